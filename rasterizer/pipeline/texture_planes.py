"""The planes of texture coordinates: what a record holds of them, and how they come into a batch (lookup_batch.py).

In:  a group of four planes of a record (records.py), of which three are planes:

         values at the anchor   S    T    D    s_ref in fixed point
         d/dx                   S_x  T_x  D_x  t_ref in fixed point
         d/dy                   S_y  T_y  D_y  error of s and of t, texels; for the filter "nearest"

Out: a row of the batch for each of the twelve; S, T and D at the samples.

Whole numbers stand in the records as the float32 with the same 32 bits.
"""

import numpy as np

from ..compiler.kernels import helper, spelled_out
from ..compiler.widths import PLANE_GROUP
from .texture_sampling import WRAP_CLAMP, WRAP_REPEAT

CLAMP_UNIT = 2.0**29  # what 1 is in fixed point where texture coordinates are clamped: the sum of two fits 32 bits


@spelled_out("build_gather_texture_planes")
def gather_texture_planes(entries, group, x, y, out, start, stride):
    """Evaluate S, T and D at every sample of a row, and copy the other numbers of its record.

    Samples up to the next multiple of PLANE_GROUP may be read and written, too.

    Parameters
    ----------
    entries : (n,) int64, which hold indices of records
    group : simd.PlaneGroup of float32; its scale counts for nothing
    x, y : int64, the first sample
    out : float32, of any shape; counted through from `start` on, a row a number, `stride` apart, both uint64
    """
    out, numbers = out.reshape(-1), group.numbers
    whole = numbers.view(np.int32)
    for k in range(len(entries)):
        record = (entries[k] & group.record_mask) << np.int64(group.shift)
        across, down = np.float32(x + k - whole[record + 1]), np.float32(y - whole[record + 2])
        first = record + np.int64(group.column)
        for i in range(3 * PLANE_GROUP):
            out[np.int64(start) + i * np.int64(stride) + k] = numbers[first + i]
        for i in range(PLANE_GROUP - 1):
            value = np.float32(numbers[first + i] + np.float32(across * numbers[first + i + PLANE_GROUP]))
            value = np.float32(value + np.float32(down * numbers[first + i + 2 * PLANE_GROUP]))
            out[np.int64(start) + i * np.int64(stride) + k] = value


@helper
def texcoord_reference(texcoord, n_texel, wrap):
    """Return a reference near a texture coordinate, and the fixed-point number that stands for it.

    It is a multiple of 2^-29 of the picture, so that the fixed-point number has no error; clamped coordinates have one
    within the picture.

    Parameters
    ----------
    texcoord : s or t, in texels, such as the mean of a triangle's corners; what is no number counts as 0
    n_texel : width or height of the picture, float64
    wrap : WRAP_...

    Returns
    -------
    (s_ref or t_ref in texels, float64; int32)
    """
    of_picture = np.rint(texcoord / n_texel * CLAMP_UNIT) / CLAMP_UNIT
    of_picture = of_picture if abs(of_picture) < 2.0**52 else 0.0
    if wrap == WRAP_CLAMP:
        of_picture = min(max(of_picture, 0.0), 1.0)
        return of_picture * n_texel, np.int32(of_picture * CLAMP_UNIT)
    of_period = of_picture if wrap == WRAP_REPEAT else 0.5 * of_picture
    fraction = of_period - np.rint(of_period)  # from -½ to ½; ½ is -½ in whole numbers, which wrap
    return of_picture * n_texel, np.int32(np.int32(fraction * 2.0**31) << np.int32(1))


@helper
def texcoord_error(numerator_error, inv_w_error, least_inv_w, largest_offset):
    """Bound the error of s' = S/D for planes S and D that err, in texels; of t' as well.

    With S + e_S and D + e_D the quotient errs by (|e_S| + |s'|·|e_D|)/D to first order. Rounding of 1/D, of the
    product, of the width's inverse and of the product with that is 4 u of s', u = 2^-24; 5 u leave room for products of
    errors.

    Parameters
    ----------
    numerator_error, inv_w_error : of S and of D
    least_inv_w : the least D, with its error taken off
    largest_offset : the largest |s'|, texels
    """
    return (numerator_error + largest_offset * inv_w_error) / least_inv_w + 5.0 * 2.0**-24 * largest_offset
