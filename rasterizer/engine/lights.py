"""What the engine knows of the types of light: one class a type, one line a type in LIGHT_TABLE.

Who asks, and for what:

    scene_tables    which lights are ambient, and which lights stand for one
    plan            how near the lit points come to it, and whether float32 holds its numbers
    bounds          how strong it is at most, how far its factors magnify rounding errors, where it jumps
    uniforms        the pipeline's function for it, and the coefficients that this function reads
    shadow_maps     the beam that a map has to show
    analysis/mach   the beam, too: which side of a face is lit

Light of one's own is a class that derives from `registries.CustomLight`; CustomEntry says here what it says.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError
from ..pipeline import lights as pipeline
from ..scene.camera import View
from ..scene.lights import light_type_of
from .rounding import SINGLE, Discontinuity, step_cosine, times

Distance = Callable[[Sequence[float]], float]  # from a position in the world to the lit point that is nearest to it

MIN_FALL = 2.0**-18  # of cosines: a spot light that falls within less has an edge
MIN_SHARE = 2.0**-10  # of the fall between its cones: from there on its slope has a bound


class Beam(NamedTuple):
    """Where a light shines from, and to, in the world."""

    origin: NDArray[np.float64] | None  # (3,); None = infinitely far away
    axis: NDArray[np.float64] | None  # (3,) unit, along which the light travels; None = to all sides
    spread: float  # tangent of the largest angle from the axis; 0 where the origin is None, inf from 90 degrees on


class LightBound(NamedTuple):
    """How strong a light is at most, and how far it magnifies errors.

    Parameters
    ----------
    strength : the largest part of its colour that arrives anywhere, above 0
    normal : what the strength changes by, at most, for each radian that the normal turns
    position : what the direction turns by, radians, and the strength changes by, as a part of the largest, at most,
        for each scene unit that a point moves
    """

    strength: float = 1.0
    normal: float = 0.0
    position: float = 0.0


class LightEntry:
    """Hold what the engine knows of a type of light.

    Every method takes a light of this type, the first argument. What is said here holds for light without a position
    that is never stronger than its colour and casts no shadows.
    """

    is_ambient = False  # it comes from all sides alike, and only its colour counts
    is_share = False  # it comes from all sides, and how much of it a point gets depends on the normal or the position

    def has_bound(self, light: Any) -> bool:
        """Tell whether the methods below say how strong it is, and how errors grow."""
        return True

    def expand(self, light: Any) -> tuple[Any, ...]:
        """Return the lights, of types that have a `function`, that stand for this one."""
        return (light,)

    def function(self, light: Any) -> pipeline.LightFunction:
        """Return the pipeline's function for the light, and what it needs."""
        raise NotImplementedError(f"{type(self).__name__} has no function: `expand` stands other lights for it")

    def write(self, coefficients: NDArray[np.float64], light: Any, view: View, dtype: np.dtype) -> None:
        """Fill the coefficients that the pipeline's function reads.

        Parameters
        ----------
        coefficients : (lights.N_LIGHT_COEFFICIENT,) float64, zeros; positions go there relative to the eye,
            directions along the axes of the world
        view : what a light that is attached to the camera moves with
        dtype : float32 or float64, what they will be converted to
        """

    def beam(self, light: Any, view: View) -> Beam | None:
        """Return where the light shines; None where that is no single place or direction. Then it casts no shadows."""
        return None

    def clearance(self, light: Any, view: View, distance: Distance) -> float:
        """Return the distance that no lit point comes nearer to the light than, scene units.

        Over this length the rounding of a position turns the direction to the light, or changes its strength: an error
        of e changes the strength by at most 2 e/clearance of it. Infinite where positions play no part.
        """
        return math.inf

    def strength(self, light: Any, clearance: ArrayLike) -> ArrayLike:
        """Return how much stronger than its colour the light is at most, at the clearance (...) and beyond; infinite
        where it has no limit."""
        return 1.0

    def steepness(self, light: Any) -> float:
        """Return how far factors of the strength magnify an error of a cosine, or a relative one of the distance."""
        return 0.0

    def slope(self, light: Any) -> float:
        """Return how far they magnify a turn of the direction, radians."""
        return self.steepness(light)

    def normal_slope(self, light: Any) -> float:
        """Return what share of the largest strength it changes by, at most, for each radian that the normal turns."""
        return 0.0

    def discontinuities(self, light: Any, u: float) -> tuple[Discontinuity, ...]:
        """Return where the strength jumps; u is the unit roundoff."""
        return ()

    def lengths(self, light: Any) -> tuple[float, ...]:
        """Return the coefficients that must keep their digits in float32 when multiplied by squares of lengths."""
        return ()


