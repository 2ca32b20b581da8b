"""Tangents: along which directions materials are brushed, in plain numpy float64."""

import numpy as np
from numpy.typing import NDArray

from .vectors import area_vectors, length, unit


def face_tangents(corners: NDArray, uv: NDArray) -> NDArray[np.float64]:
    """Return the directions in which u grows on faces, as long as the faces' areas; 0 where it grows nowhere.

    u grows while v stays along the combination of both edges in which the changes of v cancel.

    Parameters
    ----------
    corners : (n_face, 3, 3) float64
    uv : (n_face, 3, 2) float64

    Returns
    -------
    (n_face, 3) float64
    """
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    level_v = e1 * d2[:, 1:] - e2 * d1[:, 1:]
    rise_u = (d1[:, :1] * d2[:, 1:] - d2[:, :1] * d1[:, 1:])[:, 0]
    return unit(level_v) * np.sign(rise_u)[:, None] * length(area_vectors(corners))


def unit_sums(vectors: NDArray, group: NDArray) -> NDArray[np.float64]:
    """Return the sums of the vectors (n, 3) of each group (n,) int, at length 1; zero stays zero."""
    total = np.zeros((int(group.max()) + 1, 3))
    np.add.at(total, group, vectors)
    return unit(total)


def corner_tangents(corners: NDArray, normals: NDArray, uv: NDArray) -> NDArray[np.float64]:
    """Return the tangents at the corners of a mesh: the mean over the faces that share position and normal there,
    (n_face, 3, 3)."""
    rows = np.concatenate([corners.reshape(-1, 3), normals.reshape(-1, 3)], axis=1)
    group = np.unique(rows + 0.0, axis=0, return_inverse=True)[1].ravel()
    return unit_sums(np.repeat(face_tangents(corners, uv), 3, axis=0), group)[group].reshape(-1, 3, 3)
