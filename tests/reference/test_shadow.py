"""Check the reference's shadows: where it asks for them, what casts none, and rays against triangles."""

import numpy as np
from helpers.arrays import deviations, differences
from helpers.pinhole import DULL, QUAD, sheet_camera

from rasterizer.reference import render
from rasterizer.reference.shadow import NO_OWNER, gather_casters, reaches
from rasterizer.scene.lights import DirectionalLight
from rasterizer.scene.material import Material
from rasterizer.scene.mesh import Mesh
from rasterizer.scene.scene import Scene

# ── where the equation is evaluated, and who casts ──────────────────────────────────────────────────────


def show(caster, shading):
    """A sheet at depth 20, one unit a pixel, and a slab 4 over it: its shadow has x within 2..14 and y within -6..6."""
    sheet = Mesh(np.array([(-30, -20, -20.0), (-30, 20, -20), (8, 0, -20)]), [[0, 2, 1]], material=DULL)
    slab = Mesh(np.array([(-6, -6, -16.0), (6, -6, -16), (6, 6, -16), (-6, 6, -16)]), QUAD, material=caster)
    scene = Scene([sheet, slab], lights=DirectionalLight((2, 0, -1), shadow=True), camera=sheet_camera(48))
    return render(scene, (64, 48), shading=shading)


def test_flat_and_gouraud_ask_at_centroids_and_vertices():
    """The shadow holds one vertex of the sheet, (8, 0, -20), and not its centroid, (-52/3, 0, -20)."""
    cosine, flat, gouraud = 0.7 / np.sqrt(5), show(DULL, "flat"), show(DULL, "gouraud")
    assert not deviations(flat.color[flat.face == 0], cosine)
    rows, columns = np.nonzero(gouraud.face == 0)
    expected = cosine * (8 - (columns + 0.5 - 32)) / 38
    np.testing.assert_allclose(gouraud.color[rows, columns, 0], expected, atol=1e-6)
    clear = show(Material(opacity=0.99), "gouraud")
    assert not deviations(clear.color[clear.face == 0], cosine)  # what is not opaque casts none


# ── rays ────────────────────────────────────────────────────────────────────────────────────────────────


def test_no_ray_slips_through_between_faces():
    # rays exactly at the edges and vertices of a sheet whose coordinates are rounded
    rng = np.random.default_rng(4)
    x, y = np.meshgrid(np.arange(9.0), np.arange(9.0))
    grid = np.stack([x, y, 0.3 * rng.random((9, 9))], axis=-1) + 0.2 * rng.random((9, 9, 3))
    a, b, c, d = (grid[i : i + 8, j : j + 8].reshape(-1, 3) for i, j in ((0, 0), (0, 1), (1, 1), (1, 0)))
    corners = np.concatenate([np.stack(t, axis=1) for t in ((a, b, c), (a, c, d))])
    casters = gather_casters(corners, np.arange(len(corners)), np.ones(len(corners), bool))
    inner = grid[1:8, 1:8].reshape(-1, 3)
    t = rng.random((len(a), 1))
    goals = np.concatenate([inner, (a + c)[9:55] / 2, (t * a + (1 - t) * c)[9:55]])
    is_inside = (goals[:, :2] > 1.3).all(axis=1) & (goals[:, :2] < 7).all(axis=1)
    goals = goals[is_inside]
    starts = goals + rng.normal(size=goals.shape) * 0.1 + (0.3, 0.1, -3)
    owner = np.full(len(starts), NO_OWNER)
    assert len(goals) > 60
    assert not differences(reaches(casters, starts, owner, 2 * (goals - starts), True), 0)
    assert not differences(reaches(casters, starts, owner, goals - starts, False), 0)
    assert not differences(reaches(casters, starts, owner, 0.5 * (goals - starts), True), True)
    assert not differences(reaches(casters, starts, owner, starts - goals, False), True)


def test_rays_by_hand():
    corners = np.array([[(0, 0, 0), (4, 0, 0), (0, 4, 0)]], float)
    casters = gather_casters(corners, np.array([7]), np.array([True]))
    up, inside, outside = (0, 0, 2.0), (1, 1, -1.0), (3, 3, -1.0)

    def is_lit(point, to_light, is_finite=True, owner=NO_OWNER):
        return bool(
            reaches(casters, np.array([point], float), np.array([owner]), np.array([to_light], float), is_finite)[0]
        )

    assert not is_lit(inside, up) and not is_lit((1, 1, 1), (0, 0, -2.0))
    assert is_lit(outside, up) and is_lit(inside, (0, 0, 0.5)) and is_lit((1, 1, 1), up)
    assert not is_lit(inside, (0, 0, 0.5), is_finite=False) and is_lit((1, 1, 1), up, is_finite=False)
    assert is_lit(inside, up, owner=7) and not is_lit(inside, up, owner=6)
    # a light or a point on the face's plane isn't behind it, whichever way rounding moved it
    for tiny in (0.0, 1e-15, -1e-15):
        assert is_lit(inside, (0, 0, 1 + tiny)) and is_lit((1, 1, tiny), up) and is_lit((1, 1, tiny), (0, 0, -1), False)
    assert is_lit((1, 1, 0), (0, 1, 0)) and is_lit((-1, 1, 0), (5, 0, 0))
