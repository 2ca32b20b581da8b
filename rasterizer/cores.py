"""How many processors this process may use; nothing but the standard library is imported."""

import os


def n_core() -> int:
    """Return how many threads or processes can work at the same time."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
