"""Where things stand in Python's and NumPy's objects, which entry points (entry_points.py) read in memory."""

import ctypes
import sys

import numpy as np

# The first entries of the table that an entry point compares arguments with (kernels.ArgumentTypes), the same in every
# one: objects that it needs.
COMMON = np.ndarray, NotImplemented, None, RuntimeError
NDARRAY, NOT_IMPLEMENTED, NONE, ERROR = range(len(COMMON))

# Bytes from an object's beginning.
# Source: Python's C API (PyObject, PyTupleObject, whose sizes Python tells) and NumPy's (PyArrayObject_fields, and
# PyArray_Descr up to type_num, the same in NumPy 1 and 2). `are_layouts_known` tries them.
HEAD = object.__basicsize__
CLASS = HEAD - 8
N_ITEM, ITEMS = HEAD, tuple.__basicsize__
DATA, N_AXIS, SHAPE, STRIDES, DTYPE, FLAGS = (HEAD + offset for offset in (0, 8, 16, 24, 40, 48))
BYTE_ORDER, NUMBER = HEAD + 10, HEAD + 12  # of a dtype
NATIVE_ORDERS = "=", "|", "<" if sys.byteorder == "little" else ">"  # "|" where there is none; the last if asked for
IS_C, IS_F, IS_ALIGNED = 0x1, 0x2, 0x100


def are_layouts_known() -> bool:
    """Tell whether arrays and dtypes look in memory as entry points expect it; else they would read anything."""
    array = np.arange(6, dtype=np.float32).reshape(2, 3)
    if ctypes.sizeof(ctypes.c_void_p) != 8:
        return False

    def read(number_type, thing, offset):
        return number_type.from_address(id(thing) + offset).value

    long = ctypes.c_int64
    return (
        read(long, array, CLASS) == id(np.ndarray)
        and read(long, array, DATA) == array.ctypes.data
        and read(ctypes.c_int32, array, N_AXIS) == 2
        and [long.from_address(read(long, array, SHAPE) + 8 * k).value for k in range(2)] == [2, 3]
        and [long.from_address(read(long, array, STRIDES) + 8 * k).value for k in range(2)] == [12, 4]
        and read(long, array, DTYPE) == id(array.dtype)
        and read(ctypes.c_int32, array, FLAGS) & (IS_C | IS_F | IS_ALIGNED) == IS_C | IS_ALIGNED
        and read(ctypes.c_char, array.dtype, BYTE_ORDER) == b"="
        and read(ctypes.c_int32, array.dtype, NUMBER) == array.dtype.num
        and read(long, (array,), ITEMS) == id(array)
    )
