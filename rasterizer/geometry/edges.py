"""The edges of a mesh's polygons: where two faces meet at an angle, where one ends, and which are silhouettes.

In:  arrays of a mesh. Out: `Edges`, each edge once, with the polygons that have it.

Vertices at one position are one vertex here: files list a vertex several times where its normals or texture coordinates
differ. Edges between triangles of one polygon are no edges.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .normals import is_smooth, polygon_normals, smooth_cosine
from .weld import unique_rows


class Edges(NamedTuple):
    """Edges, and the polygons that have them: their sides. Those of an edge stand side by side."""

    ends: NDArray[np.float64]  # (n, 2, 3) world space
    first: NDArray[np.int64]  # (n,) the first side of each
    is_open: NDArray[np.bool_]  # (n,) one polygon has the edge, or more than two have it
    is_crease: NDArray[np.bool_]  # (n,) open, or a crease: shading is split there
    normals: NDArray[np.float64]  # (n_side, 3) of the polygons, unit or zero
    is_along: NDArray[np.bool_]  # (n_side,) the polygon goes from the edge's start to its end, else it comes back


def gather_edges(
    vertices: NDArray, triangles: NDArray, polygons: NDArray, crease_angle: float, smoothing: NDArray | None = None
) -> Edges:
    """Gather the edges of a mesh's polygons.

    Parameters
    ----------
    vertices : (n_vertex, 3) float64
    triangles : (n_face, 3)
    polygons : (n_face,) the polygon that each triangle is a part of
    crease_angle : degrees; an edge between polygons that meet at more is a crease
    smoothing : (n_face,) smoothing groups, which count in its place; None = there are none
    """
    first_of, vertex = unique_rows(vertices)
    faces = vertex[triangles].astype(np.int64)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    owner = np.repeat(polygons, 3)
    is_edge = start != end
    start, end, owner = start[is_edge], end[is_edge], owner[is_edge]
    low, high = np.minimum(start, end), np.maximum(start, end)
    order = np.lexsort((owner, high, low))
    low, high, owner, is_along = low[order], high[order], owner[order], (start < end)[order]
    # A polygon that goes along an edge there and back does not have it: the edge is inside of it.
    run, n_run = _runs(low, high, owner)
    kept = run[n_run % 2 == 1]
    low, high, owner, is_along = low[kept], high[kept], owner[kept], is_along[kept]
    first, count = _runs(low, high)
    points = vertices[first_of]
    ends = np.stack([points[low[first]], points[high[first]]], axis=1)
    normals, is_pair = polygon_normals(vertices, triangles, polygons), count == 2
    at = first[is_pair]
    # Where both run along the edge in one direction, they are wound against each other.
    turn = np.where(is_along[at] == is_along[at + 1], -1.0, 1.0)
    fill_planes(normals, np.stack([owner[at], owner[at + 1]], axis=1), turn, ends[is_pair])
    of_sides, is_crease = normals[owner], ~is_pair
    has_planes = of_sides[at].any(axis=1) & of_sides[at + 1].any(axis=1)
    cosines = turn * (of_sides[at] * of_sides[at + 1]).sum(axis=1)
    is_joined = is_smooth(cosines, smooth_cosine(crease_angle if smoothing is None else 0.0))
    if smoothing is not None:
        # Of two faces in one plane the normals are the same, also where they are not averaged.
        group = np.zeros(polygons.max(initial=0) + 1, smoothing.dtype)
        group[polygons] = smoothing
        one, other = group[owner[at]], group[owner[at + 1]]
        is_joined |= (one != 0) & (one == other)
    is_crease[is_pair] = has_planes & ~is_joined
    return Edges(ends, first, ~is_pair, is_crease, of_sides, is_along)


def _runs(*columns: NDArray) -> tuple[NDArray, NDArray]:
    """Return where runs of equal rows begin, and how many rows each has."""
    is_first = np.ones(len(columns[0]), bool)
    is_first[1:] = np.any([column[1:] != column[:-1] for column in columns], axis=0)
    begin = np.flatnonzero(is_first)
    return begin, np.diff(np.append(begin, len(is_first)))


def fill_planes(normals: NDArray, sides: NDArray, turn: NDArray, ends: NDArray) -> None:
    """Give polygons without area the plane of their neighbour over the longest of their edges.

    Files fill the gap beside a vertex that lies on an edge with such a triangle. Its longest side is that edge: so none
    of its sides looks like the border of a surface.

    Parameters
    ----------
    normals : (n_polygon, 3), changed where they are 0
    sides : (n, 2) the two polygons at each edge
    turn : (n,) -1 where they are wound against each other, else 1
    ends : (n, 2, 3) of the edges
    """
    has_plane = normals.any(axis=1)
    if has_plane.all():
        return
    taker, giver = np.concatenate([sides, sides[:, ::-1]]).T
    length = np.tile(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), 2)
    found = np.flatnonzero(~has_plane[taker] & has_plane[giver])
    found = found[np.argsort(length[found], kind="stable")]  # what comes last, the longest, stays
    normals[taker[found]] = np.tile(turn, 2)[found, None] * normals[giver[found]]
