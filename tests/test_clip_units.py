"""Clipped faces look alike in any unit of length, and however far away one of their corners lies."""

import numpy as np
import pytest
from judge import compare
from pinhole import unit

import rasterizer as rz


@pytest.mark.parametrize("is_perspective", [True, False])
def test_clipped_faces_are_the_same_in_any_unit(is_perspective):
    """A scene whose lengths are 2^k times as long has the same picture, and depths 2^k times as deep, to the last bit; the judge
    agrees."""
    rng = np.random.default_rng(3)
    points, normals = rng.normal(0, 1.5, (24, 3)), unit(rng.normal(size=(24, 3)))
    lens = {"fov": 60.0} if is_perspective else {"height": 2.0}
    frames = []
    for unit_length in (1.0, 2.0**-70, 2.0**70):
        lengths = {name: unit_length * value for name, value in lens.items() if name == "height"}
        camera = rz.Camera(position=(0, 0, 2 * unit_length), near=1.8 * unit_length, **(lens | lengths))
        mesh = rz.Mesh(unit_length * points, np.arange(24).reshape(-1, 3), normals=normals)
        scene = rz.Scene([mesh], [rz.AmbientLight(0.1), rz.DirectionalLight((-0.3, -0.5, -0.8), 0.8)], camera)
        frames.append(rz.render(scene, (24, 18), shading="phong", outputs=("color", "depth", "face")))
        compare(scene, (24, 18), shading="phong", tolerance=0)
    assert frames[0].stats.clipped > 3 and (frames[0].face >= 0).sum() > 100
    for frame, unit_length in zip(frames[1:], (2.0**-70, 2.0**70), strict=True):
        assert (frame.face == frames[0].face).all() and (frame.color == frames[0].color).all()
        assert (frame.depth == np.float32(unit_length) * frames[0].depth).all()


def test_a_face_with_one_corner_very_far_away_is_not_seen_edge_on():
    """Its determinant is small beside its furthest corner's length, not beside the product of all three."""
    for ratio in (1e6, 1e7, 5e7):
        points = np.array([[-1, -1, -1], [2, -1, -1.5], [0.1 * ratio, 0.6 * ratio, -ratio]])
        mesh = rz.Mesh(np.concatenate([points, points[:1] + (0, 0, 1.5)]), [[0, 1, 2], [1, 3, 2]])
        scene = rz.Scene([mesh], [rz.DirectionalLight((-0.3, -0.5, -0.8))], rz.Camera.perspective((0, 0, 0), (0, 0, -1), near=0.1))
        compare(scene, (24, 18), shading="phong", tolerance=0)
