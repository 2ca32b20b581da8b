"""`raster render`: one model after another is loaded, drawn and written; a failure doesn't stop the rest."""

import os
from dataclasses import fields
from pathlib import Path
from time import perf_counter

from ..errors import RasterizerError, SceneError, internal_error
from ..frame import Frame, picture_format
from ..options import Options
from ..renderer import Renderer
from .cameras_lights import camera_of, check_camera
from .defaults import PICTURE_SAMPLES
from .load_scene import load_scene, make_settings, with_options
from .messages import compilation_shown, print_record
from .targets import STDIO, plan_targets
from .warnings import find_doubts
from .write_targets import Outputs

_ENCODING = {"JPEG": {"quality": 92}}
_IN_MEMORY = 2**28  # bytes of a picture's file; one that is larger is written while it is drawn, if its format lets it
_LONG = 2**32  # bytes of a file that takes so long that it is told before


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


def draw_models(arguments, messages, draw, check_suffix=None) -> tuple[list, int]:
    """Hand every model to `draw`, which is called with its targets, the arguments, the Settings and the messages;
    `check_suffix` is that of `plan_targets`.

    Returns and raises what `render_models` does.
    """
    settings = make_settings(arguments)
    check_camera(arguments)
    plan = plan_targets(arguments, check_suffix)
    failures = []
    with compilation_shown(messages), Outputs(plan, arguments) as outputs:
        for number, targets in enumerate(plan):
            try:
                draw(targets, arguments, settings, messages, outputs.of_model(number))
            except BrokenPipeError:
                raise
            except Exception as error:  # noqa: BLE001  one model that fails does not stop the rest
                failures.append(_failure(error, targets[0], arguments, messages))
                messages.error(failures[-1])
                if getattr(failures[-1], "is_internal", False):
                    messages.traceback(error.__cause__ if failures[-1] is error and error.__cause__ else error)
                if arguments.json:
                    record = {"path": targets[0].model, "error": str(failures[-1])}
                    print_record(record, targets[0].output == STDIO)
        failures += outputs.finish(messages)
    return failures, len(plan)


def _failure(error, target, arguments, messages) -> RasterizerError:
    """What is said of a model that failed; a fault of the program's own is told as such."""
    if isinstance(error, RasterizerError):
        return error
    if isinstance(error, MemoryError):
        return SceneError(f"not enough memory for {target.model} at {arguments.size}: {error}")
    return internal_error(target.model, error)


def make_options(arguments) -> Options:
    """The options of the pictures: every field of `Options` is a flag."""
    values = {field.name: getattr(arguments, field.name) for field in fields(Options)}
    is_picture = values["outputs"] is None and not _is_npy(arguments)
    if values["samples"] is None:
        values["samples"] = PICTURE_SAMPLES if is_picture else Options.samples
    if values["outputs"] is None:
        values["outputs"] = "rgb" if is_picture else "color"
    return Options(**values)


def _render_model(targets, arguments, settings, messages, output) -> None:
    """Draw all views of one model."""
    start = perf_counter()
    scene, of_model, own_options, framing = load_scene(
        targets[0].model, arguments, settings, messages, output.files_read
    )
    arguments = with_options(arguments, own_options, _names_of_file(arguments), targets[0].model)
    options = make_options(arguments)
    with Renderer(scene, **_as_keywords(options)) as renderer:
        for target in targets:
            camera = camera_of(arguments, target.view, scene, framing)
            file = _row_file(target.output, options)
            if file is not None and file.n_byte > _LONG:
                messages.notice(
                    f"{target.model}: drawing {file.n_byte / 1e9:.3g} GB into {target.output}, which takes a while"
                )
            frame, is_black, is_written = _draw(renderer, camera, file, output)
            doubts = find_doubts(frame.stats, is_black, scene, arguments, camera)
            doubts = [f"{target.model}: {text}" for text in doubts]
            for text in doubts:
                messages.warn(text)
            if not is_written:
                output.write(_content(frame, target.output, options.outputs[0]), target.output)
            seconds, start = perf_counter() - start, perf_counter()
            messages.detail(f"{target.model}: {target.output}, {frame!r}, {seconds:.2f} s in all")
            messages.detail(f"{target.model}: {describe_bound(frame.stats)}")
            messages.detail(f"{target.model}: {'; '.join(repr(frame.stats.plan).splitlines())}")
            if arguments.json:
                record = _record(target, frame, scene, seconds, of_model + doubts)
                print_record(record, target.output == STDIO)


def _draw(renderer, camera, file, output) -> tuple[Frame, bool, bool]:
    """Draw a picture, into its file at once where that is a RowFile.

    Returns
    -------
    the frame, which has no arrays where the file is written; whether the picture is black; whether the file is written
    """
    if file is None:
        frame = renderer.render(camera)
        return frame, frame.has("rgb") and not frame.rgb.any(), False
    stats = output.draw(lambda file: renderer.render_rows(file, camera), file)
    return Frame(None, {}, stats, file.size), file.is_black, True


def _row_file(output, options):
    """Return the RowFile that a large picture is drawn into, band by band; None where it is drawn in memory."""
    format = Path(output).suffix.lower().lstrip(".")
    is_place = output != STDIO and (os.path.isfile(output) or not os.path.exists(output))
    if format not in ("npy", "tif", "tiff") or not is_place:
        return None
    from ..io.row_files import RowFile, row_format_of

    kind = row_format_of(format, options.outputs[0] if format == "npy" else None)
    file = None if kind is None else RowFile(output, kind, options.size)
    return None if file is None or file.n_byte <= _IN_MEMORY else file


def _is_npy(arguments) -> bool:
    return str(arguments.output).lower().endswith(".npy")


def _names_of_file(arguments) -> set[str]:
    """The options that a scene file may set; what is written is known before it is read, but for which array a .npy
    holds."""
    names = {field.name for field in fields(Options)}
    return names if _is_npy(arguments) else names - {"outputs"}


def _as_keywords(options) -> dict:
    return {field.name: getattr(options, field.name) for field in fields(options)}


def describe_bound(stats) -> str:
    """Say how far a picture may be off, and next to what it may be further off."""
    steps = "".join(
        f"; without bound next to a step: {cause} (within {near:.1g}, {unit})" for cause, near, unit in stats.steps
    )
    return f"errors are at most {stats.error_bound:.2g} in linear intensity{steps}"


def _content(frame, output, array) -> bytes:
    """A picture, or the array asked for, as the bytes of its file."""
    is_array = array != "rgb" or output.lower().endswith(".npy")
    return frame.encode_array(array) if is_array else encode_picture(frame, output)


def encode_picture(frame, output) -> bytes:
    """A picture, in the format of its output's suffix; PNG for stdout."""
    name = "PNG" if output == STDIO else picture_format(Path(output).suffix)
    return frame.encode(name, **_ENCODING.get(name, {}))


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
