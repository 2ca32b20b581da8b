"""Edges over a picture: wireframe, creases and silhouettes, drawn where nothing hides them.

    edges of polygons ─ chosen for the view ─ to the screen ─ strokes (pipeline/strokes.py) ─ over the picture

In:  a prepared scene, a view, and the picture as it is. Out: the picture, with strokes over it.

The colour of a stroke is laid over the picture's linear colours, by the covered share of each pixel. Bytes that are
touched are decoded, mixed and encoded again, so that exposure and range leave the stroke's colour what it is.
"""

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..geometry.edges import Edges, join_edges
from ..pipeline.strokes import GRID, STEPS, EdgeView, Occluders, draw_strokes
from ..pipeline.transform import Screen, skew_stretch
from ..scene.camera import Camera, View
from ..scene.color import LINEAR_OF_BYTE, linear_rgb, srgb_from_linear
from .attributes import NONE
from .coding import make_buffer_coding
from .depth_range import screen_of
from .draw import NO_CLOCK, draw
from .output_buffers import BUFFER_TABLE
from .passes import NO_MATERIALS, BufferPass

if TYPE_CHECKING:
    from .prepared_scene import PreparedScene

FACTOR = 2  # samples a pixel along each axis at which it is known which triangle is visible
COORDINATE_ERROR = 2.0**-22  # of the largest coordinate: float32 keeps 2^-24 of each, and sums of four are taken


class EdgeOverlay:
    """The edges of one scene.

    Parameters
    ----------
    prepared : the scene
    """

    def __init__(self, prepared: "PreparedScene") -> None:
        self._prepared = prepared
        self._edges = join_edges(prepared.scene.meshes)

    def draw_over(self, camera: Camera, rgba: NDArray[np.uint8], color: NDArray | None, alpha: NDArray | None) -> None:
        """Draw the edges that the options ask for over a picture.

        Parameters
        ----------
        camera : through which the picture is seen
        rgba : (height, width, 4) uint8, changed
        color, alpha : (height, width, 3) and (height, width) float32, linear, changed; None where nobody needs them
        """
        options = self._prepared.options
        coverage = self.coverage(camera)
        ink = np.array(linear_rgb(options.edge_color))
        at = np.nonzero(coverage)
        share = coverage[at][:, None]
        bytes_there = rgba[at]
        shown, opacity = mix(LINEAR_OF_BYTE[bytes_there[:, :3]], bytes_there[:, 3:] / 255.0, share, ink)
        rgba[at] = np.rint(255.0 * np.concatenate([srgb_from_linear(shown), opacity], axis=1)).astype(np.uint8)
        if color is not None and alpha is not None:
            shown, opacity = mix(color[at].astype(np.float64), alpha[at][:, None].astype(np.float64), share, ink)
            color[at], alpha[at] = shown, opacity[:, 0]

    def coverage(self, camera: Camera) -> NDArray[np.float64]:
        """Return which share of each pixel strokes cover, (height, width)."""
        prepared, options, view = self._prepared, self._prepared.options, camera.view()
        # The middle of a stroke that reaches into the picture may lie beside it, and is hidden there or not.
        margin = math.ceil(0.5 * options.edge_width) + 1
        width, height = (n + 2 * margin for n in options.size)
        size = width * FACTOR, height * FACTOR
        screen = screen_of(camera, view, options.size, FACTOR, prepared.geometry, prepared.bounds, margin)
        chosen = choose(self._edges, options.edges, screen, options.cull == "back")
        radius = 0.5 * options.edge_width
        segments = project(self._edges.ends[chosen], screen, size)
        bits = np.zeros((height, width), np.uint64)
        if len(segments):
            largest = float(max(np.abs(prepared.bounds).max(), np.abs(screen.eye).max()))
            slack = COORDINATE_ERROR * largest * skew_stretch(screen)
            projection = screen.scale_x, screen.scale_y, screen.center_x, screen.center_y
            edge_view = EdgeView(*projection, screen.is_perspective, slack, float(FACTOR), screen.near)
            occluders = Occluders(
                in_camera(prepared.geometry.positions, screen),
                np.ascontiguousarray(prepared.geometry.vertex, np.uint32),
                self._visible_triangles(view, screen, size),
            )
            flags = np.empty(STEPS * (sum(size) + 4 * FACTOR) + 4, np.uint8)
            draw_strokes(segments, occluders, edge_view, radius, flags, bits)
        return np.bitwise_count(bits[margin:-margin, margin:-margin]) / float(GRID * GRID)

    def _visible_triangles(self, view: View, screen: Screen, size: tuple[int, int]) -> NDArray[np.int32]:
        """Return which triangle each sample shows, (height, width), -1 where none is."""
        prepared = self._prepared
        visible = BUFFER_TABLE["triangle"].make(size)
        render_pass = BufferPass(
            attributes=NONE,
            coding=make_buffer_coding(screen, 0),
            size=size,
            is_culled=prepared.options.cull == "back",
            screen=screen,
            buffers={"triangle": visible},
            tables={},
        )
        geometry = prepared.geometry._replace(face_material=NO_MATERIALS)
        draw(geometry, render_pass, screen, prepared.workspaces, prepared.threads, NO_CLOCK)
        return visible


