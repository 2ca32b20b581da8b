"""Who draws for a batch: processes of this machine, an executor of `concurrent.futures`, or the workers of Dask.

In:  jobs: a function, what it is called with, what it shares with others        Out: an outcome of each, in any order

    work_through ── submit ──> pool ── wait ──> (job, outcome)

    Done(value)       what the job's function returned
    Died(how)         the process that worked on it ended; who else was at work isn't concerned
    Failed(error)     it could not be sent there or back, or the function raised
"""

import os
import pickle
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from time import monotonic
from typing import Any, NamedTuple, Protocol

from ..compiler.kernels import STORE
from ..cores import n_core
from ..errors import RasterizerError, SceneError, shown
from ..scene.validate import whole
from .worker import MAX_SHARED, READY, read_message, write_message

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
        return ProcessPool(n_process)
    if isinstance(executor, Executor):
        return ExecutorPool(executor, n_process)
    if isinstance(executor, str) or (hasattr(executor, "scatter") and hasattr(executor, "get_executor")):
        return DaskPool(executor, n_process)
    legal = "None, an executor of concurrent.futures, a Client of dask.distributed, or the address of its scheduler"
    raise SceneError(f"executor must be {legal}; given {shown(executor)}")


class SharedObject:
    """Something large that many jobs need: it goes to each process once.

    Parameters
    ----------
    value : what is shared; not changed any more
    key : text that tells it from all others of the pool
    """

    def __init__(self, value: Any, key: str) -> None:
        self.value: Any = value
        self.key: str = key
        self.sent: Any = None  # what a pool keeps of it: its bytes, or its name on the machines it was sent to


class Job:
    """A piece of work: a function of a module, and what it is called with.

    Parameters
    ----------
    function : called as function(argument, value of `shared`, kept); `kept` is a dict that stays with a process
    argument : what can be pickled
    shared : SharedObject, or None
    """

    def __init__(self, function: Callable[..., Any], argument: Any, shared: SharedObject | None = None) -> None:
        self.function: Callable[..., Any] = function
        self.argument: Any = argument
        self.shared: SharedObject | None = shared
        self.note: Any = None  # the caller's own; it isn't sent
        self.is_alone = False  # one picture, drawn once more because a process died of some
        self.n_lost = 0  # how often it had to be sent again because of others


class Done(NamedTuple):
    """The function has returned."""

    value: Any


class Died(NamedTuple):
    """The process that worked on it has ended."""

    how: str


class Failed(NamedTuple):
    """Nothing came back, but for an error."""

    error: Exception


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


def make_error(name: str, outcome: Died | Failed) -> RasterizerError:
    """Return what is said of a model that no process has drawn."""
    if isinstance(outcome, Died):
        return RasterizerError(f"{name}: the process that drew it {outcome.how}, twice")
    fault = outcome.error
    return SceneError(f"{name}: can't be drawn by another process: {type(fault).__name__}: {fault}")


