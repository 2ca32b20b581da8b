"""Check what the engine's table says of each reflection model against the models themselves."""

import numpy as np
import pytest
from helpers.pinhole import unit

import rasterizer as rz
from rasterizer.engine.reflections import (
    LAMBERT,
    MIN_BASE,
    REFLECTION_TABLE,
    count_terms,
    entry_of,
    fresnel_of,
    power_slope,
)
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
        assert callable(entry_of(material).function(material))
        dull = made(word, specular=0)
        assert entry_of(dull) is (REFLECTION_TABLE[word] if word in ("oren-nayar", "toon") else LAMBERT)
        assert count_terms(dull) == 1
        assert (count_terms(material) > 1) == (word not in ("lambert", "oren-nayar"))


def steepest_of(material, seeds=12):
    """The largest change of the light of a material for each radian that the normal turns, by differences."""
    found, angle = 0.0, 1e-6
    for seed in range(seeds):
        to_light, normals = random_sides(seed, 4000)
        across = unit(np.cross(normals, np.random.default_rng(seed).normal(size=normals.shape)))
        pair = [highlights(material, unit(normals + sign * angle / 2 * across), to_light) for sign in (-1, 1)]
        found = max(found, np.abs(pair[1] - pair[0]).max() / angle)
    return found


def test_no_highlight_is_brighter_or_steeper_than_the_table_says():
    for name, material in HIGHLIGHTS.items():
        entry = entry_of(material)
        bound, found = (
            entry.limits(material).peak,
            max(highlights(material, *random_sides(seed, 2000)[::-1]).max() for seed in range(6)),
        )
        assert 0.001 * bound < found <= bound, f"{name}: {found:.4g} > {bound:.4g}, or far below"
        if material.reflection != "cook-torrance":  # whose slopes hold where light and viewer aren't opposite
            slope, steepest = entry.limits(material).slope * bound, steepest_of(material)
            assert 2e-4 * slope < steepest <= slope * (1 + 1e-4), f"{name}: {steepest:.4g} > {slope:.4g}, or far below"
    for roughness in (0.1, 0.5, 1.0):
        material = rz.Material(reflection="oren-nayar", diffuse=1, ambient=0, specular=0, roughness=roughness)
        slope, steepest = 1 + entry_of(material).limits(material).rough, steepest_of(material)
        assert 0.5 < steepest <= slope, f"rough by {roughness}: {steepest:.4g} > {slope:.4g}"


def test_the_slope_of_a_power_is_bounded():
    distance = np.sqrt(2) * np.concatenate([np.linspace(0, 1, 4001), np.geomspace(1e-5, 1, 4001)])
    h = 1 - distance**2 / 2
    for exponent in (1, 1.5, 2, 5, 10, 100, 1e4, 1e6):
        slope, bound = (exponent * np.maximum(h, 0) ** (exponent - 1) * distance).max(), power_slope(exponent)
        assert slope <= bound <= 2.2 * slope, f"h^{exponent}: {slope:.4g} > {bound:.4g}, or far below"


def test_a_power_with_an_exponent_below_1_has_a_slope_where_its_bound_holds():
    h = np.geomspace(MIN_BASE, 1.0, 4001)
    for exponent in (0.05, 0.3, 0.9):
        slope = (exponent * h ** (exponent - 1.0) * np.sqrt(2.0 - 2.0 * h)).max()
        assert slope <= power_slope(exponent) <= 1.01 * slope, exponent


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
        found = entry_of(material).limits(material).reason
        assert found == reason, f"{material}: {found!r} != {reason!r}"


def test_only_what_has_a_weight_is_parted():
    assert count_terms(made("phong")) == 2 and count_terms(made("cook-torrance")) == 3
    assert count_terms(made("cook-torrance", metallic=0.5)) == 4 and fresnel_of(made("cook-torrance")) == 0.04
    for word in REFLECTION_MODELS:
        colored = made(word, fresnel=(0.9, 0.5, 0.1))
        assert (count_terms(colored) == 3) == (word in ("phong", "blinn", "cook-torrance"))
        assert count_terms(made(word, fresnel=(0.9, 0.5, 0.1), specular=0)) == 1
    blinn = made("blinn", shininess=10, normalized=True)
    assert entry_of(blinn).highlight_scale(blinn) == pytest.approx(12 * 14 / (8 * (2**-5 + 10)))
