"""Clusters: runs of neighbouring triangles of a dense mesh, with what tells that none of a run's is seen.

In:  positions and index columns of the triangles.
Out: `Clusters`: for every CLUSTER triangles that follow one another a box, a cone of normals, and which vertices they
     use.

Files list triangles that are neighbours one after the other, as a rule, so a run of them is a small patch. The order of
faces, which decides at equal depth, stays as it is; where it isn't one of neighbours, boxes and cones are wide, and
nothing is gained. pipeline/clusters.py says what follows from them.

       ^ ^ ^   normals n of the triangles: each has n·axis >= cos
       |/_/    around the axis of the cone
     __/_/__
    /       \\  patch: each triangle's plane passes the center of the box at n·(p - center) >= offset
        x center
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import helper, index, kernel

CLUSTER = 64  # triangles; the last one may have fewer
VERTEX_BLOCK = 64  # vertices
LEAST_FACES = 8192  # below that many a scene is drawn without: there is little to skip
MOST_BLOCKS = 48  # blocks that a cluster uses on average where it pays to tell which vertices are needed

# Rows of what is known of clusters.
CENTER, HALF_SIZE, AXIS = 0, 3, 6  # x, y, z of each
COSINE, SINE, OFFSET, HEIGHT = 9, 10, 11, 12
N_SHAPE_ROW = 13

# Directions of normals err by less than this. Positions are what they are, so an edge errs by its length times 2^-53,
# each component, and the product of two edges by 2^-50 of their lengths' product; the normal's length is at least
# LEAST_ASPECT of that. Unit length and the products with the axis add a few 2^-53.
LEAST_ASPECT = 2.0**-20
DIRECTION_SLACK = 2.0**-29


class Clusters(NamedTuple):
    """The clusters of a scene: the triangles CLUSTER·k .. CLUSTER·(k + 1) are cluster k."""

    # (N_SHAPE_ROW, n) float64, world space, scene units: the box; the unit axis of the cone of geometric normals, the
    # cosine (at most) and sine (at least) of its half angle; the least n·(p - center) of the triangles' planes; the
    # least height of a triangle above its longest edge, 0 where the cone is of no use. The center is NaN where a corner
    # isn't finite.
    shapes: NDArray[np.float64]
    block_starts: NDArray[np.int64]  # (n + 1,) where in `blocks` those of each cluster begin
    blocks: NDArray[np.uint32]  # the blocks of VERTEX_BLOCK vertices that it uses; empty where it pays to use all
    n_face: int


class ClusterScratch(NamedTuple):
    """What is noted of the triangles of one cluster, and of the blocks of vertices that it uses."""

    rows: NDArray[np.float64]  # (N_ROW * CLUSTER,): corners, then normals and heights
    last_user: NDArray[np.int64]  # (n_block,) 1 + the last cluster that used the block; 0 at first


# All rows stand one behind the other in one flat array, `rows[X0 + k]`, so that the compiler sees that they don't
# overlap.
X0, Y0, Z0, X1, Y1, Z1, X2, Y2, Z2, NX, NY, NZ, HEIGHT_ROW = (index(CLUSTER * row) for row in range(13))
NEXT, N_ROW = index(CLUSTER), 13


def has_clusters(n_face: int) -> bool:
    """Tell whether a scene has so many triangles that clusters of them save time."""
    return n_face >= LEAST_FACES


def make_clusters(positions: NDArray[np.float64], vertex_idx: NDArray[np.uint32], workers) -> Clusters:
    """Divide the triangles of a scene into clusters.

    Parameters
    ----------
    positions : (3, n_vertex) float64, world space
    vertex_idx : (3, n_face) uint32
    workers : what maps parts to threads
    """
    n_face = vertex_idx.shape[1]
    n_cluster, n_block = -(-n_face // CLUSTER), -(-positions.shape[1] // VERTEX_BLOCK)
    shapes = np.empty((N_SHAPE_ROW, n_cluster))
    most = MOST_BLOCKS * CLUSTER  # of a cluster alone: three for each triangle at most

    def make(part):
        first, end = part[0] // CLUSTER, part[1] // CLUSTER
        scratch = ClusterScratch(np.zeros(N_ROW * CLUSTER), np.zeros(n_block, np.int64))
        counts, blocks = np.empty(end - first, np.int64), np.empty(MOST_BLOCKS * (end - first) + most, np.uint32)
        n = describe_clusters(first, end, positions, vertex_idx, scratch, shapes, counts, blocks)
        return counts, blocks[: max(n, 0)].copy(), n >= 0

    parts = workers.map(make, workers.ranges(n_cluster * CLUSTER))
    if not all(is_told for *_, is_told in parts):
        return Clusters(shapes, np.zeros(n_cluster + 1, np.int64), np.empty(0, np.uint32), n_face)
    starts = np.append(0, np.cumsum(np.concatenate([counts for counts, *_ in parts])))
    return Clusters(shapes, starts, np.concatenate([blocks for _, blocks, _ in parts]), n_face)


# ---------------------------------------------------------------- kernels


@kernel
def describe_clusters(first, end, positions, vertex_idx, scratch, out_shapes, out_counts, out_blocks):
    """Describe the clusters first..end; return how many blocks they use, or -1 if more than there is room for: then all
    are described, but what they use is not told.

    Parameters
    ----------
    positions : (3, n_vertex) float64 · vertex_idx : (3, n_face) uint32
    scratch : ClusterScratch
    out_shapes : (N_SHAPE_ROW, n_cluster) float64, of which first..end is written
    out_counts : (end - first,) int64, blocks that each cluster uses
    out_blocks : (n,) uint32, these blocks
    """
    n_face, n_block, has_room = index(vertex_idx.shape[1]), index(0), True
    for cluster in range(index(first), index(end)):
        start = cluster * index(CLUSTER)
        faces = vertex_idx[:, start : min(start + index(CLUSTER), n_face)]
        n = gather_corners(positions, faces, scratch.rows)
        shape = out_shapes[:, cluster]
        measure_box(n, scratch.rows, shape)
        measure_normals(n, scratch.rows)
        measure_cone(n, scratch.rows, shape)
        has_room &= n_block + index(3 * CLUSTER) <= index(len(out_blocks))
        if has_room:
            n_listed = list_blocks(cluster, faces, scratch.last_user, out_blocks, n_block)
            out_counts[cluster - index(first)] = np.int64(n_listed - n_block)
            n_block = n_listed
    return np.int64(n_block) if has_room else np.int64(-1)


@helper
def gather_corners(positions, faces, rows):
    """Write the corners of a cluster's triangles to the rows; return how many triangles there are, uint64."""
    n = index(faces.shape[1])
    for k in range(n):
        a, b, c = faces[0, k], faces[1, k], faces[2, k]
        for axis in range(index(3)):
            rows[X0 + axis * NEXT + k] = positions[axis, a]
            rows[X1 + axis * NEXT + k] = positions[axis, b]
            rows[X2 + axis * NEXT + k] = positions[axis, c]
    return n


