"""Check what the clip stage keeps of triangles that can't be placed whole."""

import numpy as np
import pytest
from helpers.against_reference import EXACT, compare_with_reference
from helpers.stages import SERIAL, interpret, plain_screen
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

import rasterizer as rz
from rasterizer.pipeline import clip as stage
from rasterizer.pipeline.clip import MOST_CORNERS, N_CORNER_COLUMN, clip, find_nearest
from rasterizer.pipeline.drawables import Triangles
from rasterizer.pipeline.face_planes import compute_face_planes
from rasterizer.pipeline.transform import DEPTH_MARGIN, LIMIT_PX, OUTSIDE, transform

NEAR, FAR = 1.0, 10.0


def clip_mesh(points, faces, screen, corner=None):
    """Transform and clip a mesh; return (Clipped, vertices before it)."""
    positions = np.ascontiguousarray(np.asarray(points, float).T)
    vertex = np.ascontiguousarray(np.asarray(faces, np.uint32).reshape(-1, 3).T)
    with np.errstate(all="ignore"):
        vertices, _ = transform(positions, screen, SERIAL)
        triangles = Triangles(vertex, vertex if corner is None else corner, np.zeros(vertex.shape[1], np.uint8))
        return clip(positions, triangles, vertices, screen), vertices


def clip_shares(points, screen, faces=((0, 1, 2),)):
    """The parts of triangles before they are rounded: shares (n_part, 3, 3) of their vertices in the parts' corners,
    and the triangle of each part. `points` are those of a camera at the origin that looks down -z."""
    points, faces = np.asarray(points, float), np.asarray(faces, np.uint32)
    parts, owners = np.empty((7 * len(faces), 3, N_CORNER_COLUMN)), np.empty(7 * len(faces), np.uint32)
    numbers = np.arange(len(faces), dtype=np.uint32)
    columns = np.ascontiguousarray(points.T), np.ascontiguousarray(faces.T)
    n = stage.clip_faces(*columns, numbers, screen, stage.make_clip_scratch(), parts, owners)
    parts, owners = parts[:n], owners[:n]
    of_eye = points[faces] * (1, 1, -1)  # across, upward, depth
    return np.linalg.solve(of_eye.swapaxes(1, 2)[owners], parts[:, :, [1, 2, 0]].swapaxes(1, 2)).swapaxes(1, 2), owners


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
    triangles, _ = clip_shares(points, screen)
    beyond = (depth - plane) * (-1 if is_far else 1) < 0
    # A corner of the triangle is cut off where its two edges meet the plane: at these shares of them.
    alone = int(np.flatnonzero(beyond if beyond.sum() == 1 else ~beyond)[0])
    others = [k for k in range(3) if k != alone]
    corner = np.prod([(plane - depth[alone]) / (depth[k] - depth[alone]) for k in others])
    expected = 1.0 - corner if beyond.sum() == 1 else corner
    assert abs(share_of_area(triangles) - expected) <= 1e-14
    is_part = np.abs(np.linalg.det(triangles)) > 1e-12  # a vertex on the plane leaves a second part without area
    assert is_part.sum() == {"one behind": 2, "two behind": 1, "on the plane": 1}[kind]
    assert len(triangles) - is_part.sum() == (kind == "on the plane")
    assert np.abs(triangles.sum(axis=2) - 1).max() <= 1e-14
    at = triangles @ depth
    is_new = (np.abs(triangles) > 1e-12).sum(axis=2) > 1
    assert is_new.any() and np.abs(at[is_new] - plane).max() <= 1e-14 * FAR
    assert (clipped.vertices.x[3:] != OUTSIDE).all() and clipped.n_clipped == 1


