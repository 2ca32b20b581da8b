"""Check spectral colour and exposure in whole pictures: products wavelength by wavelength, the same in all methods and
models."""

from itertools import cycle, product

import numpy as np
from helpers.arrays import differences
from helpers.pinhole import SHADINGS, octasphere, unit

import rasterizer as rz
from rasterizer.engine.scene_tables import multiply_colors
from rasterizer.options import Options
from rasterizer.scene.spectrum import D65, MATCHING, WAVELENGTHS, Spectrum

SIZE = (20, 15)
SHEET = np.array([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], float)
CAMERA = rz.Camera.orthographic((0, 0, 5), (0, 0, 0), height=10)
DIRECTION = (0.3, -0.4, -1)
COSINE = -unit(np.array(DIRECTION))[2]
GREENISH = Spectrum((380, 480, 520, 560, 640, 780), (0.1, 0.2, 0.9, 0.8, 0.3, 0.1))
REDDISH = Spectrum((400, 550, 600, 700), (0.05, 0.1, 0.8, 0.9))
LAMP = Spectrum.blackbody(2856)
NO_SHARE = np.zeros(1, bool)  # the one light of a test is no ambient share
LASER = Spectrum((510, 515, 520, 525, 530), (0, 2, 6, 2, 0))  # no display shows it: its red is negative


def draw(mesh, lights, shading="phong", background=None, **options):
    scene = rz.Scene([mesh], lights, CAMERA, background)
    return rz.render(scene, SIZE, shading=shading, **{"samples": 1, "tolerance": 0} | options)


def show(material, lights, shading="phong", **options):
    return draw(rz.Mesh(SHEET, [[0, 1, 2, 3]], material=material), lights, shading, **options)


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


def test_a_flat_reflectance_under_white_is_neutral():
    light = (rz.DirectionalLight((0, 0, -1), 1.0), rz.AmbientLight(0.25))
    for n, shading, grey in zip((None, 3, 16, 81, 401), cycle(SHADINGS), cycle((0.5, 0.05, 1.0))):
        frame = show(rz.Material(diffuse=Spectrum.flat(grey), specular=0), light, shading, spectral=n)
        off = np.abs(frame.color / np.float32(grey * 1.25) - 1).max()  # the products are exact to 1e-12
        assert off <= 4e-7, f"{n} samples, {shading}, {grey}: {off:.3g} > 4e-7"
        assert np.ptp(frame.rgb, axis=-1).max() == 0
        materials = [rz.Material(diffuse=Spectrum.flat(0.5), specular=0.2)]
        lights, ambient = [rz.DirectionalLight((0, 0, -1))], [rz.AmbientLight(0.3)]
        if n is not None:
            found = multiply_colors(materials, lights, NO_SHARE, ambient, Options(spectral=n))
            for values, expected in zip(found[1:], (0.0, 0.15, 0.5, 0.2, 0.0, 0.0), strict=True):
                assert np.abs(values - expected).max() < 1e-12, f"{n} samples: {values} != {expected}"


def test_the_product_of_two_spectra_is_summed_over_the_wavelengths():
    for (lamp, reflectance), shading in zip(
        product((LAMP, GREENISH, LASER, 0.8), (GREENISH, REDDISH, 0.6)), cycle((*SHADINGS, "phong"))
    ):
        material = rz.Material(diffuse=reflectance, ambient=REDDISH, specular=0, emissive=GREENISH.scaled(0.1))
        frame = show(material, (rz.DirectionalLight(DIRECTION, lamp), rz.AmbientLight(LAMP.scaled(0.2))), shading)
        expected = seen(at(reflectance) * at(lamp)) * COSINE + seen(at(REDDISH) * at(LAMP) * 0.2)
        error = np.abs(frame.color - expected - seen(at(GREENISH) * 0.1)).max()
        assert error < 2e-6, f"{lamp} on {reflectance}, {shading}: {error:.3g} > 2e-6"
    # Channels alone would give another colour.
    assert np.abs(seen(at(GREENISH) * at(LASER)) - np.array(GREENISH) * np.array(LASER)).max() > 0.05


def test_rgb_colours_under_white_light_stay_what_they_are():
    """The spectrum of an RGB colour has that RGB; of two colours the product is another matter."""
    vertices, faces = octasphere(2)
    material = rz.Material(diffuse=(0.7, 0.3, 0.2), ambient=(0.2, 0.5, 0.6), specular=0.3, emissive=(0.1, 0, 0.05))
    lights = (rz.AmbientLight(0.2), rz.DirectionalLight(DIRECTION, 0.6), rz.PointLight((2, 2, 3), 0.4, "1/(d+1)"))
    mesh = rz.Mesh(vertices * 3, faces, material=material)
    for n, shading in zip((16, 81, 200), SHADINGS, strict=True):
        plain, spectral = (draw(mesh, lights, shading, spectral=each) for each in (None, n))
        error = np.abs(spectral.color - plain.color).max()
        assert error < 2e-6 and np.ptp(plain.color) > 0.3, f"{n} samples, {shading}: {error:.3g} > 2e-6"


