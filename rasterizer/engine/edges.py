"""Edges over a picture: wireframe, creases and silhouettes, drawn on the faces that are seen.

    edges of polygons ─ chosen for the view ─ to the screen ─ shares of samples (pipeline/edges.py) ─ over the picture

In:  meshes, a view and its depths, and the picture as it is. Out: the picture, with edges over it.

The edges' colour is opaque, and laid over the picture's linear colours by the share of each pixel that edges cover.
Bytes that are touched are decoded, mixed and encoded again, so that exposure and range leave that colour what it is.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..geometry.edges import Edges, gather_edges
from ..options import Options
from ..pipeline.edges import draw_edges, place_lines
from ..pipeline.transform import Screen
from ..scene.color import LINEAR_OF_BYTE, linear_rgb, srgb_from_linear
from ..scene.mesh import DEFAULT_CREASE_ANGLE, Mesh
from .points import number_polygons

MIN_ROWS = 64  # of samples, that are worth a thread of their own


def join_edges(meshes: Sequence[Mesh]) -> Edges:
    """Return the edges of all meshes; their creases are where shading is split, by the mesh's own rule.

    Where normals are given, these say nothing of edges: the mesh's angle counts, else the default one.
    """
    parts = []
    for mesh in meshes:
        angle, smoothing = mesh.creases if mesh.normals is None else (mesh.crease_angle, None)
        angle = DEFAULT_CREASE_ANGLE if angle is None else angle
        parts.append(gather_edges(mesh.vertices, mesh.faces, number_polygons(mesh), angle, smoothing))
    n_before = np.cumsum([0] + [len(part.normals) for part in parts])
    parts = [part._replace(first=part.first + n) for part, n in zip(parts, n_before, strict=False)]
    return Edges(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def cover(edges: Edges, options: Options, depth: NDArray, screen: Screen, threads) -> tuple[NDArray, NDArray]:
    """Return which share of each pixel the edges that the options ask for cover, and which share of it shows anything,
    (height, width) each; `depth` is that of each sample, (h, w) float32."""
    share, width = np.zeros(depth.shape, np.float32), options.edge_width * options.factor
    ends, sides = choose(edges, options.edges, screen, options.cull == "back")
    segments, is_left = project(ends, screen)
    lines = place_lines(segments, sides[is_left], width)

    def draw(rows: tuple[int, int]) -> None:
        draw_edges(segments, lines, min(width, 1.0), screen.is_perspective, rows, depth, share)

    threads.map(draw, threads.ranges(len(depth), MIN_ROWS))
    return average(share, options.factor), average(depth < np.inf, options.factor)


def choose(edges: Edges, names: tuple[str, ...], screen: Screen, is_culled: bool) -> tuple[NDArray, NDArray]:
    """Choose the edges that are drawn.

    Returns
    -------
    ends : (n, 2, 3) float64, world space
    sides : (n,) float64, -1 where their polygons lie to the left of the edge as it is seen, 1 to the right, 0 to both
    """
    n_side = np.diff(np.append(edges.first, len(edges.normals)))
    away = np.repeat(edges.ends[:, 0] - screen.eye, n_side, axis=0) if screen.is_perspective else screen.forward
    across = (edges.normals * away).sum(axis=1)
    is_front = across < 0.0
    is_shown = is_front if is_culled else across != 0.0
    # A polygon that looks to the viewer is wound counter-clockwise: it lies to the left of its sides.
    is_left = is_shown & (is_front == edges.is_along)
    n_left, n_shown = (np.add.reduceat(column, edges.first, dtype=np.int64) for column in (is_left, is_shown))
    is_outline = (n_left == 0) | (n_left == n_shown)
    chosen = np.full(len(edges.first), "wire" in names)
    if "crease" in names:
        chosen |= edges.is_crease
    if "silhouette" in names:
        chosen |= edges.is_open | is_outline
    chosen &= n_shown > 0
    sides = np.where(is_outline, np.where(n_left > 0, -1.0, 1.0), 0.0)
    return edges.ends[chosen], sides[chosen]


def project(ends: NDArray, screen: Screen) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Bring edges to the screen, and cut off what lies beyond the depths that are drawn.

    Parameters
    ----------
    ends : (n, 2, 3), world space

    Returns
    -------
    segments : (m, 6) float64: x, y and nearness of both ends, see `draw_edges`
    is_left : (n,) bool, of which edges something is left
    """
    # In the camera's frame: along the screen's `across`, up, and depth.
    axes, eye = np.stack([screen.across, screen.up, screen.forward]), np.asarray(screen.eye)
    points = (axes @ (ends.reshape(-1, 3).T - eye[:, None])).T.reshape(-1, 2, 3)
    for sign, limit in ((1.0, screen.near), (-1.0, screen.far)):
        if np.isfinite(limit):
            points = cut(points, sign, limit)
    is_left = np.isfinite(points).all(axis=(1, 2))
    across, up, depth = points[is_left].reshape(-1, 3).T
    w = depth if screen.is_perspective else np.ones(len(depth))
    x, y = screen.center_x + screen.scale_x * across / w, screen.center_y - screen.scale_y * up / w
    nearness = 1.0 / depth if screen.is_perspective else depth
    return np.stack([x, y, nearness], axis=1).reshape(-1, 6), is_left


