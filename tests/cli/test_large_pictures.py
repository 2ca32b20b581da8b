"""Pictures that the command line writes while it draws: the same files, the same rules for what is replaced."""

import json
import os
import shutil
import signal
import time

import numpy as np
import pytest
from helpers.command import CUBE, end_by_signal, one_error, run, start_with
from helpers.raster import ROOT
from PIL import Image

from rasterizer.cli import main, render_command
from rasterizer.engine import memory

pytestmark = pytest.mark.usefixtures("folder")
GLOBE = ("globe.obj", "globe.mtl", "globe.png")


@pytest.fixture
def all_large(monkeypatch):
    """Every picture counts as a large one."""
    monkeypatch.setattr(render_command, "_IN_MEMORY", 0)


@pytest.mark.parametrize(
    ("name", "flags"),
    [
        ("x.tif", []), ("x.tiff", ["--background", "red"]), ("x.npy", []), ("x.npy", ["--array", "rgb"]),
        ("x.npy", ["--array", "color", "--color-range", "global"]), ("x.npy", ["--array", "depth"]),
        ("x.png", []), ("x.tif", ["--color-range", "global", "--exposure", "3"]),
    ],
)  # fmt: skip
def test_the_file_is_the_same(folder, monkeypatch, capsys, name, flags):
    files, records = [], []
    for limit in (2**28, 0):
        monkeypatch.setattr(render_command, "_IN_MEMORY", limit)
        assert run(CUBE, "-o", name, "--json", *flags) == 0
        files.append((folder / name).read_bytes())
        out, err = capsys.readouterr()
        records.append(json.loads(out) | {"seconds": 0})
        assert err == ""
    assert files[0] == files[1] and records[0] == records[1]
    assert os.listdir(folder) == [name]


def test_a_large_picture_is_not_held_in_memory(folder, all_large, monkeypatch):
    render = render_command.Renderer.render

    def render_mask(renderer, camera=None, **arguments):
        assert renderer.options.size != (24, 16), "a whole picture was drawn"
        return render(renderer, camera, **arguments)

    monkeypatch.setattr(render_command.Renderer, "render", render_mask)
    assert run(CUBE, "-o", "x.tif", "-v") == 0 and run(CUBE, "-o", "x.npy") == 0
    assert Image.open("x.tif").size == (24, 16) and np.load("x.npy").shape == (16, 24, 3)


def test_how_large_a_picture_is_that_is_drawn_into_its_file():
    options = {"outputs": ("rgb",), "size": (8192, 8192)}
    large = render_command.Options(**options)
    assert render_command._row_file("x.tif", large) is not None
    assert render_command._row_file("x.npy", large) is None  # rgb alone: 3 bytes a pixel
    assert render_command._row_file("x.tif", render_command.Options(**options | {"size": (8192, 8000)})) is None
    for name in ("-", "x.png", ".", os.devnull):
        assert render_command._row_file(name, large) is None


def test_what_is_doubtful_is_told(folder, all_large, capsys):
    assert run(CUBE, "-o", "x.tif", "--eye", "5,0,0", "--target", "9,0,0") == 0
    assert "the picture is empty" in capsys.readouterr().err
    assert run(CUBE, "-o", "x.tif", "--light", "ambient:color=0") == 0
    assert "the picture is black" in capsys.readouterr().err


def test_what_is_read_is_not_replaced(folder, all_large, capsys):
    for name in GLOBE:
        shutil.copy(ROOT / "models" / name, folder / name)
    (folder / "globe.mtl").write_text((folder / "globe.mtl").read_text().replace("globe.png", "globe.tif"))
    Image.open(folder / "globe.png").save(folder / "globe.tif")
    os.link(folder / "globe.tif", folder / "hard.tif")
    before = (folder / "globe.tif").read_bytes()
    for name in ("globe.tif", "hard.tif"):
        assert run("globe.obj", "-o", name) == 4 and "which is read; give another name" in one_error(capsys)
    shutil.copy(CUBE, folder / "hard.obj")  # what a later model reads
    assert run("hard.obj", "globe.obj", "-o", "{stem}-drawn.tif") == 0
    (folder / "globe.mtl").write_text((folder / "globe.mtl").read_text().replace("globe.tif", "hard-drawn.tif"))
    shutil.copy(folder / "globe.tif", folder / "hard-drawn.tif")
    assert run("hard.obj", "globe.obj", "-o", "{stem}-drawn.tif") == 1
    assert "can't write hard-drawn.tif: it is" in capsys.readouterr().err
    assert (folder / "globe.tif").read_bytes() == before == (folder / "hard-drawn.tif").read_bytes()
    assert not [name for name in os.listdir(folder) if name.startswith(".")]