def test_negative_components_stay_in_colours_and_end_in_bytes():
    for shading, tolerance in product(SHADINGS, (0, 1 / 4096)):
        light = rz.DirectionalLight((0, 0, -1), LASER)
        frame = show(rz.Material(diffuse=1.0, specular=0), light, shading, tolerance=tolerance)
        expected, case = np.array(LASER), f"{shading}, {tolerance:.2g}"
        assert expected.min() < -0.05 and np.abs(frame.color - expected).max() < max(tolerance, 2e-6), case
        assert (frame.rgb[..., expected < 0] == 0).all() and (frame.rgb.max(axis=-1) > 0).all(), case
    color = np.array(LASER) * 9
    for policy, samples in (("clamp", 1), ("global", 4), ("local", 1), ("local", 4), ("clamp", 4), ("global", 1)):
        light = rz.DirectionalLight((0, 0, -1), LASER.scaled(9))
        frame = show(rz.Material(diffuse=1.0, specular=0), light, color_range=policy, samples=samples)
        assert np.abs(frame.color - color).max() < 2e-5 and color.max() > 1, f"{policy}, {samples}"
        assert (frame.rgb[..., 0] == 0).all() and (frame.rgb[..., 1] == 255).all(), f"{policy}, {samples}"


def test_highlights_under_a_coloured_lamp():
    """With grey coefficients the picture is the lamp's RGB times that under white light of 1."""
    mesh = rz.Mesh(octasphere(2)[0] * 3, octasphere(2)[1], material=rz.Material(diffuse=0.5, specular=0.4))
    for shading in SHADINGS:
        dark, white, lit = (
            draw(mesh, (rz.AmbientLight(0.3), rz.DirectionalLight(DIRECTION, color)), shading).color
            for color in (0.0, 1.0, LAMP)
        )
        error = np.abs(lit - (dark + (white - dark) * np.array(LAMP))).max()
        assert error < 3e-6 and white.max() > 0.5, f"{shading}: {error:.3g} > 3e-6"


# ── exposure ────────────────────────────────────────────────────────────────────────────────────────────


def exposed(shading, background=None, tolerance=0, **options):
    """A picture of a ball; `options` are those of the picture, and the material's opacity."""
    vertices, faces = octasphere(2)
    lights = (rz.AmbientLight(0.1), rz.DirectionalLight(DIRECTION, (0.5, 0.4, 0.3)), rz.PointLight((2, 3, 4), 0.3))
    look = {"opacity": options.pop("opacity", 1.0)}
    material = rz.Material(diffuse=(0.6, 0.5, 0.4), specular=0.2, emissive=0.02, **look)
    mesh = rz.Mesh(vertices * 3, faces, material=material)
    return draw(mesh, lights, shading, background, tolerance=tolerance, **options)


def test_exposure_multiplies_by_powers_of_2_exactly():
    """Every operation after a product with a power of 2 is exact: the same digits."""
    for shading, opacity in product(SHADINGS, (1.0, 0.5)):
        plain = exposed(shading, opacity=opacity)
        assert plain.color.max() > 0.01
        for stops in (-3, 4):
            frame, case = exposed(shading, opacity=opacity, exposure=stops), f"{shading}, {opacity}, {stops} stops"
            assert np.array_equal(frame.color, plain.color * np.float32(2.0**stops)), case
            assert np.array_equal(frame.alpha, plain.alpha), case


def test_the_background_is_not_exposed():
    behind = (0.3, 0.4, 0.2)
    for stops, opacity in ((-2, 1.0), (0.5, 0.5), (2, 1.0), (2, 0.5)):
        options = {"opacity": opacity, "exposure": stops}
        bare, frame = exposed("gouraud", **options), exposed("gouraud", behind, **options)
        expected = bare.color * bare.alpha[..., None] + behind * (1 - bare.alpha[..., None])
        error = np.abs(frame.color - expected).max()
        assert (bare.alpha == 0).any() and error < 1e-6 * (2**stops + 1), f"{stops} stops, {opacity}: {error:.3g}"


def test_exposure_and_spectra_together():
    material = rz.Material(diffuse=GREENISH, specular=0.0, emissive=REDDISH.scaled(0.1))
    lights = (rz.DirectionalLight(DIRECTION, LAMP), rz.AmbientLight(0.1))
    for shading in SHADINGS:
        plain = show(material, lights, shading, background=(0.5, 0.5, 0.5))
        assert plain.color.max() > 0.05
        for stops in (-4, 0.5, 3):
            frame = show(material, lights, shading, exposure=stops, background=(0.5, 0.5, 0.5))
            error = np.abs(frame.color - plain.color * np.float32(2.0**stops)).max()
            assert error <= (1e-6 if stops == 0.5 else 0), f"{shading}, {stops} stops: {error:.3g}"


def test_exposure_of_pictures_within_the_tolerance():
    """The tolerance is one of the exposed picture."""
    for shading, stops in zip(SHADINGS * 2, (-6, 3, 3, 3, -6, -6), strict=True):
        exact, frame = (exposed(shading, exposure=stops, tolerance=tolerance) for tolerance in (0, 1 / 4096))
        error = np.abs(frame.color - exact.color).max()
        assert exact.color.max() > 0.1 * 2.0**stops and error <= 1 / 4096, f"{shading}, {stops} stops: {error:.3g}"


def test_scenes_without_spectra_multiply_none():
    materials, lights, ambient = [rz.Material()], [rz.DirectionalLight((0, 0, -1))], [rz.AmbientLight()]
    assert multiply_colors(materials, lights, NO_SHARE, ambient, Options()) is None
    assert multiply_colors(materials, lights, NO_SHARE, ambient, Options(spectral=81)) is not None
    assert multiply_colors(materials, [rz.DirectionalLight((0, 0, -1), LAMP)], NO_SHARE, ambient, Options()) is not None
    products = multiply_colors(materials, [], NO_SHARE[:0], [], Options(spectral=20))
    assert products.diffuse.shape == (1, 0, 3) and not differences(products.ambient, 0)
