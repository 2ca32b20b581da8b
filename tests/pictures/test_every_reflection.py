"""Check the reflection models as physics and as pictures: energy, reciprocity, digits, and what the reference says."""

from functools import cache

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.batches import (
    DIFFUSE,
    DTYPES,
    REFLECTION_FUNCTIONS,
    UP,
    directions_of,
    polar,
    random_directions,
    reflect,
)
from helpers.pinhole import octasphere, unit

import rasterizer as rz
from rasterizer.engine import reflections as reflection_table
from rasterizer.pipeline import material_coefficients as m
from rasterizer.reference import reflection
from rasterizer.reference.reflection import read_materials

WHITE = {"diffuse": 1.0, "specular": 1.0}  # of each term, so that each is integrated by itself


def made(reflection, **options):
    """A material that reflects all it can."""
    return rz.Material(reflection=reflection, **(WHITE | options))


MATERIALS = {
    "lambert": made("lambert"),
    "oren-nayar, smooth": made("oren-nayar", roughness=0.0),
    "oren-nayar": made("oren-nayar", roughness=0.35),
    "oren-nayar, rough": made("oren-nayar", roughness=1.0),
    "ggx": made("cook-torrance", roughness=0.5, fresnel=1.0),
    "ggx, rough": made("cook-torrance", roughness=1.0, fresnel=1.0),
    "ggx, smooth": made("cook-torrance", roughness=0.15, fresnel=1.0),
    "ggx, glass": made("cook-torrance", roughness=0.3),
    "beckmann": made("cook-torrance", distribution="beckmann", roughness=0.5, fresnel=1.0),
    "beckmann, rough": made("cook-torrance", distribution="beckmann", roughness=1.0, fresnel=1.0),
    "beckmann, smooth": made("cook-torrance", distribution="beckmann", roughness=0.15, fresnel=1.0),
    "beckmann, glass": made("cook-torrance", distribution="beckmann", roughness=0.3),
    "phong": made("phong", shininess=20),
    "phong, W": made("phong", shininess=20, fresnel=0.1),
    "phong, normalised": made("phong", shininess=20, normalized=True),
    "phong, normalised, dull": made("phong", shininess=0.7, normalized=True),
    "phong, normalised, W": made("phong", shininess=20, normalized=True, fresnel=0.0),
    "blinn": made("blinn", shininess=20),
    "blinn, W": made("blinn", shininess=20, fresnel=0.1),
    "blinn, normalised": made("blinn", shininess=20, normalized=True),
    "blinn, normalised, dull": made("blinn", shininess=0.7, normalized=True),
    "blinn, normalised, sharp": made("blinn", shininess=200, normalized=True),
    "blinn, normalised, W": made("blinn", shininess=80, normalized=True, fresnel=0.3),
    "ggx, brushed by axis": made("cook-torrance", roughness=(0.2, 0.6), fresnel=1.0, tangent=(3, 0, -1)),
    "ggx, brushed across": made("cook-torrance", roughness=(0.7, 0.15), fresnel=0.3, tangent=(0.1, 0.8, 0.3)),
    "ggx, brushed by u": made("cook-torrance", roughness=(0.15, 0.5), fresnel=0.5),
    "toon": made("toon", shininess=20),
    "toon, two levels": made("toon", shininess=5, levels=2),
}
# As the table in the docstring of scene/material.py says.
RECIPROCAL = {name for name in MATERIALS if name.startswith(("lambert", "oren", "ggx", "beckmann"))}
RECIPROCAL |= {name for name in MATERIALS if "normalised" in name and "W" not in name}
CONSERVING = RECIPROCAL | {name for name in MATERIALS if "normalised" in name}


def model_of(material):
    """The pipeline's word for the function that the plan would choose."""
    model = reflection_table.entry_of(material).function(material)
    return next(word for word, other in REFLECTION_FUNCTIONS.items() if other is model)


def highlight_scale(material):
    """The factor of a normalised highlight, as the table has it."""
    return reflection_table.entry_of(material).highlight_scale(material)


