"""The smallest view that shows every vertex: where the eye must stand for a given viewing direction; and, at the end,
which axis of a model points upwards.

    in:  points (world), viewing direction, picture's shape     out: eye, target (camera's axes), height of the view

Everything is asked of the points by one question, `Cloud.farthest`: which of them is furthest along a direction?
Coordinates (a, b, c) are taken along the camera's axes right, up, forward; the perspective view in one plane is

        margin |  picture  | margin         slope T = tan(half the field of view),
                                            that of the part inside the margins
                 \\       /
                   \\   /   every point: |a - e_a| <= T (c - e_c)
                     eye
"""

import math
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..choices import AXES
from ..cores import Workers, n_core
from ..errors import SceneError, shown
from .arrays import real_array
from .validate import choice, flag, is_whole, items_of, number, picture_size

Array: TypeAlias = NDArray[np.float64]

# Where the camera stands for an azimuth of 0, by up axis, and the direction in which a positive azimuth turns it:
# up × front, +x wherever up leaves x free, else the y-up arrangement rolled about z.
_FRONT = {"x": "z", "y": "z", "z": "-y", "-x": "z", "-y": "-z", "-z": "y"}
_SIDE = {"x": "-y", "-x": "y"} | dict.fromkeys(("y", "z", "-y", "-z"), "x")
MIN_FOV = 1e-6  # degrees: a hair in 10 km
_ASPECT, _MAX_ASPECT = 4 / 3, 1e9  # of a picture: beyond the limit framing would divide by nothing
_FIRST, _MAX_CAMERAS = 35.0, 100_000  # azimuth of an orbit's first camera, degrees; and how many it may have
_CHUNK = 1 << 14  # points looked at in one go: their temporaries stay in L2
_FEW = 8 * _CHUNK  # points that are copied once for all that is asked of them
_NEAREST = 0.01  # a perspective eye keeps this share of the subject's size away from the nearest vertex


class Lens(NamedTuple):
    """What a picture that is framed shows."""

    fov: float | None  # degrees, vertical; None without perspective
    aspect: float  # width / height
    filled: float  # share of width and height that the subject may fill

    def fit(self, cloud: "Cloud") -> tuple[Array, Array, float | None]:
        """Return eye and target (3,) along the camera's axes, and the height of a view without perspective."""
        if self.fov is None:
            return fit_orthographic(cloud, self.aspect * self.filled, self.filled)
        slope = self.filled * math.tan(math.radians(self.fov) / 2.0)
        return *fit_perspective(cloud, self.aspect * slope, slope), None


def checked_lens(orthographic: object, fov: object, margin: object, aspect: object, size: Any) -> Lens:
    """Return the lens for a margin and a shape, or a size, of the picture; SceneError where they are not legal."""
    angle = None if flag(orthographic, "orthographic") else checked_fov(fov)
    margin = number(margin, "the margin", low=0, below=0.5, unit=" of the picture")
    if size is not None:
        if aspect is not None:
            raise SceneError(f"a picture's shape is its size or its aspect; given {shown(size)} and {shown(aspect)}")
        width, height = picture_size((size, size) if is_whole(size) else size)
        aspect = width / height
    return Lens(angle, _ASPECT if aspect is None else checked_aspect(aspect), 1.0 - 2.0 * margin)


def checked_fov(fov: object) -> float:
    """Return a field of view, degrees; SceneError for what is none."""
    return number(fov, "the camera's fov", low=MIN_FOV, below=180, unit=" degrees")


def checked_aspect(aspect: object) -> float:
    """Return the width / height of a picture; SceneError for what is none."""
    return number(aspect, "the aspect (width / height)", low=1.0 / _MAX_ASPECT, high=_MAX_ASPECT)


def up_axis(subject: Any, up: object) -> str:
    """Return the axis that points upwards: the one given, else a scene's own, else y; SceneError for no axis."""
    own = getattr(subject, "up", None) if hasattr(subject, "meshes") else None
    return choice((own or "y") if up is None else up, AXES, "up")


def checked_azimuths(azimuths: Any) -> list[float]:
    """Return the angles of an orbit in degrees: those given, or as many as given, evenly round the whole turn."""
    if is_whole(azimuths, 1, _MAX_CAMERAS):
        return [_FIRST + 360.0 * k / azimuths for k in range(azimuths)]
    angles = items_of(azimuths)
    if not angles:
        legal = f"angles in degrees, or how many, 1 to {_MAX_CAMERAS}"
        raise SceneError(f"azimuths must be {legal}; given {shown(azimuths)}")
    return [number(angle, "each azimuth") for angle in angles]


