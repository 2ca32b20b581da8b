"""Cameras from the arguments: the scene's own, one at --eye, or one that frames the model."""

import math
from dataclasses import replace

import numpy as np

from ..choices import VIEWS
from ..errors import SceneError
from ..scene.camera import Camera
from .flags import AZIMUTH, ELEVATION, FOV


def is_camera_given(arguments) -> bool:
    """Tell whether any flag but --zoom and --camera says where the picture is taken from, and how."""
    numbers = (arguments.azimuth, arguments.elevation, arguments.fov, arguments.eye, arguments.target, arguments.up,
               arguments.margin)  # fmt: skip
    return bool(arguments.views) or arguments.ortho or any(value is not None for value in numbers)


def check_camera(arguments) -> None:
    """Raise SceneError where no model could be looked at like this; something stands in for the model.

    A file of --camera is read, and kept in the arguments.
    """
    _read_camera(arguments)
    if arguments.zoom <= 0.0:
        raise SceneError(f"--zoom must be above 0; given {arguments.zoom:g}")
    if arguments.eye is None and arguments.target is not None:
        raise SceneError("--target needs --eye")
    if arguments.eye is not None and (
        arguments.views or arguments.azimuth is not None or arguments.elevation is not None
    ):
        raise SceneError("--eye and --target can't be used with --view, --azimuth or --elevation")
    box = np.array([[1.0, 2.0, 3.0], [2.0, 3.0, 4.0]]) + (arguments.eye or (0.0, 0.0, 0.0))
    up = "y" if arguments.up in (None, "auto") else arguments.up
    for view in arguments.views or [None]:
        make_camera(arguments, view, box, box, up)


def camera_of(arguments, view, scene, framing=None, subject=None) -> Camera:
    """Make the camera for a view of a scene: the scene's own where there is one and no flag asks for another.

    Parameters
    ----------
    arguments : those of the command
    view : name out of VIEWS, or None
    scene : Scene
    framing : dict of the arguments of `Camera.framing` that a scene file gives instead of a camera, or None; flags come
        first
    subject : Scene or points (n, 3), what is framed; None = the scene

    Returns
    -------
    Camera; raises SceneError for a value that is not legal
    """
    own = scene.camera
    if arguments.camera == "frame":
        own = framing = None
    elif arguments.camera == "file" and own is None and framing is None:
        raise SceneError("--camera file: the model brings no camera; leave it out to fill the picture")
    elif isinstance(arguments.camera, tuple):
        own, framing = arguments.camera
    if own is None or framing is not None or is_camera_given(arguments):
        return make_camera(arguments, view, scene if subject is None else subject, scene.bounds, scene.up, framing)
    return zoomed(own, arguments.zoom)


def _read_camera(arguments) -> None:
    """Read the file of --camera: a pair of a Camera and how to frame the model, one of them None.

    Raises
    ------
    SceneError : other flags that say where the camera stands, or a file without a camera
    ModelError : a file that can't be read
    """
    given = arguments.camera
    if given is None or isinstance(given, tuple):
        return
    if given != "frame" and is_camera_given(arguments):
        raise SceneError(f"--camera {given} can't be used with other flags of the camera but --zoom")
    if given not in ("file", "frame"):
        from ..io.scene_file import read_camera_file

        arguments.camera_file, arguments.camera = given, read_camera_file(given)


def make_camera(arguments, view, subject, bounds, up, framing=None) -> Camera:
    """Make the camera for a view, as `camera_of` does, of a subject with a box `bounds` (2, 3) and an axis `up`.

    An orthographic one at --eye shows of the target's plane what it would show with perspective.
    """
    if arguments.eye is not None:
        fov = _first(arguments.fov, (framing or {}).get("fov"), FOV)
        target = bounds.mean(axis=0) if arguments.target is None else arguments.target
        camera = Camera.perspective(arguments.eye, target, up, fov)
        if arguments.ortho:
            distance = math.dist(camera.position, camera.target)
            height = 2.0 * distance * math.tan(math.radians(camera.fov) / 2.0)
            camera = Camera.orthographic(arguments.eye, target, up, height)
    else:
        camera = Camera.framing(subject, **framing_settings(arguments, view, up, framing))
    return zoomed(camera, arguments.zoom)


def framing_settings(arguments, view, up, framing=None) -> dict:
    """The arguments of `Camera.framing`, but for the subject: of flags, else of `framing`, else the defaults."""
    framing = framing or {}
    azimuth, elevation = VIEWS.get(view, (framing.get("azimuth", AZIMUTH), framing.get("elevation", ELEVATION)))
    width, height = arguments.size
    settings = {
        "azimuth": _first(arguments.azimuth, azimuth),
        "elevation": _first(arguments.elevation, elevation),
        "fov": _first(arguments.fov, framing.get("fov"), FOV),
        "up": up,
        "orthographic": arguments.ortho or framing.get("orthographic", False),
        "aspect": width / height,
    }
    if arguments.margin is not None:
        settings["margin"] = arguments.margin
    return framing | settings


def _first(*values):
    """The first value that is not None."""
    return next(value for value in values if value is not None)


def zoomed(camera, zoom) -> Camera:
    """Make everything `zoom` times larger in the picture, from the same place."""
    if zoom == 1.0:
        return camera
    if camera.intrinsics is not None:
        fx, fy, cx, cy = camera.intrinsics
        (width, height), (x, y) = camera.size, (cx + 0.5, cy + 0.5)
        # The middle of the picture stays where it is; OpenCV counts from the centre of the first pixel.
        x, y = width / 2 + (x - width / 2) * zoom, height / 2 + (y - height / 2) * zoom
        return replace(camera, intrinsics=(fx * zoom, fy * zoom, x - 0.5, y - 0.5), skew=camera.skew * zoom)
    if not camera.is_perspective:
        return replace(camera, height=camera.height / zoom)
    slope = math.tan(math.radians(camera.fov) / 2.0) / zoom
    return replace(camera, fov=math.degrees(2.0 * math.atan(slope)))
