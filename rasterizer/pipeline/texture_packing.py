"""Textures as texture_lookup.py reads them: 8 bytes a texel, and how much their colours err.

In:  `Textures` (texture_sampling.py).
Out: `PackedTextures`: each channel of a texel in 16 bits, a border of one texel around each mip level, which holds what
     the wrap puts there. `texture_error` says how far colours looked up in them are from exact ones.

A texture of w × h texels needs 8 bytes for each, with mip levels a third more, and 48·(w + h) bytes for the borders.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from .fragments import BATCH_SIZE

# ----------------------------------------------------------------
# The textures of a scene as arrays, with float32 texels, as exact look-ups read them (texture_sampling.py).

FILTER_NEAREST, FILTER_BILINEAR, FILTER_TRILINEAR = 0, 1, 2
WRAP_REPEAT, WRAP_CLAMP, WRAP_MIRROR = 0, 1, 2  # what lies outside the picture


class Textures(NamedTuple):
    """All textures of a scene, one mip level behind the other in one array."""

    texels: np.ndarray  # (4 * n_texel,) float32: linear red, green, blue, and alpha of each
    mip_levels: np.ndarray  # (n_level, 3) int64: first texel, width, height
    first_levels: np.ndarray  # (n_texture + 1,) int64
    filters: np.ndarray  # (n_texture,) int64, FILTER_...
    wraps: np.ndarray  # (n_texture, 2) int64, WRAP_... along u and v
    of_materials: np.ndarray  # (n_material,) int64, the texture of each, -1 for none


# ----------------------------------------------------------------
# The batch of samples that a texture is looked up for (texture_lookup.py): which quantity stands where.
# One flat array of float32, one quantity after the other, each for BATCH_SIZE samples, as in fragments.py. Whole
# numbers
# stand in it, too: as the float32 with the same 32 bits.
#
#     s, t     texture coordinates in texels of the picture: s to the right, t downwards, (0, 0) its upper left corner
#     s', t'   s - s_ref, t - t_ref, relative to references that a triangle has (`texcoord_references`)
#     S, T, D  s'/w, t'/w and 1/w: linear on the screen


def _quantity(number):
    """Return where a quantity begins in a batch."""
    return index(BATCH_SIZE * number)


# What is given of each sample: four planes of its record and, for mip levels, the slopes of three of them
# (texture_planes.py).
S_PLANE, T_PLANE, INV_W, REFERENCES = (_quantity(k) for k in range(4))
S_DX, T_DX, INV_W_DX, S_DY, T_DY, INV_W_DY = (_quantity(k) for k in range(4, 10))
# What comes of it: s', t' and w in the first rows; s and t in fixed point, the mip level.
S_OFFSET, T_OFFSET, W = S_PLANE, T_PLANE, INV_W
S, T, MIP_LEVEL = (_quantity(k) for k in range(10, 13))
# Then, in place of the planes: the texels up left and down left of the sample (whole numbers), the weights of the two
# on the left and of the two on the right (two of 16 bits); all four of the next mip level, too; the share of that one.
TOP, BOTTOM, LEFT_WEIGHTS, RIGHT_WEIGHTS = (_quantity(k) for k in range(4))
NEXT_MIP_LEVEL, SHARE = _quantity(4), _quantity(8)
TEXEL, IS_DOUBTFUL = TOP, MIP_LEVEL  # of the filter "nearest"; doubtful is 1, and 0 certain
TEXEL_ROWS = TOP, BOTTOM, LEFT_WEIGHTS, RIGHT_WEIGHTS
MIP_LEVEL_ROWS = (*TEXEL_ROWS, *(row + NEXT_MIP_LEVEL for row in TEXEL_ROWS), SHARE)
LOOKUP_SHAPE = (13 * BATCH_SIZE,)

ONE, ZERO = np.int32(1), np.int32(0)


def make_lookup_batch() -> np.ndarray:
    """Return room for the samples of a batch: LOOKUP_SHAPE zeros of float32."""
    return np.zeros(LOOKUP_SHAPE, np.float32)


@helper
def bits_of(number):
    """Return the 32 bits of a float32 as a whole number."""
    return np.float32(number).view(np.int32)


@helper
def from_bits(bits):
    """Return the float32 with these 32 bits: so whole numbers stand in the rows of a batch."""
    return np.int32(bits).view(np.float32)


# ----------------------------------------------------------------
# Which texels a sample needs, and their weights, from its texture coordinates and its mip level (texture_lookup.py).
# In:  S, T and MIP_LEVEL of a batch (texture_packing.py). The fixed-point number s lies in texel ⌊s·n/2^32⌋ of a mip
# level n
#      texels wide: whatever s is, that texel exists.
# Out: the rows that texture_lookup.py reads.

HALF_BITS, LOW_BITS = np.int32(16), np.int32(0xFFFF)
WEIGHT_BITS = np.int32(15)
NEAREST_ERROR = 2.0**-10  # of s and t, texels, where the nearest texel is looked for: one of 256 samples is doubtful
REACH = np.int32(int(NEAREST_ERROR * 2.0**16) + 4)


class PackedTexture(NamedTuple):
    """One texture as it is looked up here; see PackedTextures (texture_packing.py)."""

    texels: np.ndarray  # (4 * n,) int16, all mip levels
    width: int  # int32, texels of the first mip level
    height: int  # int32
    coarsest: int  # int32, the last mip level
    filter: int  # FILTER_...
    wraps: tuple[int, int]  # WRAP_... along s and t
    step: float  # float32, linear intensity of a step between two values of a texel


@helper
def first_texel(width, height, mip_level):
    """Return where a mip level begins among the texels of its texture; all int32.

    A level has a border of one texel about it, which holds what the wrap puts there: a sample's four texels are two
    neighbours in each of two rows. So level k has at most (w + 2)·(h + 2) texels with w <= max(W/2^k, 1) and h <=
    max(H/2^k, 1). That is W·H/4^k + 2·(W + H)/2^k + 4, or, where one of w and h is 1, 3·max(W, H)/2^k + 6. What stands
    between two levels here is at least

        a/4^k - a/4^(k+1) - 1 + b/2^k - b/2^(k+1) - 1 + 8    with a >= 4/3·W·H, b = 6·(W + H),

    that is W·H/4^k + 3·(W + H)/2^k + 6. A formula instead of a table: so loops over samples of different levels become
    vector instructions.
    """
    area, rim = level_terms(width, height)
    return level_start(area, rim, mip_level)


@helper
def level_terms(width, height):
    """Return the numbers a and b of `first_texel`."""
    area = np.int32(np.int32(np.int64(width) * np.int64(height) * 4 // 3) + ONE)
    return area, np.int32(np.int32(width + height) * np.int32(6))


@helper
def level_start(area, rim, mip_level):
    """Return `first_texel` of a texture with the numbers a and b that stand there."""
    inside = np.int32(area - shifted(area, np.int32(mip_level + mip_level)))
    border = np.int32(rim - shifted(rim, mip_level))
    return np.int32(np.int32(inside + border) + np.int32(mip_level << np.int32(3)))


@helper
def shifted(number, n_bit):
    """Return ⌊number / 2^n_bit⌋ for n_bit < 32: the compiler, which is told so, makes a shift of 32 bits of it."""
    return np.int32(number >> np.int32(n_bit & np.int32(31)))


@helper
def halved(n_texel, mip_level):
    """Return the width or height of a mip level."""
    return max(shifted(n_texel, mip_level), ONE)


@helper
def locate_texels(batch, n, texture):
    """Fill the texels and weights of mip level ⌊MIP_LEVEL⌋ and of the next one."""
    width, height = np.int32(texture.width), np.int32(texture.height)
    area, rim = level_terms(width, height)
    for k in range(index(n)):
        finer = np.int32(batch[MIP_LEVEL + k])
        coarser = np.int32(finer + ONE)
        size = halved(width, finer), halved(height, finer)
        set_texels(batch, k, index(0), level_start(area, rim, finer), size)
        size = halved(width, coarser), halved(height, coarser)
        set_texels(batch, k, NEXT_MIP_LEVEL, level_start(area, rim, coarser), size)


@helper
def locate_picture_texels(batch, n, texture):
    """Fill the texels and weights of the first mip level."""
    size = np.int32(texture.width), np.int32(texture.height)
    for k in range(index(n)):
        set_texels(batch, k, index(0), ZERO, size)


@helper
def set_texels(batch, k, out, start, size):
    """Set the texels of sample k in a mip level of `size` = (width, height) that begins at `start`, and their weights.

    Weights are shares of 2^15, negative, so that -1 fits 16 bits. They add up to -2^15 exactly and none is positive:
    with f, g and p, the shares to the right, down and both, p = f·g rounded is <= f and <= g, and 1 - f - g + p >= 0.
    """
    x, y = texel_position(bits_of(batch[S + k]), size[0]), texel_position(bits_of(batch[T + k]), size[1])
    pitch = np.int32(size[0] + np.int32(2))
    column = np.int32(np.int32(x >> HALF_BITS) + ONE)
    row = np.int32(np.int32(y >> HALF_BITS) + ONE)
    top = np.int32(np.int32(start + column) + np.int32(row * pitch))
    batch[out + TOP + k], batch[out + BOTTOM + k] = from_bits(top), from_bits(np.int32(top + pitch))
    f, g = np.int32(np.int32(x & LOW_BITS) >> ONE), np.int32(np.int32(y & LOW_BITS) >> ONE)
    both = np.int32(np.int32(np.int32(f * g) + np.int32(1 << 14)) >> WEIGHT_BITS)
    right, below = np.int32(both - f), np.int32(both - g)
    rest = np.int32(np.int32(f - np.int32(1 << 15)) - below)
    batch[out + LEFT_WEIGHTS + k] = from_bits(pack_weights(rest, below))
    batch[out + RIGHT_WEIGHTS + k] = from_bits(pack_weights(right, np.int32(-both)))


@helper
def pack_weights(top, bottom):
    """Return two numbers of 16 bits in one of 32, the first one in the lower half."""
    return np.int32(np.int32(top & LOW_BITS) | np.int32(bottom << HALF_BITS))


@helper
def texel_position(s, n_texel):
    """Return where the fraction s of n_texel <= 2^14 texels lies, in 1/2^16 of a texel, from the centre of the first.

    Its 15 bits behind the point err by at most 2^-16 texels: the product is less than 2^-16 too small, is made larger
    by 2^-16, and loses its last bit. It lies within -½..n - ½, so its texel and the next one are within -1..n.
    """
    return np.int32(product_of(s, n_texel) - np.int32((1 << 15) - 1))


@helper
def product_of(s, n_texel):
    """Return ⌊s·n⌋ in 1/2^16 of a texel for the fraction s of n_texel <= 2^14 texels: less than n·2^16."""
    high = np.int32(np.int32(np.int32(s >> HALF_BITS) & LOW_BITS) * n_texel)
    low = np.int32(np.int32(np.int32(s & LOW_BITS) * n_texel) >> HALF_BITS)
    return np.int32(high + low)


# ---------------------------------------------------------------- the nearest texel


@helper
def locate_nearest_texels(batch, n, texture):
    """Fill the texels that samples lie in, and whether a sample is so near to a border that it may lie in another one;
    tell whether any is.

    A border is near within NEAREST_ERROR, and 4/2^16 of a texel for what fixed point loses: less than 1 in
    `product_of`, and 2 in 2^-29 of 2^14 texels.
    """
    width, height = np.int32(texture.width), np.int32(texture.height)
    pitch, union = np.int32(width + np.int32(2)), ZERO
    repeats_s, repeats_t = texture.wraps[0] == WRAP_REPEAT, texture.wraps[1] == WRAP_REPEAT
    for k in range(index(n)):
        x, y = product_of(bits_of(batch[S + k]), width), product_of(bits_of(batch[T + k]), height)
        column, row = np.int32(x >> HALF_BITS), np.int32(y >> HALF_BITS)
        batch[TEXEL + k] = from_bits(np.int32(np.int32(column + ONE) + np.int32(np.int32(row + ONE) * pitch)))
        is_near = is_near_border(np.int32(x & LOW_BITS), column, width, repeats_s)
        is_near |= is_near_border(np.int32(y & LOW_BITS), row, height, repeats_t)
        is_doubtful = ONE if is_near else ZERO
        batch[IS_DOUBTFUL + k] = from_bits(is_doubtful)
        union = np.int32(union | is_doubtful)
    return union != ZERO


@helper
def is_near_border(fraction, texel, n_texel, repeats):
    """Tell whether another texel begins near a fraction of a texel, 1/2^16 of one.

    Beyond the picture's border there is another one only where the picture repeats.
    """
    before = (fraction < REACH) & (repeats | (texel > ZERO))
    behind = (fraction >= np.int32((1 << 16) - REACH)) & (repeats | (texel < np.int32(n_texel - ONE)))
    return before | behind


OF_S, OF_T, OF_LEVEL, ALWAYS = range(4)  # columns of `errors`
# What a lookup loses itself, see `texture_error`.
POSITION_ERROR, FIXED_POINT_ERROR, WEIGHT_ERROR = 2.0**-16, 2.0**-29, 2.0**-16
LEVEL_ERROR, VALUE_ERROR = 1e-5, 0.51 / 65535.0 + 2.0**-21


class PackedTextures(NamedTuple):
    """All textures of a scene for texture_lookup.py, one behind the other."""

    texels: np.ndarray  # (4 * n_texel,) int16, see texture_lookup.py
    first_texels: np.ndarray  # (n_texture + 1,) int64
    sizes: np.ndarray  # (n_texture, 3) int64: width, height, mip levels
    filters: np.ndarray  # (n_texture,) int64, FILTER_...
    wraps: np.ndarray  # (n_texture, 2) int64, WRAP_... along s and t
    steps: np.ndarray  # (n_texture,) float32: intensity of a step between two values
    errors: np.ndarray  # (n_texture, 4) float64, see `texture_error`


@helper
def packed_texture(textures, texture):
    """Return one of the textures, an `index`."""
    first, end = index(textures.first_texels[texture]), index(textures.first_texels[texture + index(1)])
    width, height, n_level = textures.sizes[texture, 0], textures.sizes[texture, 1], textures.sizes[texture, 2]
    return PackedTexture(
        textures.texels[first << index(2) : end << index(2)],
        np.int32(width),
        np.int32(height),
        np.int32(n_level - 1),
        textures.filters[texture],
        (textures.wraps[texture, 0], textures.wraps[texture, 1]),
        textures.steps[texture],
    )


@helper
def texture_error(textures, texture, s_error, t_error, level_error):
    """Bound how far a channel of what `texture_lookup.read_texels` finds is from exact, linear intensity.

    Parameters
    ----------
    textures : PackedTextures
    texture : its number, an `index`
    s_error, t_error : of the texture coordinates s and t, texels of the picture; see `texcoord_error`
    level_error : of the mip level that the planes would give exactly; 1.45 times the error of its derivatives in texels
        a sample is enough, as d log2 g = dg / (g·ln 2) and levels above 0 have g > 1

    Returns
    -------
    the bound, float64; infinite for what is no number. Of the filter "nearest" that of samples that aren't doubtful,
    and infinite where s or t errs by more than NEAREST_ERROR

    Notes
    -----
    Along a row a bilinear mean changes by at most d_s a texel, the largest difference of two neighbouring texels of its
    mip level, the wrap included; down a column by d_t. A mip level of w of the picture's W texels shrinks an error to
    w/W times as many texels: it errs by s_error·w/W·d_s, and by POSITION_ERROR + FIXED_POINT_ERROR·w texels more, which
    are lost in the look-up.

    The weight of the fourth texel is rounded by WEIGHT_ERROR, and those of the others so that their sum stays: with it
    changes |c00 - c01 - c10 + c11| <= 2·min(d_s, d_t).

    A level that errs by e mixes two means by a share that errs by e. They differ by at most D, see `level_difference`;
    that also holds where e leads to other levels, as the mixture is continuous. LEVEL_ERROR is what the look-up adds:
    0.74e-5 of the logarithm's polynomial, 2^-24·10 of its rounding, 2^-24·8 of that of the squares, and 2^-20 where
    levels end.

    Values are rounded to 16 bits by half a step, and eight times in float32.
    """
    row, kind = textures.errors[texture], textures.filters[texture]
    if kind == FILTER_NEAREST:
        return row[index(ALWAYS)] if (s_error <= NEAREST_ERROR) & (t_error <= NEAREST_ERROR) else np.inf
    bound = s_error * row[index(OF_S)] + t_error * row[index(OF_T)] + row[index(ALWAYS)]
    bound += level_error * row[index(OF_LEVEL)] if kind == FILTER_TRILINEAR else 0.0
    return bound if bound >= 0.0 else np.inf


def pack_textures(textures: Textures) -> PackedTextures:
    """Pack all textures of a scene.

    A texture whose colours are at most 2^k, k >= 0 or less, has steps of 2^k/65535.
    """
    n_texture = len(textures.filters)
    levels = [textures.mip_levels[first:end] for first, end in _pairs(textures.first_levels)]
    sizes = np.array([(*rows[0, 1:], len(rows)) for rows in levels], np.int64).reshape(n_texture, 3)
    counts = [first_texel(*(np.int32(number) for number in size)) for size in sizes]
    first_texels = np.cumsum([0, *counts]).astype(np.int64)
    texels = np.zeros((int(first_texels[-1]), 4), np.int16)
    steps, errors = np.zeros(n_texture, np.float32), np.zeros((n_texture, 4))
    for k, rows in enumerate(levels):
        pictures = [textures.texels[4 * start : 4 * (start + w * h)].reshape(h, w, 4) for start, w, h in rows]
        largest = largest_color(pictures[0].reshape(-1, 4))
        scale = 2.0 ** np.ceil(np.log2(max(largest, 2.0**-40)))
        steps[k] = scale / 65535.0
        out = texels[first_texels[k] : first_texels[k + 1]]
        wraps = tuple(textures.wraps[k])
        differences = [
            pack_level(picture, wraps, scale, _bordered(out, sizes[k], level)) for level, picture in enumerate(pictures)
        ]
        errors[k] = error_factors([picture.shape for picture in pictures], differences, scale, textures.filters[k])
    return PackedTextures(texels.ravel(), first_texels, sizes, textures.filters, textures.wraps, steps, errors)


def _pairs(numbers):
    """Pairs of neighbouring numbers."""
    return zip(numbers[:-1], numbers[1:], strict=True)


def _bordered(texels, size, level):
    """Return the part (h + 2, w + 2, 4) of a texture's texels that is one mip level."""
    width, height = max(int(size[0]) >> level, 1), max(int(size[1]) >> level, 1)
    first = int(first_texel(np.int32(size[0]), np.int32(size[1]), np.int32(level)))
    return texels[first : first + (width + 2) * (height + 2)].reshape(height + 2, width + 2, 4)


