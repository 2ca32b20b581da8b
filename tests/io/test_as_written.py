"""Files as other programs write them, where these go their own ways within a format, or a little beyond it."""

import json

import numpy as np
import pytest
from helpers.model_bytes import gltf_with

import rasterizer as rz
from rasterizer.io.loader import load

CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0))


@pytest.mark.parametrize("letters, order", [
    ("", "x"), ("N", "xn"), ("C", "xc"), ("ST", "xu"), ("CN", "xnc"), ("STCN", "xncu"),  # Geomview
    ("NC", "xcn"), ("CST", "xcu"), ("NST", "xnu"), ("NCST", "xcnu"), ("NC", "xnc"),  # MeshLab, and the last CGAL
])  # fmt: skip
def test_letters_of_off_files_in_any_order(letters, order):
    words = {"c": "255 0 51 255", "n": "0 0.6 0.8", "u": "0.5 0.25"}
    rows = [" ".join([f"{x} {y} {z}", *(words[each] for each in order[1:])]) for x, y, z in CORNERS]
    (mesh,) = load("\n".join([f"{letters}OFF", "3 1 0", *rows, "3 0 1 2", ""]).encode(), format="off").meshes
    np.testing.assert_array_equal(mesh.vertices, CORNERS)
    for letter, array, expected in (("n", mesh.normals, (0, 0.6, 0.8)), ("u", mesh.uv, (0.5, 0.25))):
        assert (array is not None) == (letter in order)
        if array is not None:
            np.testing.assert_allclose(array, np.tile(expected, (3, 1)), atol=1e-15)
    assert (mesh.colors is not None) == ("c" in order)
    assert mesh.colors is None or np.allclose(mesh.colors[:, :2], (1, 0), atol=0)


def test_some_objects_of_an_obj_file_have_colours_and_some_faces_have_normals():
    face = "v 0 0 0{0}\nv 1 0 0{0}\nv 0 1 0{0}\nv 0 0 1{1}\nf {2} {3} {4}\nf {2} {3} {5}\n"
    text = "".join([
        "vn 0 0.6 0.8\n",
        "o plain\n" + face.format("", "", "1//1", "2//1", "3//1", "4//1").replace("f 1//1 2//1 4//1", "f 1 2 4"),
        "o painted\n" + face.format(" 1 0 0", " 1 0 1", 5, 6, 7, 8),
        "o half\n" + face.format(" 1 0 0", " 1", 9, 10, 11, 12),
    ])  # fmt: skip
    for more in ("", "# a comment\n" * 25000):  # long files are read by blocks, and another way
        plain, painted, half = load((text + more).encode(), format="obj").meshes
        assert plain.colors is None and plain.palette[0].diffuse != painted.palette[0].diffuse
        np.testing.assert_array_equal(painted.colors[:, :3], [(1, 0, 0)] * 3 + [(1, 0, 1)])
        np.testing.assert_array_equal(half.colors[:, :3], [(1, 0, 0)] * 3 + [(1, 1, 1)])
        np.testing.assert_allclose(plain.normals[0], np.tile((0, 0.6, 0.8), (3, 1)), atol=1e-15)
        np.testing.assert_allclose(plain.normals[1], np.tile((0, -1, 0), (3, 1)), atol=1e-15)  # computed


def test_texture_coordinates_of_gltf_are_whole_numbers_or_parts_of_the_largest():
    """KHR_mesh_quantization: a transform of the texture scales those that are not normalized."""
    whole = np.array([[0, 0], [4095, 0], [0, 4095], [100, 4000]] * 2, np.uint16)
    found = []
    for is_normalized in (False, True):

        def change(tree, primitive, is_normalized=is_normalized):
            rows = np.zeros((tree["accessors"][primitive["attributes"]["POSITION"]]["count"], 2), np.uint16)
            rows[: len(whole)] = whole
            tree["buffers"].append({"byteLength": rows.nbytes, "uri": data_uri(rows)})
            tree["bufferViews"].append({"buffer": len(tree["buffers"]) - 1, "byteLength": rows.nbytes})
            tree["accessors"].append({"bufferView": len(tree["bufferViews"]) - 1, "componentType": 5123, "type": "VEC2",
                                      "count": len(rows), "normalized": is_normalized})  # fmt: skip
            primitive["attributes"]["TEXCOORD_0"] = len(tree["accessors"]) - 1

        (mesh,) = load(gltf_with(change), format="gltf").meshes
        uv = np.asarray(mesh.uv).reshape(-1, 2)
        found.append(np.unique(np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1), axis=0))
    expected = np.unique(whole.astype(float), axis=0)
    np.testing.assert_allclose(found[0], expected, atol=1e-9)
    np.testing.assert_allclose(found[1], expected / 65535, atol=1e-12)


def data_uri(array) -> str:
    import base64

    return f"data:application/octet-stream;base64,{base64.b64encode(array.tobytes()).decode()}"


