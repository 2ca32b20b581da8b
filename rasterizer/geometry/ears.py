"""Kernels that cut polygons into triangles by their ears.

         c ____ d          An *ear* at b: the triangle a b c turns the polygon's way, and no edge passes through its
          |    \\           inside. Cutting it off leaves a polygon with one corner less. Every polygon that doesn't
     e ___|     |          cross itself has two (Meisters 1975, Amer. Math. Monthly 82(6)), also where it touches
    a _______ b            itself along a bridge: edges may touch an ear's sides.

Spikes, where the polygon goes back the way it came, and repeated corners are cut off first: they have no area, but
would block ears, or make the angle between two of them look like one. Of all ears that of the best shape is cut, and
corners on a straight line when no ear is left. A cut changes only the ears at both neighbours of the corner; the
corners wait in a heap, the next one on top (Williams 1964, Comm. ACM 7(6), 347-348). So n corners take some n² steps at
most, of which nearly all compare boxes.

A corner's turn is decided exactly: the sign of a 2 x 2 determinant of differences, in floating point where its error
bound leaves no doubt, else as the sum of six exact products (Shewchuk 1997, Discrete & Computational Geometry 18(3),
305-363). One coordinate is dropped, that of Newell's largest component, so nothing is rounded on the way into the
plane. All coordinates are multiplied by one power of two, so that the largest is near 1; then products can underflow
only where they are 2^-900 of the largest one, and count as zero.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import helper, kernel

_SPLITTER = 2.0**27 + 1.0
# The error of a computed turn, relative to the sum of its products (Shewchuk 1997, section 4.3).
_TURN_ERROR = (3.0 + 16.0 * 2.0**-53) * 2.0**-53
_LEAST = 2.0**-900  # below it products lose digits
SPIKE, EAR, STRAIGHT, BLOCKED, REFLEX = range(5)


class Outline(NamedTuple):
    """What is left of a polygon: its corners, in the order in which it is cut, as a ring."""

    x: NDArray[np.float64]  # (n,) in the plane
    y: NDArray[np.float64]  # (n,)
    points: NDArray[np.float64]  # (n, 3) in space
    before: NDArray[np.int64]  # (n,) the corner before each
    after: NDArray[np.int64]  # (n,) the corner after each


@kernel
def cut_ears(vertices, corners, starts, counts, first_triangle, most, triangles, out_is_crossing):
    """Cut polygons into triangles.

    Parameters
    ----------
    vertices : (n_vertex, 3) float64
    corners : (n_corner,) int64, indices of vertices, polygon by polygon
    starts, counts : (n,) int64, where each polygon's corners begin, and how many there are: at least 3, at most `most`
    first_triangle : (n,) int64, where each polygon's triangles begin
    triangles : (n_triangle, 3) int64, gets indices into the corners
    out_is_crossing : (n,) bool, whether the polygon crosses itself
    """
    order, keep = np.empty(most, np.int64), np.empty(most, np.int64)
    before, after = np.empty(most, np.int64), np.empty(most, np.int64)
    outline = Outline(np.empty(most), np.empty(most), np.empty((most, 3)), before, after)
    # Of each corner its kind, the shape of its triangle (the larger, the better), and its rank in the heap.
    kind, shape = np.empty(most, np.int64), np.empty(most)
    heap, rank = np.empty(most, np.int64), np.empty(most, np.int64)
    for polygon in range(len(starts)):
        start, n, row = starts[polygon], counts[polygon], first_triangle[polygon]
        is_reversed = _put_in_order(vertices, corners, start, n, keep, order)
        for i in range(n):
            before[i], after[i] = (i - 1) % n, (i + 1) % n
            for axis in range(3):
                outline.points[i, axis] = vertices[corners[start + order[i]], axis]
        _project(outline.points, n, outline.x, outline.y)
        for i in range(n):
            kind[i], shape[i] = _classify(outline, i, n)
            heap[i] = i
            _settle(heap, rank, i + 1, i, kind, shape)
        tip, is_crossing = 0, False
        for left in range(n, 3, -1):
            if kind[heap[0]] > STRAIGHT and not is_crossing:
                is_crossing = not _classify_all(heap, rank, kind, shape, outline, left)
            # Cut the next corner off, and classify its neighbours again.
            tip = heap[0]
            a, c = before[tip], after[tip]
            _emit(triangles, row, start, order, a, tip, c, is_reversed)
            row += 1
            after[a], before[c] = c, a
            heap[0] = heap[left - 1]
            _settle(heap, rank, left - 1, 0, kind, shape)
            for i in (a, c):
                kind[i], shape[i] = _classify(outline, i, left - 1)
                _settle(heap, rank, left - 1, rank[i], kind, shape)
            tip = c
        a, c = before[tip], after[tip]
        _emit(triangles, row, start, order, a, tip, c, is_reversed)
        is_turned = (
            _turn((outline.x[a], outline.y[a]), (outline.x[tip], outline.y[tip]), (outline.x[c], outline.y[c])) < 0
        )
        out_is_crossing[polygon] = is_crossing or is_turned


@helper
def _emit(triangles, row, start, order, a, b, c, is_reversed):
    """Write one triangle, wound as the polygon is."""
    if is_reversed:
        a, c = c, a
    triangles[row, 0], triangles[row, 1], triangles[row, 2] = start + order[a], start + order[b], start + order[c]


@helper
def _compare(vertices, a, b):
    """Compare two vertices by x, then y, then z: -1, 0 or 1."""
    for axis in range(3):
        if vertices[a, axis] != vertices[b, axis]:
            return -1 if vertices[a, axis] < vertices[b, axis] else 1
    return 0


@helper
def _least_rotation(vertices, corners, start, n, step):
    """Return where a polygon's list of points is smallest when it is begun there and followed by `step`, 1 or -1.

    Source: Shiloach 1981, J. Algorithms 2(2), 107-121: at most 3 n comparisons.
    """
    i, j, same = 0, 1, 0
    while i < n and j < n and same < n:
        order = _compare(vertices, corners[start + step * (i + same) % n], corners[start + step * (j + same) % n])
        if order == 0:
            same += 1
            continue
        if order > 0:
            i += same + 1
        else:
            j += same + 1
        if i == j:
            j += 1
        same = 0
    return step * min(i, j) % n


@helper
def _put_in_order(vertices, corners, start, n, keep, order):
    """Begin a polygon where, and follow it as, its list of points is smallest; return whether that is backwards."""
    forward = _least_rotation(vertices, corners, start, n, 1)
    backward = _least_rotation(vertices, corners, start, n, -1)
    difference = 0
    for i in range(n):
        order[i], keep[i] = (forward + i) % n, (backward - i) % n
        if difference == 0:
            difference = _compare(vertices, corners[start + order[i]], corners[start + keep[i]])
    if difference <= 0:
        return False
    for i in range(n):
        order[i] = keep[i]
    return True


@helper
def _project(points, n, out_x, out_y):
    """Drop the coordinate of Newell's largest component, so that the polygon turns counter-clockwise; bring the points
    near 1.

    Where the areas cancel, as in a symmetrical bow tie, the coordinate of the largest sum of areas is dropped.
    """
    largest = 0.0
    for i in range(n):
        for axis in range(3):
            largest = max(largest, abs(points[i, axis]))
    scale = math.ldexp(1.0, -math.frexp(largest)[1]) if largest > 0.0 else 1.0
    extent = 0.0
    for i in range(n):
        for axis in range(3):
            points[i, axis] *= scale
            extent = max(extent, abs(points[i, axis] - points[0, axis]))
    extent = extent if extent > 0.0 else 1.0
    dropped, best, sign = 2, -1.0, 1.0
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        area = total = 0.0
        for i in range(1, n - 1):
            part = (points[i, u] - points[0, u]) / extent * ((points[i + 1, v] - points[0, v]) / extent)
            part -= (points[i, v] - points[0, v]) / extent * ((points[i + 1, u] - points[0, u]) / extent)
            area += part
            total += abs(part)
        # A sum that is only rounding says nothing: then the parts themselves count, and last the lengths, but behind
        # all sums.
        weight = 2.0**-60 * total + 2.0**-120 * _extent(points, n, u) / extent * (_extent(points, n, v) / extent)
        weight = abs(area) if abs(area) > n * 2.0**-50 * total else weight
        if weight > best:
            dropped, best, sign = axis, weight, 1.0 if area >= 0.0 else -1.0
    u, v = (dropped + 1) % 3, (dropped + 2) % 3
    for i in range(n):
        out_x[i] = points[i, u] if sign > 0.0 else points[i, v]
        out_y[i] = points[i, v] if sign > 0.0 else points[i, u]


@helper
def _extent(points, n, axis):
    """Return how far a polygon reaches along an axis."""
    low = high = points[0, axis]
    for i in range(n):
        low, high = min(low, points[i, axis]), max(high, points[i, axis])
    return high - low


@helper
def _classify_all(heap, rank, kind, shape, outline, n):
    """Classify all n corners again; return whether one may be cut off: a polygon that crosses itself runs out of ears.

    Cuts elsewhere never clear an ear of a polygon that doesn't cross itself; others may have got one.
    """
    for k in range(n):
        i = heap[k]
        kind[i], shape[i] = _classify(outline, i, n)
    for k in range(n):
        _settle(heap, rank, k + 1, k, kind, shape)
    return kind[heap[0]] <= STRAIGHT


@helper
def _is_before(i, j, kind, shape):
    """Tell whether corner i is cut before j: by kind, then the one of the better shape, of equal ones the first in
    order."""
    if kind[i] != kind[j]:
        return kind[i] < kind[j]
    return shape[i] > shape[j] or (shape[i] == shape[j] and i < j)


@helper
def _settle(heap, rank, n, k, kind, shape):
    """Move corner k of a heap of n up or down to where it belongs, and note the ranks."""
    i = heap[k]
    while k > 0 and _is_before(i, heap[(k - 1) // 2], kind, shape):
        heap[k] = heap[(k - 1) // 2]
        rank[heap[k]] = k
        k = (k - 1) // 2
    while 2 * k + 1 < n:
        child = 2 * k + 1
        if child + 1 < n and _is_before(heap[child + 1], heap[child], kind, shape):
            child += 1
        if not _is_before(heap[child], i, kind, shape):
            break
        heap[k] = heap[child]
        rank[heap[k]] = k
        k = child
    heap[k] = i
    rank[i] = k


@helper
def _classify(outline, i, n):
    """Return the kind of corner i of the n that are left, and the shape of its triangle."""
    return _classify_corner(i, n, outline.x, outline.y, outline.points, outline.before, outline.after)


@kernel
def _classify_corner(i, n, x, y, points, before, after):
    """Return the kind of a corner of the n that are left, and the shape of its triangle: its area over the sum of its
    sides' squares.

    The arrays are those of `Outline`, one by one: a tuple of arrays costs a call ten atomic operations.
    """
    i_before, i_after = before[i], after[i]
    a, b, c = (x[i_before], y[i_before]), (x[i], y[i]), (x[i_after], y[i_after])
    turn = _turn(a, b, c)
    if turn < 0:
        return REFLEX, 0.0
    if turn == 0:
        is_repeated = (a[0] == b[0] and a[1] == b[1]) or (b[0] == c[0] and b[1] == c[1])
        goes_on = _goes_on(a[0], b[0], c[0]) and _goes_on(a[1], b[1], c[1])
        return (STRAIGHT if goes_on and not is_repeated else SPIKE), 0.0
    shape = _shape(points, i_before, i, i_after)
    x_low, x_high = min(a[0], b[0], c[0]), max(a[0], b[0], c[0])
    y_low, y_high = min(a[1], b[1], c[1]), max(a[1], b[1], c[1])
    here, p = i_after, c
    for _ in range(n - 2):
        here = after[here]
        q = (x[here], y[here])
        is_apart = (p[0] <= x_low and q[0] <= x_low) or (p[0] >= x_high and q[0] >= x_high)
        is_apart = is_apart or (p[1] <= y_low and q[1] <= y_low) or (p[1] >= y_high and q[1] >= y_high)
        if not is_apart and _passes_through(a, b, c, p, q):
            return BLOCKED, shape
        p = q
    return EAR, shape


@helper
def _goes_on(a, b, c):
    """Tell whether a coordinate doesn't turn back, on a straight line."""
    return a <= b <= c or a >= b >= c