def orbit_axes(azimuth: float, elevation: float, up: str) -> Array:
    """Return the axes right, up, forward (3, 3), world space, of a camera on an orbit about the up axis.

    They depend smoothly on both angles, at elevations of ±90 degrees too: the camera's up is the direction in
    which it moves when the elevation grows. Angles in degrees; SceneError where they are not finite or the
    elevation is outside -90..90.
    """
    azimuth = number(azimuth, "the azimuth")
    elevation = number(elevation, "the elevation", low=-90, high=90, unit=" degrees")
    (cos_az, sin_az), (cos_el, sin_el) = cos_sin(azimuth), cos_sin(elevation)
    pole, front, side = np.array([AXES[up], AXES[_FRONT[up]], AXES[_SIDE[up]]])
    outward = cos_az * front + sin_az * side
    right = cos_az * side - sin_az * front
    axes = np.stack([right, cos_el * pole - sin_el * outward, -(cos_el * outward + sin_el * pole)])
    return axes + 0.0  # no negative zeros


def top_when_parallel(forward: Array, up: Array) -> Array:
    """Return what is upwards in the picture of a view parallel to `up`: as on an orbit at azimuth 0."""
    axis = max(AXES, key=lambda name: float(np.dot(AXES[name], up)))
    front = np.array(AXES[_FRONT[axis]])
    return front if np.dot(forward, up) > 0.0 else -front


def fit_perspective(cloud: "Cloud", slope_x: float, slope_y: float) -> tuple[Array, Array]:
    """Place the eye of a perspective camera so that its view inside the margins just holds the subject.

    Parameters
    ----------
    cloud : the points of the subject along the camera's axes
    slope_x, slope_y : T = tangent of half the field of view inside the margins, across and upwards

    Returns
    -------
    eye, target : (3,) float64, along the camera's axes, as the cloud's points

    Derivation. A point (a, b, c) is inside the left and right planes when |a - e_a| <= T (c - e_c), which is
    linear in the eye:
        e_a - T e_c >= a - T c   and   -e_a - T e_c >= -a - T c   for every point.
    With the extremes M+ = max(a - T c), M- = max(-a - T c) their sum reads e_c <= -(M+ + M-) / 2T: the line
    where the two extreme planes meet. Up and down give another bound and the smaller rules; its axis is
    tight. The other axis has slack: it is centred by `_center`, which gives the tight axis its
    e_a = (M+ - M-) / 2 as well.
    """
    queries = [(1, 0, -slope_x), (-1, 0, -slope_x), (0, 1, -slope_y), (0, -1, -slope_y)]
    touched = cloud.farthest(np.array(queries))
    right, left, top, bottom = np.einsum("ij,ij->i", touched, queries)
    depth_x = -(right + left) / (2.0 * slope_x)
    depth_y = -(top + bottom) / (2.0 * slope_y)
    depth = min(depth_x, depth_y, cloud.low[2] - _NEAREST * cloud.size)
    eye = _center(cloud, touched, depth)
    return eye, np.array((eye[0], eye[1], cloud.middle[2]))


def fit_orthographic(cloud: "Cloud", share_x: float, share_y: float) -> tuple[Array, Array, float]:
    """Place an orthographic camera in front of the subject, centred, and find the height of its view.

    Parameters
    ----------
    cloud : as in `fit_perspective`
    share_x, share_y : width and height inside the margins, as shares of the picture's height

    Returns
    -------
    eye, target : (3,) float64, along the camera's axes
    height : float, scene units
    """
    width, height, _ = cloud.high - cloud.low
    view_height = max(width / share_x, height / share_y) or cloud.size
    eye = np.array((cloud.middle[0], cloud.middle[1], cloud.low[2] - cloud.size))
    return eye, cloud.middle, float(view_height)


def _center(cloud: "Cloud", touched: Array, depth: float) -> Array:
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
    before, (slopes, centers) = np.full(2, -1.0), _half_extents(known, depth)
    while (slopes > before).any():
        (s, r), before = slopes, slopes
        found = cloud.farthest(np.array([(1, 0, -s), (-1, 0, -s), (0, 1, -r), (0, -1, -r)]))
        known = np.array(sorted({*map(tuple, known.tolist()), *map(tuple, found.tolist())}))
        slopes, centers = _half_extents(known, depth)
        slopes = np.maximum(slopes, before)
    return np.append(centers, depth)


def _half_extents(points: Array, depth: float) -> tuple[Array, Array]:
    """Return the half extents (2,) of the centred projection of a few points, and the eye (2,) for it."""
    w = points[:, 2] - depth
    sums, slopes, centers = w[:, None] + w, np.empty(2), np.empty(2)
    for axis in range(2):
        a = points[:, axis]
        ratios = (a[:, None] - a) / sums
        i, j = divmod(int(ratios.argmax()), len(a))
        slopes[axis] = ratios[i, j]
        centers[axis] = 0.5 * ((a[i] - slopes[axis] * w[i]) + (a[j] + slopes[axis] * w[j]))
    return slopes, centers


