"""Check which samples the scan stage covers, against integer edges, and what shows at equal depth."""

import itertools

import numpy as np
import pytest
from helpers import stages
from helpers.pinhole import octasphere
from helpers.pixels import needle, project
from helpers.raster import draw_faces, sheet
from hypothesis import given, settings
from hypothesis import strategies as st

import rasterizer as rz
from rasterizer.options import MAX_PIXELS
from rasterizer.pipeline import records, scan, visibility
from rasterizer.pipeline.cull import Band
from rasterizer.pipeline.gradients import IS_INVISIBLE, IS_TRANSPARENT
from rasterizer.pipeline.scan import make_deferred
from rasterizer.pipeline.setup import make_block
from rasterizer.pipeline.transform import compute_z
from rasterizer.pipeline.visibility import CLEAR, LEVEL_MASK, id_payload
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


def test_soup_drawn_at_once_shows_the_lowest_face_of_those_that_cover():
    """Equal depth everywhere: the z-buffer must not change what is covered, whatever the bands' height. The number
    of threads decides that."""
    rng, size = np.random.default_rng(3), (37, 290)
    triangles = rng.integers(-2000, 12000, (80, 3, 2)) * (1, 10)
    masks = np.array([coverage(t, *size) for t in triangles])
    expected = np.where(masks.any(axis=0), masks.argmax(axis=0), -1)
    for threads in (1, 2, 5, 16):
        wrong = (draw_faces(triangles, size, threads=threads) != expected).sum()
        assert wrong == 0, f"{wrong} samples wrong on {threads} threads"


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


def test_a_tiling_of_pixels_covers_every_sample_once():
    """Vertices on pixel corners, on samples, and a sub-pixel beside them."""
    for offset in (0, 128, 1):
        x, y = np.meshgrid(256 * np.arange(-1, SIZE[0] + 1) + offset, 256 * np.arange(-1, SIZE[1] + 1) + offset)
        assert is_covered_once(split_cells(np.stack([x, y], axis=-1))).all(), f"offset {offset}/256 px"


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
OUTPUTS = [("color",), ("rgb",), ("face",), ("depth", "normal"), ("color", "rgb", "depth", "face", "normal")]


