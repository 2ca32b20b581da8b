"""Colours: what a person writes becomes linear RGB, and the two sRGB curves.

Inside the package every colour is linear, relative to the sRGB / Rec. 709 primaries. Text (hex, CSS names) is
sRGB-encoded, as everywhere, and is decoded; numbers are linear already. 8-bit colours of a mesh are sRGB-encoded.

Source of the curves: IEC 61966-2-1:1999, section 5.2 (piecewise: a straight line near black, a power of 2.4 above).
"""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError, shown
from .arrays import real_array
from .validate import is_whole, items_of, number, vector3

RGB: TypeAlias = tuple[float, float, float]  # linear
# A colour as a caller may give it: a grey, three linear numbers, hex or CSS text, or a Spectrum (which is a tuple).
ColorLike: TypeAlias = float | str | Sequence[float] | NDArray[Any]


def linear_rgb(color: ColorLike, what: str = "color") -> RGB:
    """Return any accepted way to write a colour as linear RGB.

    Parameters
    ----------
    color : number (a linear grey), three numbers (linear RGB as they are; above 1 is legal, but not in whole numbers:
        who writes (255, 128, 0) means sRGB), or str (sRGB: "#f80", "#ff8800", "orange", "rgb(255, 136, 0)", anything
        that PIL.ImageColor reads), or Spectrum
    what : name of the argument, for messages

    Returns
    -------
    (red, green, blue) floats, linear, at least 0; a Spectrum itself, which is such a triple too, but may have
    negative components

    Raises
    ------
    SceneError : not one of these forms, an unknown name, a component that is negative or not finite, three whole
        numbers of which one is above 1, text with an alpha below 1
    """
    if isinstance(color, str):
        return _rgb_of_text(color, what)
    if isinstance(color, tuple) and hasattr(color, "wavelengths"):
        return color  # a Spectrum: its module imports this one
    given: Any = color
    is_array = hasattr(given, "__len__") or hasattr(given, "__dlpack__")
    if not is_array or getattr(given, "ndim", 1) == 0:
        rgb = (number(given, f"{what} (a grey, three linear numbers, or a hex or CSS colour)"),) * 3
    else:
        rgb = vector3(given, what)
        # No surface reflects 255 times what it gets.
        if max(rgb) > 1.0 and min(rgb) >= 0.0 and all(map(is_whole, items_of(given))):
            text = "#{:02x}{:02x}{:02x}".format(*map(int, rgb)) if max(rgb) <= 255.0 else "#rrggbb"
            hint = f'sRGB is written "{text}" or rz.srgb(...), linear light divided by 255, or 2.0 where that is meant'
            raise SceneError(f"{what} must be linear, 1 is white; given whole numbers, {shown(color)}: {hint}")
    if min(rgb) < 0.0:
        raise SceneError(f"{what} must not be negative; given {shown(color)}")
    return rgb


def srgb(colors: ArrayLike) -> NDArray[np.float64]:
    """Decode sRGB colours to the linear ones that materials, lights and float colours of a mesh are given in.

        rz.Material(diffuse=rz.srgb((255, 128, 0)))   # as "#ff8000"
        rz.Mesh(vertices, faces, colors=rz.srgb(colors))

    Parameters
    ----------
    colors : (..., 3) or (..., 4) sRGB-encoded: whole numbers of any dtype within 0..255, or floats within 0..1. A
        fourth channel is alpha, which is linear already

    Returns
    -------
    array of the same shape, float64, linear, 0..1

    Raises
    ------
    SceneError : another shape, numbers out of range, text

    Source: IEC 61966-2-1:1999, 5.2. `rasterizer.scene.color.srgb_from_linear` is the inverse.
    """
    given = real_array(colors)
    if given is None or given.ndim == 0 or given.shape[-1] not in (3, 4):
        raise SceneError(f"colours must be numbers of the shape (..., 3) or (..., 4); given {shown(colors)}")
    white = 1.0 if given.dtype.kind == "f" else 255.0
    if given.size and not (given.min() >= 0 and given.max() <= white):
        legal = "floats within 0..1, or whole numbers within 0..255"
        raise SceneError(f"colours must be {legal}; given {given.min():g} to {given.max():g}")
    encoded = given.astype(np.float64) / white
    linear = linear_from_srgb(encoded)
    linear[..., 3:] = encoded[..., 3:]
    return linear


def _rgb_of_text(text: str, what: str) -> RGB:
    """Decode a hex or CSS colour; the import waits until one is met, as PIL is slow to import."""
    from PIL import ImageColor

    try:
        channels = ImageColor.getrgb(text.strip())
    except ValueError:
        legal = 'a CSS name such as "orange" or hex such as "#ff8800"'
        raise SceneError(f"{what} must be {legal}; given {shown(text)}") from None
    if len(channels) == 4 and channels[3] != 255:
        raise SceneError(f"{what} must be opaque; given {shown(text)} with an alpha of {channels[3]}/255")
    if not all(0 <= channel <= 255 for channel in channels):
        raise SceneError(f"{what} must have channels within 0..255; given {shown(text)}")
    red, green, blue = (float(LINEAR_OF_BYTE[channel]) for channel in channels[:3])
    return red, green, blue


def srgb_from_linear(linear: ArrayLike) -> NDArray[np.float64]:
    """Encode linear values with the sRGB curve.

    Parameters
    ----------
    linear : array of any shape, 1 = white; values outside 0..1 follow the curve's ends, nan stays nan

    Returns
    -------
    float64 array of the same shape, 1 = white

    Source: IEC 61966-2-1:1999, 5.2.
    """
    linear = np.asarray(linear, dtype=np.float64)
    power = 1.055 * np.maximum(linear, 0.0031308) ** (1.0 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, power)


def linear_from_srgb(srgb: ArrayLike) -> NDArray[np.float64]:
    """Decode sRGB values to linear ones, the inverse of `srgb_from_linear`.

    Parameters
    ----------
    srgb : array of any shape, 1 = white (8-bit values divided by 255)

    Returns
    -------
    float64 array of the same shape, linear, 1 = white

    Source: IEC 61966-2-1:1999, 5.2.
    """
    srgb = np.asarray(srgb, dtype=np.float64)
    power = ((np.maximum(srgb, 0.04045) + 0.055) / 1.055) ** 2.4
    return np.where(srgb <= 0.04045, srgb / 12.92, power)


def linear_from_srgb_bytes(colors: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Decode 8-bit colours through a table; a fourth channel is alpha, which is never encoded.

    Parameters
    ----------
    colors : (n, 3) or (n, 4) uint8, sRGB-encoded, alpha linear

    Returns
    -------
    float64 array of the same shape, linear, 0..1
    """
    linear = LINEAR_OF_BYTE[colors]
    if colors.shape[-1] == 4:
        linear[..., 3] = colors[..., 3] / 255.0
    return linear


LINEAR_OF_BYTE = linear_from_srgb(np.arange(256) / 255.0)
LINEAR_OF_BYTE.flags.writeable = False
