"""Stage 2, clip: the triangles with a vertex that can't be placed on the screen, in homogeneous space.

In:  index columns, positions, and the vertices on the screen, some of them OUTSIDE.
Out: the same with every such triangle replaced, at its place in the order of faces, by the parts of it that can be
placed, and
     the planes of the whole face.

Clipped against the near plane, the far plane where the caller gave one, and |x|, |y| <= 2^20 px: six half-spaces that
are linear in eye space (Sutherland & Hodgman 1974). A new vertex is always computed from the inside vertex to the
outside one, so two triangles that share an edge get the same one, and no gap opens between them.

The parts say only what is covered. Depth and attributes come from the planes of the whole face, so they are the same in
all parts of a face, wherever it is clipped:

* A part's corners are rounded to 1/256 px as all vertices are. Its depths are those of the whole face at the rounded
  corners; depth is affine on the screen, so the planes of all parts are the plane of the face.
* Attributes are interpolated with the weights q_i of the face's own three vertices, which are affine on the screen,
  too: with the vertices P_i in eye space and the ray r(x, y) = ((x - center_x)/scale_x, (center_y - y)/scale_y, 1) of a
  sample, q = M^-1 r, where P_0, P_1, P_2 are the columns of M. Then r·w = Σ b_i P_i with b_i = w q_i, and 1/w = Σ q_i
  (Olano & Greer 1997, "Triangle scan conversion using 2D homogeneous coordinates"). Without perspective P_i = (across,
  upward, 1), and q_i = b_i.

Where all three vertices have a place on the screen, near and far planes apart, they count at their rounded places: the
planes are those of the face that isn't clipped. Else one is behind the eye, or too far out to be rounded, and all count
where they are. The vertices are sorted before anything is computed from them, and a part begins at its topmost,
leftmost corner: so two faces with the same vertices have the same parts and the same depths to the last bit, in
whatever order a file lists them.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel
from .transform import LIMIT_PX, OUTSIDE, SUBPIXEL, Vertices

N_PLANE = 6
GUARD = (-float(LIMIT_PX), float(LIMIT_PX), -float(LIMIT_PX), float(LIMIT_PX))  # px
MOST_CORNERS = 3 + N_PLANE  # each plane adds at most one corner to a convex polygon
# Rounding may bend a sliver, and then more than two edges cross a plane: of n corners with m inside, m and one for each
# crossing are left, m + 2 min(m, n - m) <= 3 n / 2. Six times from a triangle on: 4, 6, 9, 13, 19, 28.
ROOM = 28
# A corner while it is clipped: distance along the viewing axis, along right and up (scene units).
W, ACROSS, UPWARD = 0, 1, 2
N_COLUMN = 3
# Rows of `Clipped.planes`: q_i at the picture's corner (0, 0), and what 1/256 px to the right, and down, adds to them;
# the range that their sum has where the face is seen; depths of the vertices. Without perspective the sum is 1.
WEIGHT, WEIGHT_X, WEIGHT_Y, LEAST_SUM, LARGEST_SUM, WHOLE_DEPTH = 0, 3, 6, 9, 10, 11
N_PLANE_COLUMN = 14
NO_PLANES = np.empty((0, N_PLANE_COLUMN))


class Clipped(NamedTuple):
    """What takes the place of the index columns; new vertices stand behind the old ones."""

    vertex: np.ndarray  # (3, n) uint32
    corner: np.ndarray  # (3, n) uint32: of a part those of its face
    face: np.ndarray  # (n,) uint32, the face that each triangle is a part of
    cut: np.ndarray  # (n,) int32, its row of `planes`; -1 for a face that is whole
    planes: np.ndarray  # (n_cut, N_PLANE_COLUMN) float64
    ends: np.ndarray  # (n_cut, 2) float64, least and largest depth that is seen of the face, z-buffer units
    vertices: Vertices
    n_clipped: int  # faces that were clipped or lie wholly outside


def clip(positions, vertex, corner, vertices, screen) -> Clipped:
    """Clip every triangle that has an OUTSIDE vertex."""
    touched = np.flatnonzero((vertices.x[vertex] == OUTSIDE).any(axis=0))
    crossing = np.empty(len(touched), np.uint32)
    crossing = crossing[: find_crossing(positions, vertex, touched.astype(np.uint32), screen, crossing)]
    most = len(crossing) * (MOST_CORNERS - 2)
    parts, cut = np.empty((most, 3, N_COLUMN)), np.empty(most, np.uint32)
    n_new = clip_faces(positions, vertex, crossing, screen, parts, cut)
    parts, cut = parts[:n_new], cut[:n_new]

    x, y, is_inside = place(parts.reshape(-1, N_COLUMN), screen)
    planes, whole_z = find_whole_planes(positions, vertex[:, crossing], screen)
    least, largest = find_ranges(parts[:, :, W], cut, len(crossing))
    if screen.is_perspective:
        planes[:, LEAST_SUM], planes[:, LARGEST_SUM] = 1.0 / largest, 1.0 / least
    z = np.repeat(whole_z[cut], 3, axis=0)
    z = z[:, 0] + z[:, 1] * x + z[:, 2] * y
    # The corners' depths may lie beyond those of the face: brought back, they would tilt its plane. See setup.py:
    # MAX_CUT_SLOPE.
    ends = np.sort(z_of(np.stack([least, largest], axis=1), screen), axis=1)
    z = np.where(np.isnan(z), np.repeat(ends.mean(axis=1)[cut], 3), z)

    keep = is_inside.reshape(-1, 3).all(axis=1)
    n_old = len(vertices.x)
    new_vertex = np.arange(n_old, n_old + 3 * n_new, dtype=np.uint32).reshape(-1, 3)
    x, y = np.where(is_inside, x, OUTSIDE).astype(np.int32), np.where(is_inside, y, 0).astype(np.int32)
    vertices = Vertices(np.append(vertices.x, x), np.append(vertices.y, y), np.append(vertices.z, z))

    # Put the new triangles where the old ones stood: order is what decides at equal depth.
    untouched = np.ones(vertex.shape[1], bool)
    untouched[touched] = False
    old_face = np.flatnonzero(untouched).astype(np.uint32)
    owner = crossing[cut[keep]]
    face = np.concatenate([old_face, owner])
    order = np.argsort(face, kind="stable")
    return Clipped(
        np.ascontiguousarray(np.concatenate([vertex[:, old_face], new_vertex[keep].T], axis=1)[:, order]),
        np.ascontiguousarray(corner[:, face[order]]),
        face[order],
        np.concatenate([np.full(len(old_face), -1, np.int32), cut[keep].astype(np.int32)])[order],
        planes,
        ends,
        vertices,
        len(touched),
    )


def place(corners, screen):
    """Put clipped corners on the screen: (x, y, whether they could be placed), x and y whole numbers of 1/256 px."""
    depth = corners[:, W]
    w = depth if screen.is_perspective else np.ones(len(depth))
    x = (screen.center_x + screen.scale_x * corners[:, ACROSS] / w) * SUBPIXEL
    y = (screen.center_y - screen.scale_y * corners[:, UPWARD] / w) * SUBPIXEL
    limit = float(LIMIT_PX * SUBPIXEL)
    is_inside = np.isfinite(x) & np.isfinite(y) & np.isfinite(depth)
    # New corners lie on the limits but for rounding.
    x, y = (np.where(is_inside, np.rint(np.clip(values, -limit, limit)), 0.0) for values in (x, y))
    return x, y, is_inside


def z_of(w, screen):
    """Depths along the viewing axis in units of the z-buffer."""
    return screen.z_offset + screen.z_scale * (1.0 / w if screen.is_perspective else w)


def find_ranges(w, cut, n_cut):
    """Least and largest depth of the parts of each face, (n_cut,) float64 each; 1 for a face of which nothing is left.

    Parameters
    ----------
    w : (n_part, 3) float64, scene units
    cut : (n_part,) uint32, the faces' numbers, below n_cut
    """
    least, largest = np.full(n_cut, np.inf), np.full(n_cut, -np.inf)
    np.minimum.at(least, cut, w.min(axis=1))
    np.maximum.at(largest, cut, w.max(axis=1))
    is_left = least <= largest
    return np.where(is_left, least, 1.0), np.where(is_left, largest, 1.0)


def round_places(across, upward, w, screen):
    """Move the vertices of faces across the view to where the screen shows them rounded, if all three have a place
    there.

    All are (n_cut, 3) float64, scene units; depths, `w`, stay.
    """
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        x = (screen.center_x + screen.scale_x * across / w) * SUBPIXEL
        y = (screen.center_y - screen.scale_y * upward / w) * SUBPIXEL
        limit = float(LIMIT_PX * SUBPIXEL)
        is_placed = ((w > 0.0) & (np.abs(x) <= limit) & (np.abs(y) <= limit)).all(axis=1, keepdims=True)
        x, y = np.rint(x) / SUBPIXEL, np.rint(y) / SUBPIXEL
        across = np.where(is_placed, w * (x - screen.center_x) / screen.scale_x, across)
        upward = np.where(is_placed, w * (screen.center_y - y) / screen.scale_y, upward)
    return across, upward


def find_whole_planes(positions, vertex, screen):
    """Find the planes of the weights q_i of whole faces, and of their depths.

    M^-1 has the rows (P_j × P_k)/det M. Each face is scaled to lengths of at most 1, so that no product over- or
    underflows; without perspective the third coordinate is 1 and no length, and stays. Each P_i is known to 2^-53 of
    its length, twice, and so det M = P_i·(P_j × P_k), products included, to less than 2^-50 Σ |P_i| |P_j × P_k|,
    however much further away one vertex is than another. A face whose determinant is no larger is seen edge-on: its
    weights are all the same, and so is its depth, which isn't known here.

    Parameters
    ----------
    positions : (3, n) float64, world space
    vertex : (3, n_cut) uint32

    Returns
    -------
    planes : (n_cut, N_PLANE_COLUMN) float64; LEAST_SUM and LARGEST_SUM are 1
    z : (n_cut, 3) float64, z-buffer units at the picture's corner, and what 1/256 px to the right, and down, adds; NaN
        for faces that are seen edge-on
    """
    relative = positions[:, vertex] - screen.eye[:, None, None]
    across, upward, depth = (
        np.einsum("a,akn->nk", axis, relative) for axis in (screen.right, screen.up, screen.forward)
    )
    w = depth if screen.is_perspective else np.ones_like(depth)
    across, upward = round_places(across, upward, w, screen)
    order = np.lexsort((upward, across, depth), axis=-1)
    across, upward, w, depth = (np.take_along_axis(values, order, axis=1) for values in (across, upward, w, depth))
    corners = np.stack([across, upward, w], axis=2)  # (n_cut, vertex, axis), sorted
    largest = np.abs(corners[:, :, : 3 if screen.is_perspective else 2]).max(axis=(1, 2), initial=2.0**-1000)
    scale = np.repeat(np.exp2(np.ceil(np.log2(largest)))[:, None], 3, axis=1)
    if not screen.is_perspective:
        scale[:, 2] = 1.0
    corners = corners / scale[:, None, :]

    # P_j × P_k = P_j × (P_k - P_j): the vertices of a small face far away differ in few digits.
    after, before = np.roll(corners, -1, axis=1), np.roll(corners, -2, axis=1)
    rows = np.cross(after, before - after)  # (n_cut, vertex, axis) of the ray
    edges = corners[:, 1:] - corners[:, :1]
    determinant = (corners[:, 0] * np.cross(edges[:, 0], edges[:, 1])).sum(axis=1)
    doubt = 2.0**-50 * (np.linalg.norm(corners, axis=2) * np.linalg.norm(rows, axis=2)).sum(axis=1)
    is_edge_on = ~(np.abs(determinant) > doubt)
    rows = rows / np.where(is_edge_on, 1.0, determinant)[:, None, None] / scale[:, None, :]
    rows[is_edge_on] = (0.0, 0.0, 1.0)
    q_x, q_y = rows[:, :, 0] / (screen.scale_x * SUBPIXEL), -rows[:, :, 1] / (screen.scale_y * SUBPIXEL)
    q = (
        rows[:, :, 2]
        - rows[:, :, 0] * (screen.center_x / screen.scale_x)
        + rows[:, :, 1] * (screen.center_y / screen.scale_y)
    )

    planes = np.ones((len(corners), N_PLANE_COLUMN))
    back = np.argsort(order, axis=1)
    for column, values in ((WEIGHT, q), (WEIGHT_X, q_x), (WEIGHT_Y, q_y), (WHOLE_DEPTH, depth)):
        planes[:, column : column + 3] = np.take_along_axis(values, back, axis=1)
    share = np.ones_like(depth) if screen.is_perspective else depth
    z = np.stack([screen.z_scale * (values * share).sum(axis=1) for values in (q, q_x, q_y)], axis=1)
    z[:, 0] += screen.z_offset
    z[is_edge_on] = np.nan
    return planes, z


@kernel
def find_crossing(positions, vertex, faces, screen, out_face):
    """Find those of the triangles `faces` that don't lie wholly beyond one of the planes; return how many: nothing is
    left of the others."""
    corners = np.empty((3, N_COLUMN))
    n_out = np.uint64(0)
    for face in faces:
        take_triangle(positions, vertex, face, screen, corners)
        out_face[n_out] = face
        n_out += np.uint64(not is_beyond(corners, screen, GUARD))
    return n_out


@helper
def is_beyond(corners, screen, limits):
    """Tell whether a triangle lies wholly beyond one of the planes; also where its corners are not finite."""
    for plane in range(N_PLANE):
        d0, d1 = distance(corners[0], plane, screen, limits), distance(corners[1], plane, screen, limits)
        if not max(d0, d1, distance(corners[2], plane, screen, limits)) >= 0.0:
            return True
    return False


@kernel
def clip_faces(positions, vertex, faces, screen, out_parts, out_cut):
    """Clip the triangles `faces`; write what is left of each as a fan of triangles, and its place in `faces`; return
    how many."""
    polygon, scratch = np.empty((ROOM, N_COLUMN)), np.empty((ROOM, N_COLUMN))
    n_out = np.uint64(0)
    for number in range(np.uint64(len(faces))):
        take_triangle(positions, vertex, faces[number], screen, polygon)
        n = 3
        for plane in range(N_PLANE):
            n = clip_polygon(polygon, n, plane, screen, GUARD, scratch)
            polygon, scratch = scratch, polygon
        first = find_first(polygon, n, screen)
        for k in range(np.uint64(2), np.uint64(min(max(n, 2), MOST_CORNERS))):
            for column in range(np.uint64(N_COLUMN)):
                out_parts[n_out, 0, column] = polygon[first, column]
                out_parts[n_out, 1, column] = polygon[(first + k - np.uint64(1)) % np.uint64(n), column]
                out_parts[n_out, 2, column] = polygon[(first + k) % np.uint64(n), column]
            out_cut[n_out] = number
            n_out += np.uint64(1)
    return n_out


@helper
def find_first(polygon, n, screen):
    """Find the corner of a polygon that is topmost on the screen, then leftmost, once rounded; of equal ones any."""
    first, least_x, least_y = np.uint64(0), np.inf, np.inf
    for k in range(np.uint64(n)):
        w = polygon[k, W] if screen.is_perspective else 1.0
        x = np.rint((screen.center_x + screen.scale_x * polygon[k, ACROSS] / w) * SUBPIXEL)
        y = np.rint((screen.center_y - screen.scale_y * polygon[k, UPWARD] / w) * SUBPIXEL)
        if y < least_y or (y == least_y and x < least_x):
            first, least_x, least_y = k, x, y
    return first


@kernel
def find_nearest(positions, vertex, screen, width, height):
    """Find the least distance along the viewing axis at which any triangle is seen in the picture; infinite if none is.

    For a camera inside the scene: what is behind it or beside the picture says nothing about the depths that are seen.
    """
    polygon, scratch = np.empty((ROOM, N_COLUMN)), np.empty((ROOM, N_COLUMN))
    limits = (0.0, float(width), 0.0, float(height))
    nearest = np.inf
    for face in range(np.uint64(vertex.shape[1])):
        take_triangle(positions, vertex, face, screen, polygon)
        if min(polygon[0, W], polygon[1, W], polygon[2, W]) >= nearest or is_beyond(polygon, screen, limits):
            continue
        n = 3
        for plane in range(N_PLANE):
            n = clip_polygon(polygon, n, plane, screen, limits, scratch)
            polygon, scratch = scratch, polygon
        for k in range(np.uint64(n)):
            nearest = min(nearest, polygon[k, W])
    return nearest


@helper
def take_triangle(positions, vertex, face, screen, out):
    """Write the corners of a triangle in eye space."""
    for k in range(np.uint64(3)):
        i = vertex[k, face]
        rx, ry, rz = positions[0, i] - screen.eye[0], positions[1, i] - screen.eye[1], positions[2, i] - screen.eye[2]
        out[k, W] = rx * screen.forward[0] + ry * screen.forward[1] + rz * screen.forward[2]
        out[k, ACROSS] = rx * screen.right[0] + ry * screen.right[1] + rz * screen.right[2]
        out[k, UPWARD] = rx * screen.up[0] + ry * screen.up[1] + rz * screen.up[2]


@helper
def clip_polygon(polygon, n, plane, screen, limits, out):
    """Keep the part of a convex polygon on the inner side of one plane (Sutherland & Hodgman 1974); return its
    corners."""
    n_out = np.uint64(0)
    for k in range(np.uint64(n)):
        here, after = polygon[k], polygon[np.uint64(0) if k + np.uint64(1) == np.uint64(n) else k + np.uint64(1)]
        d_here, d_after = distance(here, plane, screen, limits), distance(after, plane, screen, limits)
        if d_here >= 0.0:
            for column in range(np.uint64(N_COLUMN)):
                out[n_out, column] = here[column]
            n_out += np.uint64(1)
        if d_here >= 0.0 and d_after < 0.0:
            cut(here, after, d_here / (d_here - d_after), out[n_out])
            n_out += np.uint64(1)
        elif d_after >= 0.0 and d_here < 0.0:
            cut(after, here, d_after / (d_after - d_here), out[n_out])
            n_out += np.uint64(1)
    return np.int64(n_out)


@helper
def cut(inside, outside, t, out):
    """Write the point that is the share t of the way from the inside corner to the outside one."""
    for column in range(np.uint64(N_COLUMN)):
        out[column] = inside[column] + t * (outside[column] - inside[column])


@helper
def distance(corner, plane, screen, limits):
    """Distance of a corner from a plane, in any unit, negative outside; a plane that isn't there is passed by all.

    Planes are near, far, and the `limits` on the screen: least and largest x, least and largest y, in px.
    """
    w = corner[W]
    if plane == 0:
        return w - screen.near
    if plane == 1:
        return screen.far - w if screen.far < np.inf else 1.0
    scale = w if screen.is_perspective else 1.0
    if plane <= 3:
        x = screen.scale_x * corner[ACROSS]
        return (screen.center_x - limits[0]) * scale + x if plane == 2 else (limits[1] - screen.center_x) * scale - x
    y = screen.scale_y * corner[UPWARD]
    return (screen.center_y - limits[2]) * scale - y if plane == 4 else (limits[3] - screen.center_y) * scale + y
