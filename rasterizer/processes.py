"""Processes of this machine, which draw a batch or compile kernels: an executor of loky.

A pool of `concurrent.futures` imports the program anew in each process, so that a script needs an
`if __name__ == "__main__"`; loky's doesn't. What loky leaves open is here: a process ends with the one that started it,
leaves interrupts to it, and writes nothing to its standard output; a program that ends while a batch is drawn doesn't
wait for it; and nothing is imported from the current folder, which may hold anything (by Python 3.11 and later).
"""

import atexit
import os
import shutil
import signal
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout, suppress
from io import StringIO

from .errors import RasterizerError
from .memory import keep_what_is_freed

_GLANCE = 0.2  # seconds between looks at who has started a process
# A thread a process for numpy's libraries. And a process that keeps a model is no leak, for which loky would end it.
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_SETTINGS = {"PYTHONSAFEPATH": "1", "LOKY_MAX_MEMORY_LEAK_SIZE": "1e18"}
_executors: "weakref.WeakSet[Executor]" = weakref.WeakSet()  # that run
_folders: set[str] = set()  # that are there
_starting = threading.Lock()
_ends_at_exit = False


def start_processes(n: int, is_silent: bool = False) -> tuple[Executor, Future]:
    """Return an executor with n processes, and a future that is done when one of them has started.

    Parameters
    ----------
    is_silent : whether what they print goes nowhere, and not to stderr

    Raises RasterizerError where none can be started.
    """
    try:
        from loky.process_executor import ProcessPoolExecutor

        environment = {name: os.environ.get(name, "1") for name in _THREADS} | _SETTINGS
        with _starting, _streams_open(), _interrupts_held():
            _start_tracker()
            executor = ProcessPoolExecutor(n, initializer=_begin, initargs=(os.getpid(), is_silent), env=environment)
            _executors.add(executor)
            try:
                first = executor.submit(os.getpid)
                _end_at_exit()
            except BaseException:  # an interrupt, too: loky doesn't know yet of the thread that it has begun
                with suppress(RuntimeError):  # or it isn't begun
                    end_processes(executor, is_at_work=True)
                raise
    except (ImportError, OSError, RuntimeError, AssertionError) as fault:
        # There are no semaphores; the interpreter ends; this is a daemon of multiprocessing, which may start none.
        raise RasterizerError(f"no process can be started: {getattr(fault, 'strerror', None) or fault}") from fault
    return executor, first


def end_processes(executor: Executor, is_at_work: bool) -> None:
    """End the processes of an executor; those at work are killed."""
    if executor in _executors:
        _executors.discard(executor)
        executor.shutdown(kill_workers=is_at_work)  # type: ignore[call-arg]  # loky's


def make_folder() -> str:
    """Make a folder for what processes are sent; it goes away with the program, however that ends."""
    from loky.backend import resource_tracker

    path = tempfile.mkdtemp(prefix="raster-")
    resource_tracker.register(path, "folder")
    _folders.add(path)
    return path


def remove_folder(path: str) -> None:
    """Remove such a folder."""
    if path in _folders:
        from loky.backend import resource_tracker

        _folders.discard(path)
        shutil.rmtree(path, ignore_errors=True)
        resource_tracker.unregister(path, "folder")


def _end_at_exit() -> None:
    """End what runs when the interpreter ends: before it waits for the threads that lead processes, as they would wait
    for what was begun. So what is registered last is called first."""
    global _ends_at_exit
    if not _ends_at_exit:
        getattr(threading, "_register_atexit", atexit.register)(_end_all)
        _ends_at_exit = True


def _end_all() -> None:
    for executor in list(_executors):
        end_processes(executor, is_at_work=True)
    for path in list(_folders):
        remove_folder(path)


if hasattr(os, "register_at_fork"):  # both stay those of the process that was forked
    os.register_at_fork(after_in_child=lambda: (_executors.clear(), _folders.clear()))


@contextmanager
def _streams_open() -> Iterator[None]:
    """Stand in for standard streams that this process was started without: loky flushes them inside the block, and no
    pipe may have their numbers."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(number, True)
    os.close(number)
    with ExitStack() as stack:
        if sys.stdout is None:
            stack.enter_context(redirect_stdout(StringIO()))
        if sys.stderr is None:
            stack.enter_context(redirect_stderr(StringIO()))
        yield


def _start_tracker() -> None:
    """Start what cleans up after killed processes: its command line alone says that nothing is imported from the
    current folder, and that nobody wants to be warned of what killed processes leave."""
    from loky.backend import resource_tracker as tracker

    spawn = tracker.spawnv_passfds
    flags = ["-P"] * (sys.version_info >= (3, 11)) + ["-W", "ignore::UserWarning:loky.backend.resource_tracker"]
    tracker.spawnv_passfds = lambda path, args, fds: spawn(path, [args[0], *flags, *args[1:]], fds)
    try:
        tracker.ensure_running()
    finally:
        tracker.spawnv_passfds = spawn


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Keep interrupts of the terminal from processes that are started inside the block, until they ignore them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


# ---------------------------------------------------------------- in each process


def _begin(parent: int, is_silent: bool) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    keep_what_is_freed()
    if is_silent:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    os.dup2(2, 1)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    # What was imported lives as long as the process: nothing is gained by taking it apart.
    atexit.register(os._exit, 0)


def _end_with(parent: int) -> None:
    """End this process when its parent has ended."""
    if sys.platform == "win32":
        import _winapi

        _winapi.WaitForSingleObject(_winapi.OpenProcess(_winapi.SYNCHRONIZE, False, parent), _winapi.INFINITE)
    else:
        while os.getppid() == parent:
            time.sleep(_GLANCE)
    os._exit(1)
