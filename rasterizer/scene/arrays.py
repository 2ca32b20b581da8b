"""Arrays as callers give them: of any kind that numpy reads, but never masked."""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

VectorLike: TypeAlias = Sequence[float] | NDArray[Any]  # three numbers, as a caller may give them


def plain_array(values: ArrayLike) -> NDArray:
    """Return `np.asarray(values)`, numbers beyond float64 as infinities.

    Parameters
    ----------
    values : anything that numpy reads, of any shape and dtype

    Returns
    -------
    array of the same shape; longer floats become float64

    Raises
    ------
    TypeError, ValueError : no array, or a masked one, whose masked values would count
    """
    if is_masked(values):
        raise ValueError("masked values are no numbers")
    array = np.asarray(values)
    if array.dtype.kind == "f" and array.dtype.itemsize > 8:
        with np.errstate(over="ignore"):
            array = array.astype(np.float64)
    return array


def is_masked(values: object) -> bool:
    """Tell whether an array has masked values. `np.ma` would say so, but takes as long to import as a small model."""
    return isinstance(values, np.ndarray) and bool(np.any(getattr(values, "mask", False)))


def distinct(values: NDArray) -> NDArray:
    """Return the distinct ones of whole numbers (n,), ascending.

    `np.unique` would do, but imports `np.ma`, to see whether some are masked.
    """
    ordered = np.sort(values)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])[: len(ordered)]]
