"""Pictures by kernels of the store: the bytes are those of numba's way, no compiler is loaded, and many processes may
begin with an empty store together."""

import re

import pytest
from helpers.stores import run, start

from rasterizer.compiler import kernels

NAMES = (
    "many lights", "many lights, as exact as float64", "clipped all round", "a polygon with ears", "four samples",
    "transparent and textured", "shadows", "texture, trilinear", "reflection, cook-torrance, with W", "small triangles",
)  # fmt: skip
DRAWS = """
import hashlib, sys
from helpers.small_scenes import draw

for name in sys.argv[1:]:
    digest = hashlib.sha256()
    for shading in ("flat", "gouraud", "phong"):
        for buffer, values in sorted(draw(name, shading).items()):
            digest.update(buffer.encode() + values.tobytes())
    print(digest.hexdigest())
"""
# Numba can be found, as its version is part of what kernels are found by, but not imported.
NO_COMPILER = """
import importlib.machinery, sys

class Refuses:
    def create_module(self, spec):
        return None

    def exec_module(self, module):
        raise ImportError(f"{module.__name__} is imported")

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name not in ("numba", "trimesh"):
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path)
        spec.loader = Refuses()
        return spec

sys.meta_path.insert(0, Finder())
"""
filled = pytest.mark.skipif(kernels.STORE.own is None, reason="there is no store")


def folder():
    """The folder of the store that this process uses."""
    return kernels.STORE.own.parent


@filled
@pytest.mark.nightly
def test_the_bytes_are_the_same_with_a_store_and_without(tmp_path):
    """Numba compiles all of it in the second process, and keeps nothing."""
    stored = run(DRAWS, tmp_path, *NAMES, RASTER_STORE=folder())
    compiled = run(DRAWS, tmp_path, *NAMES, RASTER_STORE="off")
    differing = [
        name for name, *both in zip(NAMES, stored.split(), compiled.split(), strict=True) if both[0] != both[1]
    ]
    assert not differing and len(set(stored.split())) >= len(NAMES) - 1  # two are as exact as each other


@filled
def test_a_picture_with_a_filled_store_loads_no_compiler(tmp_path):
    program = NO_COMPILER + DRAWS + "print(*sorted({'numba', 'trimesh'} & set(sys.modules)))"
    assert len(run(program, tmp_path, *NAMES[:3], RASTER_STORE=folder()).split()) == 3


TOGETHER = """
import hashlib, sys
import numpy as np
from rasterizer.compiler import kernels
from rasterizer.geometry.normals import list_corners
from rasterizer.pipeline.reflection import lambert

sys.stdin.readline()
rng = np.random.default_rng(3)
corners, first, order = rng.integers(0, 50, 400).astype(np.uint32), np.zeros(52, np.uint32), np.zeros(400, np.uint32)
with kernels.compiling_ahead(lambda: {(lambert, ("batch function", "float64")): True}):
    valence = list_corners(corners, first, order)
    assert kernels.batch_function(lambert, np.float64).address
print(valence, hashlib.sha256(first.tobytes() + order.tobytes()).hexdigest())
"""


@pytest.mark.nightly
def test_many_processes_may_begin_with_an_empty_store_together(tmp_path):
    """All get the same numbers, each file is there once and whole, and nothing else is left."""
    processes = [start(TOGETHER, tmp_path, RASTER_STORE=tmp_path / "store") for _ in range(8)]
    told = [(*process.communicate("\n"), process.returncode) for process in processes]
    said = {line for _, complaint, _ in told for line in complaint.splitlines()}
    assert all(re.match(r"rasterizer: compiling \d kernels? for the first time: ", line) for line in said), said
    assert len({(out, code) for out, _, code in told}) == 1 and told[0][2] == 0 and len(told[0][0]) > 64, told
    (own,) = (tmp_path / "store").iterdir()
    names = sorted(path.name.rpartition("-")[0] for path in own.iterdir())
    assert names == ["normals.list_corners", "reflection.lambert"]
