"""Gradients: the planes of what is interpolated over a block of triangles, and whether they are good enough.

In:  a `Block` of setup.py: vertices, slopes, attributes, and the error that is accepted.
Out: planes (value at the anchor, d/dx, d/dy) in its rows PLANE_INTENSITY and PLANE_ATTRIBUTE; HAS_INTENSITY and
     HAS_PLANES are 1 for the triangles of which these err by no more than the tolerance.

There are three paths for a triangle's attributes to its samples. Its material says which is the cheapest that will do
for its illumination; each triangle takes the cheapest from there on that is good enough for its shape:

* In packed samples: the intensity stands beside the depth, and one addition a sample advances both: I_{p+1} = I_p +
  ΔI·Δv (Gouraud 1971). One channel, flat shading and Gouraud's method.
* In planes: a setup holds value, d/dx and d/dy of every attribute in float32: the normals of Phong's method over w,
  and intensities of three channels.
* Exact: a setup holds the corners themselves, and every visible sample is interpolated from exact edge functions, in
  perspective and in float64. What the first two can't do within the tolerance, and everything at tolerance 0.

Which one is decided by bounds that stand beside the code, never by measuring. Letters: w distance along the viewing
axis, r = w_0/w the same inverted, with w_0 the nearest one that is seen, I intensity, n normal, a any other value, m
the largest |a| of a triangle, s what a plane rises by over its box, u = 2^-24 the rounding of float32. An index 0, 1, 2
is a vertex, x and y are slopes.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper
from . import setup as s
from .setup import (
    MIN_INVERSE,
    SINGLE,
    DepthScale,
    compute_plane,
    depth_rounding,
    linear_in_z,
    values_at,
)
from .textures import FIRST_TEXCOORD, TextureCoding, compute_texcoord_planes
from .visibility import INTENSITY_MASK

EXACT, IN_PACKED, IN_PLANES = 0, 1, 2  # the cheapest path that a material's triangles may take
# Features of a material, bits: it is computed in float32, or in float64 and so from exact setups; it has three
# channels, a texture; what is behind it is seen, or nothing else; colours are given with the model.
SINGLE_PRECISION, DOUBLE_PRECISION, HAS_COLORS, HAS_TEXTURE, IS_TRANSPARENT, IS_INVISIBLE, HAS_ALBEDO = (
    1, 2, 4, 8, 16, 32, 64,
)  # fmt: skip
MAX_CHANNELS = 3


class Coding(NamedTuple):
    """How this frame's attributes reach the samples. Which of these are None decides what is compiled."""

    paths: np.ndarray  # (n_material,) uint8: EXACT, IN_PACKED or IN_PLANES
    features: np.ndarray  # (n_material,) uint8: the bits above
    reads_double: np.ndarray  # (n_material,) bool: attributes are not rounded to float32
    n_attributes: np.ndarray  # (n_material,) int64: how many of the attributes are read
    limits: np.ndarray  # (n_material,) float64: error that is accepted: in an intensity, or of a normal, in 2^-24 / √3
    intensity_scale: float  # intensity steps a unit; 0 where attributes are normals, and what stands behind them
    albedo_tolerance: float | None  # error that is accepted in an attribute behind the normals; None: there is none
    needs_distance: bool  # samples have positions, which are found from their packed samples
    textures: TextureCoding | None  # None where no texture coordinates stand in planes
    depths: DepthScale
    is_exact: bool  # all setups are


@helper
def clear_planes(block):
    """Let all setups of a block be exact."""
    ints = block.ints
    for k in range(s.BLOCK):
        ints[s.HAS_INTENSITY + k] = ints[s.HAS_PLANES + k] = ints[s.IS_WEIGHTED + k] = ints[s.PIECE + k] = 0


# ---------------------------------------------------------------- intensity steps, in packed samples


