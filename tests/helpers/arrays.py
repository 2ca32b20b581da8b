"""What is different in two arrays, in words: the first line of a test that fails."""

from collections.abc import Callable

import numpy as np


def differences(found, expected, equal_nan=False) -> str:
    """Say how many values differ and which is the first; "" where none does.

    What is expected has the same shape, or is one number or tuple, as a colour or a vector, for all.
    """
    both_nan = (lambda a, b: np.isnan(a) & np.isnan(b)) if equal_nan else lambda a, b: False
    return in_words(found, expected, lambda a, b: (a == b) | both_nan(a, b))


def deviations(found, expected, rtol=1e-5, atol=1e-8) -> str:
    """Say how many values differ by more than `np.allclose` admits, as `differences` does."""
    return in_words(found, expected, lambda a, b: np.isclose(a, b, rtol, atol))


def in_words(found, expected, are_same: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> str:
    """Say how many values aren't the same, and which is the first."""
    is_for_all = np.ndim(expected) == 0 or isinstance(expected, tuple)
    found, expected = np.asarray(found), np.asarray(expected)
    if expected.shape != found.shape[found.ndim - expected.ndim if is_for_all else 0 :]:
        return f"the shape is {found.shape} instead of {expected.shape}"
    is_same = np.asarray(are_same(found, expected))
    if is_same.all():
        return ""
    place = tuple(int(k) for k in np.argwhere(~is_same)[0])
    one, other = found[place], np.broadcast_to(expected, found.shape)[place]
    return f"{(~is_same).sum()} of {is_same.size} values differ, the first at {place}: {one} instead of {other}"
