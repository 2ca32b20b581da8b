"""How outputs are written: never in place of a file that the run reads, nor of another output of the run.

Which other files a model reads (materials, textures, buffers, parts of a scene) is known once it has been loaded. So an
output that exists already, where a later model may read it, waits until all models have been loaded. Unless
--allow-outside is given, a model can only read what lies in its own folder, and only some formats name other files at
all: in most runs nothing waits.
"""

import os
import signal
import tempfile
import threading
from contextlib import contextmanager
from pathlib import Path

from ..errors import OutputError
from ..io import formats
from ..io.files import identity_of, write_whole
from .messages import write_stdout
from .targets import STDIO

_IN_MEMORY = 2**26  # bytes that wait in memory; more go into a file without a name
_TERMINATED = 128 + 15  # exit code of a process that SIGTERM has ended


class Outputs:
    """Write the outputs of a run.

    Parameters
    ----------
    plan : list of lists of Target, as `plan_targets` returns it
    arguments : those of the command
    """

    def __init__(self, plan, arguments):
        self.files_read = {
            identity_of(model): model for model in (targets[0].model for targets in plan) if model != STDIO
        }
        self._written, self._waiting, self._store = {}, [], None
        self._later = []  # for each model the folders in which later ones may read
        below = []
        for targets in reversed(plan):
            self._later.insert(0, list(below))
            model = targets[0].model
            format = formats.find(arguments.input_format or Path(model).suffix)
            if format is not None and format.companions:  # its files may name others
                folder = os.path.realpath("." if model == STDIO else os.path.dirname(model) or ".")
                below.append(os.sep if arguments.allow_outside else folder)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        """Write what waits, also after an interrupt: what hasn't been loaded will not be read any more."""
        self.finish(None)

    def of_model(self, number, results=None) -> "ModelOutput":
        """Return what writes the outputs of one model of the plan; `results` are told what is done."""
        return ModelOutput(self, number, results)

    def write(self, content, output, number) -> None:
        """Write an output of a model; raises OutputError where it would replace what is read or was written."""
        if output == STDIO:
            write_stdout(content)
            return
        self._check(output)
        if self._must_wait(output, number):
            self._store = self._store or tempfile.SpooledTemporaryFile(_IN_MEMORY)  # noqa: SIM115  lives with the run
            start, length = self._store.seek(0, os.SEEK_END), len(content)
            self._store.write(content)
            self._waiting.append((output, lambda: self._write(self._stored(start, length), output)))
        else:
            self._write(content, output)

    def _must_wait(self, output, number) -> bool:
        """Tell whether there is a file that a model after model `number` may read."""
        place = os.path.realpath(output)
        return os.path.isfile(place) and any(Path(place).is_relative_to(folder) for folder in self._later[number])

    def _stored(self, start, length) -> bytes:
        self._store.seek(start)
        return self._store.read(length)

    def _check(self, output) -> None:
        identity = identity_of(output)
        if identity is None:
            return
        if identity in self.files_read:
            what = f"can't write {output}: it is {self.files_read[identity]}, which is read"
            raise OutputError(f"{what}; give another name with -o")
        if identity in self._written and os.path.isfile(output):
            raise OutputError(f"can't write {output}: it is {self._written[identity]}, which has just been written")

    def _write(self, content, output) -> None:
        make_folder(output)
        with _cleaning_up():
            write_whole(output, content)
        self._written[identity_of(output)] = output

    def finish(self, messages) -> list[OutputError]:
        """Write what waits; return what failed, after telling it."""
        failures, waiting = [], self._waiting
        self._waiting = []
        for output, put in waiting:
            try:
                self._check(output)
                put()
            except OutputError as error:
                failures.append(error)
                if messages is not None:
                    messages.error(error)
        return failures


class ModelOutput:
    """Write the outputs of one model; `files_read` is a list that takes the paths of the files it reads, `results` the
    Results of the run."""

    def __init__(self, outputs, number, results=None):
        self._outputs, self._number, self.files_read, self.results = outputs, number, [], results

    def write(self, content, output) -> None:
        """Write an output, as `Outputs.write` does."""
        self._note_files_read()
        self._outputs.write(content, output, self._number)

    def _note_files_read(self) -> None:
        self._outputs.files_read |= {identity_of(path): path for path in self.files_read}


def make_folder(output) -> None:
    """Make the folder of an output, where it isn't there; OutputError where that can't be done."""
    folder = os.path.dirname(os.path.realpath(output))
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise OutputError(f"can't write {output}: can't make the folder {folder}: {error.strerror or error}") from error


@contextmanager
def _cleaning_up():
    """Let SIGTERM end the process by an exception inside the block, so that no half file stays."""

    def stop(*_):
        raise SystemExit(_TERMINATED)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
