"""What the scan stage leaves for the shade stage: intensities in words, or records with what is interpolated.

There are three ways for a triangle's attributes to reach its samples; each triangle takes the cheapest that is good
enough:

* In words: the intensity stands beside the depth, and one addition a sample advances both: I_{p+1} = I_p + ΔI·Δv
  (Gouraud
  1971). One channel, flat shading and Gouraud's method.
* In planes: a record holds value, d/dx and d/dy of every attribute. Three channels (integers, so that constants stay
  constant and nothing leaves the range of the vertices), and the normals of Phong's method (float32).
* Exact: a record holds the corners themselves, and every visible sample is interpolated from exact edge functions, in
perspective.
  What the first two can't do within the tolerance, and everything at tolerance 0.

Which one is decided for each triangle by bounds that stand beside the code, never by measuring.
"""

from typing import NamedTuple

import numpy as np
from numba.extending import overload

from ..compiler.kernels import borrow, helper
from .clip import WHOLE_DEPTH
from .setup import (
    ANCHOR_X,
    ANCHOR_Y,
    ATTRIBUTE0,
    BLOCK,
    DISTANCE_PLANE,
    IS_FLIPPED,
    IS_GOOD,
    LEVEL,
    NEXT,
    OFFSET_X,
    OFFSET_Y,
    PLANE0,
    SLOPE_X1,
    SLOPE_X2,
    SLOPE_Y1,
    SLOPE_Y2,
    STEPS_X,
    STEPS_Y,
    X0,
    X1,
    X2,
    Y0,
    Y1,
    Y2,
    Z0,
    Z1,
    Z2,
)
from .setup import CUT as CUT_FACE
from .simd import GROUP

LEVEL_BITS = 24
PAYLOAD_BITS = LEVEL_BITS + 1
IS_ID = np.int64(1 << LEVEL_BITS)  # the payload is a record number, not an intensity
IS_EXACT = np.int64(1 << (LEVEL_BITS - 1))  # ... of an exact record
LEVEL_MASK = np.int64(IS_ID - 1)
RECORD_MASK = np.int64(IS_EXACT - 1)
MAX_RECORDS = 1 << (LEVEL_BITS - 1)

EXACT, IN_WORDS, IN_PLANES, NORMAL_PLANES = 0, 1, 2, 3  # kinds of coding; IN_PLANES and above have records with planes

# Columns of an exact record's integers: the first vertex and the two edges that leave it (1/256 px), the triangle, and
# the side that is seen; the row of the planes of the clipped face that it is a part of, or -1.
PLACE, FACE, SIDE, CUT = 0, 6, 7, 8
N_INTEGER = 9
# Columns of an exact record's numbers: 1/w, depth (orthographic) and each attribute, each at the three vertices.
INV_W, DEPTH, ATTRIBUTE = 0, 3, 6
# Columns of a record of planes: the triangle, the sample where the planes are anchored, and then the planes of four
# attributes a group: four values, four d/dx, four d/dy (simd.py). Such records stand one behind the other in a flat
# array, 2^plane_shift numbers each, so that a place is found by a shift.
PLANE_FACE, PLANE_X, PLANE_Y, PLANE = 0, 1, 2, 4
DISTANCE = 3  # the fourth attribute of the normals' group: 1/w, or depth without perspective, where it is needed


class Coding(NamedTuple):
    """What the words and records of this frame hold. Its subclass decides what is compiled."""

    kind: int  # EXACT, IN_WORDS, IN_PLANES or NORMAL_PLANES
    level_scale: float  # levels a unit of intensity
    level_tolerance: float  # error that is accepted, in levels
    normal_limit: float  # NORMAL_PLANES: how far a normal may turn, in units of 2^-24; see find_normals
    albedo_tolerance: float  # NORMAL_PLANES: error that is accepted in an attribute behind the normals
    needs_distance: bool  # NORMAL_PLANES: a plane of 1/w (orthographic: of depth) stands beside those of the normals
    inv_w_offset: float  # 1/w = inv_w_offset + inv_w_scale · z
    inv_w_scale: float
    depth_offset: float  # orthographic depth = depth_offset + depth_scale · z, scene units; 0 + 0 z in perspective
    depth_scale: float


