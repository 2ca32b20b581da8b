"""Textures in float32: what the texture of a batch's samples shows, side by side.

For samples for which `texture_error` (textures.py, where the letters are) is small enough; texture_sampling.py does the
others. Their texture coordinates come from planes or are exact.

In:  a batch of samples of one texture, with the planes of their texture coordinates, or with s, t and the mip level,
     which texturing.py has filled.
Out: red, green, blue and alpha, linear, a row each.

A quotient s' = S/D errs relative to the extent of its triangle alone. It is turned into a fixed-point number, 2^32 of
which are the picture's width or height, and the reference is added in whole numbers: to repeat the picture is to let
them wrap around. The fixed-point number s lies in texel ⌊s·n/2^32⌋ of a mip level n texels wide. So every texel that is
read exists, whatever the planes hold.

Work goes row by row, in loops without branches, which become vector instructions. Only texels are read sample by
sample, by loops that intrinsics.py spells out for the compiler.
"""

import numpy as np

from ..compiler.kernels import helper, index, spelled_out
from .fragments import BATCH_SIZE
from .textures import (
    FILTER_NEAREST,
    FILTER_TRILINEAR,
    NEAREST_ERROR,
    ONE,
    REFERENCE_BITS,
    WRAP_CLAMP,
    WRAP_MIRROR,
    WRAP_REPEAT,
    ZERO,
    halved,
    level_start,
    level_terms,
)
from .visibility import LANES

# The batch is one flat array of float32, one quantity after the other, each for BATCH_SIZE samples, as in fragments.py.
# Whole numbers stand in it, too: as the float32 with the same 32 bits.


def _quantity(number):
    """Return where a quantity begins in a batch."""
    return index(BATCH_SIZE * number)


# What comes in for each sample: four planes of its record and, for mip levels, the slopes of three of them
# (textures.py).
S_PLANE, T_PLANE, INV_W, REFERENCES = (_quantity(k) for k in range(4))
S_DX, T_DX, INV_W_DX, S_DY, T_DY, INV_W_DY = (_quantity(k) for k in range(4, 10))
# What comes of it: s' and t' in the first rows; s and t in fixed point, the mip level.
S_OFFSET, T_OFFSET = S_PLANE, T_PLANE
S, T, MIP_LEVEL = (_quantity(k) for k in range(10, 13))
# Then, in place of the planes: the texels up left and down left of the sample (whole numbers), the weights of the two
# on the left and of the two on the right (two of 16 bits); all four of the next mip level, too; its fraction.
TOP, BOTTOM, LEFT_WEIGHTS, RIGHT_WEIGHTS = (_quantity(k) for k in range(4))
NEXT_MIP_LEVEL, LEVEL_FRACTION = _quantity(4), _quantity(8)
TEXEL, IS_DOUBTFUL = TOP, MIP_LEVEL  # of the filter "nearest"; doubtful is 1, and 0 certain
TEXEL_ROWS = TOP, BOTTOM, LEFT_WEIGHTS, RIGHT_WEIGHTS
MIP_LEVEL_ROWS = (*TEXEL_ROWS, *(row + NEXT_MIP_LEVEL for row in TEXEL_ROWS), LEVEL_FRACTION)
LOOKUP_SHAPE = (13 * BATCH_SIZE,)


def make_lookup_batch() -> np.ndarray:
    """Return room for the samples of a batch: LOOKUP_SHAPE zeros of float32."""
    return np.zeros(LOOKUP_SHAPE, np.float32)


@helper
def compute_texcoords(batch, n, texture):
    """Turn the planes of n <= BATCH_SIZE samples into texture coordinates and mip levels.

    Parameters
    ----------
    batch : LOOKUP_SHAPE float32, with the planes of the samples, up to the next multiple of LANES; they are lost
    texture : PackedTexture
    """
    n = padded(n)
    if texture.filter == FILTER_TRILINEAR:
        divide_with_slopes(batch, n, texture)
    else:
        divide_planes(batch, n)
    wrap_texcoords(batch, n, texture)


