"""Check whole pictures against the reference: all shadings, lights, materials, cameras, exact and default."""

import itertools

import numpy as np
import pytest
from helpers.against_reference import BUFFERS, EXACT, NORMAL, assert_matches_reference
from helpers.pinhole import SHADINGS, octasphere, torus
from helpers.pixels import needle
from helpers.raster import COLORED, GREY, assert_runs, sheet

import rasterizer as rz
from rasterizer import reference

SIZE = (60, 45)
DEFAULT = 1 / 4096
TOLERANCES = ((0.0, EXACT), (DEFAULT, DEFAULT))  # (option, budget)
RING, BALL = torus(24, 12), octasphere(3)
CAMERAS = {
    "perspective": rz.Camera.perspective((1.5, 2, 4), fov=40),
    "orthographic": rz.Camera.orthographic((1.5, 2, 4), height=3.2),
}
LIGHTS = {
    "directional": GREY,
    "point": (rz.AmbientLight(0.1), rz.PointLight((2, 3, 3), 0.9, (1, 0.1, 0.05))),
    "coloured": COLORED,
    "carried": (
        rz.AmbientLight(0.1),
        rz.DirectionalLight((-0.4, -0.5, -0.8), 0.5, "camera"),
        rz.PointLight((-1, 1, 0), 0.5, (1, 0, 0.01), "camera"),
    ),
    "amplifying": (rz.PointLight((1.2, 1.5, 0.9), 0.3, (0.1, 0, 0.3), amplify=True),),
    "none": (),
}
MATERIALS = {
    "default": rz.Material(),
    "tinted": rz.Material(diffuse=(0.8, 0.4, 0.2), specular=(0.4, 0.2, 0.1)),
    "blinn": rz.Material(specular=0.5, shininess=80, reflection="blinn"),
    "glowing": rz.Material(diffuse=(0.8, 0.4, 0.2), specular=0.3, emissive=(0, 0.1, 0.05)),
    "dull": rz.Material(specular=0, diffuse=0.5, emissive=0.05),
}


def check_all(scene, size=SIZE, shadings=SHADINGS, **options):
    """Check a scene with every shading method, at tolerance 0 and the default."""
    for shading in shadings:
        for tolerance, budget in TOLERANCES:
            assert_matches_reference(scene, size, budget, shading=shading, tolerance=tolerance, **options)


def many_meshes():
    """Meshes of different materials, with colours of vertices, of faces and none, that cut each other."""
    rng = np.random.default_rng(0)
    vertices, faces = BALL
    return [
        rz.Mesh(*RING),
        rz.Mesh(vertices * 0.5 + (0.6, 0.2, 0.4), faces, material=MATERIALS["blinn"]),
        rz.Mesh(
            vertices * 0.4 - (0.6, 0.1, 0.1),
            faces,
            colors=rng.random(vertices.shape),
            material=MATERIALS["dull"],
        ),
        rz.Mesh(
            vertices * 0.4 + (0, 0.7, 0.1),
            faces,
            face_colors=rng.random((len(faces), 3)),
            material=MATERIALS["tinted"],
        ),
    ]


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("lights", LIGHTS)
def test_every_light_and_material_against_the_reference(camera, lights):
    for material in MATERIALS.values():
        check_all(rz.Scene([rz.Mesh(*RING, material=material)], LIGHTS[lights], CAMERAS[camera]))


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("lights", ["directional", "coloured"])
def test_several_meshes(camera, lights):
    check_all(rz.Scene(many_meshes(), LIGHTS[lights], CAMERAS[camera]))
    check_all(rz.Scene(many_meshes()[:2], LIGHTS[lights], CAMERAS[camera]))


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("samples", [4, 9, 16])
def test_samples_and_backgrounds(camera, samples):
    for lights, background in ((GREY, None), (COLORED, (0.1, 0.2, 0.3)), (GREY, "navy")):
        scene = rz.Scene(many_meshes()[:2], lights, CAMERAS[camera], background)
        check_all(scene, (30, 22), samples=samples, ignored=0.02)


