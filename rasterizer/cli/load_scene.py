"""Models and scene files as the arguments want them: lights, materials, shadows, finer meshes."""

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
from ..io.model_file import MeshSettings
from ..io.scene_file import SceneFile
from ..io.text_numbers import noticing_progress
from ..options import Options
from ..scene.color import linear_rgb
from ..scene.lights import Shadow, on_tabletop, with_shadow_fields
from ..scene.material import REFLECTION_MODELS, Material
from ..scene.scene import DepthCue, Scene
from ..scene.texture import Texture
from .cameras_lights import cast_shadows, make_lights, make_shadow, shadow_fields, takes_shadows
from .defaults import UNSAID
from .messages import Bar
from .suggestions import did_you_mean
from .targets import STDIO

LONG = 1.0  # seconds of reading a file, after which a bar is shown

_MOST_TIMES = 15  # that a mesh can be subdivided


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
    if not 0 <= arguments.subdivide <= _MOST_TIMES:
        raise SceneError(f"--subdivide must be within 0..{_MOST_TIMES}; given {arguments.subdivide}")
    return Settings(
        load={
            "lights": make_lights(arguments),
            "background": None if background in (None, "transparent") else linear_rgb(background, "--background"),
            "up": None if arguments.up == "auto" else arguments.up,
            "crease_angle": _checked_angle(arguments.crease_angle),
            "weighting": arguments.weighting,
            "drop_bad_faces": arguments.drop_bad_faces,
            "allow_outside": arguments.allow_outside,
        },
        material=_make_material(arguments),
        shadow=make_shadow(arguments) if arguments.shadows else None,
        shadow_fields={} if arguments.shadows else shadow_fields(arguments),
        is_transparent=background == "transparent",
        scene={} if arguments.depth_cue == UNSAID else {"depth_cue": _make_cue(arguments.depth_cue)},
        subdivide=arguments.subdivide,
        is_on_tabletop=getattr(arguments, "ground", False),
        has_key_shadow=takes_shadows(arguments) and not arguments.shadows,  # which say how lights cast them
    )


def _make_cue(settings):
    """The cue of --depth-cue."""
    try:
        return None if settings is None else DepthCue(**settings)
    except SceneError as fault:
        raise SceneError(f"--depth-cue: {fault}") from fault


def _checked_angle(angle):
    if angle is not None and not 0.0 <= angle <= 180.0:
        raise SceneError(f"--crease-angle must be within 0..180 degrees; given {angle:g}")
    return angle


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
    if settings.get("texture") is not None:
        try:
            settings["texture"] = Texture(settings["texture"])
        except ModelError as fault:
            raise ModelError(f"--material texture: {fault}") from fault
    try:
        Material(**settings)
    except SceneError as fault:
        raise SceneError(f"--material: {fault}") from fault
    return settings


def _checked_model(word: str, flag: str) -> str:
    """Return the word for a reflection model; SceneError where the scene's table has none of that name."""
    if word not in REFLECTION_MODELS:
        meant = did_you_mean(word, REFLECTION_MODELS)
        raise SceneError(f"argument {flag}: one of {', '.join(REFLECTION_MODELS)} is needed; given {word!r}{meant}")
    return word