@helper
def measure_box(n, rows, out):
    """Write the box round n triangles: its center, and half of its size, rounded up.

    A difference of two numbers is rounded by 2^-53 of it.
    """
    for axis in range(index(3)):
        low0 = low1 = low2 = np.inf
        high0 = high1 = high2 = -np.inf
        nothing = 0.0
        for k in range(n):  # three chains each: a chain waits for its last step
            a, b, c = rows[X0 + axis * NEXT + k], rows[X1 + axis * NEXT + k], rows[X2 + axis * NEXT + k]
            low0, low1, low2 = a if a < low0 else low0, b if b < low1 else low1, c if c < low2 else low2
            high0, high1, high2 = a if a > high0 else high0, b if b > high1 else high1, c if c > high2 else high2
            nothing += (a - a) + ((b - b) + (c - c))  # NaN where a corner isn't finite
        low, high = min(low0, low1, low2), max(high0, high1, high2)
        center = 0.5 * (low + high) + nothing
        out[index(CENTER) + axis] = center
        out[index(HALF_SIZE) + axis] = max(high - center, center - low) * (1.0 + 2.0**-50)


@helper
def measure_normals(n, rows):
    """Turn n triangles' rows NX, NY, NZ into their unit normals, and HEIGHT_ROW into their heights above the longest
    edge: the normal's length, twice the triangle's area, over the length of that edge.

    Both are 0 where a triangle is too thin for its normal to be known.
    """
    for k in range(n):
        ax, ay, az = rows[X1 + k] - rows[X0 + k], rows[Y1 + k] - rows[Y0 + k], rows[Z1 + k] - rows[Z0 + k]
        bx, by, bz = rows[X2 + k] - rows[X0 + k], rows[Y2 + k] - rows[Y0 + k], rows[Z2 + k] - rows[Z0 + k]
        cx, cy, cz = rows[X2 + k] - rows[X1 + k], rows[Y2 + k] - rows[Y1 + k], rows[Z2 + k] - rows[Z1 + k]
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        longest = max(ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz, cx * cx + cy * cy + cz * cz)
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        is_thick = length > LEAST_ASPECT * longest
        scale = 1.0 / length
        rows[NX + k], rows[NY + k] = nx * scale if is_thick else 0.0, ny * scale if is_thick else 0.0
        rows[NZ + k] = nz * scale if is_thick else 0.0
        rows[HEIGHT_ROW + k] = length / np.sqrt(longest) if is_thick else 0.0


