"""The decorators of every compiled function.

`kernel` is for loops over arrays: it releases the GIL, so that bands run on threads. `helper` is for scalar functions
that kernels call: the compiler inlines them. `by_type` is for those that are another function for float32 than for
float64, `spelled_out` for those whose instructions the compiler is told. `batch_function` is for functions that kernels
call by their address.

Nothing here loads the compiler. A kernel's machine code comes from the store (store.py), for each signature
(`ArgumentTypes`) that it is called with, and is called through its entry point (entry_points.py). Only where the store
has none is it compiled (internals.py) and kept. A kernel that makes no such code is compiled by `numba.njit`, which
calls it: slower to begin with, with the same results. RASTER_STORE=off in the environment asks for that.

From Python every helper is the plain function that stands in its source. With NUMBA_DISABLE_JIT=1 kernels are, too: a
debugger steps through them, and a small picture takes seconds.
"""

import contextlib
import contextvars
import ctypes
import functools
import logging
import sys
from collections.abc import Callable, Iterable

import numpy as np

from ..errors import RasterizerError
from ..locks import LOCK
from . import fingerprint
from .layouts import COMMON
from .machine_code import LoadedCode
from .store import Store, is_own, title_of

# Threads share out work through iterators, and entry points read objects without locks.
if not getattr(sys, "_is_gil_enabled", lambda: True)():
    raise RasterizerError("Python's global interpreter lock is off: set PYTHON_GIL=1 in the environment to draw")

Job = tuple[Callable, tuple]  # a kernel that is compiled: its plain function, and a signature

IS_COMPILING = not fingerprint.setting("DISABLE_JIT")
STORE = Store.of_process(IS_COMPILING)

_log = logging.getLogger("rasterizer")


def _internals():
    """Load the compiler; ImportError where it is of a version that was not tried, as it is used beyond its manual."""
    version, (first, last) = fingerprint.numba_version(), fingerprint.SEEN
    if not fingerprint.is_seen(version):
        raise ImportError(f"kernels are compiled by numba {first[0]}.{first[1]} to {last[0]}.{last[1]}, not {version}")
    from . import internals

    return internals


# ---------------------------------------------------------------- loops


def kernel(function: Callable) -> Callable:
    """Compile a loop over arrays on first use: without the GIL, kept in the store.

    Division by zero yields inf or nan, and integers wrap, both in silence. An index counts from an array's start: a
    negative one isn't tested for, as that test keeps loops from becoming vector instructions. Signed and unsigned
    integers aren't mixed, as numba makes a float64 of their sum. Arguments are given by position. A kernel doesn't
    allocate, raise or print, and returns None, a bool, a number or a tuple of these: else it can't be kept.
    """
    return Kernel(function) if IS_COMPILING else np.errstate(all="ignore")(function)


class Kernel:
    """A compiled loop: it is called like the plain function `py_func`."""

    def __init__(self, function: Callable):
        functools.update_wrapper(self, function)
        self.py_func = function
        self._entries = []  # (entry point, address of a table, its ArgumentTypes) of the types of arguments met so far
        self._loaded = {}  # signature -> (entry point, its LoadedCode)
        self._by_numba = None  # what numba made of it, where it has no entry points

    def __call__(self, *arguments):
        """Run the loop."""
        for entry_point, table, _ in self._entries:
            result = entry_point(arguments, table)
            if result is not NotImplemented:
                return result
        return self._call_first(arguments)

    @property
    def signatures(self) -> list:
        """The signatures that it was called with in this process."""
        return [*self._loaded, *(self._by_numba.signatures if self._by_numba is not None else ())]

    def _call_first(self, arguments):
        """Call the kernel with arguments of types that were not met before."""
        types = ArgumentTypes(arguments)
        with LOCK:
            if types.signature not in self._loaded and self._by_numba is None:
                loaded = load(self.py_func, types.signature) if STORE.is_used else None
                if loaded is None:
                    self._by_numba = _internals().compile_by_numba(self.py_func)
                # Who lists what is to be compiled ahead may have called this kernel meanwhile: what it got is in use.
                elif types.signature not in self._loaded:
                    self._loaded[types.signature] = _ENTRY_POINT(loaded.address), loaded
            entry_point, _ = self._loaded.get(types.signature, (None, None))
        if entry_point is not None:
            result = entry_point(arguments, types.address)
            if result is not NotImplemented:
                self._entries.append((entry_point, types.address, types))
                return result
        if self._by_numba is None:  # the signature tells of more than the entry point can read
            title, known = title_of(self.py_func), types.signature
            _log.info("kernel %s is left to numba: its entry point doesn't know %s", title, known)
            self._by_numba = _internals().compile_by_numba(self.py_func)
        return self._by_numba(*arguments)


