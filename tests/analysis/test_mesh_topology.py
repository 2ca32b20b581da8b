"""How triangles are joined: against meshes whose answer is known, and trimesh's own."""

import numpy as np
import pytest
import trimesh
from helpers.raster import ROOT

import rasterizer as rz
from rasterizer.analysis.mesh_topology import compute_topology, count_components
from rasterizer.scene.framing import guess_up

TETRAHEDRON = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
OUTWARDS = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])


def test_a_tetrahedron_is_watertight():
    found = compute_topology(TETRAHEDRON, OUTWARDS)
    assert found.is_watertight and (found.n_vertex, found.n_edge, found.n_body) == (4, 6, 1)
    assert found.volume == pytest.approx(1 / 6) and found.area == pytest.approx(1.5 + np.sqrt(3) / 2)


def test_what_is_in_the_way_is_counted():
    opened = compute_topology(TETRAHEDRON, OUTWARDS[:3])
    assert not opened.is_watertight and opened.n_open == 3 and opened.volume is None
    turned = compute_topology(TETRAHEDRON, np.concatenate([OUTWARDS[:3], OUTWARDS[3:, ::-1]]))
    assert turned.is_watertight and turned.n_turned == 3 and turned.volume is None
    twice = compute_topology(TETRAHEDRON, np.concatenate([OUTWARDS, OUTWARDS]))
    assert twice.is_watertight and twice.n_branching == 6 and twice.n_body == 1
    needle = compute_topology(TETRAHEDRON, np.concatenate([OUTWARDS, [(1, 1, 2)]]))
    assert needle.is_watertight and needle.n_degenerate == 1
    nothing = compute_topology(TETRAHEDRON, np.array([(0, 0, 1)]))
    assert not nothing.is_watertight and nothing.n_edge == nothing.n_body == 0


def test_vertices_that_formats_repeat_are_one():
    points, faces = TETRAHEDRON[OUTWARDS.reshape(-1)], np.arange(12).reshape(4, 3)
    points[points == 0] *= -1.0  # -0 is 0
    assert compute_topology(points, faces) == compute_topology(TETRAHEDRON, OUTWARDS)


@pytest.mark.parametrize("name", ["gear.stl", "teapot.obj", "table.obj"])
def test_trimesh_finds_the_same(name):
    scene = rz.load(ROOT / "models" / name)
    points = np.concatenate([mesh.vertices for mesh in scene.meshes])
    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in scene.meshes])
    faces = np.concatenate([m.faces.astype(int) + k for m, k in zip(scene.meshes, offsets[:-1], strict=True)])
    found = compute_topology(points, faces)
    theirs = trimesh.Trimesh(points, faces, process=False)
    theirs.merge_vertices(digits_vertex=15)
    assert found.n_edge == len(theirs.edges_unique) and found.area == pytest.approx(theirs.area)
    assert found.is_watertight == theirs.is_watertight
    if found.volume is not None:
        assert found.volume == pytest.approx(abs(theirs.volume))


def test_parts_are_counted_like_by_a_search():
    rng = np.random.default_rng(7)
    for n in (1, 2, 30, 300):
        a, b = rng.integers(0, n, (2, n))
        seen, n_part = set(), 0
        neighbours = {k: set() for k in range(n)}
        for x, y in zip(a.tolist(), b.tolist(), strict=True):
            neighbours[x].add(y)
            neighbours[y].add(x)
        for start in range(n):
            n_part += start not in seen
            waiting = [start]
            while waiting:
                node = waiting.pop()
                if node not in seen:
                    seen.add(node)
                    waiting += neighbours[node]
        assert count_components(n, a, b) == n_part
    chain = np.arange(9999)
    assert count_components(10_000, chain + 1, chain) == count_components(10_000, chain, chain + 1) == 1
    assert count_components(5, np.empty(0, int), np.empty(0, int)) == 5


def guess(points, faces):
    return guess_up(points, faces, np.array([points.min(axis=0), points.max(axis=0)]))[0]


def test_a_level_base_tells_which_way_is_up():
    pyramid = np.array([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1), (0, 2, 0)], float)
    faces = np.array([(0, 1, 2), (0, 2, 3), (1, 0, 4), (2, 1, 4), (3, 2, 4), (0, 3, 4)])
    assert guess(pyramid, faces) == "y"
    assert guess(-pyramid, faces[:, ::-1]) == "-y"
    assert guess(pyramid[:, [0, 2, 1]], faces[:, ::-1]) == "z"
    cube = rz.load(ROOT / "models" / "cube.obj").meshes[0]
    assert guess(cube.vertices, cube.faces) is None  # as level at its top
    assert guess(TETRAHEDRON * (1, 1, 0), OUTWARDS[:1]) is None  # flat


def test_huge_coordinates_raise_nothing():
    found = compute_topology(TETRAHEDRON * 1e100, OUTWARDS)
    assert found.is_watertight and found.n_body == 1
    guess(TETRAHEDRON * 1e100, OUTWARDS)
