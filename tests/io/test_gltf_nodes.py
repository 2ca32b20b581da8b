"""Lights and cameras in glTF files: every field, the places that nodes give them, and broken values."""

import math

import numpy as np
import pytest
from helpers.model_bytes import gltf_with
from helpers.refusals import assert_refused

from rasterizer.errors import ModelError
from rasterizer.io.gltf import world_matrices
from rasterizer.io.loader import load
from rasterizer.scene.camera import Camera
from rasterizer.scene.lights import AmbientLight, DirectionalLight, PointLight, SpotLight, studio

QUARTER = math.sqrt(0.5)  # of a turn, as part of a quaternion


def loaded(*nodes, lights=(), cameras=(), **options):
    """A glTF box with more nodes at its root, lights and cameras."""

    def change(tree, _primitive):
        first = len(tree["nodes"])
        tree["nodes"] += nodes
        tree["scenes"][0]["nodes"] += range(first, first + len(nodes))
        tree["extensions"] = {"KHR_lights_punctual": {"lights": list(lights)}}
        tree["extensionsUsed"] = ["KHR_lights_punctual"]
        tree["cameras"] = list(cameras)

    return load(gltf_with(change), format="gltf", **{"camera": "file"} | options)


def light_node(number=0, **place):
    return {"extensions": {"KHR_lights_punctual": {"light": number}}, **place}


def only_light(light, **place):
    (found,) = loaded(light_node(**place), lights=[light]).lights
    return found


def camera_of(lens, **place):
    return loaded({"camera": 0, **place}, cameras=[lens]).camera


# --- lights -------------------------------------------------------------------------------------------------


def test_a_directional_light_shines_down_minus_z_of_its_node():
    assert only_light({"type": "directional"}) == DirectionalLight((0, 0, -1), 1.0)
    # a quarter turn about x takes -z to +y
    shown = {"type": "directional", "color": [1, 0.5, 0.25], "intensity": 4}
    light = only_light(shown, rotation=[QUARTER, 0, 0, QUARTER], translation=[1, 2, 3])
    np.testing.assert_allclose(light.direction, (0, 1, 0), atol=1e-15)
    assert light.color == (4.0, 2.0, 1.0)


def test_point_and_spot_lights_fall_off_with_the_square():
    light = only_light({"type": "point", "intensity": 10, "range": 5}, translation=[1, 2, 3])
    assert light == PointLight((1, 2, 3), 10.0, "1/d^2", amplify=True, range=5.0)
    assert only_light({"type": "point"}).range is None
    cone = {"innerConeAngle": math.pi / 12, "outerConeAngle": math.pi / 6}
    light = only_light({"type": "spot", "spot": cone, "range": 2}, translation=[0, 0, 9])
    assert (light.inner, light.outer) == pytest.approx((15, 30))
    assert light.position == (0, 0, 9) and light.direction == (0, 0, -1)
    assert light.attenuation == (0, 0, 1) and light.amplify and light.range == 2
    default = only_light({"type": "spot"})
    assert isinstance(default, SpotLight) and (default.inner, default.outer) == (0, 45)
    widest = only_light({"type": "spot", "spot": {"outerConeAngle": float(np.float32(math.pi / 2))}})
    assert widest.outer == 90