def pictures_per_job(pool: Pool, n_picture: int) -> int:
    """Return how many pictures of a model one job draws: fewer where few are left, so that all processes have some."""
    return max(1, min(LONGEST_RUN, n_picture // pool.n_slot))


# ---------------------------------------------------------------- processes of this machine
#
# Each process is led by a thread, which sends it one job after the other through its standard input and waits for the
# answer on its standard output (worker.py). So a process that dies takes down the job that it worked on and nothing
# else, and it is known which one that was; a pool of concurrent.futures loses all that it holds. The program that
# started the batch isn't imported again, as multiprocessing does: no `if __name__ == "__main__"` is needed.

_PARENT = str(Path(__file__).resolve().parents[2])  # what the package is imported from
_PROGRAM = """
import sys
sys.path[:] = [sys.argv[1], *filter(None, sys.path)]
from rasterizer.batch.worker import main
main()
"""
_PATIENCE = 2.0  # seconds in which a process may end by itself, and remove what it has half written


class ProcessPool:
    """Processes that are started when there is work for them.

    Parameters
    ----------
    n_process : how many at most; None = as many as this one may use processors

    Where no kernel is stored yet, the first job is alone: it compiles what it needs on all processors, and those that
    come after it find that in the store.
    """

    is_here = True

    def __init__(self, n_process: int | None = None) -> None:
        self.n_process = n_process or n_core()
        self._workers: list[_Worker] = []
        self._idle: list[_Worker] = []
        self._outcomes: SimpleQueue = SimpleQueue()
        self.is_warm = not STORE.is_kept or has_kernels()  # nobody has to wait until kernels are stored
        self.n_running = 0

    @property
    def n_slot(self) -> int:
        """How many jobs it should have at a time."""
        return self.n_process if self.is_warm else 1

    def submit(self, job: Job) -> None:
        """Give a job to a process: to one that has what the job shares, if there is one.

        Raises RasterizerError where no process can be started.
        """
        key = job.shared.key if job.shared else None
        worker = next((each for each in self._idle if key in each.known), None) or next(iter(self._idle), None)
        if worker is None:
            worker = _Worker(self._outcomes)
            self._workers.append(worker)
        else:
            self._idle.remove(worker)
        worker.jobs.put(job)
        self.n_running += 1

    def wait(self) -> tuple[Job, Done | Died | Failed]:
        """Wait for the next job that has an outcome; return both.

        Raises RasterizerError where a process ends before its first job: the others would, too.
        """
        job, outcome, worker = self._outcomes.get()
        self.n_running -= 1
        self.is_warm = True
        if isinstance(outcome, Died):
            self._workers.remove(worker)
            if not worker.is_started:
                raise RasterizerError(f"the processes that draw can't be started: the first one {outcome.how}")
        else:
            self._idle.append(worker)
        return job, outcome

    def close(self) -> None:
        """End all processes, and what they are at."""
        for worker in self._workers:
            worker.end(is_idle=worker in self._idle)
        for worker in self._workers:
            worker.join()
        self._workers, self._idle, self.n_running = [], [], 0


def has_kernels() -> bool:
    """Tell whether the store of this process has any kernels."""
    with suppress(OSError):
        return any(name.endswith(".kernel") for folder in STORE.folders for name in os.listdir(folder))
    return False


class _Worker:
    """A process and the thread that leads it."""

    def __init__(self, outcomes: SimpleQueue) -> None:
        self.jobs: SimpleQueue = SimpleQueue()
        self.known: list[str] = []  # keys of the shared objects that the process has, the last one last
        self.is_started = False
        self._outcomes = outcomes
        try:
            # A session of its own: an interrupt of the terminal reaches the caller alone, which ends the others.
            self._process: Any = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM, _PARENT],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                start_new_session=True,
            )
        except OSError as fault:
            raise RasterizerError(f"no process can be started: {fault.strerror or fault}") from fault
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        while (job := self.jobs.get()) is not None:
            outcome = self._ask(job)
            if isinstance(outcome, Failed):
                self.known.clear()  # it isn't known whether what was sent has been understood
            self._outcomes.put((job, outcome, self))
            if isinstance(outcome, Died):
                return
            del job, outcome  # they hold models

    def _ask(self, job: Job) -> Done | Died | Failed:
        """Let the process work on a job; wait for its answer."""
        try:
            message = self._pack(job)
        except Exception as fault:  # noqa: BLE001  whatever an object does that is pickled
            return Failed(fault)
        try:
            if not self.is_started:
                # The paths are those by which classes that are sent are found.
                write_message(self._process.stdin, pickle.dumps(sys.path))
                self.is_started = read_message(self._process.stdout) == READY
            write_message(self._process.stdin, message)
            answer = read_message(self._process.stdout)
        except (OSError, EOFError, ValueError):
            return Died(self._how_it_ended())
        try:
            is_done, value = pickle.loads(answer)
        except Exception as fault:  # noqa: BLE001  whatever an object does that is unpickled
            return Failed(fault)
        return Done(value) if is_done else Failed(value)

    def _pack(self, job: Job) -> bytes:
        """Return the job as bytes, with what it shares unless the process has it."""
        key, content = None, None
        if job.shared is not None:
            key = job.shared.key
            if job.shared.sent is None:
                job.shared.sent = pickle.dumps(job.shared.value, protocol=pickle.HIGHEST_PROTOCOL)
            content = None if key in self.known else job.shared.sent
        message = pickle.dumps((job.function, job.argument, key, content), protocol=pickle.HIGHEST_PROTOCOL)
        if key is not None:  # the process forgets by the same rule
            self.known = [*(each for each in self.known if each != key), key][-MAX_SHARED:]
        return message

    def _how_it_ended(self) -> str:
        code = self._process.wait()
        if code >= 0:
            return f"ended with exit code {code}"
        with suppress(ValueError):
            return f"was ended by {signal.Signals(-code).name}"
        return f"was ended by signal {-code}"

    def end(self, is_idle: bool) -> None:
        """Ask the process to end, whatever it is at; one that waits for work ends with its input."""
        self.jobs.put(None)
        if not is_idle:
            self._process.terminate()
            return
        with suppress(OSError):
            self._process.stdin.close()

    def join(self) -> None:
        """Wait until the process has ended; one that doesn't is killed."""
        try:
            self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._thread.join()
        for stream in (self._process.stdin, self._process.stdout):
            with suppress(OSError):  # what was left to send
                stream.close()


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
        message = "a scheduler needs Dask: install the extra distributed, as in pip install '.[distributed]'"
        raise RasterizerError(f"{message} ({fault})") from fault
    try:
        return Client(address, timeout=_ANSWER_WITHIN, set_as_default=False)
    except (OSError, ValueError, TypeError) as fault:  # TimeoutError is an OSError
        raise RasterizerError(f"no scheduler of Dask answers at {address}: {fault}") from fault


def _is_death(fault: Exception) -> bool:
    """Tell whether Dask gave a job up because the workers that took it died."""
    return type(fault).__name__ == "KilledWorker"