@pytest.mark.parametrize("camera", CAMERAS)
def test_two_sided_lighting_and_culling(camera):
    """Open models, seen from both sides, wound both ways; normals that look inwards, and senseless ones."""
    rng = np.random.default_rng(0)
    vertices, faces = RING
    half = faces[: len(faces) // 2]
    corner_normals = rng.standard_normal((len(BALL[1]), 3, 3))
    corner_normals[5] = 0
    meshes = [
        rz.Mesh(vertices, half),
        rz.Mesh(vertices, half[:, ::-1]),
        rz.Mesh(*BALL, normals=-BALL[0]),
        rz.Mesh(*BALL, normals=corner_normals),
    ]
    for mesh in meshes:
        for cull in ("none", "back"):
            check_all(rz.Scene([mesh], COLORED, CAMERAS[camera]), cull=cull)


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("color_range", ["clamp", "global", "local"])
def test_colours_out_of_range(shading, color_range):
    """Float32 may round across a threshold of the 8 bits: one level, in less than 1 % of the values."""
    bright = (
        rz.AmbientLight(0.5),
        rz.DirectionalLight((-0.2, -0.3, -1), (3, 2, 1.0)),
        rz.PointLight((10, 10, 3), (1, 2, 0.5)),
    )
    size, points = (40, 30), [(3, 3), (36, 5), (35, 28), (2, 25)]
    for background in (None, (0.2, 4, 0.3)):
        for samples in (1, 9):
            scene = sheet(size, points, [1, 1, 1.2, 1.1], [[0, 1, 2], [0, 2, 3]], bright, background=background)
            expected = reference.render(scene, size, shading=shading, samples=samples, color_range=color_range)
            assert expected.color.max() > 1.5
            frame = rz.render(scene, size, shading=shading, samples=samples, color_range=color_range, tolerance=0)
            levels = np.abs(frame.rgb.astype(int) - expected.rgb)
            assert levels.max() <= 1 and (levels > 0).mean() < 0.01, (
                f"{levels.max()} levels, {(levels > 0).sum()} values"
            )
            alone = rz.render(
                scene,
                size,
                shading=shading,
                samples=samples,
                color_range=color_range,
                tolerance=0,
                outputs=("rgb",),
            )
            assert (alone.rgba == frame.rgba).all()


@pytest.mark.parametrize("seed", [2, 3, 5, 6])
def test_soups_through_the_near_plane(seed):
    """Triangles with one, two and three vertices behind the eye, far planes, every kind of attribute."""
    rng = np.random.default_rng(seed)
    center = 3 * rng.standard_normal((25, 1, 3)) - (0, 0, 2)
    vertices = (center + 1.5 * rng.standard_normal((25, 3, 3))).reshape(-1, 3)
    behind = (vertices[:, 2] > 1).reshape(-1, 3).sum(axis=1)
    assert {0, 1, 2} <= set(behind.tolist())
    given = {"colors": rng.random((75, 3))} if seed % 2 else {"normals": rng.standard_normal((75, 3))}
    mesh = rz.Mesh(vertices, np.arange(75).reshape(-1, 3), **given)
    for near, far in ((10.0 ** rng.uniform(-2, 0), None), (0.3, 9.0)):
        camera = rz.Camera.perspective((0, 0, 1), (0, 0, -5), fov=70, near=near, far=far)
        check_all(rz.Scene([mesh], COLORED if seed < 4 else GREY, camera), units=2.0**18, ignored=0.02)
        camera = rz.Camera.orthographic((0, 0, 1), (0.3, 0.2, -5), height=6, near=near, far=far)
        check_all(rz.Scene([mesh], COLORED if seed < 4 else GREY, camera), units=2.0**18, ignored=0.02)


@pytest.mark.parametrize("near", [1.0, 0.1, 1e-3, 1e-5])
def test_floors_that_pass_below_the_eye(near):
    """The ratio of distances reaches 10^7; vertices lie behind the eye."""
    corners = [(-50, -1, 50), (50, -1, 50), (50, -1, -50), (-50, -1, -50)]
    camera = rz.Camera.perspective((0.1, 0.2, 0.3), (0.3, 0.1, -5), fov=60, near=near)
    lights = (rz.AmbientLight(0.1), rz.PointLight((2, 3, -3), 0.9, (1, 0.1, 0.01)))
    for given in (lights, GREY):
        scene = rz.Scene([rz.Mesh(corners, [[0, 1, 2], [0, 2, 3]])], given, camera)
        check_all(scene, units=2.0**22, ignored=0.01)


@pytest.mark.parametrize("scale", [1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9])
def test_scenes_of_any_size(scale):
    vertices, faces = RING
    lights = (rz.AmbientLight(0.1), rz.PointLight((2 * scale, 3 * scale, 3 * scale), 0.9))
    for camera in (
        rz.Camera.perspective((1.5 * scale, 2 * scale, 4 * scale), fov=40),
        rz.Camera.orthographic((1.5 * scale, 2 * scale, 4 * scale), height=3.2 * scale),
    ):
        check_all(rz.Scene([rz.Mesh(vertices * scale, faces)], lights, camera))


@pytest.mark.parametrize("reach", [1, 10, 1e3, 1e5])
def test_large_triangles_close_to_the_eye(reach):
    """Products of edge functions, 1/w and normals must fit float32 also far beyond the picture."""
    for depth in (1, 1e-3, 1e-6):
        corners = [(-reach, -reach, -depth), (reach, -reach, -1.5 * depth), (0, reach, -depth)]
        camera = rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=60)
        check_all(rz.Scene([rz.Mesh(corners, [[0, 1, 2]])], GREY, camera), units=2.0**22)


