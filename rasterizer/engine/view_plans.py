"""The plan for each view: float64 where float32 has too few digits for it, and the error bound that holds there."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..geometry.surfaces import find_shortest_normal
from ..options import Options
from ..pipeline.gradients import EXACT
from . import reflection_table
from .error_bounds import WRITTEN, Surroundings, frame_error, furthest_over_nearest, list_steps
from .float64_reasons import LARGE, SMALL
from .intensity_bounds import compute_amplifications
from .light_table import entry_of
from .lit_points import LitPoints, eye_distances
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
        self._precise_plan: Plan | None = None
        self._last_key: tuple | None = None
        self._last: ViewPlan | None = None
        self.plan = make_plan(scene, options, geometry.albedo)
        self._lit_points = LitPoints(geometry, len(self.plan.materials), self.plan.lights, self.plan.is_lit_per_sample)
        if not np.isfinite(self.plan.bound):
            self.plan = make_plan(scene, options, geometry.albedo, clearances=self._lasting_clearances())
        self._shortest = 1.0
        if self.plan.is_lit_per_sample and self.plan.reflected.turn_slope > 0.0:
            self._shortest = find_shortest_normal(geometry.normals, geometry.corner)

    def plan_for(self, view, screen) -> ViewPlan:
        """The plan for a view, or one with float64 where float32 has too few digits for it."""
        reach = np.abs(self._bounds - view.eye).max(axis=(0, 1)).tolist()
        surroundings = self._surroundings(view, screen, math.sqrt(sum(side * side for side in reach))).rounded()
        key = *surroundings.key(), screen.is_perspective
        if self._last_key != key:
            plan, tolerance = self._bounded_plan(surroundings), self._options.tolerance
            rounding = rounding_of(plan, surroundings)
            if plan.dtype == np.float32 and fits_float32(plan, tolerance, surroundings, rounding):
                plan = plan._replace(rounding=float(rounding.max(initial=0.0)))
            elif plan.dtype == np.float32:
                plan = self._precise()
                rounding = rounding_of(plan, surroundings)
            error_bound = float(error_bound_of(plan, tolerance, rounding).max(initial=0.0))
            steps, summary = list_steps(plan, surroundings), summarize(plan, screen.is_perspective)
            self._last_key, self._last = key, ViewPlan(plan, error_bound, steps, summary)
        return self._last

    def _bounded_plan(self, surroundings: Surroundings) -> Plan:
        """The scene's plan; where lights that move with the camera amplify without limit one for their clearances in
        this view."""
        if np.isfinite(self.plan.bound):
            return self.plan
        clearances = surroundings.kept().clearances.min(axis=0, initial=np.inf)
        return make_plan(self._scene, self._options, self._geometry.albedo, clearances=clearances)

    def _precise(self) -> Plan:
        """The scene's plan with float64."""
        if self._precise_plan is None:
            self._precise_plan = make_plan(self._scene, self._options, self._geometry.albedo, is_precise=True)
        return self._precise_plan

    def _lasting_clearances(self) -> np.ndarray:
        """Half of the clearance that each light has in every view, with room for what a view takes off; 0 for one that
        moves with the camera."""
        lights = self.plan.lights
        return np.array(
            [entry_of(light).lasting_clearance(light, self._lit_points.distance) for light in lights], float
        )

    def _surroundings(self, view, screen, furthest) -> Surroundings:
        """What this view says about the positions of lights and surfaces.

        No lit point comes nearer to a light than its clearance: no vertex or centroid, or no sample's point.
        A sample's point lies beside its triangle, because vertices are rounded to 1/256 px: by at most √2/512 px at its
        depth.
        """
        beside = 0.0
        if self.plan.is_lit_per_sample:
            deepest = furthest if screen.is_perspective else 1.0
            beside = deepest * math.sqrt(2.0) / 512.0 / min(screen.scale_x, screen.scale_y)
        lights, least_sums = self.plan.lights, 0.0
        if any(reflection_table.entry_of(material).needs_least_sums for material in self.plan.materials):
            least_sums = self._lit_points.least_sums(view, screen.is_perspective, beside)
        deepness = furthest_over_nearest(screen, furthest) if screen.is_perspective else 0.0
        return Surroundings(
            furthest=furthest,
            clearances=np.maximum(self._lit_points.clearances(view) - beside, 0.0),
            shortest=self._shortest,
            is_lit_per_sample=self.plan.is_lit_per_sample,
            deepness=deepness,
            eye_distances=eye_distances(lights, view),
            least_sums=least_sums,
        )


def fits_float32(plan: Plan, tolerance, surroundings: Surroundings, rounding: NDArray[np.float64]) -> bool:
    """Tell whether float32 leaves room enough for a plan's approximations in one view, see `make_plan`.

    Lengths and their squares must keep their digits, from the nearest point to a light to the furthest one from the
    eye; a light that is further away than LARGE is found by the furthest point's clearance.
    """
    of_positions = surroundings.clearances[np.isfinite(surroundings.clearances)]
    lengths = [surroundings.furthest, *of_positions.tolist()]
    if not all(SMALL <= length <= LARGE for length in lengths):
        return False
    if (compute_amplifications(plan.lights, surroundings.clearances) > plan.most).any():
        return False
    # Nothing is kept back here: where a normal vanishes or a light lies on a surface, float64 is right.
    if surroundings.is_lit_per_sample and surroundings.shortest <= 0.0:
        return False
    return bool((rounding <= tolerance / 2).all())


def rounding_of(plan: Plan, surroundings: Surroundings) -> NDArray[np.float64]:
    """What rounding may add to an intensity of each material in one view, (n_material,), in the plan's type, and in the
    float32 of the picture."""
    u = SINGLE if plan.dtype == np.float32 else DOUBLE
    reflected = plan.reflected.amplified(compute_amplifications(plan.lights, surroundings.kept().clearances))
    written = WRITTEN * SINGLE * (plan.brightest_background + reflected.bounds)
    return frame_error(reflected, surroundings, u) + written


def error_bound_of(plan: Plan, tolerance, rounding: NDArray[np.float64]) -> NDArray[np.float64]:
    """The largest error of an intensity of each material in one view, (n_material,), against the exact evaluation of
    the same polygons; see `Stats`. `rounding` is that of `rounding_of`.

    Float64 leaves the rounding alone. Float32 adds half a level where a polygon has one intensity in its visibility
    entries, a quarter of the tolerance for the normals' planes and one for colours', or all of it for what Gouraud's
    method has between the corners.
    """
    if plan.coding == EXACT:
        return rounding
    if plan.is_flat:
        return rounding + 0.5 / plan.level_scale
    if plan.is_lit_per_sample:
        return rounding + tolerance / 4 * (2 if plan.has_albedo else 1)
    return np.maximum(rounding, tolerance)
