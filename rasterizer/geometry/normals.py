"""Normals of polygons, and of vertices: averaged over the faces round them up to the creases, where vertices split.

In: vertices (n_vertex, 3) and triangles (n_face, 3), counter-clockwise seen from outside, as a `Mesh` holds them. Out:
unit normals; from `split_creases` new triangles over vertices that carry one normal each.

      after            A *corner* is one vertex of one face, numbered 3 * face + k. It leaves along here-after
      /  \\             and comes back along before-here. Two faces that share an edge are wound alike where
     / A  \\            one leaves along it and the other comes back; else one of them is wound badly.
 before - here         The *fan* is the corners at one vertex.

Each fan is taken apart by itself, with the list of corners at each vertex and nothing else: no table of edges and no
stored face normals. To compute a normal again at each corner costs less than to store and fetch it: the corners of some
fans are measured together, by the compiler's vector instructions. Nearly all fans are rings: from each corner a walk
across the edge that it leaves along comes to the next one, and at last back to the first. The edges of others are
sorted. Parts of the vertices are split side by side, on threads.

Rounding: only differences of coordinates are used, so a common offset loses no more than the coordinates already have.
Lengths may lie anywhere between 1e-60 and 1e60.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..choices import WEIGHTINGS, Weighting
from ..compiler.kernels import helper, kernel
from ..cores import Workers
from .vectors import cross, divide, dot, length, subtract, vector_of_row

_ANGLE, _AREA, _UNIFORM = range(3)  # as in WEIGHTINGS

_PART = 1 << 13  # vertices that are worth a thread

_MAX_RING = 32  # corners of a fan in which the next one is looked for among all

# Corners that are measured together. What is noted of them are rows of numbers, one quantity a row; all stand one
# behind the other in one flat array, `block[HERE + k]`, so that the compiler sees that they don't overlap.
_BLOCK = 128
_HERE, _AFTER, _BEFORE, _NORMAL = (3 * _BLOCK * k for k in range(4))  # positions, and the face's unit normal
_SCALE, _SIZE, _COSINE, _WEIGHT = ((12 + k) * _BLOCK for k in range(4))  # see _area_vector
_NEXT = _BLOCK  # from x to y to z

# All pairs of faces at an edge are compared. An edge of more faces than these is no part of a surface: it joins
# nothing, so that the time stays below this many comparisons a corner.
_MAX_AT_EDGE = 64

# The dot product of two unit normals, each off unit length by 2 * 2^-53, is wrong by less than 8 * 2^-53.
_DOT_ERROR = 2.0**-50

# Two faces meet at the crease angle when they do so within this many degrees. Coordinates with six decimals
# (usual in OBJ) are off by 5e-7; the walls of a 12-sided unit cylinder are 0.52 wide, so each is tilted by up
# to 2 * 5e-7 / 0.52 rad, and two against each other by 2.2e-4 degrees. Take twice that.
_ANGLE_SLACK = 5e-4

# A cross product a x b of rounded differences is wrong by up to 5.3 * 2^-53 |a||b|: each product carries
# three roundings, the difference one more, and |(|ay bz| + |az by|, ...)| <= sqrt(2) |a||b|. Under 8 * 2^-53
# it is noise.
_FLAT = 2.0**-50

# A sum of weighted normals that is shorter than this part of the weights has cancelled: its direction shows
# how the coordinates were rounded (single precision: 2^-24), not the surface.
_CANCELLED = 2.0**-20

_MAX_EXPONENT = 200  # of coordinates, see `within_range`


class Split(NamedTuple):
    """Triangles over split vertices, in the order of the vertices that they were split from.

    Attributes
    ----------
    faces : (n_face, 3) uint32, the faces as given, as indices of split vertices; one column behind the other
    source : (n_split,) uint32, index of the vertex that each was split from
    normals : (n_split, 3) float64, unit length; zero where only faces without area meet
    """

    faces: NDArray[np.uint32]
    source: NDArray[np.uint32]
    normals: NDArray[np.float64]


class Fans(NamedTuple):
    """The corners of a mesh, sorted by vertex; made by `list_fans`."""

    corner_vertices: NDArray[np.uint32]  # (n_corner,) the vertex at each corner
    first: NDArray[np.uint32]  # (n_vertex + 2,) where each vertex's corners begin; the last entry is working space
    corners: NDArray[np.uint32]  # (n_corner,) those of vertex v are corners[first[v] : first[v + 1]]
    valence: int  # the most that one vertex has


class FanCorners(NamedTuple):
    """Corners that were measured: of some fans, or those of one that have an area."""

    measured: NDArray[np.float64]  # (n, 4) the face's unit normal there, and the weight, which is 0 without area
    members: NDArray[np.uint32]  # (n,) the corner
    after: NDArray[np.uint32]  # (n,) the vertices at the far ends of its edges
    before: NDArray[np.uint32]  # (n,)


class FanScratch(NamedTuple):
    """What is known of some fans that are measured together; and of one while it is worked on, an entry for each of its
    corners."""

    block: NDArray[np.float64]  # see _BLOCK
    corners: FanCorners  # room for max(_BLOCK, valence)
    next: NDArray[np.uint32]  # (valence,) in a ring, the corner across the edge to `after`; its own at a crease
    keys: NDArray[np.int64]  # (2 * valence,) the edges: far vertex << 32 | index in the fan << 1 | leaves
    parents: NDArray[np.uint32]  # (valence,) the groups: see _find
    signs: NDArray[np.int64]  # (valence,)
    sums: NDArray[np.float64]  # (valence, 4) at the root of each group: weighted normals and weights
    split_of: NDArray[np.int64]  # (valence, 2) there: the split vertices of both sides, or -1


class CreaseRule(NamedTuple):
    """Which corners are joined, and how they are averaged."""

    smoothing: NDArray[np.int32]  # (n_face,) or empty: then the angle decides
    smooth_cosine: float  # see `is_smooth`
    weighting: int  # 0 to 2


def polygon_normals(vertices: ArrayLike, faces: ArrayLike, polygons: ArrayLike) -> NDArray[np.float64]:
    """Compute the unit normal of every polygon, convex or not, from the sum of its triangles' area vectors.

    Parameters
    ----------
    vertices : (n_vertex, 3) real, scene units
    faces : (n_face, 3) integer, counter-clockwise seen from outside
    polygons : (n_face,) integer, index of the polygon that each face is part of

    Returns
    -------
    (max(polygons) + 1, 3) float64, unit length; zero for a polygon without area

    Source: Newell's method in Sutherland, Sproull & Schumacker 1974, ACM Computing Surveys 6(1).
    """
    return polygon_planes(vertices, faces, polygons)[0]


def polygon_planes(
    vertices: ArrayLike, faces: ArrayLike, polygons: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute the unit normal and the area-weighted centroid of every polygon; parameters as in `polygon_normals`.

    Returns
    -------
    normals : (max(polygons) + 1, 3) float64, as `polygon_normals` returns them
    centroids : the same shape, scene units; where no triangle of a polygon has an area, the mean of theirs
    """
    vertices, faces = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.uint32)
    polygons = np.ascontiguousarray(polygons, np.uint32)
    n_polygon = int(polygons.max()) + 1 if len(polygons) else 0
    normals, centroids, sums = np.zeros((n_polygon, 3)), np.zeros((n_polygon, 3)), np.zeros((n_polygon, 2))
    sum_by_polygon(vertices, within_range(vertices), faces, polygons, normals, centroids, sums)
    is_flat = (sums[:, 1] == 0.0)[polygons]
    if is_flat.any():
        of_flat, centers = polygons[is_flat], vertices[faces[is_flat]].sum(axis=1) / 3.0
        for axis in range(3):
            centroids[:, axis] += np.bincount(of_flat, centers[:, axis], n_polygon)
        centroids /= np.maximum(np.bincount(of_flat, minlength=n_polygon), 1)[:, None]
    return normals, centroids


