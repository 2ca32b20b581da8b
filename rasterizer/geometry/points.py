"""Geometry of a scene: all its meshes as one set of plain arrays, with normals where the shading method needs them.

Points are where the illumination equation is evaluated or normals are kept: the split vertices for Gouraud's and
Phong's methods, the polygons' centroids for flat shading. With the methods that interpolate, convex polygons with more
than three corners are triangles about their centres, points behind all others that are not lit: see `centers.py`.
Triangles index vertices and points through separate columns, which are the same array where a vertex is a point.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel
from .centers import Centers, join_rings, split_rings, with_means
from .normals import polygon_normals, split_creases
from .polygons import find_rings

DEFAULT_CREASE_ANGLE = 30.0  # degrees
LEAST_AGREEMENT = 2.0**-40  # of three corner normals with their triangle's, times its length
NO_TANGENTS = np.empty((3, 0))


class Geometry(NamedTuple):
    """The scene as arrays, meshes one behind the other."""

    positions: np.ndarray  # (3, n_vertex) float64, world space
    vertex: np.ndarray  # (3, n_face) uint32, the vertices of each triangle
    corner: np.ndarray  # (3, n_face) uint32, the points at its corners
    points: np.ndarray  # (3, n_point) float64, world space
    normals: np.ndarray  # (3, n_point) float64, unit length or zero; at centres the means of the corners'
    albedo: np.ndarray  # (n_point, 3) float64, linear; (0, 3) where no mesh has colours and no material a texture
    is_inverted: np.ndarray  # (n_face,) uint8: 1 where the normals look against the winding
    point_offsets: (
        np.ndarray
    )  # (n_group + 1,) int64: points of one material stand side by side, in one or several groups
    group_material: np.ndarray  # (n_group,) int64
    face_material: np.ndarray  # (n_face,) uint32; empty where there is one material
    uv: np.ndarray  # (n_point, 2) float64, texture coordinates; (0, 2) where no material has a texture
    tangents: np.ndarray = NO_TANGENTS  # (3, n_point) float64, see `find_tangents`; (3, 0) where no material needs them
    face: np.ndarray = np.empty(0, np.uint32)  # (n_face,) the triangle as loaded; empty where they are the same
    centers: Centers | None = None  # the last points, which are means of others; None where there are none

    @property
    def n_loaded(self) -> int:
        """Number of triangles as loaded."""
        return int(self.face.max()) + 1 if len(self.face) else self.vertex.shape[1]


class Part(NamedTuple):
    """One mesh's share of Geometry, rows first."""

    positions: np.ndarray  # (n_vertex, 3)
    vertex: np.ndarray  # (n_face, 3)
    corner: np.ndarray  # (n_face, 3)
    points: np.ndarray  # (n_point, 3)
    normals: np.ndarray  # (n_point, 3)
    albedo: np.ndarray | None  # (n_point, 3)
    uv: np.ndarray | None = None  # (n_point, 2)
    n_points: tuple = ()  # of each material
    tangents: np.ndarray | None = None  # (n_point, 3)


def gather_geometry(scene, is_flat: bool) -> Geometry:
    """Gather the meshes of a scene for flat shading, or for methods that interpolate between vertices."""
    materials, numbers = number_materials(scene.meshes)
    is_textured = any(material.texture is not None for material in materials)
    is_brushed = any(material.is_anisotropic and material.tangent == "u" for material in materials)
    parts = [flat_part(mesh) if is_flat else smooth_part(mesh) for mesh in scene.meshes]
    if is_brushed:
        parts = [add_tangents(part, mesh, is_flat) for part, mesh in zip(parts, scene.meshes, strict=True)]
    parts = [split_points(part, mesh, is_textured) for part, mesh in zip(parts, scene.meshes, strict=True)]
    first_vertex = np.cumsum([0] + [len(part.positions) for part in parts])
    first_point = np.cumsum([0] + [len(part.points) for part in parts])
    positions = _columns([part.positions for part in parts], np.float64)
    vertex = _columns([part.vertex for part in parts], np.uint32, first_vertex)
    points, corner = positions, vertex
    if is_flat:
        points = _columns([part.points for part in parts], np.float64)
        corner = vertex if is_textured else _columns([part.corner for part in parts], np.uint32, first_point)
    normals = _columns([part.normals for part in parts], np.float64)
    albedo = np.empty((0, 3))
    if is_textured or any(part.albedo is not None for part in parts):
        white = [np.ones((len(part.points), 3)) if part.albedo is None else part.albedo for part in parts]
        albedo = np.concatenate(white)
    uv = np.concatenate([part.uv for part in parts]) if is_textured else np.empty((0, 2))
    offsets, group_material = group_points([n for part in parts for n in part.n_points], np.concatenate(numbers))
    face_material = np.empty(0, np.uint32)
    if len(materials) > 1:
        of_meshes = [
            np.full(mesh.n_face, number[0]) if mesh.face_material is None else number[mesh.face_material]
            for mesh, number in zip(scene.meshes, numbers, strict=True)
        ]
        face_material = np.concatenate(of_meshes).astype(np.uint32)
    tangents = _columns([part.tangents for part in parts], np.float64) if is_brushed else NO_TANGENTS
    is_inverted = np.zeros(vertex.shape[1], np.uint8)
    geometry = Geometry(
        positions,
        vertex,
        corner,
        points,
        normals,
        albedo,
        is_inverted,
        offsets,
        group_material,
        face_material,
        uv,
        tangents,
    )
    if not is_flat:
        geometry = about_centers(geometry, scene.meshes, parts, first_point)
        flag_inverted(geometry.positions, geometry.normals, geometry.vertex, geometry.is_inverted)
    return geometry


