"""Spectra: the tables, what the eye makes of a spectrum, neutrality, lamps, and RGB colours as spectra."""

import math

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.refusals import assert_refused

from rasterizer.errors import SceneError
from rasterizer.scene.color import linear_rgb
from rasterizer.scene.lights import DirectionalLight
from rasterizer.scene.material import Material
from rasterizer.scene.spectrum import (
    D65,
    MATCHING,
    WAVELENGTHS,
    Spectrum,
    daylight,
    rgb_basis,
    rgb_of,
    rgb_weights,
    samples_of,
    standard_observer,
    xyz_weights,
)

EVERY_N = pytest.mark.parametrize("n", [3, 4, 16, 80, 81, 82, 401])


def chromaticity(spectrum):
    xyz = spectrum.at(WAVELENGTHS) @ xyz_weights(81)
    return xyz[:2] / xyz.sum()


def line(wavelength) -> Spectrum:
    """A colour that is nearly of one wavelength."""
    return Spectrum((wavelength - 5, wavelength, wavelength + 5), (0, 1, 0))


# --- tables -------------------------------------------------------------------------------------------------


def test_tables_have_the_published_sums_and_peaks():
    assert not differences(WAVELENGTHS, np.arange(380, 781, 5))
    assert MATCHING.shape == (81, 3) and D65.shape == (81,)
    # The sums over 380, 385, .. 780 nm of the published tables.
    assert MATCHING.sum(axis=0) == pytest.approx([21.371524, 21.371327, 21.371540], abs=1e-9)
    assert D65.sum() == pytest.approx(7092.7234, abs=1e-9)
    assert MATCHING[:, 1].max() == MATCHING[WAVELENGTHS == 555, 1] == 1.0
    assert D65[WAVELENGTHS == 560] == 100.0
    with pytest.raises(ValueError, match="read-only"):
        D65[0] = 1.0


# --- neutrality and sampling --------------------------------------------------------------------------------


@EVERY_N
def test_white_has_luminance_1_and_few_samples_keep_its_chromaticity(n):
    xyz = xyz_weights(n).sum(axis=0)
    assert xyz[1] == pytest.approx(1.0, abs=1e-14)
    if n <= 81:
        assert xyz == pytest.approx(xyz_weights(81).sum(axis=0), rel=1e-13)
    assert xyz[:2] / xyz.sum() == pytest.approx([0.31272, 0.32903], abs=1e-4)
    assert xyz_weights(n).min() >= 0.0


# --- what colours come out ----------------------------------------------------------------------------------


def test_the_observer_and_daylight_make_the_colour_of_a_surface_in_a_light():
    """The sum that CIE 15 writes down, by the public functions, is what a spectrum says of itself."""
    nm = np.arange(380, 781, 5)
    surface, lamp = Spectrum.of_rgb("tan"), Spectrum.blackbody(2856)
    both = Spectrum(nm, surface.at(nm) * lamp.at(nm))
    seen = daylight(nm)[:, None] * standard_observer(nm)
    assert np.allclose((surface.at(nm) * lamp.at(nm)) @ seen / seen[:, 1].sum(), both.xyz, rtol=1e-3)
    assert np.allclose(Spectrum.flat(1).xyz / Spectrum.flat(1).xyz.sum(), (0.3127, 0.3290, 0.3583), atol=1e-4)
    assert standard_observer(555).tolist() == MATCHING[35].tolist() and not standard_observer([300, 900]).any()


def test_black_bodies():
    # D65 is the daylight nearest to a black body of 6504 K, which is a little more purple.
    assert Spectrum.blackbody(6504) == pytest.approx((1.0, 1.0, 1.0), abs=0.05)
    # Illuminant A: 2856 K by the temperature scale of its time (CIE 15:2004, table T.3).
    assert chromaticity(Spectrum.blackbody(2856)) == pytest.approx([0.44757, 0.40745], abs=1e-4)
    # Wyszecki & Stiles 1982, table 1(3.11), computed with c2 = 14388 um K
    assert chromaticity(Spectrum.blackbody(10_000)) == pytest.approx([0.2807, 0.2884], abs=2e-4)
    assert chromaticity(Spectrum.blackbody(2000)) == pytest.approx([0.5267, 0.4133], abs=2e-4)
    for kelvin in (100, 1e3, 1e4, 1e300):
        assert luminance(Spectrum.blackbody(kelvin)) == pytest.approx(1.0, abs=1e-12)


def luminance(spectrum) -> float:
    return spectrum.at(WAVELENGTHS) @ xyz_weights(81)[:, 1]


