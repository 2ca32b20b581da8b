"""Shadows: which part of a light arrives, by comparing depths with a map of what the light sees (Williams 1978).

A shadow map is a picture of the scene from the light, drawn by this rasterizer: a texel holds 1/w of the nearest surface, or
minus its depth where the rays are parallel; so larger is nearer, and both are planes over the map where the surface is one.

`cast` is a row function like those of lights (lights.py): it reads the rows of positions, normals and of the surface's shape, and
multiplies STRENGTH by the lit part. Its numbers are a header followed by the maps themselves. A picture with shadows is computed
in float64: next to a shadow's edge no error is small.

A texel shows the depth at its centre alone. So a surface's own depth is taken there, too: the value at the point plus the slopes
of its tangent plane, which the normal gives, times the way to the centre. On one plane both agree, but for

    half a texel times the slopes     neighbouring polygons that fold towards the light reach into the texel by that much;
                                      it also covers the rounding of the map's vertices, a 512th of a texel
    2^-32 of the map's range          rounding of its values: planes of depth err by a 2^-33rd of it (block.py)
    2^-40 of the distances            rounding of positions: float64, a few operations from the corners to the point

which is all that a point may lie behind the map and still be lit. The picture's own vertices are rounded to 1/256 px, which tilts
its polygons a little: so a point is first moved onto the plane that its polygon has in the scene. A polygon that stands for a
piece of a curved surface may lie below it: the point is then lifted along its normal by LIFT, how far the polygon's corners lie
from their neighbours' tangent planes (geometry.py); flat surfaces have no lift. So nothing of a convex surface lies before the
tangent plane of a lifted point; before the plane of its polygon neighbours may lie, where the polygon is turned away from the
light and its normals are not yet. Where a point is lifted beyond the light, it is lit.
"""

import numpy as np
from numba import carray
from numba.extending import register_jitable

from .._kernel import borrow, kernel
from .records import PAYLOAD_BITS
from .resolve import clean
from .rows import (
    CHUNK,
    LIFT,
    N_DOT_L,
    N_ROW,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    OFFSET,
    PLANE_X,
    PLANE_Y,
    PLANE_Z,
    POSITION_X,
    POSITION_Y,
    POSITION_Z,
    STRENGTH,
)
from .scan import CLEAR, GROUP_SHIFT

# The header: how many maps (1, or 6: one for each face of a cube), texels a side, texels a side of the filter, whether rays
# diverge; then for each map: the light's place relative to the eye, its axes (right, up, forward), scale and centre, texels;
# rounding of its values.
N_MAP, SIZE, FILTER, IS_PERSPECTIVE, MAPS = 0, 1, 2, 3, 4
ORIGIN, RIGHT, UP, FORWARD, SCALE_X, SCALE_Y, CENTER_X, CENTER_Y, ROUNDING, N_MAP_NUMBER = (
    0, 3, 6, 9, 12, 13, 14, 15, 16, 17,
)  # fmt: skip
HEADER = MAPS + 6 * N_MAP_NUMBER
POSITION_ROUNDING = 2.0**-40


def cast(rows, n, numbers):
    """Multiply STRENGTH by the part of the light that isn't held off."""
    row, header = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (HEADER,))
    size, taps = np.int64(header[SIZE]), np.int64(header[FILTER])
    is_cube, is_perspective = header[N_MAP] > header.dtype.type(1), header[IS_PERSPECTIVE] != header.dtype.type(0)
    texels = carray(numbers, (HEADER + np.int64(header[N_MAP]) * size * size,))
    zero = header.dtype.type(0)
    for k in range(np.uint64(n)):
        if row[N_DOT_L + k] > zero and row[STRENGTH + k] > zero:
            x, y, z = row[POSITION_X + k], row[POSITION_Y + k], row[POSITION_Z + k]
            across, upward, outward = row[PLANE_X + k], row[PLANE_Y + k], row[PLANE_Z + k]
            back, lift = row[OFFSET + k] - (across * x + upward * y + outward * z), row[LIFT + k]
            plane = (row[NORMAL_X + k], row[NORMAL_Y + k], row[NORMAL_Z + k])
            x += back * across + lift * plane[0] - header[MAPS + ORIGIN]
            y += back * upward + lift * plane[1] - header[MAPS + ORIGIN + 1]
            z += back * outward + lift * plane[2] - header[MAPS + ORIGIN + 2]
            face = cube_face(x, y, z) if is_cube else 0
            place = np.uint64(MAPS + N_MAP_NUMBER * face)
            first = np.uint64(HEADER + face * size * size)
            reach = abs(x) + abs(y) + abs(z) + abs(header[MAPS]) + abs(header[MAPS + 1]) + abs(header[MAPS + 2])
            row[STRENGTH + k] *= lit_part(header, texels, place, first, (x, y, z), plane, reach, size, taps, is_perspective)


