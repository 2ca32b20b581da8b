"""Check which maps a light needs, and where float32 holds them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pinhole import QUAD, octasphere, unit

import rasterizer as rz
from rasterizer.engine.lights import Beam, entry_of
from rasterizer.engine.shadow_maps import CUBE, choose_views, corners_of, map_side, reaches
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
    """Nothing that the light shines at; what the filter reaches beyond the face's border counts, too."""
    rng, n_left_out = np.random.default_rng(taps), 0
    shadow = rz.Shadow(32, taps)
    widest = map_side(shadow) / shadow.size
    for k in range(160):
        boxes, outer = random_boxes(rng, rng.integers(1, 4)), np.radians(rng.uniform(64, 89))
        origin = boxes.mean(axis=(0, 1)) + rng.normal(0, 0.3, 3)
        beam = Beam(origin, None, math.inf) if k % 2 else Beam(origin, unit(rng.normal(size=3)), math.tan(outer))
        maps = choose_views(beam, corners_of(boxes), shadow)
        if len(maps.views) == 1:
            continue
        points = inside(rng, boxes, 1000) - origin
        if beam.axis is not None:
            points = points[points @ beam.axis > np.linalg.norm(points, axis=1) * np.cos(outer)]
        for forward, is_needed in zip(CUBE, maps.is_needed, strict=True):
            depth = points @ forward
            beside = np.abs(points - depth[:, None] * forward).max(axis=1)
            n_seen = ((depth > 0) & (beside <= widest * depth)).sum()
            assert is_needed or n_seen == 0, f"{n_seen} points behind a face that was left out"
            n_left_out += not is_needed
    assert n_left_out > 25


@pytest.mark.parametrize("taps", [1, 9])
def test_maps_show_what_the_light_shines_at_with_room_for_the_filter(taps):
    rng, shadow, n_view = np.random.default_rng(taps), rz.Shadow(32, taps), set()
    for k in range(60):
        boxes, axis = random_boxes(rng, 2), unit(rng.normal(size=3))
        near, away = boxes.mean(axis=(0, 1)), 9 * unit(rng.normal(size=3))
        beam = [
            Beam(None, axis, 0.0), Beam(near + away, None, math.inf), Beam(near, None, math.inf),
            Beam(near + away, -away / 9, math.tan(0.2)),
        ][k % 4]  # fmt: skip
        maps = choose_views(beam, corners_of(boxes), shadow)
        n_view.add(len(maps.views))
        points = inside(rng, boxes, 300) - maps.origin
        if k % 4 == 3:
            points = points[points @ beam.axis > np.linalg.norm(points, axis=1) * np.cos(0.2)]
        margin = (taps >> 1) + (0.99 if len(maps.views) == 1 else 0.0)  # of a fitted map, a texel more
        for view, projection in maps.views:
            depth = points @ view.forward
            across, upward = (points @ way / (depth if beam.origin is not None else 1) for way in (view.right, view.up))
            at = np.stack([projection.center_x + projection.scale_x * across,
                           projection.center_y - projection.scale_y * upward])  # fmt: skip
            is_of_map = (
                (depth > 0) & (np.maximum(abs(across), abs(upward)) <= 1) if len(maps.views) == 6 else depth < 99
            )
            off = np.maximum(margin - at, at - map_side(shadow) + margin)[:, is_of_map].max(initial=-1.0)
            assert off <= 1e-9, f"{beam}: {off:.3g} texels beyond what the filter leaves"
    assert n_view == {1, 6}


@pytest.mark.parametrize("kind", ["range", "cone", "both"])
def test_a_light_reaches_nothing_only_if_no_point_is_lit(kind):
    rng, n_dark = np.random.default_rng(len(kind)), 0
    for _ in range(200):
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
    assert n_dark > 20


def test_float32_is_taken_where_it_moves_edges_by_less_than_an_eighth_of_a_texel():
    meshes = [FLOOR, BALL]
    for distance, texels, expected in (
        (6, 1024, "float32"), (60, 64, "float32"), (40, 4096, "float64"), (3000, 1024, "float64"),
    ):  # fmt: skip
        light = rz.DirectionalLight((0.3, 0.2, -1), shadow=rz.Shadow(texels))
        camera = rz.Camera.perspective((0, -0.6 * distance, 0.8 * distance), (0, 0, 0), fov=math.degrees(4 / distance))
        with rz.Renderer(rz.Scene(meshes, light, camera), 32, shading="phong", samples=1) as renderer:
            stats = renderer.render().stats
        assert stats.plan.dtype == expected, f"{distance} units, {texels} texels: {stats.plan.dtype}"
    assert rz.render(rz.Scene(meshes, light, camera), 32, tolerance=0, samples=1).stats.plan.dtype == "float64"


def test_maps_are_drawn_anew_where_a_view_needs_float64():
    """From near, from far away, and from near again: as if each were drawn alone."""
    scene = rz.Scene([FLOOR, BALL], rz.DirectionalLight((0.3, 0.2, -1), shadow=rz.Shadow(256)))
    cameras = [rz.Camera.perspective((0, -d, d), (0, 0, 0), fov=200 / d) for d in (5.0, 3000.0, 5.0)]
    with rz.Renderer(scene, 64, shading="phong", samples=1) as renderer:
        for camera, dtype in zip(cameras, ("float32", "float64", "float32"), strict=True):
            frame = renderer.render(camera)
            alone = rz.render(replace(scene, camera=camera), 64, shading="phong", samples=1)
            assert frame.stats.plan.dtype == dtype and not differences(frame.rgba, alone.rgba)


def test_a_black_light_needs_no_look_up():
    scene = rz.Scene([FLOOR], rz.DirectionalLight((0, 0, -1), 0.0, shadow=True))
    assert rz.render(scene, 16, shading="phong", samples=1).color.max() == 0
