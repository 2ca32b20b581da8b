"""Two inner loops as vector instructions: a small box of samples, and the planes of the samples of a row.

They stand here in Python, which is what runs with the JIT switched off; compiler/intrinsics.py spells them out for the
compiler, which wouldn't find vector instructions for loops of eight or four by itself. tests/pipeline/test_simd.py
compares both.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, spelled_out
from ..compiler.widths import ID_BIT, LANES, PLANE_GROUP

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
    out : (n,) float32; written from `start` on, a row a plane, `stride` apart, both uint64
    """
    numbers, whole = group.numbers, group.numbers.view(np.int32)
    for k in range(index(len(entries))):
        record = record_number(entries[k], group)
        across, down = np.float32(x + np.int64(k) - whole[record + index(1)]), np.float32(y - whole[record + index(2)])
        values = values_of_planes(numbers, record + group.column, across, down)
        for i in range(PLANE_GROUP):
            out[start + index(i) * stride + k] = values[i]


@helper
def record_number(entry, group):
    """Return where the record that an entry shows begins, an `index`; 0 where it shows none."""
    mask = group.record_mask if entry >> ID_BIT & 1 else np.int64(0)
    return index(entry & mask) << group.shift


@helper
def values_of_planes(numbers, plane, across, down):
    """Return the values of four planes beside the sample where they have their values; float32 is rounded after each
    operation."""
    return (
        value_beside(numbers, plane, across, down),
        value_beside(numbers, plane + index(1), across, down),
        value_beside(numbers, plane + index(2), across, down),
        value_beside(numbers, plane + index(3), across, down),
    )


@helper
def value_beside(numbers, plane, across, down):
    """Return the value of one plane, see `values_of_planes`."""
    value = numbers[plane] + across * numbers[plane + index(PLANE_GROUP)]
    return value + down * numbers[plane + index(2 * PLANE_GROUP)]
