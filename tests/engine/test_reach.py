"""Check that a light is left out only where it adds exactly 0: point by point in both types, and picture by picture."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.lit_points import light_points_of
from helpers.pinhole import SHADINGS, octasphere, unit

import rasterizer as rz
from rasterizer.engine.reach import NormalCones, is_black, lights_reaching

VIEW = rz.Camera.perspective((1.0, 2.0, 6.0), (0, 0, 0)).view()
WHITE = rz.Material(ambient=0, diffuse=1, specular=1, shininess=3)
SIZE = (40, 30)


def random_light(rng, kind):
    """A light near the origin whose range or cone ends somewhere between the boxes."""
    place, way = rng.normal(size=3), unit(rng.normal(size=3))
    if kind == "range":
        return rz.PointLight(place, 1.0, tuple(rng.uniform(0, 1, 3)), range=float(10.0 ** rng.uniform(-1, 1)))
    outer = float(rng.uniform(1, 90))
    inner = float(rng.choice([outer, rng.uniform(0, outer)]))
    falloff = float(rng.choice([1.0, 0.6, 3.0]))
    return rz.SpotLight(place, way, 1.0, inner, outer, float(rng.choice([0, 4])), falloff=falloff)


def boxes_at_the_edge(rng, light, n):
    """Boxes (n, 2, 3), most of them next to the end of a light's range or cone: just beyond, or just not."""
    sizes = 10.0 ** rng.uniform(-6, 0.3, (n, 1)) * rng.random((n, 3))
    off = 10.0 ** rng.uniform(-8, 0, (n, 1)) * rng.choice([-0.3, 1.0], (n, 1))
    ways = unit(rng.normal(size=(n, 3)))
    if isinstance(light, rz.SpotLight):
        axis = np.array(light.direction)
        across = unit(np.cross(axis, rng.normal(size=(n, 3))))
        angle = np.radians(light.outer) + off
        ways, far = np.cos(angle) * axis + np.sin(angle) * across, 10.0 ** rng.uniform(-1, 1, (n, 1))
    else:
        far = light.range * (1.0 + off)
    # The corner that is nearest to the light, or to its axis, stands at the edge.
    corner = np.array(light.position) + far * ways
    side = np.sign(ways) if not isinstance(light, rz.SpotLight) else np.sign(across)
    other = corner + np.where(side == 0, 1.0, side) * sizes
    return np.stack([np.minimum(corner, other), np.maximum(corner, other)], axis=1)


