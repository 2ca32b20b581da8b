"""Which models are read, and what the arguments make of them: lights, shadows, materials, finer meshes."""

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

from ..errors import ModelError, SceneError
from ..io import formats
from ..io.loader import load
from ..io.model_file import MeshSettings, noticing_progress
from ..options import Options
from ..scene.color import linear_rgb
from ..scene.lights import PRESETS, Shadow, on_tabletop, with_shadow_fields, without_shadows
from ..scene.material import REFLECTION_MODELS, Material
from ..scene.scene import DepthCue, Scene
from ..scene.texture import Texture
from .flags import UNSAID
from .messages import STDIO, Bar
from .parser import did_you_mean
from .values import make_light

_LONG = 1.0  # seconds of reading a file, after which a bar is shown
_UNTOLD_UP = ("obj", "stl", "ply", "off")  # formats that don't say which axis points upwards
_MAX_LOOKED_AT = 50_000  # faces, when that is guessed: more make no other share of the area
_MAX_SUBDIVISIONS = 15  # that a mesh can be subdivided


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

    load: dict  # arguments of `load`, None where the file rules
    material: dict  # fields of Material to replace
    shadow: Shadow | None  # of all lights but those that say otherwise
    shadow_fields: dict  # fields of Shadow to replace, of lights that cast one
    is_transparent: bool  # whether a background is taken away
    scene: dict  # other fields of Scene to replace
    subdivide: int
    is_on_tabletop: bool  # whether models that bring no lights are lit as there
    has_key_shadow: bool  # there, of the key light


class Loaded(NamedTuple):
    """A model, ready to be drawn."""

    scene: Scene
    warnings: list[str]  # that loading gave, which were said
    options: dict  # a scene file's, by the names of Options
    framing: dict | None  # a scene file's, as `camera_of` takes it


def make_settings(arguments) -> Settings:
    """Read what the arguments want of every model.

    Raises
    ------
    SceneError : an argument that is wrong for every model
    ModelError : a texture that can't be read
    """
    background = arguments.background
    if not 0 <= arguments.subdivide <= _MAX_SUBDIVISIONS:
        raise SceneError(f"--subdivide must be within 0..{_MAX_SUBDIVISIONS}; given {arguments.subdivide}")
    if arguments.crease_angle is not None and not 0.0 <= arguments.crease_angle <= 180.0:
        raise SceneError(f"--crease-angle must be within 0..180 degrees; given {arguments.crease_angle:g}")
    shadow_fields = _shadow_fields(arguments)
    return Settings(
        load={
            "lights": make_lights(arguments),
            "background": None if background in (None, "transparent") else linear_rgb(background, "--background"),
            "up": None if arguments.up == "auto" else arguments.up,
            "crease_angle": arguments.crease_angle,
            "weighting": arguments.weighting,
            "drop_bad_faces": arguments.drop_bad_faces,
            "allow_outside": arguments.allow_outside,
        },
        material=_make_material(arguments),
        shadow=Shadow(**shadow_fields) if arguments.shadows else None,
        shadow_fields={} if arguments.shadows else shadow_fields,
        is_transparent=background == "transparent",
        scene={} if arguments.depth_cue == UNSAID else {"depth_cue": _make_cue(arguments.depth_cue)},
        subdivide=arguments.subdivide,
        is_on_tabletop=getattr(arguments, "ground", False),
        has_key_shadow=_takes_shadows(arguments) and not arguments.shadows,  # which say how lights cast them
    )


@contextmanager
def _told_of(what):
    """Begin the message of a fault inside the block with what it is about."""
    try:
        yield
    except (ModelError, SceneError) as fault:
        raise type(fault)(f"{what}: {fault}") from fault


def _make_cue(settings) -> DepthCue | None:
    """The cue of --depth-cue."""
    with _told_of("--depth-cue"):
        return None if settings is None else DepthCue(**settings)


def _make_material(arguments) -> dict:
    """The fields of --reflection and --material, the last of a name; checked on a material that stands in for the
    model's."""
    settings = {}
    if arguments.reflection is not None:
        settings["reflection"] = _checked_model(arguments.reflection, "--reflection")
    for given in arguments.materials:
        settings |= given
    if "reflection" in settings:
        _checked_model(settings["reflection"], "--material: reflection")
    for field, make in (("texture", Texture), ("metallic_roughness", Texture.of_numbers)):
        if settings.get(field) is not None:
            with _told_of(f"--material {field}"):
                settings[field] = make(settings[field])
    with _told_of("--material"):
        Material(**settings)
    return settings


def _checked_model(word: str, flag: str) -> str:
    """Return the word for a reflection model; SceneError where the scene's table has none of that name."""
    if word not in REFLECTION_MODELS:
        meant = did_you_mean(word, REFLECTION_MODELS)
        raise SceneError(f"argument {flag}: one of {', '.join(REFLECTION_MODELS)} is needed; given {word!r}{meant}")
    return word


# --- lights -----------------------------------------------------------------------------------------------------------


def _shadow_fields(arguments) -> dict[str, int]:
    """Return the fields of Shadow that flags give."""
    given = {"size": arguments.shadow_size, "filter": arguments.shadow_filter}
    return {name: value for name, value in given.items() if value is not None}


