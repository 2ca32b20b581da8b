"""Where float32 is enough, and what is stated of a picture: one page.

A material is lit in float32 where all of this holds, else in float64:

    what                        float32                     why
    --------------------------  --------------------------  ----------------------------------------------------------
    tolerance                   above 0                     0 asks for float64
    exponent of a highlight     1 at least                  h^n with n < 1 is steep without limit at h = 0
    reflection model            no toon, nothing brushed,   next to a step of a toon no error is small; a tangent that
                                no metallic-roughness map   stands upright has no direction; maps make mirrors
    spot light                  no sharp edge               positions are carried across it
    lights and models           those of this package       nobody knows how a formula of one's own rounds
    intensities                 finite                      a light that amplifies without limit has no bound
    lengths                     2^-40 to 2^60               squares of others lose their digits
    furthest / nearest depth    2^22 at most                what depths lose of float64 must be less than a float32 does
    depth cue                   fades what z says of        a quarter of the tolerance is for that: `is_far`
                                depth by little
    shadows                     a point moves by 1/8 texel  else they show other shadows (shadow_maps.py)
    roundings                   half of the tolerance       see below; the other half is for planes and packed samples

What rounding adds to an intensity is 2^-24 times the sum of

    (30 + n/2) I                           coefficients and colours, the sum over n lights, the pixel over a background
    D (20 ρ + (1 + ρ) (7 + t))             for each light: D is what it adds diffusely, ρ the slope of Oren-Nayar's term
    S (κ + σ t)                            S its highlight: κ its own roundings and σ its slope, of reflections.py
    (D + S) ((2 + λ) t + 6 μ)              λ and μ are the slopes of its cone and range, of lights.py
    τ I                                    τ of the look-up of its texture (pipeline/textures.py), with alpha twice

where the direction to the light turns by t u, t = 10 x of samples and 2 x of vertices: positions are relative to the
eye, and err by 10 u and 2 u of their distance; x says how many times as far from the eye as from the light the surface
may be. It is 0 for parallel light. First-order sums of all roundings with the worst sign give 20 u for samples; in
3 000 random scenes, and uphill from there, no error was above what is stated (tests/helpers/campaign.py).

So these stay in float32 with the default tolerance: exponents up to some 300, GGX from a roughness of 0.35 on,
Beckmann from 0.7 on, Oren-Nayar, lights from a tenth of the scene's size on, spots that fall within some degrees, all
in light whose colours sum up to 1. What is brighter, or seen from further away, asks for duller highlights.

A picture states its tolerance where something is lit in float32, and 10^-6 of full scale else: six operations round a
finished colour to float32. Where something is textured that is 2·10^-5: of the largest texture a look-up of colours
errs by 9.1·10^-6, one of alpha again; and the tolerance where maps say how rough metals are, which magnifies that. It
states nothing, and why, where float64 isn't enough either: `state`. Next to a step (`list_steps`) no bound
holds, nor by Phong's method where the corners' normals look so far apart that their mean is shorter than SHORT_NORMAL.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..pipeline.setup import DEPTH_PLANE_ROUNDING
from ..pipeline.shade import DEPTH_ERROR
from ..pipeline.textures import lookup_error
from ..pipeline.transform import DEPTH_BITS, DEPTH_MARGIN, Screen
from ..scene.arrays import distinct
from ..scene.camera import View
from . import lights as light_table
from . import reflections as reflection_table
from .lights import LENGTHS, Step
from .scene_tables import SceneTables

SINGLE, DOUBLE = 2.0**-24, 2.0**-53  # u, the unit roundoff, of float32 and float64
EXACT, TEXTURED = 1e-6, 2e-5  # what is stated of float64, also with textures
ROUNDED = 6e-7  # how far float64 may be off before it becomes float32, where EXACT is stated
MAX_LIGHT = 1024.0  # and the brightest that light may be without highlights
MAX_DEPTHS = 2.0**22  # furthest over nearest depth that float32 takes
MAX_FADING = 1.0 / 4.0  # share of the tolerance that a depth cue may be off by
SHARES = np.array([1 / 8, 1 / 4, 1 / 2])  # of the tolerance, that rounding may take; packed samples have the rest
SHARES_OR_NONE = np.append(SHARES, np.inf)
NEAREST = 2.0**-10  # a light nearer to a surface than this share of the distance from the eye counts as on it
SHORT_NORMAL = 1 / 8  # an interpolated normal that is shorter counts as none
TEXEL_BORDER = 2.0**-18  # texels: a 2^-32nd of the largest picture, what texture coordinates are rounded to
TOO_MUCH = "rounding beyond half of the tolerance"
UNBOUNDED = "lights without bound"
OF_SAMPLES, OF_VERTICES = 10.0, 2.0  # u of its distance from the eye that a lit point errs by


# ---------------------------------------------------------------- how near lights are


def measure_clearances(tables: SceneTables) -> NDArray[np.float64]:
    """Return the distances that no face of a material comes nearer to a light than, (n_material, n_light), scene units.

    That to the box round the material's meshes, or where the light is near to this one, to boxes round some of their
    faces each. Infinite for parallel light; 0 for lights that move with the camera, see `measure_reach`.
    """
    found = np.full(tables.is_lit.shape, np.inf)
    for i, light in enumerate(tables.lights):
        if not hasattr(light, "position"):
            continue
        found[:, i] = 0.0
        if not light_table.is_carried(light):
            place, boxes = np.array(light.position), tables.material_boxes
            found[:, i] = distances_of(boxes, place)
            for k in np.flatnonzero(found[:, i] < np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)):
                found[k, i] = distances_of(tables.face_boxes[k], place).min(initial=np.inf)
    return found


def distances_of(boxes: NDArray[np.float64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distances of boxes (n, 2, 3) from a place, (n,); 0 of one round it."""
    return np.linalg.norm(np.maximum(np.maximum(boxes[:, 0] - place, place - boxes[:, 1]), 0.0), axis=1)


