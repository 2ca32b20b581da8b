"""The smallest view that shows every vertex: where the eye must stand for a given viewing direction.

    in:  points (world), viewing direction, picture's shape     out: eye, target (world), height of the view

Everything is asked of the points by one question, `_Cloud.farthest`: which of them is furthest along a
direction? Coordinates (a, b, c) are taken along the camera's axes right, up, forward; the perspective view in
one plane is

        margin |  picture  | margin         slope T = tan(half the field of view),
                                            that of the part inside the margins
                 \\       /
                   \\   /   every point: |a - e_a| <= T (c - e_c)
                     eye
"""

import math
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..choices import AXES
from ..errors import SceneError, shown
from .validate import number

Array: TypeAlias = NDArray[np.float64]

# Where the camera stands for an azimuth of 0, by up axis. up × front is the direction in which a positive
# azimuth turns it: +x wherever up leaves x free, else the y-up arrangement rolled about z.
_FRONT = {"x": "z", "y": "z", "z": "-y", "-x": "z", "-y": "-z", "-z": "y"}
_CHUNK = 1 << 14  # points looked at in one go: their temporaries stay in L2
_NEAREST = 0.01  # a perspective eye keeps this share of the subject's size away from the nearest vertex


def orbit_axes(azimuth: float, elevation: float, up: str) -> Array:
    """Return the axes right, up, forward (3, 3), world space, of a camera on an orbit about the up axis.

    They depend smoothly on both angles, at elevations of ±90 degrees too: the camera's up is the direction in
    which it moves when the elevation grows. Angles in degrees; SceneError where they are not finite or the
    elevation is outside -90..90.
    """
    cos_az, sin_az = _cos_sin(number(azimuth, "the azimuth"))
    elevation = number(elevation, "the elevation")
    if not -90.0 <= elevation <= 90.0:
        raise SceneError(f"the elevation must be within -90..90 degrees; given {elevation!r}")
    cos_el, sin_el = _cos_sin(elevation)
    pole, front = np.array(AXES[up]), np.array(AXES[_FRONT[up]])
    side = np.cross(pole, front)
    outward = cos_az * front + sin_az * side
    right = cos_az * side - sin_az * front
    axes = np.stack([right, cos_el * pole - sin_el * outward, -(cos_el * outward + sin_el * pole)])
    return axes + 0.0  # no negative zeros


def top_when_parallel(forward: Array, up: Array) -> Array:
    """Return what is upwards in the picture of a view parallel to `up`: as on an orbit at azimuth 0."""
    axis = max(AXES, key=lambda name: float(np.dot(AXES[name], up)))
    front = np.array(AXES[_FRONT[axis]])
    return front if np.dot(forward, up) > 0.0 else -front


def fit_perspective(subject: Any, axes: Array, slope_x: float, slope_y: float) -> tuple[Array, Array]:
    """Place the eye of a perspective camera so that its view inside the margins just holds the subject.

    Parameters
    ----------
    subject : as in `Camera.framing`
    axes : (3, 3) float64, the camera's right, up, forward, world space
    slope_x, slope_y : T = tangent of half the field of view inside the margins, across and upwards

    Returns
    -------
    eye, target : (3,) float64, world space

    Derivation. A point (a, b, c) is inside the left and right planes when |a - e_a| <= T (c - e_c), which is
    linear in the eye:
        e_a - T e_c >= a - T c   and   -e_a - T e_c >= -a - T c   for every point.
    With the extremes M+ = max(a - T c), M- = max(-a - T c) their sum reads e_c <= -(M+ + M-) / 2T: the line
    where the two extreme planes meet. Up and down give another bound and the smaller rules; its axis is
    tight. The other axis has slack: it is centred by `_center`, which gives the tight axis its
    e_a = (M+ - M-) / 2 as well.
    """
    cloud = _Cloud(subject, axes)
    queries = [(1, 0, -slope_x), (-1, 0, -slope_x), (0, 1, -slope_y), (0, -1, -slope_y)]
    touched = cloud.farthest(np.array(queries))
    reach = np.einsum("ij,ij->i", touched, queries)
    depth_x = -(reach[0] + reach[1]) / (2.0 * slope_x)
    depth_y = -(reach[2] + reach[3]) / (2.0 * slope_y)
    depth = min(depth_x, depth_y, cloud.low[2] - _NEAREST * cloud.size)
    eye = _center(cloud, touched, depth)
    return cloud.to_world(eye), cloud.to_world((eye[0], eye[1], cloud.middle[2]))


def fit_orthographic(subject: Any, axes: Array, share_x: float, share_y: float) -> tuple[Array, Array, float]:
    """Place an orthographic camera in front of the subject, centred, and find the height of its view.

    Parameters
    ----------
    subject, axes : as in `fit_perspective`
    share_x, share_y : width and height inside the margins, as shares of the picture's height

    Returns
    -------
    eye, target : (3,) float64, world space
    height : float, scene units
    """
    cloud = _Cloud(subject, axes)
    width, height, _ = cloud.high - cloud.low
    view_height = max(width / share_x, height / share_y) or cloud.size
    eye = (cloud.middle[0], cloud.middle[1], cloud.low[2] - cloud.size)
    return cloud.to_world(eye), cloud.to_world(cloud.middle), float(view_height)


