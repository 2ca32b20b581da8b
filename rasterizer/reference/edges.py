"""Edges of polygons over a picture: which are drawn, where they are seen, and how much of each pixel they cover.

In: a scene, and how it is looked at. Out: the share of each pixel that strokes cover, from points of a grid of 8x8.

    sides of faces ─ edges of polygons ─ those to draw ─ strokes on the screen ─ points near them ─ is a face before?

A stroke is what lies within half its width of a segment on the screen, so its ends are round. A point of the grid is
covered where the nearest point of the segment is seen. That is hidden where the ray through it meets any face nearer
to the eye: every face is asked, at the point itself.

What counts as nearer. Coordinates come from files of float32, so those of a face and of an edge that lies on it may be
off by d = 2^-22 of the scene's largest: float32 keeps 2^-24 of each, and four are added. A face hides a point if it
still does so moved away by d along its normal, with the point brought nearer by d.
"""

from collections import Counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.camera import Projection, View
from ..scene.mesh import DEFAULT_CREASE_ANGLE, Mesh
from ..scene.scene import Scene
from .clip import Range, rays, to_eye
from .creases import NO_AREA
from .vectors import dot, length

GRID = 8  # points of a pixel along each axis
COORDINATE_ERROR = 2.0**-22  # of the largest coordinate
# A product of three coordinates is off by less than 2^-50 of what the lengths allow: what lies so near the border of a
# face counts as covered, so that there is no gap between neighbours.
BORDER = 2.0**-48
CHUNK = 1 << 12  # points that are looked at in one go


class Edge(NamedTuple):
    """An edge, and the polygons that have it."""

    ends: NDArray[np.float64]  # (2, 3) world space
    normals: NDArray[np.float64]  # (n_polygon, 3) unit, wound as the first; 0 of one without area
    turns: NDArray[np.float64]  # (n_polygon,) -1 where a normal was turned for that, else 1
    cos_crease: float

    @property
    def is_open(self) -> bool:
        """Whether the surface ends here, or more than two polygons meet."""
        return len(self.normals) != 2

    @property
    def is_crease(self) -> bool:
        """Whether it is open, or the polygons meet at more than the crease angle."""
        if self.is_open:
            return True
        a, b = self.normals
        return bool(a.any() and b.any() and dot(a, b) < self.cos_crease)


class Faces(NamedTuple):
    """What may hide an edge, and how it is looked at."""

    corners: NDArray[np.float64]  # (n_face, 3, 3) in the eye's frame
    projection: Projection  # of a picture of one sample a pixel
    depths: Range
    slack: float  # how far a coordinate may be off, scene units


def list_edges(mesh: Mesh) -> list[Edge]:
    """List the edges of a mesh's polygons. Vertices at one position are one; an edge inside a polygon is none."""
    names: dict[tuple[float, ...], int] = {}
    vertex = [names.setdefault(tuple(point), len(names)) for point in mesh.vertices.tolist()]
    points = np.array(list(names))
    polygons = list(range(mesh.n_face)) if mesh.polygons is None else mesh.polygons.tolist()
    normals = _polygon_normals(mesh, polygons)
    sides: dict[tuple[int, int], list[tuple[int, bool]]] = {}
    for polygon, face in zip(polygons, mesh.faces.tolist(), strict=True):
        loop = [vertex[corner] for corner in face]
        for start, end in zip(loop, loop[1:] + loop[:1], strict=True):
            if start != end:
                sides.setdefault((min(start, end), max(start, end)), []).append((polygon, start < end))
    # A polygon that goes along an edge there and back does not have it: the edge is inside of it.
    for ends, at in sides.items():
        n_time = Counter(polygon for polygon, _ in at)
        sides[ends] = sorted(dict(side for side in reversed(at) if n_time[side[0]] % 2).items())
    _fill_planes(normals, sides, points)
    angle = DEFAULT_CREASE_ANGLE if mesh.crease_angle is None else mesh.crease_angle
    found = []
    for ends, at in sides.items():
        if not at:
            continue
        # Of two polygons that are wound alike, one goes along the edge and the other comes back.
        turns = np.array([-1.0 if k and is_up == at[0][1] else 1.0 for k, (_, is_up) in enumerate(at)])
        turned = turns[:, None] * np.array([normals[polygon] for polygon, _ in at])
        found.append(Edge(points[list(ends)], turned, turns, float(np.cos(np.radians(angle)))))
    return found


