"""Shadow maps: for every light that casts shadows, pictures of the opaque surfaces as the light sees them
(pipeline/shadow_lookup.py).

What a map shows follows from the light's `Beam` (lights.py); an area light is many point lights:

    parallel rays   one map of the scene; where the picture shows a part of it, maps of what it shows before it
    a cone          one map about its axis, as wide as the cone, if that has 63 degrees at most; else as to all sides
    to all sides    one map, if the scene fits into a wide view from the light; else six, the faces of a cube round it
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..cores import Workers
from ..errors import SceneError
from ..geometry.vectors import cross
from ..pipeline import shadow_lookup as lookup
from ..pipeline.a_buffer import Opacity
from ..pipeline.cull import list_seen_faces
from ..pipeline.cut_outs import CutOuts
from ..pipeline.setup import DEPTH_PLANE_ROUNDING, DepthScale
from ..pipeline.transform import DEPTH_MARGIN, Screen, make_screen
from ..pipeline.workspace import WorkspacePool
from ..scene.camera import Projection, View
from .depth_range import NEAREST, are_seen_from_outside, fit_screen, scale_depths
from .domains import DOUBLE, SINGLE
from .draw import NO_CLOCK, draw
from .lights import Beam, entry_of, is_carried, shadow_of
from .passes import NONE, ShadowMapPass
from .plan import Plan
from .points import Geometry
from .uniforms import NO_DEPTHS, make_cut_outs

MAX_TEXELS = 2**28  # of all maps of a scene: 1 GiB in float32
DOUBLE_ROUNDING = 2.0**-40  # of the distances, in float64: slivers lie that far beside their planes
# Tangent of the widest half angle of a single map: its middle has half of the texels that a cube's face would have.
WIDEST = 2.0
# A map's texels are even, and pixels grow with the distance: so what is seen is cut into slices whose furthest depth is
# some SLICE times the nearest. A header has room for six maps, and the last one shows the whole scene.
SLICE, MAX_SLICES = 8.0, 5
FINER = 2.0  # a slice's map is more than so many times as fine as that of the scene: else that one's edges will do
MARGIN = 1.0  # texels that stay free at the borders of a fitted map, beside those that the filter reaches
# The directions of the faces of a cube, in the order in which a lookup counts them.
CUBE = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
# Float32 may move what shadows are asked for by this share of a texel, where the scene is furthest from the light.
MAX_SHIFT = 0.125
NORMALS = 7  # u that an interpolated normal errs by
BEYOND_RANGE = 1.0 + 2.0**-10  # times the range of a light: no rounding brings anything back from there

Slices = Sequence[NDArray[np.float64]]  # (n, 3) points round what is seen, one for each slice of its depths
Seen = Mapping[int, Slices]  # by a light's index: the slices that it has maps of

NO_PARTS: Seen = {}


class Casters(NamedTuple):
    """What casts shadows."""

    geometry: Geometry  # of the opaque faces
    corners: NDArray[np.float64]  # (n_mesh, 8, 3) of boxes round them, and what they fall on, world space
    bounds: NDArray[np.float64]  # (n_mesh, 2, 3) of the same boxes
    inner_sides: NDArray[np.int8] | None  # (n_face,) of closed bodies, see geometry/closed.py; None where they count
    cut_outs: CutOuts | None = None  # without depths; None where all samples of the faces are there

    def some(self, faces: NDArray) -> "Casters":
        """Return some faces alone, as far as drawing depths reads them."""
        vertex, is_inverted = np.ascontiguousarray(self.geometry.vertex[:, faces]), self.geometry.is_inverted[faces]
        geometry = self.geometry._replace(vertex=vertex, corner=vertex, is_inverted=is_inverted)
        if self.cut_outs is not None:
            corner, material = np.ascontiguousarray(self.geometry.corner[:, faces]), self.geometry.face_material
            geometry = geometry._replace(corner=corner, face_material=material[faces] if len(material) else material)
        inner_sides = None if self.inner_sides is None else self.inner_sides[faces]
        return self._replace(geometry=geometry, inner_sides=inner_sides)


def gather_casters(
    geometry: Geometry,
    bounds: NDArray[np.float64],
    opacity: Opacity | None,
    inner_sides: NDArray[np.int8] | None = None,
    cut_outs: CutOuts | None = None,
) -> Casters | None:
    """Return the opaque faces of a scene; None if there are none.

    Parameters
    ----------
    bounds : (n_mesh, 2, 3) float64, boxes round the meshes
    opacity : None where all is opaque
    inner_sides : (n_face,) int8, which a light that is outside of all boxes doesn't see; None = all are drawn
    """
    plain = geometry._replace(corner=geometry.vertex, face_material=np.empty(0, np.uint32))
    plain = geometry if cut_outs is not None else plain  # they look texture coordinates up
    casters = Casters(plain, corners_of(bounds), bounds, inner_sides, cut_outs)
    if opacity is None:
        return casters
    faces = np.flatnonzero(opacity.is_opaque[geometry.face_material] if len(geometry.face_material) else [])
    return casters.some(faces) if len(faces) else None


class Shadows:
    """The shadow maps of a scene, kept from picture to picture."""

    def __init__(
        self, geometry: Geometry, bounds: NDArray[np.float64], plan: Plan, inner_sides: NDArray[np.int8] | None = None
    ):
        cut_outs = make_cut_outs(plan, geometry, NO_DEPTHS)
        self._casters = gather_casters(geometry, bounds, plan.opacity, inner_sides, cut_outs)
        self._corners, self._bounds = corners_of(bounds), bounds
        self._plan = plan
        # Where a light was (`place_of`), and its maps, by its index and their type; or its extent, by its index.
        self._maps: dict[tuple, tuple[tuple, ShadowMap | None]] = {}
        self._extents: dict[int, tuple[tuple, tuple]] = {}

    def slice_view(self, view: View, screen: Screen, n_sample: tuple[int, int]) -> Seen:
        """Return for each light of parallel rays which parts of what a picture shows of the scene have maps of their
        own."""
        lights, beams = self._plan.tables.lights, {}
        for k in self._list_lights():
            beam = entry_of(lights[k]).beam(lights[k], view)
            if beam is not None and beam.origin is None:
                beams[k] = beam
        slices = slice_view(view, screen, n_sample, self._corners, self._bounds) if beams else ()
        return {k: choose_parts(beam, self._corners, shadow_of(lights[k]), slices) for k, beam in beams.items()}

    def draw(
        self,
        plan: Plan,
        view: View,
        dtype: np.dtype,
        workspaces: WorkspacePool,
        threads: Workers,
        seen: Seen = NO_PARTS,
    ) -> "list[ShadowMap | None]":
        """Return the maps of all lights in a type, None for those that cast no shadows here; those of lights that are
        where they were in the picture before, and that show the same, are kept. `seen` is what `slice_view` returns.

        Raises SceneError where they would have more than MAX_TEXELS numbers.
        """
        maps: list[ShadowMap | None] = [None] * len(plan.tables.lights)
        moved, n_number = {}, 0
        for k in self._list_lights() if self._casters is not None else ():
            light, parts = plan.tables.lights[k], seen.get(k, ())
            place, (last_place, maps[k]) = place_of(light, view, parts), self._maps.get((k, dtype), (None, None))
            if place != last_place:
                moved[k] = place, plan_maps(light, view, self._casters, parts)
                n_number += moved[k][1].n_number if moved[k][1] is not None else 0
            elif maps[k] is not None:
                n_number += len(maps[k].block)
        if n_number > MAX_TEXELS and any(map(len, seen.values())):  # there is room for fewer maps
            return self.draw(plan, view, dtype, workspaces, threads)
        if n_number > MAX_TEXELS:
            raise SceneError(
                f"the shadow maps of all lights may have {MAX_TEXELS} texels; this scene needs {n_number}: "
                "choose a smaller shadow size, or fewer cells of area lights"
            )
        for k, (place, planned) in moved.items():
            self._maps.pop((k, dtype), None)  # the next one is drawn into its memory
            drawn = planned and draw_maps(planned, self._casters, dtype, workspaces, threads, maps[k])
            self._maps[k, dtype], maps[k] = (place, drawn), drawn
        for shadow_map in maps:
            if shadow_map is not None:
                shadow_map.fit_view(view.eye, plan)
        return maps

    def _list_lights(self) -> list[int]:
        """List the lights that cast shadows, and that some material reflects."""
        tables = self._plan.tables
        return [k for k in tables.lit_by if shadow_of(tables.lights[k]) is not None]

    def is_far(self, view: View, seen: Seen = NO_PARTS) -> bool:
        """Tell whether float32 moves any point that shadows are asked for too far in one view."""
        return any(not shift <= MAX_SHIFT * texel for shift, texel in self.shifts_in(view, seen))

    def shifts_in(self, view: View, seen: Seen = NO_PARTS) -> Iterator[tuple[float, float]]:
        """Yield of each map of each light how far float32 moves points in a view, and the width of a texel, scene
        units.

        Positions are rounded to ROUNDINGS·u of their distances (pipeline/shadow_lookup.py), from the eye to the light
        and from there to the points. That must be no more than MAX_SHIFT of a texel's width where the scene is furthest
        from the light: up to there float32 and float64 show the same shadows, but for edges that move by so much. So it
        holds where the eye and the lights are no further from the scene than some twenty times its extent, with maps of
        1024 texels, and half as far with twice as many. Points that are lit before they are drawn may lie anywhere.
        """
        for k in self._list_lights():
            light, parts = self._plan.tables.lights[k], seen.get(k, ())
            place, (last_place, found) = place_of(light, view, parts), self._extents.get(k, (None, ()))
            if place != last_place:
                found = measure_extents(light, view, self._corners, parts, self._plan.is_lit_per_sample)
                self._extents[k] = place, found
            for origin, extent, texel in found:
                yield lookup.ROUNDINGS * SINGLE * (extent + float(np.abs(origin - view.eye).sum())), texel


def place_of(light: Any, view: View, parts: Slices) -> tuple:
    """Return what the maps of a light follow from, beside the scene, as what can be compared: where it shines, if it
    moves with the camera, and of parallel rays the parts of what the picture shows that have maps of their own."""
    beam = entry_of(light).beam(light, view)
    if beam is None:
        return ()
    carried = (None if part is None else np.asarray(part).tobytes() for part in beam if is_carried(light))
    return (*carried, *(points.tobytes() for points in parts))


def measure_extents(
    light: Any, view: View, corners: NDArray[np.float64], parts: Slices, is_lit_per_sample: bool
) -> list[tuple[NDArray[np.float64], float, float]]:
    """Return where a light is, (3,), how far the boxes (n_mesh, 8, 3) extend from there, a sum of components, and the
    least width of a texel where they are furthest from the light, on a surface that faces it, scene units. Of parallel
    rays for each map, and of what is seen there."""
    beam = entry_of(light).beam(light, view)
    if beam is None:
        return [(np.zeros(3), 0.0, math.inf)]
    maps, least = choose_views(beam, corners, shadow_of(light), parts), math.inf
    points = (corners - maps.origin).reshape(-1, 3)
    if beam.origin is None:
        shown = [points if part is None or not is_lit_per_sample else part - maps.origin for part in maps.parts]
        extents = [float(np.abs(part).sum(axis=1).max()) for part in shown]
        texels = [1.0 / max(projection.scale_x, projection.scale_y) for _, projection in maps.views]
        return [(maps.origin, *found) for found in zip(extents, texels, strict=True)]
    for (light_view, projection), is_needed in zip(maps.views, maps.is_needed, strict=True):
        furthest = float((points @ light_view.forward).max())
        if is_needed and furthest > 0.0:
            least = min(least, furthest / max(projection.scale_x, projection.scale_y))
    return [(maps.origin, float(np.abs(points).sum(axis=1).max()), least)]


# ---------------------------------------------------------------- the maps of one light


class ShadowMap(NamedTuple):
    """The maps of one light."""

    block: NDArray[np.floating]  # the header, and the texels; float32 or float64
    origin: NDArray[np.float64]  # (3,) world space: what the maps' coordinates are relative to

    def fit_view(self, eye: NDArray[np.float64], plan: Plan) -> None:
        """Write what depends on the view: the origin relative to the eye, as the positions of surface points are, and
        how far the normals of the materials that are lit in the map's type may be turned.

        A normal errs by no more than normal_limit allows its planes, or than exact setups do; normalising it, and its
        products with the axes of the map and with the position, by 8 u.
        """
        limits, u = plan.of_materials.normal_limits[~plan.of_materials.is_double], _unit(self.block.dtype)
        turned = NORMALS + 8 if u == DOUBLE else max(np.sqrt(3.0) * limits.max(initial=0.0), NORMALS) + 8
        radius = int(self.block[lookup.FILTER]) >> 1
        self.block[lookup.ORIGIN : lookup.ORIGIN + 3] = self.origin - eye
        self.block[lookup.NORMAL_ERROR] = turned * u * (0.5 + radius)


class PlannedMaps(NamedTuple):
    """The maps of one light, not drawn yet."""

    maps: "MapViews"
    shadow: Any

    @property
    def n_number(self) -> int:
        """How many numbers they take."""
        return lookup.HEADER + sum(self.maps.is_needed) * map_side(self.shadow) ** 2


def plan_maps(light: Any, view: View, casters: Casters, parts: Slices = ()) -> PlannedMaps | None:
    """Return which maps show what a light sees; one that is attached to the camera is where `view` puts it. `parts` is
    what `choose_parts` returns.

    None where it reaches nothing. Raises SceneError where the light has no beam.
    """
    beam = entry_of(light).beam(light, view)
    if beam is None:
        raise SceneError(f"a {type(light).__name__} shines from no single place or direction, so it casts no shadows")
    if not reaches(light, beam, casters.corners):
        return None
    return PlannedMaps(choose_views(beam, casters.corners, light.shadow, parts), light.shadow)


def draw_maps(
    planned: PlannedMaps, casters: Casters, dtype: np.dtype, workspaces: WorkspacePool, threads: Workers,
    before: ShadowMap | None = None,
) -> ShadowMap:  # fmt: skip
    """Draw the maps of a light.

    What depends on the view that the picture shows is written by `ShadowMap.fit_view`.

    Parameters
    ----------
    dtype : of the map
    before : the light's map in the picture before, whose memory is used again where it is alike
    """
    (maps, shadow), u, n_number = planned, _unit(dtype), planned.n_number
    size = map_side(shadow)
    is_alike = before is not None and len(before.block) == n_number and before.block.dtype == dtype
    block = before.block if is_alike else np.empty(n_number, dtype)

    # What all maps of the light share, but for what depends on the view of the picture.
    header = [lookup.N_MAP, lookup.SIZE, lookup.FILTER, lookup.IS_PERSPECTIVE]
    block[header] = len(maps.views), size, shadow.filter, maps.views[0][1].is_perspective
    block[lookup.POSITION_ROUNDING] = lookup.ROUNDINGS * u if u == SINGLE else DOUBLE_ROUNDING

    layers = iter(block[lookup.HEADER :].reshape(-1, size, size))
    for k, (seen_from, projection) in enumerate(maps.views):
        row = block[lookup.MAPS + lookup.N_MAP_COLUMN * k :][: lookup.N_MAP_COLUMN]
        row[lookup.FILTER_RANGE] = (shadow.filter + 2) / min(projection.scale_x, projection.scale_y)
        row[lookup.LAYER] = sum(maps.is_needed[:k]) if maps.is_needed[k] else -1
        if maps.is_needed[k]:
            depths = draw_layer(seen_from, projection, casters, next(layers), workspaces, threads)
            _write_view(row, seen_from, projection, depths, size)
    return ShadowMap(block, maps.origin)


def draw_layer(view: View, projection: Projection, casters: Casters, texels, workspaces, threads) -> DepthScale:
    """Draw one map of a light, texels (size, size); return what its depths mean."""
    size, geometry = len(texels), casters.geometry
    planes = border_planes(view, projection, size) if projection.is_perspective else None
    with np.errstate(over="ignore", invalid="ignore"):
        is_any_beyond = planes is not None and ((casters.corners - view.eye) @ planes.T < 0.0).any()
    if is_any_beyond:
        casters = casters.some(list_seen_faces(geometry.positions, geometry.vertex, view.eye, planes))
    screen = _fit_screen(view, projection, casters, size)
    depths, sides = scale_depths(screen), casters.inner_sides
    n_sample, is_finite = (size, size), np.isfinite(projection[:4]).all()  # else it is narrower than a number can say
    if not (is_finite and are_seen_from_outside(view, screen, n_sample, casters.bounds).all()):
        sides = None
    render_pass = ShadowMapPass(
        attributes=NONE,
        n_sample=n_sample,
        hidden_sides=sides,
        cut_outs=None if casters.cut_outs is None else casters.cut_outs._replace(depths=depths),
        depths=depths,
        texels=texels,
    )
    draw(casters.geometry, render_pass, screen, workspaces, threads, NO_CLOCK)
    return depths


def _unit(dtype) -> float:
    """The unit roundoff of a type."""
    return SINGLE if dtype == np.float32 else DOUBLE


def _write_view(row, view: View, projection: Projection, depths: DepthScale, size: int) -> None:
    """Write where a map was drawn from, so that a lookup can find a point's texel, and how far it is off.

    Its values, 1/w or depth, are off by the rounding of planes of depth. From the sample where such a plane has its
    value, it is less than `size` steps to any texel, along both axes: half a unit of the z-buffer each, and
    DEPTH_PLANE_ROUNDING. The slack is texels that a limit is raised by, times its slopes: half a one, and the rounding
    of a position on the map. That is a sum of two terms, of four factors each: 8 u of the largest.
    """
    for start, axis in ((lookup.RIGHT, view.right), (lookup.UP, view.up), (lookup.FORWARD, view.forward)):
        row[start : start + 3] = axis
    row[[lookup.SCALE_X, lookup.SCALE_Y, lookup.CENTER_X, lookup.CENTER_Y]] = projection[:4]
    unit = abs(depths.inv_w_scale if depths.is_perspective else depths.depth_scale)
    row[lookup.ROUNDING] = (size + DEPTH_PLANE_ROUNDING) * unit
    largest = max(abs(projection.center_x), abs(projection.center_y))
    row[lookup.SLACK] = 0.5 + 8 * _unit(row.dtype) * (size + largest)


def _fit_screen(view: View, projection: Projection, casters: Casters, size: int) -> Screen:
    """The screen of a map, its depths fitted to what is seen there."""
    depth = (casters.corners.reshape(-1, 3) - view.eye) @ view.forward
    nearest, furthest = float(depth.min()), float(depth.max())
    if not projection.is_perspective:
        window, is_part = Window(view, projection, (size, size), (-np.inf, np.inf)), False
        if not window.holds(casters.corners).all():
            window = window._replace(depths=(nearest, furthest))
            depth = (window.meet(casters.corners, casters.bounds) - view.eye) @ view.forward
            is_part = len(depth) > 0
        nearest, furthest = _extent(depth) if is_part else (nearest, furthest)
        margin = NEAREST * max(furthest - nearest, np.abs(depth).max(initial=0.0))
        fitted = nearest - margin, furthest + margin
        return make_screen(view, projection, fitted, fitted[0], fitted[1] if is_part else np.inf)
    furthest = (furthest if furthest > 0.0 else 1.0) * (1 + NEAREST)
    near = max(nearest * (1 - NEAREST), furthest * NEAREST)
    return fit_screen(view, projection, (near, furthest), np.inf, casters.geometry, (size, size))[0]


# ---------------------------------------------------------------- what the maps of a light show


class MapViews(NamedTuple):
    """How the maps of one light see the scene."""

    origin: NDArray[np.float64]  # (3,) world space: what the maps' coordinates are relative to
    views: list[tuple[View, Projection]]
    is_needed: list[bool]  # False for a map that shows no caster, or that nothing asks
    parts: Sequence[NDArray[np.float64] | None] = (None,)  # what each is fitted to; None = the scene


def choose_views(beam: Beam, corners: NDArray[np.float64], shadow: Any, parts: Slices = ()) -> MapViews:
    """Choose the views that a light's maps show of the scene.

    Parameters
    ----------
    corners : (n_mesh, 8, 3) of boxes round all that casts shadows, and all that they fall on, world space
    shadow : Shadow of the light
    parts : what `choose_parts` returns
    """
    if beam.origin is None:
        return _choose_parallel_views(beam, corners, shadow, parts)
    origin = beam.origin
    corners, radius = corners - origin, shadow.filter >> 1
    points = corners.reshape(-1, 3)
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


def _choose_parallel_views(beam: Beam, corners: NDArray[np.float64], shadow: Any, parts: Slices) -> MapViews:
    """Fit a map to each part, and the last one to the whole scene."""
    whole = corners.reshape(-1, 3)
    origin = (parts[0] if len(parts) else whole).mean(axis=0)
    view = _look(origin, beam.axis)
    views = [(view, _fit_parallel(view, points, shadow)) for points in (*parts, whole)]
    return MapViews(origin, views, [True] * len(views), [*parts, None])


def choose_parts(beam: Beam, corners: NDArray[np.float64], shadow: Any, seen: Slices) -> Slices:
    """Choose the slices of what is seen whose maps are finer than that of the whole scene, in a light's parallel rays.

    Texels narrower than DOUBLE_ROUNDING of the scene's extent show nothing but rounding. `seen` is what `slice_view`
    returns.
    """
    whole = corners.reshape(-1, 3)
    view = _look(whole.mean(axis=0), beam.axis)
    extent, last, parts = np.abs(whole - view.eye).sum(axis=1).max(), _fit_parallel(view, whole, shadow), []
    for points in seen:
        found = _fit_parallel(view, points, shadow)
        is_finer = found.scale_x > FINER * last.scale_x or found.scale_y > FINER * last.scale_y
        if is_finer and max(found.scale_x, found.scale_y) * DOUBLE_ROUNDING * extent < 1.0:
            parts.append(points)
    return parts


def _fit_parallel(view: View, points: NDArray[np.float64], shadow: Any) -> Projection:
    """The projection that shows points (n, 3) in parallel rays along a view."""
    relative = points - view.eye
    return _fit_projection(_extent(relative @ view.right), _extent(relative @ view.up), shadow, False)


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


# ---------------------------------------------------------------- what a picture shows

# Corners of a box at both ends of its twelve edges, as `corners_of` counts them.
EDGES = np.array([(k, k | 1 << axis) for axis in range(3) for k in range(8) if not k >> axis & 1]).T


class Window(NamedTuple):
    """What lies in a picture between two depths."""

    view: View
    projection: Projection
    size: tuple[int, int]
    depths: tuple[float, float]

    @property
    def planes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Normals (6, 3) and offsets (6,): what lies within is normal·(p - eye) + offset >= 0 for each."""
        (width, height), (near, far), lens = self.size, self.depths, self.projection
        forward, skew = self.view.forward, lens.skew * self.view.up
        x, y = lens.scale_x * self.view.right - skew, lens.scale_y * self.view.up
        borders = np.array([lens.center_x, width - lens.center_x, height - lens.center_y, lens.center_y])
        sides, offsets = np.array([x, -x, y, -y]), borders
        if lens.is_perspective:
            sides, offsets = sides + borders[:, None] * forward, np.zeros(4)
        return np.vstack([sides, [forward, -forward]]), np.append(offsets, [-near, far])

    @property
    def corners(self) -> NDArray[np.float64]:
        """(8, 3) world space, in the order of `corners_of`."""
        (across, upward), lens, forward = self.projection.ray_axes(self.view), self.projection, self.view.forward
        found = []
        for k in range(8):
            ends = (0, self.size[0]), (0, self.size[1]), self.depths
            x, y, depth = (pair[k >> axis & 1] for axis, pair in enumerate(ends))
            beside = (x - lens.center_x) / lens.scale_x * across + (lens.center_y - y) / lens.scale_y * upward
            found.append(self.view.eye + depth * forward + beside * (depth if lens.is_perspective else 1.0))
        return np.array(found)

    def holds(self, corners: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell which points (..., 3) lie within."""
        normals, offsets = self.planes
        return ((corners - self.view.eye) @ normals.T + offsets >= 0.0).all(axis=-1)

    def meet(self, corners: NDArray[np.float64], bounds: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the corners of what is left of boxes within the window, (n, 3).

        A corner lies on three planes of both bodies together: where an edge of one ends within the other, or meets one
        of its planes.
        """
        normals, offsets = self.planes
        is_there = ~((corners - self.view.eye) @ normals.T + offsets < 0.0).all(axis=1).any(axis=-1)
        corners, (low, high) = corners[is_there], bounds[is_there].swapaxes(0, 1)
        of_boxes = _clip_edges(corners, normals, offsets - normals @ self.view.eye)
        of_window = _clip_edges(self.corners, np.vstack([np.eye(3), -np.eye(3)]), np.hstack([-low, high])[:, None])
        return np.concatenate([of_boxes, of_window])


def _clip_edges(corners, normals, offsets) -> NDArray[np.float64]:
    """Return the ends (n, 3) of what is left of edges of boxes (..., 8, 3) where normal·p + offset >= 0 for all planes.

    Source: Cyrus & Beck 1978, "Generalized two- and three-dimensional clipping", Computers & Graphics 3, 23-28.
    """
    starts, ends = corners[..., EDGES[0], :], corners[..., EDGES[1], :]
    first, last = starts @ normals.T + offsets, ends @ normals.T + offsets  # (..., 12, n_plane)
    share = first / np.where(first == last, 1.0, first - last)
    enters = np.where(first < 0.0, np.where(last < 0.0, np.inf, share), 0.0).max(axis=-1)
    leaves = np.where(last < 0.0, np.where(first < 0.0, -np.inf, share), 1.0).min(axis=-1)
    is_left = enters <= leaves
    shape = (*is_left.shape, 3)
    starts, ways = np.broadcast_to(starts, shape)[is_left], np.broadcast_to(ends - starts, shape)[is_left]
    return np.concatenate([starts + share[is_left][:, None] * ways for share in (enters, leaves)])


def slice_view(
    view: View, screen: Screen, n_sample: tuple[int, int], corners: NDArray[np.float64], bounds: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Return points round what a picture shows of boxes, (n, 3) each, for each slice of its depths, the nearest first;
    none where it shows all of them.

    Parameters
    ----------
    screen : Screen of the picture, whose depths are fitted to what is seen
    n_sample : (width, height) of the picture in samples
    corners, bounds : (n_mesh, 8, 3) and (n_mesh, 2, 3) of the boxes
    """
    lens = Projection(*screen[5:9], screen.is_perspective, screen.skew)
    if Window(view, lens, n_sample, (screen.near, screen.far)).holds(corners).all():
        return []
    depth, n_slice = (corners - view.eye) @ view.forward, 1
    near, far = max(float(depth.min()), screen.near), min(float(depth.max()), screen.far)
    if lens.is_perspective and screen.z_scale != 0.0:
        near = max(near, screen.z_scale / (DEPTH_MARGIN - screen.z_offset))
    if not near < far:
        return []
    if lens.is_perspective:
        n_slice = min(max(math.ceil(math.log(far / near, SLICE)), 1), MAX_SLICES)
        depths = near * (far / near) ** (np.arange(n_slice + 1) / n_slice)
    else:
        depths = np.array([near, far])
    with np.errstate(all="ignore"):
        windows = (Window(view, lens, n_sample, (a, b)) for a, b in zip(depths[:-1], depths[1:], strict=True))
        found = [window.meet(corners, bounds) for window in windows]
    return [points for points in found if len(points)]


def corners_of(bounds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners of boxes (n, 2, 3), (n, 8, 3)."""
    return np.stack([bounds[:, [(k >> axis) & 1 for axis in range(3)], range(3)] for k in range(8)], axis=1)


def map_side(shadow: Any) -> int:
    """Return the texels along a side of a map: those of a Shadow, and on every side what its filter reaches beyond."""
    return shadow.size + 2 * (shadow.filter >> 1)


# ---------------------------------------------------------------- what a light reaches, and what its maps leave out


def reaches(light: Any, beam: Beam, corners: NDArray[np.float64]) -> bool:
    """Tell whether a light can reach any of the boxes (n_mesh, 8, 3): they lie within its range, and not beside its
    cone."""
    if beam.origin is None:
        return True
    low, high = corners.min(axis=1) - beam.origin, corners.max(axis=1) - beam.origin
    within = np.ones(len(corners), bool)
    if getattr(light, "range", None) is not None:
        nearest = np.maximum(np.maximum(low, -high), 0.0)
        within &= np.linalg.norm(nearest, axis=1) <= BEYOND_RANGE * light.range
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


def border_planes(view: View, projection: Projection, side: int) -> NDArray[np.float64] | None:
    """Return the planes that bound what a map with perspective may show, (5, 3) normals: see pipeline/clip.py. None
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
