"""The plot of speed against error: milliseconds and rms error of every method, both logarithmic, and the front."""

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..errors import counted
from .comparison import require
from .speed_error import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes


FORMATS = (".png", ".svg", ".pdf")
GREY, ORANGE, BLUE = "#7f7f7f", "#d55e00", "#0072b2"  # Okabe & Ito 2008, for any eye
COLORS = {"flat": GREY, "lambert": GREY, "gouraud": ORANGE, "phong": BLUE}


def check_plotting() -> None:
    """Raise SceneError where matplotlib isn't installed."""
    require("matplotlib", "matplotlib", "a plot")


_PALER = 0.45  # of a method's colour towards white, for each subdivision
_MARKERS = {1: "v", 4: "o", 9: "D", 16: "s"}
_SIZE = (9.0, 6.0)  # inches
_DPI = 120  # pixels an inch, of a PNG file
_MIN_ERROR = 1e-9  # what is exact has a place on a logarithmic axis


def plot(rows: Sequence[Row], title: str, suffix: str) -> bytes:
    """Plot rows, as the bytes of a file.

    Parameters
    ----------
    rows : sequence of Row, as `speed_error.study` sorts them
    title : text above the plot
    suffix : one of FORMATS

    Raises
    ------
    SceneError : matplotlib isn't installed
    """
    check_plotting()
    import matplotlib
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    figure = Figure(figsize=_SIZE, layout="constrained")
    axes = figure.add_subplot()
    _draw_rows(axes, rows)
    _draw_front(axes, [row for row in rows if not row.is_beaten])
    axes.set(title=title, xlabel="milliseconds a frame")
    axes.set_ylabel("error (rms, linear intensity) against Phong at 64 samples a pixel")
    axes.set(xscale="log", yscale="log")
    for axis in (axes.xaxis, axes.yaxis):  # ticks at 1, 2, 5, 10 ... that read as plain numbers
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=30))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.margins(0.08)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="best", fontsize=9)
    written = io.BytesIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "rasterizer"}):  # the same bytes each time
        metadata = {"Date": None} if suffix == ".svg" else None
        figure.savefig(written, format=suffix.lstrip("."), dpi=_DPI, metadata=metadata)
    return written.getvalue()


def _draw_rows(axes: "Axes", rows: Sequence[Row]) -> None:
    """Draw a point for each row: its colour tells the shading, its marker the samples, an empty one tolerance 0."""
    looks = dict.fromkeys((row.method.name, row.method.shading, row.method.subdivisions) for row in rows)
    for name, shading, times in sorted(looks, key=lambda look: (list(COLORS).index(look[1]), look[2])):
        color = _paler(COLORS[shading], _PALER * times)
        axes.scatter([], [], color=color, marker="o", label=name)
        for row in rows:
            if row.method.name == name:
                axes.scatter(
                    *_place_of(row), color="none" if row.method.tolerance == 0.0 else color,
                    edgecolor=color, marker=_MARKERS[row.method.samples], s=34 if row.is_beaten else 64,
                    alpha=0.55 if row.is_beaten else 1.0, zorder=2 if row.is_beaten else 4,
                )  # fmt: skip
    for samples in sorted({row.method.samples for row in rows}):
        axes.scatter([], [], color="black", marker=_MARKERS[samples],
                     label=f"{counted(samples, 'sample')} a pixel")  # fmt: skip
    if any(row.method.tolerance == 0.0 for row in rows):
        axes.scatter([], [], color="none", edgecolor="black", marker="o", label="tolerance 0")


def _draw_front(axes: "Axes", front: Sequence[Row]) -> None:
    """Draw the front as steps: what can be had for a time."""
    times, errors = zip(*sorted(_place_of(row) for row in front), strict=True)
    axes.step(times, errors, where="post", color="black", linewidth=1.0, zorder=3,
              label="front: nothing is quicker and nearer")  # fmt: skip


def _place_of(row: Row) -> tuple[float, float]:
    return row.ms, max(row.error.rms, _MIN_ERROR)


def _paler(color: str, share: float) -> str:
    """A colour, mixed with white."""
    channels = (int(color[k : k + 2], 16) for k in (1, 3, 5))
    return "#" + "".join(f"{round(c + (255 - c) * min(share, 0.8)):02x}" for c in channels)
