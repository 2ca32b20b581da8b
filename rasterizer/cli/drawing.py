"""How a command goes through the models: one after another is loaded, drawn and written; a failure doesn't stop the
rest. And what looks like a mistake in a picture.
"""

import os
from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np

from ..options import Options
from .cameras import check_camera, is_camera_given
from .messages import STDIO, Failures, Results, compilation_shown
from .models import make_settings, with_options
from .outputs import Outputs, needed_outputs, plan_targets, without

if TYPE_CHECKING:
    from ..renderer import Renderer

OPTIONS = frozenset(field.name for field in fields(Options))


def draw_models(arguments, messages, draw, check=None) -> tuple[list, int]:
    """Hand every model to `draw`, which is called with its targets, the arguments, the Settings, the messages and its
    ModelOutput.

    Parameters
    ----------
    arguments : those of the command, as `parse` returns them
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
    settings = make_settings(arguments)
    check_camera(arguments)
    plan, n_model = plan_missing(arguments, messages, check)
    failures = Failures(messages, arguments.json)
    results = Results(messages, sum(map(len, plan)), is_told=not arguments.json)
    with compilation_shown(messages), results, Outputs(plan, arguments) as outputs:
        for number, targets in enumerate(plan):
            with failures.caught(targets[0].model, arguments.size, targets[0].output == STDIO):
                draw(targets, arguments, settings, messages, outputs.of_model(number, results))
        failures += outputs.finish(messages)
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


def make_options(arguments) -> Options:
    """The options of the pictures: every field of `Options` is a flag."""
    values = {name: getattr(arguments, name) for name in OPTIONS}
    values["outputs"] = needed_outputs(arguments)
    return Options(**values)


def take_options(arguments, loaded, model, but=("outputs",)) -> tuple:
    """Return the arguments with a scene file's options, but for those of some names, and the Options that they make."""
    arguments = with_options(arguments, loaded.options, OPTIONS.difference(but), model)
    return arguments, make_options(arguments)


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
        return [f"{model}: the picture is black: no light reaches what is seen; try --preset headlight"]
    return []


def _why_empty(stats, scene, arguments, camera) -> str:
    """The cause, where it is known, and what to try."""
    if stats.faces == stats.culled:
        return "all faces are seen from behind; try --cull none"
    if all(material.opacity == 0.0 for mesh in scene.meshes for material in mesh.palette):
        names = ", ".join(sorted({f"'{material.name}'" for mesh in scene.meshes for material in mesh.palette})[:5])
        return f"every material is invisible, its opacity is 0: {names}; try --material opacity=1"
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
