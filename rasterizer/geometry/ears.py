"""Polygons cut into triangles by their ears, in compiled code.

         c ____ d          An *ear* at b: the triangle a b c turns the polygon's way, and no edge passes through its
          |    \\           inside. Cutting it off leaves a polygon with one corner less. Every polygon that doesn't
     e ___|     |          cross itself has two (Meisters 1975, Amer. Math. Monthly 82(6)), also where it touches
    a _______ b            itself along a bridge: edges may touch an ear's sides.

Spikes, where the polygon goes back the way it came, and repeated corners are cut off first: they have no area, but
would block ears, or make the angle between two of them look like one. Of all ears that of the best shape is cut, and
corners on a straight line when no ear is left. A cut changes only the ears at both neighbours of the corner; the
corners wait in a heap, the next one on top (Williams 1964, Comm. ACM 7(6), 347-348). So n corners take some n² steps at
most, of which nearly all compare boxes.

A corner's turn is decided exactly: by the sign of a 2 x 2 determinant of differences, in floating point where its error
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

SPIKE, EAR, STRAIGHT, BLOCKED, REFLEX = range(5)  # types of corners, in the order in which they are cut

TEST = 32  # steps
N_PART = 13  # room for an exact sum: each of the six products adds two parts
_SPLITTER = 2.0**27 + 1.0
# The error of a computed turn, relative to the sum of its products (Shewchuk 1997, section 4.3).
_TURN_ERROR = (3.0 + 16.0 * 2.0**-53) * 2.0**-53
_MIN_SUM = 2.0**-900  # below it products lose digits
_MAX_SCALE = 2.0**1022


class Polygons(NamedTuple):
    """Polygons that are cut."""

    vertices: NDArray[np.float64]  # (n_vertex, 3)
    corners: NDArray[np.int64]  # (n_corner,) indices of vertices, polygon by polygon
    starts: NDArray[np.int64]  # (n,) where each polygon's corners begin
    counts: NDArray[np.int64]  # (n,) how many there are, at least 3
    first_triangle: NDArray[np.int64]  # (n,) where each polygon's triangles begin


class Outline(NamedTuple):
    """What is left of a polygon: its corners, in the order in which it is cut, as a ring."""

    x: NDArray[np.float64]  # (n,) in the plane
    y: NDArray[np.float64]  # (n,)
    points: NDArray[np.float64]  # (n, 3) in space
    before: NDArray[np.int64]  # (n,) the corner before each
    after: NDArray[np.int64]  # (n,) the corner after each
    parts: NDArray[np.float64]  # (N_PART,) scratch of turns
    steps: NDArray[np.int64]  # (1,) how many were taken: a comparison of boxes is one, a test of an edge TEST


class Heap(NamedTuple):
    """The corners that are left, the one that is cut next on top."""

    corners: NDArray[np.int64]  # (n,)
    rank: NDArray[np.int64]  # (n,) where each corner stands in the heap
    types: NDArray[np.int64]  # (n,) of each corner, SPIKE to REFLEX
    shape: NDArray[np.float64]  # (n,) of each corner's triangle: the larger, the better


class EarScratch(NamedTuple):
    """What is known of one polygon while it is cut."""

    outline: Outline
    heap: Heap
    order: NDArray[np.int64]  # (n,) its corners as they are listed, in the order in which it is cut
    backward: NDArray[np.int64]  # (n,) its corners in another order, while the better one is looked for


def cut_ears(vertices, corners, starts, counts, first_triangle, max_steps, triangles, out_is_crossing) -> int:
    """Cut polygons into triangles, as long as that takes no more than `max_steps`; return how many were cut.

    Parameters
    ----------
    vertices : (n_vertex, 3) float64
    corners : (n_corner,) int64, indices of vertices, polygon by polygon
    starts, counts : (n,) int64, where each polygon's corners begin, and how many there are: at least 3
    first_triangle : (n,) int64, where each polygon's triangles begin
    triangles : (n_triangle, 3) int64, gets indices into the corners
    out_is_crossing : (n,) bool, whether the polygon crosses itself
    """
    polygons = Polygons(vertices, corners, starts, counts, first_triangle)
    return cut_outlines(polygons, make_ear_scratch(int(counts.max())), max_steps, triangles, out_is_crossing)


def make_ear_scratch(max_corner: int) -> EarScratch:
    """Return room for polygons with up to `max_corner` corners."""
    real, whole = (lambda *shape: np.empty(shape)), (lambda: np.empty(max_corner, np.int64))
    planar = real(max_corner), real(max_corner), real(max_corner, 3)
    outline = Outline(*planar, whole(), whole(), real(N_PART), np.zeros(1, np.int64))
    return EarScratch(outline, Heap(whole(), whole(), whole(), real(max_corner)), whole(), whole())


@kernel
def cut_outlines(polygons, scratch, max_steps, triangles, out_is_crossing):
    """Cut polygons into triangles, see `cut_ears`; polygons: Polygons, scratch: EarScratch, whose steps are 0."""
    outline, heap, order = scratch.outline, scratch.heap, scratch.order
    before, after = outline.before, outline.after
    for polygon in range(len(polygons.starts)):
        start, n, row = polygons.starts[polygon], polygons.counts[polygon], polygons.first_triangle[polygon]
        is_reversed = _put_in_order(polygons.vertices, polygons.corners, start, n, scratch.backward, order)
        for i in range(n):
            before[i], after[i], heap.corners[i] = (i - 1) % n, (i + 1) % n, i
            for axis in range(3):
                outline.points[i, axis] = polygons.vertices[polygons.corners[start + order[i]], axis]
        _project(outline.points, n, outline.x, outline.y)
        is_crossing, is_cut, left, tip, a, c = False, False, n, np.int64(0), np.int64(0), np.int64(0)
        while True:
            # Classify both neighbours of a corner that was cut off, or, one after the other, all that are left.
            for k in range(2 if is_cut else left):
                i = heap.corners[k] if not is_cut else (a if k == 0 else c)
                heap.types[i], heap.shape[i] = _classify(outline, i, left)
                _settle(heap, left if is_cut else k + 1, heap.rank[i] if is_cut else k)
                if outline.steps[0] > max_steps:
                    return polygon
            if left == 3:
                break
            if heap.types[heap.corners[0]] > STRAIGHT and not is_crossing:
                # Cuts elsewhere never clear an ear of a polygon that doesn't cross itself; others may have got one.
                is_crossing, is_cut = not is_cut, False
                if not is_crossing:
                    continue
            # Cut the next corner off.
            tip = heap.corners[0]
            a, c = before[tip], after[tip]
            _emit(triangles, row, start, order, a, tip, c, is_reversed)
            row += 1
            left -= 1
            after[a], before[c] = c, a
            heap.corners[0] = heap.corners[left]
            _settle(heap, left, 0)
            tip, is_cut = c, True
        _emit(triangles, row, start, order, before[tip], tip, after[tip], is_reversed)
        out_is_crossing[polygon] = is_crossing or heap.types[tip] == REFLEX
    return len(polygons.starts)


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
def _put_in_order(vertices, corners, start, n, backward, order):
    """Begin a polygon where, and follow it as, its list of points is smallest; return whether that is backwards."""
    first = _least_rotation(vertices, corners, start, n, 1)
    last = _least_rotation(vertices, corners, start, n, -1)
    difference = 0
    for i in range(n):
        order[i], backward[i] = (first + i) % n, (last - i) % n
        if difference == 0:
            difference = _compare(vertices, corners[start + order[i]], corners[start + backward[i]])
    if difference <= 0:
        return False
    for i in range(n):
        order[i] = backward[i]
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
    scale = 1.0  # a power of two
    while largest * scale >= 1.0:
        scale *= 0.5
    while 0.0 < largest * scale < 0.5 and scale < _MAX_SCALE:
        scale *= 2.0
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
def _is_before(i, j, heap):
    """Tell whether corner i is cut before j: by type, then the one of the better shape, of equal ones the first in
    order."""
    types, shape = heap.types, heap.shape
    if types[i] != types[j]:
        return types[i] < types[j]
    return shape[i] > shape[j] or (shape[i] == shape[j] and i < j)


@helper
def _settle(heap, n, k):
    """Move corner k of a heap of n up or down to where it belongs, and note the ranks."""
    corners, rank = heap.corners, heap.rank
    i = corners[k]
    while k > 0 and _is_before(i, corners[(k - 1) // 2], heap):
        corners[k] = corners[(k - 1) // 2]
        rank[corners[k]] = k
        k = (k - 1) // 2
    while 2 * k + 1 < n:
        child = 2 * k + 1
        if child + 1 < n and _is_before(corners[child + 1], corners[child], heap):
            child += 1
        if not _is_before(corners[child], i, heap):
            break
        corners[k] = corners[child]
        rank[corners[k]] = k
        k = child
    corners[k] = i
    rank[i] = k


@helper
def _classify(outline, i, n):
    """Return the type of corner i of the n that are left, and the shape of its triangle: its area over the sum of its
    sides' squares."""
    x, y, after = outline.x, outline.y, outline.after
    i_before, i_after = outline.before[i], after[i]
    a, b, c = (x[i_before], y[i_before]), (x[i], y[i]), (x[i_after], y[i_after])
    turn = turn_of(a, b, c, outline.parts)
    if turn < 0:
        return REFLEX, 0.0
    if turn == 0:
        is_repeated = (a[0] == b[0] and a[1] == b[1]) or (b[0] == c[0] and b[1] == c[1])
        goes_on = _goes_on(a[0], b[0], c[0]) and _goes_on(a[1], b[1], c[1])
        return (STRAIGHT if goes_on and not is_repeated else SPIKE), 0.0
    shape = _shape(outline.points, i_before, i, i_after)
    x_low, x_high = min(a[0], b[0], c[0]), max(a[0], b[0], c[0])
    y_low, y_high = min(a[1], b[1], c[1]), max(a[1], b[1], c[1])
    here, p, n_step, is_blocked = i_after, c, 0, False
    for _ in range(n - 2):
        here = after[here]
        q = (x[here], y[here])
        is_apart = (p[0] <= x_low and q[0] <= x_low) or (p[0] >= x_high and q[0] >= x_high)
        is_apart = is_apart or (p[1] <= y_low and q[1] <= y_low) or (p[1] >= y_high and q[1] >= y_high)
        n_step += 1
        if not is_apart:
            n_step += TEST
            if _passes_through(a, b, c, p, q, outline.parts):
                is_blocked = True
                break
        p = q
    outline.steps[0] += n_step
    return (BLOCKED if is_blocked else EAR), shape


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
def _passes_through(a, b, c, p, q, parts):
    """Tell whether the segment p q has a point strictly inside the counter-clockwise triangle a b c.

    It has none if and only if a line separates them, and then one along a side of the triangle or along the segment
    does (separating axes of convex figures: Gottschalk, Lin & Manocha 1996, SIGGRAPH).
    """
    is_point = p[0] == q[0] and p[1] == q[1]  # one that no side separates is inside
    is_left = is_right = is_point
    u, v, w = a, b, c
    for _ in range(3):
        if turn_of(u, v, p, parts) <= 0 and turn_of(u, v, q, parts) <= 0:
            return False
        if not (is_left and is_right):
            side = turn_of(p, q, u, parts)
            is_left, is_right = is_left or side > 0, is_right or side < 0
        u, v, w = v, w, u
    return is_left and is_right


