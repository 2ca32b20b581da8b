"""The points of one mesh: where the illumination equation is evaluated, with what is known there.

For the methods that interpolate, points are vertices, split where normals, colours, materials or texture coordinates
differ. For flat shading a polygon has one point, its centroid.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.mesh import DEFAULT_CREASE_ANGLE, Mesh
from .normals import polygon_normals, split_creases, within_range
from .polygons import find_rings


class Part(NamedTuple):
    """One mesh's share of Geometry, rows first."""

    positions: NDArray[np.float64]  # (n_vertex, 3)
    vertex: NDArray[np.uint32]  # (n_face, 3)
    corner: NDArray[np.uint32]  # (n_face, 3)
    points: NDArray[np.float64]  # (n_point, 3)
    normals: NDArray[np.float64]  # (n_point, 3)
    albedo: NDArray[np.float64] | None  # (n_point, 3)
    uv: NDArray[np.float64] | None = None  # (n_point, 2)
    n_points: tuple[int, ...] = ()  # of each material
    tangents: NDArray[np.float64] | None = None  # (n_point, 3)


def smooth_part(mesh: Mesh) -> Part:
    """Split a mesh's vertices where normals or colours differ: the file's normals, else smoothing groups, else creases.

    Where a mesh has colours of its vertices or corners and of its faces, those of the vertices or corners count.
    """
    if mesh.normals is not None and mesh.crease_angle is None:
        if mesh.normals.ndim == 2:
            corner, source, normals = mesh.faces, slice(None), mesh.normals
        else:
            keys = [mesh.faces.reshape(-1, 1), mesh.normals.reshape(-1, 3)]
            first, corner = unique_rows(keys)
            source, normals = mesh.faces.ravel()[first], mesh.normals.reshape(-1, 3)[first]
            corner = corner.reshape(-1, 3)
    else:
        angle = DEFAULT_CREASE_ANGLE if mesh.crease_angle is None else mesh.crease_angle
        groups = mesh.smoothing if mesh.crease_angle is None else None
        corner, source, normals = split_creases(mesh.vertices, mesh.faces, angle, mesh.weighting, groups)
    albedo = None
    if mesh.colors is not None and mesh.colors.ndim == 2:
        albedo = mesh.colors[source, :3]
    elif mesh.colors is not None or mesh.face_colors is not None:
        colors = np.repeat(mesh.face_colors[:, None], 3, axis=1) if mesh.colors is None else mesh.colors
        colors = colors[..., :3].reshape(-1, 3)
        first, new_corner = unique_rows([corner.reshape(-1, 1), colors])
        point = corner.ravel()[first]
        source = np.arange(len(mesh.vertices))[source][point]
        normals, albedo, corner = normals[point], colors[first], new_corner.reshape(-1, 3)
    positions = mesh.vertices[source]
    return Part(positions, corner, corner, positions, normals, albedo)


def flat_part(mesh: Mesh) -> Part:
    """Give every polygon of a mesh one point, its area-weighted centroid, with its plane normal (Newell)."""
    polygons = np.arange(mesh.n_face, dtype=np.uint32) if mesh.polygons is None else _renumber(mesh.polygons)
    normals = polygon_normals(mesh.vertices, mesh.faces, polygons)
    points = polygon_centroids(mesh.vertices, mesh.faces, polygons, len(normals))
    albedo = None
    if mesh.colors is not None:
        albedo = _mean_by(polygons, _triangle_colors(mesh), len(normals))
    elif mesh.face_colors is not None:
        albedo = _mean_by(polygons, mesh.face_colors[:, :3], len(normals))
    corner = np.broadcast_to(polygons.astype(np.uint32)[:, None], (mesh.n_face, 3))
    return Part(mesh.vertices, mesh.faces, corner, points, normals, albedo)


