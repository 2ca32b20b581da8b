"""The reflection models, one reflection function each: what a batch reflects to the viewer of one light.

In:  NORMAL, LIGHT_DIR, VIEW_DIR, N_DOT_L, N_DOT_V and STRENGTH of the batch (fragments.py), and the coefficients of one
     material (material_coefficients.py).
Out: DIFFUSE, D; and of a highlight S the part SPECULAR = S·(1 - s), with s = 0 where W(θ) is 1, and else also GRAZING =
     S·s; of Cook-Torrance's also METAL, that of SPECULAR which is metal. lighting.py multiplies them by colours and
     sums them over the lights.

    N  unit normal      L  unit vector to the light      V  unit vector to the viewer
    R  L mirrored at N, 2 (N·L) N - L                    H  half vector, (L + V) / |L + V|

A new model is a function here and a row in the engine's table (engine/reflections.py). One's own (registries.py) is one
formula for one point: `function_of_reflection` makes a reflection function of it. Which models conserve energy, and
which are reciprocal: see the table in scene/material.py. At a silhouette N·V may come out below 0, by a rounding error
or an interpolated normal: no model here divides by it.
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from ..compiler.kernels import as_array, helper
from ..geometry.vectors import add, cross, dot, length, scale, subtract
from . import fragments as f
from . import material_coefficients as m
from .fragments import get_vector, read_vector, set_vector
from .power import exponential, grazing, power

MIN_ALPHA = 0.001  # of GGX, where a texture multiplies it: what a material may have at least
MIN_COSINE = 1 / 64  # of Oren-Nayar's smaller angle: see there


def lambert(batch, n, material):
    """Diffuse reflection alone: the cosine of the angle of incidence (Lambert 1760)."""
    batch = as_array(batch, f.BATCH_SHAPE)
    zero = batch.dtype.type(0)  # of the batch's own type: an int would widen float32 to float64
    for k in range(n):
        n_dot_l = batch[f.N_DOT_L + k]
        # No product where nothing is lit: the strength may be infinite in the light itself.
        batch[f.DIFFUSE + k] = batch[f.STRENGTH + k] * n_dot_l if n_dot_l > zero else zero


def oren_nayar(batch, n, material):
    """Rough diffuse surfaces: N·L·(A + B·max(0, cos(φl - φv))·sin α·tan β), α the larger, β the smaller angle of L and
    V with N.

    Oren & Nayar 1994, Proc. SIGGRAPH, 239-246, equation 30 (the qualitative model). The part of L across the normal
    times that of V is cos(φl - φv)·sin θl·sin θv = L·V - (N·L)(N·V), and the smaller angle has the larger cosine, so
    the last three factors are max(0, L·V - (N·L)(N·V)) / max(N·L, N·V).
    N·L·tan β has no limit where both directions graze; cos β is taken for 1/64 at least (89.1°), which makes it
    continuous, keeps the model reciprocal and changes only the last 1/8192 of a sphere's radius. Never above 1, because
    A² + B² <= 1.
    """
    batch, material = as_array(batch, f.BATCH_SHAPE), as_array(material, m.REFLECTION_SHAPE)
    real = batch.dtype.type
    zero, least = real(0), real(MIN_COSINE)
    square = material[m.ROUGHNESS] * material[m.ROUGHNESS]
    a = real(1) - real(0.5) * square / (square + real(0.33))
    b = real(0.45) * square / (square + real(0.09))
    for k in range(n):
        n_dot_l, n_dot_v = batch[f.N_DOT_L + k], batch[f.N_DOT_V + k]
        l_dot_v = dot(get_vector(batch, f.LIGHT_DIR, k), get_vector(batch, f.VIEW_DIR, k))
        across = max(l_dot_v - n_dot_l * n_dot_v, zero)
        reflected = n_dot_l * (a + b * across / max(max(n_dot_l, n_dot_v), least))
        batch[f.DIFFUSE + k] = batch[f.STRENGTH + k] * reflected if n_dot_l > zero else zero


def toon(batch, n, material):
    """Few levels, as in a drawing: N·L raised to the next k/levels, k = 1, 2, .. levels; a highlight of 1 where
    (R·V)^n >= 1/2.

    A step is a step: a rounding error next to one costs a whole level. The plan takes float64 for this model, and
    cosines within `grazing` above a step count as lying on it: what lies on a step exactly (a light parallel to a face,
    or at 60 degrees with two levels) falls on the same side everywhere. After Lake, Marshall, Harris & Blackstein 2000,
    NPAR, 13-20.
    """
    batch, material = as_array(batch, f.BATCH_SHAPE), as_array(material, m.REFLECTION_SHAPE)
    real = batch.dtype.type
    zero, one, two = real(0), real(1), real(2)
    slack = grazing(zero)
    levels, least = material[m.TOON_LEVELS], real(0.5) ** (one / material[m.SHININESS])
    for k in range(n):
        n_dot_l, strength = batch[f.N_DOT_L + k], batch[f.STRENGTH + k]
        l_dot_v = dot(get_vector(batch, f.LIGHT_DIR, k), get_vector(batch, f.VIEW_DIR, k))
        r_dot_v = two * n_dot_l * batch[f.N_DOT_V + k] - l_dot_v
        # A cosine may come out a little above 1.
        step = min(np.ceil(levels * (n_dot_l - slack)), levels) / levels
        batch[f.DIFFUSE + k] = strength * step if n_dot_l > slack else zero
        batch[f.SPECULAR + k] = strength if (n_dot_l > slack) & (r_dot_v >= least - slack) else zero


def ambient_share(batch, n, material):
    """Reflect an ambient share (`function_of_share`), whatever the model: as much to all sides, and no highlight."""
    batch = as_array(batch, f.BATCH_SHAPE)
    zero = batch.dtype.type(0)
    for k in range(n):
        batch[f.DIFFUSE + k] = batch[f.STRENGTH + k]
        batch[f.SPECULAR + k] = batch[f.GRAZING + k] = batch[f.METAL + k] = zero


# ---------------------------------------------------------------- Phong's and Blinn's highlights

MAX_SQUARED = 4096  # integer exponents up to this are raised by squaring
SMALLEST_SQUARED = 28.0  # results of that below 2^-28 become 0: invisible, and no denormal number on the way there


def phong(batch, n, material):
    """Lambert and a highlight (R·V)^n about the mirrored light direction (Phong 1975).

    The highlight is normalised, or parted by W(θ), cos θ = N·L, where the material asks for it.
    """
    batch, material = as_array(batch, f.BATCH_SHAPE), as_array(material, m.REFLECTION_SHAPE)
    fill_r_dot_v(batch, n)
    finish_highlights(batch, n, material)
    weight_highlights(batch, n, material)


def blinn(batch, n, material):
    """Lambert and a highlight (N·H)^n about the half vector (Blinn 1977); weighted as Phong's."""
    batch, material = as_array(batch, f.BATCH_SHAPE), as_array(material, m.REFLECTION_SHAPE)
    fill_n_dot_h(batch, n)
    finish_highlights(batch, n, material)
    weight_highlights(batch, n, material)


