"""The faces of a scene, corner by corner: what there is to see, before anybody looks.

In: a `Scene`. Out: a `Surface`. The normals of corners come from normals.py. The *side* of a face is +1 where its
shading normals look to the viewer and -1 where they must be turned.

The triangles themselves are part of the model: a `Mesh` has them before anybody draws it, and `Frame.face` numbers
them. Polygons are left for what is the same on all of one: flat shading.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.mesh import DEFAULT_CREASE_ANGLE, Mesh
from ..scene.scene import Scene
from ..vectors import length, unit
from .normals import corner_normals
from .reflection import GRAZING, palette_of
from .vectors import area_vectors, dot


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


def gather(scene: Scene, shading: str = "flat") -> Surface:
    """Lay out the faces of all meshes of a scene corner by corner; for "flat" shading with one colour a polygon."""
    parts, n_polygon, n_material = [], 0, 0
    has_texture = any(material.needs_uv for material in palette_of(scene))
    is_brushed = any(material.is_anisotropic and material.tangent == "u" for material in palette_of(scene))
    for mesh in scene.meshes:
        polygon = np.arange(mesh.n_face)
        if mesh.polygons is not None:  # numbered without gaps
            polygon = np.unique(mesh.polygons, return_inverse=True)[1].reshape(-1)
        given = mesh.face_material
        material = np.zeros(mesh.n_face, np.int64) if given is None else given.astype(np.int64)
        uv = _corner_uv(mesh) if has_texture else None
        albedo = _corner_albedo(mesh)
        if shading == "flat" and mesh.polygons is not None and mesh.colors is not None:
            albedo = _even_colors(mesh, albedo)
        attributes = _corner_normals(mesh), albedo
        part = Surface(mesh.vertices[mesh.faces], *attributes, polygon + n_polygon, material + n_material, uv)
        parts.append(part._replace(tangents=corner_tangents(*part[:2], uv)) if is_brushed else part)
        n_polygon += int(polygon.max()) + 1
        n_material += len(mesh.palette)
    columns = zip(*parts, strict=True)
    return Surface(*(None if column[0] is None else np.concatenate(column) for column in columns))


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


def _even_colors(mesh: Mesh, albedo: NDArray) -> NDArray[np.float64]:
    """Return colours (n_face, 3, 3) that are the mean of those of the polygon's corners, each of which counts once,
    however many triangles have it; `albedo` (n_face, 3, 3) are those of the corners."""
    corners: dict[int, dict] = {}
    for polygon, vertices, colors in zip(mesh.polygons.tolist(), mesh.faces.tolist(), albedo.tolist(), strict=True):
        corners.setdefault(polygon, {}).update({(v, *c): c for v, c in zip(vertices, colors, strict=True)})
    means = {polygon: np.mean(list(colors.values()), axis=0) for polygon, colors in corners.items()}
    return np.stack([np.tile(means[polygon], (3, 1)) for polygon in mesh.polygons.tolist()])


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