@helper
def clear_texcoords(batch, n):
    """Let n samples show the picture's corner: those of which nothing is known read texels that there are."""
    for k in range(index(padded(n))):
        batch[S + k] = batch[T + k] = batch[MIP_LEVEL + k] = np.float32(0)


@helper
def read_texels(batch, n, texture, out, start, stride):
    """Read the texels of n samples whose texture coordinates and mip levels are known, see `compute_texcoords`.

    Parameters
    ----------
    out : float32, of any shape; counted through from `start` on, a row a channel, `stride` apart, both uint64. Samples
        up to the next multiple of LANES may be written, too

    Returns
    -------
    whether any sample is to be looked up exactly: those where the row IS_DOUBTFUL isn't 0. Only with the filter
    "nearest", next to the border of two texels
    """
    n = padded(n)
    if texture.filter == FILTER_NEAREST:
        is_doubtful = locate_nearest_texels(batch, n, texture)
        fetch_texels(texture.texels, batch, (TEXEL,), index(n), out, start, stride, texture.step)
        return is_doubtful
    if locate_texels(batch, n, texture):
        blend_mip_levels(texture.texels, batch, MIP_LEVEL_ROWS, index(n), out, start, stride, texture.step)
    else:
        blend_texels(texture.texels, batch, TEXEL_ROWS, index(n), out, start, stride, texture.step)
    return False


@helper
def padded(n):
    """Return for how many samples texels are read: as many as planes are evaluated for."""
    return (n + LANES - 1) // LANES * LANES


@helper
def bits_of(number):
    """Return the 32 bits of a float32 as a whole number."""
    return np.float32(number).view(np.int32)


@helper
def from_bits(bits):
    """Return the float32 with these 32 bits: so whole numbers stand in the rows of a batch."""
    return np.int32(bits).view(np.float32)


# ---------------------------------------------------------------- texture coordinates


@helper
def divide_planes(batch, n):
    """Turn S and T into s' and t'."""
    one = np.float32(1)
    for k in range(index(n)):
        w = one / batch[INV_W + k]
        batch[S_OFFSET + k] *= w
        batch[T_OFFSET + k] *= w


@helper
def wrap_texcoords(batch, n, texture):
    """Fill s and t, in fixed point."""
    wrap_axis(batch, n, S_OFFSET, S, texture.wraps[0], (texture.width, ZERO))
    wrap_axis(batch, n, T_OFFSET, T, texture.wraps[1], (texture.height, REFERENCE_BITS))


@helper
def wrap_axis(batch, n, source, out, wrap, axis):
    """Fill one of s and t: the fraction of the picture, 2^32 for all of it, that stands for any texture coordinate.

    Mirrored, two pictures are one period of 2^32; the second half runs back, which is to invert all bits.

    axis : how many texels the picture has along it, and where its reference begins in that of the sample, bits
    """
    to_picture = np.float32(1) / np.float32(axis[0])
    if wrap == WRAP_CLAMP:
        for k in range(index(n)):
            reference = np.int32(reference_of(batch[REFERENCES + k], axis[1]) << np.int32(18))
            s = np.int32(reference + clamped_offset(batch[source + k] * to_picture))
            s = min(max(s, ZERO), np.int32((1 << 29) - 1))
            batch[out + k] = from_bits(np.int32(s << np.int32(3)))
    elif wrap == WRAP_MIRROR:
        to_period = np.float32(0.5) * to_picture
        for k in range(index(n)):
            reference = np.int32(reference_of(batch[REFERENCES + k], axis[1]) << np.int32(21))
            s = np.int32(reference + periodic_offset(batch[source + k] * to_period))
            s = np.int32(s ^ np.int32(s >> np.int32(31)))
            batch[out + k] = from_bits(np.int32(s << ONE))
    else:
        for k in range(index(n)):
            reference = np.int32(reference_of(batch[REFERENCES + k], axis[1]) << np.int32(21))
            s = np.int32(reference + periodic_offset(batch[source + k] * to_picture))
            batch[out + k] = from_bits(s)


