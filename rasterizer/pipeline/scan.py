"""Stage 5, scan: the triangles of one band into its z-buffer.

In:  the band's list of triangles, in face order, and the vertices on the screen.
Out: a word for every sample of the band, and a record for every triangle whose samples are shaded later.

A word packs depth and what is visible there, so that one integer addition advances both along a span, and one comparison
decides visibility and writes both:

    63        62 ............ 25   24     23 ............. 0
    sign (0)  depth (38 bits)      is_id  intensity or record number

A plane is anchored at the first sample of the triangle's unclipped box, and integer addition is associative: a word is a
function of triangle and sample alone, not of band, span start or thread. Products may overflow 64 bits on the way;
arithmetic modulo 2^64 gives the right word all the same, because the word itself fits.

    top v0                    Clockwise on the screen (y points down): v0 is the topmost vertex, the leftmost of two.
       /\\                     Left chain v0-v2(-v1), right chain v0-v1(-v2). A sample on a left or top edge belongs to
      /  \\_                   the triangle, on a right or bottom edge it doesn't: spans run from the first sample at or
  v2 /_____\\ v1               beyond the left edge to the last one before the right edge.
"""

from typing import NamedTuple

import numpy as np

from .._kernel import borrow, helper, kernel
from .lanes import LANES, MOST_HIGH, MOST_WIDE, merge_box
from .records import (
    PAYLOAD_BITS,
    Polygons,
    borrow_records,
    carry_attributes,
    find_slopes,
    gradient,
)
from .setup import first_sample
from .transform import DEPTH_BITS, HALF, SUBPIXEL

DEPTH_MASK = np.int64(-(1 << PAYLOAD_BITS))
CLEAR = np.int64(((1 << DEPTH_BITS) - 1) << PAYLOAD_BITS)  # nothing here: behind every depth
GROUP_SHIFT = 3  # extents are kept for groups of 8 rows
PADDING = MOST_WIDE  # samples behind each row that lanes may read and write back
# Planes are good while box area / triangle area stays below this: a coefficient is at most 2^DEPTH_BITS · 2^20 < 2^63 and its
# float64 rounding error at most 2^(38 + 20 - 53) units a box, a 2^33rd of the depth range. Slivers beyond are interpolated exactly.
MAX_ELONGATION = 2.0**20
MAX_SLOPE = 2.0**60  # of depth, a sample: steeper ones would leave 64 bits; a triangle that reaches far out of the picture may


class Canvas(NamedTuple):
    """The z-buffer of one band, private to a thread and clean between bands."""

    words: np.ndarray  # (rows * pitch,) int64
    pitch: int
    width: int
    left: np.ndarray  # (groups,) int64: samples left..right of a group of rows may have been written
    right: np.ndarray  # (groups,) int64


@kernel
def scan(faces, polygons, vertices, attributes, coding, y_start, y_stop, canvas, records):
    """Draw the triangles `faces` into the rows y_start..y_stop of the picture; return how many records were written.

    `attributes` is (side, n, n_attribute): side 0 for triangles whose normals look at the viewer as they are, the last side for
    those whose normals must be flipped.
    """
    x, y, z = borrow(vertices.x), borrow(vertices.y), borrow(vertices.z)
    polygons = Polygons(borrow(polygons.vertex), borrow(polygons.corner), borrow(polygons.is_inverted))
    canvas = Canvas(borrow(canvas.words), canvas.pitch, canvas.width, borrow(canvas.left), borrow(canvas.right))
    records = borrow_records(records)
    attributes = borrow(attributes)
    n_record = np.int64(0)
    for face in faces:
        # Order the vertices: clockwise on the screen, topmost (then leftmost) first, so that the same triangle gives the same
        # plane however the file lists its vertices.
        o0, o1, o2, is_front = order_vertices(polygons.vertex, face, x, y)
        i0, i1, i2 = polygons.vertex[o0, face], polygons.vertex[o1, face], polygons.vertex[o2, face]
        c0, c1, c2 = polygons.corner[o0, face], polygons.corner[o1, face], polygons.corner[o2, face]
        is_flipped = is_front == (polygons.is_inverted[face] != 0)
        x0, y0, z0 = np.int64(x[i0]), np.int64(y[i0]), z[i0]
        x1, y1, z1 = np.int64(x[i1]), np.int64(y[i1]), z[i1]
        x2, y2, z2 = np.int64(x[i2]), np.int64(y[i2]), z[i2]
        dx1, dy1, dx2, dy2 = x1 - x0, y1 - y0, x2 - x0, y2 - y0
        area = dx1 * dy2 - dx2 * dy1

        # Find the box: in samples, unclipped for the anchor, clipped for the loops.
        x_min, x_max, y_max = min(x0, x1, x2), max(x0, x1, x2), max(y1, y2)
        anchor_x, anchor_y = first_sample(x_min), first_sample(y0)
        left, right = max(anchor_x, 0), min(first_sample(x_max), canvas.width)
        top, bottom = max(anchor_y, y_start), min(first_sample(y_max), y_stop)
        if left >= right or top >= bottom:
            continue

        # Find the slopes of planes over the triangle, and that of depth.
        is_sliver = float(x_max - x_min) * float(y_max - y0) > MAX_ELONGATION * area
        slopes = find_slopes(dx1, dy1, dx2, dy2, np.inf if is_sliver else float(area))
        offset = (float(anchor_x * SUBPIXEL + HALF - x0) / SUBPIXEL, float(anchor_y * SUBPIXEL + HALF - y0) / SUBPIXEL)
        z_x, z_y = gradient(z1 - z0, z2 - z0, slopes)
        if abs(z_x) + abs(z_y) > MAX_SLOPE:
            is_sliver, z_x, z_y = True, 0.0, 0.0

        # Carry the attributes to the samples: in the word, in planes, or exactly.
        side = np.uint64(attributes.shape[0] - 1 if is_flipped else 0)
        corners, depths = (attributes[side, c0], attributes[side, c1], attributes[side, c2]), (z0, z1, z2)
        steps = (first_sample(x_max) - anchor_x, first_sample(y_max) - anchor_y)
        payload, payload_x, payload_y, n_record = carry_attributes(
            records, n_record, corners, slopes, (anchor_x, anchor_y), offset, steps, depths,
            (x0, y0, dx1, dy1, dx2, dy2), coding, face, is_flipped, is_sliver,
        )  # fmt: skip

        # Note what part of the band is touched.
        first_group = np.uint64(top - y_start) >> np.uint64(GROUP_SHIFT)
        last_group = np.uint64(bottom - 1 - y_start) >> np.uint64(GROUP_SHIFT)
        for group in range(first_group, last_group + np.uint64(1)):
            canvas.left[group] = min(canvas.left[group], left)
            canvas.right[group] = max(canvas.right[group], right)

        # Fill: all samples of a small box side by side, else span by span.
        triangle = (x0, y0, x1, y1, x2, y2)
        box = (left, right, top, bottom, (top - y_start) * canvas.pitch)
        word_x = pack(np.rint(z_x), payload_x)
        word_y = pack(np.rint(z_y), payload_y)
        anchor = pack(np.rint(z0 + z_x * offset[0] + z_y * offset[1]), payload)
        origin = anchor - np.uint64(anchor_x) * word_x - np.uint64(anchor_y) * word_y  # the plane's word at sample (0, 0)
        if steps[0] <= MOST_WIDE and steps[1] <= MOST_HIGH and not is_sliver:
            fill_lanes(canvas.words, canvas.pitch, box, triangle, (origin, word_x, word_y))
        else:
            fill_spans(canvas, box, triangle, (origin, word_x, word_y), is_sliver, (z0, z1, z2), payload)
    return n_record