class Cloud:
    """The points of a subject in the camera's axes, relative to one of them (`origin`, world), so that a far
    offset costs no digits.

    `low`, `high`, `middle` : (3,) extent along the axes; `extremes` : (6, 3) the points that reach them
    `size` : length of that box's diagonal; for a single point an arbitrary length that its coordinates can
        resolve
    """

    def __init__(self, sets: list[NDArray[Any]], axes: Array, origin: Array | None = None) -> None:
        self._axes, self._origin = axes, sets[0][0].astype(np.float64) if origin is None else origin
        # Few points are turned into columns once, and are soon looked through: no thread is woken for them.
        is_few = sum(map(len, sets)) <= _FEW
        self._chunks = [points[i : i + _CHUNK] for points in sets for i in range(0, len(points), _CHUNK)]
        self._columns = [self._columns_of(np.concatenate(sets))] if is_few else []
        self.extremes = self.farthest(np.concatenate([np.eye(3), -np.eye(3)]))
        if not np.isfinite(self.extremes).all():
            raise SceneError("the points to be framed must be finite; some are not")
        self.low, self.high = self.extremes.min(axis=0), self.extremes.max(axis=0)
        self.middle = 0.5 * (self.low + self.high)
        self.size = math.dist(self.low, self.high) or max(1.0, 1e-6 * float(np.abs(self._origin).max()))

    def farthest(self, directions: Array) -> Array:
        """Return the point (k, 3) that is furthest along each direction (k, 3); the first of several."""
        directions_world = directions @ self._axes

        def search(columns: Array) -> tuple[Array, Array]:
            """Return how far the furthest of some points are along the directions, (k,), and these, (k, 3)."""
            scores = directions_world @ columns
            where = scores.argmax(axis=1)
            return scores[np.arange(len(scores)), where], columns.T[where]

        with np.errstate(invalid="ignore"):  # of points that aren't finite, which are refused
            if self._columns:
                parts = list(map(search, self._columns))
            else:
                with Workers(n_core()) as workers:
                    parts = workers.map(lambda points: search(self._columns_of(points)), self._chunks)
            reached, found = map(np.array, zip(*parts, strict=True))
            return found[reached.argmax(axis=0), np.arange(len(directions))] @ self._axes.T

    def _columns_of(self, points: NDArray[Any]) -> Array:
        """Return points relative to the origin, (3, n): numpy's loops over columns are long."""
        columns = np.array(points.T, np.float64, order="C")
        columns -= self._origin[:, None]
        return columns

    def to_world(self, p_local: ArrayLike, axes: Array | None = None) -> Array:
        """Return a point given along the camera's axes, or along other ones (3, 3), in world coordinates."""
        return self._origin + np.asarray(p_local) @ (self._axes if axes is None else axes)


class SweptCloud(Cloud):
    """The circles that the points of a subject run through when it is turned about an upright axis through its middle.

    Derivation. A point at the height h above the middle and at the distance r from the axis runs through a circle.
    Along a direction D = D_h + D_v, D_v along the axis, the circle's furthest point lies where D_h points: at
    h + r·D_h/|D_h|, D·h + r·|D_h| away. So `farthest` is exact, and what holds the circles holds the subject at every
    angle. They look the same from every azimuth: one fit serves all cameras of an orbit.
    """

    def __init__(self, sets: list[NDArray[Any]], axes: Array, pole: ArrayLike) -> None:
        low = np.min([points.min(axis=0) for points in sets], axis=0).astype(np.float64)
        high = np.max([points.max(axis=0) for points in sets], axis=0)
        middle = 0.5 * low + 0.5 * high
        self._pole = np.asarray(pole)
        self._circles = []  # heights above the middle and distances from the axis, (n,) each, set by set
        for points in sets:
            local = points - middle
            heights = local @ self._pole
            self._circles.append((heights, np.linalg.norm(local - heights[:, None] * self._pole, axis=1)))
        super().__init__(sets, axes, middle)

    def farthest(self, directions: Array) -> Array:
        """Return the point (k, 3) of the circles that is furthest along each direction (k, 3)."""
        directions_world = directions @ self._axes
        upward = directions_world @ self._pole
        across = directions_world - upward[:, None] * self._pole
        length = np.linalg.norm(across, axis=1)
        across /= np.where(length > 0.0, length, 1.0)[:, None]
        best, points = np.full(len(directions), -np.inf), np.full((len(directions), 3), np.nan)
        for heights, radii in self._circles:
            for k in range(len(directions)):
                scores = upward[k] * heights + length[k] * radii
                where = scores.argmax()
                if scores[where] > best[k]:
                    best[k], points[k] = scores[where], heights[where] * self._pole + radii[where] * across[k]
        return points @ self._axes.T

    def seen_of_axis(self, eye: Array, target: Array) -> Array:
        """Return where the view from an eye meets the axis, (3,) along the camera's axes: the same point for all
        cameras of an orbit. Along the axis, and where it lies behind the eye, it is the target that is given."""
        pole = self._axes @ self._pole
        if pole[1] == 0.0:
            return target
        met = eye[1] / pole[1] * pole
        return met if met[2] > eye[2] else target


