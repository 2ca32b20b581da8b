"""glTF files without their materials: accessors, what numbers they hold, and numbers that lead out of a buffer;
triangles in lists, strips and fans; nodes, lights and cameras; skins and morph targets; what is broken or left out."""

import json
import math

import numpy as np
import pytest
import trimesh
from helpers.gltf import add_array, add_view, file_of, picture_uri, uri
from helpers.model_bytes import GLB, gltf_with
from helpers.refusals import assert_refused

from rasterizer.errors import ModelError
from rasterizer.io.gltf import world_matrices
from rasterizer.io.loader import load
from rasterizer.io.model_file import most
from rasterizer.scene.camera import Camera
from rasterizer.scene.lights import AmbientLight, DirectionalLight, PointLight, SpotLight, studio

# --- accessors ----------------------------------------------------------------------------------------------


def only_mesh(change):
    (mesh,) = load(gltf_with(change), format="gltf", crease_angle=None).meshes
    return mesh


def positions(change):
    """The vertices of a glTF box whose accessor of positions has been changed."""

    def with_accessor(tree, primitive):
        change(tree, tree["accessors"][primitive["attributes"]["POSITION"]])

    return np.asarray(only_mesh(with_accessor).vertices)


def of_accessor(**fields):
    return lambda tree, _: tree["accessors"][1].update(fields)


def sparse(places, rows, dtype=np.uint8, component=5121, **more):
    def change(tree, accessor):
        accessor["sparse"] = {
            "count": len(places),
            "indices": {"bufferView": add_view(tree, np.array(places, dtype)), "componentType": component},
            "values": {"bufferView": add_view(tree, np.array(rows, np.float32))},
        } | more

    return change


def test_a_sparse_accessor_replaces_rows():
    before = positions(lambda tree, accessor: None)
    expected = before.copy()
    expected[[1, 4]] = [[9, 8, 7], [6, 5, 4]]
    for dtype, component in ((np.uint8, 5121), (np.uint16, 5123), (np.uint32, 5125)):
        after = positions(sparse([1, 4], [[9, 8, 7], [6, 5, 4]], dtype, component))
        assert {tuple(row) for row in after} == {tuple(row) for row in expected}, dtype  # those at one place are one

    def without_view(tree, accessor):
        n = accessor["count"]
        del accessor["bufferView"]
        sparse(range(n), np.arange(3.0 * n).reshape(n, 3) ** 1.5)(tree, accessor)

    assert len(positions(without_view)) == 8
    assert sorted(map(tuple, positions(sparse([0], [[1, 1, 1]])))) != sorted(map(tuple, before))


def test_views_have_offsets_and_strides():
    rows = np.arange(48, dtype=np.float32).reshape(8, 6) ** 1.5

    def change(tree, accessor):
        padded = np.concatenate([np.zeros(4, np.float32), rows.ravel()])
        view = add_view(tree, padded, byteStride=24, byteOffset=16, byteLength=rows.nbytes)
        accessor.update(bufferView=view, byteOffset=12)

    assert {tuple(row) for row in positions(change)} == {tuple(row) for row in rows[:, 3:].astype(float)}


def test_fractions_of_integers_are_taken_where_they_are_meant():
    rows = np.array([[0, 1, 2], [255, 0, 5], [51, 255, 0], [102, 102, 255]] * 2, np.uint8)
    for dtype, is_fraction, scale in ((np.uint8, True, 255), (np.uint8, False, 1), (np.int8, True, 127)):
        given = np.zeros((8, 4), dtype)  # rows begin at multiples of four bytes
        given[:, :3] = -(rows // 2).astype(np.int8) if dtype == np.int8 else rows

        def change(tree, accessor, given=given, is_fraction=is_fraction):
            view = add_view(tree, given, byteStride=4)
            component = 5121 if given.dtype == np.uint8 else 5120
            accessor.update(bufferView=view, byteOffset=0, componentType=component, normalized=is_fraction)

        found = {tuple(np.round(row, 6)) for row in positions(change)}
        assert found == {tuple(np.round(row[:3] / scale, 6)) for row in given.astype(float)}, (dtype, is_fraction)


def test_colors_are_linear():
    for dtype, scale in (("<f4", 1), ("<u2", 65535), ("u1", 255)):
        colors = (np.arange(32).reshape(8, 4) / 31 * scale).astype(dtype)

        def change(tree, primitive, colors=colors, scale=scale):
            primitive["attributes"]["COLOR_0"] = add_array(tree, colors, normalized=scale > 1)

        mesh = only_mesh(change)
        np.testing.assert_allclose(mesh.colors, colors / scale, atol=1e-7, err_msg=str(dtype))
        assert mesh.material.diffuse == (1.0, 1.0, 1.0)


def test_triangles_come_in_lists_strips_and_fans():
    """Every other triangle of a strip is turned round."""
    for mode, expected in (
        (4, [[0, 1, 2], [3, 4, 5]]),
        (5, [[0, 1, 2], [3, 2, 1], [2, 3, 4], [5, 4, 3]]),
        (6, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]),
    ):

        def change(tree, primitive, mode=mode):
            places = np.array([(k, k * k, k**3) for k in range(6)], np.float32)
            primitive["attributes"] = {"POSITION": add_array(tree, places)}
            del primitive["indices"]
            primitive["mode"] = mode

        mesh = only_mesh(change)
        found = mesh.vertices[mesh.faces][..., 0].astype(int).tolist()
        assert [sorted(face) for face in found] == [sorted(face) for face in expected], f"mode {mode}: {found}"
        turns = [[found[k].index(corner) for corner in face] for k, face in enumerate(expected)]
        assert all(turn in ([0, 1, 2], [1, 2, 0], [2, 0, 1]) for turn in turns), f"mode {mode}: {found}"


