"""Shading once a pixel and polygon, between scan and shade: the points of a band that are shaded, and afterwards their
intensities for all samples.

In:  a band after the scan stage, with several samples a pixel.
Out: a list of points, which the shade stage takes for a band of one row (`PointList.band`); and, once it has radiance,
     the radiance of the band's samples.

The samples of a pixel that show the same record are shaded together, at one point of the polygon. Where a polygon
covers the whole pixel, that is the pixel's centre: it lies within the convex hull of the samples, so within the
polygon. Else it is the covered sample that is nearest to the centre, the first one of these. So nothing is ever
extrapolated. (What OpenGL and Direct3D call multisampling with centroid sampling.)

    B B | B B      a, b, c, d: the points that are shaded. The right pixel shows one polygon, so it is shaded at its
    A b | .d.      centre; in the left one A and B are shaded at a sample each, b being the first of three.
    a   | B B

Depth at the centre is the mean of the samples' depths, because depth is affine. It errs no more than theirs
(`setup.depth_rounding`), rounded to a unit as it is: their mean distance from where the plane has its value is shorter
than the largest one by half a sample or more along each axis, and half a unit a sample counts there.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from .fragments import BATCH_SIZE
from .gradients import HAS_TEXTURE
from .interpolate import ScannedBand
from .records import material_of
from .samples import ScreenPoints
from .transform import SUBPIXEL
from .visibility import (
    CLEAR,
    IS_ID,
    LANES,
    LEVEL_MASK,
    NO_END,
    NO_START,
    PAYLOAD_BITS,
    VisibilityBuffer,
    extent_of_pixels,
)

PAYLOAD_MASK = np.int64(IS_ID | LEVEL_MASK)
NO_POINT, SEVERAL = np.int32(-1), np.int32(-2)
MAX_SAMPLES = index(16)  # of a pixel
PIECE = 64  # pixels that are listed together: those that show a record each take a shorter path


class PointList(NamedTuple):
    """Memory for the points of a band, and for what is found at them."""

    visibility: VisibilityBuffer  # of one row: an entry for each point
    x: np.ndarray  # (n_row * pitch,) int32, see `ScreenPoints`
    y: np.ndarray
    pixels: np.ndarray  # (n_row // factor, width // factor) int32: the point of each pixel, or NO_POINT, or SEVERAL
    numbers: np.ndarray  # (n_row * pitch,) int32: the point of each sample, or NO_POINT, in pixels that have SEVERAL
    radiance: np.ndarray  # (n_channel, n_row * pitch), of the points
    is_spread: np.ndarray  # (1,) bool: the samples of the band have radiance
    scratch: np.ndarray  # (3, BATCH_SIZE) int64

    def band(self, band: ScannedBand, factor) -> ScannedBand:
        """Return the list as a band that the shade stage takes, after `list_points`."""
        points = ScreenPoints(self.x, self.y, float(factor))
        return band._replace(visibility=self.visibility, y_start=0, n_row=1, points=points)


def make_point_list(visibility: VisibilityBuffer, n_row, factor, n_channel, dtype) -> PointList:
    """Return room for the points of bands of `n_row` rows, with `factor` samples a pixel along each axis."""
    n_sample, pixels = len(visibility.entries), (n_row // factor, visibility.width // factor)
    starts, ends = (np.full((2, 1), edge) for edge in (NO_START, NO_END))
    buffer = VisibilityBuffer(
        np.full(n_sample, CLEAR), n_sample, n_sample, starts[0], ends[0], np.full(1, np.int64(-1)), starts[1], ends[1]
    )
    x, y, numbers = (np.zeros(n_sample, np.int32) for _ in range(3))
    radiance, scratch = np.zeros((n_channel, n_sample), dtype), np.zeros((3, BATCH_SIZE), np.int64)
    return PointList(buffer, x, y, np.zeros(pixels, np.int32), numbers, radiance, np.zeros(1, np.bool_), scratch)


def order_samples(factor) -> np.ndarray:
    """Return the samples of a pixel, those nearest to its centre first, (factor²,) int64, counted row by row."""
    rows, columns = np.divmod(np.arange(factor * factor), factor)
    distances = (2 * rows - factor + 1) ** 2 + (2 * columns - factor + 1) ** 2
    return np.argsort(distances, kind="stable")


@kernel
def list_points(band, grid, order, is_textured, out):
    """List the points of a band that are shaded.

    Parameters
    ----------
    band : ScannedBand, a whole number of pixels high
    grid : SampleGrid
    order : what `order_samples` returns
    is_textured : whether textured surfaces alone are wanted
    out : PointList, written
    """
    visibility, points, n, factor = band.visibility, out.visibility, index(0), factor_of(grid)
    for row in range(0, band.n_row, factor):
        first, end = extent_of_pixels(visibility, row, factor, visibility.width)
        for left in range(first, end, PIECE):
            n_pixel = index(min(end - left, PIECE))
            n = list_batch(band, (row, left), index(factor), n_pixel, order, is_textured, n, out)
    for k in range(n, n + index(LANES)):  # which may be read, too
        points.entries[k] = CLEAR
    points.left[0], points.right[0] = 0, np.int64(n)
    points.other_left[0], points.other_right[0] = 0, np.int64(n)
    out.is_spread[0] = False


@helper
def list_batch(band, first, factor, n_pixel, order, is_textured, n, out):
    """List the points of a row's pixels behind n others; return how many there are now.

    `first` is the band's row of samples and the column of pixels where the batch begins; `factor` an `index`.
    """
    (row, left), visibility = first, band.visibility
    differences, totals, mixed = out.scratch[0], out.scratch[1], out.scratch[2]
    start, pitch = index(row * visibility.pitch + left * np.int64(factor)), index(visibility.pitch)
    entries = visibility.entries[start : start + (factor - index(1)) * pitch + n_pixel * factor]
    is_whole = compare_samples(entries, pitch, factor, n_pixel, differences, totals)
    pixels, n_mixed = out.pixels[index(row) // factor, index(left) :], index(0)
    if is_whole and not is_textured:
        return list_whole(band, first, factor, entries, totals, pixels[:n_pixel], n, out)
    n_sample, half = factor * factor, np.int32((np.int64(factor) - 1) * (SUBPIXEL // 2))
    y = np.int32((band.y_start + row) * SUBPIXEL) + half
    for i in range(n_pixel):
        entry, is_uniform = entries[i * factor], differences[i] == 0
        is_point = is_uniform and is_listed(entry, band, is_textured)
        # Written whether it is a point or not: the next one takes the same place.
        depth = np.int64((index(totals[i]) + n_sample // index(2)) // n_sample)
        out.visibility.entries[n] = (depth << PAYLOAD_BITS) | (entry & PAYLOAD_MASK)
        out.x[n] = np.int32((left + np.int64(i)) * np.int64(factor) * SUBPIXEL) + half
        out.y[n] = y
        pixels[i] = np.int32(n) if is_point else NO_POINT if is_uniform else SEVERAL
        mixed[n_mixed] = np.int64(i)
        n += index(is_point)
        n_mixed += index(not is_uniform)
    for k in range(n_mixed):
        skipped = index(mixed[k])
        here = row, (left + mixed[k]) * np.int64(factor)
        n = list_mixed(band, here, start + skipped * factor, factor, order, is_textured, n, out)
    return n


@helper
def compare_samples(entries, pitch, factor, n_pixel, differences, totals):
    """Fill what the payloads of each pixel's samples differ by, 0 where all are the same, and the sum of their depths;
    tell whether all pixels show one record each."""
    of_all, common = np.int64(0), IS_ID
    for i in range(n_pixel):
        first, difference, total = entries[i * factor], np.int64(0), np.int64(0)
        for row in range(factor):
            for k in range(factor):
                entry = entries[row * pitch + i * factor + k]
                difference |= entry ^ first
                total += entry >> PAYLOAD_BITS
        differences[i], totals[i] = difference & PAYLOAD_MASK, total
        of_all |= difference & PAYLOAD_MASK
        common &= first
    return of_all == 0 and common != 0


@helper
def list_whole(band, first, factor, entries, totals, pixels, n, out):
    """List a point for each of a row's pixels behind n others; return how many there are now."""
    (row, left), n_sample, n_pixel = first, factor * factor, index(len(pixels))
    half = np.int32((np.int64(factor) - 1) * (SUBPIXEL // 2))
    y, x = np.int32((band.y_start + row) * SUBPIXEL) + half, np.int32(left * np.int64(factor) * SUBPIXEL) + half
    step, number = np.int32(np.int64(factor) * SUBPIXEL), np.int32(n)
    listed, xs, ys = out.visibility.entries[n : n + n_pixel], out.x[n : n + n_pixel], out.y[n : n + n_pixel]
    for i in range(n_pixel):
        depth = np.int64((index(totals[i]) + n_sample // index(2)) // n_sample)
        listed[i] = (depth << PAYLOAD_BITS) | (entries[i * factor] & PAYLOAD_MASK)
    for i in range(n_pixel):
        xs[i], ys[i] = np.int32(x + np.int32(step * np.int32(i))), y
        pixels[i] = np.int32(number + np.int32(i))
    return n + n_pixel


@helper
def list_mixed(band, first, start, factor, order, is_textured, n, out):
    """List the points of a pixel that shows several surfaces behind n others; return how many there are now.

    `first` is the band's row and the column of its first sample, `start` that one's number. Without branches: which
    samples show the same is a matter of chance.
    """
    entries, pitch, keys, numbers = band.visibility.entries, index(band.visibility.pitch), out.scratch[0], out.numbers
    left, top = np.int32(first[1] * SUBPIXEL), np.int32((band.y_start + first[0]) * SUBPIXEL)
    for k in range(factor * factor):
        row, column = index(order[k]) // factor, index(order[k]) % factor
        here = start + row * pitch + column
        key = entries[here] & PAYLOAD_MASK
        is_point = is_listed(entries[here], band, is_textured)
        number, is_new = n, True
        for other in range(k):
            is_same = keys[other] == key
            number = index(keys[MAX_SAMPLES + other]) if is_same else number
            is_new = is_new & (not is_same)
        keys[k], keys[MAX_SAMPLES + k] = key, np.int64(number)
        numbers[here] = np.int32(number) if is_point else NO_POINT
        # Written whether it is a new point or not: the next one takes the same place.
        out.visibility.entries[n] = entries[here]
        out.x[n] = np.int32(left + np.int32(np.int64(column) * SUBPIXEL))
        out.y[n] = np.int32(top + np.int32(np.int64(row) * SUBPIXEL))
        n += index(is_new & is_point)
    return n


@helper
def is_listed(entry, band, is_textured):
    """Tell whether a sample is shaded at a point: it shows a record, and a textured one where only those are wanted."""
    if entry & IS_ID == 0:
        return False
    return not is_textured or band.coding.features[material_of(entry, band.records)] & HAS_TEXTURE != 0


@kernel
def spread_points(visibility, n_row, factor, points, radiance, out_radiance):
    """Give the samples of a band the intensities of their points; those that have none are left as they are.

    Parameters
    ----------
    visibility : of the band
    n_row : rows of the band
    factor : samples a pixel along each axis
    points : PointList, after `list_points`
    radiance : (n_channel, n_row * pitch), of the points
    out_radiance : (n_channel, n_row * pitch), of the same type; changed
    """
    points.is_spread[0] = True
    for j in range(n_row):
        first, end = extent_of_pixels(visibility, j // factor * factor, factor, visibility.width)
        pixels = points.pixels[index(j // factor)]
        for column in range(first * factor, end * factor):
            sample = index(j * visibility.pitch + column)
            point = pixels[index(column // factor)]
            point = points.numbers[sample] if point == SEVERAL else point
            if point != NO_POINT:
                for channel in range(index(radiance.shape[0])):
                    out_radiance[channel, sample] = radiance[channel, index(point)]


# ---------------------------------------------------------------- how many samples a pixel has

# As a type: each number of them has kernels of its own. Loops over the samples of a pixel are unrolled, and those over
# pixels become vector instructions, where the number is known when they are compiled. A picture has one number of
# samples: so one such loop is compiled, not one for each.

MAX_FACTOR = 4  # samples a pixel along an axis


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
