"""Arrays of a .npz file, looked at before they are unpacked: a file of some kilobytes may hold gigabytes.

.npz   a zip file of .npy files: a header, which tells shape and dtype, and the numbers
"""

import math
import os
import tokenize
import zipfile
import zlib
from collections.abc import Mapping

import numpy as np
from numpy.lib import format as npy

from ..errors import ModelError

MOST_UNPACKED = 2**28  # bytes that the arrays of any .npz may have together, packed or not
MOST_RATIO = 20  # of bytes in the arrays to bytes of the file, beyond MOST_UNPACKED
# What numpy and zipfile have been seen to raise for damaged files, besides their own errors.
_FAULTS = (
    OSError, ValueError, EOFError, TypeError, SyntaxError, LookupError, RuntimeError, MemoryError, ArithmeticError,
    AttributeError, zipfile.BadZipFile, zlib.error, tokenize.TokenError,
)  # fmt: skip


class Arrays(Mapping):
    """Map the names of a .npz file's arrays to the arrays, each unpacked when it is first asked for; no object is ever
    made.

    Parameters
    ----------
    stream : binary file object, or path
    name : text, what messages call it

    Raises
    ------
    ModelError : no .npz file, a damaged or encrypted one, or one that unpacks to more than MOST_UNPACKED bytes and
        MOST_RATIO times its size; also when an array is asked for that is damaged or holds objects
    """

    def __init__(self, stream, name: str):
        self._name, self._found = name, {}
        try:
            self._archive = zipfile.ZipFile(stream)
            members = self._archive.infolist()
            self._archive.fp.seek(0, os.SEEK_END)
            limit = max(MOST_UNPACKED, MOST_RATIO * self._archive.fp.tell())
        except _FAULTS as fault:
            raise self._fault(fault) from fault
        total = sum(member.file_size for member in members)
        if total > limit:
            raise ModelError(f"{name}: its arrays would take {total} bytes; an .npz file of its size may have {limit}")
        self.n_byte = total  # of all arrays
        self._members = {member.filename.removesuffix(".npy"): member for member in members}

    def _fault(self, fault) -> ModelError:
        reason = " ".join(str(fault).split())[:200] or type(fault).__name__
        return ModelError(f"{self._name}: can't be read as .npz ({reason})")

    def __len__(self) -> int:
        return len(self._members)

    def __iter__(self):
        return iter(self._members)

    def __contains__(self, key) -> bool:
        return key in self._members

    def __getitem__(self, key) -> np.ndarray:
        if key not in self._found:
            try:
                self._found[key] = self._read(self._members[key])
            except _FAULTS as fault:
                raise self._fault(fault) from fault
        return self._found[key]

    def _read(self, member) -> np.ndarray:
        """Unpack one array, whose header must ask for what the member holds, and no more."""
        if member.flag_bits & 1:
            raise ValueError(f"{member.filename} is encrypted")
        with self._archive.open(member) as stream:
            version = npy.read_magic(stream)
            read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
            shape, is_fortran, dtype = read_header(stream)
            if dtype.hasobject or dtype.names or dtype.kind not in "biuf":
                raise ValueError(f"{member.filename} holds no numbers, but {str(dtype)[:40]}")
            length = math.prod(shape) * dtype.itemsize
            if min(shape, default=0) < 0 or length > member.file_size:
                raise ValueError(
                    f"{member.filename} must hold {length} bytes for its shape, and has {member.file_size}"
                )
            data = stream.read(length)
            if len(data) < length:
                raise ValueError(f"{member.filename} is cut off")
        return np.frombuffer(data, dtype).reshape(shape, order="F" if is_fortran else "C")
