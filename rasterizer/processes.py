"""Processes of this machine that work on jobs: those that draw a batch, and those that compile kernels.

In:  jobs: a function, what it is called with, what it shares with others        Out: an outcome of each, in any order

    ProcessPool.submit ── Job ──> thread ── message ──> process: `main`
                  wait <─ outcome ─────── <── answer ──

    Done(value)       what the job's function returned
    Died(how)         the process that worked on it ended; who else was at work isn't concerned
    Failed(error)     it could not be sent there or back, or the function raised

Each process is led by a thread, which sends it one job after the other through its standard input and waits for the
answer on its standard output. So a process that dies takes down the job that it worked on and nothing else, and it is
known which one that was; a pool of concurrent.futures loses all that it holds. The program that started the pool isn't
imported again, as multiprocessing does: no `if __name__ == "__main__"` is needed.

A message is its length, 8 bytes, then a pickle. The first one that comes has the paths of modules, and is answered by
READY. The others are jobs; each is answered by (whether it was done, its value or the error). An empty message is a
sign of life, which a thread of the process gives every second, whatever the process is at: a process that gives none
for SILENCE is ended. The same thread ends the process within half a second after the one that started it.
"""

import ctypes
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO, Any, NamedTuple

from .errors import RasterizerError

SILENCE = 30.0  # seconds without a sign of life, after which a process that has a job is given up
READY = b"ready"
MAX_SHARED = 2  # objects that a process keeps
_LENGTH, _PART = 8, 1 << 20  # bytes
_BEAT, _GLANCE = 1.0, 0.2  # seconds between signs of life, and between looks at who has started the process
_PATIENCE = 0.5  # seconds in which a process may end by itself, and remove what it has half written
_DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG of Linux
_PARENT = str(Path(__file__).resolve().parents[1])  # what the package is imported from
_PROGRAM = """
import sys
sys.path[:] = [sys.argv[1], *filter(None, sys.path)]  # "" is the folder where the program is started: nothing of ours
from rasterizer.processes import main
main(int(sys.argv[2]))
"""


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


class ProcessPool:
    """Processes that are started when there is work for them.

    Parameters
    ----------
    n_process : how many at most
    is_warm : False = the first job is alone, until it is done
    environment : variables of theirs; None = those of this process
    stderr : what theirs is, as subprocess.Popen takes it; None = that of this process
    silence : seconds, 1 or more, after which a process that has a job and gives no sign of life is given up
    """

    is_here = True

    def __init__(
        self,
        n_process: int,
        *,
        is_warm: bool = True,
        environment: Mapping[str, str] | None = None,
        stderr: int | None = None,
        silence: float = SILENCE,
    ) -> None:
        self.n_process, self.is_warm, self.n_running = n_process, is_warm, 0
        self._settings: dict[str, Any] = {"env": environment, "stderr": stderr}
        self._silence, self._looked_at = silence, time.monotonic()
        self._workers: list[_Worker] = []
        self._idle: list[_Worker] = []
        self._outcomes: SimpleQueue = SimpleQueue()

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
            worker = _Worker(self._outcomes, self._settings)
            self._workers.append(worker)
        else:
            self._idle.remove(worker)
        worker.silence = 0.0
        worker.jobs.put(job)
        self.n_running += 1

    def wait(self) -> tuple[Job, Done | Died | Failed]:
        """Wait for the next job that has an outcome; return both.

        Raises RasterizerError where a process ends before its first job: the others would, too.
        """
        while True:
            with suppress(Empty):
                job, outcome, worker = self._outcomes.get(timeout=1.0)
                break
            self._give_up_silent_ones()
        self._give_up_silent_ones()
        self.n_running -= 1
        self.is_warm = True
        if isinstance(outcome, Died):
            self._workers.remove(worker)
            if not worker.is_started:
                raise RasterizerError(f"processes can't be started: the first one {outcome.how}")
        else:
            self._idle.append(worker)
        return job, outcome

    def _give_up_silent_ones(self) -> None:
        """End processes that have given no sign of life; time in which nobody has waited, or that this process was
        stopped for, counts for a second at most."""
        now = time.monotonic()
        passed, self._looked_at = min(1.0, now - self._looked_at), now
        for worker in self._workers:
            worker.silence += passed
            if worker.silence > self._silence and worker not in self._idle:
                worker.give_up(f"gave no sign of life for {self._silence:g} s")

    def close(self) -> None:
        """End all processes, and what they are at."""
        for worker in self._workers:
            worker.end(is_idle=worker in self._idle)
        for worker in self._workers:
            worker.join()
        self._workers, self._idle, self.n_running = [], [], 0


