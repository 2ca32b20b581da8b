"""Shadow maps: for every light that casts shadows, pictures of the opaque surfaces as the light sees them
(pipeline/shadow_lookup.py).

    directional   one map, parallel rays, fitted to the scene
    spot          one map about its axis, as wide as the outer cone, if that has 63 degrees at most; else as a point light
    point         one map, if the scene fits into a wide view from the light; else six, the faces of a cube round it
    area          maps of its cells, as for points
"""

import math
from functools import cached_property
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from ..errors import SceneError
from ..geometry.points import find_lifts, find_shapes
from ..pipeline.gradients import IN_ENTRIES
from ..pipeline.shadow_lookup import (
    CENTER_X,
    CENTER_Y,
    FILTER,
    FORWARD,
    HEADER,
    IS_PERSPECTIVE,
    MAPS,
    N_MAP,
    N_MAP_COLUMN,
    ORIGIN,
    RIGHT,
    ROUNDING,
    SCALE_X,
    SCALE_Y,
    SIZE,
    UP,
)
from ..pipeline.transform import make_screen
from ..scene.camera import Projection, View
from ..scene.lights import DirectionalLight, PointLight, SpotLight
from .coding import make_coding
from .depth_range import NEAREST, fit_screen
from .draw import draw
from .passes import shadow_map_pass
from .uniforms import world_direction, world_position

