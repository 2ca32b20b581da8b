"""Arrays as callers give them, and as a scene keeps them: read as numbers, and fixed, so that nobody can change them.

A masked array is no array of numbers: its masked values would count.
"""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError, cut

VectorLike: TypeAlias = Sequence[float] | NDArray[Any]  # three numbers, as a caller may give them
_Scalar = TypeVar("_Scalar", bound=np.generic)


def plain_array(values: ArrayLike) -> NDArray:
    """Return `np.asarray(values)`, numbers beyond float64 as infinities.

    Parameters
    ----------
    values : anything that numpy reads, of any shape and dtype; or an array that other libraries share by DLPack

    Returns
    -------
    array of the same shape; longer floats become float64

    Raises
    ------
    TypeError, ValueError : no array, or a masked one, whose masked values would count
    SceneError : an array of another library that numpy can't read: one on a GPU, one that needs its gradient
    """
    # `np.ma` would say so, but takes as long to import as a small model.
    if isinstance(values, np.ndarray) and hasattr(values, "mask") and np.any(values.mask):
        raise ValueError("masked values are no numbers")
    if isinstance(values, np.ndarray) or not (hasattr(values, "__array__") or hasattr(values, "__dlpack__")):
        array = np.asarray(values)
    else:
        array = _read_foreign(values)
    if array.dtype.kind == "f" and array.dtype.itemsize > 8:
        with np.errstate(over="ignore"):
            array = array.astype(np.float64)
    return array


def _read_foreign(values: Any) -> NDArray:
    """Return an array of another library, by its own protocol for numpy, else by DLPack; what it refuses it says."""
    try:
        return np.asarray(values) if hasattr(values, "__array__") else np.from_dlpack(values)
    except (TypeError, ValueError, RuntimeError, BufferError) as fault:
        how = "give x.detach().cpu().numpy() of a torch.Tensor x, x.get() of a CuPy array"
        raise SceneError(f"numpy can't read this {type(values).__name__} ({cut(fault, 120)}): {how}") from None


def real_array(values: Any, read: Callable[[Any], NDArray[Any]] = plain_array) -> NDArray[Any] | None:
    """Return what `read` does where it is an array of real numbers (booleans are none), else None."""
    try:
        array = read(values)
    except SceneError:
        raise
    except (TypeError, ValueError):
        return None
    return array if array.dtype.kind in "fiu" else None


def distinct(values: NDArray) -> NDArray:
    """Return the distinct ones of whole numbers (n,), ascending.

    `np.unique` would do, but imports `np.ma`, to see whether some are masked.
    """
    ordered = np.sort(values)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])[: len(ordered)]]


# --- arrays that nobody can change ---------------------------------------------------------------------------


class _Owned(np.ndarray):
    """Marks memory that was taken over by `fixed`."""


def fixed(array: NDArray[_Scalar]) -> NDArray[_Scalar]:
    """Take over an array's memory: return it contiguous, and so that it can neither be written through nor be made
    writable.

    Numpy lets a read-only view be made writable again where its memory is; so what lies between is a read-only buffer.
    Whoever calls this must hold the only reference that can write: an index changed afterwards would make kernels read
    anywhere.
    """
    if is_fixed(array):
        return np.ascontiguousarray(array)
    return np.asarray(memoryview(np.ascontiguousarray(array).view(_Owned)).toreadonly())  # type: ignore[arg-type]


def is_fixed(array: NDArray) -> bool:
    """Tell whether an array is one made by `fixed`, or a view of one."""
    base: Any = array
    while type(base) is np.ndarray:
        base = base.base
    return type(base) is memoryview and type(base.obj) is _Owned


def own_array(values: ArrayLike) -> NDArray:
    """Return what `plain_array` does in memory that nobody else writes to, so that it stays what is checked.

    An array that was fixed is shared: what a mesh hands on to another takes no memory twice.
    """
    array = plain_array(values)
    is_new = type(values) in (list, tuple)  # of anything else numpy may have made a view
    is_new |= isinstance(values, np.ndarray) and not np.may_share_memory(array, values)
    return array if is_new or is_fixed(array) else array.copy()


class KeepsArrays:
    """What holds fixed arrays: those that come from pickle or from a deep copy are fixed, too."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        for key, value in state.items():
            self.__dict__[key] = fixed(np.array(value)) if isinstance(value, np.ndarray) else value
