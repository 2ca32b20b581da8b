"""What a render returns: the picture and the buffers as plain arrays, with the ways to show and save them."""

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .choices import ARRAY_SUFFIXES, SAVED_ARRAYS, SavedArray, Scale
from .errors import OutputError, SceneError, counted, shown
from .io.files import write_whole
from .io.formats import encoded, on_white, picture_format
from .io.png import encode_png
from .keywords import checked_keywords
from .picking import PICKED, FrameSource, Pick, checked_pixel, make_pick

if TYPE_CHECKING:
    from PIL import Image

    from .engine.plan import PlanSummary
    from .scene.camera import Camera


@dataclass(frozen=True)
class Stats:
    """What happened on the way to a picture.

    Parameters
    ----------
    faces : triangles of the scene
    clipped : triangles with a corner that is behind the near plane, beyond a far plane or too far beside the picture to
        be placed
    culled : triangles left out because they showed their back, or the inner side of a closed body: see `Options.cull`
    drawn : triangles that may cover a sample: those with small boxes that cover none are left out
    covered : samples that something covers
    samples : samples of the picture
    threads : how many worked
    error_bound : how far an intensity may be off, in linear intensity where 1 is white, against the exact illumination
        of the same faces at the same samples, by rounding and what is approximated: the tolerance where something is
        lit in float32, else 1e-6 of full scale, 2e-5 with textures; which is 1, or the largest intensity of the scene
        (`plan.bound`) where that is above. None where none is stated: then `steps` says why. What rounding of vertices
        to 1/256 px changes is no part of it, see `position_bound`, nor are shadow maps and texture filters. By Phong's
        method it doesn't hold where corners' normals look so far apart that their mean is shorter than an eighth. 0
        where no picture was asked for
    milliseconds : dict of stage to time
    steps : tuple of (cause, near, unit): where the illumination of this scene jumps, so that no error is small, and how
        near to that the bound doesn't hold; infinite where none is stated at all. Empty where it holds everywhere
    plan : PlanSummary, what the picture needed
    """

    faces: int
    clipped: int
    culled: int
    drawn: int
    covered: int
    samples: int
    threads: int
    error_bound: float | None
    milliseconds: dict[str, float] = field(default_factory=dict)
    steps: tuple[Any, ...] = ()
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


class MissingArray(SceneError, AttributeError):
    """A frame doesn't have what wasn't asked for; an AttributeError, so that `hasattr` and `getattr` can ask, too."""


def _array(name: str, what: str) -> Any:
    """Return the property of a frame that is one of its arrays; `what` is said of it."""
    return property(lambda frame: frame.array(name), doc=f"{what}.")


