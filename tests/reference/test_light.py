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
    at_pixel,
    draw,
    eye_camera,
    layer,
    octasphere,
    sample_rays,
    sheet_camera,
    unit,
)

from rasterizer.scene.camera import Camera
from rasterizer.scene.lights import AmbientLight, DirectionalLight, PointLight
from rasterizer.scene.material import Material

# ── light ───────────────────────────────────────────────────────────────────────────────────────────────


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


def emitting(emissive, **options):
    """Render a sheet that shines by itself and fills the picture."""
    size = (4, 4)
    corners = [at_pixel(size, *place, 2.0) for place in ((-9, -9), (13, -9), (13, 13), (-9, 13))]
    material = Material(diffuse=0.0, specular=0.0, emissive=emissive)
    return draw(corners, QUAD, size, lights=(), material=material, **options)


def test_color_ranges():
    scaled = (1.0, 0.5, 0.25)
    for color_range, expected in (("clamp", (1.0, 1.0, 0.5)), ("local", scaled), ("global", scaled)):
        picture = emitting((2.0, 1.0, 0.5), color_range=color_range)
        assert not deviations(picture.color, (2.0, 1.0, 0.5))
        assert (picture.rgb == emitting(expected).rgb).all(), color_range
    corners = np.array([layer((4, 4), 2.0), layer((4, 4), 2.0)]).reshape(-1, 3)
    corners[1:3, 0] = 0.0  # the first sheet ends in the middle of the picture, and wins where both are
    bright = [AmbientLight(4.0)]
    colors = np.repeat([[1.0, 1.0, 0.0], [0.5, 0.25, 0.125]], 4, axis=0)
    picture = draw(
        corners, np.concatenate([QUAD, QUAD + 4]), (4, 4), lights=bright, colors=colors, color_range="global"
    )
    assert not differences(picture.rgb[:, :2], (255, 255, 0))
    assert not differences(picture.rgb[:, 2:], tuple(emitting((0.5, 0.25, 0.125)).rgb[0, 0]))
    picture = draw(corners, np.concatenate([QUAD, QUAD + 4]), (4, 4), lights=bright, colors=colors, color_range="local")
    assert not differences(picture.rgb[:, :2], (255, 255, 0))
    assert not differences(picture.rgb[:, 2:], tuple(emitting((1.0, 0.5, 0.25)).rgb[0, 0]))
    assert not differences(emitting((0.5, 0.2, 0.1), color_range="local").rgb, emitting((0.5, 0.2, 0.1)).rgb)
