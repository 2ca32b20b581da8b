"""A process that works on jobs: what pools.py starts.

A message is its length, 8 bytes, then a pickle. The first one that comes has the paths of modules, and is answered by
READY. The others are jobs; each is answered by (whether it was done, its value or the error). The process ends with
its input, so also when who started it is gone.
"""

import os
import pickle
import signal
import sys
from typing import IO, Any

READY = b"ready"
MAX_SHARED = 2  # objects that a process keeps
_LENGTH = 8  # bytes


def main() -> None:
    """Work on the jobs that standard input brings."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # removes what is half written
    # What others print is no answer: the streams of messages get numbers that nobody else knows.
    messages, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "rb") as empty:
        os.dup2(empty.fileno(), 0)
    os.dup2(2, 1)
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):  # before numpy is imported
        os.environ.setdefault(name, "1")
    code: Any = 0
    try:
        paths = pickle.loads(read_message(messages))
        sys.path[:] = [*dict.fromkeys([*sys.path, *paths])]
        write_message(answers, READY)
        serve(messages, answers)
    except (EOFError, BrokenPipeError):  # who started this process wants no more of it
        pass
    except SystemExit as end:
        code = end.code
    # What was imported lives as long as the process: nothing is gained by taking it apart.
    sys.stderr.flush()
    os._exit(code)


def serve(messages: IO[bytes], answers: IO[bytes]) -> None:
    """Answer messages until there are no more: EOFError."""
    known: dict[str, Any] = {}
    kept: dict[str, Any] = {}
    while True:
        message = read_message(messages)
        try:
            answer = True, work(message, known, kept)
        except Exception as fault:  # noqa: BLE001  whatever it is goes back to who sent the job
            answer = False, fault
        del message
        write_message(answers, pack_answer(*answer))
        del answer  # it would stay while the next message is awaited


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
            pickle.loads(content)  # errors with arguments of their own can be packed, but not unpacked
        return content
    except Exception as fault:  # noqa: BLE001  whatever an object does that is pickled
        text = f"{type(value).__name__}: {value}" if not is_done else f"what it returned can't be sent: {fault}"
        return pickle.dumps((False, RuntimeError(text)))


def write_message(stream: IO[bytes], content: bytes) -> None:
    """Write a message."""
    stream.write(len(content).to_bytes(_LENGTH, "little"))
    stream.write(content)
    stream.flush()


def read_message(stream: IO[bytes]) -> bytes:
    """Read a message; EOFError where the stream ends before its end."""
    head = stream.read(_LENGTH)
    content = stream.read(int.from_bytes(head, "little")) if len(head) == _LENGTH else b""
    if len(head) < _LENGTH or len(content) < int.from_bytes(head, "little"):
        raise EOFError("the stream has ended")
    return content
