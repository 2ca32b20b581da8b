"""Pictures that are written while they are drawn, or drawn into an array that is given."""

import itertools
import os
import subprocess
import sys

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pinhole import torus
from helpers.raster import COLORED, ROOT
from PIL import Image

import rasterizer as rz

SIZE = (31, 23)
CAMERA = rz.Camera.perspective((1.5, 2, 4), fov=40)
LAMPS = (*COLORED, rz.PointLight((1, 1, 2), 2.0))  # too bright, so that the range is left


def ring(background=None, opacity=1.0):
    """A ring that hides parts of itself."""
    return rz.Scene([rz.Mesh(*torus(12, 8), material=rz.Material(opacity=opacity))], LAMPS, CAMERA, background)


OPTIONS = [
    {"outputs": "rgb"}, {"samples": 4}, {"threads": 3, "shading": "phong"}, {"color_range": "global"},
    {"color_range": "global", "outputs": "rgb", "samples": 4}, {"color_range": "local", "outputs": ("depth", "color")},
]  # fmt: skip


def test_the_file_is_that_of_the_frame(tmp_path):
    looks = itertools.cycle([(None, 1.0), ("orange", 1.0), (None, 0.5)])
    for options, (background, opacity) in zip(OPTIONS, looks, strict=False):
        with rz.Renderer(ring(background, opacity), SIZE, **{"samples": 1} | options) as renderer:
            frame = renderer.render()
            has_color = "color" in renderer.options.outputs
            kinds = [("x.tif", None), ("x.TIFF", None), *((f"{name}.npy", name) for name in ("rgb", "rgba", "alpha"))]
            for name, array in [*kinds, ("x.bmp", None), *([("color.npy", "color"), ("x.npy", None)] * has_color)]:
                stats = renderer.render_to(tmp_path / name, array=array)
                written = (tmp_path / name).read_bytes()
                assert written == frame.save(tmp_path / name, array=array).read_bytes(), f"{name}, {options}"
                assert stats.covered == frame.stats.covered and stats.error_bound == frame.stats.error_bound
                assert stats.plan == frame.stats.plan
            frame.save(tmp_path / "x.png")
        png = np.asarray(Image.open(tmp_path / "x.png").convert("RGBA"))
        assert np.array_equal(np.asarray(Image.open(tmp_path / "x.tif")), png), options


def test_arrays_in_png_and_npz_files_are_those_of_a_frame(tmp_path):
    with rz.Renderer(ring(), SIZE, outputs=("rgb", "depth", "normal")) as renderer:
        frame = renderer.render()
        for name, settings in (
            ("mm.png", {"array": "depth"}),
            ("cm.png", {"array": "depth", "scale": 0.01}),
            ("normal.png", {"array": "normal"}),
            ("all.npz", {}),
            ("two.npz", {"array": ("depth", "rgb")}),
        ):
            renderer.render_to(tmp_path / name, **settings)
            written = (tmp_path / name).read_bytes()
            assert written == frame.save(tmp_path / name, **settings).read_bytes(), name
        assert Image.open(tmp_path / "cm.png").text["scale"] == "0.01"
        with pytest.raises(rz.OutputError, match="or more holds the deepest"):
            renderer.render_to(tmp_path / "x.png", array="depth", scale=1e-6)


def test_another_camera_and_a_path_as_text(tmp_path):
    other = rz.Camera.perspective((0, 3, 3), fov=40)
    with rz.Renderer(ring(), SIZE, samples=1) as renderer:
        renderer.render_to(str(tmp_path / "x.tif"), other)
        assert not differences(np.asarray(Image.open(tmp_path / "x.tif")), renderer.render(other).rgba)


def test_what_a_file_cannot_hold(tmp_path):
    for outputs, name, array, words in (
        ("depth", "x.tif", None, "no picture: ask for it with outputs"),
        ("rgb", "x.npy", None, "no color: ask for it"),
        ("rgb", "x.npy", "depth", "no depth: ask for it"),
        ("depth", "x.npy", "rgba", "no picture"),
        ("color", "x.npy", "colour", "array must be one of"),
        ("color", "x.tif", "color", "arrays are written as .npy"),
    ):
        with rz.Renderer(ring(), SIZE, outputs=outputs) as renderer, pytest.raises(rz.SceneError, match=words):
            renderer.render_to(tmp_path / name, array=array)
    assert os.listdir(tmp_path) == []


