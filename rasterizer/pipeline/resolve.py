"""Stage 7, resolve: a band's intensities into pixels of the picture, while they are in the cache.

In:  the band's visibility entries (what is covered) and radiance (linear intensities).
Out: all of the band's rows of the picture: linear colour float32, and, by the encode stage, 8 bits a channel. The
     visibility buffer is left clear for the next band.

Samples are averaged over each pixel (box filter, linear light) where there are several; a pixel's colour is the mean of
its covered samples, its alpha the covered fraction.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from .encode import (
    ALPHA,
    PIXELS_SHAPE,
    RANGE_CLAMP,
    encode_batch,
    encode_channel,
    pack_bytes,
)
from .fragments import BATCH_SIZE, NEXT
from .visibility import CLEAR, clear, strip_of

MOST_FACTOR = 4  # samples a pixel along an axis
PIECE = index(64)  # pixels that are averaged together: those that are covered as a whole take a shorter way


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


def resolve(visibility, radiance, translucent, y_start, y_end, factor, encoding, batch, out) -> int:
    """Write rows of the picture from a band; clear the band.

    Parameters
    ----------
    visibility : of the band
    radiance : (n_channel, n_row * pitch) float32 or float64, linear
    translucent : Translucent, the samples that nothing opaque is behind (layers.py), or None where there are none
    y_start, y_end : the rows of pixels; the band's rows are y_start*factor .. y_end*factor
    factor : samples a pixel along each axis
    encoding : Encoding
    batch : PixelBatch, scratch
    out : Picture

    Returns
    -------
    how many samples are covered
    """
    if translucent is not None:
        return resolve_translucent(visibility, radiance, translucent, (y_start, y_end), factor, encoding, batch, out)
    if factor == 1 and is_plain(radiance.shape[0], encoding, out):
        return resolve_bytes(visibility, radiance, y_start, y_end, encoding, out)
    if factor == 1:
        return resolve_samples(visibility, radiance, y_start, y_end, encoding, batch, out)
    return resolve_averages(visibility, radiance, y_start, y_end, factor, encoding, batch, out)


@helper
def is_plain(n_channel, encoding, out) -> bool:
    """Tell whether pixels are encoded as they are: bytes alone are asked for, and nothing is to mix or to scale."""
    is_clamped = encoding.policy == RANGE_CLAMP and not encoding.has_background
    return is_clamped and len(out.color) == 0 and (n_channel == 3 or encoding.is_grey)


# ---------------------------------------------------------------- kernels


@kernel
def resolve_bytes(visibility, radiance, y_start, y_end, encoding, out):
    """Encode a sample a pixel into bytes, a row in one loop; clear the band; return how many samples are covered."""
    entries, radiance, n_covered = visibility.entries, radiance, np.int64(0)
    for j in range(y_start, y_end):
        row = j - y_start
        first, end = covered_columns(visibility, row, 1)
        fill_blank(out, j, first, end, encoding)
        start, n = index(row * visibility.pitch + first), index(end - first)
        n_covered += encode_samples(entries[start : start + n], radiance, start, out.rgba[index(j), index(first) :])
    clear(visibility, y_end - y_start)
    return n_covered


@kernel
def resolve_samples(visibility, radiance, y_start, y_end, encoding, batch, out):
    """Write a sample a pixel; clear the band; return how many samples are covered."""
    entries, radiance, n_covered = visibility.entries, radiance, np.int64(0)
    for j in range(y_start, y_end):
        row = j - y_start
        first, end = covered_columns(visibility, row, 1)
        fill_blank(out, j, first, end, encoding)
        for left in range(first, end, BATCH_SIZE):
            start, n = index(row * visibility.pitch + left), index(min(end - left, BATCH_SIZE))
            n_covered += gather_samples(entries[start : start + n], radiance, start, batch.values)
            write_pixels(batch, n, radiance.shape[0], encoding, (j, left), out)
    clear(visibility, y_end - y_start)
    return n_covered


@kernel
def resolve_averages(visibility, radiance, y_start, y_end, factor, encoding, batch, out):
    """Average the samples of each pixel and write it; clear the band; return how many samples are covered."""
    n_covered = np.int64(0)
    for j in range(y_start, y_end):
        row = (j - y_start) * factor
        first, end = covered_columns(visibility, row, factor)
        fill_blank(out, j, first, end, encoding)
        for left in range(first, end, BATCH_SIZE):
            n = index(min(end - left, BATCH_SIZE))
            n_covered += average_samples(visibility, radiance, None, (row, left), factor, n, batch)
            write_pixels(batch, n, radiance.shape[0], encoding, (j, left), out)
    clear(visibility, (y_end - y_start) * factor)
    return n_covered


@kernel
def resolve_translucent(visibility, radiance, translucent, rows, factor, encoding, batch, out):
    """As `resolve_averages`, where samples may show something transparent and nothing opaque: in some columns."""
    entries, n_covered, n_channel, (y_start, y_end) = visibility.entries, np.int64(0), radiance.shape[0], rows
    is_direct = factor == 1 and is_plain(n_channel, encoding, out)
    for j in range(y_start, y_end):
        row = (j - y_start) * factor
        first, end = covered_columns(visibility, row, factor)
        fill_blank(out, j, first, end, encoding)
        weighted, weighted_end = extent_of_pixels(translucent, row, factor, visibility.width)
        weighted, weighted_end = (weighted, weighted_end) if weighted < weighted_end else (end, end)
        left = first
        while left < end:
            is_weighted = weighted <= left < weighted_end
            stretch_end = weighted if left < weighted else weighted_end if is_weighted else end
            n, here = index(min(stretch_end - left, BATCH_SIZE)), (row, left)
            if is_direct and not is_weighted:
                n, start = index(stretch_end - left), index(row * visibility.pitch + left)
                n_covered += encode_samples(
                    entries[start : start + n], radiance, start, out.rgba[index(j), index(left) :]
                )
                left = stretch_end
                continue
            if is_weighted:
                n_covered += average_samples(visibility, radiance, translucent, here, factor, n, batch)
            else:
                n_covered += average_samples(visibility, radiance, None, here, factor, n, batch)
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
def covered_columns(visibility, row, factor):
    """Return the columns of pixels that any sample of `factor` rows may cover, half-open; where there are none, 0 and
    0."""
    return extent_of_pixels(visibility, row, factor, visibility.width)


@helper
def extent_of_pixels(extents, row, factor, width):
    """Return the columns of pixels that the extents of `factor` rows reach, half-open; where there are none, 0 and
    0."""
    left, right = np.int64(width), np.int64(0)
    for sub in range(row, row + factor):
        strip = strip_of(sub)
        left, right = min(left, extents.left[strip]), max(right, extents.right[strip])
    return (left // factor, (right + factor - 1) // factor) if left < right else (np.int64(0), np.int64(0))


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


# ---------------------------------------------------------------- samples into pixels


@helper
def encode_samples(entries, radiance, start, out):
    """Encode one sample a pixel, a row in one loop; transparent black where none is covered; return how many are
    covered.

    `start` is the first sample in the band; out is (n,) uint32.
    """
    n = index(len(entries))
    blank, opaque = np.uint32(0), np.int32(255)
    n_covered = np.int64(0)
    red = radiance[0, start : start + n]
    if radiance.shape[0] == 1:
        for i in range(n):
            level, is_covered = encode_channel(np.float32(red[i])), entries[i] < CLEAR
            out[i] = pack_bytes(level, level, level, opaque) if is_covered else blank
            n_covered += is_covered
    else:
        green, blue = radiance[1, start : start + n], radiance[2, start : start + n]
        for i in range(n):
            is_covered = entries[i] < CLEAR
            r, g = encode_channel(np.float32(red[i])), encode_channel(np.float32(green[i]))
            b = encode_channel(np.float32(blue[i]))
            out[i] = pack_bytes(r, g, b, opaque) if is_covered else blank
            n_covered += is_covered
    return n_covered


@helper
def gather_samples(entries, radiance, start, pixels):
    """Copy one sample a pixel: its intensities and its coverage; return how many are covered."""
    n = index(len(entries))
    zero, one = np.float32(0), np.float32(1)
    n_covered = np.int64(0)
    for i in range(n):
        n_covered += entries[i] < CLEAR
        pixels[ALPHA + i] = one if entries[i] < CLEAR else zero
    for channel in range(index(radiance.shape[0])):
        source, target = radiance[channel, start : start + n], channel * NEXT
        for i in range(n):
            pixels[target + i] = np.float32(source[i]) if entries[i] < CLEAR else zero
    return n_covered


@helper
def average_samples(visibility, radiance, translucent, first, factor, n, batch):
    """Compute the mean of every pixel's samples, weighted by their opacity, and their mean opacity; return how many
    samples show anything.

    Of a pixel that shows nothing transparent, these are the mean of its covered samples, and the covered share.

    Parameters
    ----------
    translucent : Translucent; None where nothing transparent is seen
    first : the band's row of samples and the column of pixels where the batch begins
    """
    if factor == 1:
        return gather_sample_row(visibility, radiance, translucent, first, n, batch.values)
    # The factor as a constant: the compiler then makes vector instructions of the loops over pixels.
    if factor == 2:
        return average_squares(visibility, radiance, translucent, first, index(2), n, batch)
    if factor == 3:
        return average_squares(visibility, radiance, translucent, first, index(3), n, batch)
    return average_squares(visibility, radiance, translucent, first, index(4), n, batch)


@helper
def gather_sample_row(visibility, radiance, translucent, first, n, pixels):
    """See `average_samples`, for one sample a pixel: nothing is to sum."""
    if translucent is not None:
        return weight_single_samples(visibility, radiance, translucent, first, n, pixels)
    start = index(first[0] * visibility.pitch + first[1])
    return gather_samples(visibility.entries[start : start + n], radiance, start, pixels)


@helper
def average_squares(visibility, radiance, translucent, first, factor, n, batch):
    """See `average_samples`; `factor` is an `index`."""
    (row, left), pitch, n_seen = first, visibility.pitch, np.int64(0)
    for skipped in range(index(0), n, PIECE):
        n_here, column = min(n - skipped, PIECE), (left + np.int64(skipped)) * np.int64(factor)
        n_opaque = count_opaque(visibility.entries, pitch, (row, column), factor, n_here)
        if n_opaque == np.int64(n_here * factor * factor):
            average_opaque(radiance, pitch, (row, column), factor, skipped, n_here, batch.values)
        else:
            n_opaque = average_weighted(
                visibility, radiance, translucent, (row, column), factor, skipped, n_here, batch
            )
        n_seen += n_opaque
    return n_seen


@helper
def count_opaque(entries, pitch, first, factor, n):
    """Count the samples of n pixels in which something opaque is seen; `first` is the row and column of samples."""
    n_opaque, n_sample = np.int64(0), n * factor
    for sub in range(factor):
        start = index((first[0] + np.int64(sub)) * pitch + first[1])
        of_row = entries[start : start + n_sample]
        for k in range(n_sample):
            n_opaque += of_row[k] < CLEAR
    return n_opaque


@helper
def average_opaque(radiance, pitch, first, factor, skipped, n, pixels):
    """Compute the means of n pixels all of whose samples show something opaque; they come after `skipped` pixels."""
    scale = 1.0 / np.float64(factor * factor)
    for channel in range(index(radiance.shape[0])):
        target = channel * NEXT + skipped
        start, step = index(first[0] * pitch + first[1]), index(pitch)
        samples = radiance[channel, start : start + (factor - index(1)) * step + n * factor]
        for i in range(n):
            total = 0.0
            for sub in range(factor):
                for k in range(factor):
                    total += np.float64(samples[sub * step + i * factor + k])
            pixels[target + i] = total * scale
    for i in range(n):
        pixels[ALPHA + skipped + i] = np.float32(1)


@helper
def average_weighted(visibility, radiance, translucent, first, factor, skipped, n, batch):
    """Compute the means of n pixels weighted by opacity; return how many samples show anything.

    `first` is the row and column of samples; the pixels come after `skipped` ones.
    """
    sums, weights, n_channel = batch.sums, batch.weights, index(radiance.shape[0])
    n_seen, n_sample, (row, column) = np.int64(0), n * factor, first
    for channel in range(index(4)):
        for i in range(n):
            sums[channel * NEXT + i] = 0.0
    for sub in range(row, row + np.int64(factor)):
        start = index(sub * visibility.pitch + column)
        n_seen += fill_weights(visibility, translucent, (sub, column), n_sample, weights)
        for channel in range(n_channel):
            add_weighted(radiance[channel, start : start + n_sample], weights, factor, n, sums[channel * NEXT :])
        add_weights(weights, factor, n, sums[ALPHA:])
    scale_sums(sums, n, n_channel, np.float64(factor * factor), batch.values[skipped:])
    return n_seen


@helper
def fill_weights(visibility, translucent, first, n, weights):
    """Fill the opacity of n samples of a row, float64: 1 where something opaque is seen; return how many are not 0.

    `first` is the row and the column of samples of the first one.
    """
    (row, left), n_seen, zero, one = first, np.int64(0), np.float64(0), np.float64(1)
    start = index(row * visibility.pitch + left)
    entries = visibility.entries[start : start + n]
    for k in range(n):
        weights[k] = one if entries[k] < CLEAR else zero
        n_seen += entries[k] < CLEAR
    if translucent is not None:
        strip = strip_of(row)
        begin, end = max(left, translucent.left[strip]), min(left + np.int64(n), translucent.right[strip])
        if begin < end:
            sample = index(translucent.columns[index(row)] + begin)
            before, n_here = index(begin - left), index(end - begin)
            opacity = translucent.opacity[sample : sample + n_here]
            for k in range(n_here):
                is_behind = entries[before + k] >= CLEAR
                weights[before + k] = opacity[k] if is_behind else one
                n_seen += is_behind & (opacity[k] > zero)
    return n_seen


@helper
def add_weighted(samples, weights, factor, n, sums):
    """Add a row's samples of each of n pixels, times their weights, to its sum; samples without weight may hold
    anything."""
    for i in range(n):
        total = sums[i]
        for k in range(factor):
            weight, sample = weights[i * factor + k], np.float64(samples[i * factor + k])
            total += weight * (sample if weight > 0.0 else 0.0)
        sums[i] = total


@helper
def add_weights(weights, factor, n, sums):
    """Add the weights of a row's samples of each of n pixels to their sum."""
    for i in range(n):
        total = sums[i]
        for k in range(factor):
            total += weights[i * factor + k]
        sums[i] = total


