"""How far two pictures are apart: in linear intensity, in 8-bit levels, and in coverage."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError
from ..frame import Frame
from ..scene.color import linear_from_srgb_bytes, srgb_from_linear


@dataclass(frozen=True)
class Comparison:
    """Hold how far two pictures are apart.

    Parameters
    ----------
    max : largest difference of a value; linear intensity where both pictures have it, else 8-bit sRGB / 255
    rms : root of the mean squared difference of all values, in the same unit
    psnr : the same in decibels below full scale, -20 log10(rms); inf where the pictures are equal
    levels : largest difference of an 8-bit value, 0..255
    over_one : number of 8-bit values, three a pixel, that differ by more than one level
    coverage : number of pixels whose alpha differs; 0 where one of the pictures has none
    """

    max: float
    rms: float
    psnr: float
    levels: int
    over_one: int
    coverage: int

    def __str__(self) -> str:
        if not (self.max or self.levels or self.coverage):
            return "equal"
        return (
            f"max {self.max:.3g}, rms {self.rms:.3g}, psnr {self.psnr:.1f} dB, "
            f"{self.levels} of 255 levels at most, {self.over_one} values off by more than one, "
            f"{self.coverage} pixels covered otherwise"
        )


class _Picture(NamedTuple):
    """A picture as it is compared."""

    linear: NDArray | None  # (height, width, channels) floating point
    levels: NDArray[np.uint8]  # (height, width, channels), sRGB
    alpha: NDArray | None  # (height, width), covered share


def compare(a: Frame | ArrayLike, b: Frame | ArrayLike) -> Comparison:
    """Compare two pictures of one size.

    Parameters
    ----------
    a, b : Frame, or array (height, width), (height, width, 3) or (height, width, 4): uint8 is sRGB, floating
        point is linear with 1 = white; a fourth channel is alpha

    Returns
    -------
    Comparison, over linear intensities where both pictures have them (a Frame rendered with "color", a
    floating-point array), else over 8-bit values

    Raises
    ------
    SceneError : not a picture, a frame without one, values that are not finite, or two sizes
    """
    first, second = picture_of(a), picture_of(b)
    if first.levels.shape != second.levels.shape:
        raise SceneError(f"pictures must have one size to be compared; given {_shape(first)} and {_shape(second)}")
    steps = np.abs(first.levels.astype(np.int16) - second.levels.astype(np.int16))
    if first.linear is None or second.linear is None:
        difference = steps / 255.0
    else:
        difference = np.abs(first.linear.astype(np.float64) - second.linear)
    rms = root_mean_square(difference)
    has_alpha = first.alpha is not None and second.alpha is not None
    return Comparison(
        max=float(difference.max()),
        rms=rms,
        psnr=-20.0 * math.log10(rms) if rms > 0.0 else math.inf,
        levels=int(steps.max()),
        over_one=int(np.count_nonzero(steps > 1)),
        coverage=int(np.count_nonzero(first.alpha != second.alpha)) if has_alpha else 0,
    )


def _shape(picture: _Picture) -> str:
    height, width, n_channel = picture.levels.shape
    return f"{width}x{height} with {n_channel} channels"


def picture_of(source: Frame | ArrayLike) -> _Picture:
    """Take a frame or an array apart."""
    if isinstance(source, Frame):
        linear = source.color if source.has("color") else None
        return _Picture(linear, source.rgb, source.alpha)
    try:
        array = np.asarray(source)
    except ValueError:  # lists of several lengths
        array = np.empty(0, object)
    is_shaped = array.ndim == 2 or (array.ndim == 3 and array.shape[2] in (1, 3, 4))
    is_linear = np.issubdtype(array.dtype, np.floating)
    if not (is_shaped and array.size and (is_linear or array.dtype == np.uint8)):
        legal = "a Frame, or a uint8 or floating-point array (height, width) with 3 or 4 channels or none"
        raise SceneError(f"a picture must be {legal}; given {_described(source, array)}")
    if is_linear and not np.isfinite(array).all():
        raise SceneError("a picture's values must be finite; compare depths where both are")
    array = array[..., None] if array.ndim == 2 else array
    alpha = array[..., 3] if array.shape[2] == 4 else None
    array = array[..., :3]
    if not is_linear:
        return _Picture(None, array, _share(alpha))
    return _Picture(array, levels_from_linear(array), alpha)


def levels_from_linear(linear: NDArray) -> NDArray[np.uint8]:
    """Round linear colours, clamped to 0..1, to 8-bit sRGB."""
    return np.rint(255.0 * srgb_from_linear(np.clip(linear, 0.0, 1.0))).astype(np.uint8)


def root_mean_square(values: NDArray) -> float:
    """Compute the root of the mean of the squares; 0 without values."""
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def _share(alpha: NDArray | None) -> NDArray | None:
    """8-bit alpha as the covered share of a pixel, float32 as in a Frame."""
    return None if alpha is None else alpha / np.float32(255)


def _described(source: object, array: NDArray) -> str:
    if array.ndim == 0:
        return type(source).__name__
    return f"{array.dtype} of the shape {array.shape}"


# ----------------------------------------------------------------
# How different two pictures look: CIEDE2000, the difference of two colours as an eye sees it.
# in: two pictures of one size       out: ΔE00 of every pixel; about 1 is just noticed, 0 is equal
#
# Source: Sharma, Wu & Dalal 2005, "The CIEDE2000 color-difference formula: implementation notes, supplementary test
# data,
# and mathematical observations", Color Research & Application 30(1); equation numbers are theirs. L*a*b*: CIE 15:2004,
# section 8.2.1. Primaries and white: IEC 61966-2-1:1999 (sRGB, D65).

_XYZ_OF_RGB = np.array([(0.4124, 0.3576, 0.1805), (0.2126, 0.7152, 0.0722), (0.0193, 0.1192, 0.9505)])
_WHITE = _XYZ_OF_RGB.sum(axis=1)
_LINEAR_BELOW = (6.0 / 29.0) ** 3  # of Y/Yn: the cube root is continued by its tangent there
_POWER_25_7 = 25.0**7
_AT_ONCE = 2**16  # pixels: some 30 arrays of them stay in cache


def color_difference(a: Frame | ArrayLike, b: Frame | ArrayLike) -> NDArray[np.float64]:
    """Compute the colour difference ΔE00 of every pixel of two pictures.

    Parameters
    ----------
    a, b : Frame, or array (height, width, 3 or 4): uint8 is sRGB, floating point is linear with 1 = white. What is
        beyond 0..1 is shown as 0 or 1; alpha doesn't count

    Returns
    -------
    (height, width) float64, at least 0

    Raises
    ------
    SceneError : not a picture, grey arrays, values that are not finite, or two sizes
    """
    first, second = _linear(a), _linear(b)
    if first.shape != second.shape:
        raise SceneError(f"pictures must have one size to be compared; given {first.shape} and {second.shape}")
    shape = first.shape[:2]
    first, second = first.reshape(-1, 3), second.reshape(-1, 3)
    difference = np.empty(len(first))
    for start in range(0, len(first), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        difference[part] = delta_e_2000(lab_from_linear(first[part]), lab_from_linear(second[part]))
    return difference.reshape(shape)


def _linear(source: Frame | ArrayLike) -> NDArray:
    """The linear colours of a picture, (height, width, 3)."""
    picture = picture_of(source)
    linear = linear_from_srgb_bytes(picture.levels) if picture.linear is None else picture.linear
    if linear.shape[2] != 3:
        raise SceneError(f"colours have three channels; given {linear.shape[2]}")
    return linear


def lab_from_linear(linear: ArrayLike) -> NDArray[np.float64]:
    """Convert linear RGB to CIE L*a*b* with the white D65.

    Parameters
    ----------
    linear : (..., 3), sRGB primaries, 1 = white; clamped to 0..1, which is what a display shows

    Returns
    -------
    (..., 3) float64: L* within 0..100, a*, b*
    """
    ratio = np.clip(np.asarray(linear, np.float64), 0.0, 1.0) @ (_XYZ_OF_RGB / _WHITE[:, None]).T
    f = np.where(ratio > _LINEAR_BELOW, np.cbrt(ratio), ratio * (29.0 / 6.0) ** 2 / 3.0 + 4.0 / 29.0)
    x, y, z = f[..., 0], f[..., 1], f[..., 2]
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


def delta_e_2000(first: ArrayLike, second: ArrayLike) -> NDArray[np.float64]:
    """Compute the CIEDE2000 difference of colours, with kL = kC = kH = 1.

    Parameters
    ----------
    first, second : (..., 3) L*, a*, b*

    Returns
    -------
    (...) float64, at least 0
    """
    l1, a1, b1 = np.moveaxis(np.asarray(first, np.float64), -1, 0)
    l2, a2, b2 = np.moveaxis(np.asarray(second, np.float64), -1, 0)
    mean_chroma = 0.5 * (np.hypot(a1, b1) + np.hypot(a2, b2))  # eq. 2, 3
    stretch = 1.5 - 0.5 * _share_of_seventh_power(mean_chroma)  # 1 + G, eq. 4
    a1, a2 = stretch * a1, stretch * a2  # eq. 5
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)  # eq. 6
    h1, h2 = np.degrees(np.arctan2(b1, a1)) % 360.0, np.degrees(np.arctan2(b2, a2)) % 360.0  # eq. 7
    is_grey = c1 * c2 == 0.0
    turn = np.where(is_grey, 0.0, h2 - h1)  # eq. 10
    turn += np.where(turn > 180.0, -360.0, np.where(turn < -180.0, 360.0, 0.0))
    dl, dc = l2 - l1, c2 - c1  # eq. 8, 9
    dh = 2.0 * np.sqrt(c1 * c2) * np.sin(np.radians(0.5 * turn))  # eq. 11
    lightness, chroma, hue = 0.5 * (l1 + l2), 0.5 * (c1 + c2), _mean_hue(h1, h2, is_grey)  # eq. 12 to 14
    t = (
        1.0
        - 0.17 * np.cos(np.radians(hue - 30.0))
        + 0.24 * np.cos(np.radians(2.0 * hue))
        + 0.32 * np.cos(np.radians(3.0 * hue + 6.0))
        - 0.20 * np.cos(np.radians(4.0 * hue - 63.0))
    )  # eq. 15
    of_l = dl / (1.0 + 0.015 * (lightness - 50.0) ** 2 / np.sqrt(20.0 + (lightness - 50.0) ** 2))  # eq. 18
    of_c = dc / (1.0 + 0.045 * chroma)  # eq. 19
    of_h = dh / (1.0 + 0.015 * chroma * t)  # eq. 20
    angle = 60.0 * np.exp(-(((hue - 275.0) / 25.0) ** 2))  # 2 Δθ, eq. 16
    rotation = -2.0 * _share_of_seventh_power(chroma) * np.sin(np.radians(angle))  # eq. 17, 21
    squared = of_l**2 + of_c**2 + of_h**2 + rotation * of_c * of_h  # eq. 22
    return np.sqrt(np.maximum(squared, 0.0))  # the form is positive; rounding may not be


def _share_of_seventh_power(chroma: NDArray) -> NDArray:
    """sqrt(C^7 / (C^7 + 25^7))."""
    power = chroma**7
    return np.sqrt(power / (power + _POWER_25_7))


def _mean_hue(h1: NDArray, h2: NDArray, is_grey: NDArray) -> NDArray:
    """The mean of two hues, degrees, along the shorter arc; the sum where one colour has none. Eq. 14."""
    total = h1 + h2
    is_far = np.abs(h1 - h2) > 180.0
    mean = np.where(is_far, 0.5 * np.where(total < 360.0, total + 360.0, total - 360.0), 0.5 * total)
    return np.where(is_grey, total, mean)
