"""Tests of loading what is broken: an error that names the file and the fault, never a traceback."""

import pytest
from helpers.model_bytes import GLB, PLY_HEADER, box, exported, gltf_with, rich_gltf
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer.errors import ModelError, SceneError
from rasterizer.io.loader import load

FORMATS = ("obj", "stl", "ply", "off", "glb")


def test_faults_of_the_path(tmp_path):
    with pytest.raises(ModelError, match=r"gone\.obj: no such file"):
        load(tmp_path / "gone.obj")
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(ModelError, match=r"folder\.obj: is a folder"):
        load(tmp_path / "folder.obj")
    with pytest.raises(ModelError, match="unknown format 'xyz'; readable are obj, stl, ply, off, glb, gltf, 3mf"):
        load(tmp_path / "model.xyz")
    with pytest.raises(ModelError, match="model: no such file"):
        load(tmp_path / "model")
    (tmp_path / "model").write_text("v 0 0 0")
    with pytest.raises(ModelError, match="format is unknown without a suffix"):
        load(tmp_path / "model")
    with pytest.raises(ModelError, match="format is unknown without a suffix"):
        load(b"v 0 0 0")
    with pytest.raises(ModelError, match="can't be read"):
        load("a\0b.obj")
    with pytest.raises(SceneError, match="format must be text"):
        load(b"v 0 0 0", format=3)


@pytest.mark.parametrize("format", [*FORMATS, "gltf", "3mf"])
@pytest.mark.parametrize("data", [b"", b" \n\t", b"\0" * 100, b"hello world\n", b"\xff\xfe\x80\x81" * 50, b"[[[[[["])
def test_what_is_no_model_is_an_error(tmp_path, format, data):
    path = tmp_path / f"model.{format}"
    path.write_bytes(data)
    with pytest.raises(ModelError) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}: ")
    if not data.strip():
        assert str(caught.value) == f"{path}: the file is empty"


@pytest.mark.parametrize(
    ("format", "data", "fault"),
    [
        ("stl", exported(box(), "stl")[:-10], "binary STL of 12 faces must have 684 bytes, the file has 674"),
        ("stl", exported(box(), "stl_ascii")[:-20], "cut off"),
        ("ply", exported(box(), "ply")[:-10], "binary PLY of another length"),
        (
            "ply",
            (PLY_HEADER.format(n_face=2, face_properties="") + "3 0 1 2\n").encode(),
            "promises 2 face lines",
        ),
        ("ply", (PLY_HEADER.format(n_face=1, face_properties="") + "3 0 1 9\n").encode(), "9"),
        ("ply", (PLY_HEADER.format(n_face=1, face_properties="") + "3 0 1 -1\n").encode(), "-1"),
        ("ply", PLY_HEADER.format(n_face=0, face_properties="").encode(), "no faces"),
        ("off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "outside the range|refers to vertex 3"),
        (
            "off",
            b"OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
            "promises 3 vertices and 2 faces, the file has 3 and 1",
        ),
        ("off", b"OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1\n", "fewer corners than it says"),
        ("off", b"OFF\n4000000000 1 0\n0 0 0\n", "promises 4000000000 vertices"),
        ("off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n99999999999999999999 0 1 2\n", "not a readable OFF file"),
        ("off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n", "zero area"),
        ("off", b"OFF\n3 1 0\n0 0 0\nnan 0 0\n2 1 0\n3 0 1 2\n", "1 of 3 vertices"),
        ("glb", GLB[:-10], "not a readable GLB file"),
    ],
)
def test_broken_files(format, data, fault):
    with pytest.raises(ModelError, match=fault):
        load(data, format=format)


def test_messages_name_the_file_once():
    for data, format in [
        (b"OFF\n3 2 0\n", "off"),
        (gltf_with(lambda tree, _: tree["accessors"].clear()), "gltf"),
    ]:
        with pytest.raises(ModelError) as caught:
            load(data, format=format)
        assert str(caught.value).count("model:") == 1


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda tree, _: tree["accessors"][1].pop("bufferView"), "every face has zero area"),
        (lambda tree, _: tree["accessors"][1].pop("bufferView") and tree["accessors"][1].update(count=10**12), "legal"),
        (lambda tree, _: tree["accessors"][1].update(type="VEC6"), "type must be one of SCALAR, .*; given VEC6"),
        (lambda tree, _: tree["accessors"][1].update(sparse={"count": 1}), "not a readable"),
        (lambda tree, _: tree["asset"].update(version="1.0"), "glTF of version 1.0; 2.0 is read"),
        (lambda tree, _: tree["accessors"][1].update(count=10**9), "not a readable"),
        (lambda tree, _: tree.update(extensionsRequired=["KHR_draco_mesh_compression"]), "KHR_draco"),
        (lambda tree, _: tree["nodes"][0].update(matrix=[0] * 16), "transform"),
        (lambda _, primitive: primitive["attributes"].pop("POSITION"), "no faces"),
        (lambda tree, _: tree.update(meshes=3), "not a readable"),
        (lambda tree, _: tree.update(meshes=[]), "."),
        (lambda _, primitive: primitive.update(mode=3), "no faces|not a readable"),
    ],
)
def test_broken_gltf(change, fault):
    with pytest.raises(ModelError, match=fault):
        load(gltf_with(change), format="gltf")


