"""The program as a whole: help, compiled kernels, and the process itself with its streams."""

import os
import re
import shlex
import subprocess
import sys

import pytest
from helpers.command import CUBE, SMALL, run, start
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.cli import arguments, main
from rasterizer.cli.commands import COMMANDS
from rasterizer.cli.messages import Messages, compilation_shown

pytestmark = pytest.mark.usefixtures("folder")


@pytest.mark.parametrize("argv", [["--help"], ["render", "--help"], ["warmup", "-h"], ["--version"]])
def test_help(argv, capsys):
    with pytest.raises(SystemExit) as stop:
        main(argv)
    out, err = capsys.readouterr()
    assert stop.value.code == 0 and err == "" and out
    if argv == ["--version"]:
        assert out == f"raster {rz.__version__}\n"


def test_the_examples_of_the_help_parse(capsys):
    with pytest.raises(SystemExit):
        main(["render", "--help"])
    examples = re.findall(r"raster (render .*?)(?:   .*| > .*)?$", capsys.readouterr().out, re.MULTILINE)
    examples = [example for example in examples if "MODEL..." not in example]
    assert len(examples) == 8
    for example in examples:
        arguments.parse(example.replace("'", "").split())


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_a_help_whose_examples_parse(command, capsys):
    with pytest.raises(SystemExit) as stop:
        main([command, "--help"])
    out = capsys.readouterr().out
    assert stop.value.code == 0 and out.startswith(f"usage: raster {command}")
    for example in re.findall(rf"^  raster ({command} .*?)(?:   .*| > .*)?$", out, re.MULTILINE):
        arguments.parse(shlex.split(example))
    if command not in ("compare", "bench", "view", "warmup"):
        assert "examples:" in out and "exit codes:" in out


def test_warmup_leaves_nothing_to_compile(capsys):
    with compilation_shown(Messages()) as progress:
        for model in ("still_life.obj", "globe.obj", "glass.obj", "room.json", "knot.ply", "gear.stl", "torus.glb"):
            path = ROOT / "models" / model
            for flags in (
                ["--shading", "phong"],
                ["--shading", "phong", "--light", "point:1,1,1", "--tolerance", "0", "--crease-angle", "60"],
                [
                    "--shading",
                    "flat",
                    "--light",
                    "directional:1,1,1,color=#f00",
                    "--samples",
                    "9",
                    "--cull",
                    "back",
                ],
                [
                    "--eye",
                    "0.1,0,0.2",
                    "--target",
                    "5,1,0",
                    "--color-range",
                    "local",
                    "--background",
                    "white",
                ],
                ["--eye", "0.1,0,0.2", "--array", "face", "--ortho"],
                ["--array", "normal"],
                ["--array", "depth", "--shading", "flat"],
                ["--shadows", "--shading", "phong", "-s", "32"],
                ["--shadows", "--light", "area:1,3,1,edge_u=1/0/0,edge_v=0/0/1,resolution=2/2", "-s", "32"],
                ["--ortho", "--reflection", "blinn", "--spectral", "5", "--shading", "phong"],
            ):
                output = "x.npy" if "--array" in flags else "x.png"
                assert run(path, *flags, "-o", output, "-q") == 0
    assert progress.n_shown == 0 and capsys.readouterr().err == ""


def test_a_cache_folder_that_cannot_be_written_breaks_nothing(folder):
    (folder / "file").write_bytes(b"")
    code = "from rasterizer.compiler.kernels import STORE; print(STORE.own, STORE.is_used)"
    environment = os.environ | {"RASTER_STORE": str(folder / "file" / "below")}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=environment, check=True)
    assert done.stdout == "None True\n"


def test_help_imports_neither_numpy_nor_numba_nor_trimesh():
    code = (
        "import sys; from rasterizer.cli import main\n"
        "try: main(['render', '--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'numba', 'llvmlite', 'trimesh', 'PIL', 'scipy'} & set(sys.modules)\n"
        "print(sorted(heavy), len(sys.modules), file=sys.stderr)"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    heavy, n_module = result.stderr.strip().rsplit(" ", 1)
    assert heavy == "[]" and int(n_module) < 150


def test_garbage_is_collected_while_models_are_drawn_but_not_what_imports_made(folder):
    """Also: who calls `main` with arguments keeps the collector as he has set it."""
    code = (
        "import gc, sys; from rasterizer.cli import main, render_command\n"
        "def draw(*_): print(gc.isenabled(), gc.get_freeze_count() > 0); return [], 1\n"
        "render_command.render_models = draw\n"
        "gc.disable(); assert main(['render', 'x']) == 0\n"
        "gc.enable(); sys.argv[1:] = ['render', 'x']; assert main() == 0"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout.split() == ["False", "False", "True", "True"]


def test_the_program_itself(folder):
    done = start("render", CUBE, *SMALL, "-o", "-", cwd=folder)
    assert done.returncode == 0 and done.stdout.startswith(b"\x89PNG") and b"error" not in done.stderr
    failed = start("render", "nope.obj", cwd=folder)
    assert failed.returncode == 3 and failed.stderr == b"raster: error: nope.obj: no such file\n"


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_a_full_disk_behind_stdout(folder):
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": ""}
    command = [sys.executable, "-m", "rasterizer", "--help"]
    with open("/dev/full", "wb") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, env=environment, cwd=folder)
    assert done.returncode == 4 and done.stderr == b"raster: error: can't write to stdout: No space left on device\n"


@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
def test_a_reader_that_has_gone(folder):
    reader, writer = os.pipe()
    os.close(reader)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "rasterizer", "render", CUBE, *SMALL, "--json", "-q"]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, env=environment, cwd=folder)
    os.close(writer)
    assert done.returncode == 4 and done.stderr == b""
