"""The reflection models, one row function each: from the directions at surface points to what is reflected to the
viewer.

A row function reads the rows of normals, lights, view directions, N_DOT_L, N_DOT_V and STRENGTH, and writes the rows
DIFFUSE and SPECULAR, which lighting.py multiplies by colours and sums. A new model needs its function here and a line
in REFLECTIONS; engine/intensity_bounds.py gives its name and its largest value, engine/error_bounds.py its bound,
fresnel.py its second term where F0 has a colour.

Which of them conserve energy, and which are reciprocal: see the table in scene/material.py. At a silhouette N·V may
come out below 0, by a rounding error or an interpolated normal: Cook-Torrance takes it for 0, where the formula has a
finite limit; the others don't divide by it.
"""

from typing import NamedTuple

import numpy as np
from numba import carray
from numba.extending import register_jitable

from .anisotropic import anisotropic_mirrors, fill_tangents
from .fragments import (
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
from .power import exponential, grazing, power

# A material's numbers, as far as row functions read them. SCALE: of a normalised highlight, 0 for a classic one.
# ROUGHNESS_ACROSS and the three of BRUSH, an axis in the world: of anisotropic materials.
SHININESS, ROUGHNESS, FRESNEL, SCALE, LEVELS, ROUGHNESS_ACROSS, BRUSH = range(7)
N_MATERIAL_NUMBER = 9
MOST_SQUARED = 4096  # integer exponents up to this are raised by squaring
LEAST_COSINE = 1 / 64  # of Oren-Nayar's smaller angle: see there
VISIBLE = 2.0**-12  # a fifth power of less is taken for 0: invisible, and never a denormal number


class Reflection(NamedTuple):
    """A reflection model as the shader sees it."""

    row_function: object
    needs_view: bool  # it reads N_DOT_V and the view directions
    has_highlight: bool  # it writes SPECULAR


def lambert(rows, n, numbers):
    """Matte: the cosine of the angle of incidence (Lambert 1760)."""
    row = carray(rows, (N_ROW * CHUNK,))
    zero = row.dtype.type(0)  # of the rows' own type: an int would widen float32 to float64
    for k in range(np.uint64(n)):
        n_dot_l = row[N_DOT_L + k]
        # No product where nothing is lit: the strength may be infinite in the light itself.
        row[DIFFUSE + k] = row[STRENGTH + k] * n_dot_l if n_dot_l > zero else zero


@register_jitable
def phong(rows, n, numbers):
    """Lambert and a highlight (R·V)^n about the mirrored light direction R = 2 (N·L) N - L (Phong 1975).

    R·V = 1 - |R - V|²/2, as both have unit length. An error e of a vector moves that by e·|R - V| alone, which the n-th
    power magnifies by about √n (engine/error_bounds.py); that of R·V itself, or of a vector's length, it would magnify
    by n. Never above 1.
    """
    row, number = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (N_MATERIAL_NUMBER,))
    one, two, half = row.dtype.type(1), row.dtype.type(2), row.dtype.type(0.5)
    for k in range(np.uint64(n)):
        twice = two * row[N_DOT_L + k]
        x = twice * row[NORMAL_X + k] - row[LIGHT_X + k] - row[VIEW_X + k]
        y = twice * row[NORMAL_Y + k] - row[LIGHT_Y + k] - row[VIEW_Y + k]
        z = twice * row[NORMAL_Z + k] - row[LIGHT_Z + k] - row[VIEW_Z + k]
        row[SPECULAR + k] = one - half * (x * x + y * y + z * z)
    finish_highlights(row, n, number)


