"""Check which maps a light needs, and where float32 holds them."""

import math

import numpy as np
import pytest
from helpers.pinhole import unit

import rasterizer as rz
from rasterizer.engine.lights import Beam, entry_of
from rasterizer.engine.shadow_maps import CUBE, choose_views, corners_of, map_side, reaches
from rasterizer.scene.camera import View

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
