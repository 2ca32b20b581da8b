"""Try each use of what numba doesn't document, alone, in the version that is installed."""

import numpy as np
from helpers.stores import TINY, EntryPoint, Pair, start

from rasterizer.compiler import kernels

# ---------------------------------------------------------------- what is written for the optimiser


@kernels.helper
def mix(pair, k):
    """Read both arrays of a structure, and write one."""
    pair.second[k] = pair.first[1, k] + pair.first[np.uint32(0), k]
    return pair.second[k] - pair.first[1, 0]


def through_structures(pair, n):
    """Sum what a helper finds in a structure within a structure."""
    total = 0.0
    for k in range(n):
        total += mix(pair.first, k)
    return total, pair.second


def items(numbers, flags, k):
    """Items by indices of all kinds, also by numbers below 0; numbers that are written become what the array holds."""
    last = numbers[-1] + numbers[2, 1 - k] if numbers.ndim == 9 else numbers[1, k]
    found = last, numbers[np.uint64(k), 0], numbers[2, np.int32(k)], flags[k], flags[-1], flags[np.uint8(1)]
    numbers[k, 1], numbers[np.uint64(0), np.uint64(k)] = 2.9, 7
    flags[np.int16(0)], flags[-1] = 5, k > 9
    return found


def variables(values, n):
    """Variables that are set once, before a loop, in it, on one way alone, and anew in each round."""
    first, total, seen = values[0], 0.0, 0.0
    for k in range(n):
        here = values[k]
        if here > first:
            twice = 2.0 * here
            total += twice
            if k > 2:
                seen = twice - first
        total += here
    before = total - first
    return before, seen, here


def extremes(a, b, c, k):
    """Least and greatest of two, three and four numbers of several types, and of a tuple."""
    return min(a, b), max(a, b, c), min(b, a, k), max(a, b, c, k), min((a, b, c)), max(k, 3)


@kernels.helper
def first_or_least(values, least):
    """What no array has stands where it can't be reached."""
    if least is None:
        return values.nothing_of_this_name
    return max(values[0], least)


def with_what_is_given(values, least):
    """The first number, or the least."""
    return first_or_least(values, least)


def test_what_stands_for_none_is_not_compiled_where_something_is_given():
    given = np.array([1.5, 2.5]), 2.0
    assert EntryPoint(with_what_is_given, given)(*given) == 2.0


def test_structures_items_and_variables_are_those_of_python():
    outcomes = []
    for call in (
        lambda function, *given: EntryPoint(function, given)(*given),
        lambda function, *given: function(*given),
    ):
        arrays = Pair(np.arange(6.0).reshape(2, 3) ** 2, np.zeros(3))
        numbers, flags = np.arange(12, dtype=np.int16).reshape(3, 4), np.array([True, False, True])
        outcomes.append((
            call(through_structures, Pair(arrays, 7), 3), arrays.second.tolist(), call(items, numbers, flags, 1),
            numbers.tolist(), flags.tolist(), call(variables, np.array([3.0, 1.0, 5.0, 2.0, 9.0, 4.0]), 6),
        ))  # fmt: skip
    assert outcomes[0] == outcomes[1]
    assert outcomes[0][:3] == ((28.0, 7), [9.0, 17.0, 29.0], (5, 4, 9, False, True, False))
    assert outcomes[0][3][:2] == [[0, 7, 2, 3], [4, 2, 6, 7]] and outcomes[0][5] == (57.0, 5.0, 4.0)


def ranges(n, few):
    """Count by ranges of one, two and three ends, of none, backwards, nested, left early, and of unsigned numbers."""
    total, last = 0, -1
    for k in range(n):
        for last in range(k, few):
            total += 10 * last + k
        if k == 5:
            break
    for k in range(n, few):
        total += 1000 * k
    for k in range(n, -n, -3):
        total += 100 * k
    for k in range(np.uint64(2), np.uint64(5)):
        last += np.int64(k)
    for _ in range(np.int32(-3)):
        total += 10**6
    return total, last


def numbers_and_truths(a, b, k):
    """Operations on numbers of several types, of which some are constants; powers; and what is true."""
    total = 2 * k + a - 1 if k else -1.0
    total *= b**2 + 2.0**k + (k + 7) ** 3 // 4
    total += (k << 3 | 1) % 5 + (k > 2) + (not a == b) + np.float32(1) / np.float32(3)
    return total, bool(a) and not bool(k - 3), np.int32(a) & 3, -k ^ 5, (a, b, k)[-1], int(b) < np.uint64(9)


def test_ranges_and_numbers_are_those_of_python():
    for function, cases in (
        (ranges, ((7, 4), (3, 9), (0, 0), (-2, 3))),
        (numbers_and_truths, ((1.5, 2.5, 3), (-4.0, 1e9, 2), (0.0, 0.0, 1))),
    ):
        entry = EntryPoint(function, cases[0])
        for given in cases:
            assert entry(*given) == function(*given), given


def test_the_least_and_the_greatest_number_are_those_of_python():
    """Also where one isn't a number, and of two zeros."""
    entry = EntryPoint(extremes, (1.5, 2.5, 3.5, 2))
    for numbers in ((1.5, np.nan, 2.5), (np.nan, 1.0, -2.0), (-0.0, 0.0, 0.0), (3.0, 2.0, 1.0)):
        texts = [[repr(float(value)) for value in found(*numbers, 2)] for found in (entry, extremes)]
        assert texts[0] == texts[1], numbers


# ---------------------------------------------------------------- versions that were not seen


def test_a_version_that_was_not_seen_compiles_nothing_and_says_so(tmp_path):
    with start(f"import numba\nnumba.__version__ = '0.99.0'\n{TINY}", tmp_path, RASTER_STORE=tmp_path) as process:
        _, complaint = process.communicate()
    assert process.returncode == 1 and "kernels are compiled by numba 0.61 to 0.68, not 0.99.0" in complaint
