"""Random meshes of closed bodies, some of them damaged: what the rule of `cull="auto"` has to tell apart."""

from itertools import combinations

import numpy as np

import rasterizer as rz
from helpers.pinhole import octasphere, torus


def hull(rng, n):
    """The convex hull of random points, counter-clockwise seen from outside."""
    points, corners = rng.normal(size=(n, 3)), np.array(list(combinations(range(n), 3)))
    a, b, c = points[corners].transpose(1, 0, 2)
    heights = ((points - a[:, None]) * np.cross(b - a, c - a)[:, None]).sum(axis=2)  # of all points over each triangle
    is_front, is_back = (heights < 1e-12).all(axis=1), (heights > -1e-12).all(axis=1)
    return points, np.concatenate([corners[is_front], corners[is_back][:, ::-1]])


def hole(rng, vertices, faces):
    return vertices, np.delete(faces, rng.integers(len(faces)), axis=0)


def duplicate(rng, vertices, faces):
    return vertices, np.concatenate([faces, faces[[rng.integers(len(faces))]]])


def turned_face(rng, vertices, faces):
    faces = faces.copy()
    at = rng.integers(len(faces))
    faces[at] = faces[at][::-1]
    return vertices, faces


def inside_out(_, vertices, faces):
    return vertices, faces[:, ::-1]


def mirrored(_, vertices, faces):
    return vertices * [-1, 1, 1], faces


def soup(_, vertices, faces):
    """Every face has vertices of its own."""
    return vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)


def seams(rng, vertices, faces):
    """Some corners have vertices of their own."""
    is_own = rng.random(faces.size) < 0.2
    names = np.where(is_own, len(vertices) + np.arange(faces.size), faces.ravel())
    return np.concatenate([vertices, vertices[faces].reshape(-1, 3)]), names.reshape(-1, 3)


def with_shell(_, vertices, faces):
    """A hollow body: a smaller one within looks the other way."""
    middle = vertices.mean(axis=0)
    return np.concatenate([vertices, middle + 0.5 * (vertices - middle)]), np.concatenate([
        faces, faces[:, ::-1] + len(vertices),
    ])  # fmt: skip


def touching(rng, vertices, faces):
    """Two bodies with an edge in common, the other one turned inside out half of the time."""
    start, end, _ = faces[rng.integers(len(faces))]
    twin = vertices[start] + vertices[end] - vertices
    wound = faces if rng.random() < 0.5 else faces[:, ::-1]
    return np.concatenate([vertices, twin]), np.concatenate([faces, wound + len(vertices)])


CHANGES = (
    lambda _, vertices, faces: (vertices, faces), hole, duplicate, turned_face, inside_out, mirrored, soup, seams,
    with_shell, touching,
)  # fmt: skip


def random_body(rng):
    """A body of some proportions somewhere, changed in one way."""
    vertices, faces = (
        lambda: hull(rng, rng.integers(4, 30)),
        lambda: octasphere(int(rng.integers(0, 3))),
        lambda: torus(int(rng.integers(3, 12)), int(rng.integers(3, 8))),
    )[rng.integers(3)]()
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    vertices = vertices @ (turn * np.linalg.det(turn)) * rng.uniform(0.3, 1.2, 3) * rng.choice([1.0, 1.0, 0.05])
    vertices = vertices + rng.normal(size=3) * rng.choice([0.0, 0.3, 1.0])
    return CHANGES[rng.integers(len(CHANGES))](rng, vertices, faces)


def random_bodies(rng, material) -> rz.Mesh:
    """A mesh of up to three bodies, its vertices joined or not, its faces in order or not."""
    vertices, faces = np.empty((0, 3)), np.empty((0, 3), int)
    for _ in range(rng.integers(1, 4)):
        more, wound = random_body(rng)
        vertices, faces = np.concatenate([vertices, more]), np.concatenate([faces, wound + len(vertices)])
    if rng.random() < 0.3:
        vertices, name = np.unique(vertices, axis=0, return_inverse=True)
        faces = name.ravel()[faces]
    if rng.random() < 0.5:
        faces = faces[rng.permutation(len(faces))]
    return rz.Mesh(vertices, faces, material=material, crease_angle=float(rng.choice([0, 30, 180])))


def random_scene(seed) -> rz.Scene:
    """One or two such meshes, seen from outside or inside, with and without clip planes."""
    rng = np.random.default_rng(seed)
    materials = rz.Material(diffuse=(0.8, 0.3, 0.2)), rz.Material(diffuse=0.5), rz.Material(opacity=0.5)
    meshes = [random_bodies(rng, materials[rng.choice(3, p=[0.45, 0.45, 0.1])]) for _ in range(rng.integers(1, 3))]
    eye = rng.normal(size=3)
    eye *= rng.uniform(0.2, 6.0) / np.linalg.norm(eye)
    near = float(rng.uniform(0.1, 5.0)) if rng.random() < 0.2 else None
    far = float((near or 0.0) + rng.uniform(0.5, 6.0)) if rng.random() < 0.2 else None
    target = rng.normal(size=3) * 0.2
    if rng.random() < 0.7:
        camera = rz.Camera.perspective(eye, target, fov=float(rng.uniform(20, 90)), near=near, far=far)
    else:
        camera = rz.Camera.orthographic(eye, target, height=float(rng.uniform(0.5, 4.0)), near=near, far=far)
    return rz.Scene(meshes, [rz.AmbientLight(0.2), rz.DirectionalLight((-1, -2, -0.5), 0.8)], camera)
