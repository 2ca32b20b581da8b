"""The shadow on the ground: the share of an area light that the scene hides, and how it lies under a picture."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import solids
from helpers.pixels import project, skewed

import rasterizer as rz
from rasterizer import ground_shadow
from rasterizer.ground_shadow import GroundShadow

CUBE = rz.Mesh(*solids.cube())
UPS = ("y", "z", "x", "-y", "-z", "-x")


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


def centers(shadow):
    """The centres of the texels, (rows · columns, 3)."""
    ground = shadow._ground
    rows, columns = shadow.opacity.shape
    y, x = np.mgrid[:rows, :columns]
    x, y = (x.ravel() - (columns - 1) / 2)[:, None], (y.ravel() - (rows - 1) / 2)[:, None]
    return ground.center + ground.texel * (x * ground.right + y * ground.front)


@pytest.mark.parametrize("up", UPS)
def test_the_opacity_is_the_share_of_the_light_that_rays_do_not_reach(up):
    for seed in range(3):
        mesh = soup(seed)
        scene = rz.Scene(mesh, up=up)
        shadow = GroundShadow(scene, strength=1.0, size=48, points=7)
        ground = shadow._ground
        points = centers(shadow)
        hidden = np.zeros(len(points))
        for x, y in ground_shadow._light_points(ground, 7):
            eye = ground.center + x * ground.right + y * ground.front
            eye = eye + ground_shadow.HEIGHT * ground.radius * ground.up
            hidden += ~lit_by_rays(mesh.vertices, mesh.faces, points, eye)
        difference = np.abs(hidden / 7 - shadow.opacity.ravel())
        # Vertices are rounded to 1/256 of a texel: a texel next to an edge may count otherwise, for one point or two.
        assert difference.max() <= 2 / 7 + 1e-6 and np.count_nonzero(difference > 1e-6) < 0.01 * len(points)
        assert hidden.max() > 0


@pytest.mark.parametrize("up", UPS)
def test_nothing_is_dark_at_the_rim(up):
    for seed in range(4):
        opacity = GroundShadow(rz.Scene(soup(seed), up=up), size=64, points=40).opacity
        assert not np.concatenate([opacity[0], opacity[-1], opacity[:, 0], opacity[:, -1]]).any()


@pytest.mark.parametrize("lens", ["perspective", "orthographic", "skew"])
@pytest.mark.parametrize("up", UPS)
def test_a_pixel_shows_the_ground_that_its_ray_meets(up, lens):
    scene = rz.Scene(soup(1), up=up)
    shadow = GroundShadow(scene, size=64, points=20)
    for azimuth, elevation in ((20, 30), (-100, 70), (200, 90)):
        camera = rz.Camera.framing(scene, azimuth, elevation, up=up, orthographic=lens == "orthographic")
        camera = skewed(camera, (80, 60), 0.4) if lens == "skew" else camera
        opacity = shadow.opacity_at(camera, (80, 60))
        x, y = project(camera, centers(shadow), (80, 60))[0].T
        column, row = np.floor(x).astype(int), np.floor(y).astype(int)
        inside = (column > 0) & (column < 79) & (row > 0) & (row < 59)
        near = (
            opacity[np.clip(row, 1, 58) + dy, np.clip(column, 1, 78) + dx] for dx in (-1, 0, 1) for dy in (-1, 0, 1)
        )
        near = np.stack(list(near))
        dark = shadow.opacity.ravel()
        assert inside.sum() > 100
        # What the ground has there lies between what the pixels round it show, but for the change from texel to texel.
        step = max(np.abs(np.diff(shadow.opacity, axis=0)).max(), np.abs(np.diff(shadow.opacity, axis=1)).max())
        assert (dark[inside] <= near.max(axis=0)[inside] + 2 * step).all()
        assert (dark[inside] >= near.min(axis=0)[inside] - 2 * step).all()


def test_the_ground_is_not_seen_from_below_or_beyond_the_horizon():
    scene = rz.Scene(CUBE)
    shadow = GroundShadow(scene, size=32, points=8)
    for orthographic in (False, True):
        below = rz.Camera.framing(scene, 10, -20, orthographic=orthographic)
        assert not shadow.opacity_at(below, (32, 24)).any()
    level = rz.Camera.perspective((0, 0.5, 9), (0, 0.5, 0))
    assert not shadow.opacity_at(level, (32, 24))[:12].any()


@pytest.mark.parametrize("background", [None, "white", (0.2, 0.4, 0.9)])
def test_the_shadow_lies_under_the_picture(background):
    scene = rz.Scene(CUBE, background=None)
    camera = rz.Camera.framing(scene, 30, 40, margin=0.25)
    frame = rz.render(replace(scene, camera=camera), (96, 72), samples=4, outputs=("color", "rgb", "depth"))
    shadow = GroundShadow(scene, size=64, points=16)
    below = shadow.under(frame, camera, background)
    opacity = shadow.opacity_at(camera, (96, 72))[..., None]
    alpha, color = frame.alpha[..., None], frame.color * frame.alpha[..., None]  # premultiplied
    dark = (1 - alpha) * opacity
    if background is None:
        expected_alpha = alpha + dark
        expected = color / np.maximum(expected_alpha, 1e-9)
    else:
        behind = rz.Scene(CUBE, background=background).background
        expected_alpha, expected = np.ones_like(alpha), color + (1 - alpha - dark) * np.array(behind)
    got = below.rgba / 255
    assert np.abs(got[..., 3:] - expected_alpha).max() <= 1.0 / 255 + 1e-6  # rounded once in the frame, once here
    expected = np.where(expected <= 0.0031308, 12.92 * expected, 1.055 * expected ** (1 / 2.4) - 0.055)
    visible = expected_alpha[..., 0] > 0.1  # elsewhere a level of the frame's own rounding is many of the result's
    assert np.abs(got[..., :3] - expected)[visible].max() <= 2.1 / 255
    assert (frame.alpha == 1).any() and np.array_equal(below.rgba[frame.alpha == 1], frame.rgba[frame.alpha == 1])
    assert below.stats is frame.stats and np.array_equal(below.depth, frame.depth)
    assert (opacity > 0.1).any()


def test_more_strength_is_darker_and_glass_lets_light_through():
    dark = GroundShadow(rz.Scene(CUBE), size=32, points=8, strength=1.0).opacity
    half = GroundShadow(rz.Scene(CUBE), size=32, points=8, strength=0.5).opacity
    assert np.allclose(half, dark / 2) and dark.max() == 1.0
    glass = rz.Mesh(*solids.cube(), material=rz.Material(opacity=0.25))
    clear = GroundShadow(rz.Scene(glass), size=32, points=8, strength=1.0).opacity
    # Two of the cube's sides lie one behind the other: 1 - 0.75² of the light does not arrive.
    assert clear.max() == pytest.approx(1 - 0.75**2, abs=1 / 255)


@pytest.mark.parametrize("scale", [1e-30, 1e-9, 1.0, 1e9, 1e30])
def test_units_do_not_matter(scale):
    one = GroundShadow(rz.Scene(soup(3)), size=48, points=9).opacity
    mesh = soup(3)
    other = GroundShadow(rz.Scene(replace(mesh, vertices=mesh.vertices * scale)), size=48, points=9).opacity
    assert other.shape == one.shape and np.count_nonzero(one != other) < 0.01 * one.size


def test_what_has_no_height_or_no_size_is_legal():
    flat = rz.Mesh([[0, 0, 0], [1, 0, 0], [0, 0, 1]], [[0, 1, 2]])
    shadow = GroundShadow(rz.Scene(flat), size=32, points=4)
    assert np.isfinite(shadow.opacity).all()
    point = rz.Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1]]) * 1e-4 + 1e9, [[0, 1, 2]])
    shadow = GroundShadow(rz.Scene(point), size=32, points=4)
    camera = rz.Camera.perspective((9, 9, 9))
    assert not shadow.opacity.any() and not shadow.opacity_at(camera, (8, 8)).any()
    assert shadow.outline().shape == (0, 3)


def test_the_outline_holds_what_is_dark():
    shadow = GroundShadow(rz.Scene(soup(5)), size=64, points=16)
    at, dark = centers(shadow), shadow.opacity.ravel()
    outline = shadow.outline(0.5)
    low, high = outline.min(axis=0) - 1e-9, outline.max(axis=0) + 1e-9
    inside = dark > 0.5 * dark.max()
    assert (at[inside] >= low).all() and (at[inside] <= high).all() and len(outline) > 4
    assert np.abs(outline[:, 1] - shadow._ground.center[1]).max() == 0


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"strength": 1.5}, "strength must be within 0..1; given 1.5"),
        ({"strength": math.nan}, "strength"),
        ({"size": 8}, "size must be a whole number within 16..4096; given 8"),
        ({"size": 20.5}, "size must be a whole number"),
        ({"points": 0}, "points must be a whole number within 1..1024; given 0"),
    ],
)
def test_what_is_not_legal_is_told(settings, message):
    with pytest.raises(rz.SceneError, match=message):
        GroundShadow(rz.Scene(CUBE), **settings)


def test_the_same_bytes_on_any_number_of_threads():
    """Also of the sum over glass, whose masks are shares; and where there are fewer points than threads."""
    glass = rz.Scene(replace(soup(8), material=rz.Material(opacity=0.3)))
    for scene in (rz.Scene(soup(7)), glass):
        for points in (1, 12):
            first = GroundShadow(scene, size=64, points=points, threads=1).opacity
            assert 0.0 < first.max() <= np.float32(0.6)
            for threads in (2, 3, 7):
                assert np.array_equal(first, GroundShadow(scene, size=64, points=points, threads=threads).opacity)


def test_large_scenes_are_prepared_once(monkeypatch):
    """By one renderer with all threads: the same bytes."""
    scene = rz.Scene(soup(7))
    first = GroundShadow(scene, size=64, points=12, threads=2).opacity
    monkeypatch.setattr(ground_shadow, "MOST_SHARED", scene.n_face - 1)
    assert np.array_equal(first, GroundShadow(scene, size=64, points=12, threads=2).opacity)
