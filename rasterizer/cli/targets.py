"""Which models are drawn and where their pictures go, known and checked before the first model is loaded."""

import glob
import os
import re
import sys
from pathlib import Path
from typing import NamedTuple

from ..errors import OutputError, SceneError
from ..io import formats
from ..io.files import identity_of
from .arrays import check_arrays, default_suffix

STDIO = "-"
_MOST_LETTERS = 255  # to which a name is padded: file systems take no longer ones


class Target(NamedTuple):
    """One picture to make."""

    model: str  # path, or - for stdin
    view: str | None  # a name out of VIEWS; None = the angles or the eye given
    output: str | None  # path, - for stdout, or None where no file is asked for


def plan_targets(arguments, check_output=None) -> list[list[Target]]:
    """List the pictures of each model.

    Parameters
    ----------
    arguments : those of the command; `default_name` is the template of a name without suffix, and `always_writes` says
        whether there is an output where none is asked for
    check_output : called with a path or -, and the array that is asked for or None; raises SceneError where that can't
        be written; None = `check_picture`

    Returns
    -------
    for each model the list of its targets, one a view

    Raises
    ------
    SceneError : two pictures of one name, a template that is not legal, a format that is unknown, a terminal
        for stdout or stdin
    OutputError : a folder that can't be made, an output that would replace one of the models, or another file that was
        asked for
    ModelError : such a model, of a format that no model has
    """
    models = list_models(arguments)
    views = arguments.views or [None]
    templates = _templates(arguments, models)
    if templates is None:
        return [[Target(model, view, None) for view in views] for model in models]
    frames = range(arguments.frames) if writes_frames(arguments) else [None]
    plan = [
        [Target(model, view, _fill(template, model, view, frame, arguments)) for view in views for frame in frames]
        for model, template in zip(models, templates, strict=True)
    ]
    targets = [target for row in plan for target in row]
    for output in {Path(target.output).suffix.lower(): target.output for target in targets}.values():
        (check_output or check_picture)(output, arguments.outputs)
    if templates[0] == STDIO:
        _check_stdout(len(targets))
    else:
        _check_names(targets)
        _check_reads(targets, models, arguments)
    return plan


def list_models(arguments) -> list[str]:
    """List the models that are read, patterns replaced by the files that match; SceneError where stdin can't be one."""
    models = _expand(arguments.models)
    if getattr(arguments, "recursive", False):
        models = [found for model in models for found in (_walk(model) if os.path.isdir(model) else [model])]
    _check_stdin(models, arguments.input_format)
    return models


def _walk(folder) -> list[str]:
    """List the models in a folder and in those below, in order; what is hidden is left out, and so are scene files, as
    not every JSON file is one.

    Raises SceneError where there is none.
    """
    found = []
    for path, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(names):
            entry = None if name.startswith(".") else formats.find(Path(name).suffix)
            if entry is not None and not entry.is_scene:
                found.append(os.path.join(path, name))
    if not found:
        raise SceneError(
            f"{folder}: there is no model in this folder, nor below; legal are {', '.join(formats.names())}"
        )
    return found


def without_existing(plan) -> tuple[list[list[Target]], int]:
    """Return a plan without the outputs that are there already, and how many these are."""
    rest = [[target for target in row if not os.path.isfile(target.output)] for row in plan]
    n_left_out = sum(map(len, plan)) - sum(map(len, rest))
    return [row for row in rest if row], n_left_out


def _expand(patterns) -> list[str]:
    """Replace patterns by the files that match, in order; a name that exists, or matches nothing, stays."""
    models = []
    for pattern in patterns:
        is_pattern = glob.has_magic(pattern) and not os.path.exists(pattern)
        models += (is_pattern and sorted(glob.glob(pattern, recursive=True))) or [pattern]
    return models


