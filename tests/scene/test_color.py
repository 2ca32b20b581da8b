"""Colours: what people write, linear or in sRGB, and the curves between the two."""

import math

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.refusals import assert_refused

import rasterizer as rz
from rasterizer.errors import SceneError
from rasterizer.scene.color import linear_from_srgb, linear_from_srgb_bytes, linear_rgb, srgb_from_linear


def test_every_way_to_write_a_colour():
    """Text is sRGB, numbers are linear; greys are exactly neutral."""
    for written, linear in (
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
    ):
        assert linear_rgb(written) == linear, f"{written!r}: {linear_rgb(written)} != {linear}"
    # IEC 61966-2-1: 0x80 / 255 = 0.50196 decodes to 0.21586
    assert linear_rgb("#808080") == pytest.approx((0.2158605,) * 3, abs=1e-7)
    for written in (0.72, "#b8b8b8", "grey", (0.3, 0.3, 0.3)):
        assert len(set(linear_rgb(written))) == 1, f"{written}: {len(set(linear_rgb(written)))} != 1"


def test_illegal_colours_are_refused_by_name():
    wrong = [
        -0.1, math.nan, math.inf, (0.1, -0.2, 0.3), (0.1, math.nan, 0.3), (0.1, 0.2), (0.1, 0.2, 0.3, 1.0), "nocolour",
        "#12", "", "#ff000080", None, True, {}, object(), np.array([0.5]), [[1, 2, 3]], 1j, b"red", (None, 1, 2),
        ("red", "red", "red"),
    ]  # fmt: skip
    assert_refused(lambda each: linear_rgb(each, "the lamp"), [(each, "the lamp") for each in wrong], SceneError)


def test_curves_at_known_points():
    # ends, the joint, and mid grey as tabulated for IEC 61966-2-1
    linear = np.array([0.0, 0.0031308, 0.18, 1.0])
    assert srgb_from_linear(linear) == pytest.approx([0.0, 0.04044994, 0.46135613, 1.0], abs=1e-8)
    assert linear_from_srgb([0.0, 0.04045, 0.5, 1.0]) == pytest.approx([0.0, 0.0031308, 0.2140411, 1.0], abs=1e-7)
    assert linear_from_srgb(1.0) == 1.0


def test_bytes_decode_through_the_table_and_alpha_is_linear():
    colors = np.array([[0, 128, 255, 51]], dtype=np.uint8)
    assert linear_from_srgb_bytes(colors) == pytest.approx(np.array([[0.0, 0.2158605, 1.0, 0.2]]), abs=1e-7)
    back = srgb_from_linear(linear_from_srgb_bytes(np.arange(256, dtype=np.uint8).reshape(-1, 1))) * 255.0
    assert not differences(np.rint(back[:, 0]), np.arange(256))


# --- sRGB, asked for by name, and taken for linear by mistake -----------------------------------------------


def test_srgb_decodes_whole_numbers_up_to_255_and_floats_up_to_1():
    assert rz.Material(diffuse=rz.srgb((255, 128, 0))) == rz.Material(diffuse="#ff8000")
    levels = np.arange(256).reshape(-1, 1).repeat(3, axis=1)
    expected = linear_from_srgb(levels / 255.0)
    for given_levels in (*(levels.astype(dtype) for dtype in (np.uint8, np.int64, np.uint16)), levels / 255.0):
        assert np.array_equal(rz.srgb(given_levels), expected), given_levels.dtype
    assert rz.srgb([[255, 0, 0, 51]])[0, 3] == 0.2 and rz.srgb((0.5, 0.5, 0.5, 0.5))[3] == 0.5, "alpha is linear"
    assert rz.srgb(np.zeros((4, 5, 3), np.uint8)).shape == (4, 5, 3) and rz.srgb(np.zeros((0, 3))).shape == (0, 3)
    bad = ["red", None, 5, (1, 2), (256, 0, 0), (-1, 0, 0), (1.5, 0, 0), (np.nan, 0, 0), [["a"] * 3]]
    assert_refused(rz.srgb, [(each, "colours must be") for each in bad], SceneError)


def test_whole_numbers_above_one_are_no_colour():
    ways = (255, 128, 0), [255, 128, 0], np.array([255, 128, 0], np.uint8), (255, 128, 0)
    fields = "diffuse", "ambient", "specular", "emissive"
    said = 'the material\'s {} must be linear, .*"#ff8000" or rz.srgb'
    cases = [({field: way}, said.format(field)) for field, way in zip(fields, ways, strict=True)]
    cases.append(({"diffuse": (300, 0, 0)}, '"#rrggbb"'))
    assert_refused(lambda given: rz.Material(**given), cases, SceneError)
    mesh = ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.raises(SceneError, match=r'the background .*given whole numbers, \(30, 30, 30\): .*"#1e1e1e"'):
        rz.render(mesh, 8, background=(30, 30, 30))
    others = [
        (lambda color: rz.DirectionalLight((0, 0, -1), color=color), "the directional light's color"),
        (lambda color: rz.AreaLight((0, 0, 0), (1, 0, 0), (0, 1, 0), color=color), "the area light's color"),
        (lambda color: rz.DepthCue(1, color=color), "the depth cue's color"),
        (lambda color: rz.Options(edge_color=color), "the edges' color"),
    ]
    for make, whose in others:
        with pytest.raises(SceneError, match=f'{whose} must be linear, .*given whole numbers, .*"#ff8000"'):
            make((255, 128, 0))


def test_ones_and_zeros_greys_floats_and_lights_may_be_above_one():
    assert rz.Material(diffuse=(1, 0, 0)).diffuse == (1.0, 0.0, 0.0) == rz.Material(diffuse="red").diffuse
    assert rz.Material(specular=2).specular == (2.0, 2.0, 2.0)  # a grey is a coefficient
    assert rz.Material(emissive=(255.0, 128.0, 0.0)).emissive == (255.0, 128.0, 0.0)
    assert rz.Material(emissive=(2.0, 1, 0)).emissive == (2.0, 1.0, 0.0)
    assert rz.PointLight((0, 0, 1), (100.0, 90, 80)).color == (100.0, 90.0, 80.0)
