"""Edges of polygons over a picture: which are drawn, where they are seen, and how much of each sample they cover.

In: a scene, how it is looked at, and the depth at each sample. Out: the share of each sample that edges cover.

    sides of faces ─ edges of polygons ─ those to draw ─ segments on the screen ─ samples near them, on their surface

A line runs along an edge; where all polygons that are seen at an edge lie on one side of it, beside it there, with its
border on the edge. A sample is covered as far as its distance from the line's middle lies within half the width: from
none to all over the width of a sample. Of a line beside its edge, samples up to that are covered. A line that is less
wide than a sample is drawn as wide as one, and fainter.

Only samples that see the edge's surface are covered: the segment's nearest point belongs to what the sample next to it
sees, and to what the covered sample sees. That has the depths of the 3x3 samples around it, which may change by as much
again for every sample between. The covered sample may lie before the edge by twice that: what is round bends away.
"""

from collections import Counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.camera import Projection, View
from ..scene.mesh import DEFAULT_CREASE_ANGLE, Mesh
from ..vectors import length
from .clip import Range, to_eye
from .closed import list_sides
from .normals import NO_AREA, is_crease
from .vectors import dot

NEAREST = 2.0**-30  # of an edge's furthest depth: what is nearer to the eye's plane lies 2^30 px away, at 2^-22 px
DEPTH_ERROR = 2.0**-20  # of a depth: it is stored in float32, and coordinates are, in files


class Edge(NamedTuple):
    """An edge, and the polygons that have it."""

    ends: NDArray[np.float64]  # (2, 3) world space
    normals: NDArray[np.float64]  # (n_polygon, 3) unit; 0 of one without area
    is_along: NDArray[np.bool_]  # (n_polygon,) it goes from the first end to the second, else it comes back
    crease_angle: float  # degrees
    groups: tuple[int, ...] | None  # the polygons' smoothing groups, 0 = none; None where the angle decides

    @property
    def is_open(self) -> bool:
        """Whether the surface ends here, or more than two polygons meet."""
        return len(self.normals) != 2

    @property
    def is_crease(self) -> bool:
        """Whether it is open, or the polygons meet at more than the crease angle: at any, but for those of one
        smoothing group, where groups decide."""
        if self.is_open or not self.normals.any(axis=1).all():
            return self.is_open
        if self.groups is not None and self.groups[0] == self.groups[1] != 0:
            return False
        angle = self.crease_angle if self.groups is None else 0.0
        sign = np.where(self.is_along[:1] == self.is_along[1:], -1, 1)
        return bool(is_crease(self.normals[:1], self.normals[1:], sign, angle)[0])


def list_edges(mesh: Mesh) -> list[Edge]:
    """List the edges of a mesh's polygons. Vertices at one position are one; an edge inside a polygon is none."""
    names: dict[tuple[float, ...], int] = {}
    vertex = [names.setdefault(tuple(point), len(names)) for point in mesh.vertices.tolist()]
    points = np.array(list(names))
    polygons = list(range(mesh.n_face)) if mesh.polygons is None else mesh.polygons.tolist()
    normals = _polygon_normals(mesh, polygons)
    sides = list_sides([[vertex[corner] for corner in face] for face in mesh.faces.tolist()], polygons)
    # A polygon that goes along an edge there and back does not have it: the edge is inside of it.
    for ends, at in sides.items():
        n_time = Counter(polygon for polygon, _ in at)
        sides[ends] = sorted(dict(side for side in reversed(at) if n_time[side[0]] % 2).items())
    _fill_planes(normals, sides, points)
    angle = DEFAULT_CREASE_ANGLE if mesh.crease_angle is None else mesh.crease_angle
    has_groups = mesh.crease_angle is None and mesh.normals is None and mesh.smoothing is not None
    group = dict(zip(polygons, mesh.smoothing.tolist(), strict=True)) if has_groups else {}
    found = []
    for ends, at in sides.items():
        if not at:
            continue
        of_polygons = np.array([normals[polygon] for polygon, _ in at])
        groups = tuple(group[polygon] for polygon, _ in at) if has_groups else None
        is_along = np.array([is_along for _, is_along in at])
        found.append(Edge(points[list(ends)], of_polygons, is_along, angle, groups))
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
        # Of two polygons that are wound alike, one goes along the edge and the other comes back.
        turn = -1.0 if at[0][1] == at[1][1] else 1.0
        for (taker, _), (giver, _) in (at, at[::-1]):
            if taker not in has_plane and giver in has_plane and size > longest.get(taker, 0.0):
                longest[taker], normals[taker] = size, turn * normals[giver]


