"""`rz.explain`: the reference's account of a pixel, for what the words of a picture say."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.pinhole import octasphere

import rasterizer as rz
from rasterizer.reference import explain as explaining

SIZE = (40, 30)
CAMERA = rz.Camera.perspective((0, 0, 4), fov=40)
LIGHT = rz.DirectionalLight((0.2, -0.3, -1))


def ball(**material):
    return rz.Scene([rz.Mesh(*octasphere(3), crease_angle=180, material=rz.Material(**material))], [LIGHT], CAMERA)


def test_it_is_what_the_reference_says():
    scene, options = ball(specular=0.3, opacity=0.5), {"shading": "phong", "samples": 4}
    assert rz.explain(scene, 18, 13, SIZE, **options) == explaining.explain(
        scene, 18, 13, rz.Options(size=SIZE, **options)
    )


def test_a_camera_of_its_own_and_the_value_of_the_picture():
    camera = rz.Camera.orthographic((1, 2, 4), height=3)
    frame = rz.render(replace(ball(), camera=camera), SIZE, shading="phong", tolerance=0, samples=1)
    for x, y in ((20, 15), (17, 12), (24, 19)):
        found = rz.explain(ball(), x, y, SIZE, camera=camera, shading="phong", tolerance=0, samples=1)
        error = np.abs(np.array(dict(found.rows)["linear"]) - frame.color[y, x]).max()
        assert error <= frame.stats.error_bound + 1e-7, f"{error:.3g} > {frame.stats.error_bound:.3g}"


def test_a_pixel_outside_is_refused():
    for x, y in ((-1, 0), (40, 0), (0, 30), (1.5, 0), ("a", 0)):
        with pytest.raises(rz.SceneError, match="within 0..(39|29)"):
            rz.explain(ball(), x, y, SIZE, samples=1)
