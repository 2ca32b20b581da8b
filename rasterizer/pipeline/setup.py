"""A block of triangles, and the planes of depth over them: the first half of the scan stage.

The scan stage takes its triangles BLOCK at a time. What is to be known of them stands in rows, one quantity a row and
one triangle a column, so that the arithmetic runs through all of them in vector instructions: done one by one, small
triangles would take as long to set up as to fill. A block that isn't full is worked on to its end all the same:
constant loops are shorter. All rows of a type stand one behind the other in one flat array, `reals[Z0 + k]`: with
offsets that are known when it is compiled, the compiler sees that rows don't overlap.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import borrow, helper
from .cull import first_sample
from .transform import DEPTH_MARGIN, HALF, SUBPIXEL

BLOCK = 64

# Rows of int32. The vertices are in 1/256 px, clockwise on the screen, the topmost (then leftmost) first; boxes in
# samples.
X0, Y0, X1, Y1, X2, Y2 = (np.uint64(BLOCK * k) for k in range(6))
LEFT, RIGHT, TOP, BOTTOM = (np.uint64(BLOCK * k) for k in range(6, 10))  # clipped: left..right, top..bottom
# Where planes begin: the first sample of the box, but not beyond the picture's left or upper border.
ANCHOR_X, ANCHOR_Y = (np.uint64(BLOCK * k) for k in range(10, 12))
STEPS_X, STEPS_Y = (np.uint64(BLOCK * k) for k in range(12, 14))  # its extent
IS_FLIPPED, IS_SLIVER, IS_GOOD = (np.uint64(BLOCK * k) for k in range(14, 17))
CORNER0, CORNER1, CORNER2 = (np.uint64(BLOCK * k) for k in range(17, 20))  # where the vertices' attributes are
CUT = np.uint64(BLOCK * 20)  # the row of the planes of the face that it is a part of; -1 for a whole face
N_INT = 21
# Rows of int64: the plane of depth in z-buffer units (value at the anchor, d/dx, d/dy a sample); those of levels, see
# records.py.
DEPTH, DEPTH_X, DEPTH_Y = (np.uint64(BLOCK * k) for k in range(3))
LEVEL = np.uint64(BLOCK * 3)
N_LONG = 3 + 9
# Rows of float64: depths; what a rise along edge 1 or 2 adds to d/dx and d/dy; from vertex 0 to the anchor, in samples;
# the range of depths that a part of a clipped face may have; attributes at vertex 0, 1, 2, one after the other; planes
# of attributes, see records.py.
Z0, Z1, Z2 = (np.uint64(BLOCK * k) for k in range(3))
SLOPE_X1, SLOPE_X2, SLOPE_Y1, SLOPE_Y2 = (np.uint64(BLOCK * k) for k in range(3, 7))
OFFSET_X, OFFSET_Y = (np.uint64(BLOCK * k) for k in range(7, 9))
LEAST_Z, LARGEST_Z = (np.uint64(BLOCK * k) for k in range(9, 11))
ATTRIBUTE0, MOST_ATTRIBUTES = np.uint64(BLOCK * 11), 11
PLANE0, MOST_PLANES = np.uint64(BLOCK * (11 + 3 * MOST_ATTRIBUTES)), 7
DISTANCE_PLANE = MOST_PLANES - 1
N_REAL = 11 + 3 * MOST_ATTRIBUTES + 3 * MOST_PLANES
NEXT = np.uint64(BLOCK)

# Planes are good while box area / triangle area stays below this: a coefficient is at most 2^DEPTH_BITS · 2^20 < 2^63
# and its float64 rounding error at most 2^(38 + 20 - 53) units a box, a 2^33rd of the depth range. Slivers beyond are
# done exactly.
MAX_ELONGATION = 2.0**20
# A part of a clipped face has the plane of the whole face, but its corners are rounded to 1/256 px: a sample in it lies
# up to 1/512 px outside the face, along either axis, and the plane leaves the face's range of depths by up to its slope
# over 512 there. Where that is more than half the room at the ends of the z-buffer, depth is found at every sample, and
# kept within the range.
MAX_CUT_SLOPE = DEPTH_MARGIN / 2 * (2 * SUBPIXEL)
MAX_SLOPE = (
    2.0**60
)  # of depth, a sample: steeper ones would leave 64 bits; a triangle that reaches far out of the picture may


class Block(NamedTuple):
    """The rows of one thread."""

    ints: np.ndarray  # (N_INT * BLOCK,) int32
    longs: np.ndarray  # (N_LONG * BLOCK,) int64
    reals: np.ndarray  # (N_REAL * BLOCK,) float64


def make_block() -> Block:
    """Room for a block of triangles."""
    return Block(np.zeros(N_INT * BLOCK, np.int32), np.zeros(N_LONG * BLOCK, np.int64), np.zeros(N_REAL * BLOCK))


class Polygons(NamedTuple):
    """The triangles: which vertices they join, and where their attributes are (a row a corner)."""

    vertex: np.ndarray  # (3, n) uint32, into the vertices
    corner: np.ndarray  # (3, n) uint32, into the attributes
    is_inverted: np.ndarray  # (n,) uint8: 1 where the shading normals look against the winding
    cut: np.ndarray = np.empty(0, np.int32)  # (n,) int32, see clip.Clipped; empty where no face was clipped
    ends: np.ndarray = np.empty((0, 2))  # (n_cut, 2) float64, as there


@helper
def borrow_polygons(polygons):
    """The triangles as arrays that count no references."""
    return Polygons(
        borrow(polygons.vertex), borrow(polygons.corner), borrow(polygons.is_inverted), borrow(polygons.cut),
        borrow(polygons.ends),
    )  # fmt: skip


@helper
def gather_vertices(faces, polygons, vertices, block):
    """Fetch the triangles' vertices in the order of the file; IS_FLIPPED says for now if the normals look against the
    winding."""
    ints, reals = block.ints, block.reals
    x, y, z = vertices.x, vertices.y, vertices.z
    for k in range(np.uint64(len(faces))):
        face = faces[k]
        a, b, c = polygons.vertex[0, face], polygons.vertex[1, face], polygons.vertex[2, face]
        ints[X0 + k], ints[X1 + k], ints[X2 + k] = x[a], x[b], x[c]
        ints[Y0 + k], ints[Y1 + k], ints[Y2 + k] = y[a], y[b], y[c]
        reals[Z0 + k], reals[Z1 + k], reals[Z2 + k] = z[a], z[b], z[c]
        ints[CORNER0 + k] = polygons.corner[0, face]
        ints[CORNER1 + k] = polygons.corner[1, face]
        ints[CORNER2 + k] = polygons.corner[2, face]
        ints[IS_FLIPPED + k] = polygons.is_inverted[face]
        cut = polygons.cut[face] if len(polygons.cut) > 0 else np.int32(-1)
        ints[CUT + k] = cut
        if cut >= 0:
            reals[LEAST_Z + k], reals[LARGEST_Z + k] = (
                polygons.ends[np.uint64(cut), 0],
                polygons.ends[np.uint64(cut), 1],
            )
        else:
            reals[LEAST_Z + k], reals[LARGEST_Z + k] = -np.inf, np.inf


@helper
def order_vertices(block):
    """Order the vertices, so that the same triangle gives the same planes however the file lists them; complete
    IS_FLIPPED."""
    ints, reals = block.ints, block.reals
    for k in range(np.uint64(BLOCK)):
        xa, xb, xc = np.int64(ints[X0 + k]), np.int64(ints[X1 + k]), np.int64(ints[X2 + k])
        ya, yb, yc = np.int64(ints[Y0 + k]), np.int64(ints[Y1 + k]), np.int64(ints[Y2 + k])
        is_front = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya) < 0  # counter-clockwise as loaded
        key_a, key_b, key_c = (ya << 32) + xa, (yb << 32) + xb, (yc << 32) + xc
        is_c_first = key_c < min(key_a, key_b)
        is_b_first = (key_b < key_a) & (not is_c_first)
        ints[IS_FLIPPED + k] = is_front == (ints[IS_FLIPPED + k] != 0)
        ints[X0 + k], ints[X1 + k], ints[X2 + k] = turn(xa, xb, xc, is_b_first, is_c_first, is_front)
        ints[Y0 + k], ints[Y1 + k], ints[Y2 + k] = turn(ya, yb, yc, is_b_first, is_c_first, is_front)
        za, zb, zc = reals[Z0 + k], reals[Z1 + k], reals[Z2 + k]
        reals[Z0 + k], reals[Z1 + k], reals[Z2 + k] = turn(za, zb, zc, is_b_first, is_c_first, is_front)
        ca, cb, cc = ints[CORNER0 + k], ints[CORNER1 + k], ints[CORNER2 + k]
        # A part's attributes are those of its face, in the order of the planes.
        is_whole = ints[CUT + k] < 0
        ints[CORNER0 + k], ints[CORNER1 + k], ints[CORNER2 + k] = turn(
            ca, cb, cc, is_b_first & is_whole, is_c_first & is_whole, is_front & is_whole
        )


@helper
def turn(a, b, c, is_b_first, is_c_first, is_front):
    """Three values of a triangle's vertices, turned until the first vertex is first, and clockwise on the screen."""
    first = c if is_c_first else (b if is_b_first else a)
    after = a if is_c_first else (c if is_b_first else b)
    before = b if is_c_first else (a if is_b_first else c)
    return first, before if is_front else after, after if is_front else before