def split_points(part: Part, mesh: Mesh, is_textured: bool) -> Part:
    """Split the points of a mesh where faces of different materials meet, and where texture coordinates differ.

    The points of a material then stand side by side, so that they can be lit together. With textures every point gets
    its texture coordinates, and belongs to one vertex: also in flat shading, where points are polygons else.
    """
    n_material = len(mesh.palette)
    if mesh.face_material is None and not is_textured:
        return part._replace(n_points=(len(part.points),))
    corner, vertex = np.asarray(part.corner, np.int64).ravel(), np.asarray(part.vertex, np.int64).ravel()
    material = np.zeros(len(corner), np.int64)
    if mesh.face_material is not None:
        material = np.repeat(mesh.face_material.astype(np.int64), 3)
    keys, uv = [material[:, None], corner[:, None]], np.zeros((len(corner), 2))
    if is_textured:
        if mesh.uv is not None:
            uv = (mesh.uv[mesh.faces] if mesh.uv.ndim == 2 else mesh.uv).reshape(-1, 2)
        keys += [vertex[:, None], uv]
    first, kind = unique_rows(keys)
    order = np.argsort(material[first], kind="stable")
    first, rank = first[order], np.argsort(order)
    kind = rank[kind].astype(np.uint32).reshape(-1, 3)
    point = corner[first]
    is_own = is_textured or part.corner is part.vertex  # every vertex has a point of its own
    return Part(
        part.positions[vertex[first]] if is_own else part.positions, kind if is_own else part.vertex, kind,
        part.points[point], part.normals[point], None if part.albedo is None else part.albedo[point],
        uv[first], tuple(np.bincount(material[first], minlength=n_material).tolist()),
        None if part.tangents is None else part.tangents[point],
    )  # fmt: skip


def _triangle_colors(mesh: Mesh) -> NDArray[np.float64]:
    """Return the colours (n_face, 3) of triangles, the means of their corners; in a convex polygon the mean of all its
    corners, so that it doesn't matter which is first."""
    rows, points, names = mesh.colors[..., :3], mesh.vertices, mesh.faces
    if rows.ndim == 3:
        first, names = unique_rows([mesh.faces.reshape(-1, 1), rows.reshape(-1, 3)])
        rows, points, names = rows.reshape(-1, 3)[first], points[mesh.faces.ravel()[first]], names.reshape(-1, 3)
    colors = sum(rows[names[:, k]] for k in range(3)) / 3.0
    rings = find_rings(names, mesh.polygons, points)
    for k in range(3 if len(rings.start) else 0):
        mean = np.add.reduceat(rows[rings.corners, k], rings.offsets[:-1]) / np.diff(rings.offsets)
        colors[rings.owners, k] = np.repeat(mean, np.diff(rings.offsets))
    return colors


def polygon_centroids(vertices: NDArray, faces: NDArray, polygons: NDArray, n_polygon: int) -> NDArray[np.float64]:
    """Compute the area-weighted centroids (n_polygon, 3) of polygons given as triangles.

    Where no triangle of a polygon has an area, its centroid is the mean of theirs.
    """
    centers = sum(vertices[faces[:, k]] for k in range(3)) / 3.0
    scaled = within_range(vertices)
    a, b, c = (scaled[faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    total = np.bincount(polygons, area, n_polygon)
    share = np.where(total[polygons] > 0.0, area, 1.0)
    return _mean_by(polygons, centers, n_polygon, share)


def _mean_by(group: NDArray, values: NDArray, n_group: int, weights: NDArray | None = None) -> NDArray[np.float64]:
    """Return the weighted mean of the rows of each group."""
    weights = np.ones(len(values)) if weights is None else weights
    total = np.bincount(group, weights, n_group)
    sums = [np.bincount(group, values[:, k] * weights, n_group) for k in range(values.shape[1])]
    return np.stack(sums, axis=1) / total[:, None]


def _renumber(polygons: NDArray) -> NDArray[np.uint32]:
    """Number the polygons that are in use from 0 upwards, in the order of their numbers."""
    if int(polygons.max()) > 8 * len(polygons):  # few, far apart: to sort them is less than to look at all between
        return np.unique(polygons, return_inverse=True)[1].reshape(-1).astype(np.uint32)
    is_used = np.zeros(int(polygons.max()) + 1, np.bool_)
    is_used[polygons] = True
    return (np.cumsum(is_used) - 1)[polygons].astype(np.uint32)


def unique_rows(columns: Sequence[NDArray]) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """Find equal rows of side-by-side arrays; return (first row of each kind, kind of each row), kinds in order of
    first use."""
    rows = np.ascontiguousarray(np.concatenate([np.asarray(column, np.float64) for column in columns], axis=1) + 0.0)
    keys = rows.view(np.dtype((np.void, rows.dtype.itemsize * rows.shape[1]))).ravel()
    _, first, kind = np.unique(keys, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty(len(order), np.uint32)
    rank[order] = np.arange(len(order), dtype=np.uint32)
    return first[order], rank[kind.ravel()]