@register_jitable
def cube_face(x, y, z):
    """The face of a cube round the light that a direction passes: +x, -x, +y, -y, +z, -z."""
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax >= ay and ax >= az:
        return 0 if x > 0 else 1
    if ay >= az:
        return 2 if y > 0 else 3
    return 4 if z > 0 else 5


@register_jitable
def lit_part(header, texels, place, first, point, plane, reach, size, taps, is_perspective):
    """The part of the texels about a point whose surface doesn't lie before its tangent plane."""
    x, y, z = point
    number = header.dtype.type
    zero, one, half = number(0), number(1), number(0.5)
    across = along(header, place + np.uint64(RIGHT), x, y, z)
    upward = along(header, place + np.uint64(UP), x, y, z)
    depth = along(header, place + np.uint64(FORWARD), x, y, z)
    if is_perspective and depth <= zero:
        return one
    plane_across = along(header, place + np.uint64(RIGHT), plane[0], plane[1], plane[2])
    plane_upward = along(header, place + np.uint64(UP), plane[0], plane[1], plane[2])
    plane_depth = along(header, place + np.uint64(FORWARD), plane[0], plane[1], plane[2])
    scale_x, scale_y = header[place + np.uint64(SCALE_X)], header[place + np.uint64(SCALE_Y)]
    value, magnification = -depth, one
    if is_perspective:
        # n·X = c with X = w (F + a R + b U): 1/w is the plane (n·F + a n·R + b n·U)/c.
        magnification = one / depth
        value = magnification
        constant = plane_across * across + plane_upward * upward + plane_depth * depth
        if constant >= zero:  # lifted beyond the light: its plane hides nothing from the point
            return one
        slope_x, slope_y = plane_across / (constant * scale_x), -plane_upward / (constant * scale_y)
    else:
        slope_x, slope_y = plane_across / (plane_depth * scale_x), -plane_upward / (plane_depth * scale_y)
    at_x = header[place + np.uint64(CENTER_X)] + scale_x * across * magnification
    at_y = header[place + np.uint64(CENTER_Y)] - scale_y * upward * magnification
    rounding = header[place + np.uint64(ROUNDING)] + number(POSITION_ROUNDING) * reach * magnification * magnification
    slack = half * (abs(slope_x) + abs(slope_y)) + rounding
    i, j = np.int64(np.floor(at_x)), np.int64(np.floor(at_y))
    radius, n_lit = taps >> 1, zero
    for v in range(j - radius, j + radius + 1):
        for u in range(i - radius, i + radius + 1):
            column, line = min(max(u, 0), size - 1), min(max(v, 0), size - 1)
            to_x, to_y = number(column) + half - at_x, number(line) + half - at_y
            limit = value + slope_x * to_x + slope_y * to_y + slack
            # Also where the limit is no number, because the slopes are infinite.
            n_lit += zero if texels[first + np.uint64(line * size + column)] > limit else one
    return n_lit / number(taps * taps)


@register_jitable
def along(header, axis, x, y, z):
    """Component of a vector along one of the map's axes."""
    return x * header[axis] + y * header[axis + np.uint64(1)] + z * header[axis + np.uint64(2)]


@kernel
def write_map(canvas, y_start, n_row, offset, scale, out_texels):
    """Turn a band's depths into texels: 1/w, or minus the depth, which are offset + scale·z; clean the band."""
    words = borrow(canvas.words)
    far = out_texels.dtype.type(-np.inf)  # where nothing is, nothing is held off
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(GROUP_SHIFT)
        left, right = canvas.left[group], canvas.right[group]
        row = out_texels[np.uint64(y_start + j)]
        for i in range(np.uint64(len(row))):
            row[i] = far
        if left < right:
            start = np.uint64(j * canvas.pitch)
            for i in range(np.uint64(left), np.uint64(min(right, len(row)))):
                word = words[start + i]
                row[i] = offset + scale * float(word >> PAYLOAD_BITS) if word < CLEAR else far
    clean(canvas, n_row)
