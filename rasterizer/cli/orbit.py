"""Cameras on a circle about a model: one distance for all of them, so that it turns and doesn't pump.

    points, directions ─ how far each point reaches ─ the lowest distance that shows all of them ─ cameras

Seen from the direction with the axes right, up, forward, the camera stands at c - D·forward, c a point on the axis that
it goes round. A point p has the coordinates (a, b, d) along the axes, relative to c. With the slopes T_x, T_y of the
view inside its margins it is seen where

    |a| <= T_x (d + D)   and   |b| <= T_y (d + D)

so D is the largest of |a| / T_x - d and |b| / T_y - d, over all points and directions, and of what keeps the nearest
point away. Moved along the axis by s, c takes s·up·pole from b and s·forward·pole from d, which are the same for all
directions of one elevation: D(s) is the largest of four lines, whose lowest point is where two of them meet.
"""

import math
from dataclasses import replace
from itertools import combinations

import numpy as np

from ..choices import AXES
from ..errors import SceneError
from ..scene.camera import Camera
from ..scene.framing import orbit_axes

_NEAREST = 0.01  # share of the extent that stays between the camera and the nearest point


def orbit_cameras(points, azimuths, *, elevation, fov, up, aspect, margin=0.05, orthographic=False) -> list[Camera]:
    """Make cameras on a circle that show all points, from the smallest distance at which each of them does.

    Parameters
    ----------
    points : (n, 3) float64, world space
    azimuths : degrees, as in `Camera.framing`
    elevation, fov, up, aspect, margin, orthographic : as in `Camera.framing`

    Returns
    -------
    list of Camera, one for each azimuth; they look at one point, on the axis through the middle of the points' box

    Raises
    ------
    SceneError : a value that is not legal
    """
    # Its errors are those of the arguments; it also has a lens that is checked.
    lens = Camera.framing(points[:1], azimuths[0], elevation, fov, up, margin, orthographic, aspect)
    if not all(math.isfinite(azimuth) for azimuth in azimuths):
        raise SceneError(f"the azimuth must be finite; given {azimuths[0]}")
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    local = points - middle
    extent = math.dist(points.min(axis=0), points.max(axis=0)) or max(1.0, 1e-6 * float(np.abs(middle).max()))
    filled = 1.0 - 2.0 * margin
    slope_y = filled * (0.5 if orthographic else math.tan(math.radians(fov) / 2.0))
    slope_x = aspect * slope_y
    views = [orbit_axes(azimuth, elevation, up) for azimuth in azimuths]
    pole = np.array(AXES[up])
    heights = np.full(4, -np.inf)  # of the lines: sideways, above, below, towards the camera
    for axes in views:
        a, b, d = axes @ local.T
        ahead = np.zeros(1) if orthographic else d
        sideways, above, below = np.abs(a) / slope_x - ahead, b / slope_y - ahead, -b / slope_y - ahead
        heights = np.maximum(heights, [sideways.max(), above.max(), below.max(), (_NEAREST * extent - ahead).max()])
    rise, ahead = float(views[0][1] @ pole), 0.0 if orthographic else float(views[0][2] @ pole)
    slopes = np.array([ahead, ahead - rise / slope_y, ahead + rise / slope_y, ahead])
    shift, size = _lowest(heights, slopes)
    target = middle + shift * pole
    if orthographic:  # the size is that of the view, and any distance will do that is outside
        height, distance = size, 2.0 * extent + abs(shift)
        lens = replace(lens, height=height)
    else:
        distance = size
    return [replace(lens, position=target - distance * axes[2], target=target, up=axes[1]) for axes in views]


def _lowest(heights, slopes) -> tuple[float, float]:
    """Return where the largest of some lines is lowest, and how high it is there."""

    def largest(s) -> float:
        return float((heights + slopes * s).max())

    found = [0.0]
    for i, j in combinations(range(len(heights)), 2):
        if slopes[i] != slopes[j]:
            found.append(float((heights[j] - heights[i]) / (slopes[i] - slopes[j])))
    best = min(found, key=largest)
    return best, largest(best)
