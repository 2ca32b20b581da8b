"""Climb for the worst points: float32 against float64 at single points, over what the bounds say for just that point.

Every case is one light, one material and one point. The search starts from random ones, near and far, grazing and next
to highlights and the edges of cones, and moves where the share of the bound that is used up is largest.
"""

from itertools import cycle, product

import numpy as np
import pytest
from helpers.lit_points import light_points_of, plan_of_points
from helpers.pinhole import unit

import rasterizer as rz
from rasterizer.engine.bounds import Distances, rounding_errors
from rasterizer.engine.reflections import MIN_SUM
from rasterizer.engine.rounding import SINGLE, step_cosine

EYE = np.array([0.0, 0.0, 5.0])
GENEROUS, EXACT = 1e30, 0.0  # tolerances: float32 and float64


def of(model, **fields):
    return rz.Material(reflection=model, **{"ambient": 0, "diffuse": 0.8, "specular": 0.7} | fields)


MATERIALS = {
    "lambert": of("lambert"),
    "oren-nayar": of("oren-nayar", roughness=0.6),
    "phong, dull": of("phong", shininess=3),
    "phong": of("phong", shininess=40),
    "phong, sharp": of("phong", shininess=1800),
    "phong, any exponent": of("phong", shininess=700.3),
    "phong, weighted": of("phong", shininess=25, normalized=True, fresnel=0.1),
    "blinn": of("blinn", shininess=60),
    "blinn, sharp": of("blinn", shininess=1000),
    "ggx, rough": of("cook-torrance", roughness=0.7),
    "ggx": of("cook-torrance", roughness=0.3),
    "ggx, smooth": of("cook-torrance", roughness=0.1),
    "beckmann": of("cook-torrance", roughness=0.35, distribution="beckmann"),
    "beckmann, smooth": of("cook-torrance", roughness=0.12, distribution="beckmann"),
}
PLACE, WAY = (0.6, 0.9, 0.4), (-0.5, -0.8, -0.33)
LIGHTS = {
    "directional": rz.DirectionalLight((-0.4, -0.8, -0.5), 0.9),
    "point": rz.PointLight(PLACE, 0.9),
    "point, weakened": rz.PointLight(PLACE, 0.9, (0.3, 0.2, 2.0)),
    "point, amplifies": rz.PointLight(PLACE, 0.1, (0, 0, 1), amplify=True),
    "point, range": rz.PointLight(PLACE, 0.9, (0.5, 0.5, 0), range=1.5),
    "spot": rz.SpotLight(PLACE, WAY, 0.9, 15, 20),
    "spot, exponent": rz.SpotLight(PLACE, WAY, 0.9, 20, 60, 30),
    "spot, amplifies": rz.SpotLight(PLACE, WAY, 0.02, 25, 40, 4, attenuation=(0, 0.1, 1), amplify=True),
}


def lit(material, light, points, normals, tolerance):
    """Intensities (n,) at points that are lit as vertices are, and the plan."""
    clearance = float(np.linalg.norm(points - np.array(PLACE), axis=1).min())
    view = rz.Camera.perspective(EYE, (0, 0, 0)).view()
    plan = plan_of_points(material, light, tolerance, clearance)
    return light_points_of(material, light, points, normals, view, tolerance, clearance), plan


def directions(light, points):
    """L and V at points, (n, 3) each, and their distances from the light, (n,)."""
    to_eye = unit(EYE - points)
    if isinstance(light, rz.DirectionalLight):
        return np.broadcast_to(-np.array(light.direction), points.shape), to_eye, np.full(len(points), np.inf)
    away = np.array(light.position) - points
    return unit(away), to_eye, np.linalg.norm(away, axis=1)


def bounds_at(plan, light, points):
    """What `rounding_errors` says of each point, (n,): each counts as a material of its own."""
    distances, brightness, n = directions(light, points)[2], plan.brightness, len(points)
    rows = {name: np.repeat(getattr(brightness, name), n, axis=0) for name in ("undirected", "diffuse", "specular")}
    around = Distances(furthest=np.linalg.norm(points - EYE, axis=1), clearances=distances[:, None])
    return rounding_errors(brightness._replace(materials=brightness.materials * n, **rows), around, SINGLE)


