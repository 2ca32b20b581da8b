"""`raster bench`: what each method costs on this machine, and how far its picture is from the best one.

The table on stdout is the front, the rows that nothing beats; the last line says what to choose, and why.
"""

from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter

from .. import choices
from ..errors import SceneError, counted
from ..options import Options
from . import values
from .flags import add_appearance, add_camera, add_json, add_messages, add_models, add_size
from .messages import QUIET, Bar, aligned, print_text

IMPORTS = ("drawing",)
_OPTIONS = ("size", "cull", "exposure", "spectral", "threads")
_BUSY = 0.5  # load average, a core, from which on times are not to be trusted
_DESCRIPTION = """\
Draw each model by many methods and measure them in turns: shading, subdivision, samples a pixel, tolerance. The table
lists the methods that no other beats in both time and error; --all lists the others, too. The last line says which to
choose.
"""
_TABLE = """\
Lists have commas between their values. The table says of each method:

  ms                 a warm frame, median
  rms, max           error against Phong's shading at 64 samples a pixel with
                     tolerance 0, in linear intensity where white is 1, over
                     the pixels that either covers

With --all also:

  over 1, ΔE         share of 8-bit values more than a level off; mean colour
                     difference (CIEDE2000)
  method, sampling   what makes that error: where light is evaluated, and how
                     many samples see it (rms)
"""
_COLUMNS = ("shading", "samples", "tolerance", "ms", "rms", "max", "over 1", "ΔE", "of method",
            "of sampling", "FLIP")  # fmt: skip


def add_flags(parser) -> None:
    """Add the flags to the command's parser, and what its help says."""
    parser.usage = "raster bench MODEL... [--plot OUT] [options]"
    parser.description = _DESCRIPTION
    parser.set_defaults(outputs=None, default_name="{stem}-bench", default_suffix=".png", always_writes=False)
    add_models(parser)
    output = parser.add_argument_group("output")
    output.add_argument(
        "--plot", dest="output", metavar="OUT",
        help="draw time against error, as .png, .svg or .pdf; with {stem} or {view} for several (needs matplotlib)",
    )  # fmt: skip
    add_size(output, Options.size)
    add_json(output, "print a line of JSON for each model instead of the table")
    add_messages(output)
    add = parser.add_argument_group("measured", _TABLE).add_argument
    add("--shadings", type=values.list_of(str, choices.SHADINGS), default=("flat", "gouraud", "phong"), metavar="LIST",
        help="shading methods (default flat,gouraud,phong)")  # fmt: skip
    add("--subdivisions", type=values.list_of(values.whole, range(16)), default=(0, 1, 2), metavar="LIST",
        help="times that triangles are cut in four for gouraud (default 0,1,2)")  # fmt: skip
    add("--samples", dest="list_of_samples", type=values.list_of(values.whole, choices.SAMPLES), default=(1, 4, 16),
        metavar="LIST", help="samples a pixel (default 1,4,16)")  # fmt: skip
    add("--tolerances", type=values.list_of(values.fraction), default=(0.0, Options.tolerance, 1 / 64), metavar="LIST",
        help="errors accepted (default 0,1/4096,1/64)")  # fmt: skip
    add("--all", dest="has_all", action="store_true", help="print all methods, and what makes their errors")
    add("--flip", dest="with_flip", action="store_true",
        help="also FLIP, 0 to 1 (needs flip-evaluator)")  # fmt: skip
    add("--seconds", type=values.number, default=50.0, metavar="N", help="time limit (default 50); compiling is extra")
    add_camera(parser)
    add_appearance(parser, is_compared=True, is_measured=True)


def run(request, messages, *, has_all, with_flip, seconds, **compared) -> tuple[list, int]:
    """Measure every model; parameters, result and errors are those of `drawing.draw_models`."""
    from ..analysis.comparison import check_flip
    from ..analysis.speed_error import list_methods
    from ..analysis.speed_error_plot import check_plotting
    from .drawing import draw_models

    for tolerance in compared["tolerances"]:
        Options(tolerance=tolerance)
    if not seconds > 0.0:
        raise SceneError(f"--seconds must be above 0; given {seconds:g}")
    if request.files.output is not None:
        check_plotting()
    if with_flip:
        check_flip()
    lists = (compared[name] for name in ("shadings", "subdivisions", "list_of_samples", "tolerances"))
    measure = partial(_measure, methods=list_methods(*lists), seconds=seconds, with_flip=with_flip)
    return draw_models(
        request, messages, partial(_bench_model, measure=measure, has_all=has_all or with_flip), _check_plot
    )


