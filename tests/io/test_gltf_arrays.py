"""Accessors of glTF files: what numbers they hold, sparse ones, ones without data, and numbers that lead out of a
buffer; triangles in lists, strips and fans; extensions that a file says it needs."""

import base64

import numpy as np
import pytest
from helpers.model_bytes import gltf_with
from helpers.refusals import assert_refused

from rasterizer.errors import ModelError
from rasterizer.io.loader import load
from rasterizer.io.model_file import most


def add_view(tree, array) -> int:
    """Put an array into a buffer and a view of its own; the view's number."""
    data = base64.b64encode(array.tobytes()).decode()
    tree["buffers"].append({"byteLength": array.nbytes, "uri": f"data:application/octet-stream;base64,{data}"})
    tree["bufferViews"].append({"buffer": len(tree["buffers"]) - 1, "byteLength": array.nbytes})
    return len(tree["bufferViews"]) - 1


def only_mesh(change):
    (mesh,) = load(gltf_with(change), format="gltf", crease_angle=None).meshes
    return mesh


def positions(change):
    """The vertices of a glTF box whose accessor of positions has been changed."""

    def with_accessor(tree, primitive):
        change(tree, tree["accessors"][primitive["attributes"]["POSITION"]])

    return np.asarray(only_mesh(with_accessor).vertices)


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
        view = add_view(tree, np.concatenate([np.zeros(4, np.float32), rows.ravel()]))
        tree["bufferViews"][view] |= {"byteStride": 24, "byteOffset": 16, "byteLength": rows.nbytes}
        accessor.update(bufferView=view, byteOffset=12)

    assert {tuple(row) for row in positions(change)} == {tuple(row) for row in rows[:, 3:].astype(float)}


def test_fractions_of_integers_are_taken_where_they_are_meant():
    rows = np.array([[0, 1, 2], [255, 0, 5], [51, 255, 0], [102, 102, 255]] * 2, np.uint8)
    for dtype, is_fraction, scale in ((np.uint8, True, 255), (np.uint8, False, 1), (np.int8, True, 127)):
        given = np.zeros((8, 4), dtype)  # rows begin at multiples of four bytes
        given[:, :3] = -(rows // 2).astype(np.int8) if dtype == np.int8 else rows

        def change(tree, accessor, given=given, is_fraction=is_fraction):
            view = add_view(tree, given)
            tree["bufferViews"][view]["byteStride"] = 4
            component = 5121 if given.dtype == np.uint8 else 5120
            accessor.update(bufferView=view, byteOffset=0, componentType=component, normalized=is_fraction)

        found = {tuple(np.round(row, 6)) for row in positions(change)}
        assert found == {tuple(np.round(row[:3] / scale, 6)) for row in given.astype(float)}, (dtype, is_fraction)


def test_colors_are_linear():
    for dtype, component, scale in (("<f4", 5126, 1), ("<u2", 5123, 65535), ("u1", 5121, 255)):
        colors = (np.arange(32).reshape(8, 4) / 31 * scale).astype(dtype)

        def change(tree, primitive, colors=colors, component=component, scale=scale):
            accessor = {"bufferView": add_view(tree, colors), "componentType": component, "count": 8, "type": "VEC4"}
            tree["accessors"].append(accessor | {"normalized": scale > 1})
            primitive["attributes"]["COLOR_0"] = len(tree["accessors"]) - 1

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
            accessor = {"bufferView": add_view(tree, places), "componentType": 5126, "count": 6, "type": "VEC3"}
            tree["accessors"].append(accessor)
            primitive["attributes"] = {"POSITION": len(tree["accessors"]) - 1}
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


def test_damaged_accessors_are_refused():
    cases = [
        (sparse([1, 99], [[0, 0, 0]] * 2), "indices of accessor . must be whole numbers below 8"),
        (sparse([1], [[0, 0, 0]], np.float32, 5126), "indices of accessor . must be whole numbers below 8"),
        (sparse([1], [[0, 0, 0]], component=5120, dtype=np.int8), "must be whole numbers below 8"),
        (sparse([1, 2], [[0, 0, 0]]), "the values of accessor . of 2 rows ends at byte 24 of 12"),
        (sparse([1], [[0, 0, 0]], count=0), "not a readable"),
        (sparse([1], [[0, 0, 0]], count=10**12), "ends at byte"),
        (sparse([1], [[0, 0, 0]], values=3), "not a readable"),
        (lambda tree, accessor: accessor.update(componentType=7), "componentType must be one of 5120, .*; given 7"),
        (lambda tree, accessor: accessor.update(type=[1]), "not a readable"),
    ]
    assert_refused(positions, cases, ModelError, "model: ")


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
