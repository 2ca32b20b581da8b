"""The globe: a sphere with texture coordinates, and its picture, computed by formula.

The picture is a map in equal steps of longitude (to the right, 0 at the middle) and latitude; its texels hold one of 16
colours. Compression would give other bytes with other versions of its library, so the PNG holds its texels as they are.
"""

import struct
import zlib

import numpy as np
from model_formats import number_text, rounded

# sRGB: deep, open and shallow sea, shore, lowland to peaks, ice, lines of the grid
PALETTE = (
    (12, 38, 92), (18, 60, 128), (40, 104, 168), (214, 196, 140), (86, 138, 62), (58, 108, 48), (122, 112, 66),
    (150, 128, 96), (172, 160, 148), (240, 244, 248), (236, 200, 60),
)  # fmt: skip
# Waves whose sum is the height: direction and length (x, y, z), phase, height.
WAVES = (
    ((1.3, 0.4, -0.9), 0.3, 1.0), ((-0.7, 1.6, 1.2), 1.9, 0.9), ((2.1, -1.1, 0.8), 4.1, 0.8),
    ((0.9, 2.4, -2.2), 2.6, 0.6), ((-3.6, 1.9, 2.7), 0.8, 0.4), ((4.4, 3.1, -3.3), 5.2, 0.3),
    ((-6.5, 5.8, 4.1), 3.3, 0.2), ((9.2, -8.4, 7.7), 1.1, 0.12),
)  # fmt: skip


def globe_texels(width=256, height=128):
    """Return the numbers of the colours (height, width), north at the top."""
    longitude = ((np.arange(width) + 0.5) / width - 0.5) * (2 * np.pi)
    latitude = (0.5 - (np.arange(height) + 0.5) / height) * np.pi
    x = np.cos(latitude)[:, None] * np.sin(longitude)
    y = np.sin(latitude)[:, None] + 0.0 * longitude
    z = np.cos(latitude)[:, None] * np.cos(longitude)
    level = sum(high * np.sin(a * x + b * y + c * z + phase) for (a, b, c), phase, high in WAVES)
    texels = np.searchsorted([-1.0, -0.1, 0.18, 0.28, 0.75, 1.15, 1.5, 1.9], level)
    texels[np.abs(y) + 0.03 * level > 0.93] = 9
    is_line = np.zeros((height, width), bool)
    is_line[[k * height // 6 for k in range(1, 6)]] = True
    is_line[:, [k * width // 12 for k in range(12)]] = True
    texels[is_line & (texels != 9)] = 10
    return texels


def png_bytes(texels, palette):
    """Write a PNG of 4 bits a texel, not compressed: (height, even width) numbers below 16.

    Source: ISO/IEC 15948 (PNG), 11.2; RFC 1950 and 1951 for the blocks that are stored as they are.
    """
    height, width = texels.shape
    pairs = (texels[:, 0::2] << 4 | texels[:, 1::2]).astype(np.uint8)
    rows = np.concatenate(
        [np.zeros((height, 1), np.uint8), pairs], axis=1
    ).tobytes()  # each row begins with its filter: none
    stream = b"\x78\x01"
    for start in range(0, len(rows), 65535):
        block = rows[start : start + 65535]
        is_last = start + 65535 >= len(rows)
        stream += struct.pack("<BHH", is_last, len(block), len(block) ^ 0xFFFF) + block
    stream += struct.pack(">I", zlib.adler32(rows))
    header = struct.pack(">2I5B", width, height, 4, 3, 0, 0, 0)
    chunks = (b"IHDR", header), (b"PLTE", bytes(sum(palette, ()))), (b"IDAT", stream), (b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(png_chunk(kind, data) for kind, data in chunks)


def png_chunk(kind, data):
    """Write one chunk: length, kind, data, checksum."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def globe_obj(sides=32, rings=16):
    """Write a unit sphere with texture coordinates: one point at each pole, one row of coordinates more than there are
    columns.

    Seen from outside, columns go to the right with the longitude, rows go down from the north pole.
    """
    latitude = (0.5 - np.arange(1, rings) / rings)[:, None] * np.pi
    longitude = (np.arange(sides) / sides - 0.5)[None, :] * (2 * np.pi)
    x, z = np.cos(latitude) * np.sin(longitude), np.cos(latitude) * np.cos(longitude)
    ring = np.stack([x, np.sin(latitude) + 0.0 * x, z], axis=-1).reshape(-1, 3)
    points = rounded(np.concatenate([ring, [(0.0, 1.0, 0.0), (0.0, -1.0, 0.0)]]))
    seam = [(j / sides, 1 - i / rings) for i in range(1, rings) for j in range(sides + 1)]
    poles = [((j + 0.5) / sides, v) for v in (1.0, 0.0) for j in range(sides)]

    def corner(i, j):
        return f"{(i - 1) * sides + j % sides + 1}/{(i - 1) * (sides + 1) + j + 1}"

    def pole(number, j):
        return f"{len(ring) + number + 1}/{len(seam) + number * sides + j + 1}"

    faces = [f"f {pole(0, j)} {corner(1, j)} {corner(1, j + 1)}" for j in range(sides)]
    for i in range(1, rings - 1):
        faces += [
            f"f {corner(i, j)} {corner(i + 1, j)} {corner(i + 1, j + 1)} {corner(i, j + 1)}" for j in range(sides)
        ]
    faces += [f"f {corner(rings - 1, j)} {pole(1, j)} {corner(rings - 1, j + 1)}" for j in range(sides)]
    lines = ["# globe, made by make_models.py", "mtllib globe.mtl", "o globe"]
    lines += ["v " + " ".join(map(number_text, point)) for point in points]
    lines += ["vt " + " ".join(map(number_text, pair)) for pair in seam + poles]
    return "\n".join([*lines, "usemtl globe", *faces, ""]).encode()


def globe_files():
    """Return the files of the globe by their names."""
    material = "newmtl globe\nKd 1 1 1\nKs 0.15 0.15 0.15\nNs 30\nmap_Kd globe.png\n"
    return {"globe.obj": globe_obj(), "globe.mtl": material.encode(), "globe.png": png_bytes(globe_texels(), PALETTE)}