@helper
def scale_sums(sums, n, n_channel, n_sample, pixels):
    """Divide the sums of n pixels by those of their weights, and these by the number of samples; of a pixel without
    weight all is 0."""
    for i in range(n):
        weight = sums[ALPHA + i]
        pixels[ALPHA + i] = weight / n_sample
        sums[ALPHA + i] = 1.0 / (weight if weight > 0.0 else 1.0)
    for channel in range(n_channel):
        first = channel * NEXT
        for i in range(n):
            pixels[first + i] = sums[first + i] * sums[ALPHA + i]


@helper
def weight_single_samples(visibility, radiance, translucent, first, n, pixels):
    """Copy one sample a pixel and its opacity; return how many show anything."""
    (row, left), n_covered = first, np.int64(0)
    start, sample = index(row * visibility.pitch + left), index(translucent.columns[index(row)] + left)
    entries, opacity = visibility.entries[start : start + n], translucent.opacity[sample : sample + n]
    for i in range(n):
        weight = 1.0 if entries[i] < CLEAR else opacity[i]
        n_covered += weight > 0.0
        pixels[ALPHA + i] = weight
    for channel in range(index(radiance.shape[0])):
        source, target = radiance[channel, start : start + n], channel * NEXT
        for i in range(n):
            is_seen = (entries[i] < CLEAR) | (opacity[i] > 0.0)
            pixels[target + i] = np.float32(source[i]) if is_seen else np.float32(0)
    return n_covered


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
