"""The program as a whole: help, what is mistyped, the process itself with its streams, its own model and kernels."""

import gc
import os
import re
import shlex
import shutil
import subprocess
import sys

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.command import CUBE, SMALL, assert_refused, errors, one_error, picture, raster, start
from helpers.raster import ROOT
from PIL import Image

import rasterizer as rz
from rasterizer.cli import compare
from rasterizer.cli.parser import COMMANDS, make_command_parser, parse
from rasterizer.compiler import store

pytestmark = pytest.mark.usefixtures("folder")


def help_of(capsys, *argv) -> str:
    with pytest.raises(SystemExit) as stop:
        raster(*argv)
    out, err = capsys.readouterr()
    assert stop.value.code == 0 and err == "", argv
    return out


def test_every_command_has_a_help_whose_examples_parse(capsys):
    assert help_of(capsys, "--version") == f"raster {rz.__version__}\n"
    n_example = {}
    for command in COMMANDS:
        out = help_of(capsys, command, "--help")
        assert out.startswith(f"usage: raster {command}") and out == help_of(capsys, "help", command)
        examples = re.findall(rf"^  raster ({command} .*?)(?:   .*| > .*)?$", out, re.MULTILINE)
        examples = [example for example in examples if "MODEL..." not in example]
        n_example[command] = len(examples)
        for example in examples:
            parse(shlex.split(example))
        if command not in ("compare", "bench", "view"):
            assert "examples:" in out, command
    assert n_example["render"] >= 7
    out = help_of(capsys, "compare", "--help")
    assert "x".join(map(str, compare.SIZE)) in out and "MODEL-compare.png" in out and "--no-reference" in out


