"""Check which samples the scan stage covers, against integer edges, and what shows at equal depth."""

import itertools

import numpy as np
import pytest
from helpers import stages
from helpers.pinhole import octasphere
from helpers.pixels import needle, project
from helpers.raster import draw_faces
from hypothesis import given, settings
from hypothesis import strategies as st

import rasterizer as rz
from rasterizer.options import MAX_PIXELS
from rasterizer.reference import coverage

SIZE = (37, 29)
LIMIT = 2**28


def assert_covered_exactly(triangles, size=SIZE):
    """Draw triangles of one depth, some at a time, in both orders, and compare sample by sample: the lowest face that
    covers a sample shows."""
    n_covered = 0
    for start in range(0, len(triangles), 6):
        some = np.asarray(triangles[start : start + 6], np.int64)
        for order in (some, some[::-1]):
            masks = np.array([coverage(triangle, *size) for triangle in order])
            expected = np.where(masks.any(axis=0), masks.argmax(axis=0), -1)
            face = draw_faces(order, size)
            wrong = np.argwhere(face != expected)
            assert not len(wrong), (
                f"{len(wrong)} samples wrong, the first (row, column) {wrong[0]}: face {face[tuple(wrong[0])]} instead "
                f"of {expected[tuple(wrong[0])]} of {order.tolist()}"
            )
            n_covered += masks.sum()
    return n_covered


near_ints = st.integers(-2000, 12000)
half_pixels = st.integers(-6, 80).map(lambda k: 128 * k)
far_ints = st.integers(-LIMIT, LIMIT)
coordinates = st.one_of(near_ints, half_pixels, half_pixels, far_ints)


soups = st.lists(st.tuples(*[st.tuples(coordinates, coordinates)] * 3), min_size=3, max_size=6)


@settings(max_examples=50, deadline=None)
@given(soups)
def test_coverage_is_that_of_integer_edge_functions(triangles):
    assert_covered_exactly(triangles)


@pytest.mark.nightly
@settings(max_examples=1500, deadline=None)
@given(soups)
def test_coverage_of_many_triangles_is_that_of_integer_edge_functions(triangles):
    assert_covered_exactly(triangles)


def thin_triangles(rng):
    """A few sub-pixels wide, at any angle, from inside the picture to 2^20 px; and some round a sample that are as thin
    as can be."""
    found = [stages.slivers(rng, 12, SIZE, reach, width) for width in (1, 5, 60) for reach in (20, 500, 2**14, 2**19)]
    return np.concatenate([*found, [needle(rng, bits, SIZE) for bits in (4, 10, 16, 22, 26) for _ in range(6)]])


SOUPS = {
    "small": lambda rng: stages.random_triangles(rng, 240, SIZE, 1.5),
    "sub-pixel": lambda rng: stages.random_triangles(rng, 240, SIZE, 0.9),
    "medium": lambda rng: stages.random_triangles(rng, 60, SIZE, 10.0),
    "larger than the picture": lambda rng: stages.random_triangles(rng, 30, SIZE, 100.0),
    "far outside": lambda rng: stages.random_triangles(rng, 60, SIZE, 2.0**14),
    "as far as can be": lambda rng: stages.random_triangles(rng, 60, SIZE, 2.0**19.9),
    "thin": thin_triangles,
}


