"""The frame of the eye: faces of the world are brought there, cut where they leave what is seen, and put on the screen.

In: the corners of the faces, world space. Out: `Pieces`, triangles in the eye's frame: right, up, depth along the
viewing axis. A piece of a face that is cut is a triangle like any other; where its corners lie on the face, and so what
they have of all that is interpolated, is said by `Pieces.weights`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..scene.camera import Projection, View
from ..vectors import length
from .vectors import dot

SUBPIXELS = 256
SNAP_LIMIT = 2**28  # 2^20 px in 1/256 px: edge functions stay below 2^60 and so are exact in int64
DEPTH_RATIO = 2.0**-20  # smallest near plane that is chosen for a scene, as a part of its far plane
VERTEX_RATIO = 2.0**-26  # the same for the sake of a corner that is seen


Plane = tuple[float, float, float, float]  # (a, b, c, d): inside is a right + b up + c depth + d >= 0


class Range(NamedTuple):
    """The depths of a picture, in scene units along the viewing axis."""

    near: float
    far: float
    is_far_given: bool  # only a far plane that somebody asked for cuts anything off


class Pieces(NamedTuple):
    """Triangles after clipping."""

    face: NDArray[np.int64]  # (n_piece,) ascending
    position: NDArray[np.float64]  # (n_piece, 3, 3) in the eye's frame: right, up, depth
    weights: NDArray[np.float64]  # (n_piece, 3, 3) of each corner on the corners of the face


def to_eye(points: NDArray, view: View) -> NDArray[np.float64]:
    """Express world points (..., 3) in the eye's frame: right, up, depth along the viewing axis."""
    r = points - view.eye
    return np.stack([dot(r, axis) for axis in (view.right, view.up, view.forward)], axis=-1)


def depths_of_boxes(boxes: NDArray, view: View) -> NDArray[np.float64]:
    """Return the depths (n, 8) of the corners of boxes (n, 2, 3), their lowest and highest corners in the world."""
    corners = np.stack([boxes[:, (i, j, k), (0, 1, 2)] for i, j, k in np.ndindex(2, 2, 2)], axis=1)
    return to_eye(corners, view)[..., 2]


def are_outside(boxes: NDArray, view: View, projection: Projection, near: float, size: tuple[int, int]) -> NDArray:
    """Tell which boxes (n, 2, 3) don't reach between the eye and the part of the near plane that a grid of samples
    shows: they lie beyond it, or with perspective further from the eye along some axis than all of that part."""
    is_beyond = depths_of_boxes(boxes, view).min(axis=1) >= near
    corners = near * rays(*np.meshgrid((0.0, size[0]), (0.0, size[1])), projection)
    gap = np.maximum(boxes[:, 0] - view.eye, view.eye - boxes[:, 1]).max(axis=1)
    return is_beyond | (projection.is_perspective & (gap > length(corners).max()))


def depths_in_view(position: NDArray, projection: Projection, size: tuple[int, int]) -> NDArray[np.float64]:
    """Return the depths (n,) of the corners (n_face, 3, 3), in the camera's frame, that a picture of `size` samples
    shows, whatever lies before them."""
    corners = position.reshape(-1, 3)
    corners = corners[np.isfinite(corners).all(axis=1) & (corners[:, 2] > 0.0)]
    x, y = project(corners[None], projection)[0].T
    return corners[(x >= 0) & (x <= size[0] * SUBPIXELS) & (y >= 0) & (y <= size[1] * SUBPIXELS), 2]


def choose_range(
    depth: NDArray, is_perspective: bool, near: float | None, far: float | None, shown: NDArray | None = None
) -> Range:
    """Fit near and far to depths where they are not given.

    With perspective a near plane that isn't given is never nearer than DEPTH_RATIO of the largest depth, or of the far
    plane if that is given and nearer; but for a corner that is shown, of depths `shown`, it is, down to VERTEX_RATIO.
    """
    depth = depth[np.isfinite(depth)]
    deepest = depth.max(initial=-np.inf)
    seen = deepest if far is None else min(deepest, far)
    if near is None:
        least = max(seen * DEPTH_RATIO, np.finfo(np.float64).tiny) if is_perspective else 0.0
        near = max(depth.min(initial=np.inf), least)
        if is_perspective and shown is not None:
            near = min(near, shown[shown >= deepest * VERTEX_RATIO].min(initial=np.inf))
    elif is_perspective and near <= 0:
        raise SceneError(f"near is {near}, legal in a perspective view is > 0")
    elif far is not None and near >= far:
        raise SceneError(f"near is {near} and far is {far}, legal is near < far")
    return Range(near, deepest if far is None else far, far is not None)


def clip_to_view(position: NDArray, projection: Projection, depths: Range) -> Pieces:
    """Cut faces (n, 3, 3) at the near plane, the far plane if given, and ±2^20 px of the screen."""
    face = np.flatnonzero(np.isfinite(position).all(axis=(1, 2)))
    planes: list[Plane] = [(0.0, 0.0, 1.0, -depths.near)]
    if depths.is_far_given:
        planes.append((0.0, 0.0, -1.0, depths.far))
    planes += _screen_planes(projection)
    triangles = position[face]
    distances = np.stack([_plane_distance(triangles, plane) for plane in planes], axis=-1)
    is_whole = (distances >= 0).all(axis=(1, 2))
    crossing = np.flatnonzero(~is_whole & (distances >= 0).any(axis=1).all(axis=1))
    # A corner is its position, and its weights on the corners of the face: what is linear on the face is clipped alike.
    corners = np.concatenate([triangles, np.broadcast_to(np.eye(3), triangles.shape)], axis=2)
    source, fans = [np.flatnonzero(is_whole)], [corners[is_whole]]
    for triangle_idx in crossing:
        polygon = corners[triangle_idx]
        for plane in planes:
            polygon = _clip_polygon(polygon, plane)
        fan = _fan(polygon, projection)
        source.append(np.full(len(fan), triangle_idx))
        fans.append(fan)
    order = np.argsort(np.concatenate(source), kind="stable")
    source, fans = (np.concatenate(rows)[order] for rows in (source, fans))
    return Pieces(face[source], fans[..., :3], fans[..., 3:])


