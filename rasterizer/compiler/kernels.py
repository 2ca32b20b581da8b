"""The two decorators of every compiled function, and where compiled code is kept.

`kernel` is for loops over arrays: it releases the GIL, so that bands run on threads, and its machine code is kept on
disk. `helper` is for scalar functions that kernels call: the compiler inlines them.

The code is kept in files of our own (compiler/store.py). Numba's would be stamped with one file's time and size only,
so a changed helper in another file would leave stale kernels behind; they have no checksum, and a damaged one ends
every run. Here the folder's name carries a hash of all the sources that kernels are made of, and of what else decides
what the compiler makes of them. Where no folder will do, the kernels are compiled in every process: slower, never
broken.
"""

import functools
import hashlib
import logging
import os
import pickle
import sys
from pathlib import Path

import llvmlite
import numba
import numba.extending
import numpy
from llvmlite import ir
from numba.core import compiler, config, serialize, sigutils
from numba.core.caching import NullCache
from numba.core.ccallback import CFunc
from numba.core.compiler_lock import global_compiler_lock

from . import store

_OPTIONS = {"nogil": True, "error_model": "numpy"}
_PACKAGE = Path(__file__).resolve().parents[1]
# Settings of numba (0.68) that change the code that it makes; each is also an environment variable, NUMBA_...
_CODE_SETTINGS = (
    "BOUNDSCHECK", "CPU_FEATURES", "CPU_NAME", "DEBUGINFO_DEFAULT", "DEBUG_NRT", "DISABLE_INTEL_SVML", "ENABLE_AVX",
    "ENABLE_PROFILING", "ENABLE_SYS_MONITORING", "EXTEND_VARIABLE_LIFETIMES", "LLVM_REFPRUNE_FLAGS", "LLVM_REFPRUNE_PASS",
    "LOOP_VECTORIZE", "NRT_STATS", "OPT", "SLP_VECTORIZE", "USING_SVML",
)  # fmt: skip

# The type of indices in hot loops: a signed index makes numba add code for negative ones, which count from the end.
index = numpy.uint64

_log = logging.getLogger("rasterizer")


def _describe_compiler() -> str:
    """Say what decides, beside the sources, what code is made."""
    versions = numba.__version__, llvmlite.__version__, numpy.__version__, sys.implementation.cache_tag
    return repr((versions, [(name, str(getattr(config, name, None))) for name in _CODE_SETTINGS]))


def _name_folder() -> str:
    """The name of the folder for what these sources are compiled to."""
    digest = hashlib.sha256(_describe_compiler().encode())
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
    """Tell whether no kernel has been compiled into the cache folder yet, so that the first picture will take
    seconds."""
    return CACHE_FOLDER is None or next(CACHE_FOLDER.glob(f"*{store.SUFFIX}"), None) is None


class _Kept(NullCache):
    """One function's compiled forms on disk: what dispatchers and CFuncs of numba (0.61 to 0.68) ask for and hand
    over."""

    def __init__(self, function):
        self._function = function
        self._title = f"{function.__module__.rpartition('.')[2]}.{function.__name__}"

    @property
    def cache_path(self):
        return str(CACHE_FOLDER)

    def _key(self, signature, codegen) -> bytes:
        where = self._function.__module__, self._function.__qualname__, self._function.__code__.co_firstlineno
        return repr((_describe_compiler(), where, str(signature), codegen.magic_tuple())).encode()

    def load_overload(self, sig, target_context):
        """Return what was compiled for a signature, or None."""
        target_context.refresh()
        code = store.read_code(CACHE_FOLDER, self._title, self._key(sig, target_context.codegen()))
        if code is None:
            return None
        try:
            return compiler.CompileResult._rebuild(target_context, *pickle.loads(code))
        except Exception as fault:  # noqa: BLE001  unpickling raises anything: what numba doesn't know any more
            _log.info("kernel %s can't be loaded and is compiled again (%s)", self._title, fault)
            return None

    def save_overload(self, sig, data):
        """Keep what was compiled; code that holds addresses of this process can't be kept."""
        if not data.lifted and not data.library.has_dynamic_globals:
            store.write_code(CACHE_FOLDER, self._title, self._key(sig, data.codegen), serialize.dumps(data._reduce()))


def _compile_lazily(function, **options):
    """Apply `numba.njit` with the package's own cache, without changing the folder of anybody else."""
    compiled = numba.njit(**options)(function)
    if CACHE_FOLDER is not None and not config.DISABLE_JIT:
        compiled._cache = _Kept(function)
    return compiled


# A process that is forked while another thread compiles would find the compiler locked for ever.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(
        before=global_compiler_lock.acquire,
        after_in_parent=global_compiler_lock.release,
        after_in_child=global_compiler_lock.release,
    )


def kernel(function):
    """Compile a loop over arrays on first use: without the GIL, kept on disk. Division by zero yields inf or nan, as in
    numpy."""
    return _compile_lazily(function, **_OPTIONS)


def helper(function):
    """Compile a scalar function that kernels call; it is inlined into them and needs no cache entry of its own.

    It has no entry for Python, which would take a quarter of all compile time: from Python call its `py_func`.
    """
    return numba.njit(forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, **_OPTIONS)(function)


@functools.cache
def row_function(function, dtype):
    """Compile `function(rows, n, params)`, where rows and params point to `dtype`; return a numba CFunc.

    A kernel calls it through its `address` with `call_row`. So one kernel serves every kind of light and every
    reflection model, and only those that a scene uses are ever compiled. Keep the CFunc as long as the address is in
    use.
    """
    number = numba.from_dtype(numpy.dtype(dtype))
    pointer = numba.types.CPointer(number)
    signature = numba.types.void(pointer, numba.types.intp, pointer)
    # What `numba.cfunc` does, with a cache of our own.
    options = {"error_model": "numpy", "nopython": True}
    compiled = CFunc(function, sigutils.normalize_signature(signature), locals={}, options=options)
    # The folder's name tells of this package's sources alone, not of those of a light that somebody registered.
    is_own = function.__module__.partition(".")[0] == __name__.partition(".")[0]
    if CACHE_FOLDER is not None and is_own:
        compiled._cache = _Kept(function)
    compiled.compile()
    return compiled


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

    A slice of a counted array costs two atomic operations, about 10 ns: more than a span of a small triangle. The
    caller of a kernel holds its arguments for the kernel's whole run, so what is borrowed from them stays valid.
    """

    def generate(context, builder, signature, arguments):
        struct = context.make_array(signature.args[0])(context, builder, arguments[0])
        struct.meminfo = ir.Constant(struct.meminfo.type, None)
        struct.parent = ir.Constant(struct.parent.type, None)
        return struct._getvalue()

    return array(array), generate
