"""Two inner loops as vector instructions: a small box of samples, and the planes of one sample.

They stand here in Python, which is what runs with the JIT switched off; compiler/intrinsics.py spells them out for the
compiler, which wouldn't find vector instructions for loops of eight or four by itself. tests/pipeline/test_simd.py
compares both.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import spelled_out
from ..compiler.widths import LANES, PLANE_GROUP

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
    """Four planes of every record, side by side: PLANE_GROUP values, as many d/dx, as many d/dy."""

    numbers: np.ndarray  # (n << shift,) int32 or float32, the records, 2^shift numbers each
    record_mask: int  # int64, the bits of an entry that are the index of a record
    shift: int  # uint64
    column: int  # uint64, where the group begins in a record
    scale: float  # what integers are multiplied by at the end, in the type of the output


@spelled_out("build_evaluate_planes")
def evaluate_planes(entries, group, x, y, out, start, stride):
    """Evaluate a group of four planes at every sample of a row: the inner loop of the shade stage.

    The second and third number of a record are whole ones whatever the others are: the sample at which its planes have
    their values. Int32 wraps and is multiplied by the scale at the end, and its fourth plane is left out. Float32 is
    rounded after each operation, in this order. Samples up to the next multiple of PLANE_GROUP may be read and written,
    too.

    Parameters
    ----------
    entries : (n,) int64, which hold indices of records
    group : PlaneGroup
    x, y : int64, the first sample
    out : float32 or float64, of any shape; counted through from `start` on, a row a plane, `stride` apart, both uint64
    """
    out = out.reshape(-1)
    numbers = group.numbers
    kind, real, whole = numbers.dtype.type, out.dtype.type, numbers.view(np.int32)
    is_integer = numbers.dtype.kind == "i"
    for k in range(len(entries)):
        record = (entries[k] & group.record_mask) << np.int64(group.shift)
        across, down = kind(x + k - whole[record + 1]), kind(y - whole[record + 2])
        for i in range(PLANE_GROUP - 1 if is_integer else PLANE_GROUP):
            plane = record + np.int64(group.column) + i
            value = kind(numbers[plane] + kind(across * numbers[plane + PLANE_GROUP]))
            value = kind(value + kind(down * numbers[plane + 2 * PLANE_GROUP]))
            target = np.int64(start) + i * np.int64(stride) + k
            out[target] = real(value) * group.scale if is_integer else real(value)
