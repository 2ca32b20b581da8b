"""Shadows: which part of a light arrives, by comparing depths with a map of what the light sees (Williams 1978).

A shadow map is a picture of the scene from the light, drawn by this rasterizer: a texel holds 1/w of the nearest
surface, or minus its depth where the rays are parallel; so larger is nearer, and both are planes over the map where the
surface is one.

`occlude` is called as a light function is (lights.py), after the light's own: it reads POSITION, NORMAL,
FACE_NORMAL, FACE_OFFSET and FACE_SIDE of the batch, and multiplies STRENGTH by the lit part. In place of
coefficients it gets a header followed by the maps' texels, in the type of the batch.

A texel shows the depth at its centre alone. So a surface's own depth is taken there, too: the value at the point plus
the slopes of its polygon's plane times the way to the centre. On one plane both agree, but for

    half a texel times the slopes   neighbouring polygons that fold towards the light reach into the texel by that much;
                                    it also covers the rounding of the map's vertices, a 512th of a texel
    S + 40 units of the z-buffer    rounding of its values, S texels a side: a step of a plane of depth is rounded to
                                    whole units, so half of one for each texel that a polygon reaches over, along both
                                    axes, beside DEPTH_PLANE_ROUNDING (setup.py). Of the map's range of 2^38 units that
                                    is a 2^-28th at 1024 texels; a polygon that is no larger than 16 errs by a 2^-32nd
    the rounding of positions       in float32 ROUNDINGS·u of the distances, in float64 2^-40 of them; see below

which is all that a point may lie behind the map and still be lit. The picture's own vertices are rounded to 1/256 px,
which tilts its polygons a little: so a point is first moved onto the plane that its polygon has in the scene.

A polygon may be turned away from a light that its normals still look at, where it stands for a piece of a curved
surface. Its own body lies before it then. Such a point is compared with its tangent plane instead, and is moved along
its normal first: by FACE_SIDE, the polygon's longest side, times the sine of the angle between the normal and the
polygon's. No corner of the polygon lies higher above the tangent plane: from the point to a corner is no further than
the longest side, in the polygon's plane. Where a point is moved beyond the light, it is lit.

A polygon that faces the light may have neighbours that fold towards the light. Texels of the filter that show them lie
before its plane. So its points are moved likewise, but no further than texels of the filter reach: twice that, because
the normal between two polygons has half of the angle between them.

The rounding of positions. X is the moved point as seen from the light, O the light as seen from the eye, and h the
most that the point may be moved along its normal; so it is moved by no more than √3·h, and lay no further than
L + √3·h from the eye, L = |X| + |O|, lengths as sums of components. u is the unit roundoff, n the plane's unit normal,
c = n·X (n·F for parallel rays, F the map's axis), m = 1/w (1 for parallel rays). A point that lies e before its plane
has a limit that is off by m e/|c|. Counted in u L, that is in m u L/|c|, and in u h:

    L   h
    5   5·√3    the distance from the plane: n·P 4 (n, products, two sums), the plane's offset 1
    3   2·√3    onto the plane: the product 1, as that way is far shorter than P, and the sum; the sum with the offset 1
    1           subtracting O: O and the difference, which are L together
    1   18      the offset: the sine 9.5 (n·N 4, n and the product 2; the difference and the length 3.5 of itself, 1 at
                most), h as a share of the distance 6.3 (its share 1, product 1, length 2.5, and √3 for the difference),
                where O, too, is rounded; two products 2
    8           the point's own 1/w or depth and its position on the map: products with an axis err by 4 each (axis,
                products, two sums), an error d of the point. What that changes in the limit is m n·d/c: 4·√3; and 1 as
                m is a quotient
    4           the limit, a sum of four terms (3), and the texel's own rounding: of m, and m <= m |X|/|c|

That is 22 L + 31 h. ROUNDINGS = 35 of L + h are allowed, what float32 positions may be off as well (Precision in
engine/shadow_maps.py). What an error e of the normal changes in the slopes is e/(|c| scale) and
e/|c| of the slope itself, times |X| (1 for parallel rays); times the way to the furthest texel of the filter. SLACK has
the roundings of the slopes, and of the position times the scale.
Errors of a position along its own plane move what the point is compared with: an edge appears that much elsewhere.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import as_array, by_type, helper, kernel
from ..geometry.vectors import add, dot, length, scale, subtract
from . import fragments as f
from .fragments import get_vector, read_vector, set_vector
from .interpolate import row_extent
from .visibility import CLEAR, PAYLOAD_BITS, clear

# The header: how many maps (1; or 6, one for each face of a cube; of parallel rays any number up to that, each of which
# shows more than those before it, the last one all), texels a side, texels a side of the filter, whether rays diverge;
# the light's position relative to the eye; how far positions are rounded, as a share of the distances; how far the
# normal's error turns the slopes, in texels. Then a block of N_MAP_COLUMN numbers for each map.
N_MAP, SIZE, FILTER, IS_PERSPECTIVE, ORIGIN = 0, 1, 2, 3, 4
POSITION_ROUNDING, NORMAL_ERROR, MAPS = 7, 8, 9
# A map's block: its axes, unit length; scale and centre, texels; how far its values are rounded; how many texels the
# limit is raised by, times the slopes; twice how far texels of the filter reach on a surface that faces the light,
# scene units, in perspective 1 away; which of the blocks of texels is its own, or -1 where nothing is to be seen: then
# the others aren't written.
RIGHT, UP, FORWARD, SCALE_X, SCALE_Y, CENTER_X, CENTER_Y, ROUNDING, SLACK, LAYER = 0, 3, 6, 9, 10, 11, 12, 13, 14, 15
FILTER_RANGE = 16
N_MAP_COLUMN = 17
HEADER = MAPS + 6 * N_MAP_COLUMN
ROUNDINGS = 35
# Quantities of the batch. FROM_LIGHT, the point as seen from the light, becomes: the number of the texel that it lies
# in, the limit there, and the texel. Beside the slopes of the limit: the number of the map.
TEXEL_IDX, LIMIT, TEXEL = f.FROM_LIGHT, f.FROM_LIGHT + f.NEXT, f.FROM_LIGHT + f.NEXT + f.NEXT
N_BEFORE = TEXEL  # where there is a filter: how many of its texels lie before the limit
SLOPE_X, SLOPE_Y = f.LIMIT_SLOPES, f.LIMIT_SLOPES + f.NEXT
MAX_MOVED = SLOPE_X  # before: how far a point may have been moved along its normal
MAP_NUMBER = f.SHADOW_COUNT


class MapView(NamedTuple):
    """How one map sees the scene."""

    axes: tuple  # right, up and forward, three unit vectors
    scales: tuple  # texels along x and y for a unit of length, in perspective at depth 1
    center: tuple  # texels: where the axis FORWARD meets the map
    rounding: float  # of the map's values
    slack: float  # texels: what the limit is raised by, times the slopes
    position_rounding: float  # share of the distances
    normal_error: float  # texels
    origin: tuple  # the light's position relative to the eye, scene units
    far: float  # sum of the components of that: what positions lose digits by
    is_perspective: bool


def occlude(batch, n, shadow_map):
    """Multiply STRENGTH by the part of the light that isn't occluded."""
    batch, header = as_array(batch, f.BATCH_SHAPE), as_array(shadow_map, (HEADER,))
    size, n_map = np.int64(header[SIZE]), np.int64(header[N_MAP])
    texels = as_array(shadow_map, (HEADER + n_map * size * size,))
    move_points(batch, header, 0, 0, n)
    if n_map == 1:
        look_up(batch, header, texels, 0, 0, n)
        return
    is_perspective = header[IS_PERSPECTIVE] != header.dtype.type(0)
    if is_perspective:
        compute_cube_faces(batch, n)
    else:
        choose_maps(batch, header, n_map, n)
    start = 0
    while start < n:  # neighbouring points look at the same map
        number, end = batch[MAP_NUMBER + start], start + 1
        while end < n and batch[MAP_NUMBER + end] == number:
            end += 1
        if not is_perspective:
            move_points(batch, header, np.int64(number), start, end)
        look_up(batch, header, texels, np.int64(number), start, end)
        start = end


