"""What the engine knows of the reflection models: one class a model, one line a model in REFLECTION_TABLE.

Who asks, and for what:

    scene_tables    whether a highlight is two sums, because its F0 has a colour
    plan            why a material needs float64
    bounds          how bright a highlight is at most, how far rounding and turns of directions move it, where it jumps
    uniforms        the pipeline's functions, and the coefficients that these read

A model of one's own is a class that derives from `registries.CustomReflection`; CustomEntry says here what it says.
The bounds of a highlight are those of one whose largest value is 1: see the table at the head of bounds.py.
"""

import math
from typing import Any, NamedTuple

from ..errors import SceneError
from ..pipeline import reflection as pipeline
from .rounding import DOUBLE, SINGLE, Discontinuity, step_cosine


class ReflectionBound(NamedTuple):
    """How far a reflection model magnifies errors. D is at most 1.

    Parameters
    ----------
    turn : what D and S change by, at most, for each radian that the normal or the direction to the light turns
    highlight : the largest S
    """

    turn: float = 1.0
    highlight: float = 1.0


class ReflectionEntry:
    """Hold what the engine knows of a reflection model.

    Every method takes a Material that names the model. What is said here holds for a model without a highlight, whose
    diffuse term errs by no more than N·L does. Of a highlight three numbers count, for one whose largest value is 1:
    what rounding adds, and how far it moves when the normal or the light's direction turns (engine/bounds.py).
    """

    has_bound = True  # the methods below tell how errors grow
    is_lambert_when_dull = False  # with a black `specular` it reflects as Lambert's model does
    default_fresnel = 1.0  # F0 of a material that gives none

    def function(self, material: Any) -> pipeline.ReflectionFunction:
        """Return the pipeline's function for the material, and what it needs."""
        raise NotImplementedError(f"{type(self).__name__} has no function")

    def has_highlight(self, material: Any) -> bool:
        """Tell whether the material has a highlight."""
        return max(material.specular) > 0 and self.function(material).has_highlight

    def reason_for_float64(self, material: Any) -> str:
        """Return why float32 won't do, in a few words; empty where it does."""
        return ""

    def highlight_scale(self, material: Any) -> float:
        """Return the factor of a normalised highlight, beside N·L; 0 for a classic one."""
        return 0.0

    def brightest_highlight(self, material: Any) -> float:
        """Return the largest value of a highlight where `specular` is 1."""
        return 0.0

    def diffuse_slope(self, material: Any) -> float:
        """Return how far the diffuse term magnifies an error of the directions, beyond Lambert's."""
        return 0.0

    def highlight_rounding(self, material: Any, u: float) -> float:
        """Return how far a highlight of height 1 is off by rounding; u is the unit roundoff."""
        return 0.0

    def turn_slope(self, material: Any, u: float) -> float:
        """Return what a highlight of height 1 changes by, at most, for each radian that the normal turns."""
        return 0.0

    def light_slope(self, material: Any, u: float) -> float:
        """Return the same for the direction to the light."""
        return self.turn_slope(material, u)

    def weight(self, material: Any, u: float) -> float:
        """Return the share of its height that a highlight has at most beside its `discontinuities`."""
        return 1.0

    def discontinuities(self, material: Any, u: float) -> tuple[Discontinuity, ...]:
        """Return where the model jumps."""
        return ()


MIN_SUM = {SINGLE: 2.0**-1, DOUBLE: 2.0**-5}  # by u: |L + V| from which bounds of half vectors hold
MIN_BASE = 2.0**-20  # of a power with an exponent below 1: from there on its bound holds


class LambertEntry(ReflectionEntry):
    """Lambert's model: N·L."""

    is_lambert_when_dull = True

    def function(self, material: Any) -> pipeline.ReflectionFunction:
        """Return Lambert's function."""
        return pipeline.reflection_function_of("lambert")


class OrenNayarEntry(ReflectionEntry):
    """Oren's and Nayar's model of rough surfaces."""

    def function(self, material: Any) -> pipeline.ReflectionFunction:
        """Return Oren's and Nayar's function."""
        return pipeline.reflection_function_of("oren-nayar")

    def diffuse_slope(self, material: Any) -> float:
        """Return that of tan β, which is cut off at MIN_COSINE."""
        square = material.roughness**2
        return 0.45 * square / (square + 0.09) / pipeline.MIN_COSINE


