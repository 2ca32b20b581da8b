"""Check what the clip stage keeps of triangles that can't be placed whole, in any unit, however far a corner lies."""

from itertools import product

import numpy as np
import pytest
from helpers.against_reference import compare_with_reference
from helpers.pinhole import SHADINGS
from helpers.stages import SERIAL, plain_screen
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

import rasterizer as rz
from rasterizer.pipeline import clip as stage
from rasterizer.pipeline.clip import MAX_CORNERS, N_CORNER_COLUMN, clip
from rasterizer.pipeline.transform import LIMIT_PX, OUTSIDE, transform

NEAR, FAR = 1.0, 10.0


def clip_mesh(points, faces, screen):
    """Transform and clip a mesh; return (Clipped, vertices before it)."""
    positions = np.ascontiguousarray(points, float)
    vertex = np.ascontiguousarray(np.asarray(faces, np.uint32).reshape(-1, 3).T)
    with np.errstate(all="ignore"):
        vertices, _ = transform(positions, screen, SERIAL)
        return clip(positions, vertex, vertices, screen), vertices


def clip_shares(points, screen, faces=((0, 1, 2),)):
    """The parts of triangles before they are rounded: shares (n_part, 3, 3) of their vertices in the parts' corners,
    and the triangle of each part. `points` are those of a camera at the origin that looks down -z."""
    points, faces = np.asarray(points, float), np.asarray(faces, np.uint32)
    parts, owners = np.empty((7 * len(faces), 3, N_CORNER_COLUMN)), np.empty(7 * len(faces), np.uint32)
    numbers = np.arange(len(faces), dtype=np.uint32)
    mesh, scratch = (points, np.ascontiguousarray(faces.T)), stage.make_clip_scratch()
    n = stage.clip_faces(*mesh, numbers, screen, scratch, parts, owners)
    parts, owners = parts[:n], owners[:n]
    of_eye = points[faces] * (1, 1, -1)  # across, upward, depth
    return np.linalg.solve(of_eye.swapaxes(1, 2)[owners], parts[:, :, [1, 2, 0]].swapaxes(1, 2)).swapaxes(1, 2), owners


number = st.one_of(st.floats(-8, 8), st.integers(-3, 3).map(float))
depths = st.one_of(st.floats(-4, 14), st.sampled_from([NEAR, FAR, 0.0, 2.0]))
far_out = st.sampled_from([1.0, 1.0, 1.0, 2.0**19, 2.0**24])
# The edge between the first two goes through a corner of what is kept of the screen.
THROUGH_A_CORNER = (
    (-50331648.0, -50331648.0, -1.0), (-1.7651736441047339, -1.7651736441047339, -1.0),
    (0.0, 524288.0, -0.0), (0.0, 524288.0, -1.0),
)  # fmt: skip
vertex = st.tuples(number, number, depths, far_out).map(lambda v: (v[0] * v[3], v[1] * v[3], -v[2]))


@settings(max_examples=60, deadline=None)
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
    mesh = np.array(corners), np.ascontiguousarray(faces.T.astype(np.uint32))
    with np.errstate(all="ignore"):
        vertices, _ = transform(mesh[0], screen, SERIAL)
        n = stage.clip_faces(*mesh, np.arange(2, dtype=np.uint32), screen, stage.make_clip_scratch(), parts, owners)
        (x, y, *_), _ = stage.place_corners(parts[:n], screen)
    assume((vertices.x[faces] == OUTSIDE).any(axis=1).all() and {0, 1} <= set(owners[:n]))
    # The corners that lie on the edge between the points 0 and 1: those that both faces have.
    edge = np.array(corners)[:2] * (1, 1, -1)
    on_edge = []
    for face in range(2):
        placed = np.concatenate([parts[:n, :, :3], x[..., None], y[..., None]], axis=2)
        rows = placed[owners[:n] == face].reshape(-1, 5)
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


