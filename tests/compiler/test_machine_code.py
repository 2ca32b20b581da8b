"""Machine code in memory: it needs nothing but the C library and Python, and what is none is refused, not run."""

import ctypes
import platform

import llvmlite.binding as llvm
import numpy as np
import pytest
from helpers.stores import split_file

from rasterizer.compiler import internals, kernels, store
from rasterizer.compiler.kernels import ArgumentTypes
from rasterizer.compiler.machine_code import LoadedCode

# What machine code of the package may call.
PYTHON = {
    "PyBool_FromLong", "PyErr_Clear", "PyErr_Occurred", "PyErr_SetString", "PyEval_RestoreThread", "PyEval_SaveThread",
    "PyFloat_AsDouble", "PyFloat_FromDouble", "PyLong_AsLongLong", "PyLong_AsUnsignedLongLongMask",
    "PyLong_FromLongLong", "PyLong_FromUnsignedLongLong", "PyObject_IsTrue", "PyTuple_New", "PyTuple_SetItem",
    "Py_IncRef",
}  # fmt: skip
MATHEMATICS = {
    "acos", "asin", "atan", "atan2", "ceil", "cos", "exp", "exp2", "floor", "fma", "fmod", "hypot", "ldexp", "log",
    "log10", "log1p", "log2", "nearbyint", "pow", "rint", "round", "sin", "sincos", "sqrt", "tan", "trunc",
}  # fmt: skip
ALLOWED = PYTHON | MATHEMATICS | {f"{name}f" for name in MATHEMATICS} | {"memcpy", "memmove", "memset"}


def halves(x):
    return x[0] * 0.5


def halves_code() -> bytes:
    return internals.compile_signature(halves, (("array", "float64", 1, "C"),))


# ---------------------------------------------------------------- what there is


def test_every_kernel_of_the_package_needs_nothing_of_numba():
    """So it runs where numba is not loaded. Looks at all that `raster warmup` has put into the store."""
    if kernels.STORE.own is None:
        pytest.skip("there is no store")
    paths = sorted(path for path in kernels.STORE.own.glob(f"*{store.SUFFIX}") if not path.name.startswith("list-of-"))
    assert len(paths) > 40, f"only {len(paths)} kernels are stored <= 40"
    for path in paths:
        needed = split_file(path.read_bytes())[1].partition(b"\n")[0].decode().split()
        strange = {*needed} - ALLOWED
        assert not strange, f"{path.name} needs {', '.join(sorted(strange))}"


# ---------------------------------------------------------------- what is none


def test_code_that_needs_what_is_nowhere_or_has_no_entry_point_is_refused():
    """Where it is put into memory without LLVM, and by it."""
    code = halves_code()
    assert LoadedCode(code).address
    other = b"\n" + object_file(SOURCE.replace("@entry", "@another").replace("@nowhere_at_all", "@clock"))
    for lacking, reason in (
        (b"numba_nothing nowhere_at_all\n" + object_file(SOURCE), "no function numba_nothing, nowhere_at_all"),
        (other, "no entry point"),
    ):
        with pytest.raises(LookupError, match=reason):
            LoadedCode(lacking)


def test_code_does_the_same_whether_it_is_put_into_memory_here_or_by_llvm(monkeypatch):
    """Calls of the C library, constants, and numbers that Python gets."""

    def mixed(x):
        total = 0.0
        for k in range(len(x)):
            total += np.log2(x[k]) ** 1.7 + (2.5, 3.5, 4.5, 5.5)[k & 3]
        return total, len(x)

    numbers, found = np.arange(1.0, 99.0), []
    types = ArgumentTypes((numbers,))
    code = internals.compile_signature(mixed, types.signature)
    for machine in (platform.machine(), "one that only LLVM knows"):
        monkeypatch.setattr(platform, "machine", lambda machine=machine: machine)
        loaded = LoadedCode(code)
        call = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.py_object, ctypes.c_void_p)(loaded.address)
        found.append(call((numbers,), types.address))
    assert found[0] == found[1] and np.isclose(found[0][0], mixed(numbers)[0])


# ---------------------------------------------------------------- object file

SOURCE = """
declare i64 @nowhere_at_all()
declare double @pow(double, double)
@table = global [99 x i64] zeroinitializer
define internal i64 @hidden() { ret i64 3 }
define i64 @entry(ptr %a) {
  %x = call i64 @nowhere_at_all()
  %y = call double @pow(double 2.0, double 3.0)
  %z = call i64 @hidden()
  ret i64 %x
}
"""


def object_file(source=SOURCE) -> bytes:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine(codemodel="jitdefault", jit=True)
    return machine.emit_object(llvm.parse_assembly(source.replace("ptr", "i8*")))
