"""The kernels that are compiled ahead are those that pictures call: helpers/record_kernels.py records them."""

import importlib
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.small_scenes import MODELS

import rasterizer as rz
from rasterizer.compiler import kernels
from rasterizer.engine.recorded_kernels import list_all_kernels, list_kernels

RECORD = [sys.executable, "-m", "helpers.record_kernels", "--check"]


@pytest.mark.skipif(not kernels.STORE.is_used, reason="numba calls them, which has its own types")
@pytest.mark.parametrize("every", [29, pytest.param(1, marks=pytest.mark.nightly)])
def test_what_is_recorded_is_what_pictures_call(every):
    """All that they call, and nothing else where all are drawn. `python -m helpers.record_kernels` mends the file."""
    done = subprocess.run(
        [*RECORD, "--every", str(every)], capture_output=True, text=True, cwd=Path(__file__).resolve().parents[1]
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_default_picture_takes_few_kernels():
    """A grey scene without textures, shadows or transparent surfaces takes nothing of these."""
    with rz.Renderer(MODELS / "teapot.obj", 8) as renderer:
        listed = [kernels.title_of(function) for function, _ in list_kernels(renderer.scene, renderer.options)]
    unused = "texture", "layers.", "a_buffer.", "shadow", "clip.", "buffers.", "ears."
    assert not [title for title in listed if any(part in title for part in unused)]
    assert "phong_shading.shade_lit" in listed and len(listed) <= 12


def test_no_kernel_of_the_package_is_forgotten():
    """Whatever a kernel is for, warming up compiles it: a wheel that holds the store draws without the compiler."""
    left_out = ("rasterizer.__main__", "rasterizer.viewer.widget")  # a program; a module that needs an extra
    modules = [m.name for m in pkgutil.walk_packages(rz.__path__, "rasterizer.") if m.name not in left_out]
    everything = [value for name in modules for value in vars(importlib.import_module(name)).values()]
    own = {value.py_func for value in everything if isinstance(value, kernels.Kernel)}
    missing = {kernels.title_of(function) for function in own - {function for function, _ in list_all_kernels()}}
    assert len(own) > 40 and not missing
