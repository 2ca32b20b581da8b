"""What the maps of a light's shadows show: their views, which of them matter, and whether float32 holds them.

    parallel rays   one map, fitted to the scene
    a cone          one map about its axis, as wide as the cone, if that has 63 degrees at most; else as to all sides
    to all sides    one map, if the scene fits into a wide view from the light; else six, the faces of a cube round it

Which of these a light is says its `Beam` (engine/light_table.py); an area light is many point lights.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..geometry.vectors import cross
from ..pipeline.shadow_lookup import ROUNDINGS
from ..scene.camera import Projection, View
from .depth_range import NEAREST
from .light_table import Beam, entry_of, is_carried, shadow_of
from .plan import Plan
from .rounding import SINGLE

# Tangent of the widest half angle of a single map: its middle has half of the texels that a cube's face would have.
WIDEST = 2.0
MARGIN = 1.0  # texels that stay free at the borders of a fitted map, beside those that the filter reaches
# The directions of the faces of a cube, in the order in which a lookup counts them.
CUBE = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
# Float32 may move what shadows are asked for by this share of a texel, where the scene is furthest from the light.
MOST_SHIFT = 0.125
OUT_OF_REACH = 1.0 + 2.0**-10  # times the range of a light: no rounding brings anything back from there


class MapViews(NamedTuple):
    """How the maps of one light see the scene."""

    origin: NDArray[np.float64]  # (3,) world space: what the maps' coordinates are relative to
    views: list[tuple[View, Projection]]
    is_needed: list[bool]  # False for a map that shows no caster, or that nothing asks


def corners_of(bounds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners of boxes (n, 2, 3), (n, 8, 3)."""
    return np.stack([bounds[:, [(k >> axis) & 1 for axis in range(3)], range(3)] for k in range(8)], axis=1)


def map_side(shadow: Any) -> int:
    """Return the texels along a side of a map: those of a Shadow, and on every side what its filter reaches beyond."""
    return shadow.size + 2 * (shadow.filter >> 1)


def choose_views(beam: Beam, corners: NDArray[np.float64], shadow: Any) -> MapViews:
    """Choose the views that a light's maps show of the scene.

    Parameters
    ----------
    corners : (n_mesh, 8, 3) of boxes round all that casts shadows, and all that they fall on, world space
    shadow : Shadow of the light
    """
    origin = corners.reshape(-1, 3).mean(axis=0) if beam.origin is None else beam.origin
    corners, radius = corners - origin, shadow.filter >> 1
    points = corners.reshape(-1, 3)
    if beam.origin is None:
        view = _look(origin, beam.axis)
        box = _extent(points @ view.right), _extent(points @ view.up)
        return MapViews(origin, [(view, _fit_projection(*box, shadow, False))], [True])
    spread = beam.spread
    view = _look(origin, beam.axis if spread <= WIDEST else points.mean(axis=0))
    depth = points @ view.forward
    across = upward = (-math.inf, math.inf)
    if depth.min() > 0.0:
        across, upward = _extent(points @ view.right / depth), _extent(points @ view.up / depth)
    if spread <= WIDEST:
        across, upward = (_overlap(extent, spread) for extent in (across, upward))
    if max(map(abs, (*across, *upward))) <= WIDEST:
        return MapViews(origin, [(view, _fit_projection(across, upward, shadow, True))], [True])
    half = shadow.size / 2
    whole = Projection(half, half, half + radius, half + radius, True)
    widest = map_side(shadow) / shadow.size  # tangent of half a map's angle
    is_needed = [_is_needed(forward, widest, corners, beam) for forward in CUBE]
    return MapViews(origin, [(_look(origin, forward), whole) for forward in CUBE], is_needed)


def _is_needed(forward, widest, corners, beam) -> bool:
    """Tell whether a cube's face can show something, and its light shines there.

    A box lies beside the pyramid of the face where all its corners lie beyond the plane of one of its sides. The cone
    of a spot light does where the angle between both axes is larger than theirs together.
    """
    axis = int(np.argmax(np.abs(forward)))
    depth, sides = corners @ forward, np.delete(corners, axis, axis=2)
    beyond = [(sign * sides - widest * depth[..., None] > 0.0).all(axis=1) for sign in (-1.0, 1.0)]  # (n_mesh, 2) each
    is_beside = np.concatenate(beyond, axis=1).any(axis=1) | (depth < 0.0).all(axis=1)
    if beam.axis is not None:
        between = math.acos(min(max(float(forward @ beam.axis), -1.0), 1.0))
        if between > math.atan(beam.spread) + math.atan(math.sqrt(2.0) * widest) + 2.0**-20:
            return False
    return not is_beside.all()


def reaches(light: Any, beam: Beam, corners: NDArray[np.float64]) -> bool:
    """Tell whether a light can reach any of the boxes (n_mesh, 8, 3): they lie within its range, and not beside its
    cone."""
    if beam.origin is None:
        return True
    low, high = corners.min(axis=1) - beam.origin, corners.max(axis=1) - beam.origin
    within = np.ones(len(corners), bool)
    if getattr(light, "range", None) is not None:
        nearest = np.maximum(np.maximum(low, -high), 0.0)
        within &= np.linalg.norm(nearest, axis=1) <= OUT_OF_REACH * light.range
    if beam.axis is not None:
        # The sphere round a box, of radius r at the distance d, is seen within asin r/d of its middle.
        middle, radius = (low + high) / 2, np.linalg.norm(high - low, axis=1) / 2
        distance = np.linalg.norm(middle, axis=1)
        is_round = distance <= radius * (1 + 2.0**-20)  # the light lies within the sphere
        distance = np.where(is_round, 1.0, distance)
        between = np.arccos(np.clip(middle @ beam.axis / distance, -1.0, 1.0))
        wide = math.atan(beam.spread) + np.arcsin(np.clip(radius / distance, 0.0, 1.0))
        within &= is_round | (between <= wide + 2.0**-20)
    return bool(within.any())


