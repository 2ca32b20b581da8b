"""Materials: defaults, normal forms, refusals."""

import math
from dataclasses import FrozenInstanceError, replace

import pytest

from rasterizer.errors import SceneError
from rasterizer.scene.material import Material


def test_default_is_neutral_grey():
    material = Material()
    assert material.diffuse == material.ambient == (0.72, 0.72, 0.72)
    assert material.specular == (0.18, 0.18, 0.18) and material.emissive == (0.0, 0.0, 0.0)
    assert (material.shininess, material.opacity, material.reflection, material.name) == (
        32.0,
        1.0,
        "phong",
        "",
    )


def test_colours_become_linear_triples():
    material = Material(ambient="white", diffuse=(0.1, 0.2, 0.3), specular=2, emissive="#000")
    assert material.ambient == (1.0, 1.0, 1.0)
    assert material.diffuse == (0.1, 0.2, 0.3)
    assert material.specular == (2.0, 2.0, 2.0)
    assert material.emissive == (0.0, 0.0, 0.0)


def test_ambient_follows_diffuse_unless_given():
    assert Material(diffuse="red").ambient == (1.0, 0.0, 0.0)
    assert Material(diffuse="red", ambient=0.1).ambient == (0.1, 0.1, 0.1)
    assert replace(Material(), diffuse=0.5, ambient=None).ambient == (0.5, 0.5, 0.5)


def test_materials_are_frozen_and_comparable():
    with pytest.raises(FrozenInstanceError):
        Material().diffuse = 1.0
    assert Material() == Material() and hash(Material()) == hash(Material())
    assert Material(reflection="blinn") != Material()


@pytest.mark.parametrize("shininess", [0.5, 1, 1000, 1e6])
def test_legal_shininess(shininess):
    assert Material(shininess=shininess).shininess == shininess


@pytest.mark.parametrize(
    ("field", "wrong"),
    [
        ("diffuse", -0.1),
        ("ambient", "nocolour"),
        ("specular", math.nan),
        ("emissive", (1, 2)),
        ("shininess", 0.0),
        ("shininess", -3),
        ("shininess", math.inf),
        ("shininess", "dull"),
        ("shininess", True),
        ("opacity", 1.01),
        ("opacity", -0.1),
        ("opacity", math.nan),
        ("opacity", None),
        ("reflection", "Phong"),
        ("reflection", None),
        ("roughness", -0.1),
        ("roughness", 1.1),
        ("roughness", "rough"),
        ("distribution", "GGX"),
        ("distribution", None),
        ("fresnel", 1.5),
        ("fresnel", -0.1),
        ("fresnel", math.nan),
        ("fresnel", (0.1, 0.2, 1.5)),
        ("fresnel", (0.1, 0.2)),
        ("tangent", "v"),
        ("tangent", (0, 0, 0)),
        ("roughness", (0.1, 0.2)),
        ("normalized", 1),
        ("normalized", "yes"),
        ("levels", 0),
        ("levels", 2.5),
        ("levels", 257),
        ("levels", True),
        ("name", None),
    ],
)
def test_illegal_values_are_refused_by_field(field, wrong):
    with pytest.raises(SceneError, match=f"material's {field}"):
        Material(**{field: wrong})


def test_cook_torrance_needs_some_roughness():
    assert Material(reflection="oren-nayar", roughness=0).roughness == 0.0
    assert Material(reflection="cook-torrance", roughness=0.001).roughness == 0.001
    for roughness in (0.0, 0.0009):
        with pytest.raises(SceneError, match="material's roughness must be within 0.001..1"):
            Material(reflection="cook-torrance", roughness=roughness)
    with pytest.raises(SceneError, match="material's roughness"):
        replace(Material(roughness=0.0), reflection="cook-torrance")


def test_numbers_of_the_models_in_their_normal_form():
    material = Material(fresnel=1, levels=4.0, normalized=True, roughness=1)
    assert (material.fresnel, material.levels, material.normalized, material.roughness) == (1.0, 4, True, 1.0)
    assert type(material.levels) is int and type(material.fresnel) is float
    assert Material().fresnel is None
