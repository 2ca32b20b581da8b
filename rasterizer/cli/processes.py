"""Pictures of the command line as tasks of a batch: `raster batch`, and `raster render -j N`.

here                                      there
plan ─ a Shot for each view ─ Batch ────  load ─ Renderer ─ bytes, and what there is to say
what there is to say ─ exit code ───────  ┘
"""

from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter
from typing import Any

from ..batch.annotations import Annotator, depth_said
from ..batch.draw_run import Drawn, Run, identify, is_seen
from ..batch.pools import make_pool
from ..batch.rendering import Batch, Work
from ..batch.tasks import RenderSummary, RenderTask
from ..choices import RANDOM
from ..compiler.kernels import noticing_compilation
from ..errors import RasterizerError
from ..options import Options
from ..renderer import Renderer
from .messages import STDIO, Failures, Messages, Results, compilation_shown, failure_of
from .models import Loaded, load_scene
from .outputs import Target, by_view
from .request import seed_of


@dataclass(frozen=True)
class Shot(RenderTask):
    """Say which files show one view of a model; what they hold was checked with the arguments."""

    targets: tuple[Target, ...] = ()
    files_named: tuple[str, ...] = ()

    def files(self, options: Options) -> dict[str, tuple[str, ...]]:
        """Return the names of the arrays that each file holds, as those of any task."""
        return {target.output: target.arrays or () for target in self.targets}

    def check(self) -> Options:
        """Return the options."""
        return self.options


def can_use_processes(request) -> bool:
    """Tell whether other processes can draw: stdin and stdout are this one's."""
    return STDIO not in (*request.models, *(output for output, _ in request.files.asked))


def draw_in_processes(
    request, messages, plan, draw, executor=None, existing="replace", manifest=None
) -> tuple[list, RenderSummary]:
    """Draw the pictures of a plan, as `plan_targets` returns it, in processes of this machine or by an executor.

    `draw` is `render_view`; `executor` and `existing` are those of `render_many`, and `manifest` is a Manifest or None.

    Returns
    -------
    the failures, one error for each model that failed; and how many files were drawn, skipped or failed
    """
    request = replace(request, options=replace(request.options, threads=request.options.threads or 1))
    pool, shots = make_pool(executor, request.n_process), shots_of(request, plan)
    if not pool.is_warm:
        messages.notice("compiling kernels for the first time, which takes a while: raster warmup does it ahead")
    results = Results(messages, sum(map(len, plan)), is_told=not request.is_json)
    failures, summary = Failures(messages, request.is_json), RenderSummary()
    said_of: dict[str, dict[str, Exception]] = {shot.source: {} for shot in shots}  # by the model and the text
    draw = partial(draw_shots, draw, replace(request, models=(), views=()))  # a shot has its own of both
    with compilation_shown(messages), Batch(Work(iter(shots), pool, existing, manifest, draw)) as batch:
        try:
            for record in batch:
                shot, error = shots[record.index], record.error
                setattr(summary, record.status, getattr(summary, record.status) + len(shot.targets))
                messages.warn(*record.warnings)
                for target in shot.targets if record.status == "skipped" and request.is_json else ():
                    kept = {"model": target.model, "view": target.view, "output": target.output}
                    messages.record(kept | {"status": "skipped"})
                for name, what in record.remarks or ():
                    getattr(results if name == "tell" else messages, name)(*what)
                if error is not None and said_of[shot.source].setdefault(str(error), error) is error:
                    failures.tell(shot.source, error)
        except RasterizerError:
            if batch.summary.failed < len(shots):
                raise  # else each of them was said
    failures += [next(iter(errors.values())) for errors in said_of.values() if errors]
    summary.first_error = str(failures[0]) if failures else None
    return failures, summary


def shots_of(request, plan) -> list[Shot]:
    """Return the tasks of a plan, in its order."""
    reading = request.appearance.reading | {"camera": "file"}
    return [_shot_of(of_view, request, reading) for targets in plan for of_view in by_view(targets)]


def _shot_of(targets, request, reading) -> Shot:
    first = targets[0]
    view = first.view if seed_of(first.view) is None else RANDOM
    return Shot(
        first.model, first.output, view, options=request.options, load=reading, scale=request.files.scale,
        seed=first.seed, targets=tuple(targets), files_named=request.read,
    )  # fmt: skip


# ---------------------------------------------------------------- in each process


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
    """Keep what is to be written, and what is said of it."""

    def __init__(self, said):
        self.results, self._said, self.contents = self, said, {}

    def tell(self, *of_picture) -> None:
        """Keep that a picture is done; see `Results`."""
        self._said.append(("tell", of_picture))

    def write(self, contents) -> None:
        """Keep the contents of the files of a picture."""
        self.contents = contents


def draw_shots(draw, request, run: Run, shared, kept) -> list[Drawn] | None:
    """Draw the pictures of a run as `draw_run` does, by the request of a command."""
    if not is_seen(run):
        return None
    drawn, made = [], ()
    # The process that has sent the work has said that kernels are compiled.
    with noticing_compilation(lambda *_: None), ExitStack() as stack:
        for shot, _ in run.tasks:
            start, messages, error, said = perf_counter(), HeldMessages(request.level), None, None
            output, loaded = HeldOutput(messages.said), None
            with messages.shown_warnings():
                try:
                    loaded, files_read = _load(run, request, messages, shared, kept)
                    made = made or _make(loaded, run.is_annotated, stack)
                    frame = draw(shot.targets, made[0], loaded, request, messages, output, start)
                    if run.is_annotated:
                        said = made[1].annotate(frame) | depth_said(frame, shot.scale)
                except Exception as fault:  # noqa: BLE001  whatever it is, one that fails does not stop the rest
                    error = failure_of(run.name, request.options.size, fault)
                    messages.fault(error, fault)
                    error = error.with_traceback(None)
            of_model = ((), None) if loaded is None else (tuple(files_read), loaded.request.options)
            contents = {} if error else output.contents
            drawn.append(Drawn(contents, error, perf_counter() - start, None, (), *of_model, said, messages.said))
    return drawn


def _load(run, request, messages, shared, kept: dict[str, Any]) -> tuple[Loaded, list[str]]:
    """Load the model of a run, unless it is the one that was drawn before; return it, and the files that it named."""
    key = id(shared) if run.path is None else (run.path, identify(run.path))
    if kept.get("key") != key:
        kept.clear()
        kept["key"], kept["shared"], files_read = key, shared, []
        try:
            kept["loaded"] = load_scene(run.name, request, messages, files_read, shared), files_read
        except RasterizerError as fault:
            kept["fault"] = fault.with_traceback(None)
    if "fault" in kept:  # it isn't read once more for each of its pictures
        raise kept["fault"]
    return kept["loaded"]


def _make(loaded, is_annotated, stack) -> tuple:
    """Make what draws a model, and what says of its pictures what a manifest holds, if there is one."""
    renderer = stack.enter_context(Renderer(loaded.scene, options=loaded.request.options))
    if not is_annotated:
        return renderer, None
    return renderer, stack.enter_context(closing(Annotator(loaded.scene, loaded.request.options)))
