"""Cameras of a turntable: one distance, one target, and a view that holds the subject from every side, just so."""

import math

import numpy as np
import pytest

import rasterizer as rz

RANDOM = np.random.default_rng(5)
CLOUD = RANDOM.normal(size=(60, 3)) * (3.0, 1.0, 0.4) + (5.0, -2.0, 7.0)
SIZE = (300, 200)


def seen(camera, points, size=SIZE):
    """Where points lie in the picture, as shares of its width and height."""
    eye, right, up, forward = camera.view()
    scale_x, scale_y, center_x, center_y, is_perspective, _ = camera.projection(size)
    local = points - eye
    w = local @ forward if is_perspective else np.ones(len(points))
    assert not is_perspective or (w > 0).all()
    x = (center_x + scale_x * (local @ right) / w) / size[0]
    return x, (center_y - scale_y * (local @ up) / w) / size[1]


@pytest.mark.parametrize("up", ["x", "y", "z", "-x", "-y", "-z"])
@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("elevation", [-90, -20, 0, 25, 60, 90])
def test_every_camera_holds_the_subject_and_some_just_so(up, orthographic, elevation):
    angles = np.arange(0, 360, 3.0)
    cameras = rz.Camera.orbit(CLOUD, angles, elevation, up=up, margin=0.1, orthographic=orthographic, size=SIZE)
    reached = [np.abs(np.array(seen(camera, CLOUD)) - 0.5).max() for camera in cameras]
    assert max(reached) <= 0.4 + 1e-9, f"{max(reached)} > 0.4"
    assert max(reached) > 0.4 - 2e-3, f"{max(reached)}: further away than it must be"


@pytest.mark.parametrize("orthographic", [False, True])
def test_distance_target_and_height_are_the_same_for_all(orthographic):
    cameras = rz.Camera.orbit(CLOUD, 24, orthographic=orthographic, aspect=1.5)
    targets = np.array([camera.target for camera in cameras])
    distances = [math.dist(camera.position, camera.target) for camera in cameras]
    heights = np.array([camera.position for camera in cameras])[:, 1]
    assert np.ptp(distances) < 1e-12 * max(distances) and np.ptp(heights) < 1e-12 * np.abs(heights).max()
    middle = 0.5 * (CLOUD.min(axis=0) + CLOUD.max(axis=0))
    around = np.hypot(targets[:, 0] - middle[0], targets[:, 2] - middle[2])
    assert around.max() < 1e-12 and np.ptp(targets[:, 1]) < 1e-12, "one point of the axis"
    assert len({camera.height for camera in cameras}) == 1


def test_a_number_spreads_the_cameras_from_the_default_side_on():
    scene = rz.load(rz.demo_model())
    cameras = rz.Camera.orbit(scene, 4)
    assert cameras == rz.Camera.orbit(scene, [35, 125, 215, 305])
    first = np.array(rz.Camera.framing(scene).view().forward)
    assert np.abs(cameras[0].view().forward - first).max() < 1e-12
    assert len(rz.Camera.orbit(scene)) == 36


def test_a_far_offset_costs_no_digits():
    offset = np.array([1e9, -2e9, 5e8])
    near, far = (rz.Camera.orbit(CLOUD + move, 3) for move in (0.0 * offset, offset))
    for a, b in zip(near, far, strict=True):
        assert np.abs(np.array(b.position) - offset - a.position).max() < 1e-5


def test_one_point_is_framed_too():
    for camera in rz.Camera.orbit([[1.0, 2.0, 3.0]], 3):
        x, y = seen(camera, np.array([[1.0, 2.0, 3.0]]))
        assert abs(x[0] - 0.5) < 1e-9 and abs(y[0] - 0.5) < 1e-9


@pytest.mark.parametrize("azimuths", [0, -1, [], "36", None, 10**9, [float("nan")], ["a"], 2.5, True])
def test_illegal_azimuths(azimuths):
    with pytest.raises(rz.SceneError, match="azimuth"):
        rz.Camera.orbit(CLOUD, azimuths)


# --- what framing knows ---------------------------------------------------------------------------------------------


def test_framing_takes_the_up_axis_of_a_scene():
    mesh = rz.Mesh(CLOUD[:3], [[0, 1, 2]])
    scene = rz.Scene(mesh, up="z")
    assert rz.Camera.framing(scene) == rz.Camera.framing(mesh, up="z") != rz.Camera.framing(mesh)
    assert rz.Camera.framing(scene, up="y") == rz.Camera.framing(mesh)
    assert rz.Camera.orbit(scene, 2) == rz.Camera.orbit(mesh, 2, up="z")


def test_framing_takes_the_shape_of_a_size():
    assert rz.Camera.framing(CLOUD, size=(300, 200)) == rz.Camera.framing(CLOUD, aspect=1.5)
    assert rz.Camera.framing(CLOUD, size=64) == rz.Camera.framing(CLOUD, aspect=1.0)
    assert rz.Camera.framing(CLOUD) == rz.Camera.framing(CLOUD, size=rz.Options().size)
    with pytest.raises(rz.SceneError, match="size or its aspect; given 64 and 1.0"):
        rz.Camera.framing(CLOUD, size=64, aspect=1.0)
    for size in (0, (4, 0), "64", (1, 2, 3)):
        with pytest.raises(rz.SceneError, match="size must be"):
            rz.Camera.framing(CLOUD, size=size)
