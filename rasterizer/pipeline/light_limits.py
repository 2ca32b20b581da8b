"""Where lights end: whether all points of a batch lie beyond a light's range or outside its cone, so that nothing of it
is evaluated for them.

In:  POSITION of the batch (fragments.py), and a row of limits for each light, which engine/uniforms.py writes.
Out: whether the light's strength is exactly 0 at every point: then it is left out, and no bit of a sum changes.

All points lie in a box along the axes, and in the sphere round the box. A light function compares (d/r)² with 1,
rounded by less than 16 u: the range here is larger by SLACK. It compares the cosine of the angle from the axis, rounded
by less than 12 u, with that of the cone, or with 2^-20 less where the cone is sharp (`grazing`): the cone here is wider
by COSINE_SLACK. What is rounded here is less than SLACK of the lengths. u is at most 2^-24.

The sphere of radius s about c, seen from the light at the distance d under the angle φ from the axis, lies outside a
cone with the half angle o <= 90 degrees where d sin(φ - o) > s: that is the distance from the cone's surface, or less.
"""

import numpy as np

from ..compiler.kernels import choice, helper, index
from ..geometry.vectors import add, dot, scale, subtract
from . import fragments as f
from .fragments import get_vector, read_vector
from .power import is_single

# A row of limits: the light's position relative to the eye; its range, infinite where it has none; axis, cosine and
# sine of a cone, 0 where it has none.
POSITION, RANGE, AXIS, COSINE, SINE = 0, 3, 4, 7, 8
N_LIMIT = 9
SLACK = 2.0**-18  # of lengths
COSINE_SLACK = 2.0**-18
FLIPPED = np.int32(0x7FFFFFFF)


@choice(lambda batch, n: bound_single if is_single(batch.dtype) else bound_double)
def bound_positions(batch, n):
    """Return the corners (low, high) of a box round the positions of n points; one round nothing without any.

    A point with a component that is no number may lie outside: its light is 0.
    """
    return bound_single(batch, n) if batch.dtype == np.float32 else bound_double(batch, n)


@helper
def bound_single(batch, n):
    """See `bound_positions`: by whole numbers that are in the order of the floats, whose least ones vector instructions
    find."""
    x, y, z = order_of(np.float32(np.inf)), order_of(np.float32(np.inf)), order_of(np.float32(np.inf))
    x_end, y_end, z_end = order_of(np.float32(-np.inf)), order_of(np.float32(-np.inf)), order_of(np.float32(-np.inf))
    for k in range(index(n)):
        a, b, c = get_vector(batch, f.POSITION, k)
        i, j, m = order_of(a), order_of(b), order_of(c)
        x, y, z = i if i < x else x, j if j < y else y, m if m < z else z
        x_end, y_end, z_end = i if i > x_end else x_end, j if j > y_end else y_end, m if m > z_end else z_end
    return (of_order(x), of_order(y), of_order(z)), (of_order(x_end), of_order(y_end), of_order(z_end))


@helper
def order_of(number):
    """Return an int32 for a float32, larger for larger numbers: of negative ones all bits but the sign are flipped."""
    bits = np.float32(number).view(np.int32)
    return np.int32(bits ^ np.int32(np.int32(bits >> np.int32(31)) & FLIPPED))


@helper
def of_order(bits):
    """Return the float32 that `order_of` has made a number of."""
    return np.int32(bits ^ np.int32(np.int32(bits >> np.int32(31)) & FLIPPED)).view(np.float32)


@helper
def bound_double(batch, n):
    """See `bound_positions`."""
    x = y = z = np.inf
    x_end = y_end = z_end = -np.inf
    for k in range(index(n)):
        a, b, c = get_vector(batch, f.POSITION, k)
        x, y, z = a if a < x else x, b if b < y else y, c if c < z else z
        x_end, y_end, z_end = a if a > x_end else x_end, b if b > y_end else y_end, c if c > z_end else z_end
    return (x, y, z), (x_end, y_end, z_end)


@helper
def is_within(box, limits):
    """Tell whether some point of a box may lie within the limits of a light.

    Parameters
    ----------
    box : corners (low, high), relative to the eye
    limits : (N_LIMIT,) the light's row
    """
    (low, high), light = box, read_vector(limits, POSITION)
    real = limits.dtype.type
    half, slack = real(0.5), real(SLACK)
    beside = beyond(low[0], high[0], light[0]), beyond(low[1], high[1], light[1]), beyond(low[2], high[2], light[2])
    is_near = not dot(beside, beside) > limits[RANGE] * limits[RANGE]
    center, size = scale(add(low, high), half), subtract(high, low)
    away, axis = subtract(center, light), read_vector(limits, AXIS)
    along = dot(away, axis)
    across = subtract(away, scale(axis, along))
    rounded = slack * (abs(center[0]) + abs(center[1]) + abs(center[2]) + np.sqrt(dot(away, away)))
    radius = half * np.sqrt(dot(size, size)) + rounded
    is_outside = np.sqrt(dot(across, across)) * limits[COSINE] - along * limits[SINE] > radius
    return is_near and not ((limits[COSINE] > real(0)) & is_outside)


@helper
def beyond(low, high, number):
    """Return how far a number lies outside a range, at least 0."""
    below, above = low - number, number - high
    outside = below if below > above else above
    return outside if outside > 0 else type(outside)(0)
