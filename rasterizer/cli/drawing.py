"""How a command goes through the models: one after another is loaded, drawn and written, and a failure doesn't stop the
rest. And what looks like a mistake in a picture.
"""

import os

import numpy as np

from .messages import STDIO, Failures, Results, compilation_shown
from .outputs import Outputs, plan_targets, without


def draw_models(request, messages, draw, check=None, n_frame=None) -> tuple[list, int]:
    """Hand every model to `draw`, which is called with its targets, the Request, the messages and the Outputs of the
    run.

    Parameters
    ----------
    request : Request
    messages : Messages
    check, n_frame : those of `plan_targets`

    Returns
    -------
    the failures, one error for each model that failed; and the number of models

    Raises
    ------
    SceneError : an argument that is wrong for every model
    OutputError : the folder of an output doesn't exist
    """
    plan, n_model = plan_missing(request, messages, check, n_frame)
    failures = Failures(messages, request.is_json)
    n_target = sum(map(len, plan))
    with compilation_shown(messages):
        outputs = Outputs(plan, Results(messages, n_target, is_told=not request.is_json))
        for targets in plan:
            with failures.caught(targets[0].model, request.options.size, targets[0].output == STDIO):
                draw(targets, request, messages, outputs)
    return failures, n_model


def plan_missing(request, messages, check=None, n_frame=None) -> tuple[list, int]:
    """List the outputs of each model, without those that --skip-existing leaves out; and how many models there are."""
    plan = plan_targets(request, check, n_frame)
    n_model = len(plan)
    if request.files.skip_existing:
        n_target = sum(map(len, plan))
        plan, n_left_out = without(plan, lambda target: os.path.isfile(target.output))
        messages.notice(f"{n_left_out} of {n_target} outputs are there already")
    return plan, n_model


def picture_warnings(frame, scene, request, camera, model) -> list[str]:
    """Say what looks like a mistake in a picture, and what to try.

    Parameters
    ----------
    frame : Frame, the picture
    scene : Scene, with its own camera if it has one
    request : Request
    camera : Camera that the picture was taken with
    model : text, what they begin with
    """
    if frame.stats.coverage == 0.0:
        return [f"{model}: the picture is empty: {_why_empty(frame.stats, scene, request, camera)}"]
    is_alone = frame.has("rgb") and scene.background is None
    if is_alone and not frame.rgba[..., :3].any():
        if all(_is_black(mesh) for mesh in scene.meshes):
            return [f"{model}: the picture is black: so are its materials or colours; try --color grey"]
        return [f"{model}: the picture is black: no light reaches what is seen; try --preset headlight"]
    is_cut_off = request.options.color_range == "clamp" and frame.stats.plan.bound > 1.0
    if is_alone and is_cut_off and _is_white(frame.rgba[::4, ::4]):
        return [f"{model}: the picture is white: its lights are too bright; try --color-range global, or --exposure -3"]
    return []


def _is_white(rgba) -> bool:
    """Tell whether nine of ten pixels (height, width, 4) that show anything are white."""
    seen = rgba[rgba[..., 3] > 0]
    return len(seen) > 0 and (seen[:, :3] == 255).all(axis=1).mean() > 0.9


def _is_black(mesh) -> bool:
    """Tell whether a mesh reflects and glows nothing, but for highlights."""
    if any(colors is not None and not colors[..., :3].any() for colors in (mesh.colors, mesh.face_colors)):
        return True
    fields = (field for each in mesh.palette for field in (each.diffuse, each.ambient, each.emissive, each.metal))
    return not any(field is not None and any(field) for field in fields)


def _why_empty(stats, scene, request, camera) -> str:
    """The cause, where it is known, and what to try."""
    if stats.faces == stats.culled:
        return "all faces are seen from behind; try --cull none"
    if not any(material.is_visible for mesh in scene.meshes for material in mesh.palette):
        names = ", ".join(sorted({f"'{material.name}'" for mesh in scene.meshes for material in mesh.palette})[:5])
        return f"every material is invisible, its opacity is 0 or below its cutoff: {names}; try --material opacity=1"
    cause = _out_of_view(scene, camera)
    cause = f"{cause}; " if cause else ""
    if request.viewpoint.eye is not None:
        low, high = ("(" + ", ".join(f"{value:g}" for value in corner) + ")" for corner in scene.bounds)
        return f"{cause}the model reaches from {low} to {high}; try another --eye or --target, or leave --eye out"
    if scene.camera is not None and not request.is_view_given:
        return f"{cause}the camera of the file sees nothing of it; try --view iso"
    if request.viewpoint.zoom > 1.0:
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
