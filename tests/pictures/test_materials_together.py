"""Check scenes whose surfaces need different things: each is drawn as the reference draws it, and no surface changes a
bit of another.

A pixel is a function of the polygon that it shows and of its place: what else is in its band, how high the band is and
which thread draws it must not matter.
"""

import itertools

import numpy as np
import pytest
from helpers.against_reference import assert_matches_reference
from helpers.arrays import deviations
from helpers.pairs import pairs
from helpers.pinhole import octasphere

import rasterizer as rz

SIZE = (52, 44)
BALL = octasphere(1)
RNG = np.random.default_rng(12)
PAPER = rz.Texture(RNG.uniform(0.2, 1, (6, 5, 3)), "bilinear")
FOIL = rz.Texture(np.concatenate([RNG.uniform(0.2, 1, (4, 4, 3)), RNG.uniform(0, 1, (4, 4, 1))], axis=2), "bilinear")
CLAY = (0.8, 0.4, 0.2)
LOOKS = {
    "plain": rz.Material(diffuse=0.7),
    "dull": rz.Material(diffuse=0.5, specular=0),
    "tinted": rz.Material(ambient=CLAY, diffuse=CLAY, specular=0),
    "coloured": rz.Material(diffuse=(0.2, 0.5, 0.9), specular=0.3),
    "textured": rz.Material(texture=PAPER),
    "toon": rz.Material(reflection="toon", specular=0.5, diffuse=(0.3, 0.7, 0.4)),
    "shininess 1000": rz.Material(specular=0.5, shininess=1000),
    "mirror": rz.Material(specular=0.5, shininess=20_000),
    "cook-torrance": rz.Material(reflection="cook-torrance", specular=0.6, fresnel=(0.9, 0.6, 0.2)),
    "glass": rz.Material(diffuse=(0.5, 0.8, 0.6), opacity=0.4),
    "smoke": rz.Material(diffuse=0.3, specular=0, opacity=0.7),
    "foil": rz.Material(texture=FOIL, opacity=0.8),
    "textured toon": rz.Material(reflection="toon", specular=0.5, texture=PAPER),
    "worn metal": rz.Material(
        reflection="cook-torrance", metallic=0.9, diffuse=CLAY, roughness=0.8, texture=PAPER, metallic_roughness=PAPER
    ),
    "opacity 0": rz.Material(diffuse="red", opacity=0.0),
    "vertex colours": rz.Material(),
}
GREY = (rz.AmbientLight(0.1), rz.DirectionalLight((-0.4, -0.5, -0.8), 0.8))
LAMPS = (*GREY, rz.PointLight((2, 3, 4), (0.4, 0.3, 0.2), (1, 0.1, 0.05)))
CAMERA = rz.Camera.perspective((1.0, 1.5, 5.5), (0, 0, 0), fov=40, near=1.0, far=20.0)


def ball(look, center=(0, 0, 0), radius=0.7, shape=BALL):
    """A ball of one of LOOKS."""
    vertices, faces = shape
    extras = {"uv": 1.3 * vertices[:, :2]}
    if look == "vertex colours":
        extras["colors"] = np.random.default_rng(len(vertices)).uniform(0, 1, vertices.shape)
    return rz.Mesh(vertices * radius + np.array(center, float), faces, material=LOOKS[look], crease_angle=60, **extras)


