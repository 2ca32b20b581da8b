"""Skins and morph targets of glTF: meshes stand in the pose of the file; and what is left out of it is said."""

import base64
import json

import numpy as np
import pytest
import trimesh

import rasterizer as rz

POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 2, 0.5]], "<f4")
FACES = np.array([[0, 1, 2], [1, 3, 2]], "<u2")


def file_of(arrays, primitive, **tree) -> bytes:
    """A glTF file of one primitive; `arrays` are its accessors in order."""
    buffers, views, accessors = [], [], []
    for k, array in enumerate(arrays):
        component = {"f4": 5126, "u2": 5123, "u1": 5121}[array.dtype.str[1:]]
        width = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}[array[0].size]
        uri = "data:;base64," + base64.b64encode(array.tobytes()).decode()
        buffers.append({"uri": uri, "byteLength": array.nbytes})
        views.append({"buffer": k, "byteLength": array.nbytes})
        accessor = {"bufferView": k, "componentType": component, "count": len(array), "type": width}
        accessors.append(accessor | ({"normalized": True} if array.dtype == np.uint8 and k == 4 else {}))
    usual = {"asset": {"version": "2.0"}, "buffers": buffers, "bufferViews": views, "accessors": accessors,
             "meshes": [{"primitives": [primitive]}]}  # fmt: skip
    return json.dumps(usual | tree).encode()


def skinned(random, weights, n_joint=3, **tree):
    """A skinned file, and where its vertices and normals are: sum of weights · joint · inverse bind matrix."""
    places = [trimesh.transformations.random_rotation_matrix(random.random(3)) for _ in range(n_joint)]
    binds = [trimesh.transformations.random_rotation_matrix(random.random(3)) for _ in range(n_joint)]
    for matrix in (*places, *binds):
        matrix[:3, 3] = random.normal(size=3)
    joints = random.integers(0, n_joint, (4, 4))
    arrays = [POINTS, FACES.reshape(-1, 1), np.float32(POINTS[:, ::-1] + 1), joints.astype("<u2"), weights,
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
        (mesh,) = rz.load(data, format="gltf").meshes
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
        uri = "data:;base64," + base64.b64encode(joints.tobytes()).decode()
        tree["buffers"][3]["uri"] = uri
        given = json.dumps(tree).encode()
        if is_refused:
            with pytest.raises(rz.ModelError, match="carried by joint 99; its skin has 3"):
                rz.load(given, format="gltf")
        else:
            assert rz.load(given, format="gltf").n_face == 2


def test_morph_targets_move_a_mesh_by_the_weights_of_its_node_or_its_own():
    moved = np.float32([[0, 0, 1], [0, 0, 2], [0, 0, 3], [1, 0, 0]])
    arrays = [POINTS, FACES.reshape(-1, 1), moved, -moved]
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "targets": [{"POSITION": 2}, {"POSITION": 3}]}
    for own, of_node, factor in (([], None, 0), ([0.5, 0], None, 0.5), ([0.5, 0], [0, 2], -2), ([1, 1], None, 0)):
        node = {"mesh": 0} | ({} if of_node is None else {"weights": of_node})
        mesh = {"primitives": [primitive]} | ({"weights": own} if own else {})
        (found,) = rz.load(file_of(arrays, primitive, nodes=[node], meshes=[mesh]), format="gltf").meshes
        np.testing.assert_allclose(found.vertices, POINTS + factor * moved, atol=1e-6, err_msg=f"{own} {of_node}")


def test_what_is_not_drawn_is_said_by_load_and_render():
    data = file_of([POINTS, FACES.reshape(-1, 1)], {"attributes": {"POSITION": 0}, "indices": 1}, nodes=[{"mesh": 0}],
                   animations=[{}], extensionsUsed=["EXT_mesh_gpu_instancing"])  # fmt: skip
    said = "model: not used: the extension EXT_mesh_gpu_instancing, animations"
    with pytest.warns(UserWarning, match=said):
        rz.load(data, format="gltf")


def test_a_texture_of_another_format_falls_back_on_the_one_beside_it():
    from helpers.file_grammar import picture

    uv = np.zeros((4, 4), "<f4")
    uri = "data:;base64," + base64.b64encode(picture()).decode()
    texture = {"source": 0, "extensions": {"KHR_texture_basisu": {"source": 1}}}
    data = file_of(
        [POINTS, FACES.reshape(-1, 1), uv],
        {"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": 0},
        nodes=[{"mesh": 0}], images=[{"uri": uri}, {"uri": "data:;base64,AAAA"}], textures=[texture],
        materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    )  # fmt: skip
    tree = json.loads(data)
    tree["accessors"][2]["type"] = "VEC2"
    (mesh,) = rz.load(json.dumps(tree).encode(), format="gltf").meshes
    assert mesh.material.texture.image.shape[:2] == (3, 5)