def test_places_that_cannot_be_written(tmp_path):
    with rz.Renderer(ring(), SIZE, samples=1) as renderer:
        with pytest.raises(rz.OutputError, match="there is no folder"):
            renderer.render_to(tmp_path / "missing" / "x.tif")
        with pytest.raises(rz.OutputError, match="is unknown"):
            renderer.render_to(tmp_path / "x.foo")
        with pytest.raises(rz.SceneError, match="saved to a path"):
            renderer.render_to(5)
        with pytest.raises(rz.OutputError, match="can't write 'a"):
            renderer.render_to("a\0b.tif")
        with pytest.raises(rz.OutputError, match="too long"):
            renderer.render_to(tmp_path / ("x" * 300 + ".tif"))
        with pytest.raises(rz.SceneError, match="camera must be"):
            renderer.render_to(tmp_path / "x.tif", "front")
    with pytest.raises(rz.SceneError, match="closed"):
        renderer.render_to(tmp_path / "x.tif")
    assert os.listdir(tmp_path) == []


def test_a_fault_while_drawing_leaves_nothing(tmp_path, monkeypatch):
    def fail(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", fail)  # the system's, at the last moment
    with rz.Renderer(ring(), SIZE, threads=2, samples=1) as renderer, pytest.raises(KeyboardInterrupt):
        renderer.render_to(tmp_path / "x.tif")
    assert os.listdir(tmp_path) == []


@pytest.mark.nightly
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits and figures of Linux")
def test_a_picture_may_be_larger_than_the_memory(tmp_path):
    """1 GiB of pixels in a process that may have 0.9 GB of addresses, and holds much less."""
    code = (
        "import resource, sys\n"
        "resource.setrlimit(resource.RLIMIT_AS, (900_000_000, 900_000_000))\n"
        "import rasterizer as rz\n"
        "scene = rz.load(sys.argv[1])\n"
        "with rz.Renderer(scene, 16384, outputs='rgb', threads=2) as renderer:\n"
        "    renderer.render_to('x.tif')\n"
        "print(*[line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM')])"
    )
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", code, str(ROOT / "models/cube.obj")]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "x.tif").stat().st_size > 2**30
    held = int(done.stdout) / 1024
    assert held < 300, f"{held:.0f} MiB > 300 MiB held"


# --- into an array ------------------------------------------------------------------------------------------


def test_a_picture_is_drawn_into_the_array_that_is_given():
    for outputs, color_range in (
        ("rgb", "clamp"),
        ("rgb", "global"),
        (("color", "depth"), "clamp"),
        ("color", "global"),
    ):
        out = np.full((SIZE[1], SIZE[0], 4), 77, np.uint8)
        options = {"outputs": outputs, "color_range": color_range, "samples": 1}
        frame, expected = rz.render(ring(), SIZE, out=out, **options), rz.render(ring(), SIZE, **options).rgba
        assert np.shares_memory(frame.rgba, out) and np.array_equal(out, expected), options
        with rz.Renderer(ring(), SIZE, **options) as renderer:
            for _ in range(2):
                assert np.array_equal(renderer.render(out=out).rgba, expected), options


ROOM = np.zeros((SIZE[1], SIZE[0], 4), np.uint8)
READ_ONLY = ROOM.copy()
READ_ONLY.flags.writeable = False


def test_arrays_that_do_not_fit():
    aside = np.zeros(ROOM.size + 1, np.uint8)[1:].reshape(ROOM.shape)
    for out in (ROOM[:-1], ROOM[..., :3], ROOM.astype(np.float32), ROOM[::-1], ROOM.tolist(), READ_ONLY, aside):
        with pytest.raises(rz.SceneError, match=r"out must be a writable array \(23, 31, 4\) of uint8"):
            rz.render(ring(), SIZE, out=out, samples=1)


def test_an_array_takes_a_picture_only():
    with pytest.raises(rz.SceneError, match="out takes a picture"):
        rz.render(ring(), SIZE, outputs="depth", out=ROOM)
