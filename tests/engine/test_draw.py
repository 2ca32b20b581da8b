"""Bands: high enough to be worth a thread, low enough for a cache, and for the numbers of setups."""

from types import SimpleNamespace

import numpy as np
import pytest
from helpers.stages import SERIAL, drawables_of

import rasterizer as rz
from rasterizer.engine.draw import cull
from rasterizer.pipeline.visibility import MAX_SETUPS


def test_too_many_triangles_for_a_band_make_it_lower():
    """Setup numbers are limited: bands are halved until they suffice; one row of pixels must do."""
    rng, (width, height), n, factor = np.random.default_rng(3), (64, 44), 900, 2
    corners = rng.uniform(0, (width - 8, height - 8), (n, 1, 2)) + np.array([(0, 0), (6, 0), (0, 6)])
    drawables = drawables_of(np.rint(256 * corners), np.full((n, 3), 2.0**30), np.zeros((1, n, 3, 1), np.float32))

    def bands_of(limit):
        as_pass = SimpleNamespace(
            n_sample=(width, height), factor=factor, sample_time=4, hidden_sides=None,
            units_per_setup=MAX_SETUPS // limit, opacity=None,
        )  # fmt: skip
        lists, n_row = cull(drawables.triangles, drawables.vertices, as_pass, SERIAL)
        return n_row, np.diff(lists.starts)

    whole, n_in_band = bands_of(n)
    assert whole == height and n_in_band.tolist() == [n]
    n_row, n_in_band = bands_of(400)
    assert n_row < height and n_row % factor == 0 and n_in_band.max() <= 400, f"{n_row} rows: {n_in_band.max()} > 400"
    assert bands_of(2 * n_in_band.max())[0] >= n_row, "lower than they need be"
    with pytest.raises(rz.SceneError, match="polygons meet one row of pixels; legal are 20: draw a larger picture"):
        bands_of(20)