@helper
def fill_r_dot_v(batch, n):
    """Fill SPECULAR with R·V = 1 - |R - V|²/2, as both have unit length. Never above 1.

    An error e of a vector moves that by e·|R - V| alone, which the n-th power magnifies by about √n
    (engine/reflections.py); that of R·V itself, or of a vector's length, it would magnify by n.
    """
    real = batch.dtype.type
    one, two, a_half = real(1), real(2), real(0.5)
    for k in range(n):
        mirrored = scale(get_vector(batch, f.NORMAL, k), two * batch[f.N_DOT_L + k])
        reflect_dir = subtract(mirrored, get_vector(batch, f.LIGHT_DIR, k))
        difference = subtract(reflect_dir, get_vector(batch, f.VIEW_DIR, k))
        batch[f.SPECULAR + k] = one - a_half * dot(difference, difference)


@helper
def fill_n_dot_h(batch, n):
    """Fill SPECULAR with N·H = 1 - |N - H|²/2, see `fill_r_dot_v`.

    |L + V| by components: with 2 + 2 L·V for its square the digits cancel where the viewer looks towards the light.
    """
    real = batch.dtype.type
    zero, one, a_half = real(0), real(1), real(0.5)
    for k in range(n):
        half = add(get_vector(batch, f.LIGHT_DIR, k), get_vector(batch, f.VIEW_DIR, k))
        square = dot(half, half)
        half_dir = scale(half, one / np.sqrt(square))
        difference = subtract(get_vector(batch, f.NORMAL, k), half_dir)
        # Where L = -V there is no half vector, and no highlight.
        batch[f.SPECULAR + k] = one - a_half * dot(difference, difference) if square > zero else zero


