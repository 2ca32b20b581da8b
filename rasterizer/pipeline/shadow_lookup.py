"""Shadows: which part of a light arrives, by comparing depths with a map of what the light sees (Williams 1978).

A shadow map is a picture of the scene from the light, drawn by this rasterizer: a texel holds 1/w of the nearest
surface, or minus its depth where the rays are parallel; so larger is nearer, and both are planes over the map where the
surface is one.

`occlude` is called as a light function is (light_kinds.py), after the light's own: it reads POSITION, NORMAL,
FACE_NORMAL, FACE_OFFSET and NORMAL_OFFSET of the batch, and multiplies STRENGTH by the lit part. In place of
coefficients it gets a header followed by the maps' texels. A picture with shadows is computed in float64: next to a
shadow's edge no error is small.

A texel shows the depth at its centre alone. So a surface's own depth is taken there, too: the value at the point plus
the slopes of its tangent plane, which the normal gives, times the way to the centre. On one plane both agree, but for

    half a texel times the slopes   neighbouring polygons that fold towards the light reach into the texel by that much;
                                    it also covers the rounding of the map's vertices, a 512th of a texel
    2^-32 of the map's range        rounding of its values: planes of depth err by a 2^-33rd of it (setup.py)
    2^-40 of the distances          rounding of positions: float64, a few operations from the corners to the point

which is all that a point may lie behind the map and still be lit. The picture's own vertices are rounded to 1/256 px,
which tilts its polygons a little: so a point is first moved onto the plane that its polygon has in the scene. A polygon
that stands for a piece of a curved surface may lie below it: the point is then moved along its normal by NORMAL_OFFSET,
how far the polygon's corners lie from their neighbours' tangent planes (geometry/surfaces.py), 0 on flat surfaces. So
nothing of a convex surface lies before the tangent plane of an offset point; before the plane of its polygon neighbours
may lie, where the polygon is turned away from the light and its normals are not yet. Where a point is moved beyond the
light, it is lit.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import as_array, helper, index, kernel
from ..geometry.vectors import add, dot, scale, subtract
from . import fragments as f
from .fragments import get_vector, read_vector, set_vector
from .interpolate import row_extent
from .visibility import CLEAR, PAYLOAD_BITS, clear

# The header: how many maps (1, or 6: one for each face of a cube), texels a side, texels a side of the filter, whether
# rays diverge; then a block of N_MAP_COLUMN numbers for each map.
N_MAP, SIZE, FILTER, IS_PERSPECTIVE, MAPS = 0, 1, 2, 3, 4
# A map's block: the light's position relative to the eye; its axes, unit length; scale and centre, texels; how far its
# values are rounded.
ORIGIN, RIGHT, UP, FORWARD, SCALE_X, SCALE_Y, CENTER_X, CENTER_Y, ROUNDING = 0, 3, 6, 9, 12, 13, 14, 15, 16
N_MAP_COLUMN = 17
HEADER = MAPS + 6 * N_MAP_COLUMN
POSITION_ROUNDING = 2.0**-40
# Quantities of the batch: the point as seen from the light, which becomes its position on the map, texels, and the
# limit of the texels there; and the slopes of the limit.
MAP_X, MAP_Y, LIMIT = f.FROM_LIGHT, f.FROM_LIGHT + f.NEXT, f.FROM_LIGHT + f.NEXT + f.NEXT
SLOPE_X, SLOPE_Y = f.LIMIT_SLOPES, f.LIMIT_SLOPES + f.NEXT


class MapView(NamedTuple):
    """How one map sees the scene."""

    axes: tuple  # right, up and forward, three unit vectors
    scales: tuple  # texels along x and y for a unit of length, in perspective at depth 1
    center: tuple  # texels: where the axis FORWARD meets the map
    rounding: float  # of the map's values
    far: float  # sum of the components of the light's position, scene units: what positions lose digits by
    is_perspective: bool


def occlude(batch, n, shadow_map):
    """Multiply STRENGTH by the part of the light that isn't occluded."""
    batch, header = as_array(batch, f.BATCH_SHAPE), as_array(shadow_map, (HEADER,))
    size, n_map = np.int64(header[SIZE]), np.int64(header[N_MAP])
    texels = as_array(shadow_map, (HEADER + n_map * size * size,))
    n = index(n)
    move_points(batch, header, n)
    start = index(0)
    while start < n:
        # Neighbouring points look at the same map, as far as there are several.
        end, face = n, 0
        if n_map > 1:
            face, end = cube_face(batch, start), start + index(1)
            while end < n and cube_face(batch, end) == face:
                end += index(1)
        compute_limits(batch, read_view(header, face), header[SIZE], start, end)
        compare(batch, header, texels, index(HEADER + face * size * size), start, end)
        start = end


@helper
def move_points(batch, header, n):
    """Move points onto the planes of their polygons, then by their normal offsets; count from the light."""
    origin = read_vector(header, MAPS + ORIGIN)
    for k in range(n):
        position, plane = get_vector(batch, f.POSITION, k), get_vector(batch, f.FACE_NORMAL, k)
        back = batch[f.FACE_OFFSET + k] - dot(plane, position)
        offset = scale(get_vector(batch, f.NORMAL, k), batch[f.NORMAL_OFFSET + k])
        moved = add(add(position, scale(plane, back)), offset)
        set_vector(batch, f.FROM_LIGHT, k, subtract(moved, origin))


@helper
def cube_face(batch, k):
    """Return the face of a cube round the light behind which a point lies: +x, -x, +y, -y, +z, -z."""
    x, y, z = get_vector(batch, f.FROM_LIGHT, k)
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax >= ay and ax >= az:
        return 0 if x > 0 else 1
    if ay >= az:
        return 2 if y > 0 else 3
    return 4 if z > 0 else 5


