"""The judge: a slow renderer in plain numpy float64 and integers; what it shares with the fast one, see
reference/__init__.py.

In: a `Scene` and the options of a picture. Out: a `Picture` of float64 arrays. It reads in working order:

    view ─ clip (reference/clip.py) ─ snap ─ cover ─ visibility ─ light (reference/light.py) ─ composite ─ resolve

Letters: n_face loaded triangles; n_piece triangles after clipping, a fan for each face that is cut.
Screen coordinates are integers in 1/256 px, x to the right, y down; row 0 is the top one:

    (0,0)────────────► x        sample of the pixel in column i and row j: (256 i + 128, 256 j + 128)
      │   a ────── b            a→b→c turns clockwise as seen here: its doubled signed area is positive,
      │     ╲    ╱              and the inside of an edge a→b is where cross(b − a, sample − a) > 0;
      ▼ y     c                 a→b is a top edge (dy = 0, dx > 0), c→a is a left edge (dy < 0)
"""

from typing import NamedTuple

import numpy as np

from ..errors import SceneError
from ..options import Options
from ..scene.camera import Projection
from ..scene.color import linear_rgb, srgb_from_linear
from ..scene.scene import Scene
from . import light as lighting
from .clip import SNAP_LIMIT, SUBPIXELS, Pieces, choose_range, clip_to_view, furthest_depth, rays, snap, to_eye
from .light import Seen, Stage, Surface
from .vectors import dot

DEPTH_STEPS, LOG_STEPS = 2**39, 2.0**40
NOTHING = np.iinfo(np.int64).max  # of the depth buffer


class Picture(NamedTuple):
    """A rendered picture. Depth, face, normal and margin are those of the pixel centres.

    The margin tells how safe the order of the surfaces is. Where a surface lets something through, the next ones have
    margins too; the least counts. The steps of a z-buffer grow with the depth squared in perspective, so these margins
    are brought to the depth of the nearest surface: as many steps there.
    """

    color: np.ndarray  # (h, w, 3) float64, linear, not clamped, not premultiplied
    alpha: np.ndarray  # (h, w) float64
    rgb: np.ndarray  # (h, w, 3) uint8, sRGB
    depth: (
        np.ndarray
    )  # (h, w) float64, scene units along the viewing axis, inf where nothing is; of the nearest surface
    face: np.ndarray  # (h, w) int32 index into the faces as loaded, -1 where nothing is; of the nearest surface
    normal: np.ndarray  # (h, w, 3) float64, unit, towards the viewer, 0 where nothing is; of the nearest surface
    margin: np.ndarray  # (h, w) float64, how much deeper the runner-up lies, inf where there is none


class Visible(NamedTuple):
    """The nearest surface that a grid of samples sees, of all or of those that lie behind the layers seen already."""

    piece: np.ndarray  # (h, w) int, -1 where nothing is
    weights: np.ndarray  # (h, w, 3) float64, perspective-correct, on the corners of the face
    key: np.ndarray  # (h, w) int64, of the depth buffer; NOTHING where nothing is
    depth: np.ndarray  # (h, w) float64, inf where nothing is
    margin: np.ndarray  # (h, w) float64, inf where there is no runner-up


class Pass(NamedTuple):
    """What drawing a grid of samples starts from."""

    pieces: Pieces
    screen: np.ndarray  # (n_piece, 3, 2) int64, in 1/256 px
    side: np.ndarray  # (n_piece,) int, +1 or -1, see reference/light.py
    is_drawn: np.ndarray  # (n_piece,) bool
    grid: tuple[int, int]  # columns, rows
    projection: Projection


class Drawn(NamedTuple):
    """A grid of samples."""

    color: np.ndarray  # (h, w, 3) float64, linear, premultiplied
    alpha: np.ndarray  # (h, w) float64
    normal: np.ndarray  # (h, w, 3) float64, of the nearest surface
    face: np.ndarray  # (h, w) int32, of the nearest surface
    depth: np.ndarray  # (h, w) float64, of the nearest surface
    margin: np.ndarray  # (h, w) float64, as in `Picture`


