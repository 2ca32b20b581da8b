"""A texture: a picture that is laid over a surface, decoded to linear colours, with its mipmaps.

Texture coordinates: u runs to the right, v upwards; (0, 0) is the picture's lower left corner and (1, 1) its upper right one,
as in OBJ. A picture of w × h texels has the centre of the texel in column i and row j (from the top) at
u = (i + ½)/w, v = 1 - (j + ½)/h.
"""

import os
import struct
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rasterizer.errors import ModelError, SceneError
from rasterizer.scene._arrays import KeepsArrays, fixed
from rasterizer.scene._check import choice, shown
from rasterizer.scene.color import linear_from_srgb_bytes

FILTERS = ("nearest", "bilinear", "trilinear")
WRAPS = ("repeat", "clamp", "mirror")
MOST_TEXELS = 2**14  # along a side
# What PIL has been seen to raise for damaged files, and for modes that it can't convert.
PICTURE_FAULTS = (OSError, ValueError, SyntaxError, EOFError, IndexError, struct.error, MemoryError, OverflowError)


@dataclass(frozen=True, eq=False, repr=False)
class Texture(KeepsArrays):
    """Hold a picture that multiplies a material's diffuse and ambient coefficients.

    Parameters
    ----------
    image : path of a picture, `PIL.Image.Image`, or array (h, w), (h, w, 1), (h, w, 2: grey and alpha), (h, w, 3) or
        (h, w, 4): uint8 is sRGB-encoded (its alpha is not), floats are linear. Stored as (h, w, 4) float32, linear, with the
        alpha that the picture has, else 1; read-only
    filter : "nearest", "bilinear", or "trilinear": bilinear between and within mipmaps, each half as large as the one before
    wrap : what lies outside 0..1: "repeat", "clamp" or "mirror"; or a pair of these, for u and v
    name : text, for reports; the path where one was given

    Raises
    ------
    SceneError : a value that is not legal
    ModelError : a file that can't be read as a picture
    """

    image: object
    filter: str = "trilinear"
    wrap: object = "repeat"
    name: str = ""

    def __post_init__(self):
        choice(self.filter, FILTERS, "the texture's filter")
        wrap = (self.wrap, self.wrap) if isinstance(self.wrap, str) else self.wrap
        if not isinstance(wrap, (tuple, list)) or len(wrap) != 2:
            raise SceneError(f"the texture's wrap must be one word, or two for u and v; given {shown(self.wrap)}")
        object.__setattr__(self, "wrap", tuple(choice(word, WRAPS, "the texture's wrap") for word in wrap))
        if not isinstance(self.name, str):
            raise SceneError(f"the texture's name must be text; given {shown(self.name)}")
        image = self.image
        if isinstance(image, (str, os.PathLike)):
            object.__setattr__(self, "name", self.name or os.fsdecode(image))
            image = read_picture(image, os.fsdecode(image))
        elif hasattr(image, "convert"):
            try:
                image = _pixels_of(image)
            except PICTURE_FAULTS as fault:
                raise SceneError(f"a texture's image can't be decoded ({fault}); given {shown(image)}") from fault
        object.__setattr__(self, "image", _checked_image(image))

    def __repr__(self) -> str:
        name = f"{self.name!r}, " if self.name else ""
        height, width = self.image.shape[:2]
        return f"Texture({name}{width} x {height}, {self.filter}, {'/'.join(self.wrap)})"

    @cached_property
    def has_alpha(self) -> bool:
        """Whether any texel lets something through."""
        return bool((self.image[..., 3] < 1.0).any())

    @cached_property
    def pyramid(self) -> tuple[np.ndarray, ...]:
        """The picture and its mipmaps, (h, w, 4) float32 each, read-only, the last one with a single texel; the picture alone
        where the filter needs no mipmaps.

        Colours are weighted by their alpha. A level has half of the texels of the one before along each axis, rounded down, but
        at least one; each is the mean of the area that it covers (Williams 1983, Pyramidal parametrics, for even numbers).
        """
        levels = [self.image]
        while self.filter == "trilinear" and max(levels[-1].shape[:2]) > 1:
            levels.append(_halve(levels[-1]))
        return tuple(levels)


