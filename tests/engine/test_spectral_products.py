"""Check spectral colour and exposure in whole pictures: products wavelength by wavelength, the same in all methods and
models."""

import numpy as np
import pytest
from helpers.pinhole import SHADINGS, octasphere, unit

import rasterizer as rz
from rasterizer.engine.spectral_products import multiply_spectra
from rasterizer.options import Options
from rasterizer.scene.cie_tables import D65, MATCHING, WAVELENGTHS
from rasterizer.scene.spectrum import Spectrum

SIZE = (40, 30)
SHEET = np.array([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], float)
CAMERA = rz.Camera.orthographic((0, 0, 5), (0, 0, 0), height=10)
DIRECTION = (0.3, -0.4, -1)
COSINE = -unit(np.array(DIRECTION))[2]
GREENISH = Spectrum((380, 480, 520, 560, 640, 780), (0.1, 0.2, 0.9, 0.8, 0.3, 0.1))
REDDISH = Spectrum((400, 550, 600, 700), (0.05, 0.1, 0.8, 0.9))
LAMP = Spectrum.blackbody(2856)
LASER = Spectrum((510, 515, 520, 525, 530), (0, 2, 6, 2, 0))  # no display shows it: its red is negative


def show(material, lights, shading="phong", **options):
    scene = rz.Scene(
        [rz.Mesh(SHEET, [[0, 1, 2, 3]], material=material)], lights, CAMERA, options.pop("background", None)
    )
    return rz.render(scene, SIZE, shading=shading, **({"samples": 1} | {"tolerance": 0} | options))


def seen(values):
    """Linear RGB of a spectrum at the tables' wavelengths: sums over the tables, primaries of sRGB with the white of S
    = 1."""
    step = np.full(len(WAVELENGTHS), 5.0)
    step[[0, -1]] = 2.5
    white = (step * D65) @ MATCHING
    xyz = (step * D65 * values) @ MATCHING / white[1]
    primaries = np.array([(x / y, 1, (1 - x - y) / y) for x, y in ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06))]).T
    scale = np.linalg.solve(primaries, white / white[1])
    return np.linalg.solve(primaries * scale, xyz)


def at(color):
    """A colour at the tables' wavelengths."""
    return color.at(WAVELENGTHS) if isinstance(color, Spectrum) else np.full(len(WAVELENGTHS), float(color))


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("n", [None, 3, 16, 81, 401])
@pytest.mark.parametrize("grey", [0.05, 0.5, 1.0])
def test_a_flat_reflectance_under_white_is_neutral(grey, n, shading):
    light = (rz.DirectionalLight((0, 0, -1), 1.0), rz.AmbientLight(0.25))
    frame = show(rz.Material(diffuse=Spectrum.flat(grey), specular=0), light, shading, spectral=n)
    expected = np.float32(grey * 1.25)
    assert (
        np.abs(frame.color - expected).max() <= 4e-7 * expected
    )  # what float32 can hold; the products are exact to 1e-12
    assert np.ptp(frame.rgb, axis=-1).max() == 0


def test_products_are_neutral_to_the_last_digits():
    scene = (
        [rz.Material(diffuse=Spectrum.flat(0.5), specular=0.2)],
        [rz.DirectionalLight((0, 0, -1))],
        [rz.AmbientLight(0.3)],
    )
    for n in (None, 3, 7, 81, 400):
        products = multiply_spectra(*scene, Options(spectral=n))
        assert np.abs(products.diffuse - 0.5).max() < 1e-12 and np.abs(products.specular - 0.2).max() < 1e-12
        assert np.abs(products.ambient - 0.15).max() < 1e-12 and not products.emissive.any()


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("reflectance", [GREENISH, REDDISH, 0.6])
@pytest.mark.parametrize("lamp", [LAMP, GREENISH, LASER, 0.8])
def test_the_product_of_two_spectra_is_summed_over_the_wavelengths(lamp, reflectance, shading):
    material = rz.Material(diffuse=reflectance, ambient=REDDISH, specular=0, emissive=GREENISH.scaled(0.1))
    frame = show(material, (rz.DirectionalLight(DIRECTION, lamp), rz.AmbientLight(LAMP.scaled(0.2))), shading)
    expected = seen(at(reflectance) * at(lamp)) * COSINE + seen(at(REDDISH) * at(LAMP) * 0.2) + seen(at(GREENISH) * 0.1)
    assert np.abs(frame.color - expected).max() < 2e-6


