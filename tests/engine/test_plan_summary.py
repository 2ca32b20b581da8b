"""The plan in words: what a picture needed, and how many triangles took which way."""

import pickle

import numpy as np
from helpers.pinhole import octasphere

import rasterizer as rz

BALL = rz.Mesh(*octasphere(3), crease_angle=180)
LIGHT = rz.DirectionalLight((0.2, -0.3, -1))
CAMERA = rz.Camera.perspective((0, 0, 4), fov=40)
SIZE = (64, 48)


def plan_of(mesh=BALL, lights=(LIGHT,), **options):
    frame = rz.render(rz.Scene([mesh], lights, CAMERA), SIZE, **{"samples": 1} | options)
    return frame.stats.plan


def test_a_plan_names_the_features_that_a_scene_uses():
    image = np.full((2, 2, 3), 0.5)
    material = rz.Material(reflection="cook-torrance", texture=rz.Texture(image), opacity=0.5)
    mesh = rz.Mesh(*octasphere(2), uv=np.zeros((66, 2)), material=material)
    lights = (rz.SpotLight((0, 0, 4), (0, 0, -1), outer=30, shadow=True), rz.AmbientLight(0.2))
    plan = plan_of(mesh, lights, shading="phong")
    assert plan.features == ("textures", "shadows", "transparency") and plan.dtype == "float32"
    assert plan.reasons == () and plan.materials == 1 and plan.doubles == 0
    assert "float32" in repr(plan) and "textures" in repr(plan) and "shadows" in repr(plan)


def test_a_renderer_tells_its_plan_before_and_after_a_picture():
    with rz.Renderer(rz.Scene([BALL], [LIGHT], CAMERA), SIZE, samples=1, shading="gouraud") as renderer:
        assert renderer.plan.paths is None and renderer.plan.dtype == "float32"
        frame = renderer.render()
        assert renderer.plan == frame.stats.plan and renderer.plan.paths is not None
    assert pickle.loads(pickle.dumps(frame.stats.plan)) == frame.stats.plan


def test_a_plan_counts_the_lights():
    plan = plan_of(lights=(LIGHT, rz.DirectionalLight((0, 0, -1), 0), rz.AmbientLight(0.1)))
    assert plan.left_out == 1 and "left out: 1 light that" in repr(plan)
    assert plan.lights == 1 and "1 light" in repr(plan)
    assert plan_of().left_out == 0 and "left out" not in repr(plan_of())
