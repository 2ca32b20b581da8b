"""Normals and creases: a slow twin on random broken meshes, known solids, slivers, scales, sizes, errors."""

import os
import subprocess
import sys
import time
from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rasterizer.errors import ModelError, SceneError
from rasterizer.geometry.normals import face_normals, polygon_normals, split_creases, vertex_normals

WEIGHTINGS = ("angle", "area", "uniform")


# -------------------------------------------------------------------------- solids
def cube():
    vertices = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return vertices, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def ring(n, z, radius=1.0):
    angles = 2 * np.pi * np.arange(n) / n
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(n, z)])


def cylinder(n):
    """Closed cylinder. Faces: wall (2 n), two caps (n each); vertices: bottom ring, top ring, two centres."""
    vertices = np.vstack([ring(n, 0.0), ring(n, 1.0), [[0, 0, 0], [0, 0, 1]]])
    faces = []
    for i in range(n):
        j = (i + 1) % n
        faces += [(i, j, n + j), (i, n + j, n + i)]
    faces += [(2 * n, (i + 1) % n, i) for i in range(n)]
    faces += [(2 * n + 1, n + i, n + (i + 1) % n) for i in range(n)]
    return vertices, np.array(faces)


def cone(n, height):
    vertices = np.vstack([[[0, 0, height]], ring(n, 0.0)])
    i = np.arange(n)
    return vertices, np.column_stack([0 * i, 1 + i, 1 + (i + 1) % n])


def fin(*angles, leaves=None):
    """Faces at the given degrees round the edge 0-1 (z axis); leaves[k]: whether face k runs from 0 to 1."""
    radians = np.radians(angles)
    tips = np.column_stack([np.cos(radians), np.sin(radians), np.full(len(angles), 0.5)])
    faces = [(0, 1, 2 + k) if leaves is None or leaves[k] else (1, 0, 2 + k) for k in range(len(angles))]
    return np.vstack([[[0, 0, 0], [0, 0, 1]], tips]), np.array(faces)


def sphere(n):
    """Sphere of 4 n (n - 1) faces with two open poles."""
    u, v = np.meshgrid(2 * np.pi * np.arange(2 * n) / (2 * n), np.linspace(0.1, np.pi - 0.1, n))
    vertices = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1).reshape(-1, 3)
    row, i = 2 * n * np.arange(n - 1)[:, None], np.arange(2 * n)[None]
    a, b = row + i, row + (i + 1) % (2 * n)
    quads = np.stack([a, a + 2 * n, b + 2 * n, b], axis=-1).reshape(-1, 4)
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.uint32)


def corner_normals(split):
    return split.normals[split.faces]


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


def check_split(vertices, faces, split):
    """Hold a Split to what must always be true."""
    used = split.faces.reshape(-1)
    assert split.faces.dtype == np.uint32 and split.source.dtype == np.uint32
    assert np.array_equal(split.source[split.faces], faces)
    assert np.array_equal(np.unique(used), np.arange(len(split.source)))
    sources, first_use = np.unique(np.asarray(faces).reshape(-1), return_index=True)
    run_starts = np.flatnonzero(np.diff(split.source.astype(np.int64), prepend=-1))
    assert np.array_equal(split.source[run_starts], sources[np.argsort(first_use)])
    lengths = np.linalg.norm(split.normals, axis=1)
    assert np.all((np.abs(lengths - 1) < 1e-15 * 4) | (lengths == 0))


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


@settings(max_examples=400, deadline=None)
@given(meshes(), angles, st.sampled_from(WEIGHTINGS), st.booleans(), st.randoms(use_true_random=False))
def test_split_equals_slow_twin(mesh, crease_angle, weighting, has_groups, random):
    vertices, faces = mesh
    smoothing = np.array([random.randrange(3) for _ in faces]) if has_groups else None
    split = split_creases(vertices, faces, crease_angle, weighting, smoothing)
    check_split(vertices, faces, split)
    expected, names = twin_split(vertices, faces, crease_angle, weighting, smoothing)
    error = np.abs(corner_normals(split) - expected).max()
    assert error < 1e-7, f"measured {error} > 1e-7"
    pairs = set(zip(split.faces.reshape(-1).tolist(), names.reshape(-1), strict=True))
    assert len(pairs) == len(split.source) == len({name for _, name in pairs})


