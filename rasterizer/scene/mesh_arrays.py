"""The arrays of a mesh, checked and brought into their stored form: contiguous, of one dtype each, triangles only.

In: what people have: any real dtype, lists, quads, ragged polygons. Out: float64, uint32 and int32 arrays.

What could still be written to is copied first, by `arrays.own_array`, and the copy is checked.
Whole-array checks are minima and maxima, which hand a nan on and need no temporary; the culprit is looked for only once
there is one.
"""

import math
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..choices import Weighting
from ..errors import ModelError, SceneError, shown, warn_caller
from ..vectors import cross, dot
from .arrays import own_array, real_array
from .color import linear_from_srgb_bytes
from .triangulation import CROSSING, TooManyCorners, cut_polygons, listed
from .validate import COORDINATE_LIMIT, UNIT_SLACK

CHUNK = 1 << 16  # faces looked at in one go
_LARGEST = float(np.finfo(np.float64).max)
_INT32_MAX = 2**31 - 1


def checked_vertices(vertices: Any) -> NDArray[np.float64]:
    """Return the vertices as (n_vertex, 3) float64; whether they are finite is looked at later."""
    array = _as_real(vertices, "vertices")
    if array.size == 0:
        raise ModelError("the mesh has no vertices")
    if array.ndim != 2 or array.shape[1] != 3:
        raise ModelError(f"vertices must have the shape (n, 3); given {array.shape}")
    return np.ascontiguousarray(array, dtype=np.float64)


def triangulate(faces: Any, vertices: NDArray[np.float64]) -> tuple[NDArray[np.uint32], NDArray[np.int32] | None]:
    """Cut polygons into triangles, as `triangulation.py` says: fans where they are convex, ears where they are not.

    Parameters
    ----------
    faces : (n, k) integers, k >= 3, or a sequence of polygons of any length >= 3
    vertices : (n_vertex, 3) float64, finite or not

    Returns
    -------
    triangles : (n_face, 3) uint32
    polygons : (n_face,) int32, the polygon that each triangle came from; None where all were triangles

    Raises
    ------
    ModelError : no faces, fewer than 3 corners, indices that are not integers or out of range; concave polygons with
        too many corners

    Warns
    -----
    UserWarning : polygons that cross themselves
    """
    corners, counts = _flattened(faces)
    if len(counts) == 0:
        raise ModelError("the mesh has no faces")
    if counts.min() < 3:
        face = int(np.argmax(counts < 3))
        raise ModelError(f"a face must have at least 3 corners; face {face} has {counts[face]}")
    if corners.min() < 0 or corners.max() >= len(vertices):
        place, last = int(np.argmax((corners < 0) | (corners >= len(vertices)))), len(vertices) - 1
        face = int(np.searchsorted(np.cumsum(counts), place, side="right"))
        legal = f"the mesh has {len(vertices)} vertices, legal is 0..{last}"
        raise ModelError(f"face {face} refers to vertex {corners[place]}; {legal}")
    if counts.max() == 3:
        return np.ascontiguousarray(corners.reshape(-1, 3), dtype=np.uint32), None
    try:
        cut = cut_polygons(vertices, corners, counts)
    except TooManyCorners as refusal:
        raise ModelError(f"face {refusal.polygon} {refusal.fault}") from None
    if len(cut.crossing):
        warn_caller(f"face {listed(cut.crossing)} {CROSSING}")
    return cut.of_corners(corners.astype(np.uint32)), cut.polygons


def _flattened(faces: Any) -> tuple[NDArray, NDArray[np.int64]]:
    """Return all corners one after the other, any integer dtype, and how many each face has."""
    try:
        array = own_array(faces)
    except SceneError:
        raise
    except ValueError:
        if isinstance(faces, np.ndarray):
            raise ModelError(f"faces must be integers, none of them masked; given {shown(faces)}") from None
        array = np.empty(0, dtype=object)  # lists of several lengths
    if array.dtype == object:
        try:
            faces = [tuple(face) for face in faces]
            counts = np.array([len(face) for face in faces], dtype=np.int64)
            corners = np.array(list(chain.from_iterable(faces)))
        except (TypeError, ValueError):
            raise ModelError(f"faces must be lists of vertex indices; given {shown(faces)}") from None
    elif array.size == 0:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    elif array.ndim != 2:
        raise ModelError(f"faces must have the shape (n, 3 or more), or be a list of polygons; given {array.shape}")
    else:
        # broadcast: the counts of a million triangles need no memory
        corners, counts = array.reshape(-1), np.broadcast_to(np.int64(array.shape[1]), len(array))
    if corners.ndim != 1 or corners.dtype.kind not in "iu":
        raise ModelError(f"faces must be integers, the indices of vertices; given {shown(faces)}")
    return corners, counts


