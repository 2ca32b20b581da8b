"""Compare the vector loops with the plain Python in their docstrings, wrap-around and rounding included."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer.compiler.kernels import kernel
from rasterizer.pipeline.simd import GROUP, LANES, merge_box, take_planes

PITCH, ROWS = 21, 6


@kernel
def merge(words, start, pitch, n_row, word, edges, depth_mask):
    """Call merge_box from a kernel, as the scan stage does."""
    merge_box(words, start, pitch, n_row, word, edges, depth_mask)


def merge_plainly(words, start, pitch, n_row, word, edges, depth_mask):
    """The loop of the docstring, with Python's integers, cut to 64 and 32 bits where the vectors are."""
    words = list(words)
    for row in range(n_row):
        for k in range(LANES):
            new = signed(word[0] + k * word[1] + row * word[2], 64)
            inside = [signed(edges[e] + k * edges[e + 1] + row * edges[e + 2], 32) >= 0 for e in (0, 3, 6)]
            place = start + row * pitch + k
            if all(inside) and new < words[place] & depth_mask:
                words[place] = new
    return words


def signed(value, bits):
    """The lowest bits of an integer, in two's complement."""
    return (value + (1 << bits - 1)) % (1 << bits) - (1 << bits - 1)


def assert_same(words, start, n_row, word, edges, depth_mask):
    """Merge both ways; return how many words changed."""
    expected = merge_plainly(words, start, PITCH, n_row, word, edges, depth_mask)
    array = np.array(words, np.int64)
    merge(
        array, np.uint64(start), np.uint64(PITCH), n_row, tuple(np.uint64(w % 2**64) for w in word),
        tuple(np.int64(e) for e in edges), np.int64(depth_mask),
    )  # fmt: skip
    assert array.tolist() == expected
    return sum(a != b for a, b in zip(words, expected, strict=True))


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
    words = rng.integers(-(2**63), 2**63 - 1, PITCH * ROWS).tolist()
    word = data.draw(st.tuples(whole, whole, whole))
    edges = [0] * 9 if is_open else data.draw(st.lists(edge, min_size=9, max_size=9))
    assert_same(words, start, n_row, word, edges, mask)


def test_steps_run_through_the_wrap_around():
    """A depth that passes 2^63, and edge functions that pass 2^31, along a row and between rows."""
    words = [2**63 - 1] * (PITCH * ROWS)
    top = 2**63 - 4 * 2**40
    n_changed = [
        assert_same(words, 3, ROWS, (top, 2**40, 3), [0] * 9, -(1 << 25)),
        assert_same(words, 3, ROWS, (top, 5, 2**41), [0] * 9, -(1 << 25)),
        assert_same(words, 3, ROWS, (0, 1, 8), [2**31 - 5, 1, 0, 0, 0, 0, 0, 0, 0], -1),
        assert_same(words, 3, ROWS, (0, 1, 8), [0, 0, 0, 2**31 - 3, 0, 1, -(2**31), -1, 0], -1),
    ]
    # The first two wrap to small numbers, which are nearer; the others leave the inside, or enter it.
    assert n_changed == [LANES * ROWS, LANES * ROWS, 5 * ROWS, 3 * 7]


@pytest.mark.parametrize("level", [0, 1, 2**25 - 1])
def test_at_equal_depth_the_earlier_word_stays(level):
    """Payloads differ, depths are equal: nothing is written; one step nearer: everything."""
    mask = -(1 << 25)
    words = [(7 << 25) + level] * (PITCH * ROWS)
    assert assert_same(words, 0, ROWS, ((7 << 25), 0, 0), [0] * 9, mask) == 0
    assert assert_same(words, 0, ROWS, ((7 << 25) - 1, 0, 0), [0] * 9, mask) == LANES * ROWS


