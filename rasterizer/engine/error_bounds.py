"""How far rounding can move an intensity: the terms of `Stats.error_bound`, and the steps next to which there is no
bound.

u is the unit roundoff, 2^-24 in float32 and 2^-53 in float64; errors of the first order in u are counted, all with the
worst sign. Errors of directions are angles, in radians. Lit points are those of the polygons as they lie on the screen,
with vertices rounded to 1/256 px.

A unit vector is found as v·(1/√(v·v)), which changes its length by 4.5 u (3 u of the square, halved, two operations, a
product) and its direction by u, beside what was rounded before:

    N       2 u beside the length: copied and scaled
    L       2 u, of which the light's position is not a part: see `position_error`
    V       8 u: the ray through the sample errs by 7 u, with skew by more: see `frame_error` (phong_shading.py)
    N·L     6.5 u of N, 6.5 u of L, 3 u of the product: 16 u. With attenuation (5 u), coefficients and colours: LIT

What becomes of these errors in a light's strength and in a highlight, the tables of lights and of reflection models
know (engine/light_table.py, engine/reflection_table.py).
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..pipeline.planes import DEPTH_PLANE_ROUNDING
from ..pipeline.transform import DEPTH_BITS, DEPTH_MARGIN, Screen
from . import light_table, reflection_table
from .intensity_bounds import Reflected
from .reflection_entry import HighlightBounds
from .rounding import DOUBLE, SINGLE, Step, times

# In units of u:
LIT = 24  # a diffuse term
INTERPOLATED = 7  # the mean of three corners
WRITTEN = 6  # a pixel over a background, in float32
ROUGH = 20  # the cosines of Oren-Nayar's formula
CONE = 12  # the cosine of the angle from a spot light's axis
CORNERS = 7  # an interpolated normal: corners, weights (two), products, sums (two), one more for the sum of the weights
POINTS = 1  # the position of a vertex, over its distance from the eye
SAMPLES = 19  # that of a sample: 10 u of w, its inverse, 7 u of its ray, a product
# Shares:
LEAST_SHARE = 2.0**-20  # a light nearer to a surface than this share of the scene's depth counts as on it
LEAST_NORMAL = 2.0**-20  # an interpolated normal shorter than this counts as none


class Surroundings(NamedTuple):
    """What a view says about the positions of lights and surfaces."""

    furthest: float  # distance of the furthest point from the eye, scene units
    # (n_light,) or (n_material, n_light): see `LightEntry.clearance`; inf for a directional light
    clearances: NDArray[np.float64]
    shortest: float  # the least length of a normal that is interpolated; 1 where none is
    is_lit_per_sample: bool
    deepness: float = 0.0  # the furthest depth over the nearest one that is seen; 0 without perspective
    eye_distances: ArrayLike = np.inf  # (n_light,): of each light from the eye; inf where that is not known
    least_sums: ArrayLike = 0.0  # (n_material, n_light): |L + V| is nowhere less; 0 where that is not known
    shadow_shift: float = 0.0  # scene units: how far float32 moves what shadows are asked for, see shadow_views.py
    depth_shift: float = 0.0  # scene units: how far the depths of samples are off without perspective
    fading: float = 0.0  # how far off the share that depth cueing leaves of an intensity may be, in float32
    lean: float = 0.0  # of columns, by skew: |skew|/scale_x; 0 where no rays are asked for

    def rounded(self) -> "Surroundings":
        """Return the same, lengths rounded to an eighth of an octave and |L + V| to an eighth, to the unsafe side.

        Without lights that have a position the furthest point counts only as far as its square may leave float32. So a
        camera that moves finds much the same again.
        """
        clearances, eye_distances = self.clearances, self.eye_distances
        has_positions = not np.isinf(clearances).all()
        if has_positions:
            with np.errstate(divide="ignore"):
                clearances = np.exp2(np.floor(8.0 * np.log2(clearances)) / 8.0)
        if not np.isinf(eye_distances).all():
            with np.errstate(divide="ignore"):
                eye_distances = np.exp2(np.ceil(8.0 * np.log2(eye_distances)) / 8.0)
        furthest = 2.0 ** (math.ceil(8.0 * math.log2(self.furthest)) / 8.0) if self.furthest > 0.0 else 0.0
        if not has_positions and 2.0**-30 < furthest < 2.0**50:
            furthest = 1.0
        deepness = 2.0 ** math.ceil(math.log2(self.deepness)) if self.deepness > 2.0**20 else 0.0
        shift, depth_shift, fading = (
            2.0 ** (math.ceil(8.0 * math.log2(value)) / 8.0) if 0.0 < value < math.inf else value
            for value in (self.shadow_shift, self.depth_shift if has_positions else 0.0, self.fading)
        )
        return self._replace(
            furthest=furthest,
            clearances=clearances,
            deepness=deepness,
            eye_distances=eye_distances,
            least_sums=np.floor(8.0 * np.asarray(self.least_sums)) / 8.0,
            shadow_shift=shift,
            depth_shift=depth_shift,
            fading=fading,
            lean=2.0 ** math.ceil(math.log2(self.lean)) if self.lean > 0.0 else 0.0,
        )

    def kept(self) -> "Surroundings":
        """Return the same without points that lie on a light, and normals that vanish: next to these nothing is
        bounded."""
        least = max(LEAST_SHARE * self.furthest, np.finfo(float).tiny)
        return self._replace(clearances=np.maximum(self.clearances, least), shortest=max(self.shortest, LEAST_NORMAL))

    def key(self) -> tuple:
        """Return what tells the surroundings of two views apart."""
        arrays = (np.asarray(values) for values in (self.clearances, self.eye_distances, self.least_sums))
        numbers = self.furthest, self.deepness, self.shadow_shift, self.depth_shift, self.fading, self.lean
        return *numbers, *(values.tobytes() for values in arrays)


def frame_error(reflected: Reflected, surroundings: Surroundings, u: float) -> NDArray[np.float64]:
    """Return what rounding adds to an intensity of one frame at most, normals interpolated exactly; (n_material,).

    With skew a ray errs by 4·2^-53·lean of its length beside the 7 u (phong_shading.py), so V by no more than 8 u', and
    what is seen by 19 u', with u' = u + 2^-54·lean. No error grows faster than u.
    """
    surroundings = surroundings.kept()
    highlights = bound_highlights(reflected, u, surroundings.least_sums)
    bounds, deep = reflected.bounds, 2.0 * depth_rounding(surroundings)
    error = lighting_error(reflected, u, highlights) + position_error(reflected, surroundings, u, highlights)
    error += times(deep, bounds)
    if surroundings.is_lit_per_sample:
        error += normal_error(reflected, (CORNERS * u + deep) / surroundings.shortest, highlights)
    return np.minimum(error * (1.0 + 0.5 * surroundings.lean * DOUBLE / u), bounds)


def bound_highlights(reflected: Reflected, u: float, least_sums: ArrayLike) -> HighlightBounds:
    """Return what is known of the highlights of each material and light, (n_material, n_light).

    Parameters
    ----------
    least_sums : (n_material, n_light) or a number, see `Surroundings`
    """
    return reflected.highlights.look_up(u, np.broadcast_to(np.asarray(least_sums, float), reflected.specular.shape))


def lighting_error(reflected: Reflected, u: float, highlights: HighlightBounds | None = None) -> NDArray[np.float64]:
    """Return what rounding adds to an intensity at most, wherever lights and surfaces are; (n_material,).

    Parameters
    ----------
    highlights : what a view tells of them, see `bound_highlights`; None before there is one
    """
    specular = reflected.specular if highlights is None else reflected.specular * highlights.peaks
    given = reflected.diffuse + specular
    total = reflected.undirected + reflected.sum_lights(given)
    # The sum over the lights is taken one after the other: each of them is rounded once for each that follows. An F0
    # with a colour has two terms for each light.
    is_colored = any(reflection_table.has_colored_fresnel(material) for material in reflected.materials)
    n_term = reflected.sets.most_together * (2 if is_colored else 1)
    error = u * (LIT + INTERPOLATED + n_term) * total
    error += u * ROUGH * times(reflected.diffuse_slopes, reflected.sum_lights(reflected.diffuse))
    error += reflected.sum_lights(times(given, np.minimum(1.0, CONE * u * reflected.steepnesses)))
    return error + highlight_error(reflected, u, highlights)


def highlight_error(reflected: Reflected, u: float, highlights: HighlightBounds | None = None) -> NDArray[np.float64]:
    """Return the part of `lighting_error` that is that of highlights, (n_material,)."""
    if highlights is not None:
        return reflected.sum_lights(times(reflected.specular, highlights.roundings))
    heights = [reflection_table.entry_of(m).highlight_rounding(m, u) for m in reflected.materials]
    return times(reflected.sum_lights(reflected.specular), heights)


def normal_error(reflected: Reflected, angle: float, highlights: HighlightBounds) -> NDArray[np.float64]:
    """Return what an error of the normals, in radians, adds to an intensity at most, (n_material,)."""
    error = times(reflected.diffuse, np.minimum(1.0, (1.0 + reflected.diffuse_slopes) * angle)[:, None])
    changes = times(highlights.normal_slopes, angle)
    for m in _with_steep_powers(highlights):
        material = reflected.materials[m]
        changes[m] = reflection_table.entry_of(material).highlight_change(material, angle)
    return reflected.sum_lights(error + times(reflected.specular, np.minimum(1.0, changes)))


def position_error(
    reflected: Reflected, surroundings: Surroundings, u: float, highlights: HighlightBounds
) -> NDArray[np.float64]:
    """Return what the rounding of positions adds to an intensity at most, (n_material,).

    Positions are relative to the eye. That of a point errs by k·u of its distance |P| from the eye, with k as POINTS or
    SAMPLES says, and that of the light by u of its own, E. With the distance d between both, |P| is at most the
    furthest distance F, and at most E + d; E is at most F + d. So both together err by less than

        (k F + min(E, F))·u + [E > F]·u·d         and         (k + 1)·E·u + k·u·d

    Without perspective a sample's depth errs by `depth_shift` whatever its distance, which both sums have besides.

    The first part of such a sum moves light and point by a length, see `LightEntry.sway`: the direction turns by this
    over d. The second part turns it by an angle, or changes d by a share, that is the same at every distance. The turn
    moves a highlight as `light_slopes` says. The better of both sums is taken for each material and light.
    """
    if not reflected.lights:
        return np.zeros(len(reflected.materials))
    k = (SAMPLES if surroundings.is_lit_per_sample else POINTS) * u + 2.0 * depth_rounding(surroundings)
    shape, furthest = reflected.diffuse.shape, surroundings.furthest
    away = np.broadcast_to(np.asarray(surroundings.eye_distances, float), shape)
    clearances = np.broadcast_to(surroundings.clearances, shape)
    sways, turns = _sways_and_turns(reflected, clearances, highlights.light_slopes)
    shift = surroundings.depth_shift
    far = k * furthest + u * np.minimum(away, furthest) + shift, np.where(away > furthest, u, 0.0)
    near = (k + u) * away + shift, np.full(shape, k)
    of_diffuse, of_highlights = np.minimum(*(times(sways, a) + times(turns, b) for a, b in (far, near)))
    for m in _with_steep_powers(highlights):
        with np.errstate(over="ignore", invalid="ignore"):
            angles = np.minimum(*(length[m] / clearances[m] + angle[m] for length, angle in (far, near)))
        angles = np.where(np.isfinite(clearances[m]), angles, 0.0)
        material, steep = reflected.materials[m], 2.0 + reflected.steepnesses
        of_highlights[m] = reflection_table.entry_of(material).highlight_change(material, angles, steep)
    error = times(reflected.diffuse, np.minimum(1.0, of_diffuse))
    return reflected.sum_lights(error + times(reflected.specular, np.minimum(1.0, of_highlights)))


def _sways_and_turns(reflected, clearances, light_slopes) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What an error of positions that is a length, or an angle, of 1 does to diffuse terms and highlights of height 1,
    (2, n_material, n_light) each; 0 where positions play no part."""
    diffuse_slopes = np.broadcast_to(1.0 + reflected.diffuse_slopes[:, None], clearances.shape)
    slopes = np.stack([diffuse_slopes, light_slopes])
    sways = np.zeros(slopes.shape)
    has_position = np.isfinite(clearances)
    for i in np.flatnonzero(has_position.any(axis=0)):
        light, clearance = reflected.lights[i], clearances[:, i]
        with np.errstate(over="ignore", invalid="ignore"):
            sways[..., i] = light_table.entry_of(light).sway(light, clearance, slopes[..., i])
    turns = slopes + 2.0 + reflected.steepnesses
    return np.where(has_position, sways, 0.0), np.where(has_position, turns, 0.0)