@helper
def finish_highlights(batch, n, material):
    """Raise the cosines in SPECULAR to the exponent, and fill DIFFUSE; no highlight from a light behind the surface.

    A classic highlight ends at N·L = 0 with a step: what grazes the surface counts as behind it, see `grazing`. One
    that is normalised falls to 0 there.
    """
    zero, one = batch.dtype.type(0), batch.dtype.type(1)
    shininess, least = material[m.SHININESS], zero if material[m.HIGHLIGHT_SCALE] > zero else grazing(zero)
    if shininess == np.floor(shininess) and one <= shininess <= MAX_SQUARED:
        square_and_multiply(batch, n, np.int64(shininess))
    else:
        for k in range(n):
            batch[f.SPECULAR + k] = power(batch[f.SPECULAR + k], shininess)
    for k in range(n):
        n_dot_l, strength = batch[f.N_DOT_L + k], batch[f.STRENGTH + k]
        batch[f.DIFFUSE + k] = strength * n_dot_l if n_dot_l > zero else zero
        batch[f.SPECULAR + k] = strength * batch[f.SPECULAR + k] if n_dot_l > least else zero


@helper
def weight_highlights(batch, n, material):
    """Multiply SPECULAR by HIGHLIGHT_SCALE·N·L if that isn't 0, and part it where W(θ), cos θ = N·L, isn't 1."""
    zero, highlight_scale = batch.dtype.type(0), material[m.HIGHLIGHT_SCALE]
    if highlight_scale > zero:
        for k in range(n):
            batch[f.SPECULAR + k] = batch[f.SPECULAR + k] * (highlight_scale * max(batch[f.N_DOT_L + k], zero))
    if material[m.HAS_FRESNEL] > zero:
        for k in range(n):
            part_highlight(batch, k, batch[f.SPECULAR + k], max(batch[f.N_DOT_L + k], zero))


@helper
def square_and_multiply(batch, n, exponent):
    """Raise SPECULAR to an integer, two bits of it a pass (Knuth, TAOCP 2, 4.6.3); uses DIFFUSE.

    Results below 2^-28 become 0: invisible, and the denormal numbers on the way there would slow the loop down.
    """
    zero, one = batch.dtype.type(0), batch.dtype.type(1)
    smallest = batch.dtype.type(2.0 ** (-SMALLEST_SQUARED / exponent))
    is_first = True
    while exponent > 0:
        is_odd, is_odd_next = exponent & 1, exponent & 2
        for k in range(n):
            base = batch[f.DIFFUSE + k]
            if is_first:
                base = batch[f.SPECULAR + k] if batch[f.SPECULAR + k] > smallest else zero
            square = base * base
            factor = base if is_odd else one
            factor = factor * square if is_odd_next else factor
            batch[f.SPECULAR + k] = factor if is_first else batch[f.SPECULAR + k] * factor
            batch[f.DIFFUSE + k] = square * square
        exponent >>= 2
        is_first = False


# ---------------------------------------------------------------- microscopic mirrors, tilted at random

# SPECULAR / (1 - s) = GRAZING / s = strength · N·L · π D G / (4 (N·L) (N·V))       DIFFUSE = strength · N·L
#
# D says how many mirrors look along the half vector, G how many of these see both light and viewer. What a mirror
# reflects is W(θ), cos θ = |L + V|/2. An N·V below 0 is taken for 0: the formula has a finite limit there.
#
# Sources: Cook & Torrance 1981, Proc. SIGGRAPH, 307-316; Walter, Marschner, Li & Torrance 2007, EGSR, 195-206.