@helper
def compute_intensities(n_attribute, coding, block):
    """Compute the planes of intensity steps, then those of intensities where the first are not good enough; clear
    HAS_INTENSITY and HAS_PLANES where neither are."""
    ints = block.ints
    if coding.needs_distance:
        check_distances(coding, block)
    n_in_packed = 0
    for k in range(s.BLOCK):
        ints[s.HAS_INTENSITY + k] = ints[s.PIECE + k] = 0
        ints[s.HAS_PLANES + k] &= ints[s.PATH + k] != EXACT
        n_in_packed += ints[s.PATH + k] == IN_PACKED
    if n_in_packed > 0:
        compute_intensity_plane(coding, block)
        if count_left(block) > 0:
            compute_pieces(coding, block)
    n_left = count_left(block)
    if n_left > 0 and n_attribute > 0:
        compute_value_planes(0, MAX_CHANNELS, coding.depths, block)
        compute_textured(n_attribute, coding.textures, coding.depths, block)


@helper
def count_left(block):
    """Return how many triangles of a block may have planes, and have no intensity steps."""
    n_left = 0
    for k in range(s.BLOCK):
        n_left += block.ints[s.HAS_PLANES + k] > block.ints[s.HAS_INTENSITY + k]
    return n_left


@helper
def compute_textured(n_attribute, textures, depths, block):
    """Compute the planes of what textured surfaces give off, and of texture coordinates, if any stand in planes."""
    if textures is not None:
        if n_attribute > MAX_CHANNELS:
            compute_value_planes(MAX_CHANNELS, MAX_CHANNELS, depths, block)
        compute_texcoords(n_attribute, textures, depths, block)


@helper
def compute_intensity_plane(coding, block):
    """Compute the plane, in whole intensity steps, of the intensity of triangles whose materials have one channel.

    Rounding of the value and of one increment a step moves a value by at most e = (steps + 1)/2 intensity steps. So
    that no value can leave the range of the vertices, the plane is first shrunk about the middle of that range by e at
    both ends; a range below 2e becomes a constant. Interpolating I instead of I/w errs by at most |ΔI|·(√r-1)/(√r+1) <=
    |ΔI|·(r-1)/4 with r = w_max/w_min: the first is (r-1)/(√r+1)².
    Whatever the intensities are, also none (NaN), negative or infinite ones, the intensity steps are within
    0..INTENSITY_MASK - 1: no packed sample can carry into the bits above it.
    """
    ints, longs, reals = block.ints, block.longs, block.reals
    scale, highest = coding.intensity_scale, float(INTENSITY_MASK - 1)  # no rounding can carry into the bits above
    for k in range(s.BLOCK):
        path, tolerance = ints[s.PATH + k], reals[s.LIMIT + k] * scale
        i0, i1, i2 = values_at(s.ATTRIBUTE + k, block)
        intensity0, intensity1 = clamp(i0 * scale, highest), clamp(i1 * scale, highest)
        intensity2 = clamp(i2 * scale, highest)
        low, high = min(intensity0, intensity1, intensity2), max(intensity0, intensity1, intensity2)
        spread, middle = high - low, 0.5 * (low + high)
        margin = float(ints[s.EXTENT_X + k] + ints[s.EXTENT_Y + k]) + 1.0  # 2e
        shrink = 1.0 - margin / spread if spread > margin else 0.0
        drift = margin if spread > margin else 0.5 * spread
        w0, w1, w2 = linear_in_z(k, coding.depths.inv_w_offset, coding.depths.inv_w_scale, block)
        least = min(w0, w1, w2)
        rise = max(w0, w1, w2) - least
        # Compared after multiplication by 4/w_max, so that nothing is divided; half an intensity step is the rounding
        # of the vertices.
        is_good = spread * rise + 4.0 * least * (drift + 0.5) <= 4.0 * least * tolerance
        ints[s.HAS_INTENSITY + k] = ints[s.HAS_PLANES + k] & is_good & (path == IN_PACKED)
        rise1, rise2 = (intensity1 - intensity0) * shrink, (intensity2 - intensity0) * shrink
        dx = rise1 * reals[s.SLOPE_X1 + k] + rise2 * reals[s.SLOPE_X2 + k]
        dy = rise1 * reals[s.SLOPE_Y1 + k] + rise2 * reals[s.SLOPE_Y2 + k]
        value = middle + (intensity0 - middle) * shrink + dx * reals[s.OFFSET_X + k] + dy * reals[s.OFFSET_Y + k]
        longs[s.PLANE_INTENSITY + k], longs[s.PLANE_INTENSITY_DX + k] = np.int64(np.rint(value)), np.int64(np.rint(dx))
        longs[s.PLANE_INTENSITY_DY + k] = np.int64(np.rint(dy))


