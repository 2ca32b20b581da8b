"""Signatures of arguments: one for each kind, refusals that say why, and tables that tell classes apart."""

import collections
import enum
import gc
import weakref

import numpy as np
import pytest
from helpers.stores import Pair

from rasterizer.compiler.kernels import ArgumentTypes

NUMBERS = ["bool", *(f"{sign}int{n}" for sign in ("", "u") for n in (8, 16, 32, 64)), "float32", "float64"]


def signature_of(arguments):
    return ArgumentTypes(arguments).signature


def unaligned(values):
    """The same values one byte beside where they should be."""
    memory = np.empty(values.nbytes + 1, np.uint8)
    shifted = memory[1:].view(values.dtype).reshape(values.shape)
    shifted[...] = values
    return shifted


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


# ---------------------------------------------------------------- tables


def test_a_table_keeps_its_classes_so_that_no_other_gets_their_address():
    brief = collections.namedtuple("brief", ["x"])
    table, alive = ArgumentTypes((brief(1),)), weakref.ref(brief)
    del brief
    gc.collect()
    assert alive() is not None
    del table
    gc.collect()
    assert alive() is None
