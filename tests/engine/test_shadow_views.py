"""Check which maps a light needs, and where float32 holds them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.pinhole import QUAD, octasphere, unit

import rasterizer as rz
from rasterizer.engine.light_table import Beam, entry_of
from rasterizer.engine.shadow_views import CUBE, choose_views, corners_of, map_side, reaches
from rasterizer.pipeline.shadow_lookup import LAYER, MAPS, N_MAP_COLUMN
from rasterizer.scene.camera import View

FLOOR = rz.Mesh([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], QUAD)
BALL = rz.Mesh(octasphere(2)[0] * 0.4 + (0, 0, 0.5), octasphere(2)[1])
VIEW = View(np.array([0.0, 0.0, 5.0]), *np.eye(3))


def random_boxes(rng, n):
    low = rng.uniform(-3, 3, (n, 3))
    return np.stack([low, low + rng.uniform(0.05, 1.5, (n, 3))], axis=1)


def inside(rng, boxes, n):
    """Points of the boxes, (n, 3), borders included."""
    box = boxes[rng.integers(0, len(boxes), n)]
    return box[:, 0] + (box[:, 1] - box[:, 0]) * np.clip(rng.uniform(-0.2, 1.2, (n, 3)), 0, 1)


@pytest.mark.parametrize("taps", [1, 9])
def test_a_face_of_the_cube_is_left_out_only_if_nothing_lies_behind_it(taps):
    """What the filter reaches beyond the face's border counts, too."""
    rng, n_left_out = np.random.default_rng(taps), 0
    shadow = rz.Shadow(32, taps)
    widest = map_side(shadow) / shadow.size
    for _ in range(200):
        boxes = random_boxes(rng, rng.integers(1, 4))
        origin = boxes.mean(axis=(0, 1)) + rng.normal(0, 0.3, 3)
        maps = choose_views(Beam(origin, None, math.inf), corners_of(boxes), shadow)
        if len(maps.views) == 1:
            continue
        points = inside(rng, boxes, 2000) - origin
        for forward, is_needed in zip(CUBE, maps.is_needed, strict=True):
            depth = points @ forward
            beside = np.abs(points - depth[:, None] * forward).max(axis=1)
            n_seen = ((depth > 0) & (beside <= widest * depth)).sum()
            assert is_needed or n_seen == 0, f"{n_seen} points behind a face that was left out"
            n_left_out += not is_needed
    assert n_left_out > 50


@pytest.mark.parametrize("kind", ["range", "cone", "both"])
def test_a_light_reaches_nothing_only_if_no_point_is_lit(kind):
    rng, n_dark = np.random.default_rng(len(kind)), 0
    for _ in range(400):
        boxes = random_boxes(rng, rng.integers(1, 3))
        position, way = rng.uniform(-6, 6, 3), unit(rng.normal(size=3))
        light = rz.PointLight(position, range=rng.uniform(0.5, 6))
        if kind != "range":
            light = rz.SpotLight(position, way, outer=rng.uniform(1, 90), range=light.range if kind == "both" else None)
        to_point = inside(rng, boxes, 500) - position
        distance = np.linalg.norm(to_point, axis=1)
        is_lit = distance < (light.range or np.inf)
        if kind != "range":
            is_lit &= to_point @ way > distance * np.cos(np.radians(light.outer))
        is_reached = reaches(light, entry_of(light).beam(light, VIEW), corners_of(boxes))
        assert is_reached or not is_lit.any(), f"{is_lit.sum()} points are lit"
        n_dark += not is_reached
    assert n_dark > 40


def drawn_maps(light, meshes=(FLOOR, BALL)):
    """The layers of the maps that are drawn of a light; None for none."""
    with rz.Renderer(rz.Scene(meshes, light), 16, shading="phong", samples=1) as renderer:
        renderer.render()
        shadows = renderer._prepared.shadows  # None where no light is left that casts any
        (shadow_map,) = (shadows and shadows._maps.values()) or [None]
    if shadow_map is None:
        return None
    block = shadow_map.block
    return [int(block[MAPS + N_MAP_COLUMN * k + LAYER]) for k in range(int(block[0]))]