@register_jitable
def blinn(rows, n, numbers):
    """Lambert and a highlight (N·H)^n about the half vector (Blinn 1977); H = (L + V) / |L + V|.

    By components: with 2 + 2 L·V for |L + V|² the digits cancel where the viewer looks towards the light. N·H = 1 - |N
    - H|²/2, see `phong`.
    """
    row, number = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (N_MATERIAL_NUMBER,))
    zero, one, half = row.dtype.type(0), row.dtype.type(1), row.dtype.type(0.5)
    for k in range(np.uint64(n)):
        half_x, half_y = row[LIGHT_X + k] + row[VIEW_X + k], row[LIGHT_Y + k] + row[VIEW_Y + k]
        half_z = row[LIGHT_Z + k] + row[VIEW_Z + k]
        square = half_x * half_x + half_y * half_y + half_z * half_z
        scale = one / np.sqrt(square)
        x, y, z = (
            row[NORMAL_X + k] - half_x * scale,
            row[NORMAL_Y + k] - half_y * scale,
            row[NORMAL_Z + k] - half_z * scale,
        )
        # Where L = -V there is no half vector, and no highlight.
        row[SPECULAR + k] = one - half * (x * x + y * y + z * z) if square > zero else zero
    finish_highlights(row, n, number)


@register_jitable
def distant_blinn(rows, n, numbers):
    """Blinn's highlight where light and viewer are at infinity: H is the same everywhere, and is found once for all n
    points."""
    row, number = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (N_MATERIAL_NUMBER,))
    half_x, half_y, half_z = row[LIGHT_X] + row[VIEW_X], row[LIGHT_Y] + row[VIEW_Y], row[LIGHT_Z] + row[VIEW_Z]
    square = half_x * half_x + half_y * half_y + half_z * half_z
    zero, one, half = row.dtype.type(0), row.dtype.type(1), row.dtype.type(0.5)
    has_half = square > zero
    scale = one / np.sqrt(square) if has_half else zero
    half_x, half_y, half_z = half_x * scale, half_y * scale, half_z * scale
    for k in range(np.uint64(n)):
        x, y, z = row[NORMAL_X + k] - half_x, row[NORMAL_Y + k] - half_y, row[NORMAL_Z + k] - half_z
        row[SPECULAR + k] = one - half * (x * x + y * y + z * z) if has_half else zero
    finish_highlights(row, n, number)


def weighted_phong(rows, n, numbers):
    """Phong's highlight times W(θ), or normalised, or both."""
    phong(rows, n, numbers)
    weigh_highlights(rows, n, numbers)


def weighted_blinn(rows, n, numbers):
    """Blinn's highlight times W(θ), or normalised, or both."""
    blinn(rows, n, numbers)
    weigh_highlights(rows, n, numbers)


def weighted_distant_blinn(rows, n, numbers):
    """The same where light and viewer are at infinity."""
    distant_blinn(rows, n, numbers)
    weigh_highlights(rows, n, numbers)


def oren_nayar(rows, n, numbers):
    """Rough matte surfaces: N·L·(A + B·max(0, cos(φl - φv))·sin α·tan β), α the larger, β the smaller angle of L and V
    with N.

    Oren & Nayar 1994, Proc. SIGGRAPH, 239-246, equation 30 (the qualitative model). The part of L across the normal
    times that of V is cos(φl - φv)·sin θl·sin θv = L·V - (N·L)(N·V), and the smaller angle has the larger cosine, so
    the last three factors are max(0, L·V - (N·L)(N·V)) / max(N·L, N·V).
    N·L·tan β has no limit where both directions graze; cos β is taken for 1/64 at least (89.1°), which makes it
    continuous, keeps the model reciprocal and changes only the last 1/8192 of a sphere's radius. Never above 1, because
    A² + B² <= 1.
    """
    row, number = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (N_MATERIAL_NUMBER,))
    zero, least = row.dtype.type(0), row.dtype.type(LEAST_COSINE)
    square = number[ROUGHNESS] * number[ROUGHNESS]
    a = row.dtype.type(1) - row.dtype.type(0.5) * square / (square + row.dtype.type(0.33))
    b = row.dtype.type(0.45) * square / (square + row.dtype.type(0.09))
    for k in range(np.uint64(n)):
        n_dot_l, n_dot_v = row[N_DOT_L + k], row[N_DOT_V + k]
        l_dot_v = (
            row[LIGHT_X + k] * row[VIEW_X + k] + row[LIGHT_Y + k] * row[VIEW_Y + k] + row[LIGHT_Z + k] * row[VIEW_Z + k]
        )
        across = max(l_dot_v - n_dot_l * n_dot_v, zero)
        reflected = n_dot_l * (a + b * across / max(max(n_dot_l, n_dot_v), least))
        row[DIFFUSE + k] = row[STRENGTH + k] * reflected if n_dot_l > zero else zero


