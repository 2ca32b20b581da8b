"""Shadows: which part of a light arrives, by comparing depths with a map of what the light sees (Williams 1978).

A shadow map is a picture of the scene from the light, drawn by this rasterizer: a texel holds 1/w of the nearest
surface, or minus its depth where the rays are parallel; so larger is nearer, and both are planes over the map where the
surface is one.

`cast` is a row function like those of lights (light_kinds.py): it reads the rows of positions, normals and of the
surface's shape, and multiplies STRENGTH by the lit part. Its numbers are a header followed by the maps themselves. A
picture with shadows is computed in float64: next to a shadow's edge no error is small.

A texel shows the depth at its centre alone. So a surface's own depth is taken there, too: the value at the point plus
the slopes of its tangent plane, which the normal gives, times the way to the centre. On one plane both agree, but for

    half a texel times the slopes     neighbouring polygons that fold towards the light reach into the texel by that much;
                                      it also covers the rounding of the map's vertices, a 512th of a texel
    2^-32 of the map's range          rounding of its values: planes of depth err by a 2^-33rd of it (setup.py)
    2^-40 of the distances            rounding of positions: float64, a few operations from the corners to the point

which is all that a point may lie behind the map and still be lit. The picture's own vertices are rounded to 1/256 px,
which tilts its polygons a little: so a point is first moved onto the plane that its polygon has in the scene. A polygon
that stands for a piece of a curved surface may lie below it: the point is then lifted along its normal by LIFT, how far
the polygon's corners lie from their neighbours' tangent planes (geometry/surfaces.py); flat surfaces have no lift. So
nothing of a convex surface lies before the tangent plane of a lifted point; before the plane of its polygon neighbours
may lie, where the polygon is turned away from the light and its normals are not yet. Where a point is lifted beyond the
light, it is lit.
"""

import numpy as np
from numba import carray
from numba.extending import register_jitable

from ..compiler.kernels import borrow, kernel
from .fragments import (
    CHUNK,
    LIFT,
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
    SEEN_X,
    SEEN_Y,
    SEEN_Z,
    SLOPE_X,
    SLOPE_Y,
    STRENGTH,
)
from .visibility import CLEAR, PAYLOAD_BITS, STRIP_SHIFT, clear

# The header: how many maps (1, or 6: one for each face of a cube), texels a side, texels a side of the filter, whether
# rays diverge; then for each map: the light's place relative to the eye, its axes (right, up, forward), scale and
# centre, texels; rounding of its values.
N_MAP, SIZE, FILTER, IS_PERSPECTIVE, MAPS = 0, 1, 2, 3, 4
N_MAP_NUMBER = 17
ORIGIN, RIGHT, UP, FORWARD, SCALE_X, SCALE_Y, CENTER_X, CENTER_Y, ROUNDING = 0, 3, 6, 9, 12, 13, 14, 15, 16
AT_X, AT_Y, LIMIT = SEEN_X, SEEN_Y, SEEN_Z  # where a point lies on the map, texels; its limit, see find_limits
HEADER = MAPS + 6 * N_MAP_NUMBER
POSITION_ROUNDING = 2.0**-40


def cast(rows, n, numbers):
    """Multiply STRENGTH by the part of the light that isn't held off."""
    row, header = carray(rows, (N_ROW * CHUNK,)), carray(numbers, (HEADER,))
    size, n_map = np.int64(header[SIZE]), np.int64(header[N_MAP])
    texels = carray(numbers, (HEADER + n_map * size * size,))
    n = np.uint64(n)
    place_points(row, header, n)
    start = np.uint64(0)
    while start < n:
        # Neighbouring points look at the same map, as far as there are several.
        stop, face = n, 0
        if n_map > 1:
            face, stop = cube_face(row, start), start + np.uint64(1)
            while stop < n and cube_face(row, stop) == face:
                stop += np.uint64(1)
        find_limits(row, header, MAPS + N_MAP_NUMBER * face, start, stop)
        compare(row, header, texels, np.uint64(HEADER + face * size * size), start, stop)
        start = stop


@register_jitable
def place_points(row, header, n):
    """Move points onto the planes of their polygons, lift them, and count from the light."""
    origin_x, origin_y, origin_z = header[MAPS + ORIGIN], header[MAPS + ORIGIN + 1], header[MAPS + ORIGIN + 2]
    for k in range(n):
        x, y, z = row[POSITION_X + k], row[POSITION_Y + k], row[POSITION_Z + k]
        plane_x, plane_y, plane_z = row[PLANE_X + k], row[PLANE_Y + k], row[PLANE_Z + k]
        back, lift = row[OFFSET + k] - (plane_x * x + plane_y * y + plane_z * z), row[LIFT + k]
        row[SEEN_X + k] = x + back * plane_x + lift * row[NORMAL_X + k] - origin_x
        row[SEEN_Y + k] = y + back * plane_y + lift * row[NORMAL_Y + k] - origin_y
        row[SEEN_Z + k] = z + back * plane_z + lift * row[NORMAL_Z + k] - origin_z


@register_jitable
def cube_face(row, k):
    """The face of a cube round the light behind which a point lies: +x, -x, +y, -y, +z, -z."""
    x, y, z = row[SEEN_X + k], row[SEEN_Y + k], row[SEEN_Z + k]
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax >= ay and ax >= az:
        return 0 if x > 0 else 1
    if ay >= az:
        return 2 if y > 0 else 3
    return 4 if z > 0 else 5


