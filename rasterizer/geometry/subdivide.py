"""Subdivision: every triangle becomes four that lie in it, so that Gouraud's method sees more points of the surface.

in:  a mesh                                             2                         d ── m ── c
out: the same surface in smaller triangles,            ╱ ╲                        │ ╲  │  ╱ │
     face by face                                     5───4                       m ── M ── m
                                                     ╱ ╲ ╱ ╲                      │ ╱  │  ╲ │
                                                    0───3───1                     a ── m ── b

    a triangle f becomes 4f .. 4f + 3:              (0, 3, 5) (3, 1, 4) (5, 4, 2) (3, 4, 5)
    a convex polygon, drawn about its centre M      two triangles an edge: (a, m, M) (m, b, M)
    (polygons.py), is cut as it is drawn:            of a quad that are four a triangle, too

Every triangle's points have numbers: 0, 1, 2 its corners, 3, 4, 5 the midpoints of the edges that begin there, 6 the
centre of its polygon.
"""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import ModelError, SceneError, shown
from ..scene.mesh import DEFAULT_CREASE_ANGLE, MAX_FACES, Mesh
from ..scene.validate import is_whole
from .normals import split_mesh, within_range
from .points import units
from .polygons import Centers, Rings, find_rings, with_means
from .weld import unique_rows

_CHILDREN = np.array([(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)])
_HIDDEN_FOLD = math.sin(math.radians(DEFAULT_CREASE_ANGLE / 2))  # of a slope that both ends of an edge don't know
_NEXT = [1, 2, 0]  # the edge that begins at corner k ends here; its midpoint is the point 3 + k
_CENTER = 6


class _Cuts(NamedTuple):
    """How the triangles of a mesh are cut."""

    owner: NDArray[np.int64]  # (n_finer,) the triangle that a new one is made of
    corners: NDArray[np.int64]  # (n_finer, 3) its corners, as points 0..6 of that triangle
    rings: Rings  # the polygons that are cut about their centres; their corners are rows
    rows: NDArray[np.int64] | None  # (n_row,) corners of faces, 3f + k, each different one; None: rows are vertices
    ring: NDArray[np.int64]  # (n_face,) which of the rings a triangle belongs to, -1 to none


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
    """Cut every triangle of a mesh in four, and polygons that are drawn about their centres there.

    An edge has one midpoint however many faces meet there, so the finer mesh is as closed as the given one. Where two
    edges coincide though their vertices differ, their midpoints do too: a sum of two numbers is the same both ways
    round.
    """
    has_normals = mesh.normals is not None and mesh.crease_angle is None
    normals: Any = mesh.normals if has_normals else _averaged_normals(mesh)
    cuts = _list_cuts(mesh, normals)
    ends, midpoints = _edges(mesh.faces, cuts)
    centers = mesh.n_vertex + len(ends) + cuts.ring[:, None]
    names = np.concatenate([mesh.faces, midpoints + np.int64(mesh.n_vertex), centers], axis=1)
    polygons = np.arange(mesh.n_face, dtype=np.int32) if mesh.polygons is None else mesh.polygons
    finer = replace(
        mesh,
        vertices=_cut_attribute(mesh.vertices, mesh, cuts, ends),
        faces=_pick(names, cuts),
        normals=_cut_attribute(normals, mesh, cuts, ends, is_direction=True),
        crease_angle=None,
        colors=_cut_attribute(mesh.colors, mesh, cuts, ends),
        uv=_cut_attribute(mesh.uv, mesh, cuts, ends),
        polygons=polygons[cuts.owner],
        face_colors=None if mesh.face_colors is None else mesh.face_colors[cuts.owner],
        smoothing=None if mesh.smoothing is None else mesh.smoothing[cuts.owner],
        face_material=None if mesh.face_material is None else mesh.face_material[cuts.owner],
    )
    return finer if has_normals else _unfold(finer, mesh, normals, cuts)


def _list_cuts(mesh: Mesh, normals: NDArray) -> _Cuts:
    """List the triangles that a mesh is cut into, in the order of those that they are made of.

    A polygon whose corners don't have one value each is drawn as its triangles lie, and cut so.
    """
    of_corners = [each for each in (normals, mesh.colors, mesh.uv) if each is not None and each.ndim == 3]
    rows, names, points = None, mesh.faces, mesh.vertices
    if of_corners and mesh.polygons is not None:
        keys = [mesh.faces.reshape(-1, 1), *(each.reshape(-1, each.shape[2]) for each in of_corners)]
        rows, names = unique_rows(np.column_stack(keys))
        names, points = names.reshape(-1, 3), mesh.vertices[mesh.faces.ravel()[rows]]
    rings = find_rings(names, mesh.polygons, points)
    ring = np.full(mesh.n_face, -1)
    ring[rings.owners] = np.repeat(np.arange(len(rings.start)), np.diff(rings.offsets))
    start = (names[rings.owners] == rings.corners[:, None]).argmax(axis=1)  # an edge of a polygon begins there
    triangles = np.flatnonzero(ring < 0)
    end, center = (start + 1) % 3, np.full(len(start), _CENTER)
    halves = np.stack([np.stack([start, 3 + start, center], 1), np.stack([3 + start, end, center], 1)], 1)
    owner = np.concatenate([np.repeat(triangles, 4), np.repeat(rings.owners, 2)])
    corners = np.concatenate([np.tile(_CHILDREN, (len(triangles), 1)), halves.reshape(-1, 3)])
    order = np.argsort(owner, kind="stable")
    return _Cuts(owner[order], corners[order], rings, rows, ring)


