"""Polygons drawn about their centres, so that methods that interpolate don't depend on which corner comes first.

    d ─────── c        A fan has a diagonal, and along it only two corners count: with the values 0, 1, 0, 1 the middle
    │ ╲     ╱ │        of a quad would be 0 or 1, as the list of its corners begins. Gouraud 1971 interpolates along the
    │   ╲ ╱   │        edges, then along the scanline between them: no corner is preferred, but that depends on how the
    │   ╱ ╲   │        polygon lies in the picture (turned by 45 degrees, the middle of this quad is 0 or 1 again), so a
    │ ╱     ╲ │        turning object shimmers.
    a ─────── b
                       A convex polygon of k > 3 corners is drawn as k triangles between its edges and its centre.

The centre's position is the mean of the corners'. It is no vertex: nothing is lit there. Its values are the means of
the corners': intensities with Gouraud's method, normals with Phong's (not brought to unit length before they are
interpolated, as nothing is along an edge), colours and texture coordinates with both. So:

- values are linear along every edge, as with Gouraud 1971, and equal those of the neighbour on the other side;
- every corner counts alike: what permutes the corners (another first corner, the other direction, a turned or mirrored
  polygon) permutes the triangles, and nothing else. With two corners alike and opposite, as 0, 1, 0, 1, the middle has
  0.5;
- values stay within those of the corners, equal ones stay equal, and values that are linear over a plane polygon stay
  so, because a mean commutes with what is linear: that is all of what a fan does right. Perspective doesn't come into
  it: everything is interpolated in space.

Flat shading has one value a polygon, and needs none of it. Concave polygons keep the triangles of their ears, which
don't depend on the first corner either; a polygon whose corners don't have one point each, as where a crease goes
through it, keeps its own.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .polygons import Rings


class Centers(NamedTuple):
    """The points that are means of others: the last ones of a geometry."""

    first: int  # the number of the first of them
    offsets: NDArray[np.int64]  # (n_center + 1,) into `points`
    points: NDArray[np.int64]  # (n_corner,) the points that each is the mean of


class Split(NamedTuple):
    """Triangles, some of them about centres."""

    vertex: NDArray[np.uint32]  # (3, n) points; a centre's number is that of `Centers`
    face: NDArray[np.uint32]  # (n,) the triangle before, of those that have the same edge of the polygon
    centers: Centers


def split_rings(vertex: NDArray, n_point: int, rings: Rings) -> Split:
    """Draw convex polygons as triangles about their centres, where they were in the order of the triangles.

    Parameters
    ----------
    vertex : (3, n_face) uint32, points of triangles
    n_point : how many points there are
    rings : of the triangles, all of them
    """
    sizes = np.diff(rings.offsets)
    is_kept = np.ones(vertex.shape[1], bool)
    is_kept[rings.owners] = False
    kept = np.flatnonzero(is_kept)
    after = np.arange(1, len(rings.corners) + 1)
    after[rings.offsets[1:] - 1] = rings.offsets[:-1]
    number = n_point + np.repeat(np.arange(len(sizes)), sizes)
    pieces = np.stack([rings.corners, rings.corners[after], number]).astype(np.uint32)
    order = np.argsort(np.concatenate([kept, np.repeat(rings.start, sizes)]), kind="stable")
    face = np.concatenate([kept, rings.owners])[order].astype(np.uint32)
    columns = np.ascontiguousarray(np.concatenate([vertex[:, kept], pieces], axis=1)[:, order])
    return Split(columns, face, Centers(n_point, rings.offsets, rings.corners))


def join_rings(parts: list[Rings], first_face: NDArray, first_point: NDArray) -> Rings:
    """Join the rings of several meshes: their triangles and points stand behind each other, from these numbers on."""
    return Rings(
        np.concatenate([rings.start + face for rings, face in zip(parts, first_face, strict=False)]),
        np.concatenate([[0], np.cumsum(np.concatenate([np.diff(rings.offsets) for rings in parts]))]).astype(np.int64),
        np.concatenate([rings.corners + point for rings, point in zip(parts, first_point, strict=False)]),
        np.concatenate([rings.owners + face for rings, face in zip(parts, first_face, strict=False)]),
    )


def with_means(values: NDArray, centers: Centers) -> NDArray[np.float64]:
    """Append to values of points (n_point, k) the means over each centre's points, not outside their range by a
    rounding."""
    if len(values) == 0:
        return values
    starts, count = centers.offsets[:-1], np.diff(centers.offsets)
    out = np.concatenate([values, np.empty((len(count), values.shape[1]))])
    for k, column in enumerate(values.T):  # numpy sums columns several times as fast as rows
        corners = column[centers.points]
        low, high = np.minimum.reduceat(corners, starts), np.maximum.reduceat(corners, starts)
        out[len(values) :, k] = np.clip(np.add.reduceat(corners, starts) / count, low, high)
    return out
