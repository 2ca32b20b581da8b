"""What is interpolated over the triangles: intensities of points that are lit before they are drawn, or normals.

Flat shading lights the centroids of faces, Gouraud's method the vertices. Phong's method hands on the normals, and
behind them what else a sample needs: colours, texture coordinates, tangents.
"""

from typing import NamedTuple

import numpy as np

from ..pipeline.fragments import make_batch
from ..pipeline.gradients import NEEDS_COLORS
from ..pipeline.lighting import SurfacePoints, light_points
from ..pipeline.means import fill_means


class Attributes(NamedTuple):
    """What is interpolated over the triangles; rows of points that belong to the other type hold anything."""

    single: np.ndarray  # (n_side, n_point, n_attribute) float32
    double: np.ndarray  # the same in float64


NONE = Attributes(np.empty((1, 0, 0), np.float32), np.empty((1, 0, 0)))


def light_all(geometry, plan, lightings, screen, n_side, normal_offsets, threads) -> Attributes:
    """Evaluate the illumination equation at all points, before they are drawn.

    Parameters
    ----------
    lightings : {dtype: Lighting}, for each of the plan's types
    n_side : 1, or 2 where normals may have to be flipped: side 1 has the intensities of flipped normals
    normal_offsets : (n_point,) float64, scene units, see pipeline/shadow_lookup.py; empty where no light casts shadows

    Returns
    -------
    Attributes: n_channel intensities, linear; of materials with one channel the first is written alone. With textures 8
    in float64: of textured surfaces what a black one gives off, what the whole one gives off, texture coordinates
    """
    found = {dtype: NONE[k] for k, dtype in enumerate((np.dtype(np.float32), np.dtype(np.float64)))}
    groups = list_groups(geometry)
    for dtype, lighting in lightings.items():
        is_lit = plan.of_materials.is_double == (dtype == np.float64)
        here = [group for group in groups if is_lit[group.material]]
        out = light(geometry, plan, lighting, screen, n_side, normal_offsets, threads, here)
        textured = [group for group in here if plan.materials[group.material].texture is not None]
        if textured:
            out = add_textured(out, here, textured, geometry, plan, lighting, screen, normal_offsets, threads)
        found[dtype] = fill_centers(out, geometry, here, threads)
    return Attributes(*found.values())


def add_textured(whole, groups, textured, geometry, plan, lighting, screen, normal_offsets, threads) -> np.ndarray:
    """Add what the textured ones of some groups of points have beside the intensities `whole`: see `light_all`."""
    n_side, n_point, n_channel = whole.shape
    # What is left where nothing is reflected diffusely: the texture doesn't weaken it.
    black = geometry._replace(albedo=np.zeros(geometry.albedo.shape))
    rest = light(black, plan, lighting, screen, n_side, normal_offsets, threads, textured)
    out = np.zeros((n_side, n_point, 2 * n_channel + 2), whole.dtype)
    for group in groups:
        here = slice(group.start, group.end)
        out[:, here, :n_channel] = rest[:, here] if group in textured else whole[:, here]
        if group in textured:
            out[:, here, n_channel : 2 * n_channel] = whole[:, here]
            out[:, here, 2 * n_channel :] = geometry.uv[here]
    return out


class Group(NamedTuple):
    """Points start..end, all of one material."""

    material: int
    start: int
    end: int


def list_groups(geometry) -> list[Group]:
    """List the groups of points of a geometry."""
    offsets = geometry.point_offsets.tolist()
    return [Group(*group) for group in zip(geometry.group_material.tolist(), offsets[:-1], offsets[1:], strict=True)]


def light(geometry, plan, lighting, screen, n_side, normal_offsets, threads, groups) -> np.ndarray:
    """Light the points of some groups: (n_side, n_point, n_channel) in the lighting's type; see `light_all`."""
    dtype, needs = lighting.materials.dtype, plan.of_materials.needs
    n_channel = 3 if any(needs[group.material] & NEEDS_COLORS for group in groups) else 1
    intensities = np.zeros((n_side, geometry.points.shape[1], n_channel), dtype)
    tangents = geometry.tangents if plan.has_tangents else None
    points = SurfacePoints(geometry.points, geometry.normals, tangents, geometry.albedo, normal_offsets)
    for material, start, end in groups:
        for side, out in enumerate(intensities):
            sign = 0 if plan.is_flat else 1 - 2 * side

            def light_part(part, material=material, start=start, sign=sign, out=out):
                batch = make_batch(dtype)
                light_points(points, start + part[0], start + part[1], screen, sign, lighting, material, batch, out)

            threads.map(light_part, threads.ranges(end - start))
    return intensities


def fill_centers(values, geometry, groups, threads) -> np.ndarray:
    """Give the points that are means of those of some groups their values (n_side, n_point, n_value); nothing is lit
    there."""
    centers = geometry.centers
    if centers is not None and groups:
        first_points = centers.points[centers.offsets[:-1]]
        starts, ends = np.array([(group.start, group.end) for group in groups]).T
        group = np.searchsorted(starts, first_points, side="right") - 1
        here = np.flatnonzero((group >= 0) & (first_points < ends[group]))
        first, end = (int(here[0]), int(here[-1]) + 1) if len(here) else (0, 0)
        for side in values:

            def fill_part(part, side=side):
                fill_means(side, centers.first, centers.offsets, centers.points, first + part[0], first + part[1])

            threads.map(fill_part, threads.ranges(end - first))
    return values


class NormalAttributes:
    """The normals of a scene's points as attributes, kept from picture to picture."""

    def __init__(self, geometry):
        self._geometry = geometry
        self._kept: dict[tuple, np.ndarray] = {}

    def of(self, plan) -> Attributes:
        """Normals, behind them the model's colours, texture coordinates and tangents: 3 to 11 attributes."""
        is_double, n_attributes = plan.of_materials.is_double, plan.of_materials.n_attributes
        found = list(NONE)
        for k, dtype in enumerate((np.dtype(np.float32), np.dtype(np.float64))):
            if dtype in plan.dtypes:
                of_dtype = is_double == (dtype == np.float64)
                found[k] = self._of(dtype, int(n_attributes[of_dtype].max()))
        return Attributes(*found)

    def normals(self) -> Attributes:
        """The normals alone, in float64."""
        return NONE._replace(double=self._of(np.dtype(np.float64), 3))

    def _of(self, dtype, n_attribute) -> np.ndarray:
        """So many attributes, of all points."""
        key = dtype, n_attribute
        if key not in self._kept:
            geometry, n_point = self._geometry, self._geometry.points.shape[1]
            columns = geometry.normals.T, geometry.albedo, geometry.uv, geometry.tangents.T
            columns = np.concatenate([column for column in columns if len(column) == n_point], axis=1)
            self._kept[key] = np.ascontiguousarray(columns[None, :, :n_attribute], dtype)
        return self._kept[key]

    def of_faces(self, view, screen) -> Attributes:
        """Normals of flat faces, towards the viewer, two sides: side 1 is reversed, because `write_normal` flips it."""
        normals = self._geometry.normals.T
        away = (self._geometry.points.T - view.eye) if screen.is_perspective else view.forward
        toward = np.where((normals * away).sum(axis=1, keepdims=True) > 0.0, -normals, normals)
        return NONE._replace(double=np.stack([toward, -toward]))
