"""Run programs, one at a time, from a small process; print time and memory of each as a line of JSON.

Linux counts to a program's peak what the process held that started it. measure.py holds numpy and numba; this holds
the standard library's share only. A line of the input is the JSON of [command, environment].
"""

import json
import os
import subprocess
import sys
from time import monotonic_ns


def run(command: list, environment: dict) -> dict:
    """Run a program.

    Returns
    -------
    ms, cpu_ms : milliseconds from its start to its end, and of processors, its children's included
    peak_mib : the most memory that it held
    code, output : its exit code, and what it printed
    """
    start = monotonic_ns()
    process = subprocess.Popen(
        command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    output = process.stdout.read().decode(errors="replace")
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return {"ms": (monotonic_ns() - start) / 1e6, "cpu_ms": 1000.0 * (usage.ru_utime + usage.ru_stime),
            "peak_mib": usage.ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10),
            "code": process.returncode, "output": output}  # fmt: skip


if __name__ == "__main__":
    for line in sys.stdin:
        print(json.dumps(run(*json.loads(line))), flush=True)
