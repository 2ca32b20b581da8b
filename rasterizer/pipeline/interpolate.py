"""Exact interpolation over the triangles of exact setups (triangle_setups.py), and the walk over their runs of samples.

In:  a band after the scan stage: packed samples and setups.
Out: means of what the three corners of a triangle have, weighted for one sample, for the stages behind scan.

It is perspective-correct: with the edge functions e_i of a sample, q_i = e_i / w_i, an attribute is Σ q_i·a_i / Σ q_i
(Blinn 1992, "Hyperbolic interpolation"). Nothing is extrapolated, and the e_i are exact integers, so slivers are as
good as any.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper
from .gradients import Coding
from .scan import ScanCounts
from .setup import ExactTriangle, corner_weights
from .transform import SUBPIXEL
from .triangle_setups import ATTRIBUTE, DEPTH, EDGES, INV_W, TriangleSetups
from .visibility import CLEAR, INTENSITY_BITS, INTENSITY_MASK, IS_EXACT, IS_ID, VisibilityBuffer, is_exact, strip_of


class ScannedBand(NamedTuple):
    """What the scan stage leaves of a band, for the stages behind it."""

    visibility: VisibilityBuffer
    setups: TriangleSetups
    coding: Coding | None  # how attributes reach the samples; None of `uncoded` bands
    counts: ScanCounts  # what the scan stage found
    y_start: int  # the band's first row in the picture, samples
    n_row: int

    def uncoded(self) -> "ScannedBand":
        """Return the band for kernels that don't ask how it is coded: they are compiled once for all codings."""
        return self._replace(coding=None)


# ---------------------------------------------------------------- runs of samples


@helper
def row_extent(visibility, j):
    """Return the columns left..right of row j of the band that may show something; left >= right where none do."""
    strip = strip_of(j)
    return visibility.left[strip], visibility.right[strip]


@helper
def has_exact(packed):
    """Tell whether any packed sample holds the number of an exact setup."""
    union = 0
    for k in range(len(packed)):
        union |= packed[k] & (packed[k] >> INTENSITY_BITS)  # IS_ID is bit INTENSITY_BITS, IS_EXACT bit 0
    return (union & IS_EXACT) != 0


@helper
def has_planes(packed):
    """Tell whether any packed sample holds the number of a setup that isn't exact."""
    union = 0
    for k in range(len(packed)):
        union |= ~packed[k] & (packed[k] >> INTENSITY_BITS)
    return (union & IS_EXACT) != 0


@helper
def needs_decoding(packed):
    """Tell whether any packed sample shows a triangle without an exact setup: an intensity step, or planes."""
    union = False
    for k in range(len(packed)):
        union |= (packed[k] < CLEAR) & (not is_exact(packed[k]))
    return union


@helper
def run_end(packed, start):
    """Return the end of the run of samples that show the same setup as the one at `start`."""
    end = start + 1
    while end < len(packed) and (packed[end] ^ packed[start]) & (IS_ID | INTENSITY_MASK) == 0:
        end += 1
    return end


@helper
def next_exact_run(packed, start):
    """Find the next run of samples that show one exact setup: (start, end); an empty one where there is none.

    All that is interpolated over exact setups is so run by run:

        start, end = next_exact_run(packed, 0)
        while start < end:
            ...
            start, end = next_exact_run(packed, end)
    """
    n = len(packed)
    while start < n and not is_exact(packed[start]):
        start += 1
    return start, run_end(packed, start) if start < n else start


# ---------------------------------------------------------------- weights of the corners


@helper
def exact_triangle(setups, setup):
    """Read what the weights of an exact setup are computed from."""
    row, first = setups.integers[setup], EDGES
    dx1, dy1 = np.int64(row[first + 2]), np.int64(row[first + 3])
    dx2, dy2 = np.int64(row[first + 4]), np.int64(row[first + 5])
    w0, w1, w2 = corner_values(setups.reals, setup, INV_W)
    x0, y0 = np.int64(row[first]), np.int64(row[first + 1])
    area = float(dx1 * dy2 - dx2 * dy1)
    return ExactTriangle(x0, y0, dx1, dy1, dx2, dy2, (float(w0), float(w1), float(w2)), area)


