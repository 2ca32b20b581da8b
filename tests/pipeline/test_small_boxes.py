"""Check which samples small triangles cover, against the reference, and how they are merged."""

import numpy as np
import pytest
from helpers.stages import random_triangles, slivers
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer.pipeline import fill, small_boxes
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


corner = st.tuples(
    *(st.one_of(st.integers(-400, 256 * n + 400), st.integers(-2, 2 * n + 2).map(lambda k: 128 * k)) for n in SIZE)
)


@settings(deadline=None, max_examples=400)
@given(corner, st.lists(st.tuples(st.integers(-700, 700), st.integers(-700, 700)), min_size=2, max_size=2))
def test_covered_samples_are_those_of_the_reference(first, steps):
    check([first, *((first[0] + dx, first[1] + dy) for dx, dy in steps)])


def test_soups_and_slivers_are_covered_as_the_reference_says():
    rng = np.random.default_rng(1)
    parts = [random_triangles(rng, 600, SIZE, reach) for reach in (0.2, 0.6, 1.4)]
    parts += [random_triangles(rng, 600, SIZE, 1.4) // 128 * 128, slivers(rng, 600, SIZE, 1, 2)]
    counts = [check(triangle) for triangle in np.concatenate(parts)]
    n = [counts.count(k) for k in range(4)]
    assert min(n) > 20, f"triangles with 0..3 covered samples: {n}"


def test_edge_functions_are_those_of_the_scan_stage():
    rng = np.random.default_rng(2)
    for xa, ya, xb, yb, sx, sy in rng.integers(-700, 700, (500, 6)).tolist():
        expected = fill.edge_function(xa, ya, xb, yb, sx, sy)
        given_numbers = [np.int32(v) for v in (xa, ya, xb, yb)]
        for a, b, side in ((given_numbers[:2], given_numbers[2:], 1), (given_numbers[2:], given_numbers[:2], -1)):
            found = small_boxes.edge_function(*a, *b, np.int32(side), np.int32(sx), np.int32(sy))
            assert tuple(map(int, found)) == expected


@pytest.mark.parametrize("seed", range(20))
def test_covered_samples_are_merged_as_entries_are(seed):
    rng = np.random.default_rng(seed)
    pitch, first = 11, 14
    entries = rng.integers(0, 2**62, 60)
    entries[::3] = CLEAR
    value, dx, dy = (int(v) for v in rng.integers(-(2**60), 2**60, 3))
    covered = int(sum(1 << (x + NEXT_ROW * y) for x in range(MOST_WIDE) for y in range(MOST_WIDE) if rng.integers(2)))
    expected = entries.copy()
    for y in range(MOST_WIDE):
        for x in range(MOST_WIDE):
            new = (value + x * dx + y * dy + 2**63) % 2**64 - 2**63
            at = first + x + y * pitch
            if covered >> (x + NEXT_ROW * y) & 1 and new < expected[at] & int(DEPTH_MASK):
                expected[at] = new
    with np.errstate(over="ignore"):
        fill_covered(entries, first, pitch, np.int32(covered), tuple(np.uint64(v % 2**64) for v in (value, dx, dy)))
    assert (entries == expected).all()
