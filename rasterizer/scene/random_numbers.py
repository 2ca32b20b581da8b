"""Random numbers by a stated seed: the same on every machine, in every version of numpy, in any order of calls.

In:  a seed and a number for what is drawn by it        Out: floats within [0, 1), ranges

The bits are those of numpy's Philox generator and SeedSequence, which stay the same, as numpy promises for both; what
its distributions make of them may change.
"""

import math
from typing import Any

from ..errors import SceneError, shown
from .validate import items_of, number, whole

VIEW, LIGHTS = range(2)  # what is drawn by one seed doesn't depend on each other


def uniform_numbers(seed: object, what: int, n: int) -> list[float]:
    """Return n numbers within [0, 1), evenly distributed, of 53 bits.

    Parameters
    ----------
    seed : whole number, at least 0
    what : VIEW or LIGHTS

    Raises
    ------
    SceneError : a seed that is not legal
    """
    from numpy.random import Philox, SeedSequence  # takes as long as all of numpy

    bits = Philox(SeedSequence(whole(seed, "seed", 0), spawn_key=(what,))).random_raw(n)
    return [float(each) for each in (bits >> 11) * 2.0**-53]


def checked_range(value: Any, what: str, low: float, high: float) -> tuple[float, float]:
    """Return a range as two floats, one number as both its ends; SceneError where it isn't within low..high."""
    ends = items_of(value) or [value, value]
    if isinstance(value, (str, bytes)) or len(ends) != 2:
        raise SceneError(f"{what} must be a number or a pair of them; given {shown(value)}")
    first, last = (number(each, f"each end of {what}") for each in ends)
    if not low <= first <= last <= high:
        raise SceneError(f"{what} must be a range within {low:g}..{high:g}; given {shown(value)}")
    return first, last


def within(ends: tuple[float, float], share: float) -> float:
    """Return the number that lies at a share of a range."""
    return ends[0] + share * (ends[1] - ends[0])


def elevation_at(ends: tuple[float, float], share: float) -> float:
    """Return the elevation, degrees, up to which a share of the zone of a sphere between two elevations lies.

    Source: Archimedes: zones of one height have one area, so the sine of the elevation is evenly distributed.
    """
    low, high = (math.sin(math.radians(end)) for end in ends)
    return math.degrees(math.asin(min(max(within((low, high), share), -1.0), 1.0)))
