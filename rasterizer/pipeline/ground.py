"""Which part of an area light the ground doesn't get: for each texel, how many points of the light a scene hides.

    project         vertices onto the ground, from the middle of the light
    draw_layers     triangles into layers of bits, each triangle once, whatever the number of points
    count_hidden    for up to 64 points: layers, shifted, and triangles near the ground; counted for each texel

Coordinates are those of the middle's picture of the ground: columns and rows of texels, whole at their centres, and a
third, t: by how many texels a point's shadow shifts when the light moves from the middle to its rim. As projections
keep planes, triangles stay triangles. The texel p is hidden from the point l of the light (|l| <= 1) where the straight
line from (p, 0) along (l, 1) meets one.

So layers of equal t are drawn once, and shifted by t·l. A line is replaced by a path on a lattice: upright through each
layer, over the texel nearest to the line, and from there to the texel of the next layer, first along the row, then
along the column. Three bits for each texel and layer tell whether a triangle is met

    UPRIGHT     in the layer, over the texel's centre
    ACROSS      on the layer's floor, between this texel's centre and the next in the row
    ALONG       likewise, the next in the column

A path meets a closed surface as often as a line does, so nothing leaks, and no triangle is made larger to close gaps.
It lies up to half a texel beside the line. That matters little where the shadow's edge is blurred over many texels,
which are 2t. So the lattice is finer further down: of the bands of layers, from FLOOR to 2 FLOOR + OVERLAP in units of
their own lattice, the last one has a point for each texel, and those below it have FACTOR, and FACTOR² times as many
along each axis. Where a path changes from band to band it may jump over a surface: so both know the layers there.
Below all bands triangles are drawn for each point of the light, exactly: what they have above NEAR_END is cut off.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel

UPRIGHT, ACROSS, ALONG = 0, 1, 2
FLOOR = 8  # of a band, in units of its lattice: half a unit beside the line moves an edge by at most a 32nd of its blur
OVERLAP = 2  # layers of a band that the next one has, too
LOG_FACTORS = 2, 1, 0  # of the bands: binary logarithm of the lattice's points in a texel, along each axis
NEAR, NEAR_END = 2.0, 3.0  # t below which triangles are drawn exactly: FLOOR of the first band in texels; with overlap
SUBTEXEL = 256.0  # places of vertices in a texel, along each axis
CHUNK = 64  # points of the light that are worked on together
PADDING = 8  # words between masks, so that the same texel of many isn't in the same place of the processor's cache


class Layers(NamedTuple):
    """Layers of bits; those of the finest band come first."""

    # (3, n_plane, n_row * n_word) uint64: a plane for each point of the lattice in a texel; see `place`
    bits: np.ndarray
    rows: np.ndarray  # (n_plane, 2) int64: first and end of the rows in use
    bands: np.ndarray  # (n_band, 3) int64: log of the factor, layers, first plane
    ground: np.ndarray  # (n_row * n_word,) uint64: texels that are covered at t = 0
    n_row: int  # of texels
    n_word: int  # a row, 64 texels each


def make_layers(shape: tuple[int, int], highest: float) -> Layers:
    """Return empty layers.

    Parameters
    ----------
    shape : rows and columns of texels
    highest : t of the highest vertex
    """
    bands, n_plane = [], 0
    for log in LOG_FACTORS:
        end = 2 * FLOOR + OVERLAP if log else math.inf
        n = max(min(math.floor(highest * 2**log * (1 + 2**-20)) + 1, end) - FLOOR, 0)  # t is rounded to 24 bits
        bands.append((log, n, n_plane))
        n_plane += n * 4**log
    n_row, n_word = shape[0], -(-shape[1] // 64)
    bits, ground = np.zeros((3, n_plane, n_row * n_word), np.uint64), np.zeros(n_row * n_word, np.uint64)
    return Layers(bits, np.tile(np.array([n_row, 0]), (n_plane, 1)), np.array(bands), ground, n_row, n_word)


def join(parts: list[Layers]) -> Layers:
    """Join layers that parts of the triangles were drawn into: into those of the first part."""
    joined = parts[0]
    for part in parts[1:]:
        np.bitwise_or(joined.ground, part.ground, out=joined.ground)
        for plane, (first, end) in enumerate(part.rows * joined.n_word):
            joined.bits[:, plane, first:end] |= part.bits[:, plane, first:end]
        joined.rows[:, 0] = np.minimum(joined.rows[:, 0], part.rows[:, 0])
        joined.rows[:, 1] = np.maximum(joined.rows[:, 1], part.rows[:, 1])
    return joined


@kernel
def project(vertices, frame, first, end, out):
    """Project vertices onto the ground.

    Parameters
    ----------
    vertices : (n, 3) float64, world space, scene units
    frame : (5, 3) float64: a point of the ground; what columns and rows are, per scene unit; what is above the ground;
        and the light's height in scene units, its radius in texels, 0
    first, end : of the vertices that are projected
    out : (n, 3) float32: column and row, rounded to whole 1/SUBTEXEL as in every picture; and t
    """
    height, radius = frame[4, 0], frame[4, 1]
    for v in range(first, end):
        x, y, z = vertices[v, 0] - frame[0, 0], vertices[v, 1] - frame[0, 1], vertices[v, 2] - frame[0, 2]
        above = max(x * frame[3, 0] + y * frame[3, 1] + z * frame[3, 2], 0.0)
        further = height / (height - above)  # similar triangles
        column = (x * frame[1, 0] + y * frame[1, 1] + z * frame[1, 2]) * further
        row = (x * frame[2, 0] + y * frame[2, 1] + z * frame[2, 2]) * further
        out[v, 0], out[v, 1] = np.rint(SUBTEXEL * column) / SUBTEXEL, np.rint(SUBTEXEL * row) / SUBTEXEL
        out[v, 2] = (further - 1.0) * radius


# ---------------------------------------------------------------- triangles, row by row


@helper
def in_order(a, b, c, axis):
    """The corners of a triangle in the order of a coordinate."""
    if a[axis] > b[axis]:
        a, b = b, a
    if b[axis] > c[axis]:
        b, c = c, b
    if a[axis] > b[axis]:
        a, b = b, a
    return a, b, c


@helper
def crossing(at, a, b, axis, of):
    """Where the edge from a to b has the coordinate `at` of an axis: the coordinate `of`, the same bits from b to a."""
    if a[axis] > b[axis]:
        a, b = b, a
    return a[of] + (at - a[axis]) * ((b[of] - a[of]) / (b[axis] - a[axis]))


@helper
def cut(at, a, b, c, axis, of):
    """Where the sides of a triangle, its corners in the order of an axis, have the coordinate `at` of it."""
    other = crossing(at, a, b, axis, of) if at < b[axis] else crossing(at, b, c, axis, of)
    return crossing(at, a, c, axis, of), other


@helper
def whole(low, high, n):
    """First and end of the whole numbers k < n with low <= k < high, where k >= 0."""
    return max(np.int64(math.ceil(low)), 0), min(np.int64(math.ceil(high)), n)


@helper
def set_bits(words, first, end):
    """Set the bits first..end of a row."""
    if first < end:
        last = end - 1
        a, b = first >> 6, last >> 6
        head, tail = ~np.uint64(0) << np.uint64(first & 63), ~np.uint64(0) >> np.uint64(63 - (last & 63))
        if a == b:
            words[a] |= head & tail
        else:
            words[a] |= head
            for w in range(a + 1, b):
                words[w] = ~np.uint64(0)
            words[b] |= tail


@helper
def fill(a, b, c, n_row, n_word, mask):
    """Cover the texels of a mask, (n_row * n_word,), whose centres are inside of a triangle."""
    a, b, c = in_order(a, b, c, 1)
    first, end = whole(a[1], c[1], n_row)
    for row in range(first, end):
        u, v = cut(np.float64(row), a, b, c, 1, 0)
        left, right = whole(min(u, v), max(u, v), 64 * n_word)
        set_bits(mask[row * n_word : (row + 1) * n_word], left, right)


# ---------------------------------------------------------------- layers


@helper
def place(band, layer, x, y):
    """Plane, row and column of texels of the point (x, y) of a band's lattice."""
    log = band[0]
    inner = (1 << log) - 1
    return band[2] + (((layer << log) + (y & inner)) << log) + (x & inner), y >> log, x >> log


