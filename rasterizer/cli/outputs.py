"""What is written. Names and formats are known and checked before the first model is loaded. A file appears whole or
not at all, and never in place of one that the run reads, nor of another output of the run.

Which other files a model reads (materials, textures, buffers, parts of a scene) is known once it has been loaded. So an
output that exists already, where a later model may read it, waits until all models have been loaded. Unless
--allow-outside is given, a model can only read what lies in its own folder, and only some formats name other files at
all: in most runs nothing waits.
"""

import os
import re
import signal
import sys
import threading
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

from ..choices import ARRAY_SUFFIXES, BUFFERS, RANDOM
from ..errors import OutputError, SceneError
from ..io import formats
from ..io.files import identity_of, write_whole
from .flags import EVERY
from .messages import STDIO, write_stdout
from .models import list_models
from .values import seed_of

_ENCODING = {"JPEG": {"quality": 92}}
_MAX_LETTERS = 255  # to which a name is padded: file systems take no longer ones
_IN_MEMORY = 2**26  # bytes that wait in memory; more go into a file without a name
_TERMINATED = 128 + 15  # exit code of a process that SIGTERM has ended


# --- which pictures there are, and their names ------------------------------------------------------------------------


class Target(NamedTuple):
    """One file to make."""

    model: str  # path, or - for stdin
    view: str | None  # a name out of VIEWS; None = the angles or the eye given
    output: str | None  # path, - for stdout, or None where no file is asked for
    frame: int | None = None  # number of a picture among those of a round
    arrays: tuple[str, ...] | None = None  # that are asked for; None = a picture, or what the suffix says
    seed: int | None = None  # of what is random about the view


