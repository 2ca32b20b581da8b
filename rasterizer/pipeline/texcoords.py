"""Texture coordinates of a batch of samples that show one texture, in fixed point, and mip levels.

In:  a batch with the planes of texture coordinates (textures.py, where the letters are), which texturing.py has
     evaluated, or exact setups (triangle_setups.py), two attributes of which are u and v.
Out: s and t of each sample: the fraction of the picture that stands for any texture coordinate, 2^32 for all of it. And
     the mip level, whole or between two.

    u, v   texture coordinates, any number; v points up      s, t   the same within the picture; t points down

To repeat the picture is to let whole numbers wrap around. A fraction lies in texel ⌊s·n/2^32⌋ of a mip level n texels
wide. So every texel that is read exists, whatever planes and setups hold.

Of planes, a quotient s' = S/D errs relative to the extent of its triangle alone; its reference is added in whole
numbers. Of exact setups, whole repeats are taken off the corners first, so that large coordinates keep their digits.
All is interpolated in perspective (interpolate.py).

The mip level is chosen by the larger of the lengths, in texels, that one step of the sample to the right and one down
move on the texture (Williams 1983, "Pyramidal parametrics"; Heckbert 1983): with u = U/D, both linear on the screen,
du/dx = (U_x - u·D_x)/D.
"""

import numpy as np

from ..compiler.kernels import helper
from ..geometry.vectors import scale
from .fragments import BARYCENTRIC, BATCH_SIZE, INVERSE_SUM, TEXCOORD_T, TEXCOORD_U, get_vector, set_vector
from .interpolate import corner_values, exact_triangle, mean, next_exact_run, sample_weights, weight_steps
from .samples import skip_to
from .setup import inverse_sum
from .textures import (
    FILTER_TRILINEAR,
    ONE,
    REFERENCE_BITS,
    WRAP_CLAMP,
    WRAP_MIRROR,
    ZERO,
    without_repeats,
    wrap_texcoord,
)
from .triangle_setups import ATTRIBUTE, material_of
from .visibility import LANES, setup_of

# The batch is one flat array of float32, one quantity after the other, each for BATCH_SIZE samples, as in fragments.py.
# Whole numbers stand in it, too: as the float32 with the same 32 bits.


def _quantity(number):
    """Return where a quantity begins in a batch."""
    return BATCH_SIZE * number


# What comes in for each sample: four planes of its setup and, for mip levels, the slopes of three of them
# (textures.py).
S_PLANE, T_PLANE, INV_W, REFERENCES = (_quantity(k) for k in range(4))
S_DX, T_DX, INV_W_DX, S_DY, T_DY, INV_W_DY = (_quantity(k) for k in range(4, 10))
# What comes of it: s' and t' in the first rows; s and t in fixed point, the mip level.
S_OFFSET, T_OFFSET = S_PLANE, T_PLANE
S, T, MIP_LEVEL = (_quantity(k) for k in range(10, 13))
# In place of the planes, and behind: what texture_lookup.py needs, and finds.
FIRST_OF_LOOKUP, TEXEL = _quantity(0), _quantity(13)
LOOKUP_SHAPE = (17 * BATCH_SIZE,)


def make_lookup_batch() -> np.ndarray:
    """Return room for the samples of a batch: LOOKUP_SHAPE zeros of float32."""
    return np.zeros(LOOKUP_SHAPE, np.float32)


@helper
def padded(n):
    """Return for how many samples texels are read: as many as planes are evaluated for."""
    return (n + LANES - 1) // LANES * LANES


@helper
def clear_texcoords(batch, n):
    """Let n samples show the picture's corner: those of which nothing is known read texels that there are."""
    for k in range(padded(n)):
        batch[S + k] = batch[T + k] = batch[MIP_LEVEL + k] = np.float32(0)


@helper
def bits_of(number):
    """Return the 32 bits of a float32 as a whole number."""
    return np.float32(number).view(np.int32)


