"""The textures of the judge: what a picture laid over a surface shows at a sample, in plain numpy float64.

In: texture coordinates u, v, and what they change by from one sample of the picture to the next. Out: linear RGB, and
alpha.

    v = 1 ┌───┬───┬───┐ row 0     a picture of w × h texels: texel (i, j) covers i/w <= u < (i + 1)/w and
          │   │   │ · │           j/h < 1 - v <= (j + 1)/h; its centre lies at u·w = i + ½, (1 - v)·h = j + ½
    v = 0 └───┴───┴───┘ row h-1
        u = 0       u = 1

Alpha is interpolated as the colours are, and multiplies nothing here.
"""

import numpy as np

from ..scene.texture import Texture


def look_up(texture: Texture, uv, steps) -> np.ndarray:
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
        return _bilinear(texture.image, uv, texture.wrap)
    detail = level_of_detail(texture, steps)
    lower = np.floor(detail).astype(np.int64)
    texels = np.empty((len(uv), 4))
    for level in np.unique(lower):
        at = lower == level
        near = _bilinear(texture.pyramid[level], uv[at], texture.wrap)
        far = _bilinear(texture.pyramid[min(level + 1, len(texture.pyramid) - 1)], uv[at], texture.wrap)
        texels[at] = _mix(near, far, (detail[at] - level)[:, None])
    return texels


def level_of_detail(texture: Texture, steps) -> np.ndarray:
    """Return the level of the mipmap, (n,) float64 within 0..n_level - 1, for the derivatives (n, 2, 2) of u and v by
    samples.

    It is log2 of the texels of level 0 that the larger of the two steps moves.
    Sources: Williams 1983, Computer Graphics 17(3), 1-11; Heckbert 1983, NYIT, "Texture mapping polygons in
    perspective".
    """
    height, width = texture.image.shape[:2]
    moved = np.hypot(steps[..., 0] * width, steps[..., 1] * height).max(axis=1)
    return np.clip(np.log2(np.maximum(moved, 1.0)), 0.0, len(texture.pyramid) - 1)


def _nearest(level, uv, wrap) -> np.ndarray:
    """Return the texels (n, 4) of a level (h, w, 4) that points (n, 2) lie in."""
    x, y = _texel_place(level, uv)
    return _texels_at(level, np.floor(x), np.floor(y), wrap)


def _bilinear(level, uv, wrap) -> np.ndarray:
    """Return the means (n, 4) of the four texels of a level (h, w, 4) whose centres lie round points (n, 2)."""
    x, y = (place - 0.5 for place in _texel_place(level, uv))
    left, top = np.floor(x), np.floor(y)
    across, down = (x - left)[:, None], (y - top)[:, None]
    above, below = (
        _mix(_texels_at(level, left, row, wrap), _texels_at(level, left + 1, row, wrap), across)
        for row in (top, top + 1)
    )
    return _mix(above, below, down)


def _texel_place(level, uv):
    """Return where points lie on a level, in texels from its left border and from its upper one, (n,) each."""
    height, width = level.shape[:2]
    return uv[:, 0] * width, (1.0 - uv[:, 1]) * height


def _texels_at(level, columns, rows, wrap) -> np.ndarray:
    """Return the texels (n, 4) float64 with whole numbers (n,) as indices, wrapped."""
    height, width = level.shape[:2]
    return level[_wrap(rows, height, wrap[1]), _wrap(columns, width, wrap[0])].astype(np.float64)


def _wrap(index, n: int, word: str) -> np.ndarray:
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


def _mix(a, b, part) -> np.ndarray:
    """Go the share `part` of the way from a to b; where both are equal nothing is rounded."""
    return a + part * (b - a)
