"""Small triangles: which samples of a small box are covered, found for many triangles side by side.

In dense meshes most triangles hold a sample or two in their box, and many cover none. Up to MOST_WIDE x MOST_WIDE
samples are tested with the edge functions of the scan stage, in int32, all in vector instructions: the cull stage drops
triangles that cover none before anything else is computed for them, and the scan stage visits the covered samples one
by one. A row of lanes, read and written as a whole, would have to wait for the neighbour's, written just before.

    + . . +    The window begins with the first sample of the box in the picture, and has all others. What is covered
    |\\    |    lies in the half-open box that `first_sample` makes of the corners. For let m be the greatest x of the
    | '\\. |    corners: a sample right of m is outside. One at m is inside only on a vertex or an edge there. An edge
    +----'+    along m has the triangle on its left, so it is no left edge; every other edge that reaches m ends there,
               and of the two that meet, one has the triangle on its left. The same holds for the greatest y.
"""

import numpy as np

from ..compiler.kernels import helper, index
from .transform import HALF, SUBPIXEL
from .visibility import DEPTH_MASK

MOST_WIDE = 3  # columns and rows of samples of a small box; 4 gains nothing: larger triangles hold many samples
NEXT_ROW = 4  # bits from row to row of a set of covered samples: bit x + NEXT_ROW·y


@helper
def is_any_covered(triangle, side, left, top):
    """Tell whether a triangle with a small box covers any sample of the window.

    Parameters
    ----------
    triangle : (x0, y0, x1, y1, x2, y2) int32, 1/256 px; where the box is not small, the result is of no use
    side : int32, 1 where it is clockwise on the screen, -1 where it isn't
    left, top : int32, column and row of the window's first sample
    """
    (e0, e1, e2), (dx0, dx1, dx2), (dy0, dy1, dy2) = edge_functions(triangle, side, left, top)
    outside = np.int32(-1)  # its sign is set while no sample is inside of all edges
    for _ in range(MOST_WIDE):
        at0, at1, at2 = e0, e1, e2
        for _ in range(MOST_WIDE):
            outside = np.int32(outside & np.int32(np.int32(at0 | at1) | at2))
            at0, at1, at2 = np.int32(at0 + dx0), np.int32(at1 + dx1), np.int32(at2 + dx2)
        e0, e1, e2 = np.int32(e0 + dy0), np.int32(e1 + dy1), np.int32(e2 + dy2)
    return outside >= 0


@helper
def find_covered(triangle, left, top, right, bottom):
    """Return the set of samples of the window that a clockwise triangle with a small box covers, int32.

    Parameters
    ----------
    triangle : (x0, y0, x1, y1, x2, y2) int32, 1/256 px; where the box is not small, the result is of no use
    left, top, right, bottom : int32, the columns and rows that are drawn, half-open, of which the window is the first
    """
    (e0, e1, e2), (dx0, dx1, dx2), (dy0, dy1, dy2) = edge_functions(triangle, np.int32(1), left, top)
    covered = np.int32(0)
    for y in range(MOST_WIDE):
        at0, at1, at2 = e0, e1, e2
        for x in range(MOST_WIDE):
            is_inside = (np.int32(np.int32(at0 | at1) | at2) >= 0) & (left + x < right) & (top + y < bottom)
            covered = np.int32(covered | (np.int32(1 << (x + NEXT_ROW * y)) if is_inside else np.int32(0)))
            at0, at1, at2 = np.int32(at0 + dx0), np.int32(at1 + dx1), np.int32(at2 + dx2)
        e0, e1, e2 = np.int32(e0 + dy0), np.int32(e1 + dy1), np.int32(e2 + dy2)
    return covered


@helper
def edge_functions(triangle, side, left, top):
    """Evaluate the three edge functions of a triangle at a sample: values, and steps to the right and down; int32.

    The corners of a small box lie within MOST_WIDE + 1 px of every sample in it. So products of two lengths are below
    2^21, and nothing wraps.
    """
    x0, y0, x1, y1, x2, y2 = triangle
    sx, sy = np.int32(left * SUBPIXEL + HALF), np.int32(top * SUBPIXEL + HALF)
    e0, dx0, dy0 = edge_function(x0, y0, x1, y1, side, sx, sy)
    e1, dx1, dy1 = edge_function(x1, y1, x2, y2, side, sx, sy)
    e2, dx2, dy2 = edge_function(x2, y2, x0, y0, side, sx, sy)
    return (e0, e1, e2), (dx0, dx1, dx2), (dy0, dy1, dy2)


@helper
def edge_function(xa, ya, xb, yb, side, sx, sy):
    """Evaluate the edge function of an edge at a sample, with its steps a sample, as scan.edge_function does; int32.

    The edge of a triangle that isn't clockwise is reversed: its value, steps and direction change their signs.
    """
    dx, dy = np.int32(side * np.int32(xb - xa)), np.int32(side * np.int32(yb - ya))
    is_top_left = (dy < 0) | ((dy == 0) & (dx > 0))
    value = np.int32(dx * np.int32(sy - ya) - dy * np.int32(sx - xa) - (0 if is_top_left else 1))
    return value, np.int32(dy * -SUBPIXEL), np.int32(dx * SUBPIXEL)


@helper
def fill_covered(entries, first, pitch, covered, plane):
    """Merge the covered samples of a window into a visibility buffer; at equal depth the earlier entry stays.

    Parameters
    ----------
    entries : (n,) int64, the visibility buffer, changed
    first, pitch : int64, the window's first entry in it, and entries from row to row
    covered : int32, the set of covered samples
    plane : (value at the window's first sample, d/dx, d/dy) uint64, what is merged; it wraps
    """
    value, dx, dy = plane
    rest = np.int64(covered)
    while rest != 0:
        lowest = rest & -rest
        bit = (np.float64(lowest).view(np.int64) >> 52) - 1023  # the exponent
        x, y = bit & (NEXT_ROW - 1), bit // NEXT_ROW
        entry_idx = index(first + x + y * pitch)
        new, old = np.int64(value + index(x) * dx + index(y) * dy), entries[entry_idx]
        entries[entry_idx] = new if new < (old & DEPTH_MASK) else old
        rest ^= lowest
