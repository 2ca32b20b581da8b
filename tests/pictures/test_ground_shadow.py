"""The shadow on the ground: the share of an area light that the scene hides, and how it lies under a picture."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import solids
from helpers.arrays import deviations, differences
from helpers.pixels import AXIS, skewed

import rasterizer as rz
from rasterizer import reference
from rasterizer.cores import Workers
from rasterizer.engine import ground_shadow
from rasterizer.engine.ground_shadow import GroundShadow

CUBE = rz.Mesh(*solids.cube())
SIZE = (40, 30)


def lit_by_rays(vertices, faces, points, eye):
    """Tell which points see the eye past all triangles, by Möller & Trumbore's test, (n,) bool."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    ray = eye - points
    p = np.cross(ray[:, None], c - a)
    det = (p * (b - a)).sum(axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = points[:, None] - a
        u = (s * p).sum(axis=2) / det
        q = np.cross(s, b - a)
        v = (ray[:, None] * q).sum(axis=2) / det
        t = ((c - a) * q).sum(axis=2) / det
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 1)
    return ~hit.any(axis=1)


def soup(seed, n=12):
    rng = np.random.default_rng(seed)
    vertices = rng.uniform(-1, 1, (3 * n, 3)) * rng.uniform(0.2, 3.0, 3)
    return rz.Mesh(vertices, np.arange(3 * n).reshape(-1, 3))


def lamp_over(scene, n):
    """The ground's height along `up`, and n points (n, 3) of the round light over the middle of the scene's box, spread
    as in a sunflower (Vogel 1979)."""
    up = np.array(AXIS[scene.up], float)
    low, high = scene.bounds
    radius, level = np.linalg.norm(high - low) / 2, min(low @ up, high @ up)
    middle = (low + high) / 2
    center = middle + (level - middle @ up + ground_shadow.HEIGHT * radius) * up
    right, front = rz.Camera.framing(scene, 0, 90, up=scene.up, orthographic=True).view()[1:3]
    k = np.arange(n)
    away = ground_shadow.SPREAD * ground_shadow.HEIGHT * radius * np.sqrt((k + 0.5) / n)
    turn = k * math.pi * (3 - math.sqrt(5))
    return level, center + (away * np.cos(turn))[:, None] * right - (away * np.sin(turn))[:, None] * front


def ground_at(camera, level, up):
    """Where the rays through the pixels' centres meet the ground (h, w, 3); NaN where they don't."""
    (eye, right, above, forward), projection = camera.view(), camera.projection(SIZE)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    b = (projection.center_y - y) / projection.scale_y
    a = (x - projection.center_x + projection.skew * b) / projection.scale_x
    aside = a[..., None] * right + b[..., None] * above
    start, way = (
        (eye, aside + forward) if projection.is_perspective else (eye + aside, np.broadcast_to(forward, aside.shape))
    )
    with np.errstate(divide="ignore"):
        far = (level - start @ up) / (way @ up)
    return np.where(far[..., None] > 0, start + far[..., None] * way, np.nan)


def opacity_at(shadow, camera, size):
    """The opacity of the ground in a picture of nothing, and what it is multiplied by towards the border, (h, w)."""
    shape, workers = size[::-1], Workers(1)
    alpha = np.zeros(shape, np.float32)
    blank = np.zeros((*shape, 4), np.uint8), np.zeros((*shape, 3), np.float32), alpha
    shadow.lay_under(camera, *blank, None, workers)
    across, along = ground_shadow.faded(size)
    return alpha, along[:, None] * across


