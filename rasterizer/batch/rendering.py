"""`render_many`: tasks in, files and records out.

Tasks are taken from their iterable as they are needed, a few for each process. Neighbours of one model become a run,
which is one job: the model is loaded once for it. A job that is lost with a process is divided into single tasks. Each
of these is drawn again, alone in its process; one that ends it twice is named.
"""

import os
from collections import OrderedDict, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from time import perf_counter
from typing import Any, NamedTuple
from weakref import finalize

from ..errors import OutputError, RasterizerError, SceneError, shown, warn_caller
from ..io import formats
from ..io.camera_file import viewpoint_of
from ..io.files import checked_path, identity_of, place_of, refuse_inputs, write_outputs
from ..io.loader import SceneFile, read_source
from ..keywords import checked_keywords
from ..options import Options
from ..scene.mesh import Mesh
from ..scene.scene import Scene
from ..scene.validate import choice
from ..viewpoint import is_path
from .draw_run import Drawn, Run, draw_run, identify, load_model_of, plain_error, view_of
from .manifest import Manifest, depth_scale
from .pools import (
    LONGEST_RUN,
    MOST_ALONE,
    Died,
    Done,
    Failed,
    Job,
    Pool,
    SharedObject,
    make_error,
    make_pool,
    work_through,
)
from .tasks import EXISTING, Existing, RenderRecord, RenderSummary, RenderTask, is_random

_MAX_KNOWN = 2**16  # outputs and inputs, of which is known which task writes them, and that they are read
_NEVER_ASKED = "nothing was drawn: render_many draws while its records are asked for, as in `for record in ...`"
_MAX_OBJECTS = 8  # models given as objects that are recognised when they come again


