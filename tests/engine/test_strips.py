"""Strips of a picture have the bytes that the whole one has there, whatever is drawn and wherever it is cut."""

import itertools

import numpy as np
import pytest
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.batch.strip_renderer import StripRenderer

SIZE = (61, 83)
ALL = ("color", "depth", "face", "normal")
LOOKS = {
    "one channel": ("gear.stl", {}),
    "colours and shadows": ("still_life.obj", {}),
    "glass": ("glass.obj", {}),
    "a texture": ("globe.obj", {}),
    "a scene file with shadows": ("room.json", {}),
}
OPTIONS = {
    "gouraud": {"outputs": ALL},
    "phong": {"shading": "phong", "outputs": ALL, "color_range": "global"},
    "flat, local": {"shading": "flat", "outputs": ALL, "color_range": "local"},
    "4 samples": {"shading": "phong", "samples": 4, "outputs": ALL},
    "16 samples, bytes": {"samples": 16, "outputs": "rgb", "color_range": "global", "exposure": 1.0},
    "shade-once": {"shading": "phong", "samples": 4, "antialias": "shade-once", "outputs": "rgb"},
    "buffers alone, culled": {"outputs": ("face", "depth"), "cull": "back"},
    "exact": {"shading": "phong", "tolerance": 0.0, "outputs": ("color", "normal")},
}


def whole_and_strips(scene, options, cuts):
    with rz.Renderer(scene, SIZE, threads=2, **options) as renderer:
        whole = renderer.render()
    rows = list(itertools.pairwise([0, *cuts, SIZE[1]]))
    with StripRenderer(scene, SIZE, threads=1, **options) as renderer:
        is_global = options.get("color_range") == "global"
        brightest = max(renderer.measure_strip(each) for each in rows) if is_global else 0.0
        strips = [renderer.render_strip(each, brightest=brightest) for each in rows]
    return whole, strips


@pytest.mark.parametrize("look", LOOKS)
@pytest.mark.parametrize("way", OPTIONS)
def test_strips_put_together_are_the_picture(look, way):
    name, settings = LOOKS[look]
    options = OPTIONS[way]
    cuts = sorted(set(np.random.default_rng(len(look + way)).integers(1, SIZE[1], 4).tolist()))
    scene = rz.load(ROOT / "models" / name, **settings)
    whole, strips = whole_and_strips(scene, options, cuts)
    compared = [array for array in ("rgba", "alpha", *ALL) if whole.has("rgb" if array == "rgba" else array)]
    assert compared
    for array in compared:
        found = np.concatenate([strip.array(array) for strip in strips])
        assert found.tobytes() == whole.array(array).tobytes(), array
    assert sum(strip.stats.covered for strip in strips) == whole.stats.covered > 0
    assert sum(strip.stats.samples for strip in strips) == whole.stats.samples
    assert {strip.stats.error_bound for strip in strips} == {whole.stats.error_bound}


def test_single_rows_put_together_are_the_picture():
    whole, strips = whole_and_strips(rz.load(ROOT / "models" / "glass.obj"), {"samples": 4}, range(1, SIZE[1]))
    assert len(strips) == SIZE[1]
    assert np.concatenate([strip.rgba for strip in strips]).tobytes() == whole.rgba.tobytes()


@pytest.mark.parametrize("rows", [(3, 3), (-1, 4), (0, 84), (5, 4), 7, (0, 1, 2), ("a", "b"), (0.5, 4), None])
def test_rows_that_are_not_legal(rows):
    with (
        StripRenderer(rz.load(ROOT / "models" / "cube.obj"), SIZE, threads=1) as renderer,
        pytest.raises(rz.SceneError, match=r"rows must be \(first, end\) within 0..83"),
    ):
        renderer.render_strip(rows)


def test_a_closed_renderer_draws_no_strips():
    renderer = StripRenderer(rz.load(ROOT / "models" / "cube.obj"), SIZE, threads=1)
    renderer.close()
    with pytest.raises(rz.SceneError, match="closed"):
        renderer.render_strip((0, 4))