def _polygon_normals(mesh: Mesh, polygons: list[int]) -> dict[int, NDArray[np.float64]]:
    """Return the unit normal (3,) of each polygon, 0 where it has no area: the sum of its triangles' area vectors."""
    sums: dict[int, NDArray] = {}
    scales: dict[int, float] = {}
    for polygon, (a, b, c) in zip(polygons, mesh.vertices[mesh.faces], strict=True):
        sides = sorted((b - a, c - b, a - c), key=lambda side: dot(side, side))
        area = np.cross(b - a, c - a)
        sums[polygon] = sums.get(polygon, 0.0) + area
        scales[polygon] = scales.get(polygon, 0.0) + float(length(sides[0])[0] * length(sides[1])[0])
    return {
        polygon: area / length(area) if length(area)[0] > NO_AREA * scales[polygon] else np.zeros(3)
        for polygon, area in sums.items()
    }


def _fill_planes(normals: dict[int, NDArray], sides: dict[tuple[int, int], list], points: NDArray) -> None:
    """Give each polygon without area the normal of its neighbour over the longest of its edges: it fills the gap beside
    a vertex that lies on that edge."""
    longest: dict[int, float] = {}
    has_plane = {polygon for polygon, normal in normals.items() if normal.any()}
    for ends, at in sides.items():
        if len(at) != 2:
            continue
        size = float(length(points[ends[1]] - points[ends[0]])[0])
        turn = -1.0 if at[0][1] == at[1][1] else 1.0
        for (taker, _), (giver, _) in (at, at[::-1]):
            if taker not in has_plane and giver in has_plane and size > longest.get(taker, 0.0):
                longest[taker], normals[taker] = size, turn * normals[giver]


def is_drawn(edge: Edge, kinds: tuple[str, ...], view: View, is_perspective: bool, is_culled: bool) -> bool:
    """Tell whether an edge is one of those asked for, and has a polygon that isn't left out as it is wound. A polygon
    looks to the viewer if its normal does."""
    away = edge.ends[0] - view.eye if is_perspective else view.forward
    across = dot(edge.normals, away)
    is_front = across < 0.0
    if is_culled and not (edge.turns * across < 0.0).any():
        return False
    is_outline = edge.is_open or is_front[0] != is_front[1]
    return "wire" in kinds or ("crease" in kinds and edge.is_crease) or ("silhouette" in kinds and bool(is_outline))


def make_strokes(edges: list[Edge], view: View, faces: Faces) -> NDArray[np.float64]:
    """Bring edges to the screen, cut at the depths that are drawn.

    Returns
    -------
    (n, 2, 3) float64: x, y in px, and nearness of both ends: 1/depth, without perspective -depth. Both change linearly
    along the stroke
    """
    near, far, is_far_given = faces.depths
    projection, found = faces.projection, []
    for edge in edges:
        ends = _cut(to_eye(edge.ends, view), 1.0, -near)
        ends = _cut(ends, -1.0, far) if is_far_given else ends
        if not len(ends):
            continue
        w = ends[:, 2] if projection.is_perspective else np.ones(2)
        x = projection.center_x + (projection.scale_x * ends[:, 0] - projection.skew * ends[:, 1]) / w
        y = projection.center_y - projection.scale_y * ends[:, 1] / w
        stroke = np.stack([x, y, 1.0 / w if projection.is_perspective else -ends[:, 2]], axis=1)
        # Of an edge that is seen end-on, the nearer end is the one that is seen.
        found.append(stroke[np.argsort(-stroke[:, 2])])
    return np.array(found).reshape(-1, 2, 3)


def _cut(ends: NDArray, slope: float, room: float) -> NDArray[np.float64]:
    """Cut a segment (2, 3) of the eye's frame where slope·depth + room falls below 0; nothing is left of (0, 3)."""
    inside = slope * ends[:, 2] + room
    if not len(ends) or (inside < 0).all():
        return np.empty((0, 3))
    for k in np.flatnonzero(inside < 0):
        other = 1 - k
        ends[k] = ends[other] + (ends[k] - ends[other]) * (inside[other] / (inside[other] - inside[k]))
    return ends


def cover_pixels(strokes: NDArray, faces: Faces, size: tuple[int, int], width: float) -> NDArray[np.float64]:
    """Return which share of each pixel strokes cover, (height, width): overlapping ones count once."""
    columns, rows = size[0] * GRID, size[1] * GRID
    is_covered = np.zeros((rows, columns), bool)
    for stroke in strokes:
        row, column, t = near_points(stroke, size, 0.5 * width)
        is_open = ~is_covered[row, column]
        row, column, t = row[is_open], column[is_open], t[is_open]
        is_covered[row, column] = is_seen(stroke[0] + t[:, None] * (stroke[1] - stroke[0]), faces)
    return is_covered.reshape(size[1], GRID, size[0], GRID).mean(axis=(1, 3))


