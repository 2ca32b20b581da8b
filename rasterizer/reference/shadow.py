"""Shadows: rays from lit points to lights, against every face that light does not go through, in float64.

          light q          A ray is blocked where a face lies strictly between its ends: they lie on different sides
             ·             of the face's plane, and the line p→q passes the three edges of the face on the same side.
         ───·──── face
           ·               Edges, as seen along d = q - p: d·(A × B) for A = a - p, B = b - p. The same edge of the
          p lit            face beside it gives the same number with the other sign, bit by bit: no ray slips through
                           between them.

Every face casts shadows, whether it is culled or out of the picture, but for those whose material isn't opaque.
Source: Segura & Feito 2001, "Algorithms to test ray-triangle intersection", Proc. WSCG, for the test by signed volumes.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..vectors import unit
from .vectors import area_vectors, dot

CHUNK = 2**17  # pairs of rays and faces looked at together: some 40 MB
NO_OWNER = -1  # of a point whose own faces are known by their planes alone


class Casters(NamedTuple):
    """The faces that cast shadows."""

    corners: NDArray[np.float64]  # (n_caster, 3, 3) world
    normals: NDArray[np.float64]  # (n_caster, 3) unit; 0 without an area
    owner: NDArray[np.int64]  # (n_caster,) the face's number, or in flat shading that of its polygon
    on_plane: float  # scene units: a point nearer to a plane than this lies on it
    face: NDArray[np.int64]  # (n_caster,) the faces' numbers
    # Tells of faces (n,) and weights (n, 3) on their corners which points are there; None where all are.
    are_there: Callable[[NDArray, NDArray], tuple[NDArray, NDArray]] | None = None


def gather_casters(corners: NDArray, owner: NDArray, is_opaque: NDArray) -> Casters:
    """Gather the faces that cast shadows.

    Rounding: a point on a face is a weighted sum of its corners, wrong by less than 4·2^-53 R in each coordinate, where
    R is the largest coordinate of the scene. The direction of a face's normal is wrong by some 4·2^-53 R/h, where h is
    the least altitude of the face, so that its distance from a point of the same face is wrong by less than 2^-50
    R·L/h, L its longest side. 2^-40 R allows for slivers up to L/h = 2^10, and is 2^-40 of the scene's extent.

    Parameters
    ----------
    corners : (n_face, 3, 3) float64, world
    owner : (n_face,) int, of what each face is a part
    is_opaque : (n_face,) bool

    Returns
    -------
    Casters
    """
    largest = np.abs(corners).max(initial=0.0)
    corners, face = corners[is_opaque], np.flatnonzero(is_opaque)
    return Casters(corners, unit(area_vectors(corners)), owner[is_opaque], 2.0**-40 * largest, face)


def reaches(casters: Casters, points: NDArray, owner: NDArray, to_light: NDArray, is_finite: bool) -> NDArray[np.bool_]:
    """Tell which points the light reaches.

    A face on whose plane a point (or the light itself) lies is not between them: so neither a vertex's own faces nor
    the one that lies on top of another cast shadows on it.

    Parameters
    ----------
    casters : faces in the way
    points : (n, 3) float64, world
    owner : (n,) int, faces with the same owner are left out; NO_OWNER leaves out none
    to_light : (n, 3) float64: where the light has a place the vectors to it, else directions
    is_finite : whether the light has a place

    Returns
    -------
    (n,) bool
    """
    is_lit = np.ones(len(points), bool)
    step = max(CHUNK // max(len(casters.corners), 1), 1)
    for start in range(0, len(points), step):
        part = slice(start, start + step)
        is_blocked = _crosses(casters, points[part, None], to_light[part, None], is_finite)
        is_lit[part] = ~(is_blocked & (owner[part, None] != casters.owner)).any(axis=1)
    return is_lit


def _crosses(casters: Casters, points: NDArray, to_light: NDArray, is_finite: bool) -> NDArray[np.bool_]:
    """Tell which rays (n, 1, 3) cross which faces, (n, n_caster) bool."""
    a, b, c = (casters.corners[:, corner] - points for corner in range(3))
    height = -dot(a, casters.normals)  # of the point above the face
    end = height + dot(to_light, casters.normals) if is_finite else dot(to_light, casters.normals)
    nearest = casters.on_plane if is_finite else 0.0
    is_between = np.where(height > 0, end < -nearest, end > nearest) & (np.abs(height) > casters.on_plane)
    edges = np.stack([dot(to_light, np.cross(v, w)) for v, w in ((b, c), (c, a), (a, b))])
    is_crossed = is_between & ((edges >= 0).all(axis=0) | (edges <= 0).all(axis=0))
    if casters.are_there is not None:
        ray, caster = np.nonzero(is_crossed)
        volumes = edges[:, ray, caster].T  # each in proportion to the weight of the corner that its edge leaves out
        is_there, _ = casters.are_there(casters.face[caster], volumes / volumes.sum(axis=1, keepdims=True))
        is_crossed[ray, caster] = is_there
    return is_crossed
