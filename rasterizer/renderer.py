"""The public way to render: `render` for one picture, `Renderer` for many of one scene."""

from time import perf_counter

import numpy as np

from .draw import FaceTable, buffers_job, draw, interpolated_job, light, lit_job
from .errors import SceneError
from .frame import Frame, Stats
from .illumination import make_lighting, world_position
from .options import Options
from .pipeline.records import EXACT
from .pipeline.resolve import encode_picture
from .pipeline.scratch import Scratch, empty_buffers, make_picture
from .pipeline.transform import make_screen
from .pipeline.workers import Workers
from .plan import fit_depth_range, fit_screen, is_too_close, make_coding, make_encoding, make_plan
from .scene.camera import Camera
from .scene.geometry import find_clearance, gather_geometry
from .scene.lights import PointLight, SpotLight
from .scene.scene import Scene
from .shadow_maps import Shadows


def render(scene, size=(640, 480), **options) -> Frame:
    """Render a scene.

    Parameters
    ----------
    scene : Scene, or anything that a Scene takes as its meshes
    size : (width, height) in pixels, or one number for a square
    options : those of `Options`: shading, tolerance, samples, outputs, cull, color_range, exposure, spectral, threads

    Raises SceneError for an option that is not legal, ModelError for a mesh that is not.
    """
    with Renderer(scene, size, **options) as renderer:
        return renderer.render()


