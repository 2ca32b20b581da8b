"""Try each use of what numba doesn't document, alone, in the version that is installed."""

import gc
import sys

import numba
import numpy as np
import pytest
from helpers.stores import TINY, EntryPoint, Pair, names_in, start

from rasterizer.compiler import internals, kernels

ARRAY = ("array", "float64", 1, "C")


def first_of(x):
    """What is compiled here."""
    return x[0] * 0.5


# ---------------------------------------------------------------- object code


def test_object_code_defines_an_entry_and_needs_what_it_says():
    """Nothing is made for Python: KernelLibrary, no_cpython_wrapper, no_cfunc_wrapper."""
    code = internals.compile_signature(first_of, (ARRAY,))
    names, needed = names_in(code), code.partition(b"\n")[0].decode().split()
    assert "entry" in names and needed and all(name.startswith("Py") for name in needed), needed
    assert not [name for name in names if "cpython" in name or "cfunc" in name], names
    code = internals.compile_signature(doubles, ("batch function", "float32"))
    assert "entry" in names_in(code) and code.startswith(b"\n")


def doubles(batch, n, coefficients):
    """A batch function."""
    values = kernels.as_array(batch, (8,))
    for k in range(n):
        values[k] *= coefficients[0]


def allocates(n):
    return np.zeros(n).sum()


def prints(n):
    print(n)


def gives_complex(n):
    return 1j * n


def gives_pair(n):
    return Pair(n, n)


def gives_array(n, values=None):
    return values


def gives_none_or_number(n):
    if n > 3:
        return None
    return n


LEFT = (
    (allocates, (), "it allocates memory"),
    (prints, (), "it calls numba_gil_ensure"),
    (gives_complex, (), "a kernel that returns complex128"),
    (gives_pair, (), "a kernel that returns Pair"),
    (gives_none_or_number, (), "a kernel that returns OptionalType"),
    (gives_array, (ARRAY,), "a kernel that returns array"),
    *(
        (gives_array, (("tuple", name, ()),), "no class")
        for name in ("nowhere.at_all:Thing", "collections:Nothing", "collections:x.<locals>.Thing")
    ),
)


def test_what_needs_numba_is_left_to_it_and_says_why():
    """And garbage is collected afterwards, as before."""
    was_collecting = gc.isenabled()
    try:
        for k, (function, more, reason) in enumerate(LEFT):
            (gc.enable if k % 2 else gc.disable)()
            with pytest.raises(internals.NotStandalone, match=reason):
                internals.compile_signature(function, ("int64", *more))
            assert gc.isenabled() == bool(k % 2), function.__name__
    finally:
        (gc.enable if was_collecting else gc.disable)()


def test_numba_knows_every_part_of_a_signature():
    pair = ("tuple", f"{Pair.__module__}:Pair", ("float32", ("tuple", "", ("none", "bool"))))
    found = internals.type_of_part(pair)
    assert found.instance_class is Pair and found.types[0] == numba.float32
    assert found.types[1] == numba.types.Tuple((numba.none, numba.boolean))
    assert internals.type_of_part(("array", "uint8", 3, "A")) == numba.types.Array(numba.uint8, 3, "A")


# ---------------------------------------------------------------- what kernels call


@kernels.helper
def thrice(x):
    """A helper."""
    return 3.0 * x


@kernels.kernel
def called_kernel(values, factor):
    return values[0] * factor


@kernels.helper
def say_single(x):
    """Say that a number is float32."""
    return 1


@kernels.helper
def say_double(x):
    return 2


say_type = kernels.by_type(say_single, say_double)


@kernels.helper
def product_of(values, k):
    """Slice an array, and return a tuple."""
    part = values[0:2]
    return part[0] * part[1], k


def calls(values, n):
    """Helpers, another kernel, choices by type, slices, a division by zero."""
    total = 0.0
    for k in range(n):
        product, _ = product_of(values[k : k + 2], k)
        total += product
    told = say_type(np.float32(values[0])), say_type(values[0])
    return thrice(values[0]) + thrice(values[1]), called_kernel(values, 2.0), told, total, n / (values[0] - 2.0)


def test_kernels_call_helpers_kernels_and_choices():
    """Helpers are inlined: forceinline, HelperLibrary, insert_user_function; no references are counted."""
    values = np.array([2.0, 3.0, 4.0])
    expected = 15.0, 4.0, (1, 2), 18.0, np.inf
    entry, before = EntryPoint(calls, (values, 2)), sys.getrefcount(values)
    assert entry(values, 2) == expected == internals.compile_by_numba(calls)(values, 2)
    assert sys.getrefcount(values) == before
    names = names_in(internals.compile_signature(calls, (ARRAY, "int64")))
    called = [name for name in names if "thrice" in name and "NumbaEnv" not in name]
    assert not called, "a helper is called, not inlined"


def through_address(address, batch, n, coefficients):
    """Call a batch function."""
    kernels.call_batch_function(address, batch, n, coefficients)


def test_a_batch_function_is_called_by_its_address():
    for dtype in (np.float32, np.float64):
        function = kernels.batch_function(doubles, dtype)
        for make in (
            lambda given: EntryPoint(through_address, given),
            lambda _: internals.compile_by_numba(through_address),
        ):
            values, factor = np.arange(8, dtype=dtype), np.array([2], dtype)
            given = function.address, values.ctypes.data, 3, factor.ctypes.data
            make(given)(*given)
            assert values.tolist() == [0, 2, 4, 3, 4, 5, 6, 7], dtype


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
