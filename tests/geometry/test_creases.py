"""Creases of broken meshes, of slivers, at other scales and sizes."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from helpers.arrays import deviations, differences
from helpers.solids import corner_normals, cube, sphere
from hypothesis import given, settings
from hypothesis import strategies as st

from rasterizer.geometry.normals import polygon_normals, split_creases


def face_normals(vertices, faces):
    return polygon_normals(vertices, faces, np.arange(len(faces)))


# ------------------------------------------------------------------- broken meshes
def test_one_face_wound_badly_keeps_the_average_and_turns_it():
    vertices, faces = sphere(12)
    good = corner_normals(split_creases(vertices, faces, 60))
    turned = faces.copy()
    turned[100] = turned[100, ::-1]
    split = split_creases(vertices, turned, 60)
    bad = corner_normals(split)
    assert len(split.source) == len(vertices) + 3
    assert not deviations(bad[100], -good[100, ::-1], rtol=0, atol=1e-14)
    assert not deviations(np.delete(bad, 100, axis=0), np.delete(good, 100, axis=0), rtol=0, atol=1e-14)


def test_smoothing_groups_rule_over_angles():
    vertices, faces = cube()
    assert len(split_creases(vertices, faces, 30, smoothing=np.full(12, 4)).source) == 8
    # in group 0 even the two halves of a square are apart
    assert len(split_creases(vertices, faces, 180, smoothing=np.zeros(12, int)).source) == 36
    by_side = np.repeat(np.arange(1, 7), 2)
    assert len(split_creases(vertices, faces, 180, smoothing=by_side).source) == 24


# ------------------------------------------------------------------------- numbers
def test_needles_have_exact_normals_and_weights():
    for thin, scale in product((1e-3, 1e-6, 1e-9, 1e-12), (1e-6, 1.0, 1e6)):
        vertices, case = np.array([[0, 0, 0], [1, 2, 3], [1 + 2 * thin, 2 - thin, 3]]) * scale, (thin, scale)
        a, b, c = np.array([[Fraction(x) for x in vertex] for vertex in vertices])
        exact = np.array(np.cross(b - a, c - a) * 10**40, dtype=float)
        exact /= np.linalg.norm(exact)
        for turn in range(3):
            error = np.abs(face_normals(np.roll(vertices, turn, axis=0), [[0, 1, 2]])[0] - exact).max()
            assert error < 4e-16, f"thin by {thin}, scale {scale}: {error} > 4e-16"
        # beside a right angle that looks up, a needle that looks right tilts the average by its own small angle
        wall = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, thin]]) * scale
        normal = split_creases(wall, [[0, 1, 2], [0, 2, 3]], 180).normals[0]
        assert normal[0] / normal[2] == pytest.approx(np.arctan(thin) / (np.pi / 2), rel=1e-14), case


@settings(max_examples=30, deadline=None)
@given(st.integers(-6, 6), st.integers(-3, 3), st.integers(0, 5))
def test_scale_and_offset_change_nothing(exponent, shift, seed):
    vertices, faces = sphere(5)
    vertices = np.round(vertices + np.random.default_rng(seed).normal(scale=0.2, size=vertices.shape), 3)
    vertices = np.rint(vertices * 1024) / 1024
    base = split_creases(vertices, faces, 25)
    moved = split_creases((vertices + shift * 4096) * 2.0 ** (exponent * 3), faces, 25)
    assert [(a, b) for a, b in zip(base, moved, strict=True) if not np.array_equal(a, b)] == []


# ----------------------------------------------------------------- size and border


def test_nothing_given_is_changed_and_any_layout_is_taken():
    vertices, faces = cube()
    base = split_creases(vertices, faces, 30)
    odd_vertices = np.asfortranarray(np.repeat(vertices, 2, axis=0))[::2]
    for v, f in [
        (vertices.tolist(), faces.tolist()),
        (odd_vertices, faces[:, ::-1].astype(np.int8)[:, ::-1]),
        (vertices.astype(np.float32), faces.astype(np.uint64)),
    ]:
        before = np.array(v), np.array(f)
        assert [(a, b) for a, b in zip(split_creases(v, f, 30), base, strict=True) if not np.array_equal(a, b)] == []
        assert not differences(v, before[0]) and not differences(f, before[1])
    frozen = vertices.copy()
    frozen.flags.writeable = False
    split_creases(frozen, faces, 30)
    assert vertices.flags.writeable and faces.flags.writeable and base.normals.flags.writeable


def test_an_edge_of_many_faces_is_no_part_of_a_surface():
    """The pages of a book: up to 64 at its back are compared two by two, more of them stay as they are."""
    for n_page, is_joined, smoothing in ((60, True, None), (60, True, 1), (65, False, None), (100_000, False, 1)):
        angle = np.arange(n_page) * (2 * np.pi / n_page)
        pages = np.stack([np.cos(angle), np.sin(angle), np.full(n_page, 0.5)], axis=1)
        vertices = np.concatenate([[(0, 0, 0), (0, 0, 1)], pages])
        faces = np.stack([np.zeros(n_page), np.ones(n_page), np.arange(n_page) + 2], axis=1).astype(int)
        groups = None if smoothing is None else np.full(n_page, smoothing)
        split = split_creases(vertices, faces, 40.0, smoothing=groups)
        at_back = (split.source < 2).sum()
        assert (at_back < 2 * n_page) == is_joined, f"{at_back} split vertices at the back of {n_page} pages"
