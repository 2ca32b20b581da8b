"""How a command goes through the models: what the arguments want of all of them is made once; then one after another is
loaded, drawn and written, and a failure doesn't stop the rest. And what looks like a mistake in a picture.
"""

import os
from argparse import Namespace
from dataclasses import fields
from types import SimpleNamespace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..choices import RANDOM
from ..errors import SceneError, told_of
from ..io.camera_file import viewpoint_of
from ..look import Look
from ..options import Options
from ..scene.camera import Camera
from ..scene.color import linear_rgb
from ..scene.lights import Shadow
from ..scene.material import REFLECTION_MODELS
from ..scene.scene import DepthCue
from ..viewpoint import Viewpoint, check_words, words_given, zoomed
from .flags import UNSAID
from .messages import STDIO, Failures, Results, compilation_shown
from .outputs import Outputs, holds_arrays, needed_outputs, plan_targets, seed_of, without
from .values import make_light

if TYPE_CHECKING:
    from ..renderer import Renderer

OPTIONS = frozenset(field.name for field in fields(Options))
_CAMERA_WORDS = ("camera", "azimuth", "elevation", "fov", "ortho", "zoom", "margin", "eye", "target")
_LOOK_WORDS = ("preset", "background", "reflection", "crease_angle", "weighting", "subdivide", "drop_bad_faces",
               "allow_outside")  # fmt: skip


# --- what the arguments want of every model ---------------------------------------------------------------------------


class Settings(NamedTuple):
    """What the arguments want of every model."""

    options: Options
    look: Look
    viewpoints: dict[str | None, Viewpoint]  # by the names of views: None where none is named, RANDOM of random ones
    shadow_fields: dict[str, int]  # fields of Shadow to replace, of lights that cast one
    has_random_lights: bool
    options_of_file: frozenset[str]  # names of the options that a scene file decides


def make_settings(arguments, but=()) -> Settings:
    """Read what the arguments want of every model.

    Parameters
    ----------
    arguments : those of the command, as `parse` returns them
    but : names of options that a scene file doesn't decide, beside those that flags give; which outputs there are, it
        decides where a file of arrays is written

    Raises
    ------
    SceneError : an argument that is wrong for every model
    ModelError : a texture or a camera that can't be read
    """
    names, given = OPTIONS.intersection(vars(arguments)), {}
    for name in names:
        if getattr(arguments, name) is not None:
            given[name] = getattr(arguments, name)
    options = Options(**given | {"outputs": needed_outputs(arguments)})
    decided = names - arguments.explicit - {*but, *(() if holds_arrays(arguments) else ("outputs",))}
    shadow_fields = {}
    if arguments.shadow_size is not None:
        shadow_fields["size"] = arguments.shadow_size
    if arguments.shadow_filter is not None:
        shadow_fields["filter"] = arguments.shadow_filter
    shadow = Shadow(**shadow_fields)  # of lights that cast one and don't say its size and filter themselves
    look, has_random = _make_look(arguments, shadow), RANDOM in arguments.lights and hasattr(arguments, "seed")
    shadow_fields = {} if arguments.shadows else shadow_fields
    return Settings(options, look, _viewpoints_of(arguments), shadow_fields, has_random, decided)


def _make_look(arguments, shadow) -> Look:
    """Make the Look of the arguments; `shadow` is that of lights that cast one."""
    words = {"shadows": shadow if arguments.shadows else False, "format": arguments.input_format}
    for name in _LOOK_WORDS:
        if name in arguments:
            words[name] = getattr(arguments, name)
    lights = []
    for text in arguments.lights:
        if text != RANDOM or not hasattr(arguments, "seed"):
            lights.append(make_light(text, shadow))
    words["lights"] = tuple(lights) or None
    words["up"] = None if arguments.up == "auto" else arguments.up
    if arguments.depth_cue is None:
        words["depth_cue"] = "none"
    elif arguments.depth_cue != UNSAID:
        with told_of("--depth-cue"):
            words["depth_cue"] = DepthCue(**arguments.depth_cue)
    if arguments.background not in (None, "transparent"):
        linear_rgb(arguments.background, "--background")
    material = {}
    for given in arguments.materials:
        material |= given
    for word, flag in ((arguments.reflection, "--reflection"), (material.get("reflection"), "--material: reflection")):
        if word is not None and word not in REFLECTION_MODELS:
            raise SceneError(f"argument {flag}: one of {', '.join(REFLECTION_MODELS)} is needed; given {word!r}")
    if material or arguments.reflection:
        with told_of("--material"):
            material = Look(material=material, reflection=arguments.reflection).material
    return Look(material=material, **words)


