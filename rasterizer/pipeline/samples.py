"""Where the samples of a batch lie: side by side in a row, or anywhere; and what planes of records are there.

The stages behind scan work on batches of samples. In a row of a band, the sample (x, y) where a batch begins says where
all of them lie. In a list of points, one for each polygon in a pixel (shade_once.py), arrays do. A parameter `first` is
one or the other; its type decides what is compiled.

Planes stand in records (records.py), four side by side. Of samples in a row they are evaluated by vector instructions,
which intrinsics.py spells out for the compiler: it wouldn't find them for loops of four planes by itself.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import choice, class_of, helper, index, spelled_out
from .transform import HALF, SUBPIXEL
from .visibility import LEVEL_BITS


class ScreenPoints(NamedTuple):
    """Where the points of a list lie."""

    x: np.ndarray  # (n,) int32, 1/256 of a sample's width, from the centre of the first column of samples
    y: np.ndarray  # (n,) int32, the same downwards
    step: float  # how many samples, along an axis, it is from a point to the next: what a texture is filtered for


def is_list(first) -> bool:
    """Tell whether the type of `first` is that of ScreenPoints."""
    return class_of(first) is ScreenPoints


@choice
def samples_from(points, first, start, n):
    """Return where the samples of a batch lie.

    Parameters
    ----------
    points : ScreenPoints of a band that is a list; None of other bands
    first : the sample (x, y) that the batch begins with, in other bands
    start, n : its number in the band, and the length of the batch, both `index`
    """
    return points_of_batch if is_list(points) else samples_of_batch


@helper
def samples_of_batch(points, first, start, n):
    """See `samples_from`."""
    return first


@helper
def points_of_batch(points, first, start, n):
    """See `samples_from`."""
    return ScreenPoints(points.x[start : start + n], points.y[start : start + n], points.step)


@choice
def skip_to(first, k):
    """Return where the samples from number k on lie."""
    return skip_points if is_list(first) else skip_samples


@helper
def skip_points(first, k):
    """See `skip_to`."""
    return ScreenPoints(first.x[k:], first.y[k:], first.step)


@helper
def skip_samples(first, k):
    """See `skip_to`."""
    return first[0] + np.int64(k), first[1]


@choice
def subpixel_at(first, k):
    """Return where sample k lies, (x, y) int64, 1/256 of a sample's width from the picture's corner."""
    return subpixel_of_point if is_list(first) else subpixel_of_sample


@helper
def subpixel_of_point(first, k):
    """See `subpixel_at`."""
    return np.int64(first.x[k]) + HALF, np.int64(first.y[k]) + HALF


@helper
def subpixel_of_sample(first, k):
    """See `subpixel_at`."""
    return (first[0] + np.int64(k)) * SUBPIXEL + HALF, first[1] * SUBPIXEL + HALF


@choice
def step_of(first):
    """Return how many samples, along an axis, it is from one of a batch to the next in the picture."""
    return step_of_points if is_list(first) else step_of_samples


@helper
def step_of_points(first):
    """See `step_of`."""
    return first.step


@helper
def step_of_samples(first):
    """See `step_of`."""
    return 1.0


# ---------------------------------------------------------------- planes

PLANE_GROUP = 4  # planes that stand side by side in a record, and samples whose texels are read so


class PlaneGroup(NamedTuple):
    """Four planes of every record, side by side: PLANE_GROUP values, as many d/dx, as many d/dy; then, where samples
    must stay within a range, as many least and greatest values."""

    numbers: np.ndarray  # (n << shift,) float32, the records
    record_mask: int  # int64, the bits of an entry that are the index of a record
    shift: int  # uint64: a record begins at these bits shifted left
    column: int  # uint64, where the group begins in a record


@choice
def evaluate_planes(entries, group, first, out, start, stride):
    """Evaluate a group of four planes at the samples of a batch: the inner loop of the shade stage.

    The second and third number of a record are whole ones: the sample at which its planes have their values. Float32 is
    rounded after each operation, in this order. Samples up to the next multiple of LANES may be read and written, too.

    Parameters
    ----------
    entries : (n,) int64; of those without the index of a record, the values of record 0
    group : PlaneGroup
    first : where the samples lie
    out : (n,) float32; written from `start` on, a row a plane, `stride` apart, both uint64
    """
    return planes_of_points if is_list(first) else planes_of_samples


@helper
def planes_of_points(entries, group, first, out, start, stride):
    """See `evaluate_planes`."""
    for k in range(index(len(entries))):
        record = record_number(entries[k], group)
        across, down = offset_from(first, k, group, record)
        write_row(out, start + k, stride, values_of_planes(group.numbers, record + group.column, across, down))


@helper
def write_row(rows, place, stride, values):
    """Write four values of a sample, one a row."""
    rows[place], rows[place + stride] = values[0], values[1]
    rows[place + stride + stride], rows[place + stride + stride + stride] = values[2], values[3]


@helper
def planes_of_samples(entries, group, first, out, start, stride):
    """See `evaluate_planes`."""
    planes_of_row(entries, group, first, out, start, stride)


@spelled_out("build_planes_of_row")
def planes_of_row(entries, group, first, out, start, stride):
    """See `evaluate_planes`."""
    for k in range(index(len(entries))):
        record = record_number(entries[k], group)
        across, down = offset_of_sample(first, k, group, record)
        write_row(out, start + k, stride, values_of_planes(group.numbers, record + group.column, across, down))


@helper
def record_number(entry, group):
    """Return where the record that an entry shows begins, an `index`; 0 where it shows none."""
    mask = group.record_mask if entry >> LEVEL_BITS & 1 else np.int64(0)
    return index(entry & mask) << group.shift


@helper
def values_of_planes(numbers, plane, across, down):
    """Return the values of four planes beside the sample where they have their values; float32 is rounded after each
    operation."""
    return (
        value_beside(numbers, plane, across, down),
        value_beside(numbers, plane + index(1), across, down),
        value_beside(numbers, plane + index(2), across, down),
        value_beside(numbers, plane + index(3), across, down),
    )


@helper
def value_beside(numbers, plane, across, down):
    """Return the value of one plane, see `values_of_planes`."""
    value = numbers[plane] + across * numbers[plane + index(PLANE_GROUP)]
    return value + down * numbers[plane + index(2 * PLANE_GROUP)]


@choice
def offset_from(first, k, group, record):
    """Return how far sample k lies across and down from the one at which the planes of a record have their values,
    float32."""
    return offset_of_point if is_list(first) else offset_of_sample


@helper
def offset_of_point(first, k, group, record):
    """See `offset_from`. What it is rounded from are multiples of 128 parts of a sample: a float32 holds them."""
    anchor, part = anchor_of(group, record), np.float32(1.0 / SUBPIXEL)
    across = np.int64(first.x[k]) - SUBPIXEL * anchor[0]
    down = np.int64(first.y[k]) - SUBPIXEL * anchor[1]
    return np.float32(across) * part, np.float32(down) * part


@helper
def offset_of_sample(first, k, group, record):
    """See `offset_from`."""
    anchor = anchor_of(group, record)
    return np.float32(first[0] + np.int64(k) - anchor[0]), np.float32(first[1] - anchor[1])


@helper
def anchor_of(group, record):
    """Return the sample at which the planes of a record have their values: where four numbers are whole ones' bits."""
    x, y = np.float32(group.numbers[record + index(1)]), np.float32(group.numbers[record + index(2)])
    return np.int64(x.view(np.int32)), np.int64(y.view(np.int32))


