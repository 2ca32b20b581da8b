"""Which samples a triangle covers, decided in integers.

Screen coordinates are integers in 1/256 px, x to the right, y down; row 0 is the top one:

    (0,0)────────────► x        sample of the pixel in column i and row j: (256 i + 128, 256 j + 128)
      │   a ────── b            a→b→c turns clockwise as seen here: its doubled signed area is positive,
      │     ╲    ╱              and the inside of an edge a→b is where cross(b − a, sample − a) > 0;
      ▼ y     c                 a→b is a top edge (dy = 0, dx > 0), c→a is a left edge (dy < 0)
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError
from .clip import SNAP_LIMIT, SUBPIXELS


class Window(NamedTuple):
    """A part of a grid of samples that is looked at."""

    left: int  # column of its first sample
    top: int  # row of its first sample
    width: int
    height: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.height, self.width


def coverage(triangle: ArrayLike, width: int, height: int) -> NDArray[np.bool_]:
    """Tell which pixels of a picture a triangle covers.

    Parameters
    ----------
    triangle : (3, 2) int, x and y of the vertices in 1/256 px, within ±2^28, in either winding
    width, height : pixels

    Returns
    -------
    (height, width) bool

    Raises
    ------
    SceneError : a vertex lies beyond ±2^28
    """
    triangle = np.asarray(triangle, np.int64)
    if np.abs(triangle).max() > SNAP_LIMIT:
        raise SceneError(f"a vertex lies at {np.abs(triangle).max()}/256 px, legal is up to {SNAP_LIMIT}/256")
    mask = np.zeros((height, width), bool)
    rows, columns, _ = cover(triangle, Window(0, 0, width, height))
    mask[rows, columns] = True
    return mask


def cover(triangle: NDArray, window: Window) -> tuple[NDArray, NDArray, NDArray]:
    """Return rows and columns (n,) of the samples of a window that a triangle covers, and their affine weights (n, 3).

    Sources: Pineda 1988, Computer Graphics 22(4), 17-20; fill rule: Direct3D 11 functional specification.
    """
    rows = _sample_range(triangle[:, 1], window.top, window.height)
    columns = _sample_range(triangle[:, 0], window.left, window.width)
    y, x = (SUBPIXELS * lines + SUBPIXELS // 2 for lines in (rows[:, None], columns[None, :]))
    area = doubled_area(triangle)
    clockwise = np.sign(area)  # turns the edges of a triangle that is wound the other way
    is_inside = np.full((len(rows), len(columns)), area != 0)
    edges = np.zeros((3, *is_inside.shape), np.int64)
    for corner in range(3):
        a, b = triangle[(corner + 1) % 3], triangle[(corner + 2) % 3]
        dx, dy = clockwise * (b - a)
        edges[corner] = dx * (y - a[1]) - dy * (x - a[0])
        is_top_or_left = dy < 0 or (dy == 0 and dx > 0)
        is_inside &= edges[corner] >= 0 if is_top_or_left else edges[corner] > 0
    row_idx, column_idx = np.nonzero(is_inside)
    return rows[row_idx], columns[column_idx], edges[:, row_idx, column_idx].T / max(abs(area), 1)


def _sample_range(coordinates: NDArray, start: int, count: int) -> NDArray[np.int64]:
    """Return the i of start..start + count - 1 whose samples 256 i + 128 lie within the coordinates."""
    first = -((SUBPIXELS // 2 - int(coordinates.min())) // SUBPIXELS)
    last = (int(coordinates.max()) - SUBPIXELS // 2) // SUBPIXELS
    return np.arange(max(first, start), min(last + 1, start + count))


def doubled_area(triangles: NDArray) -> NDArray[np.int64]:
    """Return twice the signed area of triangles (..., 3, 2); positive is clockwise as seen on the screen."""
    ab, ac = triangles[..., 1, :] - triangles[..., 0, :], triangles[..., 2, :] - triangles[..., 0, :]
    return ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0]