def test_matrices_in_float32_lights_and_cameras_beyond_the_format_cost_no_model():
    def change(tree, primitive):
        tree["nodes"].append({"camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}})
        tree["nodes"][0]["matrix"] = [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 1, 2, 3, 0.99999994]
        for key in ("translation", "rotation", "scale"):
            tree["nodes"][0].pop(key, None)
        tree["scenes"] = [{"nodes": [0, len(tree["nodes"]) - 1]}]
        tree["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1, "aspectRatio": 0}}]
        tree["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point", "range": 0, "name": "lamp"}]}}

    with pytest.warns(UserWarning) as warned:
        scene = load(gltf_with(change), format="gltf")
    assert len(warned) == 2 and "light 0 'lamp'" in str(warned[0].message) and "camera 0" in str(warned[1].message)
    assert scene.camera is None and len(scene.meshes[0].faces) == 12


def test_a_vertex_of_a_skin_without_weights_goes_with_its_first_joint():
    from rasterizer.io.gltf import _carry

    joints = np.tile(np.eye(4), (2, 1, 1))
    joints[0, :3, 3], joints[1, :3, 3] = (5, 0, 0), (0, 5, 0)
    weights = np.array([[0, 0, 0, 0], [0, 1, 0, 0], [0.5, 0.5, 0, 0]])
    for nobody in (0, 99):  # a number that no joint has, of a vertex that none carries
        part = {"vertices": np.array(CORNERS, float), "faces": np.array([[0, 1, 2]])}
        numbers = np.array([[nobody, 1, 0, 0], [0, 1, 0, 0], [0, 1, 0, 0]], np.uint8)
        _carry(part, {"JOINTS_0": numbers, "WEIGHTS_0": weights}, joints)
    np.testing.assert_allclose(part["vertices"], np.array(CORNERS) + [(5, 0, 0), (0, 5, 0), (2.5, 2.5, 0)])


def test_a_missing_material_file_is_named_and_so_are_missing_materials(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl red\nKd 1 0 0\nPm 1\n")
    face = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
    for used, said in (
        ("red", "'b.mtl' not found$"),
        ("blue", "not found; no definition of material 'blue'; the default"),
    ):
        (tmp_path / "x.obj").write_text(f"mtllib a.mtl b.mtl\n{face}usemtl {used}\nf 1 2 3\n")
        with pytest.warns(UserWarning, match=said):
            rz.load(tmp_path / "x.obj")


def test_colours_of_vertices_go_before_those_of_faces_in_ply_files():
    head = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    colors = "".join(f"property uchar {color}\n" for color in ("red", "green", "blue"))
    rows = "".join(f"{x} {y} {z} 255 0 0\n" for x, y, z in CORNERS)
    lists = "element face 1\nproperty list uchar int vertex_indices\n"
    text = f"{head}{colors}{lists}{colors}end_header\n{rows}3 0 1 2 0 0 255\n"
    facts = []
    (mesh,) = load(text.encode(), format="ply", log=facts.append).meshes
    assert mesh.face_colors is None and np.allclose(mesh.colors[:, :3], (1, 0, 0))
    assert any("colours of faces" in fact for fact in facts)


def test_cameras_with_blank_lines_and_those_of_lenses_that_are_not_drawn(tmp_path):
    (tmp_path / "cameras.txt").write_text("# a comment\n1 PINHOLE 640 480 500 500 320 240\n\n")
    (tmp_path / "images.txt").write_text("# a comment\n\n1 1 0 0 0 0 0 3 1 a.png\n\n2 1 0 0 0 0 0 4 1 b.png\n1 2 3\n\n")
    assert sorted(rz.read_colmap(tmp_path)) == ["a.png", "b.png"]
    pose = np.eye(4).tolist()
    lenses = [
        ({}, True),
        ({"camera_model": "OPENCV"}, True),
        ({"camera_model": None}, True),
        ({"is_fisheye": True}, False),
    ]
    lenses += [({"is_fisheye": True}, False)]
    lenses += [({"camera_model": name}, False) for name in ("EQUIRECTANGULAR", "OPENCV_FISHEYE", ["x"])]
    for lens, is_legal in lenses:
        content = {"fl_x": 500, "w": 640, "h": 480, "frames": [{"file_path": "a.png", "transform_matrix": pose}]} | lens
        (tmp_path / "transforms.json").write_text(json.dumps(content))
        if is_legal:
            assert list(rz.read_nerf(tmp_path / "transforms.json")) == ["a.png"]
        else:
            with pytest.raises(rz.ModelError, match="undistort"):
                rz.read_nerf(tmp_path / "transforms.json")


def test_entries_of_a_scene_file_with_scalars_that_differ_in_the_middle(tmp_path):
    (tmp_path / "x.obj").write_text("".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS) * 400 + "".join(
        f"f {k} {k + 1} {k + 2}\n" for k in range(1, 1200, 3)))  # fmt: skip
    values = [[0.0] * 1200, [0.0] * 600 + [1.0] * 3 + [0.0] * 597]
    entries = [{"file": "x.obj", "scalars": each} for each in values]
    (tmp_path / "scene.json").write_text(json.dumps({"meshes": entries}))
    first, second = rz.load(tmp_path / "scene.json").meshes
    assert not np.array_equal(first.uv, second.uv)
