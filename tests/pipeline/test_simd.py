"""Compare the vector loops with plain Python, wrap-around and rounding included, and so what stands in for them."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer.compiler.kernels import kernel
from rasterizer.pipeline.simd import (
    LANES,
    PLANE_GROUP,
    PlaneGroup,
    evaluate_planes,
    evaluate_planes_at,
    evaluate_values,
    evaluate_values_at,
    merge_box,
)

PITCH, ROWS = 21, 6


@kernel
def merge(entries, start, pitch, n_row, plane, edges, depth_mask):
    """Call merge_box from a kernel, as the scan stage does."""
    merge_box(entries, start, pitch, n_row, plane, edges, depth_mask)


# As vector instructions, in Python with the JIT switched off, and where numba's version is unknown.
MERGES = merge, np.errstate(over="ignore")(merge_box.py_func), numba.njit(merge_box.py_func)


def merge_plainly(entries, start, pitch, n_row, word, edges, depth_mask):
    """The same loop with Python's integers, cut to 64 and 32 bits where the vectors are."""
    entries = list(entries)
    for row in range(n_row):
        for k in range(LANES):
            new = signed(word[0] + k * word[1] + row * word[2], 64)
            inside = [signed(edges[e] + k * edges[e + 1] + row * edges[e + 2], 32) >= 0 for e in (0, 3, 6)]
            place = start + row * pitch + k
            if all(inside) and new < entries[place] & depth_mask:
                entries[place] = new
    return entries


def signed(value, bits):
    """The lowest bits of an integer, in two's complement."""
    return (value + (1 << bits - 1)) % (1 << bits) - (1 << bits - 1)


def assert_same(entries, start, n_row, word, edges, depth_mask):
    """Merge in all ways; return how many entries changed."""
    expected = merge_plainly(entries, start, PITCH, n_row, word, edges, depth_mask)
    for way in MERGES:
        array = np.array(entries, np.int64)
        way(
            array, np.uint64(start), np.uint64(PITCH), n_row, tuple(np.uint64(w % 2**64) for w in word),
            tuple(np.int64(e) for e in edges), np.int64(depth_mask),
        )  # fmt: skip
        assert array.tolist() == expected
    return sum(a != b for a, b in zip(entries, expected, strict=True))


whole = st.integers(-(2**63), 2**63 - 1)
edge = st.one_of(
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-3, 3),
    st.sampled_from([2**31 - 1, -(2**31), 2**28, -(2**28)]),
)
masks = st.sampled_from([-1, -(1 << 25), -(1 << 24), -(1 << 62), 0])


@settings(max_examples=300, deadline=None)
@given(st.data(), st.integers(0, 8), st.integers(0, ROWS), masks, st.booleans())
def test_any_bits_give_what_plain_python_gives(data, start, n_row, mask, is_open):
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    entries = rng.integers(-(2**63), 2**63 - 1, PITCH * ROWS).tolist()
    word = data.draw(st.tuples(whole, whole, whole))
    edges = [0] * 9 if is_open else data.draw(st.lists(edge, min_size=9, max_size=9))
    assert_same(entries, start, n_row, word, edges, mask)


def test_steps_run_through_the_wrap_around():
    """A depth that passes 2^63, and edge functions that pass 2^31, along a row and between rows."""
    entries = [2**63 - 1] * (PITCH * ROWS)
    top = 2**63 - 4 * 2**40
    n_changed = [
        assert_same(entries, 3, ROWS, (top, 2**40, 3), [0] * 9, -(1 << 25)),
        assert_same(entries, 3, ROWS, (top, 5, 2**41), [0] * 9, -(1 << 25)),
        assert_same(entries, 3, ROWS, (0, 1, 8), [2**31 - 5, 1, 0, 0, 0, 0, 0, 0, 0], -1),
        assert_same(entries, 3, ROWS, (0, 1, 8), [0, 0, 0, 2**31 - 3, 0, 1, -(2**31), -1, 0], -1),
    ]
    # The first two wrap to small numbers, which are nearer; the others leave the inside, or enter it.
    assert n_changed == [LANES * ROWS, LANES * ROWS, 5 * ROWS, 3 * 7]


