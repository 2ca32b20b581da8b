"""The plan for each view: float64 where float32 has too few digits for it, and the error bound that holds there."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..geometry.points import number_materials
from ..geometry.surfaces import compute_clearance, compute_point_clearance, find_shortest_normal
from ..options import Options
from ..pipeline.gradients import EXACT, HAS_ALBEDO, IN_ENTRIES
from ..pipeline.lighting import Lighting
from ..pipeline.setup import DEPTH_PLANE_ROUNDING
from ..pipeline.shade import DEPTH_ERROR
from ..scene.camera import View
from . import bounds as b
from . import reflections as reflection_table
from .lights import entry_of, is_carried, shadow_of
from .plan import TOO_MUCH, Plan, are_single, list_lights, make_plan
from .plan_summary import PlanSummary, summarize
from .rounding import DOUBLE, SINGLE, Step
from .uniforms import light_view, list_materials, with_functions

ANYWHERE = View(np.zeros(3), *np.eye(3))  # for lights that don't move with the camera
STEPS = 16  # an octave: views whose distances differ by less are planned alike


class ViewPlan(NamedTuple):
    """What one view needs."""

    plan: Plan
    error_bound: float | None  # linear intensity, see `Stats`
    steps: tuple  # where no error is small, and why none is stated, see `Stats`
    summary: PlanSummary
    filters: tuple[b.FilterBound, ...]


class ViewPlans:
    """The plans of a scene, kept from view to view: what was found for one usually holds for the next."""

    def __init__(self, scene, options: Options, geometry, bounds):
        self._options, self._geometry, self._bounds = options, geometry, bounds
        self._is_lit_per_sample = options.shading == "phong"
        materials, numbers = number_materials(scene.meshes)
        self._lights, n_material = list_lights(scene)[0], len(materials)
        has = [[k in of_mesh for of_mesh in numbers] for k in range(n_material)]
        self._boxes = np.array([(bounds[of_k, 0].min(axis=0), bounds[of_k, 1].max(axis=0)) for of_k in has])
        self._parts = list_parts(geometry, n_material, self._is_lit_per_sample)
        self._clearances = np.zeros((n_material, len(self._lights)))
        for i, light in enumerate(self._lights):
            self._clearances[:, i] = 0.0 if is_carried(light) else self._clearances_from(light, ANYWHERE)
        colored = find_colored(geometry, n_material)
        self.plan = make_plan(scene, options, geometry.albedo, 0.5 * self._clearances, colored)
        self._shortest, self._last_key, self._last = 1.0, None, None
        if self._is_lit_per_sample and self.plan.brightness.turn_slopes.max(initial=0.0) > 0.0:
            self._shortest = find_shortest_normal(geometry.normals, geometry.corner)
        self._lightings: dict[tuple, Lighting] = {}  # what is the same in all views, by type, needs and projection
        self._shadow_precision: Any = None  # made where it is needed first

    @property
    def casts_shadows(self) -> bool:
        """Some light may cast shadows in some view."""
        return any(shadow_of(light) is not None for light in self.plan.lights)

    def plan_for(self, view, screen) -> ViewPlan:
        """The plan for a view, or one with float64 where float32 has too few digits for it."""
        distances = self._measure(view, screen)
        arrays = {name: getattr(distances, name).tobytes() for name in ("furthest", "clearances")}
        key = distances._replace(**arrays), screen.is_perspective
        if self._last is None or self._last_key != key:
            plan = plan_of_view(self.plan, self._options.tolerance, distances)
            stated = error_bounds_of(plan, self._options.tolerance)
            reasons = list_unstated(plan, self._options, stated)
            steps = (*b.list_steps(plan, distances), *(Step(reason, np.inf, "everywhere") for reason in reasons))
            error_bound = None if reasons else float(stated.max(initial=0.0))
            summary = summarize(plan)
            self._last_key, self._last = key, ViewPlan(plan, error_bound, steps, summary, b.bound_filters(plan))
        return self._last

    def lighting_for(self, plan: Plan, view, screen, dtype: np.dtype, shadows) -> Lighting:
        """The illumination in one type, for the view that `plan` was made for; `shadows` as `make_lighting` takes
        them."""
        key = dtype, plan.of_materials.needs.tobytes()
        if key not in self._lightings:
            self._lightings[key] = with_functions(list_materials(plan, dtype), plan, dtype)
        return light_view(self._lightings[key], plan, view, shadows)

    def _measure(self, view, screen) -> b.Distances:
        """What this view says about positions; distances are rounded to the unsafe side, to 1/16 of an octave."""
        furthest = b.furthest_of(self._bounds, view.eye)
        each = np.array([b.furthest_of(box[None], view.eye) for box in self._boxes])
        if np.isinf(self._clearances).all() and are_single(each):
            each = np.ones(len(each))  # they play no part
        beside = b.position_reach(screen, furthest, self._is_lit_per_sample)
        clearances = self._clearances.copy()
        for i, light in enumerate(self._lights):
            if is_carried(light):
                clearances[:, i] = self._clearances_from(light, view)
        with np.errstate(divide="ignore"):
            octaves = np.floor(STEPS * np.log2(np.maximum(clearances - beside, 0.0)))
        return b.Distances(
            furthest=np.array([_up(away) for away in each]),
            clearances=np.exp2(octaves / STEPS),
            shortest=self._shortest,
            is_lit_per_sample=self._is_lit_per_sample,
            ratio=_up(b.furthest_over_nearest(screen, furthest)),
            fading=self._fading(screen),
            lean=abs(screen.skew) / screen.scale_x if self._is_lit_per_sample else 0.0,
            shadow_shift=self._shadow_shift(view),
        )

    def _clearances_from(self, light, view) -> list[float]:
        """The distances that no lit point of each material comes nearer to a light than; see `LightEntry.clearance`."""
        compute = compute_clearance if self._is_lit_per_sample else compute_point_clearance
        parts = [lambda position, part=part: compute(*part, *map(float, position)) for part in self._parts]
        return [entry_of(light).clearance(light, view, distance) for distance in parts]

    def _fading(self, screen) -> float:
        """How far off the share may be that depth cueing leaves of an intensity, where depths are those of entries.

        Without perspective these err by half a unit of the z-buffer for each step from a triangle's first sample, along
        both axes, and by DEPTH_PLANE_ROUNDING; over the cue's scale that is a change of the share.
        """
        cue, (width, height), factor = self.plan.cue, self._options.size, self._options.factor
        if cue is None or screen.z_scale == 0.0:
            return 0.0
        if screen.is_perspective:
            return DEPTH_ERROR * (0.25 + max(cue.start, 0.0) / cue.scale)
        return (0.5 * factor * (width + height) + DEPTH_PLANE_ROUNDING) / abs(screen.z_scale) / cue.scale

    def _shadow_shift(self, view) -> float:
        """How far float32 moves what shadows are asked for, scene units; infinite where it can't be taken."""
        if not self.plan.has_shadows or self.plan.of_materials.is_double.all():
            return 0.0
        if self._shadow_precision is None:
            from .shadow_maps import Precision

            self._shadow_precision = Precision(self.plan, self._bounds)
        return self._shadow_precision.shift(view)


