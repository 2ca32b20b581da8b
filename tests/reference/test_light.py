"""Check the reference's light and its resolve, against what does not depend on it.

Closed forms of the illumination equation, a ray that meets a sphere, colours and alphas by hand.
"""

import numpy as np
import pytest
from helpers.arrays import deviations, differences
from helpers.pinhole import (
    DULL,
    QUAD,
    SHADINGS,
    SIZE,
    at_pixel,
    draw,
    eye_camera,
    layer,
    octasphere,
    sample_rays,
    sheet_camera,
    tilted,
    unit,
)

from rasterizer.reference import render
from rasterizer.scene.camera import Camera
from rasterizer.scene.lights import AmbientLight, DirectionalLight, PointLight
from rasterizer.scene.material import Material
from rasterizer.scene.mesh import Mesh
from rasterizer.scene.scene import Scene

# ── facing ──────────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("shading", SHADINGS)
def test_normals_look_to_the_viewer_from_both_sides(shading):
    lights = (DirectionalLight((0, 0, -1)),)
    front = draw(layer((8, 8), 2.0), QUAD, (8, 8), lights=lights, material=DULL, shading=shading)
    back = draw(layer((8, 8), 2.0), QUAD[:, ::-1], (8, 8), lights=lights, material=DULL, shading=shading)
    for picture in (front, back):
        assert not deviations(picture.normal, (0, 0, 1))
        assert not deviations(picture.color, 0.7)
    assert draw(layer((8, 8), 2.0), QUAD, (8, 8), cull="back").face.min() >= 0
    assert not differences(draw(layer((8, 8), 2.0), QUAD[:, ::-1], (8, 8), cull="back").face, -1)


@pytest.mark.parametrize("shading", ["gouraud", "phong"])
def test_normals_of_a_file_that_contradict_its_winding(shading):
    options = {"lights": (DirectionalLight((0, 0, -1)),), "material": DULL, "shading": shading}
    for normals in (np.tile([0.0, 0, 1], (4, 1)), np.tile([0.0, 0, -1], (4, 1))):
        for faces in (QUAD, QUAD[:, ::-1]):
            picture = draw(layer((8, 8), 2.0), faces, (8, 8), normals=normals, **options)
            assert not deviations(picture.normal, (0, 0, 1))
            assert not deviations(picture.color, 0.7)


def test_culling_a_closed_mesh_changes_nothing():
    vertices, faces = octasphere(1)
    for shading in SHADINGS:
        options = {"lights": None, "material": Material(), "camera": Camera.perspective((1, 2, 4), fov=40)}
        options["shading"] = shading
        all_faces = draw(vertices, faces, (25, 20), **options)
        culled = draw(vertices, faces, (25, 20), cull="back", **options)
        assert not differences(all_faces.face, culled.face) and not differences(all_faces.color, culled.color)


# ── light ───────────────────────────────────────────────────────────────────────────────────────────────


def test_one_lit_plane_is_the_same_in_all_shadings():
    points, normal, _ = tilted(True)
    lights = (AmbientLight(0.1), DirectionalLight((0.3, -0.4, -0.8), (0.9, 0.6, 0.3)))
    towards = unit(normal) * -np.sign(normal @ points[0])
    cosine = max(towards @ -unit([0.3, -0.4, -0.8]), 0)
    expected = 0.7 * (0.1 + np.array([0.9, 0.6, 0.3]) * cosine)
    assert cosine > 0.1
    for shading in SHADINGS:
        picture = draw(points, [[0, 1, 2]], SIZE, lights=lights, material=DULL, shading=shading)
        np.testing.assert_allclose(
            picture.color[picture.face == 0], np.tile(expected, ((picture.face == 0).sum(), 1)), rtol=1e-12
        )


