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
from helpers.command import CUBE, end_by_signal, one_error, run, start, start_with
from helpers.raster import HAS_TOML, ROOT
from PIL import Image

from rasterizer.cli import main

GLOBE = ("globe.obj", "globe.mtl", "globe.png")
pytestmark = pytest.mark.usefixtures("folder")


@pytest.fixture
def globe(folder):
    """A textured model, whose default picture would be named like its texture."""
    for name in GLOBE:
        shutil.copy(ROOT / "models" / name, folder / name)
    return folder


# --- what is read is not replaced ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "argv",
    [
        [], ["-o", "globe.png"], ["-o", "./globe.png"], ["-o", "{stem}.png"], ["-o", "."], ["--json"],
        ["-o", "soft.png"],
        ["-o", "hard.png"], ["--view", "iso", "-o", "globe.png"], ["-o", "again/globe.png"],
    ],
)  # fmt: skip
@pytest.mark.parametrize("command", ["render", "compare"])
def test_a_texture_is_not_replaced_by_any_name_or_link(globe, command, argv, capsys):
    (globe / "soft.png").symlink_to("globe.png")
    os.link(globe / "globe.png", globe / "hard.png")
    (globe / "again").symlink_to(".")
    before = (globe / "globe.png").read_bytes()
    is_named = command == "compare" and argv in ([], ["-o", "."], ["--json"])  # globe-compare.png
    code = main(
        [command, "globe.obj", "-s", "16", "--threads", "1", *argv, *["--no-reference"] * (command == "compare")]
    )
    assert code == (0 if is_named else 4)
    assert is_named or "which is read; give another name with -o" in capsys.readouterr().err
    assert (globe / "globe.png").read_bytes() == before


def test_models_libraries_arrays_scenes_and_buffers_are_not_replaced(folder, capsys):
    shutil.copy(CUBE, folder / "cube.png")  # a model by any name
    assert run("-q", "cube.png", "--input-format", "obj") == 4 and "it is cube.png, which is read" in one_error(capsys)
    shutil.copy(CUBE, folder / "part.png")
    (folder / "scene.json").write_text(json.dumps({"meshes": [{"file": "part.obj"}]}))
    (folder / "part.obj").symlink_to("part.png")
    assert run("-q", "scene.json", "-o", "part.png") == 4 and "which is read" in one_error(capsys)
    assert (folder / "part.png").read_bytes() == open(CUBE, "rb").read()
    Image.new("RGB", (2, 2)).save(folder / "t.png")
    shutil.copy(ROOT / "models" / "globe.obj", folder / "g.obj")
    assert run(
        "-q", "g.obj", "--material", "texture=t.png", "-o", "t.png"
    ) == 4 and "it is t.png, which is read" in one_error(capsys)


def test_what_a_later_model_reads_is_not_replaced_by_an_earlier_one(globe, capsys):
    shutil.copy(CUBE, globe / "a.obj")
    shutil.copy(globe / "globe.png", globe / "a.png")
    (globe / "globe.mtl").write_text((globe / "globe.mtl").read_text().replace("globe.png", "a.png"))
    texture = (globe / "a.png").read_bytes()
    assert run("a.obj", "globe.obj", "-o", "{stem}.png") == 1
    err = capsys.readouterr().err
    assert "can't write a.png: it is" in err and "globe.png" not in err
    assert (globe / "a.png").read_bytes() == texture and Image.open(globe / "globe.png").size == (24, 16)


def test_pictures_of_an_earlier_run_are_replaced(globe):
    shutil.copy(CUBE, globe / "a.obj")
    for size in ("8", "12"):
        assert main(["render", "a.obj", "globe.obj", "-s", size, "-o", "{stem}-drawn.png"]) == 0
        for name in ("a-drawn.png", "globe-drawn.png"):
            assert Image.open(globe / name).size == (int(size), int(size))


