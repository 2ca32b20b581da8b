"""Check what is made of meshes before they are drawn: points, normals, colours, the distance to a light."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import deviations, differences
from helpers.pinhole import octasphere, torus, unit
from helpers.solids import sphere

import rasterizer as rz
from rasterizer import reference
from rasterizer.cores import Workers
from rasterizer.engine.points import flat_part, gather_geometry, smooth_part
from rasterizer.geometry.normals import polygon_planes
from rasterizer.geometry.surfaces import flag_inverted
from rasterizer.geometry.weld import FEW

CUBE = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])
QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def corner_places(part):
    return part.points[part.corner]


# ---------------------------------------------------------------- interpolation between vertices


def test_a_cube_is_split_at_its_edges():
    mesh = rz.Mesh(CUBE, QUADS)
    part = smooth_part(mesh)
    assert len(part.points) == 24 and not differences(corner_places(part), CUBE[mesh.faces])
    normals = part.normals[part.corner]
    area = np.cross(CUBE[mesh.faces[:, 1]] - CUBE[mesh.faces[:, 0]], CUBE[mesh.faces[:, 2]] - CUBE[mesh.faces[:, 0]])
    assert np.abs(normals - unit(area)[:, None]).max() < 1e-15
    assert len(smooth_part(rz.Mesh(CUBE, QUADS, crease_angle=180)).points) == 8
    assert part.albedo is None and part.vertex is mesh.faces, "vertices stand where they were"
    one_group = {"smoothing": np.ones(12, int)}
    assert len(smooth_part(rz.Mesh(CUBE, mesh.faces, **one_group)).points) == 8
    assert len(smooth_part(rz.Mesh(CUBE, mesh.faces, crease_angle=30, **one_group)).points) == 24, "the angle overrides"


def test_normals_of_vertices_are_taken_as_they_are():
    vertices, faces = octasphere(2)
    mesh = rz.Mesh(vertices, faces, normals=-vertices)
    part = smooth_part(mesh)
    assert not differences(part.positions, vertices) and not differences(part.corner, faces)
    assert np.abs(part.normals + vertices).max() < 1e-15
    creased = smooth_part(rz.Mesh(vertices, faces, normals=-vertices, crease_angle=180))
    assert (creased.normals * creased.points).sum(axis=1).min() > 0.9, "a crease angle overrides the file's normals"


def test_equal_normals_at_the_corners_of_a_vertex_are_welded():
    """Normals a corner: as many points as there are kinds of (vertex, normal), and nothing lost."""
    vertices, faces = octasphere(1)
    rng = np.random.default_rng(0)
    kinds = unit(rng.normal(size=(3, 3)))
    choice = rng.integers(0, 3, faces.shape)
    normals = kinds[choice]
    normals[0, 0], normals[1, 1] = (0.0, 0.0, 1.0), (-0.0, 0.0, 1.0)  # equal but for the sign of a zero
    mesh = rz.Mesh(vertices, faces, normals=normals)
    part = smooth_part(mesh)
    assert not differences(part.normals[part.corner], mesh.normals)
    assert not differences(corner_places(part), vertices[faces])
    pairs = {(int(v), *(n + 0.0)) for v, n in zip(faces.ravel(), mesh.normals.reshape(-1, 3), strict=True)}
    assert len(part.points) == len(pairs) < faces.size
    first_use = part.corner.ravel()[np.sort(np.unique(part.corner.ravel(), return_index=True)[1])]
    assert (first_use == np.arange(len(part.points))).all(), "points stand in the order of first use"


def test_one_normal_everywhere_leaves_the_vertices_whole():
    vertices, faces = octasphere(2)
    part = smooth_part(rz.Mesh(vertices, faces, normals=vertices[faces]))
    assert len(part.points) == len(vertices)
    assert np.abs(part.normals - part.points).max() < 1e-15


def test_colors_of_faces_split_the_vertices_they_share():
    vertices, faces = octasphere(1)
    colors = np.array([(1.0, 0.2, 0.1), (0.1, 0.3, 0.9)])[np.arange(len(faces)) % 2]
    part = smooth_part(rz.Mesh(vertices, faces, face_colors=colors, crease_angle=180))
    assert not differences(part.albedo[part.corner], colors[:, None].repeat(3, axis=1))
    assert not differences(corner_places(part), vertices[faces])
    assert len(vertices) < len(part.points) <= 2 * len(vertices)
    whole = smooth_part(rz.Mesh(vertices, faces, crease_angle=180))
    assert np.abs(part.normals[part.corner] - whole.normals[whole.corner]).max() == 0
    one = smooth_part(rz.Mesh(vertices, faces, face_colors=np.tile(colors[:1], (len(faces), 1)), crease_angle=180))
    assert len(one.points) == len(vertices), "one colour splits nothing"


def test_colors_of_vertices_count_before_those_of_faces():
    vertices, faces = octasphere(1)
    colors = np.random.default_rng(1).random(vertices.shape)
    mesh = rz.Mesh(vertices, faces, colors=colors, face_colors=np.ones((len(faces), 3)))
    part = smooth_part(mesh)
    assert not differences(part.albedo[part.corner], colors[faces])
    flat = flat_part(mesh)
    assert np.abs(flat.albedo - colors[faces].mean(axis=1)).max() < 1e-15


# ---------------------------------------------------------------- flat shading


def test_polygons_have_one_point_each():
    """A rectangle of two triangles, and a triangle: centroids of the polygons, not of their parts."""
    vertices = np.array([[0, 0, 1.0], [4, 0, 1], [4, 1, 1], [0, 1, 1], [9, 9, 9]])
    mesh = rz.Mesh(vertices, [[0, 1, 2, 3], [0, 3, 4]])
    part = flat_part(mesh)
    assert part.corner.tolist() == [[0] * 3, [0] * 3, [1] * 3]
    assert np.abs(part.points[0] - (2, 0.5, 1)).max() < 1e-15 and np.abs(part.normals[0] - (0, 0, 1)).max() < 1e-15
    assert np.abs(part.points[1] - vertices[[0, 3, 4]].mean(axis=0)).max() < 1e-14
    assert part.positions is mesh.vertices and part.albedo is None


def test_centroids_are_weighted_by_area():
    """A trapezium cut into two triangles of areas 3 and 1."""
    vertices = np.array([[0, 0, 0.0], [3, 0, 0], [1, 2, 0], [0, 2, 0]])
    part = flat_part(rz.Mesh(vertices, [[0, 1, 2, 3]]))
    expected = (3 * np.array([4 / 3, 2 / 3, 0]) + 1 * np.array([1 / 3, 4 / 3, 0])) / 4
    assert np.abs(part.points[0] - expected).max() < 1e-15


def test_polygons_without_area_still_have_a_point():
    vertices = np.array([[0, 0, 0.0], [2, 0, 0], [4, 0, 0], [0, 3, 0]])
    faces, polygons = np.array([[0, 1, 2], [1, 1, 2], [0, 1, 3]]), np.array([0, 0, 1], np.uint32)
    _, found = polygon_planes(vertices, faces, polygons)
    assert np.abs(found - [[7 / 3, 0, 0], [2 / 3, 1, 0]]).max() < 1e-14


def test_numbers_of_polygons_may_have_gaps():
    vertices, faces = octasphere(1)
    polygons = (np.arange(len(faces)) // 3) * 7 + 5
    part = flat_part(rz.Mesh(vertices, faces, polygons=polygons))
    assert not differences(part.corner[:, 0], np.arange(len(faces)) // 3) and len(part.points) == -(-len(faces) // 3)
    assert not differences(np.isfinite(part.points), True)
    assert np.abs(np.linalg.norm(part.normals, axis=1) - 1).max() < 1e-15


def test_colors_of_corners_are_kept():
    vertices, faces = octasphere(1)
    own, shared = np.random.default_rng(3).random((len(faces), 3, 4)), np.random.default_rng(4).random(vertices.shape)
    for polygons in (None, np.arange(len(faces)) // 2):
        part = smooth_part(rz.Mesh(vertices, faces, colors=own, polygons=polygons))
        assert not differences(part.albedo[part.corner], own[..., :3])
        assert not differences(corner_places(part), vertices[faces])
        meshes = [rz.Mesh(vertices, faces, colors=c, polygons=polygons) for c in (shared, shared[faces])]
        flat, same = (flat_part(mesh).albedo for mesh in meshes)
        assert not deviations(flat, same, rtol=0, atol=1e-15)
    assert np.abs(flat_part(rz.Mesh(vertices, faces, colors=own)).albedo - own[..., :3].mean(axis=1)).max() < 1e-15


def test_colors_of_corners_are_those_of_the_reference():
    vertices = [(-1, -1, 0), (1, -1, 0), (1, 1, 0.3), (-1, 1, 0), (0, 1.6, 0.2)]
    colors = np.random.default_rng(1).random((3, 3, 3))
    scene = rz.Scene(rz.Mesh(vertices, [(0, 1, 2), (0, 2, 3), (3, 2, 4)], colors=colors, polygons=[0, 0, 1]))
    for shading in ("flat", "gouraud", "phong"):
        drawn = rz.render(scene, size=(40, 30), shading=shading, tolerance=0.0, samples=1).color
        error = np.abs(drawn - reference.render(scene, (40, 30), shading=shading).color).max()
        assert error < 1e-6, f"{shading}: {error:.2g} > 1e-6"


def test_colors_of_polygons_are_means():
    vertices, faces = octasphere(1)
    colors = np.random.default_rng(2).random((len(faces), 4))
    polygons = np.arange(len(faces)) // 2
    part = flat_part(rz.Mesh(vertices, faces, polygons=polygons, face_colors=colors))
    assert part.albedo.shape[1] == 3
    assert np.abs(part.albedo - colors[:, :3].reshape(-1, 2, 3).mean(axis=1)).max() < 1e-15


# ---------------------------------------------------------------- all meshes together


@pytest.mark.parametrize("is_flat", [True, False])
def test_meshes_stand_one_behind_the_other(is_flat):
    rng = np.random.default_rng(3)
    ball, ring = octasphere(1), torus(8, 5)
    colors = rng.random(ring[0].shape)
    looks = [rz.Material(shininess=n) for n in (8, 16, 32)]
    shapes = [rz.Mesh(*ball), rz.Mesh(*ring, colors=colors), rz.Mesh(CUBE, rz.Mesh(CUBE, QUADS).faces)]
    meshes = [replace(mesh, material=look) for mesh, look in zip(shapes, looks, strict=True)]
    scene = rz.Scene(meshes)
    geometry = gather_geometry(scene.meshes, is_flat)
    corners = np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes])
    assert not differences(geometry.positions[geometry.vertex.T], corners)
    assert geometry.corner.shape == geometry.vertex.shape == (3, scene.n_face)
    assert is_flat or not differences(geometry.points[geometry.corner.T], corners)
    unasked = gather_geometry(scene.meshes, is_flat, has_lit_points=False)
    assert not differences(unasked.normals, geometry.normals) and not differences(unasked.corner, geometry.corner)
    for mesh in range(3):
        start, stop = scene.face_offsets[mesh : mesh + 2]
        first, last = geometry.point_offsets[mesh : mesh + 2]
        here = geometry.corner[:, start:stop]
        assert here.min() == first and here.max() == last - 1
        white = (geometry.albedo[first:last] == 1).all()
        assert white == (mesh != 1)
    assert len(geometry.albedo) == len(geometry.points) == geometry.point_offsets[-1]
    assert gather_geometry(rz.Scene(meshes[:1]).meshes, is_flat).albedo.shape == (0, 3)
    assert not differences(geometry.is_inverted, 0)
    assert geometry.group_material.tolist() == [0, 1, 2]
    assert not differences(geometry.face_material, np.repeat(np.arange(3), np.diff(scene.face_offsets)))


@pytest.mark.parametrize("is_flat", [True, False])
def test_meshes_of_equal_materials_are_one_group(is_flat):
    faces = rz.Mesh(CUBE, QUADS).faces
    shapes = [rz.Mesh(CUBE, faces, material=rz.Material(shininess=n)) for n in (8, 8, 16, 8)]
    geometry = gather_geometry(rz.Scene(shapes).meshes, is_flat)
    n = len(geometry.points) // 4
    assert geometry.group_material.tolist() == [0, 1, 0]
    assert geometry.point_offsets.tolist() == [0, 2 * n, 3 * n, 4 * n]
    assert geometry.face_material.tolist() == [0] * 24 + [1] * 12 + [0] * 12
    assert len(gather_geometry(rz.Scene(shapes[:2]).meshes, is_flat).face_material) == 0


def test_faces_whose_normals_contradict_their_winding_are_flagged():
    vertices, faces = octasphere(2)
    flipped = np.arange(len(faces)) % 3 == 0
    wound = np.where(flipped[:, None], faces[:, ::-1], faces)
    geometry = gather_geometry(rz.Scene([rz.Mesh(vertices, wound, normals=vertices)]).meshes, False)
    assert not differences(geometry.is_inverted, flipped)
    inside = gather_geometry(rz.Scene([rz.Mesh(vertices, wound, normals=-vertices)]).meshes, False)
    assert not differences(inside.is_inverted, ~flipped)
    assert not differences(
        gather_geometry(rz.Scene([rz.Mesh(vertices, wound, normals=vertices)]).meshes, True).is_inverted, 0
    )
    nothing = np.ones(len(faces), np.uint8)
    indices = geometry.vertex, geometry.corner
    flag_inverted(geometry.positions, 0 * geometry.normals, *indices, (0, len(nothing)), nothing)
    assert not nothing.any(), "no normal is no contradiction"


def test_the_number_of_threads_changes_no_geometry():
    """Of meshes that are worth several threads, more than are split in one round, with creases and turned faces."""
    rng, (vertices, faces) = np.random.default_rng(0), sphere(160)
    vertices = vertices + rng.normal(scale=0.004, size=vertices.shape)
    turned = np.where(rng.random((len(faces), 1)) < 0.01, faces[:, ::-1], faces)
    meshes = rz.Scene([rz.Mesh(vertices, faces), rz.Mesh(vertices, turned, normals=vertices)]).meshes
    alone = gather_geometry(meshes, False)
    assert alone.is_inverted.any() and len(alone.points) > 2 * len(vertices), "some are split"
    for n_thread in (1, 2, 3):
        geometry = gather_geometry(meshes, False, Workers(n_thread))
        for name in ("positions", "vertex", "corner", "points", "normals", "is_inverted"):
            assert not differences(getattr(geometry, name), getattr(alone, name)), (name, n_thread)


# ---------------------------------------------------------------- the distance to a light


# ---------------------------------------------------------------- as many as other code is taken for

PAINT = tuple(rz.Material(diffuse=shade, name=str(shade)) for shade in (0.2, 0.5, 0.8))
PAPER = rz.Material(texture=rz.Texture(np.eye(4)), name="paper")
BRUSHED = rz.Material(reflection="cook-torrance", roughness=(0.2, 0.6), name="brushed")


def patches(n_copy, features, seed=7):
    """So many copies of a small patch of quads, each 8 units beside the last, in one mesh."""
    rng = np.random.default_rng(seed)
    heights, (x, y) = rng.integers(0, 40, 20) / 64.0, np.meshgrid(np.arange(5.0), np.arange(4.0))
    at = (np.arange(16).reshape(4, 4) + np.arange(4)[:, None])[:3].ravel()  # first corners of the 12 quads
    faces = np.stack([at, at + 1, at + 6, at, at + 6, at + 5], axis=1).reshape(-1, 3)
    vertices, shift = np.stack([x.ravel(), y.ravel(), heights], axis=1), np.array([8.0, 0, 0])
    given = {
        "normals of vertices": {"normals": unit(rng.normal(size=(20, 3)))},
        "normals of corners": {"normals": unit(rng.normal(size=(2, 3)))[rng.integers(0, 2, (24, 3))]},
        "colors of vertices": {"colors": rng.integers(0, 3, (20, 3)) / 2},
        "colors of corners": {"colors": rng.integers(0, 2, (24, 3, 3)) / 1},
        "colors of faces": {"face_colors": np.repeat(rng.integers(0, 2, (12, 3)) / 1, 2, axis=0)},
        "smoothing": {"smoothing": np.repeat(rng.integers(0, 3, 12), 2)},
        "uv of vertices": {"uv": rng.random((20, 2))},
        "uv of corners": {"uv": rng.integers(0, 2, (24, 3, 2)) / 1},
        "materials": {"face_material": np.repeat(rng.integers(0, 3, 12), 2)},
    }
    own = {name: value for feature in features for name, value in given.get(feature, {}).items()}
    tiled = {name: np.concatenate([value] * n_copy) for name, value in own.items()}
    if "face_material" in own:
        tiled["materials"] = (PAPER if "texture" in features else PAINT[0], *PAINT[1:])
    else:
        tiled["material"] = PAPER if "texture" in features else BRUSHED if "brushed" in features else PAINT[0]
    moved = (vertices + shift * np.arange(n_copy)[:, None, None]).reshape(-1, 3)
    faces = (faces + 20 * np.arange(n_copy)[:, None, None]).reshape(-1, 3)
    return rz.Mesh(moved, faces, polygons=np.arange(len(faces)) // 2, **tiled)


MANY = 900  # patches: more vertices, and more corners, than are sorted
FEATURES = [
    (), ("materials",), ("normals of vertices",), ("normals of corners",), ("colors of vertices",),
    ("colors of corners",), ("colors of faces", "materials"), ("smoothing", "materials"), ("uv of vertices", "texture"),
    ("uv of corners", "texture", "materials"), ("uv of vertices", "brushed"), ("uv of corners", "brushed"),
    ("normals of corners", "colors of corners", "uv of corners", "texture", "materials"),
]  # fmt: skip


@pytest.mark.parametrize("features", FEATURES, ids=" and ".join)
def test_a_large_mesh_has_at_its_corners_what_a_small_one_has(features):
    """Equal rows of many points, corners and vertices are found by other code than those of a few."""
    assert 20 * MANY > FEW
    for is_flat in (False, True):
        found = []
        for n_copy in (1, MANY):
            geometry = gather_geometry(rz.Scene(patches(n_copy, features)).meshes, is_flat, Workers(2))
            columns = geometry.points, geometry.normals, geometry.albedo, geometry.uv, geometry.tangents
            rows = [rows[geometry.corner.T] for rows in columns if len(rows)]
            values = np.concatenate([geometry.positions[geometry.vertex.T], *rows], axis=2)
            values = values.reshape(n_copy, -1, 3, values.shape[2])
            materials = geometry.face_material.reshape(n_copy, -1)
            found.append((values, materials))
        (one, material), (many, its_material) = found
        for columns in (slice(0, 1), slice(3, 4)):  # x of vertices, and of points
            many[..., columns] -= 8.0 * np.arange(MANY)[:, None, None, None]
        assert not deviations(many, np.broadcast_to(one, many.shape), rtol=0, atol=1e-10), is_flat
        assert not differences(its_material, np.broadcast_to(material, its_material.shape)), is_flat
