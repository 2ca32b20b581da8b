"""`--array`: several arrays, every format, and what they can't hold."""

import io

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.command import CUBE, PLAIN, assert_refused, errors, one_error, run
from PIL import Image

import rasterizer as rz
from rasterizer.choices import BUFFERS

pytestmark = pytest.mark.usefixtures("folder")


def test_arrays_are_those_of_the_library(capsys):
    cube = rz.load(CUBE)
    for name, dtype in (("color", "f4"), ("rgb", "u1"), ("depth", "f4"), ("face", "i4"), ("normal", "f4")):
        assert run(CUBE, "--array", name, *PLAIN) == 0
        saved, expected = (
            np.load("cube.npy"),
            getattr(rz.render(cube, (24, 16), outputs=(name,), shading="gouraud"), name),
        )
        assert saved.dtype == dtype and np.array_equal(saved, expected), name
    assert run(CUBE, "-o", "x.npy", *PLAIN) == 0, "the suffix alone asks for linear colours"
    assert not differences(np.load("x.npy"), rz.render(cube, (24, 16), shading="gouraud").color)
    assert errors(capsys) == ""


def test_one_array_is_an_npy_and_several_are_an_npz(folder):
    assert run(CUBE, "--array", "mask") == 0 and np.load("cube.npy").dtype == bool
    assert run(CUBE, "--array", "depth", "--array", "object", "--array", "depth") == 0
    with np.load("cube.npz") as found:
        assert list(found) == ["depth", "object"] and found["object"].max() == 0
    assert run(CUBE, "--array", "all", "-o", "all.npz") == 0
    with np.load("all.npz") as found:
        assert set(found) == {"color", *BUFFERS} and found["position_camera"].shape == (16, 24, 3)


def test_depth_is_written_in_millimetres_or_at_a_given_scale(folder, capsys):
    assert run(CUBE, "--array", "depth", "-o", "a.npy") == 0
    depth = np.load("a.npy").astype(float)
    for name, scale, flags in (("mm.png", 0.001, ()), ("cm.png", 0.01, ("--scale", "0.01"))):
        assert run(CUBE, "--array", "depth", "-o", name, *flags) == 0
        with Image.open(name) as image:
            assert float(image.text["scale"]) == scale
            stored = np.asarray(image).astype(int)
        assert np.array_equal(stored, np.where(np.isfinite(depth), np.rint(depth / scale), 0)), name
    assert run(CUBE, "--array", "depth", "--scale", "1e-6", "-o", "b.png") == 4
    assert "scale=" in one_error(capsys) and not (folder / "b.png").exists()


def test_exr_files_hold_the_picture_or_arrays(folder):
    exr = pytest.importorskip("OpenEXR", reason="the extra exr is not installed")
    assert run(CUBE, "-o", "a.exr") == 0
    assert run(CUBE, "--array", "color", "--array", "face", "-o", "b.exr") == 0
    for name, channels in (("a.exr", set("RGBA")), ("b.exr", {*"RGBA", "id.face"})):
        with exr.File(name, separate_channels=True) as file:
            assert (got := set(file.channels())) == channels, f"{name}: {got} != {channels}"


def test_stdout_takes_one_array_or_several(capfdbinary):
    assert run(CUBE, "-o", "-", "--array", "face") == 0
    assert np.load(io.BytesIO(capfdbinary.readouterr().out)).dtype == np.int32
    assert run(CUBE, "-q", "--array", "mask", "--array", "face", "-o", "-") == 0
    with np.load(io.BytesIO(capfdbinary.readouterr().out)) as found:
        assert list(found) == ["mask", "face"]


def test_what_can_not_be_written_is_told_before_anything_is_drawn(capsys):
    cases = {
        "--array depth --array mask -o a.npy": "a .npy file holds one array",
        "--array depth -o a.jpg": ".npy, .npz, .exr or .png; given a.jpg for --array depth",
        "--array uv -o a.png": "a .png file holds rgb, depth, mask",
        "--array all -o a.png": "a .png file holds one array",
        "--array rgb -o a.exr": "give --array color",
        "--scale 1": "--scale is that of depth in a PNG file",
        "--array depth --scale 1 -o a.npy": "--scale is that of depth in a PNG file",
        "--array depth --scale 0 -o a.png": "--scale must be a number above 0; given 0",
        "--array depth --scale far -o a.png": "a finite number is needed",
        "--array deep": "deep",
    }
    assert_refused(capsys, [([CUBE, *flags.split()], words) for flags, words in cases.items()], "render")
