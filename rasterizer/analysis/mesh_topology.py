"""What the triangles of a mesh make together: whether they close a volume and how many bodies they are.

    points, triangles ─ weld ─ edges ─┬─ open, branching, turned round: watertight?
                                      └─ faces that share one: bodies

Vertices at one position are one here, as formats repeat them. A triangle two of whose corners are one has no edges that
count.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..geometry.weld import unique_rows

_FACES = 1 << 20  # looked at in one go


class Topology(NamedTuple):
    """Say how triangles are joined.

    Parameters
    ----------
    n_vertex : different positions that triangles use
    n_edge : different edges
    n_open : edges of an odd number of triangles, as at the border of a hole
    n_branching : edges of more than two triangles
    n_turned : edges that two triangles run through in the same direction, so that one of them is turned round
    n_degenerate : triangles two of whose corners are at one position
    n_body : parts that share no edge
    area : of all triangles, square scene units
    volume : cubic scene units; None where the mesh is not watertight, or triangles are turned round
    """

    n_vertex: int
    n_edge: int
    n_open: int
    n_branching: int
    n_turned: int
    n_degenerate: int
    n_body: int
    area: float
    volume: float | None

    @property
    def is_watertight(self) -> bool:
        """Whether every edge has triangles on both sides: there is an inside."""
        return self.n_edge > 0 and self.n_open == 0


def compute_topology(points: NDArray[np.float64], faces: NDArray) -> Topology:
    """Look at how triangles are joined.

    Parameters
    ----------
    points : (n_vertex, 3) float64, finite
    faces : (n_face, 3) integers, legal indices of points

    Returns
    -------
    Topology
    """
    _, position = unique_rows(points)
    corners = position.astype(np.int64)[faces]
    n_vertex = int(np.count_nonzero(np.bincount(corners.reshape(-1))))
    following = np.roll(corners, -1, axis=1)
    is_whole = (corners != following).all(axis=1)
    corners, following = corners[is_whole], following[is_whole]
    # Both directions of an edge have one key; an edge's entries become neighbours.
    keys = (np.minimum(corners, following) * (position.max() + 1) + np.maximum(corners, following)).reshape(-1)
    order = np.argsort(keys, kind="stable")
    keys, is_forward = keys[order], (corners < following).reshape(-1)[order]
    begins = np.flatnonzero(np.diff(keys, prepend=-1))
    counts = np.diff(np.append(begins, len(keys)))
    n_forward = np.add.reduceat(is_forward, begins, dtype=np.int64) if len(begins) else counts
    n_open = int(np.count_nonzero(counts % 2))
    n_turned = int(np.count_nonzero((counts % 2 == 0) & (2 * n_forward != counts)))
    owners = order // 3
    is_shared = np.diff(keys) == 0
    area, volume = _measure(points, faces)
    is_oriented = len(begins) > 0 and n_open == n_turned == 0
    return Topology(
        n_vertex=n_vertex,
        n_edge=len(begins),
        n_open=n_open,
        n_branching=int(np.count_nonzero(counts > 2)),
        n_turned=n_turned,
        n_degenerate=int(len(is_whole) - np.count_nonzero(is_whole)),
        n_body=count_components(len(corners), owners[:-1][is_shared], owners[1:][is_shared]),
        area=area,
        volume=abs(volume) if is_oriented else None,
    )


def count_components(n: int, a: NDArray[np.int64], b: NDArray[np.int64]) -> int:
    """Count the connected parts of a graph of `n` nodes, whose edges join the nodes `a` to the nodes `b`.

    In every round each tree is hung on the smallest tree that an edge joins it to, and all trees become flat.

    Source: Shiloach & Vishkin 1982, J. Algorithms 3(1), 57-67, with minima instead of parallel writes.
    """
    root = np.arange(n)
    while len(a):
        root_a, root_b = root[a], root[b]
        is_joined = root_a == root_b
        a, b = a[~is_joined], b[~is_joined]
        low, high = np.minimum(root_a, root_b)[~is_joined], np.maximum(root_a, root_b)[~is_joined]
        np.minimum.at(root, high, low)
        while not np.array_equal(flat := root[root], root):
            root = flat
    return int(np.count_nonzero(root == np.arange(n)))


def _measure(points: NDArray[np.float64], faces: NDArray) -> tuple[float, float]:
    """Return the area of triangles, and the volume that they enclose; inf where they are too large for float64.

    The volume is the sum of the tetrahedra from the middle of the box to each triangle.
    """
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    area = volume = 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        for begin in range(0, len(faces), _FACES):
            a, b, c = ((points - middle)[faces[begin : begin + _FACES, k]] for k in range(3))
            normals = np.cross(b - a, c - a)
            area += 0.5 * float(np.linalg.norm(normals, axis=1).sum())
            volume += float(np.einsum("ij,ij->", a, normals)) / 6.0
    return area, volume
