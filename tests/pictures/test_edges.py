"""Edges over pictures: which are drawn, where they are hidden, how wide they are, and what they leave alone."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.edge_scenes import fast_coverage
from helpers.small_scenes import cube, floor, scene_of

import rasterizer as rz

SIZE = (120, 90)
QUAD = np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
FRONT = rz.Camera.orthographic((0, 0, 5), (0, 0, 0), height=4.0)


def coverage_of(scene, edges="all", size=SIZE, **options) -> np.ndarray:
    """The share of each pixel that edges cover."""
    return fast_coverage(scene, size, edges=edges, threads=1, **options)


def pixel_of(point, scene, size=SIZE) -> tuple[int, int]:
    """The row and column at which a point of the world is seen."""
    camera = scene.camera_for(size)
    view, projection = camera.view(), camera.projection(size)
    r = np.asarray(point) - view.eye
    w = r @ view.forward if projection.is_perspective else 1.0
    x = projection.center_x + projection.scale_x * (r @ view.right) / w
    return int(np.floor(projection.center_y - projection.scale_y * (r @ view.up) / w)), int(np.floor(x))


def share_near(point, scene, coverage) -> float:
    """The largest share of the pixel at which a point is seen and those around it."""
    row, column = pixel_of(point, scene)
    return coverage[row - 1 : row + 2, column - 1 : column + 2].max()


CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
CUBE_EDGES = [(a, b) for a in CORNERS for b in CORNERS if (a < b).sum() == 1 and (a == b).sum() == 2]


@pytest.mark.parametrize("kind, is_perspective", [("wire", True), ("crease", False)])
def test_nine_edges_of_a_cube_are_seen_and_three_are_hidden(kind, is_perspective):
    scene = scene_of(cube())
    if not is_perspective:
        scene = replace(scene, camera=rz.Camera.orthographic((2.5, 2.0, 3.5), (0, 0, 0), height=4.0))
    mesh = scene.meshes[0]
    quads = replace(mesh, polygons=np.arange(12) // 2)
    coverage = coverage_of(replace(scene, meshes=[quads]), kind)
    n_hidden = 0
    for a, b in CUBE_EDGES:
        is_hidden = (np.minimum(a, b) == -1).all() and ((a == -1).all() or (b == -1).all())
        n_hidden += is_hidden
        shares = [share_near(a + t * (b - a), scene, coverage) for t in np.linspace(0.1, 0.9, 23)]
        is_right = np.mean(np.array(shares) == 0) > 0.7 if is_hidden else min(shares) > 0  # other edges cross it
        assert is_right, f"{a} to {b}: {min(shares)}..{max(shares)}"
    assert n_hidden == 3


def test_the_diagonals_of_polygons_are_no_edges():
    whole, cut = rz.Mesh(QUAD, [(0, 1, 2, 3)]), rz.Mesh(QUAD, [(0, 1, 2), (0, 2, 3)])
    for mesh, has_diagonal in ((whole, False), (cut, True)):
        coverage = coverage_of(rz.Scene(mesh, camera=FRONT), "wire")
        assert (coverage[pixel_of((0.02, 0.02, 0), rz.Scene(mesh, camera=FRONT))] > 0) == has_diagonal
        coverage = coverage_of(rz.Scene(mesh, camera=FRONT), ("crease", "silhouette"))  # it is flat
        assert coverage[pixel_of((0.02, 0.02, 0), rz.Scene(mesh, camera=FRONT))] == 0


@pytest.mark.parametrize("samples", [1, 4, 9, 16])
def test_an_edge_is_as_wide_as_asked_for(samples):
    """On one side of it where nothing is on the other, on both sides else; less wide than a sample, it is fainter."""
    sheet = rz.Mesh(QUAD, [(0, 1, 2, 3)])
    roof = rz.Mesh([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0.01, -1, 1), (0.01, 1, 1)],
                   [(0, 4, 5, 3), (4, 1, 2, 5)])  # fmt: skip
    # The first sample that is covered may lie anywhere within one of a border.
    for mesh, x, error in ((sheet, 1.0, 0.5 / samples**0.5), (roof, 0.01, 0.0)):
        scene = rz.Scene(mesh, camera=FRONT)
        for width in (0.25, 1.0, 1.5, 3.0, 8.0):
            coverage = coverage_of(scene, "wire", edge_width=width, samples=samples)
            row, column = pixel_of((x, 0, 0), scene)
            across = coverage[row, column - 9 : column + 10].sum()
            assert abs(across - width) <= error + 1e-4, f"{across} px instead of {width}"
            assert coverage[row, pixel_of((0.5, 0, 0), scene)[1]] == 0, f"{width} px reach too far"


def test_edges_that_come_from_far_behind_the_eye_are_those_of_nearer_ones():
    """Whichever end comes first, and however near the near plane is: nothing is divided by a depth of 0."""
    camera = rz.Camera(position=(0, 0, 0), target=(0, 0, -1), fov=60.0, near=1e-9)
    ends, way = np.array([(0.3, -0.2, -2.0), (-0.6, 0.1, -3.0)]), np.array([0.2, -0.1, 1.0])
    for turn in range(3):
        found = []
        for reach in (1e7, 1e10):
            corners = np.roll([ends[0] + reach * way, *ends], turn, axis=0)
            found.append(coverage_of(rz.Scene(rz.Mesh(corners, [[0, 1, 2]]), camera=camera), "wire", cull="none"))
        assert found[0].sum() > 10 and np.abs(found[1] - found[0]).max() < 1e-3, turn


def test_the_edge_that_three_leaves_share_is_a_silhouette_from_every_side():
    angles = np.radians([0, 100, 230])
    tips = np.stack([np.cos(angles), np.zeros(3), np.sin(angles)], axis=1)
    vertices = np.concatenate([[(0.0, -1, 0), (0.0, 1, 0)], tips])
    for winding in range(8):
        faces = [(0, 1, 2 + k) if winding >> k & 1 else (1, 0, 2 + k) for k in range(3)]
        for turn in np.radians(range(5, 365, 30)):
            camera = rz.Camera.orthographic((5 * np.cos(turn), 0, 5 * np.sin(turn)), (0, 0, 0), height=4.0)
            scene = rz.Scene(rz.Mesh(vertices, faces), camera=camera)
            assert share_near((0, 0, 0), scene, coverage_of(scene, "silhouette")) > 0, f"{faces}, {turn:.2f} rad"


@pytest.mark.parametrize("shading, samples", [("flat", 1), ("gouraud", 4), ("phong", 4)])
def test_a_picture_changes_where_edges_are_and_nowhere_else(shading, samples):
    scene = scene_of(cube(), floor())
    options = {"shading": shading, "samples": samples, "outputs": ("color", "face")}
    plain, drawn = (rz.render(scene, SIZE, **options, **more) for more in ({}, {"edges": "all", "edge_color": "red"}))
    coverage = coverage_of(scene, shading=shading, samples=samples)
    assert not differences(drawn.rgba[coverage == 0], plain.rgba[coverage == 0])
    assert not differences(drawn.color[coverage == 0], plain.color[coverage == 0])
    assert not differences(drawn.face, plain.face)
    full = coverage > 1 - 1e-6
    assert full.sum() > 10
    assert not differences(drawn.rgba[full], (255, 0, 0, 255))
    assert not differences(drawn.rgba[..., 3], plain.rgba[..., 3])
    assert np.abs(drawn.alpha - plain.alpha).max() <= 1e-7
    part = coverage > 0
    share = (coverage[part] / plain.alpha[part])[:, None]  # of what is covered of the pixel
    expected = np.array([1.0, 0, 0]) * share + plain.color[part] * (1 - share)
    assert np.abs(drawn.color[part] - expected).max() <= 1e-6


@pytest.mark.parametrize("samples", [1, 4, 9, 16])
def test_alpha_is_the_models_coverage(samples):
    options = {"samples": samples, "outputs": ("rgb", "color"), "shading": "phong"}
    scene = scene_of(cube())
    plain, drawn = (rz.render(scene, SIZE, edges=edges, edge_width=5, **options) for edges in (None, "all"))
    assert not differences(drawn.rgba[..., 3], plain.rgba[..., 3])
    assert np.abs(drawn.alpha - plain.alpha).max() <= 1e-7
    assert not differences(drawn.rgba[plain.alpha == 0], 0) and differences(drawn.rgb, plain.rgb)
    white = rz.render(replace(scene, background="white"), SIZE, edges="all", **options)
    assert not differences(white.alpha, 1)
    away = replace(scene, camera=rz.Camera.perspective((0, 0, 9), (0, 0, 20)))
    assert not differences(rz.render(away, 16, outputs="rgb", edges="all").rgba, 0)


def test_edges_of_glass_are_opaque_and_what_lies_behind_glass_has_none():
    glass = rz.Material(opacity=0.25)
    sheet = rz.Mesh(QUAD * 1.5 + (0, 0, 1), [(0, 1, 2, 3)], material=glass)
    scene = rz.Scene([sheet, rz.Mesh(QUAD, [(0, 1, 2, 3)])], camera=FRONT)
    options = {"outputs": "color", "edges": "silhouette", "edge_width": 3, "edge_color": "lime", "samples": 4}
    row, column = pixel_of((1.5, 0, 1), scene)
    for frame, alpha in ((rz.render(scene, SIZE, **options), 0.25),
                         (rz.render(replace(scene, background="white"), SIZE, **options), 1.0)):  # fmt: skip
        assert np.abs(frame.color[row, column - 1] - (0, 1, 0)).max() <= 1e-6 and frame.alpha[row, column - 1] == 1
        assert abs(frame.alpha[row, column - 8] - alpha) <= 1e-6
        inner = pixel_of((1, 0, 0), scene)[1]
        assert not (frame.color[row, inner - 4 : inner + 4] == (0, 1, 0)).all(axis=1).any()


def test_exposure_and_range_leave_the_edges_colour():
    scene = scene_of(cube())
    for options in ({"exposure": 5.0}, {"exposure": 5.0, "color_range": "global"}, {"color_range": "local"}):
        frame = rz.render(scene, SIZE, outputs="rgb", edges="crease", edge_width=3, edge_color="lime", **options)
        full = coverage_of(scene, "crease", edge_width=3, samples=4) > 1 - 1e-6
        assert not differences(frame.rgb[full], (0, 255, 0)) and full.sum() > 50
