"""The look of pictures where no flag asks for another, and what keeps a file's own."""

import json

import numpy as np
import pytest
from helpers.command import CUBE, SMALL, errors, loaded, picture, raster
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.cli.default_look import NEUTRAL

pytestmark = pytest.mark.usefixtures("folder")
LIFE = str(ROOT / "models" / "still_life.obj")


def run(*argv) -> int:
    return raster("render", *SMALL, *argv)


def test_a_model_without_lights_and_materials_is_put_on_the_tabletop():
    found = loaded(CUBE)
    assert found.is_on_tabletop and found.scene.lights == rz.tabletop()
    assert found.scene.meshes[0].palette == (rz.Material(diffuse=NEUTRAL),)
    beside = loaded(CUBE, "--preset", "tabletop", "--light", "ambient:0.5")
    assert beside.is_on_tabletop and beside.scene.lights == (*rz.tabletop(), rz.AmbientLight(0.5))
    for flags in ("--preset studio", "--preset headlight", "--light directional:0,-1,0"):
        found = loaded(CUBE, *flags.split())
        assert not found.is_on_tabletop and found.scene.meshes[0].palette == (rz.Material(),), flags


def test_the_key_casts_no_shadow_where_no_sample_is_lit():
    for shading in ("flat", "gouraud"):
        lights = loaded(CUBE, "--shading", shading).scene.lights
        assert all(getattr(light, "shadow", None) is None for light in lights), shading
        assert [getattr(light, "color", None) for light in lights] == [light.color for light in rz.tabletop()]
    shadows = {light.shadow for light in loaded(CUBE, "--shadows", "--shadow-size", "64").scene.lights[1:]}
    assert shadows == {rz.Shadow(64)}, "flags for shadows come first"


def test_materials_of_the_file_stay(folder, capsys):
    ours, theirs = loaded(LIFE).scene.meshes, rz.load(LIFE).meshes
    assert [mesh.palette for mesh in ours] == [mesh.palette for mesh in theirs]
    (folder / "x.obj").write_text("mtllib none.mtl\nusemtl paint\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (material,) = loaded("x.obj").scene.meshes[0].palette
    assert (material.name, material.diffuse) == ("paint", (NEUTRAL,) * 3), "what a library lacks is grey"
    assert "none.mtl" in capsys.readouterr().err


def test_a_scene_file_rules_its_own_look(folder):
    cube = {"vertices": rz.load(CUBE).meshes[0].vertices.tolist(), "faces": rz.load(CUBE).meshes[0].faces.tolist()}
    (folder / "scene.json").write_text(json.dumps({"meshes": [cube]}))
    found = loaded("scene.json")
    assert not found.is_on_tabletop and found.scene.lights == rz.studio()
    assert loaded("scene.json", "--preset", "tabletop").is_on_tabletop


def test_the_ground_is_a_flag_and_alone_has_a_soft_shadow(capsys):
    shadows = {}
    for flags in ("", "--no-ground", "--preset studio", "--preset studio --ground"):
        assert run(CUBE, "-o", "x.png", "-s", "64", *flags.split()) == 0
        seen = picture("x.png")
        shadows[flags] = bool(((seen[..., 3] > 0) & (seen[..., 3] < 140) & (seen[..., :3] == 0).all(axis=2)).any())
    assert shadows == {"": True, "--no-ground": False, "--preset studio": False, "--preset studio --ground": True}
    assert run(CUBE, "-o", "x.png", "-s", "64", "--background", "white") == 0
    seen = picture("x.png")
    assert seen.shape == (64, 64, 3) and seen[0, 0].tolist() == [255] * 3
    outside = np.concatenate([seen[-3:, :, 0].ravel(), seen[40:, :3, 0].ravel(), seen[40:, -3:, 0].ravel()])
    assert outside.min() < 250, "an opaque background shows the shadow"
    assert errors(capsys) == ""


def test_an_array_has_no_ground_and_the_same_camera(capsys):
    assert run(CUBE, "-o", "x.png") == 0 and run(CUBE, "--array", "face", "-o", "x.npy", "--samples", "1") == 0
    covered = np.load("x.npy") >= 0
    assert picture("x.png")[..., 3][covered].min() > 100
    assert run(CUBE, "-o", "y.npy", "--array", "rgb") == 0 and np.load("y.npy")[0, 0].tolist() == [0, 0, 0]
    assert errors(capsys) == ""
    coverages = []
    for flags in ([], ["--no-ground"]):
        assert run(CUBE, "--json", "--eye", "3,3,5", *flags) == 0
        coverages.append(json.loads(capsys.readouterr().out)["coverage"])
    assert coverages[0] == coverages[1], "coverage counts the model alone"