def choose(edges: Edges, kinds: tuple[str, ...], screen: Screen, is_culled: bool) -> NDArray[np.bool_]:
    """Tell which edges are drawn, (n,)."""
    is_front, is_shown = edges.is_front(screen.eye, screen.forward, screen.is_perspective)
    chosen = np.zeros(len(edges.ends), bool)
    if "wire" in kinds:
        chosen[:] = True
    if "crease" in kinds:
        chosen |= edges.is_crease
    if "silhouette" in kinds:
        chosen |= edges.is_open | (is_front[:, 0] != is_front[:, 1])
    return chosen & is_shown.any(axis=1) if is_culled else chosen


def in_camera(positions: NDArray, screen: Screen) -> NDArray[np.float64]:
    """Return points (3, n) of the world in the camera's frame: along the screen's `across`, up, and depth."""
    axes = np.stack([screen.across, screen.up, screen.forward])
    return axes @ (positions - np.asarray(screen.eye)[:, None])


def project(ends: NDArray, screen: Screen, size: tuple[int, int]) -> NDArray[np.float64]:
    """Bring edges to the screen, and cut off what lies beyond the depths that are drawn, or beside the samples.

    Parameters
    ----------
    ends : (n, 2, 3), world space
    size : (width, height) of what is seen, samples: the picture, and beside it what strokes may reach from

    Returns
    -------
    (m, 6) float64: x, y and nearness of both ends, see `draw_strokes`
    """
    points = in_camera(ends.reshape(-1, 3).T, screen).T.reshape(-1, 2, 3)
    starts, finishes = points[:, 0], points[:, 1]
    planes = [starts[:, 2] - screen.near, finishes[:, 2] - screen.near]
    starts, finishes = cut(starts, finishes, *planes)
    if np.isfinite(screen.far):
        starts, finishes = cut(starts, finishes, screen.far - starts[:, 2], screen.far - finishes[:, 2])
    starts, finishes = to_screen(starts, screen), to_screen(finishes, screen)
    for axis, most in enumerate(size):
        starts, finishes = cut(starts, finishes, starts[:, axis], finishes[:, axis])
        starts, finishes = cut(starts, finishes, most - starts[:, axis], most - finishes[:, axis])
    # Of an edge that is seen end-on, the nearer end is the one that is seen.
    is_end_on = (starts[:, :2] == finishes[:, :2]).all(axis=1) & (finishes[:, 2] > starts[:, 2])
    starts[is_end_on] = finishes[is_end_on]
    return np.concatenate([starts, finishes], axis=1)


def to_screen(points: NDArray, screen: Screen) -> NDArray[np.float64]:
    """Return where points (n, 3) of the camera's frame are seen: x, y in samples, and nearness."""
    across, up, depth = points.T
    w = depth if screen.is_perspective else np.ones(len(depth))
    nearness = 1.0 / depth if screen.is_perspective else -depth
    x = screen.center_x + screen.scale_x * across / w
    return np.stack([x, screen.center_y - screen.scale_y * up / w, nearness], axis=1)


def cut(starts: NDArray, finishes: NDArray, inside_start: NDArray, inside_finish: NDArray) -> tuple[NDArray, NDArray]:
    """Cut segments where a distance, given at both ends and linear between them, falls below 0; drop what has none."""
    kept = (inside_start >= 0) | (inside_finish >= 0)
    starts, finishes, a, b = starts[kept].copy(), finishes[kept].copy(), inside_start[kept], inside_finish[kept]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = starts + (finishes - starts) * (a / (a - b))[:, None]
    starts[a < 0], finishes[b < 0] = crossing[a < 0], crossing[b < 0]
    return starts, finishes


def mix(colors: NDArray, opacity: NDArray, share: NDArray, ink: NDArray) -> tuple[NDArray, NDArray]:
    """Lay an opaque colour over straight colours (n, 3) with opacity (n, 1), on a share (n, 1) of each.

    Source: Porter & Duff 1984, "over".
    """
    behind = opacity * (1.0 - share)
    total = share + behind
    return (ink * share + colors * behind) / total, total
