"""Polygons: cut as they are, whatever their shape, unit and place, and whichever corner comes first."""

import math
from itertools import product

import numpy as np
import pytest
from helpers.arrays import differences

import rasterizer as rz
from rasterizer.geometry.polygons import find_rings
from rasterizer.scene.triangulation import classify_polygons, cut_polygons

ELL = [(0, 0), (8, 0), (8, 2), (2, 2), (2, 8), (0, 8)]
KEYHOLE = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]


def star(n, inner=0.4):
    angle = np.arange(2 * n) * np.pi / n
    radius = np.where(np.arange(2 * n) % 2, inner, 1.0)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def comb(n):
    """n teeth upwards."""
    teeth = [point for k in range(n) for point in ((k, 0.5), (k + 0.4, 3), (k + 0.6, 3))]
    return [(n, 0.5), (n, 0), (0, 0), *teeth]


def spiral(n):
    angle = np.arange(n) * 0.3
    outer = np.stack([(1 + angle) * np.cos(angle), (1 + angle) * np.sin(angle)], axis=1)
    return np.concatenate([outer, (outer * (1 - 0.5 / (1 + angle))[:, None])[::-1]])


SHAPES = {
    "ell": ELL, "keyhole": KEYHOLE, "star": star(7), "comb": comb(6), "spiral": spiral(60),
    "dart": [(0, 0), (4, 0), (1, 1), (0, 4)],
    "straight corners": [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 1), (0, 2), (0, 1)],
    "repeated corners": [(0, 0), (0, 0), (3, 0), (1, 1), (1, 1), (1, 1), (0, 3)],
    "outward spike": [(0, 0), (2, 0), (5, 0), (2, 0), (2, 2), (1, 1), (0, 2)],
    "inward spike": [(0, 0), (4, 0), (4, 4), (2, 4), (2, 1), (2, 4), (0, 4)],
    "slit": [(0, 0), (4, 0), (4, 2), (1, 2), (4, 2), (4, 4), (0, 4)],
    "two holes": [
        (0, 0), (9, 0), (7, 1), (5, 1), (7, 3), (7, 1), (9, 0), (9, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (1, 1),
    ],
}  # fmt: skip


def in_space(shape, axes=((1, 0, 0), (0, 1, 0), (0, 0, 1)), unit=1.0, place=(0.0, 0.0, 0.0)):
    flat = np.asarray(shape, float)
    return (np.c_[flat, np.zeros(len(flat))] @ np.asarray(axes).T) * unit + np.asarray(place)


def shoelace(points):
    """The polygon's area vector, with an exact sum of each component."""
    after = np.roll(points, -1, axis=0)
    parts = np.cross(points - points[0], after - points[0]) / 2
    return np.array([math.fsum(column) for column in parts.T])


def areas(points, triangles):
    corners = points[triangles]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2


def cut_one(points):
    cut = cut_polygons(points, np.arange(len(points)), [len(points)])
    assert cut.corners.shape == (len(points) - 2, 3), "a polygon of k corners has k - 2 triangles"
    return cut


def random_axes(rng):
    return np.linalg.qr(rng.normal(size=(3, 3)))[0]


def as_places(points, triangles):
    return sorted(tuple(sorted(map(tuple, corners))) for corners in points[triangles].tolist())


def test_a_polygon_is_covered_once():
    """The triangles' areas sum up to the polygon's, none against it: so none overlap, and none lie outside."""
    rng = np.random.default_rng(1)
    for name, case in product(SHAPES, range(15)):
        unit = 10.0 ** rng.integers(-30, 31)
        axes = np.eye(3) if case % 3 == 0 else random_axes(rng)
        place = axes @ rng.normal(size=3) * unit * rng.choice([0, 1, 1e6])
        points = in_space(SHAPES[name], axes, unit, place)
        points = np.roll(points, rng.integers(len(points)), axis=0)[:: rng.choice([-1, 1])]
        cut = cut_one(points)
        assert len(cut.crossing) == 0, f"{name}, case {case}, is said to cross itself"
        expected = shoelace(points)
        direction = expected / np.linalg.norm(expected)
        parts = areas(points, cut.corners) @ direction
        # Coordinates of 10^6 units are known to 10^-10.
        slack = 1e-13 * np.linalg.norm(expected) + 1e-15 * np.abs(points).max() * np.ptp(points, axis=0).max() * 40
        off = float(np.abs(np.abs(parts).sum() - np.linalg.norm(expected)) / slack)
        assert off <= 1.0, f"{name}, case {case}: area off by {off:.3g} > 1 times what rounding explains"


