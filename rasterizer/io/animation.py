"""Write moving pictures: the table of their formats, and an encoder for each.

frames, seconds ─┬─ GIF, WebP, APNG by Pillow: with transparency
                 └─ MP4 and its like by PyAV: on a background
"""

import io
from collections.abc import Callable, Collection, Iterator
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import OutputError, SceneError, import_extra

if TYPE_CHECKING:
    from PIL import Image

Frames = Collection[NDArray[np.uint8]]  # (height, width, 4) uint8 each; may be gone through more than once
_MAX_GIF_FPS = 50  # times are hundredths of a second, and viewers take 1 for 10
_MAX_GIF = 65535  # pixels along a side of a GIF file
_CLEAR = 255  # of a GIF file: the index of what is transparent, after 255 colours
_COVERED = 128  # alpha from which on a pixel of a GIF file counts as covered
_MAX_WEBP = 16383
_MAX_BYTES = 4e9  # of frames that Pillow holds together
_VIDEO = {"crf": "18", "preset": "veryfast"}  # of H.264: quality that looks like the original


class Timing(NamedTuple):
    """When frames are shown.

    Parameters
    ----------
    seconds : float above 0, of one round
    loop : how often the animation is shown; 0 = again and again
    """

    seconds: float
    loop: int = 0

    def delays(self, n_frame: int, unit: float) -> list[int]:
        """Return how long each frame is shown, whole multiples of `unit` seconds; their sum is right to one of them."""
        ends = [round(self.seconds * k / n_frame / unit) for k in range(n_frame + 1)]
        return [max(after - before, 1) for before, after in zip(ends[:-1], ends[1:], strict=True)]


class AnimationFormat(NamedTuple):
    """Describe a format of moving pictures.

    Parameters
    ----------
    suffix : of files, in lower case with its dot
    encode : function of frames, a Timing and the suffix, which returns the file's bytes
    has_alpha : whether its pictures may be transparent
    max_fps : frames a second that it can show; None = as many as are wanted
    """

    suffix: str
    encode: Callable[[Frames, Timing, str], bytes]
    has_alpha: bool = True
    max_fps: float | None = None

    def check_timing(self, n_frame: int, seconds: float) -> None:
        """Raise SceneError where a file can't show so many frames in so many seconds."""
        if self.max_fps is not None and n_frame > 1 and n_frame > self.max_fps * seconds:
            legal = f"a {self.suffix} file shows at most {self.max_fps:g} frames a second"
            raise SceneError(f"{legal}; given {n_frame} in {seconds:g} s")


def animation_format(suffix: str) -> AnimationFormat:
    """Return the format of files with a suffix.

    Raises
    ------
    SceneError : a suffix that no format has
    OutputError : a format whose library is missing
    """
    found = FORMATS.get(suffix.lower())
    if found is None:
        given = f"given {suffix}" if suffix else "the name has no suffix"
        raise SceneError(f"moving pictures are written as {', '.join(FORMATS)}; {given}")
    if found.encode is _encode_video:
        _import_av(suffix)
    return found


def encode_animation(frames: Frames, suffix: str, timing: Timing) -> bytes:
    """Return frames as the bytes of a file.

    Parameters
    ----------
    frames : collection of (height, width, 4) uint8, all of one size; it may be gone through twice. Where the format
        knows no transparency they are opaque
    suffix : of the file, which chooses the format
    timing : Timing

    Raises
    ------
    SceneError : another format, or more than it can hold
    OutputError : a library that is missing, or that can't write these frames
    """
    if not len(frames):
        raise SceneError("an animation needs at least one frame; given none")
    found = animation_format(suffix)
    found.check_timing(len(frames), timing.seconds)
    return found.encode(frames, timing, suffix.lower())


def _encode_gif(frames: Frames, timing: Timing, _suffix: str) -> bytes:
    """Encode frames of 255 colours, which Pillow chooses for each; those that have no more, as of a grey model, keep
    them.

    GIF knows no partly covered pixels: those that are covered by half and more count as covered.
    """
    _shape_of(frames, _MAX_GIF, "GIF")
    loop = {} if timing.loop == 1 else {"loop": max(timing.loop - 1, 0)}  # rounds after the first one
    delays = [10 * delay for delay in timing.delays(len(frames), 0.01)]
    # What stood in the frame before is taken away where something is transparent.
    options = {"duration": delays, "transparency": _CLEAR, "disposal": 2, "optimize": False}
    return _saved(frames, map(_indexed, frames), "GIF", n_byte=1, **loop, **options)


