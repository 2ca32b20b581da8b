"""Check how good pictures are: against the reference, true surfaces, and what shading methods promise."""

import itertools
from dataclasses import replace

import make_models
import numpy as np
import pytest
from helpers import true_surfaces
from helpers.against_reference import EXACT, assert_matches_reference, compare_with_reference
from helpers.arrays import differences
from helpers.pinhole import ALBEDO, DULL, SHADINGS, octasphere, torus, unit
from helpers.raster import COLORED, GREY, ROOT, sheet
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import rasterizer as rz

DEFAULT = 1 / 4096
SIZE = (48, 36)
VIEW = rz.Camera.perspective((1.5, 2, 4), fov=40)


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

SURFACES = {
    "sphere": (lambda k: make_models.sphere(k), (2, 3), rz.Camera.perspective((1.5, 2, 4), fov=34)),
    "torus": (
        lambda k: make_models.torus(4 * 2**k, 2 * 2**k),
        (2, 3),
        rz.Camera.perspective((1.5, 3, 4), fov=34),
    ),
}


@pytest.mark.parametrize("name, specular", [("sphere", 0.3), ("torus", 0.0)])
def test_errors_against_the_true_surface(name, specular):
    """Flat > Gouraud > Phong, and edges half as long divide errors by about 2 (flat) and 4 (interpolated).

    A highlight has to be wider than the facets before Gouraud's method falls so fast, hence 2.2.
    """
    make, levels, camera = SURFACES[name]
    material = rz.Material(diffuse=0.7, specular=specular, shininess=20)
    errors = []
    for level in levels:
        solid = make(level)
        mesh = rz.Mesh(solid.points, solid.faces, material=material, crease_angle=180)
        scene = rz.Scene([mesh], GREY, camera)
        truth = true_surfaces.draw(name, scene, (160, 120), 1)
        rms = []
        for shading in SHADINGS:
            frame = rz.render(scene, (160, 120), shading=shading, samples=1)
            both = (frame.alpha > 0) & (truth.alpha > 0)
            assert both.sum() > 5000
            rms.append(np.sqrt(np.mean((frame.color - truth.color)[both] ** 2)))
        flat, gouraud, phong = rms
        assert flat > 1.15 * gouraud and gouraud > 1.1 * phong, f"level {level}: {rms} are not falling"
        errors.append(rms)
    falls = np.array(errors)[:-1] / np.array(errors)[1:]
    for shading, fall, least in zip(SHADINGS, falls.T, (1.7, 2.2, 3.0), strict=True):
        assert (fall > least).all(), f"{shading}: errors fall by {fall.round(2)}, not by {least}"
    assert errors[-1][2] < 0.02, f"Phong's method is off by {errors[-1][2]:.3g} > 0.02"


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


# ---------------------------------------------------------------- what interpolation may not do

WIDE = (8192, 3)


@pytest.mark.parametrize("channels, rise", [("mono", 0.9), ("rgb", 0.9), ("rgb", 1e-4), ("mono", 1e-6)])
def test_increments_do_not_drift_over_long_spans(rise, channels):
    """Intensity that rises over 8192 samples, added up one ΔI a sample: the last is as good as the first."""
    points = [(-3, -3), (8195, -3), (8195, 8), (-3, 8)]
    lights, given = (rz.AmbientLight(0.05), rz.DirectionalLight((0, 0, -1), 0.95)), {}
    if channels == "mono":
        cosines = np.array([1 - rise, 1, 1, 1 - rise])
        normals = np.stack([np.sqrt(1 - cosines**2), np.zeros(4), cosines], axis=1)
        given, at_corners = {"normals": normals}, 0.9 * (0.05 + 0.95 * cosines)
    else:
        low = np.array([0.05, 0.9 - rise, 0.3]) * 0.9
        colors = np.array([low, low + (0, rise * 0.9, 0), low + (0, rise * 0.9, 0), low])
        lights, given = (rz.AmbientLight(1.0),), {"colors": colors}
        at_corners = colors[:, 1]
    material = rz.Material(diffuse=0.9, specular=0) if channels == "mono" else ALBEDO
    scene = sheet(WIDE, points, 1.0, [[0, 1, 2], [0, 2, 3]], lights, material=material, **given)
    share = (np.arange(WIDE[0]) + 0.5 + 3) / 8198
    expected = at_corners[0] + share * (at_corners[1] - at_corners[0])
    by_tolerance = {}
    for tolerance, budget in ((0.0, EXACT), (DEFAULT, DEFAULT)):
        color = rz.render(scene, WIDE, tolerance=tolerance, samples=1, shading="gouraud").color[..., 1]
        error = np.abs(color - expected)
        assert error.max() <= budget, f"{error.max():.3g} > {budget:.3g}"
        by_tolerance[tolerance] = color
    # Half of a level (2^-24) a step is all that one addition may be off: far less than the tolerance here.
    drift = np.abs(by_tolerance[DEFAULT] - by_tolerance[0.0])
    assert drift.max() <= 8203 * 2.0**-24, f"{drift.max():.3g} > {8203 * 2.0**-24:.3g}"
    assert rise < 1e-5 or (drift > 0).any(), "nothing was added up"


