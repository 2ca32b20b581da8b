"""What a frame tells of the surfaces that it shows: its exact buffers by name, and all of one pixel."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import SceneError
from .picking import PICKED, FrameSource, Pick, checked_pixel, make_pick


class FrameBuffers:
    """The exact buffers of a `Frame`, beside depth, face and normal; see there."""

    size: tuple[int, int]
    _arrays: dict[str, NDArray[Any]]
    _source: FrameSource | None

    def array(self, name: str) -> NDArray[Any]:
        """Return an array by name; SceneError for one that the frame doesn't have."""
        raise NotImplementedError

    def pick(self, x: int, y: int) -> Pick | None:
        """Tell what a pixel shows at its centre.

        What the frame doesn't hold is drawn once more: a frame remembers its scene, but not where it was pickled.

        Parameters
        ----------
        x, y : column and row of the pixel, from 0 on; row 0 is the top

        Returns
        -------
        Pick of the nearest surface; None where nothing is

        Raises
        ------
        SceneError : a pixel that the picture doesn't have; a frame that has neither the buffers nor its scene
        """
        x, y = checked_pixel(x, y, self.size)
        if all(name in self._arrays for name in PICKED):
            return make_pick(self._arrays, x, y, None if self._source is None else self._source.scene)
        if self._source is None:
            missing = ", ".join(repr(name) for name in PICKED if name not in self._arrays)
            raise SceneError(f"this frame doesn't know its scene: to pick, ask for outputs=({missing}, ...)")
        return self._source.pick(x, y)

    @property
    def mask(self) -> NDArray[np.bool_]:
        """(height, width) bool: whether something is there."""
        return self.array("mask")

    @property
    def object(self) -> NDArray[np.int32]:
        """(height, width) int32, index into `Scene.meshes`; -1 where nothing is."""
        return self.array("object")

    @property
    def material(self) -> NDArray[np.int32]:
        """(height, width) int32, index into `Scene.materials`; -1 where nothing is."""
        return self.array("material")

    @property
    def uv(self) -> NDArray[np.float32]:
        """(height, width, 2) float32, texture coordinates; NaN where nothing is, or the mesh has none."""
        return self.array("uv")

    @property
    def barycentric(self) -> NDArray[np.float32]:
        """(height, width, 3) float32, weights of the corners of `face`; NaN where nothing is."""
        return self.array("barycentric")

    @property
    def position(self) -> NDArray[np.float32]:
        """(height, width, 3) float32, world space; NaN where nothing is."""
        return self.array("position")

    @property
    def position_camera(self) -> NDArray[np.float32]:
        """(height, width, 3) float32, x right, y up, z backwards from the camera; NaN where nothing is."""
        return self.array("position_camera")

    @property
    def normal_camera(self) -> NDArray[np.float32]:
        """(height, width, 3) float32, `normal` along the camera's axes; 0 where nothing is."""
        return self.array("normal_camera")
