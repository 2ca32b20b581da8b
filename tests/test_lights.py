"""Lights: normal forms, refusals, and the ready-made sets."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rasterizer.errors import SceneError
from rasterizer.scene.lights import AmbientLight, DirectionalLight, PointLight, headlight, studio
from rasterizer.scene.material import Material

_numbers = st.floats(-1e300, 1e300, allow_nan=False)


def test_defaults():
    assert AmbientLight().color == (1.0, 1.0, 1.0)
    light = PointLight((1, 2, 3))
    assert light == PointLight((1.0, 2.0, 3.0), 1.0, (1, 0, 0), "world", False)
    assert light.attenuation == (1.0, 0.0, 0.0) and not light.amplify
    assert DirectionalLight((0, 0, -2)).direction == (0.0, 0.0, -1.0)


@given(st.tuples(_numbers, _numbers, _numbers).filter(any))
def test_directions_become_unit_vectors(direction):
    unit = np.array(DirectionalLight(direction).direction)
    assert np.linalg.norm(unit) == pytest.approx(1.0, abs=1e-15)
    largest = max(map(abs, direction))
    scaled = np.array(direction) / largest
    assert unit == pytest.approx(scaled / np.linalg.norm(scaled), abs=1e-12)


def test_arrays_are_taken_and_lights_are_hashable():
    light = DirectionalLight(np.array([0, 3, 4]), color=np.array([1, 0.5, 0], dtype=np.float32))
    assert light.direction == (0.0, 0.6, 0.8) and light.color == (1.0, 0.5, 0.0)
    assert len({light, light, PointLight(np.zeros(3))}) == 2


@pytest.mark.parametrize(
    "wrong", [(0, 0, 0), (0, math.nan, 1), (math.inf, 0, 0), (1, 2), 5, "up", None, (True, 0, 1)]
)
def test_illegal_directions_name_the_light(wrong):
    with pytest.raises(SceneError, match="directional light's direction"):
        DirectionalLight(wrong)


@pytest.mark.parametrize("wrong", [(0, 0, 0), (-1, 0, 0), (1, 0, math.nan), (1, 0), 1.0])
def test_illegal_attenuations(wrong):
    with pytest.raises(SceneError, match="attenuation"):
        PointLight((0, 0, 0), attenuation=wrong)


def test_other_illegal_values():
    with pytest.raises(SceneError, match="point light's position"):
        PointLight((0, 0, math.inf))
    with pytest.raises(SceneError, match="attached.*'world', 'camera'.*'moon'"):
        PointLight((0, 0, 0), attached="moon")
    with pytest.raises(SceneError, match="attached"):
        DirectionalLight((0, 0, 1), attached=None)
    for make in (AmbientLight, lambda c: PointLight((0, 0, 0), c), lambda c: DirectionalLight((0, 0, 1), c)):
        with pytest.raises(SceneError, match="light's color must not be negative"):
            make(-1.0)


@pytest.mark.parametrize("lights", [studio(), headlight()])
def test_ready_made_sets_are_neutral_and_move_with_the_camera(lights):
    assert any(isinstance(light, AmbientLight) for light in lights)
    for light in lights:
        assert len(set(light.color)) == 1
        assert isinstance(light, AmbientLight) or light.attached == "camera"


def test_studio_comes_from_where_it_says():
    _, key, fill, rim = studio()
    assert key.direction[0] > 0 and key.direction[1] < 0 and key.direction[2] < 0  # from upper left, in front
    assert fill.direction[0] < 0 and fill.direction[2] < 0 and max(fill.color) < max(key.color)
    assert rim.direction[2] > 0 and rim.direction[1] < 0  # from behind and above


@pytest.mark.parametrize("lights", [studio(), headlight()])
def test_ready_made_sets_neither_clip_nor_leave_black(lights):
    """The default material, seen from +z, over all normals that face the viewer."""
    material = Material()
    u, v = np.meshgrid(np.linspace(-1, 1, 201), np.linspace(-1, 1, 201))
    z = np.sqrt(np.maximum(1.0 - u**2 - v**2, 0.0))
    normals = np.stack([u, v, z], axis=2)[u**2 + v**2 <= 1.0]
    total = np.zeros(len(normals))
    for light in lights:
        if isinstance(light, AmbientLight):
            total += material.ambient[0] * light.color[0]
            continue
        to_light = -np.array(light.direction)
        n_dot_l = normals @ to_light
        r_dot_v = np.clip(2.0 * n_dot_l * normals[:, 2] - to_light[2], 0.0, None)
        lit = n_dot_l > 0.0
        spec = material.specular[0] * r_dot_v**material.shininess
        total += light.color[0] * lit * (material.diffuse[0] * n_dot_l + spec)
    assert 0.05 < total.min() and 0.6 < total.max() <= 1.0, (total.min(), total.max())
