"""Pictures that are drawn into an array that is given."""

import numpy as np
import pytest
from helpers.pinhole import torus
from helpers.raster import COLORED

import rasterizer as rz

SIZE = (31, 23)
LAMPS = (*COLORED, rz.PointLight((1, 1, 2), 2.0))  # too bright, so that the range is left


def ring():
    """A ring that hides parts of itself."""
    return rz.Scene([rz.Mesh(*torus(12, 8))], LAMPS, rz.Camera.perspective((1.5, 2, 4), fov=40))


def test_a_picture_is_drawn_into_the_array_that_is_given():
    for outputs, color_range in (
        ("rgb", "clamp"),
        ("rgb", "global"),
        (("color", "depth"), "clamp"),
        ("color", "global"),
    ):
        out = np.full((SIZE[1], SIZE[0], 4), 77, np.uint8)
        options = {"outputs": outputs, "color_range": color_range, "samples": 1}
        frame, expected = rz.render(ring(), SIZE, out=out, **options), rz.render(ring(), SIZE, **options).rgba
        assert np.shares_memory(frame.rgba, out) and np.array_equal(out, expected), options
        with rz.Renderer(ring(), SIZE, **options) as renderer:
            for _ in range(2):
                assert np.array_equal(renderer.render(out=out).rgba, expected), options


ROOM = np.zeros((SIZE[1], SIZE[0], 4), np.uint8)
READ_ONLY = ROOM.copy()
READ_ONLY.flags.writeable = False


def test_arrays_that_do_not_fit():
    aside = np.zeros(ROOM.size + 1, np.uint8)[1:].reshape(ROOM.shape)
    for out in (ROOM[:-1], ROOM[..., :3], ROOM.astype(np.float32), ROOM[::-1], ROOM.tolist(), READ_ONLY, aside):
        with pytest.raises(rz.SceneError, match=r"out must be a writable array \(23, 31, 4\) of uint8"):
            rz.render(ring(), SIZE, out=out, samples=1)


def test_an_array_takes_a_picture_only():
    with pytest.raises(rz.SceneError, match="out takes a picture"):
        rz.render(ring(), SIZE, outputs="depth", out=ROOM)
