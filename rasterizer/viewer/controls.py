"""What each event does: to the camera, to the look, or to what is picked."""

from typing import NamedTuple

from ..scene.camera import Camera
from ..scene.scene import Scene
from .events import Click, Drag, Event, Key, Switch, Zoom
from .orbit import Orbit, Size
from .picking import Picked

SHADINGS = ("flat", "gouraud", "phong")
LIGHTS = ("own", "studio", "headlight")  # the scene's own, and the presets of `scene.lights`
PROJECTIONS = ("perspective", "orthographic")
SWITCHES = {"shading": SHADINGS, "lights": LIGHTS, "projection": PROJECTIONS}

_HALF_TURN = 180.0  # degrees that a drag over the height of the picture turns the camera by
_STEP = 5.0  # degrees of a key; with shift it moves by _SHARE of the picture's height
_SHARE = 0.05
_ZOOM_OF_KEY = 1.25
_ZOOM_OF_DRAG = 8.0  # over the height of the picture
# key: azimuth and elevation in degrees, as `--view` has them
_VIEWS = {
    "1": (0.0, 0.0, "front"),
    "2": (180.0, 0.0, "back"),
    "3": (-90.0, 0.0, "left"),
    "4": (90.0, 0.0, "right"),
    "5": (0.0, 90.0, "top"),
    "6": (0.0, -90.0, "bottom"),
    "7": (45.0, 35.264389682754654, "iso"),
}
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
    picked: Picked | None = None
    said: str = ""


class Aim(NamedTuple):
    """What an event asks to be picked: the point under a pixel, and whether the camera is to turn about it."""

    x: float
    y: float
    is_pivot: bool


def home_camera(scene: Scene, size: Size, given: Camera | None = None) -> Camera:
    """Return the camera that a scene is looked at with at first: one that is given, the scene's own, or one that shows
    all of it."""
    return given or scene.camera_for(size)


def apply(event: Event, state: State, scene: Scene, home: Camera, size: Size) -> tuple[State, Aim | None]:
    """Do what an event says.

    Parameters
    ----------
    event : what was done
    state : State before
    scene : Scene that is looked at
    home : Camera of a state that has no orbit
    size : (width, height) of the picture at rest, pixels

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
    return _pressed(state, orbit, scene, event, size), None


def projection_of(state: State, home: Camera) -> str:
    """Return the word for the camera's projection."""
    camera = home if state.orbit is None else state.orbit.lens
    return PROJECTIONS[0 if camera.is_perspective else 1]


def _pressed(state: State, orbit: Orbit, scene: Scene, event: Key, size: Size) -> State:
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
    if key in _VIEWS:
        azimuth, elevation, name = _VIEWS[key]
        camera = _framing(scene, azimuth, elevation, orbit.lens, size)
        return state._replace(orbit=Orbit.of(camera, scene), said=f"view: {name}")
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
    if name == "shading":
        return state._replace(said=said, shading=value)
    return state._replace(said=said, lights=value)


def _framing(scene: Scene, azimuth: float, elevation: float, lens: Camera, size: Size) -> Camera:
    """Return the camera that shows all of a scene from a side."""
    aspect = size[0] / size[1]
    if lens.fov is None:
        return Camera.framing(scene, azimuth, elevation, up=scene.up, orthographic=True, aspect=aspect)
    return Camera.framing(scene, azimuth, elevation, lens.fov, scene.up, aspect=aspect)