class LevelCoding(Coding):
    """Intensities in words or in planes of levels, where they are good enough."""


class NormalCoding(Coding):
    """Normals, and what stands behind them, in planes of float32 where they are good enough."""


CODINGS = {EXACT: Coding, IN_WORDS: LevelCoding, IN_PLANES: LevelCoding, NORMAL_PLANES: NormalCoding}


class Records(NamedTuple):
    """What shade.py interpolates: a row for each triangle of the band whose words hold a record number."""

    integers: np.ndarray  # (n, N_INTEGER) int32
    numbers: np.ndarray  # (n, 6 + 3 * n_attribute) float32 or float64
    levels: np.ndarray  # (n << plane_shift,) int32: the planes
    planes: np.ndarray  # the same memory as float32
    plane_shift: int
    cut: (
        np.ndarray
    )  # (n_cut, 14) float64: the planes of clipped faces, see clip.Clipped; those of the picture, not of the band


@helper
def borrow_records(records):
    """The records as arrays that count no references."""
    return Records(
        borrow(records.integers), borrow(records.numbers), borrow(records.levels), borrow(records.planes), records.plane_shift,
        borrow(records.cut),
    )  # fmt: skip


# ---------------------------------------------------------------- a block at a time: planes, and whether they are good
# enough


def carry_attributes(n_attribute, coding, block):
    """Find the planes of a block's attributes, and where they are good enough (IS_GOOD)."""
    raise NotImplementedError("compiled code only")


@overload(carry_attributes)
def _overload_carry_attributes(n_attribute, coding, block):
    if coding.instance_class is LevelCoding:
        return lambda n_attribute, coding, block: carry_levels(n_attribute, coding, block)
    if coding.instance_class is NormalCoding:
        return lambda n_attribute, coding, block: carry_normals(n_attribute, coding, block)
    return lambda n_attribute, coding, block: None


@helper
def carry_levels(n_attribute, coding, block):
    """One channel for words, three for planes."""
    for channel in range(np.uint64(n_attribute)):
        find_levels(channel, coding, block)


@helper
def carry_normals(n_attribute, coding, block):
    """Normals, albedo, and distances, where there are any."""
    find_normals(coding, block)
    for k in range(np.uint64(3), np.uint64(n_attribute)):
        find_albedo(k, coding, block)
    if coding.needs_distance:
        find_distances(coding, block)


@helper
def inv_ws(z0, z1, z2, coding):
    """Least, and largest minus least, of 1/w at the three vertices."""
    w0 = coding.inv_w_offset + coding.inv_w_scale * z0
    w1 = coding.inv_w_offset + coding.inv_w_scale * z1
    w2 = coding.inv_w_offset + coding.inv_w_scale * z2
    least = min(w0, w1, w2)
    return least, max(w0, w1, w2) - least


