"""Samples of scenes: a few faces need the kernels that the whole picture needs."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.campaign_scenes import make_case
from helpers.mixed_scenes import mixed
from helpers.pinhole import octasphere
from helpers.small_scenes import SHADINGS, checks, cube, drawn, floor, scene_of

import rasterizer as rz
from bench.scenes import torus
from rasterizer.compiler.kernels import noting_needs
from rasterizer.geometry import clusters
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


@pytest.mark.parametrize("name", drawn())
def test_a_sample_of_every_kind_of_scene_is_small_and_can_be_drawn(name):
    scene, options = drawn()[name]
    sample = sample_scene(scene)
    assert sum(len(mesh.faces) for mesh in sample.meshes) <= 60 and len(sample.lights) == len(scene.lights)
    assert rz.render(sample, SIZE, threads=1, **{"samples": 1} | options).rgb.shape == (SIZE, SIZE, 3)


# Where rounding takes half of the tolerance, a view decides whether float32 will do: none of these is such a scene.
NAMES = ("grey, one channel", "transparent and textured", "texture, bilinear", "four samples")
CLIPPING = {"search_nearest", "find_crossing", "clip_faces"}  # what the whole scene needs and its sample may not


def needs_of(scene, size, views=None, **options) -> set:
    """The kernels that pictures of a scene need; Python draws them."""
    with noting_needs() as needs, rz.Renderer(scene, size, threads=1, **{"samples": 1} | options) as renderer:
        for view in views or [None]:
            renderer.render(view)
    return set(needs)


def missing(scene, **options) -> set[str]:
    """The names of the kernels that a picture of a scene needs, and its sample doesn't."""
    sample = sample_scene(scene)
    sampled = needs_of(sample, SIZE, sample_views(sample, scene, scene.camera), **options)
    return {function.__name__ for function, _ in needs_of(scene, (24, 18), **options) - sampled}


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("name", NAMES)
def test_the_kernels_that_a_sample_needs_are_those_of_the_picture(name, shading):
    """What only the whole scene needs, such as clipping, is met later."""
    scene, options = drawn()[name]
    assert missing(scene, shading=shading, outputs=("color", "depth", "face", "normal"), **options) <= CLIPPING


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("name", mixed())
def test_materials_that_need_different_things_are_all_seen(name, shading):
    assert missing(mixed()[name], shading=shading) <= CLIPPING


