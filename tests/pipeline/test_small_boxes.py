"""Check which samples small triangles cover, against the reference, and how they are merged."""

import numpy as np
from helpers.stages import random_triangles, slivers

from rasterizer.pipeline.cull import first_sample
from rasterizer.pipeline.small_boxes import MOST_WIDE, NEXT_ROW, fill_covered, find_covered, is_any_covered
from rasterizer.pipeline.visibility import CLEAR, DEPTH_MASK
from rasterizer.reference import coverage

SIZE = (9, 7)


def clockwise(triangle):
    """The triangle, clockwise on the screen, and 1 if it was so already, else -1; 0 without area."""
    (ax, ay), (bx, by), (cx, cy) = triangle
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    return (triangle if area >= 0 else triangle[::-1]), int(np.sign(area))


def box_of(triangle):
    """First and end column, first and end row of the samples in the box."""
    (left, right), (top, bottom) = (
        (int(first_sample.py_func(min(v))), int(first_sample.py_func(max(v)))) for v in zip(*triangle, strict=True)
    )
    return left, right, top, bottom


def numbers(triangle):
    return tuple(np.int32(v) for corner in triangle for v in corner)


def check(triangle):
    """Hold a triangle to the reference; return how many samples it covers, or None if its box isn't small."""
    triangle = [tuple(map(int, corner)) for corner in triangle]
    turned, side = clockwise(triangle)
    left, right, top, bottom = box_of(triangle)
    left, right, top, bottom = max(left, 0), min(right, SIZE[0]), max(top, 0), min(bottom, SIZE[1])
    whole = box_of(triangle)
    if side == 0 or left >= right or top >= bottom or max(whole[1] - whole[0], whole[3] - whole[2]) > MOST_WIDE:
        return None
    expected = coverage(np.array(triangle), *SIZE)
    found = int(find_covered(numbers(turned), *map(np.int32, (left, top, right, bottom))))
    samples = np.zeros_like(expected)
    for bit in range(NEXT_ROW * MOST_WIDE):
        if found >> bit & 1:
            samples[top + bit // NEXT_ROW, left + bit % NEXT_ROW] = True
    assert (samples == expected).all(), f"{triangle}: {found:b}"
    anywhere = is_any_covered(numbers(triangle), np.int32(side), np.int32(left), np.int32(top))
    assert anywhere or not expected.any(), f"{triangle} covers samples"
    if whole == (left, right, top, bottom):
        assert anywhere == expected.any()
    return int(expected.sum())


def test_soups_and_slivers_are_covered_as_the_reference_says():
    rng = np.random.default_rng(1)
    parts = [random_triangles(rng, 150, SIZE, reach) for reach in (0.2, 0.6, 1.4)]
    parts += [random_triangles(rng, 150, SIZE, 1.4) // 128 * 128, slivers(rng, 150, SIZE, 1, 2)]
    counts = [check(triangle) for triangle in np.concatenate(parts)]
    n = [counts.count(k) for k in range(4)]
    assert min(n) > 5, f"triangles with 0..3 covered samples: {n}"


def test_covered_samples_are_merged_as_entries_are():
    for seed in range(6):
        rng = np.random.default_rng(seed)
        pitch, first = 11, 14
        entries = rng.integers(0, 2**62, 60)
        entries[::3] = CLEAR
        value, dx, dy = (int(v) for v in rng.integers(-(2**60), 2**60, 3))
        places = [(x, y) for x in range(MOST_WIDE) for y in range(MOST_WIDE) if rng.integers(2)]
        covered, expected = sum(1 << (x + NEXT_ROW * y) for x, y in places), entries.copy()
        for x, y in places:
            new = (value + x * dx + y * dy + 2**63) % 2**64 - 2**63
            at = first + x + y * pitch
            expected[at] = new if new < expected[at] & int(DEPTH_MASK) else expected[at]
        with np.errstate(over="ignore"):
            fill_covered(entries, first, pitch, np.int32(covered), tuple(np.uint64(v % 2**64) for v in (value, dx, dy)))
        assert (entries == expected).all(), f"seed {seed}, samples {places}"
