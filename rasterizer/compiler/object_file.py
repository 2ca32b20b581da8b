"""What an object file needs and offers, read from the file itself.

LLVM takes for granted that it is given a whole object file: anything else, or a name that it can't find, ends the
process. So a file is looked at before LLVM gets it. Only ELF, which Linux has, is looked into; of the formats of macOS
and Windows only the first bytes are compared.

Source: Tool Interface Standard, Executable and Linking Format, version 1.2; its 64 bit form.
"""

import struct
import sys

ELF, MACH_O, COFF = b"\x7fELF\x02", b"\xcf\xfa\xed\xfe", b"\x64\x86"  # ELF of 64 bit; COFF for x86-64
RELOCATABLE = 1  # the kind of ELF file that compilers write
SYMBOL_TABLE, NO_BITS = 2, 8  # kinds of sections: that of names, and one without content in the file
UNDEFINED = 0  # the section of a name that another file has
_HEADER, _SECTION, _SYMBOL = "16sHHIQQQIHHHHHH", "IIQQQQIIQQ", "IBBHQQ"


def read_names(content: bytes) -> tuple[set[str], set[str]]:
    """Return the names that an object file defines, and those that it needs; none where the format isn't ELF.

    Raises ValueError for what is no object file, or is cut off.
    """
    if content.startswith((MACH_O, COFF)) and sys.platform != "linux":
        return set(), set()
    if not content.startswith(ELF):
        raise ValueError("it is no object file")
    try:
        sections = _read_sections(content)
        tables = [section for section in sections if section[1] == SYMBOL_TABLE]
        defined, needed = set(), set()
        for _, _, _, _, offset, size, link, *_ in tables:
            _, _, _, _, text_offset, text_size, *_ = sections[link]
            text = content[text_offset : text_offset + text_size]
            for name, _, _, section, _, _ in struct.iter_unpack(_order() + _SYMBOL, content[offset : offset + size]):
                if name:
                    (needed if section == UNDEFINED else defined).add(text[name : text.index(b"\0", name)].decode())
    except (struct.error, IndexError, ValueError) as fault:
        raise ValueError(f"it is no whole object file ({fault})") from fault
    return defined, needed


def _read_sections(content):
    """Return the fields of all section headers; ValueError where the file doesn't hold what they tell of."""
    header = struct.unpack_from(_order() + _HEADER, content)
    kind, table, entry_size, n_section = header[1], header[6], header[11], header[12]
    if kind != RELOCATABLE or entry_size != struct.calcsize("=" + _SECTION):
        raise ValueError("not what a compiler writes")
    size = n_section * entry_size
    if not n_section or table + size > len(content):
        raise ValueError("its sections are missing")
    sections = list(struct.iter_unpack(_order() + _SECTION, content[table : table + size]))
    for _, kind, _, _, offset, size, *_ in sections:
        if kind != NO_BITS and offset + size > len(content):
            raise ValueError("a section is missing")
    return sections


def _order():
    return "<" if sys.byteorder == "little" else ">"
