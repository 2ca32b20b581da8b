"""Stage 7 for buffers that follow from the visible triangle and the pixel's centre: masks, labels, and means of what
the corners of the faces have.

In:  what buffers.py works on, and a table: a label for each face, or values for the corners of each triangle.
Out: the band's rows of a buffer.

A mean is Σ p_i·a_i with the perspective weights p_i of interpolate.py, in float64, rounded once to float32. The weights
come in the order of the record, which begins at the topmost vertex; the table is in the order of the file.
`corner_order` tells which is which.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from .buffers import triangle_of, write_normal
from .interpolate import corner_weights, mean, row_extent, run_end
from .records import face_of
from .visibility import CLEAR
from .visible_triangles import fetch_positions, order_of, ordered


class CornerTable(NamedTuple):
    """What the corners of triangles have: rows of values, and which row belongs to which corner."""

    values: np.ndarray  # (n, n_component) float64
    rows: np.ndarray  # (3, n_triangle) uint32, of the triangles before any is clipped, corners in the order of the file


@kernel
def write_mask(surfaces, band, out):
    """Write where something is visible: out is (height, width) bool."""
    visibility = surfaces.visibility
    for row in range(band.y_end - band.y_start):
        y, (left, right) = band.y_start + row, row_extent(visibility, row)
        for x in range(left, right):
            out[index(y), index(x)] = visibility.entries[index(row * visibility.pitch + x)] < CLEAR


@kernel
def write_label(surfaces, band, out, labels):
    """Write the label of the visible face: out is (height, width) int32, `labels` (n_face,) int32 of loaded faces."""
    visibility, records, loaded_faces = surfaces.visibility, surfaces.records, surfaces.loaded_faces
    for row in range(band.y_end - band.y_start):
        y, (left, right) = band.y_start + row, row_extent(visibility, row)
        for x in range(left, right):
            entry = visibility.entries[index(row * visibility.pitch + x)]
            if entry < CLEAR:
                face = face_of(entry, records)
                loaded = index(loaded_faces[face]) if len(loaded_faces) > 0 else face
                out[index(y), index(x)] = labels[loaded]


@kernel
def write_mean(surfaces, band, out, table):
    """Write the means of what the corners of the visible triangles have: out is (height, width, n_component) float32,
    `table` a CornerTable."""
    visibility = surfaces.visibility
    for row in range(band.y_end - band.y_start):
        y, (left, right) = band.y_start + row, row_extent(visibility, row)
        if left >= right:
            continue
        first = row * visibility.pitch + left
        entries = visibility.entries[index(first) : index(first + right - left)]
        here = out[index(y), index(left) : index(right)]
        start = index(0)
        while start < index(len(entries)):
            end = run_end(entries, start)
            if entries[start] < CLEAR:
                triangle, _ = triangle_of(entries[start], surfaces)
                corners = table_rows(face_of(entries[start], surfaces.records), surfaces, table)
                fill_means(triangle, corners, table.values, left + np.int64(start), y, here[start:end])
            start = end


@helper
def table_rows(face, surfaces, table):
    """Return the rows of a table for the corners of a triangle of the picture, in the order of its record."""
    sources = surfaces.sources
    source = index(sources[face]) if len(sources) > 0 else face
    i, j, k = corner_order(face, surfaces.drawables)
    return index(table.rows[i, source]), index(table.rows[j, source]), index(table.rows[k, source])


@helper
def corner_order(face, drawables):
    """Return which corner of a triangle each corner of its record is; parts of clipped faces have those of the face."""
    i, j, k = index(0), index(1), index(2)
    clipped_idx = drawables.triangles.clipped_idx
    is_whole = len(clipped_idx) == 0 or clipped_idx[face] < 0
    if is_whole:
        xs, ys = fetch_positions(face, drawables)
        i, j, k = ordered((i, j, k), order_of(xs, ys))
    return i, j, k


@helper
def fill_means(triangle, corners, values, x, y, out):
    """Interpolate the values of three corners at a run of samples from (x, y) on: out is (n, n_component)."""
    a, b, c = corners
    for k in range(index(out.shape[0])):
        q = corner_weights(triangle, x + np.int64(k), y)
        total = q[0] + q[1] + q[2]
        p = (q[0] / total, q[1] / total, q[2] / total)
        for component in range(index(out.shape[1])):
            out[k, component] = mean((values[a, component], values[b, component], values[c, component]), p)


def write_turned_normal(surfaces, band, out, rotation):
    """Write the unit normal, turned by a rotation: out is (height, width, 3) float32, `rotation` (3, 3) float64.

    The normal is rounded to float32 before and after. A component of it is off by 2^-25 at most, so the turned one by
    √3·2^-25 and its own rounding: less than 2^-23.
    """
    write_normal(surfaces, band, out)
    rows = out[band.y_start : band.y_end]
    rows[...] = rows @ rotation.T + 0.0  # no -0 where nothing is
