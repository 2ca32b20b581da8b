"""What all planes over a block of triangles are computed from (gradients.py, texture_planes.py).

Letters: w distance along the viewing axis, r = w_0/w the same inverted, with w_0 the nearest one that is seen. An index
0, 1, 2 is a vertex, x and y are slopes.
"""

from typing import NamedTuple

from ..compiler.kernels import helper, index
from . import setup as s

# How far a plane of depth may be off, z-buffer units, beside half a unit a step: half a unit at the anchor, and less
# than 39 of float64, see setup.MAX_LEVERAGE.
DEPTH_PLANE_ROUNDING = 40.0
# Where r is less, its inverse is no number that float32 is at home with.
LEAST_INVERSE = 2.0**-40


class DepthScale(NamedTuple):
    """What the z of an entry says, z-buffer units."""

    inv_w_offset: float  # 1/w = inv_w_offset + inv_w_scale · z; 1 + 0 z without perspective
    inv_w_scale: float
    depth_offset: float  # orthographic depth = depth_offset + depth_scale · z, scene units; 0 + 0 z in perspective
    depth_scale: float
    ratio_offset: float  # r = ratio_offset + ratio_scale · z; 1 + 0 z without perspective
    ratio_scale: float


@helper
def inverse_depths(k, depths, block):
    """Compute 1/w at the three vertices of triangle k."""
    z0, z1, z2 = block.reals[s.Z0 + k], block.reals[s.Z1 + k], block.reals[s.Z2 + k]
    offset, scale = depths.inv_w_offset, depths.inv_w_scale
    return offset + scale * z0, offset + scale * z1, offset + scale * z2


@helper
def straight_depths(k, depths, block):
    """Compute the depths without perspective at the three vertices of triangle k; with it all are 0."""
    z0, z1, z2 = block.reals[s.Z0 + k], block.reals[s.Z1 + k], block.reals[s.Z2 + k]
    offset, scale = depths.depth_offset, depths.depth_scale
    return offset + scale * z0, offset + scale * z1, offset + scale * z2


@helper
def inverse_ratios(k, depths, block):
    """Compute r at the three vertices of triangle k."""
    z0, z1, z2 = block.reals[s.Z0 + k], block.reals[s.Z1 + k], block.reals[s.Z2 + k]
    offset, scale = depths.ratio_offset, depths.ratio_scale
    return offset + scale * z0, offset + scale * z1, offset + scale * z2


@helper
def values_at(row, block):
    """Return an attribute of a triangle at the three vertices."""
    return block.reals[row], block.reals[row + s.NEXT], block.reals[row + s.NEXT + s.NEXT]


@helper
def compute_plane(k, plane, a0, a1, a2, block):
    """Compute a plane through the values at the vertices of triangle k; return how much it rises over the whole box."""
    ints, reals = block.ints, block.reals
    rise1, rise2 = a1 - a0, a2 - a0
    dx = rise1 * reals[s.SLOPE_X1 + k] + rise2 * reals[s.SLOPE_X2 + k]
    dy = rise1 * reals[s.SLOPE_Y1 + k] + rise2 * reals[s.SLOPE_Y2 + k]
    out = s.PLANE_ATTRIBUTE + plane * s.NEXT_PLANE + k
    reals[out] = a0 + dx * reals[s.OFFSET_X + k] + dy * reals[s.OFFSET_Y + k]
    reals[out + s.NEXT], reals[out + s.NEXT + s.NEXT] = dx, dy
    return abs(dx) * float(ints[s.EXTENT_X + k] + 1) + abs(dy) * float(ints[s.EXTENT_Y + k] + 1)


@helper
def depth_rounding(k, block):
    """Return how far the depth of a sample of triangle k may be off, in z-buffer units: see setup.py."""
    return 0.5 * float(block.ints[s.EXTENT_X + k] + block.ints[s.EXTENT_Y + k]) + DEPTH_PLANE_ROUNDING


# ----------------------------------------------------------------
# Planes of values over a block of triangles, intensities or albedo, and whether they are good enough.
# In:  a `Block` of setup.py: vertices, slopes, attributes; the error that is accepted in its row LIMIT.
# Out: planes (value at the anchor, d/dx, d/dy) in its rows PLANE_ATTRIBUTE; IS_WEIGHTED says which of two kinds they
# are;
#      HAS_PLANES is cleared where they err by more than is accepted.
#
# * Affine: planes of the values themselves, where a triangle spans so little depth that perspective hardly bends them.
# * Weighted: planes of a·r. A sample divides by its own r, which is found from its depth, and what leaves the range of
#   the vertices by rounding is brought back into it (records.py): so a constant stays one.
#
# Letters: as in gradients.py; a is a value, m the largest |a| of a triangle, s what a plane rises by over its box.

N_VALUE = 3  # attributes that are looked at together
SINGLE = 2.0**-24


