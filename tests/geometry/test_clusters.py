"""Check what clusters of triangles say of them, against plain numpy."""

import numpy as np
from helpers.arrays import differences
from helpers.stages import SERIAL

from rasterizer.geometry import clusters as c
from rasterizer.pipeline.threads import Workers


def mesh_of(n, seed=0):
    """Positions (3, n_vertex) and index columns (3, n) of a rough sheet: neighbours one after the other."""
    rng = np.random.default_rng(seed)
    n_column = 23
    n_row = n // (2 * n_column) + 2
    row, column = np.mgrid[: n_row + 1, : n_column + 1]
    points = np.stack([column.ravel(), row.ravel(), np.zeros(row.size)]) + rng.uniform(-0.3, 0.3, (3, row.size))
    corner = (row * (n_column + 1) + column)[:-1, :-1].ravel()
    upper = np.stack([corner, corner + 1, corner + n_column + 2])
    lower = np.stack([corner, corner + n_column + 2, corner + n_column + 1])
    faces = np.stack([upper, lower], axis=2).reshape(3, -1)[:, :n]
    return points, np.ascontiguousarray(faces, np.uint32)


def test_boxes_cones_heights_and_blocks_hold_all_triangles():
    for n in (1, c.CLUSTER, c.CLUSTER + 1, 5 * c.CLUSTER + 7):
        positions, faces = mesh_of(n)
        found = c.make_clusters(positions, faces, SERIAL)
        assert found.n_face == n and found.shapes.shape == (c.N_SHAPE_ROW, -(-n // c.CLUSTER))
        for k, shape in enumerate(found.shapes.T):
            here = faces[:, k * c.CLUSTER : (k + 1) * c.CLUSTER]
            triangles, case = positions.T[here.T], f"cluster {k} of {n} triangles"
            center, half, axis = (shape[first : first + 3] for first in (c.CENTER, c.HALF_SIZE, c.AXIS))
            assert (np.abs(triangles - center) <= half).all(), case
            assert (half < np.ptp(triangles, axis=(0, 1)) / 2 + 1e-12).all(), case
            normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
            area = np.linalg.norm(normals, axis=1)
            normals /= area[:, None]
            cosine = normals @ axis
            assert abs(np.linalg.norm(axis) - 1.0) < 1e-15, case
            assert 0 <= (cosine - shape[c.COSINE]).min() < 4 * c.DIRECTION_SLACK, case
            assert 0.0 <= shape[c.COSINE] ** 2 + shape[c.SINE] ** 2 - 1.0 < 1e-5, case
            beyond = (normals * (triangles[:, 0] - center)).sum(axis=1)
            assert 0 <= (beyond - shape[c.OFFSET]).min() < 1e-7, case
            longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
            assert 0.0 < shape[c.HEIGHT] <= (area / longest).min() < shape[c.HEIGHT] * (1 + 1e-8), case
            listed = found.blocks[found.block_starts[k] : found.block_starts[k + 1]]
            assert sorted(listed.tolist()) == np.unique(here // c.VERTEX_BLOCK).tolist(), case


def test_where_neighbours_are_scattered_blocks_are_not_told():
    """A hundred blocks a cluster: all vertices are needed anyway."""
    positions, faces = mesh_of(300 * c.CLUSTER)
    faces = faces[:, np.random.default_rng(1).permutation(faces.shape[1])]
    found = c.make_clusters(positions, np.ascontiguousarray(faces), SERIAL)
    assert len(found.blocks) == 0 and not differences(np.isfinite(found.shapes), True)


def test_triangles_without_a_normal_and_corners_that_are_no_numbers_leave_nothing_to_skip():
    positions, faces = mesh_of(3 * c.CLUSTER)
    a, b, corner = faces[:, c.CLUSTER + 5]
    along = positions[:, b] - positions[:, a]
    thin = 0.5 * along + 2.0**-22 * np.linalg.norm(along) * np.array([0.0, 0.0, 1.0])
    for name, offset in (("two corners alike", 0.0 * along), ("collinear", 0.5 * along), ("too thin", thin)):
        moved = positions.copy()
        moved[:, corner] = moved[:, a] + offset
        found = c.make_clusters(moved, faces, SERIAL)
        assert found.shapes[c.HEIGHT, 1] == 0.0 and np.isfinite(found.shapes).all(), name
    for bad in (np.nan, np.inf, 1e200):  # comparisons with NaN are false
        moved = positions.copy()
        moved[1, corner] = bad
        shape = c.make_clusters(moved, faces, SERIAL).shapes[:, 1]
        assert shape[c.HEIGHT] == 0.0 if bad == 1e200 else np.isnan(shape[c.CENTER + 1]), f"{bad}: {shape}"


def test_threads_do_not_change_a_bit():
    positions, faces = mesh_of(1400 * c.CLUSTER + 11)
    workers = Workers(3)
    assert len(workers.ranges(faces.shape[1])) > 1
    serial, parallel = (c.make_clusters(positions, faces, threads) for threads in (SERIAL, workers))
    workers.close()
    for name in ("shapes", "blocks", "block_starts"):
        assert getattr(serial, name).tobytes() == getattr(parallel, name).tobytes(), name
