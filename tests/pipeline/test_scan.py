"""Check which samples the scan stage covers, against integer edges, and what shows at equal depth."""

import itertools

import numpy as np
import pytest
from helpers import stages
from helpers.pinhole import octasphere, torus
from helpers.pixels import needle, project
from helpers.raster import draw_faces, sheet
from hypothesis import given, settings
from hypothesis import strategies as st

import rasterizer as rz
from rasterizer.engine import draw
from rasterizer.options import MOST_PIXELS
from rasterizer.pipeline import cull, drawables, gradients, records, scan, setup, visibility
from rasterizer.pipeline.gradients import CODINGS, EXACT, IN_ENTRIES, LEVEL_PLANES, NORMAL_PLANES
from rasterizer.pipeline.visibility import CLEAR, LEVEL_MASK
from rasterizer.reference import coverage

SIZE = (37, 29)
LIMIT = 2**28


def assert_covered_exactly(triangles, size=SIZE):
    """Draw every triangle alone, and compare sample by sample."""
    n_covered = 0
    for triangle in triangles:
        expected = coverage(triangle, *size)
        face = draw_faces([triangle], size)
        assert ((face == 0) == expected).all(), (
            f"{np.asarray(triangle).tolist()}: {((face == 0) != expected).sum()} wrong"
        )
        n_covered += expected.sum()
    return n_covered


near_ints = st.integers(-2000, 12000)
half_pixels = st.integers(-6, 80).map(lambda k: 128 * k)
far_ints = st.integers(-LIMIT, LIMIT)
coordinates = st.one_of(near_ints, half_pixels, half_pixels, far_ints)


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(*[st.tuples(coordinates, coordinates)] * 3), min_size=1, max_size=6))
def test_coverage_is_that_of_integer_edge_functions(triangles):
    assert_covered_exactly(triangles)


SOUPS = {
    "small": (600, 1.5),
    "sub-pixel": (600, 0.9),
    "medium": (200, 10.0),
    "larger than the picture": (100, 100.0),
    "far outside": (100, 2.0**14),
    "as far as can be": (100, 2.0**19.9),
}


