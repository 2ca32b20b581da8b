"""Which texels a sample needs, and their weights, from its texture coordinates and its mip level (texture_lookup.py).

In:  S, T and MIP_LEVEL of a batch (lookup_batch.py). The fixed-point number s lies in texel ⌊s·n/2^32⌋ of a mip level n
     texels wide: whatever s is, that texel exists.
Out: the rows that texel_blend.py reads.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index
from .lookup_batch import (
    BOTTOM,
    IS_DOUBTFUL,
    LEFT_WEIGHTS,
    MIP_LEVEL,
    NEXT_MIP_LEVEL,
    ONE,
    RIGHT_WEIGHTS,
    TEXEL,
    TOP,
    ZERO,
    S,
    T,
    bits_of,
    from_bits,
)
from .textures import WRAP_REPEAT

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
