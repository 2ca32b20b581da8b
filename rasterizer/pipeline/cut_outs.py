"""Cut-outs: samples of a triangle that are not there, because a texture's alpha is below the cutoff of the material.

They are left out while the triangle is scanned: so nothing is there for pictures, buffers, shadows and edges alike. A
sample's texture coordinates are exact, in float64: (Σ q_i·u_i)/Σ q_i with q_i = e_i/w_i and the edge functions e_i, as
in interpolate.py. The alpha is that of the picture itself, without mip levels: by the filter "nearest" that of the
texel that the sample lies in, else the bilinear mean of four.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper
from ..geometry.vectors import dot
from . import setup as s
from .setup import DepthScale, ExactTriangle, corner_weights, inverse_sum
from .textures import FILTER_NEAREST, Texture, Textures, texture_of, without_repeats, wrap_texcoord


class CutOuts(NamedTuple):
    """Which alpha the samples of a picture must have."""

    thresholds: np.ndarray  # (n_material,) float64: of a texture, at least; 0 where all is there, inf where nothing is
    textures: Textures | None  # None where no material has one
    uv: np.ndarray  # (n_point, 2 or more) float64, texture coordinates
    depths: DepthScale


class CutOut(NamedTuple):
    """What says of one triangle which samples are there."""

    threshold: float
    texture: Texture
    triangle: ExactTriangle
    u: tuple  # texture coordinates at the three corners, float64
    v: tuple


@helper
def threshold_of(k, cut_outs, block):
    """Return the alpha that samples of triangle k of the block must have; 0 where all are there."""
    if cut_outs is not None:
        return cut_outs.thresholds[block.ints[s.MATERIAL + k]]
    return 0.0


@helper
def cut_out_of(k, triangle, cut_outs, block):
    """Return what says which samples of triangle k of the block, a Triangle of scan.py, are there; None where no
    texture does."""
    if cut_outs is not None:
        return cut_out_with(k, triangle, cut_outs, cut_outs.textures, block)
    return None


@helper
def cut_out_with(k, triangle, cut_outs, textures, block):
    """See `cut_out_of`; `textures` are those of `cut_outs`."""
    if textures is not None:
        material = np.int64(block.ints[s.MATERIAL + k])
        ints, depths, uv = block.ints, cut_outs.depths, cut_outs.uv
        x0, y0, x1, y1, x2, y2 = triangle
        dx1, dy1, dx2, dy2 = x1 - x0, y1 - y0, x2 - x0, y2 - y0
        c0, c1, c2 = np.uint32(ints[s.CORNER0 + k]), np.uint32(ints[s.CORNER1 + k]), np.uint32(ints[s.CORNER2 + k])
        inv_w = s.linear_in_z(k, depths.inv_w_offset, depths.inv_w_scale, block)
        texture = texture_of(textures, material)
        u = without_repeats((uv[c0, 0], uv[c1, 0], uv[c2, 0]), texture.wraps[0])
        v = without_repeats((uv[c0, 1], uv[c1, 1], uv[c2, 1]), texture.wraps[1])
        exact = ExactTriangle(x0, y0, dx1, dy1, dx2, dy2, inv_w, float(dx1 * dy2 - dx2 * dy1))
        return CutOut(cut_outs.thresholds[material], texture, exact, u, v)
    return None


@helper
def is_there(cut, x, y):
    """Tell whether a sample of the triangle is there."""
    q = corner_weights(cut.triangle, x, y)
    inverse = inverse_sum(q)
    return alpha_at(cut.texture, dot(q, cut.u) * inverse, dot(q, cut.v) * inverse) >= cut.threshold


@helper
def alpha_at(texture, u, v):
    """Return the alpha of a texture's picture, float64."""
    across = wrap_texcoord(u, texture.wraps[0]) * float(texture.width)
    down = wrap_texcoord(1.0 - v, texture.wraps[1]) * float(texture.height)
    pitch = np.int64(texture.width + 2)
    if texture.filter == FILTER_NEAREST:
        return alpha_of_texel(texture, np.int64(np.floor(across)) + 1 + (np.int64(np.floor(down)) + 1) * pitch)
    left, top = np.floor(across - 0.5), np.floor(down - 0.5)
    texel = np.int64(left) + 1 + (np.int64(top) + 1) * pitch
    right, below = across - 0.5 - left, down - 0.5 - top
    above = mixed(alpha_of_texel(texture, texel), alpha_of_texel(texture, texel + 1), right)
    under = mixed(alpha_of_texel(texture, texel + pitch), alpha_of_texel(texture, texel + pitch + 1), right)
    return mixed(above, under, below)


@helper
def alpha_of_texel(texture, texel):
    """Return the alpha of a texel of the picture with its border, float64."""
    return np.float64(texture.texels[(texel << 2) + 3])


@helper
def mixed(a, b, fraction):
    """Return what lies the fraction 0..1 of the way from a to b."""
    return a + fraction * (b - a)
