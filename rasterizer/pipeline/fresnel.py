"""The second term of highlights whose F0 is a colour or a spectrum: row functions that follow those of reflection.py.

The specular reflection function W = F0 + (1 - F0)·s, s = (1 - cos θ)^5, is affine in F0. So a light's highlight is
summed in two terms, each with a colour of its own (engine/uniforms.py, engine/spectral_products.py): the first is what
reflection.py finds with W = 1, the second s times that.
"""

import numpy as np
from numba import carray

from .fragments import CHUNK, DIFFUSE, N_DOT_L, N_ROW, SPECULAR
from .reflection import half_parts, schlick


def grazing_part(rows, n, numbers):
    """The second term of a highlight whose F0 is a colour, after the first: times s = (1 - cos θ)^5, cos θ = N·L.

    W = F0 + (1 - F0) s is affine in F0, so  ks·Ip·W·h = (ks·Ip·F0)·h + (ks·Ip·(1 - F0))·(s·h)  in every channel and for
    every wavelength: two sums with colours that geometry has no part in. With F0 within 0..1 neither has negative
    terms, and nothing cancels. The row SPECULAR still holds h, from the row function before.
    """
    row = carray(rows, (N_ROW * CHUNK,))
    zero = row.dtype.type(0)
    for k in range(np.uint64(n)):
        sink = schlick(zero, max(row[N_DOT_L + k], zero))
        # No product where nothing is left: the highlight may be infinite in the light itself.
        row[SPECULAR + k] = row[SPECULAR + k] * sink if sink > zero else zero
        row[DIFFUSE + k] = zero


def grazing_part_of_mirrors(rows, n, numbers):
    """The same for Cook-Torrance, where θ is the angle of incidence on the mirrors: cos θ = |L + V|/2."""
    row = carray(rows, (N_ROW * CHUNK,))
    zero, two = row.dtype.type(0), row.dtype.type(2)
    for k in range(np.uint64(n)):
        half_square, _, _ = half_parts(row, k)
        sink = schlick(zero, np.sqrt(half_square) / two)
        row[SPECULAR + k] = row[SPECULAR + k] * sink if sink > zero else zero
        row[DIFFUSE + k] = zero


def no_second_part(rows, n, numbers):
    """Of a material whose F0 has no colour, in a scene where another one's has."""
    row = carray(rows, (N_ROW * CHUNK,))
    zero = row.dtype.type(0)
    for k in range(np.uint64(n)):
        row[DIFFUSE + k] = row[SPECULAR + k] = zero


# By the reflection that a material names.
SECOND_PARTS = {"phong": grazing_part, "blinn": grazing_part, "cook-torrance": grazing_part_of_mirrors}
