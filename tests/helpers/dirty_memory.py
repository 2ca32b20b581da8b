"""Memory that nobody has filled, and memory that is used again, full of chosen bytes: nothing may depend on them."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

# As float32 and float64: 0; NaN (-1 as an integer); 3.0 and 32.5; -0.75 and -0.09; 2.4e38 and 1.4e306. None = random.
FILLINGS = 0x00, 0xFF, 0x40, 0xBF, 0x7F, None
RANDOM = np.random.default_rng(4).integers(0, 256, 4099, np.uint8)


def dirty(array: np.ndarray, filling: int | None) -> np.ndarray:
    """Fill an array with one byte, or with random ones; those of bool stay bool. Return it."""
    if array.size == 0 or array.dtype.hasobject or not array.flags.writeable:
        return array
    mask = 1 if array.dtype == np.bool_ else 255
    if filling is None:
        content = RANDOM[np.arange(array.nbytes) % len(RANDOM)] & mask
    else:
        content = np.full(array.nbytes, filling & mask, np.uint8)
    array[...] = content.view(array.dtype).reshape(array.shape)
    return array


@contextmanager
def dirty_memory(filling: int | None) -> Iterator[None]:
    """Let `np.empty` and `np.empty_like` return arrays full of one byte, or of random ones.

    No kernel must be compiled meanwhile: the compiler knows `np.empty` by what it is. None allocates an array itself.
    """
    empty, empty_like = np.empty, np.empty_like
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(np, "empty", lambda *given, **options: dirty(empty(*given, **options), filling))
        patch.setattr(np, "empty_like", lambda *given, **options: dirty(empty_like(*given, **options), filling))
        yield