@helper
def gather_attributes(n, attributes, block):
    """Fetch the attributes of the triangles' vertices.

    Side 0 is for triangles whose normals look at the viewer as they are, the last side for those whose normals are
    flipped.
    """
    ints, reals = block.ints, block.reals
    last_side = np.uint64(attributes.shape[0] - 1)
    for k in range(np.uint64(n)):
        side = last_side if ints[IS_FLIPPED + k] else np.uint64(0)
        c0, c1, c2 = np.uint32(ints[CORNER0 + k]), np.uint32(ints[CORNER1 + k]), np.uint32(ints[CORNER2 + k])
        row = ATTRIBUTE0 + k
        for column in range(np.uint64(attributes.shape[2])):
            reals[row] = attributes[side, c0, column]
            reals[row + NEXT] = attributes[side, c1, column]
            reals[row + NEXT + NEXT] = attributes[side, c2, column]
            row += NEXT + NEXT + NEXT


@helper
def set_up_boxes(y_start, y_stop, width, block):
    """Find the boxes of the triangles: clipped at the picture's left and upper border for the anchor, to the band for
    the loops.

    From an anchor far outside, the rounding of a plane's steps would add up before the picture is reached.
    """
    ints = block.ints
    for k in range(np.uint64(BLOCK)):
        x0, x1, x2 = ints[X0 + k], ints[X1 + k], ints[X2 + k]
        y0, y1, y2 = ints[Y0 + k], ints[Y1 + k], ints[Y2 + k]
        anchor_x, anchor_y = first_sample(min(x0, x1, x2)), first_sample(y0)
        end_x, end_y = first_sample(max(x0, x1, x2)), first_sample(max(y1, y2))
        ints[ANCHOR_X + k], ints[ANCHOR_Y + k] = max(anchor_x, 0), max(anchor_y, 0)
        ints[STEPS_X + k], ints[STEPS_Y + k] = end_x - anchor_x, end_y - anchor_y
        ints[LEFT + k], ints[RIGHT + k] = max(anchor_x, 0), min(end_x, width)
        ints[TOP + k], ints[BOTTOM + k] = max(anchor_y, y_start), min(end_y, y_stop)


