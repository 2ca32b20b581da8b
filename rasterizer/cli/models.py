"""Which models are read, and what the arguments say of how they look."""

import glob
import os
import sys
import warnings
from contextlib import contextmanager
from copy import copy
from dataclasses import fields, replace
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

from ..choices import RANDOM
from ..errors import ModelError, SceneError
from ..io import formats
from ..io.loader import read_source
from ..io.model_file import noticing_progress
from ..look import Look
from ..options import Options
from ..scene.color import linear_rgb
from ..scene.lights import Shadow
from ..scene.material import REFLECTION_MODELS
from ..scene.scene import DepthCue, Scene
from ..viewpoint import Viewpoint
from .flags import UNSAID
from .messages import STDIO, Bar
from .parser import did_you_mean
from .values import make_light

_LONG = 1.0  # seconds of reading a file, after which a bar is shown
_UNTOLD_UP = ("obj", "stl", "ply", "off")  # formats that don't say which axis points upwards
_MAX_LOOKED_AT = 50_000  # faces, when that is guessed: more make no other share of the area


def list_models(arguments) -> list[str]:
    """List the models that are read, patterns replaced by the files that match; SceneError where stdin can't be one."""
    models = _expand(arguments.models)
    if getattr(arguments, "recursive", False):
        models = [found for model in models for found in (_walk(model) if os.path.isdir(model) else [model])]
    _check_stdin(models, arguments.input_format)
    return models


def _expand(patterns) -> list[str]:
    """Replace patterns by the files that match, in order; a name that exists, or matches nothing, stays."""
    models = []
    for pattern in patterns:
        is_pattern = glob.has_magic(pattern) and not os.path.exists(pattern)
        models += (is_pattern and sorted(glob.glob(pattern, recursive=True))) or [pattern]
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


def _check_stdin(models, input_format) -> None:
    if STDIO in models:
        if models.count(STDIO) > 1:
            raise SceneError("stdin (-) can be read once only")
        if input_format is None:
            raise SceneError("a model from stdin needs --input-format")
        if sys.stdin is None or sys.stdin.isatty():
            raise SceneError("stdin is a terminal; pipe a model into it")


# --- what the arguments want of all of them ---------------------------------------------------------------------------


class Settings(NamedTuple):
    """What the arguments want of every model."""

    look: Look
    shadow_fields: dict  # fields of Shadow to replace, of lights that cast one
    has_random_lights: bool = False


class Loaded(NamedTuple):
    """A model, ready to be drawn."""

    scene: Scene
    warnings: list[str]  # that loading gave, which were said
    options: dict  # a scene file's, by the names of Options
    framing: Viewpoint | None  # a scene file's, as `camera_of` takes it
    look: Look  # the arguments', over a scene file's


def make_settings(arguments) -> Settings:
    """Read what the arguments want of every model.

    Raises
    ------
    SceneError : an argument that is wrong for every model
    ModelError : a texture that can't be read
    """
    has_random = RANDOM in arguments.lights and hasattr(arguments, "seed")
    shadow_fields = _shadow_fields(arguments)
    shadow = Shadow(**shadow_fields)  # of lights that cast one and don't say its size and filter themselves
    cue = None if arguments.depth_cue == UNSAID else "none" if arguments.depth_cue is None else arguments.depth_cue
    with _told_of("--depth-cue"):
        cue = DepthCue(**cue) if isinstance(cue, dict) else cue
    if arguments.background not in (None, "transparent"):
        linear_rgb(arguments.background, "--background")
    look = _make_look(
        arguments,
        lights=tuple(make_light(text, shadow) for text in arguments.lights if text != RANDOM or not has_random) or None,
        shadows=shadow if arguments.shadows else False,
        depth_cue=cue,
        up=None if arguments.up == "auto" else arguments.up,
        format=arguments.input_format,
    )
    return Settings(look, {} if arguments.shadows else shadow_fields, has_random)


def _make_look(arguments, **words) -> Look:
    """Make the Look of the arguments: `words` are those that flags write otherwise."""
    material = {}
    for given in arguments.materials:
        material |= given
    for word, flag in ((arguments.reflection, "--reflection"), (material.get("reflection"), "--material: reflection")):
        if word is not None and word not in REFLECTION_MODELS:
            meant = did_you_mean(word, REFLECTION_MODELS)
            raise SceneError(f"argument {flag}: one of {', '.join(REFLECTION_MODELS)} is needed; given {word!r}{meant}")
    with _told_of("--material"):
        look = Look(material=material, reflection=arguments.reflection)
    others = [each.name for each in fields(Look) if each.name in arguments and each.name != "reflection"]
    return replace(look, **{name: getattr(arguments, name) for name in others} | words)


