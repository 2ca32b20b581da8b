"""The judge: a slow renderer in plain numpy float64 and integers that shares no kernel with the fast one.

In: a `Scene` and the options of a picture. Out: a `Picture` of float64 arrays. It reads in working order:

    view ─ clip ─ snap ─ cover ─ visibility ─ light (reference_light.py) ─ resolve

Letters: n_face loaded triangles; n_piece triangles after clipping, a fan for each face that is cut.
Screen coordinates are integers in 1/256 px, x to the right, y down; row 0 is the top one:

    (0,0)────────────► x        sample of the pixel in column i and row j: (256 i + 128, 256 j + 128)
      │   a ────── b            a→b→c turns clockwise as seen here: its doubled signed area is positive,
      │     ╲    ╱              and the inside of an edge a→b is where cross(b − a, sample − a) > 0;
      ▼ y     c                 a→b is a top edge (dy = 0, dx > 0), c→a is a left edge (dy < 0)
"""

from typing import NamedTuple

import numpy as np

from rasterizer import reference_light as lighting
from rasterizer.errors import SceneError
from rasterizer.reference_light import Seen, Stage, Surface, dot
from rasterizer.scene.camera import Projection, View
from rasterizer.scene.color import linear_rgb, srgb_from_linear
from rasterizer.scene.scene import Scene

SUBPIXELS = 256
SNAP_LIMIT = 2**28  # 2^20 px in 1/256 px: edge functions stay below 2^60 and so are exact in int64
DEPTH_STEPS = 2**39 - 2**23
DEPTH_RATIO = 2.0**-20  # smallest near plane that is chosen for a scene, as a part of its far plane


class Picture(NamedTuple):
    """A rendered picture. Depth, face, normal and margin are those of the pixel centres."""

    color: np.ndarray  # (h, w, 3) float64, linear, not clamped, not premultiplied
    alpha: np.ndarray  # (h, w) float64
    rgb: np.ndarray  # (h, w, 3) uint8, sRGB
    depth: np.ndarray  # (h, w) float64, scene units along the viewing axis, inf where nothing is
    face: np.ndarray  # (h, w) int32 index into the faces as loaded, -1 where nothing is
    normal: np.ndarray  # (h, w, 3) float64, unit, towards the viewer, 0 where nothing is
    margin: np.ndarray  # (h, w) float64, how much deeper the runner-up lies, inf where there is none


class Range(NamedTuple):
    """The depths of a picture, in scene units along the viewing axis."""

    near: float
    far: float
    is_far_given: bool  # only a far plane that somebody asked for cuts anything off


class Pieces(NamedTuple):
    """Triangles after clipping."""

    face: np.ndarray  # (n_piece,) int, ascending
    position: np.ndarray  # (n_piece, 3, 3) float64 in the eye's frame: right, up, depth
    weights: np.ndarray  # (n_piece, 3, 3) float64, of each corner on the three corners of its face


class Visible(NamedTuple):
    """What a grid of samples sees."""

    piece: np.ndarray  # (h, w) int, -1 where nothing is
    weights: np.ndarray  # (h, w, 3) float64, perspective-correct, on the corners of the piece
    depth: np.ndarray  # (h, w) float64, inf where nothing is
    margin: np.ndarray  # (h, w) float64, inf where there is no runner-up