@pytest.mark.parametrize("level", [0, 1, 2**25 - 1])
def test_at_equal_depth_the_earlier_entry_stays(level):
    """Payloads differ, depths are equal: nothing is written; one step nearer: everything."""
    mask = -(1 << 25)
    entries = [(7 << 25) + level] * (PITCH * ROWS)
    assert assert_same(entries, 0, ROWS, ((7 << 25), 0, 0), [0] * 9, mask) == 0
    assert assert_same(entries, 0, ROWS, ((7 << 25) - 1, 0, 0), [0] * 9, mask) == LANES * ROWS


def test_a_sample_on_an_edge_is_inside_and_nothing_else_is_touched():
    entries = list(range(10**6, 10**6 + PITCH * ROWS))
    for e in range(3):
        for value, expected in ((0, LANES * ROWS), (-1, 0)):
            edges = [5, 0, 0] * 3
            edges[3 * e] = value
            assert assert_same(entries, 4, ROWS, (1, 0, 0), edges, -1) == expected
    assert assert_same(entries, 4, 0, (1, 0, 0), [0] * 9, -1) == 0


@kernel
def evaluate(entries, group, x, y, out, start, stride):
    """Call evaluate_planes from a kernel, as the shade stage does."""
    evaluate_planes(entries, group, x, y, out, start, stride)


EVALUATIONS = (
    evaluate,
    np.errstate(over="ignore")(evaluate_planes.py_func),
    numba.njit(evaluate_planes.py_func),
)


@kernel
def evaluate_within(entries, group, x, y, out, start, stride, weights):
    """Call evaluate_values from a kernel, as the shade stage does."""
    evaluate_values(entries, group, x, y, out, start, stride, weights)


WITHIN = (
    evaluate_within,
    np.errstate(over="ignore", invalid="ignore")(evaluate_values.py_func),
    numba.njit(evaluate_values.py_func),
)
WAYS, ID_BIT = ["vectors", "plain", "compiled"], 24


def evaluate_plainly(entries, group, x, y, out, start, stride, weights=None):
    """The same loop with numpy's float32, which rounds after every operation; within ranges where there are weights.

    x and y are the first sample, or arrays of points in 1/256 of a sample.
    """
    xs = 256 * (x + np.arange(len(entries))) if np.ndim(x) == 0 else x
    ys = np.broadcast_to(256 * y, len(entries)) if np.ndim(y) == 0 else y
    numbers, column, shift = group.numbers, int(group.column), int(group.shift)
    out, whole, real = out.copy(), numbers.view(np.int32), np.float32
    for k in range(len(entries)):
        record = int(entries[k]) & int(group.record_mask)
        if not int(entries[k]) >> ID_BIT & 1:
            record = 0
        record <<= shift
        across = real(int(xs[k]) / 256 - int(whole[record + 1]))
        down = real(int(ys[k]) / 256 - int(whole[record + 2]))
        for i in range(PLANE_GROUP):
            value, dx, dy = (numbers[record + column + part * PLANE_GROUP + i] for part in range(3))
            value = value + across * dx + down * dy
            if weights is not None:
                least, greatest = (numbers[record + column + part * PLANE_GROUP + i] for part in (3, 4))
                value = value * out[weights + k]
                value = value if value > least else least
                value = value if value < greatest else greatest
            out[start + i * stride + k] = value
    return out


def plane_group(numbers, record_mask, shift, column):
    """A PlaneGroup with the types that kernels take."""
    return PlaneGroup(numbers, np.int64(record_mask), np.uint64(shift), np.uint64(column))


N_RECORD, UNIT_SHIFT, RECORD_MASK = 40, 4, (1 << 24) - 2  # as in the pipeline: bit 0 says whether a record is exact


def random_records(rng, n_unit):
    """Records of `n_unit` units of 16 numbers each, with anchors, as float32."""
    numbers = rng.normal(size=N_RECORD * n_unit << UNIT_SHIFT).astype(np.float32)
    heads = numbers.view(np.int32).reshape(N_RECORD * n_unit, -1)[:, 1:3]
    heads[:] = rng.integers(-(2**20), 2**20, heads.shape)
    return numbers


