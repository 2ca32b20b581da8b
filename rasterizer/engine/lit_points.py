"""Where the lit points of each material lie: how near they come to a light, and to the line from the light to the eye.

In:  the geometry of a scene, its lights, a view.
Out: distances and angles, a row a material and a column a light, that no lit point of the material goes below.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geometry.surfaces import compute_clearance, compute_point_clearance
from ..scene.camera import View
from .light_table import entry_of, is_carried


class LitPoints:
    """Hold the points that are lit, material by material: surfaces in Phong's method, else vertices or centroids."""

    def __init__(self, geometry: Any, n_material: int, lights: Sequence[Any], is_lit_per_sample: bool) -> None:
        self._geometry, self._n_material, self._lights = geometry, n_material, tuple(lights)
        self._is_lit_per_sample = is_lit_per_sample
        self._parts: list | None = None
        self._spheres: tuple | None = None
        # Clearances of lights that don't move with the camera; NaN where nobody asked for them.
        self._lasting = np.full((self._n_material, len(self._lights)), np.nan)
        self._carried: dict[tuple, NDArray[np.float64]] = {}  # those of the others in the last view, by position

    def distance(self, position: Sequence[float]) -> float:
        """Return how near the lit points of all materials come to a position, scene units."""
        return float(min((self._distance(k, position) for k in range(self._n_material)), default=math.inf))

    def clearances(self, view: View, is_lit: NDArray[np.bool_] | None = None) -> NDArray[np.float64]:
        """Return the distance that no lit point of a material comes nearer to a light than, (n_material, n_light),
        scene units; see `LightEntry.clearance`. Infinite where the light doesn't light the material.

        Parameters
        ----------
        is_lit : (n_material, n_light), as in Plan; None = every light every material
        """
        is_lit = np.ones(self._lasting.shape, np.bool_) if is_lit is None else is_lit
        is_new = is_lit & np.isnan(self._lasting)
        kept, self._carried = self._carried, {}
        found = self._lasting.copy()
        for i, light in enumerate(self._lights):
            if not is_carried(light) or entry_of(light).is_distant:
                if is_new[:, i].any():
                    self._lasting[:, i] = found[:, i] = self._clearances_from(light, view, is_lit[:, i])
                continue
            beam = entry_of(light).beam(light, view)
            found[:, i] = np.inf
            if beam is not None and beam.origin is not None:
                key = (i, *beam.origin.tolist())
                every = np.ones(self._n_material, np.bool_)
                self._carried[key] = kept[key] if key in kept else self._clearances_from(light, view, every)
                found[:, i] = self._carried[key]
        return np.where(is_lit, found, np.inf)

    def _clearances_from(self, light, view, is_lit) -> list[float]:
        """The clearances of materials from a light; NaN where it doesn't light them."""
        entry = entry_of(light)
        return [
            entry.clearance(light, view, lambda position, k=k: self._distance(k, position)) if is_lit[k] else math.nan
            for k in range(self._n_material)
        ]

    def least_sums(self, view: View, is_perspective: bool, beside: float) -> NDArray[np.float64]:
        """Return what |L + V| is nowhere less than, (n_material, n_light); 0 where that isn't known.

        Parameters
        ----------
        beside : how far beside the surfaces a lit point may lie, scene units

        The points of a part of the material lie in a sphere with the radius r about c. Seen from the distance D of c,
        the direction to a point differs from that to c by asin(r/D) at most, from within by anything. So V differs from
        that of c by at most one such angle, L by another one, and the angle between both is at most the sum of all
        three: φ. Then |L + V| >= 2 cos(φ/2). The least of all parts counts.
        """
        centers, radii, starts = self._compute_spheres()
        radii = radii + beside
        to_eye, blur = _directions(centers, radii, view.eye if is_perspective else None, -view.forward)
        sums = np.zeros((self._n_material, len(self._lights)))
        for i, light in enumerate(self._lights):
            beam = entry_of(light).beam(light, view)
            if beam is None:
                continue
            back = np.zeros(3) if beam.axis is None else -beam.axis
            to_light, spread = _directions(centers, radii, beam.origin, back)
            # Next to 180 degrees, where the arc sine is steep, the angle is rounded by about 2^-26.
            apart = 2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(to_light - to_eye, axis=1), 1.0))
            angle = np.minimum(apart + blur + spread + _SLACK, np.pi)
            sums[:, i] = np.minimum.reduceat(2.0 * np.cos(0.5 * angle), starts)
        return np.maximum(sums - ROUNDED, 0.0)

    def _distance(self, k: int, position: Sequence[float]) -> float:
        """How near the lit points of material k come to a position."""
        compute = compute_clearance if self._is_lit_per_sample else compute_point_clearance
        return float(compute(*self._gather_parts()[k], *map(float, position)))

    def _gather_parts(self) -> list:
        """The arguments of the distance's kernel, for each material."""
        if self._parts is None:
            geometry = self._geometry
            if self._is_lit_per_sample:
                of_face, vertex = geometry.face_material, geometry.vertex
                split = (
                    [vertex] if not len(of_face) else [_columns(vertex, of_face == k) for k in range(self._n_material)]
                )
                self._parts = [(geometry.positions, part) for part in split]
            elif self._n_material == 1:
                self._parts = [(geometry.points,)]
            else:
                of_point = np.repeat(geometry.group_material, np.diff(geometry.point_offsets))
                lit = geometry.points[:, : len(of_point)]
                self._parts = [(_columns(lit, of_point == k),) for k in range(self._n_material)]
        return self._parts

    def _compute_spheres(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
        """Spheres about parts of the materials, neighbours in the order that they are stored in: centres (n, 3), radii
        (n,), and where each material begins, (n_material,)."""
        if self._spheres is None:
            boxes, starts = [], []
            for part in self._gather_parts():
                starts.append(len(boxes))
                boxes += _boxes_of(part, max(1, MOST_PARTS // self._n_material))
            low, high = np.array(boxes).reshape(-1, 2, 3).transpose(1, 0, 2)
            radii = 0.5 * np.linalg.norm(high - low, axis=1) * (1.0 + _SLACK)
            self._spheres = low + 0.5 * (high - low), radii, np.array(starts, np.int64)
        return self._spheres


MOST_PARTS = 128  # of all materials, but one of each at least, which are looked at one by one
ROUNDED = 2.0**-20  # of |L + V|: more than it is rounded by
_SLACK = 2.0**-40  # of angles and lengths: far more than float64 rounds them by, far less than counts


def eye_distances(lights: Sequence[Any], view: View) -> NDArray[np.float64]:
    """Return how far each light is from the eye, (n_light,), scene units; infinite for one without a position."""
    beams = [None if entry_of(light).is_distant else entry_of(light).beam(light, view) for light in lights]
    origins = [None if beam is None else beam.origin for beam in beams]
    away = [math.inf if origin is None else math.dist(origin, view.eye) * (1.0 + _SLACK) for origin in origins]
    return np.array(away, float)


def _directions(centers, radii, origin, back) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The unit directions (n, 3) from the centres of spheres to an origin, and by how much, in radians, that of another
    point in the sphere differs; without an origin it is `back`, everywhere."""
    if origin is None:
        return np.broadcast_to(back, centers.shape), np.zeros(len(centers))
    away = origin - centers
    largest = np.maximum(np.abs(away).max(axis=1, keepdims=True), np.finfo(float).tiny)
    scaled = away / largest
    lengths = np.linalg.norm(scaled, axis=1, keepdims=True)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # NaN is not below 1: a point at the origin
        share = radii / (largest * lengths)[:, 0]
    return scaled / np.maximum(lengths, 0.5), np.where(share < 1.0, np.arcsin(np.minimum(share, 1.0)), np.pi)


def _boxes_of(part, n_run) -> list[NDArray[np.float64]]:
    """The boxes (2, 3) of at most `n_run` runs of points, or of the corners of triangles."""
    n = part[-1].shape[1]
    size = max(1, -(-n // n_run))
    boxes = []
    for first in range(0, n, size):
        run = part[-1][:, first : first + size]
        points = run if len(part) == 1 else part[0][:, run.ravel()]
        boxes.append(np.stack([points.min(axis=1), points.max(axis=1)]))
    return boxes or [np.zeros((2, 3))]


def _columns(array, is_taken) -> NDArray:
    """Some columns of an array, contiguous."""
    return np.ascontiguousarray(array[:, is_taken])
