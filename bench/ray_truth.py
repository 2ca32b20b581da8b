"""Shadows by rays: as much of a picture as a time limit allows, by the float64 reference, tile by tile.

    tiles, in a random order ─ what their samples see, layer by layer ─ light, with rays to every lamp

A shadow map is compared with what it approximates, not with a finer map. A ray meets few of a scene's faces: of a tile
only those count that, seen from a lamp, overlap the tile's points. Where that can't be told a face counts.
"""

from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rasterizer.analysis.speed_error import Light
from rasterizer.options import Options
from rasterizer.reference.lamp import Lamp, make_lamps
from rasterizer.reference.light import Lighting
from rasterizer.reference.picture import Look, look_at, resolve, spread_samples
from rasterizer.reference.reflection import channels_of
from rasterizer.reference.shading import Fragments, light_fragments, opacity_of, sample_textures, world_positions
from rasterizer.reference.shadow import Casters
from rasterizer.reference.visibility import NO_KEY, Raster, Window, find_visible, gather_fragments
from rasterizer.scene.scene import Scene

TILE = 8  # pixels along each side
MIN_TILES = 8  # that show something: fewer tell nothing of a picture
_ROUNDING = 2.0**-30  # of the extent seen from a lamp, far above that of float64


class RayTruth(NamedTuple):
    """A part of a picture whose shadows are those of rays."""

    light: Light  # 0 where nothing is, or nothing was computed
    is_known: NDArray[np.bool_]  # (height, width)
    share: float  # of the picture


def draw_by_rays(
    scene: Scene, size: tuple[int, int], samples: int, seconds: float, cull: str = "none", exposure: float = 0.0,
    spectral: int | None = None,
) -> RayTruth | None:  # fmt: skip
    """Draw tiles of a picture by Phong's shading, until a time has passed.

    Parameters
    ----------
    scene : Scene
    size : (width, height) in pixels
    samples : 1, 4, 9 or 16, a pixel
    seconds : time limit
    cull, exposure, spectral : as in `rasterizer.render`

    Returns
    -------
    RayTruth; None where the time doesn't suffice for MIN_TILES
    """
    start = perf_counter()
    options = Options(shading="phong", samples=samples, cull=cull, exposure=exposure, spectral=spectral)
    look, factor = look_at(scene, size, options), options.factor
    raster, lighting = spread_samples(look, factor)
    lamps = [
        _SeenFrom(lamp, lighting.casters)
        for lamp in make_lamps(scene.lights, lighting.view, lambda color: channels_of(color, lighting.n_wave))
        if lighting.casters is not None and getattr(lamp.light, "shadow", None) is not None
    ]
    color, alpha = np.zeros((*raster.window.shape, 3)), np.zeros(raster.window.shape)
    is_known, n_shown = np.zeros((size[1], size[0]), bool), 0
    corners = [(row, column) for row in range(0, size[1], TILE) for column in range(0, size[0], TILE)]
    for row, column in np.random.default_rng(0).permutation(corners).tolist():
        if perf_counter() - start > seconds:
            break
        width, height = min(TILE, size[0] - column), min(TILE, size[1] - row)
        window = Window(column * factor, row * factor, width * factor, height * factor)
        layers = _gather_layers(raster.within(window), look, lighting)
        if layers:
            _light_tile(layers, look, lighting, lamps, color, alpha)
            n_shown += 1
        is_known[row : row + height, column : column + width] = True
    if n_shown < MIN_TILES and not is_known.all():
        return None
    straight, alpha = resolve(color, alpha, factor, None)
    return RayTruth(Light(straight * alpha[..., None], alpha), is_known, float(is_known.mean()))


def only(light: Light, is_known: NDArray[np.bool_]) -> Light:
    """A picture of which nothing is left but some pixels."""
    return Light(light.color * is_known[..., None], light.alpha * is_known)