def test_each_pixel_has_the_share_of_the_light_that_rays_do_not_reach():
    """Also far from the scene, where nothing is dark. Texels and the change between them may move an edge."""
    n = 48  # each as exact as half a texel: enough for these to cancel
    for seed, (up, lens) in enumerate(zip(AXIS, ("perspective", "orthographic", "skew") * 2, strict=True)):
        scene = rz.Scene(soup(seed), up=up)
        shadow, axis = GroundShadow(scene, strength=1.0, size=160, points=n), np.array(AXIS[up], float)
        level, points = lamp_over(scene, n)
        for azimuth, elevation in ((20, 30), (-100, 80)):
            camera = rz.Camera.framing(
                scene, azimuth, elevation, up=up, orthographic=lens == "orthographic", margin=0.2
            )
            camera = skewed(camera, SIZE, 0.4) if lens == "skew" else camera
            places, (found, faded) = ground_at(camera, level, axis), opacity_at(shadow, camera, SIZE)
            is_ground = np.isfinite(places).all(axis=-1)
            at = places[is_ground]
            hidden = np.mean([~lit_by_rays(*mesh_of(scene), at, eye) for eye in points], axis=0)
            off = np.abs(hidden * faded[is_ground] - found[is_ground])
            assert (hidden > 0.3).sum() > 20 and not differences(found[~is_ground], 0)
            assert off.mean() < 0.012 and (off > 0.25).mean() < 0.01, f"{up}, {lens}: {off.mean():.3g} on the mean"


def mesh_of(scene):
    return scene.meshes[0].vertices, scene.meshes[0].faces


def box(low, high):
    vertices, faces = solids.cube()
    unit = (np.array(vertices, float) - np.min(vertices, axis=0)) / np.ptp(vertices, axis=0)
    return rz.Mesh(low + unit * np.subtract(high, low), faces)


def drawn_masks(scene, ground, n):
    """Draw what each of n points of the light sees, and return which share of the light each texel doesn't get."""
    (rows, columns), height = ground.shape, ground_shadow.HEIGHT * ground.radius
    _, points = lamp_over(scene, n)
    casters = replace(scene, lights=(rz.AmbientLight(1.0),), camera=None, background=None, depth_cue=None)
    covered, focal = np.zeros(ground.shape, np.uint32), height / ground.texel
    options = {"shading": "flat", "samples": 1, "outputs": ("rgb",)}
    with rz.Renderer(casters, (columns, rows), **options) as renderer:
        for eye in points:
            x, y = (eye - ground.center) @ ground.right, (eye - ground.center) @ ground.front
            # Straight below the eye is the pixel that this texel is; OpenCV counts from the centre of the first one.
            below = columns / 2 - 0.5 + x / ground.texel, rows / 2 - 0.5 + y / ground.texel
            camera = rz.Camera(
                position=eye, target=eye - ground.radius * ground.up, up=-ground.front,
                intrinsics=(focal, focal, *below), size=(columns, rows),
            )  # fmt: skip
            covered += renderer.render(camera).rgba[..., 3]
    return covered.astype(np.float32) / np.float32(255 * n)


def test_nothing_is_dark_at_the_rim():
    for seed, up in enumerate(AXIS):
        opacity = GroundShadow(rz.Scene(soup(seed), up=up), size=64, points=40).opacity
        assert not differences(np.concatenate([opacity[0], opacity[-1], opacity[:, 0], opacity[:, -1]]), 0)


def test_the_ground_is_not_seen_from_below_or_beyond_the_horizon():
    scene = rz.Scene(CUBE)
    shadow = GroundShadow(scene, size=32, points=8)
    for orthographic in (False, True):
        below = rz.Camera.framing(scene, 10, -20, orthographic=orthographic)
        assert not differences(opacity_at(shadow, below, (32, 24))[0], 0)
    level = rz.Camera.perspective((0, 0.5, 9), (0, 0.5, 0))
    assert not differences(opacity_at(shadow, level, (32, 24))[0][:12], 0)


