"""What the engine knows of the reflection models: one row a model in REFLECTION_TABLE, which says all of it.

Who asks, and for what:

    scene_tables    whether a highlight is several sums, because W(θ) weights it
    domains         how bright a highlight is at most, how far it moves when directions turn, where it jumps
    plan            why a material needs float64
    uniforms        the functions that evaluate it, and the coefficients that these read

A model of one's own is a class that derives from `registries.CustomReflection`; CustomEntry is its row.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from ..errors import SceneError
from ..pipeline import reflection as pipeline
from .lights import OWN, Step, step_cosine

MIN_BASE = 2.0**-20  # of a power with an exponent below 1: from there on its bound holds


def min_sum(is_double: bool) -> float:
    """Return |L + V| from which bounds of half vectors hold: 2 degrees from opposite directions on, 29 in float32."""
    return 2.0**-5 if is_double else 2.0**-1


class ReflectionLimits(NamedTuple):
    """How bright a reflection model is, how far it magnifies errors (domains.py), and whether float32 will do; of
    highlights, for one of height 1."""

    peak: float = 1.0  # the largest value of a highlight where `specular` is 1
    rough: float = 0.0  # how far the diffuse term magnifies an error of the directions, beyond Lambert's
    slope: float = 0.0  # what a highlight changes by, at most, for each radian that the normal turns
    roundings: float = 0.0  # how many u a highlight errs by, beside what positions turn it by
    weight: float = 1.0  # the share of its height that a highlight has at most beside its `steps`
    reason: str = ""  # why float32 won't do, in a few words; empty where it does


class ReflectionEntry:
    """Hold what the engine knows of a reflection model.

    Every method takes a Material that names the model. What is said here holds for a model without a highlight, whose
    diffuse term errs by no more than N·L does.

    Parameters
    ----------
    function : the pipeline's, which is compiled by `batch_function`
    """

    is_own = False  # it is registered: nobody knows how its formula rounds
    needs_view = False  # its function reads N_DOT_V and VIEW_DIR
    is_shiny = False  # it writes SPECULAR
    has_fresnel = False  # and GRAZING
    is_lambert_when_dull = False  # with a black `specular` it reflects as Lambert's model does
    default_fresnel = 1.0  # F0 of a material that gives none

    def __init__(self, function: Callable[..., None]) -> None:
        self._function = function

    def function(self, material: Any) -> Callable[..., None]:
        """Return the pipeline's function for the material."""
        return self._function

    def highlight_scale(self, material: Any) -> float:
        """Return the factor of a normalised highlight, beside N·L; 0 for a classic one."""
        return 0.0

    def limits(self, material: Any) -> ReflectionLimits:
        """Return how bright it is, how far it magnifies errors, and whether float32 will do."""
        return ReflectionLimits()

    def steps(self, material: Any, is_double: bool) -> tuple[Step, ...]:
        """Return where the model jumps."""
        return ()


class OrenNayarEntry(ReflectionEntry):
    """Oren's and Nayar's model of rough surfaces."""

    needs_view = True

    def limits(self, material: Any) -> ReflectionLimits:
        """Return the slope of tan β, which is cut off at MIN_COSINE."""
        square = material.roughness**2
        return ReflectionLimits(rough=0.45 * square / (square + 0.09) / pipeline.MIN_COSINE)


class PowerEntry(ReflectionEntry):
    """Lambert's diffuse term, and a highlight that is a power h^n: Phong's and Blinn's models.

    With h = 1 - |R - V|²/2 an error e of R - V moves h^n by n h^(n-1)·|R - V|·e, at most `power_slope`·e; 1.5 n u more
    by the rounding of h and the product of n factors. With n < 1 that is steep at 0 without limit: such materials are
    lit in float64, and the bound holds where h is MIN_BASE at least.
    """

    turn = 1.0  # how far h's vector turns where the normal does
    needs_view = is_shiny = has_fresnel = is_lambert_when_dull = True

    def limits(self, material: Any) -> ReflectionLimits:
        """Return those of the power, of W(θ), which rises by 5 at most, and of N·L.

        The peak is the scale, at least 1: h <= 1, W <= 1, also of an F0 with a colour, because F0 <= 1. N - H errs by
        53 u where |L + V| is 1/2 at least, R - V by 68 u (see `fill_r_dot_v`).
        """
        n, slope = material.shininess, power_slope(material.shininess)
        of_weights = 5.0 * (material.fresnel is not None) + 1.0 * material.normalized
        return ReflectionLimits(
            peak=max(self.highlight_scale(material), 1.0),
            slope=self.turn * slope + of_weights,
            roundings=68.0 * slope + 1.5 * n + 16.0 * of_weights,
            reason="an exponent below 1" if n < 1.0 else "",
        )

    def steps(self, material: Any, is_double: bool) -> tuple[Step, ...]:
        """A classic highlight ends with a step; one that is normalised falls to 0 there. An exponent below 1 makes its
        beginning one."""
        steps = []
        if not material.normalized:
            cause = "a highlight ends where its light grazes the surface, N·L = 0"
            steps.append(Step(cause, step_cosine(is_double), "cosine of an angle"))
        if material.shininess < 1.0:
            cause = "a highlight with an exponent below 1 begins, R·V = 0 or N·H = 0"
            steps.append(Step(cause, MIN_BASE, "cosine of an angle"))
        return tuple(steps)