@pytest.mark.parametrize("shading, is_perspective", [("flat", True), ("gouraud", False), ("phong", True)])
def test_of_equal_triangles_the_first_is_shown(shading, is_perspective):
    """Turned round or listed from another vertex, a triangle has the same depth: the second must not show."""
    size, points, depth = (45, 35), [(2, 2), (40, 5.3), (15, 33.7)], [1.0, 2.0, 1.3]
    normals = np.array([[0.1, 0.2, 1], [0, -0.3, 1], [0.3, 0.1, 1]])
    colors = np.array([(0.5, 0.5, 0.5), (0.9, 0.1, 0.1)])
    for k, (order, outputs) in enumerate(itertools.product(ORDERS, OUTPUTS)):
        order, face_colors, tolerance = list(order), (None, colors)[k % 2], (0.0, 1 / 4096)[k // 3 % 2]
        drawn = []
        # The second triangle lies beside the picture, or before the first one: what a scene needs is the same.
        for second in ([3, 4, 5], order):
            n, faces = np.stack([normals, normals[[i % 3 for i in second]]]), [[0, 1, 2], second]
            scene = sheet(
                size, points + [(-50, 5), (-40, 9), (-30, 0)], depth + depth, faces, is_perspective=is_perspective,
                normals=n, face_colors=face_colors,
            )  # fmt: skip
            drawn.append(rz.render(scene, size, shading=shading, outputs=outputs, samples=1, tolerance=tolerance))
        first, both = drawn
        for name in outputs:
            same = getattr(both, name).tobytes() == getattr(first, name).tobytes()
            assert same, f"{name} of {order}, tolerance {tolerance}, face colours: {face_colors is not None}"


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


# ---------------------------------------------------------------- several materials


BAND = (24, 18)
SCREEN = stages.plain_screen(True, (1.0, 4.0))
N_ATTRIBUTES, TYPES = [1, 3, 6, 8], [np.float32, np.float32, np.float32, np.float64]


def coding_of(kind, has_transparent=False):
    """Four materials, of 1, 3, 6 and 8 attributes, the last in float64; where some are transparent, the first is opaque
    and the third invisible."""
    n_attributes = [max(n, 3) if kind == "normals" else n for n in N_ATTRIBUTES]
    options = {"level_scale": LEVEL_MASK - 1.0, "tolerance": 0.01, "normal_limit": 2.0**12}
    coding = stages.plain_coding(kind, SCREEN, n_attributes, TYPES, **options, needs_distance=kind == "normals")
    extra = (0, IS_TRANSPARENT, IS_INVISIBLE, IS_TRANSPARENT) if has_transparent else (0, 0, 0, 0)
    return coding._replace(features=coding.features | np.array(extra, np.uint8))


def small_band(seed):
    """Small and large triangles and slivers of four materials."""
    rng = np.random.default_rng(seed)
    found = [stages.random_triangles(rng, 24, BAND, reach) for reach in (1.5, 6.0, 30.0)]
    found += [stages.slivers(rng, 8, BAND, 2**10, 3), stages.slivers(rng, 4, BAND, 2**18, 1)]
    triangles = rng.permutation(np.concatenate(found).clip(-LIMIT, LIMIT))
    depth = rng.uniform(1.0, 4.0, (len(triangles), 1)) * rng.uniform(1.0, 1.01, (len(triangles), 3))
    values = rng.random((len(triangles), 3, 8))
    values[::2] = values[::2, :1]
    material = rng.integers(0, 4, len(triangles)).astype(np.uint32)
    return triangles, depth.clip(1.0, 4.0), values, material


@pytest.mark.parametrize("kind", stages.KINDS)
def test_without_the_compiler_the_same_comes_out(kind):
    """Small and large triangles and slivers of several materials, some of them transparent: every way through the
    stage, bit for bit."""
    triangles, depth, attributes, material = small_band(len(kind))
    coding, found = coding_of(kind, True), []
    kernel = scan.scan_normals if kind == "normals" else scan.scan_levels
    for run in (kernel, kernel.py_func):
        listed = make_deferred(len(triangles), visibility.make_extents(BAND[1]))
        with np.errstate(all="ignore"):  # unsigned integers wrap, as they do in compiled code
            workspace, counts = stages.scan_alone(
                triangles, depth, attributes, coding, SCREEN, BAND, is_inverted=np.arange(len(triangles)) % 2,
                material=material, deferred=listed, run=run,
            )  # fmt: skip
        buffer, kept = workspace.visibility, workspace.records
        arrays = {
            "entries": buffer.entries, "left": buffer.left, "right": buffer.right, "integers": kept.integers,
            "reals": kept.reals, "planes": kept.int_planes, "faces": listed.listed().faces,
            "payloads": listed.listed().payloads, "extents": listed.extents.left, "ends": listed.extents.right,
            "counts": np.array(counts), "deferred": listed.found,
        }  # fmt: skip
        found.append({name: array.tobytes() for name, array in arrays.items()})
    wrong = [name for name, content in found[0].items() if found[1][name] != content]
    assert not wrong, f"{wrong} differ"
    assert (buffer.entries < CLEAR).sum() > 100 and counts.n_exact > 0 and listed.found[0] > 0
    assert (counts.n_level > 0) == (kind == "entries") and (counts.n_plane > 0) == (kind != "exact")


def test_without_the_compiler_places_are_the_same():
    """As the last test, of entries that hold places of triangles."""
    (triangles, depth, attributes, _), found = small_band(3), []
    z = compute_z(depth, SCREEN)
    drawables = stages.drawables_of(triangles, z, attributes[None])
    band, faces = Band(np.arange(len(triangles), dtype=np.uint32), 0, BAND[1]), set()
    for run in (scan.scan_index, scan.scan_index.py_func):
        buffer = visibility.make_visibility_buffer(*BAND)
        with np.errstate(all="ignore"):
            run(band, drawables, make_block(), buffer)
        found.append((buffer.entries.tobytes(), buffer.left.tobytes(), buffer.right.tobytes()))
        faces = {int(visibility.record_of(entry)) for entry in buffer.entries if entry < CLEAR}
    assert found[0] == found[1] and len(faces) > 10


@pytest.mark.parametrize("kind", ["exact", "entries", "values", "normals"])
def test_transparent_triangles_are_listed_and_not_drawn(kind):
    """In the order of the faces, each with the payload of its record; invisible ones are not there at all."""
    triangles, depth, attributes, material = small_band(7)
    deferred, coding = make_deferred(len(triangles), visibility.make_extents(BAND[1])), coding_of(kind, True)
    workspace, counts = stages.scan_alone(
        triangles, depth, attributes, coding, SCREEN, BAND, material=material, deferred=deferred
    )
    low, high = (f(triangles, axis=1) for f in (np.min, np.max))
    touches = (high > 128).all(axis=1) & (low <= 256 * np.array(BAND) - 128).all(axis=1)
    found, kept = deferred.listed(), workspace.records
    faces = found.faces.tolist()
    assert faces == sorted(faces) and len(faces) > 20
    assert set(faces) <= set(np.flatnonzero(np.isin(material, (1, 3)) & touches).tolist())
    for face, payload in zip(faces, found.payloads, strict=True):
        record, is_exact = int(payload >> 2) & 0x3FFFFF, bool(payload & 1)
        assert payload == id_payload.py_func(record, payload & 3) and payload & 3 != 3
        its_face = kept.integers[record, records.FACE] if is_exact else kept.int_planes[16 * record + 3]
        its_material = kept.integers[record, records.MATERIAL] if is_exact else kept.int_planes[16 * record]
        assert (its_face, its_material) == (face, material[face])
    drawn = stages.entries_of(workspace, BAND)[stages.entries_of(workspace, BAND) < CLEAR]
    assert 0 < len(drawn) < np.prod(BAND) and counts.features & (IS_TRANSPARENT | IS_INVISIBLE) == 0, (
        "what is drawn is opaque"
    )
    assert deferred.counts.features & (IS_TRANSPARENT | IS_INVISIBLE) == IS_TRANSPARENT
    n_exact = int((found.payloads & 1).sum())
    assert (deferred.counts.n_plane, deferred.counts.n_exact) == (len(faces) - n_exact, n_exact)


@pytest.mark.parametrize("kind", stages.KINDS)
def test_a_band_says_what_its_materials_need_and_whether_there_is_one(kind):
    given = small_band(3)
    triangles, depth, attributes, _ = given
    coding = coding_of(kind)
    for chosen, expected in (([2], 2), ([3], 3), ([0, 1], -1), ([0, 2, 3], -1)):
        material = np.array(chosen, np.uint32)[np.arange(len(triangles)) * len(chosen) // len(triangles)]
        _, counts = stages.scan_alone(triangles, depth, attributes, coding, SCREEN, BAND, material=material)
        assert counts.material == expected and counts.features == np.bitwise_or.reduce(coding.features[chosen])
    _, counts = stages.scan_alone(triangles[:0], depth[:0], attributes[:0], coding, SCREEN, BAND, room=1)
    assert counts[:4] == (0, 0, 0, 0)
