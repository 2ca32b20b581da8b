"""Polygons with more than three corners, cut into triangles.

    in:  corners of polygons, one after the other         out: triangles, as places in that list; k - 2 of a polygon

A polygon is looked at along Newell's normal, the sum of its triangles' area vectors (Sutherland, Sproull & Schumacker
1974).

*Convex* (no corner turns back; a straight corner is no fault) and plane: a fan round its first corner. Convex, but not
plane: a fan round the corner with the smallest x, then y, then z, so that its surface doesn't depend on where its list
begins.

*Everything else* goes to geometry/ears.py: ears are cut off until a triangle is left, always the one of the best shape.
Which triangles come out depends on the places of the corners alone: not on which is first, nor on the direction, which
is that of the triangles in turn. Holes are drawn where the polygon reaches them by a bridge, an edge that is walked
both ways. Corners that repeat or lie on a straight line give triangles without area. A polygon that crosses itself
can't be cut into triangles of its corners: ears are cut as long as there are any, then the corner of the best shape
that turns the right way, whatever lies in it; so some of it may be covered twice, and some that lies outside be
covered. It is warned of. Ears take time that grows with the square of a polygon's corners, so the steps of one call are
limited, MAX_STEPS; convex polygons have no limit.

Rounding. A corner with coordinates up to M is known to M 2^-53 along each axis, as it was rounded when stored. That
turns a corner between the edges a and b by at most 4 M 2^-53 (|a| + |b|) (each edge moves by up to 2 sqrt(3) M 2^-53,
and sqrt(3) 2 < 4); the computed turn is off by less than 2^-49 |a||b| besides (three products with three roundings
each, their sum, and the normal's own rounding). What is straight within that counts as straight, what is plane within
it as plane.
"""

from collections.abc import Sequence
from importlib import import_module
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..cores import Workers, n_core
from .arrays import distinct

# Comparisons of boxes, and tests of edges, which count more, that cutting ears may take in one call. A spiral of some
# 30 000 corners takes as many; some seconds.
MAX_STEPS = 1 << 30
CHUNK = 1 << 14  # corners looked at in one go: their arrays stay in the cache
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


def fan_corners(counts: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Cut every polygon into a fan round its first corner.

    Parameters
    ----------
    counts : (n_polygon,) corners of each; those with fewer than 3 yield nothing

    Returns
    -------
    corners : (n_triangle, 3) int64, indices into the list of all corners
    polygons : (n_triangle,) int64
    """
    counts = np.asarray(counts, np.int64)
    n_triangle = np.maximum(counts - 2, 0)
    polygons = np.repeat(np.arange(len(counts)), n_triangle)
    step = np.arange(len(polygons)) - np.repeat(np.cumsum(n_triangle) - n_triangle, n_triangle)
    start = (np.cumsum(counts) - counts)[polygons]
    return np.stack([start, start + step + 1, start + step + 2], axis=1), polygons


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
    triangles, polygons = fan_corners(counts)
    starts = np.cumsum(counts) - counts
    first_triangle = np.cumsum(np.maximum(counts - 2, 0)) - np.maximum(counts - 2, 0)

    def cut_convex(chunk: tuple[int, NDArray]) -> NDArray:
        """Turn the fans of those that are bent; return the concave ones."""
        k, some = chunk
        loops = starts[some, None] + np.arange(k)
        points = vertices[corners[loops.T]]
        is_convex, is_plane = classify_polygons(points)
        if (is_bent := is_convex & ~is_plane).any():
            turned = loops[is_bent].ravel()[places_from_first(points[:, is_bent])]
            rows = first_triangle[some[is_bent], None] + np.arange(k - 2)
            triangles[rows] = turned[:, _fan(k)]
        return some[~is_convex]

    with Workers(n_core()) as workers:
        found = workers.map(cut_convex, list_by_size(counts, counts > 3))
    concave = np.sort(np.concatenate(found)) if found else np.empty(0, np.int64)
    is_crossing = np.zeros(len(concave), np.bool_)
    if len(concave):
        points, loops = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(corners, np.int64)
        spans = starts[concave], counts[concave], first_triangle[concave]
        ears = import_module("rasterizer.geometry.ears")
        n_cut = ears.cut_ears(points, loops, *spans, MAX_STEPS, triangles, is_crossing)
        if n_cut < len(concave):
            what = f"is concave and has {counts[concave[n_cut]]} corners: to cut it"
            before = f" and the {n_cut} concave ones before it" if n_cut else ""
            raise TooManyCorners(
                int(concave[n_cut]),
                f"{what}{before} into triangles takes more than {MAX_STEPS} steps; divide such polygons, or "
                "triangulate them in a modelling program",
            )
    return Cut(triangles, polygons.astype(np.int32), concave[is_crossing])


def list_by_size(counts: NDArray[np.int64], is_listed: NDArray[np.bool_]) -> list[tuple[int, NDArray[np.int64]]]:
    """List polygons with equally many corners together, as many as are looked at in one go: how many corners these
    have, and which they are.

    Parameters
    ----------
    counts : (n_polygon,) corners of each
    is_listed : (n_polygon,)
    """
    found = []
    for k in distinct(counts[is_listed]).tolist():
        of_size, step = np.flatnonzero(is_listed & (counts == k)), max(1, CHUNK // k)
        found += [(k, of_size[begin : begin + step]) for begin in range(0, len(of_size), step)]
    return found


def listed(numbers: Sequence[int] | NDArray) -> str:
    """Return up to five numbers as text, and how many there are where they are more."""
    text = ", ".join(map(str, list(numbers)[:5]))
    return text if len(numbers) <= 5 else f"{text} … ({len(numbers)} in all)"


def classify_polygons(points: NDArray) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
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


def _dot(a: Sequence[NDArray], b: Sequence[NDArray]) -> NDArray:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Sequence[NDArray], b: Sequence[NDArray]) -> tuple[NDArray, NDArray, NDArray]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _fan(k: int) -> NDArray[np.int64]:
    """Return the triangles (k - 2, 3) of a fan round corner 0."""
    return np.stack([np.zeros(k - 2, np.int64), np.arange(1, k - 1), np.arange(2, k)], axis=1)


def places_from_first(points: NDArray) -> NDArray[np.int64]:
    """Return where entries of n lists of k are taken from, (n, k) places in all of them one behind the other, so that
    each begins where its points (k, n, 3) have the smallest x, then y, then z."""
    k, n = points.shape[:2]
    is_min = np.ones(points.shape[:2], bool)
    for axis in range(3):
        values = np.where(is_min, points[..., axis], np.inf)
        is_min &= values == values.min(axis=0)
    columns = (is_min.argmax(axis=0)[:, None] + np.arange(k)) % k
    return columns + np.arange(0, n * k, k)[:, None]