def balls(looks, rng=None, lights=GREY):
    """A scene with a ball of each look, side by side and one before another; at random places where `rng` is given."""
    centers = [(1.05 * (k % 3) - 1.05, 1.05 * (k // 3 % 3) - 1.05, 0.45 * (k * 5 % 4) - 0.9) for k in range(len(looks))]
    sizes = [0.75] * len(looks)
    if rng is not None:
        centers, sizes = rng.uniform(-1.6, 1.6, (len(looks), 3)), rng.uniform(0.2, 1.2, len(looks))
    made = [ball(look, center, size) for look, center, size in zip(looks, centers, sizes, strict=True)]
    return rz.Scene(made, lights, CAMERA)


def patchwork(looks, lights=GREY, **mesh):
    """One mesh, whose faces have the looks by turns."""
    vertices, faces = octasphere(2)
    numbers = np.random.default_rng(3).integers(0, len(looks), len(faces))
    mesh = {"uv": vertices[:, :2], "materials": [LOOKS[look] for look in looks], "face_material": numbers} | mesh
    return rz.Scene([rz.Mesh(1.5 * vertices, faces, crease_angle=60, **mesh)], lights, CAMERA)


def floor_with(looks, lights=LAMPS):
    """Balls on a floor that reaches behind the camera: it is clipped."""
    corners = np.array([(-30.0, -1.2, -12), (30, -1.2, -12), (30, -1.2, 30), (-30, -1.2, 30)])
    floor = rz.Mesh(corners, [(0, 2, 1), (0, 3, 2)], uv=0.4 * corners[:, [0, 2]], material=LOOKS[looks[0]])
    return rz.Scene([floor, *balls(looks[1:]).meshes], lights, CAMERA)


SCENES = {
    "balls": lambda: balls([look for look in LOOKS if look != "foil"]),
    "balls, none transparent": lambda: balls(
        ["plain", "coloured", "textured", "shininess 1000", "vertex colours", "dull", "cook-torrance"], lights=LAMPS
    ),
    "balls of one tint beside a coloured one": lambda: balls(["tinted", "tinted", "coloured", "textured", "tinted"]),
    "one mesh": lambda: patchwork(["plain", "dull", "coloured", "textured", "toon", "shininess 1000", "glass"]),
    "one mesh with colours": lambda: patchwork(
        ["plain", "coloured", "textured", "smoke"], LAMPS, colors=RNG.uniform(0, 1, octasphere(2)[0].shape)
    ),
    "a plain floor": lambda: floor_with(["plain", "textured", "coloured", "plain", "glass"]),
    "a textured floor": lambda: floor_with(["textured", "plain", "plain", "toon", "coloured", "opacity 0"]),
    "textures in both types": lambda: balls(["textured", "textured toon", "plain", "foil", "textured toon"]),
    "transparent textures": lambda: balls(["foil", "plain", "glass", "smoke", "textured", "foil", "tinted"]),
}


# ---------------------------------------------------------------- as the reference draws them


WAYS = itertools.cycle(pairs(shading=("phong", "gouraud", "flat"), samples=(1, 4), tolerance=(1 / 4096, 0.0, 0.01)))


@pytest.mark.parametrize("name, way", [(name, next(WAYS)) for name in SCENES], ids=str)
def test_each_surface_is_within_the_bound_of_the_picture(name, way):
    """Against the reference, which knows of no ways; a toon's levels jump, so a few of their pixels may be off."""
    scene, options = SCENES[name](), dict(zip(("shading", "samples", "tolerance"), way, strict=True))
    stats = rz.render(scene, SIZE, **options).stats
    bound, most = stats.error_bound, max(1.01 * options["tolerance"], 2e-5 * max(stats.plan.bound, 1.0))
    assert bound <= most, f"the bound {bound:.3g} > {most:.3g}"
    has_steps = any(material.reflection == "toon" for mesh in scene.meshes for material in mesh.palette)
    far = 0.01 if has_steps and options["shading"] == "phong" else 0.0
    assert_matches_reference(scene, SIZE, bound, ignored=0.08, far=far, **options)


# ---------------------------------------------------------------- whatever else is in the band


def assert_same_in_all_bands(scene, message, size=SIZE, **options):
    """Refuse a picture that other threads change: with their number, bands become lower."""
    options |= {"outputs": ("color", "rgb")}
    expected = rz.render(scene, size, threads=1, **options)
    is_clear = all(material.opacity == 0 for mesh in scene.meshes for material in mesh.palette)
    assert expected.alpha.any() != is_clear, f"{message}: nothing is seen, or what is not there"
    for threads in (2, 3, 7):
        frame = rz.render(scene, size, threads=threads, **options)
        for buffer in ("color", "alpha", "rgba"):
            n_off = int((getattr(frame, buffer) != getattr(expected, buffer)).sum())
            assert n_off == 0, f"{message}: {n_off} values of {buffer} differ with {threads} threads"


def test_bands_and_threads_do_not_change_a_bit():
    for name, make in SCENES.items():
        options = dict(zip(("shading", "samples", "tolerance"), next(WAYS), strict=True))
        assert_same_in_all_bands(make(), f"{name}, {options}", **options)


SPECK = octasphere(0)
FRAME_OF_ALL = rz.Mesh(  # two triangles out of sight, so that all scenes have the same bounds
    [(-9, -9, -9), (-9, -8.9, -9), (-9, -9, -8.9), (9, 9, 4), (9, 8.9, 4), (9, 9, 3.9)], [(0, 1, 2), (3, 4, 5)],
    material=LOOKS["dull"],
)  # fmt: skip
PLACES = {
    "far above": (0.0, 3.0, 0.0),
    "beside it": (-1.5, 0.3, 0.2),
    "before it": (0.2, 0.3, 1.1),
    "behind it": (0, 0, -3),
}


NIGHTLY = {"textured toon", "worn metal"}  # which take kernels that nothing else needs
SPECKS = [pytest.param(look, marks=[pytest.mark.nightly] * (look in NIGHTLY)) for look in LOOKS]


@pytest.mark.parametrize("speck", SPECKS[2:])  # the first two are what the object is made of
def test_a_speck_leaves_every_pixel_of_a_plain_object_as_it_is(speck):
    """Wherever the speck is: out of the picture, in the same band, before or behind the object."""
    plain = ball("plain", radius=1.1)
    for shading, samples, tolerance in (("phong", 1, 0.0), ("gouraud", 4, 1 / 4096), ("phong", 4, 1 / 4096)):
        options = {"shading": shading, "samples": samples, "tolerance": tolerance, "threads": 1}
        pictures = {}
        for name, center in PLACES.items():
            scene = rz.Scene([plain, FRAME_OF_ALL, ball(speck, center, 0.12, SPECK)], GREY, CAMERA)
            pictures[name] = rz.render(scene, SIZE, outputs=("color", "rgb", "face"), **options)
        expected = pictures["far above"]
        is_plain = (expected.face >= 0) & (expected.face < plain.n_face)
        for name, frame in pictures.items():
            # With several samples, pixels about the speck show both.
            is_off = (frame.color != expected.color).any(axis=-1)
            is_other = (frame.face != expected.face) | is_off & near(frame, expected)
            here = is_plain & ~is_other
            is_seen = is_other.any() or name in ("far above", "behind it") or speck == "opacity 0"
            assert here.sum() > 300 and is_seen, name
            assert (frame.color[here] == expected.color[here]).all(), f"{speck} {name}, {options}: colours differ"
            assert (frame.rgba[here] == expected.rgba[here]).all(), f"{speck} {name}, {options}: bytes differ"


def near(frame, expected):
    """Pixels next to those that show another face."""
    other = np.pad(frame.face != expected.face, 1)
    rows, columns = frame.face.shape
    return np.any([other[j : j + rows, i : i + columns] for j in range(3) for i in range(3)], axis=0)


# ---------------------------------------------------------------- what the plan tells


NORMALS, INTENSITIES = "planes of the normals", "planes of the intensities"
ENTRIES, RECORDS = "one intensity in each visibility entry", "exact records"
NEEDS = {  # (channels, type, what the reason speaks of), then the ways with and without transparent surfaces, and lit
    "plain": (1, "float32", ""),
    "coloured": (3, "float32", ""),
    "textured": (3, "float32", ""),
    "toon": (3, "float64", "toon"),
    "shininess 1000": (1, "float32", ""),
    "mirror": (1, "float64", "rounding"),
    "glass": (3, "float32", ""),
    "smoke": (1, "float32", ""),
    "vertex colours": (3, "float32", ""),
}


def way_of(shading, channels, dtype, is_opaque):
    """The way that a plan should name."""
    if dtype == "float64":
        return RECORDS
    if shading == "phong":
        return NORMALS
    return ENTRIES if channels == 1 and is_opaque else INTENSITIES


@pytest.mark.parametrize("looks, shading", [
    (["plain", "coloured", "textured", "plain"], "phong"), (["plain", "coloured", "textured", "plain"], "gouraud"),
    (["coloured", "glass", "plain"], "flat"), (["plain", "smoke", "textured"], "gouraud"),
    (["plain", "toon", "shininess 1000", "vertex colours", "mirror"], "phong"),
])  # fmt: skip
def test_a_plan_tells_what_its_materials_need(looks, shading):
    """The most that any needs, how many need float64, and why."""
    with rz.Renderer(balls(looks), SIZE, shading=shading, samples=1) as renderer:
        before, frame = renderer.plan, renderer.render()
    plan = frame.stats.plan
    assert before._replace(paths=plan.paths) == plan
    different = list(dict.fromkeys(looks))
    needs = [NEEDS[look] for look in different]
    assert plan.materials == len(different) and plan.doubles == sum(dtype == "float64" for _, dtype, _ in needs)
    for _, dtype, reason in needs:
        assert dtype == "float32" or reason in " ".join(plan.reasons), plan
    assert plan.channels == max(NEEDS[look][0] for look in looks)
    assert plan.dtype == ("float64" if all(NEEDS[look][1] == "float64" for look in looks) else "float32")


@pytest.mark.parametrize("shading, samples", [("phong", 4), ("gouraud", 1), ("flat", 4)])
def test_textures_alone_are_drawn_as_beside_others(shading, samples):
    """Where all materials have textures, intensities without them are not computed."""
    textured = balls(["textured"] * 4).meshes
    other = ball("coloured", (1.0, 1.1, 0.0), 0.2)
    scenes = [rz.Scene(meshes, GREY, CAMERA) for meshes in (textured, (*textured, other))]
    alone, beside = (rz.render(scene, SIZE, shading=shading, samples=samples, threads=1) for scene in scenes)
    assert beside.stats.covered > alone.stats.covered, "the other one isn't seen"
    is_full = alone.alpha == 1.0
    assert is_full.sum() > 200
    # A brighter scene accepts a larger error, so some triangles may take another path.
    budget = alone.stats.error_bound + beside.stats.error_bound
    assert not deviations(alone.color[is_full], beside.color[is_full], atol=budget)


@pytest.mark.parametrize("look", ["plain", "textured", "textured toon"])
@pytest.mark.parametrize("shading, samples", [("gouraud", 1), ("gouraud", 4), ("phong", 1), ("phong", 4)])
def test_gaps_in_a_row_change_no_bit_beside_them(shading, samples, look):
    """Bars with gaps of 1 to 90 pixels between them, and the same with a wall behind that fills the gaps."""
    rights = np.cumsum(np.arange(1, 91, 4) + 3.0) + 10
    corners = np.array([(-3.0, 0, 0), (0, 0, 0), (0, 12, 0), (-3, 12, 0)])
    two = np.array([(0, 1, 2), (0, 2, 3)])
    bars = [rz.Mesh(corners + (x, 0, 0), two, uv=corners[:, :2] / 5, material=LOOKS[look]) for x in rights]
    width = int(rights[-1]) + 60
    wall = rz.Mesh(corners * (width / 3, 1, 0) + (width, 0, -5), two, uv=corners[:, :2], material=LOOKS[look])
    eye = (width / 2, 6.0, 50.0)
    camera = rz.Camera.orthographic(eye, (width / 2, 6, 0), height=12, near=1, far=100)
    options = {"size": (width, 12), "shading": shading, "samples": samples, "threads": 1}
    alone = rz.render(rz.Scene(bars, GREY, camera), **options)
    walled = rz.render(rz.Scene([*bars, wall], GREY, camera), **options)
    is_bar = alone.alpha > 0.0
    assert is_bar.sum() == 12 * 3 * len(rights)
    assert (alone.color[is_bar] == walled.color[is_bar]).all()
    assert not alone.rgba[~is_bar].any() and not alone.color[~is_bar].any()


@pytest.mark.parametrize("shading", ["gouraud", "phong"])
def test_stats_count_the_ways_of_every_material(shading):
    """Those of a fine plain ball beside a toon and a coloured one."""
    meshes = ball("plain", (-1, -1, 0), shape=octasphere(5)), *balls(["toon", "coloured"]).meshes
    frame = rz.render(rz.Scene(meshes, GREY, CAMERA), SIZE, shading=shading, threads=1, samples=1)
    ways, n_face = frame.stats.plan.paths, len(BALL[1])
    assert ways.exact >= n_face // 3, f"the toon: {ways}"
    assert ways.planes >= n_face // 3, f"the coloured ball: {ways}"
    if shading == "phong":
        assert ways.entries == 0, ways
    else:
        assert ways.entries >= 100, f"the plain ball: {ways}"
    assert sum(ways) >= frame.stats.drawn
