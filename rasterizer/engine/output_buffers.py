"""The exact buffers that a frame may have beside the picture: one kernel and one entry in BUFFER_TABLE a kind."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..pipeline.bands import Band
from ..pipeline.buffers import VisibleSurfaces, write_depth, write_face, write_normal


class OutputBuffer(NamedTuple):
    """A kind of buffer: one sample a pixel, at its centre, never averaged.

    The entries of a band may be those of a picture: what holds for every record is told by `face_of` (records.py).
    """

    write: Callable[[VisibleSurfaces, Band, NDArray], None]  # fills the pixels of a band where something is visible
    dtype: DTypeLike
    n_component: int  # numbers a pixel
    empty: float  # where nothing is visible
    needs_normals: bool = False  # attributes 0-2 of the drawables, in float64, are then the normals

    def make(self, size: tuple[int, int]) -> NDArray:
        """Return room for `size` = (width, height) pixels, (height, width), with several components (height, width,
        n_component); not filled, because the bands are filled one by one, while they are in the cache."""
        return np.empty(size[::-1] if self.n_component == 1 else (*size[::-1], self.n_component), self.dtype)


BUFFER_TABLE = {
    "depth": OutputBuffer(write_depth, np.float32, 1, np.inf),
    "face": OutputBuffer(write_face, np.int32, 1, -1),
    "normal": OutputBuffer(write_normal, np.float32, 3, 0.0, needs_normals=True),
}
