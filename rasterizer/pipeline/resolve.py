"""Stage 7, resolve: a band's intensities into pixels of the picture, and these into bytes, while they are in the cache.

In:  the band's packed samples (what is covered) and radiance (linear intensities).
Out: all of the band's rows of the picture: linear colour float32, and 8 bits a channel. The visibility buffer is left
     clear for the next band.

A pixel's colour is the mean of its covered samples in linear light, its alpha the covered fraction: a box filter. Means
are summed up row by row in float64: sixteen roundings of float32 would show at tolerance 0.

Bytes are made of that by the out-of-range policy, the sRGB curve (IEC 61966-2-1), and rounding to the nearest level.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel
from .fragments import BATCH_SIZE, NEXT, filled_up
from .visibility import CLEAR, clear, extent_of_pixels, next_stretch, strip_of


class Picture(NamedTuple):
    """What is written; linear arrays that aren't wanted have no rows."""

    color: np.ndarray  # (height, width, 3) float32, linear
    rgba: np.ndarray  # (height, width) uint32, a pixel's bytes in memory order red, green, blue, alpha
    alpha: np.ndarray  # (height, width) float32


RANGE_CLAMP, RANGE_GLOBAL, RANGE_LOCAL = 0, 1, 2  # out-of-range policies


class Encoding(NamedTuple):
    """How linear colour becomes 8 bits."""

    is_grey: bool  # all colours are grey, also the background: what has one channel is encoded once
    tint: np.ndarray  # (3,) float32: a picture with one channel is this colour times the intensity
    background: np.ndarray  # (3,) float32, linear; black unless has_background
    has_background: bool
    policy: int  # RANGE_CLAMP, RANGE_GLOBAL or RANGE_LOCAL
    scale: float  # RANGE_GLOBAL: 1 / the picture's largest component, if that is above 1
    blank: int = 0  # the bytes of a pixel in which nothing is drawn, see `with_blank`


# A batch of pixels is one flat array, as a batch of fragments is: red from 0 on, green from NEXT on, blue, alpha.
ALPHA = 3 * BATCH_SIZE
PIXELS_SHAPE = (4 * BATCH_SIZE,)
PIECE = 64  # pixels that are averaged together: those that are covered as a whole take a shorter path


# As a type: each number of them has kernels of its own. Loops over the samples of a pixel are unrolled, and those over
# pixels become vector instructions, where the number is known when they are compiled. A picture has one number of
# samples: so one such loop is compiled, not one for each. Of one sample a pixel, whose grid is None, nothing is summed.

MAX_FACTOR = 4  # samples a pixel along an axis


def make_grid(factor) -> tuple[int, ...] | None:
    """Return the samples of a pixel, as many zeros as there are along each axis; None for one sample."""
    return None if factor == 1 else (0,) * factor


@helper
def factor_of(grid):
    """Return the number of samples along an axis, int64, which the compiler takes for a constant."""
    if grid is None:
        return 1
    return len(grid)


class PixelBatch(NamedTuple):
    """A batch of pixels on their way into the picture; see ALPHA for what stands where."""

    values: np.ndarray  # PIXELS_SHAPE float32, linear colours and alpha
    levels: np.ndarray  # PIXELS_SHAPE int32
    sums: np.ndarray  # PIXELS_SHAPE float64: of the samples' colours, and of their weights
    weights: np.ndarray  # (PIECE * MAX_FACTOR,) float64, of a row's samples


def make_pixel_batch() -> PixelBatch:
    """Return the batch of pixels of one thread."""
    values, levels = np.zeros(PIXELS_SHAPE, np.float32), np.zeros(PIXELS_SHAPE, np.int32)
    return PixelBatch(values, levels, np.zeros(PIXELS_SHAPE), np.zeros(int(PIECE) * MAX_FACTOR))