def test_primitives_without_positions_and_corners_too_many_are_left_out():
    def change(tree, primitive):
        tree["meshes"][0]["primitives"].append({"attributes": {}})
        tree["accessors"][primitive["indices"]]["count"] -= 1
        tree["accessors"].append({"componentType": 5126, "count": 10**12, "type": "VEC3"})  # that nobody uses

    assert only_mesh(change).n_face == 11


def test_rows_that_no_buffer_holds_are_limited_together():
    def made(*counts):
        def change(tree, primitive):
            for name, count in zip(("POSITION", "NORMAL"), counts, strict=True):
                tree["accessors"].append({"componentType": 5126, "count": count, "type": "VEC3"})
                primitive["attributes"][name] = len(tree["accessors"]) - 1

        return only_mesh(change)

    limit = f"asks for .* bytes of arrays: .* {most(0)} are legal"
    cases = [((9, 0), "0 rows"), ((9, most(0) // 12), limit), ((9, 9), "every face has zero area")]
    assert_refused(lambda counts: made(*counts), cases, ModelError, "model: ")


def test_what_a_file_needs_and_is_not_read_is_warned_of():
    names = ["KHR_texture_transform", "EXT_mesh_gpu_instancing", "KHR_materials_unlit", "FOO_bar"]
    data = gltf_with(lambda tree, primitive: tree.update(extensionsRequired=names, extensionsUsed=names))
    with pytest.warns(UserWarning, match="the file needs EXT_mesh_gpu_instancing, FOO_bar, which is not read"):
        assert load(data, format="gltf").n_face == 12


# --- nodes that bring lights and cameras --------------------------------------------------------------------

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


def perspective(**lens):
    return {"type": "perspective", "perspective": lens}


PERSPECTIVE = perspective(yfov=math.radians(50), znear=0.5, zfar=40, aspectRatio=2)


def test_cameras_look_down_minus_z_of_their_nodes():
    camera = camera_of(PERSPECTIVE, translation=[0, 1, 8])
    assert camera.is_perspective and camera.fov == pytest.approx(50) and (camera.near, camera.far) == (0.5, 40)
    view = camera.view()
    assert view.eye.tolist() == [0, 1, 8] and view.forward.tolist() == [0, 0, -1] and view.up.tolist() == [0, 1, 0]
    least = camera_of(perspective(yfov=1, znear=0.5))
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
    other = perspective(yfov=1, znear=1)
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


BROKEN = [  # what makes a model, and what it is made of
    (lambda change: load(gltf_with(change), format="gltf"), [
        (lambda tree, _: tree["accessors"][1].pop("bufferView"), "every face has zero area"),
        (of_accessor(type="VEC6"), "type must be one of SCALAR, .*; given VEC6"),
        (of_accessor(sparse={"count": 1}), "not a readable"),
        (of_accessor(count=10**9), "not a readable"),
        (lambda tree, _: tree["asset"].update(version="1.0"), r"glTF of version 1\.0; 2\.0 is read"),
        (lambda tree, _: tree.update(extensionsRequired=["KHR_draco_mesh_compression"]), "KHR_draco"),
        (lambda tree, _: tree["nodes"][0].update(matrix=[0] * 16), "scale 0"),
        (lambda _, primitive: primitive["attributes"].pop("POSITION"), "no faces"),
        (lambda tree, _: tree.update(meshes=3), "not a readable"),
        (lambda tree, _: tree.update(meshes=[]), "no faces"),
        (lambda _, primitive: primitive.update(mode=0), "a point cloud: 36 points, no faces"),
        (lambda _, primitive: primitive.update(mode=1), "nothing but lines: 18 lines, no faces"),
        (lambda _, primitive: primitive.update(mode=3), "nothing but lines: 35 lines, no faces"),
    ]),
    (positions, [
        (sparse([1, 99], [[0, 0, 0]] * 2), "indices of accessor . must be whole numbers below 8"),
        (sparse([1], [[0, 0, 0]], np.float32, 5126), "indices of accessor . must be whole numbers below 8"),
        (sparse([1], [[0, 0, 0]], component=5120, dtype=np.int8), "must be whole numbers below 8"),
        (sparse([1, 2], [[0, 0, 0]]), "the values of accessor . of 2 rows ends at byte 24 of 12"),
        (sparse([1], [[0, 0, 0]], count=0), "not a readable"),
        (sparse([1], [[0, 0, 0]], count=10**12), "ends at byte"),
        (sparse([1], [[0, 0, 0]], values=3), "not a readable"),
        (lambda tree, accessor: accessor.update(componentType=7), "componentType must be one of 5120, .*; given 7"),
        (lambda tree, accessor: accessor.update(type=[1]), "not a readable"),
    ]),
    (lambda data: load(data, format="glb"), [
        (data, "not a readable GLB file|not a GLB file")
        for data in (GLB[:-10], GLB[:15], GLB[:4] + b"\1" + GLB[5:], b"x" + GLB[1:])
    ]),
]  # fmt: skip


def test_what_is_broken_is_named():
    for make, cases in BROKEN:
        assert_refused(make, cases, ModelError, "model: ")


# Lights and cameras that are not legal cost no model.
ILLEGAL = {
    "lights": [
        (5, "light 0: "),
        ({"type": "spot", "spot": 5}, "light 0: "),
        ({"type": "point", "intensity": -1}, "light 0: the point light's color must not be negative"),
        ({"type": "point", "range": 0, "name": "lamp"}, "light 0 'lamp': the point light's range must be above 0"),
        ({"type": "spot", "spot": {"outerConeAngle": 2}}, "outer angle must be above 0 and at most 90"),
        ({"type": "area"}, "light 0: its type must be directional, point or spot; given 'area'"),
        ({"type": "point", "color": "red"}, "light 0: "),
    ],
    "cameras": [
        ("a", "camera 0: "),
        (perspective(yfov=0, znear=1), "camera 0: the camera's fov must be at least"),
        (perspective(yfov=1, znear=2, zfar=1), "near must be below its far"),
        (perspective(znear=1), "camera 0: yfov is missing"),
        ({"type": "orthographic", "orthographic": {"ymag": 0, "znear": 0, "zfar": 1}}, "height must be above 0"),
        ({"type": "fisheye", "name": "eye"}, "'eye': its type must be perspective or orthographic; given 'fisheye'"),
    ],
}  # fmt: skip


@pytest.mark.parametrize("kind", ILLEGAL)
def test_lights_and_cameras_that_are_not_legal_are_left_out_with_a_warning(kind):
    for item, said in ILLEGAL[kind]:
        node = light_node() if kind == "lights" else {"camera": 0}
        with pytest.warns(UserWarning, match=said) as warned:
            scene = loaded(node, node, **{kind: [item]})
        assert len(warned) == 1
        assert scene.camera is None and len(scene.lights) == len(studio()) and scene.n_face == 12


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


# --- skins and morph targets --------------------------------------------------------------------------------

POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 2, 0.5]], "<f4")
FACES = np.array([0, 1, 2, 1, 3, 2], "<u2")


