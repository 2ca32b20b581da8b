"""Machine code in memory: it needs nothing but the C library and Python, and what is none is refused, not run."""

import ctypes
import platform
import sys

import llvmlite.binding as llvm
import numpy as np
import pytest
from helpers.raster import assert_runs
from helpers.stores import split_file

from rasterizer.compiler import internals, kernels, store
from rasterizer.compiler.machine_code import COFF, IN_EVERY_FILE, MACH_O, Code, LoadedCode, is_found, place, read_names
from rasterizer.compiler.signatures import Table

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
ALLOWED = PYTHON | MATHEMATICS | {f"{name}f" for name in MATHEMATICS} | {"memcpy", "memmove", "memset"} | IN_EVERY_FILE


linux = pytest.mark.skipif(sys.platform != "linux", reason="object files are of another format")


def halves(x):
    return x[0] * 0.5


def halves_code() -> Code:
    return internals.compile_kernel(halves, (("array", "float64", 1, "C"),))


# ---------------------------------------------------------------- what there is


def test_code_becomes_bytes_and_back():
    for code in (halves_code(), Code(b"", ()), Code(b"\nx y\n\n", ("a", "b"))):
        assert Code.of_bytes(code.as_bytes()) == code


def test_functions_of_the_c_library_and_of_python_are_found():
    assert is_found("pow") and is_found("PyLong_FromLongLong") and not is_found("nowhere_at_all")


def test_every_kernel_of_the_package_needs_nothing_of_numba():
    """So it runs where numba is not loaded. Looks at all that `raster warmup` has put into the store."""
    if kernels.STORE.own is None:
        pytest.skip("there is no store")
    paths = sorted(path for path in kernels.STORE.own.glob(f"*{store.SUFFIX}") if not path.name.startswith("list-of-"))
    assert len(paths) > 40, f"only {len(paths)} kernels are stored <= 40"
    for path in paths:
        code = Code.of_bytes(split_file(path.read_bytes())[1])
        _, undefined = read_names(code.content)
        strange = {*code.undefined, *undefined} - ALLOWED
        assert not strange, f"{path.name} needs {', '.join(sorted(strange))}"


# ---------------------------------------------------------------- what is none


def test_code_that_needs_what_is_nowhere_or_has_no_entry_point_is_refused():
    code = halves_code()
    assert LoadedCode(code, "entry").address
    with pytest.raises(LookupError, match="no function nowhere_at_all, numba_nothing"):
        LoadedCode(code._replace(undefined=("numba_nothing", *code.undefined, "nowhere_at_all")), "entry")
    with pytest.raises(LookupError, match="no entry point another"):
        LoadedCode(code, "another")


def test_code_does_the_same_whether_it_is_put_into_memory_here_or_by_llvm(monkeypatch):
    """Calls of the C library, constants, and numbers that Python gets."""

    def mixed(x):
        total = 0.0
        for k in range(len(x)):
            total += np.log2(x[k]) ** 1.7 + (2.5, 3.5, 4.5, 5.5)[k & 3]
        return total, len(x)

    code = internals.compile_kernel(mixed, (("array", "float64", 1, "C"),))
    numbers, found = np.arange(1.0, 99.0), []
    table = Table((numbers,))
    for machine in (platform.machine(), "one that only LLVM knows"):
        monkeypatch.setattr(platform, "machine", lambda machine=machine: machine)
        loaded = LoadedCode(code, "entry")
        call = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.py_object, ctypes.c_void_p)(loaded.address)
        found.append(call((numbers,), table.address))
    assert found[0] == found[1] and np.isclose(found[0][0], mixed(numbers)[0])


@linux
def test_every_kernel_is_put_into_memory_without_llvm():
    if kernels.STORE.own is None or platform.machine() != "x86_64":
        pytest.skip("there is no store, or no code for x86-64 in it")
    for path in kernels.STORE.own.glob(f"*{store.SUFFIX}"):
        if not path.name.startswith("list-of-"):
            code = Code.of_bytes(split_file(path.read_bytes())[1])
            needed = {*code.undefined, *read_names(code.content)[1]} - IN_EVERY_FILE
            assert place(code.content, "entry", sorted(needed)), path.name


