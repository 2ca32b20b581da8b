"""`--array`: several arrays, every format, and what they can't hold."""

import io
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.command import CUBE, one_error, run
from PIL import Image

import rasterizer as rz
from rasterizer.choices import BUFFERS
from rasterizer.cli import main


def test_one_array_is_an_npy_and_several_are_an_npz(folder):
    assert run(CUBE, "--array", "mask") == 0 and np.load("cube.npy").dtype == bool
    assert run(CUBE, "--array", "depth", "--array", "object", "--array", "depth") == 0
    with np.load("cube.npz") as found:
        assert list(found) == ["depth", "object"] and found["object"].max() == 0
    assert run(CUBE, "--array", "all", "-o", "all.npz") == 0
    with np.load("all.npz") as found:
        assert set(found) == {"color", *BUFFERS}
        scene = rz.load(CUBE)
        expected = rz.render(scene, found["mask"].shape[::-1], outputs="position_camera")
        assert found["position_camera"].shape == expected.position_camera.shape


def test_depth_is_written_in_millimetres_or_at_a_given_scale(folder):
    assert run(CUBE, "--array", "depth", "-o", "a.npy") == 0
    depth = np.load("a.npy").astype(float)
    for name, scale, flags in (("mm.png", 0.001, ()), ("cm.png", 0.01, ("--scale", "0.01"))):
        assert run(CUBE, "--array", "depth", "-o", name, *flags) == 0
        with Image.open(name) as image:
            assert float(image.text["scale"]) == scale
            stored = np.asarray(image).astype(int)
        assert np.array_equal(stored, np.where(np.isfinite(depth), np.rint(depth / scale), 0))


def test_exr_files_hold_the_picture_or_arrays(folder):
    exr = pytest.importorskip("OpenEXR", reason="the extra exr is not installed")
    assert run(CUBE, "-o", "a.exr") == 0
    assert run(CUBE, "--array", "color", "--array", "face", "-o", "b.exr") == 0
    for name, channels in (("a.exr", set("RGBA")), ("b.exr", {*"RGBA", "id.face"})):
        with exr.File(name, separate_channels=True) as file:
            assert set(file.channels()) == channels


def test_stdout_takes_several_arrays(folder, monkeypatch):
    out = SimpleNamespace(buffer=io.BytesIO(), isatty=lambda: False, flush=lambda: None)
    monkeypatch.setattr(sys, "stdout", out)
    assert main(["render", CUBE, "-s", "8", "-q", "--array", "mask", "--array", "face", "-o", "-"]) == 0
    with np.load(io.BytesIO(out.buffer.getvalue())) as found:
        assert list(found) == ["mask", "face"]


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (("--array", "depth", "--array", "mask", "-o", "a.npy"), "a .npy file holds one array"),
        (("--array", "depth", "-o", "a.jpg"), ".npy, .npz, .exr or .png; given a.jpg for --array depth"),
        (("--array", "uv", "-o", "a.png"), "a .png file holds rgb, depth, mask"),
        (("--array", "all", "-o", "a.png"), "a .png file holds one array"),
        (("--array", "rgb", "-o", "a.exr"), "give --array color"),
        (("--scale", "1"), "--scale is that of depth in a PNG file"),
        (("--array", "depth", "--scale", "1", "-o", "a.npy"), "--scale is that of depth in a PNG file"),
        (("--array", "depth", "--scale", "0", "-o", "a.png"), "--scale must be a number above 0; given 0"),
        (("--array", "depth", "--scale", "far", "-o", "a.png"), "a finite number is needed"),
        (("--array", "deep",), "deep"),
    ],
)  # fmt: skip
def test_what_can_not_be_written_is_told_before_anything_is_drawn(folder, capsys, flags, message):
    assert run(CUBE, *flags) == 2
    assert message in one_error(capsys)
    assert not list(folder.iterdir())


def test_a_depth_out_of_range_fails_the_model_alone(folder, capsys):
    assert run(CUBE, "--array", "depth", "--scale", "1e-6", "-o", "a.png") == 4
    assert "scale=" in one_error(capsys) and not list(folder.iterdir())
