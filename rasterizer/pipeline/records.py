"""What the scan stage leaves for the shade stage: intensities in words, or records with what is interpolated.

There are three ways for a triangle's attributes to reach its samples; each triangle takes the cheapest that is good enough:

* In words: the intensity stands beside the depth, and one addition a sample advances both: I_{p+1} = I_p + ΔI·Δv (Gouraud
  1971). One channel, flat shading and Gouraud's method.
* In planes: a record holds value, d/dx and d/dy of every attribute. Three channels (integers, so that constants stay constant and
  nothing leaves the range of the vertices), and the normals of Phong's method (float32).
* Exact: a record holds the corners themselves, and every visible sample is interpolated from exact edge functions, in perspective.
  What the first two can't do within the tolerance, and everything at tolerance 0.

Which one is decided for each triangle by bounds that stand beside the code, never by measuring.
"""

from typing import NamedTuple

import numpy as np

from .._kernel import borrow, helper
from .transform import SUBPIXEL

LEVEL_BITS = 24
PAYLOAD_BITS = LEVEL_BITS + 1
IS_ID = np.int64(1 << LEVEL_BITS)  # the payload is a record number, not an intensity
IS_EXACT = np.int64(1 << (LEVEL_BITS - 1))  # ... of an exact record
LEVEL_MASK = np.int64(IS_ID - 1)
RECORD_MASK = np.int64(IS_EXACT - 1)
MAX_RECORDS = 1 << (LEVEL_BITS - 1)

EXACT, IN_WORDS, IN_PLANES, NORMAL_PLANES = 0, 1, 2, 3  # kinds of coding; IN_PLANES and above have records with planes

# Columns of a record's integers: the anchor vertex, the two edges that leave it (1/256 px), the triangle, and the side that is seen.
X0, Y0, DX1, DY1, DX2, DY2, FACE, SIDE = range(8)
# Columns of an exact record's numbers: 1/w, depth (orthographic) and each attribute, each at the three vertices.
INV_W, DEPTH, ATTRIBUTE = 0, 3, 6
# Columns of a record's planes: the anchor sample (x + 65536·y), the triangle, then value, d/dx, d/dy of each attribute.
# Records of planes stand one behind the other in a flat array, 2^plane_shift numbers each, so that a place is found by a shift.
ANCHOR, PLANE_FACE, PLANE = 0, 1, 2
ANCHOR_SHIFT = 16


class Polygons(NamedTuple):
    """The triangles: which vertices they join, and where their attributes are (a row a corner)."""

    vertex: np.ndarray  # (3, n) uint32, into the vertices
    corner: np.ndarray  # (3, n) uint32, into the attributes
    is_inverted: np.ndarray  # (n,) uint8: 1 where the shading normals look against the winding


class Coding(NamedTuple):
    """What the words and records of this frame hold."""

    kind: int  # EXACT, IN_WORDS, IN_PLANES or NORMAL_PLANES
    level_scale: float  # levels a unit of intensity
    level_tolerance: float  # error that is accepted, in levels
    normal_limit: float  # NORMAL_PLANES: the largest rise of a normal's component over a triangle's box; see plan.py
    albedo_tolerance: float  # NORMAL_PLANES: error that is accepted in an attribute behind the normals
    needs_distance: bool  # NORMAL_PLANES: a plane of 1/w (orthographic: of depth) stands behind those of the attributes
    inv_w_offset: float  # 1/w = inv_w_offset + inv_w_scale · z
    inv_w_scale: float
    depth_offset: float  # orthographic depth = depth_offset + depth_scale · z, scene units; 0 + 0 z in perspective
    depth_scale: float


class Records(NamedTuple):
    """What shade.py interpolates: a row for each triangle of the band whose words hold a record number."""

    integers: np.ndarray  # (n, 8) int32
    numbers: np.ndarray  # (n, 6 + 3 * n_attribute) float32 or float64
    levels: np.ndarray  # (n << plane_shift,) int32: the planes
    planes: np.ndarray  # the same memory as float32
    plane_shift: int


@helper
def borrow_records(records):
    """The records as arrays that count no references."""
    return Records(
        borrow(records.integers), borrow(records.numbers), borrow(records.levels), borrow(records.planes), records.plane_shift
    )


@helper
def gradient(value1, value2, dx1, dy1, dx2, dy2, inv_area):
    """Derivatives, a 1/256 px, of the plane that rises by value1 along edge 1 and by value2 along edge 2."""
    return (value1 * dy2 - value2 * dy1) * inv_area, (value2 * dx1 - value1 * dx2) * inv_area


