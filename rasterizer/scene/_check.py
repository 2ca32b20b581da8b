"""Checks shared by the scene's dataclasses: a number, a vector, a word, a size."""

import math
import reprlib

import numpy as np

from rasterizer.errors import SceneError

COORDINATE_LIMIT = 1e100  # beyond it, products of coordinates overflow

AXES = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "-x": (-1.0, 0.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "-z": (0.0, 0.0, -1.0),
}


def shown(value) -> str:
    """Return `repr(value)`, cut to a length that fits a message; of something large only the beginning is looked at."""
    try:
        text = _SHORT.repr(value)
    except (ValueError, RecursionError):  # a whole number of thousands of digits
        text = f"<{type(value).__name__}>"
    text = " ".join(text.split())
    return text if len(text) <= 80 else text[:77] + "..."


def _short_repr() -> reprlib.Repr:
    """Make what writes the beginning of a value: enough for a message."""
    short = reprlib.Repr()
    short.maxlevel = 5
    for kind in ("dict", "list", "tuple", "set", "frozenset", "deque", "array"):
        setattr(short, f"max{kind}", 40)
    for kind in ("string", "long", "other"):
        setattr(short, f"max{kind}", 400)
    return short


_SHORT = _short_repr()


def number(value, what: str) -> float:
    """Return `value` as a finite float; SceneError where it is none (booleans and text are none)."""
    is_scalar = not isinstance(value, (str, bytes, bool, np.bool_)) and getattr(value, "ndim", 0) == 0
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
    if not is_whole or width < 1 or height < 1:
        raise SceneError(f"size must be (width, height), whole pixels of at least 1; given {shown(size)}")
    return int(width), int(height)