def outline(scene, shading, tolerance, camera_size, vertex_values):
    """Refuse samples outside the range of their triangle's three values (n_face, 3, channels)."""
    frame = rz.render(scene, camera_size, shading=shading, tolerance=tolerance, outputs=("color", "face"), samples=1)
    shown = frame.face >= 0
    values, color = vertex_values[frame.face[shown]], frame.color[shown]
    low, high = values.min(axis=1), values.max(axis=1)
    # Values lie on 2^24 levels by default, and are float32 at last.
    slack = (2.0**-23 if tolerance else 2.0**-24) * max(1.0, vertex_values.max())
    below, above = (low - color).max(), (color - high).max()
    assert max(below, above) <= slack, f"outside by {max(below, above):.3g} > {slack:.3g}"
    return frame


@pytest.mark.parametrize("tolerance, channels, is_perspective", [
    (0.0, "mono", True), (DEFAULT, "rgb", True), (DEFAULT, "mono", False), (1 / 64, "rgb", False),
])  # fmt: skip
def test_values_stay_within_the_range_of_the_vertices(tolerance, channels, is_perspective):
    """Any size of triangle, from slivers to ones much larger than the picture; nothing may overshoot."""
    rng = np.random.default_rng(2)
    n_seen = 0
    for reach in (2, 15, 300, 2**13):
        n = 60
        center = rng.uniform(0, 1, (n, 1, 2)) * SIZE
        points = (center + reach * rng.uniform(-1, 1, (n, 3, 2))).reshape(-1, 2)
        points[1::9] = points[::9] + rng.choice([-2, 1, 3], (len(points[::9]), 2)) / 256
        depth, faces = rng.uniform(1, 4, 3 * n), np.arange(3 * n).reshape(-1, 3)
        if channels == "mono":
            lean = rng.normal(0, 0.2, (3 * n, 2))
            normals = unit(np.concatenate([lean, np.ones((3 * n, 1))], axis=1))
            # Lit from both sides, so that it does not matter which one a steep triangle shows.
            lights = rz.DirectionalLight((0, 0, -1), 1.0), rz.DirectionalLight((0, 0, 1), 1.0)
            given = {"normals": normals, "material": DULL}
            values = 0.7 * np.repeat(normals[:, 2, None], 3, axis=1)
        else:
            values = rng.random((3 * n, 3)) ** 2
            lights, given = (rz.AmbientLight(1.0),), {"colors": values, "material": ALBEDO}
        scene = sheet(SIZE, points, depth, faces, lights, is_perspective, **given)
        frame = outline(scene, "gouraud", tolerance, SIZE, values.reshape(n, 3, 3))
        n_seen += len(np.unique(frame.face))
    assert n_seen > 60


