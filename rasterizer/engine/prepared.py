"""A scene that is prepared for drawing, with what is kept from picture to picture; one picture, or its exact buffers.

tables ─ geometry, plan, normals, shadow maps (once) ─ screen, plan of the view, pass (each picture) ─ draw.py
"""

from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import Job
from ..cores import Workers
from ..geometry.closed import gather_inner_sides, list_opaque_fans
from ..geometry.points import Geometry, Part, gather_geometry, make_parts
from ..locks import cached_property
from ..options import Options
from ..pipeline.gradients import Coding
from ..pipeline.lighting import Lighting
from ..pipeline.resolve import Encoding, encode_picture
from ..pipeline.textures import Textures
from ..pipeline.transform import Screen
from ..pipeline.workspace import WorkspacePool, make_picture
from ..scene.camera import Camera, View
from .attributes import (
    NONE,
    NormalAttributes,
    light_all,
    make_coding,
    make_encoding,
    sampled_in_double,
    scale_depths,
)
from .bounds import ErrorBounds, bound_buffers, bound_levels, furthest_of
from .buffers import BUFFER_TABLE, BufferTables
from .depth_range import are_seen_from_outside, check_depths, check_extent, depths_of_boxes, screen_of
from .draw import Counts, draw
from .passes import NO_TABLE, BufferPass, ColorPass, FaceTable, InterpolatedPass, LitPass
from .plan import Plan, ViewPlan, ViewPlans, keep
from .plan_summary import PathCounts, PlanSummary, summarize
from .scene_tables import SceneTables
from .texture_tables import lay_textures
from .uniforms import light_view, list_materials, with_functions


class DrawnPicture(NamedTuple):
    """A picture, and what was done for it."""

    rgba: NDArray[np.uint8]  # (height, width, 4)
    color: NDArray[np.float32]  # (height, width, 3), linear; no rows where only bytes were asked for
    alpha: NDArray[np.float32]  # (height, width), the same
    counts: Counts
    view_plan: ViewPlan
    screen: Screen


class PlanParts(NamedTuple):
    """What follows from the plan of a view alone."""

    plan: Plan
    dtypes: tuple[np.dtype, ...]  # its own
    normals: NDArray[np.float64]  # that Phong's method interpolates; NONE for other methods
    coding: Coding  # without depths
    textures: Textures | None  # see ColorPass
    encoding: Encoding
    summary: PlanSummary


