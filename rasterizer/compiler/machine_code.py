"""Object code into memory, by llvmlite alone.

The code is what compiler/internals.py makes: one object file that holds a kernel and its entry point. It needs
functions of the C library and of Python, and nothing else.
"""

import ctypes
from typing import NamedTuple

import llvmlite.binding as llvm

from .object_file import read_names

IN_EVERY_FILE = {"_GLOBAL_OFFSET_TABLE_"}  # a name that the linker itself defines


class Code(NamedTuple):
    """What the compiler made of a kernel."""

    content: bytes  # an object file, with an entry point NAME
    needs: tuple[str, ...]  # names of the functions that it calls and doesn't hold

    def as_bytes(self) -> bytes:
        """Return it in one piece, as a file of the store has it."""
        return " ".join(self.needs).encode() + b"\n" + self.content

    @classmethod
    def of_bytes(cls, content: bytes) -> "Code":
        """Return the code that `as_bytes` made a piece of."""
        needs, _, rest = content.partition(b"\n")
        return cls(rest, tuple(needs.decode().split()))


class LoadedCode:
    """Machine code in memory that can be called as long as this lives.

    Raises LookupError where a function that the code needs is nowhere to be found, or where it has no entry point;
    ValueError where it is no object file; RuntimeError where LLVM can't make anything of it.
    """

    def __init__(self, code: Code, name: str):
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        defined, needed = read_names(code.content)
        missing = [need for need in sorted({*code.needs, *needed} - IN_EVERY_FILE) if not is_found(need)]
        if missing:
            raise LookupError(f"no function {', '.join(missing)}")
        if defined and name not in defined:
            raise LookupError(f"no entry point {name}")
        machine = llvm.Target.from_default_triple().create_target_machine(codemodel="jitdefault", jit=True)
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code.content))
        self._engine.finalize_object()
        self.address = self._engine.get_function_address(name)
        if not self.address:
            raise LookupError(f"no entry point {name}")


def is_found(name: str) -> bool:
    """Tell whether the process has a function of this name; one of Python's is made known to LLVM."""
    if llvm.address_of_symbol(name) is not None:
        return True
    function = getattr(ctypes.pythonapi, name, None)
    if function is None:
        return False
    llvm.add_symbol(name, ctypes.cast(function, ctypes.c_void_p).value)
    return True