class PowerEntry(ReflectionEntry):
    """Lambert's diffuse term, and a highlight that is a power h^n: Phong's and Blinn's models.

    With h = 1 - |R - V|²/2 an error e of R - V moves h^n by n h^(n-1)·|R - V|·e, at most `power_slope`·e; 1.5 n u more
    by the rounding of h and the product of n factors, and 4 u. With n < 1 that is steep at 0 without limit: such
    materials are lit in float64, and the bound holds where h is MIN_BASE at least.
    """

    is_lambert_when_dull = True

    def error(self, u: float) -> float:
        """Return the error of R - V or N - H."""
        raise NotImplementedError

    def function(self, material: Any) -> pipeline.ReflectionFunction:
        """Return the function of the power."""
        return pipeline.reflection_function_of(material.reflection)

    def reason_for_float64(self, material: Any) -> str:
        """Return that h^n with n < 1 is steep without limit at h = 0."""
        return "an exponent below 1" if material.shininess < 1.0 else ""

    def brightest_highlight(self, material: Any) -> float:
        """Return the scale, at least 1: h <= 1, W <= 1, also of an F0 with a colour, because F0 <= 1."""
        return max(self.highlight_scale(material), 1.0)

    def turn_slope(self, material: Any, u: float) -> float:
        """Return that of the power, of W(θ), which rises by 5 at most, and of N·L."""
        return power_slope(material.shininess) + weight_slope(material)

    def highlight_rounding(self, material: Any, u: float) -> float:
        """Return what the head of this class derives, and the rounding of the weights."""
        n = material.shininess
        return power_slope(n) * self.error(u) + (1.5 * n + 4.0) * u + 16.0 * u * weight_slope(material)

    def discontinuities(self, material: Any, u: float) -> tuple[Discontinuity, ...]:
        """A classic highlight ends with a step; one that is normalised falls to 0 there. An exponent below 1 makes its
        beginning one."""
        steps = []
        if not material.normalized:
            cause = "a highlight ends where its light grazes the surface, N·L = 0"
            steps.append(Discontinuity(cause, step_cosine(u), "cosine of an angle"))
        if material.shininess < 1.0:
            cause = "a highlight with an exponent below 1 begins, R·V = 0 or N·H = 0"
            steps.append(Discontinuity(cause, MIN_BASE, "cosine of an angle"))
        return tuple(steps)


class PhongEntry(PowerEntry):
    """Phong's highlight: h = R·V."""

    def error(self, u: float) -> float:
        """Return the error of R - V."""
        return 68.0 * u

    def turn_slope(self, material: Any, u: float) -> float:
        """The mirrored light direction turns twice as far as the normal."""
        return 2.0 * power_slope(material.shininess) + weight_slope(material)

    def light_slope(self, material: Any, u: float) -> float:
        """R turns as far as L does."""
        return power_slope(material.shininess) + weight_slope(material)

    def highlight_scale(self, material: Any) -> float:
        """Return (n + 2)/2. Source: Lafortune & Willems 1994, TR CW197, K.U. Leuven."""
        return (material.shininess + 2) / 2 if material.normalized else 0.0


class BlinnEntry(PowerEntry):
    """Blinn's highlight: h = N·H. What is over |L + V| has no limit where L = -V, which is a step."""

    def error(self, u: float) -> float:
        """Return the error of N - H where |L + V| is MIN_SUM at least."""
        return (13.0 + 20.0 / MIN_SUM[u]) * u

    def light_slope(self, material: Any, u: float) -> float:
        """H turns by 1/|L + V| of what L does across their plane, and by half of it within."""
        return power_slope(material.shininess) / MIN_SUM[u] + weight_slope(material)

    def highlight_scale(self, material: Any) -> float:
        """Return the factor of Blinn's highlight."""
        return blinn_scale(material)

    def discontinuities(self, material: Any, u: float) -> tuple[Discontinuity, ...]:
        """Add that of the half vector, which a normalised highlight hides behind N·L = 0."""
        steps = super().discontinuities(material, u)
        half = Discontinuity("Blinn's half vector, where the light is opposite to the viewer", MIN_SUM[u], "|L + V|")
        return steps if material.normalized else (*steps, half)