class AmbientEntry(LightEntry):
    """Light from all sides: it is a coefficient of the materials, see `uniforms`."""

    is_ambient = True

    def expand(self, light: Any) -> tuple[Any, ...]:
        """Nothing is evaluated for each point."""
        return ()


class DirectionalEntry(LightEntry):
    """Light from infinitely far away."""

    def function(self, light: Any) -> pipeline.LightFunction:
        """Return the function of parallel rays."""
        return pipeline.light_function_of("directional")

    def write(self, coefficients: NDArray[np.float64], light: Any, view: View, dtype: np.dtype) -> None:
        """Write the unit direction to the light."""
        coefficients[pipeline.VECTOR : pipeline.VECTOR + 3] = world_direction(light, view) * -1.0

    def beam(self, light: Any, view: View) -> Beam | None:
        """Return parallel rays."""
        return Beam(None, world_direction(light, view), 0.0)


class PointEntry(LightEntry):
    """Light from one point to all sides."""

    def function(self, light: Any) -> pipeline.LightFunction:
        """Return the function of a light that shines alike to all sides."""
        return pipeline.light_function_of("point")

    def write(self, coefficients: NDArray[np.float64], light: Any, view: View, dtype: np.dtype) -> None:
        """Write the position relative to the eye, and what weakens the light with the distance."""
        # Never brought to the world and back: that would cost digits far from the origin.
        position = to_world(light.position, light, view)
        relative = position if light.attached == "camera" else position - view.eye
        coefficients[pipeline.VECTOR : pipeline.VECTOR + 3] = relative
        coefficients[pipeline.ATTENUATION : pipeline.ATTENUATION + 3] = light.attenuation
        coefficients[pipeline.MAX_STRENGTH] = np.inf if light.amplify else 1.0
        coefficients[pipeline.INVERSE_RANGE] = 1.0 / light.range if light.range is not None else 0.0

    def beam(self, light: Any, view: View) -> Beam | None:
        """Return a beam to all sides."""
        return Beam(world_position(light, view), None, math.inf)

    def clearance(self, light: Any, view: View, distance: Distance) -> float:
        """Return the distance of the nearest lit point."""
        return distance(world_position(light, view))

    def strength(self, light: Any, clearance: ArrayLike) -> ArrayLike:
        """1/(kc + kl d + kq d²) is largest at the least distance d; nothing arrives beyond the range."""
        constant, linear, quadratic = light.attenuation
        d = np.asarray(clearance, float)
        with np.errstate(divide="ignore", over="ignore"):
            found = 1.0 / (constant + times(linear, d) + times(times(quadratic, d), d))
        found = found if light.amplify else np.minimum(found, 1.0)
        end = math.inf if light.range is None else light.range * (1.0 + 16.0 * SINGLE)
        return np.where(d > end, 0.0, found)

    def steepness(self, light: Any) -> float:
        """(d/r)^4 rises by four times the relative error of d."""
        return 4.0 if light.range is not None else 0.0

    def lengths(self, light: Any) -> tuple[float, ...]:
        """Return the coefficients of the attenuation, and the range."""
        ends = () if light.range is None else (light.range,)
        return tuple(coefficient for coefficient in light.attenuation if coefficient > 0.0) + ends


