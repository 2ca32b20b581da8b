"""The faces of a scene, corner by corner: what there is to see, before anybody looks.

In: a `Scene`. Out: a `Surface`. The normals of corners come from normals.py. Convex polygons with more than three
corners are laid out about their centres, a face for each edge. The *side* of a face is +1 where its shading normals
look to the viewer and -1 where they must be turned.

The triangles themselves are part of the model: a `Mesh` has them before anybody draws it, `Frame.face` numbers them,
and a concave polygon can be cut correctly in several ways. Which of the polygons are convex, and everything that is
computed of one, is decided here and in shading.py.

Rounding. A corner whose largest coordinate is M was stored with an error of up to M·2^-53 along each axis. This turns
two edges a and b by at most 4 M 2^-53 (|a| + |b|), as each edge moves by up to 2√3 M 2^-53 < 4 M 2^-53. The computed
turn is wrong by less than 2^-49 |a||b| besides. A corner that turns by no more than both counts as straight.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.mesh import DEFAULT_CREASE_ANGLE, Mesh
from ..scene.scene import Scene
from .normals import corner_normals
from .reflection import GRAZING, palette_of
from .vectors import area_vectors, dot, length, unit


class Rings(NamedTuple):
    """Convex polygons with more than three corners, drawn as a face for each edge: its ends, then the centre."""

    of_face: NDArray[np.int64]  # (n_face,) the ring that a face is a part of, -1 = none
    first: NDArray[np.int64]  # (n_ring,) the first face of each ring; the others follow it
    count: NDArray[np.int64]  # (n_ring,) faces of each ring: as many as corners


class Surface(NamedTuple):
    """All faces of a scene, corner by corner, in the order of loading."""

    corners: NDArray[np.float64]  # (n_face, 3, 3) world
    normals: NDArray[np.float64]  # (n_face, 3, 3) unit shading normals, world
    albedo: NDArray[np.float64]  # (n_face, 3, 3) linear RGB that multiplies ka and kd
    polygon: NDArray[np.int64]  # (n_face,) polygon that the triangle came from
    material: NDArray[np.int64]  # (n_face,) row of the table of materials
    # (n_face, 3, 4) texture coordinates, and those of metallic-roughness textures; None where no material needs them
    uv: NDArray[np.float64] | None = None
    tangents: NDArray[np.float64] | None = None  # (n_face, 3, 3) of the corners; None where nothing is brushed along u
    loaded: NDArray[np.int64] | None = None  # (n_face,) the face as loaded; None = the same
    rings: Rings | None = None  # polygons drawn about their centres; None = none

    def loaded_faces(self, face: NDArray) -> NDArray:
        """Return the faces as loaded of faces (n,) of this surface."""
        return face if self.loaded is None else self.loaded[face]


def gather(scene: Scene, shading: str = "flat") -> Surface:
    """Lay out the faces of all meshes of a scene corner by corner.

    Convex polygons with more than three corners are laid out about their centres, unless `shading` is "flat".
    """
    parts, n_polygon, n_material = [], 0, 0
    has_texture = any(material.needs_uv for material in palette_of(scene))
    is_brushed = any(material.is_anisotropic and material.tangent == "u" for material in palette_of(scene))
    for mesh in scene.meshes:
        polygon = np.arange(mesh.n_face) if mesh.polygons is None else np.asarray(mesh.polygons, np.int64)
        material = (
            np.zeros(mesh.n_face, np.int64) if mesh.face_material is None else mesh.face_material.astype(np.int64)
        )
        uv = _corner_uv(mesh) if has_texture else None
        attributes = _corner_normals(mesh), _corner_albedo(mesh)
        part = Surface(mesh.vertices[mesh.faces], *attributes, polygon + n_polygon, material + n_material, uv)
        parts.append(part._replace(tangents=corner_tangents(*part[:2], uv)) if is_brushed else part)
        n_polygon += int(polygon.max()) + 1
        n_material += len(mesh.palette)
    columns = zip(*parts, strict=True)
    surface = Surface(*(None if column[0] is None else np.concatenate(column) for column in columns))
    has_polygons = any(mesh.polygons is not None for mesh in scene.meshes)
    if not has_polygons:
        return surface
    return even_colors(surface) if shading == "flat" else about_centers(surface)


def _corner_normals(mesh: Mesh) -> NDArray[np.float64]:
    """Return the (n_face, 3, 3) shading normals: the file's own, or averaged up to the creases."""
    if mesh.normals is not None and mesh.crease_angle is None:
        return mesh.normals if mesh.normals.ndim == 3 else mesh.normals[mesh.faces]
    crease_angle = DEFAULT_CREASE_ANGLE if mesh.crease_angle is None else mesh.crease_angle
    smoothing = mesh.smoothing if mesh.crease_angle is None else None
    return corner_normals(mesh.vertices, mesh.faces, crease_angle, mesh.weighting, smoothing)