def make_lights(arguments) -> tuple | None:
    """Make the lights: those of a preset and those given, with shadows if asked for; None where neither is, so that a
    file's own, or else the studio's, are used."""
    shadow_fields = _shadow_fields(arguments)
    shadow = Shadow(**shadow_fields)  # of lights that cast one and don't say its size and filter themselves
    given = tuple(make_light(text, arguments.shadows, shadow) for text in arguments.lights)
    if arguments.preset is None:
        return given or None
    lights = PRESETS[arguments.preset]()
    if arguments.shadows:
        return _cast_shadows(without_shadows(lights), shadow) + given
    lights = lights if _takes_shadows(arguments) else without_shadows(lights)
    return with_shadow_fields(lights, **shadow_fields) + given


def _takes_shadows(arguments) -> bool:
    """Tell whether edges of shadows are seen: with methods that don't light samples, a polygon or a vertex lies in the
    shadow as a whole."""
    return getattr(arguments, "shading", None) == "phong"


def _cast_shadows(of_scene, shadow, unshadowed=()) -> tuple:
    """Let lights cast shadows.

    Parameters
    ----------
    of_scene : sequence of lights; a shadow that one has stays what it is
    shadow : Shadow
    unshadowed : places in the sequence of lights that shall cast none

    Returns
    -------
    tuple of lights
    """

    return tuple(
        light if place in unshadowed or getattr(light, "shadow", True) is not None else replace(light, shadow=shadow)
        for place, light in enumerate(of_scene)
    )


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
            scene, options, framing, unshadowed = _read(model, arguments, settings, messages, files_read)
        if settings.is_on_tabletop and settings.load["lights"] is None:
            scene = replace(scene, lights=on_tabletop(scene.lights, settings.has_key_shadow))
        scene = _changed(scene, unshadowed, model, settings)
        if settings.shadow_fields and not any(getattr(light, "shadow", None) for light in scene.lights):
            name = next(iter(settings.shadow_fields))
            raise SceneError(f"--shadow-{name} needs a light that casts a shadow; with --shadows all do")
    messages.warn(*texts)
    return Loaded(scene, texts, options, framing)


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
    """Read a model: its scene, options and framing, and the places of lights that say that they cast no shadow."""
    input_format = arguments.input_format
    source = source_of(model, input_format)
    entry = formats.find(input_format or Path(model).suffix)
    if entry is None or not entry.is_scene:
        options = {"format": input_format, "log": messages.detail, "files_read": files_read, **settings.load}
        scene = load(source, **options, camera="file")
        if scene.camera is not None and arguments.camera != "file":
            scene = replace(scene, camera=None)
            messages.notice(f"{model}: the file has a camera; the model is framed, --camera file looks through it")
        if entry is not None and entry.name in _UNTOLD_UP and settings.load["up"] is None:
            _tell_up(model, scene, messages)
        return scene, {}, None, ()
    read = entry.read()(
        source,
        log=messages.detail,
        format=entry.name,
        mesh_settings=MeshSettings(*(settings.load[key] for key in MeshSettings._fields)),
        allow_outside=settings.load["allow_outside"],
        files_read=files_read,
    )
    changes = {key: settings.load[key] for key in ("lights", "background", "up") if settings.load[key] is not None}
    unshadowed = () if "lights" in changes else read.unshadowed
    return replace(read.scene, **changes), read.options, read.framing, unshadowed


def _tell_up(model, scene, messages) -> None:
    """Say where the shape of a model says that another axis points upwards."""
    import numpy as np

    from ..scene.up_axis import guess_up

    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in scene.meshes])
    step = scene.n_face // _MAX_LOOKED_AT + 1
    faces = [mesh.faces[::step] + np.int64(offset) for mesh, offset in zip(scene.meshes, offsets[:-1], strict=True)]
    points = [mesh.vertices for mesh in scene.meshes]
    up, reason = guess_up(points[0] if len(points) == 1 else np.concatenate(points), np.concatenate(faces))
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


def _changed(scene, unshadowed, model, settings) -> Scene:
    """Change a scene's materials, lights, meshes and background."""
    changes = dict(settings.scene)
    if settings.load["lights"] is None:
        if settings.shadow is not None:
            changes["lights"] = _cast_shadows(scene.lights, settings.shadow, unshadowed)
        elif settings.shadow_fields:
            changes["lights"] = with_shadow_fields(scene.lights, **settings.shadow_fields)
    if settings.is_transparent:
        changes["background"] = None
    if settings.material or settings.subdivide:
        changes["meshes"] = tuple(_changed_mesh(mesh, model, settings) for mesh in scene.meshes)
    return replace(scene, **changes) if changes else scene


def _changed_mesh(mesh, model, settings):
    """Change a mesh's materials, and subdivide it."""
    for field in ("texture", "metallic_roughness"):
        if settings.material.get(field) is not None and mesh.uv is None:
            which = f"mesh {mesh.name!r}" if mesh.name else "a mesh"
            raise ModelError(f"{model}: {which} has no texture coordinates (uv), which --material {field} needs")
    with _told_of(model):
        if settings.material:
            materials = tuple(_with_fields(material, settings.material) for material in mesh.palette)
            of_faces = {} if mesh.materials is None else {"materials": materials}
            mesh = replace(mesh, material=materials[0], **of_faces)
        return mesh.subdivide(settings.subdivide) if settings.subdivide else mesh


def _with_fields(material, changes) -> Material:
    """A material with other fields; the ambient coefficient, and that of metal, follow the diffuse one unless they are
    given too."""
    follows = {"ambient": None, "metal": None} if "diffuse" in changes else {}
    return replace(material, **follows | changes)


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
