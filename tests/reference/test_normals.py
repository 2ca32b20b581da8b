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


# ---------------------------------------------------------------- alone


def test_the_reference_loads_nothing_that_is_compiled():
    code = (
        "import sys, rasterizer.reference\n"
        "layers = ['rasterizer.' + name for name in ('pipeline', 'engine', 'geometry', 'compiler')]\n"
        "print(sorted(name for name in sys.modules if name.startswith(('numba', 'llvmlite', *layers))))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