def _corner_albedo(mesh: Mesh) -> NDArray[np.float64]:
    """Return the (n_face, 3, 3) linear colours of the corners, 1 where the mesh has none."""
    if mesh.colors is not None:
        return (mesh.colors if mesh.colors.ndim == 3 else mesh.colors[mesh.faces])[..., :3]
    if mesh.face_colors is not None:
        return np.repeat(mesh.face_colors[:, None, :3], 3, axis=1)
    return np.ones((mesh.n_face, 3, 3))


def _corner_uv(mesh: Mesh) -> NDArray[np.float64]:
    """Return the (n_face, 3, 4) texture coordinates of the corners, 0 where the mesh has none."""
    if mesh.uv is None:
        return np.zeros((mesh.n_face, 3, 4))
    uv = mesh.uv if mesh.uv.ndim == 3 else mesh.uv[mesh.faces]
    return np.concatenate([uv[..., :2], uv[..., -2:]], axis=2)


def compute_sides(surface: Surface, face: NDArray, facing: NDArray) -> NDArray[np.int64]:
    """Compute by what the shading normals of faces are multiplied to make them look to the viewer.

    Parameters
    ----------
    surface : all faces
    face : (n,) int
    facing : (n,) int, +1 where the face's winding is counter-clockwise as the viewer sees it, else -1

    Returns
    -------
    (n,) int, +1 or -1
    """
    vectors = area_vectors(surface.corners[face])
    agreement = dot(surface.normals[face].sum(axis=1), vectors)
    # Normals at right angles to the face agree with it: the sign of a rounding error decides nothing.
    return np.where(agreement >= -GRAZING * np.abs(vectors).sum(axis=1), facing, -facing)


# --- polygons: the convex ones with more than three corners are drawn about their centres --------------------


class Loop(NamedTuple):
    """The corners of one polygon in turn, wound as its triangles are."""

    corners: list[int]  # names of corners
    owners: list[int]  # the triangle that has the edge from each corner to the next


def about_centers(surface: Surface) -> Surface:
    """Return a `Surface` whose convex polygons that were cut into fans are faces between their edges and their centres.

    Two corners are the same where all that is known of them agrees. The centre is the mean of the corners. So is its
    normal, which is not brought to unit length. With Gouraud's method shading.py averages the corners' light.
    """
    columns = [surface.corners, surface.normals, surface.albedo, surface.uv, surface.tangents]
    values, first, loops = _find_loops(surface, [column for column in columns if column is not None])
    loop_of = {face: loop for loop in loops for face in loop.owners}
    sources, faces, rings, begun = [], [], [], {}
    for face in range(len(surface.corners)):
        loop = loop_of.get(face)
        if loop is None:
            sources.append(values[3 * face : 3 * face + 3])
            faces.append(face)
            rings.append(-1)
        elif id(loop) not in begun:
            begun[id(loop)] = len(begun)
            corners = values[first[loop.corners]]
            center = corners.mean(axis=0)
            for here, after in zip(corners, np.roll(corners, -1, axis=0), strict=True):
                sources.append(np.stack([here, after, center]))
            faces += loop.owners
            rings += [begun[id(loop)]] * len(corners)
    values, faces, rings = np.stack(sources), np.array(faces), np.array(rings)
    number, start, count = np.unique(rings, return_index=True, return_counts=True)
    table = Rings(rings, start[number >= 0], count[number >= 0])
    return surface._replace(
        corners=values[..., :3], normals=values[..., 3:6], albedo=values[..., 6:9], polygon=surface.polygon[faces],
        material=surface.material[faces], uv=None if surface.uv is None else values[..., 9:13],
        tangents=None if surface.tangents is None else values[..., -3:], loaded=faces, rings=table,
    )  # fmt: skip