def cut(points: NDArray, sign: float, limit: float) -> NDArray:
    """Cut segments (n, 2, 3) at a depth, below which they end where `sign` is 1, above it where it is -1; NaN where
    none is left."""
    inside = sign * (points[..., 2] - limit)
    # From the end that is left: rounding takes from it less than from one that may be far away.
    order = np.argsort(-inside, axis=1)
    first, second = np.take_along_axis(points, order[..., None], axis=1).swapaxes(0, 1)
    before, behind = np.take_along_axis(inside, order, axis=1).T
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = first + (before / (before - behind))[:, None] * (second - first)
    crossing[:, 2] = limit  # nothing may come to lie at the eye
    crossing[before < 0.0] = np.nan
    return np.where((inside < 0.0)[..., None], crossing[:, None], points)


def lay_over(share, seen, edge_color, rgba, color, alpha) -> None:
    """Lay the edges over a picture.

    Parameters
    ----------
    share, seen : as `cover` returns them
    edge_color : sRGB colour, as `Options` has it
    rgba : (height, width, 4) uint8, changed
    color, alpha : (height, width, 3) and (height, width) float32, linear, changed; None where nobody needs them
    """
    at, edge_color = np.nonzero(share), np.array(linear_rgb(edge_color))
    share, seen, there = share[at][:, None], seen[at][:, None], rgba[at]
    mixed, opacity = mix(LINEAR_OF_BYTE[there[:, :3]], there[:, 3:] / 255.0, share, seen, edge_color)
    rgba[at] = np.rint(255.0 * np.concatenate([srgb_from_linear(mixed), opacity], axis=1)).astype(np.uint8)
    if color is not None and alpha is not None:
        colors, opacities = color[at].astype(np.float64), alpha[at][:, None].astype(np.float64)
        mixed, opacity = mix(colors, opacities, share, seen, edge_color)
        color[at], alpha[at] = mixed, opacity[:, 0]


def mix(colors: NDArray, opacity: NDArray, share: NDArray, seen: NDArray, edge_color: NDArray) -> tuple:
    """Lay an opaque colour over straight colours (n, 3) with opacity (n, 1), on a share (n, 1) of each pixel.

    It is laid over what shows anything, a share `seen` (n, 1) of the pixel. What is opaque stays as opaque as it is.
    Source: Porter & Duff 1984, "over".
    """
    behind = opacity * (1.0 - share / seen)
    total = share + behind
    return (edge_color * share + colors * behind) / total, np.maximum(total, opacity)


def average(samples: NDArray, factor: int) -> NDArray[np.float64]:
    """Average the samples of each pixel, `factor` along each axis."""
    out = np.zeros((samples.shape[0] // factor, samples.shape[1] // factor))
    for j, i in np.ndindex(factor, factor):
        out += samples[j::factor, i::factor]
    return out / factor**2
