"""The shadow of the ground under a picture: for each pixel that shows the ground, how dark it is there.

The camera is above the ground and the scene, too: so a ray meets the scene before the ground, and the shadow lies under
the picture as Porter & Duff's "over" says (1984, "Compositing Digital Images").
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel
from .resolve import encode_alpha, encode_channel, pack_bytes

LOWEST = np.float32(1e-30)  # alpha that colours are divided by


class SeenGround(NamedTuple):
    """The shadow, and where a picture shows it."""

    # (n + 2, m + 2) float32, opacity of the ground at n rows of m texels, with a rim of 0 round them
    shadow: np.ndarray
    # (2, 2) float64: columns, and rows, of that array between which there is shadow, both exclusive
    limits: np.ndarray
    # (3, 3) float64, each a·x + b·y + c at the pixels' coordinates (x, y): the ray through a pixel meets the ground in
    # column first/third and row second/third of texels, before the camera where the third is above 0.
    planes: np.ndarray
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
        of_row, y = rgba[j], np.float64(j) + 0.5
        first, end = seen_columns(ground, y, len(of_row))
        for i in range(0 if has_background else first, len(of_row) if has_background else end):
            word = of_row[i]
            if not (word < np.uint32(0xFF000000) or (has_linear and alpha[j, i] < 1)):
                continue
            dark = np.float32(0)
            if first <= i < end:
                dark = ground.along[j] * ground.across[i] * opacity_at(ground, np.float64(i) + 0.5, y)
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
def seen_columns(ground, y, width):
    """Return the first and the end of the pixels of a row that may show shadow, one more on both sides for rounding:
    the opacity begins with 0 there."""
    planes, limits = ground.planes, ground.limits
    step, start = planes[2, 0], 0.5 * planes[2, 0] + planes[2, 1] * y + planes[2, 2]
    first, end = where_positive(step, start, 0.0, np.float64(width))
    for axis in range(2):
        a, b = planes[axis, 0], 0.5 * planes[axis, 0] + planes[axis, 1] * y + planes[axis, 2]
        low, high = limits[axis, 0] - 0.5, limits[axis, 1] - 0.5
        first, end = where_positive(a - low * step, b - low * start, first, end)
        first, end = where_positive(high * step - a, high * start - b, first, end)
    if not first < end:
        return 0, 0
    return max(first - 1.0, 0.0), min(end + 2.0, np.float64(width))


@helper
def where_positive(step, start, first, end):
    """Return the part of first..end in which start + step·k is above 0."""
    if step > 0.0:
        return max(first, -start / step), end
    if step < 0.0:
        return first, min(end, -start / step)
    return first, end if start > 0.0 else first


@helper
def opacity_at(ground, x, y):
    """Return the opacity of the ground that is seen at (x, y) of the picture, bilinearly between four texels; 0 where
    it isn't seen."""
    shadow, planes, limits = ground.shadow, ground.planes, ground.limits
    w = planes[2, 0] * x + planes[2, 1] * y + planes[2, 2]
    if not w > 0:
        return np.float32(0)
    # From the centre of the rim's first texel.
    column = (planes[0, 0] * x + planes[0, 1] * y + planes[0, 2]) / w + 0.5
    row = (planes[1, 0] * x + planes[1, 1] * y + planes[1, 2]) / w + 0.5
    if not (limits[0, 0] < column < limits[0, 1] and limits[1, 0] < row < limits[1, 1]):
        return np.float32(0)
    left, top = np.int64(column), np.int64(row)
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
    scale = np.float32(1) / max(total, LOWEST)
    if background[3] > 0:
        total = scale = np.float32(1)
    red, green, blue = red * alpha, green * alpha, blue * alpha
    return (
        (red + seen * background[0]) * scale,
        (green + seen * background[1]) * scale,
        (blue + seen * background[2]) * scale,
        total,
    )