@helper
def mark(layers, kind, band, layer, x, y):
    """Set a bit of a layer."""
    plane, row, column = place(band, layer, x, y)
    layers.bits[kind, plane, row * layers.n_word + (column >> 6)] |= np.uint64(1) << np.uint64(column & 63)
    rows = layers.rows[plane]
    rows[0], rows[1] = min(rows[0], row), max(rows[1], row + 1)


@helper
def mark_upright(layers, band, a, b, c):
    """Mark where the uprights of a band meet a triangle; coordinates in units of its lattice."""
    n_row, n_column = layers.n_row << band[0], (64 * layers.n_word) << band[0]
    low, high = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
    a, b, c = in_order(a, b, c, 1)
    ux, uy, ut = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vt = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    area = ux * vy - uy * vx
    dt_dx, dt_dy = (ut * vy - vt * uy) / area, (ux * vt - vx * ut) / area
    first, end = whole(a[1], c[1], n_row)
    for y in range(first, end):
        p, q = cut(np.float64(y), a, b, c, 1, 0)
        left, right = whole(min(p, q), max(p, q), n_column)
        for x in range(left, right):
            t = min(max(a[2] + (x - a[0]) * dt_dx + (y - a[1]) * dt_dy, low), high)
            layer = np.int64(math.floor(t)) - FLOOR
            if 0 <= layer < band[1]:
                mark(layers, UPRIGHT, band, layer, x, y)


