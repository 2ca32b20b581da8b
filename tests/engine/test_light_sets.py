"""Check which lights a plan leaves out, for which materials, and which it adds up: by points in the boxes of meshes."""

import numpy as np
from helpers.arrays import deviations, differences
from helpers.pinhole import SHADINGS, octasphere, unit

import rasterizer as rz
from rasterizer.engine.light_sets import MOST_CELLS, all_lights, compute_reach, divide_boxes, measure_cones
from rasterizer.engine.plan import list_lights
from rasterizer.engine.reach import NormalCones
from rasterizer.geometry.points import gather_geometry

SIZE = (40, 30)
CAMERA = rz.Camera.perspective((1, 2, 9), (0, 0, 0), fov=40)
SUN = rz.DirectionalLight((0.2, -0.5, -1), 0.4)


def lamps(rng, n, reach):
    return tuple(rz.PointLight(rng.uniform(-4, 4, 3), 0.5, range=reach) for _ in range(n))


def boxes_of(rng, n):
    centers, sizes = rng.uniform(-4, 4, (n, 1, 3)), rng.uniform(0.0, 2.0, (n, 1, 3)) * (rng.random((n, 1, 3)) < 0.8)
    return np.concatenate([centers - sizes / 2, centers + sizes / 2], axis=1)


def test_no_point_has_more_light_than_the_largest_sum():
    rng = np.random.default_rng(2)
    for _ in range(20):
        lights, bounds = (SUN, *lamps(rng, 7, float(rng.uniform(0.5, 3)))), boxes_of(rng, 6)
        numbers = [np.array(sorted(rng.choice(4, rng.integers(1, 3), replace=False))) for _ in bounds]
        numbers[0] = np.arange(4)
        sets = compute_reach(lights, bounds, numbers).sets
        values = rng.random((4, len(lights)))
        sums = sets.largest_sums(values)
        assert not differences(sums <= values.sum(axis=1) + 1e-12, True) and sets.reaches.shape == values.shape
        for (low, high), of_mesh in zip(bounds, numbers, strict=True):
            points = rng.uniform(low, high, (200, 3))
            away = np.array([np.linalg.norm(points - light.position, axis=1) / light.range for light in lights[1:]])
            arrives = np.vstack([np.ones(len(points), bool), away < 1.0])
            for material in of_mesh:
                most = (values[material][:, None] * arrives).sum(axis=0).max()
                assert most <= sums[material] + 1e-12, f"{most:.4g} > {sums[material]:.4g}"
                assert not differences(sets.reaches[material] | ~arrives.any(axis=1), True)


def test_lights_that_reach_no_point_together_are_not_added_up():
    """A row of lamps over a long floor: two of them at most meet."""
    lights = tuple(rz.PointLight((x, 1.0, 0.0), range=2.0) for x in range(-9, 10, 3))
    floor = np.array([[[-10.0, 0, -1], [10.0, 0, 1]]])
    sets = compute_reach(lights, floor, [np.array([0])]).sets
    assert not differences(sets.reaches, True) and not sets.is_whole
    assert sets.largest_sums(np.ones((1, len(lights))))[0] == sets.most_together == 2


def test_without_ends_all_lights_count():
    sets = compute_reach(
        (SUN, rz.PointLight((0, 0, 0))), boxes_of(np.random.default_rng(1), 3), [np.array([0])] * 3
    ).sets
    assert sets.is_whole and not differences(sets.reaches, True) and sets.most_together == 2
    carried = rz.PointLight((50, 0, 0), range=1.0, attached="camera")
    box, short = np.array([[[0, 0, 0], [1, 1, 1.0]]]), rz.PointLight((9, 0, 0), range=1.0)
    assert not differences(compute_reach((carried,), box, [np.array([0])]).sets.reaches, True)
    assert compute_reach((carried, short), box, [np.array([0])]).sets.reaches.tolist() == [[True, False]]


def test_what_counts_is_never_infinite_for_what_is_not_reached():
    sets = all_lights(1, 2)._replace(sets=np.array([[True, False], [False, True]]), is_whole=False)
    assert sets.largest_sums(np.array([[3.0, 2.0]]))[0] == 3.0
    dark = sets._replace(sets=np.array([[True, False]]))
    assert dark.largest_sums(np.array([[3.0, np.inf]]))[0] == 3.0


def test_cells_fill_their_boxes():
    rng = np.random.default_rng(6)
    for n in (1, 5, 300, 5000):
        bounds = boxes_of(rng, n)
        cells, box = divide_boxes(bounds, MOST_CELLS)
        assert len(cells) <= max(MOST_CELLS, n) and len(np.unique(box)) == n
        sizes = (cells[:, 1] - cells[:, 0]).prod(axis=1)
        whole = (bounds[:, 1] - bounds[:, 0]).prod(axis=1)
        assert not deviations(np.bincount(box, sizes), whole, rtol=1e-09)
        assert not differences(np.array([cells[box == k, 0].min(axis=0) for k in range(min(n, 5))]), bounds[:5, 0])
        assert not differences(np.array([cells[box == k, 1].max(axis=0) for k in range(min(n, 5))]), bounds[:5, 1])


