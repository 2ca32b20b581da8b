"""The edges of a mesh's polygons: where two faces meet at an angle, where one ends, and which are silhouettes.

In:  a mesh. Out: `Edges`, each edge once.

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
    normals: NDArray[np.float64]  # (n, 2, 3) unit or zero, wound alike; equal where there is one polygon
    is_open: NDArray[np.bool_]  # (n,) one polygon has the edge, or more than two have it
    is_crease: NDArray[np.bool_]  # (n,) open, or the polygons meet at more than the mesh's crease angle

    def is_front(self, eye: NDArray, forward: NDArray, is_perspective: bool) -> NDArray[np.bool_]:
        """Tell which polygons look to the viewer, (n, 2)."""
        away = self.ends[:, :1] - eye if is_perspective else forward
        return (self.normals * away).sum(axis=2) < 0.0


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
    is_first = np.append(True, (low[1:] != low[:-1]) | (high[1:] != high[:-1]))[: len(low)]
    begin = np.flatnonzero(is_first)
    count = np.diff(np.append(begin, len(low)))
    other = begin + (count > 1)
    is_kept = ~((count == 2) & (owner[begin] == owner[other]))
    begin, other, count = begin[is_kept], other[is_kept], count[is_kept]
    normals = polygon_normals(mesh.vertices, mesh.faces, polygons)
    sides = np.stack([normals[owner[begin]], normals[owner[other]]], axis=1)
    is_alike = (is_up[begin] == is_up[other]) & (count > 1)  # both run along it in one direction
    sides[is_alike, 1] *= -1.0
    angle = DEFAULT_CREASE_ANGLE if mesh.crease_angle is None else mesh.crease_angle
    is_open = count != 2
    has_planes = (sides != 0).any(axis=2).all(axis=1)
    is_bent = (sides[:, 0] * sides[:, 1]).sum(axis=1) < np.cos(np.radians(angle))
    points = mesh.vertices[first_of]
    ends = np.stack([points[low[begin]], points[high[begin]]], axis=1)
    return Edges(ends, sides, is_open, is_open | (is_bent & has_planes))