def test_the_picture_shows_the_polygon():
    """Counted in pixels, flat and interpolated."""
    for shape, shading in ((ELL, "flat"), (KEYHOLE, "gouraud"), (np.array(star(5)) * 4, "phong")):
        points = in_space(shape)
        area = np.linalg.norm(shoelace(points))
        low, high = points.min(axis=0), points.max(axis=0)
        middle, size = (low + high) / 2, (high - low).max()
        camera = rz.Camera.orthographic(tuple(middle + (0, 0, 5)), tuple(middle), (0, 1, 0), float(size))
        scene = rz.Scene(rz.Mesh(points, [range(len(points))]), camera=camera)
        frame = rz.render(scene, 200, shading=shading, outputs=("face",))
        drawn = (frame.face >= 0).mean() * size**2
        assert abs(drawn - area) < 0.02 * area, f"{shading}: {drawn:.2f} of an area of {area:.2f} is drawn"


def test_the_triangles_do_not_depend_on_the_first_corner_nor_the_direction():
    rng = np.random.default_rng(2)
    for (name, shape), is_turned in product(SHAPES.items(), (False, True)):
        points = in_space(shape, random_axes(rng) if is_turned else np.eye(3))
        expected = as_places(points, cut_one(points).corners)
        for first, step in product(range(0, len(points), 1 + len(points) // 15), (1, -1)):
            other = np.roll(points, first, axis=0)[::step]
            found = as_places(other, cut_one(other).corners)
            assert found == expected, f"{name}, first corner {first}, direction {step}"


def check_random_polygons(seed, n):
    """Corners on a small grid: straight lines, repeated corners, spikes, touching and crossing edges of all kinds."""
    rng, n_crossing = np.random.default_rng(seed), 0
    for _ in range(n):
        k = int(rng.integers(4, 9))
        points = in_space(rng.integers(0, rng.integers(2, 7), (k, 2)))
        cut = cut_one(points)
        parts = areas(points, cut.corners)[:, 2]
        total = shoelace(points)[2]
        is_covered_once = abs(np.abs(parts).sum() - abs(total)) < 1e-12
        assert abs(parts.sum() - total) < 1e-12, f"{points[:, :2].tolist()}: {parts.tolist()} of {total}"
        assert is_covered_once or len(cut.crossing) == 1, f"{points[:, :2].tolist()}: {parts.tolist()} of {total}"
        n_crossing += len(cut.crossing)
    assert 0.1 * n < n_crossing < 0.9 * n


def test_random_polygons_are_covered_once_or_are_said_to_cross_themselves():
    check_random_polygons(3, 800)


@pytest.mark.nightly
def test_many_random_polygons_are_covered_once_or_are_said_to_cross_themselves():
    check_random_polygons(4, 20_000)


def test_a_polygon_that_crosses_itself_is_warned_of(tmp_path):
    points = in_space(star(5)[::2][[0, 2, 4, 1, 3]])
    k = len(points)
    with pytest.warns(UserWarning, match="face 1 crosses itself"):
        rz.Mesh(np.r_[points, [(9, 9, 9)]], [(0, 1, k), range(k)])
    lines = [f"v {x} {y} {z}" for x, y, z in points] + ["", "f 1 2 3", "f " + " ".join(map(str, range(1, k + 1)))]
    (tmp_path / "bow.obj").write_text("\n".join(lines) + "\n")
    with pytest.warns(UserWarning, match=rf"bow\.obj:{k + 3}: the face crosses itself"):
        rz.load(tmp_path / "bow.obj")


def test_convex_polygons_are_fans_and_bent_ones_begin_at_their_least_corner():
    angle = np.arange(6) * np.pi / 3 + 0.1
    hexagon = in_space(np.stack([np.cos(angle), np.sin(angle)], axis=1))
    assert cut_one(hexagon).corners.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]
    bent = hexagon + np.array([(0, 0, 0.1 * (k % 3)) for k in range(6)])
    least = int(np.lexsort(bent.T[::-1])[0])
    for first in range(6):
        triangles = cut_one(np.roll(bent, first, axis=0)).corners
        assert not differences(triangles[:, 0], (least + first) % 6)


def test_corners_that_turn_all_one_way_but_twice_round_are_not_convex():
    angle = np.arange(5) * 4 * np.pi / 5
    is_convex, is_plane = classify_polygons(in_space(np.stack([np.cos(angle), np.sin(angle)], axis=1))[:, None])
    assert not is_convex[0] and is_plane[0]


def test_polygons_that_are_not_finite_or_points_disturb_nobody():
    points = [
        (0, 0, 0),
        (1, 0, 0),
        (1, 1, 0),
        (np.nan, 1, 0),
        (np.inf, 0, 0),
        (1e308, -1e308, 0),
        (-1e308, 1e308, 1e308),
    ]
    points = np.array(points)
    corners = [0, 1, 2, 3, 4, 5, 6, 0, 0, 0, 0, 0, 0, 5, 6, 1, 2, 0]
    cut = cut_polygons(points, np.array(corners), [4, 4, 4, 3, 3])
    assert len(cut.corners) == 8 and cut.polygons.tolist() == [0, 0, 1, 1, 2, 2, 3, 4]


def test_short_polygons_yield_nothing():
    points = in_space([(0, 0), (1, 0), (1, 1), (0, 1)])
    cut = cut_polygons(points, np.array([0, 1, 0, 1, 2, 3, 2]), [2, 4, 1])
    assert cut.corners.tolist() == [[2, 3, 4], [2, 4, 5]] and cut.polygons.tolist() == [1, 1]


def test_ten_thousand_corners():
    rng = np.random.default_rng(0)
    angle = np.linspace(0, 2 * np.pi, 10_000, endpoint=False)
    radius = 1 + 0.5 * rng.random(len(angle))
    points = in_space(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1))
    cut = cut_one(points)
    parts, total = areas(points, cut.corners)[:, 2], shoelace(points)[2]
    assert parts.min() >= 0 and abs(parts.sum() - total) < 1e-12
    round_one = in_space(np.stack([np.cos(angle), np.sin(angle)], axis=1))
    assert not differences(cut_one(round_one).corners[:, 0], 0)