class SpotEntry(PointEntry):
    """Light from one point into a cone."""

    def function(self, light: Any) -> pipeline.LightFunction:
        """Return the function of the cone, another one where its fall is raised to a power."""
        return pipeline.light_function_of("shaped spot" if light.falloff != 1.0 else "spot")

    def write(self, coefficients: NDArray[np.float64], light: Any, view: View, dtype: np.dtype) -> None:
        """Write what a point light has, and the cone."""
        super().write(coefficients, light, view, dtype)
        inner, outer = cone_cosines(light)
        coefficients[pipeline.AXIS : pipeline.AXIS + 3] = world_direction(light, view)
        coefficients[pipeline.COS_OUTER] = outer
        coefficients[pipeline.CONE_SCALE] = 1.0 / (inner - outer) if inner > outer else np.inf
        # An exponent that float32 has no number for is as good as the largest one that it has.
        coefficients[pipeline.CONE_EXPONENT] = min(light.exponent, float(np.finfo(dtype).max))
        coefficients[pipeline.CONE_FALLOFF] = light.falloff

    def beam(self, light: Any, view: View) -> Beam | None:
        """Return the outer cone."""
        spread = math.tan(math.radians(light.outer)) if light.outer < 90.0 else math.inf
        return Beam(world_position(light, view), world_direction(light, view), spread)

    def steepness(self, light: Any) -> float:
        """Add that of the cone, and of the exponent."""
        return super().steepness(light) + fall_rise(light) + exponent_rise(light)

    def slope(self, light: Any) -> float:
        """Return what a turn changes.

        It moves the cosine of the angle from the axis by its sine, which is at most that of the outer cone. With e >= 1
        the slope of cos^e, e cos^(e-1)·sin, is largest where cos² = (e - 1)/e, and at most √e there.
        """
        sine, of_exponent = math.sin(math.radians(light.outer)), exponent_rise(light)
        if light.exponent >= 1.0:
            of_exponent = min(math.sqrt(light.exponent), light.exponent * sine)
        return super().steepness(light) + sine * fall_rise(light) + of_exponent

    def discontinuities(self, light: Any, u: float) -> tuple[Discontinuity, ...]:
        """A sharp cone has an edge, and so has one that falls too steeply for a bound."""
        inner, outer = cone_cosines(light)
        near = max(step_cosine(u), MIN_FALL) if inner - outer < MIN_FALL else 0.0
        if light.falloff < 0.5:
            near = max(near, MIN_SHARE * (inner - outer))
        if light.exponent < 1.0 and outer < MIN_FALL:
            near = max(near, MIN_FALL)
        return (Discontinuity("the edge of a sharp spot light", near, "cosine of an angle"),) if near > 0.0 else ()


class AreaEntry(LightEntry):
    """Light from a parallelogram: a point light in each of its cells stands for it."""

    def expand(self, light: Any) -> tuple[Any, ...]:
        """Return a point light for each cell."""
        return light.cells()


class Frame(NamedTuple):
    """The frame in which the vectors of a light are given, as the pipeline has it: positions relative to the eye."""

    light: Any
    view: View

    def point(self, position: Sequence[float]) -> NDArray[np.float64]:
        """Return a position (3,) relative to the eye, along the axes of the world."""
        placed = to_world(position, self.light, self.view)
        return placed if is_carried(self.light) else placed - self.view.eye

    def vector(self, direction: Sequence[float]) -> NDArray[np.float64]:
        """Return a direction (3,) along the axes of the world."""
        return to_world(direction, self.light, self.view)


class CustomEntry(LightEntry):
    """Light of one's own: what its class says, a `registries.CustomLight`.

    Where it says no bound it may have any strength: then it is drawn in float64, and no bound is stated.
    """

    def __init__(self, cls: Any) -> None:
        self.is_share = cls.share is not None
        make = pipeline.function_of_share if self.is_share else pipeline.function_of_arrival
        self._function = pipeline.LightFunction(make(cls.share or cls.arrival), cls.needs_position)
        self.has_beam = cls.beam is not None

    def expand(self, light: Any) -> tuple[Any, ...]:
        """Return the lights of one colour that stand for it."""
        return tuple(light.parts())

    def function(self, light: Any) -> pipeline.LightFunction:
        """Return the function of the formula."""
        return self._function

    def write(self, coefficients: NDArray[np.float64], light: Any, view: View, dtype: np.dtype) -> None:
        """Write the numbers that the formula reads."""
        numbers = np.asarray(light.numbers(Frame(light, view)), np.float64).ravel()
        if len(numbers) > len(coefficients):
            whose = f"{type(light).__name__}.numbers"
            raise SceneError(f"{whose} must be {len(coefficients)} numbers at most; given {len(numbers)}")
        coefficients[: len(numbers)] = numbers

    def beam(self, light: Any, view: View) -> Beam | None:
        """Return where it shines, if it says so."""
        return light.beam(view) if self.has_beam else None

    def has_bound(self, light: Any) -> bool:
        """Tell whether it states one."""
        return light.bound() is not None

    def clearance(self, light: Any, view: View, distance: Distance) -> float:
        """Return the length over which the position turns it, or changes its strength, by as much as it has."""
        slope = _bound_of(light).position
        return 1.0 / slope if slope > 0.0 else math.inf

    def strength(self, light: Any, clearance: ArrayLike) -> ArrayLike:
        """Return the largest strength that it states."""
        return _bound_of(light).strength

    def normal_slope(self, light: Any) -> float:
        """Return what it states, as a share of the strength."""
        return _bound_of(light).normal / _bound_of(light).strength

    def lengths(self, light: Any) -> tuple[float, ...]:
        """Return the lengths that the bound names."""
        slope = _bound_of(light).position
        return (slope, 1.0 / slope) if slope > 0.0 else ()


