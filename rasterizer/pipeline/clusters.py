"""Before the transform stage: which clusters of triangles can be seen at all, and which vertices they need.

In:  `Clusters` of the scene (geometry/clusters.py), and the screen of a view.
Out: `SeenClusters`: the clusters whose triangles go the way through the stages.

A cluster is skipped where nothing of it can cover a sample:

    before the near plane, beyond the far one    all of its box
    beside the picture                           all of its box beyond one of the four borders
    facing away                                  all of its triangles, if backs are culled

No sample is lost by that: the sides that the stages behind would find are certain in spite of their rounding.

*What they round.* The transform stage finds a vertex r = p - eye, |r| <= D, at depth w with an error of a few 2^-53·D,
and s px across for 1 at depth 1. So x is off by 256·s·2^-49·(D/w)² sub-pixels at most, with D/w = D without
perspective: less than 1/4 where s·(D/w)² <= 2^36 (FINEST; 256·2^36·2^-49 = 1/32), which is asked for. It then rounds to
whole sub-pixels. So a vertex is off by less than SNAP = 1/2 + 1/4 of them along either axis. What is computed here of
boxes is off by a few 2^-53·D, too: SLACK·D is allowed for.

*Beside the picture.* Samples lie half a px, 128 sub-pixels, inside of the borders. What lies beyond a border covers
none. That is asked for in space, where the border is a plane through the eye (without perspective: parallel to the
axis), so it holds for clipped parts as well. Only clusters that no plane clips are skipped, so that those counted as
clipped stay the same.

*Facing away.* A triangle with corners r_i at depths w_i, geometric normal n of unit length, longest edge L, height h
above it, has twice the signed area

    A = S·L·h·(n·r_0)/(w_0·w_1·w_2)         S = 256²·scale_x·scale_y sub-pixels², clockwise > 0

on the screen: the determinant of the r_i is that of its edges with r_0, L·h·n·r_0, and each 1/w_i is a factor of a row.
Vertices that move by e <= SNAP along either axis change it by no more than

    2 e (W + H) + 4 e²                      W, H: width and height of its box on the screen

since A is a sum of x_i·(y_j - y_k), the |y_j - y_k| add up to 2 H, the |x_j - x_k| to 2 W, and what is left is twice
the area of a triangle with sides of 2 e at most. And W <= 256·scale_x·L·D/w², because x_i/w_i - x_j/w_j is a component
of r_i × r_j = (r_i - r_j) × r_j over w_i·w_j. So with g = 256·h/w_max, the height in px were the scale 1, a triangle
stays clockwise, and is culled, where

    scale_x·scale_y·g²·m >= 2 e (scale_x + scale_y)·g·(D/w_min)·(w_max/w_min) + 4 e²        m = (n·r_0)/w_max

if both sides are multiplied by h/L <= 1 (L >= h) and w_min, w_max are the least and largest depth of the cluster. The
left side less the right one's first term grows with h: it is asked for with the least h. Without perspective w = D = 1
and n·r_0 is n·forward.

*The least n·r_0*, with the cone of the normals about the unit axis a, half angle t, box center c, v = c - eye:
n·r_0 = n·v + n·(p_0 - c) >= (a·v) cos t - |v - (a·v) a| sin t + offset, where a·v > 0 and t < 90 degrees.

*With skew* x is measured along `across`, which is up to t = `skew_stretch` long, in the place of the camera's right. So
an error along x, and the box's width W, may be t times what they are without it: t·scale_x stands for scale_x in what
is computed of them. The area is what it is without skew: a shear has the determinant 1.

Source: the cone test as in Shirman & Abi-Ezzi 1993, "The cone of normals technique for fast processing of curved
patches", Computer Graphics Forum 12(3), 261-272; the slack is derived here.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.kernels import helper, index, kernel
from ..geometry.clusters import (
    AXIS,
    CENTER,
    CLUSTER,
    COSINE,
    HALF_SIZE,
    HEIGHT,
    OFFSET,
    SINE,
    VERTEX_BLOCK,
    Clusters,
)  # fmt: skip
from ..geometry.vectors import cross, dot, scale, subtract
from .transform import LIMIT_PX, SUBPIXEL, Screen, project, skew_stretch

SNAP = 0.75  # sub-pixels
FINEST = 2.0**36
SLACK = 2.0**-45  # of the distance from the eye: what depths and positions across are computed with
# Vertices that stand between two runs of needed ones are transformed with them, if they are no more than this:
# beginning a run takes as long.
SHORTEST_GAP = 1024 // VERTEX_BLOCK  # blocks

# How many vertices are looked at to tell whether a view leaves out a good part of the scene, and how much that is.
N_TESTED, LEAST_OUTSIDE = 1024, 1 / 16

SEEN, SKIPPED, FACING_AWAY, CLIPPED_AWAY = range(4)  # what becomes of a cluster


class SeenClusters(NamedTuple):
    """The clusters whose triangles are looked at, and how many triangles of the others would have been counted."""

    clusters: np.ndarray  # (n,) uint32, ascending
    n_face: int  # of all clusters
    n_culled: int  # in skipped clusters: triangles that face away
    n_clipped: int  # in skipped clusters: triangles that lie wholly before the near plane, or beyond the far one
    vertex_runs: list | None  # (start, end) of the vertices that are needed, ascending; None for all

    @property
    def faces(self) -> np.ndarray:
        """The triangles that are looked at, (n,) uint32, ascending."""
        faces = (self.clusters[:, None] * np.uint32(CLUSTER) + np.arange(CLUSTER, dtype=np.uint32)).ravel()
        return faces[faces < self.n_face]


class ClusterView(NamedTuple):
    """What clusters are looked at with."""

    screen: Screen
    width: float  # of the picture, samples
    height: float
    is_culled: bool  # triangles that are seen clockwise are dropped
    steep_x: float  # px: as `scale_x` of the screen, what a step in space changes x by at most, at depth 1


def find_seen(clusters: Clusters, n_vertex, screen, size, cull_back) -> SeenClusters:
    """Find the clusters that may be seen, and the vertices that their triangles need.

    Parameters
    ----------
    n_vertex : of the scene
    screen : Screen
    size : (width, height) of the picture in samples
    cull_back : bool, triangles that are seen clockwise are dropped
    """
    n = clusters.shapes.shape[1]
    fates, is_needed = np.empty(n, np.uint8), np.zeros(-(-n_vertex // VERTEX_BLOCK), np.uint8)
    # The views of cameras are never mirrored; of one that were, the signs of areas would be others.
    right, up, forward = screen.right.tolist(), screen.up.tolist(), screen.forward.tolist()
    is_mirrored = dot(cross(right, up), forward) >= 0.0 or min(screen.scale_x, screen.scale_y) <= 0
    view = make_view(screen, size, cull_back and not is_mirrored)
    decide_clusters(clusters.shapes, view, fates)
    seen = np.flatnonzero(fates == SEEN).astype(np.uint32)
    runs = None
    if len(clusters.blocks):
        mark_blocks(seen, clusters.block_starts, clusters.blocks, is_needed)
        runs = list_runs(is_needed, n_vertex)
    n_culled, n_clipped = (count_faces(clusters, fates == fate) for fate in (FACING_AWAY, CLIPPED_AWAY))
    return SeenClusters(seen, clusters.n_face, n_culled, n_clipped, runs)


def make_view(screen, size, is_culled) -> ClusterView:
    """Gather what clusters are looked at with; `size` is (width, height) of the picture in samples."""
    steep_x = screen.scale_x * skew_stretch(screen)
    return ClusterView(screen, float(size[0]), float(size[1]), bool(is_culled), float(steep_x))


def leaves_out(positions, screen, size) -> bool:
    """Tell whether a view leaves out so many vertices that clusters save time, by a look at N_TESTED of them.

    Parameters
    ----------
    positions : (3, n) float64, world space
    screen, size : as `find_seen` takes them
    """
    step = max(1, positions.shape[1] // N_TESTED)
    across, upward, depth = np.stack([screen.across, screen.up, screen.forward]) @ (
        positions[:, ::step] - screen.eye[:, None]
    )
    with np.errstate(all="ignore"):  # what isn't finite, or at the camera's depth, isn't in the picture
        x, y = project(across, upward, depth if screen.is_perspective else 1.0, screen)
    is_inside = (depth > screen.near) & (depth < screen.far)
    is_inside &= (x >= 0.0) & (y >= 0.0) & (x <= size[0] * SUBPIXEL) & (y <= size[1] * SUBPIXEL)
    return bool(is_inside.mean() < 1.0 - LEAST_OUTSIDE)


def count_faces(clusters: Clusters, is_counted) -> int:
    """Count the triangles of some clusters; the last cluster may have fewer than the others."""
    n, n_missing = int(np.count_nonzero(is_counted)), len(is_counted) * CLUSTER - clusters.n_face
    return n * CLUSTER - (n_missing if is_counted[-1] else 0)


def list_runs(is_needed, n_vertex) -> list[tuple[int, int]]:
    """List the runs of vertices, (start, end), whose blocks are needed; short gaps are closed.

    Parameters
    ----------
    is_needed : (n_block,) uint8
    """
    edges = np.flatnonzero(
        np.diff(is_needed, prepend=0, append=0)
    )  # starts and ends in turn; uint8 wraps, but not to 0
    starts, ends = edges[::2], edges[1::2]
    is_gap = starts[1:] - ends[:-1] > SHORTEST_GAP
    starts, ends = starts[np.append(True, is_gap)[: len(starts)]], ends[np.append(is_gap, True)[: len(ends)]]
    ends = np.minimum(ends * VERTEX_BLOCK, n_vertex)
    return list(zip((starts * VERTEX_BLOCK).tolist(), ends.tolist(), strict=True))


# ---------------------------------------------------------------- kernels


@kernel
def decide_clusters(shapes, view, out_fates):
    """Decide of every cluster whether it is SEEN, or why it isn't.

    Whatever isn't a number makes a comparison false, and the cluster SEEN.

    Parameters
    ----------
    shapes : (N_SHAPE_ROW, n) float64, of Clusters
    out_fates : (n,) uint8
    """
    screen = view.screen
    eye = (screen.eye[0], screen.eye[1], screen.eye[2])
    axis = (screen.across[0], screen.across[1], screen.across[2])
    up = (screen.up[0], screen.up[1], screen.up[2])
    forward = (screen.forward[0], screen.forward[1], screen.forward[2])
    # Of a plane beside the view n·r + d·w is the distance in px times the depth, outwards; w is 1 without perspective.
    center_x, center_y = screen.center_x, screen.center_y
    across, upward = scale(axis, screen.scale_x), scale(up, screen.scale_y)
    for k in range(index(shapes.shape[1])):
        box = (
            subtract((shapes[CENTER, k], shapes[CENTER + 1, k], shapes[CENTER + 2, k]), eye),
            (shapes[HALF_SIZE, k], shapes[HALF_SIZE + 1, k], shapes[HALF_SIZE + 2, k]),
        )
        reach = np.sqrt(dot(box[0], box[0])) + np.sqrt(dot(box[1], box[1]))
        slack = SLACK * reach
        least_w, largest_w = range_along(box, forward, slack)
        is_before = largest_w < screen.near
        is_behind = least_w > screen.far
        is_placed = (least_w >= screen.near) & (largest_w <= screen.far) & is_exact(least_w, reach, view)
        beside = is_beside(box, across, -center_x, view.width - center_x, forward, slack, screen)
        beside |= is_beside(box, upward, center_y - view.height, center_y, forward, slack, screen)
        is_away = view.is_culled & faces_away(k, shapes, box, (least_w, largest_w), reach, view)
        fate = SKIPPED if is_placed & beside else SEEN
        fate = FACING_AWAY if is_placed & is_away else fate
        out_fates[k] = CLIPPED_AWAY if is_before | is_behind else fate


@helper
def range_along(box, normal, slack):
    """Compute the least and the largest normal·r of a box (center, half size), less and more some slack."""
    center, half = box
    middle = dot(normal, center)
    reach = abs(normal[0]) * half[0] + abs(normal[1]) * half[1] + abs(normal[2]) * half[2] + slack
    return middle - reach, middle + reach


@helper
def is_exact(least_w, reach, view):
    """Tell whether all of a box has a position on the screen, which is found within SNAP; see above."""
    screen = view.screen
    ratio = reach / least_w if screen.is_perspective else reach
    most_scale = max(view.steep_x, screen.scale_y)
    out = most_scale * ratio + max(abs(screen.center_x), abs(screen.center_y))
    finest = most_scale * ratio * (ratio if screen.is_perspective else 1.0)
    return (out < LIMIT_PX - 1.0) & (finest <= FINEST)


@helper
def is_beside(box, across, low, high, forward, slack, screen):
    """Tell whether across·r < low·w in all of a box, or across·r > high·w; w is 1 without perspective.

    Parameters
    ----------
    box : (center, half size) of r, scene units
    across : an axis of the screen times its scale · low, high : px
    slack : of lengths, scene units
    """
    w = 1.0 if screen.is_perspective else 0.0
    scale_of_across = abs(across[0]) + abs(across[1]) + abs(across[2])
    margin = slack * (scale_of_across + abs(low) + abs(high))
    _, largest = range_along(box, subtract(across, scale(forward, low * w)), margin)
    least, _ = range_along(box, subtract(across, scale(forward, high * w)), margin)
    return (largest < low * (1.0 - w)) | (least > high * (1.0 - w))


@helper
def faces_away(k, shapes, box, depths, reach, view):
    """Tell whether all triangles of cluster k are certain to be clockwise on the screen; see above.

    Parameters
    ----------
    box : (center, half size) relative to the eye · depths : the least and the largest in it · reach : its furthest
        distance from the eye; scene units
    """
    screen = view.screen
    least_w, largest_w = depths if screen.is_perspective else (1.0, 1.0)
    forward = (screen.forward[0], screen.forward[1], screen.forward[2])
    axis = (shapes[AXIS, k], shapes[AXIS + 1, k], shapes[AXIS + 2, k])
    along = box[0] if screen.is_perspective else forward
    distance = reach if screen.is_perspective else 1.0
    share = dot(axis, along)
    rest = subtract(along, scale(axis, share))
    offset = shapes[OFFSET, k] if screen.is_perspective else 0.0
    least = share * shapes[COSINE, k] - np.sqrt(dot(rest, rest)) * shapes[SINE, k] + offset - SLACK * distance
    height = SUBPIXEL * shapes[HEIGHT, k] / largest_w
    area = screen.scale_x * screen.scale_y * height * height * (least / largest_w) * (1.0 - SLACK)
    moved = 2.0 * SNAP * (view.steep_x + screen.scale_y) * height * (distance / least_w) * (largest_w / least_w)
    return (shapes[COSINE, k] > 0.0) & (share > 0.0) & (area >= moved + 4.0 * SNAP * SNAP)


@kernel
def mark_blocks(clusters, block_starts, blocks, out_is_needed):
    """Mark the blocks of vertices that some clusters use.

    Parameters
    ----------
    clusters : (n,) uint32
    block_starts, blocks : of Clusters
    out_is_needed : (n_block,) uint8, zero
    """
    for cluster in clusters:
        for k in range(index(block_starts[cluster]), index(block_starts[cluster + np.uint32(1)])):
            out_is_needed[blocks[k]] = 1
