"""Stage 7 for buffers: what is visible at each pixel's centre, one kernel for each buffer.

In:  the band's visibility buffer, whose packed samples hold places in the band's list of triangles (`scan_index`), and
     the triangles; for labels and means a table: a label for each face, or values for the corners of each triangle.
Out: the band's rows of a buffer. `clear_band` comes last: it leaves the visibility buffer clear for the next band.

Every number is that of exact interpolation (interpolate.py) in float64, rounded once to float32. Of small triangles
depth is interpolated so at few samples. A packed sample's z gives a depth d, and exact interpolation one that differs
from it by at most s; where d - s and d + s round to the same float32, that is what both round to. The other samples are
those whose depth is next to the middle of two numbers of float32. Packed samples of large triangles are marked as
exact: their z is off by more, and their runs of samples are long.

How large s is. A plane of z is off by half a unit for each column and row of its triangle's box, and by
DEPTH_PLANE_ROUNDING (setup.py). Both depths come from lines in z, offset + step·z, within S = |offset| + 2^38 |step|.
With u = 2^-53, a value of the line is off by 2 u S; the means of exact interpolation by as much, and by 7 u S more for
edge functions, products, sums and quotients. Together that is 11 u S < 2^-49 S. Without perspective the line is the
depth. With it the line is v = 1/w; if v is off by m, d = 1/v is off by

    d·m d/(1 - m d) <= d·(m d + 2^-45)   for m d <= 2^-23: (m d)² <= 2^-46, and a few roundings of 2^-53. Beyond, d - s
                                         and d + s differ by more than float32 does, and the sample stays open
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel
from ..geometry.vectors import length, scale
from .fragments import BATCH_SIZE, NEXT, NORMAL
from .interpolate import (
    ExactTriangle,
    corner_weights,
    inverse_range,
    mean,
    mean_depth,
    mean_vector,
    needs_decoding,
    row_extent,
    run_end,
    weight_steps,
)
from .scan import MAX_EXTENT
from .setup import DEPTH_PLANE_ROUNDING, DepthScale, depth_at_corner, rotate_to_first
from .transform import DEPTH_BITS, Drawables, depths_on_plane
from .visibility import CLEAR, PAYLOAD_BITS, VisibilityBuffer, clear, is_exact, setup_of


class VisibleSurfaces(NamedTuple):
    """What is visible in a band, one sample a pixel."""

    visibility: VisibilityBuffer
    faces: np.ndarray  # (n,) uint32: the band's triangles; packed samples hold places in it
    drawables: Drawables  # attributes 0-2 are the normals, where a buffer needs them
    sources: np.ndarray  # (n,) the triangle of the scene that each is a part of; empty where none was clipped
    depths: DepthScale
    is_perspective: bool
    batch: np.ndarray  # scratch, see fragments.py, float32


@helper
def face_at(packed, surfaces):
    """Return the triangle that a packed sample shows."""
    return surfaces.faces[setup_of(packed)]


# ---------------------------------------------------------------- masks, faces and labels

# What all kernels that write a buffer take:
#
# surfaces : VisibleSurfaces
# band : Rows or Band, the rows of the picture that are written
# out : the whole buffer, height rows of width pixels; where nothing is visible it comes in with what is to stand there


@kernel
def write_mask(surfaces, band, out):
    """Write where something is visible: out is (height, width) bool."""
    visibility = surfaces.visibility
    for row in range(band.y_end - band.y_start):
        y, (left, right) = band.y_start + row, row_extent(visibility, row)
        for x in range(left, right):
            out[y, x] = visibility.packed[row * visibility.pitch + x] < CLEAR


@kernel
def write_face(surfaces, band, out):
    """Write the index of the visible triangle as loaded: out is (height, width) int32."""
    visibility, sources = surfaces.visibility, surfaces.sources
    for row in range(band.y_end - band.y_start):
        y, (left, right) = band.y_start + row, row_extent(visibility, row)
        if left >= right:
            continue
        start = row * visibility.pitch + left
        packed = visibility.packed[start : start + right - left]
        here = out[y, left:right]
        for k in range(len(packed)):
            if packed[k] < CLEAR:
                face = face_at(packed[k], surfaces)
                here[k] = sources[face] if len(sources) > 0 else face


@kernel
def write_label(surfaces, band, out, labels):
    """Write the label of the visible triangle: out is (height, width) int32, `labels` (n_face,) int32."""
    visibility, sources = surfaces.visibility, surfaces.sources
    for row in range(band.y_end - band.y_start):
        y, (left, right) = band.y_start + row, row_extent(visibility, row)
        for x in range(left, right):
            packed = visibility.packed[row * visibility.pitch + x]
            if packed < CLEAR:
                face = face_at(packed, surfaces)
                source = sources[face] if len(sources) > 0 else face
                out[y, x] = labels[source]


# ---------------------------------------------------------------- depth

LONG_RUN = 16  # samples, from which on a line is worth its slope
MAX_SLACK = 2.0**-26  # of a depth: beyond, float32 leaves most depths open, and 1/w could come near 0
MANY = 16  # depths are interpolated by runs where more than one in so many is open


class DepthLine(NamedTuple):
    """How a depth, or 1/w in perspective, is found from z: offset + step·z, off by no more than `rounding`."""

    offset: float
    step: float
    rounding: float


@kernel
def write_depth(surfaces, band, out):
    """Write the distance along the viewing axis where something is visible: out is (height, width) float32."""
    visibility, line = surfaces.visibility, depth_line(0.5 * float(MAX_EXTENT) + DEPTH_PLANE_ROUNDING, surfaces)
    for row in range(band.y_end - band.y_start):
        y, (left, right) = band.y_start + row, row_extent(visibility, row)
        for first in range(left, right, BATCH_SIZE):
            start, end = row * visibility.pitch + first, min(first + BATCH_SIZE, right)
            packed = visibility.packed[start : start + end - first]
            here = out[y, first:end]
            if not needs_decoding(packed):
                put_runs_of_depths(packed, surfaces, first, y, here)
                continue
            if surfaces.is_perspective:
                n_unsure = decode_distances(packed, line, here)
            else:
                n_unsure = decode_depths(packed, line, here)
            if n_unsure > 0:
                put_exact_depths(packed, surfaces, MANY * n_unsure > end - first, first, y, here)


@helper
def put_runs_of_depths(packed, surfaces, x, y, out):
    """Interpolate depths run by run; the first sample is at (x, y)."""
    start = 0
    while start < len(packed):
        end = run_end(packed, start)
        if packed[start] < CLEAR:
            triangle, depths = fetch_triangle(face_at(packed[start], surfaces), surfaces)
            put_run_of_depths(triangle, depths, surfaces.is_perspective, x + start, y, out[start:end])
        start = end


@helper
def depth_line(units, surfaces):
    """Return the line that depths are found from, where planes of z are off by as many z-buffer units."""
    depths = surfaces.depths
    offset, step = depths.depth_offset, depths.depth_scale
    if surfaces.is_perspective:
        offset, step = depths.inv_w_offset, depths.inv_w_scale
    span = abs(offset) + 2.0**DEPTH_BITS * abs(step)
    return DepthLine(offset, step, units * abs(step) + 2.0**-49 * span)


@helper
def decode_distances(packed, line, out):
    """Fill the depths of samples in perspective: inf where nothing is, NaN where the packed sample leaves it open;
    count these.

    Where 1/w may be 0, d·m d is at least d: so that is open, too.
    """
    n_unsure = 0
    for k in range(len(packed)):
        depth = 1.0 / (line.offset + line.step * float(packed[k] >> PAYLOAD_BITS))
        n_unsure += decide(packed[k], depth, depth * (line.rounding * depth + 2.0**-45), k, out)
    return n_unsure


@helper
def decode_depths(packed, line, out):
    """Fill the depths of samples without perspective; see `decode_distances`."""
    n_unsure = 0
    for k in range(len(packed)):
        depth = line.offset + line.step * float(packed[k] >> PAYLOAD_BITS)
        n_unsure += decide(packed[k], depth, line.rounding, k, out)
    return n_unsure


@helper
def decide(packed, depth, slack, k, out):
    """Write a depth that is off by at most `slack`; tell whether float32 leaves it open: 1 or 0."""
    low, high = np.float32(depth - slack), np.float32(depth + slack)
    is_covered = packed < CLEAR
    is_unsure = is_covered & (is_exact(packed) | (low != high))  # also where one is no number
    shown = np.float32(np.nan) if is_unsure else low
    out[k] = shown if is_covered else np.float32(np.inf)
    return np.int64(is_unsure)


@helper
def put_exact_depths(packed, surfaces, is_many, x, y, out):
    """Interpolate the depths that are NaN; the first sample is at (x, y).

    Where these are many, whole runs of samples of one triangle are interpolated: that costs little more than one.
    """
    start, n = 0, len(packed)
    while start < n:
        if out[start] == out[start]:
            start += 1
            continue
        end = run_end(packed, start) if is_many else start + 1
        triangle, depths = fetch_triangle(face_at(packed[start], surfaces), surfaces)
        put_run_of_depths(triangle, depths, surfaces.is_perspective, x + start, y, out[start:end])
        start = end


@helper
def put_run_of_depths(triangle, depths, is_perspective, x, y, out):
    """Interpolate depths at a run of samples of a triangle from (x, y) on: along a line, where that is certain to round
    to the same float32, else each by itself."""
    n, n_unsure = len(out), 0
    first, step, slack = line_of_run(triangle, depths, is_perspective, x, y)
    if n < LONG_RUN or slack == np.inf:
        fill_depths(triangle, depths, is_perspective, x, y, out)
        return
    for k in range(n):
        value = first + float(k) * step
        depth = 1.0 / value if is_perspective else value
        room = depth * slack if is_perspective else slack
        low, high = np.float32(depth - room), np.float32(depth + room)
        n_unsure += np.int64(low != high)
        out[k] = low if low == high else np.float32(np.nan)
    if n_unsure > 0:
        for k in range(n):
            if out[k] != out[k]:
                fill_depths(triangle, depths, is_perspective, x + k, y, out[k : k + 1])


@helper
def line_of_run(triangle, depths, is_perspective, x, y):
    """Return the line a + k·Δa that the depth, or 1/w in perspective, follows along a row from (x, y) on, and how far
    the depth of exact interpolation may be from it: in perspective as a share of the depth; inf where there is none.

    Letters: e_i edge functions, A their sum, a_i what stands at the corners: 1/w, or the depth without perspective,
    where all w are 1; m the largest |a_i|; u = 2^-53. Samples of a triangle lie in it, so |k Δe_i| <= |A|, and
    Σ |k Δe_i| <= 2 |A|. What rounds k·Δa is two products, two sums, a divisor, a quotient and the product with k: 14 u
    m, in perspective with the corners' shares of 1/w (triangle_setups.py) 18 u m. The first a errs by 8 u m, exact
    interpolation by 10 u m; the last sum, 1/a and the two ends of the range by u each. Together that is less than 64 u
    m. In perspective it is divided by a, which is not below the least a_i.
    """
    (q0, q1, q2), (steps, _) = corner_weights(triangle, x, y), weight_steps(triangle)
    first = q0 * depths[0] + q1 * depths[1] + q2 * depths[2]
    step = steps[0] * depths[0] + steps[1] * depths[1] + steps[2] * depths[2]
    if is_perspective:
        least, largest = inverse_range(triangle, depths)
        slack = 2.0**-47 * largest / least
        slack = slack if slack <= MAX_SLACK else np.inf
    else:
        slack = 2.0**-47 * max(abs(depths[0]), abs(depths[1]), abs(depths[2]))
    return first / triangle.area, step / triangle.area, slack


@helper
def fill_depths(triangle, depths, is_perspective, x, y, out):
    """Interpolate depths at a run of samples from (x, y) on, each by itself."""
    for k in range(len(out)):
        q = corner_weights(triangle, x + k, y)
        out[k] = mean_depth(triangle, depths, q, is_perspective)


# ---------------------------------------------------------------- normals


def write_turned_normal(surfaces, band, out, rotation):
    """Write the unit normal, turned by a rotation: out is (height, width, 3) float32, `rotation` (3, 3) float64.

    The normal is rounded to float32 before and after. A component of it is off by 2^-25 at most, so the turned one by
    √3·2^-25 and its own rounding: less than 2^-23.
    """
    write_normal(surfaces, band, out)
    rows = out[band.y_start : band.y_end]
    rows[...] = rows @ rotation.T + 0.0  # no -0 where nothing is


def write_normal(surfaces, band, out):
    """Write the unit normal in the world, towards the viewer: out is (height, width, 3) float32."""
    write_normal_rows(surfaces, band, out.reshape(len(out), -1))


@kernel
def write_normal_rows(surfaces, band, out):
    """See `write_normal`; out is (height, 3 * width), so that the compiler knows how far pixels are apart and makes
    vector instructions of the loop that writes them."""
    visibility, batch = surfaces.visibility, surfaces.batch
    for row in range(band.y_end - band.y_start):
        y, (left, right) = band.y_start + row, row_extent(visibility, row)
        for first in range(left, right, BATCH_SIZE):
            start, end = row * visibility.pitch + first, min(first + BATCH_SIZE, right)
            packed = visibility.packed[start : start + end - first]
            put_normals(packed, surfaces, first, y, batch)
            interleave(packed, batch, out[y, 3 * first : 3 * end])


@helper
def put_normals(packed, surfaces, x, y, batch):
    """Interpolate normals run by run; the first sample is at (x, y)."""
    start = 0
    while start < len(packed):
        end = run_end(packed, start)
        if packed[start] < CLEAR:
            face = face_at(packed[start], surfaces)
            triangle, _ = fetch_triangle(face, surfaces)
            normals, side = fetch_normals(face, surfaces.drawables)
            run = batch[NORMAL + start : NORMAL + NEXT + NEXT + end]
            fill_normals(triangle, normals, side, x + start, y, end - start, run)
        start = end


@helper
def fill_normals(triangle, normals, side, x, y, n, out):
    """Interpolate n normals from the sample (x, y) on: unit length, on the side that is seen; a row of `out` an axis,
    NEXT apart."""
    xs, ys, zs = out[:n], out[NEXT : NEXT + n], out[NEXT + NEXT : NEXT + NEXT + n]
    for k in range(n):
        q = corner_weights(triangle, x + k, y)
        total = q[0] + q[1] + q[2]
        normal = mean_vector(normals, (q[0] / total, q[1] / total, q[2] / total))
        norm = length(normal)
        xs[k], ys[k], zs[k] = scale(normal, side / norm if norm > 0 else 0.0)


@helper
def interleave(packed, batch, out):
    """Write the normals of a batch to the pixels of a row, x, y, z one after the other; 0 where nothing is."""
    n, zero = len(packed), np.float32(0)
    xs, ys, zs = batch[NORMAL : NORMAL + n], batch[NORMAL + NEXT :][:n], batch[NORMAL + NEXT + NEXT :][:n]
    for k in range(n):
        is_covered, first = packed[k] < CLEAR, 3 * k
        out[first] = xs[k] if is_covered else zero
        out[first + 1] = ys[k] if is_covered else zero
        out[first + 2] = zs[k] if is_covered else zero


# ---------------------------------------------------------------- means of what the corners of faces have

# A mean is Σ p_i·a_i with the perspective weights p_i of interpolate.py. The weights come in the order of setup.py,
# which begins at the topmost vertex; the table is in the order of the file. `order_of` tells which is which.


class CornerTable(NamedTuple):
    """What the corners of triangles have: rows of values, and which row belongs to which corner."""

    values: np.ndarray  # (n, n_component) float64
    rows: np.ndarray  # (3, n_triangle) uint32, corners in the order of the file


def write_mean(surfaces, band, out, table):
    """Write the means of what the corners of the visible triangles have: out is (height, width, n_component) float32,
    or (height, width) where that is one; `table` is a CornerTable."""
    write_means(surfaces, band, out if out.ndim == 3 else out.reshape(*out.shape, 1), table)


@kernel
def write_means(surfaces, band, out, table):
    """See `write_mean`; out has three axes."""
    visibility = surfaces.visibility
    for row in range(band.y_end - band.y_start):
        y, (left, right) = band.y_start + row, row_extent(visibility, row)
        if left >= right:
            continue
        first = row * visibility.pitch + left
        packed = visibility.packed[first : first + right - left]
        here = out[y, left:right]
        start = 0
        while start < len(packed):
            end = run_end(packed, start)
            if packed[start] < CLEAR:
                face = face_at(packed[start], surfaces)
                triangle, _ = fetch_triangle(face, surfaces)
                corners = table_rows(face, surfaces, table)
                fill_means(triangle, corners, table.values, left + start, y, here[start:end])
            start = end


@helper
def table_rows(face, surfaces, table):
    """Return the rows of a table for the corners of a triangle, in the order of its weights."""
    xs, ys = fetch_positions(face, surfaces.drawables)
    return ordered(fetch_indices(table.rows, face), order_of(xs, ys))


@helper
def fill_means(triangle, corners, values, x, y, out):
    """Interpolate the values of three corners at a run of samples from (x, y) on: out is (n, n_component)."""
    a, b, c = corners
    for k in range(out.shape[0]):
        q = corner_weights(triangle, x + k, y)
        total = q[0] + q[1] + q[2]
        p = (q[0] / total, q[1] / total, q[2] / total)
        for component in range(out.shape[1]):
            out[k, component] = mean((values[a, component], values[b, component], values[c, component]), p)


# ---------------------------------------------------------------- triangles of visible samples

# The numbers that exact setups hold (triangle_setups.py), fetched from the picture's drawables.


class VertexOrder(NamedTuple):
    """How setup.py orders the vertices of a triangle: clockwise on the screen, the topmost (then leftmost) first."""

    is_b_first: bool
    is_c_first: bool
    is_front: bool  # counter-clockwise as loaded


@helper
def fetch_triangle(face, surfaces):
    """Return a triangle, and the depths of its vertices, as an exact setup holds them."""
    drawables, depths = surfaces.drawables, surfaces.depths
    xs, ys = fetch_positions(face, drawables)
    order, vertices = order_of(xs, ys), drawables.vertices
    a, b, c = fetch_indices(drawables.triangles.vertex_idx, face)
    (x0, x1, x2), (y0, y1, y2) = ordered(xs, order), ordered(ys, order)
    true_x, true_y, z = vertices.true_x, vertices.true_y, vertices.z
    z0, z1, z2 = ordered((z[a], z[b], z[c]), order)
    (own0, own1, own2), _ = depths_on_plane(
        ordered((true_x[a], true_x[b], true_x[c]), order), ordered((true_y[a], true_y[b], true_y[c]), order),
        (float(x0), float(x1), float(x2)), (float(y0), float(y1), float(y2)), (z0, z1, z2),
        vertices.pixel,
    )  # fmt: skip
    offset, step = depths.inv_w_offset, depths.inv_w_scale
    inv_w = (offset + step * z0, offset + step * z1, offset + step * z2)
    dx1, dy1, dx2, dy2 = x1 - x0, y1 - y0, x2 - x0, y2 - y0
    triangle = ExactTriangle(x0, y0, dx1, dy1, dx2, dy2, inv_w, float(dx1 * dy2 - dx2 * dy1))
    own_depths = depth_at_corner(z0, own0, depths), depth_at_corner(z1, own1, depths), depth_at_corner(z2, own2, depths)
    return triangle, own_depths


@helper
def fetch_normals(face, drawables):
    """Return the normals of a triangle, an axis a row and a corner a column, and the side that is seen: 1 or -1.

    Normals are the first three attributes.
    """
    triangles, attributes = drawables.triangles, drawables.attributes
    xs, ys = fetch_positions(face, drawables)
    order = order_of(xs, ys)
    is_flipped = order.is_front == (triangles.is_inverted[face] != 0)
    side = attributes.shape[0] - 1 if is_flipped else 0
    a, b, c = ordered(fetch_indices(triangles.corner_idx, face), order)
    x = (attributes[side, a, 0], attributes[side, b, 0], attributes[side, c, 0])
    y = (attributes[side, a, 1], attributes[side, b, 1], attributes[side, c, 1])
    z = (attributes[side, a, 2], attributes[side, b, 2], attributes[side, c, 2])
    return (x, y, z), -1 if is_flipped else 1


@helper
def fetch_indices(columns, face):
    """Return the three indices of a triangle."""
    return columns[0, face], columns[1, face], columns[2, face]


@helper
def fetch_positions(face, drawables):
    """Return the columns and rows of a triangle's vertices, int64, 1/256 px, in the order of the file."""
    x, y = drawables.vertices.x, drawables.vertices.y
    a, b, c = fetch_indices(drawables.triangles.vertex_idx, face)
    return (np.int64(x[a]), np.int64(x[b]), np.int64(x[c])), (np.int64(y[a]), np.int64(y[b]), np.int64(y[c]))


@helper
def order_of(xs, ys):
    """Return the order of the vertices at these places, as setup.order_vertices finds it."""
    (xa, xb, xc), (ya, yb, yc) = xs, ys
    key_a, key_b, key_c = (ya << 32) + xa, (yb << 32) + xb, (yc << 32) + xc
    is_c_first = key_c < min(key_a, key_b)
    is_b_first = (key_b < key_a) and not is_c_first
    return VertexOrder(is_b_first, is_c_first, (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya) < 0)


@helper
def ordered(values, order):
    """Bring what a triangle has at its vertices into their order."""
    a, b, c = values
    return rotate_to_first(a, b, c, order.is_b_first, order.is_c_first, order.is_front)


# ---------------------------------------------------------------- the end of a band


@kernel
def clear_band(visibility, n_row):
    """Clear the first `n_row` rows of a visibility buffer (VisibilityBuffer); return how many samples are covered."""
    return clear(visibility, n_row)