@helper
def corner_values(reals, setup, column):
    """Return three neighbouring numbers of an exact setup: what it holds for its three corners."""
    return reals[setup, column], reals[setup, column + 1], reals[setup, column + 2]


@helper
def corner_vectors(setups, setup, attribute):
    """Return three neighbouring attributes of an exact setup from `attribute` on; each at the three corners."""
    column = ATTRIBUTE + 3 * attribute
    return (
        corner_values(setups.reals, setup, column),
        corner_values(setups.reals, setup, column + 3),
        corner_values(setups.reals, setup, column + 6),
    )


@helper
def sample_weights(triangle, first, k):
    """Return the weights as `corner_weights`, at sample k of a batch; `first` says where it lies (samples.py)."""
    return corner_weights(triangle, first[0] + k, first[1])


@helper
def weight_steps(triangle):
    """Return what one sample to the right, and one down, adds to the weights: two triples."""
    inv_w = triangle.inv_w
    x1, x2 = float(triangle.dy2 * SUBPIXEL), float(-triangle.dy1 * SUBPIXEL)
    y1, y2 = float(-triangle.dx2 * SUBPIXEL), float(triangle.dx1 * SUBPIXEL)
    # Edge functions 1 and 2; corner 0 loses what both gain.
    return (
        (-(x1 + x2) * inv_w[0], x1 * inv_w[1], x2 * inv_w[2]),
        (-(y1 + y2) * inv_w[0], y1 * inv_w[1], y2 * inv_w[2]),
    )


# ---------------------------------------------------------------- means


@helper
def mean(corners, p):
    """Return the mean of the three corners' values, weighted by p_i with Σ p_i = 1; never outside their range, whatever
    is rounded."""
    a0, a1, a2 = corners
    value = p[0] * a0 + p[1] * a1 + p[2] * a2
    return min(max(value, min(a0, a1, a2)), max(a0, a1, a2))


@helper
def mean_vector(corners, p):
    """Return the weighted means of three attributes, see `mean`."""
    return mean(corners[0], p), mean(corners[1], p), mean(corners[2], p)


@helper
def rounded(p, real):
    """Return three weights in the type of what they weight: float32 arithmetic stays float32."""
    return real(p[0]), real(p[1]), real(p[2])


@helper
def depth_at(setups, setup, triangle, q, is_perspective):
    """Return the depth along the viewing axis, scene units, at a sample with the weights q_i."""
    return mean_depth(triangle, corner_values(setups.reals, setup, DEPTH), q, is_perspective)


@helper
def mean_depth(triangle, depths, q, is_perspective):
    """Return the depth of a triangle's plane at a sample; `depths` is what the setup holds of it
    (triangle_setups.py)."""
    if is_perspective:
        # A mean of 1/w may not leave its range by a rounding error.
        least, largest = inverse_range(triangle, depths)
        return 1.0 / min(max(plane_inverse(triangle, depths, q), least), largest)
    total = q[0] + q[1] + q[2]
    return float(mean(depths, (q[0] / total, q[1] / total, q[2] / total)))


@helper
def plane_inverse(triangle, depths, q):
    """Return 1/w of a triangle's plane at a sample, in perspective; see `mean_depth`."""
    return (q[0] * depths[0] + q[1] * depths[1] + q[2] * depths[2]) / triangle.area


@helper
def inverse_range(triangle, depths):
    """Return the least and the largest 1/w of a triangle's plane within it, in perspective."""
    a, b, c = triangle.inv_w[0] * depths[0], triangle.inv_w[1] * depths[1], triangle.inv_w[2] * depths[2]
    return min(a, b, c), max(a, b, c)