def pack_level(picture, wraps, scale, out) -> tuple[float, float]:
    """Write a mip level with its border; return the largest differences of neighbouring texels.

    Parameters
    ----------
    picture : (h, w, 4) float32, colours from 0 to `scale`, alpha to 1
    wraps : WRAP_... along s and t
    scale : a power of two
    out : (h + 2, w + 2, 4) int16

    Returns
    -------
    (d_s, d_t) : of two neighbours in a row, of two in a column; over all channels, across the border, too
    """
    height, width = picture.shape[:2]
    repeats_s, repeats_t = (bool(wrap == WRAP_REPEAT) for wrap in wraps)
    d_s, d_t = pack_texels(
        picture.reshape(height, 4 * width), repeats_s, repeats_t, 65535.0 / scale, out.reshape(height + 2, -1)
    )
    left, right = (-2, 1) if repeats_s else (1, -2)
    out[:, 0], out[:, -1] = out[:, left], out[:, right]
    above, below = (-2, 1) if repeats_t else (1, -2)
    out[0], out[-1] = out[above], out[below]
    return d_s, d_t


@kernel
def pack_texels(picture, repeats_s, repeats_t, steps_per_unit, out):
    """Write the texels of a mip level, in steps; return the largest differences of neighbours, see `pack_level`.

    Parameters
    ----------
    picture : (h, 4 * w) float32
    steps_per_unit : of colours; of alpha it is 65535
    out : (h + 2, 4 * (w + 2)) int16; its border is left alone
    """
    height, n = index(picture.shape[0]), index(picture.shape[1])
    of_color, of_alpha, zero = np.float32(steps_per_unit), np.float32(65535.0), np.float32(2.0**15)
    pixel, one = index(4), index(1)
    across = down = np.int32(0)  # the bits of positive floats are in order as the floats are
    for j in range(height):
        row, target = picture[j], out[j + one]
        below = picture[j + one if j + one < height else (index(0) if repeats_t else j)]
        for i in range(n):
            per_unit = of_alpha if i & index(3) == index(3) else of_color
            target[i + pixel] = np.int16(np.rint(row[i] * per_unit) - zero)
        for i in range(n):
            down = max(down, np.float32(abs(below[i] - row[i])).view(np.int32))
        for i in range(n - pixel):
            across = max(across, np.float32(abs(row[i + pixel] - row[i])).view(np.int32))
        if repeats_s:
            for i in range(pixel):
                across = max(across, np.float32(abs(row[i] - row[n - pixel + i])).view(np.int32))
    return float(np.int32(across).view(np.float32)), float(np.int32(down).view(np.float32))


