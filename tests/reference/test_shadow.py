"""Check the reference's shadows: edges at places found by hand, what casts none, and rays against triangles."""

import numpy as np
import pytest
from helpers.arrays import deviations, differences
from helpers.pinhole import DULL, QUAD, layer, sheet_camera, unit

from rasterizer.reference import render
from rasterizer.reference.shadow import NO_OWNER, gather_casters, reaches
from rasterizer.scene.lights import AreaLight, DirectionalLight, PointLight, SpotLight
from rasterizer.scene.material import Material
from rasterizer.scene.mesh import Mesh
from rasterizer.scene.scene import Scene
from rasterizer.scene.texture import Texture

SIZE = (64, 48)
SLAB = [[0, 1, 2], [0, 2, 3]]


def floor_and_slab(size=SIZE, **slab):
    """A floor at depth 20, seen along its normal by `sheet_camera`, and a slab 4 over it with x and y within -6..6.

    It is one unit a pixel; the slab is seen where it is, and its shadow beside it.
    """
    corners = np.array([(-6, -6, -16.0), (6, -6, -16), (6, 6, -16), (-6, 6, -16)])
    floor = Mesh(np.array(layer(size, 20.0, is_perspective=False)), QUAD, material=DULL)
    return [floor, Mesh(corners, SLAB, **({"material": DULL} | slab))]


def floor_samples(picture, size=SIZE):
    """Where the floor is seen, and the x and y of every pixel."""
    x, y = np.meshgrid(np.arange(size[0]) + 0.5 - size[0] / 2, size[1] / 2 - np.arange(size[1]) - 0.5)
    return picture.face < 2, x, y


def show(meshes, lights, shading="phong", **options):
    scene = Scene(meshes, lights=lights, camera=sheet_camera(SIZE[1]))
    return render(scene, SIZE, shading=shading, **options)


# ── edges ───────────────────────────────────────────────────────────────────────────────────────────────


def test_a_directional_light_moves_the_outline():
    # over 4 units of depth the light goes 8 to the right and 2 down
    direction = np.array((2.0, -0.5, -1.0))
    picture = show(floor_and_slab(), DirectionalLight(direction, shadow=True))
    is_floor, x, y = floor_samples(picture)
    is_dark = (np.abs(x - 8) < 6) & (np.abs(y + 2) < 6)
    lit = 0.7 * unit(direction) @ (0, 0, -1)
    assert (is_dark & is_floor).sum() > 50
    expected = np.where(is_dark & is_floor, 0, lit)
    np.testing.assert_allclose(picture.color, np.repeat(expected[..., None], 3, axis=-1), atol=1e-12)
    assert show(floor_and_slab(), DirectionalLight(direction)).color.min() > 0


@pytest.mark.parametrize("kind", ["point", "spot", "camera"])
def test_a_light_with_a_place_magnifies_the_outline(kind):
    # 12 over the floor and so 8 over the slab: the shadow is 12/8 as large as the slab, seen from the light's foot
    # (-10, 3.1)
    place = np.array((-10.0, 3.1, -8.0))
    light = {
        "point": PointLight(place, shadow=True),
        "spot": SpotLight(place, (10, -3, -12), outer=90, inner=90, shadow=True),
        "camera": PointLight(place, shadow=True, attached="camera"),  # which stands in the origin, and looks down -z
    }[kind]
    picture = show(floor_and_slab(), light)
    bare = show(
        floor_and_slab(), PointLight(place) if kind != "spot" else SpotLight(place, (10, -3, -12), outer=90, inner=90)
    )
    is_floor, x, y = floor_samples(picture)
    is_dark = (np.abs(x + 10 - 1.5 * 10) < 1.5 * 6) & (np.abs(y - 3.1 + 1.5 * 3.1) < 1.5 * 6) & is_floor
    assert is_dark.sum() > 100 and bare.color[is_dark].min() > 0
    np.testing.assert_array_equal(picture.color, np.where(is_dark[..., None], 0, bare.color))


def test_an_area_light_has_a_penumbra():
    # two cells at x = 0 ± 3 over the slab's right edge
    light = AreaLight((0, -1, -8.0), (12, 0, 0), (0, 2, 0), resolution=(2, 1), shadow=True)
    parts = [PointLight((x, 0, -8.0), 0.5, shadow=True) for x in (3, 9)]
    whole = show(floor_and_slab(), light).color
    np.testing.assert_allclose(whole, sum(show(floor_and_slab(), part).color for part in parts), atol=1e-15)
    assert (whole == 0).any()


def test_what_is_not_opaque_casts_no_shadow():
    light = DirectionalLight((2, 0, -1), shadow=True)
    holes = Texture(np.array([[[1, 1, 1, 0.5]]], np.float32))
    for material in (Material(opacity=0.99), Material(texture=holes)):
        picture = show(floor_and_slab(material=material, uv=np.zeros((4, 2))), light)
        is_floor, _, _ = floor_samples(picture)
        assert picture.color[is_floor].min() > 0
    solid = Texture(np.ones((1, 1, 3), np.float32))
    assert (show(floor_and_slab(material=Material(texture=solid), uv=np.zeros((4, 2))), light).color == 0).any()


# ── where the equation is evaluated ─────────────────────────────────────────────────────────────────────


def test_flat_and_gouraud_ask_at_centroids_and_vertices():
    # the shadow of the slab, x within 2..14 and y within -6..6, holds one vertex of the sheet: (8, 0, -20)
    sheet = np.array([(-30, -20, -20.0), (-30, 20, -20), (8, 0, -20)])
    light = DirectionalLight((2, 0, -1), shadow=True)
    cosine = 0.7 / np.sqrt(5)
    slab = floor_and_slab()[1]
    meshes = [Mesh(sheet, [[0, 2, 1]], material=DULL), slab]
    flat = show(meshes, light, "flat")
    assert not deviations(flat.color[flat.face == 0], cosine)  # its centroid (-52/3, 0) lies in the light
    gouraud = show(meshes, light, "gouraud")
    is_sheet, x, _ = floor_samples(gouraud)
    is_sheet = gouraud.face == 0
    np.testing.assert_allclose(gouraud.color[is_sheet, 0], cosine * (8 - x[is_sheet]) / 38, atol=1e-6)


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
