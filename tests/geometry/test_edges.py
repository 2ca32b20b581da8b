"""The edges of polygons: each once, with the planes on both sides."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from helpers.small_scenes import MODELS

import rasterizer as rz
from rasterizer.engine.edges import join_edges
from rasterizer.geometry.normals import split_creases
from rasterizer.reference.edges import list_edges
from rasterizer.reference.normals import corner_normals


def edges_of(mesh):
    """The edges of one mesh."""
    return join_edges([mesh])


def prism(n: int) -> tuple[np.ndarray, list]:
    """A prism of n quads without its ends."""
    turn = 2 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(turn), np.sin(turn), np.zeros(n)], axis=1)
    return np.concatenate([ring, ring + (0, 0, 1)]), [(k, (k + 1) % n, n + (k + 1) % n, n + k) for k in range(n)]


def list_walls(vertices, quads, form: int):
    """Vertices, faces and polygons: quads, triangles of polygons, triangles alone, or quads that share no vertex."""
    n = len(quads)
    triangles = np.array([corners for a, b, c, d in quads for corners in ((a, b, c), (a, c, d))])
    if form == 3:
        return vertices[np.array(quads)].reshape(-1, 3), np.arange(4 * n).reshape(-1, 4), None
    return vertices, quads if form == 0 else triangles, np.repeat(np.arange(n), 2) if form == 1 else None


@pytest.mark.parametrize("n", range(3, 65))
def test_a_crease_is_drawn_where_normals_are_split_and_not_at_exactly_the_crease_angle(n):
    """Whatever rounding makes of a prism whose angle is the crease angle, or a thousandth of a degree off, and however
    its walls are listed. Triangles without polygons have diagonals, which are none."""
    rng = np.random.default_rng(n)
    points, quads = prism(n)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    moved = 10.0 ** rng.integers(-3, 4) * (points @ turn.T + rng.uniform(-5, 5, 3))
    exact, below, above = 360 / n, 360 / n - 1e-3, min(360 / n + 1e-3, 180.0)
    for number, (angle, dtype) in enumerate(itertools.product((exact, exact, below, above), (np.float64, np.float32))):
        form, n_crease = (n + number + number // 2) % 4, n if angle == below else 0
        vertices, faces, polygons = list_walls(moved.astype(dtype), quads, form)
        mesh = rz.Mesh(vertices, faces, crease_angle=angle, polygons=polygons)
        where = f"{n} sides, {angle} degrees, {dtype.__name__}, form {form}"
        edges, slow = edges_of(mesh), [edge for edge in list_edges(mesh) if not edge.is_open]
        assert edges.is_open.sum() == 2 * n and len(slow) == n + (n if form == 2 else 0), where
        assert edges.is_crease[~edges.is_open].sum() == n_crease, where
        assert sum(edge.is_crease for edge in slow) == n_crease, where
        if form == 3:
            continue  # there is nothing to split
        split = split_creases(mesh.vertices, mesh.faces, angle)
        assert len(split.source) == 2 * n + 2 * n_crease, where
        normals = corner_normals(mesh.vertices, mesh.faces, angle).reshape(-1, 3)
        keys = np.concatenate([mesh.faces.reshape(-1, 1), normals.round(6) + 0.0], axis=1)
        assert len(np.unique(keys, axis=0)) == 2 * n + 2 * n_crease, where


def test_smoothing_groups_decide_where_there_is_no_crease_angle():
    """As in shading: faces of one group have no crease, those of none have, unless they lie in one plane."""
    points, quads = prism(6)
    flat = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    for groups, expected in (([1] * 6, 0), ([1, 1, 1, 2, 2, 2], 2), ([0] * 6, 6), ([1, 0, 1, 1, 1, 1], 2)):
        mesh = rz.Mesh(points, quads, smoothing=groups)
        for angle, n_crease in ((None, expected), (90.0, 0), (10.0, 6)):
            edges, slow = (find(replace(mesh, crease_angle=angle)) for find in (edges_of, list_edges))
            assert edges.is_crease[~edges.is_open].sum() == n_crease, f"{groups}, {angle}"
            assert sum(edge.is_crease for edge in slow if not edge.is_open) == n_crease, f"{groups}, {angle}"
        split = split_creases(mesh.vertices, mesh.faces, 30.0, smoothing=mesh.smoothing)
        shown = np.concatenate([split.source[:, None], split.normals.round(6) + 0.0], axis=1)
        assert len(np.unique(shown, axis=0)) == 12 + 2 * expected, f"{groups}"
    sheet = rz.Mesh(flat, [(0, 1, 2), (0, 2, 3)], smoothing=[0, 0])
    assert edges_of(sheet).is_crease.sum() == 4 == sum(edge.is_crease for edge in list_edges(sheet))


def test_models_of_polygons_have_the_edges_of_euler():
    for name, n_edge in (("cube.obj", 12), ("sphere.obj", None), ("torus.obj", None)):
        (mesh,) = rz.load(MODELS / name).meshes
        edges = edges_of(mesh)
        n_vertex = len(np.unique(mesh.vertices, axis=0))
        n_polygon = mesh.n_face if mesh.polygons is None else len(np.unique(mesh.polygons))
        characteristic = n_vertex - len(edges.ends) + n_polygon
        assert characteristic == (0 if name == "torus.obj" else 2), name
        assert n_edge is None or len(edges.ends) == n_edge