class CookTorranceEntry(ReflectionEntry):
    """Microscopic mirrors, tilted as GGX or Beckmann says; also more across a direction than along it.

    With S = D(δ)·f(N·L)·g(N·V), δ between N and H, both cosines are cos(θ + δ) at least, cos θ = |L + V|/2. So D, g and
    the slopes of f and g are never large together. The largest sums of products of these over all δ, and over |L + V|
    from MIN_SUM on, lie below the numbers here (tests/engine/test_reflection_table.py): for float32, where W(θ)
    changes by three times itself for each radian at most, and for float64.
    """

    is_lambert_when_dull = True
    default_fresnel = 0.04

    def function(self, material: Any) -> pipeline.ReflectionFunction:
        """Return the function of the distribution, and of the direction along which the surface is brushed."""
        word = material.distribution
        if material.metallic_roughness is not None:
            word = "ggx of texture"
        elif material.is_anisotropic:
            word = "anisotropic ggx" if material.tangent == "u" else "anisotropic ggx by axis"
        return pipeline.reflection_function_of(word)

    def reason_for_float64(self, material: Any) -> str:
        """Where the tangent nearly stands upright on the surface its projection has no bound; nor is an error of a
        roughness small that a texture shows, where it makes mirrors of the surface."""
        if material.metallic_roughness is not None:
            return "metallic-roughness textures"
        return "brushed materials" if material.is_anisotropic else ""

    def brightest_highlight(self, material: Any) -> float:
        """Return the largest π D G / (4 N·V).

        GGX: π D <= 1/α², N·L G1(L)/(2 N·L) <= 1/2, G1(V)/(2 N·V) <= 1/α. Anisotropic: π D <= 1/(αx αy), and the root
        in G1(V) is at least the smaller α. Beckmann: π D has its maximum at tan² = max(0, 2 m² - 1), and
        G1(V)/N·V <= 3.535/m.
        """
        r = min_roughness(material)
        if material.is_anisotropic:
            r = material.roughness
            return 1.0 / (2.0 * r[0] * r[1] * min(r))
        if material.distribution == "ggx":
            return 1.0 / (2.0 * r**3)
        tangent_square = max(0.0, 2.0 * r * r - 1.0)
        return math.exp(-tangent_square / r**2) * (1.0 + tangent_square) ** 2 / r**3 * (3.535 / 4.0)

    def turn_slope(self, material: Any, u: float) -> float:
        """Return that of the mirrors. W(θ) has no part in it: L and V alone say what θ is.

        In float64 ln D rises by at most 2/α a radian and G by 1/α; α is the smaller one, as far as the tangent stands
        still. Beckmann's G is steeper where m is large.
        """
        r, is_ggx = min_roughness(material), material.distribution == "ggx"
        if u == SINGLE:
            return 7.0 if is_ggx else 46.0
        return 4.0 / r + 5.0 if is_ggx else 5.6 / r + 40.0

    def light_slope(self, material: Any, u: float) -> float:
        """Return what the mirrors change by where L turns."""
        r, is_ggx = min_roughness(material), material.distribution == "ggx"
        if u == SINGLE:
            return 9.0 if is_ggx else 29.0
        return (2.4 + 2.2 / r) / r if is_ggx else (5.0 + 3.4 / r) / r + 28.0

    def highlight_rounding(self, material: Any, u: float) -> float:
        """Return what errors of N, L, V and their products add."""
        r, is_ggx = min_roughness(material), material.distribution == "ggx"
        if u == SINGLE:
            return u * (min(105.0 + 480.0 * r, 245.0) if is_ggx else 1080.0)
        own = u * ((110.0 + 44.0 / r) / r if is_ggx else (182.0 + 68.0 / r) / r + 910.0)
        return own + self.alpha_rounding(material, u)

    def alpha_rounding(self, material: Any, u: float) -> float:
        """Return what the error of an α that a texture shows adds: 0 without one.

        α is g² of a texel's mean g within 0..1. Texture coordinates within the picture err by 16 u of a side, so g errs
        by as much of a texel's whole range, and α by 2 α/g of that. ln D rises by at most 2/α with α, ln G by 2/α.
        """
        if material.metallic_roughness is None:
            return 0.0
        r = min_roughness(material)
        sides = max(material.metallic_roughness.shape)
        return 8.0 * 16.0 * u * sides * math.sqrt(material.roughness / r)

    def weight(self, material: Any, u: float) -> float:
        """Return the largest W(θ)."""
        f0 = 1.0 if is_metallic(material) or isinstance(fresnel_of(material), tuple) else fresnel_of(material)
        return f0 + (1.0 - f0) * (1.0 - MIN_SUM[u] / 2.0) ** 5

    def discontinuities(self, material: Any, u: float) -> tuple[Discontinuity, ...]:
        """GGX mirrors that are tilted by more than a right angle count as none. What the half vector errs by has no
        bound where the light is opposite to the viewer."""
        if material.is_anisotropic:
            return ()
        opposite = "Cook-Torrance where the viewer looks towards the light, which is opposite to him"
        steps = (Discontinuity(opposite, MIN_SUM[u], "|L + V|"),)
        if material.distribution != "ggx":
            return steps
        cause = "Cook-Torrance where a normal looks away from the viewer, N·H = 0"
        return (Discontinuity(cause, step_cosine(u), "cosine of an angle"), *steps)


