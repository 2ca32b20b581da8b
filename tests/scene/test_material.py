"""Materials: defaults, normal forms, refusals, and the classic table with every way to name one of it."""

import math
from dataclasses import replace

import pytest
from helpers.refusals import assert_refused

from rasterizer.errors import SceneError
from rasterizer.scene.material import Material


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


# --- named materials ----------------------------------------------------------------------------------------

GOLD = {
    "ambient": (0.24725, 0.1995, 0.0745), "diffuse": (0.75164, 0.60648, 0.22648),
    "specular": (0.628281, 0.555802, 0.366065), "shininess": 51.2,
}  # fmt: skip


def test_gold_by_hand_and_with_changes():
    assert Material.named("gold") == Material(name="gold", **GOLD)
    assert Material.named("gold", shininess=7, name="coin") == Material(name="coin", **GOLD | {"shininess": 7})
    said = "a named material is one of brass, bronze, .*red rubber"
    assert_refused(Material.named, [(wrong, said) for wrong in ("golden", 3, None)], SceneError)
