"""The geometry of a scene: all its meshes as one set of plain arrays, with normals where a shading method reads them.

Points are where the illumination equation is evaluated or normals are kept: the split vertices for Gouraud's and
Phong's methods, the polygons' centroids for flat shading. Triangles index vertices and points through separate columns,
which are the same array where every vertex is one point.
"""

from collections.abc import Sequence
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..cores import Workers
from ..geometry.closed import find_inner_sides
from ..geometry.normals import Fans, list_fans, polygon_planes, split_creases, within_range
from ..geometry.surfaces import flag_inverted
from ..geometry.weld import unique_rows
from ..scene.arrays import distinct
from ..scene.material import Material
from ..scene.mesh import Mesh
from ..vectors import dot, unit

NO_TANGENTS = np.empty((0, 3))


class Geometry(NamedTuple):
    """The scene as arrays, meshes one behind the other."""

    positions: NDArray[np.float64]  # (n_vertex, 3) world space
    vertex: NDArray[np.uint32]  # (3, n_face) the vertices of each triangle
    corner: NDArray[np.uint32]  # (3, n_face) the points at its corners
    points: NDArray[np.float64]  # (n_point, 3) world space; (0, 3) where they are vertices that nobody asks for
    normals: NDArray[np.float64]  # (n_point, 3) unit length or zero
    albedo: NDArray[np.float64]  # (n_point, 3) linear; (0, 3) where no mesh has colours and no material a texture
    is_inverted: NDArray[np.uint8]  # (n_face,) 1 where the normals look against the winding
    point_offsets: NDArray[np.int64]  # (n_group + 1,) where groups begin: points of one material, side by side
    group_material: NDArray[np.int64]  # (n_group,) a material may have several groups
    face_material: NDArray[np.uint32]  # (n_face,) empty where there is one material
    uv: NDArray[np.float64]  # (n_point, 2 or 4) texture coordinates; (0, 2) where no material has a texture
    tangents: NDArray[np.float64] = NO_TANGENTS  # (n_point, 3) where u grows to; (0, 3) where no material needs them


class Part(NamedTuple):
    """One mesh's share of Geometry, rows first."""

    positions: NDArray[np.float64]  # (n_vertex, 3)
    vertex: NDArray[np.uint32]  # (n_face, 3)
    corner: NDArray[np.uint32]  # (n_face, 3)
    normals: NDArray[np.float64]  # (n_point, 3)
    albedo: NDArray[np.float64] | None  # (n_point, 3)
    source: NDArray[np.uint32] | None = None  # (n_point,) the vertex that each point is; None where each is one
    centroids: NDArray[np.float64] | None = None  # (n_point, 3) which points are instead in flat shading
    uv: NDArray[np.float64] | None = None  # (n_point, 2 or 4)
    n_points: tuple[int, ...] = ()  # of each material
    tangents: NDArray[np.float64] | None = None  # (n_point, 3)

    @property
    def points(self) -> NDArray[np.float64]:
        """(n_point, 3)."""
        if self.centroids is not None:
            return self.centroids
        return self.positions if self.source is None else self.positions[self.source]


