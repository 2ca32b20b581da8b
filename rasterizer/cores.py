"""How many processors this process may use, and threads to use them with: kernels release the GIL, so plain Python
threads run them side by side. Nothing but the standard library is imported.
"""

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable
from contextvars import copy_context
from typing import Any, TypeVar

_T = TypeVar("_T")

# A part of a stage is worth a thread of its own from here on. To wake a thread, and to be woken when it is done, takes
# about as long as a light takes for this many vertices.
MIN_PART = 32_768
PARTS_PER_THREAD = 4  # more parts than threads, so that a delayed thread does not hold up the stage


def n_core() -> int:
    """Return how many threads or processes can work at the same time."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Workers:
    """A fixed number of threads, the caller's among them; with one thread everything runs in the caller's.

    `lock` is for those who share the workers: who draws a picture holds it. A process that is forked has neither
    the threads nor, perhaps, the holder of the lock: there both are made anew.
    """

    def __init__(self, n_thread: int) -> None:
        from .locks import renew_in_child  # a command line's help has no need of it

        self.n_thread = n_thread
        self.renew()
        renew_in_child(self)

    def renew(self) -> None:
        """Begin with a lock that is free and without threads, which are started when they are needed."""
        self.lock, self._helpers = threading.RLock(), None

    def __enter__(self) -> "Workers":
        return self

    def close(self, *_: object) -> None:
        """End the threads; what is mapped afterwards is done on the caller's."""
        self.n_thread = 1
        if self._helpers is not None:
            self._helpers.shutdown()

    __exit__ = close

    def ranges(self, n: int, min_part: int = MIN_PART) -> list[tuple[int, int]]:
        """Divide range(n) into parts that are worth a thread each, `min_part` or more, in order; at least one part."""
        n_part = 1 if self.n_thread == 1 else max(1, min(self.n_thread * PARTS_PER_THREAD, n // min_part))
        return [(n * k // n_part, n * (k + 1) // n_part) for k in range(n_part)]

    def map(self, function: Callable[[Any], _T], items: Iterable[Any]) -> list[_T]:
        """Call `function` with every item, on the threads where there is more than one; results in the items' order.

        Every thread takes the next item when it is done with one, in the caller's context. The caller's begins at once,
        while others are still waking. They take no further item when one has failed; what is raised here then, when all
        have stopped, is what the first item raises that fails. Where no more threads can be started, those there are do
        it all.
        """
        items = list(items)
        n_helper = min(self.n_thread, len(items)) - 1
        if n_helper < 1:
            return list(map(function, items))
        results, numbers, failures = [None] * len(items), iter(range(len(items))), {}

        def work() -> None:
            for number in numbers:  # a range's iterator hands every number to one thread only
                try:
                    results[number] = function(items[number])
                except BaseException as fault:  # noqa: BLE001  raised where `map` was called
                    failures[number] = fault
                    deque(numbers, 0)  # nobody takes another one

        shares = []
        try:
            try:
                if self._helpers is None:
                    from concurrent.futures import ThreadPoolExecutor

                    self._helpers = ThreadPoolExecutor(self.n_thread - 1)
                for _ in range(n_helper):
                    shares.append(self._helpers.submit(copy_context().run, work))
            except RuntimeError:  # the process may have no more of them, or is ending
                self.n_thread = 1 + len(shares)
            work()
            for share in shares:
                share.cancel() or share.result()  # one that nobody has begun isn't waited for
        except BaseException:  # Ctrl-C: nobody may go on drawing into what the caller has given up
            deque(numbers, 0)
            if self._helpers is not None:
                self._helpers.shutdown()
            self._helpers = None
            raise
        if failures:
            raise failures[min(failures, key=lambda number: (isinstance(failures[number], Exception), number))]
        return results
