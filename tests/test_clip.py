"""Check what the clip stage keeps of triangles that can't be placed whole."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stages import SERIAL, interpret, plain_screen

from rasterizer.pipeline import clip as stage
from rasterizer.pipeline.clip import MOST_CORNERS, N_COLUMN, clip, extend, find_nearest
from rasterizer.pipeline.transform import LIMIT_PX, OUTSIDE, transform

NEAR, FAR = 1.0, 10.0


def clip_mesh(points, faces, screen, has_own_points=True, corner=None):
    """Transform and clip a mesh; return (Clipped, vertices before it)."""
    positions = np.ascontiguousarray(np.asarray(points, float).T)
    vertex = np.ascontiguousarray(np.asarray(faces, np.uint32).reshape(-1, 3).T)
    with np.errstate(all="ignore"):
        vertices, _ = transform(positions, screen, SERIAL)
        return clip(
            positions, vertex, vertex if corner is None else corner, vertices, screen, has_own_points
        ), vertices


def share_triangles(clipped, n_old, face=0):
    """Shares (n_triangle, 3, 3) of a face's vertices in the corners of what is left of it."""
    return clipped.shares[clipped.vertex[:, clipped.face == face].T.astype(int) - n_old]


def share_of_area(triangles):
    """The part of a face that triangles of shares take up."""
    return np.abs(np.linalg.det(triangles)).sum()


DEPTHS = {"one behind": (0.25, 2.0, 3.0), "two behind": (0.25, 0.75, 4.0), "on the plane": (0.25, 1.0, 3.0)}


@pytest.mark.parametrize("is_perspective", [True, False])
@pytest.mark.parametrize("is_far", [False, True])
@pytest.mark.parametrize("turn", [0, 1, 2])
@pytest.mark.parametrize("kind", DEPTHS)
def test_keeps_the_part_between_near_and_far(kind, turn, is_far, is_perspective):
    """The kept share of the area in closed form, and new vertices in the plane."""
    depth = np.roll(np.array(DEPTHS[kind]), turn)
    plane = NEAR
    if is_far:
        depth, plane = FAR + NEAR - depth, FAR
    points = np.stack([[-1.0, 2.0, 0.5], [0.5, -1.0, 2.0], -depth], axis=1)
    screen = plain_screen(is_perspective, (NEAR, FAR), far_clip=FAR, scale=50.0)
    clipped, _ = clip_mesh(points, [[0, 1, 2]], screen)
    triangles = share_triangles(clipped, 3)
    beyond = (depth - plane) * (-1 if is_far else 1) < 0
    # A corner of the triangle is cut off where its two edges meet the plane: at these shares of them.
    alone = int(np.flatnonzero(beyond if beyond.sum() == 1 else ~beyond)[0])
    others = [k for k in range(3) if k != alone]
    corner = np.prod([(plane - depth[alone]) / (depth[k] - depth[alone]) for k in others])
    expected = 1.0 - corner if beyond.sum() == 1 else corner
    assert abs(share_of_area(triangles) - expected) <= 1e-15
    assert (
        len(triangles) == {"one behind": 2, "two behind": 1, "on the plane": 1}[kind]
        or kind == "on the plane"
    )
    assert np.abs(clipped.shares.sum(axis=1) - 1).max() <= 4e-16
    at = clipped.shares @ depth
    is_new = (clipped.shares > 0).sum(axis=1) > 1
    assert is_new.any() and np.abs(at[is_new] - plane).max() <= 1e-15 * FAR
    assert (clipped.vertices.x[3:] != OUTSIDE).all() and clipped.n_clipped == 1


def test_new_vertices_stand_where_their_points_are_seen():
    rng = np.random.default_rng(0)
    for is_perspective in (True, False):
        screen = plain_screen(is_perspective, (NEAR, FAR), far_clip=FAR, scale=20.0, center=(15.5, 9.25))
        points = rng.uniform(-4, 4, (300, 3)) - (0, 0, 4)
        faces = np.arange(300).reshape(-1, 3)
        clipped, _ = clip_mesh(points, faces, screen)
        spots = np.einsum("kc,kcx->kx", clipped.shares, points[clipped.points.astype(int)])
        w = -spots[:, 2] if is_perspective else 1.0
        x, y = 256 * (15.5 + 20 * spots[:, 0] / w), 256 * (9.25 - 20 * spots[:, 1] / w)
        off = np.maximum(np.abs(clipped.vertices.x[300:] - x), np.abs(clipped.vertices.y[300:] - y)).max()
        assert len(spots) > 50 and off <= 0.5 + 1e-8, f"{off} sub-pixels > 0.5"
        z = screen.z_offset + screen.z_scale * (-1 / spots[:, 2] if is_perspective else -spots[:, 2])
        assert np.abs(clipped.vertices.z[300:] - z).max() <= 2.0**-8


