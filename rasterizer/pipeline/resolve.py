"""Stage 7, resolve: a band's intensities into pixels of the picture, while they are in the cache.

In:  the band's visibility entries (what is covered) and radiance (linear intensities).
Out: all of the band's rows of the picture: linear colour float32, and, by the encode stage, 8 bits a channel. The
     visibility buffer is left clear for the next band.

Samples are averaged over each pixel (box_filter.py) where there are several; a pixel's colour is the mean of its
covered samples in linear light, its alpha the covered fraction.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from .box_filter import PIECE, average_points, average_samples
from .encode import ALPHA, PIXELS_SHAPE, RANGE_CLAMP, encode_batch
from .fragments import BATCH_SIZE, NEXT
from .sample_grid import MOST_FACTOR, factor_of
from .visibility import clear, extent_of_pixels


class Picture(NamedTuple):
    """What is written; an array that isn't wanted has no rows."""

    color: np.ndarray  # (height, width, 3) float32, linear
    rgba: np.ndarray  # (height, width) uint32, a pixel's bytes in memory order red, green, blue, alpha
    alpha: np.ndarray  # (height, width) float32


class PixelBatch(NamedTuple):
    """A batch of pixels on their way into the picture; see encode.py for what stands where."""

    values: np.ndarray  # PIXELS_SHAPE float32, linear colours and alpha
    levels: np.ndarray  # PIXELS_SHAPE int32
    sums: np.ndarray  # PIXELS_SHAPE float64: of the samples' colours, and of their weights
    weights: np.ndarray  # (PIECE * MOST_FACTOR,) float64, of a row's samples


def make_pixel_batch() -> PixelBatch:
    """Return the batch of pixels of one thread."""
    values, levels = np.zeros(PIXELS_SHAPE, np.float32), np.zeros(PIXELS_SHAPE, np.int32)
    return PixelBatch(values, levels, np.zeros(PIXELS_SHAPE), np.zeros(int(PIECE) * MOST_FACTOR))


def resolve(visibility, radiance, translucent, rows, grid, encoding, batch, out) -> int:
    """Write rows of the picture from a band; clear the band.

    Parameters
    ----------
    visibility : of the band
    radiance : (n_channel, n_row * pitch) float32 or float64, linear
    translucent : Translucent, the samples that nothing opaque is behind (layers.py), or None where there are none
    rows : (first, end) of the pixels; the band's rows are as many times that as a pixel has samples along an axis
    grid : SampleGrid
    encoding : Encoding
    batch : PixelBatch, scratch
    out : Picture

    Returns
    -------
    how many samples are covered
    """
    if translucent is not None:
        return resolve_translucent(visibility, radiance, translucent, rows, grid, encoding, batch, out)
    return resolve_averages(visibility, radiance, None, rows, grid, encoding, batch, out)


# ---------------------------------------------------------------- kernels


@kernel
def resolve_averages(visibility, radiance, points, rows, grid, encoding, batch, out):
    """Average the samples of each pixel and write it; clear the band; return how many samples are covered.

    `points` is PointList, the points that pixels are shaded at, of all that the band shows (shade_once.py), and
    `radiance` theirs; or None, and `radiance` that of the samples.
    """
    n_covered, factor, (y_start, y_end) = np.int64(0), factor_of(grid), rows
    for j in range(y_start, y_end):
        row = (j - y_start) * factor
        first, end = begin_row(visibility, row, factor, j, encoding, out)
        for left in range(first, end, BATCH_SIZE):
            n = index(min(end - left, BATCH_SIZE))
            if points is not None:
                n_covered += average_points(visibility.pitch, points, radiance, (row, left), grid, n, batch.values)
            else:
                n_covered += average_samples(visibility, radiance, None, (row, left), grid, n, batch)
            write_pixels(batch, n, radiance.shape[0], encoding, (j, left), out)
    clear(visibility, (y_end - y_start) * factor)
    return n_covered


