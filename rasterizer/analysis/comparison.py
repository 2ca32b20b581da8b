"""How far two pictures are apart: in linear intensity, in 8-bit levels, and in coverage."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError
from ..frame import Frame
from ..scene.color import srgb_from_linear


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