def _up(value: float) -> float:
    """A number, at least 0, rounded up to a sixteenth of an octave."""
    return float(2.0 ** (np.ceil(STEPS * np.log2(value)) / STEPS)) if value > 0.0 else 0.0


def list_parts(geometry, n_material, is_lit_per_sample) -> list[tuple]:
    """List what is lit of each material: surfaces (positions, triangles), or points, as `compute_clearance` and
    `compute_point_clearance` take them."""
    if is_lit_per_sample:
        of_face, vertex = geometry.face_material, geometry.vertex
        if not len(of_face):
            return [(geometry.positions, vertex)]
        return [(geometry.positions, np.ascontiguousarray(vertex[:, of_face == k])) for k in range(n_material)]
    of_point = np.repeat(geometry.group_material, np.diff(geometry.point_offsets))
    lit = geometry.points[:, : len(of_point)]
    return [(np.ascontiguousarray(lit[:, of_point == k]),) for k in range(n_material)]


def find_colored(geometry, n_material) -> NDArray[np.bool_]:
    """Find the materials that have points whose albedo isn't grey, (n_material,)."""
    colored = np.zeros(n_material, np.bool_)
    if len(geometry.albedo):
        offsets = geometry.point_offsets.tolist()
        for material, start, end in zip(geometry.group_material, offsets[:-1], offsets[1:], strict=True):
            colored[material] |= bool(np.ptp(geometry.albedo[start:end], axis=1).any())
    return colored


