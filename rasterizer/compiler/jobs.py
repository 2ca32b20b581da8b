"""Compiling many kernels at once, in as many processes as there are cores: numba's lock makes threads useless.

A job is (function, signature). Each process (worker.py) gets the next one when it is done with one, the largest first,
and writes the code to the store itself. What a process can't compile, and what is left where none can be started, is
compiled later by who needs it.
"""

import logging
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

_PARENT = str(Path(__file__).resolve().parents[2])  # what the package is imported from
_PROGRAM = """
import sys
sys.path.insert(0, sys.argv[1])
from rasterizer.compiler.worker import main
sys.exit(main(sys.argv[2]))
"""
_log = logging.getLogger("rasterizer")


def n_core() -> int:
    """Return how many processes can work at the same time."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def compile_together(jobs: list, folder: Path, notice: Callable[[str, int, int], None]) -> None:
    """Compile kernels and put them into the store.

    Parameters
    ----------
    jobs : (function, signature) each
    folder : the store's own, to which the processes write
    notice : is called with a kernel's name, how many are done and how many there are, whenever one is begun
    """
    waiting = sorted(jobs, key=lambda job: measure_code(job[0]), reverse=True)
    turn, total = threading.Lock(), len(waiting)
    done = 0

    def next_job():
        with turn:
            if not waiting:
                return None
            job = waiting.pop(0)
            notice(job[0].__name__, done, total)
            return job

    def serve():
        nonlocal done
        with start_worker(folder) as worker:
            try:
                while (job := next_job()) is not None:
                    function, signature = job
                    print(repr((function.__module__, function.__name__, signature)), file=worker.stdin, flush=True)
                    answer = worker.stdout.readline().strip()
                    if answer != "done":
                        _log.info(
                            "kernel %s is not compiled ahead: %s", function.__name__, answer or "the process ended"
                        )
                    if not answer:
                        return
                    with turn:
                        done += 1
                worker.stdin.close()
            except OSError as fault:  # the process has ended
                _log.info("kernels are not compiled ahead: %s", fault)

    threads = [threading.Thread(target=serve) for _ in range(min(n_core(), total))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def start_worker(folder: Path) -> subprocess.Popen:
    """Start a process that takes jobs."""
    return subprocess.Popen(
        [sys.executable, "-c", _PROGRAM, _PARENT, str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        encoding="utf-8",
        env=os.environ | {"RASTER_STORE": str(folder.parent)},
    )


def measure_code(function: Callable) -> int:
    """Return the size of a function's bytecode with that of all helpers it reaches: how long it takes to compile."""
    seen, size = set(), 0
    open_ones = [function]
    while open_ones:
        code, names = open_ones[-1].__code__, open_ones.pop().__globals__
        if code in seen:
            continue
        seen.add(code)
        size += len(code.co_code)
        for name in code.co_names:
            plain = getattr(names.get(name), "py_func", None)
            if plain is not None:
                open_ones.append(plain)
    return size