def split_creases(
    vertices: ArrayLike,
    faces: ArrayLike,
    crease_angle: float,
    weighting: Weighting = "angle",
    smoothing: ArrayLike | None = None,
    workers: Workers | None = None,
    fans: Fans | None = None,
) -> Split:
    """Split each vertex so that faces that meet at more than the crease angle have normals of their own.

    The corners at a vertex are joined by walking across the edges at that vertex. Two faces that share an
    edge are joined if the angle between their normals is at most the crease angle, where 0.0005 degrees more
    are still equal. Of an edge with more than two faces all pairs are tried, of one with more than 64 none.
    Where two faces are wound against each other, the normal of one is turned for the comparison and for the average,
    and turned back for its own corners, which get a split vertex of their own. Where the walk contradicts itself
    (Möbius), the first link counts: edges are taken by the index of their far vertex, the pairs of an edge by face.

    Joined corners share the weighted average of their normals; where it cancels, each keeps its own face's.
    Faces without area join and add nothing; their corners take the first split vertex of the vertex.

    Parameters
    ----------
    vertices : (n_vertex, 3) real, scene units
    faces : (n_face, 3) integer, counter-clockwise seen from outside
    crease_angle : float, degrees, 0 to 180; without effect if smoothing groups are given
    weighting : "angle" of the face's corner, "area" of the face, or "uniform"
    smoothing : (n_face,) integer or None; then two faces that share an edge are joined if both are in the
        same group, and group 0 joins nothing
    workers : Workers, threads to split on; None = the caller's alone
    fans : those of the faces, see `list_fans`; None = they are listed

    Returns
    -------
    Split, without the vertices that no face uses

    Source: creases: Gouraud 1971; angle weights: Thürmer & Wüthrich 1998, J. Graphics Tools 3(1), 43-46.
    """
    vertices = within_range(np.ascontiguousarray(vertices, np.float64))
    faces = np.ascontiguousarray(faces, np.uint32)
    groups = np.ascontiguousarray([] if smoothing is None else smoothing, np.int32)
    rule = CreaseRule(groups, smooth_cosine(crease_angle), WEIGHTINGS.index(weighting))
    fans, workers = fans or list_fans(faces, len(vertices)), workers or Workers(1)
    columns = np.empty((3, len(faces)), np.uint32)
    # No corner has more than one split vertex: those of a part have room where its corners are in the fans. What isn't
    # written of these takes no memory.
    source, normals = np.empty(faces.size, np.uint32), np.empty((faces.size, 3))

    def split_part(part: tuple[int, int]) -> int:
        """Split the fans of a part of the vertices; number the split vertices from 0; return how many there are."""
        n, n_measured, start = fans.valence, max(_BLOCK, fans.valence), fans.first[part[0]]
        corners = FanCorners(np.empty((n_measured, 4)), *np.empty((3, n_measured), np.uint32))
        scratch = FanScratch(
            np.zeros(16 * _BLOCK), corners, np.empty(n, np.uint32), np.empty(2 * n, np.int64), np.empty(n, np.uint32),
            np.empty(n, np.int64), np.empty((n, 4)), np.empty((n, 2), np.int64),
        )  # fmt: skip
        return split_fans(vertices, fans, rule, scratch, part, columns, source[start:], normals[start:])

    parts, n_split, n_before = workers.ranges(len(vertices), _PART), 0, np.zeros(len(vertices), np.uint32)
    for part, n in zip(parts, workers.map(split_part, parts), strict=True):
        if n_split > 0:  # close the gap before this part
            start, here = fans.first[part[0]], slice(n_split, n_split + n)
            source[here], normals[here] = source[start : start + n], normals[start : start + n]
            n_before[slice(*part)] = n_split
        n_split += n

    def number(part: tuple[int, int]) -> None:
        """Count the split vertices before those of the faces' own parts, too, a few at a time: that takes no memory."""
        for start in range(*part, _PART):
            here = slice(start, min(start + _PART, part[1]))
            columns[:, here] += n_before.take(faces[here].T)

    if len(parts) > 1:
        workers.map(number, workers.ranges(len(faces)))
    return Split(columns.T, source[:n_split], normals[:n_split])


