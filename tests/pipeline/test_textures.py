"""Textures as they are looked up: every texel and its border, the largest steps, and bounds between mip levels."""

import numpy as np
import pytest
from helpers.arrays import differences

from rasterizer.cores import Workers
from rasterizer.engine.texture_tables import make_textures
from rasterizer.pipeline.textures import (
    WRAP_CLAMP,
    WRAP_MIRROR,
    WRAP_REPEAT,
    first_texel,
    texcoord_references,
)
from rasterizer.scene.texture import Texture

SIZES = ((1, 1), (1, 9), (9, 1), (2, 3), (16, 16), (37, 5), (5, 640))


def level_of(textures, texture, level):
    """A mip level with its border, (h + 2, w + 2, 4) float32, linear."""
    width, height = (max(int(n) >> level, 1) for n in textures.sizes[texture, :2])
    first = textures.first_texels[texture] + first_texel(*np.int32([*textures.sizes[texture, :2], level]))
    texels = textures.texels.reshape(-1, 4)[first : first + (width + 2) * (height + 2)]
    return texels.reshape(height + 2, width + 2, 4)


@pytest.mark.parametrize("wrap", ["repeat", "clamp", "mirror", ("repeat", "clamp")])
def test_every_level_stands_there_with_its_border(wrap):
    for width, height in SIZES:
        rng = np.random.default_rng(width)
        texture = Texture(rng.uniform(0, 1, (height, width, 4)), "trilinear", wrap)
        textures = make_textures([Texture(np.ones((3, 3, 3))), texture, Texture(np.zeros((2, 2, 3)))])
        modes = ["wrap" if word == "repeat" else "edge" for word in texture.wrap]
        for level, picture in enumerate(texture.pyramid):
            expected = np.pad(picture, ((0, 0), (1, 1), (0, 0)), mode=modes[0])
            expected = np.pad(expected, ((1, 1), (0, 0), (0, 0)), mode=modes[1])
            assert not differences(level_of(textures, 1, level), expected), f"{width} x {height}, level {level}"


@pytest.mark.parametrize("n_channel", [1, 2, 3, 4])
def test_levels_are_those_of_the_texture_however_it_is_given(n_channel):
    """Of bytes and of floats, on any number of threads."""
    rng, workers = np.random.default_rng(5), Workers(3)
    for width, height in (*SIZES, (301, 222), (640, 128)):
        image = rng.integers(0, 256, (height, width, n_channel), np.uint8)
        if n_channel in (2, 4):  # and much is hidden, whose colours count for nothing
            image[..., -1] *= rng.integers(0, 2, (height, width), np.uint8)
        of_bytes = Texture(image)
        others = Texture(Texture(image).image), Texture(image, "bilinear"), Texture.of_numbers(image)
        for k, texture in enumerate((of_bytes, *others)):
            beside = (Texture, Texture.of_numbers)[k % 3 > 0](image[:1])
            laid = make_textures([beside, texture], run=workers.map)
            for number, level in enumerate(texture.pyramid):
                assert not differences(level_of(laid, 1, number)[1:-1, 1:-1], level), f"{width} x {height}"
        of_floats, on_threads = make_textures([Texture(of_bytes.image)]), make_textures([of_bytes], run=workers.map)
        for found, expected in zip(on_threads, of_floats, strict=True):
            assert not differences(found, expected), f"{width} x {height}"


def test_mip_levels_of_any_size_do_not_overlap():
    """Each begins behind the one before, up to the largest texture."""
    for width, height in [*SIZES, (16384, 16384), (16384, 1), (1, 16384), (8193, 3), (2, 16383), (12345, 678)]:
        n_level = int(np.log2(max(width, height))) + 1
        first = [int(first_texel(*np.int32([width, height, level]))) for level in range(n_level + 1)]
        for level in range(n_level):
            room = first[level + 1] - first[level]
            need = (max(width >> level, 1) + 2) * (max(height >> level, 1) + 2)
            assert room >= need, f"{width} x {height}, level {level}: {room} < {need}"
        assert first[0] == 0
        assert first[-1] <= 4 / 3 * width * height + 6 * (width + height) + 8 * n_level + 1 < 2**31


# ---------------------------------------------------------------- texture planes

# The planes of texture coordinates: references that are exact, and bounded errors. test_samples.py has their slopes.


@pytest.mark.parametrize("wrap", [WRAP_REPEAT, WRAP_MIRROR, WRAP_CLAMP], ids=["repeat", "mirror", "clamp"])
def test_references_are_near_and_exactly_what_their_number_says(wrap):
    rng = np.random.default_rng(1)
    period = 2 if wrap == WRAP_MIRROR else 1
    texcoords = np.concatenate([rng.uniform(-9, 9, 50), [0.0, 0.5, 1.0, -0.5, 1e6, -1e6, 1.5, 2.0]])
    for u, t in rng.permutation(np.stack([texcoords, texcoords[::-1]], axis=1)):
        u_ref, t_ref, number = texcoord_references((u, t), (wrap, wrap))
        assert number == int(number) and 0 <= number < 2**24
        for texcoord, reference, whole in ((u, u_ref, int(number) & 0xFFF), (t, t_ref, int(number) >> 12)):
            nearest = min(max(texcoord, 0.0), 1.0) if wrap == WRAP_CLAMP else texcoord
            assert abs(reference - nearest) <= period * 2.0**-12, f"{reference} for {texcoord}"
            off = whole / 2.0**11 - reference / period
            assert (off if wrap == WRAP_CLAMP else off % 1.0) == 0.0, f"{whole} for {reference}"
