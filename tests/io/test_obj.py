"""OBJ files: what is recovered of them, materials, and errors that name the line."""

import warnings

import numpy as np
import pytest
from helpers.naive_obj import naive_read
from helpers.refusals import assert_refused
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


def mesh_of(lines, **options):
    (mesh,) = load_obj(POINTS + lines, **options).meshes
    return mesh


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
    forms = st.sampled_from(["{v}", "{v}/{vt}", "{v}//{vn}", "{v}/{vt}/{vn}"])
    form = draw(forms)
    sizes = st.integers(3, 6) if draw(st.booleans()) else st.just(draw(st.integers(3, 6)))

    def index(count):
        number = draw(st.integers(1, count))
        return number - count - 1 if may_be_negative and draw(st.booleans()) else number

    for _ in range(draw(st.integers(1, 8))):
        if draw(st.integers(0, 2)) == 0:
            words = ["usemtl a", "usemtl b", "o a", "o b", "g x", "s 1", "s 3", "s off", "s 0"]
            lines.append(draw(st.sampled_from(words)))
        form = draw(forms) if is_mixed else form
        corners = draw(st.permutations(range(1, n_v + 1)))[: draw(sizes)]
        if may_be_negative:
            corners = [k - n_v - 1 if draw(st.booleans()) else k for k in corners]
        lines.append("f " + " ".join(form.format(v=k, vt=index(n_vt), vn=index(n_vn)) for k in corners))
    return "\n".join(lines) + "\n"


def unit(normals):
    normals = np.array(normals)
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


@settings(max_examples=80, deadline=None)
@given(obj_texts())
def test_every_mixture_is_read_like_the_naive_reader_does(text):
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
            plain = [[(0, 0) if pair is None else pair for pair in each] for each in part["uv"]]
            np.testing.assert_array_equal(uv, plain)
        given = [normal for corners in part["normals"] for normal in corners]  # the others are computed
        assert (mesh.normals is not None) == any(given)
        if any(given):
            normals = (mesh.normals if mesh.normals.ndim == 3 else mesh.normals[mesh.faces]).reshape(-1, 3)
            is_given = [normal is not None for normal in given]
            np.testing.assert_allclose(normals[is_given], unit(list(filter(None, given))), atol=1e-12)
            np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)
        assert (mesh.smoothing is not None) == any(part["groups"])
        assert mesh.smoothing is None or mesh.smoothing.tolist() == part["groups"]
        assert (mesh.polygons is not None) == (part["n"] < len(part["polygons"]))
        assert mesh.polygons is None or mesh.polygons.tolist() == part["polygons"]


# --- what is recovered --------------------------------------------------------------------------------------


def test_what_a_face_names_and_the_file_does_not_have_is_left_out_and_warned_of():
    cases = {
        "vt 0.5 0\nf 1/1 2/7 3/1\n": "1 face with texture coordinates that the file doesn't have: drawn without",
        "f 1/1 2/2 3/3\nf 1/-1 2 3\n": "2 faces with texture coordinates that",
        "vn 0 0 1\nf 1//1 2//1 3//2\n": "1 face with normals that the file doesn't have",
        "f 1//1 2//2 3//3\nf 1 2 4\n": "1 face with normals that",
    }
    for lines, said in cases.items():
        with pytest.warns(UserWarning, match=said):
            (mesh,) = load((POINTS + lines).encode(), format="obj").meshes
        assert mesh.uv is None and (mesh.normals is None) == ("vn" not in lines), lines


def test_vertex_colors_are_srgb_and_multiply_white():
    (mesh,) = load_obj("v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 0.5\nf 1 2 3\n").meshes
    np.testing.assert_allclose(mesh.colors[:, :3], [[1, 0, 0], [0, 1, 0], [0, 0, 0.215861]], atol=1e-6)
    assert mesh.material.diffuse == (1.0, 1.0, 1.0)
    (mesh,) = load_obj("v 0 0 0 255 0 51\nv 1 0 0 255 0 51 9 9\nv 1 1 0 255 0 51 1\nf 1 2 3\n").meshes
    np.testing.assert_allclose(mesh.colors[:, :3], [(1, 0, 0.0331)] * 3, atol=1e-4)


