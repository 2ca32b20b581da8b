"""The plan for each view: float64 where float32 has too few digits for it, and the error bound that holds there."""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.points import number_materials
from ..geometry.surfaces import compute_clearance, compute_point_clearance, find_shortest_normal
from ..options import Options
from ..pipeline.gradients import EXACT, IN_ENTRIES, NEEDS_ALBEDO
from .error_bounds import WRITTEN, Surroundings, frame_error, furthest_over_nearest, list_steps
from .intensity_bounds import compute_amplifications
from .light_table import entry_of
from .material_plans import LARGE, SMALL, of_material
from .plan import Plan, make_plan
from .plan_summary import PlanSummary, summarize
from .rounding import DOUBLE, SINGLE


class ViewPlan(NamedTuple):
    """What one view needs."""

    plan: Plan
    error_bound: float  # linear intensity, see `Stats`
    steps: tuple  # where no error is small, see `Stats`
    summary: PlanSummary


class ViewPlans:
    """The plans of a scene, kept from view to view: what was found for one usually holds for the next."""

    def __init__(self, scene, options: Options, geometry, bounds):
        self._scene, self._options, self._geometry, self._bounds = scene, options, geometry, bounds
        self._clearances: dict[tuple, float] = {}  # by position
        self._last_key: tuple | None = None
        self._last: ViewPlan | None = None
        colored = find_colored(geometry, len(number_materials(scene.meshes)[0]))
        self.plan = make_plan(scene, options, geometry.albedo, colored=colored)
        if not np.isfinite(self.plan.bound):
            clearances = self._lasting_clearances()
            self.plan = make_plan(scene, options, geometry.albedo, clearances, colored)
        self._shortest = 1.0
        if self.plan.is_lit_per_sample and self.plan.reflected.turn_slope > 0.0:
            self._shortest = find_shortest_normal(geometry.normals, geometry.corner)

    def plan_for(self, view, screen) -> ViewPlan:
        """The plan for a view, or one with float64 where float32 has too few digits for it."""
        reach = np.abs(self._bounds - view.eye).max(axis=(0, 1)).tolist()
        surroundings = self._surroundings(view, screen, math.sqrt(sum(side * side for side in reach))).rounded()
        key = surroundings.furthest, surroundings.clearances.tobytes(), surroundings.deepness, screen.is_perspective
        if self._last_key != key:
            tolerance = self._options.tolerance
            plan = plan_of_view(self.plan, tolerance, surroundings)
            error_bound = error_bound_of(plan, tolerance, surroundings)
            steps, summary = list_steps(plan, surroundings), summarize(plan, screen.is_perspective)
            self._last_key, self._last = key, ViewPlan(plan, error_bound, steps, summary)
        return self._last

    def _lasting_clearances(self) -> np.ndarray:
        """Half of the clearance that each light has in every view, with room for what a view takes off; 0 for one that
        moves with the camera."""
        lights = self.plan.lights
        return np.array([entry_of(light).lasting_clearance(light, self._clearance_of) for light in lights], float)

    def _clearance_of(self, position) -> float:
        """How near the lit points come to a position: surfaces in Phong's method, else vertices or centroids."""
        if self.plan.is_lit_per_sample:
            return compute_clearance(self._geometry.positions, self._geometry.vertex, *map(float, position))
        return compute_point_clearance(self._geometry.points, *map(float, position))

    def _surroundings(self, view, screen, furthest) -> Surroundings:
        """What this view says about the positions of lights and surfaces.

        No lit point comes nearer to a light than its clearance: no vertex or centroid, or no sample's point.
        A sample's point lies beside its triangle, because vertices are rounded to 1/256 px: by at most √2/512 px at its
        depth.
        """
        kept, self._clearances = self._clearances, {}

        def distance(position) -> float:
            key = tuple(map(float, position))
            if key not in self._clearances:
                self._clearances[key] = kept[key] if key in kept else self._clearance_of(position)
            return self._clearances[key]

        beside = 0.0
        if self.plan.is_lit_per_sample:
            deepest = furthest if screen.is_perspective else 1.0
            beside = deepest * math.sqrt(2.0) / 512.0 / min(screen.scale_x, screen.scale_y)
        clearances = [entry_of(light).clearance(light, view, distance) - beside for light in self.plan.lights]
        deepness = furthest_over_nearest(screen, furthest) if screen.is_perspective else 0.0
        clearances = np.maximum(np.array(clearances, float), 0.0)
        return Surroundings(furthest, clearances, self._shortest, self.plan.is_lit_per_sample, deepness)


def find_colored(geometry, n_material) -> np.ndarray:
    """Find the materials that have points whose albedo isn't grey, (n_material,) bool."""
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
    if is_double.all():
        return plan
    of_positions = surroundings.clearances[np.isfinite(surroundings.clearances)]
    lengths = [surroundings.furthest, *of_positions]
    is_lost = not all(SMALL <= length <= LARGE for length in lengths)
    is_lost = is_lost or bool((compute_amplifications(plan.lights, surroundings.clearances) > plan.most).any())
    is_lost = is_lost or (surroundings.is_lit_per_sample and surroundings.shortest <= 0.0)
    roundings = roundings_of(plan, surroundings)
    lost = ~is_double & (is_lost | ~(roundings <= tolerance / 2))
    of_materials = plan.of_materials._replace(roundings=roundings)
    return plan._replace(of_materials=of_materials.doubled(lost, "this view") if lost.any() else of_materials)


def roundings_of(plan: Plan, surroundings: Surroundings) -> np.ndarray:
    """What rounding may add to an intensity of each material in one view, in its type, and in the float32 of the
    picture."""
    reflected = plan.reflected.amplified(compute_amplifications(plan.lights, surroundings.kept().clearances))
    written = WRITTEN * SINGLE * (plan.brightest_background + reflected.bound)
    errors = [
        frame_error(of_material(reflected, k), surroundings, DOUBLE if is_double else SINGLE)
        for k, is_double in enumerate(plan.of_materials.is_double)
    ]
    return np.array(errors) + written


def error_bound_of(plan: Plan, tolerance, surroundings: Surroundings) -> float:
    """The largest error of an intensity in one view, against the exact evaluation of the same polygons; see `Stats`.

    Float64 leaves the rounding alone. Float32 adds half a level where a polygon has one intensity in its visibility
    entries, a quarter of the tolerance for the normals' planes and one for colours', or all of it for what Gouraud's
    method has between the corners.
    """
    roundings, ways = roundings_of(plan, surroundings), plan.of_materials.ways
    approximated = np.zeros(len(ways))
    if plan.is_lit_per_sample:
        has_colors = (plan.of_materials.needs & NEEDS_ALBEDO) != 0
        approximated[:] = np.where(has_colors, tolerance / 2, tolerance / 4)
        is_looked_up = plan.of_materials.is_looked_up
        approximated[is_looked_up] = np.maximum(tolerance - roundings, 0.0)[is_looked_up]
    elif plan.is_flat:
        approximated[ways == IN_ENTRIES] = 0.5 / plan.level_scale
        approximated[plan.of_materials.is_looked_up] = tolerance
    else:
        approximated = np.maximum(tolerance - roundings, 0.0)
    return float((roundings + np.where(ways == EXACT, 0.0, approximated)).max())
