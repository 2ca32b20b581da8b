"""Copies of a mesh: moved, turned, scaled, or of another material."""

import numpy as np
import pytest

import rasterizer as rz

RANDOM = np.random.default_rng(3)
POINTS = RANDOM.normal(size=(12, 3))
FACES = RANDOM.permutation(12).reshape(4, 3)
MESH = rz.Mesh(POINTS, FACES, normals=RANDOM.normal(size=(12, 3)), name="a")


def test_a_mesh_is_moved_by_an_offset():
    moved = MESH.translated((1, -2, 3.5))
    assert np.array_equal(moved.vertices, POINTS + (1, -2, 3.5)) and moved.name == "a"
    assert np.allclose(moved.normals, MESH.normals, atol=1e-15)


@pytest.mark.parametrize(
    ("axis", "start", "end"),
    [
        ("x", (0, 1, 0), (0, 0, 1)),
        ("y", (0, 0, 1), (1, 0, 0)),
        ("z", (1, 0, 0), (0, 1, 0)),
        ("-z", (0, 1, 0), (1, 0, 0)),
    ],
)
def test_a_quarter_turn_is_counter_clockwise_and_exact(axis, start, end):
    mesh = rz.Mesh([start, (1, 1, 1), (2, 3, 4)], [[0, 1, 2]])
    assert tuple(mesh.rotated(90, axis).vertices[0]) == end
    assert np.array_equal(mesh.rotated(360, axis).vertices, mesh.vertices)


def test_turns_keep_lengths_and_the_point_that_they_are_about():
    axis, about = RANDOM.normal(size=3), np.array([1.0, 2.0, 3.0])
    turned = MESH.rotated(37, axis, about)
    assert np.allclose(np.linalg.norm(turned.vertices - about, axis=1), np.linalg.norm(POINTS - about, axis=1))
    assert np.allclose((turned.vertices - POINTS) @ axis, 0.0, atol=1e-14)
    assert np.allclose(turned.rotated(-37, axis, about).vertices, POINTS, atol=1e-14)


def test_a_scaled_mesh_leaves_one_point_where_it_is():
    assert np.allclose(MESH.scaled(2).vertices, 2 * POINTS)
    about = POINTS[0]
    grown = MESH.scaled((2, 3, 0.5), about)
    assert np.allclose(grown.vertices[0], about)
    assert np.allclose(grown.vertices - about, (POINTS - about) * (2, 3, 0.5))


def test_a_mirrored_mesh_keeps_its_outside():
    assert np.array_equal(MESH.scaled((-1, 1, 1)).faces, MESH.faces[:, [0, 2, 1]])
    assert np.array_equal(MESH.scaled((-1, 1, -1)).faces, MESH.faces)


def test_one_material_takes_the_place_of_several():
    parts = rz.Mesh(POINTS, FACES, materials=[rz.Material(), rz.Material(name="b")], face_material=[0, 1, 0, 1])
    red = rz.Material(diffuse="red")
    assert parts.with_material(red).palette == (red,) and parts.with_material(red).face_material is None
    assert MESH.with_material("gold").material == rz.Material.named("gold")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: MESH.translated(3), "the offset must be three finite numbers; given 3"),
        (lambda: MESH.translated((1, 2, np.nan)), "the offset"),
        (lambda: MESH.rotated("90"), "the angle must be a finite number"),
        (lambda: MESH.rotated(90, "w"), "the axis must be one of 'x', "),
        (lambda: MESH.rotated(90, (0, 0, 0)), "the axis must have a length"),
        (lambda: MESH.rotated(90, about=1), "the point that stays must be three"),
        (lambda: MESH.scaled(0), "the factor must not be 0; given 0"),
        (lambda: MESH.scaled((1, 0, 1)), "the factor must not be 0"),
        (lambda: MESH.scaled((1, 2)), "the factor must be three"),
        (lambda: MESH.scaled("2"), "the factor must be"),
        (lambda: MESH.with_material("gould"), "gould"),
        (lambda: MESH.with_material(None), "a mesh's material must be a Material; given None"),
    ],
)
def test_what_is_not_legal(call, words):
    with pytest.raises(rz.SceneError, match=words):
        call()


def test_a_texture_needs_coordinates():
    with pytest.raises(rz.ModelError, match="needs texture coordinates"):
        MESH.with_material(rz.Material(texture=np.eye(4)))
