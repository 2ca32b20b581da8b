"""The command line, run in this process or as the program itself: help for its tests."""

import os
import subprocess
import sys

import numpy as np
from PIL import Image

from helpers.raster import ROOT
from rasterizer.cli import main

CUBE = str(ROOT / "models" / "cube.obj")
GEAR = str(ROOT / "models" / "gear.stl")
SMALL = ["-s", "24x16", "--threads", "1"]


def run(*argv) -> int:
    """Draw a small picture in this process."""
    return main(["render", *SMALL, *map(str, argv)])


def start(*argv, cwd=None, **options):
    """Run the program itself."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "rasterizer", *argv]
    return subprocess.run(command, capture_output=True, env=environment, cwd=cwd, **options)


def errors(capsys) -> str:
    """What was said on stderr; nothing was said on stdout, and nothing looks like a traceback."""
    out, err = capsys.readouterr()
    assert out == "" and "Traceback" not in err
    assert all(line.startswith("raster: ") for line in err.splitlines())
    return err


def one_error(capsys) -> str:
    err = errors(capsys)
    assert err.startswith("raster: error: ") and err.count("\n") == 1, err
    return err


def picture(name) -> np.ndarray:
    return np.asarray(Image.open(name))
