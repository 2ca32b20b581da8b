"""Stage 7, resolve: a band's intensities into the picture, while they are in the cache.

In:  the band's z-buffer (what is covered) and radiance (linear intensities).
Out: rows of the picture: linear colour float32, and red, green, blue, alpha in 8 bits. The z-buffer is left clean for the next band.

Samples are averaged over each pixel (box filter, linear light) where there are several; a pixel's colour is the mean of its covered
samples, its alpha the covered fraction. Then the out-of-range policy, the sRGB curve (IEC 61966-2-1) and rounding to the nearest level.
"""

from typing import NamedTuple

import numpy as np

from .._kernel import helper, kernel
from .scan import CLEAR, GROUP_SHIFT, PADDING

N_BUCKET = 4096  # finer than the smallest step between thresholds, 1/(255 · 12.92) = 1/3295: a bucket holds at most one
CLAMP, GLOBAL, LOCAL = 0, 1, 2  # out-of-range policies


class Encoding(NamedTuple):
    """How linear colour becomes 8 bits: exact rounding by one look-up and one comparison."""

    tint: np.ndarray  # (3,) float32: a picture with one channel is this colour times the intensity
    background: np.ndarray  # (3,) float32, linear; read only if has_background
    has_background: bool
    policy: int  # CLAMP, GLOBAL or LOCAL
    scale: float  # GLOBAL: 1 / the picture's largest component, if that is above 1
    bucket_level: np.ndarray  # (N_BUCKET + 1,) int32: the level at the lower end of a bucket
    threshold: np.ndarray  # (258,) float32: the smallest colour of each level; infinite behind the last


class Picture(NamedTuple):
    """What is written; an array that isn't wanted has no rows."""

    color: np.ndarray  # (height, width, 3) float32, linear
    rgba: np.ndarray  # (height, width) uint32, a pixel's bytes in memory order red, green, blue, alpha
    alpha: np.ndarray  # (height, width) float32


def make_srgb_tables():
    """Return (bucket_level, threshold) of `Encoding`."""
    level = np.arange(1, 256)
    encoded = (level - 0.5) / 255.0
    exact = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    threshold = exact.astype(np.float32)
    threshold = np.where(threshold < exact, np.nextafter(threshold, np.float32(2)), threshold)
    threshold = np.concatenate([[0], threshold, [np.inf, np.inf]]).astype(np.float32)
    lower_end = np.arange(N_BUCKET + 1, dtype=np.float32) / N_BUCKET
    bucket_level = (np.searchsorted(threshold[:256], lower_end, side="right") - 1).astype(np.int32)
    return bucket_level, threshold


