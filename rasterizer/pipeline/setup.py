"""Triangle setup: boxes, slopes and planes of depth over a block of triangles. The first part of the scan stage.

In:  faces, in order, and what they refer to (transform.py).
Out: `Block`: for each triangle its vertices, clockwise on the screen and the topmost first, its box, the slopes of
     planes over it, and the plane of its depth; gradients.py adds the planes of what is interpolated.

The scan stage takes its triangles BLOCK at a time. What is to be known of them stands in rows, one quantity a row and
one triangle a column, so that the arithmetic runs through all of them in vector instructions: done one by one, small
triangles would take as long to set up as to fill. A block that isn't full is worked on to its end all the same:
constant loops are shorter. All rows of a type stand one behind the other in one flat array, `reals[Z0 + k]`: with
offsets that are known when it is compiled, the compiler sees that rows don't overlap.

         v0 _______          The box goes from the first sample of any row or column to the one behind the last. A plane
     A + |  \\      |         is anchored at the first sample A of the box: value = value at A + column·d/dx + row·d/dy,
         |  /\\     |         columns and rows counted from A. With the rises r1, r2 along the edges e1 = v1 - v0 and
         | /   \\   |         e2 = v2 - v0, (d/dx, d/dy) solves e1·(d/dx, d/dy) = r1, e2·(d/dx, d/dy) = r2:
         |/_    \\  |
      v2 |  ¯¯--_\\ |             d/dx = (r1·e2.y - r2·e1.y)/area      d/dy = (r2·e1.x - r1·e2.x)/area
         |________\\| v1          area = e1.x·e2.y - e2.x·e1.y, twice the triangle's
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper
from .cull import first_sample
from .transform import DEPTH_BITS, DEPTH_MARGIN, HALF, SUBPIXEL, depths_on_plane

BLOCK = 64  # triangles


def _starts(first, end):
    """Return where the rows first..end of a block begin, for the names below."""
    return [BLOCK * k for k in range(first, end)]


# Rows of int32. The vertices are in 1/256 px, clockwise on the screen, the topmost (then leftmost) first; boxes in
# samples.
X0, Y0, X1, Y1, X2, Y2 = _starts(0, 6)
LEFT, RIGHT, TOP, BOTTOM = _starts(6, 10)  # within picture and band: left..right, top..bottom
# Where planes begin: the first sample of the box, but not beyond the picture's left or upper border.
ANCHOR_X, ANCHOR_Y = _starts(10, 12)
EXTENT_X, EXTENT_Y = _starts(12, 14)  # columns and rows of the whole box
IS_FLIPPED, IS_SLIVER, HAS_PLANES, HAS_INTENSITY = _starts(14, 18)
CORNER0, CORNER1, CORNER2 = _starts(18, 21)  # where the vertices' attributes are
MATERIAL = BLOCK * 21
# What is known of its material, see gradients.py: its cheapest path, how many attributes are read.
PATH, N_OWN = BLOCK * 22, BLOCK * 23
IS_WEIGHTED = BLOCK * 24  # planes of values are multiplied by 1/r, see compute_value_planes in gradients.py
PIECE = BLOCK * 25  # samples after which a span is cut, see compute_pieces in gradients.py; 0 where it is one piece
N_INT = 26
# Rows of int64: the planes of depth, in z-buffer units, and of intensity steps, see gradients.py: value at the anchor,
# d/dx, d/dy a sample.
PLANE_Z, PLANE_Z_DX, PLANE_Z_DY = _starts(0, 3)
PLANE_INTENSITY, PLANE_INTENSITY_DX, PLANE_INTENSITY_DY = _starts(3, 6)
N_LONG = 6
# Rows of float64: z of the vertices; what a rise along edge 1 or 2 adds to d/dx and d/dy; from vertex 0 to the anchor,
# in samples; z of the triangle's plane where the vertices are rounded to, and how far it is from theirs at most;
# attributes at vertex 0, 1, 2, one after the other; planes of attributes, three rows each, see gradients.py; the error
# that its material accepts. Before there are planes, the vertices stand in their place as they come, 1/256 px.
Z0, Z1, Z2 = _starts(0, 3)
SLOPE_X1, SLOPE_X2, SLOPE_Y1, SLOPE_Y2 = _starts(3, 7)
OFFSET_X, OFFSET_Y = _starts(7, 9)
OWN_Z0, OWN_Z1, OWN_Z2, PLANE_SHIFT = _starts(9, 13)
ATTRIBUTE, MAX_ATTRIBUTES = BLOCK * 13, 13
PLANE_ATTRIBUTE, MAX_ATTRIBUTE_PLANES = BLOCK * (13 + 3 * MAX_ATTRIBUTES), 10
TRUE_XA, TRUE_YA, TRUE_XB, TRUE_YB, TRUE_XC, TRUE_YC = _starts(13 + 3 * MAX_ATTRIBUTES, 19 + 3 * MAX_ATTRIBUTES)
LIMIT = BLOCK * (13 + 3 * MAX_ATTRIBUTES + 3 * MAX_ATTRIBUTE_PLANES)
# Of spans in pieces: the planes of (intensity step - MIDDLE)/w and 1/w, value at the anchor, d/dx, d/dy each; MIDDLE,
# and how far from it ends of pieces may be.
PLANE_OVER_W, PLANE_INV_W, MIDDLE, HALF_RANGE = (
    BLOCK * (14 + 3 * MAX_ATTRIBUTES + 3 * MAX_ATTRIBUTE_PLANES + rows) for rows in (0, 3, 6, 7)
)
N_REAL = 22 + 3 * MAX_ATTRIBUTES + 3 * MAX_ATTRIBUTE_PLANES
NEXT = BLOCK  # from row to row
NEXT_PLANE = 3 * BLOCK  # from one plane, or attribute at the three vertices, to the next
# Planes of attributes are good while E = box area / triangle area (twice the triangle's) stays below this: float64
# rounds a rise D over an edge to 38·2^-53·E·D (the same sum as below), a 2^-28 of it, less than float32 rounds it to.
MAX_ELONGATION = 2.0**20
# A plane of depth is good while E·R stays below this, R the larger rise of z along the two edges. Then float64 rounds
# it by less than 39 units beside the rounding to whole units. With u = 2^-53, W and H the sides of the box, and
# T = |r1·e2.y| + |r2·e1.y| over the area for d/dx, likewise for d/dy:
#
#     d/dx, d/dy       6 u T: area, its inverse, products with edge and rise, the rise itself, their sum; times the way
#                      from v0 to a sample, which is no longer than W and H: the value at the anchor errs with them
#     value at A       products with the way to the anchor, and sums: 3 u T W + 2 u T H + 2 u |z0|
#     together         9 u (T W + T H) + 2 u |z0| <= 38 u E·R, and 2^-14: no edge is longer than the box, so T W and T H
#                      are at most 2 E·R each; |z0| <= R + 2^38 and E >= 1
#
# Other triangles get their depth from exact edge functions, as slivers.
MAX_LEVERAGE = 2.0**53
# A face is drawn in its own plane, but its corners are rounded to 1/256 px: a sample in it lies up to 1/512 px outside
# the face, along either axis, and the plane leaves the face's range of depths there, by no more than it does at a
# corner. Where that is more than half the room at the ends of the z-buffer, depth is computed at every sample, and kept
# within the z-buffer.
MAX_PLANE_SHIFT = DEPTH_MARGIN / 2
FURTHEST = 2.0**DEPTH_BITS - 2.0  # what lies there is still seen
# Steeper planes of depth would leave 64 bits, a sample: a triangle that reaches far out of the picture may have one.
MAX_SLOPE = 2.0**60


class Block(NamedTuple):
    """The rows of one thread."""

    ints: np.ndarray  # (N_INT * BLOCK,) int32
    longs: np.ndarray  # (N_LONG * BLOCK,) int64
    reals: np.ndarray  # (N_REAL * BLOCK,) float64


def make_block() -> Block:
    """Return room for a block of triangles."""
    return Block(np.zeros(N_INT * BLOCK, np.int32), np.zeros(N_LONG * BLOCK, np.int64), np.zeros(N_REAL * BLOCK))


@helper
def gather_vertices(faces, triangles, vertices, block):
    """Fetch the vertices of up to BLOCK triangles, (n,) uint32, in the order of the file.

    IS_FLIPPED says for now whether the normals look against the winding. Behind the last triangle the block holds what
    was left there, but a material that there is: loops over the whole block look materials up.
    """
    ints, reals = block.ints, block.reals
    x, y, z = vertices.true_x, vertices.true_y, vertices.z
    for k in range(len(faces)):
        face = faces[k]
        a, b, c = triangles.vertex_idx[0, face], triangles.vertex_idx[1, face], triangles.vertex_idx[2, face]
        reals[TRUE_XA + k], reals[TRUE_XB + k], reals[TRUE_XC + k] = x[a], x[b], x[c]
        reals[TRUE_YA + k], reals[TRUE_YB + k], reals[TRUE_YC + k] = y[a], y[b], y[c]
        reals[Z0 + k], reals[Z1 + k], reals[Z2 + k] = z[a], z[b], z[c]
        ints[CORNER0 + k] = triangles.corner_idx[0, face]
        ints[CORNER1 + k] = triangles.corner_idx[1, face]
        ints[CORNER2 + k] = triangles.corner_idx[2, face]
        ints[IS_FLIPPED + k] = triangles.is_inverted[face]
        ints[MATERIAL + k] = triangles.material[face] if len(triangles.material) > 0 else np.uint32(0)
    for k in range(len(faces), BLOCK):
        ints[MATERIAL + k] = 0


@helper
def gather_materials(n, coding, block):
    """Fetch what is known of the first n triangles' materials, so that loops over the block needn't look it up; tell
    whether they have one material: as a rule they do, and then nothing is looked up triangle by triangle."""
    ints, reals = block.ints, block.reals
    first, others = ints[MATERIAL] if len(coding.paths) > 1 else np.int32(0), np.int32(0)
    if len(coding.paths) > 1:
        for k in range(n):
            others |= ints[MATERIAL + k] ^ first
    if others == 0:
        path, n_own, limit = np.int32(coding.paths[first]), np.int32(coding.n_attributes[first]), coding.limits[first]
        for k in range(BLOCK):
            ints[PATH + k], ints[N_OWN + k], reals[LIMIT + k] = path, n_own, limit
        return True
    for k in range(n):
        material = ints[MATERIAL + k]
        ints[PATH + k], ints[N_OWN + k] = coding.paths[material], coding.n_attributes[material]
        reals[LIMIT + k] = coding.limits[material]
    return False


@helper
def order_vertices(pixel, block):
    """Round the vertices and order them, so that the same triangle gives the same planes however the file lists them.

    Completes IS_FLIPPED, and computes the z of the triangles' planes; `pixel` is the PixelWidth of the vertices.
    """
    ints, reals = block.ints, block.reals
    for k in range(BLOCK):
        ta, tb, tc = reals[TRUE_XA + k], reals[TRUE_XB + k], reals[TRUE_XC + k]
        ua, ub, uc = reals[TRUE_YA + k], reals[TRUE_YB + k], reals[TRUE_YC + k]
        xa, xb, xc = rounded(ta), rounded(tb), rounded(tc)
        ya, yb, yc = rounded(ua), rounded(ub), rounded(uc)
        is_front = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya) < 0  # counter-clockwise as loaded
        key_a, key_b, key_c = (ya << 32) + xa, (yb << 32) + xb, (yc << 32) + xc
        is_c_first = key_c < min(key_a, key_b)
        is_b_first = (key_b < key_a) & (not is_c_first)
        ints[IS_FLIPPED + k] = is_front == (ints[IS_FLIPPED + k] != 0)
        true_x = rotate_to_first(ta, tb, tc, is_b_first, is_c_first, is_front)
        true_y = rotate_to_first(ua, ub, uc, is_b_first, is_c_first, is_front)
        x = np.rint(true_x[0]), np.rint(true_x[1]), np.rint(true_x[2])
        y = np.rint(true_y[0]), np.rint(true_y[1]), np.rint(true_y[2])
        ints[X0 + k], ints[X1 + k], ints[X2 + k] = np.int32(x[0]), np.int32(x[1]), np.int32(x[2])
        ints[Y0 + k], ints[Y1 + k], ints[Y2 + k] = np.int32(y[0]), np.int32(y[1]), np.int32(y[2])
        za, zb, zc = reals[Z0 + k], reals[Z1 + k], reals[Z2 + k]
        z = rotate_to_first(za, zb, zc, is_b_first, is_c_first, is_front)
        own_z, reals[PLANE_SHIFT + k] = depths_on_plane(true_x, true_y, x, y, z, pixel)
        reals[Z0 + k], reals[Z1 + k], reals[Z2 + k] = z
        reals[OWN_Z0 + k], reals[OWN_Z1 + k], reals[OWN_Z2 + k] = own_z
        ca, cb, cc = ints[CORNER0 + k], ints[CORNER1 + k], ints[CORNER2 + k]
        ints[CORNER0 + k], ints[CORNER1 + k], ints[CORNER2 + k] = rotate_to_first(
            ca, cb, cc, is_b_first, is_c_first, is_front
        )


@helper
def rounded(coordinate):
    """Round a coordinate of a vertex to 1/256 px as `transform` does, int64."""
    return np.int64(np.int32(np.rint(coordinate)))


@helper
def rotate_to_first(a, b, c, is_b_first, is_c_first, is_front):
    """Rotate what a triangle has at its vertices until the first vertex is first; then clockwise on the screen."""
    first = c if is_c_first else (b if is_b_first else a)
    after = a if is_c_first else (c if is_b_first else b)
    before = b if is_c_first else (a if is_b_first else c)
    return first, before if is_front else after, after if is_front else before


@helper
def gather_attributes(n, n_attribute, drawables, reads_double, block):
    """Fetch the first `n_attribute` attributes of the vertices of the first n triangles.

    Side 0 of the attributes is for triangles whose normals look at the viewer as they are, the last side for those
    whose normals are flipped.

    Parameters
    ----------
    reads_double : (n_material,) bool, whose attributes are not rounded to float32
    """
    if n_attribute == 0:
        return
    for k in range(n):
        gather_corners(k, n_attribute, drawables.attributes, reads_double[block.ints[MATERIAL + k]], block)


@helper
def gather_corners(k, n_attribute, attributes, is_double, block):
    """Fetch the first attributes, as many as there are, of the vertices of triangle k, in float32 or float64."""
    ints, reals = block.ints, block.reals
    side = attributes.shape[0] - 1 if ints[IS_FLIPPED + k] else 0
    c0, c1, c2 = np.uint32(ints[CORNER0 + k]), np.uint32(ints[CORNER1 + k]), np.uint32(ints[CORNER2 + k])
    row = ATTRIBUTE + k
    for column in range(min(n_attribute, attributes.shape[2])):
        a, b, c = attributes[side, c0, column], attributes[side, c1, column], attributes[side, c2, column]
        reals[row] = a if is_double else np.float32(a)
        reals[row + NEXT] = b if is_double else np.float32(b)
        reals[row + NEXT + NEXT] = c if is_double else np.float32(c)
        row += NEXT_PLANE


@helper
def compute_boxes(rows, width, block):
    """Compute the boxes of the triangles.

    Clipped at the picture's left and upper border for the anchor: from an anchor far outside, the rounding of a plane's
    steps would add up before the picture is reached. Clipped to the band for the loops over samples.

    Parameters
    ----------
    rows : Band or Rows: y_start..y_end is drawn
    width : of the picture, samples
    """
    ints = block.ints
    for k in range(BLOCK):
        x0, x1, x2 = ints[X0 + k], ints[X1 + k], ints[X2 + k]
        y0, y1, y2 = ints[Y0 + k], ints[Y1 + k], ints[Y2 + k]
        first_x, first_y = first_sample(min(x0, x1, x2)), first_sample(y0)
        end_x, end_y = first_sample(max(x0, x1, x2)), first_sample(max(y1, y2))
        ints[ANCHOR_X + k], ints[ANCHOR_Y + k] = max(first_x, 0), max(first_y, 0)
        ints[EXTENT_X + k], ints[EXTENT_Y + k] = end_x - first_x, end_y - first_y
        ints[LEFT + k], ints[RIGHT + k] = max(first_x, 0), min(end_x, width)
        ints[TOP + k], ints[BOTTOM + k] = max(first_y, rows.y_start), min(end_y, rows.y_end)


@helper
def compute_depth_planes(block):
    """Compute the slopes of planes over the triangles, and the planes of depth; HAS_PLANES begins here.

    Slivers are the triangles that are too long and thin for a plane, also for what their depth rises by, and those
    whose depth is too steep for one.
    """
    ints, longs, reals = block.ints, block.longs, block.reals
    for k in range(BLOCK):
        x0, x1, x2 = np.int64(ints[X0 + k]), np.int64(ints[X1 + k]), np.int64(ints[X2 + k])
        y0, y1, y2 = np.int64(ints[Y0 + k]), np.int64(ints[Y1 + k]), np.int64(ints[Y2 + k])
        dx1, dy1, dx2, dy2 = x1 - x0, y1 - y0, x2 - x0, y2 - y0
        area = np.float64(dx1 * dy2 - dx2 * dy1)  # rounded once: the difference is an exact integer
        wide, high = float(max(x0, x1, x2) - min(x0, x1, x2)), float(max(y1, y2) - y0)
        z0, z1, z2 = reals[OWN_Z0 + k], reals[OWN_Z1 + k], reals[OWN_Z2 + k]
        rise1, rise2 = z1 - z0, z2 - z0
        leverage = wide * high * max(abs(rise1), abs(rise2))
        is_sliver = (wide * high > MAX_ELONGATION * area) | (leverage > MAX_LEVERAGE * area)
        # The columns of the inverse of the edges' matrix.
        scale = 0.0 if is_sliver else SUBPIXEL / area
        slope_x1, slope_x2 = float(dy2) * scale, -float(dy1) * scale
        slope_y1, slope_y2 = -float(dx2) * scale, float(dx1) * scale
        offset_x = float(ints[ANCHOR_X + k] * SUBPIXEL + HALF - x0) / SUBPIXEL
        offset_y = float(ints[ANCHOR_Y + k] * SUBPIXEL + HALF - y0) / SUBPIXEL
        dx, dy = rise1 * slope_x1 + rise2 * slope_x2, rise1 * slope_y1 + rise2 * slope_y2
        is_steep = (abs(dx) + abs(dy) > MAX_SLOPE) | (reals[PLANE_SHIFT + k] > MAX_PLANE_SHIFT)
        dx, dy = 0.0 if is_steep else dx, 0.0 if is_steep else dy
        ints[IS_SLIVER + k] = is_sliver | is_steep
        ints[HAS_PLANES + k] = not (is_sliver | is_steep)
        reals[SLOPE_X1 + k], reals[SLOPE_X2 + k] = slope_x1, slope_x2
        reals[SLOPE_Y1 + k], reals[SLOPE_Y2 + k] = slope_y1, slope_y2
        reals[OFFSET_X + k], reals[OFFSET_Y + k] = offset_x, offset_y
        longs[PLANE_Z + k] = np.int64(np.rint(z0 + dx * offset_x + dy * offset_y))
        longs[PLANE_Z_DX + k], longs[PLANE_Z_DY + k] = np.int64(np.rint(dx)), np.int64(np.rint(dy))


# ---------------------------------------------------------------- planes of what stands at the vertices

# Letters: w distance along the viewing axis, r = w_0/w the same inverted, with w_0 the nearest one that is seen. An
# index 0, 1, 2 is a vertex, x and y are slopes.

# How far a plane of depth may be off, z-buffer units, beside half a unit a step: half a unit at the anchor, and less
# than 39 of float64, see MAX_LEVERAGE.
DEPTH_PLANE_ROUNDING = 40.0
# Where r is less, its inverse is no number that float32 is at home with.
MIN_INVERSE = 2.0**-40
SINGLE = 2.0**-24  # the unit roundoff of float32


class DepthScale(NamedTuple):
    """What the z of a packed sample says, z-buffer units."""

    inv_w_offset: float  # 1/w = inv_w_offset + inv_w_scale · z; 1 + 0 z without perspective
    inv_w_scale: float
    depth_offset: float  # orthographic depth = depth_offset + depth_scale · z, scene units; 0 + 0 z in perspective
    depth_scale: float
    ratio_offset: float  # r = ratio_offset + ratio_scale · z; 1 + 0 z without perspective
    ratio_scale: float
    is_perspective: bool


@helper
def depth_at_corner(z, own_z, depths):
    """Return what an exact setup holds for the depth at a corner: that of the triangle's plane, or in perspective its
    1/w over that of the corner.

    Parameters
    ----------
    z, own_z : of the corner, and of the plane where it is rounded to
    depths : DepthScale
    """
    offset, step = depths.inv_w_offset, depths.inv_w_scale
    own = (offset + step * own_z) / (offset + step * z)
    return own if depths.is_perspective else depths.depth_offset + depths.depth_scale * own_z


@helper
def linear_in_z(k, offset, scale, block, first=Z0):
    """Compute offset + scale·z at the vertices of triangle k: 1/w, the depth or r, by the numbers of DepthScale; with
    OWN_Z0 for `first` those of its plane."""
    z0, z1, z2 = block.reals[first + k], block.reals[first + NEXT + k], block.reals[first + NEXT + NEXT + k]
    return offset + scale * z0, offset + scale * z1, offset + scale * z2


@helper
def values_at(row, block):
    """Return an attribute of a triangle at the three vertices."""
    return block.reals[row], block.reals[row + NEXT], block.reals[row + NEXT + NEXT]


@helper
def compute_plane(k, plane, a0, a1, a2, block):
    """Compute the plane of an attribute through the values at the vertices of triangle k; return how much it rises over
    the whole box."""
    return compute_plane_at(PLANE_ATTRIBUTE + plane * NEXT_PLANE + k, k, a0, a1, a2, block)


@helper
def compute_plane_at(out, k, a0, a1, a2, block):
    """See `compute_plane`; the plane is written to three rows, from that of `out` on."""
    ints, reals = block.ints, block.reals
    rise1, rise2 = a1 - a0, a2 - a0
    dx = rise1 * reals[SLOPE_X1 + k] + rise2 * reals[SLOPE_X2 + k]
    dy = rise1 * reals[SLOPE_Y1 + k] + rise2 * reals[SLOPE_Y2 + k]
    reals[out] = a0 + dx * reals[OFFSET_X + k] + dy * reals[OFFSET_Y + k]
    reals[out + NEXT], reals[out + NEXT + NEXT] = dx, dy
    return abs(dx) * float(ints[EXTENT_X + k] + 1) + abs(dy) * float(ints[EXTENT_Y + k] + 1)


@helper
def depth_rounding(k, block):
    """Return how far the depth of a sample of triangle k may be off, in z-buffer units: see MAX_LEVERAGE."""
    return 0.5 * float(block.ints[EXTENT_X + k] + block.ints[EXTENT_Y + k]) + DEPTH_PLANE_ROUNDING


# ---------------------------------------------------------------- weights of the corners at a sample, without planes

# With the edge functions e_i of a sample, q_i = e_i/w_i, an attribute is Σ q_i·a_i/Σ q_i (Blinn 1992, "Hyperbolic
# interpolation").


class ExactTriangle(NamedTuple):
    """What the weights q_i of a triangle's three corners are computed from."""

    x0: int  # the first vertex and the two edges that leave it, 1/256 px
    y0: int
    dx1: int
    dy1: int
    dx2: int
    dy2: int
    inv_w: tuple  # at the three vertices
    area: float  # Σ e_i: 1/w = Σ q_i / area


@helper
def corner_weights(triangle, x, y):
    """Return the perspective weights q_i of the three corners at the sample in column x of row y; not normalised.

    The edge functions e_i are integers below 2^60: nothing is lost however long and thin the triangle is.
    """
    sx, sy = x * SUBPIXEL + HALF, y * SUBPIXEL + HALF
    ux, uy = sx - triangle.x0, sy - triangle.y0
    e1 = ux * triangle.dy2 - uy * triangle.dx2
    e2 = uy * triangle.dx1 - ux * triangle.dy1
    e0 = (triangle.dx1 * triangle.dy2 - triangle.dx2 * triangle.dy1) - e1 - e2
    return float(e0) * triangle.inv_w[0], float(e1) * triangle.inv_w[1], float(e2) * triangle.inv_w[2]


@helper
def inverse_sum(q):
    """Return 1 / Σ q_i."""
    return 1.0 / (q[0] + q[1] + q[2])
