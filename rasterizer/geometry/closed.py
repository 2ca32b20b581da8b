"""Which side of each triangle looks into a closed body: nobody who is outside of the body sees it.

    triangles ─ edges, each with two triangles ─ bodies ─ which way round? ─ inner sides

A body is what triangles make that share edges. It is closed where each of its edges has two triangles, which are wound
alike: one goes along the edge, and the other comes back. An edge with more triangles closes nothing: they may belong to
bodies that only touch there. Of a closed body the sign of its volume tells which side of its triangles is outside:

    6 V = Σ a·((b - a) × (c - a))     over its triangles a, b, c, seen from one of its own vertices

A ray from outside enters a body that doesn't cross itself before it leaves it: so the inner side of a triangle is never
the first thing on a ray, whatever else is in the scene. Where a surface crosses itself and turns a part of it inside
out, inner sides can be seen; nothing cheap finds that.

Vertices of borders that stand at one position are one vertex here: files list a vertex several times where its normals
or texture coordinates differ.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import helper, index, kernel
from ..scene.mesh import Mesh
from .vectors import cross, dot, subtract, vector_of_row
from .weld import unique_rows

# What is known of an edge: the direction of the one triangle that has it, from the vertex that lists it or back; that
# there are two, one in each direction; or that there are others, and the body isn't closed.
FORTH, BACK, PAIRED, TORN = (np.uint8(state) for state in range(4))
MANY = 64  # triangles


class EdgeTable(NamedTuple):
    """Edges, each in the list of one of its vertices: those of vertex v are `first[v]` up to `end[v]`.

    That is the lower one; where that has MANY triangles, the one with fewer: nobody shall wait for the tip of a cone.
    Source: Chiba & Nishizeki 1985, "Arboricity and subgraph listing algorithms", SIAM J. Computing 14(1), 210-223.
    """

    valences: NDArray[np.uint32]  # (n_vertex,) triangles; zero to begin with
    first: NDArray[np.uint32]  # (n_vertex + 1,) zero to begin with
    end: NDArray[np.uint32]  # (n_vertex,)
    others: NDArray[np.uint32]  # (3 n_face,) the other vertex
    owners: NDArray[np.uint32]  # (3 n_face,) the first triangle that has the edge
    states: NDArray[np.uint8]  # (3 n_face,)


class Bodies(NamedTuple):
    """Triangles that share edges, as trees: a body has the number of its first triangle, which is the root."""

    parents: NDArray[np.uint32]  # (n_face,)
    volumes: NDArray[np.float64]  # (n_face,) at roots: six times the volume, NaN where not closed; zero to begin with
    sizes: NDArray[np.float64]  # (n_face,) at roots: what the rounding of the volume is relative to; zero to begin with


def gather_inner_sides(meshes: Sequence[Mesh]) -> NDArray[np.int8]:
    """Return the inner sides of the triangles of all meshes, see `find_inner_sides`, 0 where materials let something
    through."""
    return np.concatenate([
        find_inner_sides(mesh.vertices, mesh.faces)
        if is_opaque(mesh)
        else np.zeros(mesh.n_face, np.int8)
        for mesh in meshes
    ])  # fmt: skip


def is_opaque(mesh: Mesh) -> bool:
    """Tell whether nothing is seen through a mesh."""
    return all(material.is_opaque for material in mesh.palette)


def find_inner_sides(vertices: NDArray[np.float64], faces: NDArray[np.uint32]) -> NDArray[np.int8]:
    """Find which side of each triangle looks into a closed body.

    Parameters
    ----------
    vertices : (n_vertex, 3) float64
    faces : (n_face, 3) uint32, contiguous

    Returns
    -------
    (n_face,) int8: 1 where that is the side from which it is seen clockwise, -1 where it is the other one, 0 where the
    body isn't closed, or has no volume
    """
    sides, is_border = np.empty(len(faces), np.int8), np.zeros(len(vertices), np.bool_)
    _look_for_bodies(vertices, faces, sides, is_border)
    border = np.flatnonzero(is_border)
    if len(border):
        first, number = unique_rows(vertices[border])
        if len(first) < len(border):
            names = np.arange(len(vertices), dtype=np.uint32)
            names[border] = border[first][number]
            _look_for_bodies(vertices, names[faces], sides, is_border)
    return sides


def _look_for_bodies(vertices: NDArray, faces: NDArray, out_sides: NDArray, out_is_border: NDArray) -> None:
    """Write the inner sides of triangles, and flag the vertices of edges that one triangle has."""
    n_vertex, n_face = len(vertices), len(faces)
    edges = EdgeTable(
        np.zeros(n_vertex, np.uint32), np.zeros(n_vertex + 1, np.uint32), np.empty(n_vertex, np.uint32),
        np.empty(3 * n_face, np.uint32), np.empty(3 * n_face, np.uint32), np.empty(3 * n_face, np.uint8),
    )  # fmt: skip
    bodies = Bodies(np.empty(n_face, np.uint32), np.zeros(n_face), np.zeros(n_face))
    find_bodies(vertices, faces, edges, bodies, out_sides, out_is_border)


@kernel
def find_bodies(vertices, faces, edges, bodies, out_sides, out_is_border):
    """Find the closed bodies of a mesh, and which side of their triangles looks inwards.

    Parameters
    ----------
    vertices : (n_vertex, 3) float64
    faces : (n_face, 3) uint32
    edges : EdgeTable
    bodies : Bodies
    out_sides : (n_face,) int8, see `find_inner_sides`
    out_is_border : (n_vertex,) bool, set at edges that one triangle has
    """
    make_room(faces, edges)
    parents, n_face = bodies.parents, index(len(faces))
    for face in range(n_face):
        parents[face] = face
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        add_side(a, b, face, edges, parents)
        add_side(b, c, face, edges, parents)
        add_side(c, a, face, edges, parents)
    flag_open(edges, bodies, out_is_border)
    sum_volumes(vertices, faces, bodies)
    # Each term is off by 8 roundings of its size, and a sum of n terms by n: 2^-53 of the sizes each.
    rounding = 2.0**-53 * (len(faces) + 16)
    for face in range(n_face):
        body = parents[face]
        volume, doubt = bodies.volumes[body], rounding * bodies.sizes[body]
        out_sides[face] = np.int8(volume > doubt) - np.int8(volume < -doubt)


@helper
def make_room(faces, edges):
    """Give each vertex room for the sides of triangles that it may list."""
    valences, first = edges.valences, edges.first
    for face in range(index(len(faces))):
        for k in range(3):
            valences[faces[face, k]] += np.uint32(1)
    for face in range(index(len(faces))):
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        first[lister(a, b, valences) + index(1)] += np.uint32(1)
        first[lister(b, c, valences) + index(1)] += np.uint32(1)
        first[lister(c, a, valences) + index(1)] += np.uint32(1)
    for vertex in range(index(len(edges.end))):
        edges.end[vertex] = first[vertex]
        first[vertex + index(1)] += first[vertex]


@helper
def lister(a, b, valences):
    """Return which of two vertices lists their edge."""
    low, high = min(a, b), max(a, b)
    return index(high if valences[low] > MANY and valences[high] < valences[low] else low)


@helper
def add_side(start, end, face, edges, parents):
    """Add the side of a triangle that goes from one vertex to another one, and join it with those that have the edge,
    too. A side without length is none."""
    if start == end:
        return
    vertex = lister(start, end, edges.valences)
    other, direction = (end, FORTH) if vertex == start else (start, BACK)
    last = index(edges.end[vertex])
    for k in range(index(edges.first[vertex]), last):
        if edges.others[k] == other:
            is_pair = edges.states[k] + direction == FORTH + BACK
            edges.states[k] = PAIRED if is_pair else TORN
            join(index(face), index(edges.owners[k]), parents)
            return
    edges.others[last], edges.owners[last], edges.states[last] = other, face, direction
    edges.end[vertex] = last + index(1)


@helper
def join(one, other, parents):
    """Make one tree of those of two triangles; its root is the lower of both."""
    one, other = root_of(one, parents), root_of(other, parents)
    parents[max(one, other)] = min(one, other)


@helper
def root_of(face, parents):
    """Return the root of a triangle's tree, and halve the way there.

    Source: Tarjan & van Leeuwen 1984, "Worst-case analysis of set union algorithms", JACM 31(2), 245-281.
    """
    while parents[face] != face:
        parents[face] = parents[index(parents[face])]
        face = index(parents[face])
    return face


@helper
def flag_open(edges, bodies, out_is_border):
    """Flag the bodies that have an edge without its two triangles, and the vertices of those with one."""
    for vertex in range(index(len(edges.end))):
        for k in range(index(edges.first[vertex]), index(edges.end[vertex])):
            if edges.states[k] != PAIRED:
                bodies.volumes[root_of(index(edges.owners[k]), bodies.parents)] = np.nan
                if edges.states[k] != TORN:
                    out_is_border[vertex] = out_is_border[index(edges.others[k])] = True


@helper
def sum_volumes(vertices, faces, bodies):
    """Sum up the volumes of the bodies at their roots, which become the parents of all their triangles."""
    for face in range(index(len(faces))):
        body = root_of(face, bodies.parents)
        bodies.parents[face] = body
        a = vector_of_row(vertices, faces[face, 0])
        ab = subtract(vector_of_row(vertices, faces[face, 1]), a)
        ac = subtract(vector_of_row(vertices, faces[face, 2]), a)
        away = subtract(a, vector_of_row(vertices, faces[body, 0]))
        bodies.volumes[body] += dot(away, cross(ab, ac))
        bodies.sizes[body] += absolute_sum(away) * absolute_sum(ab) * absolute_sum(ac)


@helper
def absolute_sum(a):
    """Return the sum of the absolute values of the components."""
    return abs(a[0]) + abs(a[1]) + abs(a[2])
