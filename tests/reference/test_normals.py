"""The reference's own creases against those of the fast way, on seeded meshes that are broken in every
way."""

import subprocess
import sys

import numpy as np
import pytest
from helpers.arrays import differences

from rasterizer.geometry.normals import split_creases
from rasterizer.reference.normals import corner_normals

WEIGHTINGS = ("angle", "area", "uniform")
ANGLES = (0, 20, 30, 45, 60, 89.999, 90, 120, 180)
EXACT = 1e-12  # of unit normals: sums in another order, of weights that are computed in another way


def split_normals(vertices, faces, angle, weighting="angle", smoothing=None):
    """The fast way's normals at the corners."""
    split = split_creases(vertices, faces, angle, weighting, smoothing)
    return split.normals[split.faces]


def check(vertices, faces, angle, weighting="angle", smoothing=None):
    expected = split_normals(vertices, faces, angle, weighting, smoothing)
    error = np.abs(corner_normals(vertices, faces, angle, weighting, smoothing) - expected).max()
    assert error <= EXACT, f"crease angle {angle}, by {weighting}: {error:.3g} > {EXACT}"


def broken_mesh(rng):
    """Few vertices and many faces: open, non-manifold, wound against each other, doubled and without area, all at
    once."""
    n_vertex = int(rng.integers(3, 12))
    vertices = (
        rng.integers(-2, 3, (n_vertex, 3)).astype(float) if rng.random() < 0.5 else rng.uniform(-1, 1, (n_vertex, 3))
    )
    faces = rng.integers(0, n_vertex, (int(rng.integers(1, 30)), 3))
    return vertices * 10.0 ** rng.integers(-6, 7), faces


def check_broken_meshes(seed, n):
    """Compare the two ways on so many meshes."""
    rng = np.random.default_rng(seed)
    for k in range(n):
        vertices, faces = broken_mesh(rng)
        smoothing = rng.integers(0, 3, len(faces)) if rng.random() < 0.25 else None
        check(vertices, faces, rng.choice([*ANGLES, rng.uniform(0, 180)]), WEIGHTINGS[k % 3], smoothing)


def test_both_ways_agree_on_broken_meshes():
    check_broken_meshes(0, 120)


@pytest.mark.nightly
def test_both_ways_agree_on_many_broken_meshes():
    check_broken_meshes(1, 3000)


def bumpy_sheet(rng, n=9, height=0.4):
    """A sheet of n × n quads, each cut in two, some of the triangles reversed and some doubled."""
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0))
    vertices = np.stack([x.ravel(), y.ravel(), rng.uniform(0, height, x.size)], axis=1)
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + n + 2], axis=1), np.stack([a, a + n + 2, a + n + 1], axis=1)])
    is_reversed = rng.random(len(faces)) < 0.2
    faces[is_reversed] = faces[is_reversed, ::-1]
    return vertices, rng.permutation(np.concatenate([faces, faces[:3]]))


def test_both_ways_agree_on_sheets_with_reversed_faces():
    for k, angle in enumerate((*ANGLES, 30, 60)):
        check(*bumpy_sheet(np.random.default_rng(7)), angle, WEIGHTINGS[k % 3])


def fan(n, height):
    """n faces round one vertex, a cone as high as asked for."""
    around = 2 * np.pi * np.arange(n) / n
    rim = np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
    i = np.arange(n)
    return np.vstack([[[0.0, 0, height]], rim]), np.stack([0 * i, 1 + i, 1 + (i + 1) % n], axis=1)


def test_both_ways_agree_on_huge_fans():
    for n, height, angle in ((3, 1.0, 180), (64, 2.0, 5), (64, 2.0, 60), (1000, 0.1, 180), (1000, 3.0, 0)):
        check(*fan(n, height), angle)