class Renderer:
    """Render many pictures of one scene: what doesn't depend on the camera is prepared once, and buffers are kept.

    Parameters are those of `render`. Use it as a context manager, or call `close`, to end its threads. One Renderer draws one
    picture at a time; each thread of a caller needs one of its own.
    """

    def __init__(self, scene, size=(640, 480), **options):
        self.scene = scene if isinstance(scene, Scene) else Scene(scene)
        self.options = Options(size=size, **options)
        self._geometry = gather_geometry(self.scene, self.options.is_flat)
        self._plan = make_plan(self.scene, self.options, self._geometry.albedo)
        self._precise_plan = None
        self._clearances = {}
        self._encoding = make_encoding(self._plan, self.scene.background, self.options.color_range)
        self._bounds = np.stack([mesh.bounds for mesh in self.scene.meshes])
        self._workers = Workers(self.options.n_thread)
        self._scratch = Scratch()
        self._normals = {}
        self._shadows = Shadows(self._geometry, self._bounds, self._plan) if self._plan.has_shadows else None
        self._is_closed = False

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self) -> None:
        """End the threads; the Renderer draws no more."""
        self._is_closed = True
        self._workers.close()

    def render(self, camera: Camera | None = None) -> Frame:
        """Render the scene through its own camera, or through another one.

        Raises SceneError for what is no camera, and after `close`.
        """
        if self._is_closed:
            raise SceneError("this Renderer is closed; make a new one")
        camera = self.scene.camera_for(self.options.size) if camera is None else camera
        if not isinstance(camera, Camera):
            raise SceneError(f"camera must be a Camera or None; given {camera!r}")
        options, clock, arrays, rgba, counts = self.options, Clock(), {}, None, None
        if "color" in options.outputs or "rgb" in options.outputs:
            picture = make_picture(options.size, "color" in options.outputs or options.color_range == "global")
            counts = self._draw_picture(camera, picture, clock)
            rgba = picture.rgba.view(np.uint8).reshape(*picture.rgba.shape, 4)
            if "color" in options.outputs:
                arrays.update(color=picture.color, alpha=picture.alpha)
        if wanted := [name for name in options.outputs if name not in ("color", "rgb")]:
            buffers = empty_buffers(options.size, wanted)
            counts_of_buffers = self._draw_buffers(camera, buffers, clock)
            counts = counts or counts_of_buffers
            arrays.update({name: getattr(buffers, name) for name in wanted})
        stats = Stats(**counts._asdict(), threads=self._workers.n_thread, error_bound=self._plan.error_bound,
                      milliseconds=clock.milliseconds)  # fmt: skip
        return Frame(rgba, arrays, stats, options.size)

    def _screen(self, camera, factor):
        """The camera's screen, with `factor` samples a pixel along each axis, its depth fitted to the scene."""
        view = camera.view()
        width, height = self.options.size
        projection = camera.projection((width * factor, height * factor))
        depth_range, far_clip = fit_depth_range(camera, view, self._bounds)
        if camera.is_perspective and camera.near is None:
            size = width * factor, height * factor
            return view, fit_screen(view, projection, depth_range, far_clip, self._geometry, size)
        return view, make_screen(view, projection, depth_range, depth_range[0], far_clip)

    def _draw_picture(self, camera, picture, clock):
        """Draw the picture: the colour of every pixel."""
        options, geometry = self.options, self._geometry
        view, screen = self._screen(camera, options.factor)
        plan = self._plan_for(view)
        maps, shapes = (), np.empty((0, 5))
        if self._shadows is not None:
            maps = self._shadows.draw(view, self._scratch, self._workers)
            shapes = self._shadows.shapes if plan.is_lit_per_sample else shapes
            clock.lap("shadows")
        lighting = make_lighting(plan, view, maps, screen.is_perspective)
        coding = make_coding(plan, screen, options.tolerance)
        encoding = self._encoding
        table = FaceTable(geometry.face_material, shapes)
        if plan.is_lit_per_sample:
            attributes = self._normal_attributes(plan.dtype, plan.has_albedo, plan.has_tangents)
            job = lit_job(attributes, plan, coding, options, encoding, picture, screen, lighting, table)
        else:
            intensities = self._light_points(plan, lighting, screen)
            clock.lap("light")
            job = interpolated_job(intensities, plan, coding, options, encoding, picture, table)
        counts = draw(geometry, job, screen, self._scratch, self._workers, clock)
        if options.color_range == "global":
            encoding = encoding._replace(scale=1.0 / max(1.0, float(picture.color.max())))
            encode_picture(picture.color, picture.alpha, encoding, picture.rgba)
            clock.lap("encode")
        return counts

    def _light_points(self, plan, lighting, screen) -> np.ndarray:
        """Intensities of the points, (n_side, n_point, n_channel); with textures, those of a black surface in front of them,
        and texture coordinates behind."""
        options, geometry = self.options, self._geometry
        is_one_sided = options.is_flat or (options.cull == "back" and not geometry.is_inverted.any())
        n_side = 1 if is_one_sided else 2
        lift = np.empty(0) if self._shadows is None else self._shadows.lifts

        def light_all(geometry):
            return light(geometry, lift, plan, lighting, screen, options.is_flat, n_side, self._workers)

        if plan.textures is None:
            return light_all(geometry)
        # What is left where nothing is reflected diffusely: the texture doesn't weaken it.
        rest = light_all(geometry._replace(albedo=np.zeros_like(geometry.albedo)))
        uv = np.broadcast_to(geometry.uv, (n_side, *geometry.uv.shape))
        return np.concatenate([rest, light_all(geometry), uv], axis=2)

    def _plan_for(self, view):
        """The plan, or one with float64 where a light with a place is very close to a surface that is seen from afar."""
        points = [light for light in self._plan.lights if isinstance(light, PointLight | SpotLight)]
        if not points or self._plan.dtype == np.float64:
            return self._plan
        places = [tuple(world_position(light, view).tolist()) for light in points]
        for place in places:
            if place not in self._clearances:
                self._clearances = {kept: self._clearances[kept] for kept in places if kept in self._clearances}
                self._clearances[place] = find_clearance(self._geometry.positions, self._geometry.vertex, *map(float, place))
        furthest = np.linalg.norm(np.abs(self._bounds - view.eye).max(axis=(0, 1)))
        if not is_too_close(self._plan, self.options.tolerance, furthest, min(self._clearances[place] for place in places)):
            return self._plan
        if self._precise_plan is None:
            self._precise_plan = make_plan(self.scene, self.options, self._geometry.albedo, is_precise=True)
        return self._precise_plan

    def _draw_buffers(self, camera, buffers, clock):
        """Draw the exact buffers: always with one sample a pixel and float64 records, so that nothing else changes them."""
        view, screen = self._screen(camera, 1)
        coding = make_coding(self._plan._replace(coding=EXACT), screen, 0.0)
        n_point = self._geometry.points.shape[1]
        normals = self._normal_attributes(np.float64, False) if len(buffers.normal) else np.empty((1, n_point, 0))
        if self.options.is_flat and len(buffers.normal):
            normals = self._flat_normals(view, screen)
        job = buffers_job(normals, coding, self.options, screen, buffers)
        return draw(self._geometry, job, screen, self._scratch, self._workers, clock)

    def _normal_attributes(self, dtype, has_albedo, has_tangents=False) -> np.ndarray:
        """Normals, behind them the model's colours, the texture coordinates and the tangents, as point attributes
        (1, n_point, 3 to 11)."""
        key = np.dtype(dtype), has_albedo, has_tangents
        if key not in self._normals:
            columns = [self._geometry.normals.T] + ([self._geometry.albedo] if has_albedo else [])
            columns += [self._geometry.uv] if has_albedo and len(self._geometry.uv) else []
            columns += [self._geometry.tangents.T] if has_tangents else []
            self._normals[key] = np.ascontiguousarray(np.concatenate(columns, axis=1)[None], dtype)
        return self._normals[key]

    def _flat_normals(self, view, screen) -> np.ndarray:
        """Polygon normals towards the viewer, (2, n_point, 3): side 1 is reversed, because write_buffers turns it round."""
        normals = self._geometry.normals.T
        away = (self._geometry.points.T - view.eye) if screen.is_perspective else view.forward
        toward = np.where((normals * away).sum(axis=1, keepdims=True) > 0.0, -normals, normals)
        return np.stack([toward, -toward])


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
