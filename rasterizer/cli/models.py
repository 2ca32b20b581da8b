"""Which models are read, and how each is loaded."""

import glob
import os
import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from ..errors import ModelError, SceneError, collected_warnings, named_in_errors
from ..io import formats
from ..io.loader import SceneFile, doubt_of_up, read_source
from ..io.model_file import noticing_progress
from ..scene.scene import Scene
from .messages import STDIO, VERBOSE, Bar
from .request import Request

_LONG = 1.0  # seconds of reading a file, after which a bar is shown


def list_models(request) -> list[str]:
    """List the models that are read, patterns replaced by the files that match, in order, and folders, with
    --recursive, by the models in them; a name that exists, or matches nothing, stays.

    Raises SceneError where stdin can't be one.
    """
    models = []
    for word in request.models:
        is_pattern = glob.has_magic(word) and not os.path.exists(word)
        for model in (is_pattern and sorted(glob.glob(word, recursive=True))) or [word]:
            is_folder = request.is_recursive and os.path.isdir(model)
            models += _walk(model, request.files.may_be_empty) if is_folder else [model]
    if STDIO in models:
        if models.count(STDIO) > 1:
            raise SceneError("stdin (-) can be read once only")
        if request.appearance.format is None:
            raise SceneError("a model from stdin needs --input-format")
        if sys.stdin is None or sys.stdin.isatty():
            raise SceneError("stdin is a terminal; pipe a model into it")
    return models


def _walk(folder, may_be_empty) -> list[str]:
    """List the models in a folder and in those below, in order; what is hidden is left out, and so are scene files, as
    not every JSON file is one.

    Raises SceneError where there is none, unless it may be empty.
    """
    found = []
    for path, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(names):
            entry = None if name.startswith(".") else formats.find(Path(name).suffix)
            if entry is not None and not entry.is_scene:
                found.append(os.path.join(path, name))
    if not found and not may_be_empty:
        raise SceneError(
            f"{folder}: there is no model in this folder, nor below; legal are {', '.join(formats.FORMATS)}"
        )
    return found


class Loaded(NamedTuple):
    """A model, ready to be drawn."""

    scene: Scene
    warnings: list[str]  # that loading gave, which were said
    request: Request  # over what a scene file says


def load_scene(model, request, messages, files_read=None, read=None) -> Loaded:
    """Load a model or scene file and change it as the request says; its warnings are said, and the paths of other files
    that were read are added to `files_read`. `read` is the model, SceneFile, where it has been read elsewhere.

    Raises
    ------
    ModelError : the file can't be read, or a mesh can't take the texture
    SceneError : a value that the file or one of its materials can't take
    """
    with collected_warnings() as texts:
        with closing(Bar(messages, _LONG)) as bar, noticing_progress(bar.show if bar.is_shown else None):
            read = _read(model, request, messages, files_read, read)
        with named_in_errors(f"{model}: options"):
            request = request.over(read)
        shading = None if request.is_compared else request.options.shading
        with named_in_errors(model):
            scene = request.appearance.change(read.scene, shading, request.options.ground, request.shadow_fields)
        if request.shadow_fields and not any(getattr(light, "shadow", None) for light in scene.lights):
            name = next(iter(request.shadow_fields))
            raise SceneError(f"--shadow-{name} needs a light that casts a shadow; with --shadows all do")
    messages.warn(*texts)
    return Loaded(scene, texts, request)


def _read(model, request, messages, files_read, read) -> SceneFile:
    """Read a model, unless `read` is it; say what is noted of its camera and its upward axis."""
    appearance, is_own = request.appearance, request.viewpoint.of_file == "file"
    if read is None:
        source = source_of(model, appearance.format)
        log = messages.detail if messages.level >= VERBOSE else None
        read = read_source(source, camera="file", **appearance.reading, log=log, files_read=files_read)
    entry, scene = formats.find(appearance.format or Path(model).suffix), read.scene
    if entry is not None and entry.is_scene:
        is_dropped = request.is_up_given and not is_own  # another view is meant
    else:
        is_dropped = scene.camera is not None and not is_own
        if is_dropped:
            messages.notice(f"{model}: the file has a camera; the model is framed, --camera file looks through it")
        doubt = doubt_of_up(scene, model, appearance.format) if appearance.up is None else None
        if doubt is not None:
            messages.notice(f"{model}: {doubt[1]}: try --up {doubt[0]}, or auto to follow the shape")
    return read._replace(scene=replace(scene, camera=None)) if is_dropped else read


def source_of(model, input_format):
    """Return what `load` reads: a path, or the bytes of stdin.

    Raises ModelError, in the command line's own words, for a folder and for a name that doesn't tell its format.
    """
    if model == STDIO:
        try:
            return _Stdin(sys.stdin.buffer.read())
        except OSError as fault:
            raise ModelError(f"stdin can't be read ({fault.strerror or fault})") from fault
    path = Path(model)
    if os.path.isdir(path):
        raise ModelError(f"{model}: is a folder; give the models in it, e.g. '{path / '*.stl'}', or --recursive")
    if input_format is None and not path.suffix:
        if not os.path.exists(path):
            raise ModelError(f"{model}: no such file")
        raise ModelError(f"{model}: the format is unknown without a suffix; give --input-format")
    return model


class _Stdin(bytes):
    """What came from stdin; messages call it by its name."""

    name = "stdin"
