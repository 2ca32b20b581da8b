"""Exact interpolation over the triangle of an exact record (records.py), for shade.py and buffers.py.

It is perspective-correct: with the edge functions e_i of a sample, q_i = e_i / w_i, an attribute is Σ q_i·a_i / Σ q_i (Blinn
1992, "Hyperbolic interpolation"). Nothing is extrapolated, and the e_i are exact integers, so slivers are as good as any.
"""

import numpy as np

from .._kernel import helper
from .records import IS_EXACT, IS_ID, LEVEL_MASK, PLACE


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
def place_of(integers, record):
    """The first vertex and the two edges that leave it, of an exact record, 1/256 px."""
    row, column = integers[record], np.uint64(PLACE)
    return (
        np.int64(row[column]), np.int64(row[column + np.uint64(1)]), np.int64(row[column + np.uint64(2)]),
        np.int64(row[column + np.uint64(3)]), np.int64(row[column + np.uint64(4)]), np.int64(row[column + np.uint64(5)]),
    )  # fmt: skip


@helper
def corners_of(numbers, record, column):
    """Three neighbouring numbers of an exact record: what it holds for its three corners."""
    column = np.uint64(column)
    return numbers[record, column], numbers[record, column + np.uint64(1)], numbers[record, column + np.uint64(2)]


@helper
def corner_weights(place, inv_w, sx, sy):
    """Perspective weights q_i = e_i / w_i of the three corners at the sample (sx, sy) (1/256 px); not normalised.

    The edge functions e_i are integers below 2^60: nothing is lost however long and thin the triangle is.
    """
    x0, y0, dx1, dy1, dx2, dy2 = place
    ux, uy = sx - x0, sy - y0
    e1 = ux * dy2 - uy * dx2
    e2 = uy * dx1 - ux * dy1
    e0 = (dx1 * dy2 - dx2 * dy1) - e1 - e2
    return float(e0) * inv_w[0], float(e1) * inv_w[1], float(e2) * inv_w[2]


@helper
def mean(corners, p0, p1, p2):
    """Mean of the three corners' values, weighted by p_i with Σ p_i = 1; never outside their range, whatever is rounded."""
    a0, a1, a2 = corners
    value = p0 * a0 + p1 * a1 + p2 * a2
    return min(max(value, min(a0, a1, a2)), max(a0, a1, a2))