@kernel
def largest_color(picture):
    """Return the largest value of red, green and blue of a picture, (n, 4) float32, none of them below 0."""
    largest = np.int32(0)
    for k in range(index(len(picture))):
        for channel in range(index(3)):
            largest = max(largest, np.float32(picture[k, channel]).view(np.int32))
    return float(np.int32(largest).view(np.float32))


def error_factors(shapes, differences, scale, kind) -> tuple[float, float, float, float]:
    """Return what `texture_error` multiplies by the errors of s, of t and of the level, and what it adds.

    Parameters
    ----------
    shapes : (h, w, ...) of each mip level
    differences : (d_s, d_t) of each
    scale : at least the largest colour
    kind : FILTER_...
    """
    of_value = VALUE_ERROR * max(scale, 1.0)
    if kind == FILTER_NEAREST:
        return 0.0, 0.0, 0.0, of_value
    sizes, d = np.array([shape[1::-1] for shape in shapes], np.float64), np.array(differences)
    of_s, of_t = (sizes / sizes[0] * d).max(axis=0)
    of_texcoords = ((POSITION_ERROR + FIXED_POINT_ERROR * sizes) * d).sum(axis=1) + 2.0 * WEIGHT_ERROR * d.min(axis=1)
    of_level = level_difference(d, max(scale, 1.0))
    return of_s, of_t, of_level, of_texcoords.max() + LEVEL_ERROR * of_level + of_value


def level_difference(differences, largest) -> float:
    """Bound the difference of what a mip level and the next one show at any point.

    Both show means of texels of the finer level of n texels. The coarser one, of m, is interpolated between two of its
    texels, which cover 2·n/m of the finer: four, or where n is odd, a range of up to five that touches six. The finer
    one is interpolated between two of the same. So texels are at most 5 apart along each axis; and no value is below 0
    or above the largest.

    differences : (n_level, 2), d_s and d_t of each level
    """
    return min(5.0 * differences[:-1].sum(axis=1).max(initial=0.0), largest)
