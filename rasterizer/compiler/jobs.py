"""Compiling many kernels at once, in as many processes as there are cores: numba's lock makes threads useless.

A job is (function, signature). Each process (../processes.py) gets the next one when it is done with one, the largest
first, and writes the code to the store itself. What a process can't compile, and what is left where none can be
started, is compiled later by who needs it.
"""

import functools
import gc
import importlib
import inspect
import logging
import sys
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, wait
from contextlib import contextmanager, suppress
from pathlib import Path
from time import perf_counter

from ..cores import n_core
from ..errors import RasterizerError, counted
from ..processes import end_processes, start_processes
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
    if not jobs:
        return None
    if notice is None:
        with _line_on_stderr(len(jobs)) as notice:
            return compile_together(jobs, folder, notice)
    waiting = sorted(jobs, key=lambda job: measure_code(job[0]))  # the last one is next
    executor, running = None, {}
    try:
        n = min(n_core(), len(jobs))
        executor, _ = start_processes(n, is_silent=True)
        while waiting or running:
            while waiting and len(running) < n:
                function, signature = waiting.pop()
                notice(function.__name__, len(jobs) - len(waiting) - len(running) - 1, len(jobs))
                job = function.__module__, function.__name__, signature, str(folder)
                running[executor.submit(compile_job, job)] = function.__name__
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                name = running.pop(future)
                try:
                    future.result()
                except Exception as fault:  # noqa: BLE001  whatever it is, who needs the kernel compiles it
                    _log.info("kernel %s is not compiled ahead: %s", name, _text_of(fault))
    except (RasterizerError, RuntimeError) as fault:  # no process can be started, or one has ended
        _log.info("kernels are not compiled ahead: %s", _text_of(fault))
    finally:
        if executor is not None:
            end_processes(executor, is_at_work=bool(running))


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


def compile_job(job: tuple[str, str, tuple, str]) -> None:
    """Compile a kernel, (module, name of the function, signature, the store's own folder), into the store.

    Raises RuntimeError where the store is another one: its sources, versions or settings differ from this process's.
    """
    module, name, signature, folder = job
    gc.disable()  # what the compiler makes lives as long as this process
    # Numba would load it for matrices, which kernels have none of: a sixth of a second.
    sys.modules.setdefault("scipy.linalg", None)
    from . import internals

    store = _store_at(Path(folder))
    function = getattr(importlib.import_module(module), name)
    function = getattr(function, "py_func", function)
    store.keep(function, signature, internals.compile_signature(function, signature))
    gc.freeze()  # else what runs jobs looks through it for garbage between two of them: a seventh of a second


_store_at = functools.cache(Store.at)
