"""What is done on the page: messages are read, and each event changes the state.

In:  a message, as JSON may be        Out: the State after its events, and where something is to be picked

    read_message ─ events ─ apply ─┬─ State: orbit, shading, lights
                                   └─ Aim

    {"size": [800, 600], "background": "#ffffff", "is_rest": false, "events": [{"type": "drag", ...}, ...]}

Positions are in pixels of a picture of that size, from its upper left corner.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

from ..choices import VIEWS
from ..errors import SceneError, shown
from ..picking import Pick
from ..scene.camera import Camera
from ..scene.scene import Scene
from .orbit import Orbit, Size

# ---------------------------------------------------------------- messages: they come from outside, so all is checked

MAX_BYTES = 1 << 16  # of a message
MAX_EVENTS = 256  # of a message; the page sends one a picture, with moves of the same type added up
MAX_SIDE = 8192  # pixels of the picture along a side
MAX_PIXELS = 1 << 25  # in all
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


def read_message(value: object) -> Message:
    """Return a message that came as JSON, checked.

    Parameters
    ----------
    value : whatever JSON may be; a message is an object

    Raises
    ------
    SceneError : what is no message; the text says what is wrong
    """
    fields = _object(value, {"size", "background", "is_rest", "events"}, "a message")
    events = fields["events"]
    if not isinstance(events, list) or len(events) > MAX_EVENTS:
        raise SceneError(f"events must be a list of at most {MAX_EVENTS}; given {shown(events)}")
    background = fields["background"]
    if not isinstance(background, str) or not re.fullmatch(r"#[0-9a-fA-F]{6}", background):
        raise SceneError(f"background must be a colour such as '#ffffff'; given {shown(background)}")
    return Message(
        _size(fields["size"]), background, _flag(fields["is_rest"], "is_rest"), tuple(map(_read_event, events))
    )


def _read_event(value: object) -> Event:
    """Return one event; its type says which fields it has."""
    name = value.get("type") if isinstance(value, dict) else None
    if not isinstance(name, str) or name not in _EVENTS:
        raise SceneError(f"an event's type must be one of {', '.join(_EVENTS)}; given {shown(name)}")
    make, readers = _EVENTS[name]
    fields = _object(value, {"type", *readers}, f"an event {name!r}")
    return make(*(read(fields[field], field) for field, read in readers.items()))


def _object(value: object, names: set[str], what: str) -> dict[str, Any]:
    """Return an object that has these fields and no others."""
    if not isinstance(value, dict) or value.keys() != names:
        found = sorted(map(str, value)) if isinstance(value, dict) else value
        raise SceneError(f"{what} is an object of {', '.join(sorted(names))}; given {shown(found)}")
    return value


def _size(value: object) -> tuple[int, int]:
    """Return a size that a picture on a screen may have."""
    if isinstance(value, list) and len(value) == 2 and all(type(side) is int for side in value):
        width, height = value
        if 1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE and width * height <= MAX_PIXELS:
            return width, height
    legal = f"[width, height], each 1 to {MAX_SIDE} px, and {MAX_PIXELS} px in all"
    raise SceneError(f"size must be {legal}; given {shown(value)}")


def _number(value: object, name: str) -> float:
    """Return a number that a hand can have caused."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= _FURTHEST:  # NaN isn't
        raise SceneError(f"{name} must be a number within -{_FURTHEST:g}..{_FURTHEST:g}; given {shown(value)}")
    return float(value)


def _flag(value: object, name: str) -> bool:
    if not isinstance(value, bool):
        raise SceneError(f"{name} must be true or false; given {shown(value)}")
    return value


def _text(value: object, name: str) -> str:
    if not isinstance(value, str) or len(value) > 40:
        raise SceneError(f"{name} must be text of at most 40 characters; given {shown(value)}")
    return value


def _action(value: object, _: str) -> str:
    if value not in DRAGS:
        raise SceneError(f"a drag's action must be one of {', '.join(DRAGS)}; given {shown(value)}")
    return str(value)


def _factor(value: object, name: str) -> float:
    factor = _number(value, name)
    if not 0.01 <= factor <= 100.0:
        raise SceneError(f"a zoom's factor must be within 0.01..100; given {shown(factor)}")
    return factor


# An event's type as JSON has it: its class, and how each of its fields is read.
_EVENTS: dict[str, tuple[Callable[..., Event], dict[str, Callable[[object, str], Any]]]] = {
    "drag": (Drag, {"action": _action, "dx": _number, "dy": _number}),
    "zoom": (Zoom, {"factor": _factor, "x": _number, "y": _number}),
    "key": (Key, {"key": _text, "is_shift": _flag}),
    "click": (Click, {"x": _number, "y": _number, "is_double": _flag}),
    "switch": (Switch, {"name": _text, "value": _text}),
}


# ---------------------------------------------------------------- what each event does

SHADINGS = ("flat", "gouraud", "phong")
LIGHTS = ("own", "studio", "headlight")  # the scene's own, and the presets of `scene.lights`
PROJECTIONS = ("perspective", "orthographic")
SWITCHES = {"shading": SHADINGS, "lights": LIGHTS, "projection": PROJECTIONS}

_HALF_TURN = 180.0  # degrees that a drag over the height of the picture turns the camera by
_STEP = 5.0  # degrees of a key; with shift it moves by _SHARE of the picture's height
_SHARE = 0.05
_ZOOM_OF_KEY = 1.25
_ZOOM_OF_DRAG = 8.0  # over the height of the picture
_VIEW_KEYS = {"1": "front", "2": "back", "3": "left", "4": "right", "5": "top", "6": "bottom", "7": "iso"}
_ARROWS = {"ArrowLeft": (-1, 0), "ArrowRight": (1, 0), "ArrowUp": (0, 1), "ArrowDown": (0, -1)}
_ZOOM_KEYS = {"+": _ZOOM_OF_KEY, "=": _ZOOM_OF_KEY, "-": 1.0 / _ZOOM_OF_KEY, "_": 1.0 / _ZOOM_OF_KEY}