def _with_steep_powers(highlights) -> NDArray[np.int64]:
    """The numbers of the materials whose highlight has no largest slope: exponents below 1."""
    return np.flatnonzero(~np.isfinite(highlights.light_slopes).all(axis=1))


def depth_rounding(surroundings: Surroundings) -> float:
    """Return the relative error of 1/w.

    It is kept beside an offset, as a z-buffer's depth in float64, and so rounded to 2^-53 of the nearest one twice. In
    a face at the depth w that is 2^-52 · w/near of it. The weights of its corners, which are products with 1/w, are off
    by as much, so what is interpolated is off by twice that of its range; so is the position of a sample.
    """
    return DOUBLE * 2.0 * surroundings.deepness


def straight_rounding(furthest: float) -> float:
    """Return how far a sample's depth is off without perspective, scene units.

    It is the mean of those of the corners, which are kept as those of a z-buffer: offset + step·z. It errs by 11 u S,
    S = |offset| + 2^38 |step| (pipeline/buffers.py). The offset is the depth of the nearest point, F at most, and what
    2^38 steps reach is the range of depths, twice that at most. A corner's depth is a product of three terms before, of
    differences that are rounded: 5 u√3 < 9 u of F.

    Parameters
    ----------
    furthest : F, distance of the furthest point from the eye, scene units
    """
    return 42.0 * DOUBLE * furthest


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


