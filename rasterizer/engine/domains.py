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
    depth cue                   fades what entries say of   an eighth of the tolerance is for that: `fading_of`
                                depth by little
    shadows                     a point moves by 1/8 texel  else they show other shadows (shadow_maps.py)
    roundings                   half of the tolerance       see below; the other half is for planes and entries

What rounding adds to an intensity is 2^-24 times the sum of

    (30 + n/2) I                           coefficients and colours, the sum over n lights, the pixel over a background
    D (20 ρ + (1 + ρ) (7 + t))             for each light: D is what it adds diffusely, ρ the slope of Oren-Nayar's term
    S (κ + σ t)                            S its highlight: κ its own roundings and σ its slope, of reflections.py
    (D + S) ((2 + λ) t + 6 μ)              λ and μ are the slopes of its cone and range, of lights.py

where the direction to the light turns by t u, t = 10 x of samples and 2 x of vertices: positions are relative to the
eye, and err by 10 u and 2 u of their distance; x says how many times as far from the eye as from the light the surface
may be. It is 0 for parallel light. First-order sums of all roundings with the worst sign give 20 u for samples; in
3 000 random scenes, and uphill from there, no error was above what is stated (tests/helpers/campaign.py).

So these stay in float32 with the default tolerance: exponents up to some 300, GGX from a roughness of 0.35 on,
Beckmann from 0.7 on, Oren-Nayar, lights from a tenth of the scene's size on, spots that fall within some degrees, all
in light whose colours sum up to 1. What is brighter, or seen from further away, asks for duller highlights.

A picture states its tolerance where something is lit in float32, and 10^-6 of full scale else: six operations round a
finished colour to float32. It states nothing, and why, where float64 isn't enough either: `list_unstated`. Next to a
step (`list_steps`) no bound holds, nor by Phong's method where the corners' normals look so far apart that their mean
is shorter than SHORT_NORMAL.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..pipeline.setup import DEPTH_PLANE_ROUNDING
from ..pipeline.shade import DEPTH_ERROR
from ..pipeline.transform import DEPTH_BITS, DEPTH_MARGIN, Screen
from ..scene.camera import View
from . import lights as light_table
from . import reflections as reflection_table
from .lights import LENGTHS, Step
from .scene_tables import SceneTables, diffuse_shares

SINGLE, DOUBLE = 2.0**-24, 2.0**-53  # u, the unit roundoff, of float32 and float64
EXACT = 1e-6  # what is stated of float64
ROUNDED = 6e-7  # how far float64 may be off before it becomes float32, where EXACT is stated
MAX_LIGHT = 1024.0  # and the brightest that light may be without highlights
MAX_DEPTHS = 2.0**22  # furthest over nearest depth that float32 takes
MAX_FADING = 1.0 / 8.0  # share of the tolerance that a depth cue may be off by
SHARES = 1 / 8, 1 / 4, 1 / 2  # of the tolerance, which rounding may take; planes and entries have the rest
NEAREST = 2.0**-10  # a light nearer to a surface than this share of the distance from the eye counts as on it
SHORT_NORMAL = 1 / 8  # an interpolated normal that is shorter counts as none
TOO_MUCH = "rounding beyond half of the tolerance"
UNBOUNDED = "lights without bound"
OF_SAMPLES, OF_VERTICES = 10.0, 2.0  # u of its distance from the eye that a lit point errs by


# ---------------------------------------------------------------- how near lights are


def measure_clearances(tables: SceneTables) -> NDArray[np.float64]:
    """Return the distances that no face of a material comes nearer to a light than, (n_material, n_light), scene units.

    That to the box round the material's meshes, or where the light is near to this one, to boxes round some of their
    faces each. Infinite for parallel light; 0 for lights that move with the camera, see `nearness_in`.
    """
    found = np.full(tables.is_lit.shape, np.inf)
    places = {i: np.array(light.position) for i, light in enumerate(tables.lights) if hasattr(light, "position")}
    fixed = [i for i in places if not light_table.is_carried(tables.lights[i])]
    found[:, list(places)] = 0.0
    extent = float(np.linalg.norm(tables.bounds[:, 1].max(axis=0) - tables.bounds[:, 0].min(axis=0)))
    for k, box in enumerate(tables.material_boxes if fixed else ()):
        for i in fixed:
            found[k, i] = distance_of_boxes(places[i], box[None])
            if found[k, i] < extent:
                found[k, i] = distance_of_boxes(places[i], tables.face_boxes[k])
    return found


