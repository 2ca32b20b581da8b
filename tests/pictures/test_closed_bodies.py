"""The rule of `cull="auto"`: what is left out of closed bodies is what nobody sees."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.bodies import inside_out, random_scene
from helpers.pinhole import octasphere, torus

import rasterizer as rz
from rasterizer import reference

SIZE = (96, 72)
BALL = rz.Mesh(*octasphere(3))
LIGHTS = (rz.AmbientLight(0.3), rz.DirectionalLight((-1, -2, -0.5), 0.7))
OUTSIDE = rz.Camera.perspective((3, 2, 4), fov=35)


def pictures(scene, size=SIZE, **options):
    """The picture by the rule, and the one without culling."""
    outputs = "color", "depth", "face", "mask"
    return [rz.render(scene, size, cull=cull, outputs=outputs, **options) for cull in ("auto", "none")]


def check_same(scene, **options):
    """Both pictures cover the same samples. Where both show one face, they are the same; else they show two sides of an
    outline, which may lie behind glass. There a back may hide its front, within 1/512 px (see `ErrorBounds.face`): so
    the rule may show what is nearer, too. Return how many faces were left out, and how many pixels differ."""
    found, whole = pictures(scene, samples=1, **options)
    assert (found.mask == whole.mask).all() and (found.alpha == whole.alpha).all()
    is_other, is_same = found.face != whole.face, (found.rgba == whole.rgba).all(axis=2)
    assert (found.depth == whole.depth)[~is_other].all()
    if all(material.is_opaque for mesh in scene.meshes for material in mesh.palette):
        assert is_same[~is_other].all()
    is_other |= ~is_same
    assert is_other.sum() <= 2, f"{is_other.sum()} pixels differ"
    assert (np.abs(found.depth[is_other] - whole.depth[is_other]) <= 0.01 * whole.depth[is_other]).all()
    assert whole.stats.culled == 0
    return found.stats.culled, is_other.sum()


def check_scenes(seeds):
    """Random bodies by each way of shading; return how many of the scenes had anything left out."""
    n_culled = 0
    for seed in seeds:
        try:
            n_culled += check_same(random_scene(seed), shading=("flat", "gouraud", "phong")[seed % 3])[0] > 0
        except AssertionError as fault:
            raise AssertionError(f"seed {seed}: {fault}") from None
    return n_culled


def test_nothing_that_is_seen_is_left_out():
    assert check_scenes(range(60)) > 20


@pytest.mark.nightly
def test_nothing_that_is_seen_is_left_out_of_many_scenes():
    check_scenes(range(60, 2000))


def test_the_reference_leaves_out_the_same():
    for seed in range(100, 112):
        scene = random_scene(seed)
        expected = reference.render(scene, (40, 30), shading="flat")
        found = rz.render(scene, (40, 30), shading="flat", samples=1, outputs="face").face
        is_clear = expected.margin > 1e-4
        assert (found == expected.face)[is_clear].all(), f"seed {seed}"


def test_bodies_are_left_out_from_outside_only():
    """Neither from within, nor where a near plane opens them; a far plane opens nothing that is seen."""
    inside = rz.Camera.perspective((0.3, 0.2, 0.1), (1, 1, 1), fov=60)
    cut, before_it = replace(OUTSIDE, near=5.0), replace(OUTSIDE, near=3.5)
    beside = rz.Camera.perspective((1.2, 0.3, 0.2), (0.6, 0.3, 3.0), fov=60, near=0.1)  # the box reaches behind it
    for camera, is_culled in ((OUTSIDE, True), (inside, False), (cut, False), (before_it, True),
                              (beside, True), (replace(beside, near=1.0), False),
                              (replace(OUTSIDE, far=5.5), True), (rz.Camera.orthographic((0, 0, 3), height=2.5), True),
                              (rz.Camera.orthographic((0, 0, 0), (0, 0, -1), height=2.5), False)):  # fmt: skip
        for shading in ("flat", "gouraud", "phong"):
            culled, _ = check_same(rz.Scene(BALL, LIGHTS, camera), shading=shading)
            assert (culled > 0) == is_culled, camera


def test_each_mesh_is_asked_for_itself():
    """One that the eye is in, and one that it sees."""
    room = rz.Mesh(10.0 * BALL.vertices, BALL.faces)
    alone, _ = check_same(rz.Scene(BALL, LIGHTS, OUTSIDE))
    both, _ = check_same(rz.Scene([room, BALL], LIGHTS, OUTSIDE))
    assert alone == both > 200


def test_bodies_that_are_inside_out_show_their_outside():
    turned = rz.Mesh(*inside_out(None, BALL.vertices, BALL.faces))
    for shading in ("flat", "gouraud", "phong"):
        assert check_same(rz.Scene(turned, LIGHTS, OUTSIDE), shading=shading)[0] > 200


def test_edges_shadows_and_glass_are_those_of_the_whole_scene():
    """What is seen through glass, too: a closed body behind it, and the glass's own back."""
    ring, glass = rz.Mesh(*torus(30, 16)), replace(BALL, material=rz.Material(opacity=0.4))
    lamp = rz.DirectionalLight((-1, -2, -0.5), 0.7, shadow=rz.Shadow(256))
    for scene, options in (
        (rz.Scene(ring, LIGHTS, OUTSIDE), {"edges": "all"}),
        (rz.Scene([ring, glass], LIGHTS, OUTSIDE), {}),
        (rz.Scene([ring, rz.Mesh(0.3 * BALL.vertices, BALL.faces)], (LIGHTS[0], lamp), OUTSIDE), {"shading": "phong"}),
    ):
        assert check_same(scene, **options)[0] > 100