def about_centers(geometry, meshes, parts, first_point) -> Geometry:
    """Draw the convex polygons with more than three corners about their centres; nothing changes where there are
    none."""
    if all(mesh.polygons is None for mesh in meshes):
        return geometry
    rings = [find_rings(part.corner, mesh.polygons, part.points) for mesh, part in zip(meshes, parts, strict=True)]
    rings = join_rings(rings, np.cumsum([0] + [mesh.n_face for mesh in meshes]), first_point)
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
        uv=with_means(geometry.uv, centers), tangents=with_means(geometry.tangents.T, centers).T, face=face, centers=centers,
    )  # fmt: skip


def number_materials(meshes) -> tuple[tuple, list[np.ndarray]]:
    """The different materials of a scene, and for each mesh the numbers, int64, of those in its palette."""
    number = {}
    numbers = [np.array([number.setdefault(material, len(number)) for material in mesh.palette]) for mesh in meshes]
    return tuple(number), numbers


def group_points(n_points, material) -> tuple[np.ndarray, np.ndarray]:
    """Join neighbouring groups of points of the same material; return where the groups begin and end, and their
    materials."""
    ends, material = np.cumsum(n_points), np.asarray(material, np.int64)
    is_last = np.append(material[1:] != material[:-1], True)
    return np.append(0, ends[is_last]), material[is_last]


def split_points(part, mesh, is_textured) -> Part:
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
    first, kind = _unique_rows(keys)
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


def add_tangents(part, mesh, is_flat) -> Part:
    """Give every point of a mesh a tangent: that of its polygon, or the mean of those that share place and normal with
    it.

    A mesh without texture coordinates has none: zero.
    """
    if mesh.uv is None:
        return part._replace(tangents=np.zeros((len(part.points), 3)))
    corners, corner = mesh.vertices[mesh.faces], np.asarray(part.corner)
    group, n_group = corner, len(part.points)
    if not is_flat:
        first, group = _unique_rows([corners.reshape(-1, 3), part.normals[corner].reshape(-1, 3)])
        n_group = len(first)
    uv = mesh.uv[mesh.faces] if mesh.uv.ndim == 2 else mesh.uv
    of_groups = find_tangents(corners, uv, group.reshape(-1, 3), n_group)
    tangents = np.zeros((len(part.points), 3))
    tangents[corner.ravel()] = of_groups[group.ravel()]
    return part._replace(tangents=tangents)


def find_tangents(corners, uv, point, n_point) -> np.ndarray:
    """Find the directions in which u grows, at points of a surface: the mean of those of the triangles that meet there.

    A triangle's positions are affine in (u, v): with edges e1, e2 that are (a1, b1), (a2, b2) in texture coordinates,
    dP/du = (e1 b2 - e2 b1) / (a1 b2 - a2 b1). Triangles count by their area, as far as their u grows anywhere.

    Parameters
    ----------
    corners : (n_face, 3, 3) float64
    uv : (n_face, 3, 2) float64
    point : (n_face, 3) integers, the points at the corners

    Returns
    -------
    (n_point, 3) float64, unit length; zero where nothing is known
    """
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    (a1, b1), (a2, b2) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    along = (e1 * b2[:, None] - e2 * b1[:, None]) * np.sign(a1 * b2 - a2 * b1)[:, None]
    along = _units(along) * np.linalg.norm(np.cross(e1, e2), axis=1)[:, None]
    sums = [np.bincount(point.ravel(), np.repeat(along[:, k], 3), n_point) for k in range(3)]
    return _units(np.stack(sums, axis=1))


