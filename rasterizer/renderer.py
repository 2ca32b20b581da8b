"""The public way to render: `render` for one picture, `Renderer` for many of one scene."""

from collections.abc import Sequence
from dataclasses import fields
from time import perf_counter

from .choices import ColorRange, Cull, Output, Samples, Shading
from .compiler.kernels import compiling_ahead, noting_needs
from .engine.plan_summary import PlanSummary, summarize
from .engine.prepared_scene import PreparedScene
from .errors import RasterizerError, SceneError, shown
from .frame import Frame, Stats
from .options import Options
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
        with compiling_ahead(lambda: self._list_needs(self.scene.camera)):
            self._prepared = PreparedScene(self.scene, self.options)
        self._plan = summarize(self._prepared.view_plans.plan, is_perspective=True)
        self._is_closed = False

    @property
    def plan(self) -> PlanSummary:
        """What the last picture needed; before the first one, what the scene says of it."""
        return self._plan

    def __enter__(self) -> "Renderer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __reduce__(self) -> tuple:
        return _remake, (self.scene, {field.name: getattr(self.options, field.name) for field in fields(self.options)})

    def close(self) -> None:
        """End the threads, when the picture that is being drawn is done; the Renderer draws no more."""
        with self._prepared.threads.turn:
            self._is_closed = True
            self._prepared.threads.close()

    def render(self, camera: Camera | None = None) -> Frame:
        """Render the scene through its own camera, or through another one.

        Raises SceneError for what is no camera, and after `close`.
        """
        camera = self.scene.camera_for(self.options.size) if camera is None else camera
        if not isinstance(camera, Camera):
            raise SceneError(f"camera must be a Camera or None; given {shown(camera)}")
        with self._prepared.threads.turn, compiling_ahead(lambda: self._list_needs(camera)):
            return self._render(camera)

    def _list_needs(self, camera: Camera | None) -> dict:
        """Return the kernels that a picture through a camera needs, {(function, signature): True}.

        They are found out by drawing small ones in Python. What only the whole scene needs, such as clipping, is
        compiled when it is met.
        """
        import logging

        from .scene.sample import SIZE, sample_scene, sample_views

        options = {field.name: getattr(self.options, field.name) for field in fields(self.options)}
        with noting_needs() as needs:
            try:
                sample = sample_scene(self.scene)
                with Renderer(sample, **options | {"size": SIZE, "threads": 1}) as renderer:
                    for view in sample_views(sample, self.scene, camera):
                        renderer.render(view)
            except RasterizerError as fault:  # what was noted until then is of use
                logging.getLogger("rasterizer").info(
                    "not all kernels that the picture needs are known ahead: %s", fault
                )
        return needs

    def _render(self, camera) -> Frame:
        """Draw the picture if one is wanted, then the buffers."""
        if self._is_closed:
            raise SceneError("this Renderer is closed; make a new one")
        prepared, outputs, clock = self._prepared, self.options.outputs, Clock()
        arrays, rgba, counts, error_bound, steps = {}, None, None, 0.0, ()
        if "color" in outputs or "rgb" in outputs:
            rgba, color, alpha, counts, view_plan = prepared.draw_picture(camera, clock)
            error_bound, steps = view_plan.error_bound, view_plan.steps
            self._plan = view_plan.summary._replace(ways=counts.ways)
            if "color" in outputs:
                arrays.update(color=color, alpha=alpha)
        if set(outputs) - {"color", "rgb"}:
            buffers, counts_of_buffers = prepared.draw_buffers(camera, clock)
            counts = counts or counts_of_buffers
            arrays.update(buffers)
        stats = Stats(
            *counts[:6],
            threads=prepared.threads.n_thread,
            error_bound=error_bound,
            steps=steps,
            milliseconds=clock.milliseconds,
            plan=self._plan,
        )
        return Frame(rgba, arrays, stats, self.options.size)


def _remake(scene, options) -> Renderer:
    """What a pickled Renderer becomes."""
    return Renderer(scene, **options)


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
