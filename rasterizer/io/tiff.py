"""Write a picture as an uncompressed TIFF file: a header, then its rows as they are in memory.

    header   "II", 42 or 43, where the fields begin
    fields   size, colours, where the strips begin ...   in the order of their tags, each with its value or its place
    values   of the fields that have no room for them
    rows     red, green, blue, alpha, 8 bits each, from the top downwards

In: (height, width, 4) uint8, sRGB, alpha not premultiplied. A file of 4 GiB and more is a BigTIFF, in which all places
have 64 bits. Where each row goes is known beforehand, so bands of a picture may be written in any order.

Sources: TIFF revision 6.0, Adobe 1992: fields in section 2, strips in 3, extra samples in 18. BigTIFF, AWare Systems
2007: header and fields. ICC.1:2022 annex B.4: the profile's field.
"""

import struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .icc import srgb_profile

PIXEL_BYTES = 4
_STRIP_BYTES = 2**20  # of a strip at most, or a row: readers may hold a whole strip in memory
# Bytes of the rows of a classic TIFF: its places have 32 bits. 4 MiB are left for the header, of which each strip takes
# 8 bytes, and there are no more strips than rows.
_MOST_CLASSIC = 2**32 - 2**22
_ALIGNMENT = 16  # of the rows in the file
_SHORT, _LONG, _RATIONAL, _UNDEFINED, _LONG8 = 3, 4, 5, 7, 16  # types of values
_CODES = {_SHORT: "H", _LONG: "I", _RATIONAL: "I", _UNDEFINED: "B", _LONG8: "Q"}
# Words of the specification for what is always the same.
_NO_COMPRESSION, _RGB, _TOP_LEFT, _INTERLEAVED, _NO_UNIT, _UNASSOCIATED_ALPHA = 1, 2, 1, 1, 1, 2


class Layout(NamedTuple):
    """How the two kinds of TIFF differ: formats of `struct`."""

    version: int
    head: str  # of what follows the version
    head_values: tuple  # of which the last is where the fields begin
    count: str  # of fields
    entry: str  # of a field: tag, type, number of values
    room: int  # bytes of a value within its field, or of a place
    place: int  # type of places


_CLASSIC = Layout(42, "I", (8,), "H", "HHI", 4, _LONG)
_BIG = Layout(43, "HHQ", (8, 0, 16), "Q", "HHQ", 8, _LONG8)


def encode_tiff(pixels: NDArray[np.uint8]) -> bytes:
    """Return a picture, (height, width, 4) uint8, as the bytes of a TIFF file."""
    height, width, _ = pixels.shape
    return tiff_header(width, height) + pixels.tobytes()


def tiff_header(width: int, height: int, is_big: bool | None = None) -> bytes:
    """Return what stands before the rows of a picture.

    Parameters
    ----------
    width, height : pixels
    is_big : whether it is a BigTIFF; None = where it has to be one
    """
    if is_big is None:
        is_big = width * height * PIXEL_BYTES >= _MOST_CLASSIC
    layout = _BIG if is_big else _CLASSIC
    n_byte = len(_header_with_rows_at(0, width, height, layout))  # its length doesn't depend on where the rows begin
    start = -(-n_byte // _ALIGNMENT) * _ALIGNMENT
    return _header_with_rows_at(start, width, height, layout).ljust(start, b"\0")


def _header_with_rows_at(start: int, width: int, height: int, layout: Layout) -> bytes:
    """Return the header of a picture whose rows begin at byte `start` of the file."""
    fields = _list_fields(start, width, height, layout)
    head = struct.pack("<2sH" + layout.head, b"II", layout.version, *layout.head_values)
    entry_bytes = struct.calcsize("<" + layout.entry) + layout.room
    end = len(head) + struct.calcsize("<" + layout.count) + entry_bytes * len(fields) + layout.room
    entries, values = [], b""
    for tag, kind, numbers in fields:
        content = _pack(kind, numbers)
        n_value = len(numbers) // 2 if kind == _RATIONAL else len(numbers)
        inside = content
        if len(content) > layout.room:
            values += bytes(-(end + len(values)) % 8)
            inside = _pack(layout.place, (end + len(values),))
            values += content
        entries.append(struct.pack("<" + layout.entry, tag, kind, n_value) + inside.ljust(layout.room, b"\0"))
    no_more = bytes(layout.room)
    return head + struct.pack("<" + layout.count, len(fields)) + b"".join(entries) + no_more + values


def _list_fields(start: int, width: int, height: int, layout: Layout) -> list[tuple]:
    """Return (tag, type, numbers) of each field, tags ascending."""
    row_bytes = width * PIXEL_BYTES
    n_row = min(height, max(1, _STRIP_BYTES // row_bytes))  # of a strip; the last one may have fewer
    first_rows = range(0, height, n_row)
    offsets = [start + first * row_bytes for first in first_rows]
    lengths = [(min(first + n_row, height) - first) * row_bytes for first in first_rows]
    return [
        (256, _LONG, (width,)),
        (257, _LONG, (height,)),
        (258, _SHORT, (8, 8, 8, 8)),  # bits of each channel
        (259, _SHORT, (_NO_COMPRESSION,)),
        (262, _SHORT, (_RGB,)),
        (273, layout.place, offsets),
        (274, _SHORT, (_TOP_LEFT,)),  # row 0 is the top, column 0 the left
        (277, _SHORT, (PIXEL_BYTES,)),  # channels
        (278, _LONG, (n_row,)),
        (279, layout.place, lengths),
        (282, _RATIONAL, (1, 1)),  # resolution along x and y, without a unit: pixels are squares of no known size
        (283, _RATIONAL, (1, 1)),
        (284, _SHORT, (_INTERLEAVED,)),
        (296, _SHORT, (_NO_UNIT,)),
        (338, _SHORT, (_UNASSOCIATED_ALPHA,)),  # the fourth channel
        (34675, _UNDEFINED, tuple(srgb_profile())),
    ]


def _pack(kind: int, numbers) -> bytes:
    """Return numbers of a type as bytes."""
    return struct.pack(f"<{len(numbers)}{_CODES[kind]}", *numbers)