def test_phong_finds_the_highlight_inside_a_triangle_and_gouraud_does_not():
    shiny = Material(ambient=0.0, diffuse=0.0, specular=0.6, shininess=50)
    lights = (PointLight((0, 0, 0)),)  # in the eye: the highlight is where the sheet faces it, in the middle
    sheet = [(-20, -15, -2.0), (20, -15, -2.0), (0, 30, -2.0)]
    phong = draw(sheet, [[0, 1, 2]], (41, 41), lights=lights, material=shiny, shading="phong")
    gouraud = draw(sheet, [[0, 1, 2]], (41, 41), lights=lights, material=shiny, shading="gouraud")
    assert not differences(phong.face, 0)
    np.testing.assert_allclose(phong.color[20, 20], 0.6, rtol=1e-12)
    assert gouraud.color.max() < 1e-6
    # R.V = cos(2 angle) of the ray with the axis: elsewhere too
    cosine = 1 / np.linalg.norm(sample_rays((41, 41)), axis=-1)
    np.testing.assert_allclose(phong.color[..., 1], 0.6 * np.maximum(2 * cosine**2 - 1, 0) ** 50, atol=1e-12)


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("reflection", ["phong", "blinn"])
def test_no_highlight_from_a_light_behind(shading, reflection):
    material = Material(ambient=0.5, diffuse=0.7, specular=1.0, shininess=1.0, emissive=0.01, reflection=reflection)
    lights = (AmbientLight(0.2), DirectionalLight((0.5, 0, 0.6)), PointLight((0.1, 0.2, -2.001)))
    picture = draw(layer((8, 8), 2.0), QUAD, (8, 8), lights=lights, material=material, shading=shading)
    np.testing.assert_allclose(picture.color, 0.11, rtol=1e-12)


@pytest.mark.parametrize("attenuation, amplify", [
    ((1, 0, 0), False), ((1, 0.5, 0.25), True), ((0.2, 0, 0.1), False), ((0.2, 0, 0.1), True), ((0, 0, 1), False),
    ((0.3, 1, 0), True),
])  # fmt: skip
def test_attenuation_is_the_closed_form(attenuation, amplify):
    # a lamp 0.5 before the middle of a sheet at depth 2
    light = PointLight((0.0, 0.0, -1.5), (1.0, 0.5, 0.25), attenuation, amplify=amplify)
    picture = draw(layer((16, 16), 2.0), QUAD, (16, 16), lights=(light,), material=DULL, shading="phong")
    places = sample_rays((16, 16)) * 2
    distance = np.sqrt(places[..., 0] ** 2 + places[..., 1] ** 2 + 0.25)
    factor = 1 / (attenuation[0] + attenuation[1] * distance + attenuation[2] * distance**2)
    factor = factor if amplify else np.minimum(factor, 1)
    expected = (0.7 * 0.5 / distance * factor)[..., None] * np.array([1.0, 0.5, 0.25])
    np.testing.assert_allclose(picture.color, expected, rtol=1e-11)


@pytest.mark.parametrize("shading, degrees", [("flat", 20.0), ("gouraud", 44.0), ("phong", 0.0), ("phong", 60.0)])
def test_blinn_and_phong_are_their_closed_forms(shading, degrees):
    # seen along the normal: R.V = cos(angle), N.H = cos(angle / 2)
    angle = np.radians(degrees)
    lights = (DirectionalLight((-np.sin(angle), 0, -np.cos(angle)), (1.0, 0.8, 0.6)),)
    for reflection, cosine in (("phong", np.cos(angle)), ("blinn", np.cos(angle / 2))):
        material = Material(diffuse=(0.1, 0.2, 0.3), specular=(0.5, 0.4, 0.3), shininess=17, reflection=reflection)
        options = {"camera": sheet_camera(8), "lights": lights, "material": material, "shading": shading}
        picture = draw(layer((8, 8), 2.0, False), QUAD, (8, 8), **options)
        bare = np.array([0.1, 0.2, 0.3]) * np.cos(angle) + np.array([0.5, 0.4, 0.3]) * cosine**17
        np.testing.assert_allclose(picture.color, np.broadcast_to(bare * (1.0, 0.8, 0.6), (8, 8, 3)), rtol=1e-11)


