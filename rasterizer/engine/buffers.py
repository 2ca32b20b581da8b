"""The exact buffers that a frame may have beside the picture: one kernel and one entry in BUFFER_TABLE for each."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..locks import cached_property
from ..pipeline import buffers as b
from ..pipeline.buffers import CornerTable
from ..scene.camera import View
from ..scene.mesh import Mesh
from .points import Geometry

# ----------------------------------------------------------------
# What output buffers look up for the visible triangle: labels of faces, and values of the corners of triangles.
# In:  the meshes of a scene, and its triangles (points.py).
# Out: tables for pipeline/buffers.py. Each is made when a buffer first asks for it, and kept.


class BufferTables:
    """The tables of some meshes.

    Parameters
    ----------
    meshes : what is drawn
    geometry : their triangles
    """

    def __init__(self, meshes: Sequence[Mesh], geometry: Geometry) -> None:
        self._meshes, self._geometry = meshes, geometry

    @cached_property
    def objects(self) -> NDArray[np.int32]:
        """(n_face,) the mesh of each triangle, by its index in `Scene.meshes`."""
        counts = [mesh.n_face for mesh in self._meshes]
        return np.repeat(np.arange(len(counts), dtype=np.int32), counts)

    @cached_property
    def materials(self) -> NDArray[np.int32]:
        """(n_face,) the material of each triangle, by its index in `Scene.materials`."""
        face_material = self._geometry.face_material
        return face_material.astype(np.int32) if len(face_material) else np.zeros(len(self.objects), np.int32)

    @cached_property
    def positions(self) -> CornerTable:
        """Where the corners lie, world space."""
        return CornerTable(self._geometry.positions, self._geometry.vertex)

    def positions_seen_from(self, view: View) -> CornerTable:
        """Where the corners lie in the frame of a camera, which looks down -z; computed for every view anew."""
        offsets = self.positions.values - view.eye
        return CornerTable(offsets @ view.world_from_camera, self._geometry.vertex)

    @cached_property
    def uv(self) -> CornerTable:
        """Texture coordinates; NaN of meshes that have none."""
        values = np.concatenate([_corner_uv(mesh) for mesh in self._meshes])
        rows = np.arange(len(values), dtype=np.uint32).reshape(-1, 3).T
        return CornerTable(values, np.ascontiguousarray(rows))

    @cached_property
    def barycentric(self) -> CornerTable:
        """The weights of the corners."""
        rows = np.repeat(np.arange(3, dtype=np.uint32)[:, None], self._geometry.vertex.shape[1], axis=1)
        return CornerTable(np.eye(3), rows)


def _corner_uv(mesh: Mesh) -> NDArray[np.float64]:
    """Return the texture coordinates of a mesh's corners, (3 n_face, 2)."""
    if mesh.uv is None:
        return np.full((3 * mesh.n_face, 2), np.nan)
    return (mesh.uv[mesh.faces] if mesh.uv.ndim == 2 else mesh.uv)[..., :2].reshape(-1, 2)


class OutputBuffer(NamedTuple):
    """How a buffer is written: one sample a pixel, at its centre, never averaged.

    Parameters
    ----------
    write : function of VisibleSurfaces, Band, array and table, which fills the pixels of a band where something is
    dtype : of the array
    n_component : numbers a pixel
    empty : value where nothing is visible
    needs_normals : whether attributes 0-2 of the drawables, in float64, are the normals
    table : function of BufferTables and View that makes the fourth argument of `write`; None = it takes none
    """

    write: Callable[..., None]
    dtype: DTypeLike
    n_component: int
    empty: float
    needs_normals: bool = False
    table: Callable[[BufferTables, View], Any] | None = None

    def make(self, size: tuple[int, int]) -> NDArray:
        """Return room for `size` = (width, height) pixels: (height, width), with several components (height, width,
        n_component), of `dtype`; not filled, because the bands are filled one by one, while they are in the cache."""
        return np.empty(size[::-1] if self.n_component == 1 else (*size[::-1], self.n_component), self.dtype)


BUFFER_TABLE = {
    "depth": OutputBuffer(b.write_depth, np.float32, 1, np.inf),
    "face": OutputBuffer(b.write_face, np.int32, 1, -1),
    "normal": OutputBuffer(b.write_normal, np.float32, 3, 0.0, needs_normals=True),
    "mask": OutputBuffer(b.write_mask, np.bool_, 1, False),
    "object": OutputBuffer(b.write_label, np.int32, 1, -1, table=lambda tables, _view: tables.objects),
    "material": OutputBuffer(b.write_label, np.int32, 1, -1, table=lambda tables, _view: tables.materials),
    "uv": OutputBuffer(b.write_mean, np.float32, 2, np.nan, table=lambda tables, _view: tables.uv),
    "barycentric": OutputBuffer(b.write_mean, np.float32, 3, np.nan, table=lambda tables, _view: tables.barycentric),
    "position": OutputBuffer(b.write_mean, np.float32, 3, np.nan, table=lambda tables, _view: tables.positions),
    "position_camera": OutputBuffer(
        b.write_mean, np.float32, 3, np.nan, table=lambda tables, view: tables.positions_seen_from(view)
    ),
    "normal_camera": OutputBuffer(
        b.write_turned_normal, np.float32, 3, 0.0, True, lambda _tables, view: view.world_from_camera.T
    ),
}
