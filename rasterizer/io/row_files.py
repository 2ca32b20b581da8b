"""Pictures that are written band by band: files in which the place of each row is known before it is drawn.

    .tif .tiff   8 bits of red, green, blue and alpha, sRGB (tiff.py)
    .npy         one of the picture's arrays: color, rgb, rgba or alpha

In: rows of a picture, in any order, from any thread. Out: a file that appears when it is whole. Memory holds no more of
the picture than the bands that are being drawn.
"""

import io
import os
import shutil
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import OutputError, shown
from .files import HiddenFile
from .tiff import tiff_header

TIFF_SUFFIXES = ("tif", "tiff")


class RowFormat(NamedTuple):
    """A header, then rows."""

    array: str  # "rgba", "rgb", "color" or "alpha", as `Frame` names them
    header: Callable[[int, int], bytes]  # of width and height, pixels
    pixel_bytes: int


def row_format_of(format: str, array: str | None) -> RowFormat | None:
    """Return how a picture is written band by band; None for formats, and arrays, that can't be.

    Parameters
    ----------
    format : small letters: "tif", "tiff", "npy", or another
    array : of a .npy file; None = "color"
    """
    if format in TIFF_SUFFIXES and array is None:
        return RowFormat("rgba", tiff_header, 4)
    is_one = array is None or isinstance(array, str)
    kind = _ARRAYS.get(array or "color") if format == "npy" and is_one else None
    if kind is None:
        return None
    dtype, n_channel = kind
    return RowFormat(
        array or "color",
        lambda width, height: npy_header(dtype, (height, width, n_channel) if n_channel > 1 else (height, width)),
        np.dtype(dtype).itemsize * n_channel,
    )


_ARRAYS = {"color": (np.float32, 3), "rgb": (np.uint8, 3), "rgba": (np.uint8, 4), "alpha": (np.float32, 1)}


def npy_header(dtype, shape: tuple[int, ...]) -> bytes:
    """Return what stands before the numbers of an array in the file that numpy.save makes of it."""
    stream = io.BytesIO()
    description = {"descr": np.lib.format.dtype_to_descr(np.dtype(dtype)), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, description)
    return stream.getvalue()


class RowFile:
    """A picture's file on its way: a context manager, which removes what has not been moved to its place.

    Parameters
    ----------
    path : where the file goes; a link keeps its name and gets a new target
    kind : RowFormat
    size : (width, height) of the picture, pixels
    finish : called with (n_row, width, 4) uint8 and the number of the first row before they are written, by any thread;
        returns what is written in their stead. None = they are written as they come

    Raises OutputError for a name that no file can have.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        kind: RowFormat,
        size: tuple[int, int],
        finish: Callable[[NDArray[np.uint8], int], NDArray[np.uint8]] | None = None,
    ) -> None:
        self.path: str | os.PathLike[str] = path
        self.kind: RowFormat = kind
        self.size: tuple[int, int] = size
        self._finish = finish
        self.is_black: bool = True  # no channel of any pixel that was written is more than 0
        self._header = kind.header(*size)
        try:
            self._file = HiddenFile(os.path.realpath(path))
        except ValueError as error:  # a name that no file can have
            raise OutputError(f"can't write {shown(os.fspath(path))}: {error}") from error

    @property
    def n_byte(self) -> int:
        """Bytes of the whole file."""
        width, height = self.size
        return len(self._header) + width * height * self.kind.pixel_bytes

    def __enter__(self) -> "RowFile":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.remove()

    def begin(self) -> None:
        """Write the header; OutputError where the file can't be written, or has no room."""
        try:
            self._check_room()
            self._file.create()
            self._file.write_at(0, self._header)
        except OSError as error:
            raise self._error(error) from error

    def write_rows(self, y_start: int, rows: Any) -> None:
        """Write rows from the row `y_start` on; threads may do so at the same time.

        Parameters
        ----------
        rows : Picture of the resolve stage: color (n_row, width, 3) float32 and alpha (n_row, width) float32, linear,
            without rows where only bytes are wanted; rgba (n_row, width) uint32, a pixel's bytes in memory order red,
            green, blue, alpha

        Raises OutputError where the disk is full.
        """
        if self._finish is not None:
            rgba = self._finish(rows.rgba.view(np.uint8).reshape(*rows.rgba.shape, 4), y_start)
            rows = rows._replace(rgba=rgba.view(np.uint32)[..., 0])
        content = np.ascontiguousarray(self._array_of(rows))
        if self.is_black and (rows.rgba & _COLOR_BYTES).any():
            self.is_black = False
        try:
            self._file.write_at(len(self._header) + y_start * self.size[0] * self.kind.pixel_bytes, content)
        except OSError as error:
            raise self._error(error) from error

    def end(self) -> None:
        """End writing: files that wait until they are moved are not kept open."""
        try:
            self._file.close()
        except OSError as error:
            raise self._error(error) from error

    def move(self) -> None:
        """Put the file in its place; OutputError where that can't be done."""
        try:
            self._file.move()
        except OSError as error:
            raise self._error(error) from error

    def _array_of(self, rows) -> NDArray:
        """Return what the file holds of the rows."""
        if self.kind.array == "color":
            return rows.color
        if self.kind.array == "alpha" and len(rows.alpha):
            return rows.alpha
        rgba = rows.rgba.view(np.uint8).reshape(*rows.rgba.shape, 4)
        if self.kind.array == "alpha":
            return rgba[..., 3] / np.float32(255)
        return rgba[..., :3] if self.kind.array == "rgb" else rgba

    def _check_room(self) -> None:
        """Refuse a file that is larger than the free room in its folder."""
        free = shutil.disk_usage(os.path.dirname(self._file.place)).free
        if free < self.n_byte:
            raise OSError(28, f"it takes {self.n_byte / 1e9:.3g} GB, and {free / 1e9:.3g} GB are free in its folder")

    def _error(self, error: OSError) -> OutputError:
        folder = os.path.dirname(self._file.place)
        reason = (error.strerror or str(error)) if os.path.isdir(folder) else f"there is no folder {folder}"
        return OutputError(f"can't write {self.path}: {reason}")


_COLOR_BYTES = np.uint32(int.from_bytes(b"\xff\xff\xff\0", "little"))  # red, green and blue of a pixel
