"""Check the look-up of shadows: against a naive one, float32 against float64, and whatever the numbers are."""

import ctypes
from dataclasses import replace

import numpy as np
import pytest
from helpers.arrays import differences
from helpers.batches import axes_of, call, read, write
from helpers.pinhole import octasphere, unit

import rasterizer as rz
from rasterizer.cores import Workers
from rasterizer.engine.plan import make_plan
from rasterizer.engine.points import gather_geometry
from rasterizer.engine.scene_tables import SceneTables
from rasterizer.engine.shadow_maps import Shadows
from rasterizer.geometry.surfaces import compute_shapes
from rasterizer.pipeline import fragments as f
from rasterizer.pipeline import shadow_lookup as lookup
from rasterizer.pipeline.workspace import WorkspacePool
from rasterizer.scene.camera import View

GIVEN = (*axes_of(f.POSITION), *axes_of(f.NORMAL), *axes_of(f.FACE_NORMAL), int(f.FACE_OFFSET), int(f.FACE_SIDE))
KINDS = ("directional", "point", "cube", "spot")
N_POINT = 2048


def random_scene(rng, kind, texels, taps):
    """Some triangles over a floor, a ball, and a light of a kind."""
    floor = rz.Mesh([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], [[0, 1, 2, 3]])
    ball = rz.Mesh(octasphere(2)[0] * 0.4 + (0, 0, 0.8), octasphere(2)[1])
    soup = rz.Mesh(rng.uniform((-1.5, -1.5, 0.1), (1.5, 1.5, 1.2), (30, 3)), np.arange(30).reshape(10, 3))
    shadow, down = rz.Shadow(texels, taps), rng.uniform((-1, -1, -1), (1, 1, -0.3))
    light = {
        "directional": lambda: rz.DirectionalLight(down, shadow=shadow),
        "point": lambda: rz.PointLight(-6 * unit(down), shadow=shadow),
        "cube": lambda: rz.PointLight(rng.uniform((-1, -1, 0.3), (1, 1, 1)), shadow=shadow),
        "spot": lambda: rz.SpotLight(-4 * unit(down), down, outer=30, shadow=shadow),
    }[kind]()
    return rz.Scene([floor, ball, soup], light)


