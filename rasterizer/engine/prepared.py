"""A scene that is prepared for drawing, with what is kept from picture to picture; one picture, or its exact buffers.

tables ─ plan, geometry (once) ─ screen, drawing: what float32 is enough for, pass (each picture) ─ draw.py
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..cores import Workers
from ..locks import cached_property
from ..options import Options
from ..pipeline.gradients import Coding
from ..pipeline.lighting import Lighting
from ..pipeline.resolve import Encoding, encode_picture
from ..pipeline.transform import Screen
from ..pipeline.workspace import WorkspacePool, make_picture
from ..scene.camera import Camera, View
from . import domains
from .attributes import (
    NONE,
    join_attributes,
    light_all,
    make_coding,
    make_encoding,
    scale_depths,
    turn_to_viewer,
)
from .buffers import BUFFER_TABLE, BufferTables
from .depth_range import are_seen_from_outside, check_depths, check_extent, screen_of
from .draw import draw
from .drawn import NO_CLOCK, Counts
from .passes import NO_PLANES, BufferPass, ColorPass, InterpolatedPass, LitPass
from .plan import Plan, make_plan
from .plan_summary import PlanSummary, summarize
from .points import Geometry, Part, gather_geometry, gather_inner_sides, list_opaque_fans, make_parts
from .scene_tables import SceneTables
from .uniforms import light_view, list_materials, with_functions


class DrawnPicture(NamedTuple):
    """A picture, and what was done for it."""

    rgba: NDArray[np.uint8]  # (height, width, 4)
    color: NDArray[np.float32]  # (height, width, 3), linear; no rows where only bytes were asked for
    alpha: NDArray[np.float32]  # (height, width), the same
    counts: Counts
    seen: "Seen"


class Drawing(NamedTuple):
    """The plan of a view, and what follows from it: the same for all views with the same shares of the tolerance."""

    plan: Plan
    normals: NDArray[np.float64]  # that Phong's method interpolates; NONE for other methods
    coding: Coding  # without depths
    encoding: Encoding
    lightings: dict[np.dtype, Lighting]  # by type, without what a view says of them
    summary: PlanSummary
    steps: tuple[Any, ...]  # see Stats


class Seen(NamedTuple):
    """What a view is drawn with, and what is stated of it: see Stats."""

    drawing: Drawing
    error_bound: float | None
    steps: tuple[Any, ...]


class PreparedScene:
    """Hold what doesn't depend on the camera, and the threads and memory that pictures are drawn with.

    What follows from the meshes and options alone is taken from another one, `like`, that has the same.
    """

    def __init__(self, tables: SceneTables, options: Options, like: "PreparedScene | None" = None) -> None:
        self.tables, self.options = tables, options
        self.threads, self.workspaces = Workers(options.n_thread), WorkspacePool()
        self._joined: dict[int, NDArray[np.float64]] = {}  # attributes, by their number
        self._drawings: dict[bytes, Drawing] = {}  # by the shares of the tolerance, see Plan
        for name in {"geometry", "_inner_sides"}.intersection(() if like is None else vars(like)):
            vars(self)[name] = vars(like)[name]

    @cached_property
    def geometry(self) -> Geometry:
        """All meshes as one set of arrays."""
        check_extent(self.tables.bounds)
        meshes, options, parts = self.tables.meshes, self.options, self._make_parts()
        return gather_geometry(meshes, options.is_flat, self.threads, options.shading != "phong", parts)

    def _make_parts(self) -> list[Part]:
        """Make each mesh's share of the geometry; meanwhile a thread looks for closed bodies, if they count."""
        meshes, is_flat, threads = self.tables.meshes, self.options.is_flat, self.threads
        if self.options.cull != "auto":
            return make_parts(meshes, is_flat, threads)
        fans = list_opaque_fans(meshes)
        jobs = [lambda: make_parts(meshes, is_flat, threads, fans), lambda: gather_inner_sides(meshes, fans)]
        parts, vars(self)["_inner_sides"] = threads.map(lambda job: job(), jobs)
        return parts

    @cached_property
    def _inner_sides(self) -> NDArray[np.int8]:
        """Which side of each triangle looks into a closed body, see geometry/closed.py."""
        return gather_inner_sides(self.tables.meshes, list_opaque_fans(self.tables.meshes))

    @cached_property
    def plan(self) -> Plan:
        """What the scene needs in any view."""
        return make_plan(self.tables, self.options, run=self.threads.map)

    def prepare(self) -> PlanSummary:
        """Make what all pictures share: the plan, then the geometry; return the plan in words."""
        check_extent(self.tables.bounds)
        summary = summarize(self.plan)
        vars(self).setdefault("geometry", self.geometry)
        return summary

    def _attributes(self, n_attribute: int) -> NDArray[np.float64]:
        """So many attributes of all points, kept from picture to picture."""
        if n_attribute not in self._joined:
            self._joined[n_attribute] = join_attributes(self.geometry, n_attribute)
        return self._joined[n_attribute]

    @cached_property
    def _buffer_tables(self) -> BufferTables:
        return BufferTables(self.tables, self.geometry)

    @cached_property
    def _shadows(self) -> Any:
        """The shadow maps of a scene that has some."""
        from .shadow_maps import Shadows

        inner_sides = self._inner_sides if self.options.cull == "auto" else None
        return Shadows(self.geometry, self.tables.bounds, self.plan, inner_sides)

    @cached_property
    def edges(self) -> Any:
        """The edges over its pictures."""
        from .edges import EdgeOverlay

        def draw_depths(camera: Camera) -> tuple[NDArray, Screen]:
            buffers, _, screen = self.draw_buffers(camera, NO_CLOCK, ("depth",), factor=self.options.factor)
            return buffers["depth"], screen

        has_background = self.tables.background is not None
        return EdgeOverlay(self.tables.meshes, self.options, draw_depths, has_background, self.threads)

    def _hidden_sides(self, view: View, screen: Screen, factor: int) -> NDArray[np.int8] | None:
        """Return which side of each triangle a view leaves out, see pipeline/cull.py; None where all are drawn.

        Closed bodies hide their inner sides where the viewer is outside, and the near plane cuts no hole into them.
        """
        if self.options.cull == "none":
            return None
        if self.options.cull == "back":
            return np.ones(self.geometry.vertex.shape[1], np.int8)
        n_sample = self.options.size[0] * factor, self.options.size[1] * factor
        is_outside = are_seen_from_outside(view, screen, n_sample, self.tables.bounds)
        if is_outside.all():
            return self._inner_sides
        return self._inner_sides * np.repeat(is_outside, [mesh.n_face for mesh in self.tables.meshes])

    def screen_for(self, camera: Camera, view: View, factor: int) -> Screen:
        """Return the screen of a camera, with `factor` samples a pixel along each axis; `view` is the camera's."""
        return screen_of(camera, view, self.options.size, factor, self.geometry, self.tables.bounds)

    def see(self, camera: Camera) -> Seen:
        """Return what a view is drawn with, and what is stated of it, before anything is drawn."""
        view = camera.view()
        return self._see(view, self.screen_for(camera, view, self.options.factor))

    def _see(self, view: View, screen: Screen) -> Seen:
        """The same on the screen of the picture."""
        tables, plan = self.tables, self.plan
        furthest = domains.furthest_of(tables.material_boxes, view)
        nearness = domains.nearness_in(tables, plan.clearances, view)
        roundings = plan.intensities.roundings_at(nearness)
        is_far = domains.is_far(plan, furthest, nearness, screen)
        if tables.has_shadows and not plan.of_materials.is_double.all():
            is_far = is_far or self._shadows.is_far(view)
        shares = plan.shares_at(roundings, is_far)
        key = shares.tobytes()
        if key not in self._drawings:
            self._drawings[key] = self._make_drawing(plan.with_shares(shares, is_far))
        drawing = self._drawings[key]
        unstated = domains.list_unstated(drawing.plan, roundings, domains.furthest_over_nearest(screen, furthest.max()))
        steps = (*drawing.steps, *domains.list_near_lights(tables, nearness, furthest))
        steps += tuple(domains.Step(reason, np.inf, "everywhere") for reason in unstated)
        return Seen(drawing, None if unstated else domains.stated_of(drawing.plan), steps)

    def _make_drawing(self, plan: Plan) -> Drawing:
        """Make what follows from a plan."""
        options = self.options
        coding = make_coding(plan, options.tolerance)
        return Drawing(
            plan=plan,
            normals=self._attributes(int(plan.of_materials.n_attributes.max())) if plan.is_lit_per_sample else NONE,
            coding=coding,
            encoding=make_encoding(plan, self.tables.background, options.color_range),
            lightings={
                dtype: with_functions(list_materials(plan, dtype), plan, dtype) for dtype in plan.of_materials.dtypes
            },
            summary=summarize(plan),
            steps=domains.list_steps(plan),
        )

    # ------------------------------------------------ the picture

    def draw_picture(self, camera: Camera, clock, out=None) -> DrawnPicture:
        """Draw the picture: the colour of every pixel.

        Parameters
        ----------
        clock : Clock, which notes the milliseconds of each stage
        out : (height, width) uint32, which takes the bytes; None = a new array
        """
        options, view = self.options, camera.view()
        with_color, is_global = "color" in options.outputs, options.color_range == "global"
        picture = make_picture(options.size, with_color or is_global, out)
        screen = self.screen_for(camera, view, options.factor)
        seen = self._see(view, screen)
        render_pass = self.color_pass(view, screen, seen.drawing, picture, clock)
        counts = draw(self.geometry, render_pass, screen, self.workspaces, self.threads, clock)
        if is_global:
            scale = 1.0 / max(1.0, float(picture.color.max()))
            encoding = render_pass.encoding._replace(scale=scale)
            encode_picture(picture.color, picture.alpha, encoding, picture.rgba)
            clock.lap("encode")
        rgba = picture.rgba.view(np.uint8).reshape(*picture.rgba.shape, 4)
        return DrawnPicture(rgba, picture.color, picture.alpha, counts, seen)

    def color_pass(self, view: View, screen, drawing: Drawing, picture, clock) -> ColorPass:
        """Return the pass that draws `picture`: shadow maps are drawn, and points lit, before it."""
        options, plan = self.options, drawing.plan
        maps: dict[np.dtype, Any] = dict.fromkeys(drawing.lightings, ())
        if plan.tables.has_shadows:
            maps = {dtype: self._shadows.draw(plan, view, dtype, self.workspaces, self.threads) for dtype in maps}
            clock.lap("shadows")
        lightings = {dtype: light_view(each, plan, view, maps[dtype]) for dtype, each in drawing.lightings.items()}
        shared = {
            "coding": drawing.coding._replace(depths=scale_depths(screen)),
            "size": options.size,
            "factor": options.factor,
            "hidden_sides": (hidden_sides := self._hidden_sides(view, screen, options.factor)),
            "plan": plan,
            "screen": screen,
            "encoding": drawing.encoding,
            "picture": picture,
        }
        if plan.is_lit_per_sample:
            planes = self._shadows.shapes if plan.tables.has_shadows else NO_PLANES
            return LitPass(attributes=drawing.normals, face_planes=planes, lightings=lightings, **shared)
        attributes = self._light_points(plan, lightings, screen, hidden_sides)
        clock.lap("light")
        return InterpolatedPass(attributes=attributes, **shared)

    def _light_points(self, plan: Plan, lightings, screen, hidden_sides) -> NDArray[np.float64]:
        """Intensities of the points, on both sides where normals may have to be flipped."""
        is_never_flipped = hidden_sides is not None and hidden_sides.min() == 1 and not self.geometry.is_inverted.any()
        n_side = 1 if self.options.is_flat or is_never_flipped else 2
        normal_offsets = self._shadows.normal_offsets if plan.tables.has_shadows else np.empty((2, 0))
        return light_all(self.geometry, plan, lightings, screen, n_side, normal_offsets, self.threads)

    # ------------------------------------------------ exact buffers

    @property
    def buffer_names(self) -> list[str]:
        """The exact buffers that are asked for."""
        return [name for name in self.options.outputs if name not in ("color", "rgb")]

    def buffer_pass(self, camera: Camera, view: View, screen, names: Sequence[str], factor: int = 1) -> BufferPass:
        """Return the pass that draws exact buffers, with `factor` samples a pixel along each axis.

        Raises SceneError where the scene is deeper than a depth buffer can hold.
        """
        options = self.options
        if "depth" in names:
            check_depths(camera, view, self.tables.bounds)
        normals, size = NONE, (options.size[0] * factor, options.size[1] * factor)
        if any(BUFFER_TABLE[name].needs_normals for name in names):
            normals = turn_to_viewer(self.geometry, view, screen) if options.is_flat else self._attributes(3)
        return BufferPass(
            attributes=normals,
            size=size,
            hidden_sides=self._hidden_sides(view, screen, factor),
            depths=scale_depths(screen),
            is_perspective=screen.is_perspective,
            buffers={name: BUFFER_TABLE[name].make(size) for name in names},
            tables={name: (make(self._buffer_tables, view),) for name in names if (make := BUFFER_TABLE[name].table)},
        )

    def draw_buffers(
        self, camera: Camera, clock, names: Sequence[str] | None = None, rows=None, factor: int = 1
    ) -> tuple[dict[str, NDArray], Counts, Screen]:
        """Draw exact buffers, by name, without a picture, on that screen: one sample a pixel, or `factor` along each
        axis.

        Parameters
        ----------
        clock : Clock, which notes the milliseconds of each stage
        names : which buffers; None = those that are asked for
        rows : (first, end) of those that are drawn; the others are left as they come. None = all
        """
        view = camera.view()
        screen = self.screen_for(camera, view, factor)
        render_pass = self.buffer_pass(camera, view, screen, self.buffer_names if names is None else names, factor)
        render_pass.rows = rows
        counts = draw(self.geometry, render_pass, screen, self.workspaces, self.threads, clock)
        return render_pass.buffers, counts, screen
