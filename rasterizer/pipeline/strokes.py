"""Edges drawn as strokes: the parts of lines that nothing hides, as samples of an 8x8 grid in every pixel.

In:  line segments on the screen, the triangle that is visible at each sample, and the triangles themselves.
Out: 64 bits a pixel, one for each point of the grid that a stroke covers; strokes that overlap count once.

A point of an edge is hidden where a visible triangle covers it and lies in front of it. Both are decided at the point
itself, from the triangle's corners in float64: nothing is painted nearer than it is. The triangles that are asked are
those of the samples around the point, 3x3. Where none of them covers it, because they are smaller than samples, it is
hidden if all of them lie in front of it as a whole.

How much nearer counts as in front. Coordinates are those of float32 files: a vertex, and so a plane, may be off by
d = 2^-22 of the scene's largest coordinate, and `skew_stretch` times as much with skew. The plane n·P = c, at the
distance h = c/|n| from the eye, is seen along the ray r at 1/w = n·r/c. Moved by d along its normal, that changes by
the share d/h. The edge's own 1/w, with ends that are off by d, is off by d/w². Without perspective a plane's depth is
off by d |n|/|n_z|, that of an edge by d.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from ..geometry.vectors import cross, dot, length, subtract

GRID = 8  # points of a pixel along each axis
STEPS = 2  # points at which it is decided whether an edge is hidden, for each sample along it
ROUNDING = 2.0**-40  # of products of three coordinates in float64, with room
OUTSIDE, BEHIND, HIDING = 0, 1, 2  # what a triangle is to a point of an edge: it doesn't cover it, it isn't in front …


class Occluders(NamedTuple):
    """What may hide an edge."""

    points: np.ndarray  # (3, n_vertex) float64: across, up and depth in the camera's frame, scene units
    vertex_idx: np.ndarray  # (3, n_triangle) uint32
    visible: np.ndarray  # (height, width) int32, the triangle at each sample, -1 where none is


class EdgeView(NamedTuple):
    """How the camera's frame maps to samples."""

    scale_x: float  # samples
    scale_y: float
    center_x: float
    center_y: float
    is_perspective: bool
    slack: float  # how far a coordinate may be off, scene units
    factor: float  # samples a pixel along each axis
    near: float  # scene units: what is nearer is cut off, and hides nothing


@kernel
def draw_strokes(segments, occluders, view, radius, flags, out):
    """Draw the visible parts of segments.

    Parameters
    ----------
    segments : (n, 6) float64: x, y (samples) and nearness of both ends; nearness is 1/w, without perspective -depth
    occluders : Occluders
    view : EdgeView
    radius : half of a stroke's width, px
    flags : (n,) uint8, scratch, longer than STEPS times the picture's diagonal in samples
    out : (height, width) uint64, bits that are set
    """
    for k in range(index(len(segments))):
        x0, y0, near0 = segments[k, 0], segments[k, 1], segments[k, 2]
        dx, dy, d_near = segments[k, 3] - x0, segments[k, 4] - y0, segments[k, 5] - near0
        n_step = min(int(STEPS * np.sqrt(dx * dx + dy * dy)) + 1, len(flags) - 1)
        n_visible = 0
        for step in range(n_step + 1):
            t = step / n_step
            is_seen = is_visible(x0 + t * dx, y0 + t * dy, near0 + t * d_near, occluders, view)
            flags[index(step)] = is_seen
            n_visible += is_seen
        if n_visible > 0:
            px = 1.0 / view.factor
            draw_stroke(x0 * px, y0 * px, dx * px, dy * px, radius, n_step, flags, out)


@helper
def is_visible(x, y, nearness, occluders, view):
    """Tell whether nothing hides a point of an edge."""
    visible, is_covered, is_hidden, before = occluders.visible, False, True, -1
    height, width = visible.shape
    column, row = int(np.floor(x)), int(np.floor(y))
    for j in range(max(row - 1, 0), min(row + 2, height)):
        for i in range(max(column - 1, 0), min(column + 2, width)):
            triangle = np.int64(visible[index(j), index(i)])
            if triangle == before and triangle >= 0:
                continue
            before = triangle
            if triangle < 0:
                is_hidden = False
                continue
            a, b, c = corners_of(index(triangle), occluders)
            if view.is_perspective:
                relation, is_before = relation_in_perspective(a, b, c, x, y, nearness, view)
            else:
                relation, is_before = relation_in_parallel(a, b, c, x, y, nearness, view)
            if relation == HIDING:
                return False
            is_covered |= relation == BEHIND
            is_hidden &= is_before
    return is_covered or not is_hidden


@helper
def corners_of(triangle, occluders):
    """Return the corners of a triangle in the camera's frame."""
    points, vertex_idx = occluders.points, occluders.vertex_idx
    i, j, k = index(vertex_idx[0, triangle]), index(vertex_idx[1, triangle]), index(vertex_idx[2, triangle])
    a = points[0, i], points[1, i], points[2, i]
    b = points[0, j], points[1, j], points[2, j]
    return a, b, (points[0, k], points[1, k], points[2, k])


