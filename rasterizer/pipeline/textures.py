"""Textures as kernels look them up: their texels, and how much what is found in them errs.

In:  pictures of bytes or float32.
Out: `Textures`: the texels of all, float32 and linear, each mip level with a border of one texel, which holds what the
     wrap puts there. `texture_error` says how far colours looked up in them are from exact ones. And the planes of
     texture coordinates over a block of triangles (setup.py), as setups hold them: s'/w, t'/w, 1/w, and the
     references, which are the same at every sample.

A texture of w × h texels needs 16 bytes for each, with mip levels a third more, and 96·(w + h) bytes for the borders.

    s, t     texture coordinates in texels of the picture: s to the right, t downwards, (0, 0) its upper left corner
    s', t'   s - s_ref, t - t_ref, relative to references that a triangle has (`texcoord_references`)
    S, T, D  s'/w, t'/w and 1/w: linear on the screen
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel
from . import setup as s
from .setup import MIN_INVERSE, SINGLE, compute_plane, linear_in_z, values_at

FILTER_NEAREST, FILTER_BILINEAR, FILTER_TRILINEAR = 0, 1, 2
WRAP_REPEAT, WRAP_CLAMP, WRAP_MIRROR = 0, 1, 2  # what lies outside the picture
FIRST_TEXCOORD = 6  # attributes of a textured surface in front of the texture coordinates
STRIP = 2**15  # texels of a strip, half a megabyte


class Textures(NamedTuple):
    """Textures of a scene, one behind the other."""

    texels: np.ndarray  # (4 * n_texel,) float32, linear: red, green and blue of each, times its alpha; alpha
    first_texels: np.ndarray  # (n_texture + 1,) int64
    sizes: np.ndarray  # (n_texture, 3) int64: width, height, mip levels
    filters: np.ndarray  # (n_texture,) int64, FILTER_...
    wraps: np.ndarray  # (n_texture, 2) int64, WRAP_... along s and t
    errors: np.ndarray  # (n_texture, 4) float64, see `texture_error`
    has_alpha: np.ndarray  # (n_texture,) bool: some texel lets something through
    of_materials: np.ndarray  # (n_material,) int64, the texture of each, -1 for none
    texcoord: int = FIRST_TEXCOORD  # the attribute that is u; v follows


class Texture(NamedTuple):
    """One of Textures."""

    texels: np.ndarray  # (4 * n,) float32, all mip levels
    width: int  # int32, texels of the first mip level
    height: int  # int32
    coarsest: int  # int32, the last mip level
    filter: int  # FILTER_...
    wraps: tuple[int, int]  # WRAP_... along s and t
    has_alpha: bool


@helper
def texture_of(textures, material):
    """Return the texture of a material that has one."""
    texture = textures.of_materials[material]
    first, end = textures.first_texels[texture], textures.first_texels[texture + 1]
    width, height, n_level = textures.sizes[texture, 0], textures.sizes[texture, 1], textures.sizes[texture, 2]
    return Texture(
        textures.texels[first << 2 : end << 2],
        np.int32(width),
        np.int32(height),
        np.int32(n_level - 1),
        textures.filters[texture],
        (textures.wraps[texture, 0], textures.wraps[texture, 1]),
        textures.has_alpha[texture],
    )


# ---------------------------------------------------------------- mip levels and their borders


def fill_level(level, wraps, write, run=map) -> tuple[float, float]:
    """Fill a mip level with its border; return the largest differences of neighbouring texels.

    Parameters
    ----------
    level : (h + 2, w + 2, 4) float32, written
    wraps : WRAP_... along s and t
    write : function (first, end) that writes the rows first..end of the picture, but for the border
    run : calls a function with every item of a sequence: `map`, or `Workers.map` on threads

    Returns
    -------
    (d_s, d_t) : of two neighbours in a row, of two in a column; over all channels, across the border, too
    """
    height, width = (n - 2 for n in level.shape[:2])
    rows, strips = level.reshape(height + 2, -1), strips_of(height, width)
    (left, right), (above, below) = ((-2, 1) if wrap == WRAP_REPEAT else (1, -2) for wrap in wraps)

    def fill(strip):
        first, end = strip
        write(first, end)
        part = level[first + 1 : end + 1]
        part[:, 0], part[:, -1] = part[:, left], part[:, right]
        return largest_steps(rows[first + 1 : end + 1])  # while they are in the cache

    steps = list(run(fill, strips))
    level[0], level[-1] = level[above], level[below]
    steps += [largest_steps(rows[end : end + 2]) for end in (0, *(end for _, end in strips))]
    d_s, d_t = np.max(steps, axis=0).tolist()
    return d_s, d_t


def strips_of(height, width) -> list[tuple[int, int]]:
    """Cut rows into strips (first, end) that stay in the cache, and that threads may take."""
    n_row = max(1, STRIP // width)
    return [(first, min(first + n_row, height)) for first in range(0, height, n_row)]


@kernel
def decode_texels(encoded, n_channel, decoded, out):
    """Write rows of bytes as linear texels.

    Parameters
    ----------
    encoded : (h, n_channel * w) uint8: grey, grey and alpha, RGB, or RGB and alpha
    decoded : (2, 256) float32, what a byte of colour and one of alpha mean
    out : (h, 4 * (w + 2)) float32; its border is left alone
    """
    of_color, of_alpha = decoded[0], decoded[1]
    step, n_color = n_channel, n_channel - 1 + n_channel % 2
    for j in range(encoded.shape[0]):
        row, target = encoded[j], out[j]
        for i in range((out.shape[1] >> 2) - 2):
            texel, first = 4 * i + 4, step * i
            target[texel] = of_color[row[first]]
            target[texel + 1] = of_color[row[first + (1 if n_color == 3 else 0)]]
            target[texel + 2] = of_color[row[first + n_color - 1]]
            target[texel + 3] = of_alpha[row[first + n_color]] if step != n_color else np.float32(1)


@kernel
def largest_steps(rows):
    """Return the largest differences of neighbours in some rows of a mip level: (d_s, d_t), see `fill_level`.

    rows : (h, 4 * (w + 2)) float32
    """
    height, n, pixel, one = rows.shape[0], rows.shape[1], 4, 1
    across = down = np.int32(0)  # the bits of positive floats are in order as the floats are
    for j in range(height):
        row = rows[j]
        for i in range(n - pixel):
            across = max(across, np.float32(abs(row[i + pixel] - row[i])).view(np.int32))
        if j + one < height:
            following = rows[j + one]
            for i in range(n):
                down = max(down, np.float32(abs(following[i] - row[i])).view(np.int32))
    return float(np.int32(across).view(np.float32)), float(np.int32(down).view(np.float32))


@kernel
def halve_texels(rows, out):
    """Write the means of two by two texels.

    Parameters
    ----------
    rows : (2 m or more, 4 * (2 w + 2)) float32, of a mip level with its border
    out : (m, 4 * (w + 2)) float32, of the next one; its border is left alone
    """
    for j in range(out.shape[0]):
        above, below, target = rows[j + j], rows[j + j + 1], out[j]
        for i in range((out.shape[1] >> 2) - 2):
            left, right, texel = 8 * i + 4, 8 * i + 8, 4 * i + 4
            for k in range(4):
                of_left = np.float64(above[left + k]) + np.float64(below[left + k])
                of_right = np.float64(above[right + k]) + np.float64(below[right + k])
                target[texel + k] = np.float32((of_left + of_right) * 0.25)


# ---------------------------------------------------------------- texture coordinates within the picture


@helper
def without_repeats(corners, wrap):
    """Return texture coordinates of three corners, moved by whole periods so that the first lies within one.

    Exact, where all three are of about the same size: multiples of their last bits, and not larger than they were.
    """
    if wrap == WRAP_CLAMP:
        return corners
    period = 2.0 if wrap == WRAP_MIRROR else 1.0
    start = period * np.floor(corners[0] / period)
    return corners[0] - start, corners[1] - start, corners[2] - start


@helper
def wrap_texcoord(x, wrap):
    """Return the fraction of the picture, 0..1, that stands for any texture coordinate along an axis, from the left or
    from the top; 0 for what is infinite or no number."""
    if wrap == WRAP_CLAMP:
        wrapped = min(max(x, 0.0), 1.0)
    elif wrap == WRAP_MIRROR:
        x = x - 2.0 * np.floor(0.5 * x)
        wrapped = min(x, 2.0 - x)
    else:
        wrapped = x - np.floor(x)
    return wrapped if (wrapped >= 0.0) & (wrapped <= 1.0) else 0.0


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
# What a look-up loses itself, see `texture_error`.
FIXED_POINT_ERROR, FRACTION_ERROR = 2.0**-29, 2.0**-24
LEVEL_ERROR, MEAN_ERROR = 8e-7, 9 * 2.0**-24


@helper
def texture_error(textures, texture, s_error, t_error, level_error):
    """Bound how far a channel of what `texture_lookup.read_texels` finds is from exact, linear intensity.

    Parameters
    ----------
    textures : Textures
    texture : its number
    s_error, t_error : of the texture coordinates s and t, texels of the picture; see `texcoord_error`
    level_error : of the mip level that the planes would give exactly; 1.45 times the error of its derivatives in texels
        a sample is enough, as d log2 g = dg / (g·ln 2) and levels above 0 have g > 1

    Returns
    -------
    the bound, float64, of a texture whose filter isn't "nearest"; infinite for what is no number

    Notes
    -----
    Along a row a bilinear mean changes by at most d_s a texel, the largest difference of two neighbouring texels of its
    mip level, the wrap included; down a column by d_t. A mip level of w of the picture's W texels shrinks an error to
    w/W times as many texels: it errs by s_error·w/W·d_s, and by FIXED_POINT_ERROR·w + FRACTION_ERROR texels more, which
    are lost in the look-up.

    A level that errs by e mixes two means by a share that errs by e. They differ by at most D, see `level_difference`;
    that also holds where e leads to other levels, as the mixture is continuous. LEVEL_ERROR is what the look-up adds:
    1.5e-7 of the logarithm's polynomial, 2^-21 of its sum with up to 28 octaves, 2^-23 of the series and the squares.

    Three times, across, down and between levels, a mean is a + f·(b - a): three roundings each, of numbers that aren't
    larger than the largest texel.
    """
    row = textures.errors[texture]
    bound = s_error * row[OF_S] + t_error * row[OF_T] + level_error * row[OF_LEVEL]
    bound += row[ALWAYS]
    return bound if bound >= 0.0 else np.inf


def error_factors(sizes, differences, largest) -> tuple[float, float, float, float]:
    """Return what `texture_error` multiplies by the errors of s, of t and of the level, and what it adds.

    Parameters
    ----------
    sizes : (n_level, 2), width and height of each mip level
    differences : (n_level, 2), d_s and d_t of each
    largest : at least any texel's value
    """
    sizes, d = np.asarray(sizes, np.float64), np.asarray(differences)
    of_s, of_t = (sizes / sizes[0] * d).max(axis=0)
    of_texcoords = ((FRACTION_ERROR + FIXED_POINT_ERROR * sizes) * d).sum(axis=1).max()
    of_level = level_difference(d, largest)
    return of_s, of_t, of_level, of_texcoords + LEVEL_ERROR * of_level + MEAN_ERROR * largest


def lookup_error(width, height) -> float:
    """Bound how far what is looked up at exact texture coordinates is from exact, of the largest value of a texture.

    Such coordinates are rounded up to a 2^-32nd of the picture (texcoords.py). The rest: see `texture_error`, where no
    difference of texels is larger than their largest value.
    """
    return 2.0**-32 * (width + height) + 2.0 * FRACTION_ERROR + LEVEL_ERROR + MEAN_ERROR


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

TEXCOORD_PLANE = 6  # the first of four planes of a block's triangles
REFERENCE_BITS = np.int32(12)
REFERENCE_UNIT = 2.0**11  # of a picture, or of a period
LEVEL_SLOPE = 1.45  # more than 1/ln 2, see texture_error


class TextureCoding(NamedTuple):
    """The textures of surfaces whose texture coordinates may stand in planes."""

    textures: Textures
    limits: np.ndarray  # (n_material,) float64: error that is accepted in a texture's colours


@helper
def compute_texcoord_planes(coding, depths, block):
    """Compute the planes of texture coordinates over r; clear HAS_PLANES where a texture's colours may err by more than
    is accepted.

    A plane of a·r with |a·r| <= m that rises by s over the box errs by u·(3 m + 4 s), see gradients.py: so do S, T and
    D, with a = s', t' and 1. The slopes of a sample's texture coordinates are quotients like (S_x - s'·D_x)/D, with six
    roundings, of which s' has some more: they err by

        (8 u·(|S_x| + |s'|·|D_x|) + e_s·|D_x|)/r_min,    e_s the error of s', and the length of a slope by less than
        the sum over both coordinates.
    """
    ints = block.ints
    for k in range(s.BLOCK):
        texture = coding.textures.of_materials[ints[s.MATERIAL + k]]
        if texture < 0 or not ints[s.HAS_PLANES + k]:
            continue
        (s0, s1, s2), (t0, t1, t2), number = relative_texcoords(k, coding.textures, texture, block)
        r0, r1, r2 = linear_in_z(k, depths.ratio_offset, depths.ratio_scale, block)
        least, largest = min(r0, r1, r2), max(r0, r1, r2)
        s_largest, t_largest = max(abs(s0), abs(s1), abs(s2)), max(abs(t0), abs(t1), abs(t2))
        s_rise = compute_plane(k, TEXCOORD_PLANE, s0 * r0, s1 * r1, s2 * r2, block)
        t_rise = compute_plane(k, TEXCOORD_PLANE + 1, t0 * r0, t1 * r1, t2 * r2, block)
        r_rise = compute_plane(k, TEXCOORD_PLANE + 2, r0, r1, r2, block)
        compute_plane(k, TEXCOORD_PLANE + 3, number, number, number, block)
        r_error = plane_rounding(largest, r_rise)
        min_inverse = least - r_error
        s_error = texcoord_error(plane_rounding(s_largest * largest, s_rise), r_error, min_inverse, s_largest)
        t_error = texcoord_error(plane_rounding(t_largest * largest, t_rise), r_error, min_inverse, t_largest)
        slope_error = slope_rounding(k, s_largest, s_error, 0, block)
        slope_error += slope_rounding(k, t_largest, t_error, 1, block)
        level_error = LEVEL_SLOPE * slope_error / min_inverse
        error = texture_error(coding.textures, texture, s_error, t_error, level_error)
        limit = coding.limits[ints[s.MATERIAL + k]]
        is_good = (min_inverse >= MIN_INVERSE) & (error <= limit)
        ints[s.HAS_PLANES + k] &= is_good


@helper
def relative_texcoords(k, textures, texture, block):
    """Return s' and t' at the vertices of triangle k, texels, and the number of their references.

    References are taken off in pictures, where nothing is rounded, however many repeats lie between.
    """
    width, height = float(textures.sizes[texture, 0]), float(textures.sizes[texture, 1])
    u0, u1, u2 = values_at(s.ATTRIBUTE + FIRST_TEXCOORD * s.NEXT_PLANE + k, block)
    v0, v1, v2 = values_at(s.ATTRIBUTE + (FIRST_TEXCOORD + 1) * s.NEXT_PLANE + k, block)
    t0, t1, t2 = 1.0 - v0, 1.0 - v1, 1.0 - v2
    middle = (u0 + u1 + u2) / 3.0, (t0 + t1 + t2) / 3.0
    wraps = textures.wraps[texture, 0], textures.wraps[texture, 1]
    u_ref, t_ref, number = texcoord_references(middle, wraps)
    of_s = (u0 - u_ref) * width, (u1 - u_ref) * width, (u2 - u_ref) * width
    return of_s, ((t0 - t_ref) * height, (t1 - t_ref) * height, (t2 - t_ref) * height), number


@helper
def texcoord_references(texcoords, wraps):
    """Return references near texture coordinates, and the number that stands for both in a setup.

    What is no number, or further than 2^40 pictures away, counts as 0. Clamped coordinates have references within the
    picture. All are multiples of 2^-11 of the picture or period, so none of them has an error.

    Parameters
    ----------
    texcoords : u and 1 - v, such as the means of a triangle's corners
    wraps : WRAP_... along s and t

    Returns
    -------
    (u_ref, t_ref, number) float64, the references in pictures
    """
    u_ref, u_number = texcoord_reference(texcoords[0], wraps[0])
    t_ref, t_number = texcoord_reference(texcoords[1], wraps[1])
    return u_ref, t_ref, u_number + 2.0**12 * t_number


@helper
def texcoord_reference(texcoord, wrap):
    """Return one reference in pictures, and the number from 0 to 2^11 that stands for it."""
    period = 2.0 if wrap == WRAP_MIRROR else 1.0
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
    of_r = s.PLANE_ATTRIBUTE + (TEXCOORD_PLANE + 2) * s.NEXT_PLANE + k
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
