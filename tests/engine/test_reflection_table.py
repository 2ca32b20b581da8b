"""Check what the engine's table says of each reflection model against the models themselves."""

import numpy as np
import pytest

import rasterizer as rz
from rasterizer.engine.reflection_table import (
    LAMBERT,
    REFLECTION_TABLE,
    blinn_scale,
    entry_of,
    first_fresnel,
    has_colored_fresnel,
    has_highlight,
    power_slope,
)
from rasterizer.engine.rounding import DOUBLE, SINGLE, times
from rasterizer.scene.material import REFLECTION_MODELS


def made(reflection, **fields):
    """A material that reflects its highlight alone."""
    return rz.Material(reflection=reflection, **{"diffuse": 0, "ambient": 0, "specular": 1} | fields)


HIGHLIGHTS = {
    "phong": made("phong", shininess=12),
    "phong, blunt": made("phong", shininess=1),
    "phong, sharp": made("phong", shininess=400),
    "phong, normalised": made("phong", shininess=12, normalized=True),
    "phong, W": made("phong", shininess=12, fresnel=0.1),
    "blinn": made("blinn", shininess=30),
    "blinn, normalised, W": made("blinn", shininess=30, normalized=True, fresnel=0.3),
    "ggx": made("cook-torrance", roughness=0.3),
    "ggx, smooth": made("cook-torrance", roughness=0.08),
    "beckmann": made("cook-torrance", roughness=0.25, distribution="beckmann"),
}
UP = (0.0, 0.0, 1.0)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def highlights(material, normals, to_light):
    """The highlights (n,) at points with these normals, seen from above."""
    found = rz.illuminate(np.zeros_like(normals), normals, material, rz.DirectionalLight(-to_light), toward_viewer=UP)
    return found[:, 0]


def random_sides(seed, n):
    """A light direction, and unit normals (n, 3) that see it and the viewer; many of them next to the half vector."""
    rng = np.random.default_rng(seed)
    to_light = unit(rng.normal(size=3) + (0, 0, 1.2))
    spread = rng.choice([0.02, 0.2, 1.0], (n, 1))
    normals = unit(unit(to_light + UP) + spread * rng.normal(size=(n, 3)))
    is_ahead = (normals @ to_light > 0.01) & (normals[:, 2] > 0.01)
    return to_light, normals[is_ahead]


def test_every_model_has_an_entry():
    assert set(REFLECTION_TABLE) == set(REFLECTION_MODELS)
    for word in REFLECTION_MODELS:
        material = made(word)
        assert entry_of(material) is REFLECTION_TABLE[word]
        assert callable(entry_of(material).function(material).evaluate)
        dull = made(word, specular=0)
        assert entry_of(dull) is (REFLECTION_TABLE[word] if word in ("oren-nayar", "toon") else LAMBERT)
        assert not has_highlight(dull)
        assert has_highlight(material) == (word not in ("lambert", "oren-nayar"))


@pytest.mark.parametrize("name", HIGHLIGHTS)
def test_no_highlight_is_brighter_than_the_table_says(name):
    material = HIGHLIGHTS[name]
    bound = entry_of(material).brightest_highlight(material)
    largest = max(highlights(material, *random_sides(seed, 4000)[::-1]).max() for seed in range(12))
    assert largest <= bound, f"{largest:.4g} > {bound:.4g}"
    assert largest > 0.001 * bound, f"{largest:.4g} is far below the bound, {bound:.4g}"


@pytest.mark.parametrize("name", HIGHLIGHTS)
def test_no_highlight_changes_faster_with_the_normal_than_the_table_says(name):
    """Relative to the largest value, by differences over a small angle."""
    material, angle, steepest = HIGHLIGHTS[name], 1e-6, 0.0
    entry = entry_of(material)
    for seed in range(12):
        to_light, normals = random_sides(seed, 4000)
        across = unit(np.cross(normals, np.random.default_rng(seed).normal(size=normals.shape)))
        pair = [highlights(material, unit(normals + sign * angle / 2 * across), to_light) for sign in (-1, 1)]
        steepest = max(steepest, np.abs(pair[1] - pair[0]).max() / angle)
    bound = entry.turn_slope(material) * entry.brightest_highlight(material)
    assert steepest <= bound * (1 + 1e-4), f"{steepest:.4g} > {bound:.4g}"
    assert steepest > 0.001 * bound, f"{steepest:.4g} is far below the bound, {bound:.4g}"


