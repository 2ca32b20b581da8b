"""What all planes over a block of triangles are computed from (gradients.py, texture_planes.py).

Letters: w distance along the viewing axis, r = w_0/w the same inverted, with w_0 the nearest one that is seen. An index
0, 1, 2 is a vertex, x and y are slopes.
"""

from typing import NamedTuple

from ..compiler.kernels import helper
from . import setup as s

# How far a plane of depth may be off, z-buffer units, beside half a unit a step: half a unit at the anchor, and less
# than 39 of float64, see setup.MAX_LEVERAGE.
DEPTH_PLANE_ROUNDING = 40.0
# Where r is less, its inverse is no number that float32 is at home with.
LEAST_INVERSE = 2.0**-40


class DepthScale(NamedTuple):
    """What the z of an entry says, z-buffer units."""

    inv_w_offset: float  # 1/w = inv_w_offset + inv_w_scale · z; 1 + 0 z without perspective
    inv_w_scale: float
    depth_offset: float  # orthographic depth = depth_offset + depth_scale · z, scene units; 0 + 0 z in perspective
    depth_scale: float
    ratio_offset: float  # r = ratio_offset + ratio_scale · z; 1 + 0 z without perspective
    ratio_scale: float


@helper
def inverse_depths(k, depths, block):
    """Compute 1/w at the three vertices of triangle k."""
    z0, z1, z2 = block.reals[s.Z0 + k], block.reals[s.Z1 + k], block.reals[s.Z2 + k]
    offset, scale = depths.inv_w_offset, depths.inv_w_scale
    return offset + scale * z0, offset + scale * z1, offset + scale * z2


@helper
def straight_depths(k, depths, block):
    """Compute the depths without perspective at the three vertices of triangle k; with it all are 0."""
    z0, z1, z2 = block.reals[s.Z0 + k], block.reals[s.Z1 + k], block.reals[s.Z2 + k]
    offset, scale = depths.depth_offset, depths.depth_scale
    return offset + scale * z0, offset + scale * z1, offset + scale * z2


@helper
def inverse_ratios(k, depths, block):
    """Compute r at the three vertices of triangle k."""
    z0, z1, z2 = block.reals[s.Z0 + k], block.reals[s.Z1 + k], block.reals[s.Z2 + k]
    offset, scale = depths.ratio_offset, depths.ratio_scale
    return offset + scale * z0, offset + scale * z1, offset + scale * z2


@helper
def values_at(row, block):
    """Return an attribute of a triangle at the three vertices."""
    return block.reals[row], block.reals[row + s.NEXT], block.reals[row + s.NEXT + s.NEXT]


@helper
def compute_plane(k, plane, a0, a1, a2, block):
    """Compute a plane through the values at the vertices of triangle k; return how much it rises over the whole box."""
    ints, reals = block.ints, block.reals
    rise1, rise2 = a1 - a0, a2 - a0
    dx = rise1 * reals[s.SLOPE_X1 + k] + rise2 * reals[s.SLOPE_X2 + k]
    dy = rise1 * reals[s.SLOPE_Y1 + k] + rise2 * reals[s.SLOPE_Y2 + k]
    out = s.PLANE_ATTRIBUTE + plane * s.NEXT_PLANE + k
    reals[out] = a0 + dx * reals[s.OFFSET_X + k] + dy * reals[s.OFFSET_Y + k]
    reals[out + s.NEXT], reals[out + s.NEXT + s.NEXT] = dx, dy
    return abs(dx) * float(ints[s.EXTENT_X + k] + 1) + abs(dy) * float(ints[s.EXTENT_Y + k] + 1)


@helper
def depth_rounding(k, block):
    """Return how far the depth of a sample of triangle k may be off, in z-buffer units: see setup.py."""
    return 0.5 * float(block.ints[s.EXTENT_X + k] + block.ints[s.EXTENT_Y + k]) + DEPTH_PLANE_ROUNDING
