"""`raster render`: one model after another is loaded, drawn and written; a failure doesn't stop the rest."""

from dataclasses import fields
from pathlib import Path
from time import perf_counter

from ..errors import ModelError, OutputError, SceneError
from ..frame import picture_format, write_whole
from ..options import Options
from ..renderer import Renderer
from .arguments import PICTURE_SAMPLES
from .loading import load_scene, make_settings, with_options
from .messages import compiling_announced, print_record, write_stdout
from .outputs import STDIO, plan_targets
from .view import camera_of, check_camera, is_camera_given

# Level 1 takes half the time of Pillow's 6, which is longer than that of the drawing; files grow by a third.
_ENCODING = {"PNG": {"compress_level": 1}, "JPEG": {"quality": 92}}


def render_models(arguments, messages) -> tuple[list, int]:
    """Draw every model.

    Parameters
    ----------
    arguments : those of the command, as `parse` returns them
    messages : Messages

    Returns
    -------
    the failures, one error for each model that failed; and the number of models

    Raises
    ------
    SceneError : an argument that is wrong for every model
    OutputError : the folder of an output doesn't exist
    """
    make_options(arguments)  # what is not legal is told before a model is loaded
    return draw_models(arguments, messages, _render_model)


def draw_models(arguments, messages, draw) -> tuple[list, int]:
    """Hand every model to `draw`, which is called with its targets, the arguments, the Settings and the messages.

    Returns and raises what `render_models` does.
    """
    settings = make_settings(arguments)
    check_camera(arguments)
    plan = plan_targets(arguments)
    failures = []
    with compiling_announced(messages):
        for targets in plan:
            try:
                draw(targets, arguments, settings, messages)
            except (ModelError, OutputError, SceneError, MemoryError) as error:
                if isinstance(error, MemoryError):
                    error = SceneError(
                        f"not enough memory for {targets[0].model} at {arguments.size}: {error}"
                    )
                messages.error(error)
                failures.append(error)
                if arguments.json:
                    record = {"path": targets[0].model, "error": str(error)}
                    print_record(record, targets[0].output == STDIO)
    return failures, len(plan)


def make_options(arguments) -> Options:
    """The options of the pictures: every field of `Options` is a flag."""
    values = {field.name: getattr(arguments, field.name) for field in fields(Options)}
    is_picture = values["outputs"] is None and not _is_npy(arguments)
    if values["samples"] is None:
        values["samples"] = PICTURE_SAMPLES if is_picture else Options.samples
    if values["outputs"] is None:
        values["outputs"] = "rgb" if is_picture else "color"
    return Options(**values)


def _render_model(targets, arguments, settings, messages) -> None:
    """Draw all views of one model."""
    start = perf_counter()
    scene, of_model, own_options, framing = load_scene(targets[0].model, arguments, settings, messages)
    arguments = with_options(arguments, own_options, _names_of_file(arguments), targets[0].model)
    options = make_options(arguments)
    with Renderer(scene, **_as_keywords(options)) as renderer:
        for target in targets:
            camera = camera_of(arguments, target.view, scene, framing)
            frame = renderer.render(camera)
            doubts = [f"{target.model}: {text}" for text in find_doubts(frame, scene, arguments)]
            for text in doubts:
                messages.warn(text)
            _write(frame, target.output, options.outputs[0])
            seconds, start = perf_counter() - start, perf_counter()
            messages.detail(f"{target.model}: {target.output}, {frame!r}, {seconds:.2f} s in all")
            messages.detail(f"{target.model}: {describe_bound(frame.stats)}")
            if arguments.json:
                record = _record(target, frame, scene, seconds, of_model + doubts)
                print_record(record, target.output == STDIO)


def _is_npy(arguments) -> bool:
    return str(arguments.output).lower().endswith(".npy")


def _names_of_file(arguments) -> set[str]:
    """The options that a scene file may set; what is written is known before it is read, but for which array a .npy holds."""
    names = {field.name for field in fields(Options)}
    return names if _is_npy(arguments) else names - {"outputs"}


def _as_keywords(options) -> dict:
    return {field.name: getattr(options, field.name) for field in fields(options)}


def find_doubts(frame, scene, arguments) -> list[str]:
    """Say what looks like a mistake in a picture, and what to try."""
    if frame.stats.coverage == 0.0:
        if frame.stats.faces == frame.stats.culled:
            return ["the picture is empty: all faces are seen from behind; try --cull none"]
        if arguments.eye is not None:
            low, high = ("(" + ", ".join(f"{value:g}" for value in corner) + ")" for corner in scene.bounds)
            hint = (
                f"the model reaches from {low} to {high}; try another --eye or --target, or leave --eye out"
            )
        elif scene.camera is not None and not is_camera_given(arguments):
            hint = "the camera of the file sees nothing of it; try --view iso"
        elif arguments.zoom > 1.0:
            hint = "try a smaller --zoom"
        else:
            hint = "the model covers no sample; try a larger --size, more --samples or another --view"
        return [f"the picture is empty: {hint}"]
    if frame.has("rgb") and scene.background is None and not frame.rgb.any():
        return ["the picture is black: no light reaches what is seen; try --preset headlight"]
    return []


def describe_bound(stats) -> str:
    """Say how far a picture may be off, and next to what it may be further off."""
    steps = "".join(f"; without bound next to a step: {cause} (within {near:.1g}, {unit})" for cause, near, unit in stats.steps)
    return f"errors are at most {stats.error_bound:.2g} in linear intensity{steps}"


def _write(frame, output, array) -> None:
    """Write a picture, or the array asked for, to a file or to stdout."""
    is_array = array != "rgb" or output.lower().endswith(".npy")
    write_content(frame.encode_array(array) if is_array else encode_picture(frame, output), output)


def encode_picture(frame, output) -> bytes:
    """A picture, in the format of its output's suffix; PNG for stdout."""
    name = "PNG" if output == STDIO else picture_format(Path(output).suffix)
    return frame.encode(name, **_ENCODING.get(name, {}))


def write_content(content, output) -> None:
    """Write bytes to a file, which appears whole or not at all, or to stdout."""
    if output == STDIO:
        write_stdout(content)
    else:
        write_whole(output, content)


def _record(target, frame, scene, seconds, doubts) -> dict:
    """What --json says of a picture."""
    return {
        "path": target.model,
        "view": target.view,
        "output": target.output,
        "size": list(frame.size),
        "faces": scene.n_face,
        "coverage": frame.stats.coverage,
        "seconds": round(seconds, 4),
        "error_bound": frame.stats.error_bound,
        "warnings": doubts,
    }
