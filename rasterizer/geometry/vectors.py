"""Vector algebra on tuples of three numbers, for compiled code: a formula reads as the book has it, and costs no more.

Every function is inlined. Numbers keep their type: float32 stays float32 as long as no factor is an int. Each does the
same operations in the same order as the components written out, so it changes no bit. Without the compiler
(NUMBA_DISABLE_JIT) these are plain functions.
"""

import numpy as np

from ..compiler.kernels import helper


@helper
def vector_of_row(rows, i):
    """Return row i of an (n, 3) array."""
    return rows[i, 0], rows[i, 1], rows[i, 2]


@helper
def add(a, b):
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@helper
def subtract(a, b):
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@helper
def scale(a, factor):
    """Return a times a number."""
    return a[0] * factor, a[1] * factor, a[2] * factor


@helper
def divide(a, divisor):
    """Return a over a number; each component is rounded once, which a product with 1/divisor isn't."""
    return a[0] / divisor, a[1] / divisor, a[2] / divisor


@helper
def dot(a, b):
    """Return a·b, summed from the first component to the last."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@helper
def cross(a, b):
    """Return a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@helper
def length(a):
    """Return |a|; squares must neither over- nor underflow."""
    return np.sqrt(dot(a, a))