def test_new_vertices_stand_where_their_points_are_seen():
    """And their depths are those of the whole face at the rounded places."""
    rng = np.random.default_rng(0)
    for is_perspective in (True, False):
        screen = plain_screen(is_perspective, (NEAR, FAR), far_clip=FAR, scale=20.0, center=(15.5, 9.25))
        points = rng.uniform(-4, 4, (300, 3)) - (0, 0, 2)
        faces = np.arange(300).reshape(-1, 3)
        clipped, before = clip_mesh(points, faces, screen)
        crossing = np.flatnonzero((before.x[faces] == OUTSIDE).any(axis=1))
        shares, owners = clip_shares(points, screen, faces[crossing])
        spots = np.einsum("pkc,pcx->pkx", shares, points[faces[crossing[owners]]]).reshape(-1, 3)
        w = -spots[:, 2] if is_perspective else 1.0
        x, y = 256 * (15.5 + 20 * spots[:, 0] / w), 256 * (9.25 - 20 * spots[:, 1] / w)
        new = clipped.vertices.x[300:], clipped.vertices.y[300:], clipped.vertices.z[300:]
        off = np.maximum(np.abs(new[0] - x), np.abs(new[1] - y)).max()
        assert len(spots) > 50 and off <= 0.5 + 1e-8, f"{off} sub-pixels > 0.5"
        # On a face all of whose vertices are seen, rounding moves the plane; else it is that of the points themselves.
        corners = points[faces[crossing[owners]]]
        is_behind = np.repeat((corners[:, :, 2] >= 0).any(axis=1), 3) if is_perspective else np.zeros(len(spots), bool)
        normal = np.repeat(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), 3, axis=0)
        ray = np.stack([(new[0] / 256 - 15.5) / 20, (9.25 - new[1] / 256) / 20, -np.ones(len(spots))], axis=1)
        inv_w = (normal * ray).sum(axis=1) / (normal * np.repeat(corners[:, 0], 3, axis=0)).sum(axis=1)
        z = screen.z_offset + screen.z_scale * inv_w
        steep = np.abs(z - (screen.z_offset + screen.z_scale / w)) > DEPTH_MARGIN / 4
        if is_perspective:
            assert is_behind.sum() > 50 and np.abs(new[2] - z)[is_behind & ~steep].max() <= 2.0**-8


number = st.one_of(st.floats(-8, 8), st.integers(-3, 3).map(float))
depths = st.one_of(st.floats(-4, 14), st.sampled_from([NEAR, FAR, 0.0, 2.0]))
far_out = st.sampled_from([1.0, 1.0, 1.0, 2.0**19, 2.0**24])
# The edge between the first two goes through a corner of what is kept of the screen.
THROUGH_A_CORNER = (
    (-50331648.0, -50331648.0, -1.0), (-1.7651736441047339, -1.7651736441047339, -1.0),
    (0.0, 524288.0, -0.0), (0.0, 524288.0, -1.0),
)  # fmt: skip
vertex = st.tuples(number, number, depths, far_out).map(lambda v: (v[0] * v[3], v[1] * v[3], -v[2]))


