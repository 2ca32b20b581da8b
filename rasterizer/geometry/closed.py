"""Which side of each triangle looks into a closed body: nobody who is outside of the body sees it.

    triangles ─ edges, each with two triangles ─ bodies ─ which way round? ─ inner sides

A body is what triangles make that share edges. It is closed where each of its edges has two triangles, which are wound
alike: one goes along the edge, and the other comes back. An edge with more triangles closes nothing: they may belong to
bodies that only touch there. Edges are looked at from the vertex with the lower number: what its triangles have there
is sorted by the other vertex. Of a closed body the sign of its volume tells which side of its triangles is outside:

    6 V = Σ a·((b - a) × (c - a))     over its triangles a, b, c, seen from one of its own vertices

A ray from outside enters a body that doesn't cross itself before it leaves it: so the inner side of a triangle is never
the first thing on a ray, whatever else is in the scene. Where a surface crosses itself and turns a part of it inside
out, inner sides can be seen; nothing cheap finds that.

Vertices of borders that stand at one position are one vertex here: files list a vertex several times where its normals
or texture coordinates differ.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiler.kernels import helper, kernel
from .normals import Fans, list_fans, neighbors, sort
from .vectors import cross, dot, subtract, vector_of_row
from .weld import unique_rows


class Bodies(NamedTuple):
    """Triangles that share edges, as trees: a body has the number of its first triangle, which is the root."""

    parents: NDArray[np.uint32]  # (n_face,)
    volumes: NDArray[np.float64]  # (n_face,) at roots: six times the volume, NaN where not closed; zero to begin with
    sizes: NDArray[np.float64]  # (n_face,) at roots: what the rounding of the volume is relative to; zero to begin with


def find_inner_sides(
    vertices: NDArray[np.float64], faces: NDArray[np.uint32], fans: Fans, is_welded: bool = False
) -> NDArray[np.int8]:
    """Find which side of each triangle looks into a closed body.

    Parameters
    ----------
    vertices : (n_vertex, 3) float64
    faces : (n_face, 3) uint32, contiguous
    fans : of these faces, see `list_fans`
    is_welded : whether it is known that no two vertices stand at one position

    Returns
    -------
    (n_face,) int8: 1 where that is the side from which it is seen clockwise, -1 where it is the other one, 0 where the
    body isn't closed, or has no volume
    """
    n_face, sides = len(faces), np.empty(len(faces), np.int8)
    if is_welded and fans.valence < 2:  # no two triangles meet
        return np.zeros(n_face, np.int8)
    while True:
        bodies, is_border = (
            Bodies(np.empty(n_face, np.uint32), *np.zeros((2, n_face))),
            np.zeros(len(vertices), np.bool_),
        )
        find_bodies(vertices, faces, fans, np.empty(2 * fans.valence, np.int64), bodies, sides, is_border)
        if is_welded:
            return sides
        border = np.flatnonzero(is_border)
        first, number = unique_rows(vertices[border])
        if len(first) == len(border):
            return sides
        # Once more, with one vertex at each of their positions.
        names = np.arange(len(vertices), dtype=np.uint32)
        names[border] = border[first][number]
        faces = names[faces]
        fans = list_fans(faces, len(vertices))


@kernel
def find_bodies(vertices, faces, fans, keys, bodies, out_sides, out_is_border):
    """Find the closed bodies of a mesh, and which side of their triangles looks inwards.

    Parameters
    ----------
    vertices : (n_vertex, 3) float64
    faces : (n_face, 3) uint32
    fans : Fans
    keys : (2 * valence,) int64, working space
    bodies : Bodies
    out_sides : (n_face,) int8, see `find_inner_sides`
    out_is_border : (n_vertex,) bool, set at edges that one triangle has
    """
    parents, n_face = bodies.parents, len(faces)
    for face in range(n_face):
        parents[face], out_sides[face] = face, 0
    for vertex in range(len(vertices)):
        join_faces(vertex, keys[: list_edges(vertex, fans, keys)], parents, out_sides, out_is_border)
    for face in range(n_face):
        if out_sides[face] != 0:  # it has an edge that isn't closed
            bodies.volumes[root_of(face, parents)] = np.nan
    sum_volumes(vertices, faces, bodies)
    # Each term is off by 8 roundings of its size, and a sum of n terms by n: 2^-53 of the sizes each.
    rounding = 2.0**-53 * (len(faces) + 16)
    for face in range(n_face):
        body = parents[face]
        volume, doubt = bodies.volumes[body], rounding * bodies.sizes[body]
        out_sides[face] = np.int8(volume > doubt) - np.int8(volume < -doubt)


@helper
def list_edges(vertex, fans, out_keys):
    """List the edges from a vertex to those with higher numbers, once for each triangle that has them; equal ones side
    by side. Return how many are listed.

    A key is the other vertex << 32 | the triangle << 1 | whether it goes there, or comes back. A side without length is
    none.
    """
    n = 0
    for slot in range(fans.first[vertex], fans.first[vertex + 1]):
        corner = fans.corners[slot]
        after, before = neighbors(corner, fans.corner_vertices)
        key = np.int64(corner // 3) << 1
        if after > vertex:
            out_keys[n] = np.int64(after) << 32 | key | 1
            n += 1
        if before > vertex:
            out_keys[n] = np.int64(before) << 32 | key
            n += 1
    sort(out_keys[:n])
    return n


@helper
def join_faces(vertex, keys, parents, out_is_open, out_is_border):
    """Join the triangles of each edge of a vertex. Flag one of those of an edge that isn't closed, and its vertices
    where one triangle has it."""
    end = 0
    while end < len(keys):
        start, n_forth, other = end, 0, keys[end] >> 32
        face = (keys[start] & 0xFFFFFFFF) >> 1
        while end < len(keys) and keys[end] >> 32 == other:
            n_forth += keys[end] & 1
            if end > start:
                join(face, (keys[end] & 0xFFFFFFFF) >> 1, parents)
            end += 1
        if n_forth != 1 or end - start != 2:
            out_is_open[face] = 1
            if end - start == 1:
                out_is_border[vertex] = out_is_border[other & 0xFFFFFFFF] = True


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
        parents[face] = parents[parents[face]]
        face = parents[face]
    return face


@helper
def sum_volumes(vertices, faces, bodies):
    """Sum up the volumes of the bodies at their roots, which become the parents of all their triangles."""
    for face in range(len(faces)):
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
