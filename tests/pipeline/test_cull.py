"""Check which triangles the cull stage drops, against plain Python and against what they cover."""

import numpy as np
import pytest
from helpers.stages import SERIAL, random_triangles, slivers

from rasterizer.engine.shadow_maps import CUBE, _look, border_planes
from rasterizer.pipeline.cull import (
    Grid,
    find_visible,
    list_seen_faces,
)
from rasterizer.pipeline.transform import PixelWidth, Vertices
from rasterizer.reference import coverage
from rasterizer.scene.camera import Projection

SIZE = (37, 29)
LIMIT = 2**28


def columns(triangles):
    """The input of the stage: index columns and Vertices, which no two triangles share."""
    index = np.arange(3 * len(triangles), dtype=np.uint32).reshape(-1, 3)
    x, y = (np.ascontiguousarray(triangles[..., k].ravel().astype(np.int32)) for k in range(2))
    return np.ascontiguousarray(index.T), Vertices(x, y, *np.zeros((3, len(x))), PixelWidth(0.0, 0.0, 0.0))


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