@helper
def move_points(batch, header, number, start, end):
    """Move the points start..end onto the planes of their polygons and along their normals, for map `number`; count
    from the light.

    Fills MAX_MOVED, too.
    """
    origin, forward = read_vector(header, ORIGIN), read_vector(header, MAPS + FORWARD)
    is_perspective = header[IS_PERSPECTIVE] != header.dtype.type(0)
    filter_range = header[MAPS + N_MAP_COLUMN * number + FILTER_RANGE]
    zero, one = batch.dtype.type(0), batch.dtype.type(1)
    for k in range(start, end):
        position, plane = get_vector(batch, f.POSITION, k), get_vector(batch, f.FACE_NORMAL, k)
        normal, plane_offset = get_vector(batch, f.NORMAL, k), batch[f.FACE_OFFSET + k]
        back = plane_offset - dot(plane, position)
        tilt = length(subtract(normal, scale(plane, dot(plane, normal))))
        is_front = facing(plane, plane_offset, normal, origin, forward, is_perspective) < zero
        away = length(subtract(position, origin)) if is_perspective else one
        side = batch[f.FACE_SIDE + k]  # read here: where a branch reads it, there are no vector instructions
        near = min(side, filter_range * away) if is_front else side
        batch[MAX_MOVED + k] = near
        offset = scale(normal, tilt * near)
        moved = add(add(position, scale(plane, back)), offset)
        set_vector(batch, f.FROM_LIGHT, k, subtract(moved, origin))


