"""Which lights reach which boxes: what doesn't reach a mesh can be left out for it, and no bit of a picture changes.

Left out is a light only where its functions write exactly 0 for every point of the box, in float32 and in float64: 0 is
added to sums that are not negative.

    colour 0     what is reflected is multiplied by 0
    range        the strength is 0 where (d/r)² >= 1, see `end_at_range` (pipeline/light_kinds.py)
    cone         the strength is 0 where the angle from the axis is larger than that of the outer cone, see
                 `keep_to_cone`
    one side     N·L <= 0 writes 0, see the reflection functions

The last one takes a mesh of which one side alone is seen, as with `cull="back"`. Where both sides are, each triangle's
normals are turned to the side that is seen. That is decided by its vertices as they are rounded to 1/256 px: a triangle
of about this size may be seen from a side that it doesn't show, and be lit there.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..scene.camera import View
from .light_table import UNLIMITED, entry_of
from .rounding import SINGLE, step_cosine

POSITIONS = 20  # u: a point, of its distance from the eye, see SAMPLES in error_bounds.py
LIGHTS = 2  # u: a light's position, of its own distance from the eye
COSINE = 24  # u: N·L beside the error of positions: 16, and 7 of an interpolated normal


class NormalCones(NamedTuple):
    """Cones that hold all normals of a mesh, where it is seen from one side only."""

    axes: NDArray[np.float64]  # (n_mesh, 3) unit
    cosines: NDArray[np.float64]  # (n_mesh,) of the half angles; -1 where normals look anywhere


class Boxes(NamedTuple):
    """Boxes that hold the lit points of meshes, and how far float32 sees points outside of them."""

    low: NDArray[np.float64]  # (n_mesh, 3) world space, scene units
    high: NDArray[np.float64]
    errors: NDArray[np.float64]  # (n_mesh,) or a number, scene units: how far a computed position may be outside
    furthest: NDArray[np.float64]  # (n_mesh,) or a number, scene units: no point of the box is further from the eye

    def distances(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distances of the boxes from a light's position (3,), at least 0, errors taken off: (n_mesh,)."""
        beside = self._beside(point)
        return np.maximum(beside * (1.0 - _SLACK) - self._errors_at(beside), 0.0)

    def directions(self, point: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the unit directions from a light's position (3,) to the boxes' centres, (n_mesh, 3), and the largest
        angle between one of them and that to a point of the box, (n_mesh,) radians; π where that may be anything."""
        radii = 0.5 * np.linalg.norm(self.high - self.low, axis=1) * (1.0 + _SLACK) + self.errors_from(point)
        away = self.low + 0.5 * (self.high - self.low) - point
        lengths = np.linalg.norm(away, axis=1)
        is_outside = radii < lengths
        share = np.divide(radii, lengths, out=np.ones_like(lengths), where=is_outside)
        return away / np.where(lengths > 0.0, lengths, 1.0)[:, None], np.where(is_outside, np.arcsin(share), np.pi)

    def errors_from(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far a computed difference between a point and a light's position (3,) may be off, (n_mesh,)."""
        return self._errors_at(self._beside(point))

    def _beside(self, point) -> NDArray[np.float64]:
        """The distances of the boxes from a point, (n_mesh,)."""
        return np.linalg.norm(np.maximum(np.maximum(self.low - point, point - self.high), 0.0), axis=1)

    def _errors_at(self, distances) -> NDArray[np.float64]:
        """`errors_from` of a light at distances from the boxes, (n_mesh,).

        The light is no further from the eye than the box's nearest point is from both of them.
        """
        return self.errors + LIGHTS * SINGLE * (distances + self.furthest)


_SLACK = 2.0**-40  # of lengths: far more than float64 rounds them by, far less than counts


def lights_reaching(
    lights: Sequence[Any],
    view: View,
    boxes: ArrayLike,
    beside: float = 0.0,
    cones: NormalCones | None = None,
    turn: float = 0.0,
) -> NDArray[np.bool_]:
    """Tell which lights may reach which meshes.

    Parameters
    ----------
    lights : those that have a light function, as a plan lists them
    view : where the eye is: positions are relative to it, and lights may move with the camera
    boxes : (n_mesh, 2, 3) numbers, lowest and highest corners, world space, scene units
    beside : how far a lit point may lie outside its box, scene units: that of a sample, by the rounding of vertices
    cones : normals of meshes all of whose visible triangles are seen from their normals' side; None = none of them
    turn : how far planes may turn a normal, radians

    Returns
    -------
    (n_mesh, n_light) bool; False only where leaving the light out changes no bit
    """
    boxes = np.asarray(boxes, float).reshape(-1, 2, 3)
    low, high = boxes[:, 0], boxes[:, 1]
    furthest = np.linalg.norm(np.maximum(np.abs(low - view.eye), np.abs(high - view.eye)), axis=1)
    lit = Boxes(low, high, position_error(furthest, beside), furthest)
    reaches = lights_reaching_boxes(lights, view, lit)
    return reaches if cones is None else reaches & ~lights_behind_boxes(lights, view, lit, cones, turn)


def position_error(furthest: ArrayLike, beside: float) -> ArrayLike:
    """Return how far from its surface a lit point may be computed, scene units.

    Parameters
    ----------
    furthest : distance of the furthest point from the eye
    beside : how far samples lie beside their triangles
    """
    return POSITIONS * SINGLE * (np.asarray(furthest) + beside) + beside


def lights_reaching_boxes(lights: Sequence[Any], view: View, boxes: Boxes) -> NDArray[np.bool_]:
    """Tell which lights may reach which boxes, whose errors are known, from either side; see `lights_reaching`."""
    reaches = np.zeros((len(boxes.low), len(lights)), bool)
    for i, light in enumerate(lights):
        if not is_black(light):
            reaches[:, i] = _is_within(light, view, boxes)
    return reaches


def lights_behind_boxes(
    lights: Sequence[Any], view: View, boxes: Boxes, cones: NormalCones, turn: float
) -> NDArray[np.bool_]:
    """Tell which lights are behind all surfaces of which boxes; `cones` and `turn` as `lights_reaching` takes them."""
    columns = [_is_behind(light, view, boxes, cones, turn) for light in lights]
    return np.stack(columns, axis=1) if columns else np.zeros((len(boxes.low), 0), bool)


def _is_within(light, view, boxes) -> NDArray[np.bool_]:
    """Whether a box reaches into a light's range, and its cone, (n_mesh,).

    (d/r)² is rounded by less than 16 u, the cosine of the angle from the axis by 12 u, see CONE in error_bounds.py,
    beside the errors of positions. Next to a sharp edge of a cone it counts as inside.
    """
    limits = entry_of(light).limits(light)
    within = np.ones(len(boxes.low), bool)
    if limits == UNLIMITED:
        return within
    beam = entry_of(light).beam(light, view)
    if limits.range < math.inf:
        within &= boxes.distances(beam.origin) <= limits.range * (1.0 + 16.0 * SINGLE)
    if limits.cos_outer > -1.0:
        ways, spread = boxes.directions(beam.origin)
        nearest = np.cos(np.clip(np.arccos(np.clip(ways @ beam.axis, -1.0, 1.0)) - spread, 0.0, np.pi))
        within &= nearest + 16.0 * SINGLE + step_cosine(SINGLE) >= limits.cos_outer
    return within


def is_black(light: Any) -> bool:
    """Tell whether a light's colour is 0, so that no scene needs it.

    A light that may amplify without limit is none: 0 times infinity is no number. A spectrum is what its samples are,
    also where its RGB is 0.
    """
    if max(light.color) > 0.0 or min(light.color) < 0.0 or hasattr(light.color, "wavelengths"):
        return False
    return bool(np.all(np.isfinite(entry_of(light).amplification(light, np.zeros(1)))))


def _is_behind(light, view, lit, cones, turn) -> NDArray[np.bool_]:
    """Whether the light is behind all surfaces of a mesh, (n_mesh,).

    With x from a point to the light, a the axis of the cone and w its half angle, N·x <= a·x cos w + |x| sin w where
    a·x <= 0. a·x is largest, and |x|, too, at a corner of the box. N·L = N·x/|x| is rounded by COSINE; what is within
    `step_cosine` of 0 is left to the functions.
    """
    beam = entry_of(light).beam(light, view)
    if beam is None:
        return np.zeros(len(lit.low), bool)
    half_angles = np.arccos(np.clip(cones.cosines, -1.0, 1.0)) + turn
    if beam.origin is None:
        along, largest, errors = -(cones.axes @ beam.axis), np.ones(len(lit.low)), 0.0
    else:
        origin = beam.origin
        ends = np.where(cones.axes > 0.0, lit.low, lit.high)  # the corner that is furthest against the axis
        along = (cones.axes * (origin - ends)).sum(axis=1)
        largest = np.linalg.norm(np.maximum(np.abs(origin - lit.low), np.abs(origin - lit.high)), axis=1)
        errors = lit.errors_from(origin)
    highest = (along + errors) * np.cos(half_angles) + largest * np.sin(half_angles)
    is_narrow = half_angles < 0.5 * np.pi
    return is_narrow & (along + errors < 0.0) & (highest < -(COSINE * SINGLE + step_cosine(SINGLE)) * largest)
