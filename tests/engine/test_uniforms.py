"""Check the arrays that lights and materials become for one view."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import deviations, differences
from helpers.pinhole import unit

import rasterizer as rz
from rasterizer.compiler.kernels import batch_function
from rasterizer.engine.plan import make_plan
from rasterizer.engine.scene_tables import SceneTables
from rasterizer.engine.uniforms import light_view, make_lighting
from rasterizer.options import Options
from rasterizer.pipeline import material_coefficients as m
from rasterizer.pipeline.lights import (
    ATTENUATION,
    AXIS,
    CONE_EXPONENT,
    CONE_SCALE,
    COS_OUTER,
    INVERSE_RANGE,
    MAX_STRENGTH,
    VECTOR,
    directional,
    point,
    spot,
)
from rasterizer.pipeline.reflection import blinn, lambert
from rasterizer.scene.spectrum import Spectrum

CAMERA = rz.Camera.perspective((3, 1, 2), (0, 0, 0), up=(0, 0, 1), fov=40)
VIEW = CAMERA.view()
AXES = np.stack([VIEW.right, VIEW.up, -VIEW.forward])  # rows: x, y, z of the camera in the world
TRIANGLE = np.eye(3), [[0, 1, 2]]


def lighting_of(lights, *materials, shadows=(), **options):
    """(Lighting, plan) of lights and materials as VIEW sees them."""
    meshes = [rz.Mesh(*TRIANGLE, material=material) for material in materials or (rz.Material(),)]
    chosen = Options(shading="phong", tolerance=0, **options)
    plan = make_plan(SceneTables(rz.Scene(meshes, lights, CAMERA), chosen), chosen)
    return light_view(make_lighting(plan, plan.dtype), plan, VIEW, shadows), plan


# ── lights ──────────────────────────────────────────────────────────────────────────────────────────────


def test_directions_point_to_the_light_and_places_are_relative_to_the_eye():
    """What is attached to the camera is turned to the world."""
    place, way = np.array((0.5, -2, 3)), unit(np.array((0.2, 0.3, -1)))
    lights = (rz.DirectionalLight(way), rz.PointLight(place), rz.SpotLight(place, way))
    of_world = way, place - (3, 1, 2)
    for attached, (direction, position) in (("world", of_world), ("camera", (way @ AXES, place @ AXES))):
        rows = lighting_of([replace(light, attached=attached) for light in lights])[0].lights
        vectors = np.array([-direction, position, position])
        assert np.allclose(rows[:, VECTOR : VECTOR + 3], vectors, atol=1e-15), attached
        assert np.allclose(rows[2, AXIS : AXIS + 3], direction, atol=1e-15), attached


def test_numbers_of_positional_lights():
    lights = (
        rz.PointLight((1, 2, 3), attenuation=(0.5, 0.25, 0.125)),
        rz.PointLight((1, 2, 3), amplify=True, range=8),
        rz.SpotLight((1, 2, 3), (0, 0, -1), inner=20, outer=60, exponent=3, attenuation="1/d^2"),
        rz.SpotLight((1, 2, 3), (0, 0, -1), inner=30, outer=30),
    )
    rows = lighting_of(lights)[0].lights
    assert rows[:, ATTENUATION : ATTENUATION + 3].tolist() == [[0.5, 0.25, 0.125], [1, 0, 0], [0, 0, 1], [1, 0, 0]]
    assert rows[:, MAX_STRENGTH].tolist() == [1, np.inf, 1, 1] and rows[:, INVERSE_RANGE].tolist() == [0, 0.125, 0, 0]
    c_inner, c_outer = np.cos(np.radians((20, 60)))
    assert rows[2, COS_OUTER] == pytest.approx(c_outer, rel=1e-15) and rows[2, CONE_EXPONENT] == 3
    assert rows[2, CONE_SCALE] == pytest.approx(1 / (c_inner - c_outer), rel=1e-14) and rows[3, CONE_SCALE] == np.inf


def test_batch_functions_are_those_of_the_lights_and_then_of_the_materials():
    area = rz.AreaLight((1, 2, 3), (1, 0, 0), (0, 1, 0), resolution=(2, 1))
    lights = (rz.AmbientLight(), rz.SpotLight((1, 2, 3), (0, 0, -1)), area, rz.DirectionalLight((0, 0, -1)))
    lighting, plan = lighting_of(lights, rz.Material(specular=0), rz.Material(reflection="blinn"))
    of_lights, of_materials = lighting.light_functions.tolist(), lighting.reflection_functions.tolist()
    assert of_lights == [batch_function(function, plan.dtype).address for function in (spot, point, point, directional)]
    assert of_materials == [[batch_function(function, plan.dtype).address] * 4 for function in (lambert, blinn)]
    assert lighting.needs_position and lighting.needs_view
    assert not lighting_of((rz.DirectionalLight((0, 0, -1)),), rz.Material(specular=0))[0].needs_view


# ── colours ─────────────────────────────────────────────────────────────────────────────────────────────


def test_beside_a_coloured_material_a_grey_one_has_one_channel():
    """Where all lights are grey: then one set of their colours is enough for both."""
    grey, clay = rz.Material(ambient=0.5, diffuse=0.6, specular=0.2), rz.Material(diffuse=(0.6, 0.4, 0.2))
    lighting, plan = lighting_of((rz.AmbientLight(0.5), rz.PointLight((1, 2, 3), 0.7)), grey, clay)
    assert lighting.n_channels.tolist() == [1, 3] and not differences(plan.tint, 1)
    assert lighting.colors.shape == (1, 1, 12) and not differences(lighting.colors, 0.7)
    assert lighting.materials[0, m.DIFFUSE] == 0.6 and lighting.materials[1, m.DIFFUSE : m.DIFFUSE + 3].tolist() == [
        0.6, 0.4, 0.2,
    ]  # fmt: skip
    # Coloured light leaves nothing grey.
    lighting, _ = lighting_of((rz.DirectionalLight((0, 0, -1), (0.5, 0.2, 0.1)),), grey, clay)
    assert lighting.n_channels.tolist() in ([3, 3], [1, 3])
    assert not deviations(lighting.colors[-1, :, :6], [[0.5, 0.2, 0.1] * 2])


def test_only_the_materials_of_a_type_have_functions_in_it():
    toon = rz.Material(reflection="toon")
    scene = rz.Scene([rz.Mesh(*TRIANGLE, material=look) for look in (rz.Material(), toon)], rz.PointLight((1, 2, 3)))
    plan = make_plan(SceneTables(scene, Options(shading="phong")), Options(shading="phong"))
    single, double = (make_lighting(plan, dtype) for dtype in plan.of_materials.dtypes)
    assert single.materials.dtype == np.float32 and double.materials.dtype == np.float64
    assert (single.reflection_functions != 0).tolist() == [[True], [False]]
    assert (double.reflection_functions != 0).tolist() == [[False], [True]]
    assert single.light_functions[0] != double.light_functions[0]


def test_with_spectra_every_material_has_sums_of_its_own():
    """The lights' colours are those of the products; coefficients are 1."""
    materials = [rz.Material(diffuse=Spectrum.flat(0.5), specular=0.3)]
    materials.append(rz.Material(diffuse=(0.2, 0.6, 0.4), specular=0, emissive=0.1))
    lights = (rz.AmbientLight(0.4), rz.PointLight((1, 2, 3), 0.5), rz.DirectionalLight((0, 0, -1)))
    lighting, plan = lighting_of(lights, *materials, exposure=1)
    assert lighting.n_channels.tolist() == [3, 3] and lighting.colors.shape == (2, 2, 12)
    assert not deviations(lighting.colors[0, :, :6], [[0.5] * 3 + [0.3] * 3, [1.0] * 3 + [0.6] * 3], atol=1e-09)
    assert not deviations(lighting.colors[1, :, :6], [[0.2, 0.6, 0.4, 0, 0, 0], [0.4, 1.2, 0.8, 0, 0, 0]], atol=1e-09)
    assert not differences(lighting.materials[:, m.DIFFUSE : m.DIFFUSE + 3], 1)
    assert not differences(lighting.materials[:, m.SPECULAR : m.SPECULAR + 3], 1)
    assert not deviations(lighting.materials[1, m.EMISSION : m.EMISSION + 3], 0.2)
    assert plan.tables.products is not None


def test_a_scene_without_lights():
    lighting, _ = lighting_of((rz.AmbientLight(0.5),))
    assert lighting.lights.shape[0] == 0 and len(lighting.light_functions) == 0 and not lighting.needs_position


# ── shadows ─────────────────────────────────────────────────────────────────────────────────────────────


def test_maps_are_handed_on_by_address():
    class Map:
        block = np.zeros(8)

    lights = (rz.DirectionalLight((0, 0, -1)), rz.DirectionalLight((0, 1, -1), shadow=True))
    lighting, plan = lighting_of(lights, shadows=(None, Map))
    assert lighting.shadows.maps.tolist() == [0, Map.block.ctypes.data] and lighting.shadows.function != 0
    assert lighting.needs_position and plan.dtype == np.float64  # of the points, although no light has a place
    without = lighting_of((replace(lights[1], shadow=None),))[0]
    assert without.shadows is None and not without.needs_position
