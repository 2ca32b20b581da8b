"""Stage 7, resolve: a band's intensities into the picture, while they are in the cache.

In:  the band's z-buffer (what is covered) and radiance (linear intensities).
Out: rows of the picture: linear colour float32, and red, green, blue, alpha in 8 bits. The z-buffer is left clean for the next band.

Samples are averaged over each pixel (box filter, linear light) where there are several; a pixel's colour is the mean of its covered
samples, its alpha the covered fraction. Then the out-of-range policy, the sRGB curve (IEC 61966-2-1) and rounding to the nearest level.
"""

from typing import NamedTuple

import numpy as np

from .._kernel import borrow, helper, kernel
from .rows import CHUNK, NEXT_CHANNEL
from .scan import CLEAR, GROUP_SHIFT, PADDING

N_BUCKET = 4096  # finer than the smallest step between thresholds, 1/(255 · 12.92) = 1/3295: a bucket holds at most one
CLAMP, GLOBAL, LOCAL = 0, 1, 2  # out-of-range policies
ALPHA = np.uint64(3 * CHUNK)  # a chunk of pixels: rows of red, green, blue and alpha


class Encoding(NamedTuple):
    """How linear colour becomes 8 bits."""

    is_grey: bool  # all colours of the picture are grey
    tint: np.ndarray  # (3,) float32: a picture with one channel is this colour times the intensity
    background: np.ndarray  # (3,) float32, linear; read only if has_background
    has_background: bool
    policy: int  # CLAMP, GLOBAL or LOCAL
    scale: float  # GLOBAL: 1 / the picture's largest component, if that is above 1


class Picture(NamedTuple):
    """What is written; an array that isn't wanted has no rows."""

    color: np.ndarray  # (height, width, 3) float32, linear
    rgba: np.ndarray  # (height, width) uint32, a pixel's bytes in memory order red, green, blue, alpha
    alpha: np.ndarray  # (height, width) float32


def make_srgb_tables():
    """Return the level at the lower end of each bucket, (N_BUCKET + 1,) int32, and the smallest float32 of each level, (258,).

    Behind the last level the threshold is infinite.
    """
    level = np.arange(1, 256)
    encoded = (level - 0.5) / 255.0
    exact = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    threshold = exact.astype(np.float32)
    threshold = np.where(threshold < exact, np.nextafter(threshold, np.float32(2)), threshold)
    threshold = np.concatenate([[0], threshold, [np.inf, np.inf]]).astype(np.float32)
    lower_end = np.arange(N_BUCKET + 1, dtype=np.float32) / N_BUCKET
    bucket_level = (np.searchsorted(threshold[:256], lower_end, side="right") - 1).astype(np.int32)
    return bucket_level, threshold


# Constants of the compiled code: what can't change can't be aliased either, and the look-ups become vector instructions.
BUCKET_LEVEL, THRESHOLD = make_srgb_tables()


@kernel
def resolve(canvas, radiance, y_start, y_stop, factor, encoding, out):
    """Write the rows y_start..y_stop of the picture from the band; clean the band; return how many samples are covered.

    `factor` is the number of samples a pixel along each axis; the band's rows are y_start*factor .. y_stop*factor.
    """
    words, radiance = borrow(canvas.words), borrow(radiance)
    out = Picture(borrow(out.color), borrow(out.rgba), borrow(out.alpha))
    encoding = borrow_encoding(encoding)
    pixels, levels = np.empty(4 * CHUNK, np.float32), np.empty(3 * CHUNK, np.int32)
    n_covered = 0
    for j in range(y_start, y_stop):
        row = (j - y_start) * factor
        first, stop = touched_columns(canvas, row, factor)
        if encoding.has_background:
            fill_background(out, j, encoding)
        for left in range(first, stop, CHUNK):
            n = np.uint64(min(stop - left, CHUNK))
            if factor == 1:
                place = np.uint64(row * canvas.pitch + left)
                n_covered += take_samples(words[place : place + n], radiance, place, pixels)
            else:
                n_covered += average_samples(words, canvas.pitch, radiance, row, left, factor, n, pixels)
            finish_colors(pixels, n, radiance.shape[0], encoding)
            if out.color.shape[0] > 0:
                write_colors(pixels, n, out.color[np.uint64(j), np.uint64(left) :], out.alpha[np.uint64(j), np.uint64(left) :])
            if out.rgba.shape[0] > 0:
                encode_chunk(pixels, levels, n, encoding, out.rgba[np.uint64(j), np.uint64(left) :])
    clean(canvas, (y_stop - y_start) * factor)
    return n_covered