@helper
def read_view(header, face):
    """Read how a map sees the scene."""
    first = MAPS + N_MAP_COLUMN * face
    axes = (
        read_vector(header, first + RIGHT),
        read_vector(header, first + UP),
        read_vector(header, first + FORWARD),
    )
    x, y, z = read_vector(header, MAPS + ORIGIN)
    return MapView(
        axes, (header[first + SCALE_X], header[first + SCALE_Y]), (header[first + CENTER_X], header[first + CENTER_Y]),
        header[first + ROUNDING], abs(x) + abs(y) + abs(z), header[IS_PERSPECTIVE] != header.dtype.type(0),
    )  # fmt: skip


@helper
def compute_limits(batch, view, size, start, end):
    """Compute where points lie on one map, and the largest value that a texel may have there: a plane over the map.

    These take the place of the points as seen from the light. The plane is LIMIT + column·SLOPE_X + line·SLOPE_Y at a
    texel's centre. `size` is that of the map, texels a side.
    """
    real, (right, up, forward) = batch.dtype.type, view.axes
    zero, one, half = real(0), real(1), real(0.5)
    growing, infinite = real(POSITION_ROUNDING), real(np.inf)
    for k in range(start, end):
        position, normal = get_vector(batch, f.FROM_LIGHT, k), get_vector(batch, f.NORMAL, k)
        x, y, depth = dot(position, right), dot(position, up), dot(position, forward)
        # n·X = c with X = w (F + a R + b U): 1/w is the plane (n·F + a n·R + b n·U)/c. Parallel rays: X = a R + b U + w
        # F.
        constant = dot(normal, position) if view.is_perspective else dot(normal, forward)
        magnification = one / depth if view.is_perspective else one
        value = magnification if view.is_perspective else -depth
        slope_x = dot(normal, right) / (constant * view.scales[0])
        slope_y = -dot(normal, up) / (constant * view.scales[1])
        map_x = view.center[0] + view.scales[0] * x * magnification
        map_y = view.center[1] - view.scales[1] * y * magnification
        reach = abs(position[0]) + abs(position[1]) + abs(position[2]) + view.far
        rounding = view.rounding + growing * reach * magnification * magnification
        slack = half * (abs(slope_x) + abs(slope_y)) + rounding
        limit = value + slack + slope_x * (half - map_x) + slope_y * (half - map_y)
        # Lit is what lies behind the light, or is moved beyond it: its own plane hides nothing from such a point.
        is_free = view.is_perspective & ((depth <= zero) | (constant >= zero))
        batch[LIMIT + k] = infinite if is_free else limit
        batch[SLOPE_X + k], batch[SLOPE_Y + k] = zero if is_free else slope_x, zero if is_free else slope_y
        # A position outside the map may be any number, or none; one texel beyond the border says as much.
        batch[MAP_X + k] = min(max(map_x, -one), size) if abs(map_x) < infinite else -one
        batch[MAP_Y + k] = min(max(map_y, -one), size) if abs(map_y) < infinite else -one


@helper
def compare(batch, header, texels, first, start, end):
    """Multiply STRENGTH by the part of the texels about each point whose surface doesn't lie before the point's plane.

    `first` is the map's first texel.
    """
    size, taps = np.int64(header[SIZE]), np.int64(header[FILTER])
    last, radius = size - 1, taps >> 1
    zero, one = header.dtype.type(0), header.dtype.type(1)
    if taps == 1:
        for k in range(start, end):
            column = min(max(np.int64(np.floor(batch[MAP_X + k])), 0), last)
            line = min(max(np.int64(np.floor(batch[MAP_Y + k])), 0), last)
            limit = batch[LIMIT + k] + batch[SLOPE_X + k] * column + batch[SLOPE_Y + k] * line
            # Lit also where the limit is no number, because the slopes are infinite: the plane is seen edge-on.
            is_occluded = texels[first + index(line * size + column)] > limit
            batch[f.STRENGTH + k] = zero if is_occluded else batch[f.STRENGTH + k]
        return
    share = one / header.dtype.type(taps * taps)
    for k in range(start, end):
        i, j, n_lit = np.int64(np.floor(batch[MAP_X + k])), np.int64(np.floor(batch[MAP_Y + k])), zero
        for v in range(j - radius, j + radius + 1):
            line = min(max(v, 0), last)
            limit = batch[LIMIT + k] + batch[SLOPE_Y + k] * line
            for u in range(i - radius, i + radius + 1):
                column = min(max(u, 0), last)
                is_occluded = texels[first + index(line * size + column)] > limit + batch[SLOPE_X + k] * column
                n_lit += zero if is_occluded else one
        batch[f.STRENGTH + k] = batch[f.STRENGTH + k] * (n_lit * share) if n_lit > zero else zero


@kernel
def write_map(visibility, y_start, n_row, offset, slope, out_texels):
    """Turn the depths of n_row rows from y_start on into texels of a map; clean the band.

    Parameters
    ----------
    visibility : of the band
    offset, slope : the texels are offset + slope·z, 1/w or minus the depth
    out_texels : (size, size) float64, row y_start.. of it; -inf where nothing is
    """
    entries, nothing = visibility.entries, out_texels.dtype.type(-np.inf)
    for j in range(n_row):
        left, right = row_extent(visibility, j)
        row = out_texels[index(y_start + j)]
        for i in range(index(len(row))):
            row[i] = nothing
        if left < right:
            start = index(j * visibility.pitch)
            for i in range(index(left), index(min(right, len(row)))):
                entry = entries[start + i]
                row[i] = offset + slope * float(entry >> PAYLOAD_BITS) if entry < CLEAR else nothing
    clear(visibility, n_row)
