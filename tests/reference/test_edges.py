"""Edges as the fast way draws them, against the reference: the same strokes, hidden at the same points."""

import numpy as np
import pytest
from helpers.edge_scenes import KINDS, fast_coverage, random_camera, random_options, slow_coverage
from helpers.small_scenes import cube

import rasterizer as rz
from rasterizer import reference
from rasterizer.reference.edges import list_edges

SIZE = (64, 48)
FRONT = rz.Camera.orthographic((0, 0, 5), (0, 0, 0), height=4.0)
# The fast way decides every half sample along an edge, and asks the triangles that samples next to it show. So strokes
# end up to a quarter of a pixel further or earlier, and triangles that no sample sees hide nothing.
BUDGET, OF_FINE = 0.01, 0.025  # of the covered area; with triangles smaller than pixels
ENDS = 1.5  # px, what a wide stroke's end may differ by


def check_strokes(kind, seed):
    """Draw a random scene of a kind in both ways."""
    rng = np.random.default_rng((seed, *kind.encode()))
    scene, settings = rz.Scene(KINDS[kind](rng), camera=random_camera(rng)), random_options(rng)
    fast, slow = fast_coverage(scene, SIZE, threads=1, **settings), slow_coverage(scene, SIZE, **settings)
    off, budget = np.abs(fast - slow).sum(), ENDS + slow.sum() * (OF_FINE if kind == "sphere" else BUDGET)
    assert off <= budget, f"{kind}, seed {seed}, {settings}: {off:.2f} > {budget:.2f} px"


@pytest.mark.parametrize("kind", KINDS)
def test_strokes_are_those_of_the_reference(kind):
    for seed in range(2):
        check_strokes(kind, seed)


@pytest.mark.nightly
@pytest.mark.parametrize("kind", KINDS)
def test_many_strokes_are_those_of_the_reference(kind):
    for seed in range(4, 16):
        check_strokes(kind, seed)


@pytest.mark.parametrize("samples, background, color_range", [
    (1, None, "global"), (4, "orange", "clamp"), (4, None, "clamp"), (1, "orange", "global"),
])  # fmt: skip
def test_the_picture_under_them_is_mixed_with_their_colour(samples, background, color_range):
    lights = rz.AmbientLight(0.4), rz.DirectionalLight((-1, -2, -3), 1.5)
    scene = rz.Scene(cube(), lights, rz.Camera.perspective((2.5, 2, 3.5), fov=45), background)
    settings = {"samples": samples, "edges": ("crease", "silhouette"), "edge_color": "#3060ff", "edge_width": 2.5}
    settings |= {"shading": "flat", "color_range": color_range}
    frame = rz.render(scene, SIZE, outputs="color", threads=1, **settings)
    expected = reference.render(scene, SIZE, **settings)
    is_far = np.abs(frame.color - expected.color).max(axis=2) > 1e-3
    is_far |= np.abs(frame.alpha - expected.alpha) > 1e-3
    is_far |= np.abs(frame.rgb.astype(int) - expected.rgb).max(axis=2) > 1
    assert is_far.mean() < 0.002, f"{is_far.sum()} pixels"


# --- what was found ------------------------------------------------------------------------------------------------


def both(meshes, camera=FRONT, **settings):
    """The covered shares of both ways."""
    scene = rz.Scene(meshes, camera=camera)
    return fast_coverage(scene, SIZE, threads=1, **settings), slow_coverage(scene, SIZE, **settings)


@pytest.mark.parametrize("side", [(0, -1), (1, 0)])
def test_a_stroke_beside_the_picture_reaches_into_it(side):
    half = np.array([4.0 * SIZE[0] / SIZE[1], 4.0]) / 2 + 2 * 4.0 / SIZE[1]  # two pixels beyond the border
    across = np.array(side, float) * half
    along = np.array(side[::-1], float) * half * 0.7
    vertices = [(*(across - along), 0), (*(across + along), 0), (*(across * 1.5), 0)]
    found = both(rz.Mesh(vertices, [(0, 1, 2)]), edges="wire", edge_width=10)
    for coverage in found:
        assert 0.5 * 3 * 0.7 * min(SIZE) < coverage.sum() < 3 * max(SIZE), "three pixels of it are in the picture"
    assert np.abs(found[0] - found[1]).sum() < ENDS


