"""The planes of texture coordinates: what a record holds of them, and how they come into a batch (lookup_batch.py).

In:  a group of four planes of a record (records.py): s'/w, t'/w, 1/w, and the references, which are the same at every
     sample: their slopes are 0.
Out: four rows of the batch, by simd.evaluate_planes, and for mip levels six more, by `gather_slopes`.

Both references of a triangle are one float32, a whole number below 2^24: 12 bits each, s_ref in the lower ones. 2^11 is
the whole picture, or two of them where the picture is mirrored.
"""

import numpy as np

from ..compiler.kernels import helper, spelled_out
from ..compiler.widths import PLANE_GROUP
from .texture_sampling import WRAP_CLAMP, WRAP_MIRROR

REFERENCE_BITS = np.int32(12)
REFERENCE_UNIT = 2.0**11  # of a picture, or of a period


@spelled_out("build_gather_slopes")
def gather_slopes(entries, group, out, start, stride):
    """Copy the slopes of three planes for each sample of a row: d/dx of each, then d/dy.

    Samples up to the next multiple of PLANE_GROUP may be read and written, too.

    Parameters
    ----------
    entries : (n,) int64, which hold indices of records
    group : simd.PlaneGroup of float32; its scale counts for nothing
    out : float32, of any shape; counted through from `start` on, a row a slope, `stride` apart, both uint64
    """
    out, numbers = out.reshape(-1), group.numbers
    for k in range(len(entries)):
        record = (entries[k] & group.record_mask) << np.int64(group.shift)
        for i in range(2 * (PLANE_GROUP - 1)):
            part = i // (PLANE_GROUP - 1)
            source = record + np.int64(group.column) + PLANE_GROUP + part + i  # leaves the fourth plane out
            out[np.int64(start) + i * np.int64(stride) + k] = numbers[source]


@helper
def texcoord_references(texcoords, sizes, wraps):
    """Return references near texture coordinates, and the number that stands for both in a record.

    What is no number, or further than 2^40 pictures away, counts as 0. Clamped coordinates have references within the
    picture. All are multiples of 2^-11 of the picture or period, so none of them has an error.

    Parameters
    ----------
    texcoords : (s, t), texels, such as the means of a triangle's corners
    sizes : (width, height) of the picture, float64
    wraps : WRAP_... along s and t

    Returns
    -------
    (s_ref, t_ref, number) float64, the references in texels
    """
    s_ref, s_number = texcoord_reference(texcoords[0], sizes[0], wraps[0])
    t_ref, t_number = texcoord_reference(texcoords[1], sizes[1], wraps[1])
    return s_ref, t_ref, s_number + 2.0**12 * t_number


@helper
def texcoord_reference(texcoord, n_texel, wrap):
    """Return one reference in texels, and the number from 0 to 2^11 that stands for it."""
    period = 2.0 * n_texel if wrap == WRAP_MIRROR else n_texel
    whole = np.rint(texcoord / period * REFERENCE_UNIT)
    whole = whole if abs(whole) < 2.0**51 else 0.0
    if wrap == WRAP_CLAMP:
        whole = min(max(whole, 0.0), REFERENCE_UNIT)
        return whole / REFERENCE_UNIT * period, whole
    return whole / REFERENCE_UNIT * period, whole - REFERENCE_UNIT * np.floor(whole / REFERENCE_UNIT)


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