def _units(vectors) -> np.ndarray:
    """Vectors (n, 3) at length 1; zero stays zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0.0, length, 1.0)


def _columns(arrays, dtype, offsets=None) -> np.ndarray:
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


def smooth_part(mesh) -> Part:
    """Split a mesh's vertices where normals or colours differ: the file's normals, else smoothing groups, else creases.

    Where a mesh has colours of its vertices and of its faces, those of the vertices count.
    """
    if mesh.normals is not None and mesh.crease_angle is None:
        if mesh.normals.ndim == 2:
            corner, source, normals = mesh.faces, slice(None), mesh.normals
        else:
            keys = [mesh.faces.reshape(-1, 1), mesh.normals.reshape(-1, 3)]
            first, corner = _unique_rows(keys)
            source, normals = mesh.faces.ravel()[first], mesh.normals.reshape(-1, 3)[first]
            corner = corner.reshape(-1, 3)
    else:
        angle = DEFAULT_CREASE_ANGLE if mesh.crease_angle is None else mesh.crease_angle
        groups = mesh.smoothing if mesh.crease_angle is None else None
        corner, source, normals = split_creases(mesh.vertices, mesh.faces, angle, mesh.weighting, groups)
    albedo = None if mesh.colors is None else mesh.colors[source, :3]
    if mesh.face_colors is not None and albedo is None:
        colors = np.repeat(mesh.face_colors[:, :3], 3, axis=0)
        first, new_corner = _unique_rows([corner.reshape(-1, 1), colors])
        point = corner.ravel()[first]
        source = np.arange(len(mesh.vertices))[source][point]
        normals, albedo, corner = normals[point], colors[first], new_corner.reshape(-1, 3)
    positions = mesh.vertices[source]
    return Part(positions, corner, corner, positions, normals, albedo)


def flat_part(mesh) -> Part:
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


def _triangle_colors(mesh) -> np.ndarray:
    """Colours (n_face, 3) of triangles, the means of their corners; in a convex polygon the mean of all its corners, so
    that it doesn't matter which is first."""
    colors = sum(mesh.colors[mesh.faces[:, k], :3] for k in range(3)) / 3.0
    rings = find_rings(mesh.faces, mesh.polygons, mesh.vertices)
    for k in range(3 if len(rings.start) else 0):
        mean = np.add.reduceat(mesh.colors[rings.corners, k], rings.offsets[:-1]) / np.diff(rings.offsets)
        colors[rings.owners, k] = np.repeat(mean, np.diff(rings.offsets))
    return colors


