"""A scene that is prepared for drawing, with what is kept from picture to picture; one picture, or its exact
buffers."""

import os
from collections.abc import Collection, Sequence
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError, shown
from ..geometry.points import gather_geometry
from ..geometry.surfaces import find_shortest_normal
from ..options import Options
from ..pipeline.gradients import Coding
from ..pipeline.resolve import Encoding, encode_picture
from ..pipeline.threads import Workers
from ..pipeline.transform import Screen
from ..pipeline.workspace import WorkspacePool, make_picture
from ..scene.camera import Camera
from ..scene.scene import Scene
from .attributes import (
    NONE,
    Attributes,
    NormalAttributes,
    light_all,
    lookup_step,
    make_buffer_coding,
    make_coding,
    make_encoding,
    scale_depths,
)
from .bounds import ErrorBounds, bound_buffers, bound_levels, furthest_of
from .buffers import BUFFER_TABLE, BufferTables
from .depth_range import check_depths, check_extent, depths_of_boxes, screen_of
from .draw import Counts, draw
from .passes import NO_MATERIALS, BufferPass, ColorPass, FaceTable, InterpolatedPass, LitPass
from .plan import Plan
from .view_plans import ViewPlan, ViewPlans

# ---------------------------------------------------------------- how long each stage of a picture takes


class Clock:
    """Milliseconds of each stage, in order."""

    def __init__(self) -> None:
        self.milliseconds: dict[str, float] = {}
        self._last = perf_counter()

    def lap(self, stage: str) -> None:
        """Add the time since the last lap to a stage."""
        now = perf_counter()
        self.milliseconds[stage] = self.milliseconds.get(stage, 0.0) + 1000.0 * (now - self._last)
        self._last = now


# ----------------------------------------------------------------
# How much memory a frame takes, and whether the machine has it: systems promise more than they have, and end the.
# process that asks them to keep it.

ALWAYS_THERE = 2**28  # bytes; for less nobody is asked
EDGE_BYTES = 8  # a sample, where edges are drawn: its depth, and the share that they cover
MEMORY_INFO = "/proc/meminfo"  # Linux: what there is, of which the part that nobody needs
MEMORY_LIMIT = "/sys/fs/cgroup/memory.max"  # what a container may have at most


def check_memory(options: Options, has_out: bool) -> None:
    """Refuse a picture that this machine's memory can't hold, before the system ends the process for it.

    Parameters
    ----------
    options : what is drawn
    has_out : whether the caller has brought the room for the bytes

    Raises SceneError, which says what to do.
    """
    width, height = options.size
    needed = width * height * count_pixel_bytes(options, has_out)
    if needed <= ALWAYS_THERE:
        return
    available = available_memory()
    if available is not None and needed > available:
        raise SceneError(
            f"a picture of {width}x{height} pixels takes {needed / 1e9:.3g} GB in memory, and {available / 1e9:.3g} GB "
            "are there: draw a smaller one"
        )


def count_pixel_bytes(options: Options, has_out: bool) -> int:
    """Return how many bytes of memory a pixel of a frame takes; the caller has brought those of its colour where
    `has_out`."""
    outputs, n_byte = set(options.outputs), 0
    if outputs & {"color", "rgb"}:
        n_byte += 0 if has_out else 4
        n_byte += 16 if "color" in outputs or options.color_range == "global" else 0
    n_byte += EDGE_BYTES * options.factor**2 if options.edges else 0
    buffers = [BUFFER_TABLE[name] for name in outputs - {"color", "rgb"}]
    return n_byte + sum(np.dtype(buffer.dtype).itemsize * buffer.n_component for buffer in buffers)


def available_memory() -> int | None:
    """Return how many bytes this process may ask for; None where the system doesn't tell."""
    found = []
    try:
        words = Path(MEMORY_INFO).read_text().split()
        found.append(1024 * int(words[words.index("MemAvailable:") + 1]))
        found.append(int(Path(MEMORY_LIMIT).read_text()))
    except (OSError, ValueError):  # another system, or no limit
        pass
    if not found and hasattr(os, "sysconf") and {"SC_PHYS_PAGES", "SC_PAGE_SIZE"} <= set(os.sysconf_names):
        found.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    return min(found, default=None)


def checked_out(out: object, options: Options) -> NDArray[np.uint32]:
    """Return the array that takes the bytes of a picture, as (height, width) uint32."""
    width, height = options.size
    if not {"color", "rgb"} & set(options.outputs):
        raise SceneError("out takes a picture: ask for it with outputs=('color', ...) or ('rgb', ...)")
    is_fit = isinstance(out, np.ndarray) and out.shape == (height, width, 4) and out.dtype == np.uint8
    if not (is_fit and out.flags.c_contiguous and out.flags.writeable and out.ctypes.data % 4 == 0):
        given = f"{out.dtype} {out.shape}" if isinstance(out, np.ndarray) else shown(out)
        legal = f"a writable array ({height}, {width}, 4) of uint8, without gaps, at a multiple of 4 bytes"
        raise SceneError(f"out must be {legal}; given {given}")
    return np.asarray(out).view(np.uint32).reshape(height, width)


