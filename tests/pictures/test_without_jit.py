"""Draw small pictures with the JIT switched off: the Python that stands in the sources is what the machine code does.

NUMBA_DISABLE_JIT=1 is how a debugger steps through a picture.
"""

import io
import os
import subprocess
import sys

import numpy as np
import pytest
from helpers.raster import ROOT
from helpers.small_scenes import SHADINGS, SIZE, draw, drawn

COLOR = 1e-6  # of float32 colours: machine code may add in another order


def draw_plainly(names):
    """Small scenes, drawn by a process that compiles nothing."""
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tests'}"}
    command = [sys.executable, "-W", "error", "-m", "helpers.small_scenes", *names]
    done = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, check=False)
    assert done.returncode == 0 and not done.stderr, done.stderr.decode()[-2000:]
    return np.load(io.BytesIO(done.stdout))


def check_scenes(names):
    """Coverage, face and depth to the bit."""
    pictures = draw_plainly(names)
    for name in names:
        for shading in SHADINGS:
            which, fault = f"{name}, {shading}", f"{name}/{shading}/fault"
            assert fault not in pictures, f"{which}: {pictures[fault]}"
            expected = draw(name, shading)
            found = {buffer: pictures[f"{name}/{shading}/{buffer}"] for buffer in expected}
            assert (expected["face"] >= 0).sum() > 50, f"{which}: the scene shows too little"
            assert np.ptp(expected["color"][expected["face"] >= 0]) > 0.05, f"{which}: the scene is all alike"
            for buffer in ("face", "depth"):
                n_off = int((found[buffer] != expected[buffer]).sum())
                assert n_off == 0, f"{which}: {buffer} differs in {n_off} px"
            for buffer in ("alpha", "color", "normal"):
                worst = np.abs(found[buffer] - expected[buffer]).max()
                assert worst <= COLOR, f"{which}: {buffer} {worst:.3g} > {COLOR:.3g}"
            levels = np.abs(found["rgb"].astype(int) - expected["rgb"]).max()
            assert levels <= 1, f"{which}: {levels} levels of 8 bits > 1"


HANDFUL = ("transparent and textured", "shadows", "reflection, cook-torrance, with W")


def test_a_few_pictures_without_the_jit_are_the_compiled_ones():
    check_scenes(HANDFUL)


@pytest.mark.nightly
def test_every_picture_without_the_jit_is_the_compiled_one():
    check_scenes(list(drawn()))


def test_the_example_of_the_manual_runs(tmp_path):
    """The whole way from a file to a file."""
    program = (
        f"import rasterizer as rz; rz.render(rz.load({str(ROOT / 'models' / 'cube.obj')!r}), {SIZE}).save('cube.png')"
    )
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert (tmp_path / "cube.png").stat().st_size > 100
