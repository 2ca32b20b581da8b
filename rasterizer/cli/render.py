"""`raster render`: a picture of each model, or its arrays.

arguments ─ models, outputs ─ load ─ camera ─ Renderer ─ Frame ─ file
argparse    names, checked    one model after the other
"""

from contextlib import contextmanager, nullcontext
from time import perf_counter
from typing import TYPE_CHECKING

from ..choices import RANDOM
from ..errors import counted
from ..options import Options
from .flags import add_appearance, add_arrays, add_camera, add_models, add_output, add_processes

if TYPE_CHECKING:
    from ..frame import Frame

IMPORTS = ("drawing",)
_EXAMPLES = """\
examples:
  raster render part.stl                                    part.png, here
  raster render part.stl -o side.jpg --view left --ortho -s 1920x1080
  raster render 'parts/*.stl' -o 'thumbs/{stem}-{view}.png' --view iso,top
  raster render part.obj --light ambient:0.2 --light directional:1,-1,0
  raster render part.obj --material diffuse=orange,shininess=80 --shadows
  raster render scene.json -s 1920x1080                     with its own lights
  raster render part.obj --array depth -o depth.npy         float32, inf: none
  raster render part.obj --array rgb --array depth -o '{stem}.{array}.png'
  raster render part.obj -o part.jpg --array depth -o depth.png
  cat part.stl | raster render - --input-format stl -o - > part.png
"""


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster render MODEL... [-o OUT] [options]"
    parser.description = "Draw each model and write a picture of it, or arrays."
    parser.epilog = _EXAMPLES
    add_models(parser)
    add_output(parser, "{stem}", Options.size, has_arrays=True)
    add_arrays(parser)
    add_camera(parser, has_seed=True)
    add_processes(add_appearance(parser))


def run(request, messages) -> tuple[list, int]:
    """Draw every model; parameters, result and errors are those of `drawing.draw_models`."""
    from .drawing import draw_models, plan_missing
    from .outputs import check_scale

    if request.files.scale is not None:
        check_scale(request.files)
    if request.n_process is not None:
        from .processes import can_use_processes, draw_in_processes

        if can_use_processes(request):
            plan, n_model = plan_missing(request, messages)
            return draw_in_processes(request, messages, plan, render_view)[0], n_model
    return draw_models(request, messages, _render_model)


def _render_model(targets, request, messages, output) -> None:
    """Draw all views of one model."""
    from ..renderer import Renderer
    from .models import load_scene
    from .outputs import by_view

    start = perf_counter()
    loaded = load_scene(targets[0].model, request, messages, output.files_read)
    with Renderer(loaded.scene, options=loaded.request.options) as renderer:
        for of_view in by_view(targets):
            render_view(of_view, renderer, loaded, request, messages, output, start)
            start = perf_counter()


def render_view(targets, renderer, loaded, asked, messages, output, start) -> "Frame":
    """Draw one view of a model, Loaded, and write its files; `start` is when that was begun. Return the frame.

    `asked` is the Request of all models.
    """
    from .drawing import picture_warnings
    from .messages import STDIO, VERBOSE
    from .outputs import encode_target

    model, request, lights = targets[0].model, loaded.request, nullcontext(renderer)
    options = request.options
    if request.seed_of_lights is not None:
        lights = _in_lights(renderer, targets[0], loaded, asked.appearance.preset)
    with lights as lit:
        camera = request.camera_of(targets[0].view, loaded.scene, lambda: lit.subject)
        frame, scene = lit.render(camera), lit.scene
    warnings = picture_warnings(frame, scene, request, camera, model)
    messages.warn(*warnings)
    contents = {}
    for target in targets:
        contents[target.output] = encode_target(frame, target, options.outputs, request.files)
    output.write(contents)
    seconds = perf_counter() - start
    for target in targets:
        output.results.tell(target.output, frame.size, len(contents[target.output]), seconds)
        if messages.level >= VERBOSE:
            messages.detail(f"{model}: {target.output}, {frame!r}, {seconds:.2f} s in all")
            messages.detail(f"{model}: {_describe_appearance(scene, camera, options)}")
            messages.detail(f"{model}: {describe_bounds(frame.stats)}")
            messages.explain(f"{model}: {'; '.join(repr(frame.stats.plan).splitlines())}")
        if request.is_json:
            record = _record(target, frame, scene, seconds, loaded.warnings + warnings)
            messages.record(record, target.output == STDIO)
    return frame


@contextmanager
def _in_lights(renderer, target, loaded, preset):
    """Yield another Renderer, which draws a view in random lights of its own, and those of a preset that flags name."""
    from ..appearance import Appearance
    from ..scene.lights import random_lights

    lights, request, options = random_lights(target.seed, up=loaded.scene.up), loaded.request, renderer.options
    appearance = Appearance(lights=lights, preset=preset, shadows=request.appearance.shadows)
    scene = appearance.change(loaded.scene, options.shading, options.ground, request.shadow_fields)
    with renderer.in_lights(scene.lights) as lit:
        yield lit


def _describe_appearance(scene, camera, options) -> str:
    """Say in a line how a scene is shown."""
    from ..scene.lights import light_type_of

    lights = ", ".join(dict.fromkeys(map(light_type_of, scene.lights)))
    seen = "through its own camera" if camera is scene.camera else f"framed, {scene.up} upwards"
    samples = counted(options.samples, "sample")
    return f"{options.shading} shading, {samples} a pixel, lights: {lights or 'none'}; {seen}"


def describe_bounds(stats) -> str:
    """Say in a line how far a picture may be off, and what that leaves out; `stats` and --json say where and why."""
    apart = [step[0] for step in stats.steps]
    if stats.error_bound is None:
        return ", ".join(cause for cause in apart if cause.startswith("no bound is stated"))
    more = f", and {len(apart) - 1} more" if len(apart) > 1 else ""
    words = f"errors are at most {stats.error_bound:.2g} in linear intensity"
    return words + (f"; but next to steps: {apart[0]}{more}" if apart else "")


def _record(target, frame, scene, seconds, warnings) -> dict:
    """What --json says of a picture."""
    from .request import seed_of

    return {
        "status": "drawn",
        "model": target.model,
        "view": target.view if seed_of(target.view) is None else RANDOM,
        "seed": target.seed,
        "output": target.output,
        "arrays": target.arrays,
        "size": list(frame.size),
        "faces": scene.n_face,
        "coverage": frame.stats.coverage,
        "seconds": round(seconds, 4),
        "error_bound": frame.stats.error_bound,
        "warnings": warnings,
    }
