"""What is measured of the triangles of a scene once, before anything is drawn: kernels over faces and points.

    flag_inverted           do a triangle's normals look against its winding?
    compute_shapes          which plane is a triangle in, and how long is its longest side?
    compute_normal_offsets  how far are points moved along their normals, so that their own faces don't shadow them?

Positions, points and normals are rows, (n, 3); vertex and corner are columns, (3, n_face).
"""

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import kernel
from .vectors import add, cross, dot, length, scale, subtract, vector_of_row

_MIN_AGREEMENT = 2.0**-40  # of three corner normals with their triangle's, times its length


@kernel
def flag_inverted(positions, normals, vertex, corner, part, out_is_inverted):
    """Flag the triangles of a part whose corner normals look, on the whole, against their winding.

    Normals at right angles to the triangle, to within 2^-40, agree with it: which way they look is no rounding's to
    decide.

    Parameters
    ----------
    positions : (n_vertex, 3) float64
    normals : (n_point, 3) float64
    vertex, corner : (3, n_face) uint32
    part : (start, end) of the triangles
    out_is_inverted : (n_face,) uint8, 1 where they look against it
    """
    for face in range(part[0], part[1]):
        i, j, k = vertex[0, face], vertex[1, face], vertex[2, face]
        a = vector_of_row(positions, i)
        e1, e2 = subtract(vector_of_row(positions, j), a), subtract(vector_of_row(positions, k), a)
        i, j, k = corner[0, face], corner[1, face], corner[2, face]
        n = add(add(vector_of_row(normals, i), vector_of_row(normals, j)), vector_of_row(normals, k))
        area = cross(e1, e2)
        agreement = dot(n, area)
        out_is_inverted[face] = agreement < -_MIN_AGREEMENT * (abs(area[0]) + abs(area[1]) + abs(area[2]))


@kernel
def compute_shapes(positions, vertex, out_shape):
    """Compute what shadows need of every triangle: its plane, and its longest side.

    Parameters
    ----------
    positions : (n, 3) float64
    vertex : (3, n_face) uint32
    out_shape : (n_face, 5) float64: unit normal n, n·P of the plane, and the length of that side, scene units
    """
    for face in range(vertex.shape[1]):
        i, j, k = vertex[0, face], vertex[1, face], vertex[2, face]
        a, b, c = vector_of_row(positions, i), vector_of_row(positions, j), vector_of_row(positions, k)
        area = cross(subtract(b, a), subtract(c, a))
        size = length(area)
        inv_size = 1.0 / size if size > 0.0 else 0.0
        out_shape[face, 0], out_shape[face, 1], out_shape[face, 2] = scale(area, inv_size)
        out_shape[face, 3] = dot(area, a) * inv_size
        out_shape[face, 4] = max(length(subtract(b, a)), length(subtract(c, b)), length(subtract(a, c)))


def compute_normal_offsets(geometry, is_flat: bool) -> NDArray[np.float64]:
    """Compute how far points are moved along their normals for shadows, (2, n_point) float64, scene units: where they
    are seen from the side of their normals, and where from the other side.

    A vertex is moved as far as the corners of the triangles about it lie above its tangent plane: on a convex surface
    not at all. The centroid of a polygon is moved as far as the polygon's corners lie above its plane.
    """
    offsets = np.zeros((2, len(geometry.points)))
    for k, corner in enumerate(geometry.corner):
        start, normal = geometry.points[corner], geometry.normals[corner]
        for vertex in geometry.vertex[[k]] if is_flat else geometry.vertex:
            height = dot((geometry.positions[vertex] - start).T, normal.T)
            np.maximum.at(offsets[0], corner, height)
            np.maximum.at(offsets[1], corner, -height)
    return offsets
