"""The plot of speed against error: its labels can be read."""

import numpy as np
import pytest

from rasterizer.analysis.speed_error import Errors, Method, Row
from rasterizer.analysis.speed_error_plot import plot


def random_rows(seed) -> list[Row]:
    """Rows as a study finds them: some of the front lie close together, some are exact."""
    rng = np.random.default_rng(seed)
    methods = [Method(shading, times, samples, 1 / 4096)
               for shading, times in (("flat", 0), ("gouraud", 0), ("gouraud", 1), ("gouraud", 2), ("phong", 0))
               for samples in (1, 4, 16)]  # fmt: skip
    ms = 5.0 * np.exp(rng.uniform(0.0, rng.choice([0.1, 1.0, 4.0]), len(methods)))
    rms = 0.02 * np.exp(-rng.uniform(0.0, rng.choice([0.1, 1.0, 6.0]), len(methods)))
    rms[rng.random(len(methods)) < 0.1] = 0.0
    is_beaten = [bool(((ms < a) & (rms < b)).any()) for a, b in zip(ms, rms, strict=True)]
    return [Row(method, a, Errors(b, b, 0, 0.0, 0.0), b, b, beaten)
            for method, a, b, beaten in zip(methods, ms.tolist(), rms.tolist(), is_beaten, strict=True)]  # fmt: skip


@pytest.mark.nightly
def test_labels_lie_within_the_plot_and_over_nothing_else(monkeypatch):
    pytest.importorskip("matplotlib", reason="the extra bench is not installed")
    from matplotlib.figure import Figure

    drawn, n_front, n_label = [], 0, 0
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: drawn.append(figure))  # of matplotlib
    for seed in range(25):
        rows = random_rows(seed)
        plot(rows, "title", ".png")
        n_front += sum(not row.is_beaten for row in rows)
        n_label += check_labels(drawn.pop(), rows)
    assert n_label > 0.8 * n_front, f"{n_label} labels of {n_front} rows"


def check_labels(figure, rows) -> int:
    """Check where the labels of a plot lie; return how many there are."""
    (axes,) = figure.axes
    figure.draw_without_rendering()
    plot, boxes = axes.get_window_extent(), [text.get_window_extent() for text in axes.texts]
    points = axes.transData.transform([(row.ms, max(row.error.rms, 1e-9)) for row in rows])
    for k, box in enumerate(boxes):
        assert plot.x0 <= box.x0 and box.x1 <= plot.x1, axes.texts[k].get_text()
        assert not box.count_overlaps([*boxes[:k], axes.get_legend().get_window_extent()]), axes.texts[k].get_text()
        assert not any(box.contains(*point) for point in points), axes.texts[k].get_text()
    return len(boxes)
