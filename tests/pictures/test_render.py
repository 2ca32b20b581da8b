"""Check whole pictures against the reference: all shadings, lights, materials, cameras, exact and default."""

import itertools

import numpy as np
import pytest
from helpers.against_reference import BUFFERS, EXACT, NORMAL, assert_matches_reference
from helpers.arrays import differences
from helpers.pinhole import SHADINGS, octasphere, torus
from helpers.pixels import needle
from helpers.raster import COLORED, GREY, assert_runs, sheet

import rasterizer as rz
from rasterizer import reference

SIZE = (40, 30)
DEFAULT = 1 / 4096
TOLERANCES = ((0.0, EXACT), (DEFAULT, DEFAULT))  # (option, budget)
RING, BALL = torus(16, 8), octasphere(2)
CAMERAS = {
    "perspective": rz.Camera.perspective((1.5, 2, 4), fov=40),
    "orthographic": rz.Camera.orthographic((1.5, 2, 4), height=3.2),
}


def check_all(scene, size=SIZE, shadings=SHADINGS, **options):
    """Check a scene with every shading method, at tolerance 0 and the default."""
    for shading in shadings:
        for tolerance, budget in TOLERANCES:
            assert_matches_reference(scene, size, budget, shading=shading, tolerance=tolerance, **options)


@pytest.mark.parametrize("samples, camera, background", [
    (4, "perspective", None), (9, "orthographic", (0.1, 0.2, 0.3)), (16, "perspective", "navy"),
])  # fmt: skip
def test_samples_and_backgrounds(samples, camera, background):
    vertices, faces = BALL
    blinn = rz.Material(specular=0.5, shininess=80, reflection="blinn")
    meshes = [rz.Mesh(*RING), rz.Mesh(vertices * 0.5 + (0.6, 0.2, 0.4), faces, material=blinn)]
    check_all(rz.Scene(meshes, COLORED, CAMERAS[camera], background), (20, 15), samples=samples, ignored=0.03)


@pytest.mark.parametrize("shading, color_range", [("flat", "clamp"), ("gouraud", "global"), ("phong", "local")])
def test_colours_out_of_range(shading, color_range):
    """Float32 may round across a threshold of the 8 bits: one level, in less than 1 % of the values."""
    sun, lamp = rz.DirectionalLight((-0.2, -0.3, -1), (3, 2, 1.0)), rz.PointLight((10, 10, 3), (1, 2, 0.5))
    bright = (rz.AmbientLight(0.5), sun, lamp)
    size, points = (40, 30), [(3, 3), (36, 5), (35, 28), (2, 25)]
    for background, samples in ((None, 1), ((0.2, 4, 0.3), 4), (None, 9)):
        scene = sheet(size, points, [1, 1, 1.2, 1.1], [[0, 1, 2], [0, 2, 3]], bright, background=background)
        options = {"shading": shading, "samples": samples, "color_range": color_range}
        expected = reference.render(scene, size, **options)
        assert expected.color.max() > 1.5
        frame = rz.render(scene, size, tolerance=0, **options)
        levels = np.abs(frame.rgb.astype(int) - expected.rgb)
        message = f"{samples} samples: {levels.max()} levels, {(levels > 0).sum()} values"
        assert levels.max() <= 1 and (levels > 0).mean() < 0.01, message
        assert not differences(rz.render(scene, size, tolerance=0, outputs=("rgb",), **options).rgba, frame.rgba)


def soup_through_the_near_plane(camera):
    """Triangles with one, two and three vertices behind the eye."""
    rng = np.random.default_rng(3)
    center = 3 * rng.standard_normal((25, 1, 3)) - (0, 0, 2)
    vertices = (center + 1.5 * rng.standard_normal((25, 3, 3))).reshape(-1, 3)
    behind = (vertices[:, 2] > 1).reshape(-1, 3).sum(axis=1)
    assert {0, 1, 2} <= set(behind.tolist())
    mesh = rz.Mesh(vertices, np.arange(75).reshape(-1, 3), colors=rng.random((75, 3)))
    return rz.Scene([mesh], COLORED, camera)


def floor_below_the_eye(near):
    """The ratio of distances reaches 10^7; vertices lie behind the eye."""
    corners = [(-50, -1, 50), (50, -1, 50), (50, -1, -50), (-50, -1, -50)]
    camera = rz.Camera.perspective((0.1, 0.2, 0.3), (0.3, 0.1, -5), fov=60, near=near)
    lights = (rz.AmbientLight(0.1), rz.PointLight((2, 3, -3), 0.9, (1, 0.1, 0.01)))
    return rz.Scene([rz.Mesh(corners, [[0, 1, 2], [0, 2, 3]])], lights, camera)