@helper
def find_levels(channel, coding, block):
    """Planes, in whole levels, of one channel's intensity.

    Rounding of the value and of one increment a step moves a value by at most e = (steps + 1)/2 levels. So that no
    value can leave the range of the vertices, the plane is first shrunk about the middle of that range by e at both
    ends; a range below 2e becomes a constant. Interpolating I instead of I/w errs by at most |ΔI|·(√r-1)/(√r+1) <=
    |ΔI|·(r-1)/4 with r = w_max/w_min: the first is (r-1)/(√r+1)².
    Whatever the intensities are, also none (NaN), negative or infinite ones, the levels are within 0..LEVEL_MASK - 1:
    no word can carry into the bits above it.
    """
    ints, longs, reals = block.ints, block.longs, block.reals
    scale, most = coding.level_scale, float(LEVEL_MASK - 1)  # no rounding can carry into the bits above
    row, out = ATTRIBUTE0 + np.uint64(3) * channel * NEXT, LEVEL + np.uint64(3) * channel * NEXT
    for k in range(np.uint64(BLOCK)):
        a0, a1, a2 = reals[row + k], reals[row + NEXT + k], reals[row + NEXT + NEXT + k]
        l0, l1, l2 = within(a0 * scale, most), within(a1 * scale, most), within(a2 * scale, most)
        low, high = min(l0, l1, l2), max(l0, l1, l2)
        spread, middle = high - low, 0.5 * (low + high)
        reach = float(ints[STEPS_X + k] + ints[STEPS_Y + k]) + 1.0  # 2e
        shrink = 1.0 - reach / spread if spread > reach else 0.0
        drift = reach if spread > reach else 0.5 * spread
        inv_w_min, inv_w_rise = inv_ws(reals[Z0 + k], reals[Z1 + k], reals[Z2 + k], coding)
        # Compared after multiplication by 4/w_max, so that nothing is divided; half a level is the rounding of the
        # vertices.
        is_good = spread * inv_w_rise + 4.0 * inv_w_min * (drift + 0.5) <= 4.0 * inv_w_min * coding.level_tolerance
        rise1, rise2 = (l1 - l0) * shrink, (l2 - l0) * shrink
        l_x = rise1 * reals[SLOPE_X1 + k] + rise2 * reals[SLOPE_X2 + k]
        l_y = rise1 * reals[SLOPE_Y1 + k] + rise2 * reals[SLOPE_Y2 + k]
        value = middle + (l0 - middle) * shrink + l_x * reals[OFFSET_X + k] + l_y * reals[OFFSET_Y + k]
        longs[out + k], longs[out + NEXT + k], longs[out + NEXT + NEXT + k] = (
            np.int64(np.rint(value)), np.int64(np.rint(l_x)), np.int64(np.rint(l_y)),
        )  # fmt: skip
        ints[IS_GOOD + k] &= is_good


@helper
def within(level, most):
    """The level within 0..most; 0 where it is no number."""
    level = level if level > 0.0 else 0.0
    return level if level < most else most


@helper
def find_normals(coding, block):
    """Planes of n/w: their direction is all that counts, so 1/w is scaled to at most 1.

    A float32 plane that rises by s over the box of its triangle errs by at most u·(3 + 4 s) there, u = 2^-24: the
    roundings of value, slopes, products and sums. With three components that turns the normal by √3·u·(3 + 4 s)/|n/w|,
    the error over the length of what is interpolated: coding.normal_limit is how many u a normal may turn by, over √3.

    The shortest n/w: it is the mean of the corners' normals n_i, with weights b_i >= 0 and Σ b_i = 1, times a mean of
    1/w. With m the least n_i² and c the least n_i·n_j of two corners, or m if that is less,

        |Σ b_i n_i|² >= m Σ b_i² + 2 c Σ b_i b_j = (m - c) Σ b_i² + c >= (m - c)/3 + c = (m + 2 c)/3,     as Σ b_i² >= 1/3.

    So |n/w| >= (w_min/w_max)·√((m + 2 c)/3): short where corners look apart, as where a file has reversed one, where a
    corner has no normal, and far away in a triangle that spans much depth. Where nothing is left of it, the record is
    exact.
    """
    ints, reals = block.ints, block.reals
    for k in range(np.uint64(BLOCK)):
        z0, z1, z2 = reals[Z0 + k], reals[Z1 + k], reals[Z2 + k]
        inv_w_min, inv_w_rise = inv_ws(z0, z1, z2, coding)
        sign = -1.0 if ints[IS_FLIPPED + k] else 1.0
        scale = sign / (inv_w_min + inv_w_rise)
        w0 = (coding.inv_w_offset + coding.inv_w_scale * z0) * scale
        w1 = (coding.inv_w_offset + coding.inv_w_scale * z1) * scale
        w2 = (coding.inv_w_offset + coding.inv_w_scale * z2) * scale
        is_flat = True
        s0 = s1 = s2 = c0 = c1 = c2 = 0.0
        for axis in range(3):
            row = ATTRIBUTE0 + np.uint64(3 * axis * BLOCK)
            n0, n1, n2 = reals[row + k], reals[row + NEXT + k], reals[row + NEXT + NEXT + k]
            is_flat &= (n0 == n1) & (n0 == n2)
            s0, s1, s2 = s0 + n0 * n0, s1 + n1 * n1, s2 + n2 * n2
            c0, c1, c2 = c0 + n1 * n2, c1 + n2 * n0, c2 + n0 * n1
        # Three equal normals stay exactly constant if no w is mixed in.
        w0, w1, w2 = sign if is_flat else w0, sign if is_flat else w1, sign if is_flat else w2
        most = 0.0
        for axis in range(3):
            row = ATTRIBUTE0 + np.uint64(3 * axis * BLOCK)
            a0, a1, a2 = reals[row + k] * w0, reals[row + NEXT + k] * w1, reals[row + NEXT + NEXT + k] * w2
            most = max(most, find_plane(k, np.uint64(axis), a0, a1, a2, block))
        shortest = min(s0, s1, s2)
        square = (shortest + 2.0 * min(c0, c1, c2, shortest)) / 3.0
        # No normals at all are exact. The length is 1 where all three are equal.
        length = np.sqrt(max(square, 0.0)) * (1.0 if is_flat else inv_w_min / (inv_w_min + inv_w_rise))
        ints[IS_GOOD + k] &= (3.0 + 4.0 * most <= coding.normal_limit * length) | (most == 0.0)


