"""Copies of a mesh: moved, turned, scaled, or of another material."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..choices import AXES, Axis
from ..errors import SceneError, shown
from . import mesh_arrays
from .arrays import VectorLike, plain_array
from .framing import cos_sin
from .material import Material
from .validate import COORDINATE_LIMIT, choice, number, position3, unit3, vector3

if TYPE_CHECKING:
    from .mesh import Mesh


class Movable:
    """The methods of `Mesh` that return another mesh, of which this one is a part."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.uint32]
    normals: NDArray[np.float64] | None

    def transformed(self, matrix: ArrayLike) -> "Mesh":
        """Return a copy that is moved by an affine matrix.

        Normals go by the inverse transpose; a matrix that mirrors also turns the faces' winding round, so
        that the outside stays outside.

        Parameters
        ----------
        matrix : (4, 4) new-from-old, its last row (0, 0, 0, 1)

        Raises
        ------
        SceneError : another shape, values that are not finite, a projective matrix
        ModelError : a matrix that leaves no face an area, or moves vertices out of the legal range
        """
        matrix = _checked_affine(matrix)
        linear = matrix[:3, :3]
        is_mirrored = np.linalg.det(linear) < 0.0
        changes: dict[str, Any] = {"vertices": mesh_arrays.fixed(self.vertices @ linear.T + matrix[:3, 3])}
        if self.normals is not None:
            # the cofactor matrix is the inverse transpose times the determinant; it exists for every matrix
            a, b, c = linear
            cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
            changes["normals"] = self.normals @ (-cofactors.T if is_mirrored else cofactors.T)
        if is_mirrored:
            turn = [0, 2, 1]
            changes["faces"] = self.faces[:, turn]
            for key in ("normals", "uv", "colors"):
                array = changes.get(key, getattr(self, key))
                if array is not None and array.ndim == 3:
                    changes[key] = array[:, turn]
        return replace(cast("Mesh", self), **changes)

    def translated(self, offset: VectorLike) -> "Mesh":
        """Return a copy that is moved by an `offset` of three numbers, scene units.

        Raises
        ------
        SceneError : an offset that is not legal
        ModelError : vertices that leave the legal range
        """
        matrix = np.eye(4)
        matrix[:3, 3] = position3(offset, "the offset")
        return self.transformed(matrix)

    def rotated(self, angle: float, axis: VectorLike | Axis = "y", about: VectorLike = (0, 0, 0)) -> "Mesh":
        """Return a copy that is turned about an axis.

        Parameters
        ----------
        angle : degrees, counter-clockwise as seen from the axis' tip
        axis : three numbers of any length above 0, or "x", "y", "z", "-x", "-y", "-z"
        about : three numbers, a point of the axis, scene units

        Raises
        ------
        SceneError : a value that is not legal
        ModelError : vertices that leave the legal range
        """
        direction = AXES[choice(axis, tuple(AXES), "the axis")] if isinstance(axis, str) else unit3(axis, "the axis")
        return self.transformed(_about(rotation(direction, number(angle, "the angle")), about))

    def scaled(self, factor: float | VectorLike, about: VectorLike = (0, 0, 0)) -> "Mesh":
        """Return a copy that is larger or smaller.

        Parameters
        ----------
        factor : number, or three of them, along x, y and z; not 0. Where an odd number of them is negative, the mesh is
            mirrored, and its outside stays outside
        about : three numbers, the point that stays, scene units

        Raises
        ------
        SceneError : a value that is not legal
        ModelError : vertices that leave the legal range, or no face that has an area left
        """
        is_one = not isinstance(factor, (str, bytes)) and not hasattr(factor, "__len__")
        factors = (number(factor, "the factor"),) * 3 if is_one else vector3(factor, "the factor")
        if 0.0 in factors:
            raise SceneError(f"the factor must not be 0; given {shown(factor)}")
        return self.transformed(_about(np.diag(factors), about))

    def with_material(self, material: Material | str) -> "Mesh":
        """Return a copy all faces of which have one material.

        Parameters
        ----------
        material : Material, or the name of one of the classic table, as `Material.named` takes it

        Raises
        ------
        SceneError : no Material, or an unknown name
        ModelError : a material that needs texture coordinates, which the mesh hasn't
        """
        material = Material.named(material) if isinstance(material, str) else material
        return replace(cast("Mesh", self), material=material, materials=None, face_material=None)


def _about(linear: NDArray[np.float64], about: VectorLike) -> NDArray[np.float64]:
    """Return the affine matrix (4, 4) that leaves a point where it is."""
    point, matrix = np.array(position3(about, "the point that stays")), np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, point - linear @ point
    return matrix


def _checked_affine(matrix: ArrayLike) -> NDArray[np.float64]:
    """Return a 4 × 4 affine matrix as float64."""
    try:
        result = plain_array(matrix)
        result = result.astype(np.float64) if result.dtype.kind in "fiu" else np.empty(0)
    except (TypeError, ValueError):
        result = np.empty(0)
    # Within the limit of coordinates no product of three numbers overflows.
    is_fine = result.shape == (4, 4) and (np.abs(result) <= COORDINATE_LIMIT).all()
    if not is_fine or (result[3] != (0.0, 0.0, 0.0, 1.0)).any():
        raise SceneError(f"the matrix must be affine: (4, 4), finite, the last row (0, 0, 0, 1); given {shown(matrix)}")
    return result


def rotation(axis: ArrayLike, angle: float) -> NDArray[np.float64]:
    """Return the matrix (3, 3) that turns vectors about a unit axis, counter-clockwise as seen from its tip.

    Parameters
    ----------
    axis : (3,) unit vector
    angle : degrees; at multiples of 90 the matrix is exact

    Source: Rodrigues 1840, J. Math. Pures Appl. 5, 380-440: R = cos θ·1 + sin θ·[a]× + (1 - cos θ)·a aᵀ.
    """
    cos, sin = cos_sin(angle)
    x, y, z = np.asarray(axis, np.float64)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return cos * np.eye(3) + sin * across + (1.0 - cos) * np.outer((x, y, z), (x, y, z))