number = st.one_of(st.floats(-8, 8), st.integers(-3, 3).map(float))
depths = st.one_of(st.floats(-4, 14), st.sampled_from([NEAR, FAR, 0.0, 2.0]))
far_out = st.sampled_from([1.0, 1.0, 1.0, 2.0**19, 2.0**24])
vertex = st.tuples(number, number, depths, far_out).map(lambda v: (v[0] * v[3], v[1] * v[3], -v[2]))


@settings(max_examples=300, deadline=None)
@given(
    st.tuples(vertex, vertex, vertex, vertex),
    st.booleans(),
    st.permutations(range(3)),
    st.permutations(range(3)),
)
def test_both_faces_of_an_edge_get_the_same_new_vertices(corners, is_perspective, turn_a, turn_b):
    """Bit for bit, through all planes, however the two faces are wound and listed: no gap can open."""
    screen = plain_screen(is_perspective, (NEAR, FAR), far_clip=FAR)
    faces = np.array([np.array([0, 1, 2])[turn_a], np.array([1, 0, 3])[turn_b]])
    clipped, _ = clip_mesh(np.array(corners), faces, screen)
    on_edge = []
    for face in range(2):
        here = clipped.face == face
        index = np.unique(clipped.vertex[:, here])
        new = index[index >= 4].astype(int)
        shares, points = clipped.shares[new - 4], clipped.points[new - 4].astype(int)
        weight = np.zeros((len(new), 4))
        np.put_along_axis(weight, points, shares, axis=1)
        place = np.stack([clipped.vertices.x[new], clipped.vertices.y[new], clipped.vertices.z[new]], axis=1)
        rows = np.concatenate([weight[:, :2], place], axis=1)[
            weight[:, :2].sum(axis=1) + weight[:, 2:].sum(axis=1) > 0
        ]
        is_on = (weight[:, 2:] == 0).all(axis=1)
        on_edge.append({row.tobytes() for row in rows[is_on] + 0.0})
    if (clipped.face == 0).any() and (clipped.face == 1).any() and clipped.n_clipped == 2:
        assert on_edge[0] == on_edge[1]


def is_kept(points, screen):
    """Tell which points (n, 3) lie inside all planes, and which are so near to one that rounding decides."""
    depth = -points[:, 2]
    w = depth if screen.is_perspective else np.ones(len(points))
    room = [depth - screen.near, screen.far - depth]
    for axis in range(2):
        room += [
            LIMIT_PX * w - points[:, axis] * screen.scale_x,
            LIMIT_PX * w + points[:, axis] * screen.scale_x,
        ]
    room = np.array(room) / np.array([1, 1, *[LIMIT_PX] * 4])[:, None]
    return (room >= 0).all(axis=0), (np.abs(room) < 1e-9).any(axis=0)


@pytest.mark.parametrize("is_perspective", [True, False])
def test_what_is_left_covers_the_inside_once(is_perspective):
    """Random points of triangles that reach far out, behind the eye and beyond the far plane."""
    rng = np.random.default_rng(4)
    screen = plain_screen(is_perspective, (NEAR, FAR), far_clip=FAR)
    n_left = []
    for _ in range(150):
        corners = rng.uniform(-1, 1, (3, 3)) * (2.0 ** rng.uniform(18, 23), 2.0 ** rng.uniform(18, 23), 7) - (
            0,
            0,
            5,
        )
        clipped, before = clip_mesh(corners, [[0, 1, 2]], screen)
        if clipped.n_clipped == 0:
            continue
        triangles = share_triangles(clipped, 3)
        n_left.append(len(triangles))
        shares = rng.dirichlet(np.ones(3), 400)
        inside, unsure = is_kept(shares @ corners, screen)
        # Barycentric coordinates in each part: positive in one where the point is inside, else in none.
        within = [shares @ np.linalg.inv(t) for t in triangles if abs(np.linalg.det(t)) > 1e-12]
        count = sum(((b >= -1e-9).all(axis=1)).astype(int) for b in within) + np.zeros(len(shares), int)
        strict = sum(((b > 1e-9).all(axis=1)).astype(int) for b in within) + np.zeros(len(shares), int)
        wrong = ~unsure & ((count > 0) != inside)
        assert not wrong.any() and strict.max() <= 1, (
            f"{wrong.sum()} points kept wrongly, or covered {strict.max()} times"
        )
    assert max(n_left) >= 4 and min(n_left) == 0 and max(n_left) <= MOST_CORNERS - 2