def ring_of_scale(scale):
    lights = (rz.AmbientLight(0.1), rz.PointLight((2 * scale, 3 * scale, 3 * scale), 0.9))
    camera = rz.Camera.perspective((1.5 * scale, 2 * scale, 4 * scale), fov=40)
    return rz.Scene([rz.Mesh(RING[0] * scale, RING[1])], lights, camera)


def large_triangle(reach, depth):
    """Products of edge functions, 1/w and normals must fit float32 also far beyond the picture."""
    corners = [(-reach, -reach, -depth), (reach, -reach, -1.5 * depth), (0, reach, -depth)]
    return rz.Scene([rz.Mesh(corners, [[0, 1, 2]])], GREY, rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=60))


def ball_from_afar(distance):
    """Positions relative to a far eye have few digits left in float32; so near a light needs more."""
    lights = (rz.AmbientLight(0.1), rz.PointLight((0.1, 0.2, 1.05), 0.8, (1, 0, 2)))
    camera = rz.Camera.perspective((0, 0, distance), fov=float(np.degrees(2 * np.arctan(1.2 / distance))))
    return rz.Scene([rz.Mesh(*BALL)], lights, camera)


PLANES = {"near": 0.3, "far": 9.0}
HARD = {  # name -> (scene, units of depth that may be off)
    "a soup, cut": (soup_through_the_near_plane(rz.Camera.perspective((0, 0, 1), (0, 0, -5), fov=70, **PLANES)), 18),
    "a soup, cut, without perspective": (
        soup_through_the_near_plane(rz.Camera.orthographic((0, 0, 1), (0.3, 0.2, -5), height=6, **PLANES)), 18,
    ),
    "a floor from 1": (floor_below_the_eye(1.0), 22), "a floor from 1e-5": (floor_below_the_eye(1e-5), 22),
    "unit 1e-9": (ring_of_scale(1e-9), 14), "unit 1e9": (ring_of_scale(1e9), 14),
    "a large triangle": (large_triangle(1e3, 1), 22), "a large near triangle": (large_triangle(1e5, 1e-6), 22),
    "a lit ball at 100": (ball_from_afar(1e2), 14), "a lit ball at 1e6": (ball_from_afar(1e6), 14),
}  # fmt: skip


@pytest.mark.parametrize("name, shading", list(zip(HARD, itertools.cycle(("phong", "gouraud")))))
def test_hard_scenes_against_the_reference(name, shading):
    scene, bits = HARD[name]
    check_all(scene, shadings=(shading,), units=2.0**bits, ignored=0.03)


def test_what_might_end_the_process():
    """The thinnest triangles; a sheet as bright as anything can be; a light in the very point of a surface."""
    assert_runs("import pictures.test_render as t; t.check_needles(); t.check_brightest(); t.check_touching_light()")


def check_needles():
    """Compare triangles of doubled area 3, up to 2^20 px long, with the reference: a sample's weights are a third
    each."""
    n_covered = 0
    for bits, lights, shading in zip((10, 20, 24, 26, 27), (GREY, COLORED) * 3, SHADINGS * 2, strict=False):
        rng = np.random.default_rng(bits)
        for _ in range(2):
            points = needle(rng, bits, SIZE) / 256
            if np.abs(points).max() >= 2**20:
                continue
            # A face outside the picture goes along, because a mesh in which nothing has area is refused.
            points = np.concatenate([points, [(-9, -9), (-6, -9), (-9, -6)]])
            normals = np.concatenate([rng.normal(0, 0.3, (6, 2)), np.ones((6, 1))], axis=1)
            scene = sheet(SIZE, points, 1.0, [[0, 1, 2], [3, 4, 5]], lights, normals=normals)
            for tolerance, budget in TOLERANCES:
                limits = {"budget": budget, "normal": NORMAL}
                if shading == "flat" and bits >= 26:
                    # The area is below float64's rounding: the polygon has a place, but no normal.
                    limits = {"budget": np.inf, "normal": np.inf}
                found = assert_matches_reference(scene, SIZE, **limits, shading=shading, tolerance=tolerance, ignored=0)
                n_covered += found.n_compared
    assert n_covered >= 12


