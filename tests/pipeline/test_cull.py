"""Check which triangles the cull stage drops, against plain Python and against what they cover."""

import math

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.stages import SERIAL, random_triangles, slivers

from rasterizer.cores import MIN_PART, Workers
from rasterizer.engine.shadow_maps import CUBE, _look, border_planes
from rasterizer.pipeline.cull import (
    MAX_PLANES,
    PASS,
    SMALL_BOX,
    Grid,
    Visible,
    find_visible,
    join_lists,
    list_seen_faces,
    sort_into_bands,
)
from rasterizer.pipeline.transform import OUTSIDE, PixelWidth, Vertices
from rasterizer.reference import coverage
from rasterizer.scene.camera import Projection

SIZE = (37, 29)
LIMIT = 2**28


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
    return np.ascontiguousarray(index.T), Vertices(x, y, *np.zeros((3, len(x))), PixelWidth(0.0, 0.0, 0.0))


def first_at(coordinate):
    """The first sample at or beyond a coordinate in 1/256 px."""
    return math.ceil((coordinate - 128) / 256)


def expected(triangles, size, band_rows, hidden_sides):
    """(visible faces, first bands, last bands, number culled) in plain Python."""
    found, n_culled = [], 0
    for face, (triangle, hidden) in enumerate(zip(triangles.tolist(), hidden_sides.tolist(), strict=True)):
        (xa, ya), (xb, yb), (xc, yc) = triangle
        area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)  # above 0: clockwise as seen, because y points down
        if int(OUTSIDE) in (xa, xb, xc) or area == 0:
            continue
        if area * hidden > 0:
            n_culled += 1
            continue
        spans = []
        for coordinates, n in (((xa, xb, xc), size[0]), ((ya, yb, yc), size[1])):
            first, stop = (first_at(v) for v in (min(coordinates), max(coordinates)))
            spans.append((max(first, 0), min(stop, n)))
        if all(first < stop for first, stop in spans) and not is_small_and_empty(triangle, *spans):
            found.append((face, spans[1][0] // band_rows, (spans[1][1] - 1) // band_rows))
    return (*np.array(found).reshape(-1, 3).T.tolist(), n_culled)


def is_small_and_empty(triangle, columns, rows):
    """Whether the box of a triangle is at most SMALL_BOX wide and high, and no sample covered from the first one in
    the picture on."""
    extents = [first_at(max(values)) - first_at(min(values)) for values in zip(*triangle, strict=True)]
    if max(extents) > SMALL_BOX:
        return False
    return not coverage(np.array(triangle) - 256 * np.array([columns[0], rows[0]]), SMALL_BOX, SMALL_BOX).any()


def test_finds_what_plain_python_finds():
    for band_rows, is_culled in ((1, True), (8, False), (10, True), (29, False), (100, True)):
        rng = np.random.default_rng(band_rows)
        triangles = soup(rng, 1200)
        hidden = rng.integers(-1, 2, 1200).astype(np.int8) * is_culled
        [visible] = find_visible(*columns(triangles), Grid(*SIZE, band_rows), hidden, SERIAL)
        face, first, last, n_culled = expected(triangles, SIZE, band_rows, hidden)
        case = f"{band_rows} rows a band, {is_culled=}"
        assert visible.faces.tolist() == face and len(face) > 150, case
        assert visible.first_bands.tolist() == first and visible.last_bands.tolist() == last, case
        assert visible.n_culled == n_culled and (n_culled > 150) == is_culled, case
        histogram = np.zeros(-(-SIZE[1] // band_rows), int)
        for a, b in zip(first, last, strict=True):
            histogram[a : b + 1] += 1
        assert visible.histogram.tolist() == histogram.tolist(), case


def near_borders(rng, n):
    """Triangles of a few samples about the borders of the picture, corners often on samples or in line with them."""
    center = np.where(rng.uniform(size=(n, 1, 2)) < 0.5, 0, SIZE) * 256 + rng.integers(-300, 300, (n, 1, 2))
    triangles = center + rng.integers(-500, 501, (n, 3, 2))
    triangles[::2] = triangles[::2] // 128 * 128
    return triangles


def test_nothing_that_covers_a_sample_is_dropped():
    """Triangles and slivers, first as they are, then all of them counter-clockwise while backs are culled."""
    rng = np.random.default_rng(1)
    parts = [random_triangles(rng, 80, SIZE, reach) for reach in (0.6, 1.0, 2.0, 30.0)]
    parts += [slivers(rng, 80, SIZE, reach, 3) for reach in (1, 2, 20, 2**18)]
    parts += [random_triangles(rng, 150, SIZE, 1.2) // 128 * 128, near_borders(rng, 150)]
    triangles = np.concatenate(parts).clip(-LIMIT, LIMIT)
    rows = [np.flatnonzero(coverage(triangle, *SIZE).any(axis=1)) for triangle in triangles]
    for hidden in (0, 1):
        if hidden:
            (ax, ay), (bx, by), (cx, cy) = triangles.transpose(1, 2, 0)
            is_away = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay) > 0
            triangles[is_away] = triangles[is_away][:, ::-1]
        [visible] = find_visible(*columns(triangles), Grid(*SIZE, 4), np.full(len(triangles), hidden, np.int8), SERIAL)
        assert visible.n_culled == 0
        is_kept = np.isin(np.arange(len(triangles)), visible.faces)
        for k in (k for k, here in enumerate(rows) if len(here)):
            assert is_kept[k], f"{triangles[k].tolist()} covers samples and was dropped"
            at = np.searchsorted(visible.faces, k)
            assert visible.first_bands[at] <= rows[k][0] // 4 and rows[k][-1] // 4 <= visible.last_bands[at]
        n = sum(len(here) > 0 for here in rows)
        assert n > 100 and len(triangles) - len(visible.faces) > 50, f"{n} cover samples, {len(visible.faces)} are kept"


def test_passes_do_not_matter():
    triangles = soup(np.random.default_rng(2), 2 * PASS + 8)
    backs = np.ones(len(triangles), np.int8)
    face = expected(triangles, SIZE, 8, backs)[0]
    for n in (0, 1, PASS - 1, PASS, PASS + 1, 2 * PASS + 5):
        [visible] = find_visible(*columns(triangles[:n]), Grid(*SIZE, 8), backs[:n], SERIAL)
        assert visible.faces.tolist() == [k for k in face if k < n], f"{n} triangles"


def test_parts_of_threads_give_the_same_in_order():
    triangles = soup(np.random.default_rng(3), 4 * MIN_PART)
    backs = np.ones(len(triangles), np.int8)
    [serial] = find_visible(*columns(triangles), Grid(*SIZE, 8), backs, SERIAL)
    workers = Workers(3)
    parts = find_visible(*columns(triangles), Grid(*SIZE, 8), backs, workers)
    workers.close()
    assert len(parts) > 2
    for name in ("faces", "first_bands", "last_bands"):
        assert np.concatenate([getattr(part, name) for part in parts]).tobytes() == getattr(serial, name).tobytes()
    assert sum(part.n_culled for part in parts) == serial.n_culled
    assert not differences(sum(part.histogram for part in parts), serial.histogram)


def test_as_many_bands_as_sixteen_bits_count_and_more():
    for height in (65535, 70_001):
        triangle = np.array([[[0, 0], [0, 256 * height], [256, 256 * height]]])
        [visible] = find_visible(*columns(triangle), Grid(1, height, 1), np.zeros(1, np.int8), SERIAL)
        assert visible.first_bands.tolist() == [0] and visible.last_bands.tolist() == [height - 1], height
        assert len(visible.histogram) == height and (visible.histogram == 1).all(), height


# ---------------------------------------------------------------- bands

# Check the sorting into bands against plain Python lists.


def random_parts(rng, n_part, n_face, n_band, most):
    """Visible triangles in parts of random length, ascending, each over up to `most` bands."""
    cuts = np.sort(rng.integers(0, n_face + 1, n_part - 1))
    parts = []
    for faces in np.split(np.arange(n_face) * 3 + 1, cuts):
        first = rng.integers(0, n_band, len(faces))
        last = np.minimum(first + rng.integers(0, most, len(faces)), n_band - 1)
        histogram = np.zeros(n_band, np.int64)
        for a, b in zip(first, last, strict=True):
            histogram[a : b + 1] += 1
        parts.append(
            Visible(faces.astype(np.uint32), first.astype(np.uint16), last.astype(np.uint16), histogram, len(parts))
        )
    return parts


def expected_of_bands(parts, n_band):
    """One list of faces a band."""
    lists = [[] for _ in range(n_band)]
    for part in parts:
        for face, first, last in zip(*(column.tolist() for column in part[:3]), strict=True):
            for band in range(first, last + 1):
                lists[band].append(face)
    return lists


def test_sorts_as_plain_lists_do():
    """Bands hold their triangles in the order of the faces; the parts are left as they are."""
    for n_face, n_band, most, n_part in (
        (0, 3, 1, 1), (1, 1, 1, 2), (500, 1, 1, 7), (500, 13, 13, 1), (500, 13, 13, 2), (60, 900, 99, 7),
    ):  # fmt: skip
        case = f"{n_face} faces, {n_band} bands, {most} each, {n_part} parts"
        parts = random_parts(np.random.default_rng(n_face + n_part), n_part, n_face, n_band, most)
        before = [[np.copy(column) for column in part[:4]] for part in parts]
        lists = [sort_into_bands(part) for part in parts]
        joined = join_lists(lists)
        bands = [joined.faces[start:end].tolist() for start, end in zip(joined.starts, joined.starts[1:], strict=False)]
        assert bands == expected_of_bands(parts, n_band), case
        assert all(band == sorted(band) for band in bands), f"{case}: not in the order of the faces"
        assert joined.faces.dtype == np.uint32 and joined.starts[-1] == len(joined.faces), case
        assert joined.n_visible == sum(len(part.faces) for part in parts), case
        assert joined.n_culled == sum(part.n_culled for part in parts), case
        for part, copies, found in zip(parts, before, lists, strict=True):
            assert all((a == b).all() for a, b in zip(part[:4], copies, strict=True)), f"{case}: the parts have changed"
            assert found.starts[0] == 0 and found.starts[-1] == len(found.faces), case
            assert len(found.starts) == n_band + 1 and found.n_visible == len(part.faces), case


# ---------------------------------------------------------------- outcodes

# Check that no triangle is left out which a map may show.


@pytest.mark.parametrize("shift", [0.0, 1e7])
def test_a_triangle_is_left_out_only_if_it_shows_nothing(shift):
    """Of those left out, no point lies before the light and on the map, to a texel; the order stays."""
    rng, side = np.random.default_rng(4), 32
    middle = rng.normal(size=(600, 1, 3)) * 3
    corners = middle + rng.normal(size=(600, 3, 3)) * rng.choice([0.05, 1, 4], (600, 1, 1))
    origin = rng.normal(size=3) * 0.2 + shift
    positions, faces = corners.reshape(-1, 3) + shift, np.arange(1800, dtype=np.uint32).reshape(600, 3).T
    weights = rng.dirichlet((0.5, 0.5, 0.5), 400)
    points = weights @ (corners + shift - origin)  # (600, 400, 3)
    half, n_out = side / 2, 0
    for forward in CUBE:
        view, projection = _look(origin, forward), Projection(half, half, half, half, True)
        seen = list_seen_faces(positions, np.ascontiguousarray(faces), origin, border_planes(view, projection, side))
        assert np.diff(seen.astype(int)).min() > 0
        is_out = np.ones(600, bool)
        is_out[seen] = False
        depth = points @ view.forward
        with np.errstate(divide="ignore", invalid="ignore"):
            x = half + half * (points @ view.right) / depth
            y = half - half * (points @ view.up) / depth
        shows = (depth > 0) & (x >= -0.9) & (x <= side + 0.9) & (y >= -0.9) & (y <= side + 0.9)
        assert not shows[is_out].any(), f"{shows[is_out].sum()} points of triangles that were left out"
        n_out += is_out.sum()
    assert 1500 < n_out < 3500, f"{n_out} of 3600"


def test_what_is_no_number_is_kept():
    positions = np.outer([np.nan, 1.0, 2.0, -5.0, -6.0, -7.0], [1.0, 0.0, 0.0])
    faces = np.array([[0, 3], [1, 4], [2, 5]], np.uint32)
    planes = np.tile([1.0, 0.0, 0.0], (MAX_PLANES, 1))
    assert list_seen_faces(positions, faces, np.zeros(3), planes).tolist() == [0]
    positions[1:3, 0] = -1.0
    assert list_seen_faces(positions, faces, np.zeros(3), planes).tolist() == [0]