@pytest.mark.parametrize("distance", [10, 1e2, 1e3, 1e4, 1e6])
def test_a_light_close_to_a_surface_that_is_seen_from_afar(distance):
    """Positions relative to a far eye have few digits left in float32; so near a light needs more."""
    lights = (rz.AmbientLight(0.1), rz.PointLight((0.1, 0.2, 1.05), 0.8, (1, 0, 2)))
    fov = float(np.degrees(2 * np.arctan(1.2 / distance)))
    for camera in (
        rz.Camera.perspective((0, 0, distance), fov=fov),
        rz.Camera.orthographic((0, 0, distance), height=2.4),
    ):
        check_all(rz.Scene([rz.Mesh(*BALL)], lights, camera), ignored=0.02)


@pytest.mark.parametrize("is_perspective", [True, False])
@pytest.mark.parametrize("reach", [60, 2**12, 2**17])
def test_slivers(reach, is_perspective):
    rng = np.random.default_rng(reach)
    n = 40
    middle, angle = rng.uniform(0, 1, (n, 2)) * SIZE, rng.uniform(0, np.pi, n)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1) * reach
    third = middle + along * rng.uniform(-0.9, 0.9, (n, 1)) + rng.choice([-1, 1, 2, 100], (n, 2)) / 256
    points = np.stack([middle - along, middle + along, third], axis=1).reshape(-1, 2)
    normals = np.concatenate([rng.normal(0, 0.3, (3 * n, 2)), np.ones((3 * n, 1))], axis=1)
    faces = np.arange(3 * n).reshape(-1, 3)
    for lights in (GREY, COLORED):
        scene = sheet(SIZE, points, rng.uniform(1, 3, 3 * n), faces, lights, is_perspective, normals=normals)
        check_all(scene, units=2.0**20, ignored=0.02)


@pytest.mark.parametrize("bits", [10, 20, 24, 26, 27])
def test_the_thinnest_triangles(bits):
    """Doubled area 3, up to 2^20 px long: a sample's weights are a third each. A fault would end the run."""
    assert_runs(f"from pictures.test_render import check_needles; check_needles({bits})")


def check_needles(bits):
    """Compare triangles of doubled area 3 with the reference."""
    rng = np.random.default_rng(bits)
    n_covered = 0
    for _ in range(4):
        points = needle(rng, bits, SIZE) / 256
        if np.abs(points).max() >= 2**20:
            continue
        # A face outside the picture goes along, because a mesh in which nothing has area is refused.
        points = np.concatenate([points, [(-9, -9), (-6, -9), (-9, -6)]])
        normals = np.concatenate([rng.normal(0, 0.3, (6, 2)), np.ones((6, 1))], axis=1)
        for lights in (GREY, COLORED):
            scene = sheet(SIZE, points, 1.0, [[0, 1, 2], [3, 4, 5]], lights, normals=normals)
            for shading, (tolerance, budget) in itertools.product(SHADINGS, TOLERANCES):
                limits = {"budget": budget, "normal": NORMAL}
                if shading == "flat" and bits >= 26:
                    # The area is below float64's rounding: the polygon has a place, but no normal.
                    limits = {"budget": np.inf, "normal": np.inf}
                found = assert_matches_reference(scene, SIZE, **limits, shading=shading, tolerance=tolerance, ignored=0)
                n_covered += found.n_compared
    assert n_covered >= 12


def test_intensities_that_reach_their_bound():
    """A sheet that faces light and viewer is as bright as anything can be; float32 may round that up."""
    assert_runs("from pictures.test_render import check_brightest; check_brightest()")


def check_brightest():
    """Render sheets that face the light and the viewer, in all directions."""
    rng = np.random.default_rng(0)
    for k in range(60):
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
        if k % 6 == 0:
            lights = lights[:1]
        mesh = rz.Mesh(corners, [[0, 1, 2], [0, 2, 3]], normals=np.tile(-direction, (4, 1)), material=material)
        check_all(rz.Scene([mesh], lights, camera), (24, 18))


def test_a_light_in_the_very_point_of_a_surface():
    """An amplifying light is infinitely strong there; no pixel may become worse than infinite."""
    assert_runs("from pictures.test_render import check_touching_light; check_touching_light()")


