"""Signatures of arguments: one for each kind, refusals that say why, and tables that tell classes apart."""

import ast
import collections
import enum
import gc
import pickle
import weakref

import numpy as np
import pytest
from helpers.stores import Other, Pair

from rasterizer.compiler.internals import class_of
from rasterizer.compiler.kernels import ArgumentTypes
from rasterizer.compiler.layouts import COMMON, NDARRAY

NUMBERS = ["bool", *(f"{sign}int{n}" for sign in ("", "u") for n in (8, 16, 32, 64)), "float32", "float64"]
MATRIX = np.arange(12.0).reshape(3, 4)


def signature_of(arguments):
    return ArgumentTypes(arguments).signature


def numbers_of(arguments):
    return ArgumentTypes(arguments).numbers


def part_of(value):
    (part,) = signature_of((value,))
    return part


def unaligned(values):
    """The same values one byte beside where they should be."""
    memory = np.empty(values.nbytes + 1, np.uint8)
    shifted = memory[1:].view(values.dtype).reshape(values.shape)
    shifted[...] = values
    return shifted


# ---------------------------------------------------------------- what there is


def test_a_number_is_named_by_its_dtype():
    for name in NUMBERS:
        assert part_of(np.dtype(name).type(1)) == name
        assert part_of(np.array([1], name)) == ("array", name, 1, "C")
    for value, part in ((1, "int64"), (-(2**63), "int64"), (2**63 - 1, "int64"), (1.5, "float64")):
        assert part_of(value) == part, value
    assert part_of(True) == "bool" and part_of(None) == "none", "they are no integers"


ARRAYS = (
    (np.zeros(()), 0, "C"), (np.zeros((0, 3)), 2, "C"), (MATRIX, 2, "C"), (MATRIX.T, 2, "F"), (MATRIX[:, ::2], 2, "A"),
    (MATRIX[::-1], 2, "A"), (MATRIX[:, 1], 1, "A"), (MATRIX[1], 1, "C"), (np.broadcast_to(1.5, (3, 4)), 2, "A"),
    (np.zeros((2, 3, 4, 5)), 4, "C"),
)  # fmt: skip


def test_an_array_is_told_by_dtype_axes_and_layout():
    for array, n_axis, layout in ARRAYS:
        assert part_of(array) == ("array", "float64", n_axis, layout), f"strides {array.strides} of {array.shape}"


def test_what_may_not_be_written_to_has_the_same_signature():
    fixed = MATRIX.copy()
    fixed.flags.writeable = False
    assert part_of(fixed) == part_of(MATRIX)


def test_dtypes_that_are_equal_make_one_signature():
    for dtype in (
        pickle.loads(pickle.dumps(np.dtype("float64"))),
        np.dtype("float64", metadata={"unit": "m"}),
        np.dtype("float64").newbyteorder("="),
        np.dtype("float64").newbyteorder("<" if np.little_endian else ">"),
    ):
        assert part_of(MATRIX.view(dtype)) == part_of(MATRIX), dtype


def test_two_names_of_one_integer_make_one_signature_and_two_tables():
    """On most systems `q` and `l` are two dtypes of the same numbers."""
    long, longlong = np.zeros(3, "l"), np.zeros(3, "q")
    assert long.dtype == longlong.dtype and part_of(long) == part_of(longlong)
    assert numbers_of((long,))[len(COMMON) :] == [np.dtype("l").num]
    assert numbers_of((longlong,))[len(COMMON) :] == [np.dtype("q").num]


def test_tuples_are_told_by_their_class_and_items():
    name = f"{Pair.__module__}:Pair"
    assert part_of(Pair(1, (2.0, None))) == ("tuple", name, ("int64", ("tuple", "", ("float64", "none"))))
    assert part_of(()) == ("tuple", "", ())
    assert part_of(Pair(1, 2)) != part_of(Other(1, 2)) != part_of((1, 2))