@linux
def test_a_changed_file_is_placed_inside_of_its_memory_or_not_at_all():
    """What is to be filled in stands in a section, and what it is filled with in another, or in a function."""
    content, rng = object_file(SOURCE.replace("i64 @nowhere_at_all", "i64 @clock")), np.random.default_rng(5)
    assert (place(content, "entry", ["clock", "pow"]) is None) == (platform.machine() != "x86_64")
    for _ in range(1000):
        changed = bytearray(content)
        for k in rng.integers(0, len(content), rng.integers(1, 4)):
            changed[k] = rng.integers(256)
        place(bytes(changed), "entry", ["clock", "pow"])


WRONG = """
import llvmlite.binding as llvm
import numpy as np
from rasterizer.compiler.machine_code import Code, LoadedCode

llvm.initialize_native_target()
llvm.initialize_native_asmprinter()
machine = llvm.Target.from_default_triple().create_target_machine(codemodel="jitdefault", jit=True)
lacking = "declare i64 @nowhere()\\ndefine i64 @entry() {\\n %r = call i64 @nowhere()\\n ret i64 %r }"
sources = "define i64 @entry() { ret i64 3 }", "define i64 @other() { ret i64 3 }", lacking
content, *wrong = (machine.emit_object(llvm.parse_assembly(source)) for source in sources)
rng = np.random.default_rng(7)
wrong += [b"", b"hello" * 99, rng.bytes(len(content)), bytes(len(content)), content[1:], b"BC" + content]
wrong += [content[: len(content) * k // 50] for k in range(50)]
wrong += [content[:64] + rng.bytes(len(content) - 64), content[:-300] + rng.bytes(300)]
for each in wrong:
    try:
        LoadedCode(Code(each, ()), "entry")
    except (LookupError, ValueError):
        continue
    raise AssertionError(f"took {len(each)} bytes that are no code: {each[:20]}")
assert LoadedCode(Code(content, ()), "entry").address
"""


def test_what_is_no_object_code_is_refused_and_ends_no_process():
    """As a wrong program may store it, under a checksum that is right: LLVM would end the process."""
    assert_runs(WRONG)


def test_a_callback_has_the_convention_that_is_told():
    """void entry(void *batch, int64 n, void *coefficients)."""

    def scales(batch, n, coefficients):
        for k in range(n):
            batch[k] *= coefficients[0]

    loaded = LoadedCode(internals.compile_batch_function(scales, np.float32), "entry")
    values, factor = np.arange(4, dtype=np.float32), np.array([3], np.float32)
    call = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)(loaded.address)
    call(values.ctypes.data, 3, factor.ctypes.data)
    assert values.tolist() == [0, 3, 6, 3]


# ---------------------------------------------------------------- object file

# What object files need and offer: read from those that LLVM writes, and refused where anything is missing.


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


@linux
def test_names_are_those_of_the_source():
    defined, undefined = read_names(object_file())
    assert {"entry", "table"} <= defined and not undefined & defined
    assert {"nowhere_at_all", "pow"} <= undefined <= {"nowhere_at_all", "pow", "_GLOBAL_OFFSET_TABLE_"}


@linux
def test_a_file_that_is_cut_off_anywhere_is_refused():
    content = object_file()
    for n_byte in [*range(200), *range(200, len(content), 7), len(content) - 1]:
        with pytest.raises(ValueError, match="no (whole )?object file"):
            read_names(content[:n_byte])


@linux
def test_changed_bytes_are_read_or_refused():
    """Nothing but a ValueError: and what is read is never more than there is."""
    content, rng = object_file(), np.random.default_rng(4)
    n_refused = 0
    for _ in range(1000):
        changed = bytearray(content)
        for k in rng.integers(0, len(content), rng.integers(1, 4)):
            changed[k] = rng.integers(256)
        try:
            defined, undefined = read_names(bytes(changed))
            assert sum(map(len, defined | undefined)) < 50 * len(content)
        except ValueError:
            n_refused += 1
    assert n_refused > 30, f"only {n_refused} of 1000 changed files were refused"


def test_what_is_no_object_file_is_refused():
    for content in (b"", b"hello\n" * 99, bytes(999), b"\x7fELF", b"\x7fELF\x01" + bytes(99), b"BC\xc0\xde"):
        with pytest.raises(ValueError, match="no (whole )?object file"):
            read_names(content)


def test_files_of_other_systems_are_not_looked_into(monkeypatch):
    for content in (MACH_O + bytes(99), COFF + bytes(99)):
        monkeypatch.setattr(sys, "platform", "darwin")
        assert read_names(content) == (set(), set())
        monkeypatch.setattr(sys, "platform", "linux")
        with pytest.raises(ValueError, match="it is no object file"):
            read_names(content)
