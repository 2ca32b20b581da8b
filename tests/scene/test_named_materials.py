"""Check the classic table of materials, and every way to name one."""

import json
from dataclasses import replace

import numpy as np
import pytest
from helpers.command import CUBE, PLAIN, errors, picture, run

import rasterizer as rz
from rasterizer.cli import arguments
from rasterizer.errors import SceneError
from rasterizer.scene.named_materials import NAMED_MATERIALS

GOLD = {
    "ambient": (0.24725, 0.1995, 0.0745), "diffuse": (0.75164, 0.60648, 0.22648),
    "specular": (0.628281, 0.555802, 0.366065),
    "shininess": 51.2,
}  # fmt: skip


def test_the_table_has_legal_materials():
    assert len(NAMED_MATERIALS) == 24
    for name in NAMED_MATERIALS:
        material = rz.Material.named(name)
        assert material.name == name and 1 < material.shininess <= 128
        assert all(0 <= c <= 1 for field in ("ambient", "diffuse", "specular") for c in getattr(material, field))
    assert len({replace(rz.Material.named(name), name="") for name in NAMED_MATERIALS}) == 24


def test_gold_by_hand_and_with_changes():
    assert rz.Material.named("gold") == rz.Material(name="gold", **GOLD)
    assert rz.Material.named("gold", shininess=7, name="coin") == rz.Material(name="coin", **GOLD | {"shininess": 7})
    for wrong in ("golden", 3, None):
        with pytest.raises(SceneError, match="a named material is one of brass, bronze, .*red rubber"):
            rz.Material.named(wrong)


def test_the_command_line(folder, capsys):
    assert arguments.parse(["render", "x.obj", "--material", "gold"]).materials == [GOLD]
    parsed = arguments.parse(["render", "x.obj", "--material", "red plastic,shininess=80,fresnel=0.5/0.4/0.3"])
    assert parsed.materials[0]["shininess"] == 80 and parsed.materials[0]["fresnel"] == (0.5, 0.4, 0.3)
    assert run(CUBE, "--material", "gold", "-o", "gold.png", *PLAIN) == 0
    scene = rz.load(CUBE)
    mesh = replace(scene.meshes[0], material=rz.Material(**GOLD))
    assert np.array_equal(picture("gold.png"), rz.render(replace(scene, meshes=[mesh]), (24, 16), samples=4))
    assert run(CUBE, "--material", "golden", "-o", "no.png") == 2
    assert "a named material is one of" in errors(capsys)


def test_scene_files(folder):
    triangle = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}

    def material_of(materials, name):
        (folder / "s.json").write_text(json.dumps({"meshes": [triangle | {"material": name}], "materials": materials}))
        return rz.load("s.json").meshes[0].material

    assert material_of({}, "red plastic") == rz.Material.named("red plastic")
    assert material_of({"gold": {"diffuse": 0.5}}, "gold") == rz.Material(diffuse=0.5, name="gold"), (
        "the file's own come first"
    )
    with pytest.raises(SceneError, match=r"meshes\[0\].material: must be .*\(none\) or of the classic ones \(brass"):
        material_of({}, "golden")
