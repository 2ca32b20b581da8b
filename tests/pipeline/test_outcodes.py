"""Check that no triangle is left out which a map may show."""

import numpy as np
import pytest

from rasterizer.engine.shadow_maps import CUBE, _look, border_planes
from rasterizer.pipeline.cull import MAX_PLANES, list_seen_faces
from rasterizer.scene.camera import Projection


@pytest.mark.parametrize("shift", [0.0, 1e7])
def test_a_triangle_is_left_out_only_if_it_shows_nothing(shift):
    """Of those left out, no point lies before the light and on the map, to a texel; the order stays."""
    rng, side = np.random.default_rng(4), 32
    middle = rng.normal(size=(600, 1, 3)) * 3
    corners = middle + rng.normal(size=(600, 3, 3)) * rng.choice([0.05, 1, 4], (600, 1, 1))
    origin = rng.normal(size=3) * 0.2 + shift
    positions, faces = (corners.reshape(-1, 3) + shift).T.copy(), np.arange(1800, dtype=np.uint32).reshape(600, 3).T
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
    positions = np.array([[np.nan, 1.0, 2.0, -5.0, -6.0, -7.0], np.zeros(6), np.zeros(6)])
    faces = np.array([[0, 3], [1, 4], [2, 5]], np.uint32)
    planes = np.tile([1.0, 0.0, 0.0], (MAX_PLANES, 1))
    assert list_seen_faces(positions, faces, np.zeros(3), planes).tolist() == [0]
    positions[0, 1:3] = -1.0
    assert list_seen_faces(positions, faces, np.zeros(3), planes).tolist() == [0]
