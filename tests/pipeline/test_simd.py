"""Compare the vector loops with plain Python, wrap-around and rounding included, and so what stands in for them."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer.compiler.kernels import kernel
from rasterizer.pipeline.simd import LANES, PLANE_GROUP, PlaneGroup, evaluate_planes, merge_box

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


def evaluate_plainly(entries, group, x, y, out, start, stride):
    """The same loop with numpy's scalars: int32 that wraps, or float32 that rounds after every operation."""
    numbers, column, shift = group.numbers, int(group.column), int(group.shift)
    out, whole, number = out.copy(), numbers.view(np.int32), numbers.dtype.type
    is_integer = number == np.int32
    for k in range(len(entries)):
        record = (int(entries[k]) & int(group.record_mask)) << shift
        across, down = x + k - int(whole[record + 1]), y - int(whole[record + 2])
        for i in range(PLANE_GROUP - is_integer):
            value, dx, dy = (numbers[record + column + part * PLANE_GROUP + i] for part in range(3))
            if is_integer:
                level = signed(int(value) + across * int(dx) + down * int(dy), 32)
                out[start + i * stride + k] = out.dtype.type(level) * group.scale
            else:
                out[start + i * stride + k] = value + number(across) * dx + number(down) * dy
    return out


def plane_group(numbers, record_mask, shift, column, scale):
    """A PlaneGroup with the types that kernels take."""
    return PlaneGroup(numbers, np.int64(record_mask), np.uint64(shift), np.uint64(column), scale)


@pytest.mark.parametrize("way", EVALUATIONS, ids=["vectors", "plain", "compiled"])
@pytest.mark.parametrize("column", [4, 16])
@pytest.mark.parametrize("n", [0, 1, 3, 4, 5, 64, 127])
@pytest.mark.parametrize("out_dtype", [np.float32, np.float64])
@pytest.mark.parametrize("dtype", [np.int32, np.float32])
def test_planes_are_those_of_plain_python(dtype, out_dtype, n, column, way):
    rng, shift, n_record, mask = np.random.default_rng(n), 5, 40, (1 << 23) - 1
    numbers = rng.integers(-(2**31), 2**31, n_record << shift).astype(np.int32)
    if dtype == np.float32:
        numbers = rng.normal(size=len(numbers)).astype(np.float32)
        anchors = numbers.view(np.int32).reshape(n_record, -1)[:, 1:3]
        anchors[:] = rng.integers(-(2**20), 2**20, anchors.shape)
    entries = (rng.integers(0, 2**38, 128) << 25 | 1 << 24 | rng.integers(0, n_record, 128)).astype(np.int64)[:n]
    out, stride = np.full(4 * 160 + 8, 7, out_dtype), 160
    group = plane_group(numbers, mask, shift, column, out_dtype(0.37))
    expected = evaluate_plainly(entries, group, 1900, 33, out, 5, stride)
    way(entries, group, np.int64(1900), np.int64(33), out, np.uint64(5), np.uint64(stride))
    stop = -(-n // PLANE_GROUP) * PLANE_GROUP
    untouched = np.ones(len(out), bool)
    for i in range(PLANE_GROUP):
        row = slice(5 + i * stride, 5 + i * stride + n)
        assert out[row].tobytes() == expected[row].tobytes()
        untouched[5 + i * stride : 5 + i * stride + stop] = False
    assert (out[untouched] == 7).all(), "wrote beyond the next multiple of a group"


@pytest.mark.filterwarnings("ignore:overflow")
@pytest.mark.parametrize("way", EVALUATIONS, ids=["vectors", "plain", "compiled"])
def test_planes_of_integers_wrap(way):
    """Values far out may leave 32 bits on the way, if they come back."""
    numbers = np.zeros(16, np.int32)
    numbers[4:8], numbers[8:12] = 2**31 - 1, 2**30
    out = np.zeros(16, np.float32)
    group = plane_group(numbers, 1, 4, 4, np.float32(1))
    way(np.zeros(4, np.int64), group, np.int64(0), np.int64(0), out, np.uint64(0), np.uint64(4))
    assert out[:4].tolist() == [np.float32(signed(2**31 - 1 + k * 2**30, 32)) for k in range(4)]
