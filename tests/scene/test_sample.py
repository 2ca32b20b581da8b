"""Samples of scenes: a few faces need the kernels that the whole picture needs."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.small_scenes import cube, draw, drawn, floor, scene_of

import rasterizer as rz
from rasterizer.compiler.kernels import noting_needs
from rasterizer.scene.sample import MOST_FACES, MOST_MESHES, SIZE, SMALL_MAP, sample_mesh, sample_scene


@pytest.mark.parametrize("name", drawn())
def test_a_sample_of_every_kind_of_scene_is_small_and_can_be_drawn(name):
    scene, options = drawn()[name]
    sample = sample_scene(scene)
    assert sum(len(mesh.faces) for mesh in sample.meshes) <= 60 and len(sample.lights) == len(scene.lights)
    assert rz.render(sample, SIZE, threads=1, **options).rgb.shape == (SIZE, SIZE, 3)


NAMES = ("grey, one channel", "transparent", "shadows", "texture, bilinear", "four samples")


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_kernels_that_a_sample_needs_are_nearly_all_of_the_pictures(name):
    """What only the whole scene needs, such as clipping, is met later."""
    scene, options = drawn()[name]
    with noting_needs() as whole:
        draw(name, "phong")
    with noting_needs() as sampled:
        rz.render(
            sample_scene(scene),
            SIZE,
            shading="phong",
            threads=1,
            outputs=("color", "depth", "face", "normal"),
            **options,
        )
    missing = {function.__name__ for function, _ in set(whole) - set(sampled)}
    assert len(missing) <= 0.3 * len(whole), f"{len(missing)} of {len(whole)} are not known ahead: {missing}"


def test_a_mesh_of_many_faces_becomes_a_few_with_an_area():
    rng = np.random.default_rng(3)
    vertices = rng.normal(size=(3000, 3))
    faces = np.arange(3000).reshape(-1, 3)
    faces[:10] = 0  # no area
    mesh = rz.Mesh(vertices, faces, uv=rng.random((3000, 2)), normals=rng.normal(size=(3000, 3)))
    sample = sample_mesh(mesh)
    assert 1 <= len(sample.faces) <= MOST_FACES and len(sample.vertices) <= 3 * MOST_FACES
    corners = sample.vertices[sample.faces[0]]
    assert np.array_equal(corners, vertices[faces[10]])
    assert np.array_equal(sample.uv[sample.faces[0]], mesh.uv[faces[10]])


def test_textures_of_a_sample_are_small_and_as_bright_and_as_clear():
    rng = np.random.default_rng(5)
    images = rng.random((300, 200, 3)) * 3, np.dstack([np.ones((9, 8, 3)), rng.random((9, 8))])
    materials = [rz.Material(texture=rz.Texture(image, "nearest", "mirror")) for image in images] + [rz.Material()]
    mesh = rz.Mesh(
        rng.normal(size=(9, 3)),
        np.arange(9).reshape(3, 3),
        uv=rng.random((9, 2)),
        materials=materials,
        face_material=[0, 1, 2],
    )
    found = sample_mesh(mesh).palette
    assert [material.texture is None for material in found] == [False, False, True]
    for before, after in zip(materials[:2], found[:2], strict=True):
        assert after.texture.image.shape == (1, 2, 4)
        assert after.texture.image[..., :3].max() == before.texture.image[..., :3].max()
        assert after.texture.image[..., 3].min() == before.texture.image[..., 3].min()
        assert (after.texture.filter, after.texture.wrap) == ("nearest", ("mirror", "mirror"))


@pytest.mark.parametrize("scale", [1e-300, 1e-200, 1e-160, 1e-30, 1.0, 1e30, 1e99])
def test_meshes_of_any_size_have_a_sample(scale):
    """An area may be too small or too large for a number."""
    mesh = cube()
    mesh = replace(mesh, vertices=mesh.vertices * scale)
    sample = sample_mesh(mesh)
    assert 1 <= len(sample.faces) <= MOST_FACES


def test_many_meshes_become_a_few_and_maps_small():
    lamp = rz.PointLight((0, 3, 0), shadow=rz.Shadow(size=2048))
    scene = scene_of(*[cube(diffuse=(k / 40, 0.5, 0.5)) for k in range(40)], floor(), lights=[lamp])
    sample = sample_scene(scene)
    assert 1 <= len(sample.meshes) <= MOST_MESHES
    assert [light.shadow.size for light in sample.lights] == [SMALL_MAP]
    assert scene.lights[0].shadow.size == 2048


def test_nothing_of_the_scene_is_changed():
    scene = scene_of(cube(), floor())
    before = [mesh.vertices.tobytes() + mesh.faces.tobytes() for mesh in scene.meshes]
    sample_scene(scene)
    assert [mesh.vertices.tobytes() + mesh.faces.tobytes() for mesh in scene.meshes] == before