def test_pictures_of_an_earlier_run_are_replaced_when_all_models_are_loaded(folder, all_large, monkeypatch):
    for name in GLOBE:
        shutil.copy(ROOT / "models" / name, folder / name)
    shutil.copy(CUBE, folder / "a.obj")
    real, found = render_command.load_scene, []

    def look(model, *rest):
        sizes = {name: Image.open(name).size for name in os.listdir(folder) if name.endswith("-drawn.tif")}
        found.append((model, sizes))
        return real(model, *rest)

    monkeypatch.setattr(render_command, "load_scene", look)
    for size in ("8", "12"):
        assert main(["render", "a.obj", "globe.obj", "-s", size, "-o", "{stem}-drawn.tif"]) == 0
    both = {"a-drawn.tif": (8, 8), "globe-drawn.tif": (8, 8)}
    # The first run's picture of a.obj is new, so nothing waits; the second's replaces one that globe.obj might read.
    assert found[1] == ("globe.obj", {"a-drawn.tif": (8, 8)}) and found[3] == ("globe.obj", both)
    assert {name: Image.open(name).size for name in both} == dict.fromkeys(both, (12, 12))
    assert not [name for name in os.listdir(folder) if name.startswith(".")]


@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="open files of Linux")
def test_files_that_wait_are_not_kept_open(folder, all_large, monkeypatch):
    for name in GLOBE:
        shutil.copy(ROOT / "models" / name, folder / name)
    shutil.copy(CUBE, folder / "a.obj")
    for view in ("top", "left", "front", "back"):
        (folder / f"a-{view}.tif").write_bytes(b"old")
    real, n_open = render_command.load_scene, []

    def look(*arguments):
        n_open.append(len(os.listdir("/proc/self/fd")))
        return real(*arguments)

    monkeypatch.setattr(render_command, "load_scene", look)
    views = [word for view in ("top", "left", "front", "back") for word in ("--view", view)]
    assert run("a.obj", "globe.obj", "-o", "{stem}-{view}.tif", *views) == 0
    assert n_open[1] <= n_open[0], f"{n_open[1] - n_open[0]} files are kept open"
    assert all(
        Image.open(folder / f"{name}-{view}.tif").size == (24, 16) for name in ("a", "globe") for view in views[1::2]
    )


def test_modes_and_protection(folder, all_large, capsys):
    (folder / "x.tif").write_bytes(b"old")
    (folder / "x.tif").chmod(0o400)
    assert run("-q", CUBE, "-o", "x.tif") == 4 and "protected" in one_error(capsys)
    assert (folder / "x.tif").read_bytes() == b"old"
    (folder / "x.tif").chmod(0o600)
    assert run(CUBE, "-o", "x.tif") == 0 and (folder / "x.tif").stat().st_mode & 0o777 == 0o600


def test_a_full_disk_is_one_line(folder, all_large, capsys, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "pwrite", fail)
    assert run(CUBE, "-o", "x.tif") == 4 and "can't write x.tif: No space left" in one_error(capsys)
    assert os.listdir(folder) == []


def test_a_picture_for_which_no_disk_has_room(folder, capsys, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(2**40, 2**39, 2**30))
    assert main(["render", CUBE, "-s", "65536", "-o", "x.tif", "-q"]) == 4
    assert "it takes 17.2 GB, and 1.07 GB are free" in one_error(capsys) and os.listdir(folder) == []
    assert main(["render", CUBE, "-s", "65536", "-o", "x.tif"]) == 4
    assert "drawing 17.2 GB into x.tif, which takes a while" in capsys.readouterr().err


def test_a_picture_for_which_there_is_no_memory_says_what_to_do(capsys, monkeypatch):
    monkeypatch.setattr(memory, "available_memory", lambda: 2**32)
    assert main(["render", CUBE, "-s", "65536", "-o", "x.png"]) == 2
    assert "takes 17.2 GB in memory" in one_error(capsys)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_while_drawing_leaves_nothing(folder, number):
    code = (
        "import sys, time\n"
        "from rasterizer.cli import main, render_command\n"
        "from rasterizer.io.row_files import RowFile\n"
        "render_command._IN_MEMORY = 0\n"
        "real = RowFile.write_rows\n"
        "def write_rows(*rows):\n"
        "    print('now', flush=True); real(*rows); time.sleep(30)\n"
        "RowFile.write_rows = write_rows\n"
        "sys.argv[1:] = ['render', sys.argv[1], '-s', '16', '-o', 'x.tif', '--threads', '1']\n"
        "sys.exit(main())"
    )
    process = start_with(code)
    assert process.stdout.readline() == b"now\n"
    assert len(os.listdir(folder)) == 1
    time.sleep(0.1)
    end_by_signal(process, number)
    assert os.listdir(folder) == []