def gather_geometry(
    meshes: Sequence[Mesh],
    is_flat: bool,
    workers: Any = None,
    has_lit_points: bool = True,
    fans: Sequence[Fans | None] = (),
) -> Geometry:
    """Gather the meshes of a scene for flat shading, or for methods that interpolate between vertices.

    Parameters
    ----------
    workers : threads to do it on; None = the caller's alone
    has_lit_points : False where points aren't lit: then nobody asks where split vertices are
    fans : of each mesh, see `split_creases`; none where they aren't known
    """
    workers, (materials, palettes) = workers or Workers(1), number_materials(meshes)
    is_textured = is_brushed = is_split = is_colored = False
    for material in materials:
        is_textured |= material.texture is not None
        is_brushed |= material.is_anisotropic and material.tangent == "u"
    n_texcoord = count_texcoords(meshes) if is_textured else 0

    # Each mesh's share; what belongs to a material stands side by side, so that it can be lit together.
    parts, n_points, face_materials = [], [], [np.empty(0, np.uint32)]
    for mesh, palette, of_mesh in zip_longest(meshes, palettes, fans):
        part = flat_part(mesh) if is_flat else smooth_part(mesh, workers, of_mesh)
        if is_brushed:
            part = add_tangents(part, mesh, is_flat)
        if mesh.face_material is not None or is_textured:
            part = split_points(part, mesh, n_texcoord)
        is_split |= part.corner is not part.vertex
        is_colored |= part.albedo is not None
        n_points += part.n_points or (len(part.normals),)
        parts.append(part)
        if len(materials) > 1:
            of_faces = np.zeros(mesh.n_face, np.int64) if mesh.face_material is None else mesh.face_material
            face_materials.append(palette[of_faces])
    ends, group_material = np.cumsum(n_points), np.concatenate(palettes)
    is_last = np.append(group_material[1:] != group_material[:-1], True)  # neighbouring groups of a material are one

    # All of them, one behind the other.
    every = Part(*zip(*parts, strict=True))
    positions = _rows(every.positions)
    vertex = _columns(every.vertex, np.cumsum([0, *map(len, every.positions)]), workers)
    points, corner, albedo = positions, vertex, np.empty((0, 3))
    if is_split:
        corner = _columns(every.corner, np.cumsum([0, *map(len, every.normals)]), workers)
    if is_flat or is_split:
        points = _rows([part.points for part in parts]) if has_lit_points else np.empty((0, 3))
    if is_textured or is_colored:
        albedo = _rows([np.ones(part.normals.shape) if part.albedo is None else part.albedo for part in parts])
    geometry = Geometry(
        positions=positions,
        vertex=vertex,
        corner=corner,
        points=points,
        normals=_rows(every.normals),
        albedo=albedo,
        is_inverted=np.zeros(vertex.shape[1], np.uint8),
        point_offsets=np.append(0, ends[is_last]),
        group_material=group_material[is_last],
        face_material=np.concatenate(face_materials).astype(np.uint32),
        uv=_rows(every.uv) if is_textured else np.empty((0, 2)),
        tangents=_rows(every.tangents) if is_brushed else NO_TANGENTS,
    )
    if not is_flat:
        given = positions, geometry.normals, vertex, corner
        workers.map(lambda part: flag_inverted(*given, part, geometry.is_inverted), workers.ranges(vertex.shape[1]))
    return geometry


def number_materials(meshes: Sequence[Mesh]) -> tuple[tuple[Material, ...], list[NDArray[np.int64]]]:
    """Return the different materials of a scene, and for each mesh the numbers, int64, of those in its palette."""
    number: dict[Material, int] = {}
    palettes = []
    for mesh in meshes:
        for material in mesh.palette:
            number.setdefault(material, len(number))
        palettes.append(np.array([*map(number.__getitem__, mesh.palette)], np.int64))
    return tuple(number), palettes


def join_attributes(geometry: Geometry, n_attribute: int) -> NDArray[np.float64]:
    """Return what Phong's method interpolates, the first attributes of all points, (1, n_point, n_attribute): normals,
    behind them the model's colours, texture coordinates and tangents, 3 to 13."""
    columns = [geometry.normals]
    for column in (geometry.albedo, geometry.uv, geometry.tangents):
        if len(column) == len(geometry.normals) and n_attribute > 3:
            columns.append(column)
    joined = np.concatenate(columns, axis=1) if len(columns) > 1 else geometry.normals
    return np.ascontiguousarray(joined[None, :, :n_attribute])


def turn_to_viewer(geometry: Geometry, view: Any, screen: Any) -> NDArray[np.float64]:
    """Return normals of flat faces, towards the viewer, (2, n_point, 3); side 1 is reversed: that is flipped."""
    away = (geometry.points - view.eye) if screen.is_perspective else view.forward
    signs = np.where(dot(geometry.normals.T, away.T) > 0.0, -1.0, 1.0)
    toward = np.empty((2, *geometry.normals.shape))
    np.multiply(geometry.normals, signs[:, None], out=toward[0])
    np.negative(toward[0], out=toward[1])
    return toward