@helper
def reference_of(references, first_bit):
    """Return one of the two references of a sample, 2^11 for the whole picture or period; any for what is none."""
    is_one = (references >= 0) & (references < np.float32(2.0**24))
    both = np.int32(references if is_one else np.float32(0))
    return np.int32(np.int32(both >> first_bit) & np.int32((1 << 12) - 1))


@helper
def periodic_offset(x):
    """Return the fraction of a number of periods as a whole number, 2^32 a period; 0 for what is no fraction.

    x - rint(x) is exact: a multiple of the last bit of x, and not larger than ½. Its product with 2^31 fits 32 bits.
    """
    x -= np.float32(np.rint(x))
    x = x if abs(x) <= np.float32(0.5) else np.float32(0)
    return np.int32(np.int32(x * np.float32(2.0**31)) << ONE)


@helper
def clamped_offset(x):
    """Return a number within -1..1, the nearest to x, as a whole number, 2^29 for 1; 0 for NaN."""
    one = np.float32(1)
    low = x if x > -one else -one
    x = low if x == x else np.float32(0)
    x = x if x < one else one
    return np.int32(x * np.float32(2.0**29))


# ---------------------------------------------------------------- mip levels

SQUARE_LIMIT = np.float32(2.0**60)


@helper
def divide_with_slopes(batch, n, texture):
    """Turn S and T into s' and t', and fill the mip levels.

    Source: see texture_sampling.py. With s' = S/D, ds/dx = (S_x - s'·D_x)/D.
    """
    coarsest, one = coarsest_level(texture), np.float32(1)
    for k in range(index(n)):
        w = one / batch[INV_W + k]
        s, t = batch[S_PLANE + k] * w, batch[T_PLANE + k] * w
        batch[S_OFFSET + k], batch[T_OFFSET + k] = s, t
        d_x, d_y = batch[INV_W_DX + k], batch[INV_W_DY + k]
        across_s, across_t = batch[S_DX + k] - s * d_x, batch[T_DX + k] - t * d_x
        down_s, down_t = batch[S_DY + k] - s * d_y, batch[T_DY + k] - t * d_y
        across, down = across_s * across_s + across_t * across_t, down_s * down_s + down_t * down_t
        square = w * w * (across if across > down else down)
        batch[MIP_LEVEL + k] = mip_level(square, coarsest)


@helper
def coarsest_level(texture):
    """Return the largest mip level: below the coarsest by 2^-20, so that there is a coarser one."""
    return max(np.float32(texture.coarsest) - np.float32(2.0**-20), np.float32(0))


@helper
def mip_level(square, coarsest):
    """Return the mip level where the longer side of a sample covers so many texels, squared; all float32."""
    one = np.float32(1)
    square = square if square > one else one  # also for what is no number
    square = square if square < SQUARE_LIMIT else SQUARE_LIMIT
    level = np.float32(0.5) * log2_coarse(square)
    level = level if level > 0 else np.float32(0)
    return level if level < coarsest else coarsest


@helper
def log2_coarse(x):
    """Return log2 x in float32 for 1 <= x <= 2^60, without a branch; within 2^-15.8.

    For a mantissa 1 + f in [√½, √2] the polynomial, f times one of degree 4, errs by 1.5e-5 at most.
    """
    bits = np.float32(x).view(np.int32)
    # The exponent of two, rounded so that the mantissa is in [√½, √2).
    octave = np.int32(np.int32(bits - np.int32(0x3F3504F3)) >> np.int32(23))
    f = np.int32(bits - np.int32(octave << np.int32(23))).view(np.float32) - np.float32(1)
    series = np.float32(-0.3945709) + f * np.float32(0.252659)
    series = np.float32(0.48668543) + f * series
    series = np.float32(-0.7202421) + f * series
    series = np.float32(1.4425781) + f * series
    return np.float32(octave) + f * series


# ---------------------------------------------------------------- which texels a sample needs, and their weights

