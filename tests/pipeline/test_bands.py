"""Check the sorting into bands against plain Python lists."""

import numpy as np
import pytest
from helpers.stages import SERIAL

from rasterizer.pipeline.bands import scatter, sort_into_bands
from rasterizer.pipeline.cull import Visible
from rasterizer.pipeline.threads import Workers


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
        parts.append(Visible(faces.astype(np.uint32), first.astype(np.uint16), last.astype(np.uint16), histogram, 0))
    return parts


def expected(parts, n_band):
    """One list of faces a band."""
    lists = [[] for _ in range(n_band)]
    for part in parts:
        for face, first, last in zip(
            part.faces.tolist(), part.first_bands.tolist(), part.last_bands.tolist(), strict=True
        ):
            for band in range(first, last + 1):
                lists[band].append(face)
    return lists


@pytest.mark.parametrize("n_thread", [1, 3])
@pytest.mark.parametrize("n_part", [1, 2, 7])
@pytest.mark.parametrize(
    "n_face, n_band, most", [(0, 3, 1), (1, 1, 1), (500, 1, 1), (500, 13, 1), (500, 13, 13), (60, 900, 400)]
)
def test_sorts_as_plain_lists_do(n_face, n_band, most, n_part, n_thread):
    parts = random_parts(np.random.default_rng(n_face + n_part), n_part, n_face, n_band, most)
    workers = SERIAL if n_thread == 1 else Workers(n_thread)
    bands = sort_into_bands(parts, workers)
    workers.close()
    lists = expected(parts, n_band)
    assert [bands.faces[a:b].tolist() for a, b in zip(bands.starts[:-1], bands.starts[1:], strict=True)] == lists
    assert bands.starts[0] == 0 and bands.starts[-1] == len(bands.faces) and len(bands.starts) == n_band + 1
    assert all(faces == sorted(faces) for faces in lists), "order within a band is the order of the faces"


def test_threads_do_not_change_a_bit():
    """Parts write side by side into one array: often enough that a race would show."""
    parts = random_parts(np.random.default_rng(5), 16, 4000, 40, 9)
    serial = sort_into_bands(parts, SERIAL)
    workers = Workers(4)
    for _ in range(30):
        assert sort_into_bands(parts, workers).faces.tobytes() == serial.faces.tobytes()
    workers.close()


def test_parts_are_left_as_they_are():
    parts = random_parts(np.random.default_rng(6), 3, 200, 9, 4)
    before = [[np.copy(a) for a in part[:4]] for part in parts]
    sort_into_bands(parts, SERIAL)
    for part, copies in zip(parts, before, strict=True):
        assert all((a == b).all() for a, b in zip(part[:4], copies, strict=True))


def test_without_the_compiler_the_same_comes_out():
    [part] = random_parts(np.random.default_rng(7), 1, 50, 6, 3)
    results = []
    for function in (scatter, scatter.py_func):
        cursor, out = np.cumsum(part.histogram) - part.histogram, np.zeros(part.histogram.sum(), np.uint32)
        function(part.faces, part.first_bands, part.last_bands, cursor, out)
        results.append((cursor.tolist(), out.tolist()))
    assert results[0] == results[1]
    assert results[0][0] == np.cumsum(part.histogram).tolist()
