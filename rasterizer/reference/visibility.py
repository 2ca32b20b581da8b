"""Which surface each sample sees, layer behind layer, at what depth and with what weights on the corners of its face.

In: triangles on a grid of samples (`Raster`). Out: a `VisibilityBuffer`, and of the samples that see something the
`Fragments`. Letters: n_piece triangles after clipping, a fan for each face that is cut.

Which samples a triangle covers is decided in integers, in 1/256 px, x to the right, y down; row 0 is the top one:

    (0,0)────────────► x        sample of the pixel in column i and row j: (256 i + 128, 256 j + 128)
      │   a ────── b            a→b→c turns clockwise as seen here: its doubled signed area is positive,
      │     ╲    ╱              and the inside of an edge a→b is where cross(b − a, sample − a) > 0;
      ▼ y     c                 a→b is a top edge (dy = 0, dx > 0), c→a is a left edge (dy < 0)
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError
from ..scene.camera import Projection
from .clip import SNAP_LIMIT, SUBPIXELS, Pieces
from .shading import Fragments

DEPTH_STEPS, LOG_STEPS = 2**39, 2.0**40
NO_KEY = np.iinfo(np.int64).max  # of the depth buffer, where nothing is


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


class Raster(NamedTuple):
    """Triangles on a grid of samples."""

    pieces: Pieces
    screen: NDArray[np.int64]  # (n_piece, 3, 2) in 1/256 px
    places: NDArray  # (n_piece, 3, 2) where they are for what is interpolated: the same, or float64 and not rounded
    plane_depths: NDArray[np.float64]  # (n_piece, 3) of the face's plane there: see clip.py
    side: NDArray[np.int64]  # (n_piece,) +1 or -1, see surface.py
    is_drawn: NDArray[np.bool_]  # (n_piece,)
    window: Window  # the samples that are looked at
    projection: Projection
    # Tells of faces (n,) and weights (n, 3) on their corners which points are there, and where rounding decides that;
    # None where all are.
    are_there: Callable[[NDArray, NDArray], tuple[NDArray, NDArray]] | None = None

    def within(self, window: Window) -> "Raster":
        """Return what concerns a window: of other triangles nothing is drawn."""
        low, high = self.screen.min(axis=1), self.screen.max(axis=1)
        start = SUBPIXELS * np.array([window.left, window.top])
        end = start + SUBPIXELS * np.array([window.width, window.height])
        is_within = ((low <= end) & (high >= start)).all(axis=1)
        return self._replace(window=window, is_drawn=self.is_drawn & is_within)


class VisibilityBuffer(NamedTuple):
    """The nearest surface that a grid of samples sees, of all or of those that lie behind the layers seen already."""

    piece: NDArray[np.int64]  # (h, w) -1 where nothing is
    weights: NDArray[np.float64]  # (h, w, 3) perspective-correct, on the corners of the piece
    key: NDArray[np.int64]  # (h, w) of the depth buffer; NO_KEY where nothing is
    depth: NDArray[np.float64]  # (h, w) inf where nothing is
    margin: NDArray[np.float64]  # (h, w) how much deeper the runner-up lies; inf where there is none


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
    rows, columns = cover(triangle, Window(0, 0, width, height))
    mask[rows, columns] = True
    return mask


def find_visible(raster: Raster, before: VisibilityBuffer | None = None) -> VisibilityBuffer:
    """Find the nearest piece at every sample; of equally near ones the first, which has the lowest face.

    Of the pieces `before`, and whatever lies in front of them, nothing is seen any more.
    """
    shape, left, top = raster.window.shape, raster.window.left, raster.window.top
    key_first, key_second = np.full((2, *shape), NO_KEY)
    depth_first, depth_second = np.full((2, *shape), np.inf)
    winner, weights, is_unsure = np.full(shape, -1), np.zeros((*shape, 3)), np.zeros(shape, bool)
    for piece_idx in np.flatnonzero(raster.is_drawn):
        rows, columns = cover(raster.screen[piece_idx], raster.window)
        depth, piece_weights = weights_at(rows, columns, np.full(len(rows), piece_idx), raster)
        key = _keys(depth, raster)
        rows, columns = rows - top, columns - left
        if raster.are_there is not None:
            piece = np.full(len(rows), piece_idx)
            on_face = on_faces(piece_weights[:, None], piece, raster)[:, 0]
            is_there, is_near = raster.are_there(raster.pieces.face[piece], on_face)
            is_unsure[rows[is_near], columns[is_near]] = True
            rows, columns, depth, key, piece_weights = (
                each[is_there] for each in (rows, columns, depth, key, piece_weights)
            )
        is_behind = np.ones(len(key), bool)
        if before is not None:
            last = before.key[rows, columns]
            is_behind = (key > last) | ((key == last) & (piece_idx > before.piece[rows, columns]))
        wins = is_behind & (key < key_first[rows, columns])
        at = rows[wins], columns[wins]
        key_second[at], depth_second[at] = key_first[at], depth_first[at]
        key_first[at], depth_first[at] = key[wins], depth[wins]
        winner[at], weights[at] = piece_idx, piece_weights[wins]
        follows = is_behind & ~wins & (key < key_second[rows, columns])
        at = rows[follows], columns[follows]
        key_second[at], depth_second[at] = key[follows], depth[follows]
    margin = np.full(shape, np.inf)
    has_second = np.isfinite(depth_second)
    margin[has_second] = np.abs(depth_second[has_second] - depth_first[has_second])
    margin[is_unsure] = 0.0
    return VisibilityBuffer(winner, weights, key_first, depth_first, margin)


def gather_fragments(visible: VisibilityBuffer, raster: Raster) -> Fragments:
    """List the samples that see something, and what."""
    rows, columns = at = np.nonzero(visible.piece >= 0)
    piece, weights = visible.piece[at], visible.weights[at]
    steps = on_faces(compute_weight_steps(piece, weights, raster), piece, raster)
    weights = on_faces(weights[:, None], piece, raster)[:, 0]
    rows, columns = rows + raster.window.top, columns + raster.window.left
    return Fragments(rows, columns, raster.pieces.face[piece], raster.side[piece], weights, visible.depth[at], steps)


# --- which samples a triangle covers -------------------------------------------------------------------------


def cover(triangle: NDArray, window: Window) -> tuple[NDArray, NDArray]:
    """Return rows and columns (n,) of the samples of a window that a triangle covers.

    Sources: Pineda 1988, Computer Graphics 22(4), 17-20; fill rule: Direct3D 11 functional specification.
    """
    rows = _sample_range(triangle[:, 1], window.top, window.height)
    columns = _sample_range(triangle[:, 0], window.left, window.width)
    y, x = (SUBPIXELS * lines + SUBPIXELS // 2 for lines in (rows[:, None], columns[None, :]))
    area = doubled_area(triangle)
    clockwise = np.sign(area)  # turns the edges of a triangle that is wound the other way
    is_inside = np.full((len(rows), len(columns)), area != 0)
    for corner in range(3):
        a, b = triangle[(corner + 1) % 3], triangle[(corner + 2) % 3]
        dx, dy = clockwise * (b - a)
        edge = dx * (y - a[1]) - dy * (x - a[0])
        is_top_or_left = dy < 0 or (dy == 0 and dx > 0)
        is_inside &= edge >= 0 if is_top_or_left else edge > 0
    row_idx, column_idx = np.nonzero(is_inside)
    return rows[row_idx], columns[column_idx]


def _sample_range(coordinates: NDArray, start: int, count: int) -> NDArray[np.int64]:
    """Return the i of start..start + count - 1 whose samples 256 i + 128 lie within the coordinates."""
    first = -((SUBPIXELS // 2 - int(coordinates.min())) // SUBPIXELS)
    last = (int(coordinates.max()) - SUBPIXELS // 2) // SUBPIXELS
    return np.arange(max(first, start), min(last + 1, start + count))


def doubled_area(triangles: NDArray) -> NDArray[np.int64]:
    """Return twice the signed area of triangles (..., 3, 2); positive is clockwise as seen on the screen."""
    ab, ac = triangles[..., 1, :] - triangles[..., 0, :], triangles[..., 2, :] - triangles[..., 0, :]
    return ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0]


# --- depths, and weights on the corners ----------------------------------------------------------------------


def weights_at(rows: NDArray, columns: NDArray, piece: NDArray, raster: Raster) -> tuple[NDArray, NDArray]:
    """Return depths (n,) of points that lie within pieces (n,), and their weights (n, 3) on the pieces' corners.

    The depth is that of the face's plane, and not that of the point with these weights, which the rounding of the
    corners puts beside the sample. 1/depth is affine on the screen, and so is A/depth for every A that is affine on the
    surface. A point beside the piece, whose corners aren't rounded, counts as the nearest one on its border.
    Source: Blinn 1992, Hyperbolic interpolation, IEEE Computer Graphics and Applications 12(4), 89-94.

    rows, columns : (n,) integers
    """
    places, plane_depths = raster.places[piece], raster.plane_depths[piece]
    x, y = SUBPIXELS * columns + SUBPIXELS // 2, SUBPIXELS * rows + SUBPIXELS // 2
    edges = np.zeros((len(piece), 3))
    for corner in range(3):
        a, b = places[:, (corner + 1) % 3], places[:, (corner + 2) % 3]
        edges[:, corner] = (b - a)[:, 0] * (y - a[:, 1]) - (b - a)[:, 1] * (x - a[:, 0])
    edges = np.maximum(edges * np.sign(doubled_area(places))[:, None], 0.0)
    total = edges.sum(axis=1, keepdims=True)
    affine = np.where(total > 0.0, edges / np.where(total > 0.0, total, 1.0), 1.0 / 3.0)
    if not raster.projection.is_perspective:
        return (affine * plane_depths).sum(axis=1), affine
    q = affine / raster.pieces.position[piece, :, 2]
    return 1.0 / (affine / plane_depths).sum(axis=1), q / q.sum(axis=1, keepdims=True)


def on_faces(weights: NDArray, piece: NDArray, raster: Raster) -> NDArray[np.float64]:
    """Turn weights (n, ..., 3) on the corners of pieces (n,) into those on the corners of their faces."""
    return weights @ raster.pieces.weights[piece]


def _keys(depth: NDArray, raster: Raster) -> NDArray[np.int64]:
    """Return the depth buffer's keys (n,) int64 of depths (n,): what rounding alone tells apart shall be the same.

    With perspective a step is 2^-40 of log2(depth), less than 2^-40 of the depth, wherever the near plane is; else it
    is a part of the range of all depths.
    """
    if raster.projection.is_perspective:
        return np.rint(LOG_STEPS * np.log2(depth)).astype(np.int64)
    depths = raster.pieces.position[..., 2]
    nearest, furthest = depths.min(), depths.max()
    whole = furthest - nearest
    return np.rint(DEPTH_STEPS * ((depth - nearest) / whole if whole else np.zeros_like(depth))).astype(np.int64)


def compute_weight_steps(piece: NDArray, weights: NDArray, raster: Raster) -> NDArray[np.float64]:
    """Return by what weights (n, 3) on the corners of pieces change from one sample to the next, (n, 2, 3): to the
    right, and down.

    A weight is q_k / Σ q, where the q_k are affine on the screen: the affine weight of the corner that faces the edge
    a→b, over the corner's depth (in an orthographic view over 1). An affine weight is the edge function over the
    doubled area, with the slopes -(b - a).y and (b - a).x. Σ q is 1/depth of the point with these weights, so
    dW_k = (dq_k - W_k Σ dq) / Σ q.
    """
    places, depth = raster.places[piece], np.ones(len(piece))
    along = np.roll(places, -2, axis=1) - np.roll(places, -1, axis=1)  # b - a, for the edge that faces each corner
    slopes = np.stack([-along[..., 1], along[..., 0]], axis=1) * SUBPIXELS / doubled_area(places)[:, None, None]
    if raster.projection.is_perspective:
        corner_depths = raster.pieces.position[piece, :, 2]
        slopes = slopes / corner_depths[:, None, :]
        depth = (weights * corner_depths).sum(axis=1)
    return (slopes - slopes.sum(axis=2, keepdims=True) * weights[:, None, :]) * depth[:, None, None]
