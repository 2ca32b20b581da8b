"""Cameras of many pictures as NeRF and COLMAP keep them: transforms.json, and cameras.txt with images.txt.

In:  Cameras by the names of pictures        Out: files; and the other way round

Both count pixels from the picture's corner, as is done here: the first pixel's centre is (0.5, 0.5). NeRF's matrices
are poses as OpenGL has them, world-from-camera. COLMAP's are camera-from-world, with x right, y down, z forward.

Sources: NeRF, Mildenhall et al. 2020, its synthetic data (`camera_angle_x`); instant-ngp and nerfstudio (`fl_x`, `cx`
…). COLMAP: colmap.github.io/format.html, and cameras/models.h (`PINHOLE` …).
"""

import json
import math
import os
from collections.abc import Mapping, Sequence
from itertools import dropwhile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ModelError, SceneError, cut, shown
from ..keywords import checked_keywords
from ..scene.camera import Camera
from ..scene.framing import rotation
from .files import checked_path, make_folder_of, write_whole
from .model_file import numbers_in

UNDISTORT = (
    "lenses have no distortion here: undistort the pictures, by cv2.undistort(picture, K, distortion) or `colmap "
    "image_undistorter`, and give the cameras without it"
)
_PLACES = {  # of fx, fy, cx, cy among the parameters of COLMAP's models; what is behind them is distortion
    **dict.fromkeys(("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"), (0, 0, 1, 2)),
    **dict.fromkeys(("PINHOLE", "OPENCV", "FULL_OPENCV"), (0, 1, 2, 3)),
}
_LENS = ("fl_x", "fl_y", "cx", "cy", "w", "h")
# What files make Python raise that hold something else: numbers of 400 digits, lists within lists, a focal length of 0.
_FAULTS = (
    OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError, SceneError,
)  # fmt: skip
_DISTORTION = ("k1", "k2", "k3", "k4", "p1", "p2", "is_fisheye")


@checked_keywords
def write_nerf(path: str | os.PathLike[str], cameras: Mapping[str, Camera], size: Sequence[int] | None = None) -> Path:
    """Write the cameras of pictures as NeRF's transforms.json.

    Parameters
    ----------
    path : of the file
    cameras : dict of the pictures' names, as seen from its folder, and their Cameras, such as `frame.camera`
    size : (width, height) of the pictures in pixels; None = that of each camera's calibration

    Returns
    -------
    Path, the same as given

    Raises
    ------
    SceneError : cameras without perspective or with skew, a size that is missing
    OutputError : the file can't be written
    """
    frames = []
    for name, camera in _checked(cameras).items():
        lens = dict(zip(_LENS, _lens(camera, size), strict=True))
        frames.append({"file_path": name, "transform_matrix": camera.pose.tolist(), **lens})
    angle = 2.0 * math.atan(0.5 * frames[0]["w"] / frames[0]["fl_x"])
    shared = {name: frames[0][name] for name in _LENS}
    if all(each[name] == shared[name] for each in frames for name in _LENS):  # else each has its own
        frames = [{name: value for name, value in each.items() if name not in _LENS} for each in frames]
    _write(path, json.dumps({"camera_angle_x": angle, **shared, "frames": frames}, indent=1))
    return Path(path)


@checked_keywords
def read_nerf(path: str | os.PathLike[str], size: Sequence[int] | None = None) -> dict[str, Camera]:
    """Read the cameras of NeRF's transforms.json: a dict of the pictures' names, as the file has them, and Cameras.

    Parameters
    ----------
    path : of the file
    size : (width, height) of the pictures in pixels, where the file doesn't say it by `w` and `h`

    Raises
    ------
    ModelError : a file that is none, or doesn't say the size; distortion: undistort the pictures first
    """
    path = checked_path(path, "path")
    try:
        content = json.loads(Path(path).read_bytes())
        return {each["file_path"]: _of_nerf(content | each, size) for each in content["frames"]}
    except _FAULTS as fault:
        raise _unreadable(path, "transforms.json", fault) from fault


