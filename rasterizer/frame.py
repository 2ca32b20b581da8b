"""What a render returns: the picture and the buffers as plain arrays, with the ways to show and save them."""

import io
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .choices import BUFFERS, SAVED_ARRAYS, SavedArray
from .errors import OutputError, SceneError, shown
from .io.files import write_and_move
from .io.png import encode_png
from .pipeline.threads import Workers

if TYPE_CHECKING:
    from PIL import Image

    from .engine.plan_summary import PlanSummary


@dataclass(frozen=True)
class Stats:
    """What happened on the way to a picture.

    Parameters
    ----------
    faces : triangles of the scene
    clipped : triangles with a corner that is behind the near plane, beyond a far plane or too far beside the picture to
        be placed
    culled : triangles left out because they showed their back; of a dense mesh, those in parts that lie beside the
        picture are left out before, and not counted
    drawn : triangles that may cover a sample: those with small boxes that cover none are left out
    covered : samples that something covers
    samples : samples of the picture
    threads : how many worked
    error_bound : the largest error of an intensity that the paths of this frame may have, in linear intensity where 1
        is white, against the exact illumination of the same faces at the same samples, or at the same points with
        antialias "shade-once": rounding to float32 or float64, and what was approximated. What rounding of vertices to
        1/256 px changes is no part of it, see `position_bound`. 0 where no picture was asked for
    milliseconds : dict of stage to time
    steps : tuple of (cause, near, unit): where the illumination of this scene jumps, so that no error is small, and how
        near to that the bound doesn't hold. Empty where it holds everywhere
    plan : PlanSummary, what the picture needed
    """

    faces: int
    clipped: int
    culled: int
    drawn: int
    covered: int
    samples: int
    threads: int
    error_bound: float
    milliseconds: dict = field(default_factory=dict)
    steps: tuple = ()
    plan: "PlanSummary | None" = None

    @property
    def position_bound(self) -> float:
        """How far, in px along either axis, a pixel's sample may lie from the point of the polygon that it shows:
        vertices are rounded to 1/256 px. `error_bound` doesn't count this: it compares with a float64 evaluation of the
        rounded polygon."""
        return 0.5 / 256  # pipeline/transform.py: POSITION_BOUND

    @property
    def coverage(self) -> float:
        """Share of the picture's samples that something covers; 0 means that the picture is empty."""
        return self.covered / self.samples


