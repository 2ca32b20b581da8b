"""The judge's polygons: the convex ones with more than three corners, drawn about their centres.

In: the faces of a scene corner by corner. Out: the same, with a face for each edge of such a polygon. What is a convex
polygon is found by the code that cuts them (geometry/polygons.py); all that is computed of one is computed here, and in
light.py.
"""

from typing import NamedTuple

import numpy as np

from ..geometry.polygons import find_rings


class Rings(NamedTuple):
    """Convex polygons with more than three corners, drawn as a face for each edge: its ends, then the centre."""

    of_face: np.ndarray  # (n_face,) int, the ring that a face is a part of, -1 = none
    first: np.ndarray  # (n_ring,) int, the first face of each ring; the others follow it
    count: np.ndarray  # (n_ring,) int, faces of each ring: as many as corners


def about_centers(surface):
    """Return a `Surface` whose convex polygons that were cut into fans are faces between their edges and their centres.

    A corner is one where all that is known of it agrees. The centre is the mean of the corners, also its normal, which
    is not brought to unit length; with Gouraud's method light.py averages the corners' light. See geometry/centers.py.
    """
    columns = [surface.corners, surface.normals, surface.albedo, surface.uv, surface.tangents]
    values, first, names, found = _find_rings(surface, [column for column in columns if column is not None])
    sources, faces, rings = [], [], []
    ring_of = np.full(len(names), -1)
    for ring in range(len(found.start)):
        ring_of[found.owners[found.offsets[ring] : found.offsets[ring + 1]]] = ring
    begun = set()
    for face, ring in enumerate(ring_of.tolist()):
        if ring < 0:
            sources.append(values[3 * face : 3 * face + 3])
            faces.append(face)
            rings.append(-1)
        elif ring not in begun:
            begun.add(ring)
            loop = slice(found.offsets[ring], found.offsets[ring + 1])
            corners = values[first[found.corners[loop]]]
            center = corners.mean(axis=0)
            for here, after in zip(corners, np.roll(corners, -1, axis=0), strict=True):
                sources.append(np.stack([here, after, center]))
            faces += found.owners[loop].tolist()
            rings += [ring] * len(corners)
    values, faces, rings = np.stack(sources), np.array(faces), np.array(rings)
    number, start, count = np.unique(rings, return_index=True, return_counts=True)
    table = Rings(rings, start[number >= 0], count[number >= 0])
    return surface._replace(
        corners=values[..., :3], normals=values[..., 3:6], albedo=values[..., 6:9], polygon=surface.polygon[faces],
        material=surface.material[faces], uv=None if surface.uv is None else values[..., 9:11],
        tangents=None if surface.tangents is None else values[..., -3:], loaded=faces, rings=table,
    )  # fmt: skip


def even_colors(surface):
    """Return a `Surface` for flat shading, all corners of whose convex polygons have the mean of the polygon's
    colours."""
    values, first, _, found = _find_rings(surface, [surface.corners, surface.albedo])
    albedo = surface.albedo.copy()
    for start, end in zip(found.offsets[:-1], found.offsets[1:], strict=True):
        albedo[found.owners[start:end]] = values[first[found.corners[start:end]], 3:6].mean(axis=0)
    return surface._replace(albedo=albedo)


def _find_rings(surface, columns):
    """Find polygons by corners that agree in all columns: (rows of all corners, first row of each name, names,
    rings)."""
    values = np.concatenate(columns, axis=2).reshape(3 * len(surface.corners), -1) + 0.0
    _, first, name = np.unique(values, axis=0, return_index=True, return_inverse=True)
    names = name.reshape(-1, 3)
    return values, first, names, find_rings(names, surface.polygon, values[first, :3])
