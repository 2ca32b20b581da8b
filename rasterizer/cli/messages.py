"""What the command line says: messages on stderr, one line each; lines of JSON; bars; what failed, what is done."""

import math
import os
import sys
from contextlib import closing, contextmanager, nullcontext
from time import perf_counter

from ..errors import OutputError, counted, cut, error_of

QUIET, NORMAL, VERBOSE, EVERYTHING = -1, 0, 1, 2  # the last: what explains how the program works
STDIO = "-"  # what stands for stdin or stdout
BAR_WIDTH = 24
_EVERY_RUN = (
    "compiling kernels takes a while in every run, as there is no folder that could keep them (-v says why); "
    "RASTER_STORE names one"
)


class Messages:
    """Say what `level` lets through: errors always, warnings and notices unless quiet, details if verbose."""

    def __init__(self, level: int = NORMAL):
        self.level = level

    def error(self, text) -> None:
        """Say what went wrong."""
        self.say(f"error: {text}")

    def warn(self, *texts) -> None:
        """Say what may be a mistake, a line each."""
        for text in texts if self.level > QUIET else ():
            self.say(f"warning: {text}")

    def notice(self, text) -> None:
        """Say what a person should know while waiting."""
        if self.level > QUIET:
            self.say(text)

    def detail(self, text) -> None:
        """Say what only somebody who asks wants to know."""
        if self.level >= VERBOSE:
            self.say(text)

    def explain(self, text) -> None:
        """Say how it was done, to somebody who asks twice."""
        if self.level >= EVERYTHING:
            self.say(text)

    def record(self, record: dict, is_stdout_taken: bool = False) -> None:
        """Print a dict as one line of JSON: on stdout, or on stderr where a picture goes to stdout.

        Its `status` is "failed" beside an error, else "done", unless the dict has one.
        A number that is not finite, which JSON doesn't have, becomes null.
        """
        import json

        record = {"status": "failed" if "error" in record else "done"} | record
        print_text(json.dumps(_finite(record), allow_nan=False) + "\n", is_stdout_taken)

    def traceback(self, error) -> None:
        """Show where a fault of the program's own happened, if verbose."""
        if self.level >= VERBOSE and sys.stderr is not None:
            import traceback

            traceback.print_exception(error, file=sys.stderr)

    def fault(self, failure, error) -> None:
        """Show where an error happened if its failure, as `failure_of` returns it, is a fault of the program's own."""
        if getattr(failure, "is_internal", False):
            self.traceback(failure.__cause__ or error)

    def say(self, text) -> None:
        """Say a line, whatever the level."""
        if sys.stderr is not None:  # None where the process was started without one
            print(f"raster: {plain(' '.join(str(text).split()))}", file=sys.stderr, flush=True)

    @contextmanager
    def shown_warnings(self):
        """Keep the warnings of libraries off stderr inside the block; they are details."""
        import warnings

        def show(message, category, _filename, _line, _file=None, _text=None):
            self.detail(f"{category.__name__}: {message}")

        with warnings.catch_warnings():
            warnings.showwarning = show
            yield


# --- what failed, and what is done ------------------------------------------------------------------------------------


def failure_of(model: str, size, error: Exception) -> Exception:
    """Return what is said of whatever went wrong at a model; `size` is that of its picture, or None."""
    at = f" at {size}" if size is not None and isinstance(error, MemoryError) else ""
    return error_of(f"{model}{at}", error)


class Failures(list):
    """The errors of a run, one for each model that failed.

    Parameters
    ----------
    messages : Messages
    is_json : whether each is also printed as a line of JSON
    """

    def __init__(self, messages, is_json: bool = False):
        super().__init__()
        self._messages, self._is_json = messages, is_json

    @contextmanager
    def caught(self, model: str, size=None, is_stdout_taken: bool = False):
        """Tell what goes wrong inside the block, which is about one model, and go on.

        Parameters
        ----------
        model : path, for messages
        size : (width, height) of its picture, or None
        is_stdout_taken : whether a picture goes to stdout
        """
        try:
            yield
        except BrokenPipeError:
            raise
        except Exception as error:  # noqa: BLE001  whatever it is, one model that fails does not stop the rest
            failure = failure_of(model, size, error)
            self.append(failure)
            self.tell(model, failure, is_stdout_taken)
            self._messages.fault(failure, error)

    def tell(self, model: str, failure: Exception, is_stdout_taken: bool = False) -> None:
        """Say what went wrong at a model."""
        self._messages.error(failure)
        if self._is_json:
            self._messages.record({"model": model, "error": str(failure)}, is_stdout_taken)


