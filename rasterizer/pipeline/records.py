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
def find_slopes(dx1, dy1, dx2, dy2, area):
    """What a rise along edge 1 or 2 adds to d/dx and d/dy, a sample: the columns of the inverse of the edges' matrix."""
    scale = SUBPIXEL / area
    return dy2 * scale, -dy1 * scale, -dx2 * scale, dx1 * scale


@helper
def gradient(rise1, rise2, slopes):
    """Derivatives, a sample, of the plane that rises by rise1 along edge 1 and by rise2 along edge 2."""
    return rise1 * slopes[0] + rise2 * slopes[1], rise1 * slopes[2] + rise2 * slopes[3]


@helper
def inv_ws(depths, coding):
    """Least, and largest minus least, of 1/w at the three vertices."""
    z0, z1, z2 = depths
    w0 = coding.inv_w_offset + coding.inv_w_scale * z0
    w1 = coding.inv_w_offset + coding.inv_w_scale * z1
    w2 = coding.inv_w_offset + coding.inv_w_scale * z2
    least = min(w0, w1, w2)
    return least, max(w0, w1, w2) - least


@helper
def carry_attributes(
    records, n_record, corners, slopes, anchor, offset, steps, depths, place, coding, face, is_flipped, is_sliver
):
    """Take the cheapest way that is good enough; return (payload, its d/dx, d/dy, records so far).

    The plane of a word is `offset` from the first vertex at `anchor`, the first sample of the triangle's box, and extends over
    `steps` samples; those of a record begin at the first sample inside the picture, so that its place fits 32 bits.
    """
    record = IS_ID + n_record
    if coding.kind == IN_WORDS and not is_sliver:
        is_good, level, level_x, level_y = level_plane(corners, np.uint64(0), slopes, offset, steps, depths, coding)
        if is_good:
            return level, level_x, level_y, n_record
    elif coding.kind >= IN_PLANES and not is_sliver:
        shown = (max(anchor[0], 0), max(anchor[1], 0))
        inside = (offset[0] + float(shown[0] - anchor[0]), offset[1] + float(shown[1] - anchor[1]))
        if write_planes(records, n_record, corners, slopes, shown, inside, steps, depths, coding, face, is_flipped):
            return record, np.int64(0), np.int64(0), n_record + 1
    write_exact(records, n_record, corners, place, depths, coding, face, is_flipped)
    return record | IS_EXACT, np.int64(0), np.int64(0), n_record + 1


# ---------------------------------------------------------------- levels, in words or in planes


@helper
def level_plane(corners, channel, slopes, offset, steps, depths, coding):
    """Return (is good enough, value at the anchor, d/dx, d/dy a sample), in whole levels, of one channel's intensity.

    Rounding of the value and of one increment a step moves a value by at most e = (steps + 1)/2 levels. So that no value can
    leave the range of the vertices, the plane is first shrunk about the middle of that range by e at both ends; a range below
    2e becomes a constant. Interpolating I instead of I/w errs by at most |ΔI|·(√r-1)/(√r+1) <= |ΔI|·(r-1)/4 with
    r = w_max/w_min: the first is (r-1)/(√r+1)².
    """
    scale, most = coding.level_scale, float(LEVEL_MASK)  # no rounding can carry into the bits above
    l0, l1, l2 = min(corners[0][channel] * scale, most), min(corners[1][channel] * scale, most), min(corners[2][channel] * scale, most)
    low, high = min(l0, l1, l2), max(l0, l1, l2)
    spread, middle = high - low, 0.5 * (low + high)
    reach = float(steps[0] + steps[1]) + 1.0  # 2e
    shrink = 1.0 - reach / spread if spread > reach else 0.0
    drift = reach if spread > reach else 0.5 * spread
    inv_w_min, inv_w_rise = inv_ws(depths, coding)
    # Compared after multiplication by 4/w_max, so that nothing is divided; half a level is the rounding of the vertices.
    is_good = spread * inv_w_rise + 4.0 * inv_w_min * (drift + 0.5) <= 4.0 * inv_w_min * coding.level_tolerance
    l_x, l_y = gradient((l1 - l0) * shrink, (l2 - l0) * shrink, slopes)
    value = middle + (l0 - middle) * shrink + l_x * offset[0] + l_y * offset[1]
    return is_good, np.int64(np.rint(value)), np.int64(np.rint(l_x)), np.int64(np.rint(l_y))


# ---------------------------------------------------------------- records


@helper
def write_planes(records, n_record, corners, slopes, anchor, offset, steps, depths, coding, face, is_flipped):
    """Write the planes of all attributes; return whether they are good enough."""
    row = np.uint64(n_record) << np.uint64(records.plane_shift)
    levels = records.levels
    levels[row + np.uint64(ANCHOR)] = anchor[0] + (anchor[1] << ANCHOR_SHIFT)
    levels[row + np.uint64(PLANE_FACE)] = face
    column = row + np.uint64(PLANE)
    if coding.kind == NORMAL_PLANES:
        return write_normal_planes(records.planes, column, corners, slopes, offset, steps, depths, coding, is_flipped)
    is_good = True
    for channel in range(np.uint64(3)):
        is_fine, level, level_x, level_y = level_plane(corners, channel, slopes, offset, steps, depths, coding)
        # A value may leave 32 bits where the plane is extrapolated; inside the triangle arithmetic modulo 2^32 is right again.
        levels[column], levels[column + np.uint64(1)], levels[column + np.uint64(2)] = level, level_x, level_y
        is_good &= is_fine
        column += np.uint64(3)
    return is_good


