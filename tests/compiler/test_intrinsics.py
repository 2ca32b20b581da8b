"""Functions whose instructions are written by hand: they do what the plain functions say, where they may be used.

Those of the pipeline's inner loops are compared with their plain twins in tests/pipeline/test_simd.py.
"""

import importlib.util
import sys

import numba
import numpy as np
import pytest
from helpers.stores import EntryPoint

from rasterizer.compiler import fingerprint, internals, intrinsics, kernels, texel_intrinsics


def through_address(address, batch, n, coefficients):
    """Call a batch function."""
    kernels.call_batch_function(address, batch, n, coefficients)


def doubles(batch, n, coefficients):
    """A batch function."""
    values = kernels.as_array(batch, (8,))
    for k in range(n):
        values[k] *= coefficients[0]


# ---------------------------------------------------------------- arrays that are sliced


def test_slices_of_an_array_count_no_references():
    values = np.arange(6.0)
    before = sys.getrefcount(values)
    entry = EntryPoint(sum_of_slices, (values, 3))
    assert entry(values, 3) == 0 * 1 + 1 * 2 + 2 * 3 == internals.compile_by_numba(sum_of_slices)(values, 3)
    assert sys.getrefcount(values) == before and values.tolist() == list(range(6))


def sum_of_slices(values, n):
    """Slice an array in a loop, and in a helper that returns a tuple."""
    total = 0.0
    for k in range(n):
        product, _ = product_of(values[k : k + 2], k)
        total += product
    return total


@kernels.helper
def product_of(values, k):
    part = values[0:2]
    return part[0] * part[1], k


# ---------------------------------------------------------------- calls by address


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("way", ["by its entry point", "by numba", "by a kernel"])
def test_a_batch_function_is_called_by_its_address(dtype, way):
    values, factor = np.arange(8, dtype=dtype), np.array([2], dtype)
    given = kernels.batch_function(doubles, dtype).address, values.ctypes.data, 3, factor.ctypes.data
    if way == "by its entry point":
        EntryPoint(through_address, given)(*given)
    else:
        make = internals.compile_by_numba if way == "by numba" else kernels.kernel
        make(through_address)(*given)
    assert values.tolist() == [0, 2, 4, 3, 4, 5, 6, 7]


@pytest.fixture
def without_jit(monkeypatch):
    """The module of decorators as it is where nothing is compiled."""
    spec = importlib.util.spec_from_file_location("rasterizer.compiler.kernels_again", kernels.__file__)
    module = importlib.util.module_from_spec(spec)
    with monkeypatch.context() as patch:  # no longer: numba reads it again whenever it compiles
        patch.setenv("NUMBA_DISABLE_JIT", "1")
        spec.loader.exec_module(module)
    assert not module.IS_COMPILING and not module.STORE.is_used
    return module


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_batch_function_is_called_by_its_address_without_the_jit(without_jit, dtype):
    function = without_jit.batch_function(doubles_plainly, dtype)
    assert isinstance(function, without_jit.PlainBatchFunction)
    values, factor = np.arange(8, dtype=dtype), np.array([2], dtype)
    address = np.array([function.address], np.int64)[0]
    without_jit.call_batch_function(address, values.ctypes.data, np.uint64(3), factor.ctypes.data)
    function(values.ctypes.data, 1, factor.ctypes.data)
    assert values.tolist() == [0, 2, 4, 3, 4, 5, 6, 7]


def doubles_plainly(batch, n, coefficients):
    values = np.ctypeslib.as_array(batch, (8,))
    for k in range(n):
        values[k] *= coefficients[0]


def test_a_fault_in_a_batch_function_is_raised_without_the_jit(without_jit):
    """A ctypes callback would only print it."""

    def fails(batch, n, coefficients):
        raise ValueError("in the batch function")

    function = without_jit.batch_function(fails, np.float32)
    with pytest.raises(ValueError, match="in the batch function"):
        without_jit.call_batch_function(function.address, 0, 1, 0)


# ---------------------------------------------------------------- where they are used


def plain_sum(a, b):
    """Add."""
    return a + b


def build_difference(typing_context, a, b):
    """Spell out something else than `plain_sum`, so that it is seen which of them runs."""

    def generate(_context, builder, _signature, arguments):
        return builder.sub(*arguments)

    return numba.int64(numba.int64, numba.int64), generate


@pytest.mark.parametrize(
    "is_seen, is_documented, expected", [(True, False, 3), (False, False, 7), (False, True, 3), (True, True, 3)]
)
def test_instructions_stand_in_for_a_plain_function_only_where_they_are_known(
    monkeypatch, is_seen, is_documented, expected
):
    monkeypatch.setattr(internals, "IS_SEEN", is_seen)
    monkeypatch.setattr(intrinsics, "build_difference", build_difference, raising=False)
    chosen = internals.compile_intrinsic(plain_sum, "build_difference", is_documented)
    assert numba.njit(lambda a, b: chosen(a, b))(5, 2) == expected


def test_a_function_that_is_spelled_out_is_a_plain_one_for_python(without_jit, monkeypatch):
    monkeypatch.setattr(intrinsics, "build_difference", build_difference, raising=False)
    chosen = kernels.spelled_out("build_difference")(plain_sum)
    assert chosen(5, 2) == 7 and chosen.py_func is plain_sum and chosen.__doc__ == "Add."
    assert EntryPoint(lambda a, b: chosen(a, b), (5, 2))(5, 2) == 3
    assert without_jit.spelled_out("build_difference")(plain_sum) is plain_sum


def test_every_function_that_is_spelled_out_has_its_instructions():
    """Each name that a source asks for is in one of the two files, and each that is there is asked for."""
    import re

    from helpers.imports import PATHS

    asked = set()
    for path in PATHS.values():
        asked |= set(re.findall(r'"(build_\w+)"', path.read_text(encoding="utf-8")))
    there = [name for module in (intrinsics, texel_intrinsics) for name in vars(module) if name.startswith("build_")]
    assert sorted(asked) == sorted(there)
    assert fingerprint.is_seen(numba.__version__)
