"""What is measured of the triangles of a scene once, before anything is drawn: kernels over faces and points.

    flag_inverted           do a triangle's normals look against its winding?
    compute_clearance       how near does the surface come to a point, such as a light or the eye?
    find_shortest_normal    how short can an interpolated normal become?
    compute_shapes          which plane is a triangle in, and how long is its longest side?
    compute_normal_offsets  how far are points moved along their normals, so that their own faces don't shadow them?

Positions, points and normals are rows, (n, 3); vertex and corner are columns, (3, n_face).
"""

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import helper, kernel
from .vectors import add, cross, divide, dot, largest_component, length, scale, subtract, vector_of_row

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
    for face in range(np.uint64(part[0]), np.uint64(part[1])):
        i, j, k = vertex[0, face], vertex[1, face], vertex[2, face]
        a = vector_of_row(positions, i)
        e1, e2 = subtract(vector_of_row(positions, j), a), subtract(vector_of_row(positions, k), a)
        i, j, k = corner[0, face], corner[1, face], corner[2, face]
        n = add(add(vector_of_row(normals, i), vector_of_row(normals, j)), vector_of_row(normals, k))
        area = cross(e1, e2)
        agreement = dot(n, area)
        out_is_inverted[face] = agreement < -_MIN_AGREEMENT * (abs(area[0]) + abs(area[1]) + abs(area[2]))


@kernel
def compute_clearance(positions, vertex, x, y, z):
    """Find the distance from a point to the nearest triangle; at least 0.

    Triangles whose sphere about the centroid is further away than one that was found already are left out.

    Parameters
    ----------
    positions : (n, 3) float64, scene units
    vertex : (3, n_face) uint32
    x, y, z : the point
    """
    least = np.inf
    point = (x, y, z)
    for face in range(np.uint64(vertex.shape[1])):
        i, j, k = vertex[0, face], vertex[1, face], vertex[2, face]
        a, b, c = vector_of_row(positions, i), vector_of_row(positions, j), vector_of_row(positions, k)
        center = divide(add(add(a, b), c), 3.0)
        from_a, from_b, from_c = subtract(a, center), subtract(b, center), subtract(c, center)
        square = max(max(max(0.0, dot(from_a, from_a)), dot(from_b, from_b)), dot(from_c, from_c))
        if length(subtract(point, center)) - np.sqrt(square) < least:
            least = min(least, triangle_distance(subtract(a, point), subtract(b, point), subtract(c, point)))
    return max(least, 0.0)


@kernel
def compute_point_clearance(points, x, y, z):
    """Find the distance from the point x, y, z to the nearest of points (n, 3)."""
    least = np.inf
    for k in range(np.uint64(len(points))):
        away = subtract(vector_of_row(points, k), (x, y, z))
        least = min(least, dot(away, away))
    return np.sqrt(least)


@kernel
def find_shortest_normal(normals, corner):
    """Find the least length that a mean of a triangle's corner normals can have, whatever its weights: the distance of
    the triangle that the normals are the corners of from the origin.

    Corners without a normal don't count: a mean is shorter there, and so is its error. 1 where there are no normals.

    Parameters
    ----------
    normals : (n, 3) float64, unit length or zero
    corner : (3, n_face) uint32
    """
    least = 1.0
    for face in range(np.uint64(corner.shape[1])):
        i, j, k = corner[0, face], corner[1, face], corner[2, face]
        a, b, c = vector_of_row(normals, i), vector_of_row(normals, j), vector_of_row(normals, k)
        # A cheap test first: with the least cosine c > 0 nothing is shorter than √((1 + 2 c)/3), see
        # pipeline/records.py.
        cosine = min(dot(a, b), dot(b, c), dot(c, a))
        if cosine > 0.0 and (1.0 + 2.0 * cosine) / 3.0 >= least * least:
            continue
        a_is, b_is, c_is = dot(a, a) > 0.0, dot(b, b) > 0.0, dot(c, c) > 0.0
        a = a if a_is else (b if b_is else c)
        b = b if b_is else a
        c = c if c_is else a
        if a_is or b_is or c_is:
            least = min(least, triangle_distance(a, b, c))
    return least


@helper
def segment_distance(a, b):
    """Return the distance of the segment a-b from the origin."""
    d = subtract(b, a)
    square = dot(d, d)
    t = min(max(-dot(a, d) / square, 0.0), 1.0) if square > 0.0 else 0.0
    return length(add(a, scale(d, t)))


@helper
def triangle_distance(a, b, c):
    """Return the distance of the triangle a-b-c from the origin: that of its plane, if the foot lies inside, else of
    its nearest side.

    In units of the largest coordinate, so that the fourth powers neither over- nor underflow.
    """
    unit = max(largest_component(a), largest_component(b), largest_component(c))
    if unit == 0.0:
        return 0.0
    a, b, c = divide(a, unit), divide(b, unit), divide(c, unit)
    u, v = subtract(b, a), subtract(c, a)
    normal = cross(u, v)
    square = dot(normal, normal)
    least = min(segment_distance(a, b), segment_distance(b, c), segment_distance(c, a))
    if square > 0.0:
        # Barycentric weights of the foot: (foot - a) × v · normal, ... with foot - a = -a but for its part along the
        # normal.
        uv, uu, vv, au, av = dot(u, v), dot(u, u), dot(v, v), -dot(a, u), -dot(a, v)
        at_b, at_c = vv * au - uv * av, uu * av - uv * au
        if at_b >= 0.0 and at_c >= 0.0 and at_b + at_c <= square:
            least = min(least, abs(dot(a, normal)) / np.sqrt(square))
    return unit * least


@kernel
def compute_shapes(positions, vertex, out_shape):
    """Compute what shadows need of every triangle: its plane, and its longest side.

    Parameters
    ----------
    positions : (n, 3) float64
    vertex : (3, n_face) uint32
    out_shape : (n_face, 5) float64: unit normal n, n·P of the plane, and the length of that side, scene units
    """
    for face in range(np.uint64(vertex.shape[1])):
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
