"""Normals and creases: a slow twin on random broken meshes, and known solids."""

import math
from itertools import combinations

import numpy as np
import pytest
from helpers.arrays import deviations
from helpers.solids import check_split, corner_normals, cylinder
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rasterizer.geometry.normals import _angle, polygon_normals, split_creases

WEIGHTINGS = ("angle", "area", "uniform")


# ----------------------------------------------------------------------- slow twin
def twin_face(vertices, face):
    a, b, c = vertices[face]
    edges = sorted([b - a, c - b, a - c], key=np.linalg.norm)
    area = np.cross(b - a, c - a)
    flat = 2.0**-50 * np.linalg.norm(edges[0]) * np.linalg.norm(edges[1])
    length = np.linalg.norm(area)
    return (area / length, length) if length > flat else (np.zeros(3), 0.0)


def twin_weight(vertices, face, k, area, weighting):
    here, after, before = (vertices[face[(k + step) % 3]] for step in range(3))
    angle = np.arctan2(area, np.dot(after - here, before - here))
    return {"angle": angle, "area": area, "uniform": 1.0}[weighting]


def twin_links(vertices, faces, fan, normals, vertex, crease_angle, smoothing):
    """Compare all pairs of faces at a vertex; return (far vertex, i, j, sign) of those joined, in order."""
    links = []
    for i, j in combinations(range(len(fan)), 2):
        for far in (set(faces[fan[i][0]]) & set(faces[fan[j][0]])) - {vertex}:
            leaves = [faces[face][(k + 1) % 3] == far for face, k in (fan[i], fan[j])]
            sign = 1 if leaves[0] != leaves[1] else -1
            n_i, n_j = normals[fan[i][0]], sign * normals[fan[j][0]]
            angle = np.degrees(np.arctan2(np.linalg.norm(np.cross(n_i, n_j)), np.dot(n_i, n_j)))
            if smoothing is not None:
                is_joined = smoothing[fan[i][0]] == smoothing[fan[j][0]] != 0
            else:
                assume(abs(angle - crease_angle - 5e-4) > 1e-5)
                is_joined = angle <= crease_angle + 5e-4
            if is_joined:
                links.append((far, i, j, sign))
    return sorted(links)


def twin_split(vertices, faces, crease_angle, weighting, smoothing=None):
    """Return each corner's normal and name, (n_face, 3); corners of one name share a split vertex."""
    measured = [twin_face(vertices, face) for face in faces]
    normals, areas = [n for n, _ in measured], [a for _, a in measured]
    corner_normal, names = np.zeros((len(faces), 3, 3)), np.empty((len(faces), 3), dtype=object)
    for vertex in range(len(vertices)):
        around = [(face, k) for face in range(len(faces)) for k in range(3) if faces[face][k] == vertex]
        fan = [(face, k) for face, k in around if areas[face] > 0]
        groups = {i: {i: 1} for i in range(len(fan))}
        for _, i, j, sign in twin_links(vertices, faces, fan, normals, vertex, crease_angle, smoothing):
            of_i, of_j = (next(g for g, members in groups.items() if place in members) for place in (i, j))
            if of_i != of_j:
                turn = sign * groups[of_i][i] * groups[of_j][j]
                groups[of_i].update({m: s * turn for m, s in groups.pop(of_j).items()})
        weights = [twin_weight(vertices, faces[face], k, areas[face], weighting) for face, k in fan]
        for group, members in groups.items():
            total = sum(s * weights[m] * normals[fan[m][0]] for m, s in members.items())
            part = np.linalg.norm(total) / sum(weights[m] for m in members)
            assume(not 1e-8 < part < 1e-5)
            for m, s in members.items():
                face, k = fan[m]
                corner_normal[face, k] = s * total / np.linalg.norm(total) if part > 1e-6 else normals[face]
                names[face, k] = (vertex, group, s) if part > 1e-6 else (vertex, m, "own")
        for face, k in around:
            if areas[face] == 0:
                first = min(fan, default=(face, k))
                corner_normal[face, k] = corner_normal[first]
                names[face, k] = names[first] or (vertex, "flat")
    return corner_normal, names


