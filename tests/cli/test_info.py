"""`raster info`: what is said of models, as lines and as JSON; nothing is drawn, and nothing heavy is imported."""

import io
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.arrays import deviations
from helpers.command import CUBE, GEAR, assert_refused, raster
from helpers.model_bytes import gltf_with
from helpers.raster import ROOT
from helpers.solids import area_of

import rasterizer as rz
from rasterizer.io.formats import formats

pytestmark = pytest.mark.usefixtures("folder")
MODELS = ROOT / "models"


def records(capsys, *argv, code=0):
    """What --json says, a dict a model."""
    assert raster("info", "--json", *argv) == code
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_the_facts_are_those_of_the_scene(capsys):
    cube, room = records(capsys, CUBE, MODELS / "room.json")
    assert (cube["faces"], cube["polygons"], cube["vertices"], cube["edges"]) == (12, 6, 8, 18)
    assert cube["watertight"] and cube["bodies"] == 1 and cube["volume"] == pytest.approx(8.0)
    assert cube["bounds"] == [[-1, -1, -1], [1, 1, 1]] and cube["up"] == "y" and cube["format"] == "obj"
    scene = rz.load(MODELS / "room.json")
    assert room["faces"] == scene.n_face and [each["faces"] for each in room["meshes"]] == [
        mesh.n_face for mesh in scene.meshes
    ]
    assert room["textures"][0]["size"] == [256, 128] and room["camera"]
    assert {"wood", "globe"} < {each["name"] for each in room["materials"]}
    assert any(name.endswith("table.obj") for name in room["files_read"])
    assert not deviations(room["bounds"], scene.bounds) and not deviations(room["extent"], np.ptp(scene.bounds, axis=0))
    assert room["area"] == pytest.approx(sum(map(area_of, scene.meshes)), rel=1e-6)


def test_lines_say_what_json_says(capsys):
    assert raster("info", GEAR, CUBE) == 0
    out, err = capsys.readouterr()
    gear, cube = out.split("\n\n")
    assert err == "" and gear.splitlines()[0] == GEAR and cube.splitlines()[0] == CUBE
    told = dict(re.findall(r"^  (\S+(?: \S+)*)  +(.*)$", gear, re.MULTILINE))
    (facts,) = records(capsys, GEAR)
    assert set(told) <= {name.replace("_", " ") for name in facts}
    assert (told["faces"], told["watertight"], told["bodies"], told["up"]) == ("2304", "yes", "1", "z")
    assert re.search(r"^  polygons +6$", cube, re.MULTILINE)


def test_a_files_camera_is_told_with_its_lens(folder, capsys):
    scene = rz.load(CUBE)
    camera = rz.Camera(position=(0, 0, 9), fov=40, aspect=16 / 9)
    rz.save(rz.Scene(scene.meshes, camera=camera), "wide.json")
    (wide,) = records(capsys, "wide.json")
    assert (wide["camera"]["fov"], wide["camera"]["height"], wide["camera"]["aspect"]) == (40, None, 16 / 9)
    assert raster("info", "wide.json") == 0
    assert "fov 40, " in (out := capsys.readouterr().out) and "aspect 1.77778" in out


def test_what_is_not_drawn_and_what_is_missing_is_told(folder, capsys):
    (folder / "odd ü.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl none\nf 1 2 3\nl 1 2\nl 2 3\np 1\n", encoding="utf-8"
    )
    assert raster("info", "odd ü.obj") == 0
    out = capsys.readouterr().out
    assert "1 point; 2 lines" in out and "no definition of material 'none'" in out
    assert re.search(r"watertight +no\n +open edges +3\n", out)
    (odd,) = records(capsys, "odd ü.obj")
    assert odd["model"] == "odd ü.obj" and len(odd["not_drawn"]) == 2 and odd["warnings"]


def test_what_a_reader_leaves_out_is_told(folder, capsys):
    """Whatever the format: what `-v` says of a file that isn't used, `info` says, too."""

    def change(tree, _):
        tree |= {"extensionsUsed": ["FOO_bar"], "animations": [{}]}

    (folder / "rig.gltf").write_bytes(gltf_with(change))
    (folder / "scan.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        b"property float z\nproperty float confidence\nelement face 1\nproperty list uchar int vertex_indices\n"
        b"end_header\n0 0 0 1\n1 0 0 1\n0 1 0 1\n3 0 1 2\n")  # fmt: skip
    rig, scan = records(capsys, "rig.gltf", "scan.ply")
    assert {"the extension FOO_bar", "animations"} <= set(rig["not_drawn"])
    assert scan["not_drawn"] == ["vertex properties confidence"]
    assert raster("info", "-v", "rig.gltf") == 0
    out, err = capsys.readouterr()
    assert err.rstrip().endswith(f"not used: {', '.join(rig['not_drawn'])}")
    assert f"{'; '.join(rig['not_drawn'])}\n" in out


def test_one_that_fails_does_not_stop_the_rest(folder, capsys):
    (folder / "empty.obj").write_bytes(b"")
    found = records(capsys, "nope.stl", CUBE, "empty.obj", code=1)
    assert found[0] == {"status": "failed", "model": "nope.stl", "error": "nope.stl: no such file"}
    assert (
        found[1]["faces"] == 12 and found[1]["status"] == "done" and found[2]["error"] == "empty.obj: the file is empty"
    )
    assert_refused(capsys, [(["nope.stl"], "raster: error: nope.stl: no such file\n")], "info", code=3)
    assert_refused(capsys, [([], "MODEL"), (["-"], "--input-format")], "info")


def test_the_formats_that_can_be_loaded_are_listed(capsys):
    with pytest.raises(SystemExit) as end:
        raster("info", "--formats")
    lines = capsys.readouterr().out.splitlines()
    assert end.value.code == 0 and [line.split()[0] for line in lines] == [each["name"] for each in formats()]
    assert all("pip install" in line for line, each in zip(lines, formats(), strict=True) if not each["is_readable"])


def test_a_model_comes_from_stdin_and_is_called_so(capsys, monkeypatch):
    def give(content):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(content)))

    give(b"x")
    words = "raster: error: stdin: not an STL file"
    assert_refused(capsys, [(["-", "--input-format", "stl"], words)], "info", code=3)
    give(Path(GEAR).read_bytes())
    (gear,) = records(capsys, "-", "--input-format", "stl")
    assert gear["bytes"] == Path(GEAR).stat().st_size and gear["faces"] == 2304


def test_a_material_under_a_spectrum_can_be_said(folder, capsys):
    mesh = rz.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], colors=np.full((3, 4), 0.5),
                   material=rz.Material(diffuse=rz.Spectrum.blackbody(4000)))  # fmt: skip
    rz.save(rz.Scene(mesh), "lamp.json")
    (lamp,) = records(capsys, "lamp.json")
    assert len(lamp["materials"][0]["diffuse"]) == 3 and lamp["not_drawn"] == ["the alpha of vertex colours"]
