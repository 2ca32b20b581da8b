"""On which side of a line a point lies, exactly.

The sign of a 2 x 2 determinant of differences: in floating point where its error bound leaves no doubt, else as the sum
of six exact products (Shewchuk 1997, Discrete & Computational Geometry 18(3), 305-363).
"""

from ..compiler.kernels import helper

_SPLITTER = 2.0**27 + 1.0
# The error of a computed turn, relative to the sum of its products (Shewchuk 1997, section 4.3).
_TURN_ERROR = (3.0 + 16.0 * 2.0**-53) * 2.0**-53
_LEAST = 2.0**-900  # below it products lose digits
N_PART = 13  # room for an exact sum: each of the six products adds two parts


@helper
def turn_of(a, b, c, parts):
    """Return the sign of the turn a b c, exactly: 1 is counter-clockwise, 0 straight."""
    left, right = (a[0] - c[0]) * (b[1] - c[1]), (a[1] - c[1]) * (b[0] - c[0])
    area, total = left - right, abs(left) + abs(right)
    if abs(area) > _TURN_ERROR * total and total > _LEAST:
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