def test_rows_of_several_lengths_and_vertices_that_nobody_uses():
    """Weights behind some places, places that are no number, colours for some vertices only."""
    text = "v 0 0 0 1\nv 1 0 0\nv 1 1 0 0.5 0.5\nv -nan nan nan\nv 0 1 0 1 0 0\nf 1 2 3\nf 1 3 5\n"
    (mesh,) = load_obj(text).meshes
    assert mesh.n_vertex == 4 and mesh.n_face == 2
    np.testing.assert_array_equal(mesh.colors[:, :3], [(1, 1, 1)] * 3 + [(1, 0, 0)])


def test_each_object_is_a_mesh_with_the_vertices_that_it_uses():
    meshes = load_obj(POINTS + "o left\nusemtl a\nf 1 2 3\no right\nf 2 5 6 3\no left\nf 7 8 1\n").meshes
    assert [mesh.name for mesh in meshes] == ["left", "right", "left"]
    assert [mesh.n_vertex for mesh in meshes] == [3, 4, 3]
    assert [mesh.material.name for mesh in meshes] == ["a", "a", "a"]
    assert meshes[1].polygons.tolist() == [0, 0] and meshes[0].polygons is None
    assert meshes[2].vertices.tolist() == [[0, 0, 0], [0.5, -1, 0], [3, 1, 2]]
    text = "".join(f"v {k} {k * k} 0\n" for k in range(100)) + "o a\nf 1 50 100\n"  # far apart in the file
    assert load_obj(text).meshes[0].vertices[:, 0].tolist() == [0, 49, 99]
    assert mesh_of("g wing\nf 1 2 3\n").name == "wing", "the only group names a file without objects"
    mesh = mesh_of("g p\nusemtl a\nf 1 2 3\ng q\nusemtl b\nf 1 3 4\n")  # groups and materials share vertices
    assert mesh.n_vertex == 4 and mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.face_material.tolist() == [0, 1] and mesh.name == ""


def test_a_degenerate_part_stays_so_that_the_others_keep_their_numbers():
    for keyword, name in (("usemtl", ""), ("o", "b")):
        mesh = mesh_of(f"{keyword} a\nf 1 1 1\n{keyword} b\nf 1 2 3\n{keyword} c\nf 2 2 2\nf 3 3 3\n")
        assert (mesh.n_face, mesh.faces[1].tolist(), mesh.name) == (4, [0, 1, 2], name), keyword


# --- material libraries -------------------------------------------------------------------------------------


def test_of_many_libraries_the_first_are_looked_for(tmp_path):
    """Half a million letters of names: done at once, or not within the hour."""
    names = "a/" * 250_000, " ".join(f"m{k}" for k in range(50_000)), "a" + " " * 500_000 + "b"
    (tmp_path / "a.obj").write_text("".join(f"mtllib {name}\n" for name in names) + POINTS + "usemtl x\nf 1 2 3\n")
    with pytest.warns(UserWarning, match="names .* material files; the first 256"):
        assert load(tmp_path / "a.obj").n_face == 1


def test_materials_come_in_the_order_of_first_use_whatever_they_are_called(tmp_path):
    names = ["Plain", "two  blanks", "0", "a#b", "Grün", "unused"]
    (tmp_path / "m.mtl").write_text("".join(f"newmtl {name}\nKd {k / 8} 0 0\n" for k, name in enumerate(names)))
    text = "f 1 2 3\n" + "".join(f"usemtl {name}\nf 1 2 {k + 3}\n" for k, name in enumerate(names[:5]))
    (tmp_path / "model.obj").write_text(f"mtllib m.mtl\n{POINTS}{text}usemtl Plain\nf 2 3 8\n")
    (mesh,) = load(tmp_path / "model.obj").meshes
    assert [material.name for material in mesh.palette] == ["", *names[:5]]
    assert [material.diffuse[0] for material in mesh.palette[1:]] == [0, 1 / 8, 2 / 8, 3 / 8, 4 / 8]
    assert mesh.face_material.tolist() == [0, 1, 2, 3, 4, 5, 1]
    data = b"# Gr\xfc\xdfe\nusemtl Gr\xfcn\n" + POINTS.encode() + b"f 1 2 3\n"  # in another encoding
    with pytest.warns(UserWarning):
        assert load(data, format="obj").meshes[0].material.name == "Grün"


