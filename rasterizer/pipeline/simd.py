"""Two inner loops as vector instructions: a small box of samples, and the planes of one sample.

They stand here in Python, which is what runs with the JIT switched off; compiler/simd_ops.py spells them out for the
compiler, which wouldn't find vector instructions for loops of eight or four by itself. tests/pipeline/test_simd.py
compares both.
"""

import numpy as np

from ..compiler.internals import lowered_by
from ..compiler.simd_ops import GROUP, LANES, build_merge_box, build_take_planes

# Edge functions of a box up to so many samples wide and high fit 32 bits: 2 · (16 · 256) · (128 · 256) = 2^28.
MOST_WIDE, MOST_HIGH = 2 * LANES, 128


@lowered_by(build_merge_box)
def merge_box(words, start, pitch, n_row, word, edges, depth_mask):
    """Merge a box LANES samples wide into a z-buffer: the inner loop of the scan stage for small triangles.

    Parameters
    ----------
    words : (n,) int64, the z-buffer, changed
    start, pitch : uint64, the box's first sample in it, and samples from row to row
    n_row : int64, the height of the box
    word : (value, d/dx, d/dy) uint64, what is merged; it wraps
    edges : (value, d/dx, d/dy) of each of the three edge functions, nine int64; their lowest 32 bits count
    depth_mask : int64, the bits of a word that are compared
    """
    value, value_x, value_y = word
    e0, e0_x, e0_y, e1, e1_x, e1_y, e2, e2_x, e2_y = edges
    for row in range(n_row):
        first = np.int64(start) + row * np.int64(pitch)
        for k in range(LANES):
            inside = (e0 + k * e0_x + row * e0_y) | (e1 + k * e1_x + row * e1_y) | (e2 + k * e2_x + row * e2_y)
            new = np.uint64(value + np.uint64(k) * value_x + np.uint64(row) * value_y).view(np.int64)
            if np.int32(inside) >= 0 and new < words[first + k] & depth_mask:
                words[first + k] = new


@lowered_by(build_take_planes)
def take_planes(words, n, record_mask, numbers, shift, column, x, y, scale, out, place, stride):
    """Evaluate a group of four planes at every sample of a row: the inner loop of the shade stage.

    Samples up to the next multiple of GROUP may be read and written, too.

    Parameters
    ----------
    words : (n,) int64; with `record_mask` and `shift` they tell where a sample's record begins in `numbers`
    n : uint64, samples
    numbers : int32 or float32, the records; the second and third of each are whole numbers whatever the others are: the
        sample at which its planes have their values. Int32 wraps and is multiplied by `scale` at the end, and its
        fourth plane is left out. Float32 is rounded after each operation, in this order
    column : uint64, where the planes begin in a record: GROUP values, GROUP times d/dx, GROUP times d/dy
    x, y : int64, the first sample, px
    scale : as `out`
    out : float32 or float64, a row a plane, `stride` apart, from `place` on
    """
    kind, real, whole = numbers.dtype.type, out.dtype.type, numbers.view(np.int32)
    is_integer = numbers.dtype.kind == "i"
    for k in range(np.int64(n)):
        record = (words[k] & record_mask) << np.int64(shift)
        across, down = kind(x + k - whole[record + 1]), kind(y - whole[record + 2])
        for i in range(GROUP - 1 if is_integer else GROUP):
            plane = record + np.int64(column) + i
            value = kind(numbers[plane] + kind(across * numbers[plane + GROUP]))
            value = kind(value + kind(down * numbers[plane + 2 * GROUP]))
            out[np.int64(place) + i * np.int64(stride) + k] = real(value) * scale if is_integer else real(value)
