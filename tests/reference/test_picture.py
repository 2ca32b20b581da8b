"""Check what the reference draws where, against what does not depend on it.

Pixels by hand, edge functions in fractions, tilings and closed meshes, rays that meet planes.
"""

from fractions import Fraction

import numpy as np
import pytest
from helpers.arrays import deviations, differences
from helpers.pinhole import (
    DULL,
    QUAD,
    SHADINGS,
    SIZE,
    WHITE,
    at_pixel,
    draw,
    eye_camera,
    layer,
    octasphere,
    sample_rays,
    sheet_camera,
    tilted,
    torus,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer.errors import SceneError
from rasterizer.reference import coverage, render
from rasterizer.scene.camera import Camera
from rasterizer.scene.lights import DirectionalLight
from rasterizer.scene.material import Material
from rasterizer.scene.mesh import Mesh
from rasterizer.scene.scene import Scene

HALF_STEP = 0.5 / 256  # px that rounding to the sub-pixel grid may move a vertex, in x and in y


# ── coverage ────────────────────────────────────────────────────────────────────────────────────────────


def test_coverage_by_hand():
    # the long edge of both triangles runs through the samples with i + j = 3: it is the left edge of one only
    i, j = np.meshgrid(np.arange(4), np.arange(4))
    upper_left = coverage([(0, 0), (1024, 0), (0, 1024)], 4, 4)
    lower_right = coverage([(1024, 1024), (0, 1024), (1024, 0)], 4, 4)
    assert not differences(upper_left, i + j < 3)
    assert not differences(lower_right, i + j >= 3)
    # a box from sample (0,0) to sample (2,2): top and left samples belong to it, right and bottom ones don't
    box = [(128, 128), (640, 128), (640, 640), (128, 640)]
    both = coverage([box[0], box[1], box[2]], 4, 4).astype(int) + coverage([box[0], box[2], box[3]], 4, 4)
    assert both.tolist() == [[1, 1, 0, 0], [1, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]


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


@settings(max_examples=40, deadline=None)
@given(st.tuples(half_pixels, half_pixels), st.tuples(far_ints, far_ints), st.integers(-2, 2), st.integers(-2, 2))
def test_coverage_of_slivers(start, end, dx, dy):
    check_coverage((start, end, (min(max(end[0] + dx, -(2**28)), 2**28), min(max(end[1] + dy, -(2**28)), 2**28))))


def test_coverage_does_not_depend_on_the_order_of_vertices():
    rng = np.random.default_rng(1)
    for triangle in rng.integers(-4, 20, (40, 3, 2)) * 128:
        masks = [coverage(triangle[list(order)], 8, 8) for order in ((0, 1, 2), (1, 2, 0), (2, 1, 0), (0, 2, 1))]
        assert [mask for mask in masks if not (mask == masks[0]).all()] == []


def test_no_area_covers_nothing():
    assert not differences(coverage([(0, 0), (1024, 1024), (2048, 2048)], 8, 8), 0)
    assert not differences(coverage([(384, 384)] * 3, 8, 8), 0)
    assert not differences(coverage([(0, 640), (2048, 640), (512, 640)], 8, 8), 0)


def test_coverage_refuses_what_would_overflow():
    with pytest.raises(SceneError, match="268435457"):
        coverage([(0, 0), (2**28 + 1, 0), (0, 5)], 4, 4)


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


def test_fan_round_a_sample_covers_it_once():
    rim = [(round(3000 * np.cos(a)) + 1152, round(3000 * np.sin(a)) + 1152) for a in np.arange(40) * np.pi / 20]
    count = sum(coverage([(1152, 1152), rim[k], rim[k - 1]], 9, 9).astype(int) for k in range(40))
    assert not differences(count, 1)


@pytest.mark.parametrize("model", [octasphere(2), torus(24, 12)], ids=["sphere", "torus"])
def test_closed_mesh_covers_once_in_front_once_behind(model):
    vertices, faces = model
    rotation = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    screen = np.rint((vertices @ rotation)[:, :2] * 256 * 20 + 256 * 32).astype(int)
    front, back = np.zeros((2, 64, 64), int)
    for triangle in screen[faces]:
        ab, ac = triangle[1] - triangle[0], triangle[2] - triangle[0]
        side = front if ab[0] * ac[1] > ab[1] * ac[0] else back
        side += coverage(triangle, 64, 64)
    assert not differences(front, back)
    assert front.max() == (2 if len(vertices) == 288 else 1)
    assert front.sum() > 600


# ── depth and visibility ────────────────────────────────────────────────────────────────────────────────


def test_depth_of_a_tilted_plane_in_perspective():
    points, normal, offset = tilted(True)
    picture = draw(points, [[0, 1, 2]], SIZE)
    is_hit = picture.face == 0
    depth = offset / (sample_rays(SIZE) @ normal)  # the ray t * direction meets n.p = d at t = d / n.direction
    assert is_hit.sum() > 300
    np.testing.assert_allclose(picture.depth[is_hit], depth[is_hit], rtol=1e-12)
    assert not differences(picture.depth[~is_hit], np.inf)


def test_depth_of_a_tilted_plane_in_an_orthographic_view():
    points, normal, offset = tilted(False)
    picture = draw(points, [[0, 1, 2]], SIZE, camera=sheet_camera(SIZE[1]))
    x, y = np.meshgrid(np.arange(40) + 0.5 - 20, 15 - (np.arange(30) + 0.5))
    depth = -(offset - normal[0] * x - normal[1] * y) / normal[2]
    is_hit = picture.face == 0
    np.testing.assert_allclose(picture.depth[is_hit], depth[is_hit], rtol=1e-12)


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


def test_equal_depth_goes_to_the_earlier_mesh():
    meshes = [
        Mesh(np.array(layer((8, 8), 2.0)), QUAD, material=Material(emissive=e, diffuse=0.0)) for e in (0.25, 0.75)
    ]
    for first, second in ((0, 1), (1, 0)):
        picture = render(Scene([meshes[first], meshes[second]], lights=WHITE, camera=eye_camera()), (8, 8))
        assert picture.face.max() < 2
        assert not deviations(picture.color, (0.25, 0.75)[first])


def test_faces_that_cross_meet_on_the_line_of_equal_depth():
    size = (64, 8)
    left_near = [at_pixel(size, -9, y, 1.0) for y in (-9, 17)] + [at_pixel(size, 73, y, 4.0) for y in (17, -9)]
    right_near = [at_pixel(size, -9, y, 4.0) for y in (-9, 17)] + [at_pixel(size, 73, y, 1.0) for y in (17, -9)]
    quad = np.array([[0, 1, 2], [0, 2, 3]])
    picture = draw(left_near + right_near, np.concatenate([quad, quad + 4]), size)
    assert picture.face[:, :32].max() < 2 and picture.face[:, 32:].min() >= 2


# ── clipping ────────────────────────────────────────────────────────────────────────────────────────────


def check_floor(triangle, near, size=(80, 60), face=((0, 1, 2),)):
    """Compare a triangle of the floor y = -1 with where the rays meet the floor."""
    picture = draw(triangle, face, size, near=near)
    rays = sample_rays(size)
    with np.errstate(divide="ignore"):
        t = np.where(rays[..., 1] < 0, -1.0 / rays[..., 1], 1e9)
    flat = np.asarray(triangle)[:, [0, 2]]
    x, z = rays[..., 0] * t, rays[..., 2] * t
    turns = []
    for k in range(3):
        (ax, az), (bx, bz) = flat[k], flat[(k + 1) % 3]
        turns.append((bx - ax) * (z - az) - (bz - az) * (x - ax))
    is_inside = (np.all(np.array(turns) > 0, axis=0) | np.all(np.array(turns) < 0, axis=0)) & (t >= near)
    is_hit = picture.face == 0
    # vertices move by less than a pixel's 1/256: only samples at the very edge may differ
    assert (is_hit != is_inside).sum() <= 2, f"{(is_hit != is_inside).sum()} samples differ"
    assert is_hit.sum() > 50
    both = is_hit & is_inside
    # 1/depth of the floor grows by 1 / 30 px a row; every vertex is at most half a sub-pixel off
    error = np.abs(1 / picture.depth[both] - 1 / t[both]).max()
    assert error <= HALF_STEP / 30 * 1.0001, f"measured {error:.3g} > budget {HALF_STEP / 30:.3g}"
    return picture


@pytest.mark.parametrize("near", [0.05, 1.5])
def test_floors_with_vertices_behind(near):
    for winding in ((0, 1, 2), (1, 2, 0), (2, 1, 0), (0, 2, 1)):
        check_floor([(0.3, -1, 3.0), (-5.2, -1, -9.1), (6.1, -1, -8.3)], near, face=[winding])
        check_floor([(-4.3, -1, 3.1), (4.1, -1, 2.7), (0.4, -1, -9.3)], near, face=[winding])


def test_clipped_colors_are_those_of_the_whole_triangle():
    triangle = np.array([(-4.3, -1, 3.1), (4.1, -1, 2.7), (0.4, -1, -9.3)])
    colors = 0.5 + triangle[:, [0, 2, 2]] / 20  # an affine function of the place
    picture = draw(triangle, [[0, 1, 2]], (80, 60), near=0.5, colors=colors)
    is_hit = picture.face == 0
    p_world = sample_rays((80, 60))[is_hit] * picture.depth[is_hit][:, None]
    # half a sub-pixel at depth t is HALF_STEP t / 30 across the floor and t times that along it
    budget = (picture.depth[is_hit] ** 2).max() / 30 * HALF_STEP * 2 / 20
    assert np.abs(picture.color[is_hit] - (0.5 + p_world[:, [0, 2, 2]] / 20)).max() <= budget


def test_a_cut_floor_has_neither_gap_nor_double_hit():
    rng = np.random.default_rng(3)
    x, z = np.meshgrid(np.linspace(-60, 60, 7), np.linspace(-50, 30, 7))
    shake = rng.uniform(-5, 5, (2, 7, 7))
    points = np.stack([x + shake[0], np.full_like(x, -1.0), z + shake[1]], axis=-1).reshape(-1, 3)
    a = (np.arange(6)[:, None] * 7 + np.arange(6)).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + 8], 1), np.stack([a, a + 8, a + 7], 1)])
    picture = draw(points, faces, (60, 60), near=0.01)
    assert picture.face[34:].min() >= 0  # below the far rim of the floor
    assert not differences(picture.face[:30], -1)
    assert not differences(picture.margin, np.inf)


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