@kernel
def resolve(visibility, radiance, translucent, rows, grid, encoding, batch, out):
    """Write rows of the picture from a band: the mean of the samples of each pixel. Clear the band; return how many
    samples are covered.

    Parameters
    ----------
    visibility : of the band
    radiance : (n_channel, n_row * pitch) float32 or float64, linear
    translucent : Translucent, the samples that nothing opaque is behind (a_buffer.py), or None where there are none
    rows : (first, end) of the pixels; the band's rows are as many times that as a pixel has samples along an axis
    grid : see `make_grid`
    encoding : Encoding
    batch : PixelBatch, scratch
    out : Picture
    """
    n_covered, factor, (y_start, y_end) = 0, factor_of(grid), rows
    for j in range(y_start, y_end):
        row = (j - y_start) * factor
        left, end = begin_row(visibility, row, factor, j, encoding, out)
        weighted, weighted_end = extent_of_translucent(translucent, row, factor, visibility.width, end)
        while left < end:
            is_weighted = weighted <= left < weighted_end
            stretch_end = weighted if left < weighted else weighted_end if is_weighted else end
            here = row, left
            n, is_blank = measure_stretch(visibility, here, stretch_end - left, is_weighted, grid)
            if is_blank:
                fill_blank(out, j, left, left + n, encoding)
            else:
                n_covered += average_where(is_weighted, visibility, radiance, translucent, here, grid, n, batch)
                write_pixels(batch, n, radiance.shape[0], encoding, (j, left), out)
            left += n
    clear(visibility, (y_end - y_start) * factor)
    return n_covered


@helper
def measure_stretch(visibility, first, n, is_weighted, grid):
    """Return how many of n pixels come next, a batch at most, and whether nothing is drawn in them; of several samples
    a pixel that isn't asked. `first` is the band's row of samples and the column of pixels where they begin."""
    n = np.int64(min(n, BATCH_SIZE))
    if grid is None:
        if not is_weighted:
            start = first[0] * visibility.pitch + first[1]
            n_here, is_blank = next_stretch(visibility.packed[start : start + n])
            return n_here if is_blank else min(filled_up(n_here), n), is_blank
    return n, False


@helper
def extent_of_translucent(translucent, row, factor, width, end):
    """Return the columns of pixels in which samples may show something transparent and nothing opaque, half-open; where
    there are none, those from `end` on."""
    if translucent is None:
        return end, end
    first, last = extent_of_pixels(translucent, row, factor, width)
    return (first, last) if first < last else (end, end)


@helper
def average_where(is_weighted, visibility, radiance, translucent, first, grid, n, batch):
    """See `average_samples`; what is translucent counts where the samples lie in its extent."""
    if translucent is not None:
        if is_weighted:
            return average_samples(visibility, radiance, translucent, first, grid, n, batch)
    return average_samples(visibility, radiance, None, first, grid, n, batch)


@helper
def begin_row(visibility, row, factor, j, encoding, out):
    """Fill what is blank in row j of the picture; return the columns of pixels that any sample of `factor` rows of the
    band, from `row` on, may cover, half-open."""
    first, end = extent_of_pixels(visibility, row, factor, visibility.width)
    fill_blank(out, j, 0, first, encoding)
    fill_blank(out, j, end, out.rgba.shape[1], encoding)
    return first, end


@helper
def fill_blank(out, j, first, end, encoding):
    """Fill a row's pixels first..end, where nothing is drawn, with the background, or with transparent black."""
    red, green, blue = encoding.background[0], encoding.background[1], encoding.background[2]
    alpha, blank = np.float32(1) if encoding.has_background else np.float32(0), np.uint32(encoding.blank)
    for i in range(first, end):
        out.rgba[j, i] = blank
    if out.color.shape[0] > 0:
        for i in range(first, end):
            out.color[j, i, 0] = red
            out.color[j, i, 1] = green
            out.color[j, i, 2] = blue
            out.alpha[j, i] = alpha


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
        write_colors(pixels, n, out.color[j, left:], out.alpha[j, left:])
    encode_batch(pixels, batch.levels, n, encoding, out.rgba[j, left:])


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
    for channel in range(n_channel):
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


# ---------------------------------------------------------------- the box filter: samples into pixels


