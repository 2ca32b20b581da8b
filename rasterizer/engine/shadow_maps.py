"""Shadow maps: for every light that casts shadows, pictures of the opaque surfaces as the light sees them
(pipeline/shadow_lookup.py).

    parallel rays   one map, fitted to the scene
    a cone          one map about its axis, as wide as the cone, if that has 63 degrees at most; else as to all sides
    to all sides    one map, if the scene fits into a wide view from the light; else six, the faces of a cube round it

Which of these a light is says its `Beam` (engine/light_table.py); an area light is many point lights.
"""

import math
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..geometry.points import Geometry
from ..geometry.surfaces import compute_normal_offsets, compute_shapes
from ..pipeline import shadow_lookup as lookup
from ..pipeline.layers import Opacity
from ..pipeline.threads import Workers
from ..pipeline.transform import make_screen
from ..pipeline.workspace import WorkspacePool
from ..scene.camera import Projection, View
from .coding import make_map_coding
from .depth_range import NEAREST, fit_screen
from .draw import NO_CLOCK, draw
from .light_table import Beam, entry_of, is_carried, shadow_of
from .passes import shadow_map_pass
from .plan import Plan

# Tangent of the widest half angle of a single map: its middle has half of the texels that a cube's face would have.
WIDEST = 2.0
MAP_ROUNDING = 2.0**-32  # of the range of a map's values; see pipeline/shadow_lookup.py
MOST_NUMBERS = 2**28  # of all maps of a scene: 2 GiB
MARGIN = 1.0  # texels that stay free at the borders of a fitted map
# The directions of the faces of a cube, in the order in which a lookup counts them.
CUBE = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)


class ShadowMap(NamedTuple):
    """The maps of one light."""

    block: NDArray[np.float64]  # the header, then the texels
    origin: NDArray[np.float64]  # (3,) world space: what the maps' coordinates are relative to

    def move(self, eye: NDArray[np.float64]) -> None:
        """Write the origin relative to the eye, as the positions of surface points are."""
        for row in _map_rows(self.block):
            row[lookup.ORIGIN : lookup.ORIGIN + 3] = self.origin - eye


class Casters(NamedTuple):
    """What casts shadows."""

    geometry: Geometry  # of the opaque faces
    corners: NDArray[np.float64]  # (n, 3) of boxes round them, world space


class Shadows:
    """The shadow maps of a scene, kept from picture to picture, and what looking them up needs of the surfaces."""

    def __init__(self, geometry: Geometry, bounds: NDArray[np.float64], plan: Plan):
        self._casters = gather_casters(geometry, bounds, plan.opacity)
        self._geometry, self._plan = geometry, plan
        self._maps: dict[int, ShadowMap] = {}  # by the index of the light

    def draw(self, view: View, workspaces: WorkspacePool, threads: Workers) -> list[ShadowMap | None]:
        """Return the maps of all lights, None for those that cast no shadows; those of lights that stay where they are,
        are kept.

        Raises SceneError where they would have more than MOST_NUMBERS numbers.
        """
        maps: list[ShadowMap | None] = []
        room = MOST_NUMBERS
        for k, light in enumerate(self._plan.lights):
            if shadow_of(light) is None or self._casters is None:
                maps.append(None)
                continue
            if k not in self._maps or is_carried(light):
                before = self._maps.get(k)
                self._maps[k] = draw_shadow_map(
                    light, view, self._casters, self._plan, workspaces, threads, room, before
                )
            self._maps[k].move(view.eye)
            room -= len(self._maps[k].block)
            maps.append(self._maps[k])
        return maps

    @cached_property
    def shapes(self) -> NDArray[np.float64]:
        """The planes of all triangles, and the normal offsets of their points, (n_face, 5)."""
        out = np.empty((self._geometry.vertex.shape[1], 5))
        compute_shapes(self._geometry.positions, self._geometry.normals, self._geometry.vertex, out)
        return out

    @cached_property
    def normal_offsets(self) -> NDArray[np.float64]:
        """The normal offsets of the points that are lit before they are drawn, (n_point,)."""
        return compute_normal_offsets(self._geometry)


