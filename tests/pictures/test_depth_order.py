"""Check which of two surfaces is shown where they lie next to each other, against planes in long double through the
vertices as they are given, not as they are rounded on the screen."""

import numpy as np
import pytest

import rasterizer as rz
from rasterizer.reference import picture as reference

SIZE = (64, 48)
NEAR, FAR = 0.5, 40.0
# Units of the z-buffer: half a one for each column and row of both boxes, 40 for each plane (pipeline/setup.py).
BOUND = sum(SIZE) + 80
WIDE = np.longdouble


def random_camera(rng):
    """A camera anywhere, with perspective or without."""
    eye, target = rng.uniform(-3, 3, (2, 3))
    if rng.random() < 0.5:
        return rz.Camera.perspective(eye, target, (0, 1, 0), fov=float(rng.uniform(20, 90)), near=NEAR, far=FAR)
    return rz.Camera.orthographic(eye, target, (0, 1, 0), height=float(rng.uniform(2, 8)), near=NEAR, far=FAR)


def random_plane(rng, camera):
    """A point before the camera, and two axes of a plane through it that leans at random, the first along the lean."""
    view = camera.view()
    point = view.eye + rng.uniform(2, 8) * view.forward
    lean, turn = np.radians(rng.uniform(0, 88)), rng.uniform(0, 2 * np.pi)
    across = np.cos(turn) * view.right + np.sin(turn) * view.up
    along = np.cos(lean) * across + np.sin(lean) * view.forward
    return point, np.array([along, -np.sin(turn) * view.right + np.cos(turn) * view.up])


def random_triangles(rng, point, axes, n):
    """Triangles (n, 3, 3) in a plane: of any size, slivers, and some that reach behind the camera."""
    places = rng.uniform(-1, 1, (n, 3, 2)) * 2.0 ** rng.uniform(-2, 4, (n, 1, 1))
    thin = rng.random(n) < 0.3
    places[thin, 2] = places[thin, 0] + rng.random((thin.sum(), 1)) * (places[thin, 1] - places[thin, 0])
    places[thin, 2] += rng.normal(size=(thin.sum(), 2)) * 2.0 ** rng.uniform(-9, -3, (thin.sum(), 1))
    return point + places @ axes


def planes_of(triangles, camera):
    """Of each triangle's plane what is affine on the screen, 1/w or the depth: (n, 3) long double, at the first sample,
    and what one sample to the right, and down, adds; and which are too nearly edge-on to have an order."""
    view, projection = camera.view(), camera.projection(SIZE)
    axes = np.stack([view.right, view.up, view.forward]).astype(WIDE)
    corners = (triangles.astype(WIDE) - view.eye) @ axes.T
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    distance = (normal * corners[:, 0]).sum(axis=1)
    x, y = WIDE(1) / WIDE(projection.scale_x), WIDE(1) / WIDE(projection.scale_y)
    ray = (0.5 - WIDE(projection.center_x)) * x, (WIDE(projection.center_y) - 0.5) * y
    n_x, n_y, n_z = normal.T
    if projection.is_perspective:
        planes = np.stack([n_x * ray[0] + n_y * ray[1] + n_z, n_x * x, -n_y * y], axis=1) / distance[:, None]
    else:
        planes = np.stack([distance - n_x * ray[0] - n_y * ray[1], -n_x * x, n_y * y], axis=1) / n_z[:, None]
    # Rounding of vertices moves depth by less than half of what counts as edge-on, and the horizon is far away.
    shift, depth = np.abs(planes[:, 1:]).sum(axis=1) / 512, corners[..., 2]
    width = 1 / np.maximum(depth.min(axis=1), NEAR) if projection.is_perspective else np.ones(len(shift))
    limit = width * min(x, y)
    if projection.is_perspective:
        limit = np.minimum(limit, 1 / np.abs(depth).max(axis=1) / 2)
    return planes, ~(shift < limit / 2) | ~np.isfinite(planes).all(axis=1)