def _indexed(frame: NDArray[np.uint8]) -> "Image.Image":
    """Return a frame as a picture of indices of 255 colours; the last index, _CLEAR, is transparent."""
    from PIL import Image

    picture = Image.fromarray(np.ascontiguousarray(frame[..., :3])).quantize(_CLEAR)
    picture.paste(_CLEAR, mask=Image.fromarray(np.where(frame[..., 3] < _COVERED, np.uint8(255), np.uint8(0))))
    return picture


def _encode_webp(frames: Frames, timing: Timing, _suffix: str) -> bytes:
    _shape_of(frames, _MAX_WEBP, "WebP")
    return _encode_by_pillow(frames, "WEBP", timing, quality=90, method=1)


def _encode_apng(frames: Frames, timing: Timing, _suffix: str) -> bytes:
    # Each frame replaces what was there: it isn't laid upon the one before.
    return _encode_by_pillow(frames, "PNG", timing, disposal=1, blend=0, compress_level=4)


def _encode_by_pillow(frames: Frames, name: str, timing: Timing, **options: Any) -> bytes:
    from PIL import Image

    pictures = (Image.fromarray(np.ascontiguousarray(frame)) for frame in frames)
    return _saved(frames, pictures, name, 4, duration=timing.delays(len(frames), 0.001), loop=timing.loop, **options)


def _saved(frames: Frames, pictures: Iterator["Image.Image"], name: str, n_byte: int, **options: Any) -> bytes:
    """Let Pillow write the pictures of frames, of `n_byte` bytes a pixel, which it holds together."""
    height, width = next(iter(frames)).shape[:2]
    if (total := n_byte * width * height * len(frames)) > _MAX_BYTES:
        raise SceneError(
            f"{len(frames)} frames of {width}x{height} take {total / 1e9:.1f} GB of memory as {name}, more than "
            f"{_MAX_BYTES / 1e9:.0f}; write them as .mp4, which takes one after the other"
        )
    stream = io.BytesIO()
    try:
        first, *others = pictures  # Pillow goes through them twice
        first.save(stream, name, save_all=True, append_images=others, **options)
    except (OSError, ValueError) as error:
        raise OutputError(f"can't write an animation as {name}: {error}") from error
    return stream.getvalue()


def _encode_video(frames: Frames, timing: Timing, suffix: str) -> bytes:
    """Encode H.264 in the container of the suffix: planes of half the size for colour, so sides are made even."""
    av = _import_av(suffix)
    height, width = _shape_of(frames, _MAX_WEBP, "H.264")
    stream = io.BytesIO()
    try:
        with av.open(stream, "w", format="matroska" if suffix == ".mkv" else suffix[1:]) as container:
            rate = Fraction(len(frames) / timing.seconds).limit_denominator(1001)
            track = container.add_stream("libx264", rate=rate, options=_VIDEO)
            track.width, track.height, track.pix_fmt = width + width % 2, height + height % 2, "yuv420p"
            for _ in range(max(timing.loop, 1)):
                for frame in frames:
                    even = np.pad(frame[..., :3], ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
                    picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(even), format="rgb24")
                    container.mux(track.encode(picture))
            container.mux(track.encode())
    except (av.FFmpegError, ValueError) as error:
        raise OutputError(f"can't write an animation as {suffix}: {error}") from error
    return stream.getvalue()


def _import_av(suffix: str) -> Any:
    return import_extra("av", "video", f"a {suffix} file", OutputError)


def _shape_of(frames: Frames, max_side: int, name: str) -> tuple[int, int]:
    """Return height and width of the first frame; SceneError where the format can't hold them."""
    height, width = next(iter(frames)).shape[:2]
    if max(height, width) > max_side:
        raise SceneError(f"a {name} file has at most {max_side} pixels a side; given {width}x{height}")
    return height, width


FORMATS = {
    each.suffix: each
    for each in (
        AnimationFormat(".gif", _encode_gif, max_fps=_MAX_GIF_FPS),
        AnimationFormat(".webp", _encode_webp),
        AnimationFormat(".png", _encode_apng),
        AnimationFormat(".apng", _encode_apng),
        AnimationFormat(".mp4", _encode_video, has_alpha=False),
        AnimationFormat(".mov", _encode_video, has_alpha=False),
        AnimationFormat(".mkv", _encode_video, has_alpha=False),
    )
}
