"""Tests of loading: every format, every kind of source, and what is kept of a file."""

import base64
import io
import json
import pathlib
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from helpers.model_bytes import GLB, PLY_HEADER, THREEMF, box, embedded_gltf, exported, gltf_with, threemf

from rasterizer.errors import ModelError
from rasterizer.io.loader import load
from rasterizer.io.threemf import MOST_UNPACKED
from rasterizer.scene.light_presets import headlight
from rasterizer.scene.material import Material
from rasterizer.scene.mesh import Mesh

MODELS = pathlib.Path(__file__).parents[2] / "models"
COMMITTED = sorted(path for path in MODELS.glob("*.*") if path.suffix in (".obj", ".stl", ".ply", ".glb"))
FORMATS = ("obj", "stl", "ply", "off", "glb")
FACE_COLORS = "property uchar red\nproperty uchar green\nproperty uchar blue\n"


def only_mesh(source, **options):
    (mesh,) = load(source, **options).meshes
    return mesh


def sorted_triangles(vertices, faces):
    rows = np.round(np.asarray(vertices, np.float64)[np.asarray(faces)].reshape(-1, 9), 6)
    return rows[np.lexsort(rows.T)]


# --- formats and sources ------------------------------------------------------------------------------------


@pytest.mark.parametrize("format", FORMATS)
def test_every_format_from_every_kind_of_source(tmp_path, format):
    data = exported(box(), format)
    path = tmp_path / f"Box.{format.upper()}"
    path.write_bytes(data)
    expected = sorted_triangles(box().vertices, box().faces)
    with path.open("rb") as opened:
        sources = [path, str(path), opened, io.BytesIO(data), data, bytearray(data), memoryview(data)]
        for source in sources:
            is_named = source is path or source is opened or isinstance(source, str)
            scene = load(source, format=None if is_named else format)
            np.testing.assert_array_equal(sorted_triangles(scene.meshes[0].vertices, scene.meshes[0].faces), expected)
            assert scene.meshes[0].n_vertex == 8
            assert scene.up == ("z" if format == "stl" else "y")


@pytest.mark.parametrize("format", ["obj", "ply", "off", "stl"])
def test_text_file_objects(format):
    options = {"ply": {"encoding": "ascii"}}.get(format, {})
    text = exported(box(), "stl_ascii" if format == "stl" else format, **options).decode()
    assert only_mesh(io.StringIO(text), format=format).n_face == 12


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


def test_trimesh_objects():
    scene = trimesh.Scene()
    scene.add_geometry(box(), geom_name="box", transform=trimesh.transformations.translation_matrix((5, 0, 0)))
    move = trimesh.transformations.translation_matrix((-5, 0, 0))
    scene.graph.update(frame_from="world", frame_to="again", geometry="box", matrix=move)
    assert only_mesh(box()).n_face == 12
    loaded = load(scene, crease_angle=40)
    assert [mesh.crease_angle for mesh in loaded.meshes] == [40, 40]
    np.testing.assert_allclose(loaded.bounds, [(-5.5, -1, -1.5), (5.5, 1, 1.5)])
    with pytest.raises(ModelError, match="no faces"):
        load(trimesh.Scene())


def test_settings_reach_the_scene():
    scene = load(exported(box(), "stl"), format="STL", up="-x", lights=headlight(), background="red", crease_angle=1)
    assert scene.up == "-x" and len(scene.lights) == len(headlight()) and scene.background == (1.0, 0.0, 0.0)
    assert scene.meshes[0].crease_angle == 1


@pytest.mark.parametrize("source", [3, None, [], {}, object()])
def test_other_sources_are_refused(source):
    with pytest.raises(ModelError):
        load(source)


def test_importing_and_reading_arrays_does_not_import_trimesh():
    code = "import sys, rasterizer.io.loader as l; l.load(([(0,0,0),(1,0,0),(0,1,0)], [(0,1,2)])); "
    code += "assert 'trimesh' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=pathlib.Path(__file__).parents[2])


@pytest.mark.parametrize("path", COMMITTED, ids=lambda path: path.name)
def test_committed_models_load(path):
    facts = []
    assert load(path, log=facts.append).n_face > 0
    assert facts[-1].startswith(f"{path}: ")


