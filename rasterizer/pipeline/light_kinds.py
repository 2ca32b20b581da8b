"""The kinds of light, one row function each: from surface points to the direction and the strength of the light that
arrives.

A row function reads the rows of normals and positions and one light's numbers, and writes the rows LIGHT_X, LIGHT_Y,
LIGHT_Z (unit vectors to the light), N_DOT_L and STRENGTH (the part of the light's intensity that arrives; lighting.py
applies its colour). A new kind of light needs its function here and a line in LIGHTS; engine/intensity_bounds.py gives
its name, engine/uniforms.py its numbers, engine/error_bounds.py its bound, engine/shadow_maps.py its map. Area lights
are many point lights (engine/plan.py).

Source of the formulas: the illumination equation, e.g. Foley, van Dam, Feiner & Hughes 1990, section 16.1; the range is
that of the glTF extension KHR_lights_punctual.
"""

from typing import NamedTuple

import numpy as np
from numba import carray
from numba.extending import register_jitable

from .fragments import (
    CHUNK,
    LIGHT_X,
    LIGHT_Y,
    LIGHT_Z,
    N_DOT_L,
    N_ROW,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    POSITION_X,
    POSITION_Y,
    POSITION_Z,
    STRENGTH,
)
from .power import grazing, power

# A light's numbers.
VECTOR, ATTENUATION, MOST, INVERSE_RANGE = 0, 3, 6, 7
AXIS, COS_OUTER, CONE_SCALE, CONE_EXPONENT, CONE_FALLOFF = 8, 11, 12, 13, 14  # of spot lights
N_NUMBER = 15


class LightKind(NamedTuple):
    """A kind of light as the shader sees it."""

    row_function: object
    needs_position: bool


def directional(rows, n, numbers):
    """Light from infinity: VECTOR is the unit direction to the light, the same everywhere."""
    row, number = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (N_NUMBER,))
    one = number.dtype.type(1)
    light_x, light_y, light_z = number[VECTOR], number[VECTOR + 1], number[VECTOR + 2]
    for k in range(np.uint64(n)):
        row[N_DOT_L + k] = row[NORMAL_X + k] * light_x + row[NORMAL_Y + k] * light_y + row[NORMAL_Z + k] * light_z
        row[LIGHT_X + k], row[LIGHT_Y + k], row[LIGHT_Z + k] = light_x, light_y, light_z
        row[STRENGTH + k] = one


def point(rows, n, numbers):
    """Light from a point: VECTOR is its position relative to the eye; it falls off as 1/(kc + kl·d + kq·d²)."""
    row, number = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (N_NUMBER,))
    shine_from_point(row, n, number)
    if number[INVERSE_RANGE] > number.dtype.type(0):
        end_at_range(row, n, number)


def spot(rows, n, numbers):
    """Light from a point within a cone about AXIS, the direction in which it travels."""
    row, number = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (N_NUMBER,))
    shine_from_point(row, n, number)
    if number[INVERSE_RANGE] > number.dtype.type(0):
        end_at_range(row, n, number)
    keep_to_cone(row, n, number)
    if number[CONE_EXPONENT] > number.dtype.type(0):
        weaken_off_axis(row, n, number)


def shaped_spot(rows, n, numbers):
    """A spot light whose fall between the cones is raised to the power CONE_FALLOFF."""
    row, number = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (N_NUMBER,))
    shine_from_point(row, n, number)
    if number[INVERSE_RANGE] > number.dtype.type(0):
        end_at_range(row, n, number)
    keep_to_shaped_cone(row, n, number)
    if number[CONE_EXPONENT] > number.dtype.type(0):
        weaken_off_axis(row, n, number)


def same_again(rows, n, numbers):
    """The light before once more: its rows still stand, and a second term of its highlight is weighted with another
    colour."""


LIGHTS = {
    "directional": LightKind(directional, needs_position=False),
    "point": LightKind(point, needs_position=True),
    "spot": LightKind(spot, needs_position=True),
    "shaped spot": LightKind(shaped_spot, needs_position=True),
}


