"""Compare two groups of planes that are evaluated together with the same groups one by one, bit for bit."""

import numba
import numpy as np
import pytest

from rasterizer.compiler.kernels import index, kernel
from rasterizer.pipeline.screen_points import (
    ScreenPoints,
    evaluate_planes_here,
    evaluate_slopes_here,
    evaluate_with_slopes,
)
from rasterizer.pipeline.simd import PlaneGroup

STRIDE, START, START_BEHIND = 160, 5, 3


@kernel
def evaluate_both(entries, group, first, out, start, stride, behind, behind_start):
    """Call evaluate_with_slopes from a kernel."""
    evaluate_with_slopes(entries, group, first, out, start, stride, behind, behind_start)


@kernel
def evaluate_each(entries, group, group_behind, first, out, behind):
    """Evaluate one group after the other."""
    evaluate_planes_here(entries, group, first, out, index(START), index(STRIDE))
    evaluate_slopes_here(entries, group_behind, first, behind, index(START_BEHIND), index(STRIDE))


WAYS = {
    "vectors": evaluate_both,
    "plain": np.errstate(all="ignore")(evaluate_with_slopes.py_func),
    "compiled": numba.njit(evaluate_with_slopes.py_func),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("is_list", [False, True])
@pytest.mark.parametrize("n", [0, 1, 3, 4, 5, 64, 127])
def test_two_groups_together_are_what_they_are_alone(n, is_list, way):
    rng, shift, n_record, mask = np.random.default_rng(n), 5, 40, (1 << 23) - 1
    numbers = rng.standard_normal(n_record << shift).astype(np.float32)
    numbers.view(np.int32).reshape(n_record, -1)[:, 1:3] = rng.integers(-300, 300, (n_record, 2))
    entries = (rng.integers(0, 2**38, 128) << 25 | 1 << 24 | rng.integers(0, n_record, 128)).astype(np.int64)[:n]
    entries[::5] &= ~np.int64(1 << 24)  # intensities: record 0 is read, whatever the bits say
    first = np.int64(11), np.int64(-3)
    if is_list:
        x, y = (128 * rng.integers(-500, 500, (2, 128))).astype(np.int32)
        first = ScreenPoints(x, y, 2.0)
    group, group_behind = (
        PlaneGroup(numbers, np.int64(mask), np.uint64(shift), np.uint64(column)) for column in (4, 16)
    )
    out, behind = np.full((2, 2, 10 * STRIDE + 8), 7, np.float32)
    WAYS[way](
        entries, group, first, out[0], np.uint64(START), np.uint64(STRIDE), behind[0], np.uint64(START_BEHIND)
    )  # fmt: skip
    evaluate_each(entries, group, group_behind, first, out[1], behind[1])
    for start, n_row, (found, expected) in ((START, 4, out), (START_BEHIND, 10, behind)):
        untouched = np.ones(len(found), bool)
        for row in range(n_row):
            left = start + row * STRIDE
            same = found[left : left + n].view(np.int32) == expected[left : left + n].view(np.int32)
            assert same.all(), f"row {row} differs at {np.flatnonzero(~same)[:8]}"
            untouched[left : left + -(-n // 4) * 4] = False
        assert (found[untouched] == 7).all(), "wrote beyond the next multiple of four"
