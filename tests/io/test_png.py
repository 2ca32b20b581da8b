"""PNG files: Pillow and zlib read what was written, whatever the size and the content."""

import io
import struct
import zlib

import numpy as np
from helpers.arrays import differences
from helpers.pairs import pairs
from PIL import Image

from rasterizer.io.png import encode_png


def noise(height, width, n_channel, seed=0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, n_channel), dtype=np.uint8)


def slopes(height, width, n_channel) -> np.ndarray:
    """Values that rise along both axes, by different steps a channel."""
    y, x, channel = np.ogrid[:height, :width, :n_channel]
    return (3 * y + (channel + 1) * x).astype(np.uint8)


def constant(height, width, n_channel) -> np.ndarray:
    return np.full((height, width, n_channel), 200, np.uint8)


def read(data) -> np.ndarray:
    with Image.open(io.BytesIO(data)) as image:
        assert image.format == "PNG"
        return np.asarray(image)


def chunks_of(data) -> list[tuple[bytes, bytes]]:
    """Names and data of a file's chunks, after their checksums have been compared."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    found, at = [], 8
    while at < len(data):
        n_byte, name = struct.unpack_from(">I4s", data, at)
        body = data[at + 8 : at + 8 + n_byte]
        assert struct.unpack_from(">I", data, at + 8 + n_byte)[0] == zlib.crc32(name + body)
        found.append((name, body))
        at += 12 + n_byte
    return found


def filtered_rows(data, height) -> np.ndarray:
    """The rows as they were deflated; zlib compares the checksum of the whole stream, which Pillow does not."""
    stream = b"".join(body for name, body in chunks_of(data) if name == b"IDAT")
    return np.frombuffer(zlib.decompress(stream), np.uint8).reshape(height, -1)


def test_what_is_read_is_what_was_written():
    sizes = [(1, 1), (1, 2), (2, 1), (1, 300), (300, 1), (7, 13), (331, 400), (3, 90_001)]
    for size, content, n_channel in pairs(size=sizes, content=(noise, slopes, constant), n_channel=(3, 4)):
        pixels = content(*size, n_channel)
        data = encode_png(pixels)
        assert np.array_equal(read(data), pixels), (size, content, n_channel)
        assert filtered_rows(data, size[0]).shape == (size[0], 1 + size[1] * n_channel)
    for seed in range(8):  # patches of noise, slopes and one colour, among what is transparent
        rng = np.random.default_rng(seed)
        height, width, n_channel = (int(n) for n in (*rng.integers(1, 300, 2), rng.integers(3, 5)))
        pixels = np.zeros((height, width, n_channel), np.uint8)
        for content in (noise, slopes, constant):
            y, x = (int(rng.integers(0, n)) for n in (height, width))
            patch = content(height, width, n_channel)[y:, x:]
            n_row, n_column = (int(rng.integers(1, n + 1)) for n in patch.shape[:2])
            pixels[y : y + n_row, x : x + n_column] = patch[:n_row, :n_column]
        assert np.array_equal(read(encode_png(pixels)), pixels), f"seed {seed}"


def test_views_of_larger_arrays_are_written_as_they_look():
    pixels = noise(60, 50, 4)
    for view in (pixels[..., :3], pixels[::-1], pixels[5:40:2, 30:3:-3], pixels.transpose(1, 0, 2)):
        assert not differences(read(encode_png(view)), view)
    pixels.setflags(write=False)
    assert not differences(read(encode_png(pixels)), pixels)