@helper
def set_up_depths(block):
    """Find the slopes of planes over the triangles, and the planes of depth."""
    ints, longs, reals = block.ints, block.longs, block.reals
    for k in range(np.uint64(BLOCK)):
        x0, x1, x2 = np.int64(ints[X0 + k]), np.int64(ints[X1 + k]), np.int64(ints[X2 + k])
        y0, y1, y2 = np.int64(ints[Y0 + k]), np.int64(ints[Y1 + k]), np.int64(ints[Y2 + k])
        dx1, dy1, dx2, dy2 = x1 - x0, y1 - y0, x2 - x0, y2 - y0
        area = float(dx1 * dy2 - dx2 * dy1)  # rounded once: the difference is an exact integer
        wide, high = float(max(x0, x1, x2) - min(x0, x1, x2)), float(max(y1, y2) - y0)
        is_sliver = wide * high > MAX_ELONGATION * area
        # The columns of the inverse of the edges' matrix.
        scale = 0.0 if is_sliver else SUBPIXEL / area
        slope_x1, slope_x2 = float(dy2) * scale, -float(dy1) * scale
        slope_y1, slope_y2 = -float(dx2) * scale, float(dx1) * scale
        offset_x = float(ints[ANCHOR_X + k] * SUBPIXEL + HALF - x0) / SUBPIXEL
        offset_y = float(ints[ANCHOR_Y + k] * SUBPIXEL + HALF - y0) / SUBPIXEL
        rise1, rise2 = reals[Z1 + k] - reals[Z0 + k], reals[Z2 + k] - reals[Z0 + k]
        z_x, z_y = rise1 * slope_x1 + rise2 * slope_x2, rise1 * slope_y1 + rise2 * slope_y2
        is_steep = abs(z_x) + abs(z_y) > (MAX_SLOPE if ints[CUT + k] < 0 else MAX_CUT_SLOPE)
        z_x, z_y = 0.0 if is_steep else z_x, 0.0 if is_steep else z_y
        ints[IS_SLIVER + k] = is_sliver | is_steep
        ints[IS_GOOD + k] = not (is_sliver | is_steep | (ints[CUT + k] >= 0))
        reals[SLOPE_X1 + k], reals[SLOPE_X2 + k] = slope_x1, slope_x2
        reals[SLOPE_Y1 + k], reals[SLOPE_Y2 + k] = slope_y1, slope_y2
        reals[OFFSET_X + k], reals[OFFSET_Y + k] = offset_x, offset_y
        longs[DEPTH + k] = np.int64(np.rint(reals[Z0 + k] + z_x * offset_x + z_y * offset_y))
        longs[DEPTH_X + k], longs[DEPTH_Y + k] = np.int64(np.rint(z_x)), np.int64(np.rint(z_y))
