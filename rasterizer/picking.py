"""What one pixel shows: which surface, and where on it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import SceneError, shown
from .scene.camera import Camera
from .scene.scene import Scene
from .scene.validate import is_whole

Vector = tuple[float, float, float]

PICKED = (
    "face", "object", "material", "depth", "barycentric", "uv", "position", "position_camera", "normal",
    "normal_camera",
)  # fmt: skip
"""The buffers that tell all of a pixel."""


@dataclass(frozen=True, kw_only=True)
class Pick:
    """Hold what a pixel shows at its centre: the nearest surface, however transparent.

    Parameters
    ----------
    x, y : column and row of the pixel
    face : index of the face as loaded, mesh after mesh
    object : index of the mesh in `Scene.meshes`
    object_name : text, the mesh's name; None where the scene isn't known any more
    object_face : index of the face in `Mesh.faces` of this mesh; None as there
    material : index of the material in `Scene.materials`
    material_name : text, the material's name; None as there
    depth : distance along the viewing axis, scene units
    position : (x, y, z), world space
    position_camera : (x, y, z) in the camera's frame: x right, y up, looking down -z
    normal : (x, y, z), unit length, world space, towards the viewer
    normal_camera : the same in the camera's frame
    uv : (u, v), texture coordinates; None where the mesh has none
    barycentric : weights of the corners of the face, which sum up to 1; see `Frame.barycentric`
    """

    x: int
    y: int
    face: int
    object: int
    object_name: str | None
    object_face: int | None
    material: int
    material_name: str | None
    depth: float
    position: Vector
    position_camera: Vector
    normal: Vector
    normal_camera: Vector
    uv: tuple[float, float] | None
    barycentric: Vector


@dataclass
class FrameSource:
    """What a frame was rendered from, for what it doesn't hold.

    Parameters
    ----------
    scene, camera : of the frame
    make_renderer : returns a Renderer of the scene, for pictures of the frame's size
    """

    scene: Scene
    camera: Camera
    make_renderer: Callable[[], Any]
    _renderer: Any = field(default=None, init=False)  # made by the first pick, and kept

    def pick(self, x: int, y: int) -> Pick | None:
        """Tell what a pixel shows."""
        if self._renderer is None:
            self._renderer = self.make_renderer()
        return self._renderer.pick(x, y, self.camera)


def checked_pixel(x: int, y: int, size: tuple[int, int]) -> tuple[int, int]:
    """Return the column and row of a pixel as ints; SceneError where the picture has no such pixel."""
    width, height = size
    if not (is_whole(x, 0, width - 1) and is_whole(y, 0, height - 1)):
        legal = f"a column of 0 to {width - 1} and a row of 0 to {height - 1}"
        raise SceneError(f"a pixel is {legal}; given {shown(x)}, {shown(y)}")
    return int(x), int(y)


def make_pick(arrays: dict[str, NDArray], x: int, y: int, scene: Scene | None) -> Pick | None:
    """Gather what the buffers `PICKED` say of a pixel; None where nothing is. `scene` gives the names."""
    values: dict[str, Any] = {name: arrays[name][y, x].tolist() for name in PICKED}
    if values["face"] < 0:
        return None
    for name, value in values.items():
        values[name] = tuple(value) if isinstance(value, list) else value
    if np.isnan(values["uv"]).any():
        values["uv"] = None
    names: dict[str, Any] = {"object_name": None, "object_face": None, "material_name": None}
    if scene is not None:
        names = {
            "object_name": scene.meshes[values["object"]].name,
            "object_face": values["face"] - int(scene.face_offsets[values["object"]]),
            "material_name": scene.materials[values["material"]].name,
        }
    return Pick(x=x, y=y, **values, **names)
