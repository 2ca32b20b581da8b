"""The public way to render: `render` for one picture, `Renderer` for many of one scene."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .choices import Antialias, Axis, ColorRange, Cull, EdgeType, Output, Samples, Shading
from .compiler.kernels import Job, compiling_ahead
from .engine.draw import Clock
from .engine.memory import check_memory, checked_out
from .engine.plan_summary import PlanSummary, summarize
from .engine.prepared import DrawnPicture, PreparedScene
from .engine.scene_tables import SceneTables
from .errors import SceneError, counted, shown
from .frame import Frame, Stats
from .io.loader import FileLike, load
from .keywords import checked_keywords
from .locks import cached_property
from .options import Options
from .picking import PICKED, FrameSource, Pick, checked_pixel, make_pick
from .scene.camera import Camera
from .scene.color import ColorLike
from .scene.lights import Light, on_tabletop
from .scene.scene import Scene, SceneLike
from .scene.validate import number

AZIMUTH, ELEVATION = 35.0, 25.0  # degrees; those of `Camera.framing`


@checked_keywords
def render(
    scene: SceneLike | FileLike,
    size: int | Sequence[int] = Options.size,
    *,
    camera: Camera | None = None,
    lights: Light | Iterable[Any] | None = None,
    background: ColorLike | None = None,
    up: Axis | None = None,
    azimuth: float | None = None,
    elevation: float | None = None,
    format: str | None = None,
    crease_angle: float | None = None,
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
    edges: EdgeType | Sequence[EdgeType] | None = Options.edges,
    edge_color: ColorLike = Options.edge_color,
    edge_width: float = Options.edge_width,
    ground: bool = Options.ground,
    out: NDArray[np.uint8] | None = None,
) -> Frame:
    """Render a scene, or whatever one can be loaded from; what each option does is said at `Options`, where the
    defaults stand.

        rz.render("teapot.obj", (640, 480), azimuth=60, shading="phong").save("teapot.png")

    Parameters
    ----------
    scene : Scene, or anything that `load` takes: a path, the bytes of a file, an open file, a Mesh or several, a
        trimesh.Trimesh or trimesh.Scene, or (vertices, faces)
    size : (width, height) in pixels, or one number for a square
    camera : Camera; None = the scene's own, else one that frames it
    lights : a light or a sequence of them; None = those of the scene or file, else studio lights
    background : colour; None = that of the scene or file, else transparent
    up : text, up axis "x", "y", "z" or with a minus sign; None = as `load` has it
    azimuth, elevation : degrees, the side from which the picture is framed, as in `Camera.framing`. Where one of these
        or `up` is given, a camera that the scene or file has doesn't count
    format : text, the format of bytes, or of a file whose suffix doesn't tell it; as in `load`
    crease_angle : degrees within 0..180; an edge between faces that meet at more stays sharp; as in `load`
    shading : "flat" or "lambert" (once a polygon), "gouraud" (once a vertex), "phong" (once a sample)
    tolerance : error accepted, in linear intensity where 1 is white; 0 = all in float64
    samples : samples a pixel: 1, 4, 9 or 16; buffers have one
    antialias : "supersample" (all is done for every sample), or "shade-once" (light and textures once for each
        polygon in a pixel)
    outputs : one name or several out of "color", "rgb", and the buffers "depth", "face", "normal", "mask", "object",
        "material", "uv", "barycentric", "position", "position_camera", "normal_camera"
    cull : "auto" (inner sides of closed bodies are left out, which nobody sees), "none", or "back" to leave out faces
        that are clockwise as the viewer sees them
    color_range : what becomes of intensities above 1 in 8 bits: "clamp", "global" or "local"
    exposure : stops by which the light of the scene is multiplied
    spectral : number of samples of the spectrum, 3 to 401; None = 81 where something has a Spectrum, else three colours
    threads : how many; None = as many as the process may use
    edges : "wire", "crease", "silhouette", "all" or several: edges drawn over the picture; None or () = none
    edge_color, edge_width : their colour, in any way that colours are written, and width in pixels
    ground : whether the scene stands on the ground of a tabletop, with a soft shadow; without lights of its own, in a
        light that casts shadows
    out : (height, width, 4) uint8, which becomes the frame's `rgba`; None = a new array. See `Renderer.render`

    Returns
    -------
    Frame

    Raises
    ------
    SceneError : an option or a part of the scene that is not legal, a camera beside angles
    OptionError : an option that there isn't; the message names the nearest one
    ModelError : a file that can't be read, or a mesh that is not legal
    """
    _check_one_view(camera, azimuth=azimuth, elevation=elevation)
    scene = load(scene, lights=lights, background=background, up=up, format=format, crease_angle=crease_angle)
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
        edges=edges,
        edge_color=edge_color,
        edge_width=edge_width,
        ground=ground,
    ) as renderer:
        if camera is azimuth is elevation is None and up is not None:  # the file's camera doesn't count
            azimuth = AZIMUTH
        return renderer.render(camera, azimuth=azimuth, elevation=elevation, out=out)


class Renderer:
    """Render many pictures of one scene: what doesn't depend on the camera is prepared once, and buffers are kept.

    Parameters are those of `render`; cameras and angles are given for each picture. Use it as a context manager, or
    call `close`, to end its threads. One Renderer draws one picture at a time: threads that share one take turns, so
    each needs one of its own to draw at the same time. A forked process goes on with it, on threads of its own;
    pickled, it becomes a new one of the same scene and options.
    """

    @checked_keywords
    def __init__(
        self,
        scene: SceneLike | FileLike,
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
        edges: EdgeType | Sequence[EdgeType] | None = Options.edges,
        edge_color: ColorLike = Options.edge_color,
        edge_width: float = Options.edge_width,
        ground: bool = Options.ground,
    ) -> None:
        self.options: Options = Options(
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
            edges=edges,
            edge_color=edge_color,
            edge_width=edge_width,
            ground=ground,
        )
        self.scene: Scene = load(scene)
        if ground:
            lights = on_tabletop(self.scene.lights, takes_shadows=self.options.shading == "phong")
            self.scene = replace(self.scene, lights=lights)
        # The background lies behind the shadow on the ground.
        drawn = replace(self.scene, background=None) if ground else self.scene
        self._prepared = PreparedScene(SceneTables(drawn, self.options), self.options)
        with compiling_ahead(self._list_kernels):
            self._plan = summarize(self._prepared.view_plans.plan)
        self._is_closed = False

    @property
    def plan(self) -> PlanSummary:
        """What the last picture needed; before the first one, what the scene says of it."""
        return self._plan

    @property
    def subject(self) -> Scene | NDArray[np.float64]:
        """What a picture is framed on, for `Camera.framing`: the scene, or where it stands on a ground its vertices and
        points round most of the shadow, (n, 3) in world space."""
        if self._ground is None:
            return self.scene
        return np.concatenate([*(mesh.used_vertices for mesh in self.scene.meshes), self._ground.outline()])

    def __repr__(self) -> str:
        width, height = self.options.size
        closed = ", closed" if self._is_closed else ""
        return f"<Renderer {width}x{height} {self.options.shading}, {counted(self.scene.n_face, 'face')}{closed}>"

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(Renderer, **_arguments_of(self.options)), (self.scene,)

    def close(self) -> None:
        """End the threads, when the picture that is being drawn is done; the Renderer draws no more."""
        with self._prepared.threads.lock:
            self._is_closed = True
            self._prepared.threads.close()

    @checked_keywords
    def render(
        self,
        camera: Camera | None = None,
        *,
        azimuth: float | None = None,
        elevation: float | None = None,
        out: NDArray[np.uint8] | None = None,
    ) -> Frame:
        """Render the scene through its own camera, or through another one, or framed from a side.

        Parameters
        ----------
        camera : Camera; None = the scene's own, else one that frames it
        azimuth, elevation : degrees, the side from which the picture is framed, as in `Camera.framing`. Where one is
            given, the scene's own camera doesn't count. `Camera.orbit` makes the cameras of a turntable
        out : (height, width, 4) uint8, without gaps, which takes the picture and becomes the frame's `rgba`: an array
            that is used again for every picture, memory that is shared, or a numpy.memmap. None = a new array

        Returns
        -------
        Frame

        Raises
        ------
        SceneError : what is no camera, a camera beside angles, an `out` that doesn't fit, a picture that this machine's
            memory can't hold; and after `close`
        """
        _check_one_view(camera, azimuth=azimuth, elevation=elevation)
        if azimuth is not None or elevation is not None:
            camera = self._framed_from(azimuth, elevation)
        camera, words = self._checked_camera(camera), None if out is None else checked_out(out, self.options)
        with self._prepared.threads.lock, compiling_ahead(partial(self._list_kernels, camera)):
            return self._render(camera, words)

    def pick(self, x: int, y: int, camera: Camera | None = None) -> Pick | None:
        """Tell what a pixel shows, without a picture: no more is drawn than the rows around it.

        Parameters
        ----------
        x, y : column and row of the pixel, from 0 on; row 0 is the top
        camera : Camera; None = the scene's own

        Returns
        -------
        Pick of the nearest surface at the pixel's centre; None where nothing is

        Raises
        ------
        SceneError : a pixel that the picture doesn't have, what is no camera; and after `close`
        """
        (x, y), camera = checked_pixel(x, y, self.options.size), self._checked_camera(camera)
        with self._prepared.threads.lock:
            self._check_open()
            arrays = self._prepared.draw_buffers(camera, Clock(), PICKED, rows=(y, y + 1))[0]
        return make_pick(arrays, x, y, self.scene)

    def _list_kernels(self, camera: Camera | None = None) -> list[Job]:
        """List the kernels of a picture through a camera; None = of the first one, before anything is prepared."""
        if camera is None:
            found = self._prepared.list_kernels(self.scene.camera_for(self.options.size))
            if self.options.ground:
                from .engine import ground_shadow

                found += ground_shadow.list_kernels(self.scene)
            return found
        return self._prepared.list_kernels(camera, self._prepared.plan_for(camera).plan)

    @cached_property
    def _ground(self) -> Any:
        """The shadow on the ground, drawn for the first picture; None without a ground."""
        if not self.options.ground:
            return None
        from .engine.ground_shadow import GroundShadow

        return GroundShadow(self.scene, threads=self.options.threads)

    def _framed_from(self, azimuth: float | None = None, elevation: float | None = None) -> Camera:
        """Return the camera that frames the scene, with the shadow on its ground, from the side that `Camera.framing`
        has for an angle that is None."""
        azimuth = AZIMUTH if azimuth is None else number(azimuth, "the azimuth")
        elevation = ELEVATION if elevation is None else number(elevation, "the elevation")
        (width, height), subject = self.options.size, self.subject
        if subject is self.scene and (azimuth, elevation) == (AZIMUTH, ELEVATION):
            return self.scene.framed(width / height)  # which is kept
        return Camera.framing(subject, azimuth, elevation, aspect=width / height, up=self.scene.up)

    def _checked_camera(self, camera) -> Camera:
        """Return the camera that a picture is taken with."""
        if camera is None:
            camera = self.scene.camera or self._framed_from()
        if not isinstance(camera, Camera):
            raise SceneError(f"camera must be a Camera or None; given {shown(camera)}")
        return camera

    def _check_open(self) -> None:
        """Raise SceneError after `close`."""
        if self._is_closed:
            raise SceneError("this Renderer is closed; make a new one")

    def _render(self, camera: Camera, out: NDArray[np.uint32] | None) -> Frame:
        """Draw the picture if one is wanted, and the buffers: together where both have one sample a pixel.

        `out` is what `PreparedScene.draw_picture` takes.
        """
        self._check_open()
        check_memory(self.options, has_out=out is not None)
        prepared, outputs, clock, arrays = self._prepared, self.options.outputs, Clock(), {}
        picture, buffers, counts, screen = None, None, None, None
        if "color" in outputs or "rgb" in outputs:
            picture = self._draw_picture(camera, clock, out)
            buffers, counts, screen = picture.buffers, picture.counts, picture.screen
            if "color" in outputs:
                arrays.update(color=picture.color, alpha=picture.alpha)
        if buffers is None and prepared.buffer_names:
            buffers, counts_of_buffers, screen = prepared.draw_buffers(camera, clock)
            counts = counts or counts_of_buffers
        arrays.update(buffers or {})
        view_plan = None if picture is None else picture.view_plan
        bounds = prepared.bound_outputs(camera, outputs, view_plan, screen)
        # What a frame picks with draws the surfaces that it shows, and no colours.
        shown_as = {"shading": self.options.shading, "cull": self.options.cull, "outputs": "face", "samples": 1}
        source = FrameSource(
            self.scene, camera, partial(Renderer, self.scene, self.options.size, threads=1, **shown_as)
        )
        rgba = None if picture is None else picture.rgba
        return Frame(rgba, arrays, self._stats(counts, view_plan, clock, bounds), self.options.size, source)

    def _draw_picture(self, camera: Camera, clock: Clock, out: NDArray[np.uint32] | None) -> DrawnPicture:
        """Draw the picture, with edges over it and the ground's shadow under it, and keep what it needed."""
        picture = self._prepared.draw_picture(camera, clock, out)
        self._plan = self._prepared.summary_of(picture.view_plan.plan, picture.counts.paths)
        linear = (picture.color, picture.alpha) if "color" in self.options.outputs else (None, None)
        if self.options.edges:
            self._prepared.edges.draw_over(camera, picture.rgba, *linear)
            clock.lap("edges")
        if self._ground is not None:
            self._ground.lay_under(camera, picture.rgba, *linear, self.scene.background)
            clock.lap("ground")
        return picture

    def _stats(self, counts, view_plan, clock, bounds) -> Stats:
        """Say what happened; `view_plan` is None where no picture was drawn."""
        return Stats(
            *counts[:6],
            threads=self._prepared.threads.n_thread,
            error_bound=0.0 if view_plan is None else view_plan.error_bound,
            steps=() if view_plan is None else view_plan.steps,
            milliseconds=clock.milliseconds,
            plan=self._plan,
            error_bounds=bounds,
        )


def _arguments_of(options: Options) -> dict:
    """The arguments of `Renderer` that options were made of."""
    return {field.name: getattr(options, field.name) for field in fields(options)}


def _check_one_view(camera: Camera | None, **angles: float | None) -> None:
    """Refuse a camera beside angles, which ask for another one; SceneError names them."""
    given = [name for name, value in angles.items() if value is not None]
    if camera is not None and given:
        raise SceneError(f"a picture has a camera, or a side that it is framed from; given camera, {', '.join(given)}")
