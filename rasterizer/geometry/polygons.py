"""Convex polygons with more than three corners, drawn about their centres: it doesn't matter which corner comes first.

They are found again among the triangles that they were cut into. In: triangles, and which polygon each came from
(scene/triangulation.py). Out: `Rings`, the corners of each convex polygon in turn; `Split`, triangles about `Centers`.

    d ─────── c        A fan has a diagonal, and along it only two corners count: with the values 0, 1, 0, 1 the middle
    │ ╲     ╱ │        of a quad would be 0 or 1, as the list of its corners begins. Gouraud 1971 interpolates along the
    │   ╲ ╱   │        edges, then along the scanline between them: no corner is preferred, but that depends on how the
    │   ╱ ╲   │        polygon lies in the picture (turned by 45 degrees, the middle of this quad is 0 or 1 again), so a
    │ ╱     ╲ │        turning object shimmers.
    a ─────── b
                       A convex polygon of k > 3 corners is drawn as k triangles between its edges and its centre.

The centre's position is the mean of the corners'. It is no vertex: nothing is lit there. Its values are the means of
the corners': intensities with Gouraud's method, normals with Phong's (not brought to unit length before they are
interpolated, as nothing is along an edge), colours and texture coordinates with both. So:

- values are linear along every edge, as with Gouraud 1971, and equal those of the neighbour on the other side;
- every corner counts alike: what permutes the corners (another first corner, the other direction, a turned or mirrored
  polygon) permutes the triangles, and nothing else. With two corners alike and opposite, as 0, 1, 0, 1, the middle has
  0.5;
- values stay within those of the corners, equal ones stay equal, and values that are linear over a plane polygon stay
  so, because a mean commutes with what is linear: that is all of what a fan does right. Perspective doesn't come into
  it: everything is interpolated in space.

Flat shading has one value a polygon, and needs none of it. Concave polygons keep the triangles of their ears, which
don't depend on the first corner either; a polygon whose corners don't have one point each, as where a crease goes
through it, keeps its own.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import kernel
from ..scene.triangulation import classify_polygons, list_by_size, places_from_first
from .normals import map_all


class Rings(NamedTuple):
    """Convex polygons that were cut into fans: their corners, in turn."""

    start: NDArray[np.int64]  # (n_ring,) the first triangle of each; its triangles follow each other
    offsets: NDArray[np.int64]  # (n_ring + 1,) into `corners`
    corners: NDArray[np.int64]  # (n_corner,) the rows that the triangles index, wound as they are
    owners: NDArray[np.int64]  # (n_corner,) the triangle that has the edge from this corner to the next


class Centers(NamedTuple):
    """The points that are means of others: the last ones of a geometry."""

    first: int  # the number of the first of them
    offsets: NDArray[np.int64]  # (n_center + 1,) into `points`
    points: NDArray[np.int64]  # (n_corner,) the points that each is the mean of


class Split(NamedTuple):
    """Triangles, some of them about centres."""

    vertex: NDArray[np.uint32]  # (3, n) points; a centre's number is that of `Centers`
    face: NDArray[np.uint32]  # (n,) the triangle before, of those that have the same edge of the polygon
    centers: Centers


def find_rings(triangles: NDArray, polygons: NDArray | None, points: NDArray, workers: Any = None) -> Rings:
    """Find the convex polygons with more than three corners among triangles: those that `cut_polygons` cut into fans.

    The triangles of a fan follow each other, share a corner, and each begins at the edge where the one before it ends;
    two triangles may do so about either end of the edge between them. What was cut in another way, as by subdivision,
    is not found.

    Parameters
    ----------
    triangles : (n_triangle, 3) integers, rows of `points`
    polygons : (n_triangle,) integers, or None where every triangle is a polygon
    points : (n_point, 3) float64
    workers : Workers, threads to look on; None = the caller's alone

    Returns
    -------
    Rings, each begun at the corner with the smallest coordinates, so that what is computed of them in this order
    doesn't depend on where a polygon's list begins
    """
    none = np.empty(0, np.int64)
    if polygons is None:
        return Rings(none, np.zeros(1, np.int64), none, none)
    is_first = np.append(True, polygons[1:] != polygons[:-1])
    start = np.flatnonzero(is_first)
    count = np.diff(np.append(start, len(polygons)))
    is_whole = np.ones(len(start), bool)
    if (polygons[1:] < polygons[:-1]).any():  # a polygon that is interrupted by others is no fan
        _, name, n_run = np.unique(polygons[start], return_inverse=True, return_counts=True)
        is_whole = n_run[name.ravel()] == 1

    def find(chunk: tuple[int, NDArray]) -> tuple[NDArray, NDArray, NDArray]:
        k, some = chunk[0], start[chunk[1]]
        loops, owners, is_fan = _fan_loops(triangles[some[:, None] + np.arange(k - 2)])
        some, loops, owners = some[is_fan], loops[is_fan], owners[is_fan]
        corners = points[loops.T]
        is_convex, _ = classify_polygons(corners)
        some, places = some[is_convex], places_from_first(corners[:, is_convex])
        return some, loops[is_convex].ravel()[places], (owners[is_convex] + some[:, None]).ravel()[places]

    fans = map_all(find, list_by_size(count + 2, is_whole & (count > 1)), workers)
    found = [(none, none.reshape(0, 1), none.reshape(0, 1)), *fans]
    starts = np.concatenate([some for some, _, _ in found])
    sizes = np.concatenate([np.full(len(some), loops.shape[1]) for some, loops, _ in found])
    order = np.argsort(starts, kind="stable")
    ends = np.append(0, np.cumsum(sizes[order]))
    sources = np.repeat((np.cumsum(sizes) - sizes)[order] - ends[:-1], sizes[order]) + np.arange(ends[-1])
    corners = np.concatenate([loops.ravel() for _, loops, _ in found])
    owners = np.concatenate([each.ravel() for _, _, each in found])
    return Rings(starts[order], ends, corners[sources], owners[sources])


def _fan_loops(groups: NDArray) -> tuple[NDArray, NDArray, NDArray]:
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
        starts, ends = _opposite(groups, middle)
        has_all = (starts >= 0).all(axis=1)
        for is_backward in (False, True):
            a, b = (starts[:, ::-1], ends[:, ::-1]) if is_backward else (starts, ends)
            is_here = (a[:, 1:] == b[:, :-1]).all(axis=1) & has_all & ~is_fan
            loops[is_here] = np.concatenate([middle[:, None], a, b[:, -1:]], axis=1)[is_here]
            owners[is_here] = n - 1 - owner if is_backward else owner
            is_fan |= is_here
    is_new = np.sort(loops, axis=1)
    return loops, owners, is_fan & (is_new[:, 1:] != is_new[:, :-1]).all(axis=1)


def _opposite(groups: NDArray, middle: NDArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the start and the end of the edge that lies opposite the `middle` (m,) in each triangle of the groups
    (m, n, 3), -1 where it isn't there."""
    a, b, c = (groups[..., k].astype(np.int64) for k in range(3))
    is_a, is_b, is_c = (corner == middle[:, None] for corner in (a, b, c))
    starts = np.where(is_a, b, np.where(is_b, c, np.where(is_c, a, -1)))
    return starts, np.where(is_a, c, np.where(is_b, a, np.where(is_c, b, -1)))


