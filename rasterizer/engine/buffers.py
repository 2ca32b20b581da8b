"""The exact buffers that a frame may have beside the picture: one kernel and one entry in BUFFER_TABLE for each."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..geometry.points import Geometry
from ..locks import cached_property
from ..pipeline.buffers import (
    CornerTable,
    write_depth,
    write_face,
    write_label,
    write_mask,
    write_mean,
    write_normal,
    write_turned_normal,
)
from ..scene.camera import View
from ..scene.mesh import Mesh
from .scene_tables import SceneTables

# ----------------------------------------------------------------
# What output buffers look up for the visible triangle: labels of faces, and values of the corners of triangles.
# In:  the tables of a scene, and the triangles that it is drawn with (geometry/points.py).
# Out: tables for pipeline/buffers.py. Each is made when a buffer first asks for it, and kept.
#
# Polygons that are drawn about their centres have triangles of an edge and the centre. Texture coordinates of the
# centre are the mean of the corners', as in the picture. Its barycentric coordinates are those of the point in the
# loaded triangle that has the edge: they may be below 0, because the centre may lie beside that triangle. A point of a
# plane polygon is the sum of the loaded triangle's corners with these weights all the same.


class BufferTables:
    """The tables of one scene.

    Parameters
    ----------
    scene : what is drawn
    geometry : the triangles that it is drawn with
    """

    def __init__(self, scene: SceneTables, geometry: Geometry) -> None:
        self._scene, self._geometry = scene, geometry

    @cached_property
    def objects(self) -> NDArray[np.int32]:
        """(n_face,) the mesh of each face as loaded, by its index in `Scene.meshes`."""
        counts = np.diff(self._scene.face_offsets)
        return np.repeat(np.arange(len(counts), dtype=np.int32), counts)

    @cached_property
    def materials(self) -> NDArray[np.int32]:
        """(n_face,) the material of each face as loaded, by its index in `Scene.materials`."""
        parts = []
        for mesh, of_palette in zip(self._scene.meshes, self._scene.palettes, strict=True):
            face_material = np.zeros(mesh.n_face, np.int64) if mesh.face_material is None else mesh.face_material
            parts.append(of_palette.astype(np.int32)[face_material])
        return np.concatenate(parts)

    @cached_property
    def positions(self) -> CornerTable:
        """Where the corners lie, world space."""
        return CornerTable(self._geometry.positions, self._vertex)

    def positions_seen_from(self, view: View) -> CornerTable:
        """Where the corners lie in the frame of a camera, which looks down -z; computed for every view anew."""
        offsets = self.positions.values - view.eye
        return CornerTable(offsets @ view.world_from_camera, self._vertex)

    @cached_property
    def uv(self) -> CornerTable:
        """Texture coordinates; NaN of meshes that have none."""
        return self.table_of([_corner_uv(mesh) for mesh in self._scene.meshes])

    def table_of(self, of_meshes: list[NDArray[np.float64]]) -> CornerTable:
        """Return the table of values (3 n_face, n_component) of the corners of each mesh as loaded."""
        values = np.concatenate(of_meshes)
        rows = 3 * self._loaded[None, :] + self._loaded_corner
        pieces = self._pieces
        if len(pieces):  # rows of their first two corners stand; the centres come behind all others
            ring, n_loaded_corner = self._ring, len(values)
            count = np.bincount(ring)
            firsts = values[rows[0, pieces]]
            sums = [np.bincount(ring, column) for column in firsts.T]
            starts = np.append(0, np.cumsum(count)[:-1])
            low, high = (pick.reduceat(firsts, starts, axis=0) for pick in (np.minimum, np.maximum))
            centers = np.clip(np.stack(sums, axis=1) / count[:, None], low, high)
            values = np.concatenate([values, centers])
            rows[2, pieces] = n_loaded_corner + ring
        return CornerTable(values, rows.astype(np.uint32))

    @cached_property
    def barycentric(self) -> CornerTable:
        """The weights of the corners of the face as loaded."""
        values, rows, pieces = np.eye(3), self._loaded_corner, self._pieces
        if len(pieces):
            corners = self._loaded_corners()
            centers = self._geometry.positions[self._geometry.vertex[2, pieces]]
            values = np.concatenate([values, _weights_in(corners, centers)])
            rows = rows.copy()
            rows[2, pieces] = 3 + np.arange(len(pieces))
        return CornerTable(values, rows.astype(np.uint32))

    @cached_property
    def _vertex(self) -> NDArray[np.uint32]:
        """(3, n_triangle) the rows of positions, as kernels take them."""
        return np.ascontiguousarray(self._geometry.vertex, np.uint32)

    @cached_property
    def _loaded(self) -> NDArray[np.int64]:
        """(n_triangle,) the face as loaded."""
        face, n_triangle = self._geometry.face, self._geometry.vertex.shape[1]
        return np.arange(n_triangle) if len(face) == 0 else face.astype(np.int64)

    @cached_property
    def _pieces(self) -> NDArray[np.int64]:
        """The triangles about centres, those of a polygon one after the other."""
        centers = self._geometry.centers
        if centers is None:
            return np.empty(0, np.int64)
        return np.flatnonzero(self._geometry.vertex[2] >= centers.first)

    @cached_property
    def _ring(self) -> NDArray[np.int64]:
        """(n_piece,) the polygon of each triangle about a centre."""
        assert self._geometry.centers is not None
        return self._geometry.vertex[2, self._pieces].astype(np.int64) - self._geometry.centers.first

    @cached_property
    def _loaded_corner(self) -> NDArray[np.uint32]:
        """(3, n_triangle) which corner of the loaded face each corner is; of centres 2, which is not theirs.

        The ends of a polygon's edge are corners of the loaded face that has the edge: those that lie where they do.
        """
        corner = np.repeat(np.arange(3, dtype=np.uint32)[:, None], self._geometry.vertex.shape[1], axis=1)
        if len(self._pieces):
            positions, corners = self._geometry.positions, self._loaded_corners()
            for k in range(2):
                here = positions[self._geometry.vertex[k, self._pieces]]
                corner[k, self._pieces] = (corners == here[:, None, :]).all(axis=2).argmax(axis=1)
        return corner

    def _loaded_corners(self) -> NDArray[np.float64]:
        """(n_piece, 3, 3) where the corners of the loaded faces of the pieces lie."""
        loaded, offsets = self._loaded[self._pieces], self._scene.face_offsets
        corners = np.empty((len(loaded), 3, 3))
        owner = np.searchsorted(offsets, loaded, side="right") - 1
        for k, mesh in enumerate(self._scene.meshes):
            at = owner == k
            corners[at] = mesh.vertices[mesh.faces[loaded[at] - offsets[k]]]
        return corners


def _corner_uv(mesh: Mesh) -> NDArray[np.float64]:
    """Return the texture coordinates of a mesh's corners, (3 n_face, 2)."""
    if mesh.uv is None:
        return np.full((3 * mesh.n_face, 2), np.nan)
    return (mesh.uv[mesh.faces] if mesh.uv.ndim == 2 else mesh.uv)[..., :2].reshape(-1, 2)


