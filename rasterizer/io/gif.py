"""Write GIF animations: one palette for all frames, so that no colour flickers; transparent where nothing is.

    frames ─ colours that they have ─ palette ─ frames as indices ─ areas that change ─ blocks of the file (Pillow)

A frame that has 255 colours or fewer together with all others keeps them exactly, as one of a grey model does. GIF
knows no partly covered pixels: those that are covered by half and more count as covered.
"""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from PIL import Image

_MOST_COLORS = 255  # one more index is that of what is transparent
_N_PACKED = 1 << 24  # colours of 8 bits a channel
_COVERED = 128  # alpha from which on a pixel counts as covered
_SAMPLED = 1 << 15  # pixels that the palette is chosen by, where there are too many colours
_BATCH = 1 << 14  # colours that are looked at in one go
_MANY = 1 << 15  # colours from which on two bits a channel don't count: a palette has gaps far wider than 4 levels then
_COARSE = 0xFCFCFC


class Palette:
    """Hold the colours of an animation, and find the nearest of them.

    Parameters
    ----------
    frames : iterable of (height, width, 4) uint8, those that the colours are chosen by; one after the other is looked
        at, and none is kept

    Attributes
    ----------
    colors : (n, 3) uint8, at most 255
    is_transparent : whether a frame has pixels that are not covered
    """

    def __init__(self, frames: Iterable[NDArray[np.uint8]]) -> None:
        is_seen = np.zeros(_N_PACKED, bool)
        self.is_transparent = False
        sampled, step, n_kept = [], 1, 0
        for frame in frames:
            packed, is_covered = _packed(frame)
            seen = packed[is_covered]
            self.is_transparent |= len(seen) < is_covered.size
            is_seen[seen] = True
            sampled.append(seen[::step])
            n_kept += len(sampled[-1])
            if n_kept > 2 * _SAMPLED:  # every other one of all, so that each frame has its share
                sampled, step = [each[::2] for each in sampled], 2 * step
                n_kept = sum(map(len, sampled))
        found = np.flatnonzero(is_seen)
        self.colors = _unpacked(found if len(found) <= _MOST_COLORS else _choose(np.concatenate(sampled)))
        self._is_coarse = len(found) > _MANY
        self._is_known = np.zeros(_N_PACKED, bool)
        self._index = np.zeros(_N_PACKED, np.uint8)

    @property
    def transparent(self) -> int:
        """The index of what is transparent."""
        return len(self.colors)

    def indices_of(self, frame: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a frame (height, width, 4) uint8 as indices (height, width) uint8 of the palette."""
        packed, is_covered = _packed(frame)
        if self._is_coarse:
            packed &= _COARSE
        unknown = packed[~self._is_known[packed] & is_covered]
        if len(unknown):
            fresh = np.unique(unknown)
            middles = fresh | 0x020202 if self._is_coarse else fresh
            self._index[fresh] = _nearest(_unpacked(middles), self.colors)
            self._is_known[fresh] = True
        return np.where(is_covered, self._index[packed], np.uint8(self.transparent))


def _packed(frame) -> tuple[NDArray[np.uint32], NDArray[np.bool_]]:
    """Return the colours of a frame as integers r + 256 g + 65536 b, and which pixels are covered."""
    words = np.ascontiguousarray(frame).view("<u4")[..., 0]
    return words & 0xFFFFFF, words >= _COVERED << 24


def _unpacked(packed) -> NDArray[np.uint8]:
    return np.stack([packed & 255, packed >> 8 & 255, packed >> 16], axis=1).astype(np.uint8)


def _choose(packed) -> NDArray[np.int64]:
    """Choose the colours of a palette by the pixels of a sample: median cut, then means (Pillow's)."""
    from PIL import Image

    pixels = Image.fromarray(_unpacked(packed)[None])
    chosen = pixels.quantize(_MOST_COLORS, Image.Quantize.MEDIANCUT, kmeans=1).getpalette()
    colors = np.array(chosen, np.int64).reshape(-1, 3)
    return np.unique(colors @ (1, 1 << 8, 1 << 16))[:_MOST_COLORS]


def _nearest(colors, palette) -> NDArray[np.uint8]:
    """Return the index of the nearest colour of a palette for each of some colours (n, 3)."""
    table = palette.astype(np.float32)
    squares = (table * table).sum(axis=1)
    found = np.empty(len(colors), np.uint8)
    for begin in range(0, len(colors), _BATCH):
        batch = colors[begin : begin + _BATCH].astype(np.float32)
        # |c - p|² = |c|² - 2 c·p + |p|², and the first is the same for all p; all are whole numbers below 2²⁴
        found[begin : begin + _BATCH] = (squares - 2.0 * batch @ table.T).argmin(axis=1)
    return found


def encode_gif(
    frames: Iterable[NDArray[np.uint8]],
    palette: Palette,
    delays: Iterable[int],
    *,
    loop: int = 0,
) -> Iterator[bytes]:
    """Yield the parts of a GIF file, one frame after the other.

    Parameters
    ----------
    frames : iterable of (height, width, 4) uint8, all of one size, at least one
    palette : Palette that was made of them
    delays : iterable of hundredths of a second, one a frame
    loop : how often the animation is shown; 0 = again and again
    """
    from PIL import GifImagePlugin

    before, is_transparent = None, palette.is_transparent
    for frame, delay in zip(frames, delays, strict=True):
        indices = palette.indices_of(frame)
        settings = {"duration": 10 * delay, "disposal": 2 if is_transparent else 1}
        if is_transparent:
            settings["transparency"] = palette.transparent
        if before is None:
            info = {"duration": 10 * delay} | _loop_of(loop)
            header, _ = GifImagePlugin.getheader(_image(indices[:1, :1], palette, indices.shape), None, info)
            yield b"".join(header)
            box = (0, 0, *reversed(indices.shape))
        else:
            box = _box_of(indices != (palette.transparent if is_transparent else before))
        left, top, right, bottom = box
        part = _image(indices[top:bottom, left:right], palette)
        yield b"".join(GifImagePlugin.getdata(part, (left, top), **settings))
        before = indices
    yield b";"


def _loop_of(loop) -> dict[str, int]:
    """Return what the file says of its rounds: how many come after the first one, nothing where none does."""
    return {} if loop == 1 else {"loop": max(loop - 1, 0)}


def _image(indices, palette, shape=None) -> "Image.Image":
    """Make a picture of indices; of another shape it is empty, and stands for the size of the file."""
    from PIL import Image

    image = Image.fromarray(np.ascontiguousarray(indices)) if shape is None else Image.new("L", shape[::-1])
    # The index of what is transparent has a colour, too, which nobody sees.
    image.putpalette(palette.colors.tobytes() + bytes(3))
    return image


def _box_of(mask) -> tuple[int, int, int, int]:
    """Return left, top, right, bottom of what is true; of one pixel where nothing is, as a frame needs one."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return 0, 0, 1, 1
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
