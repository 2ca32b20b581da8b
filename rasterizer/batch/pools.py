"""Who draws for a batch: processes of this machine, an executor of `concurrent.futures`, or the workers of Dask.

    work_through ── submit ──> pool ── wait ──> (job, outcome)

A pool of processes of this machine is in ../processes.py, with jobs and their outcomes.
"""

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import suppress
from queue import SimpleQueue
from time import monotonic
from typing import Any, Protocol

from ..choices import install_command
from ..compiler.kernels import STORE
from ..cores import n_core
from ..errors import RasterizerError, SceneError, shown
from ..processes import Died, Done, Failed, Job, ProcessPool, SharedObject
from ..scene.validate import whole

MAX_PROCESSES = 1024
LONGEST_RUN = 8  # pictures of a job


def make_pool(executor: Any, n_process: int | None) -> "Pool":
    """Return who draws.

    Parameters
    ----------
    executor : None = processes of this machine; an executor of concurrent.futures, a Client of dask.distributed, or the
        address of its scheduler
    n_process : how many processes, 1 to 1024, or how many jobs an executor works on at a time; None = as many as this
        process may use processors, or as the executor has

    Raises SceneError where one of them isn't legal.
    """
    if n_process is not None:
        n_process = whole(n_process, "n_process", 1, MAX_PROCESSES)
    if executor is None:
        return local_pool(n_process)
    if isinstance(executor, Executor):
        return ExecutorPool(executor, n_process)
    if isinstance(executor, str) or (hasattr(executor, "scatter") and hasattr(executor, "get_executor")):
        return DaskPool(executor, n_process)
    legal = "None, an executor of concurrent.futures, a Client of dask.distributed, or the address of its scheduler"
    raise SceneError(f"executor must be {legal}; given {shown(executor)}")


def local_pool(n_process: int | None) -> ProcessPool:
    """Return processes of this machine; None = as many as this one may use processors.

    Where no kernel is stored yet, the first job is alone: it compiles what it needs on all processors, and those that
    come after it find that in the store.
    """
    return ProcessPool(n_process or n_core(), is_warm=not STORE.is_kept or has_kernels())


class Pool(Protocol):
    """Who draws."""

    is_here: bool  # whether it sees the files that this process sees

    @property
    def n_slot(self) -> int:
        """How many jobs it should have at a time."""

    @property
    def n_running(self) -> int:
        """How many it has."""

    def submit(self, job: Job) -> None:
        """Give it a job."""

    def wait(self) -> tuple[Job, Done | Died | Failed]:
        """Wait for the next job that has an outcome."""

    def close(self) -> None:
        """Give up what is running, and end what was started."""


def work_through(
    pool: Pool, jobs: Iterable[Any], follow_up: Callable[[Job, Done | Died | Failed], list[Job]]
) -> Iterator[tuple[Any, Done | Died | Failed | None]]:
    """Keep a pool at work; yield (job, outcome) as jobs are done, in any order.

    Parameters
    ----------
    jobs : are taken as there is room for them; what is no Job is passed on as (it, None)
    follow_up : returns the jobs that take the place of one, after its outcome; none: the outcome is passed on
    """
    source, again, is_exhausted = iter(jobs), deque[Job](), False
    while True:
        while pool.n_running < pool.n_slot and (again or not is_exhausted):
            job = again.popleft() if again else next(source, None)
            if isinstance(job, Job):
                pool.submit(job)
            elif job is None:
                is_exhausted = True
            else:
                yield job, None
        if not pool.n_running:
            return
        done, outcome = pool.wait()
        instead = follow_up(done, outcome)
        again.extend(instead)
        if not instead:
            yield done, outcome


def replace_job(
    job: Job, outcome: Done | Died | Failed, divide: Callable[[Job], list[Job]], load: Callable[[Job], list[Job]]
) -> list[Job]:
    """Return what takes the place of a job of some pictures: the pictures one by one where something went wrong, or the
    same job with its model where the function returned None, as it doesn't see the model's file; none else.

    Parameters
    ----------
    divide : returns a job for each picture of one
    load : returns a job that has its model; none where it can't be loaded
    """
    if isinstance(outcome, Done):
        return [] if outcome.value is not None else load(job)
    parts = [] if job.is_alone else divide(job)
    if isinstance(outcome, Failed) and len(parts) == 1:
        return []
    for part in parts:
        part.is_alone = isinstance(outcome, Died)
    return parts


