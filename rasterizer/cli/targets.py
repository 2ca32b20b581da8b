"""Which models are drawn and where their pictures go, known and checked before the first model is loaded."""

import glob
import os
import re
import sys
from pathlib import Path
from typing import NamedTuple

from ..errors import OutputError, SceneError
from ..io.files import identity_of

STDIO = "-"
_MOST_LETTERS = 255  # to which a name is padded: file systems take no longer ones


class Target(NamedTuple):
    """One picture to make."""

    model: str  # path, or - for stdin
    view: str | None  # a name out of VIEWS; None = the angles or the eye given
    output: str  # path, - for stdout, or "" where no file is asked for


def plan_targets(arguments, check_suffix=None) -> list[list[Target]]:
    """List the pictures of each model; `check_suffix(suffix, output, array)` refuses what can't be written, None = what
    is no format of pictures or arrays.

    Raises
    ------
    SceneError : two pictures of one name, a template that is not legal, a format that is unknown, a terminal
        for stdout or stdin
    OutputError : a folder that doesn't exist, an output that would replace one of the models, or a texture that was
        asked for
    """
    models = _expand(arguments.models)
    _check_stdin(models, arguments.input_format)
    views = arguments.views or [None]
    template = _template(arguments)
    plan = [[Target(model, view, _fill(template, model, view, arguments)) for view in views] for model in models]
    targets = [target for row in plan for target in row]
    if template == STDIO and check_suffix is None:
        _check_stdout(len(targets))
    elif template:
        for suffix, output in {Path(target.output).suffix.lower(): target.output for target in targets}.items():
            (check_suffix or _check_suffix)(suffix, output, arguments.outputs)
        _check_names(targets)
        textures = [given["texture"] for given in arguments.materials if given.get("texture")]
        _check_reads(targets, [model for model in models if model != STDIO] + textures)
    return plan


def _expand(patterns) -> list[str]:
    """Replace patterns by the files that match, in order; a name that exists, or matches nothing, stays."""
    models = []
    for pattern in patterns:
        is_pattern = glob.has_magic(pattern) and not os.path.exists(pattern)
        models += (is_pattern and sorted(glob.glob(pattern, recursive=True))) or [pattern]
    return models


def _template(arguments) -> str:
    """The output as a template with a suffix; "" where none is asked for, and none has a default."""
    if arguments.output is None and arguments.default_name is None:
        return ""
    suffix = ".npy" if arguments.outputs else ".png"
    name = (arguments.default_name or "{stem}-bench") + ("-{view}" if len(arguments.views) > 1 else "") + suffix
    output = arguments.output
    if output is None:
        return name
    if output == "":
        raise SceneError("-o needs a name; given nothing")
    is_folder = output.endswith(("/", os.sep)) or os.path.isdir(output)
    return os.path.join(output.replace("{", "{{").replace("}", "}}"), name) if is_folder else output


def _fill(template, model, view, arguments) -> str:
    """Put a model's and a view's name into the template."""
    path = Path(model)
    is_stdin = model == STDIO
    values = {
        "stem": "stdin" if is_stdin else path.stem,
        "ext": arguments.input_format if is_stdin else path.suffix.lstrip("."),
        "view": view or ("eye" if arguments.eye else "view"),
    }
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
        return letters if len(letters) <= _MOST_LETTERS else values[name]

    return re.sub(r"\{\{|\}\}|\{[^{}]*\}|[{}]", replace, template)


def _check_suffix(suffix, output, array) -> None:
    """Refuse a format that can't be written, before anything is drawn."""
    if suffix == ".npy":
        return
    if array:
        raise SceneError(f"an array is written as .npy; given {output} for --array {array}")
    from ..frame import picture_format

    try:
        picture_format(suffix)
    except OutputError as error:
        raise SceneError(f"{output}: {error}") from None


def _check_reads(targets, paths) -> None:
    """Refuse outputs that are models, or other files that are named for reading, by whatever name or link."""
    read = {identity_of(path): path for path in paths}
    read.pop(None, None)
    for target in targets:
        identity = identity_of(target.output)
        if identity in read:
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


def _check_names(targets) -> None:
    """Refuse two pictures of one name, and folders that don't exist."""
    owners = {}
    for target in targets:
        place = os.path.realpath(target.output)
        other = owners.setdefault(identity_of(place) or place, target)
        if other is not target:
            which = " and ".join(f"{t.model} ({t.view})" if t.view else t.model for t in (other, target))
            raise SceneError(
                f"{which} would both be written to {target.output}; give -o a template such as "
                "'{stem}-{view}.png' or '{stem}-{ext}.png'"
            )
        folder = os.path.dirname(place)
        if not os.path.isdir(folder):
            raise OutputError(f"can't write {target.output}: there is no folder {folder}")