class PhongEntry(PowerEntry):
    """Phong's highlight: h = R·V. The mirrored light direction turns twice as far as the normal."""

    turn = 2.0

    def highlight_scale(self, material: Any) -> float:
        """Return (n + 2)/2. Source: Lafortune & Willems 1994, TR CW197, K.U. Leuven."""
        return (material.shininess + 2) / 2 if material.normalized else 0.0


class BlinnEntry(PowerEntry):
    """Blinn's highlight: h = N·H. What is over |L + V| has no limit where L = -V, which is a step."""

    def highlight_scale(self, material: Any) -> float:
        """Return (n + 2)(n + 4)/(8 (2^(-n/2) + n)). Source: Giesen 2009, Phong Normalization Factor derivation."""
        n = material.shininess
        return (n + 2) * (n + 4) / (8 * (2 ** (-n / 2) + n)) if material.normalized else 0.0

    def steps(self, material: Any, is_double: bool) -> tuple[Step, ...]:
        """Add that of the half vector, which a normalised highlight hides behind N·L = 0."""
        steps = super().steps(material, is_double)
        half = Step("Blinn's half vector, where the light is opposite to the viewer", min_sum(is_double), "|L + V|")
        return steps if material.normalized else (*steps, half)


class CookTorranceEntry(ReflectionEntry):
    """Microscopic mirrors, tilted as GGX or Beckmann says; also more across a direction than along it.

    With S = D(δ)·f(N·L)·g(N·V), δ between N and H, both cosines are cos(θ + δ) at least, cos θ = |L + V|/2. So D, g and
    the slopes of f and g are never large together: the largest sums of products of these over all δ, and over |L + V|
    from 1/2 on, lie below the numbers here.
    """

    needs_view = is_shiny = has_fresnel = is_lambert_when_dull = True
    default_fresnel = 0.04

    def function(self, material: Any) -> Callable[..., None]:
        """Return the function of the distribution, and of the direction along which the surface is brushed."""
        if material.metallic_roughness is not None:
            return pipeline.ggx_of_texture
        if material.is_anisotropic:
            return pipeline.anisotropic_ggx if material.tangent == "u" else pipeline.anisotropic_ggx_by_axis
        return pipeline.ggx if material.distribution == "ggx" else pipeline.beckmann

    def limits(self, material: Any) -> ReflectionLimits:
        """Return those of the mirrors. W(θ) has no part in the slope: L and V alone say what θ is.

        The peak is that of π D G / (4 N·V). GGX: π D <= 1/α², N·L G1(L)/(2 N·L) <= 1/2, G1(V)/(2 N·V) <= 1/α.
        Anisotropic: π D <= 1/(αx αy), and the root in G1(V) is at least the smaller α. Beckmann: π D has its maximum at
        tan² = max(0, 2 m² - 1), and G1(V)/N·V <= 3.535/m.

        Where a tangent nearly stands upright on the surface its projection has no bound; nor is an error of a roughness
        small that a texture shows, where it makes mirrors of the surface.
        """
        r, is_ggx = min_roughness(material), material.distribution == "ggx"
        if material.is_anisotropic:
            peak = 1.0 / (2.0 * material.roughness[0] * material.roughness[1] * r)
        elif is_ggx:
            peak = 1.0 / (2.0 * r**3)
        else:
            tangent_square = max(0.0, 2.0 * r * r - 1.0)
            peak = math.exp(-tangent_square / r**2) * (1.0 + tangent_square) ** 2 / r**3 * (3.535 / 4.0)
        is_hued = is_metallic(material) or isinstance(fresnel_of(material), tuple)
        f0 = 1.0 if is_hued else fresnel_of(material)
        reason = "brushed materials" if material.is_anisotropic else ""
        return ReflectionLimits(
            peak=peak,
            slope=7.0 if is_ggx else 46.0,
            roundings=245.0 if is_ggx else 1080.0,
            weight=f0 + (1.0 - f0) * (1.0 - min_sum(False) / 2.0) ** 5,
            reason="metallic-roughness textures" if material.metallic_roughness is not None else reason,
        )

    def steps(self, material: Any, is_double: bool) -> tuple[Step, ...]:
        """GGX mirrors that are tilted by more than a right angle count as none. What the half vector errs by has no
        bound where the light is opposite to the viewer."""
        if material.is_anisotropic:
            return ()
        opposite = "Cook-Torrance where the viewer looks towards the light, which is opposite to him"
        steps = (Step(opposite, min_sum(is_double), "|L + V|"),)
        if material.distribution != "ggx":
            return steps
        cause = "Cook-Torrance where a normal looks away from the viewer, N·H = 0"
        return (Step(cause, step_cosine(is_double), "cosine of an angle"), *steps)