def widest_texel(beam: Beam, corners: NDArray[np.float64], shadow: Any) -> float:
    """Return the largest side of a texel of a light's maps, scene units, on a surface that faces the light where the
    scene is furthest from it; arguments as `choose_views` takes them."""
    maps, widest = choose_views(beam, corners, shadow), 0.0
    points = (corners - maps.origin).reshape(-1, 3)
    for (view, projection), is_needed in zip(maps.views, maps.is_needed, strict=True):
        furthest = float((points @ view.forward).max()) if projection.is_perspective else 1.0
        if is_needed and furthest > 0.0:
            widest = max(widest, furthest / min(projection.scale_x, projection.scale_y))
    return widest


def border_planes(view: View, projection: Projection, side: int) -> NDArray[np.float64] | None:
    """Return the planes that bound what a map with perspective may show, (5, 3) normals: see pipeline/outcodes.py. None
    where all casters stand in one direction, so that the map is narrower than a number can say.

    What lies behind the light, or more than a texel beyond a border of the map: no rounding of vertices to 1/256 of one
    brings it back. A texel's column is center_x + scale_x·across/depth.

    Parameters
    ----------
    side : texels a side of the map
    """
    if not np.isfinite(projection[:4]).all():
        return None
    across, upward = projection.scale_x * view.right, -projection.scale_y * view.up
    return np.stack(
        [
            view.forward,
            across + (projection.center_x + 1.0) * view.forward,
            -across + (side + 1.0 - projection.center_x) * view.forward,
            upward + (projection.center_y + 1.0) * view.forward,
            -upward + (side + 1.0 - projection.center_y) * view.forward,
        ]
    )


def _look(origin, forward) -> View:
    """A view in a direction; which way is up doesn't matter."""
    length = np.linalg.norm(forward)
    forward = np.array([0.0, 0.0, -1.0]) if length == 0.0 else np.asarray(forward) / length
    across = np.array(cross(forward.tolist(), np.eye(3)[np.argmin(np.abs(forward))].tolist()))
    right = across / np.linalg.norm(across)
    return View(origin, right, np.array(cross(right.tolist(), forward.tolist())), forward)


def _extent(values) -> tuple[float, float]:
    """Least and largest value."""
    return float(values.min()), float(values.max())


def _overlap(extent, spread) -> tuple[float, float]:
    """The part of an extent within -spread..spread; all of that where they don't meet."""
    low, high = max(extent[0], -spread), min(extent[1], spread)
    return (low, high) if low < high else (-spread, spread)


def _fit_projection(across, upward, shadow, is_perspective) -> Projection:
    """The projection that spreads an extent over the map, but for a margin."""
    widths = [high - low for low, high in (across, upward)]
    least = max(*widths, 2.0**-1000) * NEAREST  # something that is seen edge-on has no width
    scale_x, scale_y = ((shadow.size - 2 * MARGIN) / max(width, least) for width in widths)
    margin = MARGIN + (shadow.filter >> 1)
    return Projection(scale_x, scale_y, margin - scale_x * across[0], margin + scale_y * upward[1], is_perspective)


class Precision:
    """How far float32 moves the points that shadows are asked for.

    Positions are rounded to ROUNDINGS·u of their distances (pipeline/shadow_lookup.py), from the eye to the light and
    from there to the points. That must be no more than MOST_SHIFT of a texel's width where the scene is furthest from
    the light: up to there float32 and float64 show the same shadows, but for edges that move by so much. So it holds
    where the eye and the lights are no further from the scene than some twenty times its extent, with maps of 1024
    texels, and half as far with twice as many.
    """

    def __init__(self, plan: Plan, bounds: NDArray[np.float64]):
        self._corners = corners_of(bounds)
        self._lights = [light for light in plan.reflected_lights if shadow_of(light) is not None]
        anywhere = View(np.zeros(3), *np.eye(3))
        self._lasting = [None if is_carried(light) else self._measure(light, anywhere) for light in self._lights]

    def shift(self, view: View) -> float:
        """Return how far float32 moves any point in one view, scene units; infinite where that is too far."""
        largest = 0.0
        for light, lasting in zip(self._lights, self._lasting, strict=True):
            origin, reach, texel = lasting or self._measure(light, view)
            shift = ROUNDINGS * SINGLE * (reach + float(np.abs(origin - view.eye).sum()))
            largest = max(largest, shift if shift <= MOST_SHIFT * texel else math.inf)
        return largest

    def _measure(self, light, view) -> tuple:
        """Where a light is, how far the scene reaches from there (sum of components), and the width of a texel."""
        beam = entry_of(light).beam(light, view)
        if beam is None:
            return np.zeros(3), 0.0, math.inf
        maps = choose_views(beam, self._corners, shadow_of(light))
        points = (self._corners - maps.origin).reshape(-1, 3)
        texel = math.inf
        for (map_view, projection), is_needed in zip(maps.views, maps.is_needed, strict=True):
            furthest = float((points @ map_view.forward).max()) if projection.is_perspective else 1.0
            if is_needed and furthest > 0.0:
                texel = min(texel, furthest / max(projection.scale_x, projection.scale_y))
        return maps.origin, float(np.abs(points).sum(axis=1).max()), texel