@checked_keywords
def render_many(
    tasks: Iterable[RenderTask],
    executor: Any = None,
    *,
    n_process: int | None = None,
    existing: Existing = "replace",
    manifest: str | os.PathLike[str] | None = None,
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
    existing : what becomes of a task whose files are there: "replace", "skip" (it is left out), or "changed" (it is
        left out unless its model's file, or one that this names, as a texture or a file of materials, is newer). So a
        run that was interrupted is resumed. How a file was made isn't looked at. All files of a task must be there;
        with a manifest, its line, too
    manifest : path of a file of JSON lines, one for each task that was drawn or skipped, in the order of the tasks; the
        same bytes whoever draws. It is complete when the iterator ends; what is known until then is in
        "MANIFEST.partial", with which an interrupted batch goes on. None = none is written. Each line has
        `index` of the task; `files`, paths by the names of arrays, "rgb" for a picture, as seen from the manifest's
        folder; `model` (path or null), `seed` and `view` of the task; `depth_scale`, scene units of 1 in a PNG file of
        the depth, else null; `size` [width, height] in pixels; `camera`; `objects`, one a mesh of the scene, in its
        order, so by the numbers of the array "object".
        A camera has `opencv` {K, R, t} (x_camera = R x + t; null without perspective), and `opengl` {pose, R, t}, where
        pose is the 4 × 4 matrix to the world; `height` in scene units without perspective.
        An object has `name` and `category`; `pixels` that show it, `box` [left, top, width, height] round them or null,
        and `mask`, as COCO's run lengths; `pixels_alone`, which it would have if nothing else were there, and
        `mask_alone`, null where that is the same; `visible`, pixels / pixels_alone, 0 where it has none; `pixels_whole`
        and `box_whole`, alone and in a picture larger by its own size to each side: what the border cuts off counts
        there. What is transparent hides what is behind it as anything else does

    Returns
    -------
    Batch, an iterator of RenderRecord in the order in which pictures are done; nothing is drawn before the first is
    asked for. Its `summary` counts them

    Raises
    ------
    SceneError : another argument than the tasks is not legal; from the iterator: what is no RenderTask
    RasterizerError : from the iterator: no process can be started, or the executor takes no tasks any more. What was
        written until then stays. After the last record, where all tasks failed: it names the first reason

    Warns
    -----
    UserWarning : the Batch goes away, and nobody has asked it for a record
    """
    choice(existing, EXISTING, "existing")
    file = None if manifest is None else Manifest(checked_path(manifest), existing != "replace")
    try:
        iterator = iter(tasks)
    except TypeError:
        raise SceneError(f"tasks must be an iterable of RenderTask; given {shown(tasks)}") from None
    return Batch(Work(iterator, make_pool(executor, n_process), existing, file))


class Item(NamedTuple):
    """A task that waits to be drawn."""

    number: int  # of the task
    task: RenderTask
    options: Options
    path: str | None  # of the model; None where it is an object
    shared: SharedObject | None  # the model, where it is an object

    def has_model_of(self, other: "Item") -> bool:
        """Tell whether one run can hold both."""
        loads = [{name: id(value) for name, value in each.task.load.items()} for each in (self, other)]
        is_loaded_alike = loads[0] == loads[1] and self.task.is_of_file == other.task.is_of_file
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

    def __init__(self, work: "Work") -> None:
        self._pool, self._records = work.pool, work.do()
        self._counts, self._start = RenderSummary(), 0.0  # the time at which the first record was asked for
        self._first_error: Exception | None = None
        self._never_asked = finalize(self, warn_caller, _NEVER_ASKED)

    @property
    def summary(self) -> RenderSummary:
        """What has been done so far."""
        return self._counts

    def __iter__(self) -> "Batch":
        return self

    def __next__(self) -> RenderRecord:
        self._never_asked.detach()
        counts, self._start = self._counts, self._start or perf_counter()
        record = next(self._records, None)
        if record is None:
            if counts.failed and not counts.drawn + counts.skipped:
                first, self._first_error = self._first_error, None
                if first is not None:  # it is raised once
                    raise RasterizerError(
                        f"{counts.failed} of {counts.failed} tasks failed; the first: {first}"
                    ) from first
            raise StopIteration
        setattr(counts, record.status, getattr(counts, record.status) + 1)
        counts.seconds = perf_counter() - self._start
        if record.error is not None and counts.first_error is None:
            counts.first_error, self._first_error = str(record.error), record.error
        return record

    def __enter__(self) -> "Batch":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End what draws; nothing more is written. What has been written stays."""
        self._records.close()
        self._pool.close()


class Work:
    """What a Batch has to do. It knows nothing of that one: so one that nobody holds any more ends its processes."""

    def __init__(
        self,
        tasks: Iterator[RenderTask],
        pool: Pool,
        existing: Existing,
        manifest: Manifest | None = None,
        draw: Callable[..., list[Drawn] | None] = draw_run,  # called as that
    ) -> None:
        self._tasks, self.pool, self._existing, self._manifest = tasks, pool, existing, manifest
        self._draw, self._n_task, self._is_exhausted = draw, 0, False
        self._waiting: deque[Item] = deque()
        self._outputs: OrderedDict[str, int] = OrderedDict()  # index of the task that writes each
        self._inputs: OrderedDict[Any, str] = OrderedDict()  # paths of files that models have read, by their identity
        self._newest: dict[str, int] = {}  # by the folders of models: when a file beside them was changed
        self._objects: OrderedDict[int, SharedObject] = OrderedDict()  # by the id of the object, which they keep

    def do(self) -> Generator[RenderRecord, None, None]:
        """Keep the pool at work; yield what becomes of the tasks."""
        try:
            if self._manifest is not None:
                self._manifest.open()
            for job, outcome in work_through(self.pool, self._jobs(), self._follow_up):
                if outcome is None:
                    yield job  # the record of a task that isn't drawn
                else:
                    yield from self._settle(job.note, outcome)
            if self._manifest is not None:
                self._manifest.finish()
        finally:
            if self._manifest is not None:
                self._manifest.close()
            self.pool.close()

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
        while not self._is_exhausted and len(self._waiting) < LONGEST_RUN * (self.pool.n_slot + 1):
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
            if isinstance(item, RenderRecord):
                yield item
            else:
                self._waiting.append(item)

    def _check(self, index: int, task: RenderTask) -> Item | RenderRecord:
        """Return a task as an item; its record where its files are there and shall stay."""
        if task.seed is None and (is_random(task.view) or is_random(task.lights)):
            task = replace(task, seed=index)
        options = task.check()
        path, outputs = source_of(task), {name: place_of(name) for name in task.files(options)}
        for k, (name, output) in enumerate(outputs.items()):
            other = self._outputs.get(output)
            if other is not None:
                raise OutputError(f"can't write {name}: task {other} of the batch writes it, too")
            if self._manifest is not None and self._manifest.is_one_of(output):
                raise OutputError(f"can't write {name}: it is the manifest of the batch")
            if output in list(outputs.values())[:k]:
                raise OutputError(f"can't write {name}: another file of the task is written there, too")
        self._outputs.update(dict.fromkeys(outputs.values(), index))
        while len(self._outputs) > _MAX_KNOWN:
            self._outputs.popitem(last=False)
        named = task.files_named if path is None else (path, *task.files_named)
        if self._existing != "replace" and self._is_done(outputs.values(), path, named, task):
            if self._manifest is None or self._manifest.keep(index, task.named_files(options)):
                return RenderRecord(index, task.path, "skipped", model=path, files=tuple(outputs), seed=task.seed)
        refuse_inputs(outputs, {identity_of(each): each for each in named})
        if is_path(task.camera):
            task = replace(task, camera=viewpoint_of({"camera": task.camera}))  # type: ignore[arg-type]  # its file is read
        if path is None:
            return Item(index, task, options, None, self._share(task.source, task.loading))
        return Item(index, task, options, path if self.pool.is_here else os.path.abspath(path), None)

    def _is_done(self, outputs: Iterable[str], path: str | None, named: Iterable[str], task: RenderTask) -> bool:
        """Tell whether files are there, and shall stay; `named` are the model's file and those that the task names."""
        try:
            status = [os.stat(output) for output in outputs]
            if not all(each.st_size for each in status):  # an empty file is none
                return False
            if self._existing != "changed":
                return True
            made = min(each.st_mtime_ns for each in status)
            is_older = all(os.stat(each).st_mtime_ns <= made for each in named)
            return is_older and (path is None or not self._names_newer(path, made, task))
        except (OSError, ValueError):
            return False

    def _names_newer(self, path: str, made: int, task: RenderTask) -> bool:
        """Tell whether a file that a model names is newer than its picture. The model is read only where any other file
        in its folder, or below, is newer."""
        folder = os.path.dirname(path)
        if folder not in self._newest:
            self._newest[folder] = newest_beside(folder)
        if self._newest[folder] <= made:
            return False
        try:
            model = load_model_of(Run(task.name, path, None, task.loading, ()), None, {})
        except RasterizerError:  # which is said where it is drawn
            return True
        return any(os.stat(each).st_mtime_ns > made for each in model.files_read)

    def _share(self, source: Any, settings: Mapping[str, Any]) -> SharedObject:
        """Return a model that is an object as what is sent once; one that may change is copied, by loading it."""
        if not isinstance(source, (Scene, SceneFile, Mesh, bytes)):
            return SharedObject(read_source(source, **settings))
        shared = self._objects.setdefault(id(source), SharedObject(source))
        self._objects.move_to_end(id(source))
        if len(self._objects) > _MAX_OBJECTS:
            self._objects.popitem(last=False)
        return shared

    def _next_job(self) -> Job:
        """Return what is drawn next, of what waits; it ends with all files that one view is drawn for."""
        n = max(1, min(LONGEST_RUN, len(self._waiting) // self.pool.n_slot))  # all processes shall have some
        items = [self._waiting.popleft()]
        while self._waiting and self._waiting[0].has_model_of(items[0]):
            if len(items) >= n and not self._waiting[0].shows_what(items[-1]):
                break
            items.append(self._waiting.popleft())
        return self._job_of(items)

    def _job_of(self, items: list[Item]) -> Job:
        """Return the job that draws some items of one model."""
        task, path = items[0].task, items[0].path
        identity = None if path is None or self.pool.is_here else identify(path)
        tasks = tuple((replace(item.task, source=None), item.options) for item in items)
        run = Run(task.name, path, identity, task.loading, tasks, self._manifest is not None)
        job = Job(self._draw, run, items[0].shared)
        job.note = Note(items, run)
        return job

    # --- outcomes to records

    def _follow_up(self, job: Job, outcome: Done | Died | Failed) -> list[Job]:
        """Return what takes the place of a job: its pictures one by one where something went wrong, or the same job
        with its model where that isn't seen there; none else."""
        if isinstance(outcome, Done):
            return [] if outcome.value is not None else self._send_model(job)
        items, n_alone = job.note.items, job.n_alone + 1 if isinstance(outcome, Died) else 0
        if n_alone > MOST_ALONE or (isinstance(outcome, Failed) and len(items) == 1):
            return []
        instead = [self._job_of([item]) for item in items]
        for each in instead:
            each.n_alone = n_alone
            if isinstance(outcome, Died):
                text = f"{job.note.run.name}: a process {outcome.how}; its pictures are drawn once more"
                each.note = each.note._replace(warnings=(text,))
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
        again = Job(self._draw, run, self._share(model.file, {}))
        again.note = note._replace(warnings=(*note.warnings, *model.warnings), files_read=model.files_read)
        again.n_alone = job.n_alone
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
        """Write the files of a picture; return its record."""
        if drawn.error is not None:
            return _failed(item.number, item.task, drawn.error, drawn.seconds, drawn.remarks)
        paths = tuple(drawn.contents)
        self._inputs.update((identity_of(path), path) for path in (*drawn.files_read, *note.files_read))
        while len(self._inputs) > _MAX_KNOWN:
            self._inputs.popitem(last=False)
        try:
            write_outputs(drawn.contents, self._inputs)
            if self._manifest is not None:
                files = item.task.named_files(drawn.options or item.options)
                said = _said_of(item.task, files) | (drawn.said or {})
                self._manifest.add(item.number, files, said, item.task.category)
        except OutputError as error:
            return _failed(item.number, item.task, error, drawn.seconds)
        return RenderRecord(
            item.number, paths[0], "drawn", drawn.seconds, None, drawn.stats, source_of(item.task),
            (*note.warnings, *drawn.warnings), paths, item.task.seed, drawn.remarks,
        )  # fmt: skip


def _said_of(task: RenderTask, files: dict[str, str]) -> dict[str, Any]:
    """What the manifest says of a task itself."""
    view: Any = dict(task.view) if isinstance(task.view, Mapping) else task.view
    scale = depth_scale(files, task.scale)
    return {"model": source_of(task), "seed": task.seed, "view": view, "depth_scale": scale}


def source_of(task: RenderTask) -> str | None:
    """The path of a task's model; None where that is no file."""
    return os.fspath(task.source) if isinstance(task.source, (str, os.PathLike)) else None


def _failed(
    index: int, task: RenderTask, error: Exception | None, seconds: float = 0.0, remarks: Any = None
) -> RenderRecord:
    """The record of a task that failed."""
    paths = task.output.values() if isinstance(task.output, Mapping) else [task.output]
    texts = tuple(dict.fromkeys(map(str, paths)))
    return RenderRecord(
        index, task.path, "failed", seconds, error, None, source_of(task), (), texts, task.seed, remarks
    )


def newest_beside(folder: str) -> int:
    """Return when the newest file in a folder, or below, was changed that no model is read from by itself: nanoseconds,
    as of `os.stat`; 0 where there is none."""
    newest = 0
    for place, _, names in os.walk(folder or "."):
        for name in names:
            entry = formats.find(os.path.splitext(name)[1])
            if entry is None or entry.is_scene:
                with suppress(OSError):
                    newest = max(newest, os.stat(os.path.join(place, name)).st_mtime_ns)
    return newest
