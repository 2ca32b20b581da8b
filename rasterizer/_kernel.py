"""The two decorators of every compiled function, and where compiled code is kept.

`kernel` is for loops over arrays: it releases the GIL, so that bands run on threads, and its machine code is kept on disk.
`helper` is for scalar functions that kernels call: the compiler inlines them.

Numba stamps its cache with one file's time and size only, so a changed helper in another file would leave stale kernels behind.
The cache folder therefore carries a hash of all the sources that kernels are made of. Where no folder can be written the
kernels are compiled in every process: slower, never broken.
"""

import contextlib
import functools
import hashlib
import os
import shutil
import tempfile
import time
from pathlib import Path

import numba
import numba.extending
import numpy
from llvmlite import ir

_OPTIONS = {"nogil": True, "error_model": "numpy"}
_PACKAGE = Path(__file__).resolve().parent


def _is_writable(folder: Path) -> bool:
    """Tell whether files can be made in `folder`, making the folder if need be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _find_cache_folder() -> Path | None:
    """Return the first folder that can hold compiled kernels, or None where nothing is writable."""
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(_PACKAGE.rglob("*.py")):
        content = source.read_bytes()
        if source.parent.name == "pipeline" or b"_kernel import" in content:
            digest.update(content)
    name = f"kernels-{digest.hexdigest()[:16]}"
    home = Path(os.path.expanduser("~"))
    asked = os.environ.get("NUMBA_CACHE_DIR")
    user_cache = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "rasterizer"
    candidates = [Path(asked)] if asked else [_PACKAGE / "__pycache__", user_cache]
    folder = next((base / name for base in candidates if _is_writable(base / name)), None)
    if folder is not None:
        os.utime(folder)  # in use: its age counts from now
        _remove_old(folder)
    return folder


def _remove_old(folder: Path) -> None:
    """Remove the kernels of other versions that nobody has touched for a month."""
    for other in folder.parent.glob("kernels-*"):
        try:
            if other != folder and time.time() - other.stat().st_mtime > 30 * 24 * 3600:
                shutil.rmtree(other)
        except OSError:
            continue  # somebody else's, or just removed by another process


CACHE_FOLDER = _find_cache_folder()


def is_cache_cold() -> bool:
    """Tell whether no kernel has been compiled into the cache folder yet, so that the first picture will take seconds."""
    return CACHE_FOLDER is None or next(CACHE_FOLDER.rglob("*.nbi"), None) is None


@contextlib.contextmanager
def _own_cache():
    """Let numba find the package's own cache folder, where there is one, and afterwards whatever it had before."""
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(CACHE_FOLDER or before)
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before


def _compile_lazily(function, **options):
    """Apply `numba.njit` with the package's own cache folder, without changing the folder of anybody else."""
    if CACHE_FOLDER is None:
        return numba.njit(**options)(function)
    with _own_cache():
        return numba.njit(cache=True, **options)(function)


def kernel(function):
    """Compile a loop over arrays on first use: without the GIL, kept on disk. Division by zero yields inf or nan, as in numpy."""
    return _compile_lazily(function, **_OPTIONS)


def helper(function):
    """Compile a scalar function that kernels call; it is inlined into them and needs no cache entry of its own.

    It has no entry for Python, which would take a quarter of all compile time: from Python call its `py_func`.
    """
    return numba.njit(forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, **_OPTIONS)(function)


@functools.cache
def row_function(function, dtype):
    """Compile `function(rows, n, params)`, where rows and params point to `dtype`; return a numba CFunc.

    A kernel calls it through its `address` with `call_row`. So one kernel serves every kind of light and every reflection
    model, and only those that a scene uses are ever compiled. Keep the CFunc as long as the address is in use.
    """
    number = numba.from_dtype(numpy.dtype(dtype))
    pointer = numba.types.CPointer(number)
    signature = numba.types.void(pointer, numba.types.intp, pointer)
    options = {"error_model": "numpy", "nopython": True}
    with _own_cache():
        return numba.cfunc(signature, cache=CACHE_FOLDER is not None, **options)(function)


@numba.extending.intrinsic
def call_row(typing_context, address, rows, n, params):
    """Call the row function at `address` with the addresses of two arrays and a count (inside kernels only)."""
    signature = numba.types.void(numba.types.intp, numba.types.intp, numba.types.intp, numba.types.intp)

    def generate(context, builder, _signature, arguments):
        word = ir.IntType(64)
        function_type = ir.FunctionType(ir.VoidType(), [word, word, word])
        builder.call(builder.inttoptr(arguments[0], function_type.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    return signature, generate


@numba.extending.intrinsic
def borrow(typing_context, array):
    """Return an array that counts no references (inside kernels only).

    A slice of a counted array costs two atomic operations, about 10 ns: more than a span of a small triangle. The caller of a
    kernel holds its arguments for the kernel's whole run, so what is borrowed from them stays valid.
    """

    def generate(context, builder, signature, arguments):
        struct = context.make_array(signature.args[0])(context, builder, arguments[0])
        struct.meminfo = ir.Constant(struct.meminfo.type, None)
        struct.parent = ir.Constant(struct.parent.type, None)
        return struct._getvalue()

    return array(array), generate
