"""Colours in sRGB: decoded by `srgb`, and told from linear ones where they are taken for them."""

import numpy as np
import pytest

import rasterizer as rz
from rasterizer.scene.color import linear_from_srgb, srgb_from_linear


def test_it_decodes_what_hex_text_means():
    assert tuple(rz.srgb((255, 128, 0))) == rz.Material(diffuse="#ff8000").diffuse
    assert rz.Material(diffuse=rz.srgb((255, 128, 0))) == rz.Material(diffuse="#ff8000")


@pytest.mark.parametrize("dtype", [np.uint8, np.int64, np.uint16])
def test_whole_numbers_count_to_255_and_floats_to_1(dtype):
    levels = np.arange(256).reshape(-1, 1).repeat(3, axis=1)
    expected = linear_from_srgb(levels / 255.0)
    assert np.array_equal(rz.srgb(levels.astype(dtype)), expected) and np.array_equal(rz.srgb(levels / 255.0), expected)
    assert np.abs(srgb_from_linear(expected) * 255 - levels).max() < 1e-9


def test_alpha_is_linear_already():
    assert rz.srgb([[255, 0, 0, 51]])[0, 3] == 0.2 and rz.srgb((0.5, 0.5, 0.5, 0.5))[3] == 0.5
    assert rz.srgb(np.zeros((4, 5, 3), np.uint8)).shape == (4, 5, 3) and rz.srgb(np.zeros((0, 3))).shape == (0, 3)


@pytest.mark.parametrize(
    "bad", ["red", None, 5, (1, 2), (256, 0, 0), (-1, 0, 0), (1.5, 0, 0), (np.nan, 0, 0), [["a"] * 3]]
)
def test_illegal_colours(bad):
    with pytest.raises(rz.SceneError, match="colours must be"):
        rz.srgb(bad)


@pytest.mark.parametrize("field", ["diffuse", "ambient", "specular", "emissive"])
@pytest.mark.parametrize("color", [(255, 128, 0), [255, 128, 0], np.array([255, 128, 0], np.uint8)])
def test_whole_numbers_above_one_are_no_colour_of_a_surface(field, color):
    with pytest.raises(rz.SceneError, match=rf'the material\'s {field} must be linear, .*"#ff8000" or rz.srgb'):
        rz.Material(**{field: color})


def test_the_same_of_a_background_but_not_of_a_grey():
    mesh = ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.raises(rz.SceneError, match=r'the background .*given whole numbers, \(30, 30, 30\): .*"#1e1e1e"'):
        rz.render(mesh, 8, background=(30, 30, 30))
    assert rz.Material(specular=2).specular == (2.0, 2.0, 2.0)  # a grey is a coefficient
    with pytest.raises(rz.SceneError, match='"#rrggbb"'):
        rz.Material(diffuse=(300, 0, 0))


def test_ones_and_zeros_floats_and_lights_are_as_they_were():
    assert rz.Material(diffuse=(1, 0, 0)).diffuse == (1.0, 0.0, 0.0) == rz.Material(diffuse="red").diffuse
    assert rz.Material(emissive=(255.0, 128.0, 0.0)).emissive == (255.0, 128.0, 0.0)
    assert rz.Material(emissive=(2.0, 1, 0)).emissive == (2.0, 1.0, 0.0)
    assert rz.PointLight((0, 0, 1), (100, 90, 80)).color == (100.0, 90.0, 80.0)
