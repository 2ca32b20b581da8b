"""Processes that another one has started, and whether they run; threads that begin together."""

import subprocess
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier


def workers_of(number) -> list[int]:
    """The processes that a process has started, of whichever of its threads."""
    told = subprocess.run(["ps", "-o", "pid=", "--ppid", str(number)], capture_output=True, text=True, check=False)
    return [int(each) for each in told.stdout.split()]


def is_running(number) -> bool:
    """Tell whether a process is there and hasn't ended."""
    told = subprocess.run(["ps", "-o", "stat=", "-p", str(number)], capture_output=True, text=True, check=False)
    return told.stdout.strip() != "" and not told.stdout.startswith("Z")


def at_once(work, n) -> list:
    """Call `work(k)`, k = 0 … n - 1, in n threads that begin together; what they return. What one raises is raised."""
    start = Barrier(n)

    def begin(k):
        start.wait()
        return work(k)

    with ThreadPoolExecutor(n) as executor:
        return list(executor.map(begin, range(n)))
