"""Polygons: cut as they are, whatever their shape, unit and place, and whichever corner comes first."""

import math
from itertools import product

import numba
import numpy as np
import pytest
from helpers.against_reference import EXACT, assert_matches_reference

import rasterizer as rz
from rasterizer.geometry.ears import N_PART, exact_turn, turn_of
from rasterizer.scene.triangulation import cut_polygons

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


def test_convex_polygons_are_fans_round_their_lowest_corner():
    angle = np.arange(6) * np.pi / 3 + 0.1
    hexagon = in_space(np.stack([np.cos(angle), np.sin(angle)], axis=1))
    bent = hexagon + np.array([(0, 0, 0.1 * (k % 3)) for k in range(6)])
    for points in (hexagon, bent):
        lowest = int(np.lexsort(points.T[::-1])[0])
        for first in range(6):
            triangles = cut_one(np.roll(points, first, axis=0)).corners
            k = (lowest + first) % 6
            assert triangles.tolist() == [[k, (k + 1 + j) % 6, (k + 2 + j) % 6] for j in range(4)]


def diagonals(points):
    """Which corners of a quad in the plane z = 0 its halves meet at, and whether it crosses itself."""
    cut = cut_one(np.c_[points, np.zeros(4)])
    return tuple(sorted(set(cut.corners[0].tolist()) & set(cut.corners[1].tolist()))), bool(len(cut.crossing))


def expected_diagonal(points):
    """The same in whole numbers: the shorter one of those that part the others' corners; the lowest corner's where
    both are as long. None where neither does."""

    def turn(a, b, c):
        (ax, ay), (bx, by), (cx, cy) = (points[k].tolist() for k in (a, b, c))
        return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)

    way = turn(0, 1, 2) + turn(0, 2, 3)
    may_be = [k for k in range(2) if turn(k, k + 1, k + 2) * way > 0 and turn(k, k + 2, (k + 3) % 4) * way > 0]
    length = [((points[k + 2] - points[k]) ** 2).sum() for k in range(2)]
    lowest = min(range(4), key=lambda k: tuple(points[k].tolist()))
    k = min(may_be, key=lambda k: (length[k], k != lowest % 2), default=None)
    return None if k is None else (k, k + 2)


def test_quads_are_cut_along_the_shorter_diagonal_that_lies_inside():
    """On a small grid: concave ones, straight corners, equal diagonals, from every corner and both ways round."""
    rng, counts = np.random.default_rng(5), np.zeros(3, int)
    for _ in range(600):
        points = rng.integers(0, 6, (4, 2))
        expected, is_tie = expected_diagonal(points), np.ptp(((points[2:] - points[:2]) ** 2).sum(axis=1)) == 0
        counts += [expected is not None, is_tie, expected is None]
        for first, step in product(range(4), (1, -1)):
            order = np.roll(np.arange(4), first)[::step]
            found, is_crossing = diagonals(points[order])
            if expected is not None:
                assert tuple(sorted(order[list(found)].tolist())) == expected and not is_crossing, points.tolist()
    assert counts.min() > 30


def test_rounding_does_not_turn_the_diagonals_of_a_surface_of_revolution():
    """A quad between two circles of latitude has two diagonals of one length: files state it with six decimals."""
    turn, height = np.meshgrid(np.arange(24) * np.pi / 12 + 0.01, np.linspace(-0.9, 0.9, 10), indexing="ij")
    radius = np.sqrt(1 - height**2)
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=2).reshape(-1, 3)
    i, j = np.divmod(np.arange(24 * 9), 9)
    quads = np.stack([10 * i + j, (10 * i + j + 10) % 240, (10 * i + j + 11) % 240, 10 * i + j + 1], axis=1)
    lowest = np.array([min(quad, key=lambda v: tuple(points[v])) for quad in quads.tolist()])
    for digits in (6, 7, 16):
        mesh = rz.Mesh(np.round(points, digits), quads)
        triangles = mesh.faces.reshape(-1, 2, 3)
        assert (triangles == lowest[:, None, None]).any(axis=2).all(), f"{digits} decimals"


def test_flat_colours_count_each_corner_once():
    """However a polygon is cut; the reference agrees."""
    square = np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    material, camera = rz.Material(ambient=1, diffuse=0, specular=0), rz.Camera.orthographic((0, 0, 5), height=2.0)
    for shape, first in product((square, np.concatenate([square, [(-2.0, 0, 0)]])), range(4)):
        k = len(shape)
        colors = (np.arange(k) % 2)[:, None] * np.ones(3)
        mesh = rz.Mesh(shape, [np.roll(np.arange(k), first)], colors=colors, material=material)
        of_corners = rz.Mesh(shape, mesh.faces, polygons=mesh.polygons, colors=colors[mesh.faces], material=material)
        for each in (mesh, of_corners):
            scene = rz.Scene(each, [rz.AmbientLight(1)], camera)
            color = rz.render(scene, 8, shading="flat", tolerance=0, outputs=("color",), samples=1).color[4, 4, 0]
            assert abs(color - (np.arange(k) % 2).mean()) < 1e-6, f"first corner {first}: {color}"
            assert_matches_reference(scene, (8, 8), EXACT, shading="flat", tolerance=0)


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


N_STAR = 60000  # corners
LONG = f"is concave and has {N_STAR} corners: to cut it into triangles takes more than 536870912 steps; divide"


def test_concave_polygons_that_would_take_too_long_are_refused():
    """Ears take quadratic time; convex polygons don't, and have no limit."""
    with pytest.raises(rz.ModelError, match=f"^face 1 {LONG}"):
        rz.Mesh(in_space(star(N_STAR // 2)), [[0, 1, 2], range(N_STAR)])
    assert rz.Mesh(in_space(star(N_STAR // 2, inner=1.0)), [range(N_STAR)]).n_face == N_STAR - 2


# ---------------------------------------------------------------- turns


@numba.njit
def turns(points, parts):
    """The turn of three points, (3, 2), in both ways, compiled as they are in the kernel that cuts ears."""
    a, b, c = (points[0, 0], points[0, 1]), (points[1, 0], points[1, 1]), (points[2, 0], points[2, 1])
    return exact_turn(a, b, c, parts), turn_of(a, b, c, parts)


def test_turns_are_exact():
    """Against whole numbers: points on a line, and a little beside it."""
    rng, parts = np.random.default_rng(7), np.full(N_PART, np.nan)
    for _ in range(1000):
        points = rng.integers(-(2**26), 2**26, (3, 2)) * 2 ** int(rng.integers(0, 26))
        if rng.random() < 0.7:
            a, b = points[:2]
            points[2] = a + (b - a) * int(rng.integers(-3, 4)) + (0, int(rng.integers(-1, 2)))
        (ax, ay), (bx, by), (cx, cy) = points.tolist()
        area = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
        expected, found = (area > 0) - (area < 0), turns(points * 2.0**-54, parts)
        assert np.sign(found).tolist() == [expected] * 2, f"{points.tolist()}: {found} != {expected}"
