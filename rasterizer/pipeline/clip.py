"""Stage 2, clip: the triangles with a vertex that has no place on the screen, in homogeneous space.

In:  triangles, positions, and the vertices on the screen, some of them OUTSIDE.
Out: the same with every such triangle replaced, where it stands in the order of faces, by the parts of it that have a
     place on the screen, and the planes of the whole face.

Clipped against the near plane, the far plane where the caller gave one, and |x|, |y| <= 2^20 px: six half-spaces that
are linear in eye space (Sutherland & Hodgman 1974). A new vertex is always computed from the inside vertex to the
outside one, so two triangles that share an edge get the same one, and no gap opens between them.

The parts say only what is covered. Depth and attributes come from the planes of the whole face, so they are the same in
all parts of a face, wherever it is clipped:

* A part's corners are rounded to 1/256 px as all vertices are. Its depths are those of the whole face's plane at the
  rounded corners; depth is affine on the screen, so the planes of all parts are the plane of the face.
* Attributes are interpolated with the weights q_i of the face's own three vertices, which are affine on the screen,
  too. With the vertices P_i in eye space and the ray r(x, y) = ((x - center_x)/scale_x, (center_y - y)/scale_y, 1) of a
  sample, q = M^-1 r, where P_0, P_1, P_2 are the columns of M. Then r·w = Σ b_i P_i with b_i = w q_i, and 1/w = Σ q_i
  (Olano & Greer 1997, "Triangle scan conversion using 2D homogeneous coordinates"). Without perspective
  P_i = (across, upward, 1), and q_i = b_i.

The three vertices count where they are, and not where they would be rounded to: one may be behind the eye, or too far
out to be rounded.

The vertices of a face are sorted before anything is computed from them, and a part begins at its topmost, leftmost
corner: so two faces with the same vertices have the same parts and the same depths to the last bit, in whatever order a
file lists them.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from .transform import LIMIT, LIMIT_PX, OUTSIDE, SUBPIXEL, Triangles, Vertices, compute_z, project, skew_stretch

NEAR, FAR, LEFT, RIGHT, TOP, BOTTOM = range(6)  # the clip planes
N_CLIP_PLANE = 6
MAX_CORNERS = 3 + N_CLIP_PLANE  # each plane adds at most one corner to a convex polygon
# Rounding may bend a sliver, and then more than two edges cross a plane: of n corners with m inside, m and one for each
# crossing are left, m + 2 min(m, n - m) <= 3 n / 2. Six times from a triangle on: 4, 6, 9, 13, 19, 28.
ROOM = 28
# Columns of a corner while it is clipped: distances along the viewing axis, the screen's `across` and up, scene units.
W, ACROSS, UPWARD = 0, 1, 2
N_CORNER_COLUMN = 3
# Columns of the planes: q_i at the picture's corner (0, 0), and what 1/256 px to the right, and down, adds to them; the
# range that their sum has where the face is seen, 1 without perspective; depths of the vertices, scene units.
WEIGHT, WEIGHT_X, WEIGHT_Y, MIN_SUM, MAX_SUM, FACE_DEPTH = 0, 3, 6, 9, 10, 11
N_COLUMN = 14
NO_PLANES = np.empty((0, N_COLUMN))


class Window(NamedTuple):
    """What the four planes beside the view leave of the screen, px."""

    left: float
    right: float
    top: float
    bottom: float


GUARD_BAND = Window(-float(LIMIT_PX), float(LIMIT_PX), -float(LIMIT_PX), float(LIMIT_PX))


class ClipScratch(NamedTuple):
    """Room for two polygons: what is clipped goes from one to the other and back."""

    even: np.ndarray  # (ROOM, N_CORNER_COLUMN) float64
    odd: np.ndarray  # the same


def make_clip_scratch() -> ClipScratch:
    """Return room for two polygons."""
    return ClipScratch(np.empty((ROOM, N_CORNER_COLUMN)), np.empty((ROOM, N_CORNER_COLUMN)))


class Clipped(NamedTuple):
    """What takes the place of the triangles and vertices; new vertices stand behind the old ones."""

    triangles: Triangles  # a part has the corners of its face; its clipped_idx is a row of `planes`, that of others -1
    vertices: Vertices
    faces: np.ndarray  # (n,) uint32, the face that each triangle is a part of
    planes: np.ndarray  # (n_clipped, N_COLUMN) float64
    n_clipped: int  # faces that were clipped or lie wholly outside


def clip(positions, triangles: Triangles, vertices: Vertices, screen) -> Clipped:
    """Clip every triangle that has an OUTSIDE vertex.

    Parameters
    ----------
    positions : (n, 3) float64, world space, scene units
    """
    vertex_idx = triangles.vertex_idx
    touched = np.flatnonzero((vertices.x[vertex_idx] == OUTSIDE).any(axis=0))
    crossing, scratch = np.empty(len(touched), np.uint32), make_clip_scratch()
    crossing = crossing[: find_crossing(positions, vertex_idx, touched.astype(np.uint32), screen, scratch, crossing)]
    room = len(crossing) * (MAX_CORNERS - 2)
    parts, owners = np.empty((room, 3, N_CORNER_COLUMN)), np.empty(room, np.uint32)
    n_part = clip_faces(positions, vertex_idx, crossing, screen, scratch, parts, owners)
    parts, owners = parts[:n_part], owners[:n_part]

    planes, z_planes = compute_face_planes(positions, vertex_idx[:, crossing], screen)
    least, largest = compute_depth_ranges(parts[:, :, W], owners, len(crossing))
    if screen.is_perspective:
        planes[:, MIN_SUM], planes[:, MAX_SUM] = 1.0 / largest, 1.0 / least
    # The corners' depths may lie beyond those of the face: brought back, they would tilt its plane. See setup.py:
    # MAX_CLIPPED_SLOPE.
    z_ranges = np.sort(compute_z(np.stack([least, largest], axis=1), screen), axis=1)
    (x, y, z), is_placed = snap_corners(parts, np.repeat(owners, 3), z_planes, z_ranges, screen)
    new_idx = np.arange(len(vertices.x), len(vertices.x) + 3 * n_part, dtype=np.uint32).reshape(-1, 3)[is_placed].T

    # Put the new triangles where the old ones stood: order is what decides at equal depth.
    is_whole = np.ones(vertex_idx.shape[1], bool)
    is_whole[touched] = False
    whole, owners = np.flatnonzero(is_whole).astype(np.uint32), owners[is_placed]
    faces = np.concatenate([whole, crossing[owners]])
    order = np.argsort(faces, kind="stable")
    faces = faces[order]
    parted = Triangles(
        np.ascontiguousarray(np.concatenate([vertex_idx[:, whole], new_idx], axis=1)[:, order]),
        np.ascontiguousarray(triangles.corner_idx[:, faces]),
        triangles.is_inverted[faces],
        triangles.material[faces] if len(triangles.material) else triangles.material,
        np.concatenate([np.full(len(whole), -1, np.int32), owners.astype(np.int32)])[order],
        z_ranges,
    )
    placed = zip(vertices[:5], (x, y, z, x, y), strict=True)  # a corner's z is that of where it is rounded to
    vertices = Vertices(*(np.append(old, new.astype(old.dtype)) for old, new in placed), vertices.pixel)
    return Clipped(parted, vertices, faces, planes, len(touched))


def snap_corners(parts, owners, z_planes, z_ranges, screen):
    """Round the corners of parts to 1/256 px: ((x, y, z) as of `Vertices`, which parts have all of their corners on the
    screen).

    Parameters
    ----------
    parts : (n, 3, N_CORNER_COLUMN) float64
    owners : (3 n,) uint32, the face that each corner is one of, below n_clipped
    z_planes : (n_clipped, 3) float64, see compute_face_planes
    z_ranges : (n_clipped, 2) float64, least and largest z that is seen of each face
    """
    corners = parts.reshape(-1, N_CORNER_COLUMN)
    depth = corners[:, W]
    w = depth if screen.is_perspective else np.ones(len(depth))
    x, y = project(corners[:, ACROSS], corners[:, UPWARD], w, screen)
    is_finite = np.isfinite(x) & np.isfinite(y) & np.isfinite(depth)
    # New corners lie on the limits but for rounding.
    x, y = (np.where(is_finite, np.rint(np.clip(values, -LIMIT, LIMIT)), 0.0) for values in (x, y))
    plane = z_planes[owners]
    z = plane[:, 0] + plane[:, 1] * x + plane[:, 2] * y
    z = np.where(np.isnan(z), z_ranges.mean(axis=1)[owners], z)  # the face is seen edge-on
    x, y = np.where(is_finite, x, OUTSIDE).astype(np.int32), np.where(is_finite, y, 0).astype(np.int32)
    return (x, y, z), is_finite.reshape(-1, 3).all(axis=1)


def compute_depth_ranges(w, owners, n_clipped):
    """Compute the least and the largest depth of the parts of each face; 1 for a face of which nothing is left.

    Parameters
    ----------
    w : (n_part, 3) float64, scene units
    owners : (n_part,) uint32, the face that each part is one of, below n_clipped

    Returns
    -------
    two arrays (n_clipped,) float64, scene units
    """
    least, largest = np.full(n_clipped, np.inf), np.full(n_clipped, -np.inf)
    np.minimum.at(least, owners, w.min(axis=1))
    np.maximum.at(largest, owners, w.max(axis=1))
    is_left = least <= largest
    return np.where(is_left, least, 1.0), np.where(is_left, largest, 1.0)


# ---------------------------------------------------------------- planes of whole faces


def compute_face_planes(positions, vertex_idx, screen):
    """Compute the planes of the weights q_i of whole faces, and of their depths.

    A face that is seen edge-on has the same weights everywhere, and so the same depth, which isn't known here.

    Parameters
    ----------
    positions : (n, 3) float64, world space, scene units
    vertex_idx : (3, n_clipped) uint32

    Returns
    -------
    planes : (n_clipped, N_COLUMN) float64; MIN_SUM and MAX_SUM are 1
    z_planes : (n_clipped, 3) float64, z-buffer units at the picture's corner, and what 1/256 px to the right, and down,
        adds; NaN for faces that are seen edge-on
    """
    relative = np.stack([column[vertex_idx] for column in positions.T]) - screen.eye[:, None, None]
    across, upward, depth = (
        np.einsum("a,akn->nk", axis, relative) for axis in (screen.across, screen.up, screen.forward)
    )
    w = depth if screen.is_perspective else np.ones_like(depth)
    order = np.lexsort((upward, across, depth), axis=-1)
    across, upward, w, depth = (np.take_along_axis(values, order, axis=1) for values in (across, upward, w, depth))
    corners = np.stack([across, upward, w], axis=2)
    rows, is_edge_on = invert_corners(corners, screen.is_perspective, skew_stretch(screen))
    q_x, q_y = rows[:, :, 0] / (screen.scale_x * SUBPIXEL), -rows[:, :, 1] / (screen.scale_y * SUBPIXEL)
    q = (
        rows[:, :, 2]
        - rows[:, :, 0] * (screen.center_x / screen.scale_x)
        + rows[:, :, 1] * (screen.center_y / screen.scale_y)
    )

    planes = np.ones((len(depth), N_COLUMN))
    back = np.argsort(order, axis=1)
    for column, values in ((WEIGHT, q), (WEIGHT_X, q_x), (WEIGHT_Y, q_y), (FACE_DEPTH, depth)):
        planes[:, column : column + 3] = np.take_along_axis(values, back, axis=1)
    share = np.ones_like(depth) if screen.is_perspective else depth
    z_planes = np.stack([screen.z_scale * (values * share).sum(axis=1) for values in (q, q_x, q_y)], axis=1)
    z_planes[:, 0] += screen.z_offset
    z_planes[is_edge_on] = np.nan
    return planes, z_planes


def invert_corners(corners, is_perspective, stretch=1.0):
    """Invert the matrices M whose columns are the corners of faces: (M^-1, which faces are seen edge-on).

    M^-1 has the rows (P_j × P_k)/det M. Each face is scaled to lengths of at most 1, so that no product over- or
    underflows; without perspective the third coordinate is 1 and no length, and stays. Each P_i is known to 2^-53 of
    its length, twice, and so det M = P_i·(P_j × P_k), products included, to less than 2^-50 Σ |P_i| |P_j × P_k|,
    however much further away one vertex is than another. A face whose determinant is no larger is seen edge-on; its
    rows are (0, 0, 1). With skew that is 2^-53 of a length that may be `stretch` times as long, while the corner is as
    much shorter: it counts stretch² times.

    Parameters
    ----------
    corners : (n, corner, axis) float64, eye space, scene units
    stretch : see `skew_stretch`

    Returns
    -------
    (n, corner, axis of the ray) float64, and (n,) bool
    """
    largest = np.abs(corners[:, :, : 3 if is_perspective else 2]).max(axis=(1, 2), initial=2.0**-1000)
    scale = np.repeat(np.exp2(np.ceil(np.log2(largest)))[:, None], 3, axis=1)
    if not is_perspective:
        scale[:, 2] = 1.0
    corners = corners / scale[:, None, :]
    # P_j × P_k = P_j × (P_k - P_j): the vertices of a small face far away differ in few digits.
    after, before = np.roll(corners, -1, axis=1), np.roll(corners, -2, axis=1)
    rows = np.cross(after, before - after)
    edges = corners[:, 1:] - corners[:, :1]
    determinant = (corners[:, 0] * np.cross(edges[:, 0], edges[:, 1])).sum(axis=1)
    doubt = 2.0**-50 * stretch * stretch * (np.linalg.norm(corners, axis=2) * np.linalg.norm(rows, axis=2)).sum(axis=1)
    is_edge_on = ~(np.abs(determinant) > doubt)
    rows = rows / np.where(is_edge_on, 1.0, determinant)[:, None, None] / scale[:, None, :]
    rows[is_edge_on] = (0.0, 0.0, 1.0)
    return rows, is_edge_on


# ---------------------------------------------------------------- parts of faces


@kernel
def find_crossing(positions, vertex_idx, faces, screen, scratch, out_faces):
    """Find those of some triangles that don't lie wholly beyond one of the planes; return how many.

    Nothing is left of the others.

    Parameters
    ----------
    positions : (n, 3) float64, world space · vertex_idx : (3, n_face) uint32
    faces : (n,) uint32, the triangles that are looked at
    screen : Screen
    scratch : ClipScratch
    out_faces : (n,) uint32
    """
    corners, n_out = scratch.even, index(0)
    for k in range(index(len(faces))):
        face = faces[k]
        gather_corners(positions, vertex_idx, face, screen, corners)
        out_faces[n_out] = face
        n_out += index(not is_beyond(corners, screen, GUARD_BAND))
    return np.int64(n_out)


@helper
def is_beyond(corners, screen, window):
    """Tell whether a triangle lies wholly beyond one of the planes; also where its corners are not finite."""
    for plane in range(N_CLIP_PLANE):
        d0, d1 = signed_distance(corners[0], plane, screen, window), signed_distance(corners[1], plane, screen, window)
        if not max(d0, d1, signed_distance(corners[2], plane, screen, window)) >= 0.0:
            return True
    return False


@kernel
def clip_faces(positions, vertex_idx, faces, screen, scratch, out_parts, out_owners):
    """Clip triangles; write what is left of each as a fan of triangles; return how many they are.

    Parameters
    ----------
    positions : (n, 3) float64, world space · vertex_idx : (3, n_face) uint32
    faces : (n,) uint32, the triangles that are clipped
    screen : Screen
    scratch : ClipScratch
    out_parts : (n (MAX_CORNERS - 2), 3, N_CORNER_COLUMN) float64
    out_owners : (n (MAX_CORNERS - 2),) uint32, where in `faces` the triangle is that a part is left of
    """
    polygon, other, n_out = scratch.even, scratch.odd, index(0)
    for owner in range(index(len(faces))):
        gather_corners(positions, vertex_idx, faces[owner], screen, polygon)
        n = 3
        for plane in range(N_CLIP_PLANE):
            n = clip_polygon(polygon, n, plane, screen, GUARD_BAND, other)
            polygon, other = other, polygon
        first = find_topmost(polygon, n, screen)
        for k in range(index(2), index(min(max(n, 2), MAX_CORNERS))):
            for column in range(N_CORNER_COLUMN):
                out_parts[n_out, 0, column] = polygon[first, column]
                out_parts[n_out, 1, column] = polygon[(first + k - index(1)) % index(n), column]
                out_parts[n_out, 2, column] = polygon[(first + k) % index(n), column]
            out_owners[n_out] = owner
            n_out += index(1)
    return np.int64(n_out)


@helper
def find_topmost(polygon, n, screen):
    """Find the corner of a polygon that is topmost on the screen, then leftmost, once rounded; of equal ones any."""
    topmost, min_x, min_y = index(0), np.inf, np.inf
    for k in range(index(n)):
        w = polygon[k, W] if screen.is_perspective else 1.0
        x, y = project(polygon[k, ACROSS], polygon[k, UPWARD], w, screen)
        x, y = np.rint(x), np.rint(y)
        if y < min_y or (y == min_y and x < min_x):
            topmost, min_x, min_y = k, x, y
    return topmost


@helper
def gather_corners(positions, vertex_idx, face, screen, out):
    """Write the corners of a triangle in eye space to the first three rows of `out`."""
    for k in range(3):
        i = vertex_idx[k, face]
        rx, ry, rz = positions[i, 0] - screen.eye[0], positions[i, 1] - screen.eye[1], positions[i, 2] - screen.eye[2]
        out[k, W] = rx * screen.forward[0] + ry * screen.forward[1] + rz * screen.forward[2]
        out[k, ACROSS] = rx * screen.across[0] + ry * screen.across[1] + rz * screen.across[2]
        out[k, UPWARD] = rx * screen.up[0] + ry * screen.up[1] + rz * screen.up[2]


@helper
def clip_polygon(polygon, n, plane, screen, window, out):
    """Keep the part of a convex polygon on the inner side of one plane; return how many corners it has.

    Source: Sutherland & Hodgman 1974, "Reentrant polygon clipping", CACM 17(1), 32-42.
    """
    n_out = index(0)
    for k in range(index(n)):
        here, after = polygon[k], polygon[index(0) if k + index(1) == index(n) else k + index(1)]
        d_here, d_after = signed_distance(here, plane, screen, window), signed_distance(after, plane, screen, window)
        if d_here >= 0.0:
            for column in range(N_CORNER_COLUMN):
                out[n_out, column] = here[column]
            n_out += index(1)
        if d_here >= 0.0 and d_after < 0.0:
            intersect(here, after, d_here / (d_here - d_after), out[n_out])
            n_out += index(1)
        elif d_after >= 0.0 and d_here < 0.0:
            intersect(after, here, d_after / (d_after - d_here), out[n_out])
            n_out += index(1)
    return np.int64(n_out)


@helper
def intersect(inside, outside, t, out):
    """Write the point that is the share t of the way from the inside corner to the outside one."""
    for column in range(N_CORNER_COLUMN):
        out[column] = inside[column] + t * (outside[column] - inside[column])


@helper
def signed_distance(corner, plane, screen, window):
    """Compute the distance of a corner from a clip plane, in any unit, negative outside.

    A far plane that isn't there is passed by all. The planes beside the view go through the eye and the borders of the
    window.
    """
    w = corner[W]
    # Four returns: with six the compiler counts references to the corner's row, which takes longer.
    if plane == NEAR:
        return w - screen.near
    if plane == FAR:
        return screen.far - w if screen.far < np.inf else 1.0
    scale = w if screen.is_perspective else 1.0
    if plane <= RIGHT:
        x = screen.scale_x * corner[ACROSS]
        border = screen.center_x - window.left if plane == LEFT else window.right - screen.center_x
        return border * scale + (x if plane == LEFT else -x)
    y = screen.scale_y * corner[UPWARD]
    border = screen.center_y - window.top if plane == TOP else window.bottom - screen.center_y
    return border * scale + (-y if plane == TOP else y)


# ---------------------------------------------------------------- the nearest depth that is seen


def find_nearest(positions, vertex_idx, screen, width, height) -> float:
    """Find the least distance along the viewing axis at which any triangle is seen in the picture; infinite if none is.

    For a camera inside the scene: what is behind it or beside the picture says nothing about the depths that are seen.

    Parameters
    ----------
    positions : (n, 3) float64, world space, scene units
    vertex_idx : (3, n_face) uint32
    width, height : of the picture, px
    """
    window = Window(0.0, float(width), 0.0, float(height))
    return search_nearest(positions, vertex_idx, screen, window, make_clip_scratch())


@kernel
def search_nearest(positions, vertex_idx, screen, window, scratch):
    """Clip every triangle that may lie nearer than those before it; return the least distance, see `find_nearest`.

    Parameters
    ----------
    positions : (n, 3) float64, world space, scene units · vertex_idx : (3, n_face) uint32
    screen : Screen
    window : Window, the picture
    scratch : ClipScratch
    """
    polygon, other, nearest = scratch.even, scratch.odd, np.inf
    for face in range(index(vertex_idx.shape[1])):
        gather_corners(positions, vertex_idx, face, screen, polygon)
        if min(polygon[0, W], polygon[1, W], polygon[2, W]) >= nearest or is_beyond(polygon, screen, window):
            continue
        n = 3
        for plane in range(N_CLIP_PLANE):
            n = clip_polygon(polygon, n, plane, screen, window, other)
            polygon, other = other, polygon
        for k in range(index(n)):
            nearest = min(nearest, polygon[k, W])
    return nearest
