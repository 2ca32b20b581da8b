"""Compare the vector loop of small boxes with the plain Python in its docstring, wrap-around included."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer._kernel import kernel
from rasterizer.pipeline.lanes import LANES, merge_box

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
