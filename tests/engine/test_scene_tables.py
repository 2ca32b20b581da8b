"""Check spectral colour and exposure in whole pictures: products wavelength by wavelength, the same in all methods and
models."""

from itertools import cycle, product

import numpy as np
from helpers.pinhole import SHADINGS, octasphere, unit

import rasterizer as rz
from rasterizer.scene.spectrum import D65, MATCHING, WAVELENGTHS, Spectrum

SIZE = (20, 15)
SHEET = np.array([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], float)
CAMERA = rz.Camera.orthographic((0, 0, 5), (0, 0, 0), height=10)
DIRECTION = (0.3, -0.4, -1)
COSINE = -unit(np.array(DIRECTION))[2]
GREENISH = Spectrum((380, 480, 520, 560, 640, 780), (0.1, 0.2, 0.9, 0.8, 0.3, 0.1))
REDDISH = Spectrum((400, 550, 600, 700), (0.05, 0.1, 0.8, 0.9))
LAMP = Spectrum.blackbody(2856)
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


# ── exposure ────────────────────────────────────────────────────────────────────────────────────────────


def exposed(shading, **options):
    """A picture of a ball; `options` are those of the picture, and the material's opacity."""
    vertices, faces = octasphere(2)
    lights = (rz.AmbientLight(0.1), rz.DirectionalLight(DIRECTION, (0.5, 0.4, 0.3)), rz.PointLight((2, 3, 4), 0.3))
    look = {"opacity": options.pop("opacity", 1.0)}
    material = rz.Material(diffuse=(0.6, 0.5, 0.4), specular=0.2, emissive=0.02, **look)
    mesh = rz.Mesh(vertices * 3, faces, material=material)
    return draw(mesh, lights, shading, **options)


def test_exposure_multiplies_by_powers_of_2_exactly():
    """Every operation after a product with a power of 2 is exact: the same digits."""
    for shading, opacity in product(SHADINGS, (1.0, 0.5)):
        plain = exposed(shading, opacity=opacity)
        assert plain.color.max() > 0.01
        for stops in (-3, 4):
            frame, case = exposed(shading, opacity=opacity, exposure=stops), f"{shading}, {opacity}, {stops} stops"
            assert np.array_equal(frame.color, plain.color * np.float32(2.0**stops)), case
            assert np.array_equal(frame.alpha, plain.alpha), case
    background = (0.2, 0.4, 0.6)
    over = exposed("flat", background=background, exposure=4).color[0, 0]
    assert np.abs(over - background).max() < 1e-7, "the background is not exposed"
