"""How far rounding can move an intensity: the terms of `Stats.error_bound`, and the steps next to which there is no
bound.

u is the unit roundoff, 2^-24 in float32 and 2^-53 in float64; errors of the first order in u are counted, all with the
worst sign. Errors of directions are angles, in radians. Lit points are those of the polygons as they lie on the screen,
with vertices rounded to 1/256 px.

A unit vector is found as v·(1/√(v·v)), which changes its length by 4.5 u (3 u of the square, halved, two operations, a
product) and its direction by u, beside what was rounded before:

    N 2 u beside the length: copied and scaled      L 2 u, of which the place of the light is not a part: see `of_lights`
    V 8 u: the ray through the sample errs by 7 u (shade.py)

    N·L     6.5 u of N, 6.5 u of L, 3 u of the product: 16 u. With attenuation (5 u), coefficients and colours: LIT
    (R·V)^n R = 2 (N·L) N - L errs by 2·16 + 2·6.5 + 6.5 + 3 u, V by 12.5 u, R - V by 68 u = e. With h = 1 - |R - V|²/2
    the
            power moves by n h^(n-1)·|R - V|·e, at most (0.7 √n + 0.72)·e (`slope`), plus 1.5 n u by the rounding of h
            and the product of n factors, plus 4 u
    (N·H)^n H errs by (6.5 + 12.5 + 1)/|L + V| + 5.5 u, N - H by 13 + 20/|L + V| u. That has no limit where L = -V,
    which is
            a step of Blinn's model: the highlight of a light straight ahead on the horizon may have any size. The bound
            holds where |L + V| is at least LEAST_SUM
    h^n with n < 1 is steep at 0 without limit, but |(h + e)^n - h^n| <= e^n, so that is taken; such scenes are drawn in
    float64
"""

import math
from typing import NamedTuple

import numpy as np

from ..scene.lights import DirectionalLight, SpotLight
from .intensity_bounds import (
    cone_cosines,
    has_colored_fresnel,
    has_highlight,
    highlight_bounds,
    matte_magnification,
    model_of,
)

SINGLE, DOUBLE = 2.0**-24, 2.0**-53  # u of float32 and float64
LIT, INTERPOLATED, WRITTEN = (
    24,
    7,
    6,
)  # u: of a matte term, of the mean of three corners, of a pixel over a background in float32
REFLECTED = 68  # u: see above
ROUGH = 20  # u: the cosines of Oren-Nayar's formula
CONE = 12  # u: the cosine of the angle from a spot light's axis
MIRRORS = 30  # u: the half vector of Cook-Torrance, whose highlight shrinks with N·L as |L + V| does
LEAST_SUM = {SINGLE: 2.0**-3, DOUBLE: 2.0**-20}  # |L + V| from which the bound of Blinn's highlight holds
CORNERS = 7  # u: the normal that is interpolated exactly: corners, weights (two), products, sums (two), one more for their sum
POINTS, SAMPLES = (
    2,
    20,
)  # u: a point's place, over its distance: a vertex; a sample: 10 u of w, its inverse, its ray, a product
LEAST_SHARE = 2.0**-20  # a light nearer to a surface than this share of the scene's depth counts as on it
LEAST_NORMAL = 2.0**-20  # an interpolated normal shorter than this counts as none
EXPONENTS = ("phong", "blinn", "weighted phong", "weighted blinn")  # models whose highlight is a power


class Step(NamedTuple):
    """Where a picture may jump, so that no error is small: points on the other side of it by rounding are no part of
    the bound."""

    cause: str
    near: float  # how near to the step the bound doesn't hold
    unit: str  # of `near`


class Reflected(NamedTuple):
    """How bright a scene's lights make its materials at most, linear intensity, the largest of all channels."""

    rest: np.ndarray  # (n_material,) float64: what needs no light with a direction: ambient and emissive
    matte: np.ndarray  # (n_material, n_light)
    shine: np.ndarray  # (n_material, n_light): highlights
    rough: np.ndarray  # (n_material,): how far the matte reflection magnifies errors of directions, beyond Lambert's
    steep: np.ndarray  # (n_light,): how far the factors of cone and range magnify an error of the light's direction
    materials: tuple

    @property
    def bound(self) -> float:
        """The largest intensity that any point can have."""
        with np.errstate(over="ignore"):  # infinite where no bound holds
            return float((self.rest + self.matte.sum(axis=1) + self.shine.sum(axis=1)).max(initial=0.0))

    @property
    def turned(self) -> float:
        """What an intensity changes by, at most, for each radian that the normal turns; infinite where that has no
        limit."""
        slopes = [turn_slope(material) for material in self.materials]
        return float(
            ((1.0 + self.rough) * self.matte.sum(axis=1) + times(self.shine.sum(axis=1), slopes)).max(initial=0.0)
        )

    def amplified(self, most) -> "Reflected":
        """The same under lights that are amplified by `most` (n_light,)."""
        return self._replace(matte=times(self.matte, most), shine=times(self.shine, most))