def read_picture(source, name: str) -> np.ndarray:
    """Read a picture file.

    Parameters
    ----------
    source : path, or binary file object
    name : text, what the message calls it

    Returns
    -------
    (h, w) or (h, w, 2..4) uint8, sRGB-encoded, as the file has it; palettes and rarer modes as RGBA

    Raises
    ------
    ModelError : a file that can't be read as a picture
    """
    from PIL import Image

    try:
        with Image.open(source) as picture:
            return _pixels_of(picture)
    except (*PICTURE_FAULTS, Image.DecompressionBombError) as fault:
        raise ModelError(f"{name}: can't be read as a picture ({fault})") from fault


def _pixels_of(picture) -> np.ndarray:
    """The pixels of a PIL image, in 8 bits; palettes and rarer modes as RGBA."""
    if picture.mode.startswith("I;16"):  # PIL would cut off what is above 255
        return np.rint(np.asarray(picture) / 257.0).astype(np.uint8)
    is_plain = picture.mode in ("L", "LA", "RGB", "RGBA") and "transparency" not in picture.info
    return np.asarray(picture if is_plain else picture.convert("RGBA"))


def _checked_image(image) -> np.ndarray:
    """Return an image as (h, w, 4) float32, linear, read-only."""
    try:
        array = np.asarray(image)
    except ValueError:  # lists of several lengths
        array = np.empty(0, object)
    array = array[..., None] if array.ndim == 2 else array
    is_shaped = array.ndim == 3 and array.shape[2] in (1, 2, 3, 4) and 1 <= min(array.shape[:2])
    if not is_shaped or max(array.shape[:2]) > MOST_TEXELS or array.dtype.kind not in "uf":
        legal = f"(h, w) or (h, w, 1..4), uint8 or float, up to {MOST_TEXELS} texels a side"
        raise SceneError(f"a texture's image must be {legal}; given {array.shape} {array.dtype}")
    if array.dtype.kind == "u" and array.dtype != np.uint8:
        raise SceneError(f"a texture's image of integers must be uint8; given {array.dtype}")
    out = np.ones((*array.shape[:2], 4), np.float32)
    has_alpha = array.shape[2] in (2, 4)
    colors = array[..., : array.shape[2] - has_alpha]
    with np.errstate(over="ignore"):  # what float32 can't hold becomes infinite, and is refused
        out[..., :3] = linear_from_srgb_bytes(colors) if array.dtype == np.uint8 else colors
        if has_alpha:
            out[..., 3] = array[..., -1] / 255.0 if array.dtype == np.uint8 else array[..., -1]
    if not np.isfinite(out).all() or out.min() < 0.0 or out[..., 3].max() > 1.0:
        raise SceneError("a texture's image must be finite and at least 0, its alpha within 0..1")
    return fixed(out)


def _halve(level) -> np.ndarray:
    """The next mipmap."""
    alpha = level[..., 3:].astype(np.float64)
    weighted = np.concatenate([level[..., :3] * alpha, level[..., :3], alpha], axis=2)
    for axis in (0, 1):
        weighted = _halve_axis(weighted, axis)
    alpha = weighted[..., 6:]
    colors = np.where(alpha > 0.0, weighted[..., :3] / np.where(alpha > 0.0, alpha, 1.0), weighted[..., 3:6])
    half = np.concatenate([colors, alpha], axis=2).astype(np.float32)
    half.flags.writeable = False
    return half


def _halve_axis(array, axis) -> np.ndarray:
    """Means of what each of half as many texels covers along an axis.

    Of n = 2 m + 1 texels, the new one with the number k covers the range from k·n/m to (k + 1)·n/m, that is from 2 k + k/m to
    2 k + 2 + (k + 1)/m: the share 1 - k/m of texel 2 k, all of the next, and the share (k + 1)/m of the one after.
    """
    n = array.shape[axis]
    if n == 1:
        return array
    m = n // 2
    rows = np.moveaxis(array, axis, 0)
    if n % 2 == 0:
        return np.moveaxis((rows[0::2] + rows[1::2]) / 2.0, 0, axis)
    k = np.arange(m).reshape(-1, *[1] * (array.ndim - 1))
    total = (1.0 - k / m) * rows[0:-1:2] + rows[1::2] + ((k + 1) / m) * rows[2::2]
    return np.moveaxis(total * (m / n), 0, axis)
