"""Files of a frame's arrays: one of them as .npy or PNG, several in an .npz or EXR file.

    .npy   one array as it is
    .npz   arrays by name, deflated
    .png   whole numbers: mask, alpha, normals in 8 bits, depth and indices in 16; text fields say how to read them
    .exr   channels of float32, lossless; by the library OpenEXR (extra `exr`)

In: arrays by name, as `Frame` has them. Out: the bytes of a file.

What a PNG file holds is stored·scale + offset; the text fields "array", "scale", "offset" and "nothing" say it. What is
out of range is an error: nothing is limited in silence. Normals have 8 bits a channel, as normal maps have: of 16 bits
in three channels Pillow, and imageio with it, reads 8 without a word.

An EXR file of one array has the channels that every program looks for: Y, or R, G and B (B is 0 with texture
coordinates). One of several has a name for each, see CHANNELS; programs that know no names read its colours alone. Its
numbers are those of the arrays, indices too, which float32 holds up to 2^24. Colours beside alpha are multiplied by it,
as is the custom there.
"""

import io
import math
import os
import tempfile
import zipfile
from collections.abc import Sequence
from typing import IO

import numpy as np
from numpy.typing import NDArray

from ..choices import ARRAY_SUFFIXES, SAVED_ARRAYS, Scale
from ..errors import OutputError, SceneError, cut, import_extra, shown
from ..scene.validate import number
from .png import encode_png

DEFAULT_SCALE = 0.001  # of depths in PNG files: millimetres, where a scene unit is a metre
MAX_U8, MAX_U16 = 255, 65535  # the largest numbers of 8 and 16 bits
MAX_WHOLE = 1 << 24  # float32 holds all whole numbers up to it
INDICES = ("face", "object", "material")
NORMALS = ("normal", "normal_camera")
IN_PNG = ("rgb", "rgba", "alpha", "depth", "mask", *INDICES, *NORMALS)
CHANNELS = {  # of EXR files that hold several arrays
    "color": ("R", "G", "B"),
    "alpha": ("A",),
    "depth": ("Z",),
    "normal": ("N.X", "N.Y", "N.Z"),
    "position": ("P.X", "P.Y", "P.Z"),
    "normal_camera": ("Ncamera.X", "Ncamera.Y", "Ncamera.Z"),
    "position_camera": ("Pcamera.X", "Pcamera.Y", "Pcamera.Z"),
    "uv": ("UV.U", "UV.V"),
    "barycentric": ("barycentric.X", "barycentric.Y", "barycentric.Z"),
    "mask": ("mask",),
    "face": ("id.face",),
    "object": ("id.object",),
    "material": ("id.material",),
}


def encode_arrays(arrays: dict[str, NDArray], format: str, scale: Scale = None) -> bytes:
    """Return arrays by name as the bytes of a file.

    Parameters
    ----------
    arrays : as `Frame` has them
    format : small letters: "npy", "npz", "exr" or "png"
    scale : of depths in a PNG file, see `encode_array_png`

    Raises
    ------
    SceneError : no array, several for a format that holds one, one that the format doesn't hold, a scale in vain
    OutputError : a value that is out of range, or a library that is missing
    """
    names = list(arrays)
    check_arrays(names, format, scale)
    if format == "png":
        return encode_array_png(names[0], arrays[names[0]], scale)
    if format == "npy":
        return encode_npy(arrays[names[0]])
    return encode_npz(arrays) if format == "npz" else encode_exr(arrays)


def check_arrays(names: Sequence[str], format: str, scale: Scale = None) -> None:
    """Refuse what a file of arrays can't hold; parameters and errors are those of `encode_arrays`."""
    if not names:
        raise SceneError(f"array must name at least one of {', '.join(SAVED_ARRAYS)}; given none")
    given = ", ".join(names)
    if format not in (*ARRAY_SUFFIXES, "png"):
        legal = "arrays are written as .npy, .npz, .exr or .png"
        raise SceneError(f"{legal}; given {'.' + format if format else 'no suffix'} for {given}")
    if format in ("npy", "png") and len(names) > 1:
        raise SceneError(f"a .{format} file holds one array, .npz and .exr files several; given {cut(given, 90)}")
    if format == "png" and names[0] not in IN_PNG:
        raise SceneError(f"a PNG file can't hold {names[0]!r}: write it as .npy, .npz or .exr")
    if format == "png":
        check_scale(scale, names[0])
    elif scale is not None:
        raise SceneError(f"scale is that of depth in a PNG file; given scale={shown(scale)} for .{format}")
    if format == "exr":
        for name in {"rgb", "rgba"}.intersection(names):
            raise SceneError(f"an EXR file holds linear colours: give 'color', not {name!r}")
        import_exr()


