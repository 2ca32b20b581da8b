"""The lock of whoever loads or compiles kernels, and what a forked process makes anew.

A forked process has none of the other threads, and what they held locked stays locked in it for ever. So locks and
threads of this package are made anew there (`renew_in_child`). Those of numba, of LLVM and of Python's imports aren't:
who forks while another thread compiles a kernel or imports a module may wait for ever, as in any program with numba.
"""

import functools
import os
import sys
import threading
import weakref
from collections.abc import Callable
from contextlib import nullcontext
from typing import Any, Protocol, TypeVar


class Renewed(Protocol):
    """What has a lock or threads of its own."""

    def renew(self) -> None:
        """Make them anew, in a process that was just forked."""


LOCK = threading.RLock()  # who loads or compiles a kernel
_renewed: "weakref.WeakSet[Renewed]" = weakref.WeakSet()
renew_in_child = _renewed.add


def _renew_all() -> None:
    LOCK._at_fork_reinit()  # type: ignore[attr-defined]  # as the standard library does with its own
    for each in _renewed:
        each.renew()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew_all)


if sys.version_info >= (3, 12):
    cached_property = functools.cached_property
else:
    _T = TypeVar("_T")

    class cached_property(functools.cached_property[_T]):
        """That of Python 3.12, which has no lock.

        The one of older versions holds a lock for all objects of a class while it computes a value. A thread that needs
        a kernel for that would wait for LOCK, while the thread that has LOCK waits for such a value.
        """

        def __init__(self, function: Callable[[Any], _T]) -> None:
            super().__init__(function)
            self.lock: Any = nullcontext()