@pytest.mark.parametrize("background", [None, "white", (0.2, 0.4, 0.9)])
def test_the_shadow_lies_under_the_picture(background):
    scene = rz.Scene(CUBE, background=None)
    camera = rz.Camera.framing(scene, 30, 40, margin=0.25)
    frame = rz.render(replace(scene, camera=camera), (96, 72), samples=4, outputs=("color", "rgb", "depth"))
    shadow = GroundShadow(scene, size=64, points=16)
    behind = rz.Scene(CUBE, background=background).background
    below = frame.rgba.copy(), frame.color.copy(), frame.alpha.copy()
    shadow.lay_under(camera, *below, behind, Workers(2))
    opacity = opacity_at(shadow, camera, (96, 72))[0][..., None]
    alpha, color = frame.alpha[..., None], frame.color * frame.alpha[..., None]  # premultiplied
    dark = (1 - alpha) * opacity
    if background is None:
        expected_alpha = alpha + dark
        expected = color / np.maximum(expected_alpha, 1e-9)
    else:
        expected_alpha, expected = np.ones_like(alpha), color + (1 - alpha - dark) * np.array(behind)
    assert not deviations(below[2], expected_alpha[..., 0], 1e-6)
    is_seen = expected_alpha[..., 0] > 0
    assert not deviations(below[1][is_seen], expected[is_seen], 1e-5)
    got = below[0] / 255
    assert np.abs(got[..., 3:] - expected_alpha).max() <= 1.0 / 255 + 1e-6  # rounded once in the frame, once here
    expected = np.where(expected <= 0.0031308, 12.92 * expected, 1.055 * expected ** (1 / 2.4) - 0.055)
    visible = expected_alpha[..., 0] > 0.1  # elsewhere a level of the frame's own rounding is many of the result's
    assert np.abs(got[..., :3] - expected)[visible].max() <= 2.1 / 255
    assert (frame.alpha == 1).any() and not differences(below[0][frame.alpha == 1], frame.rgba[frame.alpha == 1])
    assert (opacity > 0.1).any()


def test_glass_beside_and_over_what_is_opaque_is_as_dark_as_it_is_drawn():
    """But in half-shadows, where opacities are combined as if each hid points of the light at random."""
    glass, sphere = rz.Material(opacity=0.5), rz.Mesh(*solids.sphere(12))
    leaf = rz.Texture(np.full((2, 2, 4), (1.0, 1.0, 1.0, 0.5)))
    pane = rz.Mesh([(2, 1, 0), (3, 1, 0), (3, 1, 1), (2, 1, 1)], [(0, 1, 2, 3)], uv=[(0, 0), (1, 0), (1, 1), (0, 1)])
    for meshes in (
        [replace(sphere, material=glass), box((-2, 0.0, -0.2), (0.3, 0.2, 0.3))],
        [replace(pane, material=glass), box((2.5, 0.1, 0.2), (3.5, 0.4, 0.8))],
        [replace(pane, material=rz.Material(texture=leaf)), replace(sphere, material=rz.Material(opacity=0.25))],
    ):
        scene = rz.Scene(meshes)
        shadow = GroundShadow(scene, size=128, strength=1.0)
        exact = drawn_masks(scene, shadow.ground, 256)
        off = np.abs(shadow.opacity - exact)
        assert exact.max() > 0.3 and off.mean() <= 0.005 and off.max() <= 0.15, f"{off.mean():.3g}, {off.max():.3g}"


def test_what_has_no_height_or_no_size_is_legal():
    flat = rz.Mesh([[0, 0, 0], [1, 0, 0], [0, 0, 1]], [[0, 1, 2]])
    shadow = GroundShadow(rz.Scene(flat), size=32, points=4)
    assert not differences(np.isfinite(shadow.opacity), True)
    point = rz.Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1]]) * 1e-4 + 1e9, [[0, 1, 2]])
    shadow = GroundShadow(rz.Scene(point), size=32, points=4)
    camera = rz.Camera.perspective((9, 9, 9))
    assert not differences(shadow.opacity, 0) and not differences(opacity_at(shadow, camera, (8, 8))[0], 0)
    assert shadow.outline().shape == (0, 3)


def test_ground_lays_the_shadow_under_the_picture_alone():
    """Colours and alpha hold it, buffers don't; the studio's lights become the tabletop's, other lights stay."""
    scene, outputs = rz.Scene(CUBE), ("color", "rgb", "depth", "mask")
    with rz.Renderer(scene, SIZE, ground=True, outputs=outputs) as renderer:
        frame, seen = renderer.render(), renderer.subject
        turned = renderer.render(azimuth=80)
    assert not differences(rz.render(CUBE, SIZE, ground=True).rgba, frame.rgba)
    for azimuth, found in ((35, frame), (80, turned)):
        camera = rz.Camera.framing(seen, azimuth, aspect=SIZE[0] / SIZE[1])
        lit = replace(scene, lights=rz.tabletop(), camera=camera)
        bare = rz.render(lit, SIZE, outputs=outputs)
        rgba, color, alpha = bare.rgba.copy(), bare.color.copy(), bare.alpha.copy()
        GroundShadow(scene).lay_under(camera, rgba, color, alpha, None, Workers(1))
        expected = {"rgba": rgba, "color": color, "alpha": alpha, "depth": bare.depth, "mask": bare.mask}
        for name, values in expected.items():
            assert not differences(getattr(found, name), values), name
        assert (found.alpha > bare.alpha).any() and found.stats.coverage == bare.stats.coverage


