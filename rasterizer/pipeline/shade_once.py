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

Depth at the centre is the mean of the samples' depths, which is exact but for half a unit: depth is affine.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from ..compiler.widths import PLANE_GROUP, POINT_UNIT
from .gradients import NEEDS_TEXTURE
from .interpolate import ScannedBand
from .places import Places
from .records import material_of
from .visibility import CLEAR, IS_ID, LEVEL_MASK, NO_END, NO_START, PAYLOAD_BITS, VisibilityBuffer, strip_of

PAYLOAD_MASK = np.int64(IS_ID | LEVEL_MASK)
NO_POINT = np.int32(-1)


class PointList(NamedTuple):
    """Memory for the points of a band, and for what is found at them."""

    visibility: VisibilityBuffer  # of one row: an entry for each point
    x: np.ndarray  # (n_row * pitch,) int32, see `Places`
    y: np.ndarray
    numbers: np.ndarray  # (n_row * pitch,) int32: the point of each sample, or NO_POINT
    radiance: np.ndarray  # (n_channel, n_row * pitch), of the points

    def band(self, band: ScannedBand, factor) -> ScannedBand:
        """Return the list as a band that the shade stage takes, after `list_points`."""
        places = Places(self.x, self.y, float(factor))
        return band._replace(visibility=self.visibility, y_start=0, n_row=1, places=places)


def make_point_list(n_sample, n_channel, dtype) -> PointList:
    """Return room for the points of bands of `n_sample` samples."""
    starts, ends = (np.full((2, 1), edge) for edge in (NO_START, NO_END))
    buffer = VisibilityBuffer(
        np.full(n_sample, CLEAR), n_sample, n_sample, starts[0], ends[0], np.full(1, np.int64(-1)), starts[1], ends[1]
    )
    x, y, numbers = (np.zeros(n_sample, np.int32) for _ in range(3))
    return PointList(buffer, x, y, numbers, np.zeros((n_channel, n_sample), dtype))


def order_samples(factor) -> np.ndarray:
    """Return the samples of a pixel, those nearest to its centre first, (factor²,) int64, counted row by row."""
    rows, columns = np.divmod(np.arange(factor * factor), factor)
    distances = (2 * rows - factor + 1) ** 2 + (2 * columns - factor + 1) ** 2
    return np.argsort(distances, kind="stable")


@kernel
def list_points(band, factor, order, is_textured, out):
    """List the points of a band that are shaded.

    Parameters
    ----------
    band : ScannedBand, a whole number of pixels high
    factor : samples a pixel along each axis
    order : what `order_samples` returns
    is_textured : whether textured surfaces alone are wanted
    out : PointList, written
    """
    visibility, points, n = band.visibility, out.visibility, index(0)
    for top in range(0, band.n_row, factor):
        first, end = columns_of_pixels(visibility, top, factor)
        for column in range(first, end, factor):
            start = index(top * visibility.pitch + column)
            n = list_pixel(band, (column, top), start, factor, order, is_textured, n, out)
    for k in range(n, n + index(PLANE_GROUP)):  # which may be read, too
        points.entries[k] = CLEAR
    points.left[0], points.right[0] = 0, np.int64(n)
    points.other_left[0], points.other_right[0] = 0, np.int64(n)


@helper
def columns_of_pixels(visibility, top, factor):
    """Return the columns of samples of the pixels, whose first row is `top`, that may show something; half-open."""
    left, right = np.int64(visibility.width), np.int64(0)
    for row in range(top, top + factor):
        strip = strip_of(row)
        left, right = min(left, visibility.left[strip]), max(right, visibility.right[strip])
    return left // factor * factor, right


@helper
def list_pixel(band, sample, start, factor, order, is_textured, n, out):
    """List the points of a pixel behind n others; return how many there are now.

    `sample` is the column and the row, in the band, of its first sample, `start` that one's number.
    """
    entries, entry = band.visibility.entries, band.visibility.entries[start]
    pitch, difference, total = index(band.visibility.pitch), np.int64(0), np.int64(0)
    for row in range(index(factor)):
        for k in range(start + row * pitch, start + row * pitch + index(factor)):
            difference |= entries[k] ^ entry
            total += entries[k] >> PAYLOAD_BITS
    if difference & PAYLOAD_MASK != 0:
        return list_mixed(band, sample, start, factor, order, is_textured, n, out)
    number = NO_POINT
    if is_listed(entry, band, is_textured):
        n_sample, number = np.int64(factor * factor), np.int32(n)
        depth = (total + (n_sample >> 1)) // n_sample
        out.visibility.entries[n] = (depth << PAYLOAD_BITS) | (entry & PAYLOAD_MASK)
        half = (factor - 1) * (POINT_UNIT // 2)
        out.x[n] = sample[0] * POINT_UNIT + half
        out.y[n] = (band.y_start + sample[1]) * POINT_UNIT + half
        n += index(1)
    for row in range(index(factor)):
        for k in range(start + row * pitch, start + row * pitch + index(factor)):
            out.numbers[k] = number
    return n


@helper
def list_mixed(band, sample, start, factor, order, is_textured, n, out):
    """List the points of a pixel that shows several surfaces, see `list_pixel`."""
    entries, listed, first = band.visibility.entries, out.visibility.entries, n
    for k in range(index(len(order))):
        row, column = order[k] // factor, order[k] % factor
        here = start + index(row * band.visibility.pitch + column)
        number = NO_POINT
        if is_listed(entries[here], band, is_textured):
            point = first
            while point < n and (listed[point] ^ entries[here]) & PAYLOAD_MASK != 0:
                point += index(1)
            if point == n:
                listed[n] = entries[here]
                out.x[n] = (sample[0] + column) * POINT_UNIT
                out.y[n] = (band.y_start + sample[1] + row) * POINT_UNIT
                n += index(1)
            number = np.int32(point)
        out.numbers[here] = number
    return n


@helper
def is_listed(entry, band, is_textured):
    """Tell whether a sample is shaded at a point: it shows a record, and a textured one where only those are wanted."""
    if entry & IS_ID == 0:
        return False
    return not is_textured or band.coding.needs[material_of(entry, band.records)] & NEEDS_TEXTURE != 0


@kernel
def spread_points(visibility, n_row, points, radiance, out_radiance):
    """Give the samples of a band the intensities of their points; those that have none are left as they are.

    Parameters
    ----------
    visibility : of the band
    n_row : rows of the band
    points : PointList, after `list_points`
    radiance : (n_channel, n_row * pitch), of the points
    out_radiance : (n_channel, n_row * pitch), of the same type; changed
    """
    for j in range(n_row):
        strip = strip_of(j)
        left, right = visibility.left[strip], visibility.right[strip]
        if left < right:
            start, n = index(j * visibility.pitch + left), index(right - left)
            numbers = points.numbers[start : start + n]
            for channel in range(index(radiance.shape[0])):
                out, source = out_radiance[channel, start : start + n], radiance[channel]
                for k in range(n):
                    point = index(max(numbers[k], np.int32(0)))
                    out[k] = source[point] if numbers[k] != NO_POINT else out[k]
