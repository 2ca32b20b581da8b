"""What the engine knows of the types of light: one row a type in LIGHT_TABLE, which says all of it.

Who asks, and for what:

    scene_tables    which lights are ambient, and which lights stand for one
    domains         how strong it is at most, how far its factors magnify rounding errors, where it jumps
    uniforms        the function that evaluates it, and the coefficients that this function reads
    shadow_maps     the beam that a map has to show
    analysis/mach   the beam, too: which side of a face is lit

Light of one's own is a class that derives from `registries.CustomLight`; CustomEntry is its row.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError, faults_of
from ..pipeline import lights as pipeline
from ..scene.camera import View
from ..scene.lights import light_type_of

OWN = "a light or reflection model of one's own"
FAR = "distances and numbers of lights beyond float32"
MIN_FALL = 2.0**-18  # of cosines: a spot light that falls within less has an edge
MIN_SHARE = 2.0**-10  # of the fall between its cones: from there on its slope has a bound
LENGTHS = 2.0**-40, 2.0**60  # scene units: squares of lengths between them keep their digits in float32


class Step(NamedTuple):
    """Where a picture may jump, so that no error is small: what rounding carries across is no part of the bound."""

    cause: str
    near: float  # how near to that the bound doesn't hold
    unit: str  # of `near`


def step_cosine(is_double: bool) -> float:
    """Return how near to a step of a cosine no bound holds: twice what counts as 0, see `grazing` in
    pipeline/power.py."""
    return 2.0**-39 if is_double else 2.0**-19


class Beam(NamedTuple):
    """Where a light shines from, and to, in the world."""

    origin: NDArray[np.float64] | None  # (3,); None = infinitely far away
    axis: NDArray[np.float64] | None  # (3,) unit, along which the light travels; None = to all sides
    spread: float  # tangent of the largest angle from the axis; 0 where the origin is None, inf from 90 degrees on


class LightLimits(NamedTuple):
    """How far a light magnifies errors, and whether float32 will do."""

    slope: float = 0.0  # how far factors of the strength magnify a turn of the direction, radians
    steepness: float = 0.0  # and an error of a cosine, or a relative one of the distance
    reason: str = ""  # why float32 won't do, in a few words; empty where it does


class LightEntry:
    """Hold what the engine knows of a type of light.

    Every method takes a light of this type, the first argument. What is said here holds for light without a position
    that is never stronger than its colour and casts no shadows.

    Parameters
    ----------
    function : the pipeline's, which is compiled by `batch_function`; None of lights that others stand for
    """

    needs_position = False  # its function reads where a point lies
    is_own = False  # it is registered: nobody knows how its formula rounds

    is_ambient = False  # it comes from all sides alike, and only its colour counts
    is_share = False  # it comes from all sides, and how much of it a point gets depends on the normal or the position

    def __init__(self, function: Callable[..., None] | None = None) -> None:
        self._function = function

    def expand(self, light: Any) -> tuple[Any, ...]:
        """Return the lights, of types that have a `function`, that stand for this one."""
        return (light,)

    def function(self, light: Any) -> Any:
        """Return the pipeline's function for the light."""
        return self._function

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

    def strength(self, light: Any, distance: float) -> float:
        """Return how much stronger than its colour the light is at most, at a distance (scene units) and beyond;
        infinite where it has no limit."""
        return 1.0

    def limits(self, light: Any) -> LightLimits:
        """Return how far it magnifies errors, and whether float32 will do."""
        return LightLimits()

    def steps(self, light: Any, is_double: bool) -> tuple[Step, ...]:
        """Return where the strength jumps."""
        return ()


class AmbientEntry(LightEntry):
    """Light from all sides: it is a coefficient of the materials, see `uniforms`."""

    is_ambient = True

    def expand(self, light: Any) -> tuple[Any, ...]:
        """Nothing is evaluated for each point."""
        return ()


class DirectionalEntry(LightEntry):
    """Light from infinitely far away."""

    def write(self, coefficients: NDArray[np.float64], light: Any, view: View, dtype: np.dtype) -> None:
        """Write the unit direction to the light."""
        coefficients[pipeline.VECTOR : pipeline.VECTOR + 3] = to_world(light.direction, light, view) * -1.0

    def beam(self, light: Any, view: View) -> Beam | None:
        """Return parallel rays."""
        return Beam(None, to_world(light.direction, light, view), 0.0)


class PointEntry(LightEntry):
    """Light from one point to all sides."""

    needs_position = True

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

    def strength(self, light: Any, distance: float) -> float:
        """1/(kc + kl d + kq d²) is largest at the least distance d; nothing arrives beyond the range."""
        if light.range is not None and distance > light.range * (1.0 + 2.0**-20):
            return 0.0
        constant, linear, quadratic = light.attenuation
        weakened = constant + (linear * distance if linear else 0.0)
        weakened += quadratic * distance * distance if quadratic else 0.0  # 0 times infinity is no number
        found = 1.0 / weakened if weakened > 0.0 else math.inf
        return found if light.amplify else min(found, 1.0)

    def limits(self, light: Any) -> LightLimits:
        """(d/r)^4 rises by four times the relative error of d. Coefficients and the range must keep their digits."""
        rise = 4.0 if light.range is not None else 0.0
        lengths = [*filter(None, light.attenuation), light.range or 1.0]
        is_single = LENGTHS[0] <= min(lengths) and max(lengths) <= LENGTHS[1]
        return LightLimits(rise, rise, "" if is_single else FAR)


