"""How far two pictures are apart.

    compare             in linear intensity, in 8-bit levels, and in coverage
    color_difference    how different two colours look, pixel by pixel: CIEDE2000, by scikit-image
    flip_map            how different they look when one picture is shown after the other: FLIP, by its authors' program

Both packages come with the extra `bench`.
"""

import math
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError
from ..frame import Frame
from ..scene.color import linear_from_srgb_bytes, srgb_from_linear

_AT_ONCE = 2**16  # pixels: the formula's arrays of them stay in cache


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


def color_difference(a: Frame | ArrayLike, b: Frame | ArrayLike) -> NDArray[np.float64]:
    """Compute the colour difference ΔE00 (CIEDE2000) of every pixel of two pictures: about 1 is just noticed.

    Parameters
    ----------
    a, b : Frame, or array (height, width, 3 or 4): uint8 is sRGB, floating point is linear with 1 = white. What is
        beyond 0..1 is shown as 0 or 1; alpha doesn't count

    Returns
    -------
    (height, width) float64, at least 0

    Raises
    ------
    SceneError : not a picture, grey arrays, values that are not finite, two sizes, or scikit-image isn't installed
    """
    first, second = _linear(a), _linear(b)
    if first.shape != second.shape:
        raise SceneError(f"pictures must have one size to be compared; given {first.shape} and {second.shape}")
    return delta_e_2000(first.reshape(-1, 3), second.reshape(-1, 3)).reshape(first.shape[:2])


def delta_e_2000(first: NDArray, second: NDArray) -> NDArray[np.float64]:
    """Compute the CIEDE2000 difference of colours, with kL = kC = kH = 1.

    Parameters
    ----------
    first, second : (n, 3) linear RGB; clamped to 0..1, which is what a display shows

    Returns
    -------
    (n,) float64, at least 0

    Raises SceneError where scikit-image isn't installed.
    """
    skimage_color = require("skimage.color", "scikit-image", "a colour difference")
    difference = np.empty(len(first))
    for start in range(0, len(first), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        labs = (skimage_color.rgb2lab(srgb_from_linear(np.clip(linear[part], 0.0, 1.0))) for linear in (first, second))
        difference[part] = skimage_color.deltaE_ciede2000(*labs)
    return difference


def flip_map(found: NDArray, expected: NDArray) -> NDArray[np.float32]:
    """Compute FLIP of every pixel, at 67 pixels a degree: a display of 0.7 m and 3840 pixels seen from 0.7 m.

    Parameters
    ----------
    found, expected : (height, width, 3) linear, clamped to 0..1

    Returns
    -------
    (height, width) float32 within 0..1

    Raises SceneError where flip-evaluator isn't installed.

    Source: Andersson et al. 2020, "FLIP: A Difference Evaluator for Alternating Images", Proc. ACM Comput. Graph.
    Interact. Tech. 3(2).
    """
    flip_evaluator = check_flip()
    pictures = (np.clip(picture, 0.0, 1.0).astype(np.float32) for picture in (expected, found))
    errors, _, _ = flip_evaluator.evaluate(
        *pictures, "LDR", inputsRGB=False, applyMagma=False, computeMeanError=False, parameters={}
    )
    return errors[..., 0]


def check_flip() -> Any:
    """Return the module of flip-evaluator; SceneError where it isn't installed."""
    return require("flip_evaluator", "flip-evaluator", "FLIP")


def require(module: str, package: str, what: str) -> Any:
    """Return a module that only some questions need; SceneError, in one line, where it isn't installed.

    Parameters
    ----------
    module : its name in Python
    package : its name for pip
    what : what needs it, as the message begins
    """
    try:
        return import_module(module)
    except ImportError:
        raise SceneError(f"{what} needs {package}: pip install {package}") from None


class _Picture(NamedTuple):
    """A picture as it is compared."""

    linear: NDArray | None  # (height, width, channels) floating point
    levels: NDArray[np.uint8]  # (height, width, channels), sRGB
    alpha: NDArray | None  # (height, width), covered share


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
        given = f"{array.dtype} of the shape {array.shape}" if array.ndim else type(source).__name__
        raise SceneError(f"a picture must be {legal}; given {given}")
    if is_linear and not np.isfinite(array).all():
        raise SceneError("a picture's values must be finite; compare depths where both are")
    array = array[..., None] if array.ndim == 2 else array
    alpha = array[..., 3] if array.shape[2] == 4 else None
    array = array[..., :3]
    if not is_linear:
        return _Picture(None, array, None if alpha is None else alpha / np.float32(255))  # as in a Frame
    return _Picture(array, levels_from_linear(array), alpha)


def levels_from_linear(linear: NDArray) -> NDArray[np.uint8]:
    """Round linear colours, clamped to 0..1, to 8-bit sRGB."""
    return np.rint(255.0 * srgb_from_linear(np.clip(linear, 0.0, 1.0))).astype(np.uint8)


def root_mean_square(values: NDArray) -> float:
    """Compute the root of the mean of the squares; 0 without values."""
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def _linear(source: Frame | ArrayLike) -> NDArray:
    """The linear colours of a picture, (height, width, 3)."""
    picture = picture_of(source)
    linear = linear_from_srgb_bytes(picture.levels) if picture.linear is None else picture.linear
    if linear.shape[2] != 3:
        raise SceneError(f"colours have three channels; given {linear.shape[2]}")
    return linear