@helper
def compute_value_planes(first, most_affine, depths, block):
    """Compute the planes of N_VALUE attributes from number `first` on, as far as triangles have them.

    Parameters
    ----------
    first : a constant: of rows that are known when it is compiled the compiler sees that they don't overlap
    most_affine : materials of so many attributes may have affine planes
    depths : DepthScale
    """
    ints, reals = block.ints, block.reals
    for k in range(index(s.BLOCK)):
        n_own, accepted = ints[s.N_OWN + k] - first, reals[s.LIMIT + k]  # other materials of the block may have more
        most, spread, nothing = measure_values(k, first, n_own, block)
        r0, r1, r2 = inverse_ratios(k, depths, block)
        least, largest = min(r0, r1, r2), max(r0, r1, r2)
        is_affine = (ints[s.N_OWN + k] <= most_affine) & is_bent_little(spread, least, largest, accepted)
        factors = 1.0 if is_affine else r0, 1.0 if is_affine else r1, 1.0 if is_affine else r2
        rise = nothing
        for number in range(index(N_VALUE)):
            a0, a1, a2 = values_at(s.ATTRIBUTE + (index(first) + number) * s.NEXT_PLANE + k, block)
            a0, a1, a2 = a0 * factors[0], a1 * factors[1], a2 * factors[2]
            here = compute_plane(k, index(first) + number, a0, a1, a2, block)
            rise = larger(rise, here if number < n_own else 0.0)
        shift = depth_rounding(k, block) * abs(depths.ratio_scale)
        shrinkage = affine_error(most, rise)
        error = 2.0 * shrinkage if is_affine else weighted_error(most, rise, least, largest, shift)
        is_good = error <= (0.5 * accepted if is_affine else accepted)
        is_good &= is_affine | (least >= LEAST_INVERSE)
        ints[s.HAS_PLANES + k] &= is_good | (n_own <= 0)  # where it has none of these, any are good
        ints[s.IS_WEIGHTED + k] = ints[s.IS_WEIGHTED + k] if n_own <= 0 else not is_affine
        for number in range(index(N_VALUE)):
            shrink_plane(k, index(first) + number, shrinkage if is_affine else 0.0, block)


@helper
def measure_values(k, first, n_own, block):
    """Return the largest absolute value and the largest range of triangle k's attributes, and 0, or NaN where one isn't
    finite: then no plane is good."""
    most = spread = nothing = 0.0
    for number in range(index(N_VALUE)):
        a0, a1, a2 = values_at(s.ATTRIBUTE + (index(first) + number) * s.NEXT_PLANE + k, block)
        is_own = number < n_own
        most = larger(most, max(abs(a0), abs(a1), abs(a2)) if is_own else 0.0)
        spread = larger(spread, max(a0, a1, a2) - min(a0, a1, a2) if is_own else 0.0)
        nothing += (a0 - a0) + (a1 - a1) + (a2 - a2) if is_own else 0.0
    return most, spread, nothing


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
def affine_error(most, rise):
    """Bound what float32 takes from an affine plane.

    With u = 2^-24 it rounds the value at the anchor, at most m + s, and the slopes; then two products and two sums:
    u·(3 m + 4 s). One m and one s more leave room for products of roundings and for those of float64.
    """
    return SINGLE * (4.0 * most + 5.0 * rise)


@helper
def weighted_error(most, rise, least, largest, shift):
    """Bound the error of a sample's value.

    A weighted plane errs by u·(3 m r_max + 4 s); a sample's r, found from a depth that is off by d z-buffer units, by
    d·|ratio_scale|/r_min of it and 2 u more of rounding; one more is for the product. So a is off by

        (u·(3 m r_max + 4 s) + m·d·|ratio_scale|)/r_min + 3 u m

    `shift` is d·|ratio_scale|.
    """
    return (SINGLE * (3.0 * most * largest + 4.0 * rise) + most * shift) / least + 3.0 * SINGLE * most


@helper
def shrink_plane(k, attribute, reach, block):
    """Shrink an affine plane about the middle of its range by `reach` at both ends, so that no rounding can leave it; a
    range that is less becomes a constant. Weighted planes stay as they are: of these, `reach` is 0."""
    reals = block.reals
    a0, a1, a2 = values_at(s.ATTRIBUTE + attribute * s.NEXT_PLANE + k, block)
    low, high = min(a0, a1, a2), max(a0, a1, a2)
    spread, middle = high - low, 0.5 * (low + high)
    is_wide = spread > 2.0 * reach
    shrink = 1.0 - 2.0 * reach / spread if is_wide else 0.0
    row = s.PLANE_ATTRIBUTE + attribute * s.NEXT_PLANE + k
    value = middle + (reals[row] - middle) * shrink
    reals[row] = value if reach > 0.0 else reals[row]
    reals[row + s.NEXT] *= shrink if reach > 0.0 else 1.0
    reals[row + s.NEXT + s.NEXT] *= shrink if reach > 0.0 else 1.0