class State(NamedTuple):
    """What is looked at, and how.

    `orbit` : Orbit, or None where the scene is looked at as it was at first; `shading`, `lights` : out of SWITCHES;
    `picked` : the point that was picked last; `said` : what an event has done, in words, for those who don't see it
    """

    orbit: Orbit | None
    shading: str
    lights: str
    picked: Pick | None = None
    said: str = ""


class Aim(NamedTuple):
    """What an event asks to be picked: the point under a pixel, and whether the camera is to turn about it."""

    x: float
    y: float
    is_pivot: bool


def apply(
    event: Event, state: State, scene: Scene, home: Camera, size: Size, subject: Callable[[], Any] | None = None
) -> tuple[State, Aim | None]:
    """Do what an event says.

    Parameters
    ----------
    event : what was done
    state : State before
    scene : Scene that is looked at
    home : Camera of a state that has no orbit
    size : (width, height) of the picture at rest, pixels
    subject : that of `Viewpoint.camera_of`, for named views

    Returns
    -------
    the State after, and what is to be picked if anything is; keys and switches without meaning do nothing
    """
    state = state._replace(said="")
    orbit = state.orbit or Orbit.of(home, scene)
    height = size[1]
    if isinstance(event, Drag):
        if event.action == "pan":
            return state._replace(orbit=orbit.panned(event.dx, event.dy, size)), None
        if event.action == "zoom":
            factor = _ZOOM_OF_DRAG ** max(-4.0, min(4.0, -event.dy / height))
            return state._replace(orbit=orbit.zoomed(factor, size[0] / 2, height / 2, size)), None
        turn = _HALF_TURN / height
        return state._replace(orbit=orbit.turned(-event.dx * turn, event.dy * turn)), None
    if isinstance(event, Zoom):
        return state._replace(orbit=orbit.zoomed(event.factor, event.x, event.y, size)), None
    if isinstance(event, Click):
        return state, Aim(event.x, event.y, event.is_double)
    if isinstance(event, Switch):
        return _switched(state, orbit, event.name, event.value), None
    if event.key in ("Enter", " "):
        return state, Aim(size[0] / 2, height / 2, event.is_shift)
    return _pressed(state, orbit, scene, event, size, subject), None


def describe_pick(pick: Pick) -> str:
    """Say in a line what was picked."""
    whose = f"object {pick.object_name!r}" if pick.object_name else f"object {pick.object}"
    x, y, z = (f"{value:.6g}" for value in pick.position)
    normal = ", ".join(f"{value:.3f}" for value in pick.normal)
    return f"face {pick.object_face} of {whose}, position ({x}, {y}, {z}), normal ({normal})"


def projection_of(state: State, home: Camera) -> str:
    """Return the word for the camera's projection."""
    camera = home if state.orbit is None else state.orbit.lens
    return PROJECTIONS[0 if camera.is_perspective else 1]


def _pressed(
    state: State, orbit: Orbit, scene: Scene, event: Key, size: Size, subject: Callable[[], Any] | None
) -> State:
    """Do what a key says, if it says anything."""
    key, height = event.key, size[1]
    if key in _ARROWS:
        across, upwards = _ARROWS[key]
        if event.is_shift:
            moved = orbit.panned(-across * _SHARE * height, upwards * _SHARE * height, size)
        else:
            moved = orbit.turned(across * _STEP, upwards * _STEP)
        return state._replace(orbit=moved)
    if key in _ZOOM_KEYS:
        return state._replace(orbit=orbit.zoomed(_ZOOM_KEYS[key], size[0] / 2, height / 2, size))
    if key in _VIEW_KEYS:
        name = _VIEW_KEYS[key]
        camera = _framing(scene, *VIEWS[name], orbit.lens, size, subject)
        return state._replace(orbit=replace(Orbit.of(camera, scene), former=orbit.former), said=f"view: {name}")
    if key in ("0", "Home"):
        return state._replace(orbit=None, said="view: as at first")
    if key == "Escape":
        return state._replace(picked=None, said="nothing is picked" if state.picked else "")
    if key in ("s", "l", "o"):
        name = {"s": "shading", "l": "lights", "o": "projection"}[key]
        words = SWITCHES[name]
        now = {"s": state.shading, "l": state.lights, "o": PROJECTIONS[0 if orbit.lens.is_perspective else 1]}[key]
        return _switched(state, orbit, name, words[(words.index(now) + 1) % len(words)])
    return state


def _switched(state: State, orbit: Orbit, name: str, value: str) -> State:
    """Choose one of SWITCHES; what is not in the list does nothing."""
    if value not in SWITCHES.get(name, ()):
        return state
    said = f"{name}: {value}"
    if name == "projection":
        is_other = orbit.lens.is_perspective != (value == PROJECTIONS[0])
        return state._replace(orbit=orbit.with_other_projection() if is_other else state.orbit, said=said)
    return state._replace(said=said, **{name: value})  # type: ignore[arg-type]  # shading or lights


def _framing(
    scene: Scene, azimuth: float, elevation: float, lens: Camera, size: Size, subject: Callable[[], Any] | None
) -> Camera:
    """Return the camera that shows all of a scene from a side."""
    framed = scene if subject is None else subject()
    of_lens: dict[str, Any] = {"orthographic": True} if lens.fov is None else {"fov": lens.fov}
    return Camera.framing(framed, azimuth, elevation, up=scene.up, aspect=size[0] / size[1], **of_lens)
