"""Check where the transform stage puts vertices, and which of them it leaves to the clip stage."""

from fractions import Fraction

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pairs import pairs
from helpers.pixels import project
from helpers.stages import SERIAL, plain_screen, screen_of
from hypothesis import given, settings
from hypothesis import strategies as st

import rasterizer as rz
from rasterizer import reference
from rasterizer.cores import Workers
from rasterizer.pipeline.transform import (
    DEPTH_BITS,
    DEPTH_MARGIN,
    DEPTH_SPAN,
    LIMIT_PX,
    MIN_VERTICES,
    OUTSIDE,
    POSITION_BOUND,
    Vertices,
    transform,
    transform_range,
)


def place(points, screen, workers=SERIAL):
    """Transform points (n, 3); return (vertices, number that must be clipped)."""
    return transform(np.ascontiguousarray(points, float).reshape(-1, 3), screen, workers)


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


def test_without_a_far_plane_nothing_is_too_far():
    here, n_outside = place([(0, 0, -1e300), (0, 0, -200)], plain_screen(depths=(1.0, 100.0)))
    assert n_outside == 0 and not differences(here.x, 0)


@pytest.mark.parametrize("is_perspective", [True, False])
def test_depths_fill_the_buffer_and_leave_room_at_both_ends(is_perspective):
    assert DEPTH_MARGIN + DEPTH_SPAN + DEPTH_MARGIN == 2**DEPTH_BITS
    for depths in [(1.0, 100.0), (0.999999, 1.000001), (1e-6, 1.0), (1e6, 1e6 + 1), (3e-5, 7e4)]:
        near, far = depths
        points = np.zeros((1001, 3))
        points[:, 2] = -np.linspace(near, far, 1001)
        points[-1, 2] = -far
        z = place(points, plain_screen(is_perspective, depths))[0].z
        # z = offset + scale·(1/w): with 1/near much larger than the range of 1/w, its rounding is magnified.
        given = (1 / near, 1 / far) if is_perspective else depths
        slack = 4 * 2.0**-52 * max(map(abs, given)) / abs(given[1] - given[0]) * DEPTH_SPAN
        off = max(abs(z[0] - DEPTH_MARGIN), abs(z[-1] - DEPTH_MARGIN - DEPTH_SPAN))
        assert off <= slack < DEPTH_MARGIN / 2, f"{depths}: {off} > {slack} units"
        assert (np.diff(z) > 0).all(), f"{depths}: not ascending"


def test_what_is_nearer_than_the_depths_that_are_seen_lies_before_the_buffer():
    """A triangle that reaches the picture from the side needs depths there, but no room for them."""
    seen = plain_screen(depths=(4.0, 8.0))._replace(near=1.0)
    here, n_outside = place([(0, 0, -1), (0, 0, -4), (0, 0, -8), (0, 0, -0.9)], seen)
    assert n_outside == 1 and here.x[3] == OUTSIDE
    assert np.abs(here.z[:3] - DEPTH_MARGIN - np.array([-6.0, 0.0, 1.0]) * DEPTH_SPAN).max() <= 2.0**-10


def test_one_depth_alone_lies_inside_the_buffer():
    for is_perspective in (True, False):
        z = place([(0.3, 0.2, -5.0)], plain_screen(is_perspective, (5.0, 5.0)))[0].z
        assert z == DEPTH_MARGIN


coordinate = st.floats(-50, 50)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(coordinate, coordinate, st.floats(1, 90)), min_size=2, max_size=2), st.booleans())
def test_depth_is_affine_on_the_screen(ends, is_perspective):
    """The point that is seen midway between two others has the mean of their z, in rational numbers."""
    screen = plain_screen(is_perspective)
    (xa, ya, wa), (xb, yb, wb) = ends
    # Midway on the screen is at the share wa/(wa + wb) of the way in space.
    t = Fraction(wa) / (Fraction(wa) + Fraction(wb)) if is_perspective else Fraction(1, 2)
    middle = [float(Fraction(p) + t * (Fraction(q) - Fraction(p))) for p, q in ((xa, xb), (ya, yb), (wa, wb))]
    z = place([(xa, ya, -wa), (xb, yb, -wb), (*middle[:2], -middle[2])], screen)[0].z
    assert abs(z[2] - (z[0] + z[1]) / 2) <= 2.0**-12, "a 4096th of a step of the z-buffer"


