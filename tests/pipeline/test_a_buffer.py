"""Check the lists of the A-buffer: which samples have one, how room is divided among them, and that they are sorted."""

import numpy as np

from rasterizer.pipeline.a_buffer import (
    MAX_FRAGMENTS,
    FragmentLists,
    Room,
    divide_room,
    number_samples,
    sort_lists,
    split_samples,
)
from rasterizer.pipeline.visibility import make_extents


def test_samples_in_the_extents_are_numbered_row_by_row():
    extents, n_row = make_extents(20), 20
    extents.left[:3], extents.right[:3] = (3, extents.left[1], 0), (7, extents.right[1], 2)  # nothing in rows 8 to 15
    columns, first = np.empty(n_row, np.int64), np.empty(n_row + 1, np.int64)
    assert number_samples(extents, columns, first) == 8 * 4 + 4 * 2
    assert first.tolist() == [*range(0, 32, 4), *[32] * 8, 32, 34, 36, 38, 40]
    assert [int(columns[row]) + left for row, left in ((0, 3), (7, 3), (16, 0), (19, 0))] == [0, 28, 32, 38]


def test_room_is_divided_by_the_lengths_of_the_lists():
    cursors, starts = np.array([2, 0, 5, 1]), np.full(5, -1)
    assert tuple(divide_room(cursors, starts)) == (8, 3)
    assert starts.tolist() == [0, 2, 2, 7, 8] and cursors.tolist() == starts[:4].tolist()


def test_room_grows_and_is_used_again():
    room = Room()
    first = room.array("a", (3, 4))
    assert first.shape == (3, 4) and first.dtype == np.int64 and room.n_byte == 96
    assert np.shares_memory(room.array("a", (5,)), first) and not np.shares_memory(room.array("b", (5,)), first)
    assert room.array("a", (5,), np.float64).dtype == np.float64 and room.array("a", (50,)).shape == (50,)
    assert room.n_byte == 50 * 8 + 5 * 8


def test_ranges_of_samples_are_whole_in_order_and_within_the_limit():
    rng = np.random.default_rng(2)
    for pitch, n_row in ((1, 1), (8, 5), (40, 16)):
        for most in (0, 9, MAX_FRAGMENTS // 3, 2 * MAX_FRAGMENTS):
            counts = rng.integers(0, most + 1, pitch * n_row)
            start = np.append(0, np.cumsum(counts))
            ranges = list(split_samples(start, np.arange(n_row + 1) * pitch))
            assert [first for first, _ in ranges] == [0, *(end for _, end in ranges[:-1])], ranges
            assert ranges[-1][1] == len(counts), ranges
            for first, end in ranges:
                n = start[end] - start[first]
                assert end - first == 1 or n <= MAX_FRAGMENTS, f"{first}..{end}: {n} > {MAX_FRAGMENTS} fragments"
                is_whole = end % pitch == 0 or start[(first // pitch + 1) * pitch] - start[first] > MAX_FRAGMENTS
                assert is_whole, f"{first}..{end} ends within a row"
            assert most > 9 or len(ranges) == 1, ranges


def test_lists_are_sorted_in_whatever_order_they_are():
    """The first list, which isn't in the range, stays as it is."""
    rng, lists = np.random.default_rng(3), [np.array([3, 2, 1])]
    for n in (0, 1, 2, 3, 24, 65, 1000):
        up = np.arange(n)
        lists += [
            up,
            up[::-1],
            rng.permutation(n),
            rng.integers(0, 5, n),
            np.zeros(n, int),
            np.roll(up, n // 2),
            up ^ 1,
        ]
        lists += [rng.integers(-(2**62), 2**62, n)]
    starts = np.append(0, np.cumsum([len(each) for each in lists]))
    entries, unused = np.concatenate(lists).astype(np.int64), np.zeros(1, np.int64)
    sort_lists(FragmentLists(1, len(lists), 3, entries[3:], unused, unused, starts, False, unused))
    for k, (each, start, end) in enumerate(zip(lists, starts, starts[1:], strict=False)):
        wanted = np.sort(each) if k else each
        assert np.array_equal(entries[start:end], wanted), f"list {k}: {entries[start:end]}"
