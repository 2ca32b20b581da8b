"""`raster sheet`: views of one model, or many models, on one labelled picture.

    models x views ─ a picture each, all of one size ─ sheet (analysis/contact_sheet.py) ─ one file

A model that fails leaves its cells empty, and its label says so.
"""

import os
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from time import perf_counter

from ..errors import SceneError
from . import values
from .flags import add_appearance, add_camera, add_models, add_output
from .messages import STDIO, Bar, Failures, Results, compilation_shown

IMPORTS = ("drawing",)
_SIZE = (320, 240)  # of one picture on a sheet
_VIEWS = ("iso", "front", "right", "back", "left", "top")  # of one model
_DESCRIPTION = f"""\
Lay pictures on one sheet, with labels: several views of one model
({", ".join(_VIEWS)} unless --view says others), or many
models from one view; with many models and several views each model has a row.
"""
_EXAMPLES = """\
examples:
  raster sheet part.stl                              part-sheet.png: six views
  raster sheet 'parts/*.stl' -o parts.png --columns 5        one picture a model
  raster sheet a.obj b.obj --view front,top -o both.png      a row a model
  raster sheet part.obj --view iso --no-labels -o - > part.png
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster sheet MODEL... [-o OUT] [options]"
    parser.description, parser.epilog = _DESCRIPTION, _EXAMPLES
    add_models(parser)
    add_output(parser, "{stem}-sheet", _SIZE, fields="{stem} {ext}")
    add = parser.add_argument_group("sheet").add_argument
    add("--columns", type=values.whole, metavar="N", help="pictures in a row (default: as many as views, or as rows)")
    add("--rows", type=values.whole, metavar="N", help="rows, instead of --columns")
    add("--gap", type=values.whole, default=8, metavar="N", help="pixels between pictures (default 8)")
    add("--no-labels", dest="has_labels", action="store_false", help="without names below the pictures")
    add_camera(parser)
    add_appearance(parser)


def run(request, messages, *, columns, rows, gap, has_labels) -> tuple[list, int]:
    """Lay all models on one sheet; parameters and errors are those of `drawing.draw_models`.

    Returns
    -------
    the failures, one error for each model that failed and for the sheet; and the number of models
    """
    import numpy as np

    from ..analysis.contact_sheet import sheet
    from .outputs import Outputs, encode_sheet, plan_sheet

    start = perf_counter()
    _check_grid(columns, rows, gap)
    request = replace(request, of_file=request.of_file - {"size"})  # its pictures are of one size
    viewpoint, plan = request.viewpoint, plan_sheet(request)
    is_framed = (
        viewpoint.camera in (None, "frame")
        and viewpoint.view is viewpoint.eye is viewpoint.azimuth is viewpoint.elevation is None
    )
    if request.views == (None,) and is_framed and len(plan) == 1:
        request = replace(request, views=_VIEWS)
        plan = plan_sheet(request)
    if request.files.skip_existing and os.path.isfile(plan[0][0].output):
        messages.notice("1 of 1 outputs are there already")
        return [], len(plan)
    failures, names = Failures(messages, request.is_json), _short_names([targets[0].model for targets in plan])
    pictures, labels, records = [], [], []
    outputs = Outputs(plan)
    with compilation_shown(messages):
        with closing(Bar(messages)) as bar:
            for number, targets in enumerate(plan):
                bar.show(number, len(plan), f"drawing {targets[0].model}")
                n_failed = len(failures)
                with failures.caught(targets[0].model, request.options.size, targets[0].output == STDIO):
                    drawn, record = _draw(targets, request, messages, outputs.files_read)
                    pictures += drawn
                    records.append(record)
                if len(failures) > n_failed:
                    pictures += [np.zeros((*request.options.size[::-1], 4), np.uint8)] * len(targets)
                labels += _labels(targets, names[number], len(plan) > 1, len(failures) > n_failed)
        if len(failures) < len(plan):
            if columns is None and len(plan) > 1 and len(plan[0]) > 1:
                columns = len(plan[0])
            columns = columns if rows is None else -(-len(pictures) // rows)
            background = None if request.appearance.background == "transparent" else request.appearance.background
            image = sheet(pictures, columns, gap, background, labels if has_labels else None)
            content = encode_sheet(image, plan[0][0].output)
            outputs.write({plan[0][0].output: content})
            results = Results(messages, 1, is_told=not request.is_json)
            results.tell(plan[0][0].output, image.size, len(content), perf_counter() - start)
    if request.is_json and len(failures) < len(plan):
        seconds = round(perf_counter() - start, 4)
        record = {"status": "drawn", "output": plan[0][0].output, "models": records, "seconds": seconds}
        messages.record(record, plan[0][0].output == STDIO)
    return failures, len(plan)


def _check_grid(columns, rows, gap) -> None:
    """Raise SceneError where rows and columns can't be."""
    for name, value in (("columns", columns), ("rows", rows)):
        if value is not None and value < 1:
            raise SceneError(f"--{name} must be at least 1; given {value}")
    if None not in (columns, rows):
        raise SceneError("--columns and --rows: one of them says the other; given both")
    if gap < 0:
        raise SceneError(f"--gap must be at least 0; given {gap}")


def _draw(targets, request, messages, files_read) -> tuple[list, dict]:
    """Draw all views of one model; return the pictures, and what --json says of them."""
    from ..renderer import Renderer
    from .drawing import picture_warnings
    from .models import load_scene

    model = targets[0].model
    loaded = load_scene(model, request, messages, files_read)
    frames, warnings = [], []
    with Renderer(loaded.scene, options=loaded.request.options) as renderer:
        for target in targets:
            camera = loaded.request.camera_of(target.view, loaded.scene, lambda: renderer.subject)
            frames.append(renderer.render(camera))
            warnings += picture_warnings(frames[-1], loaded.scene, request, camera, model)
    warnings = list(dict.fromkeys(warnings))
    messages.warn(*warnings)
    record = {
        "model": model,
        "views": [target.view for target in targets],
        "faces": loaded.scene.n_face,
        "coverage": [frame.stats.coverage for frame in frames],
        "warnings": loaded.warnings + warnings,
    }
    return [frame.rgba for frame in frames], record


def _short_names(models) -> list[str]:
    """The names of models without folder and suffix; with both where that is not enough to tell them apart."""
    stems = ["stdin" if model == STDIO else Path(model).stem for model in models]
    return [stem if stems.count(stem) == 1 else model for stem, model in zip(stems, models, strict=True)]


def _labels(targets, name, is_one_of_many, is_failed) -> list[str]:
    """What stands below the pictures of a model: its view, its name, or both where there are many of either."""
    found = []
    for target in targets:
        words = [name] if is_one_of_many else []
        words += [target.view] if target.view and len(targets) > 1 else []
        found.append(" ".join(words or [name]) + (": failed" if is_failed else ""))
    return found