def _pick(table: NDArray, cuts: _Cuts) -> NDArray:
    """Return what a table (n_face, 7, ...) of the triangles' points has at the corners of the new triangles."""
    return table[cuts.owner[:, None], cuts.corners]


def _edges(faces: NDArray, cuts: _Cuts) -> tuple[NDArray[np.uint32], NDArray[np.int64]]:
    """Return the ends (n_edge, 2) uint32 of all edges that are cut, and which edge begins at each corner, (n_face, 3);
    anything where none is cut."""
    is_cut = np.zeros((len(faces), _CENTER + 1), bool)
    is_cut[cuts.owner[:, None], cuts.corners] = True
    is_cut = is_cut[:, 3:_CENTER]
    low, high = np.minimum(faces, faces[:, _NEXT])[is_cut], np.maximum(faces, faces[:, _NEXT])[is_cut]
    keys, edge = np.unique(low.astype(np.uint64) << np.uint64(32) | high, return_inverse=True)
    ends = np.stack([keys >> np.uint64(32), keys & np.uint64(0xFFFFFFFF)], axis=1).astype(np.uint32)
    midpoints = np.zeros(faces.shape, np.int64)
    midpoints[is_cut] = edge.ravel()
    return ends, midpoints


def _cut_attribute(values: Any, mesh: Mesh, cuts: _Cuts, ends: NDArray, is_direction: bool = False) -> Any:
    """Return an attribute of the vertices (n_vertex, k), of the corners (n_face, 3, k), or None, for the finer mesh."""
    if values is None:
        return None
    mean = _mean_direction if is_direction else _mean
    centers = _center_means(values, mesh, cuts, is_direction)
    if values.ndim == 2:
        return np.concatenate([values, mean(values[ends[:, 0]], values[ends[:, 1]]), centers])
    of_faces = _spread(centers, cuts)[:, None]
    return _pick(np.concatenate([values, mean(values, values[:, _NEXT]), of_faces], axis=1), cuts)


def _spread(of_rings: NDArray, cuts: _Cuts) -> NDArray:
    """Return what each face has of its ring, (n_face, ...) of (n_ring, ...); 0 where it belongs to none."""
    return np.append(of_rings, np.zeros_like(of_rings, shape=(1, *of_rings.shape[1:])), axis=0)[cuts.ring]


def _center_means(values: NDArray, mesh: Mesh, cuts: _Cuts, is_direction: bool) -> NDArray[np.float64]:
    """Return the means of an attribute over the corners of each ring, (n_ring, k); of directions that cancel, the first
    one."""
    rings = cuts.rings
    if len(rings.start) == 0:
        return np.empty((0, values.shape[-1]))
    if values.ndim == 3:
        values = values.reshape(-1, values.shape[2])[cuts.rows]
    elif cuts.rows is not None:
        values = values[mesh.faces.ravel()[cuts.rows]]
    means = with_means(values, Centers(len(values), rings.offsets, rings.corners))[len(values) :]
    if is_direction:
        means = np.where(np.any(means != 0.0, axis=1, keepdims=True), means, values[rings.corners[rings.offsets[:-1]]])
    return means


def _mean(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """Return the means of values."""
    return 0.5 * (a + b)


def _mean_direction(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """Return the means of directions, which the mesh makes unit vectors.

    Where two are opposite and cancel, the first is taken.
    """
    total = a + b
    return np.where(np.any(total != 0.0, axis=-1, keepdims=True), total, a)


def _unfold(finer: Mesh, mesh: Mesh, normals: NDArray, cuts: _Cuts) -> Mesh:
    """Return the finer mesh with the normals of its faces at midpoints of edges that hide a fold.

    Where the surface bends one way and then the other, as in a saw-tooth, the normals at its vertices may all be
    parallel while the faces between aren't. Such an edge runs uphill, or downhill, as both its ends see it; on a
    surface that bends one way it falls off from both. The faces at the edge are what the ends don't know. The
    lines from a polygon's corners to its centre are such edges, too.
    Source: Overveld & Wyvill 1997, ACM Trans. Graphics 16(4), 397-419: interpolation that knows inflections.

    Parameters
    ----------
    normals : of the coarse mesh, of its vertices or corners
    """
    corners = normals[mesh.faces] if normals.ndim == 2 else normals
    vertices = within_range(mesh.vertices)
    points = vertices[mesh.faces]
    hidden = _leans(points, points[:, _NEXT], corners, corners[:, _NEXT])
    centers, of_centers = (
        _spread(_center_means(values, mesh, cuts, is_direction), cuts)[:, None]
        for values, is_direction in ((vertices, False), (normals, True))
    )
    to_center = _leans(points, centers, corners, units(of_centers)).any(axis=1) & (cuts.ring >= 0)
    is_hidden_ring = np.bincount(cuts.ring[to_center], minlength=len(cuts.rings.start)) > 0
    table = np.concatenate([np.zeros_like(hidden), hidden, _spread(is_hidden_ring, cuts)[:, None]], axis=1)
    if not table.any():
        return finer
    is_taken = _pick(table, cuts)[..., None]
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
