"""The plan for each view: float64 where float32 has too few digits for it, and the error bound that holds there."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..geometry.points import number_materials
from ..geometry.surfaces import find_shortest_normal
from ..options import Options
from ..pipeline.depth_cueing import DEPTH_ERROR
from ..pipeline.gradients import EXACT, IN_ENTRIES, NEEDS_ALBEDO
from ..pipeline.lighting import Lighting
from ..pipeline.planes import DEPTH_PLANE_ROUNDING
from ..pipeline.transform import skew_stretch
from . import reflection_table
from .error_bounds import (
    WRITTEN,
    Surroundings,
    frame_error,
    furthest_over_nearest,
    list_fixed_steps,
    list_steps,
    straight_rounding,
)
from .float64_reasons import LARGE, SMALL
from .intensity_bounds import compute_amplifications
from .light_sets import LightSets, compute_reach, measure_cones
from .light_table import entry_of, shadow_of
from .lit_points import LitPoints, eye_distances
from .output_bounds import FilterBound, bound_filters, furthest_of
from .plan import Plan, list_lights, make_plan
from .plan_summary import PlanSummary, summarize
from .reach import NormalCones
from .rounding import DOUBLE, SINGLE
from .uniforms import light_view, list_materials


class ViewPlan(NamedTuple):
    """What one view needs."""

    plan: Plan
    error_bound: float  # linear intensity, see `Stats`
    steps: tuple  # where no error is small, see `Stats`
    summary: PlanSummary
    filters: tuple[FilterBound, ...]


class FixedParts:
    """What follows from a plan whatever the view: kept until a view needs other types, or another projection."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._lightings: dict[np.dtype, Lighting] = {}
        self.summary = summarize(plan)
        self.steps = list_fixed_steps(plan)
        self.filters = bound_filters(plan)

    def is_of(self, plan: Plan) -> bool:
        """Tell whether it follows from a plan, which may differ in what rounding adds."""
        own = self._plan
        return own is plan or (own.reflected is plan.reflected and own.of_materials.is_like(plan.of_materials))

    def lighting(self, dtype: np.dtype) -> Lighting:
        """The part of the illumination in one type that is the same in all views."""
        if dtype not in self._lightings:
            self._lightings[dtype] = list_materials(self._plan, dtype)
        return self._lightings[dtype]


