"""Meshes with known normals, for the tests of normals and creases, and what every split of vertices must hold to."""

import numpy as np

from helpers.arrays import differences


def cube():
    vertices = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return vertices, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def ring(n, z, radius=1.0):
    angles = 2 * np.pi * np.arange(n) / n
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(n, z)])


def cylinder(n):
    """Closed cylinder. Faces: wall (2 n), two caps (n each); vertices: bottom ring, top ring, two centres."""
    vertices = np.vstack([ring(n, 0.0), ring(n, 1.0), [[0, 0, 0], [0, 0, 1]]])
    faces = []
    for i in range(n):
        j = (i + 1) % n
        faces += [(i, j, n + j), (i, n + j, n + i)]
    faces += [(2 * n, (i + 1) % n, i) for i in range(n)]
    faces += [(2 * n + 1, n + i, n + (i + 1) % n) for i in range(n)]
    return vertices, np.array(faces)


def cone(n, height):
    vertices = np.vstack([[[0, 0, height]], ring(n, 0.0)])
    i = np.arange(n)
    return vertices, np.column_stack([0 * i, 1 + i, 1 + (i + 1) % n])


def sphere(n):
    """Sphere of 4 n (n - 1) faces with two open poles."""
    u, v = np.meshgrid(2 * np.pi * np.arange(2 * n) / (2 * n), np.linspace(0.1, np.pi - 0.1, n))
    vertices = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1).reshape(-1, 3)
    row, i = 2 * n * np.arange(n - 1)[:, None], np.arange(2 * n)[None]
    a, b = row + i, row + (i + 1) % (2 * n)
    quads = np.stack([a, a + 2 * n, b + 2 * n, b], axis=-1).reshape(-1, 4)
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.uint32)


def area_of(mesh):
    """The area of all triangles of a mesh."""
    corners = mesh.vertices[mesh.faces]
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2


def corner_normals(split):
    return split.normals[split.faces]


def check_split(vertices, faces, split):
    """Hold a Split to what must always be true."""
    used = split.faces.reshape(-1)
    assert split.faces.dtype == np.uint32 and split.source.dtype == np.uint32
    assert not differences(split.source[split.faces], faces)
    assert not differences(np.unique(used), np.arange(len(split.source)))
    assert not differences(np.sort(split.source), split.source)
    lengths = np.linalg.norm(split.normals, axis=1)
    assert np.all((np.abs(lengths - 1) < 1e-15 * 4) | (lengths == 0))