def test_channels_alone_would_give_another_colour():
    """So the test before could not be passed without spectra."""
    assert np.abs(seen(at(GREENISH) * at(LASER)) - np.array(GREENISH) * np.array(LASER)).max() > 0.05


@pytest.mark.parametrize("shading", SHADINGS)
def test_rgb_colours_under_white_light_stay_what_they_are(shading):
    """The spectrum of an RGB colour has that RGB; of two colours the product is another matter."""
    vertices, faces = octasphere(2)
    material = rz.Material(diffuse=(0.7, 0.3, 0.2), ambient=(0.2, 0.5, 0.6), specular=0.3, emissive=(0.1, 0, 0.05))
    lights = (rz.AmbientLight(0.2), rz.DirectionalLight(DIRECTION, 0.6), rz.PointLight((2, 2, 3), 0.4, "1/(d+1)"))
    scene = rz.Scene([rz.Mesh(vertices * 3, faces, material=material)], lights, CAMERA)
    plain = rz.render(scene, SIZE, shading=shading, tolerance=0, samples=1)
    for n in (16, 81, 200):
        spectral = rz.render(scene, SIZE, shading=shading, tolerance=0, spectral=n, samples=1)
        assert np.abs(spectral.color - plain.color).max() < 2e-6
    assert np.ptp(plain.color) > 0.3


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("tolerance", [0, 1 / 4096])
def test_negative_components_stay_in_colours_and_end_in_bytes(shading, tolerance):
    frame = show(
        rz.Material(diffuse=1.0, specular=0), (rz.DirectionalLight((0, 0, -1), LASER),), shading, tolerance=tolerance
    )
    expected = np.array(LASER)
    assert expected.min() < -0.05 and np.abs(frame.color - expected).max() < max(tolerance, 2e-6)
    assert (frame.rgb[..., expected < 0] == 0).all() and (frame.rgb.max(axis=-1) > 0).all()


@pytest.mark.parametrize("policy", ["clamp", "global", "local"])
@pytest.mark.parametrize("samples", [1, 4])
def test_negative_components_in_every_policy(policy, samples):
    frame = show(rz.Material(diffuse=1.0, specular=0), (rz.DirectionalLight((0, 0, -1), LASER.scaled(9)),),
                 color_range=policy, samples=samples)  # fmt: skip
    color = np.array(LASER) * 9
    assert np.abs(frame.color - color).max() < 2e-5 and color.max() > 1
    assert (frame.rgb[..., 0] == 0).all() and (frame.rgb[..., 1] == 255).all()


@pytest.mark.parametrize("shading", SHADINGS)
def test_highlights_under_a_coloured_lamp(shading):
    """With grey coefficients the picture is the lamp's RGB times that under white light of 1."""
    vertices, faces = octasphere(3)
    model = rz.Mesh(vertices * 3, faces, material=rz.Material(diffuse=0.5, specular=0.4))

    def draw(color, **options):
        lights = (rz.AmbientLight(0.3), rz.DirectionalLight(DIRECTION, color))
        return rz.render(
            rz.Scene([model], lights, CAMERA), SIZE, shading=shading, tolerance=0, **{"samples": 1} | options
        ).color

    dark, white = draw(0.0), draw(1.0)
    assert np.abs(draw(LAMP) - (dark + (white - dark) * np.array(LAMP))).max() < 3e-6 and white.max() > 0.8


