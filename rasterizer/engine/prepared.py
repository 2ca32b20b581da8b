"""A scene that is prepared for drawing, with what is kept from picture to picture; one picture, or its exact buffers.

tables ─ plan, geometry (once) ─ screen, drawing: what float32 is enough for, pass (each picture) ─ draw.py
"""

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..cores import MIN_PART, Workers
from ..errors import SceneError, shown
from ..geometry.surfaces import compute_normal_offsets, compute_shapes
from ..locks import cached_property
from ..options import Options
from ..pipeline.gradients import Coding
from ..pipeline.lighting import Lighting
from ..pipeline.resolve import Encoding, encode_picture
from ..pipeline.transform import Screen
from ..pipeline.workspace import WorkspacePool, make_picture
from ..scene.camera import Camera, View
from ..scene.mesh import Mesh
from . import domains
from .buffers import BUFFER_TABLE, BufferTables
from .depth_range import are_seen_from_outside, check_depths, check_extent, scale_depths, screen_of, warn_of_cut
from .draw import NO_CLOCK, Counts, draw
from .lights import FAR, Step
from .lit_points import light_seen
from .passes import NO_PLANES, NONE, BufferPass, ColorPass
from .plan import PICTURES, Plan, PlanSummary, make_plan, summarize
from .points import Geometry, gather_geometry, gather_inner_sides, join_attributes, list_opaque_fans, turn_to_viewer
from .scene_tables import SceneTables
from .uniforms import light_view, make_coding, make_cut_outs, make_encoding, make_lighting

ALWAYS_THERE = 2**28  # bytes; for less the system is not asked
EDGE_BYTES = 8  # a sample, where edges are drawn: its depth, and the share that they cover
MAX_DRAWINGS = 64  # that are kept: many materials may share the tolerance in many ways
MEMORY_INFO = "/proc/meminfo"  # Linux: "MemAvailable" is what is free, or can be freed
MEMORY_LIMIT = "/sys/fs/cgroup/memory.max"  # of a container


class Drawing(NamedTuple):
    """The plan of a view, and what follows from it: the same for all views with the same shares of the tolerance."""

    plan: Plan
    coding: Coding  # without depths
    encoding: Encoding
    lightings: dict[np.dtype, Lighting]  # by type, without what a view says of them
    summary: PlanSummary
    steps: tuple[Any, ...]  # see Stats


class DrawnPicture(NamedTuple):
    """A picture, and what was done for it."""

    rgba: NDArray[np.uint8]  # (height, width, 4)
    color: NDArray[np.float32]  # (height, width, 3), linear; no rows where only bytes were asked for
    alpha: NDArray[np.float32]  # (height, width), the same
    counts: Counts
    summary: PlanSummary
    error_bound: float | None  # see Stats
    steps: tuple[Any, ...]
    scale: float  # what colours are multiplied by before they become bytes, in the colour range "global"; else 1


class PreparedMeshes:
    """Hold what follows from meshes and options alone, whatever the lights are, made when it is first asked for.

    Attributes
    ----------
    geometry : all meshes as one set of arrays
    inner_sides : (n_face,) int8, which side of each triangle looks into a closed body, see geometry/closed.py; None
        where nobody asks
    """

    def __init__(self, meshes: Sequence[Mesh], options: Options, threads: Workers) -> None:
        """Gather the geometry; meanwhile a thread looks for closed bodies, if they count."""
        self._meshes, self._options = meshes, options
        gather = partial(gather_geometry, meshes, options.is_flat, threads, options.shading != "phong")
        self.geometry: Geometry
        self.inner_sides: NDArray[np.int8] | None = None
        if options.cull != "auto":
            self.geometry = gather()
        else:
            fans = list_opaque_fans(meshes)
            jobs = partial(gather, fans=fans), partial(gather_inner_sides, meshes, fans)
            self.geometry, self.inner_sides = threads.map(partial.__call__, jobs)

    @cached_property
    def buffer_tables(self) -> BufferTables:
        """What buffers look up."""
        return BufferTables(self._meshes, self.geometry)

    @cached_property
    def edges(self) -> Any:
        """The edges of the meshes."""
        from .edges import join_edges

        return join_edges(self._meshes)

    @cached_property
    def shapes(self) -> NDArray[np.float64]:
        """The planes of all triangles, and their longest sides, (n_face, 5)."""
        out = np.empty((self.geometry.vertex.shape[1], 5))
        compute_shapes(self.geometry.positions, self.geometry.vertex, out)
        return out

    @cached_property
    def normal_offsets(self) -> NDArray[np.float64]:
        """The normal offsets of the points that are lit before they are drawn, (2, n_point)."""
        return compute_normal_offsets(self.geometry, self._options.is_flat)