@pytest.mark.parametrize("roughness", [0.1, 0.5, 1.0])
def test_the_diffuse_term_of_rough_surfaces_changes_no_faster_than_the_table_says(roughness):
    material = rz.Material(reflection="oren-nayar", diffuse=1, ambient=0, specular=0, roughness=roughness)
    bound, steepest, angle = 1 + entry_of(material).diffuse_slope(material), 0.0, 1e-6
    for seed in range(12):
        to_light, normals = random_sides(seed, 4000)
        across = unit(np.cross(normals, np.random.default_rng(seed).normal(size=normals.shape)))
        pair = [highlights(material, unit(normals + sign * angle / 2 * across), to_light) for sign in (-1, 1)]
        steepest = max(steepest, np.abs(pair[1] - pair[0]).max() / angle)
    assert 0.5 < steepest <= bound, f"{steepest:.4g} > {bound:.4g}"


@pytest.mark.parametrize("exponent", [1, 1.5, 2, 5, 10, 100, 1e4, 1e6])
def test_the_slope_of_a_power_is_bounded(exponent):
    distance = np.sqrt(2) * np.concatenate([np.linspace(0, 1, 4001), np.geomspace(1e-5, 1, 4001)])
    h = 1 - distance**2 / 2
    slope = (exponent * np.maximum(h, 0) ** (exponent - 1) * distance).max()
    assert slope <= power_slope(exponent) <= 2.2 * slope, f"{slope:.4g}, the bound {power_slope(exponent):.4g}"


def test_rounding_grows_with_the_exponent_and_never_exceeds_the_highlight():
    for u in (SINGLE, DOUBLE):
        for word in ("phong", "blinn"):
            found = [
                entry_of(m).highlight_rounding(m, u) for m in (made(word, shininess=n) for n in (1, 10, 1e3, 1e12))
            ]
            assert found == sorted(found) and 0 < found[0] and found[-1] <= 1
        steep = made("phong", shininess=0.1)
        assert 0.01 < entry_of(steep).highlight_rounding(steep, u) <= 1
        assert entry_of(steep).turn_slope(steep) == np.inf
        change = entry_of(steep).highlight_change(steep, np.array([0.0, 1e-9, 1.0, np.inf]))
        assert change[0] == 0 and 0 < change[1] < 1 and (change[2:] == 1).all()


def test_models_say_why_they_need_float64():
    cases = {
        made("phong", shininess=0.9): "an exponent below 1",
        made("phong", shininess=0.9, specular=0): "",
        made("toon"): "toon levels",
        made("cook-torrance", roughness=(0.1, 0.4), tangent=(1, 0, 0)): "brushed materials",
        made("cook-torrance", roughness=(0.1, 0.4), tangent=(1, 0, 0), specular=0): "",
        made("cook-torrance"): "",
        made("oren-nayar"): "",
    }
    for material, reason in cases.items():
        assert entry_of(material).reason_for_float64(material) == reason


def test_fresnel_as_the_pipeline_takes_it():
    assert first_fresnel(made("phong")) == 1.0 and first_fresnel(made("cook-torrance")) == 0.04
    assert first_fresnel(made("blinn", fresnel=0.3)) == 0.3
    for word in REFLECTION_MODELS:
        colored = made(word, fresnel=(0.9, 0.5, 0.1))
        assert first_fresnel(colored) == 1.0
        assert has_colored_fresnel(colored) == (word in ("phong", "blinn", "cook-torrance"))
        assert not has_colored_fresnel(made(word, fresnel=(0.9, 0.5, 0.1), specular=0))
    assert blinn_scale(made("blinn", shininess=10, normalized=True)) == pytest.approx(12 * 14 / (8 * (2**-5 + 10)))


def test_nothing_times_infinity_is_nothing():
    assert times([0.0, 2.0, np.inf], [np.inf, 3.0, 0.0]).tolist() == [0.0, 6.0, 0.0]