def test_maps_that_matter_to_nothing_are_not_drawn():
    lamp = rz.PointLight((0, 0, 1), shadow=rz.Shadow(32))
    assert drawn_maps(lamp) == [0, 1, 2, 3, -1, 4], "nothing lies above the lamp"
    assert drawn_maps(replace(lamp, color=0)) is None, "it is black"
    assert drawn_maps(replace(lamp, position=(0, 0, 9), range=2.0)) is None, "out of its range"
    spot = rz.SpotLight((0, 0, 5), (0, 0, 1), outer=40, shadow=rz.Shadow(32))
    assert drawn_maps(spot) is None, "it looks away"
    assert drawn_maps(replace(spot, direction=(0, 0, -1))) == [0]
    wide = rz.SpotLight((0, 0, 0.5), (1, 0, 0), outer=70, shadow=rz.Shadow(32))
    assert drawn_maps(wide)[1] == -1, "behind a wide spot light"


@pytest.mark.parametrize("position", [(0, 0, 1), (1.5, -0.3, 0.7), (0, 0, 30)])
def test_what_is_left_out_changes_nothing(position, monkeypatch):
    from rasterizer.engine import shadow_views

    scene = rz.Scene([FLOOR, BALL], rz.PointLight(position, shadow=rz.Shadow(64, 3), range=8.0))
    frame = rz.render(scene, 64, shading="phong", samples=1)
    monkeypatch.setattr(shadow_views, "_is_needed", lambda *_: True)
    monkeypatch.setattr("rasterizer.engine.shadow_maps.reaches", lambda *_: True)
    assert (rz.render(scene, 64, shading="phong", samples=1).rgba == frame.rgba).all()


@pytest.mark.parametrize(
    "distance, texels, expected",
    [(6, 1024, "float32"), (60, 64, "float32"), (20, 8192, "float64"), (3000, 1024, "float64")],
)
def test_float32_is_taken_where_it_moves_edges_by_less_than_an_eighth_of_a_texel(distance, texels, expected):
    light = rz.DirectionalLight((0.3, 0.2, -1), shadow=rz.Shadow(texels))
    camera = rz.Camera.perspective((0, -0.6 * distance, 0.8 * distance), (0, 0, 0), fov=math.degrees(4 / distance))
    frame = rz.render(rz.Scene([FLOOR, BALL], light, camera), 32, shading="phong", samples=1)
    assert frame.stats.plan.dtype == expected, frame.stats.plan.reasons
    assert any("float32" in cause for cause, _, _ in frame.stats.steps) == (expected == "float32")
    assert rz.render(rz.Scene([FLOOR, BALL], light, camera), 32, tolerance=0, samples=1).stats.plan.dtype == "float64"


def test_maps_are_drawn_anew_where_a_view_needs_float64():
    """From near, from far away, and from near again: as if each were drawn alone."""
    scene = rz.Scene([FLOOR, BALL], rz.DirectionalLight((0.3, 0.2, -1), shadow=rz.Shadow(256)))
    cameras = [rz.Camera.perspective((0, -d, d), (0, 0, 0), fov=200 / d) for d in (5.0, 3000.0, 5.0)]
    with rz.Renderer(scene, 64, shading="phong", samples=1) as renderer:
        for camera, dtype in zip(cameras, ("float32", "float64", "float32"), strict=True):
            frame = renderer.render(camera)
            alone = rz.render(replace(scene, camera=camera), 64, shading="phong", samples=1)
            assert frame.stats.plan.dtype == dtype and (frame.rgba == alone.rgba).all()


def test_a_black_light_needs_no_look_up():
    scene = rz.Scene([FLOOR], rz.DirectionalLight((0, 0, -1), 0.0, shadow=True))
    assert rz.render(scene, 16, shading="phong", samples=1).color.max() == 0