@helper
def facing(plane, plane_offset, normal, origin, forward, is_perspective):
    """Return a number that is negative where a polygon faces a light: where that stands on the side of the polygon's
    plane that the normal looks to. `forward` is where parallel rays go to."""
    beyond = plane_offset - dot(plane, origin) if is_perspective else dot(plane, forward)
    return beyond * dot(plane, normal)


@helper
def compute_cube_faces(batch, n):
    """Fill the face of a cube round the light behind which a point lies: +x, -x, +y, -y, +z, -z."""
    real = batch.dtype.type
    zero, one, two, four = real(0), real(1), real(2), real(4)
    for k in range(n):
        x, y, z = get_vector(batch, f.FROM_LIGHT, k)
        ax, ay, az = abs(x), abs(y), abs(z)
        of_yz = two if ay >= az else four
        along_yz = y if ay >= az else z
        is_x = (ax >= ay) & (ax >= az)
        along, axis = x if is_x else along_yz, zero if is_x else of_yz
        batch[MAP_NUMBER + k] = axis + (zero if along > zero else one)


@helper
def choose_maps(batch, header, n_map, n):
    """Fill the number of the first map that shows a point and the filter's texels round it; the last one shows all."""
    real, radius, size = batch.dtype.type, np.int64(header[FILTER]) >> 1, np.int64(header[SIZE])
    low, high = real(radius), real(size - radius)
    for number in range(n_map - 1, -1, -1):
        move_points(batch, header, number, 0, n)
        view, is_last = read_view(header, number), number == n_map - 1
        (right, up, _), (scale_x, scale_y), (center_x, center_y) = view.axes, view.scales, view.center
        for k in range(n):
            position = get_vector(batch, f.FROM_LIGHT, k)
            x, y = center_x + scale_x * dot(position, right), center_y - scale_y * dot(position, up)
            is_shown = is_last | ((x >= low) & (x < high) & (y >= low) & (y < high))
            batch[MAP_NUMBER + k] = real(number) if is_shown else batch[MAP_NUMBER + k]


@helper
def read_view(header, number):
    """Read how a map sees the scene."""
    first = MAPS + N_MAP_COLUMN * number
    axes = (
        read_vector(header, first + RIGHT),
        read_vector(header, first + UP),
        read_vector(header, first + FORWARD),
    )
    x, y, z = read_vector(header, ORIGIN)
    return MapView(
        axes, (header[first + SCALE_X], header[first + SCALE_Y]), (header[first + CENTER_X], header[first + CENTER_Y]),
        header[first + ROUNDING], header[first + SLACK], header[POSITION_ROUNDING], header[NORMAL_ERROR],
        (x, y, z), abs(x) + abs(y) + abs(z), header[IS_PERSPECTIVE] != header.dtype.type(0),
    )  # fmt: skip