class ToonEntry(ReflectionEntry):
    """Few levels: between the steps nothing moves."""

    needs_view = is_shiny = True

    def limits(self, material: Any) -> ReflectionLimits:
        """Next to a step no error is small."""
        return ReflectionLimits(reason="toon levels")

    def steps(self, material: Any, is_double: bool) -> tuple[Step, ...]:
        """Every level ends with a step, the highlight too."""
        return (Step("a toon's levels", step_cosine(is_double), "cosine of an angle"),)


class CustomEntry(ReflectionEntry):
    """A model of one's own: what its class says, a `registries.CustomReflection`.

    Nobody knows how its formula rounds: so it is lit in float64, and no bound is stated.
    """

    is_own = True

    def __init__(self, model: Any) -> None:
        super().__init__(pipeline.function_of_reflection(type(model).reflect))
        self.needs_view, self.is_shiny = model.needs_view, model.has_highlight

    def limits(self, material: Any) -> ReflectionLimits:
        """Return that nothing is known."""
        return ReflectionLimits(rough=math.inf, reason=OWN)


# By the words of scene.material.REFLECTION_MODELS.
REFLECTION_TABLE: dict[str, ReflectionEntry] = {
    "phong": PhongEntry(pipeline.phong),
    "blinn": BlinnEntry(pipeline.blinn),
    "lambert": ReflectionEntry(pipeline.lambert),
    "oren-nayar": OrenNayarEntry(pipeline.oren_nayar),
    "cook-torrance": CookTorranceEntry(pipeline.ggx),
    "toon": ToonEntry(pipeline.toon),
}
LAMBERT = REFLECTION_TABLE["lambert"]


def entry_of(material: Any) -> ReflectionEntry:
    """Return what the engine knows of a material's reflection model.

    A dull material needs no exponent, and what isn't asked for costs nothing: where Lambert's model gives the same, its
    entry is returned.

    Raises
    ------
    SceneError : the engine doesn't know the model; the message lists those that it knows
    """
    if material.reflection not in REFLECTION_TABLE:
        legal = ", ".join(REFLECTION_TABLE)
        raise SceneError(f"the engine knows the reflection models {legal}; given {material.reflection!r}")
    entry = REFLECTION_TABLE[material.reflection]
    return LAMBERT if entry.is_lambert_when_dull and max(material.specular) == 0 else entry


def min_roughness(material: Any) -> float:
    """Return the roughness of a material; of two, or of what a texture makes of it, the smallest one."""
    if material.metallic_roughness is not None:
        return max(material.roughness * material.metallic_roughness.least[1] ** 2, pipeline.MIN_ALPHA)
    return min(material.roughness) if material.is_anisotropic else material.roughness


def is_metallic(material: Any) -> bool:
    """Tell whether a material may be metal, whose F0 follows the colours of the mesh and its texture."""
    return material.metallic > 0.0 or material.metallic_roughness is not None


def count_terms(material: Any) -> int:
    """Return how many sums a material's light is: 1 without a highlight, 2 with one, 3 where W(θ) weights it, 4 of
    metals; see pipeline/lighting.py."""
    entry = entry_of(material)
    if not (entry.is_shiny and max(material.specular) > 0):
        return 1
    if not entry.has_fresnel or (material.fresnel is None and entry.default_fresnel == 1.0):
        return 2
    return 4 if is_metallic(material) else 3


def fresnel_of(material: Any) -> Any:
    """Return F0 of a material's specular reflection function W(θ): a number, a colour or a Spectrum."""
    return entry_of(material).default_fresnel if material.fresnel is None else material.fresnel


def power_slope(exponent: float) -> float:
    """Return the largest n h^(n-1)·|R - V| with h = R·V = 1 - |R - V|²/2; with n < 1 for h >= MIN_BASE.

    With s = |R - V|/2 it is 2 n (1 - 2 s²)^(n-1)·s, largest where s² = 1/(4 n - 2): √2 for n = 1, 0.61 √n for large n.
    For n < 1 it is largest at MIN_BASE, where |R - V| is √2 at most.
    """
    if exponent < 1.0:
        return math.sqrt(2.0) * exponent * MIN_BASE ** (exponent - 1.0)
    return 0.7 * math.sqrt(exponent) + 0.72