# ---------------------------------------------------------------- values within their ranges


@helper
def evaluate_values(entries, group, first, out, start, stride, weights):
    """Evaluate a group of four planes as `evaluate_planes` does, multiply, and keep values within their ranges.

    Parameters
    ----------
    group : PlaneGroup, in whose records the least values stand behind the planes, then the greatest
    out : (n,) float32, to which the rows are written
    weights : uint64, where in `out` the factors of the samples begin
    """
    numbers, behind = group.numbers, index(3 * PLANE_GROUP)
    for k in range(index(len(entries))):
        record = record_number(entries[k], group)
        across, down = offset_from(first, k, group, record)
        plane, weight = record + group.column, out[weights + k]
        v0, v1, v2, v3 = values_of_planes(numbers, plane, across, down)
        values = (
            within(v0 * weight, numbers, plane + behind),
            within(v1 * weight, numbers, plane + behind + index(1)),
            within(v2 * weight, numbers, plane + behind + index(2)),
            within(v3 * weight, numbers, plane + behind + index(3)),
        )
        write_row(out, start + k, stride, values)


@helper
def within(value, numbers, min_at):
    """Return a value kept within its range; the least one where it is no number."""
    least, greatest = numbers[min_at], numbers[min_at + index(PLANE_GROUP)]
    value = value if value > least else least
    return value if value < greatest else greatest


