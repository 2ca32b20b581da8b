"""PLY: every kind of file that others write, and errors that name the line."""

import struct
import warnings

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.model_bytes import PLY_HEADER
from helpers.refusals import assert_refused
from helpers.solids import area_of
from PIL import Image

from rasterizer.errors import ModelError
from rasterizer.io.loader import load

POINTS = [(0, 0, 0), (8, 0, 0), (8, 2, 0), (2, 2, 0), (2, 8, 0), (0, 8, 0)]
VERTEX = "element vertex {n}\nproperty float x\nproperty float y\nproperty float z\n"


def text(elements, rows, n=6, comment="comment a\nobj_info b\n"):
    return f"ply\nformat ascii 1.0\n{comment}{VERTEX.format(n=n)}{elements}end_header\n{rows}".encode()


def points(extra=""):
    return "".join(f"{x} {y} {z} {extra}\n" for x, y, z in POINTS)


FACES = "element face {n}\nproperty list uchar int vertex_indices\n"


def only(data, **options):
    (mesh,) = load(data, format="ply", **options).meshes
    return mesh


def test_polygons_and_face_colours_come_in_the_order_of_the_file():
    mesh = only(text(FACES.format(n=1), points() + "6 0 1 2 3 4 5\n"))
    assert mesh.n_face == 4 and abs(area_of(mesh) - 28) < 1e-12, "concave"
    colors = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    rows = "4 0 1 2 3 255 0 0\n3 0 1 2 0 255 0\n5 0 1 2 3 5 0 0 255\n"
    mesh = only(text(FACES.format(n=3) + colors, points() + rows))
    assert mesh.faces.tolist()[:3] == [[1, 2, 3], [1, 3, 0], [0, 1, 2]]
    assert mesh.polygons.tolist() == [0, 0, 1, 2, 2, 2]
    assert mesh.face_colors[:, :3].tolist() == np.eye(3)[[0, 0, 1, 2, 2, 2]].tolist()
    rows = points().replace("\n", " ") + "\n3\n0 1\n2 3 3\n4 5"  # may be written on any lines
    assert only(text(FACES.format(n=2), rows)).n_face == 2
    data = text(FACES.format(n=1), points() + "3 0 1 2\n", comment="comment von J\xfcrgen\n")
    assert only(data.decode().encode("latin-1")).n_face == 1


@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_files_are_those_of_text(order):
    """Lists of several lengths, elements and properties that nobody asked for, bytes in both orders."""
    rng = np.random.default_rng(7)
    faces = [rng.choice(6, rng.integers(3, 6), replace=False).tolist() for _ in range(40)] + [[0, 1], [], [5, 4, 3]]
    name = b"binary_little_endian" if order == "<" else b"binary_big_endian"
    junk = "element junk 2\nproperty list uchar double values\nproperty short z\n"
    codes = {"uchar": "u1", "char": "i1", "ushort": "u2", "short": "i2", "int": "i4", "uint": "u4", "float": "f4"}
    for type, index in zip(codes, ["short", "int", "uint", "uchar", "char", "short", "int"], strict=True):
        properties = f"property uchar red\nproperty list {type} {index} vertex_index\nproperty double green\n"
        elements = f"element face {len(faces)}\n{properties}property uchar blue\n"
        rows = [f"{k} {len(face)} {' '.join(map(str, face))} {k / 2} {255 - k}" for k, face in enumerate(faces)]
        written = text(elements, "\n".join(["2 1.5 2.5 7", "0 9", points() + rows[0], *rows[1:]]) + "\n", comment=junk)
        written = written.replace(b"float x", b"double x")
        data = struct.pack(order + "BddhBh", 2, 1.5, 2.5, 7, 0, 9)
        data += b"".join(struct.pack(order + "dff", *point) for point in POINTS)
        for k, face in enumerate(faces):
            data += bytes([k]) + np.array(len(face), order + codes[type]).tobytes()
            data += np.array(face, order + codes[index]).tobytes()
            data += np.array(k / 2, order + "f8").tobytes() + bytes([255 - k])
        header = written[: written.index(b"end_header\n") + 11].replace(b"ascii", name).replace(b"\n", b"\r\n")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # polygons that cross themselves
            one, other = only(header + data), only(written)
        assert np.array_equal(one.vertices, other.vertices) and np.array_equal(one.faces, other.faces), type
        assert np.array_equal(one.polygons, other.polygons), type
        assert np.allclose(one.face_colors[:, [0, 2]], other.face_colors[:, [0, 2]]), type
        cases = [(n, "binary PLY of another length than its header says") for n in (1, 2, 3, 7, 20, 59)]
        assert_refused(lambda n, whole=header + data: only(whole[:-n]), cases, ModelError)