@helper
def mark_floors(layers, band, a, b, c):
    """Mark where the floors of a band's layers meet a triangle, between neighbouring points of the lattice."""
    n_row, n_column = layers.n_row << band[0], (64 * layers.n_word) << band[0]
    a, b, c = in_order(a, b, c, 2)
    first, end = max(np.int64(math.ceil(a[2])) - FLOOR, 1), min(np.int64(math.ceil(c[2])) - FLOOR, band[1])
    for layer in range(first, end):
        t = np.float64(layer + FLOOR)
        ux, vx = cut(t, a, b, c, 2, 0)
        uy, vy = cut(t, a, b, c, 2, 1)
        u, v = (ux, uy), (vx, vy)
        top, bottom = whole(min(uy, vy), max(uy, vy), n_row)
        for y in range(top, bottom):
            x = np.int64(math.ceil(crossing(np.float64(y), u, v, 1, 0))) - 1
            if 0 <= x < n_column:
                mark(layers, ACROSS, band, layer, x, y)
        left, right = whole(min(ux, vx), max(ux, vx), n_column)
        for x in range(left, right):
            y = np.int64(math.ceil(crossing(np.float64(x), u, v, 0, 1))) - 1
            if 0 <= y < n_row:
                mark(layers, ALONG, band, layer, x, y)


@helper
def scaled(points, v, factor):
    """A projected vertex in units of a lattice."""
    return np.float64(points[v, 0]) * factor, np.float64(points[v, 1]) * factor, np.float64(points[v, 2]) * factor


@helper
def holds_whole(u, v, w):
    """Tell whether there is a whole number between three: from the least on, but below the largest."""
    u, v, w = np.ceil(u), np.ceil(v), np.ceil(w)
    return (u != v) | (v != w)


@kernel
def draw_layers(points, faces, first, end, layers, out_is_near):
    """Draw triangles into the layers.

    Parameters
    ----------
    points : (n, 3) float32, see `project`
    faces : (n_face, 3) uint32
    first, end : of the faces that are drawn
    layers : changed
    out_is_near : (n_face,) bool, set where a part of the triangle is near the ground, which is left to `count_hidden`
    """
    for f in range(first, end):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        low, high = min(points[i, 2], points[j, 2], points[k, 2]), max(points[i, 2], points[j, 2], points[k, 2])
        if high == 0.0:
            a, b, c = scaled(points, i, 1.0), scaled(points, j, 1.0), scaled(points, k, 1.0)
            fill(a, b, c, layers.n_row, layers.n_word, layers.ground)
        else:
            out_is_near[f] = low < NEAR
        for number in range(len(layers.bands)):
            band = layers.bands[number]
            factor = np.float32(1 << band[0])
            if high * factor >= FLOOR and low * factor < FLOOR + band[1]:
                has_x = holds_whole(points[i, 0] * factor, points[j, 0] * factor, points[k, 0] * factor)
                has_y = holds_whole(points[i, 1] * factor, points[j, 1] * factor, points[k, 1] * factor)
                has_t = holds_whole(low * factor, low * factor, high * factor)
                a, b, c = scaled(points, i, factor), scaled(points, j, factor), scaled(points, k, factor)
                if has_x and has_y:
                    mark_upright(layers, band, a, b, c)
                if (has_x or has_y) and has_t:
                    mark_floors(layers, band, a, b, c)


# ---------------------------------------------------------------- points of the light


@helper
def shifted(a, lights, k):
    """Where the shadow of a point is, as light k throws it."""
    return a[0] - lights[0, k] * a[2], a[1] - lights[1, k] * a[2]


