"""The command line, run in this process or as the program itself: help for its tests."""

import os
import subprocess
import sys

import numpy as np
from PIL import Image

from helpers.raster import ROOT
from rasterizer.cli import main
from rasterizer.cli.messages import Messages
from rasterizer.cli.models import load_scene
from rasterizer.cli.parser import parse
from rasterizer.cli.request import make_request

CUBE = str(ROOT / "models" / "cube.obj")
GEAR = str(ROOT / "models" / "gear.stl")
PLAIN = ["--preset", "studio", "--shading", "gouraud"]  # as the library draws, but for 4 samples
SMALL = ["-s", "24x16", "--threads", "1"]


class Code(int):
    """An exit code that an assertion shows with the command that ended with it."""

    def __new__(cls, code, argv):
        made = super().__new__(cls, code)
        made.command = " ".join(argv)
        return made

    def __repr__(self):
        return f"{int(self)}, of raster {self.command},"


def raster(*argv) -> Code:
    """Run the command line in this process; return its exit code."""
    argv = [str(each) for each in argv]
    return Code(main(argv), argv)


def run(*argv) -> Code:
    """Draw a small picture in this process; without a ground, which takes ten times as long as the model."""
    return raster("render", *SMALL, "--no-ground", *argv)


def loaded(model, *argv):
    """What is loaded of a model with the flags of `raster render`."""
    return load_scene(str(model), request_of(str(model), *argv), Messages())


def request_of(*argv, command="render"):
    """What a command line asks for."""
    return make_request(parse([command, *argv]))[0]


def start(*argv, cwd=None, variables=(), **options):
    """Run the program itself, with more variables of the environment."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)} | dict(variables)
    command = [sys.executable, "-m", "rasterizer", *argv]
    return subprocess.run(command, capture_output=True, env=environment, cwd=cwd, **options)


def end_once_it_says_now(code) -> None:
    """Start a program in Python, with the cube's file as its argument, and terminate it when it has printed "now": it
    must end with that exit code, and without a traceback."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", code, CUBE]
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout.readline() == b"now\n"
    process.terminate()
    _, err = process.communicate(timeout=20)
    assert process.returncode == 143 and b"Traceback" not in err


def errors(capsys) -> str:
    """What was said on stderr; nothing was said on stdout, and nothing looks like a traceback."""
    out, err = capsys.readouterr()
    assert out == "" and "Traceback" not in err
    assert [line for line in err.splitlines() if not line.startswith("raster: ")] == []
    return err


def one_error(capsys) -> str:
    err = errors(capsys)
    assert err.startswith("raster: error: ") and err.count("\n") == 1, err
    return err


def picture(name) -> np.ndarray:
    return np.asarray(Image.open(name))


def assert_refused(capsys, cases, *command, code=2) -> None:
    """Run a command with the arguments of each case, (arguments, words): it must end with the exit code and one line on
    stderr that holds the words, and write nothing."""
    before = sorted(os.listdir())
    for argv, words in cases:
        found = raster(*command, *argv)
        out, err = capsys.readouterr()
        case = f"raster {found.command}"
        assert found == code, f"{case}: exit code {int(found)}, not {code}: {err}"
        assert err.startswith("raster: error: ") and err.count("\n") == 1 and not out, f"{case}: {out}{err}"
        assert words in err, f"{case}: {words!r} is not in {err!r}"
        assert sorted(os.listdir()) == before, f"{case}: a file was written"
