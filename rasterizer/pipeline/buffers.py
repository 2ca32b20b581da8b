"""Stage 7 for buffers: what is visible at each pixel's centre, one kernel a kind of buffer.

In:  the band's visibility buffer, all of its entries indices of records, and the triangles that these show.
Out: the band's rows of a buffer. `clear_band` comes last: it leaves the visibility buffer clear for the next band.

Every number is that of exact interpolation (interpolate.py) in float64, rounded once to float32, so it doesn't matter
which pass the entries come from. Depth is interpolated so at few samples only. An entry's z gives a depth d, and exact
interpolation one that differs from it by at most s; where d - s and d + s round to the same float32, that is what both
round to. The other samples are those whose depth is next to the middle of two numbers of float32.

How large s is. A plane of z is off by half a unit for each column and row of its triangle's box, and by
DEPTH_PLANE_ROUNDING (planes.py). Both depths come from lines in z, offset + step·z, within S = |offset| + 2^38 |step|.
With u = 2^-53, a value of the line is off by 2 u S; the means of exact interpolation by as much, and by 7 u S more for
edge functions, products, sums and quotients. Together that is 11 u S < 2^-49 S. Without perspective the line is the
depth. With it the line is v = 1/w; if v is off by m, d = 1/v is off by

    d·m d/(1 - m d) <= d·(m d + 2^-45)   for m d <= 2^-23: (m d)² <= 2^-46, and a few roundings of 2^-53. Beyond, d - s
                                         and d + s differ by more than float32 does, and the sample stays open
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from ..geometry.vectors import length, scale
from .drawables import Drawables
from .fragments import BATCH_SIZE, NEXT, NORMAL
from .gradients import MOST_EXTENT
from .interpolate import (
    corner_values,
    corner_vectors,
    corner_weights,
    exact_triangle,
    mean_depth,
    mean_vector,
    needs_decoding,
    row_extent,
    run_end,
    weight_steps,
)
from .planes import DEPTH_PLANE_ROUNDING, DepthScale
from .records import DEPTH, SIDE, Records, face_of
from .transform import DEPTH_BITS, SUBPIXEL
from .visibility import CLEAR, PADDING, PAYLOAD_BITS, VisibilityBuffer, forget, is_exact, record_of, strip_of
from .visible_triangles import fetch_normals, fetch_positions, fetch_triangle

LONG_RUN = 16  # samples, from which on a line is worth its slope
MOST_SLACK = 2.0**-26  # of a depth: beyond, float32 leaves most depths open, and 1/w could come near 0
MANY = 16  # depths are interpolated by runs where more than one in so many is open


class VisibleSurfaces(NamedTuple):
    """What is visible in a band, one sample a pixel."""

    visibility: VisibilityBuffer
    records: Records
    drawables: Drawables  # attributes 0-2 in float64 are the normals, where a buffer needs them
    loaded_faces: np.ndarray  # (n_face,) the face that each triangle is a part of; empty where no face was clipped
    depths: DepthScale
    is_own: bool  # the pass that drew them is a buffer's: triangles without an exact record are small
    has_corners: bool  # all triangles have exact records, with the normals as attributes 0-2
    is_perspective: bool
    batch: np.ndarray  # scratch, see fragments.py, float32
    sources: np.ndarray = np.empty(0, np.uint32)  # (n,) which of all triangles each is a part of; empty as loaded_faces


class DepthLine(NamedTuple):
    """How a depth, or 1/w in perspective, is found from z: offset + step·z, off by no more than `rounding`."""

    offset: float
    step: float
    rounding: float


# ---------------------------------------------------------------- depth


@kernel
def write_depth(surfaces, band, out):
    """Write the distance along the viewing axis where something is visible: out is (height, width) float32."""
    largest = MOST_EXTENT if surfaces.is_own else find_largest(band.faces, surfaces.drawables)
    visibility, line = surfaces.visibility, depth_line(0.5 * float(largest) + DEPTH_PLANE_ROUNDING, surfaces)
    for row in range(band.y_end - band.y_start):
        y, (left, right) = band.y_start + row, row_extent(visibility, row)
        for first in range(left, right, BATCH_SIZE):
            start, end = row * visibility.pitch + first, min(first + BATCH_SIZE, right)
            entries = visibility.entries[index(start) : index(start + end - first)]
            here = out[index(y), index(first) : index(end)]
            if not needs_decoding(entries):
                put_runs_of_depths(entries, surfaces, first, y, here)
                continue
            if surfaces.is_perspective:
                n_unsure = decode_distances(entries, line, here)
            else:
                n_unsure = decode_depths(entries, line, here)
            if n_unsure > 0:
                put_exact_depths(entries, surfaces, MANY * n_unsure > end - first, first, y, here)


@helper
def find_largest(faces, drawables):
    """Return how many columns and rows together the box of any of these triangles has at most, int64.

    Parts of clipped faces don't count: they have exact records. `faces` is (n,) uint32.
    """
    triangles, largest = drawables.triangles, np.int64(0)
    for k in range(index(len(faces))):
        (xa, xb, xc), (ya, yb, yc) = fetch_positions(faces[k], drawables)
        is_whole = len(triangles.clipped_idx) == 0 or triangles.clipped_idx[faces[k]] < 0
        extent = max(xa, xb, xc) - min(xa, xb, xc) + max(ya, yb, yc) - min(ya, yb, yc)
        largest = max(largest, extent if is_whole else np.int64(0))
    return largest // SUBPIXEL + 2


@helper
def put_runs_of_depths(entries, surfaces, x, y, out):
    """Interpolate the depths of exact records, run by run; the first sample is at (x, y)."""
    start = index(0)
    while start < index(len(entries)):
        end = run_end(entries, start)
        if entries[start] < CLEAR:
            triangle, depths = triangle_of(entries[start], surfaces)
            put_run_of_depths(triangle, depths, surfaces.is_perspective, x + np.int64(start), y, out[start:end])
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
def decode_distances(entries, line, out):
    """Fill the depths of samples in perspective: inf where nothing is, NaN where the entry leaves it open; count these.

    Where 1/w may be 0, d·m d is at least d: so that is open, too.
    """
    n_unsure = 0
    for k in range(index(len(entries))):
        depth = 1.0 / (line.offset + line.step * float(entries[k] >> PAYLOAD_BITS))
        n_unsure += decide(entries[k], depth, depth * (line.rounding * depth + 2.0**-45), k, out)
    return n_unsure


@helper
def decode_depths(entries, line, out):
    """Fill the depths of samples without perspective; see `decode_distances`."""
    n_unsure = 0
    for k in range(index(len(entries))):
        depth = line.offset + line.step * float(entries[k] >> PAYLOAD_BITS)
        n_unsure += decide(entries[k], depth, line.rounding, k, out)
    return n_unsure


@helper
def decide(entry, depth, slack, k, out):
    """Write a depth that is off by at most `slack`; tell whether float32 leaves it open: 1 or 0."""
    low, high = np.float32(depth - slack), np.float32(depth + slack)
    is_covered = entry < CLEAR
    is_unsure = is_covered & (is_exact(entry) | (low != high))  # also where one is no number
    shown = np.float32(np.nan) if is_unsure else low
    out[k] = shown if is_covered else np.float32(np.inf)
    return np.int64(is_unsure)


@helper
def put_exact_depths(entries, surfaces, is_many, x, y, out):
    """Interpolate the depths that are NaN; the first sample is at (x, y).

    Where these are many, whole runs of samples of one triangle are interpolated: that costs little more than one.
    """
    start, n = index(0), index(len(entries))
    while start < n:
        if out[start] == out[start]:
            start += index(1)
            continue
        end = run_end(entries, start) if is_many else start + index(1)
        triangle, depths = triangle_of(entries[start], surfaces)
        put_run_of_depths(triangle, depths, surfaces.is_perspective, x + np.int64(start), y, out[start:end])
        start = end


@helper
def triangle_of(entry, surfaces):
    """Return the triangle that an entry shows, and the depths of its vertices."""
    records, record = surfaces.records, record_of(entry)
    if is_exact(entry) or surfaces.has_corners:
        return exact_triangle(records, record), corner_values(records.reals, record, index(DEPTH))
    return fetch_triangle(face_of(entry, records), surfaces.drawables, surfaces.depths)


@helper
def put_run_of_depths(triangle, depths, is_perspective, x, y, out):
    """Interpolate depths at a run of samples of a triangle from (x, y) on: along a line, where that is certain to round
    to the same float32, else each by itself."""
    n, n_unsure = index(len(out)), np.int64(0)
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
                fill_depths(triangle, depths, is_perspective, x + np.int64(k), y, out[k : k + index(1)])


@helper
def line_of_run(triangle, depths, is_perspective, x, y):
    """Return the line a + k·Δa that the depth, or 1/w in perspective, follows along a row from (x, y) on, and how far
    the depth of exact interpolation may be from it: in perspective as a share of the depth; inf where there is none.

    Letters: e_i edge functions, A their sum, a_i what stands at the corners: 1/w, or the depth without perspective,
    where all w are 1; m the largest |a_i|; u = 2^-53. Samples of a triangle lie in it, so |k Δe_i| <= |A|, and
    Σ |k Δe_i| <= 2 |A|. What rounds k·Δa is two products, two sums, a divisor, a quotient and the product with k: 14 u
    m. The first a errs by 6 u m, exact interpolation by 8 u m; the last sum, 1/a and the two ends of the range by u
    each. Together that is less than 32 u m. In perspective it is divided by a, which is not below the least a_i.
    """
    (q0, q1, q2), (steps, _) = corner_weights(triangle, x, y), weight_steps(triangle)
    least, largest = triangle.sums
    if is_perspective:
        first, step = q0 + q1 + q2, steps[0] + steps[1] + steps[2]
        slack = 2.0**-48 * largest / least
        slack = slack if slack <= MOST_SLACK else np.inf
    else:
        first = q0 * depths[0] + q1 * depths[1] + q2 * depths[2]
        step = steps[0] * depths[0] + steps[1] * depths[1] + steps[2] * depths[2]
        slack = 2.0**-48 * max(abs(depths[0]), abs(depths[1]), abs(depths[2])) if least == largest == 1.0 else np.inf
    return first / triangle.area, step / triangle.area, np.inf if triangle.is_clipped else slack


@helper
def fill_depths(triangle, depths, is_perspective, x, y, out):
    """Interpolate depths at a run of samples from (x, y) on, each by itself."""
    for k in range(index(len(out))):
        q = corner_weights(triangle, x + np.int64(k), y)
        out[k] = mean_depth(triangle, depths, q, is_perspective)


# ---------------------------------------------------------------- faces and normals


@kernel
def write_face(surfaces, band, out):
    """Write the index of the visible face as loaded: out is (height, width) int32."""
    visibility, records, loaded_faces = surfaces.visibility, surfaces.records, surfaces.loaded_faces
    for row in range(band.y_end - band.y_start):
        y, (left, right) = band.y_start + row, row_extent(visibility, row)
        if left >= right:
            continue
        start = row * visibility.pitch + left
        entries = visibility.entries[index(start) : index(start + right - left)]
        here = out[index(y), index(left) : index(right)]
        for k in range(index(len(entries))):
            if entries[k] < CLEAR:
                face = face_of(entries[k], records)
                here[k] = loaded_faces[face] if len(loaded_faces) > 0 else face


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
            entries = visibility.entries[index(start) : index(start + end - first)]
            put_normals(entries, surfaces, first, y, batch)
            interleave(entries, batch, out[index(y), index(3 * first) : index(3 * end)])


@helper
def put_normals(entries, surfaces, x, y, batch):
    """Interpolate normals run by run; the first sample is at (x, y)."""
    start = index(0)
    while start < index(len(entries)):
        end = run_end(entries, start)
        if entries[start] < CLEAR:
            triangle, _ = triangle_of(entries[start], surfaces)
            normals, side = normals_of(entries[start], surfaces)
            run = batch[NORMAL + start : NORMAL + NEXT + NEXT + end]
            fill_normals(triangle, normals, side, x + np.int64(start), y, end - start, run)
        start = end


@helper
def fill_normals(triangle, normals, side, x, y, n, out):
    """Interpolate n normals from the sample (x, y) on: unit length, on the side that is seen; a row of `out` an axis,
    NEXT apart."""
    xs, ys, zs = out[:n], out[NEXT : NEXT + n], out[NEXT + NEXT : NEXT + NEXT + n]
    for k in range(n):
        q = corner_weights(triangle, x + np.int64(k), y)
        total = q[0] + q[1] + q[2]
        normal = mean_vector(normals, (q[0] / total, q[1] / total, q[2] / total))
        norm = length(normal)
        xs[k], ys[k], zs[k] = scale(normal, side / norm if norm > 0 else 0.0)


@helper
def normals_of(entry, surfaces):
    """Return the normals of the triangle that an entry shows, an axis a row, and the side of it that is seen."""
    records, record = surfaces.records, record_of(entry)
    if surfaces.has_corners:
        return corner_vectors(records, record, index(0)), np.int64(records.integers[record, index(SIDE)])
    return fetch_normals(face_of(entry, records), surfaces.drawables)


@helper
def interleave(entries, batch, out):
    """Write the normals of a batch to the pixels of a row, x, y, z one after the other; 0 where nothing is."""
    n, nothing = index(len(entries)), np.float32(0)
    xs, ys, zs = batch[NORMAL : NORMAL + n], batch[NORMAL + NEXT :][:n], batch[NORMAL + NEXT + NEXT :][:n]
    for k in range(n):
        is_covered, first = entries[k] < CLEAR, index(3) * k
        out[first] = xs[k] if is_covered else nothing
        out[first + index(1)] = ys[k] if is_covered else nothing
        out[first + index(2)] = zs[k] if is_covered else nothing


# ---------------------------------------------------------------- the end of a band


@kernel
def clear_band(visibility, n_row):
    """Clear the first `n_row` rows of the visibility buffer; return how many samples are covered."""
    n_covered = 0
    for row in range(n_row):
        strip = strip_of(row)
        left, right, start = visibility.left[strip], visibility.right[strip], row * visibility.pitch
        if left < right:
            entries = visibility.entries[index(start + left) : index(start + right + PADDING)]
            for k in range(index(right - left)):
                n_covered += entries[k] < CLEAR
                entries[k] = CLEAR
            for k in range(index(right - left), index(len(entries))):
                entries[k] = CLEAR
    forget(visibility)
    return n_covered