class ViewPlans:
    """The plans of a scene, kept from view to view: what was found for one usually holds for the next."""

    def __init__(self, scene, options: Options, geometry, bounds):
        self._scene, self._options, self._geometry, self._bounds = scene, options, geometry, bounds
        self._last_key: tuple | None = None
        self._last: ViewPlan | None = None
        self._fixed: FixedParts | None = None
        self._shadow_precision: Any = None  # a plan, and its Precision; made where it is needed first
        materials, numbers = number_materials(scene.meshes)
        self._colored = find_colored(geometry, len(materials))
        self._reach = compute_reach(list_lights(scene)[0], bounds, numbers, one_sided_cones(scene, options, geometry))
        self.plan = self._make_plan(None, self._reach.sets)
        self._lit_points = LitPoints(geometry, len(materials), self.plan.lights, self.plan.is_lit_per_sample)
        if not np.isfinite(self.plan.bound):
            self.plan = self._make_plan(self._lasting_clearances(), self._reach.sets)
        self._whole_plan: Plan | None = None  # for views in which no light is left out, made for the first of them
        entries = {reflection_table.entry_of(material) for material in materials}
        self._needs_least_sums = any(entry.needs_least_sums for entry in entries)
        self._shortest = 1.0
        if self.plan.is_lit_per_sample and self.plan.reflected.turn_slope > 0.0:
            self._shortest = find_shortest_normal(geometry.normals, geometry.corner)

    @property
    def casts_shadows(self) -> bool:
        """Some light may cast shadows in some view."""
        return any(shadow_of(light) is not None for light in self.plan.lights)

    def plan_for(self, view, screen) -> ViewPlan:
        """The plan for a view, or one with float64 where float32 has too few digits for it."""
        furthest = furthest_of(self._bounds, view.eye)
        beside = self._beside(screen, furthest)
        plan = self._plan_of_reach(furthest, beside)
        surroundings = self._surroundings(plan, view, screen, furthest, beside).rounded()
        key = *surroundings.key(), screen.is_perspective, plan is self.plan
        if self._last_key != key:
            tolerance = self._options.tolerance
            plan = plan_of_view(self._bounded_plan(plan, surroundings), tolerance, surroundings)
            error_bound, fixed = float(error_bounds_of(plan, tolerance).max(initial=0.0)), self._fixed_of(plan, screen)
            steps = list_steps(plan, surroundings, fixed.steps)
            self._last_key, self._last = key, ViewPlan(plan, error_bound, steps, fixed.summary, fixed.filters)
        return self._last

    def measure_all_lights(self, view) -> None:
        """Measure how near all lights come to all materials, also where a light doesn't reach."""
        self._lit_points.clearances(view)

    def lighting_for(self, plan: Plan, view, screen, dtype: np.dtype, shadows) -> Lighting:
        """The illumination in one type, for the view that `plan` was made for; `shadows` as `make_lighting` takes
        them."""
        return light_view(self._fixed_of(plan, screen).lighting(dtype), plan, view, shadows)

    def _fixed_of(self, plan, screen) -> "FixedParts":
        """What follows from a plan, whatever the view."""
        if self._fixed is None or not self._fixed.is_of(plan):
            self._fixed = FixedParts(plan)
        return self._fixed

    def _make_plan(self, clearances, sets: LightSets | None) -> Plan:
        """The plan of the scene; arguments as `make_plan` takes them."""
        return make_plan(self._scene, self._options, self._geometry.albedo, clearances, self._colored, sets)

    def _plan_of_reach(self, furthest, beside) -> Plan:
        """The scene's plan; where what lights reach isn't known, the one in which they reach everything."""
        if self._reach.holds_in(furthest, beside):
            return self.plan
        if self._whole_plan is None:
            clearances = None if np.isfinite(self.plan.bound) else self._lasting_clearances()
            self._whole_plan = self._make_plan(clearances, None)
        return self._whole_plan

    def _bounded_plan(self, plan: Plan, surroundings: Surroundings) -> Plan:
        """The plan; where lights that move with the camera amplify without limit one for their clearances in this
        view."""
        if np.isfinite(plan.bound):
            return plan
        clearances = surroundings.kept().clearances.min(axis=0, initial=np.inf)
        return self._make_plan(clearances, plan.reflected.sets)

    def _lasting_clearances(self) -> np.ndarray:
        """Half of the clearance that each light has in every view, with room for what a view takes off; 0 for one that
        moves with the camera."""
        lights = self.plan.lights
        return np.array(
            [entry_of(light).lasting_clearance(light, self._lit_points.distance) for light in lights], float
        )

    def _beside(self, screen, furthest) -> float:
        """How far beside its triangle a sample's point may lie, scene units: vertices are rounded to 1/256 px, so by at
        most √2/512 px at its depth, with skew `skew_stretch` times as much; 0 where vertices or centroids are lit."""
        if not self.plan.is_lit_per_sample:
            return 0.0
        deepest = furthest if screen.is_perspective else 1.0
        return deepest * math.sqrt(2.0) / 512.0 / min(screen.scale_x, screen.scale_y) * skew_stretch(screen)

    def _surroundings(self, plan, view, screen, furthest, beside) -> Surroundings:
        """What this view says about the positions of lights and surfaces.

        No lit point comes nearer to a light than its clearance: no vertex or centroid, or no sample's point.
        """
        least_sums = 0.0
        if self._needs_least_sums:
            least_sums = self._lit_points.least_sums(view, screen.is_perspective, beside)
        deepness = furthest_over_nearest(screen, furthest) if screen.is_perspective else 0.0
        is_straight = self.plan.is_lit_per_sample and not screen.is_perspective
        return Surroundings(
            furthest=furthest,
            clearances=np.maximum(self._lit_points.clearances(view, plan.is_lit) - beside, 0.0),
            shortest=self._shortest,
            is_lit_per_sample=self.plan.is_lit_per_sample,
            deepness=deepness,
            eye_distances=eye_distances(plan.lights, view),
            least_sums=least_sums,
            shadow_shift=self._shadow_shift(plan, view),
            depth_shift=straight_rounding(furthest) if is_straight else 0.0,
            fading=self._fading(plan, screen),
            lean=abs(screen.skew) / screen.scale_x if self.plan.is_lit_per_sample else 0.0,
        )

    def _fading(self, plan, screen) -> float:
        """How far off the share may be that depth cueing leaves of an intensity, where depths are those of entries.

        Without perspective these err by half a unit of the z-buffer for each step from a triangle's first sample, along
        both axes, and by DEPTH_PLANE_ROUNDING; over the cue's scale that is a change of the share.
        """
        cue, (width, height), factor = plan.cue, self._options.size, self._options.factor
        if cue is None or screen.z_scale == 0.0:
            return 0.0
        if screen.is_perspective:
            return DEPTH_ERROR * (0.25 + max(cue.start, 0.0) / cue.scale)
        return (0.5 * factor * (width + height) + DEPTH_PLANE_ROUNDING) / abs(screen.z_scale) / cue.scale

    def _shadow_shift(self, plan, view) -> float:
        """How far float32 moves what shadows are asked for, scene units; infinite where it can't be taken."""
        if not plan.has_shadows or plan.of_materials.is_double.all():
            return 0.0
        if self._shadow_precision is None or self._shadow_precision[0] is not plan:
            from .shadow_views import Precision

            self._shadow_precision = plan, Precision(plan, self._bounds)
        return self._shadow_precision[1].shift(view)