def load_scene(model, arguments, settings, messages, files_read=None) -> Loaded:
    """Load a model or scene file and change it as the settings say; its warnings are said, and the paths of other files
    that were read are added to `files_read`.

    Raises
    ------
    ModelError : the file can't be read, or a mesh can't take the texture
    SceneError : a value that the file or one of its materials can't take
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        with _reading_shown(messages):
            read = _read(model, arguments.input_format, settings, messages, files_read)
        if settings.is_on_tabletop and settings.load["lights"] is None:
            lights = on_tabletop(read.scene.lights, settings.has_key_shadow)
            read = read._replace(scene=replace(read.scene, lights=lights))
        scene = _changed(read, model, settings)
        _check_shadows(scene, settings)
    texts = list(dict.fromkeys(str(warning.message) for warning in caught if issubclass(warning.category, UserWarning)))
    for text in texts:
        messages.warn(text)
    return Loaded(scene, texts, read.options, read.framing)


@contextmanager
def _reading_shown(messages):
    """Show inside the block how far the reading of a file has come, where it takes long and stderr is a terminal."""
    start = perf_counter()

    def show(n_done, n, what):
        if perf_counter() - start > LONG:
            bar.show(n_done, n, what)

    with Bar(messages) as bar, noticing_progress(show):
        yield


def _read(model, input_format, settings, messages, files_read) -> SceneFile:
    """Read a model; what it has no say in is left to the defaults."""
    source = source_of(model, input_format)
    entry = formats.find(input_format or Path(model).suffix)
    if entry is None or not entry.is_scene:
        return SceneFile(load(source, format=input_format, log=messages.detail, files_read=files_read, **settings.load))
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
    return read._replace(scene=replace(read.scene, **changes), unshadowed=unshadowed)


def source_of(model: str, input_format: str | None) -> str | bytes:
    """Return what `load` reads: a path, or the bytes of stdin.

    Raises ModelError, in the command line's own words, for a folder and for a name that doesn't tell its format.
    """
    return _read_stdin() if model == STDIO else _checked_path(model, input_format)


class _Stdin(bytes):
    """What came from stdin; messages call it by its name."""

    name = "stdin"


def _read_stdin() -> bytes:
    try:
        return _Stdin(sys.stdin.buffer.read())
    except OSError as fault:
        raise ModelError(f"stdin can't be read ({fault.strerror or fault})") from fault


def _checked_path(model, input_format) -> str:
    """Refuse, in the command line's own words, a folder and a name that doesn't tell its format."""
    path = Path(model)
    if os.path.isdir(path):
        raise ModelError(f"{model}: is a folder; give the models in it, e.g. '{path / '*.stl'}', or --recursive")
    if input_format is None and not path.suffix:
        if not os.path.exists(path):
            raise ModelError(f"{model}: no such file")
        raise ModelError(f"{model}: the format is unknown without a suffix; give --input-format")
    return model


def _changed(read, model, settings) -> Scene:
    """Change a scene's materials, lights, meshes and background."""
    changes = dict(settings.scene)
    if settings.load["lights"] is None:
        if settings.shadow is not None:
            changes["lights"] = cast_shadows(read.scene.lights, settings.shadow, read.unshadowed)
        elif settings.shadow_fields:
            changes["lights"] = with_shadow_fields(read.scene.lights, **settings.shadow_fields)
    if settings.is_transparent:
        changes["background"] = None
    if settings.material or settings.subdivide:
        changes["meshes"] = tuple(_changed_mesh(mesh, model, settings) for mesh in read.scene.meshes)
    return replace(read.scene, **changes) if changes else read.scene


def _check_shadows(scene, settings) -> None:
    """Refuse fields of shadows where there is none."""
    if not any(getattr(light, "shadow", None) for light in scene.lights):
        for name in settings.shadow_fields:
            raise SceneError(f"--shadow-{name} needs a light that casts a shadow; with --shadows all do")


def _changed_mesh(mesh, model, settings):
    """Change a mesh's materials, and subdivide it."""
    if settings.material.get("texture") is not None and mesh.uv is None:
        which = f"mesh {mesh.name!r}" if mesh.name else "a mesh"
        raise ModelError(f"{model}: {which} has no texture coordinates (uv), which --material texture needs")
    try:
        if settings.material:
            materials = tuple(with_fields(material, settings.material) for material in mesh.palette)
            own = (
                {"material": materials[0]}
                if mesh.materials is None
                else {"material": materials[0], "materials": materials}
            )
            mesh = replace(mesh, **own)
        return mesh.subdivide(settings.subdivide) if settings.subdivide else mesh
    except (ModelError, SceneError) as fault:
        raise type(fault)(f"{model}: {fault}") from fault


def with_fields(material, changes) -> Material:
    """A material with other fields; the ambient coefficient follows the diffuse one unless it is given too."""
    follows = {"ambient": None} if "diffuse" in changes else {}
    return replace(material, **follows | changes)


def with_options(arguments, options, names, model):
    """Return the arguments with a scene file's options, out of `names`, in place of defaults; flags that were given
    win.

    Raises SceneError for an option that is not legal.
    """
    own = {name: value for name, value in options.items() if name in names and name not in arguments.given}
    changed = copy(arguments)
    if own:
        try:
            checked = Options(
                **{name: value for name, value in vars(arguments).items() if _is_option(name, value)} | own
            )
        except SceneError as fault:
            raise SceneError(f"{model}: options: {fault}") from fault
        for name in own:
            setattr(changed, name, getattr(checked, name))
    return changed


def _is_option(name, value) -> bool:
    return value is not None and name in {field.name for field in fields(Options)}
