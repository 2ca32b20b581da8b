"""Edges as the fast way draws them, against the reference: the same shares of the same samples."""

import numpy as np
import pytest
from helpers.edge_scenes import KINDS, fast_coverage, random_camera, random_options, slow_coverage
from helpers.small_scenes import cube

import rasterizer as rz
from rasterizer import reference

SIZE = (64, 48)
FRONT = rz.Camera.orthographic((0, 0, 5), (0, 0, 0), height=4.0)
# Shares of samples are those of the reference to rounding, in float32. Where depths decide, one of both may come out on
# the other side by rounding: few samples.
EXACT, FEW = 1e-6, 0.0005


def check_edges(kind, seed):
    """Draw a random scene of a kind in both ways."""
    rng = np.random.default_rng((seed, *kind.encode()))
    scene, settings = rz.Scene(KINDS[kind](rng), camera=random_camera(rng)), random_options(rng)
    settings["samples"] = (1, 4, 9, 16)[rng.integers(4)]
    fast, slow = fast_coverage(scene, SIZE, threads=1, **settings), slow_coverage(scene, SIZE, **settings)
    n_off = (np.abs(fast - slow) > EXACT).sum()
    assert n_off <= FEW * fast.size, f"{kind}, seed {seed}, {settings}: {n_off} pixels"


@pytest.mark.parametrize("kind", KINDS)
def test_edges_are_those_of_the_reference(kind):
    for seed in range(4):
        check_edges(kind, seed)


@pytest.mark.nightly
@pytest.mark.parametrize("kind", KINDS)
def test_many_edges_are_those_of_the_reference(kind):
    for seed in range(4, 16):
        check_edges(kind, seed)


@pytest.mark.parametrize("samples, background, color_range", [
    (1, None, "global"), (4, "orange", "clamp"), (16, None, "clamp"), (1, "orange", "global"),
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


@pytest.mark.parametrize("is_perspective", [True, False])
def test_what_the_near_plane_cuts_off_hides_nothing_and_its_cut_is_no_edge(is_perspective):
    """A sheet comes out of the near plane, in front of an edge of another one."""
    sheet = rz.Mesh([(-9, -1, 4.5), (9, -1, 4.5), (9, 1, 0), (-9, 1, 0)], [(0, 1, 2, 3)])
    edge = rz.Mesh([(-1.0, -1.2, -1), (1.0, -1.2, -1), (0.0, 1.8, -1)], [(0, 1, 2)])
    camera = rz.Camera.perspective((0, 0, 5), fov=40, near=2.5)
    camera = camera if is_perspective else rz.Camera.orthographic((0, 0, 5), height=4.0, near=2.5)
    fast, slow = both([sheet, edge], camera, edges="wire", edge_width=4)
    assert np.abs(fast - slow).max() <= EXACT and slow.sum() > 100
    depth = rz.render(rz.Scene([sheet, edge], camera=camera), SIZE, outputs="depth").depth
    cut = np.abs(depth - 2.5) < 0.2
    assert cut.sum() > 50 and (fast[cut] > 0).sum() <= 2 * (4 + 2), "two edges that it hides may end at its border"
