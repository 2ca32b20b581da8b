"""Check what is made of meshes before they are drawn: points, normals, colours, the distance to a light."""

import numpy as np
from helpers.arrays import differences
from helpers.pinhole import octasphere

import rasterizer as rz
from rasterizer import reference
from rasterizer.engine.points import flat_part, gather_geometry, smooth_part
from rasterizer.geometry.surfaces import flag_inverted


def corner_places(part):
    return part.points[part.corner]


# ---------------------------------------------------------------- interpolation between vertices


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


def test_numbers_of_polygons_may_have_gaps():
    vertices, faces = octasphere(1)
    polygons = (np.arange(len(faces)) // 3) * 7 + 5
    part = flat_part(rz.Mesh(vertices, faces, polygons=polygons))
    assert not differences(part.corner[:, 0], np.arange(len(faces)) // 3) and len(part.points) == -(-len(faces) // 3)
    assert not differences(np.isfinite(part.points), True)
    assert np.abs(np.linalg.norm(part.normals, axis=1) - 1).max() < 1e-15


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
