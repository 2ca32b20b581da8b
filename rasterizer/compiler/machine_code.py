"""Object code into memory.

The code is what internals.py makes: one object file that holds a kernel and its entry point. It needs functions of the
C library and of Python, and nothing else. On Linux and x86-64 it is put where it belongs by `place`, because loading
LLVM takes longer than all that a small picture does in the pipeline. Elsewhere, and where anything about that is not as
expected, LLVM loads it.

LLVM takes for granted that it is given a whole object file: anything else, or a name that it can't find, ends the
process. So a file is looked at before LLVM gets it. Only ELF, which Linux has, is looked into; of the formats of macOS
and Windows only the first bytes are compared.
"""

import ctypes
import mmap
import platform
import struct
import sys
from typing import NamedTuple

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
        defined, undefined = read_names(code.content)
        needed = sorted({*code.undefined, *undefined} - IN_EVERY_FILE)
        placed = place(code.content, name, needed)
        if placed is not None:
            self._memory, self.address = placed
            return
        import llvmlite.binding as llvm

        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        missing = [other for other in needed if not is_found(other)]
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
    import llvmlite.binding as llvm

    if llvm.address_of_symbol(name) is not None:
        return True
    function = getattr(ctypes.pythonapi, name, None)
    if function is None:
        return False
    llvm.add_symbol(name, ctypes.cast(function, ctypes.c_void_p).value)
    return True


# ---------------------------------------------------------------- without LLVM


def place(content: bytes, name: str, needed: list[str]) -> tuple[mmap.mmap, int] | None:
    """Put an object file for Linux on x86-64 into memory; `needed` are the functions that it calls and doesn't hold.

    LLVM makes it for memory of any size: nothing is left to fill in but whole addresses.

    Returns
    -------
    the memory, in which the code stays as long as this lives, and the address of the function `name`; None for any
    other file, where a function is missing, and where the system gives no memory for code
    """
    if sys.platform != "linux" or platform.machine() != "x86_64" or content[18:20] != X86_64:
        return None
    try:
        return _place(content, name, {other: _address_of(other) for other in needed})
    except (struct.error, ArithmeticError, AttributeError, LookupError, OSError, ValueError):
        return None  # LLVM's side says what is wrong


def _address_of(function: str) -> int:
    """Return the address of a function of Python or the C library; AttributeError where there is none."""
    library = ctypes.pythonapi if function.startswith("Py") else ctypes.CDLL(None)
    return ctypes.cast(getattr(library, function), ctypes.c_void_p).value


def _place(content, name, functions):
    sections = _read_sections(content)
    starts, size = {}, 0  # of the sections that are needed: where each begins, in bytes from the first
    for k, (_, section_type, flags, _, _, n_byte, _, _, alignment, _) in enumerate(sections):
        if flags & IN_MEMORY and section_type in (IN_FILE, NO_BITS):
            starts[k] = size + -size % max(alignment, 1)
            size = starts[k] + n_byte
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    base = ctypes.addressof(ctypes.c_char.from_buffer(memory))
    for k, start in starts.items():
        _, section_type, _, _, offset, n_byte, *_ = sections[k]
        if section_type == IN_FILE:
            memory[start : start + n_byte] = content[offset : offset + n_byte]
    symbols = _read_symbols(content, sections)
    for _, section_type, _, _, offset, n_byte, _, target, *_ in sections:
        if section_type != RELOCATIONS or target not in starts:
            continue
        for where, info, addend in struct.iter_unpack(_RELOCATION, content[offset : offset + n_byte]):
            if info & 0xFFFFFFFF != ADDRESS or where + 8 > sections[target][5]:
                return None
            other, section, value = symbols[info >> 32]
            address = functions[other] if section == UNDEFINED else base + starts[section] + value
            struct.pack_into("<Q", memory, starts[target] + where, (address + addend) % 2**64)
    (entry,) = (base + starts[section] + value for other, section, value in symbols if other == name)
    # Never to be written and run at a time: some systems refuse such memory.
    protect = ctypes.CDLL(None).mprotect
    is_refused = protect(ctypes.c_void_p(base), ctypes.c_size_t(size), mmap.PROT_READ | mmap.PROT_EXEC)
    return None if is_refused else (memory, entry)


# ---------------------------------------------------------------- what an object file holds

# Source: Tool Interface Standard, Executable and Linking Format, version 1.2; its 64 bit form, and the psABI of x86-64.
ELF, MACH_O, COFF = b"\x7fELF\x02", b"\xcf\xfa\xed\xfe", b"\x64\x86"  # ELF of 64 bit; COFF for x86-64
RELOCATABLE = 1  # the type of ELF file that compilers write
# Types of sections: with content in the file, that of names, what is to be filled in, and without content in the file.
IN_FILE, SYMBOL_TABLE, RELOCATIONS, NO_BITS = 1, 2, 4, 8
IN_MEMORY = 2  # the flag of a section that a process needs
X86_64, ADDRESS = b"\x3e\0", 1  # the machine; the type of a relocation that is a whole address of 64 bits
UNDEFINED = 0  # the section of a name that another file has
_HEADER, _SECTION, _SYMBOL, _RELOCATION = "16sHHIQQQIHHHHHH", "IIQQQQIIQQ", "IBBHQQ", "<QQq"


def read_names(content: bytes) -> tuple[set[str], set[str]]:
    """Return the names that an object file defines, and those that it doesn't; none where the format isn't ELF.

    Raises ValueError for what is no object file, or is cut off.
    """
    if content.startswith((MACH_O, COFF)) and sys.platform != "linux":
        return set(), set()
    if not content.startswith(ELF):
        raise ValueError("it is no object file")
    try:
        defined, undefined = set(), set()
        for name, section, _ in _read_symbols(content, _read_sections(content)):
            if name:
                (undefined if section == UNDEFINED else defined).add(name)
    except (struct.error, IndexError, ValueError) as fault:
        raise ValueError(f"it is no whole object file ({fault})") from fault
    return defined, undefined


def _read_symbols(content, sections):
    """Return the name of each symbol ("" of sections), the number of its section, and where in it it stands."""
    symbols = []
    for _, section_type, _, _, offset, size, link, *_ in sections:
        if section_type == SYMBOL_TABLE:
            _, _, _, _, text_offset, text_size, *_ = sections[link]
            text = content[text_offset : text_offset + text_size]
            for name, _, _, section, value, _ in struct.iter_unpack(
                _order() + _SYMBOL, content[offset : offset + size]
            ):
                symbols.append((text[name : text.index(b"\0", name)].decode(), section, value))
    return symbols


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