class PreparedScene:
    """Hold what doesn't depend on the camera, and the threads and memory that pictures are drawn with.

    What follows from the meshes and options alone is taken from another one, `like`, that has the same.
    """

    def __init__(self, tables: SceneTables, options: Options, like: "PreparedScene | None" = None) -> None:
        self.tables, self.options = tables, options
        self.threads, self.workspaces = Workers(options.n_thread), WorkspacePool()
        self._lightings: dict[tuple, Lighting] = {}  # what is the same in all views, by type and features
        self._plan_parts: dict[int, PlanParts] = {}  # by the id of a plan that is kept there
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
    def view_plans(self) -> ViewPlans:
        """What each view needs."""
        return ViewPlans(self.tables, self.options, self.geometry, self.threads.map)

    @cached_property
    def _normals(self) -> NormalAttributes:
        return NormalAttributes(self.geometry)

    @cached_property
    def _buffer_tables(self) -> BufferTables:
        return BufferTables(self.tables, self.geometry)

    @cached_property
    def _shadows(self) -> Any:
        """The shadow maps of a scene that has some."""
        from .shadow_maps import Shadows

        inner_sides = self._inner_sides if self.options.cull == "auto" else None
        return Shadows(self.geometry, self.tables.bounds, self.view_plans.plan, inner_sides)

    @cached_property
    def edges(self) -> Any:
        """The edges over its pictures."""
        from .edges import EdgeOverlay

        return EdgeOverlay(self)

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

    def list_kernels(self, camera: Camera, plan: Plan | None = None) -> list[Job]:
        """List the kernels of a picture through a camera; see kernels_of_plan.py, which is imported where one is
        missing."""
        from .kernels_of_plan import list_kernels

        return list_kernels(self.tables, self.options, camera, plan)

    def screen_for(self, camera: Camera, view: View, factor: int) -> Screen:
        """Return the screen of a camera, with `factor` samples a pixel along each axis; `view` is the camera's."""
        return screen_of(camera, view, self.options.size, factor, self.geometry, self.tables.bounds)

    def plan_for(self, camera: Camera) -> ViewPlan:
        """Return the plan for a view, before anything is drawn."""
        view = camera.view()
        return self._plan_on(view, self.screen_for(camera, view, self.options.factor))

    def _plan_on(self, view: View, screen: Screen) -> ViewPlan:
        """The plan for a view, on the screen of its picture."""
        return self.view_plans.plan_for(view, screen, lambda: self._shadows.precision.shift(view))

    def summary_of(self, plan: Plan, paths: PathCounts | None = None) -> PlanSummary:
        """Return a plan in words, with how many triangles took which path."""
        return self._parts_of(plan).summary._replace(paths=paths)

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
        view_plan = self._plan_on(view, screen)
        render_pass = self.color_pass(view, screen, view_plan.plan, picture, clock)
        counts = draw(self.geometry, render_pass, screen, self.workspaces, self.threads, clock)
        if is_global:
            scale = 1.0 / max(1.0, float(picture.color.max()))
            encoding = render_pass.encoding._replace(scale=scale)
            encode_picture(picture.color, picture.alpha, encoding, picture.rgba)
            clock.lap("encode")
        rgba = picture.rgba.view(np.uint8).reshape(*picture.rgba.shape, 4)
        return DrawnPicture(rgba, picture.color, picture.alpha, counts, view_plan, screen)

    def color_pass(self, view: View, screen, plan: Plan, picture, clock) -> ColorPass:
        """Return the pass that draws `picture`: shadow maps are drawn, and points lit, before it."""
        options, parts = self.options, self._parts_of(plan)
        maps: dict[np.dtype, Any] = dict.fromkeys(parts.dtypes, ())
        if plan.has_shadows:
            maps = {d: self._shadows.draw(plan, view, d, self.workspaces, self.threads) for d in parts.dtypes}
            clock.lap("shadows")
        lightings = {d: light_view(self._lighting_in(plan, d), plan, view, maps[d]) for d in parts.dtypes}
        shared = {
            "coding": parts.coding._replace(depths=scale_depths(screen)),
            "size": options.size,
            "factor": options.factor,
            "hidden_sides": (hidden_sides := self._hidden_sides(view, screen, options.factor)),
            "plan": plan,
            "screen": screen,
            "encoding": parts.encoding,
            "textures": parts.textures,
            "picture": picture,
        }
        if plan.is_lit_per_sample:
            face_table = FaceTable(self._shadows.shapes) if plan.has_shadows else NO_TABLE
            return LitPass(attributes=parts.normals, face_table=face_table, lightings=lightings, **shared)
        attributes = self._light_points(plan, lightings, screen, hidden_sides)
        clock.lap("light")
        return InterpolatedPass(attributes=attributes, **shared)

    def _lighting_in(self, plan: Plan, dtype: np.dtype) -> Lighting:
        """The illumination in one type, but for what a view says of it."""
        key = dtype, plan.of_materials.features.tobytes()
        if key not in self._lightings:
            self._lightings[key] = with_functions(list_materials(plan, dtype), plan, dtype)
        return self._lightings[key]

    def _parts_of(self, plan: Plan) -> PlanParts:
        """What follows from a plan."""
        if id(plan) not in self._plan_parts:
            options = self.options
            coding = make_coding(plan, options.tolerance)
            encoding = make_encoding(plan, self.tables.background, options.color_range)
            normals = self._normals.of(plan) if plan.is_lit_per_sample else NONE
            textures = plan.textures and lay_textures(plan.textures, sampled_in_double(plan, coding), self.threads.map)
            parts = PlanParts(plan, plan.dtypes, normals, coding, textures, encoding, summarize(plan))
            keep(self._plan_parts, id(plan), parts)
        return self._plan_parts[id(plan)]

    def _light_points(self, plan: Plan, lightings, screen, hidden_sides) -> NDArray[np.float64]:
        """Intensities of the points, on both sides where normals may have to be flipped."""
        is_never_flipped = hidden_sides is not None and hidden_sides.min() == 1 and not self.geometry.is_inverted.any()
        n_side = 1 if self.options.is_flat or is_never_flipped else 2
        normal_offsets = self._shadows.normal_offsets if plan.has_shadows else np.empty((2, 0))
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
            normals = self._normals.of_faces(view, screen) if options.is_flat else self._normals.normals()
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

    # ------------------------------------------------ bounds

    def bound_outputs(
        self, camera: Camera, outputs: Collection[str], view_plan: ViewPlan | None, screen: Screen
    ) -> ErrorBounds:
        """Say how far each output of a picture may be off.

        Parameters
        ----------
        outputs : names of what was drawn
        view_plan : that of the picture; None without one
        screen : that of the buffers, or of the picture
        """
        found: dict[str, Any] = {}
        if view_plan is not None:
            error = view_plan.error_bound
            found |= {"color": error} if "color" in outputs else {}
            found |= {"rgb": bound_levels(error, self.options.color_range), "filters": view_plan.filters}
            if view_plan.plan.has_shadows:
                found["shadows"] = self._shadows.list_bounds(view_plan.plan)
        if self.buffer_names:
            view, bounds = camera.view(), self.tables.bounds
            has_means = not (self.options.is_flat or {"normal", "normal_camera"}.isdisjoint(outputs))
            shortest = self.view_plans.shortest_normal if has_means else 1.0
            nearest = depths_of_boxes(view, bounds)[0]
            found |= bound_buffers(outputs, screen, furthest_of(bounds, view.eye), nearest, shortest)
        return ErrorBounds(**found)
