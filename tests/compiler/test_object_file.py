"""What object files need and offer: read from those that LLVM writes, and refused where anything is missing."""

import sys

import llvmlite.binding as llvm
import numpy as np
import pytest

from rasterizer.compiler.machine_code import COFF, MACH_O, read_names

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
linux = pytest.mark.skipif(sys.platform != "linux", reason="object files are of another format")


def object_file(source=SOURCE) -> bytes:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine(codemodel="jitdefault", jit=True)
    return machine.emit_object(llvm.parse_assembly(source.replace("ptr", "i8*")))


@linux
def test_names_are_those_of_the_source():
    defined, needed = read_names(object_file())
    assert {"entry", "table"} <= defined and not needed & defined
    assert {"nowhere_at_all", "pow"} <= needed <= {"nowhere_at_all", "pow", "_GLOBAL_OFFSET_TABLE_"}


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
        for place in rng.integers(0, len(content), rng.integers(1, 4)):
            changed[place] = rng.integers(256)
        try:
            defined, needed = read_names(bytes(changed))
            assert sum(map(len, defined | needed)) < 50 * len(content)
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
