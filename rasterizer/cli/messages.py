"""What the command line says: one line a message, on stderr only, plain text."""

import math
import os
import sys
from contextlib import contextmanager

from ..errors import OutputError

QUIET, NORMAL, VERBOSE = -1, 0, 1
BAR_WIDTH = 24
LINES = 20  # the most about one compilation, where there is no bar


class Messages:
    """Say what `level` lets through: errors always, warnings and notices unless quiet, details if verbose."""

    def __init__(self, level: int = NORMAL):
        self.level = level
        self.bar = None  # one of tqdm, while it is on the terminal
        self._told: set[str] = set()  # what is said but once

    def error(self, text) -> None:
        """Say what went wrong."""
        self._say(f"error: {text}")

    def warn(self, text) -> None:
        """Say what may be a mistake."""
        if self.level > QUIET:
            self._say(f"warning: {text}")

    def notice(self, text) -> None:
        """Say what a person should know while waiting."""
        if self.level > QUIET:
            self._say(text)

    def notice_once(self, text) -> None:
        """Say what holds for all models of a run, at the first of them."""
        if text not in self._told:
            self._told.add(text)
            self.notice(text)

    def detail(self, text) -> None:
        """Say what only somebody who asks wants to know."""
        if self.level >= VERBOSE:
            self._say(text)

    def record(self, record: dict, is_stdout_taken: bool) -> None:
        """Print a line of JSON, as `print_record` does."""
        print_record(record, is_stdout_taken)

    def traceback(self, error) -> None:
        """Show where a fault of the program's own happened, if verbose."""
        if self.level >= VERBOSE and sys.stderr is not None:
            import traceback

            traceback.print_exception(error, file=sys.stderr)

    def _say(self, text) -> None:
        if self.bar is not None:
            self.bar.write(_line_of(text), file=sys.stderr)
        elif sys.stderr is not None:  # None where the process was started without one
            print(_line_of(text), file=sys.stderr, flush=True)

    @contextmanager
    def shown_warnings(self):
        """Keep the warnings of libraries off stderr inside the block; they are details."""
        import warnings

        def show(message, category, _filename, _line, _file=None, _text=None):
            self.detail(f"{category.__name__}: {message}")

        with warnings.catch_warnings():
            warnings.showwarning = show
            yield


def _line_of(text) -> str:
    return f"raster: {' '.join(str(text).split())}"


def byte_words(n_byte: int) -> str:
    """A number of bytes for people."""
    for unit, size in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if n_byte >= size:
            return f"{n_byte / size:.3g} {unit}"
    return f"{n_byte} bytes"


def print_record(record: dict, is_stdout_taken: bool) -> None:
    """Print a dict as one line of JSON: on stdout, or on stderr where a picture goes to stdout.

    A number that is not finite, which JSON doesn't have, becomes null, and the field NAME_reason beside it says what it
    was.
    """
    import json

    print_text(json.dumps(_finite(record), allow_nan=False) + "\n", is_stdout_taken)


def _finite(value):
    """Replace what JSON can't say."""
    if isinstance(value, (list, tuple)):
        return [None if _is_not_finite(each) else _finite(each) for each in value]
    if not isinstance(value, dict):
        return value
    found = {}
    for key, each in value.items():
        if _is_not_finite(each):
            found |= {key: None, f"{key}_reason": "infinite: no bound is known" if abs(each) > 0 else "not a number"}
        else:
            found[key] = _finite(each)
    return found


def _is_not_finite(value) -> bool:
    return isinstance(value, float) and not math.isfinite(value)


def print_text(text: str, is_stdout_taken: bool) -> None:
    """Print lines that were asked for: on stdout, or on stderr where a picture goes to stdout."""
    if not is_stdout_taken:
        write_stdout(_bytes_of(text))
    elif sys.stderr is not None:
        sys.stderr.write(text)


def _bytes_of(text) -> bytes:
    """Text as UTF-8, the names of files in it as the bytes that they are."""
    try:
        return text.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:
        return text.encode("utf-8", "backslashreplace")


def write_stdout(content: bytes) -> None:
    """Write bytes to stdout; a reader that has gone is no error of ours, a full disk is one."""
    if sys.stdout is None:
        raise OutputError("can't write to stdout: it is closed")
    try:
        sys.stdout.flush()
        rest = memoryview(content)
        while rest:
            rest = rest[sys.stdout.buffer.write(rest) :]  # an unbuffered stream may take a part only
        sys.stdout.buffer.flush()
    except OSError as error:
        # What Python flushes at its end goes nowhere, so that it can't complain once more.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            raise
        raise OutputError(f"can't write to stdout: {error.strerror or error}") from error


@contextmanager
def compilation_shown(messages):
    """Show inside the block which kernel is being compiled and how many are done; as a detail, what is wrong with those
    on disk.

    Yields the Progress that is shown.
    """
    from ..compiler import kernels

    for reason in kernels.STORE.reasons:
        messages.detail(f"the store of kernels: {reason}")
    progress = Progress(messages, not kernels.STORE.is_kept)
    with kernels.noticing_compilation(progress.show), _details_told(messages):
        try:
            yield progress
        finally:
            progress.end()


class Bar:
    """A bar on a terminal about work of many parts; elsewhere it says nothing."""

    def __init__(self, messages):
        is_terminal = sys.stderr is not None and sys.stderr.isatty()
        self.is_shown = messages.level == NORMAL and is_terminal and messages.bar is None
        self._is_drawn = False

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()

    def show(self, n_done: int, n: int, what: str) -> None:
        """Show how many parts are done, and what comes now."""
        if self.is_shown:
            n_filled = BAR_WIDTH * n_done // max(n, 1)
            bar = "#" * n_filled + "." * (BAR_WIDTH - n_filled)
            # An escape sequence of terminals clears the rest of the line.
            sys.stderr.write(f"\rraster: [{bar}] {n_done}/{n} {what}\x1b[K")
            sys.stderr.flush()
            self._is_drawn = True

    def end(self) -> None:
        """Take the bar off the terminal."""
        if self._is_drawn:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
            self._is_drawn = False


class Progress:
    """Lines about kernels that are being compiled: a bar on a terminal, else some lines."""

    def __init__(self, messages, is_every_run: bool):
        self._messages, self._is_every_run = messages, is_every_run
        self._bar = Bar(messages)
        self.n_shown, self._last = 0, -1

    def show(self, name: str, n_done: int, n_kernel: int) -> None:
        """Show that a kernel is begun."""
        self.n_shown += 1
        if self._is_every_run and self.n_shown == 1:
            self._messages.notice(_EVERY_RUN)
        if not self._bar.is_shown:
            part = n_done * LINES // n_kernel
            if n_kernel <= LINES or part > self._last:
                self._last = part
                self._messages.notice(f"compiling kernels for the first time: {name}, {n_done} of {n_kernel} done")
            return
        self._bar.show(n_done, n_kernel, f"compiling {name}")

    def end(self) -> None:
        """Take the bar off the terminal."""
        self._bar.end()


@contextmanager
def _details_told(messages):
    """Say what the package's modules log, inside the block, as details."""

    if messages.level < VERBOSE:
        yield
        return
    import logging

    class Teller(logging.Handler):
        def emit(self, record):
            messages.detail(record.getMessage())

    log, teller = logging.getLogger("rasterizer"), Teller(logging.INFO)
    before = log.level
    log.addHandler(teller)
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.setLevel(before)
        log.removeHandler(teller)


_EVERY_RUN = (
    "compiling kernels takes some seconds in every run, as there is no folder that could keep them (-v says why); "
    "RASTER_STORE names one"
)
