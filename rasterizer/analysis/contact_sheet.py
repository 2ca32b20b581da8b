"""Several pictures in one: a sheet of rows and columns, for a notebook cell or one file."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError, shown
from ..frame import Frame
from ..keywords import checked_keywords
from ..scene.color import ColorLike, linear_from_srgb_bytes, linear_rgb, srgb_from_linear
from ..scene.validate import whole

if TYPE_CHECKING:
    from PIL import Image, ImageFont

GAP = 8  # pixels between pictures, unless another one is asked for
_MAX_PIXELS = 1 << 28  # a sheet of 1 GB is a mistake
_LABEL_GREY = (128, 128, 128, 255)  # read on white and on black paper


@checked_keywords
def sheet(
    frames: "Sequence[Frame | Image.Image | NDArray[np.uint8]]",
    columns: int | None = None,
    gap: int = GAP,
    background: ColorLike | None = None,
    labels: Sequence[str] | None = None,
) -> "Image.Image":
    """Lay several pictures on one sheet, from left to right and from top to bottom.

    Parameters
    ----------
    frames : sequence of pictures, each a Frame, a PIL.Image or a uint8 array (height, width, 3 or 4); sizes
        may differ, each is centred in its cell
    columns : pictures in a row; None = about as many columns as rows
    gap : pixels between neighbours and around the sheet
    background : colour as `linear_rgb` reads it; None = transparent
    labels : sequence of text, one a picture, written below it, its middle left out where it is too wide; None = no text

    Returns
    -------
    PIL.Image, which a notebook shows and which has `save`: RGBA, or RGB with a background

    Raises
    ------
    SceneError : no pictures, something that is none, or another argument that is not legal
    """
    from PIL import Image

    pictures = [_rgba(frame) for frame in _listed(frames, "frames")]
    if not pictures:
        raise SceneError("a sheet needs at least one picture; given none")
    labels = None if labels is None else [str(label) for label in _listed(labels, "labels")]
    if labels is not None and len(labels) != len(pictures):
        raise SceneError(f"a sheet needs one label a picture; given {len(labels)} for {len(pictures)} pictures")
    columns = whole(columns, "columns", 1) if columns is not None else math.ceil(math.sqrt(len(pictures)))
    columns = min(columns, len(pictures))
    gap = whole(gap, "gap", 0)
    cell_width = max(picture.shape[1] for picture in pictures)
    cell_height = max(picture.shape[0] for picture in pictures)
    step_x, step_y = cell_width + gap, cell_height + gap + (_label_height() if labels else 0)
    width, height = gap + columns * step_x, gap + -(-len(pictures) // columns) * step_y
    if width * height > _MAX_PIXELS:
        raise SceneError(f"a sheet of {width}x{height} px is too large; give it fewer or smaller pictures")
    paper = np.zeros((height, width, 4), np.uint8)
    for i, picture in enumerate(pictures):
        x = gap + i % columns * step_x + (cell_width - picture.shape[1]) // 2
        y = gap + i // columns * step_y + (cell_height - picture.shape[0]) // 2
        paper[y : y + picture.shape[0], x : x + picture.shape[1]] = picture
    image = Image.fromarray(paper if background is None else _laid_on(paper, linear_rgb(background, "the background")))
    for i, label in enumerate(labels or ()):
        middle = gap + i % columns * step_x + cell_width / 2
        _write(image, _fitted(label, cell_width + gap), middle, gap + i // columns * step_y + cell_height + 2)
    return image


def _listed(items: Any, what: str) -> list:
    """A sequence as a list; one picture or one text alone is a mistake that would give a strange sheet."""
    if isinstance(items, (Frame, str)) or not hasattr(items, "__iter__"):
        raise SceneError(f"{what} must be a sequence; given {type(items).__name__}")
    try:
        return list(items)
    except TypeError:  # an array of no dimension
        raise SceneError(f"{what} must be a sequence; given {shown(items)}") from None


def _rgba(source: Any) -> NDArray[np.uint8]:
    """A picture as (height, width, 4) uint8."""
    if hasattr(source, "convert") and hasattr(source, "mode"):
        return np.asarray(source.convert("RGBA"))
    array = np.asarray(source)
    if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] not in (3, 4) or not array.size:
        legal = "a Frame, a PIL.Image or a uint8 array (height, width, 3 or 4)"
        raise SceneError(f"a picture on a sheet must be {legal}; given {type(source).__name__}")
    if array.shape[2] == 4:
        return array
    return np.concatenate([array, np.full((*array.shape[:2], 1), 255, np.uint8)], axis=2)


def _laid_on(paper: NDArray[np.uint8], background: tuple[float, float, float]) -> NDArray[np.uint8]:
    """Blend the sheet with a linear background colour, as the renderer does: in linear light."""
    out = np.empty((*paper.shape[:2], 3), np.uint8)
    for row, line in zip(out, paper, strict=True):
        share = line[:, 3:] / 255.0
        linear = linear_from_srgb_bytes(line[:, :3]) * share + np.array(background) * (1.0 - share)
        row[:] = np.rint(255.0 * srgb_from_linear(np.clip(linear, 0.0, 1.0)))
    return out


def _label_height() -> int:
    """Room for a line of text, pixels."""
    left, top, right, bottom = _font().getbbox("Ág")
    return math.ceil(bottom) + 4


def _fitted(label: str, width: int) -> str:
    """Cut a label in its middle, so that it is no wider than its cell: names differ at both ends."""
    label, font = " ".join(label.split()), _font()
    if font.getlength(label) <= width:
        return label
    cuts = (f"{label[: (n + 1) // 2]}...{label[len(label) - n // 2 :]}" for n in range(len(label) - 2, 1, -1))
    return next((cut for cut in cuts if font.getlength(cut) <= width), "")


def _font() -> "ImageFont.FreeTypeFont | ImageFont.ImageFont":
    from PIL import ImageFont

    return ImageFont.load_default()


def _write(image: "Image.Image", label: str, middle: float, top: float) -> None:
    """Write a line of text, centred."""
    from PIL import ImageDraw

    draw, font = ImageDraw.Draw(image), _font()
    draw.text((middle - draw.textlength(label, font) / 2, top), label, _LABEL_GREY[: len(image.getbands())], font)
