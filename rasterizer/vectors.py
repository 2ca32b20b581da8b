"""Vector algebra in plain numpy; that of compiled code is geometry/vectors.py."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def dot(a: Any, b: Any) -> Any:
    """Return a·b of vectors that are given by their three components, numbers or arrays; summed from the first to the
    last: equal vectors give equal bits."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Any, b: Any) -> tuple[Any, Any, Any]:
    """Return a × b of vectors that are given by their three components, numbers or arrays; numpy's takes as long as a
    thousand vertices."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def length(vectors: NDArray) -> NDArray[np.float64]:
    """Return the lengths (..., 1) of vectors (..., 3); hypot keeps the squares from over- and underflowing."""
    return np.hypot(np.hypot(vectors[..., :1], vectors[..., 1:2]), vectors[..., 2:])


def unit(vectors: NDArray) -> NDArray[np.float64]:
    """Return vectors (..., 3) at length 1; zero stays zero."""
    size = length(vectors)
    return vectors / np.where(size > 0, size, 1)