def _center(cloud: "_Cloud", touched: Array, depth: float) -> Array:
    """Return the eye at a given depth that sees as far to the left as to the right, above as below.

    The half extent s of the projection is the least with |a - e_a| <= s w for every point, w = c - depth; by
    the sum of the two sides
        s = max over pairs of (a_i - a_j) / (w_i + w_j),   e_a = the middle of a_i - s w_i and a_j + s w_j.
    The best pair among the points known so far gives an s; the points furthest along ±a - s c join them until
    s grows no more.

    Source: Dinkelbach 1967, Management Science 13(7), 492-498 (ratio of linear functions; finite,
    superlinear).
    """
    known = np.concatenate([touched, cloud.extremes])
    before = np.full(2, -1.0)
    slopes = _half_extents(known, depth)[0]
    while (slopes > before).any():
        (s, r), before = slopes, slopes
        found = cloud.farthest(np.array([(1, 0, -s), (-1, 0, -s), (0, 1, -r), (0, -1, -r)]))
        # Asked for indices, too, np.unique doesn't import np.ma.
        known = np.unique(np.concatenate([known, found]), axis=0, return_index=True)[0]
        slopes = np.maximum(_half_extents(known, depth)[0], before)
    return np.append(_half_extents(known, depth)[1], depth)


def _half_extents(points: Array, depth: float) -> tuple[Array, Array]:
    """Return the half extents (2,) of the centred projection of a few points, and the eye (2,) for it."""
    w = points[:, 2] - depth
    slopes, centers = np.empty(2), np.empty(2)
    for axis in range(2):
        a = points[:, axis]
        ratios = (a[:, None] - a[None, :]) / (w[:, None] + w[None, :])
        i, j = np.unravel_index(np.argmax(ratios), ratios.shape)
        slopes[axis] = ratios[i, j]
        centers[axis] = 0.5 * ((a[i] - slopes[axis] * w[i]) + (a[j] + slopes[axis] * w[j]))
    return slopes, centers


class _Cloud:
    """The points of a subject in the camera's axes, relative to one of them (`origin`, world), so that a far
    offset costs no digits.

    `low`, `high`, `middle` : (3,) extent along the axes; `extremes` : (6, 3) the points that reach them
    `size` : length of that box's diagonal; for a single point an arbitrary length that its coordinates can
        resolve
    """

    def __init__(self, subject: Any, axes: Array) -> None:
        self._sets, self._axes = _point_sets(subject), axes
        self._origin = self._sets[0][0].astype(np.float64)
        self.extremes = self.farthest(np.concatenate([np.eye(3), -np.eye(3)]))
        if not np.isfinite(self.extremes).all():
            raise SceneError("the points to be framed must be finite; some are not")
        self.low, self.high = self.extremes.min(axis=0), self.extremes.max(axis=0)
        self.middle = 0.5 * (self.low + self.high)
        self.size = math.dist(self.low, self.high) or max(1.0, 1e-6 * float(np.abs(self._origin).max()))

    def farthest(self, directions: Array) -> Array:
        """Return the point (k, 3) that is furthest along each direction (k, 3); the first of several."""
        directions_world = directions @ self._axes
        best, points = np.full(len(directions), -np.inf), np.full((len(directions), 3), np.nan)
        for chunk in (s[i : i + _CHUNK] for s in self._sets for i in range(0, len(s), _CHUNK)):
            local = chunk - self._origin
            scores = directions_world @ local.T
            where = scores.argmax(axis=1)
            reached = np.take_along_axis(scores, where[:, None], axis=1)[:, 0]
            is_better = (reached > best) | np.isnan(reached)
            best[is_better], points[is_better] = reached[is_better], local[where[is_better]]
        return points @ self._axes.T

    def to_world(self, p_local: ArrayLike) -> Array:
        """Return a point given along the camera's axes in world coordinates."""
        return self._origin + np.asarray(p_local) @ self._axes


def _point_sets(subject: Any) -> list[NDArray[Any]]:
    """Return the points to be framed as a list of (n, 3) arrays that are not empty."""
    if hasattr(subject, "meshes"):
        return [mesh.used_vertices for mesh in subject.meshes]
    points = getattr(subject, "used_vertices", getattr(subject, "vertices", subject))
    try:
        points = np.asarray(points)
        is_real = points.dtype.kind in "fiu"
    except (TypeError, ValueError):
        is_real = False
    if not is_real or points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        legal = "bounds (2, 3), points (n, 3), a mesh or a scene"
        raise SceneError(f"what is framed must be {legal}; given {shown(subject)}")
    if points.shape == (2, 3) and not hasattr(subject, "vertices"):  # bounds: all corners of the box
        points = np.stack(np.meshgrid(*points.T, indexing="ij"), axis=-1).reshape(-1, 3)
    return [points]


def _cos_sin(degrees: float) -> tuple[float, float]:
    """Return cosine and sine of an angle in degrees, exact at multiples of 90."""
    quarter, rest = divmod(degrees, 90.0)
    if rest == 0.0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    return math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
