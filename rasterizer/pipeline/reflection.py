"""The reflection models, one reflection function each: what a batch reflects to the viewer of one light.

In:  NORMAL, LIGHT_DIR, VIEW_DIR, N_DOT_L, N_DOT_V and STRENGTH of the batch (fragments.py), and the coefficients of one
     material (material_coefficients.py).
Out: DIFFUSE and SPECULAR, which lighting.py multiplies by colours and sums over the lights.

    N  unit normal      L  unit vector to the light      V  unit vector to the viewer
    R  L mirrored at N, 2 (N·L) N - L                    H  half vector, (L + V) / |L + V|

A new model is a function, here or in a file of its own as cook_torrance.py is, and an entry in REFLECTION_FUNCTIONS, by
the name that the engine has for it. Which models conserve energy, and which are reciprocal: see the table in
scene/material.py. At a silhouette N·V may come out below 0, by a rounding error or an interpolated normal: no model
here divides by it.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..compiler.kernels import as_array, helper, index
from ..errors import SceneError
from ..geometry.vectors import add, dot, scale, subtract
from . import fragments as f
from . import material_coefficients as m
from .anisotropic import anisotropic_ggx, anisotropic_ggx_by_axis
from .cook_torrance import beckmann, ggx
from .fragments import get_vector
from .fresnel import grazing_term, grazing_term_of_mirrors, schlick
from .power import grazing, power

MOST_SQUARED = 4096  # integer exponents up to this are raised by squaring
SMALLEST_SQUARED = 28.0  # results of that below 2^-28 become 0: invisible, and no denormal number on the way there
LEAST_COSINE = 1 / 64  # of Oren-Nayar's smaller angle: see there


class ReflectionFunction(NamedTuple):
    """What the pipeline knows of a reflection model. Functions are (batch, n, coefficients), see `batch_function`."""

    evaluate: Callable
    needs_view: bool  # it reads N_DOT_V and VIEW_DIR
    has_highlight: bool  # it writes SPECULAR
    needs_tangent: bool = False  # it reads TANGENT, which nobody else fills for it
    second_term: Callable | None = None  # follows `evaluate` where F0 has a colour, see fresnel.py


def lambert(batch, n, material):
    """Diffuse reflection alone: the cosine of the angle of incidence (Lambert 1760)."""
    batch = as_array(batch, f.BATCH_SHAPE)
    zero = batch.dtype.type(0)  # of the batch's own type: an int would widen float32 to float64
    for k in range(index(n)):
        n_dot_l = batch[f.N_DOT_L + k]
        # No product where nothing is lit: the strength may be infinite in the light itself.
        batch[f.DIFFUSE + k] = batch[f.STRENGTH + k] * n_dot_l if n_dot_l > zero else zero


def phong(batch, n, material):
    """Lambert and a highlight (R·V)^n about the mirrored light direction (Phong 1975)."""
    batch, material = as_array(batch, f.BATCH_SHAPE), as_array(material, m.REFLECTION_SHAPE)
    fill_r_dot_v(batch, n)
    finish_highlights(batch, n, material)


def blinn(batch, n, material):
    """Lambert and a highlight (N·H)^n about the half vector (Blinn 1977)."""
    batch, material = as_array(batch, f.BATCH_SHAPE), as_array(material, m.REFLECTION_SHAPE)
    fill_n_dot_h(batch, n)
    finish_highlights(batch, n, material)


def weighted_phong(batch, n, material):
    """Phong's highlight times W(θ), or normalised, or both."""
    batch, material = as_array(batch, f.BATCH_SHAPE), as_array(material, m.REFLECTION_SHAPE)
    fill_r_dot_v(batch, n)
    finish_highlights(batch, n, material)
    weight_highlights(batch, n, material)


def weighted_blinn(batch, n, material):
    """Blinn's highlight times W(θ), or normalised, or both."""
    batch, material = as_array(batch, f.BATCH_SHAPE), as_array(material, m.REFLECTION_SHAPE)
    fill_n_dot_h(batch, n)
    finish_highlights(batch, n, material)
    weight_highlights(batch, n, material)


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
    zero, least = real(0), real(LEAST_COSINE)
    square = material[m.ROUGHNESS] * material[m.ROUGHNESS]
    a = real(1) - real(0.5) * square / (square + real(0.33))
    b = real(0.45) * square / (square + real(0.09))
    for k in range(index(n)):
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
    for k in range(index(n)):
        n_dot_l, strength = batch[f.N_DOT_L + k], batch[f.STRENGTH + k]
        l_dot_v = dot(get_vector(batch, f.LIGHT_DIR, k), get_vector(batch, f.VIEW_DIR, k))
        r_dot_v = two * n_dot_l * batch[f.N_DOT_V + k] - l_dot_v
        # A cosine may come out a little above 1.
        step = min(np.ceil(levels * (n_dot_l - slack)), levels) / levels
        batch[f.DIFFUSE + k] = strength * step if n_dot_l > slack else zero
        batch[f.SPECULAR + k] = strength if (n_dot_l > slack) & (r_dot_v >= least - slack) else zero


