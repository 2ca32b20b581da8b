"""What is known of the surface that each pixel's centre sees, beside its light: masks, labels, coordinates, values.

In: the fragments of the nearest surfaces. Out: `SurfaceBuffers`, one array for each.

Of a polygon that is drawn about its centre, a face has an edge of the polygon and the centre for corners. The edge's
ends are corners of the triangle as loaded; the centre has the mean of all corners' values, and the barycentric
coordinates of where it lies in the plane of the triangle as loaded.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.camera import View
from ..scene.mesh import Mesh
from ..scene.scene import Scene
from .clip import to_eye
from .shading import Fragments
from .surface import Surface
from .vectors import blend

CAMERA_AXES = np.array([1.0, 1.0, -1.0])  # right, up, depth becomes right, up, backwards


class SurfaceBuffers(NamedTuple):
    """What the pixels' centres see; where nothing is, indices are -1 and coordinates NaN, but normals 0."""

    mask: NDArray[np.bool_]  # (h, w)
    object: NDArray[np.int32]  # (h, w) index into the scene's meshes
    material: NDArray[np.int32]  # (h, w) index into the scene's different materials
    uv: NDArray[np.float64]  # (h, w, 2) NaN also of meshes without texture coordinates
    barycentric: NDArray[np.float64]  # (h, w, 3) weights of the corners of the face as loaded, which sum up to 1
    position: NDArray[np.float64]  # (h, w, 3) world
    position_camera: NDArray[np.float64]  # (h, w, 3) x right, y up, z backwards
    normal_camera: NDArray[np.float64]  # (h, w, 3) the same axes


def describe_surface(
    scene: Scene, surface: Surface, fragments: Fragments, normal: NDArray, view: View
) -> SurfaceBuffers:
    """Gather the buffers of the fragments of the nearest surfaces; `normal` is (h, w, 3), world."""
    shape, at = normal.shape[:2], (fragments.rows, fragments.columns)
    mask, labels = np.zeros(shape, bool), np.full((2, *shape), -1, np.int32)
    uv, barycentric = np.full((*shape, 2), np.nan), np.full((*shape, 3), np.nan)
    position = np.full((*shape, 3), np.nan)
    materials: list = []
    seen, of_seen = np.unique(fragments.face, return_inverse=True)
    corner_uv, corner_weights = np.zeros((len(seen), 3, 2)), np.zeros((len(seen), 3, 3))
    uv_of_meshes = [_uv_of(mesh) for mesh in scene.meshes]
    face_labels = np.zeros((len(seen), 2), np.int32)
    for mesh in scene.meshes:
        materials += [material for material in dict.fromkeys(mesh.palette) if material not in materials]
    for k, face in enumerate(seen):
        number, mesh, loaded = _owner(scene, int(surface.loaded_faces(face)))
        material = mesh.palette[0 if mesh.face_material is None else mesh.face_material[loaded]]
        face_labels[k] = number, materials.index(material)
        corner_uv[k] = _corner_values(scene, surface, int(face), uv_of_meshes)
        corner_weights[k] = _corner_weights(scene, surface, int(face))
    mask[at] = True
    for k in range(2):
        labels[k][at] = face_labels[of_seen, k]
    uv[at] = blend(fragments.weights, corner_uv[of_seen])
    barycentric[at] = blend(fragments.weights, corner_weights[of_seen])
    position[at] = blend(fragments.weights, surface.corners[fragments.face])
    seen_from_camera = to_eye(position, view) * CAMERA_AXES
    axes = np.stack([view.right, view.up, -np.asarray(view.forward)])
    return SurfaceBuffers(mask, *labels, uv, barycentric, position, seen_from_camera, normal @ axes.T)


def _owner(scene: Scene, face: int) -> tuple[int, Mesh, int]:
    """Return the mesh of a face as loaded: its index, itself, and the face's index in it."""
    for number, mesh in enumerate(scene.meshes):
        if face < mesh.n_face:
            return number, mesh, face
        face -= mesh.n_face
    raise IndexError(face)


def _corner_values(scene: Scene, surface: Surface, face: int, of_meshes: list[NDArray]) -> NDArray[np.float64]:
    """Return the values (3, k) of a face's corners; `of_meshes` are those of the loaded faces, (n_face, 3, k) each."""
    own = _loaded_values(scene, surface, face, of_meshes)
    ring = -1 if surface.rings is None else int(surface.rings.of_face[face])
    if ring < 0:
        return own
    firsts = []
    first, count = surface.rings.first[ring], surface.rings.count[ring]
    for piece in range(first, first + count):
        corner = _corner_at(_loaded_corners(scene, surface, piece), surface.corners[piece, 0])
        firsts.append(_loaded_values(scene, surface, piece, of_meshes)[corner])
    return np.stack([*own[_edge_of(scene, surface, face)], np.mean(firsts, axis=0)])


def _corner_weights(scene: Scene, surface: Surface, face: int) -> NDArray[np.float64]:
    """Return the weights (3, 3) of a face's corners in the face as loaded."""
    if surface.rings is None or surface.rings.of_face[face] < 0:
        return np.eye(3)
    corners, center = _loaded_corners(scene, surface, face), surface.corners[face, 2]
    (s, t), *_ = np.linalg.lstsq((corners[1:] - corners[0]).T, center - corners[0], rcond=None)
    return np.stack([*np.eye(3)[_edge_of(scene, surface, face)], (1 - s - t, s, t)])


def _edge_of(scene: Scene, surface: Surface, face: int) -> list[int]:
    """Return which corners of the face as loaded are the ends of the edge of a face about a centre."""
    corners, (start, end, _) = _loaded_corners(scene, surface, face), surface.corners[face]
    return [_corner_at(corners, start), _corner_at(corners, end)]


def _corner_at(corners: NDArray, point: NDArray) -> int:
    """Return which of three corners lies where a point does."""
    return int(np.flatnonzero((corners == point).all(axis=1))[0])


def _loaded_corners(scene: Scene, surface: Surface, face: int) -> NDArray[np.float64]:
    """Return where the corners (3, 3) of a face as loaded lie."""
    _, mesh, row = _owner(scene, int(surface.loaded_faces(np.int64(face))))
    return mesh.vertices[mesh.faces[row]]


def _loaded_values(scene: Scene, surface: Surface, face: int, of_meshes: list[NDArray]) -> NDArray[np.float64]:
    """Return the values (3, k) of the corners of a face as loaded."""
    number, _, row = _owner(scene, int(surface.loaded_faces(np.int64(face))))
    return of_meshes[number][row]


def _uv_of(mesh: Mesh) -> NDArray[np.float64]:
    """Return the texture coordinates (n_face, 3, 2) of a mesh's corners, NaN where it has none."""
    if mesh.uv is None:
        return np.full((mesh.n_face, 3, 2), np.nan)
    return (mesh.uv if mesh.uv.ndim == 3 else mesh.uv[mesh.faces])[..., :2]
