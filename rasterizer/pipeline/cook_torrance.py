"""Highlights of microscopic mirrors, tilted at random (Cook & Torrance 1981): the reflection functions.

    SPECULAR = strength · N·L · π D F G / (4 (N·L) (N·V))       DIFFUSE = strength · N·L

D says how many mirrors look along the half vector, G how many of these see both light and viewer, F = W(θ) what a
mirror reflects, cos θ = |L + V|/2. At a silhouette N·V may come out below 0, by a rounding error or an interpolated
normal: it is taken for 0, where the formula has a finite limit. Mirrors whose tilt depends on a direction in the
surface: anisotropic.py.

Sources: Cook & Torrance 1981, Proc. SIGGRAPH, 307-316; Walter, Marschner, Li & Torrance 2007, EGSR, 195-206.
"""

import numpy as np

from ..compiler.kernels import as_array, helper, index
from ..geometry.vectors import add, cross, dot
from . import fragments as f
from . import material_coefficients as m
from .fragments import get_vector
from .fresnel import schlick
from .power import exponential

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
    zero, one, two = batch.dtype.type(0), batch.dtype.type(1), batch.dtype.type(2)
    alpha_square = material[m.ROUGHNESS] * material[m.ROUGHNESS]
    rest = one - alpha_square
    for k in range(index(n)):
        half_square, along, across_square = half_vector_parts(batch, k)
        n_dot_l, n_dot_v = max(batch[f.N_DOT_L + k], zero), max(batch[f.N_DOT_V + k], zero)
        spread = alpha_square * along * along + across_square
        ratio = half_square / spread if (along > zero) & (spread > zero) else zero
        mirrors = alpha_square * ratio * ratio
        masked = n_dot_l / (n_dot_l + np.sqrt(alpha_square + rest * n_dot_l * n_dot_l))
        masked = masked / (n_dot_v + np.sqrt(alpha_square + rest * n_dot_v * n_dot_v))
        reflected = mirrors * masked * schlick(material[m.FRESNEL], np.sqrt(half_square) / two)
        set_reflection(batch, k, n_dot_l, reflected)


def beckmann(batch, n, material):
    """Mirrors tilted as Beckmann says: D = exp(-tan²θh / m²) / (π m² cos⁴θh).

    Cook & Torrance 1981; Smith's G in the approximation of Walter et al. 2007, section 5.2. Mirrors tilted by more than
    89.9° count as none: exp(-2^20).
    """
    batch, material = as_array(batch, f.BATCH_SHAPE), as_array(material, m.REFLECTION_SHAPE)
    real, roughness = batch.dtype.type, material[m.ROUGHNESS]
    zero, one, two, four, steep = real(0), real(1), real(2), real(4), real(STEEP)
    scale = one / (roughness * roughness)
    for k in range(index(n)):
        half_square, along, across_square = half_vector_parts(batch, k)
        n_dot_l, n_dot_v = max(batch[f.N_DOT_L + k], zero), max(batch[f.N_DOT_V + k], zero)
        square = along * along
        inverse = one / square if (along > zero) & (square > steep * half_square) else zero
        ratio = half_square * inverse  # 1 / cos²θh
        mirrors = exponential(-scale * across_square * inverse) * scale * ratio * ratio
        masked = n_dot_l * beckmann_visible(n_dot_l, roughness) * beckmann_visible(n_dot_v, roughness) / four
        reflected = mirrors * masked * schlick(material[m.FRESNEL], np.sqrt(half_square) / two)
        set_reflection(batch, k, n_dot_l, reflected)


@helper
def set_reflection(batch, k, n_dot_l, reflected):
    """Write what fragment k reflects; nothing where the light is behind the surface, also of infinite strength."""
    zero, strength = batch.dtype.type(0), batch[f.STRENGTH + k]
    batch[f.DIFFUSE + k] = strength * n_dot_l if n_dot_l > zero else zero
    batch[f.SPECULAR + k] = strength * reflected if n_dot_l > zero else zero


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
