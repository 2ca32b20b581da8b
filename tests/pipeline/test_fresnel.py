"""Check F0 with a colour of its own: by channel, by wavelength, in all ways to shade, and that nobody else pays for
it."""

import numpy as np
import pytest

import rasterizer as rz
from rasterizer.errors import SceneError
from rasterizer.scene.spectrum import rgb_of, samples_of

GOLD = (1.0, 0.78, 0.34)
RAMP = rz.Spectrum((400, 500, 600, 700), (0.1, 0.3, 0.9, 1.0))


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


def test_forms_and_refusals():
    assert rz.Material(fresnel="#808080").fresnel == pytest.approx(0.2158605, abs=1e-6)
    assert rz.Material(fresnel=[0.1, 0.2, 0.3]).fresnel == (0.1, 0.2, 0.3)
    assert rz.Material(fresnel=RAMP).fresnel is RAMP
    for wrong in (-0.1, 1.1, (0.1, 0.2, 1.2), (0.1, 0.2), "nocolour", rz.Spectrum((400, 700), (0.5, 1.5)), True):
        with pytest.raises(SceneError, match="fresnel"):
            rz.Material(fresnel=wrong)