def fast(material, normal, to_light, to_viewer, has_kernels_cosines=False):
    """D and S by the reflection function that the plan would choose, (2, n) float64."""
    along, across = np.broadcast_to(material.roughness, 2)
    coefficients = {
        m.ROUGHNESS: along,
        m.ROUGHNESS_ACROSS: across,
        **dict(zip(range(m.TANGENT_AXIS, m.TANGENT_AXIS + 3), axis_of(material), strict=True)),
        m.HAS_FRESNEL: reflection_table.count_terms(material) > 2,
        m.HIGHLIGHT_SCALE: highlight_scale(material),
        m.TOON_LEVELS: material.levels,
    }
    model = model_of(material)
    fresnel = reflection_table.fresnel_of(material)
    sides = normal, to_light, to_viewer
    found = reflect(model, *sides, 1.0, material.shininess, has_kernels_cosines, coefficients, fresnel)
    if model in DIFFUSE:
        found[1] = 0.0  # nobody reads it
    assert not differences(np.isfinite(found), True)
    return found


def axis_of(material):
    """The axis that a material is brushed along; by u it is the one that `reflect` fills the rows with."""
    return (3.0, 0.0, -1.0) if material.tangent == "u" else material.tangent


def of_reference(material, *sides):
    """D and S by the reference, (2, n), 0 where nothing is lit."""
    corners, faces = octasphere(0)
    scene = rz.Scene([rz.Mesh(corners, faces, uv=corners[:, :2], material=material)])
    table = np.repeat(read_materials(scene), len(sides[0]))
    normal, to_light, to_viewer = (side.astype(float) for side in sides)
    tangents = np.broadcast_to(np.array(axis_of(material), float), normal.shape)
    found = np.stack(reflection.reflect(table, normal, to_light, to_viewer, tangents)[:2])[:, :, 0]
    return np.where((normal * to_light).sum(axis=1) > 0, found, 0)


def grazing_directions(seed, n, dtype):
    """Normals, and directions that graze the surface, some of them to its other side, some opposite to each other or
    equal."""
    rng = np.random.default_rng(seed)
    up = np.sin(10.0 ** rng.uniform(-4, -0.5, (2, n))) * rng.choice([1, 1, 1, -1], (2, n))
    azimuth = rng.choice([0, np.pi, 1.0], n) + rng.choice([1e-3, 0.3], n) * rng.normal(size=n)
    sides = [np.stack(polar(cosine, turn), axis=1) for cosine, turn in zip(up, (np.zeros(n), azimuth), strict=True)]
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return directions_of(dtype, *(np.broadcast_to(v, (n, 3)) @ turn for v in (UP, *sides)))


def all_directions(dtype):
    """Directions all over, in the highlight, and grazing; the viewer, as always, before the surface or hardly behind
    it."""
    rng = np.random.default_rng(8)
    n = 1500
    anywhere, grazing = random_directions(6, n, np.float64), grazing_directions(7, n, np.float64)
    normal, to_light, _ = random_directions(9, n, np.float64)
    mirrored = 2 * (normal * to_light).sum(axis=1, keepdims=True) * normal - to_light
    spread = 10.0 ** rng.uniform(-4, -0.5, (n, 1))
    shiny = [normal, to_light, unit(mirrored + spread * rng.normal(size=normal.shape))]
    sides = [np.concatenate(parts) for parts in zip(anywhere, grazing, shiny, strict=True)]
    is_possible = (sides[0] * sides[2]).sum(axis=1) > -0.1
    return directions_of(dtype, *(side[is_possible] for side in sides))


# ---------------------------------------------------------------- against the formulas


@pytest.mark.parametrize("name", MATERIALS)
def test_reflection_functions_compute_what_the_reference_does(name):
    """In float64, for equal directions; the conditioning of a sharp peak and of exponents is all that may differ."""
    material, sides = MATERIALS[name], all_directions(np.float64)
    found, expected = fast(material, *sides), of_reference(material, *sides)
    # Squared exponents leave out what is below 2^-28.
    least = 2.0**-28 * (1 + highlight_scale(material)) if "phong" in name or "blinn" in name else 0.0
    n_wrong = (np.abs(found - expected) > 1e-9 * (1 + expected) + least).sum()
    assert n_wrong == 0, f"{n_wrong} of {expected.size} wrong, by up to {np.abs(found - expected).max():.3g}"
    assert (expected[0] > 0.01).mean() > 0.1


