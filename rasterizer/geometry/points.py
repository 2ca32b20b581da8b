"""The geometry of a scene: all its meshes as one set of plain arrays, with normals where the shading method needs them.

Points are where the illumination equation is evaluated or normals are kept: the split vertices for Gouraud's and
Phong's methods, the polygons' centroids for flat shading. With the methods that interpolate, convex polygons with more
than three corners are triangles about their centres, points behind all others that are not lit: see `centers.py`.
Triangles index vertices and points through separate columns, which are the same array where a vertex is a point.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from ..scene.material import Material
from ..scene.mesh import Mesh
from ..scene.scene import Scene
from .centers import Centers, join_rings, split_rings, with_means
from .mesh_points import Part, flat_part, smooth_part, split_points
from .polygons import find_rings
from .surfaces import flag_inverted
from .tangents import add_tangents

NO_TANGENTS = np.empty((3, 0))


class Geometry(NamedTuple):
    """The scene as arrays, meshes one behind the other."""

    positions: NDArray[np.float64]  # (3, n_vertex) world space
    vertex: NDArray[np.uint32]  # (3, n_face) the vertices of each triangle
    corner: NDArray[np.uint32]  # (3, n_face) the points at its corners
    points: NDArray[np.float64]  # (3, n_point) world space
    normals: NDArray[np.float64]  # (3, n_point) unit length or zero; at centres the means of the corners'
    albedo: NDArray[np.float64]  # (n_point, 3) linear; (0, 3) where no mesh has colours and no material a texture
    is_inverted: NDArray[np.uint8]  # (n_face,) 1 where the normals look against the winding
    point_offsets: NDArray[np.int64]  # (n_group + 1,) where groups begin: points of one material, side by side
    group_material: NDArray[np.int64]  # (n_group,) a material may have several groups
    face_material: NDArray[np.uint32]  # (n_face,) empty where there is one material
    uv: NDArray[np.float64]  # (n_point, 2) texture coordinates; (0, 2) where no material has a texture
    tangents: NDArray[np.float64] = NO_TANGENTS  # (3, n_point) see tangents.py; (3, 0) where no material needs them
    face: NDArray[np.uint32] = np.empty(0, np.uint32)  # (n_face,) the triangle as loaded; empty where they are the same
    centers: Centers | None = None  # the last points, which are means of others; None where there are none

    @property
    def n_loaded(self) -> int:
        """Number of triangles as loaded."""
        return int(self.face.max()) + 1 if len(self.face) else self.vertex.shape[1]


def gather_geometry(scene: Scene, is_flat: bool) -> Geometry:
    """Gather the meshes of a scene for flat shading, or for methods that interpolate between vertices."""
    materials, numbers = number_materials(scene.meshes)
    is_textured = any(material.texture is not None for material in materials)
    is_brushed = any(material.is_anisotropic and material.tangent == "u" for material in materials)
    parts = [flat_part(mesh) if is_flat else smooth_part(mesh) for mesh in scene.meshes]
    if is_brushed:
        parts = [add_tangents(part, mesh, is_flat) for part, mesh in zip(parts, scene.meshes, strict=True)]
    parts = [split_points(part, mesh, is_textured) for part, mesh in zip(parts, scene.meshes, strict=True)]
    geometry = _join_parts(parts, is_flat, is_textured)
    offsets, group_material = group_points([n for part in parts for n in part.n_points], np.concatenate(numbers))
    geometry = geometry._replace(
        point_offsets=offsets,
        group_material=group_material,
        face_material=_face_materials(scene.meshes, numbers) if len(materials) > 1 else np.empty(0, np.uint32),
        tangents=_columns([part.tangents for part in parts], np.float64) if is_brushed else NO_TANGENTS,
    )
    if not is_flat:
        geometry = about_centers(geometry, scene.meshes, parts)
        flag_inverted(geometry.positions, geometry.normals, geometry.vertex, geometry.is_inverted)
    return geometry


def _join_parts(parts: Sequence[Part], is_flat: bool, is_textured: bool) -> Geometry:
    """Stack the arrays of meshes; indices move behind the meshes before them. What belongs to materials is left
    empty."""
    first_vertex = np.cumsum([0] + [len(part.positions) for part in parts])
    positions = _columns([part.positions for part in parts], np.float64)
    vertex = _columns([part.vertex for part in parts], np.uint32, first_vertex)
    points, corner = positions, vertex
    if is_flat:
        points = _columns([part.points for part in parts], np.float64)
        corner = vertex if is_textured else _columns([part.corner for part in parts], np.uint32, _first_points(parts))
    normals = _columns([part.normals for part in parts], np.float64)
    albedo = np.empty((0, 3))
    if is_textured or any(part.albedo is not None for part in parts):
        white = [np.ones((len(part.points), 3)) if part.albedo is None else part.albedo for part in parts]
        albedo = np.concatenate(white)
    uv = np.concatenate([part.uv for part in parts]) if is_textured else np.empty((0, 2))
    is_inverted, nothing = np.zeros(vertex.shape[1], np.uint8), np.empty(0, np.int64)
    return Geometry(
        positions, vertex, corner, points, normals, albedo, is_inverted, nothing, nothing, np.empty(0, np.uint32), uv
    )


def _face_materials(meshes: Sequence[Mesh], numbers: Sequence[NDArray]) -> NDArray[np.uint32]:
    """Return the material of each triangle, (n_face,); `numbers` are those of each mesh's palette."""
    of_meshes = [
        np.full(mesh.n_face, number[0]) if mesh.face_material is None else number[mesh.face_material]
        for mesh, number in zip(meshes, numbers, strict=True)
    ]
    return np.concatenate(of_meshes).astype(np.uint32)