_ENTRY_POINT = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.py_object, ctypes.c_void_p)


def load(function: Callable, signature: tuple) -> LoadedCode | None:
    """Return the machine code of a function in memory: from the store, else compiled and put there.

    None where neither is possible: the log says why.
    """
    code = STORE.find(function, signature)
    if code is None and _ahead.get() is not None:
        _compile_ahead((function, signature))
        code = STORE.find(function, signature)
    if code is not None:
        try:
            return LoadedCode(code)
        except (LookupError, RuntimeError) as fault:
            _log.info("kernel %s can't be loaded and is compiled again (%s)", title_of(function), fault)
    internals = _internals()
    if notice := _notice.get():
        notice(function.__name__, 0, 1)
    try:
        code = internals.compile_signature(function, signature)
        STORE.keep(function, signature, code)
        return LoadedCode(code)
    except (internals.NotStandalone, LookupError, RuntimeError) as reason:
        _log.info("kernel %s is left to numba: %s", title_of(function), reason)
        return None


# ---------------------------------------------------------------- signatures
#
# What types of arguments a kernel is called with, in plain tuples that are written, read and compared.
#
#     argument                          its part of a signature
#     --------------------------------- -----------------------------------------------------------------
#     array                             ("array", dtype, number of axes, layout), layout "C", "F" or "A" (any)
#     tuple, NamedTuple                 ("tuple", class, parts), the class as "module:name", "" of a plain tuple
#     int, float, bool, NumPy's scalar  the name of its dtype, such as "int64"
#     None                              "none"
#
# One machine code serves all arguments with the same signature. Whether an array may be written to is no part of it:
# kernels write to their outputs only. An entry point finds out whether it is called with such arguments: it compares
# them with a table, and reads them where they stand in memory.

_MIN_INT, _MAX_INT = -(2**63), 2**63 - 1
_PLAIN = {int: "int64", float: "float64", bool: "bool", type(None): "none"}
_NUMBERS = "?fd" + np.typecodes["AllInteger"]  # the dtypes of which kernels take numbers


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
            if cls is int and not _MIN_INT <= value <= _MAX_INT:
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


# ---------------------------------------------------------------- many at once

# What the current context does about kernels that are not in the store.
_ahead = contextvars.ContextVar("ahead", default=None)  # what lists them, until the first one is missing
_notice = contextvars.ContextVar("notice", default=None)  # None = many at once show a line on stderr


@contextlib.contextmanager
def compiling_ahead(list_kernels: Callable[[], Iterable[Job]]):
    """Where a kernel is missing inside the block, compile all that `list_kernels()` returns at once, on all cores.

    Without effect where there is no folder for new kernels, or no Python to start.
    """
    is_possible = STORE.own is not None and bool(sys.executable) and not getattr(sys, "frozen", False)
    token = _ahead.set(list_kernels if is_possible else None)
    try:
        yield
    finally:
        _ahead.reset(token)


@contextlib.contextmanager
def noticing_compilation(notice: Callable[[str, int, int], None]):
    """Call `notice(name, n_done, n_job)` whenever inside the block a kernel begins to be compiled; nothing is shown
    then."""
    token = _notice.set(notice)
    try:
        yield
    finally:
        _notice.reset(token)


def _compile_ahead(missing) -> None:
    """Compile a missing kernel and what else the picture takes, as far as it isn't stored."""
    list_kernels = _ahead.get()
    _ahead.set(None)  # once: what is still missing afterwards is compiled where it is met
    compile_into(STORE, missing_in(STORE, [missing, *list_kernels()]))


def missing_in(store: Store, listed: Iterable[Job]) -> list[Job]:
    """Return those of some kernels that a store doesn't have, and can, each once."""
    return [
        (function, signature)
        for function, signature in dict.fromkeys(listed)
        if is_own(function) and store.find(function, signature) is None
    ]


def compile_into(store: Store, jobs: list[Job]) -> None:
    """Compile kernels into a store, in as many processes as there are cores."""
    from .jobs import compile_together  # it starts processes: most runs have no need of it

    compile_together(jobs, store.own, _notice.get())


# ---------------------------------------------------------------- what kernels call