@helper
def borrow_encoding(encoding):
    """The encoding with arrays that count no references."""
    return Encoding(
        encoding.is_grey, borrow(encoding.tint), borrow(encoding.background), encoding.has_background, encoding.policy,
        encoding.scale,
    )  # fmt: skip


@helper
def touched_columns(canvas, row, factor):
    """Pixels that any sample of `factor` rows may have touched, as a half-open range."""
    left, right = np.int64(canvas.width), np.int64(0)
    for sub in range(row, row + factor):
        group = np.uint64(sub) >> np.uint64(GROUP_SHIFT)
        left, right = min(left, canvas.left[group]), max(right, canvas.right[group])
    return left // factor, (right + factor - 1) // factor


@helper
def take_samples(words, radiance, place, pixels):
    """One sample a pixel: its intensities and its coverage; return how many are covered."""
    n = np.uint64(len(words))
    zero, one = np.float32(0), np.float32(1)
    n_covered = np.int64(0)
    for i in range(n):
        n_covered += words[i] < CLEAR
        pixels[ALPHA + i] = one if words[i] < CLEAR else zero
    for channel in range(np.uint64(radiance.shape[0])):
        source, target = radiance[channel, place : place + n], channel * NEXT_CHANNEL
        for i in range(n):
            pixels[target + i] = np.float32(source[i]) if words[i] < CLEAR else zero
    return n_covered


@helper
def average_samples(words, pitch, radiance, row, left, factor, n, pixels):
    """Mean intensities of every pixel's covered samples, and the covered share; return how many samples are covered."""
    n_channel, count = np.uint64(radiance.shape[0]), np.int64(0)
    for i in range(n):
        sum0 = sum1 = sum2 = 0.0  # float64: sixteen roundings of float32 would show at tolerance 0
        n_covered = np.int32(0)
        for sub in range(row, row + factor):
            place = np.uint64(sub * pitch + (left + np.int64(i)) * factor)
            for k in range(place, place + np.uint64(factor)):
                if words[k] < CLEAR:
                    n_covered += np.int32(1)
                    sum0 += radiance[0, k]
                    if n_channel > np.uint64(1):
                        sum1 += radiance[1, k]
                        sum2 += radiance[2, k]
        scale = 1.0 / max(n_covered, np.int32(1))
        pixels[i] = sum0 * scale
        if n_channel > np.uint64(1):
            pixels[NEXT_CHANNEL + i] = sum1 * scale
            pixels[NEXT_CHANNEL + NEXT_CHANNEL + i] = sum2 * scale
        pixels[ALPHA + i] = np.float32(n_covered) / np.float32(factor * factor)
        count += np.int64(n_covered)
    return count


@helper
def finish_colors(pixels, n, n_channel, encoding):
    """Spread one channel to three; let the background show through what isn't covered."""
    if n_channel == 1:
        red, green, blue = encoding.tint[0], encoding.tint[1], encoding.tint[2]
        for i in range(n):
            intensity = pixels[i]
            pixels[i] = intensity * red
            pixels[NEXT_CHANNEL + i] = intensity * green
            pixels[NEXT_CHANNEL + NEXT_CHANNEL + i] = intensity * blue
    if encoding.has_background:
        one = np.float32(1)
        for channel in range(np.uint64(3)):
            behind, row = encoding.background[channel], channel * NEXT_CHANNEL
            for i in range(n):
                pixels[row + i] = pixels[row + i] * pixels[ALPHA + i] + behind * (one - pixels[ALPHA + i])
        for i in range(n):
            pixels[ALPHA + i] = one


@helper
def write_colors(pixels, n, color, alpha):
    """Write linear colours as they are."""
    for i in range(n):
        color[i, 0] = pixels[i]
        color[i, 1] = pixels[NEXT_CHANNEL + i]
        color[i, 2] = pixels[NEXT_CHANNEL + NEXT_CHANNEL + i]
        alpha[i] = pixels[ALPHA + i]