STEEP = 2.0**-20  # square of the cosine of a tilt of 89.94 degrees: Beckmann's D is exp(-2^20) there
BECKMANN_LIMIT = 1.6  # from this a on, G1 of Beckmann's distribution is 1


def ggx(batch, n, material):
    """Mirrors tilted as GGX says.

    D and G: Walter et al. 2007, equations 33, 34 and 23 (Smith's G, the two directions masked independently). With
    s = |N×H|, c = N·H: D = α² / (π (α² c² + s²)²); s by the cross product, because 1 - c² loses its digits in the
    highlight. G1(V) / (2 N·V) = 1 / (N·V + √(α² + (1-α²)(N·V)²)) is finite at N·V = 0, unlike with the V-shaped grooves
    of 1981.
    """
    batch, material = as_array(batch, f.BATCH_SHAPE), as_array(material, m.REFLECTION_SHAPE)
    two, alpha_square = batch.dtype.type(2), material[m.ROUGHNESS] * material[m.ROUGHNESS]
    for k in range(n):
        n_dot_l, reflected, half_square = ggx_mirrors(batch, k, alpha_square)
        set_reflection(batch, k, n_dot_l, reflected, np.sqrt(half_square) / two)


@helper
def ggx_mirrors(batch, k, alpha_square):
    """Return N·L, what fragment k reflects where W is 1, and |L + V|²; see `ggx`."""
    zero, one = batch.dtype.type(0), batch.dtype.type(1)
    rest = one - alpha_square
    half_square, along, across_square = half_vector_parts(batch, k)
    n_dot_l, n_dot_v = max(batch[f.N_DOT_L + k], zero), max(batch[f.N_DOT_V + k], zero)
    spread = alpha_square * along * along + across_square
    ratio = half_square / spread if (along > zero) & (spread > zero) else zero
    mirrors = alpha_square * ratio * ratio
    masked = n_dot_l / (n_dot_l + np.sqrt(alpha_square + rest * n_dot_l * n_dot_l))
    masked = masked / (n_dot_v + np.sqrt(alpha_square + rest * n_dot_v * n_dot_v))
    return n_dot_l, mirrors * masked, half_square


def beckmann(batch, n, material):
    """Mirrors tilted as Beckmann says: D = exp(-tan²θh / m²) / (π m² cos⁴θh).

    Cook & Torrance 1981; Smith's G in the approximation of Walter et al. 2007, section 5.2. Mirrors tilted by more than
    89.9° count as none: exp(-2^20).
    """
    batch, material = as_array(batch, f.BATCH_SHAPE), as_array(material, m.REFLECTION_SHAPE)
    real, roughness = batch.dtype.type, material[m.ROUGHNESS]
    zero, one, two, four, steep = real(0), real(1), real(2), real(4), real(STEEP)
    scale = one / (roughness * roughness)
    for k in range(n):
        half_square, along, across_square = half_vector_parts(batch, k)
        n_dot_l, n_dot_v = max(batch[f.N_DOT_L + k], zero), max(batch[f.N_DOT_V + k], zero)
        square = along * along
        inverse = one / square if (along > zero) & (square > steep * half_square) else zero
        ratio = half_square * inverse  # 1 / cos²θh
        mirrors = exponential(-scale * across_square * inverse) * scale * ratio * ratio
        masked = n_dot_l * beckmann_visible(n_dot_l, roughness) * beckmann_visible(n_dot_v, roughness) / four
        set_reflection(batch, k, n_dot_l, mirrors * masked, np.sqrt(half_square) / two)


@helper
def set_reflection(batch, k, n_dot_l, reflected, cosine):
    """Write what fragment k reflects; nothing where the light is behind the surface, also of infinite strength. All of
    SPECULAR may be metal: how much is, is in its colour."""
    zero, strength = batch.dtype.type(0), batch[f.STRENGTH + k]
    batch[f.DIFFUSE + k] = strength * n_dot_l if n_dot_l > zero else zero
    part_highlight(batch, k, strength * reflected if n_dot_l > zero else zero, cosine)
    batch[f.METAL + k] = batch[f.SPECULAR + k]


