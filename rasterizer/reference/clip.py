"""The judge's frame of the eye: faces of the world are brought there, and cut where they leave what is seen.

In: the corners of the faces, world space. Out: `Pieces`, triangles in the eye's frame: right, up, depth along the viewing axis.
"""

from typing import NamedTuple

import numpy as np

from rasterizer.errors import SceneError
from rasterizer.reference.vectors import dot
from rasterizer.scene.camera import Projection, View

SUBPIXELS = 256
SNAP_LIMIT = 2**28  # 2^20 px in 1/256 px: edge functions stay below 2^60 and so are exact in int64
DEPTH_RATIO = 2.0**-20  # smallest near plane that is chosen for a scene, as a part of its far plane


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


def to_eye(points: np.ndarray, view: View) -> np.ndarray:
    """Express world points (..., 3) in the eye's frame: right, up, depth along the viewing axis."""
    r = points - view.eye
    return np.stack([dot(r, axis) for axis in (view.right, view.up, view.forward)], axis=-1)


def choose_range(depth, is_perspective: bool, near, far) -> Range:
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


def clip_to_view(position, projection: Projection, depths: Range) -> Pieces:
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
