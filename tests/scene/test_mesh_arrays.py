"""What is asked of arrays as callers give them, and of those of a mesh: which triangles have an area."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer.errors import ModelError
from rasterizer.scene.arrays import distinct, plain_array
from rasterizer.scene.mesh import Mesh
from rasterizer.scene.mesh_arrays import CHUNK, has_any_area, has_area

MASKED = np.ma.array([1.0, 2.0], mask=[False, True])
UNMASKED = np.ma.array([1.0, 2.0])
CORNERS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0), (np.nan, 0, 0), (np.inf, 1, 0)])


@settings(max_examples=30)
@given(st.lists(st.integers(-5, 5)))
def test_distinct_numbers_are_those_of_numpy(numbers):
    array = np.array(numbers, np.int64)
    assert distinct(array).tolist() == np.unique(array).tolist()


def test_masked_values_are_refused_and_masks_that_hide_nothing_are_not():
    with pytest.raises(ValueError, match="masked"):
        plain_array(MASKED)
    assert type(plain_array(UNMASKED)) is np.ndarray


def test_points_lines_and_corners_that_are_not_finite_have_no_area():
    faces = np.array([(0, 1, 2), (0, 0, 0), (0, 1, 1), (0, 1, 3), (0, 1, 4), (5, 1, 2)])
    for scale in (1e-300, 1e-160, 1.0, 1e150, 1e300):
        assert has_area(CORNERS * scale, faces).tolist() == [True, False, False, False, False, False], scale


def test_a_line_is_straight_within_the_rounding_of_its_products():
    rng = np.random.default_rng(1)
    a, b = rng.uniform(-1, 1, (2, 1000, 3))
    t = rng.uniform(0.1, 0.9, (1000, 1))
    normal = np.cross(b - a, rng.uniform(-1, 1, (1000, 3)))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    for bend, least, most in ((0.0, 0, 0.5), (2.0**-53, 0, 0.5), (2.0**-45, 0.9, 1)):
        vertices = np.stack([a, b, a * (1 - t) + b * t + bend * normal], axis=1).reshape(-1, 3)
        share = has_area(vertices, np.arange(3000).reshape(-1, 3)).mean()
        assert least <= share <= most, f"{share:.0%} of lines that are bent by {bend:g} have an area"


def test_one_good_face_among_many_is_found():
    faces = np.zeros((CHUNK + 10, 3), np.uint32)
    assert not has_any_area(CORNERS, faces)
    with pytest.raises(ModelError, match=f"every face has zero area: {CHUNK + 10} faces"):
        Mesh(CORNERS[:3], faces)
    faces[-1] = 0, 1, 2
    assert has_any_area(CORNERS, faces)


def test_a_small_face_beside_a_huge_one_without_area_counts():
    vertices = np.array([(0, 0, 0), (1e-170, 0, 0), (0, 1e-170, 0), (1e99, 0, 0), (-1e99, 0, 0)])
    assert has_area(vertices, np.array([(0, 1, 2), (0, 3, 4)])).tolist() == [True, False]
