"""What is interpolated over the triangles: intensities of points that are lit before they are drawn, or normals.

Flat shading lights the centroids of faces, Gouraud's method the vertices. Phong's method hands on the normals, and
behind them what else a sample needs: colours, texture coordinates, tangents.
"""

import numpy as np

from ..pipeline.fragments import make_batch
from ..pipeline.lighting import SurfacePoints, light_points
from ..pipeline.means import fill_means


def point_intensities(geometry, plan, lighting, screen, n_side, normal_offsets, threads, runs=None) -> np.ndarray:
    """Evaluate the illumination equation at all points, before they are drawn.

    Parameters
    ----------
    n_side : 1, or 2 where normals may have to be flipped: side 1 has the intensities of flipped normals
    normal_offsets : (n_point,) float64, scene units, see pipeline/shadow_lookup.py; empty where no light casts shadows
    runs : list of (start, end), the points that are needed, ascending; the others may be left unset. None for all

    Returns
    -------
    (n_side, n_point, n_channel) in the plan's type, linear. With textures (n_side, n_point, 2 n_channel + 2): what a
    black surface gives off, what the whole one gives off, texture coordinates
    """

    def light_all(geometry):
        return light(geometry, plan, lighting, screen, n_side, normal_offsets, threads, runs)

    if plan.textures is None:
        return fill_centers(light_all(geometry), geometry.centers, threads)
    # What is left where nothing is reflected diffusely: the texture doesn't weaken it.
    rest = light_all(geometry._replace(albedo=np.zeros_like(geometry.albedo)))
    uv = np.broadcast_to(geometry.uv, (n_side, *geometry.uv.shape))
    return fill_centers(np.concatenate([rest, light_all(geometry), uv], axis=2), geometry.centers, threads)


def light(geometry, plan, lighting, screen, n_side, normal_offsets, threads, runs=None) -> np.ndarray:
    """Light all points but the centres of polygons: (n_side, n_point, n_channel); see `point_intensities`."""
    intensities = np.empty((n_side, geometry.points.shape[1], plan.n_channel), plan.dtype)
    tangents = geometry.tangents if plan.has_tangents else None
    points = SurfacePoints(geometry.points, geometry.normals, tangents, geometry.albedo, normal_offsets)
    starts, ends = geometry.point_offsets[:-1].tolist(), geometry.point_offsets[1:].tolist()
    runs = [(0, geometry.points.shape[1])] if runs is None else runs
    for material, start, end in zip(geometry.group_material.tolist(), starts, ends, strict=True):
        needed = [(max(first, start), min(last, end)) for first, last in runs if first < end and start < last]
        for side, out in enumerate(intensities):
            sign = 0 if plan.is_flat else 1 - 2 * side

            def light_part(part, material=material, sign=sign, out=out):
                light_points(points, *part, screen, sign, lighting, material, make_batch(plan.dtype), out)

            threads.map(light_part, threads.divide(needed))
    return intensities


def fill_centers(values, centers, threads) -> np.ndarray:
    """Give the points that are means of others their values (n_side, n_point, n_value); nothing is lit there."""
    if centers is not None:
        for side in values:

            def fill_part(part, side=side):
                fill_means(side, centers.first, centers.offsets, centers.points, *part)

            threads.map(fill_part, threads.ranges(len(centers.offsets) - 1))
    return values


class NormalAttributes:
    """The normals of a scene's points as attributes, kept from picture to picture."""

    def __init__(self, geometry):
        self._geometry = geometry
        self._kept: dict[tuple, np.ndarray] = {}

    def of(self, dtype, has_albedo=False, has_tangents=False) -> np.ndarray:
        """Normals, behind them the model's colours, texture coordinates and tangents: (1, n_point, 3 to 11)."""
        key = np.dtype(dtype), has_albedo, has_tangents
        if key not in self._kept:
            geometry = self._geometry
            columns = [geometry.normals.T] + ([geometry.albedo] if has_albedo else [])
            columns += [geometry.uv] if has_albedo and len(geometry.uv) else []
            columns += [geometry.tangents.T] if has_tangents else []
            self._kept[key] = np.ascontiguousarray(np.concatenate(columns, axis=1)[None], dtype)
        return self._kept[key]

    def of_faces(self, view, screen) -> np.ndarray:
        """Normals of flat faces, towards the viewer, (2, n_point, 3): side 1 is reversed, because `write_normal` flips
        it."""
        normals = self._geometry.normals.T
        away = (self._geometry.points.T - view.eye) if screen.is_perspective else view.forward
        toward = np.where((normals * away).sum(axis=1, keepdims=True) > 0.0, -normals, normals)
        return np.stack([toward, -toward])

    def none(self) -> np.ndarray:
        """No attributes, (1, n_point, 0)."""
        return np.empty((1, self._geometry.points.shape[1], 0))
