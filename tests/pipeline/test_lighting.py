"""Check the illumination equation over points against the judge's, in float32 and with grazing light, too."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pairs import pairs
from helpers.stages import NOTHING, lighting_of

import rasterizer as rz
from rasterizer.pipeline.fragments import BATCH_SIZE, make_batch
from rasterizer.pipeline.lighting import SurfacePoints, light_points
from rasterizer.pipeline.transform import make_screen
from rasterizer.reference import light as reference_light
from rasterizer.reference.light import Lighting, Points
from rasterizer.reference.reflection import read_materials

SIZE = (64, 48)
EYE = (1.5, 2.0, 4.0)
CAMERAS = {
    "perspective": rz.Camera.perspective(EYE, (0.1, 0.2, -0.3), fov=40),
    "orthographic": rz.Camera.orthographic(EYE, (0.1, 0.2, -0.3), height=3.0),
}
LIGHTS = {
    "grey": (
        rz.AmbientLight(0.1),
        rz.DirectionalLight((-0.4, -0.5, -0.8), 0.8),
        rz.PointLight((2, 3, 3), 0.5, (1, 0.1, 0.05)),
    ),
    "coloured": (
        rz.AmbientLight((0.1, 0.05, 0.02)),
        rz.DirectionalLight((-0.4, -0.5, -0.8), (0.5, 0.6, 0.2)),
        rz.PointLight((2, 3, 3), (0.3, 0.2, 0.4), (1, 0.1, 0.05)),
        rz.AmbientLight((0.0, 0.02, 0.1)),
    ),
    "carried": (
        rz.DirectionalLight((0.2, -0.5, -0.8), 0.5, "camera"),
        rz.PointLight((-1, 1, 0), (0.5, 0.2, 0.1), (0, 0, 0.1), "camera"),
    ),
    "ambient": (rz.AmbientLight((0.3, 0.2, 0.1)),),
    "none": (),
}
MATERIALS = [
    rz.Material(),
    rz.Material(diffuse=(0.8, 0.4, 0.2), specular=(0.4, 0.2, 0.1), emissive=(0.01, 0.02, 0.03), shininess=7.5),
    rz.Material(specular=0.5, shininess=20, reflection="blinn"),
    rz.Material(specular=0, ambient=(0.5, 0.1, 0.2)),
]


def random_points(n):
    """Positions, unit normals and albedo (n, 3) round the origin."""
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(n, 3))
    return (
        rng.uniform(-1, 1, (n, 3)),
        normals / np.linalg.norm(normals, axis=1, keepdims=True),
        rng.random((n, 3)),
    )


def light_them(camera, lights, material, dtype, side, points, has_albedo, n_material=1, start=0, end=None):
    """Intensities (n, n_channel) of points, as the pipeline computes them, and the plan."""
    positions, normals, albedo = points
    view = camera.view()
    screen = make_screen(view, camera.projection(SIZE), (0.5, 20.0), 0.5, np.inf)
    lighting, plan = lighting_of(
        lights,
        [replace(material, name=str(k)) for k in range(n_material)],
        view,
        dtype,
        albedo if has_albedo else NOTHING,
    )
    out = np.full((len(positions), plan.n_channel), np.nan)
    rows, albedo = map(np.ascontiguousarray, (positions, normals)), albedo if has_albedo else NOTHING
    surface = SurfacePoints(*rows, None, albedo, np.empty((2, 0)))
    which = np.arange(start, len(positions) if end is None else end)
    light_points(surface, which, screen, side, lighting, n_material - 1, make_batch(dtype), out)
    return out, plan


def judge_them(camera, lights, material, side, points, has_albedo):
    """The same (n, 3), as the reference computes it."""
    positions, normals, albedo = points
    scene = rz.Scene([rz.Mesh(np.eye(3), [[0, 1, 2]], material=material)], lights, camera)
    expected_lighting = Lighting(camera.view(), camera.projection(SIZE), read_materials(scene), scene.lights, "phong")
    toward = np.sign((normals * reference_light.to_viewer(positions, expected_lighting)).sum(axis=1, keepdims=True))
    normals = normals * (side if side else toward)
    white = albedo if has_albedo else np.ones_like(positions)
    diffuse, specular = reference_light.light_points(
        Points(positions, normals, np.zeros(len(positions), int)), expected_lighting
    )
    return white * diffuse + specular


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_points_are_lit_as_the_reference_lights_them(dtype):
    """In float32 within what the plan counts on; in float64 highlights below 2^-28 become 0."""
    points = random_points(BATCH_SIZE + 17)
    for camera, lights, material, side, has_albedo in pairs(
        camera=tuple(CAMERAS), lights=tuple(LIGHTS), material=MATERIALS, side=(1, -1, 0), has_albedo=(False, True)
    ):
        case = CAMERAS[camera], LIGHTS[lights], material
        found, plan = light_them(*case, dtype, side, points, has_albedo)
        expected = judge_them(*case, side, points, has_albedo)
        # A picture of one channel is its tint times the intensity.
        color = found * plan.tint if plan.n_channel == 1 else found
        intensities = plan.intensities
        roundings = intensities.roundings + 8.0 * intensities.by_nearness.sum(axis=1)
        allowed = 2.0**-24 * roundings.max() + 2.0**-28 if dtype == np.float32 else 2.0**-27
        error, name = np.abs(color - expected).max(), f"{camera}, {lights}, {material}, {side=}, {has_albedo=}"
        assert error <= allowed + 2.0**-24 * expected.max(), f"{name}: {error:.3g} > {allowed:.3g}"
        brightest = expected.max()
        assert plan.bound * (1 + 1e-6) + allowed >= brightest, f"{name}: {brightest} > {plan.bound}, the plan's bound"


def test_only_the_asked_points_are_lit_and_each_as_it_would_be_alone():
    """A batch's border, and where a part begins, don't change a bit."""
    points = random_points(3 * BATCH_SIZE)
    case = CAMERAS["perspective"], LIGHTS["coloured"], MATERIALS[1], np.float32, 1, points, True
    whole, _ = light_them(*case)
    assert not differences(np.isfinite(whole), True)
    for start, end in ((0, 1), (5, 5), (200, 300), (BATCH_SIZE - 1, 2 * BATCH_SIZE + 1), (700, 3 * BATCH_SIZE)):
        part, _ = light_them(*case, start=start, end=end)
        assert not differences(part[start:end], whole[start:end])
        assert not differences(np.isnan(part[:start]), True) and not differences(np.isnan(part[end:]), True)
    other, _ = light_them(*case, n_material=3)
    assert not differences(other, whole)


def test_points_without_a_normal_and_points_in_the_eye_are_numbers():
    positions = np.array([[0.0, 0, 0], EYE, (2, 3, 3), (0.3, 0, 0)])
    normals = np.array([[0.0, 0, 0], [0, 0, 1], [0, 1, 0], [1e-200, 0, 0]])
    points = positions, normals, np.ones((4, 3))
    for dtype, material, side in pairs(dtype=(np.float32, np.float64), material=MATERIALS, side=(1, -1, 0)):
        found, _ = light_them(CAMERAS["perspective"], LIGHTS["grey"], material, dtype, side, points, False)
        assert np.isfinite(found).all() and (found >= 0).all(), f"{material}, {side=}, {dtype.__name__}: {found}"


def test_a_picture_against_the_sun_keeps_the_tolerance():
    """A floor that mirrors a low sun straight ahead: L is nearly -V."""
    for elevation, reflection in product((0.05, 2.0, 10.0), ("phong", "blinn")):
        sun = np.radians(elevation)
        material = rz.Material(diffuse=0.3, specular=0.5, shininess=80, reflection=reflection)
        floor = np.array([[-50, 0, -200], [50, 0, -200], [50, 0, 0.5], [-50, 0, 0.5]])
        camera = rz.Camera.perspective((0, 1.0, 0), (0, 0.9, -3), fov=50)
        lights = (rz.AmbientLight(0.1), rz.DirectionalLight((0, -np.sin(sun), np.cos(sun)), 0.8))
        scene = rz.Scene([rz.Mesh(floor, [[0, 3, 2], [0, 2, 1]], material=material)], lights, camera)
        fast, exact = (rz.render(scene, (120, 90), shading="phong", tolerance=t, samples=1) for t in (1 / 4096, 0.0))
        error = np.abs(fast.color - exact.color).max()
        assert error <= 1 / 4096, f"sun at {elevation}°, {reflection}: {error:.3g} > {1 / 4096:.3g}"