def near_points(stroke: NDArray, size: tuple[int, int], radius: float) -> tuple[NDArray, NDArray, NDArray]:
    """Return rows and columns (n,) of the grid's points within `radius` px of a stroke, and where on it, 0 to 1, the
    point is that is nearest to each."""
    start, along = stroke[0, :2], stroke[1, :2] - stroke[0, :2]
    spans = []
    for axis in range(2):
        low, high = stroke[:, axis].min() - radius, stroke[:, axis].max() + radius
        first, end = np.clip([np.floor(low * GRID) - 1, np.ceil(high * GRID) + 1], 0, size[axis] * GRID)
        spans.append(np.arange(int(first), int(end)))
    column, row = (each.ravel() for each in np.meshgrid(*spans))
    x, y = (column + 0.5) / GRID - start[0], (row + 0.5) / GRID - start[1]
    square = along @ along
    t = np.clip((x * along[0] + y * along[1]) / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(x))
    is_near = (x - t * along[0]) ** 2 + (y - t * along[1]) ** 2 <= radius**2
    return row[is_near], column[is_near], t[is_near]


def is_seen(points: NDArray, faces: Faces) -> NDArray[np.bool_]:
    """Tell for points (n, 3), x and y in px and nearness, whether no face hides them, (n,)."""
    chunks = [points[begin : begin + CHUNK] for begin in range(0, len(points), CHUNK)]
    return np.concatenate([np.empty(0, bool), *(~hidden_by(chunk, faces).any(axis=1) for chunk in chunks)])


def hidden_by(points: NDArray, faces: Faces) -> NDArray[np.bool_]:
    """Tell which faces hide points (n, 3), x and y in px and nearness: (n, n_face).

    The ray r of a point meets the face where depth·r = Σ W_k P_k: W_a is r·(b×c) over a·(b×c), times the depth. Without
    perspective the third coordinate of r and P_k is 1, and W_k are the weights.
    """
    near, far, is_far_given = faces.depths
    ray, is_perspective = rays(points[:, 0], points[:, 1], faces.projection), faces.projection.is_perspective
    corners = faces.corners.copy()
    if not is_perspective:
        corners[..., 2] = 1.0
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    volume = dot(a, np.cross(b - a, c - a))
    has_volume = volume != 0.0
    is_met = np.broadcast_to(has_volume, (len(points), len(corners))).copy()
    weights = []
    for p, q in ((b, c), (c, a), (a, b)):
        weight = ray @ (np.sign(volume)[:, None] * np.cross(p, q)).T
        is_met &= weight >= -BORDER * length(ray) * (length(p) * length(q)).T
        weights.append(weight / np.where(has_volume, np.abs(volume), 1.0))
    if is_perspective:
        total = sum(weights)
        is_met &= total > 0.0
        depth = 1.0 / np.where(is_met, total, 1.0)
    else:
        depth = sum(weight * faces.corners[:, k, 2] for k, weight in enumerate(weights))
    is_met &= (depth >= near) & ((depth <= far) | (not is_far_given))
    depth_of_point = 1.0 / points[:, 2] if is_perspective else -points[:, 2]
    return is_met & (_moved_away(depth, faces) < depth_of_point[:, None] - faces.slack)


def _moved_away(depth: NDArray, faces: Faces) -> NDArray[np.float64]:
    """Return the depths (n, n_face) of faces that are moved away from the eye by the slack, along their normals.

    The plane n·P = h, n of unit length, is seen at the depth h/(n·r) along the ray r, so that grows by the share d/h.
    Without perspective depths grow by d/|n_z|.
    """
    a, b, c = (faces.corners[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    size = length(normal)[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        if faces.projection.is_perspective:
            return depth * (1.0 + faces.slack * size / np.abs(dot(normal, a)))
        return depth + faces.slack * size / np.abs(normal[:, 2])


def lay_over(color: NDArray, alpha: NDArray, share: NDArray, ink: NDArray) -> tuple[NDArray, NDArray]:
    """Lay an opaque colour over straight colours (h, w, 3) of opacity (h, w), on a share (h, w) of each pixel.

    Source: Porter & Duff 1984, Computer Graphics 18(3), 253-259, "over".
    """
    behind = alpha * (1.0 - share)
    total = share + behind
    mixed = (ink * share[..., None] + color * behind[..., None]) / np.where(total > 0, total, 1.0)[..., None]
    return np.where(share[..., None] > 0, mixed, color), np.where(share > 0, total, alpha)


def gather_faces(
    scene: Scene, corners: NDArray, view: View, projection: Projection, depths: Range, is_culled: bool
) -> Faces:
    """Gather what may hide edges: faces (n, 3, 3), world space, but for those left out because they look away."""
    corners = to_eye(corners, view)
    if is_culled:
        a, b, c = (corners[:, k] for k in range(3))
        normal = np.cross(b - a, c - a)
        # Right, up and forward are a left-handed frame: there, normals look the other way.
        corners = corners[(dot(normal, a) if projection.is_perspective else normal[:, 2]) > 0.0]
    bounds = np.stack([mesh.bounds for mesh in scene.meshes])
    return Faces(
        corners, projection, depths, COORDINATE_ERROR * float(max(np.abs(bounds).max(), np.abs(view.eye).max()))
    )
