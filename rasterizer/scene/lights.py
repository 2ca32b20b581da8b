"""Lights: ambient, directional, point, spot and area lights, and three ready-made sets that move with the camera.

A light is attached to the world or to the camera. Attached to the camera, its direction and position are given in the
camera's frame (x right, y up, the camera looks down -z), so the light goes where the camera goes.

Conventions: a direction is the one in which the light travels; intensities are linear, per channel, never negative.

The command line and scene files read and write lights by what their fields are annotated with, see `describe_fields`:
a light that is added needs no code there.
"""

import math
import re
import types
from collections.abc import Callable, Iterable, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass, replace
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias, Union, get_args, get_origin, get_type_hints

from ..choices import ATTACHMENTS, AXES, Attachment, Axis
from ..errors import SceneError, shown
from ..keywords import checked_keywords
from ..vectors import dot
from .arrays import VectorLike
from .color import ColorLike, linear_rgb
from .framing import orbit_axes
from .plugins import find_plugin
from .random_numbers import LIGHTS, checked_range, elevation_at, uniform_numbers, within
from .validate import choice, flag, is_whole, items_of, number, position3, store, unit3, value_class, vector3, whole

MAX_LIGHTS = 16384  # of a scene; the cells of area lights count one by one, as their time does
_MAX_SHADOWED = 4096  # of them cast shadows: each is a picture or six
_MAX_CELLS = 64  # of an area light, along each edge
_MAX_TEXELS = 8192  # along a side of a shadow map
_MAX_RANDOM = 100  # lights of `random_lights`
_MAX_TAPS = 9  # along a side of its filter

# What a light may be given. Once checked it is stored as three floats, as two ints, as linear RGB or a Spectrum, and as
# three floats (kc, kl, kq).
Vector: TypeAlias = Annotated[VectorLike, "vector"]
Cells: TypeAlias = Annotated[Sequence[int], "cells"]  # numbers of cells along two edges
Color: TypeAlias = Annotated[ColorLike, "color"]
Attenuation: TypeAlias = Annotated[str | VectorLike, "attenuation"]


@value_class
@dataclass(frozen=True)
class Shadow:
    """How a light casts shadows: by shadow maps (Williams 1978), depths of the scene as the light sees it.

    Parameters
    ----------
    size : texels along each side of the map, 16 to 8192. A directional light has one map of the scene, and where a
        picture shows a part of it up to five more, of what the picture shows at growing distances; a light with a place
        has one if the scene, or its cone, fits into a view of 63 degrees to each side, else six. The cells
        of an area light have maps of half the size, but at least 16
    filter : side of the square of texels whose comparisons are averaged (percentage-closer filtering, Reeves, Salesin &
        Cook 1987): an odd number, 1 (hard edges) to 9

    Raises
    ------
    SceneError : a value that is not legal
    """

    size: int = 1024
    filter: int = 1

    def __post_init__(self) -> None:
        if not (is_whole(self.filter, 1, _MAX_TAPS) and self.filter % 2 == 1):
            legal = f"an odd number within 1..{_MAX_TAPS}"
            raise SceneError(f"the shadow's filter must be {legal}; given {shown(self.filter)}")
        store(self, size=whole(self.size, "the shadow's size", 16, _MAX_TEXELS), filter=int(self.filter))


@value_class
@dataclass(frozen=True)
class AmbientLight:
    """Light a surface evenly from all sides.

    Parameters
    ----------
    color : intensity Ia, linear: a number, three numbers, hex or CSS text, or a Spectrum

    Raises
    ------
    SceneError : a colour that is not legal
    """

    color: Color = 1.0

    def __post_init__(self) -> None:
        store(self, color=linear_rgb(self.color, "the ambient light's color"))


