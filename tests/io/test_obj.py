"""Tests of the OBJ and MTL readers."""

import warnings

import numpy as np
import pytest
from helpers.naive_obj import naive_read
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer.errors import ModelError
from rasterizer.io.loader import load
from rasterizer.scene.material import Material

POINTS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 1\nv 2 2 1\nv 0.5 -1 0\nv 3 1 2\n"


def load_obj(text, **options):
    """Load OBJ text without a folder; that materials are missing then is no news."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load(text.encode(), format="obj", **options)


def triangles(mesh):
    return mesh.vertices[mesh.faces]


# --- against a naive twin -----------------------------------------------------------------------------------


@st.composite
def obj_texts(draw):
    """OBJ texts with every mixture of corner forms, polygons, materials, smoothing groups and index signs."""
    n_v, n_vt, n_vn = draw(st.integers(5, 9)), draw(st.integers(1, 4)), draw(st.integers(1, 4))
    lines = [f"v {k} {k * k % 7} {k * k * k % 11}" for k in range(n_v)]
    lines += [f"vt {k / 8} {k / 4}" for k in range(n_vt)]
    lines += [f"vn {k} 1 {2 - k}" for k in range(n_vn)]
    is_mixed, may_be_negative = draw(st.booleans()), draw(st.booleans())
    form = draw(st.sampled_from(["{v}", "{v}/{vt}", "{v}//{vn}", "{v}/{vt}/{vn}"]))
    sizes = st.integers(3, 6) if draw(st.booleans()) else st.just(draw(st.integers(3, 6)))

    def index(count):
        number = draw(st.integers(1, count))
        return number - count - 1 if may_be_negative and draw(st.booleans()) else number

    for _ in range(draw(st.integers(1, 8))):
        if draw(st.integers(0, 2)) == 0:
            lines.append(
                draw(st.sampled_from(["usemtl a", "usemtl b", "o a", "o b", "g x", "s 1", "s 3", "s off", "s 0"]))
            )
        if is_mixed:
            form = draw(st.sampled_from(["{v}", "{v}/{vt}", "{v}//{vn}", "{v}/{vt}/{vn}"]))
        corners = draw(st.permutations(range(1, n_v + 1)))[: draw(sizes)]
        if may_be_negative:
            corners = [k - n_v - 1 if draw(st.booleans()) else k for k in corners]
        words = [form.format(v=k, vt=index(n_vt), vn=index(n_vn)) for k in corners]
        lines.append("f " + " ".join(words))
    return "\n".join(lines) + "\n"


def unit(normals):
    normals = np.array(normals)
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def assert_same(text):
    """The meshes of a text are those that the naive reader finds, triangle by triangle."""
    expected = naive_read(text)
    scene = load_obj(text)
    assert len(scene.meshes) == len(expected)
    for mesh, (name, part) in zip(scene.meshes, expected, strict=True):
        assert mesh.name == (name or ("x" if "\ng x" in text else ""))
        np.testing.assert_array_equal(triangles(mesh), np.array(part["points"]))
        numbers = [0] * mesh.n_face if mesh.face_material is None else mesh.face_material.tolist()
        assert [mesh.palette[number].name for number in numbers] == part["materials"]
        assert [material.name for material in mesh.palette] == list(dict.fromkeys(part["materials"]))
        assert (mesh.uv is not None) == any(None not in corners for corners in part["uv"])
        if mesh.uv is not None:
            uv = mesh.uv if mesh.uv.ndim == 3 else mesh.uv[mesh.faces]
            np.testing.assert_array_equal(
                uv, [[(0, 0) if pair is None else pair for pair in each] for each in part["uv"]]
            )
        has_normals = all(normal is not None for corners in part["normals"] for normal in corners)
        assert (mesh.normals is not None) == has_normals
        if has_normals:
            np.testing.assert_allclose(mesh.normals, unit(part["normals"]), atol=1e-12)
        assert (mesh.smoothing is not None) == any(part["groups"])
        if mesh.smoothing is not None:
            assert mesh.smoothing.tolist() == part["groups"]
        assert (mesh.polygons is not None) == (part["n"] < len(part["polygons"]))
        if mesh.polygons is not None:
            assert mesh.polygons.tolist() == part["polygons"]


@settings(max_examples=150, deadline=None)
@given(obj_texts())
def test_every_mixture_is_read_like_the_naive_reader_does(text):
    assert_same(text)


@settings(max_examples=30, deadline=None)
@given(obj_texts(), st.sampled_from(["crlf", "cr", "tab", "blank", "comment", "continued", "bom", "no end"]))
def test_the_spelling_of_a_file_does_not_matter(text, spelling):
    spelled = {
        "crlf": text.replace("\n", "\r\n"),
        "cr": text.replace("\n", "\r"),
        "tab": text.replace(" ", "\t"),
        "blank": text.replace("\n", "  \n   "),
        "comment": text.replace("\n", " # f 1 2 3 usemtl x\n# usemtl y\n"),
        "continued": text.replace(" ", " \\\n"),
        "bom": "\ufeff" + text,
        "no end": text.rstrip("\n"),
    }[spelling]
    if spelling == "comment":  # a name may hold a '#'
        lines = text.split("\n")
        spelled = "\n".join(line if line.startswith(("usemtl", "o ", "g ")) else line + " # usemtl x" for line in lines)
    meshes, expected = load_obj(spelled).meshes, load_obj(text).meshes
    assert [mesh.name for mesh in meshes] == [mesh.name for mesh in expected]
    for mesh, twin in zip(meshes, expected, strict=True):
        np.testing.assert_array_equal(triangles(mesh), triangles(twin))
        assert (mesh.normals is None) == (twin.normals is None)


# --- what is recovered --------------------------------------------------------------------------------------


def test_file_normals_beside_texture_coordinates():
    text = POINTS + "vn 0 0 2\nvn 0 3 0\nvt 0 0\nvt 1 0\nf 1/1/1 2/2/1 3/1/2\nf 1/2/2 3/1/2 4/1/1\n"
    (mesh,) = load_obj(text).meshes
    assert mesh.n_vertex == 4  # no copies at the seam of texture coordinates
    assert mesh.normals.tolist() == [[[0, 0, 1], [0, 0, 1], [0, 1, 0]], [[0, 1, 0], [0, 1, 0], [0, 0, 1]]]
    assert mesh.uv.shape == (2, 3, 2)


def test_texture_coordinates_without_a_seam_belong_to_vertices():
    (mesh,) = load_obj(POINTS + "vt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\nf 2/2 1/1 3/3\n").meshes
    assert mesh.uv.tolist() == [[0, 0], [1, 0], [1, 1]]


def test_zero_normals_are_computed_from_the_faces():
    facts = []
    text = POINTS + "vn 0 0 0\nvn 0 1 0\nf 1//1 2//2 3//2\n"
    (mesh,) = load_obj(text, log=facts.append).meshes
    assert mesh.normals.tolist() == [[[0, 0, 1], [0, 1, 0], [0, 1, 0]]]
    assert any("1 file normals are zero" in fact for fact in facts)


def test_partial_normals_are_not_used():
    (mesh,) = load_obj(POINTS + "vn 0 0 1\nf 1//1 2//1 3//1\nf 1 3 4\n").meshes
    assert mesh.normals is None and mesh.n_face == 2


@pytest.mark.parametrize("word", ["off", "0", "none", "-1"])
def test_no_smoothing_group(word):
    assert load_obj(POINTS + f"s {word}\nf 1 2 3\n").meshes[0].smoothing is None


def test_smoothing_group_holds_until_the_next():
    (mesh,) = load_obj(POINTS + "f 1 2 3\ns 2\nf 1 3 4\nf 2 5 3\ns off\nf 1 2 7\n").meshes
    assert mesh.smoothing.tolist() == [0, 2, 2, 0]


def test_polygons_of_quads_come_in_the_order_of_the_file():
    (mesh,) = load_obj(POINTS + "f 1 2 3 4\nf 2 5 6 3\n").meshes
    assert mesh.polygons.tolist() == [0, 0, 1, 1]
    assert mesh.faces.tolist() == [[0, 1, 2], [2, 3, 0], [1, 4, 5], [5, 2, 1]]


def test_triangles_have_no_polygons():
    assert load_obj(POINTS + "f 1 2 3\nf 1 3 4\n").meshes[0].polygons is None


def test_points_lines_and_short_faces_are_left_out():
    (mesh,) = load_obj(POINTS + "p 1\nl 1 2 3\nf 1 2\nf 1 2 3\nf 1 2 3 4\n").meshes
    assert mesh.n_face == 3


def test_vertex_colors_are_srgb_and_multiply_white():
    text = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 0.5\nf 1 2 3\n"
    (mesh,) = load_obj(text).meshes
    np.testing.assert_allclose(mesh.colors[:2, :3], [[1, 0, 0], [0, 1, 0]])
    assert 0.20 < mesh.colors[2, 2] < 0.23  # 0.5 decoded
    assert mesh.material.diffuse == (1.0, 1.0, 1.0)


def test_rows_of_several_lengths_and_vertices_that_nobody_uses():
    """Weights behind some places, what C writes for no number, colours for some vertices only."""
    text = "v 0 0 0 1\nv 1 0 0\nv 1 1 0 0.5 0.5\nv -nan(ind) 1.#QNAN nan\nv 0 1 0 1 0 0\nf 1 2 3\nf 1 3 5\n"
    (mesh,) = load_obj(text).meshes
    assert mesh.n_vertex == 4 and mesh.n_face == 2 and mesh.colors is None
    (mesh,) = load_obj("v 0 0 0 255 0 51\nv 1 0 0 255 0 51 9 9\nv 1 1 0 255 0 51 1\nf 1 2 3\n").meshes
    np.testing.assert_allclose(mesh.colors[:, :3], [(1, 0, 0.0331)] * 3, atol=1e-4)


@pytest.mark.parametrize(
    "line",
    [
        "f 1// 2// 3// 4//",
        "f 1/ 2/ 3/ 4/",
        "f 1/2/ 2/1/ 3/1/ 4/1/",
        "f 1// 2/2/ 3/1 4",
        "f -8// -7/ -6 4 # f 9 9 9",
        "f 1 2 \\\n3 4",
    ],
)
def test_corners_written_short(line):
    (mesh,) = load_obj(POINTS + "vt 0 0\nvt 1 0\n" + line + "\n").meshes
    assert mesh.n_face == 2 and triangles(mesh)[0].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]


def test_concave_faces_are_drawn_as_they_are():
    """An L of area 28, with normals and texture coordinates that stay with their corners."""
    ell = [(0, 0), (8, 0), (8, 2), (2, 2), (2, 8), (0, 8)]
    text = "".join(f"v {x} {y} 0\nvt {x / 8} {y / 8}\n" for x, y in ell) + "vn 0 0 1\n"
    for first in range(6):
        words = [f"{(k + first) % 6 + 1}/{(k + first) % 6 + 1}/1" for k in range(6)]
        (mesh,) = load_obj(text + "f " + " ".join(words) + "\n").meshes
        corners = triangles(mesh)
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
        assert abs(area - 28) < 1e-12
        uv = mesh.uv if mesh.uv.ndim == 3 else mesh.uv[mesh.faces]
        np.testing.assert_array_equal(uv, corners[..., :2] / 8)


def test_long_lines_take_no_square_of_their_length(tmp_path):
    """Blanks, slashes and names of half a million letters: done at once, or not within the hour."""
    n = 500_000
    path = tmp_path / "long.obj"
    lines = ["mtllib a" + " " * n + "b", "mtllib " + "a/" * n, "usemtl x" + " " * n + "y", "#" * n, " " * n + "# c"]
    lines += ["mtllib " + " ".join(f"m{k}" for k in range(n // 10))]
    lines += ["o " + " " * n + "x", "g" + " " * n, "s " + " " * n + "1"]
    path.write_text("\n".join(lines) + "\n" + POINTS + "f 1 2 3" + " " * n + "\n")
    with pytest.warns(UserWarning, match="names .* material files; the first 256"):
        assert load(path).n_face == 1


# --- materials ----------------------------------------------------------------------------------------------


def load_with_mtl(folder, mtl, text=POINTS + "usemtl a\nf 1 2 3\n", **options):
    (folder / "m.mtl").write_text(mtl)
    (folder / "model.obj").write_text("mtllib m.mtl\n" + text)
    return load(folder / "model.obj", **options)


@pytest.mark.parametrize(
    ("mtl", "expected"),
    [
        ("Kd 0.001 0.5 1", Material(diffuse=(0.001, 0.5, 1), specular=0)),
        ("Kd 0.5", Material(diffuse=0.5, specular=0)),
        ("Ka 0.1 0.2 0.3\nKd 1 0 0", Material(ambient=(0.1, 0.2, 0.3), diffuse=(1, 0, 0), specular=0)),
        ("Kd 1 1 1\nKs 0.3 0.3 0.3\nNs 96.5", Material(diffuse=1, specular=0.3, shininess=96.5)),
        ("Kd 1 1 1\nKs 1 1 1\nillum 1", Material(diffuse=1, specular=0)),
        (
            "Ka 1 1 1\nKd 0.5 0 0\nKs 1 1 1\nKe 0 0 2\nillum 0",
            Material(ambient=0, diffuse=0, specular=0, emissive=(0.5, 0, 2)),
        ),
        ("Kd 0 0 0\nKe 1 2 3", Material(diffuse=0, specular=0, emissive=(1.0, 2, 3))),
        ("d 0.25", Material(specular=0, opacity=0.25)),
        ("Tr 0.25", Material(specular=0, opacity=0.75)),
        ("Tr 0.25\nd 1", Material(specular=0)),
        ("d -halo 0.5", Material(specular=0, opacity=0.5)),
        ("  KD\t0.5 0.5 0.5 # grey", Material(diffuse=0.5, specular=0)),
        ("", Material(specular=0)),
    ],
)
def test_material(tmp_path, mtl, expected):
    material = load_with_mtl(tmp_path, "newmtl a\n" + mtl).meshes[0].material
    assert material.name == "a"
    for field in ("ambient", "diffuse", "specular", "shininess", "emissive", "opacity"):
        assert getattr(material, field) == getattr(expected, field), field


def test_materials_come_in_the_order_of_first_use_whatever_they_are_called(tmp_path):
    names = ["Plain", "two  blanks", "0", "a#b", "Grün", "unused"]
    mtl = "".join(f"newmtl {name}\nKd {k / 8} 0 0\n" for k, name in enumerate(names))
    text = POINTS + "f 1 2 3\n" + "".join(f"usemtl {name}\nf 1 2 {k + 3}\n" for k, name in enumerate(names[:5]))
    text += "usemtl Plain\nf 2 3 8\n"
    (mesh,) = load_with_mtl(tmp_path, mtl, text).meshes
    assert [material.name for material in mesh.palette] == ["", *names[:5]]
    assert [material.diffuse[0] for material in mesh.palette[1:]] == [0, 1 / 8, 2 / 8, 3 / 8, 4 / 8]
    assert mesh.face_material.tolist() == [0, 1, 2, 3, 4, 5, 1]


def test_normals_go_across_the_borders_of_materials_and_groups():
    """Two triangles that meet in an edge share its vertices, whatever lies between their lines."""
    (mesh,) = load_obj(POINTS + "g p\nusemtl a\nf 1 2 3\ng q\nusemtl b\nf 1 3 4\n").meshes
    assert mesh.n_vertex == 4 and mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.face_material.tolist() == [0, 1] and mesh.name == ""


def test_each_object_is_a_mesh_with_the_vertices_that_it_uses():
    text = POINTS + "o left\nusemtl a\nf 1 2 3\no right\nf 2 5 6 3\no left\nf 7 8 1\n"
    meshes = load_obj(text).meshes
    assert [mesh.name for mesh in meshes] == ["left", "right", "left"]
    assert [mesh.n_vertex for mesh in meshes] == [3, 4, 3]
    assert [mesh.material.name for mesh in meshes] == ["a", "a", "a"]
    assert meshes[1].polygons.tolist() == [0, 0] and meshes[0].polygons is None
    assert meshes[2].vertices.tolist() == [[0, 0, 0], [0.5, -1, 0], [3, 1, 2]]


def test_an_object_far_apart_in_the_file():
    text = "".join(f"v {k} {k * k} 0\n" for k in range(100)) + "o a\nf 1 50 100\n"
    (mesh,) = load_obj(text).meshes
    assert mesh.vertices[:, 0].tolist() == [0, 49, 99]


def test_the_only_group_names_a_file_without_objects():
    assert load_obj(POINTS + "g wing\nf 1 2 3\n").meshes[0].name == "wing"


def test_several_libraries_and_names_with_blanks(tmp_path):
    for name, material in (("one.mtl", "a"), ("two.mtl", "b"), ("my file.mtl", "c")):
        (tmp_path / name).write_text(f"newmtl {material}\nKd 0.25 0 0\n")
    uses = "".join(f"usemtl {name}\nf 1 2 3\n" for name in "abc")
    path = tmp_path / "model.obj"
    path.write_text(f"mtllib one.mtl two.mtl\nmtllib my file.mtl\n{POINTS}{uses}")
    assert [material.diffuse[0] for material in load(path).meshes[0].palette] == [0.25] * 3


def test_missing_library_is_warned_of_and_named(tmp_path):
    path = tmp_path / "model.obj"
    path.write_text(f"mtllib gone.mtl\n{POINTS}usemtl a\nf 1 2 3\n")
    with pytest.warns(UserWarning, match=r"model\.obj: material file 'gone\.mtl' not found"):
        (mesh,) = load(path).meshes
    assert mesh.material.diffuse == Material().diffuse and mesh.material.name == "a"


def test_missing_material_is_warned_of_and_named(tmp_path):
    with pytest.warns(UserWarning, match="no definition of material 'a'"):
        load_with_mtl(tmp_path, "newmtl b\n")


# --- faults -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (POINTS + "f 1 2 9\n", r":9: face refers to vertex 9, the file has 8$"),
        (POINTS + "f 1 2 3\nf 1/1 2/1 99/1\n", r":10: face refers to vertex 99, the file has 8$"),
        (POINTS + "f 0 1 2\n", r":9: face refers to vertex 0, the first one is 1$"),
        (POINTS + "f 1 2 -9\n", r":9: face refers to vertex -9, only 8 stand before it$"),
        ("v 0 0 0\nf 1 2 -2\nv 1 0 0\nv 1 1 0\n", r":2: face refers to vertex -2, only 1 stand before it$"),
        (POINTS + "vn 0 0 1\nf 1//1 2//1 3//2\n", r":10: face refers to normal 2, the file has 1$"),
        pytest.param(POINTS + "f 1 2 3.5/1\n", r":9: '3\.5/1' is not a corner of a face", id="fraction"),
        (POINTS + f"f 1 2 {'9' * 5000}\n", r":9: '9+' is not a corner of a face"),
        (
            POINTS + f"s {'9' * 5000}\nf 1//1 2 {'9' * 5000}\n",
            r":10: face refers to normal 1, the file has 0$",
        ),
        (POINTS + "f 1 2 x\n", r":9: 'x' is not a corner of a face"),
        (POINTS + "f 1 2 3\nv 1 abc 2\n", r":10: 'abc' is not a number$"),
        ("v 0 0\nv 1 0\nv 1 1\nf 1 2 3\n", r":1: a vertex has 2 numbers, 3 are needed$"),
        (POINTS + "vn 0 0\nf 1//1 2//1 3//1\n", r":9: a normal has 2 numbers, 3 are needed$"),
        ("# c\r\n\r\nv 0 0 0\r\nv 1 0 0 \\\r\n\r\nv x 1 0\r\nf 1 2 3\r\n", r":6: 'x' is not a number$"),
        (POINTS, r": a point cloud: 8 points, no faces$"),
        (POINTS + "p 1 2\np 3\n", r": a point cloud: 3 points, no faces$"),
        (POINTS + "f 1 2\n", r": nothing but lines: 1 line, no faces$"),
        ("f 1 2 3\n", r":1: face refers to vertex 1, the file has 0$"),
        (POINTS + "l 1 2\nl 2 3 4\np 1\n", r": nothing but lines: 2 lines, no faces$"),
        ("hello world\n", r": no faces$"),
        (POINTS + "f 1 1 2\nf 3 3 3\n", r"every face has zero area"),
        ("v nan 0 0\nv inf 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 2 3 4\n", r"2 of 4 vertices .* not finite"),
    ],
)
def test_fault_names_the_line(tmp_path, text, fault):
    path = tmp_path / "broken.obj"
    path.write_bytes(text.encode())
    with pytest.raises(ModelError, match=r"broken\.obj" + fault if fault[0] == ":" else fault) as caught:
        load(path)
    assert str(caught.value).startswith(str(path))


def test_faces_that_are_not_finite_can_be_dropped():
    text = POINTS + "v nan 0 0\nf 1 2 3\nf 1 2 9\nf 1 3 4\n"
    assert load_obj(text, drop_bad_faces=True).meshes[0].n_face == 2


@pytest.mark.parametrize("keyword", ["usemtl", "o"])
def test_a_degenerate_part_stays_so_that_the_others_keep_their_numbers(keyword):
    text = POINTS + f"{keyword} a\nf 1 1 1\n{keyword} b\nf 1 2 3\n{keyword} c\nf 2 2 2\nf 3 3 3\n"
    (mesh,) = load_obj(text).meshes
    assert mesh.n_face == 4 and mesh.faces[1].tolist() == [0, 1, 2]
    assert mesh.name == ("b" if keyword == "o" else "")


def test_unknown_texture_coordinates_are_not_a_fault():
    assert load_obj(POINTS + "vt 0.5 0\nf 1/1 2/7 3/1\n").meshes[0].uv is None


def test_names_in_another_encoding():
    text = b"# Gr\xfc\xdfe\nusemtl Gr\xfcn\n" + POINTS.encode() + b"f 1 2 3\n"
    with pytest.warns(UserWarning):
        assert load(text, format="obj").meshes[0].material.name == "Grün"