@settings(max_examples=100, deadline=None)
@given(meshes(), st.sampled_from(WEIGHTINGS))
def test_vertex_and_face_normals_equal_slow_twin(mesh, weighting):
    vertices, faces = mesh
    normals, areas = zip(*[twin_face(vertices, face) for face in faces], strict=True)
    assert np.allclose(face_normals(vertices, faces), normals, rtol=0, atol=1e-12)
    computed = vertex_normals(vertices, faces, weighting)
    for vertex in range(len(vertices)):
        corners = [(f, k) for f, k in np.argwhere(faces == vertex) if areas[f] > 0]
        weights = [twin_weight(vertices, faces[f], k, areas[f], weighting) for f, k in corners]
        total = sum((w * normals[f] for w, (f, _) in zip(weights, corners, strict=True)), np.zeros(3))
        part = np.linalg.norm(total) / sum(weights) if corners else 0.0
        assume(not 1e-8 < part < 1e-5)
        kept = normals[corners[0][0]] if corners else np.zeros(3)
        expected = total / np.linalg.norm(total) if part > 1e-6 else kept
        assert np.allclose(computed[vertex], expected, rtol=0, atol=1e-7)


# -------------------------------------------------------------------- known solids
@pytest.mark.parametrize(("crease_angle", "n_split"), [(0, 24), (30, 24), (89.999, 24), (90, 8), (180, 8)])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("offset", [0.0, 1e4])
def test_cube_splits_under_a_right_angle(crease_angle, n_split, scale, offset):
    vertices, faces = cube()
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    split = split_creases((vertices @ turn + offset) * scale, faces, crease_angle)
    check_split(vertices, faces, split)
    assert len(split.source) == n_split


def test_cube_averages():
    vertices, faces = cube()
    joined = split_creases(vertices, faces, 90)
    # weighted by angle the diagonals of the faces don't matter: Thürmer & Wüthrich's own example
    assert np.allclose(joined.normals, vertices[joined.source] / np.sqrt(3), rtol=0, atol=1e-15)
    assert np.allclose(vertex_normals(vertices, faces), vertices / np.sqrt(3), rtol=0, atol=1e-15)
    assert not np.allclose(vertex_normals(vertices, faces, "uniform"), vertices / np.sqrt(3), atol=0.1)
    sharp = split_creases(vertices, faces, 30)
    assert np.array_equal(corner_normals(sharp), np.repeat(face_normals(vertices, faces)[:, None], 3, axis=1))


def test_cylinder_has_a_smooth_wall_and_sharp_rims():
    n = 24
    vertices, faces = cylinder(n)
    split = split_creases(vertices, faces, 30)
    assert len(split.source) == 4 * n + 2
    wall, caps = corner_normals(split)[: 2 * n], corner_normals(split)[2 * n :]
    radial = vertices[faces[: 2 * n]] * [1, 1, 0]
    # each ring vertex sees three wall triangles; by angle (90 and 45 + 45 degrees) both walls weigh the same
    assert np.allclose(wall, radial, rtol=0, atol=1e-14)
    assert np.array_equal(caps[:n], np.broadcast_to([0.0, 0.0, -1.0], (n, 3, 3)))
    assert np.array_equal(caps[n:], np.broadcast_to([0.0, 0.0, 1.0], (n, 3, 3)))


@pytest.mark.parametrize("rounding", [lambda a: a, np.float32, lambda a: np.round(a, 6)])
def test_a_dihedral_that_equals_the_crease_angle_joins_all_round(rounding):
    vertices, faces = cylinder(12)
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    vertices = rounding(vertices @ turn)
    assert len(split_creases(vertices, faces, 30).source) == 4 * 12 + 2
    assert len(split_creases(vertices, faces, 29.999).source) == 6 * 12 + 2


def test_cone_apex_has_one_normal_or_many():
    vertices, faces = cone(8, 1.0)
    sharp, smooth = split_creases(vertices, faces, 20), split_creases(vertices, faces, 40)
    assert np.count_nonzero(sharp.source == 0) == 8 and np.count_nonzero(smooth.source == 0) == 1
    assert np.allclose(smooth.normals[smooth.source == 0], [0, 0, 1], rtol=0, atol=1e-15)