def test_rings_are_found_again():
    rng = np.random.default_rng(4)
    angle = np.arange(9) * 2 * np.pi / 9
    points = in_space(np.stack([np.cos(angle), np.sin(angle)], axis=1), random_axes(rng))
    faces = [[0, 1, 2], [0, 2, 4, 6], [3, 4, 5, 7, 8], [1, 2, 3], [8, 0, 1, 2, 3, 4, 5, 6, 7]]
    mesh = rz.Mesh(points, faces)
    rings = find_rings(mesh.faces, mesh.polygons, points)
    assert rings.start.tolist() == [1, 3, 7]
    for ring, face in enumerate(faces[k] for k in (1, 2, 4)):
        loop = rings.corners[rings.offsets[ring] : rings.offsets[ring + 1]].tolist()
        turn = face.index(loop[0])
        assert loop == face[turn:] + face[:turn]
    dart = rz.Mesh(in_space(SHAPES["dart"]), [(0, 1, 2, 3)])
    assert len(find_rings(dart.faces, dart.polygons, dart.vertices).start) == 0


N_STAR = 60000  # corners
LONG = f"is concave and has {N_STAR} corners: to cut it into triangles takes more than 1073741824 steps; divide"


def test_concave_polygons_that_would_take_too_long_are_refused():
    """Ears take quadratic time; convex polygons don't, and have no limit."""
    with pytest.raises(rz.ModelError, match=f"^face 1 {LONG}"):
        rz.Mesh(in_space(star(N_STAR // 2)), [[0, 1, 2], range(N_STAR)])
    assert rz.Mesh(in_space(star(N_STAR // 2, inner=1.0)), [range(N_STAR)]).n_face == N_STAR - 2


@pytest.mark.nightly
def test_polygons_of_files_that_would_take_too_long_are_refused_with_their_place(tmp_path):
    points = in_space(star(N_STAR // 2))
    lines = [f"{x} {y} {z}" for x, y, z in points.tolist()]
    face = "f " + " ".join(map(str, range(2, N_STAR + 2)))
    (tmp_path / "star.obj").write_text("\n".join(["v 0 0 0", *(f"v {line}" for line in lines), "f 1 2 3", face]))
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {N_STAR}\n{axes}element face 1\nproperty list int int vertex_indices\n"
    )
    loop = f"{N_STAR} " + " ".join(map(str, range(N_STAR)))
    (tmp_path / "star.ply").write_text("\n".join([head + "end_header", *lines, loop]) + "\n")
    for name, place in (("star.obj", rf"star\.obj:{N_STAR + 3}: the face"), ("star.ply", r"star\.ply.*")):
        with pytest.raises(rz.ModelError, match=f"{place} {LONG}"):
            rz.load(tmp_path / name)
    with pytest.raises(rz.ModelError, match="face [1-9].* and the [1-9].* concave ones before it into triangles takes"):
        rz.Mesh(in_space(star(6000)), np.tile(np.arange(12000), (20, 1)))