@helper
def from_bits(bits):
    """Return the float32 with these 32 bits: so whole numbers stand in the rows of a batch."""
    return np.int32(bits).view(np.float32)


# ---------------------------------------------------------------- of exact setups


@helper
def put_in_exact_texcoords(packed, setups, first, material, attribute, texture, weights, batch):
    """Put in texture coordinates and mip levels of a material's exact setups.

    Parameters
    ----------
    packed : (n,) int64, n <= BATCH_SIZE
    first : where they lie (samples.py)
    attribute : the one that is u; v follows
    texture : Texture
    weights : the batch of float64, see fragments.py
    batch : LOOKUP_SHAPE float32
    """
    start, end = next_exact_run(packed, 0)
    while start < end:
        if material_of(packed[start], setups) == material:
            n, setup, where = end - start, setup_of(packed[start]), skip_to(first, start)
            fill_barycentric(setups, setup, where, n, weights)
            corners = corner_texcoords(setups, setup, attribute, texture.wraps)
            for k in range(n):
                p = get_vector(weights, BARYCENTRIC, k)
                u, t = mean(corners[0], p), mean(corners[1], p)
                weights[TEXCOORD_U + k], weights[TEXCOORD_T + k] = u, t
                batch[S + start + k] = from_bits(fixed_point(wrap_texcoord(u, texture.wraps[0])))
                batch[T + start + k] = from_bits(fixed_point(wrap_texcoord(t, texture.wraps[1])))
            if texture.filter == FILTER_TRILINEAR:
                levels = batch[MIP_LEVEL + start : MIP_LEVEL + end]
                fill_mip_levels(exact_triangle(setups, setup), corners, n, texture, weights, levels)
        start, end = next_exact_run(packed, end)


@helper
def fill_barycentric(setups, setup, first, n, batch):
    """Fill the weights of an exact setup's corners, in perspective and with the sum 1, and 1 / Σ q.

    Apart from what is weighted: so each loop becomes vector instructions.
    """
    triangle = exact_triangle(setups, setup)
    for k in range(n):
        q = sample_weights(triangle, first, k)
        inverse = inverse_sum(q)
        batch[INVERSE_SUM + k] = inverse
        set_vector(batch, BARYCENTRIC, k, scale(q, inverse))


@helper
def corner_texcoords(setups, setup, attribute, wraps):
    """Return u and 1 - v of an exact setup, each at the three corners, without whole repeats of the picture."""
    column = ATTRIBUTE + 3 * attribute
    us = without_repeats(corner_values(setups.reals, setup, column), wraps[0])
    vs = without_repeats(corner_values(setups.reals, setup, column + 3), wraps[1])
    return us, (1.0 - vs[0], 1.0 - vs[1], 1.0 - vs[2])


@helper
def fixed_point(x):
    """Return a number within 0..1 as a whole number, 2^32 for 1, but the largest below for 1 itself.

    Rounded up: so a point on the border of two texels, k of n, lies in the second one, as it does in exact numbers.
    """
    return np.int32(np.int64(min(np.ceil(x * 2.0**32), 2.0**32 - 1.0)))


@helper
def fill_mip_levels(triangle, corners, n, texture, weights, out):
    """Fill the mip levels of n samples of an exact setup, behind their texture coordinates.

    Parameters
    ----------
    triangle : what `exact_triangle` returns
    corners : what `corner_texcoords` returns
    out : (n,) float32
    """
    steps_x, steps_y = weight_steps(triangle)
    us, ts = corners
    d_x, u_x, t_x = step_sums(steps_x, us, ts)
    d_y, u_y, t_y = step_sums(steps_y, us, ts)
    width, height = float(texture.width), float(texture.height)
    coarsest = np.float32(texture.coarsest)
    for k in range(n):
        u, t, inverse = weights[TEXCOORD_U + k], weights[TEXCOORD_T + k], weights[INVERSE_SUM + k]
        across_u, across_t = (u_x - u * d_x) * inverse * width, (t_x - t * d_x) * inverse * height
        down_u, down_t = (u_y - u * d_y) * inverse * width, (t_y - t * d_y) * inverse * height
        square = max(across_u * across_u + across_t * across_t, down_u * down_u + down_t * down_t)
        out[k] = mip_level(np.float32(square), coarsest)


