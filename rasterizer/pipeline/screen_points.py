"""Where the samples of a batch lie: side by side in a row, or anywhere.

The stages behind scan work on batches of samples. In a row of a band, the sample (x, y) where a batch begins says where
all of them lie. In a list of points, one for each polygon in a pixel (shade_once.py), arrays do. A parameter `first` is
one or the other; its type decides what is compiled.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import choice, helper, index
from ..compiler.widths import PLANE_GROUP
from ..geometry.vectors import add, dot, scale
from . import fragments as f
from .fragments import read_vector, set_vector
from .lighting import view_from_direction
from .simd import PlaneGroup, evaluate_planes, record_number, values_of_planes
from .texture_planes import copy_slopes, evaluate_slopes
from .transform import HALF, SUBPIXEL


class ScreenPoints(NamedTuple):
    """Where the points of a list lie."""

    x: np.ndarray  # (n,) int32, 1/256 of a sample's width, from the centre of the first column of samples
    y: np.ndarray  # (n,) int32, the same downwards
    step: float  # how many samples, along an axis, it is from a point to the next: what a texture is filtered for


def is_list(first) -> bool:
    """Tell whether the type of `first` is that of ScreenPoints."""
    return getattr(first, "instance_class", None) is ScreenPoints


def choose_samples(points, first, start, n):
    """Return what is compiled in the place of `samples_from`."""
    return points_of_batch if is_list(points) else samples_of_batch


@choice(choose_samples)
def samples_from(points, first, start, n):
    """Return where the samples of a batch lie.

    Parameters
    ----------
    points : ScreenPoints of a band that is a list; None of other bands
    first : the sample (x, y) that the batch begins with, in other bands
    start, n : its number in the band, and the length of the batch, both `index`
    """
    gather = points_of_batch if isinstance(points, ScreenPoints) else samples_of_batch
    return gather(points, first, start, n)


@helper
def samples_of_batch(points, first, start, n):
    """See `samples_from`."""
    return first


@helper
def points_of_batch(points, first, start, n):
    """See `samples_from`."""
    return ScreenPoints(points.x[start : start + n], points.y[start : start + n], points.step)


def choose_skip(first, k):
    """Return what is compiled in the place of `skip_to`."""
    return skip_points if is_list(first) else skip_samples


@choice(choose_skip)
def skip_to(first, k):
    """Return where the samples from number k on lie."""
    return skip_points(first, k) if isinstance(first, ScreenPoints) else skip_samples(first, k)


@helper
def skip_points(first, k):
    """See `skip_to`."""
    return ScreenPoints(first.x[k:], first.y[k:], first.step)


@helper
def skip_samples(first, k):
    """See `skip_to`."""
    return first[0] + np.int64(k), first[1]


def choose_subpixel(first, k):
    """Return what is compiled in the place of `subpixel_at`."""
    return subpixel_of_point if is_list(first) else subpixel_of_sample


@choice(choose_subpixel)
def subpixel_at(first, k):
    """Return where sample k lies, (x, y) int64, 1/256 of a sample's width from the picture's corner."""
    return subpixel_of_point(first, k) if isinstance(first, ScreenPoints) else subpixel_of_sample(first, k)


@helper
def subpixel_of_point(first, k):
    """See `subpixel_at`."""
    return np.int64(first.x[k]) + HALF, np.int64(first.y[k]) + HALF


@helper
def subpixel_of_sample(first, k):
    """See `subpixel_at`."""
    return (first[0] + np.int64(k)) * SUBPIXEL + HALF, first[1] * SUBPIXEL + HALF


def choose_step(first):
    """Return what is compiled in the place of `step_of`."""
    return step_of_points if is_list(first) else step_of_samples


@choice(choose_step)
def step_of(first):
    """Return how many samples, along an axis, it is from one of a batch to the next in the picture."""
    return step_of_points(first) if isinstance(first, ScreenPoints) else step_of_samples(first)


@helper
def step_of_points(first):
    """See `step_of`."""
    return first.step


@helper
def step_of_samples(first):
    """See `step_of`."""
    return 1.0


# ---------------------------------------------------------------- planes


def choose_offset(first, k, group, record):
    """Return what is compiled in the place of `offset_from`."""
    return offset_of_point if is_list(first) else offset_of_sample


@choice(choose_offset)
def offset_from(first, k, group, record):
    """Return how far sample k lies across and down from the one at which the planes of a record have their values,
    float32."""
    offset = offset_of_point if isinstance(first, ScreenPoints) else offset_of_sample
    return offset(first, k, group, record)


@helper
def offset_of_point(first, k, group, record):
    """See `offset_from`. What it is rounded from are multiples of 128 parts of a sample: a float32 holds them."""
    whole, part = group.numbers.view(np.int32), np.float32(1.0 / SUBPIXEL)
    across = np.int64(first.x[k]) - SUBPIXEL * np.int64(whole[record + index(1)])
    down = np.int64(first.y[k]) - SUBPIXEL * np.int64(whole[record + index(2)])
    return np.float32(across) * part, np.float32(down) * part


@helper
def offset_of_sample(first, k, group, record):
    """See `offset_from`."""
    whole = group.numbers.view(np.int32)
    across = first[0] + np.int64(k) - np.int64(whole[record + index(1)])
    return np.float32(across), np.float32(first[1] - np.int64(whole[record + index(2)]))


def choose_planes_at(entries, group, first, out, start, stride):
    """Return what is compiled in the place of `evaluate_planes_here`."""
    return planes_of_points if is_list(first) else planes_of_samples


@choice(choose_planes_at)
def evaluate_planes_here(entries, group, first, out, start, stride):
    """Evaluate a group of four planes, see `simd.evaluate_planes`."""
    evaluate = planes_of_points if isinstance(first, ScreenPoints) else planes_of_samples
    evaluate(entries, group, first, out, start, stride)


@helper
def planes_of_points(entries, group, first, out, start, stride):
    """See `evaluate_planes_here`."""
    for k in range(index(len(entries))):
        record = record_number(entries[k], group)
        across, down = offset_from(first, k, group, record)
        values = values_of_planes(group.numbers, record + group.column, across, down)
        write_row(out, start + k, stride, values)


@helper
def write_row(rows, place, stride, values):
    """Write four values of a sample, one a row."""
    rows[place], rows[place + stride] = values[0], values[1]
    rows[place + stride + stride], rows[place + stride + stride + stride] = values[2], values[3]


@helper
def planes_of_samples(entries, group, first, out, start, stride):
    """See `evaluate_planes_here`."""
    evaluate_planes(entries, group, first[0], first[1], out, start, stride)


@helper
def evaluate_values(entries, group, first, out, start, stride, weights):
    """Evaluate a group of four planes as `evaluate_planes_here`, multiply, and keep values within their ranges.

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
def within(value, numbers, least_at):
    """Return a value kept within its range; the least one where it is no number."""
    least, greatest = numbers[least_at], numbers[least_at + index(PLANE_GROUP)]
    value = value if value > least else least
    return value if value < greatest else greatest