def one_sided_cones(scene, options: Options, geometry) -> NormalCones | None:
    """The cones of the normals of meshes of which backs are culled; None where faces are seen from both sides.

    Flat shading turns the normals of faces by itself, also of one that is seen from its front by rounding alone.
    """
    if options.cull != "back" or options.is_flat:
        return None
    return measure_cones(geometry, [mesh.n_face for mesh in scene.meshes])


def find_colored(geometry, n_material) -> NDArray[np.bool_]:
    """Find the materials that have points whose albedo isn't grey, (n_material,)."""
    colored = np.zeros(n_material, np.bool_)
    if len(geometry.albedo):
        offsets = geometry.point_offsets.tolist()
        for material, start, end in zip(geometry.group_material, offsets[:-1], offsets[1:], strict=True):
            colored[material] |= bool(np.ptp(geometry.albedo[start:end], axis=1).any())
    return colored


def plan_of_view(plan: Plan, tolerance, surroundings: Surroundings) -> Plan:
    """Return the plan with float64 for the materials for which float32 has too few digits in one view.

    Float32 leaves room enough for a plan's approximations where rounding takes half of the tolerance at most. Lengths
    and their squares must keep their digits, from the nearest point to a light to the furthest one from the eye; a
    light that is further away than LARGE is found by the furthest point's clearance. Nothing is kept back here: where a
    normal vanishes or a light lies on a surface, float64 is right.
    """
    is_double = plan.of_materials.is_double
    roundings = roundings_of(plan, surroundings)
    if not is_double.all():
        of_positions = surroundings.clearances[np.isfinite(surroundings.clearances)]
        lengths = [surroundings.furthest, *of_positions.tolist()]
        is_lost = not all(SMALL <= length <= LARGE for length in lengths) or not np.isfinite(surroundings.shadow_shift)
        amplifies = compute_amplifications(plan.lights, surroundings.clearances) > plan.most
        is_lost = is_lost or bool((amplifies & plan.is_lit).any())
        is_lost = is_lost or (surroundings.is_lit_per_sample and surroundings.shortest <= 0.0)
        lost = ~is_double & (is_lost | ~(roundings <= tolerance / 2))
        if lost.any():
            plan = plan._replace(of_materials=plan.of_materials.doubled(lost, "this view"))
            roundings = roundings_of(plan, surroundings)
    return plan._replace(of_materials=plan.of_materials._replace(roundings=roundings))


def roundings_of(plan: Plan, surroundings: Surroundings) -> NDArray[np.float64]:
    """What rounding may add to an intensity of each material in one view, (n_material,), in its type, and in the
    float32 of the picture; and what layers that are left out may."""
    reflected = plan.reflected.amplified(compute_amplifications(plan.lights, surroundings.kept().clearances))
    written = WRITTEN * SINGLE * (plan.brightest_background + reflected.bounds)
    if plan.opacity is not None and plan.opacity.least > 0.0:
        written = written + 2.0 * plan.opacity.least * plan.bound  # of layers that are left out: pipeline/layers.py
    is_double = plan.of_materials.is_double
    errors = {
        u: frame_error(reflected, surroundings, u) for u in {DOUBLE if double else SINGLE for double in is_double}
    }
    fades_to = 0.0 if plan.cue is None else float(plan.cue.color.max())
    faded = surroundings.fading * (reflected.bounds + fades_to) if surroundings.fading > 0.0 else 0.0
    return np.where(is_double, errors.get(DOUBLE, 0.0), errors.get(SINGLE, 0.0) + faded) + written


def error_bounds_of(plan: Plan, tolerance) -> NDArray[np.float64]:
    """The largest error of an intensity of each material in one view, (n_material,), against the exact evaluation of
    the same polygons; see `Stats`. The plan's roundings are those of the view.

    Float64 leaves the rounding alone. Float32 adds half a level where a polygon has one intensity in its visibility
    entries, a quarter of the tolerance for the normals' planes and one for colours'; or all that rounding leaves of it,
    for what Gouraud's method has between the corners, and for textures.
    """
    of_materials, roundings = plan.of_materials, plan.of_materials.roundings
    rest = np.maximum(tolerance - roundings, 0.0)
    if plan.is_lit_per_sample:
        has_colors = (of_materials.needs & NEEDS_ALBEDO) != 0
        approximated = np.where(has_colors, tolerance / 2, tolerance / 4)
    elif plan.is_flat:
        approximated = np.where(of_materials.ways == IN_ENTRIES, 0.5 / plan.level_scale, 0.0)
    else:
        approximated = rest
    approximated = np.where(of_materials.is_looked_up, rest, approximated)
    return roundings + np.where(of_materials.ways == EXACT, 0.0, approximated)