def split_rings(vertex: NDArray, n_point: int, rings: Rings) -> Split:
    """Draw convex polygons as triangles about their centres, where they were in the order of the triangles.

    Parameters
    ----------
    vertex : (3, n_face) uint32, points of triangles
    n_point : how many points there are
    rings : of the triangles, all of them
    """
    sizes = np.diff(rings.offsets)
    is_kept = np.ones(vertex.shape[1], bool)
    is_kept[rings.owners] = False
    kept = np.flatnonzero(is_kept)
    after = np.arange(1, len(rings.corners) + 1)
    after[rings.offsets[1:] - 1] = rings.offsets[:-1]
    number = n_point + np.repeat(np.arange(len(sizes)), sizes)
    pieces = np.stack([rings.corners, rings.corners[after], number]).astype(np.uint32)
    order = np.argsort(np.concatenate([kept, np.repeat(rings.start, sizes)]), kind="stable")
    face = np.concatenate([kept, rings.owners])[order].astype(np.uint32)
    columns = np.ascontiguousarray(np.concatenate([vertex[:, kept], pieces], axis=1)[:, order])
    return Split(columns, face, Centers(n_point, rings.offsets, rings.corners))


def join_rings(parts: list[Rings], first_face: NDArray, first_point: NDArray) -> Rings:
    """Join the rings of several meshes: their triangles and points stand behind each other, from these numbers on."""
    return Rings(
        np.concatenate([rings.start + face for rings, face in zip(parts, first_face, strict=False)]),
        np.concatenate([[0], np.cumsum(np.concatenate([np.diff(rings.offsets) for rings in parts]))]).astype(np.int64),
        np.concatenate([rings.corners + point for rings, point in zip(parts, first_point, strict=False)]),
        np.concatenate([rings.owners + face for rings, face in zip(parts, first_face, strict=False)]),
    )


def with_means(values: NDArray, centers: Centers, workers: Any = None) -> NDArray[np.float64]:
    """Append to values of points (n_point, k) the means over each centre's points, not outside their range by a
    rounding; on the threads of Workers, where there are some."""
    if len(values) == 0:
        return values
    starts, count = centers.offsets[:-1], np.diff(centers.offsets)
    out = np.concatenate([values, np.empty((len(count), values.shape[1]))])

    def fill(k: int) -> None:  # numpy sums columns several times as fast as rows
        corners = values[:, k][centers.points]
        low, high = np.minimum.reduceat(corners, starts), np.maximum.reduceat(corners, starts)
        out[len(values) :, k] = np.clip(np.add.reduceat(corners, starts) / count, low, high)

    map_all(fill, range(values.shape[1]), workers)
    return out


@kernel
def fill_means(values, first, offsets, points, start, end):
    """Give the centres start..end the means of their points' values.

    A mean can leave the range of its values by a rounding only; it may not.

    Parameters
    ----------
    values : (n_point, n_value) float64, changed
    first : the point that centre 0 is
    offsets : (n_center + 1,) int64 into `points`
    points : (n_corner,) int64, the points of each centre, one centre's behind the other's
    """
    for center in range(start, end):
        corner_start, corner_end = offsets[center], offsets[center + 1]
        for k in range(values.shape[1]):
            total, low, high = 0.0, np.inf, -np.inf
            for corner in range(corner_start, corner_end):
                value = values[points[corner], k]
                total += value
                low, high = min(low, value), max(high, value)
            values[first + center, k] = min(max(total / (corner_end - corner_start), low), high)
