"""Compiling many kernels at once, in as many processes as there are cores: numba's lock makes threads useless.

A job is (function, signature). Each process (`main`) gets the next one when it is done with one, the largest first, and
writes the code to the store itself. What a process can't compile, and what is left where none can be started, is
compiled later by who needs it.
"""

import ast
import importlib
import inspect
import logging
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

from ..cores import n_core
from .store import Store, title_of

_PARENT = str(Path(__file__).resolve().parents[2])  # what the package is imported from
_PROGRAM = """
import sys
sys.path[:] = [sys.argv[1], *filter(None, sys.path)]  # "" is the folder where the program is started: nothing of ours
from rasterizer.compiler.jobs import main
sys.exit(main(sys.argv[2]))
"""
_log = logging.getLogger("rasterizer")


def compile_together(jobs: list, folder: Path, notice: Callable[[str, int, int], None]) -> None:
    """Compile kernels and put them into the store.

    Parameters
    ----------
    jobs : (function, signature) each
    folder : the store's own, to which the processes write
    notice : is called with a kernel's name, how many are done and how many there are, whenever one is begun

    Whatever ends it, such as Ctrl-C, ends the processes, too.
    """
    pool = _Pool(jobs, folder, notice)
    threads = [threading.Thread(target=pool.serve, daemon=True) for _ in range(min(n_core(), len(jobs)))]
    try:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        pool.end()


class _Pool:
    """Processes that share jobs; each is led by a thread, which runs `serve`."""

    def __init__(self, jobs, folder, notice):
        self._waiting = sorted(jobs, key=lambda job: measure_code(job[0]), reverse=True)
        self._folder, self._notice = folder, notice
        self._total, self._n_done = len(jobs), 0
        self._lock, self._workers = threading.Lock(), []

    def serve(self):
        """Start a process and give it one job after the other."""
        try:
            with self._lock:
                if not self._waiting:
                    return
                worker = start_worker(self._folder)
                self._workers.append(worker)
            with worker:
                while (job := self._next_job()) is not None and self._is_answered(worker, job):
                    pass
        except OSError as fault:  # it can't be started, or has ended
            _log.info("kernels are not compiled ahead: %s", fault)

    def _next_job(self):
        with self._lock:
            if not self._waiting:
                return None
            function, signature = self._waiting.pop(0)
            self._notice(function.__name__, self._n_done, self._total)
            return function, signature

    def _is_answered(self, worker, job) -> bool:
        """Give a process a job and wait until it is done; False where the process has ended."""
        function, signature = job
        print(repr((function.__module__, function.__name__, signature)), file=worker.stdin, flush=True)
        answer = worker.stdout.readline().strip()
        if answer != "done":
            _log.info("kernel %s is not compiled ahead: %s", function.__name__, answer or "the process ended")
        with self._lock:
            self._n_done += bool(answer)
        return bool(answer)

    def end(self):
        """End all processes; those that have ended by themselves are left alone."""
        with self._lock:
            self._waiting.clear()
            for worker in self._workers:
                worker.kill()


def start_worker(folder: Path) -> subprocess.Popen:
    """Start a process that takes jobs."""
    return subprocess.Popen(
        [sys.executable, "-c", _PROGRAM, _PARENT, str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        encoding="utf-8",
        errors="replace",
        env=os.environ | {"RASTER_STORE": str(folder.parent)},
    )


def measure_code(function: Callable) -> int:
    """Return the size of a function's bytecode with that of all helpers it reaches: how long it takes to compile."""
    seen, size = set(), 0
    open_ones = [function]
    while open_ones:
        here = inspect.unwrap(open_ones.pop())  # a choice calls what the function that it wraps returns
        code, names = here.__code__, here.__globals__
        if code in seen:
            continue
        seen.add(code)
        size += len(code.co_code)
        for name in code.co_names:
            plain = getattr(names.get(name), "py_func", None)
            if plain is not None:
                open_ones.append(plain)
    return size


# ---------------------------------------------------------------- in each process


def main(folder: str) -> int:
    """Compile what standard input asks for, into the store's folder `folder`; return the exit code.

    A line of the input is the repr of (module, name of the function, signature). After each a line is printed: "done",
    or why it could not. 2 tells that this process would use another store: its sources, versions or settings differ.
    """
    from . import internals

    store = Store.of_process(is_compiling=True)
    if str(store.own) != folder or not internals.IS_SEEN:
        return 2
    answers = sys.stdout
    sys.stdout = sys.stderr  # what others print is no answer
    for line in sys.stdin:
        module, name, signature = ast.literal_eval(line)
        try:
            function = getattr(importlib.import_module(module), name)
            function = getattr(function, "py_func", function)
            code = internals.compile_signature(function, signature)
            store.keep(title_of(function), signature, code.as_bytes())
            answer = "done"
        except Exception as fault:  # noqa: BLE001  whatever it is, who asked compiles this one himself and meets it
            answer = " ".join(f"{type(fault).__name__}: {fault}".split())
        print(answer, file=answers, flush=True)
    return 0