def plan_targets(arguments, check=None) -> list[list[Target]]:
    """List the pictures of each model.

    Parameters
    ----------
    arguments : those of the command; `default_name` is the template of a name without suffix, and `always_writes` says
        whether there is an output where none is asked for
    check : called with a path or -, and the arrays that are asked for or None; raises SceneError where they can't be
        written; None = `check_output`

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
    models = list_models(arguments)
    views = arguments.views or [None]
    files = asked_files(arguments)
    if files[0][0] is None and not arguments.always_writes:
        return [[Target(model, view, None) for view in views] for model in models]
    templates = [_templates(arguments, models, *each) for each in files]
    frames = range(arguments.frames) if writes_frames(arguments) else [None]
    plan = [
        [
            Target(
                model, view, _fill(template, model, view, frame, part, arguments), frame, part, _seed(view, arguments)
            )
            for view in views
            for frame in frames
            for template, (_, names) in zip(row, files, strict=True)
            for part in _parts(template, names)
        ]
        for model, row in zip(models, zip(*templates, strict=True), strict=True)
    ]
    _check_targets([target for row in plan for target in row], models, arguments, check or check_output)
    return plan


def _seed(view, arguments) -> int | None:
    """Return the seed of a random view, or of the random lights of another one."""
    seed = seed_of(view)
    return arguments.seed if seed is None and RANDOM in arguments.lights and hasattr(arguments, "seed") else seed


def asked_files(arguments) -> list[tuple[str | None, tuple[str, ...] | None]]:
    """Return (output, arrays) for each -o, as `_templates` takes both; SceneError where --array stands after the last
    of several, or an output has none that needs some."""
    files, every = getattr(arguments, "files", ()), expand_arrays(arguments.outputs)
    if len(files) < 2:
        return [(arguments.output, every)]
    if sum(len(names) for _, names in files) < len(arguments.outputs or ()):
        raise SceneError(f"with several -o, --array stands before its own; given one after -o {files[-1][0]}")
    for output, names in files:
        if not names and suffix_of(output) in ARRAY_SUFFIXES:
            raise SceneError(f"with several -o, --array stands before its own; given none for -o {output}")
    return [(output, expand_arrays(names)) for output, names in files]


def _parts(template, names) -> list[tuple[str, ...] | None]:
    """Return which arrays each file of a template holds: one, where {array} is in it."""
    return [(name,) for name in names] if names and has_field(template, "array") else [names]


def has_field(template, name) -> bool:
    """Tell whether a template has a field in braces."""
    return bool(re.search(r"(?<!\{)(\{\{)*\{" + name + "[:}]", template or ""))


def by_view(targets) -> list[list[Target]]:
    """Return the targets of a model in a list for each view: their files come from one frame."""
    return [list(group) for _, group in groupby(targets, lambda target: target.view)]


def without(plan, is_left_out) -> tuple[list[list[Target]], int]:
    """Return a plan without the targets for which `is_left_out` is true, and how many these are."""
    rest = [[target for target in row if not is_left_out(target)] for row in plan]
    return [row for row in rest if row], sum(map(len, plan)) - sum(map(len, rest))


def plan_sheet(arguments) -> list[list[Target]]:
    """List the pictures of each model that one sheet shows: all have its output.

    Raises what `plan_targets` does; models that have one name are no fault here.
    """
    models = list_models(arguments)
    name = (arguments.default_name if len(models) == 1 else "sheet") + arguments.default_suffix
    template = _put_in_folder(arguments.output, name)
    output = _fill(template, models[0], None, None, None, arguments)
    views = arguments.views or [None]
    plan = [[Target(model, view, output) for view in views] for model in models]
    _check_targets(plan[0][:1], models, arguments, check_output)
    return plan


def writes_frames(arguments) -> bool:
    """Tell whether a command that makes moving pictures is to write a file for each frame: {frame} is in the name."""
    return hasattr(arguments, "frames") and has_field(arguments.output, "frame")


def _templates(arguments, models, output, arrays) -> list[str]:
    """Return an output of each model as a template with a suffix.

    Parameters
    ----------
    output : what -o says; None = a default
    arrays : what it holds; None = a picture, or what the suffix says
    """
    suffix = arguments.default_suffix if arrays is None else ".npy" if len(arrays) == 1 else ".npz"
    names = _default_names(arguments, models)
    view = "-{view}" if len(arguments.views) > 1 else ""
    return [_put_in_folder(output, name + view + suffix) for name in names]


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


def _fill(template, model, view, frame, arrays, arguments) -> str:
    """Put a model's and a view's name, the number of a frame, and the name of an array, into the template."""
    path = Path(model)
    is_stdin = model == STDIO
    values = {
        "stem": "stdin" if is_stdin else path.stem or "model",  # "." is no model, which is said when it is loaded
        "ext": arguments.input_format if is_stdin else path.suffix.lstrip("."),
        "view": view or ("eye" if arguments.eye else "view"),
    }
    if frame is not None:
        values["frame"] = frame
    if arrays is not None:
        values["array"] = "-".join(arrays)
    legal = ", ".join(f"{{{name}}}" for name in values)

    def replace(match) -> str:
        word = match[0]
        if word in ("{{", "}}"):
            return word[0]
        name, _, form = word[1:-1].partition(":")
        if name not in values or not re.fullmatch(r"(.?[<>^])?\d{0,3}", form):
            padded = f"{{stem:_>9}} for at least 9 letters, {_MAX_LETTERS} at most"
            raise SceneError(
                f"-o may hold {legal}, padded as in {padded}, and {{{{ }}}} for braces; given {template!r}"
            )
        letters = format(values[name], form)
        return letters if len(letters) <= _MAX_LETTERS else str(values[name])

    return re.sub(r"\{\{|\}\}|\{[^{}]*\}|[{}]", replace, template)


def _check_targets(targets, models, arguments, check) -> None:
    """Refuse what can't be written, before anything is drawn: see `plan_targets`."""
    for target in {(Path(each.output).suffix.lower(), each.arrays): each for each in targets}.values():
        check(target.output, target.arrays)
    if all(target.output != STDIO for target in targets):
        _check_names(targets)
        _check_reads(targets, models, arguments)
    elif len(targets) > 1:
        raise SceneError(f"stdout takes one picture; {len(targets)} are asked for")
    elif sys.stdout is not None and sys.stdout.isatty():
        raise SceneError("stdout is a terminal; send it to a file or a program")


def _check_names(targets) -> None:
    """Refuse two pictures of one name, and folders that can't be made."""
    owners = {}
    for target in targets:
        place = os.path.realpath(target.output)
        other = owners.setdefault(identity_of(place) or place, target)
        if other is not target:
            which = " and ".join(f"{t.model} ({t.view})" if t.view else t.model for t in (other, target))
            raise SceneError(f"{which} would both be written to {target.output}; {_how_to_differ(other, target)}")
        folder = os.path.dirname(place)
        while not os.path.lexists(folder):
            folder = os.path.dirname(folder)
        if not os.path.isdir(folder):
            raise OutputError(f"can't write {target.output}: {folder} is no folder")


