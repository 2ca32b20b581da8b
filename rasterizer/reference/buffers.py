"""What is known of the surface that each pixel's centre sees, beside its light: masks, labels, coordinates, values.

In: the fragments of the nearest surfaces. Out: `SurfaceBuffers`, one array for each.
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
    corner_uv = np.concatenate([_uv_of(mesh) for mesh in scene.meshes])
    face_labels = np.zeros((len(seen), 2), np.int32)
    for mesh in scene.meshes:
        materials += [material for material in dict.fromkeys(mesh.palette) if material not in materials]
    for k, face in enumerate(seen):
        number, mesh, loaded = _owner(scene, int(face))
        material = mesh.palette[0 if mesh.face_material is None else mesh.face_material[loaded]]
        face_labels[k] = number, materials.index(material)
    mask[at] = True
    for k in range(2):
        labels[k][at] = face_labels[of_seen, k]
    uv[at] = blend(fragments.weights, corner_uv[fragments.face])
    barycentric[at] = fragments.weights
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


def _uv_of(mesh: Mesh) -> NDArray[np.float64]:
    """Return the texture coordinates (n_face, 3, 2) of a mesh's corners, NaN where it has none."""
    if mesh.uv is None:
        return np.full((mesh.n_face, 3, 2), np.nan)
    return (mesh.uv if mesh.uv.ndim == 3 else mesh.uv[mesh.faces])[..., :2]
