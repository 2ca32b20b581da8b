"""Tests of the table of file formats: everything that must know a format asks it."""

import json

import numpy as np
import pytest

import rasterizer as rz
from rasterizer.cli import main
from rasterizer.io import formats
from rasterizer.io.formats import FORMATS, Format
from rasterizer.scene.material import Material

TRIANGLE = "0 0 0\n1 0 0\n0 1 0\n"


def read_toy(model):
    """Read a toy format: the corners of triangles, a line each."""
    numbers = [[float(word) for word in line.split()] for line in model.data.decode().splitlines()]
    if len(numbers) % 3:
        raise model.error("a corner is left over", len(numbers))
    faces = np.arange(len(numbers)).reshape(-1, 3)
    return [{"vertices": np.array(numbers), "faces": faces, "name": "toy", "material": Material()}]


@pytest.fixture
def toy(monkeypatch, tmp_path):
    """The toy format in the table, for one test; return a file of it."""
    monkeypatch.setattr(formats, "FORMATS", dict(FORMATS))
    formats.register(Format(name="toy", reader=f"{__name__}:read_toy", suffixes=("toy", "tri"), up="-x"))
    path = tmp_path / "a.tri"
    path.write_text(TRIANGLE)
    return path


def test_a_format_that_is_added_is_loaded(toy):
    for scene in (rz.load(toy), rz.load(str(toy), format="TOY"), rz.load(TRIANGLE.encode(), format="tri")):
        assert scene.n_face == 1 and scene.meshes[0].name == "toy" and scene.up == "-x"
    with toy.open() as opened:
        assert rz.load(opened).n_face == 1
    toy.write_text(TRIANGLE + "1 1 1\n")
    with pytest.raises(rz.ModelError, match=r"a\.tri:4: a corner is left over"):
        rz.load(toy)


def test_a_format_that_is_added_is_drawn_by_the_command_line(toy, monkeypatch, capsys):
    monkeypatch.chdir(toy.parent)
    assert main(["render", "a.tri", "--json", "-s", "16x12"]) == 0
    assert json.loads(capsys.readouterr().out)["faces"] == 1
    assert main(["render", "a.tri", "--input-format", "toy", "-o", "b.png", "-s", "16x12"]) == 0
    with pytest.raises(SystemExit):
        main(["render", "--help"])
    assert "off, glb, gltf, 3mf, toy files" in " ".join(capsys.readouterr().out.split())


def test_a_format_that_is_added_is_a_model_of_scene_files(toy):
    scene = toy.parent / "scene.json"
    scene.write_text(json.dumps({"meshes": [{"file": "a.tri"}]}))
    assert rz.load(scene).n_face == 1 and rz.load(scene).up == "-x"


def test_a_stranger_is_an_error_that_lists_what_is_legal(toy):
    for load in (lambda: rz.load("a.xyz"), lambda: rz.load(b"1", format=".XYZ")):
        with pytest.raises(rz.ModelError, match="unknown format 'xyz'; readable are obj, stl, .*, json, toml, toy$"):
            load()
    with pytest.raises(rz.ModelError, match="unknown format 'obj' of a scene file; readable are json, toml$"):
        formats.format_of("scene", "obj", is_scene=True)


def test_a_name_or_suffix_is_taken_once(toy):
    for entry in (Format(name="obj", reader="a:b"), Format(name="new", reader="a:b", suffixes=("new", "tri"))):
        with pytest.raises(rz.SceneError, match=f"'{entry.name}' can't be added: '(obj|tri)' is taken by '(obj|toy)'"):
            formats.register(entry)
    assert formats.find("new") is None


@pytest.mark.parametrize("name", FORMATS)
def test_entries_are_whole(name):
    entry = FORMATS[name]
    assert entry.name == name and callable(entry.read()) and formats.find(f".{name.upper()}") is entry
    with pytest.raises(AttributeError):
        entry.up = "x"


@pytest.mark.parametrize("name", [name for name, entry in FORMATS.items() if entry.is_binary])
def test_a_file_object_of_text_is_refused_where_a_format_is_no_text(tmp_path, name):
    path = tmp_path / f"a.{name}"
    path.write_text("text")
    with path.open() as opened, pytest.raises(rz.ModelError, match=f"{name} is no text; open the file with mode 'rb'"):
        rz.load(opened)
