"""Which surface each sample sees, layer behind layer, at what depth and with what weights on the corners of its face.

In: triangles on a grid of samples (`Raster`). Out: a `VisibilityBuffer`, and of the samples that see something the
`Fragments`. Letters: n_piece triangles after clipping, a fan for each face that is cut.

Which samples a triangle covers is decided in integers, in 1/256 px, x to the right, y down; row 0 is the top one:

    (0,0)────────────► x        sample of the pixel in column i and row j: (256 i + 128, 256 j + 128)
      │   a ────── b            a→b→c turns clockwise as seen here: its doubled signed area is positive,
      │     ╲    ╱              and the inside of an edge a→b is where cross(b − a, sample − a) > 0;
      ▼ y     c                 a→b is a top edge (dy = 0, dx > 0), c→a is a left edge (dy < 0)
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError
from ..scene.camera import Projection
from .clip import SNAP_LIMIT, SUBPIXELS, Pieces, rays
from .shading import Fragments
from .vectors import dot

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
    side: NDArray[np.int64]  # (n_piece,) +1 or -1, see surface.py
    is_drawn: NDArray[np.bool_]  # (n_piece,)
    window: Window  # the samples that are looked at
    projection: Projection

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
    weights: NDArray[np.float64]  # (h, w, 3) perspective-correct, on the corners of the face
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
    rows, columns, _ = cover(triangle, Window(0, 0, width, height))
    mask[rows, columns] = True
    return mask


def find_visible(raster: Raster, before: VisibilityBuffer | None = None) -> VisibilityBuffer:
    """Find the nearest piece at every sample; of equally near ones the first, which has the lowest face.

    Of the pieces `before`, and whatever lies in front of them, nothing is seen any more.
    """
    shape, left, top = raster.window.shape, raster.window.left, raster.window.top
    key_first, key_second = np.full((2, *shape), NO_KEY)
    depth_first, depth_second = np.full((2, *shape), np.inf)
    winner, weights = np.full(shape, -1), np.zeros((*shape, 3))
    for piece_idx in np.flatnonzero(raster.is_drawn):
        rows, columns, affine = cover(raster.screen[piece_idx], raster.window)
        if raster.pieces.is_cut[piece_idx]:
            depth, piece_weights = _weights_of_cut(rows, columns, piece_idx, raster)
        else:
            depth, piece_weights = _interpolate(affine, piece_idx, raster)
        key = _keys(depth, raster)
        rows, columns = rows - top, columns - left
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
    return VisibilityBuffer(winner, weights, key_first, depth_first, margin)


def gather_fragments(visible: VisibilityBuffer, raster: Raster) -> Fragments:
    """List the samples that see something, and what."""
    rows, columns = at = np.nonzero(visible.piece >= 0)
    piece, weights = visible.piece[at], visible.weights[at]
    steps = compute_weight_steps(piece, weights, visible.depth[at], raster)
    rows, columns = rows + raster.window.top, columns + raster.window.left
    return Fragments(rows, columns, raster.pieces.face[piece], raster.side[piece], weights, visible.depth[at], steps)


# --- which samples a triangle covers -------------------------------------------------------------------------


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


# --- depths, and weights on the corners ----------------------------------------------------------------------


def _interpolate(affine: NDArray, piece: int | NDArray, raster: Raster) -> tuple[NDArray, NDArray]:
    """Return depths (n,) and perspective-correct weights (n, 3) of samples of whole faces with affine weights (n, 3).

    The depth is that of the face's plane, and not that of the point with these weights, which the rounding of the
    corners puts beside the sample. 1/depth is affine on the screen, and so is A/depth for every A that is affine on the
    surface.
    Source: Blinn 1992, Hyperbolic interpolation, IEEE Computer Graphics and Applications 12(4), 89-94.
    """
    plane_depths = raster.pieces.plane_depth[piece]
    if not raster.projection.is_perspective:
        return (affine * plane_depths).sum(axis=1), affine
    q = affine / raster.pieces.position[piece, :, 2]
    return 1.0 / (affine / plane_depths).sum(axis=1), q / q.sum(axis=1, keepdims=True)


def _weights_of_cut(rows: NDArray, columns: NDArray, piece_idx: int, raster: Raster) -> tuple[NDArray, NDArray]:
    """Return depths (n,) of samples that see a piece of a face that is cut, and their weights (n, 3) on the face's
    corners.

    The ray r of a sample meets the face where depth·r = Σ W_k P_k, so W/depth solves a linear system; in an
    orthographic view the third coordinate is 1, and it is W. A piece's corners are rounded to the screen's grid, so a
    sample may lie as far outside the face: no weight is below 0, and the depth stays within that of what is left of the
    face.
    """
    ray = rays(columns + 0.5, rows + 0.5, raster.projection)
    corners, is_perspective = raster.pieces.corners[piece_idx], raster.projection.is_perspective
    near, far = raster.pieces.depth_range[piece_idx]
    weights = np.maximum(_intersect(corners[None], ray[None], is_perspective)[0], 0.0)
    inv_depth = weights.sum(axis=1)
    weights = weights / inv_depth[:, None]
    if is_perspective:
        return 1.0 / np.clip(inv_depth, 1.0 / far, 1.0 / near), weights
    return weights @ corners[:, 2], weights


def _intersect(
    corners: NDArray, directions: NDArray, is_perspective: bool, edge_on: float = 1.0
) -> NDArray[np.float64]:
    """Return the q_k (n, m, 3) with Σ q_k P_k = r, for faces (n, 3, 3) of the eye's frame and m rays (n, m, 3) each;
    `edge_on` for faces that are seen edge-on, where there are none.

    The determinant of the P_k is P_i·(P_j × P_k). Each of them is known to 2^-53 of its length, twice, so the
    determinant, products included, is known to 2^-50 Σ |P_i| |P_j × P_k| at best. Without perspective the third
    coordinate is 1 and no length.
    """
    columns, largest = np.swapaxes(corners, -1, -2).copy(), np.ones((len(corners), 3, 1))
    n_length = 3 if is_perspective else 2
    columns[:, n_length:, :] = 1.0
    lengths = np.abs(columns[:, :n_length]).max(axis=(1, 2), initial=np.finfo(np.float64).tiny)
    largest[:, :n_length] = lengths[:, None, None]
    columns = columns / largest
    a, b, c = (columns[:, :, corner] for corner in range(3))
    determinant = dot(a, np.cross(b - a, c - a))
    rotations = (a, b, c), (b, c, a), (c, a, b)
    doubt = sum(np.linalg.norm(p, axis=1) * np.linalg.norm(np.cross(q, r - q), axis=1) for p, q, r in rotations)
    is_edge_on = ~(np.abs(determinant) > 2.0**-50 * doubt)
    columns[is_edge_on] = np.eye(3)
    q = np.swapaxes(np.linalg.solve(columns, np.swapaxes(directions, 1, 2) / largest), 1, 2)
    q[is_edge_on] = edge_on
    return q


def _keys(depth: NDArray, raster: Raster) -> NDArray[np.int64]:
    """Return the depth buffer's keys (n,) int64 of depths (n,): what rounding alone tells apart shall be the same.

    With perspective a step is 2^-40 of log2(depth), less than 2^-40 of the depth, wherever the near plane is; else it
    is a part of the range of all depths.
    """
    if raster.projection.is_perspective:
        return np.rint(LOG_STEPS * np.log2(depth)).astype(np.int64)
    nearest, furthest = raster.pieces.depth_range[:, 0].min(), raster.pieces.depth_range[:, 1].max()
    whole = furthest - nearest
    return np.rint(DEPTH_STEPS * ((depth - nearest) / whole if whole else np.zeros_like(depth))).astype(np.int64)


def compute_weight_steps(piece: NDArray, weights: NDArray, depth: NDArray, raster: Raster) -> NDArray[np.float64]:
    """Return by what the weights on the corners of faces change from one sample to the next, (n, 2, 3): to the right,
    and down.

    A weight is q_k / Σ q, where the q_k are affine on the screen and Σ q is 1/depth (in an orthographic view 1), so
    dW_k = (dq_k - W_k Σ dq) / Σ q. Of a whole face q_k is the affine weight of the corner that faces the edge a→b, over
    the corner's depth: its edge function over the doubled area, with the slopes -(b - a).y and (b - a).x. Of a face
    that is cut, see `_weights_of_cut`.
    """
    screen, is_perspective = raster.screen[piece], raster.projection.is_perspective
    along = np.roll(screen, -2, axis=1) - np.roll(screen, -1, axis=1)  # b - a, for the edge that faces each corner
    slopes = np.stack([-along[..., 1], along[..., 0]], axis=1) * SUBPIXELS / doubled_area(screen)[:, None, None]
    is_cut = raster.pieces.is_cut[piece]
    if is_perspective:
        corner_depths = raster.pieces.position[piece, :, 2]
        slopes = slopes / corner_depths[:, None, :]
        depth = np.where(is_cut, depth, (weights * corner_depths).sum(axis=1))  # of the point with these weights
    one_px = rays(np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), raster.projection)
    steps = one_px[1:] - one_px[0]  # of the ray, by one sample to the right, and down
    corners = raster.pieces.corners[piece[is_cut]]
    slopes[is_cut] = _intersect(corners, np.broadcast_to(steps, (len(corners), 2, 3)), is_perspective, edge_on=0.0)
    sums = 1.0 / depth[:, None, None] if is_perspective else 1.0
    return (slopes - slopes.sum(axis=2, keepdims=True) * weights[:, None, :]) / sums
