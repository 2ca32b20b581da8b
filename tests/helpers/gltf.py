"""glTF files made by hand: trees whose arrays and pictures are texts in them, or bytes behind them."""

import base64
import io
import json
import struct

import numpy as np
from PIL import Image

COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}  # by how many numbers a row has


def uri(data, kind="") -> str:
    return f"data:{kind};base64," + base64.b64encode(data).decode()


def png(pixels) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(np.array(pixels, np.uint8)).save(stream, "png")
    return stream.getvalue()


def picture_uri(pixels) -> str:
    return uri(png(pixels), "image/png")


def add_view(tree, data, **fields) -> int:
    """Put bytes or an array into a buffer and a view of its own; the view's number."""
    data = bytes(data)
    buffers, views = (tree.setdefault(name, []) for name in ("buffers", "bufferViews"))
    buffers.append({"uri": uri(data), "byteLength": len(data)})
    views.append({"buffer": len(buffers) - 1, "byteLength": len(data)} | fields)
    return len(views) - 1


def add_array(tree, rows, **fields) -> int:
    """Put an array into a buffer, a view and an accessor of its own; the accessor's number."""
    accessors, code = tree.setdefault("accessors", []), rows.dtype.str[1:]
    usual = {"componentType": COMPONENTS[code], "count": len(rows), "type": TYPES[rows[0].size]}
    accessors.append({"bufferView": add_view(tree, rows.tobytes())} | usual | fields)
    return len(accessors) - 1


def file_of(arrays, *primitives, **tree) -> bytes:
    """Return a glTF file of one mesh; `arrays` are its accessors in order."""
    whole = {"asset": {"version": "2.0"}, "meshes": [{"primitives": primitives}], "nodes": [{"mesh": 0}]}
    for rows in arrays:
        add_array(whole, rows, normalized=rows.dtype == np.uint8)
    return json.dumps(whole | tree).encode()


def glb(tree, data) -> bytes:
    """Return a GLB file of a tree, and of the bytes of its first buffer."""
    text = json.dumps(tree, separators=(",", ":")).encode()
    text, data = text + b" " * (-len(text) % 4), data + b"\0" * (-len(data) % 4)
    chunks = struct.pack("<2I", len(text), 0x4E4F534A) + text + struct.pack("<2I", len(data), 0x004E4942) + data
    return struct.pack("<3I", 0x46546C67, 2, 12 + len(chunks)) + chunks
