"""Materials: defaults, normal forms, refusals, and the classic table with every way to name one of it."""

import json
import math
from dataclasses import FrozenInstanceError, replace

import pytest
from helpers.arrays import differences
from helpers.command import CUBE, PLAIN, errors, picture, run
from helpers.refusals import assert_refused

import rasterizer as rz
from rasterizer.errors import SceneError
from rasterizer.scene.material import NAMED_MATERIALS, Material


def test_default_is_neutral_grey():
    material = Material()
    assert material.diffuse == material.ambient == (0.55, 0.55, 0.55)
    assert material.specular == (0.18, 0.18, 0.18) and material.emissive == (0.0, 0.0, 0.0)
    assert (material.shininess, material.opacity, material.reflection, material.name) == (32.0, 1.0, "phong", "")


def test_colours_become_linear_triples_and_ambient_follows_diffuse_unless_given():
    material = Material(ambient="white", diffuse=(0.1, 0.2, 0.3), specular=2, emissive="#000")
    assert (material.ambient, material.diffuse) == ((1.0, 1.0, 1.0), (0.1, 0.2, 0.3))
    assert (material.specular, material.emissive) == ((2.0, 2.0, 2.0), (0.0, 0.0, 0.0))
    assert Material(diffuse="red").ambient == (1.0, 0.0, 0.0)
    assert Material(diffuse="red", ambient=0.1).ambient == (0.1, 0.1, 0.1)
    assert replace(Material(), diffuse=0.5, ambient=None).ambient == (0.5, 0.5, 0.5)


def test_materials_are_frozen_and_comparable():
    with pytest.raises(FrozenInstanceError):
        Material().diffuse = 1.0
    assert Material() == Material() and hash(Material()) == hash(Material())
    assert Material(reflection="blinn") != Material()


def test_illegal_values_are_refused_by_field():
    wrong = {
        "diffuse": [-0.1], "ambient": ["nocolour"], "specular": [math.nan], "emissive": [(1, 2)],
        "shininess": [0.0, -3, math.inf, "dull", True], "opacity": [1.01, -0.1, math.nan, None],
        "reflection": ["Phong", None], "roughness": [-0.1, 1.1, "rough", (0.1, 0.2)], "distribution": ["GGX", None],
        "fresnel": [1.5, -0.1, math.nan, (0.1, 0.2, 1.5), (0.1, 0.2)], "tangent": ["v", (0, 0, 0)],
        "normalized": [1, "yes"], "levels": [0, 2.5, 257, True], "name": [None],
    }  # fmt: skip
    cases = [({field: value}, f"material's {field}") for field, values in wrong.items() for value in values]
    assert_refused(lambda given: Material(**given), cases, SceneError)
    for shininess in (0.5, 1, 1000, 1e6):
        assert Material(shininess=shininess).shininess == shininess


def test_cook_torrance_needs_some_roughness():
    assert Material(reflection="oren-nayar", roughness=0).roughness == 0.0
    assert Material(reflection="cook-torrance", roughness=0.001).roughness == 0.001
    for roughness in (0.0, 0.0009):
        with pytest.raises(SceneError, match=r"material's roughness must be within 0\.001\.\.1"):
            Material(reflection="cook-torrance", roughness=roughness)
    with pytest.raises(SceneError, match="material's roughness"):
        replace(Material(roughness=0.0), reflection="cook-torrance")


def test_numbers_of_the_models_in_their_normal_form():
    material = Material(fresnel=1, levels=4.0, normalized=True, roughness=1)
    assert (material.fresnel, material.levels, material.normalized, material.roughness) == (1.0, 4, True, 1.0)
    assert type(material.levels) is int and type(material.fresnel) is float
    assert Material().fresnel is None


# --- named materials ----------------------------------------------------------------------------------------

GOLD = {
    "ambient": (0.24725, 0.1995, 0.0745), "diffuse": (0.75164, 0.60648, 0.22648),
    "specular": (0.628281, 0.555802, 0.366065), "shininess": 51.2,
}  # fmt: skip


def test_the_table_has_legal_materials():
    named = [Material.named(name) for name in NAMED_MATERIALS]
    assert len(named) == len({replace(each, name="") for each in named}) == 24
    for name, each in zip(NAMED_MATERIALS, named, strict=True):
        assert each.name == name, f"{name}: {each.name} != {name}"
        assert 1 < each.shininess <= 128, name
        assert all(0 <= c <= 1 for field in ("ambient", "diffuse", "specular") for c in getattr(each, field)), name


def test_gold_by_hand_and_with_changes():
    assert Material.named("gold") == Material(name="gold", **GOLD)
    assert Material.named("gold", shininess=7, name="coin") == Material(name="coin", **GOLD | {"shininess": 7})
    said = "a named material is one of brass, bronze, .*red rubber"
    assert_refused(Material.named, [(wrong, said) for wrong in ("golden", 3, None)], SceneError)


def test_the_command_line_takes_names_with_changes(folder, capsys):
    assert run(CUBE, "--material", "gold,shininess=80", "-o", "gold.png", *PLAIN) == 0
    scene = rz.load(CUBE)
    mesh = replace(scene.meshes[0], material=Material(**GOLD | {"shininess": 80}))
    assert not differences(
        picture("gold.png"), rz.render(replace(scene, meshes=[mesh]), (24, 16), samples=4, shading="gouraud")
    )
    assert run(CUBE, "--material", "golden", "-o", "no.png") == 2
    said = errors(capsys)
    assert "a named material is one of" in said and "did you mean gold?" in said and len(said) < 300


def test_scene_files_take_names_after_their_own(folder):
    triangle = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}

    def material_of(materials, name):
        (folder / "s.json").write_text(json.dumps({"meshes": [triangle | {"material": name}], "materials": materials}))
        return rz.load("s.json").meshes[0].material

    assert material_of({}, "red plastic") == Material.named("red plastic")
    own = material_of({"gold": {"diffuse": 0.5}}, "gold")
    assert own == Material(diffuse=0.5, name="gold"), "the file's own come first"
    with pytest.raises(SceneError, match=r"meshes\[0\].material: must be .*\(none\) or of the classic ones \(brass"):
        material_of({}, "golden")
