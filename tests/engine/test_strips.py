"""Strips of a picture have the bytes that the whole one has there, whatever is drawn and wherever it is cut."""

import itertools

import numpy as np
import pytest
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.batch.strip_renderer import StripRenderer

SIZE = (31, 43)
ALL = ("color", "depth", "face", "normal")
CASES = {
    "gear.stl": {"shading": "flat", "outputs": ALL, "color_range": "local", "samples": 1},
    "still_life.obj": {"shading": "phong", "outputs": ALL, "color_range": "global", "exposure": 1.0, "samples": 1},
    "glass.obj": {"shading": "phong", "samples": 4, "outputs": ALL},
    "globe.obj": {"shading": "phong", "samples": 4, "antialias": "shade-once", "outputs": "rgb"},
    "room.json": {"outputs": ("face", "depth"), "cull": "back"},
    "cube.obj": {"shading": "phong", "tolerance": 0.0, "outputs": ("color", "normal")},
}


@pytest.mark.parametrize("name", CASES)
def test_strips_put_together_are_the_picture(name):
    scene, options = rz.load(ROOT / "models" / name), CASES[name]
    with rz.Renderer(scene, SIZE, threads=2, **options) as renderer:
        whole = renderer.render()
    rows = list(itertools.pairwise([0, 1, 2, 13, 38, SIZE[1]]))
    with StripRenderer(scene, SIZE, threads=1, **options) as renderer:
        is_global = options.get("color_range") == "global"
        brightest = max(renderer.measure_strip(each) for each in rows) if is_global else 0.0
        strips = [renderer.render_strip(each, brightest=brightest) for each in rows]
    compared = [array for array in ("rgba", "alpha", *ALL) if whole.has("rgb" if array == "rgba" else array)]
    assert compared
    for array in compared:
        found = np.concatenate([strip.array(array) for strip in strips])
        assert found.tobytes() == whole.array(array).tobytes(), array
    assert sum(strip.stats.covered for strip in strips) == whole.stats.covered > 0
    assert sum(strip.stats.samples for strip in strips) == whole.stats.samples
    assert {strip.stats.error_bound for strip in strips} == {whole.stats.error_bound}


def test_rows_that_are_not_legal_and_a_closed_renderer_are_refused():
    renderer = StripRenderer(rz.load(ROOT / "models" / "cube.obj"), SIZE, threads=1)
    for rows in ((3, 3), (-1, 4), (0, 44), (5, 4), 7, (0, 1, 2), ("a", "b"), (0.5, 4), None):
        with pytest.raises(rz.SceneError, match=r"rows must be \(first, end\) within 0..43"):
            renderer.render_strip(rows)
    renderer.close()
    with pytest.raises(rz.SceneError, match="closed"):
        renderer.render_strip((0, 4))