@pytest.mark.parametrize("kind", SOUPS)
def test_soups_are_covered_exactly(kind):
    n, reach = SOUPS[kind]
    rng = np.random.default_rng(7)
    center = rng.uniform(0, 256 * np.array(SIZE), (n, 1, 2))
    triangles = np.rint(center + 256 * reach * rng.uniform(-1, 1, (n, 3, 2))).clip(-LIMIT, LIMIT).astype(np.int64)
    snapped = triangles.copy()
    snapped[::3] = (snapped[::3] // 128 * 128).clip(-LIMIT, LIMIT)  # vertices on samples and on pixel corners
    assert assert_covered_exactly(snapped) > 50


@pytest.mark.parametrize("width", [1, 2, 5, 60])
def test_slivers_are_covered_exactly(width):
    """Triangles a few sub-pixels wide, at any angle, from inside the picture to 2^20 px."""
    rng = np.random.default_rng(width)
    n_covered = 0
    for reach in (20, 500, 2**14, 2**19):
        middle = rng.uniform(0, 256 * np.array(SIZE), (60, 2))
        angle = rng.uniform(0, np.pi, 60)
        along = np.stack([np.cos(angle), np.sin(angle)], axis=1) * reach * 256
        third = middle + along * rng.uniform(-0.9, 0.9, (60, 1)) + rng.choice([-width, width], (60, 2))
        triangles = np.rint(np.stack([middle - along, middle + along, third], axis=1)).astype(np.int64)
        n_covered += assert_covered_exactly(triangles.clip(-LIMIT, LIMIT))
    assert n_covered > 10


@pytest.mark.parametrize("bits", [4, 10, 16, 22, 26])
def test_the_thinnest_triangles_are_covered_exactly(bits):
    rng = np.random.default_rng(bits)
    triangles = [needle(rng, bits, SIZE) for _ in range(20)]
    assert assert_covered_exactly(triangles) >= 20


@pytest.mark.parametrize("size", [(65536, 8), (8, 65536), (MOST_PIXELS, 2), (2, MOST_PIXELS)])
def test_the_longest_pictures_are_covered_exactly(size):
    """Triangles and slivers along the whole of the longest pictures, and beyond their ends."""
    rng, box = np.random.default_rng(11), 256 * np.array(size)
    soup = np.rint(rng.uniform(-0.3, 1.3, (6, 3, 2)) * box).astype(np.int64)
    along = np.array([(0, 0), box, box // 2]) + np.array([1, 3, 60, 300])[:, None, None] * rng.integers(
        -1, 2, (4, 3, 2)
    )
    through = np.array([-box, 2 * box, box // 3]) + rng.integers(-90, 91, (4, 3, 2))
    for kind in (soup, soup // 128 * 128, along, through):
        assert assert_covered_exactly(kind.clip(-LIMIT, LIMIT), size) > 1000


def test_soup_drawn_at_once_shows_the_lowest_face_of_those_that_cover(monkeypatch):
    """Equal depth everywhere: the z-buffer must not change what is covered, whatever the bands' height."""
    rng = np.random.default_rng(3)
    triangles = rng.integers(-2000, 12000, (80, 3, 2))
    masks = np.array([coverage(t, *SIZE) for t in triangles])
    expected = np.where(masks.any(axis=0), masks.argmax(axis=0), -1)
    for n_entry in (1, 400, 2**17):
        monkeypatch.setattr(draw, "BAND_ENTRIES", n_entry)
        for threads in (1, 2, 5):
            assert (draw_faces(triangles, SIZE, threads=threads) == expected).all()


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


@pytest.mark.parametrize("columns, rows", [(1, 1), (4, 3), (12, 25), (50, 30), (200, 200)])
def test_a_tiling_covers_every_sample_once(columns, rows):
    for seed in range(5):
        is_good = is_covered_once(tiling(np.random.default_rng(seed), columns, rows))
        assert is_good.all(), f"{(~is_good).sum()} samples not covered once"


def test_counting_covers_finds_gaps_and_overlaps():
    triangles = tiling(np.random.default_rng(0), 4, 3)
    assert not is_covered_once(triangles[1:]).all()
    assert not is_covered_once(np.concatenate([triangles, triangles[5:6] + 3])).all()


@pytest.mark.parametrize("offset", [0, 128, 1])
def test_a_tiling_of_pixels_covers_every_sample_once(offset):
    """Vertices on pixel corners, on samples, and a sub-pixel beside them."""
    x, y = np.meshgrid(256 * np.arange(-1, SIZE[0] + 1) + offset, 256 * np.arange(-1, SIZE[1] + 1) + offset)
    assert is_covered_once(split_cells(np.stack([x, y], axis=-1))).all()


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


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("n_split", [0, 2, 5])
def test_a_sphere_covers_each_sample_once_in_front_and_once_behind(camera, n_split):
    vertices, faces = octasphere(n_split)
    is_hit = draw_faces(on_screen(vertices, faces, camera), SIZE) >= 0
    assert 100 < is_hit.sum()
    for order in (faces, faces[:, ::-1]):
        assert (is_covered_once(on_screen(vertices, order, camera), cull="back") == is_hit).all()


@pytest.mark.parametrize("camera", CAMERAS)
def test_a_closed_mesh_has_as_many_fronts_as_backs_at_every_sample(camera):
    vertices, faces = torus(14, 7)
    vertices = vertices[:, [2, 0, 1]]  # seen from the side: one part of the ring before the other
    fronts, backs = (
        sum((draw_faces([t], SIZE, cull="back") >= 0).astype(int) for t in on_screen(0.9 * vertices, order, camera))
        for order in (faces, faces[:, ::-1])
    )
    assert fronts.max() >= 2
    assert (fronts == backs).all()


ORDERS = list(itertools.permutations(range(3)))
OUTPUTS = [("color",), ("rgb",), ("face",), ("depth", "normal"), ("color", "rgb", "depth", "face", "normal")]


@pytest.mark.parametrize("shading", ["flat", "gouraud", "phong"])
@pytest.mark.parametrize("is_perspective", [True, False])
def test_of_equal_triangles_the_first_is_shown(shading, is_perspective):
    """Turned round or listed from another vertex, a triangle has the same depth: the second must not show."""
    size, points, depth = (90, 70), [(5, 5), (80, 11.3), (30, 66.7)], [1.0, 2.0, 1.3]
    normals = np.array([[0.1, 0.2, 1], [0, -0.3, 1], [0.3, 0.1, 1]])
    for order, outputs, tolerance in itertools.product(ORDERS, OUTPUTS, (0.0, 1 / 4096)):
        order = list(order)
        colors = np.array([(0.5, 0.5, 0.5), (0.9, 0.1, 0.1)])
        for face_colors in (None, colors) if order[0] == 0 else (None,):
            drawn = []
            for faces, n in (
                ([[0, 1, 2], order], np.stack([normals, normals[order]])),
                ([[0, 1, 2]], normals[None]),
            ):
                given = None if face_colors is None else face_colors[: len(faces)]
                scene = sheet(size, points, depth, faces, is_perspective=is_perspective, normals=n, face_colors=given)
                drawn.append(rz.render(scene, size, shading=shading, outputs=outputs, tolerance=tolerance))
            both, first = drawn
            for name in outputs:
                assert getattr(both, name).tobytes() == getattr(first, name).tobytes(), f"{order} {name}"


def test_the_first_of_equal_slivers_is_shown():
    """Slivers take another way to their depth; it may not depend on the order of the vertices either."""
    rng = np.random.default_rng(11)
    n_covered = 0
    for bits in (12, 18, 24):
        for _ in range(10):
            triangle, depth = needle(rng, bits, SIZE), rng.random(3)
            for order in ORDERS:
                order = list(order)
                face = draw_faces([triangle, triangle[order]], SIZE, [depth, depth[order]])
                assert (face <= 0).all()
                n_covered += (face == 0).sum()
    assert n_covered > 100


# ---------------------------------------------------------------- with the interpreter


BAND = (24, 18)


def scanned(triangles, depth, values, kind):
    """What the scan stage leaves of a small band: the counts, and the bytes of buffer and records."""
    screen = stages.plain_screen(True, (1.0, 4.0))
    coding = stages.plain_coding(kind, screen, LEVEL_MASK - 1.0, 0.01, normal_limit=2.0**12, needs_distance=True)
    workspace, *counts = stages.scan_alone(
        triangles, depth, values, coding, screen, BAND, is_inverted=np.arange(len(triangles)) % 2, n_group=2
    )
    buffer, kept = workspace.visibility, workspace.records
    arrays = buffer.entries, buffer.left, buffer.right, kept.integers, kept.reals, kept.int_planes
    return counts, [array.tobytes() for array in arrays], (buffer.entries < CLEAR).sum()


@pytest.mark.parametrize("kind", CODINGS)
def test_without_the_compiler_the_same_comes_out(kind, monkeypatch):
    """Small and large triangles and slivers: every way through the stage, vector instructions included, bit for bit."""
    rng = np.random.default_rng(kind)
    found = [stages.random_triangles(rng, 12, BAND, reach) for reach in (1.5, 6.0, 30.0)]
    found += [stages.slivers(rng, 8, BAND, 2**10, 3), stages.slivers(rng, 4, BAND, 2**18, 1)]
    triangles = np.concatenate(found).clip(-LIMIT, LIMIT)
    depth = rng.uniform(1.0, 4.0, (len(triangles), 1)) * rng.uniform(1.0, 1.01, (len(triangles), 3))
    values = rng.random((len(triangles), 3, {IN_ENTRIES: 1, NORMAL_PLANES: 6}.get(kind, 3))).astype(np.float32)
    values[::2] = values[::2, :1]
    given = triangles, depth.clip(1.0, 4.0), values, kind
    compiled = scanned(*given)
    stages.interpret(monkeypatch, stages, scan, setup, gradients, records, visibility, cull, drawables)
    with np.errstate(all="ignore"):  # unsigned integers wrap, as they do in compiled code
        assert scanned(*given) == compiled
    (n_record, n_exact), _, n_covered = compiled
    assert n_covered > 300 and n_exact > 0 and (kind == EXACT or n_exact < len(triangles))
    assert n_record > n_exact if kind in (LEVEL_PLANES, NORMAL_PLANES) else n_record == n_exact