def _of_nerf(said: dict[str, Any], size: Sequence[int] | None) -> Camera:
    """Return the camera of what is said of a picture."""
    if not isinstance(said["file_path"], str):
        raise ValueError(f"file_path must be text; given {shown(said['file_path'])}")
    if (said.get("camera_model") or "PINHOLE") not in tuple(_PLACES) or any(said.get(name) for name in _DISTORTION):
        raise ValueError(UNDISTORT)
    width, height = (said["w"], said["h"]) if "w" in said else size or (None, None)
    if width is None:
        raise ValueError("it doesn't say w and h: give size=(width, height), that of the pictures")
    if not (width > 0 and height > 0 and width % 1 == 0 and height % 1 == 0):
        raise ValueError(f"w and h must be whole numbers above 0; given {shown(width)} and {shown(height)}")
    fx = said.get("fl_x") or 0.5 * width / math.tan(0.5 * said["camera_angle_x"])
    fy, cx, cy = said.get("fl_y", fx), said.get("cx", 0.5 * width), said.get("cy", 0.5 * height)
    return Camera.from_pose(said["transform_matrix"], K=_matrix(fx, fy, cx, cy), size=(int(width), int(height)))


@checked_keywords
def write_colmap(
    folder: str | os.PathLike[str], cameras: Mapping[str, Camera], size: Sequence[int] | None = None
) -> Path:
    """Write the cameras of pictures as COLMAP's text model: cameras.txt, images.txt, and points3D.txt without points.

    Parameters
    ----------
    folder : of the files, such as "sparse/0"
    cameras : dict of the pictures' names and their Cameras, such as `frame.camera`
    size : as for `write_nerf`

    Returns
    -------
    Path, the same as given

    Raises what `write_nerf` does.
    """
    place = Path(checked_path(folder, "folder"))
    lenses: dict[Any, int] = {}
    images = []
    for k, (name, camera) in enumerate(_checked(cameras).items()):
        if not name.strip() or name != name.strip() or len(name.splitlines()) != 1:
            raise SceneError(f"COLMAP's names are one line each without blanks around; given {shown(name)}")
        lens = _lens(camera, size)
        number = lenses.setdefault(lens, len(lenses) + 1)
        _, R, t = camera.to_opencv(lens[4:])
        images.append(f"{k + 1} {_words((*quaternion_of(R), *t))} {number} {name}\n\n")  # no points in the second line
    rows = [f"{number} PINHOLE {lens[4]} {lens[5]} {_words(lens[:4])}\n" for lens, number in lenses.items()]
    _write(place / "cameras.txt", "# CAMERA_ID MODEL WIDTH HEIGHT fx fy cx cy\n" + "".join(rows))
    title = "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, and a line of points\n"
    _write(place / "images.txt", title + "".join(images))
    _write(place / "points3D.txt", "# no points\n")
    return place


@checked_keywords
def read_colmap(folder: str | os.PathLike[str]) -> dict[str, Camera]:
    """Read the cameras of COLMAP's text model, cameras.txt and images.txt in a folder: a dict of the pictures' names
    and their Cameras. A binary one becomes text by `colmap model_converter --output_type TXT`.

    Raises
    ------
    ModelError : files that are none; distortion: undistort the pictures first
    """
    place = Path(checked_path(folder, "folder"))
    try:
        lenses = {}
        for row in filter(str.strip, _rows(place / "cameras.txt")):
            number, model, *words = row.split()
            width, height, *values = _numbers(words)
            if model not in _PLACES or any(values[max(_PLACES[model]) + 1 :]):
                raise ValueError(f"camera {number} is {model}: {UNDISTORT}")
            if width % 1 or height % 1:
                raise ValueError(f"camera {number} has a size of {width:g} x {height:g}")
            K = _matrix(*(values[place] for place in _PLACES[model]))
            lenses[number] = K, (int(width), int(height))
        found = {}
        rows = list(dropwhile(lambda row: not row.strip(), _rows(place / "images.txt")))
        for row in filter(str.strip, rows[::2]):  # behind each picture a line of points, maybe of none
            _, *pose, number, name = row.split(maxsplit=9)
            w, x, y, z, *t = _numbers(pose)
            length = math.hypot(x, y, z)
            if not 0.0 < math.hypot(length, w) < math.inf:
                raise ValueError(f"the rotation of '{cut(name.strip(), 80)}' is no quaternion: {w:g} {x:g} {y:g} {z:g}")
            R = rotation(np.array([x, y, z]) / (length or 1.0), math.degrees(2.0 * math.atan2(length, w)))
            K, size = lenses[number]
            found[name.strip()] = Camera.from_opencv(K, R, t, size)
        return found
    except _FAULTS as fault:
        raise _unreadable(folder, "cameras.txt and images.txt", fault) from fault


