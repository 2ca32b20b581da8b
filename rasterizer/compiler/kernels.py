"""The decorators of every compiled function, and where compiled code is kept.

`kernel` is for loops over arrays: it releases the GIL, so that bands run on threads, and its machine code is kept on
disk. `helper` is for scalar functions that kernels call: the compiler inlines them. `batch_function` is for functions
that kernels call by their address.

The code is kept in files of our own (store.py). Numba's would be stamped with one file's time and size only, so a
changed helper in another file would leave stale kernels behind; they have no checksum, and a damaged one ends every
run. Here the folder's name carries a hash of all the sources that kernels are made of, and of what else decides what
the compiler makes of them. Where no folder will do, the kernels are compiled in every process: slower, never broken.

With NUMBA_DISABLE_JIT=1 nothing is compiled: every function is the plain Python that stands in its source, which a
debugger steps through. A small picture takes seconds then.
"""

import ctypes
import functools
import hashlib
import os
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np

from . import store
from .internals import (
    INLINED,
    IS_COMPILING,
    IS_SEEN,
    build_borrow,
    build_call,
    compile_callback,
    describe_compiler,
    guard_forks,
    keep_on_disk,
    lowered_by,
)

# The type that hot loops count with. A signed index may count from the end of an array: numba tests for that at every
# access, and the test keeps loops from becoming vector instructions. A sum of a signed and an unsigned integer is a
# float64, so what is added to such an index has this type, too. Constants alone may be plain integers.
index = np.uint64

_OPTIONS = {"nogil": True, "error_model": "numpy"}
_PACKAGE = Path(__file__).resolve().parents[1]


# ---------------------------------------------------------------- where compiled code is kept


def _name_folder() -> str:
    """The name of the folder for what these sources are compiled to."""
    digest = hashlib.sha256(describe_compiler().encode())
    for source in sorted(_PACKAGE.rglob("*.py")):
        content = source.read_bytes()
        if source.parent.name in ("pipeline", "compiler") or b"compiler.kernels import" in content:
            digest.update(content)
    return f"{store.PREFIX}{digest.hexdigest()[:16]}"


def _find_cache_folder() -> tuple[Path | None, list[str]]:
    """Return the folder that holds compiled kernels, or None where none will do, and why others won't do.

    NUMBA_CACHE_DIR names the only one that is tried. What others can write to is refused there, too: code is loaded
    from it.
    """
    if not IS_SEEN:
        return None, [f"any folder: numba {numba.__version__} is newer or older than the versions that were tried"]
    asked = os.environ.get("NUMBA_CACHE_DIR")
    candidates = [Path(asked)] if asked else [_PACKAGE / "__pycache__"]
    if not asked:
        candidates += [folder / "rasterizer" for folder in store.home_folders()]
    folder, reasons = store.choose_folder(candidates, _name_folder())
    if folder is not None:
        store.remove_old(folder)
    return folder, reasons


CACHE_FOLDER, CACHE_REASONS = _find_cache_folder()


def is_cache_cold() -> bool:
    """Tell whether the cache folder holds no kernel yet, so that the first picture will take seconds."""
    return CACHE_FOLDER is None or next(CACHE_FOLDER.glob(f"*{store.SUFFIX}"), None) is None


guard_forks()


# ---------------------------------------------------------------- loops, and what is inlined into them


def kernel(function: Callable) -> Callable:
    """Compile a loop over arrays on first use: without the GIL, kept on disk.

    Division by zero yields inf or nan, and integers wrap, both in silence.
    """
    if not IS_COMPILING:
        return np.errstate(all="ignore")(function)
    return keep_on_disk(numba.njit(**_OPTIONS)(function), CACHE_FOLDER)


def helper(function: Callable) -> Callable:
    """Compile a scalar function that kernels call; it is inlined into them and needs no cache entry of its own.

    It has no entry for Python, which would take a quarter of all compile time: from Python call its `py_func`.
    """
    return numba.njit(**INLINED, **_OPTIONS)(function)


@lowered_by(build_borrow)
def borrow(array):
    """Return an array that counts no references (inside kernels only).

    A slice of a counted array costs two atomic operations, about 10 ns: more than a span of a small triangle. The
    caller of a kernel holds its arguments for the kernel's whole run, so what is borrowed from them stays valid.
    """
    return array


# ---------------------------------------------------------------- functions that are called by their address


class PlainBatchFunction:
    """What `batch_function` returns with the JIT switched off: the function itself, as it stands in its source.

    `address` is that of this object (CPython's `id`), which `call_batch_function` turns back into it.
    """

    def __init__(self, function: Callable, dtype):
        self._function = function
        self._pointer = ctypes.POINTER(np.ctypeslib.as_ctypes_type(dtype))
        self.address = id(self)

    def __call__(self, batch: int, n: int, coefficients: int) -> None:
        """Call the function with typed pointers, which `numba.carray` takes in Python as well."""
        self._function(ctypes.cast(batch, self._pointer), n, ctypes.cast(coefficients, self._pointer))


@functools.cache
def batch_function(function: Callable, dtype):
    """Compile `function(batch, n, coefficients)`, where both are addresses of arrays of `dtype`; return a numba CFunc.

    A kernel calls it through its `address` with `call_batch_function`. So one kernel serves every kind of light and
    every reflection model, and only those that a scene uses are ever compiled. Keep the CFunc as long as the address is
    in use.
    """
    if not IS_COMPILING:
        return PlainBatchFunction(function, dtype)
    pointer = numba.types.CPointer(numba.from_dtype(np.dtype(dtype)))
    signature = numba.types.void(pointer, numba.types.intp, pointer)
    # The folder's name tells of this package's sources alone, not of those of a light that somebody registered.
    is_own = function.__module__.partition(".")[0] == __name__.partition(".")[0]
    return compile_callback(function, signature, CACHE_FOLDER if is_own else None)


@lowered_by(build_call, is_documented=True)
def call_batch_function(address, batch, n, coefficients):
    """Call the batch function at `address` with the addresses of two arrays and a count (inside kernels only)."""
    ctypes.cast(int(address), ctypes.py_object).value(int(batch), int(n), int(coefficients))
