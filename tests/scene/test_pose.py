"""Cameras from a pose, and those that look at a point."""

import numpy as np
import pytest

import rasterizer as rz

RANDOM = np.random.default_rng(7)


def rotation():
    q, _ = np.linalg.qr(RANDOM.normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


@pytest.mark.parametrize("scale", [1.0, 1e-6, 1e6])
def test_a_pose_comes_back(scale):
    for _ in range(20):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation(), RANDOM.normal(size=3) * scale
        camera = rz.Camera.from_pose(pose, fov=50)
        assert camera.fov == 50 and np.abs(camera.pose - pose).max() <= 4e-15 * max(scale, 1.0)


def test_the_frame_of_opencv_is_turned_over():
    pose, flip = np.eye(4), np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, :3], pose[:3, 3] = rotation(), (1, 2, 3)
    turned = rz.Camera.from_pose(pose @ flip, frame="opencv")
    assert np.abs(turned.pose - pose).max() < 1e-14
    K, R, t = turned.to_opencv((64, 48))
    by_calibration = np.eye(4)
    by_calibration[:3, :3], by_calibration[:3, 3] = R.T, -R.T @ t
    assert np.abs(by_calibration - pose @ flip).max() < 1e-14


def test_what_a_pose_sees():
    """The eye at (0, 0, 5), as it is: looking down -z at the origin."""
    pose = np.eye(4)
    pose[2, 3] = 5.0
    triangle = rz.Mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], [[0, 1, 2]])
    by_pose, by_eye = (
        rz.render(triangle, 32, camera=camera)
        for camera in (rz.Camera.from_pose(pose), rz.Camera.perspective((0, 0, 5)))
    )
    assert by_pose.stats.covered > 0 and (by_pose.rgba == by_eye.rgba).all()
    assert rz.Camera.from_pose(pose, height=2.0).height == 2.0


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        (np.eye(3), r"the pose must be finite numbers of the shape \(4, 4\)"),
        (np.eye(4) * np.nan, "the pose must be finite"),
        (np.diag([1.0, 1, 1, 2]), r"the pose's last row must be \(0, 0, 0, 1\); given"),
        (np.diag([2.0, 2, 2, 1]), r"the pose's upper left \(3, 3\) must be a rotation"),
        (np.diag([1.0, 1, -1, 1]), "must be a rotation"),
        (None, "the pose must be finite"),
        ("pose", "the pose must be finite"),
    ],
)
def test_illegal_poses(pose, words):
    with pytest.raises(rz.SceneError, match=words):
        rz.Camera.from_pose(pose)


def test_a_frame_is_a_word():
    with pytest.raises(rz.SceneError, match="the pose's frame must be one of 'opengl', 'opencv'; given 'gl'"):
        rz.Camera.from_pose(np.eye(4), frame="gl")


def test_look_at_is_with_perspective_unless_a_height_is_given():
    assert rz.Camera.look_at((1, 2, 3)) == rz.Camera.perspective((1, 2, 3))
    assert rz.Camera.look_at((1, 2, 3), (0, 1, 0), "z", height=4) == rz.Camera.orthographic(
        (1, 2, 3), (0, 1, 0), "z", height=4
    )
    with pytest.raises(rz.SceneError, match="either fov"):
        rz.Camera.look_at((1, 2, 3), fov=30, height=4)