@helper
def _shape(points, a, b, c):
    """Return the area of a triangle over the sum of the squares of its sides, in space; the sides divided by the
    longest extent."""
    extent = 0.0
    for axis in range(3):
        low = min(points[a, axis], points[b, axis], points[c, axis])
        extent = max(extent, max(points[a, axis], points[b, axis], points[c, axis]) - low)
    if extent == 0.0:
        return 0.0
    normal = squares = 0.0
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        e_u, e_v = (points[b, u] - points[a, u]) / extent, (points[b, v] - points[a, v]) / extent
        f_u, f_v = (points[c, u] - points[b, u]) / extent, (points[c, v] - points[b, v]) / extent
        side = (points[a, u] - points[c, u]) / extent
        normal += (e_u * f_v - e_v * f_u) ** 2
        squares += e_u * e_u + f_u * f_u + side * side
    return math.sqrt(normal) / squares


@helper
def _passes_through(a, b, c, p, q):
    """Tell whether the segment p q has a point strictly inside the counter-clockwise triangle a b c.

    It has none if and only if a line separates them, and then one along a side of the triangle or along the segment
    does (separating axes of convex figures: Gottschalk, Lin & Manocha 1996, SIGGRAPH).
    """
    if _turn(a, b, p) <= 0 and _turn(a, b, q) <= 0:
        return False
    if _turn(b, c, p) <= 0 and _turn(b, c, q) <= 0:
        return False
    if _turn(c, a, p) <= 0 and _turn(c, a, q) <= 0:
        return False
    if p[0] == q[0] and p[1] == q[1]:
        return True  # a point that no side separates
    of_a, of_b, of_c = _turn(p, q, a), _turn(p, q, b), _turn(p, q, c)
    return min(of_a, of_b, of_c) < 0 and max(of_a, of_b, of_c) > 0


