"""How many samples a pixel has, as a type: each number of them has kernels of its own.

Loops over the samples of a pixel are unrolled, and those over pixels become vector instructions, where the number is
known when they are compiled. A picture has one number of samples: so one such loop is compiled, not one for each.
"""

from typing import NamedTuple

from ..compiler.kernels import helper

MOST_FACTOR = 4  # samples a pixel along an axis


class SampleGrid(NamedTuple):
    """The samples of a pixel, as many along either axis as `axis` has items."""

    axis: tuple  # zeros


def make_grid(factor) -> SampleGrid:
    """Return the samples of a pixel, `factor` along each axis."""
    return SampleGrid((0,) * factor)


@helper
def factor_of(grid):
    """Return the number of samples along an axis, int64, which the compiler takes for a constant."""
    return len(grid.axis)
