"""Run programs, one at a time, from a small process; print time and peak memory of each as a line of JSON.

Linux counts to a program's peak what the process held that started it. `startup.py` holds numpy and numba; this holds
the standard library's share only. A line of the input is the JSON of [command, environment].
"""

import json
import os
import subprocess
import sys
from time import monotonic_ns


def main() -> None:
    """Run what the standard input asks for, until it ends."""
    for line in sys.stdin:
        print(json.dumps(run(*json.loads(line))), flush=True)


def run(command: list, environment: dict) -> dict:
    """Run a program.

    Returns
    -------
    start, end : nanoseconds of the clock that all processes share; the program finds the first in BENCH_START
    peak_mib : the most memory that it held; None where the system does not tell
    cpu_ms : milliseconds of processors that it and its children took; None likewise
    code, output : its exit code, and what it printed
    """
    start = monotonic_ns()
    environment = {**environment, "BENCH_START": str(start)}
    process = subprocess.Popen(
        command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    output = process.stdout.read().decode(errors="replace")
    code, peak, cpu = wait_for(process)
    return {
        "start": start, "end": monotonic_ns(), "peak_mib": peak, "cpu_ms": cpu, "code": code, "output": output
    }  # fmt: skip


def wait_for(process) -> tuple:
    """Return the exit code of a process, its peak memory in MiB, and milliseconds of processors."""
    if not hasattr(os, "wait4"):  # Windows
        return process.wait(), None, None
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    peak = usage.ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
    return process.returncode, peak, 1000.0 * (usage.ru_utime + usage.ru_stime)


if __name__ == "__main__":
    main()
