"""Loading: every format, every kind of source, what is kept of a file, errors that name it, and what is said of files
that no reader takes, or that aren't what their names say."""

import gzip
import io
import json
import pathlib

import numpy as np
import pytest
import trimesh
from helpers.model_bytes import GLB, box, embedded_gltf, exported, gltf_with
from helpers.refusals import assert_refused

from rasterizer.errors import ModelError, SceneError
from rasterizer.io.formats import FORMATS, find
from rasterizer.io.loader import demo_model, load
from rasterizer.scene.lights import headlight
from rasterizer.scene.material import Material

MODELS = pathlib.Path(__file__).parents[2] / "models"


def only_mesh(source, **options):
    (mesh,) = load(source, **options).meshes
    return mesh


def sorted_triangles(vertices, faces):
    rows = np.round(np.asarray(vertices, np.float64)[np.asarray(faces)].reshape(-1, 9), 6)
    return rows[np.lexsort(rows.T)]


# --- formats and sources ------------------------------------------------------------------------------------


@pytest.mark.parametrize("format", ["obj", "stl", "ply", "off", "glb"])
def test_every_format_from_every_kind_of_source(tmp_path, format):
    data = exported(box(), format)
    path = tmp_path / f"Box.{format.upper()}"
    path.write_bytes(data)
    expected = sorted_triangles(box().vertices, box().faces)
    with path.open("rb") as opened:
        for source in (path, str(path), opened, io.BytesIO(data), data, bytearray(data), memoryview(data)):
            is_named = source is path or source is opened or isinstance(source, str)
            scene = load(source, format=None if is_named else format)
            (mesh,) = scene.meshes
            np.testing.assert_array_equal(sorted_triangles(mesh.vertices, mesh.faces), expected)
            assert mesh.n_vertex == 8 and scene.up == ("z" if format == "stl" else "y")
            assert mesh.normals is None, "trimesh would compute some"
            assert mesh.material == Material() or format == "glb"
    if format != "glb":
        text = exported(
            box(), "stl_ascii" if format == "stl" else format, **{"encoding": "ascii"} if format == "ply" else {}
        )
        assert only_mesh(io.StringIO(text.decode()), format=format).n_face == 12


def test_plain_arrays_meshes_and_scenes():
    vertices, faces = [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]
    mesh = only_mesh((vertices, faces), crease_angle=10)
    assert mesh.n_face == 1 and mesh.crease_angle == 10
    assert only_mesh(mesh) is mesh
    assert only_mesh(mesh, crease_angle=20).crease_angle == 20
    scene = load(mesh)
    assert load(scene) is scene
    assert load(scene, up="z").up == "z"
    assert load(scene, crease_angle=5).meshes[0].crease_angle == 5
    bad = (np.array([*vertices, (np.nan, 0, 0)]), [(0, 1, 2), (0, 1, 3)])
    assert only_mesh(bad, drop_bad_faces=True).n_face == 1
    scene = load(exported(box(), "stl"), format="STL", up="-x", lights=headlight(), background="red", crease_angle=1)
    assert scene.up == "-x" and len(scene.lights) == len(headlight()) and scene.background == (1.0, 0.0, 0.0)
    assert scene.meshes[0].crease_angle == 1


def two_boxes(turn=None):
    """A box, turned or moved by 5, and the same again, moved by 10."""
    scene, translation = trimesh.Scene(), trimesh.transformations.translation_matrix
    scene.add_geometry(box(), geom_name="box", transform=translation((5, 0, 0)) if turn is None else turn)
    scene.graph.update(frame_from="world", frame_to="again", geometry="box", matrix=translation((10, 0, 0)))
    return scene


# --- what a file holds --------------------------------------------------------------------------------------


def test_gltf_nodes_are_placed_and_instances_repeated():
    scene = two_boxes(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 0, 1), (0, 0, 0)))
    for format, data in (("glb", exported(scene, "glb")), ("gltf", json.dumps(embedded_gltf(scene)).encode())):
        boxes = sorted(mesh.bounds.tolist() for mesh in load(data, format=format).meshes)
        expected = [[(-1, -0.5, -1.5), (1, 0.5, 1.5)], [(9.5, -1, -1.5), (10.5, 1, 1.5)]]
        np.testing.assert_allclose(boxes, expected, err_msg=format)


def test_gltf_normals_are_used_and_vertices_joined_where_a_crease_angle_is_asked_for():
    flat = box()
    flat.unmerge_vertices()
    normals = np.repeat(flat.face_normals, 3, 0)
    soup = trimesh.Trimesh(flat.vertices, flat.faces, vertex_normals=normals, process=False)
    data = trimesh.Scene(soup).export(file_type="glb", include_normals=True)
    mesh = only_mesh(data, format="glb")
    assert mesh.n_vertex == 36 and mesh.normals.shape == (36, 3)
    mesh = only_mesh(data, format="glb", crease_angle=30)
    assert mesh.n_vertex == 8 and mesh.normals.shape == (12, 3, 3)


