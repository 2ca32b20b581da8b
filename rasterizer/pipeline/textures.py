"""The textures of a scene as arrays, with float32 texels, as exact look-ups read them (texture_sampling.py)."""

from typing import NamedTuple

import numpy as np

FILTER_NEAREST, FILTER_BILINEAR, FILTER_TRILINEAR = 0, 1, 2
WRAP_REPEAT, WRAP_CLAMP, WRAP_MIRROR = 0, 1, 2  # what lies outside the picture


class Textures(NamedTuple):
    """All textures of a scene, one mip level behind the other in one array."""

    texels: np.ndarray  # (4 * n_texel,) float32: linear red, green, blue, and alpha of each
    mip_levels: np.ndarray  # (n_level, 3) int64: first texel, width, height
    first_levels: np.ndarray  # (n_texture + 1,) int64
    filters: np.ndarray  # (n_texture,) int64, FILTER_...
    wraps: np.ndarray  # (n_texture, 2) int64, WRAP_... along u and v
    of_materials: np.ndarray  # (n_material,) int64, the texture of each, -1 for none
