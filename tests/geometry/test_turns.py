"""Turns: exact, however near the three points are to a line."""

import numba
import numpy as np

from rasterizer.geometry.turns import N_PART, exact_turn


@numba.njit
def turn_exactly(points, parts):
    """The exact turn of three points, (3, 2), compiled as it is in the kernel that cuts ears."""
    a, b, c = (points[0, 0], points[0, 1]), (points[1, 0], points[1, 1]), (points[2, 0], points[2, 1])
    return exact_turn(a, b, c, parts)


def test_turns_are_exact():
    """Against whole numbers: points on a line, and a little beside it."""
    rng, parts = np.random.default_rng(7), np.full(N_PART, np.nan)
    for _ in range(2000):
        a, b, c = rng.integers(-(2**26), 2**26, (3, 2)) * 2 ** int(rng.integers(0, 26))
        if rng.random() < 0.7:
            c = a + (b - a) * int(rng.integers(-3, 4)) + (0, int(rng.integers(-1, 2)))
        (ax, ay), (bx, by), (cx, cy) = ([int(value) for value in point] for point in (a, b, c))
        expected = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
        scaled = [tuple(float(value) * 2.0**-54 for value in point) for point in ((ax, ay), (bx, by), (cx, cy))]
        assert turn_exactly(np.array(scaled), parts) == (expected > 0) - (expected < 0)
