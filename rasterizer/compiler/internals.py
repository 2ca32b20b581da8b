"""What the package uses of numba beyond what numba's manual promises; no other module touches it.

Each of these may change in any version without notice. All were seen to work in the versions SEEN, which setup.cfg
admits; tests/compiler/test_internals.py tries each one alone in the version that is installed.

    name in numba (0.61 to 0.68)                     used for                                      instead, elsewhere
    ------------------------------------------------ --------------------------------------------- --------------------
    Dispatcher._cache, CFunc._cache                  files of our own for machine code             nothing on disk
    core.caching.NullCache                           what numba asks of a cache                    nothing on disk
    core.compiler.CompileResult._rebuild, ._reduce   machine code from bytes, and to bytes         nothing on disk
    core.serialize.dumps                             the same                                      nothing on disk
    codegen().magic_tuple()                          which processor the code is for               nothing on disk
    core.ccallback.CFunc, core.sigutils              a C callback whose cache can be set           numba.cfunc
    njit(forceinline=, no_cpython_wrapper=,          inlining, and a quarter less to compile       njit without them
         no_cfunc_wrapper=)
    core.config.NAME                                 settings that change the code                 nothing on disk
    core.compiler_lock.global_compiler_lock          forks that don't inherit a held lock          forks are not guarded
    core.event, "numba:run_pass"                     telling that a compilation begins             it isn't told
    context.make_array, .meminfo, .parent            arrays without reference counts (`borrow`)    the array itself
    context.get_dummy_value                          what an intrinsic returns that returns None   (the same)
    core.cgutils; typed pointers of llvmlite.ir      vector instructions (simd_ops.py)             plain loops, compiled

In other versions the last column holds, with a warning in the log: slower, never broken. What the manual documents is
used everywhere: njit, cfunc, carray, from_dtype, types, config.DISABLE_JIT, and of numba.extending `intrinsic`,
`overload` and `register_jitable`.

With the JIT switched off (NUMBA_DISABLE_JIT=1) nothing here compiles anything: see `lowered_by` and
kernels.PlainBatchFunction.
"""

import contextlib
import functools
import logging
import os
import pickle
import re
import sys
from collections.abc import Callable
from pathlib import Path

import llvmlite
import numba
import numba.extending
import numpy
from llvmlite import ir

from . import store

SEEN = (0, 61), (0, 68)  # the first and the last version of numba; each brings one version of llvmlite, 0.44 to 0.50
# Settings of numba that change the code that it makes; each is also an environment variable, NUMBA_...
CODE_SETTINGS = (
    "BOUNDSCHECK", "CPU_FEATURES", "CPU_NAME", "DEBUGINFO_DEFAULT", "DEBUG_NRT", "DISABLE_INTEL_SVML", "ENABLE_AVX",
    "ENABLE_PROFILING", "ENABLE_SYS_MONITORING", "EXTEND_VARIABLE_LIFETIMES", "LLVM_REFPRUNE_FLAGS",
    "LLVM_REFPRUNE_PASS",
    "LOOP_VECTORIZE", "NRT_STATS", "OPT", "SLP_VECTORIZE", "USING_SVML",
)  # fmt: skip

_log = logging.getLogger("rasterizer")


def is_seen(version: str) -> bool:
    """Tell whether a version of numba, such as "0.68.1", is one that this module was tried in."""
    numbers = re.match(r"(\d+)\.(\d+)", version)
    return numbers is not None and SEEN[0] <= (int(numbers[1]), int(numbers[2])) <= SEEN[1]


IS_SEEN = is_seen(numba.__version__)
IS_COMPILING = not numba.config.DISABLE_JIT

if IS_SEEN:
    from numba.core import cgutils, compiler, event, serialize, sigutils
    from numba.core.caching import NullCache
    from numba.core.ccallback import CFunc
    from numba.core.compiler_lock import global_compiler_lock
else:
    NullCache, cgutils = object, None
    _log.warning(
        "numba %s is not among the versions that rasterizer was tried with, %d.%d to %d.%d: "
        "compiled kernels are not kept on disk, so that every run begins with compiling",
        numba.__version__, *SEEN[0], *SEEN[1],
    )  # fmt: skip

