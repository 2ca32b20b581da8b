"""Tests of which files a file may read, and of how files are written: the rules of rasterizer.io.files, format by
format."""

import base64
import json
import os
import stat
import warnings

import pytest
from helpers.file_grammar import TRIANGLE
from helpers.model_bytes import box, exported, gltf_with
from helpers.other_models import dae
from PIL import Image

import rasterizer as rz
from rasterizer.io.files import Folder, OutsideError, identity_of, read_source, write_whole

TEXTURED = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl a\nf 1/1 2/2 3/3\n"
SECRET = "outside/secret.png"


@pytest.fixture
def place(tmp_path):
    """A folder with a model's folder `in`, and beside it what the model may not read."""
    for name in ("in/sub", "outside"):
        os.makedirs(tmp_path / name)
    for name in ("in/wood.png", "in/sub/bark.png", SECRET):
        Image.new("RGB", (2, 2), "red").save(tmp_path / name)
    for name in ("secret.bin", "secret.obj", "secret.npz"):
        (tmp_path / "outside" / name).write_bytes(b"TOP SECRET" * 100)
    (tmp_path / "in" / "link.png").symlink_to(tmp_path / SECRET)
    (tmp_path / "in" / "out").symlink_to(tmp_path / "outside")
    (tmp_path / "in" / "loop.png").symlink_to("loop.png")
    (tmp_path / "in" / "own.png").symlink_to("sub/bark.png")
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "in" / "pipe.png")
        (tmp_path / "in" / "endless.png").symlink_to("/dev/zero")
    return tmp_path


def bad_names(place):
    """Names that a file may not read, each of something that is there."""
    names = [
        str(place / SECRET),
        "../" + SECRET,
        "sub/../../" + SECRET,
        "link.png",
        "out/secret.png",
        "loop.png",
        "sub",
    ]
    return names + (
        ["pipe.png", "endless.png", "/dev/zero", "/dev/stdin", "/proc/self/environ"] if hasattr(os, "mkfifo") else []
    )


def test_names_from_other_machines(place):
    folder = Folder(place / "in")
    for name in (
        "WOOD.PNG",
        r"C:\Users\me\wood.png",
        "/home/me/textures/Wood.png",
        "../../wood.png",
        "http://host/wood.png",
    ):
        assert folder.find_alike(name) == place / "in" / "wood.png", name
    for name in ("./wood.png", "sub/../wood.png", "own.png"):  # the last is a link to what lies below
        assert folder.read_bytes(folder.find(name)) == folder.read_bytes(folder.find_alike(name)), name
    assert folder.find_alike(r"SUB\Bark.png") == place / "in" / "sub" / "bark.png"
    (place / "in" / "Wood.png").write_bytes(b"")
    assert folder.find_alike("wood.png").name == "wood.png" and folder.find_alike("Wood.png").name == "Wood.png"


def test_outside_on_request(place):
    folder = Folder(place / "in", allow_outside=True)
    for name in (str(place / SECRET), "../" + SECRET, "link.png", "out/secret.png"):
        assert folder.find(name) and folder.find_alike(name)
    for name in ("pipe.png", "endless.png", "sub", "/dev/zero"):
        with pytest.raises((OutsideError, OSError)):
            folder.find(name)


def test_a_material_library_below_may_name_textures_above_it_but_within(place):
    (place / "in" / "sub" / "m.mtl").write_text("newmtl a\nmap_Kd ../wood.png\n")
    (place / "in" / "model.obj").write_text(TEXTURED.replace("m.mtl", "sub/m.mtl"))
    read = []
    assert rz.load(place / "in" / "model.obj", files_read=read).meshes[0].material.texture is not None
    assert list(dict.fromkeys(os.path.basename(path) for path in read)) == ["m.mtl", "wood.png"]