# ── exposure ────────────────────────────────────────────────────────────────────────────────────────────


def lit_scene(background=None, **material):
    vertices, faces = octasphere(2)
    lights = (rz.AmbientLight(0.1), rz.DirectionalLight(DIRECTION, (0.5, 0.4, 0.3)), rz.PointLight((2, 3, 4), 0.3))
    made = rz.Material(diffuse=(0.6, 0.5, 0.4), specular=0.2, emissive=0.02, **material)
    return rz.Scene([rz.Mesh(vertices * 3, faces, material=made)], lights, CAMERA, background)


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("stops", [-3, -1, 1, 4])
@pytest.mark.parametrize("material", [{}, {"opacity": 0.5}])
def test_exposure_multiplies_by_powers_of_2_exactly(stops, shading, material):
    """Every operation after a product with a power of 2 is exact: the same digits."""
    scene = lit_scene(**material)
    plain = rz.render(scene, SIZE, shading=shading, tolerance=0, samples=1)
    frame = rz.render(scene, SIZE, shading=shading, tolerance=0, exposure=stops, samples=1)
    assert plain.color.max() > 0.01
    assert np.array_equal(frame.color, plain.color * np.float32(2.0**stops)) and np.array_equal(
        frame.alpha, plain.alpha
    )


@pytest.mark.parametrize("stops", [-2, 0.5, 2])
def test_the_background_is_not_exposed(stops):
    for material in ({}, {"opacity": 0.5}):
        behind = (0.3, 0.4, 0.2)
        bare = rz.render(lit_scene(**material), SIZE, tolerance=0, exposure=stops, samples=1)
        frame = rz.render(lit_scene(behind, **material), SIZE, tolerance=0, exposure=stops, samples=1)
        expected = bare.color * bare.alpha[..., None] + behind * (1 - bare.alpha[..., None])
        assert (bare.alpha == 0).any() and np.abs(frame.color - expected).max() < 1e-6 * 2**stops + 1e-6


@pytest.mark.parametrize("shading", SHADINGS)
def test_exposure_and_spectra_together(shading):
    material = rz.Material(diffuse=GREENISH, specular=0.0, emissive=REDDISH.scaled(0.1))
    lights = (rz.DirectionalLight(DIRECTION, LAMP), rz.AmbientLight(0.1))
    plain = show(material, lights, shading, background=(0.5, 0.5, 0.5))
    assert plain.color.max() > 0.05
    for stops in (-4, 1, 3):
        frame = show(material, lights, shading, exposure=stops, background=(0.5, 0.5, 0.5))
        assert np.array_equal(frame.color, plain.color * np.float32(2.0**stops))
    half = show(material, lights, shading, exposure=0.5)
    assert np.abs(half.color - plain.color * 2**0.5).max() < 1e-6


def test_exposure_of_pictures_within_the_tolerance():
    """The tolerance is one of the exposed picture."""
    for shading in SHADINGS:
        for stops in (-6, 3):
            exact = rz.render(lit_scene(), SIZE, shading=shading, tolerance=0, exposure=stops, samples=1)
            frame = rz.render(lit_scene(), SIZE, shading=shading, exposure=stops, samples=1)
            assert exact.color.max() > 0.1 * 2.0**stops
            assert np.abs(frame.color - exact.color).max() <= 1 / 4096


def test_scenes_without_spectra_multiply_none():
    materials, lights, ambient = [rz.Material()], [rz.DirectionalLight((0, 0, -1))], [rz.AmbientLight()]
    assert multiply_spectra(materials, lights, ambient, Options()) is None
    assert multiply_spectra(materials, lights, ambient, Options(spectral=81)) is not None
    assert multiply_spectra(materials, [rz.DirectionalLight((0, 0, -1), LAMP)], ambient, Options()) is not None
    products = multiply_spectra(materials, [], [], Options(spectral=20))
    assert products.diffuse.shape == (1, 0, 3) and not products.ambient.any()