@helper
def inv_ws(depths, coding):
    """Least, and largest minus least, of 1/w at the three vertices."""
    z0, z1, z2 = depths
    w0 = coding.inv_w_offset + coding.inv_w_scale * z0
    w1 = coding.inv_w_offset + coding.inv_w_scale * z1
    w2 = coding.inv_w_offset + coding.inv_w_scale * z2
    least = min(w0, w1, w2)
    return least, max(w0, w1, w2) - least


# ---------------------------------------------------------------- levels, in words or in planes


@helper
def level_plane(attributes, channel, corners, edges, offset, steps, depths, coding):
    """Return (is good enough, value at the anchor, d/dx, d/dy a sample), in whole levels, of one channel's intensity.

    Rounding of the value and of one increment a step moves a value by at most e = (steps + 1)/2 levels. So that no value can
    leave the range of the vertices, the plane is first shrunk about the middle of that range by e at both ends; a range below
    2e becomes a constant. Interpolating I instead of I/w errs by at most |ΔI|·(√r-1)/(√r+1) <= |ΔI|·(r-1)/4 with
    r = w_max/w_min: the first is (r-1)/(√r+1)².
    """
    side, c0, c1, c2 = corners
    dx1, dy1, dx2, dy2, inv_area = edges
    scale, most = coding.level_scale, float(LEVEL_MASK)  # no rounding can carry into the bits above
    l0 = min(attributes[side, c0, channel] * scale, most)
    l1 = min(attributes[side, c1, channel] * scale, most)
    l2 = min(attributes[side, c2, channel] * scale, most)
    low, high = min(l0, l1, l2), max(l0, l1, l2)
    spread, middle = high - low, 0.5 * (low + high)
    reach = float(steps[0] + steps[1]) + 1.0  # 2e
    shrink = 1.0 - reach / spread if spread > reach else 0.0
    drift = reach if spread > reach else 0.5 * spread
    inv_w_min, inv_w_rise = inv_ws(depths, coding)
    # Compared after multiplication by 4/w_max, so that nothing is divided; half a level is the rounding of the vertices.
    is_good = spread * inv_w_rise + 4.0 * inv_w_min * (drift + 0.5) <= 4.0 * inv_w_min * coding.level_tolerance
    l_x, l_y = gradient((l1 - l0) * shrink, (l2 - l0) * shrink, dx1, dy1, dx2, dy2, inv_area)
    value = middle + (l0 - middle) * shrink + l_x * offset[0] + l_y * offset[1]
    return is_good, np.int64(np.rint(value)), np.int64(np.rint(l_x * SUBPIXEL)), np.int64(np.rint(l_y * SUBPIXEL))


@helper
def code_word(attributes, corners, edges, offset, steps, depths, coding, record):
    """Return (is coded, payload, its d/dx, d/dy): the plane of the one channel, or `record` where that isn't good enough."""
    is_good, level, level_x, level_y = level_plane(attributes, np.uint64(0), corners, edges, offset, steps, depths, coding)
    if is_good:
        return True, level, level_x, level_y
    return False, record, np.int64(0), np.int64(0)


# ---------------------------------------------------------------- records


@helper
def write_planes(records, n_record, attributes, corners, edges, anchor, offset, steps, depths, coding, face, is_flipped):
    """Write the planes of all attributes; return whether they are good enough."""
    row = np.uint64(n_record) << np.uint64(records.plane_shift)
    records.levels[row + np.uint64(ANCHOR)] = anchor[0] + (anchor[1] << ANCHOR_SHIFT)
    records.levels[row + np.uint64(PLANE_FACE)] = face
    if coding.kind == NORMAL_PLANES:
        return write_normal_planes(records.planes, row, attributes, corners, edges, offset, steps, depths, coding, is_flipped)
    is_good = True
    for channel in range(np.uint64(attributes.shape[2])):
        is_fine, level, level_x, level_y = level_plane(attributes, channel, corners, edges, offset, steps, depths, coding)
        column = row + np.uint64(PLANE) + np.uint64(3) * channel
        # A value may leave 32 bits where the plane is extrapolated; inside the triangle arithmetic modulo 2^32 is right again.
        records.levels[column] = level
        records.levels[column + np.uint64(1)] = level_x
        records.levels[column + np.uint64(2)] = level_y
        is_good &= is_fine
    return is_good


