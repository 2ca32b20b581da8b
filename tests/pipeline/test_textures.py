"""Textures as they are looked up: every texel and its border, the largest steps, and bounds between mip levels."""

import numpy as np
import pytest
from helpers.arrays import differences

from rasterizer.cores import Workers
from rasterizer.engine.texture_tables import make_textures
from rasterizer.pipeline import textures as laying
from rasterizer.pipeline.textures import (
    WRAP_CLAMP,
    WRAP_MIRROR,
    WRAP_REPEAT,
    first_texel,
    texcoord_error,
    texcoord_references,
)
from rasterizer.reference.textures import sample_texture
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


def test_materials_that_share_a_texture_have_it_once():
    one, two = (Texture(np.full((4, 4, 3), k, np.uint8)) for k in range(2))
    laid = make_textures([one, None, two, one], n_texcoord=4)
    assert laid.of_materials.tolist() == [0, -1, 1, 0] and len(laid.sizes) == 2 and laid.texcoord == 8
    assert make_textures([None, None]) is None


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


def test_the_largest_steps_are_found():
    """Inside the picture, and across its border where it repeats; on any number of threads."""
    run = Workers(2).map
    rng = np.random.default_rng(2)
    for k in range(16):
        repeats = bool(k & 1), bool(k & 2)
        picture = np.float32(rng.uniform(0, 1, (*rng.integers(1, 6, 2), 4)))
        height, width = picture.shape[:2]
        level = np.zeros((height + 2, width + 2, 4), np.float32)

        def write(first, end, picture=picture, level=level):
            level[first + 1 : end + 1, 1:-1] = picture[first:end]

        d_s, d_t = laying.fill_level(level, [WRAP_REPEAT if each else WRAP_MIRROR for each in repeats], write, run)
        for found, axis, is_repeated in ((d_s, 1, repeats[0]), (d_t, 0, repeats[1])):
            wide = np.concatenate([picture, picture.take([0], axis)], axis) if is_repeated else picture
            expected = np.abs(np.diff(wide, axis=axis)).max(initial=0.0)
            assert found == expected, f"{width} x {height}, axis {axis}, repeated: {is_repeated}"


@pytest.mark.parametrize("wrap", ["repeat", "clamp"])
def test_levels_differ_by_no_more_than_the_bound(wrap):
    """At a fine grid of points, between all levels; smooth pictures, where the range says nothing, as well as noise."""
    rng = np.random.default_rng(3)
    for width, height in [(16, 16), (5, 7), (33, 2), (3, 3), (13, 1), (1, 6)]:
        x = np.linspace(0, 1, width)[None, :, None]
        y = np.linspace(0, 1, height)[:, None, None]
        smooth = np.concatenate([0.3 * x + 0 * y, 0.2 * y + 0 * x, 0.1 * x + 0.1 * y, 1 - 0.1 * x * y], axis=2)
        for image in (rng.uniform(0, 1, (height, width, 4)), smooth):
            texture = Texture(image, "trilinear", wrap)
            u, v = np.meshgrid(np.linspace(-0.3, 1.3, 8 * width + 3), np.linspace(-0.3, 1.3, 8 * height + 3))
            uv, shown = np.stack([u.ravel(), v.ravel()], axis=1), []
            for level in range(len(texture.pyramid)):
                steps = np.zeros((len(uv), 2, 2))
                steps[:, 0, 0] = 2.0**level / width
                shown.append(sample_texture(texture, uv, steps))
            worst = max(np.abs(a - b).max() for a, b in zip(shown[:-1], shown[1:], strict=True))
            bound = make_textures([texture]).errors[0, laying.OF_LEVEL] + 1e-7
            assert worst <= bound, f"{width} x {height}: {worst:.3g} > {bound:.3g}"


def test_what_textures_need_does_not_depend_on_their_neighbours():
    rng = np.random.default_rng(4)
    every = [Texture(rng.uniform(0, 2, (n, n + 1, 3)), filter) for n, filter in ((3, "nearest"), (8, "trilinear"))]
    together = make_textures(every)
    for k, texture in enumerate(every):
        alone, first = make_textures([texture]), together.first_texels[k]
        assert not differences(alone.texels, together.texels[4 * first :][: len(alone.texels)])
        assert not differences(alone.errors[0], together.errors[k])
        assert not differences(alone.sizes[0], together.sizes[k])


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


def test_a_reference_is_a_number_whatever_the_texcoord_is():
    for texcoord in (np.nan, np.inf, -np.inf, 1e300):
        for wrap in (WRAP_REPEAT, WRAP_MIRROR, WRAP_CLAMP):
            found = u_ref, t_ref, number = texcoord_references((texcoord, 0.4), (wrap, wrap))
            assert 0.0 <= u_ref <= 2.0 and abs(t_ref - 0.4) < 0.01 and 0 <= number < 2**24, f"{texcoord}: {found}"


def test_quotients_of_planes_are_within_their_error():
    """Of planes that err as far as they may, each way, and with the roundings of the look-up."""
    rng = np.random.default_rng(2)
    n, size = 20000, np.float32(37)
    inv_w = rng.uniform(0.1, 4, n)
    offset = rng.uniform(-50, 50, n)
    numerator = offset * inv_w
    worst = 0.0
    for e_s, e_d in ((0.0, 0.0), (1e-6, 0.0), (0.0, 1e-7), (1e-5, 3e-7)):
        s = np.float32(numerator + e_s * rng.choice([-1, 1], n))
        d = np.float32(inv_w + e_d * rng.choice([-1, 1], n))
        w = np.float32(1) / d
        found = (s * w) * (np.float32(1) / size)
        off = abs(found * 37.0 - offset)
        rounded = 2.0**-24 * abs(s), 2.0**-24 * d  # the planes are float32
        bound = texcoord_error(e_s + rounded[0], e_d + rounded[1], d - e_d - rounded[1], abs(offset))
        worst = max(worst, (off / bound).max())
    assert 0.3 < worst <= 1.0, f"{worst:.3f} of the bound"
