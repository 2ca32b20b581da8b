"""Stage 7 for exact buffers: depth, face and normal of what is visible at each pixel's centre.

In:  the band's visibility buffer, all of its entries indices of exact records, and the records (float64).
Out: rows of the buffers. The visibility buffer is left clear for the next band.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import borrow, helper, index, kernel
from ..geometry.vectors import length, scale
from .interpolate import corner_vectors, corner_weights, depth_at, exact_triangle, mean_vector
from .records import FACE, SIDE, borrow_records
from .visibility import CLEAR, RECORD_MASK, clear, strip_of


class Buffers(NamedTuple):
    """What is written; an array that isn't wanted has no rows."""

    depth: np.ndarray  # (height, width) float32, distance along the viewing axis, scene units; inf where nothing is
    face: np.ndarray  # (height, width) int32; -1 where nothing is
    normal: np.ndarray  # (height, width, 3) float32, unit length, towards the viewer, world space; 0 where nothing is


def empty_buffers(size, names) -> Buffers:
    """Return buffers with nothing visible, of `size` = (width, height) pixels; those that aren't named have no rows."""
    width, height = size

    def n_row(name):
        return height if name in names else 0

    return Buffers(
        np.full((n_row("depth"), width), np.inf, np.float32),
        np.full((n_row("face"), width), -1, np.int32),
        np.zeros((n_row("normal"), width, 3), np.float32),
    )


@kernel
def write_buffers(visibility, records, loaded_faces, band, screen, out):
    """Write a band's rows of the buffers; clear the band; return how many samples are covered.

    Parameters
    ----------
    loaded_faces : (n_face,) uint32, the face that each triangle is a part of; empty where no face was clipped
    band : Band
    screen : Screen
    out : Buffers
    """
    entries, records = borrow(visibility.entries), borrow_records(records)
    out_depth, out_face, out_normal = borrow(out.depth), borrow(out.face), borrow(out.normal)
    n_covered = 0
    for row in range(band.y_end - band.y_start):
        strip = strip_of(row)
        y = index(band.y_start + row)
        for i in range(visibility.left[strip], visibility.right[strip]):
            entry = entries[index(row * visibility.pitch + i)]
            if entry >= CLEAR:
                continue
            n_covered += 1
            x, record = index(i), index(entry & RECORD_MASK)
            if out_face.shape[0] > 0:
                face = records.integers[record, FACE]
                out_face[y, x] = loaded_faces[index(face)] if len(loaded_faces) > 0 else face
            triangle = exact_triangle(records, record)
            q = corner_weights(triangle, i, band.y_start + row)
            if out_depth.shape[0] > 0:
                out_depth[y, x] = depth_at(records, record, triangle, q, screen.is_perspective)
            if out_normal.shape[0] > 0:
                total = q[0] + q[1] + q[2]
                normal = normal_of(records, record, (q[0] / total, q[1] / total, q[2] / total))
                out_normal[y, x, 0], out_normal[y, x, 1], out_normal[y, x, 2] = normal
    clear(visibility, band.y_end - band.y_start)
    return n_covered


@helper
def normal_of(records, record, p):
    """Interpolate the normal of an exact record with weights p_i, Σ p_i = 1: unit length, on the side that is seen."""
    normal = mean_vector(corner_vectors(records, record, 0), p)
    norm = length(normal)
    return scale(normal, records.integers[record, SIDE] / norm if norm > 0 else 0.0)
