"""Mirrors that are tilted more across a direction T in the surface than along it: brushed metal, wood, hair.

Burley 2012, "Physically-based shading at Disney", appendix B; Heitz 2014, JCGT 3(2), equations 85 and 99. With B = N×T,
and the roughnesses αx along T and αy across it:

    D  = 1 / (π αx αy ((H·T)²/αx² + (H·B)²/αy² + (N·H)²)²)
    G1 = 2 / (1 + √(1 + (αx²(V·T)² + αy²(V·B)²) / (N·V)²))
    G1 / (2 N·V) = 1 / (N·V + √((N·V)² + αx²(V·T)² + αy²(V·B)²))

The last two terms under the root are 1 - (N·V)² times the square of the roughness in the plane of N and V: `masking`.
So it is the isotropic formula (cook_torrance.py) where αx = αy.
"""

import numpy as np

from ..compiler.kernels import as_array, helper, index
from ..geometry.vectors import add, cross, dot, length, scale, subtract
from . import fragments as f
from . import material_coefficients as m
from .cook_torrance import set_reflection
from .fragments import get_vector, read_vector, set_vector
from .fresnel import schlick

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
    for k in range(index(n)):
        set_vector(batch, f.TANGENT, k, axis)
    reflect_anisotropically(batch, n, material)


@helper
def reflect_anisotropically(batch, n, material):
    """Fill DIFFUSE and SPECULAR."""
    two, roughnesses = batch.dtype.type(2), (material[m.ROUGHNESS], material[m.ROUGHNESS_ACROSS])
    for k in range(index(n)):
        half = add(get_vector(batch, f.LIGHT_DIR, k), get_vector(batch, f.VIEW_DIR, k))
        reflected = anisotropic_mirrors(batch, k, half, roughnesses)
        reflected = reflected * schlick(material[m.FRESNEL], length(half) / two)
        set_reflection(batch, k, batch[f.N_DOT_L + k], reflected)


@helper
def anisotropic_mirrors(batch, k, half, roughnesses):
    """Return N·L · π D G / (4 (N·L) (N·V)) of fragment k, without W; `half` is L + V, `roughnesses` are αx and αy."""
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