def test_lamps_are_scaled_to_white_whatever_their_unit():
    assert Spectrum.of_power(WAVELENGTHS, D65) == pytest.approx((1, 1, 1), abs=1e-12)
    for unit in (1e-300, 1.0, 1e300):
        assert Spectrum.of_power(WAVELENGTHS, D65 * unit).values == pytest.approx(1.0, abs=1e-12)
    lamp = Spectrum.of_power([300, 500, 502.5, 900], [1, 2, 1, 4])
    assert luminance(lamp) == pytest.approx(1.0, abs=1e-12)
    assert 502.5 in lamp.wavelengths and lamp.wavelengths[0] == 380 and lamp.wavelengths[-1] == 780
    at_500, at_555 = lamp.at([500, 555]) * D65[[24, 35]]
    assert at_555 / at_500 == pytest.approx((1 + 3 * 52.5 / 397.5) / 2, rel=1e-12)


# --- RGB colours as spectra ---------------------------------------------------------------------------------


@EVERY_N
def test_rgb_comes_back_at_any_n(n):
    for rgb in [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.2, 0.7, 3.0), (-0.1, 0.5, 0.2)]:
        assert rgb_of(samples_of(rgb, n)) == pytest.approx(rgb, abs=1e-12)
    assert rgb_weights(n).T @ rgb_basis(n) == pytest.approx(np.eye(3), abs=1e-12)
    assert samples_of((0.2, 0.7, 3.0), n) == pytest.approx(rgb_basis(n) @ (0.2, 0.7, 3.0), abs=1e-12)


def test_of_rgb_reads_every_way_to_write_a_colour():
    for rgb in np.random.default_rng(3).uniform(0, 4, (9, 3)):
        assert Spectrum.of_rgb(rgb) == pytest.approx(rgb, abs=1e-12)
    assert Spectrum.of_rgb("orange") == pytest.approx(linear_rgb("orange"), abs=1e-12)
    assert not differences(Spectrum.of_rgb(0.5).values, 0.5)
    seen = Spectrum.of_rgb(line(520))
    assert seen == pytest.approx(tuple(line(520)), abs=1e-12)
    with pytest.raises(SceneError, match="spectrum's color"):
        Spectrum.of_rgb("nocolour")


# --- the class ----------------------------------------------------------------------------------------------


def test_a_spectrum_is_its_linear_rgb():
    spectrum = Spectrum([400, 500, 600], [0.1, 0.9, 0.2])
    assert isinstance(spectrum, tuple) and len(spectrum) == 3
    assert [component for component in spectrum if type(component) is not float] == []
    assert not differences(np.array(spectrum), rgb_of(spectrum.at(WAVELENGTHS)))
    red, green, blue = spectrum
    assert green > blue > red
    assert linear_rgb(spectrum) is spectrum
    assert DirectionalLight((0, 0, -1), spectrum).color is spectrum
    assert Material(diffuse=spectrum).ambient is spectrum


def test_values_between_and_beyond_samples():
    spectrum = Spectrum([400, 500], [1, 3])
    assert not differences(spectrum.at([[300, 400], [450, 900]]), [[1, 1], [2, 3]])
    assert spectrum.at(425) == 1.5
    assert Spectrum([550], [0.4]) == pytest.approx((0.4, 0.4, 0.4), abs=1e-15)
    with pytest.raises(SceneError, match="wavelengths must be finite numbers; given 'red'"):
        spectrum.at("red")


def test_what_is_no_spectrum_is_refused():
    two, finite = [400, 500], "values must be finite numbers"
    cases = [
        ((two, [1, 2, 3]), "as many samples of values as wavelengths; given 3 for 2"),
        (([400, 400], [1, 2]), "must increase; given"),
        (([0.4, 0.5], [1, 2]), r"in nm and reach into 380\.\.780; given 0\.4\.\.0\.5"),
        (([800, 900], [1, 2]), r"reach into 380\.\.780; given 800\.\.900"),
        (([400, 500, 600], [1, -0.5, 2]), r"at least 0; given -0\.5 at 500 nm"),
        *(((two, values), finite) for values in ([1, math.inf], ["1", "2"], [True, False], [1j, 2], [[1, 2], 3])),
        (([], []), "wavelengths must be a row of numbers"),
        ((400, 1), "wavelengths must be a row of numbers; given 400"),
    ]
    assert_refused(lambda given: Spectrum(*given), cases, SceneError)
    greys, hot = [-1, math.nan, "grey", None, [1], True], [0, 99.9, -5000, math.inf, "hot", None]
    assert_refused(Spectrum.flat, [(each, "spectrum") for each in greys], SceneError)
    assert_refused(Spectrum.blackbody, [(each, "black body's temperature must be") for each in hot], SceneError)
    dark = "lamp's power must be above 0 at some of 380, 385"
    cases = [
        ((two, [1, -1]), "power of a spectrum must be at least 0; given -1 at 500 nm"),
        (([501, 502, 503], [0, 1, 0]), dark),  # a line between two of the wavelengths that are seen
    ]
    assert_refused(lambda given: Spectrum.of_power(*given), cases, SceneError)