def test_the_ground_comes_before_the_background_and_leaves_other_lights():
    opaque = rz.render(CUBE, SIZE, ground=True, background="white")
    assert not differences(opaque.rgba[..., 3], 255) and not differences(opaque.rgba[0], 255)
    below = rz.render(CUBE, SIZE, ground=True)
    shadow = (below.rgba[..., :3] == 0).all(axis=2) & (below.alpha > 0.2)
    assert shadow.any() and (opaque.rgba[shadow][:, :3] < 240).all()
    lamp = (rz.PointLight((3, 4, 5)),)
    with rz.Renderer(rz.Scene(CUBE, lamp), SIZE, ground=True) as renderer:
        assert renderer.scene.lights == lamp
    for shading, casts in (("flat", False), ("gouraud", False), ("phong", True)):
        with rz.Renderer(CUBE, SIZE, ground=True, shading=shading) as renderer:
            lights = renderer.scene.lights
        assert any(getattr(light, "shadow", None) for light in lights) == casts and len(lights) == 4, shading
    with pytest.raises(rz.SceneError, match="ground must be True or False; given 3"):
        rz.render(CUBE, SIZE, ground=3)


@pytest.mark.parametrize("color_range", ["clamp", "global", "local"])
def test_the_background_has_the_same_bytes_with_a_ground_as_without(color_range):
    look = {"background": (0.9, 0.5, 0.05), "exposure": 2, "color_range": color_range}
    for outputs in ("rgb", ("color", "rgb")):
        with rz.Renderer(CUBE, SIZE, ground=True, outputs=outputs, **look) as renderer:
            frame, lights = renderer.render(), renderer.scene.lights
        scene = rz.Scene(CUBE, lights, frame.camera)
        bare = rz.render(scene, SIZE, outputs=("color", "rgb"), **look)
        assert not differences(frame.rgba[0], bare.rgba[0]), "at the border no shadow is left"
        inside = bare.rgba != bare.rgba[0, 0]
        assert (frame.rgba[inside] == bare.rgba[inside]).mean() > 0.9, "the cube, but for its outline"
        assert outputs == "rgb" or not differences(frame.color[0], bare.color[0])
    judged = reference.render(replace(scene, background=look.pop("background")), SIZE, shading="phong", **look)
    assert np.abs(frame.rgb[0].astype(int) - judged.rgb[0]).max() <= 1


def test_cut_outs_are_there_or_not():
    """A card with a hole in its middle casts the shadow of the frame that is left."""
    card = np.array([[-1, 1, -1], [-1, 1, 1], [1, 1, 1], [1, 1, -1]], float)
    image = np.full((16, 16, 4), 255, np.uint8)
    image[4:12, 4:12, 3] = 0
    cut_out = rz.Material(texture=image, alpha_cutoff=0.5)
    stand = rz.Mesh([(0, 0, 0), (0, 0.01, 0), (0.01, 0, 0)], [[0, 1, 2]])
    inner = 0.5 * card + (0, 0.5, 0)
    ring = [[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    for uv, wrap in (((0, 0), "clamp"), ((3, -2), "repeat"), ((2, 4), "mirror")):
        corners = np.array([(0, 0), (0, 1), (1, 1), (1, 0)]) + uv
        material = replace(cut_out, texture=rz.Texture(image, wrap=wrap))
        whole = rz.Mesh(card, [[0, 1, 2, 3]], uv=corners, material=material)
        found = GroundShadow(rz.Scene([stand, whole]), size=128, strength=1.0)
        expected = GroundShadow(rz.Scene([stand, rz.Mesh(np.concatenate([card, inner]), ring)]), size=128, strength=1.0)
        assert np.abs(found.opacity - expected.opacity).max() < 0.1, wrap
    assert found.opacity[64, 64] < 0.5 < found.opacity.max()
