"""`render_many`: tasks in, files and records out.

Tasks are taken from their iterable as they are needed, a few for each process. Neighbours of one model become a run,
which is one job: the model is loaded once for it. A job whose process dies is divided into single tasks. Each
of these is drawn once more, alone in its process; the one that ends that process, too, is named.
"""

import logging
import os
from collections import OrderedDict, deque
from collections.abc import Generator, Iterable, Iterator, Mapping
from dataclasses import replace
from time import perf_counter
from typing import Any, NamedTuple

from ..errors import OutputError, RasterizerError, SceneError, shown
from ..io.files import identity_of, write_whole
from ..io.loader import load
from ..options import Options
from ..processes import Died, Done, Failed, Job, SharedObject
from ..scene.mesh import Mesh
from ..scene.scene import Scene
from ..scene.validate import choice
from .draw_run import Drawn, Run, draw_run, identify, load_model_of, plain_error, view_of
from .pools import LONGEST_RUN, Pool, died_once, make_error, make_pool, pictures_per_job, replace_job, work_through
from .tasks import EXISTING, Existing, RenderRecord, RenderSummary, RenderTask

_MAX_OUTPUTS = 2**16  # of the last ones is known which task writes them
_MAX_OBJECTS = 8  # models given as objects that are recognised when they come again


def render_many(
    tasks: Iterable[RenderTask],
    executor: Any = None,
    *,
    n_process: int | None = None,
    existing: Existing = "replace",
) -> "Batch":
    """Draw many pictures of many models, in several processes, and write each as soon as it is drawn.

    One that fails doesn't stop the others, whatever the reason: a broken model, an argument that is not legal, a
    process that dies. A file appears whole or not at all. The bytes are those that one process writes.

    Parameters
    ----------
    tasks : RenderTask each, in a list or from a generator, which is asked for a few at a time. Neighbours that have the
        same model are drawn together: put the views of a model next to each other
    executor : who draws. None = processes of this machine, with one thread each. Else an executor of
        `concurrent.futures`, a `dask.distributed.Client`, or the address of a scheduler of Dask, "tcp://…" (extra
        `distributed`). Files are written by this process alone. Dask's workers read a model's file themselves where
        they see the same one, of the same length and time of change; else it is loaded here and sent to each worker
        once
    n_process : how many processes, 1 to 1024, or how many tasks an executor works on at a time; None = as many as this
        process may use processors, or as the executor has
    existing : what becomes of a task whose file is there: "replace", "skip" (it is left out), or "skip-newer" (it is
        left out unless its model's file has changed since). So a run that was interrupted is resumed. It isn't asked
        how the file was made

    Returns
    -------
    Batch, an iterator of RenderRecord in the order in which pictures are done; nothing is drawn before the first is
    asked for. Its `summary` counts them

    Raises
    ------
    SceneError : another argument than the tasks is not legal; from the iterator: what is no RenderTask
    RasterizerError : from the iterator: no process can be started, or the executor takes no tasks any more. What was
        written until then stays
    """
    choice(existing, EXISTING, "existing")
    try:
        iterator = iter(tasks)
    except TypeError:
        raise SceneError(f"tasks must be an iterable of RenderTask; given {shown(tasks)}") from None
    return Batch(iterator, make_pool(executor, n_process), existing)


class Item(NamedTuple):
    """A task that waits to be drawn."""

    number: int  # of the task
    task: RenderTask
    options: Options
    path: str | None  # of the model; None where it is an object
    shared: SharedObject | None  # the model, where it is an object

    def has_model_of(self, other: "Item") -> bool:
        """Tell whether one run can hold both."""
        is_loaded_alike = self.task.load is other.task.load or not (self.task.load or other.task.load)
        return is_loaded_alike and self.path == other.path and self.shared is other.shared

    def shows_what(self, other: "Item") -> bool:
        """Tell whether both files come from one frame, where they have one model."""
        return self.options == other.options and view_of(self.task) == view_of(other.task)


class Note(NamedTuple):
    """What is remembered of a job that was sent."""

    items: list[Item]
    run: Run
    warnings: tuple[str, ...] = ()  # of a model that was loaded here
    files_read: tuple[str, ...] = ()
    error: RasterizerError | None = None  # where it could not be loaded here


