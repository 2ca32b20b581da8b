"""Messages of the page: what was done since the last one. They come from outside, so all of them is checked.

    {"size": [800, 600], "background": "#ffffff", "is_rest": false, "events": [{"kind": "drag", ...}, ...]}

All positions are in pixels of a picture of that size, from its upper left corner.
"""

import re
from typing import Any, NamedTuple, TypeAlias

from ..errors import SceneError, shown

MOST_BYTES = 1 << 16  # of a message
MOST_EVENTS = 256  # of a message; the page sends one a picture, with moves of the same kind added up
MOST_SIDE = 8192  # pixels of the picture along a side
MOST_PIXELS = 1 << 25  # in all
_FURTHEST = 1e6  # pixels or steps of a wheel: more than a hand can do between two pictures

DRAGS = ("rotate", "pan", "zoom")


class Drag(NamedTuple):
    """The pointer was moved with a button down: pixels to the right and downwards."""

    action: str
    dx: float
    dy: float


class Zoom(NamedTuple):
    """The wheel was turned, or two fingers were spread: enlarged `factor` times about a point."""

    factor: float
    x: float
    y: float


class Key(NamedTuple):
    """A key was pressed, by the name that browsers have for it."""

    key: str
    is_shift: bool


class Click(NamedTuple):
    """A point of the picture was clicked, once or twice."""

    x: float
    y: float
    is_double: bool


class Switch(NamedTuple):
    """Something was chosen from a list."""

    name: str
    value: str


Event: TypeAlias = Drag | Zoom | Key | Click | Switch


class Message(NamedTuple):
    """What the page wants.

    `size` : (width, height) of the picture at rest, pixels; `background` : "#rrggbb", the page's own; `is_rest` :
    whether nothing moves, so that the picture shall be as good as it gets
    """

    size: tuple[int, int]
    background: str
    is_rest: bool
    events: tuple[Event, ...]


def read_message(given: object) -> Message:
    """Return a message that came as JSON, checked.

    Parameters
    ----------
    given : whatever JSON may be; a message is an object

    Raises
    ------
    SceneError : what is no message; the text says what is wrong
    """
    fields = _object(given, {"size", "background", "is_rest", "events"}, "a message")
    events = fields["events"]
    if not isinstance(events, list) or len(events) > MOST_EVENTS:
        raise SceneError(f"events must be a list of at most {MOST_EVENTS}; given {shown(events)}")
    background = fields["background"]
    if not isinstance(background, str) or not re.fullmatch(r"#[0-9a-fA-F]{6}", background):
        raise SceneError(f"background must be a colour such as '#ffffff'; given {shown(background)}")
    return Message(
        _size(fields["size"]), background, _flag(fields["is_rest"], "is_rest"), tuple(map(_read_event, events))
    )


def _read_event(given: object) -> Event:
    """Return one event; its kind says which fields it has."""
    kind = given.get("kind") if isinstance(given, dict) else None
    if not isinstance(kind, str) or kind not in _READERS:
        raise SceneError(f"an event's kind must be one of {', '.join(_READERS)}; given {shown(kind)}")
    names, read = _READERS[kind]
    return read(_object(given, {"kind", *names}, f"an event {kind!r}"))


def _read_drag(fields: dict[str, Any]) -> Drag:
    if fields["action"] not in DRAGS:
        raise SceneError(f"a drag's action must be one of {', '.join(DRAGS)}; given {shown(fields['action'])}")
    return Drag(fields["action"], _number(fields["dx"], "dx"), _number(fields["dy"], "dy"))


def _read_zoom(fields: dict[str, Any]) -> Zoom:
    factor = _number(fields["factor"], "factor")
    if not 0.01 <= factor <= 100.0:
        raise SceneError(f"a zoom's factor must be within 0.01..100; given {shown(factor)}")
    return Zoom(factor, _number(fields["x"], "x"), _number(fields["y"], "y"))


def _read_click(fields: dict[str, Any]) -> Click:
    is_double = _flag(fields["is_double"], "is_double")
    return Click(_number(fields["x"], "x"), _number(fields["y"], "y"), is_double)


_READERS: dict[str, tuple[tuple[str, ...], Any]] = {
    "drag": (("action", "dx", "dy"), _read_drag),
    "zoom": (("factor", "x", "y"), _read_zoom),
    "key": (("key", "is_shift"), lambda f: Key(_text(f["key"], "key"), _flag(f["is_shift"], "is_shift"))),
    "click": (("x", "y", "is_double"), _read_click),
    "switch": (("name", "value"), lambda f: Switch(_text(f["name"], "name"), _text(f["value"], "value"))),
}


def _object(given: object, names: set[str], what: str) -> dict[str, Any]:
    """Return an object that has these fields and no others."""
    if not isinstance(given, dict) or given.keys() != names:
        found = sorted(map(str, given)) if isinstance(given, dict) else given
        raise SceneError(f"{what} is an object of {', '.join(sorted(names))}; given {shown(found)}")
    return given


def _size(given: object) -> tuple[int, int]:
    """Return a size that a picture on a screen may have."""
    if isinstance(given, list) and len(given) == 2 and all(type(side) is int for side in given):
        width, height = given
        if 1 <= width <= MOST_SIDE and 1 <= height <= MOST_SIDE and width * height <= MOST_PIXELS:
            return width, height
    legal = f"[width, height], each 1 to {MOST_SIDE} px, and {MOST_PIXELS} px in all"
    raise SceneError(f"size must be {legal}; given {shown(given)}")


def _number(given: object, name: str) -> float:
    """Return a number that a hand can have caused."""
    if isinstance(given, bool) or not isinstance(given, (int, float)) or not abs(given) <= _FURTHEST:  # NaN isn't
        raise SceneError(f"{name} must be a number within -{_FURTHEST:g}..{_FURTHEST:g}; given {shown(given)}")
    return float(given)


def _flag(given: object, name: str) -> bool:
    if not isinstance(given, bool):
        raise SceneError(f"{name} must be true or false; given {shown(given)}")
    return given


def _text(given: object, name: str) -> str:
    if not isinstance(given, str) or len(given) > 40:
        raise SceneError(f"{name} must be text of at most 40 characters; given {shown(given)}")
    return given