@pytest.mark.parametrize("kind", SOUPS)
def test_soups_are_covered_exactly(kind):
    triangles = SOUPS[kind](np.random.default_rng(7)).clip(-LIMIT, LIMIT)
    if kind != "thin":
        triangles[::3] = (triangles[::3] // 128 * 128).clip(-LIMIT, LIMIT)  # on samples and on pixel corners
    assert assert_covered_exactly(triangles) > 50


@pytest.mark.parametrize("size", [(65536, 8), (8, 65536), (MAX_PIXELS, 2), (2, MAX_PIXELS)])
def test_the_longest_pictures_are_covered_exactly(size):
    """Triangles and slivers along the whole of the longest pictures, and beyond their ends."""
    rng, box = np.random.default_rng(11), 256 * np.array(size)
    soup = np.rint(rng.uniform(-0.3, 1.3, (2, 3, 2)) * box).astype(np.int64)
    along = np.array([(0, 0), box, box // 2]) + np.array([1, 60])[:, None, None] * rng.integers(-1, 2, (2, 3, 2))
    through = np.array([-box, 2 * box, box // 3]) + rng.integers(-90, 91, (1, 3, 2))
    for kind in (np.concatenate([soup[:1] // 128 * 128, soup[1:], through]), along):
        assert assert_covered_exactly(kind.clip(-LIMIT, LIMIT), size) > 1000


def tiling(rng, columns, rows):
    """Triangles over a grid that reaches beyond the picture on all sides.

    Vertices move by less than a quarter of a cell, so that no triangle turns over; a third of them stay, and
    where there is room another third goes to the nearest sample or pixel corner.
    """
    x, y = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1))
    step = (256 * np.array(SIZE) + 1024) / (columns, rows)
    points = np.rint(np.stack([x, y], axis=-1) * step - 512).astype(np.int64)
    jitter = np.rint(rng.uniform(-0.2, 0.2, points.shape) * step).astype(np.int64)
    choice = rng.integers(0, 3, (rows + 1, columns + 1, 1))
    moved = points + np.where(choice == 0, 0, jitter)
    snapped = (moved + 64) // 128 * 128
    moved = np.where((choice == 2) & (step.min() > 64 / 0.04), snapped, moved)
    points[1:-1, 1:-1] = moved[1:-1, 1:-1]
    return split_cells(points)


def split_cells(points):
    """Two triangles for every cell of a grid of points (rows + 1, columns + 1, 2)."""
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    return np.concatenate([np.stack(t, axis=2).reshape(-1, 3, 2) for t in ((a, b, c), (a, c, d))])


def is_covered_once(triangles, **options):
    """Tell which samples exactly one triangle covers.

    Depths are equal, so the lowest face is shown: in the opposite order another one, where there are more.
    """
    there = draw_faces(triangles, SIZE, **options)
    back = draw_faces(triangles[::-1], SIZE, **options)
    return (there >= 0) & (there == len(triangles) - 1 - back)


def test_a_tiling_covers_every_sample_once():
    for columns, rows, seed in [(1, 1, 0), (4, 3, 1), (12, 25, 2), (50, 30, 3), (200, 200, 4)]:
        is_good = is_covered_once(tiling(np.random.default_rng(seed), columns, rows))
        assert is_good.all(), f"{columns} x {rows} cells: {(~is_good).sum()} samples not covered once"


def on_screen(vertices, faces, camera):
    """Triangles (n, 3, 2) of a model in whole 1/256 px, as a camera sees them."""
    places, depth = project(camera, vertices, SIZE)
    assert depth.min() > 0
    return np.rint(256 * places).astype(np.int64)[faces]


CAMERAS = [
    rz.Camera.perspective((1.5, 2.0, 4.0), fov=40),
    rz.Camera.perspective((0.9, 0.9, 1.1), fov=100),
    rz.Camera.orthographic((1.5, 2.0, 4.0), height=2.4),
]


def test_a_sphere_covers_each_sample_once_in_front_and_once_behind():
    for camera, n_split in zip(CAMERAS, (0, 2, 5), strict=True):
        vertices, faces = octasphere(n_split)
        is_hit = draw_faces(on_screen(vertices, faces, camera), SIZE) >= 0
        assert 100 < is_hit.sum()
        for order in (faces, faces[:, ::-1]):
            wrong = (is_covered_once(on_screen(vertices, order, camera), cull="back") != is_hit).sum()
            assert wrong == 0, f"{wrong} samples of {camera}, split {n_split} times"


ORDERS = list(itertools.permutations(range(3)))


def test_the_first_of_equal_slivers_is_shown():
    """Slivers take another way to their depth; it may not depend on the order of the vertices either."""
    rng = np.random.default_rng(11)
    n_covered = 0
    for bits in (12, 18, 24):
        for _ in range(4):
            triangle, depth = needle(rng, bits, SIZE), rng.random(3)
            for order in ORDERS:
                order = list(order)
                face = draw_faces([triangle, triangle[order]], SIZE, [depth, depth[order]])
                assert face.max() <= 0
                n_covered += (face == 0).sum()
    assert n_covered > 40