class Batch:
    """Iterate over what becomes of the tasks of `render_many`; a context manager, which ends what it has started.

    Attributes
    ----------
    summary : RenderSummary of what has been done so far
    """

    def __init__(self, tasks: Iterator[RenderTask], pool: Pool, existing: Existing) -> None:
        self._tasks, self._pool, self._existing = tasks, pool, existing
        self._counts, self._start, self._n_task = RenderSummary(), perf_counter(), 0
        self._is_exhausted = False
        self._waiting: deque[Item] = deque()
        self._outputs: OrderedDict[str, int] = OrderedDict()  # index of the task that writes each
        self._objects: OrderedDict[int, SharedObject] = OrderedDict()  # by the id of the object, which they keep
        self._n_object = 0
        self._records = self._work()

    @property
    def summary(self) -> RenderSummary:
        """What has been done so far."""
        return self._counts

    def __iter__(self) -> "Batch":
        return self

    def __next__(self) -> RenderRecord:
        record = next(self._records)
        setattr(self._counts, record.status, getattr(self._counts, record.status) + 1)
        self._counts.seconds = perf_counter() - self._start
        return record

    def __enter__(self) -> "Batch":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End what draws; nothing more is written. What has been written stays."""
        self._records.close()
        self._pool.close()

    def _work(self) -> Generator[RenderRecord, None, None]:
        """Keep the pool at work; yield what becomes of the tasks."""
        self._start = perf_counter()
        try:
            for job, outcome in work_through(self._pool, self._jobs(), self._follow_up):
                if outcome is None:
                    yield job  # the record of a task that isn't drawn
                else:
                    yield from self._settle(job.note, outcome)
        finally:
            self._pool.close()

    # --- tasks to jobs

    def _jobs(self) -> Iterator[Job | RenderRecord]:
        """Yield what is to be drawn, and the records of what isn't."""
        while True:
            yield from self._fill()
            if not self._waiting:
                return
            yield self._next_job()

    def _fill(self) -> Iterator[RenderRecord]:
        """Take tasks until there are some for each process; yield the records of those that aren't drawn."""
        while not self._is_exhausted and len(self._waiting) < LONGEST_RUN * (self._pool.n_slot + 1):
            try:
                task = next(self._tasks)
            except StopIteration:
                self._is_exhausted = True
                return
            if not isinstance(task, RenderTask):
                raise SceneError(f"tasks must be RenderTask each; number {self._n_task} is {shown(task)}")
            index, self._n_task = self._n_task, self._n_task + 1
            try:
                item = self._check(index, task)
            except Exception as fault:  # noqa: BLE001  whatever it is, one that is not legal doesn't stop the others
                yield _failed(index, task, plain_error(task.name, fault))
                continue
            if item is None:
                yield RenderRecord(index, os.fspath(task.output), "skipped", source=source_of(task))
            else:
                self._waiting.append(item)

    def _check(self, index: int, task: RenderTask) -> Item | None:
        """Return a task as an item; None where its file is there and shall stay."""
        options = task.check()
        output = os.path.abspath(task.output)
        other = self._outputs.setdefault(output, index)
        if other != index:
            raise OutputError(f"can't write {task.output}: task {other} of the batch writes it, too")
        if len(self._outputs) > _MAX_OUTPUTS:
            self._outputs.popitem(last=False)
        path = source_of(task)
        if self._existing != "replace" and is_there(output, path if self._existing == "skip-newer" else None):
            return None
        identity = None if path is None else identity_of(path)
        if identity is not None and identity == identity_of(output):
            raise OutputError(f"can't write {task.output}: it is the model, which is read")
        if path is not None and not self._pool.is_here:
            path = os.path.abspath(path)
        return Item(index, task, options, path, None if path is not None else self._share(task.source, task.load))

    def _share(self, source: Any, settings: Mapping[str, Any]) -> SharedObject:
        """Return a model that is an object as what is sent once; one that may change is copied, by loading it."""
        is_frozen = isinstance(source, (Scene, Mesh, bytes))
        shared = self._objects.get(id(source)) if is_frozen else None
        if shared is None:
            shared = SharedObject(source if is_frozen else load(source, **settings), str(self._n_object))
            self._n_object += 1
            if is_frozen:
                self._objects[id(source)] = shared
        if is_frozen:
            self._objects.move_to_end(id(source))
        if len(self._objects) > _MAX_OBJECTS:
            self._objects.popitem(last=False)
        return shared

    def _next_job(self) -> Job:
        """Return what is drawn next, of what waits; it ends with all files that one view is drawn for."""
        n = pictures_per_job(self._pool, len(self._waiting))
        items = [self._waiting.popleft()]
        while self._waiting and self._waiting[0].has_model_of(items[0]):
            if len(items) >= n and not self._waiting[0].shows_what(items[-1]):
                break
            items.append(self._waiting.popleft())
        return self._job_of(items)

    def _job_of(self, items: list[Item]) -> Job:
        """Return the job that draws some items of one model."""
        task, path = items[0].task, items[0].path
        identity = None if path is None or self._pool.is_here else identify(path)
        tasks = tuple((replace(item.task, source=None), item.options) for item in items)
        run = Run(task.name, path, identity, dict(task.load), tasks)
        job = Job(draw_run, run, items[0].shared)
        job.note = Note(items, run)
        return job

    # --- outcomes to records

    def _follow_up(self, job: Job, outcome: Done | Died | Failed) -> list[Job]:
        instead = replace_job(
            job, outcome, lambda job: [self._job_of([item]) for item in job.note.items], self._send_model
        )
        if instead and isinstance(outcome, Died):
            logging.getLogger("rasterizer").warning("%s: %s", job.note.run.name, died_once(outcome))
        return instead

    def _send_model(self, job: Job) -> list[Job]:
        """Load a model that the machine that should draw it doesn't see; return the job that has it, if any."""
        note: Note = job.note
        try:
            model = load_model_of(note.run, None, {})
        except Exception as fault:  # noqa: BLE001  whatever it is, one that can't be read doesn't stop the rest
            job.note = note._replace(error=plain_error(note.run.name, fault))
            return []
        run = note.run._replace(path=None, identity=None, load={})
        again = Job(draw_run, run, self._share(model.scene, {}))
        again.note = note._replace(warnings=model.warnings, files_read=model.files_read)
        return [again]

    def _settle(self, note: Note, outcome: Done | Died | Failed) -> Iterator[RenderRecord]:
        """Write what was drawn, and yield its records."""
        if isinstance(outcome, Done) and outcome.value is not None:
            for item, drawn in zip(note.items, outcome.value, strict=True):
                yield self._write(item, drawn, note)
            return
        error = note.error if isinstance(outcome, Done) else make_error(note.run.name, outcome)
        yield from (_failed(item.number, item.task, error) for item in note.items)

    def _write(self, item: Item, drawn: Drawn, note: Note) -> RenderRecord:
        """Write the file of a picture; return its record."""
        if drawn.content is None:
            return _failed(item.number, item.task, drawn.error, drawn.seconds)
        output = os.fspath(item.task.output)
        try:
            identity = identity_of(output)
            for path in (*drawn.files_read, *note.files_read):
                if identity is not None and identity_of(path) == identity:
                    raise OutputError(f"can't write {output}: it is {path}, which the model reads")
            make_folder_of(output)
            write_whole(output, drawn.content)
        except OutputError as error:
            return _failed(item.number, item.task, error, drawn.seconds)
        warnings = (*note.warnings, *drawn.warnings)
        source = source_of(item.task)
        return RenderRecord(item.number, output, "drawn", drawn.seconds, None, drawn.stats, source, warnings)


def make_folder_of(output: str) -> None:
    """Make the folder that a file goes to; OutputError where that can't be done."""
    try:
        os.makedirs(os.path.dirname(os.path.realpath(output)), exist_ok=True)
    except (OSError, ValueError) as fault:
        reason = getattr(fault, "strerror", None) or fault
        raise OutputError(f"can't write {output}: its folder can't be made: {reason}") from fault


def source_of(task: RenderTask) -> str | None:
    """The path of a task's model; None where that is no file."""
    return os.fspath(task.source) if isinstance(task.source, (str, os.PathLike)) else None


def _failed(index: int, task: RenderTask, error: Exception | None, seconds: float = 0.0) -> RenderRecord:
    """The record of a task that failed."""
    return RenderRecord(index, str(task.output), "failed", seconds, error, None, source_of(task))


def is_there(output: str, model: str | None) -> bool:
    """Tell whether a file is there, and no older than the file of its model, if one is given. An empty one is none."""
    try:
        status = os.stat(output)
        return status.st_size > 0 and (model is None or status.st_mtime_ns >= os.stat(model).st_mtime_ns)
    except (OSError, ValueError):
        return False