def cook_torrance_ggx(rows, n, numbers):
    """Lambert and a highlight of microscopic mirrors (Cook & Torrance 1981), tilted as GGX says: π D F G / (4 N·V).

    D and G: Walter, Marschner, Li & Torrance 2007, EGSR, 195-206, equations 33, 34 and 23 (Smith's G, the two
    directions masked independently). With s = |N×H|, c = N·H: D = α² / (π (α² c² + s²)²); s by the cross product,
    because 1 - c² loses its digits in the highlight. G1(V) / (2 N·V) = 1 / (N·V + √(α² + (1-α²)(N·V)²)) is finite at
    N·V = 0, unlike with the V-shaped grooves of 1981.
    """
    row, number = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (N_MATERIAL_NUMBER,))
    zero, one = row.dtype.type(0), row.dtype.type(1)
    square = number[ROUGHNESS] * number[ROUGHNESS]
    rest = one - square
    for k in range(np.uint64(n)):
        half_square, along, across = half_parts(row, k)
        n_dot_l, n_dot_v, strength = max(row[N_DOT_L + k], zero), max(row[N_DOT_V + k], zero), row[STRENGTH + k]
        spread = square * along * along + across
        ratio = half_square / spread if (along > zero) & (spread > zero) else zero
        mirrors = square * ratio * ratio
        masked = n_dot_l / (n_dot_l + np.sqrt(square + rest * n_dot_l * n_dot_l))
        masked = masked / (n_dot_v + np.sqrt(square + rest * n_dot_v * n_dot_v))
        reflected = mirrors * masked * schlick(number[FRESNEL], np.sqrt(half_square) / row.dtype.type(2))
        row[DIFFUSE + k] = strength * n_dot_l if n_dot_l > zero else zero
        row[SPECULAR + k] = strength * reflected if n_dot_l > zero else zero


def cook_torrance_beckmann(rows, n, numbers):
    """As `cook_torrance_ggx`, with mirrors tilted as Beckmann says: D = exp(-tan²θh / m²) / (π m² cos⁴θh).

    Cook & Torrance 1981, Proc. SIGGRAPH, 307-316; Smith's G in the approximation of Walter et al. 2007, section 5.2.
    Mirrors tilted by more than 89.9° count as none: exp(-2^20).
    """
    row, number = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (N_MATERIAL_NUMBER,))
    zero, one, steep = row.dtype.type(0), row.dtype.type(1), row.dtype.type(2.0**-20)
    m = number[ROUGHNESS]
    scale = one / (m * m)
    for k in range(np.uint64(n)):
        half_square, along, across = half_parts(row, k)
        n_dot_l, n_dot_v, strength = max(row[N_DOT_L + k], zero), max(row[N_DOT_V + k], zero), row[STRENGTH + k]
        square = along * along
        inverse = one / square if (along > zero) & (square > steep * half_square) else zero
        ratio = half_square * inverse  # 1 / cos²θh
        mirrors = exponential(-scale * across * inverse) * scale * ratio * ratio
        masked = n_dot_l * beckmann_visible(n_dot_l, m) * beckmann_visible(n_dot_v, m) / row.dtype.type(4)
        reflected = mirrors * masked * schlick(number[FRESNEL], np.sqrt(half_square) / row.dtype.type(2))
        row[DIFFUSE + k] = strength * n_dot_l if n_dot_l > zero else zero
        row[SPECULAR + k] = strength * reflected if n_dot_l > zero else zero


