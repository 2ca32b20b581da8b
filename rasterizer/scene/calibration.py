"""Read where a camera is as others write it: OpenCV's calibration K, R, t, and the 4 × 4 pose of graphics programs."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..choices import POSE_FRAMES
from ..errors import SceneError, shown
from .arrays import plain_array
from .validate import choice


def read_calibration(
    K: ArrayLike, R: ArrayLike, t: ArrayLike
) -> tuple[tuple[float, float, float, float, float], NDArray[np.float64], NDArray[np.float64]]:
    """Check a calibration x_cam = R x_world + t, in a frame with x right, y down, z forward.

    Parameters
    ----------
    K : (3, 3) [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] in pixels
    R : (3, 3) rotation from world to camera
    t : (3,) or (3, 1), scene units

    Returns
    -------
    (fx, fy, cx, cy, skew) in pixels, the rotation (3, 3) nearest to R, and t (3,)

    Raises
    ------
    SceneError : shapes, values that are not finite, another form of K, a matrix R that is no rotation
    """
    K, R = _checked_matrix(K, (3, 3), "K"), _checked_matrix(R, (3, 3), "R")
    t = _checked_matrix(np.ravel(t) if _is_column(t) else t, (3,), "t")
    (fx, skew, cx), (_, fy, cy), _ = K.tolist()
    ideal = np.array([[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    if np.abs(K - ideal).max() > 1e-9 * max(abs(fx), 1.0):
        raise SceneError(f"K must be [[fx, skew, cx], [0, fy, cy], [0, 0, 1]]; given {shown(K.tolist())}")
    return (fx, fy, cx, cy, skew), _nearest_rotation(R, "R"), t


def read_pose(pose: ArrayLike, frame: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Check a pose: x_world = R x_cam + eye.

    Parameters
    ----------
    pose : (4, 4) world-from-camera
    frame : "opengl" (x right, y up, looking down -z) or "opencv" (x right, y down, looking down +z)

    Returns
    -------
    the rotation (3, 3) nearest to R, from the frame of "opengl", and the eye (3,), scene units

    Raises
    ------
    SceneError : another shape, values that are not finite, a matrix that isn't affine, scales or mirrors
    """
    choice(frame, POSE_FRAMES, "the pose's frame")
    matrix = _checked_matrix(pose, (4, 4), "the pose")
    if (matrix[3] != (0.0, 0.0, 0.0, 1.0)).any():
        raise SceneError(f"the pose's last row must be (0, 0, 0, 1); given {shown(matrix[3].tolist())}")
    rotation = _nearest_rotation(matrix[:3, :3], "the pose's upper left (3, 3)")
    return rotation * (1.0, -1.0, -1.0) if frame == "opencv" else rotation, matrix[:3, 3]


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


def _nearest_rotation(matrix: NDArray[np.float64], what: str) -> NDArray[np.float64]:
    """Return the rotation nearest to a matrix that is one up to a few digits.

    Source: Schönemann 1966, Psychometrika 31, 1-10: U Vᵀ of the singular value decomposition.
    """
    u, stretch, vt = np.linalg.svd(matrix)
    rotation = u @ vt
    if np.abs(stretch - 1.0).max() > 1e-3 or np.linalg.det(rotation) < 0.0:
        raise SceneError(
            f"{what} must be a rotation (perpendicular unit rows, determinant 1); given {shown(matrix.tolist())}"
        )
    return rotation