class Surroundings(NamedTuple):
    """What a view says about the places of lights and surfaces."""

    furthest: float  # distance of the furthest point from the eye, scene units
    clearances: (
        np.ndarray
    )  # (n_light,): distance that no lit point comes nearer to a light than; inf for a directional one
    shortest: float  # the least length of a normal that is interpolated; 1 where none is
    is_lit_per_sample: bool
    deepness: float = (
        0.0  # how many times as far as the nearest depth that is seen the furthest is; 0 without perspective
    )

    def rounded(self) -> "Surroundings":
        """The same, lengths rounded to an eighth of an octave, to the unsafe side; without lights that have a place the
        furthest point counts only as far as its square may leave float32. So a camera that moves finds much the same
        again."""
        with np.errstate(divide="ignore"):
            clearances = np.exp2(np.floor(8.0 * np.log2(self.clearances)) / 8.0)
        furthest = 2.0 ** (math.ceil(8.0 * math.log2(self.furthest)) / 8.0) if self.furthest > 0.0 else 0.0
        if np.isinf(clearances).all() and 2.0**-30 < furthest < 2.0**50:
            furthest = 1.0
        deepness = 2.0 ** math.ceil(math.log2(self.deepness)) if self.deepness > 2.0**20 else 0.0
        return self._replace(furthest=furthest, clearances=clearances, deepness=deepness)

    def kept(self) -> "Surroundings":
        """The same without points that lie on a light, and normals that vanish: next to these nothing is bounded."""
        least = max(LEAST_SHARE * self.furthest, np.finfo(float).tiny)
        return self._replace(clearances=np.maximum(self.clearances, least), shortest=max(self.shortest, LEAST_NORMAL))


def times(a, b) -> np.ndarray:
    """Products in which 0 times infinity is 0: a light that gives nothing can't be amplified."""
    a, b = np.broadcast_arrays(np.asarray(a, float), np.asarray(b, float))
    with np.errstate(invalid="ignore"):
        return np.where((a == 0.0) | (b == 0.0), 0.0, a * b)


def find_reflected(materials, lights, ambient, most_albedo, products=None) -> Reflected:
    """Find how bright each light makes each material at most, where nothing is amplified.

    Parameters
    ----------
    ambient : (3,) float64, the sum of the ambient lights
    most_albedo : largest component of the colours that multiply what materials reflect, textures' included
    products : those of spectra (engine/spectral_products.py), in which the exposure is included, or None
    """
    rest = np.array([max(m.ambient) * ambient.max() * most_albedo + max(m.emissive) for m in materials])
    colors = np.array([max(light.color) for light in lights], float)
    matte = np.array([max(m.diffuse) for m in materials])[:, None] * colors
    shine = np.array([max(m.specular) for m in materials])[:, None] * colors
    if products is not None:
        rest = np.abs(products.ambient).max(axis=1) * most_albedo + np.abs(products.emissive).max(axis=1)
        matte, shine = (
            np.abs(products.diffuse).max(axis=2),
            (np.abs(products.specular) + np.abs(products.grazing)).max(axis=2),
        )
    peaks = np.array([highlight_bounds(m)[0] if has_highlight(m) else 0.0 for m in materials])
    rough = np.array([matte_magnification(m) for m in materials])
    steep = np.array([steepness(light) for light in lights], float)
    return Reflected(rest, matte * most_albedo, shine * peaks[:, None], rough, steep, tuple(materials))


def find_most(lights, clearances=None) -> np.ndarray:
    """How much each light amplifies at most (n_light,), where no lit point is nearer to it than its clearance; 1 for
    most."""
    most = np.ones(len(lights))
    distances = np.zeros(len(lights)) if clearances is None else clearances
    for k, (light, distance) in enumerate(zip(lights, distances, strict=True)):
        if getattr(light, "amplify", False) and light.attenuation[0] < 1.0:
            constant, linear, quadratic = light.attenuation
            total = constant + times(linear, distance) + times(quadratic, distance) * distance
            most[k] = max(1.0, 1.0 / total) if total > 0.0 else np.inf
    return most


def slope(exponent) -> float:
    """The largest n h^(n-1)·|R - V| with h = R·V = 1 - |R - V|²/2, for n >= 1.

    With s = |R - V|/2 it is 2 n (1 - 2 s²)^(n-1)·s, largest where s² = 1/(4 n - 2): √2 for n = 1, 0.61 √n for large n.
    """
    return 0.7 * np.sqrt(exponent) + 0.72


