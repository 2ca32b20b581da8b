"""Triangles that are fetched once more: those of visible samples whose records don't hold their corners.

In:  the index of a triangle in the picture, and the picture's drawables.
Out: what `exact_triangle` of interpolate.py reads from an exact record: the same numbers in the same order, so that
     what is interpolated has the same bits.

A part of a clipped face always has an exact record: its weights come from planes.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index
from .interpolate import ExactTriangle
from .setup import rotate_to_first


class VertexOrder(NamedTuple):
    """How a record orders the vertices of a triangle: clockwise on the screen, the topmost (then leftmost) first."""

    is_b_first: bool
    is_c_first: bool
    is_front: bool  # counter-clockwise as loaded


@helper
def fetch_triangle(face, drawables, depths):
    """Return a whole triangle, and the depths of its vertices, as an exact record holds them.

    `face` is its index in the picture, `depths` the DepthScale.
    """
    xs, ys = fetch_positions(face, drawables)
    order, z = order_of(xs, ys), drawables.vertices.z
    a, b, c = fetch_indices(drawables.triangles.vertex_idx, face)
    (x0, x1, x2), (y0, y1, y2) = ordered(xs, order), ordered(ys, order)
    z0, z1, z2 = ordered((z[a], z[b], z[c]), order)
    offset, step = depths.inv_w_offset, depths.inv_w_scale
    inv_w = (offset + step * z0, offset + step * z1, offset + step * z2)
    dx1, dy1, dx2, dy2 = x1 - x0, y1 - y0, x2 - x0, y2 - y0
    zeros, sums = (0.0, 0.0, 0.0), (min(inv_w), max(inv_w))
    area = float(dx1 * dy2 - dx2 * dy1)
    triangle = ExactTriangle(False, x0, y0, dx1, dy1, dx2, dy2, inv_w, zeros, zeros, zeros, sums, area)
    offset, step = depths.depth_offset, depths.depth_scale
    return triangle, (offset + step * z0, offset + step * z1, offset + step * z2)


@helper
def fetch_normals(face, drawables):
    """Return the normals of a triangle, an axis a row and a corner a column, and the side that is seen: 1 or -1.

    Normals are the first three attributes in float64.
    """
    triangles, attributes = drawables.triangles, drawables.double_attributes
    xs, ys = fetch_positions(face, drawables)
    order = order_of(xs, ys)
    is_flipped = order.is_front == (triangles.is_inverted[face] != 0)
    side = index(attributes.shape[0] - 1) if is_flipped else index(0)
    corners = fetch_indices(triangles.corner_idx, face)
    is_whole = len(triangles.clipped_idx) == 0 or triangles.clipped_idx[face] < 0
    if is_whole:  # the attributes of a part are those of its face, in the order of the planes
        corners = ordered(corners, order)
    a, b, c = corners
    x = (attributes[side, a, index(0)], attributes[side, b, index(0)], attributes[side, c, index(0)])
    y = (attributes[side, a, index(1)], attributes[side, b, index(1)], attributes[side, c, index(1)])
    z = (attributes[side, a, index(2)], attributes[side, b, index(2)], attributes[side, c, index(2)])
    return (x, y, z), -1 if is_flipped else 1


@helper
def fetch_indices(columns, face):
    """Return the three indices of a triangle."""
    return index(columns[index(0), face]), index(columns[index(1), face]), index(columns[index(2), face])


@helper
def fetch_positions(face, drawables):
    """Return the columns and rows of a triangle's vertices, int64, 1/256 px, in the order of the file."""
    x, y = drawables.vertices.x, drawables.vertices.y
    a, b, c = fetch_indices(drawables.triangles.vertex_idx, face)
    return (np.int64(x[a]), np.int64(x[b]), np.int64(x[c])), (np.int64(y[a]), np.int64(y[b]), np.int64(y[c]))


@helper
def order_of(xs, ys):
    """Return the order of the vertices at these places, as setup.order_vertices finds it."""
    (xa, xb, xc), (ya, yb, yc) = xs, ys
    key_a, key_b, key_c = (ya << 32) + xa, (yb << 32) + xb, (yc << 32) + xc
    is_c_first = key_c < min(key_a, key_b)
    is_b_first = (key_b < key_a) and not is_c_first
    return VertexOrder(is_b_first, is_c_first, (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya) < 0)


@helper
def ordered(values, order):
    """Bring what a triangle has at its vertices into their order."""
    a, b, c = values
    return rotate_to_first(a, b, c, order.is_b_first, order.is_c_first, order.is_front)
