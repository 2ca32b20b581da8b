"""Models drawn in other processes: `raster batch`, and `raster render -j N`.

    here                                            there
    plan ─ jobs ──────────────────────────────────  load ─ Renderer ─ bytes, and what there is to say
    files ─ what there is to say ─ exit code  ────  ┘

What writes files, and what is said, is here, as where one process draws: never in place of what the run reads, one line
a message.
"""

import os
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

from ..batch.draw_run import identify
from ..batch.pools import (
    DaskPool,
    Died,
    Done,
    Job,
    LocalPool,
    Pool,
    SharedObject,
    died_once,
    make_error,
    pictures_per_job,
    replace_job,
    work_through,
)
from ..batch.tasks import RenderSummary
from ..compiler.kernels import noticing_compilation
from ..errors import RasterizerError
from .drawing import Settings
from .messages import STDIO, Failures, Messages, Results, compilation_shown
from .models import load_scene
from .outputs import Outputs, Target, by_view


class ModelWork(NamedTuple):
    """What is sent for some pictures of a model."""

    draw: Callable  # see `draw_in_processes`
    targets: list[Target]
    arguments: Any
    settings: Settings
    identity: tuple[int, int] | None  # of the model's file, as it is here; None where it isn't compared


class ModelDone(NamedTuple):
    """What comes back."""

    notes: dict[str | None, tuple]  # of each view what the manifest says of it, and the outputs of its frame
    contents: list[dict[str, bytes]]  # of the files of each picture, by their names
    said: list[tuple[str, tuple]]  # methods of Messages, or of Results, and what they are called with
    failures: list[RasterizerError]
    files_read: list[str]


class HeldMessages(Messages):
    """Keep what is said; it is said elsewhere."""

    def __init__(self, level):
        super().__init__(level)
        self.said = []

    def say(self, text) -> None:
        """Keep a line that the level lets through."""
        self.said.append(("say", (str(text),)))

    def record(self, record, is_stdout_taken) -> None:
        """Keep a line of JSON."""
        self.said.append(("record", (record, is_stdout_taken)))

    def traceback(self, error) -> None:
        """Keep where a fault happened: a traceback can't be sent."""
        import traceback

        for line in "".join(traceback.format_exception(error)).splitlines():
            self.detail(line)


class HeldOutput:
    """Keep what is to be written, and what is told of it."""

    def __init__(self, said):
        self.results, self._said = self, said
        self.contents, self.files_read, self.notes = [], [], {}

    def tell(self, *of_picture) -> None:
        """Keep that a picture is done; see `Results`."""
        self._said.append(("tell", of_picture))

    def write(self, contents) -> None:
        """Keep the contents of the files of a picture."""
        self.contents.append(contents)


def draw_job(work: ModelWork, loaded, kept) -> ModelDone | None:
    """Draw pictures of a model; return them, or None where this process doesn't see the model's file.

    `kept` holds the model of the job before, which is changed; other pictures of it are drawn without reading it again.
    """
    model = work.targets[0].model
    identity = identify(model)
    if loaded is None and work.identity is not None and identity != work.identity:
        return None
    messages = HeldMessages(work.arguments.level)
    output = HeldOutput(messages.said)
    failures = Failures(messages, work.arguments.json)
    nothing_said = noticing_compilation(lambda *_: None)  # who has sent the work has told that kernels are compiled
    with nothing_said, messages.shown_warnings(), failures.caught(model, work.arguments.size):
        if loaded is None and kept.get("key") != (model, identity):
            kept.clear()
            kept["loaded"] = load_scene(model, work.arguments, work.settings, messages, output.files_read)
            kept["key"] = model, identity
        loaded = loaded or kept["loaded"]
        work.draw(work.targets, work.arguments, work.settings, messages, output, loaded)
    plain = [failure.with_traceback(None) for failure in failures]
    return ModelDone(output.notes, output.contents, messages.said, plain, output.files_read)


def can_use_processes(arguments) -> bool:
    """Tell whether other processes can draw: stdin and stdout are this one's."""
    return STDIO not in (*arguments.models, arguments.output, *(output for output, _ in arguments.files))


