"""Depths: fitted to the scene, clipped where a camera says so, and right, or refused, at the ends of float64."""

from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest
from helpers.against_reference import EXACT, NORMAL, compare_with_reference
from helpers.arrays import differences
from helpers.pinhole import SHADINGS

import rasterizer as rz
from rasterizer import reference
from rasterizer.engine.depth_range import MIN_EXTENT, NEAREST, depths_of_boxes, fit_depth_range
from rasterizer.options import DEFAULT_TOLERANCE

LIGHTS = (rz.AmbientLight(0.1), rz.DirectionalLight((-0.4, -0.5, -0.8), 0.8))
BOUNDS = np.array([[[-1.0, -1, -1], [1, 1, 1]], [[2.0, 0, 0], [3, 1, 1]]])


def fitted(camera, bounds=BOUNDS):
    """Near, far and the clip distance that a camera gets."""
    (near, far), clip = fit_depth_range(camera, depths_of_boxes(camera.view(), bounds))
    return near, far, clip


def test_the_range_fits_what_lies_before_the_camera():
    for name, camera, least, most in (
        ("before it", rz.Camera.perspective((0, 0, 5)), 4, 6),
        ("about it", rz.Camera.perspective((0, 0, 0), (0, 0, -1)), NEAREST, 1),
        ("before it, straight", rz.Camera.orthographic((0, 0, 5)), 4, 6),
        ("about it, straight", rz.Camera.orthographic((0, 0, 0.5)), 0, 1.5),
        ("behind it, straight", rz.Camera.orthographic((0, 0, -5), (0, 0, -9)), 0, 0),
    ):
        near, far, clip = fitted(camera)
        assert (near, far) == (pytest.approx(least, rel=1e-5), pytest.approx(most, rel=1e-5)), name
        assert near <= least and far >= most and clip == np.inf, f"{name}: no room for rounding"
    near, far, _ = fitted(rz.Camera.perspective((0, 0, -5), (0, 0, -9)))
    assert 0 < near <= far < np.inf, "a camera that sees nothing gets a range all the same"


@pytest.mark.parametrize("make", [rz.Camera.perspective, rz.Camera.orthographic])
def test_near_and_far_that_are_given_count(make):
    assert fitted(make((0, 0, 5), near=0.25, far=7.5)) == (0.25, 7.5, 7.5)
    near, far, clip = fitted(make((0, 0, 5), near=0.25))
    assert near == 0.25 and far == pytest.approx(6, rel=1e-5) and clip == np.inf
    near, far, clip = fitted(make((0, 0, 5), far=5.5))
    assert near == pytest.approx(4, rel=1e-5) and (far, clip) == (5.5, 5.5)
    assert fitted(make((0, 0, 5), near=50.0)) == (50.0, 50.0, np.inf)
    if make == rz.Camera.perspective:  # what a far plane cuts off does not push the near one away
        assert fitted(make((0, 0, 0), (0, 0, -1), far=0.1))[0] == pytest.approx(0.1 * NEAREST)


def test_scenes_without_depth_are_drawn():
    """All depths equal: the range is a point, and must not divide by zero."""
    corners = [(-1, -1, 0), (1, -1, 0), (0, 1, 0)]
    for camera in (rz.Camera.perspective((0, 0, 3)), rz.Camera.orthographic((0, 0, 3), height=2.5)):
        frame = rz.render(rz.Scene([rz.Mesh(corners, [[0, 1, 2]])], LIGHTS, camera), (40, 30), outputs="depth")
        is_seen = np.isfinite(frame.depth)
        assert is_seen.sum() > 100 and np.abs(frame.depth[is_seen] - 3).max() < 1e-6


NEARS = (None, 0.25, 1e-3, 1e-9, 1e-11, 1e-16, 1e-30, 1e-300, 5e-324)
FARS = (None, 6.0, 1e10, 1e30, 1e300)
PLANES = [*zip(NEARS, cycle(FARS)), *zip(NEARS[::-1], cycle(FARS[1:]))]


