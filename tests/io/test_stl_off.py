"""STL and OFF: every kind of file that others write, and errors that name the line."""

import struct

import numpy as np
import pytest
from helpers.model_bytes import box, exported
from helpers.refusals import assert_refused

from rasterizer.errors import ModelError
from rasterizer.io.loader import load

ELL = "0 0 0\n8 0 0\n8 2 0\n2 2 0\n2 8 0\n0 8 0\n"
FACET = "facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 0 1 0\n endloop\nendfacet\n"


def load_off(text, **options):
    (mesh,) = load(text.encode(), format="off", **options).meshes
    return mesh


def area(mesh):
    corners = mesh.vertices[mesh.faces]
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2


def test_off_heads_and_polygons():
    for head in ("OFF\n6 1 0\n", "OFF 6 1 0\n", "# c\nOFF # d\n# e\n6 1 # f\n", "OFF\r\n\r\n6 1 0\r\n"):
        mesh = load_off(head + ELL + "6 0 1 2 3 4 5\n")
        assert mesh.n_face == 4, f"{head}: {mesh.n_face} != 4"
        assert abs(area(mesh) - 28) < 1e-12, head
    text = "OFF # c\n5 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n-1 0 0\n\n5 0 1 2 3 4\n3 0 1 2\n4 3 2 1 0\n"
    mesh = load_off(text)
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 2], [3, 2, 1], [1, 0, 3]]
    assert mesh.polygons.tolist() == [0, 0, 0, 1, 2, 2]


def test_off_with_everything():
    rows = "".join(f"{k} {k * k} 0 2 0 0 1 255 51 0 255 0.5 0.25\n" for k in range(3))
    mesh = load_off("STCN4OFF\n3 1 0\n" + rows.replace(" 0 2 0 0 1 255", " 0 2 0 0 3 255") + "3 0 1 2\n")
    assert mesh.vertices[2].tolist() == [1, 2, 0], "places of four numbers are divided by the last"
    assert mesh.normals[0].tolist() == [0, 0, 1] and mesh.uv[1].tolist() == [0.5, 0.25]
    np.testing.assert_allclose(mesh.colors[0, :3], (1, 0.0331, 0), atol=1e-3)
    for color, blue in (("255 0 0", "0 0 255"), ("1.0 0.0 0.0 1.0", "0 0 1")):
        rows = "".join(f"{k} {k * k} 0 {color}\n" for k in range(3))
        mesh = load_off("COFF\n3 1 0\n" + rows + "3 0 1 2 0.5 0.5 0.5\n")
        assert mesh.colors[1, :3].tolist() == [1, 0, 0], f"{color}: {mesh.colors[1, :3].tolist()} != {[1, 0, 0]}"
        assert mesh.face_colors is None, color
        mesh = load_off("OFF\n6 2 0\n" + ELL + f"4 0 1 2 3 {color}\n3 0 3 4 {blue}\n")
        assert mesh.face_colors[:, :3].tolist() == [[1, 0, 0], [1, 0, 0], [0, 0, 1]], color


def test_off_faults_name_the_line():
    one = "OFF\n6 1 0\n"
    assert_refused(load_off, [
        ("6 1 0\n" + ELL + "6 0 1 2 3 4 5\n", "'OFF' is missing"),
        ("OFF\n3 -1 0\n0 0 0\n", ":2: '3 -1 0' does not say how many"),
        ("OFF\n-3 1 0\n0 0 0\n", ":2: '-3 1 0' does not say how many"),
        ("OFF\nx\n", ":2: 'x' does not say"),
        ("OFF\n", "no line says how many"),
        ("OFF\n4294967296 4294967296 0\n0 0 0\n", ":2: the header promises 4294967296 vertices"),
        ("OFF\n6 2 0\n" + ELL + "3 0 1 2\n", "promises 6 vertices and 2 faces, the file has 6 and 1"),
        (one + ELL + "-3 0 1 2\n", ":9: not a readable OFF file: a face line has fewer corners than it says"),
        (one + ELL + "99999999999999999999 0 1 2\n", "not a readable OFF file"),
        ("OFF\n6 2 0\n" + ELL + "3 0 1 2\n5 0 1 2\n", ":10: .* fewer corners than it says, 5"),
        (one + ELL + "3 0 1 6\n", ":9: the face refers to vertex 6; the file has 6"),
        (one + ELL + "3 0 1 1.5\n", r":9: the face refers to vertex 1\.5, which is no index"),
        (one + ELL + "3 0 1 two\n", ":9: '3 0 1 two' holds something that is no number"),
        (one + ELL.replace("8 2 0", "8 y 0") + "3 0 1 2\n", ":5: '8 y 0' is not a vertex of 3 numbers"),
        (one + ELL.replace("8 2 0", "8 2") + "3 0 1 2\n", ":5: '8 2' is not a vertex of 3 numbers"),
        (one + ELL.replace("8 2 0", "nan 2 0") + "3 0 1 2\n", "1 of 6 vertices"),
        (one + ELL + "3 0 1 1\n", "zero area"),
        ("OFF\n6 0 0\n" + ELL, "a point cloud: 6 points, no faces"),
        ("4nOFF\n3 3 1 0\n", "nOFF, which is not read"),
        ("OFF BINARY\n\0\0\0", "binary OFF, which is not read"),
    ], ModelError, "model")  # fmt: skip


