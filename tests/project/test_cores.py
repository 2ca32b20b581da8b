"""Tests of work that a thread does ahead of the caller."""

import threading

import pytest

from rasterizer.cores import ahead


def counting(n, fault=None):
    yield from range(n)
    if fault is not None:
        raise fault


def test_items_that_are_taken_ahead_come_in_order_and_so_does_what_is_raised():
    n_thread = threading.active_count()
    assert list(ahead(counting(50), 3)) == list(range(50)) and list(ahead([], 3)) == []
    items = []
    with pytest.raises(OSError, match="no more"):
        items.extend(ahead(counting(5, OSError("no more")), 2))
    assert threading.active_count() == n_thread, "a thread is left"


def test_items_that_nobody_wants_are_not_taken():
    taken = []
    items = ahead((taken.append(k) or k for k in range(1000)), 3)
    assert [next(items), next(items)] == [0, 1]
    items.close()
    assert len(taken) <= 6, f"{len(taken)} items taken"
