"""Check the sorting into bands against plain Python lists."""

import numpy as np
import pytest

from rasterizer.pipeline.bands import join_lists, scatter, sort_into_bands
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
        parts.append(
            Visible(faces.astype(np.uint32), first.astype(np.uint16), last.astype(np.uint16), histogram, len(parts))
        )
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


@pytest.mark.parametrize("n_part", [1, 2, 7])
@pytest.mark.parametrize(
    "n_face, n_band, most", [(0, 3, 1), (1, 1, 1), (500, 1, 1), (500, 13, 1), (500, 13, 13), (60, 900, 400)]
)
def test_sorts_as_plain_lists_do(n_face, n_band, most, n_part):
    parts = random_parts(np.random.default_rng(n_face + n_part), n_part, n_face, n_band, most)
    lists = [sort_into_bands(part) for part in parts]
    joined = join_lists(lists)
    bands = [joined.faces[start:end] for start, end in zip(joined.starts[:-1], joined.starts[1:], strict=True)]
    assert [band.tolist() for band in bands] == expected(parts, n_band)
    assert joined.n_visible == sum(len(part.faces) for part in parts) and joined.starts[-1] == len(joined.faces)
    assert joined.n_culled == sum(part.n_culled for part in parts)
    for part, found in zip(parts, lists, strict=True):
        assert found.starts[0] == 0 and found.starts[-1] == len(found.faces) and len(found.starts) == n_band + 1
        assert found.n_visible == len(part.faces)
    assert all((np.diff(band.astype(np.int64)) > 0).all() for band in bands), "in the order of the faces"
    assert all(band.dtype == np.uint32 and band.flags.c_contiguous for band in bands)


def test_threads_do_not_change_a_bit():
    """Threads sort parts side by side: often enough that a race would show."""
    parts = random_parts(np.random.default_rng(5), 16, 4000, 40, 9)
    serial = [lists.faces.tobytes() for lists in map(sort_into_bands, parts)]
    workers = Workers(4)
    for _ in range(30):
        assert [lists.faces.tobytes() for lists in workers.map(sort_into_bands, parts)] == serial
    workers.close()


def test_parts_are_left_as_they_are():
    parts = random_parts(np.random.default_rng(6), 3, 200, 9, 4)
    before = [[np.copy(a) for a in part[:4]] for part in parts]
    for part in parts:
        sort_into_bands(part)
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
