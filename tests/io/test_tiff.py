"""TIFF files: what Pillow reads of them, where the rows lie, and that their profile is that of sRGB."""

import io

import numpy as np
import pytest
from PIL import Image, features

from rasterizer.io.icc import srgb_profile
from rasterizer.io.tiff import encode_tiff, tiff_header

SHAPES = [(1, 1), (48, 64), (3, 1000), (700, 2000), (1, 65536), (65536, 1)]
WIDTH, HEIGHT, OFFSETS, ORIENTATION, ROWS, LENGTHS, ALPHA, PROFILE = 256, 257, 273, 274, 278, 279, 338, 34675
CLASSIC, BIG = b"II\x2a\0", b"II\x2b\0"


def noise(height, width):
    """A picture in which all pixels differ."""
    return np.random.default_rng(1).integers(0, 256, (height, width, 4), np.uint8)


@pytest.mark.parametrize("is_big", [False, True])
@pytest.mark.parametrize("shape", SHAPES)
def test_pillow_reads_what_was_written(shape, is_big):
    pixels = noise(*shape)
    content = tiff_header(shape[1], shape[0], is_big) + pixels.tobytes()
    assert content.startswith(BIG if is_big else CLASSIC)
    image = Image.open(io.BytesIO(content))
    assert image.mode == "RGBA" and np.array_equal(np.asarray(image), pixels)


@pytest.mark.parametrize("is_big", [False, True])
def test_what_the_fields_say(is_big):
    image = Image.open(io.BytesIO(tiff_header(640, 480, is_big) + bytes(640 * 480 * 4)))
    tags = image.tag_v2
    assert tags[ALPHA] == (2,), "alpha must be unassociated: colours are not multiplied by it"
    assert tags[ORIENTATION] == 1, "row 0 is the top, column 0 the left"
    assert (tags[282], tags[283], tags[296]) == (1, 1, 1), "pixels are squares of no known size"
    assert tags[PROFILE] == srgb_profile() == image.info["icc_profile"]
    assert (tags[258], tags[259], tags[262], tags[277], tags[284]) == ((8, 8, 8, 8), 1, 2, 4, 1)


@pytest.mark.parametrize(
    "size", [(1, 1), (640, 480), (2000, 700), (2**16, 2**16), (1, 2**18), (2**18, 5), (2**18, 2**18)]
)
def test_strips_hold_the_rows_one_after_the_other(size, monkeypatch):
    """So bands of the picture may be written in any order."""
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", None)
    header = tiff_header(*size)
    tags, row_bytes = Image.open(io.BytesIO(header)).tag_v2, 4 * size[0]
    offsets, lengths = tags[OFFSETS], tags[LENGTHS]
    assert offsets[0] == len(header) and len(header) % 16 == 0
    assert all(a + n == b for a, n, b in zip(offsets[:-1], lengths[:-1], offsets[1:], strict=True))
    assert sum(lengths) == row_bytes * size[1] and set(lengths[:-1]) <= {tags[ROWS] * row_bytes}
    assert max(lengths) <= max(2**20, row_bytes), "a reader holds a strip in memory"
    assert (tags[WIDTH], tags[HEIGHT]) == size and tags[ROWS] <= size[1]


@pytest.mark.parametrize(
    ("size", "magic"),
    [
        ((30000, 30000), CLASSIC), ((2**18, 4091), CLASSIC), ((4091, 2**18), CLASSIC), ((1, 2**18), CLASSIC),
        ((2**15, 2**15), BIG), ((2**18, 4096), BIG), ((2**16, 2**16), BIG),
    ],
)  # fmt: skip
def test_a_file_of_four_gib_is_a_bigtiff(size, magic):
    header = tiff_header(*size)
    n_byte = len(header) + 4 * size[0] * size[1]
    assert header.startswith(magic) and (magic == BIG or n_byte < 2**32), f"{n_byte} bytes"


def test_a_whole_picture_is_encoded():
    pixels = noise(5, 7)
    assert encode_tiff(pixels) == tiff_header(7, 5) + pixels.tobytes()


@pytest.mark.skipif(not features.check("littlecms2"), reason="Pillow without LittleCMS")
def test_the_profile_is_that_of_srgb():
    """LittleCMS takes it, and finds the colours that its own profile of sRGB has."""
    from PIL import ImageCms

    ours = ImageCms.ImageCmsProfile(io.BytesIO(srgb_profile()))
    assert ImageCms.getProfileDescription(ours).strip() == "sRGB"
    ramp = np.zeros((256, 4, 3), np.uint8)
    for channel in range(4):
        ramp[:, channel, [channel] if channel < 3 else [0, 1, 2]] = np.arange(256)[:, None]
    shown = ImageCms.profileToProfile(Image.fromarray(ramp), ours, ImageCms.createProfile("sRGB"))
    error = np.abs(np.asarray(shown).astype(int) - ramp).max()
    assert error <= 1, f"colours move by {error} > 1 level"
