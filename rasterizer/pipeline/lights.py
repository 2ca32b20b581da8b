"""The types of light, one light function each: the direction and the strength of the light that arrives at a batch.

In:  normals and positions of the batch (fragments.py), and the coefficients of one light.
Out: LIGHT_DIR, N_DOT_L, and STRENGTH, the part of the light's intensity that arrives; lighting.py applies its colour.

A new type of light is a function here and a row in the engine's table (engine/lights.py). Area lights are many point
lights. Light of one's own (registries.py) is one formula for one point: `function_of_arrival` or
`function_of_share` makes a light function of it.

Source of the formulas: the illumination equation, e.g. Foley, van Dam, Feiner & Hughes 1990, section 16.1; the range is
that of the glTF extension KHR_lights_punctual.
"""

from collections.abc import Callable
from functools import cache

import numpy as np

from ..compiler.kernels import as_array, helper
from ..geometry.vectors import dot, scale, subtract
from . import fragments as f
from .fragments import get_vector, read_vector, set_vector
from .power import grazing, power

# Where a light's coefficients stand. Lengths are in scene units, VECTOR and AXIS along the world's axes.
VECTOR, ATTENUATION, MAX_STRENGTH, INVERSE_RANGE = 0, 3, 6, 7
AXIS, COS_OUTER, CONE_SCALE, CONE_EXPONENT, CONE_FALLOFF = 8, 11, 12, 13, 14  # of spot lights
N_LIGHT_COEFFICIENT = 15
LIGHT_SHAPE = (N_LIGHT_COEFFICIENT,)


def directional(batch, n, light):
    """Light from infinity: VECTOR is the unit direction to the light, the same everywhere."""
    batch, light = as_array(batch, f.BATCH_SHAPE), as_array(light, LIGHT_SHAPE)
    one = light.dtype.type(1)
    light_dir = read_vector(light, VECTOR)
    for k in range(n):
        batch[f.N_DOT_L + k] = dot(get_vector(batch, f.NORMAL, k), light_dir)
        set_vector(batch, f.LIGHT_DIR, k, light_dir)
        batch[f.STRENGTH + k] = one


def point(batch, n, light):
    """Light from a point: VECTOR is its position relative to the eye; it falls off as 1/(kc + kl·d + kq·d²)."""
    batch, light = as_array(batch, f.BATCH_SHAPE), as_array(light, LIGHT_SHAPE)
    light_from_point(batch, n, light)
    end_at_range(batch, n, light)


def spot(batch, n, light):
    """Light from a point within a cone about AXIS, the direction in which it travels."""
    batch, light = as_array(batch, f.BATCH_SHAPE), as_array(light, LIGHT_SHAPE)
    light_from_point(batch, n, light)
    end_at_range(batch, n, light)
    keep_to_cone(batch, n, light, False)
    weaken_off_axis(batch, n, light)


def shaped_spot(batch, n, light):
    """A spot light whose fall between the cones is raised to the power CONE_FALLOFF: it takes longer."""
    batch, light = as_array(batch, f.BATCH_SHAPE), as_array(light, LIGHT_SHAPE)
    light_from_point(batch, n, light)
    end_at_range(batch, n, light)
    keep_to_cone(batch, n, light, True)
    weaken_off_axis(batch, n, light)


@cache  # what is compiled of a formula is kept for good, as all batch functions are
def function_of_arrival(arrival: Callable) -> Callable:
    """Return the light function of light with a direction.

    Parameters
    ----------
    arrival : (normal, position, numbers) -> unit direction to the light, strength; for one point, see
        `registries.CustomLight`
    """
    formula = helper(arrival)

    def evaluate(batch, n, light):
        batch, light = as_array(batch, f.BATCH_SHAPE), as_array(light, LIGHT_SHAPE)
        for k in range(n):
            normal = get_vector(batch, f.NORMAL, k)
            light_dir, strength = formula(normal, get_vector(batch, f.POSITION, k), light)
            batch[f.N_DOT_L + k] = dot(normal, light_dir)
            set_vector(batch, f.LIGHT_DIR, k, light_dir)
            batch[f.STRENGTH + k] = strength

    evaluate.__module__, evaluate.__name__ = (
        arrival.__module__,
        arrival.__name__,
    )  # the store keeps what is of this package
    return evaluate


