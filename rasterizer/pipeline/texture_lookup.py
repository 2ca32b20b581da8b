"""What a texture shows at a batch of samples: the one look-up, for colours, alpha and numbers of metal.

In:  a batch of samples of one texture with s, t and the mip level (texcoords.py).
Out: red, green, blue and alpha, float32 and linear, in four rows of the batch from TEXEL on.

How far they are from exact ones is said in textures.py.

Work goes row by row, in loops without branches, which become vector instructions. Only texels are read sample by
sample, by loops that intrinsics.py spells out for the compiler.
"""

import numpy as np

from ..compiler.kernels import helper, spelled_out
from .fragments import BATCH_SIZE
from .samples import write_row
from .texcoords import FIRST_OF_LOOKUP, MIP_LEVEL, TEXEL, S, T, bits_of, from_bits, padded
from .textures import FILTER_NEAREST, FILTER_TRILINEAR, ONE, ZERO, halved, level_start, level_terms

# In place of the planes: the texels up left and down left of the sample (whole numbers), and how far it lies to the
# right of the left ones and below the upper ones; all four of the next mip level, too; its fraction.
TOP, BOTTOM, RIGHT, DOWN = (FIRST_OF_LOOKUP + BATCH_SIZE * k for k in range(4))
NEXT_MIP_LEVEL = BATCH_SIZE * 4
LEVEL_FRACTION = FIRST_OF_LOOKUP + BATCH_SIZE * 8
TEXEL_ROWS = TOP, BOTTOM, RIGHT, DOWN
MIP_LEVEL_ROWS = (*TEXEL_ROWS, *(row + NEXT_MIP_LEVEL for row in TEXEL_ROWS), LEVEL_FRACTION)


@helper
def read_texels(batch, n, texture):
    """Read the texels of n samples whose texture coordinates and mip levels are known.

    Samples up to the next multiple of LANES are written, too.

    Parameters
    ----------
    batch : LOOKUP_SHAPE float32, see texcoords.py
    texture : Texture
    """
    n = padded(n)
    if texture.filter == FILTER_NEAREST:
        locate_nearest_texels(batch, n, texture)
        fetch_texels(texture.texels, batch, (TOP,), n, TEXEL)
    elif locate_texels(batch, n, texture):
        blend_mip_levels(texture.texels, batch, MIP_LEVEL_ROWS, n, TEXEL)
    else:
        blend_texels(texture.texels, batch, TEXEL_ROWS, n, TEXEL)
    if texture.has_alpha:
        divide_by_alpha(batch, n)


@helper
def divide_by_alpha(batch, n):
    """Divide the colours that were found, which are multiplied by alpha, so that clear texels count for nothing; where
    nothing but these was found they stay 0."""
    for k in range(n):
        alpha = batch[TEXEL + 3 * BATCH_SIZE + k]
        divisor = alpha if alpha > 0 else np.float32(1)
        for channel in range(3):
            batch[TEXEL + channel * BATCH_SIZE + k] /= divisor


# ---------------------------------------------------------------- which texels a sample needs, and their weights

HALF_BITS, LOW_BITS = np.int32(16), np.int32(0xFFFF)
PIECE = 32  # samples that are located together: where they show the first mip level alone, in half the time


@helper
def locate_nearest_texels(batch, n, texture):
    """Fill the texels that samples lie in."""
    pitch = np.int32(texture.width + np.int32(2))
    for k in range(n):
        column = np.int32(product_of(bits_of(batch[S + k]), texture.width)[0] >> HALF_BITS)
        row = np.int32(product_of(bits_of(batch[T + k]), texture.height)[0] >> HALF_BITS)
        batch[TOP + k] = from_bits(np.int32(np.int32(column + ONE) + np.int32(np.int32(row + ONE) * pitch)))


@helper
def locate_texels(batch, n, texture):
    """Fill the texels and weights of each sample; tell whether two mip levels are mixed anywhere.

    Of those that show the first level alone, the fraction of the next one is 0, and its texels may be anything.
    """
    is_mixed, end = False, n
    for first in range(0, end, PIECE):
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
    """Fill the texels and weights of mip level ⌊MIP_LEVEL⌋ and of the next one, and the fraction of the latter. Beyond
    the coarsest one stands that again."""
    width, height, coarsest = np.int32(texture.width), np.int32(texture.height), np.int32(texture.coarsest)
    area, rim = level_terms(width, height)
    for k in range(first, end):
        finer = np.int32(batch[MIP_LEVEL + k])
        coarser = min(np.int32(finer + ONE), coarsest)
        size = halved(width, finer), halved(height, finer)
        set_texels(batch, k, 0, level_start(area, rim, finer), size)
        size = halved(width, coarser), halved(height, coarser)
        set_texels(batch, k, NEXT_MIP_LEVEL, level_start(area, rim, coarser), size)
        batch[LEVEL_FRACTION + k] = batch[MIP_LEVEL + k] - np.float32(finer)


