"""Tests of what is asked of arrays as callers give them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rasterizer.scene.arrays import distinct, is_masked, plain_array

MASKED = np.ma.array([1.0, 2.0], mask=[False, True])
UNMASKED = np.ma.array([1.0, 2.0])


@given(st.lists(st.integers(-5, 5)))
def test_distinct_numbers_are_those_of_numpy(numbers):
    array = np.array(numbers, np.int64)
    assert distinct(array).tolist() == np.unique(array).tolist()


@pytest.mark.parametrize("values", [MASKED, UNMASKED, np.ones(2), [1, 2], None, "text", (MASKED, 1)])
def test_what_is_masked_is_what_numpy_calls_so(values):
    assert is_masked(values) == (isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values))


def test_masked_values_are_refused_and_masks_that_hide_nothing_are_not():
    with pytest.raises(ValueError, match="masked"):
        plain_array(MASKED)
    assert type(plain_array(UNMASKED)) is np.ndarray
