"""Normals of faces, polygons and vertices, and the splitting of vertices at creases.

In: vertices (n_vertex, 3) and triangles (n_face, 3), counter-clockwise seen from outside. Out: unit normals;
from `split_creases` new triangles over vertices that carry one normal each. The kernels are in `creases.py`.
"""

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from ..errors import ModelError, SceneError
from ..scene.mesh import DEFAULT_CREASE_ANGLE, WEIGHTINGS
from ..scene.validate import choice, number
from .creases import (
    UNSET,
    CreaseRule,
    Fans,
    SplitVertices,
    average_fans,
    list_corners,
    make_fan_scratch,
    smooth_cosine,
    split_fans,
    sum_by_polygon,
)

_MOST_EXPONENT = 200  # of coordinates, see `within_range`

WeightingName = Literal["angle", "area", "uniform"]


class Split(NamedTuple):
    """Triangles over split vertices, in order of first use; those split from one vertex stand side by side.

    Attributes
    ----------
    faces : (n_face, 3) uint32, the faces as given, as indices of split vertices
    source : (n_split,) uint32, index of the vertex that each was split from
    normals : (n_split, 3) float64, unit length; zero where only faces without area meet
    """

    faces: NDArray[np.uint32]
    source: NDArray[np.uint32]
    normals: NDArray[np.float64]


def face_normals(vertices: ArrayLike, faces: ArrayLike) -> NDArray[np.float64]:
    """Compute the unit normal of every triangle.

    Parameters
    ----------
    vertices : (n_vertex, 3) real, scene units
    faces : (n_face, 3) integer, counter-clockwise seen from outside

    Returns
    -------
    (n_face, 3) float64, unit length; zero for a face without area

    Raises ModelError for wrong shapes and for an index out of range.
    """
    return polygon_normals(vertices, faces, np.arange(len(faces), dtype=np.uint32))


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

    Raises ModelError for wrong shapes and for an index out of range.
    Source: Newell's method in Sutherland, Sproull & Schumacker 1974, ACM Computing Surveys 6(1).
    """
    vertices, faces = _check_mesh(vertices, faces)
    polygons = _check_per_face("polygons", polygons, faces)
    if polygons.size and polygons.min() < 0:
        raise ModelError(f"polygons holds {polygons.min()}; an index can't be negative")
    normals = np.zeros((int(polygons.max()) + 1 if polygons.size else 0, 3))
    sum_by_polygon(vertices, faces, _freeze(polygons, np.uint32), normals, np.zeros(len(normals)))
    return normals


def vertex_normals(vertices: ArrayLike, faces: ArrayLike, weighting: WeightingName = "angle") -> NDArray[np.float64]:
    """Average the normals of the faces round each vertex, across creases and wound as they are.

    Parameters
    ----------
    vertices : (n_vertex, 3) real, scene units
    faces : (n_face, 3) integer, counter-clockwise seen from outside
    weighting : "angle" of the face's corner, "area" of the face, or "uniform"

    Returns
    -------
    (n_vertex, 3) float64, unit length; the first face's where the faces cancel; zero where none has an area

    Raises ModelError for wrong shapes and for an index out of range, SceneError for an unknown weighting.
    Source: angle: Thürmer & Wüthrich 1998, J. Graphics Tools 3(1), 43-46; uniform: Gouraud 1971.
    """
    weighting = WEIGHTINGS.index(choice(weighting, WEIGHTINGS, "weighting"))
    vertices, faces = _check_mesh(vertices, faces)
    normals = np.zeros((len(vertices), 3))
    fans = _list_fans(vertices, faces)
    average_fans(vertices, fans, weighting, make_fan_scratch(fans.valence), normals)
    return normals


def split_creases(
    vertices: ArrayLike,
    faces: ArrayLike,
    crease_angle: float,
    weighting: WeightingName = "angle",
    smoothing: ArrayLike | None = None,
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

    Returns
    -------
    Split, without the vertices that no face uses

    Raises ModelError for wrong shapes and for an index out of range, SceneError for weighting or angle.
    Source: creases: Gouraud 1971; angle weights: Thürmer & Wüthrich 1998, J. Graphics Tools 3(1), 43-46.
    """
    weighting = WEIGHTINGS.index(choice(weighting, WEIGHTINGS, "weighting"))
    if not 0 <= number(crease_angle, "crease_angle") <= 180:
        raise SceneError(f"crease_angle must be 0 to 180 degrees; given {crease_angle}")
    vertices, faces = _check_mesh(vertices, faces)
    groups = np.empty(0) if smoothing is None else _check_per_face("smoothing", smoothing, faces)
    groups = _freeze(groups, np.int32)
    return _split(vertices, faces, CreaseRule(groups, smooth_cosine(crease_angle), weighting))


