"""Vectors as tuples of three numbers: what compiled code writes formulas with.

The compiler inlines every one of these and keeps the numbers in registers, so a formula costs what it costs written out
component by component. Sums run in the order x, y, z. The type of the numbers is kept: float32 stays float32 as long as
no factor is an int.
"""

import numpy as np

from ..compiler.kernels import helper


@helper
def dot(a, b):
    """Return the dot product a·b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@helper
def cross(a, b):
    """Return the cross product a×b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


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
    """Return the vector a times a number."""
    return a[0] * factor, a[1] * factor, a[2] * factor


@helper
def length(a):
    """Return the length |a|."""
    return np.sqrt(dot(a, a))
