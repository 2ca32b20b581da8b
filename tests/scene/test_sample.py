"""Samples of scenes: a few faces need the kernels that the whole picture needs."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.mixed_scenes import mixed
from helpers.small_scenes import checks, cube, drawn, floor, scene_of

import rasterizer as rz
from rasterizer.compiler.kernels import noting_needs
from rasterizer.scene.sample import (
    MOST_FACES,
    MOST_MESHES,
    SIZE,
    SMALL_MAP,
    kind_of,
    sample_mesh,
    sample_scene,
    sample_views,
)

CLIPPING = {"search_nearest", "find_crossing", "clip_faces"}  # what the whole scene needs and its sample may not


def needs_of(scene, size, views=(None,), **options) -> set:
    """The kernels that pictures of a scene need; Python draws them."""
    with noting_needs() as needs, rz.Renderer(scene, size, threads=1, **{"samples": 1} | options) as renderer:
        for view in views:
            renderer.render(view)
    return set(needs)


def missing(scene, **options) -> set[str]:
    """The names of the kernels that a picture of a scene needs, and its sample doesn't."""
    sample = sample_scene(scene)
    sampled = needs_of(sample, SIZE, sample_views(sample, scene, scene.camera), **options)
    return {function.__name__ for function, _ in needs_of(scene, (12, 9), **options) - sampled} - CLIPPING


MIXED = ("a textured speck", "textured, and glass", "three models")


@pytest.mark.parametrize(("name", "shading"), list(zip(MIXED, ("flat", "gouraud", "phong"), strict=True)))
def test_materials_that_need_different_things_are_all_seen(name, shading):
    assert not missing(mixed()[name], shading=shading)


@pytest.mark.nightly
@pytest.mark.parametrize("shading", ["flat", "gouraud", "phong"])
def test_the_kernels_that_samples_need_are_those_of_the_pictures(shading):
    for name, scene in mixed().items():
        assert not missing(scene, shading=shading), name
    # Where rounding takes half of the tolerance, a view decides whether float32 will do: none of these is such a scene.
    for name in ("grey, one channel", "transparent and textured", "texture, bilinear", "four samples"):
        scene, options = drawn()[name]
        assert not missing(scene, shading=shading, outputs=("color", "depth", "face", "normal"), **options), name


def test_faces_are_seen_however_thin_or_small_they_are_or_wherever_they_look():
    """A face of each kind of material fills a view, front first; in the last view nothing is seen."""
    small, far = cube(reflection="toon"), cube(reflection="blinn", opacity=0.5)
    small = replace(small, vertices=1e-4 * small.vertices[:, [1, 0, 2]] + (0, 3, 0))  # inside out
    far = replace(far, vertices=far.vertices * (1, 1, 1e-5) + (50, 0, 0))
    thin = rz.Mesh(np.array([[0, 0, 0], [1, 0, 0], [0.3, 2.0**-40, 0]]) * 1e-6, [[0, 1, 2]])
    thin = replace(thin, material=rz.Material(diffuse=100.0))
    scene = rz.Scene([cube(), small, far, thin])
    sample = sample_scene(scene)
    views, ends = sample_views(sample, scene, None), np.cumsum([0, *(mesh.n_face for mesh in sample.meshes)])
    assert len(views) == 5 and len(sample.meshes) == 4
    with rz.Renderer(sample, SIZE, cull="back", outputs=("face",), threads=1) as renderer:
        *faces, nothing = [np.unique(renderer.render(view).face).tolist() for view in views]
    for mesh, found in enumerate(faces):
        assert any(ends[mesh] <= face < ends[mesh + 1] for face in found), f"mesh {mesh}: {found}"
    assert nothing == [-1]


def test_what_cuts_faces_off_behind_a_camera_is_needed_by_a_sample():
    camera = rz.Camera.perspective((0.1, 0.2, 0.3), (0.5, 0.1, 0.1))  # stands on a floor
    scene = rz.Scene(rz.Mesh([[-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3]], [[0, 1, 2, 3]]), camera=camera)
    sample = sample_scene(scene)
    sampled = needs_of(sample, SIZE, sample_views(sample, scene, camera))
    assert {"search_nearest", "clip_faces"} <= {function.__name__ for function, _ in sampled}