class PreparedScene:
    """Hold what doesn't depend on the camera, and the threads and memory that pictures are drawn with.

    Attributes
    ----------
    n_sample : columns and rows of a picture's samples
    plan : what the scene needs in any view
    summary : the same in words
    of_meshes : what follows from the meshes
    geometry, inner_sides : those of them
    normals : what Phong's method interpolates, see `join_attributes`; NONE for other methods

    What follows from the meshes and options alone is taken from another one, `like`, that has the same.
    """

    def __init__(self, tables: SceneTables, options: Options, like: "PreparedScene | None" = None) -> None:
        check_extent(tables.bounds)
        self.tables, self.options, (width, height) = tables, options, options.size
        self.n_sample = width * options.factor, height * options.factor
        self.threads, self.workspaces = Workers(options.n_thread), WorkspacePool()
        # By the shares of the tolerance, see Plan, and the reason of those that need float64.
        self.drawings: dict[tuple[bytes, str], Drawing] = {}
        self.plan = make_plan(tables, options, run=self.threads.map, like=like.plan if like else None)
        self.summary = summarize(self.plan)
        self.of_meshes = like.of_meshes if like else PreparedMeshes(tables.meshes, options, self.threads)
        self.geometry, self.inner_sides = self.of_meshes.geometry, self.of_meshes.inner_sides
        self.normals = like.normals if like else NONE
        if self.plan.is_lit_per_sample and not like:
            self.normals = join_attributes(self.geometry, int(self.plan.of_materials.n_attributes.max()))

    @cached_property
    def _shadows(self) -> Any:
        """The shadow maps of a scene that has some."""
        from .shadow_maps import Shadows

        return Shadows(self.geometry, self.tables.bounds, self.plan, self.inner_sides)

    def slice_view(self, view: View, screen: Screen) -> Any:
        """Return what a view shows that shadow maps are fitted to, see `Shadows.slice_view`."""
        return self._shadows.slice_view(view, screen, self.n_sample) if self.tables.has_shadows else {}

    def _hidden_sides(self, view: View, screen: Screen, n_sample: tuple[int, int]) -> NDArray[np.int8] | None:
        """Return which side of each triangle a view leaves out, see pipeline/cull.py; None where all are drawn.

        Closed bodies hide their inner sides where the viewer is outside, and the near plane cuts no hole into them.
        """
        if self.options.cull == "none":
            return None
        if self.options.cull == "back":
            return np.ones(self.geometry.vertex.shape[1], np.int8)
        is_outside = are_seen_from_outside(view, screen, n_sample, self.tables.bounds)
        if is_outside.all():
            return self.inner_sides
        return self.inner_sides * np.repeat(is_outside, [mesh.n_face for mesh in self.tables.meshes])

    def see(self, view: View, screen: Screen, seen: Any) -> tuple[Drawing, float | None, tuple[Any, ...]]:
        """Return what a view is drawn with, on the screen of the picture, and what is stated of it: the error's bound,
        and the steps next to which it doesn't hold, see Stats. `seen` is what `slice_view` returns."""
        tables, plan, tolerance = self.tables, self.plan, self.options.tolerance
        reach = domains.measure_reach(plan, view, screen)
        is_far = domains.is_far(plan, reach, screen)
        if tables.has_shadows and not plan.of_materials.is_double.all():
            is_far = is_far or self._shadows.is_far(view, seen)
        shares = domains.share_of_tolerance(reach.roundings, tolerance)
        shares = np.where(plan.of_materials.is_double | is_far, np.inf, shares)
        why = FAR if is_far else domains.TOO_MUCH
        key = shares.tobytes(), why
        if key not in self.drawings:
            if len(self.drawings) == MAX_DRAWINGS:
                self.drawings.clear()
            self.drawings[key] = make_drawing(plan.with_shares(shares, why))
        drawing = self.drawings[key]
        bound, steps = domains.state(drawing.plan, reach)
        return drawing, bound, (*drawing.steps, *steps)

    # ------------------------------------------------ the picture

    def draw_picture(self, camera: Camera, clock, out=None, behind=None) -> DrawnPicture:
        """Draw the picture: the colour of every pixel.

        Parameters
        ----------
        clock : Clock, which notes the milliseconds of each stage
        out : (height, width) uint32, which takes the bytes; None = a new array
        behind : linear colour that is laid behind the picture later on; None = nothing
        """
        options, view = self.options, camera.view()
        with_color, is_global = "color" in options.outputs, options.color_range == "global"
        picture = make_picture(options.size, with_color or is_global, out)
        screen, is_cut = screen_of(camera, view, self.n_sample, self.geometry, self.tables.bounds)
        seen = self.slice_view(view, screen)
        drawing, bound, steps = self.see(view, screen, seen)
        if is_cut:
            why = f"what is nearer than {screen.near:.3g} is cut; give the camera a near plane"
            bound, steps = None, (*steps, Step(f"no bound is stated: {why}", np.inf, "everywhere"))
            warn_of_cut(screen, view, camera.projection(self.n_sample), self.n_sample, self.geometry.positions)
        render_pass = self.color_pass(view, screen, seen, drawing, picture, clock)
        counts = draw(self.geometry, render_pass, screen, self.workspaces, self.threads, clock)
        scale = 1.0
        if is_global:
            shown = picture.color
            if behind is not None:
                shown = (shown - np.float32(behind)) * picture.alpha[..., None] + np.float32(behind)
            scale = 1.0 / max(1.0, float(shown.max()))
            encoding = render_pass.encoding._replace(scale=scale)

            def encode(rows):
                part = slice(*rows)
                encode_picture(picture.color[part], picture.alpha[part], encoding, picture.rgba[part])

            width, height = options.size
            self.threads.map(encode, self.threads.ranges(height, -(-MIN_PART // width)))
            clock.lap("encode")
        rgba = picture.rgba.view(np.uint8).reshape(*picture.rgba.shape, 4)
        return DrawnPicture(rgba, picture.color, picture.alpha, counts, drawing.summary, bound, steps, scale)

    def color_pass(self, view: View, screen, seen, drawing: Drawing, picture, clock) -> ColorPass:
        """Return the pass that draws `picture`: shadow maps are drawn, and points lit, before it. `seen` is what
        `slice_view` returns."""
        plan, lightings = drawing.plan, {}
        for dtype, lighting in drawing.lightings.items():
            maps: Sequence[Any] = ()
            if plan.tables.has_shadows:
                maps = self._shadows.draw(plan, view, dtype, self.workspaces, self.threads, seen)
                clock.lap("shadows")
            lightings[dtype] = light_view(lighting, plan, view, maps)
        hidden_sides, light, planes = self._hidden_sides(view, screen, self.n_sample), None, NO_PLANES
        if plan.is_lit_per_sample and plan.tables.has_shadows:
            planes = self.of_meshes.shapes
        if not plan.is_lit_per_sample:
            # Intensities of the points, on both sides where normals may have to be flipped.
            is_never_flipped = hidden_sides is not None and hidden_sides.min() == 1
            is_never_flipped = is_never_flipped and not self.geometry.is_inverted.any()
            n_side = 1 if self.options.is_flat or is_never_flipped else 2
            normal_offsets = self.of_meshes.normal_offsets if plan.tables.has_shadows else np.empty((2, 0))
            light = partial(light_seen, self.geometry, plan, lightings, screen, n_side, normal_offsets, self.threads)
        return ColorPass(
            attributes=self.normals if plan.is_lit_per_sample else NONE,
            light=light,
            n_sample=self.n_sample,
            factor=self.options.factor,
            cut_outs=make_cut_outs(plan, self.geometry, scale_depths(screen)),
            face_planes=planes,
            hidden_sides=hidden_sides,
            lightings=lightings,
            coding=drawing.coding._replace(depths=scale_depths(screen)),
            plan=plan,
            screen=screen,
            encoding=drawing.encoding,
            picture=picture,
        )

    def draw_edges(self, camera: Camera, rgba: NDArray, color: NDArray | None, alpha: NDArray | None) -> None:
        """Draw the edges that the options ask for over a picture, the arrays of `edges.lay_over`, seen by a camera."""
        from .edges import cover, lay_over

        factor = self.options.factor
        buffers, _, screen = self.draw_buffers(camera, NO_CLOCK, ("depth",), factor=factor, min_opacity=0.0)
        share, seen = cover(self.of_meshes.edges, self.options, buffers["depth"], screen, self.threads)
        seen = seen if self.tables.background is None else np.ones(share.shape)
        lay_over(share, seen, self.options.edge_color, rgba, color, alpha)

    # ------------------------------------------------ exact buffers

    def draw_buffers(
        self, camera: Camera, clock, names: Sequence[str] | None = None, rows=None, factor: int = 1, min_opacity=None
    ) -> tuple[dict[str, NDArray], Counts, Screen]:
        """Draw exact buffers, by name, without a picture, on that screen: one sample a pixel, or `factor` along each
        axis.

        Parameters
        ----------
        clock : Clock, which notes the milliseconds of each stage
        names : which buffers; None = those that are asked for
        rows : (first, end) of those that are drawn; the others are left as they come. None = all
        min_opacity : from which opacity on a surface counts; None = as the options say

        Raises SceneError where the scene is deeper than a depth buffer can hold.
        """
        view, normals, (width, height) = camera.view(), NONE, self.options.size
        n_sample = width * factor, height * factor
        is_alone = names is None and not PICTURES & set(self.options.outputs)
        names = [name for name in self.options.outputs if name not in PICTURES] if names is None else names
        screen, is_cut = screen_of(camera, view, n_sample, self.geometry, self.tables.bounds)
        if is_cut and is_alone:  # else the picture has warned of it
            warn_of_cut(screen, view, camera.projection(n_sample), n_sample, self.geometry.positions)
        if "depth" in names:
            check_depths(camera, view, self.tables.bounds)
        if any(BUFFER_TABLE[name].needs_normals for name in names):
            is_flat, geometry = self.options.is_flat, self.geometry
            normals = turn_to_viewer(geometry, view, screen) if is_flat else join_attributes(geometry, 3)
        render_pass = BufferPass(
            attributes=normals,
            n_sample=n_sample,
            hidden_sides=self._hidden_sides(view, screen, n_sample),
            rows=rows,
            cut_outs=make_cut_outs(
                self.plan,
                self.geometry,
                scale_depths(screen),
                self.options.min_opacity if min_opacity is None else min_opacity,
            ),
            depths=scale_depths(screen),
            buffers={name: BUFFER_TABLE[name].make(n_sample) for name in names},
            tables={
                name: (make(self.of_meshes.buffer_tables, view),)
                for name in names
                if (make := BUFFER_TABLE[name].table)
            },
        )
        counts = draw(self.geometry, render_pass, screen, self.workspaces, self.threads, clock)
        return render_pass.buffers, counts, screen


def make_drawing(plan: Plan) -> Drawing:
    """Make what follows from the plan of a view."""
    lightings = {}
    for dtype in plan.of_materials.dtypes:
        lightings[dtype] = make_lighting(plan, dtype)
    return Drawing(plan, make_coding(plan), make_encoding(plan), lightings, summarize(plan), domains.list_steps(plan))


# ---------------------------------------------------------------- the memory of a frame
#
# Systems promise more memory than they have, and end the process that asks them to keep it.


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
    n_byte, outputs = EDGE_BYTES * options.factor**2 if options.edges else 0, set(options.outputs)
    if outputs & PICTURES:
        n_byte += 0 if has_out else 4
        n_byte += 16 if "color" in outputs or options.color_range == "global" else 0
    for name in outputs - PICTURES:
        n_byte += np.dtype(BUFFER_TABLE[name].dtype).itemsize * BUFFER_TABLE[name].n_component
    return n_byte


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
    if not PICTURES & set(options.outputs):
        raise SceneError("out takes a picture: ask for it with outputs=('color', ...) or ('rgb', ...)")
    is_fit = isinstance(out, np.ndarray) and out.shape == (height, width, 4) and out.dtype == np.uint8
    if not (is_fit and out.flags.c_contiguous and out.flags.writeable and out.ctypes.data % 4 == 0):
        given = f"{out.dtype} {out.shape}" if isinstance(out, np.ndarray) else shown(out)
        legal = f"a writable array ({height}, {width}, 4) of uint8, without gaps, at a multiple of 4 bytes"
        raise SceneError(f"out must be {legal}; given {given}")
    return np.asarray(out).view(np.uint32).reshape(height, width)