@helper
def pack(depth, payload):
    """Put depth above payload. Unsigned, because products of a plane may overflow on the way: signed overflow is undefined."""
    return (np.uint64(np.int64(depth)) << np.uint64(PAYLOAD_BITS)) + np.uint64(payload)


@helper
def order_vertices(vertex, face, x, y):
    """Return the columns of the first, second and third vertex, and whether the triangle is counter-clockwise as loaded."""
    a, b, c = vertex[0, face], vertex[1, face], vertex[2, face]
    xa, ya, xb, yb, xc, yc = np.int64(x[a]), np.int64(y[a]), np.int64(x[b]), np.int64(y[b]), np.int64(x[c]), np.int64(y[c])
    is_front = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya) < 0
    key_a, key_b, key_c = (ya << 32) + xa, (yb << 32) + xb, (yc << 32) + xc
    first = 1 if key_b < key_a else 0
    first = 2 if key_c < min(key_a, key_b) else first
    after = 0 if first == 2 else first + 1
    before = 2 if first == 0 else first - 1
    second = before if is_front else after
    third = after if is_front else before
    return np.uint64(first), np.uint64(second), np.uint64(third), is_front


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
        merge_box(words, np.uint64(base + first), np.uint64(pitch), bottom - top, (word, word_x, word_y), edges, DEPTH_MASK)


@helper
def edge_function(xa, ya, xb, yb, sx, sy):
    """Pineda's edge function (1988) of a clockwise edge at a sample, and its steps a sample; >= 0 means inside.

    A sample on the edge is inside only on a top edge (to the right) or a left one (upwards), so the others are moved by one.
    """
    dx, dy = xb - xa, yb - ya
    is_top_left = (dy < 0) | ((dy == 0) & (dx > 0))
    value = dx * (sy - ya) - dy * (sx - xa) - (0 if is_top_left else 1)
    return value, -dy * SUBPIXEL, dx * SUBPIXEL


@helper
def fill_spans(canvas, box, triangle, plane, is_sliver, depths, payload):
    """Walk the left and the right chain down the rows and fill the samples between them, slivers exactly."""
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
                if is_sliver:
                    fill_span_exactly(row, start, j, triangle, depths, payload)
                else:
                    fill_span(row, origin + np.uint64(j) * word_y + np.uint64(start) * word_x, word_x)
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
    Returns (sample, rest, sample step, rest step, divisor): each row adds the steps, and carries one when rest >= divisor.
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
    """Fill a span of a triangle that is too thin for a plane: its depth comes from exact edge functions at every sample."""
    x0, y0, x1, y1, x2, y2 = triangle
    z0, z1, z2 = depths
    area = float((x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0))
    uy = j * SUBPIXEL + HALF - y0
    for k in range(np.uint64(len(row))):
        ux = (start + np.int64(k)) * SUBPIXEL + HALF - x0
        b1 = (ux * (y2 - y0) - uy * (x2 - x0)) / area
        b2 = (uy * (x1 - x0) - ux * (y1 - y0)) / area
        new, old = np.int64(pack(np.rint(z0 + b1 * (z1 - z0) + b2 * (z2 - z0)), payload)), row[k]
        row[k] = new if new < (old & DEPTH_MASK) else old