# --- what a file holds --------------------------------------------------------------------------------------


def test_stl_triangles_share_vertices_and_solids_stay_apart():
    assert only_mesh(exported(box(), "stl"), format="stl").n_vertex == 8
    one = exported(box(), "stl_ascii").decode()
    scene = load((one.replace("solid", "solid a") + one).encode("utf-8"), format="stl")
    assert [mesh.n_face for mesh in scene.meshes] == [12, 12]


@pytest.mark.parametrize("convention", ["viscam", "magics"])
def test_stl_colors(convention):
    data = bytearray(exported(box(), "stl"))
    red_green_blue = (31, 0, 10)
    for face in range(12):
        red, green, blue = red_green_blue if convention == "viscam" else red_green_blue[::-1]
        bits = red << 10 | green << 5 | blue | (0x8000 if convention == "viscam" else 0)
        data[84 + 50 * face + 48 : 84 + 50 * face + 50] = bits.to_bytes(2, "little")
    if convention == "magics":
        data[:10] = b"COLOR=\x10\x20\x30\xff"
        data[84 + 48 : 84 + 50] = b"\x00\x80"  # the first face has the colour of the part
    mesh = only_mesh(bytes(data), format="stl")
    expected = np.array([255, 0, 82], np.uint8)
    twin = Mesh(mesh.vertices, mesh.faces, face_colors=np.tile(expected, (12, 1)))
    np.testing.assert_allclose(mesh.face_colors[1:, :3], twin.face_colors[1:, :3])
    assert (convention == "magics") == bool((mesh.face_colors[0] != mesh.face_colors[1]).any())
    assert mesh.material.diffuse == (1.0, 1.0, 1.0)


def test_ply_normals_and_vertex_colors():
    source = box()
    source.visual.vertex_colors = np.arange(32, dtype=np.uint8).reshape(8, 4) * 8
    mesh = only_mesh(exported(source, "ply", vertex_normal=True), format="ply")
    assert mesh.normals.shape == (8, 3)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1)
    twin = Mesh(source.vertices, source.faces, colors=np.asarray(source.visual.vertex_colors))
    np.testing.assert_allclose(mesh.colors, twin.colors)
    assert mesh.material.diffuse == (1.0, 1.0, 1.0)


def test_ply_polygons_and_face_colors_come_in_the_order_of_the_file():
    header = PLY_HEADER.format(n_face=3, face_properties=FACE_COLORS)
    rows = "4 0 1 2 3 255 0 0\n3 0 1 2 0 255 0\n4 3 2 1 0 0 0 255\n"
    mesh = only_mesh((header + rows).encode(), format="ply")
    assert mesh.faces.tolist() == [[0, 1, 2], [2, 3, 0], [0, 1, 2], [3, 2, 1], [1, 0, 3]]
    assert mesh.polygons.tolist() == [0, 0, 1, 2, 2]
    assert mesh.face_colors[:, :3].tolist() == np.eye(3)[[0, 0, 1, 2, 2]].tolist()


def test_ply_polygons_of_every_size():
    header = PLY_HEADER.format(n_face=4, face_properties="")
    rows = "5 0 1 2 3 1\n3 0 1 2\n6 0 1 2 3 2 1\n4 3 2 1 0\n"
    mesh = only_mesh((header + rows).encode(), format="ply")
    assert mesh.polygons.tolist() == [0, 0, 0, 1, 2, 2, 2, 2, 3, 3]
    assert mesh.faces.tolist()[3] == [0, 1, 2] and mesh.faces.tolist()[8:] == [[3, 2, 1], [1, 0, 3]]


def test_ply_comment_in_another_encoding():
    data = PLY_HEADER.format(n_face=1, face_properties="comment von Jürgen\n").encode("latin-1") + b"3 0 1 2\n"
    assert only_mesh(data, format="ply").n_face == 1


