"""Framing and turntables: the smallest centred view from every side, of anything, at any scale."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.pairs import pairs
from helpers.pixels import AXIS, project
from helpers.refusals import assert_refused
from hypothesis import given, settings
from hypothesis import strategies as st

import rasterizer as rz
from rasterizer.errors import SceneError
from rasterizer.scene.camera import Camera

_coordinate = st.floats(-10.0, 10.0).map(lambda x: round(x, 4))
_points = st.lists(st.tuples(_coordinate, _coordinate, _coordinate), min_size=1, max_size=12).map(np.array)
CUBE = [[-1, -1, -1], [1, 1, 1]]
LENSES = False, True
CLOUD = np.random.default_rng(5).normal(size=(60, 3)) * (3.0, 1.0, 0.4) + (5.0, -2.0, 7.0)


def margins(camera, points, size):
    """Return the empty shares of the picture: (left, top), (right, bottom)."""
    pixels, depth = project(camera, points, size)
    assert depth.min() > 0.0
    return pixels.min(axis=0) / size, 1.0 - pixels.max(axis=0) / size


def assert_framed(camera, points, size=(640, 480), centered=1e-9, what=""):
    """Check that the points keep the margin, reach it in one direction, and are centred."""
    low, high = margins(camera, points, size)
    assert abs(min(low.min(), high.min()) - 0.05) <= 1e-6, f"{what}: margins {low}, {high}"
    off = np.abs(low - high).max()
    assert off <= centered, f"{what}: off the middle by {off:.3g} > {centered:.3g}"


@given(
    _points, st.floats(-360, 360), st.floats(-90, 90), st.floats(1, 120), st.floats(0.1, 10), st.floats(0, 0.45),
    st.sampled_from(sorted(AXIS)), st.booleans(),
)  # fmt: skip
@settings(max_examples=60, deadline=None)
def test_framing_anything(points, azimuth, elevation, fov, aspect, margin, up, orthographic):
    mesh = SimpleNamespace(vertices=points)  # two bare points would be bounds
    camera = Camera.framing(mesh, azimuth, elevation, fov, up, margin, orthographic, aspect)
    size = (1000 * aspect, 1000)
    view, scale = camera.view(), camera.projection((1000, 1000)).scale_x
    r = points - view.eye
    w = r @ view.forward if camera.is_perspective else np.ones(len(r))
    assert w.min() > 0.0
    pixels = np.stack([scale * (r @ view.right) / w, scale * (r @ view.up) / w], axis=1) / size + 0.5
    low, high = pixels.min(axis=0), 1.0 - pixels.max(axis=0)
    # With u the spacing of the largest coordinate, those of the eye are rounded by u/2, and of r, twice as large, by u;
    # a dot product has five roundings, of numbers below 4 of it, by 2 u: (3/2 sqrt(3) + 10) u, on two sides, here and
    # in `framing`, is less than 64 u.
    spacing = np.spacing(np.abs([*points, view.eye]).max())
    rounding = 64 * spacing * scale / w.min() / min(size)
    assert np.abs(low - high).max() <= 1e-6 + rounding
    assert min(low) >= margin - 1e-6 - rounding
    # a needle that points at the eye keeps its distance; a line seen as a point fills nothing
    size_along_axes = np.linalg.norm(np.ptp(r @ np.stack(view[1:]).T, axis=0))
    is_needle = camera.is_perspective and w.min() <= 0.0101 * size_along_axes
    is_point = (np.ptp(pixels, axis=0) < 1e-6).all()
    if not is_needle and not is_point:
        assert min(low) == pytest.approx(margin, abs=1e-6 + rounding)


def test_framing_is_smallest():
    """Any step nearer pushes a vertex over the margin; many points go by chunks."""
    for n in (100, 100_000):
        points = np.random.default_rng(5).normal(size=(n, 3))
        camera = Camera.framing(points)
        assert_framed(camera, points)
        nearer = replace(camera, position=np.array(camera.position) + 1e-3 * camera.view().forward)
        low, high = margins(nearer, points, (640, 480))
        assert min(low.min(), high.min()) < 0.05 - 1e-5


def test_framing_takes_bounds_meshes_and_scenes():
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)], dtype=np.float32)
    expected = Camera.framing(corners)
    assert_framed(expected, corners, centered=1e-3)
    assert Camera.framing([[0, 0, 0], [1, 2, 3]]).position == pytest.approx(expected.position)
    assert Camera.framing(SimpleNamespace(vertices=corners)).position == expected.position
    halves = [SimpleNamespace(used_vertices=half) for half in (corners[:3], corners[3:])]
    assert Camera.framing(SimpleNamespace(meshes=halves)).position == pytest.approx(expected.position)
    two = SimpleNamespace(vertices=corners[[0, 7]])  # two vertices of a mesh are no bounds
    assert_framed(Camera.framing(two, azimuth=-60), corners[[0, 7]], centered=1e-3)
    mesh = rz.Mesh(CLOUD[:3], [[0, 1, 2]])
    scene = rz.Scene(mesh, up="z")  # its up axis counts
    assert Camera.framing(scene) == Camera.framing(mesh, up="z") != Camera.framing(mesh)
    assert Camera.framing(scene, up="y") == Camera.framing(mesh)
    assert Camera.orbit(scene, 2) == Camera.orbit(mesh, 2, up="z")


def test_framing_takes_the_shape_of_a_size():
    assert Camera.framing(CLOUD, size=(300, 200)) == Camera.framing(CLOUD, aspect=1.5)
    assert Camera.framing(CLOUD, size=64) == Camera.framing(CLOUD, aspect=1.0)
    assert Camera.framing(CLOUD) == Camera.framing(CLOUD, size=rz.Options().size)
    with pytest.raises(SceneError, match=r"size or its aspect; given 64 and 1\.0"):
        Camera.framing(CLOUD, size=64, aspect=1.0)
    sizes = [(size, "size must be") for size in (0, (4, 0), "64", (1, 2, 3))]
    assert_refused(lambda size: Camera.framing(CLOUD, size=size), sizes, SceneError)


def test_what_cannot_be_framed_is_refused():
    wrong = [np.zeros((0, 3)), [[1, 2]], "cube", None, [["a", "b", "c"]], np.zeros(3), 5]
    assert_refused(Camera.framing, [(each, "what is framed") for each in wrong], SceneError)
    for where, bad in zip((0, 3, 40_000, 49_999), (math.nan, math.inf, -math.inf, math.nan), strict=True):
        points = np.random.default_rng(1).normal(size=(50_000, 3))
        points[where, 1] = bad
        with pytest.raises(SceneError, match="finite"):
            Camera.framing(points)
    options = [
        ("azimuth", math.nan), ("elevation", 91), ("fov", 0), ("fov", 180), ("up", "w"), ("up", (0, 1, 0)),
        ("margin", 0.5), ("margin", -0.1), ("aspect", 0), ("aspect", math.inf),
    ]  # fmt: skip
    cases = [({name: value}, name) for name, value in options]
    assert_refused(lambda given: Camera.framing(CUBE, **given), cases, SceneError)


# --- turntables: one distance, one target, and a view that holds the subject from every side, just so ---------------


def test_every_camera_of_an_orbit_holds_the_subject_and_some_just_so():
    for case in pairs(up=tuple(AXIS), orthographic=LENSES, elevation=(-90, -89, -20, 0, 25, 60, 89.9, 90)):
        up, orthographic, elevation = case
        angles, size = np.arange(0, 360, 6.0), (300, 200)
        cameras = Camera.orbit(CLOUD, angles, elevation, up=up, margin=0.1, orthographic=orthographic, size=size)
        low = min(min(map(np.min, margins(camera, CLOUD, size))) for camera in cameras)
        assert 0.1 - 1e-9 <= low < 0.1 + 8e-3, f"{case}: a margin of {low}, not 0.1"


def test_a_number_spreads_the_cameras_from_the_default_side_on():
    cameras = Camera.orbit(CLOUD, 4)
    assert cameras == Camera.orbit(CLOUD, [35, 125, 215, 305])
    first = np.array(Camera.framing(CLOUD).view().forward)
    assert np.abs(cameras[0].view().forward - first).max() < 1e-12
    assert len(Camera.orbit(CLOUD)) == 36
    offset = np.array([1e9, -2e9, 5e8])  # costs no digits
    for a, b in zip(Camera.orbit(CLOUD, 3), Camera.orbit(CLOUD + offset, 3), strict=True):
        assert np.abs(np.array(b.position) - offset - a.position).max() < 1e-5
    wrong = [0, -1, [], "36", None, 10**9, [float("nan")], ["a"], 2.5, True]
    assert_refused(lambda each: Camera.orbit(CLOUD, each), [(each, "azimuth") for each in wrong], SceneError)
