"""Stage 2, clip: the triangles with a vertex that can't be placed on the screen, in homogeneous space.

In:  index columns, positions, and the vertices on the screen, some of them OUTSIDE.
Out: the same with every such triangle replaced, at its place in the order of faces, by the part that can be placed.

Clipped against the near plane, the far plane where the caller gave one, and |x|, |y| <= 2^20 px: six half-spaces that are linear
in eye space (Sutherland & Hodgman 1974). A new vertex is always computed from the inside vertex to the outside one, so two
triangles that share an edge get the same one, and no gap opens between them.
"""

from typing import NamedTuple

import numpy as np

from .._kernel import helper, kernel
from .transform import LIMIT_PX, OUTSIDE, SUBPIXEL, Vertices

N_PLANE = 6
GUARD = (-float(LIMIT_PX), float(LIMIT_PX), -float(LIMIT_PX), float(LIMIT_PX))  # px
MOST_CORNERS = 3 + N_PLANE  # each plane adds at most one corner to a convex polygon
# Rounding may bend a sliver, and then more than two edges cross a plane: of n corners with m inside, m and one for each crossing
# are left, m + 2 min(m, n - m) <= 3 n / 2. Six times from a triangle on: 4, 6, 9, 13, 19, 28.
ROOM = 28
# A corner while it is clipped: distance along the viewing axis, along right and up (scene units), shares of the three vertices.
W, ACROSS, UPWARD, SHARE = 0, 1, 2, 3
N_COLUMN = 6


class Clipped(NamedTuple):
    """What takes the place of the index columns; new vertices and points stand behind the old ones."""

    vertex: np.ndarray  # (3, n) uint32
    corner: np.ndarray  # (3, n) uint32
    face: np.ndarray  # (n,) uint32, the face that each triangle is a part of
    vertices: Vertices
    points: np.ndarray  # (n_new, 3) uint32: new point k is a mean of these points ...
    shares: np.ndarray  # (n_new, 3) float64: ... with these weights
    n_clipped: int  # faces that were clipped or lie wholly outside


def clip(positions, vertex, corner, vertices, screen, has_own_points) -> Clipped:
    """Clip every triangle that has an OUTSIDE vertex.

    `has_own_points` tells that every corner of a new triangle needs a point of its own (vertices are points); else a new
    triangle keeps the points of its face (flat shading).
    """
    touched = np.flatnonzero((vertices.x[vertex] == OUTSIDE).any(axis=0))
    crossing = np.empty(len(touched), np.uint32)
    crossing = crossing[: find_crossing(positions, vertex, touched.astype(np.uint32), screen, crossing)]
    most = len(crossing) * (MOST_CORNERS - 2)
    triangles, owner = np.empty((most, 3, N_COLUMN)), np.empty(most, np.uint32)
    n_new = clip_faces(positions, vertex, crossing, screen, triangles, owner)
    triangles, owner = triangles[:n_new].reshape(-1, N_COLUMN), owner[:n_new]

    x, y, z, is_inside = place(triangles, screen)
    keep = is_inside.reshape(-1, 3).all(axis=1)
    n_old = len(vertices.x)
    new_vertex = np.arange(n_old, n_old + 3 * n_new, dtype=np.uint32).reshape(-1, 3)
    vertices = Vertices(np.append(vertices.x, x), np.append(vertices.y, y), np.append(vertices.z, z))
    faces_of_corner = np.repeat(owner, 3)
    points, shares = corner[:, faces_of_corner].T, triangles[:, SHARE:]
    new_corner = new_vertex if has_own_points else corner[:, owner].T

    # Put the new triangles where the old ones stood: order is what decides at equal depth.
    untouched = np.ones(vertex.shape[1], bool)
    untouched[touched] = False
    old_face = np.flatnonzero(untouched).astype(np.uint32)
    face = np.concatenate([old_face, owner[keep]])
    order = np.argsort(face, kind="stable")
    return Clipped(
        np.ascontiguousarray(np.concatenate([vertex[:, old_face], new_vertex[keep].T], axis=1)[:, order]),
        np.ascontiguousarray(np.concatenate([corner[:, old_face], new_corner[keep].T], axis=1)[:, order]),
        face[order],
        vertices,
        np.ascontiguousarray(points),
        np.ascontiguousarray(shares),
        len(touched),
    )


