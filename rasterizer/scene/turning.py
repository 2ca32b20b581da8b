"""A camera that goes round: turned about an upright axis, everything else of it kept.

in:  a Camera, angles in degrees, the axis: a direction and a point     out: a Camera for each angle
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .camera import Camera
from .mesh import rotation


def turned_cameras(
    camera: Camera, angles: Sequence[float], pole: ArrayLike, pivot: NDArray[np.float64]
) -> list[Camera]:
    """Return a camera turned about an axis, at each of several angles; at 0 it is the one given.

    Parameters
    ----------
    camera : Camera
    angles : degrees, counter-clockwise as seen from the axis' tip, as azimuths are
    pole : (3,) unit vector along the axis, world space
    pivot : (3,) a point of the axis, world space
    """
    # The top of a view along the axis is one that the camera's `up` doesn't say: it turns, too.
    up = camera.view().up
    found = []
    for angle in angles:
        turn = rotation(pole, angle)
        position, target = (pivot + turn @ (np.array(p) - pivot) for p in (camera.position, camera.target))
        moved: dict[str, Any] = {"position": position, "target": target, "up": turn @ up}
        found.append(camera if angle == 0.0 else replace(camera, **moved))
    return found


def pivot_of(camera: Camera, bounds: NDArray[np.float64], nearest: float = 0.0) -> NDArray[np.float64]:
    """Return the point (3,), world space, that a camera turns about: what it looks at.

    The target of a camera that was made of a calibration lies anywhere on its axis. It turns about the point of its
    axis that is as far away as the scene's middle.

    Parameters
    ----------
    camera : Camera
    bounds : (2, 3) of the scene
    nearest : that the point of such a camera is away at least, in diagonals of the scene's box
    """
    if camera.intrinsics is None:
        return np.array(camera.target)
    return middle_on_axis(camera, bounds, nearest)


def middle_on_axis(camera: Camera, bounds: NDArray[np.float64], nearest: float = 0.0) -> NDArray[np.float64]:
    """Return the point (3,), world space, of a camera's axis that is as far away as a scene's middle; parameters are
    those of `pivot_of`."""
    eye, _, _, forward = camera.view()
    low, high = bounds
    distance = max(float(np.dot(0.5 * (low + high) - eye, forward)), nearest * math.dist(low, high))
    return eye + distance * forward
