"""Files of arrays as other programs read them: Pillow, OpenCV and OpenEXR give the frame's numbers, within the stated
step, or the file was refused with the suffix that takes them."""

import os

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.raster import ROOT
from PIL import Image

import rasterizer as rz
from rasterizer.choices import BUFFERS

ARRAYS = ("color", "rgb", "rgba", "alpha", *BUFFERS)
FLOATS = ("color", "uv", "barycentric", "position", "position_camera")  # what no PNG file holds
DEPTH_SCALE = 0.001


@pytest.fixture(scope="module")
def frame() -> rz.Frame:
    """A picture with every buffer, and pixels where nothing is: two balls with texture coordinates, one of them red."""
    (ball,) = rz.load(ROOT / "models/globe.obj").meshes
    other = ball.translated((2.5, 0.5, 1)).with_material(rz.Material(diffuse="#c02010", name="red"))
    return rz.render(rz.Scene([ball, other]), (37, 23), outputs=("color", *BUFFERS), samples=4)


def by_pillow(path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image)


def by_opencv(path) -> np.ndarray:
    os.environ["OPENCV_IO_ENABLE_OPENEXR"] = "1"
    cv2 = pytest.importorskip("cv2", reason="OpenCV is not installed")
    if path.suffix == ".exr" and not cv2.haveImageReader(str(path)):
        pytest.skip(f"OpenCV {cv2.__version__} was built without OpenEXR")
    found = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return found if found.ndim == 2 else found[..., [2, 1, 0, 3][: found.shape[2]]]  # of BGR


def by_openexr(path) -> np.ndarray:
    with pytest.importorskip("OpenEXR", reason="the extra exr is not installed").File(str(path)) as file:
        (channel,) = file.channels().values()
        return np.array(channel.pixels)


def numbers_in_png(name, stored) -> tuple[np.ndarray, float]:
    """What the pages say of a PNG file: its numbers as those of the array, and by how much they may differ."""
    stored = np.asarray(stored, float)
    is_nothing = stored == 0
    if name == "depth":
        return np.where(is_nothing, np.inf, stored * DEPTH_SCALE), DEPTH_SCALE / 2
    if name in ("face", "object", "material"):
        return stored - 1, 0
    if name in ("normal", "normal_camera"):
        return np.where(is_nothing.all(axis=-1, keepdims=True), 0, stored / 255 * 2 - 1), 1 / 255
    return (stored / 255, 0.5 / 255) if name in ("mask", "alpha") else (stored, 0)


@pytest.mark.parametrize(
    "reader, suffix", [(by_pillow, "png"), (by_opencv, "png"), (by_opencv, "exr"), (by_openexr, "exr")]
)
def test_others_read_the_numbers_of_the_arrays(frame, tmp_path, reader, suffix):
    if suffix == "exr":
        pytest.importorskip("OpenEXR", reason="the extra exr is not installed")
    for name in ARRAYS:
        if name in (FLOATS if suffix == "png" else ("rgb", "rgba")):
            continue
        path, expected = tmp_path / f"{name}.{suffix}", frame.array(name)
        frame.save(path, array=name)
        found, most = np.squeeze(reader(path)), 0.0
        if suffix == "png":
            found, most = numbers_in_png(name, found)
        elif expected.shape[2:] == (2,):
            assert found.shape[2] == 3 and not found[..., 2].any(), name
            found = found[..., :2]
        assert found.shape == expected.shape, name
        is_number = np.isfinite(expected)
        assert not differences(found[~is_number], np.asarray(expected[~is_number]), equal_nan=True), name
        error = np.abs(found[is_number].astype(float) - expected[is_number]).max()
        assert error <= most * 1.001, f"{name}.{suffix}: {error:.3g} > {most:.3g}"