def check_touching_light():
    """Put lights into a vertex, a centroid, and between."""
    points = [(5, 5), (50, 8), (22, 40)]
    vertices = sheet(SIZE, points, 1.0, [[0, 1, 2]]).meshes[0].vertices
    for place in (vertices[0], vertices.mean(axis=0), vertices.mean(axis=0) + (0, 0, 1e-3)):
        for amplify in (False, True):
            for attenuation in ((0, 0, 1), (1, 0, 0)):
                light = rz.PointLight(place, 0.8, attenuation, amplify=amplify)
                scene = sheet(SIZE, points, 1.0, [[0, 1, 2]], (light,))
                for shading in SHADINGS:
                    frame = rz.render(scene, SIZE, shading=shading, samples=1)
                    assert frame.alpha.sum() > 100
                    assert not np.isnan(frame.color).any()


def test_flat_normals_of_a_concave_polygon():
    """A fan from the wrong corner holds a triangle wound the other way; the polygon has one normal still."""
    dart = [(10, 10), (55, 22), (10, 40), (25, 22)]
    for polygon in ([0, 1, 2, 3], [1, 2, 3, 0], [2, 3, 0, 1], [3, 2, 1, 0], [0, 3, 2, 1]):
        frame = rz.render(sheet(SIZE, dart, 1.0, [polygon]), SIZE, shading="flat", outputs=("normal",))
        normals = np.unique(frame.normal[frame.normal.any(axis=-1)], axis=0)
        assert len(normals) == 1 and normals[0, 2] > 0, f"{polygon}: normals {normals.tolist()}"


def test_vertex_and_face_colours_together():
    rng = np.random.default_rng(1)
    square = [(10, 10), (50, 8), (48, 40), (8, 38)]
    colors, face_colors = rng.random((4, 3)), rng.random((2, 3))
    for given in (
        {"colors": colors},
        {"face_colors": face_colors},
        {"colors": colors, "face_colors": face_colors},
    ):
        check_all(sheet(SIZE, square, 1.0, [[0, 1, 2], [0, 2, 3]], **given))


LONG = [(65536, 3), (3, 65536), (2**18, 1), (1, 2**18)]


@pytest.mark.parametrize("size", [(1, 1), (1, 50), (50, 1), (16384, 3), (3, 16384), *LONG, (7, 9), (8, 8), (9, 7)])
def test_pictures_of_any_shape(size):
    width, height = size
    points = [(-3, -3), (width + 5, -2), (width / 2, 2 * height + 5)]
    for is_perspective, lights in ((True, GREY), (False, COLORED)):
        scene = sheet(size, points, [1, 2.0, 1.5], [[0, 1, 2]], lights, is_perspective)
        check_all(scene, size, units=max(2.0**16, width + height))


@pytest.mark.parametrize("size", [(2**16, 1), (1, 2**16)])
def test_samples_of_the_longest_pictures(size):
    """Two surfaces that cross, with 16 samples: as many along an axis as there may be."""
    (width, height), lights = size, COLORED
    points = [(-3, -3), (width + 5, -2), (width / 2, 2 * height + 5)] * 2
    scene = sheet(size, points, [1, 2.0, 1.5, 2.0, 1.0, 1.5], [[0, 1, 2], [3, 4, 5]], lights)
    frame = rz.render(scene, size, samples=16, tolerance=0)
    expected = reference.render(scene, size, samples=16)
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


@pytest.mark.parametrize("camera", EMPTY)
@pytest.mark.parametrize("shading", SHADINGS)
def test_make_pictures(camera, shading):
    for background, rgba in ((None, (0, 0, 0, 0)), ("red", (255, 0, 0, 255))):
        for samples in (1, 9):
            scene = rz.Scene([rz.Mesh(*BALL)], GREY, EMPTY[camera], background)
            frame = rz.render(scene, (31, 17), shading=shading, samples=samples, outputs=BUFFERS)
            assert (frame.face == -1).all() and np.isinf(frame.depth).all() and not frame.normal.any()
            assert (frame.rgba == rgba).all() and frame.stats.covered == 0


@pytest.mark.parametrize("shading", SHADINGS)
def test_the_default_picture_is_within_one_level_of_the_exact_one(shading):
    """Every value of the picture, for every kind of scene."""
    scenes = [
        rz.Scene([rz.Mesh(*RING, material=material)], lights, camera)
        for material in MATERIALS.values()
        for lights in LIGHTS.values()
        for camera in CAMERAS.values()
    ]
    for scene in scenes:
        usual, exact = (
            rz.render(scene, (100, 75), shading=shading, tolerance=t, samples=1).rgb.astype(int) for t in (DEFAULT, 0)
        )
        assert np.abs(usual - exact).max() <= 1, f"{np.abs(usual - exact).max()} levels > 1"
