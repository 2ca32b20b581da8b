"""The shadow of the ground under a picture: for each pixel that shows the ground, how dark it is there.

The camera is above the ground and the scene, too: so a ray meets the scene before the ground, and the shadow lies under
the picture as Porter & Duff's "over" says (1984, "Compositing Digital Images").
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel
from ..geometry.vectors import add, scale
from .resolve import encode_alpha, encode_channel, pack_bytes

LOWEST = np.float32(1e-30)  # alpha that colours are divided by


class SeenGround(NamedTuple):
    """The shadow, and where a picture shows it."""

    # (n + 2, m + 2) float32, opacity of the ground at n rows of m texels, with a rim of 0 round them
    shadow: np.ndarray
    # (3, 3) float64, each a·x + b·y + c at the pixels' coordinates (x, y): the ray through a pixel meets the ground in
    # column first/third and row second/third of texels, before the camera where the third is above 0.
    planes: np.ndarray
    columns: np.ndarray  # (height, 2) int64: first and end of the pixels of each row that may show shadow
    across: np.ndarray  # (width,) float32, what the opacity is multiplied by in each column
    along: np.ndarray  # (height,) float32, likewise in each row


@kernel
def lay_under(ground, background, decoded, rows, rgba, color, alpha):
    """Lay the shadow under rows of a picture.

    Parameters
    ----------
    ground : SeenGround
    background : (4,) float32, linear colour and 1; or 0 each, where the picture stays transparent
    decoded : (256,) float32, the linear value of each level of the sRGB curve
    rows : (first, end)
    rgba : (height, width) uint32, see resolve.Picture, drawn without a background; changed
    color, alpha : (height, width, 3) and (height, width) float32, linear, of the same picture, changed; without rows
        where nobody needs them
    """
    has_linear, has_background = len(alpha) > 0, background[3] > 0
    for j in range(rows[0], rows[1]):
        of_row, y, steps = rgba[j], np.float64(j) + 0.5, vector_of_column(ground.planes, 0)
        starts = add(scale(vector_of_column(ground.planes, 1), y), vector_of_column(ground.planes, 2))
        first, end = ground.columns[j, 0], ground.columns[j, 1]
        for i in range(0 if has_background else first, len(of_row) if has_background else end):
            word = of_row[i]
            if not (word < np.uint32(0xFF000000) or (has_linear and alpha[j, i] < 1)):
                continue
            dark = np.float32(0)
            if first <= i < end:
                seen = opacity_at(ground.shadow, add(scale(steps, np.float64(i) + 0.5), starts))
                dark = ground.along[j] * ground.across[i] * seen
            if not has_background and dark == 0:
                continue
            if word == 0 and not has_background:  # as below: most pixels are these
                of_row[i] = np.uint32(encode_alpha(dark)) << np.uint32(24)
            elif word < np.uint32(0xFF000000):
                red, green, blue = decoded[word & 0xFF], decoded[word >> 8 & 0xFF], decoded[word >> 16 & 0xFF]
                share = np.float32(word >> 24) / np.float32(255)
                red, green, blue, share = over(red, green, blue, share, dark, background)
                of_row[i] = pack_bytes(
                    encode_channel(red), encode_channel(green), encode_channel(blue), encode_alpha(share)
                )
            if has_linear and alpha[j, i] < 1:
                pixel = color[j, i]
                pixel[0], pixel[1], pixel[2], alpha[j, i] = over(
                    pixel[0], pixel[1], pixel[2], alpha[j, i], dark, background
                )


@helper
def vector_of_column(planes, k):
    """Return column k of a (3, 3) array."""
    return planes[0, k], planes[1, k], planes[2, k]


@helper
def opacity_at(shadow, place):
    """Return the opacity of the ground, bilinearly between four texels; 0 where it isn't seen. `place` is what the
    planes are at a pixel."""
    w = place[2]
    # From the centre of the rim's first texel, times w: where that isn't above 0, nothing lies between the limits.
    column, row = place[0] + 0.5 * w, place[1] + 0.5 * w
    if not (0.0 < column < (shadow.shape[1] - 1) * w and 0.0 < row < (shadow.shape[0] - 1) * w):
        return np.float32(0)
    column, row = column / w, row / w  # which may be rounded up to a limit
    left, top = min(np.int64(column), shadow.shape[1] - 2), min(np.int64(row), shadow.shape[0] - 2)
    share_x, share_y = np.float32(column - left), np.float32(row - top)
    upper, lower = shadow[top], shadow[top + 1]
    right = left + 1
    above = upper[left] + share_x * (upper[right] - upper[left])
    below = lower[left] + share_x * (lower[right] - lower[left])
    return above + share_y * (below - above)


@helper
def over(red, green, blue, alpha, opacity, background):
    """Return the linear colour, not premultiplied, and the alpha of a pixel with black shadow under it, and the
    background under that."""
    shadow = (np.float32(1) - alpha) * opacity
    seen = background[3] * (np.float32(1) - alpha - shadow)
    total = alpha + shadow + seen
    weight = np.float32(1) / max(total, LOWEST)
    if background[3] > 0:
        total = weight = np.float32(1)
    red, green, blue = red * alpha, green * alpha, blue * alpha
    return (
        (red + seen * background[0]) * weight,
        (green + seen * background[1]) * weight,
        (blue + seen * background[2]) * weight,
        total,
    )
