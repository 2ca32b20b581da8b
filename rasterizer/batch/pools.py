"""Who draws for a batch: processes of this machine, an executor of `concurrent.futures`, or the workers of Dask.

    work_through ── submit ──> pool ── wait ──> (job, outcome)

    Done(value)       what the job's function returned
    Died(how)         a process of the executor ended: this one's, or another one's
    Failed(error)     it could not be sent there or back, or the function raised

Processes of this machine are those of ../processes.py. One that ends breaks its executor, which loses all that it held.
Another one takes its place, and what was lost is drawn again, a picture at a time: one that breaks it twice is named.
"""

import os
import pickle
import re
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import suppress
from queue import SimpleQueue
from time import monotonic
from typing import Any, NamedTuple
from weakref import finalize

from ..compiler.kernels import STORE
from ..cores import n_core
from ..errors import RasterizerError, SceneError, import_extra, shown
from ..processes import end_processes, make_folder, remove_folder, start_processes
from ..scene.validate import whole

MAX_PROCESSES = 1024
LONGEST_RUN = 8  # pictures of a job
MOST_ALONE = 2  # times that a picture is drawn alone before it is named as what ends processes
_SOON = 5.0  # seconds in which an executor that is broken says so to all who wait
_MAX_FAILED = 2  # times that processes are started once more, because the first one ended before it had started
MAX_SHARED = 2  # models that a process keeps, of those that it was sent


class SharedObject:
    """A model that many jobs need: it goes to each process once.

    Parameters
    ----------
    value : what is shared; not changed any more
    """

    def __init__(self, value: Any) -> None:
        self.value: Any = value
        self.sent: Any = None  # what stands for it where it was sent to


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
        self.n_alone = 0  # how often it, one picture, is drawn with no other beside it, because a process died of some


class Done(NamedTuple):
    """The function has returned."""

    value: Any


class Died(NamedTuple):
    """A process has ended."""

    how: str


class Failed(NamedTuple):
    """Nothing came back, but for an error."""

    error: Exception


# ---------------------------------------------------------------- jobs, one after the other


def work_through(
    pool: "Pool", jobs: Iterable[Any], follow_up: Callable[[Job, Done | Died | Failed], list[Job]]
) -> Iterator[tuple[Any, Done | Died | Failed | None]]:
    """Keep a pool at work; yield (job, outcome) as jobs are done, in any order.

    Parameters
    ----------
    jobs : are taken as there is room for them; what is no Job is passed on as (it, None)
    follow_up : returns the jobs that take the place of one, after its outcome; none: the outcome is passed on
    """
    source, again, is_exhausted, is_alone = iter(jobs), deque[Job](), False, 0
    while True:
        while again or not is_exhausted:
            # One that is drawn alone waits until nothing else runs, and while it runs nothing else is begun.
            if pool.n_running >= (1 if is_alone or (again and again[0].n_alone) else pool.n_slot):
                break
            job = again.popleft() if again else next(source, None)
            if isinstance(job, Job):
                pool.submit(job)
                is_alone = job.n_alone
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


def make_error(name: str, outcome: Died | Failed) -> RasterizerError:
    """Return what is said of a model that no process has drawn."""
    if isinstance(outcome, Died):
        return RasterizerError(f"{name}: the process that drew it {outcome.how}, twice")
    fault = outcome.error
    return SceneError(f"{name}: can't be drawn by another process: {type(fault).__name__}: {fault}")


# ---------------------------------------------------------------- who works on them


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
        return LocalPool(n_process)
    if isinstance(executor, Executor):
        return Pool(executor, n_process)
    if isinstance(executor, str) or (hasattr(executor, "scatter") and hasattr(executor, "get_executor")):
        return DaskPool(executor, n_process)
    legal = "None, an executor of concurrent.futures, a Client of dask.distributed, or the address of its scheduler"
    raise SceneError(f"executor must be {legal}; given {shown(executor)}")


