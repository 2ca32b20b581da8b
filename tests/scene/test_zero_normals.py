"""Normals of length 0 are computed from the faces, as where none are given."""

import numpy as np
import pytest
from helpers.model_bytes import gltf_with
from helpers.pinhole import octasphere

import rasterizer as rz
from rasterizer.reference.normals import corner_normals

VERTICES, FACES = octasphere(2)


def corners_of(mesh):
    """The normals (n_face, 3, 3) of all corners."""
    return mesh.normals if mesh.normals.ndim == 3 else mesh.normals[mesh.faces]


@pytest.mark.parametrize(("weighting", "is_per_corner"), [("angle", False), ("area", True), ("uniform", False)])
def test_a_vertex_without_a_normal_gets_that_of_its_faces(weighting, is_per_corner):
    """The others keep theirs."""
    given = VERTICES + (0.3, 0.1, 0.0)
    given = given[FACES] if is_per_corner else given
    is_zero = np.random.default_rng(3).random(given.shape[:-1]) < 0.4
    mesh = rz.Mesh(
        VERTICES, FACES, np.where(is_zero[..., None], 0.0, given), weighting=weighting, smoothing=[1] * len(FACES)
    )
    whole = rz.Mesh(VERTICES, FACES, given)
    is_zero = is_zero if is_per_corner else is_zero[FACES]
    computed = corner_normals(VERTICES, FACES, 180.0, weighting, None)
    expected = np.where(is_zero[..., None], computed, corners_of(whole))
    assert mesh.normals.shape == given.shape, "no vertex of a ball has two"
    np.testing.assert_allclose(corners_of(mesh), expected, atol=1e-12)


def test_files_say_how_many_they_have(tmp_path):
    """OBJ, PLY and glTF say it in what `-v` prints; scene files keep what was computed."""
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nvn 0 1 0\nf 1//1 2//2 3//1\n")
    properties = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    (tmp_path / "a.ply").write_text(
        f"ply\nformat ascii 1.0\nelement vertex 3\n{properties}element face 1\n"
        "property list uchar int vertex_indices\nend_header\n0 0 0 0 0 0\n1 0 0 0 1 0\n0 1 0 0 0 0\n3 0 1 2\n"
    )

    def of_a_triangle(tree, primitive):
        """Positions and normals of a buffer of their own."""
        rows = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [0, 1, 0], [0, 0, 0]], np.float32)
        (tmp_path / "a.bin").write_bytes(rows.tobytes())
        tree["buffers"] = [{"uri": "a.bin", "byteLength": 72}]
        tree["bufferViews"] = [{"buffer": 0, "byteOffset": 36 * k, "byteLength": 36} for k in range(2)]
        tree["accessors"] = [{"bufferView": k, "componentType": 5126, "count": 3, "type": "VEC3"} for k in range(2)]
        primitive["attributes"] = {"POSITION": 0, "NORMAL": 1}
        del primitive["indices"]

    (tmp_path / "a.gltf").write_bytes(gltf_with(of_a_triangle))
    for name in ("a.obj", "a.ply", "a.gltf"):
        facts = []
        (mesh,) = rz.load(tmp_path / name, log=facts.append).meshes
        assert corners_of(mesh).tolist() == [[[0, 0, 1], [0, 1, 0], [0, 0, 1]]], name
        assert any("2 file normals are zero" in fact and "computed from the faces" in fact for fact in facts), facts
    rz.save(rz.Scene(mesh), tmp_path / "a.json")
    assert corners_of(rz.load(tmp_path / "a.json").meshes[0]).tolist() == corners_of(mesh).tolist()