def random_entries(rng, n, n_unit, has_others):
    """Entries that hold indices of records, some of exact ones; with others that hold intensities, and clear ones."""
    record = n_unit * rng.integers(0, N_RECORD - 1, n) << 1 | rng.integers(0, 2, n)
    entries = rng.integers(0, 2**38, n) << 25 | 1 << ID_BIT | record
    if has_others:
        levels = rng.integers(0, 2**38, n) << 25 | rng.integers(0, 1 << ID_BIT, n)
        entries = np.where(rng.random(n) < 0.3, levels, entries)
        entries[rng.random(n) < 0.1] = ((1 << 38) - 1) << 25
    return entries.astype(np.int64)


def assert_written(out, expected, start, stride, n):
    """Refuse other bits than expected, and what is written beyond the next multiple of a group."""
    stop = -(-n // PLANE_GROUP) * PLANE_GROUP
    untouched = np.ones(len(out), bool)
    for i in range(PLANE_GROUP):
        row = slice(start + i * stride, start + i * stride + n)
        assert out[row].tobytes() == expected[row].tobytes()
        untouched[start + i * stride : start + i * stride + stop] = False
    assert out[untouched].tobytes() == expected[untouched].tobytes(), "wrote beyond the next multiple of a group"


@pytest.mark.parametrize("way", EVALUATIONS, ids=WAYS)
@pytest.mark.parametrize("column, n_unit", [(4, 1), (4, 2), (16, 3)])
@pytest.mark.parametrize("has_others", [False, True])
@pytest.mark.parametrize("n", [0, 1, 3, 4, 5, 64, 127])
def test_planes_are_those_of_plain_python(n, has_others, column, n_unit, way):
    """Also of entries that hold intensities, or nothing: these read record 0, whatever their bits say."""
    rng = np.random.default_rng(n)
    group = plane_group(random_records(rng, n_unit), RECORD_MASK, UNIT_SHIFT - 1, column)
    entries = random_entries(rng, 128, n_unit, has_others)[:n]
    out, stride = np.full(4 * 160 + 8, 7, np.float32), 160
    expected = evaluate_plainly(entries, group, 1900, 33, out, 5, stride)
    way(entries, group, np.int64(1900), np.int64(33), out, np.uint64(5), np.uint64(stride))
    assert_written(out, expected, 5, stride, n)


@pytest.mark.parametrize("way", WITHIN, ids=WAYS)
@pytest.mark.parametrize("column, n_unit", [(4, 2), (16, 3)])
@pytest.mark.parametrize("n", [0, 1, 3, 4, 5, 64, 127])
def test_values_within_their_ranges_are_those_of_plain_python(n, column, n_unit, way):
    """Also of entries that hold intensities, or nothing: these read record 0, whatever their bits say."""
    rng = np.random.default_rng(n)
    numbers = random_records(rng, n_unit)
    records = numbers.reshape(N_RECORD, -1)
    least = column + 3 * PLANE_GROUP
    limits = np.sort(rng.normal(size=(N_RECORD, 2, PLANE_GROUP)) * 2.0**20, axis=1)
    limits[::3, 1] = limits[::3, 0]  # a constant
    records[:, least : least + 2 * PLANE_GROUP] = limits.reshape(N_RECORD, -1)
    group = plane_group(numbers, RECORD_MASK, UNIT_SHIFT - 1, column)
    entries = random_entries(rng, 128, n_unit, True)[:n]
    out, stride, weights = np.full(6 * 160 + 8, 7, np.float32), 160, 5 + 5 * 160
    out[weights : weights + 128] = rng.uniform(0.5, 2.0**20, 128)
    expected = evaluate_plainly(entries, group, 1900, 33, out, 5, stride, weights)
    assert n < 64 or len(np.unique(expected[5 : 5 + n])) > 10
    way(entries, group, np.int64(1900), np.int64(33), out, np.uint64(5), np.uint64(stride), np.uint64(weights))
    assert_written(out, expected, 5, stride, n)


@pytest.mark.parametrize("way", WITHIN, ids=WAYS)
def test_values_that_are_no_numbers_become_the_least_and_constants_stay_constant(way):
    """NaN and infinite planes and weights leave no range: what is compared with NaN is false."""
    numbers = np.zeros(32, np.float32)
    numbers[4:8] = (np.nan, np.inf, -np.inf, 1e38)
    numbers[16:20], numbers[20:24] = (0.25, 0.25, 0.25, 0.5), (0.75, 0.75, 0.25, 0.5)
    entries = np.full(8, 1 << ID_BIT, np.int64)
    out = np.zeros(40, np.float32)
    out[32:40] = (1, np.inf, np.nan, 0, 1e-38, 2, 3, 1)
    way(
        entries, plane_group(numbers, RECORD_MASK, UNIT_SHIFT - 1, 4), np.int64(0), np.int64(0), out, np.uint64(0),
        np.uint64(8), np.uint64(32),
    )  # fmt: skip
    found = out[:32].reshape(4, 8)
    assert (found[0] == 0.25).all() and (found[2] == 0.25).all() and (found[3] == 0.5).all()
    assert found[1].tolist() == [0.75, 0.75, 0.25, 0.25, 0.75, 0.75, 0.75, 0.75]


@kernel
def evaluate_at(entries, group, xs, ys, out, start, stride):
    """Call evaluate_planes_at from a kernel, as the shade stage does."""
    evaluate_planes_at(entries, group, xs, ys, out, start, stride)


@kernel
def evaluate_within_at(entries, group, xs, ys, out, start, stride, weights):
    """Call evaluate_values_at from a kernel, as the shade stage does."""
    evaluate_values_at(entries, group, xs, ys, out, start, stride, weights)


def random_points(rng, n):
    """Places of n points: samples and what lies half-way between them."""
    return tuple((128 * rng.integers(0, 2**19, n)).astype(np.int32) for _ in range(2))


@pytest.mark.parametrize(
    "way",
    [evaluate_at, np.errstate(over="ignore")(evaluate_planes_at.py_func), numba.njit(evaluate_planes_at.py_func)],
    ids=WAYS,
)
@pytest.mark.parametrize("column, n_unit", [(4, 1), (16, 3)])
@pytest.mark.parametrize("n", [0, 1, 5, 64, 127])
def test_planes_at_points_are_those_of_plain_python(n, column, n_unit, way):
    """Wherever points lie, also half-way between samples: how far from the anchor is exact in float32."""
    rng = np.random.default_rng(n)
    group = plane_group(random_records(rng, n_unit), RECORD_MASK, UNIT_SHIFT - 1, column)
    entries, (xs, ys) = random_entries(rng, 128, n_unit, True)[:n], random_points(rng, 128)
    out, stride = np.full(4 * 160 + 8, 7, np.float32), 160
    expected = evaluate_plainly(entries, group, xs, ys, out, 5, stride)
    way(entries, group, xs, ys, out, np.uint64(5), np.uint64(stride))
    assert_written(out, expected, 5, stride, n)


@pytest.mark.parametrize(
    "way",
    [
        evaluate_within_at,
        np.errstate(over="ignore", invalid="ignore")(evaluate_values_at.py_func),
        numba.njit(evaluate_values_at.py_func),
    ],
    ids=WAYS,
)
@pytest.mark.parametrize("n", [0, 1, 5, 64, 127])
def test_values_at_points_stay_within_their_ranges(n, way):
    rng = np.random.default_rng(n)
    numbers = random_records(rng, 2)
    records = numbers.reshape(N_RECORD, -1)
    limits = np.sort(rng.normal(size=(N_RECORD, 2, PLANE_GROUP)) * 2.0**20, axis=1)
    records[:, 4 + 3 * PLANE_GROUP : 4 + 5 * PLANE_GROUP] = limits.reshape(N_RECORD, -1)
    group = plane_group(numbers, RECORD_MASK, UNIT_SHIFT - 1, 4)
    entries, (xs, ys) = random_entries(rng, 128, 2, True)[:n], random_points(rng, 128)
    out, stride, weights = np.full(6 * 160 + 8, 7, np.float32), 160, 5 + 5 * 160
    out[weights : weights + 128] = rng.uniform(0.5, 2.0**20, 128)
    expected = evaluate_plainly(entries, group, xs, ys, out, 5, stride, weights)
    way(entries, group, xs, ys, out, np.uint64(5), np.uint64(stride), np.uint64(weights))
    assert_written(out, expected, 5, stride, n)