@contextmanager
def _told_of(what):
    """Begin the message of a fault inside the block with what it is about."""
    try:
        yield
    except (ModelError, SceneError) as fault:
        raise type(fault)(f"{what}: {fault}") from fault


def _shadow_fields(arguments) -> dict[str, int]:
    """Return the fields of Shadow that flags give."""
    given = {"size": arguments.shadow_size, "filter": arguments.shadow_filter}
    return {name: value for name, value in given.items() if value is not None}


# --- models -----------------------------------------------------------------------------------------------------------


def load_scene(model, arguments, settings, messages, files_read=None) -> Loaded:
    """Load a model or scene file and change it as the settings say; its warnings are said, and the paths of other files
    that were read are added to `files_read`.

    Raises
    ------
    ModelError : the file can't be read, or a mesh can't take the texture
    SceneError : a value that the file or one of its materials can't take
    """
    with noted_warnings() as texts:
        with _reading_shown(messages):
            scene, options, framing, look = _read(model, arguments, settings, messages, files_read)
        look = settings.look.over(look)
        changed = with_options(arguments, options, {"shading", "ground"} & {*vars(arguments)}, model)
        drawn = getattr(changed, "shading", None), getattr(changed, "ground", False)
        with _told_of(model):
            scene = look.change(scene, *drawn, settings.shadow_fields)
        if settings.shadow_fields and not any(getattr(light, "shadow", None) for light in scene.lights):
            name = next(iter(settings.shadow_fields))
            raise SceneError(f"--shadow-{name} needs a light that casts a shadow; with --shadows all do")
    messages.warn(*texts)
    return Loaded(scene, texts, options, framing, look)


@contextmanager
def noted_warnings():
    """Yield a list that holds what was warned of inside the block, once that has ended: each text once."""
    texts = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        yield texts
    texts += dict.fromkeys(str(warning.message) for warning in caught if issubclass(warning.category, UserWarning))


@contextmanager
def _reading_shown(messages):
    """Show inside the block how far the reading of a file has come, where it takes long and stderr is a terminal."""
    start = perf_counter()

    def show(n_done, n, what):
        if perf_counter() - start > _LONG:
            bar.show(n_done, n, what)

    with Bar(messages) as bar, noticing_progress(show):
        yield


def _read(model, arguments, settings, messages, files_read) -> tuple:
    """Read a model as a SceneFile."""
    look, input_format = settings.look, arguments.input_format
    source = source_of(model, input_format)
    read = read_source(source, camera="file", **look.reading, log=messages.detail, files_read=files_read)
    entry, scene = formats.find(input_format or Path(model).suffix), read.scene
    if entry is not None and entry.is_scene:
        is_dropped = arguments.up is not None and arguments.camera != "file"  # another side is meant
    else:
        is_dropped = scene.camera is not None and arguments.camera != "file"
        if is_dropped:
            messages.notice(f"{model}: the file has a camera; the model is framed, --camera file looks through it")
        if entry is not None and entry.name in _UNTOLD_UP and look.up is None:
            _tell_up(model, scene, messages)
    return read._replace(scene=replace(scene, camera=None)) if is_dropped else read


def _tell_up(model, scene, messages) -> None:
    """Say where the shape of a model says that another axis points upwards."""
    import numpy as np

    from ..scene.framing import guess_up

    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in scene.meshes])
    step = scene.n_face // _MAX_LOOKED_AT + 1
    faces = [mesh.faces[::step] + np.int64(offset) for mesh, offset in zip(scene.meshes, offsets[:-1], strict=True)]
    points = [mesh.vertices for mesh in scene.meshes]
    up, reason = guess_up(
        points[0] if len(points) == 1 else np.concatenate(points), np.concatenate(faces), scene.bounds
    )
    if up not in (None, scene.up):
        messages.notice(f"{model}: drawn with {scene.up} upwards; the shape says {up} ({reason}): try --up {up}")


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


def with_options(arguments, options, names, model):
    """Return the arguments with a scene file's options, out of `names`, in place of defaults; flags that were given
    win.

    Raises SceneError for an option that is not legal.
    """
    own = {name: value for name, value in options.items() if name in names and name not in arguments.explicit}
    changed = copy(arguments)
    if own:
        given = {field.name: getattr(arguments, field.name, None) for field in fields(Options)}
        with _told_of(f"{model}: options"):
            checked = Options(**{name: value for name, value in given.items() if value is not None} | own)
        for name in own:
            setattr(changed, name, getattr(checked, name))
    return changed