@kernel
def resolve_translucent(visibility, radiance, translucent, rows, grid, encoding, batch, out):
    """As `resolve_averages`, where samples may show something transparent and nothing opaque: in some columns."""
    n_covered, n_channel, (y_start, y_end) = np.int64(0), radiance.shape[0], rows
    factor = factor_of(grid)
    for j in range(y_start, y_end):
        row = (j - y_start) * factor
        first, end = begin_row(visibility, row, factor, j, encoding, out)
        weighted, weighted_end = extent_of_pixels(translucent, row, factor, visibility.width)
        weighted, weighted_end = (weighted, weighted_end) if weighted < weighted_end else (end, end)
        left = first
        while left < end:
            is_weighted = weighted <= left < weighted_end
            stretch_end = weighted if left < weighted else weighted_end if is_weighted else end
            n, here = index(min(stretch_end - left, BATCH_SIZE)), (row, left)
            if is_weighted:
                n_covered += average_samples(visibility, radiance, translucent, here, grid, n, batch)
            else:
                n_covered += average_samples(visibility, radiance, None, here, grid, n, batch)
            write_pixels(batch, n, n_channel, encoding, (j, left), out)
            left += np.int64(n)
    clear(visibility, (y_end - y_start) * factor)
    return n_covered


@helper
def write_pixels(batch, n, n_channel, encoding, first, out):
    """Write n pixels of a batch that have `n_channel` channels; `first` is the row and the column of the first one."""
    (j, left), pixels = first, batch.values
    # One channel of pixels is enough where no more is read: in a grey picture of bytes.
    is_single = encoding.is_grey and encoding.policy == RANGE_CLAMP and out.color.shape[0] == 0
    if n_channel == 1 and not is_single:
        tint_pixels(pixels, n, encoding)
    if encoding.has_background:
        show_background(pixels, n, encoding, 1 if is_single else 3)
    if out.color.shape[0] > 0:
        write_colors(pixels, n, out.color[index(j), index(left) :], out.alpha[index(j), index(left) :])
    if out.rgba.shape[0] > 0:
        encode_batch(pixels, batch.levels, n, encoding, out.rgba[index(j), index(left) :])


@helper
def begin_row(visibility, row, factor, j, encoding, out):
    """Fill what is blank in row j of the picture; return the columns of pixels that any sample of `factor` rows of the
    band, from `row` on, may cover, half-open."""
    first, end = extent_of_pixels(visibility, row, factor, visibility.width)
    fill_blank(out, j, first, end, encoding)
    return first, end


@helper
def fill_blank(out, j, first, end, encoding):
    """Fill a row's pixels on both sides of first..end, where nothing is drawn, with the background, or with
    transparent black."""
    red, green, blue = encoding.background[0], encoding.background[1], encoding.background[2]
    alpha, blank = np.float32(1) if encoding.has_background else np.float32(0), np.uint32(encoding.blank)
    for left, right in ((0, first), (end, out.rgba.shape[1])):
        for i in range(index(left), index(right)):
            out.rgba[index(j), i] = blank
        if out.color.shape[0] > 0:
            for i in range(index(left), index(right)):
                out.color[index(j), i, 0] = red
                out.color[index(j), i, 1] = green
                out.color[index(j), i, 2] = blue
                out.alpha[index(j), i] = alpha


# ---------------------------------------------------------------- pixels


@helper
def tint_pixels(pixels, n, encoding):
    """Make three channels of one: multiples of the picture's tint."""
    red, green, blue = encoding.tint[0], encoding.tint[1], encoding.tint[2]
    for i in range(n):
        intensity = pixels[i]
        pixels[i] = intensity * red
        pixels[NEXT + i] = intensity * green
        pixels[NEXT + NEXT + i] = intensity * blue


@helper
def show_background(pixels, n, encoding, n_channel):
    """Let the background show through what isn't covered."""
    one = np.float32(1)
    for channel in range(index(n_channel)):
        behind, first = encoding.background[channel], channel * NEXT
        for i in range(n):
            pixels[first + i] = pixels[first + i] * pixels[ALPHA + i] + behind * (one - pixels[ALPHA + i])
    for i in range(n):
        pixels[ALPHA + i] = one


@helper
def write_colors(pixels, n, color, alpha):
    """Write linear colours as they are: color is (n, 3), alpha (n,)."""
    for i in range(n):
        color[i, 0] = pixels[i]
        color[i, 1] = pixels[NEXT + i]
        color[i, 2] = pixels[NEXT + NEXT + i]
        alpha[i] = pixels[ALPHA + i]
