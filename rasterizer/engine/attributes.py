"""What is interpolated over the triangles: intensities of points that are lit before they are drawn, or normals.

Flat shading lights the centroids of faces, Gouraud's method the vertices. Phong's method hands on the normals, and
behind them what else a sample needs: colours, texture coordinates, tangents.
"""

import numpy as np

from ..pipeline.fragments import make_batch
from ..pipeline.lighting import SurfacePoints, light_points
from ..pipeline.means import fill_means


def point_intensities(geometry, plan, lightings, screen, n_side, normal_offsets, threads) -> np.ndarray:
    """Evaluate the illumination equation at all points, before they are drawn.

    Parameters
    ----------
    lightings : {dtype: Lighting}, for each of the plan's types
    n_side : 1, or 2 where normals may have to be flipped: side 1 has the intensities of flipped normals
    normal_offsets : (n_point,) float64, scene units, see pipeline/shadow_lookup.py; empty where no light casts shadows

    Returns
    -------
    (n_side, n_point, n_channel), linear; float64 where some material is lit in it. Materials of one channel have the
    first alone. With textures (n_side, n_point, 8): textured surfaces have what a black surface gives off, what the
    whole one gives off, texture coordinates
    """

    def light_all(geometry, materials=None):
        return light(geometry, plan, lightings, screen, n_side, normal_offsets, threads, materials)

    if plan.textures is None:
        return fill_centers(light_all(geometry), geometry.centers, threads)
    # What is left where nothing is reflected diffusely: the texture doesn't weaken it.
    is_textured = np.array([material.texture is not None for material in plan.materials])
    whole, rest = light_all(geometry), light_all(geometry._replace(albedo=np.zeros_like(geometry.albedo)), is_textured)
    first = whole.copy()
    for material, start, end in list_groups(geometry):
        if is_textured[material]:
            first[:, start:end] = rest[:, start:end]
    uv = np.broadcast_to(geometry.uv, (n_side, *geometry.uv.shape))
    return fill_centers(np.concatenate([first, whole, uv], axis=2), geometry.centers, threads)


def list_groups(geometry) -> list[tuple[int, int, int]]:
    """List material, first point and end of each group of points."""
    offsets = geometry.point_offsets.tolist()
    return list(zip(geometry.group_material.tolist(), offsets[:-1], offsets[1:], strict=True))


def light(geometry, plan, lightings, screen, n_side, normal_offsets, threads, materials=None) -> np.ndarray:
    """Light all points but the centres of polygons: (n_side, n_point, n_channel); see `point_intensities`.

    `materials` says which are lit, (n_material,) bool; None = all.
    """
    shape = n_side, geometry.points.shape[1], plan.n_channel
    intensities = np.zeros(shape, plan.dtypes[-1])
    tangents = geometry.tangents if plan.has_tangents else None
    points = SurfacePoints(geometry.points, geometry.normals, tangents, geometry.albedo, normal_offsets)
    for material, start, end in list_groups(geometry):
        if materials is not None and not materials[material]:
            continue
        dtype = np.dtype(np.float64 if plan.of_materials.is_double[material] else np.float32)
        for side, out in enumerate(intensities):
            sign = 0 if plan.is_flat else 1 - 2 * side

            def light_part(part, material=material, start=start, sign=sign, out=out, dtype=dtype):
                lighting, batch = lightings[dtype], make_batch(dtype)
                light_points(points, start + part[0], start + part[1], screen, sign, lighting, material, batch, out)

            threads.map(light_part, threads.ranges(end - start))
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
