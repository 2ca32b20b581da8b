"""`raster batch` and `raster render -j`: models drawn in other processes."""

import json
import os
import re
import signal
import sys
import time

import pytest
from helpers.command import CUBE, GEAR, assert_refused, end_by_signal, errors, picture, raster, start_with
from helpers.processes import is_running, workers_of
from helpers.raster import ROOT

pytestmark = pytest.mark.usefixtures("folder")

CONE = str(ROOT / "models" / "cone.obj")
SIZE = ["-s", "24x16", "--no-ground"]


def batch(*argv) -> int:
    return raster("batch", *SIZE, "-j", "1", *argv)


def summary_of(err) -> str:
    (line,) = [line for line in err.splitlines() if " drawn" in line]
    return re.sub(r" in .*", "", line.removeprefix("raster: "))


def test_the_files_are_those_of_render(capsys):
    look = ["--view", "iso", "--view", "top", "--material", "gold", "--shading", "phong", "-o", "{stem}-{view}.png"]
    assert raster("render", *SIZE, CUBE, CONE, "-q", *look) == 0
    found = {name: open(name, "rb").read() for name in os.listdir()}
    assert set(found) == {"cube-iso.png", "cube-top.png", "cone-iso.png", "cone-top.png"}
    for command, n in (("batch", "1"), ("render", "2")):
        assert raster(command, *SIZE, CUBE, CONE, "-q", *look, "-j", n) == 0
        assert found == {name: open(name, "rb").read() for name in os.listdir()}, command
    assert errors(capsys) == ""


def test_a_process_reads_a_model_once(folder, capsys):
    text = open(CUBE).read()
    (folder / "warned.obj").write_text(f"mtllib missing.mtl\nusemtl x\n{text}")
    views = "front,back,left,right,top,bottom,iso"
    assert raster("batch", *SIZE, "warned.obj", "-j", "2", "--view", views, "-o", "{view}.png") == 0
    err = errors(capsys)  # a warning each time that it is read, of three jobs
    assert summary_of(err) == "7 pictures drawn" and 1 <= err.count("missing.mtl") <= 2


def test_one_bad_model_does_not_stop_the_rest(folder, capsys):
    (folder / "bad.obj").write_text("v 1 2\n")
    assert batch(CUBE, "bad.obj", "nope.stl", GEAR, "--json") == 1
    out, err = capsys.readouterr()
    assert "bad.obj:1" in err and "nope.stl: no such file" in err
    assert summary_of(err) == "2 pictures drawn, 2 failed"
    assert {"cube.png", "gear.png"} <= set(os.listdir())
    *lines, last = map(json.loads, out.splitlines())
    assert "bad.obj:1" in last.pop("first_error")
    assert last | {"seconds": 0} == {"status": "done", "drawn": 2, "skipped": 0, "failed": 2, "seconds": 0}
    assert sorted(line["path"] for line in lines) == sorted([CUBE, "bad.obj", "nope.stl", GEAR])


def test_where_nothing_is_drawn_the_exit_code_says_why(folder, capsys):
    (folder / "cube.png").write_bytes(b"old")
    os.chmod("cube.png", 0o444)
    for model, code in (("nope.stl", 3), (CUBE, 4)):
        assert batch(model) == code
        assert summary_of(errors(capsys)) == "0 pictures drawn, 1 failed"
    assert (folder / "cube.png").read_bytes() == b"old"
    (folder / "skin.png").write_bytes((ROOT / "models" / "globe.png").read_bytes())
    (folder / "b.mtl").write_text("newmtl m\nmap_Kd skin.png\n")
    (folder / "b.obj").write_text("mtllib b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n")
    (folder / "skin.obj").write_bytes(open(CUBE, "rb").read())
    assert batch("skin.obj", "b.obj") == 1
    assert "can't write skin.png: it is" in errors(capsys), "what another model reads stays"
    assert picture("skin.png").shape == picture(ROOT / "models" / "globe.png").shape


def test_folders_are_made_again_and_what_is_there_is_skipped(folder, capsys):
    for path in ("parts/a/model.obj", "parts/ü b/model.obj", "parts/model.obj", "parts/.hidden/model.obj"):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(open(CUBE, "rb").read())
    (folder / "parts" / "notes.txt").write_text("no model")
    parts = ["parts", "--recursive", "-o", "thumbs/"]

    def done(*flags):
        assert batch(*parts, *flags) == 0
        return summary_of(errors(capsys))

    assert done() == "3 pictures drawn"
    found = sorted(str(path.relative_to(folder)) for path in folder.glob("thumbs/**/*.png"))
    assert found == ["thumbs/a/model.png", "thumbs/model.png", "thumbs/ü b/model.png"]
    os.unlink("thumbs/model.png")
    assert done("--resume") == "1 picture drawn, 2 skipped"
    later = time.time() + 10
    os.utime("parts/a/model.obj", (later, later))
    assert done("--skip-existing") == "0 pictures drawn, 3 skipped"
    assert done("--resume") == "1 picture drawn, 2 skipped", "one is older than its model"


def test_what_is_not_legal_is_told_before_a_model_is_loaded(capsys):
    assert_refused(capsys, [
        ([CUBE, "-j", "0"], "1 to 1024 processes"), ([CUBE, "-j", "two"], "1 to 1024 processes"),
        (["-", "--input-format", "obj"], "there is raster render"), ([CUBE, "-o", "-"], "there is raster render"),
        ([CUBE, "--scheduler", "here"], "tcp://"), ([CUBE, "--zoom", "0"], "--zoom"),
    ], "batch")  # fmt: skip
    for command in ("render", "batch"):
        assert_refused(capsys, [
            (["nope.obj", CUBE, "--scale", "1"], "--scale is that of depth in a PNG file"),
            (["nope.obj", CUBE, "--array", "depth", "--scale", "-1", "-o", "{stem}.png"], "--scale must be a number"),
            (["nope.obj", CUBE, "--samples", "3"], "argument --samples"),
            (["nope.obj", CUBE, "--exposure", "1e9"], "exposure"),
        ], command)  # fmt: skip


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform == "win32", reason="processes are those that ps shows")
@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.nightly)])
def test_an_interrupt_ends_all_processes_and_leaves_whole_files(number, folder, alone):
    for k in range(400):
        os.symlink(ROOT / "models" / "teapot.obj", folder / f"pot{k}.obj")
    argv = ["batch", str(folder / "*.obj"), "-o", "out/", "-j", "2", "-s", "128x96", "--no-ground"]
    process = start_with(f"import sys; from rasterizer.cli import main; sys.argv[1:] = {argv!r}; sys.exit(main())")
    deadline = time.monotonic() + 20
    while not list(folder.glob("out/*.png")) and time.monotonic() < deadline:
        time.sleep(0.02)
    below = workers_of(process.pid)
    assert len(below) == 2
    if number == signal.SIGTERM:
        process.terminate()
        process.communicate(timeout=20)
    else:
        end_by_signal(process, number)
    deadline = time.monotonic() + 20  # a process ends with its input, when it is done with what it is at
    while any(map(is_running, below)) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not list(filter(is_running, below))
    names = os.listdir("out")
    assert names and not [name for name in names if name.startswith(".")]
    assert [name for name in names if picture(f"out/{name}").shape != (96, 128, 4)] == []
