"""What a process does for a batch: it loads a model, and draws the pictures of a run, one after the other.

A run is some tasks of one model. Nothing is written here: the bytes of the files go back.
"""

import os
import pickle
from time import perf_counter
from typing import Any, NamedTuple

from ..errors import RasterizerError, SceneError, collected_warnings, error_of
from ..frame import Frame, Stats
from ..io.loader import SceneFile, read_source
from ..options import Options
from ..renderer import Renderer
from ..scene.camera import Camera
from ..scene.lights import random_lights
from ..scene.scene import Scene
from .annotations import Annotator, depth_said
from .tasks import RenderTask, is_random


class Run(NamedTuple):
    """Some pictures of one model."""

    name: str  # of the model, as messages call it
    path: str | None  # of its file; None where it is sent
    identity: tuple[int, int] | None  # of the file, as the caller sees it; None where nobody else is asked
    load: dict[str, Any]  # arguments of `load`
    tasks: tuple[tuple[RenderTask, Options], ...]  # what is drawn, without the model; options are complete
    is_annotated: bool = False  # whether a manifest is written


class Drawn(NamedTuple):
    """What became of a picture."""

    contents: dict[str, bytes]  # of its files, by their paths; none where it failed
    error: Exception | None
    seconds: float
    stats: Stats | None
    warnings: tuple[str, ...]
    files_read: tuple[str, ...]  # that the model named
    options: Options | None = None  # with those of a scene file
    said: dict[str, Any] | None = None  # for the manifest, see annotations.py
    remarks: Any = None  # of a command, see RenderRecord


class Model(NamedTuple):
    """A model that is loaded."""

    key: tuple
    file: SceneFile
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
    start, model, said, complete = perf_counter(), None, None, None
    try:
        model = load_model_of(run, shared, kept)
        complete = _options_of(run, task, options, model.file)
        frame = _render(model, task, complete, kept)
        contents = encode(frame, task, complete)
        if run.is_annotated:
            said = _annotate(model, complete, frame, kept) | depth_said(frame, task.scale)
        stats, error = frame.stats, None
    except Exception as fault:  # noqa: BLE001  whatever it is, one that fails does not stop the rest
        contents, stats, error = {}, None, plain_error(run.name, fault)
    of_model = ((), ()) if model is None else (model.warnings, model.files_read)
    return Drawn(contents, error, perf_counter() - start, stats, *of_model, complete, said)


def _options_of(run: Run, task: RenderTask, options: Options, file: SceneFile) -> Options:
    """Return the options of a picture, with those of a scene file that the task doesn't give."""
    try:
        return task.options_over(file.options) if file.options else options
    except SceneError as fault:  # of the file: those of the task are legal
        raise SceneError(f"{run.name}: options: {fault}") from fault


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
    with collected_warnings() as texts:
        source = shared if run.path is None else run.path
        try:
            file = read_source(source, **run.load, files_read=files_read)
        except RasterizerError as fault:  # of the model; what else goes wrong may go well the next time
            kept["fault"], kept["source"] = (key, fault.with_traceback(None)), shared
            raise
    kept["model"] = Model(key, file, tuple(texts), tuple(dict.fromkeys(files_read)))
    kept["source"] = shared  # another one may not get its id
    return kept["model"]


def drop(kept: dict[str, Any]) -> None:
    """Forget the model that was drawn before, and end its Renderer."""
    for name in {"renderer", "annotator"}.intersection(kept):
        kept[name].close()
    kept.clear()


def _render(model: Model, task: RenderTask, options: Options, kept: dict[str, Any]) -> Frame:
    """Draw a picture of a model, by the Renderer of the one before if options and appearance are the same; where the
    view is, too, the frame is that of the one before."""
    seed = task.seed if is_random(task.lights) else None
    appearance = options, pickle.dumps(task.appearance), pickle.dumps(task.lights), seed
    if kept.get("appearance") != appearance:
        file = model.file
        lights = {} if task.lights is None else {"lights": lights_of(file.scene, task)}
        before, of_before = kept.pop("renderer", None), kept.pop("appearance", None)
        if before is not None:
            before.close()
        is_changed = task.appearance or file.appearance is not None  # which may change lights
        if before is not None and of_before[:2] == appearance[:2] and not is_changed:
            kept["renderer"] = before.in_lights(lights.get("lights", file.scene.lights))
        else:
            kept["renderer"] = Renderer(file, options=options, **lights | task.appearance)
        kept["appearance"], kept["frame"] = appearance, (None, None)
    view = view_of(task)
    if kept["frame"][0] != view:
        kept["frame"] = view, kept["renderer"].render(**side_of(model.file.scene, task, options.size))
    return kept["frame"][1]


def _annotate(model: Model, options: Options, frame: Frame, kept: dict[str, Any]) -> dict[str, Any]:
    """Return what the manifest says of a picture."""
    if kept.get("annotated") != options:
        if "annotator" in kept:
            kept.pop("annotator").close()
        kept["annotator"], kept["annotated"] = Annotator(model.file.scene, options), options
    if kept.get("said", (None,))[0] is not frame:
        kept["said"] = frame, kept["annotator"].annotate(frame)
    return kept["said"][1]


def view_of(task: RenderTask) -> bytes:
    """Return what tells the view and appearance of a task from others of its model."""
    return pickle.dumps((task.view_words, task.view, task.appearance, task.lights, task.seed))


def lights_of(scene: Scene, task: RenderTask) -> Any:
    """Return the lights of a picture that has its own."""
    if is_random(task.lights):
        settings: dict[str, Any] = {"seed": task.seed, "up": scene.up}
        return random_lights(**settings | dict({} if isinstance(task.lights, str) else task.lights))
    return task.lights


def side_of(scene: Scene, task: RenderTask, size: tuple[int, int]) -> dict[str, Any]:
    """Return the words that say where a picture is taken from."""
    if not is_random(task.view):
        return task.view_words
    settings: dict[str, Any] = {"seed": task.seed, "size": size}
    given: Any = {} if isinstance(task.view, str) else task.view
    return task.view_words | {"camera": Camera.random(scene, **settings | dict(given))}


def encode(frame: Frame, task: RenderTask, options: Options) -> dict[str, bytes]:
    """Return the bytes of the files of a task by their paths, as `Frame.save` writes them."""
    found = {}
    for path, names in task.files(options).items():
        array: Any = names[0] if len(names) == 1 else names or None
        found[path] = frame.encode_file(os.path.splitext(path)[1], array, task.scale_in(path, names))
    return found
