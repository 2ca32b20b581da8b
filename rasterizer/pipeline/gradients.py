"""Gradients: the planes of what is interpolated over a block of triangles, and whether they are good enough.

In:  a `Block` of setup.py: vertices, slopes, attributes.
Out: planes (value at the anchor, d/dx, d/dy) in its rows PLANE_LEVEL and PLANE_ATTRIBUTE; HAS_PLANES stays 1 for the
     triangles whose planes err by no more than the tolerance.

There are three ways for a triangle's attributes to reach its samples; each triangle takes the cheapest that is good
enough:

* In entries: the intensity stands beside the depth, and one addition a sample advances both: I_{p+1} = I_p + ΔI·Δv
  (Gouraud 1971). One channel, flat shading and Gouraud's method.
* In planes: a record holds value, d/dx and d/dy of every attribute. Three channels (integers, so that constants stay
  constant and nothing leaves the range of the vertices), and the normals of Phong's method (float32).
* Exact: a record holds the corners themselves, and every visible sample is interpolated from exact edge functions, in
  perspective. What the first two can't do within the tolerance, and everything at tolerance 0.

Which one is decided for each triangle by bounds that stand beside the code, never by measuring. Letters: w distance
along the viewing axis, I intensity, n normal, u = 2^-24 the rounding of float32. An index 0, 1, 2 is a vertex, x and y
are slopes.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import choice, helper, index
from . import setup as s
from .visibility import LEVEL_MASK

EXACT, IN_ENTRIES, LEVEL_PLANES, NORMAL_PLANES = 0, 1, 2, 3  # from LEVEL_PLANES on there are records with planes
DISTANCE_PLANE = s.MOST_ATTRIBUTE_PLANES - 1


class Coding(NamedTuple):
    """How this frame's attributes reach the samples. Its subclass, and what is None, decide what is compiled."""

    kind: int  # EXACT, IN_ENTRIES, LEVEL_PLANES or NORMAL_PLANES
    level_scale: float | None  # levels a unit of intensity; None where attributes are no intensities
    level_tolerance: float  # error that is accepted, in levels
    normal_limit: float | None  # how far a normal may turn, in units of 2^-24, see compute_normal_planes; or None
    albedo_tolerance: float  # NORMAL_PLANES: error that is accepted in an attribute behind the normals
    needs_distance: bool  # NORMAL_PLANES: a plane of 1/w (orthographic: of depth) stands beside those of the normals
    inv_w_offset: float  # 1/w = inv_w_offset + inv_w_scale · z
    inv_w_scale: float
    depth_offset: float  # orthographic depth = depth_offset + depth_scale · z, scene units; 0 + 0 z in perspective
    depth_scale: float


class LevelCoding(Coding):
    """Intensities in entries or in planes of levels, where they are good enough."""


class NormalCoding(Coding):
    """Normals, and what stands behind them, in planes of float32 where they are good enough."""


CODINGS = {EXACT: Coding, IN_ENTRIES: LevelCoding, LEVEL_PLANES: LevelCoding, NORMAL_PLANES: NormalCoding}


def choose_gradients(n_attribute, coding, block):
    """Return what is compiled in the place of `compute_gradients`: only what the coding needs."""
    if coding.instance_class is LevelCoding:
        return compute_levels
    if coding.instance_class is NormalCoding:
        return compute_normals
    return lambda n_attribute, coding, block: None


@choice(choose_gradients)
def compute_gradients(n_attribute, coding, block):
    """Compute the planes of a block's attributes; clear HAS_PLANES where they aren't good enough."""
    if isinstance(coding, LevelCoding):
        compute_levels(n_attribute, coding, block)
    elif isinstance(coding, NormalCoding):
        compute_normals(n_attribute, coding, block)


@helper
def compute_levels(n_attribute, coding, block):
    """Compute the planes of one channel for entries, of three for records."""
    for channel in range(index(n_attribute)):
        compute_level_plane(channel, coding, block)


