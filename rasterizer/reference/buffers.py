"""What is known of the surface that each pixel's centre sees, beside its light: masks, labels, coordinates.

In: the fragments of the nearest surfaces. Out: `SurfaceBuffers`, one array a kind.

Of a polygon that is drawn about its centre, a face has an edge of the polygon and the centre for corners. The edge's
ends are corners of the triangle as loaded; the centre has the mean of all corners' texture coordinates, and the
barycentric coordinates of where it lies in the plane of the triangle as loaded.
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
    """Of the pixels' centres; where nothing is, indices are -1 and coordinates NaN, but normals 0."""

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
    face_labels = np.zeros((len(seen), 2), np.int32)
    for mesh in scene.meshes:
        materials += [material for material in dict.fromkeys(mesh.palette) if material not in materials]
    for k, face in enumerate(seen):
        number, mesh, loaded = _owner(scene, int(surface.loaded_faces(face)))
        material = mesh.palette[0 if mesh.face_material is None else mesh.face_material[loaded]]
        face_labels[k] = number, materials.index(material)
        corner_uv[k], corner_weights[k] = _corners(scene, surface, int(face))
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


def _corners(scene: Scene, surface: Surface, face: int) -> tuple[NDArray, NDArray]:
    """Return the texture coordinates (3, 2) of a face's corners, and their weights (3, 3) in the face as loaded."""
    loaded = int(surface.loaded_faces(np.int64(face)))
    uv = _uv_of(scene, loaded)
    ring = -1 if surface.rings is None else int(surface.rings.of_face[face])
    if ring < 0:
        return uv, np.eye(3)
    first, count = surface.rings.first[ring], surface.rings.count[ring]
    _, mesh, row = _owner(scene, loaded)
    corners = mesh.vertices[mesh.faces[row]]
    start, end, center = surface.corners[face]
    edge = [_corner_at(corners, start), _corner_at(corners, end)]
    firsts = []
    for piece in range(first, first + count):
        owner = int(surface.loaded_faces(np.int64(piece)))
        _, mesh, row = _owner(scene, owner)
        firsts.append(_uv_of(scene, owner)[_corner_at(mesh.vertices[mesh.faces[row]], surface.corners[piece, 0])])
    sides = (corners[1:] - corners[0]).T
    (s, t), *_ = np.linalg.lstsq(sides, center - corners[0], rcond=None)
    weights = np.stack([*np.eye(3)[edge], (1 - s - t, s, t)])
    return np.stack([*uv[edge], np.mean(firsts, axis=0)]), weights


def _corner_at(corners: NDArray, point: NDArray) -> int:
    """Return which of three corners lies where a point does."""
    return int(np.flatnonzero((corners == point).all(axis=1))[0])


def _uv_of(scene: Scene, face: int) -> NDArray[np.float64]:
    """Return the texture coordinates (3, 2) of the corners of a face as loaded, NaN where the mesh has none."""
    _, mesh, row = _owner(scene, face)
    if mesh.uv is None:
        return np.full((3, 2), np.nan)
    return mesh.uv[row] if mesh.uv.ndim == 3 else mesh.uv[mesh.faces[row]]
