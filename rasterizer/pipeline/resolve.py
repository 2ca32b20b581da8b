"""Stage 7, resolve: a band's intensities into the picture, while they are in the cache.

In:  the band's z-buffer (what is covered) and radiance (linear intensities).
Out: all of the band's rows of the picture: linear colour float32, and red, green, blue, alpha in 8 bits. The z-buffer
is left clean for the next band.

Samples are averaged over each pixel (box filter, linear light) where there are several; a pixel's colour is the mean of
its covered samples, its alpha the covered fraction. Then the out-of-range policy, the sRGB curve (IEC 61966-2-1) and
rounding to the nearest level.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import borrow, helper, kernel
from .fragments import CHUNK, NEXT_CHANNEL
from .visibility import CLEAR, STRIP_SHIFT, clear

LEAST, MOST = np.float32(2.0**-13), np.float32(1 - 2.0**-24)  # below the first threshold and above the last
BUCKET_SHIFT = np.int32(16)  # floats with the same upper 16 bits share a bucket: 128 buckets an octave
FIRST_BUCKET = np.int32(LEAST.view(np.int32) >> BUCKET_SHIFT)
REST_MASK = np.int32((1 << BUCKET_SHIFT) - 1)
CLAMP, GLOBAL, LOCAL = 0, 1, 2  # out-of-range policies
ALPHA = np.uint64(3 * CHUNK)  # a chunk of pixels: rows of red, green, blue and alpha


class Encoding(NamedTuple):
    """How linear colour becomes 8 bits."""

    is_grey: bool  # all colours of the picture are grey
    tint: np.ndarray  # (3,) float32: a picture with one channel is this colour times the intensity
    background: np.ndarray  # (3,) float32, linear; black unless has_background
    has_background: bool
    policy: int  # CLAMP, GLOBAL or LOCAL
    scale: float  # GLOBAL: 1 / the picture's largest component, if that is above 1


class Picture(NamedTuple):
    """What is written; an array that isn't wanted has no rows."""

    color: np.ndarray  # (height, width, 3) float32, linear
    rgba: np.ndarray  # (height, width) uint32, a pixel's bytes in memory order red, green, blue, alpha
    alpha: np.ndarray  # (height, width) float32


def srgb_thresholds():
    """Return the smallest float32 that is nearest to each of the levels 1..255 of the sRGB curve, (255,)."""
    encoded = (np.arange(1, 256) - 0.5) / 255.0
    exact = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    threshold = exact.astype(np.float32)
    return np.where(threshold < exact, np.nextafter(threshold, np.float32(2)), threshold)


def make_level_table():
    """Return an int32 for every bucket of floats from LEAST to MOST: the sum of it and of the lower bits of a float in
    the bucket has the float's level in its upper bits.

    A bucket is 2^-7 of its octave wide, and no two thresholds come so close: so it holds one threshold at most, and the
    sum carries into the level from there on. (Positive floats are ordered as their bits are.)
    """
    threshold = srgb_thresholds().view(np.int32)
    start = np.arange(FIRST_BUCKET, (MOST.view(np.int32) >> BUCKET_SHIFT) + 1, dtype=np.int32) << BUCKET_SHIFT
    level = np.searchsorted(threshold, start, side="right")
    following = np.append(threshold, np.iinfo(np.int32).max)[level]
    to_carry = np.where(following <= start + REST_MASK, start + (1 << BUCKET_SHIFT) - following, 0)
    return ((level << BUCKET_SHIFT) + to_carry).astype(np.int32)


# A constant of the compiled code: what can't change can't be aliased, and look-ups become vector instructions.
LEVEL_TABLE = make_level_table()


