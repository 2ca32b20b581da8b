"""Polygons with more than three corners: cut into triangles, and found again among triangles.

    in:  corners of polygons, one after the other         out: triangles, as places in that list; k - 2 of a polygon

A polygon is looked at along Newell's normal, the sum of its triangles' area vectors (Sutherland, Sproull & Schumacker
1974).

*Convex* (no corner turns back; a straight corner is no fault) and plane: a fan round its first corner. Convex, but not
plane: a fan round the corner with the smallest x, then y, then z, so that its surface doesn't depend on where its list
begins.

*Everything else* goes to `ears.py`: ears are cut off until a triangle is left, always the one of the best shape. Which
triangles come out depends on the places of the corners alone: not on which is first, nor on the direction, which is
that of the triangles in turn. Holes are drawn where the polygon reaches them by a bridge, an edge that is walked both
ways. Corners that repeat or lie on a straight line give triangles without area. A polygon that crosses itself can't be
cut into triangles of its corners: ears are cut as long as there are any, then the corner of the best shape that turns
the right way, whatever lies in it; so some of it may be covered twice, and some that lies outside be covered. It is
warned of. Ears take time that grows with the square of a polygon's corners, so the sum of these squares is limited,
MOST_STEPS for one call; convex ones have no limit.

Rounding. A corner with coordinates up to M is known to M 2^-53 along each axis, as it was rounded when stored. That
turns a corner between the edges a and b by at most 4 M 2^-53 (|a| + |b|) (each edge moves by up to 2 sqrt(3) M 2^-53,
and sqrt(3) 2 < 4); the computed turn is off by less than 2^-49 |a||b| besides (three products with three roundings
each, their sum, and the normal's own rounding). What is straight within that counts as straight, what is plane within
it as plane.
"""

from typing import NamedTuple

import numpy as np

MOST_STEPS = (
    1 << 29
)  # sum of the squares of the corners of polygons that are cut by ears: one of 23170, or 53687 of 100
CHUNK = 1 << 14  # corners looked at in one go: their arrays stay in the cache
CROSSING = "crosses itself: no triangles between its corners fill it, so more or less than its area may be drawn"
_UNIT = 2.0**-53


class Cut(NamedTuple):
    """Triangles of polygons, in the order of the polygons."""

    corners: np.ndarray  # (n_triangle, 3) int64, places in the list of corners
    polygons: np.ndarray  # (n_triangle,) int32
    crossing: np.ndarray  # (n,) int64, the polygons that cross themselves


class TooManyCorners(Exception):
    """Concave polygons would take too long to cut.

    Attributes
    ----------
    polygon : the largest of them
    fault : text that follows the polygon's place in a message
    """

    def __init__(self, polygon: int, fault: str):
        super().__init__(f"polygon {polygon} {fault}")
        self.polygon, self.fault = polygon, fault


class Rings(NamedTuple):
    """Convex polygons that were cut into fans: their corners, in turn."""

    start: np.ndarray  # (n_ring,) int64, the first triangle of each; its triangles follow each other
    offsets: np.ndarray  # (n_ring + 1,) int64 into `corners`
    corners: np.ndarray  # (n_corner,) int64, the rows that the triangles index, wound as they are
    owners: np.ndarray  # (n_corner,) int64, the triangle that has the edge from this corner to the next


def fan_corners(counts) -> tuple[np.ndarray, np.ndarray]:
    """Cut every polygon into a fan round its first corner.

    Parameters
    ----------
    counts : (n_polygon,) corners of each; those with fewer than 3 yield nothing

    Returns
    -------
    corners : (n_triangle, 3) int64, places in the list of all corners
    polygons : (n_triangle,) int64
    """
    counts = np.asarray(counts, np.int64)
    n_triangle = np.maximum(counts - 2, 0)
    polygons = np.repeat(np.arange(len(counts)), n_triangle)
    step = np.arange(len(polygons)) - np.repeat(np.cumsum(n_triangle) - n_triangle, n_triangle)
    start = (np.cumsum(counts) - counts)[polygons]
    return np.stack([start, start + step + 1, start + step + 2], axis=1), polygons


