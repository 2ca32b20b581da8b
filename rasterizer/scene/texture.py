"""A texture: a picture that is laid over a surface, decoded to linear colours, with its mipmaps.

Texture coordinates: u runs to the right, v upwards; (0, 0) is the picture's lower left corner and (1, 1) its upper
right one, as in OBJ. A picture of w × h texels has the centre of the texel in column i and row j (from the top) at
u = (i + ½)/w, v = 1 - (j + ½)/h.

Pictures are read by Pillow, from the few formats of `FORMATS`: none of them starts another program. How large one is
stands in its header, and is looked at before anything is decoded: see `max_texels`. A texture keeps the bytes of its
picture, 1 to 4 a texel; what is linear needs 16, a third more with mipmaps, and is made where it is asked for.
"""

import math
import os
import struct
import zlib
from collections.abc import Iterable
from contextlib import closing
from dataclasses import dataclass, replace
from io import BytesIO
from typing import IO, TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..choices import FILTERS, WRAPS, Filter, Wrap
from ..cores import Workers, n_core
from ..errors import ModelError, SceneError, shown, warn_caller
from ..keywords import checked_fields
from ..locks import cached_property
from .arrays import KeepsArrays, fixed, own_array
from .color import LINEAR_OF_BYTE
from .validate import choice, several, store, text

if TYPE_CHECKING:
    from PIL import Image

FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "TGA", "TIFF", "GIF")  # Pillow's names
MAX_TEXELS = 2**14  # along a side
MAX_IN_PICTURE = 2**25  # texels, of a picture that is read: 8192 × 4096
ENVIRONMENT = "RASTER_MOST_TEXELS"  # a number that takes the place of MAX_IN_PICTURE
LEAST_TEXELS, TEXELS_A_BYTE = 5 * 2**21, 8  # of all textures of a file, whatever its size, or by its size; see `Budget`
MOST_TEXELS_A_BYTE = 64  # of all pictures of a file that are decoded, or 8 times as many as one picture may have
MAX_WEBP = 2**24  # texels of a WebP picture, each of which takes 13 bytes on the way, unless its file is large
MAX_RLE = 2**20  # texels of a BMP picture in runs, which Pillow decodes in Python, unless its file is large
MAX_SCANNED = 2**30  # texels of a JPEG picture times its scans, each of which goes through all of them
_TILE_SIZE = 322, 323  # TIFF's tags of a tile's width and height
_STRIP = 2**16  # texels that are converted at a time
# What PIL has been seen to raise for damaged files, and for modes that it can't convert, widened to base classes.
_PICTURE_FAULTS = (
    OSError, ValueError, SyntaxError, EOFError, LookupError, struct.error, MemoryError, ArithmeticError, RuntimeError,
    TypeError, AttributeError, AssertionError, zlib.error,
)  # fmt: skip


class HasPixels(Protocol):
    """What is taken for a picture: `PIL.Image.Image` and its like."""

    @property
    def size(self) -> tuple[int, int]:
        """(width, height), pixels."""

    def convert(self, mode: str) -> Any:
        """Return the picture in another mode of Pillow's."""


ImageLike: TypeAlias = ArrayLike | str | os.PathLike[str] | HasPixels  # what a texture is made of