def polygon_centroids(vertices, faces, polygons, n_polygon) -> np.ndarray:
    """Area-weighted centroids of polygons given as triangles, (n_polygon, 3); the mean of the triangles' where none has
    area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    centers = (a + b + c) / 3.0
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    total = np.bincount(polygons, area, n_polygon)
    share = np.where(total[polygons] > 0.0, area, 1.0)
    return _mean_by(polygons, centers, n_polygon, share)


def _mean_by(group, values, n_group, weights=None) -> np.ndarray:
    """Weighted mean of the rows of each group."""
    weights = np.ones(len(values)) if weights is None else weights
    total = np.bincount(group, weights, n_group)
    sums = [np.bincount(group, values[:, k] * weights, n_group) for k in range(values.shape[1])]
    return np.stack(sums, axis=1) / total[:, None]


def _renumber(polygons) -> np.ndarray:
    """Number the polygons that are in use from 0 upwards, in the order of their numbers."""
    if int(polygons.max()) > 8 * len(
        polygons
    ):  # few, far apart: sorting them is less than looking at all numbers between
        return np.unique(polygons, return_inverse=True)[1].reshape(-1).astype(np.uint32)
    is_used = np.zeros(int(polygons.max()) + 1, np.bool_)
    is_used[polygons] = True
    return (np.cumsum(is_used) - 1)[polygons].astype(np.uint32)


def _unique_rows(columns) -> tuple[np.ndarray, np.ndarray]:
    """Find equal rows of side-by-side arrays; return (first row of each kind, kind of each row), kinds in order of
    first use."""
    rows = np.ascontiguousarray(np.concatenate([np.asarray(column, np.float64) for column in columns], axis=1) + 0.0)
    keys = rows.view(np.dtype((np.void, rows.dtype.itemsize * rows.shape[1]))).ravel()
    _, first, kind = np.unique(keys, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty(len(order), np.uint32)
    rank[order] = np.arange(len(order), dtype=np.uint32)
    return first[order], rank[kind.ravel()]


@kernel
def flag_inverted(positions, normals, vertex, out_is_inverted):
    """Flag the triangles whose corner normals look, on the whole, against their winding.

    Normals at right angles to the triangle, to within 2^-40, agree with it: which way they look is no rounding's to
    decide.
    """
    for face in range(np.uint64(vertex.shape[1])):
        a, b, c = vertex[0, face], vertex[1, face], vertex[2, face]
        e1_x, e1_y, e1_z = (
            positions[0, b] - positions[0, a],
            positions[1, b] - positions[1, a],
            positions[2, b] - positions[2, a],
        )
        e2_x, e2_y, e2_z = (
            positions[0, c] - positions[0, a],
            positions[1, c] - positions[1, a],
            positions[2, c] - positions[2, a],
        )
        n_x = normals[0, a] + normals[0, b] + normals[0, c]
        n_y = normals[1, a] + normals[1, b] + normals[1, c]
        n_z = normals[2, a] + normals[2, b] + normals[2, c]
        c_x, c_y, c_z = e1_y * e2_z - e1_z * e2_y, e1_z * e2_x - e1_x * e2_z, e1_x * e2_y - e1_y * e2_x
        agreement = n_x * c_x + n_y * c_y + n_z * c_z
        out_is_inverted[face] = agreement < -LEAST_AGREEMENT * (abs(c_x) + abs(c_y) + abs(c_z))


@kernel
def find_clearance(positions, vertex, x, y, z):
    """Find the distance from a point to the nearest triangle; at least 0.

    Triangles whose sphere about the centroid is further away than one that was found already are left out.
    """
    least = np.inf
    for face in range(np.uint64(vertex.shape[1])):
        a, b, c = vertex[0, face], vertex[1, face], vertex[2, face]
        center_x = (positions[0, a] + positions[0, b] + positions[0, c]) / 3.0
        center_y = (positions[1, a] + positions[1, b] + positions[1, c]) / 3.0
        center_z = (positions[2, a] + positions[2, b] + positions[2, c]) / 3.0
        radius = 0.0
        for i in (a, b, c):
            dx, dy, dz = positions[0, i] - center_x, positions[1, i] - center_y, positions[2, i] - center_z
            radius = max(radius, dx * dx + dy * dy + dz * dz)
        dx, dy, dz = x - center_x, y - center_y, z - center_z
        if np.sqrt(dx * dx + dy * dy + dz * dz) - np.sqrt(radius) < least:
            least = min(least, triangle_distance(
                (positions[0, a] - x, positions[1, a] - y, positions[2, a] - z),
                (positions[0, b] - x, positions[1, b] - y, positions[2, b] - z),
                (positions[0, c] - x, positions[1, c] - y, positions[2, c] - z),
            ))  # fmt: skip
    return max(least, 0.0)


@kernel
def find_point_clearance(points, x, y, z):
    """Find the distance from a place to the nearest of points (3, n)."""
    least = np.inf
    for k in range(np.uint64(points.shape[1])):
        dx, dy, dz = points[0, k] - x, points[1, k] - y, points[2, k] - z
        least = min(least, dx * dx + dy * dy + dz * dz)
    return np.sqrt(least)


@kernel
def find_shortest_normal(normals, corner):
    """Find the least length that a mean of a triangle's corner normals can have, whatever its weights: the distance of
    the triangle that the normals are the corners of from the origin.

    Corners without a normal don't count: a mean is shorter there, and so is its error. 1 where there are no normals.

    Parameters
    ----------
    normals : (3, n) float64, unit length or zero
    corner : (3, n_face) uint32
    """
    least = 1.0
    for face in range(np.uint64(corner.shape[1])):
        i, j, k = corner[0, face], corner[1, face], corner[2, face]
        a = (normals[0, i], normals[1, i], normals[2, i])
        b = (normals[0, j], normals[1, j], normals[2, j])
        c = (normals[0, k], normals[1, k], normals[2, k])
        # A cheap test first: with the least cosine c > 0 nothing is shorter than √((1 + 2 c)/3), see
        # pipeline/records.py.
        cosine = min(dot3(a, b), dot3(b, c), dot3(c, a))
        if cosine > 0.0 and (1.0 + 2.0 * cosine) / 3.0 >= least * least:
            continue
        a_is, b_is, c_is = dot3(a, a) > 0.0, dot3(b, b) > 0.0, dot3(c, c) > 0.0
        a = a if a_is else (b if b_is else c)
        b = b if b_is else a
        c = c if c_is else a
        if a_is or b_is or c_is:
            least = min(least, triangle_distance(a, b, c))
    return least


@helper
def dot3(a, b):
    """The dot product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@helper
