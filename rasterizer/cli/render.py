"""`raster render`: one model after another is loaded, drawn and written; a failure doesn't stop the rest."""

import sys
import warnings
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from time import perf_counter

from ..errors import ModelError, OutputError, SceneError
from ..frame import picture_format, write_whole
from ..options import Options
from ..renderer import Renderer
from ..scene.color import linear_rgb
from ..scene.load import load
from ..scene.scene import Scene
from .arguments import PICTURE_SAMPLES
from .messages import compiling_announced, print_record, write_stdout
from .outputs import STDIO, plan_targets
from .view import check_camera, make_camera, make_lights

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
    return draw_models(arguments, messages, partial(_render_model, options=make_options(arguments)))


def draw_models(arguments, messages, draw) -> tuple[list, int]:
    """Hand every model to `draw`, which is called with its targets, the arguments, the settings of `load` and the messages.

    Returns and raises what `render_models` does.
    """
    settings = {
        "lights": make_lights(arguments),
        "background": None
        if arguments.background == "transparent"
        else linear_rgb(arguments.background, "--background"),
        "up": None if arguments.up == "auto" else arguments.up,
        "crease_angle": _checked_angle(arguments.crease_angle),
        "drop_bad_faces": arguments.drop_bad_faces,
    }
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
    is_picture = values["outputs"] is None and not str(arguments.output).lower().endswith(".npy")
    if values["samples"] is None:
        values["samples"] = PICTURE_SAMPLES if is_picture else Options.samples
    if values["outputs"] is None:
        values["outputs"] = "rgb" if is_picture else "color"
    return Options(**values)


def _checked_angle(angle):
    if angle is not None and not 0.0 <= angle <= 180.0:
        raise SceneError(f"--crease-angle must be within 0..180 degrees; given {angle:g}")
    return angle


def _render_model(targets, arguments, settings, messages, options) -> None:
    """Draw all views of one model."""
    start = perf_counter()
    scene, of_model = load_scene(targets[0].model, arguments, settings, messages)
    with Renderer(scene, **_as_keywords(options)) as renderer:
        for target in targets:
            camera = make_camera(arguments, target.view, scene, scene.bounds, scene.up)
            frame = renderer.render(camera)
            doubts = [f"{target.model}: {text}" for text in find_doubts(frame, scene, arguments)]
            for text in doubts:
                messages.warn(text)
            _write(frame, target.output, options.outputs[0])
            seconds, start = perf_counter() - start, perf_counter()
            messages.detail(f"{target.model}: {target.output}, {frame!r}, {seconds:.2f} s in all")
            if arguments.json:
                record = _record(target, frame, scene, seconds, of_model + doubts)
                print_record(record, target.output == STDIO)


def _as_keywords(options) -> dict:
    return {field.name: getattr(options, field.name) for field in fields(options)}


def load_scene(model, arguments, settings, messages) -> tuple[Scene, list[str]]:
    """Load a model; return it with the warnings that it gave, which were said."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        scene = _load(model, arguments, settings, messages)
    texts = list(dict.fromkeys(str(warning.message) for warning in caught))
    for text in texts:
        messages.warn(text)
    return scene, texts


def _load(model, arguments, settings, messages) -> Scene:
    """Load a model, and give its materials the reflection formula asked for."""
    source = sys.stdin.buffer.read() if model == STDIO else _checked_path(model, arguments.input_format)
    scene = load(source, format=arguments.input_format, log=messages.detail, **settings)
    if arguments.reflection is None:
        return scene
    meshes = tuple(
        replace(mesh, material=replace(mesh.material, reflection=arguments.reflection))
        for mesh in scene.meshes
    )
    return replace(scene, meshes=meshes)


def _checked_path(model, input_format) -> str:
    """Refuse, in the command line's own words, a folder and a name that doesn't tell its format."""
    path = Path(model)
    if path.is_dir():
        raise ModelError(f"{model}: is a folder; give the models in it, e.g. '{path / '*.stl'}'")
    if input_format is None and not path.suffix and path.exists():
        raise ModelError(f"{model}: the format is unknown without a suffix; give --input-format")
    return model


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
        elif arguments.zoom > 1.0:
            hint = "try a smaller --zoom"
        else:
            hint = "the model covers no sample; try a larger --size, more --samples or another --view"
        return [f"the picture is empty: {hint}"]
    if frame.has("rgb") and scene.background is None and not frame.rgb.any():
        return ["the picture is black: no light reaches what is seen; try --preset headlight"]
    return []


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
