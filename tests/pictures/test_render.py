"""Check whole pictures against the reference: all shadings, lights, materials, cameras, exact and default."""

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


def test_the_thinnest_triangles_do_not_end_the_process():
    assert_runs("import pictures.test_render as t; t.check_needles()")


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


SHAPES = [(1, 1), (1, 50), (50, 1), (7, 9), (8, 8), (16384, 1), (1, 2**16)]


@pytest.mark.parametrize("size", SHAPES)
def test_pictures_of_any_shape(size):
    width, height = size
    points = [(-3, -3), (width + 5, -2), (width / 2, 2 * height + 5)]
    scene = sheet(size, points, [1, 2.0, 1.5], [[0, 1, 2]], COLORED, width == 1)
    check_all(scene, size, ("phong",) if max(size) > 99 else SHADINGS, units=max(2.0**16, width + height))


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
