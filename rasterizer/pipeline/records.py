"""Records: what the scan stage leaves for the shade stage of every triangle whose samples are shaded later.

In:  a `Block` of setup.py with the planes of gradients.py.
Out: a row for each such triangle of the band. A record of planes holds them; an exact one holds the triangle itself.

A record of planes is 2^plane_shift numbers in a flat array, so that a record is found by a shift. The planes of four
attributes stand side by side, for simd.py:

    face  anchor x  anchor y  -  |  4 values  4 d/dx  4 d/dy  |  4 values  ...
                                   first group: channels or normals, 1/w; second: albedo
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index
from . import setup as s
from .face_planes import FACE_DEPTH, NO_PLANES
from .gradients import DISTANCE_PLANE, LEVEL_PLANES
from .simd import PLANE_GROUP

# Columns of an exact record's integers: the first vertex and the two edges that leave it (1/256 px), the triangle, and
# the side that is seen; the row of the planes of the clipped face that it is a part of, or -1.
EDGES, FACE, SIDE, CLIPPED_IDX = 0, 6, 7, 8
N_INTEGER = 9
# Columns of an exact record's reals: 1/w, depth (orthographic) and each attribute, each at the three vertices.
INV_W, DEPTH, ATTRIBUTE = 0, 3, 6
# Columns of a record of planes: the triangle, the sample where the planes are anchored, the planes; of the first group,
# the plane of 1/w or depth.
PLANES_FACE, PLANES_ANCHOR_X, PLANES_ANCHOR_Y, FIRST_PLANE = 0, 1, 2, 4
DISTANCE = 3


class Records(NamedTuple):
    """What the shade stage interpolates: a row for each triangle of the band whose entries hold an index."""

    integers: np.ndarray  # (n, N_INTEGER) int32
    reals: np.ndarray  # (n, ATTRIBUTE + 3 * n_attribute) float32 or float64
    int_planes: np.ndarray  # (n << plane_shift,) int32
    float_planes: np.ndarray  # the same memory as float32
    plane_shift: int
    clipped_planes: np.ndarray  # (n_clipped, 14) float64, see clip.Clipped: those of the picture, not of the band


def make_records(n, n_attribute, n_plane_group, dtype) -> Records:
    """Return room for n records of either kind.

    Only what is written to becomes memory, so both kinds may have room for every triangle.
    """
    shift = (FIRST_PLANE + 3 * PLANE_GROUP * n_plane_group - 1).bit_length()
    integers, reals = np.zeros((n, N_INTEGER), np.int32), np.zeros((n, ATTRIBUTE + 3 * n_attribute), dtype)
    int_planes = np.zeros(n << shift, np.int32)
    return Records(integers, reals, int_planes, int_planes.view(np.float32), shift, NO_PLANES)


@helper
def write_planes(records, n_record, k, face, n_attribute, coding, block):
    """Write record number `n_record`: the planes of triangle k of the block.

    Parameters
    ----------
    face : the triangle's index in the picture
    """
    ints = block.ints
    record = index(n_record) << index(records.plane_shift)
    planes = records.int_planes
    planes[record + index(PLANES_FACE)] = face
    planes[record + index(PLANES_ANCHOR_X)] = ints[s.ANCHOR_X + k]
    planes[record + index(PLANES_ANCHOR_Y)] = ints[s.ANCHOR_Y + k]
    first = record + index(FIRST_PLANE)
    if coding.kind == LEVEL_PLANES:
        write_levels(planes, first, k, coding.level_scale, block)
    else:
        write_normals(records.float_planes, first, k, n_attribute, coding.needs_distance, coding.normal_limit, block)


@helper
def write_levels(planes, first, k, level_scale, block):
    """Write the planes of levels of triangle k to a record; `level_scale` is None where a coding has none."""
    if level_scale is not None:
        # A value may leave 32 bits where the plane is extrapolated; inside the triangle arithmetic modulo 2^32 is right
        # again.
        copy_planes(block.longs, s.PLANE_LEVEL + k, index(3), planes, first)


@helper
def write_normals(planes, first, k, n_attribute, needs_distance, normal_limit, block):
    """Write the planes of normals of triangle k, and what stands behind them, to a record; `normal_limit` is None where
    a coding has none."""
    if normal_limit is not None:
        copy_planes(block.reals, s.PLANE_ATTRIBUTE + k, index(3), planes, first)
        if needs_distance:
            source = s.PLANE_ATTRIBUTE + index(DISTANCE_PLANE) * s.NEXT_PLANE + k
            copy_planes(block.reals, source, index(1), planes, first + index(DISTANCE))
        if n_attribute > 3:
            source = s.PLANE_ATTRIBUTE + index(3) * s.NEXT_PLANE + k
            copy_planes(block.reals, source, index(3), planes, first + index(3 * PLANE_GROUP))


@helper
def copy_planes(rows, source, n, planes, target):
    """Copy the planes of n, an `index`, neighbouring attributes from a block's rows to a record."""
    for attribute in range(n):
        for part in range(index(3)):
            value = rows[source + attribute * s.NEXT_PLANE + part * s.NEXT]
            planes[target + attribute + part * index(PLANE_GROUP)] = planes.dtype.type(value)


@helper
def write_exact(records, n_record, k, face, n_attribute, coding, block):
    """Write record number `n_record`: where triangle k lies on the screen; 1/w, depth and attributes of its corners.

    Of a part of a clipped face the depths and attributes are those of the face's corners, and the weights come from its
    planes.

    Parameters
    ----------
    face : the triangle's index in the picture
    """
    ints, reals = block.ints, block.reals
    row, integers, out = index(n_record), records.integers, records.reals
    x0, y0 = np.int64(ints[s.X0 + k]), np.int64(ints[s.Y0 + k])
    edges = (x0, y0, ints[s.X1 + k] - x0, ints[s.Y1 + k] - y0, ints[s.X2 + k] - x0, ints[s.Y2 + k] - y0)
    for column in range(6):
        integers[row, index(EDGES + column)] = edges[column]
    integers[row, FACE] = face
    integers[row, SIDE] = -1 if ints[s.IS_FLIPPED + k] else 1
    clipped = ints[s.CLIPPED_IDX + k]
    integers[row, CLIPPED_IDX] = clipped
    for corner in range(index(3)):
        z = reals[s.Z0 + corner * s.NEXT + k]
        out[row, index(INV_W) + corner] = coding.inv_w_offset + coding.inv_w_scale * z
        out[row, index(DEPTH) + corner] = coding.depth_offset + coding.depth_scale * z
    if clipped >= 0:
        for corner in range(index(3)):
            out[row, index(DEPTH) + corner] = records.clipped_planes[index(clipped), index(FACE_DEPTH) + corner]
    for column in range(index(3 * n_attribute)):
        out[row, index(ATTRIBUTE) + column] = reals[s.ATTRIBUTE + column * s.NEXT + k]
