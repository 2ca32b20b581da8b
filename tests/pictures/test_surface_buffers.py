"""Check masks, labels, texture coordinates, barycentric coordinates, positions and normals of the camera's frame
against the reference, and against each other."""

from dataclasses import replace

import numpy as np
from helpers.arrays import differences
from helpers.pinhole import octasphere
from helpers.small_scenes import cube, drawn, floor, scene_of

import rasterizer as rz

SIZE = (60, 44)
LABELS = ("mask", "object", "material")
MEANS = ("uv", "barycentric", "position", "position_camera")
NEW = (*LABELS, *MEANS, "normal_camera")
ALL = ("depth", "face", "normal", *NEW)


def polygons_with_uv() -> rz.Mesh:
    """A hexagon, a concave polygon and a bent quad; texture coordinates of their own at every corner."""
    angles = np.radians(60 * np.arange(6) + 7)
    hexagon = np.stack([np.cos(angles), np.sin(angles), 0.4 * np.cos(angles)], axis=1)
    leaf = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (0, -0.3, 0), (-1, 1, 0)]) + (2.4, 0, -1)
    bent = np.array([(-1, -1, 0), (1, -1, 0.7), (1, 1, 0), (-1, 1, 0.7)]) * 0.8 + (-2.2, 0, -0.5)
    vertices = np.concatenate([hexagon, leaf, bent])
    polygons = [tuple(range(6)), tuple(range(6, 11)), tuple(range(11, 15))]
    mesh = rz.Mesh(vertices, polygons)
    return replace(mesh, uv=np.random.default_rng(3).uniform(-2, 3, (len(vertices), 2)))


def two_palettes() -> rz.Scene:
    """Two meshes, faces of several materials, one of which both meshes have."""
    gold, red = rz.Material.named("gold"), rz.Material(diffuse="red")
    box = cube()
    mixed = replace(box, face_material=np.arange(box.n_face) % 2, materials=(gold, red))
    ball = rz.Mesh(*octasphere(2), material=red).transformed(np.diag((0.8, 0.8, 0.8, 1.0)) + 1.5 * np.eye(4, k=3))
    return scene_of(mixed, ball, floor(diffuse="navy"))


def deep() -> rz.Scene:
    """A floor from 1/1000 to 100 units away."""
    camera = rz.Camera.perspective((0, 0.001, 0), (0, 0, -1), fov=90, near=0.001)
    return rz.Scene(rz.Mesh([(-90, 0, 1), (90, 0, 1), (90, 0, -100), (-90, 0, -100)], [(0, 1, 2, 3)]), camera=camera)


def far_away() -> rz.Scene:
    """A cube a million units from the origin."""
    mesh = cube().transformed(np.eye(4) + np.outer([1e6, -2e6, 3e6, 0], [0, 0, 0, 1]))
    return rz.Scene(mesh, camera=rz.Camera.perspective((1e6 + 2.5, -2e6 + 2, 3e6 + 3.5), (1e6, -2e6, 3e6), fov=50))


def scenes() -> dict[str, rz.Scene]:
    """Name -> scene."""
    small = drawn()
    names = (
        "a file", "many lights", "orthographic", "clipped all round", "small triangles", "a polygon with ears",
        "transparent", "texture, bilinear",
    )  # fmt: skip
    chosen = {name: small[name][0] for name in names}
    front = rz.Camera.perspective((0.5, 0.3, 6), fov=45)
    chosen["polygons"] = scene_of(polygons_with_uv(), camera=front)
    chosen["polygons, clipped"] = scene_of(polygons_with_uv(), camera=replace(front, position=(0, 0.1, 0.5), near=0.2))
    chosen["subpixel"] = scene_of(rz.Mesh(*octasphere(5)), camera=rz.Camera.perspective((0, 1, 9), fov=20))
    return chosen | {"palettes": two_palettes(), "deep": deep(), "far away": far_away()}


SCENES = scenes()


def test_face_and_barycentric_give_everything_else():
    for name in ("a file", "many lights", "palettes", "polygons", "orthographic"):
        scene = SCENES[name]
        frame = rz.render(scene, SIZE, shading="gouraud", outputs=ALL)
        seen, offsets = frame.mask, scene.face_offsets
        assert not differences(seen, frame.face >= 0) and frame.mask.dtype == bool
        assert np.abs(frame.barycentric[seen].sum(axis=1) - 1).max() <= 2.0**-22
        corners = np.concatenate([mesh.vertices[mesh.faces] for mesh in scene.meshes])[frame.face[seen]]
        position = np.einsum("nk,nkx->nx", frame.barycentric[seen].astype(float), corners)
        error = np.abs(position - frame.position[seen]).max()
        assert error <= 2.0**-22 * np.abs(corners).max(), f"{name}: {error:.3g}"
        assert not differences(np.searchsorted(offsets, frame.face[seen], side="right") - 1, frame.object[seen])
        # The weights are those of a point within 1/512 px of the sample; the depth is that of the plane at the sample.
        camera = scene.camera_for(SIZE)
        view, projection, depth = camera.view(), camera.projection(SIZE), frame.depth[seen].astype(float)
        eye = (corners - view.eye) @ np.stack([view.right, view.up, view.forward]).T
        normal = np.cross(eye[:, 1] - eye[:, 0], eye[:, 2] - eye[:, 0])
        slope = np.abs(normal[:, :2] / (projection.scale_x, projection.scale_y)).sum(axis=1)
        if projection.is_perspective:  # 1/depth is n·r / n·P along the ray r
            moved = depth**2 * slope / np.abs((normal * eye[:, 0]).sum(axis=1)) / 512
        else:
            moved = slope / np.abs(normal[:, 2]) / 512
        off = np.abs(-frame.position_camera[..., 2][seen] - depth)
        assert (off <= 1.01 * moved + 2.0**-22 * depth).all(), f"{name}: {(off - moved).max():.3g}"


def test_materials_are_numbered_as_the_scene_lists_them():
    scene = SCENES["palettes"]
    frame = rz.render(scene, SIZE, outputs=("material", "object"))
    assert [material.name for material in scene.materials][:1] == ["gold"] and len(scene.materials) == 3
    assert set(np.unique(frame.material[frame.object == 1])) == {1}  # red is that of the first mesh, too
    assert set(np.unique(frame.material[frame.object == 0])) == {0, 1}
    assert set(np.unique(frame.material[frame.object == 2])) == {2}


def test_an_empty_view_has_empty_buffers():
    scene = replace(SCENES["a file"], camera=rz.Camera.perspective((0, 0, 9), (0, 0, 20)))
    frame = rz.render(scene, 8, outputs=ALL)
    assert not differences(frame.mask, 0) and not differences(frame.object, -1) and not differences(frame.material, -1)
    assert [buffer for buffer in MEANS if not np.isnan(frame.array(buffer)).all()] == []
    assert not differences(frame.normal_camera, 0) and not differences(np.signbit(frame.normal_camera), 0)


def test_culled_faces_are_in_no_buffer():
    scene = scene_of(floor(), camera=rz.Camera.perspective((0, -5, 0.1), (0, 0, 0)))
    assert rz.render(scene, 8, outputs="mask").mask.any()
    assert not differences(rz.render(scene, 8, outputs="mask", cull="back").mask, 0)
