"""Tests of what is asked of the arrays of a mesh: which triangles have an area."""

import numpy as np
import pytest

from rasterizer.errors import ModelError
from rasterizer.scene.mesh_arrays import CHUNK, check_area, has_any_area, has_area

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0), (np.nan, 0, 0), (np.inf, 1, 0)])


@pytest.mark.parametrize("scale", [1e-300, 1e-160, 1.0, 1e150, 1e300])
def test_points_lines_and_corners_that_are_not_finite_have_no_area(scale):
    faces = np.array([(0, 1, 2), (0, 0, 0), (0, 1, 1), (0, 1, 3), (0, 1, 4), (5, 1, 2)])
    assert has_area(CORNERS * scale, faces).tolist() == [True, False, False, False, False, False]


@pytest.mark.parametrize("bend", [0.0, 2.0**-53, 2.0**-45])
def test_a_line_is_straight_within_the_rounding_of_its_products(bend):
    rng = np.random.default_rng(1)
    a, b = rng.uniform(-1, 1, (2, 1000, 3))
    t = rng.uniform(0.1, 0.9, (1000, 1))
    middle = a * (1 - t) + b * t
    normal = np.cross(b - a, rng.uniform(-1, 1, (1000, 3)))
    middle += bend * normal / np.linalg.norm(normal, axis=1, keepdims=True)
    vertices = np.stack([a, b, middle], axis=1).reshape(-1, 3)
    share = has_area(vertices, np.arange(3000).reshape(-1, 3)).mean()
    assert share > 0.9 if bend > 2.0**-50 else share < 0.5, f"{share:.0%} of bent lines have an area"


def test_one_good_face_among_many_is_found():
    faces = np.zeros((CHUNK + 10, 3), np.uint32)
    assert not has_any_area(CORNERS, faces)
    with pytest.raises(ModelError, match=f"every face has zero area: {CHUNK + 10} faces"):
        check_area(CORNERS, faces)
    faces[-1] = 0, 1, 2
    assert has_any_area(CORNERS, faces)
    check_area(CORNERS, faces)


def test_a_small_face_beside_a_huge_one_without_area_counts():
    vertices = np.array([(0, 0, 0), (1e-170, 0, 0), (0, 1e-170, 0), (1e99, 0, 0), (-1e99, 0, 0)])
    assert has_area(vertices, np.array([(0, 1, 2), (0, 3, 4)])).tolist() == [True, False]
