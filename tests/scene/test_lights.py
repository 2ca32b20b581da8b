"""Lights: normal forms, refusals, and the ready-made sets."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rasterizer.errors import SceneError
from rasterizer.scene.light_presets import headlight, studio
from rasterizer.scene.lights import AmbientLight, AreaLight, DirectionalLight, PointLight, SpotLight
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


@pytest.mark.parametrize("wrong", [(0, 0, 0), (0, math.nan, 1), (math.inf, 0, 0), (1, 2), 5, "up", None, (True, 0, 1)])
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


SPOT, AREA = (
    {"position": (0, 1, 2), "direction": (0, 0, -3)},
    {"corner": (0, 3, 0), "edge_u": (2, 0, 0), "edge_v": (0, 0, 1)},
)


def test_spot_and_area_defaults():
    spot = SpotLight(**SPOT)
    assert spot.direction == (0.0, 0.0, -1.0) and (spot.inner, spot.outer, spot.exponent) == (24.0, 30.0, 0.0)
    assert spot.range is None and not spot.amplify
    assert AreaLight(**AREA).resolution == (4, 4) and len(AreaLight(**AREA).cells()) == 16


@pytest.mark.parametrize("written, legal", [
    ("1", (1, 0, 0)), ("1/d", (0, 1, 0)), ("1/(d+2.5)", (2.5, 1, 0)), ("1 / (d + 3e2)", (300, 1, 0)),
    ("1/d^2", (0, 0, 1)), ("1/d²", (0, 0, 1)), ((1, 2, 3), (1, 2, 3)),
])  # fmt: skip
def test_attenuation_in_all_written_forms(written, legal):
    for light in (PointLight((0, 0, 0), attenuation=written), SpotLight(**SPOT, attenuation=written)):
        assert light.attenuation == legal and all(isinstance(c, float) for c in light.attenuation)


@pytest.mark.parametrize("wrong", ["", "d", "1/d^3", "1/(d-2)", "1/(d+-2)", "1/(d+inf)", "1/(d+)", "2/d"])
def test_illegal_attenuations_as_text(wrong):
    with pytest.raises(SceneError, match="area light's attenuation"):
        AreaLight(**AREA, attenuation=wrong)


@pytest.mark.parametrize("settings, message", [
    ({"direction": (0, 0, 0)}, "spot light's direction"), ({"position": (0, math.nan, 0)}, "spot light's position"),
    ({"inner": 40}, r"inner angle must be within 0..outer = 30 degrees; given 40"), ({"inner": -1}, "inner"),
    ({"outer": 0}, "outer"), ({"outer": 91}, "outer"), ({"exponent": -1}, "exponent"),
    ({"exponent": math.inf}, "exponent"),
    ({"falloff": 0}, "falloff"), ({"falloff": math.nan}, "falloff"),
    ({"color": -1}, "spot light's color"), ({"range": 0}, "spot light's range"), ({"range": math.inf}, "range"),
    ({"attached": "wall"}, "spot light's attached"), ({"color": (1, math.nan, 1)}, "color"),
])  # fmt: skip
def test_illegal_spot_lights_name_the_light(settings, message):
    with pytest.raises(SceneError, match=message):
        SpotLight(**{**SPOT, **settings})


@pytest.mark.parametrize("settings, message", [
    ({"resolution": (0, 4)}, "resolution.*1 to 64; given"), ({"resolution": 4}, "resolution"),
    ({"resolution": (2, 65)}, "resolution"),
    ({"resolution": (2.0, 2)}, "resolution"), ({"edge_u": (0, 0, 0)}, "edge_u"), ({"edge_v": (-4, 0, 0)}, "parallel"),
    ({"corner": (1, 2)}, "corner"), ({"color": -0.5}, "area light's color"), ({"range": -1}, "area light's range"),
])  # fmt: skip
def test_illegal_area_lights_name_the_light(settings, message):
    with pytest.raises(SceneError, match=message):
        AreaLight(**{**AREA, **settings})


def test_an_area_light_is_a_point_light_a_cell():
    """At the cells' centres, the intensity shared; of any parallelogram."""
    light = AreaLight((1, 2, 3), (4, 0, 2), (1, 3, 0), (0.6, 0.3, 0), (2, 3), "1/d^2", "camera", True, 9)
    cells = light.cells()
    assert len(cells) == 6 and np.array([cell.color for cell in cells]).sum(axis=0) == pytest.approx([0.6, 0.3, 0])
    places = np.array([cell.position for cell in cells])
    assert places.mean(axis=0) == pytest.approx([1 + 2.5, 2 + 1.5, 3 + 1])  # the middle of the parallelogram
    assert places[0] == pytest.approx([1 + 1 + 1 / 6, 2 + 0.5, 3 + 0.5])
    assert places[1] - places[0] == pytest.approx([2, 0, 1]) and places[2] - places[0] == pytest.approx([1 / 3, 1, 0])
    assert all(cell == PointLight(cell.position, cell.color, (0, 0, 1), "camera", True, 9) for cell in cells)