@helper
def fill_background(out, j, encoding):
    """Fill a row with the background."""
    red, green, blue = encoding.background[0], encoding.background[1], encoding.background[2]
    pixel = encode_pixel(red, green, blue, np.float32(1), encoding)
    for i in range(np.uint64(out.rgba.shape[1])):
        out.rgba[np.uint64(j), i] = pixel
    if out.color.shape[0] > 0:
        for i in range(np.uint64(out.color.shape[1])):
            out.color[np.uint64(j), i, 0] = red
            out.color[np.uint64(j), i, 1] = green
            out.color[np.uint64(j), i, 2] = blue
            out.alpha[np.uint64(j), i] = np.float32(1)


@helper
def encode_chunk(pixels, levels, n, encoding, out):
    """Apply the out-of-range policy, encode, and pack a chunk of pixels into bytes."""
    if encoding.policy != CLAMP:
        for i in range(n):
            scale = range_scale(pixels[i], pixels[NEXT_CHANNEL + i], pixels[NEXT_CHANNEL + NEXT_CHANNEL + i], encoding)
            pixels[i] *= scale
            pixels[NEXT_CHANNEL + i] *= scale
            pixels[NEXT_CHANNEL + NEXT_CHANNEL + i] *= scale
    # A grey picture has three equal channels.
    n_different = 1 if encoding.is_grey else 3
    for channel in range(np.uint64(n_different)):
        row = channel * NEXT_CHANNEL
        for i in range(n):
            levels[row + i] = encode_channel(pixels[row + i], encoding)
    green = NEXT_CHANNEL if n_different == 3 else np.uint64(0)
    blue = green + green
    for i in range(n):
        alpha = np.int32(pixels[ALPHA + i] * np.float32(255) + np.float32(0.5))
        out[i] = pack(levels[i], levels[green + i], levels[blue + i], alpha)


@helper
def pack(red, green, blue, alpha):
    """Put four levels into the bytes red, green, blue, alpha, the first lowest."""
    return np.uint32(red | (green << np.int32(8)) | (blue << np.int32(16)) | (alpha << np.int32(24)))


@helper
def range_scale(red, green, blue, encoding):
    """What a pixel is multiplied by to bring it into the display's range."""
    if encoding.policy == GLOBAL:
        return np.float32(encoding.scale)
    return np.float32(1) / max(max(red, green), max(blue, np.float32(1)))


@helper
def encode_pixel(red, green, blue, alpha, encoding):
    """Encode one linear colour."""
    scale = np.float32(1) if encoding.policy == CLAMP else range_scale(red, green, blue, encoding)
    return pack(
        encode_channel(red * scale, encoding),
        encode_channel(green * scale, encoding),
        encode_channel(blue * scale, encoding),
        np.int32(alpha * np.float32(255) + np.float32(0.5)),
    )


@helper
def encode_channel(value, encoding):
    """The nearest of 256 levels of the sRGB curve, by one look-up and one comparison: no bucket holds two thresholds."""
    value = min(value, np.float32(1)) if value > np.float32(0) else np.float32(0)  # 0 where it isn't a number, too
    level = BUCKET_LEVEL[np.uint32(value * np.float32(N_BUCKET))]
    return np.int32(level + np.int32(value >= THRESHOLD[np.uint32(level) + np.uint32(1)]))


@kernel
def encode_picture(color, alpha, encoding, out_rgba):
    """Encode a whole picture whose linear colours are known: for the policy GLOBAL, which needs the largest of them."""
    for j in range(np.uint64(color.shape[0])):
        for i in range(np.uint64(color.shape[1])):
            out_rgba[j, i] = encode_pixel(color[j, i, 0], color[j, i, 1], color[j, i, 2], alpha[j, i], encoding)


@helper
def clean(canvas, n_row):
    """Make the z-buffer empty again where it was touched, padding included."""
    words = borrow(canvas.words)
    for row in range(np.uint64(n_row)):
        group = row >> np.uint64(GROUP_SHIFT)
        left, right = canvas.left[group], canvas.right[group]
        if left < right:
            start = row * np.uint64(canvas.pitch)
            for place in range(start + np.uint64(left), start + np.uint64(right + PADDING)):
                words[place] = CLEAR
    for group in range(np.uint64(len(canvas.left))):
        canvas.left[group], canvas.right[group] = np.int64(1 << 30), np.int64(-1)