@cache  # what is compiled of a formula is kept for good, as all batch functions are
def function_of_share(share: Callable) -> Callable:
    """Return the light function of an ambient share: N·L is 1 everywhere, and no reflection model has a part in it.

    Parameters
    ----------
    share : (normal, position, numbers) -> what a point gets of the light, for one point
    """
    formula = helper(share)

    def evaluate(batch, n, light):
        batch, light = as_array(batch, f.BATCH_SHAPE), as_array(light, LIGHT_SHAPE)
        one = batch.dtype.type(1)
        for k in range(n):
            batch[f.N_DOT_L + k] = one
            batch[f.STRENGTH + k] = formula(get_vector(batch, f.NORMAL, k), get_vector(batch, f.POSITION, k), light)

    evaluate.__module__, evaluate.__name__ = share.__module__, share.__name__
    return evaluate


@helper
def light_from_point(batch, n, light):
    """Fill what a light that shines alike to all sides writes."""
    light_position, attenuation = read_vector(light, VECTOR), read_vector(light, ATTENUATION)
    constant, linear, quadratic = attenuation
    real = light.dtype.type
    zero, one = real(0), real(1)  # of the batch's own type: an int would widen float32 to float64
    strongest = light[MAX_STRENGTH]  # 1, or infinite where the light may amplify
    for k in range(n):
        to_light = subtract(light_position, get_vector(batch, f.POSITION, k))
        square = dot(to_light, to_light)
        distance = np.sqrt(square)
        inverse = one / distance if square > zero else zero
        batch[f.N_DOT_L + k] = dot(get_vector(batch, f.NORMAL, k), to_light) * inverse
        set_vector(batch, f.LIGHT_DIR, k, scale(to_light, inverse))
        batch[f.STRENGTH + k] = min(strongest, one / (constant + linear * distance + quadratic * square))


@helper
def end_at_range(batch, n, light):
    """Let the strength fall smoothly to 0 at the light's range r, if it has one: times max(0, 1 - (d/r)^4)."""
    zero, one = light.dtype.type(0), light.dtype.type(1)
    light_position = read_vector(light, VECTOR)
    inverse_square = light[INVERSE_RANGE] * light[INVERSE_RANGE]
    if light[INVERSE_RANGE] > zero:
        for k in range(n):
            to_light = subtract(light_position, get_vector(batch, f.POSITION, k))
            share = dot(to_light, to_light) * inverse_square  # (d/r)²
            # No product where nothing arrives: the strength may be infinite in the light itself.
            batch[f.STRENGTH + k] = batch[f.STRENGTH + k] * (one - share * share) if share < one else zero


@helper
def keep_to_cone(batch, n, light, is_shaped):
    """Let the strength fall from the inner to the outer cone as t²(3 - 2t), t = (c - c_outer)/(c_inner - c_outer).

    c is the cosine of the angle from the axis. Where both cones are the same the fall is a step, which belongs to the
    inside (see `grazing`). `is_shaped`, a constant, raises the fall to a power: its slope, see engine/lights.py.
    """
    real, axis, outer, slope = light.dtype.type, read_vector(light, AXIS), light[COS_OUTER], light[CONE_SCALE]
    zero, one, two, three = real(0), real(1), real(2), real(3)
    is_step, falloff = slope == np.inf, light[CONE_FALLOFF]
    least = -grazing(zero) if is_step else zero
    for k in range(n):
        above = -dot(get_vector(batch, f.LIGHT_DIR, k), axis) - outer
        t = one if is_step else min(above * slope, one)
        fall = t * t * (three - two * t)
        if is_shaped:
            fall = power(min(fall, one), falloff)
        batch[f.STRENGTH + k] = batch[f.STRENGTH + k] * fall if above >= least else zero


@helper
def weaken_off_axis(batch, n, light):
    """Multiply the strength by the cosine of the angle from the axis, to the spot's exponent, if it has one."""
    axis, exponent, one = read_vector(light, AXIS), light[CONE_EXPONENT], light.dtype.type(1)
    if exponent > light.dtype.type(0):
        for k in range(n):
            cosine = -dot(get_vector(batch, f.LIGHT_DIR, k), axis)
            batch[f.STRENGTH + k] *= power(min(cosine, one), exponent)
