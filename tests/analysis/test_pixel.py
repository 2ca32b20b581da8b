"""`rz.explain`: the reference's account of a pixel, and the way that the renderer takes to it."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.pinhole import octasphere

import rasterizer as rz
from rasterizer.reference import explain as explaining

SIZE = (40, 30)
CAMERA = rz.Camera.perspective((0, 0, 4), fov=40)
LIGHT = rz.DirectionalLight((0.2, -0.3, -1))
MIDDLE = (20, 15)


def ball(**material):
    return rz.Scene([rz.Mesh(*octasphere(3), crease_angle=180, material=rz.Material(**material))], [LIGHT], CAMERA)


def test_the_path_of_a_pixel_is_told():
    for options, path in (
        ({"shading": "flat"}, "packed entry"),
        ({"shading": "gouraud", "tolerance": 0.01}, "packed entry"),
        ({"shading": "phong"}, "plane record"),
        ({"shading": "phong", "tolerance": 0}, "exact record"),
        ({"shading": "flat", "samples": 4}, "packed entry"),
    ):
        found = rz.explain(ball(), *MIDDLE, SIZE, **{"samples": 1} | options)
        assert found.path == path and f"drawn by: {path}" in str(found), f"{options}: {found.path}"
        # The picture's own counts know the path, too.
        counts = rz.render(ball(), SIZE, **{"samples": 1} | options).stats.plan.paths
        used = {"packed entry": counts.entries, "plane record": counts.planes, "exact record": counts.exact}
        assert used[path] > 0, options


def test_all_else_is_what_the_reference_says():
    scene, options = ball(specular=0.3, opacity=0.5), {"shading": "phong", "samples": 4}
    found = rz.explain(scene, 18, 13, SIZE, **{"samples": 1} | options)
    expected = explaining.explain(scene, 18, 13, rz.Options(size=SIZE, **options))
    assert replace(found, path=None) == expected and expected.path is None
    assert found.path == "plane record"


def test_a_camera_of_its_own_and_the_value_of_the_picture():
    camera = rz.Camera.orthographic((1, 2, 4), height=3)
    frame = rz.render(replace(ball(), camera=camera), SIZE, shading="phong", tolerance=0, samples=1)
    for x, y in ((20, 15), (17, 12), (24, 19)):
        found = rz.explain(ball(), x, y, SIZE, camera=camera, shading="phong", tolerance=0, samples=1)
        error = np.abs(np.array(found.linear) - frame.color[y, x]).max()
        assert error <= frame.stats.error_bound + 1e-7, f"{error:.3g} > {frame.stats.error_bound:.3g}"


def test_a_pixel_outside_is_refused_and_one_that_shows_nothing_has_no_way():
    assert rz.explain(ball(), 0, 0, SIZE, samples=1).path is None
    for x, y in ((-1, 0), (40, 0), (0, 30), (1.5, 0), ("a", 0)):
        with pytest.raises(rz.SceneError, match="within 0..(39|29)"):
            rz.explain(ball(), x, y, SIZE, samples=1)
