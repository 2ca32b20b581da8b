"""The public way to render: `render` for one picture, `Renderer` for many of one scene."""

from collections.abc import Sequence
from dataclasses import fields
from time import perf_counter

import numpy as np

from .choices import ColorRange, Cull, Output, Samples, Shading
from .engine.attributes import NormalAttributes, point_intensities
from .engine.coding import make_coding, make_encoding
from .engine.depth_range import check_depths, screen_of
from .engine.draw import Counts, draw
from .engine.output_buffers import BUFFER_TABLE
from .engine.passes import BufferPass, FaceTable, InterpolatedPass, LitPass
from .engine.plan_summary import PlanSummary, Ways, summarize
from .engine.shadow_maps import Shadows
from .engine.uniforms import make_lighting
from .engine.view_plans import ViewPlan, ViewPlans
from .errors import SceneError, shown
from .frame import Frame, Stats
from .geometry.points import gather_geometry
from .options import Options
from .pipeline.encode import encode_picture
from .pipeline.gradients import EXACT
from .pipeline.threads import Workers
from .pipeline.workspace import WorkspacePool, make_picture
from .scene.camera import Camera
from .scene.scene import Scene, SceneLike


def render(
    scene: SceneLike,
    size: int | Sequence[int] = Options.size,
    *,
    shading: Shading = Options.shading,
    tolerance: float = Options.tolerance,
    samples: Samples = Options.samples,
    outputs: Output | Sequence[Output] = Options.outputs,
    cull: Cull = Options.cull,
    color_range: ColorRange = Options.color_range,
    exposure: float = Options.exposure,
    spectral: int | None = Options.spectral,
    threads: int | None = Options.threads,
) -> Frame:
    """Render a scene; what each option does is said at `Options`, where the defaults stand.

    Parameters
    ----------
    scene : Scene, or anything that a Scene takes as its meshes
    size : (width, height) in pixels, or one number for a square
    shading : "flat" or "lambert" (once a polygon), "gouraud" (once a vertex), "phong" (once a sample)
    tolerance : error accepted, in linear intensity where 1 is white; 0 = as exact as float64
    samples : samples a pixel: 1, 4, 9 or 16
    outputs : one name or several out of "color", "rgb", "depth", "face", "normal"
    cull : "none", or "back" to leave out faces that are clockwise as the viewer sees them
    color_range : what becomes of intensities above 1 in 8 bits: "clamp", "global" or "local"
    exposure : stops by which the light of the scene is multiplied
    spectral : number of samples of the spectrum, 3 to 401; None = 81 where something has a Spectrum, else three colours
    threads : how many; None = as many as the process may use

    Returns
    -------
    Frame

    Raises
    ------
    SceneError : an option or a part of the scene that is not legal
    ModelError : a mesh that is not legal
    """
    with Renderer(
        scene,
        size,
        shading=shading,
        tolerance=tolerance,
        samples=samples,
        outputs=outputs,
        cull=cull,
        color_range=color_range,
        exposure=exposure,
        spectral=spectral,
        threads=threads,
    ) as renderer:
        return renderer.render()


