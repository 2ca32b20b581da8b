"""Machine code into memory.

What internals.py makes of a kernel, and the store keeps, is one piece of bytes: the names of the functions that the
code calls and doesn't hold, with blanks between them, a newline, and an object file with a function `entry`. It needs
functions of the C library and of Python, and nothing else. On Linux and x86-64 it is put where it belongs by `place`,
because loading LLVM takes longer than all that a small picture does in the pipeline. Elsewhere, and where anything
about that is not as expected, LLVM loads it.
"""

import ctypes
import mmap
import platform
import struct
import sys

ENTRY = "entry"


class LoadedCode:
    """Machine code in memory, whose function `entry` can be called at `address` as long as this lives.

    Raises LookupError where a function that the code needs is nowhere to be found, or where it has no entry point;
    RuntimeError where LLVM can't make anything of it.
    """

    def __init__(self, code: bytes):
        names, _, content = code.partition(b"\n")
        placed = place(content)
        if placed is not None:
            self._memory, self.address = placed
            return
        import llvmlite.binding as llvm

        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        missing = [name for name in names.decode().split() if not is_found(name)]  # LLVM would end the process
        if missing:
            raise LookupError(f"no function {', '.join(missing)}")
        machine = llvm.Target.from_default_triple().create_target_machine(codemodel="jitdefault", jit=True)
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(content))
        self._engine.finalize_object()
        self.address = self._engine.get_function_address(ENTRY)
        if not self.address:
            raise LookupError("no entry point")


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

# Source: Tool Interface Standard, Executable and Linking Format, version 1.2; its 64 bit form, and the psABI of x86-64.
_HEADER, _SECTION, _SYMBOL, _RELOCATION = "<16sHHIQQQIHHHHHH", "<IIQQQQIIQQ", "<IBBHQQ", "<QQq"
RELOCATABLE, X86_64 = 1, 62  # the type of file that compilers write; the machine
# Types of sections: with content in the file, that of names, what is to be filled in, and without content in the file.
IN_FILE, SYMBOL_TABLE, RELOCATIONS, NO_BITS = 1, 2, 4, 8
IN_MEMORY = 2  # the flag of a section that a process needs
UNDEFINED = 0  # the section of a name that another file has
ADDRESS = 1  # the type of a relocation that is a whole address of 64 bits


def place(content: bytes) -> tuple[mmap.mmap, int] | None:
    """Put an object file for Linux on x86-64 into memory.

    LLVM makes it for memory of any size: nothing is left to fill in but whole addresses.

    Returns
    -------
    the memory, in which the code stays as long as this lives, and the address of its function `entry`; None for any
    other file, where a function is missing, and where the system gives no memory for code
    """
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return None
    try:
        return _place(content)
    except (struct.error, AttributeError, LookupError, OSError, ValueError):
        return None  # LLVM's side says what is wrong


def _place(content):
    # List the sections, and give those that a process needs their places, in bytes from the first.
    _, file_type, machine, _, _, _, table, _, _, _, _, size, n_section, _ = struct.unpack_from(_HEADER, content)
    if (file_type, machine) != (RELOCATABLE, X86_64):
        return None
    sections = [*struct.iter_unpack(_SECTION, content[table : table + n_section * size])]
    starts, size = {}, 0
    for k, (_, section_type, flags, _, _, n_byte, _, _, alignment, _) in enumerate(sections):
        if flags & IN_MEMORY and section_type in (IN_FILE, NO_BITS):
            starts[k] = size + -size % max(alignment, 1)
            size = starts[k] + n_byte
    # Copy what they hold.
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    base = ctypes.addressof(ctypes.c_char.from_buffer(memory))
    for k, start in starts.items():
        _, section_type, _, _, offset, n_byte, *_ = sections[k]
        if section_type == IN_FILE:
            memory[start : start + n_byte] = content[offset : offset + n_byte]
    # Find out what each symbol is called (sections have no name), in which section it is, and where in it.
    symbols, entry = [], None
    for _, section_type, _, _, offset, n_byte, names, *_ in sections:
        if section_type == SYMBOL_TABLE:
            for name, _, _, section, value, _ in struct.iter_unpack(_SYMBOL, content[offset : offset + n_byte]):
                start = sections[names][4] + name
                symbols.append((content[start : content.index(b"\0", start)].decode(), section, value))
                if symbols[-1][0] == ENTRY:
                    entry = base + starts[section] + value
    # Fill in addresses: those of Python and of the C library, and those of the code's own.
    for _, section_type, _, _, offset, n_byte, _, target, *_ in sections:
        if section_type != RELOCATIONS or target not in starts:
            continue
        for where, info, addend in struct.iter_unpack(_RELOCATION, content[offset : offset + n_byte]):
            if info & 0xFFFFFFFF != ADDRESS or where + 8 > sections[target][5]:
                return None
            name, section, value = symbols[info >> 32]
            if section == UNDEFINED:
                library = ctypes.pythonapi if name.startswith("Py") else ctypes.CDLL(None)
                address = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
            else:
                address = base + starts[section] + value
            struct.pack_into("<Q", memory, starts[target] + where, (address + addend) % 2**64)
    # Never to be written and run at a time: some systems refuse such memory.
    protect = ctypes.CDLL(None).mprotect
    is_refused = protect(ctypes.c_void_p(base), ctypes.c_size_t(size), mmap.PROT_READ | mmap.PROT_EXEC)
    return None if is_refused or entry is None else (memory, entry)
