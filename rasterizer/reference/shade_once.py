"""Shading once a pixel and polygon: which point of a polygon is lit in the place of the samples that see it in a pixel.

In: the `Fragments` of a grid of per_axis² samples a pixel. Out: the same, with the weights and the place of the points
that are lit.

The samples of a pixel that see one opaque piece share a point: the pixel's centre where all samples see the piece, else
the sample that is nearest to the centre, the first of these row by row. What is transparent is lit at every sample; so
is what has its light from the vertices or the polygon and no texture. A step of a texture is one from pixel to pixel.
"""

import numpy as np
from numpy.typing import NDArray

from .light import Lighting
from .shading import Fragments
from .surface import Surface
from .visibility import Raster, compute_weight_steps, find_visible, weights_at


class SharedPoints:
    """The points that the samples of a grid share."""

    def __init__(self, raster: Raster, surface: Surface, lighting: Lighting, is_opaque: NDArray, per_axis: int):
        """Find them; `is_opaque` is (n_material,) bool."""
        self._raster, self._per_axis = raster, per_axis
        material = surface.material[raster.pieces.face]
        self._is_shared = is_opaque[material] & (lighting.shading == "phong" or _has_texture(lighting)[material])
        drawn = raster.is_drawn & is_opaque[material]
        self._piece = find_visible(raster._replace(is_drawn=drawn)).piece
        self._rows, self._columns = self._choose_points()

    def _choose_points(self) -> tuple[NDArray, NDArray]:
        """Return row and column, float64, of the point that each sample shares, window by window (h, w)."""
        per_axis, window = self._per_axis, self._raster.window
        rows, columns = np.nonzero(self._piece >= 0)
        pixel = rows // per_axis * (window.width // per_axis) + columns // per_axis
        middle = (per_axis - 1) / 2.0
        distance = (rows % per_axis - middle) ** 2 + (columns % per_axis - middle) ** 2
        n_piece = len(self._raster.is_drawn)
        group = pixel * n_piece + self._piece[rows, columns]
        order = np.lexsort((columns, rows, distance, group))
        _, first, of_sample, count = np.unique(group[order], return_index=True, return_inverse=True, return_counts=True)
        nearest = order[first]
        is_whole = count == per_axis**2
        corner_rows, corner_columns = rows[nearest] // per_axis * per_axis, columns[nearest] // per_axis * per_axis
        point_rows = np.where(is_whole, corner_rows + middle, rows[nearest])
        point_columns = np.where(is_whole, corner_columns + middle, columns[nearest])
        found = np.full((2, *window.shape), np.nan)
        found[:, rows[order], columns[order]] = point_rows[of_sample], point_columns[of_sample]
        return found[0] + window.top, found[1] + window.left

    def move(self, fragments: Fragments, piece: NDArray) -> Fragments:
        """Return fragments that are lit at the points; `piece` is (h, w), what the samples of the grid see."""
        window = self._raster.window
        at = fragments.rows - window.top, fragments.columns - window.left
        pieces = piece[at]
        is_moved = (pieces == self._piece[at]) & self._is_shared[pieces]
        rows, columns, pieces = self._rows[at][is_moved], self._columns[at][is_moved], pieces[is_moved]
        depth, new_weights = weights_at(rows, columns, pieces, self._raster)
        weights, steps = fragments.weights.copy(), fragments.steps.copy()
        lit_at = np.column_stack([fragments.rows, fragments.columns, fragments.depth]).astype(np.float64)
        weights[is_moved] = new_weights
        steps[is_moved] = self._per_axis * compute_weight_steps(pieces, new_weights, depth, self._raster)
        lit_at[is_moved] = np.column_stack([rows, columns, depth])
        return fragments._replace(weights=weights, steps=steps, lit_at=lit_at)


def _has_texture(lighting: Lighting) -> NDArray[np.bool_]:
    """Tell which materials have a texture, (n_material,)."""
    n_material = len(lighting.materials["opacity"])
    if not lighting.textures:
        return np.zeros(n_material, bool)
    return np.array([texture is not None for texture in lighting.textures])
