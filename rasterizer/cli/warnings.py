"""What looks like a mistake in a picture: why it is empty or black, and what to try."""

import numpy as np

from .cameras_lights import is_camera_given


def find_doubts(stats, is_black, scene, arguments, camera) -> list[str]:
    """Say what looks like a mistake in a picture, and what to try.

    Parameters
    ----------
    stats : Stats of the picture
    is_black : bool, whether it has bytes, and none of its channels is more than 0 anywhere
    scene : Scene, with its own camera if it has one
    arguments : those of the command
    camera : Camera that the picture was taken with
    """
    if stats.coverage == 0.0:
        return [f"the picture is empty: {_why_empty(stats, scene, arguments, camera)}"]
    if is_black and scene.background is None:
        return ["the picture is black: no light reaches what is seen; try --preset headlight"]
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