@helper
def compute_normals(n_attribute, coding, block):
    """Compute the planes of normals, albedo, and distances, where there are any."""
    compute_normal_planes(coding, block)
    for attribute in range(index(3), index(n_attribute)):
        compute_albedo_plane(attribute, coding, block)
    if coding.needs_distance:
        compute_distance_plane(coding, block)


@helper
def inverse_depths(k, coding, block):
    """Compute 1/w at the three vertices of triangle k."""
    z0, z1, z2 = block.reals[s.Z0 + k], block.reals[s.Z1 + k], block.reals[s.Z2 + k]
    offset, scale = coding.inv_w_offset, coding.inv_w_scale
    return offset + scale * z0, offset + scale * z1, offset + scale * z2


@helper
def values_at(row, block):
    """Return an attribute of a triangle at the three vertices."""
    return block.reals[row], block.reals[row + s.NEXT], block.reals[row + s.NEXT + s.NEXT]


@helper
def compute_level_plane(channel, coding, block):
    """Compute the plane, in whole levels, of one channel's intensity.

    Rounding of the value and of one increment a step moves a value by at most e = (steps + 1)/2 levels. So that no
    value can leave the range of the vertices, the plane is first shrunk about the middle of that range by e at both
    ends; a range below 2e becomes a constant. Interpolating I instead of I/w errs by at most |ΔI|·(√r-1)/(√r+1) <=
    |ΔI|·(r-1)/4 with r = w_max/w_min: the first is (r-1)/(√r+1)².
    Whatever the intensities are, also none (NaN), negative or infinite ones, the levels are within 0..LEVEL_MASK - 1:
    no entry can carry into the bits above it.
    """
    ints, longs, reals = block.ints, block.longs, block.reals
    scale, most = coding.level_scale, float(LEVEL_MASK - 1)  # no rounding can carry into the bits above
    out = s.PLANE_LEVEL + channel * s.NEXT_PLANE
    for k in range(index(s.BLOCK)):
        i0, i1, i2 = values_at(s.ATTRIBUTE + channel * s.NEXT_PLANE + k, block)
        level0, level1, level2 = clamp(i0 * scale, most), clamp(i1 * scale, most), clamp(i2 * scale, most)
        low, high = min(level0, level1, level2), max(level0, level1, level2)
        spread, middle = high - low, 0.5 * (low + high)
        reach = float(ints[s.EXTENT_X + k] + ints[s.EXTENT_Y + k]) + 1.0  # 2e
        shrink = 1.0 - reach / spread if spread > reach else 0.0
        drift = reach if spread > reach else 0.5 * spread
        w0, w1, w2 = inverse_depths(k, coding, block)
        least = min(w0, w1, w2)
        rise = max(w0, w1, w2) - least
        # Compared after multiplication by 4/w_max, so that nothing is divided; half a level is the rounding of the
        # vertices.
        ints[s.HAS_PLANES + k] &= spread * rise + 4.0 * least * (drift + 0.5) <= 4.0 * least * coding.level_tolerance
        rise1, rise2 = (level1 - level0) * shrink, (level2 - level0) * shrink
        dx = rise1 * reals[s.SLOPE_X1 + k] + rise2 * reals[s.SLOPE_X2 + k]
        dy = rise1 * reals[s.SLOPE_Y1 + k] + rise2 * reals[s.SLOPE_Y2 + k]
        value = middle + (level0 - middle) * shrink + dx * reals[s.OFFSET_X + k] + dy * reals[s.OFFSET_Y + k]
        longs[out + k], longs[out + s.NEXT + k] = np.int64(np.rint(value)), np.int64(np.rint(dx))
        longs[out + s.NEXT + s.NEXT + k] = np.int64(np.rint(dy))


@helper
def clamp(level, most):
    """Return the level within 0..most; 0 where it is no number."""
    level = level if level > 0.0 else 0.0
    return level if level < most else most


