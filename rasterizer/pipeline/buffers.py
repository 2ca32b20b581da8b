"""Stage 7 for exact buffers: depth, face and normal of what is visible at each pixel's centre.

In:  the band's z-buffer, all of its words holding record numbers, and the records (float64).
Out: rows of the buffers. The z-buffer is left clean for the next band.
"""

from typing import NamedTuple

import numpy as np

from .._kernel import kernel
from .resolve import clean
from .scan import ATTRIBUTE, CLEAR, DX1, DX2, DY1, DY2, FACE, GROUP_SHIFT, INV_W, LEVEL_MASK, PAYLOAD_BITS, SIDE
from .shade import corner_weights
from .transform import HALF, SUBPIXEL


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
    n_covered = 0
    for j in range(n_row):
        group = np.uint64(j) >> np.uint64(GROUP_SHIFT)
        sy = (y_start + j) * SUBPIXEL + HALF
        y = np.uint64(y_start + j)
        for i in range(canvas.left[group], canvas.right[group]):
            word = canvas.words[np.uint64(j * canvas.pitch + i)]
            if word >= CLEAR:
                continue
            n_covered += 1
            record = np.uint64(word & LEVEL_MASK)
            integers, numbers = records.integers[record], records.numbers[record]
            q0, q1, q2 = corner_weights(integers, numbers, i * SUBPIXEL + HALF, sy)
            total = q0 + q1 + q2
            x, face = np.uint64(i), np.uint64(integers[FACE])
            if out.depth.shape[0] > 0:
                area = float(integers[DX1]) * integers[DY2] - float(integers[DX2]) * integers[DY1]
                if screen.is_perspective:
                    # A mean of 1/w may not leave its range by a rounding error.
                    inv_w = min(max(total / area, min(numbers[INV_W], numbers[INV_W + 1], numbers[INV_W + 2])),
                                max(numbers[INV_W], numbers[INV_W + 1], numbers[INV_W + 2]))  # fmt: skip
                    out.depth[y, x] = 1.0 / inv_w
                else:
                    z = float(word >> PAYLOAD_BITS)
                    out.depth[y, x] = (z - screen.z_offset) / screen.z_scale if screen.z_scale > 0 else screen.near
            if out.face.shape[0] > 0:
                out.face[y, x] = loaded_face[face] if len(loaded_face) > 0 else face
            if out.normal.shape[0] > 0:
                a = ATTRIBUTE
                nx = q0 * numbers[a] + q1 * numbers[a + 1] + q2 * numbers[a + 2]
                ny = q0 * numbers[a + 3] + q1 * numbers[a + 4] + q2 * numbers[a + 5]
                nz = q0 * numbers[a + 6] + q1 * numbers[a + 7] + q2 * numbers[a + 8]
                length = np.sqrt(nx * nx + ny * ny + nz * nz)
                scale = integers[SIDE] / length if length > 0 else 0.0
                normal = out.normal[y, x]
                normal[0], normal[1], normal[2] = nx * scale, ny * scale, nz * scale
    clean(canvas, n_row)
    return n_covered