def _how_to_differ(a, b) -> str:
    """What keeps two pictures apart: what differs between them, in their names; or folders."""
    pairs = {
        "stem": [Path(each.model).stem for each in (a, b)],
        "view": [each.view for each in (a, b)],
        "ext": [Path(each.model).suffix for each in (a, b)],
        "array": [each.arrays for each in (a, b)],
    }
    apart = [name for name, (one, other) in pairs.items() if one != other]
    if apart:
        words = "-".join(f"{{{name}}}" for name in dict.fromkeys(["stem", *apart]))
        return f"give -o a template such as '{words}.png'"
    if identity_of(a.model) == identity_of(b.model):
        return "a model is drawn once"
    return "--recursive with the folder above them keeps folders, else draw them one at a time"


def _check_reads(targets, models, arguments) -> None:
    """Refuse outputs that are models, or other files that are named for reading, by whatever name or link."""
    textures = [given["texture"] for given in arguments.materials if given.get("texture")]
    paths = [model for model in models if model != STDIO] + textures
    paths += [arguments.camera_file] if getattr(arguments, "camera_file", None) else []
    read = {identity_of(path): path for path in paths}
    read.pop(None, None)
    for target in targets:
        identity = identity_of(target.output)
        if identity in read:
            if read[identity] in models:  # a picture in the place of a model: that no model is read from it says more
                formats.format_of(read[identity], arguments.input_format)
            raise _would_replace(target.output, read[identity])


def _would_replace(output, path) -> OutputError:
    return OutputError(f"can't write {output}: it is {path}, which is read; give another name with -o")


# --- pictures and arrays ----------------------------------------------------------------------------------------------


def suffix_of(output) -> str:
    """Return the suffix of an output, small letters without the point; "" where there is no output."""
    return Path(output or "").suffix.lower().lstrip(".")


def holds_arrays(arguments) -> bool:
    """Tell whether arrays are written, and no picture."""
    return bool(arguments.outputs) or suffix_of(arguments.output) in ARRAY_SUFFIXES


def needed_outputs(arguments) -> tuple[str, ...]:
    """Return the outputs of `Options` that the files need."""
    names = expand_arrays(arguments.outputs)
    if names is None:
        return ("color",) if holds_arrays(arguments) else ("rgb",)
    is_picture = any(not arrays for _, arrays in asked_files(arguments))
    return names if "rgb" in names or not is_picture else ("rgb", *names)


def expand_arrays(names) -> tuple[str, ...] | None:
    """Return the arrays that are asked for, each once; None where none are named."""
    if not names:
        return None
    names = (names,) if isinstance(names, str) else names
    every = ("color", *BUFFERS)
    return tuple(dict.fromkeys(name for given in names for name in (every if given == EVERY else (given,))))


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


def _check_arrays(suffix, output, names) -> None:
    """Refuse what a file of arrays can't hold."""
    from ..io.array_files import check_arrays

    names = expand_arrays(names) or ("color",)
    try:
        check_arrays(names, suffix)
    except (SceneError, OutputError) as fault:
        hint = "; {array} in its name makes a file of each" if len(names) > 1 and suffix in ("npy", "png") else ""
        raise SceneError(f"{output}: {fault}{hint}") from None


def is_picture_of(suffix, arrays) -> bool:
    """Tell whether a file of this suffix holds "rgb", and can hold nothing but a picture."""
    return tuple(arrays) == ("rgb",) and suffix not in (*ARRAY_SUFFIXES, "png", "")


def check_scale(arguments) -> None:
    """Refuse a scale for anything but the depth in a PNG file, or one that is not above 0."""
    has_png = any(
        suffix_of(output) == "png" and ("depth",) in _parts(output, names) for output, names in asked_files(arguments)
    )
    if arguments.scale is not None and not has_png:
        raise SceneError("--scale is that of depth in a PNG file: it needs --array depth and -o NAME.png")
    if arguments.scale is not None and not arguments.scale > 0:
        raise SceneError(f"--scale must be a number above 0; given {arguments.scale:g}")


def encode_picture(frame, output) -> bytes:
    """Return a picture as the bytes of a file, in the format of its output's suffix; PNG for stdout."""
    name = "PNG" if output == STDIO else formats.picture_format(Path(output).suffix)
    return frame.encode(name, **_ENCODING.get(name, {}))


def encode_sheet(image, output) -> bytes:
    """Return a sheet, an image of Pillow, as `encode_picture` does."""
    import numpy as np

    from ..frame import Frame

    return encode_picture(Frame(np.asarray(image.convert("RGBA")), {}, None, image.size), output)


