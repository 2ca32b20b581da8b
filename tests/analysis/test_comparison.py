"""Comparisons: against a plain computation, and by properties that any distance has."""

import math
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import rasterizer as rz
from rasterizer.frame import Frame, Stats
from rasterizer.scene.color import linear_from_srgb_bytes

STATS = Stats(1, 0, 0, 1, 1, 1, 1, 0.0)
PICTURES = arrays(np.uint8, (3, 5, 3), elements=st.integers(0, 255))


def make_frame(levels, color=None, alpha=255) -> Frame:
    height, width, _ = levels.shape
    rgba = np.full((height, width, 4), alpha, np.uint8)
    rgba[..., :3] = levels
    return Frame(rgba, {} if color is None else {"color": color}, STATS, (width, height))


@given(PICTURES, PICTURES, st.booleans())
@settings(max_examples=30, deadline=None)
def test_levels_against_a_plain_computation(a, b, are_near):
    if are_near:  # two steps at most
        b = np.clip(a + (b % 5).astype(np.int16) - 2, 0, 255).astype(np.uint8)
    steps = [abs(int(x) - int(y)) for x, y in zip(a.ravel(), b.ravel(), strict=True)]
    result = rz.compare(a, b)
    assert result.levels == max(steps) and result.over_one == sum(step > 1 for step in steps)
    assert result.max == pytest.approx(max(steps) / 255)
    assert result.rms == pytest.approx(math.sqrt(sum(step**2 for step in steps) / len(steps)) / 255)
    assert result == rz.compare(b, a) == rz.compare(make_frame(a), make_frame(b))


def test_a_picture_equals_itself():
    a = np.random.default_rng(1).integers(0, 256, (3, 5, 3), np.uint8)
    result = rz.compare(a, a.copy())
    assert result == rz.Comparison(max=0.0, rms=0.0, psnr=math.inf, levels=0, over_one=0, coverage=0)
    assert str(result) == "equal"


def test_linear_intensities_count_where_both_have_them():
    levels = np.zeros((2, 2, 3), np.uint8)
    color = np.full((2, 2, 3), 0.5, np.float32)
    a, b = make_frame(levels, color), make_frame(levels, color + np.float32(0.25))
    assert rz.compare(a, b).max == 0.25 and rz.compare(a, b).levels == 0
    assert rz.compare(a, b).psnr == pytest.approx(20 * math.log10(4))
    assert rz.compare(a, make_frame(levels)).max == 0.0


def test_linear_arrays_are_encoded_for_levels():
    result = rz.compare(np.array([[0.0, 0.5, 1.5]]), np.array([[[0], [188], [255]]], np.uint8))
    assert (result.max, result.levels) == (0.0, 0)
    assert rz.compare(np.zeros((1, 1)), np.array([[1 / 3294]])).levels == 1


def test_alpha_is_compared_as_coverage():
    levels = np.zeros((2, 2, 3), np.uint8)
    half = np.dstack([levels, np.array([[255, 255], [255, 127]], np.uint8)])
    assert rz.compare(make_frame(levels), half).coverage == 1
    assert rz.compare(make_frame(levels), half).max == 0.0
    assert rz.compare(make_frame(levels), levels).coverage == 0
    text = str(rz.compare(make_frame(levels), half))
    assert "1 pixels covered otherwise" in text and "\n" not in text


def test_what_is_no_picture():
    for a, b, message in (
        (np.zeros((2, 2, 3)), np.zeros((2, 3, 3)), "2x2 with 3 channels and 3x2"),
        (np.zeros((2, 2, 2)), np.zeros((2, 2, 2)), "float64 of the shape"),
        (np.zeros((0, 2)), np.zeros((0, 2)), "shape"),
        (np.full((2, 2), np.inf), np.zeros((2, 2)), "finite"),
        ("a.png", "b.png", "given str"),
        (Frame(None, {}, STATS, (1, 1)), np.zeros((1, 1)), "no picture"),
    ):
        with pytest.raises(rz.SceneError, match=message):
            rz.compare(a, b)


# ── CIEDE2000, by scikit-image: the pairs that its authors publish ─────────────────────────────────────────


def test_difference_of_pictures():
    pytest.importorskip("skimage", reason="scikit-image (the extra `bench`) isn't installed")
    rng = np.random.default_rng(5)
    bytes_ = rng.integers(0, 256, (300, 250, 3), np.uint8)  # more pixels than are looked at together
    other = bytes_.copy()
    other[7, 9] ^= 1
    difference = rz.color_difference(bytes_, other)
    assert difference.shape == (300, 250) and np.flatnonzero(difference).tolist() == [7 * 250 + 9]
    linear, changed = (linear_from_srgb_bytes(each[:9]) for each in (bytes_, other))
    assert np.abs(rz.color_difference(linear, changed) - difference[:9]).max() <= 1e-9


def test_what_cannot_be_compared(monkeypatch):
    for a, b, words in (
        (np.zeros((2, 3, 3)), np.zeros((3, 2, 3)), "one size"),
        (np.zeros((2, 3)), np.zeros((2, 3)), "three channels"),
        ("a", "b", "a picture must be"),
    ):
        with pytest.raises(rz.SceneError, match=words):
            rz.color_difference(a, b)
    monkeypatch.setitem(sys.modules, "skimage.color", None)
    with pytest.raises(rz.SceneError, match="^a colour difference needs scikit-image: pip install scikit-image$"):
        rz.color_difference(np.zeros((2, 3, 3)), np.zeros((2, 3, 3)))
