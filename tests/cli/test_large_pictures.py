"""Pictures that the command line writes while it draws: the same files, the same rules for what is replaced."""

import os
import shutil
import signal

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.command import CUBE, assert_refused, end_by_signal, raster, start_with
from PIL import Image

import rasterizer as rz

pytestmark = pytest.mark.usefixtures("folder")
SIDE = 43 * 111  # pixels: linear colours take a little more than the 2^28 bytes from which on files are written so
LARGE = ["-s", str(SIDE), "--preset", "studio", "--shading", "flat", "--threads", "1"]


def test_a_large_picture_is_written_while_it_is_drawn(folder, capsys, monkeypatch):
    assert raster("render", CUBE, *LARGE, "-o", "x.npy", "--json") == 0
    out, err = capsys.readouterr()
    large = np.load("x.npy", mmap_mode="r")
    assert large.shape == (SIDE, SIDE, 3) and f'"size": [{SIDE}, {SIDE}]' in out and err == ""
    small = rz.render(rz.load(CUBE), SIDE // 111, shading="flat", samples=1).color
    assert np.array_equal(large[55::111, 55::111], small), "every 111th pixel"
    os.unlink("x.npy")
    (folder / "x.npy").write_bytes(b"old")
    (folder / "x.npy").chmod(0o400)
    assert_refused(capsys, [(["-q", CUBE, *LARGE, "-o", "x.npy"], "protected")], "render", code=4)
    assert (folder / "x.npy").read_bytes() == b"old"
    shutil.copy(CUBE, "own.npy")
    read = [(["own.npy", "--input-format", "obj", *LARGE, "-o", "own.npy"], "which is read; give another name")]
    assert_refused(capsys, read, "render", code=4)

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "pwrite", fail)  # the system's
    assert_refused(
        capsys, [([CUBE, *LARGE, "-o", "full.npy"], "can't write full.npy: No space left")], "render", code=4
    )


def test_a_picture_for_which_there_is_no_room_says_so(capsys, monkeypatch):
    huge = [CUBE, "-s", "131072", "-o"]
    assert_refused(capsys, [([*huge, "x.npz", "--array", "all"], "GB in memory, and ")], "render")
    usage = shutil.disk_usage(".")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=2**30))  # the system's
    argv = [CUBE, "-s", "65536", "-o", "x.tif", "-q"]
    assert_refused(capsys, [(argv, "it takes 17.2 GB, and 1.07 GB are free")], "render", code=4)
    assert raster("render", *argv[:-1]) == 4
    assert "drawing 17.2 GB into x.tif, which takes a while" in capsys.readouterr().err


@pytest.mark.nightly
@pytest.mark.parametrize(("name", "flags"), [
    ("x.tif", ["-s", "8200"]), ("x.tif", ["-s", "8200", "--color-range", "global", "--exposure", "3"]),
    ("x.npy", ["-s", "4730"]), ("x.npy", ["-s", "8200", "--array", "depth"]),
])  # fmt: skip
def test_the_whole_file_is_that_of_the_library(name, flags, capsys):
    look = ["--preset", "studio", "--shading", "gouraud", "--samples", "1"]
    assert raster("render", CUBE, "-o", name, *look, *flags) == 0
    size = int(flags[1])
    options = {"color_range": "global", "exposure": 3.0} if "--exposure" in flags else {}
    output = "rgb" if name == "x.tif" else "depth" if "--array" in flags else "color"
    frame = rz.render(rz.load(CUBE), size, outputs=output, samples=1, **options)
    Image.MAX_IMAGE_PIXELS = None
    found = np.load(name, mmap_mode="r") if name == "x.npy" else np.asarray(Image.open(name))
    assert not differences(found, frame.rgba if output == "rgb" else getattr(frame, output))


@pytest.mark.nightly
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_while_drawing_leaves_nothing(folder, number, alone):
    code = (
        "import os, sys, time\n"
        "from rasterizer.cli import main\n"
        "real = os.pwrite\n"
        "def pwrite(*where):\n"
        "    print('now', flush=True); time.sleep(30); return real(*where)\n"
        "os.pwrite = pwrite\n"
        f"sys.argv[1:] = ['render', sys.argv[1], *{LARGE!r}, '-o', 'x.npy']\n"
        "sys.exit(main())"
    )
    process = start_with(code)
    assert process.stdout.readline() == b"now\n" and len(os.listdir(folder)) == 1
    end_by_signal(process, number)
    assert os.listdir(folder) == []
