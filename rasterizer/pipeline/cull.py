"""Stage 3, setup: which triangles can touch a sample, and in which bands.

In:  index columns of the triangles and the vertices on the screen.
Out: `Visible`: the triangles that are left, in face order, each with the first and last band of scanlines that it
reaches.

A triangle is dropped when it has no area, when a vertex is OUTSIDE (the clip stage has put its parts in its place),
when it is culled, or when its box holds no sample of the picture. Blocks of triangles go through three passes, each of
which the compiler can vectorise or keep free of mispredicted branches: signed areas, compaction, boxes.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel
from .transform import HALF, OUTSIDE

BLOCK = 2048  # triangles a block: its scratch stays in the L1 cache
SUBPIXEL_SHIFT = 8  # log2 of SUBPIXEL


class Faces(NamedTuple):
    """Triangles as index columns, unsigned: signed ones would cost a wrap-around test at every access."""

    a: np.ndarray  # (n,) uint32 each, into the vertices
    b: np.ndarray
    c: np.ndarray


class Visible(NamedTuple):
    """What is left of a range of triangles."""

    face: np.ndarray  # (n,) uint32, ascending
    first_band: np.ndarray  # (n,) uint16, or uint32 where there are more bands
    last_band: np.ndarray  # the same, inclusive
    histogram: np.ndarray  # (n_band,) int64, triangles a band
    n_culled: int


@helper
def first_sample(coordinate):
    """Index of the first sample at or beyond a coordinate in 1/256 px; exact."""
    return (np.int64(coordinate) + HALF - 1) >> SUBPIXEL_SHIFT


def find_visible(faces, vertices, width, height, band_rows, cull_back, workers) -> list[Visible]:
    """Drop the triangles that can't be seen; one Visible for each part of the range of faces, in order."""
    n_band = -(-height // band_rows)
    number = np.uint16 if n_band <= 2**16 else np.uint32

    def find(part):
        n = part[1] - part[0]
        face, first, last = np.empty(n, np.uint32), np.empty(n, number), np.empty(n, number)
        histogram = np.zeros(n_band + 1, np.int64)
        n_kept, n_culled = find_visible_range(
            *part, faces, vertices, width, height, band_rows, cull_back, face, first, last, histogram
        )
        return Visible(face[:n_kept], first[:n_kept], last[:n_kept], histogram[:n_band], n_culled)

    return workers.map(find, workers.ranges(len(faces.a)))


@kernel
def find_visible_range(
    start, stop, faces, vertices, width, height, band_rows, cull_back, out_face, out_first, out_last, histogram
):
    """Write the visible triangles of start..stop to the out arrays; return how many, and how many were culled."""
    x, y = vertices.x, vertices.y
    keep = np.empty(BLOCK, np.uint8)
    candidates = np.empty(BLOCK, np.uint32)
    bands_a_row = 1.0 / band_rows
    n_kept = np.uint64(0)
    n_culled = 0
    for block in range(np.uint64(start), np.uint64(stop), np.uint64(BLOCK)):
        n = np.uint64(min(BLOCK, stop - block))
        n_culled += flag_by_area(faces.a[block : block + n], faces.b[block : block + n], faces.c[block : block + n],
                                 x, y, cull_back, keep)  # fmt: skip
        n_candidate = np.uint64(0)
        for k in range(n):
            candidates[n_candidate] = np.uint32(block + k)
            n_candidate += np.uint64(keep[k])
        for k in range(n_candidate):
            face = candidates[k]
            a, b, c = faces.a[face], faces.b[face], faces.c[face]
            left = first_sample(min(x[a], x[b], x[c]))
            right = first_sample(max(x[a], x[b], x[c]))
            top = max(first_sample(min(y[a], y[b], y[c])), 0)
            bottom = min(first_sample(max(y[a], y[b], y[c])), height)
            is_hit = (max(left, 0) < min(right, width)) & (top < bottom)
            # Quotients of integers: half a row more keeps the product further from a whole number than it is rounded.
            # So what is rounded down lies within 0..n_band - 1, as the rows do within 0..height.
            first = np.uint64((top + 0.5) * bands_a_row) if is_hit else np.uint64(0)
            last = np.uint64((bottom - 0.5) * bands_a_row) if is_hit else np.uint64(0)
            out_face[n_kept] = face
            out_first[n_kept] = first
            out_last[n_kept] = last
            n_kept += np.uint64(is_hit)
            histogram[first] += is_hit  # for now: how many more than in the band before
            histogram[last + np.uint64(1)] -= is_hit
    for band in range(1, len(histogram)):
        histogram[band] += histogram[band - 1]
    return n_kept, n_culled


@helper
def flag_by_area(a, b, c, x, y, cull_back, keep):
    """Set keep[k] = 1 for every triangle that has area and is not culled; return how many were culled."""
    n_culled = 0
    for k in range(len(a)):
        x0, y0 = np.int64(x[a[k]]), np.int64(y[a[k]])
        x1, y1 = np.int64(x[b[k]]), np.int64(y[b[k]])
        x2, y2 = np.int64(x[c[k]]), np.int64(y[c[k]])
        # Twice the signed area; the y axis points down, so counter-clockwise triangles are negative.
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        is_placed = (min(x0, x1, x2) != OUTSIDE) & (area != 0)
        is_culled = is_placed & cull_back & (area > 0)
        keep[k] = np.uint8(is_placed & (not is_culled))
        n_culled += is_culled
    return n_culled