def encode_npy(array: NDArray) -> bytes:
    """Return an array as the bytes of a .npy file."""
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def read_npy(source: str | IO[bytes]) -> NDArray:
    """Return the array of a .npy file, given by its path or as a stream.

    Raises
    ------
    ValueError : it is damaged, or an array of objects, or no array
    OSError : it can't be read
    """
    try:
        with np.errstate(all="ignore"):
            array = np.load(source, allow_pickle=False)
    except OSError:
        raise
    except Exception as fault:  # the head is Python's text: numpy lets out whatever its parsers meet
        raise ValueError(cut(fault) or type(fault).__name__) from fault
    if not isinstance(array, np.ndarray):
        raise ValueError("it is no array")
    return array


def encode_npz(arrays: dict[str, NDArray]) -> bytes:
    """Return arrays by name as the bytes of an .npz file; of equal arrays the same bytes."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, array in arrays.items():
            entry = zipfile.ZipInfo(f"{name}.npy")  # of a fixed date
            # Level 6, the default of an entry of its own, takes three times as long.
            archive.writestr(entry, encode_npy(array), zipfile.ZIP_DEFLATED, compresslevel=1)
    return stream.getvalue()


def encode_array_png(name: str, array: NDArray, scale: Scale = None) -> bytes:
    """Return an array as the bytes of a PNG file.

    Parameters
    ----------
    name : one of IN_PNG
    array : as `Frame` has it
    scale : scene units that 1 in the file stands for, of depths alone, see `scale_of`

    Raises
    ------
    SceneError : an array that whole numbers can't hold; a scale that is no number above 0, or of another array
    OutputError : a value that is out of range
    """
    check_scale(scale, name)
    if name in ("rgb", "rgba"):
        return encode_png(array)
    if name == "depth":
        stored, text = _stored_depths(array, scale_of(array, scale))
    elif name == "mask":
        stored, text = np.where(array, np.uint8(MAX_U8), np.uint8(0)), _text(1 / MAX_U8, 0, "0 or 1")
    elif name == "alpha":
        stored, text = np.rint(array * MAX_U8).astype(np.uint8), _text(1 / MAX_U8, 0, "covered share")
    elif name in INDICES:
        if array.max(initial=-1) >= MAX_U16:
            legal = f"a PNG file holds indices up to {MAX_U16 - 1}"
            raise OutputError(f"{legal}; given {name} {array.max()}: write it as .npy, .npz or .exr")
        stored, text = (array + 1).astype(np.uint16), _text(1, -1, "index")
    else:  # NORMALS: no other arrays pass check_arrays
        stored = np.rint((array.astype(np.float64) + 1) * (MAX_U8 / 2)).astype(np.uint8)
        stored[(array == 0).all(axis=-1)] = 0  # which no unit vector is
        text = _text(2 / MAX_U8, -1, "unit vector")
    has_runs = name == "mask" or name in INDICES
    return encode_png(stored.reshape(*array.shape[:2], -1), {"array": name, **text}, has_runs)


def check_scale(scale: Scale, name: str) -> None:
    """Refuse a scale that is no number above 0, or of another array than depth; raises SceneError."""
    if scale is not None and name != "depth":
        raise SceneError(f"scale is that of depth in a PNG file; given scale={shown(scale)} for {name!r}")
    is_given = scale is not None and not (isinstance(scale, str) and scale == "auto")
    if is_given and not number(scale, "scale") > 0:
        raise SceneError(f"scale must be a number above 0, the scene units of 1, or 'auto'; given {shown(scale)}")


def scale_of(depths: NDArray, scale: Scale) -> float:
    """Return the scene units that 1 stands for in a PNG file of depths; "auto": so that the furthest just fits, rounded
    up to two digits."""
    if scale != "auto":
        return DEFAULT_SCALE if scale is None else number(scale, "scale")
    high = float(np.max(depths, where=np.isfinite(depths), initial=0.0))
    return _rounded_up(high / MAX_U16) if high > 0.0 else DEFAULT_SCALE


def _stored_depths(depths: NDArray, scale: float) -> tuple[NDArray[np.uint16], dict[str, str]]:
    """Return depths as 16-bit numbers, 0 where nothing is, and what is said of them."""
    is_seen = np.isfinite(depths)
    stored = np.zeros(depths.shape)
    stored[is_seen] = np.rint(depths[is_seen].astype(np.float64) / scale)
    if is_seen.any() and not (stored[is_seen].min() >= 1 and stored.max() <= MAX_U16):
        low, high = float(depths[is_seen].min()), float(depths[is_seen].max())
        legal = f"with scale {scale:g} a PNG file holds depths from {scale:g} to {MAX_U16 * scale:g}"
        fitting = f"; scale={_rounded_up(high / MAX_U16):g} or more holds the deepest" if high > MAX_U16 * scale else ""
        raise OutputError(f"{legal}; given {low:g} to {high:g}{fitting}")
    return stored.astype(np.uint16), _text(scale, 0, "scene units along the viewing axis")


def _rounded_up(value: float) -> float:
    """Return the next number with two digits."""
    power = math.floor(math.log10(value)) - 1
    return float(f"{math.ceil(value / 10.0**power)}e{power}")


def _text(scale: float, offset: float, unit: str) -> dict[str, str]:
    """What a PNG file says of its numbers."""
    formula = f"stored * {scale!r} {'-' if offset < 0 else '+'} {abs(offset)}"
    return {
        "scale": repr(scale),
        "offset": repr(offset),
        "nothing": "0",
        "Description": f"{formula}, {unit}; 0 = nothing",
    }


def encode_exr(arrays: dict[str, NDArray]) -> bytes:
    """Return arrays by name as the bytes of an EXR file: its channels are listed at the top of this file.

    Colours are multiplied by the array "alpha", where there is one.

    Raises
    ------
    OutputError : the library OpenEXR is missing, or can't write the file; a whole number that float32 doesn't hold
    """
    exr = import_exr()
    channels: dict[str, NDArray[np.float32]] = {}
    for name, array in arrays.items():
        if array.dtype.kind in "iu" and array.max(initial=0) > MAX_WHOLE:
            legal = f"an EXR file holds whole numbers up to {MAX_WHOLE}"
            raise OutputError(f"{legal}; given {name} {array.max()}: write it as .npy or .npz")
        if name == "color" and "alpha" in arrays:
            array = array * arrays["alpha"][..., None]
        columns = array.reshape(*array.shape[:2], -1)
        n_column = columns.shape[2]
        if len(arrays) == 1 and n_column == 2:
            columns = np.concatenate([columns, np.zeros_like(columns[..., :1])], axis=2)
        if len(arrays) == 1 and n_column <= 3:
            names = ("Y",) if n_column == 1 else ("R", "G", "B")
        else:
            names = CHANNELS[name]
        for k, channel in enumerate(names):
            channels[channel] = np.ascontiguousarray(columns[..., k], np.float32)
    header = {
        "compression": exr.ZIP_COMPRESSION,
        "type": exr.scanlineimage,
        "comments": f"{', '.join(arrays)}: numbers as in the arrays; colours beside alpha are multiplied by it",
    }
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "arrays.exr")
        try:
            exr.File(header, channels).write(path)
        except (RuntimeError, ValueError, TypeError) as error:
            raise OutputError(f"can't write an EXR file: {error}") from error
        with open(path, "rb") as stream:
            return stream.read()


def import_exr():
    """Return the library OpenEXR; raises OutputError, which names the extra, where it is missing."""
    return import_extra("OpenEXR", "exr", "an EXR file", OutputError)