@settings(max_examples=300, deadline=None)
@given(
    st.tuples(vertex, vertex, vertex, vertex),
    st.booleans(),
    st.permutations(range(3)),
    st.permutations(range(3)),
)
@example(THROUGH_A_CORNER, False, [0, 1, 2], [0, 1, 2])
def test_both_faces_of_an_edge_get_the_same_new_vertices(corners, is_perspective, turn_a, turn_b):
    """Bit for bit, through all planes, however the two faces are wound and listed: no gap can open.

    Where an edge goes through a line in which two planes meet, one face may have two corners in one subpixel.
    """
    screen = plain_screen(is_perspective, (NEAR, FAR), far_clip=FAR)
    faces = np.array([np.array([0, 1, 2])[turn_a], np.array([1, 0, 3])[turn_b]])
    parts, owners = np.empty((14, 3, N_CORNER_COLUMN)), np.empty(14, np.uint32)
    columns = np.ascontiguousarray(np.array(corners).T), np.ascontiguousarray(faces.T.astype(np.uint32))
    with np.errstate(all="ignore"):
        vertices, _ = transform(columns[0], screen, SERIAL)
        n = stage.clip_faces(*columns, np.arange(2, dtype=np.uint32), screen, stage.make_clip_scratch(), parts, owners)
        flat, ranges = np.zeros((2, 3)), np.zeros((2, 2))
        (x, y, _), _ = stage.snap_corners(parts[:n], np.repeat(owners[:n], 3), flat, ranges, screen)
    assume((vertices.x[faces] == OUTSIDE).any(axis=1).all() and {0, 1} <= set(owners[:n]))
    # The corners that lie on the edge between the points 0 and 1: those that both faces have.
    edge = np.array(corners)[:2] * (1, 1, -1)
    on_edge = []
    for face in range(2):
        rows = np.concatenate([parts[:n].reshape(-1, N_CORNER_COLUMN), x[:, None], y[:, None]], axis=1)[
            np.repeat(owners[:n] == face, 3)
        ]
        along = edge[1] - edge[0]
        off = np.cross(rows[:, [1, 2, 0]] - edge[0], along)
        scale = np.abs(edge).max() * np.abs(along).max()
        on_edge.append({row.tobytes() for row in rows[np.abs(off).max(axis=1) <= 1e-13 * scale] + 0.0})
    apart = np.cross(np.array(corners)[2:] * (1, 1, -1) - edge[0], along)
    if np.abs(apart).max(axis=1).min() > 1e-6 * scale:  # the other corners are far from the edge
        pixels = [{row[-16:] for row in rows} for rows in on_edge]  # x and y, rounded to subpixels
        assert pixels[0] == pixels[1]
        shared = {row[-16:] for row in on_edge[0] & on_edge[1]}
        assert {row[-16:] for row in on_edge[0] ^ on_edge[1]} <= shared


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
        triangles, _ = clip_shares(corners, screen)
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
        screen = screen._replace(**{name: getattr(screen, name) @ turn for name in ("right", "up", "forward")})
        with np.errstate(all="ignore"):
            clipped, _ = clip_mesh(np.concatenate([good @ turn, [bad]]), faces, screen)
        x, y = (
            clipped.vertices.x[clipped.triangles.vertex_idx].astype(int),
            clipped.vertices.y[clipped.triangles.vertex_idx].astype(int),
        )
        assert (x != OUTSIDE).all()
        area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
        drawn = set(clipped.faces[area != 0].tolist())
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
    clipped, before = clip_mesh(points, faces, screen, corner)
    is_whole = (before.x[faces] != OUTSIDE).all(axis=1)
    assert (np.diff(clipped.faces.astype(int)) >= 0).all()
    assert clipped.n_clipped == (~is_whole).sum() > 20 and is_whole.sum() > 20
    assert set(np.flatnonzero(is_whole)) <= set(clipped.faces)
    kept = is_whole[clipped.faces]
    assert (clipped.triangles.vertex_idx[:, kept] == faces[clipped.faces[kept]].T).all()
    assert (clipped.triangles.vertex_idx[:, ~kept] >= 60).all() and ((clipped.triangles.clipped_idx < 0) == kept).all()
    assert (clipped.triangles.corner_idx == corner[:, clipped.faces]).all()
    assert [a[:60].tobytes() for a in clipped.vertices] == [a.tobytes() for a in before]


def test_parts_keep_the_winding_of_their_face():
    rng = np.random.default_rng(7)
    screen = plain_screen(True, (NEAR, FAR), far_clip=FAR, scale=200.0)
    n_part = 0
    for _ in range(100):
        points = rng.uniform(-4, 4, (3, 3)) - (0, 0, 4)
        clipped, _ = clip_mesh(points, [[0, 1, 2]], screen)
        facing = np.linalg.det(points)  # whether the eye, at the origin, sees the face counter-clockwise
        x, y = (a[clipped.triangles.vertex_idx].astype(np.int64) for a in clipped.vertices[:2])
        area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
        large = area[np.abs(area) > 2**18]
        assert (np.sign(large) == np.sign(facing)).all()
        n_part += len(large)
    assert n_part > 50


def place_of(points, w=1.0):
    """(1, x, y) of points (..., 3) on a screen with scale 30 about (15.5, 9.25), in 1/256 px."""
    x, y = 15.5 + 30 * points[..., 0] / w, 9.25 - 30 * points[..., 1] / w
    return np.stack([np.ones_like(x), 256 * x, 256 * y], axis=-1)