def _rows(arrays: Sequence[NDArray]) -> NDArray:
    """Stack arrays; a single one is left as it is."""
    return np.concatenate(arrays) if len(arrays) > 1 else np.ascontiguousarray(arrays[0])


def _columns(arrays: Sequence[NDArray], offsets: NDArray, workers: Any) -> NDArray[np.uint32]:
    """Stack (n, 3) indices as (3, n), one contiguous column a corner; they move behind the parts before them. A single
    array that is stored so is left as it is."""
    if len(arrays) == 1 and arrays[0].T.flags.c_contiguous:
        return arrays[0].T
    out, start = np.empty((3, sum(map(len, arrays))), np.uint32), 0
    for array, offset in zip(arrays, offsets.astype(np.uint32), strict=False):
        columns = out[:, start : start + len(array)]

        def fill(part, array=array, columns=columns, offset=offset):
            for axis in range(3):
                column = columns[axis, slice(*part)]
                column[:] = array[slice(*part), axis]
                if offset:
                    column += offset

        workers.map(fill, workers.ranges(len(array)))
        start += len(array)
    return out


# --- the points of one mesh: vertices that are split where something differs, or the centroids of polygons ---


def smooth_part(mesh: Mesh, workers: Any = None, fans: Fans | None = None) -> Part:
    """Split a mesh's vertices where normals or colours differ: the file's normals, else smoothing groups, else creases.

    Where a mesh has colours of its vertices or corners and of its faces, those of the vertices or corners count.
    """
    vertex = mesh.faces
    if mesh.normals is not None and mesh.crease_angle is None:
        if mesh.normals.ndim == 2:
            corner, source, normals = mesh.faces, None, mesh.normals
        else:
            keys = [mesh.faces.reshape(-1, 1), mesh.normals.reshape(-1, 3)]
            first, corner = unique_rows(np.column_stack(keys))
            source, normals = mesh.faces.ravel()[first], mesh.normals.reshape(-1, 3)[first]
            corner = corner.reshape(-1, 3)
    else:
        angle, smoothing = mesh.creases
        corner, source, normals = split_creases(
            mesh.vertices, mesh.faces, angle, mesh.weighting, smoothing, workers, fans
        )
        if len(source) == mesh.n_vertex and (source[1:] > source[:-1]).all():  # nothing is split
            vertex, source = corner, None
    albedo = None
    if mesh.colors is not None and mesh.colors.ndim == 2:
        albedo = mesh.colors[slice(None) if source is None else source, :3]
    elif mesh.colors is not None or mesh.face_colors is not None:
        colors = np.repeat(mesh.face_colors[:, None], 3, axis=1) if mesh.colors is None else mesh.colors
        colors = colors[..., :3].reshape(-1, 3)
        first, new_corner = unique_rows(np.column_stack([corner.reshape(-1, 1), colors]))
        point = corner.ravel()[first]
        source = point if source is None else source[point]
        normals, albedo, corner = normals[point], colors[first], new_corner.reshape(-1, 3)
    return Part(mesh.vertices, vertex, corner, normals, albedo, source)


def flat_part(mesh: Mesh) -> Part:
    """Give every polygon of a mesh one point, its area-weighted centroid, with its plane normal (Newell)."""
    polygons = number_polygons(mesh)
    normals, points = polygon_planes(mesh.vertices, mesh.faces, polygons)
    albedo = None
    if mesh.colors is not None:
        albedo = polygon_colors(mesh, polygons, len(normals))
    elif mesh.face_colors is not None:
        albedo = _mean_by(polygons, mesh.face_colors[:, :3], len(normals))
    corner = np.broadcast_to(polygons[:, None], (mesh.n_face, 3))
    return Part(mesh.vertices, mesh.faces, corner, normals, albedo, centroids=points)


def count_texcoords(meshes: Sequence[Mesh]) -> int:
    """Return how many texture coordinates a point has: 4 where a mesh has some of its own for `metallic_roughness`."""
    return max((mesh.uv.shape[-1] for mesh in meshes if mesh.uv is not None), default=2)