@value_class
@dataclass(frozen=True)
class DirectionalLight:
    """Light with parallel rays, from infinitely far away; it never gets weaker.

    Parameters
    ----------
    direction : three numbers, the direction in which the light travels; any length, stored as a unit vector
    color : intensity Ip, linear: a number, three numbers, hex or CSS text, or a Spectrum
    attached : "world", or "camera" where `direction` is given in the camera's frame
    shadow : Shadow, or True for the default one; None = the light casts no shadows, unless all lights shall
        (`render(shadows=True)`); False = not even then

    Raises
    ------
    SceneError : a direction without length or not finite, a colour or attachment that is not legal
    """

    direction: Vector
    color: Color = 1.0
    attached: Attachment = "world"
    shadow: Shadow | bool | None = None

    def __post_init__(self) -> None:
        choice(self.attached, ATTACHMENTS, "the directional light's attached")
        store(
            self,
            direction=unit3(self.direction, "the directional light's direction"),
            color=linear_rgb(self.color, "the directional light's color"),
            shadow=checked_shadow(self.shadow, "the directional light's"),
        )


@value_class
@dataclass(frozen=True)
class PointLight:
    """Light that shines from one point to all sides, and may get weaker with the distance d.

    The intensity at distance d is `color` times min(1, 1 / (kc + kl d + kq d²)); with `amplify` the minimum
    is left out, so that a surface nearer than the unit distance gets more than `color`.

    Parameters
    ----------
    position : three numbers, scene units
    color : intensity Ip, linear: a number, three numbers, hex or CSS text, or a Spectrum
    attenuation : (kc, kl, kq), finite, at least 0, not all 0, or text: "1" = (1, 0, 0), no fall-off;
        "1/d" = (0, 1, 0); "1/(d+3)" = (3, 1, 0); "1/d^2" = (0, 0, 1), inverse square
    attached : "world", or "camera" where `position` is given in the camera's frame
    amplify : whether the attenuation may exceed 1
    range : scene units, above 0, or None: the intensity is multiplied by max(0, 1 - (d/range)^4), as glTF's
        KHR_lights_punctual recommends, so that nothing beyond is lit
    shadow : Shadow, or True for the default one; None = the light casts no shadows, unless all lights shall
        (`render(shadows=True)`); False = not even then

    Raises
    ------
    SceneError : a value that is not legal; the message names the light and the field
    """

    position: Vector
    color: Color = 1.0
    attenuation: Attenuation = (1.0, 0.0, 0.0)
    attached: Attachment = "world"
    amplify: bool = False
    range: float | None = None
    shadow: Shadow | bool | None = None

    def __post_init__(self) -> None:
        store(self, position=position3(self.position, "the point light's position"))
        _check_positional(self, "the point light's")


@value_class
@dataclass(frozen=True)
class SpotLight:
    """Light that shines from one point into a cone.

    At the angle a from the axis the intensity of a point light is multiplied by (cos a)^exponent, and between
    the two cones by (t² (3 - 2 t))^falloff with t = (cos a - cos outer) / (cos inner - cos outer): 1 inside the inner
    cone, falling to 0 at the outer one. Where both angles are equal the edge is sharp.

    Whatever `falloff` is, the light starts to fall smoothly at the inner cone, because t² (3 - 2 t) has no slope at
    t = 1. Next to the outer one it goes as t^(2 falloff): smoothly above 1/2, in a straight line for 1/2, and below
    that with a steep edge. So 1 is the usual smooth step, 2 and more draw the light together in the middle, 1/4
    fills the outer cone nearly to its border.

    Parameters
    ----------
    position : three numbers, scene units
    direction : three numbers, the direction in which the light travels; any length, stored as a unit vector
    color : intensity Ip, linear: a number, three numbers, hex or CSS text, or a Spectrum
    inner, outer : degrees from the axis, 0 <= inner <= outer, 0 < outer <= 90; inner None = four fifths of
        `outer`
    exponent : number, at least 0; 0 = even within the inner cone
    attenuation, attached, amplify, range, shadow : as for PointLight; `attached` holds for position and direction
    falloff : number above 0, the exponent of the fall between the two cones

    Raises
    ------
    SceneError : a value that is not legal; the message names the light and the field
    """

    position: Vector
    direction: Vector
    color: Color = 1.0
    inner: float | None = None
    outer: float = 30.0
    exponent: float = 0.0
    attenuation: Attenuation = (1.0, 0.0, 0.0)
    attached: Attachment = "world"
    amplify: bool = False
    range: float | None = None
    shadow: Shadow | bool | None = None
    falloff: float = 1.0

    def __post_init__(self) -> None:
        outer = number(self.outer, "the spot light's outer angle", above=0, high=90, unit=" degrees")
        inner = 0.8 * outer if self.inner is None else self.inner
        store(
            self,
            position=position3(self.position, "the spot light's position"),
            direction=unit3(self.direction, "the spot light's direction"),
            inner=number(inner, "the spot light's inner angle", low=0, high=outer, unit=" degrees, the outer one"),
            outer=outer,
            exponent=number(self.exponent, "the spot light's exponent", low=0),
            falloff=number(self.falloff, "the spot light's falloff", above=0),
        )
        _check_positional(self, "the spot light's")


