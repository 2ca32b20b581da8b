"""What all bounds of rounding share: the unit roundoffs, where a picture jumps, products with infinity."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

SINGLE, DOUBLE = 2.0**-24, 2.0**-53  # u, the unit roundoff, of float32 and float64


class Discontinuity(NamedTuple):
    """Where a picture may jump, so that no error is small: what rounding carries across is no part of the bound."""

    cause: str
    near: float  # how near to that the bound doesn't hold
    unit: str  # of `near`


def step_cosine(u: float) -> float:
    """Return how near to a step of a cosine no bound holds: twice what counts as 0, see `grazing` in
    pipeline/power.py."""
    return 2.0**-19 if u == SINGLE else 2.0**-39


def times(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """Return products in which 0 times infinity is 0: a light that gives nothing can't be amplified.

    a, b : (...) without NaN
    """
    with np.errstate(invalid="ignore"):
        product = np.asarray(np.multiply(a, b), float)
    return np.where(np.isnan(product), 0.0, product)