def _first_points(parts: Sequence[Part]) -> NDArray[np.int64]:
    """Return the number of the first point of each mesh, and how many points there are."""
    return np.cumsum([0] + [len(part.points) for part in parts])


def about_centers(geometry: Geometry, meshes: Sequence[Mesh], parts: Sequence[Part]) -> Geometry:
    """Draw the convex polygons with more than three corners about their centres; nothing changes where there are
    none."""
    if all(mesh.polygons is None for mesh in meshes):
        return geometry
    rings = [find_rings(part.corner, mesh.polygons, part.points) for mesh, part in zip(meshes, parts, strict=True)]
    rings = join_rings(rings, np.cumsum([0] + [mesh.n_face for mesh in meshes]), _first_points(parts))
    if len(rings.start) == 0:
        return geometry
    vertex, face, centers = split_rings(geometry.vertex, geometry.points.shape[1], rings)
    positions, normals = (
        np.ascontiguousarray(with_means(rows.T, centers).T) for rows in (geometry.positions, geometry.normals)
    )
    return geometry._replace(
        positions=positions, vertex=vertex, corner=vertex, points=positions, normals=normals,
        albedo=with_means(geometry.albedo, centers), is_inverted=np.zeros(vertex.shape[1], np.uint8),
        face_material=geometry.face_material[face] if len(geometry.face_material) else geometry.face_material,
        uv=with_means(geometry.uv, centers), tangents=with_means(geometry.tangents.T, centers).T,
        face=face, centers=centers,
    )  # fmt: skip


def number_materials(meshes: Sequence[Mesh]) -> tuple[tuple[Material, ...], list[NDArray[np.int64]]]:
    """Return the different materials of a scene, and for each mesh the numbers, int64, of those in its palette."""
    number = {}
    numbers = [np.array([number.setdefault(material, len(number)) for material in mesh.palette]) for mesh in meshes]
    return tuple(number), numbers


def group_points(n_points: ArrayLike, material: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Join neighbouring groups of points of the same material; return where the groups begin and end, and their
    materials."""
    ends, material = np.cumsum(n_points), np.asarray(material, np.int64)
    is_last = np.append(material[1:] != material[:-1], True)
    return np.append(0, ends[is_last]), material[is_last]


def _columns(arrays: Sequence[NDArray], dtype: DTypeLike, offsets: NDArray | None = None) -> NDArray:
    """Stack (n, 3) arrays as (3, n), one contiguous column an axis; indices move behind the parts before them."""
    out = np.empty((3, sum(len(array) for array in arrays)), dtype)
    start = 0
    for k, array in enumerate(arrays):
        stop = start + len(array)
        for axis in range(3):
            out[axis, start:stop] = array[:, axis]
            if offsets is not None:
                out[axis, start:stop] += dtype(offsets[k])
        start = stop
    return out