def forms(place):
    """Every way in which a file names another: the format's name, and a function from the name to the path of the
    model."""

    def obj(name):
        (place / "in" / "m.mtl").write_text(f"newmtl a\nmap_Kd {name}\n")
        (place / "in" / "model.obj").write_text(TEXTURED)
        return place / "in" / "model.obj"

    def library(name):
        (place / "in" / "model.obj").write_text(TEXTURED.replace("m.mtl", name))
        return place / "in" / "model.obj"

    def image(name):
        def change(tree, primitive):
            tree["images"], tree["textures"] = [{"uri": name}], [{"source": 0}]
            tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
            primitive["material"] = 0

        (place / "in" / "model.gltf").write_bytes(gltf_with(change))
        return place / "in" / "model.gltf"

    def buffer(name):
        (place / "in" / "model.gltf").write_bytes(gltf_with(lambda tree, _: tree["buffers"][0].update(uri=name)))
        return place / "in" / "model.gltf"

    def scene(table):
        (place / "in" / "scene.json").write_text(json.dumps(table))
        return place / "in" / "scene.json"

    def collada(name):
        (place / "in" / "model.dae").write_text(dae(image=name))
        return place / "in" / "model.dae"

    texture = {"arrays": "x.npz", "texture": 0}
    return {
        "dae": collada,
        "obj": obj, "mtllib": library, "image": image, "buffer": buffer,
        "part": lambda name: scene({"meshes": [{"file": name}]}),
        "npz": lambda name: scene({"meshes": [{"arrays": name, "mesh": 0}]}),
        "texture": lambda name: scene({"meshes": [TRIANGLE | {"material": {"texture": name}}]}),
        "texels": lambda name: scene({"meshes": [TRIANGLE | {"material": {"texture": texture | {"arrays": name}}}]}),
    }  # fmt: skip


@pytest.mark.parametrize("form", ["obj", "mtllib", "image", "buffer", "part", "npz", "texture", "texels", "dae"])
def test_no_file_reads_what_it_may_not(place, form, monkeypatch):
    """The system's own way to open files is watched."""
    if form == "dae":
        pytest.importorskip("collada", reason="the extra formats is not installed")
    opened = []
    real_open = os.open

    def watched(path, *args, **settings):
        opened.append(os.path.realpath(path) if isinstance(path, (str, os.PathLike)) else path)
        return real_open(path, *args, **settings)

    monkeypatch.setattr(os, "open", watched)
    for name in [*bad_names(place), "../outside/secret.bin", "../outside/secret.obj", "../outside/secret.npz"]:
        path, said = forms(place)[form](name), []
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                rz.load(path)
            except (rz.ModelError, rz.SceneError) as fault:
                said.append(str(fault))
        said += [str(warning.message) for warning in caught]
        assert said and not any("TOP SECRET" in text or "internal" in text for text in said), (name, said)
        assert not [p for p in opened if str(p).startswith((str(place / "outside"), "/dev/z", "/proc"))], name


def test_a_buffer_is_read_up_to_its_length(place):
    data = json.loads(gltf_with())
    content = base64.b64decode(data["buffers"][0]["uri"].partition(",")[2])
    with open(place / "in" / "large.bin", "wb") as stream:
        stream.write(content)
        stream.truncate(2**40)  # a terabyte with nothing in it
    data["buffers"][0]["uri"] = "large.bin"
    (place / "in" / "model.gltf").write_text(json.dumps(data))
    assert rz.load(place / "in" / "model.gltf").n_face == 12


def test_what_a_person_names_may_be_elsewhere_but_must_end(place):
    assert rz.Texture(place / "in" / "link.png").image.shape == (2, 2, 4)
    (place / "box.stl").write_bytes(exported(box(), "stl"))
    (place / "in" / "link.stl").symlink_to(place / "box.stl")
    assert rz.load(place / "in" / "link.stl").n_face == 12
    with pytest.raises(rz.ModelError, match="it is a device"):
        rz.load("/dev/zero", format="stl")
    assert read_source(place / "box.stl", "box.stl")


# --- writing ------------------------------------------------------------------------------------------------


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_a_new_file_has_the_mode_of_the_umask_and_a_protected_one_is_refused(tmp_path):
    path = tmp_path / "x.png"
    write_whole(path, b"new")
    (tmp_path / "plain").touch()
    new, plain = (stat.S_IMODE(os.stat(each).st_mode) for each in (path, tmp_path / "plain"))
    assert new == plain, f"a new file's mode is {new:o}, not {plain:o}"
    (tmp_path / "plain").unlink()
    write_whole(path, b"after")
    for mode in (0o400, 0o444, 0o000):
        path.chmod(mode)
        with pytest.raises(rz.OutputError, match="protected against writing"):
            write_whole(path, b"again")
        path.chmod(0o600)
        assert path.read_bytes() == b"after" and os.listdir(tmp_path) == ["x.png"]


def test_a_file_is_known_by_any_name(tmp_path):
    (tmp_path / "a").write_bytes(b"")
    os.link(tmp_path / "a", tmp_path / "b")
    (tmp_path / "c").symlink_to("a")
    assert identity_of(tmp_path / "a") == identity_of(tmp_path / "b") == identity_of(tmp_path / "c")
    assert identity_of(tmp_path / "d") is None and identity_of("\0") is None