def test_sphere_against_the_ray_that_meets_it():
    vertices, faces = octasphere(4)
    center, light_pos = np.array([0.1, -0.2, -3.0]), np.array([2.0, 3.0, 1.0])
    material = Material(diffuse=0.6, specular=0.3, shininess=20)
    size, lights = (40, 40), (AmbientLight(0.1), PointLight(light_pos))
    options = {"lights": lights, "material": material, "shading": "phong", "camera": eye_camera()}
    picture = draw(vertices + center, faces, size, normals=vertices, **options)
    rays = unit(sample_rays(size))
    along = rays @ center
    rest = along**2 - (center @ center - 1)
    is_safe = rest > 0.1  # away from the silhouette
    is_hit = picture.face >= 0
    assert not differences(is_hit[is_safe], True) and not differences(is_hit[rest < 0], 0)
    points = rays * (along - np.sqrt(np.maximum(rest, 0)))[..., None]
    # edges are about 90° / 2^4 of the circle long: their middles lie 1 - cos(half of that) below the sphere,
    # and faces up to twice as deep
    sagitta = 2 * (1 - np.cos(np.radians(90 / 2**4) / 2))
    slant = np.abs(np.sum(unit(points - center) * rays, axis=-1))
    error = (np.abs(picture.depth + points[..., 2])[is_safe] * slant[is_safe]).max()
    assert error < 1.5 * sagitta, f"measured {error:.3g} > budget {1.5 * sagitta:.3g}"
    normal, to_light = unit(points - center), unit(light_pos - points)
    n_dot_l = np.sum(normal * to_light, axis=-1)
    r_dot_v = np.sum((2 * n_dot_l[..., None] * normal - to_light) * -rays, axis=-1)
    lit = 0.6 * np.maximum(n_dot_l, 0) + (n_dot_l > 0) * 0.3 * np.maximum(r_dot_v, 0) ** 20
    assert np.abs(picture.normal - normal)[is_safe].max() < 0.01
    assert np.abs(picture.color[..., 0] - 0.06 - lit)[is_safe].max() < 0.01


def test_lights_attached_to_the_camera():
    vertices, faces = octasphere(2)
    eye, target = np.array([1.0, 2.0, 4.0]), np.array([0.1, 0.0, 0.2])
    camera = Camera.perspective(eye, target, fov=40)
    forward = unit(target - eye)
    right = unit(np.cross(forward, (0, 1, 0)))
    up = np.cross(right, forward)
    lamp = PointLight((0.3, 0.4, -0.5), 0.5, (0, 1, 0), "camera")
    carried = DirectionalLight((0.5, -0.3, -0.8), 0.5, "camera"), lamp
    direction = 0.5 * right - 0.3 * up + 0.8 * forward
    position = eye + 0.3 * right + 0.4 * up + 0.5 * forward
    fixed = (DirectionalLight(direction, 0.5), PointLight(position, 0.5, (0, 1, 0)))
    options = {"camera": camera, "material": Material()}
    pictures = [draw(vertices, faces, (24, 18), lights=lights, **options) for lights in (carried, fixed)]
    assert pictures[0].color.max() > 0.1
    np.testing.assert_allclose(pictures[0].color, pictures[1].color, rtol=1e-11)


def test_flat_lights_a_polygon_once_at_its_centroid():
    # a trapezium, its parallel sides 6 and 2 long and 3 apart: the centroid lies
    # 3 (6 + 2·2) / (3 (6 + 2)) = 1.25 from the long side
    corners = np.array([(-3, 0, -4.0), (3, 0, -4.0), (1, 3, -4.0), (-1, 3, -4.0)])
    light = PointLight((0.5, 2.0, -3.0), attenuation=(0, 0, 0.5))
    colors = np.array([[0.1, 0, 0], [0.4, 0, 0], [0.6, 0, 0], [0.9, 0, 0]])
    picture = draw(corners, [[0, 1, 2, 3]], (60, 60), lights=(light,), material=DULL, shading="flat", colors=colors)
    to_light = np.array([0.5, 2.0, -3.0]) - (0, 1.25, -4.0)
    distance = np.linalg.norm(to_light)
    albedo = (0.1 + 0.4 + 0.6 + 0.9) / 4
    seen = picture.color[picture.face >= 0]
    np.testing.assert_allclose(seen[:, 0], albedo * 0.7 / distance * min(1, 2 / distance**2), rtol=1e-11)
    assert set(np.unique(picture.face)) == {-1, 0, 1}
    lambert, flat = (draw(corners, [[0, 1, 2, 3]], (9, 9), shading=name).color for name in ("lambert", "flat"))
    assert not differences(lambert, flat)