def test_the_unit_of_length_does_not_change_a_bit():
    size = (203, 157)
    for camera, power in pairs(camera=CAMERAS[:2], power=(-40, -3, 20, 40)):
        view, scale = camera.view(), 2.0**power
        points = view.eye + 4.0 * view.forward + np.random.default_rng(2).uniform(-2, 2, (300, 3))
        screen = screen_of(view, camera.projection(size), (0.5, 20.0), 20.0)
        larger = screen_of(
            view._replace(eye=view.eye * scale), camera.projection(size), (0.5 * scale, 20.0 * scale), 20.0 * scale
        )
        (here, n_here), (there, n_there) = place(points, screen), place(points * scale, larger)
        assert n_here == n_there
        for name in here._fields[:5]:
            same = (getattr(here, name) == getattr(there, name)).all()
            assert same, f"{name} differs at a scale of 2^{power}, seen from {view.eye}"


def test_threads_and_compilation_do_not_change_a_bit():
    rng = np.random.default_rng(3)
    points = rng.uniform(-20, 20, (3 * MIN_VERTICES + 77, 3))
    screen = plain_screen(depths=(1.0, 15.0), far_clip=15.0, scale=30.0, center=(20.5, 10.25))
    serial, n_outside = place(points, screen)
    for n_thread in (2, 3):
        workers = Workers(n_thread)
        assert len(workers.ranges(len(points), MIN_VERTICES)) > 1
        parallel, n_parallel = place(points, screen, workers)
        workers.close()
        assert n_parallel == n_outside > 100
        assert [(a, b) for a, b in zip(serial[:5], parallel, strict=False) if a.tobytes() != b.tobytes()] == []
    n = 500
    plain = Vertices(np.empty(n, np.int32), np.empty(n, np.int32), *np.empty((3, n)), serial.pixel)
    n_plain = transform_range.py_func(points[:n].reshape(-1), 0, n, screen, plain)
    assert n_plain == (serial.x[:n] == OUTSIDE).sum()
    assert [(a, b) for a, b in zip(serial[:5], plain, strict=False) if a[:n].tobytes() != b.tobytes()] == []


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


def test_the_reference_can_leave_the_rounding_of_vertices_out():
    """Without it a plane of colours is exact; with it, it is off by what colours change within the bound."""
    vertices = np.array([(-1.3, -1.1, 0), (1.7, -0.9, 0.5), (0.1, 1.2, -0.4)])
    mesh = rz.Mesh(vertices, [[0, 1, 2]], colors=np.eye(3), material=rz.Material(ambient=1.0))
    camera, size = rz.Camera.perspective((0, 0, 3)), (32, 24)
    scene, view = rz.Scene([mesh], [rz.AmbientLight(1.0)], camera), camera.view()
    corners = (vertices - view.eye) @ np.stack([view.right, view.up, view.forward]).T
    j, i = np.mgrid[:24, :32] + 0.5
    expected = unrounded_values(corners, np.eye(3), camera.projection(size), np.stack([i, j], axis=-1))
    whole, rounded = (reference.render(scene, size, shading="phong", rounded=flag) for flag in (False, True))
    inside = (whole.face == 0) & (expected > 1e-3).all(axis=-1)
    assert inside.sum() > 200 and not differences(whole.face, rounded.face)
    off, moved = (np.abs(found.color - expected)[inside].max() for found in (whole, rounded))
    assert off < 1e-12, f"off by {off:.3g} > 1e-12 without rounding"
    assert 1e-6 < moved < 1e-3, f"rounding moved a colour by {moved:.3g}"
