"""The triangles of a view that the stages work on, and what is counted and timed of them."""

from time import perf_counter
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from ..pipeline.cull import BandLists
from ..pipeline.transform import Drawables
from .plan_summary import PathCounts


class Drawn(NamedTuple):
    """The triangles that the stages after clip work on."""

    drawables: Drawables
    source: np.ndarray  # (n_triangle,) uint32: the triangle of the scene that each is a part of, or empty


class BandCounts(NamedTuple):
    """What was drawn in one band: samples, and triangles by the path that their attributes took
    (pipeline/gradients.py)."""

    covered: int
    entries: int
    planes: int
    exact: int


class Counts(NamedTuple):
    """What was drawn, for `Stats`."""

    faces: int
    clipped: int
    culled: int
    drawn: int
    covered: int
    samples: int
    paths: PathCounts

    @classmethod
    def of(
        cls, given: tuple[int, int], lists: BandLists, n_sample: tuple[int, int], counts: list[BandCounts]
    ) -> "Counts":
        """Sum up the counts of the stages and bands; `given` are the scene's triangles, and those that were clipped;
        `n_sample` is (width, height) of the picture in samples."""
        covered, *paths = (sum(column) for column in zip(*counts, strict=True)) if counts else (0, 0, 0, 0)
        n_visible, (width, height) = lists.n_visible, n_sample
        return cls(*given, lists.n_culled, n_visible, covered, width * height, PathCounts(*paths))


class Clock:
    """Milliseconds of each stage, in order."""

    def __init__(self) -> None:
        self.milliseconds: dict[str, float] = {}
        self._last = perf_counter()

    def lap(self, stage: str) -> None:
        """Add the time since the last lap to a stage."""
        now = perf_counter()
        self.milliseconds[stage] = self.milliseconds.get(stage, 0.0) + 1000.0 * (now - self._last)
        self._last = now


NO_CLOCK = SimpleNamespace(lap=lambda stage: None)  # for passes whose stages are not those of the picture