def shares(material, light, points, normals):
    """The share of the bound that the error of each point uses up, (n,); 0 next to a step, and where none is seen."""
    to_light, to_eye, _ = directions(light, points)
    single, plan = lit(material, light, points, normals, GENEROUS)
    double = lit(material, light, points, normals, EXACT)[0]
    assert plan.dtype == np.float32
    n_dot_l, n_dot_v = (normals * to_light).sum(axis=1), (normals * to_eye).sum(axis=1)
    is_clear = (np.abs(n_dot_l) > step_cosine(SINGLE)) & (n_dot_v > 1e-4)
    if "cook" in material.reflection:  # N·H = 0
        is_clear &= np.abs((normals * unit(to_light + to_eye)).sum(axis=1)) > step_cosine(SINGLE)
    if material.reflection in ("blinn", "cook-torrance"):
        is_clear &= np.linalg.norm(to_light + to_eye, axis=1) > MIN_SUM[SINGLE]
    error, bounds = np.abs(single - double), bounds_at(plan, light, points)
    assert not error[bounds == 0.0].any(), "light beyond its range"
    return np.where(is_clear & (bounds > 0.0), error / np.maximum(bounds, np.finfo(float).tiny), 0.0)


def starts(rng, light, n):
    """Points about the light, many of them near it or next to the edge of its cone, and normals next to half vectors,
    mirrors and horizons."""
    points = np.array(PLACE) + 10.0 ** rng.uniform(-2.5, 0.5, (n, 1)) * unit(rng.normal(size=(n, 3)))
    if isinstance(light, rz.SpotLight):
        axis = np.array(light.direction)
        across = unit(np.cross(axis, rng.normal(size=(n, 3))))
        angle = np.radians(rng.uniform(0.6 * light.inner, light.outer, (n, 1)))
        ways = np.cos(angle) * axis + np.sin(angle) * across
        points = np.array(light.position) + 10.0 ** rng.uniform(-2.5, 0.5, (n, 1)) * ways
    to_light, to_eye, _ = directions(light, points)
    about = np.stack([unit(to_light + to_eye), to_light, to_eye, unit(rng.normal(size=(n, 3)))])
    normals = about[rng.integers(0, 4, n), np.arange(n)] + rng.choice([0.02, 0.2, 1.0], (n, 1)) * rng.normal(
        size=(n, 3)
    )
    return points, unit(normals)


def climb(rng, material, light, n=120, n_step=8):
    """The largest share that is found from n starting points."""
    points, normals = starts(rng, light, n)
    best = shares(material, light, points, normals)
    for step in 0.3 * 0.5 ** np.arange(n_step):
        reach = np.linalg.norm(points - np.array(PLACE), axis=1, keepdims=True)
        moved = points + step * reach * 0.3 * rng.normal(size=points.shape)
        turned = unit(normals + step * rng.normal(size=normals.shape))
        found = shares(material, light, moved, turned)
        is_better = found > best
        points[is_better], normals[is_better] = moved[is_better], turned[is_better]
        best = np.maximum(best, found)
    return best.max()


def check(names_and_kinds):
    for name, kind in names_and_kinds:
        worst = climb(np.random.default_rng(len(name) + 31 * len(kind)), MATERIALS[name], LIGHTS[kind])
        assert 0.0 < worst <= 1.0, f"{name}, {kind}: {worst:.3f} of the bound > 1"


def test_no_single_point_is_further_off_than_its_bound():
    check([*zip(MATERIALS, cycle(LIGHTS)), ("phong", "spot"), ("ggx", "point, amplifies")])


@pytest.mark.nightly
def test_no_single_point_of_any_material_and_light_is_further_off_than_its_bound():
    check(product(MATERIALS, LIGHTS))