class SpotEntry(PointEntry):
    """Light from one point into a cone."""

    def function(self, light: Any) -> Any:
        """Return that of the cone, another one where its fall is raised to a power."""
        return pipeline.shaped_spot if light.falloff != 1.0 else pipeline.spot

    def write(self, coefficients: NDArray[np.float64], light: Any, view: View, dtype: np.dtype) -> None:
        """Write what a point light has, and the cone."""
        super().write(coefficients, light, view, dtype)
        inner, outer = cone_cosines(light)
        coefficients[pipeline.AXIS : pipeline.AXIS + 3] = to_world(light.direction, light, view)
        coefficients[pipeline.COS_OUTER] = outer
        coefficients[pipeline.CONE_SCALE] = 1.0 / (inner - outer) if inner > outer else np.inf
        # An exponent that float32 has no number for is as good as the largest one that it has.
        coefficients[pipeline.CONE_EXPONENT] = min(light.exponent, float(np.finfo(dtype).max))
        coefficients[pipeline.CONE_FALLOFF] = light.falloff

    def beam(self, light: Any, view: View) -> Beam | None:
        """Return the outer cone."""
        spread = math.tan(math.radians(light.outer)) if light.outer < 90.0 else math.inf
        return Beam(world_position(light, view), to_world(light.direction, light, view), spread)

    def limits(self, light: Any) -> LightLimits:
        """Add what the cone and the exponent magnify; rounding to float32 carries positions across a sharp edge.

        A turn moves the cosine of the angle from the axis by its sine, which is at most that of the outer cone. With
        e >= 1 the slope of cos^e, e cos^(e-1)·sin, is largest where cos² = (e - 1)/e, and at most √e there.
        """
        plain, sine, of_exponent = super().limits(light), math.sin(math.radians(light.outer)), exponent_rise(light)
        steepness = plain.steepness + fall_rise(light) + of_exponent
        if light.exponent >= 1.0:
            of_exponent = min(math.sqrt(light.exponent), light.exponent * sine)
        slope = plain.slope + sine * fall_rise(light) + of_exponent
        return LightLimits(slope, steepness, "a sharp spot light" if self.steps(light, False) else plain.reason)

    def steps(self, light: Any, is_double: bool) -> tuple[Step, ...]:
        """A sharp cone has an edge, and so has one that falls too steeply for a bound."""
        inner, outer = cone_cosines(light)
        near = MIN_FALL if inner - outer < MIN_FALL else 0.0
        if light.falloff < 0.5:
            near = max(near, MIN_SHARE * (inner - outer))
        if light.exponent < 1.0 and outer < MIN_FALL:
            near = max(near, MIN_FALL)
        return (Step("the edge of a sharp spot light", near, "cosine of an angle"),) if near > 0.0 else ()


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

    It may have any strength, and nobody knows how its formula rounds: so it is lit in float64, and no bound is stated.
    """

    is_own = True

    def __init__(self, cls: Any) -> None:
        self.is_share, self.needs_position = cls.share is not None, cls.needs_position
        make = pipeline.function_of_share if self.is_share else pipeline.function_of_arrival
        super().__init__(make(cls.share or cls.arrival))
        self.has_beam = cls.beam is not None

    def expand(self, light: Any) -> tuple[Any, ...]:
        """Return the lights of one colour that stand for it."""
        with faults_of(_whose(light)):
            return tuple(light.parts())

    def write(self, coefficients: NDArray[np.float64], light: Any, view: View, dtype: np.dtype) -> None:
        """Write the numbers that the formula reads."""
        with faults_of(_whose(light)):
            numbers = np.asarray(light.numbers(Frame(light, view)), np.float64).ravel()
        if len(numbers) > len(coefficients):
            whose = f"{type(light).__name__}.numbers"
            raise SceneError(f"{whose} must be {len(coefficients)} numbers at most; given {len(numbers)}")
        coefficients[: len(numbers)] = numbers

    def beam(self, light: Any, view: View) -> Beam | None:
        """Return where it shines, if it says so."""
        with faults_of(_whose(light)):
            return light.beam(view) if self.has_beam else None

    def strength(self, light: Any, distance: float) -> float:
        """Return that there is no limit."""
        return math.inf

    def limits(self, light: Any) -> LightLimits:
        """Return that nothing is known."""
        return LightLimits(math.inf, math.inf, OWN)


def _whose(light: Any) -> str:
    """Return how messages name the class of a light."""
    return f"the light {type(light).__module__}.{type(light).__qualname__}"


# By the words of scene.lights.LIGHT_TYPES.
LIGHT_TABLE: dict[str, LightEntry] = {
    "ambient": AmbientEntry(),
    "directional": DirectionalEntry(pipeline.directional),
    "point": PointEntry(pipeline.point),
    "spot": SpotEntry(),
    "area": AreaEntry(),
}


def entry_of(light: Any) -> LightEntry:
    """Return what the engine knows of a light's type.

    Raises
    ------
    SceneError : the type is unknown; the message lists those that are known
    """
    return LIGHT_TABLE[light_type_of(light)]


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


def to_world(vector: Sequence[float], light: Any, view: View) -> NDArray[np.float64]:
    """Return a light's vector (3,) along the axes of the world; of one that moves with the camera it is given along
    those of the camera."""
    if not is_carried(light):
        return np.array(vector)
    return np.array(vector) @ view.world_from_camera.T
