"""All pairs in place of all combinations: most faults need one value of one choice, or two of two."""

from collections.abc import Sequence
from itertools import combinations, product
from typing import Any


def pairs(**choices: Sequence) -> list[tuple]:
    """Return few combinations, a value of each choice each, so that every two values of two choices meet in one.

    Greedily, always in the same order: the combination that has the most pairs which weren't met before comes next.

        @pytest.mark.parametrize("shading, samples", pairs(shading=("flat", "phong"), samples=(1, 4)))
    """
    open_pairs = {pair for case in product(*choices.values()) for pair in _pairs_of(case)}
    chosen: list[tuple] = []
    while open_pairs:
        best = max(product(*choices.values()), key=lambda case: len(open_pairs & _pairs_of(case)))
        chosen.append(best)
        open_pairs -= _pairs_of(best)
    return chosen


def _pairs_of(case: tuple) -> set[tuple[Any, Any]]:
    if len(case) == 1:
        return {((0, case[0]), None)}
    return set(combinations(enumerate(case), 2))
