"""Colours: what people write, and the sRGB curves."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rasterizer.errors import SceneError
from rasterizer.scene.color import linear_from_srgb, linear_from_srgb_bytes, linear_rgb, srgb_from_linear
from rasterizer.scene.spectrum import Spectrum


@pytest.mark.parametrize(
    ("written", "linear"),
    [
        (0.5, (0.5, 0.5, 0.5)),
        (2, (2.0, 2.0, 2.0)),
        (np.float32(0.25), (0.25, 0.25, 0.25)),
        (np.array(0.25), (0.25, 0.25, 0.25)),
        ((0.1, 0.2, 3), (0.1, 0.2, 3.0)),
        (np.array([0.0, 0.5, 1.0]), (0.0, 0.5, 1.0)),
        ("white", (1.0, 1.0, 1.0)),
        (" Black ", (0.0, 0.0, 0.0)),
        ("#f00", (1.0, 0.0, 0.0)),
        ("#00ff00ff", (0.0, 1.0, 0.0)),
        ("rgb(0, 0, 255)", (0.0, 0.0, 1.0)),
    ],
)
def test_every_way_to_write_a_colour(written, linear):
    assert linear_rgb(written) == linear


def test_text_is_srgb_and_numbers_are_linear():
    # IEC 61966-2-1: 0x80 / 255 = 0.50196 decodes to 0.21586
    assert linear_rgb("#808080") == pytest.approx((0.2158605,) * 3, abs=1e-7)
    assert linear_rgb((0.5, 0.5, 0.5)) == (0.5, 0.5, 0.5)


def test_grey_is_exactly_neutral():
    for written in (0.72, "#b8b8b8", "grey", (0.3, 0.3, 0.3)):
        red, green, blue = linear_rgb(written)
        assert red == green == blue


@pytest.mark.parametrize(
    "wrong",
    [
        -0.1,
        math.nan,
        math.inf,
        (0.1, -0.2, 0.3),
        (0.1, math.nan, 0.3),
        (0.1, 0.2),
        (0.1, 0.2, 0.3, 1.0),
        "nocolour",
        "#12",
        "",
        "#ff000080",
        None,
        True,
        {},
        object(),
        np.array([0.5]),
        [[1, 2, 3]],
        1j,
        b"red",
        (None, 1, 2),
        ("red", "red", "red"),
    ],
)
def test_illegal_colours_are_refused_by_name(wrong):
    with pytest.raises(SceneError, match="the lamp"):
        linear_rgb(wrong, "the lamp")


@given(st.floats(0.0, 4.0))
def test_curves_are_inverse(value):
    assert linear_from_srgb(srgb_from_linear(value)) == pytest.approx(value, abs=1e-12)


def test_curves_at_known_points():
    # ends, the joint, and mid grey as tabulated for IEC 61966-2-1
    linear = np.array([0.0, 0.0031308, 0.18, 1.0])
    assert srgb_from_linear(linear) == pytest.approx([0.0, 0.04044994, 0.46135613, 1.0], abs=1e-8)
    assert linear_from_srgb([0.0, 0.04045, 0.5, 1.0]) == pytest.approx([0.0, 0.0031308, 0.2140411, 1.0], abs=1e-7)
    assert linear_from_srgb(1.0) == 1.0


def test_curves_grow_everywhere_and_keep_the_shape():
    steps = np.linspace(-0.1, 2.0, 100_001).reshape(-1, 1)
    for curve in (srgb_from_linear, linear_from_srgb):
        assert curve(steps).shape == steps.shape
        assert (np.diff(curve(steps)[:, 0]) > 0.0).all()
        assert np.isnan(curve(math.nan))


def test_bytes_decode_through_the_table_and_alpha_is_linear():
    colors = np.array([[0, 128, 255, 51]], dtype=np.uint8)
    assert linear_from_srgb_bytes(colors) == pytest.approx(np.array([[0.0, 0.2158605, 1.0, 0.2]]), abs=1e-7)
    back = srgb_from_linear(linear_from_srgb_bytes(np.arange(256, dtype=np.uint8).reshape(-1, 1))) * 255.0
    assert np.array_equal(np.rint(back[:, 0]), np.arange(256))


def test_a_spectrum_stays_one():
    # It is a triple of linear RGB itself, and tells the wavelengths to those who ask.
    spectrum = Spectrum([500, 520, 540], [0, 1, 0])
    assert min(spectrum) < 0.0
    assert linear_rgb(spectrum, "the lamp") is spectrum