def nearness_in(tables: SceneTables, clearances: NDArray[np.float64], view: View) -> NDArray[np.float64]:
    """Return x of a view, see the head of this page, (n_material, n_light); no more than 1/NEAREST."""
    clearances = clearances.copy()
    for i, light in enumerate(tables.lights):
        if hasattr(light, "position") and light_table.is_carried(light):
            place = light_table.world_position(light, view)
            clearances[:, i] = [distance_of_boxes(place, box[None]) for box in tables.material_boxes]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.fmin(furthest_of(tables.material_boxes, view)[:, None] / clearances, 1.0 / NEAREST)


def distance_of_boxes(place: NDArray[np.float64], boxes: NDArray[np.float64]) -> float:
    """Return the distance of the nearest of boxes (n, 2, 3) from a place; 0 within one."""
    beside = np.maximum(np.maximum(boxes[:, 0] - place, place - boxes[:, 1]), 0.0)
    return float(np.linalg.norm(beside, axis=1).min(initial=np.inf))


def furthest_of(boxes: NDArray[np.float64], view: View) -> NDArray[np.float64]:
    """Return the distance of the furthest corner of each box (n, 2, 3) from the eye, scene units, (n,)."""
    return np.linalg.norm(np.abs(boxes - view.eye).max(axis=1), axis=1)


# ---------------------------------------------------------------- how bright a scene may be


class Brightness(NamedTuple):
    """How bright lights make materials at most, linear intensity, the largest of all channels."""

    undirected: NDArray[np.float64]  # (n_material,): what needs no light with a direction: ambient and emissive
    diffuse: NDArray[np.float64]  # (n_material, n_light)
    specular: NDArray[np.float64]  # (n_material, n_light): highlights

    @property
    def of_materials(self) -> NDArray[np.float64]:
        """The largest intensity that any point of a material can have, (n_material,)."""
        with np.errstate(over="ignore"):  # infinite where no bound holds
            return self.undirected + (self.diffuse + self.specular).sum(axis=1)


def compute_brightness(tables: SceneTables) -> Brightness:
    """Compute how bright each light makes each material at most, where its strength is 1."""
    materials, lights, products, max_albedo = tables.materials, tables.lights, tables.products, tables.max_albedo
    undirected = np.array([max(m.ambient) * tables.ambient.max() * max_albedo + max(m.emissive) for m in materials])
    colors = np.array([max(light.color) for light in lights], float)
    diffuse = (np.array([max(m.diffuse) for m in materials]) * diffuse_shares(materials))[:, None] * colors
    specular = np.array([max(m.specular) for m in materials])[:, None] * colors
    if products is not None:
        undirected = np.abs(products.ambient).max(axis=1) * max_albedo + np.abs(products.emissive).max(axis=1)
        diffuse = np.abs(products.diffuse).max(axis=2)
        specular = np.maximum(np.abs(products.specular), np.abs(products.grazing)).max(axis=2)
        specular = specular + np.abs(products.metal).max(axis=2) * max_albedo
    else:  # W is 1 at most, but where F0 exceeds it
        specular = specular * np.array([brightest_weight(m, max_albedo) for m in materials])[:, None]
    rows = [(reflection_table.entry_of(material), material) for material in materials]
    peaks = [row.peak(m) if reflection_table.has_highlight(m) else 0.0 for row, m in rows]
    return Brightness(undirected, diffuse * max_albedo, _times(specular, np.array(peaks)[:, None]))


def weaken(brightness: Brightness, tables: SceneTables, clearances: NDArray[np.float64]) -> Brightness:
    """Return the same with the strengths of lights from half of their clearances (n_material, n_light) on: vertices are
    rounded to 1/256 px, so a sample may show what lies a little beside its triangle."""
    strengths = np.ones(clearances.shape)
    for i, light in enumerate(tables.lights):
        row = light_table.entry_of(light)
        strengths[:, i] = [row.strength(light, 0.5 * clearance) for clearance in clearances[:, i].tolist()]
    diffuse, specular = _times(brightness.diffuse, strengths), _times(brightness.specular, strengths)
    return brightness._replace(diffuse=diffuse, specular=specular)


def brightest_weight(material: Any, max_albedo: float) -> float:
    """Return the largest W of a material, at least 1: F0 of a metal may exceed it, as colours and textures may."""
    if not reflection_table.is_metallic(material):
        return 1.0
    return max(1.0, 1.0 - material.metallic + material.metallic * max(material.metal_color) * max_albedo)


