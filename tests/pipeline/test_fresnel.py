"""Check F0 with a colour of its own: by channel, by wavelength, in all ways to shade, and that nobody else pays for
it."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.against_reference import EXACT, assert_matches_reference
from helpers.pairs import pairs
from helpers.pinhole import SHADINGS, octasphere

import rasterizer as rz
from rasterizer.errors import SceneError
from rasterizer.scene.spectrum import rgb_of, samples_of

GOLD = (1.0, 0.78, 0.34)
RAMP = rz.Spectrum((400, 500, 600, 700), (0.1, 0.3, 0.9, 1.0))
LIGHTS = (
    rz.AmbientLight(0.1),
    rz.DirectionalLight((-1, -0.4, -1), (0.7, 0.6, 0.5)),
    rz.PointLight((2, 3, 3), 0.4, "1/(d+1)"),
    rz.DirectionalLight((-0.2, -0.3, 1), 0.5),  # from behind: W is near 1
)
MATERIALS = {
    "phong": rz.Material(diffuse=0.3, specular=(0.6, 0.5, 0.4), shininess=12, fresnel=GOLD),
    "phong, normalised": rz.Material(specular=0.3, shininess=7.5, fresnel=GOLD, normalized=True),
    "blinn": rz.Material(diffuse=0.3, specular=0.6, reflection="blinn", fresnel=GOLD),
    "ggx": rz.Material(diffuse=0.1, specular=0.8, reflection="cook-torrance", roughness=0.4, fresnel=GOLD),
    "beckmann": rz.Material(
        diffuse=0.1, specular=0.8, reflection="cook-torrance", distribution="beckmann", roughness=0.4, fresnel=GOLD
    ),
    "brushed": rz.Material(
        diffuse=0.1, specular=0.1, reflection="cook-torrance", roughness=(0.2, 0.5), tangent=(0, 1, 0), fresnel=GOLD
    ),
    "spectrum": rz.Material(diffuse=0.3, specular=0.6, shininess=12, fresnel=RAMP),
}


def ball(*materials, **more):
    """A ball for each material, beside each other."""
    vertices, faces = octasphere(2)
    meshes = [rz.Mesh(vertices + (2.2 * k, 0, 0), faces, material=material) for k, material in enumerate(materials)]
    return rz.Scene(meshes, LIGHTS, **more)


@pytest.mark.parametrize("name", MATERIALS)
def test_pictures_agree_with_the_reference(name):
    scene = ball(MATERIALS[name])
    for shading, tolerance in pairs(shading=SHADINGS, tolerance=(0.0, 1 / 4096)):
        assert_matches_reference(scene, (24, 20), max(tolerance, EXACT), shading=shading, tolerance=tolerance)


def test_materials_with_and_without_it_share_a_picture():
    scene = ball(MATERIALS["blinn"], rz.Material(fresnel=0.2), rz.Material(specular=0), MATERIALS["ggx"], rz.Material())
    for shading in SHADINGS:
        assert_matches_reference(scene, (60, 20), EXACT, shading=shading, tolerance=0)


def test_a_spectrum_is_evaluated_at_every_wavelength():
    """One point, one light: RGB(ks·Ip·(F0 + (1 - F0)(1 - cos θ)^5)·(R·V)^n), sample by sample."""
    light, n = rz.Spectrum.blackbody(3500), 81
    light_dir, normal = np.array((0.8, 0.0, 0.6)), np.array((0.0, 0.0, 1.0))
    view_dir = np.array((-0.6, 0.0, 0.8))
    material = rz.Material(diffuse=0, ambient=0, specular=0.7, shininess=5, fresnel=RAMP)
    found = rz.illuminate((0, 0, 0), normal, material, rz.DirectionalLight(-light_dir, light), toward_viewer=view_dir)
    first = samples_of(RAMP, n)
    mirrored = 2 * (normal @ light_dir) * normal - light_dir
    weight = first + (1 - first) * (1 - normal @ light_dir) ** 5
    expected = rgb_of(samples_of(light, n) * 0.7 * weight * (mirrored @ view_dir) ** 5)
    assert np.abs(found - expected).max() < 1e-14, f"{found} instead of {expected}"


def test_w_grows_to_white_with_the_angle_of_incidence():
    """In the mirror direction Phong's highlight is ks·W alone: F0 at normal incidence, 1 at grazing."""
    material = rz.Material(diffuse=0, ambient=0, specular=1.0, fresnel=GOLD)
    for degrees in (0.0, 30.0, 60.0, 80.0, 89.0):
        a = np.radians(degrees)
        light_dir, mirrored = (np.sin(a), 0, np.cos(a)), (-np.sin(a), 0, np.cos(a))
        light = rz.DirectionalLight(np.negative(light_dir))
        found = rz.illuminate((0, 0, 0), (0, 0, 1), material, light, toward_viewer=mirrored)
        expected = np.array(GOLD) + (1 - np.array(GOLD)) * (1 - np.cos(a)) ** 5
        assert np.abs(found - expected).max() < 1e-12, f"{degrees}°: {found} instead of {expected}"


