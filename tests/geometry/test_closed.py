"""Which bodies are closed, and which side of their triangles looks inwards."""

import numpy as np
import pytest
from helpers import bodies
from helpers.solids import cube

import rasterizer as rz
from rasterizer.engine.points import gather_inner_sides, list_opaque_fans
from rasterizer.geometry.closed import find_inner_sides
from rasterizer.geometry.normals import list_fans
from rasterizer.reference.closed import find_inner_sides as expected_inner_sides


def sides_of(vertices, faces):
    """The inner sides, as a list."""
    faces = np.ascontiguousarray(faces, np.uint32)
    return find_inner_sides(np.asarray(vertices, float), faces, list_fans(faces, len(vertices))).tolist()


def changed(change, seed=0):
    """A cube that is changed in one way."""
    return change(np.random.default_rng(seed), *cube())


def test_each_body_counts_for_itself():
    """A cavity, a body that touches another one, and an open one beside a closed one."""
    vertices, faces = cube()
    n = len(faces)
    assert sides_of(*changed(bodies.with_shell)) == [1] * n + [-1] * n
    open_one = changed(bodies.hole)
    both = np.concatenate([vertices, open_one[0] + 5.0]), np.concatenate([faces, open_one[1] + len(vertices)])
    assert sides_of(*both) == [1] * n + [0] * (n - 1)
    for seed in range(4):
        touching, two = changed(bodies.touching, seed)
        assert set(sides_of(touching, two)[:n]) == {1} and 0 not in sides_of(touching, two)
        # With one pair of vertices for both, nobody knows which faces go on into which.
        joined, name = np.unique(touching, axis=0, return_inverse=True)
        assert set(sides_of(joined, name.ravel()[two])) == {0}


def test_what_has_no_volume_has_no_inside():
    """Also where rounding gives it one: two sides of a sheet that is turned and far away."""
    rng = np.random.default_rng(5)
    points = np.column_stack([*rng.uniform(-1, 1, (2, 12)), np.zeros(12)])
    fan = np.array([(0, k, k + 1) for k in range(1, 11)])
    for shift in (0.0, 1e6):
        flat = points @ np.linalg.qr(rng.normal(size=(3, 3)))[0] + shift
        assert set(sides_of(flat, np.concatenate([fan, fan[:, ::-1]]))) == {0}
        folded = np.concatenate([flat, flat[[0]]])  # a second vertex at one place
        assert set(sides_of(folded, np.concatenate([fan, np.where(fan == 0, 12, fan)[:, ::-1]]))) == {0}


def test_triangles_that_share_nothing_enclose_nothing():
    vertices, faces = cube()
    loose, alone = vertices[faces].reshape(-1, 3), np.arange(36, dtype=np.uint32).reshape(-1, 3)
    for is_welded in (False, True):  # known to be: then no two of them stand at one position, whatever these do
        found = find_inner_sides(loose, alone, list_fans(alone, 36), is_welded).tolist()
        assert found == [0 if is_welded else 1] * 12


def test_transparent_meshes_have_no_inner_sides():
    glass, vertices, faces = rz.Material(opacity=0.5), *cube()
    meshes = [rz.Mesh(vertices, faces), rz.Mesh(vertices, faces, material=glass)]
    assert gather_inner_sides(meshes, list_opaque_fans(meshes)).tolist() == [1] * 12 + [0] * 12


def check_bodies(seeds):
    """Random bodies, against the reference."""
    n_closed = 0
    for seed in seeds:
        mesh = bodies.random_bodies(np.random.default_rng(seed), rz.Material())
        found, expected = np.array(sides_of(mesh.vertices, mesh.faces)), -expected_inner_sides(mesh)
        assert (found == expected).all(), f"seed {seed}: {(found != expected).sum()} of {len(found)} faces"
        n_closed += (found != 0).any()
    assert 0.3 * len(seeds) < n_closed < len(seeds)


def test_random_bodies_are_those_of_the_reference():
    check_bodies(range(60))


@pytest.mark.nightly
def test_many_random_bodies_are_those_of_the_reference():
    check_bodies(range(60, 3000))
