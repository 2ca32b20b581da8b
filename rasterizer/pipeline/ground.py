"""Which part of an area light the ground doesn't get: for each texel, how many points of the light a scene hides.

    project         vertices onto the ground, from the middle of the light
    draw_layers     triangles into layers of bits, each triangle once, whatever the number of points
    count_hidden    for 64 points of the light: layers, shifted, and triangles near the ground; counted for each texel

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
Below all bands triangles are drawn for each point of the light, exactly.
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
LOG_SUBTEXEL, SUBTEXEL = 8, 256.0  # places of vertices in a texel, along each axis
CHUNK = 64  # points of the light that are worked on together
PADDING = 8  # words between masks, so that the same texel of many isn't in the same place of the processor's cache
SMALL = 4  # texels along each axis that a small triangle may reach over
ROUNDING = np.float32(2.0**-7)  # of differences of coordinates, which have 24 bits, and are placed on the grid


class Layers(NamedTuple):
    """Layers of bits; those of the finest band come first."""

    bits: (
        np.ndarray
    )  # (3, n_plane, n_row * n_word) uint64: a plane for each point of the lattice in a texel; see `place`
    rows: np.ndarray  # (n_layer, 2) int64: first and end of the rows in use
    bands: np.ndarray  # (n_band, 4) int64: log of the factor, first layer, layers, first plane
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
    bands, n_layer, n_plane = [], 0, 0
    for log in LOG_FACTORS:
        end = 2 * FLOOR + OVERLAP if log else math.inf
        n = max(min(math.floor(highest * 2**log * (1 + 2**-20)) + 1, end) - FLOOR, 0)  # t is rounded to 24 bits
        bands.append((log, n_layer, n, n_plane))
        n_layer, n_plane = n_layer + n, n_plane + n * 4**log
    n_row, n_word = shape[0], -(-shape[1] // 64)
    return Layers(
        np.zeros((3, n_plane, n_row * n_word), np.uint64),
        np.tile(np.array([n_row, 0]), (n_layer, 1)),
        np.array(bands),
        np.zeros(n_row * n_word, np.uint64),
        n_row,
        n_word,
    )


def join(parts: list[Layers]) -> Layers:
    """Join layers that parts of the triangles were drawn into: into those of the first part."""
    joined = parts[0]
    for part in parts[1:]:
        np.bitwise_or(joined.ground, part.ground, out=joined.ground)
        for log, first_layer, n_layer, first_plane in part.bands:
            for layer in range(n_layer):
                first, end = part.rows[first_layer + layer]
                planes = slice(first_plane + (layer << 2 * log), first_plane + (layer + 1 << 2 * log))
                at = slice(None), planes, slice(first * joined.n_word, end * joined.n_word)
                np.bitwise_or(joined.bits[at], part.bits[at], out=joined.bits[at])
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
def place(layers, band, layer, x, y):
    """Plane, row and column of texels of the point (x, y) of a band's lattice."""
    log = band[0]
    inner = (1 << log) - 1
    return band[3] + (((layer << log) + (y & inner)) << log) + (x & inner), y >> log, x >> log


@helper
def mark(layers, kind, band, layer, x, y):
    """Set a bit of a layer."""
    plane, row, column = place(layers, band, layer, x, y)
    layers.bits[kind, plane, row * layers.n_word + (column >> 6)] |= np.uint64(1) << np.uint64(column & 63)
    rows = layers.rows[band[1] + layer]
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
            if 0 <= layer < band[2]:
                mark(layers, UPRIGHT, band, layer, x, y)


@helper
def mark_floors(layers, band, a, b, c):
    """Mark where the floors of a band's layers meet a triangle, between neighbouring points of the lattice."""
    n_row, n_column = layers.n_row << band[0], (64 * layers.n_word) << band[0]
    a, b, c = in_order(a, b, c, 2)
    first, end = max(np.int64(math.ceil(a[2])) - FLOOR, 1), min(np.int64(math.ceil(c[2])) - FLOOR, band[2])
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
def put(out, n, a, b, c):
    """Write a triangle into a row."""
    for k in range(3):
        out[n, k], out[n, 3 + k], out[n, 6 + k] = a[k], b[k], c[k]
    return n + 1


