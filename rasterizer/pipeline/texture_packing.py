"""Textures as texture_lookup.py reads them: 8 bytes a texel, and how much their colours err.

In:  `Textures` (texture_sampling.py).
Out: `PackedTextures`: each channel of a texel in 16 bits, a border of one texel around each mip level, which holds what
     the wrap puts there. `texture_error` says how far colours looked up in them are from exact ones.

A texture of w × h texels needs 8 bytes for each, with mip levels a third more, and 48·(w + h) bytes for the borders.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from .texel_positions import NEAREST_ERROR, PackedTexture, first_texel
from .textures import FILTER_NEAREST, FILTER_TRILINEAR, WRAP_REPEAT, Textures

OF_S, OF_T, OF_LEVEL, ALWAYS = range(4)  # columns of `errors`
# What a lookup loses itself, see `texture_error`.
POSITION_ERROR, FIXED_POINT_ERROR, WEIGHT_ERROR = 2.0**-16, 2.0**-29, 2.0**-16
LEVEL_ERROR, VALUE_ERROR = 1e-5, 0.51 / 65535.0 + 2.0**-21


class PackedTextures(NamedTuple):
    """All textures of a scene for texture_lookup.py, one behind the other."""

    texels: np.ndarray  # (4 * n_texel,) int16, see texel_blend.py
    first_texels: np.ndarray  # (n_texture + 1,) int64
    sizes: np.ndarray  # (n_texture, 3) int64: width, height, mip levels
    filters: np.ndarray  # (n_texture,) int64, FILTER_...
    wraps: np.ndarray  # (n_texture, 2) int64, WRAP_... along s and t
    steps: np.ndarray  # (n_texture,) float32: intensity of a step between two values
    errors: np.ndarray  # (n_texture, 4) float64, see `texture_error`


@helper
def packed_texture(textures, texture):
    """Return one of the textures, an `index`."""
    first, end = index(textures.first_texels[texture]), index(textures.first_texels[texture + index(1)])
    width, height, n_level = textures.sizes[texture, 0], textures.sizes[texture, 1], textures.sizes[texture, 2]
    return PackedTexture(
        textures.texels[first << index(2) : end << index(2)],
        np.int32(width),
        np.int32(height),
        np.int32(n_level - 1),
        textures.filters[texture],
        (textures.wraps[texture, 0], textures.wraps[texture, 1]),
        textures.steps[texture],
    )


@helper
def texture_error(textures, texture, s_error, t_error, level_error):
    """Bound how far a channel of what `texture_lookup.read_texels` finds is from exact, linear intensity.

    Parameters
    ----------
    textures : PackedTextures
    texture : its number, an `index`
    s_error, t_error : of the texture coordinates s and t, texels of the picture; see `texcoord_error`
    level_error : of the mip level that the planes would give exactly; 1.45 times the error of its derivatives in texels
        a sample is enough, as d log2 g = dg / (g·ln 2) and levels above 0 have g > 1

    Returns
    -------
    the bound, float64; infinite for what is no number. Of the filter "nearest" that of samples that aren't doubtful,
    and infinite where s or t errs by more than NEAREST_ERROR

    Notes
    -----
    Along a row a bilinear mean changes by at most d_s a texel, the largest difference of two neighbouring texels of its
    mip level, the wrap included; down a column by d_t. A mip level of w of the picture's W texels shrinks an error to
    w/W times as many texels: it errs by s_error·w/W·d_s, and by POSITION_ERROR + FIXED_POINT_ERROR·w texels more, which
    are lost in the look-up.

    The weight of the fourth texel is rounded by WEIGHT_ERROR, and those of the others so that their sum stays: with it
    changes |c00 - c01 - c10 + c11| <= 2·min(d_s, d_t).

    A level that errs by e mixes two means by a share that errs by e. They differ by at most D, see `level_difference`;
    that also holds where e leads to other levels, as the mixture is continuous. LEVEL_ERROR is what the look-up adds:
    0.74e-5 of the logarithm's polynomial, 2^-24·10 of its rounding, 2^-24·8 of that of the squares, and 2^-20 where
    levels end.

    Values are rounded to 16 bits by half a step, and eight times in float32.
    """
    row, kind = textures.errors[texture], textures.filters[texture]
    if kind == FILTER_NEAREST:
        return row[index(ALWAYS)] if (s_error <= NEAREST_ERROR) & (t_error <= NEAREST_ERROR) else np.inf
    bound = s_error * row[index(OF_S)] + t_error * row[index(OF_T)] + row[index(ALWAYS)]
    bound += level_error * row[index(OF_LEVEL)] if kind == FILTER_TRILINEAR else 0.0
    return bound if bound >= 0.0 else np.inf


def pack_textures(textures: Textures) -> PackedTextures:
    """Pack all textures of a scene.

    A texture whose colours are at most 2^k, k >= 0 or less, has steps of 2^k/65535.
    """
    n_texture = len(textures.filters)
    levels = [textures.mip_levels[first:end] for first, end in _pairs(textures.first_levels)]
    sizes = np.array([(*rows[0, 1:], len(rows)) for rows in levels], np.int64).reshape(n_texture, 3)
    counts = [first_texel(*(np.int32(number) for number in size)) for size in sizes]
    first_texels = np.cumsum([0, *counts]).astype(np.int64)
    texels = np.zeros((int(first_texels[-1]), 4), np.int16)
    steps, errors = np.zeros(n_texture, np.float32), np.zeros((n_texture, 4))
    for k, rows in enumerate(levels):
        pictures = [textures.texels[4 * start : 4 * (start + w * h)].reshape(h, w, 4) for start, w, h in rows]
        largest = largest_color(pictures[0].reshape(-1, 4))
        scale = 2.0 ** np.ceil(np.log2(max(largest, 2.0**-40)))
        steps[k] = scale / 65535.0
        out = texels[first_texels[k] : first_texels[k + 1]]
        wraps = tuple(textures.wraps[k])
        differences = [
            pack_level(picture, wraps, scale, _bordered(out, sizes[k], level)) for level, picture in enumerate(pictures)
        ]
        errors[k] = error_factors([picture.shape for picture in pictures], differences, scale, textures.filters[k])
    return PackedTextures(texels.ravel(), first_texels, sizes, textures.filters, textures.wraps, steps, errors)


def _pairs(numbers):
    """Pairs of neighbouring numbers."""
    return zip(numbers[:-1], numbers[1:], strict=True)


def _bordered(texels, size, level):
    """Return the part (h + 2, w + 2, 4) of a texture's texels that is one mip level."""
    width, height = max(int(size[0]) >> level, 1), max(int(size[1]) >> level, 1)
    first = int(first_texel(np.int32(size[0]), np.int32(size[1]), np.int32(level)))
    return texels[first : first + (width + 2) * (height + 2)].reshape(height + 2, width + 2, 4)


