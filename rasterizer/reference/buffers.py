"""What is known of the surface that each pixel's centre sees, beside its light: masks, labels, coordinates, values.

In: the fragments of the nearest surfaces. Out: `SurfaceBuffers`, one array for each.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.camera import View
from ..scene.material import Material
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
    uv, barycentric, position = (np.full((*shape, n), np.nan) for n in (2, 3, 3))
    numbers: dict[Material, int] = {}
    face_labels, corner_uv = [], []
    for number, mesh in enumerate(scene.meshes):
        palette = np.array([numbers.setdefault(material, len(numbers)) for material in mesh.palette])
        of_faces = palette[np.zeros(mesh.n_face, int) if mesh.face_material is None else mesh.face_material]
        face_labels.append([np.full(mesh.n_face, number), of_faces])
        corner_uv.append(_uv_of(mesh))
    mask[at], barycentric[at] = True, fragments.weights
    labels[:, at[0], at[1]] = np.concatenate(face_labels, axis=1)[:, fragments.face]
    uv[at] = blend(fragments.weights, np.concatenate(corner_uv)[fragments.face])
    position[at] = blend(fragments.weights, surface.corners[fragments.face])
    seen_from_camera = to_eye(position, view) * CAMERA_AXES
    axes = np.stack([view.right, view.up, -np.asarray(view.forward)])
    return SurfaceBuffers(mask, *labels, uv, barycentric, position, seen_from_camera, normal @ axes.T)


def _uv_of(mesh: Mesh) -> NDArray[np.float64]:
    """Return the texture coordinates (n_face, 3, 2) of a mesh's corners, NaN where it has none."""
    if mesh.uv is None:
        return np.full((mesh.n_face, 3, 2), np.nan)
    return (mesh.uv if mesh.uv.ndim == 3 else mesh.uv[mesh.faces])[..., :2]