class Frame:
    """Hold a rendered picture.

    Attributes
    ----------
    color : (height, width, 3) float32, linear, not limited to 1; where alpha is 0, 0
    rgb : (height, width, 3) uint8, sRGB, not mixed with what lies behind where alpha is below 1; a copy
    alpha : (height, width) float32, covered share of each pixel, weighted by opacity; 1 with a background; in steps of
        1/255 where only "rgb" was asked for
    depth : (height, width) float32, distance along the viewing axis in scene units, inf where nothing is
    face : (height, width) int32, index of the triangle as loaded, -1 where nothing is; `Mesh.polygons` says which
        polygon it is of
    normal : (height, width, 3) float32, unit normal in world space, towards the viewer, 0 where nothing is
    mask : (height, width) bool, whether something is there
    object : (height, width) int32, index of the mesh in `Scene.meshes`, -1 where nothing is
    material : (height, width) int32, index of the material in `Scene.materials`, -1 where nothing is
    uv : (height, width, 2) float32, texture coordinates, NaN where nothing is or the mesh has none
    barycentric : (height, width, 3) float32, weights of the corners of `face`, which sum up to 1, NaN where nothing is
    position : (height, width, 3) float32, world space, NaN where nothing is
    position_camera : (height, width, 3) float32, in the camera's frame: x right, y up, looking down -z; NaN where
        nothing is
    normal_camera : (height, width, 3) float32, `normal` in that frame, 0 where nothing is
    stats : Stats
    size : (width, height) in pixels; `width` and `height` are its parts
    camera : Camera that it was taken with, as for `frame.camera.project(points, frame.size)`; None of a picture with a
        colour bar

    An array that was not asked for raises SceneError, which says what to ask for.
    """

    def __init__(
        self,
        rgba: NDArray[np.uint8] | None,
        arrays: dict[str, NDArray[Any]],
        stats: Stats,
        size: tuple[int, int],
        source: FrameSource | None = None,
    ) -> None:
        self._rgba = rgba  # (height, width, 4) uint8 or None
        self._arrays = arrays
        self.stats: Stats = stats
        self.size: tuple[int, int] = size
        self.camera: Camera | None = None if source is None else source.camera
        self._source = source  # what `pick` asks for what the frame doesn't hold

    def __getstate__(self) -> dict[str, Any]:
        """What is pickled: the arrays, and not the scene."""
        return self.__dict__ | {"_source": None}

    def __repr__(self) -> str:
        width, height = self.size
        names = "+".join(["rgb"] * (self._rgba is not None) + list(self._arrays)).replace("+alpha", "")
        total, faces = sum(self.stats.milliseconds.values()), counted(self.stats.faces, "face")
        size = f"{width}x{height} {names}".strip()
        return f"<Frame {size}, {faces}, {100 * self.stats.coverage:.1f} % covered, {total:.1f} ms>"

    def has(self, name: str) -> bool:
        """Tell whether the frame has `name`: "rgb" (a picture), "color", or a buffer: "depth", "face", "normal" …
        SceneError for what is no text."""
        if not isinstance(name, str):
            raise SceneError(f"a frame has arrays by name; given {shown(name)}")
        return self._rgba is not None if name == "rgb" else name in self._arrays

    def array(self, name: str) -> NDArray[Any]:
        """Return an array by name.

        Parameters
        ----------
        name : text, one of the attributes

        Returns
        -------
        (height, width) or (height, width, n), with the dtype that is said above; not a copy

        Raises
        ------
        SceneError : a name that is unknown, or an array that the frame doesn't have; the message says what to ask for
        """
        if not isinstance(name, str) or name not in SAVED_ARRAYS:
            raise SceneError(f"array must be one of {', '.join(SAVED_ARRAYS)}; given {shown(name)}")
        if name in ("rgb", "rgba", "alpha"):
            return getattr(self, name)
        if name in self._arrays:
            return self._arrays[name]
        raise MissingArray(f"this frame has no {name}: ask for it with outputs=({name!r}, ...)")

    @property
    def rgba(self) -> NDArray[np.uint8]:
        """(height, width, 4) uint8: sRGB and alpha, not premultiplied."""
        if self._rgba is None:
            raise MissingArray("this frame has no picture: ask for it with outputs=('color', ...) or ('rgb', ...)")
        return self._rgba

    @property
    def rgb(self) -> NDArray[np.uint8]:
        """(height, width, 3) uint8, sRGB, a copy without gaps. Where alpha is partial, at outlines and through glass,
        it is the surface's own colour, as in `rgba`, not mixed with what is behind it; black where alpha is 0. So a
        picture that is to be shown without its alpha needs a `background`."""
        return np.ascontiguousarray(self.rgba[..., :3])

    @property
    def alpha(self) -> NDArray[Any]:
        """(height, width) float32, covered share of each pixel."""
        if "alpha" in self._arrays:
            return self._arrays["alpha"]
        return self.rgba[..., 3] / np.float32(255)

    color: NDArray[np.float32] = _array("color", "(height, width, 3) float32, linear")
    depth: NDArray[np.float32] = _array("depth", "(height, width) float32, scene units along the viewing axis, or inf")
    face: NDArray[np.int32] = _array("face", "(height, width) int32, face index as loaded; -1 where nothing is")
    normal: NDArray[np.float32] = _array("normal", "(height, width, 3) float32, unit, world space; 0 where nothing is")
    mask: NDArray[np.bool_] = _array("mask", "(height, width) bool: whether something is there")
    object: NDArray[np.int32] = _array("object", "(height, width) int32, index into `Scene.meshes`, or -1")
    material: NDArray[np.int32] = _array("material", "(height, width) int32, index into `Scene.materials`, or -1")
    uv: NDArray[np.float32] = _array("uv", "(height, width, 2) float32, texture coordinates, or NaN")
    barycentric: NDArray[np.float32] = _array("barycentric", "(height, width, 3) float32, weights of corners, or NaN")
    position: NDArray[np.float32] = _array("position", "(height, width, 3) float32, world space; NaN where nothing is")
    position_camera: NDArray[np.float32] = _array("position_camera", "(height, width, 3) float32, along its axes")
    normal_camera: NDArray[np.float32] = _array("normal_camera", "(height, width, 3) float32, along the camera's axes")

    def pick(self, x: int, y: int) -> Pick | None:
        """Tell what a pixel shows at its centre.

        What the frame doesn't hold is drawn once more: a frame remembers its scene, but not where it was pickled.

        Parameters
        ----------
        x, y : column and row of the pixel, from 0 on; row 0 is the top

        Returns
        -------
        Pick of the nearest surface; None where nothing is

        Raises
        ------
        SceneError : a pixel that the picture doesn't have; a frame that has neither the buffers nor its scene
        """
        x, y = checked_pixel(x, y, self.size)
        if all(name in self._arrays for name in PICKED):
            return make_pick(self._arrays, x, y, None if self._source is None else self._source.scene)
        if self._source is None:
            missing = ", ".join(repr(name) for name in PICKED if name not in self._arrays)
            raise SceneError(f"this frame doesn't know its scene: to pick, ask for outputs=({missing}, ...)")
        return self._source.pick(x, y)

    @property
    def width(self) -> int:
        """Columns of the picture."""
        return self.size[0]

    @property
    def height(self) -> int:
        """Rows of the picture."""
        return self.size[1]

    @property
    def __array_interface__(self) -> dict[str, Any]:
        """What `PIL.Image.fromarray` reads: the picture as (height, width, 4) uint8; numpy shares its memory."""
        return self.rgba.__array_interface__ | {"strides": self.rgba.strides}

    def tobytes(self) -> bytes:
        """Return the bytes of `rgba`, row by row, as `PIL.Image.fromarray` asks for them; SceneError without any."""
        return self.rgba.tobytes()

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        """The picture as (height, width, 4) uint8."""
        return np.array(self.rgba, dtype=dtype, copy=copy)

    def to_pil(self, array: SavedArray | None = None) -> "Image.Image":
        """Return the picture, or an array as one that can be looked at, as a `PIL.Image`: RGB where every pixel is
        opaque, else RGBA.

        Parameters
        ----------
        array : name of an attribute, as "depth" (lighter where it is nearer), "object" (a colour for each), "normal";
            None = the picture. Values are in `array()`, and in the files of `save`

        Raises
        ------
        SceneError : what the frame doesn't have
        """
        from PIL import Image

        if array is None:
            return Image.fromarray(np.ascontiguousarray(self._pixels()))
        from .figures import picture_of

        return Image.fromarray(picture_of(array, self.array(array)))

    def with_colorbar(self, label: str | None = None) -> "Frame":
        """Return a frame whose picture has a colour bar with ticks at its right, of the scalar field that it shows.

        Parameters
        ----------
        label : text above the bar; None = the name of the scalars, where they have one

        Returns
        -------
        Frame with that picture, and without arrays

        Raises
        ------
        SceneError : a scene that shows no scalar field, a frame without a picture or one that was pickled, which
            doesn't know its scene
        """
        from .figures import with_colorbar

        if not (label is None or isinstance(label, str)):
            raise SceneError(f"label must be text or None; given {shown(label)}")
        rgba = with_colorbar(self.rgba, None if self._source is None else self._source.scene, label)
        return Frame(rgba, {}, self.stats, (rgba.shape[1], rgba.shape[0]))

    def show(self, array: SavedArray | None = None) -> None:
        """Show the picture, or an array as `to_pil` does: in the cell of a notebook, else in the program that this
        computer opens pictures with.

        Raises
        ------
        OutputError : there is no such program; the message says what to do instead
        SceneError : what the frame doesn't have
        """
        picture = self.to_pil(array)
        if show_in_notebook(picture):
            return
        from PIL import ImageShow

        if not ImageShow.show(picture):
            raise OutputError("no program is there to show pictures with; frame.save('picture.png') writes a file")

    def _pixels(self) -> NDArray[np.uint8]:
        """The picture as it is saved: (height, width, 3) where every pixel is opaque, else (height, width, 4)."""
        return self.rgb if self.rgba[..., 3].min() == 255 else self.rgba

    def _repr_png_(self) -> bytes | None:
        """What a notebook shows: the picture, if there is one."""
        return None if self._rgba is None else self.encode("PNG")

    @checked_keywords
    def save(
        self,
        path: str | os.PathLike[str],
        *,
        array: SavedArray | Sequence[SavedArray] | None = None,
        format: str | None = None,
        scale: Scale = None,
        **options: Any,
    ) -> Path:
        """Write the picture, or arrays; the file appears whole or not at all.

        Parameters
        ----------
        path : where to; the suffix chooses the format: whatever Pillow writes (transparency is laid on white
            where a format has none), or for arrays `.npy` (one), `.npz`, `.exr` (several) and `.png` (one: mask,
            alpha, and normals in 8 bits, depth and indices in 16), see io/array_files.py
        array : which array, or which ones: names of the attributes. None = the picture; in a `.npy` file "color"; in
            `.npz` and `.exr` files all that the frame has
        format : overrides the suffix: "npy", "npz", "exr" or a name of Pillow's: "PNG", "JPEG", ...
        scale : of depths in a PNG file: the scene units that 1 stands for; None = 0.001; "auto" = so that the
            furthest just fits. The file says it in a text field, and that 0 is nothing
        options : passed to Pillow, e.g. quality=95 for a JPEG file, or dpi=300, pixels an inch; without options a PNG
            file is written by `io.png`, which is faster; a TIFF file has a profile of sRGB

        Returns
        -------
        Path, the same as given

        Raises
        ------
        OutputError : the file can't be written, the format is unknown, or what it needs isn't installed; a value that
            is out of a PNG file's range
        SceneError : an array that is unknown, that the frame doesn't have, or that the format doesn't hold
        """
        if not isinstance(path, (str, os.PathLike)):
            raise SceneError(f"a frame is saved to a path, and frame.encode() gives its bytes; given {shown(path)}")
        path = Path(path)
        write_whole(path, self.encode_file(path.suffix if format is None else format, array, scale, **options))
        return path

    def encode_file(
        self,
        format: str,
        array: SavedArray | Sequence[SavedArray] | None = None,
        scale: Scale = None,
        **options: Any,
    ) -> bytes:
        """Return the picture, or arrays, as the bytes of the file that `save` writes; parameters and errors are its.

        "rgb" and "rgba" in a format that holds pictures alone are the picture.
        """
        if not isinstance(format, str):
            raise SceneError(f"format must be text; given {shown(format)}")
        format = format.lower().lstrip(".")
        if isinstance(array, str) and array in ("rgb", "rgba") and format not in (*ARRAY_SUFFIXES, "png"):
            array = None
        if format in ARRAY_SUFFIXES or array is not None:
            return self.encode_arrays(array, format, scale)
        if scale is not None:
            raise SceneError(f"scale is that of depth in a PNG file: give array='depth'; given scale={shown(scale)}")
        return self.encode(format, **options)

    def encode_array(self, array: SavedArray = "color") -> bytes:
        """Return one of the frame's arrays, by name, as the bytes of a .npy file; errors are those of `array`."""
        return self.encode_arrays(array, "npy")

    def encode_arrays(
        self, array: SavedArray | Sequence[SavedArray] | None = None, format: str = "npz", scale: Scale = None
    ) -> bytes:
        """Return one or several of the frame's arrays as the bytes of a file; parameters and errors are those of
        `save`."""
        from .io.array_files import encode_arrays

        names: list[Any] = list(array) if isinstance(array, (list, tuple)) else [array]
        if array is None:  # all that the frame has, but for copies of each other; "color" says what to ask for
            has_bytes = self._rgba is not None and format == "npz"
            names = ["rgb"] * has_bytes + ["alpha"] * (has_bytes and "alpha" not in self._arrays) + list(self._arrays)
            names = ["color"] if format == "npy" or not names else names
        return encode_arrays({name: self.array(name) for name in names}, format, scale)

    def encode(self, format: str = "PNG", **options: Any) -> bytes:
        """Return the picture as the bytes of a file in a format that Pillow writes, by name or suffix.

        Transparency is laid on white where the format has none; `options` are passed to Pillow. Without options a PNG
        file is written by `io.png`; a TIFF file has a profile of sRGB.

        Raises
        ------
        OutputError : a format that is unknown, or that can't hold the picture
        SceneError : a frame without a picture
        """
        name = picture_format(format)
        if name == "PNG" and not options:
            return encode_png(self._pixels())
        if name == "TIFF" and not options:
            from PIL import ImageCms

            profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
            options = {"icc_profile": profile[:24] + bytes(12) + profile[36:]}  # without the time at which it was made
        if "dpi" in options and not isinstance(options["dpi"], (tuple, list)):
            dots = options["dpi"]
            if isinstance(dots, bool) or not (isinstance(dots, (int, float)) and 0 < dots < 1e5):
                raise SceneError(f"dpi must be a number above 0 and below 100000, or a pair; given {shown(dots)}")
            options["dpi"] = (dots, dots)
        image = self.to_pil()
        try:
            return encoded(image, name, options)
        except (OSError, ValueError) as error:
            if image.mode == "RGB":
                raise OutputError(f"can't write a {name} file: {error}") from error
        try:
            return encoded(on_white(image), name, options)
        except (OSError, ValueError) as error:
            raise OutputError(f"can't write a {name} file: {error}") from error


def show_in_notebook(picture: object) -> bool:
    """Show what has a `_repr_png_` in the cell of a notebook; False where none is running."""
    ipython = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if ipython is None or not hasattr(ipython, "kernel"):  # a shell has no cells
        return False
    sys.modules["IPython"].display.display(picture)
    return True
