"""`raster bench`: what each way to draw a model costs on this machine, and how far its picture is from the best one.

    load ─ methods, in turns ─ what else the scene has ─ table, JSON, plot
           speed_error          scene_axes

The table on stdout has the front first, the rows that nothing beats; the last line says what to choose.
"""

from dataclasses import replace
from pathlib import Path
from time import perf_counter

from ..analysis.flip import check_flip
from ..analysis.plotting import FORMATS, check_plotting
from ..analysis.scene_axes import AxisStudy, measure_axes
from ..analysis.speed_error import Study, list_methods, printed, study, told
from ..analysis.speed_error_plot import plot
from ..analysis.timing import describe_machine
from ..errors import SceneError, counted
from ..options import Options
from .cameras_lights import camera_of
from .load_scene import load_scene, with_options
from .messages import QUIET, Bar, print_record, print_text
from .render_command import draw_models

_OPTIONS = ("size", "cull", "exposure", "spectral", "threads")
_OF_AXES = 0.15  # of the time limit: for what else a scene has
_BUSY = 0.5  # load average, a core, from which on times are not to be trusted

COLUMNS = ("", "shading", "samples", "tolerance", "ms", "ns/tri", "ns/px", "rms", "max", "over 1", "ΔE", "of method",
           "of sampling", "rounding", "bound", "FLIP")  # fmt: skip
AXIS_COLUMNS = ("", "value", "ms", "times", "rms", "max", "ΔE", "against")


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
        found, axes = _measure(scene, arguments, messages)
        title = _title(target, scene, arguments, machine)
        if target.output is not None:
            output.write(plot(found.rows, title, Path(target.output).suffix.lower()), target.output)
        seconds, start = perf_counter() - start, perf_counter()
        if arguments.json:
            print_record(_record(target, arguments, scene, seconds, machine, warned, found, axes), False)
        elif arguments.level > QUIET:
            print_text(
                "\n".join([title, _LEGEND, "", *_table(found), "", *_axis_table(axes.rows), found.advice]) + "\n", False
            )


def _measure(scene, arguments, messages):
    """Return the Study of a scene, and the AxisStudy of what else it has."""
    options = {name: getattr(arguments, name) for name in _OPTIONS if name != "size"}
    methods = list_methods(arguments.shadings, arguments.subdivisions, arguments.list_of_samples, arguments.tolerances)
    with Bar(messages) as bar:

        def show(n_done, n, what):
            bar.show(n_done, n, f"measuring {what}")

        seconds = (1.0 - _OF_AXES * arguments.has_axes) * arguments.seconds
        found = study(scene, arguments.size, methods, seconds, show, arguments.with_flip, **options)
        axes = AxisStudy([], [])
        if arguments.has_axes:
            seconds = _OF_AXES * arguments.seconds
            limit = max(arguments.seconds - found.seconds, seconds)
            axes = measure_axes(scene, arguments.size, seconds, show, found.truth, limit, **options)
    if found.left_out:
        names = ", ".join(dict.fromkeys(method.name for method in found.left_out))
        messages.notice(
            f"{len(found.left_out)} methods are left out for want of time or memory ({names}); see --seconds"
        )
    if axes.left_out:
        messages.notice(f"left out for want of time: {', '.join(axes.left_out)}; see --seconds")
    return found, axes


# --- what is printed ----------------------------------------------------------------------------------------

_LEGEND = (
    "rms, max: error against Phong's shading at 64 samples a pixel with tolerance 0, linear intensity; over 1: 8-bit "
    "values\nmore than a level off; of method, of sampling: what makes the rms; rounding: against tolerance 0, and its "
    "bound"
)
_BEYOND = "*: next to a step, where no bound holds: the edge of a shadow, for one; raster render -v names them"


def _title(target, scene, arguments, machine) -> str:
    width, height = arguments.size
    n_thread = arguments.threads or machine["cores"]
    threads = counted(n_thread, "thread")
    view = f", {target.view}" if target.view else ""
    return f"{target.model}{view}: {counted(scene.n_face, 'triangle')}, {width}x{height}, {threads} on {machine['cpu']}"


def _table(found: Study) -> list[str]:
    """The rows as lines; those of the front have numbers, the others say which of them beats them."""
    front = [row for row in found.rows if not row.is_beaten]
    lines, is_any_beyond = [COLUMNS], any(row.is_beyond for row in found.rows)
    for row in found.rows:
        method, error = row.method, row.error
        mark = str(front.index(row) + 1) if not row.is_beaten else f"<{_winner(row, front)}"
        lines.append((
            mark, method.name, str(method.samples), told(method.tolerance), f"{row.ms:.2f}", _figure(row.ns_triangle),
            _figure(row.ns_pixel), f"{error.rms:.2e}", f"{error.max:.2f}", f"{100 * error.over_one:.1f}%",
            f"{error.delta_e:.3f}", f"{row.of_method:.1e}", f"{row.of_sampling:.1e}",
            f"{row.rounding:.1e}" + ("*" if row.is_beyond else " " * is_any_beyond), f"{row.bound:.1e}",
            "" if error.flip is None else f"{error.flip:.4f}",
        ))  # fmt: skip
    n_column = len(COLUMNS) - (found.rows[0].error.flip is None)
    texts = _aligned([line[:n_column] for line in lines], n_left=2)
    n_front = len(front) + 1
    beaten = ["", "both slower and further off than the row whose number stands after <:", *texts[n_front:]]
    return texts[:n_front] + (beaten if len(texts) > n_front else []) + [_BEYOND] * is_any_beyond


def _winner(row, front) -> int:
    """The number of the nearest row of the front that isn't slower."""
    return max(
        k + 1
        for k, other in enumerate(front)
        if other.ms <= row.ms and printed(other.error.rms) <= printed(row.error.rms)
    )


def _axis_table(axes) -> list[str]:
    """What else the scene has."""
    if not axes:
        return []
    lines = [AXIS_COLUMNS]
    for k, row in enumerate(axes):
        name = row.axis if k == 0 or axes[k - 1].axis != row.axis else ""
        error = ("-", "-", "-")
        if row.error is not None:
            error = f"{row.error.rms:.2e}", f"{row.error.max:.2f}", f"{row.error.delta_e:.3f}"
        lines.append((name, row.value, f"{row.ms:.2f}", f"{row.ratio:.2f}", *error, row.against))
    title = "one thing changed at a time, Phong with 4 samples a pixel; times: of the picture without the change"
    return [title, *_aligned(lines, n_left=2, is_last_left=True), ""]


def _aligned(lines, n_left, is_last_left=False) -> list[str]:
    """Lines of cells in columns."""
    widths = [max(len(cell) for cell in column) for column in zip(*lines, strict=True)]
    n_column = len(widths)

    def cell(text, k):
        is_left = k < n_left or (is_last_left and k == n_column - 1)
        return text.ljust(widths[k]) if is_left else text.rjust(widths[k])

    return ["  ".join(cell(text, k) for k, text in enumerate(line)).rstrip() for line in lines]


def _figure(value) -> str:
    return f"{value:.3g}" if value < 1000.0 else f"{value:.0f}"


def _record(target, arguments, scene, seconds, machine, warned, found, axes) -> dict:
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
        "axes": [row._asdict() | {"error": row.error and row.error._asdict()} for row in axes.rows],
        "left_out": [str(method) for method in found.left_out],
        "axes_left_out": axes.left_out,
        "advice": found.advice,
        "warnings": warned,
    }