def _gather_layers(raster: Raster, look: Look, lighting: Lighting) -> list[Fragments]:
    """List what the samples of a window see, layer behind layer, until nothing lets anything through."""
    through, layers, window = np.ones(raster.window.shape), list[Fragments](), raster.window
    visible = find_visible(raster)
    while len((fragments := gather_fragments(visible, raster)).face):
        layers.append(fragments)
        texels = sample_textures(look.surface, fragments, lighting)
        at = fragments.rows - window.top, fragments.columns - window.left
        through[at] *= 1.0 - opacity_of(look.surface, fragments, lighting, texels)
        is_open = (visible.piece >= 0) & (through > 0.0)
        if not is_open.any():
            break
        visible = find_visible(raster, visible._replace(key=np.where(is_open, visible.key, NO_KEY)))
    return layers


def _light_tile(
    parts: list[Fragments], look: Look, lighting: Lighting, lamps: list, color: NDArray, alpha: NDArray
) -> None:
    """Light the layers of a tile, and put them on each other, the nearest first."""
    points = np.concatenate([world_positions(part, lighting) for part in parts])
    if lighting.casters is not None:
        is_near = np.zeros(len(lighting.casters.owner), bool)
        for lamp in lamps:
            is_near |= lamp.may_be_between(points)
        corners, normals, owner, on_plane = lighting.casters
        lighting = lighting._replace(casters=Casters(corners[is_near], normals[is_near], owner[is_near], on_plane))
    for part in parts:
        colors, _, opacity = light_fragments(look.surface, part, lighting)
        at = part.rows, part.columns
        share = (1.0 - alpha[at]) * opacity
        color[at] += share[:, None] * colors
        alpha[at] += share


class _SeenFrom:
    """The faces that cast shadows, as a lamp sees them."""

    def __init__(self, lamp: Lamp, casters: Casters) -> None:
        self._position, self._corners = lamp.position, casters.corners
        if lamp.position is None:
            self._frame = _frame_of(-lamp.axis)
            self._boxes = _boxes(casters.corners @ self._frame.T)

    def may_be_between(self, points: NDArray) -> NDArray[np.bool_]:
        """Tell which faces may lie between the lamp and one of some points (n, 3): (n_caster,) bool."""
        if self._position is None:
            low, high = _box(points @ self._frame.T)
            least, most = self._boxes
            is_before = most[:, 2] >= low[2]  # nearer to the lamp than the furthest point
            return is_before & (most[:, :2] >= low[:2]).all(axis=1) & (least[:, :2] <= high[:2]).all(axis=1)
        away = points - self._position
        frame = _frame_of(away.mean(axis=0))
        flat, depth = _flattened(away @ frame.T)
        if not (depth > 0.0).all():
            return np.ones(len(self._corners), bool)
        low, high = _box(flat)
        corners, depths = _flattened((self._corners - self._position) @ frame.T)
        least, most = _boxes(corners)
        is_before = depths > 0.0
        overlaps = (most >= low).all(axis=1) & (least <= high).all(axis=1)
        return np.where(is_before.all(axis=1), overlaps, is_before.any(axis=1))


def _frame_of(direction: NDArray) -> NDArray[np.float64]:
    """Three axes as rows, of which the last one has a direction; all axes of the world where it is 0."""
    length = np.linalg.norm(direction)
    if not length > 0.0:
        return np.eye(3)
    last = direction / length
    first = np.cross(last, np.eye(3)[np.argmin(np.abs(last))])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(last, first), last])


def _flattened(points: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Project points (..., 3) to the plane at depth 1: (..., 2), and their depths."""
    depth = points[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return points[..., :2] / depth[..., None], depth


def _box(points: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper ends (k,) of points (n, k), with room for rounding."""
    room = _ROUNDING * np.abs(points).max()
    return points.min(axis=0) - room, points.max(axis=0) + room


def _boxes(corners: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper ends (n, k) of faces (n, 3, k)."""
    return corners.min(axis=1), corners.max(axis=1)