@kernel
def resolve(canvas, radiance, layers, y_start, y_stop, factor, encoding, out):
    """Write the rows y_start..y_stop of the picture from the band; clean the band; return how many samples are covered.

    `factor` is the number of samples a pixel along each axis; the band's rows are y_start*factor .. y_stop*factor.
    `layers` is None, or takes the place of the radiance where surfaces are transparent (a_buffer.py).
    """
    words, radiance = borrow(canvas.entries), borrow(radiance)
    out = Picture(borrow(out.color), borrow(out.rgba), borrow(out.alpha))
    encoding = borrow_encoding(encoding)
    pixels, levels = np.empty(4 * CHUNK, np.float32), np.empty(3 * CHUNK, np.int32)
    behind, n_covered = encoding.background, 0
    blank = (
        encode_pixel(behind[0], behind[1], behind[2], np.float32(1), encoding)
        if encoding.has_background
        else np.uint32(0)
    )
    # The usual case: bytes alone, a sample a pixel, nothing to mix or to scale.
    n_channel = radiance.shape[0]
    is_plain = (factor == 1) & (out.color.shape[0] == 0) & (encoding.policy == CLAMP) & (not encoding.has_background)
    is_plain &= (n_channel == 3) | encoding.is_grey
    # One row of pixels is enough where no more is read: in a grey picture of bytes.
    is_single = encoding.is_grey and encoding.policy == CLAMP and out.color.shape[0] == 0
    for j in range(y_start, y_stop):
        row = (j - y_start) * factor
        first, stop = touched_columns(canvas, row, factor)
        fill_blank(out, j, first, stop, encoding, blank)
        if layers is None:
            if is_plain:
                start, n = np.uint64(row * canvas.pitch + first), np.uint64(stop - first)
                samples, pixels_out = words[start : start + n], out.rgba[np.uint64(j), np.uint64(first) :]
                n_covered += encode_samples(samples, radiance, start, pixels_out)
                continue
        for left in range(first, stop, CHUNK):
            n = np.uint64(min(stop - left, CHUNK))
            if layers is not None:
                n_covered += average_layers(layers.color, layers.opacity, canvas.pitch, row, left, factor, n, pixels)
            elif factor == 1:
                place = np.uint64(row * canvas.pitch + left)
                n_covered += take_samples(words[place : place + n], radiance, place, pixels)
            else:
                n_covered += average_samples(words, canvas.pitch, radiance, row, left, factor, n, pixels)
            if n_channel == 1 and not is_single:
                spread_channel(pixels, n, encoding)
            if encoding.has_background:
                show_background(pixels, n, encoding, 1 if is_single else 3)
            if out.color.shape[0] > 0:
                write_colors(
                    pixels, n, out.color[np.uint64(j), np.uint64(left) :], out.alpha[np.uint64(j), np.uint64(left) :]
                )
            if out.rgba.shape[0] > 0:
                encode_chunk(pixels, levels, n, encoding, out.rgba[np.uint64(j), np.uint64(left) :])
    clear(canvas, (y_stop - y_start) * factor)
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
    """Pixels that any sample of `factor` rows may have touched, as a half-open range; where there are none, an empty
    one."""
    left, right = np.int64(canvas.width), np.int64(0)
    for sub in range(row, row + factor):
        group = np.uint64(sub) >> np.uint64(STRIP_SHIFT)
        left, right = min(left, canvas.left[group]), max(right, canvas.right[group])
    return (left // factor, (right + factor - 1) // factor) if left < right else (np.int64(0), np.int64(0))


@helper
def encode_samples(words, radiance, start, out):
    """Encode one sample a pixel, a row in one loop; transparent black where none is covered; return how many are
    covered."""
    n = np.uint64(len(words))
    blank, opaque = np.uint32(0), np.int32(255)
    n_covered = np.int64(0)
    red = radiance[0, start : start + n]
    if radiance.shape[0] == 1:
        for i in range(n):
            level, is_covered = encode_channel(np.float32(red[i])), words[i] < CLEAR
            out[i] = pack(level, level, level, opaque) if is_covered else blank
            n_covered += is_covered
    else:
        green, blue = radiance[1, start : start + n], radiance[2, start : start + n]
        for i in range(n):
            is_covered = words[i] < CLEAR
            r, g = encode_channel(np.float32(red[i])), encode_channel(np.float32(green[i]))
            b = encode_channel(np.float32(blue[i]))
            out[i] = pack(r, g, b, opaque) if is_covered else blank
            n_covered += is_covered
    return n_covered


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
def average_layers(color, opacities, pitch, row, left, factor, n, pixels):
    """Mean of every pixel's samples, weighted by their opacity, and their mean opacity; return how many samples show
    anything.

    `color` is weighted by opacity already; where that is 0 it may be anything.
    """
    n_channel, count = np.uint64(color.shape[0]), np.int64(0)
    if factor == 1:  # nothing to sum: loops that become vector instructions
        place = np.uint64(row * pitch + left)
        here = opacities[place : place + n]
        for i in range(n):
            count += here[i] > 0.0
            pixels[ALPHA + i] = here[i]
        for channel in range(n_channel):
            source, target = color[channel, place : place + n], channel * NEXT_CHANNEL
            for i in range(n):
                pixels[target + i] = source[i] * (1.0 / here[i]) if here[i] > 0.0 else 0.0
        return count
    for i in range(n):
        sum0 = sum1 = sum2 = opacity = 0.0
        for sub in range(row, row + factor):
            place = np.uint64(sub * pitch + (left + np.int64(i)) * factor)
            for k in range(place, place + np.uint64(factor)):
                if opacities[k] == 0.0:
                    continue
                count += 1
                opacity += opacities[k]
                sum0 += color[0, k]
                if n_channel > np.uint64(1):
                    sum1 += color[1, k]
                    sum2 += color[2, k]
        scale = 1.0 / opacity if opacity > 0.0 else 0.0
        pixels[i] = sum0 * scale
        if n_channel > np.uint64(1):
            pixels[NEXT_CHANNEL + i] = sum1 * scale
            pixels[NEXT_CHANNEL + NEXT_CHANNEL + i] = sum2 * scale
        pixels[ALPHA + i] = opacity / (factor * factor)
    return count


@helper
def spread_channel(pixels, n, encoding):
    """Make three channels of one."""
    red, green, blue = encoding.tint[0], encoding.tint[1], encoding.tint[2]
    for i in range(n):
        intensity = pixels[i]
        pixels[i] = intensity * red
        pixels[NEXT_CHANNEL + i] = intensity * green
        pixels[NEXT_CHANNEL + NEXT_CHANNEL + i] = intensity * blue


@helper
def show_background(pixels, n, encoding, n_channel):
    """Let the background show through what isn't covered."""
    one = np.float32(1)
    for channel in range(np.uint64(n_channel)):
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
def fill_blank(out, j, first, stop, encoding, blank):
    """Fill a row's pixels on both sides of first..stop, where nothing is drawn, with the background, or with
    transparent black."""
    red, green, blue = encoding.background[0], encoding.background[1], encoding.background[2]
    alpha = np.float32(1) if encoding.has_background else np.float32(0)
    for left, right in ((0, first), (stop, out.rgba.shape[1])):
        for i in range(np.uint64(left), np.uint64(right)):
            out.rgba[np.uint64(j), i] = blank
        if out.color.shape[0] > 0:
            for i in range(np.uint64(left), np.uint64(right)):
                out.color[np.uint64(j), i, 0] = red
                out.color[np.uint64(j), i, 1] = green
                out.color[np.uint64(j), i, 2] = blue
                out.alpha[np.uint64(j), i] = alpha


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
            levels[row + i] = encode_channel(pixels[row + i])
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
        encode_channel(red * scale),
        encode_channel(green * scale),
        encode_channel(blue * scale),
        np.int32(alpha * np.float32(255) + np.float32(0.5)),
    )


@helper
def encode_channel(value):
    """The nearest of 256 levels of the sRGB curve, by one look-up and one addition; see make_level_table."""
    value = min(value, MOST) if value > LEAST else LEAST  # LEAST where it isn't a number, too
    bits = np.float32(value).view(np.int32)
    bucket = np.uint32(np.int32(bits >> BUCKET_SHIFT) - FIRST_BUCKET)
    return np.int32(np.int32(LEVEL_TABLE[bucket] + np.int32(bits & REST_MASK)) >> BUCKET_SHIFT)


@kernel
def encode_picture(color, alpha, encoding, out_rgba):
    """Encode a whole picture whose linear colours are known: for the policy GLOBAL, which needs the largest of them."""
    for j in range(np.uint64(color.shape[0])):
        for i in range(np.uint64(color.shape[1])):
            out_rgba[j, i] = encode_pixel(color[j, i, 0], color[j, i, 1], color[j, i, 2], alpha[j, i], encoding)
