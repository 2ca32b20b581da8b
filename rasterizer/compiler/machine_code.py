"""Object code into memory, by llvmlite alone.

The code is what internals.py makes: one object file that holds a kernel and its entry point. It needs functions of the
C library and of Python, and nothing else.

LLVM takes for granted that it is given a whole object file: anything else, or a name that it can't find, ends the
process. So a file is looked at before LLVM gets it. Only ELF, which Linux has, is looked into; of the formats of macOS
and Windows only the first bytes are compared.
"""

import ctypes
import struct
import sys
from typing import NamedTuple

import llvmlite.binding as llvm

IN_EVERY_FILE = {"_GLOBAL_OFFSET_TABLE_"}  # a name that the linker itself defines


class Code(NamedTuple):
    """What the compiler made of a kernel."""

    content: bytes  # an object file, with an entry point NAME
    undefined: tuple[str, ...]  # names of the functions that it calls and doesn't hold

    def as_bytes(self) -> bytes:
        """Return it in one piece, as a file of the store has it."""
        return " ".join(self.undefined).encode() + b"\n" + self.content

    @classmethod
    def of_bytes(cls, content: bytes) -> "Code":
        """Return the code that `as_bytes` made a piece of."""
        names, _, rest = content.partition(b"\n")
        return cls(rest, tuple(names.decode().split()))


class LoadedCode:
    """Machine code in memory that can be called as long as this lives.

    Raises LookupError where a function that the code needs is nowhere to be found, or where it has no entry point;
    ValueError where it is no object file; RuntimeError where LLVM can't make anything of it.
    """

    def __init__(self, code: Code, name: str):
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        defined, undefined = read_names(code.content)
        missing = [other for other in sorted({*code.undefined, *undefined} - IN_EVERY_FILE) if not is_found(other)]
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


# ---------------------------------------------------------------- which names an object file defines

# Source: Tool Interface Standard, Executable and Linking Format, version 1.2; its 64 bit form.
ELF, MACH_O, COFF = b"\x7fELF\x02", b"\xcf\xfa\xed\xfe", b"\x64\x86"  # ELF of 64 bit; COFF for x86-64
RELOCATABLE = 1  # the type of ELF file that compilers write
SYMBOL_TABLE, NO_BITS = 2, 8  # types of sections: that of names, and one without content in the file
UNDEFINED = 0  # the section of a name that another file has
_HEADER, _SECTION, _SYMBOL = "16sHHIQQQIHHHHHH", "IIQQQQIIQQ", "IBBHQQ"


def read_names(content: bytes) -> tuple[set[str], set[str]]:
    """Return the names that an object file defines, and those that it doesn't; none where the format isn't ELF.

    Raises ValueError for what is no object file, or is cut off.
    """
    if content.startswith((MACH_O, COFF)) and sys.platform != "linux":
        return set(), set()
    if not content.startswith(ELF):
        raise ValueError("it is no object file")
    try:
        sections = _read_sections(content)
        tables = [section for section in sections if section[1] == SYMBOL_TABLE]
        defined, undefined = set(), set()
        for _, _, _, _, offset, size, link, *_ in tables:
            _, _, _, _, text_offset, text_size, *_ = sections[link]
            text = content[text_offset : text_offset + text_size]
            for name, _, _, section, _, _ in struct.iter_unpack(_order() + _SYMBOL, content[offset : offset + size]):
                if name:
                    (undefined if section == UNDEFINED else defined).add(text[name : text.index(b"\0", name)].decode())
    except (struct.error, IndexError, ValueError) as fault:
        raise ValueError(f"it is no whole object file ({fault})") from fault
    return defined, undefined


def _read_sections(content):
    """Return the fields of all section headers; ValueError where the file doesn't hold what they tell of."""
    header = struct.unpack_from(_order() + _HEADER, content)
    file_type, table, entry_size, n_section = header[1], header[6], header[11], header[12]
    if file_type != RELOCATABLE or entry_size != struct.calcsize("=" + _SECTION):
        raise ValueError("not what a compiler writes")
    size = n_section * entry_size
    if not n_section or table + size > len(content):
        raise ValueError("its sections are missing")
    sections = list(struct.iter_unpack(_order() + _SECTION, content[table : table + size]))
    for _, section_type, _, _, offset, size, *_ in sections:
        if section_type != NO_BITS and offset + size > len(content):
            raise ValueError("a section is missing")
    return sections


def _order():
    return "<" if sys.byteorder == "little" else ">"