@register_jitable
def shine_from_point(row, n, number):
    """Fill all rows for a light that shines alike to all sides."""
    light_x, light_y, light_z = number[VECTOR], number[VECTOR + 1], number[VECTOR + 2]
    constant, linear, quadratic = number[ATTENUATION], number[ATTENUATION + 1], number[ATTENUATION + 2]
    zero, one = (
        number.dtype.type(0),
        number.dtype.type(1),
    )  # of the rows' own type: an int would widen float32 to float64
    most = number[MOST]  # 1, or infinite where the light may amplify
    for k in range(np.uint64(n)):
        to_x = light_x - row[POSITION_X + k]
        to_y = light_y - row[POSITION_Y + k]
        to_z = light_z - row[POSITION_Z + k]
        square = to_x * to_x + to_y * to_y + to_z * to_z
        distance = np.sqrt(square)
        inverse = one / distance if square > zero else zero
        row[N_DOT_L + k] = (row[NORMAL_X + k] * to_x + row[NORMAL_Y + k] * to_y + row[NORMAL_Z + k] * to_z) * inverse
        row[LIGHT_X + k], row[LIGHT_Y + k], row[LIGHT_Z + k] = to_x * inverse, to_y * inverse, to_z * inverse
        row[STRENGTH + k] = min(most, one / (constant + linear * distance + quadratic * square))


@register_jitable
def end_at_range(row, n, number):
    """Let the strength fall smoothly to 0 at the light's range r: times max(0, 1 - (d/r)^4)."""
    light_x, light_y, light_z = number[VECTOR], number[VECTOR + 1], number[VECTOR + 2]
    zero, one = number.dtype.type(0), number.dtype.type(1)
    scale = number[INVERSE_RANGE] * number[INVERSE_RANGE]
    for k in range(np.uint64(n)):
        to_x = light_x - row[POSITION_X + k]
        to_y = light_y - row[POSITION_Y + k]
        to_z = light_z - row[POSITION_Z + k]
        share = (to_x * to_x + to_y * to_y + to_z * to_z) * scale  # (d/r)²
        # No product where nothing arrives: the strength may be infinite in the light itself.
        row[STRENGTH + k] = row[STRENGTH + k] * (one - share * share) if share < one else zero


@register_jitable
def keep_to_cone(row, n, number):
    """Let the strength fall from the inner to the outer cone as t²(3 - 2t), t = (c - c_outer)/(c_inner - c_outer), c
    the cosine of the angle from the axis; a step where both cones are the same, which belongs to the inside (see
    `grazing`)."""
    axis_x, axis_y, axis_z = number[AXIS], number[AXIS + 1], number[AXIS + 2]
    outer, scale = number[COS_OUTER], number[CONE_SCALE]
    zero, one, two, three = number.dtype.type(0), number.dtype.type(1), number.dtype.type(2), number.dtype.type(3)
    is_step = scale == np.inf
    least = -grazing(zero) if is_step else zero
    for k in range(np.uint64(n)):
        above = -(row[LIGHT_X + k] * axis_x + row[LIGHT_Y + k] * axis_y + row[LIGHT_Z + k] * axis_z) - outer
        t = one if is_step else min(above * scale, one)
        row[STRENGTH + k] = row[STRENGTH + k] * (t * t * (three - two * t)) if above >= least else zero


@register_jitable
def keep_to_shaped_cone(row, n, number):
    """As `keep_to_cone`, with the fall t²(3 - 2t) raised to a power: its slope, see engine/intensity_bounds.py."""
    axis_x, axis_y, axis_z = number[AXIS], number[AXIS + 1], number[AXIS + 2]
    outer, scale, falloff = number[COS_OUTER], number[CONE_SCALE], number[CONE_FALLOFF]
    zero, one, two, three = number.dtype.type(0), number.dtype.type(1), number.dtype.type(2), number.dtype.type(3)
    is_step = scale == np.inf
    for k in range(np.uint64(n)):
        above = -(row[LIGHT_X + k] * axis_x + row[LIGHT_Y + k] * axis_y + row[LIGHT_Z + k] * axis_z) - outer
        t = one if is_step else min(above * scale, one)
        fall = power(min(t * t * (three - two * t), one), falloff)
        row[STRENGTH + k] = row[STRENGTH + k] * fall if above >= zero else zero


@register_jitable
def weaken_off_axis(row, n, number):
    """Multiply the strength by the cosine of the angle from the axis, to the spot's exponent."""
    axis_x, axis_y, axis_z = number[AXIS], number[AXIS + 1], number[AXIS + 2]
    exponent, one = number[CONE_EXPONENT], number.dtype.type(1)
    for k in range(np.uint64(n)):
        cosine = -(row[LIGHT_X + k] * axis_x + row[LIGHT_Y + k] * axis_y + row[LIGHT_Z + k] * axis_z)
        row[STRENGTH + k] *= power(min(cosine, one), exponent)
