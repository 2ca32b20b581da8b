"""Stage 1, transform: vertices from world space to the screen.

In:  positions, world space, float64 rows.
Out: `Vertices`: x and y int32 in 1/256 px, and as they were before they were rounded; and z float64, depth in units of
     the z-buffer. It is affine in screen space, so that a plane interpolates it: z = a + b/w in perspective, with w
     the distance along the viewing axis, else z = a + b·depth. A vertex that has no place on the screen (nearer than
     the near plane, beyond the far plane, further than 2^20 px from the picture, not finite) has x = OUTSIDE; its
     triangles go to the clip stage.

Skew is a shear of the view, and that is all it is: where points are measured along `across` instead of `right`, they
are seen as without skew. So the stages that only project and clip know nothing of it.

Float64 throughout: float32 would move one to four vertices in a hundred to another place of the grid.

What the rounding to 1/256 px does to all that is interpolated: a vertex v_i of the polygon becomes s_i, no further than
1/512 px from it along either axis. With the weights b_i >= 0, Σ b_i = 1, of a sample p = Σ b_i s_i, what is seen there
is what the polygon itself shows at p' = Σ b_i v_i, but for the depth: a value is a function of the b_i and of what the
vertices have. And |p' - p| <= Σ b_i |v_i - s_i| <= 1/512 px along either axis (POSITION_BOUND). So every colour, normal
and texture coordinate is that of a point of the polygon that lies no further than this from the sample; how much that
is in a colour depends on how fast the colour changes there.

Depth is that of the polygon's plane at p: it is interpolated between those that the plane has at the s_i
(`depths_on_plane`). A polygon that lies behind another one, in a plane that is parallel to its, would else lie before
it at some samples, because the points p' of both differ.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from ..compiler.kernels import helper, kernel
from ..cores import MIN_PART

SUBPIXEL = 256  # vertices are snapped to 1/256 px
HALF = SUBPIXEL // 2  # a pixel's sample is half a pixel from its corner
POSITION_BOUND = 0.5 / SUBPIXEL  # px, along either axis
LIMIT_PX = 2**20  # vertices further out than this are clipped: edge functions stay below 2^60
LIMIT = float(LIMIT_PX * SUBPIXEL)  # the same, 1/256 px
OUTSIDE = np.int32(-(2**31))  # x of a vertex that must be clipped
DEPTH_BITS = 38
DEPTH_MARGIN = 2.0**32  # room at both ends of the depth range, for what lies beside its polygon; see setup.py
DEPTH_SPAN = 2.0**DEPTH_BITS - 2 * DEPTH_MARGIN
MIN_VERTICES = 2 * MIN_PART  # vertices that are worth a thread of its own: one takes half of what a light takes


class Screen(NamedTuple):
    """How world space maps to the screen and to the z-buffer."""

    eye: np.ndarray  # (3,) float64, world space
    right: np.ndarray  # (3,) float64 each: the axes of view space, world space, unit length
    up: np.ndarray
    forward: np.ndarray
    across: np.ndarray  # (3,) float64: what x is measured along, right - skew/scale_x · up; no unit vector with skew
    scale_x: float  # px
    scale_y: float
    center_x: float
    center_y: float
    skew: float  # px, 0 without perspective; see `Projection`
    near: float  # clip distance, scene units
    far: float  # clip distance: infinite where the caller gave none
    z_offset: float  # z = z_offset + z_scale / w  (perspective)  or  z_offset + z_scale * depth
    z_scale: float
    is_perspective: bool


class PixelWidth(NamedTuple):
    """How wide a pixel is where it shows what lies at z: offset + scale·z, units of the z-buffer."""

    offset: float
    scale: float
    horizon: float  # z of what is infinitely far away


class Vertices(NamedTuple):
    """Vertices on the screen."""

    x: np.ndarray  # (n,) int32, 1/256 px, or OUTSIDE
    y: np.ndarray  # (n,) int32, 1/256 px
    z: np.ndarray  # (n,) float64, z-buffer units
    true_x: np.ndarray  # (n,) float64, 1/256 px: x and y before they were rounded
    true_y: np.ndarray  # (n,) float64
    pixel: PixelWidth


class Triangles(NamedTuple):
    """Index columns: which vertices triangles join, and where the attributes of their corners are.

    The indices are unsigned: signed ones would cost a wrap-around test at every access.
    """

    vertex_idx: np.ndarray  # (3, n) uint32, into the vertices
    corner_idx: np.ndarray  # (3, n) uint32, into the attributes
    is_inverted: np.ndarray  # (n,) uint8: 1 where the shading normals look against the winding
    material: np.ndarray = np.empty(0, np.uint32)  # (n,) uint32; empty where all have one


class Drawables(NamedTuple):
    """The triangles of a picture with all that they refer to."""

    triangles: Triangles
    vertices: Vertices
    attributes: np.ndarray  # (side, n, n_attribute) float64
    cut_outs: Any = None  # CutOuts, see cut_outs.py; None where all samples of the triangles are there


def make_screen(view, projection, depth_range, near_clip, far_clip) -> Screen:
    """Fit the z-buffer to the depths that are seen.

    What is nearer than these but beyond `near_clip` lies outside the picture: it needs a depth for the planes of the
    triangles that reach there, but no room in the z-buffer.

    Parameters
    ----------
    view : View, the camera's place and axes, world space
    projection : Projection, in px
    depth_range : (nearest, furthest) distance along the viewing axis that is seen, scene units
    near_clip, far_clip : distances of the clip planes, scene units; `far_clip` may be infinite
    """
    near, far = depth_range
    if projection.is_perspective:
        spread = 1.0 / near - 1.0 / far
        scale = -DEPTH_SPAN / spread if spread > 0 else 0.0
        offset = DEPTH_MARGIN - scale / near if spread > 0 else DEPTH_MARGIN
    else:
        spread = far - near
        scale = DEPTH_SPAN / spread if spread > 0 else 0.0
        offset = DEPTH_MARGIN - scale * near
    skew, across = projection.skew, view.right
    if skew != 0.0:
        across = view.right - (skew / projection.scale_x) * view.up
    return Screen(
        view.eye, view.right, view.up, view.forward, across,
        projection.scale_x, projection.scale_y, projection.center_x, projection.center_y, skew,
        near_clip, far_clip, offset, scale, projection.is_perspective,
    )  # fmt: skip


def transform(positions, screen: Screen, workers) -> tuple[Vertices, int]:
    """Project every vertex to the screen; also return how many are OUTSIDE, and must be clipped.

    Parameters
    ----------
    positions : (n, 3) float64, world space, scene units
    """
    n = len(positions)
    x, y = np.empty(n, np.int32), np.empty(n, np.int32)
    out = Vertices(x, y, np.empty(n), np.empty(n), np.empty(n), pixel_width(screen))
    flat, parts = positions.reshape(-1), workers.ranges(n, MIN_VERTICES)
    counts = workers.map(lambda part: transform_range(flat, *part, screen, out), parts)
    return out, sum(counts)


def pixel_width(screen) -> PixelWidth:
    """Return how wide a pixel is.

    Without perspective that is z_scale times its width in scene units. With it w/scale_x is how wide it is at w, and
    |dz/dw| = |z_scale|/w²: the product is |z_scale|/w over scale_x.
    """
    per_px = max(screen.scale_x, screen.scale_y)
    if screen.is_perspective:
        return PixelWidth(screen.z_offset / per_px, -1.0 / per_px, screen.z_offset)
    return PixelWidth(screen.z_scale / per_px, 0.0, math.inf)


@kernel
def transform_range(positions, start, end, screen, out):
    """Project vertices start..end to the screen; return how many are OUTSIDE.

    Parameters
    ----------
    positions : (3 n,) float64, world space, scene units. The compiler doesn't know how far it is from row to row of
        other arrays, and would make no vector instructions
    screen : Screen
    out : Vertices, of which start..end is written
    """
    eye_x, eye_y, eye_z = screen.eye[0], screen.eye[1], screen.eye[2]
    across_x, across_y, across_z = screen.across[0], screen.across[1], screen.across[2]
    up_x, up_y, up_z = screen.up[0], screen.up[1], screen.up[2]
    forward_x, forward_y, forward_z = screen.forward[0], screen.forward[1], screen.forward[2]
    here = positions[3 * start : 3 * end]
    out_x, out_y, out_z = out.x[start:end], out.y[start:end], out.z[start:end]
    out_true_x, out_true_y = out.true_x[start:end], out.true_y[start:end]
    n_outside = 0
    for k in range(end - start):
        row = 3 * k
        rx, ry, rz = here[row] - eye_x, here[row + 1] - eye_y, here[row + 2] - eye_z
        depth = rx * forward_x + ry * forward_y + rz * forward_z
        w = depth if screen.is_perspective else 1.0
        across = rx * across_x + ry * across_y + rz * across_z
        upward = rx * up_x + ry * up_y + rz * up_z
        x, y = project(across, upward, w, screen)
        is_inside = (depth >= screen.near) & (depth <= screen.far) & (abs(x) <= LIMIT) & (abs(y) <= LIMIT)
        n_outside += not is_inside
        out_x[k] = np.int32(np.rint(x)) if is_inside else OUTSIDE
        out_y[k] = np.int32(np.rint(y)) if is_inside else np.int32(0)
        out_true_x[k], out_true_y[k] = x, y
        out_z[k] = compute_z(depth, screen)
    return n_outside


@helper
def project(across, upward, w, screen):
    """Project view space to the screen: (x, y) in 1/256 px, not rounded; numbers in kernels, or float64 arrays.

    Parameters
    ----------
    across, upward : along the screen's `across` and the camera's up, scene units
    w : distance along the viewing axis, scene units; 1 without perspective
    """
    x = (screen.center_x + screen.scale_x * across / w) * SUBPIXEL
    y = (screen.center_y - screen.scale_y * upward / w) * SUBPIXEL
    return x, y


@helper
def compute_z(depth, screen):
    """Turn distances along the viewing axis, scene units, into units of the z-buffer; numbers or float64 arrays."""
    return screen.z_offset + screen.z_scale * (1.0 / depth if screen.is_perspective else depth)


@helper
def depths_on_plane(true_x, true_y, x, y, z, pixel):
    """Return the z of a triangle's plane where its vertices are rounded to, three numbers, and how far these are from
    the z of the vertices at most. Of one that is seen nearly edge-on they are the z of the vertices.

    With the edges e1, e2 and the rises r1, r2 of z along them, the slopes g = dz/d(x, y) of the plane solve e1·g = r1,
    e2·g = r2. A vertex was moved by half a 256th of a pixel along either axis at most. Where z could change by more
    than a pixel is wide at the nearest vertex, a triangle is seen edge-on: it leans by 512 to 1 and more. So is one
    with a vertex so near to the horizon of its plane that it could get half way there.

    Parameters
    ----------
    true_x, true_y : three float64 each, 1/256 px
    x, y : the same, rounded
    z : three float64, z-buffer units
    pixel : PixelWidth
    """
    x1, y1, x2, y2 = true_x[1] - true_x[0], true_y[1] - true_y[0], true_x[2] - true_x[0], true_y[2] - true_y[0]
    rise1, rise2 = z[1] - z[0], z[2] - z[0]
    inverse = 1.0 / (x1 * y2 - x2 * y1)
    slope_x, slope_y = (rise1 * y2 - rise2 * y1) * inverse, (rise2 * x1 - rise1 * x2) * inverse
    width, way = pixel.offset + pixel.scale * min(z[0], z[1], z[2]), pixel.horizon - max(z[0], z[1], z[2])
    shift = 0.5 * (abs(slope_x) + abs(slope_y))
    is_edge_on = not shift <= min(width, 0.5 * way)  # also where they are no numbers
    slope_x, slope_y = 0.0 if is_edge_on else slope_x, 0.0 if is_edge_on else slope_y
    z0 = z[0] - slope_x * (true_x[0] - x[0]) - slope_y * (true_y[0] - y[0])
    z1 = z[1] - slope_x * (true_x[1] - x[1]) - slope_y * (true_y[1] - y[1])
    z2 = z[2] - slope_x * (true_x[2] - x[2]) - slope_y * (true_y[2] - y[2])
    return (z0, z1, z2), 0.0 if is_edge_on else shift