def list_steps(plan: Any, surroundings: Surroundings, fixed: tuple[Step, ...] | None = None) -> tuple[Step, ...]:
    """List the steps in what a frame shows, and how near to each of them its bound doesn't hold.

    Parameters
    ----------
    plan : Plan (engine/plan.py)
    fixed : what `list_fixed_steps` returns for the plan; None = it is found here
    """
    steps = list(list_fixed_steps(plan) if fixed is None else fixed)
    steps += _shadow_steps(plan, surroundings)
    if any(m.texture is not None and m.texture.filter == "nearest" for m in plan.materials):
        steps.append(Step("the border between texels that are not blended", 2.0**-20, "texels"))
    least = LEAST_SHARE * surroundings.furthest
    if (surroundings.clearances < least).any():
        steps.append(Step("a light on a surface", least, "scene units"))
    if surroundings.is_lit_per_sample and surroundings.shortest < LEAST_NORMAL:
        steps.append(Step("an interpolated normal without length", LEAST_NORMAL, "of its length"))
    return tuple(dict.fromkeys(steps))  # each cause once


def list_fixed_steps(plan: Any) -> tuple[Step, ...]:
    """List the steps that a plan has in every view: those of materials, then those of lights."""
    u = SINGLE if plan.dtype == np.float32 else DOUBLE
    steps = _material_steps(plan, u)
    steps += [step for light in plan.reflected_lights for step in light_table.entry_of(light).steps(light, u)]
    return tuple(dict.fromkeys(steps))


