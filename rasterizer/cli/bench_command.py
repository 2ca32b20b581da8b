"""`raster bench`: what each way to draw a model costs on this machine, and how far its picture is from the best one.

The table on stdout has the front first, the rows that nothing beats; the last line says what to choose.
"""

from dataclasses import replace
from pathlib import Path
from time import perf_counter

from ..analysis.comparison import check_flip
from ..analysis.speed_error import Study, list_methods, printed, study, tolerance_text
from ..analysis.speed_error_plot import FORMATS, check_plotting, plot
from ..analysis.timing import describe_machine
from ..errors import SceneError, counted
from ..options import Options
from .cameras_lights import camera_of
from .load_scene import load_scene, with_options
from .messages import QUIET, Bar, print_record, print_text
from .render_command import draw_models

_OPTIONS = ("size", "cull", "exposure", "spectral", "threads")
_BUSY = 0.5  # load average, a core, from which on times are not to be trusted

COLUMNS = ("", "shading", "samples", "tolerance", "ms", "rms", "max", "over 1", "ΔE", "of method",
           "of sampling", "FLIP")  # fmt: skip


def bench_models(arguments, messages) -> tuple[list, int]:
    """Measure every model; parameters, result and errors are those of `render_models`."""
    for name in _OPTIONS:
        Options(**{name: getattr(arguments, name)})  # what is not legal is told at once
    for tolerance in arguments.tolerances:
        Options(tolerance=tolerance)
    if not arguments.seconds > 0.0:
        raise SceneError(f"--seconds must be above 0; given {arguments.seconds:g}")
    if arguments.output is not None:
        check_plotting()
    if arguments.with_flip:
        check_flip()
    return draw_models(arguments, messages, _bench_model, _check_plot)


def _check_plot(output, _) -> None:
    if Path(output).suffix.lower() not in FORMATS:
        raise SceneError(f"--plot writes {', '.join(FORMATS)}; given {output}")


def _bench_model(targets, arguments, settings, messages, output) -> None:
    """Measure all views of one model."""
    start = perf_counter()
    loaded, warned, own_options, framing = load_scene(
        targets[0].model, arguments, settings, messages, output.files_read
    )
    arguments = with_options(arguments, own_options, _OPTIONS, targets[0].model)
    machine = describe_machine()
    if machine["load"] is not None and machine["load"] > _BUSY * machine["cores"]:
        messages.warn(f"the load average is {machine['load']}: other work is running, so trust ratios only")
    for target in targets:
        scene = replace(loaded, camera=camera_of(arguments, target.view, loaded, framing))
        found = _measure(scene, arguments, messages)
        title = _title(target, scene, arguments, machine)
        if target.output is not None:
            output.write(plot(found.rows, title, Path(target.output).suffix.lower()), target.output)
        seconds, start = perf_counter() - start, perf_counter()
        if arguments.json:
            print_record(_record(target, arguments, scene, seconds, machine, warned, found), False)
        elif arguments.level > QUIET:
            print_text("\n".join([title, _LEGEND, "", *_table(found), "", found.advice]) + "\n", False)


def _measure(scene, arguments, messages):
    """Return the Study of a scene."""
    options = {name: getattr(arguments, name) for name in _OPTIONS if name != "size"}
    methods = list_methods(arguments.shadings, arguments.subdivisions, arguments.list_of_samples, arguments.tolerances)
    with Bar(messages) as bar:

        def show(n_done, n, what):
            bar.show(n_done, n, f"measuring {what}")

        found = study(scene, arguments.size, methods, arguments.seconds, show, arguments.with_flip, **options)
    if found.rows[0].error.delta_e is None:
        messages.notice("there is no ΔE without scikit-image: pip install scikit-image")
    if found.left_out:
        names = ", ".join(dict.fromkeys(method.name for method in found.left_out))
        messages.notice(
            f"{len(found.left_out)} methods are left out for want of time or memory ({names}); see --seconds"
        )
    return found


# --- what is printed ----------------------------------------------------------------------------------------

_LEGEND = (
    "rms, max: error against Phong's shading at 64 samples a pixel with tolerance 0, linear intensity; over 1: 8-bit "
    "values\nmore than a level off; of method, of sampling: what makes the rms"
)


def _title(target, scene, arguments, machine) -> str:
    width, height = arguments.size
    n_thread = arguments.threads or machine["cores"]
    threads = counted(n_thread, "thread")
    view = f", {target.view}" if target.view else ""
    return f"{target.model}{view}: {counted(scene.n_face, 'triangle')}, {width}x{height}, {threads} on {machine['cpu']}"


def _table(found: Study) -> list[str]:
    """The rows as lines; those of the front have numbers, the others say which of them beats them."""
    front = [row for row in found.rows if not row.is_beaten]
    lines = [COLUMNS]
    for row in found.rows:
        method, error = row.method, row.error
        mark = str(front.index(row) + 1) if not row.is_beaten else f"<{_winner(row, front)}"
        delta_e = "" if error.delta_e is None else f"{error.delta_e:.3f}"
        errors = f"{error.rms:.2e}", f"{error.max:.2f}", f"{100 * error.over_one:.1f}%", delta_e
        parts = f"{row.of_method:.1e}", f"{row.of_sampling:.1e}", "" if error.flip is None else f"{error.flip:.4f}"
        words = method.name, str(method.samples), tolerance_text(method.tolerance)
        lines.append((mark, *words, f"{row.ms:.2f}", *errors, *parts))
    n_column = len(COLUMNS) - (found.rows[0].error.flip is None)
    texts = _aligned([line[:n_column] for line in lines], n_left=2)
    n_front = len(front) + 1
    beaten = ["", "both slower and further off than the row whose number stands after <:", *texts[n_front:]]
    return texts[:n_front] + (beaten if len(texts) > n_front else [])


def _winner(row, front) -> int:
    """The number of the nearest row of the front that isn't slower."""
    return max(
        k + 1
        for k, other in enumerate(front)
        if other.ms <= row.ms and printed(other.error.rms) <= printed(row.error.rms)
    )


def _aligned(lines, n_left) -> list[str]:
    """Lines of cells in columns, the first ones to the left."""
    widths = [max(len(cell) for cell in column) for column in zip(*lines, strict=True)]

    def cell(text, k):
        return text.ljust(widths[k]) if k < n_left else text.rjust(widths[k])

    return ["  ".join(cell(text, k) for k, text in enumerate(line)).rstrip() for line in lines]


def _record(target, arguments, scene, seconds, machine, warned, found) -> dict:
    """What --json says of a model."""
    return {
        "path": target.model,
        "view": target.view,
        "plot": target.output,
        "size": list(arguments.size),
        "faces": scene.n_face,
        "seconds": round(seconds, 3),
        "machine": machine,
        "rows": [
            {**row.method._asdict(), **row._asdict(), "method": str(row.method), "error": row.error._asdict()}
            for row in found.rows
        ],
        "left_out": [str(method) for method in found.left_out],
        "advice": found.advice,
        "warnings": warned,
    }
