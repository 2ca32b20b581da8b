"""A crew of processes on this machine.

Each process is led by a thread, which sends it one unit after the other through its standard input and waits for the
answer on its standard output (worker.py). So a process that dies takes down the unit that it worked on and nothing
else, and it is known which one that was; a pool of concurrent.futures loses all that it holds. The program that
started the batch isn't imported again, as multiprocessing does: no `if __name__ == "__main__"` is needed.
"""

import os
import pickle
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from ..compiler.kernels import STORE
from ..cores import n_core
from ..errors import RasterizerError
from .executors import Died, Done, Failed, Unit
from .worker import MOST_SHARED, READY, read_message, write_message

_PARENT = str(Path(__file__).resolve().parents[2])  # what the package is imported from
_PROGRAM = """
import sys
sys.path[:] = [sys.argv[1], *filter(None, sys.path)]
from rasterizer.batch.worker import main
main()
"""
_PATIENCE = 2.0  # seconds in which a process may end by itself, and remove what it has half written


class LocalProcesses:
    """Processes that are started when there is work for them.

    Parameters
    ----------
    n_process : how many at most; None = as many as this one may use processors

    Where no kernel is stored yet, the first unit is alone: it compiles what it needs on all processors, and those that
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
        """How many units it should have at a time."""
        return self.n_process if self.is_warm else 1

    def submit(self, unit: Unit) -> None:
        """Give a unit to a process: to one that has what the unit shares, if there is one.

        Raises RasterizerError where no process can be started.
        """
        key = unit.shared.key if unit.shared else None
        worker = next((each for each in self._idle if key in each.known), None) or next(iter(self._idle), None)
        if worker is None:
            worker = _Worker(self._outcomes)
            self._workers.append(worker)
        else:
            self._idle.remove(worker)
        worker.units.put(unit)
        self.n_running += 1

    def wait(self) -> tuple[Unit, Done | Died | Failed]:
        """Wait for the next unit that has an outcome; return both.

        Raises RasterizerError where a process ends before its first unit: the others would, too.
        """
        unit, outcome, worker = self._outcomes.get()
        self.n_running -= 1
        self.is_warm = True
        if isinstance(outcome, Died):
            self._workers.remove(worker)
            if not worker.is_started:
                raise RasterizerError(f"the processes that draw can't be started: the first one {outcome.how}")
        else:
            self._idle.append(worker)
        return unit, outcome

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
        self.units: SimpleQueue = SimpleQueue()
        self.known: list[str] = []  # keys of the shared objects that the process has, the last one last
        self.is_started = False
        self._outcomes, self._is_ending = outcomes, False
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
        while (unit := self.units.get()) is not None:
            outcome = self._ask(unit)
            if isinstance(outcome, Failed):
                self.known.clear()  # it isn't known whether what was sent has been understood
            self._outcomes.put((unit, outcome, self))
            if isinstance(outcome, Died):
                return
            del unit, outcome  # they hold models

    def _ask(self, unit: Unit) -> Done | Died | Failed:
        """Let the process work on a unit; wait for its answer."""
        try:
            message = self._pack(unit)
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

    def _pack(self, unit: Unit) -> bytes:
        """Return the unit as bytes, with what it shares unless the process has it."""
        key, content = None, None
        if unit.shared is not None:
            key = unit.shared.key
            if unit.shared.sent is None:
                unit.shared.sent = pickle.dumps(unit.shared.value, protocol=pickle.HIGHEST_PROTOCOL)
            content = None if key in self.known else unit.shared.sent
        message = pickle.dumps((unit.function, unit.argument, key, content), protocol=pickle.HIGHEST_PROTOCOL)
        if key is not None:  # the process forgets by the same rule
            self.known = [*(each for each in self.known if each != key), key][-MOST_SHARED:]
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
        self.units.put(None)
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
