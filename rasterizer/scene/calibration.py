"""Read a camera's calibration as OpenCV writes it: intrinsics K, rotation R and translation t."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError, shown
from .arrays import plain_array


def read_calibration(
    K: ArrayLike, R: ArrayLike, t: ArrayLike
) -> tuple[tuple[float, float, float, float], NDArray[np.float64], NDArray[np.float64]]:
    """Check a calibration x_cam = R x_world + t, in a frame with x right, y down, z forward.

    Parameters
    ----------
    K : (3, 3) [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels, without skew
    R : (3, 3) rotation from world to camera
    t : (3,) or (3, 1), scene units

    Returns
    -------
    (fx, fy, cx, cy) in pixels, the rotation (3, 3) nearest to R, and t (3,)

    Raises
    ------
    SceneError : shapes, values that are not finite, skew, a matrix R that is no rotation
    """
    K, R = _checked_matrix(K, (3, 3), "K"), _checked_matrix(R, (3, 3), "R")
    t = _checked_matrix(np.ravel(t) if _is_column(t) else t, (3,), "t")
    fx, fy, cx, cy = K[0, 0], K[1, 1], K[0, 2], K[1, 2]
    ideal = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    if np.abs(K - ideal).max() > 1e-9 * max(abs(fx), 1.0):
        raise SceneError(f"K must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] without skew; given {shown(K.tolist())}")
    return (fx, fy, cx, cy), _nearest_rotation(R), t


def _is_column(value: Any) -> bool:
    """Tell whether a value is (3, 1), as OpenCV writes vectors."""
    try:
        return [len(each) for each in value] == [1, 1, 1]
    except TypeError:
        return False


def _checked_matrix(value: ArrayLike, shape: tuple[int, ...], what: str) -> NDArray[np.float64]:
    """Return a finite float64 array of the given shape."""
    try:
        matrix = plain_array(value)
        matrix = matrix.astype(np.float64) if matrix.dtype.kind in "fiu" else np.empty(0)
    except (TypeError, ValueError):
        matrix = np.empty(0)
    if matrix.shape != shape or not np.isfinite(matrix).all():
        raise SceneError(f"{what} must be finite numbers of the shape {shape}; given {shown(value)}")
    return matrix


def _nearest_rotation(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation nearest to a matrix that is one up to a few digits.

    Source: Schönemann 1966, Psychometrika 31, 1-10: U Vᵀ of the singular value decomposition.
    """
    u, stretch, vt = np.linalg.svd(matrix)
    rotation = u @ vt
    if np.abs(stretch - 1.0).max() > 1e-3 or np.linalg.det(rotation) < 0.0:
        raise SceneError(
            f"R must be a rotation (perpendicular unit rows, determinant 1); given {shown(matrix.tolist())}"
        )
    return rotation
