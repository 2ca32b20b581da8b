"""The threads that a frame is drawn with: kernels release the GIL, so plain Python threads run them side by side."""

import os
import threading
import weakref
from concurrent.futures import ThreadPoolExecutor, wait

# A part of a stage is worth a thread of its own from here on: waking a thread costs about as much as this many
# vertices.
MIN_PART = 16_384
PARTS_PER_THREAD = 4  # more parts than threads, so that a delayed thread does not hold up the stage


class Workers:
    """A fixed number of threads, the caller's among them; with one thread everything runs in the caller's.

    `turn` is a lock for those who share the workers: who draws a picture holds it. A process that is forked has neither
    the threads nor, perhaps, the holder of the lock: there both are made anew.
    """

    def __init__(self, n_thread: int):
        self.n_thread = n_thread
        self._start()
        _living.add(self)

    def _start(self) -> None:
        self.turn = threading.RLock()
        self._pool = ThreadPoolExecutor(self.n_thread - 1) if self.n_thread > 1 else None

    def ranges(self, n: int) -> list[tuple[int, int]]:
        """Divide range(n) into parts that are worth a thread each, in order; at least one part."""
        n_part = 1 if self._pool is None else max(1, min(self.n_thread * PARTS_PER_THREAD, n // MIN_PART))
        cuts = [n * k // n_part for k in range(n_part + 1)]
        return list(zip(cuts[:-1], cuts[1:], strict=True))

    def map(self, function, items) -> list:
        """Call `function` with every item, on the threads where there is more than one; results in the items' order.

        Every thread takes the next item when it is done with one. The caller's begins at once, while others are still
        waking. What one of them raises is raised here, when all have stopped: they take no further item then.
        """
        items = list(items)
        if self._pool is None or len(items) < 2:
            return [function(item) for item in items]
        results, turns, others = [None] * len(items), iter(range(len(items))), []
        failed = threading.Event()

        def work():
            try:
                for turn in turns:  # a range's iterator hands every number to one thread only
                    if failed.is_set():
                        return
                    results[turn] = function(items[turn])
            except BaseException:
                failed.set()
                raise

        try:
            for _ in range(min(self.n_thread, len(items)) - 1):
                try:
                    others.append(self._pool.submit(work))
                except RuntimeError:  # no more can be started, as when the interpreter ends: those there are do it all
                    break
            work()
            wait(others)
        except BaseException:  # also Ctrl-C while waiting: nobody may go on drawing into what the caller has given up
            failed.set()
            wait(others)
            raise
        for other in others:
            other.result()  # raises what went wrong there
        return results

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()


_living = weakref.WeakSet()  # whom a forked process must start anew: a fork concerns the process as a whole


def _start_anew() -> None:
    for workers in _living:
        workers._start()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_start_anew)