@helper
def relation_in_perspective(a, b, c, x, y, nearness, view):
    """Return what a triangle is to a point of an edge, and whether all of it is nearer.

    The ray r meets the triangle where r = Σ q_k P_k with all q_k >= 0; q_a = r·(b×c)/(a·(b×c)).
    """
    ray = (x - view.center_x) / view.scale_x, (view.center_y - y) / view.scale_y, 1.0
    of_a, of_b, of_c = cross(b, c), cross(c, a), cross(a, b)
    normal = cross(subtract(b, a), subtract(c, a))
    volume = dot(normal, a)
    side, reach = (1.0 if volume > 0 else -1.0), length(ray) * ROUNDING
    size_a, size_b, size_c = length(a), length(b), length(c)
    is_covering = side * dot(ray, of_a) >= -reach * size_b * size_c
    is_covering &= side * dot(ray, of_b) >= -reach * size_c * size_a
    is_covering &= side * dot(ray, of_c) >= -reach * size_a * size_b
    total = dot(ray, normal)
    of_edge = view.slack * nearness * nearness
    furthest = max(a[2], b[2], c[2])
    is_before = min(a[2], b[2], c[2]) > 0.0 and 1.0 / furthest - nearness > of_edge
    if not is_covering or not side * total > 0.0 or volume == 0.0:
        return OUTSIDE, is_before
    found = total / volume
    if found * view.near > 1.0:
        return OUTSIDE, False
    is_hiding = found - nearness > found * view.slack * length(normal) / abs(volume) + of_edge
    return HIDING if is_hiding else BEHIND, is_before


@helper
def relation_in_parallel(a, b, c, x, y, nearness, view):
    """Return the same without perspective: nearness is -depth."""
    px, py = (x - view.center_x) / view.scale_x, (view.center_y - y) / view.scale_y
    of_a = (c[0] - b[0]) * (py - b[1]) - (c[1] - b[1]) * (px - b[0])
    of_b = (a[0] - c[0]) * (py - c[1]) - (a[1] - c[1]) * (px - c[0])
    of_c = (b[0] - a[0]) * (py - a[1]) - (b[1] - a[1]) * (px - a[0])
    area = of_a + of_b + of_c
    side = 1.0 if area > 0 else -1.0
    most = max(abs(a[0]), abs(a[1]), abs(b[0]), abs(b[1]), abs(c[0]), abs(c[1]), abs(px), abs(py))
    reach = -ROUNDING * most * most
    is_before = -max(a[2], b[2], c[2]) - nearness > view.slack
    if not (side * of_a >= reach and side * of_b >= reach and side * of_c >= reach) or area == 0.0:
        return OUTSIDE, is_before
    normal = cross(subtract(b, a), subtract(c, a))
    depth = (of_a * a[2] + of_b * b[2] + of_c * c[2]) / area
    if depth < view.near:
        return OUTSIDE, False
    is_hiding = -depth - nearness > view.slack * (1.0 + length(normal) / abs(normal[2]))
    return HIDING if is_hiding else BEHIND, is_before


@helper
def draw_stroke(x0, y0, dx, dy, radius, n_step, flags, out):
    """Set the bits within `radius` of the visible parts of a segment, px; its ends are round."""
    height, width = out.shape
    long = np.sqrt(dx * dx + dy * dy)
    inverse = 1.0 / (long * long) if long > 0.0 else 0.0
    half = radius * long / abs(dy) if dy != 0.0 else np.inf  # of the stroke, along a row
    low, high = min(x0, x0 + dx) - radius, max(x0, x0 + dx) + radius
    first = max(int(np.floor(min(y0, y0 + dy) - radius)), 0)
    end = min(int(np.floor(max(y0, y0 + dy) + radius)) + 1, height)
    for row in range(first, end):
        left, right = low, high
        if half < np.inf:
            xa, xb = x0 + dx * (row - y0) / dy, x0 + dx * (row + 1 - y0) / dy
            left, right = max(low, min(xa, xb) - half), min(high, max(xa, xb) + half)
        for column in range(max(int(np.floor(max(left, -1.0))), 0), min(int(np.floor(min(right, width))) + 1, width)):
            bits = out[index(row), index(column)]
            for point in range(GRID * GRID):
                x = column + (point % GRID + 0.5) / GRID - x0
                y = row + (point // GRID + 0.5) / GRID - y0
                t = min(max((x * dx + y * dy) * inverse, 0.0), 1.0)
                ex, ey = x - t * dx, y - t * dy
                if ex * ex + ey * ey <= radius * radius and flags[index(t * n_step + 0.5)]:
                    bits |= np.uint64(1) << np.uint64(point)
            out[index(row), index(column)] = bits