def _split(vertices: NDArray, faces: NDArray, rule: CreaseRule) -> Split:
    """Split the fans of a mesh, and make room for more split vertices whenever there is none left."""
    fans, split_faces = _list_fans(vertices, faces), np.full(faces.size, UNSET)
    scratch = make_fan_scratch(fans.valence)
    # Room for a smooth mesh; it grows with the creases.
    split = _grow(
        SplitVertices(np.empty(0, np.uint32), np.empty((0, 3))), 0, min(len(vertices), faces.size) + fans.valence
    )
    corner, n_split = split_fans(vertices, fans, rule, scratch, 0, 0, split_faces, split)
    while corner < faces.size:
        split = _grow(split, n_split, n_split + n_split // 2 + fans.valence)
        corner, n_split = split_fans(vertices, fans, rule, scratch, corner, n_split, split_faces, split)
    return Split(split_faces.reshape(-1, 3), split.source[:n_split], split.normals[:n_split])


def _grow(split: SplitVertices, n_split: int, capacity: int) -> SplitVertices:
    """Return room for so many split vertices, with those that there are."""
    larger = SplitVertices(np.empty(capacity, np.uint32), np.empty((capacity, 3)))
    larger.source[:n_split], larger.normals[:n_split] = split.source[:n_split], split.normals[:n_split]
    return larger


def _freeze(array: NDArray, dtype: DTypeLike) -> NDArray:
    """Return a plain, contiguous, read-only view: one array type, so one compiled variant of each kernel."""
    view = np.require(array, dtype, ["C", "A", "E"]).view()
    view.flags.writeable = False
    return view


def _check_mesh(vertices: ArrayLike, faces: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Return vertices as float64 and faces as uint32 for the kernels, or raise ModelError."""
    vertices, faces = np.asarray(vertices), np.asarray(faces)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise ModelError(f"vertices must be (n_vertex, 3) numbers; given shape {vertices.shape}")
    if faces.size == 0:
        faces = np.empty((0, 3), dtype=np.uint32)
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
        raise ModelError(f"faces must be (n_face, 3) integers; given shape {faces.shape}, type {faces.dtype}")
    if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
        worst = faces.min() if faces.min() < 0 else faces.max()
        raise ModelError(f"faces refer to vertex {worst}; the last of the vertices is {len(vertices) - 1}")
    return within_range(_freeze(vertices, np.float64)), _freeze(faces, np.uint32)


def fill_normals(
    vertices: NDArray[np.float64],
    faces: NDArray[np.uint32],
    normals: NDArray[np.float64],
    weighting: WeightingName,
    smoothing: NDArray[np.int32] | None,
) -> NDArray[np.float64]:
    """Compute the normals that are zero from the faces, up to the creases: as where a mesh has none.

    Parameters
    ----------
    normals : (n_vertex, 3), or (n_face, 3, 3) for each corner
    smoothing : (n_face,) smoothing groups; None = creases are at the default angle

    Returns
    -------
    normals of the same shape; of each corner where a vertex needs several. Zero where only faces without area meet
    """
    split = split_creases(vertices, faces, DEFAULT_CREASE_ANGLE, weighting, smoothing)
    is_zero: NDArray[np.bool_] = np.logical_not(normals.any(axis=-1))
    if normals.ndim == 2:
        n_split = np.bincount(split.source, minlength=len(vertices))
        if n_split[is_zero].max() <= 1:
            filled, chosen = normals.copy(), is_zero[split.source]
            filled[split.source[chosen]] = split.normals[chosen]
            return filled
        normals, is_zero = normals[faces], is_zero[faces]
    return np.where(is_zero[..., None], split.normals[split.faces], normals)


def within_range(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return vertices of which areas can be computed: times a power of two where fourth powers of edges, which are the
    squares of areas, might leave float64. Directions, angles and the areas' shares stay what they are.

    Edges are at most 2^202, and from 2^-200 on down to the rounding of coordinates, 2^-253; 2^1024 and 2^-1022 are the
    limits of float64.
    """
    largest = max(float(vertices.max(initial=0.0)), -float(vertices.min(initial=0.0)))
    exponent = math.frexp(largest)[1]  # 0 of what isn't finite
    if largest == 0.0 or -_MOST_EXPONENT <= exponent <= _MOST_EXPONENT:
        return vertices
    return np.ldexp(vertices, -exponent)


def _check_per_face(name: str, values: ArrayLike, faces: NDArray) -> NDArray:
    """Return an array with one integer for each face, or raise ModelError."""
    values = np.asarray(values)
    if values.shape != (len(faces),) or (values.size and values.dtype.kind not in "iu"):
        raise ModelError(f"{name} must be {len(faces)} integers, one a face; given shape {values.shape}")
    return values


def _list_fans(vertices: NDArray, faces: NDArray) -> Fans:
    """List the corners of a mesh by vertex."""
    corner_vertices = faces.reshape(-1)
    first = np.zeros(len(vertices) + 2, dtype=np.uint32)
    corners = np.empty(faces.size, dtype=np.uint32)
    return Fans(corner_vertices, first, corners, list_corners(corner_vertices, first, corners))