def test_saw_tooth_does_not_become_a_flat_sheet():
    n = 9
    x = np.arange(n)
    vertices = np.array([[i, y, i % 2] for i in x for y in (0.0, 1.0)], dtype=float)
    faces = [t for i in x[:-1] for t in ((2 * i, 2 * i + 2, 2 * i + 3), (2 * i, 2 * i + 3, 2 * i + 1))]
    averaged = vertex_normals(vertices, faces)[2:-2]
    assert np.allclose(averaged, [0, 0, 1], rtol=0, atol=1e-14), "the fault that the crease is to cure"
    shaded = corner_normals(split_creases(vertices, faces, 30))
    assert np.allclose(shaded, face_normals(vertices, faces)[:, None], rtol=0, atol=1e-15)


# ------------------------------------------------------------------- broken meshes
def test_one_face_wound_badly_keeps_the_average_and_turns_it():
    vertices, faces = sphere(12)
    good = corner_normals(split_creases(vertices, faces, 60))
    turned = faces.copy()
    turned[100] = turned[100, ::-1]
    split = split_creases(vertices, turned, 60)
    bad = corner_normals(split)
    assert len(split.source) == len(vertices) + 3
    assert np.allclose(bad[100], -good[100, ::-1], rtol=0, atol=1e-14)
    assert np.allclose(np.delete(bad, 100, axis=0), np.delete(good, 100, axis=0), rtol=0, atol=1e-14)


def test_non_manifold_edge_joins_every_pair_within_the_angle():
    # 0 and 180 degrees lie in one plane, 90 stands on it
    vertices, faces = fin(0, 180, 90, leaves=(True, False, True))
    split = split_creases(vertices, faces, 10)
    assert split.faces[0, 0] == split.faces[1, 1] != split.faces[2, 0]
    joined = split_creases(vertices, faces, 90)
    assert len(np.unique(joined.faces[[0, 1, 2], [0, 1, 0]])) <= 2


def test_a_walk_that_contradicts_itself_takes_the_first_link():
    vertices, faces = fin(0, 120, 240)
    split = split_creases(vertices, faces, 180)
    check_split(vertices, faces, split)
    again = split_creases(vertices, faces, 180)
    assert all(np.array_equal(a, b) for a, b in zip(split, again, strict=True))


def test_cancelling_faces_keep_their_own_normals():
    vertices, faces = np.eye(3), np.array([[0, 1, 2], [0, 2, 1]])
    split = split_creases(vertices, faces, 180)
    assert np.array_equal(corner_normals(split), np.repeat(face_normals(vertices, faces)[:, None], 3, axis=1))
    assert np.allclose(vertex_normals(vertices, faces), 1 / np.sqrt(3))


def test_faces_without_area_join_and_add_nothing():
    vertices, faces = cube()
    vertices = np.vstack([vertices, [[0, 0, 1]], [[5, 5, 5]], [[6, 6, 6]]])
    flat = [(1, 8, 7), (0, 0, 3), (9, 9, 10), (10, 10, 10)]
    split = split_creases(vertices, np.vstack([flat, faces]), 30)
    check_split(vertices, np.vstack([flat, faces]), split)
    assert len(split.source) == 24 + 3
    assert np.array_equal(corner_normals(split)[4:], corner_normals(split_creases(*cube(), 30)))
    assert np.all(np.linalg.norm(split.normals[split.source < 8], axis=1) == 1)
    assert not split.normals[split.source >= 8].any()


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e200])
def test_coordinates_that_are_not_usable_stay_where_they_are(value):
    vertices, faces = cube()
    vertices[7] = value
    split = split_creases(vertices, faces, 30)
    assert np.isfinite(split.normals).all() and np.isfinite(vertex_normals(vertices, faces)).all()
    assert np.isfinite(face_normals(vertices, faces)).all()


def test_smoothing_groups_rule_over_angles():
    vertices, faces = cube()
    assert len(split_creases(vertices, faces, 30, smoothing=np.full(12, 4)).source) == 8
    # in group 0 even the two halves of a square are apart
    assert len(split_creases(vertices, faces, 180, smoothing=np.zeros(12, int)).source) == 36
    by_side = np.repeat(np.arange(1, 7), 2)
    assert len(split_creases(vertices, faces, 180, smoothing=by_side).source) == 24


