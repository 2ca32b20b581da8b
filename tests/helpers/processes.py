"""Processes that another one has started, and whether they run."""

import subprocess


def workers_of(number) -> list[int]:
    """The processes that a process has started, of whichever of its threads."""
    told = subprocess.run(["ps", "-o", "pid=", "--ppid", str(number)], capture_output=True, text=True, check=False)
    return [int(each) for each in told.stdout.split()]


def is_running(number) -> bool:
    """Tell whether a process is there and hasn't ended."""
    told = subprocess.run(["ps", "-o", "stat=", "-p", str(number)], capture_output=True, text=True, check=False)
    return told.stdout.strip() != "" and not told.stdout.startswith("Z")