# ---------------------------------------------------------------- planes with their slopes


@choice
def evaluate_with_slopes(entries, group, first, out, start, stride, behind, behind_start):
    """Evaluate a group of four planes into four rows of `out`, and the group that stands right behind it, with slopes,
    into ten rows of `behind`, which begin at `behind_start`.

    See `evaluate_planes` and `evaluate_slopes`.
    """
    return both_of_points if is_list(first) else both_of_samples


@helper
def both_of_points(entries, group, first, out, start, stride, behind, behind_start):
    """See `evaluate_with_slopes`."""
    planes_of_points(entries, group, first, out, start, stride)
    slopes_of_points(entries, group_behind(group), first, behind, behind_start, stride)


@helper
def both_of_samples(entries, group, first, out, start, stride, behind, behind_start):
    """See `evaluate_with_slopes`."""
    both_of_row(entries, group, first, out, start, stride, behind, behind_start)


@spelled_out("build_both_of_row")
def both_of_row(entries, group, first, out, start, stride, behind, behind_start):
    """See `evaluate_with_slopes`."""
    planes_of_row(entries, group, first, out, start, stride)
    slopes_of_row(entries, group_behind(group), first, behind, behind_start, stride)


@helper
def group_behind(group):
    """Return the group of planes that stands right behind another one."""
    return PlaneGroup(group.numbers, group.record_mask, group.shift, group.column + index(3 * PLANE_GROUP))


@choice
def evaluate_slopes(entries, group, first, out, start, stride):
    """Evaluate a group of four planes as `evaluate_planes` does, and copy the slopes of three for each sample.

    Ten rows are written: the planes, then d/dx of the first three, then d/dy of these.
    """
    return slopes_of_points if is_list(first) else slopes_of_samples


@helper
def slopes_of_points(entries, group, first, out, start, stride):
    """See `evaluate_slopes`."""
    planes_of_points(entries, group, first, out, start, stride)
    copy_slopes(entries, group, out, start, stride)


@helper
def slopes_of_samples(entries, group, first, out, start, stride):
    """See `evaluate_slopes`."""
    slopes_of_row(entries, group, first, out, start, stride)


@spelled_out("build_slopes_of_row")
def slopes_of_row(entries, group, first, out, start, stride):
    """See `evaluate_slopes`."""
    planes_of_row(entries, group, first, out, start, stride)
    copy_slopes(entries, group, out, start, stride)


@helper
def copy_slopes(entries, group, out, start, stride):
    """Copy the slopes of three planes for each sample: d/dx of each, then d/dy, behind the planes."""
    for k in range(index(len(entries))):
        first = record_number(entries[k], group) + group.column + index(PLANE_GROUP)
        for i in range(index(PLANE_GROUP - 1)):
            out[start + (index(PLANE_GROUP) + i) * stride + k] = group.numbers[first + i]
            out[start + (index(2 * PLANE_GROUP - 1) + i) * stride + k] = group.numbers[first + index(PLANE_GROUP) + i]