@pytest.mark.parametrize("shading", SHADINGS)
def test_every_mesh_keeps_its_own_material(shading):
    # the sheet in front covers the left half; the faces of the one behind are counted on from it
    front, behind = np.array(layer((8, 8), 2.0)), np.array(layer((8, 8), 3.0))
    front[1:3, 0] = 0.0
    materials = [Material(diffuse=d, specular=0.0, emissive=e) for d, e in ((0.2, 0.1), (0.6, 0.0))]
    meshes = [Mesh(v, QUAD, material=m) for v, m in zip((front, behind), materials, strict=True)]
    scene = Scene(meshes, lights=(DirectionalLight((0, 0, -1)),), camera=eye_camera())
    picture = render(scene, (8, 8), shading=shading)
    assert picture.face[:, :4].max() < 2 and picture.face[:, 4:].min() >= 2
    assert not deviations(picture.color[:, :4], 0.3)
    assert not deviations(picture.color[:, 4:], 0.6)


def test_creases_and_smoothing_decide_the_normals():
    # two faces of a roof that meet at 60 degrees on the line x = 0
    deep = -4 - 9 * np.tan(np.pi / 6)
    roof = [(0, -9, -4.0), (0, 9, -4.0), (-9, 0, deep), (9, 0, deep)]
    faces = [[0, 1, 2], [1, 0, 3]]
    column = (slice(None), 20)
    for options, tilt in (
        ({}, 30),
        ({"crease_angle": 59}, 30),
        ({"crease_angle": 61}, 0),
        ({"smoothing": np.array([1, 1])}, 0),
        ({"smoothing": np.array([1, 2])}, 30),
        ({"smoothing": np.array([1, 1]), "crease_angle": 59}, 30),
    ):
        picture = draw(roof, faces, (41, 41), shading="phong", **options)
        angle = np.degrees(np.arccos(np.minimum(picture.normal[column][:, 2], 1)))
        assert np.abs(angle[18:23] - tilt).max() < 2, f"{options}: {angle[18:23]}"


def test_vertex_and_face_colors_are_the_albedo():
    sheet = layer((4, 4), 2.0)
    vertex = draw(sheet, QUAD, (4, 4), colors=np.tile(np.uint8([255, 128, 0]), (4, 1)))
    face = draw(sheet, QUAD, (4, 4), face_colors=np.tile([1.0, 0.25, 0.5, 1.0], (2, 1)))
    assert not deviations(vertex.color, (1.0, ((128 / 255 + 0.055) / 1.055) ** 2.4, 0.0))
    assert not deviations(face.color, (1.0, 0.25, 0.5))


# ── resolve ─────────────────────────────────────────────────────────────────────────────────────────────


def emitting(emissive, size=(4, 4), edge=None, **options):
    """Render a sheet that shines by itself, from the left border to `edge` in pixels."""
    edge = size[0] + 9 if edge is None else edge
    corners = [at_pixel(size, *place, 2.0) for place in ((-9, -9), (edge, -9), (edge, size[1] + 9), (-9, size[1] + 9))]
    material = Material(diffuse=0.0, specular=0.0, emissive=emissive)
    return draw(corners, QUAD, size, lights=(), material=material, **options)


def test_srgb_curve_at_its_ends_and_in_between():
    for linear, byte in ((0.0, 0), (1.0, 255), (0.0031308, 10), (0.001, 3), (0.5, 188), (0.18, 118), (7.0, 255)):
        assert (emitting(linear).rgb == byte).all(), f"{linear} should be {byte}"


