"""Mirrors that are tilted more across a direction T in the surface than along it: brushed metal, wood, hair.

Burley 2012, "Physically-based shading at Disney", appendix B; Heitz 2014, JCGT 3(2), equations 85 and 99. With B = N×T,
and the roughnesses αx along T and αy across it:

    D  = 1 / (π αx αy ((H·T)²/αx² + (H·B)²/αy² + (N·H)²)²)
    G1 = 2 / (1 + √(1 + (αx²(V·T)² + αy²(V·B)²) / (N·V)²)), so G1 / (2 N·V) = 1 / (N·V + √((N·V)² + αx²(V·T)² +
    αy²(V·B)²))

whose last two terms are `masking`, 1 - (N·V)² times the square of the roughness in the plane of N and V: so it is the
isotropic formula where αx = αy.
"""

import numpy as np
from numba import carray
from numba.extending import register_jitable

from .fragments import (
    CHUNK,
    LIGHT_X,
    LIGHT_Y,
    LIGHT_Z,
    N_DOT_L,
    N_DOT_V,
    N_ROW,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    TANGENT_X,
    TANGENT_Y,
    TANGENT_Z,
    VIEW_X,
    VIEW_Y,
    VIEW_Z,
)

SHORT = 2.0**-80  # square of a projected tangent that is too short to be one: see `tangent_at`


@register_jitable
def fill_tangents(rows, n, x, y, z):
    """Fill the rows TANGENT with one direction."""
    row = carray(rows, (N_ROW * CHUNK,))
    for k in range(np.uint64(n)):
        row[TANGENT_X + k], row[TANGENT_Y + k], row[TANGENT_Z + k] = x, y, z


@register_jitable
def anisotropic_mirrors(row, k, alpha_along, alpha_across):
    """π D G / (4 N·V), without W; the rows TANGENT hold T, of any length and not yet in the surface."""
    zero = row.dtype.type(0)
    nx, ny, nz = row[NORMAL_X + k], row[NORMAL_Y + k], row[NORMAL_Z + k]
    lx, ly, lz = row[LIGHT_X + k], row[LIGHT_Y + k], row[LIGHT_Z + k]
    vx, vy, vz = row[VIEW_X + k], row[VIEW_Y + k], row[VIEW_Z + k]
    tx, ty, tz, is_tangent = tangent_at(row, k)
    bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    mean = np.sqrt(alpha_along * alpha_across)
    ax, ay = alpha_along if is_tangent else mean, alpha_across if is_tangent else mean
    hx, hy, hz = lx + vx, ly + vy, lz + vz
    half_square, along = hx * hx + hy * hy + hz * hz, nx * hx + ny * hy + nz * hz
    h_t, h_b = (hx * tx + hy * ty + hz * tz) / ax, (hx * bx + hy * by + hz * bz) / ay
    spread = h_t * h_t + h_b * h_b + along * along
    ratio = half_square / spread if (along > zero) & (spread > zero) else zero
    n_dot_l, n_dot_v = max(row[N_DOT_L + k], zero), max(row[N_DOT_V + k], zero)
    masked = n_dot_l / masking(n_dot_l, lx * tx + ly * ty + lz * tz, lx * bx + ly * by + lz * bz, ax, ay)
    masked = masked / masking(n_dot_v, vx * tx + vy * ty + vz * tz, vx * bx + vy * by + vz * bz, ax, ay)
    return ratio * ratio / (ax * ay) * masked


@register_jitable
def tangent_at(row, k):
    """The unit vector along the row TANGENT's part in the surface, and whether there is one; else any in the surface.

    With a unit tangent, T - (T·N)N errs by about 2^-52. Shorter than 2^-40 its direction errs by more than 2^-12: an
    axis that stands upright on the surface has no direction there, but rounding would make one up.
    """
    nx, ny, nz = row[NORMAL_X + k], row[NORMAL_Y + k], row[NORMAL_Z + k]
    tx, ty, tz = row[TANGENT_X + k], row[TANGENT_Y + k], row[TANGENT_Z + k]
    zero, one = row.dtype.type(0), row.dtype.type(1)
    whole = tx * tx + ty * ty + tz * tz
    up = nx * tx + ny * ty + nz * tz
    tx, ty, tz = tx - up * nx, ty - up * ny, tz - up * nz
    square = tx * tx + ty * ty + tz * tz
    is_tangent = square > row.dtype.type(SHORT) * whole
    if not is_tangent:
        # The shortest of the axes' parts along N has the longest one across: never shorter than √(2/3).
        is_x = (abs(nx) <= abs(ny)) & (abs(nx) <= abs(nz))
        is_y = (not is_x) & (abs(ny) <= abs(nz))
        tx, ty, tz = one if is_x else zero, one if is_y else zero, zero if is_x | is_y else one
        up = nx * tx + ny * ty + nz * tz
        tx, ty, tz = tx - up * nx, ty - up * ny, tz - up * nz
        square = tx * tx + ty * ty + tz * tz
    scale = one / np.sqrt(square)
    return tx * scale, ty * scale, tz * scale, is_tangent


@register_jitable
def masking(cosine, along, across, alpha_along, alpha_across):
    """c + √(c² + α²(1 - c²)), c the cosine of a direction D with N, α² = (αx²(D·T)² + αy²(D·B)²) / ((D·T)² + (D·B)²).

    Where D is N itself, α has no part in it. Where c was below 0 and is taken for 0, this is the limit at the horizon.
    """
    one, square = type(cosine)(1), along * along + across * across
    x, y = alpha_along * along, alpha_across * across
    alpha_square = (x * x + y * y) / square if square > type(cosine)(0) else alpha_along * alpha_across
    return cosine + np.sqrt(alpha_square + (one - alpha_square) * cosine * cosine)
