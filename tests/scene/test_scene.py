"""Scenes: what is taken, global face numbers, the camera for a picture."""

import math

import numpy as np
import pytest
from helpers.refusals import assert_refused

from rasterizer.engine.point_lighting import illuminate
from rasterizer.errors import ModelError, SceneError
from rasterizer.scene.camera import Camera
from rasterizer.scene.lights import AmbientLight, AreaLight, PointLight
from rasterizer.scene.material import Material
from rasterizer.scene.mesh import Mesh
from rasterizer.scene.scene import Scene

SQUARE = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
TWO = np.array([(0, 1, 2), (0, 2, 3)])
MESH = Mesh(SQUARE, TWO)


def test_one_or_many_meshes_and_lights():
    pair, lists = (SQUARE, TWO), [SQUARE.tolist(), TWO.tolist()]
    one = {"a mesh": MESH, "a list": [MESH], "a pair": pair, "lists": lists, "a list of a pair": [pair]}
    two = {"meshes": (MESH, MESH), "pairs": [pair, pair], "pairs of lists": [tuple(lists)] * 2}
    two["a generator"] = (mesh for mesh in (MESH, MESH))
    for name, meshes in (one | two).items():
        scene = Scene(meshes)
        assert len(scene.meshes) == 2 if name in two else 1, f"{name}: {len(scene.meshes)} != {2 if name in two else 1}"
        assert all(isinstance(mesh, Mesh) for mesh in scene.meshes), name
    assert len(Scene([MESH, pair, MESH]).meshes) == 3
    lamp = PointLight((0, 0, 0))
    assert Scene(MESH, lamp).lights == (lamp,)
    assert Scene(MESH, [lamp, AmbientLight()]).lights == (lamp, AmbientLight())
    assert Scene(MESH, []).lights == () and "lights: none" in repr(Scene(MESH, []))


def test_camera_is_the_scenes_own_or_framed():
    camera = Camera.perspective((0, 0, 5))
    assert Scene(MESH, camera=camera).camera_for((10, 10)) is camera
    scene = Scene([MESH, (SQUARE + (0, 0, 3), TWO)], up="z")
    points = np.concatenate([SQUARE, SQUARE + (0, 0, 3)])
    framed = scene.camera_for((300, 100))
    expected = Camera.framing(points, up="z", aspect=3.0)
    assert framed.position == pytest.approx(expected.position) and framed.fov == 30.0
    assert scene.camera_for((600, 200)) is framed and scene.framed(3.0) is framed
    assert scene.camera_for((100, 300)) != framed
    assert_refused(scene.camera_for, [((0, 5), "size")], SceneError)
    assert_refused(scene.framed, [(-1.0, "aspect")], SceneError)


def test_illegal_scenes_are_refused():
    cases = [
        ({"meshes": []}, "at least one mesh"),
        ({"meshes": None}, "meshes must be"),
        ({"meshes": 5}, "meshes must be"),
        ({"lights": 5}, "lights must be.*given 5 at 0"),
        ({"lights": [AmbientLight(), "sun"]}, "lights must be.*'sun' at 1"),
        ({"camera": "front"}, "camera"),
        ({"background": "nocolour"}, "background"),
        ({"background": math.nan}, "background"),
        ({"up": "w"}, "up must be one of"),
    ]
    assert_refused(lambda changes: Scene(**({"meshes": MESH} | changes)), cases, SceneError)
    cases = [
        ("cube.obj", "a mesh must be .* take a file .*given 'cube.obj'"),
        ([MESH, None], "a mesh must be"),
        ((SQUARE, TWO + 5), "face 0 refers to vertex"),
    ]
    assert_refused(Scene, cases, ModelError)


def test_scenes_have_a_limited_number_of_lights():
    """A small file may name many area lights of many cells; they take time one by one."""
    area = AreaLight((0, 0, 3), (1, 0, 0), (0, 1, 0), resolution=(64, 64))
    assert len(Scene(MESH, [area] * 4).lights) == 4
    with pytest.raises(SceneError, match="16384 lights at most, .* one by one; given 16385"):
        Scene(MESH, [area] * 4 + [AmbientLight(0.1)])
    with pytest.raises(SceneError, match="16384 lights at most"):
        illuminate((0, 0, 0), (0, 0, 1), Material(), [area] * 5, toward_viewer=(0, 0, 1))
    dark = AreaLight((0, 0, 3), (1, 0, 0), (0, 1, 0), resolution=(64, 64), shadow=True)
    assert len(Scene(MESH, [dark, area]).lights) == 2
    with pytest.raises(SceneError, match="4096 lights that cast shadows at most, .*; given 4097"):
        Scene(MESH, [dark, PointLight((0, 0, 3), shadow=True)])
