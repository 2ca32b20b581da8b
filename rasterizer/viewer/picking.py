"""What is seen at a pixel: which face, of which object, where in the world, and how it is turned."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..frame import Frame
from ..scene.camera import Camera
from ..scene.scene import Scene


class Picked(NamedTuple):
    """A point of a surface.

    Parameters
    ----------
    pixel : (column, row) of the picture
    face : index of the triangle in the scene, as the buffer `face` has it
    mesh : index of its mesh in `scene.meshes`
    face_of_mesh : index of the triangle in `mesh.faces`
    name : the mesh's name, "" where it has none
    position : (x, y, z) world space, scene units, at the pixel's centre, as exact as the buffer of depth: float32
    normal : (x, y, z) unit, world space, towards the viewer
    """

    pixel: tuple[int, int]
    face: int
    mesh: int
    face_of_mesh: int
    name: str
    position: tuple[float, float, float]
    normal: tuple[float, float, float]

    def __str__(self) -> str:
        whose = f"object {self.name!r}" if self.name else f"object {self.mesh}"
        x, y, z = (f"{value:.6g}" for value in self.position)
        normal = ", ".join(f"{value:.3f}" for value in self.normal)
        return f"face {self.face_of_mesh} of {whose}, position ({x}, {y}, {z}), normal ({normal})"


def pick(frame: Frame, scene: Scene, camera: Camera, x: float, y: float) -> Picked | None:
    """Tell what a frame shows at a point of the picture.

    Parameters
    ----------
    frame : Frame with the buffers "face", "depth" and "normal"
    scene : Scene that it shows
    camera : Camera that it was taken with
    x, y : pixels from the upper left corner; the pixel that they lie in counts

    Returns
    -------
    Picked; None where nothing is, or outside the picture
    """
    column, row = math.floor(x), math.floor(y)
    width, height = frame.size
    if not (0 <= column < width and 0 <= row < height):
        return None
    face = int(frame.face[row, column])
    if face < 0:
        return None
    view, projection = camera.view(), camera.projection(frame.size)
    right, up = projection.ray_axes(view)
    depth = float(frame.depth[row, column])
    spread = depth if projection.is_perspective else 1.0
    across = (column + 0.5 - projection.center_x) / projection.scale_x * spread
    upwards = (projection.center_y - row - 0.5) / projection.scale_y * spread
    position = view.eye + across * right + upwards * up + depth * view.forward
    mesh = int(np.searchsorted(scene.face_offsets, face, side="right")) - 1
    return Picked(
        pixel=(column, row),
        face=face,
        mesh=mesh,
        face_of_mesh=face - int(scene.face_offsets[mesh]),
        name=scene.meshes[mesh].name or "",
        position=_three(position),
        normal=_three(frame.normal[row, column]),
    )


def _three(vector: NDArray[Any]) -> tuple[float, float, float]:
    """Return a vector (3,) as plain numbers."""
    x, y, z = map(float, vector)
    return x, y, z
