"""How far rounding can move an intensity: the terms of `Stats.error_bound`, and the steps next to which there is no
bound.

u is the unit roundoff, 2^-24 in float32 and 2^-53 in float64; errors of the first order in u are counted, all with the
worst sign. Errors of directions are angles, in radians. Lit points are those of the polygons as they lie on the screen,
with vertices rounded to 1/256 px.

A unit vector is found as v·(1/√(v·v)), which changes its length by 4.5 u (3 u of the square, halved, two operations, a
product) and its direction by u, beside what was rounded before:

    N       2 u beside the length: copied and scaled
    L       2 u, of which the light's position is not a part: see `position_error`
    V       8 u: the ray through the sample errs by 7 u (shade.py)
    N·L     6.5 u of N, 6.5 u of L, 3 u of the product: 16 u. With attenuation (5 u), coefficients and colours: LIT

What becomes of these errors in a light's strength and in a highlight, the tables of lights and of reflection models
know (engine/light_table.py, engine/reflection_table.py).
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..pipeline.transform import DEPTH_MARGIN, Screen
from . import light_table, reflection_table
from .intensity_bounds import Reflected
from .rounding import DOUBLE, SINGLE, Step, times

# In units of u:
LIT = 24  # a diffuse term
INTERPOLATED = 7  # the mean of three corners
WRITTEN = 6  # a pixel over a background, in float32
ROUGH = 20  # the cosines of Oren-Nayar's formula
CONE = 12  # the cosine of the angle from a spot light's axis
CORNERS = 7  # an interpolated normal: corners, weights (two), products, sums (two), one more for the sum of the weights
POINTS = 2  # the position of a vertex, over its distance from the eye
SAMPLES = 20  # that of a sample: 10 u of w, its inverse, its ray, a product
# Shares:
LEAST_SHARE = 2.0**-20  # a light nearer to a surface than this share of the scene's depth counts as on it
LEAST_NORMAL = 2.0**-20  # an interpolated normal shorter than this counts as none


class Surroundings(NamedTuple):
    """What a view says about the positions of lights and surfaces."""

    furthest: float  # distance of the furthest point from the eye, scene units
    clearances: NDArray[np.float64]  # (n_light,): see `LightEntry.clearance`; inf for a directional light
    shortest: float  # the least length of a normal that is interpolated; 1 where none is
    is_lit_per_sample: bool
    deepness: float = 0.0  # the furthest depth over the nearest one that is seen; 0 without perspective
    shadow_shift: float = 0.0  # scene units: how far float32 moves what shadows are asked for, see shadow_views.py

    def rounded(self) -> "Surroundings":
        """Return the same, lengths rounded to an eighth of an octave, to the unsafe side.

        Without lights that have a position the furthest point counts only as far as its square may leave float32. So a
        camera that moves finds much the same again.
        """
        with np.errstate(divide="ignore"):
            clearances = np.exp2(np.floor(8.0 * np.log2(self.clearances)) / 8.0)
        furthest = 2.0 ** (math.ceil(8.0 * math.log2(self.furthest)) / 8.0) if self.furthest > 0.0 else 0.0
        if np.isinf(clearances).all() and 2.0**-30 < furthest < 2.0**50:
            furthest = 1.0
        deepness = 2.0 ** math.ceil(math.log2(self.deepness)) if self.deepness > 2.0**20 else 0.0
        shift = self.shadow_shift
        if 0.0 < shift < math.inf:
            shift = 2.0 ** (math.ceil(8.0 * math.log2(shift)) / 8.0)
        return self._replace(furthest=furthest, clearances=clearances, deepness=deepness, shadow_shift=shift)

    def kept(self) -> "Surroundings":
        """Return the same without points that lie on a light, and normals that vanish: next to these nothing is
        bounded."""
        least = max(LEAST_SHARE * self.furthest, np.finfo(float).tiny)
        return self._replace(clearances=np.maximum(self.clearances, least), shortest=max(self.shortest, LEAST_NORMAL))


def frame_error(reflected: Reflected, surroundings: Surroundings, u: float) -> float:
    """Return what rounding adds to an intensity of one frame at most, normals interpolated exactly."""
    surroundings = surroundings.kept()
    deep = 2.0 * depth_rounding(surroundings)
    error = lighting_error(reflected, u) + position_error(reflected, surroundings, u) + deep * reflected.bound
    if surroundings.is_lit_per_sample:
        error += normal_error(reflected, (CORNERS * u + deep) / surroundings.shortest)
    return min(error, reflected.bound)


def lighting_error(reflected: Reflected, u: float) -> float:
    """Return what rounding adds to an intensity at most, wherever lights and surfaces are."""
    given = reflected.diffuse + reflected.specular
    total = reflected.undirected + given.sum(axis=1)
    # The sum over the lights is taken one after the other: each of them is rounded once for each that follows. An F0
    # with a colour has two terms for each light.
    is_colored = any(reflection_table.has_colored_fresnel(material) for material in reflected.materials)
    n_term = given.shape[1] * (2 if is_colored else 1)
    error = u * (LIT + INTERPOLATED + n_term) * total
    error += u * ROUGH * times(reflected.diffuse_slopes, reflected.diffuse.sum(axis=1))
    error += times(given, np.minimum(1.0, CONE * u * reflected.steepnesses)).sum(axis=1)
    return float((error + highlight_error(reflected, u)).max(initial=0.0))


def highlight_error(reflected: Reflected, u: float) -> NDArray[np.float64]:
    """Return the part of `lighting_error` that is that of highlights, (n_material,)."""
    materials = reflected.materials
    heights = [reflection_table.entry_of(material).highlight_rounding(material, u) for material in materials]
    return times(reflected.specular.sum(axis=1), heights)


def normal_error(reflected: Reflected, angle: float) -> float:
    """Return what an error of the normals, in radians, adds to an intensity at most."""
    parts = []
    for k, material in enumerate(reflected.materials):
        highlight = reflection_table.entry_of(material).highlight_change(material, angle)
        diffuse = min(1.0, (1.0 + reflected.diffuse_slopes[k]) * angle)
        parts.append(diffuse * reflected.diffuse[k].sum() + float(times(highlight, reflected.specular[k].sum())))
    return max(parts, default=0.0)


def position_error(reflected: Reflected, surroundings: Surroundings, u: float) -> float:
    """Return what the rounding of positions adds to an intensity at most.

    Positions are relative to the eye, and err by k·u of the furthest distance F from it, with k as POINTS or SAMPLES
    says; as the light's position does. Over the distance d from the light that is the angle by which the light's
    direction is off. It moves N·L and a highlight as a turn of the normal does, and the attenuation by at most twice
    its share: d² is in it.
    """
    k = SAMPLES if surroundings.is_lit_per_sample else POINTS
    with np.errstate(over="ignore"):
        angles = (k * u + 2.0 * depth_rounding(surroundings)) * surroundings.furthest / surroundings.clearances
    cone = np.minimum(1.0, times(reflected.steepnesses, angles))
    error = 0.0
    for m, material in enumerate(reflected.materials):
        diffuse = np.minimum(1.0, (3.0 + reflected.diffuse_slopes[m]) * angles)
        highlight = reflection_table.entry_of(material).highlight_change(material, angles, beside=2.0)
        given = reflected.diffuse[m] + reflected.specular[m]
        parts = times(reflected.diffuse[m], diffuse) + times(reflected.specular[m], highlight) + times(given, cone)
        error = max(error, float(parts.sum()))
    return error


def depth_rounding(surroundings: Surroundings) -> float:
    """Return the relative error of 1/w.

    It is kept beside an offset, as a z-buffer's depth in float64, and so rounded to 2^-53 of the nearest one twice. In
    a face at the depth w that is 2^-52 · w/near of it. The weights of its corners, which are products with 1/w, are off
    by as much, so what is interpolated is off by twice that of its range; so is the position of a sample.
    """
    return DOUBLE * 2.0 * surroundings.deepness


def furthest_over_nearest(screen: Screen, furthest: float) -> float:
    """Return how many times as far as the nearest depth that a z-buffer has room for the furthest point is.

    Parameters
    ----------
    screen : one with perspective
    furthest : distance of the furthest point from the eye, scene units
    """
    if screen.z_scale == 0.0:
        return 1.0
    return max(1.0, min(furthest, screen.far) * (DEPTH_MARGIN - screen.z_offset) / screen.z_scale)


def list_steps(plan: Any, surroundings: Surroundings) -> tuple[Step, ...]:
    """List the steps in what a frame shows, and how near to each of them its bound doesn't hold.

    Parameters
    ----------
    plan : Plan (engine/plan.py)
    """
    u = SINGLE if plan.dtype == np.float32 else DOUBLE
    steps = _material_steps(plan, u)
    steps += [step for light in plan.lights for step in light_table.entry_of(light).steps(light, u)]
    steps += _shadow_steps(plan, surroundings)
    if any(m.texture is not None and m.texture.filter == "nearest" for m in plan.materials):
        steps.append(Step("the border between texels that are not blended", 2.0**-20, "texels"))
    least = LEAST_SHARE * surroundings.furthest
    if (surroundings.clearances < least).any():
        steps.append(Step("a light on a surface", least, "scene units"))
    if surroundings.is_lit_per_sample and surroundings.shortest < LEAST_NORMAL:
        steps.append(Step("an interpolated normal without length", LEAST_NORMAL, "of its length"))
    return tuple(dict.fromkeys(steps))  # each cause once


def _shadow_steps(plan, surroundings) -> list[Step]:
    """The edges of shadows, whose exact ones are those of rays from the lights.

    A point is compared with texels whose centres lie within half the filter of it, along each axis of the map; the
    map's vertices are rounded to a 512th of a texel, float32 moves a point by `shadow_shift`. So what rises from the
    surface towards the light, as a wall does from a floor, hides that much of it. What lies before the surface by less
    than its depth changes over a texel isn't seen; nor what a normal offset carries the point across
    (pipeline/shadow_lookup.py).
    """
    taps = [light_table.shadow_of(light).filter for light in plan.lights if light_table.shadow_of(light) is not None]
    if not taps:
        return []
    cause = "the edge of a shadow, or a fold towards its light"
    steps = [Step(cause, (max(taps) + 1) / 2, "texels of the shadow map")]
    if plan.dtype == np.float32:
        steps.append(Step("the edge of a shadow in float32", surroundings.shadow_shift, "scene units beside that"))
    unit = "times what the surface's depth changes by over a texel, and its normal offset"
    steps.append(Step("what casts a shadow next to the surface", 1.0, unit))
    return steps


def _material_steps(plan, u) -> list[Step]:
    """The steps of the reflection models: of diffuse terms, where there is a light, then of highlights that are lit; in
    the order of the table, whatever that of the materials."""
    has_lit_highlight = plan.reflected.specular.any(axis=1)
    diffuse, highlights = [], []
    for entry in reflection_table.REFLECTION_TABLE.values():
        for material, is_lit in zip(plan.materials, has_lit_highlight, strict=True):
            if reflection_table.entry_of(material) is entry:
                diffuse += entry.diffuse_steps(material, u) if plan.lights else ()
                highlights += entry.highlight_steps(material, u) if is_lit else ()
    return diffuse + highlights