@pytest.mark.parametrize("is_perspective", [True, False])
def test_weights_are_those_of_the_whole_face(is_perspective):
    """At random points of faces: the planes give each point's own shares of the vertices, and its depth."""
    rng = np.random.default_rng(8)
    screen = plain_screen(is_perspective, (NEAR, FAR), far_clip=FAR, scale=30.0, center=(15.5, 9.25))
    points = rng.uniform(-4, 4, (300, 3)) - (0, 0, 3)
    faces = np.arange(300).reshape(-1, 3)
    behind = points[faces][:, :, 2].max(axis=1) >= 0  # others are rounded
    vertex = np.ascontiguousarray(faces[behind].T.astype(np.uint32))
    planes, z = compute_face_planes(np.ascontiguousarray(points.T), vertex, screen)
    shares = rng.dirichlet((1, 1, 1), (len(planes), 40))
    spots = shares @ points[faces[behind]]
    is_seen = spots[..., 2] < -0.2
    w = -spots[..., 2] if is_perspective else np.ones(spots.shape[:2])
    place = np.moveaxis(place_of(spots, w), -1, 0)
    if not is_perspective:  # all have a place there, and so the vertices are rounded: there each has all the weight
        at_vertices = np.rint(place_of(points[faces[behind]]))
        weights = np.einsum("pck,pjk->pjc", planes[:, :9].reshape(-1, 3, 3).swapaxes(1, 2), at_vertices)
        assert len(weights) > 20 and np.abs(weights - np.eye(3)).max() < 1e-9
        depth = (z[:, None] * at_vertices).sum(axis=2)
        expected = screen.z_offset - screen.z_scale * points[faces[behind]][..., 2]
        assert np.abs(depth - expected).max() <= 1e-9 * np.abs(expected).max()
        return
    q = np.einsum("pck,pjk->pjc", planes[:, :9].reshape(-1, 3, 3).swapaxes(1, 2), np.moveaxis(place, 0, -1))
    found = q / q.sum(axis=2, keepdims=True)
    assert is_seen.sum() > 500
    assert np.abs(found - shares)[is_seen].max() < 1e-9 and np.abs(q.sum(axis=2) * w - 1)[is_seen].max() < 1e-9
    depth = (z[:, None] * np.moveaxis(place, 0, -1)).sum(axis=2)
    expected = screen.z_offset + screen.z_scale / w
    assert np.abs(depth - expected)[is_seen].max() <= 1e-9 * np.abs(expected[is_seen]).max()


def test_clipping_nothing_changes_nothing():
    points = [(0, 0, -2), (1, 0, -2), (0, 1, -2)]
    clipped, before = clip_mesh(points, [[0, 1, 2]], plain_screen())
    assert (
        clipped.n_clipped == 0 and (clipped.triangles.vertex_idx == [[0], [1], [2]]).all() and len(clipped.planes) == 0
    )
    behind, _ = clip_mesh(-np.array(points), [[0, 1, 2]], plain_screen())
    assert behind.n_clipped == 1 and behind.triangles.vertex_idx.shape == (3, 0) and behind.faces.shape == (0,)


# ---------------------------------------------------------------- in pictures


def random_scene(rng, n_face, camera):
    """Faces all round the camera, each with colours of its own."""
    vertices, colors = rng.uniform(-4, 4, (3 * n_face, 3)), rng.uniform(0, 1, (3 * n_face, 3))
    faces = np.arange(3 * n_face).reshape(-1, 3)
    return (
        vertices,
        colors,
        faces,
        (rz.AmbientLight(0.3), rz.DirectionalLight((0.3, -1, -1), 0.7), rz.PointLight((1, 1, 1), 0.3)),
    )


def random_camera(rng):
    """A camera inside the scene, whose near plane cuts faces."""
    target, near = tuple(rng.normal(size=3)), float(rng.choice([0.05, 0.5, 1.5]))
    far = float(rng.choice([4.0, np.inf]))
    far = None if far == np.inf else far
    if rng.random() < 0.3:
        return rz.Camera.orthographic((0, 0, 3), target, height=4, near=near, far=far)
    return rz.Camera.perspective((0, 0, 3), target, fov=float(rng.choice([20, 60, 120])), near=near, far=far)


def mesh_of(vertices, faces, colors):
    return rz.Mesh(vertices, faces, colors=colors, crease_angle=0, material=rz.Material(specular=0.3, shininess=9))


@pytest.mark.parametrize("shading", ["flat", "gouraud", "phong"])
def test_of_two_equal_faces_the_lower_index_wins_however_they_are_listed_and_clipped(shading):
    rng = np.random.default_rng(11)
    n_clipped = 0
    for _ in range(25):
        vertices, colors, faces, lights = random_scene(rng, 6, None)
        again = np.roll(faces, rng.integers(3), axis=1)[:, :: rng.choice([1, -1])]
        mesh = mesh_of(vertices, np.concatenate([faces, again]), colors)
        frame = rz.render(
            rz.Scene([mesh], lights, random_camera(rng)), (32, 24), shading=shading, outputs=("color", "face")
        )
        wrong = (frame.face >= len(faces)).sum()
        assert wrong == 0, f"{wrong} pixels show the face that comes later"
        n_clipped += frame.stats.clipped
    assert n_clipped > 100


