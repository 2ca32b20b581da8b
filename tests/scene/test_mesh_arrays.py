"""What is asked of arrays as callers give them, and of those of a mesh: which triangles have an area."""

import numpy as np

from rasterizer.scene.mesh_arrays import has_area


def test_a_small_face_beside_a_huge_one_without_area_counts():
    vertices = np.array([(0, 0, 0), (1e-170, 0, 0), (0, 1e-170, 0), (1e99, 0, 0), (-1e99, 0, 0)])
    assert has_area(vertices, np.array([(0, 1, 2), (0, 3, 4)])).tolist() == [True, False]