# --- on which side of a line a point lies, exactly ----------------------------------------------------------


@helper
def turn_of(a, b, c, parts):
    """Return the sign of the turn a b c, exactly: 1 is counter-clockwise, 0 straight."""
    left, right = (a[0] - c[0]) * (b[1] - c[1]), (a[1] - c[1]) * (b[0] - c[0])
    area, total = left - right, abs(left) + abs(right)
    if abs(area) > _TURN_ERROR * total and total > _MIN_SUM:
        return 1 if area > 0.0 else -1
    return exact_turn(a, b, c, parts)


@helper
def exact_turn(a, b, c, parts):
    """Return the sign of ax by - ay bx + bx cy - by cx + cx ay - cy ax, summed without an error.

    Twelve parts of six products are added one by one to a sum that is kept as parts that don't overlap; the sign is
    that of its largest part (Shewchuk 1997: GROW-EXPANSION, theorem 10). parts: (N_PART,) float64, scratch.
    """
    n, u, v, w = 0, a, b, c
    for k in range(6):
        # ax by, then -ay bx; the same of b and c, and of c and a.
        left, right = (u[0], v[1]) if k % 2 == 0 else (-u[1], v[0])
        product = left * right
        # The rounding error of the product (Dekker 1971, Numerische Mathematik 18, 224-242).
        left_high = _SPLITTER * left - (_SPLITTER * left - left)
        right_high = _SPLITTER * right - (_SPLITTER * right - right)
        left_low, right_low = left - left_high, right - right_high
        error = left_low * right_low - (
            ((product - left_high * right_high) - left_low * right_high) - left_high * right_low
        )
        for number in (error, product):
            carried = number
            for i in range(n):
                total = carried + parts[i]
                taken = total - carried
                parts[i] = (carried - (total - taken)) + (parts[i] - taken)
                carried = total
            parts[n] = carried
            n += 1
        if k % 2 == 1:
            u, v, w = v, w, u
    for i in range(n - 1, -1, -1):
        if parts[i] != 0.0:
            return 1 if parts[i] > 0.0 else -1
    return 0
