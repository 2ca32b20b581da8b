"""Random scenes whose edges are drawn in the fast way and by the reference: cubes, soups, strips, fans and grids."""

from dataclasses import replace

import numpy as np

import rasterizer as rz
from rasterizer import reference
from rasterizer.choices import CULLS

from .pinhole import octasphere

WIDTHS = (0.5, 1.0, 1.5, 3.0, 8.0)
CHOSEN = (("wire",), ("crease",), ("silhouette",), ("crease", "silhouette"))
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)


def shares_of(picture) -> np.ndarray:
    """The share of each pixel that white edges cover, over a scene without light."""
    return picture.color[..., 1] * picture.alpha


def fast_coverage(scene, size, **settings) -> np.ndarray:
    """The share of each pixel that edges cover."""
    dark = replace(scene, lights=(), background=None)
    return shares_of(rz.render(dark, size, outputs="color", edge_color="white", **{"samples": 1} | settings))


def slow_coverage(scene, size, **settings) -> np.ndarray:
    """The same, of the reference."""
    dark = replace(scene, lights=(), background=None)
    return shares_of(reference.render(dark, size, edge_color="white", **{"samples": 1} | settings))


def random_options(rng) -> dict:
    """Options of a picture with edges."""
    settings = {"edges": CHOSEN[rng.integers(4)], "edge_width": rng.choice(WIDTHS).item()}
    return settings | {"cull": rng.choice(CULLS).item(), "shading": rng.choice(["flat", "gouraud"]).item()}


def random_camera(rng) -> rz.Camera:
    """A camera outside, inside, along an axis, or whose planes cut the scene."""
    kind, way, target = rng.integers(5), rng.normal(size=3), 0.2 * rng.normal(size=3)
    way /= np.linalg.norm(way)
    if kind == 0:
        return rz.Camera.orthographic(way * rng.uniform(2, 6), target, height=rng.uniform(2, 5))
    if kind == 1:
        return rz.Camera.perspective(way * rng.uniform(0.3, 1.5), target, fov=rng.uniform(40, 110))
    if kind == 2:
        near, far = rng.uniform(2.5, 4), rng.uniform(4.5, 6)
        return rz.Camera.perspective(way * rng.uniform(3, 6), target, fov=rng.uniform(20, 60), near=near, far=far)
    if kind == 3:
        axis = np.eye(3)[rng.integers(3)] * rng.choice([-1, 1])
        return rz.Camera.orthographic(6 * axis, height=5.0)
    return rz.Camera.perspective(way * rng.uniform(3, 6), target, fov=rng.uniform(15, 60))


def _rotation(rng) -> np.ndarray:
    matrix, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return matrix * np.sign(np.linalg.det(matrix))


def _cube(center, half, rotation=None) -> rz.Mesh:
    rotation = np.eye(3) if rotation is None else rotation
    return rz.Mesh(half * CORNERS @ rotation.T + center, QUADS)


def _cubes(rng) -> list:
    return [_cube(rng.uniform(-0.8, 0.8, 3), rng.uniform(0.2, 0.9), _rotation(rng)) for _ in range(3)]


def _aligned(_) -> list:
    return [_cube((0, 0, 0), 1), _cube((0, 2, 0), 0.5), _cube((0.5, -1.5, 0.5), 0.5)]


def _soup(rng) -> list:
    """Triangles of all sizes, which cross each other; some have no area."""
    vertices = rng.uniform(-1.2, 1.2, (14, 1, 3)) + rng.normal(size=(14, 3, 3)) * rng.uniform(0.1, 0.8, (14, 1, 1))
    vertices[0, 2], vertices[1, 2] = vertices[0, 1], 0.5 * (vertices[1, 0] + vertices[1, 1])
    return [rz.Mesh(vertices.reshape(-1, 3), np.arange(42).reshape(-1, 3))]


def _fans(rng) -> list:
    """Several triangles at one edge, wound as it comes."""
    return [_fan(rng), _fan(rng)]


def _fan(rng) -> rz.Mesh:
    n = rng.integers(3, 6)
    faces = [(0, 1, 2 + k) if rng.random() < 0.5 else (1, 0, 2 + k) for k in range(n)]
    return rz.Mesh(rng.normal(size=(n + 2, 3)), faces)


def _grid(rng) -> list:
    across = np.linspace(-1.3, 1.3, 5)
    vertices = np.array([(x, y, 0.35 * rng.normal()) for x in across for y in across]) @ _rotation(rng).T
    corners = [5 * i + j for i in range(4) for j in range(4)]
    return [rz.Mesh(vertices, [face for a in corners for face in ((a, a + 5, a + 6), (a, a + 6, a + 1))])]


def _sphere(rng) -> list:
    vertices, faces = octasphere(2)
    ball = rz.Mesh(rng.uniform(0.4, 1) * np.asarray(vertices) + 0.3 * rng.normal(size=3), faces)
    return [ball, _cube(rng.uniform(-0.5, 0.5, 3), 0.4, _rotation(rng))]


def _moebius(_, n: int = 24, half: float = 0.4) -> list:
    """A strip that is wound against itself at one place, whichever way its triangles are wound."""
    angles = np.linspace(0, 2 * np.pi, n, endpoint=False)
    radius = 1 + half * np.stack([-np.cos(angles / 2), np.cos(angles / 2)], axis=1)
    height = half * np.stack([-np.sin(angles / 2), np.sin(angles / 2)], axis=1)
    vertices = np.stack([radius * np.cos(angles)[:, None], radius * np.sin(angles)[:, None], height], axis=2)
    faces = [face for k in range(0, 2 * n - 2, 2) for face in ((k, k + 1, k + 3), (k, k + 3, k + 2))]
    return [rz.Mesh(vertices.reshape(-1, 3), [*faces, (2 * n - 2, 2 * n - 1, 0), (2 * n - 2, 0, 1)])]


KINDS = {
    "cubes": _cubes,
    "aligned": _aligned,
    "soup": _soup,
    "fans": _fans,
    "grid": _grid,
    "sphere": _sphere,
    "moebius": _moebius,
}