@helper
def _turn(a, b, c):
    """Return the sign of the turn a b c, exactly: 1 is counter-clockwise, 0 straight."""
    left, right = (a[0] - c[0]) * (b[1] - c[1]), (a[1] - c[1]) * (b[0] - c[0])
    area, total = left - right, abs(left) + abs(right)
    if abs(area) > _TURN_ERROR * total and total > _LEAST:
        return 1 if area > 0.0 else -1
    return _exact_turn(a, b, c)


@kernel
def _exact_turn(a, b, c):
    """Return the sign of ax by - ay bx + bx cy - by cx + cx ay - cy ax, summed without an error.

    Twelve parts of six products are added one by one to a sum that is kept as parts that don't overlap; the sign is
    that of its largest part (Shewchuk 1997: GROW-EXPANSION, theorem 10).
    """
    parts, n = np.zeros(13), 0
    for k in range(6):
        if k == 0:
            u, v = a[0], b[1]
        elif k == 1:
            u, v = -a[1], b[0]
        elif k == 2:
            u, v = b[0], c[1]
        elif k == 3:
            u, v = -b[1], c[0]
        elif k == 4:
            u, v = c[0], a[1]
        else:
            u, v = -c[1], a[0]
        product = u * v
        # The rounding error of the product (Dekker 1971, Numerische Mathematik 18, 224-242).
        u_high, v_high = _SPLITTER * u - (_SPLITTER * u - u), _SPLITTER * v - (_SPLITTER * v - v)
        u_low, v_low = u - u_high, v - v_high
        error = u_low * v_low - (((product - u_high * v_high) - u_low * v_high) - u_high * v_low)
        for number in (error, product):
            carried = number
            for i in range(n):
                total = carried + parts[i]
                taken = total - carried
                parts[i] = (carried - (total - taken)) + (parts[i] - taken)
                carried = total
            parts[n] = carried
            n += 1
    for i in range(n - 1, -1, -1):
        if parts[i] != 0.0:
            return 1 if parts[i] > 0.0 else -1
    return 0
