"""Stage 2, clip: the triangles with a vertex that has no place on the screen, in homogeneous space.

In:  positions, triangles, and the vertices on the screen, some of them OUTSIDE.
Out: `Clipped`: in the place of each such triangle, in the order of faces, the parts of it that have a place on the
     screen. The stages behind know nothing of it: a part is a triangle like any other.

Clipped against the near plane, the far plane where the caller gave one, and |x|, |y| <= 2^20 px: six half-spaces that
are linear in eye space (Sutherland & Hodgman 1974). A new vertex is always computed from the inside vertex to the
outside one, so two triangles that share an edge get the same one, and no gap opens between them:

           inside │ outside
     A ───────────C─────── B      C = A + t (B - A), t = d_A / (d_A - d_B), d the distances from the plane
      ╲           │     ╱         C has the weights 1 - t on A and t on B
       ╲          │  ╱
        ╲         │╱              A C D E is left, as a fan of two triangles
         ╲       ╱D
          ╲   ╱   │
           E      │

What is interpolated is linear in eye space, before the division. So all that the vertices of a triangle have goes the
same way: with A_i its positions, normals, intensities, texture coordinates, a new vertex has Σ b_i A_i, where b_i are
its weights on them, Σ b_i = 1.

A fan begins at the topmost, leftmost corner: so two faces with the same vertices have the same parts, in whatever order
a file lists them.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel
from .transform import LIMIT, LIMIT_PX, OUTSIDE, Vertices, compute_z, project

NEAR, FAR, LEFT, RIGHT, TOP, BOTTOM = range(6)  # the clip planes
N_CLIP_PLANE = 6
MAX_CORNERS = 3 + N_CLIP_PLANE  # each plane adds at most one corner to a convex polygon
# Rounding may bend a sliver, and then more than two edges cross a plane: of n corners with m inside, m and one for each
# crossing are left, m + 2 min(m, n - m) <= 3 n / 2. Six times from a triangle on: 4, 6, 9, 13, 19, 28.
ROOM = 28
# Columns of a corner while it is clipped: distances along the viewing axis, the screen's `across` and up, scene units;
# three weights on the vertices of its triangle.
W, ACROSS, UPWARD, WEIGHTS = 0, 1, 2, 3
N_CORNER_COLUMN = 6


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
    """The triangles that are left, whole ones and parts, in the order of the faces."""

    vertices: Vertices  # behind the old ones stand three for each part
    faces: np.ndarray  # (n,) uint32, the triangle that each is, or is a part of
    parts: np.ndarray  # (n_part,) which of them are parts
    weights: np.ndarray  # (n_part, 3, 3) float64, of each corner of a part on the vertices of its triangle
    n_clipped: int  # triangles that were clipped or lie wholly outside

    def add_values(self, values, rows):
        """Return what vertices have, (n_side, n_row, n_value) float32 or float64, with what new ones have behind it.

        `rows` (3, n_face) is where the three corners of each triangle find theirs. A constant stays one, and no value
        leaves the range of its triangle's, whatever is rounded. Where there are no values, none are added.
        """
        if values.shape[-1] == 0:
            return values
        owners = self.faces[self.parts]
        a, b, c = (values[:, rows[k, owners], None] for k in range(3))  # (n_side, n_part, 1, n_value)
        weight = self.weights[..., None]
        with np.errstate(invalid="ignore", over="ignore"):  # of values that nobody reads, and that may be anything
            means = weight[:, :, 0] * a + weight[:, :, 1] * b + weight[:, :, 2] * c
        low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        new = np.clip(means, low, high).reshape(len(values), -1, values.shape[-1])
        return np.concatenate([values, new.astype(values.dtype)], axis=1)

    def rows_of(self, rows, n_row):
        """Return where the corners of the triangles that are left find what they have, (3, n) uint32: of parts behind
        the n_row rows of old vertices; see `add_values`."""
        found = np.take(rows, self.faces, axis=1)
        found[:, self.parts] = np.arange(n_row, n_row + 3 * len(self.weights)).reshape(-1, 3).T
        return found


def clip(positions, vertex_idx, vertices: Vertices, screen) -> Clipped:
    """Clip every triangle that has an OUTSIDE vertex.

    Parameters
    ----------
    positions : (n, 3) float64, world space, scene units
    vertex_idx : (3, n_face) uint32
    """
    is_touched = (vertices.x[vertex_idx] == OUTSIDE).any(axis=0)
    touched = np.flatnonzero(is_touched).astype(np.uint32)
    crossing, scratch = np.empty(len(touched), np.uint32), make_clip_scratch()
    crossing = crossing[: find_crossing(positions, vertex_idx, touched, screen, scratch, crossing)]
    room = len(crossing) * (MAX_CORNERS - 2)
    parts, owners = np.empty((room, 3, N_CORNER_COLUMN)), np.empty(room, np.uint32)
    n_part = clip_faces(positions, vertex_idx, crossing, screen, scratch, parts, owners)
    new, is_placed = place_corners(parts[:n_part], screen)
    parts, owners = parts[:n_part][is_placed], owners[:n_part][is_placed]

    # Put the parts where their triangles stood: order is what decides at equal depth.
    whole = np.flatnonzero(~is_touched).astype(np.uint32)
    faces = np.concatenate([whole, crossing[owners]])
    order = np.argsort(faces, kind="stable")
    columns = (np.append(old, values[is_placed].ravel()) for old, values in zip(vertices[:5], new, strict=True))
    return Clipped(
        Vertices(*columns, vertices.pixel),
        faces[order],
        np.flatnonzero(order >= len(whole)),
        parts[:, :, WEIGHTS:],
        len(touched),
    )


def place_corners(parts, screen):
    """Put the corners of parts (n, 3, N_CORNER_COLUMN) on the screen: ((x, y, z, true_x, true_y) as of `Vertices`, each
    (n, 3); and (n,) bool, which parts have a place there with all of their corners)."""
    # Rounding may leave a corner a little before the near plane, or beyond the limits.
    depth = np.maximum(parts[:, :, W], screen.near)
    w = depth if screen.is_perspective else np.ones_like(depth)
    x, y = project(parts[:, :, ACROSS], parts[:, :, UPWARD], w, screen)
    is_placed = (np.isfinite(x) & np.isfinite(y) & np.isfinite(depth)).all(axis=1)
    x, y = (np.where(is_placed[:, None], np.clip(values, -LIMIT, LIMIT), 0.0) for values in (x, y))
    return (np.rint(x).astype(np.int32), np.rint(y).astype(np.int32), compute_z(depth, screen), x, y), is_placed


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
    corners, n_out = scratch.even, 0
    for k in range(len(faces)):
        face = faces[k]
        gather_corners(positions, vertex_idx, face, screen, corners)
        out_faces[n_out] = face
        n_out += not is_beyond(corners, screen, GUARD_BAND)
    return n_out


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
    polygon, other, n_out = scratch.even, scratch.odd, 0
    for owner in range(len(faces)):
        gather_corners(positions, vertex_idx, faces[owner], screen, polygon)
        n = 3
        for plane in range(N_CLIP_PLANE):
            n = clip_polygon(polygon, n, plane, screen, GUARD_BAND, other)
            polygon, other = other, polygon
        first = find_topmost(polygon, n, screen)
        for k in range(2, min(max(n, 2), MAX_CORNERS)):
            for column in range(N_CORNER_COLUMN):
                out_parts[n_out, 0, column] = polygon[first, column]
                out_parts[n_out, 1, column] = polygon[(first + k - 1) % n, column]
                out_parts[n_out, 2, column] = polygon[(first + k) % n, column]
            out_owners[n_out] = owner
            n_out += 1
    return n_out


@helper
def find_topmost(polygon, n, screen):
    """Find the corner of a polygon that is topmost on the screen, then leftmost, once rounded; of equal ones any."""
    topmost, min_x, min_y = 0, np.inf, np.inf
    for k in range(n):
        w = polygon[k, W] if screen.is_perspective else 1.0
        x, y = project(polygon[k, ACROSS], polygon[k, UPWARD], w, screen)
        x, y = np.rint(x), np.rint(y)
        if y < min_y or (y == min_y and x < min_x):
            topmost, min_x, min_y = k, x, y
    return topmost


@helper
def gather_corners(positions, vertex_idx, face, screen, out):
    """Write the corners of a triangle in eye space, with their weights, to the first three rows of `out`."""
    for k in range(3):
        i = vertex_idx[k, face]
        rx, ry, rz = positions[i, 0] - screen.eye[0], positions[i, 1] - screen.eye[1], positions[i, 2] - screen.eye[2]
        out[k, W] = rx * screen.forward[0] + ry * screen.forward[1] + rz * screen.forward[2]
        out[k, ACROSS] = rx * screen.across[0] + ry * screen.across[1] + rz * screen.across[2]
        out[k, UPWARD] = rx * screen.up[0] + ry * screen.up[1] + rz * screen.up[2]
        for vertex in range(3):
            out[k, WEIGHTS + vertex] = 1.0 if vertex == k else 0.0


@helper
def clip_polygon(polygon, n, plane, screen, window, out):
    """Keep the part of a convex polygon on the inner side of one plane; return how many corners it has.

    Source: Sutherland & Hodgman 1974, "Reentrant polygon clipping", CACM 17(1), 32-42.
    """
    n_out = 0
    for k in range(n):
        here, after = polygon[k], polygon[0 if k + 1 == n else k + 1]
        d_here, d_after = signed_distance(here, plane, screen, window), signed_distance(after, plane, screen, window)
        if d_here >= 0.0:
            for column in range(N_CORNER_COLUMN):
                out[n_out, column] = here[column]
            n_out += 1
        if d_here >= 0.0 and d_after < 0.0:
            intersect(here, after, d_here / (d_here - d_after), out[n_out])
            n_out += 1
        elif d_after >= 0.0 and d_here < 0.0:
            intersect(after, here, d_after / (d_after - d_here), out[n_out])
            n_out += 1
    return n_out


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
    for face in range(vertex_idx.shape[1]):
        gather_corners(positions, vertex_idx, face, screen, polygon)
        if min(polygon[0, W], polygon[1, W], polygon[2, W]) >= nearest or is_beyond(polygon, screen, window):
            continue
        n = 3
        for plane in range(N_CLIP_PLANE):
            n = clip_polygon(polygon, n, plane, screen, window, other)
            polygon, other = other, polygon
        for k in range(n):
            nearest = min(nearest, polygon[k, W])
    return nearest
