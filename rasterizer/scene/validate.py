"""Checks shared by the scene's dataclasses: a number, a vector, a word, a size."""

import math

import numpy as np

from ..errors import SceneError, shown

COORDINATE_LIMIT = 1e100  # beyond it, products of coordinates overflow

AXES = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "-x": (-1.0, 0.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "-z": (0.0, 0.0, -1.0),
}


_MOST_PIXELS = 2**31 - 1  # that any size may have; a picture has fewer, see Options


def plain_array(values) -> np.ndarray:
    """Return `np.asarray(values)`, numbers beyond float64 as infinities.

    Raises
    ------
    TypeError, ValueError : no array, or a masked one, whose masked values would count
    """
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise ValueError("masked values are no numbers")
    array = np.asarray(values)
    if array.dtype.kind == "f" and array.dtype.itemsize > 8:
        with np.errstate(over="ignore"):
            array = array.astype(np.float64)
    return array


def number(value, what: str) -> float:
    """Return `value` as a finite float; SceneError where it is none (booleans and text are none)."""
    is_scalar = not isinstance(value, (str, bytes, bool, np.bool_)) and getattr(value, "ndim", 0) == 0
    is_scalar = is_scalar and value is not np.ma.masked and getattr(getattr(value, "dtype", None), "kind", "f") in "fiu"
    try:
        result = float(value) if is_scalar else math.nan
    except (TypeError, ValueError, OverflowError):
        result = math.nan
    if not math.isfinite(result):
        raise SceneError(f"{what} must be a finite number; given {shown(value)}")
    return result


def vector3(value, what: str) -> tuple[float, float, float]:
    """Return `value` as three finite floats; SceneError where it is anything else."""
    try:
        items = [] if isinstance(value, (str, bytes)) else list(value)
    except TypeError:
        items = []
    if len(items) != 3:
        raise SceneError(f"{what} must be three finite numbers; given {shown(value)}")
    x, y, z = (number(item, f"each of the three numbers of {what}") for item in items)
    return x, y, z


def place3(value, what: str) -> tuple[float, float, float]:
    """Return `value` as three floats within ±COORDINATE_LIMIT; SceneError where it is anything else."""
    place = vector3(value, what)
    if max(map(abs, place)) > COORDINATE_LIMIT:
        raise SceneError(f"{what} must be within ±{COORDINATE_LIMIT:g} scene units; given {shown(value)}")
    return place


def unit3(value, what: str) -> tuple[float, float, float]:
    """Return `value` as a unit 3-vector; SceneError where it has no length or is not finite."""
    x, y, z = vector3(value, what)
    # dividing by the largest component first keeps the squares from over- and underflowing
    largest = max(abs(x), abs(y), abs(z))
    if largest == 0.0:
        raise SceneError(f"{what} must have a length; given {shown(value)}")
    x, y, z = x / largest, y / largest, z / largest
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


def choice(value, legal: tuple[str, ...], what: str) -> str:
    """Return `value` where it is one of the `legal` words, else raise SceneError that lists them."""
    if not isinstance(value, str) or value not in legal:
        raise SceneError(f"{what} must be one of {', '.join(map(repr, legal))}; given {shown(value)}")
    return value


def picture_size(size) -> tuple[int, int]:
    """Return a picture's size as two ints of at least 1."""
    try:
        width, height = size
        is_whole = int(width) == width and int(height) == height
    except (TypeError, ValueError, OverflowError):
        is_whole = False
    if not is_whole or not (1 <= width <= _MOST_PIXELS and 1 <= height <= _MOST_PIXELS):
        raise SceneError(f"size must be (width, height), whole pixels of at least 1; given {shown(size)}")
    return int(width), int(height)
