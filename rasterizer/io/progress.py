"""Tell whoever waits how far the reading of a large file has come.

Readers call `report` as often as they like; it costs nothing where nobody listens. A listener is there for the block of
`noticing_progress`, in its own thread.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_listener: ContextVar[Callable[[int, int, str], object] | None] = ContextVar("progress of reading", default=None)


@contextmanager
def noticing_progress(show: Callable[[int, int, str], object]) -> Iterator[None]:
    """Call show(n_done, n, what) inside the block whenever a reader has come further; None makes it silent again."""
    token = _listener.set(show)
    try:
        yield
    finally:
        _listener.reset(token)


def report(n_done: int, n: int, what: str) -> None:
    """Say that `n_done` of `n` parts of some work are done."""
    show = _listener.get()
    if show is not None:
        show(n_done, n, what)