def test_polygons_of_any_shape():
    # an arrow head, concave at vertex 2: the fan from vertex 0 has one triangle turned over
    vertices = np.array([[0, 0, 0], [4, 0, 0], [1, 1, 0], [0, 4, 0], [9, 9, 9]], dtype=float)
    faces = np.array([[1, 2, 3], [1, 3, 0], [4, 4, 0]])
    assert np.array_equal(face_normals(vertices, faces)[:2, 2], [-1, 1])
    normals = polygon_normals(vertices, faces, [1, 1, 3])
    assert np.array_equal(normals, [[0, 0, 0], [0, 0, 1], [0, 0, 0], [0, 0, 0]])


# ------------------------------------------------------------------------- numbers
@pytest.mark.parametrize("thin", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_needles_have_exact_normals_and_weights(thin, scale):
    vertices = np.array([[0, 0, 0], [1, 2, 3], [1 + 2 * thin, 2 - thin, 3]]) * scale
    a, b, c = np.array([[Fraction(x) for x in vertex] for vertex in vertices])
    exact = np.array(np.cross(b - a, c - a) * 10**40, dtype=float)
    exact /= np.linalg.norm(exact)
    for turn in range(3):
        computed = face_normals(np.roll(vertices, turn, axis=0), [[0, 1, 2]])[0]
        error = np.abs(computed - exact).max()
        assert error < 4e-16, f"measured {error} > 4e-16"
    # beside a right angle that looks up, a needle that looks right tilts the average by its own small angle
    wall = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, thin]]) * scale
    normal = vertex_normals(wall, [[0, 1, 2], [0, 2, 3]])[0]
    assert normal[0] / normal[2] == pytest.approx(np.arctan(thin) / (np.pi / 2), rel=1e-14)


@settings(max_examples=60, deadline=None)
@given(st.integers(-6, 6), st.integers(-3, 3), st.integers(0, 5))
def test_scale_and_offset_change_nothing(exponent, shift, seed):
    vertices, faces = sphere(5)
    vertices = np.round(vertices + np.random.default_rng(seed).normal(scale=0.2, size=vertices.shape), 3)
    vertices = np.rint(vertices * 1024) / 1024
    base = split_creases(vertices, faces, 25)
    moved = split_creases((vertices + shift * 4096) * 2.0 ** (exponent * 3), faces, 25)
    assert all(np.array_equal(a, b) for a, b in zip(base, moved, strict=True))


def test_order_of_faces_and_start_of_a_face_do_not_matter():
    vertices, faces = cylinder(9)
    order = np.random.default_rng(0).permutation(len(faces))
    base = corner_normals(split_creases(vertices, faces, 50))
    shuffled = corner_normals(split_creases(vertices, faces[order], 50))
    rotated = corner_normals(split_creases(vertices, np.roll(faces, 1, axis=1), 50))
    assert np.allclose(shuffled, base[order], rtol=0, atol=1e-15)
    assert np.allclose(np.roll(rotated, -1, axis=1), base, rtol=0, atol=1e-15)


def test_all_weightings_agree_on_a_symmetric_fan():
    vertices, faces = cone(6, 0.5)
    tops = [vertex_normals(vertices, faces, weighting)[0] for weighting in WEIGHTINGS]
    assert np.allclose(tops, [0, 0, 1], rtol=0, atol=1e-15)


# ----------------------------------------------------------------- size and border
def test_an_apex_of_many_faces_is_not_quadratic():
    vertices, faces = cone(10_000, 0.01)
    order = np.random.default_rng(1).permutation(len(faces))
    split_creases(vertices[:3], [[0, 1, 2]], 30)
    start = time.perf_counter()
    split = split_creases(vertices, faces[order], 30)
    seconds = time.perf_counter() - start
    assert len(split.source) == len(vertices)
    assert seconds < 1.0, f"measured {seconds} > 1.0; 0.01 is usual, but all pairs take longer"