def _shadow_steps(plan, surroundings) -> list[Step]:
    """The edges of shadows, whose exact ones are those of rays from the lights.

    A point is compared with texels whose centres lie within half the filter of it, along each axis of the map; the
    map's vertices are rounded to a 512th of a texel, float32 moves a point by `shadow_shift`. So what rises from the
    surface towards the light, as a wall does from a floor, hides that much of it. What lies before the surface by less
    than its depth changes over a texel isn't seen; nor what a normal offset carries the point across
    (pipeline/shadow_lookup.py); nor what lies nearer than the map's depths are rounded to.
    """
    shadows = [light_table.shadow_of(light) for light in plan.reflected_lights]
    taps = [shadow.filter for shadow in shadows if shadow is not None]
    if not taps:
        return []
    cause = "the edge of a shadow, or a fold towards its light"
    steps = [Step(cause, (max(taps) + 1) / 2, "texels of the shadow map")]
    if plan.dtype == np.float32:
        steps.append(Step("the edge of a shadow in float32", surroundings.shadow_shift, "scene units beside that"))
    cause, unit = "what casts a shadow next to the surface", "times what the surface's depth changes by over a texel"
    steps.append(Step(cause, 1.0, f"{unit}, and its normal offset"))
    side = max(shadow.size + shadow.filter for shadow in shadows if shadow is not None)
    units = side + DEPTH_PLANE_ROUNDING  # as in engine/shadow_maps.py
    steps.append(Step(cause, units * 2.0**-DEPTH_BITS, "of the range of the map's depths, or of their inverses"))
    return steps


def _material_steps(plan, u) -> list[Step]:
    """The steps of the reflection models: of diffuse terms, where there is a light, then of highlights that are lit; in
    the order of the table, whatever that of the materials."""
    has_lit_highlight = plan.reflected.specular.any(axis=1).tolist()
    is_lit, numbers = bool(plan.is_lit.any()), {}
    for k, material in enumerate(plan.materials):
        numbers.setdefault(reflection_table.entry_of(material), []).append(k)
    diffuse, highlights = [], []
    for entry in reflection_table.REFLECTION_TABLE.values():
        for k in numbers.get(entry, ()):
            diffuse += entry.diffuse_steps(plan.materials[k], u) if is_lit else ()
            highlights += entry.highlight_steps(plan.materials[k], u) if has_lit_highlight[k] else ()
    return diffuse + highlights