def gather_casters(geometry: Geometry, bounds: NDArray[np.float64], opacity: Opacity | None) -> Casters | None:
    """Return the opaque faces of a scene; None if there are none.

    Parameters
    ----------
    bounds : (n_mesh, 2, 3) float64, boxes round the meshes
    opacity : None where all is opaque
    """
    if opacity is not None:
        faces = np.flatnonzero(opacity.is_opaque[geometry.face_material] if len(geometry.face_material) else [])
        if len(faces) == 0:
            return None
        vertex = np.ascontiguousarray(geometry.vertex[:, faces])
        geometry = geometry._replace(vertex=vertex, is_inverted=geometry.is_inverted[faces])
    geometry = geometry._replace(face_material=np.empty(0, np.uint32))
    corners = np.stack([bounds[:, [(k >> axis) & 1 for axis in range(3)], range(3)] for k in range(8)], axis=1)
    return Casters(geometry._replace(corner=geometry.vertex), corners.reshape(-1, 3))


def draw_shadow_map(
    light: Any, view: View, casters: Casters, plan: Plan, workspaces: WorkspacePool, threads: Workers,
    room: int = MOST_NUMBERS, before: ShadowMap | None = None,
) -> ShadowMap:  # fmt: skip
    """Draw what a light sees; one that is attached to the camera is where `view` puts it.

    Parameters
    ----------
    room : numbers that the map may have
    before : the light's map in the picture before, whose memory is used again: new memory costs a fifth of the time

    Raises
    ------
    SceneError : there is no room for the map, or the light has no beam
    """
    beam = entry_of(light).beam(light, view)
    if beam is None:
        raise SceneError(f"a {type(light).__name__} shines from no single place or direction, so it casts no shadows")
    origin = casters.corners.mean(axis=0) if beam.origin is None else beam.origin
    size = light.shadow.size
    views = _choose_views(beam, origin, casters.corners - origin, size)
    block = _allocate_block(lookup.HEADER + len(views) * size * size, room, before)
    is_perspective = views[0][1].is_perspective
    header = [lookup.N_MAP, lookup.SIZE, lookup.FILTER, lookup.IS_PERSPECTIVE]
    block[header] = len(views), size, light.shadow.filter, is_perspective
    texels = block[lookup.HEADER :].reshape(len(views), size, size)
    for k, (row, (light_view, projection)) in enumerate(zip(_map_rows(block), views, strict=True)):
        screen = _fit_screen(light_view, projection, casters, size)
        coding = make_map_coding(screen)
        render_pass = shadow_map_pass(coding, screen, texels[k])
        draw(casters.geometry, render_pass, screen, workspaces, threads, NO_CLOCK)
        _write_view(row, light_view, projection, MAP_ROUNDING * _value_range(screen, coding))
    return ShadowMap(block, origin)


def _allocate_block(n_number, room, before) -> NDArray[np.float64]:
    """The memory of a map: that of the one before where it has the same size. SceneError where there is no room."""
    if n_number > room:
        raise SceneError(
            f"the shadow maps of all lights may have {MOST_NUMBERS // 2**17} MiB; this scene needs more: "
            "choose a smaller shadow size, or fewer cells of area lights"
        )
    return before.block if before is not None and len(before.block) == n_number else np.empty(n_number)


def _map_rows(block) -> list[NDArray[np.float64]]:
    """The rows of a header, views: one for each of the light's maps."""
    starts = (lookup.MAPS + lookup.N_MAP_COLUMN * k for k in range(int(block[lookup.N_MAP])))
    return [block[start : start + lookup.N_MAP_COLUMN] for start in starts]


def _write_view(row, view, projection, rounding) -> None:
    """Write where a map was drawn from, so that a lookup can find a point's texel."""
    axes = (lookup.RIGHT, view.right), (lookup.UP, view.up), (lookup.FORWARD, view.forward)
    for start, axis in axes:
        row[start : start + 3] = axis
    row[[lookup.SCALE_X, lookup.SCALE_Y, lookup.CENTER_X, lookup.CENTER_Y]] = projection[:4]
    row[lookup.ROUNDING] = rounding


def _choose_views(beam: Beam, origin, corners, size) -> list[tuple[View, Projection]]:
    """The views that a light needs of the scene; `corners` are relative to the origin."""
    if beam.origin is None:
        view = _look(origin, beam.axis)
        box = _extent(corners @ view.right), _extent(corners @ view.up)
        return [(view, _fit_projection(*box, size, False))]
    spread = beam.spread
    view = _look(origin, beam.axis if spread <= WIDEST else corners.mean(axis=0))
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
    depths = coding.depths
    scale = depths.inv_w_scale if screen.is_perspective else depths.depth_scale
    return abs(scale) * 2.0**38
