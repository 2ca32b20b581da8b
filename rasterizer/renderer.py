"""The public way to render: `render` for one picture, `Renderer` for many of one scene."""

import os
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .choices import Antialias, ColorRange, Cull, Output, Samples, SavedArray, Shading
from .compiler.kernels import compiling_ahead, noting_needs
from .engine.memory import check_memory
from .engine.passes import RowSink
from .engine.plan_summary import PlanSummary, summarize
from .engine.prepared_scene import PreparedScene
from .errors import RasterizerError, SceneError, shown
from .frame import Frame, Stats
from .geometry.clusters import has_clusters
from .options import Options
from .scene.camera import Camera
from .scene.scene import Scene, SceneLike

if TYPE_CHECKING:
    from .io.row_files import RowFile


def render(
    scene: SceneLike,
    size: int | Sequence[int] = Options.size,
    *,
    shading: Shading = Options.shading,
    tolerance: float = Options.tolerance,
    samples: Samples = Options.samples,
    antialias: Antialias = Options.antialias,
    outputs: Output | Sequence[Output] = Options.outputs,
    cull: Cull = Options.cull,
    color_range: ColorRange = Options.color_range,
    exposure: float = Options.exposure,
    spectral: int | None = Options.spectral,
    threads: int | None = Options.threads,
    out: NDArray[np.uint8] | None = None,
) -> Frame:
    """Render a scene; what each option does is said at `Options`, where the defaults stand.

    Parameters
    ----------
    scene : Scene, or anything that a Scene takes as its meshes
    size : (width, height) in pixels, or one number for a square
    shading : "flat" or "lambert" (once a polygon), "gouraud" (once a vertex), "phong" (once a sample)
    tolerance : error accepted, in linear intensity where 1 is white; 0 = as exact as float64
    samples : samples a pixel: 1, 4, 9 or 16
    antialias : "supersample" (all is done for every sample), or "shade-once" (light and textures once for each
        polygon in a pixel)
    outputs : one name or several out of "color", "rgb", "depth", "face", "normal"
    cull : "none", or "back" to leave out faces that are clockwise as the viewer sees them
    color_range : what becomes of intensities above 1 in 8 bits: "clamp", "global" or "local"
    exposure : stops by which the light of the scene is multiplied
    spectral : number of samples of the spectrum, 3 to 401; None = 81 where something has a Spectrum, else three colours
    threads : how many; None = as many as the process may use
    out : (height, width, 4) uint8, which becomes the frame's `rgba`; None = a new array. See `Renderer.render`

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
        antialias=antialias,
        outputs=outputs,
        cull=cull,
        color_range=color_range,
        exposure=exposure,
        spectral=spectral,
        threads=threads,
    ) as renderer:
        return renderer.render(out=out)


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
        antialias: Antialias = Options.antialias,
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
            antialias=antialias,
            outputs=outputs,
            cull=cull,
            color_range=color_range,
            exposure=exposure,
            spectral=spectral,
            threads=threads,
        )
        with compiling_ahead(lambda: self._list_needs(self.scene.camera, is_prepared=False)):
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
        return _remake, (self.scene, _arguments_of(self.options))

    def close(self) -> None:
        """End the threads, when the picture that is being drawn is done; the Renderer draws no more."""
        with self._prepared.threads.turn:
            self._is_closed = True
            self._prepared.threads.close()

    def render(self, camera: Camera | None = None, *, out: NDArray[np.uint8] | None = None) -> Frame:
        """Render the scene through its own camera, or through another one.

        Parameters
        ----------
        camera : Camera; None = the scene's own
        out : (height, width, 4) uint8, without gaps, which takes the picture and becomes the frame's `rgba`: an array
            that is used again for every picture, memory that is shared, or a numpy.memmap. None = a new array

        Returns
        -------
        Frame

        Raises
        ------
        SceneError : what is no camera, an `out` that doesn't fit, a picture that this machine's memory can't hold; and
            after `close`
        """
        camera, words = self._checked_camera(camera), None if out is None else self._checked_out(out)
        with self._prepared.threads.turn, compiling_ahead(lambda: self._list_needs(camera)):
            return self._render(camera, words)

    def render_to(
        self, path: str | os.PathLike[str], camera: Camera | None = None, *, array: SavedArray | None = None
    ) -> Stats:
        """Render into a file; the same file as `render(camera).save(path, array=array)` writes.

        TIFF files, and .npy files of `color`, `rgb`, `rgba` or `alpha`, are written band by band while the picture is
        drawn: it may be larger than the memory. Nothing but what the file holds is drawn. With
        `color_range="global"` the picture is drawn twice. Other files are written when the picture is whole.

        Parameters
        ----------
        path : where to; the suffix chooses the format. The file appears whole or not at all
        camera : Camera; None = the scene's own
        array : which array a .npy file holds, as in `Frame.save`

        Returns
        -------
        Stats

        Raises
        ------
        OutputError : the file can't be written, or its folder has no room for it
        SceneError : what is no camera, an array that is unknown or was not asked for by `outputs`; and after `close`
        """
        from .io.row_files import RowFile, row_format_of

        is_path = isinstance(path, (str, os.PathLike))
        kind = row_format_of(Path(path).suffix.lower().lstrip("."), array) if is_path else None
        if kind is None or (os.path.exists(path) and not os.path.isfile(path)):  # a device or a pipe has no places
            frame = self.render(camera)
            frame.save(path, array=array)
            return frame.stats
        with RowFile(path, kind, self.options.size) as file:
            stats = self.render_rows(file, camera)
            file.move()
        return stats

    def render_rows(self, file: "RowFile", camera: Camera | None = None) -> Stats:
        """Render into a file, band by band, and leave it to the caller to move it to its place; see `render_to`.

        Parameters
        ----------
        file : RowFile of a picture of this size (io/row_files.py)
        camera : Camera; None = the scene's own
        """
        outputs, wanted = self.options.outputs, file.kind.array
        if "color" not in outputs and (wanted == "color" or "rgb" not in outputs):
            Frame(None, {}, None, self.options.size).array(wanted)  # says what to ask for
        camera, clock = self._checked_camera(camera), Clock()
        with self._prepared.threads.turn, compiling_ahead(lambda: self._list_needs(camera)):
            self._check_open()
            file.begin()
            with_color = wanted == "color" or (wanted == "alpha" and "color" in outputs)
            drawn = self._prepared.draw_picture(camera, clock, sink=RowSink(file.write_rows, with_color))
            file.end()
            self._plan = drawn.view_plan.summary._replace(ways=drawn.counts.ways)
            return self._stats(drawn.counts, drawn.view_plan, clock)

    def _checked_out(self, out) -> NDArray[np.uint32]:
        """Return the array that takes the bytes of a picture, as (height, width) uint32."""
        width, height = self.options.size
        if not {"color", "rgb"} & set(self.options.outputs):
            raise SceneError("out takes a picture: ask for it with outputs=('color', ...) or ('rgb', ...)")
        is_fit = isinstance(out, np.ndarray) and out.shape == (height, width, 4) and out.dtype == np.uint8
        if not (is_fit and out.flags.c_contiguous and out.flags.writeable and out.ctypes.data % 4 == 0):
            given = f"{out.dtype} {out.shape}" if isinstance(out, np.ndarray) else shown(out)
            legal = f"a writable array ({height}, {width}, 4) of uint8, without gaps, at a multiple of 4 bytes"
            raise SceneError(f"out must be {legal}; given {given}")
        return np.asarray(out).view(np.uint32).reshape(height, width)

    def _list_needs(self, camera: Camera | None, is_prepared: bool = True) -> dict:
        """Return the kernels that a picture through a camera needs, {(function, signature): True}.

        They are found out by drawing small ones in Python, of a sample of the scene: by the plan that the whole scene
        has in that view, or, before it is prepared, by the sample's own with all lights. What only the whole scene
        needs, such as clipping, is compiled when it is met.
        """
        import logging

        from .engine.given_plan import declare_lights, follow, measure_lights, view_whole
        from .scene.sample import SIZE, choose_meshes, sample_scene, sample_views

        draws_color = bool({"color", "rgb"} & set(self.options.outputs))
        is_known = is_prepared and draws_color
        whole = view_whole(self._prepared, self._checked_camera(camera)) if is_known else None
        with noting_needs() as needs:
            try:
                kind = None if whole is None else whole.kind
                origins, sample = choose_meshes(self.scene, kind), sample_scene(self.scene, kind)
                with Renderer(sample, **_arguments_of(self.options) | {"size": SIZE, "threads": 1}) as renderer:
                    # A view of the whole scene skips nothing but what faces away.
                    is_part_skipped = camera is not None or self.options.cull == "back"
                    renderer._prepared.uses_clusters = is_part_skipped and has_clusters(self.scene.n_face)
                    prepared, view = renderer._prepared, renderer._checked_camera(None)
                    prepared.is_thorough = True
                    if draws_color:
                        measure_lights(prepared, view)
                        if whole is None or not follow(prepared, whole, origins):
                            declare_lights(prepared, view)
                    kind = None if whole is None else whole.kind_in(sample, origins)
                    for view in sample_views(sample, self.scene, camera, kind):
                        renderer.render(view)
            except RasterizerError as fault:  # what was noted until then is of use
                logging.getLogger("rasterizer").info(
                    "not all kernels that the picture needs are known ahead: %s", fault
                )
        return needs

    def _checked_camera(self, camera) -> Camera:
        """Return the camera that a picture is taken with."""
        camera = self.scene.camera_for(self.options.size) if camera is None else camera
        if not isinstance(camera, Camera):
            raise SceneError(f"camera must be a Camera or None; given {shown(camera)}")
        return camera

    def _check_open(self) -> None:
        """Raise SceneError after `close`."""
        if self._is_closed:
            raise SceneError("this Renderer is closed; make a new one")

    def _render(self, camera, out) -> Frame:
        """Draw the picture if one is wanted, and the buffers: together where both have one sample a pixel.

        `out` is what `PreparedScene.draw_picture` takes.
        """
        self._check_open()
        check_memory(self.options, has_out=out is not None)
        prepared, outputs, clock = self._prepared, self.options.outputs, Clock()
        arrays, rgba, counts, view_plan, buffers = {}, None, None, None, None
        if "color" in outputs or "rgb" in outputs:
            rgba, color, alpha, counts, view_plan, buffers = prepared.draw_picture(camera, clock, out)
            self._plan = view_plan.summary._replace(ways=counts.ways)
            if "color" in outputs:
                arrays.update(color=color, alpha=alpha)
        if buffers is None and prepared.buffer_names:
            buffers, counts_of_buffers = prepared.draw_buffers(camera, clock)
            counts = counts or counts_of_buffers
        arrays.update(buffers or {})
        return Frame(rgba, arrays, self._stats(counts, view_plan, clock), self.options.size)

    def _stats(self, counts, view_plan, clock) -> Stats:
        """Say what happened; `view_plan` is None where no picture was drawn."""
        return Stats(
            *counts[:6],
            threads=self._prepared.threads.n_thread,
            error_bound=0.0 if view_plan is None else view_plan.error_bound,
            steps=() if view_plan is None else view_plan.steps,
            milliseconds=clock.milliseconds,
            plan=self._plan,
        )


def _arguments_of(options: Options) -> dict:
    """The arguments of `Renderer` that options were made of."""
    return {field.name: getattr(options, field.name) for field in fields(options)}


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