def test_a_long_list_among_short_ones_takes_no_square_of_its_length():
    elements = "element face 3\nproperty list uint int vertex_indices\n"
    header = text(elements, "").replace(b"ascii", b"binary_little_endian")
    data = np.array([float(word) for word in points().split()], "<f4").tobytes()
    long = np.arange(200_000, dtype="<i4") % 2
    for face in ([0, 1, 2], long, [0, 1, 2, 3]):
        data += np.array([len(face), *face], "<i4").tobytes()
    assert only(header + data).n_face == 1 + len(long) - 2 + 2
    huge = data.replace(np.array([len(long)], "<u4").tobytes(), b"\xff\xff\xff\xff")
    with pytest.raises(ModelError, match="ends in face row 1 of 3"):
        only(header + huge)


def test_triangle_strips():
    elements = "element tristrips 1\nproperty list int int vertex_indices\n"
    mesh = only(text(elements, points() + "9 0 1 2 3 -1 3 4 5 5\n"))
    assert mesh.faces.tolist() == [[0, 1, 2], [2, 1, 3], [3, 4, 5]]
    both = FACES.format(n=1) + elements
    mesh = only(text(both, points() + "4 0 1 2 3\n9 0 1 2 3 -1 3 4 5 5\n"))
    assert mesh.n_face == 5 and mesh.polygons.tolist() == [0, 0, 1, 2, 3]
    with pytest.raises(ModelError, match="a triangle strip refers to vertex 77"):
        only(text(elements, points() + "4 0 1 2 77\n"))


def test_colours_of_every_type_and_normals_of_vertices():
    values = {
        "uchar": "255 0 51 128",
        "float": "1 0 0.2",
        "ushort": "65535 0 13107",
        "double": "1.0 0.0 0.2",
        "int": "255 0 51",
    }
    names = ["red green blue alpha", "diffuse_red diffuse_green diffuse_blue", "r g b", "red green blue", "r g b"]
    for (type, row), words in zip(values.items(), names, strict=True):
        properties = "".join(f"property {type} {name}\n" for name in words.split())
        mesh = only(text(properties + FACES.format(n=1), points(row) + "3 0 1 2\n"))
        assert np.allclose(mesh.colors[0, :3], (1, 0, 0.0331), atol=1e-3), f"{type} {words}: {mesh.colors[0]}"
        assert np.allclose(mesh.colors[0, 3:], 128 / 255)
        assert mesh.material.diffuse == (1, 1, 1)
    properties = "".join(f"property float n{axis}\n" for axis in "xyz")
    mesh = only(text(properties + FACES.format(n=1), points("0 3 4") + "3 0 1 2\n"))
    assert mesh.normals.tolist() == [[0, 0.6, 0.8]] * mesh.n_vertex


# --- what others read, though it is not quite legal -----------------------------------------------------------

ROWS = PLY_HEADER.format(n_face=1, face_properties="property uchar red\n")


def test_rows_of_ply_with_more_values_than_the_header_names():
    vertices = ROWS.replace("0 0 0\n1 0 0", "0 0 0 7 7\n1 0 0 7")
    for data in (ROWS + "3 0 1 2 9 5 5 5 5\n", vertices + "3 0 1 2 9\n", ROWS + "3 0 1 2 9 3 0\n"):
        with pytest.warns(UserWarning, match="rows hold more values than the header names: these are left out"):
            mesh = only(data.encode())
        assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], data
        assert mesh.faces.tolist() == [[0, 1, 2]], data
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        broken = ROWS.replace("1 0 0\n1 1 0", "1 0\n0 1 1 0")  # rows need no lines of their own
        assert only((broken + "3 0 1\n2 9").encode()).n_face == 1


def test_elements_of_ply_without_rows():
    edges = "element edge 0\nproperty int vertex1\nproperty int vertex2\n"
    assert only(text(edges + FACES.format(n=1), points() + "3 0 1 2\n")).n_face == 1
    for order in (b"ascii", b"binary_little_endian"):
        for elements in (FACES.format(n=0), edges + FACES.format(n=0)):
            with pytest.raises(ModelError, match="^model: no faces$"):
                only(text(elements, "", n=0).replace(b"ascii", order))


# --- textures -----------------------------------------------------------------------------------------------

WEDGES = FACES.format(n=3) + "property list uchar float texcoord\nproperty int texnumber\n"
PICTURES = "comment TextureFile red.png\ncomment TextureFile  dark blue.png \n"


def test_texture_coordinates_for_each_corner_of_a_face():
    """As MeshLab writes them: six numbers a triangle, and the number of a picture."""
    elements = WEDGES.replace("face 3", "face 2")
    rows = "3 0 1 2 6 0 0 1 0 1 0.5 0\n4 0 3 4 5 8 0.1 0.2 0.3 0.4 0.5 0.6 0.7 0.8 0\n"
    mesh = only(text(elements, points() + rows))
    assert mesh.uv.shape == (3, 3, 2) and mesh.uv[0].tolist() == [[0, 0], [1, 0], [1, 0.5]]
    named = {0: (0.1, 0.2), 3: (0.3, 0.4), 4: (0.5, 0.6), 5: (0.7, 0.8)}
    for triangle, uv in zip(mesh.faces[1:], mesh.uv[1:], strict=True):
        assert uv.tolist() == [list(named[corner]) for corner in triangle.tolist()]
    facts = []
    rows = "3 0 1 2 6 0 0 1 0 1 0.5 0\n4 0 3 4 5 0 0\n"
    assert not differences(only(text(elements, points() + rows), log=facts.append).uv[1:], 0)
    assert any("1 face without two texture coordinates" in fact for fact in facts)