# Where perspective bends the intensity of a triangle too much, its spans are cut at every PIECE-th column of the
# picture. At both ends of a piece the intensity step is that of the perspective, between them it advances by ΔI·Δv as
# everywhere.
#
# With f = 1/w and M = (I - I_m)/w, both linear on the screen, I = I_m + M/f, where I_m is the middle of the vertices'
# intensities: so |M/f| <= D/2, D = |ΔI| of the vertices. With the least f of the triangle:
#
#     along a row           I_x = (M_x - (M/f)·f_x)/f, so |I_x| <= G = (|M_x| + D/2·|f_x|)/f_min
#     over a piece of P     |ΔI| <= min(D, P·G), and f grows by a factor q with q - 1 <= P·|f_x|/f_min
#     between its ends      I - line <= |ΔI|·(√q - 1)/(√q + 1) <= |ΔI|·(q - 1)/4 <= min(D, P·G)·P·|f_x|/(4 f_min)
#
# Intensity steps are whole: an end is rounded by half of one, an increment by half of one, which adds up to P/2 at
# most. So M is first shrunk by P/2 + 1 intensity steps, as planes are: no rounding leaves the range of the vertices.
# Float64 errs by 2^-28 of what M and f rise by (MAX_ELONGATION in setup.py), so with f <= 1 an intensity step errs by
# 3/2·2^-28·D/f_min.
#
# Columns are those of the picture, and ends are samples of the triangle: a packed sample is a function of triangle and
# sample alone.

PIECES = 8, 16, 32, 64, 128, 256, 512  # samples
LEAST_INVERSE = 2.0**-20  # of f, the largest being 1: far above what float64 loses


@helper
def compute_pieces(coding, block):
    """Find the longest pieces whose errors are accepted, and the planes of what stands at their ends, of triangles for
    which one plane of intensity steps is not good enough; the others of their materials get exact setups."""
    ints, reals = block.ints, block.reals
    scale, highest = coding.intensity_scale, float(INTENSITY_MASK - 1)
    for k in range(s.BLOCK):
        tolerance = reals[s.LIMIT + k] * scale
        i0, i1, i2 = values_at(s.ATTRIBUTE + k, block)
        intensity0, intensity1 = clamp(i0 * scale, highest), clamp(i1 * scale, highest)
        intensity2 = clamp(i2 * scale, highest)
        low, high = min(intensity0, intensity1, intensity2), max(intensity0, intensity1, intensity2)
        spread, middle = high - low, 0.5 * (low + high)
        f0, f1, f2 = linear_in_z(k, coding.depths.inv_w_offset, coding.depths.inv_w_scale, block)
        inverse = 1.0 / max(f0, f1, f2)
        f0, f1, f2 = f0 * inverse, f1 * inverse, f2 * inverse
        m0, m1, m2 = (intensity0 - middle) * f0, (intensity1 - middle) * f1, (intensity2 - middle) * f2
        s.compute_plane_at(s.PLANE_OVER_W + k, k, m0, m1, m2, block)
        s.compute_plane_at(s.PLANE_INV_W + k, k, f0, f1, f2, block)
        least, bend = min(f0, f1, f2), abs(reals[s.PLANE_INV_W + s.NEXT + k])
        slope = (abs(reals[s.PLANE_OVER_W + s.NEXT + k]) + 0.5 * spread * bend) / least
        rest = tolerance - 2.0**-26 * spread / least
        piece = 1 if rest >= 3.0 else 0
        for n in PIECES:
            steps = min(n, float(ints[s.EXTENT_X + k]))
            bent = min(spread, steps * slope) * steps * bend
            piece = n if bent <= 4.0 * least * (rest - float(n + 2)) else piece
        margin = float(piece + 2)  # of both ends
        shrink = 1.0 - margin / spread if spread > margin else 0.0
        for part in range(3):
            reals[s.PLANE_OVER_W + part * s.NEXT + k] *= shrink
        reals[s.MIDDLE + k], reals[s.HALF_RANGE + k] = middle, 0.5 * spread * shrink
        is_left = (ints[s.PATH + k] == IN_PACKED) & (ints[s.HAS_PLANES + k] > ints[s.HAS_INTENSITY + k])
        is_good = is_left & (piece > 0) & (least >= LEAST_INVERSE)
        ints[s.PIECE + k] = piece if is_good else 0
        ints[s.HAS_INTENSITY + k] |= is_good
        ints[s.HAS_PLANES + k] &= is_good | (not is_left)