def turn_slope(material) -> float:
    """What a highlight of height 1 changes by, at most, for each radian that the normal turns; infinite for h^n with n
    < 1.

    The mirrored light turns twice as far as the normal. W(θ) rises by 5 at most, N·L by 1; Cook-Torrance: see
    `highlight_bounds`.
    """
    if not has_highlight(material) or material.reflection == "toon":
        return 0.0
    if model_of(material) not in EXPONENTS:
        return highlight_bounds(material)[1]
    if material.shininess < 1.0:
        return np.inf
    twice = 2.0 if material.reflection == "phong" else 1.0
    return twice * slope(material.shininess) + 5.0 * (material.fresnel is not None) + 1.0 * material.normalized


def highlight_rounding(material, u) -> float:
    """How far a highlight of height 1 is off by rounding, at most 1; see the head of this file."""
    if not has_highlight(material) or material.reflection == "toon":
        return 0.0
    if model_of(material) not in EXPONENTS:
        return min(1.0, MIRRORS * u * highlight_bounds(material)[1])
    n, error = material.shininess, REFLECTED * u
    if material.reflection == "blinn":
        error = (13.0 + 20.0 / LEAST_SUM[u]) * u
    if n < 1.0:
        return min(1.0, (1.5 * error) ** n + 4.0 * u)
    weights = 16.0 * u * (5.0 * (material.fresnel is not None) + 1.0 * material.normalized)
    return min(1.0, slope(n) * error + (1.5 * n + 4.0) * u + weights)


def steepness(light) -> float:
    """How far the factors of a light's cone and range magnify an error of its direction, or a relative one of its
    distance.

    S = t² (3 - 2 t) rises by at most 3/2 of what t does, so S^p, p >= 1, by 3p/2; for 1/2 <= p < 1 the slope
    6 p t^(2p-1) (1 - t) (3 - 2 t)^(p-1) is at most 6p, because the last three factors are at most 1; below 1/2 it has
    no bound. (d/r)^4 rises by four times the relative error of d. c^e rises by at most e c^(e-1):
    by e for e >= 1, else most at the outer cone; where that is at 90 degrees it is multiplied by S^p, with p >= 1 at
    most t² (3 - 2 t) <= 3 (c/c_inner)². Infinite for a sharp cone: its edge is a step.
    """
    total = 4.0 if getattr(light, "range", None) is not None else 0.0
    if isinstance(light, SpotLight):
        inner, outer = cone_cosines(light)
        p, exponent = light.falloff, light.exponent
        rise = 1.5 * p if p >= 1.0 else 6.0 * p if p >= 0.5 else np.inf
        total += rise / (inner - outer) if inner > outer else np.inf
        if 0.0 < exponent < 1.0:
            at_edge = 3.0 / inner**2 if inner > 0.0 and p >= 1.0 else np.inf
            exponent *= min(outer ** (exponent - 1.0) if outer > 1e-15 else np.inf, at_edge)
        total += exponent
    return total


def lighting_error(reflected, u) -> float:
    """What rounding adds to an intensity at most, wherever lights and surfaces are."""
    given = reflected.matte + reflected.shine
    total = reflected.rest + given.sum(axis=1)
    # The sum over the lights is taken one after the other: each of them is rounded once for each that follows. A
    # coloured F0 has two terms for each light.
    n_term = given.shape[1] * (2 if any(has_colored_fresnel(material) for material in reflected.materials) else 1)
    error = u * (LIT + INTERPOLATED + n_term) * total
    error += u * ROUGH * times(reflected.rough, reflected.matte.sum(axis=1))
    error += times(given, np.minimum(1.0, CONE * u * reflected.steep)).sum(axis=1)
    return float((error + highlights_error(reflected, u)).max(initial=0.0))


def highlights_error(reflected, u) -> np.ndarray:
    """The part of `lighting_error` that is that of highlights, (n_material,)."""
    return times(reflected.shine.sum(axis=1), [highlight_rounding(material, u) for material in reflected.materials])


def turning_error(reflected, angle) -> float:
    """What an error of the normals, in radians, adds to an intensity at most."""
    parts = []
    for k, material in enumerate(reflected.materials):
        by = min(1.0, float(times(turn_slope(material), angle)))
        if material.shininess < 1.0 and model_of(material) in EXPONENTS:
            by = min(1.0, (3.0 * angle) ** material.shininess)  # |R - V| <= 2, see the head of this file
        matte = min(1.0, (1.0 + reflected.rough[k]) * angle)
        parts.append(matte * reflected.matte[k].sum() + float(times(by, reflected.shine[k].sum())))
    return max(parts, default=0.0)