def snap(position: NDArray, projection: Projection) -> NDArray[np.int64]:
    """Project points of the eye's frame (..., 3) to the screen (..., 2), int64 in 1/256 px, rounded half to even."""
    return np.rint(project(position, projection)).astype(np.int64)


def project(position: NDArray, projection: Projection) -> NDArray[np.float64]:
    """Project points of the eye's frame (..., 3) to the screen (..., 2), in 1/256 px."""
    w = position[..., 2] if projection.is_perspective else 1.0
    x_px = projection.center_x + (projection.scale_x * position[..., 0] - projection.skew * position[..., 1]) / w
    y_px = projection.center_y - projection.scale_y * position[..., 1] / w
    return SUBPIXELS * np.stack([x_px, y_px], axis=-1)


def rays(x_px: NDArray, y_px: NDArray, projection: Projection) -> NDArray[np.float64]:
    """Return the points (..., 3) of the eye's frame at depth 1 that are seen at x_px, y_px (...), in px."""
    upward = (projection.center_y - y_px) / projection.scale_y
    across = (x_px - projection.center_x + projection.skew * upward) / projection.scale_x
    return np.stack([across, upward, np.ones_like(across)], axis=-1)


def depths_on_planes(faces: NDArray, projection: Projection) -> NDArray[np.float64]:
    """Return the depths (n, 3) that the planes of faces (n, 3, 3) have where their corners are rounded to 1/256 px.

    Faces that are seen so nearly edge-on that half a step of the grid along either axis could change their depth by
    more than the width of a pixel at their nearest corner, or put a corner twice as far away, keep their depths.

    A plane n·P = n·P_0 is seen at the depth n·P_0 / n·r along the ray r of a grid point; without perspective the point
    (x, y) has the depth (n·P_0 - n_x x - n_y y) / n_z. What is affine on the screen is 1/depth, else the depth; let v
    be that, with the slopes g a pixel. A pixel is depth/scale wide, by which v changes by v/scale; else by 1/scale.
    """
    pixels = snap(faces, projection) / SUBPIXELS
    moved = rays(pixels[..., 0], pixels[..., 1], projection)
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])[:, None, :]
    distance, per_px = dot(normal, faces), max(projection.scale_x, projection.scale_y)  # n·P_i, all equal
    one_px = rays(np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), projection)
    steps = one_px[1:] - one_px[0]  # of the ray, by one pixel to the right, and down
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if projection.is_perspective:
            depth = distance / dot(normal, moved)
            slopes, inverse = dot(normal, steps) / distance[:, :1], 1.0 / faces[..., 2]
            width = np.minimum(inverse.max(axis=1) / per_px, inverse.min(axis=1) / 2)
        else:
            across, forward = normal * (1.0, 1.0, 0.0), normal[..., 2]
            depth = (distance - dot(across, moved)) / forward
            slopes, width = dot(across, steps) / forward, 1.0 / per_px
        is_edge_on = ~(np.abs(slopes).sum(axis=1) / (2 * SUBPIXELS) <= width)
    return np.where(is_edge_on[:, None], faces[..., 2], depth)


def _fan(polygon: NDArray, projection: Projection) -> NDArray[np.float64]:
    """Divide a convex polygon (k, 6) into triangles (n, 3, 6) about its topmost, then leftmost corner on the screen.

    However the face lists its corners, its pieces are the same.
    """
    if len(polygon) < 3:
        return np.empty((0, 3, 6))
    screen = snap(polygon[:, :3], projection)
    polygon = np.roll(polygon, -np.lexsort((screen[:, 0], screen[:, 1]))[0], axis=0)
    return np.stack([polygon[[0, k - 1, k]] for k in range(2, len(polygon))])


def _screen_planes(projection: Projection) -> list[Plane]:
    """Return the planes |x_px|, |y_px| = 2^20 as (a, b, c, d), with a right + b up + c depth + d >= 0 inside.

    x_px <= limit says center_x + (scale_x right - skew up) / w <= limit, so (limit - center_x) w - scale_x right
    + skew up >= 0, as w > 0: w is the depth in a perspective view and 1 in an orthographic one. Likewise for the other
    three.
    """
    limit = SNAP_LIMIT / SUBPIXELS
    planes = []
    for sign in (1.0, -1.0):
        x_room, y_room = limit - sign * projection.center_x, limit - sign * projection.center_y
        x_slope, y_slope = -sign * projection.scale_x, sign * projection.scale_y
        for right, up, room in ((x_slope, sign * projection.skew, x_room), (0.0, y_slope, y_room)):
            planes.append((right, up, room, 0.0) if projection.is_perspective else (right, up, 0.0, room))
    return planes


def _clip_polygon(polygon: NDArray, plane: Plane) -> NDArray[np.float64]:
    """Clip a convex polygon (k, 6) at a plane: positions, and what is linear on it.

    A new vertex is computed from the inside vertex to the outside one: both faces of an edge get the same.
    Source: Sutherland & Hodgman 1974, Comm. ACM 17(1), 32-42.
    """
    distances = _plane_distance(polygon[:, :3], plane)
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


def _plane_distance(points: NDArray, plane: Plane) -> NDArray[np.float64]:
    """Return how far inside a plane points of the eye's frame lie."""
    return dot(points, np.array(plane[:3])) + plane[3]