def render(
    scene: Scene,
    size=(640, 480),
    shading: str = "gouraud",
    samples: int = 1,
    cull: str = "none",
    color_range: str = "clamp",
    near: float | None = None,
    far: float | None = None,
    *,
    exposure: float = 0.0,
    spectral: int | None = None,
    rounded: bool = True,
) -> Picture:
    """Render a scene slowly, and as exactly as float64 allows.

    Parameters
    ----------
    scene : what to draw
    size : (width, height) in pixels
    shading : "flat" (or "lambert"), "gouraud" or "phong": where the illumination equation is evaluated
    samples : 1, 4, 9 or 16 samples a pixel, on a regular grid, averaged in linear light
    cull : "none", or "back" to leave out faces whose winding is clockwise as the viewer sees it
    color_range : "clamp", "global" or "local": what becomes of values above 1 in `Picture.rgb`
    near, far : clipping distances in scene units; None takes the camera's, and without those the scene's own
    exposure : stops by which all light is multiplied, 2^exposure; not the background
    spectral : samples of 380..780 nm, or None: 81 where a light or material has a spectrum, else RGB alone
    rounded : whether colours, depths and normals are those of the polygons whose vertices are rounded to 1/256 px, as
        in the fast way; False takes them from the polygons as they are, of which a sample at the very edge sees the
        nearest point, and leaves the rounding to what is covered. The difference of both pictures is what the rounding
        of vertices does to colours

    Returns
    -------
    Picture

    Raises
    ------
    SceneError : an option is not legal
    """
    _check_options(shading, samples, cull, color_range)
    Options(exposure=exposure, spectral=spectral)  # refuses what isn't legal
    camera = scene.camera_for(size)
    near, far = (camera.near if near is None else near), (camera.far if far is None else far)
    shading = "flat" if shading == "lambert" else shading
    surface = lighting.gather(scene, shading)
    deepest = furthest_depth(np.stack([mesh.bounds for mesh in scene.meshes]), camera.view())

    def look(per_axis) -> Drawn:
        grid = size[0] * per_axis, size[1] * per_axis
        stage = lighting.set_stage(scene, surface, camera.view(), camera.projection(grid), shading, spectral, exposure)
        return _draw(surface, stage, grid, cull, (near, far, deepest), rounded)

    per_axis = round(samples**0.5)
    centres = look(1)
    fine = look(per_axis) if per_axis > 1 else centres
    color, alpha = _resolve(fine.color, fine.alpha, per_axis, scene.background)
    rgb = _encode(color, color_range)
    return Picture(color, alpha, rgb, centres.depth, centres.face, centres.normal, centres.margin)


def _check_options(shading, samples, cull, color_range) -> None:
    """Refuse what the other functions of this file do not know."""
    shadings = ("flat", "lambert", "gouraud", "phong")
    for name, given, legal in (
        ("shading", shading, shadings),
        ("samples", samples, (1, 4, 9, 16)),
        ("cull", cull, ("none", "back")),
        ("color_range", color_range, ("clamp", "global", "local")),
    ):
        if given not in legal:
            raise SceneError(f"{name} is {given!r}, legal are {', '.join(map(repr, legal))}")


def _draw(surface: Surface, stage: Stage, grid, cull, limits, is_rounded) -> Drawn:
    """Draw a surface on a grid of (columns, rows) samples; `limits` are near, far and the deepest, as `choose_range`
    takes them."""
    position = to_eye(surface.corners, stage.view)
    depths = choose_range(position[..., 2], stage.projection.is_perspective, *limits)
    pieces = clip_to_view(position, stage.projection, depths, is_rounded)
    screen = snap(pieces.position, stage.projection)
    facing = -np.sign(_doubled_area(screen))  # counter-clockwise is a negative area where y grows downwards
    is_drawn = facing > 0 if cull == "back" else facing != 0
    side = lighting.find_sides(surface, pieces.face, facing)
    return _composite(surface, stage, Pass(pieces, screen, side, is_drawn, grid, stage.projection))


def _composite(surface: Surface, stage: Stage, job: Pass) -> Drawn:
    """Put the layers of surfaces that each sample sees on each other, the nearest first, until one lets nothing
    through.

    Sources: Porter & Duff 1984, Computer Graphics 18(3), 253-259, "over" from front to back; Everitt 2001, NVIDIA,
    "Interactive order-independent transparency", for a picture of the next layer behind the one before.
    """
    shape = job.grid[1], job.grid[0]
    color, through, margin = np.zeros((*shape, 3)), np.ones(shape), np.full(shape, np.inf)
    alpha = np.zeros(shape)  # summed up by itself: 1 - through has no digits where all is next to clear
    nearest = visible = _find_visible(job)
    seen = _see(visible, job)
    layer, normal, opacity = lighting.light_samples(surface, seen, shape, stage)
    face = np.full(shape, -1, np.int32)
    face[seen.rows, seen.columns] = seen.face if surface.loaded is None else surface.loaded[seen.face]
    while len(seen.face):
        at = visible.piece >= 0
        growth = (nearest.depth[at] / visible.depth[at]) ** 2 if job.projection.is_perspective else 1.0
        margin[at] = np.minimum(margin[at], visible.margin[at] * growth)
        color += (through * opacity)[..., None] * layer
        alpha += through * opacity
        through *= 1.0 - opacity
        is_open = at & (through > 0)
        if not is_open.any():
            break
        visible = _find_visible(job, visible._replace(key=np.where(is_open, visible.key, NOTHING)))
        seen = _see(visible, job)
        layer, _, opacity = lighting.light_samples(surface, seen, shape, stage)
    return Drawn(color, alpha, normal, face, nearest.depth, margin)


