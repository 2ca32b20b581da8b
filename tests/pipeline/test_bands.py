"""Check the sorting into bands against plain Python lists."""

import numpy as np

from rasterizer.pipeline.cull import Visible, join_lists, sort_into_bands


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
        assert bands == expected(parts, n_band), case
        assert all(band == sorted(band) for band in bands), f"{case}: not in the order of the faces"
        assert joined.faces.dtype == np.uint32 and joined.starts[-1] == len(joined.faces), case
        assert joined.n_visible == sum(len(part.faces) for part in parts), case
        assert joined.n_culled == sum(part.n_culled for part in parts), case
        for part, copies, found in zip(parts, before, lists, strict=True):
            assert all((a == b).all() for a, b in zip(part[:4], copies, strict=True)), f"{case}: the parts have changed"
            assert found.starts[0] == 0 and found.starts[-1] == len(found.faces), case
            assert len(found.starts) == n_band + 1 and found.n_visible == len(part.faces), case
