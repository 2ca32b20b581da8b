"""Stage 3, cull: which triangles can touch a sample, and in which bands.

In:  index columns of the triangles and the vertices on the screen.
Out: `Visible`: the triangles that are left, in face order, each with the first and last band of scanlines that it
     reaches.

A triangle is dropped when it has no area, when a vertex is OUTSIDE (the clip stage has put its parts in its place),
when its back is seen and backs are culled, or when its box holds no sample of the picture. PASS triangles at a time go
through three loops, each of which the compiler can vectorise or keep free of mispredicted branches: signed areas,
compaction, boxes.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from .transform import HALF, OUTSIDE

PASS = 2048  # triangles: what is noted of them on the way stays in the L1 cache
SUBPIXEL_SHIFT = 8  # log2 of SUBPIXEL


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


class CullScratch(NamedTuple):
    """What is noted of PASS triangles between the three loops."""

    is_kept: np.ndarray  # (PASS,) uint8
    candidates: np.ndarray  # (PASS,) uint32


def make_cull_scratch() -> CullScratch:
    """Return room for what is noted of PASS triangles."""
    return CullScratch(np.empty(PASS, np.uint8), np.empty(PASS, np.uint32))


@helper
def first_sample(coordinate):
    """Compute the column or row of the first sample at or beyond a coordinate in 1/256 px, int64; exact."""
    return (np.int64(coordinate) + HALF - 1) >> SUBPIXEL_SHIFT


def find_visible(vertex_idx, vertices, grid: Grid, cull_back, workers) -> list[Visible]:
    """Drop the triangles that can't be seen; one Visible for each part of the range of faces, in order.

    Parameters
    ----------
    vertex_idx : (3, n) uint32, as in Triangles
    vertices : Vertices
    cull_back : bool, drop triangles that are seen clockwise
    """
    n_band = -(-grid.height // grid.band_rows)
    dtype = np.uint16 if n_band <= 2**16 else np.uint32

    def find(part):
        n = part[1] - part[0]
        out = Visible(np.empty(n, np.uint32), np.empty(n, dtype), np.empty(n, dtype), np.zeros(n_band + 1, np.int64), 0)
        n_kept, n_culled = find_visible_range(*part, vertex_idx, vertices, grid, cull_back, make_cull_scratch(), out)
        return Visible(*(column[:n_kept] for column in out[:3]), out.histogram[:n_band], n_culled)

    return workers.map(find, workers.ranges(vertex_idx.shape[1]))


@kernel
def find_visible_range(start, end, vertex_idx, vertices, grid, cull_back, scratch, out):
    """Write the visible ones of the triangles start..end to `out`; return how many they are, and how many were culled.

    Parameters
    ----------
    vertex_idx : (3, n) uint32
    scratch : CullScratch
    out : Visible with room for all triangles; its histogram is zero and has n_band + 1 places
    """
    a, b, c = vertex_idx[0], vertex_idx[1], vertex_idx[2]
    x, y = vertices.x, vertices.y
    out_faces, out_first, out_last, histogram = out.faces, out.first_bands, out.last_bands, out.histogram
    is_kept, candidates = scratch.is_kept, scratch.candidates
    bands_a_row = 1.0 / grid.band_rows
    n_kept = index(0)
    n_culled = 0
    for first_face in range(index(start), index(end), index(PASS)):
        n = index(min(PASS, end - np.int64(first_face)))
        end_face = first_face + n
        n_culled += flag_by_area(a[first_face:end_face], b[first_face:end_face], c[first_face:end_face],
                                 x, y, cull_back, is_kept)  # fmt: skip
        n_candidate = index(0)
        for k in range(n):
            candidates[n_candidate] = np.uint32(first_face + k)
            n_candidate += index(is_kept[k])
        for k in range(n_candidate):
            face = candidates[k]
            v0, v1, v2 = a[face], b[face], c[face]
            left = first_sample(min(x[v0], x[v1], x[v2]))
            right = first_sample(max(x[v0], x[v1], x[v2]))
            top = max(first_sample(min(y[v0], y[v1], y[v2])), 0)
            bottom = min(first_sample(max(y[v0], y[v1], y[v2])), grid.height)
            is_hit = (max(left, 0) < min(right, grid.width)) & (top < bottom)
            # Quotients of integers: half a row more keeps the product further from a whole number than it is rounded.
            # So what is rounded down lies within 0..n_band - 1, as the rows do within 0..height.
            first = index((top + 0.5) * bands_a_row) if is_hit else index(0)
            last = index((bottom - 0.5) * bands_a_row) if is_hit else index(0)
            out_faces[n_kept] = face
            out_first[n_kept] = first
            out_last[n_kept] = last
            n_kept += index(is_hit)
            histogram[first] += is_hit  # for now: how many more than in the band before
            histogram[last + index(1)] -= is_hit
    for band in range(1, len(histogram)):
        histogram[band] += histogram[band - 1]
    return np.int64(n_kept), n_culled


@helper
def flag_by_area(a, b, c, x, y, cull_back, is_kept):
    """Set is_kept[k] to 1 for every triangle that has area and is not culled, else to 0; return how many were culled.

    Parameters
    ----------
    a, b, c : (n,) uint32, vertices of the triangles
    x, y : (n_vertex,) int32, 1/256 px
    is_kept : (PASS,) uint8
    """
    n_culled = 0
    for k in range(len(a)):
        x0, y0 = np.int64(x[a[k]]), np.int64(y[a[k]])
        x1, y1 = np.int64(x[b[k]]), np.int64(y[b[k]])
        x2, y2 = np.int64(x[c[k]]), np.int64(y[c[k]])
        # Twice the signed area; the y axis points down, so counter-clockwise triangles are negative.
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        is_placed = (min(x0, x1, x2) != OUTSIDE) & (area != 0)
        is_culled = is_placed & cull_back & (area > 0)
        is_kept[k] = np.uint8(is_placed & (not is_culled))
        n_culled += is_culled
    return n_culled