def test_what_is_known_of_a_scene_ends_where_rounding_grows():
    lamp, box = rz.PointLight((0, 0, 5), range=1.0), np.array([[[-1.0, -1, -1], [1, 1, 1]]])
    reach = compute_reach((lamp,), box, [np.array([0])])
    assert not differences(reach.sets.reaches, 0)
    assert reach.holds_in(3000.0, 1e-4) and not reach.holds_in(4000.0, 1e-4) and not reach.holds_in(20.0, 0.5)


# ---------------------------------------------------------------- pictures


def balls(*materials):
    vertices, faces = octasphere(2)
    places = np.linspace(-2.5, 2.5, len(materials))
    return [
        rz.Mesh(0.7 * vertices + (x, 0, 0), faces, material=material, crease_angle=180)
        for x, material in zip(places, materials, strict=True)
    ]


def test_a_plan_leaves_out_what_reaches_nothing():
    """Of shadows, colours and float64, too: a picture with such lights is one without them."""
    meshes = balls(rz.Material(shininess=9), rz.Material(diffuse=0.5))
    away = (
        rz.PointLight((0, 20, 0), (1, 0, 0), range=3.0, shadow=True),
        rz.SpotLight((0, 4, 0), (0, 1, 0), (0, 1, 0), 10, 20, shadow=True),
        rz.PointLight((0, 0, 1e20), range=1e10),
        rz.DirectionalLight((0, 0, -1), 0),
    )
    scenes = [rz.Scene(meshes, (SUN, *more), CAMERA) for more in ((), away)]
    for shading in SHADINGS:
        frames = [rz.render(scene, SIZE, shading=shading, samples=1) for scene in scenes]
        assert (frames[0].color == frames[1].color).all() and (frames[0].rgba == frames[1].rgba).all(), shading
        plans = [frame.stats.plan for frame in frames]
        assert plans[1].left_out == 4 and "left out: 4 lights" in repr(plans[1]) and plans[0].left_out == 0
        assert plans[1]._replace(left_out=0) == plans[0] and frames[0].stats.error_bound == frames[1].stats.error_bound


def test_a_light_counts_for_the_materials_that_it_reaches():
    """A red lamp at one ball: the other one keeps its channel."""
    meshes = balls(rz.Material(diffuse=0.8), rz.Material(diffuse=0.5))
    lamp = rz.PointLight((-2.5, 0, 2), (0.8, 0.1, 0.1), range=2.0)
    frame = rz.render(rz.Scene(meshes, (SUN, lamp), CAMERA), SIZE, shading="phong", samples=1)
    needs = {numbers: need for need in frame.stats.plan.needs for numbers in need.materials}
    assert (needs[0].lights, needs[0].channels) == (2, 3) and (needs[1].lights, needs[1].channels) == (1, 1)
    exact = rz.render(rz.Scene(meshes, (SUN, lamp), CAMERA), SIZE, shading="phong", tolerance=0, samples=1)
    assert np.abs(frame.color - exact.color).max() <= frame.stats.error_bound + exact.stats.error_bound


def test_far_views_leave_nothing_out_and_show_the_same():
    meshes, lamp = balls(rz.Material(diffuse=0.8)), rz.PointLight((0, 9, 0), 5.0, range=7.0)
    with rz.Renderer(rz.Scene(meshes, (SUN, lamp), CAMERA), SIZE, samples=1) as renderer:
        assert renderer.render().stats.plan.left_out == 1
        far = rz.Camera.perspective((0, 0, 1e6), fov=1e-4)
        assert renderer.render(far).stats.plan.left_out == 0
        assert renderer.render().stats.plan.left_out == 1


def test_lights_behind_what_is_seen_from_one_side_are_left_out():
    square = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    mesh = rz.Mesh(square, [[0, 1, 2], [0, 2, 3]], material=rz.Material(shininess=9))
    behind, camera = rz.DirectionalLight((0.5, 0.2, 1)), rz.Camera.perspective((0, 0, 4))
    scene = rz.Scene([mesh], (SUN, behind), camera)
    for shading in SHADINGS:
        plan = rz.render(scene, SIZE, shading=shading, cull="back", tolerance=0, samples=1).stats.plan
        assert plan.left_out == (shading in ("gouraud", "phong")), shading
    assert rz.render(scene, SIZE, samples=1).stats.plan.left_out == 0, "both sides may be seen"


def test_cones_hold_the_normals_of_each_mesh():
    rng = np.random.default_rng(9)
    normals = unit(np.array([0, 0, 1.0]) + 0.3 * rng.normal(size=(4, 3)))
    square = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    sheet = rz.Mesh(square, [[0, 1, 2], [0, 2, 3]], normals=normals)
    turned = rz.Mesh(square, [[0, 1, 2], [0, 2, 3]], normals=-normals)
    ball = rz.Mesh(*octasphere(2), crease_angle=180)
    scene = rz.Scene([ball, sheet, turned], [SUN], CAMERA)
    cones = measure_cones(gather_geometry(scene, False), [mesh.n_face for mesh in scene.meshes])
    assert isinstance(cones, NormalCones) and cones.cosines[0] == -1.0, "a ball's normals look anywhere"
    assert not differences(normals @ cones.axes[1] >= cones.cosines[1], True) and cones.cosines[1] > 0.5
    assert cones.cosines[2] == -1.0, "these look against the winding"


def test_black_lights_are_no_part_of_the_list():
    black = rz.PointLight((0, 0, 0), 0)
    assert list_lights(rz.Scene(balls(rz.Material()), (SUN, black, rz.AmbientLight(0.1)), CAMERA)) == ((SUN,), 1)
