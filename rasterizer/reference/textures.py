"""What a texture shows at a point: wrap, filter and mip level, in float64.

Colours are mixed multiplied by their alpha, and divided by it at the end: clear texels count for nothing.
"""

import numpy as np
from numpy.typing import NDArray

from ..scene.texture import Texture


def without_repeats(corners: NDArray, wraps: tuple[str, str]) -> NDArray[np.float64]:
    """Return texture coordinates (n, 3, 2) of triangles' corners without whole repeats of the picture, so that large
    ones keep their digits when they are interpolated: each triangle's first corner lies in the first period."""
    for axis, wrap in enumerate(wraps):
        if wrap != "clamp":
            period = 2.0 if wrap == "mirror" else 1.0
            corners[..., axis] -= period * np.floor(corners[:, :1, axis] / period)
    return corners


def sample_texture(texture: Texture, uv: NDArray, steps: NDArray) -> NDArray[np.float64]:
    """Return what a texture shows at samples.

    Parameters
    ----------
    texture : its filter and wrap decide
    uv : (n, 2) float64, texture coordinates
    steps : (n, 2, 2) float64, derivatives of u and v (last axis) by one sample to the right and one down

    Returns
    -------
    (n, 4) float64, linear red, green, blue, and alpha
    """
    if texture.filter == "nearest":
        return _nearest(texture.image, uv, texture.wrap)
    if texture.filter == "bilinear":
        return _of_multiplied(_bilinear(texture.pyramid[0], uv, texture.wrap))
    mip_level = compute_mip_level(texture, steps)
    lower = np.floor(mip_level).astype(np.int64)
    texels = np.empty((len(uv), 4))
    for level in np.unique(lower):
        at = lower == level
        near = _bilinear(texture.pyramid[level], uv[at], texture.wrap)
        far = _bilinear(texture.pyramid[min(level + 1, len(texture.pyramid) - 1)], uv[at], texture.wrap)
        texels[at] = _mix(near, far, (mip_level[at] - level)[:, None])
    return _of_multiplied(texels)


def _of_multiplied(texels: NDArray) -> NDArray[np.float64]:
    """Return texels (n, 4) whose colours were multiplied by their alpha, divided by it; 0 where nothing is seen."""
    alpha = texels[:, 3:]
    return np.concatenate([texels[:, :3] / np.where(alpha > 0.0, alpha, 1.0), alpha], axis=1)


def alpha_of_picture(texture: Texture, uv: NDArray) -> NDArray[np.float64]:
    """Return the alpha (n,) of a texture's picture at texture coordinates (n, 2), by its filter but without mipmaps."""
    look_up = _nearest if texture.filter == "nearest" else _bilinear
    return look_up(texture.pyramid[0], uv, texture.wrap)[:, 3]


def compute_mip_level(texture: Texture, steps: NDArray) -> NDArray[np.float64]:
    """Return the mip level, (n,) float64 within 0..n_level - 1, for the derivatives (n, 2, 2) of u and v by samples.

    It is log2 of the texels of level 0 that the larger of the two steps moves.
    Sources: Williams 1983, Computer Graphics 17(3), 1-11; Heckbert 1983, NYIT, "Texture mapping polygons in
    perspective".
    """
    height, width = texture.image.shape[:2]
    moved = np.hypot(steps[..., 0] * width, steps[..., 1] * height).max(axis=1)
    return np.clip(np.log2(np.maximum(moved, 1.0)), 0.0, len(texture.pyramid) - 1)


def _nearest(level: NDArray, uv: NDArray, wrap: tuple[str, str]) -> NDArray[np.float64]:
    """Return the texels (n, 4) of a level (h, w, 4) that points (n, 2) lie in."""
    x, y = _texel_coordinates(level, uv)
    return _texels_at(level, np.floor(x), np.floor(y), wrap)


def _bilinear(level: NDArray, uv: NDArray, wrap: tuple[str, str]) -> NDArray[np.float64]:
    """Return the means (n, 4) of the four texels of a level (h, w, 4) whose centres lie round points (n, 2)."""
    x, y = (coordinate - 0.5 for coordinate in _texel_coordinates(level, uv))
    left, top = np.floor(x), np.floor(y)
    across, down = (x - left)[:, None], (y - top)[:, None]
    above, below = (
        _mix(_texels_at(level, left, row, wrap), _texels_at(level, left + 1, row, wrap), across)
        for row in (top, top + 1)
    )
    return _mix(above, below, down)


def _texel_coordinates(level: NDArray, uv: NDArray) -> tuple[NDArray, NDArray]:
    """Return where points lie on a level, in texels from its left border and from its upper one, (n,) each."""
    height, width = level.shape[:2]
    return uv[:, 0] * width, (1.0 - uv[:, 1]) * height


def _texels_at(level: NDArray, columns: NDArray, rows: NDArray, wrap: tuple[str, str]) -> NDArray[np.float64]:
    """Return the texels (n, 4) float64 with whole numbers (n,) as indices, wrapped."""
    height, width = level.shape[:2]
    return level[_wrap(rows, height, wrap[1]), _wrap(columns, width, wrap[0])].astype(np.float64)


def _wrap(index: NDArray, n: int, word: str) -> NDArray[np.int64]:
    """Bring whole numbers (n_sample,), kept as float64, into 0..n - 1; mirrored at the borders, -1 is 0 and n is n -
    1."""
    if word == "clamp":
        index = np.clip(index, 0, n - 1)
    elif word == "repeat":
        index = np.mod(index, n)
    else:
        index = np.mod(index, 2 * n)
        index = np.minimum(index, 2 * n - 1 - index)
    return index.astype(np.int64)


def _mix(a: NDArray, b: NDArray, part: NDArray) -> NDArray[np.float64]:
    """Interpolate between a and b, `part` from a; where both are equal nothing is rounded."""
    return a + part * (b - a)