class Frame:
    """Hold a rendered picture.

    Attributes
    ----------
    color : (height, width, 3) float32, linear, not limited to 1; where alpha is 0, 0
    rgb : (height, width, 3) uint8, sRGB
    alpha : (height, width) float32, covered share of each pixel, weighted by opacity; 1 with a background; in steps of
        1/255 where only "rgb" was asked for
    depth : (height, width) float32, distance along the viewing axis in scene units, inf where nothing is
    face : (height, width) int32, index of the face as loaded, -1 where nothing is; of a convex polygon with more than
        three corners, unless it is shaded flat, the triangle that has the edge between which and the centre the sample
        lies
    normal : (height, width, 3) float32, unit normal in world space, towards the viewer, 0 where nothing is
    stats : Stats

    An array that was not asked for raises SceneError, which says what to ask for.
    """

    def __init__(
        self, rgba: NDArray[np.uint8] | None, arrays: dict[str, NDArray], stats: Stats, size: tuple[int, int]
    ) -> None:
        self._rgba = rgba  # (height, width, 4) uint8 or None
        self._arrays = arrays
        self.stats = stats
        self.size = size

    def __repr__(self) -> str:
        width, height = self.size
        names = [name for name in ("rgb", *self._arrays) if name != "alpha" and self.has(name)]
        total = sum(self.stats.milliseconds.values())
        return (
            f"<Frame {' '.join([f'{width}x{height}', '+'.join(names)]).strip()}, {self.stats.faces} faces, "
            f"{100 * self.stats.coverage:.1f} % covered, {total:.1f} ms>"
        )

    def has(self, name: str) -> bool:
        """Tell whether the frame has `name`: "rgb" (a picture), "color", or a buffer: "depth", "face", "normal" …"""
        if not isinstance(name, str):
            raise SceneError(f"a frame has arrays by name; given {shown(name)}")
        return self._rgba is not None if name == "rgb" else name in self._arrays

    def array(self, name: str) -> NDArray:
        """Return an array by name: those of the attributes, and buffers that were added (registries.py).

        Raises SceneError for an array that the frame doesn't have.
        """
        if not isinstance(name, str) or not (name in SAVED_ARRAYS or name in BUFFERS):
            legal = dict.fromkeys((*SAVED_ARRAYS, *BUFFERS))
            raise SceneError(f"array must be one of {', '.join(legal)}; given {shown(name)}")
        if name in ("rgb", "rgba", "alpha"):
            return getattr(self, name)
        if name in self._arrays:
            return self._arrays[name]
        raise SceneError(f"this frame has no {name}: ask for it with outputs=({name!r}, ...)")

    @property
    def rgba(self) -> NDArray[np.uint8]:
        """(height, width, 4) uint8: sRGB and alpha, not premultiplied."""
        if self._rgba is None:
            raise SceneError("this frame has no picture: ask for it with outputs=('color', ...) or ('rgb', ...)")
        return self._rgba

    @property
    def rgb(self) -> NDArray[np.uint8]:
        """(height, width, 3) uint8, sRGB."""
        return self.rgba[..., :3]

    @property
    def alpha(self) -> NDArray[Any]:
        """(height, width) float32, covered share of each pixel."""
        if "alpha" in self._arrays:
            return self._arrays["alpha"]
        return self.rgba[..., 3] / np.float32(255)

    @property
    def color(self) -> NDArray[np.float32]:
        """(height, width, 3) float32, linear."""
        return self.array("color")

    @property
    def depth(self) -> NDArray[np.float32]:
        """(height, width) float32, scene units along the viewing axis; inf where nothing is."""
        return self.array("depth")

    @property
    def face(self) -> NDArray[np.int32]:
        """(height, width) int32, face index as loaded; -1 where nothing is."""
        return self.array("face")

    @property
    def normal(self) -> NDArray[np.float32]:
        """(height, width, 3) float32, unit, world space; 0 where nothing is."""
        return self.array("normal")

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray:
        """The picture as (height, width, 4) uint8."""
        return np.array(self.rgba, dtype=dtype, copy=copy)

    def to_pil(self) -> "Image.Image":
        """Return the picture as a `PIL.Image`: RGB where every pixel is opaque, else RGBA."""
        from PIL import Image

        return Image.fromarray(np.ascontiguousarray(self._pixels()))

    def _pixels(self) -> NDArray[np.uint8]:
        """The picture as it is saved: (height, width, 3) where every pixel is opaque, else (height, width, 4)."""
        return self.rgb if self.rgba[..., 3].min() == 255 else self.rgba

    def _repr_png_(self) -> bytes | None:
        """What a notebook shows: the picture, if there is one."""
        return None if self._rgba is None else self.encode("PNG")

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        array: SavedArray | None = None,
        format: str | None = None,
        **options: Any,
    ) -> Path:
        """Write the picture, or an array; the file appears whole or not at all.

        Parameters
        ----------
        path : where to; the suffix chooses the format: whatever Pillow writes (transparency is laid on white
            where a format has none), or `.npy` for an array
        array : which array a `.npy` file holds: "color" (when None), "rgb", "rgba", "alpha", "depth", "face",
            "normal"
        format : overrides the suffix: "npy" or a name of Pillow's: "PNG", "JPEG", ...
        options : passed to Pillow, e.g. quality=95 for a JPEG file; without options a PNG file is written by `io.png`,
            which is faster, and a TIFF file by `io.tiff`: not compressed, with alpha and a profile of sRGB

        Returns
        -------
        Path, the same as given

        Raises
        ------
        OutputError : the file can't be written, or the format is unknown
        SceneError : an array that is unknown, that the frame doesn't have, or that isn't for a `.npy` file
        """
        if not isinstance(path, (str, os.PathLike)):
            raise SceneError(f"a frame is saved to a path; given {shown(path)}")
        if format is not None and not isinstance(format, str):
            raise SceneError(f"format must be text; given {shown(format)}")
        path = Path(path)
        format = (format or path.suffix).lower().lstrip(".")
        if format == "npy":
            content = self.encode_array(array or "color")
        elif array is not None:
            raise SceneError(f"arrays are written as .npy; given {shown(path.name)} for the array {shown(array)}")
        else:
            content = self.encode(format, **options)
        write_whole(path, content)
        return path

    def encode_array(self, array: SavedArray = "color") -> bytes:
        """Return one of the frame's arrays, by name, as the bytes of a .npy file."""
        stream = io.BytesIO()
        np.save(stream, self.array(array))
        return stream.getvalue()

    def encode(self, format: str = "PNG", **options: Any) -> bytes:
        """Return the picture as the bytes of a file in a format that Pillow writes, by name or suffix.

        Transparency is laid on white where the format has none; `options` are passed to Pillow. Without options a PNG
        file is written by `io.png`, on as many threads as have drawn the picture, and a TIFF file by `io.tiff`.
        """
        name = picture_format(format)
        if name == "PNG" and not options:
            return self._encode_png()
        if name == "TIFF" and not options:
            from .io.tiff import encode_tiff

            return encode_tiff(self.rgba)
        image = self.to_pil()
        try:
            return _encoded(image, name, options)
        except (OSError, ValueError) as error:
            if image.mode == "RGB":
                raise OutputError(f"can't write a {name} file: {error}") from error
        try:
            return _encoded(_on_white(image), name, options)
        except (OSError, ValueError) as error:
            raise OutputError(f"can't write a {name} file: {error}") from error

    def _encode_png(self) -> bytes:
        workers = Workers(getattr(self.stats, "threads", 1))  # a sheet of pictures has no stats
        try:
            return encode_png(self._pixels(), workers.map)
        finally:
            workers.close()