def skinned(random, weights, n_joint=3, **tree):
    """A skinned file, and where its vertices and normals are: sum of weights · joint · inverse bind matrix."""
    places = [trimesh.transformations.random_rotation_matrix(random.random(3)) for _ in range(n_joint)]
    binds = [trimesh.transformations.random_rotation_matrix(random.random(3)) for _ in range(n_joint)]
    for matrix in (*places, *binds):
        matrix[:3, 3] = random.normal(size=3)
    joints = random.integers(0, n_joint, (4, 4))
    arrays = [POINTS, FACES, np.float32(POINTS[:, ::-1] + 1), joints.astype("<u2"), weights,
              np.float32([matrix.T.ravel() for matrix in binds])]  # fmt: skip
    attributes = {"POSITION": 0, "NORMAL": 2, "JOINTS_0": 3, "WEIGHTS_0": 4}
    nodes = [{"matrix": matrix.T.ravel().tolist()} for matrix in places]
    # The place of the node that shows it doesn't count; the joints' parent moves them all.
    nodes += [{"children": [*range(n_joint)], "translation": [0, 0, 7]}]
    nodes += [{"mesh": 0, "skin": 0, "translation": [50, 60, 70]}]
    skins = [{"joints": [*range(n_joint)], "inverseBindMatrices": 5}]
    scenes = [{"nodes": [n_joint, n_joint + 1]}]
    data = file_of(arrays, {"attributes": attributes, "indices": 1}, nodes=nodes, skins=skins, scenes=scenes, **tree)
    lift = trimesh.transformations.translation_matrix([0, 0, 7])
    shares = weights / weights.sum(axis=1, keepdims=True, dtype=float)
    vertices, normals = [], []
    for point, normal, of_vertex, share in zip(POINTS, arrays[2], joints, shares, strict=True):
        matrix = sum(w * lift @ places[j] @ np.float32(binds[j]) for w, j in zip(share, of_vertex, strict=True))
        vertices.append((matrix @ [*point, 1])[:3])
        normals.append(np.linalg.inv(matrix[:3, :3]).T @ normal * np.sign(np.linalg.det(matrix[:3, :3])))
    return data, np.array(vertices), np.array(normals)


