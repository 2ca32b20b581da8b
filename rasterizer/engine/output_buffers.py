"""The exact buffers that a frame may have beside the picture: one kernel and one entry in BUFFER_TABLE a kind."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..pipeline.buffers import write_depth, write_face, write_normal
from ..pipeline.surface_buffers import write_label, write_mask, write_mean, write_turned_normal
from ..scene.camera import View
from .buffer_tables import BufferTables


class OutputBuffer(NamedTuple):
    """A kind of buffer: one sample a pixel, at its centre, never averaged.

    The entries of a band may be those of a picture: what holds for every record is told by `face_of` (records.py).

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
