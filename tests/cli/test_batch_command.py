"""`raster batch` and `raster render -j`: models drawn in other processes."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import pytest
from helpers.command import CUBE, GEAR, end_by_signal, errors, one_error, picture
from helpers.raster import ROOT

from rasterizer.cli import main

pytestmark = pytest.mark.usefixtures("folder")

CONE = str(ROOT / "models" / "cone.obj")
SIZE = ["-s", "24x16"]


def batch(*argv) -> int:
    return main(["batch", *SIZE, "-j", "1", *map(str, argv)])


def summary_of(err) -> str:
    (line,) = [line for line in err.splitlines() if " drawn" in line]
    return re.sub(r" in .*", "", line.removeprefix("raster: "))


def test_the_files_are_those_of_render(capsys):
    look = ["--view", "iso", "--view", "top", "--material", "gold", "--shading", "phong", "-o", "{stem}-{view}.png"]
    assert batch(CUBE, CONE, "-q", *look) == 0
    found = {name: open(name, "rb").read() for name in os.listdir()}
    assert set(found) == {"cube-iso.png", "cube-top.png", "cone-iso.png", "cone-top.png"}
    assert main(["render", *SIZE, CUBE, CONE, "-q", *look]) == 0
    assert found == {name: open(name, "rb").read() for name in os.listdir()}
    assert main(["render", *SIZE, CUBE, CONE, "-j", "2", *look]) == 0
    assert found == {name: open(name, "rb").read() for name in os.listdir()}
    assert errors(capsys) == ""


def test_one_bad_model_does_not_stop_the_rest(folder, capsys):
    (folder / "bad.obj").write_text("v 1 2\n")
    assert batch(CUBE, "bad.obj", "nope.stl", GEAR) == 1
    err = errors(capsys)
    assert "bad.obj:1" in err and "nope.stl: no such file" in err
    assert summary_of(err) == "2 pictures drawn, 2 failed"
    assert {"cube.png", "gear.png"} <= set(os.listdir())


@pytest.mark.parametrize(("models", "code"), [(["nope.stl"], 3), ([CUBE], 4)])
def test_where_nothing_is_drawn_the_exit_code_says_why(models, code, folder, capsys):
    (folder / "cube.png").write_bytes(b"old")
    os.chmod("cube.png", 0o444)
    assert batch(*models) == code
    assert summary_of(errors(capsys)) == "0 pictures drawn, 1 failed"
    assert (folder / "cube.png").read_bytes() == b"old"


def test_the_folders_of_models_are_made_again(folder, capsys):
    for path in ("parts/a/model.obj", "parts/ü b/model.obj", "parts/model.obj", "parts/.hidden/model.obj"):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(open(CUBE, "rb").read())
    (folder / "parts" / "notes.txt").write_text("no model")
    assert batch("parts", "--recursive", "-o", "thumbs/") == 0
    found = sorted(str(path.relative_to(folder)) for path in folder.glob("thumbs/**/*.png"))
    assert found == ["thumbs/a/model.png", "thumbs/model.png", "thumbs/ü b/model.png"]
    assert summary_of(errors(capsys)) == "3 pictures drawn"


@pytest.mark.parametrize("flag", ["--skip-existing", "--resume"])
def test_what_is_there_is_skipped(flag, folder, capsys):
    (folder / "own.obj").write_bytes(open(CUBE, "rb").read())
    assert batch("own.obj", CONE) == 0
    os.unlink("cone.png")
    errors(capsys)
    assert batch("own.obj", CONE, flag) == 0
    assert summary_of(errors(capsys)) == "1 picture drawn, 1 skipped"
    later = time.time() + 10
    os.utime("own.obj", (later, later))
    assert batch("own.obj", CONE, flag) == 0
    expected = "1 picture drawn, 1 skipped" if flag == "--resume" else "0 pictures drawn, 2 skipped"
    assert summary_of(errors(capsys)) == expected


def test_json_has_a_line_for_each_picture_and_one_for_all(folder, capsys):
    assert batch(CUBE, "nope.obj", "--json", "-q") == 1
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert lines[-1] | {"seconds": 0} == {"drawn": 1, "skipped": 0, "failed": 1, "seconds": 0}
    assert sorted(line["path"] for line in lines[:-1]) == sorted([CUBE, "nope.obj"])


def test_no_picture_is_written_over_what_another_model_reads(folder, capsys):
    (folder / "skin.png").write_bytes((ROOT / "models" / "globe.png").read_bytes())
    (folder / "b.mtl").write_text("newmtl m\nmap_Kd skin.png\n")
    (folder / "b.obj").write_text("mtllib b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n")
    (folder / "skin.obj").write_bytes(open(CUBE, "rb").read())
    assert batch("skin.obj", "b.obj") == 1
    assert "can't write skin.png: it is" in errors(capsys)
    assert picture("skin.png").shape == picture(ROOT / "models" / "globe.png").shape


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        ([CUBE, "-j", "0"], "1 to 1024 processes"),
        ([CUBE, "-j", "two"], "1 to 1024 processes"),
        (["-", "--input-format", "obj"], "there is raster render"),
        ([CUBE, "-o", "-"], "there is raster render"),
        ([CUBE, "--scheduler", "here"], "tcp://"),
        ([CUBE, "--zoom", "0"], "--zoom"),
    ],
)
def test_arguments_that_are_not_legal(argv, words, capsys):
    assert main(["batch", *argv]) == 2
    assert words in one_error(capsys)


def test_a_large_picture_is_written_where_it_is_drawn(folder, capsys, monkeypatch):
    """A file of 268 MB would be sent; this one has a row more."""
    assert main(["batch", CUBE, "-j", "1", "-s", "8192x8193", "-o", "cube.tif", "--samples", "1", "-q"]) == 0
    assert (folder / "cube.tif").stat().st_size > 2**28
    os.unlink("cube.tif")


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_ends_all_processes_and_leaves_whole_files(number, folder):
    code = f"import sys; from rasterizer.cli import main; sys.argv[1:] = {argv_of_many(folder)!r}; sys.exit(main())"
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    deadline = time.monotonic() + 20
    while not list(folder.glob("out/*.png")) and time.monotonic() < deadline:
        time.sleep(0.02)
    below = children_of(process.pid)
    assert len(below) == 2
    if number == signal.SIGTERM:
        process.terminate()
        process.communicate(timeout=20)
    else:
        end_by_signal(process, number)
    deadline = time.monotonic() + 20  # a process ends with its input, when it is done with what it is at
    while any(os.path.exists(f"/proc/{pid}") for pid in below) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not [pid for pid in below if os.path.exists(f"/proc/{pid}")]
    names = os.listdir("out")
    assert names and not [name for name in names if name.startswith(".")]
    assert all(picture(f"out/{name}").shape == (96, 128, 4) for name in names)


def argv_of_many(folder) -> list[str]:
    """A batch that takes a minute."""
    for k in range(400):
        os.symlink(ROOT / "models" / "teapot.obj", folder / f"pot{k}.obj")
    return ["batch", str(folder / "*.obj"), "-o", "out/", "-j", "2", "-s", "128x96", "--shading", "phong"]


def children_of(pid) -> list[int]:
    """The processes that a process has started."""
    with open(f"/proc/{pid}/task/{pid}/children") as stream:
        return [int(text) for text in stream.read().split()]


@pytest.mark.parametrize("command", ["render", "batch"])
def test_what_is_wrong_for_every_model_is_told_before_one_is_loaded(command, folder, capsys):
    for argv, words in (
        (["--scale", "1"], "--scale is that of depth in a PNG file"),
        (["--array", "depth", "--scale", "-1", "-o", "{stem}.png"], "--scale must be a number above 0"),
        (["--samples", "3"], "argument --samples"),
        (["--exposure", "1e9"], "exposure"),
    ):
        assert main([command, "nope.obj", CUBE, *argv]) == 2
        assert words in one_error(capsys) and not os.listdir(folder)
