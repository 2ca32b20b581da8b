"""Formats of pictures, by name or suffix: what Pillow writes, and what is written without it."""

import io
from typing import TYPE_CHECKING, Any

from ..errors import OutputError, SceneError, shown

if TYPE_CHECKING:
    from PIL import Image

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


def encoded(image: "Image.Image", name: str, options: dict[str, Any]) -> bytes:
    """Return a `PIL.Image` as the bytes of a file; `name` is Pillow's of the format, `options` are passed on."""
    stream = io.BytesIO()
    image.save(stream, name, **options)
    return stream.getvalue()


def on_white(image: "Image.Image") -> "Image.Image":
    """Return an RGBA picture laid on white, as RGB."""
    from PIL import Image

    paper = Image.new("RGBA", image.size, "white")
    paper.alpha_composite(image)
    return paper.convert("RGB")