def find_side(edge: Edge, types: tuple[str, ...], view: View, is_perspective: bool, is_culled: bool) -> int | None:
    """Tell on which side of an edge, as it is seen, its polygons lie: 1 to the right, -1 to the left, 0 to both; None
    where it isn't drawn.

    A polygon looks to the viewer if its normal does. It isn't shown if it is seen edge-on, or is left out because it
    looks away.
    """
    across = dot(edge.normals, edge.ends[0] - view.eye if is_perspective else view.forward)
    is_shown = across < 0.0 if is_culled else across != 0.0
    # What is wound counter-clockwise as it is seen lies to the left of its sides.
    is_left = ((across < 0.0) == edge.is_along)[is_shown]
    if not len(is_left):
        return None
    is_outline = is_left.all() or not is_left.any()
    is_asked_for = "wire" in types or ("crease" in types and edge.is_crease)
    if not is_asked_for and not ("silhouette" in types and (is_outline or edge.is_open)):
        return None
    return (-1 if is_left[0] else 1) if is_outline else 0


def make_segment(edge: Edge, view: View, projection: Projection, depths: Range) -> NDArray[np.float64]:
    """Bring an edge to the screen, cut at the depths that are drawn.

    Returns
    -------
    (2, 3) float64: x and y in samples, and nearness of both ends: 1/depth, without perspective the depth. It changes
    linearly along the segment. (0, 3) where nothing is left
    """
    ends, near = to_eye(edge.ends, view), depths.near
    if projection.is_perspective:
        near = max(near, NEAREST * ends[:, 2].max())
    ends = _cut(ends, 1.0, -near)
    ends = _cut(ends, -1.0, depths.far) if depths.is_far_given else ends
    w = ends[:, 2] if projection.is_perspective else np.ones(len(ends))
    x = projection.center_x + (projection.scale_x * ends[:, 0] - projection.skew * ends[:, 1]) / w
    y = projection.center_y - projection.scale_y * ends[:, 1] / w
    return np.stack([x, y, 1.0 / w if projection.is_perspective else ends[:, 2]], axis=1)


def _cut(ends: NDArray, slope: float, room: float) -> NDArray[np.float64]:
    """Cut a segment (2, 3) of the eye's frame where slope·depth + room falls below 0; nothing is left of (0, 3)."""
    inside = slope * ends[:, 2] + room
    if not len(ends) or (inside < 0).all():
        return np.empty((0, 3))
    for k in np.flatnonzero(inside < 0):
        other = 1 - k
        ends[k] = ends[other] + (ends[k] - ends[other]) * (inside[other] / (inside[other] - inside[k]))
    return ends


