"""Checks shared by the scene's dataclasses, the options and the analysis: a number, a vector, a word, a size.

Each returns the value in the form that is stored, or raises SceneError with what was given and what is legal. Only the
standard library is imported, because the command line's help needs the options.
"""

import math
import operator
from collections.abc import Collection
from dataclasses import MISSING, fields
from typing import Any, TypeVar

from ..errors import SceneError, shown
from ..keywords import checked_fields

T = TypeVar("T", bound=type)

COORDINATE_LIMIT = 1e100  # beyond it, products of coordinates overflow
# A unit vector that was computed once has n·n = 1 to 10 roundings of 2^-53: 3 of the sum, 1 of the root and 1 of the
# division of each component count twice in the square, 3 of this sum, and 1 to spare. It stays what it is when it is
# stored again: in a scene that was saved, in a copy.
UNIT_SLACK = 10 * 2.0**-53
_MAX_PIXELS = 2**31 - 1  # that any size may have; a picture has fewer, see Options


def number(
    value: object,
    what: str,
    *,
    low: float = -math.inf,
    above: float = -math.inf,
    high: float = math.inf,
    below: float = math.inf,
    unit: str = "",
) -> float:
    """Return `value` as a finite float; SceneError where it is none, or one that is not legal.

    Booleans, text and masked values are no numbers.

    Parameters
    ----------
    what : names the value in the message
    low, high : the least and the largest that are legal
    above, below : what a legal one is above and below
    unit : text, follows the limits in the message
    """
    is_scalar = not isinstance(value, (str, bytes, bool)) and getattr(value, "ndim", 0) == 0
    # The kind of numpy's booleans is "b"; a masked value has a mask that is true.
    is_scalar = is_scalar and getattr(getattr(value, "dtype", None), "kind", "f") in "fiu"
    is_scalar = is_scalar and not getattr(value, "mask", False)
    try:
        result = float(value) if is_scalar else math.nan  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        result = math.nan
    if math.isfinite(result) and low <= result <= high and above < result < below:
        return result
    limits = {"at least": low, "above": above, "at most": high, "below": below}
    legal = " and ".join(f"{word} {limit:g}" for word, limit in limits.items() if math.isfinite(limit))
    if math.isfinite(high - low):
        legal = f"within {low:g}..{high:g}"
    legal = legal + unit if math.isfinite(result) else f"a finite number {legal}{unit}".rstrip()
    raise SceneError(f"{what} must be {legal}; given {shown(value)}")


def is_whole(value: object, low: float = -math.inf, high: float = math.inf) -> bool:
    """Tell whether a value is an integer within low..high: Python's or numpy's, no float and no boolean."""
    try:
        is_truth = type(value).__name__ in ("bool", "bool_")  # numpy's is an index to its older versions
        return not is_truth and low <= operator.index(value) <= high  # type: ignore[arg-type]
    except TypeError:
        return False


def whole(value: object, what: str, low: int, high: float = math.inf, unit: str = "") -> int:
    """Return `value` as an int within low..high; SceneError where it is anything else, with the limits and `unit`."""
    if not is_whole(value, low, high):
        legal = f"from {low} upwards" if high == math.inf else f"within {low}..{high}"
        raise SceneError(f"{what} must be a whole number {legal}{unit}; given {shown(value)}")
    return operator.index(value)  # type: ignore[arg-type]


def flag(value: object, what: str) -> bool:
    """Return `value` as a bool, Python's or numpy's; SceneError where it is anything else."""
    # That of numpy, which isn't imported here, is told by its name.
    if not isinstance(value, bool) and type(value).__name__ not in ("bool_", "bool"):
        raise SceneError(f"{what} must be True or False; given {shown(value)}")
    return bool(value)


def text(value: object, what: str) -> str:
    """Return `value` where it is text; SceneError where it is anything else."""
    if not isinstance(value, str):
        raise SceneError(f"{what} must be text; given {shown(value)}")
    return value


def items_of(value: Any) -> list[Any]:
    """Return what a sequence or an array of any library holds; nothing of text, and of what is no sequence."""
    try:
        if hasattr(value, "__dlpack__") and not hasattr(value, "__array_interface__"):  # not numpy's
            from .arrays import plain_array

            value = plain_array(value).tolist()
        return [] if isinstance(value, (str, bytes)) else list(value)
    except TypeError:
        return []