def draw_in_processes(
    arguments, settings, messages, plan, draw, executor=None, note=None
) -> tuple[list, int, RenderSummary]:
    """Draw the pictures of a plan, as `plan_targets` returns it, in processes of this machine or by an executor.

    `draw` is `render_model`, or another function of a module that is called as that. `note` is called with the targets
    of each view that is written, what the manifest says of it, and the outputs of its frame; None = there is no
    manifest.

    Returns
    -------
    the failures, one error for each model that failed; the number of models; and what was done
    """
    threads = settings.options.threads or 1
    settings = settings._replace(options=replace(settings.options, threads=threads))
    pool = LocalPool(arguments.n_process) if executor is None else DaskPool(executor, arguments.n_process)
    if not pool.is_warm:
        messages.notice("compiling kernels for the first time, which takes a while: raster warmup does it ahead")
    results = Results(messages, sum(map(len, plan)), is_told=not arguments.json)
    with compilation_shown(messages):
        try:
            work = _Work(arguments, settings, messages, pool, plan, (draw, note), results)
            return work.run() if plan else ([], 0, RenderSummary())
        finally:
            pool.close()


class _Work:
    """The pictures of a plan on their way to a pool of processes and back."""

    def __init__(self, arguments, settings, messages, pool: Pool, plan, draw, results):
        self._arguments, self._settings, self._messages = arguments, settings, messages
        self._pool, self._plan, (self._draw, self._note), self._results = pool, plan, draw, results
        self._failed = {}  # the first error of each model that failed, by its number
        self._summary = RenderSummary()

    def run(self) -> tuple[list, int, RenderSummary]:
        """Draw everything; return what `draw_in_processes` does."""
        outputs = Outputs(self._plan)
        for job, outcome in work_through(self._pool, self._jobs(), self._follow_up):
            self._settle(job, outcome, outputs)
        failures = [self._failed[number] for number in sorted(self._failed)]
        self._summary.first_error = str(failures[0]) if failures else None
        return failures, len(self._plan), self._summary

    def _jobs(self):
        """Yield the views of each model, in several jobs where there are fewer models than processes."""
        views = [by_view(targets) for targets in self._plan]
        longest = pictures_per_job(self._pool, sum(map(len, views)))
        for number, of_model in enumerate(views):
            for first in range(0, len(of_model), longest):
                yield self._job(number, [target for view in of_model[first : first + longest] for target in view])

    def _job(self, number, targets) -> Job:
        identity = None
        if not self._pool.is_here:
            targets = [target._replace(model=os.path.abspath(target.model)) for target in targets]
            identity = identify(targets[0].model)
        job = Job(draw_job, ModelWork(self._draw, targets, self._arguments, self._settings, identity))
        job.note = number
        return job

    def _follow_up(self, job, outcome) -> list[Job]:
        def divide(job) -> list[Job]:
            return [self._job(job.note, view) for view in by_view(job.argument.targets)]

        instead = replace_job(job, outcome, divide, self._send_model)
        if instead and isinstance(outcome, Died):
            self._messages.warn(f"{job.argument.targets[0].model}: {died_once(outcome)}")
        return instead

    def _send_model(self, job) -> list[Job]:
        """Load a model that the machine that should draw it doesn't see; return the job that has it, if any."""
        model, found = job.argument.targets[0].model, []
        failures = Failures(self._messages, self._arguments.json)
        with failures.caught(model):
            loaded = load_scene(model, self._arguments, self._settings, self._messages, found)
            again = Job(draw_job, job.argument, SharedObject(loaded))
            again.note = job.note
            return [again]
        self._note_failures(job, failures)
        return []

    def _settle(self, job, outcome, outputs) -> None:
        """Write what was drawn, and say what there is to say."""
        model = job.argument.targets[0].model
        failures = Failures(self._messages, self._arguments.json)
        written: list[str] = []
        if isinstance(outcome, Done) and outcome.value is not None:
            done: ModelDone = outcome.value
            outputs.files_read += done.files_read
            for contents in done.contents:
                with failures.caught(model):
                    outputs.write(contents)
                    written += contents
            for targets in by_view(job.argument.targets) if self._note else ():
                if {target.output for target in targets}.issubset(written):
                    self._note(targets, *done.notes[targets[0].view])
            for name, what in done.said:
                getattr(self._results if name == "tell" else self._messages, name)(*what)
            failures += done.failures
        elif not isinstance(outcome, Done):
            with failures.caught(model):
                raise make_error(model, outcome)
        self._summary.drawn += len(written)
        self._summary.failed += len(job.argument.targets) - len(written)
        self._note_failures(job, failures)

    def _note_failures(self, job, failures) -> None:
        for failure in failures:
            self._failed.setdefault(job.note, failure)
