"""Cameras on a circle: everything is seen in every frame, and from no nearer can it be."""

import math

import numpy as np
import pytest
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.cli.orbit import orbit_cameras

AZIMUTHS = [10.0 + 30 * k for k in range(12)]


def shares(cameras, points, aspect):
    """How far the points reach in each picture, (n, 2): 1 = to its edge."""
    found = []
    for camera in cameras:
        view, lens = camera.view(), camera.projection((100 * aspect, 100))
        local = points - view.eye
        w = local @ view.forward if camera.is_perspective else 1.0
        x, y = lens.scale_x * (local @ view.right) / w, lens.scale_y * (local @ view.up) / w
        found.append((np.abs(x).max() / (50 * aspect), np.abs(y).max() / 50))
    return np.array(found)


def points_of(name):
    return np.concatenate([mesh.used_vertices for mesh in rz.load(ROOT / "models" / name).meshes])


@pytest.mark.parametrize("elevation", [-90.0, -35.0, 0.0, 25.0, 80.0])
@pytest.mark.parametrize("aspect", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("name", ["gear.obj", "still_life.obj"])
def test_all_is_seen_from_the_smallest_distance(elevation, aspect, orthographic, name):
    points = points_of(name)
    cameras = orbit_cameras(points, AZIMUTHS, elevation=elevation, fov=30.0, up="y", aspect=aspect,
                            margin=0.05, orthographic=orthographic)  # fmt: skip
    reach = shares(cameras, points, aspect).max()
    assert reach == pytest.approx(0.9, abs=1e-6), f"the model reaches to {reach:.4f} of the edge"
    distances = [math.dist(camera.position, camera.target) for camera in cameras]
    assert np.ptp(distances) < 1e-9 * max(distances) and len({camera.target for camera in cameras}) == 1


@pytest.mark.parametrize("up", ["x", "z", "-y"])
def test_the_up_axis_stands_upright(up):
    points = points_of("gear.obj") * (1, 2, 3) + (5, -7, 1)
    for camera in orbit_cameras(points, AZIMUTHS, elevation=20.0, fov=40.0, up=up, aspect=1.0):
        assert camera.view().right @ np.array(rz.Camera.orthographic((9, 8, 7), up=up).up) == pytest.approx(
            0, abs=1e-12
        )


@pytest.mark.parametrize("points", [np.zeros((1, 3)), np.ones((4, 3)), np.array([[0, 0, 0], [0, 9, 0]], float)])
def test_a_point_and_a_line_can_be_turned(points):
    for camera in orbit_cameras(points, [0.0, 90.0], elevation=0.0, fov=30.0, up="y", aspect=1.0):
        assert np.isfinite(camera.position).all()


def test_illegal_values_are_refused():
    for bad in ({"elevation": 91.0}, {"fov": 180.0}, {"fov": 0.0}, {"margin": 0.5}, {"aspect": 0.0}):
        settings = {"elevation": 0.0, "fov": 30.0, "up": "y", "aspect": 1.0} | bad
        with pytest.raises(rz.SceneError):
            orbit_cameras(np.eye(3), [0.0], **settings)
