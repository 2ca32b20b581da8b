"""Check how the reference puts layers that let light through on each other: panes by hand, in any order of the file."""

import numpy as np
import pytest
from helpers.arrays import deviations, differences
from helpers.pinhole import QUAD, eye_camera, layer, sheet_camera

from rasterizer.reference import render
from rasterizer.scene.lights import AmbientLight
from rasterizer.scene.material import Material
from rasterizer.scene.mesh import Mesh
from rasterizer.scene.scene import Scene
from rasterizer.scene.texture import Texture

SIZE = (8, 8)
RED, GREEN, BLUE = np.eye(3)


def pane(color, opacity, depth, is_perspective=True, **options):
    """A sheet across the picture that shines by itself."""
    material = Material(diffuse=0.0, specular=0.0, emissive=color, opacity=opacity, **options)
    return Mesh(np.array(layer(SIZE, depth, is_perspective)), QUAD, material=material, uv=np.zeros((4, 2)))


def show(meshes, shading="gouraud", background=None, camera=None, **options):
    scene = Scene(meshes, lights=AmbientLight(), camera=camera or eye_camera(), background=background)
    return render(scene, SIZE, shading=shading, **options)


@pytest.mark.parametrize("shading, is_perspective", [("flat", True), ("gouraud", False), ("phong", True)])
def test_two_panes_in_both_orders_of_the_file(shading, is_perspective):
    camera = None if is_perspective else sheet_camera(SIZE[1])
    front, behind = pane(RED, 0.25, 2.0, is_perspective), pane(GREEN, 0.5, 3.0, is_perspective)
    for meshes, front_faces in (((front, behind), {0, 1}), ((behind, front), {2, 3})):
        picture = show(meshes, shading, camera=camera)
        # premultiplied 0.25 red and 0.75·0.5 green; 1 - 0.75·0.5 is covered
        np.testing.assert_allclose(picture.alpha, 0.625, rtol=1e-15)
        np.testing.assert_allclose(picture.color, np.broadcast_to((0.4, 0.6, 0.0), (8, 8, 3)), atol=1e-15)
        assert set(np.unique(picture.face)) == front_faces
        np.testing.assert_allclose(picture.depth, 2.0, rtol=1e-14)
        assert not deviations(picture.normal, (0, 0, 1))
        over = show(meshes, shading, "#0000ff", camera=camera)
        np.testing.assert_allclose(over.color, np.broadcast_to((0.25, 0.375, 0.375), (8, 8, 3)), atol=1e-15)
        assert not differences(over.alpha, 1)


def test_of_equally_deep_layers_the_lower_face_is_nearer():
    for meshes, expected in (
        ((pane(RED, 0.5, 2.0), pane(GREEN, 0.5, 2.0)), (2 / 3, 1 / 3, 0)),
        ((pane(GREEN, 0.5, 2.0), pane(RED, 0.5, 2.0)), (1 / 3, 2 / 3, 0)),
        ((pane(GREEN, 1.0, 2.0), pane(RED, 0.5, 2.0)), (0, 1, 0)),
        ((pane(RED, 0.5, 2.0), pane(GREEN, 1.0, 2.0)), (0.5, 0.5, 0)),
    ):
        picture = show(meshes)
        np.testing.assert_allclose(picture.color, np.broadcast_to(expected, (8, 8, 3)), atol=1e-14)
        assert picture.face.max() < 2 and not differences(picture.margin, 0)


def test_texture_and_opacity_multiply():
    image = np.array([[[0.2, 0.4, 0.6, 0.5]]], np.float32)
    texture = Texture(image, "nearest")
    material = Material(ambient=1.0, diffuse=0.0, specular=0.0, opacity=0.5, texture=texture)
    mesh = Mesh(np.array(layer(SIZE, 2.0)), QUAD, material=material, uv=np.zeros((4, 2)))
    picture = show([mesh])
    np.testing.assert_allclose(picture.alpha, 0.25, rtol=1e-15)
    np.testing.assert_allclose(picture.color, np.broadcast_to(image[0, 0, :3], (8, 8, 3)), rtol=1e-7)


def test_what_is_clear_is_not_there_but_in_the_buffers():
    clear = pane(RED, 0.0, 2.0)
    picture = show([clear])
    assert not differences(picture.alpha, 0) and not differences(picture.color, 0) and not differences(picture.rgb, 0)
    assert picture.face.min() >= 0 and not deviations(picture.depth, 2.0)
    both = show([clear, pane(GREEN, 1.0, 3.0)])
    assert not differences(both.color, tuple(GREEN)) and not differences(both.alpha, 1) and both.face.max() < 2
