"""Vector algebra over arrays of vectors in float64, beside that of rasterizer/vectors.py."""

import numpy as np
from numpy.typing import NDArray


def dot(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """Return the dot products over the last axis, added in one fixed order: equal vectors give equal bits."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def blend(weights: NDArray, corner_values: NDArray) -> NDArray[np.float64]:
    """Return the weighted sums (n, k) of the values at three corners (n, 3, k), with weights (n, 3)."""
    return np.einsum("sc,scv->sv", weights, corner_values)


def area_vectors(corners: NDArray) -> NDArray[np.float64]:
    """Return vectors (n, 3) about which triangles (n, 3, 3) turn counter-clockwise, twice as long as their areas."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
