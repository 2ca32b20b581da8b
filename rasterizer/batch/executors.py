"""A crew that is an executor of `concurrent.futures`: threads, a pool of processes, MPI, or the workers of Dask.

Dask takes care of workers that are lost: what they were at is done by others. A shared object is sent to each of its
workers once. Elsewhere it goes with every unit.
"""

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import suppress
from queue import SimpleQueue
from time import monotonic
from typing import Any, NamedTuple, Protocol

from ..cores import n_core
from ..errors import RasterizerError, SceneError, shown

# ----------------------------------------------------------------
# What all who draw for a batch have in common: units of work, and what becomes of them.
# A crew takes a unit by `submit`, and `wait` returns the next one that has an outcome, in any order:
#
#     Done(value)       what the unit's function returned
#     Died(how)         the process that worked on it ended; who else was at work isn't concerned
#     Failed(error)     it could not be sent there or back, or the function raised


class SharedObject:
    """Something large that many units need: it goes to each process once.

    Parameters
    ----------
    value : what is shared; not changed any more
    key : text that tells it from all others of the crew
    """

    def __init__(self, value: Any, key: str) -> None:
        self.value: Any = value
        self.key: str = key
        self.sent: Any = None  # what a crew keeps of it: its bytes, or its name on the machines it was sent to


class Unit:
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


class Crew(Protocol):
    """Who draws."""

    is_here: bool  # whether it sees the files that this process sees

    @property
    def n_slot(self) -> int:
        """How many units it should have at a time."""

    @property
    def n_running(self) -> int:
        """How many it has."""

    def submit(self, unit: Unit) -> None:
        """Give it a unit."""

    def wait(self) -> tuple[Unit, Done | Died | Failed]:
        """Wait for the next unit that has an outcome."""

    def close(self) -> None:
        """Give up what is running, and end what was started."""


def work_through(
    crew: Crew, units: Iterable[Any], follow_up: Callable[[Unit, Done | Died | Failed], list[Unit]]
) -> Iterator[tuple[Any, Done | Died | Failed | None]]:
    """Keep a crew at work; yield (unit, outcome) as units are done, in any order.

    Parameters
    ----------
    units : are taken as there is room for them; what is no Unit is passed on as (it, None)
    follow_up : returns the units that take the place of one, after its outcome; none: the outcome is passed on
    """
    source, again, is_exhausted = iter(units), deque[Unit](), False
    while True:
        while crew.n_running < crew.n_slot and (again or not is_exhausted):
            unit = again.popleft() if again else next(source, None)
            if isinstance(unit, Unit):
                crew.submit(unit)
            elif unit is None:
                is_exhausted = True
            else:
                yield unit, None
        if not crew.n_running:
            return
        done, outcome = crew.wait()
        instead = follow_up(done, outcome)
        again.extend(instead)
        if not instead:
            yield done, outcome


_AHEAD = 2  # units for each process: one that it works on, and one that it finds there when it is done
_MOST_SCATTERED = 8  # objects that Dask's workers keep for the batch
_PATIENCE = 10.0  # seconds in which a scheduler must answer
_LATELY = 1.0  # seconds for which the number of Dask's workers is taken to stay
_MOST_LOST = 3  # times that a unit is sent again, because what it shares was lost with a worker