def fill_normals(
    vertices: NDArray[np.float64],
    faces: NDArray[np.uint32],
    normals: NDArray[np.float64],
    crease_angle: float,
    weighting: Weighting,
    smoothing: NDArray[np.int32] | None,
) -> NDArray[np.float64]:
    """Compute the normals that are zero from the faces, up to the creases: as where a mesh has none.

    Parameters
    ----------
    normals : (n_vertex, 3), or (n_face, 3, 3) for each corner
    crease_angle, weighting, smoothing : as in `split_creases`

    Returns
    -------
    normals of the same shape; of each corner where a vertex needs several. Zero where only faces without area meet
    """
    split = split_creases(vertices, faces, crease_angle, weighting, smoothing)
    is_zero: NDArray[np.bool_] = np.logical_not(normals.any(axis=-1))
    if normals.ndim == 2:
        n_split = np.bincount(split.source, minlength=len(vertices))
        if n_split[is_zero].max() <= 1:
            filled, chosen = normals.copy(), is_zero[split.source]
            filled[split.source[chosen]] = split.normals[chosen]
            return filled
        normals, is_zero = normals[faces], is_zero[faces]
    return np.where(is_zero[..., None], split.normals[split.faces], normals)


def smooth_cosine(crease_angle: float) -> float:
    """Return the least cosine of the angle between faces that is no crease, for `is_smooth`.

    Parameters
    ----------
    crease_angle : degrees, 0 to 180. Faces that meet at exactly this angle are no crease, where 0.0005 degrees more are
        still equal
    """
    # Cosines fall where angles grow.
    return math.cos(math.radians(min(180.0, crease_angle + _ANGLE_SLACK))) - _DOT_ERROR