@kernel
def resolve(canvas, radiance, y_start, y_stop, factor, encoding, out):
    """Write the rows y_start..y_stop of the picture from the band; clean the band; return how many samples are covered.

    `factor` is the number of samples a pixel along each axis; the band's rows are y_start*factor .. y_stop*factor.
    """
    n_channel = radiance.shape[0]
    sums = np.empty((3, canvas.width // factor + 1), np.float32)
    counts = np.empty(canvas.width // factor + 1, np.float32)
    n_covered = 0
    for j in range(y_start, y_stop):
        row = (j - y_start) * factor
        first, stop = touched_columns(canvas, row, factor)
        if encoding.has_background:
            fill_background(out, j, encoding)
        if first >= stop:
            continue
        if factor == 1:
            take_samples(canvas, radiance, row, first, stop, n_channel, sums, counts)
        else:
            average_samples(canvas, radiance, row, first, stop, factor, n_channel, sums, counts)
        for i in range(np.uint64(stop - first)):
            n_covered += np.int64(counts[i])
        n = np.uint64(stop - first)
        if n_channel == 1:
            spread_tint(sums, n, encoding.tint)
        finish_colors(sums, counts, n, np.float32(1.0 / (factor * factor)), encoding)
        if out.color.shape[0] > 0:
            for i in range(n):
                for channel in range(np.uint64(3)):
                    out.color[np.uint64(j), np.uint64(first) + i, channel] = sums[channel, i]
            for i in range(n):
                out.alpha[np.uint64(j), np.uint64(first) + i] = counts[i]
        if out.rgba.shape[0] > 0:
            encode_row(sums, counts, n, encoding, out.rgba[np.uint64(j), np.uint64(first) : np.uint64(stop)])
    clean(canvas, (y_stop - y_start) * factor)
    return n_covered


@helper
def touched_columns(canvas, row, factor):
    """Pixels that any sample of `factor` rows may have touched, as a half-open range."""
    left, right = np.int64(canvas.width), np.int64(0)
    for sub in range(row, row + factor):
        group = np.uint64(sub) >> np.uint64(GROUP_SHIFT)
        left, right = min(left, canvas.left[group]), max(right, canvas.right[group])
    return left // factor, (right + factor - 1) // factor


@helper
def take_samples(canvas, radiance, row, first, stop, n_channel, sums, counts):
    """One sample a pixel: its intensities, and 1 where it is covered."""
    start = np.uint64(row * canvas.pitch + first)
    n = np.uint64(stop - first)
    words = canvas.words[start : start + n]
    for i in range(n):
        counts[i] = np.float32(1) if words[i] < CLEAR else np.float32(0)
    for channel in range(np.uint64(n_channel)):
        source = radiance[channel, start : start + n]
        for i in range(n):
            sums[channel, i] = np.float32(source[i]) if words[i] < CLEAR else np.float32(0)


@helper
def average_samples(canvas, radiance, row, first, stop, factor, n_channel, sums, counts):
    """Mean intensities of every pixel's covered samples, and their number."""
    n = np.uint64(stop - first)
    for i in range(n):
        counts[i] = np.float32(0)
        for channel in range(np.uint64(n_channel)):
            sums[channel, i] = np.float32(0)
    for sub in range(row, row + factor):
        start = np.uint64(sub * canvas.pitch + first * factor)
        for i in range(n):
            for k in range(np.uint64(factor)):
                place = start + i * np.uint64(factor) + k
                if canvas.words[place] < CLEAR:
                    counts[i] += np.float32(1)
                    for channel in range(np.uint64(n_channel)):
                        sums[channel, i] += np.float32(radiance[channel, place])
    for i in range(n):
        scale = np.float32(1) / max(counts[i], np.float32(1))
        for channel in range(np.uint64(n_channel)):
            sums[channel, i] *= scale


@helper
def spread_tint(sums, n, tint):
    """One intensity into three channels."""
    red, green, blue = tint[0], tint[1], tint[2]
    for i in range(n):
        intensity = sums[0, i]
        sums[0, i] = intensity * red
        sums[1, i] = intensity * green
        sums[2, i] = intensity * blue


@helper
def finish_colors(sums, counts, n, alpha_of_sample, encoding):
    """Counts into alpha; the background shows through what isn't covered."""
    for i in range(n):
        counts[i] *= alpha_of_sample
    if encoding.has_background:
        for channel in range(np.uint64(3)):
            behind = encoding.background[channel]
            for i in range(n):
                sums[channel, i] = sums[channel, i] * counts[i] + behind * (np.float32(1) - counts[i])
        for i in range(n):
            counts[i] = np.float32(1)


@helper
def fill_background(out, j, encoding):
    """Fill a row with the background."""
    red, green, blue = encoding.background[0], encoding.background[1], encoding.background[2]
    if out.rgba.shape[0] > 0:
        pixel = encode_pixel(red, green, blue, np.float32(1), encoding)
        out.rgba[np.uint64(j), :] = pixel
    if out.color.shape[0] > 0:
        for i in range(np.uint64(out.color.shape[1])):
            color = out.color[np.uint64(j), i]
            color[0], color[1], color[2] = red, green, blue
            out.alpha[np.uint64(j), i] = np.float32(1)


@helper
def encode_row(sums, counts, n, encoding, out):
    """Apply the out-of-range policy and encode a row."""
    for i in range(n):
        out[i] = encode_pixel(sums[0, i], sums[1, i], sums[2, i], counts[i], encoding)


@helper
def encode_pixel(red, green, blue, alpha, encoding):
    """Encode one linear colour into the bytes red, green, blue, alpha, the lowest first."""
    if encoding.policy == GLOBAL:
        scale = np.float32(encoding.scale)
        red, green, blue = red * scale, green * scale, blue * scale
    elif encoding.policy == LOCAL:
        scale = np.float32(1) / max(max(red, green), max(blue, np.float32(1)))
        red, green, blue = red * scale, green * scale, blue * scale
    return np.uint32(
        encode_channel(red, encoding)
        | (encode_channel(green, encoding) << np.int32(8))
        | (encode_channel(blue, encoding) << np.int32(16))
        | (np.int32(alpha * np.float32(255) + np.float32(0.5)) << np.int32(24))
    )


@helper
def encode_channel(value, encoding):
    """The nearest of 256 levels of the sRGB curve; exact, because no bucket holds two thresholds."""
    value = min(max(value, np.float32(0)), np.float32(1))
    level = encoding.bucket_level[np.uint32(value * np.float32(N_BUCKET))]
    return np.int32(level + np.int32(value >= encoding.threshold[np.uint32(level) + np.uint32(1)]))


@kernel
def encode_picture(color, alpha, encoding, out_rgba):
    """Encode a whole picture whose linear colours are known: for the policy GLOBAL, which needs the largest of them."""
    for j in range(np.uint64(color.shape[0])):
        for i in range(np.uint64(color.shape[1])):
            out_rgba[j, i] = encode_pixel(color[j, i, 0], color[j, i, 1], color[j, i, 2], alpha[j, i], encoding)


@helper
def clean(canvas, n_row):
    """Make the z-buffer empty again where it was touched, padding included."""
    for row in range(np.uint64(n_row)):
        group = row >> np.uint64(GROUP_SHIFT)
        left, right = canvas.left[group], canvas.right[group]
        if left < right:
            start = row * np.uint64(canvas.pitch)
            canvas.words[start + np.uint64(left) : start + np.uint64(right + PADDING)] = CLEAR
    canvas.left[:] = np.int64(1 << 30)
    canvas.right[:] = np.int64(-1)
