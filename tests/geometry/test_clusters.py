"""Check what clusters of triangles say of them, against plain numpy."""

import numpy as np
import pytest
from helpers.stages import SERIAL

from bench.scenes import uv_sphere
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


def triangles_of(positions, faces, k):
    """The corners (n, 3, 3) of the triangles of cluster k."""
    return positions.T[faces.T[k * c.CLUSTER : (k + 1) * c.CLUSTER]]


def normals_of(triangles):
    """Normals (n, 3), as long as twice the area."""
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


@pytest.mark.parametrize("n", [1, c.CLUSTER - 1, c.CLUSTER, c.CLUSTER + 1, 5 * c.CLUSTER + 7])
def test_boxes_cones_and_heights_hold_all_triangles(n):
    positions, faces = mesh_of(n)
    found = c.make_clusters(positions, faces, SERIAL)
    assert found.n_face == n and found.shapes.shape == (c.N_SHAPE_ROW, -(-n // c.CLUSTER))
    for k, shape in enumerate(found.shapes.T):
        triangles = triangles_of(positions, faces, k)
        center, half, axis = (shape[first : first + 3] for first in (c.CENTER, c.HALF_SIZE, c.AXIS))
        assert (np.abs(triangles - center) <= half).all() and (half < np.ptp(triangles, axis=(0, 1)) / 2 + 1e-12).all()
        normals = normals_of(triangles)
        area = np.linalg.norm(normals, axis=1)
        normals /= area[:, None]
        cosine = normals @ axis
        assert abs(np.linalg.norm(axis) - 1.0) < 1e-15
        assert (cosine >= shape[c.COSINE]).all() and cosine.min() - shape[c.COSINE] < 4 * c.DIRECTION_SLACK
        assert 0.0 <= shape[c.COSINE] ** 2 + shape[c.SINE] ** 2 - 1.0 < 1e-5
        beyond = (normals * (triangles[:, 0] - center)).sum(axis=1)
        assert (beyond >= shape[c.OFFSET]).all() and beyond.min() - shape[c.OFFSET] < 1e-7
        longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
        assert 0.0 < shape[c.HEIGHT] <= (area / longest).min() < shape[c.HEIGHT] * (1 + 1e-8)


def test_blocks_are_those_that_a_cluster_uses_each_once():
    positions, faces = mesh_of(40 * c.CLUSTER + 3)
    found = c.make_clusters(positions, faces, SERIAL)
    for k in range(found.shapes.shape[1]):
        listed = found.blocks[found.block_starts[k] : found.block_starts[k + 1]]
        used = np.unique(faces[:, k * c.CLUSTER : (k + 1) * c.CLUSTER] // c.VERTEX_BLOCK)
        assert sorted(listed.tolist()) == used.tolist()


def test_where_neighbours_are_scattered_blocks_are_not_told():
    """A hundred blocks a cluster: all vertices are needed anyway."""
    positions, faces = mesh_of(600 * c.CLUSTER)
    faces = faces[:, np.random.default_rng(1).permutation(faces.shape[1])]
    found = c.make_clusters(positions, np.ascontiguousarray(faces), SERIAL)
    assert len(found.blocks) == 0 and np.isfinite(found.shapes).all()
    for k, shape in enumerate(found.shapes.T):  # all are described nevertheless
        corners = triangles_of(positions, faces, k).reshape(-1, 3)
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        assert np.abs(shape[c.CENTER : c.CENTER + 3] - middle).max() < 1e-9, k


@pytest.mark.parametrize("kind", ["two corners alike", "collinear", "too thin"])
def test_a_triangle_without_a_normal_leaves_its_cone_without_use(kind):
    positions, faces = mesh_of(3 * c.CLUSTER)
    a, b, third = faces[:, c.CLUSTER + 5]
    along = positions[:, b] - positions[:, a]
    positions[:, third] = (
        positions[:, a]
        + {
            "two corners alike": 0.0 * along,
            "collinear": 0.5 * along,
            "too thin": 0.5 * along + 2.0**-22 * np.linalg.norm(along) * np.array([0.0, 0.0, 1.0]),
        }[kind]
    )
    found = c.make_clusters(positions, faces, SERIAL)
    assert found.shapes[c.HEIGHT, 1] == 0.0 and np.isfinite(found.shapes).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_corner_that_is_no_number_leaves_no_box(bad):
    """Comparisons with NaN are false, so nothing of such a cluster is skipped."""
    positions, faces = mesh_of(3 * c.CLUSTER)
    positions[1, faces[2, c.CLUSTER + 5]] = bad
    assert np.isnan(c.make_clusters(positions, faces, SERIAL).shapes[c.CENTER + 1, 1])


def test_squares_that_overflow_leave_a_cone_without_use():
    positions, faces = mesh_of(3 * c.CLUSTER)
    positions[1, faces[2, c.CLUSTER + 5]] = 1e200
    assert c.make_clusters(positions, faces, SERIAL).shapes[c.HEIGHT, 1] == 0.0


def test_threads_and_the_compiler_do_not_change_a_bit():
    positions, faces = mesh_of(1400 * c.CLUSTER + 11)
    serial = c.make_clusters(positions, faces, SERIAL)
    workers = Workers(3)
    assert len(workers.ranges(faces.shape[1])) > 1
    parallel = c.make_clusters(positions, faces, workers)
    workers.close()
    assert serial.shapes.tobytes() == parallel.shapes.tobytes()
    assert serial.blocks.tobytes() == parallel.blocks.tobytes()
    assert serial.block_starts.tobytes() == parallel.block_starts.tobytes()
    few = 2
    scratch = c.ClusterScratch(
        np.zeros(c.N_ROW * c.CLUSTER), np.zeros(positions.shape[1] // c.VERTEX_BLOCK + 1, np.int64)
    )
    shapes, counts, blocks = np.empty((c.N_SHAPE_ROW, few)), np.empty(few, np.int64), np.empty(1000, np.uint32)
    n = c.describe_clusters.py_func(0, few, positions, faces, scratch, shapes, counts, blocks)
    # Compiled code may keep more digits of a sum of products.
    assert np.abs(shapes - serial.shapes[:, :few]).max() < 1e-12
    assert blocks[:n].tolist() == serial.blocks[:n].tolist() and counts.sum() == n


def test_only_scenes_with_many_triangles_have_clusters():
    assert not c.has_clusters(c.LEAST_FACES - 1)
    assert c.has_clusters(c.LEAST_FACES)


def test_a_dense_sphere_has_narrow_cones():
    """Half angles of a few degrees: what is gained rests on that."""
    vertices, faces = uv_sphere(64, 96)
    positions, columns = np.ascontiguousarray(np.array(vertices, float).T), np.ascontiguousarray(faces.T, np.uint32)
    found = c.make_clusters(positions, columns, SERIAL)
    assert np.median(found.shapes[c.COSINE]) > 0.5