class Results:
    """Tell of each picture that is done in a line on a terminal:

        raster: [37/200] thumbs/part.png, 640x480, 35.1 kB, 0.12 s

    Nothing is said where stderr is no terminal, where -q or -v is given, or where lines of JSON say more.

    Parameters
    ----------
    messages : Messages
    n : how many pictures there will be
    is_told : whether anybody wants lines
    """

    def __init__(self, messages, n: int, is_told: bool = True):
        is_terminal = sys.stderr is not None and sys.stderr.isatty()
        self._messages, self._n, self._n_done = messages, n, 0
        self._is_told = is_told and is_terminal and messages.level == NORMAL

    def tell(self, output: str, size, n_byte: int, seconds: float) -> None:
        """Say that a picture is done.

        Parameters
        ----------
        output : path, or - for stdout
        size : (width, height), pixels
        n_byte : of the file
        seconds : that it took
        """
        self._n_done += 1
        if self._is_told:
            count = f"[{self._n_done}/{self._n}] " if self._n > 1 else ""
            name = "stdout" if output == STDIO else output
            width, height = size
            self._messages.notice(f"{count}{name}, {width}x{height}, {byte_words(n_byte)}, {seconds:.2f} s")


# --- stdout, and lines of JSON ----------------------------------------------------------------------------------------


def byte_words(n_byte: int) -> str:
    """A number of bytes for people."""
    for unit, size in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if n_byte >= size:
            return f"{n_byte / size:.3g} {unit}"
    return f"{n_byte} bytes"


def _finite(value):
    """Replace what JSON can't say."""
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def aligned(rows) -> list[str]:
    """Return rows of cells, texts, as lines in columns: the first one to the left."""
    first, *others = ([len(cell) for cell in column] for column in zip(*rows, strict=True))
    widths = [max(lengths) for lengths in others]
    return ["  ".join([name.ljust(max(first)), *map(str.rjust, cells, widths)]).rstrip() for name, *cells in rows]


def print_text(text: str, is_stdout_taken: bool = False) -> None:
    """Print lines that were asked for: on stdout, or on stderr where a picture goes to stdout."""
    text = plain(text)
    if not is_stdout_taken:
        write_stdout(_bytes_of(text))
    elif sys.stderr is not None:
        sys.stderr.write(text)


def plain(text: str) -> str:
    """Return a text with a question mark in the place of each character that a terminal would obey, that turns the
    order of what is shown, or that isn't seen: names in files may hold any."""
    odd = [each for each in set(text) if not (each.isprintable() or each in "\n\t")]
    if odd:
        from unicodedata import category

        text = text.translate({ord(each): "?" for each in odd if category(each) in ("Cc", "Cf", "Zl", "Zp")})
    return text


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


# --- bars, and kernels that are being compiled ------------------------------------------------------------------------


@contextmanager
def compilation_shown(messages):
    """Show inside the block which kernel is being compiled and how many are done; as a detail, what is wrong with those
    on disk.

    Yields the Progress that is shown.
    """
    from ..compiler import kernels

    for reason in kernels.STORE.reasons:
        messages.detail(f"the store of kernels: {reason}")
    with closing(Bar(messages)) as bar, _details_told(messages) if messages.level >= VERBOSE else nullcontext():
        progress = Progress(messages, bar, not kernels.STORE.is_kept)
        with kernels.noticing_compilation(progress.show):
            yield progress


class Bar:
    """A bar on a terminal about work of many parts, until `close`; elsewhere it says nothing.

    Parameters
    ----------
    messages : Messages
    patience : seconds of work before it is shown
    """

    def __init__(self, messages, patience: float = 0.0):
        is_terminal = sys.stderr is not None and sys.stderr.isatty()
        self.is_shown = messages.level == NORMAL and is_terminal
        self._is_drawn, self._start = False, perf_counter() + patience

    def show(self, n_done: int, n: int, what: str) -> None:
        """Show how many parts are done, and what comes now."""
        if self.is_shown and perf_counter() >= self._start:
            n_filled = BAR_WIDTH * n_done // max(n, 1)
            bar = "#" * n_filled + "." * (BAR_WIDTH - n_filled)
            # An escape sequence of terminals clears the rest of the line.
            sys.stderr.write(f"\rraster: [{bar}] {n_done}/{n} {cut(what)}\x1b[K")
            sys.stderr.flush()
            self._is_drawn = True

    def close(self) -> None:
        """Take the bar off the terminal."""
        if self._is_drawn:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
            self._is_drawn = False


class Progress:
    """What is said of kernels that are being compiled: a bar on a terminal, else a line."""

    def __init__(self, messages, bar: Bar, is_every_run: bool):
        self._messages, self._bar, self._is_every_run = messages, bar, is_every_run
        self.n_shown = 0

    def show(self, name: str, n_done: int, n_kernel: int) -> None:
        """Show that a kernel is begun."""
        self.n_shown += 1
        if self._is_every_run and self.n_shown == 1:
            self._messages.notice(_EVERY_RUN)
        if self._bar.is_shown:
            self._bar.show(n_done, n_kernel, f"compiling {name}")
        elif self.n_shown == 1:
            self._messages.notice(f"compiling {counted(n_kernel, 'kernel')} for the first time")


@contextmanager
def _details_told(messages):
    """Say what the package's modules log, inside the block, as details."""
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