def test_a_smooth_mesh_keeps_its_vertices():
    vertices, faces = sphere(60)
    split = split_creases(vertices, faces, 30)
    check_split(vertices, faces, split)
    assert len(split.source) == len(vertices)
    assert np.abs(split.normals - vertex_normals(vertices, faces)[split.source]).max() < 1e-14
    assert np.einsum("ij,ij->i", split.normals, vertices[split.source]).min() > 0.99


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
        assert all(np.array_equal(a, b) for a, b in zip(split_creases(v, f, 30), base, strict=True))
        assert np.array_equal(v, before[0]) and np.array_equal(f, before[1])
    frozen = vertices.copy()
    frozen.flags.writeable = False
    split_creases(frozen, faces, 30)
    assert vertices.flags.writeable and faces.flags.writeable and base.normals.flags.writeable


def test_empty_meshes():
    for vertices in (np.zeros((0, 3)), np.zeros((2, 3))):
        split = split_creases(vertices, np.zeros((0, 3), int), 30)
        assert split.faces.shape == (0, 3) and split.source.shape == (0,) and split.normals.shape == (0, 3)
        assert vertex_normals(vertices, []).shape == (len(vertices), 3)
        assert face_normals(vertices, []).shape == polygon_normals(vertices, [], []).shape == (0, 3)


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        ({"faces": [[0, 1, 8]]}, ModelError, "vertex 8; the last of the vertices is 7"),
        ({"faces": [[0, -1, 2]]}, ModelError, "vertex -1"),
        ({"faces": [[0, 1, 2, 3]]}, ModelError, r"\(1, 4\)"),
        ({"faces": [[0.0, 1.0, 2.0]]}, ModelError, "float64"),
        ({"vertices": np.zeros((8, 2))}, ModelError, r"\(8, 2\)"),
        ({"crease_angle": 181}, SceneError, "181"),
        ({"crease_angle": -1}, SceneError, "-1"),
        ({"crease_angle": float("nan")}, SceneError, "nan"),
        ({"weighting": "volume"}, SceneError, "volume"),
        ({"smoothing": [1, 2]}, ModelError, r"12 integers.*\(2,\)"),
    ],
)
def test_errors_say_what_is_wrong(change, error, text):
    vertices, faces = cube()
    with pytest.raises(error, match=text):
        split_creases(**{"vertices": vertices, "faces": faces, "crease_angle": 30} | change)


def test_polygon_indices_are_checked():
    with pytest.raises(ModelError, match="-2"):
        polygon_normals(np.eye(3), [[0, 1, 2]], [-2])
    with pytest.raises(ModelError, match="1 integers"):
        polygon_normals(np.eye(3), [[0, 1, 2]], [0, 0])


def test_the_same_without_the_compiler():
    code = (
        "import sys; sys.path[:0] = ['geometry', '.']\n"
        "from test_normals import *\n"
        "s = split_creases(*cylinder(7), 60)\n"
        "n = vertex_normals(*cube())\n"
        "print(s.faces.tolist(), s.source.tolist(), np.round([*n, *s.normals], 12).tolist())"
    )
    folder = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))  # tests/
    texts = [
        subprocess.run(
            [sys.executable, "-W", "error", "-c", code],
            env={**os.environ, "NUMBA_DISABLE_JIT": flag},
            cwd=folder,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.replace("-0.0,", "0.0,")
        for flag in "01"
    ]
    assert texts[0] == texts[1] and texts[0]


@pytest.mark.parametrize("smoothing", [None, 1])
def test_an_edge_of_many_faces_is_no_part_of_a_surface(smoothing):
    """The pages of a book: up to 64 at its back are compared two by two, more of them stay as they are."""
    for n_page, is_joined in ((60, True), (200_000, False)):
        angle = np.arange(n_page) * (2 * np.pi / n_page)
        pages = np.stack([np.cos(angle), np.sin(angle), np.full(n_page, 0.5)], axis=1)
        vertices = np.concatenate([[(0, 0, 0), (0, 0, 1)], pages])
        faces = np.stack([np.zeros(n_page), np.ones(n_page), np.arange(n_page) + 2], axis=1).astype(int)
        groups = None if smoothing is None else np.full(n_page, smoothing)
        split = split_creases(vertices, faces, 40.0, smoothing=groups)
        at_back = (split.source < 2).sum()
        assert (at_back < 2 * n_page) == is_joined, f"{at_back} split vertices at the back of {n_page} pages"
