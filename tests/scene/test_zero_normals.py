"""Normals of length 0 are computed from the faces, as where none are given."""

import numpy as np
import pytest
from helpers.against_reference import assert_matches_reference
from helpers.arrays import differences
from helpers.model_bytes import gltf_with
from helpers.pinhole import octasphere

import rasterizer as rz
from rasterizer.reference.normals import corner_normals

VERTICES, FACES = octasphere(2)
LIGHTS = (rz.AmbientLight(0.1), rz.DirectionalLight((-1, -2, -3), 0.8))
ROOF = np.array([[-1, 0, 1], [1, 0, 1], [1, 1, 0], [-1, 1, 0], [-1, 0, -1], [1, 0, -1]], float)
SLOPES = [[0, 1, 2], [0, 2, 3], [3, 2, 5], [3, 5, 4]]


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


def test_creases_are_those_of_a_mesh_without_normals():
    """The ridge of a roof has two normals; so all corners get normals of their own."""
    normals = np.tile([0.0, 1.0, 0.0], (6, 1))
    normals[[2, 3]] = 0.0
    mesh, bare = rz.Mesh(ROOF, SLOPES, normals), rz.Mesh(ROOF, SLOPES, 0 * normals)
    slopes = np.array([[0, 1, 1], [0, 1, 1], [0, 1, -1], [0, 1, -1]]) / 2**0.5
    np.testing.assert_allclose(corners_of(bare), np.repeat(slopes[:, None], 3, axis=1), atol=1e-12)
    is_ridge = np.isin(mesh.faces, [2, 3])
    expected = np.where(is_ridge[..., None], slopes[:, None], [0.0, 1.0, 0.0])
    np.testing.assert_allclose(corners_of(mesh), expected, atol=1e-12)
    grouped = rz.Mesh(ROOF, SLOPES, 0 * normals, smoothing=[1, 1, 1, 1])
    assert grouped.normals.ndim == 2 and np.allclose(grouped.normals[2], (0, 1, 0)), "smoothing groups count"


def test_what_cannot_be_computed_stays_zero():
    """A vertex of no face, or of faces without area; with a crease angle normals aren't used."""
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5], [2, 0, 0], [3, 0, 0], [4, 0, 0]]
    mesh = rz.Mesh(vertices, [[0, 1, 2], [4, 5, 6]], np.zeros((7, 3)))
    assert not differences(np.isfinite(mesh.normals), True)
    assert not differences(mesh.normals[:3], (0, 0, 1))
    assert not differences(mesh.normals[3], 0)
    creased = rz.Mesh(VERTICES, FACES, 0 * VERTICES, crease_angle=30)
    assert not differences(creased.normals, 0) and rz.render(creased, 16, outputs="color").color.max() > 0.2


@pytest.mark.parametrize("shading", ["gouraud", "phong"])
def test_methods_and_the_reference_agree_on_them(shading):
    normals = VERTICES.copy()
    normals[::3] = 0.0
    scene = rz.Scene(rz.Mesh(VERTICES, FACES, normals), LIGHTS, rz.Camera.perspective((0, 1, 4)))
    assert_matches_reference(scene, (24, 18), 1 / 4096 + 1e-6, shading=shading)


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
