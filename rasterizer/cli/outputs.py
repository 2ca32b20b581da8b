"""What is written. Names and formats are known and checked before the first model is loaded. A file appears whole or
not at all, those of a picture together, and never in place of one that the run is to read, or has read.
"""

import os
import sys
from contextlib import suppress
from dataclasses import replace
from itertools import chain, groupby
from operator import attrgetter
from pathlib import Path
from string import Formatter
from typing import NamedTuple

from ..choices import ARRAY_SUFFIXES
from ..errors import OutputError, SceneError
from ..io import formats
from ..io.files import identity_of, refuse_inputs, write_outputs
from .messages import STDIO, write_stdout
from .models import list_models
from .request import is_name, seed_of, suffix_of

_HOW_TO_DIFFER = (
    "give -o a template with {stem}, {view}, {ext}, {folder} or {array}, or the folder above them in the place of both"
)
_ENCODING = {"JPEG": {"quality": 92}}


# --- which pictures there are, and their names ------------------------------------------------------------------------


class Target(NamedTuple):
    """One file to make."""

    model: str  # path, or - for stdin
    view: str | None  # a name out of VIEWS; None = the angles or the eye given
    output: str | None  # path, - for stdout, or None where no file is asked for
    frame: int | None = None  # number of a picture among those of a round
    arrays: tuple[str, ...] | None = None  # that are asked for; None = a picture, or what the suffix says
    seed: int | None = None  # of what is random about the view


def plan_targets(request, check=None, n_frame=None) -> list[list[Target]]:
    """List the pictures of each model.

    Parameters
    ----------
    request : Request
    check : called with a path or -, and the arrays that are asked for or None; raises SceneError where they can't be
        written; None = `check_output`
    n_frame : of a moving picture, each of which has a file where {frame} is in the name

    Returns
    -------
    for each model the list of its targets, those of a view one after the other

    Raises
    ------
    SceneError : two pictures of one name, a template that is not legal, a format that is unknown, a terminal
        for stdout or stdin
    OutputError : a folder that can't be made, an output that would replace one of the models, or another file that was
        asked for
    ModelError : such a model, of a format that no model has
    """
    models, views, files = list_models(request), request.views, request.files.asked
    if files[0][0] is None and not request.files.always_writes:
        return [[Target(model, view, None) for view in views] for model in models]
    _check_format(request)
    frames = range(n_frame) if n_frame is not None and writes_frames(request) else [None]
    plan = []
    for model in models:
        name = _default_name(request, model)
        of_files = []  # the template of each file, and which arrays it holds: one, where {array} is in it
        for output, arrays in files:
            template = _template(output, name, arrays, request)
            parts = [(each,) for each in arrays] if arrays and "array" in fields_of(template) else [arrays]
            of_files += zip([template] * len(parts), parts, strict=True)
        targets = []
        for view in views:
            seed = request.seed_of_lights if seed_of(view) is None else seed_of(view)
            for frame in frames:
                for template, arrays in of_files:
                    output = _fill(template, model, view, frame, arrays, request)
                    targets.append(Target(model, view, output, frame, arrays, seed))
        plan.append(targets)
    _check_targets(list(chain.from_iterable(plan)), models, request, check or check_output)
    return plan


def fields_of(template) -> set[str]:
    """Return the names in braces that a template has; none where it is not legal."""
    with suppress(ValueError):
        return {name for _, name, *_ in Formatter().parse(template or "") if name is not None}
    return set()


def by_view(targets) -> list[list[Target]]:
    """Return the targets of a model in a list for each view: their files come from one frame."""
    return [list(group) for _, group in groupby(targets, attrgetter("view"))]


def without(plan, is_left_out) -> tuple[list[list[Target]], int]:
    """Return a plan without the targets for which `is_left_out` is true, and how many these are."""
    rest = [[target for target in row if not is_left_out(target)] for row in plan]
    return [row for row in rest if row], sum(map(len, plan)) - sum(map(len, rest))


def plan_sheet(request) -> list[list[Target]]:
    """List the pictures of each model that one sheet shows: all have its output.

    Raises what `plan_targets` does; models that have one name are no fault here.
    """
    models = list_models(request)
    name = request.files.default_name if len(models) == 1 else "sheet"
    template = _template(request.files.output, name, None, replace(request, views=(None,)))
    output = _fill(template, models[0], None, None, None, request)
    plan = [[Target(model, view, output) for view in request.views] for model in models]
    _check_targets(plan[0][:1], models, request, check_picture)
    return plan


def writes_frames(request) -> bool:
    """Tell whether a command that makes moving pictures is to write a file for each frame: {frame} is in the name."""
    return "frame" in fields_of(request.files.output)


def _default_name(request, model) -> str:
    """Return the name of a model's picture, without a suffix. That of a model in a folder that was given stays in
    folders of these names, and has the model's suffix, so that it never depends on what else is in the folder."""
    folder = _folder_below(model, request)
    if folder is None:
        return request.files.default_name
    name = request.files.default_name.replace("{stem}", "{stem}.{ext}")
    return os.path.join(_escaped(folder), name) if folder else name