@pytest.mark.parametrize("make", [rz.Camera.perspective, rz.Camera.orthographic])
def test_near_and_far_planes_only_clip(make):
    """A square lies a little before another one: however far the planes are from both, it hides it, and nothing is
    off."""
    square = np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    vertices, colors = np.concatenate([square - (0, 0, 1e-3), square]), np.repeat([[1.0, 0, 0], [0, 1, 0]], 4, axis=0)
    faces = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]  # that before is the second one
    planes = PLANES + [(-1e30, 1e30)] * (make == rz.Camera.orthographic)
    for k, (near, far) in enumerate(planes):
        order, tolerance = (1, -1)[k % 2], (0, DEFAULT_TOLERANCE)[k // 2 % 2]
        camera = make((0, 0, 5), near=near, far=far)
        scene = rz.Scene([rz.Mesh(vertices, faces[::order], colors=colors)], [rz.AmbientLight(1.0)], camera)
        frame = rz.render(scene, (32, 24), shading="phong", tolerance=tolerance, samples=1, outputs=("color", "depth"))
        is_seen, case = frame.alpha > 0, f"near {near}, far {far}, tolerance {tolerance:.2g}"
        assert is_seen.sum() > 100 and np.abs(frame.depth[is_seen] - 5).max() < 1e-5, case
        assert frame.color[is_seen][:, 0].max() <= DEFAULT_TOLERANCE, f"{case}: the other one is seen"


def test_a_camera_inside_a_mesh_may_have_any_near_plane():
    """Next to the camera faces are cut, or are not: all colours and depths are finite, and those of the reference."""
    rng = np.random.default_rng(5)
    vertices = rng.uniform(-1, 1, (36, 3))
    mesh = rz.Mesh(vertices, np.arange(36).reshape(-1, 3), colors=rng.uniform(0, 1, (36, 3)), crease_angle=0)
    for near, shading in zip(NEARS[1:], cycle(SHADINGS)):
        camera = rz.Camera.perspective((0, 0, 0), (0.3, 0.2, -1), fov=80, near=near)
        verdict = compare_with_reference(rz.Scene([mesh], LIGHTS, camera), (32, 24), shading=shading, tolerance=0)
        assert max(verdict.color, verdict.depth) <= EXACT and verdict.normal <= NORMAL, f"near {near}: {verdict}"
        assert verdict.n_compared > 100


# ---------------------------------------------------------------- units


def draw_scaled(scale):
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
    faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    scene = rz.Scene([rz.Mesh(scale * corners, faces, crease_angle=0)], LIGHTS)
    return rz.render(scene, (64, 48), outputs=("color", "face"), tolerance=0, samples=1)


def test_what_is_too_small_for_float64_is_refused():
    for scale in (0.5 * MIN_EXTENT, 1e-310, 5e-324):
        with pytest.raises(rz.SceneError, match="large; it must be at least .*: scale the scene"):
            draw_scaled(scale)


def test_nothing_before_the_camera_is_cut_however_large_the_scene_or_no_bound_is_stated():
    """A ball near the eye over floors of any size, in one mesh with the floor or beside it; a wall through the eye."""
    ball = rz.load("models/sphere.obj").meshes[0]
    small = rz.Mesh((ball.vertices - ball.bounds.mean(axis=0)) / np.ptp(ball.bounds, axis=0).max() * 0.2, ball.faces)
    camera = rz.Camera.perspective((0, 0, 0.6), fov=40)
    for size in (1e1, 1e3, 1e6, 2e7):
        square = np.array([(-1, -1, -1), (1, -1, -1), (1, -1, 1), (-1, -1, 1)]) * (size, 1, size)
        floor = rz.Mesh(square, [(0, 2, 1), (0, 3, 2)])
        both = rz.Mesh(
            np.concatenate([small.vertices, square]), np.concatenate([small.faces, len(small.vertices) + floor.faces])
        )
        for meshes in ([small, floor], [both]):
            scene = rz.Scene(meshes, LIGHTS, camera)
            frame = rz.render(scene, (60, 48), samples=1, outputs=("color", "face", "depth"))
            seen = (frame.face >= 0) & (frame.face < small.n_face)
            assert 0.1 < seen.mean() < 0.5, f"floor of {size:g}: the ball covers {seen.mean():.3f}"
            assert frame.depth[seen].min() == pytest.approx(0.5, rel=1e-3) and frame.stats.error_bound is not None
            judged = reference.render(scene, (60, 48), shading="phong")
            assert not differences(frame.face[seen], judged.face[seen])
    far = rz.Mesh([(-1e8, -1, -1e8), (1e8, -1, -1e8), (0, -1, 9)], [(0, 1, 2)])
    through = rz.Mesh([(-1e-9, 0, -1), (1e-9, 0, 1), (0, 1, 0)], [(0, 1, 2)])
    camera = rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=90)
    frame = rz.render(rz.Scene([through, far], LIGHTS, camera), (61, 48), cull="none")
    assert frame.stats.error_bound is None and "cut" in frame.stats.steps[-1].cause
    lost = replace(small, vertices=small.vertices * 0.1 - (0, 0, 0.5))
    for outputs in ("color", "depth", ("rgb", "face")):
        with pytest.warns(UserWarning, match="isn't drawn, for the sake of depth: give the camera a near plane"):
            frame = rz.render(rz.Scene([lost, far], LIGHTS, camera), (61, 48), outputs=outputs)
    near = rz.render(rz.Scene([through, far], LIGHTS, replace(camera, near=1.0)), (61, 48), cull="none")
    assert near.stats.error_bound is not None, "what the user's own plane cuts is no news"


def test_a_square_across_the_view_has_one_depth():
    """Also where there is no range of depths, and where the one depth is 0: zeros don't tell which kind it is."""
    white, corners = rz.Material(diffuse=0.8, specular=0.0), [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]]
    square = rz.Mesh(corners, [[0, 1, 2], [0, 2, 3]], material=white)
    lamp = rz.PointLight((0.3, 0.2, 1.0), 1.0, attenuation=(0, 0, 1))
    for away in (0.0, 2.0**-30, 1.0, 7.0):
        parallel = rz.Camera.orthographic((0, 0, away), (0, 0, away - 1), height=3.0)
        for camera in (parallel, rz.Camera.perspective((0, 0, max(away, 2.0**-10)), (0, 0, -1), fov=60)):
            scene = rz.Scene(square, lamp, camera)
            frame = rz.render(scene, (48, 32), shading="phong", threads=1, outputs=("color", "depth"), samples=1)
            exact = reference.render(scene, (48, 32), shading="phong")
            assert np.ptp(exact.color) > (0.1 if away > 0.5 or camera is parallel else 0.0)
            error, bound = np.abs(frame.color - exact.color).max(), frame.stats.error_bound + 1e-7
            assert frame.stats.plan.dtype == "float32" and error <= bound, f"depth {away}: {error:.3g} > {bound:.3g}"
