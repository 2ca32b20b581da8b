"""STL and OFF: every kind of file that others write, and errors that name the line."""

import struct

import numpy as np
import pytest

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


@pytest.mark.parametrize(
    "head", ["OFF\n6 1 0\n", "OFF 6 1 0\n", "# c\nOFF # d\n# e\n6 1 # f\n", "OFF\r\n\r\n6 1 0\r\n", "off_6"]
)
def test_off_heads(head):
    if head == "off_6":
        with pytest.raises(ModelError, match="'OFF' is missing"):
            load_off("6 1 0\n" + ELL + "6 0 1 2 3 4 5\n")
        return
    mesh = load_off(head + ELL + "6 0 1 2 3 4 5\n")
    assert mesh.n_face == 4 and abs(area(mesh) - 28) < 1e-12


def test_off_with_everything():
    rows = "".join(f"{k} {k * k} 0 1 0 0 1 255 51 0 255 0.5 0.25\n" for k in range(3))
    mesh = load_off("STCN4OFF\n3 1 0\n" + rows.replace(" 0 1 0 0 1 255", " 0 2 0 0 1 255") + "3 0 1 2\n")
    assert mesh.vertices[2].tolist() == [1, 2, 0], "places of four numbers are divided by the last"
    assert mesh.normals[0].tolist() == [0, 0, 1] and mesh.uv[1].tolist() == [0.5, 0.25]
    np.testing.assert_allclose(mesh.colors[0, :3], (1, 0.0331, 0), atol=1e-3)


@pytest.mark.parametrize("color", ["255 0 0", "1.0 0.0 0.0 1.0"])
def test_off_colours(color):
    mesh = load_off("COFF\n3 1 0\n" + "".join(f"{k} {k * k} 0 {color}\n" for k in range(3)) + "3 0 1 2 0.5 0.5 0.5\n")
    assert mesh.colors[1, :3].tolist() == [1, 0, 0] and mesh.face_colors is None
    blue = "0 0 255" if color[0] == "2" else "0 0 1"
    mesh = load_off("OFF\n6 2 0\n" + ELL + f"4 0 1 2 3 {color}\n3 0 3 4 {blue}\n")
    assert mesh.face_colors[:, :3].tolist() == [[1, 0, 0], [1, 0, 0], [0, 0, 1]]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("OFF\n3 -1 0\n0 0 0\n", ":2: '3 -1 0' does not say how many"),
        ("OFF\n-3 1 0\n0 0 0\n", ":2: '-3 1 0' does not say how many"),
        ("OFF\nx\n", ":2: 'x' does not say"),
        ("OFF\n", "no line says how many"),
        ("OFF\n4294967296 4294967296 0\n0 0 0\n", ":2: the header promises 4294967296 vertices"),
        (
            "OFF\n6 1 0\n" + ELL + "-3 0 1 2\n",
            ":9: not a readable OFF file: a face line has fewer corners than it says",
        ),
        ("OFF\n6 2 0\n" + ELL + "3 0 1 2\n5 0 1 2\n", ":10: .* fewer corners than it says, 5"),
        ("OFF\n6 1 0\n" + ELL + "3 0 1 6\n", ":9: the face refers to vertex 6; the file has 6"),
        ("OFF\n6 1 0\n" + ELL + "3 0 1 1.5\n", ":9: the face refers to vertex 1.5, which is no index"),
        ("OFF\n6 1 0\n" + ELL + "3 0 1 two\n", ":9: '3 0 1 two' holds something that is no number"),
        ("OFF\n6 1 0\n" + ELL.replace("8 2 0", "8 y 0") + "3 0 1 2\n", ":5: '8 y 0' is not a vertex of 3 numbers"),
        ("OFF\n6 1 0\n" + ELL.replace("8 2 0", "8 2") + "3 0 1 2\n", ":5: '8 2' is not a vertex of 3 numbers"),
        ("OFF\n6 0 0\n" + ELL, "a point cloud: 6 points, no faces"),
        ("4nOFF\n3 3 1 0\n", "nOFF, which is not read"),
        ("OFF BINARY\n\0\0\0", "binary OFF, which is not read"),
    ],
)
def test_off_faults_name_the_line(text, fault):
    with pytest.raises(ModelError, match="model" + fault if fault[0] == ":" else fault):
        load_off(text)


# --- STL ----------------------------------------------------------------------------------------------------


def binary_stl(n, promised=None, head=b""):
    rows = b"".join(struct.pack("<12fH", 0, 0, 1, 0, 0, k, 1, 0, k, 0, 1, k, 0) for k in range(n))
    return head.ljust(80, b" ") + struct.pack("<I", n if promised is None else promised) + rows


def load_stl(data, **options):
    return load(data, format="stl", **options)


def test_a_binary_file_may_begin_with_solid():
    assert load_stl(binary_stl(3, head=b"solid exported")).n_face == 3
    assert load_stl(binary_stl(3, promised=7, head=b"solid exported\0")).n_face == 3


@pytest.mark.parametrize("promised", [0, 2, 7, 2**32 - 1])
def test_a_wrong_number_of_faces_is_reported(promised):
    facts = []
    assert load_stl(binary_stl(4, promised), log=facts.append).n_face == 4
    assert any("another length than its header says; 4 faces" in fact for fact in facts)
    facts = []
    assert load_stl(binary_stl(4) + b"trailing", log=facts.append).n_face == 4
    assert any("another length" in fact for fact in facts)


def test_a_huge_promise_costs_no_memory():
    with pytest.raises(
        ModelError, match="binary STL of 4294967295 faces must have 214748364834 bytes, the file has 97"
    ):
        load_stl(binary_stl(0, 2**32 - 1) + bytes(13))


@pytest.mark.parametrize(
    "spell", [str, str.upper, str.title, lambda text: text.replace("\n", "\r\n"), lambda text: text.replace(" ", "\t")]
)
def test_ascii_in_any_spelling(spell):
    scene = load_stl(spell("solid part one\n" + FACET * 2 + "endsolid part one\n").encode())
    assert scene.n_face == 2 and scene.meshes[0].name.lower().replace("\t", " ") == "part one"


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (
            "solid\n" + FACET.replace("1 0 0", "1 x 0") + "endsolid\n",
            r":5: 'vertex 1 x 0' is not a vertex of three numbers",
        ),
        (
            "solid\n" + FACET + FACET.replace("  vertex 0 1 0\n", "") + "endsolid\n",
            ":13: a facet has 2 vertices, 3 are needed",
        ),
        ("solid\n" + FACET.replace(" endloop\nendfacet\n", "") + "endsolid\n", "last facet is cut off"),
        ("solid\n" + FACET, "cut off"),
        ("solid\nendsolid\n", "no faces"),
    ],
)
def test_ascii_faults_name_the_line(text, fault):
    with pytest.raises(ModelError, match="model" + fault if fault[0] == ":" else fault):
        load_stl(text.encode())