class Pool:
    """Jobs on an executor.

    Parameters
    ----------
    executor : its `submit` is called; it isn't shut down
    n_process : how many jobs are worked on at a time; None = what the executor says of itself
    """

    is_here = False  # whether it sees the files that this process sees
    is_warm = True  # whether kernels are stored, so that not every process compiles them

    def __init__(self, executor: Any, n_process: int | None = None) -> None:
        self.executor = executor
        self._n_process = n_process or getattr(executor, "_max_workers", None) or n_core()
        self._outcomes: SimpleQueue = SimpleQueue()
        self._running: dict[Future, Job] = {}

    @property
    def n_slot(self) -> int:
        """How many jobs it should have at a time: for each process one that it works on, and one that it finds there
        when it is done."""
        return 2 * self._n_process

    @property
    def n_running(self) -> int:
        """How many it has."""
        return len(self._running)

    def submit(self, job: Job) -> None:
        """Give it a job.

        Raises RasterizerError where it takes none any more.
        """
        try:
            future = self._send(job)
        except RuntimeError as fault:  # broken, or shut down
            raise RasterizerError(f"the executor takes no tasks any more: {fault}") from fault
        self._running[future] = job
        future.add_done_callback(self._outcomes.put)

    def _send(self, job: Job) -> Future:
        return self.executor.submit(call, job.function, job.argument, job.shared and job.shared.value)

    def wait(self) -> tuple[Job, Done | Died | Failed]:
        """Wait for the next job that has an outcome; return both."""
        future = self._outcomes.get()
        job = self._running.pop(future)
        try:
            return job, Done(self._result(future))
        except CancelledError:
            return job, self._cancelled(job)
        except Exception as fault:  # noqa: BLE001  whatever a job raised there: the others go on
            how = self._death(fault)
            return job, Failed(fault) if how is None else Died(how)

    def _result(self, future: Future) -> Any:
        return future.result()

    def _cancelled(self, job: Job) -> Died | Failed:
        return Failed(RasterizerError("the executor has cancelled it"))

    def _death(self, fault: Exception) -> str | None:
        """Return how a process has ended, if that is what a fault tells of."""
        return str(fault) if isinstance(fault, BrokenExecutor) else None

    def close(self) -> None:
        """Take back what hasn't begun; what runs is left to the executor."""
        for future in self._running:
            future.cancel()
        self._running.clear()


def call(function: Any, argument: Any, shared: Any) -> Any:
    """Call the function of a job, in a process that keeps nothing for later ones."""
    return function(argument, shared, {})


class LocalPool(Pool):
    """Jobs on processes of this machine, which are started with the first one.

    Where no kernel is stored yet, the first job is the only one until it is done: it compiles what it needs on all
    processors, and those that come after it find that in the store.
    """

    is_here = True

    def __init__(self, n_process: int | None = None) -> None:
        super().__init__(None, n_process)
        self.is_warm = not STORE.is_kept or has_kernels()
        self._n_started, self._n_failed, self._first = 0, 0, Future[int]()
        self._folder = ""  # where models are that are sent
        self._n_sent = 0

    @property
    def n_slot(self) -> int:
        """How many jobs it should have at a time."""
        return super().n_slot if self.is_warm else 1

    def _send(self, job: Job) -> Future:
        n = 1 if job.n_alone else self._n_process
        if self._n_started != n:
            self._start(n)
        try:
            # Whatever can't be sent there or back is its own fault, and breaks nothing.
            message = pickle.dumps((job.function, job.argument), protocol=pickle.HIGHEST_PROTOCOL)
            path = None if job.shared is None else self._share(job.shared)
        except Exception as fault:  # noqa: BLE001  whatever an object does that is pickled
            return _failed(fault)
        try:
            return self.executor.submit(work, message, path)
        except BrokenExecutor:
            self._start(n)
        try:
            return self.executor.submit(work, message, path)
        except BrokenExecutor as fault:  # the new processes have ended, too: `wait` says what that means
            return _failed(fault)

    def _start(self, n: int) -> None:
        self._n_failed = self._n_failed + 1 if self._has_failed() else 0
        self._end()
        self.executor, self._first = start_processes(n)
        self._n_started = n

    def _has_failed(self, seconds: float = 0.0) -> bool:
        """Tell whether no process could be started, or one ended before it was; wait so long for that to be known."""
        wait([self._first], seconds)
        return self._first.done() and not self._first.cancelled() and self._first.exception() is not None

    def _end(self) -> None:
        if self._n_started:
            end_processes(self.executor, is_at_work=self.n_running > 0)
        self._n_started = 0

    def _share(self, shared: SharedObject) -> str:
        """Write a model to a file, once, from which each process reads it, once; return its path."""
        if shared.sent is None:
            self._folder = self._folder or make_folder()
            self._n_sent += 1
            path = os.path.join(self._folder, f"{self._n_sent}.pickle")
            with open(path, "wb") as stream:
                pickle.dump(shared.value, stream, protocol=pickle.HIGHEST_PROTOCOL)
            finalize(shared, _remove, path)  # nobody needs it any more
            shared.sent = path
        return shared.sent

    def wait(self) -> tuple[Job, Done | Died | Failed]:
        """Wait for the next job that has an outcome; return both.

        Raises RasterizerError where no process could be started, again and again.
        """
        job, outcome = super().wait()
        if isinstance(outcome, Died) and self._has_failed(_SOON):
            if self._n_failed >= _MAX_FAILED:
                raise RasterizerError(f"processes can't be started: the first one {outcome.how}")
            self.submit(job)
            return self.wait()
        self.is_warm = True
        return job, outcome

    def _result(self, future: Future) -> Any:
        return pickle.loads(future.result())

    def _death(self, fault: Exception) -> str | None:
        if not isinstance(fault, BrokenExecutor):
            return None
        ends = re.findall(r"([A-Z]\w*)\((-?\d+)\)", str(fault))  # as loky says it: {EXIT(9), SIGKILL(-9)}
        words = [f"was ended by {name}" if code < "0" else f"ended with exit code {code}" for name, code in ends]
        return " and ".join(dict.fromkeys(words)) or "has ended"

    def close(self) -> None:
        """End all processes, and what they are at."""
        self._end()
        super().close()
        if self._folder:
            remove_folder(self._folder)
            self._folder = ""