def test_libraries_are_found_by_names_with_blanks_or_missed_by_name(tmp_path):
    for name, material in (("one.mtl", "a"), ("two.mtl", "b"), ("my file.mtl", "c")):
        (tmp_path / name).write_text(f"newmtl {material}\nKd 0.25 0 0\n")
    path, uses = tmp_path / "model.obj", "".join(f"usemtl {name}\nf 1 2 3\n" for name in "abc")
    path.write_text(f"mtllib one.mtl two.mtl\nmtllib my file.mtl\n{POINTS}{uses}")
    assert [material.diffuse[0] for material in load(path).meshes[0].palette] == [0.25] * 3
    for library, said in (
        ("gone.mtl", r"model\.obj: material file 'gone\.mtl' not found"),
        ("two.mtl", "no definition of material 'a'"),
    ):
        path.write_text(f"mtllib {library}\n{POINTS}usemtl a\nf 1 2 3\n")
        with pytest.warns(UserWarning, match=said):
            (mesh,) = load(path).meshes
        assert mesh.material.diffuse == Material().diffuse and mesh.material.name == "a"


# --- faults -------------------------------------------------------------------------------------------------


def test_faults_name_the_line(tmp_path):
    path = tmp_path / "broken.obj"

    def read(text):
        path.write_bytes(text.encode())
        load(path)

    nines = "9" * 5000
    windows = "# c\r\n\r\nv 0 0 0\r\nv 1 0 0 \\\r\n\r\nv x 1 0\r\nf 1 2 3\r\n"
    assert_refused(read, [
        (POINTS + "f 1 2 9\n", "obj:9: face refers to vertex 9, the file has 8$"),
        (POINTS + "f 1 2 3\nf 1/1 2/1 99/1\n", "obj:10: face refers to vertex 99, the file has 8$"),
        (POINTS + "f 0 1 2\n", "obj:9: face refers to vertex 0, the first one is 1$"),
        (POINTS + "f 1 2 -9\n", "obj:9: face refers to vertex -9, only 8 stand before it$"),
        ("v 0 0 0\nf 1 2 -2\nv 1 0 0\nv 1 1 0\n", "obj:2: face refers to vertex -2, only 1 stand before it$"),
        (POINTS + "f 1 2 3.5/1\n", r"obj:9: '3\.5/1' is not a corner of a face"),
        (POINTS + f"f 1 2 {nines}\n", "obj:9: '9+ ... 9+' is not a corner of a face"),
        (POINTS + "f 1 2 3\nv 1 abc 2\n", "obj:10: 'abc' is not a number$"),
        ("v 0 0\nv 1 0\nv 1 1\nf 1 2 3\n", "obj:1: a vertex has 2 numbers, 3 are needed$"),
        (windows, "obj:6: 'x' is not a number$"),
        (POINTS, "obj: a point cloud: 8 points, no faces$"),
        (POINTS + "p 1 2\np 3\n", "obj: a point cloud: 3 points, no faces$"),
        (POINTS + "f 1 2\n", "obj: nothing but lines: 1 line, no faces$"),
        ("hello world\n", "no faces$"),
        (POINTS + "f 1 1 2\nf 3 3 3\n", "every face has zero area"),
        ("v nan 0 0\nv inf 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 2 3 4\n", r"2 of 4 vertices .* not finite"),
    ], ModelError, str(path))  # fmt: skip
    assert mesh_of("v nan 0 0\nf 1 2 3\nf 1 2 9\nf 1 3 4\n", drop_bad_faces=True).n_face == 2