@pytest.mark.parametrize("is_perspective", [True, False])
def test_what_the_near_plane_cuts_off_hides_nothing(is_perspective):
    """A sheet comes out of the near plane, in front of an edge of another one."""
    sheet = rz.Mesh([(-9, -1, 4.5), (9, -1, 4.5), (9, 1, 0), (-9, 1, 0)], [(0, 1, 2, 3)])
    edge = rz.Mesh([(-1.0, -1.2, -1), (1.0, -1.2, -1), (0.0, 1.8, -1)], [(0, 1, 2)])
    camera = rz.Camera.perspective((0, 0, 5), fov=40, near=2.5)
    camera = camera if is_perspective else rz.Camera.orthographic((0, 0, 5), height=4.0, near=2.5)
    fast, slow = both([sheet, edge], camera, edges="wire", edge_width=8)
    assert np.abs(fast - slow).sum() < 0.01 * slow.sum() and slow.sum() > 300


def test_of_an_edge_that_is_seen_end_on_the_nearer_end_is_drawn():
    for depths in ((1.0, -1.0), (-1.0, 1.0)):
        blade = rz.Mesh([(0, 0, depths[0]), (0, 0, depths[1]), (0, 1.0, 0)], [(0, 1, 2)])
        wall = rz.Mesh([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [(0, 1, 2, 3)])
        fast, slow = both([blade, wall], edges="wire", edge_width=6)
        assert np.abs(fast - slow).max() < 1e-6 and slow[23:25, 31:33].min() > 1 - 1e-6


def test_a_polygon_without_area_is_no_border():
    """A vertex lies on an edge: files fill the gap with a triangle that has no area."""
    for height in (0.0, -1.0):  # flat, or bent along the edge by more than the crease angle
        vertices = [(-1, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 0), (0, -1, height)]
        faces = [(0, 1, 2), (0, 3, 1), (0, 4, 3), (3, 4, 1)]
        edges = list_edges(rz.Mesh(vertices, faces))
        on_line = [edge for edge in edges if not edge.ends[:, 1:].any()]
        assert [edge.is_open for edge in on_line] == [False] * 3
        assert sum(edge.is_crease for edge in on_line) == (0 if height == 0.0 else 2)
        fast, slow = both(rz.Mesh(vertices, faces), edges=("crease", "silhouette"), edge_width=2)
        assert np.abs(fast - slow).sum() < ENDS
        assert (slow[24, 31:33].max() > 0) == (height != 0.0)


def test_a_face_that_folds_onto_an_edge_does_not_open_it():
    """At the pole of a sphere of quads, triangles have two corners at one place."""
    vertices = [(0, 0, 1), (0, 0, 1), (1, 0, 0.9), (0, 1, 0.9), (-1, -1, 0.9)]
    faces = [(0, 2, 3), (0, 3, 1), (1, 3, 4), (0, 4, 2)]
    at_pole = [edge for edge in list_edges(rz.Mesh(vertices, faces)) if edge.ends[:, 2].max() == 1]
    assert [edge.is_open for edge in at_pole] == [False] * 3
    fast, slow = both(rz.Mesh(vertices, faces), edges="crease")
    assert np.abs(fast - slow).sum() < ENDS and slow[24, 32] == 0


def test_a_moebius_strip_has_one_border_and_no_creases():
    (strip,) = KINDS["moebius"](None, 96)  # so many that it bends by little at each
    edges = list_edges(strip)
    assert sum(edge.is_open for edge in edges) == sum(edge.is_crease for edge in edges) == 2 * 96
    assert len(edges) == 4 * 96