@pytest.mark.parametrize("seed", range(6))
def test_whatever_a_picture_needs_is_listed_before_it_is_drawn(seed):
    """Scenes that nobody has chosen: lights that don't reach the sample, surfaces too thin to be seen, what only a view
    of the whole scene tells, such as that float32 has too few digits for it."""
    for number in range(12):
        case = make_case(seed, number)
        size, options = tuple(max(side // 3, 4) for side in case.size), dict(case.options)
        options["outputs"] = ("color", "depth", "face", "normal") if number % 3 == 0 else ("rgb",)
        if options["samples"] > 1 and number % 2:
            options["antialias"] = "shade-once"
        try:
            needed = needs_of(case.scene, size, **options)
        except rz.SceneError:
            continue
        listed = rz.Renderer(case.scene, size, threads=1, **{"samples": 1} | options)._list_needs(case.scene.camera)
        names = {function.__name__ for function, _ in needed - set(listed)} - CLIPPING
        assert not names, f"{case.words}: {sorted(names)} are compiled when they are met"


def test_lights_and_casters_that_the_sample_does_not_show_are_known():
    """A lamp beside the first faces, a lamp for a mesh that is left out, and a map that looks at some casters only."""
    strip = np.array([[x, y, 0.0] for x in range(40) for y in (0, 1)])
    faces = np.array([[k, k + 1, k + 2] for k in range(78)])
    lamp = rz.PointLight((38.5, 0.5, 1.0), range=2.0)
    spot = rz.SpotLight((20.0, 0.5, 3.0), (0, 0, -1), outer=20, falloff=2.0, range=5.0, shadow=rz.Shadow(2048))
    camera = rz.Camera.perspective((20, 0.5, 30), (20, 0.5, 0))
    scene = rz.Scene(rz.Mesh(strip, faces), [lamp, spot], camera)
    for shading in ("gouraud", "phong"):
        listed = set(rz.Renderer(scene, 24, shading=shading, threads=1, samples=1)._list_needs(camera))
        assert {"point", "shaped_spot", "occlude", "list_seen"} <= {function.__name__ for function, _ in listed}
        before = set(
            rz.Renderer(scene, 24, shading=shading, threads=1, samples=1)._list_needs(camera, is_prepared=False)
        )
        assert {"point", "shaped_spot"} <= {function.__name__ for function, _ in before}


CARRIED = {
    "spot": rz.SpotLight((0.0, 0.5, 0.0), (0, 0, -1), 0.5, outer=20, attached="camera", shadow=rz.Shadow(16)),
    "point": rz.PointLight((0.2, 0.1, -1.4), 0.7, attached="camera", shadow=rz.Shadow(16)),
    "at the eye": rz.PointLight((0.0, 0.0, 0.0), 0.7, attached="camera", shadow=rz.Shadow(16)),
}


@pytest.mark.parametrize("lamp", CARRIED)
@pytest.mark.parametrize("is_prepared", [True, False])
def test_another_view_asks_a_carried_lamp_for_nothing_new(lamp, is_prepared):
    """From near by its shadow map leaves out some casters, from afar none: what chooses them is known before."""
    vertices, faces = octasphere(1)
    scene = scene_of(
        cube(), rz.Mesh(vertices * 0.5 + (0.2, 1.5, 0.3), faces), lights=[rz.AmbientLight(0.1), CARRIED[lamp]]
    )
    views = [None, rz.Camera.perspective((-2.0, 1.6, 3.0), fov=60), rz.Camera.perspective((0, 1.6, 1.0), (0, 1.6, 0))]
    with rz.Renderer(scene, 12, shading="phong", threads=1, samples=1) as renderer:
        listed = {function.__name__ for function, _ in renderer._list_needs(None, is_prepared=is_prepared)}
    needed = [{function.__name__ for function, _ in needs_of(scene, 12, [view], shading="phong")} for view in views]
    choosing = {"compute_outcodes", "list_seen"}
    assert not choosing <= needed[0] and choosing <= set.union(*needed)
    assert set.union(*needed) - listed <= CLIPPING


def test_faces_that_are_too_thin_to_be_seen_become_fatter():
    thin = np.array([[0, 0, 0], [1, 0, 0], [0.3, 2.0**-40, 0], [0, 5, 0], [1, 5, 0], [0, 6, 0]]) * 1e-12
    mesh = rz.Mesh(
        thin, [[0, 1, 2], [3, 4, 5]], materials=[cube().material, cube(opacity=0.5).material], face_material=[0, 1]
    )
    scene = rz.Scene(mesh)
    views = sample_views(sample_scene(scene), scene, None)
    seen = [rz.render(replace(sample_scene(scene), camera=view), SIZE, outputs="face").face.max() for view in views]
    assert len(views) == 3 and min(seen[:2]) >= 0 > seen[2]


@pytest.mark.parametrize("cull", ["none", "back"])
@pytest.mark.parametrize("is_near", [False, True])
def test_what_dense_scenes_skip_triangles_with_is_needed_by_their_samples(monkeypatch, cull, is_near):
    """The whole scene may be a hundred thousand triangles; the sample's few say that there are clusters."""
    monkeypatch.setattr(clusters, "LEAST_FACES", 1)
    camera = rz.Camera.perspective((0.0, 0.3, 0.9)) if is_near else None
    scene = rz.Scene(rz.Mesh(*torus(12, 8)), camera=camera)
    listed = {function.__name__ for function, _ in rz.Renderer(scene, SIZE, cull=cull, samples=1)._list_needs(camera)}
    needed = {function.__name__ for function, _ in needs_of(scene, (24, 18), cull=cull)}
    assert needed - listed <= CLIPPING
    assert ("describe_clusters" in needed) == ("describe_clusters" in listed) == (cull == "back" or is_near)


def test_what_cuts_faces_off_behind_a_camera_is_listed():
    """A camera that stands on a floor: depths are looked for, and the floor is clipped."""
    camera = rz.Camera.perspective((0.1, 0.2, 0.3), (0.5, 0.1, 0.1))
    floor = rz.Mesh([[-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3]], [[0, 1, 2, 3]])
    scene = rz.Scene(floor, camera=camera)
    listed = {function.__name__ for function, _ in rz.Renderer(scene, SIZE, samples=1)._list_needs(camera)}
    needed = {function.__name__ for function, _ in needs_of(scene, (24, 18))}
    assert {"search_nearest", "clip_faces"} <= needed <= listed, needed - listed


def test_faces_are_seen_however_small_they_are_or_wherever_they_look():
    """A face of each kind of material fills a view, front first."""
    small, far = cube(reflection="toon"), cube(reflection="blinn")
    small = replace(small, vertices=1e-4 * small.vertices[:, [1, 0, 2]] + (0, 3, 0))  # inside out
    far = replace(far, vertices=far.vertices * (1, 1, 1e-5) + (50, 0, 0))
    scene = rz.Scene([cube(), small, far])
    sample = sample_scene(scene)
    views, ends = sample_views(sample, scene, None), np.cumsum([0, *(mesh.n_face for mesh in sample.meshes)])
    assert len(views) == 4 and len(sample.meshes) == 3
    with rz.Renderer(sample, SIZE, cull="back", outputs=("face",), threads=1) as renderer:
        faces = [np.unique(renderer.render(view).face).tolist() for view in views[:3]]
    for mesh, found in enumerate(faces):
        assert any(ends[mesh] <= face < ends[mesh + 1] for face in found), f"mesh {mesh}: {found}"


@pytest.mark.parametrize("opacity", [0.5, 1.0])
def test_in_the_last_view_nothing_is_seen(opacity):
    scene = scene_of(cube(opacity=opacity))
    *views, last = sample_views(scene, scene, scene.camera)
    assert len(views) == 1
    assert rz.render(replace(scene, camera=last), SIZE, threads=1, samples=1).alpha.max() == 0.0


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


def test_a_mesh_of_many_materials_keeps_a_face_of_each_kind():
    n = 1000
    looks = [rz.Material(diffuse=0.5 + 0.4 * k / n) for k in range(n)] + [rz.Material(reflection="toon")]
    corners = np.random.default_rng(4).normal(size=(3 * n + 3, 3))
    faces = np.arange(3 * n + 3).reshape(-1, 3)
    mesh = rz.Mesh(corners, faces, materials=looks, face_material=np.arange(n + 1))
    kept = sample_mesh(mesh)
    assert kept.n_face <= MOST_FACES and n in kept.face_material


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
