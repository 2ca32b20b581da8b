"""`raster sheet`: views of one model, or many models, on one labelled picture.

    models x views ─ a picture each, all of one size ─ sheet (analysis/contact_sheet.py) ─ one file

A model that fails leaves its cells empty, and its label says so.
"""

from dataclasses import fields
from pathlib import Path
from time import perf_counter

import numpy as np

from ..analysis.contact_sheet import label_width, sheet
from ..errors import SceneError
from ..frame import Frame
from ..options import Options
from ..renderer import Renderer
from .cameras_lights import camera_of, check_camera
from .defaults import SHEET_VIEWS
from .failures import Failures
from .load_scene import load_scene, make_settings, with_options
from .messages import Bar, compilation_shown, print_record
from .render_command import encode_picture, make_options
from .results import Results
from .targets import STDIO, plan_sheet
from .warnings import find_doubts
from .write_targets import Outputs


def lay_out_models(arguments, messages) -> tuple[list, int]:
    """Lay all models on one sheet; parameters and errors are those of `render_models`.

    Returns
    -------
    the failures, one error for each model that failed and for the sheet; and the number of models
    """
    start = perf_counter()
    _check_grid(arguments)
    make_options(arguments)  # what is not legal is told before a model is loaded
    settings = make_settings(arguments)
    if not arguments.views and not arguments.eye and arguments.azimuth is None and arguments.elevation is None:
        n_model = len(plan_sheet(arguments))
        arguments.views = list(SHEET_VIEWS) if n_model == 1 else []
    check_camera(arguments)
    plan = plan_sheet(arguments)
    failures, names = Failures(messages, arguments.json), _short_names([targets[0].model for targets in plan])
    pictures, labels, records = [], [], []
    with compilation_shown(messages), Outputs(plan, arguments) as outputs:
        with Bar(messages) as bar:
            for number, targets in enumerate(plan):
                bar.show(number, len(plan), f"drawing {targets[0].model}")
                n_failed = len(failures)
                with failures.caught(targets[0].model, arguments.size, targets[0].output == STDIO):
                    drawn, record = _draw(targets, arguments, settings, messages, outputs.of_model(number).files_read)
                    pictures += drawn
                    records.append(record)
                if len(failures) > n_failed:
                    pictures += [np.zeros((*arguments.size[::-1], 4), np.uint8)] * len(targets)
                labels += _labels(targets, names[number], len(plan) > 1, len(failures) > n_failed)
        if len(failures) < len(plan):
            size, n_byte = _write(pictures, labels, plan, arguments, outputs)
            results = Results(messages, 1, is_told=not arguments.json)
            results.tell(plan[0][0].output, size, n_byte, perf_counter() - start)
        failures += outputs.finish(messages)
    if arguments.json and len(failures) < len(plan):
        record = {"output": plan[0][0].output, "models": records, "seconds": round(perf_counter() - start, 4)}
        print_record(record, plan[0][0].output == STDIO)
    return failures, len(plan)


def _check_grid(arguments) -> None:
    """Raise SceneError where rows and columns can't be."""
    for name in ("columns", "rows"):
        value = getattr(arguments, name)
        if value is not None and value < 1:
            raise SceneError(f"--{name} must be at least 1; given {value}")
    if arguments.columns is not None and arguments.rows is not None:
        raise SceneError("--columns and --rows: one of them says the other; given both")
    if arguments.gap < 0:
        raise SceneError(f"--gap must be at least 0; given {arguments.gap}")


def _draw(targets, arguments, settings, messages, files_read) -> tuple[list, dict]:
    """Draw all views of one model; return the pictures, and what --json says of them."""
    loaded = load_scene(targets[0].model, arguments, settings, messages, files_read)
    scene = loaded.scene
    # A sheet's pictures are of one size, whatever a scene file says of its own.
    names = {field.name for field in fields(Options)} - {"outputs", "size"}
    arguments = with_options(arguments, loaded.options, names, targets[0].model)
    options = make_options(arguments)
    frames, doubts = [], []
    keywords = {field.name: getattr(options, field.name) for field in fields(options)}
    with Renderer(scene, **keywords) as renderer:
        for target in targets:
            camera = camera_of(arguments, target.view, scene, loaded.framing, renderer.subject)
            frames.append(renderer.render(camera))
            texts = find_doubts(frames[-1].stats, not frames[-1].rgb.any(), scene, arguments, camera)
            doubts += [f"{target.model}: {text}" for text in texts]
    for text in dict.fromkeys(doubts):
        messages.warn(text)
    record = {
        "path": targets[0].model,
        "views": [target.view for target in targets],
        "faces": scene.n_face,
        "coverage": [frame.stats.coverage for frame in frames],
        "warnings": loaded.warnings + list(dict.fromkeys(doubts)),
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


def _write(pictures, labels, plan, arguments, outputs) -> tuple[tuple[int, int], int]:
    """Lay out the sheet, and write it; return its size and the bytes of its file."""
    n, n_view = len(pictures), len(plan[0])
    columns = arguments.columns
    if arguments.rows is not None:
        columns = -(-n // arguments.rows)
    elif columns is None and len(plan) > 1 and n_view > 1:
        columns = n_view
    width = arguments.size[0] + arguments.gap
    background = arguments.background
    image = sheet(
        pictures,
        columns,
        arguments.gap,
        None if background in (None, "transparent") else background,
        [_fitted(label, width) for label in labels] if arguments.has_labels else None,
    )
    output = plan[0][0].output
    frame = Frame(np.asarray(image.convert("RGBA")), {}, None, image.size)
    content = encode_picture(frame, output)
    outputs.of_model(len(plan) - 1).write(content, output)
    return image.size, len(content)


def _fitted(label, width) -> str:
    """Cut a label in its middle, so that it is no wider than its picture: names differ at both ends."""
    if label_width(label) <= width:
        return label
    for n_letter in range(len(label) - 2, 1, -1):
        cut = f"{label[: (n_letter + 1) // 2]}...{label[len(label) - n_letter // 2 :]}"
        if label_width(cut) <= width:
            return cut
    return ""