integers = st.integers(-2, 2).map(float)
reals = st.floats(-1, 1, allow_nan=False).map(lambda x: round(x, 3))


@st.composite
def meshes(draw):
    """Few vertices, many faces: open, non-manifold, badly wound, doubled and degenerate, all at once."""
    coordinate = draw(st.sampled_from([integers, reals]))
    n_vertex = draw(st.integers(3, 7))
    vertices = np.array(draw(st.lists(st.tuples(*[coordinate] * 3), min_size=n_vertex, max_size=n_vertex)))
    index = st.integers(0, n_vertex - 1)
    faces = np.array(draw(st.lists(st.tuples(index, index, index), min_size=1, max_size=14)))
    return vertices * 10.0 ** draw(st.integers(-6, 6)), faces


angles = st.sampled_from([0, 20, 30, 45, 60, 89.999, 90, 120, 180]) | st.floats(0, 180)


def check_split_by_twin(mesh, crease_angle, weighting, has_groups, random):
    vertices, faces = mesh
    smoothing = np.array([random.randrange(3) for _ in faces]) if has_groups else None
    split = split_creases(vertices, faces, crease_angle, weighting, smoothing)
    check_split(vertices, faces, split)
    expected, names = twin_split(vertices, faces, crease_angle, weighting, smoothing)
    error = np.abs(corner_normals(split) - expected).max()
    assert error < 1e-7, f"measured {error} > 1e-7"
    pairs = set(zip(split.faces.reshape(-1).tolist(), names.reshape(-1), strict=True))
    assert len(pairs) == len(split.source) == len({name for _, name in pairs})


SPLITS = meshes(), angles, st.sampled_from(WEIGHTINGS), st.booleans(), st.randoms(use_true_random=False)


@settings(max_examples=80, deadline=None)
@given(*SPLITS)
def test_split_equals_slow_twin(mesh, crease_angle, weighting, has_groups, random):
    check_split_by_twin(mesh, crease_angle, weighting, has_groups, random)


@pytest.mark.nightly
@settings(max_examples=2000, deadline=None)
@given(*SPLITS)
def test_split_equals_slow_twin_in_many_meshes(mesh, crease_angle, weighting, has_groups, random):
    check_split_by_twin(mesh, crease_angle, weighting, has_groups, random)


@settings(max_examples=40, deadline=None)
@given(meshes())
def test_face_normals_equal_slow_twin(mesh):
    vertices, faces = mesh
    normals = [twin_face(vertices, face)[0] for face in faces]
    assert not deviations(polygon_normals(vertices, faces, np.arange(len(faces))), normals, rtol=0, atol=1e-12)


def test_angles_are_exact_to_four_roundings():
    """Of any sine and cosine, most of all where the formula changes: at π/8, 3π/8, 5π/8 and 7π/8."""
    rng = np.random.default_rng(1)
    angles = np.concatenate([
        rng.uniform(0, np.pi, 4000), 10.0 ** rng.uniform(-60, 0, 1000), np.pi - 10.0 ** rng.uniform(-16, 0, 1000),
        np.pi / 8 * np.arange(1, 8)[:, None].repeat(500, 1).ravel() * (1 + 1e-15 * rng.integers(-9, 10, 3500)),
    ])  # fmt: skip
    scales = 10.0 ** rng.uniform(-120, 120, len(angles))
    given = [*zip(scales * np.sin(angles), scales * np.cos(angles), strict=True), (1.0, 0.0), (0.0, 2.0), (0.0, -2.0)]
    for sine, cosine in given:
        found, wanted = _angle(sine, cosine), math.atan2(sine, cosine)
        assert abs(found - wanted) <= 2.0**-51 * wanted, f"{sine!r}, {cosine!r}: {found!r}, it is {wanted!r}"


# -------------------------------------------------------------------- known solids


def test_a_dihedral_that_equals_the_crease_angle_joins_all_round():
    vertices, faces = cylinder(12)
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    for rounding in (np.float64, np.float32, lambda a: np.round(a, 6)):
        moved = rounding(vertices @ turn)
        assert len(split_creases(moved, faces, 30).source) == 4 * 12 + 2
        assert len(split_creases(moved, faces, 29.999).source) == 6 * 12 + 2