@helper
def draw_exactly(a, b, c, layers, lights, is_met, masks):
    """Draw a triangle, whose highest corner is c, for all points of the light. Most are small: so first it is asked for
    which points there may be a texel's centre inside."""
    for axis in range(2):
        low, high = min(a[axis], b[axis], c[axis]), max(a[axis], b[axis], c[axis])
        if np.ceil(low - c[2]) > high + c[2]:
            return
    for k in range(lights.shape[1]):
        p, q, r = shifted(a, lights, k), shifted(b, lights, k), shifted(c, lights, k)
        is_met[k] = holds_whole(p[0], q[0], r[0]) & holds_whole(p[1], q[1], r[1])
    for k in range(lights.shape[1]):
        if is_met[k]:
            p, q, r = shifted(a, lights, k), shifted(b, lights, k), shifted(c, lights, k)
            fill(p, q, r, layers.n_row, layers.n_word, masks[k])


@helper
def point_at_end(a, b):
    """The point of an edge at NEAR_END."""
    return crossing(NEAR_END, a, b, 2, 0), crossing(NEAR_END, a, b, 2, 1), NEAR_END


@helper
def draw_near(near, layers, lights, is_met, masks):
    """Draw the parts of triangles below NEAR_END."""
    for f in range(len(near)):
        corners = near[f]
        a, b, c = in_order(scaled(corners, 0, 1.0), scaled(corners, 1, 1.0), scaled(corners, 2, 1.0), 2)
        if c[2] > NEAR_END:
            on_long_side = point_at_end(a, c)
            if b[2] < NEAR_END:
                draw_exactly(b, on_long_side, point_at_end(b, c), layers, lights, is_met, masks)
            else:
                b = point_at_end(a, b)
            c = on_long_side
        draw_exactly(a, b, c, layers, lights, is_met, masks)


@helper
def shift_in(layers, kind, band, layer, x, y, mask):
    """Set the bits p of a mask for which the bit p + (x, y) of a layer is set; both have all rows one after another."""
    plane, row, column = place(band, layer, x, y)
    n_word, words, rows = layers.n_word, layers.bits[kind, plane], layers.rows[plane]
    skip, bit = n_word * row + (column >> 6), np.uint64(column & 63)
    first = max(rows[0] * n_word - skip - 1, 0, -skip)
    end = min(rows[1] * n_word - skip, len(mask), len(words) - 1 - skip)
    if first < end:
        out, low, high = mask[first:end], words[first + skip : end + skip], words[first + skip + 1 : end + skip + 1]
        back = np.uint64(63) - bit
        for k in range(len(out)):
            out[k] |= (low[k] >> bit) | ((high[k] << np.uint64(1)) << back)


@helper
def follow(layers, x, y, mask):
    """Add to a mask what the layers hide from one point of the light."""
    for number in range(len(layers.bands)):
        band = layers.bands[number]
        last_x, last_y = 0, 0
        for layer in range(band[1]):
            middle = np.float64(layer + FLOOR) + 0.5
            path_x, path_y = np.int64(math.floor(x * middle + 0.5)), np.int64(math.floor(y * middle + 0.5))
            if layer > 0 and path_x != last_x:
                shift_in(layers, ACROSS, band, layer, min(path_x, last_x), last_y, mask)
            if layer > 0 and path_y != last_y:
                shift_in(layers, ALONG, band, layer, path_x, min(path_y, last_y), mask)
            shift_in(layers, UPRIGHT, band, layer, path_x, path_y, mask)
            last_x, last_y = path_x, path_y


@helper
def add_mask(mask, sums):
    """Add a mask to sums whose bits are spread over planes: a carry goes from plane to plane. The mask is lost."""
    for p in range(len(sums)):
        plane = sums[p]
        for k in range(len(mask)):
            bit = plane[k]
            plane[k] = bit ^ mask[k]
            mask[k] &= bit


@kernel
def count_hidden(layers, near, lights, is_met, masks, out_sums):
    """Count how many of up to CHUNK points of the light each texel doesn't see.

    Parameters
    ----------
    layers : of all triangles, see `draw_layers`
    near : (n, 3, 3) float32, the corners of triangles that are near the ground
    lights : (2, n_light) float64, columns and rows; the light's radius is 1
    is_met : (n_light,) bool, working space
    masks : (n_light, n_row * n_word + PADDING) uint64, working space, which comes in as zero
    out_sums : (7, n_row * n_word) uint64, comes in as zero: a plane for each bit of the numbers, 64 texels a word
    """
    draw_near(near, layers, lights, is_met, masks)
    for k in range(lights.shape[1]):
        mask = masks[k, : len(layers.ground)]
        for word in range(len(mask)):
            mask[word] |= layers.ground[word]
        follow(layers, lights[0, k], lights[1, k], mask)
        add_mask(mask, out_sums)