def _viewpoints_of(arguments) -> dict[str | None, Viewpoint]:
    """Make the Viewpoint of each view; SceneError where no model could be looked at like this: something stands in for
    the model."""
    found = {}
    for view in arguments.views or [None]:
        name = view if seed_of(view) is None else RANDOM
        if name in found:
            continue
        words = _camera_words(arguments, view)
        check_words(words, "--")
        if name == RANDOM:
            given = ["camera"] * (arguments.camera not in (None, "frame")) + words_given(words)
            if given:
                raise SceneError(f"a random view is framed by its seed; given --view random, --{', --'.join(given)}")
        viewpoint = found[name] = viewpoint_of(words)
        if name != RANDOM and arguments.camera != "file":
            box = np.array([[1.0, 2.0, 3.0], [2.0, 3.0, 4.0]]) + (arguments.eye or (0.0, 0.0, 0.0))
            up = "y" if arguments.up in (None, "auto") else arguments.up
            viewpoint.camera_of(SimpleNamespace(camera=None, bounds=box, up=up), arguments.size, lambda box=box: box)
    return found


def _camera_words(arguments, view=None) -> dict:
    """Return the words of `Viewpoint` that the flags are; those of a random view are in its name."""
    words = {"view": None if seed_of(view) is not None else view}
    for name in _CAMERA_WORDS:
        words[name] = getattr(arguments, name)
    return words


def is_camera_given(arguments) -> bool:
    """Tell whether any flag but --zoom and --camera says where the picture is taken from, and how."""
    return bool(arguments.views or arguments.up is not None or words_given(_camera_words(arguments)))


def camera_of(settings, view, loaded, subject=None) -> Camera:
    """Make the camera for a view of a model, by its name or None.

    Parameters
    ----------
    settings : Settings
    loaded : Loaded, the model
    subject : that of `Viewpoint.camera_of`
    """
    size, seed = loaded.options.size, seed_of(view)
    if seed is not None:
        return zoomed(Camera.random(loaded.scene, seed, size=size), settings.viewpoints[RANDOM].zoom)
    return settings.viewpoints[view].over(loaded.framing).camera_of(loaded.scene, size, subject)


def with_options(arguments, options) -> Namespace:
    """Return the arguments with the values of Options in the place of their own."""
    changed = {name: getattr(options, name) for name in OPTIONS if name in arguments}
    return Namespace(**vars(arguments) | changed)


# --- one model after another ------------------------------------------------------------------------------------------


def draw_models(arguments, settings, messages, draw, check=None) -> tuple[list, int]:
    """Hand every model to `draw`, which is called with its targets, the arguments, the Settings, the messages and the
    Outputs of the run.

    Parameters
    ----------
    arguments : those of the command, as `parse` returns them
    settings : Settings
    messages : Messages
    check : that of `plan_targets`

    Returns
    -------
    the failures, one error for each model that failed; and the number of models

    Raises
    ------
    SceneError : an argument that is wrong for every model
    OutputError : the folder of an output doesn't exist
    """
    plan, n_model = plan_missing(arguments, messages, check)
    failures = Failures(messages, arguments.json)
    n_target = sum(map(len, plan))
    with compilation_shown(messages):
        outputs = Outputs(plan, Results(messages, n_target, is_told=not arguments.json))
        for targets in plan:
            with failures.caught(targets[0].model, arguments.size, targets[0].output == STDIO):
                draw(targets, arguments, settings, messages, outputs)
    return failures, n_model