@pytest.mark.parametrize("columns", [80, 100])
def test_every_help_has_all_flags_and_fits_the_columns(columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    for command in COMMANDS:
        text = help_of(capsys, command, "--help")
        named = {name for action in make_command_parser(command)._actions for name in action.option_strings}  # noqa: SLF001
        assert not [flag for flag in named if flag not in text], command
        longest = max(map(len, text.splitlines()))
        assert longest <= columns, f"{command}: {longest} columns"


# --- what is said to somebody who mistypes, or leaves out the command ------------------------------------------------


def test_the_word_that_is_meant_is_named(capsys):
    """A flag by its nearest or by a word of other programs; of other words all that are legal are listed."""
    meant = {
        "render x.obj --exposur 1": "did you mean --exposure?",
        "render x.obj --bg=white": "did you mean --background?",
        "render x.obj --resolution 80": "did you mean --size?",
        "x.obj --versoin": "raster render --help",
        "rendr x.obj": "render",
        "render x.obj --shading gourad": "gouraud",
        "render x.obj --view Top": "top",
        "render x.obj --reflection blin": "blinn",
        "bench x.obj --shadings flat,fong": "phong",
        f"render {CUBE} --material shine=9": "shininess",
        f"render {CUBE} --light pont:1,2,3": "point",
        f"render {CUBE} --light spot:1,2,3,fall=2": "falloff",
    }
    assert_refused(capsys, [(argv.split(), word) for argv, word in meant.items()])
    assert_refused(capsys, [(["qwertz"], "there is no command and no file 'qwertz' (commands are render, ")])
    assert raster("render", "x.obj", "--qwertz") == 2 and "did you mean" not in one_error(capsys)


def test_models_without_a_command_are_drawn(capsys):
    for argv in ([CUBE, *SMALL], [*SMALL, CUBE], [*SMALL, "--", CUBE]):
        assert raster(*argv) == 0 and Image.open("cube.png").size == (24, 16), argv
        os.unlink("cube.png")
    assert_refused(capsys, [(["nope.stl"], "raster: error: nope.stl: no such file\n")], code=3)
    assert_refused(capsys, [(["draw"], "raster --help"), (["--foo"], "raster render --help"),
                            (["-q"], "raster render --help")])  # fmt: skip


def test_help_is_printed_for_the_program_and_for_a_command(capsys):
    for argv, begin in (([], "usage: raster "), (["help"], "usage: raster "), (["help", "info"], "usage: raster info")):
        out = help_of(capsys, *argv)
        assert out.startswith(begin) and (argv[1:] or ("commands:" in out and "warmup" in out)), argv


# --- the process ----------------------------------------------------------------------------------------------------


def test_who_calls_main_keeps_the_collector_of_garbage_as_it_is_set():
    try:
        for is_enabled in (False, True):
            (gc.enable if is_enabled else gc.disable)()
            assert raster("info", CUBE) == 0 and gc.isenabled() == is_enabled
    finally:
        gc.enable()


def test_the_program_itself(folder):
    done = start("render", CUBE, "nope.obj", *SMALL, "-o", "{stem}.png", cwd=folder)
    assert done.returncode == 1 and done.stderr == b"raster: error: nope.obj: no such file\n"
    assert os.listdir(folder) == ["cube.png"]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_a_full_disk_behind_stdout_or_a_reader_that_has_gone(folder):
    """The first is an error; who has read enough knows it."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": ""}
    reader, writer = os.pipe()
    os.close(reader)
    full = os.open("/dev/full", os.O_WRONLY)
    for stdout, err in ((full, b"raster: error: can't write to stdout: No space left on device\n"), (writer, b"")):
        for argv in (["--help"], ["completion", "bash"]):
            command = [sys.executable, "-m", "rasterizer", *argv]
            done = subprocess.run(command, stdout=stdout, stderr=subprocess.PIPE, env=environment, cwd=folder)
            assert (got := (done.returncode, done.stderr)) == (4, err), f"{argv}: {got} != {(4, err)}"
        os.close(stdout)


def test_what_stands_behind_two_dashes_is_a_name(folder, capsys):
    for name in ("--allow-outside", "-q", "part.obj"):
        shutil.copy(CUBE, folder / name)
    assert raster("render", "-s", "8", "--input-format", "obj", "--", "--allow-outside", "-q", "part.obj") == 0
    assert {"--allow-outside.png", "-q.png", "part.png"} < set(os.listdir(folder))
    assert raster("--", "part.obj") == 0
    assert raster("render", "-s", "8", "--", "part.obj", "--no-such-file") == 1
    assert "--no-such-file" in capsys.readouterr().err


def test_no_name_of_a_file_reaches_the_terminal_raw(folder, capfd):
    """Names of materials, meshes, textures and of the file itself, in what is said, listed and warned of."""
    wild = "".join(map(chr, (27, 91, 51, 49, 109, 7, 8, 127, 155)))
    (folder / f"{wild}.mtl").write_text(f"newmtl {wild}\nmap_Kd {wild}.png\n")
    model = (
        f"mtllib no{wild}.mtl {wild}.mtl\no {wild}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl {wild}\nf 1/1 2/1 3/1\n"
    )
    (folder / f"a{wild}.obj").write_text(model)
    lines = [["render", "-s", "8", "-v"], ["info"], ["info", "--json"], ["render", "--json", "-s", "8"]]
    lines += [["render", "-s", "8", "--scalars", wild], ["batch", "-s", "8", "-j", "1", "--skip-existing", "-v"]]
    for line in lines:
        raster(*line, f"a{wild}.obj")
        raster(line[0], f"no{wild}.obj")
        text = "".join(capfd.readouterr())
        assert not [
            letter for letter in text if (ord(letter) < 32 or 127 <= ord(letter) < 160) and letter not in "\n\t"
        ]


# --- `raster demo` and `raster warmup` ------------------------------------------------------------------------------


def test_the_model_of_the_package_is_drawn_in_the_current_folder(folder, capsys):
    assert raster("demo", "-s", "64x40", "--threads", "1", "--preset", "studio") == 0
    assert os.listdir(folder) == ["demo.png"]
    expected = rz.render(rz.load(rz.demo_model()), (64, 40), shading="phong", samples=4).rgba
    assert not differences(picture("demo.png"), expected)
    capsys.readouterr()
    assert raster("demo", "-s", "24x16", "-o", "x.jpg", "--shading", "flat", "--view", "top", "-v", "--no-ground") == 0
    out, err = capsys.readouterr()
    assert out == "" and "flat shading" in err and "raster render MODEL draws one of yours" in err
    assert np.unique(picture("x.jpg")).size > 20
    assert_refused(capsys, [(["cube.obj"], "unrecognized arguments: cube.obj")], "demo")


@pytest.mark.nightly  # compiles all kernels that there are
def test_kernels_that_are_there_are_not_compiled_again(capsys):
    assert raster("warmup") == 0 and raster("warmup") == 0
    assert re.search(r"^raster: kernels were ready already after [\d.]+ s, in ", errors(capsys), re.MULTILINE)


@pytest.mark.skipif(os.name != "posix", reason="modes are looked at on POSIX alone")
def test_a_place_where_no_store_can_be_is_refused(folder, capsys):
    (folder / "file").write_text("precious")
    assert_refused(capsys, [(["--into", str(folder / "file"), "-q"], "no store can be made in")], "warmup", code=4)
    assert (folder / "file").read_text() == "precious"
    own = folder / "kernels" / store.shipped_name()
    own.mkdir(parents=True)
    own.chmod(0o777)
    assert raster("warmup", "--into", str(own.parent)) == 4
    assert "others can write to it" in one_error(capsys)
    done = start("warmup", variables={"RASTER_STORE": str(folder / "file" / "below")})
    assert done.returncode == 4 and done.stderr.startswith(b"raster: error: compiled kernels can't be kept: ")
    assert b"RASTER_STORE names another folder" in done.stderr
