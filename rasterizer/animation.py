"""Moving pictures: frames that a notebook shows one after the other, and the turntable of a scene."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .appearance import Appearance
from .errors import SceneError, counted, shown
from .frame import Frame
from .io.animation import Timing, encode_animation
from .io.camera_file import viewpoint_of
from .io.files import write_whole
from .io.loader import read_source
from .keywords import divided, takes_words
from .options import Options
from .renderer import Renderer, render
from .scene.validate import number, text, whole
from .viewpoint import Viewpoint

if TYPE_CHECKING:
    from .keywords import Unpack
    from .words import RenderWords

_MAX_FRAMES = 10_000
_MAX_LOOPS = 65535
_SIZE = 320, 240


class Animation:
    """Hold frames that are shown one after the other. The last expression of a notebook's cell shows itself.

    Parameters
    ----------
    frames : sequence of Frame, or of (height, width, 4) uint8 arrays, all of one size; stored as a list of arrays
    seconds : how long one round takes, 0.001 to 1000000
    loop : how often it is shown, up to 65535; 0 = again and again

    Raises
    ------
    SceneError : no frames, frames of several sizes, or a value that is not legal
    """

    def __init__(self, frames: Iterable[Frame | NDArray[np.uint8]], seconds: float = 3.0, loop: int = 0) -> None:
        try:
            self.frames: list[NDArray[np.uint8]] = [_picture_of(frame) for frame in frames]
        except TypeError:
            raise SceneError(f"an animation is made of a sequence of frames; given {shown(frames)}") from None
        sizes = sorted({frame.shape[1::-1] for frame in self.frames})
        if len(sizes) != 1:
            found = "none" if not sizes else " and ".join(f"{width}x{height}" for width, height in sizes[:3])
            raise SceneError(f"an animation needs frames of one size; given {found}")
        self.seconds: float = number(seconds, "the seconds of an animation", low=1e-3, high=1e6)
        self.loop: int = whole(loop, "loop", 0, _MAX_LOOPS, ", 0 = again and again")

    def __repr__(self) -> str:
        height, width = self.frames[0].shape[:2]
        return f"<Animation {width}x{height}, {counted(len(self.frames), 'frame')}, {self.seconds:g} s>"

    def __len__(self) -> int:
        return len(self.frames)

    def _repr_png_(self) -> bytes:
        """What a notebook shows: an APNG file, which browsers play."""
        return self.encode("png")

    def encode(self, format: str = "gif") -> bytes:
        """Return the animation as the bytes of a file in a format, by name or suffix: gif, webp, png (APNG), mp4 ...

        Raises
        ------
        SceneError : a format that is unknown, or can't hold this many pixels or frames a second
        OutputError : a library that is missing
        """
        name = text(format, "format").lower().lstrip(".")
        suffix = f".{name}" if name else ""
        return encode_animation(self.frames, suffix, Timing(self.seconds, self.loop))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the animation to a path, whose suffix chooses the format; the file appears whole or not at all.

        Returns
        -------
        Path, the same as given

        Raises
        ------
        SceneError, OutputError : as `encode`, and where the file can't be written
        """
        if not isinstance(path, (str, os.PathLike)):
            raise SceneError(f"an animation is saved to a path, and encode() gives its bytes; given {shown(path)}")
        path = Path(path)
        write_whole(path, self.encode(path.suffix))
        return path


@takes_words(Viewpoint, Appearance, Options, but=("size", "outputs"))
def turntable(
    scene: Any,
    size: int | Sequence[int] | None = None,
    n_frame: int = 36,
    *,
    seconds: float = 3.0,
    options: Options | None = None,
    **words: Unpack[RenderWords],
) -> Animation:
    """Turn a scene round once: the camera goes round it at one distance, to the right, about the scene's up axis.

    Parameters
    ----------
    scene : Scene, or whatever `load` takes
    size : (width, height) in pixels, or one number for a square; None = that of the options or a scene file, else
        (320, 240)
    n_frame : pictures of one round, 1 to 10000
    seconds : how long it takes
    options, words : those of `render`, but `outputs`. What says where a picture is taken from says it of the first
        frame. A `camera` goes round what it looks at, and one at `eye` round its `target`; else the cameras are those
        of `Camera.orbit`, which show all of the scene from all sides

    Returns
    -------
    Animation, which a notebook's cell shows

    Raises
    ------
    SceneError : a value or option that is not legal
    ModelError : a model that can't be read
    """
    if TYPE_CHECKING:  # how Jedi finds the words
        render(scene, **words)
    n_frame = whole(n_frame, "n_frame", 1, _MAX_FRAMES)
    view_words, others = divided(words, Viewpoint)
    viewpoint, others = viewpoint_of(view_words), others | {"outputs": "rgb"}
    angles = [360.0 * k / n_frame for k in range(n_frame)]
    appearance = Appearance(**divided(others, Appearance)[0])
    read = read_source(scene, camera=viewpoint.of_file, **appearance.reading)
    if size is None and options is None and "size" not in read.options:
        size = _SIZE
    with Renderer(read, size, options=options, camera=viewpoint.of_file, **others) as renderer:
        cameras = viewpoint.over(renderer.framing).cameras_round(
            angles, renderer.scene, renderer.options.size, lambda: renderer.subject
        )
        return Animation([renderer.render(camera) for camera in cameras], seconds)


def _picture_of(frame: object) -> NDArray[np.uint8]:
    """Return a frame as (height, width, 4) uint8."""
    picture = frame.rgba if isinstance(frame, Frame) else frame
    is_picture = isinstance(picture, np.ndarray) and picture.dtype == np.uint8 and picture.ndim == 3
    if not is_picture or picture.shape[2] != 4 or not picture.size:  # type: ignore[attr-defined]
        raise SceneError(f"a frame must be a Frame or an array (height, width, 4) of uint8; given {shown(frame)}")
    return picture  # type: ignore[return-value]