@value_class
@dataclass(frozen=True)
class AreaLight:
    """Light from a parallelogram: m·n point lights at the centres of its cells, each with 1/(m·n) of the
    intensity. It shines to both sides, without the cosine of a real emitter.

    Parameters
    ----------
    corner : three numbers, scene units
    edge_u, edge_v : three numbers each, scene units, from the corner along two sides; not parallel
    color : intensity Ip of the whole light, linear: a number, three numbers, hex or CSS text, or a Spectrum
    resolution : (m, n), cells along edge_u and edge_v, from 1 to 64 each
    attenuation, attached, amplify, range, shadow : as for PointLight, for each cell; `attached` holds for corner and
        edges

    Raises
    ------
    SceneError : a value that is not legal; the message names the light and the field
    """

    corner: Vector
    edge_u: Vector
    edge_v: Vector
    color: Color = 1.0
    resolution: Cells = (4, 4)
    attenuation: Attenuation = (1.0, 0.0, 0.0)
    attached: Attachment = "world"
    amplify: bool = False
    range: float | None = None
    shadow: Shadow | bool | None = None

    def __post_init__(self) -> None:
        for field in ("corner", "edge_u", "edge_v"):
            store(self, **{field: position3(getattr(self, field), f"the area light's {field}")})
        for ends in ((0, 1), (1, 0), (1, 1)):
            end = [c + ends[0] * u + ends[1] * v for c, u, v in zip(self.corner, self.edge_u, self.edge_v, strict=True)]
            position3(end, "each corner of the area light")
        u, v = unit3(self.edge_u, "the area light's edge_u"), unit3(self.edge_v, "the area light's edge_v")
        # Unit vectors whose cosine is 1 to float64 rounding are parallel.
        if abs(dot(u, v)) >= 1.0 - 1e-15:
            both = f"{shown(self.edge_u)} and {shown(self.edge_v)}"
            raise SceneError(f"the area light's edge_u and edge_v must not be parallel; given {both}")
        cells = items_of(self.resolution)
        if len(cells) != 2 or not all(is_whole(n, 1, _MAX_CELLS) for n in cells):
            legal = f"two whole numbers from 1 to {_MAX_CELLS}"
            raise SceneError(f"the area light's resolution must be {legal}; given {shown(self.resolution)}")
        store(self, resolution=(int(cells[0]), int(cells[1])))
        _check_positional(self, "the area light's")

    @property
    def n_cell(self) -> int:
        """How many point lights this light is made of."""
        return math.prod(self.resolution)

    def cells(self) -> tuple[PointLight, ...]:
        """Return the point lights that this light is made of, row after row."""
        m, n = self.resolution
        share = 1.0 / (m * n)
        stored: Any = self.color
        color = stored.scaled(share) if hasattr(stored, "scaled") else tuple(component * share for component in stored)
        # Where the edges of many shadows are averaged, half of the texels are enough for each.
        shadow = self.shadow
        if isinstance(shadow, Shadow):
            shadow = replace(shadow, size=max(16, shadow.size // 2))
        steps = [((i + 0.5) / m, (j + 0.5) / n) for j in range(n) for i in range(m)]
        return tuple(
            PointLight(
                tuple(c + s * u + t * v for c, u, v in zip(self.corner, self.edge_u, self.edge_v, strict=True)),
                color, self.attenuation, self.attached, self.amplify, self.range, shadow,
            )
            for s, t in steps
        )  # fmt: skip


Light: TypeAlias = AmbientLight | DirectionalLight | PointLight | SpotLight | AreaLight  # the built-in ones

# Every type of light that a scene may have, by the word for it in scene files and on the command line. What the engine,
# the reference and the Mach bands know of it stands in tables by the same words; `rasterizer.registries` enters a type
# in all of them.
LIGHT_TYPES: dict[str, Any] = {
    "ambient": AmbientLight,
    "directional": DirectionalLight,
    "point": PointLight,
    "spot": SpotLight,
    "area": AreaLight,
}


def class_of_light(word: object) -> Any:
    """Return the class of a type of light by the word for it, also where that is a plug-in's; SceneError for another
    word."""
    find_plugin(word, LIGHT_TYPES)
    return LIGHT_TYPES[choice(word, LIGHT_TYPES, "kind")]


def light_type_of(light: Any) -> str:
    """Return the word for a light's type: that of its very class, because a subclass may give another light.

    Raises
    ------
    SceneError : a class that is in no row of LIGHT_TYPES; the message lists those that are
    """
    for word, cls in LIGHT_TYPES.items():
        if type(light) is cls:
            return word
    raise SceneError(f"a light must be one of {_legal_lights()}; given {shown(light)}")


def checked_lights(lights: Any) -> tuple[Any, ...]:
    """Return one light or a sequence of them as a tuple.

    Raises
    ------
    SceneError : no light, or one whose type is unknown; the message lists those that are known. Or more lights than
        MAX_LIGHTS, or more that cast shadows than _MAX_SHADOWED
    """
    if type(lights) in LIGHT_TYPES.values() or isinstance(lights, str):
        lights = (lights,)
    try:
        lights = tuple(lights)
    except TypeError:
        lights = (lights,)
    for i, light in enumerate(lights):
        if type(light) not in LIGHT_TYPES.values():
            ready = "; ready-made ones are made by studio(), headlight() and tabletop()" * isinstance(light, str)
            raise SceneError(f"lights must be of {_legal_lights()}; given {shown(light)} at {i}{ready}")
    counts = [getattr(light, "n_cell", 1) for light in lights]
    shadowed = [count for count, light in zip(counts, lights, strict=True) if getattr(light, "shadow", None)]
    for n, limit, which in (
        (sum(counts), MAX_LIGHTS, "lights"), (sum(shadowed), _MAX_SHADOWED, "lights that cast shadows"),
    ):  # fmt: skip
        if n > limit:
            legal = f"{limit} {which} at most, the cells of area lights counted one by one"
            hint = "choose fewer, or a smaller resolution of area lights"
            raise SceneError(f"a scene may have {legal}; given {n}: {hint}")
    return lights


def _legal_lights() -> str:
    """List the classes of lights that are known."""
    return ", ".join(cls.__name__ for cls in LIGHT_TYPES.values())


# --- ready-made lights: neutral, attached to the camera, so that every view of a model is lit alike ----------


def studio() -> tuple[Light, ...]:
    """Return the default lights: key from the upper left, weaker fill from the right, rim from behind and
    above, low ambient.

    They move with the camera and are exactly neutral, so that a grey scene needs one channel. The intensities
    are chosen so that the default material stays below 1 whichever way a surface faces, highlight included.
    """
    return (
        AmbientLight(0.08),
        DirectionalLight((0.55, -0.65, -0.75), 0.85, "camera"),
        DirectionalLight((-0.85, -0.10, -0.50), 0.20, "camera"),
        DirectionalLight((0.15, -0.70, 0.70), 0.30, "camera"),
    )


def headlight() -> tuple[Light, ...]:
    """Return one directional light along the view and a low ambient, both neutral: nothing seen is dark."""
    return (AmbientLight(0.15), DirectionalLight((0.0, 0.0, -1.0), 0.80, "camera"))


def tabletop() -> tuple[Light, ...]:
    """Return the lights of `studio`, brighter for darker materials, with a key that casts shadows."""
    return (
        AmbientLight(0.08),
        DirectionalLight((0.55, -0.65, -0.75), 0.95, "camera", shadow=Shadow(1024, 5)),
        DirectionalLight((-0.85, -0.10, -0.50), 0.20, "camera"),
        DirectionalLight((0.15, -0.70, 0.70), 0.35, "camera"),
    )


@checked_keywords
def random_lights(
    seed: int = 0,
    *,
    n: int | Sequence[int] = (1, 3),
    elevation: float | Sequence[float] = (0.0, 90.0),
    intensity: float | Sequence[float] = (0.3, 0.8),
    ambient: float | Sequence[float] = (0.05, 0.2),
    up: Axis = "y",
    shadow: Shadow | bool | None = None,
    fill: float | Sequence[float] = (0.3, 0.5),
) -> tuple[Light, ...]:
    """Return an ambient and some directional lights, neutral and attached to the world, from random sides; and one that
    is attached to the camera, so that no side that is seen is dark. The same for a seed.

    Parameters
    ----------
    seed : whole number, at least 0
    n : how many directional lights, 0 to 100; here, and below, a number or the ends of a range, from which one is taken
        at random, evenly
    elevation : degrees above the horizon from which each shines; equal areas of the sky have equally many
    intensity : of each, linear
    ambient : intensity of the ambient light, linear
    up : the axis that points upwards in the scene
    shadow : of each, as in `DirectionalLight`
    fill : intensity of the light that is attached to the camera: it shines from a random side within 45 degrees of the
        viewer, and casts no shadow; 0 = there is none

    Raises
    ------
    SceneError : a value that is not legal
    """
    low, high = (int(end) for end in checked_range(n, "n", 0, _MAX_RANDOM))
    elevations = checked_range(elevation, "elevation", -90, 90)
    intensities, ambients = checked_range(intensity, "intensity", 0, 1e6), checked_range(ambient, "ambient", 0, 1e6)
    fills = checked_range(fill, "fill", 0, 1e6)
    choice(up, AXES, "up")
    first, second, *numbers = uniform_numbers(seed, LIGHTS, 5 + 3 * _MAX_RANDOM)
    found: list[Light] = [AmbientLight(within(ambients, first))]
    for k in range(low + int(second * (high - low + 1))):
        around, above, strength = numbers[3 * k : 3 * k + 3]
        forward = orbit_axes(360.0 * around, elevation_at(elevations, above), up)[2]
        found.append(DirectionalLight(forward, within(intensities, strength), shadow=shadow))
    around, above, strength = numbers[-3:]
    if fills[1] > 0.0:  # the viewer is where the camera's z points to
        forward = orbit_axes(360.0 * around, elevation_at((45.0, 90.0), above), "z")[2]
        found.append(DirectionalLight(forward, within(fills, strength), "camera"))
    return tuple(found)


def on_tabletop(lights: tuple[Light, ...], takes_shadows: bool) -> tuple[Light, ...]:
    """Return the lights of `tabletop` in place of those of `studio`, the default; others as they are.

    Without `takes_shadows` the key light casts none.
    """
    if lights != studio():
        return lights
    return tabletop() if takes_shadows else without_shadows(tabletop())


PRESETS = {"studio": studio, "headlight": headlight, "tabletop": tabletop}


def with_shadows(lights: Iterable[Any], change: Callable[[Any], Any]) -> tuple[Any, ...]:
    """Return lights with what `change` makes of the field `shadow` of each that has one."""
    return tuple(replace(light, shadow=change(light.shadow)) if hasattr(light, "shadow") else light for light in lights)


def without_shadows(lights: Iterable[Any]) -> tuple[Any, ...]:
    """Return lights that cast no shadows."""
    return with_shadows(lights, lambda _: None)


# --- what may be written into a light ------------------------------------------------------------------------


_PLAIN = {float: "number", int: "whole", bool: "flag", str: "text"}


class Field(NamedTuple):
    """One field of a dataclass."""

    holds: str  # "number", "whole", "flag", "text", "word", "vector", "cells", "color", "attenuation" or "shadow"
    is_needed: bool  # it has no default
    words: tuple[str, ...] = ()  # the legal ones of a "word"


def describe_fields(cls: type) -> dict[str, Field]:
    """Describe the fields of a dataclass, in their order.

    What a field holds is said by its annotation: float ("number"), int ("whole"), bool ("flag"), str ("text"), a
    Literal of words ("word"), `Vector`, `Cells`, `Color`, `Attenuation`, or a dataclass such as `Shadow` (its name in
    small letters). `T | None` holds what T does; so does `Shadow | bool | None`.

    Parameters
    ----------
    cls : a dataclass

    Returns
    -------
    dict of the field's name to Field

    Raises
    ------
    TypeError : no dataclass, or an annotation that is none of these
    """
    if not (isinstance(cls, type) and is_dataclass(cls)):
        raise TypeError(f"a dataclass is needed; given {cls!r}")
    hints = get_type_hints(cls, include_extras=True)
    described = {}
    for field in fields(cls):
        annotation = hints[field.name]
        if get_origin(annotation) in (Union, types.UnionType):  # T | None, or T | bool | None
            members = [member for member in get_args(annotation) if member is not type(None)]
            members = [member for member in members if member is not bool] or members
            annotation = members[0] if len(members) == 1 else annotation
        holds, words = _PLAIN.get(annotation), ()
        if get_origin(annotation) is Annotated:
            holds = next((word for word in annotation.__metadata__ if isinstance(word, str)), None)
        elif get_origin(annotation) is Literal:
            holds, words = "word", get_args(annotation)
        elif isinstance(annotation, type) and is_dataclass(annotation):
            holds = annotation.__name__.lower()
        if holds is None:
            legal = "float, int, bool, str, a Literal, Vector, Cells, Color, Attenuation or a dataclass"
            raise TypeError(f"{cls.__name__}.{field.name} must be annotated with {legal}; given {annotation!r}")
        is_needed = field.default is MISSING and field.default_factory is MISSING
        described[field.name] = Field(holds, is_needed, words)
    return described


# --- checks --------------------------------------------------------------------------------------------------


def checked_shadow(shadow: Any, whose: str) -> Shadow | Literal[False] | None:
    """Return what a light's field `shadow` is stored as: a Shadow; None for a light that casts none unless all shall,
    False for one that never does.

    Parameters
    ----------
    shadow : Shadow, True, False or None
    whose : text, the light's name in messages, such as "the point light's"

    Raises
    ------
    SceneError : anything else
    """
    if not (shadow is None or isinstance(shadow, (bool, Shadow))):
        raise SceneError(f"{whose} shadow must be a Shadow, True, False or None; given {shown(shadow)}")
    return Shadow() if shadow is True else shadow


def _check_positional(light: Any, whose: str) -> None:
    """Check and set what all lights with a place have: colour, attenuation, attachment, range."""
    store(light, color=linear_rgb(light.color, f"{whose} color"), attenuation=_attenuation(light.attenuation, whose))
    choice(light.attached, ATTACHMENTS, f"{whose} attached")
    store(light, amplify=flag(light.amplify, f"{whose} amplify"), shadow=checked_shadow(light.shadow, whose))
    if light.range is not None:
        store(light, range=number(light.range, f"{whose} range", above=0, unit=", or None"))


def _attenuation(value: Any, whose: str) -> tuple[float, float, float]:
    """The coefficients of an attenuation, which may be written as text."""
    what = f"{whose} attenuation (kc, kl, kq)"
    if isinstance(value, str):
        text = value.replace(" ", "").replace("²", "^2").replace("**", "^")
        shifted: Any = re.fullmatch(r"1/\(d\+([\d.eE+-]+)\)", text)
        try:
            known = {"1": (1.0, 0.0, 0.0), "1/d": (0.0, 1.0, 0.0), "1/d^2": (0.0, 0.0, 1.0)}
            coefficients = known.get(text) or (float(shifted[1]), 1.0, 0.0)
        except (TypeError, ValueError):
            raise SceneError(f'{what} as text must be "1", "1/d", "1/(d+D)" or "1/d^2"; given {shown(value)}') from None
    else:
        coefficients = vector3(value, what)
    if not all(math.isfinite(c) and c >= 0.0 for c in coefficients) or max(coefficients) == 0.0:
        raise SceneError(f"{what} must be at least 0 and not all 0; given {shown(value)}")
    return coefficients