def _see(visible: Visible, job: Pass) -> Seen:
    """List the samples that see something, and what."""
    rows, columns = at = np.nonzero(visible.piece >= 0)
    piece, weights = visible.piece[at], visible.weights[at]
    steps = _weight_steps(piece, weights, visible.depth[at], job)
    return Seen(rows, columns, job.pieces.face[piece], job.side[piece], weights, visible.depth[at], steps)


def _weight_steps(piece, weights, depth, job: Pass) -> np.ndarray:
    """Return by what the weights on the corners of faces change from one sample to the next, (n, 2, 3): to the right,
    and down.

    A weight is q_k / Σ q, where the q_k are affine on the screen and Σ q is 1/depth (in an orthographic view 1), so
    dW_k = (dq_k - W_k Σ dq) / Σ q. Of a whole face q_k is the affine weight of the corner that faces the edge a→b, over
    the corner's depth: its edge function over the doubled area, with the slopes -(b - a).y and (b - a).x. Of a face
    that is cut, see `_weights_of_cut`.
    """
    screen, is_perspective = job.screen[piece], job.projection.is_perspective
    along = np.roll(screen, -2, axis=1) - np.roll(screen, -1, axis=1)  # b - a, for the edge that faces each corner
    slopes = np.stack([-along[..., 1], along[..., 0]], axis=1) * SUBPIXELS / _doubled_area(screen)[:, None, None]
    if is_perspective:
        slopes = slopes / job.pieces.position[piece, :, 2][:, None, :]
    is_cut = job.pieces.is_cut[piece]
    one_px = rays(np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), job.projection)
    steps = one_px[1:] - one_px[0]  # of the ray, by one sample to the right, and down
    corners = job.pieces.corners[piece[is_cut]]
    slopes[is_cut] = _meet(corners, np.broadcast_to(steps, (len(corners), 2, 3)), is_perspective, edge_on=0.0)
    sums = 1.0 / depth[:, None, None] if is_perspective else 1.0
    return (slopes - slopes.sum(axis=2, keepdims=True) * weights[:, None, :]) / sums


# ── snap and cover ────────────────────────────────────────────────────────────────────────────────────────


def coverage(triangle, width: int, height: int) -> np.ndarray:
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
    rows, columns, _ = _cover(triangle, width, height)
    mask[rows, columns] = True
    return mask