@helper
def point_at(t, a, b):
    """The point of an edge at t."""
    return crossing(t, a, b, 2, 0), crossing(t, a, b, 2, 1), t


@helper
def put_near(a, b, c, out, n):
    """Write the part of a triangle below NEAR_END, and return the number of rows in use."""
    a, b, c = in_order(a, b, c, 2)
    if c[2] <= NEAR_END:
        return put(out, n, a, b, c)
    p = point_at(NEAR_END, a, c)
    if b[2] >= NEAR_END:
        return put(out, n, a, point_at(NEAR_END, a, b), p)
    return put(out, put(out, n, a, b, p), b, p, point_at(NEAR_END, b, c))


@helper
def scaled(points, v, factor):
    """A projected vertex in units of a lattice."""
    return np.float64(points[v, 0]) * factor, np.float64(points[v, 1]) * factor, np.float64(points[v, 2]) * factor


@helper
def holds_whole(u, v, w):
    """Tell whether there is a whole number between three."""
    return np.ceil(min(u, v, w)) < np.ceil(max(u, v, w))


@kernel
def draw_layers(points, faces, first, end, layers, out_near):
    """Draw triangles into the layers.

    Parameters
    ----------
    points : (n, 3) float32, see `project`
    faces : (n_face, 3) uint32
    first, end : of the faces that are drawn
    layers : changed
    out_near : (2 (end - first), 9) float32: the parts of the triangles that are near the ground, corner by corner

    Returns
    -------
    the number of parts
    """
    n, n_band = 0, len(layers.bands)
    for f in range(first, end):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        low, high = min(points[i, 2], points[j, 2], points[k, 2]), max(points[i, 2], points[j, 2], points[k, 2])
        if low < NEAR:
            a, b, c = scaled(points, i, 1.0), scaled(points, j, 1.0), scaled(points, k, 1.0)
            if high == 0.0:
                fill(a, b, c, layers.n_row, layers.n_word, layers.ground)
            else:
                n = put_near(a, b, c, out_near, n)
        for number in range(n_band):
            band = layers.bands[number]
            factor = np.float32(1 << band[0])
            if high * factor >= FLOOR and low * factor < FLOOR + band[2]:
                has_x = holds_whole(points[i, 0] * factor, points[j, 0] * factor, points[k, 0] * factor)
                has_y = holds_whole(points[i, 1] * factor, points[j, 1] * factor, points[k, 1] * factor)
                has_t = holds_whole(low * factor, low * factor, high * factor)
                a, b, c = scaled(points, i, factor), scaled(points, j, factor), scaled(points, k, factor)
                if has_x and has_y:
                    mark_upright(layers, band, a, b, c)
                if (has_x or has_y) and has_t:
                    mark_floors(layers, band, a, b, c)
    return n


# ---------------------------------------------------------------- points of the light


class PassScratch(NamedTuple):
    """Room for CHUNK points of the light."""

    # (CHUNK, n_row * n_word + PADDING) uint64: texels that a point doesn't see
    masks: np.ndarray
    sums: np.ndarray  # (7, n_row * n_word) uint64: bits of the number of points that don't see a texel
    edges: np.ndarray  # (11, CHUNK) int32: three edge functions with their gains, the column and row they begin at
    covered: np.ndarray  # (CHUNK,) uint32


def make_scratch(layers: Layers) -> PassScratch:
    """Return room for CHUNK points of the light, with nothing hidden."""
    size = layers.ground.size
    return PassScratch(
        np.zeros((CHUNK, size + PADDING), np.uint64), np.zeros((CHUNK.bit_length(), size), np.uint64),
        np.empty((11, CHUNK), np.int32), np.empty(CHUNK, np.uint32),
    )  # fmt: skip


@helper
def place_on_grid(position):
    """A coordinate in whole 1/SUBTEXEL, int32."""
    return np.int32(np.rint(np.float32(SUBTEXEL) * position))


@helper
def edge_at_origin(x0, y0, x1, y1):
    """An edge function at the origin, int32."""
    return np.int32(np.int32(x0 * y1) - np.int32(y0 * x1))


