"""Tests of what the command line writes, and where not: no file that is read is replaced, modes are kept, nothing is
left over."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time

import pytest
from helpers.command import CUBE, assert_refused, end_by_signal, one_error, raster, run, start_with
from helpers.odd_format import odd_format
from helpers.raster import ROOT
from PIL import Image

GLOBE = ("globe.obj", "globe.mtl", "globe.png")
pytestmark = pytest.mark.usefixtures("folder")


@pytest.fixture
def globe(folder):
    """A textured model, whose default picture would be named like its texture."""
    for name in GLOBE:
        shutil.copy(ROOT / "models" / name, folder / name)
    return folder


# --- what is read is not replaced ---------------------------------------------------------------------------


def test_a_texture_is_not_replaced_by_any_name_or_link(globe, capsys):
    (globe / "soft.png").symlink_to("globe.png")
    os.link(globe / "globe.png", globe / "hard.png")
    (globe / "again").symlink_to(".")
    before = (globe / "globe.png").read_bytes()
    outputs = ("globe.png", "./globe.png", "{stem}.png", ".", "soft.png", "hard.png", "again/globe.png")
    cases = [["globe.obj", "-s", "8", "--no-ground", "-o", output] for output in outputs]
    for argv in (*cases, cases[0][:-2], [*cases[0], "--view", "iso"]):
        assert_refused(capsys, [(argv, "which is read; give another name with -o")], "render", code=4)
    argv = ["globe.obj", "-s", "8", "-o", "hard.png", "--no-reference", "--methods", "flat,phong"]
    assert_refused(capsys, [(argv, "which is read; give another name with -o")], "compare", code=4)
    assert raster("render", *cases[0][:-2], "--json") == 4 and (globe / "globe.png").read_bytes() == before


def test_models_scenes_and_textures_of_flags_are_not_replaced(folder, capsys):
    shutil.copy(CUBE, folder / "cube.png")  # a model by any name
    shutil.copy(CUBE, folder / "part.png")
    (folder / "scene.json").write_text(json.dumps({"meshes": [{"file": "part.obj"}]}))
    (folder / "part.obj").symlink_to("part.png")
    Image.new("RGB", (2, 2)).save(folder / "t.png")
    shutil.copy(ROOT / "models" / "globe.obj", folder / "g.obj")
    assert_refused(capsys, [
        (["-q", "cube.png", "--input-format", "obj"], "it is cube.png, which is read"),
        (["-q", "scene.json", "-o", "part.png"], "which is read"),
        (["-q", "g.obj", "--material", "texture=t.png", "-o", "t.png"], "it is t.png, which is read"),
    ], "render", code=4)  # fmt: skip
    assert (folder / "part.png").read_bytes() == open(CUBE, "rb").read()


def test_what_a_later_model_reads_is_not_replaced_by_an_earlier_one(folder, capsys):
    """Each model may read what lies in its own folder."""
    one, two = folder / "one", folder / "two"
    one.mkdir()
    two.mkdir()
    shutil.copy(CUBE, one / "a.obj")
    for name in GLOBE:
        shutil.copy(ROOT / "models" / name, two / ("a.png" if name == "globe.png" else name))
    (two / "globe.mtl").write_text((two / "globe.mtl").read_text().replace("globe.png", "a.png"))
    texture = (two / "a.png").read_bytes()
    assert run("one/a.obj", "two/globe.obj", "-o", "two/{stem}.png") == 1
    err = capsys.readouterr().err
    assert "can't write two/a.png: it is" in err and "globe.png" not in err
    assert (two / "a.png").read_bytes() == texture and Image.open(two / "globe.png").size == (24, 16)


def test_pictures_of_an_earlier_run_are_replaced_also_where_this_one_is_interrupted(globe):
    shutil.copy(CUBE, globe / "a.obj")
    for size in ("8", "12"):
        assert raster("render", "a.obj", "globe.obj", "--no-ground", "-s", size, "-o", "{stem}-drawn.png") == 0
        sizes = {name: Image.open(globe / name).size for name in ("a-drawn.png", "globe-drawn.png")}
        assert set(sizes.values()) == {(int(size), int(size))}, sizes
    shutil.copy(CUBE, globe / "b.odd")
    with odd_format(KeyboardInterrupt()):
        assert raster("render", "a.obj", "b.odd", "--no-ground", "-s", "9", "-o", "{stem}-drawn.png") == 130
    assert Image.open(globe / "a-drawn.png").size == (9, 9), "what had been drawn is written"


# --- modes, and what is left over ---------------------------------------------------------------------------


def test_protected_outputs_are_refused_and_modes_kept(folder, capsys):
    for name, mode in (("protected.png", 0o400), ("private.png", 0o600)):
        (folder / name).write_bytes(b"old")
        (folder / name).chmod(mode)
    assert_refused(capsys, [(["-q", CUBE, "-o", "protected.png"], "protected")], "render", code=4)
    assert (folder / "protected.png").read_bytes() == b"old"
    assert run(CUBE, "-o", "private.png") == 0
    assert (folder / "private.png").stat().st_mode & 0o777 == 0o600 and Image.open("private.png").size == (24, 16)
    before = os.umask(0o077)
    try:
        assert run(CUBE, "-o", "new.png") == 0
    finally:
        os.umask(before)
    assert (folder / "new.png").stat().st_mode & 0o777 == 0o600


def test_a_full_disk_or_an_interrupt_leaves_no_half_file(folder, capsys, monkeypatch):
    """The system's `os.replace`, by which a whole file comes to its place, fails or doesn't return."""
    for fault, code, words in (
        (OSError(28, "No space left on device"), 4, "can't write x.png: No space left on device"),
        (KeyboardInterrupt(), 130, "raster: error: interrupted\n"),
        (MemoryError("Unable to allocate 9 TiB"), 2, f"not enough memory for {CUBE} at (24, 16): Unable to allocate 9"),
    ):

        def fail(*_, fault=fault):
            raise fault

        monkeypatch.setattr(os, "replace", fail)
        assert run(CUBE, "-o", "x.png") == code
        assert words in one_error(capsys) and not os.listdir(folder), fault


SIGNALS = [signal.SIGTERM, pytest.param(signal.SIGINT, marks=pytest.mark.nightly)]


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_while_writing_leaves_nothing(folder, number, alone):
    code = (
        "import os, sys, time\n"
        "from rasterizer.cli import main\n"
        "real = os.replace\n"
        "def replace(*places):\n"
        "    print('now', flush=True); time.sleep(30); real(*places)\n"
        "os.replace = replace\n"
        "sys.argv[1:] = ['render', sys.argv[1], '-s', '16', '-o', 'x.png', '--preset', 'studio']\n"
        "sys.exit(main())"
    )
    process = start_with(code)
    assert process.stdout.readline() == b"now\n"
    end_by_signal(process, number)
    assert not os.listdir(folder)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize(
    "delays", [(0.0, 0.15), pytest.param((0.01, 0.02, 0.05, 0.1, 0.2, 0.4), marks=pytest.mark.nightly)]
)
def test_an_interrupt_at_any_time_shows_no_traceback(folder, delays, alone):
    """From the moment on at which the package is reached; before that, the process is Python's."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    for delay in delays:
        code = "import sys, rasterizer.cli as c; print('now', flush=True); sys.exit(c.main())"
        command = [sys.executable, "-c", code, "render", CUBE, "-s", "2000", "-o", "x.png"]
        process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        process.stdout.readline()
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
        if err.startswith(b"Traceback") and b"cli" not in err:
            continue  # it came before `main` was entered
        assert b"Traceback" not in err and process.returncode in (0, 130), (delay, err.decode())
        if process.returncode == 130:
            assert err.endswith(b"raster: error: interrupted\n")


def test_names_of_files_as_long_as_no_system_takes_them(folder, capsys):
    long = "x" * 300
    for argv, code in (([f"{long}.obj"], 3), ([f"{long}.toml"], 3), ([CUBE, "-o", f"{long}.png"], 4)):
        assert run(*argv) == code and "too long" in one_error(capsys).lower(), argv[-1][-5:]


def test_libraries_say_nothing_on_stderr(folder, capfd):
    """Neither do those in C."""
    (folder / "m.obj").write_bytes(
        b"mtllib m.mtl\nv 0 0 0\nv 1e99 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nf 1 2 3\n"
    )
    (folder / "m.mtl").write_text("newmtl a\nmap_Kd t.tif\n")
    Image.new("RGB", (4, 4)).save(folder / "t.tif", compression="tiff_lzw")
    data = bytearray((folder / "t.tif").read_bytes())
    data[-20:] = b"\xff" * 20
    (folder / "t.tif").write_bytes(data)
    run("m.obj")
    err = capfd.readouterr().err
    assert err and all(line.startswith("raster: ") for line in err.splitlines()), err