@pytest.mark.parametrize("dtype", DTYPES)
def test_closed_forms(dtype):
    """Values by hand: all three directions equal, light and viewer equal, and the steps of toon."""
    tiny = 20 * float(np.finfo(dtype).eps)
    same = directions_of(dtype, UP, UP, UP)
    for distribution in ("ggx", "beckmann"):
        material = made("cook-torrance", distribution=distribution, roughness=0.4, fresnel=0.7)
        assert fast(material, *same)[1, 0] == pytest.approx(0.7 / (4 * 0.4**2), rel=tiny)
    clay = made("oren-nayar", roughness=0.5)
    a, b = 1 - 0.5 * 0.25 / (0.25 + 0.33), 0.45 * 0.25 / (0.25 + 0.09)
    assert fast(clay, *same)[0, 0] == pytest.approx(a, rel=tiny)
    retro = directions_of(dtype, UP, polar(0.5), polar(0.5))
    assert fast(clay, *retro)[0, 0] == pytest.approx(0.5 * (a + b * np.sqrt(0.75) * np.sqrt(3)), rel=tiny)
    assert fast(made("phong", fresnel=0.2), *same)[1, 0] == pytest.approx(0.2, rel=tiny)
    assert fast(made("phong", normalized=True, shininess=6), *same)[1, 0] == pytest.approx(4.0, rel=tiny)
    for cosine, step in ((0.01, 0.25), (0.24, 0.25), (0.26, 0.5), (0.74, 0.75), (0.76, 1.0), (1.0, 1.0)):
        sides = directions_of(dtype, UP, polar(cosine), UP)
        assert fast(made("toon", levels=4), *sides)[0, 0] == step
    for shininess in (1, 20.5):
        edge = 0.5 ** (1 / shininess)
        for cosine, expected in ((edge + 1e-4, 1.0), (edge - 1e-4, 0.0)):
            sides = directions_of(dtype, UP, polar(cosine), UP)  # V = N: R·V = N·L
            assert fast(made("toon", shininess=shininess), *sides)[1, 0] == expected


# ---------------------------------------------------------------- physics


@cache
def hemisphere(n=56):
    """Directions over the hemisphere (m, 3), and their weights: solid angle times cosine."""
    # Gauss-Legendre by the polar angle; the trapezium rule round the axis, which converges as fast for a periodic
    # function.
    x, weight = np.polynomial.legendre.leggauss(n)
    theta, azimuth = (x + 1) * np.pi / 4, (np.arange(2 * n) + 0.5) * np.pi / n
    cosine, azimuth = (values.ravel() for values in np.meshgrid(np.cos(theta), azimuth, indexing="ij"))
    solid = np.repeat(weight * np.pi / 4 * np.sin(theta) * np.cos(theta), 2 * n) * np.pi / n
    return np.stack(polar(cosine, azimuth), axis=1), solid


def albedos(material, degrees):
    """The share of a light's energy that the terms D and S reflect: ∫ f(L, V) cos θv dω, with f = intensity / (π
    N·L)."""
    to_viewer, weight = hemisphere()
    cosine = np.cos(np.radians(degrees))
    found = fast(material, *directions_of(np.float64, UP, polar(cosine), to_viewer))
    return found @ weight / (np.pi * cosine)


ANGLES = (0.0, 40.0, 75.0, 85.0)


def test_no_more_light_leaves_than_arrives_where_the_table_says_so():
    """Classic highlights don't shrink with N·L, so f grows without limit towards grazing light; steps are rounded
    up."""
    for name in MATERIALS:
        if name in CONSERVING:
            shares = np.array([albedos(MATERIALS[name], degrees) for degrees in ANGLES])
            assert shares.max() <= 1 + 2e-4 and (shares.max(axis=1) > 0).all(), f"{name}: {shares}"
        else:
            most = max(albedos(MATERIALS[name], degrees).max() for degrees in (*ANGLES, 89.0, 89.9))
            assert most > 1.05, f"{name}: {most} <= 1.05"


def test_reciprocity_holds_where_the_table_says_so_and_nowhere_else():
    sides = random_directions(11, 4000, np.float64)
    is_before = [(sides[0] * side).sum(axis=1) > 0.02 for side in sides[1:]]
    normal, to_light, to_viewer = (side[is_before[0] & is_before[1]] for side in sides)
    for name, material in MATERIALS.items():
        there = fast(material, normal, to_light, to_viewer) / (normal * to_light).sum(axis=1)
        back = fast(material, normal, to_viewer, to_light) / (normal * to_viewer).sum(axis=1)
        difference = np.abs(there - back).max()
        least = 2.0**-27 * (1 + highlight_scale(material)) if "normalised" in name else 0.0
        most = 1e-12 * max(1.0, there.max()) + least if name in RECIPROCAL else np.inf
        assert difference <= most, f"{name}: {difference:.3g} > {most:.3g}"
        assert name in RECIPROCAL or difference > 0.1, f"{name}: {difference:.3g} <= 0.1"