def cover_samples(
    segments: list[tuple[NDArray, int]], depth: NDArray, width: float, is_perspective: bool
) -> NDArray[np.float64]:
    """Return which share of each sample edges cover, (h, w); where they overlap, the largest.

    Parameters
    ----------
    segments : those of `make_segment`, and the side of each
    depth : (h, w) of what the samples see, inf where that is nothing
    width : samples
    """
    covered = np.zeros(depth.shape)
    around = [np.pad(depth, 1, mode="edge")[j : j + len(depth), i : i + depth.shape[1]] for j, i in np.ndindex(3, 3)]
    low, high = np.min(around, axis=0), np.max(around, axis=0)
    for segment, side in segments:
        middle, radius = segment.copy(), 0.5 * width
        if side:
            # Of the width, half a sample lies beyond the edge: what is within it counts as covered.
            border = max(width, 0.5 * (1.0 + width))
            radius = 0.5 * (border + 0.5)
            along = segment[1, :2] - segment[0, :2]
            if along.any():
                middle[:, :2] += side * (border - radius) * np.array([-along[1], along[0]]) / np.hypot(*along)
        row, column, t, distance = near_samples(middle, depth.shape, radius + 0.5)
        share = np.clip(radius + 0.5 - distance, 0.0, min(1.0, width))
        point = segment[0] + t[:, None] * (segment[1] - segment[0])
        distance = np.hypot(column + 0.5 - point[:, 0], row + 0.5 - point[:, 1])
        z = 1.0 / point[:, 2] if is_perspective else point[:, 2]
        is_seen = np.isfinite(depth[row, column]) & _belongs(z, distance, low[row, column], high[row, column], 2.0)
        column_there, row_there = (np.clip(point[:, k], 0, depth.shape[1 - k] - 1).astype(int) for k in range(2))
        distance_there = np.hypot(point[:, 0] - column_there - 0.5, point[:, 1] - row_there - 0.5)
        is_seen &= _belongs(z, distance_there, low[row_there, column_there], high[row_there, column_there], 1.0)
        covered[row, column] = np.maximum(covered[row, column], np.where(is_seen, share, 0.0))
    return covered


def _belongs(z: NDArray, distance: NDArray, low: NDArray, high: NDArray, bend: float) -> NDArray[np.bool_]:
    """Tell which points at depths z (n,) belong to what is seen at a distance of so many samples, between low and high,
    which may bend away `bend` times as much; also where that is beside nothing."""
    with np.errstate(invalid="ignore"):
        slack = (distance + 0.5) * (high - low) + DEPTH_ERROR * np.abs(z)
        return np.isinf(high) | ((z >= low - slack) & (z <= high + bend * slack))


def near_samples(segment: NDArray, shape: tuple[int, ...], radius: float) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Find the samples within `radius` of a segment.

    Returns
    -------
    rows, columns (n,), where on the segment the nearest point is (n,), 0 to 1, and the distance from it (n,)
    """
    start, along = segment[0, :2], segment[1, :2] - segment[0, :2]
    spans = []
    for axis, n in enumerate((shape[1], shape[0])):
        low, high = segment[:, axis].min() - radius, segment[:, axis].max() + radius
        first, end = np.clip([np.floor(low) - 1, np.ceil(high) + 1], 0, n)
        spans.append(np.arange(int(first), int(end)))
    column, row = (each.ravel() for each in np.meshgrid(*spans))
    x, y = column + 0.5 - start[0], row + 0.5 - start[1]
    square = along @ along
    t = np.clip((x * along[0] + y * along[1]) / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(x))
    distance = np.hypot(x - t * along[0], y - t * along[1])
    found = distance < radius
    return row[found], column[found], t[found], distance[found]


def lay_over(
    color: NDArray, alpha: NDArray, share: NDArray, seen: NDArray, edge_color: NDArray
) -> tuple[NDArray, NDArray]:
    """Lay an opaque colour over straight colours (h, w, 3) of opacity (h, w), on a share (h, w) of each pixel, of which
    a share (h, w) shows anything. What is opaque stays as opaque as it is.

    Source: Porter & Duff 1984, Computer Graphics 18(3), 253-259, "over".
    """
    is_covered = share > 0
    behind = alpha * (1.0 - share / np.where(is_covered, seen, 1.0))
    total = np.where(is_covered, share + behind, 1.0)
    mixed = (edge_color * share[..., None] + color * behind[..., None]) / total[..., None]
    return np.where(is_covered[..., None], mixed, color), np.where(is_covered, np.maximum(total, alpha), alpha)
