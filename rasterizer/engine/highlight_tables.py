"""What is known of the highlights of all materials, kept for the few values of |L + V| that views are told apart by."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import reflection_table
from .reflection_entry import HighlightBounds

STEPS = 8  # values of |L + V| a unit
LEAST_SUMS = np.arange(2 * STEPS + 1) / STEPS  # |L + V| is 2 at most


class HighlightTables:
    """Hold the bounds of the highlights of materials, found when they are asked for first.

    A view asks for all materials and lights at once, and looks them up.
    """

    def __init__(self, materials: Sequence[Any]) -> None:
        self._materials = tuple(materials)
        self._known: dict[float, HighlightBounds] = {}  # by u: (n_material, n_sum) each

    def look_up(self, u: float, least_sums: ArrayLike) -> HighlightBounds:
        """Return what is known of highlights of height 1, (n_material, n_light).

        Parameters
        ----------
        u : unit roundoff
        least_sums : (n_material, n_light), |L + V| is nowhere less; rounded down to a multiple of 1/STEPS
        """
        if u not in self._known:
            self._known[u] = self._compute(u)
        sums = np.clip(np.nan_to_num(least_sums, nan=0.0), 0.0, 2.0)  # of what is no number nothing is known
        row, column = np.arange(len(self._materials))[:, None], (STEPS * sums).astype(np.int64)
        return HighlightBounds(*(values[row, column] for values in self._known[u]))

    def _compute(self, u) -> HighlightBounds:
        """The bounds of all materials; zeros where there is no highlight."""
        found = np.zeros((len(HighlightBounds._fields), len(self._materials), len(LEAST_SUMS)))
        for m, material in enumerate(self._materials):
            if reflection_table.has_highlight(material):
                found[:, m] = reflection_table.entry_of(material).highlight_bounds(material, u, LEAST_SUMS)
        return HighlightBounds(*found)