# ---------------------------------------------------------------- how bright a scene may be


class Intensities(NamedTuple):
    """How bright lights make materials at most, linear intensity, the largest of all channels; how far that errs."""

    undirected: NDArray[np.float64]  # (n_material,): what needs no light with a direction: ambient and emissive
    diffuse: NDArray[np.float64]  # (n_material, n_light)
    specular: NDArray[np.float64]  # (n_material, n_light): highlights
    of_materials: NDArray[np.float64]  # (n_material,): all together
    unweakened: float  # the largest, if no distance made lights stronger or weaker
    slopes: NDArray[np.float64]  # (n_material,): what an intensity changes by, at most, for each radian of the normal
    roundings: NDArray[np.float64]  # (n_material,): how many u rounding adds where lights are infinitely far away
    by_nearness: NDArray[np.float64]  # (n_material, n_light): and more, times x


def bound_intensities(tables: SceneTables, clearances: NDArray[np.float64], is_lit_per_sample: bool) -> Intensities:
    """Bound the intensities of a scene.

    Parameters
    ----------
    clearances : (n_material, n_light), as `measure_clearances` returns them. Lights are as strong as from half of them
        on: vertices are rounded to 1/256 px, so a sample may show what lies a little beside its triangle
    """
    # What materials reflect at most where all is white, and how far that errs. W is 1 at most, but where F0 exceeds it.
    numbers, products, albedo = np.empty((len(tables.materials), 10)), tables.products, tables.max_albedo
    for k, (row, material) in enumerate(zip(numbers, tables.materials, strict=True)):
        limits, m = tables.models[k].limits(material), material.metallic
        is_even = material.metallic_roughness is None
        weight = max(1.0, 1.0 - m + m * max(material.metal_color) * albedo) if m > 0.0 or not is_even else 1.0
        row[0], row[1] = max(material.ambient), max(material.emissive)
        row[2] = max(material.diffuse) * (1.0 - m if is_even else 1.0)
        row[3] = max(material.specular) * weight
        row[4] = limits.peak if tables.n_terms[k] > 1 else 0.0
        row[5:] = limits.rough, limits.roundings, limits.slope, limits.weight, 0.0
        for texture in (
            *material.textures,
            *([material.texture] if material.is_cut_out or not material.is_opaque else []),
        ):
            row[9] += lookup_error(*texture.shape) / SINGLE if texture is not None else 0.0
    ambient, emissive, diffuse, specular, peak, rough, own, slope, weights, lookups = numbers.T[:, :, None]

    # How bright lights are, how strong they may be there, and how far that errs.
    lights = np.empty((len(tables.lights), 3))
    strengths = np.ones(clearances.shape)
    for i, (light, of_type) in enumerate(zip(tables.lights, tables.light_types, strict=True)):
        limits = of_type.limits(light)
        lights[i] = max(light.color), limits.slope, limits.steepness
        for clearance in distinct(clearances[:, i]).tolist():
            strengths[clearances[:, i] == clearance, i] = of_type.strength(light, 0.5 * clearance)
    color, bend, steep = lights.T

    # Their products: those of channels, or those that are made of spectra.
    undirected = (ambient * tables.ambient.max() * albedo + emissive)[:, 0]
    diffuse, specular = diffuse * color, specular * color
    if products is not None:
        undirected = np.abs(products.ambient).max(axis=1) * albedo + np.abs(products.emissive).max(axis=1)
        diffuse = np.abs(products.diffuse).max(axis=2)
        specular = np.maximum(np.abs(products.specular), np.abs(products.grazing)).max(axis=2)
        specular = specular + np.abs(products.metal).max(axis=2) * albedo
    diffuse, specular = diffuse * albedo, _times(specular, peak)
    unweakened = float((undirected + (diffuse + specular).sum(axis=1)).max(initial=0.0))
    diffuse, specular = _times(diffuse, strengths), _times(specular, strengths)
    whole = undirected + (diffuse + specular).sum(axis=1)

    # The sum at the head of this page.
    lit = _times(specular, weights)  # beside the steps of highlights
    still = _times(diffuse, 7.0 + 27.0 * rough) + _times(lit, own) + _times(diffuse + lit, 6.0 * steep)
    bent = _times(diffuse, 1.0 + rough) + _times(lit, slope)
    turned = (OF_SAMPLES if is_lit_per_sample else OF_VERTICES) * (bent + _times(diffuse + lit, 2.0 + bend))
    roundings = (30.0 + 0.5 * len(lights) + lookups[:, 0]) * whole + still.sum(axis=1)
    return Intensities(undirected, diffuse, specular, whole, unweakened, bent.sum(axis=1), roundings, turned)


