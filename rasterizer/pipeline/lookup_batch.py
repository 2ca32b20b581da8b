"""The batch of samples that a texture is looked up for (texture_lookup.py): which quantity stands where.

One flat array of float32, one quantity after the other, each for BATCH_SIZE samples, as in fragments.py. Whole numbers
stand in it, too: as the float32 with the same 32 bits.

    s, t     texture coordinates in texels of the picture: s to the right, t downwards, (0, 0) its upper left corner
    s', t'   s - s_ref, t - t_ref, relative to references that a triangle has (`texcoord_references`)
    S, T, D  s'/w, t'/w and 1/w: linear on the screen
"""

import numpy as np

from ..compiler.kernels import helper, index
from .fragments import BATCH_SIZE


def _quantity(number):
    """Return where a quantity begins in a batch."""
    return index(BATCH_SIZE * number)


# What is given of each sample: four planes of its record and, for mip levels, the slopes of three of them
# (texture_planes.py).
S_PLANE, T_PLANE, INV_W, REFERENCES = (_quantity(k) for k in range(4))
S_DX, T_DX, INV_W_DX, S_DY, T_DY, INV_W_DY = (_quantity(k) for k in range(4, 10))
# What comes of it: s', t' and w in the first rows; s and t in fixed point, the mip level.
S_OFFSET, T_OFFSET, W = S_PLANE, T_PLANE, INV_W
S, T, MIP_LEVEL = (_quantity(k) for k in range(10, 13))
# Then, in place of the planes: the texels up left and down left of the sample (whole numbers), the weights of the two
# on the left and of the two on the right (two of 16 bits); all four of the next mip level, too; the share of that one.
TOP, BOTTOM, LEFT_WEIGHTS, RIGHT_WEIGHTS = (_quantity(k) for k in range(4))
NEXT_MIP_LEVEL, SHARE = _quantity(4), _quantity(8)
TEXEL, IS_DOUBTFUL = TOP, MIP_LEVEL  # of the filter "nearest"; doubtful is 1, and 0 certain
TEXEL_ROWS = TOP, BOTTOM, LEFT_WEIGHTS, RIGHT_WEIGHTS
MIP_LEVEL_ROWS = (*TEXEL_ROWS, *(row + NEXT_MIP_LEVEL for row in TEXEL_ROWS), SHARE)
LOOKUP_SHAPE = (13 * BATCH_SIZE,)

ONE, ZERO = np.int32(1), np.int32(0)


def make_lookup_batch() -> np.ndarray:
    """Return room for the samples of a batch: LOOKUP_SHAPE zeros of float32."""
    return np.zeros(LOOKUP_SHAPE, np.float32)


@helper
def bits_of(number):
    """Return the 32 bits of a float32 as a whole number."""
    return np.float32(number).view(np.int32)


@helper
def from_bits(bits):
    """Return the float32 with these 32 bits: so whole numbers stand in the rows of a batch."""
    return np.int32(bits).view(np.float32)
