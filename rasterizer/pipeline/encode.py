"""Stage 8, encode: linear colour into the bytes of a picture.

In:  linear colours and alpha, float32, a batch of pixels or a whole picture.
Out: red, green, blue and alpha in 8 bits: the out-of-range policy, the sRGB curve (IEC 61966-2-1), and rounding to the
     nearest level.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from .fragments import BATCH_SIZE, NEXT

LEAST, MOST = np.float32(2.0**-13), np.float32(1 - 2.0**-24)  # below the first threshold and above the last
BUCKET_SHIFT = np.int32(16)  # floats with the same upper 16 bits share a bucket: 128 buckets an octave
FIRST_BUCKET = np.int32(LEAST.view(np.int32) >> BUCKET_SHIFT)
REST_MASK = np.int32((1 << BUCKET_SHIFT) - 1)
RANGE_CLAMP, RANGE_GLOBAL, RANGE_LOCAL = 0, 1, 2  # out-of-range policies
# A batch of pixels is one flat array, as a batch of fragments is: red from 0 on, green from NEXT on, blue, alpha.
ALPHA = index(3 * BATCH_SIZE)
PIXELS_SHAPE = (4 * BATCH_SIZE,)


class Encoding(NamedTuple):
    """How linear colour becomes 8 bits."""

    is_grey: bool  # all colours are grey, also the background: what has one channel is encoded once
    tint: np.ndarray  # (3,) float32: a picture with one channel is this colour times the intensity
    background: np.ndarray  # (3,) float32, linear; black unless has_background
    has_background: bool
    policy: int  # RANGE_CLAMP, RANGE_GLOBAL or RANGE_LOCAL
    scale: float  # RANGE_GLOBAL: 1 / the picture's largest component, if that is above 1
    blank: int = 0  # the bytes of a pixel in which nothing is drawn, see `with_blank`


# ---------------------------------------------------------------- the sRGB curve


def srgb_thresholds():
    """Return the smallest float32 that is nearest to each of the levels 1..255 of the sRGB curve, (255,)."""
    encoded = (np.arange(1, 256) - 0.5) / 255.0
    exact = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    thresholds = exact.astype(np.float32)
    return np.where(thresholds < exact, np.nextafter(thresholds, np.float32(2)), thresholds)


def make_level_table():
    """Return an int32 for every bucket of floats from LEAST to MOST: the sum of it and of the lower bits of a float in
    the bucket has the float's level in its upper bits.

    A bucket is 2^-7 of its octave wide, and no two thresholds come so close: so it holds one threshold at most, and the
    sum carries into the level from there on. (Positive floats are ordered as their bits are.)
    """
    thresholds = srgb_thresholds().view(np.int32)
    starts = np.arange(FIRST_BUCKET, (MOST.view(np.int32) >> BUCKET_SHIFT) + 1, dtype=np.int32) << BUCKET_SHIFT
    levels = np.searchsorted(thresholds, starts, side="right")
    following = np.append(thresholds, np.iinfo(np.int32).max)[levels]
    to_carry = np.where(following <= starts + REST_MASK, starts + (1 << BUCKET_SHIFT) - following, 0)
    return ((levels << BUCKET_SHIFT) + to_carry).astype(np.int32)


# A constant of the compiled code: what can't change can't be aliased, and look-ups become vector instructions.
LEVEL_TABLE = make_level_table()


@helper
def encode_channel(value):
    """Return the nearest of 256 levels of the sRGB curve, by one look-up and one addition; see make_level_table."""
    value = min(value, MOST) if value > LEAST else LEAST  # LEAST where it isn't a number, too
    bits = np.float32(value).view(np.int32)
    bucket = np.uint32(np.int32(bits >> BUCKET_SHIFT) - FIRST_BUCKET)
    return np.int32(np.int32(LEVEL_TABLE[bucket] + np.int32(bits & REST_MASK)) >> BUCKET_SHIFT)


@helper
def encode_alpha(alpha):
    """Return the nearest of 256 levels of an alpha within 0..1."""
    return np.int32(alpha * np.float32(255) + np.float32(0.5))


@helper
def pack_bytes(red, green, blue, alpha):
    """Put four levels into the bytes red, green, blue, alpha, the first lowest."""
    return np.uint32(red | (green << np.int32(8)) | (blue << np.int32(16)) | (alpha << np.int32(24)))


# ---------------------------------------------------------------- pixels


@helper
def range_scale(red, green, blue, encoding):
    """Return what a pixel is multiplied by to bring it into the display's range."""
    if encoding.policy == RANGE_GLOBAL:
        return np.float32(encoding.scale)
    return np.float32(1) / max(max(red, green), max(blue, np.float32(1)))


@helper
def encode_pixel(red, green, blue, alpha, encoding):
    """Encode one linear colour."""
    scale = np.float32(1) if encoding.policy == RANGE_CLAMP else range_scale(red, green, blue, encoding)
    return pack_bytes(
        encode_channel(red * scale), encode_channel(green * scale), encode_channel(blue * scale), encode_alpha(alpha)
    )


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
    for channel in range(index(n_different)):
        first = channel * NEXT
        for i in range(n):
            levels[first + i] = encode_channel(pixels[first + i])
    green = NEXT if n_different == 3 else index(0)
    blue = green + green
    for i in range(n):
        out[i] = pack_bytes(levels[i], levels[green + i], levels[blue + i], encode_alpha(pixels[ALPHA + i]))


def with_blank(encoding: Encoding) -> Encoding:
    """Return the encoding with the bytes of a pixel in which nothing is drawn: the background, or transparent black."""
    if not encoding.has_background:
        return encoding._replace(blank=0)
    rgba = np.empty((1, 1), np.uint32)
    encode_picture(encoding.background.reshape(1, 1, 3), np.ones((1, 1), np.float32), encoding, rgba)
    return encoding._replace(blank=int(rgba[0, 0]))


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
    for j in range(index(color.shape[0])):
        for i in range(index(color.shape[1])):
            out_rgba[j, i] = encode_pixel(color[j, i, 0], color[j, i, 1], color[j, i, 2], alpha[j, i], encoding)
