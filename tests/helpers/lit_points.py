"""The illumination equation at points, in the type that a tolerance asks for."""

from types import SimpleNamespace

import numpy as np

import rasterizer as rz
from rasterizer.engine.plan import make_plan
from rasterizer.engine.scene_tables import SceneTables
from rasterizer.engine.uniforms import make_lighting
from rasterizer.pipeline.fragments import make_batch
from rasterizer.pipeline.lighting import SurfacePoints, light_points
from rasterizer.pipeline.transform import Screen


def plan_of_points(material, light, tolerance, clearance=None):
    """The plan of a scene of one light and one material; float64 for tolerance 0."""
    meshes = [SimpleNamespace(palette=(material,), uv=None)]
    scene = SimpleNamespace(background=None, lights=(light,), depth_cue=None, meshes=meshes)
    clearances = None if clearance is None else np.full((1, 1), clearance)
    options = rz.Options(tolerance=tolerance)
    return make_plan(SceneTables(scene, options), options, np.empty((0, 3)), clearances=clearances)


def light_points_of(material, light, points, normals, view, tolerance, clearance=None):
    """Intensities (n,) float64 of points that are lit as vertices are, seen in perspective."""
    plan = plan_of_points(material, light, tolerance, clearance)
    screen = Screen(view.eye, view.right, view.up, view.forward, view.right, *[1.0] * 9, True)
    surface = SurfacePoints(*map(np.ascontiguousarray, (points, normals)), None, np.empty((0, 3)), np.empty((2, 0)))
    found = np.empty((len(points), plan.n_channel))
    batch = make_batch(plan.dtype)
    light_points(surface, (0, len(points)), screen, 1, make_lighting(plan, view, plan.dtype), 0, batch, found)
    return found[:, 0]
