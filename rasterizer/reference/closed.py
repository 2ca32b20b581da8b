"""The sides of faces that look into a closed body, which nobody outside of it sees.

In: a mesh. Out: for each face, which of its sides that is. A body is a set of faces that are joined over edges. It is
closed where every edge is a side of two faces that pass it in opposite directions. Its volume tells inside from
outside; where that is no more than rounding, nothing does.
"""

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..scene.mesh import Mesh
from .vectors import dot

Ends = tuple[int, int]


def find_inner_sides(mesh: Mesh) -> NDArray[np.int64]:
    """Return for each face (n_face,) how it is seen from inside of its body: 1 counter-clockwise, -1 clockwise; 0 where
    the body isn't closed, or something is seen through the mesh."""
    sides = np.zeros(mesh.n_face, np.int64)
    if not mesh.is_opaque:
        return sides
    faces = mesh.faces.tolist()
    numbers = range(len(faces))
    owners = list_sides(faces, numbers)
    borders = {end for ends, at in owners.items() if len(at) == 1 for end in ends}
    if borders:
        # Vertices of borders that stand at one position are one.
        first: dict[tuple[float, ...], int] = {}
        names = {vertex: first.setdefault(tuple(mesh.vertices[vertex]), vertex) for vertex in sorted(borders)}
        owners = list_sides([[names.get(vertex, vertex) for vertex in face] for face in faces], numbers)
    is_pair = {ends: len(at) == 2 and at[0][1] != at[1][1] for ends, at in owners.items()}
    at_gaps = {face for ends, at in owners.items() if not is_pair[ends] for face, _ in at}
    for body in list_bodies(mesh.n_face, owners):
        if body.isdisjoint(at_gaps):
            at = np.array(sorted(body))
            sides[at] = -sign_of_volume(mesh.vertices[mesh.faces[at]])
    return sides


def list_sides(faces: list[list[int]], numbers: Iterable[int]) -> dict[Ends, list[tuple[int, bool]]]:
    """List for each edge, by its lower and higher vertex, the numbers of the faces that have it, and whether they go
    from the lower to the higher one. Sides without length are left out."""
    found: dict[Ends, list[tuple[int, bool]]] = {}
    for number, corners in zip(numbers, faces, strict=True):
        for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
            if start != end:
                found.setdefault((min(start, end), max(start, end)), []).append((number, start < end))
    return found


def list_bodies(n_face: int, owners: dict[Ends, list[tuple[int, bool]]]) -> Iterable[set[int]]:
    """Yield the faces of each body."""
    neighbours: list[set[int]] = [set() for _ in range(n_face)]
    for at in owners.values():
        for face, _ in at:
            neighbours[face].update(other for other, _ in at)
    left = set(range(n_face))
    while left:
        body, found = set(), {left.pop()}
        while found:
            body |= found
            found = set().union(*(neighbours[face] for face in found)) - body
        left -= body
        yield body


def sign_of_volume(corners: NDArray) -> int:
    """Return the sign of the volume within closed faces (n, 3, 3), above 0 where they are counter-clockwise seen from
    outside; 0 where it is no more than rounding may be.

    The volume is the sum of tetrahedra from one corner of the body to its faces. Each product of three lengths has an
    error of up to 8·2^-53 of the product of the lengths' absolute sums; the sum itself is exact.
    """
    away, ab, ac = corners[:, 0] - corners[0, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    with np.errstate(all="ignore"):
        terms = dot(away, np.cross(ab, ac))
        sizes = np.abs(away).sum(axis=1) * np.abs(ab).sum(axis=1) * np.abs(ac).sum(axis=1)
    if not np.isfinite(sizes.sum()):
        return 0
    volume, doubt = math.fsum(terms), (len(corners) + 16) * 2.0**-53 * float(sizes.sum())
    return int(volume > doubt) - int(volume < -doubt)