def encode_target(frame, target, outputs, scale) -> bytes:
    """Return a picture or arrays of a frame as the bytes of a file, as `Frame.save` writes it; on stdout PNG, one array
    .npy, several .npz. EXR files of colour have alpha.

    Parameters
    ----------
    outputs : of the frame, which a file of arrays holds where none are asked for
    scale : of depth in PNG files; None = the default
    """
    suffix = suffix_of(target.output)
    names = target.arrays or (outputs if suffix in ARRAY_SUFFIXES else None)
    if names is None or is_picture_of(suffix, names):
        return encode_picture(frame, target.output)
    if target.output == STDIO:
        suffix = "npy" if len(names) == 1 else "npz"
    if suffix == "exr" and "color" in names:
        names = (*names, "alpha")
    return frame.encode_arrays(names, suffix, scale if suffix == "png" and names == ("depth",) else None)


# --- files ------------------------------------------------------------------------------------------------------------


class Outputs:
    """Write the outputs of a run; a context manager.

    Parameters
    ----------
    plan : list of lists of Target, as `plan_targets` returns it
    arguments : those of the command
    """

    def __init__(self, plan, arguments):
        models = [targets[0].model for targets in plan]
        self.files_read = {identity_of(model): model for model in models if model != STDIO}
        self._written, self._waiting, self._store = {}, [], None
        self.unwritten = set()  # names of outputs that wait, or couldn't be written once they had
        self._later = []  # for each model the folders in which later ones may read
        below = []
        for model in reversed(models):
            self._later.insert(0, list(below))
            format = formats.find(arguments.input_format or Path(model).suffix)
            if format is not None and format.companions:  # its files may name others
                folder = os.path.realpath("." if model == STDIO else os.path.dirname(model) or ".")
                below.append(os.sep if arguments.allow_outside else folder)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        """Write what waits, also after an interrupt: what hasn't been loaded will not be read any more."""
        self.finish(None)

    def of_model(self, number, results=None) -> "ModelOutput":
        """Return what writes the outputs of one model of the plan; `results` are told what is done."""
        return ModelOutput(self, number, results)

    def write(self, content, output, number) -> None:
        """Write an output of a model; raises OutputError where it would replace what is read or was written."""
        if output == STDIO:
            write_stdout(content)
            return
        self._check(output)
        if self._must_wait(output, number):
            if self._store is None:
                from tempfile import SpooledTemporaryFile  # most runs have no need of it

                self._store = SpooledTemporaryFile(_IN_MEMORY)  # noqa: SIM115  lives with the run
            self.unwritten.add(output)
            self._waiting.append((output, self._store.seek(0, os.SEEK_END), len(content)))
            self._store.write(content)
        else:
            self._write(content, output)

    def _must_wait(self, output, number) -> bool:
        """Tell whether there is a file that a model after model `number` may read."""
        place = os.path.realpath(output)
        return os.path.isfile(place) and any(Path(place).is_relative_to(folder) for folder in self._later[number])

    def _check(self, output) -> None:
        identity = identity_of(output)
        if identity is None:
            return
        if identity in self.files_read:
            raise _would_replace(output, self.files_read[identity])
        if identity in self._written and os.path.isfile(output):
            raise OutputError(f"can't write {output}: it is {self._written[identity]}, which has just been written")

    def _write(self, content, output) -> None:
        folder = os.path.dirname(os.path.realpath(output))
        try:
            os.makedirs(folder, exist_ok=True)
        except OSError as error:
            what = f"can't write {output}: can't make the folder {folder}"
            raise OutputError(f"{what}: {error.strerror or error}") from error
        with _cleaning_up():
            write_whole(output, content)
        self._written[identity_of(output)] = output

    def finish(self, messages) -> list[OutputError]:
        """Write what waits; return what failed, after telling it."""
        failures, waiting = [], self._waiting
        self._waiting = []
        for output, start, length in waiting:
            try:
                self._check(output)
                self._store.seek(start)
                self._write(self._store.read(length), output)
                self.unwritten.discard(output)
            except OutputError as error:
                failures.append(error)
                if messages is not None:
                    messages.error(error)
        return failures


class ModelOutput:
    """Write the outputs of one model; `files_read` is a list that takes the paths of the files it reads, `results` the
    Results of the run."""

    def __init__(self, outputs, number, results=None):
        self._outputs, self._number, self.files_read, self.results = outputs, number, [], results

    def write(self, content, output) -> None:
        """Write an output, as `Outputs.write` does."""
        self._outputs.files_read |= {identity_of(path): path for path in self.files_read}
        self._outputs.write(content, output, self._number)


@contextmanager
def _cleaning_up():
    """Let SIGTERM end the process by an exception inside the block, so that no half file stays."""

    def stop(*_):
        raise SystemExit(_TERMINATED)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