def plan_of_view(plan: Plan, tolerance, distances: b.Distances) -> Plan:
    """Return the plan with float64 for the materials for which float32 has too few digits in one view.

    Rounding may take half of the tolerance. Lengths and their squares must keep their digits, from the nearest point to
    a light to the furthest one from the eye. Nothing is kept back here: where a normal vanishes or a light lies on a
    surface, float64 is right.
    """
    of_materials, fades_to = plan.of_materials, 0.0 if plan.cue is None else float(plan.cue.color.max())
    written = b.WRITTEN * (plan.brightest_background + plan.brightness.at(plan.clearances).of_materials)
    single = b.rounding_errors(plan.brightness, distances, SINGLE, fades_to) + written
    lit = plan.brightness.at(distances.kept().clearances)
    with np.errstate(invalid="ignore"):  # NaN, no bound, of light that has none
        double = b.rounding_errors(plan.brightness, distances, DOUBLE) / np.maximum(
            lit.of_materials, 1.0
        )  # of full scale
    double[lit.undirected + lit.diffuse.sum(axis=1) > b.MOST_LIGHT] = np.inf
    if plan.opacity is not None:
        single += 2.0 * plan.opacity.least * plan.bound  # of layers that are left out: pipeline/a_buffer.py
        double += 2.0 * plan.opacity.least
    places = distances.clearances[plan.is_lit & np.isfinite(distances.clearances)]
    is_lost = not are_single([*distances.furthest.tolist(), *places.tolist()]) or not np.isfinite(
        distances.shadow_shift
    )
    is_lost |= bool((distances.clearances < plan.clearances)[plan.is_lit].any()) or distances.shortest <= 0.0
    lost = ~of_materials.is_double & (is_lost | ~(single <= tolerance / 2))
    if lost.any():
        of_materials = of_materials.doubled(lost, TOO_MUCH)
    roundings = np.where(of_materials.is_double, double, single)
    return plan._replace(of_materials=of_materials._replace(roundings=roundings))


def error_bounds_of(plan: Plan, tolerance) -> NDArray[np.float64]:
    """The largest error of an intensity of each material in one view, (n_material,), against the exact evaluation of
    the same polygons, see `Stats`; NaN where none is stated. The plan's roundings are those of the view.

    Of float64 that is EXACT. Float32 adds half a level where a polygon has one intensity in its visibility entries, a
    quarter of the tolerance for the normals' planes and one for colours'; or all that rounding leaves of it, for what
    Gouraud's method has between the corners, and for textures.
    """
    of_materials, roundings = plan.of_materials, plan.of_materials.roundings
    rest = np.maximum(tolerance - roundings, 0.0)
    if plan.is_lit_per_sample:
        has_colors = (of_materials.needs & HAS_ALBEDO) != 0
        approximated = np.where(has_colors, tolerance / 2, tolerance / 4)
    elif plan.is_flat:
        approximated = np.where(of_materials.ways == IN_ENTRIES, 0.5 / plan.level_scale, 0.0)
    else:
        approximated = rest
    approximated = np.where(of_materials.is_looked_up, rest, approximated)
    single = roundings + np.where(of_materials.ways == EXACT, 0.0, approximated)
    is_rounded = single <= tolerance * (1.0 + 4.0 * DOUBLE)  # a sum may round to more than the tolerance that it is
    single = np.where(is_rounded, np.minimum(single, tolerance), single)
    return np.where(of_materials.is_double, np.where(roundings <= b.ROUNDED, b.EXACT, np.nan), single)


def list_unstated(plan: Plan, options: Options, stated: NDArray[np.float64]) -> list[str]:
    """Say why no bound is stated, in a sentence each; nothing where one is."""
    found = []
    if (
        options.antialias == "shade-once"
        and options.factor > 1
        and (plan.is_lit_per_sample or plan.textures is not None)
    ):
        found.append(
            "no bound is stated: a pixel that is shaded once may differ from the mean of its samples by anything"
        )
    silent = [type(light).__name__ for light in plan.reflected_lights if not entry_of(light).has_bound(light)]
    silent += [m.reflection for m, is_lit in zip(plan.materials, plan.is_lit, strict=True)
               if is_lit.any() and not reflection_table.entry_of(m).has_bound]  # fmt: skip
    for name in dict.fromkeys(silent):
        found.append(f"no bound is stated: {name}, which is registered, says none")
    if np.isnan(stated).any() and not silent:
        found.append(
            "no bound is stated: a light, a highlight or the depths of the scene magnify the rounding of float64 "
            f"beyond {b.EXACT:.0e}"
        )
    return found
