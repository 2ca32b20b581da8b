"""Subdivision: the same surface in more triangles, and what it cures of Gouraud's faults."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import deviations, differences
from helpers.pinhole import DULL, octasphere, torus, unit
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.geometry.normals import polygon_normals

SIZE = (80, 60)


def load(name, **options):
    return rz.load(ROOT / "models" / name, **options).meshes[0]


def draw(mesh, shading="gouraud", lights=None, camera=None, **options):
    return rz.render(rz.Scene([mesh], lights, camera), SIZE, shading=shading, tolerance=0, **{"samples": 1} | options)


# ---------------------------------------------------------------- geometry


def test_children_tile_their_face_and_share_midpoints():
    for seed in range(20):
        rng = np.random.default_rng(seed)
        faces = np.sort(rng.permuted(np.tile(np.arange(9), (7, 1)), axis=1)[:, :3], axis=1)
        mesh = rz.Mesh(rng.normal(size=(9, 3)), faces)
        finer = mesh.subdivide()
        a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        expected = np.stack(
            [np.stack(child, axis=1) for child in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
        found = finer.vertices[finer.faces].reshape(7, 4, 3, 3)
        assert np.allclose(found, expected.transpose(1, 0, 2, 3), rtol=0, atol=1e-15), f"seed {seed}"
        edges = {tuple(sorted((face[k], face[k - 1]))) for face in mesh.faces.tolist() for k in range(3)}
        assert finer.n_vertex == mesh.n_vertex + len(edges) and finer.n_face == 4 * mesh.n_face
        assert not differences(finer.vertices[:9], mesh.vertices)


def test_closed_meshes_stay_closed_with_their_winding():
    """Of triangles, and of quads."""
    n, m = 8, 6
    vertices, triangles = torus(n, m)
    i, j = np.divmod(np.arange(n * m), m)
    quads = np.stack([i * m + j, (i + 1) % n * m + j, (i + 1) % n * m + (j + 1) % m, i * m + (j + 1) % m], axis=1)
    for faces in (triangles, quads):
        finer = rz.Mesh(vertices, faces).subdivide(2)
        half_edges = np.concatenate([finer.faces[:, [k, (k + 1) % 3]] for k in range(3)])
        assert len(np.unique(half_edges, axis=0)) == len(half_edges) == 3 * 32 * n * m
        assert {tuple(e) for e in half_edges.tolist()} == {tuple(e) for e in half_edges[:, ::-1].tolist()}
        # Euler's characteristic of a torus
        assert finer.n_vertex - len(half_edges) // 2 + finer.n_face == 0 and len(finer.used_vertices) == finer.n_vertex


# ---------------------------------------------------------------- what belongs to it


def test_attributes_go_along():
    rng = np.random.default_rng(1)
    quads = [[0, 1, 2, 3], [3, 2, 4, 5]]
    vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 2, 1], [0, 2, 1]]
    given_ = {
        "colors": rng.uniform(size=(6, 4)), "face_colors": rng.uniform(size=(2, 3)), "smoothing": [3, 0],
        "uv": rng.uniform(size=(6, 2)), "name": "two", "material": DULL,
    }  # fmt: skip
    mesh = rz.Mesh(vertices, quads, **given_)
    copy = {key: np.array(getattr(mesh, key)) for key in ("vertices", "faces", "colors", "uv", "polygons")}
    finer = mesh.subdivide()
    assert (finer.name, finer.material) == ("two", DULL)
    for key in ("face_colors", "smoothing", "polygons"):
        assert np.array_equal(getattr(finer, key), np.repeat(getattr(mesh, key), 4, axis=0)), key
    edges = {tuple(sorted((face[k - 1], face[k]))) for face in mesh.faces.tolist() for k in range(3)}
    groups = [[k] for k in range(6)] + sorted(edges)  # a value is the mean over some vertices
    places = np.array([mesh.vertices[list(group)].mean(axis=0) for group in groups])
    for vertex, *values in zip(finer.vertices, finer.colors, finer.uv, strict=True):
        group = list(groups[np.abs(places - vertex).sum(axis=1).argmin()])
        for key, value in zip(("colors", "uv"), values, strict=True):
            assert np.allclose(value, getattr(mesh, key)[group].mean(axis=0)), key
    assert finer.n_vertex == len(groups)
    assert [(key, array) for key, array in copy.items() if not np.array_equal(getattr(mesh, key), array)] == []
    painted = rz.Mesh(vertices, quads, materials=(DULL, rz.Material()), face_material=[0, 1])
    assert not differences(painted.subdivide().face_material, np.repeat(painted.face_material, 4))
    corners = rng.uniform(size=(4, 3, 2))
    split = replace(mesh, uv=corners)  # the fourth new triangle has the midpoints as corners
    middle = split.subdivide().uv[3::4]
    assert not deviations(middle, (corners + corners[:, [1, 2, 0]]) / 2)


def test_creases_stay_and_round_walls_stay_round():
    """On a cube all corners have their faces' normals; on a smooth mesh one array of the vertices will do."""
    cube = load("cube.obj").subdivide(2)
    expected = polygon_normals(cube.vertices, cube.faces, np.arange(cube.n_face))[:, None].repeat(3, axis=1)
    assert cube.normals.shape == (len(cube.faces), 3, 3)
    assert not deviations(cube.normals, expected, rtol=0, atol=1e-12)
    ball = rz.Mesh(*octasphere(3))
    finer = ball.subdivide()
    assert finer.normals.shape == finer.vertices.shape and finer.crease_angle is None
    cosine = np.sum(finer.normals * unit(finer.vertices), axis=1)
    assert cosine.min() > np.cos(np.radians(2))
    assert not differences(ball.subdivide(2).vertices, finer.subdivide().vertices)
    assert not differences(ball.subdivide(2).normals, finer.subdivide().normals)


# ---------------------------------------------------------------- cures


def floor():
    mesh = replace(load("floor.obj"), material=rz.Material(specular=0.6, shininess=30))
    camera = rz.Camera.perspective((0, 12, 20), (0, 0, 0), fov=50)
    return mesh, (rz.AmbientLight(0.1), rz.PointLight((-3, 10, -12), 0.8)), camera


def ball():
    mesh = rz.Mesh(*octasphere(2), material=rz.Material(specular=0.6, shininess=30))
    return mesh, (rz.AmbientLight(0.1), rz.PointLight((1, 3, 4), 0.8)), rz.Camera.perspective((0, 0, 5), fov=30)


def test_gouraud_comes_nearer_to_phong_each_time():
    for make in (floor, ball):
        mesh, lights, camera = make()
        errors = []
        for times in range(5):
            finer = mesh.subdivide(times)
            errors.append(rz.compare(*(draw(finer, s, lights, camera).color for s in ("gouraud", "phong"))).rms)
        ratios = np.array(errors[1:]) / errors[:-1]
        assert (ratios < 0.9).all() and errors[-1] < 0.25 * errors[0], f"{make.__name__}: rms {np.round(errors, 5)}"


# ---------------------------------------------------------------- what is refused


def test_numbers_of_times_that_are_none_are_refused():
    for times in (-1, 1.0, 16, True, "1", None, 10**30):
        with pytest.raises(rz.SceneError, match="whole number within"):
            load("cube.obj").subdivide(times)
    with pytest.raises(rz.ModelError, match="2147483647 faces; subdivided 15 times, its 12 would be 12884901888"):
        load("cube.obj").subdivide(15)
