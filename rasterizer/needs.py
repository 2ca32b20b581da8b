"""Which kernels a picture needs, found out before it is drawn: so they can be compiled all at once.

A few faces of every mesh are drawn, some pixels large, with the picture's options, and Python runs the kernels and
notes them. What only the whole scene needs, such as clipping, is compiled when it is met.
"""

import logging
from dataclasses import replace

import numpy as np

from .compiler.kernels import noting_needs
from .errors import RasterizerError
from .options import Options
from .scene.mesh import Mesh
from .scene.scene import Scene

SIZE = 6  # pixels
MOST_MESHES = 16
SMALL_MAP = 16  # texels
MOST_FACES = 4  # of a mesh
_ATTRIBUTES = "normals", "uv", "colors", "face_colors", "smoothing", "face_material", "polygons"

_log = logging.getLogger("rasterizer")


def list_needs(scene: Scene, options: Options) -> dict:
    """Return the kernels that a picture needs, {(function, signature): True}."""
    from .renderer import Renderer

    small = {name: getattr(options, name) for name in ("shading", "tolerance", "samples", "outputs", "cull")}
    small |= {"color_range": options.color_range, "exposure": options.exposure, "spectral": options.spectral}
    with noting_needs() as needs:
        try:
            with Renderer(sample_scene(scene), SIZE, threads=1, **small) as renderer:
                renderer.render()
        except RasterizerError as fault:  # what was noted until then is of use
            _log.info("not all kernels that the picture needs are known ahead: %s", fault)
    return needs


def sample_scene(scene: Scene) -> Scene:
    """Return a scene of a few faces that is drawn in the same way: one mesh of every kind there is."""
    kinds = {}
    for mesh in scene.meshes:
        given = tuple(getattr(mesh, name) is None for name in _ATTRIBUTES)
        kinds.setdefault((given, mesh.weighting, mesh.crease_angle is None, mesh.palette), mesh)
    meshes = [sample_mesh(mesh) for mesh in list(kinds.values())[:MOST_MESHES]]
    camera = None
    if scene.camera is not None and not scene.camera.is_perspective:
        camera = replace(scene, meshes=meshes, camera=None).camera_for((SIZE, SIZE))
    lights = [_with_small_map(light) for light in scene.lights]
    return replace(scene, meshes=meshes, camera=camera, lights=lights)


def _with_small_map(light):
    """Return a light whose shadow map, if it has one, is small: Python draws it."""
    if not getattr(light, "shadow", None):
        return light
    return replace(light, shadow=replace(light.shadow, size=SMALL_MAP))


def sample_mesh(mesh: Mesh) -> Mesh:
    """Return a mesh of a few faces with an area: those of the first polygon that has several, and of each material."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    has_area = np.cross(b - a, c - a).any(axis=1)
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
    changes = {}
    for name in _ATTRIBUTES:
        array = getattr(mesh, name)
        if array is not None:
            of_vertices = name in ("normals", "uv", "colors") and array.ndim == 2
            changes[name] = array[vertices if of_vertices else faces]
    return replace(mesh, vertices=mesh.vertices[vertices], faces=corners.reshape(-1, 3), **changes)