def test_what_is_left_covers_the_inside_once():
    """Random points of triangles that reach far out, behind the eye and beyond the far plane."""
    for is_perspective in (True, False):
        rng, n_left = np.random.default_rng(4), []
        screen = plain_screen(is_perspective, (NEAR, FAR), far_clip=FAR)
        for _ in range(150):
            corners = rng.uniform(-1, 1, (3, 3)) * (*(2.0 ** rng.uniform(18, 23, 2)), 7) - (0, 0, 5)
            clipped, _ = clip_mesh(corners, [[0, 1, 2]], screen)
            if clipped.n_clipped == 0:
                continue
            triangles, _ = clip_shares(corners, screen)
            n_left.append(len(triangles))
            shares = rng.dirichlet(np.ones(3), 400)
            inside, unsure = is_kept(shares @ corners, screen)
            # Barycentric coordinates in each part: positive in one where the point is inside, else in none.
            within = [shares @ np.linalg.inv(t) for t in triangles if abs(np.linalg.det(t)) > 1e-12]
            count, strict = (
                sum(((b > least).all(axis=1)).astype(int) for b in within) + np.zeros(400, int)
                for least in (-1e-9, 1e-9)
            )
            wrong = (~unsure & ((count > 0) != inside)).sum()
            assert wrong == 0, f"{is_perspective=}: {wrong} points of {corners.tolist()} kept wrongly > 0"
            assert strict.max() <= 1, (
                f"{is_perspective=}: points of {corners.tolist()} covered {strict.max()} times > 1"
            )
        assert max(n_left) >= 4 and min(n_left) == 0 and max(n_left) <= MAX_CORNERS - 2


def test_what_is_not_finite_draws_nothing_and_disturbs_nothing():
    good = np.array([(0, 0, -2), (1, 0, -2), (0, 1, -0.5), (0.5, 0.7, -3)])
    faces, inf = [[0, 1, 3], [0, 1, 4], [0, 2, 1], [4, 2, 0], [2, 4, 4]], np.inf
    bad_ones = (np.nan, 0, -2), (inf, 0, -2), (0, -inf, -2), (0, 0, inf), (0, 0, -inf), (1e308, 1e308, -2), (inf,) * 3
    axes = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    for bad, is_perspective, turn in product(bad_ones, (True, False), (np.eye(3), axes)):
        screen = plain_screen(is_perspective, (NEAR, FAR))
        screen = screen._replace(**{name: getattr(screen, name) @ turn for name in ("right", "up", "forward")})
        with np.errstate(all="ignore"):
            clipped, _ = clip_mesh(np.concatenate([good @ turn, [bad]]), faces, screen)
        rows = clipped.rows_of(np.ascontiguousarray(np.array(faces, np.uint32).T), 5)
        x, y = (values[rows].astype(int) for values in clipped.vertices[:2])
        assert (x != OUTSIDE).all(), bad
        area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
        drawn = set(clipped.faces[area != 0].tolist())
        if np.isfinite(bad).all():
            assert {0, 2} <= drawn, bad  # very far away is not an error
        else:
            assert drawn == {0, 2} and clipped.n_clipped == 4, f"{bad}, {is_perspective=}: faces {drawn} drawn"