def segment_distance(a, b):
    """The distance of the segment a-b from the origin."""
    d = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    square = dot3(d, d)
    t = min(max(-dot3(a, d) / square, 0.0), 1.0) if square > 0.0 else 0.0
    p = (a[0] + t * d[0], a[1] + t * d[1], a[2] + t * d[2])
    return np.sqrt(dot3(p, p))


@helper
def triangle_distance(a, b, c):
    """The distance of the triangle a-b-c from the origin: that of its plane, if the foot lies inside, else of its
    nearest side.

    In units of the largest coordinate, so that the fourth powers neither over- nor underflow.
    """
    unit = max(abs(a[0]), abs(a[1]), abs(a[2]), abs(b[0]), abs(b[1]), abs(b[2]), abs(c[0]), abs(c[1]), abs(c[2]))
    if unit == 0.0:
        return 0.0
    a, b = (a[0] / unit, a[1] / unit, a[2] / unit), (b[0] / unit, b[1] / unit, b[2] / unit)
    c = (c[0] / unit, c[1] / unit, c[2] / unit)
    u, v = (b[0] - a[0], b[1] - a[1], b[2] - a[2]), (c[0] - a[0], c[1] - a[1], c[2] - a[2])
    normal = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
    square = dot3(normal, normal)
    least = min(segment_distance(a, b), segment_distance(b, c), segment_distance(c, a))
    if square > 0.0:
        # Barycentric weights of the foot: (foot - a) × v · normal, ... with foot - a = -a but for its part along the
        # normal.
        uv, uu, vv, au, av = dot3(u, v), dot3(u, u), dot3(v, v), -dot3(a, u), -dot3(a, v)
        at_b, at_c = vv * au - uv * av, uu * av - uv * au
        if at_b >= 0.0 and at_c >= 0.0 and at_b + at_c <= square:
            least = min(least, abs(dot3(a, normal)) / np.sqrt(square))
    return unit * least


@kernel
def find_shapes(positions, normals, vertex, out_shape):
    """Find what shadows need of every triangle: its plane, and how far its corners lie, at most, from the tangent
    planes at the other corners: how far the curved surface that it may stand for is from it.

    Parameters
    ----------
    positions, normals : (3, n) float64
    vertex : (3, n_face) uint32
    out_shape : (n_face, 5) float64: unit normal n, n·P of the plane, and that distance, scene units
    """
    for face in range(np.uint64(vertex.shape[1])):
        a, b, c = vertex[0, face], vertex[1, face], vertex[2, face]
        e1_x, e1_y, e1_z = (
            positions[0, b] - positions[0, a],
            positions[1, b] - positions[1, a],
            positions[2, b] - positions[2, a],
        )
        e2_x, e2_y, e2_z = (
            positions[0, c] - positions[0, a],
            positions[1, c] - positions[1, a],
            positions[2, c] - positions[2, a],
        )
        x, y, z = e1_y * e2_z - e1_z * e2_y, e1_z * e2_x - e1_x * e2_z, e1_x * e2_y - e1_y * e2_x
        length = np.sqrt(x * x + y * y + z * z)
        scale = 1.0 / length if length > 0.0 else 0.0
        out_shape[face, 0], out_shape[face, 1], out_shape[face, 2] = x * scale, y * scale, z * scale
        out_shape[face, 3] = (x * positions[0, a] + y * positions[1, a] + z * positions[2, a]) * scale
        lift = 0.0
        for i in (a, b, c):
            for j in (a, b, c):
                lift = max(lift, abs(
                    (positions[0, j] - positions[0, i]) * normals[0, i]
                    + (positions[1, j] - positions[1, i]) * normals[1, i]
                    + (positions[2, j] - positions[2, i]) * normals[2, i]
                ))  # fmt: skip
        out_shape[face, 4] = lift


def find_lifts(geometry) -> np.ndarray:
    """How far points are lifted for shadows, (n_point,) float64, scene units: as the triangles about a vertex are; the
    centroid of a polygon as far as its corners are from its plane."""
    lifts = np.zeros(geometry.points.shape[1])
    if geometry.points is geometry.positions:
        shape = np.empty((geometry.vertex.shape[1], 5))
        find_shapes(geometry.positions, geometry.normals, geometry.vertex, shape)
        for corner in geometry.corner:
            np.maximum.at(lifts, corner, shape[:, 4])
        return lifts
    for vertex, corner in zip(geometry.vertex, geometry.corner, strict=True):
        away = geometry.positions[:, vertex] - geometry.points[:, corner]
        np.maximum.at(lifts, corner, np.abs((away * geometry.normals[:, corner]).sum(axis=0)))
    return lifts
