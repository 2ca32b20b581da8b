"""Check which triangles the cull stage drops, against plain Python and against what they cover."""

import math

import numpy as np
import pytest
from helpers.stages import SERIAL, random_triangles, slivers
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer.geometry.clusters import CLUSTER
from rasterizer.pipeline.cull import PASS, Grid, Visible, find_visible, find_visible_in, first_sample, make_cull_scratch
from rasterizer.pipeline.small_boxes import MOST_WIDE
from rasterizer.pipeline.threads import MIN_PART, Workers
from rasterizer.pipeline.transform import OUTSIDE, Vertices
from rasterizer.reference import coverage

SIZE = (37, 29)
LIMIT = 2**28


@settings(deadline=None)
@given(st.one_of(st.integers(-LIMIT, LIMIT), st.integers(-3000, 3000), st.integers(-300, 300).map(lambda k: 128 * k)))
def test_first_sample_is_the_first_at_or_beyond(coordinate):
    sample = int(first_sample.py_func(np.int32(coordinate)))
    assert 256 * sample + 128 >= coordinate > 256 * (sample - 1) + 128


def soup(rng, n):
    """Vertices of separate triangles (n, 3, 2) of all kinds; some without area, on samples, or OUTSIDE."""
    triangles = np.concatenate([
        random_triangles(rng, n // 4, SIZE, reach) for reach in (0.7, 5.0, 60.0, 2.0**19)
    ]).clip(-LIMIT, LIMIT)  # fmt: skip
    triangles = triangles[rng.permutation(len(triangles))]
    triangles[::5] = triangles[::5] // 128 * 128
    triangles[::7, 2] = triangles[::7, 1]
    triangles[3::11, 1] = (triangles[3::11, 0] + triangles[3::11, 2]) // 2
    triangles[2::13, rng.integers(0, 3), 0] = OUTSIDE
    return triangles


def columns(triangles):
    """The input of the stage: index columns and Vertices, which no two triangles share."""
    index = np.arange(3 * len(triangles), dtype=np.uint32).reshape(-1, 3)
    x, y = (np.ascontiguousarray(triangles[..., k].ravel().astype(np.int32)) for k in range(2))
    return np.ascontiguousarray(index.T), Vertices(x, y, np.zeros(len(x)))


def expected(triangles, size, band_rows, cull_back):
    """(visible faces, first bands, last bands, number culled) in plain Python."""
    found, n_culled = [], 0
    for face, triangle in enumerate(triangles.tolist()):
        (xa, ya), (xb, yb), (xc, yc) = triangle
        area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)  # above 0: clockwise as seen, because y points down
        if int(OUTSIDE) in (xa, xb, xc) or area == 0:
            continue
        if cull_back and area > 0:
            n_culled += 1
            continue
        spans = []
        for coordinates, n in (((xa, xb, xc), size[0]), ((ya, yb, yc), size[1])):
            first, stop = (math.ceil((v - 128) / 256) for v in (min(coordinates), max(coordinates)))
            spans.append((max(first, 0), min(stop, n)))
        if all(first < stop for first, stop in spans) and not is_small_and_empty(triangle, *spans):
            found.append((face, spans[1][0] // band_rows, (spans[1][1] - 1) // band_rows))
    return (*np.array(found).reshape(-1, 3).T.tolist(), n_culled)


def is_small_and_empty(triangle, columns, rows):
    """Whether the box of a triangle is at most MOST_WIDE wide and high, and no sample covered from the first one in
    the picture on."""
    extents = [
        first_sample.py_func(max(values)) - first_sample.py_func(min(values)) for values in zip(*triangle, strict=True)
    ]
    if max(extents) > MOST_WIDE:
        return False
    return not coverage(np.array(triangle) - 256 * np.array([columns[0], rows[0]]), MOST_WIDE, MOST_WIDE).any()


@pytest.mark.parametrize("cull_back", [False, True])
@pytest.mark.parametrize("band_rows", [1, 8, 10, 29, 100])
def test_finds_what_plain_python_finds(band_rows, cull_back):
    triangles = soup(np.random.default_rng(band_rows), 2000)
    [visible] = find_visible(*columns(triangles), Grid(*SIZE, band_rows), cull_back, SERIAL)
    face, first, last, n_culled = expected(triangles, SIZE, band_rows, cull_back)
    assert visible.faces.tolist() == face and len(face) > 300
    assert visible.first_bands.tolist() == first and visible.last_bands.tolist() == last
    assert visible.n_culled == n_culled and (n_culled > 300) == cull_back
    n_band = -(-SIZE[1] // band_rows)
    histogram = np.zeros(n_band, int)
    for a, b in zip(first, last, strict=True):
        histogram[a : b + 1] += 1
    assert visible.histogram.tolist() == histogram.tolist()


def near_borders(rng, n):
    """Triangles of a few samples about the borders of the picture, corners often on samples or in line with them."""
    center = np.where(rng.uniform(size=(n, 1, 2)) < 0.5, 0, SIZE) * 256 + rng.integers(-300, 300, (n, 1, 2))
    triangles = center + rng.integers(-500, 501, (n, 3, 2))
    triangles[::2] = triangles[::2] // 128 * 128
    return triangles


@pytest.mark.parametrize("cull_back", [False, True])
def test_nothing_that_covers_a_sample_is_dropped(cull_back):
    rng = np.random.default_rng(1)
    parts = [random_triangles(rng, 150, SIZE, reach) for reach in (0.6, 1.0, 2.0, 30.0)]
    parts += [slivers(rng, 150, SIZE, reach, 3) for reach in (1, 2, 20, 2**18)]
    parts += [random_triangles(rng, 300, SIZE, 1.2) // 128 * 128, near_borders(rng, 300)]
    triangles = np.concatenate(parts).clip(-LIMIT, LIMIT)
    if cull_back:  # all of them counter-clockwise
        (ax, ay), (bx, by), (cx, cy) = triangles.transpose(1, 2, 0)
        is_away = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay) > 0
        triangles[is_away] = triangles[is_away][:, ::-1]
    [visible] = find_visible(*columns(triangles), Grid(*SIZE, 4), cull_back, SERIAL)
    assert visible.n_culled == 0
    is_kept = np.isin(np.arange(len(triangles)), visible.faces)
    n_row = np.zeros(len(triangles))
    for k, triangle in enumerate(triangles):
        rows = np.flatnonzero(coverage(triangle, *SIZE).any(axis=1))
        n_row[k] = len(rows)
        if len(rows):
            assert is_kept[k], f"{triangle.tolist()} covers samples and was dropped"
            at = np.searchsorted(visible.faces, k)
            assert visible.first_bands[at] <= rows[0] // 4 and rows[-1] // 4 <= visible.last_bands[at]
    assert 200 < (n_row > 0).sum() and (~is_kept).sum() > 50


@pytest.mark.parametrize("n", [0, 1, PASS - 1, PASS, PASS + 1, 3 * PASS + 5])
def test_passes_do_not_matter(n):
    triangles = soup(np.random.default_rng(2), 4 * PASS)[:n]
    [visible] = find_visible(*columns(triangles), Grid(*SIZE, 8), True, SERIAL)
    assert visible.faces.tolist() == expected(triangles, SIZE, 8, True)[0]


@pytest.mark.parametrize("chosen", [[], [0], [3, 4, 9], range(0, 30, 2), [30], range(31)])
def test_only_the_clusters_that_are_asked_for_are_looked_at(chosen):
    triangles = soup(np.random.default_rng(4), 4 * 480)
    chosen = np.array(chosen, np.uint32)
    [visible] = find_visible(*columns(triangles), Grid(*SIZE, 8), False, SERIAL, chosen)
    face = np.array(expected(triangles, SIZE, 8, False)[0])
    assert visible.faces.tolist() == face[np.isin(face // CLUSTER, chosen)].tolist()
    assert len(triangles) // CLUSTER == 30


def test_small_boxes_that_hold_nothing_covered_are_dropped():
    """Half of the triangles of a dense mesh."""
    triangles = random_triangles(np.random.default_rng(5), 4000, SIZE, 0.5)
    [visible] = find_visible(*columns(triangles), Grid(*SIZE, 8), False, SERIAL)
    n_covering = sum(coverage(triangle, *SIZE).any() for triangle in triangles)
    assert n_covering <= len(visible.faces) < 1.1 * n_covering and n_covering < 2000


def test_without_the_compiler_the_same_comes_out():
    triangles = soup(np.random.default_rng(6), 160)
    index, vertices = columns(triangles)
    grid, clusters = Grid(*SIZE, 8), np.arange(3, dtype=np.uint32)
    results = []
    for function in (find_visible_in, find_visible_in.py_func):
        n = len(triangles)
        out = Visible(*(np.zeros(n, np.uint32) for _ in range(3)), np.zeros(5, np.int64), 0)
        with np.errstate(all="ignore"):
            counts = function(clusters, index, vertices, grid, True, make_cull_scratch(), out)
        results.append(
            (*map(int, counts), *(column[: int(counts[0])].tolist() for column in out[:3]), out.histogram.tolist())
        )
    assert results[0] == results[1] and results[0][0] > 20


def test_parts_of_threads_give_the_same_in_order():
    triangles = soup(np.random.default_rng(3), 4 * MIN_PART)
    given_columns = columns(triangles)
    [serial] = find_visible(*given_columns, Grid(*SIZE, 8), True, SERIAL)
    workers = Workers(3)
    parts = find_visible(*given_columns, Grid(*SIZE, 8), True, workers)
    workers.close()
    assert len(parts) > 2
    for name in ("faces", "first_bands", "last_bands"):
        assert np.concatenate([getattr(part, name) for part in parts]).tobytes() == getattr(serial, name).tobytes()
    assert sum(part.n_culled for part in parts) == serial.n_culled
    assert (sum(part.histogram for part in parts) == serial.histogram).all()


def test_as_many_bands_as_there_can_be():
    """Numbers of bands fill 16 bits."""
    triangle = np.array([[[0, 0], [0, 256 * 65535], [256, 256 * 65535]]])
    [visible] = find_visible(*columns(triangle), Grid(1, 65535, 1), False, SERIAL)
    assert visible.first_bands.tolist() == [0] and visible.last_bands.tolist() == [65534]
    assert (visible.histogram == 1).all()