def quaternion_of(R: NDArray[np.float64]) -> list[float]:
    """Return the unit quaternion (w, x, y, z), w >= 0, of a rotation (3, 3).

    Source: Bar-Itzhack 2000, J. Guidance 23(6), 1085-1087: the eigenvector of the largest eigenvalue.
    """
    (a, b, c), (d, e, f), (g, h, i) = R
    rows = (
        [a + e + i, 0, 0, 0],
        [h - f, a - e - i, 0, 0],
        [c - g, b + d, e - a - i, 0],
        [d - b, c + g, f + h, i - a - e],
    )
    vector = np.linalg.eigh(np.array(rows))[1][:, -1]  # of the lower triangle
    return (vector if vector[0] >= 0.0 else -vector).tolist()


def _matrix(fx: float, fy: float, cx: float, cy: float) -> list[list[float]]:
    """Return K as OpenCV counts: from the centre of the first pixel."""
    return [[fx, 0.0, cx - 0.5], [0.0, fy, cy - 0.5], [0.0, 0.0, 1.0]]


def _lens(camera: Camera, size: Sequence[int] | None) -> tuple[Any, ...]:
    """Return fx, fy, cx, cy, width, height of a camera, from the picture's corner."""
    size = camera.size if size is None else size
    if size is None:
        raise SceneError("size=(width, height), that of the pictures, is needed: a camera without K has none")
    if not camera.is_perspective or camera.skew:
        raise SceneError("NeRF and COLMAP have cameras with perspective and without skew alone")
    lens = camera.projection(size)
    return lens.scale_x, lens.scale_y, lens.center_x, lens.center_y, *map(int, size)


def _checked(cameras: Any) -> Mapping[str, Camera]:
    """Return cameras by name; SceneError for what is none."""
    is_dict = isinstance(cameras, Mapping) and bool(cameras)
    if not is_dict or not all(isinstance(c, Camera) and isinstance(name, str) for name, c in cameras.items()):
        raise SceneError(f"cameras must be a dict of pictures' names and Cameras; given {shown(cameras)}")
    return cameras


def _rows(path: Path) -> list[str]:
    """Return the lines of a file but comments."""
    return [row for row in path.read_text(encoding="utf-8").splitlines() if not row.startswith("#")]


def _numbers(words: list[str]) -> list[float]:
    """Return the numbers that words stand for."""
    found = numbers_in(" ".join(words).encode(errors="replace"))
    if found is None or not np.isfinite(found).all():
        raise ValueError(f"'{cut(' '.join(words), 80)}' are not all numbers")
    return found.tolist()


def _words(numbers: Any) -> str:
    return " ".join(repr(float(number)) for number in numbers)


def _unreadable(path: Any, what: str, fault: Exception) -> ModelError:
    """Say of a file what is wrong."""
    said = getattr(fault, "strerror", None) or cut(f"no {fault}" if isinstance(fault, KeyError) else fault, 300)
    return ModelError(f"{cut(path)}: can't be read as {what}: {said}")


def _write(path: str | os.PathLike[str], text: str) -> None:
    make_folder_of(checked_path(path, "path"))
    write_whole(path, text.encode(errors="replace"))