@helper
def clamp(intensity, highest):
    """Return the intensity step within 0..highest; 0 where it is no number."""
    intensity = intensity if intensity > 0.0 else 0.0
    return intensity if intensity < highest else highest


# ---------------------------------------------------------------- normals


@helper
def compute_normals(n_attribute, coding, block):
    """Compute the planes of normals and albedo, where there are any; clear HAS_PLANES where they aren't good enough."""
    ints = block.ints
    for k in range(s.BLOCK):
        ints[s.HAS_INTENSITY + k] = ints[s.IS_WEIGHTED + k] = 0
        ints[s.HAS_PLANES + k] &= ints[s.PATH + k] == IN_PLANES
    compute_normal_planes(coding, block)
    compute_albedo(n_attribute, coding.albedo_tolerance, coding.depths, block)
    compute_texcoords(n_attribute, coding.textures, coding.depths, block)
    if coding.needs_distance:
        check_distances(coding, block)


@helper
def compute_albedo(n_attribute, tolerance, depths, block):
    """Compute the planes of the albedo, if any stands behind normals."""
    if tolerance is not None:
        if n_attribute > 3:
            for k in range(s.BLOCK):
                block.reals[s.LIMIT + k] = tolerance
            compute_value_planes(3, 0, depths, block)


@helper
def compute_texcoords(n_attribute, textures, depths, block):
    """Compute the planes of texture coordinates, if there are any."""
    if textures is not None:
        if n_attribute > FIRST_TEXCOORD:
            compute_texcoord_planes(textures, depths, block)


@helper
def compute_normal_planes(coding, block):
    """Compute the planes of n/w: their direction is all that counts, so 1/w is scaled to at most 1.

    A float32 plane that rises by s over the box of its triangle errs by at most u·(3 + 4 s) there: the roundings of
    value, slopes, products and sums. With three components that turns the normal by √3·u·(3 + 4 s)/|n/w|, the error
    over the length of what is interpolated: coding.limits says how many u a normal may turn by, over √3.
    shortest_normal says how long n/w is at least. Where nothing is left of it, the setup is exact.
    """
    for k in range(s.BLOCK):
        w0, w1, w2 = linear_in_z(k, coding.depths.inv_w_offset, coding.depths.inv_w_scale, block)
        least = min(w0, w1, w2)
        largest = least + (max(w0, w1, w2) - least)
        sign = -1.0 if block.ints[s.IS_FLIPPED + k] else 1.0
        scale = sign / largest
        is_flat, length = shortest_normal(k, block)
        # Three equal normals stay exactly constant if no w is mixed in; then the length is 1.
        w0, w1, w2 = sign if is_flat else w0 * scale, sign if is_flat else w1 * scale, sign if is_flat else w2 * scale
        length *= 1.0 if is_flat else least / largest
        rise = 0.0
        for axis in range(3):
            n0, n1, n2 = values_at(s.ATTRIBUTE + axis * s.NEXT_PLANE + k, block)
            rise = max(rise, compute_plane(k, axis, n0 * w0, n1 * w1, n2 * w2, block))
        # No normals at all are exact.
        limit = block.reals[s.LIMIT + k]
        block.ints[s.HAS_PLANES + k] &= (3.0 + 4.0 * rise <= limit * length) | (rise == 0.0)


