"""What is asked of arrays as callers give them, and of those of a mesh: which triangles have an area."""

import numpy as np
import pytest

from rasterizer.scene.arrays import plain_array
from rasterizer.scene.mesh_arrays import has_area

MASKED = np.ma.array([1.0, 2.0], mask=[False, True])
UNMASKED = np.ma.array([1.0, 2.0])


def test_masked_values_are_refused_and_masks_that_hide_nothing_are_not():
    with pytest.raises(ValueError, match="masked"):
        plain_array(MASKED)
    assert type(plain_array(UNMASKED)) is np.ndarray


def test_a_small_face_beside_a_huge_one_without_area_counts():
    vertices = np.array([(0, 0, 0), (1e-170, 0, 0), (0, 1e-170, 0), (1e99, 0, 0), (-1e99, 0, 0)])
    assert has_area(vertices, np.array([(0, 1, 2), (0, 3, 4)])).tolist() == [True, False]