def spindle(rng, n):
    """Rings of n faces about two tips, and perhaps a second spindle that meets the first at one; faces in any order,
    some of them perhaps reversed."""
    (top, sides), bottom = fan(n, rng.uniform(0.1, 2)), rng.uniform(0.1, 2)
    top[1:, 2] += rng.uniform(-0.3, 0.3, n)
    vertices = np.vstack([top, [[0, 0, -bottom]]])
    faces = np.concatenate([sides, np.where(sides == 0, n + 1, sides)[:, ::-1]])
    if rng.random() < 0.5:
        other = np.where(faces == 0, 0, faces + n + 1)
        vertices, faces = np.vstack([vertices, 2 * vertices[0] - vertices[1:]]), np.concatenate([faces, other[:, ::-1]])
    is_reversed = rng.random(len(faces)) < rng.choice([0.0, 0.1])
    faces[is_reversed] = faces[is_reversed, ::-1]
    return vertices, rng.permutation(faces)


def test_both_ways_agree_about_rings():
    """With and without creases, of few faces and of many, two at one vertex, and some with a face that is reversed."""
    rng = np.random.default_rng(4)
    for k, n in enumerate([2, 3, 4, 5, 6, 7, 8, 16, 31, 32, 33, 70] * 4):
        vertices, faces = spindle(rng, n)
        smoothing = rng.integers(0, 3, len(faces)) if k % 4 == 3 else None
        check(vertices, faces, rng.choice([*ANGLES, rng.uniform(0, 180)]), WEIGHTINGS[k % 3], smoothing)


def edge_of(n_face, is_reversed):
    """Faces at equal angles round one edge, the z axis."""
    around = 2 * np.pi * np.arange(n_face) / n_face
    tips = np.stack([np.cos(around), np.sin(around), np.full(n_face, 0.5)], axis=1)
    ends = np.where(is_reversed[:, None], [[1, 0]], [[0, 1]])
    return np.vstack([[[0.0, 0, 0], [0, 0, 1]], tips]), np.column_stack([ends, 2 + np.arange(n_face)])


def test_both_ways_agree_about_edges_of_many_faces():
    """Up to 64 faces all pairs are tried; more are no part of a surface. What contradicts itself takes the first
    link."""
    for n_face in (2, 3, 4, 7, 63, 64, 65, 66):
        is_reversed = np.random.default_rng(n_face).random(n_face) < 0.4
        for angle in (0, 30, 90, 180):
            check(*edge_of(n_face, is_reversed), angle)


@pytest.mark.parametrize("n_side, rounding", [(6, np.float64), (9, np.float32), (12, lambda a: np.round(a, 6))])
def test_both_ways_treat_faces_that_meet_at_the_crease_angle_alike(n_side, rounding):
    around = 2 * np.pi * np.arange(n_side) / n_side
    rim = np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
    turn = np.linalg.qr(np.random.default_rng(n_side).normal(size=(3, 3)))[0]
    vertices = np.asarray(rounding(np.vstack([rim, rim + [0, 0, 1]]) @ turn), np.float64)
    i, j = np.arange(n_side), (np.arange(n_side) + 1) % n_side
    faces = np.concatenate([np.stack([i, j, n_side + j], axis=1), np.stack([i, n_side + j, n_side + i], axis=1)])
    angle = 360 / n_side
    for each in (angle, angle - 1e-3, angle + 1e-3, angle - 4e-4, angle + 4e-4):
        check(vertices, faces, each)
    joined, apart = (corner_normals(vertices, faces, each) for each in (angle, angle - 1e-3))
    assert not differences(joined[0, 0], joined[n_side - 1, 1]) and not (apart[0, 0] == apart[n_side - 1, 1]).all()


def test_faces_without_area_take_the_first_normal_at_their_vertex():
    vertices = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0), (9, 9, 9)])
    faces = np.array([(0, 1, 3), (0, 1, 2), (4, 4, 4)])
    normals = corner_normals(vertices, faces, 30)
    assert not differences(normals[:2, :2], (0, 0, 1))
    assert not differences(normals[0, 2], 0)
    assert not differences(normals[2], 0)
    check(vertices, faces, 30)


# ---------------------------------------------------------------- alone


def test_the_reference_loads_nothing_that_is_compiled():
    code = (
        "import sys, rasterizer.reference\n"
        "layers = ['rasterizer.' + name for name in ('pipeline', 'engine', 'geometry', 'compiler')]\n"
        "print(sorted(name for name in sys.modules if name.startswith(('numba', 'llvmlite', *layers))))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