@register_jitable
def find_limits(row, header, place, start, stop):
    """Find where points lie on one map, and the largest value that a texel may have there: a plane over the map.

    The rows of the points' places are written over. The plane is limit + column·slope_x + line·slope_y at a texel's
    centre.
    """
    right_x, right_y, right_z = header[place + RIGHT], header[place + RIGHT + 1], header[place + RIGHT + 2]
    up_x, up_y, up_z = header[place + UP], header[place + UP + 1], header[place + UP + 2]
    forward_x, forward_y, forward_z = header[place + FORWARD], header[place + FORWARD + 1], header[place + FORWARD + 2]
    scale_x, scale_y, center_x, center_y = (
        header[place + SCALE_X], header[place + SCALE_Y], header[place + CENTER_X], header[place + CENTER_Y],
    )  # fmt: skip
    far = abs(header[MAPS + ORIGIN]) + abs(header[MAPS + ORIGIN + 1]) + abs(header[MAPS + ORIGIN + 2])
    zero, one, half = header.dtype.type(0), header.dtype.type(1), header.dtype.type(0.5)
    fixed, growing = header[place + ROUNDING], header.dtype.type(POSITION_ROUNDING)
    is_perspective, infinite = header[IS_PERSPECTIVE] != zero, header.dtype.type(np.inf)
    for k in range(start, stop):
        x, y, z = row[SEEN_X + k], row[SEEN_Y + k], row[SEEN_Z + k]
        n_x, n_y, n_z = row[NORMAL_X + k], row[NORMAL_Y + k], row[NORMAL_Z + k]
        across, upward = x * right_x + y * right_y + z * right_z, x * up_x + y * up_y + z * up_z
        depth = x * forward_x + y * forward_y + z * forward_z
        n_across, n_upward = n_x * right_x + n_y * right_y + n_z * right_z, n_x * up_x + n_y * up_y + n_z * up_z
        # n·X = c with X = w (F + a R + b U): 1/w is the plane (n·F + a n·R + b n·U)/c. Parallel rays: X = a R + b U + w
        # F.
        constant = (
            n_x * x + n_y * y + n_z * z if is_perspective else n_x * forward_x + n_y * forward_y + n_z * forward_z
        )
        magnification = one / depth if is_perspective else one
        value = magnification if is_perspective else -depth
        slope_x, slope_y = n_across / (constant * scale_x), -n_upward / (constant * scale_y)
        at_x = center_x + scale_x * across * magnification
        at_y = center_y - scale_y * upward * magnification
        rounding = fixed + growing * (abs(x) + abs(y) + abs(z) + far) * magnification * magnification
        slack = half * (abs(slope_x) + abs(slope_y)) + rounding
        limit = value + slack + slope_x * (half - at_x) + slope_y * (half - at_y)
        # Lit is what lies behind the light, or is lifted beyond it: its own plane hides nothing from such a point.
        is_free = is_perspective & ((depth <= zero) | (constant >= zero))
        row[LIMIT + k] = infinite if is_free else limit
        row[SLOPE_X + k], row[SLOPE_Y + k] = zero if is_free else slope_x, zero if is_free else slope_y
        # A place outside the map may be any number, or none; one texel beyond the border says as much.
        row[AT_X + k] = min(max(at_x, -one), header[SIZE]) if abs(at_x) < infinite else -one
        row[AT_Y + k] = min(max(at_y, -one), header[SIZE]) if abs(at_y) < infinite else -one


@register_jitable
def compare(row, header, texels, first, start, stop):
    """Multiply STRENGTH by the part of the texels about each point whose surface doesn't lie before the point's
    plane."""
    size, taps = np.int64(header[SIZE]), np.int64(header[FILTER])
    last, radius = size - 1, taps >> 1
    zero, one = header.dtype.type(0), header.dtype.type(1)
    if taps == 1:
        for k in range(start, stop):
            column = min(max(np.int64(np.floor(row[AT_X + k])), 0), last)
            line = min(max(np.int64(np.floor(row[AT_Y + k])), 0), last)
            limit = row[LIMIT + k] + row[SLOPE_X + k] * column + row[SLOPE_Y + k] * line
            # Lit also where the limit is no number, because the slopes are infinite: the plane is seen edge-on.
            is_held = texels[first + np.uint64(line * size + column)] > limit
            row[STRENGTH + k] = zero if is_held else row[STRENGTH + k]
        return
    share = one / header.dtype.type(taps * taps)
    for k in range(start, stop):
        i, j, n_lit = np.int64(np.floor(row[AT_X + k])), np.int64(np.floor(row[AT_Y + k])), zero
        for v in range(j - radius, j + radius + 1):
            line = min(max(v, 0), last)
            edge = row[LIMIT + k] + row[SLOPE_Y + k] * line
            for u in range(i - radius, i + radius + 1):
                column = min(max(u, 0), last)
                is_held = texels[first + np.uint64(line * size + column)] > edge + row[SLOPE_X + k] * column
                n_lit += zero if is_held else one
        row[STRENGTH + k] = row[STRENGTH + k] * (n_lit * share) if n_lit > zero else zero


@kernel
def write_map(canvas, y_start, n_row, offset, scale, out_texels):
    """Turn a band's depths into texels: 1/w, or minus the depth, which are offset + scale·z; clean the band."""
    words = borrow(canvas.entries)
    far = out_texels.dtype.type(-np.inf)  # where nothing is, nothing is held off
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(STRIP_SHIFT)
        left, right = canvas.left[group], canvas.right[group]
        row = out_texels[np.uint64(y_start + j)]
        for i in range(np.uint64(len(row))):
            row[i] = far
        if left < right:
            start = np.uint64(j * canvas.pitch)
            for i in range(np.uint64(left), np.uint64(min(right, len(row)))):
                word = words[start + i]
                row[i] = offset + scale * float(word >> PAYLOAD_BITS) if word < CLEAR else far
    clear(canvas, n_row)
