"""Buffers, views and accessors of a glTF file: bytes to arrays, each number of the tree checked before it is followed.

    buffer      the binary chunk of a GLB file, a data: URI, or a file beside the model, of which byteLength bytes are
                read
    bufferView  a range of a buffer
    accessor    rows of numbers in a view, byteStride bytes from one to the next; without a view they are 0. A sparse
                one replaces some of them

Arrays are views of the bytes that were read: however often accessors refer to a buffer, it is there once. Rows that are
not in a buffer could be any number of them, so together they are limited.
Format: Khronos, glTF 2.0 Specification, 2021, 3.6.
"""

import base64
import binascii
import struct
from urllib.parse import unquote, unquote_to_bytes

import numpy as np

from .model_file import ModelFile

MOST_MADE = 2**25  # numbers of accessors without a view, and of sparse ones: 128 MB of float32
_BIN_CHUNK = 0x004E4942
_DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


class Buffers:
    """The bytes that a glTF file refers to.

    Parameters
    ----------
    model : ModelFile
    tree : dict, the file's JSON tree
    tail : bytes, what follows the tree in a GLB file
    """

    def __init__(self, model: ModelFile, tree: dict, tail: bytes):
        self.model, self.tree, self.tail = model, tree, tail
        self._buffers, self._arrays = {}, {}
        self._n_made = 0  # numbers in arrays that no buffer holds

    def uri(self, uri, most: int | None = None) -> bytes:
        """Return what a URI holds or names, up to `most` bytes.

        Raises ModelError for a file that can't be read or may not be, ValueError for a data: URI that is damaged.
        """
        if not isinstance(uri, str):
            raise TypeError(f"uri must be text, not {type(uri).__name__}")
        if uri.startswith("data:"):
            head, _, body = uri.partition(",")
            try:
                data = base64.b64decode(body) if head.endswith(";base64") else unquote_to_bytes(body)
            except binascii.Error as fault:
                raise ValueError(f"a data: URI is damaged ({fault})") from fault
            return data[:most]
        name = uri if len(uri) <= 80 else uri[:77] + "..."
        if self.model.folder is None:
            raise self.model.error(f"needs the file '{name}', but was given without a folder")
        try:
            beside = self.model.beside
            return beside.read_bytes(beside.find(unquote(uri)), most)
        except (OSError, ValueError) as fault:
            reason = getattr(fault, "strerror", None) or fault
            raise self.model.error(f"needs the file '{name}', which can't be read ({reason})") from fault

    def view(self, number) -> memoryview:
        """Return the bytes of a bufferView."""
        view = item(self.tree, "bufferViews", number)
        data = self._buffer(view["buffer"])
        begin, length = whole(view, "byteOffset", 0), whole(view, "byteLength")
        if begin + length > len(data):
            raise ValueError(f"bufferViews {number} ends at byte {begin + length} of a buffer of {len(data)}")
        return memoryview(data)[begin : begin + length]

    def _buffer(self, number) -> bytes:
        if number not in self._buffers:
            buffer = item(self.tree, "buffers", number)
            most = whole(buffer, "byteLength")
            data = self.uri(buffer["uri"], most) if "uri" in buffer else self._chunk()
            if len(data) < most:
                raise ValueError(f"buffer {number} must have {most} bytes, but has {len(data)}")
            self._buffers[number] = data
        return self._buffers[number]

    def _chunk(self) -> bytes:
        """Return the binary chunk of a GLB file, the first that follows the tree."""
        if len(self.tail) < 8:
            raise ValueError("a buffer has no uri, and there is no binary chunk")
        length, kind = struct.unpack_from("<2I", self.tail)
        if kind != _BIN_CHUNK or length > len(self.tail) - 8:
            raise ValueError("the binary chunk is cut off, or of another kind")
        return self.tail[8 : 8 + length]

    def array(self, number) -> np.ndarray:
        """Return the rows (count, width) of an accessor, as they are stored.

        Raises
        ------
        TypeError, LookupError, ValueError : what is none of glTF, reaches beyond its buffer, or asks for too many rows
        """
        if number not in self._arrays:
            self._arrays[number] = self._read(number)
        return self._arrays[number]

    def _read(self, number) -> np.ndarray:
        accessor, label = item(self.tree, "accessors", number), f"accessor {number}"
        dtype = np.dtype(_DTYPES[_known(accessor, "componentType", _DTYPES)])
        width, count = _WIDTHS[_known(accessor, "type", _WIDTHS)], whole(accessor, "count")
        has_view = "bufferView" in accessor
        rows = self._rows(accessor, dtype, (count, width), label) if has_view else None
        if rows is not None and "sparse" not in accessor:
            return rows
        self._n_made += count * width
        if count < 1 or self._n_made > MOST_MADE:
            raise ValueError(f"{label}: {count} rows that no buffer holds; 1 is needed, {MOST_MADE} numbers are legal")
        made = np.zeros((count, width), dtype) if rows is None else np.array(rows)
        if "sparse" in accessor:
            self._replace(made, accessor["sparse"], label)
        return made

    def _rows(self, table, dtype, shape, label) -> np.ndarray:
        """Return the rows of a view that a table refers to, without a copy."""
        count, width = shape
        data, begin = self.view(table["bufferView"]), whole(table, "byteOffset", 0)
        row = width * dtype.itemsize
        stride = whole(item(self.tree, "bufferViews", table["bufferView"]), "byteStride", row)
        if stride < 1:
            raise ValueError(f"byteStride must be above 0; given {stride}")
        end = begin + (count - 1) * stride + row
        if count < 1 or end > len(data):
            raise ValueError(f"{label} of {count} rows ends at byte {end} of {len(data)}")
        # The buffer is as long as the last byte of the last row: checked above.
        return np.ndarray((count, width), dtype, data, begin, (stride, dtype.itemsize))

    def _replace(self, rows, sparse, label) -> None:
        """Put the rows of a sparse accessor where its indices say."""
        count, indices, values = whole(sparse, "count"), sparse["indices"], sparse["values"]
        dtype = np.dtype(_DTYPES[_known(indices, "componentType", _DTYPES)])
        places = self._rows(indices, dtype, (count, 1), f"the indices of {label}")[:, 0]
        if dtype.kind != "u" or places.max() >= len(rows):
            raise ValueError(f"the indices of {label} must be whole numbers below {len(rows)}")
        rows[places] = self._rows(values, rows.dtype, (count, rows.shape[1]), f"the values of {label}")


def _known(table, key, legal):
    """Return what a table has under a key; a ValueError that says what is legal where it is something else."""
    if table[key] not in legal:
        raise ValueError(f"{key} must be one of {', '.join(map(str, legal))}; given {str(table[key])[:40]}")
    return table[key]


def item(tree, key, number) -> dict:
    """Return an item of one of the tree's lists; a LookupError that names it where it is none."""
    items = tree.get(key, [])
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < len(items):
        raise IndexError(f"{key} has no number {str(number)[:40]}")
    if not isinstance(items[number], dict):
        raise TypeError(f"{key} {number} is no table")
    return items[number]


def whole(table, key, default=None) -> int:
    """Return a whole number of at least 0 out of a table; TypeError where it is none, KeyError where it is missing."""
    number = table[key] if default is None else table.get(key, default)
    if isinstance(number, float) and number.is_integer():  # 12.0 is a whole number of JSON, too
        number = int(number)
    if isinstance(number, bool) or not isinstance(number, int) or number < 0:
        raise TypeError(f"{key} must be a whole number of at least 0, not {str(number)[:40]}")
    return number
