"""The edges of a mesh's polygons: where two faces meet at an angle, where one ends, and which are silhouettes.

In:  a mesh. Out: `Edges`, each edge once; where more than two polygons meet, once more for each of the others.

Vertices at one position are one vertex here: files list a vertex several times where its normals or texture coordinates
differ. Edges between triangles of one polygon are no edges.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.mesh import DEFAULT_CREASE_ANGLE, Mesh
from .mesh_points import unique_rows
from .normals import polygon_normals


class Edges(NamedTuple):
    """Edges of polygons, and the planes of the polygons on their two sides."""

    ends: NDArray[np.float64]  # (n, 2, 3) world space
    normals: NDArray[np.float64]  # (n, 2, 3) unit or zero, wound alike; equal where one polygon is meant
    turns: NDArray[np.float64]  # (n,) -1 where the second was turned for that, else 1
    is_open: NDArray[np.bool_]  # (n,) one polygon has the edge, or more than two have it
    is_crease: NDArray[np.bool_]  # (n,) open, or the polygons meet at more than the mesh's crease angle

    def is_front(self, eye: NDArray, forward: NDArray, is_perspective: bool) -> tuple[NDArray, NDArray]:
        """Tell on which sides the surface looks to the viewer, wound alike, and which polygons do as they are wound;
        (n, 2) bool each."""
        away = self.ends[:, :1] - eye if is_perspective else forward
        across = (self.normals * away).sum(axis=2)
        return across < 0.0, np.stack([across[:, 0], self.turns * across[:, 1]], axis=1) < 0.0


def join_edges(meshes) -> Edges:
    """Return the edges of all meshes."""
    parts = [gather_edges(mesh) for mesh in meshes]
    return Edges(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def gather_edges(mesh: Mesh) -> Edges:
    """Gather the edges of a mesh's polygons."""
    first_of, vertex = unique_rows([mesh.vertices])
    faces = vertex[mesh.faces].astype(np.int64)
    polygons = np.arange(mesh.n_face) if mesh.polygons is None else np.unique(mesh.polygons, return_inverse=True)[1]
    polygons = polygons.reshape(-1).astype(np.uint32)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    owner = np.repeat(polygons, 3)
    is_edge = start != end
    start, end, owner = start[is_edge], end[is_edge], owner[is_edge]
    low, high = np.minimum(start, end), np.maximum(start, end)
    order = np.lexsort((owner, high, low))
    low, high, owner, is_up = low[order], high[order], owner[order], (start < end)[order]
    # A polygon that goes along an edge there and back does not have it: the edge is inside of it.
    run, n_run = _runs(low, high, owner)
    kept = run[n_run % 2 == 1]
    low, high, owner, is_up = low[kept], high[kept], owner[kept], is_up[kept]
    begin, count = _runs(low, high)
    other = begin + (count > 1)
    points = mesh.vertices[first_of]
    normals = polygon_normals(mesh.vertices, mesh.faces, polygons)
    # Any of the polygons at an edge may be the one that looks to the viewer.
    n_more = np.maximum(count - 2, 0)
    more = np.repeat(begin + 2 - np.cumsum(n_more) + n_more, n_more) + np.arange(n_more.sum())
    begin, other, count = np.append(begin, more), np.append(other, more), np.append(count, np.repeat(count, n_more))
    ends = np.stack([points[low[begin]], points[high[begin]]], axis=1)
    # Where both run along it in one direction, they are wound against each other.
    turn = np.where((is_up[begin] == is_up[other]) & (begin != other), -1.0, 1.0)
    at = np.flatnonzero(count == 2)
    fill_planes(normals, np.stack([owner[begin], owner[other]], axis=1)[at], turn[at], ends[at])
    sides = np.stack([normals[owner[begin]], turn[:, None] * normals[owner[other]]], axis=1)
    angle = DEFAULT_CREASE_ANGLE if mesh.crease_angle is None else mesh.crease_angle
    is_open = count != 2
    has_planes = (sides != 0).any(axis=2).all(axis=1)
    is_bent = (sides[:, 0] * sides[:, 1]).sum(axis=1) < np.cos(np.radians(angle))
    return Edges(ends, sides, turn, is_open, is_open | (is_bent & has_planes))


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