@helper
def is_smooth(cosine, least):
    """Tell whether an edge between two faces is no crease: numbers in kernels, or arrays.

    Parameters
    ----------
    cosine : of the angle between the faces' unit normals, wound alike
    least : `smooth_cosine` of the crease angle
    """
    return cosine >= least


def within_range(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return vertices of which areas can be computed: times a power of two where fourth powers of edges, which are the
    squares of areas, might leave float64. Directions, angles and the areas' shares stay what they are.

    Edges are at most 2^202, and from 2^-200 on down to the rounding of coordinates, 2^-253; 2^1024 and 2^-1022 are the
    limits of float64.
    """
    largest = max(float(vertices.max(initial=0.0)), -float(vertices.min(initial=0.0)))
    exponent = math.frexp(largest)[1]  # 0 of what isn't finite
    if largest == 0.0 or -_MAX_EXPONENT <= exponent <= _MAX_EXPONENT:
        return vertices
    return np.ldexp(vertices, -exponent)


def list_fans(faces: NDArray[np.uint32], n_vertex: int) -> Fans:
    """List the corners of a mesh by vertex; `faces` is (n_face, 3), contiguous."""
    corner_vertices, first = faces.reshape(-1), np.zeros(n_vertex + 2, dtype=np.uint32)
    corners = np.empty(len(corner_vertices), dtype=np.uint32)
    return Fans(corner_vertices, first, corners, list_corners(corner_vertices, first, corners))


# --- kernels -------------------------------------------------------------------------------------------------


@kernel
def sum_by_polygon(vertices, scaled, faces, polygons, out_normals, out_centroids, out_sums):
    """Sum the area vectors by polygon and bring them to unit length, where they are more than rounding; average the
    centres of the triangles by their areas.

    vertices and scaled, of which areas can be computed, (n_vertex, 3) f64, faces (n_face, 3) u32, polygons (n_face,)
    u32; out_normals and out_centroids (n_polygon, 3) f64 come in as zero, and so does out_sums (n_polygon, 2) f64: the
    size that the rounding is relative to, and twice the area. Where that is 0, the centroid stays zero.
    """
    for face in range(len(faces)):
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        p0, p1 = vector_of_row(scaled, a), vector_of_row(scaled, b)
        area, scale, _ = _area_vector(p0, p1, vector_of_row(scaled, c))
        polygon, size = polygons[face], length(area)
        out_sums[polygon, 0] += scale
        out_sums[polygon, 1] += size
        for axis in range(3):
            out_normals[polygon, axis] += area[axis]
            center = (vertices[a, axis] + vertices[b, axis] + vertices[c, axis]) / 3.0
            out_centroids[polygon, axis] += size * center
    for polygon in range(len(out_normals)):
        size, total = length(vector_of_row(out_normals, polygon)), out_sums[polygon, 1]
        has_area = size > _FLAT * out_sums[polygon, 0]
        for axis in range(3):
            out_normals[polygon, axis] = out_normals[polygon, axis] / size if has_area else 0.0
            out_centroids[polygon, axis] = out_centroids[polygon, axis] / total if total > 0.0 else 0.0


@kernel
def list_corners(corner_vertices, out_first, out_corners):
    """Sort the corners by vertex, each vertex's in their order; return the most that one vertex has.

    corner_vertices (n_corner,) u32; out_corners (n_corner,) u32: those of vertex v are
    out_corners[out_first[v] : out_first[v + 1]]; out_first (n_vertex + 2,) u32 comes in as zero, its last
    entry is working space.
    """
    # Count two entries further on: one for the running sum, one because filling moves each start to its end.
    for corner in range(len(corner_vertices)):
        out_first[corner_vertices[corner] + 2] += np.uint32(1)
    valence = 0
    for slot in range(2, len(out_first)):
        valence = max(valence, np.int64(out_first[slot]))
        out_first[slot] += out_first[slot - 1]
    for corner in range(len(corner_vertices)):
        slot = corner_vertices[corner] + 1
        out_corners[out_first[slot]] = corner
        out_first[slot] += np.uint32(1)
    return valence


@kernel
def split_fans(vertices, fans, rule, scratch, part, out_columns, out_source, out_normals):
    """Join the corners of each fan into groups, and write split vertices for each; return how many.

    Those of the fans of a part of the vertices, (start, end). No corner has more than one.

    vertices (n_vertex, 3) f64; fans: Fans; rule: CreaseRule; scratch: FanScratch; out_columns (3, n_face) u32, the
    split vertex of each corner, numbered from 0; out_source (n,) u32, the vertex that each was split from, and
    out_normals (n, 3) f64, unit length or zero.
    """
    n_split, end, corners = 0, part[0], scratch.corners
    while end < part[1]:
        # Measure one fan, and more up to _BLOCK corners.
        begin, end = end, end + 1
        first = np.int64(fans.first[begin])
        while end < part[1] and np.int64(fans.first[end + 1]) - first <= _BLOCK:
            end += 1
        listed = fans.corners[first : fans.first[end]]
        _measure_corners(vertices, fans.corner_vertices, listed, rule.weighting, scratch.block, corners)
        for vertex in range(begin, end):
            start, stop = np.int64(fans.first[vertex]) - first, np.int64(fans.first[vertex + 1]) - first
            if start == stop:  # no face uses it
                continue
            fan, n_before = _take_fan(start, stop, corners), n_split
            n_fan = len(fan.members)
            is_ring, n_joined = _find_ring(fan, rule, scratch.next)
            total, size = _sum_fan(fan)
            if size > 0.0 and (n_joined == n_fan if is_ring else n_fan == 1):
                out_normals[n_split, 0], out_normals[n_split, 1], out_normals[n_split, 2] = divide(total, size)
                for i in range(n_fan):
                    _set_corner(out_columns, fan.members[i], n_split)
                n_split += 1
            elif n_fan > 0:
                _link_fan(fan, is_ring, rule, scratch)
                _sum_groups(fan, scratch)
                n_split = _write_groups(fan, n_split, scratch, out_normals, out_columns)
            else:
                out_normals[n_split, 0], out_normals[n_split, 1], out_normals[n_split, 2] = 0.0, 0.0, 0.0
                n_split += 1
            # The corners without area take the first of these.
            i = 0
            for slot in range(start, stop if n_fan < stop - start else start):
                if i < n_fan and fan.members[i] == listed[slot]:
                    i += 1
                else:
                    _set_corner(out_columns, listed[slot], n_before)
            for k in range(n_before, n_split):
                out_source[k] = vertex
    return n_split


@helper
def neighbors(corner, corner_vertices):
    """Return the vertices that a corner's face has after and before it."""
    k = corner % 3
    after = corner_vertices[corner - 2 if k == 2 else corner + 1]
    return after, corner_vertices[corner + 2 if k == 0 else corner - 1]


@helper
def _measure_corners(vertices, corner_vertices, corners, weighting, block, out):
    """Measure corners; out: FanCorners. Behind the last of them a block holds what was left there: loops that are as
    long as a block are compiled to half as much code."""
    for first in range(0, len(corners), _BLOCK):
        n = min(_BLOCK, len(corners) - first)
        for k in range(n):
            corner = corners[first + k]
            after, before = neighbors(corner, corner_vertices)
            out.members[first + k], out.after[first + k], out.before[first + k] = corner, after, before
            _set_vector(block, _HERE + k, vector_of_row(vertices, corner_vertices[corner]))
            _set_vector(block, _AFTER + k, vector_of_row(vertices, after))
            _set_vector(block, _BEFORE + k, vector_of_row(vertices, before))
        for k in range(_BLOCK):
            here, after = _get_vector(block, _HERE + k), _get_vector(block, _AFTER + k)
            area, block[_SCALE + k], block[_COSINE + k] = _area_vector(here, after, _get_vector(block, _BEFORE + k))
            block[_SIZE + k] = length(area)
            _set_vector(block, _NORMAL + k, divide(area, block[_SIZE + k]))
        for k in range(_BLOCK):
            size = block[_SIZE + k]
            weight = _angle(size, block[_COSINE + k]) if weighting == _ANGLE else (size if weighting == _AREA else 1.0)
            block[_WEIGHT + k] = weight if size > _FLAT * block[_SCALE + k] else 0.0
        for k in range(n):
            row = first + k
            out.measured[row, 0], out.measured[row, 1], out.measured[row, 2] = _get_vector(block, _NORMAL + k)
            out.measured[row, 3] = block[_WEIGHT + k]


@helper
def _get_vector(block, k):
    """Return the vector whose x is entry k of a block."""
    return block[k], block[k + _NEXT], block[k + _NEXT + _NEXT]


@helper
def _set_vector(block, k, vector):
    """Write it."""
    block[k], block[k + _NEXT], block[k + _NEXT + _NEXT] = vector


@helper
def _take_fan(start, stop, corners):
    """Return those of the measured corners start..stop that have an area; they are moved to the front of these."""
    end = start
    for row in range(start, stop):
        if corners.measured[row, 3] > 0.0:
            if end < row:
                corners.members[end] = corners.members[row]
                corners.after[end], corners.before[end] = corners.after[row], corners.before[row]
                for column in range(4):
                    corners.measured[end, column] = corners.measured[row, column]
            end += 1
    here = slice(start, end)
    return FanCorners(corners.measured[here], corners.members[here], corners.after[here], corners.before[here])


@helper
def _find_ring(fan, rule, out_next):
    """Find out whether a walk round the vertex, from each corner across the edge that it leaves along, leads through
    all corners and back to the first: that says that they are wound alike, and that no edge has more than two.

    Return that, and how many of the edges are no creases; out_next (n,) u32, the corner that each leads to, its own at
    a crease, where it is a ring. Large fans aren't tried.
    """
    n_fan, n_joined, here = len(fan.members), 0, 0
    if n_fan > _MAX_RING:
        return False, n_joined
    for i in range(n_fan):
        far, found = fan.after[i], n_fan
        for k in range(n_fan):  # without a jump at the one that is found, which the processor couldn't foresee
            found = k if fan.before[k] == far else found
        if found == n_fan:
            return False, n_joined
        out_next[i] = found
    for step in range(n_fan):
        here = np.int64(out_next[here])
        if (here == 0) != (step + 1 == n_fan):
            return False, n_joined
    for i in range(n_fan):
        is_joined = _are_joined(i, np.int64(out_next[i]), 1, rule, fan)
        out_next[i] = out_next[i] if is_joined else i
        n_joined += is_joined
    return n_fan > 0, n_joined


@helper
def _sum_fan(fan):
    """Sum the weighted normals of a fan whose corners are wound alike; also return their sum's length, 0 where they
    cancel; fan: FanCorners."""
    x, y, z, weights = 0.0, 0.0, 0.0, 0.0
    for i in range(len(fan.members)):
        weight = fan.measured[i, 3]
        x += weight * fan.measured[i, 0]
        y += weight * fan.measured[i, 1]
        z += weight * fan.measured[i, 2]
        weights += weight
    size = length((x, y, z))
    return (x, y, z), size if size > _CANCELLED * weights else 0.0


@helper
def _link_fan(fan, is_ring, rule, scratch):
    """Unite the corners of a fan across every edge that isn't a crease; fan: FanCorners, scratch: FanScratch."""
    n_fan = len(fan.members)
    for i in range(n_fan):
        scratch.parents[i], scratch.signs[i] = i, 1
    if is_ring:  # the order of the links is of no consequence
        for i in range(n_fan):
            _unite(scratch.parents, scratch.signs, i, scratch.next[i], 1)
        return
    keys = scratch.keys[: 2 * n_fan]
    for i in range(n_fan):
        keys[2 * i] = np.int64(fan.after[i]) << 32 | i << 1 | 1
        keys[2 * i + 1] = np.int64(fan.before[i]) << 32 | i << 1
    sort(keys)
    end = 0
    is_surface = True
    for a in range(len(keys)):
        if a == end:  # the corners at one edge stand side by side
            end = a + 1
            while end < len(keys) and keys[a] >> 32 == keys[end] >> 32:
                end += 1
            is_surface = end - a <= _MAX_AT_EDGE
        i = (keys[a] & 0xFFFFFFFF) >> 1
        for b in range(a + 1, end if is_surface else a + 1):
            j = (keys[b] & 0xFFFFFFFF) >> 1
            sign = 1 if (keys[a] ^ keys[b]) & 1 else -1
            if _are_joined(i, j, sign, rule, fan):
                _unite(scratch.parents, scratch.signs, i, j, sign)


@helper
def _are_joined(i, j, sign, rule, fan):
    """Tell whether the edge between two corners of a fan is no crease; `sign` is 1 where they are wound alike, else -1;
    fan: FanCorners."""
    if len(rule.smoothing) > 0:
        group = rule.smoothing[fan.members[i] // 3]
        return group != 0 and group == rule.smoothing[fan.members[j] // 3]
    cosine = sign * dot(vector_of_row(fan.measured, i), vector_of_row(fan.measured, j))
    return is_smooth(cosine, rule.smooth_cosine)


@helper
def sort(keys):
    """Sort in place: an insertion sort for the usual dozen, and not quadratic at the apex of a cone.

    Source: Shell 1959, CACM 2(7), 30-32, with the gaps of Knuth, TAOCP 3, 5.2.1.
    """
    gap = 1
    while gap < len(keys) // 9:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(gap, len(keys)):
            key, slot = keys[i], i
            while slot >= gap and keys[slot - gap] > key:
                keys[slot] = keys[slot - gap]
                slot -= gap
            keys[slot] = key
        gap //= 3


@helper
def _find(parents, signs, i):
    """Return the root of a corner's group and whether both are wound alike (1) or not (-1), halving the path.

    signs[i] compares corner i with its parent; a root is its own parent, with sign 1.
    Source: Tarjan & van Leeuwen 1984, JACM 31(2), 245-281.
    """
    sign = 1
    while parents[i] != i:
        signs[i] *= signs[parents[i]]
        parents[i] = parents[parents[i]]
        sign *= signs[i]
        i = parents[i]
    return i, sign


@helper
def _unite(parents, signs, i, j, sign):
    """Unite the groups of two corners, the lower root on top; inside a group the first link counts."""
    root_i, sign_i = _find(parents, signs, i)
    root_j, sign_j = _find(parents, signs, j)
    if root_i != root_j:
        low, high = min(root_i, root_j), max(root_i, root_j)
        parents[high], signs[high] = low, sign * sign_i * sign_j


@helper
def _sum_groups(fan, scratch):
    """Sum each group's weighted normals, turned to its root's side, and its weights; clear its split vertices. Every
    corner's parent is its root then; fan: FanCorners, scratch: FanScratch."""
    measured, sums = fan.measured, scratch.sums
    for i in range(len(measured)):
        scratch.split_of[i, 0], scratch.split_of[i, 1] = -1, -1
        for column in range(4):
            sums[i, column] = 0.0
    for i in range(len(measured)):
        root, sign = _find(scratch.parents, scratch.signs, i)
        scratch.parents[i], scratch.signs[i] = root, sign
        for axis in range(3):
            sums[root, axis] += sign * measured[i, 3] * measured[i, axis]
        sums[root, 3] += measured[i, 3]


@helper
def _write_groups(fan, n_split, scratch, out_normals, out_columns):
    """Write a split vertex for each side of a group, or for each corner where the group's normals cancel; return how
    many there are then; fan: FanCorners, scratch: FanScratch."""
    sums, split_of = scratch.sums, scratch.split_of
    for i in range(len(fan.members)):
        root, sign = scratch.parents[i], scratch.signs[i]
        size = length(vector_of_row(sums, root))
        has_average = size > _CANCELLED * sums[root, 3]
        side = (sign + 1) >> 1
        if not has_average or split_of[root, side] < 0:
            split_of[root, side] = n_split
            for axis in range(3):
                out_normals[n_split, axis] = sign * sums[root, axis] / size if has_average else fan.measured[i, axis]
            n_split += 1
        _set_corner(out_columns, fan.members[i], split_of[root, side])
    return n_split


@helper
def _set_corner(columns, corner, value):
    """Write what a corner has in (3, n_face) columns."""
    columns[corner % 3, corner // 3] = value


@helper
def _angle(sine, cosine):
    """Return the angle, 0 to π, that has this sine and cosine, both times the same number: to 2^-51 of itself, for
    needles and caps, too; as vector instructions. The sine is no less than 0.

    Of the smaller of both over the larger, t <= 1, it is the arc tangent, or what that leaves of a right angle. Beyond
    t = tan π/8 it is π/4 + atan((t - 1)/(t + 1)). Within, atan t = t + t³ P(t²) with the polynomial that is right at
    the 11 Chebyshev points of 0..tan² π/8, and wrong by less than 2^-57 of the angle between.
    """
    width = abs(cosine)
    low, high = min(sine, width), max(sine, width)
    is_wide = low > 0.41421356237309503 * high
    t = (low - high if is_wide else low) / (low + high if is_wide else high)
    z = t * t
    z2 = z * z
    z4 = z2 * z2
    p0 = (-0.3333333333333333 + 0.1999999999999552 * z) + (-0.14285714284666542 + 0.11111111015256361 * z) * z2
    p4 = (-0.09090904578123903 + 0.07692183190826087 * z) + (-0.06664511447381948 + 0.0585814891280221 * z) * z2
    p8 = (-0.0508544973794026 + 0.03923165829558719 * z) + -0.01917688711906226 * z2
    arc = t + t * z * (p0 + (p4 + p8 * z4) * z4)
    arc = arc + 0.25 * math.pi if is_wide else arc
    arc = 0.5 * math.pi - arc if sine > width else arc
    return math.pi - arc if cosine < 0.0 else arc


@helper
def _area_vector(p0, p1, p2):
    """Return twice the area vector, the product of its edges' lengths, and the edges' dot product at p0.

    The vector is the cross product of the two shorter edges: they enclose the largest angle, so least is lost
    to rounding, and each corner of the face gets the same.
    """
    e0, e1, e2 = subtract(p2, p1), subtract(p0, p2), subtract(p1, p0)
    d0, d1, d2 = dot(e0, e0), dot(e1, e1), dot(e2, e2)
    a, b, scale = e0, e1, d0 * d1
    if d0 >= d1 and d0 >= d2:
        a, b, scale = e1, e2, d1 * d2
    elif d1 >= d2:
        a, b, scale = e2, e0, d2 * d0
    return cross(a, b), math.sqrt(scale), -dot(e1, e2)