def _failed(fault: Exception) -> Future:
    """Return the future of a job that could not be sent."""
    future: Future = Future()
    future.set_exception(fault)
    return future


def has_kernels() -> bool:
    """Tell whether the store of this process has any kernels."""
    with suppress(OSError):
        return any(name.endswith(".kernel") for folder in STORE.folders for name in os.listdir(folder))
    return False


def _remove(path: str) -> None:
    with suppress(OSError):
        os.unlink(path)


_kept: dict[str, Any] = {}  # in each process: what functions of jobs keep
_known: dict[str, Any] = {}  # models that it was sent, the last one last


def work(message: bytes, path: str | None) -> bytes:
    """Work on a job; return what its function returns, as bytes.

    Parameters
    ----------
    path : of the model; None where it needs none
    """
    try:
        function, argument = pickle.loads(message)
        shared = None
        if path is not None:
            if path in _known:
                shared = _known.pop(path)
            else:
                with open(path, "rb") as stream:
                    shared = pickle.load(stream)
            _known[path] = shared
            while len(_known) > MAX_SHARED:
                del _known[next(iter(_known))]
        return pickle.dumps(function(argument, shared, _kept), protocol=pickle.HIGHEST_PROTOCOL)
    except Exception as fault:  # noqa: BLE001  whatever it is: some errors can't be sent
        raise RuntimeError(f"{type(fault).__name__}: {fault}") from None


# ---------------------------------------------------------------- Dask
#
# Dask takes care of workers that are lost: what they were at is done by others. A shared object is sent to each of its
# workers once.

_MAX_SCATTERED = 8  # objects that Dask's workers keep for the batch
_ANSWER_WITHIN = 10.0  # seconds in which a scheduler must answer
_LATELY = 1.0  # seconds for which the number of Dask's workers is taken to stay


class DaskPool(Pool):
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
        self._n_asked, self._asked_at = n_process, float("-inf")
        # An impure function is called for each job, also where one with the same arguments has been called before.
        super().__init__(self.client.get_executor(pure=False), n_process or 1)
        self._scattered: deque[SharedObject] = deque()

    @property
    def n_slot(self) -> int:
        """How many jobs it should have at a time."""
        if self._n_asked is None and monotonic() - self._asked_at > _LATELY:
            with suppress(Exception):  # Dask's errors have no base: the scheduler can't be asked just now
                self._n_process = max(1, sum(self.client.nthreads().values()))
            self._asked_at = monotonic()
        return super().n_slot

    def _send(self, job: Job) -> Future:
        shared = job.shared
        if shared is not None and shared.sent is None:
            shared.sent = self.client.scatter(shared.value, hash=False)
            self._scattered.append(shared)
            if len(self._scattered) > _MAX_SCATTERED:
                self._scattered.popleft().sent = None  # what is running keeps its own
        return self.executor.submit(call, job.function, job.argument, shared and shared.sent)

    def _cancelled(self, job: Job) -> Died | Failed:
        """Have an object sent anew that was lost: Dask makes results anew, but not what it was given."""
        if job.shared is None:
            return super()._cancelled(job)
        job.shared.sent = None
        return Died("was lost with its model")

    def _death(self, fault: Exception) -> str | None:
        return str(fault) if type(fault).__name__ == "KilledWorker" else super()._death(fault)

    def close(self) -> None:
        """Take back what runs, and end the connection if it was made here."""
        super().close()
        for shared in self._scattered:
            shared.sent = None
        self._scattered.clear()
        if self._is_own:
            self.client.close()


def connect(address: str) -> Any:
    """Return a client of the Dask scheduler at an address.

    Raises
    ------
    SceneError : what is no address
    RasterizerError : Dask isn't installed, or nobody answers there
    """
    if "://" not in address:
        raise SceneError(f"a scheduler's address looks like tcp://10.0.0.1:8786; given {shown(address)}")
    distributed = import_extra("dask.distributed", "distributed", "a scheduler")
    try:
        return distributed.Client(address, timeout=_ANSWER_WITHIN, set_as_default=False)
    except (OSError, ValueError, TypeError) as fault:  # TimeoutError is an OSError
        raise RasterizerError(f"no scheduler of Dask answers at {address}: {fault}") from fault
