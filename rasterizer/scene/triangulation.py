"""Polygons with more than three corners, cut into triangles: once, when the mesh is made.

    in:  corners of polygons, one after the other         out: triangles, as places in that list; k - 2 of a polygon

    d ──── c      *Quads* along the shorter diagonal, as it lies in space. Where both have the same length, along that
    │ ╲    │      of the lowest corner: the one with the smallest x, then y, then z. Where only one may be cut along,
    │   ╲  │      because the quad is concave or has a straight corner, along that one.
    a ──── b      *Larger convex polygons* (no corner turns back; a straight corner is no fault): a fan round the lowest
                  corner.
                  *Everything else* goes to geometry/ears.py: ears are cut off until a triangle is left, always the one
                  of the best shape.

Which triangles come out depends on the places of the corners alone: not on which is first, nor on the direction, which
is that of the triangles in turn. A polygon is looked at along Newell's normal, the sum of its triangles' area vectors
(Sutherland, Sproull & Schumacker 1974). A diagonal of a quad cuts off two corners, one on each side; it may be cut
along where both turn the quad's way as seen so: then both halves have an area, and neither lies on the other. Of a quad
that doesn't cross itself, and has an area, at least one may.

Holes are drawn where the polygon reaches them by a bridge, an edge that is walked both ways. Corners that repeat or lie
on a straight line give triangles without area. A polygon that crosses itself can't be cut into triangles of its
corners: ears are cut as long as there are any, then the corner of the best shape that turns the right way, whatever
lies in it; so some of it may be covered twice, and some that lies outside be covered. It is warned of. Ears take time
that grows with the square of a polygon's corners, so the steps of one call are limited, MAX_STEPS; convex polygons have
no limit.

Rounding. A corner with coordinates up to M is known to M 2^-53 along each axis, as it was rounded when stored. That
turns a corner between the edges a and b by at most 4 M 2^-53 (|a| + |b|) (each edge moves by up to 2 sqrt(3) M 2^-53,
and sqrt(3) 2 < 4); the computed turn is off by less than 2^-49 |a||b| besides (three products with three roundings
each, their sum, and the normal's own rounding). What is straight within that counts as straight.

Files round more: to float32, M 2^-24, or to six decimals, 5e-7, which is below M 2^-20 from M = 0.53 on. That moves the
end of a diagonal by up to sqrt(3) M 2^-20, so two diagonals with lengths that differ by up to 4 sqrt(3) M 2^-20, which
is below M 2^-17, may be equally long. They count so, unless they differ by more than 2^-10 of the longer one: far from
the origin, as in maps, that is the quad's shape, and better known than by six digits. The quads of surfaces of
revolution have two diagonals of one length: without that, rounding would turn them at random.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..cores import Workers, n_core
from ..vectors import cross, dot

# Comparisons of boxes, and tests of edges, which count more, that cutting ears may take in one call. A spiral of some
# 20 000 corners takes as many; some seconds.
MAX_STEPS = 1 << 29
CHUNK = 1 << 13  # corners looked at in one go: their arrays stay in the cache
CROSSING = "crosses itself: no triangles between its corners fill it, so more or less than its area may be drawn"
_UNIT = 2.0**-53


class Cut(NamedTuple):
    """Triangles of polygons, in the order of the polygons; None where all polygons are triangles."""

    corners: NDArray[np.int64] | None  # (n_triangle, 3) indices into the list of corners
    polygons: NDArray[np.int32] | None  # (n_triangle,)
    crossing: NDArray[np.int64]  # (n,) the polygons that cross themselves

    def of_corners(self, values: NDArray) -> NDArray:
        """Return what the triangles have, (n_triangle, 3), of values of the corners, (n_corner,)."""
        return values.reshape(-1, 3) if self.corners is None else values[self.corners]

    def of_polygons(self, values: NDArray) -> NDArray:
        """Return what the triangles have, (n_triangle, ...), of values of the polygons, (n_polygon, ...)."""
        return values if self.polygons is None else values[self.polygons]


class TooManyCorners(Exception):
    """Concave polygons would take too long to cut.

    Attributes
    ----------
    polygon : the one that is not cut any more
    fault : text that follows the polygon's place in a message
    """

    def __init__(self, polygon: int, fault: str) -> None:
        super().__init__(f"polygon {polygon} {fault}")
        self.polygon, self.fault = polygon, fault


def cut_polygons(vertices: NDArray, corners: NDArray, counts: ArrayLike) -> Cut:
    """Cut polygons into triangles, as the module's docstring says.

    Parameters
    ----------
    vertices : (n_vertex, 3) float64; a polygon with a corner that is not finite becomes a fan
    corners : (n_corner,) integers, legal indices of vertices, polygon by polygon
    counts : (n_polygon,) corners of each; those with fewer than 3 yield nothing

    Raises
    ------
    TooManyCorners : cutting the concave ones takes more than MAX_STEPS steps
    """
    counts = np.asarray(counts, np.int64)
    if (counts == 3).all():  # as in most large files
        return Cut(None, None, np.empty(0, np.int64))
    starts, n_triangle = np.cumsum(counts) - counts, np.maximum(counts - 2, 0)
    first_triangle = np.cumsum(n_triangle) - n_triangle
    triangles = np.empty((int(n_triangle.sum()), 3), np.int64)

    def cut_simple(chunk: tuple[int, NDArray]) -> NDArray:
        """Cut polygons of k corners; return those that only ears can cut."""
        k, some = chunk
        begin, is_cut = np.zeros(len(some), np.int64), np.ones(len(some), np.bool_)
        if k > 3:
            loops = corners[starts[some] + np.arange(k)[:, None]]
            points = np.stack([vertices[:, axis][loops] for axis in range(3)])
            begin, is_cut = find_diagonals(points) if k == 4 else find_fans(points)
        fan = np.stack([np.zeros(k - 2, np.int64), np.arange(1, k - 1), np.arange(2, k)], axis=1)
        places = starts[some, None, None] + (begin[:, None, None] + fan) % k
        triangles[first_triangle[some, None] + np.arange(k - 2)] = places
        return some[~is_cut]

    chunks = []  # as many polygons of one size as are looked at in one go
    for k in np.flatnonzero(np.bincount(counts)).tolist():
        of_size, step = np.flatnonzero(counts == k), max(1, CHUNK // max(k, 1))
        chunks += [(k, of_size[begin : begin + step]) for begin in range(0, len(of_size) if k > 2 else 0, step)]
    with Workers(n_core()) as workers:
        found = workers.map(cut_simple, chunks)
    concave = np.sort(np.concatenate(found)) if found else np.empty(0, np.int64)
    is_crossing = np.zeros(len(concave), np.bool_)
    if len(concave):
        points, loops = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(corners, np.int64)
        spans = starts[concave], counts[concave], first_triangle[concave]
        from ..geometry import ears  # only here: most polygons are convex

        n_cut = ears.cut_ears(points, loops, *spans, MAX_STEPS, triangles, is_crossing)
        if n_cut < len(concave):
            what = f"is concave and has {counts[concave[n_cut]]} corners: to cut it"
            before = f" and the {n_cut} concave ones before it" if n_cut else ""
            hint = "divide such polygons, or triangulate them in a modelling program"
            fault = f"{what}{before} into triangles takes more than {MAX_STEPS} steps; {hint}"
            raise TooManyCorners(int(concave[n_cut]), fault)
    polygons = np.repeat(np.arange(len(counts), dtype=np.int32), n_triangle)
    return Cut(triangles, polygons, concave[is_crossing])


def listed(numbers: Sequence[int] | NDArray) -> str:
    """Return up to five numbers as text, and how many there are where they are more."""
    text = ", ".join(map(str, list(numbers)[:5]))
    return text if len(numbers) <= 5 else f"{text} … ({len(numbers)} in all)"


def find_diagonals(points: NDArray) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Tell from which corner of quads, 0 or 1, the diagonal begins that they are cut along.

    Parameters
    ----------
    points : (3, 4, n) float64, the corners of each quad

    Returns
    -------
    begin : (n,) int64, 0 where corners are not finite or all in one place
    is_cut : (n,) bool, False where neither diagonal may be cut along
    """
    with np.errstate(all="ignore"):
        turn, limit = measure_turns(points)[:2]
        is_turning = turn > limit
        may_be_0, may_be_1 = is_turning[1::2].all(axis=0), is_turning[0::2].all(axis=0)
        from_0, from_1 = np.sqrt(dot(*2 * [points[:, 2:] - points[:, :2]]))
        slack = np.minimum(2.0**-17 * abs(points).max(axis=(0, 1)), 2.0**-10 * np.maximum(from_0, from_1))
        is_tie = abs(from_0 - from_1) <= slack
        begin = np.where(is_tie, find_lowest(points) % 2, from_1 < from_0)
    has_size = np.isfinite(limit).all(axis=0)
    return np.where(may_be_0 & may_be_1, begin, may_be_1) * has_size, may_be_0 | may_be_1 | ~has_size