BAD = [
    (np.nan, 0, -2),
    (np.inf, 0, -2),
    (0, -np.inf, -2),
    (0, 0, np.inf),
    (0, 0, -np.inf),
    (1e308, 1e308, -2),
    (np.inf,) * 3,
]


@pytest.mark.parametrize("is_perspective", [True, False])
@pytest.mark.parametrize("bad", BAD)
def test_what_is_not_finite_draws_nothing_and_disturbs_nothing(bad, is_perspective):
    good = np.array([(0, 0, -2), (1, 0, -2), (0, 1, -0.5), (0.5, 0.7, -3)])
    faces = [[0, 1, 3], [0, 1, 4], [0, 2, 1], [4, 2, 0], [2, 4, 4]]
    axes = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    for turn in (np.eye(3), axes):
        screen = plain_screen(is_perspective, (NEAR, FAR))
        screen = screen._replace(
            **{name: getattr(screen, name) @ turn for name in ("right", "up", "forward")}
        )
        with np.errstate(all="ignore"):
            clipped, _ = clip_mesh(np.concatenate([good @ turn, [bad]]), faces, screen)
        x, y = clipped.vertices.x[clipped.vertex].astype(int), clipped.vertices.y[clipped.vertex].astype(int)
        assert (x != OUTSIDE).all()
        area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
        drawn = set(clipped.face[area != 0].tolist())
        if np.isfinite(bad).all():
            assert {0, 2} <= drawn  # very far away is not an error
        else:
            assert drawn == {0, 2} and clipped.n_clipped == 4, f"faces {drawn} drawn"


def test_faces_keep_their_order_and_their_points():
    rng = np.random.default_rng(6)
    points = rng.uniform(-4, 4, (60, 3)) - (0, 0, 3)
    faces = rng.integers(0, 60, (200, 3))
    screen = plain_screen(True, (NEAR, FAR), far_clip=FAR, scale=30.0)
    corner = np.ascontiguousarray(rng.integers(0, 500, (3, 200)).astype(np.uint32))
    for has_own_points in (True, False):
        clipped, before = clip_mesh(points, faces, screen, has_own_points, None if has_own_points else corner)
        is_whole = (before.x[faces] != OUTSIDE).all(axis=1)
        assert (np.diff(clipped.face.astype(int)) >= 0).all()
        assert clipped.n_clipped == (~is_whole).sum() > 20 and is_whole.sum() > 20
        assert set(np.flatnonzero(is_whole)) <= set(clipped.face)
        kept = is_whole[clipped.face]
        assert (clipped.vertex[:, kept] == faces[clipped.face[kept]].T).all()
        assert (clipped.vertex[:, ~kept] >= 60).all()
        if has_own_points:
            assert (clipped.corner == clipped.vertex).all()
        else:
            assert (clipped.corner == corner[:, clipped.face]).all()
        assert [a[:60].tobytes() for a in clipped.vertices] == [a.tobytes() for a in before]


def test_parts_keep_the_winding_of_their_face():
    rng = np.random.default_rng(7)
    screen = plain_screen(True, (NEAR, FAR), far_clip=FAR, scale=200.0)
    n_part = 0
    for _ in range(100):
        points = rng.uniform(-4, 4, (3, 3)) - (0, 0, 4)
        clipped, _ = clip_mesh(points, [[0, 1, 2]], screen)
        facing = np.linalg.det(points)  # whether the eye, at the origin, sees the face counter-clockwise
        x, y = (a[clipped.vertex].astype(np.int64) for a in clipped.vertices[:2])
        area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
        large = area[np.abs(area) > 2**18]
        assert (np.sign(large) == np.sign(facing)).all()
        n_part += len(large)
    assert n_part > 50


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_attributes_of_new_points_are_linear_and_stay_in_range(dtype):
    rng = np.random.default_rng(8)
    points = rng.uniform(-4, 4, (300, 3)) - (0, 0, 3)
    clipped, _ = clip_mesh(
        points, np.arange(300).reshape(-1, 3), plain_screen(True, (NEAR, FAR), far_clip=FAR, scale=30.0)
    )
    values = rng.uniform(-1, 1, (2, 300, 4)).astype(dtype)
    values[..., 1] = dtype(0.1)  # a constant stays constant
    values[..., 2] = rng.choice(np.array([0.1, 0.3], dtype), (2, 300))
    values[..., 3] = points[:, 2]  # what the geometry itself says
    extended = extend(values, clipped)
    assert extended.dtype == dtype and (extended[:, :300] == values).all()
    new, corners = extended[:, 300:], values[:, clipped.points]
    assert new.shape[1] == len(clipped.shares) > 100
    assert (new >= corners.min(axis=2)).all() and (new <= corners.max(axis=2)).all()
    assert (new[..., 1] == dtype(0.1)).all()
    # Rounding alone would move some of many constants.
    constants = np.tile(rng.random(100).astype(dtype), (2, 300, 1))
    assert (extend(constants, clipped) == constants[:, :1]).all()
    depth = np.einsum("kc,kc->k", clipped.shares, points[clipped.points.astype(int), 2])
    assert np.abs(new[..., 3] - depth).max() <= 8 * np.finfo(dtype).eps