def test_lights_come_in_the_order_of_nodes_and_replace_the_studio():
    nodes, lights = [light_node(k) for k in (1, 0, 1)], [{"type": "point", "intensity": k} for k in (1, 2)]
    assert [light.color[0] for light in loaded(*nodes, lights=lights).lights] == [2, 1, 2]
    own = [AmbientLight(1)]
    assert loaded(*nodes, lights=lights[:1] * 2).lights != studio() == loaded(lights=lights).lights  # no node holds one

    def change(tree, _primitive):  # a light moves with its parents
        n = len(tree["nodes"])
        tree["nodes"] += [{"translation": [1, 0, 0], "children": [n + 1]}, light_node(translation=[0, 2, 0])]
        tree["scenes"][0]["nodes"].append(n)
        tree["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}

    (light,) = load(gltf_with(change), format="gltf").lights
    assert light.position == (1, 2, 0)
    assert load(gltf_with(change), format="gltf", lights=own).lights == tuple(own), "the caller's own win"


# --- cameras ------------------------------------------------------------------------------------------------

YFOV = {"yfov": math.radians(50), "znear": 0.5, "zfar": 40, "aspectRatio": 2}
PERSPECTIVE = {"type": "perspective", "perspective": YFOV}


def test_cameras_look_down_minus_z_of_their_nodes():
    camera = camera_of(PERSPECTIVE, translation=[0, 1, 8])
    assert camera.is_perspective and camera.fov == pytest.approx(50) and (camera.near, camera.far) == (0.5, 40)
    view = camera.view()
    assert view.eye.tolist() == [0, 1, 8] and view.forward.tolist() == [0, 0, -1] and view.up.tolist() == [0, 1, 0]
    least = camera_of({"type": "perspective", "perspective": {"yfov": 1, "znear": 0.5}})
    assert camera.aspect == 2 and (least.far, least.aspect) == (None, None)
    lens = {"type": "orthographic", "orthographic": {"xmag": 9, "ymag": 1.5, "znear": 0, "zfar": 40}}
    # a quarter turn about z takes +y to -x; the scale of a camera's node doesn't count
    camera = camera_of(lens, rotation=[0, 0, QUARTER, QUARTER], scale=[3, 3, 3], translation=[5, 0, 0])
    assert (camera.height, camera.aspect) == (3, 6) and (camera.near, camera.far) == (0, 40)
    np.testing.assert_allclose(camera.view().up, (-1, 0, 0), atol=1e-15)
    assert camera.view().eye.tolist() == [5, 0, 0]


def test_a_camera_looks_as_far_as_the_middle_of_the_scene():
    """A file gives no target; what turns a camera turns it about that. The box lies about (0, 0, 0)."""
    for place, turn, target in (
        ([0, 1, 8], [0, 0, 0, 1], [0, 1, 0]),
        ([6, 0, 0], [0, QUARTER, 0, QUARTER], [0, 0, 0]),  # looks along -x
        ([0.25, 0, 1000], [0, 0, 0, 1], [0.25, 0, 0]),
    ):
        camera = camera_of(PERSPECTIVE, translation=place, rotation=turn)
        np.testing.assert_allclose(camera.target, target, rtol=0, atol=1e-12 * max(place))
    for place in ([0, 0, -3], [2.0**40, 0, 1]):  # the box is behind the eye; too near for so large a coordinate
        camera = camera_of(PERSPECTIVE, translation=place)
        assert camera.view().forward.tolist() == [0, 0, -1], (
            f"{place}: {camera.view().forward.tolist()} != {[0, 0, -1]}"
        )
        assert camera.target[2] < place[2], place


def test_the_first_camera_counts_and_the_callers_own_wins():
    other = {"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}
    nodes, cameras = ({"camera": 1, "translation": [0, 0, 5]}, {"camera": 0}), [PERSPECTIVE, other]
    facts, own = [], Camera.perspective((1, 1, 1))
    assert loaded(*nodes, cameras=cameras, log=facts.append).camera.fov == pytest.approx(math.degrees(1))
    assert "a camera" in facts[-1] and loaded(*nodes, cameras=cameras, camera=own).camera is own

    def change(tree, _primitive):  # what hangs on a camera is still drawn
        tree["cameras"] = [PERSPECTIVE]
        tree["nodes"].append({"camera": 0, "children": tree["scenes"][0]["nodes"], "translation": [10, 0, 0]})
        tree["scenes"][0]["nodes"] = [len(tree["nodes"]) - 1]

    scene = load(gltf_with(change), format="gltf", camera="file")
    np.testing.assert_allclose(scene.bounds[:, 0], (9.5, 10.5))
    assert scene.camera.position == (10, 0, 0)
    assert load(gltf_with(change), format="gltf").camera is None, "the picture is framed unless it is asked for"


# --- nodes --------------------------------------------------------------------------------------------------


def test_matrices_of_nodes_multiply_down_the_tree():
    matrix = [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 7, 8, 9, 1]  # column by column: x to y, y to -x
    nodes = [
        {"children": [1], "matrix": matrix},
        {"translation": [1, 0, 0], "scale": [2, 3, 4], "rotation": [0, 0, 1, 0]},
        {"translation": [5, 5, 5]},
    ]
    found = world_matrices(None, {"nodes": nodes, "scenes": [{"nodes": [2]}, {"nodes": [0]}], "scene": 1})
    assert sorted(found) == [0, 1]
    # the point (1, 1, 1): scaled (2, 3, 4), half a turn about z (-2, -3, 4), moved (-1, -3, 4), then the parent's
    np.testing.assert_allclose(found[1] @ (1, 1, 1, 1), (7 + 3, 8 - 1, 9 + 4, 1), atol=1e-14)
    turned = world_matrices(None, {"nodes": [{"rotation": [0.5, 0.5, 0.5, 0.5]}]})[0]  # a third about (1, 1, 1)
    np.testing.assert_allclose(turned @ (1, 2, 3, 1), (3, 1, 2, 1), atol=1e-14)
    assert world_matrices(None, {"nodes": nodes[:2], "scenes": [{}]}) == {}
    assert sorted(world_matrices(None, {"nodes": nodes})) == [0, 1, 2]  # without scenes: all, each below its parent
    np.testing.assert_array_equal(world_matrices(None, {"nodes": nodes})[1], found[1])
    assert world_matrices(None, {}) == {}


# --- faults -------------------------------------------------------------------------------------------------


def test_broken_lights_are_named():
    assert_refused(only_light, [
        ({"type": "point", "intensity": -1}, "light 0: the point light's color must not be negative"),
        ({"type": "point", "range": 0, "name": "lamp"}, "light 0 'lamp': the point light's range must be above 0"),
        ({"type": "spot", "spot": {"outerConeAngle": 2}}, "outer angle must be above 0 and at most 90"),
        ({"type": "area"}, "light 0: its type must be directional, point or spot; given 'area'"),
        ({"type": "point", "color": "red"}, "light 0: "),
    ], ModelError, "model: ")  # fmt: skip


def test_broken_cameras_are_named():
    def perspective(**lens):
        return {"type": "perspective", "perspective": lens}

    assert_refused(camera_of, [
        (perspective(yfov=0, znear=1), "camera 0: the camera's fov must be at least"),
        (perspective(yfov=1, znear=2, zfar=1), "near must be below its far"),
        (perspective(znear=1), "camera 0: yfov is missing"),
        ({"type": "orthographic", "orthographic": {"ymag": 0, "znear": 0, "zfar": 1}}, "height must be above 0"),
        ({"type": "fisheye", "name": "eye"}, "'eye': its type must be perspective or orthographic; given 'fisheye'"),
    ], ModelError, "model: ")  # fmt: skip


def test_what_nodes_and_meshes_refer_to_in_vain_is_left_out_with_a_warning():
    for node, noun in (
        ({"mesh": 9}, "mesh"), ({"mesh": True}, "mesh"), ({"children": [-1]}, "node"), (light_node(3), "light"),
        ({"camera": 0}, "camera"), ({"mesh": 0, "skin": 2}, "skin"),
    ):  # fmt: skip
        with pytest.warns(UserWarning, match=f"1 {noun} that isn't there: left out"):
            assert loaded(node).meshes
    for change, noun in (
        (lambda tree, _: tree.update(scene=7), "scene"),
        (lambda _, primitive: primitive["attributes"].update(COLOR_0=99), "array of a mesh"),
    ):
        with pytest.warns(UserWarning, match=f"1 {noun} that isn't there: left out"):
            assert load(gltf_with(change), format="gltf").meshes


def test_what_stands_in_a_node_of_scale_0_is_left_out_with_a_warning():
    for node, parts in (
        ({"camera": 0}, {"cameras": [{"type": "orthographic", "orthographic": {"ymag": 1, "znear": 0, "zfar": 1}}]}),
        (light_node(), {"lights": [{"type": "directional"}]}),
    ):
        with pytest.warns(UserWarning, match="1 node of scale 0: left out"):
            scene = loaded(node | {"scale": [0, 0, 0]}, camera="file", **parts)
        assert scene.camera is None and len(scene.lights) == len(studio())


def test_a_joint_may_be_an_empty_node():
    def skin(tree, _):
        tree["nodes"] = [{"mesh": 0, "skin": 0}, {}]
        tree["scenes"], tree["skins"] = [{"nodes": [0, 1]}], [{"joints": [1]}]

    assert load(gltf_with(skin), format="gltf").n_face == 12


def test_compression_beside_plain_arrays_is_no_fault_and_alone_is_named(recwarn):
    def compressed(tree, primitive):
        tree["extensionsUsed"] = ["KHR_draco_mesh_compression"]
        primitive["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}}

    def alone(tree, primitive):
        compressed(tree, primitive)
        del tree["accessors"][primitive["attributes"]["POSITION"]]["bufferView"]

    assert load(gltf_with(compressed), format="gltf").n_face == 12 and not recwarn.list
    with pytest.raises(ModelError, match="compressed with KHR_draco_mesh_compression"):
        load(gltf_with(alone), format="gltf")
