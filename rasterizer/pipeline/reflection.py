"""The reflection models, one row function each: from the directions at surface points to what is reflected to the viewer.

A row function reads the rows of normals, lights, view directions, N_DOT_L, N_DOT_V and STRENGTH, and writes the rows DIFFUSE and
SPECULAR, which shade.py multiplies by the light's colour and sums. To add a model: write its function here
and one line in REFLECTIONS.

None of these models conserves energy or is reciprocal in its classic form; see README, Limits.
"""

import numpy as np
from numba import carray
from numba.extending import overload, register_jitable

from .rows import (
    CHUNK,
    DIFFUSE,
    LIGHT_X,
    LIGHT_Y,
    LIGHT_Z,
    N_DOT_L,
    N_DOT_V,
    N_ROW,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    SPECULAR,
    STRENGTH,
    VIEW_X,
    VIEW_Y,
    VIEW_Z,
)

SHININESS = 0  # the first number of a material that a row function reads
N_MATERIAL_NUMBER = 4
MOST_SQUARED = 4096  # integer exponents up to this are raised by squaring


def lambert(rows, n, numbers):
    """Matte: the cosine of the angle of incidence (Lambert 1760)."""
    row = carray(rows, (N_ROW * CHUNK,))
    zero = row.dtype.type(0)  # of the rows' own type: an int would widen float32 to float64
    for k in range(np.uint64(n)):
        n_dot_l = row[N_DOT_L + k]
        # No product where nothing is lit: the strength may be infinite in the light itself.
        row[DIFFUSE + k] = row[STRENGTH + k] * n_dot_l if n_dot_l > zero else zero


def phong(rows, n, numbers):
    """Lambert and a highlight (R·V)^n about the mirrored light direction (Phong 1975); R·V = 2 (N·L)(N·V) - L·V."""
    row, number = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (N_MATERIAL_NUMBER,))
    two = row.dtype.type(2)
    for k in range(np.uint64(n)):
        l_dot_v = row[LIGHT_X + k] * row[VIEW_X + k] + row[LIGHT_Y + k] * row[VIEW_Y + k] + row[LIGHT_Z + k] * row[VIEW_Z + k]
        row[SPECULAR + k] = two * row[N_DOT_L + k] * row[N_DOT_V + k] - l_dot_v
    finish_highlights(row, n, number[SHININESS])


def blinn(rows, n, numbers):
    """Lambert and a highlight (N·H)^n about the half vector (Blinn 1977); H = (L + V) / |L + V|.

    By components: with 2 + 2 L·V for |L + V|² the digits cancel where the viewer looks towards the light.
    """
    row, number = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (N_MATERIAL_NUMBER,))
    zero = row.dtype.type(0)
    for k in range(np.uint64(n)):
        half_x, half_y, half_z = row[LIGHT_X + k] + row[VIEW_X + k], row[LIGHT_Y + k] + row[VIEW_Y + k], row[LIGHT_Z + k] + row[VIEW_Z + k]
        square = half_x * half_x + half_y * half_y + half_z * half_z
        along = row[NORMAL_X + k] * half_x + row[NORMAL_Y + k] * half_y + row[NORMAL_Z + k] * half_z
        # Where L = -V there is no half vector, and no highlight.
        row[SPECULAR + k] = along / np.sqrt(square) if square > zero else zero
    finish_highlights(row, n, number[SHININESS])


REFLECTIONS = {"lambert": lambert, "phong": phong, "blinn": blinn}


@register_jitable
def finish_highlights(row, n, shininess):
    """Raise the cosines in the row SPECULAR to the exponent, and fill DIFFUSE; no highlight from a light behind the surface."""
    zero = row.dtype.type(0)
    if shininess == np.floor(shininess) and shininess <= MOST_SQUARED:
        square_and_multiply(row, n, np.int64(shininess))
    else:
        for k in range(np.uint64(n)):
            row[SPECULAR + k] = power(row[SPECULAR + k], shininess)
    for k in range(np.uint64(n)):
        n_dot_l, strength = row[N_DOT_L + k], row[STRENGTH + k]
        row[DIFFUSE + k] = strength * n_dot_l if n_dot_l > zero else zero
        row[SPECULAR + k] = strength * row[SPECULAR + k] if n_dot_l > zero else zero