@helper
def average_samples(visibility, radiance, translucent, first, grid, n, batch):
    """Compute the mean of every pixel's samples, weighted by their opacity, and their mean opacity; return how many
    samples show anything.

    Of a pixel that shows nothing transparent, these are the mean of its covered samples, and the covered share.

    Parameters
    ----------
    translucent : Translucent; None where nothing transparent is seen
    first : the band's row of samples and the column of pixels where the batch begins
    grid : see `make_grid`
    """
    if grid is None:
        return average_single(visibility, radiance, translucent, first, n, batch)
    return average_several(visibility, radiance, translucent, first, grid, n, batch)


@helper
def average_single(visibility, radiance, translucent, first, n, batch):
    """See `average_samples`, for one sample a pixel: nothing is to sum."""
    if translucent is not None:
        return weight_single_samples(visibility, radiance, translucent, first, n, batch.values)
    start = first[0] * visibility.pitch + first[1]
    return gather_samples(visibility.packed[start : start + n], radiance, start, batch.values)


@helper
def gather_samples(packed, radiance, start, pixels):
    """Copy one sample a pixel: its intensities and its coverage; return how many are covered."""
    n = len(packed)
    zero, one = np.float32(0), np.float32(1)
    n_covered = 0
    for i in range(n):
        n_covered += packed[i] < CLEAR
        pixels[ALPHA + i] = one if packed[i] < CLEAR else zero
    for channel in range(radiance.shape[0]):
        source, target = radiance[channel, start : start + n], channel * NEXT
        for i in range(n):
            pixels[target + i] = np.float32(source[i]) if pixels[ALPHA + i] != zero else zero
    return n_covered


@helper
def weight_single_samples(visibility, radiance, translucent, first, n, pixels):
    """Copy one sample a pixel and its opacity; return how many show anything."""
    (row, left), n_covered = first, 0
    start, sample = row * visibility.pitch + left, translucent.columns[row] + left
    packed, opacity = visibility.packed[start : start + n], translucent.opacity[sample : sample + n]
    for i in range(n):
        weight = 1.0 if packed[i] < CLEAR else opacity[i]
        n_covered += weight > 0.0
        pixels[ALPHA + i] = weight
    for channel in range(radiance.shape[0]):
        source, target = radiance[channel, start : start + n], channel * NEXT
        for i in range(n):
            is_seen = (packed[i] < CLEAR) | (opacity[i] > 0.0)
            pixels[target + i] = np.float32(source[i]) if is_seen else np.float32(0)
    return n_covered


@helper
def average_several(visibility, radiance, translucent, first, grid, n, batch):
    """See `average_samples`, for several samples a pixel: PIECE pixels at a time."""
    (row, left), pitch, n_seen, factor = first, visibility.pitch, 0, factor_of(grid)
    for skipped in range(0, n, PIECE):
        n_here, column = min(n - skipped, PIECE), (left + skipped) * factor
        n_opaque = count_opaque(visibility.packed, pitch, (row, column), factor, n_here)
        if n_opaque == np.int64(n_here * factor * factor):
            average_opaque(radiance, pitch, (row, column), factor, skipped, n_here, batch.values)
        elif n_opaque == 0 and translucent is None:
            clear_pixels(batch.values, skipped, n_here)
        else:
            n_opaque = average_weighted(
                visibility, radiance, translucent, (row, column), factor, skipped, n_here, batch
            )
        n_seen += n_opaque
    return n_seen


@helper
def clear_pixels(pixels, skipped, n):
    """Let n pixels after `skipped` ones show nothing."""
    for channel in range(4):
        first = channel * NEXT + skipped
        for i in range(n):
            pixels[first + i] = np.float32(0)


@helper
def count_opaque(packed, pitch, first, factor, n):
    """Count the samples of n pixels in which something opaque is seen; `first` is the row and column of samples."""
    n_opaque, n_sample = 0, n * factor
    for sub in range(factor):
        start = (first[0] + sub) * pitch + first[1]
        of_row = packed[start : start + n_sample]
        for k in range(n_sample):
            n_opaque += of_row[k] < CLEAR
    return n_opaque


