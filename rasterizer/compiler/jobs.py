"""Compiling many kernels at once, in as many processes as there are cores: numba's lock makes threads useless.

A job is (function, signature). Each process (../processes.py) gets the next one when it is done with one, the largest
first, and writes the code to the store itself. What a process can't compile, and what is left where none can be
started, is compiled later by who needs it.
"""

import gc
import importlib
import inspect
import logging
import subprocess
import sys
from collections.abc import Callable
from contextlib import contextmanager, suppress
from pathlib import Path
from time import perf_counter

from ..cores import n_core
from ..errors import RasterizerError, counted
from ..processes import Died, Failed, Job, ProcessPool
from .store import Store

_log = logging.getLogger("rasterizer")


def compile_together(jobs: list, folder: Path, notice: Callable[[str, int, int], None] | None) -> None:
    """Compile kernels and put them into the store.

    Parameters
    ----------
    jobs : (function, signature) each
    folder : the store's own, to which the processes write
    notice : is called with a kernel's name, how many are done and how many there are, whenever one is begun; None = a
        line on stderr shows it

    Whatever ends it, such as Ctrl-C, ends the processes, too.
    """
    if notice is None and jobs:
        with _line_on_stderr(len(jobs)) as notice:
            return compile_together(jobs, folder, notice)
    waiting = sorted(jobs, key=lambda job: measure_code(job[0]))  # the last one is next
    pool = ProcessPool(min(n_core(), len(jobs)), stderr=subprocess.DEVNULL)
    n_done = 0
    try:
        while waiting or pool.n_running:
            while waiting and pool.n_running < pool.n_slot:
                function, signature = waiting.pop()
                notice(function.__name__, n_done, len(jobs))
                pool.submit(Job(compile_job, (function.__module__, function.__name__, signature, str(folder))))
            job, outcome = pool.wait()
            n_done += 1
            if isinstance(outcome, (Died, Failed)):
                why = f"the process {outcome.how}" if isinstance(outcome, Died) else _text_of(outcome.error)
                _log.info("kernel %s is not compiled ahead: %s", job.argument[1], why)
    except RasterizerError as fault:
        _log.info("kernels are not compiled ahead: %s", fault)
    finally:
        pool.close()


@contextmanager
def _line_on_stderr(n_kernel):
    """Yield a `notice` that counts on one line of stderr, which ends with the block.

    Only a terminal and a notebook can have a line written anew; elsewhere it is begun and ended.
    """
    stream, start = sys.stderr, perf_counter()
    text = f"rasterizer: compiling {counted(n_kernel, 'kernel')} for the first time: "
    is_alive = stream is not None and (stream.isatty() or type(stream).__module__.startswith("ipykernel"))

    def write(words):
        with suppress(AttributeError, OSError, ValueError):  # there is none, nobody reads it, or it is closed
            stream.write(words)
            stream.flush()

    write(text)
    try:
        yield lambda _name, n_done, _n: write(f"\r{text}{n_done} done") if is_alive else None
    finally:
        end = f"{perf_counter() - start:.1f} s"
        write(f"\r{text}{end:<9}\n" if is_alive else f"{end}\n")


def _text_of(fault: Exception) -> str:
    return " ".join(f"{type(fault).__name__}: {fault}".split())


def measure_code(function: Callable) -> int:
    """Return the size of a function's bytecode with that of all helpers it reaches: how long it takes to compile."""
    seen, size = set(), 0
    open_ones = [function]
    while open_ones:
        here = inspect.unwrap(open_ones.pop())  # what goes by type wraps its float64 form
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


def compile_job(job: tuple[str, str, tuple, str], _shared: None, kept: dict) -> None:
    """Compile a kernel, (module, name of the function, signature, the store's own folder), into the store.

    Raises RuntimeError where the store is another one: its sources, versions or settings differ from this process's.
    """
    module, name, signature, folder = job
    gc.disable()  # what the compiler makes lives as long as this process
    store = kept["store"] = kept.get("store") or Store.at(Path(folder))
    # Numba would load it for matrices, which kernels have none of: a sixth of a second.
    sys.modules.setdefault("scipy.linalg", None)
    from . import internals

    function = getattr(importlib.import_module(module), name)
    function = getattr(function, "py_func", function)
    store.keep(function, signature, internals.compile_signature(function, signature))
