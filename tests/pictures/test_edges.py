"""Edges over pictures: which are drawn, where they are hidden, how wide they are, and what they leave alone."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.pinhole import SHADINGS, octasphere
from helpers.small_scenes import cube, floor, scene_of

import rasterizer as rz
from rasterizer.engine.edge_overlay import FACTOR, EdgeOverlay, choose, in_camera, project
from rasterizer.engine.prepared_scene import PreparedScene
from rasterizer.options import Options
from rasterizer.pipeline.strokes import EdgeView, Occluders, is_visible

SIZE = (120, 90)
QUAD = np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
FRONT = rz.Camera.orthographic((0, 0, 5), (0, 0, 0), height=4.0)


def overlay(scene, edges="all", size=SIZE, **options) -> tuple[EdgeOverlay, np.ndarray]:
    """The edges of a scene, and the share of each pixel that they cover."""
    prepared = PreparedScene(scene, Options(size=size, edges=edges, threads=1, **options))
    found = EdgeOverlay(prepared)
    return found, found.coverage(scene.camera_for(size))


def pixel_of(point, scene, size=SIZE) -> tuple[int, int]:
    """The row and column at which a point of the world is seen."""
    camera = scene.camera_for(size)
    view, projection = camera.view(), camera.projection(size)
    r = np.asarray(point) - view.eye
    w = r @ view.forward if projection.is_perspective else 1.0
    x = projection.center_x + projection.scale_x * (r @ view.right) / w
    return int(np.floor(projection.center_y - projection.scale_y * (r @ view.up) / w)), int(np.floor(x))


CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
CUBE_EDGES = [(a, b) for a in CORNERS for b in CORNERS if (a < b).sum() == 1 and (a == b).sum() == 2]


@pytest.mark.parametrize("kind", ["wire", "crease"])
@pytest.mark.parametrize("is_perspective", [True, False])
def test_nine_edges_of_a_cube_are_seen_and_three_are_hidden(kind, is_perspective):
    scene = scene_of(cube())
    if not is_perspective:
        scene = replace(scene, camera=rz.Camera.orthographic((2.5, 2.0, 3.5), (0, 0, 0), height=4.0))
    mesh = scene.meshes[0]
    quads = replace(mesh, polygons=np.arange(12) // 2)
    _, coverage = overlay(replace(scene, meshes=[quads]), kind)
    n_hidden = 0
    for a, b in CUBE_EDGES:
        is_hidden = (np.minimum(a, b) == -1).all() and ((a == -1).all() or (b == -1).all())
        n_hidden += is_hidden
        shares = [coverage[pixel_of(a + t * (b - a), scene)] for t in np.linspace(0.1, 0.9, 23)]
        is_right = np.mean(np.array(shares) == 0) > 0.7 if is_hidden else min(shares) > 0  # other edges cross it
        assert is_right, f"{a} to {b}: {min(shares)}..{max(shares)}"
    assert n_hidden == 3


def test_the_diagonals_of_polygons_are_no_edges():
    whole, cut = rz.Mesh(QUAD, [(0, 1, 2, 3)]), rz.Mesh(QUAD, [(0, 1, 2), (0, 2, 3)])
    for mesh, has_diagonal in ((whole, False), (cut, True)):
        _, coverage = overlay(rz.Scene(mesh, camera=FRONT), "wire")
        assert (coverage[pixel_of((0.02, 0.02, 0), rz.Scene(mesh, camera=FRONT))] > 0) == has_diagonal
        _, coverage = overlay(rz.Scene(mesh, camera=FRONT), ("crease", "silhouette"))  # it is flat
        assert coverage[pixel_of((0.02, 0.02, 0), rz.Scene(mesh, camera=FRONT))] == 0


@pytest.mark.parametrize("width", [0.25, 1.0, 1.5, 3.0, 20.0])
def test_a_stroke_is_as_wide_as_asked_for(width):
    scene = rz.Scene(rz.Mesh(QUAD, [(0, 1, 2, 3)]), camera=FRONT)
    _, coverage = overlay(scene, "wire", edge_width=width)
    row, column = pixel_of((1, 0, 0), scene)
    across = coverage[row, column - 15 : column + 16].sum()
    assert abs(across - width) <= 1 / 8, f"{across} px instead of {width}"
    inside = coverage[row, pixel_of((0, 0, 0), scene)[1]]
    assert inside == 0


def test_a_sphere_has_a_closed_silhouette_and_no_creases():
    scene = rz.Scene(rz.Mesh(*octasphere(4)), camera=rz.Camera.perspective((0.3, 0.4, 4), fov=35))
    _, coverage = overlay(scene, "silhouette", edge_width=1.5)
    assert overlay(scene, "crease")[1].max() == 0
    rows, columns = np.nonzero(coverage)
    row, column = pixel_of((0, 0, 0), scene)
    radius = np.hypot(rows + 0.5 - row, columns + 0.5 - column)
    angles = np.unique((np.degrees(np.arctan2(rows - row, columns - column)) // 6).astype(int) % 60)
    assert len(angles) == 60, f"{60 - len(angles)} gaps"
    assert radius.min() > 0.85 * radius.max(), "the far side shows through"


def test_what_lies_before_an_edge_hides_it_up_to_its_own_border():
    back = rz.Mesh(QUAD * 1.6, [(0, 1, 2, 3)])
    screen = rz.Mesh(QUAD * (0.8, 1.8, 1) + (0.4, 0, 1), [(0, 1, 2, 3)])
    scene = rz.Scene([back, screen], camera=FRONT)
    _, coverage = overlay(scene, "wire")
    row = pixel_of((0, 1.6, 0), scene)[0]
    for x, is_seen in ((-1.5, True), (-0.5, True), (-0.3, False), (0.4, False), (1.1, False), (1.4, True)):
        column = pixel_of((x, 1.6, 0), scene)[1]
        assert (coverage[row - 1 : row + 1, column].max() > 0) == is_seen, x


def test_edges_on_another_surface_are_seen():
    """A cube stands on a floor: the floor is not in front of the edges that lie in it."""
    for near in (None, 0.1):
        ground = replace(floor(), vertices=floor().vertices * (1, 0, 1) + (0, -1, 0))
        scene = scene_of(cube(), ground)
        scene = replace(scene, camera=replace(scene.camera, near=near))
        _, coverage = overlay(scene, "crease")
        for a, b in (((-1, -1, 1), (1, -1, 1)), ((1, -1, -1), (1, -1, 1))):
            shares = [coverage[pixel_of((1 - t) * np.array(a) + t * np.array(b), scene)] for t in np.linspace(0, 1, 40)]
            assert min(shares) > 0


def test_visibility_is_that_of_rays():
    """Triangles of all sizes that cross each other: whether a point is hidden is found by all of them."""
    rng = np.random.default_rng(11)
    vertices = rng.uniform(-1.2, 1.2, (24, 1, 3)) + rng.normal(size=(24, 3, 3)) * rng.uniform(0.05, 0.8, (24, 1, 1))
    mesh = rz.Mesh(vertices.reshape(-1, 3), np.arange(72).reshape(-1, 3))
    for camera in (rz.Camera.perspective((0.5, 0.4, 5), fov=40), FRONT, rz.Camera.perspective((0, 0, 0.3), fov=90)):
        scene = rz.Scene(mesh, camera=camera)
        found, _ = overlay(scene, "wire")
        prepared, view = found._prepared, camera.view()
        size = SIZE[0] * FACTOR, SIZE[1] * FACTOR
        from rasterizer.engine.depth_range import screen_of

        screen = screen_of(camera, view, SIZE, FACTOR, prepared.geometry, prepared.bounds)
        edges = project(found._edges.ends[choose(found._edges, ("wire",), screen, False)], screen, size)
        points = in_camera(prepared.geometry.positions, screen)
        occluders = Occluders(points, prepared.geometry.vertex, found._visible_triangles(view, screen, size))
        projection = screen.scale_x, screen.scale_y, screen.center_x, screen.center_y
        edge_view = EdgeView(*projection, screen.is_perspective, 1e-6, float(FACTOR), screen.near)
        n_wrong, n_hidden, n_point = 0, 0, 600
        corners = points[:, prepared.geometry.vertex.astype(int)].transpose(2, 1, 0)
        for _ in range(n_point):
            start, end = edges[rng.integers(len(edges))].reshape(2, 3)
            x, y, nearness = start + rng.uniform() * (end - start)
            expected = not is_hidden_by_any(corners, x, y, nearness, screen)
            n_wrong += bool(is_visible(x, y, nearness, occluders, edge_view)) != expected
            n_hidden += not expected
        assert n_wrong <= 0.01 * n_point, f"{n_wrong} of {n_point} points"
        assert 0.05 * n_point < n_hidden < 0.95 * n_point, n_hidden


def is_hidden_by_any(corners, x, y, nearness, screen) -> bool:
    """Tell whether the ray of a point meets any triangle (n, 3, 3) before it, by linear systems."""
    across, upward = (x - screen.center_x) / screen.scale_x, (screen.center_y - y) / screen.scale_y
    columns = corners.transpose(0, 2, 1).copy()
    ray = np.array([across, upward, 1.0])
    if not screen.is_perspective:
        depths = columns[:, 2].copy()
        columns[:, 2] = 1.0
    q = np.linalg.solve(columns, np.broadcast_to(ray, (len(columns), 3))[..., None])[..., 0]
    is_met = (q >= 0).all(axis=1)
    found = q.sum(axis=1) if screen.is_perspective else -(q * depths).sum(axis=1)
    is_met &= found * screen.near < 1 if screen.is_perspective else -found > screen.near
    return bool((is_met & (found > nearness + 1e-5)).any())


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("samples", [1, 4, 9, 16])
def test_a_picture_changes_where_strokes_are_and_nowhere_else(shading, samples):
    scene = scene_of(cube(), floor())
    plain = rz.render(scene, SIZE, shading=shading, samples=samples, outputs=("color", "face"))
    drawn = rz.render(
        scene, SIZE, shading=shading, samples=samples, outputs=("color", "face"), edges="all", edge_color="red"
    )
    _, coverage = overlay(scene, shading=shading)
    assert np.array_equal(drawn.rgba[coverage == 0], plain.rgba[coverage == 0])
    assert np.array_equal(drawn.color[coverage == 0], plain.color[coverage == 0])
    assert np.array_equal(drawn.face, plain.face)
    full = coverage == 1
    assert full.sum() > 10 and (drawn.rgba[full] == (255, 0, 0, 255)).all() and (drawn.alpha[full] == 1).all()
    part = (coverage > 0) & (coverage < 1)
    a, s = plain.alpha[part].astype(float), coverage[part]
    alpha = s + a * (1 - s)
    expected = (np.array([1.0, 0, 0]) * s[:, None] + plain.color[part] * (a * (1 - s))[:, None]) / alpha[:, None]
    assert np.abs(drawn.color[part] - expected).max() <= 1e-6 and np.abs(drawn.alpha[part] - alpha).max() <= 1e-6


def test_strokes_over_nothing_are_as_opaque_as_they_cover():
    scene = rz.Scene(rz.Mesh(QUAD, [(0, 1, 2, 3)]), camera=FRONT)
    frame = rz.render(scene, SIZE, outputs="rgb", edges="silhouette", edge_width=5, edge_color="#204060")
    _, coverage = overlay(scene, "silhouette", edge_width=5)
    outside = (coverage > 0) & (rz.render(scene, SIZE, outputs="rgb").alpha == 0)
    assert outside.sum() > 50 and np.abs(frame.alpha[outside] - coverage[outside]).max() <= 0.5001 / 255
    assert (frame.rgb[outside] == (0x20, 0x40, 0x60)).all()
    white = rz.render(replace(scene, background="white"), SIZE, outputs="rgb", edges="silhouette")
    assert (white.alpha == 1).all()


def test_exposure_and_range_leave_the_strokes_colour():
    scene = scene_of(cube())
    for options in ({"exposure": 5.0}, {"exposure": 5.0, "color_range": "global"}, {"color_range": "local"}):
        frame = rz.render(scene, SIZE, outputs="rgb", edges="crease", edge_width=3, edge_color="lime", **options)
        full = overlay(scene, "crease", edge_width=3)[1] == 1
        assert (frame.rgb[full] == (0, 255, 0)).all() and full.sum() > 50


def test_the_unit_of_the_scene_does_not_matter():
    found = []
    for unit in (1.0, 2.0**-30, 2.0**20):
        camera = rz.Camera.perspective(np.array((2.5, 2.0, 3.5)) * unit, np.array((0, -0.2, 0)) * unit, fov=50)
        meshes = [replace(mesh, vertices=mesh.vertices * unit) for mesh in (cube(), floor())]
        found.append(overlay(rz.Scene(meshes, camera=camera))[1])
    assert all(np.array_equal(found[0], other) for other in found[1:])


def test_culled_faces_have_no_edges_of_their_own():
    inside = scene_of(rz.Mesh(cube().vertices, cube().faces[:, ::-1]))
    _, coverage = overlay(inside, "crease", cull="back")
    shares = [
        coverage[pixel_of(np.array((-1, -1, -1)) + t * np.array((2, 0, 0)), inside)] for t in np.linspace(0, 1, 9)
    ]
    assert min(shares) > 0  # the far edges are seen through the front, which is left out


def test_edges_of_several_kinds_are_their_union():
    scene = scene_of(cube(), floor())
    shares = {kind: overlay(scene, kind)[1] for kind in ("wire", "crease", "silhouette", "all")}
    assert np.array_equal(shares["all"], shares["wire"])
    both = overlay(scene, ("silhouette", "crease"))[1]
    assert (both >= np.maximum(shares["silhouette"], shares["crease"])).all() and (both <= shares["all"]).all()


def test_a_view_without_edges_is_left_alone():
    scene = replace(scene_of(cube()), camera=rz.Camera.perspective((0, 0, 9), (0, 0, 20)))
    frame = rz.render(scene, 16, outputs="rgb", edges="all")
    assert not frame.rgba.any()


def test_a_picture_with_edges_may_be_written_as_any_file(tmp_path):
    with rz.Renderer(scene_of(cube()), SIZE, edges="all", outputs="rgb", samples=4) as renderer:
        frame = renderer.render()
        renderer.render_to(tmp_path / "a.tif")
        frame.save(tmp_path / "b.tif")
        out = np.empty((SIZE[1], SIZE[0], 4), np.uint8)
        assert np.array_equal(renderer.render(out=out).rgba, frame.rgba)
    assert (tmp_path / "a.tif").read_bytes() == (tmp_path / "b.tif").read_bytes()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"edges": "outline"}, "edges must be one of wire, crease, silhouette, all; given 'outline'"),
        ({"edges": ("wire", 3)}, "edges must be one of"),
        ({"edges": 3}, "edges must be one or several of"),
        ({"edge_width": 0}, "edge_width must be above 0 to 256 px; given 0"),
        ({"edge_width": 257}, "edge_width must be above 0"),
        ({"edge_width": "thick"}, "edge_width"),
        ({"edge_color": "blurple"}, "blurple"),
    ],
)
def test_what_is_no_edge_is_refused(given, message):
    with pytest.raises(rz.SceneError, match=message):
        Options(**given)


def test_none_and_nothing_are_no_edges():
    assert Options(edges=None).edges == Options(edges=()).edges == Options().edges == ()
    assert Options(edges=["silhouette", "wire", "wire"]).edges == ("wire", "silhouette")
    assert Options(edges="all").edges == ("wire", "crease", "silhouette")