class Renderer:
    """Render many pictures of one scene: what doesn't depend on the camera is prepared once, and buffers are kept.

    Parameters are those of `render`. Use it as a context manager, or call `close`, to end its threads. One Renderer
    draws one picture at a time: threads that share one take turns, so each needs one of its own to draw at the same
    time. A forked process goes on with it, on threads of its own; pickled, it becomes a new one of the same scene and
    options.
    """

    def __init__(
        self,
        scene: SceneLike,
        size: int | Sequence[int] = Options.size,
        *,
        shading: Shading = Options.shading,
        tolerance: float = Options.tolerance,
        samples: Samples = Options.samples,
        outputs: Output | Sequence[Output] = Options.outputs,
        cull: Cull = Options.cull,
        color_range: ColorRange = Options.color_range,
        exposure: float = Options.exposure,
        spectral: int | None = Options.spectral,
        threads: int | None = Options.threads,
    ) -> None:
        self.scene = scene if isinstance(scene, Scene) else Scene(scene)
        self.options = Options(
            size=size,
            shading=shading,
            tolerance=tolerance,
            samples=samples,
            outputs=outputs,
            cull=cull,
            color_range=color_range,
            exposure=exposure,
            spectral=spectral,
            threads=threads,
        )
        self._bounds = np.stack([mesh.bounds for mesh in self.scene.meshes])
        self._geometry = gather_geometry(self.scene, self.options.is_flat)
        self._view_plans = ViewPlans(self.scene, self.options, self._geometry, self._bounds)
        self._normals = NormalAttributes(self._geometry)
        self._shadows = None
        if self._view_plans.plan.has_shadows:
            self._shadows = Shadows(self._geometry, self._bounds, self._view_plans.plan)
        self._summary = summarize(self._view_plans.plan, is_perspective=True)
        self._threads = Workers(self.options.n_thread)
        self._workspaces = WorkspacePool()
        self._is_closed = False

    @property
    def plan(self) -> PlanSummary:
        """What the last picture needed; before the first one, what the scene says of it."""
        return self._summary

    def __enter__(self) -> "Renderer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __reduce__(self) -> tuple:
        return _remake, (self.scene, {field.name: getattr(self.options, field.name) for field in fields(self.options)})

    def close(self) -> None:
        """End the threads, when the picture that is being drawn is done; the Renderer draws no more."""
        with self._threads.turn:
            self._is_closed = True
            self._threads.close()

    def render(self, camera: Camera | None = None) -> Frame:
        """Render the scene through its own camera, or through another one.

        Raises SceneError for what is no camera, and after `close`.
        """
        with self._threads.turn:
            return self._render(camera)

    def _render(self, camera) -> Frame:
        """Draw the picture if one is wanted, then the buffers."""
        if self._is_closed:
            raise SceneError("this Renderer is closed; make a new one")
        camera = self.scene.camera_for(self.options.size) if camera is None else camera
        if not isinstance(camera, Camera):
            raise SceneError(f"camera must be a Camera or None; given {shown(camera)}")
        outputs, size, clock = self.options.outputs, self.options.size, Clock()
        arrays, rgba, counts, error_bound, steps = {}, None, None, 0.0, ()
        if "color" in outputs or "rgb" in outputs:
            picture = make_picture(size, "color" in outputs or self.options.color_range == "global")
            counts, (plan, error_bound, steps) = self._draw_picture(camera, picture, clock)
            self._summary = summarize(plan, camera.is_perspective, Ways(counts.entries, counts.planes, counts.exact))
            rgba = picture.rgba.view(np.uint8).reshape(*picture.rgba.shape, 4)
            if "color" in outputs:
                arrays.update(color=picture.color, alpha=picture.alpha)
        if wanted := [name for name in outputs if name not in ("color", "rgb")]:
            buffers = {name: BUFFER_TABLE[name].make(size) for name in wanted}
            counts_of_buffers = self._draw_buffers(camera, buffers, clock)
            counts = counts or counts_of_buffers
            arrays.update(buffers)
        stats = Stats(
            *counts[:6],
            threads=self._threads.n_thread,
            error_bound=error_bound,
            steps=steps,
            milliseconds=clock.milliseconds,
            plan=self._summary,
        )
        return Frame(rgba, arrays, stats, size)

    def _draw_picture(self, camera, picture, clock) -> tuple[Counts, ViewPlan]:
        """Draw the picture: the colour of every pixel."""
        options, geometry, view = self.options, self._geometry, camera.view()
        screen = screen_of(camera, view, options.size, options.factor, geometry, self._bounds)
        view_plan = self._view_plans.plan_for(view, screen)
        plan, maps = view_plan.plan, ()
        if self._shadows is not None:
            maps = self._shadows.draw(view, self._workspaces, self._threads)
            clock.lap("shadows")
        lighting = make_lighting(plan, view, maps, screen.is_perspective)
        encoding = make_encoding(plan, self.scene.background, options.color_range)
        shared = {
            "coding": make_coding(plan, screen, options.tolerance),
            "size": options.size,
            "factor": options.factor,
            "is_culled": options.cull == "back",
            "plan": plan,
            "screen": screen,
            "encoding": encoding,
            "picture": picture,
        }
        if plan.is_lit_per_sample:
            attributes = self._normals.of(plan.dtype, plan.has_albedo, plan.has_tangents)
            face_table = FaceTable(geometry.face_material, self._shadow_shapes())
            render_pass = LitPass(attributes=attributes, face_table=face_table, lighting=lighting, **shared)
        else:
            attributes = self._light_points(plan, lighting, screen)
            clock.lap("light")
            face_table = FaceTable(geometry.face_material, np.empty((0, 5)))
            render_pass = InterpolatedPass(attributes=attributes, face_table=face_table, **shared)
        counts = draw(geometry, render_pass, screen, self._workspaces, self._threads, clock)
        if options.color_range == "global":
            encoding = encoding._replace(scale=1.0 / max(1.0, float(picture.color.max())))
            encode_picture(picture.color, picture.alpha, encoding, picture.rgba)
            clock.lap("encode")
        return counts, view_plan

    def _light_points(self, plan, lighting, screen) -> np.ndarray:
        """Intensities of the points, on both sides where normals may have to be flipped."""
        can_flip = self.options.cull != "back" or self._geometry.is_inverted.any()
        n_side = 1 if self.options.is_flat or not can_flip else 2
        normal_offsets = np.empty(0) if self._shadows is None else self._shadows.normal_offsets
        return point_intensities(self._geometry, plan, lighting, screen, n_side, normal_offsets, self._threads)

    def _shadow_shapes(self) -> np.ndarray:
        """What looking shadows up needs of each triangle; no rows where no light casts any."""
        return np.empty((0, 5)) if self._shadows is None else self._shadows.shapes

    def _draw_buffers(self, camera, buffers, clock) -> Counts:
        """Draw the exact buffers: always with one sample a pixel and float64 records, so that nothing else changes
        them."""
        options, view = self.options, camera.view()
        screen = screen_of(camera, view, options.size, 1, self._geometry, self._bounds)
        if "depth" in buffers:
            check_depths(camera, view, self._bounds)
        normals = self._normals.none()
        if any(BUFFER_TABLE[name].needs_normals for name in buffers):
            normals = self._normals.of_faces(view, screen) if options.is_flat else self._normals.of(np.float64)
        render_pass = BufferPass(
            attributes=normals,
            coding=make_coding(self._view_plans.plan._replace(coding=EXACT), screen, 0.0),
            size=options.size,
            is_culled=options.cull == "back",
            screen=screen,
            buffers=buffers,
        )
        return draw(self._geometry, render_pass, screen, self._workspaces, self._threads, clock)


def _remake(scene, options) -> Renderer:
    """What a pickled Renderer becomes."""
    return Renderer(scene, **options)


class Clock:
    """Milliseconds of each stage, in order."""

    def __init__(self):
        self.milliseconds = {}
        self._last = perf_counter()

    def lap(self, stage: str) -> None:
        """Add the time since the last lap to a stage."""
        now = perf_counter()
        self.milliseconds[stage] = self.milliseconds.get(stage, 0.0) + 1000.0 * (now - self._last)
        self._last = now