def test_gltf_with_files_beside_it(tmp_path):
    for name, data in trimesh.Scene(box()).export(file_type="gltf").items():
        (tmp_path / name).write_bytes(data)
    path = tmp_path / "model.gltf"
    assert only_mesh(path).n_face == 12
    with pytest.raises(ModelError, match="given without a folder"):
        load(path.read_bytes(), format="gltf")
    for beside in tmp_path.glob("*.bin"):
        beside.unlink()
    with pytest.raises(ModelError, match=r"model\.gltf: needs the file '.*\.bin'"):
        load(path)


def test_facts_are_logged():
    def facts_of(data, format, **options):
        facts = []
        load(data, format=format, log=facts.append, **options)
        return facts[-1].removeprefix("model: ")

    data = exported(box(), "ply", vertex_normal=True)
    assert facts_of(data, "ply") == "12 faces, file normals used"
    not_used = "12 faces, file normals not used: crease angle 30 asked for"
    assert facts_of(data, "ply", crease_angle=30) == not_used
    square = b"v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 1 1 0 1 0 0\nv 0 1 0 1 0 0\nvt 0 0\n"
    said = "2 faces, polygons with more than 3 corners, vertex colours, no file normals; not used: texture coordinates"
    assert facts_of(square + b"f 1/1 2/1 3/1 4/1\n", "obj") == said
    said = "2 faces, 2 meshes, vertex colours, smoothing groups used; not used: 1 point, 2 lines"
    assert facts_of(square + b"p 1\nl 1 2\nl 2 3\no a\ns 1\nf 1 2 3\no b\nf 1 2 4\n", "obj") == said


# --- faults -------------------------------------------------------------------------------------------------


def test_faults_of_the_source_and_its_path(tmp_path):
    (tmp_path / "folder.obj").mkdir()
    (tmp_path / "model").write_text("v 0 0 0")
    assert_refused(load, [
        (tmp_path / "gone.obj", r"gone\.obj: no such file"),
        (tmp_path / "folder.obj", r"folder\.obj: is a folder"),
        (tmp_path / "model.xyz", "unknown format 'xyz'; readable are obj, stl, ply, off, glb, .*, 3dxml, xaml"),
        (tmp_path / "nothing", "nothing: no such file"),
        (tmp_path / "model", "format is unknown without a suffix"),
        (b"v 0 0 0", "format is unknown without a suffix"),
        ("a\0b.obj", "can't be read"),
        *((source, "") for source in (3, None, [], {}, object())),
    ], ModelError)  # fmt: skip
    with pytest.raises(SceneError, match="format must be text"):
        load(b"v 0 0 0", format=3)
    for data, format in ((b"OFF\n3 2 0\n", "off"), (gltf_with(lambda tree, _: tree["accessors"].clear()), "gltf")):
        with pytest.raises(ModelError) as caught:
            load(data, format=format)
        assert str(caught.value).count("model:") == 1, caught.value


def test_entries_are_whole_and_say_which_are_no_text(tmp_path):
    assert [name for name, entry in FORMATS.items() if entry.is_binary] == ["glb", "3mf", "zae", "3dxml"]
    for name, entry in FORMATS.items():
        assert entry.name == name and callable(entry.read()) and find(f".{name.upper()}") is entry
        if entry.is_binary:
            path = tmp_path / f"a.{name}"
            path.write_text("text")
            said = f"{name} is no text; open the file with mode 'rb'"
            with path.open() as opened, pytest.raises(ModelError, match=said):
                load(opened)


# --- files that aren't what their names say -----------------------------------------------------------------

GOOD = {
    "obj": exported(box(), "obj"), "stl": exported(box(), "stl"), "ply": exported(box(), "ply"),
    "off": exported(box(), "off"), "glb": GLB, "gltf": gltf_with(),
}  # fmt: skip


def loader(folder, format):
    """A function that loads data under the name of a format."""

    def load_part(data):
        (folder / f"part.{format}").write_bytes(data)
        return load(folder / f"part.{format}")

    return load_part


