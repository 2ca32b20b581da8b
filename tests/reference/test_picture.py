"""Check what the reference draws where, against what does not depend on it.

Pixels by hand, edge functions in fractions, tilings and closed meshes, rays that meet planes.
"""

from fractions import Fraction

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.pinhole import (
    QUAD,
    SIZE,
    WHITE,
    at_pixel,
    draw,
    eye_camera,
    layer,
    sample_rays,
    sheet_camera,
    tilted,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer.errors import SceneError
from rasterizer.reference import coverage, render
from rasterizer.scene.camera import Camera
from rasterizer.scene.material import Material
from rasterizer.scene.mesh import Mesh
from rasterizer.scene.scene import Scene

HALF_STEP = 0.5 / 256  # px that rounding to the sub-pixel grid may move a vertex, in x and in y


# ── coverage ────────────────────────────────────────────────────────────────────────────────────────────


def covers(triangle, x, y):
    """Tell in fractions whether a triangle covers a sample.

    A sample moved to the right by next to nothing, and down by next to nothing of that, lies on no edge any
    more. It is strictly inside exactly where the top-left rule gives the unmoved one to the triangle.
    """
    reach = max(abs(c) for vertex in (*triangle, (x, y)) for c in vertex)
    tiny = Fraction(1, 16 * reach + 16)
    x, y = x + tiny, y + tiny * tiny
    signs = set()
    for k in range(3):
        (ax, ay), (bx, by) = triangle[k], triangle[(k + 1) % 3]
        turn = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
        signs.add(turn > 0)
        if turn == 0:
            return False
    return len(signs) == 1


def check_coverage(triangle):
    area = np.linalg.det([[float(x), float(y), 1] for x, y in triangle])
    expected = [[covers(triangle, 256 * i + 128, 256 * j + 128) for i in range(6)] for j in range(5)]
    assert coverage(triangle, 6, 5).tolist() == expected, f"{triangle}, doubled area {area:.3g}"


near_ints = st.integers(-300, 1800)
half_pixels = st.integers(-3, 13).map(lambda k: 128 * k)
far_ints = st.integers(-(2**28), 2**28)
coordinates = st.one_of(near_ints, half_pixels, half_pixels, far_ints)


@settings(max_examples=60, deadline=None)
@given(st.tuples(*[st.tuples(coordinates, coordinates)] * 3))
def test_coverage_is_that_of_fractions(triangle):
    check_coverage(triangle)


@pytest.mark.parametrize("snap", [1, 128])
def test_tiling_covers_every_sample_once(snap):
    rng = np.random.default_rng(snap)
    n = 9  # a grid of quads that reaches beyond the 24 x 24 px picture, its inner vertices shaken
    x, y = np.meshgrid(np.linspace(-512, 7168, n), np.linspace(-512, 7168, n))
    grid = np.stack([x, y], axis=-1) + rng.uniform(-250, 250, (n, n, 2))
    grid = (grid / snap).round().astype(int) * snap
    count = np.zeros((24, 24), int)
    for i in range(n - 1):
        for j in range(n - 1):
            a, b, c, d = grid[i, j], grid[i, j + 1], grid[i + 1, j + 1], grid[i + 1, j]
            for triangle in ((a, b, c), (a, d, c)) if rng.random() < 0.5 else ((a, b, d), (d, c, b)):
                count += coverage(np.array(triangle), 24, 24)
    assert not differences(count, 1)


# ── depth and visibility ────────────────────────────────────────────────────────────────────────────────


def test_depth_of_a_tilted_plane_in_perspective():
    points, normal, offset = tilted(True)
    picture = draw(points, [[0, 1, 2]], SIZE)
    is_hit = picture.face == 0
    depth = offset / (sample_rays(SIZE) @ normal)  # the ray t * direction meets n.p = d at t = d / n.direction
    assert is_hit.sum() > 300
    np.testing.assert_allclose(picture.depth[is_hit], depth[is_hit], rtol=1e-12)
    assert not differences(picture.depth[~is_hit], np.inf)


def test_colors_are_interpolated_perspective_correctly():
    points, normal, offset = tilted(True)
    colors = np.array([[0.9, 0.1, 0.2], [0.0, 0.8, 0.3], [0.4, 0.5, 1.0]])
    picture = draw(points, [[0, 1, 2]], SIZE, colors=colors)
    rays = sample_rays(SIZE)[picture.face == 0]
    p_world = rays * (offset / (rays @ normal))[:, None]
    weights = np.linalg.solve(points.T, p_world.T).T  # on the three vertices
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(picture.color[picture.face == 0], weights @ colors, atol=1e-12)
    phong = draw(points, [[0, 1, 2]], SIZE, colors=colors, shading="phong")
    np.testing.assert_allclose(phong.color, picture.color, atol=1e-12)


def test_one_orthographic_pixel_by_hand():
    # vertices on (0,0), (4,0), (0,4) px: the sample (1.5, 0.5) has weights 1/2, 3/8, 1/8
    points = [at_pixel((4, 4), x, y, 1.0, is_perspective=False) for x, y in ((0, 0), (4, 0), (0, 4))]
    picture = draw(points, [[0, 2, 1]], (4, 4), camera=sheet_camera(4), colors=np.eye(3))
    assert picture.color[0, 1].tolist() == [0.5, 0.375, 0.125]
    assert picture.depth[0, 1] == 1.0
    assert picture.normal[0, 1].tolist() == [0, 0, 1]
    assert picture.face.tolist() == [[0, 0, 0, -1], [0, 0, -1, -1], [0, -1, -1, -1], [-1, -1, -1, -1]]
    # sRGB of 1/2, 3/8, 1/8 from the published curve: 187.5, 164.5 and 99.1 of 255
    assert picture.rgb[0, 1].tolist() == [188, 165, 99]


@pytest.mark.parametrize("is_perspective", [True, False])
def test_the_nearest_wins_and_the_margin_tells_by_how_much(is_perspective):
    camera = None if is_perspective else sheet_camera(8)
    sheets = np.array([layer((8, 8), depth, is_perspective) for depth in (3.0, 2.0, 5.0)]).reshape(-1, 3)
    picture = draw(sheets, np.concatenate([QUAD, QUAD + 4, QUAD + 8]), (8, 8), camera=camera)
    assert set(np.unique(picture.face)) == {2, 3}
    np.testing.assert_allclose(picture.depth, 2.0, rtol=1e-14)
    np.testing.assert_allclose(picture.margin, 1.0, rtol=1e-14)
    alone = draw(sheets[4:8], QUAD, (8, 8), camera=camera)
    assert not differences(alone.margin, np.inf)


def test_equal_depth_goes_to_the_lower_face():
    points = [at_pixel((8, 8), *place, 2.0) for place in ((-1, -1), (9, -1), (9, 9), (-1, 9))]
    for split in (QUAD, QUAD[::-1], QUAD[:, ::-1]):
        twice = np.concatenate([split, np.roll(split, 1, axis=1), split[:, ::-1]])
        picture = draw(points, twice, (8, 8))
        alone = draw(points, split, (8, 8))
        assert not differences(picture.face, alone.face)
        assert picture.margin.max() < 1e-14


def test_of_equally_deep_layers_the_lower_face_is_nearer():
    red, green = np.eye(3)[:2]
    for first, second, expected in (
        ((red, 0.5), (green, 0.5), (2 / 3, 1 / 3, 0)),
        ((green, 0.5), (red, 0.5), (1 / 3, 2 / 3, 0)),
        ((green, 1.0), (red, 0.5), (0, 1, 0)),
        ((red, 0.5), (green, 1.0), (0.5, 0.5, 0)),
    ):
        panes = [
            Mesh(layer((8, 8), 2.0), QUAD, material=Material(ambient=color, diffuse=0, specular=0, opacity=opacity))
            for color, opacity in (first, second)
        ]
        picture = render(Scene(panes, lights=WHITE, camera=eye_camera()), (8, 8), shading="gouraud")
        np.testing.assert_allclose(picture.color, np.broadcast_to(expected, (8, 8, 3)), atol=1e-14)
        assert picture.face.max() < 2 and not differences(picture.margin, 0)


def test_faces_that_cross_meet_on_the_line_of_equal_depth():
    size = (64, 8)
    left_near = [at_pixel(size, -9, y, 1.0) for y in (-9, 17)] + [at_pixel(size, 73, y, 4.0) for y in (17, -9)]
    right_near = [at_pixel(size, -9, y, 4.0) for y in (-9, 17)] + [at_pixel(size, 73, y, 1.0) for y in (17, -9)]
    quad = np.array([[0, 1, 2], [0, 2, 3]])
    picture = draw(left_near + right_near, np.concatenate([quad, quad + 4]), size)
    assert picture.face[:, :32].max() < 2 and picture.face[:, 32:].min() >= 2


# ── clipping ────────────────────────────────────────────────────────────────────────────────────────────


def test_clipped_colors_are_those_of_the_whole_triangle():
    triangle = np.array([(-4.3, -1, 3.1), (4.1, -1, 2.7), (0.4, -1, -9.3)])
    colors = 0.5 + triangle[:, [0, 2, 2]] / 20  # an affine function of the place
    picture = draw(triangle, [[0, 1, 2]], (80, 60), near=0.5, colors=colors)
    is_hit = picture.face == 0
    p_world = sample_rays((80, 60))[is_hit] * picture.depth[is_hit][:, None]
    # half a sub-pixel at depth t is HALF_STEP t / 30 across the floor and t times that along it
    budget = (picture.depth[is_hit] ** 2).max() / 30 * HALF_STEP * 2 / 20
    assert np.abs(picture.color[is_hit] - (0.5 + p_world[:, [0, 2, 2]] / 20)).max() <= budget


def test_far_plane_cuts_only_when_given():
    triangle = [(-40, -1, -1.0), (40, -1, -1.0), (0, -1, -90.0)]
    whole = draw(triangle, [[0, 1, 2]], (80, 60))
    cut = draw(triangle, [[0, 1, 2]], (80, 60), far=5.0)
    assert whole.depth[whole.face == 0].max() > 20
    is_kept = (whole.face == 0) & (whole.depth < 5)
    assert (cut.face == np.where(is_kept, 0, -1)).mean() > 0.999
    assert cut.depth[cut.face == 0].max() <= 5.001
    by_camera = draw(triangle, [[0, 1, 2]], (80, 60), camera=eye_camera(near=0.5, far=5.0))
    assert not differences(by_camera.face, cut.face)


def test_cameras_so_far_away_that_coordinates_overflow_are_refused():
    with pytest.raises(SceneError, match="within ±1e.100 scene units"):
        Camera.perspective((1.7e308, 1.7e308, 1.7e308), (1e300, 0, 0))


# ── options ─────────────────────────────────────────────────────────────────────────────────────────────


def test_illegal_options_are_refused():
    for option in (
        {"shading": "toon"}, {"samples": 2}, {"cull": "front"}, {"color_range": "tone"}, {"size": (0, 4)},
        {"near": 0.0}, {"near": 3.0, "far": 2.0},
    ):  # fmt: skip
        with pytest.raises(SceneError):
            draw(layer((4, 4), 2.0), QUAD, **({"size": (4, 4)} | option))