WIDEST = 2.0  # tangent of the widest half angle of a single map: its middle has half of the texels that a cube's face would have
NO_CLOCK = SimpleNamespace(lap=lambda stage: None)  # the stages of a map are not those of the picture
MAP_ROUNDING = 2.0**-32  # of the range of a map's values; see pipeline/shadow_lookup.py
MOST_NUMBERS = 2**28  # of all maps of a scene: 2 GiB
MARGIN = 1.0  # texels that stay free at the borders of a fitted map
CUBE = np.array(
    [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float
)  # the order of shadow.cube_face


class ShadowMap(NamedTuple):
    """The maps of one light."""

    block: np.ndarray  # float64: the header, then the texels
    origin: np.ndarray  # (3,) world space: the place that the maps' coordinates are relative to

    def move(self, eye) -> None:
        """Write the place relative to the eye, as the positions of surface points are."""
        for k in range(int(self.block[N_MAP])):
            start = MAPS + N_MAP_COLUMN * k + ORIGIN
            self.block[start : start + 3] = self.origin - eye


class Casters(NamedTuple):
    """What casts shadows."""

    geometry: object  # Geometry of the opaque faces
    corners: np.ndarray  # (n, 3) float64, corners of boxes round them, world space


class Shadows:
    """The shadow maps of a scene, kept from picture to picture, and what looking them up needs of the surfaces."""

    def __init__(self, geometry, bounds, plan):
        self._casters = find_casters(geometry, bounds, plan.opacity)
        self._geometry, self._plan, self._maps = geometry, plan, {}

    def draw(self, view, scratch, workers) -> list:
        """The maps of all lights, None for those that cast no shadows; those of lights that stay where they are, are
        kept.

        Raises SceneError where they would have more than MOST_NUMBERS numbers.
        """
        maps, room = [], MOST_NUMBERS
        for k, light in enumerate(self._plan.lights):
            if light.shadow is None or self._casters is None:
                maps.append(None)
                continue
            if k not in self._maps or light.attached == "camera":
                before = self._maps.get(k)
                self._maps[k] = draw_shadow_map(light, view, self._casters, self._plan, scratch, workers, room, before)
            self._maps[k].move(view.eye)
            room -= len(self._maps[k].block)
            maps.append(self._maps[k])
        return maps

    @cached_property
    def shapes(self) -> np.ndarray:
        """The planes of all triangles, and how far their points are lifted, (n_face, 5) float64."""
        out = np.empty((self._geometry.vertex.shape[1], 5))
        find_shapes(self._geometry.positions, self._geometry.normals, self._geometry.vertex, out)
        return out

    @cached_property
    def lifts(self) -> np.ndarray:
        """How far the points are lifted that are lit before they are drawn, (n_point,) float64."""
        return find_lifts(self._geometry)


def find_casters(geometry, bounds, opacity) -> Casters | None:
    """The opaque faces of a scene; None if there are none.

    Parameters
    ----------
    bounds : (n_mesh, 2, 3) float64, boxes round the meshes
    opacity : Opacity, or None where all is opaque
    """
    if opacity is not None:
        faces = np.flatnonzero(opacity.is_opaque[geometry.face_material] if len(geometry.face_material) else [])
        if len(faces) == 0:
            return None
        vertex = np.ascontiguousarray(geometry.vertex[:, faces])
        geometry = geometry._replace(vertex=vertex, is_inverted=geometry.is_inverted[faces])
    corners = np.stack([bounds[:, [(k >> axis) & 1 for axis in range(3)], range(3)] for k in range(8)], axis=1).reshape(
        -1, 3
    )
    return Casters(geometry._replace(corner=geometry.vertex), corners)


def draw_shadow_map(light, view, casters, plan, scratch, workers, room=MOST_NUMBERS, before=None) -> ShadowMap:
    """Draw what a light sees; one that is attached to the camera is where `view` puts it.

    Parameters
    ----------
    room : numbers that the map may have
    before : the light's map in the picture before, whose memory is used again: new memory costs a fifth of the time

    Raises
    ------
    SceneError : there is no room for the map
    """
    direction = None if isinstance(light, PointLight) else world_direction(light, view)
    origin = casters.corners.mean(axis=0) if isinstance(light, DirectionalLight) else world_position(light, view)
    size = light.shadow.size
    views = _choose_views(light, origin, direction, casters.corners - origin, size)
    n_number = HEADER + len(views) * size * size
    if n_number > room:
        raise SceneError(
            f"the shadow maps of all lights may have {MOST_NUMBERS // 2**17} MiB; this scene needs more: "
            "choose a smaller shadow size, or fewer cells of area lights"
        )
    block = before.block if before is not None and len(before.block) == n_number else np.empty(n_number)
    block[[N_MAP, SIZE, FILTER, IS_PERSPECTIVE]] = len(views), size, light.shadow.filter, views[0][1].is_perspective
    texels = block[HEADER:].reshape(len(views), size, size)
    for k, (light_view, projection) in enumerate(views):
        screen = _fit_screen(light_view, projection, casters, size)
        coding = make_coding(plan._replace(coding=IN_ENTRIES, lights=()), screen, 0.0)
        nothing = np.empty((1, casters.geometry.positions.shape[1], 0), np.float32)
        draw(casters.geometry, shadow_map_pass(nothing, coding, screen, texels[k]), screen, scratch, workers, NO_CLOCK)
        row = block[MAPS + N_MAP_COLUMN * k : MAPS + N_MAP_COLUMN * (k + 1)]
        row[RIGHT : RIGHT + 3], row[UP : UP + 3], row[FORWARD : FORWARD + 3] = (
            light_view.right,
            light_view.up,
            light_view.forward,
        )
        row[[SCALE_X, SCALE_Y, CENTER_X, CENTER_Y]] = projection[:4]
        row[ROUNDING] = MAP_ROUNDING * _value_range(screen, coding)
    return ShadowMap(block, origin)


def _choose_views(light, origin, direction, corners, size) -> list[tuple[View, Projection]]:
    """The views that a light needs of the scene; `corners` are relative to its place."""
    if isinstance(light, DirectionalLight):
        view = _look(origin, direction)
        box = _extent(corners @ view.right), _extent(corners @ view.up)
        return [(view, _fit_projection(*box, size, False))]
    spread = math.tan(math.radians(light.outer)) if isinstance(light, SpotLight) and light.outer < 90.0 else math.inf
    view = _look(origin, direction if spread <= WIDEST else corners.mean(axis=0))
    depth = corners @ view.forward
    across = upward = (-math.inf, math.inf)
    if depth.min() > 0.0:
        across, upward = _extent(corners @ view.right / depth), _extent(corners @ view.up / depth)
    if spread <= WIDEST:
        across, upward = (_overlap(extent, spread) for extent in (across, upward))
    if max(map(abs, (*across, *upward))) <= WIDEST:
        return [(view, _fit_projection(across, upward, size, True))]
    whole = Projection(size / 2, size / 2, size / 2, size / 2, True)
    return [(_look(origin, forward), whole) for forward in CUBE]


def _look(origin, forward) -> View:
    """A view in a direction; which way is up doesn't matter."""
    length = np.linalg.norm(forward)
    forward = np.array([0.0, 0.0, -1.0]) if length == 0.0 else np.asarray(forward) / length
    across = np.cross(forward, np.eye(3)[np.argmin(np.abs(forward))])
    right = across / np.linalg.norm(across)
    return View(origin, right, np.cross(right, forward), forward)


def _extent(values) -> tuple[float, float]:
    """Least and largest value."""
    return float(values.min()), float(values.max())


def _overlap(extent, spread) -> tuple[float, float]:
    """The part of an extent within -spread..spread; all of that where they don't meet."""
    low, high = max(extent[0], -spread), min(extent[1], spread)
    return (low, high) if low < high else (-spread, spread)


def _fit_projection(across, upward, size, is_perspective) -> Projection:
    """The projection that spreads an extent over the map, but for a margin."""
    widths = [high - low for low, high in (across, upward)]
    least = max(*widths, 2.0**-1000) * NEAREST  # something that is seen edge-on has no width
    scale_x, scale_y = ((size - 2 * MARGIN) / max(width, least) for width in widths)
    return Projection(scale_x, scale_y, MARGIN - scale_x * across[0], MARGIN + scale_y * upward[1], is_perspective)


def _fit_screen(view, projection, casters, size):
    """The screen of a map, its depths fitted to what is seen there."""
    depth = (casters.corners - view.eye) @ view.forward
    nearest, furthest = _extent(depth)
    if not projection.is_perspective:
        margin = NEAREST * max(furthest - nearest, np.abs(depth).max())
        return make_screen(view, projection, (nearest - margin, furthest + margin), nearest - margin, np.inf)
    furthest = (furthest if furthest > 0.0 else 1.0) * (1 + NEAREST)
    near = max(nearest * (1 - NEAREST), furthest * NEAREST)
    return fit_screen(view, projection, (near, furthest), np.inf, casters.geometry, (size, size))


def _value_range(screen, coding) -> float:
    """What the values of a map range over: 1/w, or depth."""
    scale = coding.inv_w_scale if screen.is_perspective else coding.depth_scale
    return abs(scale) * 2.0**38
