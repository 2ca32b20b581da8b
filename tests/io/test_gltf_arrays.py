"""Accessors of glTF files: sparse ones, ones without data, and extensions that a file says it needs."""

import base64

import numpy as np
import pytest
from helpers.model_bytes import gltf_with

from rasterizer.errors import ModelError
from rasterizer.io import gltf_arrays
from rasterizer.io.loader import load


def add_view(tree, array) -> int:
    """Put an array into a buffer and a view of its own; the view's number."""
    data = base64.b64encode(array.tobytes()).decode()
    tree["buffers"].append({"byteLength": array.nbytes, "uri": f"data:application/octet-stream;base64,{data}"})
    tree["bufferViews"].append({"buffer": len(tree["buffers"]) - 1, "byteLength": array.nbytes})
    return len(tree["bufferViews"]) - 1


def positions(change):
    """The vertices of a glTF box whose accessor of positions has been changed."""

    def with_accessor(tree, primitive):
        change(tree, tree["accessors"][primitive["attributes"]["POSITION"]])

    (mesh,) = load(gltf_with(with_accessor), format="gltf", crease_angle=None).meshes
    return np.asarray(mesh.vertices)


def sparse(places, rows, dtype=np.uint8, component=5121, **more):
    def change(tree, accessor):
        accessor["sparse"] = {
            "count": len(places),
            "indices": {"bufferView": add_view(tree, np.array(places, dtype)), "componentType": component},
            "values": {"bufferView": add_view(tree, np.array(rows, np.float32))},
        } | more

    return change


@pytest.mark.parametrize(("dtype", "component"), [(np.uint8, 5121), (np.uint16, 5123), (np.uint32, 5125)])
def test_a_sparse_accessor_replaces_rows(dtype, component):
    before = positions(lambda tree, accessor: None)
    after = positions(sparse([1, 4], [[9, 8, 7], [6, 5, 4]], dtype, component))
    expected = before.copy()
    expected[[1, 4]] = [[9, 8, 7], [6, 5, 4]]
    # vertices at one place are one
    assert {tuple(row) for row in after} == {tuple(row) for row in expected}


def test_without_a_view_the_other_rows_are_zero():
    def change(tree, accessor):
        n = accessor["count"]
        del accessor["bufferView"]
        sparse(range(n), np.arange(3.0 * n).reshape(n, 3) ** 1.5)(tree, accessor)

    assert len(positions(change)) == 8
    with pytest.raises(ModelError, match="every face has zero area"):
        positions(lambda tree, accessor: accessor.pop("bufferView"))


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (sparse([1, 99], [[0, 0, 0]] * 2), "indices of accessor . must be whole numbers below 8"),
        (sparse([1], [[0, 0, 0]], np.float32, 5126), "indices of accessor . must be whole numbers below 8"),
        (sparse([1], [[0, 0, 0]], component=5120, dtype=np.int8), "must be whole numbers below 8"),
        (sparse([1, 2], [[0, 0, 0]]), "the values of accessor . of 2 rows ends at byte 24 of 12"),
        (sparse([1], [[0, 0, 0]], count=0), "not a readable"),
        (sparse([1], [[0, 0, 0]], count=10**12), "ends at byte"),
        (sparse([1], [[0, 0, 0]], values=3), "not a readable"),
        (lambda tree, accessor: accessor.update(componentType=7), "componentType must be one of 5120, .*; given 7"),
        (lambda tree, accessor: accessor.update(type=[1]), "not a readable"),
    ],
)
def test_damaged_ones_are_refused(change, fault):
    with pytest.raises(ModelError, match=fault):
        positions(change)


def test_rows_that_no_buffer_holds_are_limited_together(monkeypatch):
    monkeypatch.setattr(gltf_arrays, "MOST_MADE", 3 * 8)
    assert len(positions(sparse([0], [[1, 1, 1]]))) in (8, 9)

    def twice(tree, primitive):
        for name in ("POSITION", "NORMAL"):
            tree["accessors"].append({"componentType": 5126, "count": 8, "type": "VEC3"})
            primitive["attributes"][name] = len(tree["accessors"]) - 1

    with pytest.raises(ModelError, match="8 rows that no buffer holds; 1 is needed, 24 numbers are legal"):
        load(gltf_with(twice), format="gltf")


def test_what_a_file_needs_and_is_not_read_is_warned_of():
    names = ["KHR_texture_transform", "EXT_mesh_gpu_instancing", "KHR_materials_unlit", "FOO_bar"]
    data = gltf_with(lambda tree, primitive: tree.update(extensionsRequired=names, extensionsUsed=names))
    with pytest.warns(UserWarning, match="the file needs EXT_mesh_gpu_instancing, FOO_bar, which is not read"):
        assert load(data, format="gltf").n_face == 12


def test_primitives_without_positions_and_corners_too_many_are_left_out():
    def change(tree, primitive):
        tree["meshes"][0]["primitives"].append({"attributes": {}})
        tree["accessors"][primitive["indices"]]["count"] -= 1

    assert load(gltf_with(change), format="gltf").n_face == 11