HALF_BITS, LOW_BITS = np.int32(16), np.int32(0xFFFF)
WEIGHT_BITS = np.int32(15)
PIECE = index(32)  # samples that are located together: where they show the first mip level alone, in half the time


@helper
def locate_texels(batch, n, texture):
    """Fill the texels and weights of each sample; tell whether two mip levels are mixed anywhere.

    Of those that show the first level alone, the fraction of the next one is 0, and its texels may be anything.
    """
    is_mixed, end = False, index(n)
    for first in range(index(0), end, PIECE):
        last = min(first + PIECE, end)
        if texture.filter == FILTER_TRILINEAR and has_level(batch, first, last):
            locate_in_levels(batch, first, last, texture)
            is_mixed = True
        else:
            locate_in_picture(batch, first, last, texture)
    return is_mixed


@helper
def has_level(batch, first, end):
    """Tell whether the mip level of any sample first..end isn't 0."""
    union = ZERO
    for k in range(first, end):
        union = np.int32(union | bits_of(batch[MIP_LEVEL + k]))
    return union != ZERO


@helper
def locate_in_levels(batch, first, end, texture):
    """Fill the texels and weights of mip level ⌊MIP_LEVEL⌋ and of the next one, and the fraction of the latter."""
    width, height = np.int32(texture.width), np.int32(texture.height)
    area, rim = level_terms(width, height)
    for k in range(first, end):
        finer = np.int32(batch[MIP_LEVEL + k])
        coarser = np.int32(finer + ONE)
        size = halved(width, finer), halved(height, finer)
        set_texels(batch, k, index(0), level_start(area, rim, finer), size)
        size = halved(width, coarser), halved(height, coarser)
        set_texels(batch, k, NEXT_MIP_LEVEL, level_start(area, rim, coarser), size)
        batch[LEVEL_FRACTION + k] = batch[MIP_LEVEL + k] - np.float32(finer)


@helper
def locate_in_picture(batch, first, end, texture):
    """Fill the texels and weights of the first mip level."""
    size = np.int32(texture.width), np.int32(texture.height)
    for k in range(first, end):
        set_texels(batch, k, index(0), ZERO, size)
        batch[LEVEL_FRACTION + k] = np.float32(0)


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

BORDER_WIDTH = np.int32(int(NEAREST_ERROR * 2.0**16) + 4)


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
    before = (fraction < BORDER_WIDTH) & (repeats | (texel > ZERO))
    behind = (fraction >= np.int32((1 << 16) - BORDER_WIDTH)) & (repeats | (texel < np.int32(n_texel - ONE)))
    return before | behind


# ---------------------------------------------------------------- texels

# Read texels, and mean four or eight of them. Everything but the last steps is done in whole numbers: what is constant
# stays so, and no mean leaves the range of its texels.
#
# A texel is four int16, red, green, blue and alpha; -2^15 is 0. A step between two values is `step` of intensity, or
# 1/65535 of alpha. With steps of 2^k/65535 the largest value, 2^15 - 1, is 2^k exactly: (2^15 - 1)·step and 2^15·step
# are rounded so that they add up to it.
#
# What all of these take:
#
# texels : (4 * n_texel,) int16
# batch : float32, rows of BATCH_SIZE; whole numbers are the 32 bits of what stands in them
# rows : where rows begin in the batch, uint64
# n : uint64, samples
# out : float32, of any shape; counted through from `start` on, a row a channel, `stride` apart, both uint64. Samples up
#     to the next multiple of PLANE_GROUP may be read and written, too
# step : float32

ALPHA_STEP = np.float32(1.0 / 65535.0)
ZERO_VALUE = np.float32(2.0**15)  # how many steps 0 is above the least value
OF_WEIGHTS = np.float32(-(2.0**-15))  # weights add up to -2^15


@spelled_out("build_fetch_texels")
def fetch_texels(texels, batch, rows, n, out, start, stride, step):
    """Read the texel of each sample; rows : (texel,)."""
    for k in range(index(n)):
        texel = int(np.float32(batch[rows[0] + index(k)]).view(np.int32))
        color = texel_values(texels, texel)
        set_color(out, start + index(k), stride, color, np.float32(1), step)