def check_brightest():
    """Render sheets that face the light and the viewer, in all directions; float32 may round that up."""
    rng = np.random.default_rng(0)
    for k in range(12):
        direction = rng.standard_normal(3)
        direction /= np.linalg.norm(direction)
        camera = rz.Camera.orthographic(-5 * direction, height=2)
        view = camera.view()
        corners = [x * view.right + y * view.up for x, y in ((-0.8, -0.8), (0.8, -0.8), (0.8, 0.8), (-0.8, 0.8))]
        material = rz.Material(
            diffuse=rng.random(), ambient=rng.random(), specular=rng.choice([0, rng.random()]),
            shininess=rng.choice([1, 10, 50, 90]), emissive=rng.choice([0, rng.random()]),
            reflection=rng.choice(["phong", "blinn"]),
        )  # fmt: skip
        lights = (rz.AmbientLight(rng.random()), rz.DirectionalLight(direction, rng.random()))
        mesh = rz.Mesh(corners, [[0, 1, 2], [0, 2, 3]], normals=np.tile(-direction, (4, 1)), material=material)
        check_all(rz.Scene([mesh], lights[: 1 + (k % 6 > 0)], camera), (12, 9), SHADINGS[k % 3 :][:1])


def check_touching_light():
    """Put lights into a vertex, a centroid, and between: amplified they are infinitely strong there, no worse."""
    points = [(5, 5), (35, 6), (18, 28)]
    vertices = sheet(SIZE, points, 1.0, [[0, 1, 2]]).meshes[0].vertices
    for place in (vertices[0], vertices.mean(axis=0), vertices.mean(axis=0) + (0, 0, 1e-3)):
        for amplify, attenuation in itertools.product((False, True), ((0, 0, 1), (1, 0, 0))):
            light = rz.PointLight(place, 0.8, attenuation, amplify=amplify)
            for shading in SHADINGS:
                frame = rz.render(sheet(SIZE, points, 1.0, [[0, 1, 2]], (light,)), SIZE, shading=shading, samples=1)
                assert frame.alpha.sum() > 100 and not differences(np.isnan(frame.color), 0)


SHAPES = [(1, 1), (1, 50), (50, 1), (7, 9), (8, 8), (16384, 1), (1, 2**16)]


@pytest.mark.parametrize("size", SHAPES)
def test_pictures_of_any_shape(size):
    width, height = size
    points = [(-3, -3), (width + 5, -2), (width / 2, 2 * height + 5)]
    scene = sheet(size, points, [1, 2.0, 1.5], [[0, 1, 2]], COLORED, width == 1)
    check_all(scene, size, ("phong",) if max(size) > 99 else SHADINGS, units=max(2.0**16, width + height))


@pytest.mark.nightly
@pytest.mark.parametrize("size", [(2**16, 1), (1, 2**16), (2**18, 1), (3, 16384)])
def test_samples_of_the_longest_pictures(size):
    """Two surfaces that cross, with 16 samples: as many along an axis as there may be."""
    (width, height), samples = size, 16 if max(size) <= 2**16 else 1
    points = [(-3, -3), (width + 5, -2), (width / 2, 2 * height + 5)] * 2
    scene = sheet(size, points, [1, 2.0, 1.5, 2.0, 1.0, 1.5], [[0, 1, 2], [3, 4, 5]], COLORED)
    frame = rz.render(scene, size, shading="gouraud", samples=samples, tolerance=0)
    expected = reference.render(scene, size, shading="gouraud", samples=samples)
    assert np.abs(frame.alpha - expected.alpha).max() < 1e-6
    error = np.abs(frame.color - expected.color).max()
    assert error <= EXACT, f"colours differ by {error:.3g} > {EXACT:.3g}"


EMPTY = {
    "behind": rz.Camera.perspective((0, 0, 5), (0, 0, 10)),
    "behind, orthographic": rz.Camera.orthographic((0, 0, 5), (0, 0, 10), height=2),
    "beside": rz.Camera.perspective((0, 0, 5), (9, 0, 5.1), fov=20),
    "before near": rz.Camera.perspective((0, 0, 5), near=50),
    "beyond far": rz.Camera.perspective((0, 0, 5), near=0.1, far=1.0),
    "beyond far alone": rz.Camera.perspective((0, 0, 5), far=1.0),
}


def test_pictures_in_which_nothing_is_seen():
    for (name, camera), shading, samples in zip(EMPTY.items(), SHADINGS * 2, (1, 1, 1, 4, 4, 4), strict=True):
        for background, rgba in ((None, (0, 0, 0, 0)), ("red", (255, 0, 0, 255))):
            scene = rz.Scene([rz.Mesh(*BALL)], GREY, camera, background)
            frame = rz.render(scene, (31, 17), shading=shading, samples=samples, outputs=BUFFERS)
            is_empty = (frame.face == -1).all() and np.isinf(frame.depth).all() and not frame.normal.any()
            assert is_empty and (frame.rgba == rgba).all() and frame.stats.covered == 0, name