def extend(values, clipped) -> np.ndarray:
    """Append to point attributes (side, n_point, n_attribute) those of the new points: linear along the clipped edges."""
    corners = values[:, clipped.points]  # (side, n_new, 3, n_attribute)
    new = np.einsum("skca,kc->ska", corners.astype(np.float64), clipped.shares)
    # A weighted mean can leave the range of its values by a rounding error only; it may not.
    new = np.clip(new, corners.min(axis=2), corners.max(axis=2))
    return np.concatenate([values, new.astype(values.dtype)], axis=1)


def place(corners, screen):
    """Put clipped corners on the screen: (x, y, z, whether they could be placed)."""
    depth = corners[:, W]
    w = depth if screen.is_perspective else np.ones(len(depth))
    x = (screen.center_x + screen.scale_x * corners[:, ACROSS] / w) * SUBPIXEL
    y = (screen.center_y - screen.scale_y * corners[:, UPWARD] / w) * SUBPIXEL
    limit = float(LIMIT_PX * SUBPIXEL)
    with np.errstate(invalid="ignore"):
        is_inside = np.isfinite(x) & np.isfinite(y) & np.isfinite(depth)
        # New corners lie on the limits but for rounding.
        x, y = np.clip(x, -limit, limit), np.clip(y, -limit, limit)
    x, y = np.where(is_inside, np.rint(x), OUTSIDE), np.where(is_inside, np.rint(y), 0)
    z = screen.z_offset + screen.z_scale * (1.0 / w if screen.is_perspective else depth)
    return x.astype(np.int32), y.astype(np.int32), z, is_inside


@kernel
def find_crossing(positions, vertex, faces, screen, out_face):
    """Find those of the triangles `faces` that don't lie wholly beyond one of the planes; return how many: nothing is left of
    the others."""
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
def clip_faces(positions, vertex, faces, screen, out_triangles, out_face):
    """Clip the triangles `faces`; write what is left of each as a fan of triangles; return how many."""
    polygon, scratch = np.empty((ROOM, N_COLUMN)), np.empty((ROOM, N_COLUMN))
    n_out = np.uint64(0)
    for face in faces:
        take_triangle(positions, vertex, face, screen, polygon)
        n = 3
        for plane in range(N_PLANE):
            n = clip_polygon(polygon, n, plane, screen, GUARD, scratch)
            polygon, scratch = scratch, polygon
        for k in range(np.uint64(2), np.uint64(min(max(n, 2), MOST_CORNERS))):
            for column in range(np.uint64(N_COLUMN)):
                out_triangles[n_out, 0, column] = polygon[0, column]
                out_triangles[n_out, 1, column] = polygon[k - np.uint64(1), column]
                out_triangles[n_out, 2, column] = polygon[k, column]
            out_face[n_out] = face
            n_out += np.uint64(1)
    return n_out


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
    """Write the corners of a triangle in eye space, each with its share of itself."""
    for k in range(np.uint64(3)):
        i = vertex[k, face]
        rx, ry, rz = positions[0, i] - screen.eye[0], positions[1, i] - screen.eye[1], positions[2, i] - screen.eye[2]
        out[k, W] = rx * screen.forward[0] + ry * screen.forward[1] + rz * screen.forward[2]
        out[k, ACROSS] = rx * screen.right[0] + ry * screen.right[1] + rz * screen.right[2]
        out[k, UPWARD] = rx * screen.up[0] + ry * screen.up[1] + rz * screen.up[2]
        for corner in range(np.uint64(3)):
            out[k, np.uint64(SHARE) + corner] = 1.0 if corner == k else 0.0


@helper
def clip_polygon(polygon, n, plane, screen, limits, out):
    """Keep the part of a convex polygon on the inner side of one plane (Sutherland & Hodgman 1974); return its corners."""
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