@helper
def locate_in_picture(batch, first, end, texture):
    """Fill the texels and weights of the first mip level."""
    size = np.int32(texture.width), np.int32(texture.height)
    for k in range(first, end):
        set_texels(batch, k, 0, ZERO, size)
        batch[LEVEL_FRACTION + k] = np.float32(0)


@helper
def set_texels(batch, k, out, start, size):
    """Set the texels of sample k in a mip level of `size` = (width, height) that begins at `start`, and their
    weights."""
    column, right = texel_position(bits_of(batch[S + k]), size[0])
    row, down = texel_position(bits_of(batch[T + k]), size[1])
    pitch = np.int32(size[0] + np.int32(2))
    top = np.int32(np.int32(start + np.int32(column + ONE)) + np.int32(np.int32(row + ONE) * pitch))
    batch[out + TOP + k], batch[out + BOTTOM + k] = from_bits(top), from_bits(np.int32(top + pitch))
    batch[out + RIGHT + k], batch[out + DOWN + k] = right, down


@helper
def texel_position(s, n_texel):
    """Return the last texel whose centre doesn't lie behind the fraction s of n_texel <= 2^14 texels, and how far s
    lies behind that centre, float32: 0..1 texels, rounded down to a 2^-24th.

    s lies within -½..n - ½ texels of the first centre, so its texel and the next one are within -1..n.
    """
    high, low = product_of(s, n_texel)
    x = np.int32(high - np.int32(1 << 15))
    fraction = np.int32(np.int32(np.int32(x & LOW_BITS) << np.int32(8)) | low)
    return np.int32(x >> HALF_BITS), np.float32(fraction) * np.float32(2.0**-24)


@helper
def product_of(s, n_texel):
    """Return s·n for the fraction s of n_texel <= 2^14 texels: in 1/2^16 of a texel, less than n·2^16, and the next 8
    bits."""
    high = np.int32(np.int32(np.int32(s >> HALF_BITS) & LOW_BITS) * n_texel)
    low = np.int32(np.int32(s & LOW_BITS) * n_texel)
    return np.int32(high + np.int32(low >> HALF_BITS)), np.int32(np.int32(low >> np.int32(8)) & np.int32(0xFF))


# ---------------------------------------------------------------- texels

# Read texels, and mean four or eight of them. A mean of a and b is a + f·(b - a): what is constant stays so.
#
# What all of these take:
#
# texels : (4 * n_texel,) float32
# batch : float32, rows of BATCH_SIZE; whole numbers are the 32 bits of what stands in them
# rows : where rows begin in the batch, int64
# n : int64, samples
# out : int64, where the first of four rows begins in the batch, one for each channel. Samples up to the next multiple
#     of PLANE_GROUP may be read and written, too


@spelled_out("build_fetch_texels")
def fetch_texels(texels, batch, rows, n, out):
    """Read the texel of each sample; rows : (texel,)."""
    for k in range(n):
        write_row(batch, out + k, texel_at(texels, bits_of(batch[rows[0] + k])))


@spelled_out("build_blend_texels")
def blend_texels(texels, batch, rows, n, out):
    """Mean the texels of each sample; rows : (top, bottom, right, down), see `mean_of_texels`."""
    for k in range(n):
        color = mean_of_texels(texels, batch, (rows[0], rows[1], rows[2], rows[3]), k)
        write_row(batch, out + k, color)


@spelled_out("build_blend_mip_levels")
def blend_mip_levels(texels, batch, rows, n, out):
    """Mix two means of texels; rows : four of one mip level, four of the other, and the fraction of the latter: where
    that is 0 it is not read."""
    for k in range(n):
        fraction = batch[rows[8] + k]
        color = mean_of_texels(texels, batch, (rows[0], rows[1], rows[2], rows[3]), k)
        if fraction != 0:
            other = mean_of_texels(texels, batch, (rows[4], rows[5], rows[6], rows[7]), k)
            color = mix(color, other, fraction)
        write_row(batch, out + k, color)


@helper
def texel_at(texels, texel):
    """Return the four channels of a texel."""
    i = texel << 2
    return texels[i], texels[i + 1], texels[i + 2], texels[i + 3]


@helper
def mean_of_texels(texels, batch, rows, k):
    """Return the mean of the texels `top` and `bottom` of sample k and of those to their right."""
    top, bottom = bits_of(batch[rows[0] + k]), bits_of(batch[rows[1] + k])
    right, down = batch[rows[2] + k], batch[rows[3] + k]
    on_left = mix(texel_at(texels, top), texel_at(texels, bottom), down)
    on_right = mix(texel_at(texels, np.int32(top + ONE)), texel_at(texels, np.int32(bottom + ONE)), down)
    return mix(on_left, on_right, right)


@helper
def mix(a, b, fraction):
    """Return the colour, four channels, that lies the fraction 0..1 of the way from a to b."""
    return (
        a[0] + fraction * (b[0] - a[0]),
        a[1] + fraction * (b[1] - a[1]),
        a[2] + fraction * (b[2] - a[2]),
        a[3] + fraction * (b[3] - a[3]),
    )