def plan_sheet(arguments) -> list[list[Target]]:
    """List the pictures of each model that one sheet shows: all have its output.

    Raises what `plan_targets` does; models that have one name are no fault here.
    """
    models = list_models(arguments)
    name = (arguments.default_name if len(models) == 1 else "sheet") + arguments.default_suffix
    template = _put_in_folder(arguments.output, name)
    output = _fill(template, models[0], None, None, arguments)
    views = arguments.views or [None]
    plan = [[Target(model, view, output) for view in views] for model in models]
    check_picture(output, None)
    if output == STDIO:
        _check_stdout(1)
    else:
        _check_names(plan[0][:1])
        _check_reads(plan[0][:1], models, arguments)
    return plan


def writes_frames(arguments) -> bool:
    """Tell whether a command that makes moving pictures is to write a file for each frame: {frame} is in the name."""
    return hasattr(arguments, "frames") and bool(re.search(r"(?<!\{)(\{\{)*\{frame[:}]", arguments.output or ""))


def _templates(arguments, models) -> list[str] | None:
    """Return the output of each model as a template with a suffix; None where none is asked for, and none has a
    default."""
    if arguments.output is None and not arguments.always_writes:
        return None
    suffix = default_suffix(arguments.outputs) if arguments.outputs else arguments.default_suffix
    names = _default_names(arguments, models)
    view = "-{view}" if len(arguments.views) > 1 else ""
    return [_put_in_folder(arguments.output, name + view + suffix) for name in names]


def _default_names(arguments, models) -> list[str]:
    """Return names without a suffix: models that differ in their suffix alone get it, and what --recursive has found in
    folders below stays in folders of these names."""
    folders = [_folder_below(model, arguments) for model in models]
    keys = [(folder, Path(model).stem) for folder, model in zip(folders, models, strict=True)]
    suffixes = {}
    for key, model in zip(keys, models, strict=True):
        suffixes.setdefault(key, []).append(Path(model).suffix.lower())
    found = []
    for key in keys:
        is_shared = len(suffixes[key]) > 1 and len(set(suffixes[key])) == len(suffixes[key])
        stem = "{stem}-{ext}" if is_shared else "{stem}"
        found.append(os.path.join(_escaped(key[0]), arguments.default_name.replace("{stem}", stem)))
    return found


def _folder_below(model, arguments) -> str:
    """Return where a model lies below the folder that was given; nothing where it lies in it, or was given itself."""
    for folder in arguments.models:
        if getattr(arguments, "recursive", False) and model not in arguments.models and os.path.isdir(folder):
            below = os.path.relpath(os.path.dirname(model) or ".", folder)
            if not below.startswith(os.pardir):
                return "" if below == os.curdir else below
    return ""


def _escaped(text) -> str:
    """Text that a template shows as it is."""
    return text.replace("{", "{{").replace("}", "}}")


def _put_in_folder(output, name) -> str:
    """Return the template of an output, a default name in it where it is a folder, and that name where it is None."""
    if output is None:
        return name
    if output == "":
        raise SceneError("-o needs a name; given nothing")
    is_folder = output.endswith(("/", os.sep)) or os.path.isdir(output)
    return os.path.join(_escaped(output), name) if is_folder else output


def _fill(template, model, view, frame, arguments) -> str:
    """Put a model's and a view's name, and the number of a frame, into the template."""
    path = Path(model)
    is_stdin = model == STDIO
    values = {
        "stem": "stdin" if is_stdin else path.stem or "model",  # "." is no model, which is said when it is loaded
        "ext": arguments.input_format if is_stdin else path.suffix.lstrip("."),
        "view": view or ("eye" if arguments.eye else "view"),
    }
    if frame is not None:
        values["frame"] = frame
    legal = ", ".join(f"{{{name}}}" for name in values)

    def replace(match) -> str:
        word = match[0]
        if word in ("{{", "}}"):
            return word[0]
        name, _, form = word[1:-1].partition(":")
        if name not in values or not re.fullmatch(r"(.?[<>^])?\d{0,3}", form):
            padded = f"{{stem:_>9}} for at least 9 letters, {_MOST_LETTERS} at most"
            raise SceneError(
                f"-o may hold {legal}, padded as in {padded}, and {{{{ }}}} for braces; given {template!r}"
            )
        letters = format(values[name], form)
        return letters if len(letters) <= _MOST_LETTERS else str(values[name])

    return re.sub(r"\{\{|\}\}|\{[^{}]*\}|[{}]", replace, template)