def _times(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return products in which 0 times infinity is 0: a light that gives nothing can't be amplified."""
    with np.errstate(invalid="ignore"):
        found = a * b
    found[np.isnan(found)] = 0.0
    return found


def smoothness_error(material: Any) -> float:
    """Bound what the error of a map that says how rough a metal is adds to a highlight, of its largest value.

    α is g² of the mean g of texels within 0..1. That errs by e (pipeline/textures.py: `lookup_error`), and α by 2 e/g
    of itself. D changes by twice that share at most, g(N·V) once; and f = N·L/(N·L + root) by f·(1 - N·L/root). So all
    together change by three times the largest D·f·g: f·(4 - N·L/root) <= 3/2 for f <= 1/2.
    """
    if material.metallic_roughness is None:
        return 0.0
    least = reflection_table.min_roughness(material)
    return 6.0 * lookup_error(*material.metallic_roughness.shape) * np.sqrt(material.roughness / least)


def share_of_tolerance(roundings: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
    """Return the share of the tolerance that rounding takes of each material in float32, (n_material,), one of SHARES;
    infinite where that is more: these are lit in float64."""
    if tolerance == 0.0:
        return np.full(roundings.shape, np.inf)
    return SHARES_OR_NONE[np.searchsorted(tolerance * SHARES, roundings * SINGLE)]


def reasons_of(tables: SceneTables, k: int, tolerance: float, share: float, bound: float) -> tuple[str, ...]:
    """Say why float32 won't do for material k in any view, in a few words each; nothing where it does.

    Parameters
    ----------
    share : of the tolerance, which rounding takes at least
    bound : the largest intensity that it may have; infinite where a light amplifies without limit
    """
    found = ["tolerance 0" if tolerance == 0 else TOO_MUCH if np.isinf(share) else ""]
    found.append("" if np.isfinite(bound) else UNBOUNDED)
    for i in np.flatnonzero(tables.is_lit[k]):
        found.append(tables.light_types[i].limits(tables.lights[i]).reason)
    found.append(tables.models[k].limits(tables.materials[k]).reason)
    return tuple(filter(None, dict.fromkeys(found)))


# ---------------------------------------------------------------- what one view says


class Reach(NamedTuple):
    """How far surfaces lie from the eye and the lights in one view."""

    furthest: NDArray[np.float64]  # (n_material,): distance of the furthest corner of a box round each, scene units
    nearness: NDArray[np.float64]  # (n_material, n_light): x, see the head of this page; no more than 1/NEAREST
    roundings: NDArray[np.float64]  # (n_material,): the sum there
    depths: float  # q: how many times as far as the nearest depth that a z-buffer has room for the furthest point is


def measure_reach(plan: Any, view: View, screen: Screen) -> Reach:
    """Measure how far surfaces lie from the eye and the lights."""
    tables, clearances, depths = plan.tables, plan.clearances, 1.0
    away = np.abs(tables.material_boxes - view.eye).max(axis=1)
    furthest, nearness = np.sqrt((away * away).sum(axis=1)), np.zeros(clearances.shape)
    roundings = plan.intensities.roundings
    if np.isfinite(clearances).any():  # else all light is parallel
        clearances = clearances.copy()
        for i, light in enumerate(tables.lights):
            if hasattr(light, "position") and light_table.is_carried(light):
                clearances[:, i] = distances_of(tables.material_boxes, light_table.world_position(light, view))
        with np.errstate(divide="ignore", invalid="ignore"):
            nearness = np.fmin(furthest[:, None] / clearances, 1.0 / NEAREST)
        roundings = roundings + _times(plan.intensities.by_nearness, nearness).sum(axis=1)
    if screen.z_scale != 0.0 and screen.is_perspective:
        most = min(float(furthest.max()), screen.far)
        depths = max(1.0, most * (DEPTH_MARGIN - screen.z_offset) / screen.z_scale)
    return Reach(furthest, nearness, roundings, depths)


def is_far(plan: Any, reach: Reach, screen: Screen) -> bool:
    """Tell whether float32 won't do for anything in one view, because of its lengths, depths or cue; `plan` is a
    Plan."""
    cue, is_fading, (furthest, nearness, *_) = plan.cue, False, reach
    if cue is not None and screen.z_scale != 0.0:
        # How far off the share may be that the cue leaves of an intensity, where depths are those of packed samples.
        # Without perspective these err by half a unit of the z-buffer for each step from a triangle's first sample,
        # along both axes, and by DEPTH_PLANE_ROUNDING; over the cue's scale that is a change of the share.
        fading = DEPTH_ERROR * (0.25 + max(cue.start, 0.0) / cue.scale)
        if not screen.is_perspective:
            n_step = 0.5 * plan.options.factor * sum(plan.options.size)
            fading = (n_step + DEPTH_PLANE_ROUNDING) / abs(screen.z_scale) / cue.scale
        is_fading = not fading * (plan.bound + float(cue.color.max())) <= MAX_FADING * plan.options.tolerance
    lengths, is_some = furthest, nearness > 0.0
    if is_some.any():
        lengths = np.append(furthest, (furthest[:, None] / np.where(is_some, nearness, 1.0))[is_some])
    is_long = not (LENGTHS[0] <= lengths.min() and lengths.max() <= LENGTHS[1])
    return is_long or is_fading or reach.depths > MAX_DEPTHS


# ---------------------------------------------------------------- what is stated


def state(plan: Any, reach: Reach) -> tuple[float | None, list[Step]]:
    """Return what is stated of a picture, see the head of this page, and the steps that `list_steps` doesn't know: that
    of lights which stand on a surface, and where nothing is stated why, in a step that is everywhere.

    `plan` is the Plan of a view.
    """
    tables, is_double, (furthest, nearness, roundings, depths) = plan.tables, plan.of_materials.is_double, reach
    steps, of_float64 = [], EXACT if plan.textures is None else TEXTURED
    is_near = ((nearness >= 1.0 / NEAREST) & tables.is_lit).any(axis=1)
    if is_near.any():
        steps.append(Step("a light on a surface", NEAREST * float(furthest[is_near].max()), "scene units"))
    is_rounded = plan.metals is not None or not is_double.all()
    stated, why = max(of_float64, plan.options.tolerance if is_rounded else 0.0), []
    if plan.metals is not None and max(map(smoothness_error, tables.materials)) > stated:
        why.append("a texture makes a metal so smooth that its rounding is magnified")
    elif is_double.any() and not _rounds_little(plan, roundings, depths)[is_double].all():
        own = [type(each).__name__ for each in tables.reflected_lights if light_table.entry_of(each).is_own]
        own += [each.reflection for each, model in zip(tables.materials, tables.models, strict=True) if model.is_own]
        why += [f"nobody knows how the formula of {name} rounds" for name in dict.fromkeys(own)]
        if not own:
            what = "a light, a highlight or the depths of the scene"
            why.append(f"{what} magnify the rounding of float64 beyond {of_float64:.0e}")
    for reason in why:
        steps.append(Step(f"no bound is stated: {reason}", np.inf, "everywhere"))
    return None if why else stated, steps


def _rounds_little(plan: Any, roundings: NDArray[np.float64], depths: float) -> NDArray[np.bool_]:
    """Tell of which materials (n_material,) float64 is off by no more than is stated; parameters as in `Reach`."""
    with np.errstate(invalid="ignore"):  # depths err by 2^-51 q of themselves, where else 20 roundings are counted
        off = roundings * DOUBLE * (1.0 + depths / 5.0) / np.maximum(plan.intensities.of_materials, 1.0)
    lit = plan.intensities.undirected + plan.intensities.diffuse.sum(axis=1)
    return (off <= ROUNDED) & (lit <= MAX_LIGHT)


def list_steps(plan: Any) -> tuple[Step, ...]:
    """List where what a frame shows jumps, and how near to each of them its bound doesn't hold: those of materials,
    then those of lights, shadows and textures."""
    tables, is_double = plan.tables, plan.dtype == np.float64
    found: list[Step] = []
    for material, model, is_lit in zip(tables.materials, tables.models, tables.is_lit, strict=True):
        found += model.steps(material, is_double) if is_lit.any() else ()
        for texture in material.textures:
            if texture.filter == "nearest":
                found.append(Step("the border between texels that are not blended", TEXEL_BORDER, "texels"))
    for i in tables.lit_by:
        found += tables.light_types[i].steps(tables.lights[i], is_double)
    if tables.has_shadows:
        # Their exact edges are those of rays from the lights. A point is compared with texels whose centres lie within
        # half the filter of it, along each axis of the map; the map's vertices are rounded to a 512th of a texel, and
        # float32 moves a point by an eighth of one at most (shadow_maps.py). So what rises from the surface towards the
        # light, as a wall does from a floor, hides that much of it. What lies before the surface by less than its depth
        # changes over a texel isn't seen; nor what a normal offset carries the point across
        # (pipeline/shadow_lookup.py); nor what lies nearer than the map's depths are rounded to.
        shadows = [*filter(None, map(light_table.shadow_of, tables.reflected_lights))]
        half = max(shadow.filter for shadow in shadows) / 2 + 0.75
        units = max(shadow.size + shadow.filter for shadow in shadows) + DEPTH_PLANE_ROUNDING  # as in shadow_maps.py
        cause, offset = "what casts a shadow next to the surface", "and its normal offset"
        found += [
            Step("the edge of a shadow, or a fold towards its light", half, "texels of the shadow map"),
            Step(cause, 1.0, f"times what the surface's depth changes by over a texel, {offset}"),
            Step(cause, units * 2.0**-DEPTH_BITS, "of the range of the map's depths, or of their inverses"),
        ]
    return tuple(dict.fromkeys(found))  # each cause once