@checked_fields
@dataclass(frozen=True, eq=False, repr=False)
class Texture(KeepsArrays):
    """Hold a picture that multiplies coefficients of a material: see its `texture` and `metallic_roughness`.

    Parameters
    ----------
    image : path of a picture, `PIL.Image.Image`, or array (h, w), (h, w, 1), (h, w, 2: grey and alpha), (h, w, 3) or
        (h, w, 4), up to 16384 texels a side: uint8 is sRGB-encoded (its alpha is not), floats are linear. Read as (h,
        w, 4) float32, linear, with the alpha that the picture has, else 1; read-only
    filter : "nearest", "bilinear", or "trilinear": bilinear between and within mipmaps, each half as large as the one
        before
    wrap : what lies outside 0..1: "repeat", "clamp" or "mirror"; or a pair of these, for u and v
    name : text, for reports; the path where one was given

    Raises
    ------
    SceneError : a value that is not legal
    ModelError : a file that can't be read as a picture, or is too large
    """

    image: NDArray[np.float32]
    filter: Filter = "trilinear"
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    name: str = ""

    if TYPE_CHECKING:  # more may be given than is stored

        def __init__(
            self,
            image: ImageLike,
            filter: Filter = ...,
            wrap: Wrap | tuple[Wrap, Wrap] = ...,
            name: str = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        choice(self.filter, FILTERS, "the texture's filter")
        wrap: Any = (self.wrap, self.wrap) if isinstance(self.wrap, str) else self.wrap
        if not isinstance(wrap, (tuple, list)) or len(wrap) != 2:
            raise SceneError(f"the texture's wrap must be one word, or two for u and v; given {shown(self.wrap)}")
        store(self, wrap=several(wrap, WRAPS, "the texture's wrap"))
        text(self.name, "the texture's name")
        image: Any = self.image
        if isinstance(image, (str, os.PathLike)):
            store(self, name=self.name or os.fsdecode(image))
            image = read_picture(image, os.fsdecode(image))
        elif hasattr(image, "to_array"):  # PyVista's
            image = image.to_array()
        elif hasattr(image, "convert"):
            try:
                _check_size(image, "the image")
                image = _pixels_of(image, "the image")
            except ModelError as fault:
                raise SceneError(str(fault)) from fault
            except _PICTURE_FAULTS as fault:
                what = f"a texture's image can't be decoded ({_reason(fault)})"
                raise SceneError(f"{what}; given {shown(image)}") from fault
        image = _checked_image(image)
        store(self, _encoded=image if image.dtype == np.uint8 else None, image=image)
        if image.dtype == np.uint8:
            object.__delattr__(self, "image")  # made when it is asked for

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Decode the image of bytes when it is asked for first; it is kept."""
            if name != "image" or self.__dict__.get("_encoded") is None:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            store(self, image=_decoded(self.encoded, self.decoded))
            return self.__dict__["image"]

    @property
    def encoded(self) -> NDArray[np.uint8] | None:
        """The bytes that were given, (h, w, 1..4) uint8, read-only; None where floats were."""
        encoded: NDArray[np.uint8] | None = self.__dict__["_encoded"]
        return encoded

    _is_of_numbers = False

    @property
    def decoded(self) -> NDArray[np.float32]:
        """What a byte of colour and one of alpha mean, (2, 256) float32: one array for all textures of a kind."""
        return NUMBERS_OF_BYTES if self._is_of_numbers else COLORS_OF_BYTES

    @classmethod
    def of_numbers(cls, image: ImageLike, **settings: Any) -> "Texture":
        """Return a texture of an image that holds numbers: its 8 bits are 0..1, and not sRGB-encoded.

        Parameters
        ----------
        image : as the class takes it
        settings : the other fields
        """
        texture = cls(image, **settings)
        store(texture, _is_of_numbers=texture.encoded is not None)
        return texture

    def __repr__(self) -> str:
        name = f"{self.name!r}, " if self.name else ""
        height, width = self.shape
        return f"Texture({name}{width} x {height}, {self.filter}, {'/'.join(self.wrap)})"

    @property
    def shape(self) -> tuple[int, int]:
        """(h, w), texels."""
        height, width = (self.image if self.encoded is None else self.encoded).shape[:2]
        return height, width

    @cached_property
    def has_alpha(self) -> bool:
        """Whether any texel lets something through; numbers don't."""
        if self._is_of_numbers:
            return False
        if self.encoded is None:
            return bool(least_of(self.image)[3] < 1.0)
        return self.encoded.shape[2] in (2, 4) and bool(least_of(self.encoded)[-1] < 255)

    @cached_property
    def brightest(self) -> float:
        """The largest value of red, green and blue."""
        if self.encoded is None:
            return float(self.image.max(axis=0).max(axis=0)[:3].max())
        n_color = self.encoded.shape[2] - (self.encoded.shape[2] in (2, 4))
        return float(self.decoded[0, self.encoded.max(axis=0).max(axis=0)[:n_color].max()])

    @cached_property
    def mean(self) -> NDArray[np.float64]:
        """The mean of all texels, (4,)."""
        if self._is_of_numbers and self.encoded is not None:
            return mean_of_numbers(self.encoded)
        return self.image.mean(axis=(0, 1), dtype=np.float64)

    @cached_property
    def least(self) -> NDArray[np.float64]:
        """The least of all texels in each channel, (4,)."""
        if self.encoded is None:
            return least_of(self.image).astype(np.float64)
        return _decoded(least_of(self.encoded)[None, None], self.decoded)[0, 0].astype(np.float64)

    @cached_property
    def pyramid(self) -> tuple[NDArray[np.float32], ...]:
        """The picture and its mipmaps, (h, w, 4) float32 each, read-only, the last one with a single texel; the picture
        alone where the filter needs no mipmaps.

        Colours are multiplied by their alpha, so that clear texels add nothing to a mean. A level has half of the
        texels of the one before along each axis, rounded down, but at least one; each is the mean of the area that it
        covers (Williams 1983, Pyramidal parametrics, for even numbers).
        """
        levels = [multiplied(self.image) if self.has_alpha else self.image]
        while len(levels) < self.n_level:
            levels.append(_halve(levels[-1]))
        return tuple(levels)

    def halved(self, n_halving: int) -> "Texture":
        """Return the same with a picture that is halved so often: each texel is the mean of those whose place it takes,
        weighted by alpha."""
        image: Any = self.image if self.encoded is None else _halved(self.encoded, n_halving)
        if self.encoded is None:
            for _ in range(n_halving):
                image = _halve(multiplied(image))
                alpha = image[..., 3:]
                image = np.concatenate([image[..., :3] / np.where(alpha > 0.0, alpha, 1.0), alpha], axis=2)
        make = Texture.of_numbers if self._is_of_numbers else Texture
        return make(image, filter=self.filter, wrap=self.wrap, name=self.name)

    @property
    def n_level(self) -> int:
        """How many the picture and its mipmaps are."""
        return max(self.shape).bit_length() if self.filter == "trilinear" else 1


def least_of(image: NDArray[Any]) -> NDArray[Any]:
    """The least value of each channel of an image (h, w, n): of columns first, as numpy takes rows as vectors."""
    return image.min(axis=0).min(axis=0)


TextureLike: TypeAlias = Texture | ImageLike  # what a material takes for one


def max_texels() -> int:
    """Return how many texels a picture may have that is read from a file: MAX_IN_PICTURE, or what RASTER_MOST_TEXELS
    says.

    Raises SceneError where that is no whole number above 0.
    """
    given = os.environ.get(ENVIRONMENT)
    if given is None:
        return MAX_IN_PICTURE
    if not (given.isascii() and given.isdigit() and 0 < len(given) < 19 and int(given) > 0):
        raise SceneError(f"{ENVIRONMENT} must be a whole number above 0; given {shown(given)}")
    return int(given)


class Budget:
    """Count the texels of all textures of one file; where they are too many in sum, all are halved alike, once or more.

    Pictures count a quarter when they are read (4 bytes a texel), and in full for every texture made of them (16, or 21
    with mipmaps), so that a file that uses one picture in a thousand ways takes no more. A picture of one colour packs
    to a thousandth: so textures may have TEXELS_A_BYTE texels for each byte of their pictures, or LEAST_TEXELS where
    that is more, and twice as many as one picture at most. RASTER_MOST_TEXELS takes the first of these limits away.

    Pictures and textures are halved as soon as it is known that they must be: those that come later when they are read,
    others by `fitted` and `fit`.

    Parameters
    ----------
    name : text, the file, for warnings
    """

    def __init__(self, name: str = "") -> None:
        self.name, self.n_halving = name, 0
        self._n_byte = self._n_read = self._n_texel = 0  # of pictures; of these, and of all as they would be in full
        self._kept: dict[int, tuple[Any, int]] = {}  # pictures and textures by their id, and how often each was halved
        self._fitted: dict[int, Texture] = {}

    @property
    def limit(self) -> int:
        """How many texels there may be beside the pictures read so far."""
        limit = 2 * max_texels()
        return limit if ENVIRONMENT in os.environ else min(limit, max(LEAST_TEXELS, TEXELS_A_BYTE * self._n_byte))

    def read(self, size: tuple[int, int], n_byte: int, name: str) -> int:
        """Count a picture of so many texels and bytes that is to be read; return how often it is halved.

        Raises ModelError where pictures that are far smaller in the file ask for more than is ever decoded.
        """
        n_texel = math.prod(size)
        self._n_byte += n_byte
        self._n_read += n_texel
        most = max(8 * max_texels(), MOST_TEXELS_A_BYTE * self._n_byte)
        if self._n_read > most:
            raise ModelError(f"{name}: the pictures of this file have more than {most} texels together")
        self._count(n_texel // 4)
        return self.n_halving

    def keep(self, pixels: NDArray[np.uint8], n_halving: int) -> NDArray[np.uint8]:
        """Remember how often a picture was halved when it was read; return it."""
        self._kept[id(pixels)] = pixels, n_halving
        return pixels

    def fitted(self, pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a picture that was kept as it is to be used now: all of a texture's have been halved as often."""
        n_halving = self._kept[id(pixels)][1] if id(pixels) in self._kept else self.n_halving
        return _halved(pixels, self.n_halving - n_halving)

    def add(self, texture: "Texture", n_halving: int | None = None) -> "Texture":
        """Count a texture, which was made of fitted pictures, or whose pixels were halved so often; return it."""
        n_halving = self.n_halving if n_halving is None else n_halving
        self._kept[id(texture)] = texture, n_halving
        self._count(math.prod(texture.shape) << 2 * n_halving)
        return texture

    def _count(self, n_texel: int) -> None:
        """Count texels, as they would be in full."""
        self._n_texel += n_texel
        while self._n_texel >> 2 * self.n_halving > self.limit:
            self.n_halving += 1

    def fit(self, texture: "Texture") -> "Texture":
        """Return a texture that was added, halved as often as all are when everything has been read."""
        kept, n_halving = self._kept.get(id(texture), (texture, self.n_halving))
        if n_halving == self.n_halving:
            return kept
        if id(texture) not in self._fitted:
            self._fitted[id(texture)] = texture.halved(self.n_halving - n_halving)
        return self._fitted[id(texture)]

    def fit_material(self, material: Any) -> Any:
        """Return a material with its textures as `fit` returns them; itself where they stay what they are."""
        given = {name: getattr(material, name) for name in ("texture", "metallic_roughness")}
        found = {name: self.fit(texture) for name, texture in given.items() if texture is not None}
        return material if all(found[name] is given[name] for name in found) else replace(material, **found)

    def warn(self) -> None:
        """Warn once where textures were halved."""
        if self.n_halving:
            what = f"its textures have {self._n_texel} texels, more than {self.limit}"
            size = f"all are read at 1/{1 << self.n_halving} of their size"
            warn_caller(f"{self.name}: {what}: {size}; {ENVIRONMENT} raises that")


def mean_of_numbers(pixels: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the mean (4,) of pixels of 1 to 4 channels that hold numbers, within 0..1."""
    sums = pixels.sum(axis=0, dtype=np.int64).sum(axis=0)  # exact, and 20 times as fast as a mean
    mean = np.atleast_1d(sums) / (pixels.shape[0] * pixels.shape[1]) / 255.0
    alpha = mean[-1] if len(mean) in (2, 4) else 1.0
    return np.array([*np.broadcast_to(mean[:1] if len(mean) < 3 else mean[:3], 3), alpha])


def read_picture(
    source: str | os.PathLike[str] | IO[bytes],
    name: str,
    budget: Budget | None = None,
    decoded: NDArray[np.uint8] | None = None,
) -> NDArray[np.uint8]:
    """Read a picture file.

    Parameters
    ----------
    source : path, or binary file object
    name : text, what the message calls it
    budget : Budget of the file that names the picture; None = there is no other picture
    decoded : its pixels, where `decode_ahead` has decoded it

    Returns
    -------
    (h, w) or (h, w, 2..4) uint8, sRGB-encoded, as the file has it, or halved where `budget` says so; read-only.
    Palettes and rarer modes as RGBA

    Raises
    ------
    ModelError : a file that can't be read as a picture, is of another format than `FORMATS`, or too large
    """
    from PIL import Image, UnidentifiedImageError

    _silence_log()
    try:
        n_byte = 0 if isinstance(source, (str, os.PathLike)) else source.seek(0, os.SEEK_END) - source.seek(0)
        with Image.open(source, formats=FORMATS) as picture:
            size = "{} x {}".format(*picture.size)
            _check_size(picture, name)
            most = {"WEBP": MAX_WEBP, "BMP": MAX_RLE}.get(picture.format or "", math.inf)
            is_packed = picture.format != "BMP" or picture.info.get("compression") in (1, 2)  # in runs
            if 0 < TEXELS_A_BYTE * n_byte < math.prod(picture.size) > most and is_packed:
                raise ModelError(f"{name}: a {picture.format} picture of {size} in {n_byte} bytes is not read")
            tile = [picture.tag_v2.get(tag, 1) for tag in _TILE_SIZE] if picture.format == "TIFF" else [1]
            if math.prod(tile) > max_texels():
                raise ModelError(f"{name}: a TIFF picture with tiles of {tile[0]} x {tile[1]} is not read")
            n_halving = 0 if budget is None else budget.read(picture.size, n_byte, name)
            if n_halving:
                decoded = None
            if decoded is None:
                decoded = _pixels_of(picture, name) if n_halving == 0 else _reduced(picture, n_halving)
    except (ModelError, SceneError):
        raise
    except UnidentifiedImageError as fault:
        raise ModelError(f"{name}: can't be read as a picture: is none of {', '.join(FORMATS)}") from fault
    except Image.DecompressionBombError as fault:
        most = 2 * (Image.MAX_IMAGE_PIXELS or 0)
        raise ModelError(f"{name}: can't be read as a picture: more than {most} texels") from fault
    except _PICTURE_FAULTS as fault:
        raise ModelError(f"{name}: can't be read as a picture ({_reason(fault)})") from fault
    return fixed(decoded) if budget is None else budget.keep(fixed(decoded), n_halving)


def decode_ahead(pictures: Iterable[tuple[Any, bytes | memoryview]]) -> dict[Any, NDArray[np.uint8]]:
    """Decode pictures of one file on threads, for `read_picture`, which counts them and says what is wrong with them.

    It decodes what is left out here: all from the first one on that is damaged, of a rarer format, or has too many
    texels or far more bytes than texels; and palettes.

    Parameters
    ----------
    pictures : (key, bytes) of each, in the order in which they will be read

    Returns
    -------
    their pixels, by key
    """
    from PIL import Image

    _silence_log()
    budget, opened = Budget(), {}
    for key, data in pictures:
        try:
            picture = Image.open(BytesIO(data), formats=_DECODED_AHEAD)
            _check_size(picture, "")
            n_texel = math.prod(picture.size)
            if len(data) > 8 * n_texel + 2**16 or budget.read(picture.size, len(data), "") > 0:
                break
        except (ModelError, SceneError, *_PICTURE_FAULTS, Image.DecompressionBombError):
            break
        if _is_plain(picture):
            opened[key] = picture
    n_thread = min(len(opened), n_core())
    if n_thread < 2:
        return {}
    with Workers(n_thread) as workers:
        decoded = zip(opened, workers.map(_pixels_or_none, opened.values()), strict=True)
        return {key: pixels for key, pixels in decoded if pixels is not None}


_DECODED_AHEAD = ("PNG", "JPEG")  # what most pictures are


def _pixels_or_none(picture: "Image.Image") -> NDArray[np.uint8] | None:
    """The pixels of a picture whose mode is kept; None where it can't be decoded. Pillow's own are given back."""
    try:
        with closing(picture):
            return _copied(picture)
    except _PICTURE_FAULTS:
        return None


def _silence_log() -> None:
    """Keep Pillow's errors from stderr, where they would go without any handler; who wants them adds his own."""
    import logging

    log = logging.getLogger("PIL")
    if not log.handlers:
        log.addHandler(logging.NullHandler())


def _check_size(picture: "Image.Image", name: str) -> None:
    """Raise ModelError for a picture whose header asks for more texels than may be made, or passes over them."""
    width, height = picture.size
    if max(width, height) > MAX_TEXELS:
        raise ModelError(f"{name}: a texture has up to {MAX_TEXELS} texels a side; this picture has {width} x {height}")
    if width * height > max_texels():
        fault = f"has more than {max_texels()} texels, the most that are read; {ENVIRONMENT} raises that"
        raise ModelError(f"{name}: this picture of {width} x {height} {fault}")
    stream: Any = getattr(picture, "fp", None)
    if picture.format == "JPEG" and stream is not None:
        at = stream.tell()
        stream.seek(0)
        n_scan = stream.read().count(b"\xff\xda")
        stream.seek(at)
        if n_scan * width * height > MAX_SCANNED:
            raise ModelError(f"{name}: a JPEG picture of {width} x {height} in {n_scan} scans is not read")


def _reduced(picture: "Image.Image", n_halving: int) -> NDArray[np.uint8]:
    """Return a picture that is halved, RGBA: each block of texels has become one, their mean, weighted by alpha."""
    (width, height), divisor = picture.size, 1 << n_halving
    across, down = min(divisor, width), min(divisor, height)
    out = np.empty((height // down, width // across, 4), np.uint8)
    n_row = max(1, _STRIP // (width * down))
    for top in range(0, len(out), n_row):
        bottom = min(top + n_row, len(out))
        strip = picture.crop((0, top * down, out.shape[1] * across, bottom * down)).convert("RGBA")
        out[top:bottom] = np.asarray(strip.reduce((across, down)))
    return out


def _halved(pixels: NDArray[np.uint8], n_halving: int) -> NDArray[np.uint8]:
    """Return the pixels of a picture (h, w, ..), halved as `_reduced` does."""
    from PIL import Image

    if n_halving == 0:
        return pixels
    is_grey = pixels.ndim == 3 and pixels.shape[2] == 1
    return fixed(_reduced(Image.fromarray(pixels[..., 0] if is_grey else pixels), n_halving))


def _reason(fault: Exception) -> str:
    """What an error of Pillow's says, on one line and not too long."""
    text = " ".join(str(getattr(fault, "strerror", None) or fault).split())
    return shown(text)[1:-1] if text else type(fault).__name__


def _pixels_of(picture: "Image.Image", name: str) -> NDArray[np.uint8]:
    """The pixels of a PIL image, in 8 bits; palettes and rarer modes as RGBA. ModelError for numbers of 32 bits."""
    if picture.mode.startswith("I;16"):  # PIL would cut off what is above 255
        wide = np.asarray(picture)
        pixels = np.empty(wide.shape, np.uint8)
        for rows in _strips(*wide.shape):
            pixels[rows] = np.rint(wide[rows] / 257.0)
        return pixels
    if picture.mode in ("I", "F"):  # what is black and what white isn't said; PIL would cut off what is above 255
        fault = "its texels are numbers of 32 bits; 8 and 16 bits are read"
        raise ModelError(f"{name}: can't be read as a picture: {fault}")
    return _copied(picture if _is_plain(picture) else picture.convert("RGBA"))


def _copied(picture: "Image.Image") -> NDArray[np.uint8]:
    """The pixels of a PIL image of 8 bits, copied strip by strip: Pillow makes two copies of what it hands out."""
    (width, height), n_channel = picture.size, len(picture.getbands())
    out = np.empty((height, width, n_channel) if n_channel > 1 else (height, width), np.uint8)
    for rows in _strips(height, width):
        out[rows] = np.asarray(picture.crop((0, rows.start, width, min(rows.stop, height))))
    return fixed(out)


def _is_plain(picture: "Image.Image") -> bool:
    """Tell whether the pixels of a PIL image are taken as they are."""
    return picture.mode in ("L", "LA", "RGB", "RGBA") and "transparency" not in picture.info


def _strips(height: int, width: int) -> list[slice]:
    """Cut rows into strips, so that what is computed on the way needs little room beside the picture."""
    n_row = max(1, _STRIP // width)
    return [slice(start, min(start + n_row, height)) for start in range(0, height, n_row)]


def _checked_image(image: Any) -> NDArray[Any]:
    """Return an image that nobody can change: of bytes as (h, w, 1..4) uint8, of floats as (h, w, 4) float32."""
    try:
        array = own_array(image)
    except SceneError:
        raise
    except ValueError:  # lists of several lengths
        array = np.empty(0, object)
    array = array[..., None] if array.ndim == 2 else array
    is_shaped = array.ndim == 3 and array.shape[2] in (1, 2, 3, 4) and 1 <= min(array.shape[:2])
    if not is_shaped or max(array.shape[:2]) > MAX_TEXELS or array.dtype.kind not in "uf":
        legal = f"(h, w) or (h, w, 1..4), uint8 or float, up to {MAX_TEXELS} texels a side"
        raise SceneError(f"a texture's image must be {legal}; given {array.shape} {array.dtype}")
    if array.dtype.kind == "u" and array.dtype != np.uint8:
        raise SceneError(f"a texture's image of integers must be uint8; given {array.dtype}")
    if array.dtype == np.uint8:
        return fixed(array)
    out = np.empty((*array.shape[:2], 4), np.float32)
    has_alpha = array.shape[2] in (2, 4)
    for rows in _strips(*array.shape[:2]):
        source, part = array[rows], out[rows]
        with np.errstate(over="ignore"):  # what float32 can't hold becomes infinite, and is refused
            part[..., :3] = source[..., : array.shape[2] - has_alpha]
            part[..., 3] = source[..., -1] if has_alpha else 1.0
        if not (np.isfinite(part).all() and part.min() >= 0.0 and part[..., 3].max() <= 1.0):
            raise SceneError("a texture's image must be finite and at least 0, its alpha within 0..1")
    return fixed(out)


def _decoded(encoded: NDArray[np.uint8], decoded: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the linear image (h, w, 4) of bytes (h, w, 1..4); `decoded` says what they mean."""
    out, has_alpha = np.empty((*encoded.shape[:2], 4), np.float32), encoded.shape[2] in (2, 4)
    for rows in _strips(*encoded.shape[:2]):
        source, part = encoded[rows], out[rows]
        part[..., :3] = decoded[0][source[..., : encoded.shape[2] - has_alpha]]
        part[..., 3] = decoded[1][source[..., -1]] if has_alpha else 1.0
    return fixed(out)


_SHARES = np.arange(256) / 255.0
COLORS_OF_BYTES = fixed(np.stack([LINEAR_OF_BYTE, _SHARES]).astype(np.float32))  # sRGB-encoded, alpha linear
NUMBERS_OF_BYTES = fixed(np.stack([_SHARES, _SHARES]).astype(np.float32))


def multiplied(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return an image (h, w, 4) whose colours are multiplied by their alpha."""
    return fixed(np.concatenate([image[..., :3] * image[..., 3:], image[..., 3:]], axis=2))


def _halve(level: NDArray[np.float32]) -> NDArray[np.float32]:
    """The next mipmap, made in strips of its rows."""
    n_row, n_column = (max(n // 2, 1) for n in level.shape[:2])
    half = np.empty((n_row, n_column, 4), np.float32)
    for rows in _strips(n_row, 2 * n_column):
        # Of n = 2 m + 1 rows, the new one k needs rows 2 k to 2 k + 2.
        halve_rows(level[2 * rows.start : 2 * rows.stop + 1], len(level), rows.start, half[rows])
    half.flags.writeable = False
    return half


def halve_rows(source: NDArray[np.float32], height: int, first: int, out: NDArray[np.float32]) -> None:
    """Write some rows of the next mipmap, in float64 between.

    Parameters
    ----------
    source : (2 m or more, w, 4), the rows from 2·first on of a level that has `height` of them
    out : (m, max(w // 2, 1), 4), those from `first` on
    """
    width = source.shape[1]
    source = source if height == 1 else source[: 2 * len(out) + height % 2]
    if height % 2 == 0 and width % 2 == 0:  # what is computed below is the mean of four texels, bit for bit
        pairs = np.add(source[0::2], source[1::2], dtype=np.float64)
        np.multiply(pairs[:, 0::2] + pairs[:, 1::2], 0.25, out=out, casting="same_kind")
        return
    out[:] = _halve_axis(_halve_axis(source.astype(np.float64), 0, height, first), 1, width)


def _halve_axis(array: NDArray, axis: int, n: int, first: int = 0) -> NDArray:
    """Means of what each of half as many texels covers along an axis of n: of all, or of those for the new ones from
    `first` on.

    Of n = 2 m + 1 texels, the new one with the number k covers the range from k·n/m to (k + 1)·n/m, that is from 2 k +
    k/m to 2 k + 2 + (k + 1)/m: the share 1 - k/m of texel 2 k, all of the next, and the share (k + 1)/m of the one
    after.
    """
    if n == 1:
        return array
    m = n // 2
    rows = np.moveaxis(array, axis, 0)
    if n % 2 == 0:
        return np.moveaxis((rows[0::2] + rows[1::2]) / 2.0, 0, axis)
    k = np.arange(first, first + len(rows) // 2).reshape(-1, *[1] * (array.ndim - 1))
    total = (1.0 - k / m) * rows[0:-1:2] + rows[1::2] + ((k + 1) / m) * rows[2::2]
    return np.moveaxis(total * (m / n), 0, axis)