def find_fans(points: NDArray) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Tell round which corner polygons are cut into fans.

    Parameters
    ----------
    points : (3, k, n) float64, the corners of each polygon

    Returns
    -------
    begin : (n,) int64, the lowest corner; 0 where corners are not finite or all in one place
    is_convex : (n,) bool, True there, too
    """
    with np.errstate(all="ignore"):
        turn, limit, edges, before, unit = measure_turns(points)
        along = dot(before, edges) - dot(unit, before) * dot(unit, edges)
        is_convex = ((turn > limit) | ((turn >= -limit) & (along > 0.0))).all(axis=0)
        is_convex &= np.arctan2(turn, along).sum(axis=0) < 3.0 * np.pi  # once round, 2 pi; a pentagram has 4 pi
    has_size = np.isfinite(limit).all(axis=0)
    return find_lowest(points) * has_size, is_convex | ~has_size


def find_lowest(points: NDArray) -> NDArray[np.int64]:
    """Return which corner of each polygon has the smallest x, then y, then z: (n,) of points (3, k, n)."""
    is_lowest = np.ones(points.shape[1:], bool)
    for column in points:
        values = np.where(is_lowest, column, np.inf)
        is_lowest &= values == values.min(axis=0)
    return is_lowest.argmax(axis=0)


def measure_turns(points: NDArray) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray]:
    """Measure how the corners of polygons (3, k, n) turn, as seen along their normals, in units of their sizes.

    Returns
    -------
    turn : (k, n) the cross product of the edges before and behind a corner, positive where it turns the polygon's way
    limit : (k, n) how far rounding may have turned a straight corner; NaN where corners are not finite or all in one
        place
    edges, before : (3, k, n) the edge behind each corner, and the one before it
    unit : (3, n) Newell's normal
    """
    size = abs(points).max(axis=(0, 1))
    points = points - points[:, :1]
    extent = abs(points).max(axis=(0, 1))
    points /= extent
    normal = np.stack(cross(points[:, 1:-1], points[:, 2:])).sum(axis=1)  # the sum of the areas of a fan
    length = np.sqrt(dot(normal, normal))
    length[length == 0.0] = 1.0
    unit = normal / length
    edges = np.concatenate([points[:, 1:], points[:, :1]], axis=1) - points
    before = np.concatenate([edges[:, -1:], edges[:, :-1]], axis=1)
    turn = dot(unit, cross(before, edges))
    long = np.sqrt(dot(edges, edges))
    long_before = np.concatenate([long[-1:], long[:-1]])
    slack = 4.0 * _UNIT * size / extent  # rounding of the corners
    return turn, slack * (long + long_before) + 2.0**-49 * long * long_before, edges, before, unit
