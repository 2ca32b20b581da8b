"""Textures as kernels look them up: their texels, and how much what is found in them errs.

In:  pictures of bytes or float32. As exact look-ups in float64 read them (texture_sampling.py), their texels are
     float32: `Textures`.
     Those of bytes stay so, and are decoded where they are read.
Out: `PackedTextures`, as look-ups in float32 read them (texture_lookup.py): each channel of a texel in 16 bits, and a
     border of one texel around each mip level, which holds what the wrap puts there. `texture_error` says how far
     colours looked up in them are from exact ones. And the planes of texture coordinates over a block of triangles
     (setup.py), as records hold them: s'/w, t'/w, 1/w, and the references, which are the same at every sample.

A texture of w × h texels needs 8 bytes for each, with mip levels a third more, and 48·(w + h) bytes for the borders.

    s, t     texture coordinates in texels of the picture: s to the right, t downwards, (0, 0) its upper left corner
    s', t'   s - s_ref, t - t_ref, relative to references that a triangle has (`texcoord_references`)
    S, T, D  s'/w, t'/w and 1/w: linear on the screen
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from . import setup as s
from .setup import MIN_INVERSE, SINGLE, compute_plane, linear_in_z, values_at

FILTER_NEAREST, FILTER_BILINEAR, FILTER_TRILINEAR = 0, 1, 2
WRAP_REPEAT, WRAP_CLAMP, WRAP_MIRROR = 0, 1, 2  # what lies outside the picture
FIRST_TEXCOORD = 6  # attributes of a textured surface in front of the texture coordinates


class Textures(NamedTuple):
    """Textures of a scene, one mip level behind the other in one array: those that are looked up in float64."""

    encoded: np.ndarray  # (4 * n_encoded,) uint8: red, green, blue and alpha of the first ones
    decoded: np.ndarray  # (2, 256) float32, what a byte of colour and one of alpha mean
    texels: np.ndarray  # (4 * n_texel,) float32: those of the texels behind them, linear
    mip_levels: np.ndarray  # (n_level, 3) int64: first texel, width, height
    first_levels: np.ndarray  # (n_texture + 1,) int64
    filters: np.ndarray  # (n_texture,) int64, FILTER_...
    wraps: np.ndarray  # (n_texture, 2) int64, WRAP_... along u and v
    of_materials: np.ndarray  # (n_material,) int64, the texture of each, -1 for none
    texcoord: int = FIRST_TEXCOORD  # the attribute that is u; v follows


class PackedTextures(NamedTuple):
    """All textures of a scene for texture_lookup.py, one behind the other."""

    texels: np.ndarray  # (4 * n_texel,) int16, see texture_lookup.py
    first_texels: np.ndarray  # (n_texture + 1,) int64
    sizes: np.ndarray  # (n_texture, 3) int64: width, height, mip levels
    filters: np.ndarray  # (n_texture,) int64, FILTER_...
    wraps: np.ndarray  # (n_texture, 2) int64, WRAP_... along s and t
    steps: np.ndarray  # (n_texture,) float32: intensity of a step between two values
    errors: np.ndarray  # (n_texture, 4) float64, see `texture_error`


class PackedTexture(NamedTuple):
    """One texture of PackedTextures."""

    texels: np.ndarray  # (4 * n,) int16, all mip levels
    width: int  # int32, texels of the first mip level
    height: int  # int32
    coarsest: int  # int32, the last mip level
    filter: int  # FILTER_...
    wraps: tuple[int, int]  # WRAP_... along s and t
    step: float  # float32, linear intensity of a step between two values of a texel


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


def pack_level(picture, decoded, wraps, scale, out, run=map) -> tuple[float, float]:
    """Write a mip level with its border; return the largest differences of neighbouring texels.

    Parameters
    ----------
    picture : (h, w, 4) float32, colours from 0 to `scale`, alpha to 1; or (h, w, 1..4) uint8
    decoded : (2, 256) float32, what a byte of colour and one of alpha mean
    wraps : WRAP_... along s and t
    scale : a power of two
    out : (h + 2, w + 2, 4) int16
    run : calls a function with every item of a sequence: `map`, or `Workers.map` on threads

    Returns
    -------
    (d_s, d_t) : of two neighbours in a row, of two in a column; over all channels, across the border, too
    """
    height, width = picture.shape[:2]
    repeats_s, repeats_t = (bool(wrap == WRAP_REPEAT) for wrap in wraps)
    target = out.reshape(height + 2, -1)

    def pack(strip):
        first, end = strip
        behind = end if end < height else (0 if repeats_t else height - 1)
        rows, below = decode_rows(picture, decoded, first, end), decode_rows(picture, decoded, behind, behind + 1)[0]
        return pack_texels(rows, below, repeats_s, 65535.0 / scale, target[first + 1 : end + 1])

    d_s, d_t = np.max(list(run(pack, strips_of(height, width))), axis=0).tolist()
    left, right = (-2, 1) if repeats_s else (1, -2)
    out[:, 0], out[:, -1] = out[:, left], out[:, right]
    above, below = (-2, 1) if repeats_t else (1, -2)
    out[0], out[-1] = out[above], out[below]
    return d_s, d_t


def strips_of(height, width) -> list[tuple[int, int]]:
    """Cut rows into strips (first, end) that stay in the cache, and that threads may take."""
    n_row = max(1, STRIP // width)
    return [(first, min(first + n_row, height)) for first in range(0, height, n_row)]


def decode_rows(picture, decoded, first, end) -> np.ndarray:
    """Return rows of a picture as `pack_level` takes it, (end - first, 4 * w) float32."""
    rows = picture[first:end].reshape(end - first, -1)
    if picture.dtype != np.uint8:
        return rows
    out = np.empty((end - first, 4 * picture.shape[1]), np.float32)
    decode_texels(rows, picture.shape[2], decoded, out)
    return out


STRIP = 2**15  # texels of a strip, half a megabyte of float32


@kernel
def decode_texels(encoded, n_channel, decoded, out):
    """Write rows of bytes as linear texels.

    Parameters
    ----------
    encoded : (h, n_channel * w) uint8: grey, grey and alpha, RGB, or RGB and alpha
    decoded : see `pack_level`
    out : (h, 4 * w) float32
    """
    of_color, of_alpha = decoded[0], decoded[1]
    step, n_color = index(n_channel), index(n_channel - 1 + n_channel % 2)
    for j in range(index(encoded.shape[0])):
        row, target = encoded[j], out[j]
        for i in range(index(out.shape[1]) >> index(2)):
            texel, first = index(4) * i, step * i
            target[texel] = of_color[row[first]]
            target[texel + index(1)] = of_color[row[first + (index(1) if n_color == index(3) else index(0))]]
            target[texel + index(2)] = of_color[row[first + n_color - index(1)]]
            target[texel + index(3)] = of_alpha[row[first + n_color]] if step != n_color else np.float32(1)


@kernel
def pack_texels(picture, below, repeats_s, steps_per_unit, out):
    """Write some rows of a mip level, in steps; return the largest differences of neighbours, see `pack_level`.

    Parameters
    ----------
    picture : (h, 4 * w) float32
    below : (4 * w,) float32, the row below the last one
    repeats_s : bool, whether the wrap repeats the picture along s
    steps_per_unit : of colours; of alpha it is 65535
    out : (h, 4 * (w + 2)) int16; its border is left alone
    """
    height, n = index(picture.shape[0]), index(picture.shape[1])
    of_color, of_alpha, zero = np.float32(steps_per_unit), np.float32(65535.0), np.float32(2.0**15)
    pixel, one = index(4), index(1)
    across = down = np.int32(0)  # the bits of positive floats are in order as the floats are
    for j in range(height):
        row, target = picture[j], out[j]
        following = picture[j + one] if j + one < height else below
        for i in range(n):
            per_unit = of_alpha if i & index(3) == index(3) else of_color
            target[i + pixel] = np.int16(np.rint(row[i] * per_unit) - zero)
        for i in range(n):
            down = max(down, np.float32(abs(following[i] - row[i])).view(np.int32))
        for i in range(n - pixel):
            across = max(across, np.float32(abs(row[i + pixel] - row[i])).view(np.int32))
        if repeats_s:
            for i in range(pixel):
                across = max(across, np.float32(abs(row[i] - row[n - pixel + i])).view(np.int32))
    return float(np.int32(across).view(np.float32)), float(np.int32(down).view(np.float32))


@kernel
def halve_texels(rows, out):
    """Write the means of two by two texels without alpha.

    Parameters
    ----------
    rows : (2 m or more, 8 * w) float32
    out : (m, 4 * w) float32
    """
    for j in range(index(out.shape[0])):
        above, below, target = rows[j + j], rows[j + j + index(1)], out[j]
        for i in range(index(out.shape[1]) >> index(2)):
            left, right = index(8) * i, index(8) * i + index(4)
            for k in range(index(4)):
                of_left = np.float64(above[left + k]) + np.float64(below[left + k])
                of_right = np.float64(above[right + k]) + np.float64(below[right + k])
                target[index(4) * i + k] = np.float32((of_left + of_right) * 0.25)


@kernel
def halve_weighted_texels(rows, out):
    """Write the means of two by two texels, their colours weighted by alpha: by nothing where all four have none.

    Parameters
    ----------
    rows, out : as in `halve_texels`
    """
    for j in range(index(out.shape[0])):
        above, below, target = rows[j + j], rows[j + j + index(1)], out[j]
        for i in range(index(out.shape[1]) >> index(2)):
            left, right, alpha = index(8) * i, index(8) * i + index(4), index(3)
            a, b = np.float64(above[left + alpha]), np.float64(below[left + alpha])
            c, d = np.float64(above[right + alpha]), np.float64(below[right + alpha])
            mean_alpha = ((a + b) + (c + d)) * 0.25
            target[index(4) * i + alpha] = np.float32(mean_alpha)
            if mean_alpha == 0.0:
                a = b = c = d = mean_alpha = 1.0
            for k in range(alpha):
                of_left = np.float64(above[left + k]) * a + np.float64(below[left + k]) * b
                of_right = np.float64(above[right + k]) * c + np.float64(below[right + k]) * d
                target[index(4) * i + k] = np.float32((of_left + of_right) * 0.25 / mean_alpha)


# ---------------------------------------------------------------- where a mip level begins

ONE, ZERO = np.int32(1), np.int32(0)


@helper
def first_texel(width, height, mip_level):
    """Return where a mip level begins among the texels of its texture; all int32.

    A level has a border of one texel about it, which holds what the wrap puts there: a sample's four texels are two
    neighbours in each of two rows. So level k has at most (w + 2)·(h + 2) texels with w <= max(W/2^k, 1) and h <=
    max(H/2^k, 1). That is W·H/4^k + 2·(W + H)/2^k + 4, or, where one of w and h is 1, 3·max(W, H)/2^k + 6. What stands
    between two levels here is at least

        a/4^k - a/4^(k+1) - 1 + b/2^k - b/2^(k+1) - 1 + 8    with a >= 4/3·W·H, b = 6·(W + H),

    that is W·H/4^k + 3·(W + H)/2^k + 6. A formula instead of a table: so loops over samples of different levels become
    vector instructions.
    """
    area, rim = level_terms(width, height)
    return level_start(area, rim, mip_level)


@helper
def level_terms(width, height):
    """Return the numbers a and b of `first_texel`."""
    area = np.int32(np.int32(np.int64(width) * np.int64(height) * 4 // 3) + ONE)
    return area, np.int32(np.int32(width + height) * np.int32(6))


@helper
def level_start(area, rim, mip_level):
    """Return `first_texel` of a texture with the numbers a and b that stand there."""
    inside = np.int32(area - shifted(area, np.int32(mip_level + mip_level)))
    border = np.int32(rim - shifted(rim, mip_level))
    return np.int32(np.int32(inside + border) + np.int32(mip_level << np.int32(3)))


@helper
def shifted(number, n_bit):
    """Return ⌊number / 2^n_bit⌋ for n_bit < 32: the compiler, which is told so, makes a shift of 32 bits of it."""
    return np.int32(number >> np.int32(n_bit & np.int32(31)))


@helper
def halved(n_texel, mip_level):
    """Return the width or height of a mip level."""
    return max(shifted(n_texel, mip_level), ONE)


# ---------------------------------------------------------------- how much colours err

OF_S, OF_T, OF_LEVEL, ALWAYS = range(4)  # columns of `errors`
NEAREST_ERROR = 2.0**-10  # of s and t, texels, where the nearest texel is looked for: one of 256 samples is doubtful
# What a lookup loses itself, see `texture_error`.
POSITION_ERROR, FIXED_POINT_ERROR, WEIGHT_ERROR = 2.0**-16, 2.0**-29, 2.0**-16
LEVEL_ERROR, VALUE_ERROR = 1e-5, 0.51 / 65535.0 + 2.0**-21


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
    row, filtering = textures.errors[texture], textures.filters[texture]
    if filtering == FILTER_NEAREST:
        return row[index(ALWAYS)] if (s_error <= NEAREST_ERROR) & (t_error <= NEAREST_ERROR) else np.inf
    bound = s_error * row[index(OF_S)] + t_error * row[index(OF_T)] + row[index(ALWAYS)]
    bound += level_error * row[index(OF_LEVEL)] if filtering == FILTER_TRILINEAR else 0.0
    return bound if bound >= 0.0 else np.inf


def error_factors(shapes, differences, scale, filtering) -> tuple[float, float, float, float]:
    """Return what `texture_error` multiplies by the errors of s, of t and of the level, and what it adds.

    Parameters
    ----------
    shapes : (h, w, ...) of each mip level
    differences : (d_s, d_t) of each
    scale : at least the largest colour
    filtering : FILTER_...
    """
    of_value = VALUE_ERROR * max(scale, 1.0)
    if filtering == FILTER_NEAREST:
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


# ---------------------------------------------------------------- planes of texture coordinates

# Both references of a triangle are one float32, a whole number below 2^24: 12 bits each, s_ref in the lower ones. 2^11
# is the whole picture, or two of them where the picture is mirrored.

TEXCOORDS = 6  # which attributes of a textured surface are texture coordinates: this one and the next
TEXCOORD_PLANE = index(6)  # the first of four planes of a block's triangles
REFERENCE_BITS = np.int32(12)
REFERENCE_UNIT = 2.0**11  # of a picture, or of a period
LEVEL_SLOPE = 1.45  # more than 1/ln 2, see texture_error


class TextureCoding(NamedTuple):
    """The textures of surfaces whose texture coordinates may stand in planes."""

    packed: PackedTextures
    of_materials: np.ndarray  # (n_material,) int64: the texture of each, -1 for none
    limits: np.ndarray  # (n_material,) float64: error that is accepted in a texture's colours
    # (n_material,) bool: where coordinates are exact, the look-up in float32 is good enough: also for exact records
    is_exact_looked_up: np.ndarray


@helper
def compute_texcoord_planes(textures, depths, block):
    """Compute the planes of texture coordinates over r; clear HAS_PLANES where a texture's colours may err by more than
    is accepted.

    A plane of a·r with |a·r| <= m that rises by s over the box errs by u·(3 m + 4 s), see gradients.py: so do S, T and
    D, with a = s', t' and 1. The slopes of a sample's texture coordinates are quotients like (S_x - s'·D_x)/D, with six
    roundings, of which s' has some more: they err by

        (8 u·(|S_x| + |s'|·|D_x|) + e_s·|D_x|)/r_min,    e_s the error of s', and the length of a slope by less than
        the sum over both coordinates.
    """
    ints = block.ints
    for k in range(index(s.BLOCK)):
        texture = textures.of_materials[ints[s.MATERIAL + k]]
        if texture < 0 or not ints[s.HAS_PLANES + k]:
            continue
        (s0, s1, s2), (t0, t1, t2), number = relative_texcoords(k, textures.packed, index(texture), block)
        r0, r1, r2 = linear_in_z(k, depths.ratio_offset, depths.ratio_scale, block)
        least, largest = min(r0, r1, r2), max(r0, r1, r2)
        s_largest, t_largest = max(abs(s0), abs(s1), abs(s2)), max(abs(t0), abs(t1), abs(t2))
        s_rise = compute_plane(k, TEXCOORD_PLANE, s0 * r0, s1 * r1, s2 * r2, block)
        t_rise = compute_plane(k, TEXCOORD_PLANE + index(1), t0 * r0, t1 * r1, t2 * r2, block)
        r_rise = compute_plane(k, TEXCOORD_PLANE + index(2), r0, r1, r2, block)
        compute_plane(k, TEXCOORD_PLANE + index(3), number, number, number, block)
        r_error = plane_rounding(largest, r_rise)
        min_inverse = least - r_error
        s_error = texcoord_error(plane_rounding(s_largest * largest, s_rise), r_error, min_inverse, s_largest)
        t_error = texcoord_error(plane_rounding(t_largest * largest, t_rise), r_error, min_inverse, t_largest)
        slope_error = slope_rounding(k, s_largest, s_error, index(0), block)
        slope_error += slope_rounding(k, t_largest, t_error, index(1), block)
        level_error = LEVEL_SLOPE * slope_error / min_inverse
        error = texture_error(textures.packed, index(texture), s_error, t_error, level_error)
        limit = textures.limits[ints[s.MATERIAL + k]]
        is_good = (min_inverse >= MIN_INVERSE) & (error <= limit)
        ints[s.HAS_PLANES + k] &= is_good


@helper
def relative_texcoords(k, packed, texture, block):
    """Return s' and t' at the vertices of triangle k, texels, and the number of their references."""
    width, height = float(packed.sizes[texture, 0]), float(packed.sizes[texture, 1])
    u0, u1, u2 = values_at(s.ATTRIBUTE + index(TEXCOORDS) * s.NEXT_PLANE + k, block)
    v0, v1, v2 = values_at(s.ATTRIBUTE + index(TEXCOORDS + 1) * s.NEXT_PLANE + k, block)
    s0, s1, s2 = u0 * width, u1 * width, u2 * width
    t0, t1, t2 = (1.0 - v0) * height, (1.0 - v1) * height, (1.0 - v2) * height
    middle = (s0 + s1 + s2) / 3.0, (t0 + t1 + t2) / 3.0
    wraps = packed.wraps[texture, 0], packed.wraps[texture, 1]
    s_ref, t_ref, number = texcoord_references(middle, (width, height), wraps)
    return (s0 - s_ref, s1 - s_ref, s2 - s_ref), (t0 - t_ref, t1 - t_ref, t2 - t_ref), number


@helper
def texcoord_references(texcoords, sizes, wraps):
    """Return references near texture coordinates, and the number that stands for both in a record.

    What is no number, or further than 2^40 pictures away, counts as 0. Clamped coordinates have references within the
    picture. All are multiples of 2^-11 of the picture or period, so none of them has an error.

    Parameters
    ----------
    texcoords : (s, t), texels, such as the means of a triangle's corners
    sizes : (width, height) of the picture, float64
    wraps : WRAP_... along s and t

    Returns
    -------
    (s_ref, t_ref, number) float64, the references in texels
    """
    s_ref, s_number = texcoord_reference(texcoords[0], sizes[0], wraps[0])
    t_ref, t_number = texcoord_reference(texcoords[1], sizes[1], wraps[1])
    return s_ref, t_ref, s_number + 2.0**12 * t_number


@helper
def texcoord_reference(texcoord, n_texel, wrap):
    """Return one reference in texels, and the number from 0 to 2^11 that stands for it."""
    period = 2.0 * n_texel if wrap == WRAP_MIRROR else n_texel
    whole = np.rint(texcoord / period * REFERENCE_UNIT)
    whole = whole if abs(whole) < 2.0**51 else 0.0
    if wrap == WRAP_CLAMP:
        whole = min(max(whole, 0.0), REFERENCE_UNIT)
        return whole / REFERENCE_UNIT * period, whole
    return whole / REFERENCE_UNIT * period, whole - REFERENCE_UNIT * np.floor(whole / REFERENCE_UNIT)


@helper
def plane_rounding(largest, rise):
    """Return how far a float32 plane errs within its box."""
    return SINGLE * (3.0 * largest + 4.0 * rise)


@helper
def slope_rounding(k, largest, error, number, block):
    """Return how far S_x - s'·D_x, or the same downwards, errs; of T and t' with `number` 1."""
    row, last = s.PLANE_ATTRIBUTE + (TEXCOORD_PLANE + number) * s.NEXT_PLANE + k, s.NEXT + s.NEXT
    of_r = s.PLANE_ATTRIBUTE + (TEXCOORD_PLANE + index(2)) * s.NEXT_PLANE + k
    steep, r_steep = (
        max(abs(block.reals[row + s.NEXT]), abs(block.reals[row + last])),
        max(abs(block.reals[of_r + s.NEXT]), abs(block.reals[of_r + last])),
    )
    return 8.0 * SINGLE * (steep + largest * r_steep) + error * r_steep


@helper
def texcoord_error(numerator_error, inv_w_error, min_inv_w, largest_offset):
    """Bound the error of s' = S/D for planes S and D that err, in texels; of t' as well.

    With S + e_S and D + e_D the quotient errs by (|e_S| + |s'|·|e_D|)/D to first order. Rounding of 1/D, of the
    product, of the width's inverse and of the product with that is 4 u of s', u = 2^-24; 5 u leave room for products of
    errors.

    Parameters
    ----------
    numerator_error, inv_w_error : of S and of D
    min_inv_w : the least D, with its error taken off
    largest_offset : the largest |s'|, texels
    """
    return (numerator_error + largest_offset * inv_w_error) / min_inv_w + 5.0 * 2.0**-24 * largest_offset