def _weights_in(corners: NDArray, points: NDArray) -> NDArray[np.float64]:
    """Return the weights (n, 3), summing up to 1, with which triangles (n, 3, 3) give the points (n, 3), or the nearest
    points of their planes; of triangles without area, of their lines.

    Least squares, by the pseudo-inverse: of all weights the smallest where there are many.
    """
    a = corners[:, 0]
    sides = np.stack([corners[:, 1] - a, corners[:, 2] - a], axis=2)
    scale = np.abs(sides).max(axis=(1, 2), keepdims=True)
    scale[scale == 0.0] = 1.0
    found = (np.linalg.pinv(sides / scale) @ ((points - a)[:, :, None] / scale))[:, :, 0]
    return np.concatenate([1.0 - found.sum(axis=1, keepdims=True), found], axis=1)


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
    "depth": OutputBuffer(write_depth, np.float32, 1, np.inf),
    "face": OutputBuffer(write_face, np.int32, 1, -1),
    "normal": OutputBuffer(write_normal, np.float32, 3, 0.0, needs_normals=True),
    "mask": OutputBuffer(write_mask, np.bool_, 1, False),
    "object": OutputBuffer(write_label, np.int32, 1, -1, table=lambda tables, _view: tables.objects),
    "material": OutputBuffer(write_label, np.int32, 1, -1, table=lambda tables, _view: tables.materials),
    "uv": OutputBuffer(write_mean, np.float32, 2, np.nan, table=lambda tables, _view: tables.uv),
    "barycentric": OutputBuffer(write_mean, np.float32, 3, np.nan, table=lambda tables, _view: tables.barycentric),
    "position": OutputBuffer(write_mean, np.float32, 3, np.nan, table=lambda tables, _view: tables.positions),
    "position_camera": OutputBuffer(
        write_mean, np.float32, 3, np.nan, table=lambda tables, view: tables.positions_seen_from(view)
    ),
    "normal_camera": OutputBuffer(
        write_turned_normal, np.float32, 3, 0.0, True, lambda _tables, view: view.world_from_camera.T
    ),
}
