"""Check what the engine's table says of each reflection model against the models themselves."""

from itertools import cycle, product

import numpy as np
import pytest
from helpers.mirrors import bound_lobe
from helpers.pinhole import unit

import rasterizer as rz
from rasterizer.engine.reflections import (
    LAMBERT,
    MIN_BASE,
    MIN_SUM,
    REFLECTION_TABLE,
    blinn_scale,
    count_terms,
    entry_of,
    fresnel_of,
    has_highlight,
    has_hued_fresnel,
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
            entry.brightest_highlight(material),
            max(highlights(material, *random_sides(seed, 2000)[::-1]).max() for seed in range(6)),
        )
        assert 0.001 * bound < found <= bound, f"{name}: {found:.4g} > {bound:.4g}, or far below"
        slope, steepest = entry.turn_slope(material, DOUBLE) * bound, steepest_of(material)
        assert 2e-4 * slope < steepest <= slope * (1 + 1e-4), f"{name}: {steepest:.4g} > {slope:.4g}, or far below"
    for roughness in (0.1, 0.5, 1.0):
        material = rz.Material(reflection="oren-nayar", diffuse=1, ambient=0, specular=0, roughness=roughness)
        slope, steepest = 1 + entry_of(material).diffuse_slope(material), steepest_of(material)
        assert 0.5 < steepest <= slope, f"rough by {roughness}: {steepest:.4g} > {slope:.4g}"


def lobe_at(material, least_sum, normals_about):
    """Peak, and slopes by the normal and by the light, of a highlight with |L + V| = least_sum, at random normals."""

    def light_at(angle, aside=0.0):
        return unit(np.array([np.sin(angle), aside, np.cos(angle)]))

    between, step = 2 * np.arccos(max(least_sum, 1e-3) / 2), 1e-6
    tilt, azimuth = normals_about
    across = np.stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)], axis=1)
    s, c = np.sin(between / 2), np.cos(between / 2)
    normals = across @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])  # about the half vector
    normals = normals[(normals[:, 2] > 1e-3) & (normals @ light_at(between) > 1e-3)]

    def slope(one, other):
        return (highlights(material, *other) - highlights(material, *one)) / (2 * step)

    to_light, a = light_at(between), unit(np.cross(normals, (0.3, 0.5, 0.8)))
    turned = [
        slope(*((unit(normals + k * step * way), to_light) for k in (-1, 1))) for way in (a, np.cross(normals, a))
    ]
    moved = [slope(*((normals, light_at(between + k * step)) for k in (-1, 1)))]
    moved.append(slope(*((normals, light_at(between, k * step)) for k in (-1, 1))))
    return [f.max(initial=0.0) for f in (highlights(material, normals, to_light), np.hypot(*turned), np.hypot(*moved))]


def test_the_lobes_of_mirrors_are_no_larger_or_steeper_than_their_bounds():
    """Where |L + V| is known to be no less than something."""
    rng, n, shares = np.random.default_rng(3), 1000, [0, 0.01, 0.03, 0.06, 0.15, 0.4, 1]
    cases = product(("ggx", "beckmann"), (0.0, 0.01, 0.3, 1.0, 1.6, 2.0))
    for (distribution, least_sum), roughness in zip(cases, cycle((0.06, 0.15, 0.3, 0.6, 1.0))):
        material = made("cook-torrance", roughness=roughness, distribution=distribution, fresnel=1.0)
        about = (
            np.minimum(abs(roughness * rng.normal(size=n) * rng.choice([0.1, 0.3, 1, 2], n)), 1.5),
            7 * rng.random(n),
        )
        found = np.max([lobe_at(material, least_sum + (2 - least_sum) * share, about) for share in shares], axis=0)
        bounds = bound_lobe(distribution, roughness, np.array([least_sum]))
        for name, worst in zip(("peak", "normal_slope", "light_slope"), found, strict=True):
            bound, case = getattr(bounds, name)[0], f"{name}, {distribution}, {roughness}, |L + V| from {least_sum}"
            assert 0.05 * bound < worst <= bound * (1 + 1e-5), f"{case}: {worst:.4g} > {bound:.4g}, or far below"


@pytest.mark.parametrize("u", [SINGLE, DOUBLE])
def test_the_table_of_mirrors_lies_above_their_lobes(u):
    """Over all |L + V| for which it is said, and not far above: its numbers are those of a highlight of height 1."""
    sums = np.linspace(MIN_SUM[u], 2.0, 60)
    for distribution, roughness in product(("ggx", "beckmann"), np.geomspace(0.001, 1.0, 40)):
        material = made("cook-torrance", roughness=roughness, distribution=distribution)
        entry, lobe = entry_of(material), bound_lobe(distribution, roughness, sums)
        height, fresnel = entry.brightest_highlight(material), 1.0 if u == DOUBLE else 3.0
        # In float32 W(θ) changes by three times itself; the lobes have 2.5 for it.
        more = (fresnel - 2.5) * lobe.peak if u == SINGLE else 0.0
        for name, found, bound in (
            ("rounding", (lobe.rounding + 20.0 * more) * u, entry.highlight_rounding(material, u)),
            ("light", lobe.light_slope + more, entry.light_slope(material, u)),
            ("normal", lobe.normal_slope, entry.turn_slope(material, u)),
            ("height", lobe.peak, 1.001),
        ):
            worst = found.max() / height
            assert worst <= bound, f"{name}, {distribution}, {roughness:.3g}: {worst:.4g} > {bound:.4g}"


def test_the_slope_of_a_power_is_bounded():
    distance = np.sqrt(2) * np.concatenate([np.linspace(0, 1, 4001), np.geomspace(1e-5, 1, 4001)])
    h = 1 - distance**2 / 2
    for exponent in (1, 1.5, 2, 5, 10, 100, 1e4, 1e6):
        slope, bound = (exponent * np.maximum(h, 0) ** (exponent - 1) * distance).max(), power_slope(exponent)
        assert slope <= bound <= 2.2 * slope, f"h^{exponent}: {slope:.4g} > {bound:.4g}, or far below"


def test_rounding_grows_with_the_exponent():
    for u in (SINGLE, DOUBLE):
        for word in ("phong", "blinn"):
            found = [entry_of(m).highlight_rounding(m, u) for m in (made(word, shininess=n) for n in (1, 10, 1e3, 1e6))]
            assert found == sorted(found) and 0 < found[0]


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
        found = entry_of(material).reason_for_float64(material)
        assert found == reason, f"{material}: {found!r} != {reason!r}"


def test_only_what_has_a_weight_is_parted():
    assert count_terms(made("phong")) == 2 and count_terms(made("cook-torrance")) == 3
    assert count_terms(made("cook-torrance", metallic=0.5)) == 4 and fresnel_of(made("cook-torrance")) == 0.04
    for word in REFLECTION_MODELS:
        colored = made(word, fresnel=(0.9, 0.5, 0.1))
        assert (count_terms(colored) == 3) == has_hued_fresnel(colored) == (word in ("phong", "blinn", "cook-torrance"))
        assert count_terms(made(word, fresnel=(0.9, 0.5, 0.1), specular=0)) == 1
    assert blinn_scale(made("blinn", shininess=10, normalized=True)) == pytest.approx(12 * 14 / (8 * (2**-5 + 10)))


def test_nothing_times_infinity_is_nothing():
    assert times([0.0, 2.0, np.inf], [np.inf, 3.0, 0.0]).tolist() == [0.0, 6.0, 0.0]
