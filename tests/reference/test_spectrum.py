"""Check the reference's spectral colour and its exposure, against sums over wavelengths written out."""

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pinhole import QUAD, SHADINGS, eye_camera, layer

from rasterizer.errors import SceneError
from rasterizer.reference import render
from rasterizer.scene.lights import AmbientLight, DirectionalLight, PointLight
from rasterizer.scene.material import Material
from rasterizer.scene.mesh import Mesh
from rasterizer.scene.scene import Scene
from rasterizer.scene.spectrum import Spectrum, rgb_weights, sampling
from rasterizer.scene.texture import Texture

SIZE = (6, 4)
LEAF = Spectrum([380, 500, 550, 600, 690, 780], [0.04, 0.06, 0.18, 0.07, 0.05, 0.6])
LAMP = Spectrum([380, 560, 570, 780], [0.2, 0.4, 2.0, 0.1])
ONTO = DirectionalLight((0, 0, -1), LAMP)  # N.L = R.V = 1 at the middle


def show(material, lights, shading="gouraud", mesh_options=None, background=None, **options):
    mesh = Mesh(np.array(layer(SIZE, 2.0)), QUAD, material=material, **(mesh_options or {}))
    return render(
        Scene(mesh, lights=lights, camera=eye_camera(), background=background), SIZE, shading=shading, **options
    )


def diffuse(color, **options):
    return Material(diffuse=color, specular=0.0, **options)


# ── spectra ─────────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("shading, n", [("flat", None), ("gouraud", 3), ("phong", 16), ("gouraud", 200)])
def test_two_spectra_are_multiplied_wavelength_by_wavelength(shading, n):
    picture = show(diffuse(LEAF), ONTO, shading, spectral=n)
    waves = sampling(n or 81)
    expected = sum(
        LEAF.at(wave) * LAMP.at(wave) * weight for wave, weight in zip(waves, rgb_weights(n or 81), strict=True)
    )
    np.testing.assert_allclose(picture.color, np.broadcast_to(expected, (4, 6, 3)), rtol=1e-12)
    assert np.abs(expected - np.array(LEAF) * np.array(LAMP)).max() > 0.01  # it isn't the product of the RGB colours


@pytest.mark.parametrize("shading", SHADINGS)
def test_flat_spectra_are_neutral(shading):
    material = Material(diffuse=Spectrum.flat(0.5), specular=0.25, emissive=0.1, shininess=3)
    lights = AmbientLight(0.5), DirectionalLight((0.1, 0, -1), Spectrum.flat(0.8)), PointLight((0, 0, 0), 0.3)
    grey = Material(diffuse=0.5, specular=0.25, emissive=0.1, shininess=3)
    expected = show(grey, (lights[0], DirectionalLight((0.1, 0, -1), 0.8), lights[2]), shading).color
    for n in (None, 5, 81):
        np.testing.assert_allclose(show(material, lights, shading, spectral=n).color, expected, rtol=1e-12)


def test_all_terms_are_spectra():
    # seen along the normal by a light in the eye: N.L and R.V are 1 in the middle of the picture
    material = Material(ambient=0.0, diffuse=LEAF, specular=Spectrum.flat(0.3), emissive=LAMP)
    mesh = Mesh(np.array(layer((1, 1), 2.0)), QUAD, material=material)
    picture = render(Scene(mesh, lights=PointLight((0, 0, 0), LAMP), camera=eye_camera()), (1, 1), shading="phong")
    values = LAMP.at(sampling(81)) * (LEAF.at(sampling(81)) + 0.3 + 1.0)
    np.testing.assert_allclose(picture.color[0, 0], values @ rgb_weights(81), rtol=1e-12)


@pytest.mark.parametrize("shading", SHADINGS)
def test_vertex_colors_and_textures_multiply_the_rgb_of_the_diffuse_part(shading):
    texel = np.array([0.25, 0.5, 0.75], np.float32)
    colors = np.tile([0.5, 0.2, 1.0], (4, 1))
    coefficients = {"diffuse": LEAF, "specular": 0.0, "emissive": 0.1}
    plain = show(Material(**coefficients), ONTO, shading).color
    picture = show(
        Material(**coefficients, texture=Texture(texel.reshape(1, 1, 3))),
        ONTO,
        shading,
        {"uv": np.zeros((4, 2)), "colors": colors},
    )
    np.testing.assert_allclose(picture.color, (plain - 0.1) * texel * colors[0] + 0.1, rtol=1e-12)


# ── exposure ────────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("shading, stops", [("flat", -3), ("gouraud", 0.5), ("phong", 2)])
def test_exposure_multiplies_all_light_but_the_background(shading, stops):
    material = Material(emissive=0.1, opacity=0.5)
    lights = AmbientLight(0.2), ONTO
    before = show(material, lights, shading)
    after = show(material, lights, shading, exposure=stops)
    np.testing.assert_allclose(after.color, before.color * 2.0**stops, rtol=1e-14)
    assert not differences(after.alpha, before.alpha)
    over = show(material, lights, shading, background=(0.2, 0.4, 0.6), exposure=stops)
    expected = 0.5 * after.color + 0.5 * np.array((0.2, 0.4, 0.6))
    np.testing.assert_allclose(over.color, expected, rtol=1e-12)


def test_options_that_are_not_legal():
    for options in ({"exposure": "much"}, {"exposure": 65}, {"spectral": 2}, {"spectral": 8.5}):
        with pytest.raises(SceneError, match=next(iter(options))):
            show(Material(), (), **options)