def choose_slopes_at(entries, group, first, out, start, stride):
    """Return what is compiled in the place of `evaluate_slopes_here`."""
    return slopes_of_points if is_list(first) else slopes_of_samples


@choice(choose_slopes_at)
def evaluate_slopes_here(entries, group, first, out, start, stride):
    """Evaluate a group of four planes, and copy slopes, see `texture_planes.evaluate_slopes`."""
    evaluate = slopes_of_points if isinstance(first, ScreenPoints) else slopes_of_samples
    evaluate(entries, group, first, out, start, stride)


@helper
def slopes_of_points(entries, group, first, out, start, stride):
    """See `evaluate_slopes_here`."""
    planes_of_points(entries, group, first, out, start, stride)
    copy_slopes(entries, group, out, start, stride)


@helper
def slopes_of_samples(entries, group, first, out, start, stride):
    """See `evaluate_slopes_here`."""
    evaluate_slopes(entries, group, first[0], first[1], out, start, stride)


@helper
def evaluate_with_slopes(entries, group, first, out, start, stride, behind, behind_start):
    """Evaluate a group of four planes into four rows of `out`, and the group that stands right behind it, with slopes,
    into ten rows of `behind`, which begin at `behind_start`.

    See `simd.evaluate_planes` and `texture_planes.evaluate_slopes`.
    """
    evaluate_planes_here(entries, group, first, out, start, stride)
    next_column = group.column + index(3 * PLANE_GROUP)
    group_behind = PlaneGroup(group.numbers, group.record_mask, group.shift, next_column)
    evaluate_slopes_here(entries, group_behind, first, behind, behind_start, stride)


# ---------------------------------------------------------------- rays


@helper
def fill_positions_of_points(screen, first, n, needs_position, batch):
    """Fill positions and view directions as `phong_shading.fill_positions`, for points that lie anywhere.

    A ray is computed in float64: its parts are not longer than it is itself, with 4 roundings each, of a place, the
    step and two products or sums. Then it is rounded once: so it errs by less than what counts there.
    """
    real = batch.dtype.type
    right, up, forward = read_vector(screen.right, 0), read_vector(screen.up, 0), read_vector(screen.forward, 0)
    along, one, part = 1.0 if screen.is_perspective else 0.0, real(1), 1.0 / SUBPIXEL
    step_x, step_y = 1.0 / screen.scale_x, 1.0 / screen.scale_y
    away = real(forward[0]), real(forward[1]), real(forward[2])
    if not screen.is_perspective:
        view_from_direction(batch, n, scale(away, -one))
    for k in range(index(n)):
        upward = (screen.center_y - (float(first.y[k]) * part + 0.5)) * step_y
        across = ((float(first.x[k]) * part + 0.5 - screen.center_x) + screen.skew * upward) * step_x
        exact = add(add(scale(right, across), scale(up, upward)), scale(forward, along))
        ray = real(exact[0]), real(exact[1]), real(exact[2])
        if screen.is_perspective:
            set_vector(batch, f.VIEW_DIR, k, scale(ray, -one / np.sqrt(dot(ray, ray))))
            if needs_position:
                set_vector(batch, f.POSITION, k, scale(ray, batch[f.DISTANCE + k]))
        elif needs_position:
            set_vector(batch, f.POSITION, k, add(ray, scale(away, batch[f.DISTANCE + k])))