@helper
def average_opaque(radiance, pitch, first, factor, skipped, n, pixels):
    """Compute the means of n pixels all of whose samples show something opaque; they come after `skipped` pixels."""
    scale = 1.0 / np.float64(factor * factor)
    for channel in range(radiance.shape[0]):
        target = channel * NEXT + skipped
        start, step = first[0] * pitch + first[1], pitch
        samples = radiance[channel, start : start + (factor - 1) * step + n * factor]
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
    sums, weights, n_channel = batch.sums, batch.weights, radiance.shape[0]
    n_seen, n_sample, (row, column) = 0, n * factor, first
    for channel in range(4):
        for i in range(n):
            sums[channel * NEXT + i] = 0.0
    for sub in range(row, row + factor):
        start = sub * visibility.pitch + column
        n_seen += fill_opacities(visibility, translucent, (sub, column), n_sample, weights)
        for channel in range(n_channel):
            add_weighted(radiance[channel, start : start + n_sample], weights, factor, n, sums[channel * NEXT :])
        add_weights(weights, factor, n, sums[ALPHA:])
    scale_sums(sums, n, n_channel, np.float64(factor * factor), batch.values[skipped:])
    return n_seen


@helper
def fill_opacities(visibility, translucent, first, n, weights):
    """Fill the opacity of n samples of a row, float64: 1 where something opaque is seen; return how many are not 0.

    `first` is the row and the column of samples of the first one.
    """
    (row, left), n_seen, zero, one = first, 0, np.float64(0), np.float64(1)
    start = row * visibility.pitch + left
    packed = visibility.packed[start : start + n]
    for k in range(n):
        weights[k] = one if packed[k] < CLEAR else zero
        n_seen += packed[k] < CLEAR
    if translucent is not None:
        strip = strip_of(row)
        begin, end = max(left, translucent.left[strip]), min(left + n, translucent.right[strip])
        if begin < end:
            sample = translucent.columns[row] + begin
            before, n_here = begin - left, end - begin
            opacity = translucent.opacity[sample : sample + n_here]
            for k in range(n_here):
                is_behind = packed[before + k] >= CLEAR
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


# ---------------------------------------------------------------- encode: pixels into bytes


@kernel
def encode_picture(color, alpha, encoding, out_rgba):
    """Encode a whole picture whose linear colours are known: for RANGE_GLOBAL, which needs the largest of them.

    Parameters
    ----------
    color : (height, width, 3) float32, linear
    alpha : (height, width) float32
    encoding : Encoding
    out_rgba : (height, width) uint32, see resolve.Picture
    """
    for j in range(color.shape[0]):
        for i in range(color.shape[1]):
            out_rgba[j, i] = encode_pixel(color[j, i, 0], color[j, i, 1], color[j, i, 2], alpha[j, i], encoding)


def with_blank(encoding: Encoding) -> Encoding:
    """Return the encoding with the bytes of a pixel in which nothing is drawn: the background, or transparent black."""
    if not encoding.has_background:
        return encoding._replace(blank=0)
    rgba = np.empty((1, 1), np.uint32)
    encode_picture(encoding.background.reshape(1, 1, 3), np.ones((1, 1), np.float32), encoding, rgba)
    return encoding._replace(blank=int(rgba[0, 0]))


@helper
def encode_batch(pixels, levels, n, encoding, out):
    """Apply the out-of-range policy to n pixels of a batch, encode them, and pack them into bytes.

    `levels` has room for three channels; out is (n,) uint32.
    """
    blue_start = NEXT + NEXT
    if encoding.policy != RANGE_CLAMP:
        for i in range(n):
            scale = range_scale(pixels[i], pixels[NEXT + i], pixels[blue_start + i], encoding)
            pixels[i] *= scale
            pixels[NEXT + i] *= scale
            pixels[blue_start + i] *= scale
    # A grey picture has three equal channels.
    n_different = 1 if encoding.is_grey else 3
    for channel in range(n_different):
        first = channel * NEXT
        for i in range(n):
            levels[first + i] = bits_within(pixels[first + i])
        for i in range(n):
            levels[first + i] = level_of_bits(levels[first + i])
    green = NEXT if n_different == 3 else 0
    blue = green + green
    for i in range(n):
        out[i] = pack_bytes(levels[i], levels[green + i], levels[blue + i], encode_alpha(pixels[ALPHA + i]))