def test_the_rich_file_is_sound():
    scene = load(rich_gltf(), format="gltf")
    assert len(scene.lights) == 3 and scene.camera is not None and scene.meshes[0].material.texture is not None


def test_unused_accessors_without_data_take_no_room():
    def change(tree, _primitive):
        tree["accessors"].append({"componentType": 5126, "count": 10**12, "type": "VEC3"})

    assert load(gltf_with(change), format="gltf").n_face == 12


SEEDS = {
    "obj": [
        exported(box(), "obj"),
        b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\nusemtl a\ns 1\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf 1 2 -1\n",
        b"o p\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0 0\nvt 1 1\ng x\nusemtl a\nf 1/1 2/2 3/-1\n"
        b"o q\nv 2 2 2\nf 1 2 4\nusemtl b\nf 2 3 4\no r\nf 1 1 1\n",
    ],
    "stl": [exported(box(), "stl"), exported(box(), "stl_ascii")],
    "ply": [exported(box(), "ply"), exported(box(), "ply", encoding="ascii")],
    "off": [exported(box(), "off")],
    "glb": [GLB],
    "gltf": [gltf_with(lambda tree, primitive: None), rich_gltf()],
}


@st.composite
def damaged_files(draw):
    """A format, and a good file of it that has been cut, flipped, overwritten or stirred in a few places."""
    format = draw(st.sampled_from(sorted(SEEDS)))
    data = bytearray(draw(st.sampled_from(SEEDS[format])))
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(len(data) - 1, 0)))
        kind = draw(st.sampled_from(["cut", "flip", "drop", "write", "digit"]))
        if kind == "cut":
            del data[at:]
        elif kind == "flip" and data:
            data[at] ^= 1 << draw(st.integers(0, 7))
        elif kind == "drop":
            del data[at : at + draw(st.integers(1, 8))]
        elif kind == "digit" and data:
            data[at] = draw(st.sampled_from(b"0123456789-. /\n"))
        else:
            data[at : at + 4] = draw(st.sampled_from([b"\xff" * 4, b"9999", b"nan ", b"-1 1", b"1e99", b"\0\0\0\x80"]))
    return format, bytes(data)


@pytest.mark.filterwarnings("ignore")
@settings(max_examples=300, deadline=None)
@given(damaged_files())
def test_damaged_files_load_or_raise_a_model_error(case):
    format, data = case
    try:
        scene = load(data, format=format)
    except ModelError as fault:
        assert str(fault).startswith("model:")
        assert "Traceback" not in str(fault)
    else:
        assert scene.n_face > 0