def test_off_polygons_come_in_the_order_of_the_file():
    text = "OFF # c\n5 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n-1 0 0\n\n5 0 1 2 3 4\n3 0 1 2\n4 3 2 1 0\n"
    mesh = only_mesh(text.encode(), format="off")
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 2], [3, 2, 1], [1, 0, 3]]
    assert mesh.polygons.tolist() == [0, 0, 0, 1, 2, 2]


@pytest.mark.parametrize("format", ["glb", "gltf"])
def test_gltf_nodes_are_placed_and_instances_repeated(format):
    scene = trimesh.Scene()
    turn = trimesh.transformations.rotation_matrix(np.pi / 2, (0, 0, 1), (0, 0, 0))
    scene.add_geometry(box(), geom_name="box", transform=turn)
    move = trimesh.transformations.translation_matrix((10, 0, 0))
    scene.graph.update(frame_from="world", frame_to="again", geometry="box", matrix=move)
    data = exported(scene, "glb") if format == "glb" else json.dumps(embedded_gltf(scene)).encode()
    loaded = load(data, format=format)
    assert len(loaded.meshes) == 2
    boxes = sorted((mesh.bounds.tolist() for mesh in loaded.meshes), key=lambda bounds: bounds[0][0])
    np.testing.assert_allclose(boxes, [[(-1, -0.5, -1.5), (1, 0.5, 1.5)], [(9.5, -1, -1.5), (10.5, 1, 1.5)]])


def test_gltf_material_keeps_its_precision():
    def change(tree, primitive):
        surface = {"baseColorFactor": [0.001, 0.5, 1, 0.25], "metallicFactor": 1}
        material = {"pbrMetallicRoughness": surface, "emissiveFactor": [0, 0.003, 0], "name": "m"}
        tree["materials"] = [{}, material | {"alphaMode": "BLEND"}]
        primitive["material"] = 1

    material = only_mesh(gltf_with(change), format="gltf").material
    assert material.fresnel == material.ambient == (0.001, 0.5, 1.0) and material.diffuse == (0, 0, 0)
    assert (material.emissive, material.opacity, material.name) == ((0, 0.003, 0), 0.25, "m")


def add_accessor(tree, array, kind, component, normalized=False):
    """Append an array as a buffer of its own; return the number of its accessor."""
    uri = "data:;base64," + base64.b64encode(array.tobytes()).decode()
    tree["buffers"].append({"uri": uri, "byteLength": array.nbytes})
    tree["bufferViews"].append({"buffer": len(tree["buffers"]) - 1, "byteLength": array.nbytes})
    view = len(tree["bufferViews"]) - 1
    accessor = {"bufferView": view, "componentType": component, "count": len(array), "type": kind}
    tree["accessors"].append(accessor | {"normalized": normalized})
    return len(tree["accessors"]) - 1


@pytest.mark.parametrize(("dtype", "component", "scale"), [("<f4", 5126, 1), ("<u2", 5123, 65535), ("u1", 5121, 255)])
def test_gltf_colors_are_linear(dtype, component, scale):
    colors = (np.arange(24).reshape(8, 3) / 23 * scale).astype(dtype)

    def change(tree, primitive):
        primitive["attributes"]["COLOR_0"] = add_accessor(tree, colors, "VEC3", component, scale > 1)

    mesh = only_mesh(gltf_with(change), format="gltf")
    np.testing.assert_allclose(mesh.colors[:, :3], colors / scale, atol=1e-7)
    assert mesh.material.diffuse == (1.0, 1.0, 1.0)


def soup_box():
    """A box whose triangles share no vertices, with the triangles' normals."""
    flat = box()
    flat.unmerge_vertices()
    return trimesh.Trimesh(flat.vertices, flat.faces, vertex_normals=np.repeat(flat.face_normals, 3, 0), process=False)


def test_gltf_normals_are_used_and_vertices_joined_where_a_crease_angle_is_asked_for():
    data = trimesh.Scene(soup_box()).export(file_type="glb", include_normals=True)
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