def test_extending_by_nothing_changes_nothing():
    points = [(0, 0, -2), (1, 0, -2), (0, 1, -2)]
    clipped, before = clip_mesh(points, [[0, 1, 2]], plain_screen())
    assert clipped.n_clipped == 0 and (clipped.vertex == [[0], [1], [2]]).all() and len(clipped.points) == 0
    values = np.ones((2, 3, 1), np.float32)
    assert (extend(values, clipped) == values).all()
    behind, _ = clip_mesh(-np.array(points), [[0, 1, 2]], plain_screen())
    assert behind.n_clipped == 1 and behind.vertex.shape == (3, 0) and behind.face.shape == (0,)


def test_without_the_compiler_the_same_comes_out(monkeypatch):
    rng = np.random.default_rng(9)
    positions = np.ascontiguousarray((rng.uniform(-4, 4, (90, 3)) - (0, 0, 3)).T)
    vertex = np.ascontiguousarray(np.arange(90, dtype=np.uint32).reshape(-1, 3).T)
    faces, screen = np.arange(30, dtype=np.uint32), plain_screen(True, (NEAR, FAR), far_clip=FAR)

    def run():
        triangles, owner = np.zeros((30 * 7, 3, N_COLUMN)), np.zeros(30 * 7, np.uint32)
        n = int(stage.clip_faces(positions, vertex, faces, screen, triangles, owner))
        nearest = float(stage.find_nearest(positions, vertex, screen, 40, 30))
        return n, triangles.tobytes(), owner.tobytes(), nearest

    compiled = run()
    interpret(monkeypatch, stage)
    assert compiled == run() and compiled[0] > 10 and np.isfinite(compiled[3])


def test_the_nearest_depth_that_is_seen():
    """Against many points that fall into the picture: none is nearer, and one is nearly as near."""
    rng = np.random.default_rng(10)
    size, found = (40, 30), []
    for is_perspective in (True, False):
        for _ in range(60):
            screen = plain_screen(is_perspective, (0.01, 100.0), scale=15.0, center=(20.0, 15.0))
            points = rng.uniform(-4, 4, (9, 3)) - (0, 0, 3)
            positions = np.ascontiguousarray(points.T)
            vertex = np.ascontiguousarray(np.arange(9, dtype=np.uint32).reshape(-1, 3).T)
            nearest = find_nearest(positions, vertex, screen, *size)
            seen = []
            for corners in points.reshape(3, 3, 3):
                spots = rng.dirichlet((0.7, 0.7, 0.7), 3000) @ corners
                w = -spots[:, 2] if is_perspective else np.ones(len(spots))
                x, y = 20 + 15 * spots[:, 0] / w, 15 - 15 * spots[:, 1] / w
                seen.append(-spots[(spots[:, 2] <= -0.01) & (x > 0) & (x < 40) & (y > 0) & (y < 30), 2])
            seen = np.concatenate(seen)
            if len(seen):
                assert seen.min() >= nearest * (1 - 1e-12), f"{seen.min()} is seen, nearer than {nearest}"
            if len(seen) > 300:
                found.append(seen.min() - nearest)
    assert len(found) > 30 and np.median(found) < 0.05, f"median {np.median(found)} > 0.05"
    behind = np.ascontiguousarray(np.abs(rng.normal(size=(3, 3))))
    assert find_nearest(behind, np.array([[0], [1], [2]], np.uint32), plain_screen(), *size) == np.inf
