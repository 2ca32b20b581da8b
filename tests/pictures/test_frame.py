"""Frames: what they hold, show and write; files appear whole or not at all."""

import io
import os
import stat
import subprocess
import sys

import numpy as np
import pytest
from helpers.arrays import differences
from PIL import Image

from rasterizer.errors import OutputError, SceneError
from rasterizer.frame import Frame, Stats
from rasterizer.io.files import write_whole

STATS = Stats(12, 0, 6, 6, 3, 12, 1, 1e-4, {"scan": 1.5, "shade": 0.5})


def make_frame(alpha=(0, 128, 255), **arrays) -> Frame:
    rgba = np.zeros((2, 3, 4), np.uint8)
    rgba[..., :3] = (200, 100, 50)
    rgba[..., 3] = alpha
    return Frame(rgba, arrays, STATS, (3, 2))


def test_one_line_says_what_it_is():
    text = repr(make_frame(depth=np.zeros((2, 3), np.float32)))
    assert text == "<Frame 3x2 rgb+depth, 12 faces, 25.0 % covered, 2.0 ms>"
    assert STATS.coverage == 0.25


def test_an_array_not_asked_for_says_how_to_get_it():
    frame = make_frame()
    for name in ("color", "depth", "face", "normal"):
        assert not frame.has(name)
        with pytest.raises(SceneError, match=f"no {name}: ask for it with outputs=\\('{name}'"):
            getattr(frame, name)
    buffers = Frame(None, {"face": np.zeros((2, 3), np.int32)}, STATS, (3, 2))
    assert buffers.has("face") and not buffers.has("rgb")
    with pytest.raises(SceneError, match="no picture"):
        np.asarray(buffers)
    assert buffers._repr_png_() is None


def test_pil_drops_alpha_where_all_is_opaque():
    assert make_frame().to_pil().mode == "RGBA" and make_frame(alpha=255).to_pil().mode == "RGB"


def test_a_notebook_shows_the_picture():
    shown = Image.open(io.BytesIO(make_frame()._repr_png_()))
    assert not differences(np.asarray(shown), make_frame().rgba)


def test_saved_pictures_are_the_same(tmp_path):
    frame = make_frame()
    for suffix in (".png", ".PNG", ".webp", ".tif", ".tga"):
        path = tmp_path / f"picture{suffix}"
        assert frame.save(str(path), **({"lossless": True, "exact": True} if suffix == ".webp" else {})) == path
        assert np.array_equal(np.asarray(Image.open(path)), frame.rgba), suffix


def test_transparency_is_laid_on_white_where_a_format_has_none(tmp_path):
    for suffix in (".jpg", ".ppm", ".eps"):
        path = make_frame(alpha=0).save(tmp_path / f"picture{suffix}")
        assert path.stat().st_size, suffix
        assert suffix != ".jpg" or np.asarray(Image.open(path)).min() >= 250, f"{suffix} is not white"


def test_options_of_a_png_file_are_passed_to_pillow():
    rgba = np.zeros((400, 500, 4), np.uint8)
    rgba[200:] = np.random.default_rng(1).integers(0, 256, (200, 500, 4))
    frame = Frame(rgba, {}, STATS, (500, 400))
    plain, small = frame.encode("PNG"), frame.encode("PNG", compress_level=9, dpi=(72, 72))
    assert "dpi" in Image.open(io.BytesIO(small)).info and not Image.open(io.BytesIO(plain)).info
    assert not differences(np.asarray(Image.open(io.BytesIO(small))), frame.rgba)


def run_program(code, folder):
    """What a program says on stdout, in a process of its own; nothing on stderr."""
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True)
    assert done.stderr == "", done.stderr
    return done.stdout.strip()