def test_3mf_places_objects_by_components_and_build():
    scene = load(threemf(), format="3mf")
    assert scene.up == "z" and [mesh.name for mesh in scene.meshes] == ["tip"] * 3
    corners = [mesh.bounds.tolist() for mesh in scene.meshes]
    assert corners == [[[5, 10, 0], [7, 11, 1]], [[0, 10, 0], [1, 11, 1]], [[0, 0, 0], [1, 1, 1]]]
    elsewhere = '<model><resources/><build><item objectid="1" p:path="/3D/other.model" xmlns:p="p"/></build></model>'
    assert load(threemf(elsewhere, **{"3D/other.model": THREEMF}), format="3mf").n_face == 4


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("<model", "its XML: "),
        ('<!DOCTYPE model [<!ENTITY a "aaaa">]><model>&a;</model>', "document type is not legal"),
        (THREEMF.replace('<component objectid="1"/>', '<component objectid="2"/>'), "nested more than 100 deep"),
        (THREEMF.replace('objectid="1"', 'objectid="7"'), "there is no object '7'"),
        (THREEMF.replace('v1="0"', 'v1="9"'), "refers to vertex 9"),
        (THREEMF.replace('x="0"', 'x="zero"'), "could not convert"),
        (THREEMF.replace("1 0 10 0", "1 0 nan 0"), "12 finite numbers"),
        (THREEMF.replace("<item", "<thing"), "no faces"),
    ],
)
def test_3mf_files_that_are_broken(text, fault):
    with pytest.raises(ModelError, match=f"^model: .*{fault}"):
        load(threemf(text), format="3mf")


def test_3mf_objects_that_double_forty_times_are_refused_at_once():
    double = "".join(
        f'<object id="{k}"><components><component objectid="{k - 1}"/><component objectid="{k - 1}"/></components></object>'  # noqa: E501
        for k in range(2, 42)
    )
    text = THREEMF.replace("</resources>", double.replace('id="2"', 'id="2b"', 1) + "</resources>").replace(
        '<build><item objectid="2"', '<build><item objectid="41"'
    )
    with pytest.raises(ModelError, match="repeat too many objects"):
        load(threemf(text), format="3mf")
    with pytest.raises(ModelError, match="would take 26843"):
        load(threemf(THREEMF + " " * (MOST_UNPACKED + 10)), format="3mf")


def test_facts_are_logged():
    facts = []
    load(exported(box(), "ply", vertex_normal=True), format="ply", log=facts.append)
    assert facts == ["model: 12 faces, file normals used"]
    load(exported(box(), "ply", vertex_normal=True), format="ply", crease_angle=30, log=facts.append)
    assert facts[1] == "model: 12 faces, file normals not used: crease angle 30 asked for"


def test_trimesh_is_not_asked_for_normals(monkeypatch):
    def refuse(_self):
        raise AssertionError("vertex_normals were computed")

    monkeypatch.setattr(trimesh.Trimesh, "vertex_normals", property(refuse))
    for format in FORMATS:
        assert only_mesh(exported(box(), format) if format != "glb" else GLB, format=format).normals is None


# --- arrays -------------------------------------------------------------------------------------------------


def test_default_material_is_kept_where_a_file_has_none():
    assert only_mesh(exported(box(), "off"), format="off").material == Material()


def test_committed_models_have_what_they_are_for():
    globe = only_mesh(MODELS / "globe.obj")
    assert globe.material.texture.image.shape == (128, 256, 4) and globe.uv.shape == (globe.n_face, 3, 2)
    glass = {mesh.name: mesh.material.opacity for mesh in load(MODELS / "glass.obj").meshes}
    assert glass == {"floor": 1.0, "ball": 1.0, "left": 0.4, "middle": 0.4, "right": 0.4}
    assert [mesh.material.name for mesh in load(MODELS / "table.obj").meshes] == ["wood", "glaze", "clay", "brass"]


def test_a_damaged_picture_does_not_stop_a_model(tmp_path):
    for name in ("globe.obj", "globe.mtl"):
        (tmp_path / name).write_bytes((MODELS / name).read_bytes())
    (tmp_path / "globe.png").write_bytes((MODELS / "globe.png").read_bytes()[:60])
    with pytest.warns(UserWarning, match=r"globe\.png"):
        mesh = only_mesh(tmp_path / "globe.obj")
    assert mesh.material.texture is None and mesh.uv is not None