@helper
def half_vector_parts(batch, k):
    """Return |L + V|², the part of L + V along N, and the square of its part across N."""
    half = add(get_vector(batch, f.LIGHT_DIR, k), get_vector(batch, f.VIEW_DIR, k))
    normal = get_vector(batch, f.NORMAL, k)
    across = cross(normal, half)
    return dot(half, half), dot(normal, half), dot(across, across)


@helper
def beckmann_visible(cosine, roughness):
    """Return G1(θ) / cos θ of Beckmann's distribution (Walter et al. 2007, equation 27).

    With a = 1/(m tan θ) < 1.6, G1 = (3.535 a + 2.181 a²) / (1 + 2.276 a + 2.577 a²), else 1. The fraction exceeds 1 by
    less than 1e-4 from a = 1.55 on; cut off at 1, it is continuous.
    """
    real = type(cosine)
    slope = roughness * np.sqrt(max(real(1) - cosine * cosine, real(1e-12)))  # cos θ / a
    a = cosine / slope
    fraction = (real(3.535) + real(2.181) * a) / (real(1) + a * (real(2.276) + a * real(2.577))) / slope
    whole = real(1) / max(cosine, real(1e-12))
    return min(fraction, whole) if a < real(BECKMANN_LIMIT) else whole


# ---------------------------------------------------------------- mirrors of brushed metal, wood and hair

# They are tilted more across a direction T in the surface than along it. With B = N×T, and the roughnesses αx along T
# and αy across it:
#
#     D  = 1 / (π αx αy ((H·T)²/αx² + (H·B)²/αy² + (N·H)²)²)
#     G1 = 2 / (1 + √(1 + (αx²(V·T)² + αy²(V·B)²) / (N·V)²))
#     G1 / (2 N·V) = 1 / (N·V + √((N·V)² + αx²(V·T)² + αy²(V·B)²))
#
# The last two terms under the root are 1 - (N·V)² times the square of the roughness in the plane of N and V: `masking`.
# So it is `ggx` where αx = αy.
#
# Sources: Burley 2012, "Physically-based shading at Disney", appendix B; Heitz 2014, JCGT 3(2), equations 85 and 99.

SHORT = 2.0**-80  # square of a projected tangent that is too short to be one: see `tangent_in_surface`


def anisotropic_ggx(batch, n, material):
    """Cook-Torrance with GGX whose mirrors' tilt depends on a direction: TANGENT, of any length, in the surface or not.

    The plan takes float64 for this model: where the direction nearly stands upright on the surface its projection, and
    all that depends on it, has no bound in float32.
    """
    reflect_anisotropically(as_array(batch, f.BATCH_SHAPE), n, as_array(material, m.REFLECTION_SHAPE))


def anisotropic_ggx_by_axis(batch, n, material):
    """The same, the direction being an axis of the world: TANGENT_AXIS."""
    batch, material = as_array(batch, f.BATCH_SHAPE), as_array(material, m.REFLECTION_SHAPE)
    axis = read_vector(material, m.TANGENT_AXIS)
    for k in range(n):
        set_vector(batch, f.TANGENT, k, axis)
    reflect_anisotropically(batch, n, material)


@helper
def reflect_anisotropically(batch, n, material):
    """Fill what is reflected."""
    two, roughnesses = batch.dtype.type(2), (material[m.ROUGHNESS], material[m.ROUGHNESS_ACROSS])
    for k in range(n):
        half = add(get_vector(batch, f.LIGHT_DIR, k), get_vector(batch, f.VIEW_DIR, k))
        reflected = anisotropic_mirrors(batch, k, half, roughnesses)
        set_reflection(batch, k, batch[f.N_DOT_L + k], reflected, length(half) / two)


