"""The lock of whoever loads or compiles kernels, and what a fork waits for.

A forked process has none of the other threads. What they held locked stays locked in it for ever, and what they were
importing is never there. So a fork waits until no other thread is loading or compiling a kernel, is in numba's compiler
or in LLVM, or is importing a module of this package, of those that it needs, or of Python. One function takes all these
locks, in the order in which a thread that compiles takes them:

    LOCK ── numba's compiler lock ── locks of modules that are imported ── llvmlite's lock

Locks that a picture is drawn under aren't waited for: whoever has one of those makes it anew (`renew_in_child`).

This module is imported before any other where a public name is first used, so that a fork finds it in place.
"""

import functools
import logging  # noqa: F401  first: a fork then takes its lock after those here, as a thread that imports does
import os
import sys
import threading
import weakref
from contextlib import ExitStack, suppress
from importlib import import_module
from typing import Any, Protocol, TypeVar

LOCK = threading.RLock()  # who loads or compiles a kernel

# Modules whose import a fork waits for: while they are imported they wait for no other thread. Those of a program may.
_IMPORTED = {"rasterizer", "numpy", "numba", "llvmlite", "PIL", "trimesh", "scipy", *sys.stdlib_module_names}
_taken = ExitStack()  # what the fork that is under way has taken, which it alone releases


def _take_locks() -> None:
    """Wait for what other threads are at, and let them begin nothing that the new process would wait for."""
    _take(LOCK)
    _take(getattr(sys.modules.get("numba.core.compiler_lock"), "global_compiler_lock", None))
    # Python's own table: the modules that a thread imports now. There is no public one.
    importing = getattr(sys.modules["importlib._bootstrap"], "_module_locks", {})
    waited_for: set[str] = set()
    while names := {name for name in list(importing) if name.partition(".")[0] in _IMPORTED} - waited_for:
        waited_for |= names
        for name in names:
            with suppress(Exception):  # whoever imports it meets that
                import_module(name)
    _take(getattr(getattr(sys.modules.get("llvmlite.binding.ffi"), "lib", None), "_lock", None))


def _take(lock: Any) -> None:
    if lock is not None:
        _taken.enter_context(lock)


class Renewed(Protocol):
    """What has a lock or threads of its own."""

    def renew(self) -> None:
        """Make them anew, in a process that was just forked."""


_renewed: "weakref.WeakSet[Renewed]" = weakref.WeakSet()
renew_in_child = _renewed.add


def _start_child() -> None:
    _taken.close()
    for each in _renewed:
        each.renew()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_take_locks, after_in_parent=_taken.close, after_in_child=_start_child)


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