def split_points(part: Part, mesh: Mesh, n_texcoord: int) -> Part:
    """Split the points of a mesh where faces of different materials meet, and where texture coordinates differ, of
    which a point has `n_texcoord`, or 0.

    The points of a material then stand side by side, so that they can be lit together. With textures every point gets
    its texture coordinates, and belongs to one vertex: also in flat shading, where points are polygons else.
    """
    n_material, is_textured = len(mesh.palette), n_texcoord > 0
    uv = mesh.uv if is_textured else None
    uv_of_corner = uv.reshape(3 * mesh.n_face, -1) if uv is not None and uv.ndim == 3 else None
    if mesh.face_material is None and part.centroids is None and uv_of_corner is None:  # nothing is split
        of_vertex = slice(None) if part.source is None else part.source
        own = _texcoords(None if uv is None else uv[of_vertex], len(part.normals), n_texcoord)
        return part._replace(
            positions=part.positions[of_vertex], vertex=part.corner, source=None, uv=own, n_points=(len(own),)
        )
    corner, vertex = np.asarray(part.corner, np.int64).ravel(), np.asarray(part.vertex, np.int64).ravel()
    material = np.zeros(len(corner), np.int64)
    if mesh.face_material is not None:
        material = np.repeat(mesh.face_material.astype(np.int64), 3)
    keys = [material * len(part.normals) + corner]
    if is_textured and part.centroids is not None:
        keys.append(vertex)
    if uv_of_corner is not None:
        keys.append(uv_of_corner)
    first, point = unique_rows(np.column_stack(keys))
    order = np.argsort(material[first], kind="stable")
    first, rank = first[order], np.argsort(order)
    point = rank[point].astype(np.uint32).reshape(-1, 3)
    of_point, of_vertex = corner[first], vertex[first]
    own = None if uv is None else uv[of_vertex] if uv_of_corner is None else uv_of_corner[first]
    return Part(
        part.positions[of_vertex] if is_textured else part.positions, point if is_textured else part.vertex, point,
        part.normals[of_point], None if part.albedo is None else part.albedo[of_point],
        None if is_textured else of_vertex, None if part.centroids is None else part.centroids[of_point],
        _texcoords(own, len(first), n_texcoord), tuple(np.bincount(material[first], minlength=n_material).tolist()),
        None if part.tangents is None else part.tangents[of_point],
    )  # fmt: skip