class Points:
    """Random points of a scene's surfaces, as the eye sees them, and the shadows of its light in both types."""

    def __init__(self, rng, scene, distance):
        geometry = gather_geometry(scene.meshes, False)
        bounds = np.stack([mesh.bounds for mesh in scene.meshes])
        view = View(distance * unit(rng.normal(size=3)), *np.eye(3))
        self.maps, self.blocks = [], []
        for tolerance in (rz.Options().tolerance, 0.0):
            options = rz.Options(shading="phong", tolerance=tolerance)
            plan = make_plan(SceneTables(scene, options), options)
            shadows = Shadows(geometry, bounds, plan)
            self.maps.append(shadows.draw(plan, view, plan.dtype, WorkspacePool(), Workers(1))[0])
            self.blocks.append(self.maps[-1].block)
            if tolerance > 0:
                ((self.shift, _),) = shadows.shifts_in(view)
        face = rng.integers(0, geometry.vertex.shape[1], N_POINT)
        weights = rng.dirichlet((1, 1, 1), N_POINT)
        position = np.einsum("nk,kna->an", weights, geometry.positions[geometry.vertex[:, face]])
        normal = np.einsum("nk,kna->an", weights, geometry.normals[geometry.corner[:, face]])
        shapes = np.empty((geometry.vertex.shape[1], 5))
        compute_shapes(geometry.positions, geometry.vertex, shapes)
        shape = shapes[face]
        position = position - view.eye[:, None]
        away = 1 + rng.uniform(-20, 20, N_POINT) * 2.0**-24  # how far float32 is off along a ray
        normal = normal / np.linalg.norm(normal, axis=0)
        to_light = self.maps[0].origin[:, None] - (position + view.eye[:, None])
        is_parallel = isinstance(scene.lights[0], rz.DirectionalLight)
        if is_parallel:
            to_light = -np.array(scene.lights[0].direction)[:, None] * np.ones(N_POINT)
        plane = shape[:, :3].T
        agreement = (plane * normal).sum(axis=0)
        is_front = agreement * (plane * to_light).sum(axis=0) > 0
        near = np.minimum(shape[:, 4], reach_of(self.blocks[0], -to_light))
        lift = np.linalg.norm(normal - agreement * plane, axis=0) * np.where(is_front, near, shape[:, 4])
        to_light = to_light if is_parallel else to_light - lift * normal
        distance_to_light = np.linalg.norm(to_light, axis=0)
        self.n_dot_l = np.abs((np.where(is_front, plane, normal) * to_light).sum(axis=0) / distance_to_light)
        block = self.blocks[0]
        scale = block[lookup.MAPS + lookup.SCALE_X : lookup.MAPS + lookup.SCALE_Y + 1].min()
        texel = (distance_to_light if block[lookup.IS_PERSPECTIVE] else 1) / scale
        # What the errors of a normal, at the filter's furthest texel, and of a place on the map may change, as a
        # distance along the normal.
        self.turned = block[lookup.NORMAL_ERROR] * texel * (2 + 2.6 / self.n_dot_l)
        self.turned += (block[lookup.MAPS + lookup.SLACK] - 0.5) * texel * 1.5
        offset = shape[:, 3] - shape[:, :3] @ view.eye
        self.rows = np.vstack([position, normal, shape[:, :3].T, offset, shape[:, 4]])
        self.rows_single = np.vstack([position * away, self.rows[3:]])

    def lit(self, is_double, rows):
        """The lit share of points (n,) that rows of GIVEN describe."""
        dtype = np.float64 if is_double else np.float32
        shares, batch, block = [], np.zeros(f.BATCH_SHAPE, dtype), self.blocks[is_double]
        assert block.dtype == dtype
        for start in range(0, rows.shape[1], f.BATCH_SIZE):
            some = rows[:, start : start + f.BATCH_SIZE]
            write(batch, GIVEN, some)
            write(batch, [int(f.STRENGTH)], np.ones((1, some.shape[1])))
            call(lookup.occlude, batch, some.shape[1], block)
            shares.append(read(batch, [int(f.STRENGTH)], some.shape[1])[0])
        return np.concatenate(shares)

    def moved(self, distance):
        """Rows of points that lie somewhere else on their planes, or on planes that lie beside theirs."""
        for way in (np.indices((3, 3, 3)).reshape(3, 27) - 1).T:
            rows = self.rows.copy()
            rows[:3] += distance * way[:, None]
            yield rows
        for sign in (-1, 1):
            rows = self.rows.copy()
            rows[9] += sign * (distance + self.turned)
            yield rows


def reach_of(block, from_light):
    """Twice as far as texels of the filter reach, where a point of (3,) or points of (3, n) lie."""
    away = np.linalg.norm(from_light, axis=0) if block[lookup.IS_PERSPECTIVE] else 1.0
    return block[lookup.MAPS + lookup.FILTER_RANGE] * away


def naive_share(block, row):
    """The lit share of one point, by the definition, in float64; and how near any comparison is."""
    size, taps, is_perspective = (int(block[k]) for k in (lookup.SIZE, lookup.FILTER, lookup.IS_PERSPECTIVE))
    position, normal, plane, offset = row[:3], row[3:6], row[6:9], row[9]
    from_light = position + plane * (offset - plane @ position) - block[lookup.ORIGIN : lookup.ORIGIN + 3]
    rays = from_light if is_perspective else block[lookup.MAPS + lookup.FORWARD : lookup.MAPS + lookup.FORWARD + 3]
    tilt, near, is_front = (
        np.linalg.norm(normal - plane * (plane @ normal)),
        row[10],
        (plane @ rays) * (plane @ normal) < 0,
    )
    if is_front:
        near = min(near, reach_of(block, position - block[lookup.ORIGIN : lookup.ORIGIN + 3]))
    from_light = from_light + normal * tilt * near
    normal = plane * np.sign(plane @ normal) if is_front else normal
    axis, number = int(np.abs(from_light).argmax()), 0
    if block[lookup.N_MAP] == 6:
        number = 2 * axis + (from_light[axis] <= 0)
    view = block[lookup.MAPS + number * lookup.N_MAP_COLUMN :][: lookup.N_MAP_COLUMN]
    if view[lookup.LAYER] < 0:
        return 1.0, np.inf
    texels = block[lookup.HEADER :].reshape(-1, size, size)[int(view[lookup.LAYER])]
    right, up, forward = (view[k : k + 3] for k in (lookup.RIGHT, lookup.UP, lookup.FORWARD))
    scale = np.array([view[lookup.SCALE_X], -view[lookup.SCALE_Y]])
    center = np.array([view[lookup.CENTER_X], view[lookup.CENTER_Y]])
    depth = from_light @ forward
    on_map = center + scale * (np.array([from_light @ right, from_light @ up]) / (depth if is_perspective else 1))
    if is_perspective and (depth <= 0 or from_light @ normal >= 0):
        return 1.0, np.inf
    column, line = np.clip(on_map, taps >> 1, size - 1 - (taps >> 1)).astype(int)

    def value_at(i, j):
        """The value of the point's plane at the centre of a texel."""
        a, b = (np.array([i, j]) + 0.5 - center) / scale
        way = forward + a * right + b * up if is_perspective else forward
        if is_perspective:
            return way @ normal / (from_light @ normal)
        return -((from_light - a * right - b * up) @ normal) / (forward @ normal)

    around = range(-(taps >> 1), (taps >> 1) + 1)
    slack = 0.5 * (abs(value_at(1, 0) - value_at(0, 0)) + abs(value_at(0, 1) - value_at(0, 0)))
    excess = [
        texels[line + j, column + i] - value_at(column + i, line + j) - slack for j in around for i in around
    ]  # fmt: skip
    return np.mean(np.array(excess) <= 0), np.abs(excess).min()


