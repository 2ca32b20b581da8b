"""Write a picture as a PNG file: rows are filtered and deflated in bands, which threads take side by side.

    rows   ┌ band 0   filter, deflate ┐   IHDR  size and colours; tEXt  what is said of them
    of   ──┤ band 1   filter, deflate ├── IDAT  one a band
    bytes  └ band 2   filter, deflate ┘   IEND

In: (height, width, 1, 3 or 4) uint8 or uint16. Out: the bytes of a file, without metadata but for text that is given.
They depend on these alone, not on the number of threads.

Pillow writes PNG files too, on one thread, after trying all five filters. This takes less than half of its time, and
nothing is imported; files are somewhat larger (bench/README.md).

Sources: W3C, Portable Network Graphics, third edition 2025: chunks in section 5, filters in 9, text in 11.3.3. RFC
1950, zlib: the stream and its checksum. RFC 1951: deflate.
"""

import struct
import zlib
from collections.abc import Callable, Iterable, Mapping
from functools import partial

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
_NONE, _SUB, _UP = range(3)  # filters; Average makes files larger, and Paeth takes longer than deflating

_LEVEL = 4  # of zlib: quicker than its default, 6, and with fewer bytes than 1
_STREAM_HEAD = b"\x78\x5e"  # RFC 1950, 2.2: deflate, a window of 32 KiB, a fast level
_LAST_BLOCK = b"\x03\x00"  # RFC 1951, 3.2.6: an empty block, which ends the stream
_BAND_BYTES = 1 << 18  # a band can't refer to the one before: smaller ones make files larger
_ADLER_BASE = 65521  # RFC 1950, 8.2: the largest prime below 2^16


def encode_png(
    pixels: NDArray[np.uint8] | NDArray[np.uint16],
    map_bands: Callable[[Callable, list], Iterable] = map,
    text: Mapping[str, str] | None = None,
    has_runs: bool = False,
) -> bytes:
    """Return a picture as the bytes of a PNG file.

    Parameters
    ----------
    pixels : (height, width, 1, 3 or 4) uint8 or uint16; colours are sRGB, with alpha that is not premultiplied where
        there are four channels
    map_bands : calls a function with every item of a list, and gives the results in the items' order; `map`, or what
        does so on several threads
    text : text fields, by keyword: Latin-1
    has_runs : whether neighbours have one value, as in masks and indices: then deflate looks for nothing but bytes that
        repeat, which takes half of the time, and files are as long or shorter

    Returns
    -------
    bytes, of 8 or 16 bits a channel, not interlaced
    """
    height, width, n_channel = pixels.shape
    n_bit = 8 * pixels.itemsize
    if n_bit == 16:  # the high byte first; filters take bytes
        pixels = pixels.astype(">u2").view(np.uint8)
    if not pixels.flags.c_contiguous:  # colours beside their alpha: numpy copies rows of three bytes six times slower
        channels, pixels = pixels, np.empty(pixels.shape, np.uint8)
        for k in range(channels.shape[2]):
            pixels[..., k] = channels[..., k]
    header = struct.pack(">IIBBBBB", width, height, n_bit, _COLOR_TYPES[n_channel], 0, 0, 0)
    chunks = [_SIGNATURE, _chunk(b"IHDR", header)]
    for keyword, value in (text or {}).items():
        chunks.append(_chunk(b"tEXt", f"{keyword}\0{value}".encode("latin-1")))
    chunks.append(_chunk(b"IDAT", _STREAM_HEAD))
    n_row, checksum = max(1, _BAND_BYTES // (width * pixels.shape[2])), 1
    deflate = partial(_deflate_band, pixels, n_row, has_runs)
    for deflated, of_band, n_byte in map_bands(deflate, list(range(0, height, n_row))):
        chunks.append(_chunk(b"IDAT", deflated))
        checksum = _join_checksums(checksum, of_band, n_byte)
    chunks += [_chunk(b"IDAT", _LAST_BLOCK + struct.pack(">I", checksum)), _chunk(b"IEND", b"")]
    return b"".join(chunks)


def _deflate_band(pixels, n_row, has_runs, y_start) -> tuple[bytes, int, int]:
    """Filter and deflate `n_row` rows from `y_start` on, or as many as there are.

    Returns
    -------
    deflated : bytes, which end at a whole byte, so that the next band's may follow
    checksum : int, Adler-32 of the filtered rows
    n_byte : int, how many bytes they are
    """
    channels = pixels[y_start : y_start + n_row]
    rows = channels.reshape(len(channels), -1)
    above = pixels[y_start - 1].reshape(-1) if y_start else np.zeros(rows.shape[1], np.uint8)
    filtered = _filter_rows(rows, above, pixels.shape[2])
    strategy = zlib.Z_RLE if has_runs else zlib.Z_DEFAULT_STRATEGY
    # Negative: without the stream's head and checksum.
    deflate = zlib.compressobj(_LEVEL, wbits=-zlib.MAX_WBITS, strategy=strategy)
    deflated = deflate.compress(filtered) + deflate.flush(zlib.Z_SYNC_FLUSH)
    return deflated, zlib.adler32(filtered), filtered.size


def _filter_rows(rows, above, n_channel) -> NDArray[np.uint8]:
    """Filter rows, each by the filter whose differences are smallest in sum.

    Parameters
    ----------
    rows : (n_row, n_byte) uint8
    above : (n_byte,) uint8, the row before the first one
    n_channel : bytes of a pixel, of all its channels

    Returns
    -------
    (n_row, 1 + n_byte) uint8: the filter's number, and the differences

    Source: Portable Network Graphics, "Filter selection": the sum of absolute differences, read as signed numbers.
    """
    differences = np.empty((3, *rows.shape), np.uint8)
    differences[_NONE] = rows
    differences[_SUB, :, :n_channel] = rows[:, :n_channel]
    np.subtract(rows[:, n_channel:], rows[:, :-n_channel], out=differences[_SUB, :, n_channel:])
    np.subtract(rows[0], above, out=differences[_UP, 0])
    np.subtract(rows[1:], rows[:-1], out=differences[_UP, 1:])
    sizes = np.abs(differences.view(np.int8)).view(np.uint8)  # of -128, which int8 can't negate: read as uint8, 128
    best = sizes.sum(axis=2, dtype=np.uint32).argmin(axis=0)
    filtered = np.empty((len(rows), 1 + rows.shape[1]), np.uint8)
    filtered[:, 0] = best
    filtered[:, 1:] = differences[best, np.arange(len(rows))]
    return filtered


def _join_checksums(first: int, second: int, n_byte: int) -> int:
    """Return the Adler-32 of two texts, one after the other, from each one's and the number of bytes of the second.

    Adler-32 is a + 2^16 b modulo 65521: a is 1 and the sum of the bytes, b the sum of a after every byte. The second
    text has begun with 1 instead of the first one's a: that is missing in its own a once, in its b after every byte.
    """
    a, b = first & 0xFFFF, first >> 16
    joined_b = b + (second >> 16) + n_byte * (a - 1)
    joined_a = a + (second & 0xFFFF) - 1
    return joined_b % _ADLER_BASE << 16 | joined_a % _ADLER_BASE


def _chunk(name: bytes, data: bytes) -> bytes:
    """Return a chunk: length, name, data, CRC-32 of name and data."""
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(data, zlib.crc32(name)))