def _texcoords(rows: NDArray | None, n_point: int, n_texcoord: int) -> NDArray[np.float64]:
    """Return texture coordinates (n_point, n_texcoord): 0 without rows; rows of half as many are repeated."""
    return np.zeros((n_point, n_texcoord)) if rows is None else np.tile(rows, (1, n_texcoord // rows.shape[1]))


def polygon_colors(mesh: Mesh, polygons: NDArray, n_polygon: int) -> NDArray[np.float64]:
    """Return the means (n_polygon, 3) of the colours of the polygons' corners; one that several triangles of a polygon
    have counts once, so that it doesn't matter how the polygon is cut."""
    rows, names = mesh.colors[..., :3], mesh.faces
    if rows.ndim == 3:
        rows = rows.reshape(-1, 3)
        first, names = unique_rows(np.column_stack([mesh.faces.reshape(-1, 1), rows]))
        rows, names = rows[first], names.reshape(-1, 3)
    if mesh.polygons is None:
        return sum(rows[names[:, k]] for k in range(3)) / 3.0
    corners = distinct((polygons[:, None] * np.int64(len(rows)) + names).ravel())
    return _mean_by(corners // len(rows), rows[corners % len(rows)], n_polygon)


def _mean_by(group: NDArray, values: NDArray, n_group: int) -> NDArray[np.float64]:
    """Return the mean of the rows of each group."""
    sums = [np.bincount(group, values[:, k], n_group) for k in range(values.shape[1])]
    return np.stack(sums, axis=1) / np.bincount(group, minlength=n_group)[:, None]


def number_polygons(mesh: Mesh) -> NDArray[np.uint32]:
    """Return the polygon of each triangle, (n_face,), numbered from 0 upwards without gaps."""
    polygons = mesh.polygons
    if polygons is None:
        return np.arange(mesh.n_face, dtype=np.uint32)
    if int(polygons.max()) > 8 * len(polygons):  # few, far apart: to sort them is less than to look at all between
        return np.unique(polygons, return_inverse=True)[1].reshape(-1).astype(np.uint32)
    is_used = np.zeros(int(polygons.max()) + 1, np.bool_)
    is_used[polygons] = True
    return (np.cumsum(is_used) - 1)[polygons].astype(np.uint32)


# --- the directions in which the texture coordinate u grows, for materials that are brushed along it ---------


def add_tangents(part: Part, mesh: Mesh, is_flat: bool) -> Part:
    """Give every point of a mesh a tangent: that of its polygon, or the mean of those that share position and normal
    with it.

    A mesh without texture coordinates has none: zero.
    """
    if mesh.uv is None:
        return part._replace(tangents=np.zeros((len(part.normals), 3)))
    corners, corner = mesh.vertices[mesh.faces], np.asarray(part.corner)
    group, n_group = corner, len(part.normals)
    if not is_flat:
        first, group = unique_rows(np.column_stack([corners.reshape(-1, 3), part.normals[corner].reshape(-1, 3)]))
        n_group = len(first)
    uv = (mesh.uv[mesh.faces] if mesh.uv.ndim == 2 else mesh.uv)[..., :2]
    of_groups = compute_tangents(corners, uv, group.reshape(-1, 3), n_group)
    tangents = np.zeros((len(part.normals), 3))
    tangents[corner.ravel()] = of_groups[group.ravel()]
    return part._replace(tangents=tangents)


def compute_tangents(corners: NDArray, uv: NDArray, point: NDArray, n_point: int) -> NDArray[np.float64]:
    """Compute the directions in which u grows, at points of a surface: the mean of those of the triangles that meet
    there.

    A triangle's positions are affine in (u, v): with edges e1, e2 that are (a1, b1), (a2, b2) in texture coordinates,
    dP/du = (e1 b2 - e2 b1) / (a1 b2 - a2 b1). Triangles count by their area, as far as their u grows anywhere.

    Parameters
    ----------
    corners : (n_face, 3, 3) float64
    uv : (n_face, 3, 2) float64
    point : (n_face, 3) integers, the points at the corners
    n_point : how many points there are

    Returns
    -------
    (n_point, 3) float64, unit length; zero where nothing is known
    """
    corners = within_range(corners)
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    (a1, b1), (a2, b2) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    along = (e1 * b2[:, None] - e2 * b1[:, None]) * np.sign(a1 * b2 - a2 * b1)[:, None]
    along = unit(along) * np.linalg.norm(np.cross(e1, e2), axis=1)[:, None]
    sums = [np.bincount(point.ravel(), np.repeat(along[:, k], 3), n_point) for k in range(3)]
    return unit(np.stack(sums, axis=1))


# --- closed bodies --------------------------------------------------------------------------------------------


def gather_inner_sides(meshes: Sequence[Mesh], fans: Sequence[Fans | None]) -> NDArray[np.int8]:
    """Return the inner sides of the triangles of all meshes, see `find_inner_sides`, 0 where materials let something
    through: of those the fans are None."""
    sides = []
    for mesh, of_mesh in zip(meshes, fans, strict=True):
        if of_mesh is None:
            sides.append(np.zeros(mesh.n_face, np.int8))
        else:
            sides.append(find_inner_sides(mesh.vertices, mesh.faces, of_mesh, mesh.is_welded))
    return np.concatenate(sides)


def list_opaque_fans(meshes: Sequence[Mesh]) -> list[Fans | None]:
    """List the fans of each mesh, None where materials let something through."""
    fans = []
    for mesh in meshes:
        fans.append(list_fans(mesh.faces, mesh.n_vertex) if mesh.is_opaque else None)
    return fans