@helper
def shortest_normal(k, block):
    """Tell whether triangle k's three normals are equal, and how long every mean of them is at least.

    A mean of the corners' normals n_i has weights b_i >= 0 with Σ b_i = 1, so Σ b_i² >= 1/3. With m the least n_i² and
    c the least n_i·n_j of two corners, or m if that is less,

        |Σ b_i n_i|² >= m Σ b_i² + 2 c Σ b_i b_j = (m - c) Σ b_i² + c >= (m - c)/3 + c = (m + 2 c)/3.

    n/w is such a mean times a mean of 1/w, so |n/w| >= (w_min/w_max)·√((m + 2 c)/3) with 1/w scaled to at most 1: short
    where corners look apart, as where a file has reversed one, where a corner has no normal, and far away in a triangle
    that spans much depth.
    """
    is_flat = True
    s0 = s1 = s2 = c0 = c1 = c2 = 0.0
    for axis in range(3):
        n0, n1, n2 = values_at(s.ATTRIBUTE + axis * s.NEXT_PLANE + k, block)
        is_flat &= (n0 == n1) & (n0 == n2)
        s0, s1, s2 = s0 + n0 * n0, s1 + n1 * n1, s2 + n2 * n2
        c0, c1, c2 = c0 + n1 * n2, c1 + n2 * n0, c2 + n0 * n1
    min_square = min(s0, s1, s2)
    square = (min_square + 2.0 * min(c0, c1, c2, min_square)) / 3.0
    return is_flat, np.sqrt(max(square, 0.0))


@helper
def check_distances(coding, block):
    """Clear HAS_PLANES where the distance that is found from a sample's depth may be off by more than 10 u of itself:
    2 u of rounding, the rest that of the depth.

    With perspective it is found from 1/w, else from the depth; the other one is a constant, and its scale 0.
    """
    for k in range(s.BLOCK):
        w0, w1, w2 = linear_in_z(k, coding.depths.inv_w_offset, coding.depths.inv_w_scale, block, s.OWN_Z0)
        d0, d1, d2 = linear_in_z(k, coding.depths.depth_offset, coding.depths.depth_scale, block, s.OWN_Z0)
        units = depth_rounding(k, block)
        is_good = units * abs(coding.depths.inv_w_scale) <= 8.0 * 2.0**-24 * min(w0, w1, w2)
        is_good &= units * abs(coding.depths.depth_scale) <= 8.0 * 2.0**-24 * min(abs(d0), abs(d1), abs(d2))
        block.ints[s.HAS_PLANES + k] &= is_good


# ---------------------------------------------------------------- values: intensities and albedo

# * Affine: planes of the values themselves, where a triangle spans so little depth that perspective hardly bends them.
# * Weighted: planes of a·r. A sample divides by its own r, which is found from its depth, and what leaves the range of
#   the vertices by rounding is brought back into it (samples.py): so a constant stays one.

N_VALUE = 3  # attributes that are looked at together


@helper
def compute_value_planes(first, max_affine, depths, block):
    """Compute the planes of N_VALUE attributes from number `first` on, as far as triangles have them.

    Parameters
    ----------
    first : a constant: of rows that are known when it is compiled the compiler sees that they don't overlap
    max_affine : materials of so many attributes may have affine planes
    depths : DepthScale
    """
    ints, reals = block.ints, block.reals
    for k in range(s.BLOCK):
        n_own, accepted = ints[s.N_OWN + k] - first, reals[s.LIMIT + k]  # other materials of the block may have more
        magnitude, spread, not_finite = measure_values(k, first, n_own, block)
        r0, r1, r2 = linear_in_z(k, depths.ratio_offset, depths.ratio_scale, block)
        least, largest = min(r0, r1, r2), max(r0, r1, r2)
        is_affine = (ints[s.N_OWN + k] <= max_affine) & is_bent_little(spread, least, largest, accepted)
        factors = 1.0 if is_affine else r0, 1.0 if is_affine else r1, 1.0 if is_affine else r2
        rise = not_finite
        for number in range(N_VALUE):
            a0, a1, a2 = values_at(s.ATTRIBUTE + (first + number) * s.NEXT_PLANE + k, block)
            a0, a1, a2 = a0 * factors[0], a1 * factors[1], a2 * factors[2]
            here = compute_plane(k, first + number, a0, a1, a2, block)
            rise = larger(rise, here if number < n_own else 0.0)
        shift = (depth_rounding(k, block) + reals[s.PLANE_SHIFT + k]) * abs(depths.ratio_scale)
        shrinkage = affine_error(magnitude, rise)
        error = 2.0 * shrinkage if is_affine else weighted_error(magnitude, rise, least, largest, shift)
        is_good = error <= (0.5 * accepted if is_affine else accepted)
        is_good &= is_affine | (least >= MIN_INVERSE)
        ints[s.HAS_PLANES + k] &= is_good | (n_own <= 0)  # where it has none of these, any are good
        ints[s.IS_WEIGHTED + k] = ints[s.IS_WEIGHTED + k] if n_own <= 0 else not is_affine
        for number in range(N_VALUE):
            shrink_plane(k, first + number, shrinkage if is_affine else 0.0, block)


