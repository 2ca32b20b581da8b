"""Check the reference's light against closed forms of the illumination equation."""

import numpy as np
import pytest
from helpers.pinhole import QUAD, draw, layer, sheet_camera

from rasterizer.scene.lights import DirectionalLight
from rasterizer.scene.material import Material


@pytest.mark.parametrize("shading, degrees", [("flat", 20.0), ("gouraud", 44.0), ("phong", 0.0), ("phong", 60.0)])
def test_blinn_and_phong_are_their_closed_forms(shading, degrees):
    # seen along the normal: R.V = cos(angle), N.H = cos(angle / 2)
    angle = np.radians(degrees)
    lights = (DirectionalLight((-np.sin(angle), 0, -np.cos(angle)), (1.0, 0.8, 0.6)),)
    for reflection, cosine in (("phong", np.cos(angle)), ("blinn", np.cos(angle / 2))):
        material = Material(diffuse=(0.1, 0.2, 0.3), specular=(0.5, 0.4, 0.3), shininess=17, reflection=reflection)
        options = {"camera": sheet_camera(8), "lights": lights, "material": material, "shading": shading}
        picture = draw(layer((8, 8), 2.0, False), QUAD, (8, 8), **options)
        bare = np.array([0.1, 0.2, 0.3]) * np.cos(angle) + np.array([0.5, 0.4, 0.3]) * cosine**17
        np.testing.assert_allclose(picture.color, np.broadcast_to(bare * (1.0, 0.8, 0.6), (8, 8, 3)), rtol=1e-11)