class _Worker:
    """A process and the thread that leads it."""

    def __init__(self, outcomes: SimpleQueue, settings: dict[str, Any]) -> None:
        self.jobs: SimpleQueue = SimpleQueue()
        self.known: list[str] = []  # keys of the shared objects that the process has, the last one last
        self.is_started = False
        self.silence = 0.0  # seconds since the last sign of life
        self._outcomes, self._settings = outcomes, settings
        self._given_up = ""
        begun: SimpleQueue = SimpleQueue()
        self._thread = threading.Thread(target=self._serve, args=(begun,), daemon=True)
        self._thread.start()
        process: Any = begun.get()
        if isinstance(process, OSError):
            raise RasterizerError(f"no process can be started: {process.strerror or process}") from process
        self._process = process

    def _start(self) -> Any:
        # A session of its own: an interrupt of the terminal reaches the caller alone, which ends the others.
        return subprocess.Popen(
            [sys.executable, "-c", _PROGRAM, _PARENT, str(os.getpid())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
            **self._settings,
        )

    def _serve(self, begun: SimpleQueue) -> None:
        try:
            begun.put(self._start())  # by this thread: Linux ends the process with the thread that has started it
        except OSError as fault:
            begun.put(fault)
            return
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
                self.is_started = self._read_answer(len(READY)) == READY
            write_message(self._process.stdin, message)
            answer = self._read_answer()
        except (OSError, EOFError, ValueError):
            return Died(self._how_it_ended())
        try:
            is_done, value = pickle.loads(answer)
        except Exception as fault:  # noqa: BLE001  whatever an object does that is unpickled
            return Failed(fault)
        return Done(value) if is_done else Failed(value)

    def _read_answer(self, longest: int = sys.maxsize) -> bytes:
        """Wait for a message that isn't empty."""
        while not (answer := read_message(self._process.stdout, longest, self._note_life)):
            pass
        return answer

    def _note_life(self) -> None:
        self.silence = 0.0

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

    def give_up(self, why: str) -> None:
        """End the process at once, whatever it is at."""
        self._given_up = why
        self._process.kill()

    def _how_it_ended(self) -> str:
        """Wait for the end of a process that doesn't answer any more; say how it came."""
        try:
            code = self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self.give_up("answered nonsense")
            code = self._process.wait()
        if self._given_up:
            return self._given_up
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


def write_message(stream: IO[bytes], content: bytes) -> None:
    """Write a message."""
    stream.write(len(content).to_bytes(_LENGTH, "little"))
    stream.write(content)
    stream.flush()


def read_message(stream: IO[bytes], longest: int = sys.maxsize, note: Callable[[], object] = lambda: None) -> bytes:
    """Read a message; EOFError where the stream ends before its end, or where it is longer than it can be.

    note : is called whenever some of it has come
    """
    head = stream.read(_LENGTH)
    note()
    left = int.from_bytes(head, "little")
    if len(head) < _LENGTH or left > longest:
        raise EOFError("the stream has ended")
    parts = []
    while left:
        parts.append(stream.read(min(left, _PART)))
        note()
        if not parts[-1]:
            raise EOFError("the stream has ended")
        left -= len(parts[-1])
    return b"".join(parts)


# ---------------------------------------------------------------- in each process


def main(parent: int) -> None:
    """Work on the jobs that standard input brings, as long as the process `parent` lives."""
    if sys.platform == "linux":  # also where this process can do nothing, as when it is stopped
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # removes what is half written
    # What others print is no answer: the streams of messages get numbers that nobody else knows.
    messages, answers = os.fdopen(os.dup(0), "rb"), _Answers(os.fdopen(os.dup(1), "wb"))
    with open(os.devnull, "rb") as empty:
        os.dup2(empty.fileno(), 0)
    os.dup2(2, 1)
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):  # before numpy is imported
        os.environ.setdefault(name, "1")
    threading.Thread(target=answers.live_with, args=(parent,), daemon=True).start()
    code: Any = 0
    try:
        paths = pickle.loads(read_message(messages))
        sys.path[:] = [*dict.fromkeys([*sys.path, *paths])]
        answers.write(READY)
        serve(messages, answers.write)
    except (EOFError, BrokenPipeError):  # who started this process wants no more of it
        pass
    except SystemExit as end:
        code = end.code
    # What was imported lives as long as the process: nothing is gained by taking it apart.
    sys.stderr.flush()
    os._exit(code)


class _Answers:
    """What goes back: the answers, and signs of life between them."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream, self._lock = stream, threading.Lock()

    def write(self, content: bytes) -> None:
        with self._lock:
            write_message(self._stream, content)

    def live_with(self, parent: int) -> None:
        """Give signs of life; end the process when `parent` has ended.

        The end of the input isn't waited for: it doesn't come while a process that was forked from `parent` lives. On
        Windows, where nothing is forked and the number of the parent stays, writing fails.
        """
        beat = 0.0
        with suppress(OSError):
            while os.getppid() == parent:
                if time.monotonic() >= beat:
                    self.write(b"")
                    beat = time.monotonic() + _BEAT
                time.sleep(_GLANCE)
        os._exit(1)


def serve(messages: IO[bytes], answer: Callable[[bytes], object]) -> None:
    """Answer messages until there are no more: EOFError."""
    known: dict[str, Any] = {}
    kept: dict[str, Any] = {}
    while True:
        message = read_message(messages)
        try:
            found = True, work(message, known, kept)
        except Exception as fault:  # noqa: BLE001  whatever it is goes back to who sent the job
            found = False, fault
        del message
        answer(pack_answer(*found))
        del found  # it would stay while the next message is awaited


def work(message: bytes, known: dict[str, Any], kept: dict[str, Any]) -> Any:
    """Work on a job; return what its function returns.

    Parameters
    ----------
    known : shared objects by their keys, in the order in which they were needed; changed
    kept : what the function keeps for later jobs
    """
    function, argument, key, content = pickle.loads(message)
    shared = None
    if key is not None:
        shared = known[key] if content is None else pickle.loads(content)
        known.pop(key, None)
        known[key] = shared  # the last one now
        while len(known) > MAX_SHARED:
            del known[next(iter(known))]
    return function(argument, shared, kept)


def pack_answer(is_done: bool, value: Any) -> bytes:
    """Return an answer as bytes; where it can't be pickled, an error that says so."""
    try:
        content = pickle.dumps((is_done, value), protocol=pickle.HIGHEST_PROTOCOL)
        if not is_done:
            pickle.loads(content)  # errors with arguments of their own can be packed, but not unpickled
        return content
    except Exception as fault:  # noqa: BLE001  whatever an object does that is pickled
        text = f"{type(value).__name__}: {value}" if not is_done else f"what it returned can't be sent: {fault}"
        return pickle.dumps((False, RuntimeError(text)))
