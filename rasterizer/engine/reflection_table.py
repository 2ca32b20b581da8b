"""What the engine knows of the reflection models: one class a model, one line a model in REFLECTION_TABLE.

Who asks, and for what:

    plan                which models need float64
    intensity_bounds    how bright a highlight is at most
    error_bounds        how far rounding moves it, and how far it moves when directions turn; where it jumps
    uniforms            the pipeline's functions, and the coefficients that these read
    spectral_products   whether a highlight is two sums, because its F0 has a colour

A model of one's own derives from ReflectionEntry and says only what is different; `rasterizer.registries` enters it
here and in the tables of the other layers. u is the unit roundoff throughout. The bounds of a highlight are those of
one whose largest value is 1:

    (R·V)^n R = 2 (N·L) N - L errs by 2·16 + 2·6.5 + 6.5 + 3 u, V by 12.5 u, R - V by 68 u = e. With h = 1 - |R - V|²/2
            the power moves by n h^(n-1)·|R - V|·e, at most (0.7 √n + 0.72)·e (`power_slope`), plus 1.5 n u by the
            rounding of h and the product of n factors, plus 4 u
    (N·H)^n H errs by (6.5 + 12.5 + 1)/|L + V| + 5.5 u, N - H by 13 + 20/|L + V| u. That has no limit where L = -V,
            which is a step of Blinn's model: the highlight of a light straight ahead on the horizon may have any size.
            The bound holds where |L + V| is at least LEAST_SUM
    h^n with n < 1 is steep at 0 without limit, but |(h + e)^n - h^n| <= e^n, so that is taken; such scenes are drawn in
            float64

The errors of N, L and V themselves: see engine/error_bounds.py.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError
from ..pipeline import reflection as pipeline
from .reflection_entry import HighlightBounds, ReflectionEntry
from .rounding import DOUBLE, SINGLE, Step, step_cosine, times

REFLECTED = 68  # u: of R - V, see above
MIRRORS = 30  # u: the half vector of Cook-Torrance, whose highlight shrinks with N·L as |L + V| does
LEAST_SUM = {SINGLE: 2.0**-3, DOUBLE: 2.0**-20}  # by u: |L + V| from which the bound of Blinn's highlight holds


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
        """Return that of tan β, which is cut off at LEAST_COSINE."""
        square = material.roughness**2
        return 0.45 * square / (square + 0.09) / pipeline.LEAST_COSINE


class PowerEntry(ReflectionEntry):
    """Lambert's diffuse term, and a highlight that is a power h^n: Phong's and Blinn's models."""

    is_lambert_when_dull = True
    turns = 1.0  # how many times as far as the normal the direction turns whose cosine h is

    def highlight_error(self, u: float, least_sum: ArrayLike = 0.0) -> ArrayLike:
        """Return the error of the vectors whose distance |R - V| or |N - H| gives h."""
        raise NotImplementedError

    def name(self, material: Any) -> str:
        """Return the pipeline's word for the function: another one where W(θ) or N·L weighs the highlight."""
        is_weighted = material.normalized or isinstance(material.fresnel, float)
        return f"weighted {material.reflection}" if is_weighted else material.reflection

    def function(self, material: Any) -> pipeline.ReflectionFunction:
        """Return the function of the power, with its weights where it has some."""
        return pipeline.reflection_function_of(self.name(material))

    def reason_for_float64(self, material: Any) -> str:
        """h^n with n < 1 is steep without limit at h = 0."""
        return "an exponent below 1" if material.shininess < 1.0 else ""

    def brightest_highlight(self, material: Any) -> float:
        """Return the scale, at least 1: h <= 1, W <= 1, also of an F0 with a colour, because F0 <= 1."""
        return max(self.highlight_scale(material), 1.0)

    def turn_slope(self, material: Any) -> float:
        """Return that of the power, of W(θ), which rises by 5 at most, and of N·L; infinite for n < 1."""
        if material.shininess < 1.0:
            return np.inf
        return self.turns * power_slope(material.shininess) + weight_slope(material)

    def highlight_rounding(self, material: Any, u: float) -> float:
        """Return what is said by `highlight_roundings` where nothing is known of |L + V|."""
        return float(self.highlight_roundings(material, u, np.zeros(1))[0])

    def highlight_bounds(self, material: Any, u: float, least_sums: NDArray[np.float64]) -> HighlightBounds:
        """Know more of the rounding where |L + V| is known."""
        bounds = super().highlight_bounds(material, u, least_sums)
        return bounds._replace(roundings=self.highlight_roundings(material, u, least_sums))

    def highlight_roundings(self, material: Any, u: float, least_sums: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what the head of this file derives, (n_light,)."""
        n, error = material.shininess, self.highlight_error(u, least_sums)
        if n < 1.0:
            return np.minimum(1.0, (1.5 * error) ** n + 4.0 * u) + 0.0 * least_sums
        found = power_slope(n) * error + (1.5 * n + 4.0) * u + 16.0 * u * weight_slope(material)
        return np.minimum(1.0, found) + 0.0 * least_sums

    def highlight_change(self, material: Any, angle: ArrayLike, beside: float = 0.0) -> NDArray[np.float64]:
        """Bound h^n with n < 1 by the power of the error itself: |R - V| <= 2, so h errs by 3 times the angle at
        most."""
        if material.shininess < 1.0:
            return np.minimum(1.0, (3.0 * angle) ** material.shininess + times(beside, angle))
        return super().highlight_change(material, angle, beside)

    def highlight_steps(self, material: Any, u: float) -> tuple[Step, ...]:
        """A classic highlight ends with a step; one that is normalised falls to 0 there."""
        if material.normalized:
            return ()
        cause = "a highlight ends where its light grazes the surface, N·L = 0"
        return (Step(cause, step_cosine(u), "cosine of an angle"),)


class PhongEntry(PowerEntry):
    """Phong's highlight: h = R·V."""

    turns = 2.0  # the mirrored light direction turns twice as far as the normal

    def light_slopes(self, material: Any, u: float, least_sums: NDArray[np.float64]) -> NDArray[np.float64]:
        """R turns as far as L does."""
        slope = power_slope(material.shininess) if material.shininess >= 1.0 else np.inf
        return np.full(least_sums.shape, slope + weight_slope(material))

    def highlight_error(self, u: float, least_sum: ArrayLike = 0.0) -> ArrayLike:
        """Return the error of R - V."""
        return REFLECTED * u

    def highlight_scale(self, material: Any) -> float:
        """Return (n + 2)/2. Source: Lafortune & Willems 1994, TR CW197, K.U. Leuven."""
        return (material.shininess + 2) / 2 if material.normalized else 0.0


class BlinnEntry(PowerEntry):
    """Blinn's highlight: h = N·H."""

    needs_least_sums = True

    def highlight_error(self, u: float, least_sum: ArrayLike = 0.0) -> ArrayLike:
        """Return the error of N - H where |L + V| is `least_sum`, but no less than LEAST_SUM."""
        return (13.0 + 20.0 / np.maximum(least_sum, LEAST_SUM[u])) * u

    def light_slopes(self, material: Any, u: float, least_sums: NDArray[np.float64]) -> NDArray[np.float64]:
        """H turns by 1/|L + V| of what L does across their plane, and by half of it within."""
        slope = power_slope(material.shininess) if material.shininess >= 1.0 else np.inf
        return slope / np.maximum(least_sums, LEAST_SUM[u]) + weight_slope(material)

    def highlight_scale(self, material: Any) -> float:
        """Return the factor of Blinn's highlight."""
        return blinn_scale(material)

    def highlight_steps(self, material: Any, u: float) -> tuple[Step, ...]:
        """Add that of the half vector, which a normalised highlight hides behind N·L = 0."""
        steps = super().highlight_steps(material, u)
        half = Step("Blinn's half vector, where the light is opposite to the viewer", LEAST_SUM[u], "|L + V|")
        return (*steps, half) if steps else ()


class CookTorranceEntry(ReflectionEntry):
    """Microscopic mirrors, tilted as GGX or Beckmann says; also more across a direction than along it."""

    is_lambert_when_dull = True
    default_fresnel = 0.04
    needs_least_sums = True

    def function(self, material: Any) -> pipeline.ReflectionFunction:
        """Return the function of the distribution, and of the direction along which the surface is brushed."""
        if material.is_anisotropic:
            return pipeline.reflection_function_of(
                "anisotropic ggx" if material.tangent == "u" else "anisotropic ggx by axis"
            )
        return pipeline.reflection_function_of(material.distribution)

    def reason_for_float64(self, material: Any) -> str:
        """Where the tangent nearly stands upright on the surface its projection has no bound."""
        return "brushed materials" if material.is_anisotropic else ""

    def brightest_highlight(self, material: Any) -> float:
        """Return the largest π D G / (4 N·V).

        GGX: π D <= 1/α², N·L G1(L)/(2 N·L) <= 1/2, G1(V)/(2 N·V) <= 1/α. Anisotropic: π D <= 1/(αx αy), and the root
        in G1(V) is at least the smaller α. Beckmann: π D has its maximum at tan² = max(0, 2 m² - 1), and
        G1(V)/N·V <= 3.535/m.
        """
        r = material.roughness
        if material.is_anisotropic:
            return 1.0 / (2.0 * r[0] * r[1] * min(r))
        if material.distribution == "ggx":
            return 1.0 / (2.0 * r**3)
        tangent_square = max(0.0, 2.0 * r * r - 1.0)
        return math.exp(-tangent_square / r**2) * (1.0 + tangent_square) ** 2 / r**3 * (3.535 / 4.0)

    def turn_slope(self, material: Any) -> float:
        """Return that of the mirrors: ln D rises by at most 2/α a radian, G by 1/α, W(θ) by 5; α is the smaller one,
        as far as the tangent stands still."""
        r = min(material.roughness) if material.is_anisotropic else material.roughness
        return 4.0 / r + 5.0

    def highlight_rounding(self, material: Any, u: float) -> float:
        """Return the error of the half vector, magnified."""
        return min(1.0, MIRRORS * u * self.turn_slope(material))

    def highlight_bounds(self, material: Any, u: float, least_sums: NDArray[np.float64]) -> HighlightBounds:
        """Return those of mirror_bounds.py for isotropic mirrors, over the largest value that the highlight counts
        with."""
        from .mirror_bounds import bound_lobe

        slope, brightest = self.turn_slope(material), self.brightest_highlight(material)
        if material.is_anisotropic:
            return super().highlight_bounds(material, u, least_sums)
        lobe = bound_lobe(material.distribution, material.roughness, least_sums)
        return HighlightBounds(
            peaks=np.minimum(1.0, lobe.peak / brightest),
            roundings=np.minimum(1.0, u * lobe.rounding / brightest),
            normal_slopes=np.minimum(slope, lobe.normal_slope / brightest),
            light_slopes=lobe.light_slope / brightest,
        )

    def highlight_steps(self, material: Any, u: float) -> tuple[Step, ...]:
        """GGX mirrors that are tilted by more than a right angle count as none. Where a normal looks away from the
        viewer, and the light is opposite to him, the highlight doesn't shrink as the half vector does."""
        if material.is_anisotropic:
            return ()
        opposite = "Cook-Torrance where a normal looks away from the viewer, the light opposite to him"
        steps = (Step(opposite, LEAST_SUM[u], "|L + V|"),)
        if material.distribution != "ggx":
            return steps
        cause = "Cook-Torrance where a normal looks away from the viewer, N·H = 0"
        return (Step(cause, step_cosine(u), "cosine of an angle"), *steps)


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

    def diffuse_steps(self, material: Any, u: float) -> tuple[Step, ...]:
        """Every level ends with a step, the highlight too."""
        return (Step("a toon's levels", step_cosine(u), "cosine of an angle"),)


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


def has_colored_fresnel(material: Any) -> bool:
    """Tell whether a material's F0 is a colour: then its highlight is two sums, see pipeline/fresnel.py."""
    is_colored = isinstance(material.fresnel, tuple) and has_highlight(material)
    return is_colored and entry_of(material).function(material).second_term is not None


def first_fresnel(material: Any) -> float:
    """Return F0 of a material's specular reflection function W(θ), as the pipeline's functions take it.

    With 1, W is 1: also of an F0 with a colour, which is part of what the sums are weighted with.
    """
    if material.fresnel is None:
        return entry_of(material).default_fresnel
    return 1.0 if isinstance(material.fresnel, tuple) else material.fresnel


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
    """Return the largest n h^(n-1)·|R - V| with h = R·V = 1 - |R - V|²/2, for n >= 1.

    With s = |R - V|/2 it is 2 n (1 - 2 s²)^(n-1)·s, largest where s² = 1/(4 n - 2): √2 for n = 1, 0.61 √n for large n.
    """
    return 0.7 * np.sqrt(exponent) + 0.72