def test_an_interrupt_leaves_no_picture_of_a_model_unwritten(globe, monkeypatch):
    from rasterizer.cli import render_command

    shutil.copy(CUBE, globe / "a.obj")
    assert run("a.obj", "-o", "a-drawn.png") == 0
    real = render_command.load_scene

    def stop(model, *rest):
        if model == "globe.obj":
            raise KeyboardInterrupt
        return real(model, *rest)

    monkeypatch.setattr(render_command, "load_scene", stop)
    assert main(["render", "a.obj", "globe.obj", "-s", "9", "-o", "{stem}-drawn.png"]) == 130
    assert Image.open(globe / "a-drawn.png").size == (9, 9)


def test_outputs_of_one_place_are_refused(folder, capsys):
    shutil.copy(CUBE, folder / "a.obj")
    shutil.copy(CUBE, folder / "b.obj")
    (folder / "a.png").write_bytes(b"")
    os.link(folder / "a.png", folder / "b.png")
    assert run("a.obj", "b.obj") == 2 and "would both be written" in one_error(capsys)


# --- modes, and what is left over ---------------------------------------------------------------------------


def test_protected_outputs_are_refused_and_modes_kept(folder, capsys):
    for name, mode in (("protected.png", 0o400), ("private.png", 0o600)):
        (folder / name).write_bytes(b"old")
        (folder / name).chmod(mode)
    assert run("-q", CUBE, "-o", "protected.png") == 4 and "protected" in one_error(capsys)
    assert (folder / "protected.png").read_bytes() == b"old"
    assert run(CUBE, "-o", "private.png") == 0
    assert (folder / "private.png").stat().st_mode & 0o777 == 0o600 and Image.open("private.png").size == (24, 16)
    before = os.umask(0o077)
    try:
        assert run(CUBE, "-o", "new.png") == 0
    finally:
        os.umask(before)
    assert (folder / "new.png").stat().st_mode & 0o777 == 0o600


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_while_writing_leaves_nothing(folder, number):
    code = (
        "import os, sys, time\n"
        "from rasterizer.cli import main\n"
        "real = os.replace\n"
        "def replace(*places):\n"
        "    print('now', flush=True); time.sleep(30); real(*places)\n"
        "os.replace = replace\n"
        "sys.argv[1:] = ['render', sys.argv[1], '-s', '16', '-o', 'x.png']\n"
        "sys.exit(main())"
    )
    process = start_with(code)
    assert process.stdout.readline() == b"now\n"
    end_by_signal(process, number)
    assert not os.listdir(folder)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_an_interrupt_at_any_time_shows_no_traceback(folder):
    """From the moment on at which the package is reached; before that, the process is Python's."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    for delay in (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4):
        code = "import sys, rasterizer.cli as c; print('now', flush=True); sys.exit(c.main())"
        command = [sys.executable, "-c", code, "render", CUBE, "-s", "2000", "-o", "x.png"]
        process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        process.stdout.readline()
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
        assert b"Traceback" not in err and process.returncode in (0, 130), (delay, err.decode())
        if process.returncode == 130:
            assert err.endswith(b"raster: error: interrupted\n")


# --- templates, --json, strange words -----------------------------------------------------------------------


@pytest.mark.parametrize(
    "template",
    ["{stem:>99999999999}.png", "{stem:{view}}.png", "{stem!r}.png", "{0}.png", "{}.png", "{stem.a}.png", "{stem[0]}.png",  # noqa: E501
                 "{frame:03}.png", "}.png", "{stem:_>9999}.png", "{stem:e}.png"]
)  # fmt: skip
def test_templates_that_are_refused(template, capsys):
    assert run(CUBE, "-o", template) == 2 and "-o may hold {stem}, {ext}, {view}" in one_error(capsys)


def test_a_name_is_padded_up_to_what_file_systems_take(folder, capsys):
    assert run(CUBE, "-o", "{stem:_>9}{{}}.png") == 0 and os.listdir(folder) == ["_____cube{}.png"]
    assert run(CUBE, "-o", "{stem:>255}.png") == 4 and "too long" in one_error(capsys)
    assert run(CUBE, "-o", "{stem:>300}.png") == 0


@pytest.mark.parametrize("argv", [["-o=--"], ["-o--"], ["--output=--"], ["--size=--"], ["-s=--"], ["--light=--"]])
@pytest.mark.parametrize("command", ["render", "compare"])
def test_two_dashes_are_no_value(command, argv, capsys):
    assert main([command, CUBE, *argv]) == 2 and "can't have the value --" in one_error(capsys)


def test_compare_refuses_a_size_of_nothing(capsys):
    assert main(["compare", CUBE, "-s", "0"]) == 2 and "size must be (width, height)" in one_error(capsys)


@pytest.mark.parametrize("command", ["render", "compare"])
def test_json_is_json_also_where_a_number_is_not_finite(command, capsys, monkeypatch):
    argv = ["--no-reference"] if command == "compare" else []
    assert main([command, CUBE, "-s", "16", "--light", "point:1,2,3,amplify=yes", "--json", *argv]) == 0
    from rasterizer.cli.messages import print_record

    print_record({"a": float("inf"), "b": [1.0, float("nan")], "c": {"d": float("-inf")}, "e": 1}, False)

    def refuse(word):
        raise AssertionError(word)

    lines = capsys.readouterr().out.splitlines()
    assert all(json.loads(line, parse_constant=refuse) for line in lines)
    record = json.loads(lines[-1])
    assert (
        record["a"] is None
        and record["a_reason"]
        and record["b"] == [1.0, None]
        and record["c"]["d"] is None
        and record["e"] == 1
    )


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"options": {"outputs": 5}}, "outputs"),
        ({"options": {"size": "big"}}, "size"),
        ({"options": {"tolerance": 10**400}}, "tolerance"),
        ({"options": {"exposure": 10**400}}, "exposure"),
        ({"camera": {"position": [0, 0, 5], "fov": 5e-324}}, "fov"),
        ({"lights": [{"kind": "directional", "direction": [10**400, 0, 0]}]}, "direction"),
        ({"materials": {"a": {"texture": {"file": "x.png", "filter": []}}}}, "filter"),
        ({"materials": {"a": {"texture": {"file": "x.png", "wrap": [{}, []]}}}}, "wrap"),
        ({"meshes": [{"vertices": [[0, 0, 0]], "faces": None}]}, "faces"),
        ({"meshes": [{"file": "x" * 300}]}, "can't be read"),
        ({"meshes": [{"file": "a\0b"}]}, "name of a file"),
        ({"meshes": [{"arrays": "x" * 300, "mesh": 0}]}, "can't be read"),
    ],
    ids=range(12),
)
def test_scene_files_that_were_tracebacks(folder, table, words, capsys):
    mesh = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}
    (folder / "scene.json").write_text(json.dumps({"meshes": [mesh]} | table))
    assert run("-q", "scene.json", "-o", "x.npy") in (2, 3)
    err = one_error(capsys)
    assert "scene.json" in err and words in err and "internal" not in err


@pytest.mark.skipif(not HAS_TOML, reason="no parser of TOML")
def test_names_of_files_as_long_as_no_system_takes_them(folder, capsys):
    assert run("x" * 300 + ".obj") == 3 and "too long" in one_error(capsys).lower()
    assert run("x" * 300 + ".toml") == 3 and "too long" in one_error(capsys).lower()
    assert run(CUBE, "-o", "x" * 300 + ".png") == 4 and "too long" in one_error(capsys).lower()


def test_libraries_say_nothing_on_stderr(folder):
    """In a process of its own: what C libraries write is seen, too."""
    (folder / "m.obj").write_bytes(
        b"mtllib m.mtl\nv 0 0 0\nv 1e99 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nf 1 2 3\n"
    )
    (folder / "m.mtl").write_text("newmtl a\nmap_Kd t.tif\n")
    Image.new("RGB", (4, 4)).save(folder / "t.tif", compression="tiff_lzw")
    data = bytearray((folder / "t.tif").read_bytes())
    data[-20:] = b"\xff" * 20
    (folder / "t.tif").write_bytes(data)
    done = start("render", "m.obj", "-s", "16")
    assert all(line.startswith(b"raster: ") for line in done.stderr.splitlines()), done.stderr.decode()