@helper
def write_normal_planes(planes, column, corners, slopes, offset, steps, depths, coding, is_flipped):
    """Write planes of n/w (three), of the albedo (where there is one), and of 1/w or depth (where it is needed).

    The normals' plane gives their direction only, so 1/w is scaled to at most 1. A float32 plane that rises by s over the box
    of its triangle errs by at most 2^-24·(3 + 4 s) there: the roundings of value, slopes, products and sums.
    """
    n0, n1, n2 = corners
    inv_w_min, inv_w_rise = inv_ws(depths, coding)
    scale = -1.0 / (inv_w_min + inv_w_rise) if is_flipped else 1.0 / (inv_w_min + inv_w_rise)
    w0 = (coding.inv_w_offset + coding.inv_w_scale * depths[0]) * scale
    w1 = (coding.inv_w_offset + coding.inv_w_scale * depths[1]) * scale
    w2 = (coding.inv_w_offset + coding.inv_w_scale * depths[2]) * scale
    x, y, z = np.uint64(0), np.uint64(1), np.uint64(2)
    if (n0[x] == n1[x]) & (n0[x] == n2[x]) & (n0[y] == n1[y]) & (n0[y] == n2[y]) & (n0[z] == n1[z]) & (n0[z] == n2[z]):
        w0 = w1 = w2 = -1.0 if is_flipped else 1.0  # three equal normals stay exactly constant if no w is mixed in
    most = max(
        write_plane(planes, column, n0[x] * w0, n1[x] * w1, n2[x] * w2, slopes, offset, steps),
        write_plane(planes, column + np.uint64(3), n0[y] * w0, n1[y] * w1, n2[y] * w2, slopes, offset, steps),
        write_plane(planes, column + np.uint64(6), n0[z] * w0, n1[z] * w1, n2[z] * w2, slopes, offset, steps),
    )
    column += np.uint64(9)
    is_good = most <= coding.normal_limit
    for k in range(np.uint64(3), np.uint64(len(n0))):
        spread = max(n0[k], n1[k], n2[k]) - min(n0[k], n1[k], n2[k])
        is_good &= spread * inv_w_rise <= 4.0 * inv_w_min * coding.albedo_tolerance
        is_good &= write_plane(planes, column, n0[k], n1[k], n2[k], slopes, offset, steps) <= coding.normal_limit
        column += np.uint64(3)
    if coding.needs_distance:
        is_good &= write_distance(planes, column, depths, slopes, offset, steps, coding)
    return is_good


@helper
def write_distance(planes, column, depths, slopes, offset, steps, coding):
    """Write the plane of 1/w, or of depth without perspective; return whether it is good enough."""
    add, times = coding.inv_w_offset, coding.inv_w_scale
    if coding.depth_scale != 0.0:
        add, times = coding.depth_offset, coding.depth_scale
    a0, a1, a2 = add + times * depths[0], add + times * depths[1], add + times * depths[2]
    most = write_plane(planes, column, a0, a1, a2, slopes, offset, steps)
    # 1/w loses digits where it spans much.
    return (most <= coding.normal_limit * max(a0, a1, a2)) & (max(a0, a1, a2) <= 2.0 * min(a0, a1, a2))


@helper
def write_plane(planes, column, a0, a1, a2, slopes, offset, steps):
    """Write one attribute's plane; return how much it rises over the triangle's box."""
    a_x, a_y = gradient(a1 - a0, a2 - a0, slopes)
    planes[column] = a0 + a_x * offset[0] + a_y * offset[1]
    planes[column + np.uint64(1)] = a_x
    planes[column + np.uint64(2)] = a_y
    return abs(a_x) * float(steps[0] + 1) + abs(a_y) * float(steps[1] + 1)


@helper
def write_exact(records, n_record, corners, triangle, depths, coding, face, is_flipped):
    """Write where the triangle lies on the screen, and 1/w, depth and the attributes of its three corners."""
    row = np.uint64(n_record)
    for k in range(6):
        records.integers[row, np.uint64(k)] = triangle[k]
    records.integers[row, np.uint64(FACE)] = face
    records.integers[row, np.uint64(SIDE)] = -1 if is_flipped else 1
    for k in range(3):
        records.numbers[row, np.uint64(INV_W + k)] = coding.inv_w_offset + coding.inv_w_scale * depths[k]
        records.numbers[row, np.uint64(DEPTH + k)] = coding.depth_offset + coding.depth_scale * depths[k]
    column = np.uint64(ATTRIBUTE)
    for k in range(np.uint64(len(corners[0]))):
        for corner in corners:
            records.numbers[row, column] = corner[k]
            column += np.uint64(1)