@helper
def anisotropic_mirrors(batch, k, half, roughnesses):
    """Return N·L · π D G / (4 (N·L) (N·V)) of fragment k; `half` is L + V, `roughnesses` are αx and αy."""
    zero, (roughness_along, roughness_across) = batch.dtype.type(0), roughnesses
    normal, light_dir = get_vector(batch, f.NORMAL, k), get_vector(batch, f.LIGHT_DIR, k)
    view_dir = get_vector(batch, f.VIEW_DIR, k)
    tangent, is_tangent = tangent_in_surface(normal, get_vector(batch, f.TANGENT, k))
    bitangent = cross(normal, tangent)
    mean = np.sqrt(roughness_along * roughness_across)
    alpha_x, alpha_y = roughness_along if is_tangent else mean, roughness_across if is_tangent else mean
    along = dot(normal, half)
    h_t, h_b = dot(half, tangent) / alpha_x, dot(half, bitangent) / alpha_y
    spread = h_t * h_t + h_b * h_b + along * along
    ratio = dot(half, half) / spread if (along > zero) & (spread > zero) else zero
    n_dot_l, n_dot_v = max(batch[f.N_DOT_L + k], zero), max(batch[f.N_DOT_V + k], zero)
    masked = n_dot_l / masking(n_dot_l, dot(light_dir, tangent), dot(light_dir, bitangent), alpha_x, alpha_y)
    masked = masked / masking(n_dot_v, dot(view_dir, tangent), dot(view_dir, bitangent), alpha_x, alpha_y)
    return ratio * ratio / (alpha_x * alpha_y) * masked


@helper
def tangent_in_surface(normal, tangent):
    """Return the unit vector along the tangent's part in the surface, and whether there is one; else any one there.

    With a unit tangent, T - (T·N)N errs by about 2^-52. Shorter than 2^-40 its direction errs by more than 2^-12: an
    axis that stands upright on the surface has no direction there, but rounding would make one up.
    """
    real = type(normal[0])
    zero, one = real(0), real(1)
    whole_square = dot(tangent, tangent)
    tangent = subtract(tangent, scale(normal, dot(normal, tangent)))
    square = dot(tangent, tangent)
    is_tangent = square > real(SHORT) * whole_square
    if not is_tangent:
        # The shortest of the axes' parts along N has the longest one across: never shorter than √(2/3).
        nx, ny, nz = abs(normal[0]), abs(normal[1]), abs(normal[2])
        is_x = (nx <= ny) & (nx <= nz)
        is_y = (not is_x) & (ny <= nz)
        axis = (one if is_x else zero, one if is_y else zero, zero if is_x | is_y else one)
        tangent = subtract(axis, scale(normal, dot(normal, axis)))
        square = dot(tangent, tangent)
    return scale(tangent, one / np.sqrt(square)), is_tangent


@helper
def masking(cosine, along, across, alpha_x, alpha_y):
    """Return c + √(c² + α²(1 - c²)) of a direction D, c its cosine with N: the denominator of G1(D) / (2 N·D).

    α² = (αx²(D·T)² + αy²(D·B)²) / ((D·T)² + (D·B)²) with D·T = `along` and D·B = `across`. Where D is N itself, α has
    no part in it. Where c was below 0 and is taken for 0, this is the limit at the horizon.
    """
    one, square = type(cosine)(1), along * along + across * across
    x, y = alpha_x * along, alpha_y * across
    alpha_square = (x * x + y * y) / square if square > type(cosine)(0) else alpha_x * alpha_y
    return cosine + np.sqrt(alpha_square + (one - alpha_square) * cosine * cosine)


# ---------------------------------------------------------------- the specular reflection function W(θ), and metals

# W = F0 + (1 - F0)·s with s = (1 - cos θ)^5 is F0·(1 - s) + s. So of a highlight S
#
#     ks·Ip·W·S = (ks·Ip·F0)·(S·(1 - s)) + (ks·Ip)·(S·s)
#
# in every channel and for every wavelength: two sums whose colours geometry has no part in, whether F0 is a number, a
# colour or a spectrum. With F0 within 0..1 neither term is negative, so nothing cancels.
#
# The share m of the surface is metal, whose F0 is M times the albedo a: colours of vertices, and what a texture shows.
# With F0 = (1 - m)·F + m·M·a
#
#     W = (1 - m)·F·(1 - s) + s + m·M·a·(1 - s)
#
# and the last term belongs to the sum that the albedo multiplies, beside (1 - m)·kd·Ip·N·L. So F0 follows the albedo
# wherever that is looked up, by every method of shading.
#
# Source: Schlick 1994, Computer Graphics Forum 13(3), 233-246.

