"""A colour bar with ticks, drawn beside a picture of a scalar field; and buffers as pictures that one can look at."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import SceneError
from .scene.color import srgb_from_linear
from .scene.scalars import ColorScale

MIN_LETTERS = 10  # px, the least height of text
_GOLDEN = 0.6180339887498949  # a turn by it lies in the largest gap of all turns before


def _scale_of(scene: Any) -> ColorScale:
    """Return the colour scale of a scene; SceneError where it shows no scalar field."""
    for material in () if scene is None else scene.materials:
        if isinstance(material.texture, ColorScale):
            return material.texture
    raise SceneError("this frame shows no scalar field, of which a colour bar would tell: give render() scalars=")


def ticks_of(low: float, high: float, n: int) -> tuple[list[float], list[str]]:
    """Return round values within a range, as many as fit into about `n`, and their texts.

    They are multiples of 1, 2 or 5 times a power of ten (Heckbert 1990, Nice numbers for graph labels).
    """
    least = (high - low) / max(n, 1)
    power = 10.0 ** math.floor(math.log10(least))
    step = next(step for step in (power, 2.0 * power, 5.0 * power, 10.0 * power) if step >= least * (1 - 1e-9))
    values = [k * step for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]
    most = max(abs(low), abs(high))
    if not 1e-4 <= step <= most < 1e6:
        digits = max(math.ceil(math.log10(most / step)), 0)
        return values, [f"{value:.{digits}e}" if value else "0" for value in values]
    decimals = max(-math.floor(math.log10(step) + 1e-9), 0)
    return values, [f"{value:.{decimals}f}" for value in values]


def with_colorbar(rgba: NDArray[np.uint8], scene: Any, label: str | None) -> NDArray[np.uint8]:
    """Return a picture, (h, w, 4) uint8, with a colour bar to its right.

    Parameters
    ----------
    rgba : (h, w, 4) uint8, the picture
    scene : what it shows; the bar stands on its background, with letters that are seen there
    label : text above it; None = the name of the scalars

    Raises
    ------
    SceneError : a scene that shows no scalar field, or None
    """
    from PIL import Image, ImageDraw, ImageFont

    scale = _scale_of(scene)
    behind = (0, 0, 0, 0) if scene.background is None else (*_bytes(srgb_from_linear(scene.background)), 255)
    ink = (255,) * 4 if 0 < behind[3] and max(behind[:3]) < 128 else (0, 0, 0, 255)
    height, width = rgba.shape[:2]
    letters = max(height // 26, MIN_LETTERS)
    font = ImageFont.load_default(letters)
    top, length, thick = 3 * letters, max(height - 5 * letters, 2), letters
    values, texts = ticks_of(scale.low, scale.high, max(length // (3 * letters), 1))
    label = scale.name if label is None else label
    right = letters + thick + letters + math.ceil(max(font.getlength(text) for text in texts or [""]))
    room = max(right, letters + math.ceil(font.getlength(label))) + letters
    made = np.empty((height, width + room, 4), np.uint8)
    made[:, :width], made[:, width:] = rgba, behind
    image = Image.fromarray(made)
    draw = ImageDraw.Draw(image)
    left = width + letters
    t = 1.0 - (np.arange(length) + 0.5) / length
    colors: Any = scale.encoded
    bar = colors[0][np.minimum((t * colors.shape[1]).astype(int), colors.shape[1] - 1)]
    image.paste(Image.fromarray(np.repeat(bar[:, None], thick, axis=1)), (left, top))
    draw.rectangle((left - 1, top - 1, left + thick, top + length), outline=ink)
    for value, text in zip(values, texts, strict=True):
        y = top + (1.0 - (value - scale.low) / (scale.high - scale.low)) * (length - 1)
        draw.line((left + thick, y, left + thick + letters // 3, y), fill=ink)
        draw.text((left + thick + letters * 2 // 3, y), text, fill=ink, font=font, anchor="lm")
    draw.text((left, top - letters), label, fill=ink, font=font, anchor="ls")
    return np.asarray(image)


# --- buffers ----------------------------------------------------------------------------------------------------------


def picture_of(name: str, array: NDArray[Any]) -> NDArray[np.uint8]:
    """Return a buffer as a picture (h, w, 4) uint8, clear where nothing is.

    Depth is lighter the nearer it is, from the nearest to the furthest that is seen; positions go from black to full
    along each axis. Directions -1..1 become 0..255, weights and texture coordinates 0..1 (of these the fraction).
    Indices have colours of their own, and light and coverage are grey or as they are.

    Parameters
    ----------
    name : that of an attribute of Frame
    array : its values
    """
    if name in ("rgb", "rgba"):
        return np.dstack([array, np.full(array.shape[:2], 255, np.uint8)]) if array.shape[2] == 3 else array
    if name == "color":
        return _with_alpha(_bytes(srgb_from_linear(array)), np.ones(array.shape[:2], bool))
    if array.dtype == bool or name == "alpha":
        return _with_alpha(np.repeat(_bytes(array)[..., None], 3, axis=2), np.ones(array.shape, bool))
    if array.dtype.kind == "i":
        return _with_alpha(_index_colors(array), array >= 0)
    if name.startswith("normal"):
        return _with_alpha(_bytes(array * 0.5 + 0.5), array.any(axis=2))
    is_there = np.isfinite(array) if array.ndim == 2 else np.isfinite(array).all(axis=2)
    values = np.where(is_there if array.ndim == 2 else is_there[..., None], array, 0.0)
    if name == "uv":
        values = np.dstack([values - np.floor(values), np.zeros(is_there.shape)])
    elif name != "barycentric" and is_there.any():
        seen = array[is_there]
        low, high = seen.min(axis=0), seen.max(axis=0)
        values = (values - low) / np.where(high > low, high - low, 1.0)
    if name == "depth":
        values = np.repeat(1.0 - 0.8 * values[..., None], 3, axis=2)
    return _with_alpha(_bytes(values), is_there)


def _bytes(values: NDArray[Any]) -> NDArray[np.uint8]:
    return np.rint(np.clip(values, 0.0, 1.0) * 255.0).astype(np.uint8)


def _with_alpha(rgb: NDArray[np.uint8], is_there: NDArray[np.bool_]) -> NDArray[np.uint8]:
    return np.dstack([np.where(is_there[..., None], rgb, 0), np.where(is_there, 255, 0)]).astype(np.uint8)


def _index_colors(index: NDArray[Any]) -> NDArray[np.uint8]:
    """Return a colour for each index: hues a golden section of a turn apart, so that neighbours differ."""
    hue = (index[..., None] * _GOLDEN + np.array([0.0, 2 / 3, 1 / 3])) % 1.0
    return _bytes(0.35 + 0.65 * np.clip(np.abs(6.0 * hue - 3.0) - 1.0, 0.0, 1.0))