@helper
def step_sums(steps, us, ts):
    """Return what Σ q, Σ q·u and Σ q·t grow by where the weights grow by `steps`."""
    q0, q1, q2 = steps
    return q0 + q1 + q2, q0 * us[0] + q1 * us[1] + q2 * us[2], q0 * ts[0] + q1 * ts[1] + q2 * ts[2]


# ---------------------------------------------------------------- of planes


@helper
def compute_texcoords(batch, n, texture):
    """Turn the planes of n <= BATCH_SIZE samples into texture coordinates and mip levels.

    Parameters
    ----------
    batch : LOOKUP_SHAPE float32, with the planes of the samples, up to the next multiple of LANES; they are lost
    texture : Texture
    """
    n = padded(n)
    if texture.filter == FILTER_TRILINEAR:
        divide_with_slopes(batch, n, texture)
    else:
        divide_planes(batch, n)
    wrap_texcoords(batch, n, texture)


@helper
def divide_planes(batch, n):
    """Turn S and T into s' and t'."""
    one = np.float32(1)
    for k in range(n):
        w = one / batch[INV_W + k]
        batch[S_OFFSET + k] *= w
        batch[T_OFFSET + k] *= w


@helper
def divide_with_slopes(batch, n, texture):
    """Turn S and T into s' and t', and fill the mip levels: with s' = S/D, ds/dx = (S_x - s'·D_x)/D."""
    coarsest, one = np.float32(texture.coarsest), np.float32(1)
    for k in range(n):
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
        for k in range(n):
            reference = np.int32(reference_of(batch[REFERENCES + k], axis[1]) << np.int32(18))
            s = np.int32(reference + clamped_offset(batch[source + k] * to_picture))
            s = min(max(s, ZERO), np.int32((1 << 29) - 1))
            batch[out + k] = from_bits(np.int32(s << np.int32(3)))
    elif wrap == WRAP_MIRROR:
        to_period = np.float32(0.5) * to_picture
        for k in range(n):
            reference = np.int32(reference_of(batch[REFERENCES + k], axis[1]) << np.int32(21))
            s = np.int32(reference + periodic_offset(batch[source + k] * to_period))
            s = np.int32(s ^ np.int32(s >> np.int32(31)))
            batch[out + k] = from_bits(np.int32(s << ONE))
    else:
        for k in range(n):
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
def mip_level(square, coarsest):
    """Return the mip level, 0..coarsest, where the longer side of a sample covers so many texels, squared; float32."""
    one = np.float32(1)
    square = square if square > one else one  # also for what is no number
    square = square if square < SQUARE_LIMIT else SQUARE_LIMIT
    level = np.float32(0.5) * log2_coarse(square)
    level = level if level > 0 else np.float32(0)
    return level if level < coarsest else coarsest


@helper
def log2_coarse(x):
    """Return log2 x in float32 for 1 <= x <= 2^60, without a branch; within 3.1e-7 and its rounding.

    For a mantissa 1 + f in [√½, √2] the polynomial, f times one of degree 6, errs by 3.01e-7 at most.
    """
    bits = np.float32(x).view(np.int32)
    # The exponent of two, rounded so that the mantissa is in [√½, √2).
    octave = np.int32(np.int32(bits - np.int32(0x3F3504F3)) >> np.int32(23))
    f = np.int32(bits - np.int32(octave << np.int32(23))).view(np.float32) - np.float32(1)
    series = np.float32(-0.2726979174) + f * np.float32(0.1706344656)
    series = np.float32(0.2972625940) + f * series
    series = np.float32(-0.3589618517) + f * series
    series = np.float32(0.4804650332) + f * series
    series = np.float32(-0.7213758714) + f * series
    series = np.float32(1.4426997263) + f * series
    return np.float32(octave) + f * series