def _cover(triangle, width, height):
    """Return rows and columns (n,) of the samples that a triangle covers, and their affine weights (n, 3).

    Sources: Pineda 1988, Computer Graphics 22(4), 17-20; fill rule: Direct3D 11 functional specification.
    """
    rows, columns = _sample_range(triangle[:, 1], height), _sample_range(triangle[:, 0], width)
    y, x = (SUBPIXELS * lines + SUBPIXELS // 2 for lines in (rows[:, None], columns[None, :]))
    area = _doubled_area(triangle)
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


def _sample_range(coordinates, limit) -> np.ndarray:
    """Return the i of 0..limit-1 whose samples 256 i + 128 lie within the coordinates."""
    first = -((SUBPIXELS // 2 - int(coordinates.min())) // SUBPIXELS)
    last = (int(coordinates.max()) - SUBPIXELS // 2) // SUBPIXELS
    return np.arange(max(first, 0), min(last + 1, limit))


def _doubled_area(triangles) -> np.ndarray:
    """Return twice the signed area of triangles (..., 3, 2); positive is clockwise as seen on the screen."""
    ab, ac = triangles[..., 1, :] - triangles[..., 0, :], triangles[..., 2, :] - triangles[..., 0, :]
    return ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0]


# ── visibility ────────────────────────────────────────────────────────────────────────────────────────────


def _find_visible(job: Pass, before: Visible | None = None) -> Visible:
    """Find the nearest piece at every sample; of equally near ones the first, which has the lowest face.

    Of the pieces `before`, and whatever lies in front of them, nothing is seen any more.
    """
    shape = job.grid[1], job.grid[0]
    key_first, key_second = np.full((2, *shape), NOTHING)
    depth_first, depth_second = np.full((2, *shape), np.inf)
    winner, weights = np.full(shape, -1), np.zeros((*shape, 3))
    for piece_idx in np.flatnonzero(job.is_drawn):
        rows, columns, affine = _cover(job.screen[piece_idx], *job.grid)
        if job.pieces.is_cut[piece_idx]:
            depth, piece_weights = _weights_of_cut(rows, columns, piece_idx, job)
        else:
            depth, piece_weights = _interpolate(
                affine, job.pieces.position[piece_idx, :, 2], job.projection.is_perspective
            )
        key = _keys(depth, job)
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
    return Visible(winner, weights, key_first, depth_first, margin)


def _interpolate(affine, corner_depths, is_perspective: bool):
    """Return depths (n,) and perspective-correct weights (n, 3) of samples with affine weights (n, 3).

    1/depth is affine on the screen, and so is A/depth for every A that is affine on the surface.
    Source: Blinn 1992, Hyperbolic interpolation, IEEE Computer Graphics and Applications 12(4), 89-94.
    """
    if not is_perspective:
        return (affine * corner_depths).sum(axis=1), affine
    q = affine / corner_depths
    inv_depth = q.sum(axis=1)
    return 1.0 / inv_depth, q / inv_depth[:, None]


def _weights_of_cut(rows, columns, piece_idx, job: Pass):
    """Return depths (n,) of samples that see a piece of a face that is cut, and their weights (n, 3) on the face's
    corners.

    The ray r of a sample meets the face where depth·r = Σ W_k P_k, so W/depth solves a linear system; in an
    orthographic view the third coordinate is 1, and it is W. A piece's corners are rounded to the screen's grid, so a
    sample may lie as far outside the face: no weight is below 0, and the depth stays within that of what is left of the
    face.
    """
    ray = rays(columns + 0.5, rows + 0.5, job.projection)
    corners, is_perspective = job.pieces.corners[piece_idx], job.projection.is_perspective
    near, far = job.pieces.depth_range[piece_idx]
    weights = np.maximum(_meet(corners[None], ray[None], is_perspective)[0], 0.0)
    inv_depth = weights.sum(axis=1)
    weights = weights / inv_depth[:, None]
    if is_perspective:
        return 1.0 / np.clip(inv_depth, 1.0 / far, 1.0 / near), weights
    return weights @ corners[:, 2], weights


def _meet(corners, directions, is_perspective: bool, edge_on=1.0) -> np.ndarray:
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
    turns = (a, b, c), (b, c, a), (c, a, b)
    doubt = sum(np.linalg.norm(p, axis=1) * np.linalg.norm(np.cross(q, r - q), axis=1) for p, q, r in turns)
    is_edge_on = ~(np.abs(determinant) > 2.0**-50 * doubt)
    columns[is_edge_on] = np.eye(3)
    q = np.swapaxes(np.linalg.solve(columns, np.swapaxes(directions, 1, 2) / largest), 1, 2)
    q[is_edge_on] = edge_on
    return q


def _keys(depth, job: Pass) -> np.ndarray:
    """Return the depth buffer's keys (n,) int64 of depths (n,): what rounding alone tells apart shall be the same.

    With perspective a step is 2^-40 of log2(depth), less than 2^-40 of the depth, wherever the near plane is; else it
    is a part of the range of all depths.
    """
    if job.projection.is_perspective:
        return np.rint(LOG_STEPS * np.log2(depth)).astype(np.int64)
    nearest, furthest = job.pieces.depth_range[:, 0].min(), job.pieces.depth_range[:, 1].max()
    whole = furthest - nearest
    return np.rint(DEPTH_STEPS * ((depth - nearest) / whole if whole else np.zeros_like(depth))).astype(np.int64)


# ── resolve ───────────────────────────────────────────────────────────────────────────────────────────────


def _resolve(color, alpha, per_axis: int, background):
    """Average blocks of per_axis² samples, their colour premultiplied; return straight colour (h, w, 3), 0 where
    nothing is, and alpha (h, w), over any background.
    """
    height, width = alpha.shape[0] // per_axis, alpha.shape[1] // per_axis
    total_alpha = alpha.reshape(height, per_axis, width, per_axis).sum(axis=(1, 3))
    total = color.reshape(height, per_axis, width, per_axis, 3).sum(axis=(1, 3))
    color, alpha = total / np.where(total_alpha > 0, total_alpha, 1)[..., None], total_alpha / per_axis**2
    if background is None:
        return color, alpha
    opaque = alpha[..., None]
    return color * opaque + np.array(linear_rgb(background)) * (1 - opaque), np.ones_like(alpha)


def _encode(color, color_range: str) -> np.ndarray:
    """Bring linear colours into 0..1 in the way asked for; return 8-bit sRGB, rounded to nearest."""
    if color_range == "global":
        color = color / max(color.max(), 1.0)
    elif color_range == "local":
        color = color / np.maximum(color.max(axis=-1, keepdims=True), 1.0)
    return np.rint(255 * srgb_from_linear(np.clip(color, 0, 1))).astype(np.uint8)
