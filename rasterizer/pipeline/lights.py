"""The kinds of light, one row function each: from surface points to the direction and the strength of the light that arrives.

A row function reads the rows of normals and positions and one light's numbers, and writes the rows LIGHT_X, LIGHT_Y, LIGHT_Z (unit
vectors to the light), N_DOT_L and STRENGTH (the part of the light's intensity that arrives; lighting.py applies its colour). To add a kind of light:
write its function here and one line in LIGHTS.

Source of the formulas: the illumination equation, e.g. Foley, van Dam, Feiner & Hughes 1990, section 16.1.
"""

from typing import NamedTuple

import numpy as np
from numba import carray

from .rows import (
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

# A light's numbers. Colour first: shade.py reads it for every kind.
COLOR, VECTOR, ATTENUATION, MOST = 0, 3, 6, 9
N_NUMBER = 16


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
    light_x, light_y, light_z = number[VECTOR], number[VECTOR + 1], number[VECTOR + 2]
    constant, linear, quadratic = number[ATTENUATION], number[ATTENUATION + 1], number[ATTENUATION + 2]
    zero, one = number.dtype.type(0), number.dtype.type(1)  # of the rows' own type: an int would widen float32 to float64
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


LIGHTS = {
    "directional": LightKind(directional, needs_position=False),
    "point": LightKind(point, needs_position=True),
}
