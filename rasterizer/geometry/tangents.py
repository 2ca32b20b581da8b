"""The directions in which the texture coordinate u grows, for materials that are brushed along it."""

import numpy as np
from numpy.typing import NDArray

from ..scene.mesh import Mesh
from .mesh_points import Part, unique_rows
from .normals import within_range


def add_tangents(part: Part, mesh: Mesh, is_flat: bool) -> Part:
    """Give every point of a mesh a tangent: that of its polygon, or the mean of those that share position and normal
    with it.

    A mesh without texture coordinates has none: zero.
    """
    if mesh.uv is None:
        return part._replace(tangents=np.zeros((len(part.points), 3)))
    corners, corner = mesh.vertices[mesh.faces], np.asarray(part.corner)
    group, n_group = corner, len(part.points)
    if not is_flat:
        first, group = unique_rows([corners.reshape(-1, 3), part.normals[corner].reshape(-1, 3)])
        n_group = len(first)
    uv = mesh.uv[mesh.faces] if mesh.uv.ndim == 2 else mesh.uv
    of_groups = compute_tangents(corners, uv, group.reshape(-1, 3), n_group)
    tangents = np.zeros((len(part.points), 3))
    tangents[corner.ravel()] = of_groups[group.ravel()]
    return part._replace(tangents=tangents)


def compute_tangents(corners: NDArray, uv: NDArray, point: NDArray, n_point: int) -> NDArray[np.float64]:
    """Compute the directions in which u grows, at points of a surface: the mean of those of the triangles that meet
    there.

    A triangle's positions are affine in (u, v): with edges e1, e2 that are (a1, b1), (a2, b2) in texture coordinates,
    dP/du = (e1 b2 - e2 b1) / (a1 b2 - a2 b1). Triangles count by their area, as far as their u grows anywhere.

    Parameters
    ----------
    corners : (n_face, 3, 3) float64
    uv : (n_face, 3, 2) float64
    point : (n_face, 3) integers, the points at the corners
    n_point : how many points there are

    Returns
    -------
    (n_point, 3) float64, unit length; zero where nothing is known
    """
    corners = within_range(corners)
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    (a1, b1), (a2, b2) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    along = (e1 * b2[:, None] - e2 * b1[:, None]) * np.sign(a1 * b2 - a2 * b1)[:, None]
    along = _units(along) * np.linalg.norm(np.cross(e1, e2), axis=1)[:, None]
    sums = [np.bincount(point.ravel(), np.repeat(along[:, k], 3), n_point) for k in range(3)]
    return _units(np.stack(sums, axis=1))


def _units(vectors: NDArray) -> NDArray[np.float64]:
    """Return vectors (n, 3) at length 1; zero stays zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0.0, length, 1.0)