def test_only_a_colour_that_a_highlight_shows_takes_three_channels():
    neutral = (rz.AmbientLight(0.1), rz.DirectionalLight((-1, -0.4, -1), 0.7))
    for fresnel, specular, channels in (
        (0.3, 0.5, 1), ("white", 0.5, 1), ((0.2, 0.2, 0.2), 0.5, 1), (None, 0.5, 1), (GOLD, 0, 1), (GOLD, 0.5, 3),
    ):  # fmt: skip
        scene = replace(ball(rz.Material(specular=specular, fresnel=fresnel)), lights=neutral)
        with rz.Renderer(scene, (8, 6)) as renderer:
            assert renderer.plan.channels == channels, f"F0 {fresnel}, ks {specular}"


def test_float32_serves_it_as_it_serves_a_number():
    for fresnel in (GOLD, 0.5):
        scene = ball(replace(MATERIALS["phong"], fresnel=fresnel))
        assert rz.render(scene, (8, 6), shading="phong").stats.plan.dtype == "float32", fresnel


def test_shadows_fall_on_both_parts():
    """A card between light and floor: what lies in shadow has no highlight at all."""
    shiny, black = rz.Material(fresnel=GOLD, diffuse=0), rz.Material(diffuse=0, specular=0)
    floor = rz.Mesh([[-2, 0, -2], [-2, 0, 2], [2, 0, 2], [2, 0, -2]], [[0, 1, 2, 3]], material=shiny)
    card = rz.Mesh([[-2, 1, -2], [-2, 1, 2], [2, 1, 2], [2, 1, -2]], [[0, 1, 2, 3]], material=black)
    scene = rz.Scene(
        [floor, card], rz.PointLight((0, 3, 0), shadow=True), rz.Camera.perspective((0, 0.5, 4), (0, 0, 0))
    )
    frame = rz.render(scene, (40, 30), shading="phong", outputs=("color", "face"))
    assert (frame.face < 2).any() and frame.color[(frame.face >= 0) & (frame.face < 2)].max() == 0.0


def test_forms_and_refusals():
    assert rz.Material(fresnel="#808080").fresnel == pytest.approx(0.2158605, abs=1e-6)
    assert rz.Material(fresnel=[0.1, 0.2, 0.3]).fresnel == (0.1, 0.2, 0.3)
    assert rz.Material(fresnel=RAMP).fresnel is RAMP
    for wrong in (-0.1, 1.1, (0.1, 0.2, 1.2), (0.1, 0.2), "nocolour", rz.Spectrum((400, 700), (0.5, 1.5)), True):
        with pytest.raises(SceneError, match="fresnel"):
            rz.Material(fresnel=wrong)