@helper
def look_up(batch, header, texels, number, start, end):
    """Multiply STRENGTH of the points start..end by the part of the texels about each in map `number` whose surface
    doesn't lie before the point's plane."""
    size, n_tap = np.int64(header[SIZE]), np.int64(header[FILTER])
    layer = np.int64(header[MAPS + N_MAP_COLUMN * number + LAYER])
    if layer < 0:
        return  # nothing is to be seen there, so nothing is in the way
    compute_limits(batch, read_view(header, number), size, n_tap >> 1, start, end)
    first = HEADER + layer * size * size
    if n_tap == 1:
        gather_texels(batch, texels, first, start, end)
        compare(batch, start, end)
    else:
        count_lit(batch, texels, first, (size, n_tap), start, end)


@helper
def store_bits(like, whole):
    """Return the float32 with the same bits."""
    return np.int32(whole).view(np.float32)


@helper
def store_number(like, whole):
    """Return an int32 as a quantity of the batch, of the type of `like`, holds it: float32 holds its bits."""
    return float(whole)


@helper
def read_bits(stored):
    """Return the int32 with the same bits."""
    return np.float32(stored).view(np.int32)


@helper
def read_number(stored):
    """Return the number that `stored_index` has stored, int32."""
    return np.int32(stored)


stored_index, index_of = by_type(store_bits, store_number), by_type(read_bits, read_number)


@helper
def compute_limits(batch, view, size, radius, start, end):
    """Compute in which texel of one map points lie, and the largest value that a texel may have there: a plane over the
    map.

    These take the place of the points as seen from the light. The plane is LIMIT + i·SLOPE_X + j·SLOPE_Y at the centre
    of the texel that lies i to the right and j below. Whatever the numbers are, also none, a point's texel is at least
    `radius` texels from the borders of a map of `size` texels a side.
    """
    real, (right, up, forward) = batch.dtype.type, view.axes
    zero, one, half, infinite = real(0), real(1), real(0.5), real(np.inf)
    low, high, pitch = real(radius), real(size - 1 - radius), np.int32(size)
    scale_x, scale_y = view.scales
    inv_x, inv_y = one / scale_x, one / scale_y
    turned = view.normal_error * (abs(inv_x) + abs(inv_y))
    for k in range(start, end):
        position, own, plane = (
            get_vector(batch, f.FROM_LIGHT, k),
            get_vector(batch, f.NORMAL, k),
            get_vector(batch, f.FACE_NORMAL, k),
        )
        is_front = facing(plane, batch[f.FACE_OFFSET + k], own, view.origin, forward, view.is_perspective) < zero
        of_plane, of_own = (one if dot(plane, own) > zero else -one) if is_front else zero, zero if is_front else one
        normal = add(scale(plane, of_plane), scale(own, of_own))
        x, y, depth = dot(position, right), dot(position, up), dot(position, forward)
        # n·X = c with X = w (F + a R + b U): 1/w is the plane (n·F + a n·R + b n·U)/c. Parallel rays: X = a R + b U + w
        # F.
        constant = dot(normal, position) if view.is_perspective else dot(normal, forward)
        inverse = one / constant
        magnification = one / depth if view.is_perspective else one
        value = magnification if view.is_perspective else -depth
        slope_x, slope_y = dot(normal, right) * inverse * inv_x, -dot(normal, up) * inverse * inv_y
        map_x = view.center[0] + scale_x * x * magnification
        map_y = view.center[1] - scale_y * y * magnification
        # Comparisons, not min and max: what is no number becomes a number, too.
        within_x, within_y = map_x if map_x > low else low, map_y if map_y > low else low
        column, line = np.int32(within_x if within_x < high else high), np.int32(within_y if within_y < high else high)
        extent = abs(position[0]) + abs(position[1]) + abs(position[2])
        nearness = abs(inverse) * (extent if view.is_perspective else one)  # 1 over the cosine of the ray's angle
        max_distance = extent + view.far + batch[MAX_MOVED + k]
        rounding = abs(inverse) * (magnification * view.position_rounding * max_distance + turned)
        slack = (view.slack + view.normal_error * nearness) * (abs(slope_x) + abs(slope_y)) + rounding + view.rounding
        limit = value + slack + slope_x * (real(column) + half - map_x) + slope_y * (real(line) + half - map_y)
        # Lit is what lies behind the light, or is moved beyond it: its own plane hides nothing from such a point.
        is_free = view.is_perspective & ((depth <= zero) | (constant >= zero))
        batch[LIMIT + k] = infinite if is_free else limit
        batch[SLOPE_X + k], batch[SLOPE_Y + k] = zero if is_free else slope_x, zero if is_free else slope_y
        batch[TEXEL_IDX + k] = stored_index(zero, np.int32(np.int32(line * pitch) + column))


