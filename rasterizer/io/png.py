"""Write a picture as a PNG file: one filter, one stream.

In: (height, width, 1, 3 or 4) uint8 or uint16. Out: the bytes of a file, without metadata but for text that is given.

Pillow writes PNG files too, after trying all five filters. This takes less than half of its time, and nothing is
imported; files are somewhat larger (bench/README.md).

Sources: W3C, Portable Network Graphics, third edition 2025: chunks in section 5, filters in 9, text in 11.3.3. RFC
1950, zlib: the stream. RFC 1951: deflate.
"""

import struct
import zlib
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

# ----------------------------------------------------------------
# The ICC profile of sRGB: what tells a reader of a file how its numbers become colours.
# header   128 bytes: a display, RGB, related to XYZ under D50
#     table    name, place and length of each tag
#     tags     name and licence, white, the three primaries, one curve for all channels
#
# Sources: ICC.1:2022 (profile version 4.4), sections 7 to 10. IEC 61966-2-1 for the primaries and the curve of sRGB,
# here
# adapted to D50 by the matrix of Bradford's transform, as ICC.1 annex E says.

_D50 = (0.9642, 1.0, 0.8249)
_PRIMARIES = {  # XYZ under D50, as the profiles that the ICC publishes for sRGB have them
    b"rXYZ": (0.436066, 0.222488, 0.013916),
    b"gXYZ": (0.385147, 0.716873, 0.097076),
    b"bXYZ": (0.143066, 0.060608, 0.714096),
}
_ADAPTATION = (1.047882, 0.022919, -0.050217, 0.029587, 0.990463, -0.017075, -0.009254, 0.015060, 0.752068)
# y = (a x + b)^g from d on, else c x.
_CURVE = (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)
_SEGMENTS = 3  # number of that type of curve
_HEADER_BYTES, _ENTRY_BYTES = 128, 12


def srgb_profile() -> bytes:
    """Return the profile of sRGB, the same bytes every time."""
    curve = b"para" + struct.pack(">IHH", 0, _SEGMENTS, 0) + _fixed(*_CURVE)
    tags = {b"desc": _text("sRGB"), b"cprt": _text("CC0"), b"wtpt": b"XYZ " + bytes(4) + _fixed(*_D50)}
    tags |= {name: b"XYZ " + bytes(4) + _fixed(*color) for name, color in _PRIMARIES.items()}
    tags |= {b"chad": b"sf32" + bytes(4) + _fixed(*_ADAPTATION)}
    tags |= dict.fromkeys((b"rTRC", b"gTRC", b"bTRC"), curve)
    start = _HEADER_BYTES + 4 + _ENTRY_BYTES * len(tags)
    places: dict[bytes, int] = {}  # what is the same stands there once
    body = b""
    for content in tags.values():
        if content not in places:
            places[content] = start + len(body)
            body += content + bytes(-len(content) % 4)
    table = b"".join(struct.pack(">4sII", name, places[content], len(content)) for name, content in tags.items())
    table = struct.pack(">I", len(tags)) + table
    return _header(_HEADER_BYTES + len(table) + len(body)) + table + body


def _header(n_byte: int) -> bytes:
    """Return the header of a profile of `n_byte` bytes."""
    types = struct.pack(">I4sI4s4s4s", n_byte, bytes(4), 0x04400000, b"mntr", b"RGB ", b"XYZ ")
    date = struct.pack(">6H", 2022, 5, 1, 0, 0, 0)  # that of the specification: a file does not depend on the day
    return (types + date + b"acsp" + bytes(28) + _fixed(*_D50)).ljust(_HEADER_BYTES, b"\0")


def _fixed(*numbers: float) -> bytes:
    """Return numbers as 32 bits each, 16 of them behind the point."""
    return b"".join(struct.pack(">i", round(number * 2**16)) for number in numbers)


def _text(text: str) -> bytes:
    """Return a text in one language."""
    content = text.encode("utf-16-be")
    return b"mluc" + struct.pack(">III4sII", 0, 1, 12, b"enUS", len(content), 28) + content


_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_COLOR_TYPES = {1: 0, 3: 2, 4: 6}  # grey, RGB, RGBA, by the number of channels
_UP = 2  # filter: a byte less the one above it; files are as small as with the best of three for each row
_LEVEL = 4  # of zlib: quicker than its default, 6, and with fewer bytes than 3


def encode_png(
    pixels: NDArray[np.uint8] | NDArray[np.uint16], text: Mapping[str, str] | None = None, has_runs: bool = False
) -> bytes:
    """Return a picture as the bytes of a PNG file.

    Parameters
    ----------
    pixels : (height, width, 1, 3 or 4) uint8 or uint16; colours are sRGB, with alpha that is not premultiplied where
        there are four channels
    text : text fields, by keyword: Latin-1
    has_runs : whether neighbours have one value, as in masks and indices: then deflate looks for nothing but bytes that
        repeat, which takes half of the time, and files are about as long

    Returns
    -------
    bytes, of 8 or 16 bits a channel, not interlaced
    """
    height, width, n_channel = pixels.shape
    n_bit = 8 * pixels.itemsize
    if not pixels.flags.c_contiguous:  # colours beside their alpha: numpy copies rows of three bytes six times slower
        pixels = np.stack([pixels[..., k] for k in range(n_channel)], axis=2)
    rows = pixels.astype(f">u{pixels.itemsize}", copy=False).view(np.uint8).reshape(height, -1)  # the high byte first
    filtered = np.empty((height, 1 + rows.shape[1]), np.uint8)
    filtered[:, 0], filtered[0, 1:] = _UP, rows[0]
    np.subtract(rows[1:], rows[:-1], out=filtered[1:, 1:])
    deflate = zlib.compressobj(_LEVEL, strategy=zlib.Z_RLE if has_runs else zlib.Z_DEFAULT_STRATEGY)
    header = struct.pack(">IIBBBBB", width, height, n_bit, _COLOR_TYPES[n_channel], 0, 0, 0)
    fields = [f"{keyword}\0{value}".encode("latin-1") for keyword, value in (text or {}).items()]
    chunks = [(b"IHDR", header), *((b"tEXt", field) for field in fields)]
    chunks += [(b"IDAT", deflate.compress(filtered) + deflate.flush()), (b"IEND", b"")]
    return _SIGNATURE + b"".join(_chunk(name, data) for name, data in chunks)


def _chunk(name: bytes, data: bytes) -> bytes:
    """Return a chunk: length, name, data, CRC-32 of name and data."""
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(data, zlib.crc32(name)))