def even_colors(surface: Surface) -> Surface:
    """Return a `Surface` for flat shading, all corners of whose convex polygons have the mean of the polygon's
    colours."""
    values, first, loops = _find_loops(surface, [surface.corners, surface.albedo])
    albedo = surface.albedo.copy()
    for loop in loops:
        albedo[loop.owners] = values[first[loop.corners], 3:6].mean(axis=0)
    return surface._replace(albedo=albedo)


def _find_loops(surface: Surface, columns: list) -> tuple[NDArray, NDArray, list[Loop]]:
    """Find the convex polygons by corners that agree in all columns: (rows of all corners, first row of each name,
    loops).

    A loop begins at the corner with the smallest coordinates: then a mean doesn't depend on where the polygon's list
    begins.
    """
    values = np.concatenate(columns, axis=2).reshape(3 * len(surface.corners), -1) + 0.0
    _, first, name = np.unique(values, axis=0, return_index=True, return_inverse=True)
    points = values[first, :3]
    loops = find_fans(name.reshape(-1, 3), surface.polygon)
    is_convex = {}
    for size in {len(loop.corners) for loop in loops}:
        some = [number for number, loop in enumerate(loops) if len(loop.corners) == size]
        convex = are_convex(points[[loops[number].corners for number in some]])
        is_convex |= dict(zip(some, convex.tolist(), strict=True))
    begin = [min(range(len(loop.corners)), key=lambda k: tuple(points[loop.corners[k]])) for loop in loops]
    turned = [Loop(*(row[k:] + row[:k] for row in loop)) for loop, k in zip(loops, begin, strict=True)]
    return values, first, [loop for number, loop in enumerate(turned) if is_convex[number]]


def find_fans(faces: NDArray, polygon: NDArray) -> list[Loop]:
    """Find the polygons with more than three corners that are fans of triangles.

    All triangles of a fan have a corner in common. They follow each other: each shares with the next the edge at that
    corner. What was cut in another way, as by subdivision, or is interrupted by other polygons, is no fan.

    Parameters
    ----------
    faces : (n_face, 3) integers, names of corners
    polygon : (n_face,) integers, the polygon that each triangle is a part of

    Returns
    -------
    list of Loop, in the order of the triangles
    """
    starts = np.flatnonzero(np.append(True, polygon[1:] != polygon[:-1]))
    counts = np.diff(np.append(starts, len(polygon)))
    _, which, n_run = np.unique(polygon[starts], return_inverse=True, return_counts=True)
    is_whole = n_run[which.ravel()] == 1
    loops = []
    for start, count in zip(
        starts[is_whole & (counts > 1)].tolist(), counts[is_whole & (counts > 1)].tolist(), strict=True
    ):
        loop = _outline(faces[start : start + count].tolist(), start)
        if loop is not None:
            loops.append(loop)
    return loops


def _outline(triangles: list[list[int]], start: int) -> Loop | None:
    """Return the outline of the triangles, which are numbered from `start` on, if they are a fan; else None."""
    owner = {(t[k], t[k - 2]): start + number for number, t in enumerate(triangles) for k in range(3)}  # directed edges
    inner = [edge for edge in owner if edge[::-1] in owner]
    after = {here: there for here, there in owner if (there, here) not in owner}
    n_corner = len(triangles) + 2
    middles = [corner for corner in triangles[0] if all(_share_edge(a, b, corner) for a, b in pairwise(triangles))]
    if (
        not middles
        or len(inner) != 2 * (len(triangles) - 1)
        or len(owner) != 3 * len(triangles)
        or len(after) != n_corner
    ):
        return None
    corners = [middles[0]]
    while len(corners) < n_corner and (there := after.get(corners[-1])) not in (None, corners[0]):
        corners.append(there)
    is_closed = len(corners) == n_corner and after.get(corners[-1]) == corners[0]
    return Loop(corners, [owner[here, after[here]] for here in corners]) if is_closed else None