def test_color_ranges():
    scaled = (1.0, 0.5, 0.25)
    for color_range, expected in (("clamp", (1.0, 1.0, 0.5)), ("local", scaled), ("global", scaled)):
        picture = emitting((2.0, 1.0, 0.5), color_range=color_range)
        assert not deviations(picture.color, (2.0, 1.0, 0.5))
        assert (picture.rgb == emitting(expected).rgb).all(), color_range
    corners = np.array([layer((4, 4), 2.0), layer((4, 4), 2.0)]).reshape(-1, 3)
    corners[1:3, 0] = 0.0  # the first sheet ends in the middle of the picture, and wins where both are
    colors = np.repeat([[4.0, 4.0, 0.0], [2.0, 1.0, 0.5]], 4, axis=0)
    picture = draw(corners, np.concatenate([QUAD, QUAD + 4]), (4, 4), colors=colors, color_range="global")
    assert not differences(picture.rgb[:, :2], (255, 255, 0))
    assert not differences(picture.rgb[:, 2:], tuple(emitting((0.5, 0.25, 0.125)).rgb[0, 0]))
    picture = draw(corners, np.concatenate([QUAD, QUAD + 4]), (4, 4), colors=colors, color_range="local")
    assert not differences(picture.rgb[:, :2], (255, 255, 0))
    assert not differences(picture.rgb[:, 2:], tuple(emitting((1.0, 0.5, 0.25)).rgb[0, 0]))
    assert not differences(emitting((0.5, 0.2, 0.1), color_range="local").rgb, emitting((0.5, 0.2, 0.1)).rgb)


def test_alpha_and_background():
    # the edge at 2.25 px leaves one of the two columns of samples in the third column of pixels, of three two
    clear = emitting(0.8, edge=2.5, samples=4)
    assert clear.alpha.tolist() == [[1, 1, 0.5, 0]] * 4
    assert not deviations(clear.color, [[[0.8] * 3] * 3 + [[0.0] * 3]] * 4)
    over = emitting(0.8, edge=2.5, samples=4, background=(0.2, 0.4, 0.0))
    assert not differences(over.alpha, 1)
    assert not deviations(over.color[0, 2], (0.5, 0.6, 0.4))
    assert not deviations(over.color[0, 3], (0.2, 0.4, 0.0))
    assert not differences(over.face, clear.face) and not differences(over.face[:, 2], -1)
    assert emitting(0.8, edge=2.5, samples=9).alpha[0, 2] == pytest.approx(1 / 3)
    assert emitting(0.8, edge=2.55, samples=9).alpha[0, 2] == pytest.approx(2 / 3)
    assert emitting(0.8, edge=2.8, samples=16).alpha[0].tolist() == [1, 1, 0.75, 0]
    assert emitting(0.8, edge=2.5).alpha.tolist() == [[1, 1, 0, 0]] * 4
    assert emitting(0.8, edge=2.5, samples=16, background="#ffffff").color[0, 3].tolist() == [1, 1, 1]


@pytest.mark.parametrize("samples", [4, 9, 16])
def test_supersampling_averages_a_larger_picture(samples):
    vertices, faces = octasphere(1)
    camera = Camera.perspective((1, 2, 4), fov=40)
    options = {"camera": camera, "lights": None, "material": Material(), "shading": "phong"}
    per_axis = round(samples**0.5)
    fine = draw(vertices, faces, (20 * per_axis, 15 * per_axis), **options)
    picture, plain = (draw(vertices, faces, (20, 15), samples=n, **options) for n in (samples, 1))
    blocks = (fine.color * fine.alpha[..., None]).reshape(15, per_axis, 20, per_axis, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(picture.color * picture.alpha[..., None], blocks, atol=1e-14)
    for name in ("depth", "face", "normal", "margin"):
        assert not differences(getattr(picture, name), getattr(plain, name))
