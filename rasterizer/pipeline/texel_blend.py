"""Read texels, and mean four or eight of them, as vector instructions: the inner loops of texture_lookup.py.

They stand here in Python, which is what runs with the JIT switched off; compiler/intrinsics.py spells them out for the
compiler. tests/pipeline/test_texel_blend.py compares both. Everything but the last steps is done in whole numbers: what
is constant stays so, and no mean leaves the range of its texels.

A texel is four int16, red, green, blue and alpha; -2^15 is 0. A step between two values is `step` of intensity, or
1/65535 of alpha. With steps of 2^k/65535 the largest value, 2^15 - 1, is 2^k exactly: (2^15 - 1)·step and 2^15·step are
rounded so that they add up to it.

Common parameters
-----------------
texels : (4 * n_texel,) int16
batch : float32, rows of BATCH_SIZE; whole numbers are the 32 bits of what stands in them
rows : where rows begin in the batch, uint64
n : uint64, samples
out : float32, of any shape; counted through from `start` on, a row a channel, `stride` apart, both uint64. Samples up
    to the next multiple of PLANE_GROUP may be read and written, too
step : float32
"""

import numpy as np

from ..compiler.kernels import helper, index, spelled_out

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
    """Mix two means of texels; rows : four of one mip level, four of the other, and the share of the latter."""
    for k in range(index(n)):
        a = mean_of_texels(texels, batch, (rows[0], rows[1], rows[2], rows[3]), index(k))
        b = mean_of_texels(texels, batch, (rows[4], rows[5], rows[6], rows[7]), index(k))
        share = batch[rows[8] + index(k)]
        color = mix_value(a[0], b[0], share), mix_value(a[1], b[1], share), mix_value(a[2], b[2], share)
        color = color[0], color[1], color[2], mix_value(a[3], b[3], share)
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
def mix_value(a, b, share):
    """Return what lies the share of the way from a to b."""
    return a + share * (b - a)


@helper
def set_color(out, target, stride, color, factor, step):
    """Write four values times a factor as linear colour and alpha."""
    flat = out.reshape(-1)
    flat[target] = color[0] * (factor * step) + ZERO_VALUE * step
    flat[target + stride] = color[1] * (factor * step) + ZERO_VALUE * step
    flat[target + stride + stride] = color[2] * (factor * step) + ZERO_VALUE * step
    flat[target + stride + stride + stride] = color[3] * (factor * ALPHA_STEP) + ZERO_VALUE * ALPHA_STEP
