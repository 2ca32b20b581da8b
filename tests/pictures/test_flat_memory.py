"""Memory stays flat over many pictures: `bench/scale.py --many 10000` measures the same over a night's work."""

import gc
import itertools
import tracemalloc

import pytest
from helpers.raster import ROOT

import rasterizer as rz
from bench import scale

MESH = rz.load(ROOT / "models" / "cube.obj").meshes[0]
PICTURES = 60


@pytest.mark.nightly  # many pictures, so that a leak stands out from noise
def test_pictures_of_all_kinds_leave_nothing_behind():
    """5 MB over 10 000 pictures are 500 bytes a picture; what leaks at all leaks an array of some kilobytes.

    Python's and numpy's own allocations are counted, which doesn't depend on what the system gives back.
    """
    list(scale.draw_many(16, 1))  # what is kept once: kernels, tables, imports
    gc.collect()
    tracemalloc.start()
    try:
        list(scale.draw_many(8, 1))
        gc.collect()
        before = tracemalloc.get_traced_memory()[0]
        list(scale.draw_many(PICTURES, 1))
        gc.collect()
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 500 * PICTURES, f"{grown} bytes more after {PICTURES} pictures > {500 * PICTURES}"


def test_one_renderer_holds_no_more_after_many_pictures():
    """What leaks at all leaks an array of some kilobytes in every round; what is made once, by chance, in one of them.

    Python's and numpy's own allocations are counted.
    """
    cameras = rz.Camera.orbit(MESH, 10, size=(48, 32))
    with rz.Renderer(MESH, (48, 32), outputs=("rgb", "depth"), threads=2) as renderer:
        held = []
        for _ in range(6):
            for camera in cameras:
                renderer.render(camera)
            if not held:
                tracemalloc.start()
            gc.collect()
            held.append(tracemalloc.get_traced_memory()[0])
        tracemalloc.stop()
    grown = min(after - before for before, after in itertools.pairwise(held[1:]))
    assert grown < 500 * 10, f"at least {grown} bytes more after each 10 pictures > 5000"
