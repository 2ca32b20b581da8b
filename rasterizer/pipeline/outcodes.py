"""Outcodes: which triangles can't be seen in a view, because all their vertices lie beyond the same of its planes.

In:  positions and triangles, and planes through the eye.
Out: the triangles that may be seen, in order.

Source: the outcodes of Cohen & Sutherland; Newman & Sproull 1973, "Principles of Interactive Computer Graphics".
"""

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import index, kernel
from ..geometry.vectors import dot, subtract, vector_of_column

MOST_PLANES = 8  # bits of an outcode


def list_seen_faces(positions: NDArray, vertex_idx: NDArray, eye: NDArray, planes: NDArray) -> NDArray[np.uint32]:
    """Find the triangles that don't lie beyond one plane as a whole, (n,) indices in order.

    Parameters
    ----------
    positions : (3, n_vertex) float64, world space, scene units
    vertex_idx : (3, n_face) uint32
    eye : (3,) float64, world space, on all planes
    planes : (n_plane, 3) float64, up to MOST_PLANES normals; a point is beyond where n·(P - eye) < 0, and never where
        that is no number
    """
    outcodes = np.empty(positions.shape[1], np.uint8)
    compute_outcodes(positions, eye, planes, outcodes)
    faces = np.empty(vertex_idx.shape[1], np.uint32)
    return faces[: list_seen(vertex_idx, outcodes, faces)]


@kernel
def compute_outcodes(positions, eye, planes, out_outcodes):
    """Compute a bit for each plane that a vertex lies beyond.

    Parameters
    ----------
    out_outcodes : (n_vertex,) uint8
    """
    origin = eye[0], eye[1], eye[2]
    for k in range(index(len(out_outcodes))):
        away = subtract(vector_of_column(positions, k), origin)
        outcode = np.int64(0)
        for plane in range(index(len(planes))):
            is_beyond = dot((planes[plane, 0], planes[plane, 1], planes[plane, 2]), away) < 0.0
            outcode |= np.int64(is_beyond) << np.int64(plane)
        out_outcodes[k] = outcode


@kernel
def list_seen(vertex_idx, outcodes, out_faces):
    """List the triangles whose vertices have no bit in common; return how many they are.

    Parameters
    ----------
    outcodes : (n_vertex,) uint8
    out_faces : (n_face,) uint32
    """
    n = index(0)
    for face in range(index(vertex_idx.shape[1])):
        first, second, third = vertex_idx[0, face], vertex_idx[1, face], vertex_idx[2, face]
        out_faces[n] = face
        n += index((outcodes[first] & outcodes[second] & outcodes[third]) == 0)
    return np.int64(n)
