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
from typing import Any, Protocol, TypeVar


class Renewed(Protocol):
    """What has a lock or threads of its own."""

    def renew(self) -> None:
        """Make them anew, in a process that was just forked."""


_renewed: "weakref.WeakSet[Renewed]" = weakref.WeakSet()
renew_in_child = _renewed.add


def _renew_all() -> None:
    for each in _renewed:
        each.renew()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew_all)


class KernelLock:
    """A lock that its holder may take again, and that nobody holds in a forked process."""

    def __init__(self) -> None:
        self.renew()
        renew_in_child(self)

    def renew(self) -> None:
        """Begin with a lock that is free."""
        self._lock = threading.RLock()

    def __enter__(self) -> None:
        self._lock.acquire()

    def __exit__(self, *_: object) -> None:
        self._lock.release()


LOCK = KernelLock()  # who loads or compiles a kernel


if sys.version_info >= (3, 12):
    cached_property = functools.cached_property
else:
    _T = TypeVar("_T")

    class cached_property(functools.cached_property[_T]):
        """That of Python 3.12, which has no lock.

        The one of older versions holds a lock for all objects of a class while it computes a value. A thread that needs
        a kernel for that would wait for LOCK, while the thread that has LOCK waits for such a value.
        """

        def __get__(self, instance: Any, owner: Any = None) -> Any:
            """Compute the value, and keep it in the object."""
            if instance is None:
                return self
            value = instance.__dict__[self.attrname] = self.func(instance)
            return value
