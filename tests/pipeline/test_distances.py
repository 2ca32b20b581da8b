"""Check how far away a sample counts as: what is lit from nearby tells it, in every kind of view."""

import numpy as np

import rasterizer as rz
from rasterizer import reference

SIZE = 48, 32
WHITE = rz.Material(diffuse=0.8, specular=0.0)


def lit(mesh, camera, lamp, **options):
    """(picture, that of the reference) of a mesh under one lamp by Phong's method."""
    scene = rz.Scene(mesh, lamp, camera)
    frame = rz.render(scene, SIZE, shading="phong", threads=1, outputs=("color", "depth"), **{"samples": 1} | options)
    return frame, reference.render(scene, SIZE, shading="phong")


def assert_within_bound(frame, exact, case):
    error = np.abs(frame.color - exact.color).max()
    assert error <= frame.stats.error_bound + 1e-7, f"{case}: {error:.3g} > {frame.stats.error_bound:.3g}"


def test_a_square_across_the_view_has_one_depth():
    """Also where there is no range of depths, and where the one depth is 0: zeros don't tell which kind it is."""
    square = rz.Mesh([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], [[0, 1, 2], [0, 2, 3]], material=WHITE)
    lamp = rz.PointLight((0.3, 0.2, 1.0), 1.0, attenuation=(0, 0, 1))
    for away in (0.0, 2.0**-30, 1.0, 7.0):
        parallel = rz.Camera.orthographic((0, 0, away), (0, 0, away - 1), height=3.0)
        for camera in (parallel, rz.Camera.perspective((0, 0, max(away, 2.0**-10)), (0, 0, -1), fov=60)):
            frame, exact = lit(square, camera, lamp)
            assert np.ptp(exact.color) > (0.1 if away > 0.5 or camera is parallel else 0.0)
            assert frame.stats.plan.dtype == "float32"
            assert_within_bound(frame, exact, f"depth {away}, {camera}")