@pytest.mark.parametrize(
    "kind, texels, taps", [("directional", 33, 9), ("point", 50, 3), ("cube", 64, 1), ("cube", 50, 3), ("spot", 64, 1)]
)
def test_a_share_is_that_of_a_naive_look_up(kind, texels, taps):
    rng = np.random.default_rng([7, KINDS.index(kind), texels])
    points = Points(rng, random_scene(rng, kind, texels, taps), 4.0)
    found = points.lit(True, points.rows)
    n_sure = 0
    for k in range(250):
        share, nearness = naive_share(points.blocks[True], points.rows[:, k])
        if nearness > 1e-6:  # further from a decision than any rounding
            assert abs(found[k] - share) < 1e-12, f"point {k}: {found[k]} instead of {share}"
            n_sure += 1
    assert n_sure > 200 and 0 < found[:250].mean() < 1


@pytest.mark.parametrize(
    "kind, taps, dtype", [("directional", 1, np.float32), ("cube", 3, np.float32), ("spot", 9, np.float64)]
)
def test_no_number_leads_out_of_a_map(kind, taps, dtype):
    """Run by Python, which checks every index; the compiled function returns the same."""
    rng = np.random.default_rng(5)
    points = Points(rng, random_scene(rng, kind, 16, taps), 4.0)
    block = points.blocks[dtype == np.float64]
    wild = np.array([0, -0.0, 1, -1, 1e-30, 1e30, -1e30, np.inf, -np.inf, np.nan, 3e38, 1e-45])
    n = 128
    batch = np.zeros(f.BATCH_SHAPE, dtype)
    rows = np.where(rng.random((11, n)) < 0.3, rng.choice(wild, (11, n)), points.rows[:, :n])
    with np.errstate(all="ignore"):
        write(batch, GIVEN, rows.astype(dtype))
    write(batch, [int(f.STRENGTH)], np.ones((1, n)))
    compiled = batch.copy()
    call(lookup.occlude, compiled, n, block)
    pointer = ctypes.POINTER(np.ctypeslib.as_ctypes_type(dtype))
    with np.errstate(all="ignore"):
        lookup.occlude(batch.ctypes.data_as(pointer), n, block.ctypes.data_as(pointer))
    share, expected = (read(each, [int(f.STRENGTH)], n)[0] for each in (compiled, batch))
    assert not differences(share, expected) and not differences((share >= 0) & (share <= 1), True)


def test_a_light_behind_its_surface_is_not_held_up():
    """A point light under the floor that looks at it from below: its own shadow is that of N·L."""
    rng = np.random.default_rng(1)
    scene = random_scene(rng, "point", 64, 1)
    scene = replace(scene, meshes=scene.meshes[:1], lights=(replace(scene.lights[0], position=(0.3, 0.2, -3)),))
    points = Points(rng, scene, 5.0)
    for is_double in (False, True):
        n_dark = (points.lit(is_double, points.rows) != 1).sum()
        assert n_dark == 0, f"{n_dark} points in shadow, {is_double=}"