def cut_polygons(vertices, corners, counts) -> Cut:
    """Cut polygons into triangles, as the module's docstring says.

    Parameters
    ----------
    vertices : (n_vertex, 3) float64; a polygon with a corner that is not finite becomes a fan
    corners : (n_corner,) integers, legal indices of vertices, polygon by polygon
    counts : (n_polygon,) corners of each; those with fewer than 3 yield nothing

    Raises
    ------
    TooManyCorners : cutting the concave ones would take more than MOST_STEPS steps
    """
    counts = np.asarray(counts, np.int64)
    triangles, polygons = fan_corners(counts)
    starts = np.cumsum(counts) - counts
    first_triangle = np.cumsum(np.maximum(counts - 2, 0)) - np.maximum(counts - 2, 0)
    concave = []
    for k in np.unique(counts[counts > 3]).tolist():
        of_size = np.flatnonzero(counts == k)
        step = max(1, CHUNK // k)
        for begin in range(0, len(of_size), step):
            some = of_size[begin : begin + step]
            loops = starts[some, None] + np.arange(k)
            points = vertices[corners[loops.T]]
            is_convex, is_plane = look_at(points)
            concave.append(some[~is_convex])
            if (is_bent := is_convex & ~is_plane).any():
                turned = _turned(loops[is_bent], points[:, is_bent])
                places = first_triangle[some[is_bent], None] + np.arange(k - 2)
                triangles[places] = turned[:, _fan(k)]
    concave = np.sort(np.concatenate(concave)) if concave else np.empty(0, np.int64)
    crossing = np.empty(0, np.int64)
    if len(concave):
        _check_steps(concave, counts)
        from .ears import cut_ears  # compiles; most models have only convex polygons

        is_crossing = np.zeros(len(concave), np.bool_)
        loops = np.ascontiguousarray(corners, np.int64)
        cut_ears(
            np.ascontiguousarray(vertices, np.float64), loops, starts[concave], counts[concave], first_triangle[concave],
            int(counts[concave].max()), triangles, is_crossing,
        )  # fmt: skip
        crossing = concave[is_crossing]
    return Cut(triangles, polygons.astype(np.int32), crossing)


def _check_steps(concave, counts) -> None:
    """Raise TooManyCorners where the concave polygons, given by their numbers, would take more than MOST_STEPS."""
    sizes = counts[concave].astype(np.float64)
    steps = float((sizes * sizes).sum())
    if steps <= MOST_STEPS:
        return
    largest = int(concave[np.argmax(sizes)])
    others = f", and {len(concave) - 1} more are" if len(concave) > 1 else ""
    raise TooManyCorners(
        largest,
        f"is concave and has {counts[largest]} corners{others} to be cut into triangles: the squares of the numbers of corners may "
        f"sum up to {MOST_STEPS} at most, not {steps:.0f}; divide such polygons, or triangulate them in a modelling program",
    )


def listed(numbers) -> str:
    """Return up to five numbers as text, and how many there are where they are more."""
    text = ", ".join(map(str, list(numbers)[:5]))
    return text if len(numbers) <= 5 else f"{text} … ({len(numbers)} in all)"


def look_at(points) -> tuple[np.ndarray, np.ndarray]:
    """Tell which polygons of k corners are convex, and which are plane; those that aren't finite count as both.

    Parameters
    ----------
    points : (k, n, 3) float64, a row is one corner of each polygon

    Returns
    -------
    is_convex, is_plane : (n,) bool
    """
    with np.errstate(all="ignore"):
        x, y, z = (np.ascontiguousarray(points[..., axis]) for axis in range(3))
        size = np.maximum(np.maximum(abs(x), abs(y)), abs(z)).max(axis=0)
        x, y, z = x - x[0], y - y[0], z - z[0]
        extent = np.maximum(np.maximum(abs(x), abs(y)), abs(z)).max(axis=0)
        x, y, z = x / extent, y / extent, z / extent
        slack = 4.0 * _UNIT * size / extent  # rounding of the corners, where the polygon has the size 1
        # Newell's normal: the sum of the areas of a fan.
        normal = [part.sum(axis=0) for part in _cross((x[1:-1], y[1:-1], z[1:-1]), (x[2:], y[2:], z[2:]))]
        length = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
        length[length == 0.0] = 1.0
        unit = [part / length for part in normal]
        edges = [np.concatenate([a[1:], a[:1]]) - a for a in (x, y, z)]
        before = [np.concatenate([edge[-1:], edge[:-1]]) for edge in edges]
        turn, rise = _dot(unit, _cross(before, edges)), _dot(unit, edges)
        along = _dot(before, edges) - rise * np.concatenate([rise[-1:], rise[:-1]])
        long = np.sqrt(_dot(edges, edges))
        long_before = np.concatenate([long[-1:], long[:-1]])
        limit = slack * (long + long_before) + 2.0**-49 * long * long_before
        is_convex = ((turn > limit) | ((turn >= -limit) & (along > 0.0))).all(axis=0)
        if len(x) > 4:  # four corners that turn one way go round once
            is_convex &= np.arctan2(turn, along).sum(axis=0) < 3.0 * np.pi
        height = abs(_dot(unit, (x, y, z))).max(axis=0)
        is_plane = ~(height > slack + 2.0**-49)
        is_finite = np.isfinite(extent)
    return is_convex | ~is_finite, is_plane | ~is_finite


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _fan(k) -> np.ndarray:
    """The triangles (k - 2, 3) of a fan round corner 0."""
    return np.stack([np.zeros(k - 2, np.int64), np.arange(1, k - 1), np.arange(2, k)], axis=1)


def _turned(lists, points) -> np.ndarray:
    """Turn lists (n, k) so that each begins where its points (k, n, 3) have the smallest x, then y, then z."""
    k = len(points)
    is_least = np.ones(points.shape[:2], bool)
    for axis in range(3):
        values = np.where(is_least, points[..., axis], np.inf)
        is_least &= values == values.min(axis=0)
    turns = (is_least.argmax(axis=0)[:, None] + np.arange(k)) % k
    return lists.ravel()[turns + np.arange(0, lists.size, k)[:, None]]


def find_rings(triangles, polygons, points) -> Rings:
    """Find the convex polygons with more than three corners among triangles: those cut into fans, as `cut_polygons`
    does.

    The triangles of a fan follow each other, share a corner, and each begins at the edge where the one before it ends;
    two triangles may do so about either end of the edge between them. What was cut in another way, as by subdivision,
    is not found.

    Parameters
    ----------
    triangles : (n_triangle, 3) integers, rows of `points`
    polygons : (n_triangle,) integers, or None where every triangle is a polygon
    points : (n_point, 3) float64

    Returns
    -------
    Rings, each begun at the corner with the smallest coordinates, so that what is computed of them in this order
    doesn't depend on where a polygon's list begins
    """
    nothing = np.empty(0, np.int64)
    if polygons is None:
        return Rings(nothing, np.zeros(1, np.int64), nothing, nothing)
    is_first = np.append(True, polygons[1:] != polygons[:-1])
    start = np.flatnonzero(is_first)
    count = np.diff(np.append(start, len(polygons)))
    is_whole = np.ones(len(start), bool)
    if (polygons[1:] < polygons[:-1]).any():  # a polygon that is interrupted by others is no fan
        _, name, n_run = np.unique(polygons[start], return_inverse=True, return_counts=True)
        is_whole = n_run[name.ravel()] == 1
    found = [(nothing, nothing.reshape(0, 1), nothing.reshape(0, 1))]
    for n in np.unique(count[is_whole & (count > 1)]).tolist():
        of_size = start[is_whole & (count == n)]
        step = max(1, CHUNK // (n + 2))
        for begin in range(0, len(of_size), step):
            some = of_size[begin : begin + step]
            loops, owners, is_fan = _fan_loops(triangles[some[:, None] + np.arange(n)])
            some, loops, owners = some[is_fan], loops[is_fan], owners[is_fan]
            corners = points[loops.T]
            is_convex, _ = look_at(corners)
            some, corners = some[is_convex], corners[:, is_convex]
            owners = owners[is_convex] + some[:, None]
            found.append((some, _turned(loops[is_convex], corners), _turned(owners, corners)))
    starts = np.concatenate([some for some, _, _ in found])
    sizes = np.concatenate([np.full(len(some), loops.shape[1]) for some, loops, _ in found])
    order = np.argsort(starts, kind="stable")
    ends = np.append(0, np.cumsum(sizes[order]))
    places = np.repeat((np.cumsum(sizes) - sizes)[order] - ends[:-1], sizes[order]) + np.arange(ends[-1])
    corners = np.concatenate([loops.ravel() for _, loops, _ in found])
    owners = np.concatenate([each.ravel() for _, _, each in found])
    return Rings(starts[order], ends, corners[places], owners[places])


def _fan_loops(groups) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the corners of fans in turn (m, n + 2), the triangles at the edges behind them, and which of the groups
    (m, n, 3) of triangles are fans.

    The loop begins at the fan's middle, so that triangle k has the loop's corners 0, k + 1 and k + 2; or, where a
    mirror has turned the triangles round, n - k and n + 1 - k.
    """
    m, n, _ = groups.shape
    loops, owners, is_fan = np.zeros((m, n + 2), np.int64), np.zeros((m, n + 2), np.int64), np.zeros(m, bool)
    owner = np.clip(np.arange(n + 2) - 1, 0, n - 1)
    for turn in range(3):
        if is_fan.all():
            break
        middle = groups[:, 0, turn]
        after = np.stack([_following(groups, middle, 1), _following(groups, middle, 2)], axis=2)  # (m, n, 2), -1: none
        for is_backward in (False, True):
            edges = after[:, ::-1] if is_backward else after
            is_here = (edges[:, 1:, 0] == edges[:, :-1, 1]).all(axis=1) & (after >= 0).all(axis=(1, 2)) & ~is_fan
            loops[is_here] = np.concatenate([middle[:, None], edges[:, :, 0], edges[:, -1:, 1]], axis=1)[is_here]
            owners[is_here] = n - 1 - owner if is_backward else owner
            is_fan |= is_here
    is_new = np.sort(loops, axis=1)
    return loops, owners, is_fan & (is_new[:, 1:] != is_new[:, :-1]).all(axis=1)


def _following(groups, middle, steps):
    """The corner `steps` places after the `middle` (m,) in each triangle of the groups (m, n, 3), -1 where it isn't
    there."""
    is_middle = groups == middle[:, None, None]
    following = np.take_along_axis(groups, (is_middle.argmax(axis=2)[..., None] + steps) % 3, axis=2)[..., 0].astype(
        np.int64
    )
    return np.where(is_middle.any(axis=2), following, -1)
