"""`raster render`: one model after another is loaded, drawn and written; a failure doesn't stop the rest."""

import math
from dataclasses import fields
from pathlib import Path
from time import perf_counter

from ..errors import SceneError
from ..io.formats import picture_format
from ..options import Options
from ..renderer import Renderer
from .arrays import check_scale, encode_arrays, expand_arrays, holds_arrays
from .cameras_lights import camera_of, check_camera
from .failures import Failures
from .load_scene import load_scene, make_settings, with_options
from .messages import compilation_shown, print_text
from .preview import preview
from .results import Results
from .targets import STDIO, plan_targets, without_existing
from .warnings import find_doubts
from .write_targets import Outputs

_ENCODING = {"JPEG": {"quality": 92}}


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
    check_options(arguments)
    if arguments.preview:
        if holds_arrays(arguments):
            raise SceneError("--preview shows pictures; an array is asked for")
        arguments.always_writes = False
    if arguments.n_process is not None:
        from .processes import draw_models_apart, may_be_drawn_apart

        if may_be_drawn_apart(arguments):
            plan, n_model = _plan(arguments, messages)
            return draw_models_apart(arguments, messages, plan, render_model)[0], n_model
    return draw_models(arguments, messages, render_model)


def draw_models(arguments, messages, draw, check_output=None, plan=None) -> tuple[list, int]:
    """Hand every model to `draw`, which is called with its targets, the arguments, the Settings and the messages;
    `check_output` is that of `plan_targets`, `plan` what that returns, if it has been called.

    Returns and raises what `render_models` does.
    """
    settings = make_settings(arguments)
    check_camera(arguments)
    plan, n_model = _plan(arguments, messages, check_output) if plan is None else (plan, len(plan))
    failures = Failures(messages, arguments.json)
    results = Results(messages, sum(map(len, plan)), is_told=not arguments.json)
    with compilation_shown(messages), results, Outputs(plan, arguments) as outputs:
        for number, targets in enumerate(plan):
            with failures.caught(targets[0].model, arguments.size, targets[0].output == STDIO):
                draw(targets, arguments, settings, messages, outputs.of_model(number, results))
        failures += outputs.finish(messages)
    return failures, n_model


def _plan(arguments, messages, check_output=None) -> tuple[list, int]:
    """List the outputs of each model, without those that are left out; and how many models there are."""
    plan = plan_targets(arguments, check_output)
    n_model = len(plan)
    if getattr(arguments, "skip_existing", False):
        plan, n_left_out = without_existing(plan)
        messages.notice(f"{n_left_out} of {n_left_out + sum(map(len, plan))} outputs are there already")
    return plan, n_model


def check_options(arguments) -> None:
    """Raise SceneError for what is not legal, before a model is loaded."""
    make_options(arguments)
    check_scale(arguments)


def make_options(arguments) -> Options:
    """The options of the pictures: every field of `Options` is a flag."""
    values = {field.name: getattr(arguments, field.name) for field in fields(Options)}
    values["outputs"] = expand_arrays(values["outputs"])
    if values["outputs"] is None:
        values["outputs"] = "color" if holds_arrays(arguments) else "rgb"
    return Options(**values)


def render_model(targets, arguments, settings, messages, output, loaded=None) -> None:
    """Draw all views of one model; `loaded` is the model, Loaded, where it has been loaded before."""
    start = perf_counter()
    loaded = loaded or load_scene(targets[0].model, arguments, settings, messages, output.files_read)
    scene = loaded.scene
    arguments = with_options(arguments, loaded.options, _names_of_file(arguments), targets[0].model)
    options = make_options(arguments)
    with Renderer(scene, **_as_keywords(options)) as renderer:
        for target in targets:
            camera = camera_of(arguments, target.view, scene, loaded.framing, renderer.subject)
            frame = renderer.render(camera)
            is_black = frame.has("rgb") and not frame.rgb.any()
            doubts = find_doubts(frame.stats, is_black, scene, arguments, camera)
            doubts = [f"{target.model}: {text}" for text in doubts]
            for text in doubts:
                messages.warn(text)
            n_byte = None
            if target.output is not None:
                content = _content(frame, target.output, options, arguments)
                output.write(content, target.output)
                n_byte = len(content)
            seconds, start = perf_counter() - start, perf_counter()
            output.results.tell(target.output, frame.size, n_byte, seconds)
            if getattr(arguments, "preview", False):
                print_text(preview(frame.rgba), target.output == STDIO)
            messages.detail(f"{target.model}: {target.output}, {frame!r}, {seconds:.2f} s in all")
            messages.detail(f"{target.model}: {describe_bounds(frame.stats)}")
            messages.detail(f"{target.model}: {'; '.join(repr(frame.stats.plan).splitlines())}")
            if arguments.json:
                record = _record(target, frame, scene, seconds, loaded.warnings + doubts)
                messages.record(record, target.output == STDIO)


def _names_of_file(arguments) -> set[str]:
    """The options that a scene file may set; what is written is known before it is read, but for which arrays a file of
    arrays holds."""
    names = {field.name for field in fields(Options)}
    return names if holds_arrays(arguments) else names - {"outputs"}


def _as_keywords(options) -> dict:
    return {field.name: getattr(options, field.name) for field in fields(options)}


def describe_bounds(stats) -> str:
    """Say in a line how far a picture may be off, and what that leaves out; `stats` and --json say where and why."""
    bounds, words, apart = stats.error_bounds, [], [step[0] for step in stats.steps]
    if stats.error_bound is None:
        words, apart = [cause for cause in apart if cause.startswith("no bound is stated")], []
    elif bounds.rgb is not None:
        words = [f"errors are at most {stats.error_bound:.2g} in linear intensity"]
        words.append(f"{bounds.rgb} level{'' if bounds.rgb == 1 else 's'} of 8 bits")
    if bounds.depth is not None:
        share = f" ({bounds.depth_share:.2g} of itself)" if math.isfinite(bounds.depth_share) else ""
        words.append(f"{bounds.depth:.2g} scene units of depth{share}")
    words += [] if bounds.normal is None else [f"{bounds.normal:.2g} a component of normals"]
    words += [] if bounds.face is None else ["faces exact"]
    apart += ["texture filters"] if bounds.filters else []
    more = f", and {len(apart) - 1} more" if len(apart) > 1 else ""
    return ", ".join(words) + (f"; not counted: {apart[0]}{more}" if apart else "")


def _content(frame, output, options, arguments) -> bytes:
    """A picture, or the arrays asked for, as the bytes of its file."""
    if holds_arrays(arguments):
        return encode_arrays(frame, output, options.outputs, arguments.scale)
    return encode_picture(frame, output)


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
        "error_bounds": frame.stats.error_bounds.as_json(),
        "warnings": doubts,
    }