def test_pictures_of_faces_and_of_vertices(tmp_path):
    for name, color in (("red.png", (255, 0, 0)), ("Dark Blue.png", (0, 0, 90))):
        Image.new("RGB", (2, 2), color).save(tmp_path / name)
    rows = "".join(f"3 0 1 {k + 2} 6 0 0 1 0 1 1 {number}\n" for k, number in enumerate((1, 0, -1)))
    path, facts = tmp_path / "m.ply", []
    path.write_bytes(text(WEDGES, points() + rows, comment=PICTURES))
    (mesh,) = load(path, log=facts.append).meshes
    names = [mesh.palette[k].texture and mesh.palette[k].texture.name for k in mesh.face_material]
    assert names == [str(tmp_path / "Dark Blue.png"), str(tmp_path / "red.png"), None]
    assert mesh.material.diffuse == (1, 1, 1) and facts == [f"{path}: 3 faces, 2 textures, no file normals"]
    path.write_bytes(text(WEDGES, points() + rows, comment=PICTURES.replace("red", "gone")))
    with pytest.warns(UserWarning, match=r"gone\.png' of material 'TextureFile 0' not found"):
        assert load(path).meshes[0].material.texture is None
    rows = "".join(f"{x} {y} {z} {x / 8} {y / 8}\n" for x, y, z in POINTS) + "3 0 1 2\n"
    elements = "property float texture_u\nproperty float texture_v\n" + FACES.format(n=1)
    path.write_bytes(text(elements, rows, comment="comment TextureFile red.png\n"))
    (mesh,) = load(path).meshes
    assert mesh.material.texture.image.shape == (2, 2, 4) and mesh.uv.max() == 1.0


# --- faults -------------------------------------------------------------------------------------------------


def test_what_is_not_used_is_said():
    facts = []
    elements = (
        "property float confidence\n" + FACES.format(n=1) + "property uchar flags\nelement edge 2\nproperty int a\n"
        "element camera 1\nproperty float focus\n"
    )
    only(text(elements, points("0.5") + "3 0 1 2 7\n1\n2\n9\n"), log=facts.append)
    left_out = "2 lines, vertex properties confidence, face properties flags, elements 'camera'"
    assert facts == [f"model: 1 face, no file normals; not used: {left_out}"]


def test_faults_name_the_line():
    def faces(n, rows, **options):
        return text(FACES.format(n=n), points() + rows, **options)

    binary = b"ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\n"
    binary += b"property float z\n%send_header\n%s"
    lists = b"element face 1\nproperty list uint int vertex_indices\n"
    assert_refused(only, [
        (faces(1, "3 0 1 x\n"), ":18: 'x' is not a number"),
        (faces(1, "3 0\v1\f1_0\n"), ":18: '1_0' is not a number"),  # only newlines end lines
        (faces(2, "3 0 1 2\n3 0 1 6\n"), ":19: the face refers to vertex 6; the file has 6"),
        (faces(2, "3 0 1 2\n-3 0 1 2\n"), ":19: face 1: -3 is not how long its list is"),
        (faces(2, "3 0 1 2\nnan 0 1 2\n"), ":19: face 1: nan is not how long"),
        (faces(2, "3 0 1 2\n3 0.5 1 2\n"), r"vertex 0\.5, which is no index"),
        (faces(3, "3 0 1 2\n3 0 1 2\n"), ":9: the header promises 3 face lines, the file has 2"),
        (text(FACES.format(n=1), "", n=2**40), ":5: the header promises 1099511627776 vertex lines"),
        (faces(-1, ""), ":9: -1 face lines"),
        (faces(0, ""), "a point cloud: 6 points, no faces"),
        (text("property real w\n", points()), ":9: 'property real w' is not a line of a PLY header"),
        (b"ply\nelement vertex 1\nproperty float x\nend_header\n1\n", "no line 'format'"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n", ":3: the vertices have no x"),
        (b"ply\nformat ascii 1.0\nelement face 0\nproperty list uchar int a\nend_header\n", "no vertices"),
        (binary % (9_000_000_000, b"", bytes(120)), "promised, room for at most 10"),
        (binary % (1, lists, bytes(12) + b"\xff\xff\xff\x7f"), "ends in face row 0 of 1"),
    ], ModelError, "model")  # fmt: skip