@helper
def encode_pixel(red, green, blue, alpha, encoding):
    """Encode one linear colour."""
    scale = np.float32(1) if encoding.policy == RANGE_CLAMP else range_scale(red, green, blue, encoding)
    return pack_bytes(
        encode_channel(red * scale), encode_channel(green * scale), encode_channel(blue * scale), encode_alpha(alpha)
    )


@helper
def range_scale(red, green, blue, encoding):
    """Return what a pixel is multiplied by to bring it into the display's range."""
    if encoding.policy == RANGE_GLOBAL:
        return np.float32(encoding.scale)
    return np.float32(1) / max(max(red, green), max(blue, np.float32(1)))


@helper
def encode_alpha(alpha):
    """Return the nearest of 256 levels of an alpha within 0..1."""
    return np.int32(alpha * np.float32(255) + np.float32(0.5))


@helper
def pack_bytes(red, green, blue, alpha):
    """Put four levels into the bytes red, green, blue, alpha, the first lowest."""
    return np.uint32(red | (green << np.int32(8)) | (blue << np.int32(16)) | (alpha << np.int32(24)))


# ---------------------------------------------------------------- the sRGB curve

MIN_VALUE, MAX_VALUE = np.float32(2.0**-13), np.float32(1 - 2.0**-24)  # below the first threshold and above the last
BUCKET_SHIFT = np.int32(16)  # floats with the same upper 16 bits share a bucket: 128 buckets an octave
FIRST_BUCKET = np.int32(MIN_VALUE.view(np.int32) >> BUCKET_SHIFT)
REST_MASK = np.int32((1 << BUCKET_SHIFT) - 1)


def srgb_thresholds():
    """Return the smallest float32 that is nearest to each of the levels 1..255 of the sRGB curve, (255,)."""
    encoded = (np.arange(1, 256) - 0.5) / 255.0
    exact = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    thresholds = exact.astype(np.float32)
    return np.where(thresholds < exact, np.nextafter(thresholds, np.float32(2)), thresholds)


def make_level_table():
    """Return an int32 for every bucket of floats from MIN_VALUE to MAX_VALUE: the sum of it and of the lower bits of a
    float in the bucket has the float's level in its upper bits.

    A bucket is 2^-7 of its octave wide, and no two thresholds come so close: so it holds one threshold at most, and the
    sum carries into the level from there on. (Positive floats are ordered as their bits are.)
    """
    thresholds = srgb_thresholds().view(np.int32)
    starts = np.arange(FIRST_BUCKET, (MAX_VALUE.view(np.int32) >> BUCKET_SHIFT) + 1, dtype=np.int32) << BUCKET_SHIFT
    levels = np.searchsorted(thresholds, starts, side="right")
    following = np.append(thresholds, np.iinfo(np.int32).max)[levels]
    to_carry = np.where(following <= starts + REST_MASK, starts + (1 << BUCKET_SHIFT) - following, 0)
    return ((levels << BUCKET_SHIFT) + to_carry).astype(np.int32)


# A constant of the compiled code: what can't change can't be aliased, and look-ups become vector instructions.
LEVEL_TABLE = make_level_table()


@helper
def encode_channel(value):
    """Return the nearest of 256 levels of the sRGB curve, by one look-up and one addition; see make_level_table."""
    return level_of_bits(bits_within(value))


@helper
def bits_within(value):
    """Return the bits of a value, or of the nearest one that the table has; of MIN_VALUE where it isn't a number."""
    value = min(value, MAX_VALUE) if value > MIN_VALUE else MIN_VALUE
    return np.float32(value).view(np.int32)


@helper
def level_of_bits(bits):
    """Return the level of a float with these bits."""
    bucket = np.uint32(np.int32(bits >> BUCKET_SHIFT) - FIRST_BUCKET)
    return np.int32(np.int32(LEVEL_TABLE[bucket] + np.int32(bits & REST_MASK)) >> BUCKET_SHIFT)
