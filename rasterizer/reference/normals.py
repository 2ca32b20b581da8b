"""Normals of corners, averaged over the faces round a vertex up to the creases: numpy float64 and Python integers.

In: vertices and triangles. Out: one unit normal for each corner of each triangle. Everything is computed from the
definition:

      after            A *corner* is one vertex of one face, numbered 3·face + k. Two corners at a vertex have an edge
      /  \\             in common where both faces go from that vertex to the same other one. They are wound alike where
     / A  \\            one of them leaves the vertex along the edge (here → after) and the other comes back along it
 before - here         (before → here).

Two corners with a common edge are joined where their faces meet at no more than the crease angle. Joined corners form
groups. The corners of a group share the mean of their normals. Where faces are wound against each other, one of the
normals is turned for the comparison and for the mean, and turned back for its own corners.
Sources: Gouraud 1971, IEEE Trans. Computers C-20(6), 623-629; weights by angle: Thürmer & Wüthrich 1998, J. Graphics
Tools 3(1).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..vectors import length
from .vectors import dot

# Coordinates with six decimals tilt the faces of a cylinder with 12 sides by up to 2.2e-4 degrees against each other.
# Twice that is no difference between the angle at which two faces meet and the crease angle.
ANGLE_SLACK = 5e-4  # degrees
MAX_AT_EDGE = 64  # faces at one edge: an edge of more is no part of a surface, and joins nothing
# A cross product a × b of rounded differences is wrong by up to 5.3·2^-53 |a||b|: each product carries three roundings,
# and the difference one more. A triangle whose doubled area is below 8·2^-53 |a||b| has no area.
NO_AREA = 2.0**-50
# A sum of normals that is shorter than this part of its weights has cancelled. Its direction would show how
# single-precision coordinates (2^-24) were rounded.
CANCELLED = 2.0**-20


class Corners(NamedTuple):
    """The corners of triangles, one row each, in the order of the faces."""

    vertex: NDArray[np.int64]  # (n_corner,) the vertex at the corner
    after: NDArray[np.int64]  # (n_corner,) the next vertex of the face
    before: NDArray[np.int64]  # (n_corner,) the vertex before it
    normal: NDArray[np.float64]  # (n_corner, 3) unit normal of the face; 0 where it has no area
    weight: NDArray[np.float64]  # (n_corner,) what the corner counts for in a mean; 0 where the face has no area


def corner_normals(
    vertices: ArrayLike,
    faces: ArrayLike,
    crease_angle: float,
    weighting: str = "angle",
    smoothing: ArrayLike | None = None,
) -> NDArray[np.float64]:
    """Average the normals of the faces round each vertex, up to the creases.

    Parameters
    ----------
    vertices : (n_vertex, 3) float64, scene units
    faces : (n_face, 3) integers, counter-clockwise seen from outside
    crease_angle : degrees, 0 to 180; without effect where smoothing groups are given
    weighting : "angle" of the face's corner, "area" of the face, or "uniform"
    smoothing : (n_face,) integers, or None; then faces of the same group are joined, and those of group 0 are not

    Returns
    -------
    (n_face, 3, 3) float64, unit length. A corner keeps its own face's normal where the sum of its group's normals
    cancels. The corners of a face without area get the normal of the first other corner at their vertex, or 0 where
    there is none.
    """
    corners = _measure_corners(np.asarray(vertices, np.float64), np.asarray(faces, np.int64), weighting)
    first, second, sign = _list_common_edges(corners)
    if smoothing is None:
        is_joined = ~is_crease(corners.normal[first], corners.normal[second], sign, crease_angle)
    else:
        group = np.repeat(np.asarray(smoothing), 3)
        is_joined = (group[first] != 0) & (group[first] == group[second])
    group, side = _join(len(corners.vertex), first[is_joined], second[is_joined], sign[is_joined])
    normals = _average(corners, group, side)
    return _fill_without_area(normals, corners).reshape(-1, 3, 3)


def _measure_corners(vertices: NDArray, faces: NDArray, weighting: str) -> Corners:
    """Compute each corner's face normal and weight.

    The area vector is the cross product of the two shorter edges. They enclose the largest angle, so least is lost to
    rounding.
    """
    edges = vertices[np.roll(faces, -1, axis=1)] - vertices[faces]  # edge k leaves corner k
    with np.errstate(all="ignore"):  # coordinates beyond 1e75: their faces count as without area
        squares = dot(edges, edges)
        longest, row = squares.argmax(axis=1), np.arange(len(faces))
        a, b = (longest + 1) % 3, (longest + 2) % 3
        areas = np.cross(edges[row, a], edges[row, b])
        doubled_area = np.sqrt(dot(areas, areas))
        has_area = doubled_area > NO_AREA * np.sqrt(squares[row, a] * squares[row, b])
        normals = np.where(has_area[:, None], areas / doubled_area[:, None], 0.0)
        if weighting == "angle":
            # The doubled area is |a||b| times the sine, the dot product |a||b| times the cosine of the angle.
            weights = np.arctan2(doubled_area[:, None], -dot(edges, np.roll(edges, 1, axis=1)))
        else:
            weights = np.repeat({"area": doubled_area, "uniform": np.ones(len(faces))}[weighting][:, None], 3, axis=1)
    weights = np.where(has_area[:, None], weights, 0.0)
    after, before = np.roll(faces, -1, axis=1), np.roll(faces, 1, axis=1)
    return Corners(faces.ravel(), after.ravel(), before.ravel(), np.repeat(normals, 3, axis=0), weights.ravel())


def _list_common_edges(corners: Corners) -> tuple[NDArray, NDArray, NDArray]:
    """List the pairs of corners that have an edge in common: two corners (n,), and 1 where they are wound alike, else
    -1.

    Pairs stand in the order of their vertex, then of the edge's other vertex, then of both corners.
    """
    with_area = np.flatnonzero(corners.weight > 0)
    corner = np.concatenate([with_area, with_area])
    leaves = np.repeat([1, 0], len(with_area))
    far = np.concatenate([corners.after[with_area], corners.before[with_area]])
    order = np.lexsort((leaves, corner, far, corners.vertex[corner]))
    corner, far, leaves = corner[order], far[order], leaves[order]
    here = corners.vertex[corner]
    is_new = np.append(True, (here[1:] != here[:-1]) | (far[1:] != far[:-1]))[: len(corner)]
    edge = np.cumsum(is_new) - 1
    n_at_edge = np.bincount(edge)[edge] if len(edge) else edge
    firsts, seconds = [], []
    for step in range(1, min(int(n_at_edge.max(initial=0)), MAX_AT_EDGE)):
        at = np.flatnonzero((edge[step:] == edge[:-step]) & (n_at_edge[:-step] <= MAX_AT_EDGE))
        firsts.append(at)
        seconds.append(at + step)
    first, second = (np.concatenate([np.empty(0, np.int64), *rows]) for rows in (firsts, seconds))
    order = np.lexsort((second, first))
    first, second = first[order], second[order]
    return corner[first], corner[second], np.where(leaves[first] != leaves[second], 1, -1)


def is_crease(a: NDArray, b: NDArray, sign: NDArray, crease_angle: float) -> NDArray[np.bool_]:
    """Tell where faces with the unit normals a and sign·b, (n, 3), meet at more than the crease angle, degrees (n,).

    The angle is exact where it is small or near 180. What is drawn as a crease and what splits normals is the same.
    """
    angle = np.degrees(np.arctan2(length(np.cross(a, b))[:, 0], sign * dot(a, b)))
    return angle > crease_angle + ANGLE_SLACK


def _join(n_corner: int, first: NDArray, second: NDArray, sign: NDArray) -> tuple[NDArray, NDArray]:
    """Join corners pair by pair; return the group of each corner (n_corner,), and the side of the group's faces it is
    on, 1 or -1.

    Where pairs contradict each other, as round a Möbius strip, those that come first count. The smaller group joins the
    larger.
    """
    group, side = list(range(n_corner)), [1] * n_corner
    members = [[corner] for corner in range(n_corner)]
    for i, j, alike in zip(first.tolist(), second.tolist(), sign.tolist(), strict=True):
        large, small = group[i], group[j]
        if large == small:
            continue
        if len(members[large]) < len(members[small]):
            large, small = small, large
        turn = alike * side[i] * side[j]
        for corner in members[small]:
            group[corner] = large
            side[corner] *= turn
        members[large] += members[small]
        members[small] = []
    return np.array(group, np.int64), np.array(side, np.int64)


def _average(corners: Corners, group: NDArray, side: NDArray) -> NDArray[np.float64]:
    """Return the weighted mean normal of each corner's group, (n_corner, 3), turned to the corner's side."""
    sums, weights = np.zeros((len(group), 3)), np.zeros(len(group))
    np.add.at(sums, group, (side * corners.weight)[:, None] * corners.normal)
    np.add.at(weights, group, corners.weight)
    size = np.sqrt(dot(sums, sums))
    has_mean = (size > CANCELLED * weights)[group]
    means = (side / np.where(size > 0, size, 1.0)[group])[:, None] * sums[group]
    return np.where(has_mean[:, None], means, corners.normal)


def _fill_without_area(normals: NDArray, corners: Corners) -> NDArray[np.float64]:
    """Give the corners of faces without area the normal of the first corner with one at their vertex."""
    with_area = np.flatnonzero(corners.weight > 0)
    vertex, first = np.unique(corners.vertex[with_area], return_index=True)
    source = np.full(int(corners.vertex.max(initial=-1)) + 1, -1)
    source[vertex] = with_area[first]
    lone = np.flatnonzero(corners.weight == 0)
    found = source[corners.vertex[lone]]
    normals[lone] = np.where((found >= 0)[:, None], normals[found], 0.0)
    return normals
