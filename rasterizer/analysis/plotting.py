"""What all plots share: colours, logarithmic axes that read as plain numbers, and the bytes of a file."""

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

from .packages import require

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = (".png", ".svg", ".pdf")
GREY, ORANGE, BLUE, GREEN = "#7f7f7f", "#d55e00", "#0072b2", "#009e73"  # Okabe & Ito 2008, for any eye
COLORS = {"flat": GREY, "lambert": GREY, "gouraud": ORANGE, "phong": BLUE}


def check_plotting() -> None:
    """Raise SceneError where matplotlib isn't installed."""
    require("matplotlib", "matplotlib", "a plot")


def figure_bytes(figure: "Figure", suffix: str, dpi: int = 110) -> bytes:
    """Draw a figure, as the bytes of a file: the same ones each time.

    Parameters
    ----------
    figure : matplotlib's
    suffix : one of FORMATS
    dpi : pixels an inch, of a PNG file
    """
    import matplotlib

    written = io.BytesIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "rasterizer"}):
        metadata = {"Date": None} if suffix == ".svg" else None
        figure.savefig(written, format=suffix.lstrip("."), dpi=dpi, metadata=metadata)
    return written.getvalue()


def make_logarithmic(axes: "Axes", y_subs: Sequence[float] = (1.0, 2.0, 5.0)) -> None:
    """Give both axes of a plot logarithms, with ticks at 1, 2, 5, 10 ... that read as plain numbers."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axes.set(xscale="log", yscale="log")
    for axis, subs in ((axes.xaxis, (1.0, 2.0, 5.0)), (axes.yaxis, y_subs)):
        axis.set_major_locator(LogLocator(subs=subs, numticks=30))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())