def check_order(triangles, camera, shown, covers):
    """Check that no face is shown behind one that covers the sample; return how many samples two of them cover.

    shown : (h, w) int, the face that is shown · covers : (n, h, w) bool
    """
    planes, is_edge_on = planes_of(triangles, camera)
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    values = planes[:, 0, None, None] + planes[:, 1, None, None] * columns + planes[:, 2, None, None] * rows
    if camera.is_perspective:
        values, span = -values, 1 / NEAR - 1 / FAR
    else:
        span = FAR - NEAR
    unit = span / (2.0**38 - 2.0**33)
    is_asked = covers & ~is_edge_on[:, None, None]
    nearest = np.where(is_asked, values, np.inf).min(axis=0)
    at = (shown >= 0) & ~is_edge_on[shown] & (is_asked.sum(axis=0) > 1)
    behind = (np.take_along_axis(values, np.maximum(shown, 0)[None], axis=0)[0] - nearest)[at] / unit
    assert behind.max(initial=0) <= BOUND, f"a face is shown {float(behind.max()):.3g} units behind another > {BOUND}"
    return at.sum()


def scene_of(triangles, camera):
    """A scene of separate triangles."""
    vertices = triangles.reshape(-1, 3)
    return rz.Scene([rz.Mesh(vertices, np.arange(len(vertices)).reshape(-1, 3))], camera=camera)


def draw_faces(scene, draws_slowly=False):
    """The face that each sample shows."""
    if draws_slowly:
        return reference.render(scene, SIZE, shading="flat").face
    return rz.render(scene, SIZE, outputs="face", cull="none", threads=1).face


def check_seed(seed, draws_slowly=False):
    """Check one scene of triangles in parallel planes, and one in another."""
    rng = np.random.default_rng(seed)
    camera = random_camera(rng)
    point, axes = random_plane(rng, camera)
    normal = np.cross(*axes)
    step = 10.0 ** rng.uniform(-7.5, -2)
    parallel = [random_triangles(rng, point + k * step * normal, axes, 2) for k in range(3)]
    triangles = np.concatenate([*parallel, random_triangles(rng, *random_plane(rng, camera), 1)])
    triangles = triangles[rng.permutation(len(triangles))]
    try:
        covers = np.stack([draw_faces(scene_of(each[None], camera)) >= 0 for each in triangles])
    except rz.ModelError:  # a triangle without area
        return 0
    return check_order(triangles, camera, draw_faces(scene_of(triangles, camera), draws_slowly), covers)


def test_faces_in_parallel_planes_keep_their_order():
    """However they lean: the rounding of vertices to 1/256 px decides what is covered, and not what is nearer."""
    assert sum(check_seed(seed) for seed in range(60)) > 8_000


def test_the_reference_keeps_the_order_too():
    assert sum(check_seed(seed, draws_slowly=True) for seed in range(100, 120)) > 800


@pytest.mark.nightly
def test_faces_in_parallel_planes_keep_their_order_in_many_scenes():
    assert sum(check_seed(seed) for seed in range(1000, 4000)) > 4 * 10**5


def test_a_decal_a_millionth_of_the_scenes_size_before_its_wall_hides_it():
    rng = np.random.default_rng(3)
    n_seen = 0
    for _ in range(40):
        camera = random_camera(rng)
        point, axes = random_plane(rng, camera)
        view, normal = camera.view(), np.cross(*axes)
        normal *= np.sign(normal @ (view.eye - point if camera.is_perspective else -view.forward))
        square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        wall = rz.Mesh(point + 2 * square @ axes, [[0, 1, 2, 3]])
        decal = rz.Mesh(point + 1e-6 * np.sqrt(32) * normal + 0.8 * square @ axes, [[0, 1, 2, 3]])
        is_decal = draw_faces(rz.Scene([decal], camera=camera)) >= 0
        assert (draw_faces(rz.Scene([wall, decal], camera=camera)) >= 2)[is_decal].all()
        n_seen += is_decal.sum()
    assert n_seen > 5_000