def pack_level(picture, wraps, scale, out) -> tuple[float, float]:
    """Write a mip level with its border; return the largest differences of neighbouring texels.

    Parameters
    ----------
    picture : (h, w, 4) float32, colours from 0 to `scale`, alpha to 1
    wraps : WRAP_... along s and t
    scale : a power of two
    out : (h + 2, w + 2, 4) int16

    Returns
    -------
    (d_s, d_t) : of two neighbours in a row, of two in a column; over all channels, across the border, too
    """
    height, width = picture.shape[:2]
    repeats_s, repeats_t = (bool(wrap == WRAP_REPEAT) for wrap in wraps)
    d_s, d_t = pack_texels(
        picture.reshape(height, 4 * width), repeats_s, repeats_t, 65535.0 / scale, out.reshape(height + 2, -1)
    )
    left, right = (-2, 1) if repeats_s else (1, -2)
    out[:, 0], out[:, -1] = out[:, left], out[:, right]
    above, below = (-2, 1) if repeats_t else (1, -2)
    out[0], out[-1] = out[above], out[below]
    return d_s, d_t


@kernel
def pack_texels(picture, repeats_s, repeats_t, steps_per_unit, out):
    """Write the texels of a mip level, in steps; return the largest differences of neighbours, see `pack_level`.

    Parameters
    ----------
    picture : (h, 4 * w) float32
    steps_per_unit : of colours; of alpha it is 65535
    out : (h + 2, 4 * (w + 2)) int16; its border is left alone
    """
    height, n = index(picture.shape[0]), index(picture.shape[1])
    of_color, of_alpha, zero = np.float32(steps_per_unit), np.float32(65535.0), np.float32(2.0**15)
    pixel, one = index(4), index(1)
    across = down = np.int32(0)  # the bits of positive floats are in order as the floats are
    for j in range(height):
        row, target = picture[j], out[j + one]
        below = picture[j + one if j + one < height else (index(0) if repeats_t else j)]
        for i in range(n):
            per_unit = of_alpha if i & index(3) == index(3) else of_color
            target[i + pixel] = np.int16(np.rint(row[i] * per_unit) - zero)
        for i in range(n):
            down = max(down, np.float32(abs(below[i] - row[i])).view(np.int32))
        for i in range(n - pixel):
            across = max(across, np.float32(abs(row[i + pixel] - row[i])).view(np.int32))
        if repeats_s:
            for i in range(pixel):
                across = max(across, np.float32(abs(row[i] - row[n - pixel + i])).view(np.int32))
    return float(np.int32(across).view(np.float32)), float(np.int32(down).view(np.float32))


@kernel
def largest_color(picture):
    """Return the largest value of red, green and blue of a picture, (n, 4) float32, none of them below 0."""
    largest = np.int32(0)
    for k in range(index(len(picture))):
        for channel in range(index(3)):
            largest = max(largest, np.float32(picture[k, channel]).view(np.int32))
    return float(np.int32(largest).view(np.float32))


def error_factors(shapes, differences, scale, kind) -> tuple[float, float, float, float]:
    """Return what `texture_error` multiplies by the errors of s, of t and of the level, and what it adds.

    Parameters
    ----------
    shapes : (h, w, ...) of each mip level
    differences : (d_s, d_t) of each
    scale : at least the largest colour
    kind : FILTER_...
    """
    of_value = VALUE_ERROR * max(scale, 1.0)
    if kind == FILTER_NEAREST:
        return 0.0, 0.0, 0.0, of_value
    sizes, d = np.array([shape[1::-1] for shape in shapes], np.float64), np.array(differences)
    of_s, of_t = (sizes / sizes[0] * d).max(axis=0)
    of_texcoords = ((POSITION_ERROR + FIXED_POINT_ERROR * sizes) * d).sum(axis=1) + 2.0 * WEIGHT_ERROR * d.min(axis=1)
    of_level = level_difference(d, max(scale, 1.0))
    return of_s, of_t, of_level, of_texcoords.max() + LEVEL_ERROR * of_level + of_value


def level_difference(differences, largest) -> float:
    """Bound the difference of what a mip level and the next one show at any point.

    Both show means of texels of the finer level of n texels. The coarser one, of m, is interpolated between two of its
    texels, which cover 2·n/m of the finer: four, or where n is odd, a range of up to five that touches six. The finer
    one is interpolated between two of the same. So texels are at most 5 apart along each axis; and no value is below 0
    or above the largest.

    differences : (n_level, 2), d_s and d_t of each level
    """
    return min(5.0 * differences[:-1].sum(axis=1).max(initial=0.0), largest)