def test_a_sample_on_an_edge_is_inside_and_nothing_else_is_touched():
    words = list(range(10**6, 10**6 + PITCH * ROWS))
    for e in range(3):
        for value, expected in ((0, LANES * ROWS), (-1, 0)):
            edges = [5, 0, 0] * 3
            edges[3 * e] = value
            assert assert_same(words, 4, ROWS, (1, 0, 0), edges, -1) == expected
    assert assert_same(words, 4, 0, (1, 0, 0), [0] * 9, -1) == 0


@kernel
def take(words, n, record_mask, numbers, shift, column, x, y, scale, out, place, stride):
    """Call take_planes from a kernel, as the shade stage does."""
    take_planes(words, n, record_mask, numbers, shift, column, x, y, scale, out, place, stride)


def take_plainly(words, n, record_mask, numbers, shift, column, x, y, scale, out, place, stride):
    """The loop of the docstring with numpy's scalars: int32 that wraps, or float32 that rounds after every
    operation."""
    out, whole, number = out.copy(), numbers.view(np.int32), numbers.dtype.type
    is_integer = number == np.int32
    for k in range(n):
        record = (int(words[k]) & record_mask) << shift
        across, down = x + k - int(whole[record + 1]), y - int(whole[record + 2])
        for i in range(GROUP - is_integer):
            value, value_x, value_y = (numbers[record + column + part * GROUP + i] for part in range(3))
            if is_integer:
                level = signed(int(value) + across * int(value_x) + down * int(value_y), 32)
                out[place + i * stride + k] = out.dtype.type(level) * scale
            else:
                out[place + i * stride + k] = value + number(across) * value_x + number(down) * value_y
    return out


@pytest.mark.parametrize("column", [4, 16])
@pytest.mark.parametrize("n", [0, 1, 3, 4, 5, 64, 127])
@pytest.mark.parametrize("out_dtype", [np.float32, np.float64])
@pytest.mark.parametrize("dtype", [np.int32, np.float32])
def test_planes_are_those_of_plain_python(dtype, out_dtype, n, column):
    rng, shift, n_record, mask = np.random.default_rng(n), 5, 40, (1 << 23) - 1
    numbers = rng.integers(-(2**31), 2**31, n_record << shift).astype(np.int32)
    if dtype == np.float32:
        numbers = rng.normal(size=len(numbers)).astype(np.float32)
        anchors = numbers.view(np.int32).reshape(n_record, -1)[:, 1:3]
        anchors[:] = rng.integers(-(2**20), 2**20, anchors.shape)
    words = (rng.integers(0, 2**38, 128) << 25 | 1 << 24 | rng.integers(0, n_record, 128)).astype(np.int64)
    out, stride = np.full(4 * 160 + 8, 7, out_dtype), 160
    expected = take_plainly(words, n, mask, numbers, shift, column, 1900, 33, out_dtype(0.37), out, 5, stride)
    take(words, np.uint64(n), np.int64(mask), numbers, np.uint64(shift), np.uint64(column), np.int64(1900), np.int64(33),
         out_dtype(0.37), out, np.uint64(5), np.uint64(stride))  # fmt: skip
    stop = -(-n // GROUP) * GROUP
    untouched = np.ones(len(out), bool)
    for i in range(GROUP):
        row = slice(5 + i * stride, 5 + i * stride + n)
        assert out[row].tobytes() == expected[row].tobytes()
        untouched[5 + i * stride : 5 + i * stride + stop] = False
    assert (out[untouched] == 7).all(), "wrote beyond the next multiple of a group"


@pytest.mark.filterwarnings("ignore:overflow")
def test_planes_of_integers_wrap():
    """Values far out may leave 32 bits on the way, if they come back."""
    numbers = np.zeros(16, np.int32)
    numbers[4:8], numbers[8:12] = 2**31 - 1, 2**30
    out = np.zeros(16, np.float32)
    take(np.zeros(4, np.int64), np.uint64(4), np.int64(1), numbers, np.uint64(4), np.uint64(4), np.int64(0), np.int64(0),
         np.float32(1), out, np.uint64(0), np.uint64(4))  # fmt: skip
    assert out[:4].tolist() == [np.float32(signed(2**31 - 1 + k * 2**30, 32)) for k in range(4)]
