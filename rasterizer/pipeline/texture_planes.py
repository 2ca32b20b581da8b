"""The planes of texture coordinates: what a record holds of them, and how they come into a batch (texture_packing.py).

In:  a group of four planes of a record (records.py): s'/w, t'/w, 1/w, and the references, which are the same at every
     sample: their slopes are 0.
Out: four rows of the batch, by simd.evaluate_planes, or for mip levels ten, by `evaluate_slopes`.

Both references of a triangle are one float32, a whole number below 2^24: 12 bits each, s_ref in the lower ones. 2^11 is
the whole picture, or two of them where the picture is mirrored.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, spelled_out
from ..compiler.widths import PLANE_GROUP
from . import setup as s
from .planes import LEAST_INVERSE, compute_plane, inverse_ratios, values_at
from .simd import evaluate_planes, record_number
from .texture_packing import WRAP_CLAMP, WRAP_MIRROR, PackedTextures, texture_error

TEXCOORDS = 6  # which attributes of a textured surface are texture coordinates: this one and the next
TEXCOORD_PLANE = index(6)  # the first of four planes of a block's triangles
REFERENCE_BITS = np.int32(12)
REFERENCE_UNIT = 2.0**11  # of a picture, or of a period
SINGLE = 2.0**-24  # u
LEVEL_SLOPE = 1.45  # more than 1/ln 2, see texture_error


class TextureCoding(NamedTuple):
    """The textures of surfaces whose texture coordinates may stand in planes."""

    packed: PackedTextures
    of_materials: np.ndarray  # (n_material,) int64: the texture of each, -1 for none
    limits: np.ndarray  # (n_material,) float64: error that is accepted in a texture's colours
    # (n_material,) bool: where coordinates are exact, the look-up in float32 is good enough: also for exact records
    is_exact_looked_up: np.ndarray
    step: float = 1.0  # how many samples it is to the next point that is looked up, with its rounding


@helper
def compute_texcoord_planes(textures, depths, block):
    """Compute the planes of texture coordinates over r; clear HAS_PLANES where a texture's colours may err by more than
    is accepted.

    A plane of a·r with |a·r| <= m that rises by s over the box errs by u·(3 m + 4 s), see gradients.py: so do S, T and
    D, with a = s', t' and 1. The slopes of a sample's texture coordinates are quotients like (S_x - s'·D_x)/D, with six
    roundings, of which s' has some more: they err by

        (8 u·(|S_x| + |s'|·|D_x|) + e_s·|D_x|)/r_min,    e_s the error of s', and the length of a slope by less than
        the sum over both coordinates.
    """
    ints = block.ints
    for k in range(index(s.BLOCK)):
        texture = textures.of_materials[ints[s.MATERIAL + k]]
        if texture < 0 or not ints[s.HAS_PLANES + k]:
            continue
        (s0, s1, s2), (t0, t1, t2), number = relative_texcoords(k, textures.packed, index(texture), block)
        r0, r1, r2 = inverse_ratios(k, depths, block)
        least, largest = min(r0, r1, r2), max(r0, r1, r2)
        s_reach, t_reach = max(abs(s0), abs(s1), abs(s2)), max(abs(t0), abs(t1), abs(t2))
        s_rise = compute_plane(k, TEXCOORD_PLANE, s0 * r0, s1 * r1, s2 * r2, block)
        t_rise = compute_plane(k, TEXCOORD_PLANE + index(1), t0 * r0, t1 * r1, t2 * r2, block)
        r_rise = compute_plane(k, TEXCOORD_PLANE + index(2), r0, r1, r2, block)
        compute_plane(k, TEXCOORD_PLANE + index(3), number, number, number, block)
        r_error = plane_rounding(largest, r_rise)
        at_least = least - r_error
        s_error = texcoord_error(plane_rounding(s_reach * largest, s_rise), r_error, at_least, s_reach)
        t_error = texcoord_error(plane_rounding(t_reach * largest, t_rise), r_error, at_least, t_reach)
        slope_error = slope_rounding(k, s_reach, s_error, index(0), block)
        slope_error += slope_rounding(k, t_reach, t_error, index(1), block)
        level_error = LEVEL_SLOPE * textures.step * slope_error / at_least
        error = texture_error(textures.packed, index(texture), s_error, t_error, level_error)
        limit = textures.limits[ints[s.MATERIAL + k]]
        is_good = (at_least >= LEAST_INVERSE) & (error <= limit)
        ints[s.HAS_PLANES + k] &= is_good


@helper
def relative_texcoords(k, packed, texture, block):
    """Return s' and t' at the vertices of triangle k, texels, and the number of their references."""
    width, height = float(packed.sizes[texture, 0]), float(packed.sizes[texture, 1])
    u0, u1, u2 = values_at(s.ATTRIBUTE + index(TEXCOORDS) * s.NEXT_PLANE + k, block)
    v0, v1, v2 = values_at(s.ATTRIBUTE + index(TEXCOORDS + 1) * s.NEXT_PLANE + k, block)
    s0, s1, s2 = u0 * width, u1 * width, u2 * width
    t0, t1, t2 = (1.0 - v0) * height, (1.0 - v1) * height, (1.0 - v2) * height
    middle = (s0 + s1 + s2) / 3.0, (t0 + t1 + t2) / 3.0
    wraps = packed.wraps[texture, 0], packed.wraps[texture, 1]
    s_ref, t_ref, number = texcoord_references(middle, (width, height), wraps)
    return (s0 - s_ref, s1 - s_ref, s2 - s_ref), (t0 - t_ref, t1 - t_ref, t2 - t_ref), number


@helper
def plane_rounding(largest, rise):
    """Return how far a float32 plane errs within its box."""
    return SINGLE * (3.0 * largest + 4.0 * rise)


@helper
def slope_rounding(k, reach, error, number, block):
    """Return how far S_x - s'·D_x, or the same downwards, errs; of T and t' with `number` 1."""
    row, last = s.PLANE_ATTRIBUTE + (TEXCOORD_PLANE + number) * s.NEXT_PLANE + k, s.NEXT + s.NEXT
    of_r = s.PLANE_ATTRIBUTE + (TEXCOORD_PLANE + index(2)) * s.NEXT_PLANE + k
    steep, r_steep = (
        max(abs(block.reals[row + s.NEXT]), abs(block.reals[row + last])),
        max(abs(block.reals[of_r + s.NEXT]), abs(block.reals[of_r + last])),
    )
    return 8.0 * SINGLE * (steep + reach * r_steep) + error * r_steep


@spelled_out("build_evaluate_slopes")
def evaluate_slopes(entries, group, x, y, out, start, stride):
    """Evaluate a group of four planes as `simd.evaluate_planes`, and copy the slopes of three for each sample of a row.

    The parameters are those of `evaluate_planes`. Ten rows are written: the planes, then d/dx of the first three, then
    d/dy of these.
    """
    evaluate_planes(entries, group, x, y, out, start, stride)
    copy_slopes(entries, group, out, start, stride)


@helper
def copy_slopes(entries, group, out, start, stride):
    """Copy the slopes of three planes for each sample: d/dx of each, then d/dy, behind the planes."""
    for k in range(index(len(entries))):
        first = record_number(entries[k], group) + group.column + index(PLANE_GROUP)
        for i in range(index(PLANE_GROUP - 1)):
            out[start + (index(PLANE_GROUP) + i) * stride + k] = group.numbers[first + i]
            out[start + (index(2 * PLANE_GROUP - 1) + i) * stride + k] = group.numbers[first + index(PLANE_GROUP) + i]


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
