"""The look of pictures where no flag asks for another, and what keeps a file's own."""

import json

import numpy as np
import pytest
from helpers.command import CUBE, errors, picture, run
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.cli import arguments
from rasterizer.cli.default_look import NEUTRAL
from rasterizer.cli.load_scene import load_scene, make_settings
from rasterizer.cli.messages import Messages

pytestmark = pytest.mark.usefixtures("folder")
LIFE = str(ROOT / "models" / "still_life.obj")


def loaded(model, *argv):
    """What is loaded of a model with flags."""
    parsed = arguments.parse(["render", str(model), *argv])
    return load_scene(str(model), parsed, make_settings(parsed), Messages())


def test_a_model_without_lights_and_materials_is_put_on_the_tabletop():
    found = loaded(CUBE)
    assert found.is_on_tabletop and found.scene.lights == rz.tabletop()
    assert found.scene.meshes[0].palette == (rz.Material(diffuse=NEUTRAL),)


@pytest.mark.parametrize("shading", ["flat", "gouraud"])
def test_the_key_casts_no_shadow_where_no_sample_is_lit(shading):
    lights = loaded(CUBE, "--shading", shading).scene.lights
    assert all(getattr(light, "shadow", None) is None for light in lights)
    assert [getattr(light, "color", None) for light in lights] == [light.color for light in rz.tabletop()]


def test_flags_for_shadows_come_first():
    shadows = {light.shadow for light in loaded(CUBE, "--shadows", "--shadow-size", "64").scene.lights[1:]}
    assert shadows == {rz.Shadow(64)}


def test_materials_of_the_file_stay():
    assert loaded(LIFE).scene.meshes == rz.load(LIFE).meshes or all(
        new.palette == old.palette for new, old in zip(loaded(LIFE).scene.meshes, rz.load(LIFE).meshes, strict=True)
    )


def test_a_library_of_materials_that_is_missing_leaves_grey(folder, capsys):
    (folder / "x.obj").write_text("mtllib none.mtl\nusemtl paint\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (material,) = loaded("x.obj").scene.meshes[0].palette
    assert (material.name, material.diffuse) == ("paint", (NEUTRAL,) * 3)
    assert "none.mtl" in capsys.readouterr().err


@pytest.mark.parametrize("flags", ["--preset studio", "--preset headlight", "--light directional:0,-1,0"])
def test_lights_of_flags_leave_the_tabletop(flags):
    found = loaded(CUBE, *flags.split())
    assert not found.is_on_tabletop and found.scene.meshes[0].palette == (rz.Material(),)


def test_a_preset_beside_lights():
    found = loaded(CUBE, "--preset", "tabletop", "--light", "ambient:0.5")
    assert found.is_on_tabletop and found.scene.lights == (*rz.tabletop(), rz.AmbientLight(0.5))


def test_a_scene_file_rules_its_own_look(folder):
    cube = {"vertices": rz.load(CUBE).meshes[0].vertices.tolist(), "faces": rz.load(CUBE).meshes[0].faces.tolist()}
    (folder / "scene.json").write_text(json.dumps({"meshes": [cube]}))
    found = loaded("scene.json")
    assert not found.is_on_tabletop and found.scene.lights == rz.studio()
    assert loaded("scene.json", "--preset", "tabletop").is_on_tabletop


def test_the_ground_is_a_flag(capsys):
    shadows = {}
    for name, flags in {
        "default": [], "none": ["--no-ground"], "studio": ["--preset", "studio"],
        "asked": ["--preset", "studio", "--ground"],
    }.items():  # fmt: skip
        assert run(CUBE, "-o", f"{name}.png", "-s", "64", *flags) == 0
        seen = picture(f"{name}.png")
        shadows[name] = bool(((seen[..., 3] > 0) & (seen[..., 3] < 140) & (seen[..., :3] == 0).all(axis=2)).any())
    assert errors(capsys) == ""
    assert shadows == {"default": True, "none": False, "studio": False, "asked": True}


def test_an_array_has_no_ground_and_the_same_camera(capsys):
    assert run(CUBE, "-o", "x.png") == 0 and run(CUBE, "--array", "face", "-o", "x.npy", "--samples", "1") == 0
    covered = np.load("x.npy") >= 0
    assert (picture("x.png")[..., 3][covered] > 100).all()
    assert run(CUBE, "-o", "y.npy", "--array", "rgb") == 0 and np.load("y.npy")[0, 0].tolist() == [0, 0, 0]
    assert errors(capsys) == ""


def test_coverage_counts_the_model_alone(capsys):
    records = []
    view = ["--eye", "3,3,5"]
    for flags in ([], ["--no-ground"]):
        assert run(CUBE, "--json", *view, *flags) == 0
        records.append(json.loads(capsys.readouterr().out))
    assert records[0]["coverage"] == records[1]["coverage"]


def test_an_opaque_background_shows_the_shadow(capsys):
    assert run(CUBE, "-o", "x.png", "-s", "64", "--background", "white") == 0
    seen = picture("x.png")
    assert seen.shape == (64, 64, 3) and seen[0, 0].tolist() == [255] * 3
    outside = np.concatenate([seen[-3:, :, 0].ravel(), seen[40:, :3, 0].ravel(), seen[40:, -3:, 0].ravel()])
    assert outside.min() < 250
