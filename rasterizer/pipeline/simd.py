"""Three inner loops as vector instructions: a small box of samples, and the planes of one sample.

They stand here in Python, which is what runs with the JIT switched off; compiler/intrinsics.py spells them out for the
compiler, which wouldn't find vector instructions for loops of eight or four by itself. tests/pipeline/test_simd.py
compares both.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, spelled_out
from ..compiler.widths import ID_BIT, LANES, PLANE_GROUP, POINT_UNIT

# Edge functions of a box up to so many samples wide and high fit 32 bits: 2 · (16 · 256) · (128 · 256) = 2^28.
MOST_WIDE, MOST_HIGH = 2 * LANES, 128


@spelled_out("build_merge_box")
def merge_box(entries, start, pitch, n_row, plane, edges, depth_mask):
    """Merge a box LANES samples wide into a visibility buffer: the inner loop of the scan stage for small triangles.

    Parameters
    ----------
    entries : (n,) int64, the visibility buffer, changed
    start, pitch : uint64, the box's first entry in it, and entries from row to row
    n_row : int64, the height of the box
    plane : (value, d/dx, d/dy) uint64, what is merged; it wraps
    edges : (value, d/dx, d/dy) of each of the three edge functions, nine int64; their lowest 32 bits count, >= 0 is
        inside
    depth_mask : int64, the bits of an entry that are compared
    """
    value, dx, dy = plane
    e0, e0_dx, e0_dy, e1, e1_dx, e1_dy, e2, e2_dx, e2_dy = edges
    for row in range(n_row):
        first = np.int64(start) + row * np.int64(pitch)
        for k in range(LANES):
            inside = (e0 + k * e0_dx + row * e0_dy) | (e1 + k * e1_dx + row * e1_dy) | (e2 + k * e2_dx + row * e2_dy)
            new = np.uint64(value + np.uint64(k) * dx + np.uint64(row) * dy).view(np.int64)
            if np.int32(inside) >= 0 and new < entries[first + k] & depth_mask:
                entries[first + k] = new


class PlaneGroup(NamedTuple):
    """Four planes of every record, side by side: PLANE_GROUP values, as many d/dx, as many d/dy; then, where samples
    must stay within a range, as many least and greatest values."""

    numbers: np.ndarray  # (n << shift,) float32, the records
    record_mask: int  # int64, the bits of an entry that are the index of a record
    shift: int  # uint64: a record begins at these bits shifted left
    column: int  # uint64, where the group begins in a record


@spelled_out("build_evaluate_planes")
def evaluate_planes(entries, group, x, y, out, start, stride):
    """Evaluate a group of four planes at every sample of a row: the inner loop of the shade stage.

    The second and third number of a record are whole ones: the sample at which its planes have their values. Float32 is
    rounded after each operation, in this order. Samples up to the next multiple of PLANE_GROUP may be read and written,
    too.

    Parameters
    ----------
    entries : (n,) int64; of those without the index of a record, the values of record 0
    group : PlaneGroup
    x, y : int64, the first sample
    out : float32, of any shape; counted through from `start` on, a row a plane, `stride` apart, both uint64
    """
    out, numbers = out.reshape(-1), group.numbers
    for k in range(len(entries)):
        record = record_number(entries[k], group)
        for i in range(PLANE_GROUP):
            plane = record + np.int64(group.column) + i
            out[np.int64(start) + i * np.int64(stride) + k] = value_at(numbers, record, plane, x + k, y)


@spelled_out("build_evaluate_values")
def evaluate_values(entries, group, x, y, out, start, stride, weights):
    """Evaluate a group of four planes as `evaluate_planes`, multiply, and keep values within their ranges.

    Parameters
    ----------
    entries : (n,) int64; of those without the index of a record, the values of record 0
    group : PlaneGroup with ranges
    weights : uint64, where in `out` the factors of the samples begin
    """
    out, numbers = out.reshape(-1), group.numbers
    for k in range(len(entries)):
        record = record_number(entries[k], group)
        for i in range(PLANE_GROUP):
            plane = record + np.int64(group.column) + i
            value = np.float32(value_at(numbers, record, plane, x + k, y) * out[np.int64(weights) + k])
            least, greatest = numbers[plane + 3 * PLANE_GROUP], numbers[plane + 4 * PLANE_GROUP]
            value = value if value > least else least
            out[np.int64(start) + i * np.int64(stride) + k] = value if value < greatest else greatest


@spelled_out("build_evaluate_planes")
def evaluate_planes_at(entries, group, x, y, out, start, stride):
    """Evaluate a group of four planes as `evaluate_planes`, at points that lie anywhere.

    Parameters
    ----------
    x, y : (n,) int32, where each point lies: 1/POINT_UNIT of a sample's width, from the first column and row of
        samples, and a multiple of 128 of them: a float32 holds how far it is from where the planes have their values
    """
    out, numbers = out.reshape(-1), group.numbers
    for k in range(len(entries)):
        record = record_number(entries[k], group)
        for i in range(PLANE_GROUP):
            plane = record + np.int64(group.column) + i
            out[np.int64(start) + i * np.int64(stride) + k] = value_at_point(numbers, record, plane, x[k], y[k])


@spelled_out("build_evaluate_values")
def evaluate_values_at(entries, group, x, y, out, start, stride, weights):
    """Evaluate a group of four planes as `evaluate_values`, at points that lie anywhere, see `evaluate_planes_at`."""
    out, numbers = out.reshape(-1), group.numbers
    for k in range(len(entries)):
        record = record_number(entries[k], group)
        for i in range(PLANE_GROUP):
            plane = record + np.int64(group.column) + i
            value = np.float32(value_at_point(numbers, record, plane, x[k], y[k]) * out[np.int64(weights) + k])
            least, greatest = numbers[plane + 3 * PLANE_GROUP], numbers[plane + 4 * PLANE_GROUP]
            value = value if value > least else least
            out[np.int64(start) + i * np.int64(stride) + k] = value if value < greatest else greatest


@helper
def record_number(entry, group):
    """Return where the record that an entry shows begins; 0 where it shows none."""
    mask = group.record_mask if entry >> ID_BIT & 1 else np.int64(0)
    return (entry & mask) << np.int64(group.shift)


@helper
def value_at(numbers, record, plane, x, y):
    """Return the value of a plane at the sample (x, y); `record` and `plane` are where the two begin in `numbers`."""
    whole = numbers.view(np.int32)
    return value_beside(numbers, plane, np.float32(x - whole[record + 1]), np.float32(y - whole[record + 2]))


@helper
def value_at_point(numbers, record, plane, x, y):
    """Return the value of a plane at the point (x, y), 1/256 of a sample's width."""
    whole, part = numbers.view(np.int32), np.float32(1.0 / POINT_UNIT)
    across, down = np.int64(x) - POINT_UNIT * whole[record + 1], np.int64(y) - POINT_UNIT * whole[record + 2]
    return value_beside(numbers, plane, np.float32(np.float32(across) * part), np.float32(np.float32(down) * part))


@helper
def value_beside(numbers, plane, across, down):
    """Return the value of a plane beside the sample where it has its value; float32 is rounded after each operation."""
    real = np.float32
    value = real(numbers[plane] + real(across * numbers[plane + PLANE_GROUP]))
    return real(value + real(down * numbers[plane + 2 * PLANE_GROUP]))