@pytest.mark.parametrize("format", [name for name, entry in FORMATS.items() if not entry.is_scene])
def test_what_is_no_model_of_its_name_is_told(tmp_path, format):
    load_part = loader(tmp_path, format)
    for content, data in GOOD.items():
        if content == format:
            assert load_part(data).n_face == 12
            continue
        said = f"; by its content it is {content}: --input-format {content}, or"
        assert_refused(load_part, [(data, said)], ModelError, f"{tmp_path}")
        assert load(tmp_path / f"part.{format}", format=content).n_face == 12
    step = b"ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('x'),'2;1');\n" + b"#1=POINT();\n" * 9
    hints = [
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:ab\nsize 9\n", "a Git LFS pointer, .*git lfs pull"),
        (b"<!DOCTYPE html>\n<html><body>Not Found</body></html>" + b" " * 99, "an HTML page, perhaps of a download"),
        (b"\n<HTML>" + b"x" * 200, "an HTML page"),
        (gzip.compress(GOOD["obj"]), "compressed: unpack it first"),
        (step, "a STEP file: .*export STL"),
        (b"Kaydara FBX Binary  \0" + b"\x1a\0" * 90, "an FBX file: export glTF"),
        (b"BLENDER-v280" + b"\0" * 200, "a Blender file"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".encode("utf-16"), "UTF-16: save it as UTF-8"),
        (b"", "the file is empty$"), (b" \n\t", "the file is empty$"),
        *((data, "") for data in (b"\0" * 100, b"hello world\n", b"\xff\xfe\x80\x81" * 50, b"[[[[[[")),
    ]  # fmt: skip
    cases = [(data, f"^(?!.*by its content).*{hint}") for data, hint in hints]
    assert_refused(load_part, cases, ModelError, f"{tmp_path}/part.{format}: ")
    if format in GOOD:
        said = "^(?!.*(by its content|the file is (?!cut)))"
        half = GOOD[format][: len(GOOD[format]) // 2]
        try:
            load_part(half)
        except ModelError:
            assert_refused(load_part, [(half, said)], ModelError)


def test_a_suffix_that_no_reader_takes_says_what_to_do(tmp_path):
    hints = {
        "STEP": "export STL, 3MF or OBJ", "fbx": "export glTF", "zip": "unpack it", "las": "a point cloud has no",
        "mtl": "give that one", "png": "outputs stand behind -o",
    }  # fmt: skip
    said = "unknown format '{}'; readable are .*; .*{}"
    cases = [(tmp_path / f"part.{suffix}", said.format(suffix.lower(), hint)) for suffix, hint in hints.items()]
    assert_refused(load, cases, ModelError)


# --- the model that comes with the package ------------------------------------------------------------------


def test_the_demo_model_is_the_gallerys():
    for path in (demo_model(), demo_model().with_suffix(".mtl")):
        assert path.read_bytes() == (MODELS / path.name).read_bytes(), "run models/make_models.py"


def test_the_demo_model_loads_with_all_its_materials(recwarn):
    scene = load(demo_model())
    assert not recwarn.list
    assert scene.n_face == 5198 and len({material.name for mesh in scene.meshes for material in mesh.palette}) == 7


# --- what is not taken for granted --------------------------------------------------------------------------


def test_bad_faces_of_trimesh_objects_are_dropped_where_asked():
    soup = box()
    soup.vertices[0] = np.nan
    with pytest.raises(ModelError, match="finite"):
        load(soup)
    assert 0 < only_mesh(soup, drop_bad_faces=True).n_face < 12
    assert 0 < only_mesh([trimesh.Scene(soup)], drop_bad_faces=True).n_face < 12


@pytest.mark.parametrize("n", [99, 60_000])  # vertices that are looked at one after the other, and on threads
@pytest.mark.parametrize("format", ["stl", "ply", "glb"])
def test_signalling_nans_are_refused_without_a_word_of_numpy(format, n, recwarn):
    points = np.random.default_rng(0).normal(size=(n, 3)).astype(np.float32)
    soup = trimesh.Trimesh(points, np.arange(n).reshape(-1, 3), process=False)
    data = soup.export(file_type=format).replace(points[5, 1].tobytes(), b"\x01\0\x80\x7f")
    with pytest.raises(ModelError, match="1 of .* not finite"):
        load(data, format=format)
    assert only_mesh(data, format=format, drop_bad_faces=True).n_face == n // 3 - 1
    assert not [str(warning.message) for warning in recwarn]


def test_an_open_file_names_others_as_its_path_does(tmp_path):
    (tmp_path / "wood.mtl").write_text("newmtl red\nKd 1 0 0\n")
    (tmp_path / "in").mkdir()
    path = tmp_path / "in" / "a.obj"
    path.write_text("mtllib ../wood.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    read = []
    with open(path, "rb") as stream:
        (mesh,) = load(stream, allow_outside=True, files_read=read).meshes
    assert mesh.material.diffuse == (1, 0, 0) and len(read) == 1