# --- STL ----------------------------------------------------------------------------------------------------


def binary_stl(n, promised=None, head=b""):
    rows = b"".join(struct.pack("<12fH", 0, 0, 1, 0, 0, k, 1, 0, k, 0, 1, k, 0) for k in range(n))
    return head.ljust(80, b" ") + struct.pack("<I", n if promised is None else promised) + rows


def load_stl(data, **options):
    return load(data, format="stl", **options)


def test_a_binary_file_may_begin_with_solid_or_have_a_wrong_number_of_faces():
    assert load_stl(binary_stl(3, head=b"solid exported")).n_face == 3
    assert load_stl(binary_stl(3, promised=7, head=b"solid exported\0")).n_face == 3
    wrong = [binary_stl(4, promised) for promised in (0, 2, 7, 2**32 - 1)]
    for data in (*wrong, binary_stl(4) + b"trailing"):
        facts = []
        assert load_stl(data, log=facts.append).n_face == 4
        assert any("another length than its header says; 4 faces" in fact for fact in facts), facts
    said = "binary STL of 4294967295 faces must have 214748364834 bytes, the file has 97"
    assert_refused(load_stl, [(binary_stl(0, 2**32 - 1) + bytes(13), said)], ModelError)  # costs no memory


def test_triangles_share_vertices_and_solids_stay_apart():
    (mesh,) = load_stl(exported(box(), "stl")).meshes
    assert mesh.n_vertex == 8
    one = exported(box(), "stl_ascii").decode()
    assert [mesh.n_face for mesh in load_stl((one.replace("solid", "solid a") + one).encode()).meshes] == [12, 12]


@pytest.mark.parametrize("convention", ["viscam", "magics"])
def test_stl_colors(convention):
    data, is_viscam = bytearray(exported(box(), "stl")), convention == "viscam"
    for face in range(12):
        red, green, blue = (31, 0, 10)[:: 1 if is_viscam else -1]
        bits = red << 10 | green << 5 | blue | (0x8000 if is_viscam else 0)
        data[84 + 50 * face + 48 : 84 + 50 * face + 50] = bits.to_bytes(2, "little")
    if not is_viscam:
        data[:10] = b"COLOR=\xff\x00\x00\xff"
        data[84 + 48 : 84 + 50] = b"\x00\x80"  # the first face has the colour of the part
    (mesh,) = load_stl(bytes(data)).meshes
    np.testing.assert_allclose(mesh.face_colors[1:, :3], [(1, 0, 0.084376)] * 11, atol=1e-6)
    assert is_viscam or mesh.face_colors[0, :3].tolist() == [1, 0, 0]
    assert mesh.material.diffuse == (1.0, 1.0, 1.0)


def test_ascii_in_any_spelling():
    windows, tabs = (lambda text: text.replace("\n", "\r\n")), (lambda text: text.replace(" ", "\t"))
    for spell in (str, str.upper, str.title, windows, tabs):
        text = spell("solid part one\n" + FACET * 2 + "endsolid part one\n")
        (mesh,) = load_stl(text.encode()).meshes
        assert mesh.n_face == 2, f"{text}: {mesh.n_face} != 2"
        assert mesh.name.lower().replace("\t", " ") == "part one", text


def test_stl_faults_name_the_line():
    assert_refused(lambda text: load_stl(text.encode()), [
        ("solid\n" + FACET.replace("1 0 0", "1 x 0") + "endsolid\n", ":5: 'vertex 1 x 0' is not a vertex of three"),
        ("solid\n" + FACET + FACET.replace("  vertex 0 1 0\n", "") + "endsolid\n",
         ":13: a facet has 2 vertices, 3 are needed"),
        ("solid\n" + FACET.replace(" endloop\nendfacet\n", "") + "endsolid\n", "last facet is cut off"),
        ("solid\n" + FACET, "cut off"),
        ("solid\nendsolid\n", "no faces"),
    ], ModelError, "model")  # fmt: skip
    said = "binary STL of 12 faces must have 684 bytes, the file has 674"
    assert_refused(load_stl, [(exported(box(), "stl")[:-10], said)], ModelError)