NO_SHAPES = np.empty((0, 5))  # of triangles, where no light casts shadows


class DrawnPicture(NamedTuple):
    """A picture, and what was done for it."""

    rgba: NDArray[np.uint8]  # (height, width, 4)
    color: NDArray[np.float32]  # (height, width, 3), linear; no rows where only bytes were asked for
    alpha: NDArray[np.float32]  # (height, width), the same
    counts: Counts
    view_plan: ViewPlan
    buffers: dict[str, NDArray] | None  # that were drawn beside it, by name; None where none were
    screen: Screen


def scale_of(brightest: float) -> float:
    """What a picture whose largest component is `brightest` is multiplied by where its range is global."""
    return 1.0 / max(1.0, brightest)


class PlanParts(NamedTuple):
    """What follows from a plan alone: kept until a view needs another one."""

    plan: Plan
    dtypes: tuple[np.dtype, ...]
    coding: Coding  # without depths
    encoding: Encoding


class PreparedScene:
    """Hold what doesn't depend on the camera, and the threads and memory that pictures are drawn with."""

    def __init__(self, scene: Scene, options: Options) -> None:
        self.scene, self.options = scene, options
        self.threads = Workers(options.n_thread)
        self.bounds = np.stack([mesh.bounds for mesh in scene.meshes])
        check_extent(self.bounds)
        self.geometry = gather_geometry(scene, options.is_flat)
        self.view_plans = ViewPlans(scene, options, self.geometry, self.bounds)
        self.normals = NormalAttributes(self.geometry)
        self.buffer_tables = BufferTables(scene, self.geometry)
        self.shadows: Any = self._make_shadows() if self.view_plans.casts_shadows else None
        self._edges: Any = None  # made for the first picture that shows edges
        self.workspaces = WorkspacePool()
        self._plan_parts: PlanParts | None = None  # those of the last picture

    def plan_for(self, camera: Camera) -> ViewPlan:
        """Return the plan for a view, before anything is drawn."""
        view = camera.view()
        screen = screen_of(camera, view, self.options.size, self.options.factor, self.geometry, self.bounds)
        return self.view_plans.plan_for(view, screen)

    def _make_shadows(self):
        from .shadow_maps import Shadows

        return Shadows(self.geometry, self.bounds, self.view_plans.plan)

    def draw_picture(self, camera: Camera, clock, out=None) -> DrawnPicture:
        """Draw the picture: the colour of every pixel.

        Parameters
        ----------
        clock : Clock, which notes the milliseconds of each stage
        out : (height, width) uint32, which takes the bytes; None = a new array
        """
        options, geometry, view = self.options, self.geometry, camera.view()
        with_color, is_global = "color" in options.outputs, options.color_range == "global"
        picture = make_picture(options.size, with_color or is_global, out)
        screen = screen_of(camera, view, options.size, options.factor, geometry, self.bounds)
        view_plan = self.view_plans.plan_for(view, screen)
        render_pass = self.color_pass(view, screen, view_plan.plan, picture, clock)
        is_beside = bool(self.buffer_names) and options.factor == 1  # buffers have one sample a pixel
        buffers = self.buffer_pass(camera, view, screen) if is_beside else None
        counts = draw(geometry, render_pass, screen, self.workspaces, self.threads, clock, buffers)
        if is_global:
            encoding = render_pass.encoding._replace(scale=scale_of(float(picture.color.max())))
            encode_picture(picture.color, picture.alpha, encoding, picture.rgba)
            clock.lap("encode")
        rgba = picture.rgba.view(np.uint8).reshape(*picture.rgba.shape, 4)
        beside = buffers.buffers if buffers else None
        return DrawnPicture(rgba, picture.color, picture.alpha, counts, view_plan, beside, screen)

    def color_pass(self, view, screen, plan, picture, clock) -> ColorPass:
        """Return the pass that draws `picture`: shadow maps are drawn, and points lit, before it."""
        options, parts = self.options, self._parts_of(plan)
        maps = dict.fromkeys(parts.dtypes, ())
        if plan.has_shadows:
            maps = {d: self.shadows.draw(plan, view, d, self.workspaces, self.threads) for d in parts.dtypes}
            clock.lap("shadows")
        lightings = {d: self.view_plans.lighting_for(plan, view, screen, d, maps[d]) for d in parts.dtypes}
        shared = {
            "coding": parts.coding._replace(depths=scale_depths(screen)),
            "size": options.size,
            "factor": options.factor,
            "is_culled": options.cull == "back",
            "plan": plan,
            "screen": screen,
            "encoding": parts.encoding,
            "picture": picture,
            "is_shaded_once": options.antialias == "shade-once",
        }
        if plan.is_lit_per_sample:
            attributes = self.normals.of(plan)
            face_table = FaceTable(self.shadows.shapes if plan.has_shadows else NO_SHAPES)
            return LitPass(attributes=attributes, face_table=face_table, lightings=lightings, **shared)
        attributes = self._light_points(plan, lightings, screen)
        clock.lap("light")
        return InterpolatedPass(attributes=attributes, face_table=FaceTable(NO_SHAPES), **shared)

    def _parts_of(self, plan: Plan) -> PlanParts:
        """What follows from a plan."""
        if self._plan_parts is None or self._plan_parts.plan is not plan:
            options = self.options
            step = lookup_step(options.factor, options.antialias == "shade-once")
            coding = make_coding(plan, options.tolerance, step)
            encoding = make_encoding(plan, self.scene.background, options.color_range)
            self._plan_parts = PlanParts(plan, plan.dtypes, coding, encoding)
        return self._plan_parts

    def _light_points(self, plan, lightings, screen) -> Attributes:
        """Intensities of the points, on both sides where normals may have to be flipped."""
        can_flip = self.options.cull != "back" or self.geometry.is_inverted.any()
        n_side = 1 if self.options.is_flat or not can_flip else 2
        normal_offsets = self.shadows.normal_offsets if plan.has_shadows else np.empty((2, 0))
        return light_all(self.geometry, plan, lightings, screen, n_side, normal_offsets, self.threads)

    def draw_edges(self, camera: Camera, rgba, color, alpha) -> None:
        """Draw the edges that are asked for over a picture; parameters are those of `EdgeOverlay.draw_over`."""
        if self._edges is None:
            from .edges import EdgeOverlay

            self._edges = EdgeOverlay(self)
        self._edges.draw_over(camera, rgba, color, alpha)

    @property
    def buffer_names(self) -> list[str]:
        """The exact buffers that are asked for."""
        return [name for name in self.options.outputs if name not in ("color", "rgb")]

    def buffer_pass(
        self, camera: Camera, view, screen, names: Sequence[str] | None = None, factor: int = 1
    ) -> BufferPass:
        """Return the pass that draws exact buffers; None = those that are asked for. They have
        `factor` samples a pixel along each axis. They have `factor` samples a pixel
        along each axis.

        Raises SceneError where the scene is deeper than a depth buffer can hold.
        """
        options, names = self.options, self.buffer_names if names is None else names
        if "depth" in names:
            check_depths(camera, view, self.bounds)
        normals, size = NONE, (options.size[0] * factor, options.size[1] * factor)
        if any(BUFFER_TABLE[name].needs_normals for name in names):
            normals = self.normals.of_faces(view, screen) if options.is_flat else self.normals.normals()
        return BufferPass(
            attributes=normals,
            coding=make_buffer_coding(screen, normals.double.shape[2]),
            size=size,
            is_culled=options.cull == "back",
            screen=screen,
            buffers={name: BUFFER_TABLE[name].make(size) for name in names},
            tables={name: (make(self.buffer_tables, view),) for name in names if (make := BUFFER_TABLE[name].table)},
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
        screen = screen_of(camera, view, self.options.size, factor, self.geometry, self.bounds)
        render_pass = self.buffer_pass(camera, view, screen, names, factor)
        render_pass.rows = rows
        geometry = self.geometry._replace(face_material=NO_MATERIALS)
        counts = draw(geometry, render_pass, screen, self.workspaces, self.threads, clock)
        return render_pass.buffers, counts, screen

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
        view = camera.view()
        if view_plan is not None:
            error = view_plan.error_bound
            found |= {"color": error} if "color" in outputs else {}
            found |= {"rgb": bound_levels(error, self.options.color_range), "filters": view_plan.filters}
            if view_plan.plan.has_shadows:
                found["shadows"] = self.shadows.list_bounds(view_plan.plan, view)
        shortest = 1.0 if {"normal", "normal_camera"}.isdisjoint(outputs) else self._shortest_normal
        nearest = depths_of_boxes(view, self.bounds)[0]
        found |= bound_buffers(outputs, screen, furthest_of(self.bounds, view.eye), nearest, shortest)
        return ErrorBounds(**found)

    @cached_property
    def _shortest_normal(self) -> float:
        """The least length of a mean of a face's normals."""
        if self.options.is_flat:
            return 1.0
        return float(find_shortest_normal(self.geometry.normals, self.geometry.corner))