MIN_SINK = 2.0**-12  # the fifth power of less is taken for 0: invisible, and never a denormal number


@helper
def part_highlight(batch, k, highlight, cosine):
    """Part a highlight of fragment k: s = (1 - cos θ)^5 of it goes to GRAZING, 1 - s of it to SPECULAR."""
    zero, one, least = batch.dtype.type(0), batch.dtype.type(1), batch.dtype.type(MIN_SINK)
    sink = one - cosine
    sink = sink if sink > least else zero
    share = sink * sink * (sink * sink) * sink
    # No products where nothing is left: the highlight may be infinite in the light itself.
    batch[f.GRAZING + k] = highlight * share if share > zero else zero
    batch[f.SPECULAR + k] = highlight * (one - share) if share < one else zero


def ggx_of_texture(batch, n, material):
    """GGX whose α, and the share m, a texture multiplies at every fragment: METALLIC and ROUGHNESS, α by its square.

    So 1 - m of DIFFUSE and SPECULAR, and m of METAL is left.
    """
    batch, material = as_array(batch, f.BATCH_SHAPE), as_array(material, m.REFLECTION_SHAPE)
    real = batch.dtype.type
    zero, one, two, least = real(0), real(1), real(2), real(MIN_ALPHA)
    for k in range(n):
        metallic = material[m.METALLIC] * batch[f.METALLIC + k]
        rest = one - metallic
        alpha = max(material[m.ROUGHNESS] * batch[f.ROUGHNESS + k] * batch[f.ROUGHNESS + k], least)
        n_dot_l, reflected, half_square = ggx_mirrors(batch, k, alpha * alpha)
        set_reflection(batch, k, n_dot_l, reflected, np.sqrt(half_square) / two)
        batch[f.METAL + k] = batch[f.METAL + k] * metallic if metallic > zero else zero
        batch[f.SPECULAR + k] = batch[f.SPECULAR + k] * rest if rest > zero else zero
        batch[f.DIFFUSE + k] = batch[f.DIFFUSE + k] * rest if rest > zero else zero


# ---------------------------------------------------------------- models of one's own


class Coefficients(NamedTuple):
    """What the formula of a reflection model of one's own reads of its material, of the type of the batch."""

    shininess: float
    roughness: float
    levels: float
    numbers: tuple  # N_OWN_NUMBER, with zeros behind those that the model has


@cache  # what is compiled of a formula is kept for good, as all batch functions are
def function_of_reflection(reflect: Callable) -> Callable:
    """Return the reflection function of a formula.

    Parameters
    ----------
    reflect : (normal, light_dir, view_dir, coefficients) -> D, S; for one point, see `registries.CustomReflection`
    """
    formula = helper(reflect)

    def evaluate(batch, n, material):
        batch, material = as_array(batch, f.BATCH_SHAPE), as_array(material, m.REFLECTION_SHAPE)
        zero = batch.dtype.type(0)
        at = m.OWN_NUMBERS
        numbers = material[at], material[at + 1], material[at + 2], material[at + 3], material[at + 4]
        coefficients = Coefficients(material[m.SHININESS], material[m.ROUGHNESS], material[m.TOON_LEVELS], numbers)
        for k in range(n):
            normal, light_dir = get_vector(batch, f.NORMAL, k), get_vector(batch, f.LIGHT_DIR, k)
            diffuse, specular = formula(normal, light_dir, get_vector(batch, f.VIEW_DIR, k), coefficients)
            strength, is_lit = batch[f.STRENGTH + k], batch[f.N_DOT_L + k] > zero
            batch[f.DIFFUSE + k] = strength * diffuse if is_lit else zero
            batch[f.SPECULAR + k] = strength * specular if is_lit else zero

    # By these names the store tells what is of this package: that alone is kept.
    evaluate.__module__, evaluate.__name__ = reflect.__module__, reflect.__name__
    return evaluate