def _folder_below(model, request) -> str | None:
    """Return where a model lies below a folder that was given, "" where it lies in it; None of another model."""
    for folder in request.models if request.is_recursive else ():
        if model not in request.models and os.path.isdir(folder):
            below = os.path.relpath(os.path.dirname(model) or ".", folder)
            if not below.startswith(os.pardir):
                return "" if below == os.curdir else below
    return None


def _escaped(text) -> str:
    """Text that a template shows as it is."""
    return text.replace("{", "{{").replace("}", "}}")


def _check_format(request) -> None:
    """Refuse --format where all files have names of their own, and one of them another format or none."""
    files, names = request.files, [output for output, _ in request.files.asked]
    if files.format is None:
        return
    is_any_folder, format = not all(map(is_name, names)), files.format.lower().lstrip(".")
    for output in (output for output in names if output and is_name(output) and output != STDIO):
        suffix = suffix_of(output)
        if not suffix or not (is_any_folder or _format_of(suffix) == _format_of(format)):
            where = "of files in a folder, without -o, or on stdout"
            folder = "" if suffix else f"; a folder is written {os.path.join(output, '')}"
            raise SceneError(f"--format is that {where}; given --format {files.format} and -o {output}{folder}")


def _format_of(suffix) -> str:
    """Return the format of a suffix: of pictures Pillow's name, which several have."""
    from ..io.formats import picture_format

    return suffix if suffix in ARRAY_SUFFIXES else picture_format(suffix)


def _template(output, name, arrays, request) -> str:
    """Return an output of a model as a template with a suffix.

    Parameters
    ----------
    output : what -o says; None = the default, in the current folder
    name : the model's default name, without a suffix
    arrays : what it holds; None = a picture, or what the suffix says
    """
    if output == "":
        raise SceneError("-o needs a name; given nothing")
    if is_name(output):
        return output
    view = "-{view}" if len(request.views) > 1 else ""
    suffix = request.files.default_suffix if arrays is None else ".npy" if len(arrays) == 1 else ".npz"
    if request.files.format is not None:
        suffix = f".{request.files.format.lower().lstrip('.')}"
    return os.path.join("" if output is None else _escaped(output), name + view + suffix)


def _fill(template, model, view, frame, arrays, request) -> str:
    """Put a model's and a view's name, the number of a frame, and the name of an array, into the template."""
    path = Path(model)
    is_stdin = model == STDIO
    values = {
        "stem": "stdin" if is_stdin else path.stem or "model",  # "." is no model, which is said when it is loaded
        "ext": request.appearance.format if is_stdin else path.suffix.lstrip("."),
        "folder": _folder_below(model, request) or os.curdir,
        "view": view or ("view" if request.viewpoint.eye is None else "eye"),
    }
    if frame is not None:
        values["frame"] = frame
    if arrays is not None:
        values["array"] = "-".join(arrays)

    with suppress(ValueError, MemoryError):
        if fields_of(template) <= values.keys():
            return template.format_map(values)
    legal = ", ".join(f"{{{name}}}" for name in values)
    padded = "{stem:_>9} for at least 9 letters"
    raise SceneError(f"-o may hold {legal}, padded as in {padded}, and {{{{ }}}} for braces; given {template!r}")


def _check_targets(targets, models, request, check) -> None:
    """Refuse what can't be written, before anything is drawn: see `plan_targets`."""
    checked, n_stdout = set(), 0
    for target in targets:
        n_stdout += target.output == STDIO
        kind = Path(target.output).suffix.lower(), target.arrays
        if kind not in checked:
            checked.add(kind)
            check(request.files.named(target.output), target.arrays)
    if not n_stdout:
        _check_places(targets, models, request)
    elif len(targets) > 1:
        raise SceneError(f"stdout takes one picture; {len(targets)} are asked for")
    elif sys.stdout is not None and sys.stdout.isatty():
        raise SceneError("stdout is a terminal; send it to a file or a program")


def _check_places(targets, models, request) -> None:
    """Refuse two pictures of one name, folders that can't be made, and outputs that are models, or other files that are
    named for reading."""
    owners, read = {}, {identity_of(path): path for path in (*models, *request.read)}
    read.pop(None, None)  # of what isn't there
    for target in targets:
        place = os.path.realpath(target.output)
        identity = identity_of(place)
        other = owners.setdefault(identity or place, target)
        if other is not target:
            which = " and ".join(f"{t.model} ({t.view})" if t.view else t.model for t in (other, target))
            raise SceneError(f"{which} would both be written to {target.output}; {_HOW_TO_DIFFER}")
        folder = os.path.dirname(place)
        while not os.path.lexists(folder):
            folder = os.path.dirname(folder)
        if not os.path.isdir(folder):
            raise OutputError(f"can't write {target.output}: {folder} is no folder")
        if identity in read:
            if read[identity] in models:  # a picture in the place of a model: that no model is read from it says more
                formats.format_of(read[identity], request.appearance.format)
            refuse_inputs([target.output], read)


