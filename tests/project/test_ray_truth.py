"""Shadows by rays: tile by tile they are the reference's, and a time limit leaves tiles out, not digits."""

import numpy as np
import pytest
from helpers.arrays import differences

import rasterizer as rz
from bench.ray_truth import draw_by_rays, only
from rasterizer import reference
from rasterizer.analysis.speed_error import Light

SIZE = (40, 27)  # no multiple of a tile


def shadow_scene(opacity=1.0):
    """A few cards over a floor, under a light of each sort: far away, in the world, on the camera, an area."""
    rng = np.random.default_rng(3)
    corners = rng.uniform(-1, 1, (12, 1, 3)) + rng.uniform(-0.4, 0.4, (12, 3, 3)) + (0, 1, 0)
    cards = rz.Mesh(corners.reshape(-1, 3), np.arange(36).reshape(-1, 3), material=rz.Material(opacity=opacity))
    floor = rz.Mesh([[-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3]], [[0, 1, 2, 3]])
    pane = rz.Mesh([[-1, 0, 1.5], [1, 0, 1.5], [0, 2, 1.5]], [[0, 1, 2]], material=rz.Material(opacity=0.5))
    lights = [
        rz.AmbientLight(0.1),
        rz.DirectionalLight((-1, -2, -0.5), (0.3, 0.2, 0.1), shadow=True),
        rz.PointLight((1, 2.5, 1), 0.3, shadow=True),
        rz.PointLight((0.5, 0.5, 0), 0.2, attached="camera", shadow=True),
        rz.AreaLight((0, 3, 0), (1, 0, 0), (0, 0, 1), 0.3, resolution=(2, 2), shadow=True),
    ]
    return rz.Scene([cards, floor, pane], lights, rz.Camera.perspective((2, 3, 5), (0, 0.5, 0), fov=45))


@pytest.mark.parametrize(("samples", "opacity"), [(1, 0.6), pytest.param(4, 1.0, marks=pytest.mark.nightly)])
def test_every_tile_is_the_references(samples, opacity):
    scene = shadow_scene(opacity)
    found = draw_by_rays(scene, SIZE, samples, 600.0, exposure=0.5)
    expected = reference.render(scene, SIZE, shading="phong", samples=samples, exposure=0.5)
    assert found.share == 1.0 and not differences(found.is_known, True)
    assert np.abs(found.light.alpha - expected.alpha).max() <= 1e-15
    assert np.abs(found.light.color - expected.color * expected.alpha[..., None]).max() <= 1e-14


def test_a_time_limit_leaves_tiles_out(monkeypatch):
    scene, clock = shadow_scene(), iter(range(10**6))
    monkeypatch.setattr("bench.ray_truth.perf_counter", lambda: float(next(clock)))  # a second a look
    found = draw_by_rays(scene, SIZE, 1, 12.5)
    assert 0.0 < found.share < 1.0 and found.share == found.is_known.mean()
    whole = reference.render(scene, SIZE, shading="phong")
    expected = only(Light(whole.color * whole.alpha[..., None], whole.alpha), found.is_known)
    assert np.abs(found.light.color - expected.color).max() <= 1e-14
    assert np.abs(found.light.alpha - expected.alpha).max() <= 1e-15


def test_too_little_time_says_nothing_and_an_empty_picture_is_known():
    assert draw_by_rays(shadow_scene(), SIZE, 1, 0.0) is None
    scene = rz.Scene(rz.Mesh([[0, 0, 9], [1, 0, 9], [0, 1, 9]], [[0, 1, 2]]), camera=rz.Camera.perspective((0, 0, 3)))
    found = draw_by_rays(scene, SIZE, 4, 600.0)
    assert found.share == 1.0 and not differences(found.light.alpha, 0)
