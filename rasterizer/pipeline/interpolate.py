"""Exact interpolation over the triangle of an exact record (records.py), for shade.py, texture_sampling.py and
buffers.py.

It is perspective-correct: with the edge functions e_i of a sample, q_i = e_i / w_i, an attribute is Σ q_i·a_i / Σ q_i
(Blinn 1992, "Hyperbolic interpolation"). Nothing is extrapolated, and the e_i are exact integers, so slivers are as
good as any.

Of a part of a clipped face, q_i are those of the whole face, from its planes (clip.py). A part's corners are rounded to
1/256 px, so a sample may lie outside the face by as much: a negative q_i counts as 0, and Σ q_i = 1/w stays within the
face's range.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import borrow, helper
from .face_planes import LARGEST_SUM, LEAST_SUM, WEIGHT, WEIGHT_X, WEIGHT_Y
from .records import CLIPPED_IDX, DEPTH, EDGES, INV_W
from .transform import SUBPIXEL
from .visibility import IS_EXACT, IS_ID, LEVEL_MASK


class Weights(NamedTuple):
    """How the weights q_i of an exact record's three corners are found at a sample."""

    is_cut: bool  # from planes; else from edge functions
    x0: int  # the first vertex and the two edges that leave it, 1/256 px
    y0: int
    dx1: int
    dy1: int
    dx2: int
    dy2: int
    inv_w: tuple  # at the three vertices
    q: tuple  # planes of a clipped face: at the picture's corner, and what 1/256 px to the right, and down, adds
    q_x: tuple
    q_y: tuple
    sums: tuple  # least and largest Σ q_i, before it is multiplied by the area
    area: float  # Σ e_i; 1 where weights come from planes: 1/w = Σ q_i / area


@helper
def has_exact(words):
    """Tell whether any word holds the number of an exact record."""
    union = np.int64(0)
    for k in range(np.uint64(len(words))):
        union |= words[k] & (words[k] >> 1)  # IS_ID stands one bit above IS_EXACT
    return (union & IS_EXACT) != 0


@helper
def run_end(words, start):
    """End of the run of samples that show the same record as the one at `start`."""
    stop = start + np.uint64(1)
    while stop < np.uint64(len(words)) and (words[stop] ^ words[start]) & (IS_ID | LEVEL_MASK) == 0:
        stop += np.uint64(1)
    return stop


@helper
def is_exact(word):
    """Tell whether a word holds the number of an exact record."""
    return word & (IS_ID | IS_EXACT) == IS_ID | IS_EXACT


@helper
def weights_of(records, record):
    """Fetch what the weights of an exact record are found from."""
    row, column = records.integers[record], np.uint64(EDGES)
    dx1, dy1 = np.int64(row[column + np.uint64(2)]), np.int64(row[column + np.uint64(3)])
    dx2, dy2 = np.int64(row[column + np.uint64(4)]), np.int64(row[column + np.uint64(5)])
    w0, w1, w2 = corners_of(records.reals, record, INV_W)
    inv_w = (float(w0), float(w1), float(w2))
    cut = row[np.uint64(CLIPPED_IDX)]
    if cut >= 0:
        planes, k = borrow(records.clipped_planes), np.uint64(cut)
        sums = (planes[k, np.uint64(LEAST_SUM)], planes[k, np.uint64(LARGEST_SUM)])
        q, q_x, q_y = corners_of(planes, k, WEIGHT), corners_of(planes, k, WEIGHT_X), corners_of(planes, k, WEIGHT_Y)
        area = 1.0
    else:
        q = q_x = q_y = (0.0, 0.0, 0.0)
        sums = (min(inv_w), max(inv_w))
        area = float(dx1 * dy2 - dx2 * dy1)
    return Weights(
        cut >= 0,
        np.int64(row[column]),
        np.int64(row[column + np.uint64(1)]),
        dx1,
        dy1,
        dx2,
        dy2,
        inv_w,
        q,
        q_x,
        q_y,
        sums,
        area,
    )


@helper
def corners_of(numbers, record, column):
    """Three neighbouring numbers of an exact record: what it holds for its three corners."""
    column = np.uint64(column)
    return numbers[record, column], numbers[record, column + np.uint64(1)], numbers[record, column + np.uint64(2)]


@helper
def corner_weights(weights, sx, sy):
    """Perspective weights q_i of the three corners at the sample (sx, sy) (1/256 px); not normalised.

    The edge functions e_i are integers below 2^60: nothing is lost however long and thin the triangle is.
    """
    if weights.is_cut:
        return plane_weights(weights, float(sx), float(sy))
    ux, uy = sx - weights.x0, sy - weights.y0
    e1 = ux * weights.dy2 - uy * weights.dx2
    e2 = uy * weights.dx1 - ux * weights.dy1
    e0 = (weights.dx1 * weights.dy2 - weights.dx2 * weights.dy1) - e1 - e2
    return float(e0) * weights.inv_w[0], float(e1) * weights.inv_w[1], float(e2) * weights.inv_w[2]


@helper
def plane_weights(weights, x, y):
    """The weights of a clipped face, none below 0, their sum within its range."""
    q, q_x, q_y = weights.q, weights.q_x, weights.q_y
    q0 = max(q[0] + q_x[0] * x + q_y[0] * y, 0.0)
    q1 = max(q[1] + q_x[1] * x + q_y[1] * y, 0.0)
    q2 = max(q[2] + q_x[2] * x + q_y[2] * y, 0.0)
    total = q0 + q1 + q2
    within = min(max(total, weights.sums[0]), weights.sums[1])
    if not total > 0.0:
        return within / 3.0, within / 3.0, within / 3.0
    scale = within / total
    return q0 * scale, q1 * scale, q2 * scale


@helper
def weight_steps(weights):
    """What one sample to the right, and one down, adds to the weights: two triples."""
    if weights.is_cut:
        q_x, q_y, step = weights.q_x, weights.q_y, float(SUBPIXEL)
        return (q_x[0] * step, q_x[1] * step, q_x[2] * step), (q_y[0] * step, q_y[1] * step, q_y[2] * step)
    inv_w = weights.inv_w
    x1, x2 = float(weights.dy2 * SUBPIXEL), float(-weights.dy1 * SUBPIXEL)
    y1, y2 = float(-weights.dx2 * SUBPIXEL), float(weights.dx1 * SUBPIXEL)
    # Edge functions 1 and 2; corner 0 loses what both gain.
    return (
        (-(x1 + x2) * inv_w[0], x1 * inv_w[1], x2 * inv_w[2]),
        (-(y1 + y2) * inv_w[0], y1 * inv_w[1], y2 * inv_w[2]),
    )


@helper
def depth_of(records, record, weights, q0, q1, q2, is_perspective):
    """Depth along the viewing axis, scene units, at a sample with the weights q_i."""
    total = q0 + q1 + q2
    if is_perspective:
        # A mean of 1/w may not leave its range by a rounding error.
        return 1.0 / min(max(total / weights.area, weights.sums[0]), weights.sums[1])
    return float(mean(corners_of(records.reals, record, DEPTH), q0 / total, q1 / total, q2 / total))


@helper
def mean(corners, p0, p1, p2):
    """Mean of the three corners' values, weighted by p_i with Σ p_i = 1; never outside their range, whatever is
    rounded."""
    a0, a1, a2 = corners
    value = p0 * a0 + p1 * a1 + p2 * a2
    return min(max(value, min(a0, a1, a2)), max(a0, a1, a2))