@helper
def find_albedo(attribute, coding, block):
    """The plane of an attribute behind the normals, in affine interpolation: see find_levels for its bound, and
    find_normals for that of rounding, which may take half of what is accepted: u·(3 m + 4 s) with m the largest
    value."""
    ints, reals = block.ints, block.reals
    row = ATTRIBUTE0 + np.uint64(3) * attribute * NEXT
    for k in range(np.uint64(BLOCK)):
        a0, a1, a2 = reals[row + k], reals[row + NEXT + k], reals[row + NEXT + NEXT + k]
        inv_w_min, inv_w_rise = inv_ws(reals[Z0 + k], reals[Z1 + k], reals[Z2 + k], coding)
        most = max(a0, a1, a2)
        spread = most - min(a0, a1, a2)
        is_good = spread * inv_w_rise <= 2.0 * inv_w_min * coding.albedo_tolerance
        rise = find_plane(k, attribute, a0, a1, a2, block)
        ints[IS_GOOD + k] &= is_good & (3.0 * most + 4.0 * rise <= 2.0**23 * coding.albedo_tolerance)


@helper
def find_distances(coding, block):
    """The plane of 1/w, or of depth without perspective, behind those of the attributes.

    1/w loses digits where it spans much, and planes where they rise far beyond their triangle: taken are those with
    w_max <= 2 w_min that rise by half of their maximum m at most. These err by u·(3 + 4/2)·m, that is 10 u of the
    distance itself.
    """
    ints, reals = block.ints, block.reals
    add, times = coding.inv_w_offset, coding.inv_w_scale
    if coding.depth_scale != 0.0:
        add, times = coding.depth_offset, coding.depth_scale
    for k in range(np.uint64(BLOCK)):
        a0, a1, a2 = add + times * reals[Z0 + k], add + times * reals[Z1 + k], add + times * reals[Z2 + k]
        most = find_plane(k, np.uint64(DISTANCE_PLANE), a0, a1, a2, block)
        largest = max(a0, a1, a2)
        ints[IS_GOOD + k] &= (2.0 * most <= largest) & (largest <= 2.0 * min(a0, a1, a2))


@helper
def find_plane(k, plane, a0, a1, a2, block):
    """Find a plane through the values at the three vertices; return how much it rises over the triangle's box."""
    ints, reals = block.ints, block.reals
    rise1, rise2 = a1 - a0, a2 - a0
    a_x = rise1 * reals[SLOPE_X1 + k] + rise2 * reals[SLOPE_X2 + k]
    a_y = rise1 * reals[SLOPE_Y1 + k] + rise2 * reals[SLOPE_Y2 + k]
    out = PLANE0 + np.uint64(3) * plane * NEXT + k
    reals[out] = a0 + a_x * reals[OFFSET_X + k] + a_y * reals[OFFSET_Y + k]
    reals[out + NEXT], reals[out + NEXT + NEXT] = a_x, a_y
    return abs(a_x) * float(ints[STEPS_X + k] + 1) + abs(a_y) * float(ints[STEPS_Y + k] + 1)


