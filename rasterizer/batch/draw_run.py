"""What a process does for a batch: it loads a model, and draws the pictures of a run, one after the other.

A run is some tasks of one model. Nothing is written here: the bytes of the files go back.
"""

import os
import pickle
import warnings
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from ..errors import RasterizerError, error_of
from ..frame import Frame, Stats
from ..io.loader import load
from ..options import Options
from ..renderer import Renderer
from ..scene.scene import Scene
from .tasks import RenderTask


class Run(NamedTuple):
    """Some pictures of one model."""

    name: str  # of the model, as messages call it
    path: str | None  # of its file; None where it is sent
    identity: tuple[int, int] | None  # of the file, as the caller sees it; None where nobody else is asked
    load: dict[str, Any]  # arguments of `load`
    tasks: tuple[tuple[RenderTask, Options], ...]  # what is drawn, without the model; options are complete


class Drawn(NamedTuple):
    """What became of a picture."""

    content: bytes | None  # of its file; None where it failed
    error: Exception | None
    seconds: float
    stats: Stats | None
    warnings: tuple[str, ...]
    files_read: tuple[str, ...]  # that the model named


class Model(NamedTuple):
    """A model that is loaded."""

    key: tuple
    scene: Scene
    warnings: tuple[str, ...]
    files_read: tuple[str, ...]


def draw_run(run: Run, shared: Any, kept: dict[str, Any]) -> list[Drawn] | None:
    """Draw the pictures of a run; return them, or None where this process doesn't see the file of the model.

    Parameters
    ----------
    shared : what is loaded where the run has no path
    kept : the model, the Renderer and the frame of the run before; changed
    """
    if not is_seen(run):
        return None
    return [_draw(run, *each, shared, kept) for each in run.tasks]


def is_seen(run: Run) -> bool:
    """Tell whether this process sees the file of a run's model as the caller does, where that was asked for."""
    return run.path is None or run.identity is None or identify(run.path) == run.identity


def identify(path: str) -> tuple[int, int] | None:
    """Return the length of a file and its time of change, ns; None where there is none."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_size, status.st_mtime_ns


def _draw(run: Run, task: RenderTask, options: Options, shared: Any, kept: dict[str, Any]) -> Drawn:
    """Draw one picture; whatever goes wrong becomes its error."""
    start, model = perf_counter(), None
    try:
        model = load_model_of(run, shared, kept)
        frame = _render(model, task, options, kept)
        content = encode(frame, task, options)
        stats, error = frame.stats, None
    except Exception as fault:  # noqa: BLE001  whatever it is, one that fails does not stop the rest
        content, stats, error = None, None, plain_error(run.name, fault)
    of_model = ((), ()) if model is None else (model.warnings, model.files_read)
    return Drawn(content, error, perf_counter() - start, stats, *of_model)


def plain_error(name: str, fault: Exception) -> RasterizerError:
    """Return what is said of a fault, without its traceback: that would hold on to what was being drawn."""
    return error_of(name, fault).with_traceback(None)


def load_model_of(run: Run, shared: Any, kept: dict[str, Any]) -> Model:
    """Load the model of a run, unless it is the one that was drawn before."""
    whose = id(shared) if run.path is None else (run.path, identify(run.path))
    key = (whose, pickle.dumps(run.load))
    if "model" in kept and kept["model"].key == key:
        return kept["model"]
    if "fault" in kept and kept["fault"][0] == key:  # it isn't read once more for each of its pictures
        raise kept["fault"][1]
    drop(kept)
    files_read: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        source = shared if run.path is None else run.path
        try:
            loaded = load(source, **run.load, files_read=files_read)
        except RasterizerError as fault:  # of the model; what else goes wrong may go well the next time
            kept["fault"], kept["source"] = (key, fault.with_traceback(None)), shared
            raise
    texts = dict.fromkeys(str(each.message) for each in caught if issubclass(each.category, UserWarning))
    kept["model"] = Model(key, loaded, tuple(texts), tuple(dict.fromkeys(files_read)))
    kept["source"] = shared  # another one may not get its id
    return kept["model"]


def drop(kept: dict[str, Any]) -> None:
    """Forget the model that was drawn before, and end its Renderer."""
    if "renderer" in kept:
        kept["renderer"].close()
    kept.clear()


def _render(model: Model, task: RenderTask, options: Options, kept: dict[str, Any]) -> Frame:
    """Draw a picture of a model, by the Renderer of the one before if the options are the same; where the view is, too,
    the frame is that of the one before."""
    view, look = view_of(task), pickle.dumps(task.look)
    if "renderer" not in kept or (kept["renderer"].options, kept["look"]) != (options, look):
        if "renderer" in kept:
            kept.pop("renderer").close()
        kept["renderer"], kept["frame"] = Renderer(model.scene, options=options, **task.look), (None, None)
        kept["look"] = look
    if kept["frame"][0] != view:
        kept["frame"] = view, kept["renderer"].render(**task.side)
    return kept["frame"][1]


def view_of(task: RenderTask) -> bytes:
    """Return what tells the view of a task from others of its model."""
    return pickle.dumps((task.side, task.look))


def encode(frame: Frame, task: RenderTask, options: Options) -> bytes:
    """Return a picture, or one of its arrays, as the bytes of its file; as `Frame.save` writes it."""
    if task.is_array:
        return frame.encode_array(task.array or options.outputs[0])
    return frame.encode(Path(task.output).suffix.lower())
