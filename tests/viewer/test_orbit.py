"""The viewer's camera: what lies in the pivot's plane stays below the pointer, and nothing drifts."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import deviations, differences

import rasterizer as rz
from rasterizer.viewer.orbit import FURTHEST, NEAREST, Orbit

SIZE = (80, 60)
CUBE = rz.Mesh([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], [[0, 1, 3], [4, 6, 7], [0, 4, 5]])
SCENE = rz.Scene(CUBE)
CAMERAS = {
    "framed": rz.Camera.framing(SCENE),
    "orthographic": rz.Camera.framing(SCENE, orthographic=True),
    "from above": rz.Camera.framing(SCENE, elevation=90.0),
    "tilted": rz.Camera.perspective((5, 4, 3), (0, 1, 0), up=(1, 1, 0)),
    "skewed": rz.Camera.from_opencv([[50, 35, 30], [0, 55, 33], [0, 0, 1]], np.diag([1, -1, -1]), (0, 1, 9), SIZE),
    "calibrated": rz.Camera.from_opencv([[50, 0, 30], [0, 55, 33], [0, 0, 1]], np.diag([1, -1, -1]), (0, 1, 9), SIZE),
}


@pytest.fixture(params=CAMERAS)
def orbit(request):
    return Orbit.of(CAMERAS[request.param], SCENE)


def assert_same_view(a, b, within=1e-9):
    for ours, theirs in zip(a.view(), b.view(), strict=True):
        assert np.abs(ours - theirs).max() <= within, (a, b)


def test_a_camera_that_is_not_moved_stays_the_one_that_was_given(orbit):
    assert orbit.camera is orbit.lens
    assert_same_view(orbit.panned(0, 0, SIZE).camera, orbit.lens)
    assert_same_view(orbit.turned(0, 0).camera, orbit.lens)


def test_turning_there_and_back_is_the_camera_before_and_keeps_the_pivot(orbit):
    away = -20 if orbit.axes[2] @ orbit.pole < -0.9 else 20  # from a pole there is one way only
    assert_same_view(orbit.turned(0, away).turned(50, 0).turned(-50, 0).turned(0, -away).camera, orbit.lens)
    turned = orbit.turned(33, 12)
    assert not differences(turned.pivot, orbit.pivot)
    assert math.dist(turned.camera.position, turned.pivot) == pytest.approx(orbit.distance)


def test_turning_is_that_of_azimuth_and_elevation():
    for up in ("y", "z", "-x"):
        scene = rz.Scene(CUBE, up=up)
        start = rz.Camera.framing(scene, 10, 20, up=up)
        turned = Orbit.of(start, scene).turned(30, 15).camera
        _, *axes = rz.Camera.framing(scene, 40, 35, up=up).view()
        assert np.allclose(turned.view()[1:], axes, atol=1e-12), up


def test_the_camera_stops_above_and_below_and_comes_back_level():
    orbit = Orbit.of(CAMERAS["framed"], SCENE)
    for step in (400, -400):
        pole = orbit.turned(0, step)
        assert pole.axes[2] @ pole.pole == pytest.approx(-np.sign(step))
        again = pole.turned(25, -np.sign(step) * 30)
        assert again.axes[0] @ again.pole == pytest.approx(0, abs=1e-12)


def test_thousands_of_turns_leave_the_axes_at_right_angles():
    orbit = Orbit.of(CAMERAS["tilted"], SCENE)
    rng = np.random.default_rng(1)
    for azimuth, elevation in rng.normal(0, 5, (1000, 2)):
        orbit = orbit.turned(azimuth, elevation)
    assert np.abs(orbit.axes @ orbit.axes.T - np.eye(3)).max() <= 1e-14


def test_what_is_dragged_sideways_stays_below_the_pointer(orbit):
    before = orbit.position_of(orbit.pivot, SIZE)
    after = orbit.panned(7, -4, SIZE).position_of(orbit.pivot, SIZE)
    assert not deviations(np.subtract(after, before), (7, -4), atol=1e-09)


def test_zooming_keeps_what_is_below_the_pointer(orbit):
    at = np.array((20.0, 50.0))
    across, down = at - orbit.position_of(orbit.pivot, SIZE)
    point = orbit.panned(-across, -down, SIZE).pivot  # in the pivot's plane, below the pointer
    other = point + 0.01 * orbit.axes[0]
    for factor in (1.5, 0.4):
        zoomed = orbit.zoomed(factor, *at, SIZE)
        assert np.allclose(zoomed.position_of(point, SIZE), at, atol=1e-9), factor
        grown = (zoomed.position_of(other, SIZE)[0] - at[0]) / (orbit.position_of(other, SIZE)[0] - at[0])
        assert grown == pytest.approx(factor)


def test_zooming_has_an_end_either_way(orbit):
    for _ in range(60):
        orbit = orbit.zoomed(50, 40, 30, SIZE)
    near = orbit.distance if orbit.lens.is_perspective else orbit.lens.height
    for _ in range(60):
        orbit = orbit.zoomed(1 / 50, 40, 30, SIZE)
    far = orbit.distance if orbit.lens.is_perspective else orbit.lens.height
    assert (near, far) == pytest.approx((NEAREST * orbit.extent, FURTHEST * orbit.extent))
    assert orbit.camera.position != orbit.camera.target


@pytest.mark.parametrize("name", ["framed", "orthographic"])
def test_the_other_projection_shows_the_pivot_as_large(name):
    orbit = Orbit.of(CAMERAS[name], SCENE)
    other = orbit.with_other_projection()
    assert other.lens.is_perspective is not orbit.lens.is_perspective
    edge = orbit.pivot + 0.5 * orbit.axes[1]
    assert not deviations(other.position_of(edge, SIZE), orbit.position_of(edge, SIZE))
    assert_same_view(other.with_other_projection().camera, orbit.camera, 1e-9 if name == "framed" else np.inf)


def test_a_cameras_aspect_stays_when_it_is_turned_and_loses_its_perspective():
    orbit = Orbit.of(replace(CAMERAS["framed"], aspect=3.0), SCENE)
    other = orbit.turned(10, 5).with_other_projection()
    assert other.camera.aspect == 3.0 and other.with_other_projection().camera.aspect == 3.0
    edge, narrow = other.pivot + 0.5 * other.axes[1], (SIZE[0], 4 * SIZE[0])
    assert not deviations(other.position_of(edge, narrow), orbit.turned(10, 5).position_of(edge, narrow))


def test_a_lens_comes_back_with_its_perspective():
    wide = replace(rz.Camera.perspective((5, 4, 3), (0, 1, 0), fov=40), near=4.0, far=100.0)
    names = ("fov", "near", "far", "intrinsics", "size", "skew", "aspect")
    for camera in (wide, *CAMERAS.values()):
        orbit = Orbit.of(camera, SCENE).turned(10, -5)
        other = orbit.with_other_projection()
        assert (other.lens.near, other.lens.far) == (camera.near, camera.far)
        again = other.with_other_projection().camera
        for name in names if camera.is_perspective else ():
            assert getattr(again, name) == pytest.approx(getattr(camera, name)), f"{name} of {camera}"
    flat = replace(rz.Camera.orthographic((0, 0, 50), (0, 0, 0), height=2.0), near=-10.0, far=100.0)
    deep = Orbit.of(flat, SCENE).with_other_projection()
    assert deep.lens.near is None and deep.lens.far == pytest.approx(50 + deep.distance)


def test_a_point_behind_the_eye_is_nowhere():
    orbit = Orbit.of(CAMERAS["framed"], SCENE)
    eye, *_, forward = orbit.camera.view()
    assert orbit.position_of(eye - forward, SIZE) is None


def test_scenes_of_any_unit_can_be_turned():
    expected = Orbit.of(CAMERAS["framed"], SCENE).turned(10, 10).zoomed(2, 0, 0, SIZE)
    for scale in (1e-60, 1e60):
        small = rz.Scene(rz.Mesh(scale * CUBE.vertices, CUBE.faces))
        orbit = Orbit.of(rz.Camera.framing(small), small).turned(10, 10).zoomed(2, 0, 0, SIZE)
        assert np.allclose(np.divide(orbit.camera.position, scale), expected.camera.position), scale
