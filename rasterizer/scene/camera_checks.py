"""Checks of what a camera is given: its field of view, height or intrinsics, of which one rules, and its depths."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import SceneError, shown
from .validate import number, picture_size

if TYPE_CHECKING:
    from .camera import Camera

LEAST_FOV = 1e-6  # degrees: a hair in 10 km
MOST_SKEW = 1024.0  # of fx: columns that lean by more than 89.94 degrees show nothing


def lens_of(camera: "Camera") -> dict[str, Any]:
    """Return the fields of a camera's lens, checked: `fov` or `height`, and `intrinsics` with `skew` and `size`."""
    fields: dict[str, Any] = {}
    fov = camera.fov
    if camera.intrinsics is not None:
        fields = _intrinsics_of(camera)
        fov = fields["fov"]
    elif camera.size is not None:
        raise SceneError("the camera's size goes with its intrinsics; a picture's size is given to the renderer")
    elif number(camera.skew, "the camera's skew") != 0.0:
        raise SceneError(f"the camera's skew goes with its intrinsics; given {shown(camera.skew)} without any")
    else:
        fields = {"skew": 0.0}
    if (fov is None) == (camera.height is None):
        raise SceneError(
            "a camera needs either fov (perspective) or height (orthographic); "
            f"given fov={shown(fov)}, height={shown(camera.height)}"
        )
    if fov is not None:
        return fields | {"fov": checked_fov(fov)}
    height = number(camera.height, "the camera's height")
    if height <= 0.0:
        raise SceneError(f"the camera's height must be above 0 scene units; given {shown(camera.height)}")
    return fields | {"height": height}


def _intrinsics_of(camera: "Camera") -> dict[str, Any]:
    """Check the OpenCV intrinsics, skew and the size that they belong to, and derive the field of view."""
    given: Any = camera.intrinsics
    try:
        values = tuple(given)
    except TypeError:
        values = ()
    if len(values) != 4:
        raise SceneError(f"the camera's intrinsics must be (fx, fy, cx, cy) in pixels; given {shown(given)}")
    fx, fy, cx, cy = (number(v, "each of the camera's intrinsics (fx, fy, cx, cy)") for v in values)
    if fx <= 0.0 or fy <= 0.0:
        raise SceneError(f"the camera's focal lengths fx, fy must be above 0 pixels; given {shown(fx)}, {shown(fy)}")
    skew = number(camera.skew, "the camera's skew")
    if abs(skew) > MOST_SKEW * fx:
        raise SceneError(
            f"the camera's skew must be at most {MOST_SKEW:g} times its fx, {shown(fx)} pixels; "
            f"given {shown(camera.skew)}"
        )
    width, height = picture_size(camera.size)
    fov = math.degrees(2.0 * math.atan(0.5 * height / fy))
    return {"intrinsics": (fx, fy, cx, cy), "skew": skew, "size": (width, height), "fov": fov}


def depths_of(camera: "Camera") -> dict[str, float]:
    """Return near and far, where given, checked."""
    depths: dict[str, float] = {}
    for field in ("near", "far"):
        given = getattr(camera, field)
        if given is not None:
            depths[field] = number(given, f"the camera's {field}")
            if depths[field] <= 0.0 and camera.is_perspective:
                raise SceneError(
                    f"the {field} of a perspective camera must be above 0 scene units; given {shown(given)}"
                )
    if len(depths) == 2 and depths["near"] >= depths["far"]:
        raise SceneError(f"the camera's near must be below its far; given near={camera.near}, far={camera.far}")
    return depths


def fov_unless(orthographic: object, fov: object) -> float | None:
    """Return the field of view, or None for a camera without perspective."""
    if not isinstance(orthographic, (bool, np.bool_)):
        raise SceneError(f"orthographic must be True or False; given {shown(orthographic)}")
    return None if orthographic else checked_fov(fov)


def checked_fov(fov: object) -> float:
    """Return the field of view as a float between 0 and 180 degrees; a smaller one would magnify roundings only."""
    value = number(fov, "the camera's fov")
    if not LEAST_FOV <= value < 180.0:
        raise SceneError(
            f"the camera's fov must be between 0 and 180 degrees, {LEAST_FOV:g} at least; given {shown(fov)}"
        )
    return value
