"""Stage 7 for exact buffers: depth, face and normal of what is visible at each pixel's centre.

In:  the band's z-buffer, all of its words holding record numbers, and the records (float64).
Out: rows of the buffers. The z-buffer is left clean for the next band.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import borrow, kernel
from .interpolate import corner_values, corner_weights, depth_at, exact_triangle, mean
from .records import ATTRIBUTE, FACE, RECORD_MASK, SIDE, borrow_records
from .resolve import clean
from .scan import CLEAR, GROUP_SHIFT


class Buffers(NamedTuple):
    """What is written; an array that isn't wanted has no rows."""

    depth: np.ndarray  # (height, width) float32, distance along the viewing axis, scene units; inf where nothing is
    face: np.ndarray  # (height, width) int32; -1 where nothing is
    normal: np.ndarray  # (height, width, 3) float32, unit length, towards the viewer, world space; 0 where nothing is


@kernel
def write_buffers(canvas, records, loaded_face, y_start, n_row, screen, out):
    """Write n_row rows of the buffers from y_start on; clean the band; return how many samples are covered.

    `loaded_face` is the face that each triangle is a part of, or empty where no face was clipped.
    """
    words, records = borrow(canvas.words), borrow_records(records)
    integers, numbers = records.integers, records.numbers
    out_depth, out_face, out_normal = borrow(out.depth), borrow(out.face), borrow(out.normal)
    n_covered = 0
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(GROUP_SHIFT)
        y = np.uint64(y_start + j)
        for i in range(canvas.left[group], canvas.right[group]):
            word = words[np.uint64(j * canvas.pitch + i)]
            if word >= CLEAR:
                continue
            n_covered += 1
            x, record = np.uint64(i), np.uint64(word & RECORD_MASK)
            if out_face.shape[0] > 0:
                face = integers[record, np.uint64(FACE)]
                out_face[y, x] = loaded_face[np.uint64(face)] if len(loaded_face) > 0 else face
            triangle = exact_triangle(records, record)
            q = corner_weights(triangle, i, y_start + j)
            if out_depth.shape[0] > 0:
                out_depth[y, x] = depth_at(records, record, triangle, q, screen.is_perspective)
            if out_normal.shape[0] > 0:
                total = q[0] + q[1] + q[2]
                p = (q[0] / total, q[1] / total, q[2] / total)
                nx = mean(corner_values(numbers, record, ATTRIBUTE), p)
                ny = mean(corner_values(numbers, record, ATTRIBUTE + 3), p)
                nz = mean(corner_values(numbers, record, ATTRIBUTE + 6), p)
                length = np.sqrt(nx * nx + ny * ny + nz * nz)
                scale = integers[record, np.uint64(SIDE)] / length if length > 0 else 0.0
                out_normal[y, x, 0], out_normal[y, x, 1], out_normal[y, x, 2] = nx * scale, ny * scale, nz * scale
    clean(canvas, n_row)
    return n_covered