@helper
def write_normal_planes(planes, row, attributes, corners, edges, offset, steps, depths, coding, is_flipped):
    """Write planes of n/w (three), of the albedo (where there is one), and of 1/w or depth (where it is needed).

    The normals' plane gives their direction only, so 1/w is scaled to at most 1. A float32 plane that rises by s over the box
    of its triangle errs by at most 2^-24·(3 + 4 s) there: the roundings of value, slopes, products and sums.
    """
    side, c0, c1, c2 = corners
    z0, z1, z2 = depths
    inv_w_min, inv_w_rise = inv_ws(depths, coding)
    scale = 1.0 / (inv_w_min + inv_w_rise)
    w0 = (coding.inv_w_offset + coding.inv_w_scale * z0) * scale
    w1 = (coding.inv_w_offset + coding.inv_w_scale * z1) * scale
    w2 = (coding.inv_w_offset + coding.inv_w_scale * z2) * scale
    # 1/w loses digits where it spans much: exactly then.
    is_good = not (coding.needs_distance and inv_w_rise > inv_w_min)
    sign = -1.0 if is_flipped else 1.0
    column = row + np.uint64(PLANE)
    is_flat = True
    for k in range(np.uint64(3)):
        is_flat &= (attributes[side, c0, k] == attributes[side, c1, k]) & (attributes[side, c0, k] == attributes[side, c2, k])
    for k in range(np.uint64(attributes.shape[2])):
        a0, a1, a2 = float(attributes[side, c0, k]), float(attributes[side, c1, k]), float(attributes[side, c2, k])
        if k < np.uint64(3):
            # Three equal normals stay exactly constant, because no w is mixed in.
            a0, a1, a2 = sign * a0 * (1.0 if is_flat else w0), sign * a1 * (1.0 if is_flat else w1), sign * a2 * (1.0 if is_flat else w2)
            is_good &= rise(planes, column, a0, a1, a2, edges, offset, steps) <= coding.normal_limit
        else:
            spread = max(a0, a1, a2) - min(a0, a1, a2)
            is_good &= spread * inv_w_rise <= 4.0 * inv_w_min * coding.albedo_tolerance
            is_good &= rise(planes, column, a0, a1, a2, edges, offset, steps) <= coding.normal_limit
        column += np.uint64(3)
    if coding.needs_distance:
        a0, a1, a2 = w0 / scale, w1 / scale, w2 / scale
        if coding.depth_scale != 0.0:
            a0 = coding.depth_offset + coding.depth_scale * z0
            a1 = coding.depth_offset + coding.depth_scale * z1
            a2 = coding.depth_offset + coding.depth_scale * z2
        is_good &= rise(planes, column, a0, a1, a2, edges, offset, steps) <= coding.normal_limit * max(a0, a1, a2)
    return is_good


@helper
def rise(planes, column, a0, a1, a2, edges, offset, steps):
    """Write one attribute's plane; return how much it rises over the triangle's box."""
    dx1, dy1, dx2, dy2, inv_area = edges
    a_x, a_y = gradient(a1 - a0, a2 - a0, dx1, dy1, dx2, dy2, inv_area)
    planes[column] = a0 + a_x * offset[0] + a_y * offset[1]
    planes[column + np.uint64(1)] = a_x * SUBPIXEL
    planes[column + np.uint64(2)] = a_y * SUBPIXEL
    return (abs(a_x) * float(steps[0] + 1) + abs(a_y) * float(steps[1] + 1)) * SUBPIXEL


@helper
def write_exact(records, n_record, attributes, corners, triangle, depths, coding, face, is_flipped):
    """Write where the triangle lies on the screen, and 1/w and the attributes of its three corners."""
    side, c0, c1, c2 = corners
    row = np.uint64(n_record)
    for k in range(6):
        records.integers[row, np.uint64(k)] = triangle[k]
    records.integers[row, np.uint64(FACE)] = face
    records.integers[row, np.uint64(SIDE)] = -1 if is_flipped else 1
    for k in range(3):
        records.numbers[row, np.uint64(INV_W + k)] = coding.inv_w_offset + coding.inv_w_scale * depths[k]
        records.numbers[row, np.uint64(DEPTH + k)] = coding.depth_offset + coding.depth_scale * depths[k]
    column = np.uint64(ATTRIBUTE)
    for k in range(np.uint64(attributes.shape[2])):
        records.numbers[row, column] = attributes[side, c0, k]
        records.numbers[row, column + np.uint64(1)] = attributes[side, c1, k]
        records.numbers[row, column + np.uint64(2)] = attributes[side, c2, k]
        column += np.uint64(3)
