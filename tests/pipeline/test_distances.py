"""Check how far away a sample counts as: what is lit from nearby tells it, in every kind of view."""

import numpy as np
import pytest

import rasterizer as rz
from rasterizer import reference

SIZE = 48, 32
WHITE = rz.Material(diffuse=0.8, specular=0.0)


def lit(mesh, camera, lamp, **options):
    """(picture, that of the reference) of a mesh under one lamp by Phong's method."""
    scene = rz.Scene(mesh, lamp, camera)
    frame = rz.render(scene, SIZE, shading="phong", threads=1, outputs=("color", "depth"), **{"samples": 1} | options)
    return frame, reference.render(scene, SIZE, shading="phong")


@pytest.mark.parametrize("away", [0.0, 2.0**-30, 1.0, 7.0])
@pytest.mark.parametrize("is_perspective", [True, False])
def test_a_square_across_the_view_has_one_depth(is_perspective, away):
    """Also where there is no range of depths, and where the one depth is 0: zeros don't tell which kind it is."""
    square = rz.Mesh([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], [[0, 1, 2], [0, 2, 3]], material=WHITE)
    camera = rz.Camera.orthographic((0, 0, away), (0, 0, away - 1), height=3.0)
    if is_perspective:
        camera = rz.Camera.perspective((0, 0, max(away, 2.0**-10)), (0, 0, -1), fov=60)
    lamp = rz.PointLight((0.3, 0.2, 1.0), 1.0, attenuation=(0, 0, 1))
    frame, exact = lit(square, camera, lamp)
    assert np.ptp(exact.color) > (0.1 if away > 0.5 or not is_perspective else 0.0)
    assert frame.stats.plan.dtype == "float32"
    error = np.abs(frame.color - exact.color).max()
    assert error <= frame.stats.error_bound + 1e-7, f"{error} > {frame.stats.error_bound}"


@pytest.mark.parametrize("deep", [1e2, 1e4, 1e6, 1e8])
@pytest.mark.parametrize("reach", [1.0, 30.0])
def test_a_deep_scene_says_how_far_its_nearest_surface_is_without_perspective(deep, reach):
    """The z-buffer's steps are those of the whole range, and a lamp next to the eye lights what is nearest."""
    slope = np.array([[-reach, -reach, -0.1], [reach, -reach, -0.2], [0, 2 * reach, -0.3]])
    floor = np.array([[-1, -1, -deep], [1, -1, -deep], [0, 1, -0.5 * deep]])
    mesh = rz.Mesh(np.concatenate([slope, floor]), [[0, 1, 2], [3, 4, 5]], material=WHITE)
    lamp = rz.PointLight((0.0, 0.0, -0.05), 1.0, attenuation=(0, 0, 100))
    frame, exact = lit(mesh, rz.Camera.orthographic((0, 0, 0), (0, 0, -1), height=0.5), lamp)
    assert np.ptp(exact.color) > 0.1 * exact.color.max() > 0
    error = np.abs(frame.color - exact.color).max()
    assert error <= frame.stats.error_bound + 1e-7, f"{error} > {frame.stats.error_bound}"
