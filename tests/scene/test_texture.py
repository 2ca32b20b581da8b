"""Tests of the texture: every way to give a picture, the sRGB curve, and mipmaps that are exact means of areas."""

import io
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from rasterizer.errors import ModelError, SceneError
from rasterizer.scene.color import linear_from_srgb
from rasterizer.scene.texture import Texture, read_picture

RGB = np.array([[[0, 128, 255], [10, 20, 30]], [[40, 50, 60], [70, 80, 90]], [[255, 0, 0], [0, 0, 0]]], np.uint8)


# --- forms of an image --------------------------------------------------------------------------------------


def test_bytes_are_decoded_and_floats_are_linear():
    texture = Texture(RGB)
    assert texture.image.shape == (3, 2, 4) and texture.image.dtype == np.float32
    np.testing.assert_allclose(texture.image[..., :3], linear_from_srgb(RGB / 255.0), rtol=1e-7)
    assert (texture.image[..., 3] == 1.0).all() and not texture.has_alpha
    linear = np.array([[[0.25, 2.0, 0.0]]])
    assert Texture(linear).image.tolist() == [[[0.25, 2.0, 0.0, 1.0]]]


def test_alpha_is_not_encoded():
    image = np.array([[[255, 255, 255, 128]]], np.uint8)
    texture = Texture(image)
    assert texture.image[0, 0, 3] == np.float32(128 / 255) and texture.has_alpha
    assert Texture(np.full((1, 1, 4), 0.5)).image[0, 0, 3] == 0.5


@pytest.mark.parametrize("shape", [(2, 3), (2, 3, 1)])
def test_grey(shape):
    image = np.arange(6, dtype=np.uint8).reshape(shape) * 50
    expected = linear_from_srgb(np.arange(6).reshape(2, 3) * 50 / 255.0)
    got = Texture(image).image
    for channel in range(3):
        np.testing.assert_allclose(got[..., channel], expected, rtol=1e-7)
    assert (got[..., 3] == 1.0).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.float64])
def test_grey_with_alpha(dtype):
    scale = 255 if dtype == np.uint8 else 1
    image = (np.array([[[1.0, 0.2]]]) * scale).astype(dtype)
    np.testing.assert_allclose(Texture(image).image, [[[1.0, 1.0, 1.0, 0.2]]], rtol=1e-6)


def test_the_array_given_is_neither_changed_nor_shared():
    image = np.full((2, 2, 4), 0.5, np.float32)
    texture = Texture(image)
    image[:] = 0.25
    assert (texture.image == 0.5).all() and image.flags.writeable
    for level in texture.pyramid:
        with pytest.raises(ValueError, match="read-only"):
            level[0, 0, 0] = 1.0


@pytest.mark.parametrize("mode", ["I", "F"])
def test_pictures_of_32_bits_are_refused(tmp_path, mode):
    """What is black and what white in them isn't said; their numbers were cut off."""
    picture = Image.new(mode, (2, 2), 1)
    with pytest.raises(SceneError, match="numbers of 32 bits; 8 and 16 bits are read"):
        Texture(picture)
    picture.save(tmp_path / "t.tif")
    with pytest.raises(ModelError, match=r"t\.tif: can't be read as a picture: its texels are numbers of 32 bits"):
        Texture(tmp_path / "t.tif")


@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA", "P", "1", "CMYK", "I;16"])
def test_pil_images_and_files(tmp_path, mode):
    grey = Image.fromarray(np.array([[0, 128, 255]], np.uint8))
    if mode == "I;16":
        picture = Image.fromarray(np.array([[0, 128 * 257, 65535]], np.uint16))
    else:
        picture = grey.convert(mode)
    expected = [0.0, 1.0, 1.0] if mode == "1" else linear_from_srgb(np.array([0, 128, 255]) / 255)
    if mode == "1":
        picture = Image.fromarray(np.array([[0, 255, 255]], np.uint8)).convert("1")
    texture = Texture(picture)
    np.testing.assert_allclose(texture.image[0, :, 0], expected, rtol=1e-7)
    assert texture.name == ""
    path = tmp_path / ("t.tif" if mode == "CMYK" else "t.png")
    picture.save(path)
    for source in (path, str(path)):
        again = Texture(source)
        np.testing.assert_array_equal(again.image, texture.image)
        assert again.name == str(path)
    assert Texture(path, name="other").name == "other"


def test_a_transparent_palette_entry_becomes_alpha(tmp_path):
    picture = Image.fromarray(np.array([[0, 1]], np.uint8), "P")
    picture.putpalette([255, 0, 0, 0, 255, 0])
    picture.save(tmp_path / "p.png", transparency=1)
    texture = Texture(tmp_path / "p.png")
    assert texture.image[..., 3].tolist() == [[1.0, 0.0]] and texture.image[0, 0, 0] == 1.0


def test_read_picture_takes_files_and_names_what_is_none(tmp_path):
    stream = io.BytesIO()
    Image.fromarray(RGB).save(stream, "png")
    data = stream.getvalue()
    np.testing.assert_array_equal(read_picture(io.BytesIO(data), "x"), RGB)
    for broken in (b"", b"hello", data[:40]):
        with pytest.raises(ModelError, match=r"^wood\.png: can't be read as a picture"):
            read_picture(io.BytesIO(broken), "wood.png")
    with pytest.raises(ModelError, match=r"gone\.png: can't be read as a picture"):
        Texture(tmp_path / "gone.png")