def _times(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return products in which 0 times infinity is 0: a light that gives nothing can't be amplified."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.nan_to_num(a * b, nan=0.0, posinf=np.inf)


# ---------------------------------------------------------------- what rounding adds


class Roundings(NamedTuple):
    """How many u rounding adds to an intensity of each material at most: the sum at the head of this page."""

    own: NDArray[np.float64]  # (n_material,): where lights are infinitely far away
    by_nearness: NDArray[np.float64]  # (n_material, n_light): times x

    def at(self, nearness: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the sum (n_material,) for x (n_material, n_light)."""
        return self.own + _times(self.by_nearness, nearness).sum(axis=1)


def count_roundings(tables: SceneTables, brightness: Brightness, is_lit_per_sample: bool) -> Roundings:
    """Count the roundings in intensities that are no larger than `brightness`."""
    turn = OF_SAMPLES if is_lit_per_sample else OF_VERTICES
    rows = [(reflection_table.entry_of(material), material) for material in tables.materials]
    numbers = [(row.diffuse_slope(m), row.roundings(m), row.slope(m), row.weight(m)) for row, m in rows]
    rough, own, slope, weight = np.array(numbers).reshape(-1, 4).T[:, :, None]
    lights = [(light_table.entry_of(light), light) for light in tables.lights]
    bend, steep = np.array([(row.slope(light), row.steepness(light)) for row, light in lights]).reshape(-1, 2).T
    diffuse, specular = brightness.diffuse, _times(brightness.specular, weight)
    still = _times(diffuse, 7.0 + 27.0 * rough) + _times(specular, own) + _times(diffuse + specular, 6.0 * steep)
    turned = _times(diffuse, 1.0 + rough) + _times(specular, slope) + _times(diffuse + specular, 2.0 + bend)
    with np.errstate(invalid="ignore"):
        return Roundings((30.0 + 0.5 * len(lights)) * brightness.of_materials + still.sum(axis=1), turn * turned)


def slopes_of(tables: SceneTables, brightness: Brightness) -> NDArray[np.float64]:
    """Return what an intensity of each material changes by, at most, for each radian that the normal turns,
    (n_material,); of highlights beside their steps in float32."""
    rows = [(reflection_table.entry_of(material), material) for material in tables.materials]
    rough, slope, weight = np.array([(r.diffuse_slope(m), r.slope(m), r.weight(m)) for r, m in rows]).T[:, :, None]
    parts = _times(brightness.diffuse, 1.0 + rough) + _times(brightness.specular, weight * slope)
    return parts.sum(axis=1)


def share_of_tolerance(roundings: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
    """Return the share of the tolerance that rounding takes of each material in float32, (n_material,), one of SHARES;
    infinite where that is more: these are lit in float64."""
    with np.errstate(divide="ignore", invalid="ignore"):
        part = roundings * SINGLE / tolerance
    return np.select([part <= share for share in SHARES], SHARES, np.inf)


# ---------------------------------------------------------------- what one view says


def furthest_over_nearest(screen: Screen, furthest: float) -> float:
    """Return how many times as far as the nearest depth that a z-buffer has room for the furthest point is, which is
    `furthest` from the eye, scene units; 1 without perspective."""
    if screen.z_scale == 0.0 or not screen.is_perspective:
        return 1.0
    return max(1.0, min(furthest, screen.far) * (DEPTH_MARGIN - screen.z_offset) / screen.z_scale)


def fading_of(cue: Any, screen: Screen, n_sample: tuple[int, int]) -> float:
    """Return how far off the share may be that depth cueing leaves of an intensity, where depths are those of entries.

    Without perspective these err by half a unit of the z-buffer for each step from a triangle's first sample, along
    both axes, and by DEPTH_PLANE_ROUNDING; over the cue's scale that is a change of the share.
    """
    if cue is None or screen.z_scale == 0.0:
        return 0.0
    if screen.is_perspective:
        return DEPTH_ERROR * (0.25 + max(cue.start, 0.0) / cue.scale)
    return (0.5 * sum(n_sample) + DEPTH_PLANE_ROUNDING) / abs(screen.z_scale) / cue.scale


def is_far(plan: Any, furthest: NDArray[np.float64], nearness: NDArray[np.float64], screen: Screen) -> bool:
    """Tell whether float32 won't do for anything in one view, because of its lengths, depths or cue.

    Parameters
    ----------
    plan : Plan
    furthest, nearness : as `furthest_of` and `nearness_in` return them
    """
    n_sample = plan.options.size[0] * plan.options.factor, plan.options.size[1] * plan.options.factor
    fades_to = 0.0 if plan.cue is None else float(plan.cue.color.max())
    fading = fading_of(plan.cue, screen, n_sample)
    is_fading = fading > 0.0 and not fading * (plan.bound + fades_to) <= MAX_FADING * plan.options.tolerance
    lengths = np.concatenate([furthest, (furthest[:, None] / np.where(nearness > 0.0, nearness, 1.0))[nearness > 0.0]])
    is_long = not (LENGTHS[0] <= lengths.min() and lengths.max() <= LENGTHS[1])
    return is_long or is_fading or furthest_over_nearest(screen, float(furthest.max())) > MAX_DEPTHS


# ---------------------------------------------------------------- what is stated


def list_unstated(plan: Any, roundings: NDArray[np.float64], depths: float) -> list[str]:
    """Say why no bound is stated, in a sentence each; nothing where one is.

    Parameters
    ----------
    plan : Plan of a view
    roundings : (n_material,), as `Roundings.at` returns them
    depths : furthest over nearest depth, q: depths err by 2^-51 q of themselves, where else 20 roundings are counted
    """
    with np.errstate(invalid="ignore"):
        off = roundings * DOUBLE * (1.0 + depths / 5.0) / np.maximum(plan.brightness.of_materials, 1.0)
    lit = plan.brightness.undirected + plan.brightness.diffuse.sum(axis=1)
    if not (plan.of_materials.is_double & ~((off <= ROUNDED) & (lit <= MAX_LIGHT))).any():
        return []
    own = [type(each).__name__ for each in plan.reflected_lights if light_table.entry_of(each).is_own]
    own += [each.reflection for each in plan.tables.materials if reflection_table.entry_of(each).is_own]
    if own:
        return [f"no bound is stated: nobody knows how the formula of {name} rounds" for name in dict.fromkeys(own)]
    magnified = f"magnify the rounding of float64 beyond {EXACT:.0e}"
    return [f"no bound is stated: a light, a highlight or the depths of the scene {magnified}"]


def list_steps(plan: Any) -> tuple[Step, ...]:
    """List where what a frame shows jumps, and how near to each of them its bound doesn't hold: those of materials,
    then those of lights, shadows and textures."""
    tables, is_double = plan.tables, plan.dtype == np.float64
    found: list[Step] = []
    for material, is_lit in zip(tables.materials, tables.is_lit, strict=True):
        found += reflection_table.entry_of(material).steps(material, is_double) if is_lit.any() else ()
    for light in plan.reflected_lights:
        found += light_table.entry_of(light).steps(light, is_double)
    shadows = [light_table.shadow_of(light) for light in plan.reflected_lights]
    found += _edges_of([shadow for shadow in shadows if shadow is not None])
    if any(texture.filter == "nearest" for material in tables.materials for texture in material.textures):
        found.append(Step("the border between texels that are not blended", 2.0**-20, "texels"))
    return tuple(dict.fromkeys(found))  # each cause once


def list_near_lights(
    tables: SceneTables, nearness: NDArray[np.float64], furthest: NDArray[np.float64]
) -> tuple[Step, ...]:
    """List the step of lights that stand on a surface, if any do in a view; as `nearness_in` and `furthest_of` return
    them."""
    is_near = ((nearness >= 1.0 / NEAREST) & tables.is_lit).any(axis=1)
    near = NEAREST * float(furthest[is_near].max(initial=0.0))
    return (Step("a light on a surface", near, "scene units"),) if is_near.any() else ()


def _edges_of(shadows: list[Any]) -> list[Step]:
    """The edges of shadows, whose exact ones are those of rays from the lights.

    A point is compared with texels whose centres lie within half the filter of it, along each axis of the map; the
    map's vertices are rounded to a 512th of a texel, and float32 moves a point by an eighth of one at most
    (shadow_maps.py). So what rises from the surface towards the light, as a wall does from a floor, hides that much of
    it. What lies before the surface by less than its depth changes over a texel isn't seen; nor what a normal offset
    carries the point across (pipeline/shadow_lookup.py); nor what lies nearer than the map's depths are rounded to.
    """
    if not shadows:
        return []
    half = max(shadow.filter for shadow in shadows) / 2 + 0.75
    cause, depth = "what casts a shadow next to the surface", "times what the surface's depth changes by over a texel"
    units = max(shadow.size + shadow.filter for shadow in shadows) + DEPTH_PLANE_ROUNDING  # as in shadow_maps.py
    return [
        Step("the edge of a shadow, or a fold towards its light", half, "texels of the shadow map"),
        Step(cause, 1.0, f"{depth}, and its normal offset"),
        Step(cause, units * 2.0**-DEPTH_BITS, "of the range of the map's depths, or of their inverses"),
    ]
