"""What the small dataclasses of a scene have in common: they name the nearest field, and print in one line."""

from dataclasses import MISSING, fields
from typing import Any, TypeVar

from ..errors import shown
from ..keywords import checked_fields

T = TypeVar("T", bound=type)


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
        default = field.default_factory() if field.default_factory is not MISSING else field.default
        if field.default is MISSING or not _is_same(value, default):
            told.append(f"{field.name}={_text(value)}")
    return f"{type(self).__name__}({', '.join(told)})"


def _is_same(value: Any, default: Any) -> bool:
    """Tell whether a field has its default: a grey is stored as three equal numbers."""
    is_grey = isinstance(value, tuple) and isinstance(default, (int, float)) and not isinstance(default, bool)
    return value == (default,) * len(value) if is_grey else bool(value == default)


def _text(value: Any) -> str:
    """Six digits of each number, one number of a grey, and the beginning of anything else."""
    if isinstance(value, float):
        return f"{value + 0.0:g}"  # no -0
    if type(value) is tuple and value and all(isinstance(each, float) for each in value):
        return f"({', '.join(f'{each + 0.0:g}' for each in value)})"
    return shown(value)