def test_new_vertices_have_what_is_linear_in_eye_space_where_they_are():
    """Positions that are clipped as values are where the new vertices lie; constants stay, and nothing leaves the range
    of a face; values come on both sides, from rows of their own."""
    rng = np.random.default_rng(7)
    points, n = rng.uniform(-4, 4, (60, 3)) - (0, 0, 3), 500
    faces = rng.integers(0, 60, (200, 3))
    for is_perspective in (True, False):
        screen = plain_screen(is_perspective, (NEAR, FAR), far_clip=FAR, scale=30.0)
        clipped, _ = clip_mesh(points, faces, screen)
        vertex = np.ascontiguousarray(faces.T.astype(np.uint32))
        found = clipped.add_values(points[None], vertex)[0]
        assert found[:60].tobytes() == points.tobytes()
        x, y, w = found[60:, 0], found[60:, 1], -found[60:, 2] if is_perspective else 1.0
        for true, values in ((clipped.vertices.true_x, 256 * 30 * x / w), (clipped.vertices.true_y, -256 * 30 * y / w)):
            assert np.abs(true[60:] - values).max() <= 1e-10 * np.abs(true[60:]).max(), is_perspective
        corner = np.ascontiguousarray(rng.integers(0, n, (3, 200)).astype(np.uint32))
        values = np.concatenate([rng.normal(size=(2, n, 4)), np.full((2, n, 1), 1 / 3)], axis=2)
        of_faces = values[:, corner[:, clipped.faces[clipped.parts]]]
        new = clipped.add_values(values, corner)[:, n:].reshape(2, -1, 3, 5)
        assert (new[..., 4] == 1 / 3).all()
        assert (new >= of_faces.min(axis=1)[:, :, None]).all() and (new <= of_faces.max(axis=1)[:, :, None]).all()
        assert clipped.add_values(np.empty((1, 0, 0)), corner).shape == (1, 0, 0)


# ---------------------------------------------------------------- in pictures


def random_scene(rng, n_face, camera, faces=None):
    """Faces all round the camera, each with colours of its own."""
    vertices, colors = rng.uniform(-4, 4, (3 * n_face, 3)), rng.uniform(0, 1, (3 * n_face, 3))
    faces = np.arange(3 * n_face).reshape(-1, 3) if faces is None else faces
    look = rz.Material(specular=0.3, shininess=9)
    mesh = rz.Mesh(vertices, faces, colors=colors, crease_angle=0, material=look)
    lights = rz.AmbientLight(0.3), rz.DirectionalLight((0.3, -1, -1), 0.7), rz.PointLight((1, 1, 1), 0.3)
    return rz.Scene([mesh], lights, camera)


def random_camera(rng):
    """A camera inside the scene, whose near plane cuts faces."""
    target, near = tuple(rng.normal(size=3)), float(rng.choice([0.05, 0.5, 1.5]))
    far = float(rng.choice([4.0, np.inf]))
    far = None if far == np.inf else far
    if rng.random() < 0.3:
        return rz.Camera.orthographic((0, 0, 3), target, height=4, near=near, far=far)
    return rz.Camera.perspective((0, 0, 3), target, fov=float(rng.choice([20, 60, 120])), near=near, far=far)


def test_of_two_equal_faces_the_lower_index_wins_however_they_are_listed_and_clipped():
    rng, n_clipped, faces = np.random.default_rng(11), 0, np.arange(18).reshape(-1, 3)
    for k in range(24):
        again = np.roll(faces, rng.integers(3), axis=1)[:, :: rng.choice([1, -1])]
        scene = random_scene(rng, 6, random_camera(rng), np.concatenate([faces, again]))
        frame = rz.render(scene, (32, 24), shading=SHADINGS[k % 3], outputs=("color", "face"))
        wrong = (frame.face >= len(faces)).sum()
        assert wrong == 0, f"{SHADINGS[k % 3]}: {wrong} pixels show the face that comes later"
        n_clipped += frame.stats.clipped
    assert n_clipped > 60


@pytest.mark.parametrize("seeds", [(*range(12), 121, 1315, 1475), pytest.param(range(400), marks=pytest.mark.nightly)])
def test_order_next_to_clipped_faces_is_that_of_their_planes(seeds):
    """Soups round the eye in small pictures, where faces are steep: rounding their corners must not tilt the planes of
    depth."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        points = rng.normal(0, 1, (24, 3)) * 10 ** rng.uniform(-1, 1.5)
        fov, near = rng.uniform(40, 140), None if seed % 2 else 10 ** rng.uniform(-4, -1)
        camera = rz.Camera.perspective((0, 0, 0), (0, 0, -1), fov=fov, near=near)
        scene = rz.Scene([rz.Mesh(points, np.arange(24).reshape(-1, 3))], [rz.AmbientLight(1.0)], camera)
        compare_with_reference(scene, (16, 12), shading="flat", tolerance=0)
