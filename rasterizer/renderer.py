"""The public way to render: `render` for one picture, `Renderer` for many of one scene."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from .appearance import Appearance
from .compiler.kernels import Job, compiling_ahead
from .engine.draw import Clock
from .engine.prepared import PreparedScene, check_memory, checked_out
from .engine.scene_tables import SceneTables
from .errors import SceneError, counted, shown, warn_caller
from .frame import Frame, Stats
from .io.camera_file import viewpoint_of
from .io.files import name_of
from .io.loader import FileLike, SceneFile, doubt_of_up, read_source
from .keywords import divided, takes_words
from .locks import cached_property
from .options import Options
from .picking import PICKED, FrameSource, Pick, checked_pixel, make_pick
from .scene.camera import Camera
from .scene.scene import Scene, SceneLike
from .viewpoint import Viewpoint

if TYPE_CHECKING:
    from .engine.plan import PlanSummary
    from .keywords import Unpack
    from .words import RenderWords, SceneWords, ViewpointWords


@takes_words(Viewpoint, Appearance, Options, but=("size",))
def render(
    scene: SceneLike | FileLike,
    size: int | Sequence[int] | None = None,
    *,
    options: Options | None = None,
    out: NDArray[np.uint8] | None = None,
    **words: Unpack[RenderWords],
) -> Frame:
    """Render a scene, or whatever one can be loaded from.

        rz.render("teapot.obj", (640, 480), view="front", material="gold", shadows=True).save("teapot.png")

    The words are those of the command line, and mean the same: `raster render teapot.obj --view front --material gold
    --shadows`. What each option does is said at `Options`, where their defaults stand.

    Parameters
    ----------
    scene : Scene, or anything that `load` takes: a path, the bytes of a file, an open file, a Mesh or several, those of
        trimesh, PyVista, VTK, Open3D or meshio, or (vertices, faces)
    size : (width, height) in pixels, or one number for a square; None = that of the options, (640, 480)
    options : Options, of which the words below replace some; None = those of a scene file, else the default ones
    out : (height, width, 4) uint8, which becomes the frame's `rgba`; None = a new array. See `Renderer.render`

    Where it is taken from: unless one of these is given, by the scene's own camera, else by one that frames the scene
    camera : Camera; "file" = the first one of a model file; "frame" = frame the scene although it has a camera; or the
        path of a scene file, or of a file that holds a camera alone
    view : "iso", "front", "back", "left", "right", "top", "bottom", or (azimuth, elevation) in degrees
    azimuth, elevation : degrees about the up axis, 0 = front, and above the horizon; None = 35 and 25, as in
        `Camera.framing`
    fov : degrees, vertical field of view of the camera that frames, or stands at `eye`; None = 30
    ortho : without perspective; with `eye`, the target keeps its size
    zoom : enlarges the middle of the picture as many times
    margin : share of the picture that stays empty at each border; None = 0.05
    eye, target : three numbers each, where the camera stands, and what it looks at; None = the middle of the scene

    How the model looks
    lights : a light or a sequence of them; None = those of the scene or file, else studio lights
    preset : "studio", "headlight" or "tabletop", ready-made lights, to which `lights` are added
    shadows : True = all lights but ambient ones cast shadows, unless one has `shadow=False`; or a Shadow, that of those
        that have none of their own
    material : Material, the name of one of the classic table ("gold", "jade", "red plastic" ..., see `Material.named`),
        or a dict of some fields; replaces them in every material. "ambient" is "diffuse" unless it is given
    color : one colour for everything, in place of textures and of colours that a mesh has; the "diffuse" of `material`
        multiplies these
    reflection : "phong", "blinn", "lambert", "oren-nayar", "cook-torrance" or "toon", short for that of `material`
    background : colour, or "transparent"; None = that of the scene or file, else transparent
    depth_cue : DepthCue, or a number, its scale; "none" = none; None = that of the scene or file
    up : text, up axis "x", "y", "z" or with a minus sign, or "auto"; None = as `load` has it. Where it is given, a
        camera that the scene or file has doesn't count

    How a file or mesh is read; as in `load`, but for `subdivide`
    format : text, the format of bytes, or of a file whose suffix doesn't tell it
    crease_angle : degrees within 0..180; an edge between faces that meet at more stays sharp
    weighting : "angle", "area" or "uniform", the weight of faces where normals are averaged
    subdivide : how often every triangle is cut in four, 0 to 15
    scalars, cmap, clim : a scalar field that is shown, its colormap, and the values at that one's ends
    drop_bad_faces : leave out faces with NaN or infinite coordinates
    allow_outside : read also textures, buffers and parts that lie outside the folder of the file that names them

    How it is drawn
    shading, tolerance, samples, outputs, cull, color_range, exposure : as in `Options`
    spectral, threads, edges, edge_color, edge_width, ground, min_opacity : as in `Options`

    Returns
    -------
    Frame

    Raises
    ------
    SceneError : an option or a part of the scene that is not legal, a camera beside angles
    OptionError : an option that there isn't; the message names the nearest one
    ModelError : a file that can't be read, or a mesh that is not legal

    Warns
    -----
    UserWarning : what `load` warns of; a shape whose flat underside says that another axis points upwards
    """
    if TYPE_CHECKING:  # how Jedi finds the words
        Viewpoint(**words)
        Renderer(scene, size, **words)
    view_words, others = divided(words, Viewpoint)
    viewpoint = viewpoint_of(view_words)  # what is not legal is refused before a file is read
    with Renderer(scene, size, options=options, camera=viewpoint.of_file, **others) as renderer:
        is_framed = viewpoint.camera is None and viewpoint.eye is None and renderer.scene.camera is None
        if is_framed and others.get("up") is None:
            doubt = doubt_of_up(renderer.scene, scene, others.get("format"))
            if doubt is not None:
                warn_caller(f"{doubt[1]}: try up={doubt[0]!r}")
        return renderer.render(out=out, **vars(viewpoint))


class Renderer:
    """Render many pictures of one scene: what doesn't depend on the camera is prepared once, and buffers are kept.

    Parameters
    ----------
    scene, size, options, words : those of `render`, but for those that say where a picture is taken from, which are
        given for each picture
    camera : of the scene, as `load` takes it: "file" = the first that a model file brings

    Attributes
    ----------
    scene : Scene, changed as the words say
    options : Options
    plan : PlanSummary, what the last picture needed; before the first one, what the scene says of it
    framing : Viewpoint, how a scene file asks for framing; None where it doesn't

    Use it as a context manager, or call `close`, to end its threads. One Renderer draws one picture at a time: threads
    that share one take turns, so each needs one of its own to draw at the same time. A forked process goes on with it,
    on threads of its own; pickled, it becomes a new one of the same scene and options.
    """

    @takes_words(Appearance, Options, but=("size",))
    def __init__(
        self,
        scene: SceneLike | FileLike,
        size: int | Sequence[int] | None = None,
        *,
        options: Options | None = None,
        camera: Camera | Literal["file"] | None = None,
        **words: Unpack[SceneWords],
    ) -> None:
        if TYPE_CHECKING:  # how Jedi finds the words
            Appearance(**words)
            Options(**words)
        self.scene: Scene
        self.options: Options
        self.framing: Viewpoint | None
        self.scene, self.options, self.framing, _ = load_with_appearance(scene, words, size, options, camera)
        self._prepare()

    def _prepare(self, like: PreparedScene | None = None) -> None:
        """Prepare the scene; `like` has the same meshes and options, and lends what it has prepared of these."""
        # The background lies behind the shadow on the ground.
        drawn = replace(self.scene, background=None) if self.options.ground else self.scene
        tables = SceneTables(drawn, self.options)
        with compiling_ahead(self._list_kernels):
            self._prepared = PreparedScene(tables, self.options, like)
        self.plan: PlanSummary = self._prepared.summary
        self._is_closed = False

    def in_lights(self, lights: Any) -> Renderer:
        """Return another Renderer of the same scene and options in other lights, a light or several.

        What was prepared of the meshes is not prepared again. Raises SceneError for what are no lights.
        """
        found = object.__new__(Renderer)
        found.options, found.framing = self.options, self.framing
        found.scene = Appearance(lights=lights).change(self.scene, self.options.shading, self.options.ground)
        if "_ground" in vars(self):
            found._ground = self._ground
        found._prepare(self._prepared)
        return found

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
        return partial(Renderer, options=self.options), (self.scene,), {"framing": self.framing}

    def close(self) -> None:
        """End the threads, when the picture that is being drawn is done; the Renderer draws no more."""
        with self._prepared.threads.lock:
            self._is_closed = True
            self._prepared.threads.close()

    @takes_words(Viewpoint, but=("camera",))
    def render(
        self,
        camera: Camera | str | os.PathLike[str] | None = None,
        *,
        out: NDArray[np.uint8] | None = None,
        **words: Unpack[ViewpointWords],
    ) -> Frame:
        """Render the scene through its own camera, or through another one, or as words frame it.

        Parameters
        ----------
        camera, view, azimuth, elevation, fov, ortho, zoom, margin, eye, target : where the picture is taken from, as in
            `rz.render`; unless one is given, that is the scene's own camera, else one that frames it. `Camera.orbit`
            makes the cameras of a turntable
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
        if TYPE_CHECKING:  # how Jedi finds the words
            Viewpoint(**words)
        with compiling_ahead(self._list_kernels):  # where the picture stands on a ground, framing takes its shadow
            seen_by = self._camera_of(camera, words)
            pixels = None if out is None else checked_out(out, self.options)
            with self._prepared.threads.lock:
                return self._render(seen_by, pixels)

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
        x, y = checked_pixel(x, y, self.options.size)
        camera = self._camera_of(camera, {})
        with self._prepared.threads.lock:
            arrays = self._prepared.draw_buffers(camera, Clock(), PICKED, rows=(y, y + 1))[0]
        return make_pick(arrays, x, y, self.scene)

    def _camera_of(self, camera: Any, words: Mapping[str, Any]) -> Camera:
        """Return the camera that a picture is taken with; SceneError after `close`."""
        if self._is_closed:
            raise SceneError("this Renderer is closed; make a new one")
        if isinstance(camera, Camera) and not words:
            return camera
        return self._own_camera if camera is None and not words else self._seen_by({"camera": camera, **words})

    def _seen_by(self, words: Mapping[str, Any]) -> Camera:
        """Return the camera that words ask for."""
        viewpoint = viewpoint_of(words).over(self.framing)
        return viewpoint.camera_of(self.scene, self.options.size, lambda: self.subject)

    @cached_property
    def _own_camera(self) -> Camera:
        """The camera of pictures for which none is asked."""
        return self._seen_by({})

    def _list_kernels(self) -> list[Job]:
        """List the kernels of a picture, as far as they are known before it is drawn."""
        from .engine.recorded_kernels import list_kernels  # where one is missing

        return list_kernels(self.scene, self.options)

    @cached_property
    def _ground(self) -> Any:
        """The shadow on the ground, drawn for the first picture; None without a ground."""
        if not self.options.ground:
            return None
        from .engine.ground_shadow import GroundShadow

        return GroundShadow(self.scene, threads=self.options.threads)

    def _render(self, camera: Camera, out: NDArray[np.uint32] | None) -> Frame:
        """Draw the picture if one is wanted, with edges over it and the ground's shadow under it, and then the buffers.

        `out` is what `PreparedScene.draw_picture` takes.
        """
        options, prepared, clock, arrays = self.options, self._prepared, Clock(), {}
        check_memory(options, has_out=out is not None)
        picture = None
        if "color" in options.outputs or "rgb" in options.outputs:
            behind = self.scene.background if options.ground else None
            picture = prepared.draw_picture(camera, clock, out, behind)
            self.plan = picture.summary._replace(paths=picture.counts.paths)
            if "color" in options.outputs:
                arrays |= {"color": picture.color, "alpha": picture.alpha}
            linear = arrays.get("color"), arrays.get("alpha")
            if options.edges:
                prepared.draw_edges(camera, picture.rgba, *linear)
                clock.lap("edges")
            if self._ground is not None:
                self._ground.lay_under(camera, picture.rgba, *linear, behind, prepared.threads, picture.scale)
                clock.lap("ground")
        if not {"color", "rgb"}.issuperset(options.outputs):
            buffers, counts, _ = prepared.draw_buffers(camera, clock)
            arrays |= buffers
        stats = Stats(
            *(counts if picture is None else picture.counts)[:6],
            threads=prepared.threads.n_thread,
            error_bound=0.0 if picture is None else picture.error_bound,
            steps=() if picture is None else picture.steps,
            milliseconds=clock.milliseconds,
            plan=self.plan,
        )
        pickers: list[Renderer] = []

        def draw_pick(x: int, y: int) -> Pick | None:
            if not pickers:  # what a frame picks with draws the surfaces that it shows, and no colours
                kept = {name: getattr(options, name) for name in ("shading", "cull", "min_opacity")}
                pickers.append(Renderer(self.scene, options.size, **kept, outputs="face", samples=1, threads=1))
            return pickers[0].pick(x, y, camera)

        rgba = None if picture is None else picture.rgba
        return Frame(rgba, arrays, stats, options.size, FrameSource(self.scene, camera, options, draw_pick))


