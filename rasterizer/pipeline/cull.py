"""Stage 3, cull: which triangles can cover a sample, sorted into bands of scanlines.

In:  index columns of the triangles, and the vertices on the screen.
Out: `Visible`: the triangles that are left, in face order, each with the first and last band that it reaches; then
     `BandLists`: a list of triangles for every band. Every part of the range of faces has its own, which the thread
     sorts that has found them: no thread waits for another one. `join_lists` puts those of a band together.

A triangle is dropped when it has no area, when a vertex is OUTSIDE (the clip stage has put its parts in its place),
when the side of it is seen that is left out, when its box holds no sample of the picture, or when its box is small and
none of its samples is covered. PASS triangles at a time go through four loops: their vertices are gathered into rows,
side by side the compiler's vector instructions find the signs of their areas, then what their boxes hold, and what is
left is written out without a branch.

    box of a sliver   + . . +     Up to SMALL_BOX x SMALL_BOX samples are tested with the edge functions of the scan
                      |\\    |     stage, in exact integers. They hold the top-left rule, so a triangle that is dropped
    . sample          | '\\. |     covers none of these samples.
                      +----'+

What is covered lies in the half-open box that `first_sample` makes of the corners. For let m be the greatest x of the
corners: a sample right of m is outside. One at m is inside only on a vertex or an edge there. An edge along m has the
triangle on its left, so it is no left edge; every other edge that reaches m ends there, and of the two that meet, one
has the triangle on its left. The same holds for the greatest y.

Bands are a counting sort: the classic bucket-sorted edge table with bands instead of scanlines. A band is the unit of
parallel work, and so small that its visibility buffer stays in the L2 cache. The order within a band is the order of
the faces, whatever the number of threads, so the picture can't depend on it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import helper, kernel
from ..geometry.vectors import dot, subtract, vector_of_row
from .transform import HALF, OUTSIDE, SUBPIXEL

PASS = 512  # triangles: what is noted of them on the way stays in the L1 cache
SUBPIXEL_SHIFT = 8  # log2 of SUBPIXEL
SMALL_BOX = 3  # columns and rows of samples of a small box; 4 gains nothing: larger triangles hold many samples


class Grid(NamedTuple):
    """The samples of a picture, divided into bands."""

    width: int  # samples
    height: int
    band_rows: int  # rows of samples a band; the last one may have fewer


class Visible(NamedTuple):
    """What is left of a range of triangles."""

    faces: np.ndarray  # (n,) uint32, ascending
    first_bands: np.ndarray  # (n,) uint16, or uint32 where there are more bands
    last_bands: np.ndarray  # the same, inclusive
    histogram: np.ndarray  # (n_band,) int64, triangles a band
    n_culled: int


# Rows of int32 that are noted of PASS triangles, one quantity a row; all stand one behind the other in one flat array,
# `rows[X0 + k]`, so that the compiler sees that they don't overlap.
X0, Y0, X1, Y1, X2, Y2, SIDE, FIRST_BAND, LAST_BAND, IS_KEPT = (PASS * row for row in range(10))
N_ROW = 10


class CullScratch(NamedTuple):
    """What is noted of PASS triangles between the loops."""

    faces: np.ndarray  # (PASS,) uint32
    # (N_ROW * PASS,) int32: the vertices, 1/256 px; 1 clockwise on the screen, -1 counter-clockwise, 0 dropped; the
    # bands that the box reaches in the picture; whether it is kept
    rows: np.ndarray


def make_cull_scratch() -> CullScratch:
    """Return room for what is noted of PASS triangles."""
    return CullScratch(np.empty(PASS, np.uint32), np.empty(N_ROW * PASS, np.int32))


def find_visible(vertex_idx, vertices, grid: Grid, hidden_sides, workers, then=None) -> list:
    """Drop the triangles that can't be seen; one Visible for each part of the range of faces, in order.

    Parameters
    ----------
    vertex_idx : (3, n) uint32, as in Triangles
    vertices : Vertices
    hidden_sides : (n,) int8, which side of each triangle is left out: 1 clockwise on the screen, -1 counter-clockwise,
        0 neither
    then : what the thread that found a part does with its Visible; what that returns takes its place. None for nothing
    """
    n_band = -(-grid.height // grid.band_rows)
    dtype = np.uint16 if n_band <= 2**16 else np.uint32

    def find(part):
        n = part[1] - part[0]
        out = Visible(np.empty(n, np.uint32), np.empty(n, dtype), np.empty(n, dtype), np.zeros(n_band + 1, np.int64), 0)
        n_kept, n_culled = find_visible_in(*part, vertex_idx, vertices, grid, hidden_sides, make_cull_scratch(), out)
        visible = Visible(
            out.faces[:n_kept], out.first_bands[:n_kept], out.last_bands[:n_kept], out.histogram[:n_band], n_culled
        )
        return visible if then is None else then(visible)

    return workers.map(find, workers.ranges(vertex_idx.shape[1]))


@kernel
def find_visible_in(start, end, vertex_idx, vertices, grid, hidden_sides, scratch, out):
    """Write the visible triangles of start..end to `out`; return how many they are, and how many were culled.

    Parameters
    ----------
    start, end : the range of triangles, half-open
    vertex_idx : (3, n_face) uint32
    vertices : Vertices, on the screen
    grid : Grid
    hidden_sides : (n_face,) int8, see `find_visible`
    scratch : CullScratch
    out : Visible with room for all triangles; its histogram is zero and has n_band + 1 places
    """
    n_kept, n_culled = 0, 0
    for first in range(start, end, PASS):
        n = min(PASS, end - first)
        gather_triangles(first, n, vertex_idx, vertices, scratch)
        n_here, n_left = note_sides(n, hidden_sides[first : first + n], scratch)
        n_culled += n_here
        if n_left > 0:  # whole passes look away, as a rule: neighbours in a file are neighbours in space
            flag_covering(n, grid, scratch)
            n_kept = append_kept(n, n_kept, scratch, out)
    histogram = out.histogram
    for band in range(1, len(histogram)):
        histogram[band] += histogram[band - 1]
    return n_kept, n_culled


@helper
def gather_triangles(first, n, vertex_idx, vertices, scratch):
    """Fetch n triangles from `first` on, up to PASS."""
    a, b, c = vertex_idx[0], vertex_idx[1], vertex_idx[2]
    x, y, rows = vertices.x, vertices.y, scratch.rows
    for k in range(n):
        face = first + k
        v0, v1, v2 = a[face], b[face], c[face]
        scratch.faces[k] = face
        rows[X0 + k], rows[Y0 + k] = x[v0], y[v0]
        rows[X1 + k], rows[Y1 + k] = x[v1], y[v1]
        rows[X2 + k], rows[Y2 + k] = x[v2], y[v2]


@helper
def note_sides(n, hidden_sides, scratch):
    """Note which sides of the first n triangles are seen, 0 where they are dropped; return how many were culled, and
    how many are left."""
    rows, n_culled, n_left = scratch.rows, 0, 0
    for k in range(n):
        x0, y0 = np.int64(rows[X0 + k]), np.int64(rows[Y0 + k])
        x1, y1 = np.int64(rows[X1 + k]), np.int64(rows[Y1 + k])
        x2, y2 = np.int64(rows[X2 + k]), np.int64(rows[Y2 + k])
        # Twice the signed area; the y axis points down, so counter-clockwise triangles are negative.
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        is_placed = min(x0, x1, x2) != OUTSIDE
        side = (np.int32(area > 0) - np.int32(area < 0)) * is_placed
        is_culled = (side == hidden_sides[k]) & (side != 0)
        rows[SIDE + k] = np.int32(0 if is_culled else side)
        n_culled += is_culled
        n_left += (side != 0) & (not is_culled)
    return n_culled, n_left


@helper
def flag_covering(n, grid, scratch):
    """Flag those of the first n triangles that can cover a sample of the picture, and note the bands of their boxes.

    Arithmetic on coordinates is int32, so that twice as many triangles go side by side. It wraps where triangles are
    large; these are kept, whatever their samples are.
    """
    rows, bands_a_row = scratch.rows, 1.0 / grid.band_rows
    for k in range(n):
        x0, y0, x1, y1, x2, y2 = rows[X0 + k], rows[Y0 + k], rows[X1 + k], rows[Y1 + k], rows[X2 + k], rows[Y2 + k]
        first_x, end_x = first_sample_int32(min(x0, x1, x2)), first_sample_int32(max(x0, x1, x2))
        first_y, end_y = first_sample_int32(min(y0, y1, y2)), first_sample_int32(max(y0, y1, y2))
        left, right = max(first_x, np.int32(0)), min(end_x, np.int32(grid.width))
        top, bottom = max(first_y, np.int32(0)), min(end_y, np.int32(grid.height))
        is_hit = (left < right) & (top < bottom) & (rows[SIDE + k] != 0)
        is_large = (end_x - first_x > SMALL_BOX) | (end_y - first_y > SMALL_BOX)
        triangle = (x0, y0, x1, y1, x2, y2)
        rows[IS_KEPT + k] = is_hit & (is_large | is_any_covered(triangle, rows[SIDE + k], left, top))
        # Quotients of integers: half a row more keeps the product further from a whole number than it is rounded. So
        # what is rounded down lies within 0..n_band - 1, as the rows do within 0..height.
        rows[FIRST_BAND + k] = np.int32((top + 0.5) * bands_a_row)
        rows[LAST_BAND + k] = np.int32((max(bottom, np.int32(1)) - 0.5) * bands_a_row)


@helper
def is_any_covered(triangle, side, left, top):
    """Tell whether a triangle with a small box covers any sample of the window.

    Parameters
    ----------
    triangle : (x0, y0, x1, y1, x2, y2) int32, 1/256 px; where the box is not small, the result is of no use
    side : int32, 1 where it is clockwise on the screen, -1 where it isn't
    left, top : int32, column and row of the window's first sample
    """
    (e0, e1, e2), (dx0, dx1, dx2), (dy0, dy1, dy2) = edge_functions(triangle, side, left, top)
    outside = np.int32(-1)  # its sign is set while no sample is inside of all edges
    for _ in range(SMALL_BOX):
        at0, at1, at2 = e0, e1, e2
        for _ in range(SMALL_BOX):
            outside = np.int32(outside & np.int32(np.int32(at0 | at1) | at2))
            at0, at1, at2 = np.int32(at0 + dx0), np.int32(at1 + dx1), np.int32(at2 + dx2)
        e0, e1, e2 = np.int32(e0 + dy0), np.int32(e1 + dy1), np.int32(e2 + dy2)
    return outside >= 0


@helper
def edge_functions(triangle, side, left, top):
    """Evaluate the three edge functions of a triangle at a sample: values, and steps to the right and down; int32.

    The corners of a small box lie within SMALL_BOX + 1 px of every sample in it. So products of two lengths are below
    2^21, and nothing wraps.
    """
    x0, y0, x1, y1, x2, y2 = triangle
    sx, sy = np.int32(left * SUBPIXEL + HALF), np.int32(top * SUBPIXEL + HALF)
    e0, dx0, dy0 = edge_function(x0, y0, x1, y1, side, sx, sy)
    e1, dx1, dy1 = edge_function(x1, y1, x2, y2, side, sx, sy)
    e2, dx2, dy2 = edge_function(x2, y2, x0, y0, side, sx, sy)
    return (e0, e1, e2), (dx0, dx1, dx2), (dy0, dy1, dy2)


@helper
def edge_function(xa, ya, xb, yb, side, sx, sy):
    """Evaluate the edge function of an edge at a sample, with its steps a sample, as scan.edge_function does; int32.

    The edge of a triangle that isn't clockwise is reversed: its value, steps and direction change their signs.
    """
    dx, dy = np.int32(side * np.int32(xb - xa)), np.int32(side * np.int32(yb - ya))
    is_top_left = (dy < 0) | ((dy == 0) & (dx > 0))
    value = np.int32(dx * np.int32(sy - ya) - dy * np.int32(sx - xa) - (0 if is_top_left else 1))
    return value, np.int32(dy * -SUBPIXEL), np.int32(dx * SUBPIXEL)


@helper
def first_sample(coordinate):
    """Compute the column or row of the first sample at or beyond a coordinate in 1/256 px, int64; exact."""
    return (np.int64(coordinate) + HALF - 1) >> SUBPIXEL_SHIFT


@helper
def first_sample_int32(coordinate):
    """Compute what `first_sample` does, int32; exact up to the limits of coordinates, 2^28, and for OUTSIDE."""
    return np.int32(np.int32(coordinate + (HALF - 1)) >> SUBPIXEL_SHIFT)


@helper
def append_kept(n, n_kept, scratch, out):
    """Append those of the first n triangles that are kept to `out`, which has n_kept; return how many it has then."""
    faces, rows, histogram = scratch.faces, scratch.rows, out.histogram
    out_faces, out_first, out_last = out.faces, out.first_bands, out.last_bands
    start = n_kept
    for k in range(n):
        out_faces[n_kept], out_first[n_kept], out_last[n_kept] = faces[k], rows[FIRST_BAND + k], rows[LAST_BAND + k]
        n_kept += rows[IS_KEPT + k]
    for k in range(start, n_kept):
        histogram[out_first[k]] += 1  # for now: how many more than in the band before
        histogram[out_last[k] + 1] -= 1
    return n_kept


# ---------------------------------------------------------------- bands


class BandLists(NamedTuple):
    """Lists of the triangles of a part, one after the other: those of band b are faces[starts[b]:starts[b + 1]]."""

    faces: np.ndarray  # (n,) uint32
    starts: np.ndarray  # (n_band + 1,) int64
    n_visible: int  # triangles
    n_culled: int


class Band(NamedTuple):
    """Rows y_start..y_end of samples of the picture, and the triangles that meet them."""

    faces: np.ndarray  # (n,) uint32, ascending
    y_start: int
    y_end: int

    @property
    def n_row(self) -> int:
        """Rows of samples."""
        return self.y_end - self.y_start


class Rows(NamedTuple):
    """Rows y_start..y_end of samples."""

    y_start: int
    y_end: int


def sort_into_bands(visible) -> BandLists:
    """Sort the visible triangles of a part into bands.

    Parameters
    ----------
    visible : cull.Visible
    """
    starts = np.zeros(len(visible.histogram) + 1, np.int64)
    np.cumsum(visible.histogram, out=starts[1:])
    faces = np.empty(starts[-1], np.uint32)
    scatter(visible.faces, visible.first_bands, visible.last_bands, starts[:-1].copy(), faces)
    return BandLists(faces, starts, len(visible.faces), visible.n_culled)


@kernel
def scatter(faces, first_bands, last_bands, cursors, out_faces):
    """Append every triangle to the lists of the bands that it reaches.

    Parameters
    ----------
    faces : (n,) uint32
    first_bands, last_bands : (n,) uint16 or uint32, inclusive
    cursors : (n_band,) int64, where in `out_faces` each list's next entry goes; moved on
    out_faces : (n_listed,) uint32
    """
    for k in range(len(faces)):
        for band in range(first_bands[k], last_bands[k] + 1):
            here = cursors[band]
            out_faces[here], cursors[band] = faces[k], here + 1


def join_lists(parts) -> BandLists:
    """Put the lists of all parts together: those of a band one after the other, its triangles ascending.

    It is done once, before the bands are drawn: numpy gives the GIL away for a copy, and threads that copied between
    bands would wait for it.

    Parameters
    ----------
    parts : list of BandLists, one for each part of the range of faces, in order
    """
    if len(parts) == 1:
        return parts[0]
    starts, cuts = sum(part.starts for part in parts), [part.starts.tolist() for part in parts]
    lists = [part.faces[cut[k] : cut[k + 1]]
             for k in range(len(starts) - 1) for part, cut in zip(parts, cuts, strict=True)]  # fmt: skip
    n_visible, n_culled = sum(part.n_visible for part in parts), sum(part.n_culled for part in parts)
    return BandLists(np.concatenate(lists), starts, n_visible, n_culled)


# ---------------------------------------------------------------- views that see a part of the scene

# Triangles can't be seen in a view where all their vertices lie beyond the same of its planes.
#
# Source: the outcodes of Cohen & Sutherland; Newman & Sproull 1973, "Principles of Interactive Computer Graphics".

MAX_PLANES = 8  # bits of an outcode


def list_seen_faces(positions: NDArray, vertex_idx: NDArray, eye: NDArray, planes: NDArray) -> NDArray[np.uint32]:
    """Find the triangles that don't lie beyond one plane as a whole, (n,) indices in order.

    Parameters
    ----------
    positions : (n_vertex, 3) float64, world space, scene units
    vertex_idx : (3, n_face) uint32
    eye : (3,) float64, world space, on all planes
    planes : (n_plane, 3) float64, up to MAX_PLANES normals; a point is beyond where n·(P - eye) < 0, and never where
        that is no number
    """
    outcodes = np.empty(len(positions), np.uint8)
    compute_outcodes(positions, eye, planes, outcodes)
    faces = np.empty(vertex_idx.shape[1], np.uint32)
    return faces[: list_seen(vertex_idx, outcodes, faces)]


@kernel
def compute_outcodes(positions, eye, planes, out_outcodes):
    """Compute a bit for each plane that a vertex lies beyond.

    Parameters
    ----------
    positions : (n_vertex, 3) float64, world space, scene units
    eye : (3,) float64, world space · planes : (n_plane, 3) float64, see `list_seen_faces`
    out_outcodes : (n_vertex,) uint8
    """
    origin = eye[0], eye[1], eye[2]
    for k in range(len(out_outcodes)):
        away = subtract(vector_of_row(positions, k), origin)
        outcode = 0
        for plane in range(len(planes)):
            is_beyond = dot((planes[plane, 0], planes[plane, 1], planes[plane, 2]), away) < 0.0
            outcode |= np.int64(is_beyond) << np.int64(plane)
        out_outcodes[k] = outcode


@kernel
def list_seen(vertex_idx, outcodes, out_faces):
    """List the triangles whose vertices have no bit in common; return how many they are.

    Parameters
    ----------
    vertex_idx : (3, n_face) uint32
    outcodes : (n_vertex,) uint8
    out_faces : (n_face,) uint32
    """
    n = 0
    for face in range(vertex_idx.shape[1]):
        first, second, third = vertex_idx[0, face], vertex_idx[1, face], vertex_idx[2, face]
        out_faces[n] = face
        n += (outcodes[first] & outcodes[second] & outcodes[third]) == 0
    return n
