"""Turns: exact, however near the three points are to a line."""

import numba
import numpy as np

from rasterizer.geometry.ears import N_PART, exact_turn, turn_of


@numba.njit
def turns(points, parts):
    """The turn of three points, (3, 2), in both ways, compiled as they are in the kernel that cuts ears."""
    a, b, c = (points[0, 0], points[0, 1]), (points[1, 0], points[1, 1]), (points[2, 0], points[2, 1])
    return exact_turn(a, b, c, parts), turn_of(a, b, c, parts)


def test_turns_are_exact():
    """Against whole numbers: points on a line, and a little beside it."""
    rng, parts = np.random.default_rng(7), np.full(N_PART, np.nan)
    for _ in range(1000):
        points = rng.integers(-(2**26), 2**26, (3, 2)) * 2 ** int(rng.integers(0, 26))
        if rng.random() < 0.7:
            a, b = points[:2]
            points[2] = a + (b - a) * int(rng.integers(-3, 4)) + (0, int(rng.integers(-1, 2)))
        (ax, ay), (bx, by), (cx, cy) = points.tolist()
        area = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
        expected, found = (area > 0) - (area < 0), turns(points * 2.0**-54, parts)
        assert np.sign(found).tolist() == [expected] * 2, f"{points.tolist()}: {found} != {expected}"