def _as_real(values: Any, what: str) -> NDArray:
    """Return an array of a real dtype (bool is none, and objects aren't)."""
    array = real_array(values, own_array)
    if array is None:
        # Of objects only the dtype, which may be cut off, tells that they aren't numbers.
        objects = "objects: " if isinstance(values, np.ndarray) and values.dtype.hasobject else ""
        raise ModelError(f"{what} must be an array of numbers, none of them masked; given {objects}{shown(values)}")
    return array


def _has_bad(array: NDArray, limit: float = _LARGEST) -> bool:
    """Tell whether anything is nan or beyond ±limit, without a temporary: minima and maxima hand a nan on."""
    return array.size > 0 and not (array.min() >= -limit and array.max() <= limit)


def without_unused(vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> tuple[NDArray[np.float64], int]:
    """Return vertices (n, 3) of which those that no face uses are finite, and how many of these were not."""
    if not _has_bad(vertices, COORDINATE_LIMIT):
        return vertices, 0
    is_bad: Any = ~(np.abs(vertices) <= COORDINATE_LIMIT).all(axis=1)
    is_bad[faces] = False
    return np.where(is_bad[:, None], vertices[faces[0, 0]], vertices), int(is_bad.sum())


def without_bad_vertices(
    vertices: NDArray[np.float64], faces: NDArray[np.uint32], polygons: NDArray[np.int32] | None, drop_bad_faces: bool
) -> tuple[NDArray[np.float64], NDArray[np.bool_] | None]:
    """Return vertices that are all finite, and which faces (n_face,) bool to keep; None where that is all."""
    if not _has_bad(vertices, COORDINATE_LIMIT):
        return vertices, None
    is_bad: Any = ~(np.abs(vertices) <= COORDINATE_LIMIT).all(axis=1)
    n_bad, first = int(is_bad.sum()), int(is_bad.argmax())
    fault = f"{n_bad} of {len(vertices)} vertices have coordinates that are not finite or beyond ±{COORDINATE_LIMIT:g}"
    place = f"the first is vertex {first}: {tuple(vertices[first].tolist())}"
    if not drop_bad_faces:
        raise ModelError(f"{fault} (--drop-bad-faces, drop_bad_faces=True, leaves their faces out); {place}")
    is_dropped: Any = is_bad[faces].any(axis=1)
    if polygons is not None:
        is_dropped = np.isin(polygons, polygons[is_dropped])
    if is_dropped.all():
        raise ModelError(f"{fault}, {place}; no face is left without them")
    vertices = vertices.copy()
    vertices[is_bad] = vertices[np.argmin(is_bad)]
    return vertices, ~is_dropped


def has_area(vertices: NDArray, faces: NDArray) -> NDArray[np.bool_]:
    """Tell which triangles have finite corners and an area: (n_face,) bool.

    Parameters
    ----------
    vertices : (n_vertex, 3) of a real dtype, finite or not
    faces : (n_face, 3) integers, legal indices of vertices
    """
    with np.errstate(all="ignore"):
        corners = vertices[faces].astype(np.float64, copy=False)
        edges = corners[:, 1:] - corners[:, :1]
        # relative to the largest component, so that the products neither over- nor underflow
        edges /= np.maximum(np.abs(edges).max(axis=(1, 2), keepdims=True), np.finfo(np.float64).tiny)
        normal = cross(edges[:, 0].T, edges[:, 1].T)
        area = np.sqrt(dot(normal, normal))
        lengths = np.sqrt((edges * edges).sum(axis=2))
        # a cross product of parallel edges is off zero by up to 2 roundings of a product of their lengths
        return area > 4 * np.finfo(np.float64).eps * lengths[:, 0] * lengths[:, 1]


def has_any_area(vertices: NDArray, faces: NDArray) -> bool:
    """Tell whether a triangle has an area, as `has_area` does; the first chunk with one ends the search.

    That is the first triangle of nearly every mesh. It is told in plain numbers where its sides are far from parallel,
    sin² > 1e-6, and no product of theirs leaves float64.
    """
    for a, b, c in vertices[faces[:1]].tolist():
        u, v = (b[0] - a[0], b[1] - a[1], b[2] - a[2]), (c[0] - a[0], c[1] - a[1], c[2] - a[2])
        normal, squares = cross(u, v), (dot(u, u), dot(v, v))
        if 1e-100 < min(squares) and max(squares) < 1e100 and dot(normal, normal) > 1e-6 * math.prod(squares):
            return True
    return any(has_area(vertices, faces[k : k + CHUNK]).any() for k in range(0, len(faces), CHUNK))


def checked_ints(values: Any, counts: tuple[int, ...], what: str) -> NDArray[np.int32]:
    """Return (n,) integers of at least 0 as int32, for one of the legal `counts`."""
    array = _as_real(values, what)
    if array.ndim != 1 or len(array) not in counts or array.dtype.kind not in "iu":
        n = " or ".join(map(str, counts))
        raise ModelError(f"{what} must be integers of the shape ({n},); given {array.shape} {array.dtype}")
    if not (array.min() >= 0 and array.max() <= _INT32_MAX):
        raise ModelError(f"{what} must be within 0..{_INT32_MAX}; given {array.min()}..{array.max()}")
    return np.ascontiguousarray(array, dtype=np.int32)


def checked_floats(
    values: Any, counts: tuple[int, int | None], widths: tuple[int, ...], what: str, is_mended: bool
) -> NDArray[np.float64]:
    """Return (n_vertex, width), or (n_face, 3, width), as finite float64.

    Parameters
    ----------
    counts : n_vertex and n_face; None for the latter where corners may have none
    widths : those that are legal
    is_mended : whether rows that are not finite become zero, instead of raising ModelError
    """
    array = _as_real(values, what)
    n_vertex, n_face = counts
    legal: list[tuple[int, ...]] = [(n_vertex, width) for width in widths]
    legal += [(n_face, 3, width) for width in widths if n_face is not None]
    if array.shape not in legal:
        hint = "" if n_face is not None else " (one a corner only with triangles)"
        raise ModelError(f"{what} must have the shape {' or '.join(map(str, legal))}{hint}; given {array.shape}")
    array = np.ascontiguousarray(array, dtype=np.float64)
    if not _has_bad(array):
        return array
    is_bad = ~np.isfinite(array).all(axis=-1)
    if not is_mended:
        first = ", ".join(str(i) for i in np.argwhere(is_bad)[0])
        raise ModelError(f"{what} must be finite; {is_bad.sum()} of {is_bad.size} are not, the first is number {first}")
    return np.where(is_bad[..., None], 0.0, array)


def checked_colors(
    values: Any, counts: tuple[int, ...], what: str, n_corner_face: int | None = None
) -> NDArray[np.float64]:
    """Return (n, 3 or 4), n one of the `counts`, or (n_corner_face, 3, 3 or 4) unless that is None, linear float64
    colours: uint8 is decoded, float is linear."""
    array = _as_real(values, what)
    is_of_corners = n_corner_face is not None and array.ndim == 3 and array.shape[:2] == (n_corner_face, 3)
    if not (is_of_corners or (array.ndim == 2 and len(array) in counts)) or array.shape[-1] not in (3, 4):
        n = " or ".join(map(str, counts))
        corners = "" if n_corner_face is None else f" or ({n_corner_face}, 3, 3 or 4)"
        raise ModelError(f"{what} must have the shape ({n}, 3 or 4){corners}; given {array.shape}")
    if array.dtype == np.uint8:
        return linear_from_srgb_bytes(array)
    if array.dtype.kind != "f":
        raise ModelError(f"{what} must be uint8 (sRGB) or float (linear); given {array.dtype}")
    if array.size and 2.0 <= array.max() <= 255.0:
        hint = "of 0 to 255 are given as uint8; brighter light than white is a matter of lights and materials"
        raise ModelError(f"{what} of floats are linear, 1 is white; given up to {array.max():g}: numbers {hint}")
    if not (array.min() >= 0.0 and np.isfinite(array.max())):
        raise ModelError(f"{what} must be finite and at least 0; given {array.min()}..{array.max()}")
    return np.ascontiguousarray(array, dtype=np.float64)


def filled_normals(attributes: dict[str, Any], crease_angle: float, weighting: Weighting) -> NDArray[np.float64]:
    """Return a mesh's normals, those that are zero computed from its faces."""
    normals = attributes["normals"]
    if np.einsum("...i,...i", normals, normals).min() > 0.0:
        return normals
    from ..geometry.normals import fill_normals  # only here: it is compiled, and few meshes need it

    faces, smoothing = attributes["faces"], attributes.get("smoothing")
    return fill_normals(attributes["vertices"], faces, normals, crease_angle, weighting, smoothing)


def unit_normals(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a copy of normals (..., 3) with unit length; a zero stays zero, and a unit vector what it is."""
    normals = normals.copy()
    squares = np.einsum("...i,...i", normals, normals)
    if not (1e-200 <= squares.min() and squares.max() <= 1e200):
        # zero, or so short or long that the square lost digits: the largest component becomes 1 first
        largest, is_unit = np.abs(normals).max(axis=-1), np.abs(squares - 1.0) <= UNIT_SLACK
        normals /= np.where((largest > 0.0) & ~is_unit, largest, 1.0)[..., None]
        squares = np.einsum("...i,...i", normals, normals)
        squares[squares == 0.0] = 1.0
    squares[np.abs(squares - 1.0) <= UNIT_SLACK] = 1.0
    normals /= np.sqrt(squares)[..., None]
    return normals
