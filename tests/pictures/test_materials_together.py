"""Check scenes whose surfaces need different things: each is drawn as the reference draws it, and no surface changes a
bit of another.

A pixel is a function of the polygon that it shows and of its place: what else is in its band, how high the band is and
which thread draws it must not matter.
"""

import itertools

import numpy as np
import pytest
from helpers.against_reference import assert_matches_reference
from helpers.pairs import pairs
from helpers.pinhole import octasphere

import rasterizer as rz
from rasterizer.engine.draw import choose_band_rows

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
    assert choose_band_rows(*size, 2, 1) < choose_band_rows(*size, 1, 1)
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