def test_a_png_file_is_written_without_pillow_and_while_the_interpreter_ends(tmp_path):
    """Importing it takes as long as to encode a picture. At the end no thread can be started any more."""
    code = (
        "import atexit, sys, numpy; from rasterizer.frame import Frame, Stats\n"
        "Frame(numpy.zeros((2, 3, 4), 'u1'), {}, Stats(*[1] * 8), (3, 2)).save('x.png')\n"
        "print(sorted({'PIL', 'numba'} & set(sys.modules)))\n"
        "frame = Frame(numpy.zeros((600, 600, 4), 'u1'), {}, Stats(*[2] * 8), (600, 600))\n"
        "atexit.register(frame.save, 'y.png')"
    )
    assert run_program(code, tmp_path) == "[]"
    assert [Image.open(tmp_path / name).size for name in ("x.png", "y.png")] == [(3, 2), (600, 600)]


def test_format_overrides_the_suffix(tmp_path):
    path = make_frame().save(tmp_path / "picture.data", format="BMP")
    assert Image.open(path).format == "BMP"
    path = make_frame().save(tmp_path / "array.data", format="npy", array="rgba")
    assert not differences(np.load(path), make_frame().rgba)


def test_arrays_are_saved_by_name(tmp_path):
    depth = np.array([[1.0, np.inf, 2.0]] * 2, np.float32)
    frame = make_frame(depth=depth)
    assert not differences(np.load(frame.save(tmp_path / "d.npy", array="depth")), depth)
    assert not differences(np.load(frame.save(tmp_path / "a.npy", array="alpha")), frame.alpha)
    with pytest.raises(SceneError, match="no color"):
        frame.save(tmp_path / "c.npy")
    with pytest.raises(SceneError, match="array must be one of color, rgb"):
        frame.save(tmp_path / "c.npy", array="colour")
    with pytest.raises(SceneError, match="arrays are written as .npy"):
        frame.save(tmp_path / "d.jpg", array="depth")
    assert sorted(os.listdir(tmp_path)) == ["a.npy", "d.npy"]


def test_formats_that_are_unknown_or_cannot_hold_the_picture(tmp_path):
    for name, reason in (
        ("x.foo", "'foo' is unknown.*legal are npy, png"), ("x", "without a suffix.*legal are npy, png"),
        ("x.xbm", "can't write a"), ("x.blp", "can't write a"), ("x.grib", "can't write a"),
    ):  # fmt: skip
        with pytest.raises(OutputError, match=reason):
            make_frame().save(tmp_path / name)
    assert not os.listdir(tmp_path)


def test_places_that_cannot_be_written(tmp_path):
    with pytest.raises(OutputError, match="no folder .*missing"):
        write_whole(tmp_path / "missing" / "x.png", b"1")
    with pytest.raises(OutputError, match="can't write .*irectory"):
        write_whole(tmp_path, b"1")
    (tmp_path / "file").write_bytes(b"1")
    with pytest.raises(OutputError, match="can't write"):
        write_whole(tmp_path / "file" / "x.png", b"1")


class HalfWay(Exception):
    """What stops a write in these tests."""


@pytest.mark.parametrize("stop", [OSError(28, "No space left on device"), KeyboardInterrupt(), HalfWay()])
def test_nobody_sees_half_a_file(tmp_path, monkeypatch, stop):
    path = tmp_path / "x.png"
    path.write_bytes(b"before")

    def fail(*_):
        raise stop

    monkeypatch.setattr(os, "replace", fail)  # the system's, as when a disk is full
    with pytest.raises(OutputError if isinstance(stop, OSError) else type(stop)):
        write_whole(path, b"after")
    assert path.read_bytes() == b"before" and os.listdir(tmp_path) == ["x.png"]


@pytest.mark.skipif(os.name != "posix", reason="permissions and links of POSIX")
def test_permissions_and_links(tmp_path):
    before = os.umask(0o027)
    try:
        write_whole(tmp_path / "x.png", b"1")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "x.png").stat().st_mode) == 0o640
    (tmp_path / "link.png").symlink_to(tmp_path / "x.png")
    write_whole(tmp_path / "link.png", b"2")
    assert (tmp_path / "link.png").is_symlink() and (tmp_path / "x.png").read_bytes() == b"2"
    write_whole("/dev/null", b"3")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
