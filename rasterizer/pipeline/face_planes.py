"""The planes of clipped faces: how the weights of a whole face's vertices, and its depth, change over the screen.

In:  positions, and the faces that the clip stage has to clip.
Out: a row of planes for each face, from which every part of it is interpolated.

The weights q_i of the face's own three vertices are affine on the screen: with the vertices P_i in eye space and the
ray r(x, y) = ((x - center_x)/scale_x, (center_y - y)/scale_y, 1) of a sample, q = M^-1 r, where P_0, P_1, P_2 are the
columns of M. Then r·w = Σ b_i P_i with b_i = w q_i, and 1/w = Σ q_i (Olano & Greer 1997, "Triangle scan conversion
using 2D homogeneous coordinates"). Without perspective P_i = (across, upward, 1), and q_i = b_i.

Where all three vertices have a place on the screen, near and far planes apart, they count where they are rounded to:
the planes are those of the face that isn't clipped. Else one is behind the eye, or too far out to be rounded, and all
count where they are.
"""

import numpy as np

from .transform import LIMIT, SUBPIXEL, project, skew_stretch

# Columns of the planes: q_i at the picture's corner (0, 0), and what 1/256 px to the right, and down, adds to them; the
# range that their sum has where the face is seen, 1 without perspective; depths of the vertices, scene units.
WEIGHT, WEIGHT_X, WEIGHT_Y, LEAST_SUM, LARGEST_SUM, FACE_DEPTH = 0, 3, 6, 9, 10, 11
N_COLUMN = 14
NO_PLANES = np.empty((0, N_COLUMN))


def compute_face_planes(positions, vertex_idx, screen):
    """Compute the planes of the weights q_i of whole faces, and of their depths.

    A face that is seen edge-on has the same weights everywhere, and so the same depth, which isn't known here.

    Parameters
    ----------
    positions : (3, n) float64, world space, scene units
    vertex_idx : (3, n_clipped) uint32

    Returns
    -------
    planes : (n_clipped, N_COLUMN) float64; LEAST_SUM and LARGEST_SUM are 1
    z_planes : (n_clipped, 3) float64, z-buffer units at the picture's corner, and what 1/256 px to the right, and down,
        adds; NaN for faces that are seen edge-on
    """
    relative = positions[:, vertex_idx] - screen.eye[:, None, None]
    across, upward, depth = (
        np.einsum("a,akn->nk", axis, relative) for axis in (screen.across, screen.up, screen.forward)
    )
    w = depth if screen.is_perspective else np.ones_like(depth)
    across, upward = snap_across_view(across, upward, w, screen)
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


def snap_across_view(across, upward, w, screen):
    """Move the vertices of faces across the view to where the screen shows them rounded; depths stay.

    Faces with a vertex that has no place on the screen are left as they are.

    Parameters
    ----------
    across, upward, w : (n_clipped, 3) float64, scene units; w is 1 without perspective
    """
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        x, y = project(across, upward, w, screen)
        is_placed = ((w > 0.0) & (np.abs(x) <= LIMIT) & (np.abs(y) <= LIMIT)).all(axis=1, keepdims=True)
        x, y = np.rint(x) / SUBPIXEL, np.rint(y) / SUBPIXEL
        across = np.where(is_placed, w * (x - screen.center_x) / screen.scale_x, across)
        upward = np.where(is_placed, w * (screen.center_y - y) / screen.scale_y, upward)
    return across, upward


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