@spelled_out("build_blend_texels")
def blend_texels(texels, batch, rows, n, out, start, stride, step):
    """Mean the texels of each sample; rows : (top, bottom, left_weights, right_weights), see `mean_of_texels`."""
    for k in range(index(n)):
        color = mean_of_texels(texels, batch, (rows[0], rows[1], rows[2], rows[3]), index(k))
        set_color(out, start + index(k), stride, color, OF_WEIGHTS, step)


@spelled_out("build_blend_mip_levels")
def blend_mip_levels(texels, batch, rows, n, out, start, stride, step):
    """Mix two means of texels; rows : four of one mip level, four of the other, and the fraction of the latter: where
    that is 0 it is not read."""
    for k in range(index(n)):
        fraction = batch[rows[8] + index(k)]
        a = b = mean_of_texels(texels, batch, (rows[0], rows[1], rows[2], rows[3]), index(k))
        if fraction != 0:
            b = mean_of_texels(texels, batch, (rows[4], rows[5], rows[6], rows[7]), index(k))
        color = mix_value(a[0], b[0], fraction), mix_value(a[1], b[1], fraction), mix_value(a[2], b[2], fraction)
        color = color[0], color[1], color[2], mix_value(a[3], b[3], fraction)
        set_color(out, start + index(k), stride, color, OF_WEIGHTS, step)


@helper
def texel_values(texels, texel):
    """Return the four values of a texel, float32."""
    i = index(texel) << index(2)
    return (
        np.float32(texels[i]),
        np.float32(texels[i + index(1)]),
        np.float32(texels[i + index(2)]),
        np.float32(texels[i + index(3)]),
    )


@helper
def mean_of_texels(texels, batch, rows, k):
    """Return the weighted sums, float32, of the texels `top` and `bottom` of sample k and of those to their right.

    Weights are two of 16 bits in one row: that of the upper texel in the lower half.
    """
    top, bottom = bits_at(batch, rows[0] + k), bits_at(batch, rows[1] + k)
    left, right = bits_at(batch, rows[2] + k), bits_at(batch, rows[3] + k)
    top, bottom = index(top) << index(2), index(bottom) << index(2)
    return (
        weighted_sum(texels, top, bottom, left, right),
        weighted_sum(texels, top + index(1), bottom + index(1), left, right),
        weighted_sum(texels, top + index(2), bottom + index(2), left, right),
        weighted_sum(texels, top + index(3), bottom + index(3), left, right),
    )


@helper
def bits_at(batch, i):
    """Return the whole number that stands in a batch."""
    return np.int64(np.float32(batch[i]).view(np.int32))


@helper
def weighted_sum(texels, top, bottom, left, right):
    """Return the weighted sum of one channel, which fits 32 bits, as float32."""
    total = np.int64(texels[top]) * lower_half(left) + np.int64(texels[bottom]) * (left >> 16)
    total += np.int64(texels[top + index(4)]) * lower_half(right) + np.int64(texels[bottom + index(4)]) * (right >> 16)
    return np.float32(total)


@helper
def lower_half(bits):
    """Return the lower 16 bits of a whole number, with their sign."""
    return ((bits & 0xFFFF) ^ 0x8000) - 0x8000


@helper
def mix_value(a, b, fraction):
    """Return what lies the fraction of the way from a to b."""
    return a + fraction * (b - a)


@helper
def set_color(out, target, stride, color, factor, step):
    """Write four values times a factor as linear colour and alpha."""
    flat = out.reshape(-1)
    flat[target] = color[0] * (factor * step) + ZERO_VALUE * step
    flat[target + stride] = color[1] * (factor * step) + ZERO_VALUE * step
    flat[target + stride + stride] = color[2] * (factor * step) + ZERO_VALUE * step
    flat[target + stride + stride + stride] = color[3] * (factor * ALPHA_STEP) + ZERO_VALUE * ALPHA_STEP