# Options of njit for functions that are inlined into kernels, and that Python never calls.
INLINED = {"forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True} if IS_SEEN else {}


# ---------------------------------------------------------------- machine code on disk


def describe_compiler() -> str:
    """Say what decides, beside the sources, what code is made."""
    versions = numba.__version__, llvmlite.__version__, numpy.__version__, sys.implementation.cache_tag
    return repr((versions, [(name, str(getattr(numba.config, name, None))) for name in CODE_SETTINGS]))


class KernelFiles(NullCache):
    """One function's compiled forms in a folder: what dispatchers and CFuncs ask for and hand over.

    function : the function that is compiled
    folder : where the files are, see store.py
    """

    def __init__(self, function: Callable, folder: Path):
        self._function = function
        self._folder = folder
        self._title = f"{function.__module__.rpartition('.')[2]}.{function.__name__}"

    @property
    def cache_path(self) -> str:
        """The folder, as numba's statistics tell it."""
        return str(self._folder)

    def _key(self, signature, codegen) -> bytes:
        where = self._function.__module__, self._function.__qualname__, self._function.__code__.co_firstlineno
        return repr((describe_compiler(), where, str(signature), codegen.magic_tuple())).encode()

    def load_overload(self, sig, target_context):
        """Return what was compiled for a signature, or None."""
        target_context.refresh()
        code = store.read_code(self._folder, self._title, self._key(sig, target_context.codegen()))
        if code is None:
            return None
        try:
            return compiler.CompileResult._rebuild(target_context, *pickle.loads(code))
        # Unpickling raises anything: here what numba of this very version doesn't know any more.
        except Exception as fault:  # noqa: BLE001
            _log.info("kernel %s can't be loaded and is compiled again (%s)", self._title, fault)
            return None

    def save_overload(self, sig, data) -> None:
        """Keep what was compiled; code that holds addresses of this process can't be kept."""
        if not data.lifted and not data.library.has_dynamic_globals:
            store.write_code(self._folder, self._title, self._key(sig, data.codegen), serialize.dumps(data._reduce()))


def keep_on_disk(dispatcher, folder: Path | None):
    """Let a function that `numba.njit` returned find its machine code in a folder; return it.

    Nobody else's functions, and not numba's setting for its own cache, are touched. Nothing is kept where `folder` is
    None.
    """
    if folder is not None and IS_SEEN and IS_COMPILING:
        dispatcher._cache = KernelFiles(dispatcher.py_func, folder)
    return dispatcher


def compile_callback(function: Callable, signature, folder: Path | None):
    """Compile a C callback, as `numba.cfunc` does, with its machine code in a folder, and return it.

    signature : numba's types of the result and of the arguments
    """
    options = {"error_model": "numpy", "nopython": True}
    if not IS_SEEN:
        return numba.cfunc(signature, **options)(function)
    callback = CFunc(function, sigutils.normalize_signature(signature), locals={}, options=options)
    if folder is not None:
        callback._cache = KernelFiles(function, folder)
    callback.compile()
    return callback


# ---------------------------------------------------------------- while something is compiled


def guard_forks() -> None:
    """Let no process be forked while another thread compiles: it would find the compiler locked for ever."""
    if IS_SEEN and hasattr(os, "register_at_fork"):
        os.register_at_fork(
            before=global_compiler_lock.acquire,
            after_in_parent=global_compiler_lock.release,
            after_in_child=global_compiler_lock.release,
        )


def watch_compiling(notice: Callable[[], None]) -> contextlib.AbstractContextManager:
    """Call `notice` whenever the compiler begins with something, inside the block; never for code from the disk."""
    if not IS_SEEN:
        return contextlib.nullcontext()

    class Watcher(event.Listener):
        def on_start(self, _event):
            notice()

        def on_end(self, _event):
            pass

    # Passes of the compiler run only where machine code wasn't found on disk.
    return event.install_listener("numba:run_pass", Watcher())


# ---------------------------------------------------------------- functions that are spelled out for the compiler


def lowered_by(build: Callable, is_documented: bool = False) -> Callable:
    """Decorate a plain function whose instructions `build` spells out, where the compiler wouldn't find them itself.

    The plain function says what is computed. It is what runs with the JIT switched off; in a version of numba that was
    not seen it is compiled like any other.

    Parameters
    ----------
    build : as `numba.extending.intrinsic` takes it: (typing_context, *types) -> (signature, code generator)
    is_documented : `build` uses nothing but what the manuals of numba and llvmlite describe, so it does in any version
    """

    def choose(plain):
        if not IS_COMPILING:
            return plain
        if IS_SEEN or is_documented:
            spelled_out = functools.update_wrapper(numba.extending.intrinsic(build), plain)
            spelled_out.py_func = plain  # as numba's own dispatchers have it
            return spelled_out
        return numba.extending.register_jitable(plain)

    return choose


def build_borrow(typing_context, array):
    """Build `kernels.borrow`: the array's struct without the object that counts its references."""

    def generate(context, builder, signature, arguments):
        struct = context.make_array(signature.args[0])(context, builder, arguments[0])
        struct.meminfo = cgutils.get_null_value(struct.meminfo.type)
        struct.parent = cgutils.get_null_value(struct.parent.type)
        return struct._getvalue()

    return array(array), generate


def build_call(typing_context, address, batch, n, coefficients):
    """Build `kernels.call_batch_function`: a call through a pointer to a function."""
    signature = numba.types.void(numba.types.intp, numba.types.intp, numba.types.intp, numba.types.intp)

    def generate(context, builder, _signature, arguments):
        whole = ir.IntType(64)
        function_type = ir.FunctionType(ir.VoidType(), [whole, whole, whole])
        builder.call(builder.inttoptr(arguments[0], function_type.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    return signature, generate
