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


def test_the_silhouette_stays():
    """Vertices are rounded to 1/256 px, so only samples nearer than that to an outline may change sides."""
    for name in ("torus.obj", "teapot.obj"):
        mesh = load(name)
        camera = rz.Scene([mesh]).camera_for(SIZE)
        before, after = (draw(each, camera=camera, outputs=("depth", "face")) for each in (mesh, mesh.subdivide(2)))
        changed = (before.face >= 0) != (after.face >= 0)
        assert changed.sum() <= 2, f"{name}: {changed.sum()} samples are covered otherwise > 2"
        same = (before.face == after.face // 16) & (before.face >= 0)
        assert same.sum() > 0.99 * (before.face >= 0).sum(), name
        # half a sub-pixel moves a sample of these surfaces by two thousandths of its depth at most, seen at 87 degrees
        assert np.allclose(before.depth[same], after.depth[same], rtol=4e-3), name


# ---------------------------------------------------------------- polygons


def test_values_of_polygons_corners_are_cut_alike():
    """What stands at corners is what stands at vertices, where it is the same; each new triangle knows its polygon."""
    n_corner, rng = 7, np.random.default_rng(7)
    turns = 2 * np.pi * np.arange(n_corner) / n_corner
    vertices = np.stack([np.cos(turns), np.sin(turns), rng.uniform(-0.02, 0.02, n_corner)], axis=1)
    vertices, faces = np.concatenate([vertices, [(2.5, 0, 0)]]), [list(range(n_corner)), [0, n_corner, 1]]
    values = {"uv": rng.uniform(size=(n_corner + 1, 2)), "colors": rng.uniform(size=(n_corner + 1, 3)),
              "normals": unit(rng.normal(size=(n_corner + 1, 3)) + [0, 0, 3])}  # fmt: skip
    whole = rz.Mesh(vertices, faces, face_colors=rng.uniform(size=(2, 3)), **values)
    of_corners = replace(whole, **{name: value[whole.faces] for name, value in values.items()})
    fine, other = whole.subdivide(2), of_corners.subdivide(2)
    assert not differences(fine.faces, other.faces) and not differences(fine.polygons, other.polygons)
    assert not differences(fine.polygons, np.repeat(whole.polygons, 16))
    for name in values:
        assert np.allclose(getattr(fine, name)[fine.faces], getattr(other, name), rtol=0, atol=1e-12), name
    assert not differences(fine.face_colors, np.repeat(whole.face_colors, 16, axis=0))


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


def test_colors_of_corners_are_interpolated():
    colors = np.random.default_rng(6).uniform(size=(1, 3, 3))
    finer = rz.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], colors=colors).subdivide()
    weights = np.stack([1 - finer.vertices[:, 0] - finer.vertices[:, 1], *finer.vertices.T[:2]], axis=1)
    assert not deviations(finer.colors, weights[finer.faces] @ colors[0])


def test_normals_of_a_file_are_interpolated():
    vertices, faces = octasphere(2)
    for normals in (vertices, vertices[faces]):
        finer = rz.Mesh(vertices, faces, normals=normals).subdivide()
        is_per_corner = normals.ndim == 3
        assert finer.normals.shape == ((len(finer.faces), 3, 3) if is_per_corner else finer.vertices.shape)
        points = finer.vertices[finer.faces] if is_per_corner else finer.vertices
        assert not deviations(finer.normals, unit(points), rtol=0, atol=1e-15)


def test_opposite_normals_do_not_vanish():
    mesh = rz.Mesh(np.eye(3), [[0, 1, 2]], normals=[[0, 0, 1], [0, 0, -1], [0, 0, 1]]).subdivide()
    assert not deviations(np.linalg.norm(mesh.normals, axis=1), 1)


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


def test_a_saw_tooth_is_found_without_creases():
    """From above, lit from one side: N.L is 0.99 and 0.14 on the slopes, 0.71 where normals are averaged.

    All averages at the sheet's own vertices are parallel. Those at the midpoints within a slope are not.
    """
    lights, size = (rz.DirectionalLight((-1, -1, 0), 1.0),), (320, 80)
    camera = rz.Camera.orthographic((0, 9, 0), (0, 0, 0), (0, 0, -1), height=2.0)
    sheet = replace(load("sawtooth.obj", crease_angle=180), material=DULL)
    slopes = 0.7 * np.array([0.2, 1.4]) * 0.5**0.5
    for times, is_cured, shading in (
        (0, False, "phong"),
        (0, False, "gouraud"),
        (1, True, "phong"),
        (2, True, "gouraud"),
    ):
        scene = rz.Scene([sheet.subdivide(times)], lights, camera)
        color = rz.render(scene, size, shading=shading, tolerance=0, samples=1).color[:, 20:-20, 1]
        assert (np.ptp(color) > 0.5) == is_cured, f"{times} times: {np.ptp(color):.3f} apart"
        if is_cured:  # the middle of a slope is lit as the slope; two pixels lie half a pixel beside it
            middles = color[:, 9::20] / 2 + color[:, 10::20] / 2
            assert np.abs(middles - slopes[np.arange(1, 15) % 2]).max() < 0.06
        else:
            assert np.ptp(color) < 1e-6 and abs(color.mean() - 0.7 * 0.5**0.5) < 1e-6


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


def test_a_highlight_inside_a_face_is_found():
    mesh, lights, camera = floor()
    truth = draw(mesh, "phong", lights, camera).color.max()
    lost, found = (draw(mesh.subdivide(times), "gouraud", lights, camera).color.max() for times in (0, 6))
    assert lost < 0.3 * truth and found > 0.9 * truth, f"{lost:.3f} and {found:.3f} of {truth:.3f}"


# ---------------------------------------------------------------- what is refused


def test_none_is_the_mesh_itself():
    mesh = load("cube.obj")
    assert mesh.subdivide(0) is mesh and mesh.subdivide(np.int64(1)).n_face == 4 * mesh.n_face


def test_numbers_of_times_that_are_none_are_refused():
    for times in (-1, 1.0, 16, True, "1", None, 10**30):
        with pytest.raises(rz.SceneError, match="whole number within"):
            load("cube.obj").subdivide(times)
    with pytest.raises(rz.ModelError, match="2147483647 faces; subdivided 15 times, its 12 would be 12884901888"):
        load("cube.obj").subdivide(15)