def point_sets(subject: Any) -> list[NDArray[Any]]:
    """Return the points to be framed as a list of (n, 3) arrays that are not empty."""
    if hasattr(subject, "meshes"):
        return [mesh.used_vertices for mesh in subject.meshes]
    points = real_array(getattr(subject, "used_vertices", getattr(subject, "vertices", subject)))
    if points is None or points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        legal = "bounds (2, 3), points (n, 3), a mesh or a scene"
        raise SceneError(f"what is framed must be {legal}; given {shown(subject)}")
    if points.shape == (2, 3) and not hasattr(subject, "vertices"):  # bounds: all corners of the box
        points = corners_of_box(points)
    return [points]


def corners_of_box(bounds: NDArray[Any]) -> NDArray[Any]:
    """Return the corners (8, 3) of a box (2, 3)."""
    return np.stack(np.meshgrid(*bounds.T, indexing="ij"), axis=-1).reshape(-1, 3)


def cos_sin(degrees: float) -> tuple[float, float]:
    """Return cosine and sine of an angle in degrees, exact at multiples of 90."""
    quarter, rest = divmod(degrees, 90.0)
    if rest == 0.0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    return math.cos(math.radians(degrees)), math.sin(math.radians(degrees))


def rotation(axis: ArrayLike, angle: float) -> NDArray[np.float64]:
    """Return the matrix (3, 3) that turns vectors about a unit axis, counter-clockwise as seen from its tip.

    Parameters
    ----------
    axis : (3,) unit vector
    angle : degrees; at multiples of 90 the matrix is exact

    Source: Rodrigues 1840, J. Math. Pures Appl. 5, 380-440: R = cos θ·1 + sin θ·[a]× + (1 - cos θ)·a aᵀ.
    """
    cos, sin = cos_sin(angle)
    x, y, z = np.asarray(axis, np.float64)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return cos * np.eye(3) + sin * across + (1.0 - cos) * np.outer((x, y, z), (x, y, z))


# --- which axis of a model points upwards --------------------------------------------------------------------

_NEAR = 1e-3  # of the extent: what lies within it of the lowest point stands on the ground
_LEVEL = 0.99  # cosine: such faces lie level, within 8 degrees
_EVIDENCE = 0.02  # share of the area that has to lie on the ground before it says what is down


def guess_up(points: Array, faces: NDArray[Any], bounds: Array) -> tuple[str | None, str]:
    """Guess which axis of a model points upwards: things stand on a flat underside.

    Parameters
    ----------
    points : (n_vertex, 3) float64
    faces : (n_face, 3) integers, all or some
    bounds : (2, 3) float64, lowest and highest corner of the box round the model

    Returns
    -------
    "y", "z", "-y" or "-z", or None where nothing tells; and the reason, a text

    The evidence for an axis is the area of the faces that lie level at its lowest end and face down, less that of those
    at its other end that face up: a box has as much of either, and says nothing.
    """
    corners, (low, high) = points[faces], bounds
    names, shares = ("y", "z", "-y", "-z"), np.zeros(4)
    with np.errstate(all="ignore"):
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas = np.linalg.norm(normals, axis=1)
        for k, name in enumerate(names):
            axis, sign = "xyz".index(name[-1]), sum(AXES[name])
            bottom = low[axis] if sign > 0 else high[axis]
            is_base = (np.abs(corners[:, :, axis] - bottom) <= _NEAR * (high - low).max()).all(axis=1)
            is_base &= high[axis] - low[axis] > _NEAR * (high - low).max()  # a flat thing lies on either side
            is_base &= -sign * normals[:, axis] >= _LEVEL * areas
            shares[k] = areas[is_base].sum() / areas.sum()
        evidence = shares - np.roll(shares, 2)  # that of the opposite axis
    best = int(evidence.argmax())
    if not evidence[best] >= _EVIDENCE:
        return None, "no flat underside tells which side is down"
    return names[best], f"then it stands on a flat underside, {100.0 * shares[best]:.0f} % of its surface"