class ExecutorCrew:
    """Units on an executor.

    Parameters
    ----------
    executor : its `submit` is called; it isn't shut down
    n_process : how many units are worked on at a time; None = what the executor says of itself
    """

    is_here = False

    def __init__(self, executor: Executor, n_process: int | None = None) -> None:
        self.executor = executor
        n_process = n_process or getattr(executor, "_max_workers", None) or n_core()
        self._n_slot = _AHEAD * n_process
        self._outcomes: SimpleQueue = SimpleQueue()
        self._running: dict[Future, Unit] = {}

    @property
    def n_slot(self) -> int:
        """How many units it should have at a time."""
        return self._n_slot

    @property
    def n_running(self) -> int:
        """How many it has."""
        return len(self._running)

    def submit(self, unit: Unit) -> None:
        """Give it a unit.

        Raises RasterizerError where the executor takes none any more.
        """
        try:
            future = self.executor.submit(call, unit.function, unit.argument, self._share(unit.shared))
        except RuntimeError as fault:  # broken, or shut down
            raise RasterizerError(f"the executor takes no tasks any more: {fault}") from fault
        self._running[future] = unit
        future.add_done_callback(self._outcomes.put)

    def _share(self, shared: SharedObject | None) -> Any:
        """Return what stands for a shared object among the arguments of a call."""
        return None if shared is None else shared.value

    def wait(self) -> tuple[Unit, Done | Died | Failed]:
        """Wait for the next unit that has an outcome; return both."""
        future = self._outcomes.get()
        unit = self._running.pop(future)
        try:
            return unit, Done(future.result())
        except BrokenExecutor as fault:
            return unit, Died(str(fault))
        except CancelledError:
            return self._settle_lost(unit)
        except Exception as fault:  # noqa: BLE001  whatever a unit raised there: the others go on
            return unit, Died(str(fault)) if _is_death(fault) else Failed(fault)

    def _settle_lost(self, unit: Unit) -> tuple[Unit, Done | Died | Failed]:
        """Return the outcome of a unit that somebody has cancelled."""
        return unit, Failed(RasterizerError("the executor has cancelled it"))

    def close(self) -> None:
        """Take back what hasn't begun; what runs is left to the executor."""
        for future in self._running:
            future.cancel()
        self._running.clear()


class DaskCrew(ExecutorCrew):
    """Units on the workers of Dask.

    Parameters
    ----------
    client : dask.distributed.Client, or the address of a scheduler, such as "tcp://10.0.0.1:8786"
    n_process : how many units are worked on at a time; None = one for each thread of the workers that there are, also
        of those that come later
    """

    def __init__(self, client: Any, n_process: int | None = None) -> None:
        self._is_own = isinstance(client, str)
        self.client = connect(client) if isinstance(client, str) else client
        self._n_asked = n_process
        self._asked_at = float("-inf")
        # An impure function is called for each unit, also where one with the same arguments has been called before.
        super().__init__(self.client.get_executor(pure=False), n_process or 1)
        self._scattered: deque[SharedObject] = deque()
        self._sent_with: dict[Unit, Any] = {}  # what stood for the shared object of each that is running

    @property
    def n_slot(self) -> int:
        """How many units it should have at a time."""
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
            while len(self._scattered) > _MOST_SCATTERED:
                self._scattered.popleft().sent = None  # what is running keeps its own
        return shared.sent

    def submit(self, unit: Unit) -> None:
        """Give it a unit."""
        super().submit(unit)
        self._sent_with[unit] = unit.shared and unit.shared.sent

    def wait(self) -> tuple[Unit, Done | Died | Failed]:
        """Wait for the next unit that has an outcome; return both."""
        unit, outcome = super().wait()
        self._sent_with.pop(unit, None)
        return unit, outcome

    def _settle_lost(self, unit: Unit) -> tuple[Unit, Done | Died | Failed]:
        """Send a unit again whose shared object was lost: Dask makes results anew, but not what it was given."""
        unit.n_lost += 1
        if unit.n_lost > _MOST_LOST:
            return super()._settle_lost(unit)
        shared = unit.shared
        if shared is not None and shared.sent is self._sent_with.get(unit):
            shared.sent = None  # the first unit that tells of it has the object sent anew
        self.submit(unit)
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
    """Call the function of a unit, in a process that keeps nothing for later ones."""
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
        return Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError) as fault:  # TimeoutError is an OSError
        raise RasterizerError(f"no scheduler of Dask answers at {address}: {fault}") from fault


def make_executor_crew(executor: Any, n_process: int | None) -> ExecutorCrew:
    """Return the crew that an executor, a client or an address stands for; SceneError for anything else."""
    if isinstance(executor, Executor):
        return ExecutorCrew(executor, n_process)
    if isinstance(executor, str) or (hasattr(executor, "scatter") and hasattr(executor, "get_executor")):
        return DaskCrew(executor, n_process)
    legal = "None, an executor of concurrent.futures, a Client of dask.distributed, or the address of its scheduler"
    raise SceneError(f"executor must be {legal}; given {shown(executor)}")


def identify(path: str) -> tuple[int, int] | None:
    """Return the length of a file and its time of change, ns; None where there is none."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_size, status.st_mtime_ns


def _is_death(fault: Exception) -> bool:
    """Tell whether Dask gave a unit up because the workers that took it died."""
    return type(fault).__name__ == "KilledWorker"
