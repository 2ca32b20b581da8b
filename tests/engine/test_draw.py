"""Bands: high enough to be worth a thread, low enough for a cache, and for the numbers of records."""

from types import SimpleNamespace

import numpy as np
import pytest
from helpers.stages import SERIAL, drawables_of
from hypothesis import given, settings
from hypothesis import strategies as st

import rasterizer as rz
from rasterizer.engine.draw import BAND_ENTRIES, choose_band_rows, cull, list_bands
from rasterizer.options import MAX_PIXELS
from rasterizer.pipeline.visibility import MAX_RECORDS


@settings(max_examples=50, deadline=None)
@given(st.integers(1, MAX_PIXELS), st.integers(1, MAX_PIXELS), st.integers(1, 64), st.sampled_from([1, 2, 3, 4]))
def test_bands_are_whole_pixels_high_and_fit_the_cache(columns, lines, n_thread, factor):
    width, height = max(1, columns // factor) * factor, max(1, lines // factor) * factor
    rows = choose_band_rows(width, height, n_thread, factor)
    assert rows % factor == 0 and factor <= rows <= height
    assert rows * width <= max(BAND_ENTRIES, 8 * width)
    if n_thread > 1:
        assert rows <= max(16, -(-height // (2 * n_thread)))


def test_bands_of_usual_pictures():
    for given_, rows in (
        ((640, 480, 1, 1), 204), ((640, 480, 2, 1), 120), ((16384, 16384, 1, 1), 8), ((16384, 4, 8, 4), 4),
        ((MAX_PIXELS, MAX_PIXELS, 64, 4), 8),
    ):  # fmt: skip
        assert choose_band_rows(*given_) == rows, f"{given_}: {choose_band_rows(*given_)} != {rows}"


def test_busy_bands_come_first():
    starts = np.cumsum([0, 0, 3, 9, 3, 0])
    lists = SimpleNamespace(faces=np.arange(starts[-1], dtype=np.uint32), starts=starts)
    for rows, expected in (((0, 50), [20, 10, 30, 0, 40]), ((15, 31), [20, 15, 30])):
        assert [band.y_start for band in list_bands(lists, 10, rows)] == expected
    (band,) = list_bands(lists, 10, (25, 27))
    assert (band.y_start, band.y_end, band.faces.tolist()) == (25, 27, list(range(3, 12)))


def test_too_many_triangles_for_a_band_make_it_lower():
    """Record numbers are limited: bands are halved until they suffice; one row of pixels must do."""
    rng, (width, height), n, factor = np.random.default_rng(3), (64, 44), 900, 2
    corners = rng.uniform(0, (width - 8, height - 8), (n, 1, 2)) + np.array([(0, 0), (6, 0), (0, 6)])
    drawables = drawables_of(np.rint(256 * corners), np.full((n, 3), 2.0**30), np.zeros((1, n, 3, 1), np.float32))

    def bands_of(limit):
        as_pass = SimpleNamespace(
            n_sample=(width, height), factor=factor, sample_time=4, hidden_sides=None,
            units_per_record=MAX_RECORDS // limit, opacity=None,
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