def _bound_of(light: Any) -> LightBound:
    """Return the bound that a light of one's own states; where it states none its strength has no limit."""
    return light.bound() or LightBound(strength=math.inf)


# By the words of scene.lights.LIGHT_TYPES.
LIGHT_TABLE: dict[str, LightEntry] = {
    "ambient": AmbientEntry(),
    "directional": DirectionalEntry(),
    "point": PointEntry(),
    "spot": SpotEntry(),
    "area": AreaEntry(),
}


def entry_of(light: Any) -> LightEntry:
    """Return what the engine knows of a light's type.

    Raises
    ------
    SceneError : the type is unknown, to scenes or to the engine; the message lists those that are known
    """
    name = light_type_of(light)
    if name not in LIGHT_TABLE:
        raise SceneError(f"the engine draws lights of the types {', '.join(LIGHT_TABLE)}; given one of type {name!r}")
    return LIGHT_TABLE[name]


def shadow_of(light: Any) -> Any:
    """Return the light's Shadow; None for a light that casts none, also of a type that can't."""
    return getattr(light, "shadow", None) or None


def is_black(light: Any) -> bool:
    """Tell whether a light's colour is 0, so that no scene needs it.

    A light that may amplify without limit is none: 0 times infinity is no number. A spectrum is what its samples are,
    also where its RGB is 0.
    """
    if max(light.color) > 0.0 or min(light.color) < 0.0 or hasattr(light.color, "wavelengths"):
        return False
    return bool(np.isfinite(entry_of(light).strength(light, 0.0)))


def cone_cosines(light: Any) -> tuple[float, float]:
    """Return the cosines of a spot light's inner and outer angle."""
    return math.cos(math.radians(light.inner)), math.cos(math.radians(light.outer))


def fall_rise(light: Any) -> float:
    """Return what the fall between a spot light's cones rises by for each unit of the cosine; 0 for a cone whose edge
    is a step.

    S = t² (3 - 2 t) rises by at most 3/2 of what t does, so S^p, p >= 1, by 3p/2; for 1/2 <= p < 1 the slope
    6 p t^(2p-1) (1 - t) (3 - 2 t)^(p-1) is at most 6p, because the last three factors are at most 1; below 1/2 that is
    t^(2p-1) times as much, from MIN_SHARE on.
    """
    inner, outer = cone_cosines(light)
    p, width = light.falloff, inner - outer
    if width < MIN_FALL:
        return 0.0
    return (1.5 * p if p >= 1.0 else 6.0 * p * MIN_SHARE ** min(2.0 * p - 1.0, 0.0)) / width


def exponent_rise(light: Any) -> float:
    """Return what c^e of a spot light rises by for each unit of the cosine.

    That is e c^(e-1): e for e >= 1, else most at the outer cone, and nowhere more than at MIN_FALL; where the cone is
    at 90 degrees it is multiplied by S^p, with p >= 1 at most t² (3 - 2 t) <= 3 (c/c_inner)².
    """
    inner, outer = cone_cosines(light)
    exponent = light.exponent
    if 0.0 < exponent < 1.0:
        at_edge = 3.0 / inner**2 if inner > MIN_FALL and light.falloff >= 1.0 else math.inf
        exponent *= min(max(outer, MIN_FALL) ** (exponent - 1.0), at_edge)
    return exponent


def is_carried(light: Any) -> bool:
    """Tell whether a light moves with the camera."""
    return getattr(light, "attached", "world") == "camera"


def world_position(light: Any, view: View) -> NDArray[np.float64]:
    """Return the position of a light in the world, (3,) float64, also of one that moves with the camera."""
    position = to_world(light.position, light, view)
    return view.eye + position if is_carried(light) else position


def world_direction(light: Any, view: View) -> NDArray[np.float64]:
    """Return the direction of a light in the world, (3,) float64, also of one that moves with the camera."""
    return to_world(light.direction, light, view)


def to_world(vector: Sequence[float], light: Any, view: View) -> NDArray[np.float64]:
    """Return a light's vector (3,) along the axes of the world; of one that moves with the camera it is given along
    those of the camera."""
    if not is_carried(light):
        return np.array(vector)
    return np.array(vector) @ view.world_from_camera.T
