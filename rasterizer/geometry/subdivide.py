"""Subdivision: every triangle becomes four that lie in it, so that Gouraud's method sees more points of the surface.

in:  a mesh                                             2
out: the same surface in smaller triangles,            ╱ ╲
     face by face                                     5───4
                                                     ╱ ╲ ╱ ╲
                                                    0───3───1

    a triangle f becomes 4f .. 4f + 3:              (0, 3, 5) (3, 1, 4) (5, 4, 2) (3, 4, 5)

Every triangle's points have numbers: 0, 1, 2 its corners, 3, 4, 5 the midpoints of the edges that begin there.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ModelError, SceneError, shown
from ..scene.mesh import DEFAULT_CREASE_ANGLE, MAX_FACES, Mesh
from ..scene.validate import is_whole
from .normals import split_mesh, within_range

_CHILDREN = np.array([(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)])
_HIDDEN_FOLD = math.sin(math.radians(DEFAULT_CREASE_ANGLE / 2))  # of a slope that both ends of an edge don't know
_NEXT = [1, 2, 0]  # the edge that begins at corner k ends here; its midpoint is the point 3 + k


def subdivide(mesh: Mesh, times: int) -> Mesh:
    """Return a mesh whose triangles are cut in four `times` times; see `Mesh.subdivide`."""
    times = _checked_times(times)
    n_face = mesh.n_face * 4**times
    if n_face > MAX_FACES:
        raise ModelError(
            f"a mesh may have up to {MAX_FACES} faces; subdivided {times} times, its {mesh.n_face} would be {n_face}"
        )
    for _ in range(times):
        mesh = _cut_once(mesh)
    return mesh


def _checked_times(times: object) -> int:
    """Return a whole number from 0 to 15: the sixteenth time makes 2^32 faces of one."""
    if not is_whole(times, 0, 15):
        raise SceneError(f"a mesh can be subdivided 0 to 15 times, a whole number; given {shown(times)}")
    return int(times)


def _cut_once(mesh: Mesh) -> Mesh:
    """Cut every triangle of a mesh in four.

    An edge has one midpoint however many faces meet there, so the finer mesh is as closed as the given one. Where two
    edges coincide though their vertices differ, their midpoints do too: a sum of two numbers is the same both ways
    round.
    """
    has_normals = mesh.normals is not None and mesh.crease_angle is None
    normals: Any = mesh.normals if has_normals else _averaged_normals(mesh)
    ends, midpoints = _edges(mesh.faces)
    names = np.concatenate([mesh.faces, midpoints + np.int64(mesh.n_vertex)], axis=1)
    polygons = np.arange(mesh.n_face, dtype=np.int32) if mesh.polygons is None else mesh.polygons
    of_faces = {key: getattr(mesh, key) for key in ("face_colors", "smoothing", "face_material")}
    finer = replace(
        mesh,
        vertices=_cut_attribute(mesh.vertices, ends),
        faces=_pick(names),
        normals=_cut_attribute(normals, ends, is_direction=True),
        crease_angle=None,
        colors=_cut_attribute(mesh.colors, ends),
        uv=_cut_attribute(mesh.uv, ends),
        polygons=np.repeat(polygons, 4),
        **{key: None if values is None else np.repeat(values, 4, axis=0) for key, values in of_faces.items()},
    )
    return finer if has_normals else _unfold(finer, mesh, normals)


def _pick(table: NDArray) -> NDArray:
    """Return what a table (n_face, 6, ...) of the triangles' points has at the corners of the new triangles."""
    return table[:, _CHILDREN].reshape(-1, 3, *table.shape[2:])


def _edges(faces: NDArray) -> tuple[NDArray[np.uint32], NDArray[np.int64]]:
    """Return the ends (n_edge, 2) uint32 of all edges, and which edge begins at each corner, (n_face, 3)."""
    low, high = np.minimum(faces, faces[:, _NEXT]), np.maximum(faces, faces[:, _NEXT])
    keys, edge = np.unique(low.astype(np.uint64) << np.uint64(32) | high, return_inverse=True)
    ends = np.stack([keys >> np.uint64(32), keys & np.uint64(0xFFFFFFFF)], axis=1).astype(np.uint32)
    return ends, edge.reshape(faces.shape)


def _cut_attribute(values: Any, ends: NDArray, is_direction: bool = False) -> Any:
    """Return an attribute of the vertices (n_vertex, k), of the corners (n_face, 3, k), or None, for the finer mesh."""
    if values is None:
        return None
    mean = _mean_direction if is_direction else _mean
    if values.ndim == 2:
        return np.concatenate([values, mean(values[ends[:, 0]], values[ends[:, 1]])])
    return _pick(np.concatenate([values, mean(values, values[:, _NEXT])], axis=1))


def _mean(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """Return the means of values."""
    return 0.5 * (a + b)


def _mean_direction(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """Return the means of directions, which the mesh makes unit vectors.

    Where two are opposite and cancel, the first is taken.
    """
    total = a + b
    return np.where(np.any(total != 0.0, axis=-1, keepdims=True), total, a)


def _unfold(finer: Mesh, mesh: Mesh, normals: NDArray) -> Mesh:
    """Return the finer mesh with the normals of its faces at midpoints of edges that hide a fold.

    Where the surface bends one way and then the other, as in a saw-tooth, the normals at its vertices may all be
    parallel while the faces between aren't. Such an edge runs uphill, or downhill, as both its ends see it; on a
    surface that bends one way it falls off from both. The faces at the edge are what the ends don't know.
    Source: Overveld & Wyvill 1997, ACM Trans. Graphics 16(4), 397-419: interpolation that knows inflections.

    Parameters
    ----------
    normals : of the coarse mesh, of its vertices or corners
    """
    corners = normals[mesh.faces] if normals.ndim == 2 else normals
    points = within_range(mesh.vertices)[mesh.faces]
    hidden = _leans(points, points[:, _NEXT], corners, corners[:, _NEXT])
    if not hidden.any():
        return finer
    is_taken = _pick(np.concatenate([np.zeros_like(hidden), hidden], axis=1))[..., None]
    of_faces = _averaged_normals(replace(finer, normals=None, crease_angle=mesh.crease_angle))
    own: Any = finer.normals
    own, found = (each[finer.faces] if each.ndim == 2 else each for each in (own, of_faces))
    return replace(finer, normals=np.where(is_taken, found, own))


def _leans(starts: NDArray, ends: NDArray, at_starts: NDArray, at_ends: NDArray) -> NDArray[np.bool_]:
    """Tell which lines from points to others run uphill, or downhill, as the unit normals at both see it."""
    lines = ends - starts
    lengths = np.linalg.norm(lines, axis=-1)
    rises = np.stack([(lines * at_starts).sum(axis=-1), (lines * at_ends).sum(axis=-1)])
    return (rises.min(axis=0) > _HIDDEN_FOLD * lengths) | (rises.max(axis=0) < -_HIDDEN_FOLD * lengths)


def _averaged_normals(mesh: Mesh) -> NDArray[np.float64]:
    """Average the faces' normals up to the creases: (n_vertex, 3), or (n_face, 3, 3) where a vertex has several."""
    split = split_mesh(mesh)
    if len(np.unique(split.source)) < len(split.source):
        return split.normals[split.faces]
    normals = np.zeros_like(mesh.vertices)
    normals[split.source] = split.normals
    return normals