# --- what is not legal --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("image", "fault"),
    [
        (np.zeros((2, 2, 5)), r"given \(2, 2, 5\) float64"),
        (np.zeros((0, 2, 3)), r"given \(0, 2, 3\)"),
        (np.zeros(4), r"given \(4, 1\)|given \(4,\)"),
        (np.zeros((1, 2**14 + 1)), "up to 16384 texels"),
        (np.zeros((2, 2), np.uint16), "must be uint8; given uint16"),
        (np.zeros((2, 2), np.int64), "given .* int64"),
        (np.zeros((2, 2), bool), "given .* bool"),
        ([[1, 2], [3]], "object"),
        (None, "object"),
        (np.full((1, 1), -0.1), "at least 0"),
        (np.full((1, 1), np.nan), "finite"),
        (np.full((1, 1), 1e300), "finite"),
        (np.full((1, 1, 4), 1.5), "alpha within 0..1"),
    ],
)
def test_images_that_are_refused(image, fault):
    with pytest.raises(SceneError, match=fault):
        Texture(image)


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        ({"filter": "cubic"}, "filter must be one of 'nearest', 'bilinear', 'trilinear'; given 'cubic'"),
        ({"wrap": "once"}, "wrap must be one of 'repeat', 'clamp', 'mirror'; given 'once'"),
        ({"wrap": ("clamp", "once")}, "given 'once'"),
        ({"wrap": ("clamp",)}, "one word, or two"),
        ({"wrap": 3}, "one word, or two"),
        ({"name": 3}, "name must be text"),
    ],
)
def test_options_that_are_refused(options, fault):
    with pytest.raises(SceneError, match=fault):
        Texture(RGB, **options)


def test_wrap_becomes_a_pair_and_repr_tells():
    assert Texture(RGB).wrap == ("repeat", "repeat")
    assert Texture(RGB, wrap=["clamp", "mirror"]).wrap == ("clamp", "mirror")
    assert repr(Texture(RGB, name="a", filter="nearest")) == "Texture('a', 2 x 3, nearest, repeat/repeat)"


# --- mipmaps ------------------------------------------------------------------------------------------------


def exact_weights(n) -> list[list[Fraction]]:
    """How much of each of n texels each of n // 2 covers, as shares of its own length; by intersection of intervals."""
    m = max(n // 2, 1)
    length = Fraction(n, m)
    rows = []
    for k in range(m):
        low, high = k * length, (k + 1) * length
        rows.append([max(Fraction(0), min(high, Fraction(i + 1)) - max(low, Fraction(i))) / length for i in range(n)])
    return rows


def naive_halve(level):
    """The next mipmap in fractions, texel by texel."""
    height, width = level.shape[:2]
    rows, columns = exact_weights(height), exact_weights(width)
    out = np.empty((len(rows), len(columns), 4))
    for j, row in enumerate(rows):
        for i, column in enumerate(columns):
            cells = [(a * b, level[y, x]) for y, a in enumerate(row) for x, b in enumerate(column) if a * b]
            alpha = sum(w * Fraction(float(t[3])) for w, t in cells)
            for c in range(3):
                by_alpha = sum(w * Fraction(float(t[c])) * Fraction(float(t[3])) for w, t in cells)
                plain = sum(w * Fraction(float(t[c])) for w, t in cells)
                out[j, i, c] = by_alpha / alpha if alpha else plain
            out[j, i, 3] = alpha
    return out


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 2**32 - 1))
def test_every_level_is_the_exact_mean_of_areas(height, width, seed):
    random = np.random.default_rng(seed)
    image = random.random((height, width, 4))
    image[..., 3] *= random.random((height, width)) < 0.7
    pyramid = Texture(image).pyramid
    assert pyramid[0].shape == (height, width, 4) and pyramid[-1].shape == (1, 1, 4)
    for level, half in zip(pyramid, pyramid[1:], strict=False):
        assert half.shape[:2] == tuple(max(n // 2, 1) for n in level.shape[:2])
        assert half.dtype == np.float32
        # the division by alpha and the step to float32 round once each
        np.testing.assert_allclose(half, naive_halve(level), rtol=2.0**-23, atol=1e-30)


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_the_mean_of_the_picture_is_kept(height, width, seed):
    image = np.random.default_rng(seed).random((height, width, 3))
    for level in Texture(image).pyramid:
        np.testing.assert_allclose(level[..., :3].mean(axis=(0, 1)), image.mean(axis=(0, 1)), rtol=1e-5)
        assert (level[..., 3] == 1.0).all()


def test_a_constant_picture_stays_constant():
    for level in Texture(np.full((7, 5, 4), 0.3, np.float32)).pyramid:
        assert (level == np.float32(0.3)).all()


def test_hidden_colors_do_not_bleed_but_stay_where_nothing_is_seen():
    red, hidden = (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 0.0)
    assert Texture(np.array([[red, hidden]])).pyramid[1].tolist() == [[[1.0, 0.0, 0.0, 0.5]]]
    assert Texture(np.array([[hidden, hidden]])).pyramid[1].tolist() == [[[0.0, 1.0, 0.0, 0.0]]]


@pytest.mark.parametrize("filter", ["nearest", "bilinear"])
def test_filters_without_mipmaps(filter):
    texture = Texture(RGB, filter=filter)
    assert len(texture.pyramid) == 1 and texture.pyramid[0] is texture.image
