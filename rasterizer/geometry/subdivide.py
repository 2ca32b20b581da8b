"""Subdivision: every triangle becomes four that lie in it, so that Gouraud's method sees more points of the surface.

in:  arrays                                             2
out: the same surface in smaller triangles,            ╱ ╲
     face by face                                     5───4
                                                     ╱ ╲ ╱ ╲
                                                    0───3───1

    a triangle f becomes 4f .. 4f + 3:              (0, 3, 5) (3, 1, 4) (5, 4, 2) (3, 4, 5)

Every triangle's points have numbers: 0, 1, 2 its corners, 3, 4, 5 the midpoints of the edges that begin there.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..choices import Weighting
from .normals import split_creases, within_range

_CHILDREN = np.array([(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)])
_HIDDEN_FOLD = math.sin(math.radians(15.0))  # of a slope that both ends of an edge don't know
_NEXT = [1, 2, 0]  # the edge that begins at corner k ends here; its midpoint is the point 3 + k


class Surface(NamedTuple):
    """The arrays of a mesh; see `Mesh`, also for those that may be None."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.uint32]
    normals: NDArray[np.float64] | None
    colors: NDArray[np.float64] | None
    uv: NDArray[np.float64] | None
    polygons: NDArray[np.int32] | None
    face_colors: NDArray[np.float64] | None
    smoothing: NDArray[np.int32] | None
    face_material: NDArray[np.int32] | None


def cut_once(surface: Surface) -> Surface:
    """Cut every triangle of a mesh in four; its normals may have any length then.

    An edge has one midpoint however many faces meet there, so the finer mesh is as closed as the given one. Where two
    edges coincide though their vertices differ, their midpoints do too: a sum of two numbers is the same both ways
    round.
    """
    faces, polygons = surface.faces, surface.polygons
    ends, midpoints = _edges(faces)
    names = np.concatenate([faces, midpoints + np.int64(len(surface.vertices))], axis=1)
    polygons = np.arange(len(faces), dtype=np.int32) if polygons is None else polygons
    of_faces = polygons, surface.face_colors, surface.smoothing, surface.face_material
    return Surface(
        _cut_attribute(surface.vertices, ends),
        _pick(names),
        _cut_attribute(surface.normals, ends, is_direction=True),
        _cut_attribute(surface.colors, ends),
        _cut_attribute(surface.uv, ends),
        *(None if values is None else np.repeat(values, 4, axis=0) for values in of_faces),
    )


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


def unfold(
    coarse: Surface, finer: Surface, crease_angle: float, weighting: Weighting, smoothing: NDArray | None
) -> NDArray[np.float64] | None:
    """Return the normals of the finer mesh's corners, those of its faces at midpoints of edges that hide a fold; None
    where no edge does.

    Where the surface bends one way and then the other, as in a saw-tooth, the normals at its vertices may all be
    parallel while the faces between aren't. Such an edge runs uphill, or downhill, as both its ends see it; on a
    surface that bends one way it falls off from both. The faces at the edge are what the ends don't know.
    Source: Overveld & Wyvill 1997, ACM Trans. Graphics 16(4), 397-419: interpolation that knows inflections.

    Parameters
    ----------
    coarse, finer : before and after `cut_once`; both have unit normals, of their vertices or corners
    crease_angle, weighting, smoothing : of the finer mesh, as in `split_creases`
    """
    normals: Any = coarse.normals
    corners = normals[coarse.faces] if normals.ndim == 2 else normals
    points = within_range(coarse.vertices)[coarse.faces]
    hidden = _leans(points, points[:, _NEXT], corners, corners[:, _NEXT])
    if not hidden.any():
        return None
    is_taken = _pick(np.concatenate([np.zeros_like(hidden), hidden], axis=1))[..., None]
    of_faces = average_normals(finer.vertices, finer.faces, crease_angle, weighting, smoothing)
    own: Any = finer.normals
    own, found = (each[finer.faces] if each.ndim == 2 else each for each in (own, of_faces))
    return np.where(is_taken, found, own)


def _leans(starts: NDArray, ends: NDArray, at_starts: NDArray, at_ends: NDArray) -> NDArray[np.bool_]:
    """Tell which lines from points to others run uphill, or downhill, as the unit normals at both see it."""
    lines = ends - starts
    lengths = np.linalg.norm(lines, axis=-1)
    rises = np.stack([(lines * at_starts).sum(axis=-1), (lines * at_ends).sum(axis=-1)])
    return (rises.min(axis=0) > _HIDDEN_FOLD * lengths) | (rises.max(axis=0) < -_HIDDEN_FOLD * lengths)


def average_normals(
    vertices: NDArray, faces: NDArray, crease_angle: float, weighting: Weighting, smoothing: NDArray | None
) -> NDArray[np.float64]:
    """Average the faces' normals up to the creases: (n_vertex, 3), or (n_face, 3, 3) where a vertex has several; the
    parameters are those of `split_creases`."""
    split = split_creases(vertices, faces, crease_angle, weighting, smoothing)
    if len(np.unique(split.source)) < len(split.source):
        return split.normals[split.faces]
    normals = np.zeros_like(vertices)
    normals[split.source] = split.normals
    return normals