def test_a_skinned_mesh_stands_where_its_joints_carry_it():
    random = np.random.default_rng(3)
    rows = np.float32(random.dirichlet([1] * 4, 4))
    for weights in (rows, np.uint8(np.rint(rows * 255)), np.float32([[1, 0, 0, 0]] * 4), 2 * rows):
        data, vertices, normals = skinned(random, weights)
        (mesh,) = load(data, format="gltf").meshes
        np.testing.assert_allclose(mesh.vertices, vertices, atol=1e-5)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        found = mesh.normals if mesh.normals.ndim == 2 else mesh.normals.reshape(-1, 3)
        np.testing.assert_allclose(found, normals, atol=1e-4)


def test_joints_that_there_are_not_are_refused_unless_they_carry_nothing():
    random = np.random.default_rng(4)
    data, _, _ = skinned(random, np.float32([[0.5, 0.5, 0, 0]] * 4))
    tree = json.loads(data)
    joints = np.full((4, 4), 0, "<u2")
    for column, is_refused in ((3, False), (1, True)):
        joints[:] = 0
        joints[:, column] = 99
        tree["buffers"][3]["uri"] = uri(joints.tobytes())
        given = json.dumps(tree).encode()
        if is_refused:
            with pytest.raises(ModelError, match="carried by joint 99; its skin has 3"):
                load(given, format="gltf")
        else:
            assert load(given, format="gltf").n_face == 2


def test_morph_targets_move_a_mesh_by_the_weights_of_its_node_or_its_own():
    moved = np.float32([[0, 0, 1], [0, 0, 2], [0, 0, 3], [1, 0, 0]])
    arrays = [POINTS, FACES, moved, -moved]
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "targets": [{"POSITION": 2}, {"POSITION": 3}]}
    for own, of_node, factor in ((None, None, 0), ([0.5, 0], None, 0.5), ([0.5, 0], [0, 2], -2), ([1, 1], None, 0)):
        node = {"mesh": 0} | ({"weights": of_node} if of_node else {})
        mesh = {"primitives": [primitive]} | ({"weights": own} if own else {})
        (found,) = load(file_of(arrays, primitive, nodes=[node], meshes=[mesh]), format="gltf").meshes
        np.testing.assert_allclose(found.vertices, POINTS + factor * moved, atol=1e-6, err_msg=f"{own} {of_node}")


def test_what_is_not_drawn_is_said_by_load_and_render():
    data = file_of([POINTS, FACES], {"attributes": {"POSITION": 0}, "indices": 1},
                   animations=[{}], extensionsUsed=["EXT_mesh_gpu_instancing"])  # fmt: skip
    said = "model: not used: the extension EXT_mesh_gpu_instancing, animations"
    with pytest.warns(UserWarning, match=said):
        load(data, format="gltf")


def test_a_texture_of_another_format_falls_back_on_the_one_beside_it():
    texture = {"source": 0, "extensions": {"KHR_texture_basisu": {"source": 1}}}
    data = file_of(
        [POINTS, FACES, np.zeros((4, 2), "<f4")],
        {"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": 0},
        images=[{"uri": picture_uri(np.zeros((3, 5, 3)))}, {"uri": "data:;base64,AAAA"}], textures=[texture],
        materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    )  # fmt: skip
    (mesh,) = load(data, format="gltf").meshes
    assert mesh.material.texture.image.shape[:2] == (3, 5)
