"""The threads that a frame is drawn with: kernels release the GIL, so plain Python threads run them side by side."""

from concurrent.futures import ThreadPoolExecutor, wait

# A part of a stage is worth a thread of its own from here on: waking a thread costs about as much as this many vertices.
MIN_PART = 16_384
PARTS_PER_THREAD = 4  # more parts than threads, so that a delayed thread does not hold up the stage


class Workers:
    """A fixed number of threads, the caller's among them; with one thread everything runs in the caller's."""

    def __init__(self, n_thread: int):
        self.n_thread = n_thread
        self._pool = ThreadPoolExecutor(n_thread - 1) if n_thread > 1 else None

    def ranges(self, n: int) -> list[tuple[int, int]]:
        """Divide range(n) into parts that are worth a thread each, in order; at least one part."""
        n_part = 1 if self._pool is None else max(1, min(self.n_thread * PARTS_PER_THREAD, n // MIN_PART))
        cuts = [n * k // n_part for k in range(n_part + 1)]
        return list(zip(cuts[:-1], cuts[1:], strict=True))

    def map(self, function, items) -> list:
        """Call `function` with every item, on the threads where there is more than one; results in the items' order.

        Every thread takes the next item when it is done with one. The caller's begins at once, while others are still waking.
        """
        items = list(items)
        if self._pool is None or len(items) < 2:
            return [function(item) for item in items]
        results, turns = [None] * len(items), iter(range(len(items)))

        def work():
            for turn in turns:  # a range's iterator hands every number to one thread only
                results[turn] = function(items[turn])

        others = [self._pool.submit(work) for _ in range(min(self.n_thread, len(items)) - 1)]
        try:
            work()
        finally:
            wait(others)
        for other in others:
            other.result()  # raises what went wrong there
        return results

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()