def render(
    scene: Scene,
    size=(640, 480),
    shading: str = "gouraud",
    samples: int = 1,
    cull: str = "none",
    color_range: str = "clamp",
    near: float | None = None,
    far: float | None = None,
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

    Returns
    -------
    Picture

    Raises
    ------
    SceneError : an option is not legal
    """
    _check_options(size, shading, samples, cull, color_range)
    camera = scene.camera_for(size)
    near, far = (camera.near if near is None else near), (camera.far if far is None else far)
    shading = "flat" if shading == "lambert" else shading
    surface, materials = lighting.gather(scene), lighting.read_materials(scene)

    def look(per_axis):
        grid = size[0] * per_axis, size[1] * per_axis
        stage = Stage(camera.view(), camera.projection(grid), materials, scene.lights, shading)
        return _draw(surface, stage, grid, cull, near, far)

    per_axis = round(samples**0.5)
    color, normal, face, visible = look(1)
    fine_color, _, fine_face, _ = look(per_axis) if per_axis > 1 else (color, normal, face, visible)
    color, alpha = _resolve(fine_color, fine_face >= 0, per_axis, scene.background)
    rgb = _encode(color, color_range)
    return Picture(color, alpha, rgb, visible.depth, face, normal, visible.margin)


def _check_options(size, shading, samples, cull, color_range) -> None:
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


def _draw(surface: Surface, stage: Stage, grid, cull, near, far):
    """Draw a surface on a grid of (columns, rows) samples; return colour, normal, face and the `Visible`."""
    position = _to_eye(surface.corners, stage.view)
    depths = _choose_range(position[..., 2], stage.projection.is_perspective, near, far)
    pieces = _clip_to_view(position, stage.projection, depths)
    screen = _snap(pieces.position, stage.projection)
    facing = -np.sign(_doubled_area(screen))  # counter-clockwise is a negative area where y grows downwards
    is_drawn = facing > 0 if cull == "back" else facing != 0
    visible = _find_visible(screen, pieces, is_drawn, grid, depths, stage.projection.is_perspective)
    rows, columns = at = np.nonzero(visible.piece >= 0)
    piece = visible.piece[at]
    face_weights = np.einsum("sp,spf->sf", visible.weights[at], pieces.weights[piece])
    side = lighting.find_sides(surface, pieces.face, facing)[piece]
    seen = Seen(rows, columns, pieces.face[piece], side, face_weights, visible.depth[at])
    face = np.full(visible.piece.shape, -1, np.int32)
    face[at] = seen.face
    return *lighting.light_samples(surface, seen, face.shape, stage), face, visible


# ── view and clip ─────────────────────────────────────────────────────────────────────────────────────────


def _to_eye(points: np.ndarray, view: View) -> np.ndarray:
    """Express world points (..., 3) in the eye's frame: right, up, depth along the viewing axis."""
    r = points - view.eye
    return np.stack([dot(r, axis) for axis in (view.right, view.up, view.forward)], axis=-1)


def _choose_range(depth, is_perspective: bool, near, far) -> Range:
    """Fit near and far to the depths of the corners where they are not given."""
    depth = depth[np.isfinite(depth)]
    deepest = depth.max(initial=-np.inf)
    if near is None:
        least = max(deepest * DEPTH_RATIO, np.finfo(np.float64).tiny) if is_perspective else 0.0
        near = max(depth.min(initial=np.inf), least)
    elif is_perspective and near <= 0:
        raise SceneError(f"near is {near}, legal in a perspective view is > 0")
    elif far is not None and near >= far:
        raise SceneError(f"near is {near} and far is {far}, legal is near < far")
    return Range(near, deepest if far is None else far, far is not None)


def _clip_to_view(position, projection: Projection, depths: Range) -> Pieces:
    """Cut faces (n, 3, 3) at the near plane, the far plane if given, and ±2^20 px of the screen."""
    face = np.flatnonzero(np.isfinite(position).all(axis=(1, 2)))
    corner_weights = np.broadcast_to(np.eye(3), (len(face), 3, 3))
    polygons = np.concatenate([position[face], corner_weights], axis=-1)
    planes = [(0.0, 0.0, 1.0, -depths.near)]
    if depths.is_far_given:
        planes.append((0.0, 0.0, -1.0, depths.far))
    face, polygons = _clip(face, polygons, planes)
    face, polygons = _clip(face, polygons, _screen_planes(projection))
    return Pieces(face, polygons[..., :3], polygons[..., 3:])


def _screen_planes(projection: Projection) -> list[tuple[float, float, float, float]]:
    """Return the planes |x_px|, |y_px| = 2^20 as (a, b, c, d), with a right + b up + c depth + d >= 0 inside.

    x_px <= limit says center_x + scale_x right / w <= limit, so (limit - center_x) w - scale_x right >= 0, as
    w > 0: w is the depth in a perspective view and 1 in an orthographic one. Likewise for the other three.
    """
    limit = SNAP_LIMIT / SUBPIXELS
    planes = []
    for sign in (1.0, -1.0):
        x_room, y_room = limit - sign * projection.center_x, limit - sign * projection.center_y
        x_slope, y_slope = -sign * projection.scale_x, sign * projection.scale_y
        for right, up, room in ((x_slope, 0.0, x_room), (0.0, y_slope, y_room)):
            planes.append((right, up, room, 0.0) if projection.is_perspective else (right, up, 0.0, room))
    return planes


def _clip(face, triangles, planes):
    """Clip triangles (n, 3, 6) at planes; return the fans of what is left and their faces, in order."""
    distances = np.stack([_plane_distance(triangles, plane) for plane in planes], axis=-1)
    is_kept = (distances >= 0).all(axis=(1, 2))
    is_cut = ~is_kept & (distances >= 0).any(axis=1).all(axis=1)
    source, fans = [np.flatnonzero(is_kept)], [triangles[is_kept]]
    for triangle_idx in np.flatnonzero(is_cut):
        polygon = triangles[triangle_idx]
        for plane in planes:
            polygon = _clip_polygon(polygon, plane)
        for last in range(2, len(polygon)):
            source.append([triangle_idx])
            fans.append(polygon[None, [0, last - 1, last]])
    source = np.concatenate(source)
    order = np.argsort(source, kind="stable")
    return face[source[order]], np.concatenate(fans)[order]


def _clip_polygon(polygon: np.ndarray, plane) -> np.ndarray:
    """Clip a convex polygon (k, 6) at a plane; the last three columns go along.

    A new vertex is computed from the inside vertex to the outside one: both faces of an edge get the same.
    Source: Sutherland & Hodgman 1974, Comm. ACM 17(1), 32-42.
    """
    distances = _plane_distance(polygon, plane)
    kept = []
    for here in range(len(polygon)):
        after = (here + 1) % len(polygon)
        if distances[here] >= 0:
            kept.append(polygon[here])
        if (distances[here] >= 0) != (distances[after] >= 0):
            inside, outside = (here, after) if distances[here] >= 0 else (after, here)
            t = distances[inside] / (distances[inside] - distances[outside])
            kept.append(polygon[inside] + t * (polygon[outside] - polygon[inside]))
    return np.array(kept).reshape(-1, polygon.shape[1])


def _plane_distance(points, plane) -> np.ndarray:
    """Return how far inside a plane points lie; their first three columns are right, up, depth."""
    return dot(points, np.array(plane[:3])) + plane[3]


# ── snap and cover ────────────────────────────────────────────────────────────────────────────────────────


def _snap(position, projection: Projection) -> np.ndarray:
    """Project eye-space points (..., 3) to the screen (..., 2), int64 in 1/256 px, rounded half to even."""
    w = position[..., 2] if projection.is_perspective else 1.0
    x_px = projection.center_x + projection.scale_x * position[..., 0] / w
    y_px = projection.center_y - projection.scale_y * position[..., 1] / w
    return np.rint(SUBPIXELS * np.stack([x_px, y_px], axis=-1)).astype(np.int64)


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


def _find_visible(screen, pieces: Pieces, is_drawn, grid, depths: Range, is_perspective: bool) -> Visible:
    """Find the nearest piece at every sample; of equally near ones the first, which has the lowest face."""
    shape = grid[1], grid[0]
    z_first, z_second = np.full((2, *shape), np.iinfo(np.int64).max)
    depth_first, depth_second = np.full((2, *shape), np.inf)
    winner, weights = np.full(shape, -1), np.zeros((*shape, 3))
    for piece_idx in np.flatnonzero(is_drawn):
        rows, columns, affine = _cover(screen[piece_idx], *grid)
        corner_depths = pieces.position[piece_idx, :, 2]
        z, depth, piece_weights = _interpolate(affine, corner_depths, depths, is_perspective)
        wins = z < z_first[rows, columns]
        at = rows[wins], columns[wins]
        z_second[at], depth_second[at] = z_first[at], depth_first[at]
        z_first[at], depth_first[at] = z[wins], depth[wins]
        winner[at], weights[at] = piece_idx, piece_weights[wins]
        follows = ~wins & (z < z_second[rows, columns])
        at = rows[follows], columns[follows]
        z_second[at], depth_second[at] = z[follows], depth[follows]
    margin = np.full(shape, np.inf)
    has_second = np.isfinite(depth_second)
    margin[has_second] = np.abs(depth_second[has_second] - depth_first[has_second])
    return Visible(winner, weights, depth_first, margin)


def _interpolate(affine, corner_depths, depths: Range, is_perspective: bool):
    """Return depth buffer keys (n,), depths (n,) and perspective-correct weights (n, 3) of samples.

    1/depth is affine on the screen, and so is A/depth for every A that is affine on the surface.
    Source: Blinn 1992, Hyperbolic interpolation, IEEE Computer Graphics and Applications 12(4), 89-94.
    """
    if is_perspective:
        q = affine / corner_depths
        inv_depth = q.sum(axis=1)
        depth, weights = 1.0 / inv_depth, q / inv_depth[:, None]
        passed, whole = 1.0 / depths.near - inv_depth, 1.0 / depths.near - 1.0 / depths.far
    else:
        depth, weights = (affine * corner_depths).sum(axis=1), affine
        passed, whole = depth - depths.near, depths.far - depths.near
    fraction = passed / whole if whole else np.zeros_like(depth)
    return np.rint(DEPTH_STEPS * fraction).astype(np.int64), depth, weights


# ── resolve ───────────────────────────────────────────────────────────────────────────────────────────────


def _resolve(color, is_covered, per_axis: int, background):
    """Average blocks of per_axis² samples; return colour (h, w, 3) and alpha (h, w), over any background."""
    height, width = is_covered.shape[0] // per_axis, is_covered.shape[1] // per_axis
    n_covered = is_covered.reshape(height, per_axis, width, per_axis).sum(axis=(1, 3))
    total = color.reshape(height, per_axis, width, per_axis, 3).sum(axis=(1, 3))
    color, alpha = total / np.maximum(n_covered, 1)[..., None], n_covered / per_axis**2
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