_OWN_FORMATS = {"PNG": "PNG", "TIF": "TIFF", "TIFF": "TIFF"}


def picture_format(name: str) -> str:
    """Return Pillow's name of a format that it writes, given by name or suffix; OutputError if none."""
    if not isinstance(name, str):
        raise SceneError(f"format must be text; given {shown(name)}")
    word = name.upper().lstrip(".")
    if word in _OWN_FORMATS:
        return _OWN_FORMATS[word]  # without importing Pillow, which takes as long as to encode
    from PIL import Image

    Image.init()
    found = Image.EXTENSION.get(f".{word.lower()}", word)
    if found in Image.SAVE:
        return found
    common = "png, jpg, webp, tif, bmp, ppm"
    given = f"{name!r} is unknown" if word else "a file without a suffix has none"
    raise OutputError(f"no format to write: {given}; legal are npy, {common} and others that Pillow writes")


def _encoded(image: "Image.Image", name: str, options: dict[str, Any]) -> bytes:
    """A `PIL.Image` as the bytes of a file."""
    stream = io.BytesIO()
    image.save(stream, name, **options)
    return stream.getvalue()


def _on_white(image: "Image.Image") -> "Image.Image":
    """An RGBA picture laid on white, as RGB."""
    from PIL import Image

    paper = Image.new("RGBA", image.size, "white")
    paper.alpha_composite(image)
    return paper.convert("RGB")


def write_whole(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file beside its place and move it there, so that nobody ever sees half of it.

    A link keeps its name and gets a new target. A file that is protected against writing is refused; one that is
    replaced keeps its mode. Devices and pipes can't be replaced: they are written as they are. Raises OutputError.
    """
    try:
        place = os.path.realpath(path)
        if os.path.exists(place) and not os.path.isfile(place):
            with open(place, "wb") as stream:
                stream.write(content)
        else:
            write_and_move({place: content})
    except OSError as error:
        folder = os.path.dirname(place)
        reason = (error.strerror or str(error)) if os.path.isdir(folder) else f"there is no folder {folder}"
        raise OutputError(f"can't write {path}: {reason}") from error
    except ValueError as error:  # a name that no file can have
        raise OutputError(f"can't write {shown(os.fspath(path))}: {error}") from error