def load_with_appearance(
    source: Any,
    words: Mapping[str, Any],
    size: int | Sequence[int] | None = None,
    options: Options | None = None,
    camera: Any = None,
) -> SceneFile:
    """Load a scene, and let it look as words say.

    Parameters
    ----------
    source, camera : as `load` takes them, or a SceneFile that has been read
    words : those of Appearance and of Options
    size, options : as `render` takes them; without `options`, those of a scene file are the ones that words replace

    Returns
    -------
    SceneFile, with Options
    """
    if not (options is None or isinstance(options, Options)):
        raise SceneError(f"options must be Options or None; given {shown(options)}")
    if isinstance(source, Scene) and options is not None and camera is None and size is None and not words:
        return SceneFile(source, options)
    words, chosen = divided(words, Appearance)
    chosen |= {} if size is None else {"size": size}
    made, appearance = replace(options, **chosen) if options else Options(**chosen), Appearance(**words)
    scene, own, framing, appearance_of_file = read_source(source, camera=camera, **appearance.reading)
    if own and options is None:
        try:
            made = Options(**own | chosen)
        except SceneError as fault:
            raise SceneError(f"{name_of(source)}: options: {fault}") from fault
    if camera is None and appearance.up is not None and scene.camera is not None:  # another view is meant
        scene = replace(scene, camera=None)
    return SceneFile(appearance.over(appearance_of_file).change(scene, made.shading, made.ground), made, framing)