def test_kinds_of_materials_are_told_apart_by_what_is_computed_not_by_colours():
    plain = rz.Material(diffuse=0.5)
    same = rz.Material(diffuse=(0.6, 0.5, 0.7)), rz.Material(diffuse=0.5, name="other"), rz.Material(shininess=40)
    others = (
        rz.Material(opacity=0.5), rz.Material(opacity=0.0), rz.Material(texture=checks()), rz.Material(shininess=1e4),
        rz.Material(reflection="toon"), rz.Material(diffuse=100.0), rz.Material(fresnel=0.1),
        rz.Material(fresnel=(0.1, 0.5, 0.9)), rz.Material(specular=0.0),
    )  # fmt: skip
    assert {kind_of(material) for material in same} == {kind_of(plain)}
    assert len({kind_of(material) for material in (plain, *others)}) == len(others) + 1


def test_a_mesh_of_many_faces_becomes_a_few_with_an_area_of_each_kind_of_material():
    n = 1000
    looks = [rz.Material(diffuse=0.5 + 0.4 * k / n) for k in range(n - 1)] + [rz.Material(reflection="toon")]
    rng = np.random.default_rng(3)
    vertices, faces = rng.normal(size=(3 * n, 3)), np.arange(3 * n).reshape(-1, 3)
    faces[:10] = 0  # no area
    given = {"uv": rng.random((3 * n, 2)), "normals": rng.normal(size=(3 * n, 3))}
    mesh = rz.Mesh(vertices, faces, materials=looks, face_material=np.arange(n), **given)
    kept = sample_mesh(mesh)
    assert 1 <= kept.n_face <= MOST_FACES and n - 1 in kept.face_material
    assert not differences(kept.vertices[kept.faces[0]], vertices[faces[10]])
    assert not differences(kept.uv[kept.faces[0]], mesh.uv[faces[10]])
    for scale in (1e-300, 1e-160, 1e99):  # an area may be too small or too large for a number
        small = replace(cube(), vertices=cube().vertices * scale)
        assert 1 <= sample_mesh(small).n_face <= MOST_FACES, scale


def test_textures_of_a_sample_are_small_and_as_bright_and_as_clear():
    rng = np.random.default_rng(5)
    images = rng.random((30, 20, 3)) * 3, np.dstack([np.ones((9, 8, 3)), rng.random((9, 8))])
    looks = [rz.Material(texture=rz.Texture(image, "nearest", "mirror")) for image in images] + [rz.Material()]
    given = {"uv": rng.random((9, 2)), "materials": looks, "face_material": [0, 1, 2]}
    found = sample_mesh(rz.Mesh(rng.normal(size=(9, 3)), np.arange(9).reshape(3, 3), **given)).palette
    assert [material.texture is None for material in found] == [False, False, True]
    for before, after in zip(looks[:2], found[:2], strict=True):
        assert after.texture.image.shape == (1, 2, 4)
        assert after.texture.image[..., :3].max() == before.texture.image[..., :3].max()
        assert after.texture.image[..., 3].min() == before.texture.image[..., 3].min()
        assert (after.texture.filter, after.texture.wrap) == ("nearest", ("mirror", "mirror"))


def test_many_meshes_become_a_few_and_maps_small():
    lamp = rz.PointLight((0, 3, 0), shadow=rz.Shadow(size=2048))
    scene = scene_of(*[cube(diffuse=(k / 40, 0.5, 0.5)) for k in range(40)], floor(), lights=[lamp])
    sample = sample_scene(scene)
    assert 1 <= len(sample.meshes) <= MOST_MESHES
    assert [light.shadow.size for light in sample.lights] == [SMALL_MAP] and scene.lights[0].shadow.size == 2048