@pytest.mark.parametrize("tolerance, channels, shading", [
    (0.0, "rgb", "gouraud"), (DEFAULT, "mono", "gouraud"), (DEFAULT, "rgb", "gouraud"), (0.0, "mono", "phong"),
    (DEFAULT, "rgb", "phong"), (DEFAULT, "mono", "flat"),
])  # fmt: skip
def test_constants_stay_constant(tolerance, channels, shading):
    """Triangles of any shape and depth whose corners are lit alike: one value a triangle, to the last bit."""
    rng = np.random.default_rng(6)
    n = 80
    center = rng.uniform(0, 1, (n, 1, 2)) * SIZE
    reach = rng.choice([3, 40, 2000], (n, 1, 1))
    points = (center + reach * rng.uniform(-1, 1, (n, 3, 2))).reshape(-1, 2)
    faces, depth = np.arange(3 * n).reshape(-1, 3), 10.0 ** rng.uniform(0, 3, 3 * n)
    normals = unit(np.concatenate([rng.normal(0, 0.3, (n, 2)), np.ones((n, 1))], axis=1)).repeat(3, axis=0)
    light_color, given = 0.8, {}
    if channels == "rgb":
        light_color, given = (0.8, 0.5, 0.3), {"colors": rng.random((n, 3)).repeat(3, axis=0)}
    lights = (rz.AmbientLight(0.1), rz.DirectionalLight((0.2, -0.3, -1), light_color))
    scene = sheet(SIZE, points, depth, faces, lights, True, normals=normals, material=DULL, **given)
    frame = rz.render(scene, SIZE, shading=shading, tolerance=tolerance, outputs=("color", "face"), samples=1)
    seen = np.unique(frame.face)[1:]
    assert len(seen) >= 10
    for face in seen:
        values = np.unique(frame.color[frame.face == face], axis=0)
        assert len(values) == 1, f"face {face} has {len(values)} values, {np.ptp(values, axis=0).max():.3g} apart"


# ---------------------------------------------------------------- creases, as pictures


def test_averaged_normals_hide_the_teeth_of_a_saw_and_creases_show_them():
    """From above, lit from one side: N·L is 0.99 and 0.14 on the slopes, 0.71 where normals are averaged."""
    size, lights = (320, 160), (rz.DirectionalLight((-1, -1, 0), 1.0),)
    camera = rz.Camera.orthographic((0, 9, 0), (0, 0, 0), (0, 0, -1), height=4.0)
    for shading in ("gouraud", "phong"):
        drawn = {}
        for angle in (180, 30):
            mesh = replace(load("sawtooth.obj", crease_angle=angle).meshes[0], material=DULL)
            frame = rz.render(rz.Scene([mesh], lights, camera), size, shading=shading, samples=1)
            assert not differences(frame.alpha, 1)
            drawn[angle] = frame.color[:, 20:-20, 1]  # the outermost slopes have no neighbour to average with
        even, teeth = drawn[180], drawn[30]
        assert np.ptp(even) <= DEFAULT and abs(even.mean() - 0.7 * 0.5**0.5) <= DEFAULT
        expected = 0.7 * np.array([0.2, 1.4]) * 0.5**0.5
        columns = np.arange(20, 300) // 20 % 2  # a slope is 20 px wide; the first one rises towards +x
        assert np.abs(teeth - expected[columns]).max() <= DEFAULT


def test_triangles_that_reach_far_out_of_the_picture_keep_their_depth():
    """A floor on which the eye stands, clipped next to it, slabs above and below it, some way off, and a speck before
    the eye, so that depth has a long way to go: the floor is hundreds of thousands of pixels high."""
    height, near_by = 2.0, 0.0005
    floor = [[-1000, 0, -1000], [1000, 0, -1000], [1000, 0, 1000], [-1000, 0, 1000]]
    slabs = [[[x, y, -60], [x + 6, y, -60], [x + 6, y, -20], [x, y, -20]] for x, y in ((-8, near_by), (2, -near_by))]
    speck = np.array([[0, 0, 0], [1e-4, 0, 0], [1e-4, 1e-4, 0], [0, 1e-4, 0]]) + (0, height, -2e-3)
    meshes = [rz.Mesh(points, [[0, 3, 2, 1]]) for points in (floor, *slabs, speck)]
    scene = rz.Scene(meshes, GREY, rz.Camera.perspective((0, height, 0), (0, 0, -15), up=(0.4, 1, 0), fov=50))
    compare_with_reference(scene, (160, 120), shading="flat", tolerance=0)
    face = rz.render(scene, (160, 120), shading="phong", outputs=("face",), samples=1).face
    # The floor's own vertices are rounded to 1/256 px, which lets the lower slab through at its end.
    assert np.isin(face, (2, 3)).sum() > 200 and np.isin(face, (4, 5)).sum() < 50