@register_jitable
def anisotropic_ggx(rows, n, numbers):
    """As `cook_torrance_ggx`, with mirrors whose tilt depends on a direction in the surface, that of the rows TANGENT.

    Formulas: anisotropic.py. The plan takes float64 for this model: where the direction nearly stands upright on the
    surface its projection, and all that depends on it, has no bound in float32.
    """
    row, number = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (N_MATERIAL_NUMBER,))
    zero, two = row.dtype.type(0), row.dtype.type(2)
    for k in range(np.uint64(n)):
        half_square, _, _ = half_parts(row, k)
        n_dot_l, strength = row[N_DOT_L + k], row[STRENGTH + k]
        reflected = anisotropic_mirrors(row, k, number[ROUGHNESS], number[ROUGHNESS_ACROSS])
        reflected = reflected * schlick(number[FRESNEL], np.sqrt(half_square) / two)
        row[DIFFUSE + k] = strength * n_dot_l if n_dot_l > zero else zero
        row[SPECULAR + k] = strength * reflected if n_dot_l > zero else zero


def anisotropic_ggx_by_axis(rows, n, numbers):
    """The same, the direction being the axis BRUSH in the world."""
    number = carray(numbers, (N_MATERIAL_NUMBER,))
    fill_tangents(rows, n, number[BRUSH], number[BRUSH + 1], number[BRUSH + 2])
    anisotropic_ggx(rows, n, numbers)


def toon(rows, n, numbers):
    """Few levels, as in a drawing: N·L raised to the next k/levels, k = 1, 2, .. levels; a highlight of 1 where (R·V)^n
    >= 1/2.

    A step is a step: a rounding error next to one costs a whole level. The plan takes float64 for this model, and
    cosines within `grazing` above a step count as lying on it: what lies on a step exactly (a light parallel to a face,
    or at 60 degrees with two levels) falls on the same side everywhere. After Lake, Marshall, Harris & Blackstein 2000,
    NPAR, 13-20.
    """
    row, number = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (N_MATERIAL_NUMBER,))
    zero, one, two = row.dtype.type(0), row.dtype.type(1), row.dtype.type(2)
    slack = grazing(zero)
    levels, least = number[LEVELS], row.dtype.type(0.5) ** (one / number[SHININESS])
    for k in range(np.uint64(n)):
        n_dot_l, strength = row[N_DOT_L + k], row[STRENGTH + k]
        l_dot_v = (
            row[LIGHT_X + k] * row[VIEW_X + k] + row[LIGHT_Y + k] * row[VIEW_Y + k] + row[LIGHT_Z + k] * row[VIEW_Z + k]
        )
        mirrored = two * n_dot_l * row[N_DOT_V + k] - l_dot_v
        # A cosine may come out a little above 1.
        step = min(np.ceil(levels * (n_dot_l - slack)), levels) / levels
        row[DIFFUSE + k] = strength * step if n_dot_l > slack else zero
        row[SPECULAR + k] = strength if (n_dot_l > slack) & (mirrored >= least - slack) else zero


REFLECTIONS = {
    "lambert": Reflection(lambert, needs_view=False, has_highlight=False),
    "phong": Reflection(phong, needs_view=True, has_highlight=True),
    "blinn": Reflection(blinn, needs_view=True, has_highlight=True),
    "weighted phong": Reflection(weighted_phong, needs_view=True, has_highlight=True),
    "weighted blinn": Reflection(weighted_blinn, needs_view=True, has_highlight=True),
    "oren-nayar": Reflection(oren_nayar, needs_view=True, has_highlight=False),
    "ggx": Reflection(cook_torrance_ggx, needs_view=True, has_highlight=True),
    "beckmann": Reflection(cook_torrance_beckmann, needs_view=True, has_highlight=True),
    "anisotropic ggx": Reflection(anisotropic_ggx, needs_view=True, has_highlight=True),
    "anisotropic ggx by axis": Reflection(anisotropic_ggx_by_axis, needs_view=True, has_highlight=True),
    "toon": Reflection(toon, needs_view=True, has_highlight=True),
}
# What takes their place where light and viewer are at infinity.
DISTANT = {"blinn": distant_blinn, "weighted blinn": weighted_distant_blinn}