REFLECTION_FUNCTIONS = {
    "lambert": ReflectionFunction(lambert, needs_view=False, has_highlight=False),
    "phong": ReflectionFunction(phong, needs_view=True, has_highlight=True, second_term=grazing_term),
    "blinn": ReflectionFunction(blinn, needs_view=True, has_highlight=True, second_term=grazing_term),
    "weighted phong": ReflectionFunction(weighted_phong, needs_view=True, has_highlight=True, second_term=grazing_term),
    "weighted blinn": ReflectionFunction(weighted_blinn, needs_view=True, has_highlight=True, second_term=grazing_term),
    "oren-nayar": ReflectionFunction(oren_nayar, needs_view=True, has_highlight=False),
    "ggx": ReflectionFunction(ggx, needs_view=True, has_highlight=True, second_term=grazing_term_of_mirrors),
    "beckmann": ReflectionFunction(beckmann, needs_view=True, has_highlight=True, second_term=grazing_term_of_mirrors),
    "anisotropic ggx": ReflectionFunction(
        anisotropic_ggx,
        needs_view=True,
        has_highlight=True,
        needs_tangent=True,
        second_term=grazing_term_of_mirrors,
    ),
    "anisotropic ggx by axis": ReflectionFunction(
        anisotropic_ggx_by_axis, needs_view=True, has_highlight=True, second_term=grazing_term_of_mirrors
    ),
    "toon": ReflectionFunction(toon, needs_view=True, has_highlight=True),
}


def reflection_function_of(model: str) -> ReflectionFunction:
    """Return what the pipeline knows of a reflection model.

    Raises SceneError where it knows none of this name.
    """
    if model not in REFLECTION_FUNCTIONS:
        legal = ", ".join(sorted(REFLECTION_FUNCTIONS))
        raise SceneError(f"no reflection function is called {model!r}; there are {legal}")
    return REFLECTION_FUNCTIONS[model]


# ---------------------------------------------------------------- Phong's and Blinn's highlights


@helper
def fill_r_dot_v(batch, n):
    """Fill SPECULAR with R·V = 1 - |R - V|²/2, as both have unit length. Never above 1.

    An error e of a vector moves that by e·|R - V| alone, which the n-th power magnifies by about √n
    (engine/bounds.py); that of R·V itself, or of a vector's length, it would magnify by n.
    """
    real = batch.dtype.type
    one, two, a_half = real(1), real(2), real(0.5)
    for k in range(index(n)):
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
    for k in range(index(n)):
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
    if shininess == np.floor(shininess) and one <= shininess <= MOST_SQUARED:
        square_and_multiply(batch, n, np.int64(shininess))
    else:
        for k in range(index(n)):
            batch[f.SPECULAR + k] = power(batch[f.SPECULAR + k], shininess)
    for k in range(index(n)):
        n_dot_l, strength = batch[f.N_DOT_L + k], batch[f.STRENGTH + k]
        batch[f.DIFFUSE + k] = strength * n_dot_l if n_dot_l > zero else zero
        batch[f.SPECULAR + k] = strength * batch[f.SPECULAR + k] if n_dot_l > least else zero


@helper
def weight_highlights(batch, n, material):
    """Multiply SPECULAR by W(θ), cos θ = N·L, and by HIGHLIGHT_SCALE·N·L if that isn't 0."""
    zero = batch.dtype.type(0)
    fresnel, highlight_scale = material[m.FRESNEL], material[m.HIGHLIGHT_SCALE]
    for k in range(index(n)):
        batch[f.SPECULAR + k] = batch[f.SPECULAR + k] * schlick(fresnel, max(batch[f.N_DOT_L + k], zero))
    if highlight_scale > zero:
        for k in range(index(n)):
            batch[f.SPECULAR + k] = batch[f.SPECULAR + k] * (highlight_scale * max(batch[f.N_DOT_L + k], zero))


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
        for k in range(index(n)):
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
