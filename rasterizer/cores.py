"""How many processors this process may use, and threads to use them with: kernels release the GIL, so plain Python
threads run them side by side. Nothing but the standard library is imported.

A thread waits for calls in a queue. An executor of `concurrent.futures` would do, but a call through it takes
longer, and it would have to be imported.
"""

import os
import threading
import weakref
from collections.abc import Callable, Iterable
from contextvars import copy_context
from functools import partial
from queue import SimpleQueue
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
        self._start()
        renew_in_child(self)

    def __enter__(self) -> "Workers":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def renew(self) -> None:
        """Start anew, in a forked process."""
        self._end.detach()
        self._start()

    def _start(self) -> None:
        self.lock = threading.RLock()
        self._calls, self._helpers = SimpleQueue(), []  # the threads, but for the caller's, are started when needed
        self._end = weakref.finalize(self, self._calls.put, None)

    def ranges(self, n: int, min_part: int = MIN_PART) -> list[tuple[int, int]]:
        """Divide range(n) into parts that are worth a thread each, `min_part` or more, in order; at least one part."""
        n_part = 1 if self.n_thread == 1 else max(1, min(self.n_thread * PARTS_PER_THREAD, n // min_part))
        cuts = [n * k // n_part for k in range(n_part + 1)]
        return list(zip(cuts[:-1], cuts[1:], strict=True))

    def map(self, function: Callable[[Any], _T], items: Iterable[Any]) -> list[_T]:
        """Call `function` with every item, on the threads where there is more than one; results in the items' order.

        Every thread takes the next item when it is done with one, in the caller's context. The caller's begins at once,
        while others are still waking. They take no further item when one has failed; what is raised here then, when all
        have stopped, is what the first item raises that fails.
        """
        items = list(items)
        n_helper = min(self.n_thread, len(items)) - 1
        if n_helper < 1:
            return [function(item) for item in items]
        self._hire(n_helper)
        results, numbers, failures = [None] * len(items), iter(range(len(items))), []

        def work() -> None:
            for number in numbers:  # a range's iterator hands every number to one thread only
                if any(failed < number for failed, _ in failures):
                    return
                try:
                    results[number] = function(items[number])
                except BaseException as fault:  # noqa: BLE001  raised where `map` was called
                    failures.append((number, fault))

        calls = [_Call(partial(copy_context().run, work)) for _ in range(n_helper)]
        try:
            for call in calls:
                self._calls.put(call)
            work()
            for call in calls:
                call.settle()
        except BaseException as fault:  # Ctrl-C: nobody may go on drawing into what the caller has given up
            failures.append((-1, fault))
            for call in calls:
                call.settle()
            raise
        if failures:
            raise min(failures, key=lambda failure: (isinstance(failure[1], Exception), failure[0]))[1]
        return results

    def _hire(self, n: int) -> None:
        """Start threads, so that there are at least `n`; where no more can be started, those there are do it all."""
        while len(self._helpers) < n:
            helper = threading.Thread(target=_serve, args=(self._calls,), daemon=True)
            try:
                helper.start()
            except RuntimeError:  # the process may have no more of them, or is ending
                return
            self._helpers.append(helper)

    def close(self) -> None:
        """End the threads; what is mapped afterwards is done on the caller's."""
        self._end()
        for helper in self._helpers:
            helper.join()


class _Call:
    """One helper's share of a `map`: made by a helper, or taken back by the caller, whoever comes first."""

    def __init__(self, work: Callable[[], None]) -> None:
        self._work, self._comers = work, []
        self._is_running = threading.Lock()
        self._is_running.acquire()

    def make(self) -> None:
        """Do the work, unless it was taken back."""
        self._comers.append("helper")
        if self._comers[0] == "helper":
            self._work()
            self._is_running.release()

    def settle(self) -> None:
        """Take the call back if no helper has begun, else wait until it is made; may be called again, after Ctrl-C."""
        self._comers.append("caller")
        if self._comers[0] == "helper":
            with self._is_running:
                pass


def _serve(calls: SimpleQueue) -> None:
    """Make the calls that come, until None does."""
    while (call := calls.get()) is not None:
        call.make()
        del call  # it holds what is drawn
    calls.put(None)  # for the next one