@register_jitable
def schlick(least, cosine):
    """The specular reflection function W = F0 + (1 - F0)(1 - cos θ)^5 (Schlick 1994, Computer Graphics Forum 13(3),
    233-246)."""
    number = type(cosine)
    sink = number(1) - cosine
    sink = sink if sink > number(VISIBLE) else number(0)
    square = sink * sink
    return least + (number(1) - least) * (square * square * sink)


@register_jitable
def weigh_highlights(rows, n, numbers):
    """Multiply the row SPECULAR by W(θ), cos θ = N·L, and by SCALE·N·L if SCALE isn't 0."""
    row, number = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (N_MATERIAL_NUMBER,))
    zero = row.dtype.type(0)
    least, scale = number[FRESNEL], number[SCALE]
    for k in range(np.uint64(n)):
        row[SPECULAR + k] = row[SPECULAR + k] * schlick(least, max(row[N_DOT_L + k], zero))
    if scale > zero:
        for k in range(np.uint64(n)):
            row[SPECULAR + k] = row[SPECULAR + k] * (scale * max(row[N_DOT_L + k], zero))


@register_jitable
def half_parts(row, k):
    """|L + V|², and the sum's part along N, and the square of its part across N."""
    half_x, half_y = row[LIGHT_X + k] + row[VIEW_X + k], row[LIGHT_Y + k] + row[VIEW_Y + k]
    half_z = row[LIGHT_Z + k] + row[VIEW_Z + k]
    x, y, z = row[NORMAL_X + k], row[NORMAL_Y + k], row[NORMAL_Z + k]
    cross_x, cross_y, cross_z = y * half_z - z * half_y, z * half_x - x * half_z, x * half_y - y * half_x
    return (
        half_x * half_x + half_y * half_y + half_z * half_z,
        x * half_x + y * half_y + z * half_z,
        cross_x * cross_x + cross_y * cross_y + cross_z * cross_z,
    )


@register_jitable
def beckmann_visible(cosine, m):
    """G1(θ) / cos θ of Beckmann's distribution: with a = 1/(m tan θ) < 1.6, G1 = (3.535 a + 2.181 a²) / (1 + 2.276 a +
    2.577 a²).

    Else 1 (Walter et al. 2007, equation 27). The fraction exceeds 1 by less than 1e-4 from a = 1.55 on; cut off at 1,
    it is continuous.
    """
    number = type(cosine)
    slope = m * np.sqrt(max(number(1) - cosine * cosine, number(1e-12)))  # cos θ / a
    a = cosine / slope
    fraction = (number(3.535) + number(2.181) * a) / (number(1) + a * (number(2.276) + a * number(2.577))) / slope
    whole = number(1) / max(cosine, number(1e-12))
    return min(fraction, whole) if a < number(1.6) else whole


@register_jitable
def finish_highlights(row, n, number):
    """Raise the cosines in the row SPECULAR to the exponent, and fill DIFFUSE; no highlight from a light behind the
    surface.

    A classic highlight ends at N·L = 0 with a step: what grazes the surface counts as behind it, see `grazing`. One
    that is normalised falls to 0 there.
    """
    zero, one = row.dtype.type(0), row.dtype.type(1)
    shininess, least = number[SHININESS], zero if number[SCALE] > zero else grazing(zero)
    if shininess == np.floor(shininess) and one <= shininess <= MOST_SQUARED:
        square_and_multiply(row, n, np.int64(shininess))
    else:
        for k in range(np.uint64(n)):
            row[SPECULAR + k] = power(row[SPECULAR + k], shininess)
    for k in range(np.uint64(n)):
        n_dot_l, strength = row[N_DOT_L + k], row[STRENGTH + k]
        row[DIFFUSE + k] = strength * n_dot_l if n_dot_l > zero else zero
        row[SPECULAR + k] = strength * row[SPECULAR + k] if n_dot_l > least else zero


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