class ToonEntry(ReflectionEntry):
    """Few levels: between the steps nothing moves."""

    def function(self, material: Any) -> pipeline.ReflectionFunction:
        """Return the function of the levels."""
        return pipeline.reflection_function_of("toon")

    def reason_for_float64(self, material: Any) -> str:
        """Next to a step no error is small."""
        return "toon levels"

    def brightest_highlight(self, material: Any) -> float:
        """A highlight is 1 or 0. The factor of a normalised one, which this model doesn't apply, makes the bound larger
        than it need be where a material has both."""
        return max(blinn_scale(material), 1.0)

    def discontinuities(self, material: Any, u: float) -> tuple[Discontinuity, ...]:
        """Every level ends with a step, the highlight too."""
        return (Discontinuity("a toon's levels", step_cosine(u), "cosine of an angle"),)


UNKNOWN = ReflectionBound(turn=1e30)  # of a model that states none: no error is small enough for float32


class CustomEntry(ReflectionEntry):
    """A model of one's own: what its class says, a `registries.CustomReflection`.

    Where it says no bound it is drawn in float64, and no bound is stated.
    """

    def __init__(self, model: Any) -> None:
        self._function = pipeline.ReflectionFunction(
            pipeline.function_of_reflection(type(model).reflect), model.needs_view, model.has_highlight
        )
        self.has_bound = model.bound is not None
        self._bound = model.bound or UNKNOWN

    def function(self, material: Any) -> pipeline.ReflectionFunction:
        """Return the function of the formula."""
        return self._function

    def brightest_highlight(self, material: Any) -> float:
        """Return the largest S that the model states."""
        return self._bound.highlight

    def diffuse_slope(self, material: Any) -> float:
        """Return what the model states beyond Lambert's slope of 1."""
        return max(self._bound.turn - 1.0, 0.0)

    def turn_slope(self, material: Any, u: float) -> float:
        """Return what the model states, for a highlight of height 1."""
        return self._bound.turn / max(self._bound.highlight, 1e-30)

    def highlight_rounding(self, material: Any, u: float) -> float:
        """N, L and V err by 8 u at most, which turns the model by three times that; and its own operations."""
        return (24.0 * self._bound.turn + 16.0) * u


# By the words of scene.material.REFLECTION_MODELS.
REFLECTION_TABLE: dict[str, ReflectionEntry] = {
    "phong": PhongEntry(),
    "blinn": BlinnEntry(),
    "lambert": LambertEntry(),
    "oren-nayar": OrenNayarEntry(),
    "cook-torrance": CookTorranceEntry(),
    "toon": ToonEntry(),
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


def has_highlight(material: Any) -> bool:
    """Tell whether a material has a highlight."""
    return entry_of(material).has_highlight(material)


def highlight_height(material: Any) -> float:
    """Return the largest value of a material's highlight where `specular` is 1; 0 where it has none."""
    entry = entry_of(material)
    return entry.brightest_highlight(material) if entry.has_highlight(material) else 0.0


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
    if not has_highlight(material):
        return 1
    entry = entry_of(material)
    if not entry.function(material).has_fresnel or (material.fresnel is None and entry.default_fresnel == 1.0):
        return 2
    return 4 if is_metallic(material) else 3


def fresnel_of(material: Any) -> Any:
    """Return F0 of a material's specular reflection function W(θ): a number, a colour or a Spectrum."""
    return entry_of(material).default_fresnel if material.fresnel is None else material.fresnel


def has_hued_fresnel(material: Any) -> bool:
    """Tell whether a highlight has a colour beside that of `specular`: F0 is one, or a metal's."""
    return count_terms(material) > 2 and (is_metallic(material) or isinstance(material.fresnel, tuple))


def blinn_scale(material: Any) -> float:
    """Return the factor (n + 2)(n + 4)/(8 (2^(-n/2) + n)) of a normalised highlight, 0 for a classic one.

    Source: Giesen 2009, Phong Normalization Factor derivation.
    """
    n = material.shininess
    return (n + 2) * (n + 4) / (8 * (2 ** (-n / 2) + n)) if material.normalized else 0.0


def weight_slope(material: Any) -> float:
    """Return the slope of the weights of a power: 5 of W(θ), 1 of N·L where the highlight is normalised."""
    return 5.0 * (material.fresnel is not None) + 1.0 * material.normalized


def power_slope(exponent: float) -> float:
    """Return the largest n h^(n-1)·|R - V| with h = R·V = 1 - |R - V|²/2; with n < 1 for h >= MIN_BASE.

    With s = |R - V|/2 it is 2 n (1 - 2 s²)^(n-1)·s, largest where s² = 1/(4 n - 2): √2 for n = 1, 0.61 √n for large n.
    For n < 1 it is largest at MIN_BASE, where |R - V| is √2 at most.
    """
    if exponent < 1.0:
        return math.sqrt(2.0) * exponent * MIN_BASE ** (exponent - 1.0)
    return 0.7 * math.sqrt(exponent) + 0.72
