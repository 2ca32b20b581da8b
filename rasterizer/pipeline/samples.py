"""The samples of a batch, and planes of setups there.

The stages behind scan work on batches of samples side by side in a row of a band. A parameter `first` is the sample
(x, y) where a batch begins.

Planes stand in setups (triangle_setups.py), four side by side. They are evaluated by vector instructions, which
intrinsics.py spells out for the compiler: it wouldn't find them for loops of four planes by itself.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, spelled_out
from .fragments import NEXT
from .visibility import INTENSITY_BITS, IS_WEIGHTED


@helper
def skip_to(first, k):
    """Return the sample that lies k samples to the right of another one."""
    return first[0] + k, first[1]


# ---------------------------------------------------------------- planes

PLANE_GROUP = 4  # planes that stand side by side in a setup, and samples whose texels are read so


class PlaneGroup(NamedTuple):
    """Four planes of every setup, side by side: PLANE_GROUP values, as many d/dx, as many d/dy; then, where samples
    must stay within a range, as many least and greatest values."""

    numbers: np.ndarray  # (n << shift,) float32, the setups
    setup_mask: int  # int64, the bits of a packed sample that are the index of a setup
    shift: int  # int64: a setup begins at these bits shifted left
    column: int  # int64, where the group begins in a setup


@spelled_out("build_planes_of_row")
def evaluate_planes(packed, group, first, out, start):
    """Evaluate a group of four planes at the samples of a batch: the inner loop of the shade stage.

    The second and third number of a setup are whole ones: the sample at which its planes have their values. Float32 is
    rounded after each operation, in this order. Samples up to the next multiple of LANES may be read and written, too.

    Parameters
    ----------
    packed : (n,) int64; of those without the index of a setup, the values of setup 0
    group : PlaneGroup
    first : the sample (x, y) that the batch begins with
    out : (n,) float32; written from `start` on, a row a plane, NEXT apart, as a batch has them
    """
    for k in range(len(packed)):
        setup = setup_number(packed[k], group)
        across, down = offset_of_sample(first, k, group, setup)
        write_row(out, start + k, values_of_planes(group.numbers, setup + group.column, across, down))


@helper
def write_row(rows, place, values):
    """Write four values of a sample, one a row."""
    rows[place], rows[place + NEXT] = values[0], values[1]
    rows[place + 2 * NEXT], rows[place + 3 * NEXT] = values[2], values[3]


@helper
def setup_number(packed, group):
    """Return where the setup that a packed sample shows begins; 0 where it shows none."""
    mask = group.setup_mask if packed >> INTENSITY_BITS & 1 else 0
    return (packed & mask) << group.shift


@helper
def values_of_planes(numbers, plane, across, down):
    """Return the values of four planes beside the sample where they have their values; float32 is rounded after each
    operation."""
    return (
        value_beside(numbers, plane, across, down),
        value_beside(numbers, plane + 1, across, down),
        value_beside(numbers, plane + 2, across, down),
        value_beside(numbers, plane + 3, across, down),
    )


@helper
def value_beside(numbers, plane, across, down):
    """Return the value of one plane, see `values_of_planes`."""
    value = numbers[plane] + across * numbers[plane + PLANE_GROUP]
    return value + down * numbers[plane + 2 * PLANE_GROUP]


@helper
def offset_of_sample(first, k, group, setup):
    """Return how far sample k lies across and down from the one at which the planes of a setup have their values,
    float32."""
    anchor = anchor_of(group, setup)
    return np.float32(first[0] + k - anchor[0]), np.float32(first[1] - anchor[1])


@helper
def anchor_of(group, setup):
    """Return the sample at which the planes of a setup have their values: where four numbers are whole ones' bits."""
    x, y = np.float32(group.numbers[setup + 1]), np.float32(group.numbers[setup + 2])
    return np.int64(x.view(np.int32)), np.int64(y.view(np.int32))


# ---------------------------------------------------------------- values within their ranges


@spelled_out("build_values_of_row")
def evaluate_values(packed, group, first, out, start, weights):
    """Evaluate a group of four planes as `evaluate_planes` does, multiply, and keep what is weighted within its range.

    Parameters
    ----------
    group : PlaneGroup, in whose setups the least values stand behind weighted planes, then the greatest
    out : (n,) float32, to which the rows are written
    weights : int64, where in `out` the factors of the samples begin
    """
    numbers, behind = group.numbers, 3 * PLANE_GROUP
    for k in range(len(packed)):
        setup, is_weighted = setup_number(packed[k], group), packed[k] & IS_WEIGHTED != 0
        across, down = offset_of_sample(first, k, group, setup)
        plane, weight = setup + group.column, out[weights + k]
        v0, v1, v2, v3 = values_of_planes(numbers, plane, across, down)
        values = (
            within(v0 * weight, numbers, plane + behind, is_weighted),
            within(v1 * weight, numbers, plane + behind + 1, is_weighted),
            within(v2 * weight, numbers, plane + behind + 2, is_weighted),
            within(v3 * weight, numbers, plane + behind + 3, is_weighted),
        )
        write_row(out, start + k, values)


@helper
def within(value, numbers, min_at, has_range):
    """Return a value kept within its range, if it has one; the least one where it is no number."""
    least = numbers[min_at] if has_range else np.float32(-np.inf)
    greatest = numbers[min_at + PLANE_GROUP] if has_range else np.float32(np.inf)
    value = value if value > least else least
    return value if value < greatest else greatest


# ---------------------------------------------------------------- planes with their slopes


@spelled_out("build_both_of_row")
def evaluate_with_slopes(packed, group, first, out, start, behind, behind_start):
    """Evaluate a group of four planes into four rows of `out`, and the group that stands right behind it, with slopes,
    into ten rows of `behind`, which begin at `behind_start`.

    See `evaluate_planes` and `evaluate_slopes`.
    """
    evaluate_planes(packed, group, first, out, start)
    evaluate_slopes(packed, group_behind(group), first, behind, behind_start)


@helper
def group_behind(group):
    """Return the group of planes that stands right behind another one."""
    return PlaneGroup(group.numbers, group.setup_mask, group.shift, group.column + 3 * PLANE_GROUP)


@spelled_out("build_slopes_of_row")
def evaluate_slopes(packed, group, first, out, start):
    """Evaluate a group of four planes as `evaluate_planes` does, and copy the slopes of three for each sample.

    Ten rows are written: the planes, then d/dx of the first three, then d/dy of these.
    """
    evaluate_planes(packed, group, first, out, start)
    copy_slopes(packed, group, out, start)


@helper
def copy_slopes(packed, group, out, start):
    """Copy the slopes of three planes for each sample: d/dx of each, then d/dy, behind the planes."""
    for k in range(len(packed)):
        first = setup_number(packed[k], group) + group.column + PLANE_GROUP
        for i in range(PLANE_GROUP - 1):
            out[start + (PLANE_GROUP + i) * NEXT + k] = group.numbers[first + i]
            out[start + (2 * PLANE_GROUP - 1 + i) * NEXT + k] = group.numbers[first + PLANE_GROUP + i]