@register_jitable
def square_and_multiply(row, n, exponent):
    """Raise the row SPECULAR to an integer, two bits of it a pass (Knuth, TAOCP 2, 4.6.3); uses the row DIFFUSE.

    Results below 2^-28 become 0: invisible, and the denormal numbers on the way there would slow the row down.
    """
    zero, one = row.dtype.type(0), row.dtype.type(1)
    smallest = row.dtype.type(2.0 ** (-28.0 / exponent))
    is_first = True
    while exponent > 0:
        is_odd, is_odd_next = exponent & 1, exponent & 2
        for k in range(np.uint64(n)):
            base = row[DIFFUSE + k]
            if is_first:
                base = row[SPECULAR + k] if row[SPECULAR + k] > smallest else zero
            square = base * base
            factor = base if is_odd else one
            factor = factor * square if is_odd_next else factor
            row[SPECULAR + k] = factor if is_first else row[SPECULAR + k] * factor
            row[DIFFUSE + k] = square * square
        exponent >>= 2
        is_first = False


def power(base, exponent):
    """base ** exponent for a base up to about 1 and a positive exponent; 0 where base <= 0. Float32: see `power_single`."""
    raise NotImplementedError("compiled code only")


@overload(power, inline="never")
def _overload_power(base, exponent):
    if base == np.float32 or getattr(base, "bitwidth", 64) == 32:
        return lambda base, exponent: power_single(base, exponent)
    return lambda base, exponent: base**exponent if base > 0 else 0.0


@register_jitable
def power_single(base, exponent):
    """base ** exponent in float32 without a branch, so that the loop round it vectorises: 2 ** (exponent * log2(base)).

    log2 m = 2/ln 2 · artanh t, t = (m-1)/(m+1), for a mantissa m in [√½, √2]: |t| < 0.1716, the series to t^9 leaves
    2/ln 2 · t^11/11 < 1.1e-9. 2^f for |f| <= ½: the series to f^7 leaves (f·ln 2)^8/8! < 5.2e-9. Above that comes the rounding of
    float32: 2^-24 · (4 + 3·exponent·|log2 base|) of the result. Results below 2^-126 are 0: denormals would slow the row down.
    """
    one = np.float32(1)
    safe = max(base, np.float32(1e-30))
    bits = np.float32(safe).view(np.int32)
    scale = np.int32(np.int32(bits - np.int32(0x3F3504F3)) >> np.int32(23))  # exponent, rounded so that m is in [√½, √2)
    mantissa = np.int32(bits - np.int32(scale << np.int32(23))).view(np.float32)
    t = (mantissa - one) / (mantissa + one)
    square = t * t
    series = np.float32(2.8853900) + square * (
        np.float32(0.96179669)
        + square * (np.float32(0.57707802) + square * (np.float32(0.41219858) + square * np.float32(0.32059890)))
    )
    log2 = np.float32(scale) + t * series
    y = max(exponent * log2, np.float32(-126))
    whole = np.float32(np.rint(y))
    f = y - whole
    result = np.float32(1.0) + f * (
        np.float32(0.69314718)
        + f
        * (
            np.float32(0.24022651)
            + f
            * (
                np.float32(0.055504109)
                + f
                * (
                    np.float32(0.0096181291)
                    + f * (np.float32(0.0013333558) + f * (np.float32(0.00015403530) + f * np.float32(0.000015252734)))
                )
            )
        )
    )
    two_to_whole = np.int32(np.int32(np.int32(whole) + np.int32(127)) << np.int32(23)).view(np.float32)
    return result * two_to_whole if (base > 0) & (y > np.float32(-126)) else np.float32(0)
