"""Check how good pictures are: against the reference, true surfaces, and what shading methods promise."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from helpers.against_reference import EXACT, assert_matches_reference
from helpers.pinhole import DULL, SHADINGS, octasphere, torus, unit
from helpers.raster import COLORED, GREY, ROOT, sheet
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import rasterizer as rz

DEFAULT = 1 / 4096
SIZE = (48, 36)


def load(name, **options):
    """Load one of the models, by the name of its file."""
    return rz.load(ROOT / "models" / name, **options)


# ---------------------------------------------------------------- against the reference


def slivers(lights, is_perspective):
    """A bundle of triangles a few sub-pixels wide, with a normal of its own at every corner."""
    rng = np.random.default_rng(4)
    n = 40
    middle, angle = rng.uniform(0, 1, (n, 2)) * SIZE, rng.uniform(0, np.pi, n)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.choice([20, 500, 2**16], (n, 1))
    third = middle + along * rng.uniform(-0.9, 0.9, (n, 1)) + rng.choice([-2, 2, 50, 300], (n, 2)) / 256
    points = np.stack([middle - along, middle + along, third], axis=1).reshape(-1, 2)
    normals = np.concatenate([rng.normal(0, 0.3, (3 * n, 2)), np.ones((3 * n, 1))], axis=1)
    faces = np.arange(3 * n).reshape(-1, 3)
    return sheet(SIZE, points, rng.uniform(1, 3, 3 * n), faces, lights, is_perspective, normals=normals)


def steep(lights):
    """Few large triangles, some corners up to a thousand times as far away as others, all in the picture."""
    points = [(1, 1), (47, 2), (45, 35), (2, 33), (25, 20)]
    rng = np.random.default_rng(5)
    normals = np.concatenate([rng.normal(0, 0.3, (5, 2)), np.ones((5, 1))], axis=1)
    faces = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    return sheet(SIZE, points, [1, 1000, 30, 2, 5.0], faces, lights, True, normals=normals)


COMPARED = {
    "ball": lambda: rz.Scene([rz.Mesh(*octasphere(3))], GREY, rz.Camera.orthographic((1.5, 2, 4), height=2.2)),
    "inside": lambda: rz.Scene(
        rz.Mesh(*torus(24, 12)), COLORED, rz.Camera.perspective((1, 0.1, 0), (0.6, 0, 1), fov=110)
    ),
    "slivers": lambda: slivers(COLORED, True),
    "grey slivers": lambda: slivers(GREY, False),
    "steep": lambda: steep(GREY),
}
MODELS = ("teapot.obj", "gear.obj", "still_life.obj", "knot.ply")
PAIRS = [  # (options, budget)
    ({"tolerance": 0.0}, EXACT),
    ({"tolerance": DEFAULT}, DEFAULT),
    ({"tolerance": 1 / 64}, 1 / 64),
    ({"tolerance": 0.0, "samples": 4}, EXACT),
    ({"tolerance": DEFAULT, "samples": 4}, DEFAULT),
]


@pytest.mark.parametrize("name, shading", list(zip(COMPARED, itertools.cycle(("phong", "gouraud", "flat", "gouraud")))))
def test_pictures_are_within_their_tolerance_of_the_reference(name, shading):
    check_pairs(COMPARED[name](), shading, "slivers" in name or "steep" in name)


@pytest.mark.nightly
@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("name", MODELS)
def test_pictures_of_models_are_within_their_tolerance_of_the_reference(name, shading):
    check_pairs(load(name), shading, False)


def check_pairs(scene, shading, is_thin):
    """Compare a scene with the reference, for each of PAIRS."""
    for options, budget in PAIRS:
        if is_thin and options.get("samples"):
            continue  # every pixel of a bundle has a sample in which two of the slivers are equally near
        found = assert_matches_reference(scene, SIZE, budget, ignored=0.03, units=2.0**20 if is_thin else 2.0**14,
                      shading=shading, **options)  # fmt: skip
        assert found.n_compared > 100


# ---------------------------------------------------------------- the default picture against the exact one


def views(scene):
    """Cameras round a scene: framed, without perspective, close to it, and inside it."""
    lowest, highest = scene.bounds
    middle, reach = (lowest + highest) / 2, np.linalg.norm(highest - lowest) / 2
    beside = middle + reach * np.array([0.5, 0.3, 0.6])
    return {
        "framed": rz.Camera.framing(scene, up=scene.up),
        "from below": rz.Camera.framing(scene, azimuth=200, elevation=-35, fov=60, up=scene.up),
        "orthographic": rz.Camera.framing(scene, azimuth=-60, elevation=50, up=scene.up, orthographic=True),
        "close": rz.Camera.perspective(tuple(beside), tuple(middle), fov=20),
        "inside": rz.Camera.perspective(tuple(middle), tuple(beside), fov=110),
        "inside, orthographic": rz.Camera.orthographic(tuple(middle), tuple(beside), height=reach),
    }


def floor_scene():
    """Two triangles that reach from behind the eye to the horizon, under a light that is close to them."""
    lights = (
        rz.AmbientLight(0.1),
        rz.PointLight((2, 3, -3), 0.9, (1, 0.1, 0.01)),
        rz.DirectionalLight((-1, -1, -1)),
    )
    return replace(load("floor.obj"), lights=lights)


SHOWN = {
    "gear": lambda: load("gear.stl"),
    "still life": lambda: load("still_life.obj"),
    "sphere": lambda: load("sphere.obj"),
    "floor": floor_scene,
    "coarse ball": lambda: rz.Scene([rz.Mesh(*octasphere(1), crease_angle=180)], COLORED),
    "fine ring": lambda: rz.Scene([rz.Mesh(*torus(128, 64), material=rz.Material(shininess=60, specular=0.6))]),
    "blinn": lambda: rz.Scene([rz.Mesh(*torus(40, 20), material=rz.Material(reflection="blinn", shininess=90))]),
}


@pytest.mark.parametrize("name", SHOWN)
def test_the_default_picture_is_within_one_level_of_the_exact_one(name):
    """At every value of every pixel, without exception."""
    scene = SHOWN[name]()
    n_covered = 0
    ways = itertools.cycle((*itertools.product(SHADINGS, (4, 1)), ("gouraud", 4)))
    for (view, camera), (shading, samples) in zip(views(scene).items(), ways, strict=False):
        options = {"shading": shading, "samples": samples, "outputs": ("rgb",)}
        seen = replace(scene, camera=camera)
        usual, exact = (rz.render(seen, (120, 90), tolerance=each, **options) for each in (DEFAULT, 0))
        levels = np.abs(usual.rgba.astype(int) - exact.rgba).max()
        assert levels <= 1, f"{view}, {shading}, {samples} samples: {levels} levels > 1"
        n_covered += exact.stats.covered
    assert n_covered > 40_000


# ---------------------------------------------------------------- against the true surface


def test_a_highlight_inside_a_triangle_is_lost_by_gouraud_and_found_by_phong():
    """A sheet that faces the viewer, lit along the view: R = 2 (N·V) N - V, and the highlight is (R·V)^n."""
    size, lights = (120, 90), (rz.DirectionalLight((0, 0, -1), 1.0),)
    material = rz.Material(diffuse=0.2, specular=0.7, shininess=40)
    corners, middle = [(4, 4), (116, 6), (60, 86)], (60, 32)
    lean = unit([[-0.5, 0.3, 1], [0.5, 0.3, 1], [0, -0.6, 1.0]])  # the mean looks at the viewer
    scene = sheet(size, corners, 1.0, [[0, 1, 2]], lights, normals=lean, material=material)
    for tolerance in (0.0, DEFAULT):
        flat, gouraud, phong = (
            rz.render(scene, size, shading=shading, tolerance=tolerance, samples=1).color[..., 1]
            for shading in SHADINGS
        )
        at = middle[::-1]
        highlight = phong - (phong > 0) * 0.2
        assert abs(phong.max() - 0.9) < 5e-3, f"Phong's method: {phong.max():.4f}, the true maximum is 0.9"
        assert np.hypot(*(np.argwhere(phong == phong.max()).mean(axis=0) - at)) < 5
        assert highlight[at] > 0.68 and gouraud.max() < 0.25, f"Gouraud's method: {gouraud.max():.3f} > 0.25"
        assert np.ptp(flat[flat > 0]) == 0
    corner_values = 0.2 * lean[:, 2] + 0.7 * (2 * lean[:, 2] ** 2 - 1).clip(0) ** 40
    assert gouraud.max() <= corner_values.max() + DEFAULT


numbers = st.floats(-1, 1, allow_nan=False)
places = st.tuples(st.floats(-10, 58), st.floats(-10, 46))


@settings(max_examples=15, deadline=None)
@given(
    st.lists(places, min_size=3, max_size=3),
    st.tuples(numbers, numbers),
    st.tuples(numbers, numbers, st.floats(-1, -0.05)),
    st.booleans(),
    st.booleans(),
)
def test_flat_gouraud_and_phong_agree_on_a_lit_plane(points, slopes, direction, is_perspective, is_grey):
    """No highlight, a directional light, one plane: there is one intensity, and every method must find it."""
    depth = [3 + (s * (x / SIZE[0] - 0.5) + t * (y / SIZE[1] - 0.5)) for (x, y), s, t in ((p, *slopes) for p in points)]
    # Corners of a perspective sheet lie in a plane whatever their depths: there are only three.
    area = np.linalg.det(np.array([points[1], points[2]]) - points[0])
    assume(abs(area) >= 20)
    lights = (rz.AmbientLight(0.1), rz.DirectionalLight(direction, 0.8 if is_grey else (0.8, 0.5, 0.3)))
    scene = sheet(SIZE, points, depth, [[0, 1, 2]], lights, is_perspective, material=DULL)
    vertices = scene.meshes[0].vertices
    normal = unit(np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0]))
    normal = -normal if normal @ vertices[0] > 0 and is_perspective else normal
    normal = -normal if normal[2] < 0 and not is_perspective else normal
    n_dot_l = max(0.0, -(normal @ unit(np.array(direction))))
    expected = 0.7 * (0.1 + n_dot_l * np.array(lights[1].color))
    for shading in SHADINGS:
        for tolerance, budget in ((0.0, EXACT), (DEFAULT, DEFAULT)):
            frame = rz.render(scene, SIZE, shading=shading, tolerance=tolerance, samples=1)
            error = np.abs(frame.color - expected)[frame.alpha > 0].max(initial=0.0)
            assert error <= budget, f"{shading}: {error:.3g} > {budget:.3g}"
