"""Cameras and lights from the arguments."""

import math
from dataclasses import replace

import numpy as np

from ..errors import SceneError
from ..scene import lights
from ..scene.camera import Camera
from .arguments import AZIMUTH, ELEVATION, VIEWS

_LIGHTS = {
    "ambient": lights.AmbientLight,
    "directional": lights.DirectionalLight,
    "point": lights.PointLight,
    "spot": lights.SpotLight,
    "area": lights.AreaLight,
}


def make_lights(arguments) -> tuple:
    """Make the lights: those of a preset and those given; the studio's where neither is."""
    given = tuple(_LIGHTS[light.kind](**light.settings) for light in arguments.lights)
    preset = arguments.preset or (None if given else "studio")
    return (getattr(lights, preset)() if preset else ()) + given


def check_camera(arguments) -> None:
    """Raise SceneError where no model could be looked at like this; something stands in for the model."""
    if arguments.zoom <= 0.0:
        raise SceneError(f"--zoom must be above 0; given {arguments.zoom:g}")
    if arguments.eye is None and arguments.target is not None:
        raise SceneError("--target needs --eye")
    if arguments.eye is not None and (
        arguments.views or arguments.azimuth is not None or arguments.elevation is not None
    ):
        raise SceneError("--eye and --target can't be used with --view, --azimuth or --elevation")
    box = np.array([[1.0, 2.0, 3.0], [2.0, 3.0, 4.0]]) + (arguments.eye or (0.0, 0.0, 0.0))
    up = "y" if arguments.up == "auto" else arguments.up
    for view in arguments.views or [None]:
        make_camera(arguments, view, box, box, up)


def make_camera(arguments, view, subject, bounds, up) -> Camera:
    """Make the camera for a view.

    Parameters
    ----------
    arguments : those of the command
    view : name out of VIEWS, or None
    subject : Scene or points (n, 3), what is framed
    bounds : (2, 3) box round it, scene units
    up : axis

    Returns
    -------
    Camera; orthographic at --eye, it shows of the target's plane what it would show with perspective

    Raises SceneError for a value that is not legal.
    """
    if arguments.eye is not None:
        target = bounds.mean(axis=0) if arguments.target is None else arguments.target
        camera = Camera.perspective(arguments.eye, target, up, arguments.fov)
        if arguments.ortho:
            distance = math.dist(camera.position, camera.target)
            height = 2.0 * distance * math.tan(math.radians(camera.fov) / 2.0)
            camera = Camera.orthographic(arguments.eye, target, up, height)
    else:
        azimuth, elevation = VIEWS.get(view, (AZIMUTH, ELEVATION))
        width, height = arguments.size
        camera = Camera.framing(
            subject,
            azimuth=azimuth if arguments.azimuth is None else arguments.azimuth,
            elevation=elevation if arguments.elevation is None else arguments.elevation,
            fov=arguments.fov,
            up=up,
            orthographic=arguments.ortho,
            aspect=width / height,
        )
    return _zoomed(camera, arguments.zoom)


def _zoomed(camera, zoom) -> Camera:
    """Make everything `zoom` times larger in the picture, from the same place."""
    if zoom == 1.0:
        return camera
    if not camera.is_perspective:
        return replace(camera, height=camera.height / zoom)
    slope = math.tan(math.radians(camera.fov) / 2.0) / zoom
    return replace(camera, fov=math.degrees(2.0 * math.atan(slope)))