class Helper:
    """A function that kernels call; from Python it is the plain function `py_func`.

    `compile` makes of it what numba knows, when a kernel is compiled that calls it.
    """

    def __init__(self, function: Callable, compile: Callable, is_one: bool = False):
        functools.update_wrapper(self, function)
        self.py_func, self._compile, self._is_one = function, compile, is_one
        # What was compiled and its type: for callers that count references to arrays, and for others; or one for both.
        self._compiled = {}

    def __call__(self, *arguments):
        """Run the plain function."""
        return self.py_func(*arguments)

    @property
    def _numba_type_(self):
        """What numba takes this for in a kernel."""
        is_counting = self._is_one or _internals().is_counting()
        if is_counting not in self._compiled:
            compiled = self._compile()  # kept: its type doesn't hold it
            self._compiled[is_counting] = compiled, _internals().type_of(compiled)
        return self._compiled[is_counting][1]


def helper(function: Callable) -> Callable:
    """Compile a scalar function with the kernels that call it; it is inlined into them."""
    return Helper(function, lambda: _internals().compile_helper(function)) if IS_COMPILING else function


def by_type(single: Callable, double: Callable) -> Callable:
    """Return a function that is one of two helpers with the same parameters: `single` where its first argument, a
    number or an array, is float32, else `double`. The compiler compiles no other."""

    def call(*arguments):
        return (single if getattr(arguments[0], "dtype", None) == np.float32 else double)(*arguments)

    def choose(*types):
        return (single if str(getattr(types[0], "dtype", types[0])) == "float32" else double).py_func

    functools.update_wrapper(call, getattr(double, "py_func", double))
    return Helper(call, lambda: _internals().compile_by_type(call, choose)) if IS_COMPILING else call


def spelled_out(name: str) -> Callable:
    """Decorate a plain function whose instructions the compiler is told: it wouldn't find them itself.

    The plain function says what is computed. It is what runs with the JIT switched off.

    name : the function that builds the instructions, in the module `intrinsics` beside that of the plain function
    """

    def decorate(function):
        return Helper(function, lambda: _internals().compile_intrinsic(function, name), is_one=True)

    return decorate if IS_COMPILING else lambda function: function


def as_array(pointer, shape):
    """Return the array of a known shape at a typed pointer (inside batch functions only)."""
    return np.ctypeslib.as_array(pointer, shape)


def call_batch_function(address, batch, n, coefficients):
    """Call the batch function at `address` with the addresses of two arrays and a count (inside kernels only)."""
    ctypes.cast(int(address), ctypes.py_object).value(int(batch), int(n), int(coefficients))


if IS_COMPILING:
    as_array = Helper(as_array, lambda: _internals().build_array, is_one=True)
    call_batch_function = Helper(call_batch_function, lambda: _internals().build_call, is_one=True)


# ---------------------------------------------------------------- functions that are called by their address


class BatchFunction:
    """A compiled function `(batch, n, coefficients)` with addresses of arrays, which kernels call by its `address`."""

    def __init__(self, function: Callable, dtype):
        self.py_func = function
        self.signatures = [("batch function", np.dtype(dtype).name)]
        with LOCK:
            loaded = load(function, self.signatures[0]) if STORE.is_used else None
            self._kept = loaded or _internals().compile_callback(function, dtype)
        self.address = self._kept.address

    def __call__(self, batch: int, n: int, coefficients: int) -> None:
        """Call the function with the addresses of two arrays."""
        ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)(self.address)(batch, n, coefficients)


class PlainBatchFunction:
    """What `batch_function` returns with the JIT switched off: the function itself, as it stands in its source.

    `address` is that of this object (CPython's `id`), which `call_batch_function` turns back into it.
    """

    def __init__(self, function: Callable, dtype):
        self.py_func = function
        self._pointer = ctypes.POINTER(np.ctypeslib.as_ctypes_type(dtype))
        self.address = id(self)

    def __call__(self, batch: int, n: int, coefficients: int) -> None:
        """Call the function with typed pointers to two arrays."""
        self.py_func(ctypes.cast(batch, self._pointer), n, ctypes.cast(coefficients, self._pointer))


def batch_function(function: Callable, dtype) -> BatchFunction | PlainBatchFunction:
    """Compile `function(batch, n, coefficients)`, where both are addresses of arrays of `dtype`.

    A kernel calls it through its `address` with `call_batch_function`. So one kernel serves every type of light and
    every reflection model, and only those that a scene uses are ever compiled.
    """
    key = function, np.dtype(dtype).name
    if key not in _batch_functions:
        with LOCK:  # two threads must get the same one: what is not kept is taken out of memory
            if key not in _batch_functions:
                made_by = BatchFunction if IS_COMPILING else PlainBatchFunction
                _batch_functions[key] = made_by(function, np.dtype(dtype))
    return _batch_functions[key]


_batch_functions = {}  # kept for good: whoever has an address may call it
