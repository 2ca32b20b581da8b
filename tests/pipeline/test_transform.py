"""Check where the transform stage puts vertices, and which of them it leaves to the clip stage."""

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pixels import project
from helpers.stages import SERIAL, plain_screen, screen_of

import rasterizer as rz
from rasterizer.pipeline.transform import (
    LIMIT_PX,
    OUTSIDE,
    POSITION_BOUND,
    transform,
)


def place(points, screen):
    """Transform points (n, 3); return (vertices, number that must be clipped)."""
    return transform(np.ascontiguousarray(points, float).reshape(-1, 3), screen, SERIAL)


def test_places_are_rounded_half_to_even():
    """Places that are exact halves of a sub-pixel, and places one rounding error beside them."""
    k = np.arange(-1001, 1000)
    half = (k + 0.5) / 256
    even = 2 * ((k + 1) // 2)  # the even one of k and k + 1
    screen = plain_screen(is_perspective=False)
    here, n_outside = place(np.stack([half, half, np.full(len(k), -2.0)], axis=1), screen)
    assert n_outside == 0
    assert not differences(here.x, even) and not differences(here.y, -even)
    for side, expected in ((-np.inf, k), (np.inf, k + 1)):
        beside = np.nextafter(half, side)
        here, _ = place(np.stack([beside, beside, np.full(len(k), -2.0)], axis=1), screen)
        assert not differences(here.x, expected) and not differences(here.y, -expected)


CAMERAS = [
    rz.Camera.perspective((1.5, 2.0, 4.0), (0.1, -0.2, 0.3), fov=40),
    rz.Camera.perspective((-900.0, 20.0, 7.0), (-903.0, 25.0, 1.0), fov=100),
    rz.Camera.orthographic((1.5, 2.0, 4.0), (0, 0, 0), (0, 1, 0), height=2.4),
]


@pytest.mark.parametrize("camera", CAMERAS)
def test_places_are_those_of_the_definitions(camera):
    """The nearest sub-pixel; the float64 terms on the way may move it by a millionth of one."""
    size, view = (203, 157), camera.view()
    points = view.eye + 4.0 * view.forward + np.random.default_rng(1).uniform(-2, 2, (500, 3))
    screen = screen_of(view, camera.projection(size), (1e-3, 1e3))
    here, n_outside = place(points, screen)
    places, depth = project(camera, points, size)
    off = np.abs(np.stack([here.x, here.y], axis=1) - 256 * places).max()
    assert n_outside == 0 and off <= 0.5 + 1e-6, f"{off} sub-pixels > 0.5"
    given = 1.0 / depth if camera.is_perspective else depth
    off = np.abs(here.z - (screen.z_offset + screen.z_scale * given)).max()
    assert off <= 2.0**-12, f"{off} units of the z-buffer > 2^-12"


@pytest.mark.parametrize("is_perspective", [True, False])
def test_marks_what_can_not_be_placed(is_perspective):
    limit = float(LIMIT_PX)
    screen = plain_screen(is_perspective, (1.0, 8.0), far_clip=8.0)
    inside = [(0, 0, -1), (0, 0, -8), (limit, -limit, -1), (-limit, limit, -1), (0.5, 0.5, -1)]
    up, down = np.nextafter(limit, np.inf), np.nextafter(1.0, 0.0)
    outside = [
        (0, 0, -down), (0, 0, -np.nextafter(8.0, 9.0)), (0, 0, 0), (0, 0, 3),
        (up, 0, -1), (-up, 0, -1), (0, up, -1), (0, -up, -1),
        *[np.where(np.arange(3) == k, bad, -2.0) for k in range(3) for bad in (np.nan, np.inf, -np.inf)],
        (1e308, 1e308, -2), (1e-300, 0, -1e-300), (0, 0, -1e308),
    ]  # fmt: skip
    with np.errstate(all="ignore"):
        here, n_outside = place(inside + outside, screen)
    assert np.count_nonzero(here.x[: len(inside)] == OUTSIDE) == 0
    assert (here.x[len(inside) :] == OUTSIDE).all(), outside[int(np.argmax(here.x[len(inside) :] != OUTSIDE))]
    assert n_outside == len(outside)
    assert here.x[2] == 2**28 and here.y[2] == 2**28 and here.x[3] == -(2**28)


# ---------------------------------------------------------------- what rounding does to all that is interpolated


def unrounded_values(corners, values, projection, places):
    """What a triangle shows at places (..., 2) of the screen, px, before anything is rounded: (..., 3).

    corners : (3, 3) in the eye's frame: right, up, depth · values : (3, 3), of the corners
    """
    x, y = places[..., 0], places[..., 1]
    across, upward = (x - projection.center_x) / projection.scale_x, (projection.center_y - y) / projection.scale_y
    columns = corners.T.copy()
    if not projection.is_perspective:
        columns[2] = 1.0
    q = np.stack([across, upward, np.ones_like(x)], axis=-1) @ np.linalg.inv(columns).T
    return q @ values / q.sum(axis=-1, keepdims=True)


@pytest.mark.parametrize(
    "make, reach", [(rz.Camera.perspective, 1.0), (rz.Camera.perspective, 0.1), (rz.Camera.orthographic, 0.3)]
)
def test_every_sample_shows_a_point_within_the_position_bound(make, reach):
    """A colour lies between those that the polygon has in the square about the sample: the ends are in the square's
    corners, because both parts of the quotient are linear."""
    rng, size, n_sample = np.random.default_rng(7), (48, 36), 0
    bound = POSITION_BOUND
    assert rz.render(rz.load("models/cube.obj"), (4, 3), samples=1).stats.position_bound == bound
    steps = bound * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])
    camera = make((0, 0, 3))
    view, projection = camera.view(), camera.projection(size)
    for _ in range(25):
        vertices = rng.uniform(-0.7, 0.7, 3) + rng.uniform(-reach, reach, (3, 3))
        values = rng.uniform(0, 1, (3, 3))
        mesh = rz.Mesh(vertices, [[0, 1, 2]], colors=values, material=rz.Material(ambient=1.0))
        frame = rz.render(
            rz.Scene([mesh], [rz.AmbientLight(1.0)], camera), size, shading="phong", tolerance=0, samples=1
        )
        rows, columns = np.nonzero(frame.alpha)
        places = np.stack([columns, rows], axis=1)[:, None] + 0.5 + steps
        corners = (vertices - view.eye) @ np.stack([view.right, view.up, view.forward]).T
        around = unrounded_values(corners, values, projection, places)
        low, high = around.min(axis=1), around.max(axis=1)
        off = np.maximum(low - frame.color[rows, columns], frame.color[rows, columns] - high).max(initial=0.0)
        assert off <= 1e-6, f"a sample is {off:.3g} outside what lies within {bound} px of it > 1e-6"
        n_sample += len(rows)
    assert n_sample > 10