@helper
def begin_edge(value, across, down, flip, rows, k):
    """Write an edge function at the origin, and what it gains from a texel to the next, across and down.

    flip : -1 where it is below 0 inside, else 0. What is written is 0 or more inside, also on a left edge and on a
        level one at the top, as for `fill`, and negative outside
    """
    across, down = np.int32(np.int32(across ^ flip) - flip), np.int32(np.int32(down ^ flip) - flip)
    is_owned = np.int32(across > 0) | (np.int32(across == 0) & np.int32(down > 0))
    rows[0][k] = np.int32(np.int32(value ^ flip) - flip) + is_owned - np.int32(1)
    rows[1][k], rows[2][k] = np.int32(across << np.int32(LOG_SUBTEXEL)), np.int32(down << np.int32(LOG_SUBTEXEL))


@helper
def draw_small(triangle, lights, n_x, n_y, shape, scratch):
    """Draw a triangle that covers no more than n_x by n_y texels, for CHUNK points of the light side by side."""
    a, b, c = triangle
    edges, covered, x, y = scratch.edges, scratch.covered, lights[0], lights[1]
    ab, bc, ca = (edges[0], edges[1], edges[2]), (edges[3], edges[4], edges[5]), (edges[6], edges[7], edges[8])
    left, top, mask = edges[9], edges[10], np.int32(SUBTEXEL - 1)
    for k in range(CHUNK):
        x0, y0 = place_on_grid(a[0] - x[k] * a[2]), place_on_grid(a[1] - y[k] * a[2])
        x1, y1 = place_on_grid(b[0] - x[k] * b[2]), place_on_grid(b[1] - y[k] * b[2])
        x2, y2 = place_on_grid(c[0] - x[k] * c[2]), place_on_grid(c[1] - y[k] * c[2])
        first_x, first_y = np.int32(min(min(x0, x1), x2) + mask) & ~mask, np.int32(min(min(y0, y1), y2) + mask) & ~mask
        left[k], top[k] = first_x >> np.int32(LOG_SUBTEXEL), first_y >> np.int32(LOG_SUBTEXEL)
        x0, x1, x2 = np.int32(x0 - first_x), np.int32(x1 - first_x), np.int32(x2 - first_x)
        y0, y1, y2 = np.int32(y0 - first_y), np.int32(y1 - first_y), np.int32(y2 - first_y)
        e0, e1, e2 = edge_at_origin(x0, y0, x1, y1), edge_at_origin(x1, y1, x2, y2), edge_at_origin(x2, y2, x0, y0)
        flip = np.int32(np.int32(e0 + e1 + e2) >> np.int32(31))  # the sign of the area
        begin_edge(e0, np.int32(y0 - y1), np.int32(x1 - x0), flip, ab, k)
        begin_edge(e1, np.int32(y1 - y2), np.int32(x2 - x1), flip, bc, k)
        begin_edge(e2, np.int32(y2 - y0), np.int32(x0 - x2), flip, ca, k)
        covered[k] = 0
    for row in range(n_y):
        for column in range(n_x):
            bit, u, v = np.uint32(SMALL * row + column), np.int32(column), np.int32(row)
            for k in range(CHUNK):
                e0 = ab[0][k] + np.int32(u * ab[1][k]) + np.int32(v * ab[2][k])
                e1 = bc[0][k] + np.int32(u * bc[1][k]) + np.int32(v * bc[2][k])
                e2 = ca[0][k] + np.int32(u * ca[1][k]) + np.int32(v * ca[2][k])
                covered[k] |= np.uint32(np.int32(e0 | e1 | e2) >= 0) << bit
    n_found = np.uint32(0)
    for k in range(CHUNK):
        n_found += np.uint32(covered[k] != 0)
    if n_found == 0:
        return
    # Where it covers something for many points, for which can't be foretold: then nothing takes less time to draw than
    # to leave out.
    is_rare = n_found < CHUNK // 4
    n_row, n_word = shape
    for k in range(CHUNK):
        if is_rare and covered[k] == 0:
            continue
        first_row, column = np.int64(top[k]), np.int64(left[k])
        if first_row >= 0 and first_row + n_y <= n_row and 0 <= column < 64 * n_word - SMALL:
            mask, word, bit = scratch.masks[k], first_row * n_word + (column >> 6), np.uint64(column & 63)
            rest = covered[k]
            for _ in range(n_y):
                run = np.uint64(rest & np.uint32((1 << SMALL) - 1))
                mask[word] |= run << bit
                if bit > np.uint64(64 - SMALL):
                    mask[word + 1] |= run >> (np.uint64(64) - bit)
                word += n_word
                rest >>= np.uint32(SMALL)


