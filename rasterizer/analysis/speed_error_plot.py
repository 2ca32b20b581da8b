"""The plot of speed against error: milliseconds and rms error of every method, both logarithmic, and the front."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from .plotting import COLORS, check_plotting, figure_bytes, make_logarithmic
from .speed_error import Row, told

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PALER = 0.45  # of a method's colour towards white, for each subdivision
_MARKERS = {1: "v", 4: "o", 9: "D", 16: "s"}
_SIZE = (9.0, 6.0)  # inches
_LEAST_ERROR = 1e-9  # what is exact has a place on a logarithmic axis


def plot(rows: Sequence[Row], title: str, suffix: str) -> bytes:
    """Plot rows, as the bytes of a file.

    Parameters
    ----------
    rows : sequence of Row, as `speed_error.study` sorts them
    title : text above the plot
    suffix : one of plotting.FORMATS

    Raises
    ------
    SceneError : matplotlib isn't installed
    """
    check_plotting()
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE, layout="constrained")
    axes = figure.add_subplot()
    _draw_rows(axes, rows)
    _draw_front(axes, [row for row in rows if not row.is_beaten])
    axes.set(title=title, xlabel="milliseconds a frame")
    axes.set_ylabel("error (rms, linear intensity) against Phong at 64 samples a pixel")
    make_logarithmic(axes)
    axes.margins(0.08)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="best", fontsize=9)
    return figure_bytes(figure, suffix, dpi=120)


def _draw_rows(axes: "Axes", rows: Sequence[Row]) -> None:
    """Draw a point for each row: its colour tells the shading, its marker the samples, an empty one tolerance 0."""
    looks = dict.fromkeys((row.method.name, row.method.shading, row.method.subdivisions) for row in rows)
    for name, shading, times in sorted(looks, key=lambda look: (list(COLORS).index(look[1]), look[2])):
        color = _paler(COLORS[shading], _PALER * times)
        axes.scatter([], [], color=color, marker="o", label=name)
        for row in rows:
            if row.method.name == name:
                axes.scatter(
                    row.ms, max(row.error.rms, _LEAST_ERROR), color="none" if row.method.tolerance == 0.0 else color,
                    edgecolor=color, marker=_MARKERS[row.method.samples], s=34 if row.is_beaten else 64,
                    alpha=0.55 if row.is_beaten else 1.0, zorder=2 if row.is_beaten else 4,
                )  # fmt: skip
    for samples in sorted({row.method.samples for row in rows}):
        axes.scatter([], [], color="black", marker=_MARKERS[samples],
                     label=f"{samples} sample{'s' if samples > 1 else ''} a pixel")  # fmt: skip
    if any(row.method.tolerance == 0.0 for row in rows):
        axes.scatter([], [], color="none", edgecolor="black", marker="o", label="tolerance 0")


def _draw_front(axes: "Axes", front: Sequence[Row]) -> None:
    """Draw the front as steps: what can be had for a time. Its rows have labels, but where one lies next to another."""
    front = sorted(front, key=lambda row: row.ms)
    axes.step([row.ms for row in front], [max(row.error.rms, _LEAST_ERROR) for row in front], where="post",
              color="black", linewidth=1.0, zorder=3, label="front: nothing is quicker and nearer")  # fmt: skip
    last = None
    for row in front:
        name = f"{row.method.name}, {row.method.samples}×, {told(row.method.tolerance)}"
        is_next = last is not None and row.ms < 1.15 * last.ms and row.error.rms > 0.85 * last.error.rms
        if not is_next:
            is_near = last is not None and row.ms < 1.6 * last.ms and row.error.rms > 0.85 * last.error.rms
            axes.annotate(name, (row.ms, max(row.error.rms, _LEAST_ERROR)), xytext=(-6, -13) if is_near else (6, 5),
                          textcoords="offset points", ha="right" if is_near else "left", fontsize=8)  # fmt: skip
            last = row


def _paler(color: str, share: float) -> str:
    """A colour, mixed with white."""
    channels = (int(color[k : k + 2], 16) for k in (1, 3, 5))
    return "#" + "".join(f"{round(c + (255 - c) * min(share, 0.8)):02x}" for c in channels)
