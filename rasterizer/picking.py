"""What one pixel shows: which surface, and where on it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .choices import BUFFERS
from .errors import SceneError, shown
from .options import Options
from .scene.camera import Camera
from .scene.scene import Scene
from .scene.validate import is_whole

Vector = tuple[float, float, float]

PICKED = tuple(name for name in BUFFERS if name != "mask")
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


class FrameSource(NamedTuple):
    """What a frame was drawn from: its scene, camera and options, and what draws what the frame doesn't hold."""

    scene: Scene
    camera: Camera
    options: Options
    pick: Callable[[int, int], Pick | None]


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
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
    if np.isnan(values["uv"]).any():
        values["uv"] = None
    names: dict[str, Any] = dict.fromkeys(("object_name", "object_face", "material_name"))
    if scene is not None:
        names["object_name"] = scene.meshes[values["object"]].name
        names["object_face"] = values["face"] - int(scene.face_offsets[values["object"]])
        names["material_name"] = scene.materials[values["material"]].name
    return Pick(x=x, y=y, **values, **names)
