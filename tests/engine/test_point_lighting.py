"""Check the illumination equation at points: closed forms, the judge, the renderer's own values, and the border."""

from dataclasses import replace

import numpy as np
import pytest

import rasterizer as rz
from rasterizer.errors import SceneError

UP = (0.0, 0.0, 1.0)
WHITE = rz.Material(diffuse=1.0, ambient=1.0, specular=0.0)
SHINY = rz.Material(diffuse=(0.5, 0.3, 0.1), specular=0.4, shininess=9, emissive=(0, 0.01, 0.02))
LIGHTS = (
    rz.AmbientLight((0.1, 0.1, 0.2)), rz.DirectionalLight((-1, -0.4, -1), (0.7, 0.6, 0.5)),
    rz.PointLight((2, 3, 3), 0.4, "1/(d+1)"),
    rz.SpotLight((0, 0, 4), (0, 0, -1), "orange", 5, 40, 2.0, falloff=2.5),
    rz.AreaLight((1, 1, 3), (1, 0, 0), (0, 1, 0), 0.5),
)  # fmt: skip


def test_closed_forms():
    sun = rz.DirectionalLight((0, 0, -1))
    assert rz.illuminate((0, 0, 0), UP, WHITE, sun, toward_viewer=UP).tolist() == [1, 1, 1]
    assert rz.illuminate((0, 0, 0), UP, WHITE, rz.AmbientLight((0.1, 0.2, 0.3)), (0, 0, 5)) == pytest.approx(
        (0.1, 0.2, 0.3), abs=1e-15
    )
    glow, hued = (
        rz.Material(diffuse=0, specular=0, emissive=(1, 0.5, 0)),
        [replace(sun, color=hue) for hue in np.eye(3)],
    )
    assert rz.illuminate((0, 0, 0), UP, glow, hued, toward_viewer=UP).tolist() == [1, 0.5, 0]
    a = np.radians(np.linspace(0, 180, 19))
    normals = np.stack([np.sin(a), 0 * a, np.cos(a)], axis=1)
    found = rz.illuminate((0, 0, 0), 7 * normals, WHITE, sun, (0, 0, 5))
    assert np.abs(found - np.maximum(np.cos(a), 0)[:, None]).max() < 1e-15 * 2
    distance = np.array([0.5, 1.0, 2.0, 10.0])
    points = np.stack([0 * distance, 0 * distance, -distance], axis=1)
    for form, expected in (
        ("1", 1 + 0 * distance),
        ("1/d^2", np.minimum(1, distance**-2)),
        ("1/(d+3)", 1 / (distance + 3)),
    ):
        found = rz.illuminate(points, UP, WHITE, rz.PointLight((0, 0, 0), 1, form), toward_viewer=UP)
        assert np.abs(found - expected[:, None]).max() < 1e-15, form
    colored = rz.illuminate((0, 0, 0), UP, rz.Material(diffuse=(0.9, 0.3, 0.1), specular=0), sun, toward_viewer=UP)
    assert colored == pytest.approx((0.9, 0.3, 0.1), abs=1e-16), "digits beyond float32 are lost"


def test_shapes_viewers_and_sides():
    points = np.zeros((4, 5, 3))
    assert rz.illuminate(points, UP, "gold", LIGHTS, (0, 0, 5)).shape == (4, 5, 3)
    assert rz.illuminate((0, 0, 0), points + UP, SHINY, LIGHTS, (0, 0, 5)).shape == (4, 5, 3)
    assert rz.illuminate(np.zeros((0, 3)), UP, SHINY, LIGHTS, (0, 0, 5)).shape == (0, 3)
    sun = rz.DirectionalLight((0, 0, -1))
    assert rz.illuminate((0, 0, 0), (0, 0, -1), WHITE, sun, (0, 0, 5)).max() == 0
    assert rz.illuminate((0, 0, 0), (0, 0, -1), WHITE, sun, (0, 0, 5), two_sided=True).min() == 1
    assert rz.illuminate((0, 0, 0), UP, WHITE, sun, (0, 0, 5), exposure=2).tolist() == [4, 4, 4]
    moving, camera = rz.studio(), rz.Camera.perspective((3, 2, 5))
    lit = rz.illuminate((0, 0, 0), (3, 2, 5), rz.Material(), moving, camera)
    assert 0.3 < lit.max() < 1
    # An area light is the mean of its cells, and a shadow has no part.
    area = rz.AreaLight((1, 1, 3), (1, 0, 0), (0, 1, 0), 0.5, shadow=True)
    assert rz.illuminate((0, 0, 0), UP, SHINY, area, (0, 0, 5)) == pytest.approx(
        rz.illuminate((0, 0, 0), UP, SHINY, area.cells(), (0, 0, 5)), abs=1e-15
    )


FAULTS = [
    ({"points": (0, 0)}, "points must be"),
    ({"points": (0, 0, np.nan)}, "points must be"),
    ({"points": "origin"}, "points must be"),
    ({"normals": (0, 0, 0)}, "normals must have a length"),
    ({"points": np.zeros((2, 3)), "normals": np.ones((3, 3))}, "must fit each other"),
    ({"material": "goldd"}, "a named material is one of"),
    ({"material": 3}, "must be a Material"),
    ({"material": rz.Material(texture=np.eye(2))}, "no texture"),
    ({"material": rz.Material(reflection="cook-torrance", roughness=(0.1, 0.2))}, "needs tangents"),
    ({"lights": [3]}, "lights must be"),
    ({"lights": 3}, "lights must be"),
    ({"lights": rz.studio()}, "must be a Camera"),
    ({"viewer": None}, "give either viewer"),
    ({"toward_viewer": UP}, "give either viewer"),
    ({"viewer": (0, 0)}, "the viewer must be three"),
    ({"viewer": None, "toward_viewer": (0, 0, 0)}, "toward_viewer must have a length"),
    ({"spectral": 2}, "spectral must be"),
    ({"exposure": 100}, "exposure must be"),
]


def test_faults_are_named_at_the_border():
    for wrong, words in FAULTS:
        given = {"points": (0, 0, 0), "normals": UP, "material": SHINY, "lights": LIGHTS, "viewer": (0, 0, 5)} | wrong
        with pytest.raises(SceneError, match=words):
            rz.illuminate(**given)