@pytest.mark.parametrize("shading", ["flat", "gouraud", "phong"])
@pytest.mark.parametrize("tolerance", [0.0, 1 / 4096])
def test_clipped_faces_are_those_of_the_reference(shading, tolerance):
    rng = np.random.default_rng(12)
    n_clipped = 0
    for _ in range(20):
        vertices, colors, faces, lights = random_scene(rng, 6, None)
        scene = rz.Scene([mesh_of(vertices, faces, colors)], lights, random_camera(rng))
        verdict = compare_with_reference(scene, (32, 24), shading=shading, tolerance=tolerance)
        budget = max(tolerance, EXACT)
        assert verdict.color <= budget, f"colours differ by {verdict.color:.3g} > {budget:.3g}"
        assert verdict.depth <= 1e-6, f"depths differ by {verdict.depth:.3g} > 1e-6"
        n_clipped += rz.render(scene, (32, 24), samples=1).stats.clipped
    assert n_clipped > 60


@pytest.mark.parametrize("make", [rz.Camera.perspective, rz.Camera.orthographic])
def test_what_a_near_or_far_plane_leaves_is_as_it_was(make):
    """All vertices have a place on the screen: depths and colours of what is left don't change."""
    rng = np.random.default_rng(13)
    n_compared = 0
    for _ in range(20):
        vertices, colors, faces, lights = random_scene(rng, 4, None)
        mesh = mesh_of(vertices, faces, colors)
        pictures = []
        for near, far in ((None, None), (8.0, 11.0)):
            scene = rz.Scene([mesh], lights, make((0, 0, 10), near=near, far=far))
            pictures.append(
                rz.render(scene, (32, 24), tolerance=0, shading="phong", outputs=("color", "depth", "face"))
            )
        whole, part = pictures
        same = (whole.face == part.face) & (part.face >= 0)
        assert np.abs(whole.depth[same] / part.depth[same] - 1).max(initial=0) <= 1e-6
        assert np.abs(whole.color - part.color)[same].max(initial=0) <= 1e-6
        n_compared += same.sum()
    assert n_compared > 1000


def test_a_floor_under_the_camera_is_exact():
    """One face, its corners behind the eye and far away: depth and colour in closed form."""
    corners = np.array([(-50.0, 0, 30), (50, 0, 30), (0, 0, -400)])
    camera = rz.Camera.perspective((0, 1, 0), (0, 0.6, -2), fov=70, near=0.01)
    scene = rz.Scene([rz.Mesh(corners, [[0, 1, 2]], colors=np.eye(3))], [rz.AmbientLight(1.0)], camera)
    scene = rz.Scene(
        [rz.Mesh(corners, [[0, 1, 2]], colors=np.eye(3), material=rz.Material(ambient=1.0))], scene.lights, camera
    )
    frame = rz.render(scene, (64, 48), tolerance=0, shading="phong", outputs=("color", "depth"))
    view, projection = camera.view(), camera.projection((64, 48))
    j, i = np.mgrid[:48, :64] + 0.5
    ray = (
        view.forward + ((i - projection.center_x) / projection.scale_x)[..., None] * view.right
        + ((projection.center_y - j) / projection.scale_y)[..., None] * view.up
    )  # fmt: skip
    with np.errstate(all="ignore"):
        w = -1.0 / ray[..., 1]
    spots = view.eye + w[..., None] * ray
    shares = np.linalg.solve(np.stack([corners[:, 0], corners[:, 2], np.ones(3)]), np.stack(
        [spots[..., 0], spots[..., 2], np.ones_like(w)]).reshape(3, -1)).T.reshape(48, 64, 3)  # fmt: skip
    inside = (w > 0) & (shares > 1e-3).all(axis=-1)
    assert inside.sum() > 1000 and np.isfinite(frame.depth[inside]).all()
    assert np.abs(frame.depth[inside] / w[inside] - 1).max() < 1e-6
    assert np.abs(frame.color[inside] - shares[inside]).max() < 1e-6


def test_without_the_compiler_the_same_comes_out(monkeypatch):
    rng = np.random.default_rng(9)
    positions = np.ascontiguousarray((rng.uniform(-4, 4, (90, 3)) - (0, 0, 3)).T)
    vertex = np.ascontiguousarray(np.arange(90, dtype=np.uint32).reshape(-1, 3).T)
    faces, screen = np.arange(30, dtype=np.uint32), plain_screen(True, (NEAR, FAR), far_clip=FAR)

    def run():
        triangles, owner = np.zeros((30 * 7, 3, N_CORNER_COLUMN)), np.zeros(30 * 7, np.uint32)
        n = int(stage.clip_faces(positions, vertex, faces, screen, stage.make_clip_scratch(), triangles, owner))
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
