"""A picture in a terminal: two pixels a character, one above the other, as half blocks in their colours.

    pixels, premultiplied ─ mean over the area of each half character ─ ▀ with the upper one's colour on the lower one's

Where nothing is, the terminal's own background shows. NO_COLOR in the environment, a terminal that is `dumb`, and one
that isn't written to in UTF-8 get letters of rising darkness instead, a pixel a character.
"""

import codecs
import os
import shutil
import sys

import numpy as np
from numpy.typing import NDArray

_RAMP = " .:-=+*#%@"  # of rising darkness on a light background, of rising light on a dark one
_SEEN = 0.5  # alpha from which on a half character is drawn
_LINES_LEFT = 2  # for the prompt


def preview(picture: NDArray[np.uint8], columns: int | None = None, rows: int | None = None) -> str:
    """Return a picture as text for a terminal.

    Parameters
    ----------
    picture : (height, width, 4) uint8
    columns, rows : of the terminal, in characters; None = as large as it is

    Returns
    -------
    lines, each with its line break
    """
    width, height = shutil.get_terminal_size()
    columns, rows = columns or width, rows or max(height - _LINES_LEFT, 1)
    n_row, n_column = picture.shape[:2]
    # A character is about twice as high as wide, so that its halves are squares.
    scale = min(columns / n_column, 2 * rows / n_row)
    size = (max(round(n_row * scale / 2), 1) * 2, max(round(n_column * scale), 1))
    small = _shrunk(picture, size)
    if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or not _is_utf8():
        return _letters(small)
    return _blocks(small)


def _is_utf8() -> bool:
    """Tell whether what is printed is to be UTF-8."""
    try:
        return codecs.lookup(getattr(sys.stdout, "encoding", None) or "utf-8").name == "utf-8"
    except LookupError:
        return False


def _shrunk(picture, size) -> NDArray[np.float64]:
    """Return the means over the cells of a grid of `size` (rows, columns), premultiplied (rows, columns, 4), 0 to 1."""
    values = picture.astype(np.float64) / 255.0
    values[..., :3] *= values[..., 3:]
    for axis in range(2):
        n, n_cell = values.shape[axis], size[axis]
        # The sum from the beginning to any place, between pixels too, and its differences.
        sums = np.concatenate([np.zeros_like(values.take([0], axis)), values.cumsum(axis)], axis)
        edges = np.linspace(0.0, n, n_cell + 1)
        whole = np.minimum(edges.astype(int), n - 1)
        share = (edges - whole).reshape([-1 if k == axis else 1 for k in range(3)])
        at_edges = sums.take(whole, axis) * (1.0 - share) + sums.take(whole + 1, axis) * share
        values = np.diff(at_edges, axis=axis) * (n_cell / n)
    return values


def _blocks(small) -> str:
    """Half blocks in 24-bit colours, by the escape sequences of ISO 8613-6."""
    alpha = small[..., 3:]
    is_seen = alpha[..., 0] >= _SEEN
    rgb = np.rint(255.0 * small[..., :3] / np.where(alpha > 0.0, alpha, 1.0)).clip(0, 255).astype(int)
    lines = []
    for y in range(0, len(small), 2):
        line = []
        for x in range(small.shape[1]):
            upper, lower = ";".join(map(str, rgb[y, x])), ";".join(map(str, rgb[y + 1, x]))
            if is_seen[y, x] and is_seen[y + 1, x]:
                line.append(f"\x1b[38;2;{upper};48;2;{lower}m▀\x1b[0m")
            elif is_seen[y, x]:
                line.append(f"\x1b[38;2;{upper}m▀\x1b[0m")
            else:
                line.append(f"\x1b[38;2;{lower}m▄\x1b[0m" if is_seen[y + 1, x] else " ")
        lines.append("".join(line).rstrip(" "))
    return "\n".join(lines) + "\n"


def _letters(small) -> str:
    """Letters for the mean of two halves: the more there is of light and of the model, the more ink."""
    light = small[..., :3] @ (0.2126, 0.7152, 0.0722)  # Rec. 709, of encoded values: a letter is no measurement
    pairs = 0.5 * (light[0::2] + light[1::2])
    covered = 0.5 * (small[0::2, :, 3] + small[1::2, :, 3])
    level = np.where(covered >= _SEEN, 1 + np.rint(pairs * (len(_RAMP) - 2)), 0).astype(int).clip(0, len(_RAMP) - 1)
    return "".join("".join(_RAMP[k] for k in row).rstrip() + "\n" for row in level)