@helper
def compute_normal_planes(coding, block):
    """Compute the planes of n/w: their direction is all that counts, so 1/w is scaled to at most 1.

    A float32 plane that rises by s over the box of its triangle errs by at most u·(3 + 4 s) there: the roundings of
    value, slopes, products and sums. With three components that turns the normal by √3·u·(3 + 4 s)/|n/w|, the error
    over the length of what is interpolated: coding.normal_limit is how many u a normal may turn by, over √3.
    shortest_normal says how long n/w is at least. Where nothing is left of it, the record is exact.
    """
    for k in range(index(s.BLOCK)):
        w0, w1, w2 = inverse_depths(k, coding, block)
        least = min(w0, w1, w2)
        largest = least + (max(w0, w1, w2) - least)
        sign = -1.0 if block.ints[s.IS_FLIPPED + k] else 1.0
        scale = sign / largest
        is_flat, length = shortest_normal(k, block)
        # Three equal normals stay exactly constant if no w is mixed in; then the length is 1.
        w0, w1, w2 = sign if is_flat else w0 * scale, sign if is_flat else w1 * scale, sign if is_flat else w2 * scale
        length *= 1.0 if is_flat else least / largest
        most = 0.0
        for axis in range(index(3)):
            n0, n1, n2 = values_at(s.ATTRIBUTE + axis * s.NEXT_PLANE + k, block)
            most = max(most, compute_plane(k, axis, n0 * w0, n1 * w1, n2 * w2, block))
        # No normals at all are exact.
        block.ints[s.HAS_PLANES + k] &= (3.0 + 4.0 * most <= coding.normal_limit * length) | (most == 0.0)


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
    for axis in range(index(3)):
        n0, n1, n2 = values_at(s.ATTRIBUTE + axis * s.NEXT_PLANE + k, block)
        is_flat &= (n0 == n1) & (n0 == n2)
        s0, s1, s2 = s0 + n0 * n0, s1 + n1 * n1, s2 + n2 * n2
        c0, c1, c2 = c0 + n1 * n2, c1 + n2 * n0, c2 + n0 * n1
    least_square = min(s0, s1, s2)
    square = (least_square + 2.0 * min(c0, c1, c2, least_square)) / 3.0
    return is_flat, np.sqrt(max(square, 0.0))


@helper
def compute_albedo_plane(attribute, coding, block):
    """Compute the plane of an attribute behind the normals, in affine interpolation.

    See compute_level_plane for its bound, and compute_normal_planes for that of rounding, which may take half of what
    is accepted: u·(3 m + 4 s) with m the largest value.
    """
    for k in range(index(s.BLOCK)):
        a0, a1, a2 = values_at(s.ATTRIBUTE + attribute * s.NEXT_PLANE + k, block)
        w0, w1, w2 = inverse_depths(k, coding, block)
        least = min(w0, w1, w2)
        most = max(a0, a1, a2)
        spread = most - min(a0, a1, a2)
        is_good = spread * (max(w0, w1, w2) - least) <= 2.0 * least * coding.albedo_tolerance
        rise = compute_plane(k, attribute, a0, a1, a2, block)
        is_good &= 3.0 * most + 4.0 * rise <= 2.0**23 * coding.albedo_tolerance
        block.ints[s.HAS_PLANES + k] &= is_good


@helper
def compute_distance_plane(coding, block):
    """Compute the plane of 1/w, or of depth without perspective, behind those of the attributes.

    1/w loses digits where it spans much, and planes where they rise far beyond their triangle: taken are those with
    w_max <= 2 w_min that rise by half of their maximum m at most. These err by u·(3 + 4/2)·m, that is 10 u of the
    distance itself.
    """
    reals = block.reals
    offset, scale = coding.inv_w_offset, coding.inv_w_scale
    if coding.depth_scale != 0.0:
        offset, scale = coding.depth_offset, coding.depth_scale
    for k in range(index(s.BLOCK)):
        z0, z1, z2 = reals[s.Z0 + k], reals[s.Z1 + k], reals[s.Z2 + k]
        d0, d1, d2 = offset + scale * z0, offset + scale * z1, offset + scale * z2
        rise = compute_plane(k, index(DISTANCE_PLANE), d0, d1, d2, block)
        largest = max(d0, d1, d2)
        block.ints[s.HAS_PLANES + k] &= (2.0 * rise <= largest) & (largest <= 2.0 * min(d0, d1, d2))


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