def died_once(outcome: Died) -> str:
    """Return what is said of a model whose process has ended, and that is drawn once more."""
    return f"the process that drew it {outcome.how}; its pictures are drawn once more"


def make_error(name: str, outcome: Died | Failed) -> RasterizerError:
    """Return what is said of a model that no process has drawn."""
    if isinstance(outcome, Died):
        return RasterizerError(f"{name}: the process that drew it {outcome.how}, twice")
    fault = outcome.error
    return SceneError(f"{name}: can't be drawn by another process: {type(fault).__name__}: {fault}")


def pictures_per_job(pool: Pool, n_picture: int) -> int:
    """Return how many pictures of a model one job draws: fewer where few are left, so that all processes have some."""
    return max(1, min(LONGEST_RUN, n_picture // pool.n_slot))


def has_kernels() -> bool:
    """Tell whether the store of this process has any kernels."""
    with suppress(OSError):
        return any(name.endswith(".kernel") for folder in STORE.folders for name in os.listdir(folder))
    return False


# ---------------------------------------------------------------- executors
#
# Dask takes care of workers that are lost: what they were at is done by others. A shared object is sent to each of its
# workers once. Elsewhere it goes with every job.

_AHEAD = 2  # jobs for each process: one that it works on, and one that it finds there when it is done
_MAX_SCATTERED = 8  # objects that Dask's workers keep for the batch
_ANSWER_WITHIN = 10.0  # seconds in which a scheduler must answer
_LATELY = 1.0  # seconds for which the number of Dask's workers is taken to stay
_MAX_LOST = 3  # times that a job is sent again, because what it shares was lost with a worker


class ExecutorPool:
    """Jobs on an executor.

    Parameters
    ----------
    executor : its `submit` is called; it isn't shut down
    n_process : how many jobs are worked on at a time; None = what the executor says of itself
    """

    is_here = False

    def __init__(self, executor: Executor, n_process: int | None = None) -> None:
        self.executor = executor
        n_process = n_process or getattr(executor, "_max_workers", None) or n_core()
        self._n_slot = _AHEAD * n_process
        self._outcomes: SimpleQueue = SimpleQueue()
        self._running: dict[Future, Job] = {}

    @property
    def n_slot(self) -> int:
        """How many jobs it should have at a time."""
        return self._n_slot

    @property
    def n_running(self) -> int:
        """How many it has."""
        return len(self._running)

    def submit(self, job: Job) -> None:
        """Give it a job.

        Raises RasterizerError where the executor takes none any more.
        """
        try:
            future = self.executor.submit(call, job.function, job.argument, self._share(job.shared))
        except RuntimeError as fault:  # broken, or shut down
            raise RasterizerError(f"the executor takes no tasks any more: {fault}") from fault
        self._running[future] = job
        future.add_done_callback(self._outcomes.put)

    def _share(self, shared: SharedObject | None) -> Any:
        """Return what stands for a shared object among the arguments of a call."""
        return None if shared is None else shared.value

    def wait(self) -> tuple[Job, Done | Died | Failed]:
        """Wait for the next job that has an outcome; return both."""
        future = self._outcomes.get()
        job = self._running.pop(future)
        try:
            return job, Done(future.result())
        except BrokenExecutor as fault:
            return job, Died(str(fault))
        except CancelledError:
            return self._settle_lost(job)
        except Exception as fault:  # noqa: BLE001  whatever a job raised there: the others go on
            return job, Died(str(fault)) if _is_death(fault) else Failed(fault)

    def _settle_lost(self, job: Job) -> tuple[Job, Done | Died | Failed]:
        """Return the outcome of a job that somebody has cancelled."""
        return job, Failed(RasterizerError("the executor has cancelled it"))

    def close(self) -> None:
        """Take back what hasn't begun; what runs is left to the executor."""
        for future in self._running:
            future.cancel()
        self._running.clear()


class DaskPool(ExecutorPool):
    """Jobs on the workers of Dask.

    Parameters
    ----------
    client : dask.distributed.Client, or the address of a scheduler, such as "tcp://10.0.0.1:8786"
    n_process : how many jobs are worked on at a time; None = one for each thread of the workers that there are, also
        of those that come later
    """

    def __init__(self, client: Any, n_process: int | None = None) -> None:
        self._is_own = isinstance(client, str)
        self.client = connect(client) if isinstance(client, str) else client
        self._n_asked = n_process
        self._asked_at = float("-inf")
        # An impure function is called for each job, also where one with the same arguments has been called before.
        super().__init__(self.client.get_executor(pure=False), n_process or 1)
        self._scattered: deque[SharedObject] = deque()
        self._sent_with: dict[Job, Any] = {}  # what stood for the shared object of each that is running

    @property
    def n_slot(self) -> int:
        """How many jobs it should have at a time."""
        if self._n_asked is None and monotonic() - self._asked_at > _LATELY:
            with suppress(Exception):  # Dask's errors have no base: the scheduler can't be asked just now
                self._n_slot = _AHEAD * max(1, sum(self.client.nthreads().values()))
            self._asked_at = monotonic()
        return self._n_slot

    def _share(self, shared: SharedObject | None) -> Any:
        """Give an object to Dask, once: it sends it to each worker that needs it, once."""
        if shared is None:
            return None
        if shared.sent is None:
            shared.sent = self.client.scatter(shared.value, hash=False)
            self._scattered.append(shared)
            while len(self._scattered) > _MAX_SCATTERED:
                self._scattered.popleft().sent = None  # what is running keeps its own
        return shared.sent

    def submit(self, job: Job) -> None:
        """Give it a job."""
        super().submit(job)
        self._sent_with[job] = job.shared and job.shared.sent

    def wait(self) -> tuple[Job, Done | Died | Failed]:
        """Wait for the next job that has an outcome; return both."""
        job, outcome = super().wait()
        self._sent_with.pop(job, None)
        return job, outcome

    def _settle_lost(self, job: Job) -> tuple[Job, Done | Died | Failed]:
        """Send a job again whose shared object was lost: Dask makes results anew, but not what it was given."""
        job.n_lost += 1
        if job.n_lost > _MAX_LOST:
            return super()._settle_lost(job)
        shared = job.shared
        if shared is not None and shared.sent is self._sent_with.get(job):
            shared.sent = None  # the first job that tells of it has the object sent anew
        self.submit(job)
        return self.wait()

    def close(self) -> None:
        """Take back what runs, and end the connection if it was made here."""
        super().close()
        for shared in self._scattered:
            shared.sent = None
        self._scattered.clear()
        self._sent_with.clear()
        if self._is_own:
            self.client.close()


def call(function: Any, argument: Any, shared: Any) -> Any:
    """Call the function of a job, in a process that keeps nothing for later ones."""
    return function(argument, shared, {})


def connect(address: str) -> Any:
    """Return a client of the Dask scheduler at an address.

    Raises
    ------
    SceneError : what is no address
    RasterizerError : Dask isn't installed, or nobody answers there
    """
    if "://" not in address:
        raise SceneError(f"a scheduler's address looks like tcp://10.0.0.1:8786; given {shown(address)}")
    try:
        from dask.distributed import Client
    except ImportError as fault:
        raise RasterizerError(f"a scheduler needs Dask: {install_command('distributed')} ({fault})") from fault
    try:
        return Client(address, timeout=_ANSWER_WITHIN, set_as_default=False)
    except (OSError, ValueError, TypeError) as fault:  # TimeoutError is an OSError
        raise RasterizerError(f"no scheduler of Dask answers at {address}: {fault}") from fault


def _is_death(fault: Exception) -> bool:
    """Tell whether Dask gave a job up because the workers that took it died."""
    return type(fault).__name__ == "KilledWorker"
