"""Compare the vector loops with plain Python, wrap-around and rounding included, and so what stands in for them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer.compiler.kernels import kernel
from rasterizer.pipeline.fragments import NEXT
from rasterizer.pipeline.samples import (
    PLANE_GROUP,
    PlaneGroup,
    evaluate_planes,
    evaluate_slopes,
    evaluate_values,
    evaluate_with_slopes,
)
from rasterizer.pipeline.scan import fill_span, merge_box
from rasterizer.pipeline.visibility import IS_WEIGHTED, LANES

PITCH, ROWS = 21, 6


@kernel
def merge(packed, start, pitch, n_row, plane, edges, depth_mask):
    """Call merge_box from a kernel, as the scan stage does."""
    merge_box(packed, start, pitch, n_row, plane, edges, depth_mask)


def merge_plainly(packed, start, pitch, n_row, word, edges, depth_mask):
    """The same loop with Python's integers, cut to 64 and 32 bits where the vectors are."""
    packed = list(packed)
    for row in range(n_row):
        for k in range(LANES):
            new = signed(word[0] + k * word[1] + row * word[2], 64)
            inside = [signed(edges[e] + k * edges[e + 1] + row * edges[e + 2], 32) >= 0 for e in (0, 3, 6)]
            place = start + row * pitch + k
            if all(inside) and new < packed[place] & depth_mask:
                packed[place] = new
    return packed


def as_plain(function, **warnings):
    """A kernel as it is with the JIT switched off."""
    return np.errstate(**warnings)(getattr(function, "py_func", function))


def signed(value, bits):
    """The lowest bits of an integer, in two's complement."""
    return (value + (1 << bits - 1)) % (1 << bits) - (1 << bits - 1)


def assert_same(packed, start, n_row, word, edges, depth_mask):
    """Merge by vectors, and as with the JIT switched off; return how many packed samples changed."""
    expected = merge_plainly(packed, start, PITCH, n_row, word, edges, depth_mask)
    for way in (merge, as_plain(merge, over="ignore")):
        array = np.array(packed, np.int64)
        way(
            array, np.int64(start), np.int64(PITCH), n_row, tuple(np.uint64(w % 2**64) for w in word),
            tuple(np.int64(e) for e in edges), np.int64(depth_mask),
        )  # fmt: skip
        assert array.tolist() == expected
    return sum(a != b for a, b in zip(packed, expected, strict=True))


whole = st.integers(-(2**63), 2**63 - 1)
edge = st.one_of(
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-3, 3),
    st.sampled_from([2**31 - 1, -(2**31), 2**28, -(2**28)]),
)
masks = st.sampled_from([-1, -(1 << 25), -(1 << 24), -(1 << 62), 0])


@settings(max_examples=40, deadline=None)
@given(st.data(), st.integers(0, 8), st.integers(0, ROWS), masks, st.booleans())
def test_boxes_of_any_bits_are_merged_as_plain_python_does(data, start, n_row, mask, is_open):
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    packed = rng.integers(-(2**63), 2**63 - 1, PITCH * ROWS).tolist()
    word = data.draw(st.tuples(whole, whole, whole))
    edges = [0] * 9 if is_open else data.draw(st.lists(edge, min_size=9, max_size=9))
    assert_same(packed, start, n_row, word, edges, mask)


@kernel
def fill(packed, start, end, first, step, depth_mask):
    """Call fill_span from a kernel, as the scan stage does."""
    fill_span(packed[start:end], first, step, depth_mask)


@settings(max_examples=40, deadline=None)
@given(st.data(), st.integers(0, LANES), st.integers(1, 5 * LANES + 1), masks)
def test_spans_of_any_length_are_merged_as_plain_python_does_and_nothing_beside_them(data, start, n, mask):
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    packed = rng.integers(-(2**63), 2**63 - 1, start + n + 2 * LANES).tolist()
    value, step = data.draw(whole), data.draw(st.one_of(whole, st.integers(-3, 3)))
    expected = list(packed)
    for k in range(n):
        new = signed(value + k * step, 64)
        expected[start + k] = new if new < packed[start + k] & mask else packed[start + k]
    for way in (fill, as_plain(fill, over="ignore")):
        array = np.array(packed, np.int64)
        first, end = np.int64(start), np.int64(start + n)
        way(array, first, end, np.uint64(value % 2**64), np.uint64(step % 2**64), np.int64(mask))
        assert array.tolist() == expected


# ---------------------------------------------------------------- planes

PLANES, VALUES, SLOPES, BOTH = range(4)


@kernel
def evaluate(form, packed, group, first, out, places, behind):
    """Evaluate planes in one of the ways in which the shade stage does, from a kernel."""
    start, weights, behind_start = places
    if form == PLANES:
        evaluate_planes(packed, group, first, out, start)
    elif form == VALUES:
        evaluate_values(packed, group, first, out, start, weights)
    elif form == SLOPES:
        evaluate_slopes(packed, group, first, out, start)
    else:
        evaluate_with_slopes(packed, group, first, out, start, behind, behind_start)


