"""Lights: normal forms, refusals, and the ready-made sets."""

import math

import numpy as np
import pytest
from helpers.refusals import assert_refused

import rasterizer as rz
from rasterizer.errors import SceneError
from rasterizer.scene.lights import (
    AmbientLight,
    AreaLight,
    DirectionalLight,
    PointLight,
    Shadow,
    SpotLight,
    headlight,
    studio,
)
from rasterizer.scene.material import Material

SPOT = {"position": (0, 1, 2), "direction": (0, 0, -3)}
AREA = {"corner": (0, 3, 0), "edge_u": (2, 0, 0), "edge_v": (0, 0, 1)}


def test_attenuation_in_all_written_forms():
    forms = {
        "1": (1, 0, 0), "1/d": (0, 1, 0), "1/(d+2.5)": (2.5, 1, 0), "1 / (d + 3e2)": (300, 1, 0), "1/d^2": (0, 0, 1),
        "1/d²": (0, 0, 1), (1, 2, 3): (1, 2, 3),
    }  # fmt: skip
    for written, legal in forms.items():
        for light in (PointLight((0, 0, 0), attenuation=written), SpotLight(**SPOT, attenuation=written)):
            assert light.attenuation == legal, f"{written}: {light.attenuation} != {legal}"
            assert [c for c in light.attenuation if not isinstance(c, float)] == []
    wrong = [(0, 0, 0), (-1, 0, 0), (1, 0, math.nan), (1, 0), 1.0]
    wrong += ["", "d", "1/d^3", "1/(d-2)", "1/(d+-2)", "1/(d+inf)", "1/(d+)", "2/d"]
    cases = [(each, "area light's attenuation") for each in wrong]
    assert_refused(lambda each: AreaLight(**AREA, attenuation=each), cases, SceneError)


def test_illegal_values_name_the_light():
    wrong = [(0, 0, 0), (0, math.nan, 1), (math.inf, 0, 0), (1, 2), 5, "up", None, (True, 0, 1)]
    assert_refused(DirectionalLight, [(each, "directional light's direction") for each in wrong], SceneError)
    ambient, point = lambda given: AmbientLight(**given), lambda given: PointLight(**{"position": (0, 0, 0)} | given)
    directional = lambda given: DirectionalLight((0, 0, 1), **given)
    for make in (ambient, point, directional):
        assert_refused(make, [({"color": -1.0}, "light's color must not be negative")], SceneError)
    cases = [
        ({"position": (0, 0, math.inf)}, "point light's position"),
        ({"attached": "moon"}, "attached.*'world', 'camera'.*'moon'"),
    ]
    assert_refused(point, cases, SceneError)
    assert_refused(directional, [({"attached": None}, "attached")], SceneError)
    within = r"inner angle must be within 0\.\.30 degrees, the outer one; given 40"
    cases = [
        ({"direction": (0, 0, 0)}, "spot light's direction"), ({"position": (0, math.nan, 0)}, "spot light's position"),
        ({"inner": 40}, within), ({"inner": -1}, "inner"), ({"outer": 0}, "outer"), ({"outer": 91}, "outer"),
        ({"exponent": -1}, "exponent"), ({"exponent": math.inf}, "exponent"), ({"falloff": 0}, "falloff"),
        ({"falloff": math.nan}, "falloff"), ({"color": -1}, "spot light's color"), ({"range": 0}, "spot light's range"),
        ({"range": math.inf}, "range"), ({"attached": "wall"}, "spot light's attached"),
        ({"color": (1, math.nan, 1)}, "color"),
    ]  # fmt: skip
    assert_refused(lambda given: SpotLight(**SPOT | given), cases, SceneError)
    cases = [
        ({"resolution": (0, 4)}, "resolution.*1 to 64; given"), ({"resolution": 4}, "resolution"),
        ({"resolution": (2, 65)}, "resolution"), ({"resolution": (2.0, 2)}, "resolution"),
        ({"edge_u": (0, 0, 0)}, "edge_u"), ({"edge_v": (-4, 0, 0)}, "parallel"), ({"corner": (1, 2)}, "corner"),
        ({"color": -0.5}, "area light's color"), ({"range": -1}, "area light's range"),
    ]  # fmt: skip
    assert_refused(lambda given: AreaLight(**AREA | given), cases, SceneError)


def test_shadows_have_maps_of_a_whole_size_and_odd_filters():
    cases = [
        ({"size": size}, r"shadow's size must be a whole number within 16\.\.8192") for size in (15, 8193, 64.0, "x")
    ]
    cases += [({"filter": n}, r"filter must be an odd number within 1\.\.9; given") for n in (0, 2, 8, 11, 3.0, None)]
    assert_refused(lambda given: Shadow(**given), cases, SceneError)
    assert Shadow(np.int64(16), np.int64(9)) == Shadow(16, 9)


def test_an_area_light_is_a_point_light_a_cell():
    """At the cells' centres, the intensity shared; of any parallelogram."""
    light = AreaLight((1, 2, 3), (4, 0, 2), (1, 3, 0), (0.6, 0.3, 0), (2, 3), "1/d^2", "camera", True, 9)
    cells = light.cells()
    assert len(cells) == 6 and np.array([cell.color for cell in cells]).sum(axis=0) == pytest.approx([0.6, 0.3, 0])
    places = np.array([cell.position for cell in cells])
    assert places.mean(axis=0) == pytest.approx([1 + 2.5, 2 + 1.5, 3 + 1])  # the middle of the parallelogram
    assert places[0] == pytest.approx([1 + 1 + 1 / 6, 2 + 0.5, 3 + 0.5])
    assert places[1] - places[0] == pytest.approx([2, 0, 1]) and places[2] - places[0] == pytest.approx([1 / 3, 1, 0])
    assert [cell for cell in cells if cell != PointLight(cell.position, cell.color, (0, 0, 1), "camera", True, 9)] == []


def test_ready_made_sets_are_neutral_and_move_with_the_camera():
    for light in (*studio(), *headlight()):
        assert len(set(light.color)) == 1, f"{light}: {len(set(light.color))} != 1"
        assert isinstance(light, AmbientLight) or light.attached == "camera", light
    _, key, fill, rim = studio()
    assert key.direction[0] > 0 and key.direction[1] < 0 and key.direction[2] < 0  # from upper left, in front
    assert fill.direction[0] < 0 and fill.direction[2] < 0 and max(fill.color) < max(key.color)
    assert rim.direction[2] > 0 and rim.direction[1] < 0  # from behind and above


def test_ready_made_sets_neither_clip_nor_leave_black():
    """The default material, seen from +z, over all normals that face the viewer."""
    u, v = np.meshgrid(np.linspace(-1, 1, 101), np.linspace(-1, 1, 101))
    normals = np.dstack([u, v, np.sqrt(np.maximum(1.0 - u**2 - v**2, 0.0))])[u**2 + v**2 <= 1.0]
    for lights in (studio(), headlight()):
        # far away, so that the viewer stands in one direction
        seen = rz.illuminate((0, 0, 0), normals, Material(), lights, rz.Camera.perspective((0, 0, 1e9)))
        assert 0.04 < seen.min() and 0.6 < seen.max() <= 1.0, (seen.min(), seen.max())
