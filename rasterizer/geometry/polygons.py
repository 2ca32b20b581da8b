"""Polygons with more than three corners, found again among the triangles that they were cut into
(scene/triangulation.py).

in:  triangles, and which polygon each came from      out: `Rings`, the corners of each convex polygon in turn
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.arrays import distinct
from ..scene.triangulation import CHUNK, classify_polygons, rotate_to_first


class Rings(NamedTuple):
    """Convex polygons that were cut into fans: their corners, in turn."""

    start: NDArray[np.int64]  # (n_ring,) the first triangle of each; its triangles follow each other
    offsets: NDArray[np.int64]  # (n_ring + 1,) into `corners`
    corners: NDArray[np.int64]  # (n_corner,) the rows that the triangles index, wound as they are
    owners: NDArray[np.int64]  # (n_corner,) the triangle that has the edge from this corner to the next


def find_rings(triangles: NDArray, polygons: NDArray | None, points: NDArray) -> Rings:
    """Find the convex polygons with more than three corners among triangles: those that `cut_polygons` cut into fans.

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
    for n in distinct(count[is_whole & (count > 1)]).tolist():
        of_size = start[is_whole & (count == n)]
        step = max(1, CHUNK // (n + 2))
        for begin in range(0, len(of_size), step):
            some = of_size[begin : begin + step]
            loops, owners, is_fan = _fan_loops(triangles[some[:, None] + np.arange(n)])
            some, loops, owners = some[is_fan], loops[is_fan], owners[is_fan]
            corners = points[loops.T]
            is_convex, _ = classify_polygons(corners)
            some, corners = some[is_convex], corners[:, is_convex]
            owners = owners[is_convex] + some[:, None]
            found.append((some, rotate_to_first(loops[is_convex], corners), rotate_to_first(owners, corners)))
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
        after = np.stack([_following(groups, middle, 1), _following(groups, middle, 2)], axis=2)  # (m, n, 2), -1: none
        for is_backward in (False, True):
            edges = after[:, ::-1] if is_backward else after
            is_here = (edges[:, 1:, 0] == edges[:, :-1, 1]).all(axis=1) & (after >= 0).all(axis=(1, 2)) & ~is_fan
            loops[is_here] = np.concatenate([middle[:, None], edges[:, :, 0], edges[:, -1:, 1]], axis=1)[is_here]
            owners[is_here] = n - 1 - owner if is_backward else owner
            is_fan |= is_here
    is_new = np.sort(loops, axis=1)
    return loops, owners, is_fan & (is_new[:, 1:] != is_new[:, :-1]).all(axis=1)


def _following(groups: NDArray, middle: NDArray, steps: int) -> NDArray[np.int64]:
    """Return the corner `steps` after the `middle` (m,) in each triangle of the groups (m, n, 3), -1 where it isn't
    there."""
    is_middle = groups == middle[:, None, None]
    corner = (is_middle.argmax(axis=2)[..., None] + steps) % 3
    following = np.take_along_axis(groups, corner, axis=2)[..., 0].astype(np.int64)
    return np.where(is_middle.any(axis=2), following, -1)
