"""What else a scene has: values that can be drawn, and truths finer than all of them."""

import pytest

import rasterizer as rz
from bench.axes import list_axes, measure_axes
from rasterizer.engine.shadow_maps import MAX_TEXELS


def texels_of(scene) -> int:
    """The most texels that a scene's maps may have: six maps for each lamp in the scene."""
    cells = ((light.shadow, getattr(light, "resolution", (1, 1))) for light in scene.lights if hasattr(light, "shadow"))
    return sum(6 * n * m * shadow.size**2 for shadow, (n, m) in cells if shadow is not None)


def test_the_maps_of_every_variant_have_room():
    """Thirty-six lamps of an area light can't have maps of 8192²: what has no room is left out, or coarser."""
    axes = {axis.name: axis for axis in list_axes(rz.load("models/room.json"), {})}
    assert {"shadow map", "shadow filter", "area light", "spectrum"} <= set(axes)
    for axis in axes.values():
        for variant in (*axis.variants, *([axis.finest] if axis.finest else [])):
            assert texels_of(variant.scene) <= MAX_TEXELS, (axis.name, variant.value)
    cells = [variant.value for variant in axes["area light"].variants]
    assert cells[0] == "1 x 1 cells" and axes["area light"].against == "6 x 6 cells"


def test_a_lamp_alone_is_compared_with_the_largest_maps():
    light = rz.DirectionalLight((-1, -1, -1), shadow=True)
    axes = {axis.name: axis for axis in list_axes(rz.Scene(rz.load("models/cube.obj").meshes, light), {})}
    assert axes["shadow map"].against == "maps of 8192², unfiltered" and axes["shadow map"].is_of_shadows
    assert [variant.value for variant in axes["shadow map"].variants] == ["256²", "512²", "1024²", "2048²", "4096²"]


@pytest.mark.nightly
def test_shadows_are_compared_with_rays():
    """On a picture that is wholly known the finest map's shadow is that of rays; a filter's is another one."""
    floor = rz.Mesh([[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], [[0, 1, 2, 3]])
    card = rz.Mesh([[-0.7, 1, 0.3], [0.6, 1.1, 0.4], [0.1, 0.9, -0.6]], [[0, 1, 2]])
    light = rz.DirectionalLight((-0.3, -1.2, -0.4), 0.7, shadow=True)
    scene = rz.Scene([floor, card], [rz.AmbientLight(0.1), light])
    rows = measure_axes(scene, (48, 36), 6.0, lambda *_: None, threads=1).rows
    found = {row.value: row for row in rows if row.axis == "shadow map"}
    assert [row for row in found.values() if row.against != "rays, in 100 % of the picture"] == []
    assert found["4096²"].error.rms <= 1e-6 < max(row.error.rms for row in rows if row.axis == "shadow filter")


def test_what_there_is_no_time_for_is_not_begun():
    """The limit counts pictures, and rays: with hardly any time one thing is measured, and without any nothing is."""
    scene = rz.load("models/globe.obj")
    for limit, expected in ((0.0, []), (1e-9, ["texture filter"]), (9.0, ["texture filter", "reflection"])):
        found = measure_axes(scene, (24, 18), 0.0, lambda *_: None, None, limit, threads=1)
        assert list(dict.fromkeys(row.axis for row in found.rows)) == expected
        assert expected + found.left_out == ["texture filter", "reflection"]