@pytest.mark.parametrize("is_perspective", [True, False])
def test_what_lies_behind_the_eye_draws_nothing(is_perspective):
    camera = None if is_perspective else sheet_camera(8)
    behind = np.array(layer((8, 8), 2.0)) * (1, 1, -1)
    assert not differences(draw(behind, QUAD, (8, 8), camera=camera).face, -1)
    in_front = layer((8, 8), 3.0, is_perspective)
    picture = draw([*behind, *in_front], np.concatenate([QUAD, QUAD + 4]), (8, 8), camera=camera)
    assert set(np.unique(picture.face)) == {2, 3}
    np.testing.assert_allclose(picture.depth, 3.0, rtol=1e-14)


def test_triangles_far_larger_than_the_screen():
    huge = [(-3e9, -1, 2e9), (3e9, -1, 2e9), (0, -1, -9e9)]
    picture = draw(huge, [[0, 1, 2]], (20, 20), near=1e-3)
    assert not differences(picture.face[10:], 0) and not differences(picture.face[:10], -1)
    t = -1.0 / sample_rays((20, 20))[10:, :, 1]
    # the cut at the near plane lies 2^20 px away, where half a sub-pixel is 2^-29 of the way
    np.testing.assert_allclose(1 / picture.depth[10:], 1 / t, atol=HALF_STEP / 10)
    sheet = [(-3e9, -2e9, -5.0), (3e9, -2e9, -5.0), (0, 5e9, -5.0)]
    flat = draw(sheet, [[0, 1, 2]], (20, 20), camera=sheet_camera(20))
    assert not differences(flat.face, 0)
    np.testing.assert_allclose(flat.depth, 5.0, rtol=1e-14)


def test_faces_at_the_end_of_the_world_disturb_nothing():
    sheet, huge = layer((8, 8), 2.0), 1e60 * np.array([(-9, -9, -1.0), (9, -9, -1.0), (0, 9, -1.0)])
    for shading in SHADINGS:
        both = draw([*huge, *sheet], [[0, 1, 2], *QUAD + 3], (8, 8), near=1.0, shading=shading)
        assert both.face.min() > 0 and not deviations(both.depth, 2)
        alone = draw(huge, [[0, 1, 2]], (8, 8), shading=shading, lights=(DirectionalLight((0, 0, -1)),), material=DULL)
        assert not deviations(alone.depth[3:5, 3:5] / 1e60, 1)
        assert not deviations(alone.color[3:5, 3:5], 0.7)


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
