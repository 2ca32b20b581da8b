"""Signatures: what types of arguments a kernel is called with, in plain tuples that are written, read and compared.

    argument                          its part of a signature
    --------------------------------- -----------------------------------------------------------------
    array                             ("array", dtype, number of axes, layout), layout "C", "F" or "A" (any)
    tuple, NamedTuple                 ("tuple", class, parts), the class as "module:name", "" of a plain tuple
    int, float, bool, NumPy's scalar  the name of its dtype, such as "int64"
    None                              "none"

One machine code serves all arguments with the same signature. Whether an array may be written to is no part of it:
kernels write to their outputs only.

An entry point (entry_points.py) finds out whether it is called with such arguments: it compares them with a table, and
reads them where they stand in memory.
"""

import ctypes
import sys

import numpy as np

MIN_INT, MAX_INT = -(2**63), 2**63 - 1
_PLAIN = {int: "int64", float: "float64", bool: "bool", type(None): "none"}
_NUMBERS = "?fd" + np.typecodes["AllInteger"]  # the dtypes of which kernels take numbers

# The first entries of a table, the same in every one: objects that an entry point needs.
COMMON = np.ndarray, NotImplemented, None, RuntimeError
NDARRAY, NOT_IMPLEMENTED, NONE, ERROR = range(len(COMMON))


class ArgumentTypes:
    """Of what types some arguments of a kernel are.

    signature : tuple, a part of each argument
    numbers : list of int, the table that an entry point compares arguments with, see entry_points.py: addresses of the
        objects COMMON, then, for every part of the signature in order, what tells that an argument is of this type. Of
        an array that is the number of its dtype, of anything else the address of its class; after a tuple's class come
        its items. Classes have other addresses in every process: so the table is made from the first arguments met.
    address : int, of the table in memory, as long as this lives

    Raises TypeError for what kernels don't take: other objects, arrays of a subclass or of other than numbers, and
    arrays that are not aligned or not in the machine's order of bytes; OverflowError for an int that has more than 64
    bits.
    """

    def __init__(self, arguments: tuple):
        self._classes = []  # kept, so that no address is used again
        self.numbers = list(map(id, COMMON))
        self.signature = tuple(map(self._note, arguments))
        self._memory = (ctypes.c_int64 * len(self.numbers))(*self.numbers)
        self.address = ctypes.addressof(self._memory)

    def _note(self, value):
        """Append what tells of one argument's type to the table, and return its part of the signature."""
        cls = type(value)
        if cls is np.ndarray:
            flags, dtype = value.flags, value.dtype
            if dtype.char not in _NUMBERS or not (dtype.isnative and flags.aligned):
                raise TypeError(
                    f"a kernel takes aligned arrays of numbers; this one is {dtype.str}, aligned: {flags.aligned}"
                )
            self.numbers.append(dtype.num)
            layout = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
            return ("array", dtype.name, value.ndim, layout)
        self._classes.append(cls)
        self.numbers.append(id(cls))
        if cls in _PLAIN:
            if cls is int and not MIN_INT <= value <= MAX_INT:
                raise OverflowError(
                    f"a kernel takes integers from -2^63 to 2^63 - 1, not {value}; others as numpy.uint64"
                )
            return _PLAIN[cls]
        if isinstance(value, tuple):
            name = "" if cls is tuple else f"{cls.__module__}:{cls.__qualname__}"
            return ("tuple", name, tuple(map(self._note, value)))
        if isinstance(value, np.generic) and value.dtype.char in _NUMBERS:
            return value.dtype.name
        raise TypeError(f"a kernel takes arrays, numbers, tuples and None, not {cls.__name__}")


def class_of(name: str) -> type:
    """Return the class of a tuple from its name in a signature.

    Raises ImportError or AttributeError where there is none.
    """
    module, _, path = name.partition(":")
    __import__(module)
    found = sys.modules[module]
    for step in path.split("."):
        found = getattr(found, step)
    return found


# ---------------------------------------------------------------- where things stand in objects

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