def test_a_signature_is_written_and_read_back():
    """A file's name and a compiling process need that."""
    signature = signature_of((MATRIX.T, Pair(1, (True, None)), np.float32(2), ()))
    assert ast.literal_eval(repr(signature)) == signature


# ---------------------------------------------------------------- what is refused


class Size(enum.IntEnum):
    SMALL = 1


REFUSED = (
    "x", b"x", [1.0], {}, len, int, 1j, Size.SMALL, {1}, np.complex128(1), np.str_("x"), np.datetime64("2020"),
    np.timedelta64(1), np.float16(1), range(3), memoryview(b"x"), np.zeros(3).view(np.recarray),
)  # fmt: skip


def test_other_objects_are_refused_by_name():
    for thing in REFUSED:
        for arguments in ((thing,), (1.0, Pair((), (1, thing)))):
            with pytest.raises(TypeError, match="a kernel takes arrays, numbers, tuples and None, not") as caught:
                signature_of(arguments)
            assert str(caught.value).endswith(f"not {type(thing).__name__}")
    for value in (2**63, -(2**63) - 1, 10**400):
        with pytest.raises(OverflowError, match="a kernel takes integers from -2\\^63 to 2\\^63 - 1, not"):
            signature_of(((value,),))


def test_arrays_of_anything_else_are_refused():
    for dtype in ("O", "U3", "S3", "M8[s]", "m8[s]", "c8", "c16", "f2", "V4", "i4,f4", np.longdouble):
        if np.dtype(dtype) != np.float64:  # long doubles are no longer than doubles everywhere
            with pytest.raises(TypeError, match="a kernel takes aligned arrays of numbers; this one is"):
                signature_of((np.zeros(3, dtype),))


def test_arrays_in_another_order_of_bytes_or_unaligned_are_refused():
    for name in (name for name in NUMBERS if np.dtype(name).itemsize > 1):
        values = np.arange(6).astype(name)
        with pytest.raises(TypeError, match=r"this one is [<>]\w\d, aligned: True"):
            signature_of((values.astype(values.dtype.newbyteorder()),))
        with pytest.raises(TypeError, match=r"this one is [<>]\w\d, aligned: False"):
            signature_of((unaligned(values),))


# ---------------------------------------------------------------- classes by name


def test_a_class_is_found_by_its_name():
    for cls in (Pair, Other, collections.OrderedDict):
        assert class_of(f"{cls.__module__}:{cls.__qualname__}") is cls
    with pytest.raises(ImportError):
        class_of("nowhere.at_all:Thing")
    with pytest.raises(AttributeError):
        class_of("collections:Nothing")


# ---------------------------------------------------------------- tables


def test_a_table_is_the_same_for_the_same_kinds_alone():
    first = numbers_of((MATRIX, Pair(1, (2.0, None))))
    assert numbers_of((MATRIX[:2], Pair(7, (8.0, None)))) == first
    others = [(MATRIX, Other(1, (2.0, None))), (MATRIX, Pair(True, (2.0, None))), (MATRIX, Pair(1, (2, None)))]
    others += [(MATRIX.astype(np.float32), Pair(1, (2.0, None))), (MATRIX, Pair(1, (np.float64(2), None)))]
    assert [other for other in others if numbers_of(other) == first] == []


def test_a_table_begins_with_what_entry_points_need_and_keeps_its_numbers_in_memory():
    import ctypes

    table = ArgumentTypes((MATRIX, 3))
    assert table.numbers == [*map(id, COMMON), MATRIX.dtype.num, id(int)] and table.numbers[NDARRAY] == id(np.ndarray)
    held = (ctypes.c_int64 * len(table.numbers)).from_address(table.address)
    assert list(held) == table.numbers


def test_a_table_keeps_its_classes_so_that_no_other_gets_their_address():
    brief = collections.namedtuple("brief", ["x"])
    table, alive = ArgumentTypes((brief(1),)), weakref.ref(brief)
    del brief
    gc.collect()
    assert alive() is not None
    del table
    gc.collect()
    assert alive() is None