@helper
def gather_texels(batch, texels, first, start, end):
    """Fill TEXEL; `first` is the number of the map's texel 0.

    A loop of its own: the compiler can't know that texels are no part of the batch, and would make no vector
    instructions of what else stands in it.
    """
    for k in range(start, end):
        batch[TEXEL + k] = texels[first + index_of(batch[TEXEL_IDX + k])]


@helper
def compare(batch, start, end):
    """Multiply STRENGTH by 0 where the texel lies before the limit.

    Lit also where the limit is no number, because the slopes are infinite: the plane is seen edge-on.
    """
    zero = batch.dtype.type(0)
    for k in range(start, end):
        batch[f.STRENGTH + k] = zero if batch[TEXEL + k] > batch[LIMIT + k] else batch[f.STRENGTH + k]


@helper
def count_lit(batch, texels, first, sizes, start, end):
    """Multiply STRENGTH by the share of the texels about a point that don't lie before the limit.

    `first` is the map's first texel; `sizes` are texels a side of the map and of the filter.
    """
    real, (size, n_tap) = batch.dtype.type, sizes
    zero, to_corner = real(0), (n_tap >> 1) * (size + 1)
    # A quotient: where all taps are lit, it is 1, and no rounding changes the strength.
    total = real(n_tap * n_tap)
    for k in range(start, end):
        corner = first + np.int64(index_of(batch[TEXEL_IDX + k])) - to_corner
        plane = batch[LIMIT + k], batch[SLOPE_X + k], batch[SLOPE_Y + k]
        batch[N_BEFORE + k] = real(count_before(texels, corner, size, n_tap, plane))
    for k in range(start, end):  # a loop of its own, as in `gather_texels`
        share = (total - batch[N_BEFORE + k]) / total
        batch[f.STRENGTH + k] = batch[f.STRENGTH + k] * share if share > zero else zero


@helper
def count_before(texels, corner, pitch, n_tap, plane):
    """Count the texels of a square that lie before a plane: the inner loop of a filter.

    Parameters
    ----------
    texels : (n,) float32 or float64
    corner, pitch : int64, the square's first texel, and texels from row to row
    n_tap : int64, texels a side
    plane : (limit, slope_x, slope_y), the plane's value in the middle of the square, and what it changes by a texel to
        the right and down; a texel that is larger lies before it
    """
    (limit, slope_x, slope_y), radius, n_before = plane, n_tap >> 1, 0
    for j in range(n_tap):
        first, down = corner + j * pitch, texels.dtype.type(j - radius)
        for i in range(n_tap):
            right = texels.dtype.type(i - radius)
            n_before += texels[first + i] > limit + right * slope_x + down * slope_y
    return n_before


@kernel
def write_map(visibility, y_start, n_row, offset, slope, out_texels):
    """Turn the depths of n_row rows from y_start on into texels of a map; clean the band.

    Parameters
    ----------
    visibility : VisibilityBuffer, of the band
    y_start, n_row : the rows of the map
    offset, slope : the texels are offset + slope·z, 1/w or minus the depth; computed in float64
    out_texels : (size, size) float32 or float64, row y_start.. of it; -inf where nothing is
    """
    packed, real = visibility.packed, out_texels.dtype.type
    furthest = real(-np.inf)
    for j in range(n_row):
        left, right = row_extent(visibility, j)
        row = out_texels[y_start + j]
        left, right = max(left, 0), min(max(right, left, 0), len(row))
        for i in range(min(left, len(row))):
            row[i] = furthest
        for i in range(right, len(row)):
            row[i] = furthest
        here = packed[j * visibility.pitch :]
        for i in range(left, right):
            row[i] = real(offset + slope * float(here[i] >> PAYLOAD_BITS)) if here[i] < CLEAR else furthest
    clear(visibility, n_row)