def vector3(value: object, what: str) -> tuple[float, float, float]:
    """Return `value` as three finite floats; SceneError where it is anything else."""
    items = items_of(value)
    if len(items) != 3:
        raise SceneError(f"{what} must be three finite numbers; given {shown(value)}")
    each = f"each of the three numbers of {what}"
    return number(items[0], each), number(items[1], each), number(items[2], each)


def position3(value: object, what: str) -> tuple[float, float, float]:
    """Return `value` as a point: three floats within ±COORDINATE_LIMIT; SceneError where it is anything else."""
    place = vector3(value, what)
    if max(map(abs, place)) > COORDINATE_LIMIT:
        raise SceneError(f"{what} must be within ±{COORDINATE_LIMIT:g} scene units; given {shown(value)}")
    return place


def unit3(value: object, what: str) -> tuple[float, float, float]:
    """Return `value` as a unit 3-vector, itself where it is one; SceneError where it has no length or isn't finite."""
    return at_unit_length(vector3(value, what), what)


def at_unit_length(vector: tuple[float, float, float], what: str) -> tuple[float, float, float]:
    """Return what `unit3` does of three finite floats."""
    x, y, z = vector
    if abs(x * x + y * y + z * z - 1.0) <= UNIT_SLACK:
        return x, y, z
    # dividing by the largest component first keeps the squares from over- and underflowing
    largest = max(abs(x), abs(y), abs(z))
    if largest == 0.0:
        raise SceneError(f"{what} must have a length; given {shown(vector)}")
    x, y, z = x / largest, y / largest, z / largest
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


def choice(value: object, legal: Collection[str], what: str) -> str:
    """Return `value` where it is one of the `legal` words, else raise SceneError that lists them."""
    if not isinstance(value, str) or value not in legal:
        raise SceneError(f"{what} must be one of {', '.join(map(repr, legal))}; given {shown(value)}")
    return value


def several(value: object, legal: Collection[str], what: str) -> tuple[Any, ...]:
    """Return words out of the `legal` ones as a tuple; one alone is a tuple of it, None of none. SceneError for
    anything else."""
    try:
        words = () if value is None else (value,) if isinstance(value, str) else tuple(value)  # type: ignore[arg-type]
    except TypeError:
        raise SceneError(f"{what} must be one or several of {', '.join(legal)}; given {shown(value)}") from None
    for word in words:
        choice(word, legal, what)
    return words


def picture_size(size: object) -> tuple[int, int]:
    """Return a picture's size as two ints of at least 1; whole floats are taken, too.

    Raises SceneError for anything else.
    """
    given: Any = size
    try:
        width, height = given
        sides = int(width), int(height)
        is_size = sides == (width, height) and 1 <= min(sides) and max(sides) <= _MAX_PIXELS
    except (TypeError, ValueError, OverflowError):
        is_size = False
    if not is_size:
        raise SceneError(f"size must be (width, height), whole pixels of at least 1; given {shown(size)}")
    return sides


# --- what the frozen dataclasses of a scene have in common ---------------------------------------------------


def store(instance: object, **values: object) -> None:
    """Set fields of a frozen dataclass to their checked values."""
    for name, value in values.items():
        object.__setattr__(instance, name, value)


def value_class(cls: T) -> T:
    """Let a dataclass say what fields it has where it is given another one, and print those that differ from their
    defaults."""
    cls.__repr__ = _short_repr  # type: ignore[method-assign, assignment]
    return checked_fields(cls)


def _short_repr(self: Any) -> str:
    """The fields that differ from their defaults, in one line."""
    told, follows = [], getattr(self, "FOLLOWS", {})
    for field in fields(self):
        value = getattr(self, field.name)
        if field.name in follows and value == getattr(self, follows[field.name]):
            continue
        default: Any = field.default_factory() if field.default_factory is not MISSING else field.default
        is_grey = isinstance(value, tuple) and isinstance(default, (int, float)) and not isinstance(default, bool)
        if field.default is MISSING or value != ((default,) * len(value) if is_grey else default):
            told.append(f"{field.name}={_text(value)}")
    return f"{type(self).__name__}({', '.join(told)})"


def _text(value: Any) -> str:
    """Six digits of each number, one number of a grey, and the beginning of anything else."""
    if isinstance(value, float):
        return f"{value + 0.0:g}"  # no -0
    if type(value) is tuple and value and all(isinstance(each, float) for each in value):
        return f"({', '.join(f'{each + 0.0:g}' for each in value)})"
    return shown(value)