def points_in(rng, box, n=24):
    """Points of a box (2, 3), its corners among them."""
    corners = np.stack(np.meshgrid(*box.T, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.concatenate([corners, rng.uniform(box[0], box[1], (n, 3))])


@pytest.mark.parametrize("kind", ["range", "cone"])
def test_what_is_left_out_adds_exactly_nothing(kind):
    """Boxes whose nearest corner is from 10^-8 to 1 beyond the edge, or on this side of it; in float64 and float32."""
    rng, n_out, n_in = np.random.default_rng(5), 0, 0
    for k in range(40):
        light = random_light(rng, kind)
        boxes = boxes_at_the_edge(rng, light, 40)
        reaches = lights_reaching((light,), VIEW, boxes)[:, 0]
        points = np.concatenate([points_in(rng, box, 8) for box in boxes])
        normals = unit(np.array(light.position) - points + 1e-3 * rng.normal(size=points.shape))
        found = light_points_of(WHITE, light, points, normals, VIEW, (0.0, 1e30)[k % 2]).reshape(len(boxes), -1)
        assert (found[~reaches] == 0.0).all(), f"{light}: {found[~reaches].max():.3g} > 0"
        n_out, n_in = n_out + int((~reaches).sum()), n_in + int((found[reaches] > 0.0).any(axis=1).sum())
    assert n_out > 200 and n_in > 200, f"{n_out} left out, {n_in} lit"


def test_the_edge_is_known_to_a_millionth():
    """A light isn't kept without need: what is beyond by more than rounding and the box's own size is left out."""
    light = rz.PointLight((0, 0, 0), range=2.0)
    for beyond, reaches in ((1e-9, True), (1e-4, False)):
        box = np.array([[2.0 + beyond, 0, 0], [2.5, 0.1, 0.1]])
        assert lights_reaching((light,), VIEW, box)[0, 0] == reaches, beyond
    spot = rz.SpotLight((0, 0, 0), (0, 0, -1), 1.0, 20, 30)
    for angle, reaches in ((29.0, True), (30.001, False), (170.0, False)):
        way = np.array([np.sin(np.radians(angle)), 0, -np.cos(np.radians(angle))])
        assert lights_reaching((spot,), VIEW, np.stack([way, way + 1e-9]))[0, 0] == reaches, angle


def test_samples_beside_their_triangles_count():
    light, box = rz.PointLight((0, 0, 0), range=2.0), np.array([[2.01, 0, 0], [2.5, 0.1, 0.1]])
    assert not lights_reaching((light,), VIEW, box)[0, 0] and lights_reaching((light,), VIEW, box, beside=0.02)[0, 0]


def test_lights_without_an_end_reach_everything():
    lights = (
        rz.DirectionalLight((0, 0, -1)),
        rz.PointLight((0, 0, 0)),
        rz.SpotLight((0, 0, 0), (0, 0, -1), 1.0, 20, 90),
    )
    boxes = np.array([[[-1e6, 3, 0], [1e6, 5, 1]], [[2, -1, -1], [3, 1, 1]]], float)
    assert not differences(lights_reaching(lights, VIEW, boxes), True)
    assert lights_reaching((), VIEW, boxes).shape == (2, 0)


def test_lights_move_with_the_camera():
    light = rz.PointLight((0, 0, -6.4), range=1.0, attached="camera")  # at the origin
    boxes = np.array([[[-0.1, -0.1, -0.1], [0.1, 0.1, 0.1]], [[3, 0, 0], [4, 1, 1]]], float)
    assert lights_reaching((light,), VIEW, boxes)[:, 0].tolist() == [True, False]


def test_black_is_no_light():
    assert is_black(rz.DirectionalLight((0, 0, -1), 0)) and is_black(
        rz.PointLight((0, 0, 0), 0, (0.1, 0, 1), amplify=True)
    )
    assert not is_black(rz.DirectionalLight((0, 0, -1), (0, 0, 1e-30)))
    assert not is_black(rz.PointLight((0, 0, 0), 0, (0, 0, 1), amplify=True)), "0 times infinity is no number"
    assert not is_black(rz.DirectionalLight((0, 0, -1), rz.Spectrum([400, 500], [0, 0])))


# ---------------------------------------------------------------- pictures


def assert_same_bytes(scene, other, **options):
    """Refuse pictures that differ in any bit of any colour."""
    for shading in SHADINGS:
        frames = [rz.render(s, SIZE, shading=shading, **{"samples": 1} | options) for s in (scene, other)]
        assert frames[0].color.max() > 0.1
        assert (frames[0].color == frames[1].color).all() and (frames[0].rgba == frames[1].rgba).all(), shading


def test_pictures_without_lights_that_do_not_reach_are_the_same():
    """Two balls, and lights that end before them, shine past them, or are black."""
    rng = np.random.default_rng(11)
    vertices, faces = octasphere(2)
    meshes = [
        rz.Mesh(0.7 * vertices + (x, 0, 0), faces, material=rz.Material(shininess=9), crease_angle=180) for x in (-1, 1)
    ]
    boxes, camera = np.stack([mesh.bounds for mesh in meshes]), rz.Camera.perspective((1, 2, 6), (0, 0, 0))
    sun, n_out = rz.DirectionalLight((0.2, -0.5, -1), (0.5, 0.4, 0.3)), 0
    for tolerance in (0.0, 1 / 4096):
        near = [rz.PointLight(3 * unit(rng.normal(size=3)), 0.7, range=float(rng.uniform(0.5, 3))) for _ in range(9)]
        near += [rz.SpotLight(3 * unit(rng.normal(size=3)), rng.normal(size=3), 0.7, 10, 25) for _ in range(9)]
        black = (rz.PointLight((1, 1, 2), 0), rz.DirectionalLight((0, 1, 0), 0, shadow=True))
        lights = (*black, sun, *near, *black)
        reaches = lights_reaching(lights, camera.view(), boxes, beside=0.05).any(axis=0)
        kept = tuple(light for light, is_kept in zip(lights, reaches, strict=True) if is_kept)
        n_out += len(lights) - len(kept)
        assert_same_bytes(rz.Scene(meshes, lights, camera), rz.Scene(meshes, kept, camera), tolerance=tolerance)
    assert n_out > 16, f"{n_out} lights were left out"


def test_lights_behind_what_is_seen_from_one_side():
    """With cull="back" no normal is turned; without, the same light reaches the other side."""
    square = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    mesh = rz.Mesh(square, [[0, 1, 2], [0, 2, 3]], material=rz.Material(shininess=9))
    camera, sun = rz.Camera.perspective((0, 0, 4)), rz.DirectionalLight((0.1, 0, -1), 0.8)
    cones = NormalCones(np.array([[0.0, 0.0, 1.0]]), np.array([1.0]))
    behind = (rz.DirectionalLight((0.5, 0.2, 1)), rz.PointLight((0.3, 0.1, -2)), rz.SpotLight((0, 0, -1), (0, 0, 1)))
    beside = rz.PointLight((0.3, 0.1, 1e-9))
    boxes = mesh.bounds[None]
    found = lights_reaching((sun, *behind, beside), camera.view(), boxes, cones=cones)[0]
    assert found.tolist() == [True, False, False, False, True]
    assert not differences(lights_reaching((sun, *behind), camera.view(), boxes), True)
    wide = cones._replace(cosines=np.array([np.cos(np.radians(70))]))
    assert not differences(lights_reaching(behind, camera.view(), boxes, cones=wide), True)
    assert not differences(lights_reaching(behind[:1], camera.view(), boxes, cones=cones, turn=1.2), True)
    scenes = [rz.Scene([mesh], lights, camera) for lights in ((sun, *behind), (sun,))]
    assert_same_bytes(*scenes, tolerance=0.0, cull="back")
    turned = replace(scenes[0], camera=rz.Camera.perspective((0, 0, -4)))
    assert rz.render(turned, SIZE, samples=1).color.max() > 0.1
