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
