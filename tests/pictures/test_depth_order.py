"""Check which of two surfaces is shown where they lie next to each other, against planes in long double through the
vertices as they are given, not as they are rounded on the screen."""

import json

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


def decals_of(seed):
    """A camera, a wall of triangles, and decals in the same plane."""
    rng = np.random.default_rng(seed)
    camera = random_camera(rng)
    point, axes = random_plane(rng, camera)
    return rng, camera, *(random_triangles(rng, point, axes, n) for n in (4, 3, 3))


def mesh_of(triangles, **settings):
    """A mesh of separate triangles."""
    return rz.Mesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), **settings)


def check_layers(seed, draws_slowly=False):
    """Check that the highest layer is shown where several cover a sample; return how many samples that is."""
    rng, camera, *parts = decals_of(seed)
    if any(planes_of(part, camera)[1].any() for part in parts):
        return 0
    layers = [-2, 0, 7]
    try:
        covers = [draw_faces(rz.Scene([mesh_of(part)], camera=camera)) >= 0 for part in parts]
        meshes = [mesh_of(part, layer=layer) for part, layer in zip(parts, layers, strict=True)]
    except rz.ModelError:
        return 0
    order = rng.permutation(3)
    face = draw_faces(rz.Scene([meshes[k] for k in order], camera=camera), draws_slowly)
    ends = np.cumsum([0] + [len(parts[k]) for k in order])
    shown = order[np.searchsorted(ends, np.maximum(face, 0), side="right") - 1]
    highest = np.select([covers[2], covers[1], covers[0]], [2, 1, 0], -1)
    assert (face < 0)[highest < 0].all()
    wrong = (highest >= 0) & (shown != highest)
    assert not wrong.any(), f"seed {seed}: {wrong.sum()} samples show a lower layer"
    return (np.sum(covers, axis=0) > 1).sum()


def test_the_higher_layer_is_shown_of_faces_in_one_plane():
    assert sum(check_layers(seed) for seed in range(60)) > 10_000
    assert sum(check_layers(seed, draws_slowly=True) for seed in range(8)) > 500


def test_layers_order_transparent_surfaces_and_hide_nothing_nearer():
    """A red pane on a wall lets the wall through, and not the other way round; what lies before both by more than a
    layer's step hides them."""
    camera = rz.Camera.perspective((0.3, 0.2, 4.0), (0, 0, 0), near=1.0, far=10.0)
    lean = np.array([[1.0, 0, 0.9], [0.1, 1.0, -0.4]])
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    red = rz.Material(ambient=(1, 0, 0), diffuse=0, specular=0, opacity=0.5)
    wall = rz.Mesh(2 * square @ lean, [[0, 1, 2], [0, 2, 3]], material=rz.Material(ambient=1, diffuse=0, specular=0))
    pane = rz.Mesh(square @ lean * 0.77 + 0.05 * lean[0], [[0, 1, 2], [0, 2, 3]], material=red, layer=1)
    lights = [rz.AmbientLight(1.0)]
    frame = rz.render(rz.Scene([wall, pane], lights, camera), SIZE, samples=1, shading="flat", outputs="color")
    green = frame.color[..., 1][frame.alpha > 0]
    assert set(np.round(green, 3).tolist()) == {0.5, 1.0}
    alone = draw_faces(rz.Scene([pane], camera=camera)) >= 0
    assert (np.abs(frame.color[..., 1] - 0.5) < 1e-3)[alone].all()
    before = rz.Mesh(wall.vertices + 1e-5 * np.cross(*lean), wall.faces)
    assert (draw_faces(rz.Scene([wall, pane, before], camera=camera)) < 4).sum() == (frame.alpha == 0).sum()


def test_layers_are_kept_in_scene_files(tmp_path):
    mesh = rz.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [[0, 1, 2]], layer=-3)
    for name in ("scene.json", "scene.toml"):
        rz.Scene([mesh]).save(tmp_path / name)
        assert rz.load(tmp_path / name).meshes[0].layer == -3
    entry = {"vertices": mesh.vertices.tolist(), "faces": [[0, 1, 2]], "layer": 5, "transform": {"scale": 2}}
    path = tmp_path / "given.json"
    path.write_text(json.dumps({"meshes": [entry]}))
    assert rz.load(path).meshes[0].layer == 5
    path.write_text(json.dumps({"meshes": [entry | {"layer": 1.5}]}))
    with pytest.raises(rz.SceneError, match="layer must be a whole number within -1000..1000; given 1.5"):
        rz.load(path)
    with pytest.raises(rz.SceneError, match="layer"):
        rz.Mesh(mesh.vertices, mesh.faces, layer=1001)
