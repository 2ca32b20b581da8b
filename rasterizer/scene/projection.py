"""What a camera means to those who draw: where its eye is, its axes, and how a point of its frame gets its pixel.

The figure and the formulas stand in `camera.py`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class View(NamedTuple):
    """Where the camera is and its axes: (3,) float64 each, world space; the axes are orthonormal."""

    eye: NDArray[np.float64]
    right: NDArray[np.float64]
    up: NDArray[np.float64]
    forward: NDArray[np.float64]

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(3, 3) float64: its columns are the axes right, up and backwards of the camera's frame, world space.

        A direction of the camera's frame (x right, y up, looking down -z) is `world_from_camera @ direction` in the
        world; a point is that plus `eye`.
        """
        return np.stack([self.right, self.up, -self.forward]).T


class Projection(NamedTuple):
    """How a point in the camera's frame gets its pixel; pixels, or pixels a scene unit where orthographic."""

    scale_x: float
    scale_y: float
    center_x: float
    center_y: float
    is_perspective: bool
    skew: float = 0.0  # px that a scene unit upwards takes off x at depth 1; K[0, 1] of OpenCV; 0 without perspective

    def ray_axes(self, view: View) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return what a step of 1/scale_x, 1/scale_y of a pixel moves a point at depth 1 by, (3,) float64 each, world
        space: the ray through (x, y) is

            (x - center_x)/scale_x · across + (center_y - y)/scale_y · upward + forward

        They are the camera's right and up; with skew what stays in one column leans, by skew/scale_x to the right.
        """
        if self.skew == 0.0:
            return view.right, view.up
        return view.right, view.up + (self.skew / self.scale_x) * view.right
