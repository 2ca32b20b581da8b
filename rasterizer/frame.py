"""What a render returns: the picture and the buffers as plain arrays, with the ways to show and save them."""

import io
import os
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .errors import OutputError, SceneError

ARRAYS = ("color", "depth", "face", "normal")  # saved as .npy by name


@dataclass(frozen=True)
class Stats:
    """What happened on the way to a picture.

    `milliseconds` is a dict of stage to time; `error_bound` is the error that the chosen paths may have, in linear intensity.
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
    alpha : (height, width) float32, covered share of each pixel; 1 with a background
    depth : (height, width) float32, distance along the viewing axis in scene units, inf where nothing is
    face : (height, width) int32, index of the face as loaded, -1 where nothing is
    normal : (height, width, 3) float32, unit normal in world space, towards the viewer, 0 where nothing is
    stats : Stats

    An array that was not asked for raises SceneError, which says what to ask for.
    """

    def __init__(self, rgba, arrays: dict, stats: Stats, size: tuple[int, int]):
        self._rgba = rgba  # (height, width, 4) uint8 or None
        self._arrays = arrays
        self.stats = stats
        self.size = size

    def __repr__(self) -> str:
        width, height = self.size
        names = [name for name in ("rgb", *ARRAYS) if self._has(name)]
        total = sum(self.stats.milliseconds.values())
        return (
            f"<Frame {width}x{height} {'+'.join(names)}, {self.stats.faces} faces, "
            f"{100 * self.stats.coverage:.1f} % covered, {total:.1f} ms>"
        )

    def _has(self, name) -> bool:
        return self._rgba is not None if name == "rgb" else name in self._arrays

    def _get(self, name) -> np.ndarray:
        if name in self._arrays:
            return self._arrays[name]
        raise SceneError(f"this frame has no {name}: ask for it with outputs=({name!r}, ...)")

    @property
    def rgba(self) -> np.ndarray:
        """(height, width, 4) uint8: sRGB and alpha, not premultiplied."""
        if self._rgba is None:
            raise SceneError("this frame has no picture: ask for it with outputs=('color', ...) or ('rgb', ...)")
        return self._rgba

    @property
    def rgb(self) -> np.ndarray:
        """(height, width, 3) uint8, sRGB."""
        return self.rgba[..., :3]

    @property
    def alpha(self) -> np.ndarray:
        """(height, width) float32, covered share of each pixel."""
        if "alpha" in self._arrays:
            return self._arrays["alpha"]
        return self.rgba[..., 3] / np.float32(255)

    @property
    def color(self) -> np.ndarray:
        """(height, width, 3) float32, linear."""
        return self._get("color")

    @property
    def depth(self) -> np.ndarray:
        """(height, width) float32, scene units along the viewing axis; inf where nothing is."""
        return self._get("depth")

    @property
    def face(self) -> np.ndarray:
        """(height, width) int32, face index as loaded; -1 where nothing is."""
        return self._get("face")

    @property
    def normal(self) -> np.ndarray:
        """(height, width, 3) float32, unit, world space; 0 where nothing is."""
        return self._get("normal")

    def __array__(self, dtype=None, copy=None) -> np.ndarray:
        """The picture as (height, width, 4) uint8."""
        return np.array(self.rgba, dtype=dtype, copy=copy)

    def to_pil(self):
        """Return the picture as a `PIL.Image`: RGB where every pixel is opaque, else RGBA."""
        from PIL import Image

        is_opaque = bool((self.rgba[..., 3] == 255).all())
        return Image.fromarray(np.ascontiguousarray(self.rgb if is_opaque else self.rgba))

    def _repr_png_(self) -> bytes | None:
        """What a notebook shows."""
        if self._rgba is None:
            return None
        stream = io.BytesIO()
        self.to_pil().save(stream, "PNG")
        return stream.getvalue()

    def save(self, path, *, array: str = "color", format: str | None = None, **options) -> Path:
        """Write the picture, or a buffer; the file appears whole or not at all.

        Parameters
        ----------
        path : where to; the suffix chooses the format: whatever Pillow writes (transparency is laid on white where a format
            has none), or `.npy` for an array
        array : which array a `.npy` file holds: "color", "rgb", "rgba", "alpha", "depth", "face" or "normal"
        format : overrides the suffix, as Pillow's names: "PNG", "JPEG", ...
        options : passed to Pillow, e.g. compress_level=1 or quality=95

        Returns the path. Raises OutputError if it can't be written or the format is unknown.
        """
        path = Path(path)
        is_array = (format or path.suffix.lstrip(".")).lower() == "npy"
        content = self._npy(array) if is_array else self.encode(format or path.suffix, **options)
        write_whole(path, content)
        return path

    def _npy(self, array) -> bytes:
        """An array as the bytes of a .npy file."""
        if array not in ("rgb", "rgba", "alpha", *ARRAYS):
            raise SceneError(f"array must be one of rgb, rgba, alpha, {', '.join(ARRAYS)}; given {array!r}")
        stream = io.BytesIO()
        np.save(stream, getattr(self, array))
        return stream.getvalue()

    def encode(self, format: str = "PNG", **options) -> bytes:
        """Return the picture as the bytes of a file in a format that Pillow writes, by name or suffix."""
        from PIL import Image

        image = self.to_pil()
        Image.init()
        name = format.upper().lstrip(".")
        name = Image.registered_extensions().get(f".{name.lower()}", name)
        if name not in Image.SAVE:
            raise OutputError(f"can't write {format!r} files; legal are .npy and {_legal_suffixes()}")
        stream = io.BytesIO()
        try:
            image.save(stream, name, **options)
        except OSError:
            # The format has no alpha channel.
            image = image.convert("RGBA")
            flat = Image.new("RGBA", image.size, "white")
            flat.alpha_composite(image)
            stream = io.BytesIO()
            flat.convert("RGB").save(stream, name, **options)
        return stream.getvalue()


def _legal_suffixes() -> str:
    from PIL import Image

    return ", ".join(sorted(suffix for suffix, name in Image.registered_extensions().items() if name in Image.SAVE))


def write_whole(path: Path, content: bytes) -> None:
    """Write a file beside its place and move it there, so that nobody ever sees half of it."""
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}-", delete=False) as stream:
            temporary = Path(stream.name)
            try:
                stream.write(content)
                stream.close()
                mask = os.umask(0)
                os.umask(mask)
                temporary.chmod(0o666 & ~mask)
                temporary.replace(path)
            except OSError:
                temporary.unlink(missing_ok=True)
                raise
    except OSError as error:
        raise OutputError(f"can't write {path}: {error.strerror or error}") from error