def _share_edge(a: list[int], b: list[int], corner: int) -> bool:
    """Tell whether two triangles have an edge at a corner in common, along which they are wound alike."""
    if corner not in a or corner not in b:
        return False
    i, j = a.index(corner), b.index(corner)
    return a[i - 2] == b[j - 1] or a[i - 1] == b[j - 2]


def are_convex(points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which polygons are convex: no corner turns back, and all together they go round once. A straight corner is
    no fault.

    Turns are measured about Newell's normal, the sum of the area vectors of a fan.
    Source: Sutherland, Sproull & Schumacker 1974, ACM Computing Surveys 6(1), 1-55.

    Parameters
    ----------
    points : (n, k, 3) float64, the corners of n polygons in turn

    Returns
    -------
    (n,) bool; a polygon whose corners all lie in one place is not convex
    """
    largest = np.abs(points).max(axis=(1, 2))
    points = points - points[:, :1]
    extent = np.abs(points).max(axis=(1, 2))
    has_extent = extent > 0
    extent = np.where(has_extent, extent, 1.0)
    points = points / extent[:, None, None]
    slack = (4.0 * 2.0**-53 * largest / extent)[:, None]  # of a corner, in a polygon that is 1 large
    normal = unit(np.cross(points[:, 1:-1], points[:, 2:]).sum(axis=1))[:, None]
    ahead = np.roll(points, -1, axis=1) - points
    behind = np.roll(ahead, 1, axis=1)
    turn = dot(normal, np.cross(behind, ahead))
    along = dot(behind, ahead) - dot(normal, behind) * dot(normal, ahead)  # as seen along the normal
    size, size_behind = length(ahead)[..., 0], length(behind)[..., 0]
    doubt = slack * (size + size_behind) + 2.0**-49 * size * size_behind
    goes_on = (turn > doubt) | ((turn >= -doubt) & (along > 0.0))
    turns_once = np.arctan2(turn, along).sum(axis=1) < 3.0 * np.pi  # 2π, where a pentagram has 4π
    return has_extent & goes_on.all(axis=1) & turns_once


# --- tangents: along which directions materials are brushed --------------------------------------------------


def face_tangents(corners: NDArray, uv: NDArray) -> NDArray[np.float64]:
    """Return the directions in which u grows on faces, as long as the faces' areas; 0 where it grows nowhere.

    u grows while v stays along the combination of both edges in which the changes of v cancel.

    Parameters
    ----------
    corners : (n_face, 3, 3) float64
    uv : (n_face, 3, 2 or more) float64, of which the first two count

    Returns
    -------
    (n_face, 3) float64
    """
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    d1, d2 = uv[:, 1, :2] - uv[:, 0, :2], uv[:, 2, :2] - uv[:, 0, :2]
    level_v = e1 * d2[:, 1:] - e2 * d1[:, 1:]
    rise_u = (d1[:, :1] * d2[:, 1:] - d2[:, :1] * d1[:, 1:])[:, 0]
    return unit(level_v) * np.sign(rise_u)[:, None] * length(area_vectors(corners))


def unit_sums(vectors: NDArray, group: NDArray) -> NDArray[np.float64]:
    """Return the sums of the vectors (n, 3) of each group (n,) int, at length 1; zero stays zero."""
    total = np.zeros((int(group.max()) + 1, 3))
    np.add.at(total, group, vectors)
    return unit(total)


def corner_tangents(corners: NDArray, normals: NDArray, uv: NDArray) -> NDArray[np.float64]:
    """Return the tangents at the corners of a mesh: the mean over the faces that share position and normal there,
    (n_face, 3, 3)."""
    rows = np.concatenate([corners.reshape(-1, 3), normals.reshape(-1, 3)], axis=1)
    group = np.unique(rows + 0.0, axis=0, return_inverse=True)[1].ravel()
    return unit_sums(np.repeat(face_tangents(corners, uv), 3, axis=0), group)[group].reshape(-1, 3, 3)
