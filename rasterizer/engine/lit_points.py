"""Light for flat shading and Gouraud's method: the centroids of polygons, or the vertices, are lit before they are
drawn, as far as the cull has left triangles that show them. What they give off is interpolated over the triangles.

Phong's method interpolates normals, and lights the samples: see `join_attributes` in points.py.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..cores import MIN_PART
from ..pipeline.fragments import BATCH_SHAPE
from ..pipeline.gradients import HAS_COLORS
from ..pipeline.lighting import SurfacePoints, flag_seen, light_points


class Group(NamedTuple):
    """Points start..end, all of one material, and which of them are seen, ascending."""

    material: int
    start: int
    end: int
    seen: NDArray[np.int64]


Piece = tuple[int, NDArray[np.int64]]  # a material, and points of it


def light_seen(geometry, plan, lightings, screen, n_side, normal_offsets, threads, faces) -> NDArray[np.float64]:
    """Evaluate the illumination equation at the points that triangles have at their corners.

    Parameters
    ----------
    lightings : {dtype: Lighting}, for each of the plan's types
    n_side : 1, or 2 where normals may have to be flipped: side 1 has the intensities of flipped normals
    normal_offsets : (2, n_point) float64, scene units, see geometry/surfaces.py; empty where no light casts shadows
    faces : (n,) uint32, those that are seen

    Returns
    -------
    (n_side, n_point, n_attribute): n_channel intensities, linear, computed in the type of their material; of one with
    one channel the first is written alone. Of points that
    no triangle shows it may be 0. With textures 2 n_channel + 2: of textured surfaces what a black one gives
    off, what the whole one gives off, texture coordinates
    """
    offsets, materials = geometry.point_offsets.tolist(), geometry.group_material.tolist()
    has_texture = [bool(plan.tables.has_texture[material]) for material in materials]
    # Of flat shading the centroid stands at all three corners, but for texture coordinates.
    n_corner = 1 if plan.options.is_flat and not any(has_texture) else 3
    seen = np.zeros(len(geometry.normals), np.bool_)
    flag_seen(faces, geometry.corner[:n_corner], seen)
    which = np.flatnonzero(seen)
    of_groups = np.split(which, np.searchsorted(which, offsets[1:-1]))
    groups = [*map(Group, materials, offsets[:-1], offsets[1:], of_groups)]
    textured = [group for group, has in zip(groups, has_texture, strict=True) if has]

    tangents = geometry.tangents if plan.has_tangents else None
    points = SurfacePoints(geometry.points, geometry.normals, tangents, geometry.albedo, normal_offsets)
    whole = light(points, groups, plan, lightings, screen, n_side, threads)
    if not textured:
        return whole
    # What is left where nothing is reflected diffusely: the texture doesn't weaken it.
    dark = points._replace(albedo=np.zeros(geometry.albedo.shape))
    rest = light(dark, textured, plan, lightings, screen, n_side, threads)
    n_channel = whole.shape[2]
    out = np.zeros((*whole.shape[:2], 2 * n_channel + 2))
    for group in groups:
        here = slice(group.start, group.end)
        out[:, here, :n_channel] = whole[:, here]
    for group in textured:
        here = slice(group.start, group.end)
        out[:, here, : rest.shape[2]] = rest[:, here]
        out[:, here, n_channel : 2 * n_channel] = whole[:, here]
        out[:, here, 2 * n_channel :] = geometry.uv[here, :2]
    return out


def light(points: SurfacePoints, groups, plan, lightings, screen, n_side, threads) -> NDArray[np.float64]:
    """Light the points of some groups: (n_side, n_point, n_channel); see `light_seen`.

    Memory that was never written is zero, and costs nothing: so a few points in a large scene are cheap.
    """
    of_materials = plan.of_materials
    n_channel = 3 if any(of_materials.features[group.material] & HAS_COLORS for group in groups) else 1
    is_double = of_materials.is_double.any() or plan.textures is not None  # texture coordinates stand behind these
    intensities = np.zeros((n_side, len(points.normals), n_channel), np.float64 if is_double else np.float32)
    least = MIN_PART // max(1, len(plan.tables.lights))  # points that are worth a thread of its own
    pieces = [
        (group.material, group.seen[first:end])
        for group in groups
        for first, end in threads.ranges(len(group.seen), least)
    ]

    def light_bundle(bundle):
        batches = {dtype: np.zeros(BATCH_SHAPE, dtype) for dtype in lightings}
        for side, out in enumerate(intensities):
            sign = 0 if plan.options.is_flat else 1 - 2 * side
            for material, which in bundle:
                dtype = np.dtype(np.float64 if of_materials.is_double[material] else np.float32)
                light_points(points, which, screen, sign, lightings[dtype], material, batches[dtype], out)

    threads.map(light_bundle, bundles_of(pieces, least))
    return intensities


def bundles_of(pieces: list[Piece], least: int) -> list[list[Piece]]:
    """Put neighbouring pieces together, until a bundle has `least` points."""
    bundles: list[list[Piece]] = []
    room = 0
    for piece in pieces:
        if room <= 0:
            bundles.append([])
            room = least
        bundles[-1].append(piece)
        room -= len(piece[1])
    return bundles
