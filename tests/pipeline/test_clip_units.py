"""Clipped faces look alike in any unit of length, and however far away one of their corners lies."""

import numpy as np
import pytest
from helpers.against_reference import compare_with_reference
from helpers.pinhole import unit

import rasterizer as rz


@pytest.mark.parametrize("is_perspective", [True, False])
def test_clipped_faces_are_the_same_in_any_unit(is_perspective):
    """A scene whose lengths are 2^k times as long has the same picture, and depths 2^k times as deep, to the last bit;
    the judge agrees."""
    rng = np.random.default_rng(3)
    points, normals = rng.normal(0, 1.5, (24, 3)), unit(rng.normal(size=(24, 3)))
    lens = {"fov": 60.0} if is_perspective else {"height": 2.0}
    frames = []
    for unit_length in (1.0, 2.0**-70, 2.0**70):
        lengths = {name: unit_length * value for name, value in lens.items() if name == "height"}
        camera = rz.Camera(position=(0, 0, 2 * unit_length), near=1.8 * unit_length, **(lens | lengths))
        mesh = rz.Mesh(unit_length * points, np.arange(24).reshape(-1, 3), normals=normals)
        scene = rz.Scene([mesh], [rz.AmbientLight(0.1), rz.DirectionalLight((-0.3, -0.5, -0.8), 0.8)], camera)
        frames.append(rz.render(scene, (24, 18), shading="phong", tolerance=0, outputs=("color", "depth", "face")))
        compare_with_reference(scene, (24, 18), shading="phong", tolerance=0)
    assert frames[0].stats.clipped > 3 and (frames[0].face >= 0).sum() > 100
    for frame, unit_length in zip(frames[1:], (2.0**-70, 2.0**70), strict=True):
        assert (frame.face == frames[0].face).all() and (frame.color == frames[0].color).all()
        assert (frame.depth == np.float32(unit_length) * frames[0].depth).all()


def test_a_face_with_one_corner_very_far_away_is_not_seen_edge_on():
    """Its determinant is small beside its furthest corner's length, not beside the product of all three."""
    for ratio in (1e6, 1e7, 5e7):
        points = np.array([[-1, -1, -1], [2, -1, -1.5], [0.1 * ratio, 0.6 * ratio, -ratio]])
        mesh = rz.Mesh(np.concatenate([points, points[:1] + (0, 0, 1.5)]), [[0, 1, 2], [1, 3, 2]])
        camera = rz.Camera.perspective((0, 0, 0), (0, 0, -1), near=0.1)
        scene = rz.Scene([mesh], [rz.DirectionalLight((-0.3, -0.5, -0.8))], camera)
        compare_with_reference(scene, (24, 18), shading="phong", tolerance=0)


def test_what_a_far_plane_cuts_off_does_not_push_the_near_plane_away():
    """A floor below the eye and a speck 10^8 away: with a far plane the floor is seen from where it comes into the
    picture."""
    floor = [[-50, -1, -50], [50, -1, -50], [50, -1, 50], [-50, -1, 50]]
    speck = [[0, 0, -1e8], [1e6, 0, -1e8], [0, 1e6, -1e8]]
    meshes = [rz.Mesh(floor, [[0, 3, 2, 1]]), rz.Mesh(speck, [[0, 1, 2]])]
    nearest = []
    for far in (None, 40.0):
        camera = rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=60, far=far)
        scene = rz.Scene(meshes, [rz.DirectionalLight((-0.3, -0.5, -0.8))], camera)
        compare_with_reference(scene, (24, 18), shading="phong", tolerance=0)
        nearest.append(rz.render(scene, (24, 18), outputs=("depth",)).depth[-1].min())
    assert nearest[0] > 95 or np.isinf(nearest[0]), (
        "a near plane at 2^-20 of the speck's depth leaves this of the floor"
    )
    assert nearest[1] == pytest.approx(18 / 17 * np.sqrt(3), rel=1e-4)


def test_the_scene_s_box_decides_how_near_the_fitted_near_plane_is():
    """Triangles up to 10^7 times as far away at one corner as at another: the judge and the renderer clip them
    alike."""
    rng = np.random.default_rng(1)
    for _ in range(10):
        depth = 10.0 ** rng.uniform(0, 7, (12, 1))
        points = np.concatenate([rng.uniform(-1, 1, (12, 2)), -np.ones((12, 1))], axis=1) * depth
        mesh = rz.Mesh(points, np.arange(12).reshape(-1, 3))
        scene = rz.Scene(
            [mesh], [rz.DirectionalLight((-0.3, -0.5, -0.8))], rz.Camera.perspective((0, 0, 0), (0, 0, -1))
        )
        compare_with_reference(scene, (24, 18), shading="flat", tolerance=0)


@pytest.mark.parametrize("seed", [*range(100), 121, 1315, 1475])
def test_order_next_to_clipped_faces_is_that_of_their_planes(seed):
    """Soups round the eye in small pictures, where faces are steep: rounding their corners must not tilt the planes of
    depth."""
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 1, (24, 3)) * 10 ** rng.uniform(-1, 1.5)
    fov, near = rng.uniform(40, 140), None if seed % 2 else 10 ** rng.uniform(-4, -1)
    camera = rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=fov, near=near)
    scene = rz.Scene([rz.Mesh(points, np.arange(24).reshape(-1, 3))], [rz.AmbientLight(1.0)], camera)
    compare_with_reference(scene, (16, 12), shading="flat", tolerance=0)
