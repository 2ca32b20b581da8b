"""A sample of a scene: a few faces that are drawn in the same way as the whole.

So what a picture needs is found out in no time, such as the kernels that are to be compiled before it is drawn.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from .lights import AmbientLight, Light
from .material import Material
from .mesh import Mesh
from .scene import Scene
from .shadow import Shadow
from .texture import Texture

SIZE = 6  # of a picture of it, pixels
MOST_MESHES = 16
SMALL_MAP = 16  # texels
MOST_FACES = 4  # of a mesh
_ATTRIBUTES = "normals", "uv", "colors", "face_colors", "smoothing", "face_material", "polygons"


def sample_scene(scene: Scene) -> Scene:
    """Return a scene of a few faces that is drawn in the same way: one mesh of every kind there is."""
    kinds: dict[tuple, Mesh] = {}
    for mesh in scene.meshes:
        given = tuple(getattr(mesh, name) is None for name in _ATTRIBUTES)
        kinds.setdefault((given, mesh.weighting, mesh.crease_angle is None, mesh.palette), mesh)
    meshes = tuple(sample_mesh(mesh) for mesh in list(kinds.values())[:MOST_MESHES])
    camera = None
    if scene.camera is not None and not scene.camera.is_perspective:
        camera = replace(scene, meshes=meshes, camera=None).camera_for((SIZE, SIZE))
    lights = tuple(_with_small_map(light) for light in scene.lights)
    return replace(scene, meshes=meshes, camera=camera, lights=lights)


def _with_small_map(light: Light) -> Light:
    """Return a light whose shadow map, if it has one, is small: Python draws it."""
    shadow = getattr(light, "shadow", None)
    if not isinstance(shadow, Shadow) or isinstance(light, AmbientLight):
        return light
    return replace(light, shadow=replace(shadow, size=SMALL_MAP))


def _with_small_texture(material: Material) -> Material:
    """Return a material whose texture, if it has one, has two texels: the brightest one and the one that lets most
    through."""
    texture = material.texture
    if not isinstance(texture, Texture):
        return material
    texels = texture.image.reshape(-1, 4)
    chosen = texels[[texels[:, :3].max(axis=1).argmax(), texels[:, 3].argmin()]]
    return replace(material, texture=Texture(chosen[None], texture.filter, texture.wrap))


def sample_mesh(mesh: Mesh) -> Mesh:
    """Return a mesh of a few faces with an area: those of the first polygon that has several, and of each material."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    edges = np.stack([b - a, c - a])
    with np.errstate(under="ignore"):
        has_area = np.cross(*edges / (np.abs(edges).max() or 1.0)).any(axis=1)
    has_area |= not has_area.any()  # too thin for a number: then any face will do
    chosen = np.flatnonzero(has_area)[:2].tolist()
    if mesh.polygons is not None:
        numbers, counts = np.unique(mesh.polygons, return_counts=True)
        several = np.flatnonzero(np.isin(mesh.polygons, numbers[counts > 1][:1]))
        chosen += several[: MOST_FACES * MOST_FACES].tolist()
    if mesh.face_material is not None:
        _, first = np.unique(np.where(has_area, mesh.face_material, -1), return_index=True)
        chosen += first[:MOST_FACES].tolist()
    faces = np.unique(chosen)
    vertices, corners = np.unique(mesh.faces[faces], return_inverse=True)
    changes: dict[str, Any] = {"material": _with_small_texture(mesh.material)}
    if mesh.materials is not None:
        changes["materials"] = tuple(map(_with_small_texture, mesh.materials))
    for name in _ATTRIBUTES:
        array = getattr(mesh, name)
        if array is not None:
            of_vertices = name in ("normals", "uv", "colors") and array.ndim == 2
            changes[name] = array[vertices if of_vertices else faces]
    return replace(mesh, vertices=mesh.vertices[vertices], faces=corners.reshape(-1, 3).astype(np.uint32), **changes)
