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


def two_palettes() -> rz.Scene:
    """Two meshes, faces of several materials, one of which both meshes have."""
    gold, red = rz.Material.named("gold"), rz.Material(diffuse="red")
    box = cube()
    mixed = replace(box, face_material=np.arange(box.n_face) % 2, materials=(gold, red))
    ball = rz.Mesh(*octasphere(2), material=red).transformed(np.diag((0.8, 0.8, 0.8, 1.0)) + 1.5 * np.eye(4, k=3))
    return scene_of(mixed, ball, floor(diffuse="navy"))


def test_materials_are_numbered_as_the_scene_lists_them():
    scene = two_palettes()
    frame = rz.render(scene, SIZE, outputs=("material", "object"))
    assert [material.name for material in scene.materials][:1] == ["gold"] and len(scene.materials) == 3
    assert set(np.unique(frame.material[frame.object == 1])) == {1}  # red is that of the first mesh, too
    assert set(np.unique(frame.material[frame.object == 0])) == {0, 1}
    assert set(np.unique(frame.material[frame.object == 2])) == {2}


def test_an_empty_view_has_empty_buffers():
    scene = replace(drawn()["a file"][0], camera=rz.Camera.perspective((0, 0, 9), (0, 0, 20)))
    frame = rz.render(scene, 8, outputs=ALL)
    assert not differences(frame.mask, 0) and not differences(frame.object, -1) and not differences(frame.material, -1)
    assert [buffer for buffer in MEANS if not np.isnan(frame.array(buffer)).all()] == []
    assert not differences(frame.normal_camera, 0) and not differences(np.signbit(frame.normal_camera), 0)


def test_culled_faces_are_in_no_buffer():
    scene = scene_of(floor(), camera=rz.Camera.perspective((0, -5, 0.1), (0, 0, 0)))
    assert rz.render(scene, 8, outputs="mask").mask.any()
    assert not differences(rz.render(scene, 8, outputs="mask", cull="back").mask, 0)