@helper
def measure_values(k, first, n_own, block):
    """Return the largest absolute value and the largest range of triangle k's attributes, and 0, or NaN where one isn't
    finite: then no plane is good."""
    magnitude = spread = not_finite = 0.0
    for number in range(N_VALUE):
        a0, a1, a2 = values_at(s.ATTRIBUTE + (first + number) * s.NEXT_PLANE + k, block)
        is_own = number < n_own
        magnitude = larger(magnitude, max(abs(a0), abs(a1), abs(a2)) if is_own else 0.0)
        spread = larger(spread, max(a0, a1, a2) - min(a0, a1, a2) if is_own else 0.0)
        not_finite += (a0 - a0) + (a1 - a1) + (a2 - a2) if is_own else 0.0
    return magnitude, spread, not_finite


@helper
def larger(before, here):
    """Return the larger number; `before` where one of them isn't any."""
    return here if here > before else before


@helper
def is_bent_little(spread, least, largest, accepted):
    """Tell whether affine planes take half of the error that is accepted, at most.

    Interpolating a instead of a·r errs by at most |Δa|·(√q - 1)/(√q + 1) <= |Δa|·(q - 1)/4 with q = r_max/r_min: the
    first is (q - 1)/(√q + 1)².
    """
    return spread * (largest - least) <= 2.0 * least * accepted


@helper
def affine_error(magnitude, rise):
    """Bound what float32 takes from an affine plane.

    With u = 2^-24 it rounds the value at the anchor, at most m + s, and the slopes; then two products and two sums:
    u·(3 m + 4 s). One m and one s more leave room for products of roundings and for those of float64.
    """
    return SINGLE * (4.0 * magnitude + 5.0 * rise)


@helper
def weighted_error(magnitude, rise, least, largest, shift):
    """Bound the error of a sample's value.

    A weighted plane errs by u·(3 m r_max + 4 s). A sample's r is found from a depth that is off by d z-buffer units:
    `depth_rounding`, and PLANE_SHIFT, because values are interpolated between the vertices. So r is off by
    d·|ratio_scale|/r_min of it and 2 u more of rounding; one more is for the product. So a is off by

        (u·(3 m r_max + 4 s) + m·d·|ratio_scale|)/r_min + 3 u m

    `shift` is d·|ratio_scale|.
    """
    return (SINGLE * (3.0 * magnitude * largest + 4.0 * rise) + magnitude * shift) / least + 3.0 * SINGLE * magnitude


@helper
def shrink_plane(k, attribute, margin, block):
    """Shrink an affine plane about the middle of its range by `margin` at both ends, so that no rounding can leave it;
    a range that is less becomes a constant. Weighted planes stay as they are: of these, `margin` is 0."""
    reals = block.reals
    a0, a1, a2 = values_at(s.ATTRIBUTE + attribute * s.NEXT_PLANE + k, block)
    low, high = min(a0, a1, a2), max(a0, a1, a2)
    spread, middle = high - low, 0.5 * (low + high)
    is_wide = spread > 2.0 * margin
    shrink = 1.0 - 2.0 * margin / spread if is_wide else 0.0
    row = s.PLANE_ATTRIBUTE + attribute * s.NEXT_PLANE + k
    value = middle + (reals[row] - middle) * shrink
    reals[row] = value if margin > 0.0 else reals[row]
    reals[row + s.NEXT] *= shrink if margin > 0.0 else 1.0
    reals[row + s.NEXT + s.NEXT] *= shrink if margin > 0.0 else 1.0