def plan_missing(arguments, messages, check=None) -> tuple[list, int]:
    """List the outputs of each model, without those that --skip-existing leaves out; and how many models there are."""
    plan = plan_targets(arguments, check)
    n_model = len(plan)
    if getattr(arguments, "skip_existing", False):
        n_target = sum(map(len, plan))
        plan, n_left_out = without(plan, lambda target: os.path.isfile(target.output))
        messages.notice(f"{n_left_out} of {n_target} outputs are there already")
    return plan, n_model


def make_renderer(scene, options) -> "Renderer":
    """Make what draws a scene with options."""
    from ..renderer import Renderer

    return Renderer(scene, options=options)


def picture_warnings(frame, scene, arguments, camera, model) -> list[str]:
    """Say what looks like a mistake in a picture, and what to try.

    Parameters
    ----------
    frame : Frame, the picture
    scene : Scene, with its own camera if it has one
    arguments : those of the command
    camera : Camera that the picture was taken with
    model : text, what they begin with
    """
    if frame.stats.coverage == 0.0:
        return [f"{model}: the picture is empty: {_why_empty(frame.stats, scene, arguments, camera)}"]
    if frame.has("rgb") and not frame.rgb.any() and scene.background is None:
        if all(_is_black(mesh) for mesh in scene.meshes):
            return [f"{model}: the picture is black: so are its materials or colours; try --color grey"]
        return [f"{model}: the picture is black: no light reaches what is seen; try --preset headlight"]
    return []


def _is_black(mesh) -> bool:
    """Tell whether a mesh reflects and glows nothing, but for highlights."""
    if any(colors is not None and not colors[..., :3].any() for colors in (mesh.colors, mesh.face_colors)):
        return True
    fields = (field for each in mesh.palette for field in (each.diffuse, each.ambient, each.emissive, each.metal))
    return not any(field is not None and any(field) for field in fields)


def _why_empty(stats, scene, arguments, camera) -> str:
    """The cause, where it is known, and what to try."""
    if stats.faces == stats.culled:
        return "all faces are seen from behind; try --cull none"
    if not any(material.is_visible for mesh in scene.meshes for material in mesh.palette):
        names = ", ".join(sorted({f"'{material.name}'" for mesh in scene.meshes for material in mesh.palette})[:5])
        return f"every material is invisible, its opacity is 0 or below its cutoff: {names}; try --material opacity=1"
    cause = _out_of_view(scene, camera)
    cause = f"{cause}; " if cause else ""
    if arguments.eye is not None:
        low, high = ("(" + ", ".join(f"{value:g}" for value in corner) + ")" for corner in scene.bounds)
        return f"{cause}the model reaches from {low} to {high}; try another --eye or --target, or leave --eye out"
    if scene.camera is not None and not is_camera_given(arguments):
        return f"{cause}the camera of the file sees nothing of it; try --view iso"
    if arguments.zoom > 1.0:
        return f"{cause}try a smaller --zoom"
    return f"{cause}the model covers no sample; try a larger --size, more --samples or another --view"


def _out_of_view(scene, camera) -> str | None:
    """Why nothing lies between the camera's near and far plane, if that is so."""
    eye, target = np.asarray(camera.position), np.asarray(camera.target)
    with np.errstate(all="ignore"):
        forward = (target - eye) / np.linalg.norm(target - eye)
        depths = [(mesh.used_vertices - eye) @ forward for mesh in scene.meshes]
    nearest, furthest = min(depth.min() for depth in depths), max(depth.max() for depth in depths)
    if camera.is_perspective and furthest <= 0.0:
        return "the camera looks away, all of the model is behind it"
    if camera.far is not None and nearest >= camera.far:
        return f"all of the model is beyond the far plane at {camera.far:g}, {nearest:g} away and more"
    if camera.near is not None and furthest <= camera.near:
        return f"all of the model is before the near plane at {camera.near:g}, up to {furthest:g} away"
    return None
