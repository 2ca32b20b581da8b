"""The plan for each view: float64 where float32 has too few digits for it, and the error bound that holds there."""

import math
from typing import Any, NamedTuple

import numpy as np

from ..geometry.surfaces import compute_clearance, compute_point_clearance, find_shortest_normal
from ..options import Options
from ..pipeline.gradients import EXACT
from .error_bounds import WRITTEN, Surroundings, frame_error, furthest_over_nearest, list_steps
from .intensity_bounds import compute_amplifications
from .light_table import entry_of
from .plan import LARGE, SMALL, Plan, make_plan
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
        self._precise_plan: Plan | None = None
        self._last_key: tuple | None = None
        self._last: ViewPlan | None = None
        self._shadow_precision: Any = None  # made where it is needed first
        self.plan = make_plan(scene, options, geometry.albedo)
        if not np.isfinite(self.plan.bound):
            self.plan = make_plan(scene, options, geometry.albedo, clearances=self._lasting_clearances())
        self._shortest = 1.0
        if self.plan.is_lit_per_sample and self.plan.reflected.turn_slope > 0.0:
            self._shortest = find_shortest_normal(geometry.normals, geometry.corner)

    def plan_for(self, view, screen) -> ViewPlan:
        """The plan for a view, or one with float64 where float32 has too few digits for it."""
        reach = np.abs(self._bounds - view.eye).max(axis=(0, 1)).tolist()
        surroundings = self._surroundings(view, screen, math.sqrt(sum(side * side for side in reach))).rounded()
        key = (
            surroundings.furthest, surroundings.clearances.tobytes(), surroundings.deepness, surroundings.shadow_shift,
            screen.is_perspective,
        )  # fmt: skip
        if self._last_key != key:
            plan, tolerance = self.plan, self._options.tolerance
            if plan.dtype == np.float32 and fits_float32(plan, tolerance, surroundings):
                plan = plan._replace(rounding=rounding_of(plan, surroundings))
            elif plan.dtype == np.float32:
                plan = self._precise()
            error_bound = error_bound_of(plan, tolerance, surroundings)
            steps, summary = list_steps(plan, surroundings), summarize(plan, screen.is_perspective)
            self._last_key, self._last = key, ViewPlan(plan, error_bound, steps, summary)
        return self._last

    def _precise(self) -> Plan:
        """The scene's plan with float64."""
        if self._precise_plan is None:
            self._precise_plan = make_plan(self._scene, self._options, self._geometry.albedo, is_precise=True)
        return self._precise_plan

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
        is_sample = self.plan.is_lit_per_sample
        return Surroundings(furthest, clearances, self._shortest, is_sample, deepness, self._shadow_shift(view))

    def _shadow_shift(self, view) -> float:
        """How far float32 moves what shadows are asked for, scene units; infinite where it can't be taken."""
        if not self.plan.has_shadows or self.plan.dtype != np.float32:
            return 0.0
        if self._shadow_precision is None:
            from .shadow_views import Precision

            self._shadow_precision = Precision(self.plan, self._bounds)
        return self._shadow_precision.shift(view)


def fits_float32(plan: Plan, tolerance, surroundings: Surroundings) -> bool:
    """Tell whether float32 leaves room enough for a plan's approximations in one view, see `make_plan`.

    Lengths and their squares must keep their digits, from the nearest point to a light to the furthest one from the
    eye; a light that is further away than LARGE is found by the furthest point's clearance.
    """
    of_positions = surroundings.clearances[np.isfinite(surroundings.clearances)]
    lengths = [surroundings.furthest, *of_positions]
    if not all(SMALL <= length <= LARGE for length in lengths):
        return False
    if not np.isfinite(surroundings.shadow_shift):
        return False
    if (compute_amplifications(plan.lights, surroundings.clearances) > plan.most).any():
        return False
    # Nothing is kept back here: where a normal vanishes or a light lies on a surface, float64 is right.
    if surroundings.is_lit_per_sample and surroundings.shortest <= 0.0:
        return False
    return rounding_of(plan, surroundings) <= tolerance / 2


def rounding_of(plan: Plan, surroundings: Surroundings) -> float:
    """What rounding may add to an intensity in one view, in the plan's type, and in the float32 of the picture."""
    u = SINGLE if plan.dtype == np.float32 else DOUBLE
    reflected = plan.reflected.amplified(compute_amplifications(plan.lights, surroundings.kept().clearances))
    written = WRITTEN * SINGLE * (plan.brightest_background + reflected.bound)
    return frame_error(reflected, surroundings, u) + written


def error_bound_of(plan: Plan, tolerance, surroundings: Surroundings) -> float:
    """The largest error of an intensity in one view, against the exact evaluation of the same polygons; see `Stats`.

    Float64 leaves the rounding alone. Float32 adds half a level where a polygon has one intensity in its visibility
    entries, a quarter of the tolerance for the normals' planes and one for colours', or all of it for what Gouraud's
    method has between the corners.
    """
    rounding, approximated = rounding_of(plan, surroundings), 0.0
    if plan.coding != EXACT:
        approximated = tolerance / 4 * (2 if plan.has_albedo else 1) if plan.is_lit_per_sample else tolerance - rounding
        approximated = 0.5 / plan.level_scale if plan.is_flat else max(approximated, 0.0)
    return float(rounding + approximated)