def depth_rounding(surroundings) -> float:
    """The relative error of 1/w: it is kept beside an offset, as a z-buffer's depth in float64, and so rounded to 2^-53
    of the nearest one twice. In a face at the depth w that is 2^-52 · w/near of it. The weights of its corners, which
    are products with 1/w, are off by as much, so what is interpolated is off by twice that of its range; so is the
    place of a sample."""
    return DOUBLE * 2.0 * surroundings.deepness


def placing_error(reflected, surroundings, u) -> float:
    """What the rounding of positions adds to an intensity at most.

    Positions are relative to the eye, and err by k·u of the furthest distance F from it, with k as POINTS or SAMPLES
    says; as the light's place does. Over the distance d from the light that is the angle by which the light's direction
    is off. It moves N·L and a highlight as a turn of the normal does, and the attenuation by at most twice its share:
    d² is in it.
    """
    k = SAMPLES if surroundings.is_lit_per_sample else POINTS
    with np.errstate(over="ignore"):
        angle = (k * u + 2.0 * depth_rounding(surroundings)) * surroundings.furthest / surroundings.clearances
    error = 0.0
    for m, material in enumerate(reflected.materials):
        bend = np.minimum(1.0, (3.0 + reflected.rough[m]) * angle)
        shine = np.minimum(1.0, times(turn_slope(material) + 2.0, angle))
        if material.shininess < 1.0 and model_of(material) in EXPONENTS:
            shine = np.minimum(1.0, (3.0 * angle) ** material.shininess + 2.0 * angle)
        cone = np.minimum(1.0, times(reflected.steep, angle))
        given = reflected.matte[m] + reflected.shine[m]
        error = max(
            error,
            float((times(reflected.matte[m], bend) + times(reflected.shine[m], shine) + times(given, cone)).sum()),
        )
    return error


def frame_error(reflected, surroundings, u) -> float:
    """What rounding adds to an intensity of one frame at most, normals interpolated exactly."""
    surroundings = surroundings.kept()
    deep = 2.0 * depth_rounding(surroundings)
    error = lighting_error(reflected, u) + placing_error(reflected, surroundings, u) + deep * reflected.bound
    if surroundings.is_lit_per_sample:
        error += turning_error(reflected, (CORNERS * u + deep) / surroundings.shortest)
    return min(error, reflected.bound)


def list_steps(plan, surroundings) -> tuple[Step, ...]:
    """The steps in what a frame shows, and how near to each of them its bound doesn't hold."""
    u = SINGLE if plan.dtype == np.float32 else DOUBLE
    cosine = 2.0**-19 if u == SINGLE else 2.0**-39  # twice what counts as 0, see `grazing` in pipeline/power.py
    shiny = [m for m, lit in zip(plan.materials, plan.reflected.shine.any(axis=1), strict=True) if lit]
    classic = [m for m in shiny if m.reflection in ("phong", "blinn") and not m.normalized]
    steps = []
    if any(m.reflection == "toon" for m in plan.materials) and plan.lights:
        steps.append(Step("a toon's levels", cosine, "cosine of an angle"))
    if classic:
        steps.append(Step("a highlight ends where its light grazes the surface, N·L = 0", cosine, "cosine of an angle"))
    if any(m.reflection == "blinn" for m in classic):
        steps.append(Step("Blinn's half vector, where the light is opposite to the viewer", LEAST_SUM[u], "|L + V|"))
    if any(model_of(m) == "ggx" for m in shiny):
        steps.append(
            Step("Cook-Torrance where a normal looks away from the viewer, N·H = 0", cosine, "cosine of an angle")
        )
    if any(isinstance(light, SpotLight) and light.inner == light.outer for light in plan.lights):
        steps.append(Step("the edge of a sharp spot light", cosine, "cosine of an angle"))
    if plan.has_shadows:
        steps.append(Step("the edge of a shadow", 1.0, "texels of the shadow map"))
    if any(m.texture is not None and m.texture.filter == "nearest" for m in plan.materials):
        steps.append(Step("the border between texels that are not blended", 2.0**-20, "texels"))
    least = LEAST_SHARE * surroundings.furthest
    if any(d < least and not isinstance(light, DirectionalLight)
           for d, light in zip(surroundings.clearances, plan.lights, strict=True)):  # fmt: skip
        steps.append(Step("a light on a surface", least, "scene units"))
    if surroundings.is_lit_per_sample and surroundings.shortest < LEAST_NORMAL:
        steps.append(Step("an interpolated normal without length", LEAST_NORMAL, "of its length"))
    return tuple(steps)
