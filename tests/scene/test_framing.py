"""Framing: the smallest centred view from every side, of anything, at any scale."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.pixels import AXIS, project
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer.errors import SceneError
from rasterizer.scene.camera import Camera

_coordinate = st.floats(-10.0, 10.0).map(lambda x: round(x, 4))
_points = st.lists(st.tuples(_coordinate, _coordinate, _coordinate), min_size=1, max_size=12).map(np.array)


def margins(camera, points, size):
    """Return the empty shares of the picture: (left, top), (right, bottom)."""
    pixels, depth = project(camera, points, size)
    assert (depth > 0.0).all()
    return pixels.min(axis=0) / size, 1.0 - pixels.max(axis=0) / size


def assert_framed(camera, points, size, margin=0.05, tight=1e-6, centered=1e-3):
    """Check that the points keep the margin, reach it in one direction, and are centred."""
    low, high = margins(camera, points, size)
    assert min(low.min(), high.min()) == pytest.approx(margin, abs=tight), (low, high)
    assert np.abs(low - high).max() <= centered


@pytest.mark.parametrize(
    ("up", "azimuth", "towards"),
    [
        ("y", 0, "z"),
        ("y", 90, "x"),
        ("y", 180, "-z"),
        ("y", -90, "-x"),
        ("z", 0, "-y"),
        ("z", 90, "x"),
        ("-y", 0, "-z"),
        ("-y", 90, "x"),
        ("-z", 0, "y"),
        ("-z", 90, "x"),
        ("x", 0, "z"),
        ("x", 90, "-y"),
        ("-x", 90, "y"),
    ],
)
def test_azimuth(up, azimuth, towards):
    view = Camera.framing([[-1, -1, -1], [1, 1, 1]], azimuth=azimuth, elevation=0, up=up).view()
    assert tuple(-view.forward) == AXIS[towards]
    assert tuple(view.up) == AXIS[up]


@pytest.mark.parametrize("up", AXIS)
def test_elevation_rises_towards_up(up):
    for elevation in (-90, -30, 0, 30, 90):
        view = Camera.framing([[-1, -1, -1], [1, 1, 1]], elevation=elevation, up=up).view()
        assert -view.forward @ AXIS[up] == pytest.approx(math.sin(math.radians(elevation)), abs=1e-12)
        assert view.up @ AXIS[up] == pytest.approx(math.cos(math.radians(elevation)), abs=1e-12)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("size", [(640, 480), (300, 900), (1000, 100), (1, 1)])
@pytest.mark.parametrize("elevation", [-90, -20, 0, 25, 90])
def test_framing_is_tight_and_centred(orthographic, size, elevation):
    points = np.random.default_rng(7).normal(size=(500, 3)) * (1.0, 2.0, 0.3)
    aspect = size[0] / size[1]
    camera = Camera.framing(points, elevation=elevation, orthographic=orthographic, aspect=aspect)
    assert_framed(camera, points, size, centered=1e-9)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("offset", [0.0, 1e6])
@pytest.mark.parametrize("orthographic", [False, True])
def test_framing_at_any_scale_and_offset(scale, offset, orthographic):
    points = np.random.default_rng(3).uniform(-1, 1, (200, 3)) * scale + offset
    camera = Camera.framing(points, orthographic=orthographic)
    # the eye's own coordinates are rounded: what that is in shares of the subject
    rounding = 8 * np.spacing(offset + scale) / scale
    assert_framed(camera, points, (640, 480), tight=1e-6 + rounding, centered=1e-3 + rounding)


@given(
    _points,
    st.floats(-360, 360),
    st.floats(-90, 90),
    st.floats(1, 120),
    st.floats(0.1, 10),
    st.floats(0, 0.45),
    st.sampled_from(sorted(AXIS)),
    st.booleans(),
)
@settings(max_examples=200, deadline=None)
def test_framing_anything(points, azimuth, elevation, fov, aspect, margin, up, orthographic):
    mesh = SimpleNamespace(vertices=points)  # two bare points would be bounds
    camera = Camera.framing(mesh, azimuth, elevation, fov, up, margin, orthographic, aspect)
    size = (1000 * aspect, 1000)
    view, scale = camera.view(), camera.projection((1000, 1000)).scale_x
    r = points - view.eye
    w = r @ view.forward if camera.is_perspective else np.ones(len(r))
    assert (w > 0.0).all()
    pixels = np.stack([scale * (r @ view.right) / w, scale * (r @ view.up) / w], axis=1) / size + 0.5
    low, high = pixels.min(axis=0), 1.0 - pixels.max(axis=0)
    assert np.abs(low - high).max() <= 1e-6
    assert min(low) >= margin - 1e-6
    # a needle that points at the eye keeps its distance; a line seen as a point fills nothing
    size_along_axes = np.linalg.norm(np.ptp(r @ np.stack(view[1:]).T, axis=0))
    is_needle = camera.is_perspective and w.min() <= 0.0101 * size_along_axes
    is_point = (np.ptp(pixels, axis=0) < 1e-6).all()
    if not is_needle and not is_point:
        assert min(low) == pytest.approx(margin, abs=1e-6)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("point", [(0, 0, 0), (1e6, -1e6, 3), (1e-6, 0, 0), (1e12, 0, 0)])
def test_framing_a_single_point_puts_it_in_the_middle(orthographic, point):
    camera = Camera.framing(np.array([point]), orthographic=orthographic)
    pixels, depth = project(camera, [point], (640, 480))
    assert depth[0] > 0.0
    assert pixels[0] == pytest.approx((320, 240), abs=0.5)


@pytest.mark.parametrize("orthographic", [False, True])
def test_framing_flat_meshes_and_lines(orthographic):
    square = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]) + 5.0
    for azimuth, elevation in ((0, 0), (90, 0), (0, 90), (35, 25)):  # head on, edge on twice, slanting
        camera = Camera.framing(square, azimuth, elevation, orthographic=orthographic)
        assert_framed(camera, square, (640, 480), centered=1e-9)
    line = np.array([(0, 0, -1), (0, 0, 1)])[[0, 1, 1]]
    camera = Camera.framing(line, 0, 0, orthographic=orthographic)  # the line is seen as a point
    pixels, depth = project(camera, line, (640, 480))
    assert (depth > 0.0).all() and pixels == pytest.approx(np.array([(320, 240)] * 3))


def test_framing_a_needle_keeps_a_distance():
    needle = np.array([(0, 0, 10), (0.1, 0, 0), (-0.1, 0, 0), (0, 0.1, 0), (0, -0.1, 0)])
    camera = Camera.framing(needle, 0, 0, fov=90)
    low, high = margins(camera, needle, (640, 480))
    assert low == pytest.approx(high) and min(low) > 0.05
    assert project(camera, needle, (640, 480))[1].min() == pytest.approx(0.1, rel=0.01)


def test_framing_is_smallest():
    """Any step nearer pushes a vertex over the margin."""
    points = np.random.default_rng(5).normal(size=(100, 3))
    camera = Camera.framing(points)
    forward = camera.view().forward
    nearer = replace(camera, position=np.array(camera.position) + 1e-3 * forward)
    low, high = margins(nearer, points, (640, 480))
    assert min(low.min(), high.min()) < 0.05 - 1e-5


def test_framing_takes_bounds_meshes_and_scenes():
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)], dtype=np.float32)
    expected = Camera.framing(corners)
    assert_framed(expected, corners, (640, 480))
    assert Camera.framing([[0, 0, 0], [1, 2, 3]]).position == pytest.approx(expected.position)
    assert Camera.framing(SimpleNamespace(vertices=corners)).position == expected.position
    halves = [SimpleNamespace(used_vertices=half) for half in (corners[:3], corners[3:])]
    assert Camera.framing(SimpleNamespace(meshes=halves)).position == pytest.approx(expected.position)
    two = SimpleNamespace(vertices=corners[[0, 7]])  # two vertices of a mesh are no bounds
    assert_framed(Camera.framing(two, azimuth=-60), corners[[0, 7]], (640, 480))


def test_framing_many_points_goes_by_chunks():
    points = np.random.default_rng(1).normal(size=(100_000, 3))
    assert_framed(Camera.framing(points), points, (640, 480), centered=1e-9)


@pytest.mark.parametrize("wrong", [np.zeros((0, 3)), [[1, 2]], "cube", None, [["a", "b", "c"]], np.zeros(3), 5])
def test_framing_needs_points(wrong):
    with pytest.raises(SceneError, match="what is framed"):
        Camera.framing(wrong)


@pytest.mark.parametrize("where", [0, 3, 40_000, 49_999])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_framing_refuses_points_that_are_not_finite(where, bad):
    points = np.random.default_rng(1).normal(size=(50_000, 3))
    points[where, 1] = bad
    with np.errstate(invalid="ignore"), pytest.raises(SceneError, match="finite"):
        Camera.framing(points)


@pytest.mark.parametrize(
    "options",
    [
        {"azimuth": math.nan},
        {"elevation": 91},
        {"fov": 0},
        {"fov": 180},
        {"up": "w"},
        {"up": (0, 1, 0)},
        {"margin": 0.5},
        {"margin": -0.1},
        {"aspect": 0},
        {"aspect": math.inf},
    ],
)
def test_framing_refuses_illegal_options(options):
    with pytest.raises(SceneError, match=next(iter(options))):
        Camera.framing([[0, 0, 0], [1, 1, 1]], **options)
