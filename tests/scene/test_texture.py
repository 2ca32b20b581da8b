"""Tests of the texture: every way to give a picture, the sRGB curve, and mipmaps that are exact means of areas."""

import io

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.refusals import assert_refused
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from rasterizer.errors import ModelError, SceneError
from rasterizer.scene.color import linear_from_srgb
from rasterizer.scene.texture import Budget, Texture, decode_ahead, read_picture

RGB = np.array([[[0, 128, 255], [10, 20, 30]], [[40, 50, 60], [70, 80, 90]], [[255, 0, 0], [0, 0, 0]]], np.uint8)


# --- forms of an image --------------------------------------------------------------------------------------


def test_grey_and_alpha():
    texture = Texture(np.array([[[255, 255, 255, 128]]], np.uint8))
    assert texture.image[0, 0, 3] == np.float32(128 / 255) and texture.has_alpha, "alpha is not encoded"
    assert Texture(np.full((1, 1, 4), 0.5)).image[0, 0, 3] == 0.5
    levels = np.arange(6, dtype=np.uint8) * 50
    for shape in ((2, 3), (2, 3, 1)):
        found = Texture(levels.reshape(shape)).image
        expected = np.repeat(linear_from_srgb(levels / 255.0).reshape(2, 3, 1), 3, axis=2)
        np.testing.assert_allclose(found, np.dstack([expected, np.ones((2, 3))]), rtol=1e-7)
    for image in (np.array([[[255, 51]]], np.uint8), np.array([[[1.0, 0.2]]])):
        np.testing.assert_allclose(Texture(image).image, [[[1.0, 1.0, 1.0, 0.2]]], rtol=1e-6)


def test_pictures_of_32_bits_are_refused(tmp_path):
    """What is black and what white in them isn't said; their numbers were cut off."""
    for mode in ("I", "F"):
        picture = Image.new(mode, (2, 2), 1)
        with pytest.raises(SceneError, match="numbers of 32 bits; 8 and 16 bits are read"):
            Texture(picture)
        picture.save(tmp_path / "t.tif")
        with pytest.raises(ModelError, match=r"t\.tif: can't be read as a picture: its texels are numbers of 32 bits"):
            Texture(tmp_path / "t.tif")


@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA", "P", "1", "CMYK", "I;16"])
def test_pil_images_and_files(tmp_path, mode):
    levels = np.array([[0, 255 if mode == "1" else 128, 255]], np.uint8)
    picture = Image.fromarray(levels).convert(mode) if mode != "I;16" else Image.fromarray(levels.astype("u2") * 257)
    expected = linear_from_srgb(levels[0] / 255)
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


def test_what_is_decoded_ahead_is_what_is_read():
    """In any order, and nothing from the first picture on that is damaged or of a rarer format."""
    noise = np.random.default_rng(2).integers(0, 256, (40, 30, 4), np.uint8)
    files = {}
    for name, pixels, kind in (("a", RGB, "png"), ("b", noise[..., :3], "jpeg"), ("c", noise, "png"),
                               ("d", noise[..., 0], "png"), ("e", RGB, "tiff"), ("f", RGB, "png")):  # fmt: skip
        stream = io.BytesIO()
        Image.fromarray(pixels).save(stream, kind)
        files[name] = stream.getvalue()
    found = decode_ahead(files.items())
    assert list(found) in (["a", "b", "c", "d"], [])  # none with a single processor
    for name, data in files.items():
        pixels = read_picture(io.BytesIO(data), name, Budget())
        again = read_picture(io.BytesIO(data), name, Budget(), found.get(name))
        assert not differences(again, pixels) and not again.flags.writeable
    files["b"] = files["b"][:-400]
    assert set(decode_ahead(files.items())) <= {"a", "c", "d"}
    files["b"] = b"hello"
    assert not decode_ahead(files.items())


# --- what is not legal --------------------------------------------------------------------------------------


def test_what_is_no_texture_is_refused():
    cases = [
        (np.zeros((2, 2, 5)), r"given \(2, 2, 5\) float64"),
        (np.zeros((0, 2, 3)), r"given \(0, 2, 3\)"),
        (np.zeros((1, 2**14 + 1)), "up to 16384 texels"),
        (np.zeros((2, 2), np.uint16), "must be uint8; given uint16"),
        *((image, "object") for image in ([[1, 2], [3]], None)),
        (np.full((1, 1), -0.1), "at least 0"),
        *((np.full((1, 1), value), "finite") for value in (np.nan, 1e300)),
        (np.full((1, 1, 4), 1.5), r"alpha within 0\.\.1"),
    ]
    assert_refused(Texture, cases, SceneError)
    cases = [
        ({"filter": "cubic"}, "filter must be one of 'nearest', 'bilinear', 'trilinear'; given 'cubic'"),
        ({"wrap": "once"}, "wrap must be one of 'repeat', 'clamp', 'mirror'; given 'once'"),
        *(({"wrap": wrap}, "one word, or two") for wrap in (("clamp",), 3)),
        ({"name": 3}, "name must be text"),
    ]
    assert_refused(lambda options: Texture(RGB, **options), cases, SceneError)


# --- mipmaps ------------------------------------------------------------------------------------------------


def weights(n):
    """How much of each of n texels each of n // 2 covers, as shares of its own length; by intersection of intervals."""
    k, i, length = np.arange(max(n // 2, 1))[:, None], np.arange(n), n / max(n // 2, 1)
    overlap = np.minimum((k + 1) * length, i + 1) - np.maximum(k * length, i)
    return np.maximum(overlap, 0.0) / length


def halved(level):
    """The next mipmap, as means of areas, by products of matrices."""

    def mean(values):
        rows = np.tensordot(weights(level.shape[0]), values, (1, 0))
        return np.moveaxis(np.tensordot(weights(level.shape[1]), rows, (1, 1)), 0, 1)

    return mean(level.astype(np.float64))


def assert_means_of_areas(image):
    pyramid = Texture(image).pyramid
    assert pyramid[0].shape[:2] == image.shape[:2] and pyramid[-1].shape == (1, 1, 4)
    for level, half in zip(pyramid, pyramid[1:], strict=False):
        assert half.shape[:2] == tuple(max(n // 2, 1) for n in level.shape[:2]) and half.dtype == np.float32
        # the step to float32 rounds once, the products of the matrices less
        np.testing.assert_allclose(half, halved(level), rtol=2.0**-23, atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 40), st.integers(1, 40), st.booleans(), st.integers(0, 2**32 - 1))
def test_every_level_is_the_mean_of_areas(height, width, is_opaque, seed):
    random = np.random.default_rng(seed)
    image = random.random((height, width, 4))
    image[..., 3] *= random.random((height, width)) < 0.7
    assert_means_of_areas(image[..., :3] if is_opaque else image)


def test_levels_that_are_made_in_strips_have_no_seams():
    """Strips of 2^16 texels."""
    for shape in ((301, 517), (512, 260)):
        assert_means_of_areas(np.random.default_rng(4).integers(0, 256, (*shape, 4), dtype=np.uint8))
        assert_means_of_areas(np.random.default_rng(4).random((*shape, 3), np.float32))


def test_colors_of_levels_are_multiplied_by_alpha_so_that_hidden_ones_add_nothing():
    red, hidden = (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 0.0)
    assert Texture(np.array([[red, hidden]])).pyramid[1].tolist() == [[[0.5, 0.0, 0.0, 0.5]]]
    assert Texture(np.array([[red, hidden]])).halved(1).image.tolist() == [[[1.0, 0.0, 0.0, 0.5]]]