@helper
def holds_centre(low, high, t):
    """Tell whether a texel's centre may lie between two coordinates, for any point of the light."""
    return np.ceil(low - t - ROUNDING) <= high + t + ROUNDING


@helper
def draw_near(near, lights, shape, scratch):
    """Draw triangles for CHUNK points of the light."""
    for f in range(len(near)):
        a, b, c = (
            (near[f, 0], near[f, 1], near[f, 2]),
            (near[f, 3], near[f, 4], near[f, 5]),
            (near[f, 6], near[f, 7], near[f, 8]),
        )
        low, high = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
        left, right = min(a[0], b[0], c[0]), max(a[0], b[0], c[0])
        top, bottom = min(a[1], b[1], c[1]), max(a[1], b[1], c[1])
        if not (holds_centre(left, right, high) and holds_centre(top, bottom, high)):
            continue
        wide, tall = right - left + (high - low) + ROUNDING, bottom - top + (high - low) + ROUNDING
        if wide < SMALL and tall < SMALL:
            draw_small((a, b, c), lights, np.int64(wide) + 1, np.int64(tall) + 1, shape, scratch)
        else:
            for k in range(CHUNK):
                x, y = np.float64(lights[0, k]), np.float64(lights[1, k])
                fill(
                    (a[0] - x * a[2], a[1] - y * a[2]), (b[0] - x * b[2], b[1] - y * b[2]),
                    (c[0] - x * c[2], c[1] - y * c[2]), shape[0], shape[1], scratch.masks[k],
                )  # fmt: skip


@helper
def shift_in(words, rows, n_word, shift, mask):
    """Set the bits p of a mask for which the bit p + shift of a plane is set; both have all rows one after another."""
    skip, bit = shift >> 6, np.uint64(shift & 63)
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
    n_word = layers.n_word
    for number in range(len(layers.bands)):
        band = layers.bands[number]
        last_x, last_y = 0, 0
        for layer in range(band[2]):
            middle = np.float64(layer + FLOOR) + 0.5
            path_x, path_y = np.int64(math.floor(x * middle + 0.5)), np.int64(math.floor(y * middle + 0.5))
            rows = layers.rows[band[1] + layer]
            if rows[0] < rows[1]:
                if layer > 0 and path_x != last_x:
                    plane, row, column = place(layers, band, layer, min(path_x, last_x), last_y)
                    shift_in(layers.bits[ACROSS, plane], rows, n_word, 64 * n_word * row + column, mask)
                if layer > 0 and path_y != last_y:
                    plane, row, column = place(layers, band, layer, path_x, min(path_y, last_y))
                    shift_in(layers.bits[ALONG, plane], rows, n_word, 64 * n_word * row + column, mask)
                plane, row, column = place(layers, band, layer, path_x, path_y)
                shift_in(layers.bits[UPRIGHT, plane], rows, n_word, 64 * n_word * row + column, mask)
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
def count_hidden(layers, near, lights, n_light, scratch, out_counts):
    """Count how many of up to CHUNK points of the light each texel doesn't see.

    Parameters
    ----------
    layers, near : of all triangles, see `draw_layers`
    lights : (2, CHUNK) float32, columns and rows; the light's radius is 1
    n_light : how many of them there are
    scratch : see `make_scratch`
    out_counts : (n_row * n_word * 64,) uint8
    """
    shape, ground = (layers.n_row, layers.n_word), layers.ground
    draw_near(near, lights, shape, scratch)
    for k in range(n_light):
        mask = scratch.masks[k, : len(ground)]
        for word in range(len(ground)):
            mask[word] |= ground[word]
        follow(layers, np.float64(lights[0, k]), np.float64(lights[1, k]), mask)
        add_mask(mask, scratch.sums)
    for word in range(len(ground)):
        counts = out_counts[word * 64 : word * 64 + 64]
        for x in range(64):
            counts[x] = 0
        for p in range(len(scratch.sums)):
            bits = scratch.sums[p, word]
            if bits != 0:
                for x in range(64):
                    counts[x] += np.uint8((bits >> x) & np.uint64(1)) << np.uint8(p)
