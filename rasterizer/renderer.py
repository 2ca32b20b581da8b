"""The public way to render: `render` for one picture, `Renderer` for many of one scene."""

import math
from dataclasses import fields
from time import perf_counter

import numpy as np

from .engine.draw import FaceTable, buffers_job, draw, fill_centers, interpolated_job, light, lit_job
from .engine.error_bounds import Surroundings, list_steps
from .engine.plan import (
    error_bound_of,
    fit_depth_range,
    fit_screen,
    fits_float32,
    make_coding,
    make_encoding,
    make_plan,
    rounding_of,
)
from .engine.shadow_maps import Shadows
from .engine.uniforms import make_lighting, world_position
from .errors import SceneError, shown
from .frame import Frame, Stats
from .geometry.points import find_clearance, find_point_clearance, find_shortest_normal, gather_geometry
from .options import Options
from .pipeline.records import EXACT
from .pipeline.encode import encode_picture
from .pipeline.threads import Workers
from .pipeline.transform import DEPTH_MARGIN
from .pipeline.workspace import Scratch, empty_buffers, make_picture
from .scene.camera import Camera
from .scene.lights import DirectionalLight
from .scene.scene import Scene


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

    Parameters are those of `render`. Use it as a context manager, or call `close`, to end its threads. One Renderer
    draws one picture at a time: threads that share one take turns, so each needs one of its own to draw at the same
    time. A forked process goes on with it, on threads of its own; pickled, it becomes a new one of the same scene and
    options.
    """

    def __init__(self, scene, size=(640, 480), **options):
        self.scene = scene if isinstance(scene, Scene) else Scene(scene)
        self.options = Options(size=size, **options)
        self._geometry = gather_geometry(self.scene, self.options.is_flat)
        self._plan = make_plan(self.scene, self.options, self._geometry.albedo)
        self._precise_plan = self._last_plan = None
        self._clearances = {}
        if not np.isfinite(self._plan.bound):
            clearances = self._lasting_clearances()
            self._plan = make_plan(self.scene, self.options, self._geometry.albedo, clearances=clearances)
        self._shortest = 1.0
        if self._plan.is_lit_per_sample and self._plan.reflected.turned > 0.0:
            self._shortest = find_shortest_normal(self._geometry.normals, self._geometry.corner)
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

    def __reduce__(self):
        return _remake, (self.scene, {field.name: getattr(self.options, field.name) for field in fields(self.options)})

    def close(self) -> None:
        """End the threads, when the picture that is being drawn is done; the Renderer draws no more."""
        with self._workers.turn:
            self._is_closed = True
            self._workers.close()

    def render(self, camera: Camera | None = None) -> Frame:
        """Render the scene through its own camera, or through another one.

        Raises SceneError for what is no camera, and after `close`.
        """
        with self._workers.turn:
            return self._render(camera)

    def _render(self, camera) -> Frame:
        if self._is_closed:
            raise SceneError("this Renderer is closed; make a new one")
        camera = self.scene.camera_for(self.options.size) if camera is None else camera
        if not isinstance(camera, Camera):
            raise SceneError(f"camera must be a Camera or None; given {shown(camera)}")
        options, clock, arrays, rgba, counts = self.options, Clock(), {}, None, None
        error_bound, steps = 0.0, ()
        if "color" in options.outputs or "rgb" in options.outputs:
            picture = make_picture(options.size, "color" in options.outputs or options.color_range == "global")
            counts, error_bound, steps = self._draw_picture(camera, picture, clock)
            rgba = picture.rgba.view(np.uint8).reshape(*picture.rgba.shape, 4)
            if "color" in options.outputs:
                arrays.update(color=picture.color, alpha=picture.alpha)
        if wanted := [name for name in options.outputs if name not in ("color", "rgb")]:
            buffers = empty_buffers(options.size, wanted)
            counts_of_buffers = self._draw_buffers(camera, buffers, clock)
            counts = counts or counts_of_buffers
            arrays.update({name: getattr(buffers, name) for name in wanted})
        stats = Stats(**counts._asdict(), threads=self._workers.n_thread, error_bound=error_bound, steps=steps,
                      milliseconds=clock.milliseconds)  # fmt: skip
        return Frame(rgba, arrays, stats, options.size)

    def _screen(self, camera, factor):
        """The camera's screen, with `factor` samples a pixel along each axis, its depth fitted to the scene."""
        view = camera.view()
        width, height = self.options.size
        projection = camera.projection((width * factor, height * factor))
        depth_range, far_clip = fit_depth_range(camera, view, self._bounds)
        size = width * factor, height * factor
        return view, fit_screen(view, projection, depth_range, far_clip, self._geometry, size, self._bounds)

    def _draw_picture(self, camera, picture, clock):
        """Draw the picture: the colour of every pixel."""
        options, geometry = self.options, self._geometry
        view, screen = self._screen(camera, options.factor)
        plan, error_bound, steps = self._plan_for(view, screen)
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
        return counts, error_bound, steps

    def _light_points(self, plan, lighting, screen) -> np.ndarray:
        """Intensities of the points, (n_side, n_point, n_channel); with textures, those of a black surface in front of
        them, and texture coordinates behind."""
        options, geometry = self.options, self._geometry
        is_one_sided = options.is_flat or (options.cull == "back" and not geometry.is_inverted.any())
        n_side = 1 if is_one_sided else 2
        lift = np.empty(0) if self._shadows is None else self._shadows.lifts

        def light_all(geometry):
            return light(geometry, lift, plan, lighting, screen, options.is_flat, n_side, self._workers)

        if plan.textures is None:
            return fill_centers(light_all(geometry), geometry.centers, self._workers)
        # What is left where nothing is reflected diffusely: the texture doesn't weaken it.
        rest = light_all(geometry._replace(albedo=np.zeros_like(geometry.albedo)))
        uv = np.broadcast_to(geometry.uv, (n_side, *geometry.uv.shape))
        return fill_centers(np.concatenate([rest, light_all(geometry), uv], axis=2), geometry.centers, self._workers)

    def _plan_for(self, view, screen):
        """The plan, or one with float64 where float32 has too few digits for this view; its error bound and its steps.

        What was found for the view before is kept, as it usually holds for the next one.
        """
        furthest = math.sqrt(sum(side * side for side in np.abs(self._bounds - view.eye).max(axis=(0, 1)).tolist()))
        surroundings = self._find_surroundings(view, screen, furthest).rounded()
        key = surroundings.furthest, surroundings.clearances.tobytes(), surroundings.deepness
        if self._last_plan is None or self._last_plan[0] != key:
            plan, tolerance = self._plan, self.options.tolerance
            if plan.dtype == np.float32 and fits_float32(plan, tolerance, surroundings):
                plan = plan._replace(rounding=rounding_of(plan, surroundings))
            elif plan.dtype == np.float32:
                if self._precise_plan is None:
                    self._precise_plan = make_plan(self.scene, self.options, self._geometry.albedo, is_precise=True)
                plan = self._precise_plan
            self._last_plan = key, plan, error_bound_of(plan, tolerance, surroundings), list_steps(plan, surroundings)
        return self._last_plan[1:]

    def _lasting_clearances(self) -> np.ndarray:
        """Half of the clearance that each light has in every view, with room for what a view takes off; 0 for one that
        moves with the camera."""
        lengths = []
        for source in self._plan.lights:
            if isinstance(source, DirectionalLight) or source.attached == "camera":
                lengths.append(np.inf if isinstance(source, DirectionalLight) else 0.0)
            else:
                lengths.append(0.5 * self._clearance_of(source.position))
        return np.array(lengths)

    def _clearance_of(self, place) -> float:
        """How near the lit points come to a place: surfaces in Phong's method, else vertices or centroids."""
        if self._plan.is_lit_per_sample:
            return find_clearance(self._geometry.positions, self._geometry.vertex, *map(float, place))
        return find_point_clearance(self._geometry.points, *map(float, place))

    def _find_surroundings(self, view, screen, furthest) -> Surroundings:
        """What this view says about the places of lights and surfaces.

        No lit point comes nearer to a light than its clearance: no vertex or centroid, or no sample's point.
        A sample's point lies beside its triangle, because vertices are rounded to 1/256 px: by at most √2/512 px at its
        depth.
        """
        lights = self._plan.lights
        places = [None if isinstance(light, DirectionalLight) else world_position(light, view) for light in lights]
        kept, self._clearances = self._clearances, {}
        for place in places:
            if place is not None and (key := tuple(place.tolist())) not in self._clearances:
                found = kept.get(key)
                self._clearances[key] = self._clearance_of(place) if found is None else found
        beside = 0.0
        if self._plan.is_lit_per_sample:
            deepest = furthest if screen.is_perspective else 1.0
            beside = deepest * math.sqrt(2.0) / 512.0 / min(screen.scale_x, screen.scale_y)
        distances = [np.inf if place is None else self._clearances[tuple(place.tolist())] - beside for place in places]
        distances = np.maximum(np.array(distances, float), 0.0)
        deepness = furthest_over_nearest(screen, furthest) if screen.is_perspective else 0.0
        return Surroundings(furthest, distances, self._shortest, self._plan.is_lit_per_sample, deepness)

    def _draw_buffers(self, camera, buffers, clock):
        """Draw the exact buffers: always with one sample a pixel and float64 records, so that nothing else changes
        them."""
        view, screen = self._screen(camera, 1)
        if len(buffers.depth):
            depths = np.abs((self._bounds - view.eye) * view.forward).max(axis=1).sum(axis=1)
            check_depths(min(float(depths.max()), np.inf if camera.far is None else camera.far))
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
        """Polygon normals towards the viewer, (2, n_point, 3): side 1 is reversed, because write_buffers turns it
        round."""
        normals = self._geometry.normals.T
        away = (self._geometry.points.T - view.eye) if screen.is_perspective else view.forward
        toward = np.where((normals * away).sum(axis=1, keepdims=True) > 0.0, -normals, normals)
        return np.stack([toward, -toward])


def furthest_over_nearest(screen, furthest) -> float:
    """How many times as far as the nearest depth that a z-buffer has room for the furthest point is."""
    if screen.z_scale == 0.0:
        return 1.0
    return max(1.0, min(furthest, screen.far) * (DEPTH_MARGIN - screen.z_offset) / screen.z_scale)


def check_depths(largest) -> None:
    """Refuse a scene whose depths a float32 buffer can't hold, given the largest."""
    least, most = float(np.finfo(np.float32).tiny), float(np.finfo(np.float32).max)
    if largest != 0.0 and not least <= largest <= most:
        raise SceneError(
            f"the scene's depths reach {largest:.3g} scene units; the depth buffer holds {least:.3g} to {most:.3g}: "
            "scale the scene, or leave depth out of the outputs"
        )


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