# ---------------------------------------------------------------- a triangle at a time: records


@helper
def write_planes(records, n_record, k, face, n_attribute, coding, block):
    """Write the record of triangle k of the block: the planes of all attributes."""
    ints, longs, reals = block.ints, block.longs, block.reals
    row = np.uint64(n_record) << np.uint64(records.plane_shift)
    levels, planes = records.levels, records.planes
    levels[row + np.uint64(PLANE_FACE)] = face
    levels[row + np.uint64(PLANE_X)], levels[row + np.uint64(PLANE_Y)] = ints[ANCHOR_X + k], ints[ANCHOR_Y + k]
    column = row + np.uint64(PLANE)
    if coding.kind == IN_PLANES:
        # A value may leave 32 bits where the plane is extrapolated; inside the triangle arithmetic modulo 2^32 is right
        # again.
        source = LEVEL + k
        for _ in range(3):
            for part in range(np.uint64(3)):
                levels[column + part * np.uint64(GROUP)] = longs[source + part * NEXT]
            source, column = source + NEXT + NEXT + NEXT, column + np.uint64(1)
        return
    copy_planes(planes, column, PLANE0 + k, reals)
    if coding.needs_distance:
        copy_plane(planes, column + np.uint64(DISTANCE), PLANE0 + np.uint64(3 * DISTANCE_PLANE) * NEXT + k, reals)
    if n_attribute > 3:
        copy_planes(planes, column + np.uint64(3 * GROUP), PLANE0 + np.uint64(9) * NEXT + k, reals)


@helper
def copy_planes(planes, column, source, reals):
    """Copy the planes of three attributes from a block's rows to a record."""
    for attribute in range(np.uint64(3)):
        copy_plane(planes, column + attribute, source + np.uint64(3) * attribute * NEXT, reals)


@helper
def copy_plane(planes, column, source, reals):
    """Copy one plane."""
    for part in range(np.uint64(3)):
        planes[column + part * np.uint64(GROUP)] = reals[source + part * NEXT]


@helper
def write_exact(records, n_record, k, face, n_attribute, coding, block):
    """Write where triangle k lies on the screen, and 1/w, depth and the attributes of its three corners; of a part of a
    clipped face the depths and attributes are those of the face's corners, and the weights come from its planes."""
    ints, reals = block.ints, block.reals
    row, numbers = np.uint64(n_record), records.numbers
    x0, y0 = np.int64(ints[X0 + k]), np.int64(ints[Y0 + k])
    place = (x0, y0, ints[X1 + k] - x0, ints[Y1 + k] - y0, ints[X2 + k] - x0, ints[Y2 + k] - y0)
    for column in range(6):
        records.integers[row, np.uint64(PLACE + column)] = place[column]
    records.integers[row, np.uint64(FACE)] = face
    records.integers[row, np.uint64(SIDE)] = -1 if ints[IS_FLIPPED + k] else 1
    cut = ints[CUT_FACE + k]
    records.integers[row, np.uint64(CUT)] = cut
    for corner in range(np.uint64(3)):
        z = reals[Z0 + corner * NEXT + k]
        numbers[row, np.uint64(INV_W) + corner] = coding.inv_w_offset + coding.inv_w_scale * z
        numbers[row, np.uint64(DEPTH) + corner] = coding.depth_offset + coding.depth_scale * z
    if cut >= 0:
        for corner in range(np.uint64(3)):
            numbers[row, np.uint64(DEPTH) + corner] = records.cut[np.uint64(cut), np.uint64(WHOLE_DEPTH) + corner]
    for column in range(np.uint64(3 * n_attribute)):
        numbers[row, np.uint64(ATTRIBUTE) + column] = reals[ATTRIBUTE0 + column * NEXT + k]
