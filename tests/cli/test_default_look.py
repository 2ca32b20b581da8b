"""The look where nothing asks for another, and the tabletop of --ground."""

import json

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.command import CUBE, SMALL, loaded, picture, raster

import rasterizer as rz

pytestmark = pytest.mark.usefixtures("folder")


def run(*argv) -> int:
    return raster("render", *SMALL, *argv)


def test_the_ground_brings_its_lights_where_the_model_has_none():
    assert loaded(CUBE).scene.lights == rz.studio()
    assert loaded(CUBE, "--ground").scene.lights == rz.tabletop()
    for flags in ("--preset headlight", "--light directional:0,-1,0"):
        assert loaded(CUBE, "--ground", *flags.split()).scene.lights == loaded(CUBE, *flags.split()).scene.lights, flags
    for shading in ("flat", "gouraud"):
        lights = loaded(CUBE, "--ground", "--shading", shading).scene.lights
        assert all(getattr(light, "shadow", None) is None for light in lights), shading
    shadows = {light.shadow for light in loaded(CUBE, "--ground", "--shadows", "--shadow-size", "64").scene.lights[1:]}
    assert shadows == {rz.Shadow(64)}, "flags for shadows come first"


def test_a_scene_file_keeps_its_lights_and_may_ask_for_the_ground(folder):
    cube = {"vertices": rz.load(CUBE).meshes[0].vertices.tolist(), "faces": rz.load(CUBE).meshes[0].faces.tolist()}
    table = {"meshes": [cube], "lights": ["headlight"]}
    (folder / "scene.json").write_text(json.dumps(table))
    assert loaded("scene.json", "--ground").scene.lights == rz.headlight()
    (folder / "ground.json").write_text(json.dumps(table | {"options": {"ground": True}}))
    for name, flags in (("flag.png", ["scene.json", "--ground"]), ("file.png", ["ground.json"])):
        assert raster("render", *SMALL, *flags, "-o", name) == 0
    assert raster("render", *SMALL, "ground.json", "--no-ground", "-o", "none.png") == 0
    assert not differences(picture("file.png"), picture("flag.png")) and differences(
        picture("none.png"), picture("flag.png")
    )


def test_an_array_has_no_ground_and_the_same_camera(capsys):
    assert run(CUBE, "-o", "x.png", "--ground") == 0
    assert run(CUBE, "--ground", "--array", "face", "-o", "x.npy") == 0
    covered = np.load("x.npy") >= 0
    assert picture("x.png")[..., 3][covered].min() > 100
    capsys.readouterr()
    coverages = []
    for flags in ([], ["--ground"]):
        assert run(CUBE, "--json", "--eye", "3,3,5", *flags) == 0
        coverages.append(json.loads(capsys.readouterr().out)["coverage"])
    assert coverages[0] == coverages[1], "coverage counts the model alone"
