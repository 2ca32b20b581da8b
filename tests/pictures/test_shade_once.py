"""Pictures that are shaded once a pixel and polygon: against the reference, and against what they must not change."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.against_reference import EXACT, compare_with_reference, reference_picture
from helpers.small_scenes import DAYLIGHT, LAMP, checks, cube, floor, scene_of

import rasterizer as rz
from rasterizer.options import DEFAULT_TOLERANCE

SIZE = (37, 29)  # odd, so that a band and a batch end anywhere
ONCE = {"antialias": "shade-once"}
GLOSSY = {"diffuse": (0.5, 0.4, 0.3), "specular": 0.4, "shininess": 12}
PICTURE = rz.Texture(checks(), filter="trilinear")


def scenes() -> dict:
    """Name -> scene: what is lit, looked up, seen through and clipped."""
    ball = cube(**GLOSSY).subdivide(2)
    colored = replace(ball, colors=np.random.default_rng(3).uniform(0.2, 1.0, (len(ball.vertices), 3)))
    papered = cube(texture=PICTURE, specular=0.3)
    pane = cube(diffuse=0.7, opacity=0.5).transformed(np.diag([0.4, 1.6, 1.6, 1.0]))
    return {
        "grey": scene_of(cube(specular=0.4, shininess=12)),
        "coloured": scene_of(colored, lights=(*DAYLIGHT, LAMP)),
        "textured": scene_of(papered, floor(texture=rz.Texture(checks(), filter="nearest"))),
        "one textured beside a plain one": scene_of(papered, floor(diffuse=0.5)),
        "glass before a texture": scene_of(papered, pane),
        "float64 beside float32": scene_of(cube(reflection="toon"), floor(specular=0.2)),
        "fading": replace(scene_of(papered, floor(**GLOSSY)), depth_cue=3.0),
        "parallel": scene_of(
            papered, lights=(*DAYLIGHT, LAMP), camera=rz.Camera.orthographic((2, 2, 3), (0, 0, 0), height=4.0)
        ),
    }


SCENES = scenes()


def draw_colors(scene, **options):
    """Linear colours of a picture."""
    return rz.render(scene, SIZE, outputs="color", **{"samples": 1} | options).color


WAYS = [("phong", DEFAULT_TOLERANCE), ("phong", 0.0), ("phong", DEFAULT_TOLERANCE), ("gouraud", DEFAULT_TOLERANCE)]


@pytest.mark.parametrize("name, shading, tolerance", [(n, *WAYS[k % 4]) for k, n in enumerate(SCENES)])
def test_every_picture_is_that_of_the_reference(name, shading, tolerance):
    """Of points, not of samples: the reference finds these by itself."""
    options = {"shading": shading, "samples": 4, "tolerance": tolerance, **ONCE}
    found = compare_with_reference(SCENES[name], SIZE, **options)
    assert rz.render(SCENES[name], SIZE, **options).stats.error_bound is None
    most = max(EXACT, rz.render(SCENES[name], SIZE, **options | {"samples": 1}).stats.error_bound)
    # The samples next to a step of the illumination, or to the edge of a texel, have no bound.
    has_steps = name in ("textured", "float64 beside float32")
    allowed = found.n_compared // 50 if has_steps else 0
    limited = compare_with_reference(SCENES[name], SIZE, limit=most, **options)
    assert limited.n_far <= allowed, f"{limited.n_far} pixels are off by more than {most:.3g}, up to {found.color:.3g}"


@pytest.mark.nightly  # the campaign has such numbers; these take kernels of their own
@pytest.mark.parametrize("samples, name", [(9, "coloured"), (16, "one textured beside a plain one")])
def test_nine_and_sixteen_samples_share_points_too(name, samples):
    options = {"shading": "phong", "samples": samples, **ONCE}
    found = compare_with_reference(SCENES[name], SIZE, **options)
    assert found.color <= DEFAULT_TOLERANCE, f"{found.color} > {DEFAULT_TOLERANCE}"


def test_with_one_sample_it_changes_nothing():
    for scene, shading in ((SCENES["coloured"], "phong"), (SCENES["textured"], "gouraud")):
        options = {"shading": shading, "samples": 1}
        assert draw_colors(scene, **options).tobytes() == draw_colors(scene, **options, **ONCE).tobytes()


@pytest.mark.parametrize("shading", ["flat", "gouraud"])
def test_what_is_lit_at_vertices_or_polygons_is_supersampled(shading):
    """There is nothing to save: intensities are interpolated at every sample."""
    options = {"shading": shading, "samples": 4}
    for name in ("grey", "coloured"):
        plain, once = (draw_colors(SCENES[name], **options, **extra) for extra in ({}, ONCE))
        assert plain.tobytes() == once.tobytes()


@pytest.mark.parametrize("samples", [4, pytest.param(9, marks=pytest.mark.nightly)])
def test_pixels_within_a_polygon_are_lit_at_their_centres(samples):
    """As the picture with one sample a pixel is."""
    scene = SCENES["coloured"]
    one = rz.render(scene, SIZE, shading="phong", outputs=("color", "face"), samples=1)
    fine = reference_faces(scene, samples)
    factor = round(samples**0.5)
    blocks = fine.reshape(SIZE[1], factor, SIZE[0], factor).transpose(0, 2, 1, 3).reshape(SIZE[1], SIZE[0], -1)
    is_inside = (blocks == blocks[..., :1]).all(axis=-1) & (blocks[..., 0] >= 0)
    once = draw_colors(scene, shading="phong", samples=samples, **ONCE)
    off = np.abs(once - one.color).max(axis=-1)[is_inside]
    assert is_inside.sum() > 40
    assert off.max() <= 2 * one.stats.error_bound, f"{off.max()} > {2 * one.stats.error_bound}"


def reference_faces(scene, samples):
    """The face that each sample of a picture shows."""
    factor = round(samples**0.5)
    return reference_picture(scene, (SIZE[0] * factor, SIZE[1] * factor), shading="phong").face


def test_alpha_and_coverage_are_those_of_all_samples():
    for name, scene in SCENES.items():
        plain, once = (rz.render(scene, SIZE, shading="phong", samples=4, **extra) for extra in ({}, ONCE))
        assert np.abs(plain.alpha - once.alpha).max() <= DEFAULT_TOLERANCE, name
        assert plain.stats.covered == once.stats.covered, name


def test_threads_and_bands_change_no_bit():
    for k, (name, scene) in enumerate(SCENES.items()):
        options = {
            "shading": "phong",
            "samples": 4,
            "tolerance": (0.0, DEFAULT_TOLERANCE)[k % 2],
            **ONCE,
        }
        expected = draw_colors(scene, threads=1, **options)
        for threads in (2, 5):
            assert draw_colors(scene, threads=threads, **options).tobytes() == expected.tobytes(), f"{name}, {options}"


@pytest.mark.parametrize("samples, tolerance", [(4, DEFAULT_TOLERANCE), (4, 0.0)])
def test_a_pane_changes_no_bit_beside_it(samples, tolerance):
    """Pixels are averaged from points where a band is opaque, from samples where something is seen through."""
    ball = cube(specular=0.4, shininess=12)
    pane = cube(diffuse=0.7, opacity=0.5).transformed(np.diag([0.05, 3.0, 0.05, 1.0]) + shift(1.6, 0.0, 0.0))
    options = {"shading": "phong", "samples": samples, "tolerance": tolerance, **ONCE}
    plain, glazed = (draw_colors(scene_of(*meshes), **options) for meshes in ((ball,), (ball, pane)))
    behind = rz.render(scene_of(pane), SIZE, samples=samples, shading="gouraud").alpha > 0
    assert 5 < behind.sum() < behind.size / 2 and (plain != glazed).any()
    assert plain[~behind].tobytes() == glazed[~behind].tobytes()


def shift(x, y, z):
    """What is added to a matrix of a model to move it."""
    matrix = np.zeros((4, 4))
    matrix[:3, 3] = x, y, z
    return matrix


def test_shadows_are_looked_up_at_the_points():
    """Inside a shadow and outside it the picture is that of the reference; next to its edge there is no bound."""
    lights = (rz.AmbientLight(0.1), rz.DirectionalLight((-0.4, -0.9, -0.3), 0.8, shadow=True))
    scene = scene_of(cube(diffuse=0.6), floor(diffuse=0.6), lights=lights)
    expected = reference_picture(scene, SIZE, shading="phong", samples=4, **ONCE)
    off = np.abs(draw_colors(scene, shading="phong", samples=4, **ONCE) - expected.color).max(axis=-1)
    assert np.median(off) < EXACT * 10 and (off > DEFAULT_TOLERANCE).mean() < 0.05


def test_a_mipmap_is_chosen_for_a_pixel():
    """So what is far away doesn't sparkle: the texture of a single pixel is its mean."""
    image = np.indices((64, 64)).sum(axis=0) % 2 * 1.0
    look = rz.Material(ambient=1, diffuse=0, specular=0, texture=rz.Texture(image, filter="trilinear"))
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)
    wall = rz.Mesh(corners, [(0, 1, 2), (0, 2, 3)], uv=(corners[:, :2] + 1) / 2, material=look)
    scene = rz.Scene([wall], rz.AmbientLight(1.0), rz.Camera.orthographic((0, 0, 2), (0, 0, 0), height=2.0))
    for tolerance in (0.0, DEFAULT_TOLERANCE):
        colors = rz.render(scene, 32, shading="phong", samples=4, tolerance=tolerance, outputs="color", **ONCE).color
        assert np.abs(colors - colors.mean()).max() < 1e-3, "two texels are the width of a pixel"


def test_explain_tells_where_a_pixel_is_lit():
    scene, options = SCENES["coloured"], {"shading": "phong", "samples": 4, **ONCE}
    colors = draw_colors(scene, **options)
    found = rz.explain(scene, 18, 14, SIZE, **{"samples": 1} | options)
    assert np.abs(np.array(dict(found.rows)["linear"]) - colors[14, 18]).max() <= DEFAULT_TOLERANCE
    assert dict(found.rows)["lit"] == "at a point that the pixel's samples share"