WAYS = {"vectors": evaluate, "plain": as_plain(evaluate, over="ignore", invalid="ignore")}
ID_BIT, N_SETUP, UNIT_SHIFT = 24, 40, 4
SETUP_MASK = (1 << 24) - 4  # as in the pipeline: bit 0 says whether a setup is exact, bit 1 whether it is weighted
START, START_BEHIND, WEIGHTS = 5, 3, 5 + 10 * NEXT
PLACES = tuple(np.int64(place) for place in (START, WEIGHTS, START_BEHIND))


def group_of(numbers, column):
    """A PlaneGroup with the types that kernels take."""
    return PlaneGroup(numbers, np.int64(SETUP_MASK), np.int64(UNIT_SHIFT - 2), np.int64(column))


def random_setups(rng, n_unit):
    """Setups of `n_unit` units of 16 numbers each, (N_SETUP * n_unit, 16) float32: anchors, planes and ranges."""
    numbers = rng.normal(size=(N_SETUP, 16 * n_unit)).astype(np.float32)
    for column in range(16, 16 * n_unit - 19, 4):
        limits = np.sort(rng.normal(size=(N_SETUP, 2, 4)) * 2.0**20, axis=1)
        limits[::3, 1] = limits[::3, 0]  # a constant
        numbers[:, column : column + 8] = limits.reshape(N_SETUP, 8)
    numbers = numbers.reshape(-1, 16)
    numbers.view(np.int32)[:, 1:3] = rng.integers(-(2**20), 2**20, (len(numbers), 2))
    return numbers.ravel()


def random_packed(rng, n, n_unit):
    """Packed samples that hold indices of setups, some of exact or weighted ones, others that hold intensities, and
    clear ones."""
    setup = n_unit * rng.integers(0, N_SETUP - 1, n) << 2 | rng.integers(0, 4, n)
    packed = rng.integers(0, 2**38, n) << 25 | 1 << ID_BIT | setup
    levels = rng.integers(0, 2**38, n) << 25 | rng.integers(0, 1 << ID_BIT, n)
    packed = np.where(rng.random(n) < 0.3, levels, packed)
    packed[rng.random(n) < 0.1] = ((1 << 38) - 1) << 25
    return packed.astype(np.int64)


def evaluate_plainly(packed, group, column, first, n_row, weights=None):
    """The rows (4 or 10, n) float32 that a group at `column` gives: numpy rounds after each operation.

    Of packed samples without a setup's index, the values of setup 0.
    """
    numbers, whole, k = group.numbers, group.numbers.view(np.int32), np.arange(len(packed))
    setup = np.where(packed >> ID_BIT & 1, packed & SETUP_MASK, 0) << (UNIT_SHIFT - 2)
    across, down = (np.float32(place - whole[setup + 1 + axis]) for axis, place in enumerate((first[0] + k, first[1])))
    part = numbers[(setup + column)[:, None] + np.arange(5 * PLANE_GROUP)].reshape(-1, 5, PLANE_GROUP)
    rows = ((part[:, 0] + across[:, None] * part[:, 1]) + down[:, None] * part[:, 2]).T
    if weights is not None:
        rows = rows * weights[k]
        is_weighted = (packed & IS_WEIGHTED).astype(bool)
        least, greatest = (np.where(is_weighted, part[:, k].T, end) for k, end in ((3, -np.inf), (4, np.inf)))
        rows = np.where(rows > least, rows, least)
        rows = np.where(rows < greatest, rows, greatest).astype(np.float32)
    return np.concatenate([rows, part[:, 1, :3].T, part[:, 2, :3].T])[:n_row]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("form", [PLANES, VALUES, SLOPES, BOTH], ids=["planes", "values", "slopes", "both"])
def test_planes_are_those_of_plain_python(form, way):
    """Also of packed samples that hold intensities, or nothing. Nothing is written beyond the next multiple of
    LANES."""
    for case, n in enumerate((0, 1, 3, 4, 5, 64, 127)):
        rng = np.random.default_rng(n)
        column, n_unit = ((4, 3), (16, 3))[case % 2] if form != BOTH else (4, 3)
        group, packed = group_of(random_setups(rng, n_unit), column), random_packed(rng, 128, n_unit)[:n]
        weights = np.float32(rng.uniform(0.5, 2.0**20, 128))
        first = np.int64(1900), np.int64(33)
        out, behind = np.full((2, WEIGHTS + 128), 7, np.float32)
        out[WEIGHTS:] = weights
        before = out.copy(), behind.copy()
        WAYS[way](form, packed, group, first, out, PLACES, behind)
        written = [(out, START, column, (4, 4, 10, 4)[form])]
        written += [(behind, START_BEHIND, column + 12, 10)] if form == BOTH else []
        for array, start, plane, n_row in written:
            expected = evaluate_plainly(packed, group, plane, first, n_row, weights if form == VALUES else None)
            for row in range(n_row):
                left = start + row * NEXT
                found = array[left : left + n]
                same = found.view(np.int32) == np.ascontiguousarray(expected[row]).view(np.int32)
                assert same.all(), f"{n} samples, row {row}: {found[~same][:4]} != {expected[row][~same][:4]}"
                array[left : left + -(-n // LANES) * LANES] = 7
        assert (out == before[0]).all() and (behind == before[1]).all(), f"{n} samples: wrote beyond them"