def check_picture(output, array) -> None:
    """Raise SceneError where an output has no format of pictures, or of the arrays that `array` lists, before anything
    is drawn."""
    suffix = Path(output).suffix.lower()
    if output == STDIO:
        return
    if array or suffix in (".npy", ".npz", ".exr"):
        check_arrays(suffix, output, array)
        return
    from ..io.formats import picture_format

    try:
        picture_format(suffix)
    except OutputError as error:
        folder = "" if suffix else f"; a folder is written {os.path.join(output, '')}"
        raise SceneError(f"{output}: {error}{folder}") from None


def _list_reads(models, arguments) -> list[str]:
    """The files that are known to be read before any is loaded."""
    others = [given["texture"] for given in arguments.materials if given.get("texture")]
    others += [arguments.camera_file] if getattr(arguments, "camera_file", None) else []
    return [model for model in models if model != STDIO] + others


def _check_reads(targets, models, arguments) -> None:
    """Refuse outputs that are models, or other files that are named for reading, by whatever name or link."""
    read = {identity_of(path): path for path in _list_reads(models, arguments)}
    read.pop(None, None)
    for target in targets:
        identity = identity_of(target.output)
        if identity in read:
            if read[identity] in models:  # a picture in the place of a model: that no model is read from it says more
                formats.format_of(read[identity], arguments.input_format)
            what = f"can't write {target.output}: it is {read[identity]}, which is read"
            raise OutputError(f"{what}; give another name with -o")


def _check_stdin(models, input_format) -> None:
    if STDIO in models:
        if models.count(STDIO) > 1:
            raise SceneError("stdin (-) can be read once only")
        if input_format is None:
            raise SceneError("a model from stdin needs --input-format")
        if sys.stdin is None or sys.stdin.isatty():
            raise SceneError("stdin is a terminal; pipe a model into it")


def _check_stdout(n_target) -> None:
    if n_target > 1:
        raise SceneError(f"stdout takes one picture; {n_target} are asked for")
    if sys.stdout is not None and sys.stdout.isatty():
        raise SceneError("stdout is a terminal; send it to a file or a program")


def _way_out(a, b) -> str:
    """What keeps two pictures apart: what differs between them, in their names; or folders."""
    pairs = {
        "stem": [Path(each.model).stem for each in (a, b)],
        "view": [each.view for each in (a, b)],
        "ext": [Path(each.model).suffix for each in (a, b)],
    }
    apart = [name for name, (one, other) in pairs.items() if one != other]
    if apart:
        words = "-".join(f"{{{name}}}" for name in dict.fromkeys(["stem", *apart]))
        return f"give -o a template such as '{words}.png'"
    if identity_of(a.model) == identity_of(b.model):
        return "a model is drawn once"
    return "--recursive with the folder above them keeps folders, else draw them one at a time"


def _check_names(targets) -> None:
    """Refuse two pictures of one name, and folders that can't be made."""
    owners = {}
    for target in targets:
        place = os.path.realpath(target.output)
        other = owners.setdefault(identity_of(place) or place, target)
        if other is not target:
            which = " and ".join(f"{t.model} ({t.view})" if t.view else t.model for t in (other, target))
            raise SceneError(f"{which} would both be written to {target.output}; {_way_out(other, target)}")
        folder = os.path.dirname(place)
        while not os.path.lexists(folder):
            folder = os.path.dirname(folder)
        if not os.path.isdir(folder):
            raise OutputError(f"can't write {target.output}: {folder} is no folder")