def _check_plot(output, _) -> None:
    from ..analysis.speed_error_plot import FORMATS

    if Path(output).suffix.lower() not in FORMATS:
        raise SceneError(f"--plot writes {', '.join(FORMATS)}; given {output}")


def _bench_model(targets, request, messages, output, measure, has_all) -> None:
    """Measure all views of one model."""
    from ..analysis.speed_error_plot import plot
    from ..analysis.timing import describe_machine
    from .models import load_scene

    start = perf_counter()
    model = targets[0].model
    loaded = load_scene(model, request, messages, output.files_read)
    options = loaded.request.options
    machine = describe_machine()
    if machine["load"] is not None and machine["load"] > _BUSY * machine["cores"]:
        messages.warn(f"the load average is {machine['load']}: other work is running, so trust ratios only")
    for target in targets:
        scene = replace(loaded.scene, camera=loaded.request.camera_of(target.view, loaded.scene))
        found = measure(scene, options, messages)
        title = _title(target, scene, options, machine)
        if target.output is not None:
            output.write({target.output: plot(found.rows, title, Path(target.output).suffix.lower())})
        seconds, start = perf_counter() - start, perf_counter()
        if request.is_json:
            messages.record(_record(target, options, scene, seconds, machine, loaded.warnings, found))
        elif request.level > QUIET:
            print_text("\n".join([title, _LEGEND, "", *_table(found, has_all), "", found.advice]) + "\n")


def _measure(scene, chosen, messages, methods, seconds, with_flip):
    """Return the Study of a scene."""
    from ..analysis.speed_error import study

    options = {name: getattr(chosen, name) for name in _OPTIONS if name != "size"}
    with closing(Bar(messages)) as bar:

        def show(n_done, n, what):
            bar.show(n_done, n, f"measuring {what}")

        found = study(scene, chosen.size, methods, seconds, show, with_flip, **options)
    if not found.rows:
        raise SceneError("nothing is measured: the subdivided model is too large; give lower --subdivisions")
    if found.rows[0].error.delta_e is None:
        messages.notice("there is no ΔE without scikit-image: pip install scikit-image")
    if found.left_out:
        names = ", ".join(dict.fromkeys(method.name for method in found.left_out))
        n = len(found.left_out)
        messages.notice(f"{n} methods are left out for want of time or memory ({names}); see --seconds")
    return found


# --- what is printed ----------------------------------------------------------------------------------------

_LEGEND = "rms, max: error against Phong's shading at 64 samples a pixel, in linear intensity where white is 1"
_N_USUAL = 6  # columns without --all


def _title(target, scene, options, machine) -> str:
    width, height = options.size
    threads = counted(options.threads or machine["cores"], "thread")
    view = f", {target.view}" if target.view else ""
    return f"{target.model}{view}: {counted(scene.n_face, 'triangle')}, {width}x{height}, {threads} on {machine['cpu']}"


def _table(found, has_all) -> list[str]:
    """The rows that nothing beats as lines, and the others with --all."""
    n_column = len(_COLUMNS) - (found.rows[0].error.flip is None) if has_all else _N_USUAL
    texts = aligned([line[:n_column] for line in (_COLUMNS, *map(_cells, found.rows))])
    n_line = 1 + sum(not row.is_beaten for row in found.rows)
    note = f"{counted(len(texts) - n_line, 'other')}, both slower and further off"
    return [*texts[:n_line], *([f"{note}:", *texts[n_line:]] if has_all else [f"{note}: --all"])]


def _cells(row) -> tuple[str, ...]:
    from ..analysis.speed_error import tolerance_text

    method, error = row.method, row.error
    words = method.name, str(method.samples), tolerance_text(method.tolerance)
    delta_e = "" if error.delta_e is None else f"{error.delta_e:.3f}"
    errors = f"{error.rms:.2e}", f"{error.max:.2f}", f"{100 * error.over_one:.1f}%", delta_e
    parts = f"{row.of_method:.1e}", f"{row.of_sampling:.1e}", "" if error.flip is None else f"{error.flip:.4f}"
    return *words, f"{row.ms:.2f}", *errors, *parts


def _record(target, options, scene, seconds, machine, warnings, found) -> dict:
    """What --json says of a model."""
    return {
        "model": target.model,
        "view": target.view,
        "plot": target.output,
        "size": list(options.size),
        "faces": scene.n_face,
        "seconds": round(seconds, 3),
        "machine": machine,
        "rows": [
            {**row.method._asdict(), **row._asdict(), "method": str(row.method), "error": row.error._asdict()}
            for row in found.rows
        ],
        "left_out": [str(method) for method in found.left_out],
        "advice": found.advice,
        "warnings": warnings,
    }
