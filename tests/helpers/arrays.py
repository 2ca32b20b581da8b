"""What is different in two arrays, in words: the first line of a test that fails."""

import numpy as np


def differences(found, expected, rtol=0.0, atol=0.0, equal_nan=False) -> str:
    """Say how many values differ and which is the first; "" where none does.

    What is expected is broadcast to the shape of what is found. With a tolerance, values may differ as `np.allclose`
    says.
    """
    found, expected = np.asarray(found), np.asarray(expected)
    if np.broadcast_shapes(found.shape, expected.shape) != found.shape:
        return f"the shape is {found.shape} instead of {expected.shape}"
    is_same = np.isclose(found, expected, rtol, atol, equal_nan) if rtol or atol else np.asarray(found == expected)
    if equal_nan:
        is_same = is_same | (np.isnan(found) & np.isnan(expected))
    if is_same.all():
        return ""
    place = tuple(int(k) for k in np.argwhere(~is_same)[0])
    one, other = found[place], np.broadcast_to(expected, found.shape)[place]
    return f"{(~is_same).sum()} of {is_same.size} values differ, the first at {place}: {one} instead of {other}"