@helper
def measure_cone(n, rows, out):
    """Write the cone of n triangles' normals, how far their planes lie beyond the center of the box, and the least
    height."""
    axis_x = axis_y = axis_z = 0.0
    least_height = np.inf
    for k in range(n):
        axis_x, axis_y, axis_z = axis_x + rows[NX + k], axis_y + rows[NY + k], axis_z + rows[NZ + k]
        least_height = min(least_height, rows[HEIGHT_ROW + k])
    length = np.sqrt(axis_x * axis_x + axis_y * axis_y + axis_z * axis_z)
    scale = 1.0 / length if length > 0.0 else 0.0
    axis_x, axis_y, axis_z = axis_x * scale, axis_y * scale, axis_z * scale
    x, y, z = out[CENTER], out[CENTER + 1], out[CENTER + 2]
    cosine, offset = 1.0, np.inf
    for k in range(n):
        nx, ny, nz = rows[NX + k], rows[NY + k], rows[NZ + k]
        cosine = min(cosine, nx * axis_x + ny * axis_y + nz * axis_z)
        offset = min(offset, nx * (rows[X0 + k] - x) + ny * (rows[Y0 + k] - y) + nz * (rows[Z0 + k] - z))
    cosine -= DIRECTION_SLACK
    width, height, depth = out[HALF_SIZE], out[HALF_SIZE + 1], out[HALF_SIZE + 2]
    out[AXIS], out[AXIS + 1], out[AXIS + 2] = axis_x, axis_y, axis_z
    out[COSINE], out[SINE] = cosine, np.sqrt(max(1.0 - cosine * cosine, 0.0)) * (1.0 + 2.0**-20)
    out[OFFSET] = offset - DIRECTION_SLACK * np.sqrt(width * width + height * height + depth * depth)
    out[HEIGHT] = least_height * (1.0 - DIRECTION_SLACK)


@helper
def list_blocks(cluster, faces, last_user, out, n_out):
    """Append the blocks of vertices that a cluster uses, each once, in no order; return how many are listed then."""
    stamp = np.int64(cluster) + 1
    for corner in range(3):
        for k in range(index(faces.shape[1])):
            block = faces[corner, k] // np.uint32(VERTEX_BLOCK)
            out[n_out] = block
            n_out += index(last_user[block] != stamp)
            last_user[block] = stamp
    return n_out
