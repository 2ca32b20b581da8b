"""Stage 5, scan: the triangles of one band into its z-buffer.

In:  the band's list of triangles, in face order, and the vertices on the screen.
Out: a word for every sample of the band, and a record for every triangle whose samples are shaded later.

A word packs depth and what is visible there, so that one integer addition advances both along a span, and one
comparison decides visibility and writes both:

    63        62 ............ 25   24     23 ............. 0
    sign (0)  depth (38 bits)      is_id  intensity or record number

A plane is anchored at the first sample of the part of the triangle's box that lies right of and below the picture's
upper left corner, and integer addition is associative: a word is a function of triangle and sample alone, not of band,
span start or thread. Products may overflow 64 bits on the way; arithmetic modulo 2^64 gives the right word all the
same, because the word itself fits.

    top v0                    Clockwise on the screen (y points down): v0 is the topmost vertex, the leftmost of two.
       /\\                     Left chain v0-v2(-v1), right chain v0-v1(-v2). A sample on a left or top edge belongs to
      /  \\_                   the triangle, on a right or bottom edge it doesn't: spans run from the first sample at or
  v2 /_____\\ v1               beyond the left edge to the last one before the right edge.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import borrow, helper, kernel
from .cull import first_sample
from .records import (
    IN_PLANES,
    IN_WORDS,
    IS_EXACT,
    IS_ID,
    PAYLOAD_BITS,
    borrow_records,
    carry_attributes,
    write_exact,
    write_planes,
)
from .setup import (
    ANCHOR_X,
    ANCHOR_Y,
    BLOCK,
    BOTTOM,
    DEPTH,
    DEPTH_X,
    DEPTH_Y,
    IS_GOOD,
    IS_SLIVER,
    LARGEST_Z,
    LEAST_Z,
    LEFT,
    LEVEL,
    NEXT,
    RIGHT,
    STEPS_X,
    STEPS_Y,
    TOP,
    X0,
    X1,
    X2,
    Y0,
    Y1,
    Y2,
    Z0,
    Z1,
    Z2,
    Block,
    borrow_polygons,
    gather_attributes,
    gather_vertices,
    order_vertices,
    set_up_boxes,
    set_up_depths,
)
from .simd import LANES, MOST_HIGH, MOST_WIDE, merge_box
from .transform import DEPTH_BITS, HALF, SUBPIXEL, Vertices

DEPTH_MASK = np.int64(-(1 << PAYLOAD_BITS))
CLEAR = np.int64(((1 << DEPTH_BITS) - 1) << PAYLOAD_BITS)  # nothing here: behind every depth
GROUP_SHIFT = 3  # extents are kept for groups of 8 rows
PADDING = MOST_WIDE  # samples behind each row that lanes may read and write back


class Canvas(NamedTuple):
    """The z-buffer of one band, private to a thread and clean between bands."""

    words: np.ndarray  # (rows * pitch,) int64
    pitch: int
    width: int
    left: np.ndarray  # (groups,) int64: samples left..right of a group of rows may have been written
    right: np.ndarray  # (groups,) int64


@kernel
def scan(faces, polygons, vertices, attributes, coding, y_start, y_stop, block, canvas, records):
    """Draw the triangles `faces` into the rows y_start..y_stop of the picture; return how many records were written,
    and how many of them are exact.

    `attributes` is (side, n, n_attribute): side 0 for triangles whose normals look at the viewer as they are, the last
    side for those whose normals must be flipped.
    """
    faces, attributes, records = borrow(faces), borrow(attributes), borrow_records(records)
    vertices = Vertices(borrow(vertices.x), borrow(vertices.y), borrow(vertices.z))
    polygons = borrow_polygons(polygons)
    canvas = Canvas(borrow(canvas.words), canvas.pitch, canvas.width, borrow(canvas.left), borrow(canvas.right))
    block = Block(borrow(block.ints), borrow(block.longs), borrow(block.reals))
    n_record = n_exact = np.int64(0)
    for first in range(0, len(faces), BLOCK):
        some = faces[np.uint64(first) : np.uint64(min(first + BLOCK, len(faces)))]
        # Half of the work is done for all triangles of the block side by side: planes of depth and attributes.
        gather_vertices(some, polygons, vertices, block)
        order_vertices(block)
        gather_attributes(len(some), attributes, block)
        set_up_boxes(y_start, y_stop, canvas.width, block)
        set_up_depths(block)
        carry_attributes(attributes.shape[2], coding, block)
        # The other half goes triangle by triangle: records, where there are any, and samples.
        for k in range(np.uint64(len(some))):
            left, right = np.int64(block.ints[LEFT + k]), np.int64(block.ints[RIGHT + k])
            top, bottom = np.int64(block.ints[TOP + k]), np.int64(block.ints[BOTTOM + k])
            if left >= right or top >= bottom:
                continue
            is_good = block.ints[IS_GOOD + k] != 0
            payload = (IS_ID + n_record, np.int64(0), np.int64(0))
            if coding.kind == IN_WORDS and is_good:
                payload = (block.longs[LEVEL + k], block.longs[LEVEL + NEXT + k], block.longs[LEVEL + NEXT + NEXT + k])
            elif coding.kind >= IN_PLANES and is_good:
                write_planes(records, n_record, k, some[k], attributes.shape[2], coding, block)
                n_record += 1
            else:
                write_exact(records, n_record, k, some[k], attributes.shape[2], coding, block)
                payload = (payload[0] | IS_EXACT, np.int64(0), np.int64(0))
                n_record += 1
                n_exact += 1
            note_extent(canvas, left, right, top - y_start, bottom - y_start)
            fill(canvas, (left, right, top, bottom, (top - y_start) * canvas.pitch), k, payload, block)
    return n_record, n_exact


@helper
def note_extent(canvas, left, right, first_row, end_row):
    """Note what part of the band is touched."""
    first_group = np.uint64(first_row) >> np.uint64(GROUP_SHIFT)
    last_group = np.uint64(end_row - 1) >> np.uint64(GROUP_SHIFT)
    # The two ends without asking whether they differ: for small triangles that would be a coin toss.
    widen(canvas, first_group, left, right)
    widen(canvas, last_group, left, right)
    for group in range(first_group + np.uint64(1), last_group):
        widen(canvas, group, left, right)


@helper
def widen(canvas, group, left, right):
    """Note that samples left..right of a group of rows may be touched."""
    canvas.left[group] = min(canvas.left[group], left)
    canvas.right[group] = max(canvas.right[group], right)


@helper
def fill(canvas, box, k, payload, block):
    """Fill triangle k of the block: all samples of a small box side by side, else span by span."""
    triangle, plane = triangle_of(k, block), plane_of(k, payload, block)
    is_sliver = block.ints[IS_SLIVER + k] != 0
    if block.ints[STEPS_X + k] <= MOST_WIDE and block.ints[STEPS_Y + k] <= MOST_HIGH and not is_sliver:
        fill_lanes(canvas.words, canvas.pitch, box, triangle, plane)
    else:
        fill_spans(canvas, box, triangle, plane, is_sliver, depths_of(k, block), payload[0], None)


@helper
def triangle_of(k, block):
    """The vertices of triangle k of the block."""
    ints = block.ints
    return (
        np.int64(ints[X0 + k]), np.int64(ints[Y0 + k]), np.int64(ints[X1 + k]), np.int64(ints[Y1 + k]),
        np.int64(ints[X2 + k]), np.int64(ints[Y2 + k]),
    )  # fmt: skip


@helper
def depths_of(k, block):
    """Depths at the vertices of triangle k of the block, and the least and the largest that it may have."""
    reals = block.reals
    return reals[Z0 + k], reals[Z1 + k], reals[Z2 + k], reals[LEAST_Z + k], reals[LARGEST_Z + k]


@helper
def plane_of(k, payload, block):
    """The words of triangle k of the block: at the picture's sample (0, 0), and what one step to the right, or down,
    adds."""
    ints, longs = block.ints, block.longs
    word_x, word_y = pack(longs[DEPTH_X + k], payload[1]), pack(longs[DEPTH_Y + k], payload[2])
    anchor_x, anchor_y = np.uint64(np.int64(ints[ANCHOR_X + k])), np.uint64(np.int64(ints[ANCHOR_Y + k]))
    return pack(longs[DEPTH + k], payload[0]) - anchor_x * word_x - anchor_y * word_y, word_x, word_y


@helper
def pack(depth, payload):
    """Put depth above payload. Unsigned, because products of a plane may overflow on the way: signed overflow is
    undefined."""
    return (np.uint64(np.int64(depth)) << np.uint64(PAYLOAD_BITS)) + np.uint64(payload)


@helper
def fill_lanes(words, pitch, box, triangle, plane):
    """Test every sample of a small box against the three edges, LANES at a time, without a branch."""
    left, right, top, bottom, base = box
    x0, y0, x1, y1, x2, y2 = triangle
    origin, word_x, word_y = plane
    for first in range(left, right, LANES):
        sx, sy = first * SUBPIXEL + HALF, top * SUBPIXEL + HALF
        e0, e0_x, e0_y = edge_function(x0, y0, x1, y1, sx, sy)
        e1, e1_x, e1_y = edge_function(x1, y1, x2, y2, sx, sy)
        e2, e2_x, e2_y = edge_function(x2, y2, x0, y0, sx, sy)
        word = origin + np.uint64(first) * word_x + np.uint64(top) * word_y
        edges = (e0, e0_x, e0_y, e1, e1_x, e1_y, e2, e2_x, e2_y)
        merge_box(
            words, np.uint64(base + first), np.uint64(pitch), bottom - top, (word, word_x, word_y), edges, DEPTH_MASK
        )


@helper
def edge_function(xa, ya, xb, yb, sx, sy):
    """Pineda's edge function (1988) of a clockwise edge at a sample, and its steps a sample; >= 0 means inside.

    A sample on the edge is inside only on a top edge (to the right) or a left one (upwards), so the others are moved by
    one.
    """
    dx, dy = xb - xa, yb - ya
    is_top_left = (dy < 0) | ((dy == 0) & (dx > 0))
    value = dx * (sy - ya) - dy * (sx - xa) - (0 if is_top_left else 1)
    return value, -dy * SUBPIXEL, dx * SUBPIXEL


@helper
def fill_spans(canvas, box, triangle, plane, is_sliver, depths, payload, fragments):
    """Walk the left and the right chain down the rows and fill the samples between them, slivers exactly.

    `fragments` is None, or the lists that take what lies before the canvas, which is then left as it is (a_buffer.py).
    """
    _, _, top, bottom, base = box
    x0, y0, x1, y1, x2, y2 = triangle
    origin, word_x, word_y = plane
    knee = first_sample(min(y1, y2))
    for half in range(2):
        row_start, row_stop = (top, min(bottom, knee)) if half == 0 else (max(top, knee), bottom)
        if row_start >= row_stop:
            continue
        sy = row_start * SUBPIXEL + HALF
        # Below the knee the chain that ended there goes on along the edge v1-v2.
        if half == 1 and y2 < y1:
            x_left, rest_left, dx_left, d_rest_left, run_left = edge_crossing(x2, y2, x1, y1, sy)
        else:
            x_left, rest_left, dx_left, d_rest_left, run_left = edge_crossing(x0, y0, x2, y2, sy)
        if half == 1 and y1 < y2:
            x_right, rest_right, dx_right, d_rest_right, run_right = edge_crossing(x1, y1, x2, y2, sy)
        else:
            x_right, rest_right, dx_right, d_rest_right, run_right = edge_crossing(x0, y0, x1, y1, sy)
        for j in range(row_start, row_stop):
            start, stop = max(x_left, 0), min(x_right, canvas.width)
            if start < stop:
                place = base + (j - top) * canvas.pitch + start
                row = canvas.words[np.uint64(place) : np.uint64(place + stop - start)]
                word = origin + np.uint64(j) * word_y + np.uint64(start) * word_x
                if fragments is None:
                    if is_sliver:
                        fill_span_exactly(row, start, j, triangle, depths, payload)
                    else:
                        fill_span(row, word, word_x)
                else:
                    take_span(row, place, start, j, triangle, depths, payload, is_sliver, word, word_x, fragments)
            rest_left += d_rest_left
            carry = rest_left >= run_left
            rest_left -= run_left if carry else 0
            x_left += dx_left + carry
            rest_right += d_rest_right
            carry = rest_right >= run_right
            rest_right -= run_right if carry else 0
            x_right += dx_right + carry


@helper
def edge_crossing(xa, ya, xb, yb, sy):
    """First sample at or beyond the edge a-b on the row at height `sy`, as an exact digital differential analyser.

    The crossing is at x = xa + (sy - ya)·dx/dy; the sample is ceil((x - 128)/256), a quotient of integers below 2^60.
    Returns (sample, rest, sample step, rest step, divisor): each row adds the steps, and carries one when rest >=
    divisor.
    """
    dx, dy = xb - xa, yb - ya
    divisor = dy * SUBPIXEL
    dividend = (xa - HALF) * dy + (sy - ya) * dx + divisor - 1
    sample = dividend // divisor
    step = dx // dy
    return sample, dividend - sample * divisor, step, (dx - step * dy) * SUBPIXEL, divisor


@helper
def fill_span(row, word, step):
    """Advance depth and intensity by one addition a sample; the nearer word stays, at equal depth the earlier one."""
    for k in range(np.uint64(len(row))):
        new, old = np.int64(word), row[k]
        row[k] = new if new < (old & DEPTH_MASK) else old
        word += step


@helper
def fill_span_exactly(row, start, j, triangle, depths, payload):
    """Fill a span of a triangle that is too thin or too steep for a plane: its depth comes from exact edge functions,
    at every sample."""
    for k in range(np.uint64(len(row))):
        new, old = word_of_sliver(start + np.int64(k), j, triangle, depths, payload), row[k]
        row[k] = new if new < (old & DEPTH_MASK) else old


@helper
def word_of_sliver(i, j, triangle, depths, payload):
    """Depth at a sample from exact edge functions, above the payload."""
    x0, y0, x1, y1, x2, y2 = triangle
    z0, z1, z2, least, largest = depths
    area = float((x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0))
    ux, uy = i * SUBPIXEL + HALF - x0, j * SUBPIXEL + HALF - y0
    b1 = (ux * (y2 - y0) - uy * (x2 - x0)) / area
    b2 = (uy * (x1 - x0) - ux * (y1 - y0)) / area
    z = z0 + b1 * (z1 - z0) + b2 * (z2 - z0)
    return np.int64(pack(np.rint(min(max(z, least), largest)), payload))


@helper
def take_span(row, place, start, j, triangle, depths, payload, is_sliver, word, step, fragments):
    """Count, or append to the lists of the samples, the words of a span that lie before those of `row`: whole words are
    compared, so that at equal depth the triangle with the lower number lies in front. `place` is the span's first
    sample in the band."""
    cursor = fragments.cursor
    if fragments.is_counting and not is_sliver:  # all samples: the compiler makes vector instructions of it
        lengths = cursor[np.uint64(place) : np.uint64(place + np.int64(len(row)))]
        for k in range(np.uint64(len(row))):
            new = np.int64(word)
            lengths[k] += (new >= 0) & (new < row[k])
            word += step
        return
    base = fragments.start[np.uint64(fragments.first)]
    for k in range(max(place, fragments.first), min(place + np.int64(len(row)), fragments.last)):
        i, at = k - place, np.uint64(k)
        new = np.int64(word + np.uint64(i) * step)
        if is_sliver:
            new = word_of_sliver(start + i, j, triangle, depths, payload)
        if 0 <= new < row[np.uint64(i)]:
            if not fragments.is_counting and cursor[at] < fragments.start[at + np.uint64(1)]:
                fragments.words[np.uint64(cursor[at] - base)] = new
            cursor[at] += 1