# --- pictures and arrays ----------------------------------------------------------------------------------------------


def check_output(output, array) -> None:
    """Raise SceneError where an output has no format of pictures, or of the arrays that `array` lists, before anything
    is drawn."""
    suffix = suffix_of(output)
    if output == STDIO:
        return
    if (array and not is_picture_of(suffix, array)) or suffix in ARRAY_SUFFIXES:
        _check_arrays(suffix, output, array)
        return
    try:
        formats.picture_format(Path(output).suffix.lower())
    except OutputError as error:
        folder = "" if suffix else f"; a folder is written {os.path.join(output, '')}"
        raise SceneError(f"{output}: {error}{folder}") from None


def check_picture(output, _) -> None:
    """Raise SceneError where an output has no format of pictures, before anything is drawn: of a command that writes no
    arrays."""
    if suffix_of(output) in ARRAY_SUFFIXES:
        raise SceneError(f"pictures are written, no arrays; given {output}")
    check_output(output, None)


def _check_arrays(suffix, output, names) -> None:
    """Refuse what a file of arrays can't hold."""
    from ..io.array_files import check_arrays

    names = names or ("color",)
    try:
        check_arrays(names, suffix)
    except (SceneError, OutputError) as fault:
        hint = "; {array} in its name makes a file of each" if len(names) > 1 and suffix in ("npy", "png") else ""
        raise SceneError(f"{output}: {fault}{hint}") from None


def is_picture_of(suffix, arrays) -> bool:
    """Tell whether a file of this suffix holds "rgb", and can hold nothing but a picture."""
    return tuple(arrays) == ("rgb",) and suffix not in (*ARRAY_SUFFIXES, "png", "")


def check_scale(files) -> None:
    """Refuse a scale for anything but the depth in a PNG file, or one that is not above 0."""
    suffixes = [(suffix_of(files.named(output)), names) for output, names in files.asked]
    if not any(suffix == "png" and "depth" in (names or ()) for suffix, names in suffixes):
        raise SceneError("--scale is that of depth in a PNG file: it needs --array depth and -o NAME.png")
    if files.scale != "auto" and not files.scale > 0:
        raise SceneError(f"--scale must be a number above 0; given {files.scale:g}")


def encode_picture(frame, output) -> bytes:
    """Return a picture as the bytes of a file, in the format of its output's suffix; PNG for stdout."""
    name = "PNG" if output == STDIO else formats.picture_format(Path(output).suffix)
    return frame.encode(name, **_ENCODING.get(name, {}))


def encode_sheet(image, output) -> bytes:
    """Return a sheet, an image of Pillow, as `encode_picture` does."""
    import numpy as np

    from ..frame import Frame

    return encode_picture(Frame(np.asarray(image.convert("RGBA")), {}, None, image.size), output)


def encode_target(frame, target, outputs, files) -> bytes:
    """Return a picture or arrays of a frame as the bytes of a file, as `Frame.save` writes it; on stdout PNG, one array
    .npy, several .npz, unless --format says another. EXR files of colour have alpha.

    Parameters
    ----------
    outputs : of the frame, which a file of arrays holds where none are asked for
    files : Files, which says the scale of depth in PNG files, and whether pictures have a colour bar
    """
    output = files.named(target.output)
    suffix = suffix_of(output)
    names = target.arrays or (outputs if suffix in ARRAY_SUFFIXES else None)
    if names is None or is_picture_of(suffix, names):
        return encode_picture(frame.with_colorbar() if files.colorbar else frame, output)
    if files.colorbar and names == ("rgb",):
        frame = frame.with_colorbar()
    if output == STDIO:
        suffix = "npy" if len(names) == 1 else "npz"
    if suffix == "exr" and "color" in names:
        names = (*names, "alpha")
    return frame.encode_arrays(names, suffix, files.scale if suffix == "png" and names == ("depth",) else None)


# --- files ------------------------------------------------------------------------------------------------------------


class Outputs:
    """Write the outputs of a run, never in place of what it has read.

    Parameters
    ----------
    plan : list of lists of Target, as `plan_targets` returns it
    results : Results of the run, for who draws; None = nobody tells what is done

    files_read : list that takes the paths of the files that models read
    """

    def __init__(self, plan, results=None):
        self.results, self._inputs = results, {}
        self.files_read = [targets[0].model for targets in plan if targets[0].model != STDIO]

    def write(self, contents) -> None:
        """Write the files of a picture, dict of bytes by name, all of them or none; - is stdout.

        Raises OutputError where one can't be written, or would replace what is read.
        """
        if STDIO in contents:
            write_stdout(contents[STDIO])
            return
        while self.files_read:
            path = self.files_read.pop()
            self._inputs[identity_of(path)] = path
        write_outputs(contents, self._inputs)
